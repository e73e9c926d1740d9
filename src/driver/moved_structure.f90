!> A structure whose matrices follow a parameter: condensed anew in the place where it stands, as
!> coordinates that mean the same at all values.
!>
!> Relative displacements do. Modes that the contact holds are others at each value: they are
!> condensed, unless one without damping may meet a harmonic on the way. Then all of them are
!> coordinates, in the modes of one value, which span what those of any other do.
module fw_moved_structure
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_body, only: body_type
   use fw_cyclic_structure, only: cyclic_structure, new_cyclic_structure
   use fw_error, only: error_type
   use fw_joint, only: joint_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_parameter_values, only: put_parameter
   use fw_plain_structure, only: new_plain_structure, plain_structure
   use fw_reduction, only: may_resonate_between, new_reduction, reduction_type
   use fw_sector_means, only: means_none, means_split
   use fw_structure_operator, only: structure_state
   implicit none (type, external)
   private

   public :: meets_modes, move_structure, put_fullest

contains

   !> Bring a body to the largest of its values: loads and matrices that vanish elsewhere are there,
   !> and with them the harmonics and the coordinates that all values need.
   subroutine put_fullest(body, error)
      class(body_type), intent(inout) :: body
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: largest

      associate (span => body%varied_span)
         largest = merge(span(1), span(2), abs(span(1)) > abs(span(2)))
      end associate
      call put_parameter(body, body%varied, [largest], error)
   end subroutine put_fullest

   !> Whether a mode that the contact holds may be met between the ends of the values.
   subroutine meets_modes(body, joint, harmonic, range, meets, error)
      class(body_type), intent(in) :: body
      type(joint_type), intent(in) :: joint
      integer, intent(in) :: harmonic(:)
      !> [rad/s]
      real(wp), intent(in) :: range(2)
      logical, intent(out) :: meets
      type(error_type), allocatable, intent(out) :: error
      class(body_type), allocatable :: moved
      type(reduction_type) :: basis(2)
      integer :: k

      meets = .false.
      allocate (moved, source=body)
      do k = 1, 2
         call put_parameter(moved, body%varied, body%varied_span(k:k), error)
         if (allocated(error)) return
         if (moved%model%cyclic%is_cyclic) then
            call has_undamped(moved%model, joint, harmonic, meets, error)
            if (meets .or. allocated(error)) return
            cycle
         end if
         call new_reduction(moved%model, joint%relative, harmonic, range, basis(k), error, &
                            keep_none=.true.)
         if (allocated(error)) return
      end do
      if (.not. moved%model%cyclic%is_cyclic) meets = may_resonate_between(basis(1), basis(2), &
                                                                           harmonic, range)
   end subroutine meets_modes

   !> Whether any nodal diameter of a wave has modes without damping, wherever they are: with the
   !> parameter they may come to a harmonic.
   subroutine has_undamped(model, joint, harmonic, has, error)
      type(model_type), intent(in) :: model
      type(joint_type), intent(in) :: joint
      integer, intent(in) :: harmonic(:)
      logical, intent(out) :: has
      type(error_type), allocatable, intent(out) :: error
      !> [rad/s]
      real(wp), parameter :: everywhere(2) = [0.0_wp, 1.0e100_wp]
      type(cyclic_structure) :: cyclic

      has = .false.
      call new_cyclic_structure(model, joint%cyclic, harmonic, everywhere, means_none, cyclic, &
                                error)
      if (.not. allocated(error)) has = size(cyclic%kept) > 0
   end subroutine has_undamped

   !> Bring the structure of a state's problem to the matrices of a model. Rigid laws take their eps
   !> from it, as a case of its own would, unless they are to hold it.
   subroutine move_structure(model, first, holds_eps, state, error)
      type(model_type), intent(in) :: model
      !> The frequency where the case begins [rad/s].
      real(wp), intent(in) :: first
      logical, intent(in) :: holds_eps
      class(balance_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error

      logical :: scales

      associate (problem => state%problem)
         scales = .not. (holds_eps .or. problem%origin%borrows_laws)
         if (scales) scales = take_balance(problem)
         if (scales .or. .not. problem%origin%keeps_all) then
            call take_structure(model, .false., problem, error)
            if (allocated(error)) return
         end if
         if (scales) call scale_laws(first, problem, error)
         if (allocated(error)) return
         if (problem%origin%keeps_all) call take_structure(model, .true., problem, error)
         if (allocated(error)) return
      end associate
      call state%renew_workspaces()
      call state%renew_structure(error)
   end subroutine move_structure

   !> Whether a law has an eps.
   pure logical function take_balance(problem)
      type(balance_problem), intent(in) :: problem

      take_balance = problem%forces%entry(problem%forces%pairs)%law%prediction%takes_balance
   end function take_balance

   !> Condense the matrices of a model, or take all of their modes.
   subroutine take_structure(model, keeps_all, problem, error)
      type(model_type), intent(in) :: model
      logical, intent(in) :: keeps_all
      type(balance_problem), intent(inout) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(plain_structure), allocatable :: plain
      type(cyclic_structure), allocatable :: cyclic

      if (model%cyclic%is_cyclic) then
         allocate (cyclic)
         call new_cyclic_structure(model, problem%joint%cyclic, problem%fourier%harmonic, &
                                   problem%origin%range, merge(means_split, means_none, &
                                                               take_balance(problem)), &
                                   cyclic, error, keep_all=keeps_all, &
                                   keep_none=.not. problem%origin%keeps_all)
         if (.not. allocated(error)) call move_alloc(cyclic, problem%structure)
         return
      end if
      allocate (plain)
      if (keeps_all) then
         call new_plain_structure(model, problem%joint%relative, problem%fourier%harmonic, &
                                  problem%origin%range, plain, error, keep_all=.true., &
                                  held=problem%origin%basis)
      else
         call new_plain_structure(model, problem%joint%relative, problem%fourier%harmonic, &
                                  problem%origin%range, plain, error, &
                                  keep_none=.not. problem%origin%keeps_all)
      end if
      if (allocated(error)) return
      call move_alloc(plain, problem%structure)
   end subroutine take_structure

   !> eps of the structure as it is, at the frequency where the case begins.
   subroutine scale_laws(first, problem, error)
      real(wp), intent(in) :: first
      type(balance_problem), intent(inout) :: problem
      type(error_type), allocatable, intent(out) :: error
      class(structure_state), allocatable :: stand

      call problem%structure%new_state(stand)
      call problem%structure%at(stand, first, 0.0_wp, error)
      if (.not. allocated(error)) call problem%scale_forces(stand, problem%origin%range(2))
   end subroutine scale_laws

end module fw_moved_structure
