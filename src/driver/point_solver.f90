!> One solution point: a walk to the response at a place, and what is reported of it.
module fw_point_solver
   use fw_kinds, only: wp
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_contact_data, only: memory_carried
   use fw_describe, only: describer
   use fw_error, only: error_type
   use fw_harmonics_options, only: harmonics_options
   use fw_interrupt, only: stop_run
   use fw_newton, only: solver_report
   use fw_point, only: point_type, served_by_pseudo_time
   use fw_response, only: flow_of_case, response
   use fw_solution_history, only: position
   use fw_solver_options, only: solver_newton, solver_options, solver_pseudo_time
   use fw_strategy, only: point_request
   use fw_text, only: to_text
   use fw_vibration, only: walk_type
   implicit none (type, external)
   private

   public :: point_solver

   type :: point_solver
      !> The solver of the case, and pseudo-time where it fails.
      type(response) :: method
      !> What is known of the points before. (Of a sweep over another parameter its places are
      !> values.)
      type(walk_type) :: walk
      type(describer) :: about
      !> The present solution.
      real(wp), allocatable :: x(:), r(:)
      !> Options of the case: a point may ask for others.
      type(solver_options), private :: options
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
      call self%method%plan(n, self%walk)
   end subroutine start

   !> Solve at a frequency; not converging is an outcome, marked in the point.
   subroutine solve(self, case, system, request, point, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in), target :: case
      type(balance_state), intent(inout), target :: system
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(position) :: at
      type(solver_report) :: report

      at = position(request%place())
      call begin(self, case, system, request, at, error)
      if (allocated(error)) return
      associate (walk => self%walk, method => self%method)
         if (method%kind == solver_pseudo_time) then
            call method%try_own(flow_of_case, walk, at, self%x, report, error)
            if (report%converged) walk%served_by = served_by_pseudo_time
         else
            call walk%from_guesses(method, at, self%x, report, error)
            if (request%fallback .and. .not. allocated(error)) then
               call walk%go(method, at, self%x, report, error)
            end if
         end if
         method%newton%options = self%options
         method%kind = case%solver%kind
         if (report%interrupted .and. .not. allocated(error)) then
            call stop_run(request%interrupt, error)
         end if
         if (allocated(error)) return
         call settle(self, report)
         report%iterations = method%iterations
         if (walk%out_of_work .and. .not. report%converged) then
            point%note = 'work limit: the other ways to '//trim(request%describe())// &
                         ' were left after '//to_text(method%iterations)//' iterations'
         end if
         call self%about%describe(case, request, method%harmonics%n_harmonics, system, self%x, &
                                  report, walk%served_by, point, error)
      end associate
      if (allocated(error)) return
      call self%method%add_to(case, request, self%x, report, self%about%sensitivity, point, error)
      if (allocated(error)) return
      if (report%converged .and. case%contact%memory == memory_carried) then
         associate (contact => system%work(system%problem%forces%pairs))
            ! The march of the next point starts where that of this one ended.
            contact%x_start = contact%x
         end associate
      end if
      call self%about%note_seconds(point)
   end subroutine solve

   !> What is asked of the point and its solver.
   subroutine begin(self, case, system, request, at, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in), target :: case
      type(balance_state), intent(inout), target :: system
      type(point_request), intent(in) :: request
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error

      call self%about%start_clock()
      self%method%balance => system
      call self%method%begin(case, request)
      associate (walk => self%walk)
         call walk%begin_point(self%method, at, case%solver%max_iterations, request%most_work)
         if (.not. request%again) call walk%failed%clear()
      end associate
      if (allocated(system%moved%mover)) call system%set_frequency(request%omega, error)
      if (allocated(error)) return
      self%options = self%method%newton%options
      if (request%by_newton) self%method%kind = solver_newton
      call self%method%say_solver()
      associate (options => self%method%newton%options)
         options%tolerance = max(options%tolerance, request%tolerance)
         if (request%most_iterations > 0) then
            options%max_iterations = min(options%max_iterations, request%most_iterations)
            options%fallback = .false.
         end if
         self%walk%one_guess = .not. options%fallback
         self%walk%raise_unit = options%max_iterations
      end associate
   end subroutine begin

   !> Stand at the solution, or at the best that was found; count what fails in a row.
   subroutine settle(self, report)
      class(point_solver), intent(inout) :: self
      type(solver_report), intent(inout) :: report

      associate (walk => self%walk)
         walk%failures = merge(0, walk%failures + 1, report%converged)
         if (.not. report%converged .and. walk%best_residual < huge(1.0_wp)) then
            self%x = walk%best
            report%residual = walk%best_residual
         end if
      end associate
      ! Forces and states of this very point: the last trial may have been another.
      if (report%converged .and. self%method%stands) return
      call self%method%balance%residual(self%x, self%r)
   end subroutine settle

end module fw_point_solver
