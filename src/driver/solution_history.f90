!> The last solutions of a sweep, from which the next one is guessed.
module fw_solution_history
   use fw_extrapolation, only: best_order, extrapolate
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: solution_history

   !> Solutions that are kept: polynomials up to the fourth order.
   integer, parameter :: most_kept = 5
   !> Steps longer than this many of the last one are guessed by a straight line at most: what a
   !> curved one leaves out grows with their power.
   real(wp), parameter :: far = 2.0_wp
   !> Share of what a line would have been off that a curve has to come nearer than: two orders that
   !> did alike say that neither fits.
   real(wp), parameter :: clearly = 0.6_wp

   type :: solution_history
      !> How many there are.
      integer :: kept = 0
      !> Frequencies or other values along the sweep, the newest first, and the unknowns there (n,
      !> most_kept).
      real(wp) :: place(most_kept) = -1.0_wp
      real(wp), allocatable :: x(:, :)
      integer, private :: order = 0
   contains
      procedure :: start
      procedure :: begin_with
      procedure :: remember
      procedure :: predict
   end type solution_history

contains

   !> Nothing is known yet of n unknowns.
   subroutine start(self, n)
      class(solution_history), intent(inout) :: self
      integer, intent(in) :: n

      allocate (self%x(n, most_kept), source=0.0_wp)
   end subroutine start

   !> A solution from elsewhere is all that is known: those before are of other harmonics, say.
   pure subroutine begin_with(self, place, x)
      class(solution_history), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)

      self%kept = 0
      call self%remember(place, x)
   end subroutine begin_with

   !> The newest solution; one at the same place replaces it.
   pure subroutine remember(self, place, x)
      class(solution_history), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)
      integer :: k

      if (self%kept > 0) then
         ! No direction to extrapolate in.
         if (abs(place - self%place(1)) <= 0.0_wp) then
            self%x(:, 1) = x
            return
         end if
         self%order = best_order(self%place(:self%kept), self%x, place, x, clearly)
      end if
      do k = most_kept, 2, -1
         self%place(k) = self%place(k - 1)
         self%x(:, k) = self%x(:, k - 1)
      end do
      self%place(1) = place
      self%x(:, 1) = x
      self%kept = min(most_kept, self%kept + 1)
      ! The second solution makes a line possible, and nothing is known of it.
      if (self%kept == 2) self%order = 1
   end subroutine remember

   !> A guess from two solutions at least, by the order that would have served the last one best,
   !> but by a line at least: a sweep goes somewhere.
   pure subroutine predict(self, place, x)
      class(solution_history), intent(in) :: self
      real(wp), intent(in) :: place
      real(wp), intent(out) :: x(:)
      integer :: order

      order = max(1, self%order)
      if (abs(place - self%place(1)) > far*abs(self%place(1) - self%place(2))) order = 1
      call extrapolate(self%place(:order + 1), self%x, place, x)
   end subroutine predict

end module fw_solution_history
