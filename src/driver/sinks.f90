!> Where points go: the result file, the summary, whoever watches, a list in memory. Each takes
!> every point as soon as it is known.
module fw_sinks
   use fw_error, only: error_type
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_result, only: result_writer
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: point_sink, sink_list, writer_sink, summary_sink, observer_sink

   !> Takes points one by one; an error ends the run.
   type, abstract :: point_sink
   contains
      procedure(take_point), deferred :: take
   end type point_sink

   abstract interface
      subroutine take_point(self, point, error)
         import :: point_sink, point_type, error_type
         implicit none (type, external)
         class(point_sink), intent(inout) :: self
         type(point_type), intent(in) :: point
         type(error_type), allocatable, intent(out) :: error
      end subroutine take_point
   end interface

   !> The result file, which holds a point when `take` returns.
   type, extends(point_sink) :: writer_sink
      type(result_writer), pointer :: writer => null()
   contains
      procedure :: take => write_point
   end type writer_sink

   !> Counts and extremes for the summary.
   type, extends(point_sink) :: summary_sink
      type(summary_type), pointer :: summary => null()
   contains
      procedure :: take => add_point
   end type summary_sink

   !> Whoever watches, or asks for the end.
   type, extends(point_sink) :: observer_sink
      class(observer_type), pointer :: observer => null()
      !> Points told so far, and to come in all (0: not known).
      integer :: n_told = 0, n_points = 0
   contains
      procedure :: take => tell_point
   end type observer_sink

   type :: sink_pointer
      class(point_sink), pointer :: sink => null()
   end type sink_pointer

   !> Sinks in the order in which they take a point. They have to outlive the list.
   type :: sink_list
      type(sink_pointer), allocatable, private :: items(:)
   contains
      procedure :: add
      procedure :: take
   end type sink_list

contains

   !> Sinks are few: the list grows by one.
   subroutine add(self, sink)
      class(sink_list), intent(inout) :: self
      class(point_sink), intent(in), target :: sink
      type(sink_pointer), allocatable :: longer(:)
      integer :: n

      n = 0
      if (allocated(self%items)) n = size(self%items)
      allocate (longer(n + 1))
      if (n > 0) longer(:n) = self%items
      longer(n + 1)%sink => sink
      call move_alloc(longer, self%items)
   end subroutine add

   !> Give a point to all.
   subroutine take(self, point, error)
      class(sink_list), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (.not. allocated(self%items)) return
      do i = 1, size(self%items)
         ! A sink that fails keeps the point from those behind it: the file comes first.
         call self%items(i)%sink%take(point, error)
         if (allocated(error)) return
      end do
   end subroutine take

   subroutine write_point(self, point, error)
      class(writer_sink), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%writer%add_point(point, error)
   end subroutine write_point

   subroutine add_point(self, point, error)
      class(summary_sink), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%summary%add(point)
   end subroutine add_point

   subroutine tell_point(self, point, error)
      class(observer_sink), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      self%n_told = self%n_told + 1
      call self%observer%on_point(self%n_told, self%n_points, point)
   end subroutine tell_point

end module fw_sinks
