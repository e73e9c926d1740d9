!> Polynomials through points that are known, to guess the next one.
module fw_extrapolation
   use fw_kinds, only: wp
   use fw_norm, only: norm_of
   implicit none (type, external)
   private

   public :: best_order, extrapolate

contains

   !> The polynomial through the first columns of y, which are values at x, at another place
   !> (Lagrange).
   pure subroutine extrapolate(x, y, at, value)
      real(wp), intent(in) :: x(:), y(:, :), at
      real(wp), intent(out) :: value(:)
      real(wp) :: weight
      integer :: i, j

      value = 0.0_wp
      do i = 1, size(x)
         weight = 1.0_wp
         do j = 1, size(x)
            if (j /= i) weight = weight*(at - x(j))/(x(i) - x(j))
         end do
         value = value + weight*y(:, i)
      end do
   end subroutine extrapolate

   !> The order of the polynomial through the first columns of y that comes nearest to a value known
   !> at another place; beyond a jump or a kink all are off alike, a high one more than others.
   pure integer function best_order(x, y, at, value, share) result(order)
      !> As many as are known, one at least.
      real(wp), intent(in) :: x(:), y(:, :), at, value(:)
      !> A higher order has to come nearer than this share of what the best lower one is off.
      real(wp), intent(in) :: share
      real(wp) :: off, least, guess(size(value))
      integer :: k

      order = 0
      least = huge(1.0_wp)
      do k = 1, size(x)
         call extrapolate(x(:k), y, at, guess)
         guess = guess - value
         off = norm_of(guess)
         if (off >= share*least) cycle
         order = k - 1
         least = off
      end do
   end function best_order

end module fw_extrapolation
