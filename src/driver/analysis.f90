!> What every run has, whatever its analysis: a file, an observer, a summary, sinks. And what
!> analyses differ in: how they start, where their points come from, what follows the last one.
module fw_analysis
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type, status_stopped
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_restart_file, only: restart_type
   use fw_result, only: result_writer
   use fw_run_state, only: run_state
   use fw_sinks, only: sink_list
   use fw_strategy, only: kept_strategy
   use fw_summary, only: summary_type
   use fw_sweep, only: point_source
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: analysis, build_only, run_type

   !> A run at work; not to be moved once it has begun.
   type :: run_type
      class(observer_type), pointer :: observer => null()
      type(result_writer) :: writer
      type(summary_type) :: summary
      type(run_state) :: state
      !> Where points come from, and who else takes them; no source where there are none.
      class(point_source), pointer :: source => null()
      type(sink_list) :: sinks
      !> Points told so far, and to come in all (0: not known).
      integer, private :: n_told = 0, n_points = 0
      !> The run to be continued; without rows where there is none.
      type(restart_type) :: restart
      !> Of a piece of a sweep: what the one before left, and then what this one leaves.
      type(kept_strategy), pointer :: kept => null()
      !> Whether it is to say why points were not found.
      logical :: explains = .false.
      !> What is told in place of the summary.
      type(string_type), allocatable :: table(:)
   contains
      procedure :: begin_points
      procedure :: take
      procedure :: tell
      procedure :: forgive_stop
   end type run_type

   !> An analysis with points is their source, or names another one in `start`.
   type, abstract, extends(point_source) :: analysis
   contains
      procedure(start_analysis), deferred :: start
      procedure :: check => build_only
      procedure :: next => no_point
      procedure :: conclude => nothing_more
   end type analysis

   abstract interface
      !> Build what points need, up to `begin_points`.
      subroutine start_analysis(self, case, run, error)
         import :: analysis, case_type, run_type, error_type
         implicit none (type, external)
         class(analysis), intent(inout), target :: self
         type(case_type), intent(in), target :: case
         type(run_type), intent(inout), target :: run
         type(error_type), allocatable, intent(out) :: error
      end subroutine start_analysis
   end interface

contains

   !> All is built, and points are to come.
   subroutine begin_points(self, case, source, n_points)
      class(run_type), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(point_source), intent(in), target :: source
      !> 0: not known beforehand.
      integer, intent(in) :: n_points

      self%source => source
      self%n_points = n_points
      call self%observer%on_start(case%title, n_points)
   end subroutine begin_points

   !> A point goes to the file first, so that no summary counts one that was not written; the state
   !> counts it once all have it.
   subroutine take(self, point, error)
      class(run_type), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%writer%add_point(point, error)
      if (allocated(error)) return
      call self%summary%add(point)
      self%n_told = self%n_told + 1
      call self%observer%on_point(self%n_told, self%n_points, point)
      call self%sinks%take(point, error)
      if (.not. allocated(error)) call self%state%note(point)
   end subroutine take

   !> A remark that is a message as well.
   subroutine tell(self, name, text)
      class(run_type), intent(inout) :: self
      character(*), intent(in) :: name, text

      call self%observer%on_message(text)
      call self%summary%remarks%add(name, text)
   end subroutine tell

   !> A stop is an outcome, and no error: the point at work when it came is no row.
   subroutine forgive_stop(self, error)
      class(run_type), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      self%state%was_stopped = self%observer%stop_requested
      if (.not. allocated(error)) return
      if (error%status /= status_stopped) return
      deallocate (error)
      self%state%was_stopped = .true.
      self%state%is_incomplete = .true.
   end subroutine forgive_stop

   !> What would refuse the case before anything is computed.
   subroutine build_only(self, case, error)
      class(analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(balance_problem), target :: problem
      type(balance_state) :: system

      associate (unused => self)
      end associate
      call build_system(case, problem, system, error)
   end subroutine build_only

   subroutine no_point(self, case, observer, point, more, error)
      class(analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_case => case, unused_observer => observer)
      end associate
      more = .false.
   end subroutine no_point

   !> After the last point, unless an error ended the run.
   subroutine nothing_more(self, case, run, error)
      class(analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_case => case, unused_run => run)
      end associate
   end subroutine nothing_more

end module fw_analysis
