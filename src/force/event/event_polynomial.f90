!> Trigonometric polynomials at single angles:
!>
!>   p(tau) = c_0 + sum_m c_m cos(m tau) + s_m sin(m tau),   stored as (0:degree, cosine and sine).
!>
!> The kernels of event-resolved sampling evaluate them at a few angles that no grid holds.
module fw_event_polynomial
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: fill_waves, value_of, value_and_slope, differentiate

contains

   !> cos(m angle) and sin(m angle) for m = 0..degree, by rotation: the error grows as degree
   !> times the unit of round-off.
   pure subroutine fill_waves(degree, angle, cosines, sines)
      integer, intent(in) :: degree
      real(wp), intent(in) :: angle
      !> From the constant up to the degree.
      real(wp), intent(out) :: cosines(0:degree), sines(0:degree)
      real(wp) :: c, s
      integer :: m

      cosines(0) = 1.0_wp
      sines(0) = 0.0_wp
      if (degree == 0) return
      c = cos(angle)
      s = sin(angle)
      cosines(1) = c
      sines(1) = s
      ! Two at a time: half the length of the chain of dependent operations.
      do m = 2, degree
         cosines(m) = cosines(m/2)*cosines(m - m/2) - sines(m/2)*sines(m - m/2)
         sines(m) = sines(m/2)*cosines(m - m/2) + cosines(m/2)*sines(m - m/2)
      end do
   end subroutine fill_waves

   !> p where its waves are known.
   pure real(wp) function value_of(degree, p, cosines, sines) result(value)
      integer, intent(in) :: degree
      !> Cosine and sine coefficients (0:degree, 2), as everywhere here.
      real(wp), intent(in) :: p(0:degree, 2), cosines(0:degree), sines(0:degree)
      integer :: m

      value = 0.0_wp
      do m = 0, degree
         value = value + (p(m, 1)*cosines(m) + p(m, 2)*sines(m))
      end do
   end function value_of

   !> p and its derivative at an angle, with no room for the waves.
   !> p as above, degree >= 0.
   pure subroutine value_and_slope(degree, p, angle, value, slope)
      integer, intent(in) :: degree
      real(wp), intent(in) :: p(0:degree, 2), angle
      real(wp), intent(out) :: value, slope
      real(wp) :: c, s, c_1, s_1, c_next
      integer :: m

      c_1 = cos(angle)
      s_1 = sin(angle)
      c = c_1
      s = s_1
      value = p(0, 1)
      slope = 0.0_wp
      do m = 1, degree
         value = value + (p(m, 1)*c + p(m, 2)*s)
         slope = slope + real(m, wp)*(p(m, 2)*c - p(m, 1)*s)
         c_next = c*c_1 - s*s_1
         s = s*c_1 + c*s_1
         c = c_next
      end do
   end subroutine value_and_slope

   !> Coefficients of dp/dtau.
   !> In the same storage; the constant has none.
   pure subroutine differentiate(degree, p, derivative)
      integer, intent(in) :: degree
      real(wp), intent(in) :: p(0:degree, 2)
      real(wp), intent(out) :: derivative(0:degree, 2)
      integer :: m

      do m = 0, degree
         derivative(m, 1) = real(m, wp)*p(m, 2)
         derivative(m, 2) = -real(m, wp)*p(m, 1)
      end do
   end subroutine differentiate

end module fw_event_polynomial
