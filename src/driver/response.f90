!> A response as a vibration: a balance at a place, solved with the solver that the case asks for,
!> in the unknowns of its method; and its ways, with pseudo-time, which is its own.
module fw_response
   use fw_kinds, only: wp
   use fw_case, only: analyses, case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_error, only: error_type
   use fw_flow, only: flow_system, new_flow
   use fw_formulation, only: formulation_type
   use fw_force_law, only: pair_open
   use fw_guess, only: free_guess, held_without_contact, stuck_guess
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_idle_part, only: add_motion
   use fw_kinsol, only: kinsol_solver
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   use fw_powell, only: powell_solver
   use fw_norm, only: norm_of
   use fw_parameters, only: is_of_matrices
   use fw_problem, only: build_system
   use fw_point, only: point_type, served_by_free_guess, served_by_kinsol, served_by_newton, &
      served_by_powell, served_by_pseudo_time, served_by_raised_load, served_by_smaller_steps
   use fw_pseudo_time, only: pseudo_report, pseudo_time_solver
   use fw_recovery, only: carry_solution, observed_coefficients
   use fw_remarks, only: remark_list
   use fw_sensitivity_solver, only: sensitivity_solver
   use fw_unbounded, only: is_lost_in_round_off
   use fw_undetermined, only: idle_motion, undetermined_note, undetermined_search
   use fw_slip_gap, only: lacks_friction
   use fw_solution_history, only: position, solution_history
   use fw_solver_options, only: pseudo_time_options, solver_kinsol, solver_powell
   use fw_strategy, only: point_request
   use fw_vibration, only: vibration, walk_options, walk_type, way_guesses_by_lu, way_last_guess, &
      way_own, way_rise, way_steps, way_type
   implicit none (type, external)
   private

   public :: response, is_lasting, flow_of_case

   type, extends(vibration) :: response
      !> For as long as a point is at work.
      type(case_type), pointer :: case => null()
      !> What it is built of, where it is asked for point by point, and all unknowns: those of the
      !> balance, and further ones of a vibration that has them.
      class(balance_problem), allocatable :: problem
      class(balance_state), allocatable :: state
      integer :: n = 0
      type(powell_solver) :: powell
      type(kinsol_solver) :: kinsol
      !> The solver that the case asks for.
      integer :: kind = 0
      !> Of the system that is solved.
      type(harmonics_options) :: harmonics
      !> The balance with nothing condensed, made when a flow is first needed.
      class(balance_problem), allocatable :: whole_problem
      class(balance_state), allocatable :: whole
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
      !> The system was evaluated last at the very solution that converged.
      logical :: stands = .false.
      !> Why the last pseudo-time solution failed.
      character(:), allocatable :: message
      !> Points that the pseudo-time fallback has saved, and its failures in a row.
      integer :: n_by_flow = 0, flow_failures = 0
   contains
      procedure :: start
      procedure :: stand
      procedure :: solve
      procedure :: solve_in
      procedure :: make_guess
      procedure :: offers
      procedure :: try_own => by_flow
      procedure :: solve_by_flow
      procedure :: refuse => refuse_unreal
      procedure :: say_solver
      procedure :: plan
      ! Asked for point by point.
      procedure :: build
      procedure :: begin
      procedure :: evaluate
      procedure :: look_further
      procedure :: explain
      procedure :: add_to
      procedure :: remark
      ! Along its curve.
      procedure :: curve_system
      procedure :: begin_curve
      procedure :: take_from_curve
      procedure :: back_to_curve
      procedure :: observe_beside
   end type response

   !> Unknowns up to which pseudo-time comes before a raised load on the way to a first point: the
   !> flow forms and factors matrices of all coordinates for every step.
   integer, parameter :: flow_first_up_to = 4000
   !> Unknowns from which two halvings of the step come before pseudo-time as well: a few solutions,
   !> where a flow factors matrices of all coordinates.
   integer, parameter :: steps_first_from = 1000
   !> Steps of the pseudo-time fallback, and failures in a row after which it is left alone: a
   !> joint that cannot carry its load has no solution to flow to.
   integer, parameter :: fallback_steps = 60, max_flow_failures = 2

   !> Iterations spent on a point after which no other way to it is begun, over max_iterations.
   !> (Where a sector loses its hold, points take 470 at most, and none of those with a solution
   !> took more than 25.)
   integer, parameter :: most_work = 20
   !> Pseudo-time as the solver of the case.
   integer, parameter :: own_solver = way_own + 1
   !> Bodies that nothing but contact holds may turn freely where their pairs slip: steps of a trust
   !> region do not run away with them.
   integer, parameter :: by_trust_region = way_own + 2
   type(way_type), parameter :: flow_of_case = way_type('pseudo-time', own_solver, &
                                                        served_by_pseudo_time)

   !> Where the best guesses known fail: pseudo-time; from the last point on the sweep by halves
   !> (six of them: a 64th of a step of the sweep), or to the first point by raising the load; the
   !> guesses again, with LU where GMRES failed; and at last from the solution without contact,
   !> which may lie on another branch.
   character(*), parameter :: few = 'a few smaller steps'
   type(way_type), parameter :: response_ways(*) = [ &
      way_type('raised load', way_rise, served_by_raised_load, as_next=.false., &
               more_than=flow_first_up_to, after_ripple=.false., is_costly=.true.), &
      way_type(few, way_steps, served_by_smaller_steps, as_first=.false., &
               more_than=steps_first_from, after_ripple=.false., is_costly=.true., halvings=2), &
      way_type('pseudo-time', way_own, served_by_pseudo_time, up_to=flow_first_up_to, &
               is_costly=.true.), &
      way_type('pseudo-time', way_own, served_by_pseudo_time, more_than=flow_first_up_to, &
               after_ripple=.false., is_costly=.true.), &
      way_type('raised load', way_rise, served_by_raised_load, as_next=.false., &
               up_to=flow_first_up_to, after_ripple=.false., is_costly=.true.), &
      way_type('smaller steps', way_steps, served_by_smaller_steps, as_first=.false., &
               after_ripple=.false., is_costly=.true.), &
      way_type('Powell''s method', by_trust_region, served_by_powell, after_ripple=.false., &
               is_costly=.true.), &
      way_type('guesses, with LU', way_guesses_by_lu, after_ripple=.false., is_last=.true.), &
      way_type('free guess', way_last_guess, served_by_free_guess, after_ripple=.false., &
               is_last=.true.)]

contains

   !> Options of all solvers, of which `kind` chooses; systems come with each call.
   subroutine start(self, case, harmonics)
      class(response), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics

      ! Extrapolated, the last one, all stuck; all free is the last resort.
      self%n_guesses = 3
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
      type(response), intent(inout) :: self
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

   !> At a place of the path, under a share of the load.
   subroutine stand(self, at, error)
      class(response), intent(inout) :: self
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error

      self%balance%load_share = at%level
      call self%balance%set_parameter(at%along, error)
      if (allocated(error)) self%balance%load_share = 1.0_wp
   end subroutine stand

   !> Extrapolation along the sweep, the last solution, all stuck, all free.
   subroutine make_guess(self, guess, at, known, x, is_there, error)
      class(response), intent(inout) :: self
      integer, intent(in) :: guess
      type(position), intent(in) :: at
      type(solution_history), intent(in) :: known
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: is_there
      type(error_type), allocatable, intent(out) :: error

      is_there = .true.
      select case (guess)
      case (3)
         call stuck_guess(self%balance, x)
      case (4)
         call free_guess(self%balance, x)
      case default
         call known%guess(guess, at%along, x, is_there)
      end select
   end subroutine make_guess

   !> A few smaller steps come in front of a flow only. No flow has been derived for the whole of
   !> cyclic structures.
   logical function offers(self, way)
      class(response), intent(in) :: self
      type(way_type), intent(in) :: way

      offers = .true.
      if (way%kind == way_own .or. way%word == few) then
         offers = self%flow_failures < max_flow_failures .and. &
                  .not. self%case%model%cyclic%is_cyclic
      else if (way%kind == by_trust_region) then
         offers = allocated(self%case%bodies) .and. self%kind /= solver_powell
      end if
   end function offers

   !> By Powell's method, from the last solution or the stuck guess, then from that without contact.
   subroutine by_powell(self, walk, at, x, report, error)
      class(response), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      integer :: kind, trial

      call self%stand(at, error)
      if (allocated(error)) return
      kind = self%kind
      self%kind = solver_powell
      do trial = merge(1, 2, walk%known%kept > 0), 3
         select case (trial)
         case (1); x = walk%known%x(:, 1)
         case (2); call stuck_guess(self%balance, x)
         case default; call free_guess(self%balance, x)
         end select
         call self%solve(x, report, error)
         if (allocated(error) .or. report%converged .or. report%interrupted) exit
      end do
      self%kind = kind
      if (allocated(error)) return
      if (report%converged) call walk%known%remember(at%along, x, at%level)
   end subroutine by_powell

   !> The ways of its own: pseudo-time from the last solution or from the stuck guess, and Powell's
   !> method.
   subroutine by_flow(self, way, walk, at, x, report, error)
      class(response), intent(inout) :: self
      type(way_type), intent(in) :: way
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      type(pseudo_time_options) :: pseudo
      real(wp) :: start(size(x))

      if (way%kind == by_trust_region) then
         call by_powell(self, walk, at, x, report, error)
         return
      end if
      report = solver_report()
      call self%stand(at, error)
      if (allocated(error)) return
      if (walk%known%kept > 0) then
         x = walk%known%x(:, 1)
      else
         call stuck_guess(self%balance, x)
      end if
      if (walk%is_new(at, x, way_own)) then
         pseudo = pseudo_time_options(max_steps=fallback_steps)
         if (way%kind == own_solver) pseudo = self%case%pseudo_time
         start = x
         call self%solve_by_flow(self%case, pseudo, self%balance, x, report, error)
         if (allocated(error)) return
         self%iterations = self%iterations + report%iterations
         call walk%note_attempt(self, at, start, x, report, way_own)
         if (report%converged) call walk%known%remember(at%along, x, at%level)
      end if
      if (way%kind == own_solver) return
      self%flow_failures = merge(0, self%flow_failures + 1, report%converged)
      if (report%converged) self%n_by_flow = self%n_by_flow + 1
   end subroutine by_flow

   !> Solve another balance than that at work, whose place stays.
   subroutine solve_in(self, system, x, report)
      class(response), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(balance_state), pointer :: before
      type(error_type), allocatable :: unused

      before => self%balance
      self%balance => system
      call self%solve(x, report, unused)
      self%balance => before
   end subroutine solve_in

   !> From the guess in the coefficients x. What does not count as converged: forces whose march
   !> is not periodic, amplitudes without bound, and a position with every pair open of a
   !> structure that its contact alone holds, which is no equilibrium that lasts.
   subroutine solve(self, x, report, error)
      class(response), intent(inout) :: self
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      type(formulation_type), target :: formulation
      class(parameter_system), pointer :: solved
      real(wp), allocatable :: unknowns(:)
      integer :: iterations, trial

      associate (unused => allocated(error))
      end associate
      iterations = 0
      self%ripples = .false.
      call formulation%begin(self%balance)
      solved => formulation%as_solved()
      allocate (unknowns(self%balance%n))
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
                       self%kind /= solver_kinsol
         if (self%stands) self%stands = all(abs(unknowns - x) <= 0.0_wp)
         self%left_tolerance = .false.
         if (report%converged) call refuse_unreal(self, self%balance, x, report)
         if (.not. self%left_tolerance) exit
         ! From the motion that the residual of the first solution did not tell.
         iterations = report%iterations
         call formulation%from_coefficients(x, unknowns)
      end do
      self%iterations = self%iterations + report%iterations
   end subroutine solve

   !> Whether the point that was evaluated last can last: its forces repeat from period to period,
   !> and something holds the structure.
   logical function is_lasting(system)
      type(balance_state), intent(in) :: system

      associate (contact => system%work(system%problem%forces%pairs))
         is_lasting = contact%all_periodic()
         if (system%problem%n_pairs == 0) return
         if (is_lasting .and. contact%all_open()) is_lasting = held_without_contact(system)
         if (allocated(system%problem%body_of_pair)) is_lasting = is_lasting .and. &
            .not. is_adrift(system%problem%body_of_pair, contact%state == pair_open)
      end associate
   end function is_lasting

   !> Whether a body has lost all its pairs.
   pure logical function is_adrift(body_of_pair, is_open)
      !> Of a sector, and of all that are solved.
      integer, intent(in) :: body_of_pair(:)
      logical, intent(in) :: is_open(:)
      integer :: b, j, n

      is_adrift = .false.
      n = size(body_of_pair)
      do j = 0, size(is_open)/max(n, 1) - 1
         do b = 1, maxval(body_of_pair)
            if (.not. any(body_of_pair == b)) cycle
            is_adrift = is_adrift .or. all(is_open(j*n + 1:(j + 1)*n) .or. body_of_pair /= b)
         end do
      end do
   end function is_adrift

   !> Integrate in pseudo-time on the whole structure, at the frequency and from the guess of the
   !> condensed one.
   subroutine solve_by_flow(self, case, pseudo, system, x, report, error)
      class(response), intent(inout), target :: self
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
      class(response), intent(inout) :: self
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
      class(response), intent(inout) :: self
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

   !> How a walk goes along it: nothing is known yet of n unknowns.
   subroutine plan(self, n, walk)
      class(response), intent(in) :: self
      integer, intent(in) :: n
      type(walk_type), intent(inout) :: walk

      associate (unused => self)
      end associate
      walk%limits = walk_options(skips_failed=.true., work=most_work)
      walk%ways = response_ways
      call walk%known%start(n)
   end subroutine plan

   !> What points say that was solved as the case asks for.
   subroutine say_solver(self)
      class(response), intent(inout) :: self

      self%served_by_first = served_by_newton
      if (self%kind == solver_powell) self%served_by_first = served_by_powell
      if (self%kind == solver_kinsol) self%served_by_first = served_by_kinsol
   end subroutine say_solver

   !> Problem and state; an error is a case that cannot be computed. It has to stay where it is.
   subroutine build(self, case, error)
      class(response), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      allocate (self%problem, self%state)
      call build_system(case, self%problem, self%state, error)
      if (allocated(error)) return
      self%balance => self%state
      self%n = self%state%n
      call self%start(case, case%harmonics)
      call self%say_solver()
   end subroutine build

   !> Another point is wanted.
   subroutine begin(self, case, request)
      class(response), intent(inout) :: self
      type(case_type), intent(in), target :: case
      type(point_request), intent(in) :: request

      self%case => case
      self%balance%interrupt => request%interrupt
      self%newton%linear%lu_left_out = .false.
      self%is_hopeless = .false.
   end subroutine begin

   !> Evaluate the balance at unknowns, where it stands.
   subroutine evaluate(self, x)
      class(response), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp) :: r(size(x))

      call self%balance%residual(x, r)
   end subroutine evaluate

   !> What else is worth knowing where the point is solved; the solution stays.
   subroutine look_further(self, walk, request, x, error)
      class(response), intent(inout) :: self
      type(walk_type), intent(in) :: walk
      type(point_request), intent(in) :: request
      real(wp), intent(inout), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_walk => walk, unused_request => request, unused_x => x, &
                 unused_error => allocated(error))
      end associate
   end subroutine look_further

   !> Why a point was not found, where that is known; left unallocated otherwise.
   subroutine explain(self, case, request, note)
      class(response), intent(in) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      character(:), allocatable, intent(inout) :: note

      associate (unused => self, unused_case => case, unused_request => request, &
                 unused_note => allocated(note))
      end associate
   end subroutine explain

   !> What only it has, and derivatives where they are asked for.
   subroutine add_to(self, case, request, x, report, sensitivity, point, error)
      class(response), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      real(wp), intent(in), contiguous :: x(:)
      type(solver_report), intent(in) :: report
      type(sensitivity_solver), intent(inout) :: sensitivity
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error

      if (.not. (report%converged .and. request%sensitivity)) return
      call sensitivity%find(case, self%balance, x, point, error)
   end subroutine add_to

   !> What all points together make worth saying.
   subroutine remark(self, n_points, remarks)
      class(response), intent(in) :: self
      integer, intent(in) :: n_points
      type(remark_list), intent(inout) :: remarks

      associate (unused => self, unused_count => n_points, unused_remarks => remarks)
      end associate
   end subroutine remark

   !> The system of its curve over the place, for arc length; null where there is none to follow.
   function curve_system(self) result(system)
      class(response), intent(in), target :: self
      class(parameter_system), pointer :: system

      system => self%balance
   end function curve_system

   !> From a solution x, which comes to the unknowns of the curve; its least size that matters.
   subroutine begin_curve(self, level, x, curve)
      class(response), intent(inout) :: self
      !> That is asked for, 0 where none is.
      real(wp), intent(in) :: level
      real(wp), intent(inout) :: x(:)
      class(arclength_type), intent(inout) :: curve

      associate (unused => self, unused_level => level, unused_x => x, unused_curve => curve)
      end associate
   end subroutine begin_curve

   !> Stand at a point of the curve with its unknowns as those of a point, until `back_to_curve`.
   !> Where it is none report%converged is false, and the curve ends.
   subroutine take_from_curve(self, found, at, x, report, ending, error)
      class(response), intent(inout) :: self
      type(branch_point), intent(in) :: found
      type(point_request), intent(in) :: at
      real(wp), intent(out), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      !> Why it ends; not allocated where it does not.
      character(:), allocatable, intent(out) :: ending
      type(error_type), allocatable, intent(out) :: error

      associate (unused => allocated(ending))
      end associate
      x = found%x
      report = found%report
      call self%stand(at%at(), error)
   end subroutine take_from_curve

   subroutine back_to_curve(self)
      class(response), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine back_to_curve

   !> Coefficients of the observed quantities at unknowns beside the curve; not allocated where
   !> the motion of the point is not that of the curve.
   subroutine observe_beside(self, at, x, n_harmonics, coefficients, error)
      class(response), intent(inout) :: self
      type(position), intent(in) :: at
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: n_harmonics
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      type(error_type), allocatable, intent(out) :: error

      call self%stand(at, error)
      if (allocated(error)) return
      call observed_coefficients(self%balance, x(:self%balance%n), n_harmonics, coefficients)
   end subroutine observe_beside

end module fw_response
