!> Points of any vibration that is asked for point by point: a walk leads to each, and the vibration
!> says what it is.
module fw_walked_points
   use fw_case, only: case_type
   use fw_describe, only: describer
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_remarks, only: remark_undetermined
   use fw_response, only: response
   use fw_run_state, only: run_state
   use fw_solution_history, only: position
   use fw_strategy, only: point_request, point_strategy, solver_memory
   use fw_summary, only: summary_type
   use fw_vibration, only: walk_type
   implicit none (type, external)
   private

   public :: walked_points

   type, extends(point_strategy) :: walked_points
      !> Chosen before the start.
      class(response), allocatable :: v
      type(walk_type) :: walk
      type(describer) :: about
      !> Unknowns of the present point.
      real(wp), allocatable :: x(:)
      !> Points that were not found, and no reason was either.
      integer, private :: n_unexplained = 0
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: describe_point
      procedure :: remember
      procedure :: recall
      procedure :: start_anew
   end type walked_points

contains

   subroutine start(self, case, error)
      class(walked_points), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call self%v%build(case, error)
      if (allocated(error)) return
      call self%v%plan(self%v%n, self%walk)
      allocate (self%x(self%v%n), source=0.0_wp)
   end subroutine start

   subroutine solve(self, case, request, point, error)
      class(walked_points), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      type(position) :: at

      call self%about%start_clock()
      if (allocated(self%note)) deallocate (self%note)
      associate (v => self%v, walk => self%walk, x => self%x)
         at = request%at()
         call v%begin(case, request)
         call walk%begin_point(v, at, case%solver%max_iterations, request%most_work)
         call walk%from_guesses(v, at, x, report, error)
         if (request%fallback .and. .not. (v%is_hopeless .or. allocated(error))) then
            call walk%go(v, at, x, report, error)
         end if
         if (report%interrupted .and. .not. allocated(error)) then
            call stop_run(request%interrupt, error)
         end if
         if (allocated(error)) return
         if (report%converged .and. request%fallback) then
            call v%look_further(walk, request, x, error)
            if (allocated(error)) return
         end if
         report%iterations = v%iterations
         call self%describe_point(case, request, report, walk%served_by, point, error)
         if (allocated(error)) return
         if (.not. report%converged) call v%explain(case, request, point%note)
      end associate
      if (.not. (report%converged .or. allocated(point%note))) then
         self%n_unexplained = self%n_unexplained + 1
      end if
      call self%about%note_seconds(point)
   end subroutine solve

   !> What is known of the solution, at the place where it was found.
   subroutine describe_point(self, case, request, report, served_by, point, error)
      class(walked_points), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(solver_report), intent(in) :: report
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error

      associate (v => self%v, x => self%x)
         call v%evaluate(x)
         call self%about%describe(case, request, case%harmonics%n_harmonics, v%balance, &
                                  x(:v%balance%n), report, served_by, point, error)
         if (allocated(error)) return
         call v%add_to(case, request, x, report, self%about%sensitivity, point, error)
      end associate
   end subroutine describe_point

   !> The work done, and why points failed.
   subroutine describe(self, case, state, summary, message)
      class(walked_points), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message

      message = ''
      associate (balance => self%v%balance, v => self%v)
         call summary%describe_work(balance, v%newton%linear, case%solver%kind, &
                                    state%all_converged())
         call self%about%sensitivity%report(case, balance, summary)
         call v%remark(state%n_points, summary%remarks)
         call remark_undetermined(v%undetermined, summary%remarks)
         if (state%was_stopped .or. state%all_converged()) return
         message = 'not converged: for the reasons above'
         if (self%n_unexplained > 0) then
            message = 'not converged: try smaller steps of frequency or amplitude, or more '// &
                      'harmonics%n_harmonics, for the points above'
         end if
         if (v%rippled) message = message//'; some were solved with friction that is '// &
            "ripple, not slip: take contact%law = 'rigid' where friction acts on mass"
      end associate
   end subroutine describe

   !> The last solution, so that points of a search start from it; none where levels are asked for,
   !> which a place alone does not tell.
   subroutine remember(self, memory)
      class(walked_points), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      if (self%walk%known%kept == 0 .or. self%walk%limits%from_nothing) return
      memory%x = self%walk%known%x(:, 1)
      memory%omega = self%walk%known%place(1)
   end subroutine remember

   subroutine recall(self, memory)
      class(walked_points), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      if (.not. allocated(memory%x)) return
      call self%walk%known%begin_with(memory%omega, memory%x)
   end subroutine recall

   subroutine start_anew(self)
      class(walked_points), intent(inout) :: self

      if (self%walk%limits%from_nothing) return
      self%walk%known%kept = 0
      self%walk%failures = 0
   end subroutine start_anew

end module fw_walked_points
