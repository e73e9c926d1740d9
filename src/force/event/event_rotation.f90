!> The direction of slip in the plane. A pair that slips has T = R (cos phi, sin phi), R = mu N, and
!> R phi' = P'.n with n = (-sin phi, cos phi). Up to its length the half-angle vector
!> v = (cos phi/2, sin phi/2) obeys the linear equation
!>
!>   v' = A v,   A = 1/2 [[a_x, a_y], [a_y, -a_x]],   a = P'/R,
!>
!> whose exponential is closed (A is traceless, so that A**2 is a multiple of the identity). A step
!> takes Magnus' series of fourth order at the two Gauss points (Iserles and Norsett 1999):
!>
!>   v_1 = exp(Omega) v_0,   Omega = h/2 (A_1 + A_2) - sqrt(3)/12 h**2 [A_1, A_2].
!>
!> The exponential does not depend on v: one for each step serves every turn.
!>
!> Where a pair lands, R = 0 and a is infinite, but phi is smooth: there it is a quadratic that
!> satisfies the equation at the Gauss points.
module fw_event_rotation
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: gauss_point, direction_of, half_angle
   public :: rotation_type, new_rotation, rotate, rotation_derivative
   public :: arc_type, new_arc

   !> Places of the two Gauss points in a step.
   real(wp), parameter :: gauss_point(2) = [0.5_wp - sqrt(3.0_wp)/6.0_wp, &
                                            0.5_wp + sqrt(3.0_wp)/6.0_wp]
   !> Factor of h**2 (a_2 x a_1) in the antisymmetric part of Omega.
   real(wp), parameter :: commutator = sqrt(3.0_wp)/24.0_wp
   integer, parameter :: newton_steps = 20

   !> exp(Omega) up to a factor: 1 + ratio Omega, Omega = [[p, q + r], [q - r, -p]].
   type :: rotation_type
      real(wp) :: h = 0.0_wp, p = 0.0_wp, q = 0.0_wp, r = 0.0_wp
      !> tanh(s)/s, s**2 = p**2 + q**2 - r**2, its derivative by s**2, and 1/cosh(s)**2.
      real(wp) :: ratio = 0.0_wp, slope = 0.0_wp, decay = 0.0_wp
   end type rotation_type

   !> phi = phi_0 + slope s + curvature s**2 behind a landing.
   !> phi_0 is the direction of P' at the landing.
   type :: arc_type
      real(wp) :: slope = 0.0_wp, curvature = 0.0_wp
      !> Matrix of the two conditions by slope and curvature, inverted.
      real(wp) :: inverse(2, 2) = 0.0_wp
   end type arc_type

contains

   !> Unit vector of the angle whose half v holds.
   pure function direction_of(v) result(t)
      real(wp), intent(in) :: v(2)
      real(wp) :: t(2)

      ! Difference of squares as a product: no cancellation where the direction is near +-90
      ! degrees.
      t(1) = (v(1) - v(2))*(v(1) + v(2))
      t(2) = 2.0_wp*v(1)*v(2)
   end function direction_of

   !> Half-angle vector of the direction of d.
   pure function half_angle(d) result(v)
      real(wp), intent(in) :: d(2)
      real(wp) :: v(2)
      real(wp) :: length

      v = [1.0_wp, 0.0_wp]
      length = norm2(d)
      if (length <= 0.0_wp) return
      ! 2 cos**2 = 1 + d_x/|d|, 2 sin**2 = 1 - d_x/|d|, 2 sin cos = d_y/|d|: without cancellation.
      if (d(1) >= 0.0_wp) then
         v(1) = sqrt(0.5_wp*(1.0_wp + d(1)/length))
         v(2) = 0.5_wp*d(2)/(length*v(1))
      else
         v(2) = sign(sqrt(0.5_wp*(1.0_wp - d(1)/length)), d(2))
         v(1) = 0.5_wp*d(2)/(length*v(2))
      end if
   end function half_angle

   !> The rotation of a step.
   pure type(rotation_type) function new_rotation(h, a_1, a_2) result(self)
      !> Length of the step, and P'/R at its Gauss points.
      real(wp), intent(in) :: h, a_1(2), a_2(2)

      self%h = h
      ! The symmetric part is the mean of A_1 and A_2 times h, the antisymmetric one their
      ! commutator.
      self%p = 0.25_wp*h*(a_1(1) + a_2(1))
      self%q = 0.25_wp*h*(a_1(2) + a_2(2))
      self%r = commutator*h**2*(a_2(1)*a_1(2) - a_2(2)*a_1(1))
      call hyperbolic(self%p**2 + self%q**2 - self%r**2, self%ratio, self%slope, self%decay)
   end function new_rotation

   !> exp(Omega) = cosh (1 + ratio Omega): ratio = tanh(s)/s, s**2 = p**2 + q**2 - r**2, its
   !> derivative by s**2, and 1/cosh**2.
   !> s**2 < 0 (much rotation by the commutator) makes them tan and 1/cos**2; the factor cosh itself
   !> drops out, because v is normalised.
   pure subroutine hyperbolic(square, ratio, slope, decay)
      real(wp), intent(in) :: square
      !> Both grow without bound as s**2 nears -(pi/2)**2 from above.
      real(wp), intent(out) :: ratio, slope, decay
      !> Below this the series are exact to round-off.
      real(wp), parameter :: small = 1.0e-3_wp
      !> tanh(s)/s in powers of s**2.
      real(wp), parameter :: c(0:5) = [1.0_wp, -1.0_wp/3.0_wp, 2.0_wp/15.0_wp, -17.0_wp/315.0_wp, &
                                       62.0_wp/2835.0_wp, -1382.0_wp/155925.0_wp]
      real(wp) :: s, t
      integer :: k

      if (abs(square) < small) then
         ratio = c(5)
         slope = 5.0_wp*c(5)
         do k = 4, 0, -1
            ratio = c(k) + square*ratio
            if (k > 0) slope = real(k, wp)*c(k) + square*slope
         end do
         decay = 1.0_wp - square*ratio**2
         return
      end if
      ! Direct formulas lose digits to ratio - decay for small s, which the series covers.
      s = sqrt(abs(square))
      if (square > 0.0_wp) then
         t = tanh(s)
         decay = 1.0_wp - t**2
      else
         t = tan(s)
         decay = 1.0_wp + t**2
      end if
      ratio = t/s
      slope = (decay - ratio)/(2.0_wp*square)
   end subroutine hyperbolic

   !> Half-angle vector (of length 1) after a step, and the derivative of phi by that before it.
   !> A length other than 1 of v would go through to the direction unharmed, but not to `gain`.
   pure subroutine rotate(step, v, after, gain)
      type(rotation_type), intent(in) :: step
      real(wp), intent(in) :: v(2)
      real(wp), intent(out) :: after(2), gain
      real(wp) :: square

      after(1) = v(1) + step%ratio*(step%p*v(1) + (step%q + step%r)*v(2))
      after(2) = v(2) + step%ratio*((step%q - step%r)*v(1) - step%p*v(2))
      square = after(1)**2 + after(2)**2
      ! The determinant of the exponential is 1.
      gain = step%decay/square
      after = after/sqrt(square)
   end subroutine rotate

   !> Derivatives of phi after a step by a at the Gauss points.
   pure subroutine rotation_derivative(step, a_1, a_2, v, by_a_1, by_a_2)
      type(rotation_type), intent(in) :: step
      real(wp), intent(in) :: a_1(2), a_2(2), v(2)
      real(wp), intent(out) :: by_a_1(2), by_a_2(2)
      real(wp) :: m(2), after(2), by(3), along

      ! d phi = 2 cross(v, dv)/|v|**2, phi being twice the angle of v.
      associate (p => step%p, q => step%q, r => step%r, ratio => step%ratio)
         m = [p*v(1) + (q + r)*v(2), (q - r)*v(1) - p*v(2)]
         after = v + ratio*m
         along = 2.0_wp*step%slope*cross(after, m)
         by(1) = along*p + ratio*cross(after, [v(1), -v(2)])
         by(2) = along*q + ratio*cross(after, [v(2), v(1)])
         by(3) = -along*r + ratio*cross(after, [v(2), -v(1)])
      end associate
      by = 2.0_wp*by/dot_product(after, after)
      ! p and q depend on both a alike; r by the product of one with the other turned.
      by_a_1 = 0.25_wp*step%h*by(1:2) + commutator*step%h**2*by(3)*[-a_2(2), a_2(1)]
      by_a_2 = 0.25_wp*step%h*by(1:2) + commutator*step%h**2*by(3)*[a_1(2), -a_1(1)]
   end subroutine rotation_derivative

   !> a x b of the plane: positive where b lies to the left of a.
   pure real(wp) function cross(a, b)
      real(wp), intent(in) :: a(2), b(2)

      cross = a(1)*b(2) - a(2)*b(1)
   end function cross

   !> The quadratic behind a landing, over a step of length h in the direction v at its start.
   !> Newton's method in slope and curvature, from a given slope and none; its last iterate is
   !> taken.
   pure function new_arc(h, v, p_slope, radius, slope) result(arc)
      !> P' (2, Gauss point), R (Gauss point), and phi' at the landing.
      real(wp), intent(in) :: h, v(2), p_slope(2, 2), radius(2), slope
      type(arc_type) :: arc
      real(wp) :: f(2), j(2, 2), t(2), s, determinant, change(2), phi, angle
      integer :: i, k

      arc%slope = slope
      phi = 2.0_wp*atan2(v(2), v(1))
      do k = 1, newton_steps
         do i = 1, 2
            s = gauss_point(i)*h
            angle = phi + arc%slope*s + arc%curvature*s**2
            t = [cos(angle), sin(angle)]
            ! R phi' - P'.n at both Gauss points.
            f(i) = radius(i)*(arc%slope + 2.0_wp*arc%curvature*s) - cross(t, p_slope(:, i))
            j(i, 1) = radius(i) + s*dot_product(t, p_slope(:, i))
            j(i, 2) = 2.0_wp*radius(i)*s + s**2*dot_product(t, p_slope(:, i))
         end do
         determinant = j(1, 1)*j(2, 2) - j(1, 2)*j(2, 1)
         if (abs(determinant) <= 0.0_wp) return
         arc%inverse(1, :) = [j(2, 2), -j(1, 2)]/determinant
         arc%inverse(2, :) = [-j(2, 1), j(1, 1)]/determinant
         change = arc%inverse(:, 1)*f(1) + arc%inverse(:, 2)*f(2)
         arc%slope = arc%slope - change(1)
         arc%curvature = arc%curvature - change(2)
         ! Changes of the angle over the step, in radians.
         if (maxval(abs(change)*[h, h**2]) <= 1.0e-14_wp) return
      end do
   end function new_arc

end module fw_event_rotation
