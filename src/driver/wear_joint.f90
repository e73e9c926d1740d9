!> A joint that wears: its vibration at fixed depths, vibration and depths as one system over it,
!> and the march through the cycles.
module fw_wear_joint
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_combinations, only: is_linear_euler
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_reduction, only: held_basis
   use fw_resonance, only: resonance_type
   use fw_strategy, only: new_request, note_time_limit
   use fw_wear_march, only: wear_march
   use fw_wear_options, only: wear_energy
   use fw_wear_step, only: new_wear_stepper, wear_state
   use fw_wear_system, only: new_wear_system, wear_system
   implicit none (type, external)
   private

   public :: wear_joint, stand_at

   !> Largest growth of the depth in a step where the scheme estimates no error and the case names
   !> none, as a part of the depth scale.
   real(wp), parameter :: depth_step = 5.0e-2_wp
   !> The same as a part of the depth, which a scar that keeps growing leaves behind.
   real(wp), parameter :: relative_step = 2.0e-2_wp

   !> Not to be moved once it is built.
   type :: wear_joint
      type(balance_problem) :: problem
      type(balance_state) :: balance
      type(wear_system) :: system
      class(point_solver), allocatable :: solver
      type(wear_march) :: march
      !> Where it stands.
      type(wear_state) :: state
      logical, private :: has_stepper = .false.
   contains
      procedure :: build
      procedure :: solve
      procedure :: prepare
      procedure :: take_solution
      procedure :: set_steps
      procedure :: begin_march
   end type wear_joint

contains

   !> Condense the case.
   subroutine build(self, case, error, held)
      class(wear_joint), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      !> See build_system.
      type(held_basis), intent(inout), optional :: held

      call build_system(case, self%problem, self%balance, error, held=held)
      if (allocated(error)) return
      allocate (self%solver)
      call self%solver%start(case, case%harmonics, self%balance%n)
   end subroutine build

   !> The vibration at the depths of the balance, by all ways to a first point.
   subroutine solve(self, case, observer, point, error)
      class(wear_joint), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      call observer%limit_point(case%solver%max_seconds)
      call self%solver%solve(case, self%balance, new_request(case, case%sweep%start, observer), &
                             point, error)
      if (allocated(error)) return
      if (.not. point%converged) call note_time_limit(observer, case%solver%max_seconds, point)
      call observer%limit_point(0.0_wp)
      if (allocated(point%note)) call observer%on_message(point%note)
   end subroutine solve

   !> Vibration and depths as one system over the balance.
   subroutine prepare(self, case, interrupt)
      class(wear_joint), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(interrupt_type), intent(inout), target :: interrupt

      call new_wear_system(self%balance, case%contact, case%wear%coefficient, &
                           case%wear%law == wear_energy, self%system)
      self%balance%interrupt => interrupt
      self%system%interrupt => interrupt
   end subroutine prepare

   !> Stand at the vibration that was solved for.
   subroutine take_solution(self, residual)
      class(wear_joint), intent(inout), target :: self
      !> Of the vibration.
      real(wp), intent(in) :: residual

      ! Vibration, then depths: the unknowns of the coupled system.
      self%state%x = [self%solver%x, self%system%vibration%depth]
      call stand_at(self%system, self%state%x)
      self%state%rate = self%system%rate
      self%state%residual = residual
   end subroutine take_solution

   !> Steps of the scheme of a case, the stepper the same one for all its marches.
   subroutine set_steps(self, case)
      class(wear_joint), intent(inout) :: self
      type(case_type), intent(in) :: case

      self%march%options = case%wear
      if (is_linear_euler(case) .and. case%wear%max_depth_step <= 0.0_wp) then
         self%march%options%max_depth_step = depth_step*self%system%depth_scale()
         self%march%options%relative_step = relative_step
      end if
      if (self%has_stepper) return
      self%has_stepper = .true.
      self%march%stepper = new_wear_stepper(self%march%options, case%pseudo_time%scheme, &
                                            self%solver%method%newton)
   end subroutine set_steps

   !> What the march of a case needs at the state where the joint stands; its resonance where that
   !> is to be followed.
   subroutine begin_march(self, case, iterations, error)
      class(wear_joint), intent(inout), target :: self
      type(case_type), intent(in) :: case
      !> Grows by those of the search.
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      call self%set_steps(case)
      associate (march => self%march)
         ! Also where it is not followed: the march has no case for its absence.
         march%resonance = resonance_type(n_harmonics=case%harmonics%n_harmonics, &
                                          first=case%sweep%start, &
                                          spacing=march%resonance%spacing)
         if (case%wear%follow_resonance) then
            call march%resonance%follow(march%stepper, self%system, self%state, iterations, error)
         end if
      end associate
   end subroutine begin_march

   !> Contact forces and rates that the next step starts from.
   subroutine stand_at(system, x)
      type(wear_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      real(wp), allocatable :: r(:)

      allocate (r(system%n))
      call system%begin_step(x(system%n_vibration() + 1:), 0.0_wp)
      call system%residual(x, r)
   end subroutine stand_at

end module fw_wear_joint
