!> Analyses 'frf' and 'point': the periodic response at the frequencies of a sweep.
module fw_frequency_response
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_case, only: analysis_frf
   use fw_accuracy, only: accuracy_solver
   use fw_adaptive, only: adaptive_solver
   use fw_branch, only: run_branch
   use fw_diagnosis, only: explain_failure
   use fw_diagnosis, only: finer
   use fw_error, only: error_type
   use fw_hbm, only: hbm_system
   use fw_level, only: level_solver
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_problem, only: sweep_frequency
   use fw_result, only: result_writer
   use fw_solver_options, only: continuation_arclength
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: run_frequency_response, solve_frequency

contains

   !> Solve every point, in the order given; each is written as soon as it is known.
   subroutine run_frequency_response(case, observer, writer, summary, error)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(error_type), allocatable, intent(out) :: error

      if (case%harmonics%adaptive .or. case%harmonics%accuracy > 0.0_wp) then
         call sweep_adaptively(case, observer, writer, summary, error)
      else
         call sweep(case, observer, writer, summary, error)
      end if
   end subroutine run_frequency_response

   !> With the harmonics of the case, at given frequencies or along the branch.
   subroutine sweep(case, observer, writer, summary, error)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(error_type), allocatable, intent(out) :: error
      type(hbm_system), target :: system
      type(point_solver) :: solver
      type(point_type) :: point
      character(:), allocatable :: reason
      integer :: k, n_points

      call build_system(case, system, error)
      if (allocated(error)) return
      call solver%start(case, system%n)
      ! A linear structure leaves no unknowns, and no branch that could turn back.
      if (case%analysis == analysis_frf .and. system%n > 0 .and. &
          case%sweep%continuation == continuation_arclength) then
         call observer%on_start(case%title, 0)
         call run_branch(case, system, solver, observer, writer, summary, error)
         call observer%on_end()
         call summary%describe_work(system, solver%method%newton%linear, case%solver%kind)
         return
      end if
      n_points = point_count(case)
      call observer%on_start(case%title, n_points)
      do k = 1, n_points
         call solve_frequency(case, system, solver, sweep_frequency(case%sweep, k, n_points), &
                              observer, point, error)
         if (.not. allocated(error)) call publish(k, n_points, point, observer, writer, summary, &
                                                  error)
         if (allocated(error) .or. summary%incomplete) exit
      end do
      call observer%on_end()
      call summary%describe_work(system, solver%method%newton%linear, case%solver%kind)
      if (solver%n_by_flow > 0) call summary%note_fallback(solver%n_by_flow)
      if (allocated(error) .or. observer%stop_requested) return
      if (summary%n_converged == summary%n_points) return
      reason = 'try a finer sweep, the other direction, another penalty_scale (0.3 or 3) or '// &
               trim(finer(system))//' for the points above'
      if (summary%n_converged == 0) call explain_failure(system, solver%method, reason)
      call observer%on_message('not converged: '//reason)
   end subroutine sweep

   !> With harmonics and instants that each point chooses, up to those of the case.
   subroutine sweep_adaptively(case, observer, writer, summary, error)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(error_type), allocatable, intent(out) :: error
      class(level_solver), allocatable :: solver
      type(point_type) :: point
      character(:), allocatable :: message
      integer :: k, n_points

      if (case%harmonics%adaptive) then
         allocate (adaptive_solver :: solver)
      else
         allocate (accuracy_solver :: solver)
      end if
      call solver%start(case, error)
      if (allocated(error)) return
      n_points = point_count(case)
      call observer%on_start(case%title, n_points)
      do k = 1, n_points
         call solver%solve(case, sweep_frequency(case%sweep, k, n_points), point, error)
         if (.not. allocated(error)) call publish(k, n_points, point, observer, writer, summary, &
                                                  error)
         if (allocated(error) .or. summary%incomplete) exit
      end do
      call observer%on_end()
      call solver%describe(case, summary, message)
      if (len(message) > 0) call observer%on_message(message)
   end subroutine sweep_adaptively

   pure integer function point_count(case)
      type(case_type), intent(in) :: case

      point_count = 1
      if (case%analysis == analysis_frf) point_count = case%sweep%n_points
   end function point_count

   !> A point becomes a row of the result; the observer may end the sweep.
   subroutine publish(k, n_points, point, observer, writer, summary, error)
      integer, intent(in) :: k, n_points
      type(point_type), intent(in) :: point
      class(observer_type), intent(inout) :: observer
      type(result_writer), intent(inout) :: writer
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(out) :: error

      call writer%add_point(point, error)
      if (allocated(error)) return
      call summary%add(point)
      call observer%on_point(k, n_points, point)
      if (observer%stop_requested .and. k < n_points) call summary%mark_incomplete()
   end subroutine publish

   !> One point of a sweep, starting from what the solver knows of the points before it.
   subroutine solve_frequency(case, system, solver, omega, observer, point, error)
      type(case_type), intent(in) :: case
      type(hbm_system), intent(inout), target :: system
      type(point_solver), intent(inout) :: solver
      !> [rad/s]
      real(wp), intent(in) :: omega
      !> Told why a pseudo-time solution failed.
      class(observer_type), intent(inout) :: observer
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      call solver%solve(case, system, omega, point, error)
      if (allocated(error)) return
      if (.not. point%converged .and. allocated(solver%method%message)) then
         call observer%on_message('pseudo-time: '//solver%method%message)
      end if
   end subroutine solve_frequency

end module fw_frequency_response
