!> Solution points kept in memory, and the observer that keeps them.
module fw_session_points
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: point_list, point_recorder

   !> An item of its own, so that a longer list takes points over without copying them.
   type :: point_item
      type(point_type), allocatable :: point
   end type point_item

   !> Points in the order of their arrival.
   type :: point_list
      !> Points so far; the list has room for more.
      integer :: n = 0
      type(point_item), allocatable :: item(:)
   contains
      procedure :: add
      procedure :: clear
   end type point_list

   !> Keeps every point, then tells another observer, whose wish to stop it passes on.
   type, extends(observer_type) :: point_recorder
      type(point_list), pointer :: list => null()
      class(observer_type), pointer :: observer => null()
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
      procedure :: poll
   end type point_recorder

contains

   !> The list doubles: the number of points of a branch is not known beforehand.
   subroutine add(self, point)
      class(point_list), intent(inout) :: self
      type(point_type), intent(in) :: point
      integer, parameter :: first_size = 64
      type(point_item), allocatable :: longer(:)
      integer :: i

      if (.not. allocated(self%item)) allocate (self%item(first_size))
      if (self%n == size(self%item)) then
         allocate (longer(2*self%n))
         do i = 1, self%n
            call move_alloc(self%item(i)%point, longer(i)%point)
         end do
         call move_alloc(longer, self%item)
      end if
      self%n = self%n + 1
      self%item(self%n)%point = point
   end subroutine add

   !> Give the memory back too.
   subroutine clear(self)
      class(point_list), intent(inout) :: self

      if (allocated(self%item)) deallocate (self%item)
      self%n = 0
   end subroutine clear

   !> The other observer knows who asks for the end.
   subroutine poll(self)
      class(point_recorder), intent(inout) :: self

      call self%observer%poll()
      self%stop_requested = self%stop_requested .or. self%observer%stop_requested
      self%n_wanted = self%observer%n_wanted
   end subroutine poll

   subroutine on_start(self, case_title, n_points)
      class(point_recorder), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points

      ! What ended an earlier run does not end this one.
      self%observer%stop_requested = .false.
      call self%observer%on_start(case_title, n_points)
      self%stop_requested = self%observer%stop_requested
   end subroutine on_start

   !> Kept first: the other observer may ask for the very point that it is told of.
   subroutine on_point(self, index, n_points, point)
      class(point_recorder), intent(inout) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point

      call self%list%add(point)
      call self%observer%on_point(index, n_points, point)
      self%stop_requested = self%observer%stop_requested
   end subroutine on_point

   subroutine on_message(self, text)
      class(point_recorder), intent(inout) :: self
      character(*), intent(in) :: text

      call self%observer%on_message(text)
      self%stop_requested = self%observer%stop_requested
   end subroutine on_message

   subroutine on_end(self)
      class(point_recorder), intent(inout) :: self

      call self%observer%on_end()
   end subroutine on_end

end module fw_session_points
