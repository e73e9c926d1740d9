!> Analyses 'frf', 'point' and 'time': the periodic response at the frequencies of a sweep, or along
!> its branch.
module fw_frequency_response
   use fw_accuracy, only: accuracy_solver
   use fw_adaptive, only: adaptive_solver
   use fw_branch, only: branch_source
   use fw_bifurcation, only: bifurcation_list
   use fw_bifurcation_group, only: bifurcation_group
   use fw_case, only: analyses, case_type
   use fw_control_branch, only: control_branch
   use fw_controlled_response, only: controlled_response
   use fw_error, only: error_type, status_stopped
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_one_level, only: one_level
   use fw_peak, only: peak_type
   use fw_peak_group, only: peak_group
   use fw_peak_cycle, only: cycle_keeper
   use fw_peak_finder, only: peak_finder
   use fw_remarks, only: is_shaken, is_undamped, remark_condensed, remark_open, remark_peaks, &
      remark_range, remark_stability
   use fw_result, only: result_writer
   use fw_point, only: point_type
   use fw_run_state, only: run_state
   use fw_sinks, only: observer_sink, sink_list, summary_sink, writer_sink
   use fw_solver_options, only: continuation_arclength
   use fw_stability_verdict, only: verdict_undecided
   use fw_strategy, only: kept_strategy, point_strategy
   use fw_summary, only: summary_type
   use fw_sweep, only: lead_places, list_source, point_source, run_sweep, sweep_places
   use fw_sweep_bifurcations, only: sweep_bifurcations
   use fw_time_response, only: time_strategy
   implicit none (type, external)
   private

   public :: run_frequency_response

contains

   !> Solve every point, in the order given; each is written as soon as it is known.
   subroutine run_frequency_response(case, observer, writer, summary, state, error, kept)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      !> Go on from what is kept, and keep what this run ends with.
      type(kept_strategy), intent(inout), target, optional :: kept
      class(point_strategy), allocatable, target :: strategy
      class(point_source), allocatable, target :: source
      type(writer_sink), target :: to_file
      type(summary_sink), target :: to_summary
      type(observer_sink), target :: to_observer
      type(peak_finder), target :: finder
      type(sweep_bifurcations), target :: changes
      type(cycle_keeper), target :: keeper
      type(sink_list) :: sinks
      logical :: in_order, is_kept

      call begin(case, strategy, error, kept)
      if (allocated(error)) return
      ! The source needs a strategy that is started: a branch shares its system.
      call new_source(case, strategy, source, to_observer%n_points)
      to_file%writer => writer
      to_summary%summary => summary
      to_observer%observer => observer
      ! The file first, so that no summary counts a point that was not written.
      call sinks%add(to_file)
      call sinks%add(to_summary)
      call sinks%add(to_observer)
      call observer%on_start(case%title, to_observer%n_points)
      ! A branch finds its peaks itself; a single frequency has none, nor has another parameter:
      ! what is looked for are resonances.
      select type (source)
      type is (list_source)
         if (size(source%place) > 1) then
            in_order = case%over%is_ordered()
            if (case%control%is_wanted()) then
               ! Its amplitude is given.
               in_order = .false.
            else if (.not. case%over%is_wanted()) then
               call finder%start(case, source%place, source, strategy, observer)
               ! It keeps the rows that a search after them may need.
               call sinks%add(finder)
               call sinks%add(keeper)
               call remark_range(case, finder%modes, summary%remarks)
               in_order = finder%in_order
            end if
            if (analyses(case%analysis)%is_sweep .and. case%sweep%stability .and. in_order) then
               call changes%start(source, strategy, observer)
               call sinks%add(changes)
            end if
         end if
      end select
      ! Points in their order; searches between them come after the last.
      call run_sweep(case, source, sinks, observer, state, error)
      ! Searches behind the rows leave other solutions.
      if (present(kept)) call source%remember(kept%memory)
      call observer%on_end()
      select type (source)
      type is (branch_source)
         if (source%branch%is_condensed) call remark_condensed(summary%remarks)
      end select
      call remark_stability(summary%verdicts(verdict_undecided), sum(summary%verdicts), &
                            summary%remarks)
      ! Rows that are still to come count with the others.
      if (.not. case%sweep%refine) call describe(case, strategy, observer, state, summary, error)
      ! A run that was stopped is not made longer by a search.
      if (.not. (allocated(error) .or. state%was_stopped)) then
         call find_peaks(case, source, finder, strategy, observer, keeper, writer, summary, error)
         if (.not. allocated(error)) call changes%search(case, error)
         if (.not. allocated(error)) call add_rows(case, finder, sinks, writer, state, error)
         call note_stop(observer, state, error)
      end if
      if (case%sweep%refine) call describe(case, strategy, observer, state, summary, error)
      if (.not. allocated(error)) call keep_bifurcations(case, source, changes, writer, summary, &
                                                         error)
      call finder%clear()
      if (.not. present(kept) .or. allocated(error)) return
      ! Of other strategies what a point needs depends on those before it.
      is_kept = .false.
      select type (strategy)
      type is (one_level)
         is_kept = allocated(kept%memory%x)
      end select
      if (is_kept) call move_alloc(strategy, kept%strategy)
   end subroutine run_frequency_response

   !> A strategy that is ready for the first point: the one kept, or one that is started.
   subroutine begin(case, strategy, error, kept)
      type(case_type), intent(in) :: case
      class(point_strategy), allocatable, target, intent(out) :: strategy
      type(error_type), allocatable, intent(out) :: error
      type(kept_strategy), intent(inout), target, optional :: kept

      if (present(kept)) then
         if (allocated(kept%strategy)) then
            call move_alloc(kept%strategy, strategy)
            select type (strategy)
            type is (one_level)
               call strategy%begin_run(case)
               call strategy%recall(kept%memory)
            end select
            return
         end if
      end if
      call new_strategy(case, strategy)
      call strategy%start(case, error)
   end subroutine begin

   subroutine describe(case, strategy, observer, state, summary, error)
      type(case_type), intent(in) :: case
      class(point_strategy), intent(inout), target :: strategy
      class(observer_type), intent(inout) :: observer
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(in) :: error
      character(:), allocatable :: message

      call strategy%describe(case, state, summary, message)
      if (len(message) > 0 .and. .not. allocated(error)) call observer%on_message(message)
   end subroutine describe

   !> Where the response turns or its stability changes goes to the result and the summary; of a
   !> run that was stopped, what was found by then.
   subroutine keep_bifurcations(case, source, changes, writer, summary, error)
      type(case_type), intent(in) :: case
      class(point_source), intent(in) :: source
      type(sweep_bifurcations), intent(in) :: changes
      type(result_writer), intent(inout) :: writer
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(out) :: error

      select type (source)
      type is (branch_source)
         call keep(source%branch%bifurcations, source%branch%n_solved, source%branch%iterations)
      type is (control_branch)
         call keep(source%folds, 0, 0)
      class default
         call keep(changes%found, changes%n_solved, changes%iterations)
      end select

   contains

      !> The one list or the other, with the work that it took.
      subroutine keep(list, n_solved, iterations)
         type(bifurcation_list), intent(in) :: list
         integer, intent(in) :: n_solved, iterations
         type(bifurcation_group) :: group

         call summary%describe_bifurcations(list, n_solved, iterations)
         group%list = list
         group%n_harmonics = case%harmonics%n_harmonics
         group%omega = frequency_of(case)
         call writer%add(group, error)
      end subroutine keep

   end subroutine keep_bifurcations

   !> Points of the search become rows, in the order of the sweep, where the case wants it.
   subroutine add_rows(case, finder, sinks, writer, state, error)
      type(case_type), intent(in) :: case
      type(peak_finder), intent(in) :: finder
      type(sink_list), intent(inout) :: sinks
      type(result_writer), intent(inout) :: writer
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      do k = 1, finder%added%n
         call sinks%take(finder%added%item(k)%point, error)
         if (allocated(error)) return
         call state%note(finder%added%item(k)%point)
      end do
      ! Rows were written as they were found: at the end, whatever their frequency.
      if (finder%added%n > 0) call writer%sort_points(case%sweep%end < case%sweep%start, error)
   end subroutine add_rows

   !> A stop while peaks were looked for: the rows are whole, and the peaks are left out.
   subroutine note_stop(observer, state, error)
      class(observer_type), intent(inout) :: observer
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(inout) :: error

      if (.not. allocated(error)) return
      if (error%status /= status_stopped) return
      deallocate (error)
      state%was_stopped = .true.
      state%is_incomplete = .true.
      call observer%on_message('stopped while peaks between the points were looked for: they '// &
                               'are left out')
   end subroutine note_stop

   !> The maxima between the rows go to the result and the summary.
   subroutine find_peaks(case, source, finder, strategy, observer, keeper, writer, summary, error)
      type(case_type), intent(in) :: case
      class(point_source), intent(inout) :: source
      type(peak_finder), intent(inout) :: finder
      class(point_strategy), intent(inout), target :: strategy
      class(observer_type), intent(inout), target :: observer
      type(cycle_keeper), intent(inout) :: keeper
      type(result_writer), intent(inout) :: writer
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(out) :: error
      type(peak_type), allocatable :: peaks(:)
      type(peak_group) :: group
      type(point_type) :: highest
      real(wp) :: open(2)
      integer :: n_open

      if (case%over%is_wanted() .or. case%control%is_wanted()) return
      select type (source)
      type is (branch_source)
         call source%branch%peaks%list(source%branch%first_row, peaks)
         call source%branch%at_highest(case, highest, error)
         if (.not. allocated(error)) call keeper%take(highest, error)
         if (allocated(error)) return
         call summary%describe_peaks(peaks, source%branch%peaks%n_solved, &
                                     source%branch%peaks%iterations)
      class default
         call finder%search(case, error)
         if (allocated(error)) return
         call finder%peaks(peaks)
         call keeper%solve_at_peak(case, finder, strategy, observer, peaks, error)
         if (allocated(error)) return
         call summary%describe_peaks(peaks, finder%n_solved, finder%iterations)
         call finder%find_open(open, n_open)
         call remark_open(open, n_open, summary%remarks)
      end select
      call remark_peaks(peaks, case%model%observe_name, is_undamped(case), summary%remarks)
      call move_alloc(peaks, group%peaks)
      group%n_harmonics = case%harmonics%n_harmonics
      group%omega = keeper%omega
      if (allocated(keeper%cycle)) group%cycle = keeper%cycle
      call writer%add(group, error)
   end subroutine find_peaks

   !> The one frequency of a sweep over another parameter [rad/s]; 0 where there is none.
   pure real(wp) function frequency_of(case) result(omega)
      type(case_type), intent(in) :: case

      omega = 0.0_wp
      if (case%over%is_wanted()) omega = case%sweep%start
   end function frequency_of

   !> How the case wants its points solved.
   subroutine new_strategy(case, strategy)
      type(case_type), intent(in) :: case
      class(point_strategy), allocatable, intent(out) :: strategy

      if (analyses(case%analysis)%is_integrated) then
         allocate (time_strategy :: strategy)
      else if (case%control%is_wanted()) then
         allocate (controlled_response :: strategy)
      else if (case%harmonics%adaptive) then
         allocate (adaptive_solver :: strategy)
      else if (case%harmonics%accuracy > 0.0_wp) then
         allocate (accuracy_solver :: strategy)
      else
         allocate (one_level :: strategy)
      end if
   end subroutine new_strategy

   !> Which points those are.
   subroutine new_source(case, strategy, source, n_points)
      type(case_type), intent(in) :: case
      class(point_strategy), intent(inout), target :: strategy
      class(point_source), allocatable, intent(out) :: source
      !> How many (0: not known beforehand).
      integer, intent(out) :: n_points
      type(branch_source), allocatable :: branch
      type(list_source) :: list
      type(control_branch) :: controlled
      logical :: along_branch

      along_branch = .false.
      n_points = 0
      select type (strategy)
      type is (controlled_response)
         if (case%sweep%continuation == continuation_arclength) then
            call controlled%begin(case, strategy)
            source = controlled
            return
         end if
      type is (one_level)
         ! A linear structure leaves no unknowns, and no branch that could turn back; nor does a
         ! structure at rest.
         along_branch = analyses(case%analysis)%is_sweep .and. strategy%level%system%n > 0 .and. &
                        case%sweep%continuation == continuation_arclength
         if (along_branch) along_branch = is_shaken(case)
         if (along_branch) then
            allocate (branch)
            branch%level => strategy%level
         end if
      end select
      if (along_branch) then
         call move_alloc(branch, source)
      else
         list%place = sweep_places(case)
         if (case%sweep%lead_points > 0) list%lead = lead_places(case)
         if (case%control%is_wanted()) call repeat_places(case%control%amplitude, list)
         list%strategy => strategy
         n_points = size(list%place)
         source = list
      end if
   end subroutine new_source

   !> All frequencies for each amplitude.
   pure subroutine repeat_places(amplitude, list)
      real(wp), intent(in) :: amplitude(:)
      type(list_source), intent(inout) :: list
      integer :: k, n

      n = size(list%place)
      list%amplitude = [(spread(amplitude(k), 1, n), k=1, size(amplitude))]
      list%place = [(list%place, k=1, size(amplitude))]
   end subroutine repeat_places

end module fw_frequency_response
