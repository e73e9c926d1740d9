!> Run a case: the one entry for the command line, C and Python.
module fw_run
   use, intrinsic :: iso_c_binding, only: c_int8_t
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_analysis, only: analysis, run_type
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: analyses, analysis_bounds, analysis_campbell, analysis_mode, analysis_modes, &
      analysis_population, analysis_resonance, analysis_ringdown, analysis_wear, case_type
   use fw_combinations, only: check_combinations
   use fw_error, only: error_type, fatal_error
   use fw_frequency_response, only: response_analysis
   use fw_law_check, only: check_group
   use fw_kinds, only: wp
   use fw_mission_response, only: mission_analysis
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_problem, only: build_system, threads_for
   use fw_remarks, only: remark_input
   use fw_restart_file, only: read_restart, restart_type
   use fw_run_bounds, only: bounds_analysis
   use fw_run_campbell, only: campbell_analysis
   use fw_run_mode, only: mode_analysis
   use fw_run_modes, only: modes_analysis
   use fw_run_population, only: population_analysis
   use fw_run_resonance, only: resonance_analysis
   use fw_run_ringdown, only: ringdown_analysis
   use fw_run_state, only: outcome_type
   use fw_strategy, only: kept_strategy
   use fw_summary, only: new_summary
   use fw_text, only: to_text
   use fw_text_list, only: append
   use fw_threads, only: thread_scope
   use fw_wear_response, only: wear_analysis
   implicit none (type, external)
   private

   public :: check_case, check_user_laws, run_case

contains

   !> How a case is computed.
   subroutine new_analysis(case, work)
      type(case_type), intent(in) :: case
      class(analysis), allocatable, intent(out) :: work

      select case (case%analysis)
      case (analysis_modes); allocate (modes_analysis :: work)
      case (analysis_campbell); allocate (campbell_analysis :: work)
      case (analysis_population); allocate (population_analysis :: work)
      case (analysis_bounds); allocate (bounds_analysis :: work)
      case (analysis_ringdown); allocate (ringdown_analysis :: work)
      case (analysis_mode); allocate (mode_analysis :: work)
      case (analysis_resonance); allocate (resonance_analysis :: work)
      case (analysis_wear)
         if (case%mission%is_wanted()) allocate (mission_analysis :: work)
         if (.not. allocated(work)) allocate (wear_analysis :: work)
      case default; allocate (response_analysis :: work)
      end select
   end subroutine new_analysis

   !> Everything that would refuse a case before it is computed; nothing is written.
   subroutine check_case(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      class(analysis), allocatable, target :: work
      type(thread_scope) :: threads
      type(restart_type) :: restart

      call check_input(case, restart, error)
      if (allocated(error)) return
      call threads%enter(threads_for(case))
      call new_analysis(case, work)
      call work%check(case, error)
      call threads%leave()
   end subroutine check_case

   !> What goes together, and the run to be continued.
   subroutine check_input(case, restart, error)
      type(case_type), intent(in) :: case
      type(restart_type), intent(inout) :: restart
      type(error_type), allocatable, intent(out) :: error

      call check_combinations(case, error)
      if (allocated(error)) return
      if (allocated(case%restart)) call read_restart(case%restart, case, restart, error)
   end subroutine check_input

   !> Run a case and write its result file. Points that did not converge make the outcome
   !> status_not_converged, an observer that asks for it status_stopped; `error` is for what ends
   !> the run.
   subroutine run_case(case, observer, outcome, error, write_file, image, kept, explains)
      type(case_type), intent(in), target :: case
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
      !> Say why points were not found (default: no).
      logical, intent(in), optional :: explains
      type(run_type), target :: run
      class(analysis), allocatable, target :: work
      type(thread_scope) :: threads
      type(point_type) :: point
      integer(int64) :: clock
      logical :: more

      call system_clock(clock)
      call check_input(case, run%restart, error)
      if (.not. allocated(error)) call open_run(case, observer, run, error, write_file, &
                                                in_memory=present(image))
      if (allocated(error)) return
      if (present(kept)) run%kept => kept
      if (present(explains)) run%explains = explains
      ! Behind the file, before the first product: results must not depend on the threads of the
      ! host.
      call threads%enter(threads_for(case))
      if (analyses(case%analysis)%has_points) call remark_input(case, run%summary%remarks)
      call new_analysis(case, work)
      call check_user_laws(case, error)
      if (.not. allocated(error)) call work%start(case, run, error)
      more = associated(run%source) .and. .not. allocated(error)
      do while (more)
         call run%source%next(case, observer, point, more, error)
         if (allocated(error) .or. .not. more) exit
         call run%take(point, error)
         if (allocated(error)) exit
      end do
      if (associated(run%source)) call end_points(case, run, error)
      if (.not. allocated(error)) call work%conclude(case, run, error)
      call threads%leave()
      call close_run(case, run, clock, outcome, error, image)
   end subroutine run_case

   !> Laws of the user are looked at before anything is solved (fw_law_check).
   subroutine check_user_laws(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(balance_problem), target :: problem
      type(balance_state) :: system
      integer :: k

      if (.not. allocated(case%elements%slot)) return
      do k = 1, size(case%elements%slot)
         associate (group => case%elements%slot(k)%group)
            if (.not. group%check .or. .not. allocated(group%function)) cycle
            if (size(group%function) == 0) cycle
            call build_system(case, problem, system, error)
            if (allocated(error)) return
            ! Natural frequencies are asked for without one.
            call system%set_frequency(merge(case%sweep%start, 1.0_wp, case%sweep%start > 0.0_wp), &
                                      error)
            if (.not. allocated(error)) call check_group(problem, system, &
                                                         problem%forces%elements(k), group, error)
            if (allocated(error)) return
         end associate
      end do
   end subroutine check_user_laws

   !> The result file, an observer that may have been used before, and a summary that knows nothing.
   subroutine open_run(case, observer, run, error, write_file, in_memory)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: write_file
      logical, intent(in) :: in_memory

      observer%stop_requested = .false.
      observer%demand = ''
      observer%n_wanted = huge(1)
      call observer%limit_run(case%max_seconds)
      run%observer => observer
      run%summary = new_summary(case)
      if (in_memory) then
         call run%writer%open(case, error, in_memory=.true.)
      else if (is_wanted(write_file)) then
         call run%writer%open(case, error)
      end if
   end subroutine open_run

   !> After the last point, whatever ended them.
   subroutine end_points(case, run, error)
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(inout) :: error

      call run%forgive_stop(error)
      if (.not. allocated(error)) call run%source%finish(case, run%observer)
      run%state%is_incomplete = run%state%is_incomplete .or. .not. run%source%is_covered()
      call run%observer%on_end()
   end subroutine end_points

   !> The end of the file, and what is told.
   subroutine close_run(case, run, start, outcome, error, image)
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      !> The clock when the run began.
      integer(int64), intent(in) :: start
      type(outcome_type), intent(inout) :: outcome
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int8_t), allocatable, intent(inout), optional :: image(:)
      type(error_type), allocatable :: close_error
      integer(int64) :: clock, rate
      real(wp) :: elapsed
      integer :: i

      call system_clock(clock, rate)
      elapsed = real(clock - start, wp)/real(rate, wp)
      outcome%status = run%state%status()
      outcome%out_of_time = run%observer%run_out
      call raise_demand(run%observer, error)
      call run%summary%remark_instants()
      call run%summary%remark_sliding()
      if (.not. allocated(error)) call run%writer%add(run%summary%remarks, error)
      if (allocated(error) .and. run%state%n_points == 0) then
         ! A result without points is none.
         call run%writer%discard()
         return
      else if (allocated(error)) then
         ! What was computed until then stays readable, and says that it is not all.
         call run%writer%close('failed: '//error%message, elapsed, close_error)
         if (present(image)) call move_alloc(run%writer%image, image)
         return
      end if
      if (run%observer%run_out) call run%observer%on_message('time limit: the run ended after '// &
         'case%max_seconds = '//to_text(case%max_seconds)//' s')
      call run%writer%close(trim(run%state%words()), elapsed, error, run%summary%skipped, &
                            run%summary%sampling)
      if (present(image)) call move_alloc(run%writer%image, image)
      if (.not. allocated(run%table)) then
         outcome%summary = run%summary%lines(run%state, elapsed)
         return
      end if
      do i = 1, run%summary%remarks%count()
         call append(run%table, 'remark            '//run%summary%remarks%text(i)%text)
      end do
      call move_alloc(run%table, outcome%summary)
   end subroutine close_run

   !> The end that a law of the user has asked for is an error, whatever else came of it.
   subroutine raise_demand(observer, error)
      class(observer_type), intent(in) :: observer
      type(error_type), allocatable, intent(inout) :: error

      if (observer%demand == '') return
      if (allocated(error)) deallocate (error)
      call fatal_error(error, trim(observer%demand))
   end subroutine raise_demand

   !> A flag that may be absent: then it is true.
   pure logical function is_wanted(flag)
      logical, intent(in), optional :: flag

      is_wanted = .true.
      if (present(flag)) is_wanted = flag
   end function is_wanted

end module fw_run
