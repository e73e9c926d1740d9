!> Run a case: the one entry for the command line, C and Python.
module fw_run
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_combinations, only: check_combinations
   use fw_case, only: analysis_time
   use fw_case, only: analysis_wear
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_error, only: status_not_converged
   use fw_error, only: status_ok
   use fw_error, only: status_stopped
   use fw_frequency_response, only: run_frequency_response
   use fw_hbm, only: hbm_system
   use fw_observer, only: observer_type
   use fw_outcome, only: outcome_type
   use fw_problem, only: build_system
   use fw_restart_file, only: read_restart
   use fw_restart_file, only: restart_type
   use fw_result, only: result_writer
   use fw_summary, only: summary_type
   use fw_summary, only: new_summary
   use fw_threads, only: thread_scope
   use fw_time_response, only: run_time_response
   use fw_wear_response, only: run_wear
   implicit none (type, external)
   private

   public :: run_case, check_case

contains

   !> Everything that would refuse a case before it is computed; nothing is written.
   subroutine check_case(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(hbm_system) :: system
      type(thread_scope) :: threads
      type(restart_type) :: restart

      call check_combinations(case, error)
      if (allocated(error)) return
      if (allocated(case%restart)) call read_restart(case%restart, case, restart, error)
      if (allocated(error)) return
      call threads%enter(case%threads)
      call build_system(case, system, error)
      call threads%leave()
   end subroutine check_case

   !> Run a case and write its result file. Points that did not converge make the outcome
   !> status_not_converged, an observer that asks for it status_stopped; `error` is for what ends
   !> the run.
   subroutine run_case(case, observer, outcome, error, write_file)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout) :: observer
      type(outcome_type), intent(out) :: outcome
      type(error_type), allocatable, intent(out) :: error
      !> False: results leave through the observer only (default: true).
      logical, intent(in), optional :: write_file
      type(result_writer) :: writer
      type(summary_type) :: summary
      type(thread_scope) :: threads
      type(error_type), allocatable :: close_error
      type(restart_type) :: restart
      integer(int64) :: clock, clock_end, rate
      real(wp) :: elapsed

      call system_clock(clock, rate)
      call check_combinations(case, error)
      if (allocated(error)) return
      if (allocated(case%restart)) call read_restart(case%restart, case, restart, error)
      if (allocated(error)) return
      observer%stop_requested = .false.
      if (is_wanted(write_file)) call writer%open(case, error)
      if (allocated(error)) return
      call threads%enter(case%threads)
      summary = new_summary(case)
      select case (case%analysis)
      case (analysis_time)
         call run_time_response(case, observer, writer, summary, error)
      case (analysis_wear)
         call run_wear(case, restart, observer, writer, summary, error)
      case default
         call run_frequency_response(case, observer, writer, summary, error)
      end select
      call threads%leave()
      call system_clock(clock_end)
      elapsed = real(clock_end - clock, wp)/real(rate, wp)
      if (summary%n_converged < summary%n_points .or. summary%incomplete) then
         outcome%status = status_not_converged
      end if
      if (observer%stop_requested .and. summary%incomplete) outcome%status = status_stopped
      if (allocated(error)) then
         if (summary%n_points == 0) then
            call writer%discard()
         else
            call writer%close('failed: '//error%message, elapsed, close_error)
         end if
         return
      end if
      call writer%close(final_status(outcome%status), elapsed, error, summary%skipped, &
                        summary%sampling)
      outcome%summary = summary%lines(elapsed)
   end subroutine run_case

   !> What a result file says of a run that came to its end.
   pure function final_status(status) result(words)
      integer, intent(in) :: status
      character(13) :: words

      select case (status)
      case (status_ok)
         words = 'complete'
      case (status_stopped)
         words = 'stopped'
      case default
         words = 'not converged'
      end select
   end function final_status

   pure logical function is_wanted(flag)
      logical, intent(in), optional :: flag

      is_wanted = .true.
      if (present(flag)) is_wanted = flag
   end function is_wanted

end module fw_run
