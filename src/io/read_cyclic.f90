!> Group &cyclic on top of what a model file says of its sectors, and the checks of pairs and
!> springs across sectors.
module fw_read_cyclic
   use fw_contact_data, only: contact_type, spring_type
   use fw_elements, only: element_list
   use fw_cyclic_data, only: cyclic_type
   use fw_cyclic_parts, only: cyclic_parts
   use fw_cyclic_keys, only: bind_interfaces, bind_sectors, no_order
   use fw_laws, only: facts_of
   use fw_force_law, only: law_facts
   use fw_read_mistuning, only: read_mistuning
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_cyclic, check_sectors
   ! Read behind them.
   public :: read_mistuning

contains

   subroutine read_cyclic(reader, parts, n_dof, has_wave, cyclic)
      type(reader_type), intent(inout) :: reader
      !> What the model file holds.
      type(cyclic_parts), intent(in) :: parts
      integer, intent(in) :: n_dof
      !> Whether the analysis is of a wave, which has an engine order.
      logical, intent(in) :: has_wave
      type(cyclic_type), intent(inout) :: cyclic
      integer :: n_file, n_interface

      cyclic%is_cyclic = parts%n_sectors > 0 .or. reader%given('cyclic', 'n_sectors') .or. &
                         reader%given('cyclic', 'engine_order') .or. &
                         reader%given('cyclic', 'left')
      cyclic%n_sectors = parts%n_sectors
      cyclic%engine_order = no_order
      call bind_sectors(reader, cyclic, cyclic%is_cyclic .and. parts%n_sectors == 0, &
                        cyclic%is_cyclic .and. has_wave)
      if (parts%n_sectors > 0 .and. cyclic%n_sectors /= parts%n_sectors) then
         call reader%refuse('cyclic', 'n_sectors', '= '//to_text(cyclic%n_sectors)// &
                            ': the model has '//to_text(parts%n_sectors)//'; remove n_sectors')
      end if
      if (cyclic%engine_order == no_order) cyclic%engine_order = 0
      if (cyclic%is_mistuned .and. .not. cyclic%is_cyclic) then
         call reader%refuse('cyclic', 'mistuned', '= .true.: goes with a cyclic structure; '// &
                            'give n_sectors and engine_order, or .false.')
         cyclic%is_mistuned = .false.
      end if
      n_file = 0
      if (allocated(parts%left)) n_file = size(parts%left)
      n_interface = n_file
      if (n_file > 0) then
         cyclic%left = parts%left
         cyclic%right = parts%right
      end if
      call bind_interfaces(reader, cyclic, n_interface, n_file == 0)
      ! As n_pairs and n_springs: sectors would come apart without a word.
      if (n_interface == 0 .and. .not. reader%failed() .and. &
          (reader%given('cyclic', 'left') .or. reader%given('cyclic', 'right'))) then
         call reader%refuse('cyclic', 'n_interface', 'is missing or 0: must be the number of '// &
                            'dofs of an interface, or leave out left and right')
      end if
      if (.not. reader%failed()) call check_interfaces(reader, parts, n_dof, n_file, cyclic)
      if (.not. cyclic%is_cyclic) cyclic%n_sectors = 1
   end subroutine read_cyclic

   !> A dof stands at one place of one interface.
   subroutine check_interfaces(reader, parts, n_dof, n_file, cyclic)
      type(reader_type), intent(inout) :: reader
      type(cyclic_parts), intent(in) :: parts
      integer, intent(in) :: n_dof, n_file
      type(cyclic_type), intent(in) :: cyclic
      integer :: i
      integer :: place(n_dof)

      if (.not. allocated(cyclic%left)) return
      if (size(cyclic%left) == 0) return
      if (.not. cyclic%is_cyclic) then
         call reader%refuse('cyclic', 'left', 'is given without n_sectors: give n_sectors and '// &
                            'engine_order')
         return
      else if (allocated(parts%nodal)) then
         call reader%refuse('cyclic', 'left', 'is given beside matrices of nodal diameters, '// &
                            'which are tied already: remove it')
         return
      end if
      if (n_file > 0 .and. size(cyclic%left) /= n_file) then
         call reader%refuse('cyclic', 'n_interface', '= '//to_text(size(cyclic%left))// &
                            ': the model has '//to_text(n_file)//' dofs on each interface; '// &
                            'remove it')
         return
      end if
      place = 0
      do i = 1, size(cyclic%left)
         if (cyclic%left(i) < 1 .or. cyclic%left(i) > n_dof) then
            call reader%refuse('cyclic', 'left', 'has dof '//to_text(cyclic%left(i))// &
                               ': must be from 1 to '//to_text(n_dof)//' (a sign is turned on '// &
                               'the right)')
            return
         else if (cyclic%right(i) == 0 .or. abs(cyclic%right(i)) > n_dof) then
            call reader%refuse('cyclic', 'right', 'has dof '//to_text(cyclic%right(i))// &
                               ': must be from 1 to '//to_text(n_dof)//' or its negative')
            return
         end if
         place(cyclic%left(i)) = place(cyclic%left(i)) + 1
         place(abs(cyclic%right(i))) = place(abs(cyclic%right(i))) + 1
      end do
      i = findloc(place > 1, .true., 1)
      if (i > 0) call reader%refuse('cyclic', 'left', 'and right have dof '//to_text(i)// &
                                    ' twice: a dof stands once, on one interface')
   end subroutine check_interfaces

   !> Pairs, springs and other elements between sectors.
   subroutine check_sectors(reader, cyclic, contact, springs, elements)
      type(reader_type), intent(inout) :: reader
      type(cyclic_type), intent(in) :: cyclic
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      integer :: c, i, k

      if (reader%failed()) return
      ! Those of all sectors are those of the first.
      do i = 1, contact%n_pairs/contact%n_alike
         call check_element('contact', i, contact%sector_2(i), any(contact%side_2(:, i) /= 0))
      end do
      do i = 1, springs%n_springs/cyclic%n_solved()
         call check_element('spring', i, springs%sector_2(i), springs%side_2(i) /= 0)
      end do
      do k = 1, size(elements%slot)
         associate (group => elements%slot(k)%group)
            do i = 1, group%n_elements
               do c = 1, group%n_in
                  call check_element(trim(group%name()), i, group%row_sector_2(c, i), &
                                     group%row_side_2(c, i) /= 0)
               end do
            end do
         end associate
      end do
      if (.not. reader%failed()) call check_mirrored(reader, cyclic, contact)

   contains

      subroutine check_element(group, i, sector, has_side)
         character(*), intent(in) :: group
         integer, intent(in) :: i, sector
         logical, intent(in) :: has_side

         if (sector == 0) return
         if (.not. cyclic%is_cyclic) then
            call reader%refuse(group, 'sector_2', '= '//to_text(sector)//': goes with a cyclic '// &
                               'structure; give &cyclic n_sectors and engine_order, or 0')
         else if (abs(sector) >= cyclic%n_sectors) then
            call reader%refuse(group, 'sector_2', '= '//to_text(sector)//': must be from '// &
                               to_text(1 - cyclic%n_sectors)//' to '// &
                               to_text(cyclic%n_sectors - 1))
         else if (.not. has_side) then
            call reader%refuse(group, 'sector_2', '= '//to_text(sector)//' for element '// &
                               to_text(i)//', whose side 2 is the ground: must be 0')
         end if
      end subroutine check_element

   end subroutine check_sectors

   !> A pair is given once, from one of its two sectors. (Sliders of an elastic law may stand side
   !> by side between the same dofs, all seen from the same sector.)
   subroutine check_mirrored(reader, cyclic, contact)
      type(reader_type), intent(inout) :: reader
      type(cyclic_type), intent(in) :: cyclic
      type(contact_type), intent(in) :: contact
      type(law_facts) :: facts
      logical :: repeats, mirrors
      integer :: i, k, n, n_pairs

      n_pairs = contact%n_pairs/contact%n_alike
      if (.not. cyclic%is_cyclic .or. n_pairs < 2) return
      facts = facts_of(contact)
      n = cyclic%n_sectors
      do i = 2, n_pairs
         do k = 1, i - 1
            associate (a => contact%side_1, b => contact%side_2, s => contact%sector_2)
               repeats = all(a(:, i) == a(:, k)) .and. all(b(:, i) == b(:, k)) .and. &
                         modulo(s(i) - s(k), n) == 0 .and. facts%needs_independent
               mirrors = s(i) /= 0 .and. modulo(s(i) + s(k), n) == 0 .and. &
                         (all(a(:, i) == b(:, k)) .and. all(b(:, i) == a(:, k)) .or. &
                          all(a(:, i) == -b(:, k)) .and. all(b(:, i) == -a(:, k)))
            end associate
            if (.not. (repeats .or. mirrors)) cycle
            call reader%refuse('contact', 'sector_2', 'pair '//to_text(i)//' is pair '// &
                               to_text(k)//trim(merge(' seen from the other sector', &
                                                      repeat(' ', 27), mirrors))// &
                               ': give it once')
            return
         end do
      end do
   end subroutine check_mirrored

end module fw_read_cyclic
