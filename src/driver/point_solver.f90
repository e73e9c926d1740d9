!> One solution point: warm start, other guesses, pseudo-time, intermediate frequencies or loads;
!> then what is reported, and which of these served.
module fw_point_solver
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_interrupt, only: stop_run
   use fw_contact_data, only: memory_carried
   use fw_describe, only: describer
   use fw_error, only: error_type
   use fw_failed_starts, only: failed_starts
   use fw_guess, only: free_guess, stuck_guess
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_state, only: balance_state
   use fw_newton, only: solver_report
   use fw_point, only: point_type, served_by_free_guess, served_by_kinsol, served_by_newton, &
      served_by_none, served_by_other_guess, served_by_powell, served_by_pseudo_time, &
      served_by_raised_load, served_by_smaller_steps
   use fw_solution, only: solution_method
   use fw_solution_history, only: solution_history
   use fw_strategy, only: point_request
   use fw_solver_options, only: pseudo_time_options, solver_kinsol, solver_newton, solver_options, &
      solver_powell, solver_pseudo_time
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: looks_again, point_solver

   !> Halvings of a frequency step that fails.
   ! A 64th of a step of the sweep.
   integer, parameter :: max_halvings = 6
   !> Steps of the pseudo-time fallback, and failures in a row after which it is left alone: a
   !> joint that cannot carry its load has no solution to flow to.
   integer, parameter :: fallback_steps = 60, max_flow_failures = 2
   !> Unknowns up to which pseudo-time comes before a raised load on the way to a first point.
   integer, parameter :: flow_first_up_to = 4000
   !> Unknowns from which two halvings of the step come before pseudo-time as well: a few solutions,
   !> where a flow factors matrices of all coordinates.
   integer, parameter :: steps_first_from = 1000
   !> Points that fail in a row after which a sweep spends less on a point: it has gone where no
   !> solution exists, or where none is found in this way. After 4, 8, 16, .. of them it looks
   !> again: a sweep that begins where nothing is found comes to where something is.
   integer, parameter :: most_point_failures = 2
   !> Iterations spent on a point after which no other way to it is begun, over max_iterations, of
   !> which at least as many count. (Where a sector loses its hold, points take 470 at most, and
   !> none of those with a solution took more than 25.)
   integer, parameter :: most_work = 20, least_counted = 60
   !> The same of raising the load, over what was spent before: it advances step by step, and where
   !> it gets there no other way did.
   integer, parameter :: raising_work = 50
   !> First and smallest step of the load on the way to a first solution.
   real(wp), parameter :: first_load_step = 0.25_wp, smallest_load_step = 1.0_wp/512.0_wp
   !> Ways from a start that are not gone twice: the solver of the case, with LU after GMRES, and
   !> pseudo-time.
   integer, parameter :: way_solver = 1, way_lu = 2, way_flow = 3

   type :: point_solver
      !> The solver of the case, and pseudo-time where it fails.
      type(solution_method) :: method
      type(describer) :: about
      !> The present solution, and the last converged ones with their frequencies. (Of a sweep over
      !> another parameter, here and below its values.)
      real(wp), allocatable :: x(:), r(:)
      type(solution_history) :: known
      !> The point to be solved, and the best that was found of it where nothing converged.
      real(wp) :: omega_wanted = -1.0_wp
      real(wp) :: best_residual = huge(1.0_wp)
      real(wp), allocatable :: best(:)
      !> Points that the pseudo-time fallback has saved.
      integer :: n_by_flow = 0
      integer :: flow_failures = 0
      !> Points without a solution since the last one with it.
      integer :: point_failures = 0
      !> Iterations of a point from which on no other way is begun, and whether that was so.
      integer :: work_limit = huge(1)
      logical :: out_of_work = .false.
      !> Options of the case: a point may ask for others.
      type(solver_options) :: options
      !> The same that the request allows at the most, raising the load included.
      integer, private :: most_allowed = huge(1)
      !> Friction of the present point was ripple in a solution of the solver, or of any way. Then
      !> smaller steps, LU and the free guess came to no other one (0 of 180 such points of dlft on
      !> masses), and other balances neither where the solver had found it (0 of 140).
      logical :: found_ripple = .false., ripples = .false.
      !> Where the present point was started from in vain.
      type(failed_starts), private :: failed
      !> Where the present attempt starts.
      real(wp), allocatable, private :: tried(:)
      !> What gave the present solution.
      integer :: served_by = served_by_none
   contains
      procedure :: start
      procedure :: solve
   end type point_solver

contains

   !> Nothing is known yet; the first solution starts from a guess of the system.
   subroutine start(self, case, harmonics, n)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Of the system: those of the case, or of a level.
      type(harmonics_options), intent(in) :: harmonics
      !> Unknowns of the system.
      integer, intent(in) :: n

      call self%method%start(case, harmonics)
      allocate (self%x(n), self%r(n), source=0.0_wp)
      call self%known%start(n)
   end subroutine start

   !> Solve at a frequency; not converging is an outcome, marked in the point.
   subroutine solve(self, case, system, request, point, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout), target :: system
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      integer :: iterations

      iterations = 0
      call begin(self, case, system, request, error)
      if (allocated(error)) return
      if (self%method%kind == solver_pseudo_time) then
         call by_flow(self, case, case%pseudo_time, system, request%place(), report, iterations, &
                      error)
      else
         call from_guesses(self, system, request%place(), report, iterations, error)
         if (request%fallback .and. .not. allocated(error)) then
            call beyond_guesses(self, case, system, request%place(), report, iterations, error)
         end if
      end if
      self%method%newton%options = self%options
      self%method%kind = case%solver%kind
      if (report%interrupted .and. .not. allocated(error)) call stop_run(request%interrupt, error)
      if (allocated(error)) return
      call settle(self, system, report)
      report%iterations = iterations
      if (self%out_of_work .and. .not. report%converged) then
         point%note = 'work limit: the other ways to '//trim(request%describe())// &
                      ' were left after '//to_text(iterations)//' iterations'
      end if
      call self%about%describe(case, request, self%method%harmonics%n_harmonics, system, self%x, &
                               report, self%served_by, point, error)
      if (allocated(error)) return
      if (report%converged .and. request%sensitivity) then
         call self%about%sensitivity%find(case, system, self%x, point, error)
         if (allocated(error)) return
      end if
      if (report%converged .and. case%contact%memory == memory_carried) then
         associate (contact => system%work(system%problem%forces%pairs))
            ! The march of the next point starts where that of this one ended.
            contact%x_start = contact%x
         end associate
      end if
      call self%about%note_seconds(point)
   end subroutine solve

   !> What is asked of the point and its solver.
   subroutine begin(self, case, system, request, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout), target :: system
      type(point_request), intent(in) :: request
      type(error_type), allocatable, intent(out) :: error

      call self%about%start_clock()
      self%omega_wanted = request%place()
      self%best_residual = huge(1.0_wp)
      self%most_allowed = request%most_work
      self%work_limit = min(request%most_work, &
                            most_work*max(case%solver%max_iterations, least_counted))
      self%out_of_work = .false.
      if (.not. request%again) call self%failed%clear()
      self%found_ripple = .false.
      self%ripples = .false.
      system%interrupt => request%interrupt
      if (allocated(system%moved%mover)) call system%set_frequency(request%omega, error)
      if (allocated(error)) return
      self%options = self%method%newton%options
      if (request%by_newton) self%method%kind = solver_newton
      self%method%newton%linear%lu_left_out = .false.
      associate (options => self%method%newton%options)
         options%tolerance = max(options%tolerance, request%tolerance)
         if (request%most_iterations > 0) then
            options%max_iterations = min(options%max_iterations, request%most_iterations)
            options%fallback = .false.
         end if
      end associate
   end subroutine begin

   !> Stand at the solution, or at the best that was found; count what fails in a row.
   subroutine settle(self, system, report)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      type(solver_report), intent(inout) :: report

      self%point_failures = merge(0, self%point_failures + 1, report%converged)
      if (.not. report%converged .and. self%best_residual < huge(1.0_wp)) then
         self%x = self%best
         report%residual = self%best_residual
      end if
      ! Forces and states of this very point: the last trial may have been another.
      if (.not. (report%converged .and. self%method%stands)) call system%residual(self%x, self%r)
   end subroutine settle

   !> Whether other ways to the point are worth beginning.
   logical function goes_on(self, report, iterations)
      class(point_solver), intent(inout) :: self
      type(solver_report), intent(in) :: report
      integer, intent(in) :: iterations

      goes_on = .not. (report%converged .or. report%interrupted)
      if (.not. goes_on) return
      self%out_of_work = iterations >= self%work_limit
      goes_on = .not. self%out_of_work
   end function goes_on

   !> Where the best guesses known fail: pseudo-time; then from the last point on the sweep by
   !> halves, or to the first point by raising the load; Newton again, with LU where GMRES failed;
   !> and at last from the solution without contact, which may lie on another branch.
   subroutine beyond_guesses(self, case, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(inout) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      if (.not. goes_on(self, report, iterations)) return
      if (looks_again(self%point_failures + 1)) then
         call by_other_ways(self, case, system, omega, report, iterations, error)
         if (allocated(error)) return
         if (.not. goes_on(self, report, iterations)) return
      end if
      if (self%ripples) return
      if (self%method%newton%linear%lu_left_out) then
         self%method%newton%linear%lu_follows = .true.
         call from_guesses(self, system, omega, report, iterations, error)
         self%method%newton%linear%lu_follows = .false.
         if (allocated(error) .or. report%converged .or. report%interrupted) return
      end if
      call from_free_guess(self, system, omega, report, iterations)
   end subroutine beyond_guesses

   !> Ways that cost many solutions: pseudo-time, then smaller steps of the frequency or the load,
   !> of which a few come first where there are many unknowns.
   subroutine by_other_ways(self, case, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      ! The flow forms and factors matrices of all coordinates for every step: with many of them the
      ! load is raised first, where there is no point to come from.
      if (self%ripples .and. size(self%x) > flow_first_up_to) return
      if (self%known%kept == 0 .and. size(self%x) > flow_first_up_to) then
         call raise_load(self, system, omega, report, iterations, error)
         if (allocated(error)) return
         if (report%converged) self%served_by = served_by_raised_load
         if (.not. goes_on(self, report, iterations)) return
      end if
      ! No flow has been derived for the whole of cyclic structures.
      if (self%flow_failures < max_flow_failures .and. .not. case%model%cyclic%is_cyclic) then
         if (self%known%kept > 0 .and. size(self%x) > steps_first_from .and. &
             .not. self%ripples) then
            call approach(self, system, omega, max_halvings - 1, report, iterations, error)
            if (allocated(error)) return
            if (report%converged) self%served_by = served_by_smaller_steps
            if (.not. goes_on(self, report, iterations)) return
         end if
         call by_flow(self, case, pseudo_time_options(max_steps=fallback_steps), system, omega, &
                      report, iterations, error)
         if (allocated(error)) return
         self%flow_failures = merge(0, self%flow_failures + 1, report%converged)
         if (report%converged) self%n_by_flow = self%n_by_flow + 1
         if (.not. goes_on(self, report, iterations)) return
      end if
      if (self%ripples) return
      if (self%known%kept == 0) then
         if (size(self%x) > flow_first_up_to) return
         call raise_load(self, system, omega, report, iterations, error)
         if (report%converged) self%served_by = served_by_raised_load
      else
         call approach(self, system, omega, 1, report, iterations, error)
         if (report%converged) self%served_by = served_by_smaller_steps
      end if
   end subroutine by_other_ways

   !> The last resort.
   subroutine from_free_guess(self, system, omega, report, iterations)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(inout) :: report
      integer, intent(inout) :: iterations
      type(solver_report) :: last_report

      call free_guess(system, self%x)
      if (is_new(self, system, last_report)) then
         call self%method%solve(system, self%x, last_report)
         call note_attempt(self, system, last_report)
      end if
      iterations = iterations + last_report%iterations
      report%interrupted = last_report%interrupted
      if (.not. last_report%converged) return
      report = last_report
      self%served_by = served_by_free_guess
      call self%known%remember(omega, self%x)
   end subroutine from_free_guess

   !> Integrate in pseudo-time from the last solution, or from the stuck guess.
   subroutine by_flow(self, case, pseudo, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(pseudo_time_options), intent(in) :: pseudo
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: start(:)

      call system%set_parameter(omega, error)
      if (allocated(error)) return
      if (self%known%kept > 0) then
         self%x = self%known%x(:, 1)
      else
         call stuck_guess(system, self%x)
      end if
      if (self%failed%hold(way_flow, omega, system%load_share, self%x)) return
      start = self%x
      call self%method%solve_by_flow(case, pseudo, system, self%x, report, error)
      if (allocated(error)) return
      if (.not. (report%converged .or. report%interrupted)) then
         call self%failed%add(way_flow, omega, system%load_share, start)
      end if
      iterations = iterations + report%iterations
      if (report%converged) then
         self%served_by = served_by_pseudo_time
         call self%known%remember(omega, self%x)
      else
         self%ripples = self%ripples .or. self%method%ripples
         call note_best(self, system, report)
      end if
   end subroutine by_flow

   !> From the static position to the full vibratory load, by steps that adapt.
   subroutine raise_load(self, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: reached(:)
      real(wp) :: share, step

      share = 0.0_wp
      step = first_load_step
      self%work_limit = max(self%work_limit, iterations + raising_work* &
                            max(self%method%newton%options%max_iterations, least_counted))
      self%work_limit = min(self%work_limit, self%most_allowed)
      ! The position at rest, from which the load is raised.
      system%load_share = 0.0_wp
      call system%set_parameter(omega, error)
      if (allocated(error)) return
      call stuck_guess(system, self%x)
      reached = self%x
      do
         system%load_share = min(1.0_wp, share + step)
         call system%set_parameter(omega, error)
         if (allocated(error)) exit
         if (is_new(self, system, report)) then
            call self%method%solve(system, self%x, report)
            call note_attempt(self, system, report)
         end if
         iterations = iterations + report%iterations
         if (report%converged) then
            reached = self%x
            share = system%load_share
            if (share >= 1.0_wp) exit
            ! Slower up than down: a failure costs more than a step.
            step = 1.5_wp*step
         else
            self%x = reached
            step = 0.5_wp*step
            if (step < smallest_load_step .or. self%ripples) exit
            if (.not. goes_on(self, report, iterations)) exit
         end if
      end do
      ! On every way out: the system serves other points after this one.
      system%load_share = 1.0_wp
      if (report%converged) then
         call self%known%remember(omega, self%x)
      else if (.not. allocated(error)) then
         call system%set_parameter(omega, error)
      end if
   end subroutine raise_load

   !> Newton from the guesses at a frequency: extrapolation along the sweep, the last solution, all
   !> stuck.
   subroutine from_guesses(self, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      integer :: guess, first

      call system%set_parameter(omega, error)
      if (allocated(error)) return
      first = 3 - min(self%known%kept, 2)
      do guess = first, 3
         select case (guess)
         case (1)
            call self%known%predict(omega, self%x)
         case (2)
            self%x = self%known%x(:, 1)
         case default
            call stuck_guess(system, self%x)
         end select
         if (is_new(self, system, report)) then
            call self%method%solve(system, self%x, report)
            call note_attempt(self, system, report)
         end if
         iterations = iterations + report%iterations
         if (report%converged .or. report%interrupted) exit
         if (.not. self%method%newton%options%fallback) exit
      end do
      if (.not. report%converged) return
      self%served_by = served_by_other_guess
      if (guess == first) self%served_by = first_choice(self%method%kind)
      call self%known%remember(omega, self%x)
   end subroutine from_guesses

   !> First half of the way from the last point, which may take halves of its own, then the rest.
   recursive subroutine approach(self, system, omega, depth, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      !> Halvings on the way here, this one included.
      integer, intent(in) :: depth
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: middle

      ! The last place moves on with every success, also within this procedure.
      middle = 0.5_wp*(self%known%place(1) + omega)
      call from_guesses(self, system, middle, report, iterations, error)
      if (allocated(error)) return
      if (halves_again(self, depth, report, iterations)) then
         call approach(self, system, middle, depth + 1, report, iterations, error)
         if (allocated(error)) return
      end if
      if (report%converged) then
         call from_guesses(self, system, omega, report, iterations, error)
         if (allocated(error)) return
         if (halves_again(self, depth, report, iterations)) then
            call approach(self, system, omega, depth + 1, report, iterations, error)
            if (allocated(error)) return
         end if
      end if
      ! Left at the frequency that was asked for.
      if (.not. report%converged) call system%set_parameter(omega, error)
   end subroutine approach

   !> Whether half of the way is tried. In two statements: `goes_on` notes why not, and the compiler
   !> may leave out what stands behind .and., or not.
   logical function halves_again(self, depth, report, iterations)
      class(point_solver), intent(inout) :: self
      integer, intent(in) :: depth
      type(solver_report), intent(in) :: report
      integer, intent(in) :: iterations

      halves_again = depth < max_halvings
      if (halves_again) halves_again = goes_on(self, report, iterations)
   end function halves_again

   !> The solver that the case asks for.
   pure integer function first_choice(kind)
      integer, intent(in) :: kind

      select case (kind)
      case (solver_powell)
         first_choice = served_by_powell
      case (solver_kinsol)
         first_choice = served_by_kinsol
      case default
         first_choice = served_by_newton
      end select
   end function first_choice

   !> Whether the guess in x has not failed before in the way that is tried now.
   logical function is_new(self, system, report)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(in) :: system
      !> That of no solution.
      type(solver_report), intent(out) :: report

      is_new = .not. self%failed%hold(present_way(self), system%parameter(), system%load_share, &
                                      self%x)
      if (is_new) self%tried = self%x
   end function is_new

   pure integer function present_way(self) result(way)
      class(point_solver), intent(in) :: self

      way = merge(way_lu, way_solver, self%method%newton%linear%lu_follows)
   end function present_way

   !> What an attempt came to: the start that failed, and the best that fails at the
   !> point itself.
   subroutine note_attempt(self, system, report)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(in) :: system
      type(solver_report), intent(in) :: report

      if (report%converged .or. report%interrupted) return
      call self%failed%add(present_way(self), system%parameter(), system%load_share, self%tried)
      call note_best(self, system, report)
      if (system%load_share < 1.0_wp) return
      if (abs(system%parameter() - self%omega_wanted) > 0.0_wp) return
      self%found_ripple = self%found_ripple .or. self%method%ripples
      self%ripples = self%ripples .or. self%method%ripples
   end subroutine note_attempt

   !> Keep the unknowns of the smallest residual, where they failed at the point itself:
   !> intermediate frequencies and loads are no answer to what was asked. NaN is never smaller.
   subroutine note_best(self, system, report)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(in) :: system
      type(solver_report), intent(in) :: report

      if (report%converged .or. system%load_share < 1.0_wp) return
      if (abs(system%parameter() - self%omega_wanted) > 0.0_wp) return
      if (.not. report%residual < self%best_residual) return
      self%best_residual = report%residual
      self%best = self%x
   end subroutine note_best

   !> Whether a point is worth every way to it, with it the number of points in a row that failed.
   pure logical function looks_again(n_failed)
      integer, intent(in) :: n_failed

      looks_again = n_failed <= most_point_failures .or. popcnt(n_failed) == 1
   end function looks_again

end module fw_point_solver
