!> Polynomials through points that are known, to guess the next one.
module fw_extrapolation
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: extrapolate

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

end module fw_extrapolation
