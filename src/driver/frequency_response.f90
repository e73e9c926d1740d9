!> Analyses 'frf', 'point' and 'time': the periodic response at the frequencies of a sweep, or along
!> its branch.
module fw_frequency_response
   use fw_accuracy, only: accuracy_solver
   use fw_analysis, only: analysis, run_type
   use fw_branch, only: branch_source
   use fw_bifurcation, only: bifurcation_list
   use fw_bifurcation_group, only: bifurcation_group
   use fw_case, only: analyses, case_type
   use fw_curve_source, only: curve_source
   use fw_error, only: error_type
   use fw_explanation, only: failure_list
   use fw_given_amplitude, only: given_amplitude
   use fw_held_bodies, only: are_of_bodies
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_motion, only: motion_type
   use fw_one_level, only: one_level
   use fw_pair_cycle, only: pair_cycle
   use fw_peak, only: found_unresolved, peak_type
   use fw_peak_group, only: peak_group
   use fw_peak_finder, only: peak_finder
   use fw_remarks, only: is_shaken, is_undamped, remark_condensed, remark_open, remark_peaks, &
      remark_range, remark_stability
   use fw_point, only: point_type
   use fw_several_solutions, only: several_source
   use fw_sinks, only: point_sink
   use fw_solver_options, only: continuation_arclength
   use fw_stability_verdict, only: verdict_undecided
   use fw_strategy, only: keeps_cycles, kept_strategy, point_request, point_strategy
   use fw_sweep, only: lead_places, list_source, point_source, sweep_places
   use fw_sweep_bifurcations, only: sweep_bifurcations
   use fw_time_response, only: look_by_integration, time_strategy
   use fw_vibration_branch, only: vibration_branch
   use fw_walked_points, only: walked_points
   implicit none (type, external)
   private

   public :: new_strategy, response_analysis

   !> Takes the rows that have one period of the pairs that dissipate most, and keeps that of the
   !> highest.
   type, extends(point_sink) :: cycle_keeper
      real(wp) :: omega = 0.0_wp, amplitude = -1.0_wp
      !> Not allocated where there is none.
      type(pair_cycle), allocatable :: cycle
   contains
      procedure :: take
      procedure :: solve_at_peak
   end type cycle_keeper

   type, extends(analysis) :: response_analysis
      !> Where points come from, and how each is solved.
      class(point_source), allocatable, private :: source
      class(point_strategy), allocatable, private :: strategy
      !> What watches the rows, and looks between them behind the last.
      type(peak_finder), private :: finder
      type(sweep_bifurcations), private :: changes
      type(cycle_keeper), private :: keeper
      !> Points that were not found, where a run is to say why.
      type(failure_list), private :: failures
   contains
      procedure :: start
      procedure :: conclude
   end type response_analysis

contains

   !> Every point in the order given; each is written as soon as it is known.
   subroutine start(self, case, run, error)
      class(response_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      integer :: n_points

      call begin(case, self%strategy, error, run%kept)
      if (allocated(error)) return
      ! The source needs a strategy that is started: a branch shares its system.
      call new_source(case, self%strategy, self%source, n_points)
      call run%begin_points(case, self%source, n_points)
      ! A branch finds its peaks itself; a single frequency has none, nor has another parameter:
      ! what is looked for are resonances.
      select type (source => self%source)
      type is (list_source)
         if (size(source%place) > 1) call watch(self, case, source, run)
      end select
      if (.not. run%explains) return
      self%failures%strategy => self%strategy
      call run%sinks%add(self%failures)
   end subroutine start

   !> Searches between the points come after the last: what they need of the rows is kept.
   subroutine watch(self, case, source, run)
      class(response_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(list_source), intent(in), target :: source
      type(run_type), intent(inout), target :: run
      logical :: in_order

      in_order = case%over%is_ordered()
      if (case%control%is_wanted()) then
         ! Its amplitude is given.
         in_order = .false.
      else if (.not. case%over%is_wanted()) then
         call self%finder%start(case, source%place, source, self%strategy, run%observer)
         call run%sinks%add(self%finder)
         call run%sinks%add(self%keeper)
         call remark_range(case, self%finder%modes, run%summary%remarks)
         in_order = self%finder%in_order
      end if
      if (analyses(case%analysis)%is_sweep .and. case%sweep%stability .and. in_order) then
         call self%changes%start(source, self%strategy, run%observer)
         call run%sinks%add(self%changes)
      end if
   end subroutine watch

   subroutine conclude(self, case, run, error)
      class(response_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      ! Searches behind the rows leave other solutions.
      if (associated(run%kept)) call self%source%remember(run%kept%memory)
      select type (source => self%source)
      type is (branch_source)
         if (source%is_condensed) call remark_condensed(run%summary%remarks)
      end select
      associate (verdicts => run%summary%verdicts)
         call remark_stability(verdicts(verdict_undecided), sum(verdicts), run%summary%remarks)
      end associate
      ! Rows that are still to come count with the others.
      if (.not. case%sweep%refine) call describe(case, self%strategy, run)
      select type (source => self%source)
      type is (several_source)
         call source%summarize(case, run%summary)
      end select
      if (run%explains .and. .not. run%state%was_stopped) then
         call explain(self%failures, case, run, error)
         if (allocated(error)) return
      end if
      ! A run that was stopped is not made longer by a search.
      if (.not. run%state%was_stopped) call search(self, case, run, error)
      if (case%sweep%refine .and. .not. allocated(error)) call describe(case, self%strategy, run)
      if (.not. allocated(error)) call keep_bifurcations(self, case, run, error)
      call self%finder%clear()
      if (.not. associated(run%kept) .or. allocated(error)) return
      ! Of other strategies what a point needs depends on those before it.
      select type (strategy => self%strategy)
      type is (one_level)
         if (.not. allocated(run%kept%memory%x)) return
      class default
         return
      end select
      call move_alloc(self%strategy, run%kept%strategy)
   end subroutine conclude

   !> Say why points were not found.
   subroutine explain(failures, case, run, error)
      type(failure_list), intent(in) :: failures
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      type(motion_type) :: motion
      character(480) :: refusal
      character(:), allocatable :: text
      integer :: k

      do k = 1, failures%n_places()
         call look_by_integration(case, failures%omega(k), run%observer, point, motion, refusal, &
                                  error)
         ! A stop leaves the rest unsaid, and the rows are whole.
         if (allocated(error)) call run%forgive_stop(error)
         if (allocated(error) .or. run%state%was_stopped) return
         call failures%tell(k, case%harmonics%n_harmonics, point, motion, refusal, text)
         call run%tell('explained', text)
      end do
   end subroutine explain

   !> What lies between the rows; a stop leaves it out, and the rows are whole.
   subroutine search(self, case, run, error)
      class(response_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      call find_peaks(self, case, run, error)
      if (.not. allocated(error)) call self%changes%search(case, error)
      if (.not. allocated(error)) call add_rows(case, self%finder, run, error)
      if (.not. allocated(error)) return
      call run%forgive_stop(error)
      if (.not. allocated(error)) call run%observer%on_message( &
         'stopped while peaks between the points were looked for: they are left out')
   end subroutine search

   !> A strategy that is ready for the first point: the one kept, or one that is started.
   subroutine begin(case, strategy, error, kept)
      type(case_type), intent(in) :: case
      class(point_strategy), allocatable, target, intent(out) :: strategy
      type(error_type), allocatable, intent(out) :: error
      type(kept_strategy), pointer, intent(in) :: kept

      if (associated(kept)) then
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

   subroutine describe(case, strategy, run)
      type(case_type), intent(in) :: case
      class(point_strategy), intent(inout), target :: strategy
      type(run_type), intent(inout) :: run
      character(:), allocatable :: message

      call strategy%describe(case, run%state, run%summary, message)
      if (len(message) > 0) call run%observer%on_message(message)
   end subroutine describe

   !> Where the response turns or its stability changes goes to the result and the summary; of a
   !> run that was stopped, what was found by then.
   subroutine keep_bifurcations(self, case, run, error)
      class(response_analysis), intent(in) :: self
      type(case_type), intent(in) :: case
      type(run_type), intent(inout) :: run
      type(error_type), allocatable, intent(out) :: error

      select type (source => self%source)
      type is (branch_source)
         call keep(source%bifurcations, source%n_solved, source%iterations)
      class is (curve_source)
         call keep(source%bifurcations, 0, 0)
      class default
         call keep(self%changes%found, self%changes%n_solved, self%changes%iterations)
      end select

   contains

      !> The one list or the other, with the work that it took.
      subroutine keep(list, n_solved, iterations)
         type(bifurcation_list), intent(in) :: list
         integer, intent(in) :: n_solved, iterations
         type(bifurcation_group) :: group

         call run%summary%describe_bifurcations(list, n_solved, iterations)
         group%list = list
         group%n_harmonics = case%harmonics%n_harmonics
         ! Of a sweep over another parameter the one frequency [rad/s]; else 0.
         if (case%over%is_wanted()) group%omega = case%sweep%start
         call run%writer%add(group, error)
      end subroutine keep

   end subroutine keep_bifurcations

   !> Points of the search become rows, in the order of the sweep, where the case wants it.
   subroutine add_rows(case, finder, run, error)
      type(case_type), intent(in) :: case
      type(peak_finder), intent(in) :: finder
      type(run_type), intent(inout) :: run
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      do k = 1, finder%added%n
         call run%take(finder%added%item(k)%point, error)
         if (allocated(error)) return
      end do
      ! Rows were written as they were found: at the end, whatever their frequency.
      if (finder%added%n > 0) call run%writer%sort_points(case%sweep%end < case%sweep%start, error)
   end subroutine add_rows

   !> The maxima between the rows go to the result and the summary.
   subroutine find_peaks(self, case, run, error)
      class(response_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(peak_type), allocatable :: peaks(:)
      type(peak_group) :: group
      type(point_type) :: highest
      real(wp) :: open(2)
      integer :: n_open

      if (case%over%is_wanted() .or. case%control%is_wanted()) return
      associate (finder => self%finder, keeper => self%keeper, summary => run%summary)
         select type (source => self%source)
         type is (branch_source)
            call source%peaks%list(source%first_row, peaks)
            call drop_ripples(case, peaks)
            call source%at_highest(case, highest, error)
            if (.not. allocated(error)) call keeper%take(highest, error)
            if (allocated(error)) return
            call summary%describe_peaks(peaks, source%peaks%n_solved, &
                                        source%peaks%iterations)
         class default
            call finder%search(case, error)
            if (allocated(error)) return
            call finder%peaks(peaks)
            call drop_ripples(case, peaks)
            call keeper%solve_at_peak(case, finder, self%strategy, run%observer, peaks, error)
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
      end associate
      call run%writer%add(group, error)
   end subroutine find_peaks

   !> Ripples of what bodies do that no spring holds, without damping, are no maxima to look for.
   subroutine drop_ripples(case, peaks)
      type(case_type), intent(in) :: case
      type(peak_type), allocatable, intent(inout) :: peaks(:)
      logical, allocatable :: are(:)
      integer :: i

      if (.not. allocated(case%bodies)) return
      are = are_of_bodies(case)
      peaks = peaks(pack([(i, i=1, size(peaks))], &
                         .not. (are(peaks%observed) .and. peaks%found_by == found_unresolved)))
   end subroutine drop_ripples

   !> How the case wants its points solved.
   subroutine new_strategy(case, strategy)
      type(case_type), intent(in) :: case
      class(point_strategy), allocatable, intent(out) :: strategy
      type(walked_points), allocatable :: walked

      if (analyses(case%analysis)%is_integrated) then
         allocate (time_strategy :: strategy)
      else if (case%control%is_wanted()) then
         allocate (walked)
         allocate (given_amplitude :: walked%v)
         call move_alloc(walked, strategy)
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
      type(several_source), allocatable :: several
      type(vibration_branch), allocatable :: curve
      logical :: along_branch

      along_branch = .false.
      n_points = 0
      select type (strategy)
      type is (walked_points)
         if (case%sweep%continuation == continuation_arclength) then
            allocate (curve)
            call curve%build(case, strategy)
            call move_alloc(curve, source)
            return
         end if
      type is (one_level)
         if (case%solver%n_solutions > 1) then
            allocate (several)
            several%strategy => strategy
            call move_alloc(several, source)
            return
         end if
         ! A linear structure leaves no unknowns, and no branch that could turn back; nor does a
         ! structure at rest.
         along_branch = analyses(case%analysis)%is_sweep .and. strategy%level%system%n > 0 .and. &
                        case%sweep%continuation == continuation_arclength
         if (along_branch) along_branch = is_shaken(case)
         if (along_branch) then
            allocate (branch)
            call branch%build(strategy%level)
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

   subroutine take(self, point, error)
      class(cycle_keeper), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      if (.not. (point%converged .and. allocated(point%cycle))) return
      if (size(point%amplitude) == 0) return
      if (point%amplitude(1) <= self%amplitude) return
      self%omega = point%omega
      self%amplitude = point%amplitude(1)
      self%cycle = point%cycle
   end subroutine take

   !> Solve once more at the highest maximum, from the solution that is known there.
   subroutine solve_at_peak(self, case, finder, strategy, interrupt, peaks, error)
      class(cycle_keeper), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(peak_finder), intent(inout) :: finder
      class(point_strategy), intent(inout), target :: strategy
      class(interrupt_type), intent(in), target :: interrupt
      type(peak_type), intent(in) :: peaks(:)
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(point_type) :: point
      real(wp) :: highest
      integer :: k
      logical :: found

      ! Rows have theirs already where points cannot be had again.
      if (keeps_cycles(case) .or. .not. case%output%contact) return
      if (case%contact%n_pairs == 0) return
      highest = 0.0_wp
      do k = 1, size(peaks)
         if (peaks(k)%observed /= 1 .or. peaks(k)%amplitude <= highest) cycle
         highest = peaks(k)%amplitude
         request%omega = peaks(k)%omega
      end do
      if (.not. highest > 0.0_wp) return
      call finder%go_to(request%omega, found)
      if (.not. found) return
      request%fallback = .false.
      request%contact = .true.
      request%cycle = .true.
      request%interrupt => interrupt
      call strategy%solve_in_time(case, request, point, error)
      if (.not. allocated(error)) call self%take(point, error)
   end subroutine solve_at_peak

end module fw_frequency_response
