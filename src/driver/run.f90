!> Run a case: the one entry for the command line, C and Python.
module fw_run
   use, intrinsic :: iso_c_binding, only: c_int8_t
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_combinations, only: check_combinations
   use fw_case, only: analysis_mode, analysis_modes, analysis_resonance, analysis_wear, case_type
   use fw_error, only: error_type
   use fw_frequency_response, only: run_frequency_response
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_observer, only: observer_type
   use fw_run_state, only: outcome_type, run_state
   use fw_problem, only: build_system, threads_for
   use fw_remarks, only: remark_input, remark_unused
   use fw_restart_file, only: read_restart, restart_type
   use fw_result, only: result_writer
   use fw_run_mode, only: check_mode_case, run_mode
   use fw_run_modes, only: run_modes
   use fw_run_resonance, only: run_resonance
   use fw_strategy, only: kept_strategy
   use fw_summary, only: summary_type, new_summary
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   use fw_threads, only: thread_scope
   use fw_wear_response, only: run_wear
   implicit none (type, external)
   private

   public :: run_case, check_case

contains

   !> Everything that would refuse a case before it is computed; nothing is written.
   subroutine check_case(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(balance_problem), target :: problem
      type(balance_state) :: system
      type(thread_scope) :: threads
      type(restart_type) :: restart

      call check_combinations(case, error)
      if (allocated(error)) return
      if (allocated(case%restart)) call read_restart(case%restart, case, restart, error)
      if (allocated(error)) return
      call threads%enter(threads_for(case))
      if (case%analysis == analysis_mode) then
         call check_mode_case(case, error)
      else if (case%analysis /= analysis_modes) then
         call build_system(case, problem, system, error)
      end if
      call threads%leave()
   end subroutine check_case

   !> Run a case and write its result file. Points that did not converge make the outcome
   !> status_not_converged, an observer that asks for it status_stopped; `error` is for what ends
   !> the run.
   subroutine run_case(case, observer, outcome, error, write_file, image, kept)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(outcome_type), intent(out) :: outcome
      type(error_type), allocatable, intent(out) :: error
      !> False: results leave through the observer only (default: true).
      logical, intent(in), optional :: write_file
      !> The bytes of the result file, which is not written then; not allocated where the run has
      !> not come to a point.
      integer(c_int8_t), allocatable, intent(out), optional :: image(:)
      !> Of a piece of a sweep: what the one before left, and then what this one leaves.
      type(kept_strategy), intent(inout), target, optional :: kept
      type(result_writer), target :: writer
      type(summary_type), target :: summary
      type(run_state) :: state
      type(thread_scope) :: threads
      type(error_type), allocatable :: close_error
      type(restart_type) :: restart
      type(string_type), allocatable :: table(:)
      integer(int64) :: clock, clock_end, rate
      real(wp) :: elapsed
      integer :: i

      call system_clock(clock, rate)
      call check_combinations(case, error)
      if (allocated(error)) return
      if (allocated(case%restart)) call read_restart(case%restart, case, restart, error)
      if (allocated(error)) return
      ! Observers may be used again.
      observer%stop_requested = .false.
      observer%n_wanted = huge(1)
      call observer%limit_run(case%max_seconds)
      if (present(image)) then
         call writer%open(case, error, in_memory=.true.)
      else if (is_wanted(write_file)) then
         call writer%open(case, error)
      end if
      if (allocated(error)) return
      ! Behind the file, before the first product: results must not depend on the threads of the
      ! host.
      call threads%enter(threads_for(case))
      summary = new_summary(case)
      if (case%analysis /= analysis_modes) call remark_input(case, summary%remarks)
      if (case%analysis == analysis_modes) then
         call remark_unused(case, summary%remarks)
         call run_modes(case, writer, table, error)
      else if (case%analysis == analysis_mode) then
         call run_mode(case, observer, writer, summary, state, error)
      else if (case%analysis == analysis_resonance) then
         call run_resonance(case, observer, writer, summary, state, error)
      else if (case%analysis == analysis_wear) then
         call run_wear(case, restart, observer, writer, summary, state, error)
      else
         call run_frequency_response(case, observer, writer, summary, state, error, kept)
      end if
      call threads%leave()
      call system_clock(clock_end)
      elapsed = real(clock_end - clock, wp)/real(rate, wp)
      outcome%status = state%status()
      outcome%out_of_time = observer%run_out
      call summary%remark_instants()
      if (.not. allocated(error)) call writer%add(summary%remarks, error)
      if (allocated(error)) then
         if (state%n_points == 0) then
            ! A result without points is none.
            call writer%discard()
         else
            ! What was computed until then stays readable, and says that it is not all.
            call writer%close('failed: '//error%message, elapsed, close_error)
            if (present(image)) call move_alloc(writer%image, image)
         end if
         return
      end if
      if (observer%run_out) call observer%on_message('time limit: the run ended after case'// &
         '%max_seconds = '//to_text(case%max_seconds)//' s')
      call writer%close(trim(state%words()), elapsed, error, summary%skipped, summary%sampling)
      if (present(image)) call move_alloc(writer%image, image)
      if (allocated(table)) then
         do i = 1, summary%remarks%count()
            call append(table, 'remark            '//summary%remarks%text(i)%text)
         end do
         call move_alloc(table, outcome%summary)
      else
         outcome%summary = summary%lines(state, elapsed)
      end if
   end subroutine run_case

   !> A flag that may be absent: then it is true.
   pure logical function is_wanted(flag)
      logical, intent(in), optional :: flag

      is_wanted = .true.
      if (present(flag)) is_wanted = flag
   end function is_wanted

end module fw_run
