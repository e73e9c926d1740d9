!> Modal damping of the stuck joint: the joint that its modes are those of, and what does not go
!> with it.
module fw_read_stuck
   use fw_case, only: case_type
   use fw_closed_pairs, only: add_pairs, add_springs
   use fw_contact_data, only: sliding_steady
   use fw_model_keys, only: damping_of_stuck, model_options
   use fw_normal_law, only: curved_pairs
   use fw_parameters, only: normal_stiffness, parameter_words, spring_coefficient, &
      tangential_stiffness
   use fw_reader, only: reader_type
   implicit none (type, external)
   private

   public :: take_damped_joint, check_damped_joint

contains

   !> Before the model is finished, whose damping takes it.
   subroutine take_damped_joint(reader, options, case)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(case_type), intent(inout) :: case

      if (reader%failed() .or. options%modal_damping_of /= damping_of_stuck) return
      if (case%contact%n_pairs > 0) then
         if (any(curved_pairs(case%contact))) then
            call refuse(reader, "a contact%normal_law other than 'unilateral'", &
                        'a curve has no stiffness at small amplitude before its pressure is known')
         else if (case%contact%sliding == sliding_steady .and. case%contact%slides()) then
            call refuse(reader, "contact%sliding = 'steady'", &
                        'pairs on a side that slides do not stick')
         end if
         if (reader%failed()) return
      end if
      allocate (case%model%damped_joint)
      call add_springs(case%springs, case%model%cyclic%n_solved(), case%model%damped_joint)
      call add_pairs(case%contact, case%model%damped_joint)
   end subroutine take_damped_joint

   !> Parameters that go over what the modes are those of: their damping would have to follow.
   subroutine check_damped_joint(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(in) :: case
      integer, allocatable :: numbers(:)
      integer :: k

      if (reader%failed() .or. .not. allocated(case%model%damped_joint)) return
      allocate (numbers(0))
      if (allocated(case%sensitivity%parameters)) numbers = case%sensitivity%parameters
      numbers = [numbers, case%varied, case%over%number]
      do k = 1, size(numbers)
         if (.not. moves(numbers(k))) cycle
         call refuse(reader, 'the parameter '//trim(parameter_words(numbers(k))), &
                     'the stuck modes would change with it')
         return
      end do

   contains

      !> Whether a spring of the joint has it.
      pure logical function moves(number)
         integer, intent(in) :: number

         moves = .false.
         select case (number)
         case (spring_coefficient)
            if (case%springs%n_springs > 0) moves = any(case%springs%power == 1)
         case (tangential_stiffness, normal_stiffness)
            if (case%model%damped_joint%n_rows() > 0) then
               moves = any(.not. case%model%damped_joint%is_held)
            end if
         case default ! none of its springs
         end select
      end function moves

   end subroutine check_damped_joint

   subroutine refuse(reader, what, reason)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: what, reason

      call reader%refuse('model', 'modal_damping_of', "= 'stuck' does not go with "//what//': '// &
                         reason//"; use 'open', or give model%damping")
   end subroutine refuse

end module fw_read_stuck
