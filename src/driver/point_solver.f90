!> One solution point: warm start, other guesses, pseudo-time, intermediate frequencies or loads;
!> then what is reported, and which of these served.
module fw_point_solver
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_interrupt, only: stop_run
   use fw_contact_data, only: memory_carried
   use fw_cycle_recovery, only: recover_cycle
   use fw_error, only: error_type
   use fw_failed_starts, only: failed_starts
   use fw_guess, only: free_guess, stuck_guess
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_state, only: balance_state
   use fw_newton, only: solver_report
   use fw_point, only: point_type, served_by_free_guess, served_by_kinsol, served_by_newton, &
      served_by_none, served_by_other_guess, served_by_powell, served_by_pseudo_time, &
      served_by_raised_load, served_by_smaller_steps
   use fw_recovery, only: recover_histories, recover_point
   use fw_tail, only: recover_tail
   use fw_sensitivity_solver, only: sensitivity_solver
   use fw_solution, only: solution_method
   use fw_solution_history, only: solution_history
   use fw_stability_solver, only: stability_solver
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
      type(stability_solver) :: stability
      type(sensitivity_solver) :: sensitivity
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
      !> The same that the request allows at the most, raising the load included.
      integer, private :: most_allowed = huge(1)
      !> Friction of the present point was ripple in a solution of the solver, or of any way. Then
      !> smaller steps, LU and the free guess came to no other one (0 of 180 such points of dlft on
      !> masses), and other balances neither where the solver had found it (0 of 140).
      logical :: found_ripple = .false., ripples = .false.
      !> Where the present point was started from in vain.
      type(failed_starts), private :: failed
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
      type(solver_options) :: kept
      integer(int64) :: clock, clock_end, rate

      call system_clock(clock, rate)
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
      kept = self%method%newton%options
      if (request%by_newton) self%method%kind = solver_newton
      associate (options => self%method%newton%options)
         options%tolerance = max(options%tolerance, request%tolerance)
         if (request%most_iterations > 0) then
            options%max_iterations = min(options%max_iterations, request%most_iterations)
            options%fallback = .false.
         end if
      end associate
      call reach(self, case, system, request, report, point%iterations, error)
      self%method%newton%options = kept
      self%method%kind = case%solver%kind
      if (report%interrupted .and. .not. allocated(error)) call stop_run(request%interrupt, error)
      if (allocated(error)) return
      if (self%out_of_work .and. .not. report%converged) then
         point%note = 'work limit: the other ways to '//trim(request%describe())// &
                      ' were left after '//to_text(point%iterations)//' iterations'
      end if
      self%point_failures = merge(0, self%point_failures + 1, report%converged)
      if (report%converged) point%served_by = self%served_by
      if (.not. report%converged .and. self%best_residual < huge(1.0_wp)) then
         self%x = self%best
         report%residual = self%best_residual
      end if
      ! Forces and states of this very point: the last trial may have been another.
      if (.not. (report%converged .and. self%method%stands)) call system%residual(self%x, self%r)
      point%omega = request%omega
      point%place = request%place()
      point%load_scale = case%model%harmonic_scale*system%vibratory_factor()
      point%converged = report%converged
      point%residual = report%residual
      ! Also of a point that failed: it is written with its mark.
      call recover_point(system, self%x, self%method%harmonics%n_harmonics, request%contact, point)
      call recover_tail(system, case%model, case%contact, point%omega, case%output%tail, point)
      if (request%histories) then
         call recover_histories(system, size(system%balance, 1), self%x, &
            self%method%harmonics%n_harmonics, point)
      end if
      if (request%cycle) call recover_cycle(system, size(system%balance, 1), self%x, point)
      if (report%converged .and. request%stability) then
         call self%stability%find(case, system, self%x, point, error)
         if (allocated(error)) return
      end if
      if (report%converged .and. request%sensitivity) then
         call self%sensitivity%find(case, system, self%x, point, error)
         if (allocated(error)) return
      end if
      if (report%converged .and. case%contact%memory == memory_carried) then
         associate (contact => system%work(system%problem%forces%pairs))
            ! The march of the next point starts where that of this one ended.
            contact%x_start = contact%x
         end associate
      end if
      call system_clock(clock_end)
      point%seconds = real(clock_end - clock, wp)/real(rate, wp)
   end subroutine solve

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

   !> Newton from the best guesses known. Where all fail: pseudo-time; then from the last point on
   !> the sweep by halves, or to the first point by raising the load; Newton again, with LU where
   !> GMRES failed; and at last from the solution without contact, which may lie on another branch.
   subroutine reach(self, case, system, request, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout), target :: system
      type(point_request), intent(in) :: request
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      if (self%method%kind == solver_pseudo_time) then
         call by_flow(self, case, case%pseudo_time, system, request%place(), report, iterations, &
                      error)
         return
      end if
      self%method%newton%linear%lu_left_out = .false.
      call from_guesses(self, system, request%place(), report, iterations, error)
      if (allocated(error)) return
      if (.not. request%fallback) return
      if (.not. goes_on(self, report, iterations)) return
      if (looks_again(self%point_failures + 1)) then
         call by_other_ways(self, case, system, request%place(), report, iterations, error)
         if (allocated(error)) return
         if (.not. goes_on(self, report, iterations)) return
      end if
      if (self%ripples) return
      if (self%method%newton%linear%lu_left_out) then
         self%method%newton%linear%lu_follows = .true.
         call from_guesses(self, system, request%place(), report, iterations, error)
         self%method%newton%linear%lu_follows = .false.
         if (allocated(error) .or. report%converged .or. report%interrupted) return
      end if
      call from_free_guess(self, system, request%place(), report, iterations)
   end subroutine reach

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
      call attempt(self, system, last_report)
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
         call note_best(self, report)
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
         call attempt(self, system, report)
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

   !> Newton from the guesses at a frequency.
   subroutine from_guesses(self, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      call system%set_parameter(omega, error)
      if (allocated(error)) return
      call try_guesses(self, system, omega, report, iterations)
      if (report%converged) call self%known%remember(omega, self%x)
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

   !> Extrapolation along the sweep, the last solution, all stuck.
   subroutine try_guesses(self, system, omega, report, iterations)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      integer :: guess, first

      first = 3
      if (self%known%kept > 0) first = 2
      if (self%known%kept > 1) first = 1
      do guess = first, 3
         select case (guess)
         case (1)
            call self%known%predict(omega, self%x)
         case (2)
            self%x = self%known%x(:, 1)
         case default
            call stuck_guess(system, self%x)
         end select
         call attempt(self, system, report)
         iterations = iterations + report%iterations
         if (report%converged .or. report%interrupted) exit
         if (.not. self%method%newton%options%fallback) exit
      end do
      if (.not. report%converged) return
      self%served_by = served_by_other_guess
      if (guess == first) self%served_by = first_choice(self%method%kind)
   end subroutine try_guesses

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

   !> One solution from the guess in x, unless that has failed before; the best that fails at the
   !> point itself is noted.
   subroutine attempt(self, system, report)
      class(point_solver), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      type(solver_report), intent(out) :: report
      real(wp), allocatable :: start(:)
      integer :: way

      way = merge(way_lu, way_solver, self%method%newton%linear%lu_follows)
      associate (place => system%parameter(), share => system%load_share)
         if (self%failed%hold(way, place, share, self%x)) return
         start = self%x
         call self%method%solve(system, self%x, report)
         if (report%converged .or. report%interrupted) return
         call self%failed%add(way, place, share, start)
      end associate
      if (system%load_share < 1.0_wp) return
      ! Intermediate frequencies and loads are no answer to what was asked.
      if (abs(system%parameter() - self%omega_wanted) > 0.0_wp) return
      self%found_ripple = self%found_ripple .or. self%method%ripples
      self%ripples = self%ripples .or. self%method%ripples
      call note_best(self, report)
   end subroutine attempt

   !> Keep the unknowns of the smallest residual; NaN is never smaller.
   subroutine note_best(self, report)
      class(point_solver), intent(inout) :: self
      type(solver_report), intent(in) :: report

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
