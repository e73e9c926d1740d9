!> Analyses 'frf' and 'point': the periodic response at the frequencies of a sweep.
module fw_frequency_response
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_case, only: analysis_frf
   use fw_branch, only: run_branch
   use fw_diagnosis, only: explain_failure
   use fw_error, only: error_type
   use fw_hbm, only: hbm_system
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
      type(hbm_system), target :: system
      type(point_solver) :: solver
      type(point_type) :: point
      character(:), allocatable :: reason
      integer :: k, n_points

      call build_system(case, system, error)
      if (allocated(error)) return
      call solver%start(case, system%n)
      if (case%analysis == analysis_frf .and. &
          case%sweep%continuation == continuation_arclength) then
         call observer%on_start(case%title, 0)
         call run_branch(case, system, solver, observer, writer, summary, error)
         call observer%on_end()
         call summary%describe_work(system, solver%method%newton%linear, case%solver%kind)
         return
      end if
      n_points = 1
      if (case%analysis == analysis_frf) n_points = case%sweep%n_points
      call observer%on_start(case%title, n_points)
      do k = 1, n_points
         call solve_frequency(case, system, solver, sweep_frequency(case%sweep, k, n_points), &
                              observer, point, error)
         if (allocated(error)) exit
         call writer%add_point(point, error)
         if (allocated(error)) exit
         call summary%add(point)
         call observer%on_point(k, n_points, point)
         if (observer%stop_requested .and. k < n_points) then
            call summary%mark_incomplete()
            exit
         end if
      end do
      call observer%on_end()
      call summary%describe_work(system, solver%method%newton%linear, case%solver%kind)
      if (solver%n_by_flow > 0) call summary%note_fallback(solver%n_by_flow)
      if (allocated(error) .or. summary%n_converged > 0 .or. observer%stop_requested) return
      call explain_failure(system, solver%method, reason)
      call observer%on_message('not converged: '//reason)
   end subroutine run_frequency_response

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
