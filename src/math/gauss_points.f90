!> Points and weights of Gauss and Legendre on [0, 1].
module fw_gauss_points
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: gauss_rule

contains

   !> The rule of size(points) points: Newton's method for the roots of the Legendre polynomial.
   pure subroutine gauss_rule(points, weights)
      real(wp), intent(out) :: points(:), weights(:)
      ! From the guess below four steps do for any number of points.
      integer, parameter :: steps = 8
      real(wp) :: x, p, before, last, slope
      integer :: i, k, m, n

      n = size(points)
      do i = 1, n
         x = cos(pi*(real(i, wp) - 0.25_wp)/(real(n, wp) + 0.5_wp))
         slope = 1.0_wp
         do k = 1, steps
            p = 1.0_wp
            last = 0.0_wp
            do m = 1, n
               before = last
               last = p
               p = (real(2*m - 1, wp)*x*last - real(m - 1, wp)*before)/real(m, wp)
            end do
            slope = real(n, wp)*(x*p - last)/(x**2 - 1.0_wp)
            x = x - p/slope
         end do
         points(i) = 0.5_wp*(1.0_wp - x)
         weights(i) = 1.0_wp/((1.0_wp - x**2)*slope**2)
      end do
   end subroutine gauss_rule

end module fw_gauss_points
