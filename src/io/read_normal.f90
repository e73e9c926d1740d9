!> How pairs press: the keys of the normal laws in group &contact, and what they must be to each
!> other.
module fw_read_normal
   use fw_contact_data, only: contact_type
   use fw_contact_keys, only: bind_normal_law, bind_table
   use fw_kinds, only: wp
   use fw_normal_law, only: exponential, normal_words, pairs_with, power, table, unilateral
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_normal_law, match_normal_dofs, check_normal_laws

contains

   !> The words, one for all pairs or one for each, and the table.
   subroutine read_normal_law(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(inout) :: contact
      integer :: n_file

      call bind_normal_law(reader, contact)
      n_file = contact%n_table
      call bind_table(reader, contact)
      if (reader%failed()) return
      if (.not. any(pairs_with(contact, table))) then
         if (contact%n_table > 0 .and. reader%given('contact', 'n_table')) call reader%refuse( &
            'contact', 'n_table', "has no meaning without normal_law = 'table'")
         return
      end if
      if (contact%n_table == 0) then
         call reader%refuse('contact', 'n_table', "is missing: normal_law = 'table' takes "// &
                            'overclosure and force of n_table points, 2 or more')
      else if (contact%n_table < 2) then
         call reader%refuse('contact', 'n_table', '= '//to_text(contact%n_table)//': must be 2 '// &
                            'or more, from a force of 0 up')
      else if (contact%n_table == n_file .or. allocated(contact%table_force)) then
         call check_table(reader, contact)
      end if
   end subroutine read_normal_law

   !> Overclosures rise, forces rise or stay, and begin with 0.
   subroutine check_table(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      integer :: k

      associate (d => contact%overclosure, p => contact%table_force)
         if (abs(p(1)) > 0.0_wp) call reader%refuse('contact', 'force', '(1) = '// &
            to_text(p(1))//': a table begins where the sides touch; must be 0')
         do k = 2, size(d)
            if (.not. d(k) > d(k - 1)) then
               call reader%refuse('contact', 'overclosure', '('//to_text(k)//') = '// &
                                  to_text(d(k))//': must be above the one before, '// &
                                  to_text(d(k - 1)))
               return
            end if
            if (.not. p(k) >= p(k - 1)) then
               call reader%refuse('contact', 'force', '('//to_text(k)//') = '//to_text(p(k))// &
                                  ': must not be below the one before, '//to_text(p(k - 1)))
               return
            end if
         end do
         if (.not. p(size(p)) > 0.0_wp) call reader%refuse('contact', 'force', &
            '= 0 throughout: the last must be above 0')
      end associate
   end subroutine check_table

   !> Pairs without a normal dof have no normal law; a word for each pair must not say otherwise.
   subroutine match_normal_dofs(reader, has_normal, contact)
      type(reader_type), intent(inout) :: reader
      !> (n_pairs)
      logical, intent(in) :: has_normal(:)
      type(contact_type), intent(inout) :: contact
      integer :: i
      logical :: one_for_all

      if (.not. allocated(contact%normal_law) .or. size(has_normal) == 0) return
      ! Sides that could not be read have no dofs.
      if (reader%failed()) return
      one_for_all = all(contact%normal_law == contact%normal_law(1))
      i = findloc(.not. has_normal .and. contact%normal_law /= unilateral, .true., dim=1)
      if (i > 0 .and. .not. (one_for_all .and. any(has_normal))) then
         call reader%refuse('contact', 'normal_law', "= '"//trim(normal_words( &
                            contact%normal_law(i)))//"' for pair "//to_text(i)//', which has '// &
                            "no normal dof: give one, or 'unilateral'")
         return
      end if
      where (.not. has_normal) contact%normal_law = unilateral
   end subroutine match_normal_dofs

   !> Whether the laws of the pairs know normal laws, and constants have values where pairs take
   !> them.
   subroutine check_normal_laws(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      integer :: i, law

      call check_constant(reader, contact, 'normal_coefficient', power)
      call check_constant(reader, contact, 'normal_exponent', power)
      call check_constant(reader, contact, 'reference_force', exponential)
      call check_constant(reader, contact, 'decay_length', exponential)
      if (contact%normal_per_area .and. all(pairs_with(contact, unilateral))) then
         call reader%refuse('contact', 'normal_per_area', '= .true.: has no meaning with '// &
                            "normal_law = 'unilateral', whose stiffness is that of the pair")
      end if
      do i = 1, contact%n_pairs
         if (.not. allocated(contact%normal_law)) exit
         if (contact%normal_law(i) == unilateral) cycle
         law = contact%law
         if (allocated(contact%law_of)) law = contact%law_of(i)
         if (contact%constants%is_taken(law, 'normal_exponent')) cycle
         call reader%refuse('contact', 'normal_law', "= '"//trim(normal_words( &
                            contact%normal_law(i)))//"' for pair "//to_text(i)//': its law is '// &
                            "rigid; give law = 'penalty' or 'regularised'")
         return
      end do
   end subroutine check_normal_laws

   !> A constant of the pairs of one normal law: above 0 for each of them.
   subroutine check_constant(reader, contact, name, number)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      character(*), intent(in) :: name
      !> Of the normal law.
      integer, intent(in) :: number
      integer :: i

      if (.not. contact%constants%has(name)) return
      if (.not. any(pairs_with(contact, number))) then
         if (reader%given('contact', name)) call reader%refuse('contact', name, 'has no '// &
            "meaning without normal_law = '"//trim(normal_words(number))//"'")
         return
      end if
      i = findloc(pairs_with(contact, number) .and. &
                  contact%constants%get(name, contact%n_pairs) <= 0.0_wp, .true., dim=1)
      if (i > 0) call reader%refuse('contact', name, '= 0 for pair '//to_text(i)//': must be '// &
                                    "above 0 with normal_law = '"//trim(normal_words(number))// &
                                    "'")
   end subroutine check_constant

end module fw_read_normal
