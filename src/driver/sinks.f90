!> Who watches the points of a run beside its file, its summary and its observer: searches for peaks
!> and bifurcations. Each takes every point as soon as it is known.
module fw_sinks
   use fw_error, only: error_type
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: point_sink, sink_list

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
         ! A sink that fails keeps the point from those behind it.
         call self%items(i)%sink%take(point, error)
         if (allocated(error)) return
      end do
   end subroutine take

end module fw_sinks
