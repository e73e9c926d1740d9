!> Starts of a point from which no solution was found: the same way from the same start ends as it
!> did before. Halves of a step come back to places and guesses that were tried, and so do other
!> balances that give back what was known.
module fw_failed_starts
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: failed_starts

   !> What tells starts apart: a number for the way, the place, the share of the load, and three
   !> sums of the unknowns.
   integer, parameter :: n_marks = 6

   type :: failed_starts
      private
      !> (n_marks, n)
      real(wp), allocatable :: marks(:, :)
      integer :: n = 0
   contains
      procedure :: clear
      procedure :: add
      procedure :: hold
   end type failed_starts

contains

   !> Another point, or other equations.
   pure subroutine clear(self)
      class(failed_starts), intent(inout) :: self

      self%n = 0
   end subroutine clear

   !> No solution was found from there.
   pure subroutine add(self, way, place, share, x)
      class(failed_starts), intent(inout) :: self
      integer, intent(in) :: way
      real(wp), intent(in) :: place, share, x(:)
      real(wp), allocatable :: larger(:, :)

      if (.not. allocated(self%marks)) allocate (self%marks(n_marks, 16))
      if (self%n == size(self%marks, 2)) then
         allocate (larger(n_marks, 2*self%n))
         larger(:, :self%n) = self%marks
         call move_alloc(larger, self%marks)
      end if
      self%n = self%n + 1
      self%marks(:, self%n) = marks_of(way, place, share, x)
   end subroutine add

   !> Whether it was tried from there.
   pure logical function hold(self, way, place, share, x)
      class(failed_starts), intent(in) :: self
      integer, intent(in) :: way
      real(wp), intent(in) :: place, share, x(:)
      real(wp) :: wanted(n_marks)
      integer :: k

      hold = .false.
      if (self%n == 0) return
      wanted = marks_of(way, place, share, x)
      do k = 1, self%n
         hold = all(abs(self%marks(:, k) - wanted) <= 0.0_wp)
         if (hold) return
      end do
   end function hold

   !> Equal starts have equal marks; those that differ in one unknown alone do not.
   pure function marks_of(way, place, share, x) result(marks)
      integer, intent(in) :: way
      real(wp), intent(in) :: place, share, x(:)
      real(wp) :: marks(n_marks)
      integer :: k

      marks = [real(way, wp), place, share, sum(x), dot_product(x, x), 0.0_wp]
      do k = 1, size(x)
         marks(n_marks) = marks(n_marks) + real(k, wp)*x(k)
      end do
   end function marks_of

end module fw_failed_starts
