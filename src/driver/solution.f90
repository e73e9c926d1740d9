!> Solve a balance with the solver that the case asks for, in the unknowns of its method.
module fw_solution
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_difference_system, only: difference_system, new_difference_system
   use fw_error, only: error_type
   use fw_flow, only: flow_system, new_flow
   use fw_formulation, only: formulation_type
   use fw_guess, only: held_without_contact
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_kinsol, only: kinsol_solver
   use fw_newton, only: newton_solver, solver_report
   use fw_parameter_system, only: parameter_system
   use fw_powell, only: powell_solver
   use fw_problem, only: build_system
   use fw_pseudo_time, only: pseudo_report, pseudo_time_solver
   use fw_recovery, only: carry_solution
   use fw_unbounded, only: is_lost_in_round_off
   use fw_slip_gap, only: lacks_friction
   use fw_solver_options, only: pseudo_time_options, jacobian_difference, solver_kinsol, &
      solver_powell
   implicit none (type, external)
   private

   public :: solution_method, is_lasting

   type :: solution_method
      type(newton_solver) :: newton
      type(powell_solver) :: powell
      type(kinsol_solver) :: kinsol
      !> The solver that the case asks for.
      integer :: kind = 0
      !> Of the system that is solved.
      type(harmonics_options) :: harmonics
      !> The balance with nothing condensed, made when a flow is first needed.
      type(balance_problem), allocatable :: whole_problem
      type(balance_state), allocatable :: whole
      !> A solution was refused because it grows without bound.
      logical :: unbounded = .false.
      !> Where a motion was first taken for none because nothing determines it [rad/s], and whether
      !> that was so at other frequencies too; below 0: nowhere.
      real(wp) :: undetermined_at = -1.0_wp
      logical :: undetermined_again = .false.
      !> A solution was refused because its friction is ripple.
      logical :: rippled = .false.
      !> The last one was.
      logical :: ripples = .false.
      !> The system was evaluated last at the very solution that converged.
      logical :: stands = .false.
      !> Why the last pseudo-time solution failed.
      character(:), allocatable :: message
   contains
      procedure :: start
      procedure :: solve
      procedure :: solve_by_flow
      procedure :: refuse => refuse_unreal
   end type solution_method

contains

   !> Options of all solvers, of which `kind` chooses; systems come with each call.
   subroutine start(self, case, harmonics)
      class(solution_method), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics

      self%kind = case%solver%kind
      self%newton%options = case%solver
      self%newton%linear%keeps = case%solver%skips
      self%powell%options = case%solver
      self%kinsol%options = case%solver
      self%harmonics = harmonics
   end subroutine start

   !> From the guess in the coefficients x. What does not count as converged: forces whose march
   !> is not periodic, amplitudes without bound, and a position with every pair open of a
   !> structure that its contact alone holds, which is no equilibrium that lasts.
   subroutine solve(self, system, x, report)
      class(solution_method), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(formulation_type), target :: formulation
      class(parameter_system), pointer :: solved
      real(wp), allocatable :: unknowns(:)

      self%ripples = .false.
      call formulation%begin(system)
      solved => formulation%as_solved()
      allocate (unknowns(system%n))
      call formulation%from_coefficients(x, unknowns)
      call solve_system(self, solved, unknowns, report)
      call formulation%to_coefficients(unknowns, x)
      ! Newton's method evaluates what it accepts last; other solvers, and formulations with
      ! unknowns of their own, may have been elsewhere.
      self%stands = report%converged .and. self%kind /= solver_powell .and. &
                    self%kind /= solver_kinsol .and. &
                    self%newton%options%jacobian /= jacobian_difference
      if (self%stands) self%stands = all(abs(unknowns - x) <= 0.0_wp)
      if (report%converged) call refuse_unreal(self, system, x, report)
   end subroutine solve

   !> Whether the point that was evaluated last can last: its forces repeat from period to period,
   !> and something holds the structure.
   logical function is_lasting(system)
      type(balance_state), intent(in) :: system

      associate (contact => system%work(system%problem%forces%pairs))
         is_lasting = contact%all_periodic()
         if (system%problem%n_pairs == 0) return
         if (is_lasting .and. contact%all_open()) is_lasting = held_without_contact(system)
      end associate
   end function is_lasting

   !> With the derivative that the case asks for.
   subroutine solve_system(self, system, x, report)
      class(solution_method), intent(inout) :: self
      class(parameter_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(difference_system), target :: by_differences
      logical :: reduced

      if (self%newton%options%jacobian /= jacobian_difference) then
         call solve_with(self, system, x, report)
         return
      end if
      reduced = system%reduced
      by_differences = new_difference_system(system)
      ! The solver sees a system like any other, whose products are differences.
      call solve_with(self, by_differences, x, report)
      system%reduced = reduced
   end subroutine solve_system

   !> By the solver that the case asks for; pseudo-time has an entry of its own.
   subroutine solve_with(self, system, x, report)
      class(solution_method), intent(inout) :: self
      class(parameter_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report

      select case (self%kind)
      case (solver_powell)
         call self%powell%solve(system, x, report)
      case (solver_kinsol)
         call self%kinsol%solve(system, x, report)
      case default
         call self%newton%solve(system, x, report)
      end select
   end subroutine solve_with

   !> Integrate in pseudo-time on the whole structure, at the frequency and from the guess of the
   !> condensed one.
   subroutine solve_by_flow(self, case, pseudo, system, x, report, error)
      class(solution_method), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(pseudo_time_options), intent(in) :: pseudo
      type(balance_state), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      type(pseudo_time_solver) :: solver
      type(pseudo_report) :: outcome
      type(flow_system) :: flow
      real(wp), allocatable :: whole_x(:)

      self%stands = .false.
      self%ripples = .false.
      report%interrupted = system%is_interrupted()
      if (report%interrupted) return
      if (.not. allocated(self%whole)) then
         allocate (self%whole, self%whole_problem)
         ! One and the same law: prediction stiffness of the condensed system.
         call build_system(case, self%whole_problem, self%whole, error, keep_all=.true., &
                           of_level=self%harmonics, forces=system%problem%forces)
         if (allocated(error)) return
      end if
      call self%whole%follow(system, error)
      if (allocated(error)) return
      ! Memory and reference, too.
      self%whole%depth = system%depth
      associate (pairs => system%problem%forces%pairs)
         self%whole%work(pairs)%x_start = system%work(pairs)%x_start
      end associate
      self%whole%reference = system%reference
      self%whole%interrupt => system%interrupt
      allocate (whole_x(self%whole%n))
      call carry_solution(system, x, self%whole, whole_x)
      call new_flow(self%whole, pseudo%flow, flow)
      report%interrupted = flow%is_interrupted()
      if (report%interrupted) return
      solver%options = case%solver
      solver%pseudo = pseudo
      call solver%solve(flow, whole_x, outcome)
      call flow%clear_shift()
      report = outcome%solver_report
      if (allocated(self%message)) deallocate (self%message)
      if (.not. outcome%converged) self%message = outcome%message
      call carry_solution(self%whole, whole_x, system, x)
      if (report%converged) call refuse_unreal(self, self%whole, whole_x, report)
   end subroutine solve_by_flow

   !> Take `converged` back from what solves the equations and is no vibration.
   subroutine refuse_unreal(self, system, x, report)
      class(solution_method), intent(inout) :: self
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      logical :: lost, rippled
      integer :: n_driven, n_idle

      call system%problem%structure%undetermined(system%structure_state, n_idle, n_driven)
      lost = n_driven > 0 .or. is_lost_in_round_off(system, x)
      self%unbounded = self%unbounded .or. lost
      report%converged = is_lasting(system) .and. .not. lost
      if (.not. report%converged) return
      rippled = lacks_friction(system, x)
      self%rippled = self%rippled .or. rippled
      self%ripples = rippled
      report%converged = .not. rippled
      if (n_idle > 0 .and. report%converged) then
         if (self%undetermined_at < 0.0_wp) self%undetermined_at = system%frequency()
         self%undetermined_again = self%undetermined_again .or. &
                                   abs(self%undetermined_at - system%frequency()) > 0.0_wp
      end if
   end subroutine refuse_unreal

end module fw_solution
