!> Motion of the base: group &base on top of a model file, and what it makes of pairs, springs and
!> other elements.
!>
!> Elements see relative displacements alone, those of u = y + R u_b: R has to be such that y says
!> them. An element between a support and another dof takes that dof along, R = 1 there, and so on
!> from element to element; elements that see the motion of the base itself are refused.
module fw_read_base
   use fw_base_motion, only: base_motion, motion_acceleration, motion_displacement, motion_velocity
   use fw_contact_data, only: contact_type, spring_type
   use fw_element_group, only: element_group
   use fw_elements, only: element_list
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_raw_model, only: raw_model
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: check_supports, read_base

contains

   !> The keys of the group; supports of elements become the ground of y.
   subroutine read_base(reader, is_cyclic, raw, contact, springs, elements)
      type(reader_type), intent(inout) :: reader
      logical, intent(in) :: is_cyclic
      type(raw_model), intent(inout) :: raw
      type(contact_type), intent(inout) :: contact
      type(spring_type), intent(inout) :: springs
      type(element_list), intent(inout) :: elements

      associate (base => raw%base)
         if (.not. reader%given('base', 'n_terms') .and. reader%has_group('base')) then
            call reader%refuse('base', 'n_terms', 'is missing: must be the number of motions')
         end if
         if (reader%given('base', 'dof') .and. allocated(base%direction)) then
            deallocate (base%direction)
         else if (reader%given('base', 'direction') .and. allocated(base%dof)) then
            deallocate (base%dof)
         end if
         call base%bind_keys(reader)
         if (reader%failed() .or. base%n_terms == 0) return
         call check_keys(reader, is_cyclic, base)
         if (reader%failed()) return
         if (allocated(base%direction)) then
            base%carried = base%direction
            return
         end if
         call check_dofs(reader, raw%order(), base%dof)
         if (allocated(raw%rows)) call reader%refuse('base', 'dof', 'does not go with '// &
            'model%row, whose dofs may move as supports do in part: use direction, or n_rows = 0')
         if (reader%failed()) return
         allocate (base%carried(raw%order()), source=0.0_wp)
         base%carried(abs(base%dof)) = real(sign(1, base%dof), wp)
         call carry(reader, base, contact, springs, elements)
      end associate
   end subroutine read_base

   !> Keys that contradict each other, before sizes are looked at.
   subroutine check_keys(reader, is_cyclic, base)
      type(reader_type), intent(inout) :: reader
      logical, intent(in) :: is_cyclic
      type(base_motion), intent(in) :: base
      integer :: i

      if (is_cyclic) then
         call reader%refuse('base', 'n_terms', '= '//to_text(base%n_terms)//' does not go with '// &
                            '&cyclic: give the load that the base makes')
      else if (allocated(base%dof) .and. allocated(base%direction)) then
         call reader%refuse('base', 'direction', 'stands beside dof: must be one of both')
      else if (.not. (allocated(base%dof) .or. allocated(base%direction))) then
         call reader%refuse('base', 'dof', 'is missing: must be the supports, or give '// &
                            'direction for the ground')
      end if
      if (reader%failed()) return
      if (allocated(base%direction)) then
         if (.not. any(abs(base%direction) > 0.0_wp)) call reader%refuse('base', 'direction', &
            'is 0 for all dofs: must move one')
         if (base%moves_with_frame()) call reader%refuse('base', 'frame', "= 'absolute' goes "// &
            "with dof: with direction use 'relative', or make the ground a dof of the model")
      end if
      do i = 1, base%n_terms
         if (base%harmonic(i) > 0 .or. base%motion == motion_displacement) cycle
         if (base%motion == motion_acceleration .and. allocated(base%direction)) cycle
         call reader%refuse('base', 'harmonic', 'of term '//to_text(i)//' is 0, but a constant '// &
                            trim(merge('velocity    ', 'acceleration', &
                                       base%motion == motion_velocity))// &
                            " leads away: must be above 0, or take motion = 'displacement'"// &
                            ' (acceleration with direction)')
         return
      end do
   end subroutine check_keys

   !> Supports are dofs of the model, each of them once.
   subroutine check_dofs(reader, n_dof, dof)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_dof, dof(:)
      integer :: i

      if (size(dof) == 0) call reader%refuse('base', 'dof', 'is empty: must be the supports')
      do i = 1, size(dof)
         if (dof(i) == 0 .or. abs(dof(i)) > n_dof) then
            call reader%refuse('base', 'dof', '= '//to_text(dof(i))//': must be a dof from 1 '// &
                               'to '//to_text(n_dof)//', or its negative')
         else if (count(abs(dof) == abs(dof(i))) > 1) then
            call reader%refuse('base', 'dof', 'has dof '//to_text(abs(dof(i)))//' twice: must '// &
                               'be each support once')
         else
            cycle
         end if
         return
      end do
   end subroutine check_dofs

   !> R of the dofs that elements join to supports, until no more are found; then supports stand for
   !> the ground.
   subroutine carry(reader, base, contact, springs, elements)
      type(reader_type), intent(inout) :: reader
      type(base_motion), intent(inout) :: base
      type(contact_type), intent(inout) :: contact
      type(spring_type), intent(inout) :: springs
      type(element_list), intent(inout) :: elements
      logical :: is_carried(0:size(base%carried)), is_support(0:size(base%carried)), grows
      integer :: c, i, k

      is_support = .false.
      is_support(abs(base%dof)) = .true.
      is_carried = is_support
      grows = .true.
      do while (grows)
         grows = .false.
         do i = 1, contact%n_pairs
            do c = 1, 3
               call pass_on(contact%side_1(c, i), contact%side_2(c, i))
            end do
         end do
         do i = 1, springs%n_springs
            call pass_on(springs%side_1(i), springs%side_2(i))
         end do
         do k = 1, size(elements%slot)
            associate (group => elements%slot(k)%group)
               do i = 1, group%n_elements
                  do c = 1, group%n_in
                     call pass_on(group%row_side_1(c, i), group%row_side_2(c, i))
                  end do
               end do
            end associate
         end do
      end do
      do i = 1, contact%n_pairs
         do c = 1, 3
            call ground('contact', 'side_1', 'and side_2: pair '//to_text(i), &
                        contact%side_1(c, i), contact%side_2(c, i))
            if (reader%failed()) return
         end do
      end do
      do i = 1, springs%n_springs
         call ground('spring', 'side_1', 'and side_2: spring '//to_text(i), springs%side_1(i), &
                     springs%side_2(i))
         if (reader%failed()) return
      end do
      do k = 1, size(elements%slot)
         call ground_group(elements%slot(k)%group)
         if (reader%failed()) return
      end do

   contains

      !> Of both sides of an element one takes the other along.
      subroutine pass_on(side_1, side_2)
         integer, intent(in) :: side_1, side_2

         if (side_1 == 0 .or. side_2 == 0) return
         if (is_carried(abs(side_1)) .eqv. is_carried(abs(side_2))) return
         if (is_carried(abs(side_1))) then
            base%carried(abs(side_2)) = sign(1, side_2)*motion_of(side_1)
         else
            base%carried(abs(side_1)) = sign(1, side_1)*motion_of(side_2)
         end if
         is_carried(abs([side_1, side_2])) = .true.
         grows = .true.
      end subroutine pass_on

      real(wp) function motion_of(side)
         integer, intent(in) :: side

         motion_of = 0.0_wp
         if (side /= 0) motion_of = sign(1, side)*base%carried(abs(side))
      end function motion_of

      !> Elements as the law counts them: terms that share dofs are one.
      subroutine ground_group(group)
         class(element_group), intent(inout) :: group

         do i = 1, group%n_elements
            do c = 1, group%n_in
               call ground(trim(group%name()), trim(group%count_key()), '= '// &
                           to_text(group%n_given)//': element '//to_text(i), &
                           group%row_side_1(c, i), group%row_side_2(c, i))
               if (reader%failed()) return
            end do
         end do
      end subroutine ground_group

      subroutine ground(group, key, name, side_1, side_2)
         character(*), intent(in) :: group, key, name
         integer, intent(inout) :: side_1, side_2

         if (side_1 == 0 .and. side_2 == 0) return
         if (is_support(abs(side_1)) .and. is_support(abs(side_2))) then
            call reader%refuse(group, key, name//' joins two supports of &base dof: remove it')
         else if (abs(motion_of(side_1) - motion_of(side_2)) > 0.0_wp) then
            call reader%refuse(group, key, name//' sees the motion of &base dof itself, not '// &
                               'relative ones alone: elements must join what supports move to '// &
                               'supports only')
         end if
         if (is_support(abs(side_1))) side_1 = 0
         if (is_support(abs(side_2))) side_2 = 0
      end subroutine ground

   end subroutine carry

   !> What moves as the base says takes no load, and a constant motion no force without a place.
   subroutine check_supports(reader, base, turns, model)
      type(reader_type), intent(inout) :: reader
      type(base_motion), intent(in) :: base
      !> Whether there are Coriolis forces.
      logical, intent(in) :: turns
      !> With its loads.
      type(model_type), intent(in) :: model
      real(wp), allocatable :: loads(:, :)
      integer :: i

      if (base%has_constant()) then
         if (base%moves_supports() .and. allocated(model%cyclic%speed)) then
            call reader%refuse('base', 'harmonic', 'has a 0, whose force changes with a speed '// &
                               'that follows the frequency: must be above 0')
         else if (turns .and. base%motion == motion_acceleration) then
            call reader%refuse('base', 'harmonic', 'has a 0, and coriolis makes a force of a '// &
                               'constant acceleration that grows for ever: must be above 0')
         end if
         if (reader%failed()) return
      end if
      if (.not. base%moves_supports()) return
      loads = model%load_columns()
      do i = 1, size(base%dof)
         if (.not. any(abs(loads(abs(base%dof(i)), :)) > 0.0_wp)) cycle
         call reader%refuse('base', 'dof', '= '//to_text(base%dof(i))//' has a load: a support '// &
                            'moves as &base says, whatever acts on it; must have none')
         return
      end do
   end subroutine check_supports

end module fw_read_base
