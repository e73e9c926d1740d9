!> Solve a balance with the solver that the case asks for, in the unknowns of its method.
module fw_solution
   use fw_kinds, only: wp
   use fw_case, only: analyses, case_type
   use fw_difference_system, only: difference_system, new_difference_system
   use fw_error, only: error_type
   use fw_flow, only: flow_system, new_flow
   use fw_formulation, only: formulation_type
   use fw_guess, only: held_without_contact
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_idle_part, only: add_motion
   use fw_kinsol, only: kinsol_solver
   use fw_newton, only: newton_solver, solver_report
   use fw_parameter_system, only: parameter_system
   use fw_powell, only: powell_solver
   use fw_norm, only: norm_of
   use fw_parameters, only: is_of_matrices
   use fw_problem, only: build_system
   use fw_pseudo_time, only: pseudo_report, pseudo_time_solver
   use fw_recovery, only: carry_solution
   use fw_unbounded, only: is_lost_in_round_off
   use fw_undetermined, only: idle_motion, undetermined_note, undetermined_search
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
      !> Motions that nothing determines, as springs and stuck pairs hold them, and what was taken
      !> for none.
      type(undetermined_search) :: search
      type(undetermined_note) :: undetermined
      !> A solution left its tolerance where motions near a mode without damping were corrected.
      logical, private :: left_tolerance = .false.
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
      call start_search(self, case)
   end subroutine start

   !> Where the matrices stay, and springs act in all harmonics.
   subroutine start_search(self, case)
      type(solution_method), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Runs may leave their range of frequencies, by less than that.
      real(wp), parameter :: beyond = 4.0_wp
      real(wp) :: range(2)

      if (is_of_matrices(case%varied) .or. is_of_matrices(case%resonance%parameter) .or. &
          self%harmonics%filter_harmonics > 0) return
      ! What holds a motion beside pairs and springs is not looked through.
      if (case%elements%n_elements() > 0) return
      range = case%sweep%start
      if (analyses(case%analysis)%is_sweep) range = case%sweep%range()
      call self%search%start(case%model, case%contact, case%springs, &
                             range*[1.0_wp/beyond, beyond*self%harmonics%n_harmonics])
   end subroutine start_search

   !> From the guess in the coefficients x. What does not count as converged: forces whose march
   !> is not periodic, amplitudes without bound, and a position with every pair open of a
   !> structure that its contact alone holds, which is no equilibrium that lasts.
   subroutine solve(self, system, x, report)
      class(solution_method), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(formulation_type), target :: formulation
      type(difference_system), target :: by_differences
      class(parameter_system), pointer :: given, solved
      real(wp), allocatable :: unknowns(:)
      logical :: reduced
      integer :: iterations, trial

      iterations = 0
      self%ripples = .false.
      call formulation%begin(system)
      given => formulation%as_solved()
      solved => given
      reduced = given%reduced
      if (self%newton%options%jacobian == jacobian_difference) then
         ! The solver sees a system like any other, whose products are differences.
         by_differences = new_difference_system(given)
         solved => by_differences
      end if
      allocate (unknowns(system%n))
      call formulation%from_coefficients(x, unknowns)
      do trial = 1, 2
         select case (self%kind)
         case (solver_powell)
            call self%powell%solve(solved, unknowns, report)
         case (solver_kinsol)
            call self%kinsol%solve(solved, unknowns, report)
         case default
            call self%newton%solve(solved, unknowns, report)
         end select
         report%iterations = report%iterations + iterations
         call formulation%to_coefficients(unknowns, x)
         ! Newton's method evaluates what it accepts last; other solvers, and formulations with
         ! unknowns of their own, may have been elsewhere.
         self%stands = report%converged .and. self%kind /= solver_powell .and. &
                       self%kind /= solver_kinsol .and. &
                       self%newton%options%jacobian /= jacobian_difference
         if (self%stands) self%stands = all(abs(unknowns - x) <= 0.0_wp)
         self%left_tolerance = .false.
         if (report%converged) call refuse_unreal(self, system, x, report)
         if (.not. self%left_tolerance) exit
         ! From the motion that the residual of the first solution did not tell.
         iterations = report%iterations
         call formulation%from_coefficients(x, unknowns)
      end do
      if (self%newton%options%jacobian == jacobian_difference) given%reduced = reduced
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
      self%whole%reference = system%reference
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
      if (report%converged) call refuse_unreal(self, self%whole, whole_x, report)
      call carry_solution(self%whole, whole_x, system, x)
   end subroutine solve_by_flow

   !> Take `converged` back from what solves the equations and is no vibration.
   subroutine refuse_unreal(self, system, x, report, keeps)
      class(solution_method), intent(inout) :: self
      type(balance_state), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      !> Leave x, which has further conditions, as it is.
      logical, intent(in), optional :: keeps
      type(idle_motion), allocatable :: idle(:)
      logical :: lost, moves, rippled
      integer :: n_driven, n_idle, k

      call system%problem%structure%undetermined(system%structure_state, n_idle, n_driven)
      ! A pair that nothing moves is left out, and holds the structure all the same.
      if (self%search%is_needed .and. system%problem%joint%n_idle > 0) n_idle = 0
      call self%search%find(system, x, idle)
      lost = n_driven > 0 .or. any(idle%is_driven)
      moves = size(idle) > 0 .and. .not. lost
      if (present(keeps)) moves = moves .and. .not. keeps
      if (moves) call take_changes(self, system, idle, x, report)
      lost = lost .or. is_lost_in_round_off(system, x)
      self%unbounded = self%unbounded .or. lost
      report%converged = is_lasting(system) .and. .not. (lost .or. self%left_tolerance)
      self%left_tolerance = self%left_tolerance .and. .not. lost
      if (.not. report%converged) return
      rippled = lacks_friction(system, x)
      self%rippled = self%rippled .or. rippled
      self%ripples = rippled
      report%converged = .not. rippled
      if (.not. report%converged) return
      do k = 1, size(idle)
         if (size(idle(k)%shapes, 2) > 0) call self%undetermined%take(system%frequency(), merge( &
            system%problem%fourier%harmonic(idle(k)%h), 0, idle(k)%is_held))
      end do
      if (n_idle > 0) call self%undetermined%take(system%frequency(), 0)
   end subroutine refuse_unreal

   !> Motions that nothing determines come to rest, and those that the tolerance hides to what they
   !> are.
   subroutine take_changes(self, system, idle, x, report)
      class(solution_method), intent(inout) :: self
      type(balance_state), intent(inout) :: system
      type(idle_motion), intent(in) :: idle(:)
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      real(wp) :: r(size(x))
      integer :: k

      do k = 1, size(idle)
         call add_motion(system, idle(k)%h, idle(k)%change, x)
      end do
      call system%residual(x, r)
      report%residual = norm_of(r)/system%reference
      self%stands = .false.
      self%left_tolerance = .not. report%residual <= self%newton%options%tolerance
   end subroutine take_changes

end module fw_solution
