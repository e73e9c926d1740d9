!> All roots in [0, 2 pi) of a trigonometric polynomial of known degree from its values and slopes
!> on a uniform grid of more than 2 degree angles.
!>
!> Certificates of a cell of width w, with M_k a bound of the k-th derivative:
!>   one root or none   both end slopes have one sign and exceed w**2 M_3/8, so that p is monotone;
!>   no root            the ends have one sign and the Hermite cubic stays above w**4 M_4/384.
!> Cells without one are halved. M_k is the smaller of degree**k max|p| (Bernstein), with
!> max|p| <= max|samples|/cos(pi degree/n) (Ehlich and Zeller 1964), and sum m**k (|c_m| + |s_m|).
module fw_event_roots
   use fw_event_polynomial, only: value_and_slope
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: find_roots, root_between
   public :: bounds_type, new_bounds, knot_type, changes_sign, monotone, keeps_sign

   !> Bounds of a polynomial.
   type :: bounds_type
      !> Third and fourth derivative.
      real(wp) :: third = 0.0_wp, fourth = 0.0_wp
      !> Values and slopes (per cell width) below this are round-off.
      real(wp) :: noise = 0.0_wp
   end type bounds_type

   !> End of a cell.
   !> p and p' at an angle; the slope is per radian, not per cell.
   type :: knot_type
      real(wp) :: angle, value, slope
   end type knot_type

   !> Halvings after which two roots in a cell, or none, make no difference to double precision.
   ! Width 2 pi/n 2**(-26) squared is below round-off: a parabola cannot dip that much more.
   integer, parameter :: max_depth = 26
   !> Round-off of a sum of waves relative to the sum of its amplitudes.
   real(wp), parameter :: round_off = 1.0e-15_wp
   ! Halving alone takes 52 from a bracket of the size of 1.
   integer, parameter :: newton_steps = 60
   !> Relative accuracy of an angle.
   real(wp), parameter :: angle_tolerance = 4.0e-16_wp

contains

   !> Bounds from samples and coefficients. `scale` is the size of the terms that p was computed
   !> from, which may be far larger than p.
   pure type(bounds_type) function new_bounds(n, degree, p, values, scale) result(self)
      integer, intent(in) :: n, degree
      !> The polynomial, its values on the grid, and the sum of its amplitudes.
      real(wp), intent(in) :: p(0:degree, 2), values(n), scale
      real(wp) :: largest, amplitude, third, fourth
      integer :: m

      ! Valid for n > 2 degree: the cosine is positive.
      largest = maxval(abs(values))/cos(pi*real(degree, wp)/real(n, wp))
      third = 0.0_wp
      fourth = 0.0_wp
      do m = 1, degree
         amplitude = abs(p(m, 1)) + abs(p(m, 2))
         third = third + real(m, wp)**3*amplitude
         fourth = fourth + real(m, wp)**4*amplitude
      end do
      self%third = min(third, real(degree, wp)**3*largest)
      self%fourth = min(fourth, real(degree, wp)**4*largest)
      ! Of `scale`, since p may be a small difference of large terms.
      self%noise = round_off*scale
   end function new_bounds

   !> Append the roots of p to `roots`, ascending. A value of zero counts as positive.
   pure subroutine find_roots(n, degree, p, values, slopes, scale, n_roots, roots)
      integer, intent(in) :: n, degree
      !> Coefficients, and samples at 2 pi k/n, k = 0..n-1, n > 2 degree.
      real(wp), intent(in) :: p(0:degree, 2), values(n), slopes(n), scale
      integer, intent(inout) :: n_roots
      real(wp), intent(inout) :: roots(:)
      type(bounds_type) :: bounds
      type(knot_type) :: left, right
      real(wp) :: width
      integer :: k

      bounds = new_bounds(n, degree, p, values, scale)
      ! Nothing but round-off has no roots: touching zero everywhere is no switch.
      if (maxval(abs(values)) <= bounds%noise) return
      width = 2.0_wp*pi/real(n, wp)
      right = knot_type(0.0_wp, values(1), slopes(1))
      do k = 1, n
         ! The end of the last cell is the first sample, at the angle 2 pi.
         left = right
         right = knot_type(width*real(k, wp), values(modulo(k, n) + 1), slopes(modulo(k, n) + 1))
         if (monotone(left, right, bounds)) then
            if (changes_sign(left, right)) then
               call append(degree, p, left, right, bounds%noise, n_roots, roots)
            end if
         else if (.not. keeps_sign(left, right, bounds)) then
            call halve(degree, p, left, right, bounds, n_roots, roots)
         end if
      end do
   end subroutine find_roots

   !> Search a cell without a certificate, its left half first.
   !> Iterative instead of recursive, with the right ends that wait on a stack: a cell is finished
   !> before its neighbour is looked at, so the roots come in ascending order.
   pure subroutine halve(degree, p, left, right, bounds, n_roots, roots)
      integer, intent(in) :: degree
      real(wp), intent(in) :: p(0:degree, 2)
      type(knot_type), intent(in) :: left, right
      type(bounds_type), intent(in) :: bounds
      integer, intent(inout) :: n_roots
      real(wp), intent(inout) :: roots(:)
      type(knot_type) :: first, second, waiting(max_depth)
      integer :: depth, level(max_depth), n_waiting

      first = left
      n_waiting = 1
      waiting(1) = right
      level(1) = 0
      do while (n_waiting > 0)
         second = waiting(n_waiting)
         depth = level(n_waiting)
         if (monotone(first, second, bounds) .or. depth + 1 >= max_depth .or. &
             negligible(first, second, bounds)) then
            if (changes_sign(first, second)) then
               call append(degree, p, first, second, bounds%noise, n_roots, roots)
            end if
         else if (.not. keeps_sign(first, second, bounds)) then
            level(n_waiting) = depth + 1
            n_waiting = n_waiting + 1
            level(n_waiting) = depth + 1
            waiting(n_waiting)%angle = 0.5_wp*(first%angle + second%angle)
            call value_and_slope(degree, p, waiting(n_waiting)%angle, &
                                 waiting(n_waiting)%value, waiting(n_waiting)%slope)
            cycle
         end if
         first = second
         n_waiting = n_waiting - 1
      end do
   end subroutine halve

   !> Zero counts as positive at both ends, so that a root on a knot is found in one cell only.
   pure logical function changes_sign(left, right)
      type(knot_type), intent(in) :: left, right

      changes_sign = (left%value >= 0.0_wp) .neqv. (right%value >= 0.0_wp)
   end function changes_sign

   !> Slopes of one sign that the third derivative cannot turn.
   pure logical function monotone(left, right, bounds)
      type(knot_type), intent(in) :: left, right
      type(bounds_type), intent(in) :: bounds
      real(wp) :: least

      ! p' differs from the line between its end values by at most w**2 M_3/8.
      least = 0.125_wp*(right%angle - left%angle)**2*bounds%third
      monotone = min(left%slope, right%slope) > least .or. max(left%slope, right%slope) < -least
   end function monotone

   !> The Hermite cubic, made positive at its ends, stays above its error.
   pure logical function keeps_sign(left, right, bounds)
      type(knot_type), intent(in) :: left, right
      type(bounds_type), intent(in) :: bounds
      real(wp) :: width, deviation, b(4), root, t, side
      real(wp) :: a(0:3)

      keeps_sign = .false.
      if (changes_sign(left, right)) return
      width = right%angle - left%angle
      ! Error of the Hermite cubic, w**4 M_4/4!/16 at the middle.
      deviation = width**4*bounds%fourth/384.0_wp
      side = merge(1.0_wp, -1.0_wp, left%value >= 0.0_wp)
      ! Control points of the cubic bound it from below.
      b = side*[left%value, left%value + width*left%slope/3.0_wp, &
                right%value - width*right%slope/3.0_wp, right%value]
      keeps_sign = minval(b) > deviation
      ! Near zero at an end only halving can tell.
      if (keeps_sign .or. min(b(1), b(4)) <= deviation) return
      ! Its only minimum inside, if any, is the root of the slope with positive curvature.
      a = [b(1), 3.0_wp*(b(2) - b(1)), 3.0_wp*(b(1) - 2.0_wp*b(2) + b(3)), &
           b(4) - b(1) + 3.0_wp*(b(2) - b(3))]
      keeps_sign = .true.
      root = a(2)**2 - 3.0_wp*a(3)*a(1)
      if (root <= 0.0_wp) return
      root = sqrt(root)
      if (a(2) + root > 0.0_wp) then
         t = -a(1)/(a(2) + root)
      else if (abs(a(3)) > 0.0_wp) then
         t = (root - a(2))/(3.0_wp*a(3))
      else
         return
      end if
      if (t <= 0.0_wp .or. t >= 1.0_wp) return
      keeps_sign = a(0) + t*(a(1) + t*(a(2) + t*a(3))) > deviation
   end function keeps_sign

   !> A cell whose values and slopes are round-off holds nothing that matters.
   !> Also its curvature, which the bound of the third derivative contains: without it a dip between
   !> two small ends would pass.
   pure logical function negligible(left, right, bounds)
      type(knot_type), intent(in) :: left, right
      type(bounds_type), intent(in) :: bounds
      real(wp) :: width

      width = right%angle - left%angle
      negligible = max(abs(left%value), abs(right%value), width*abs(left%slope), &
                       width*abs(right%slope)) <= bounds%noise .and. &
                   width**3*bounds%third <= bounds%noise
   end function negligible

   !> The root of a cell whose ends have values of opposite sign.
   pure subroutine append(degree, p, left, right, noise, n_roots, roots)
      integer, intent(in) :: degree
      real(wp), intent(in) :: p(0:degree, 2)
      type(knot_type), intent(in) :: left, right
      real(wp), intent(in) :: noise
      integer, intent(inout) :: n_roots
      real(wp), intent(inout) :: roots(:)

      ! Ascending order holds, because cells are visited from left to right.
      ! The polynomial has no more roots than fit; round-off may repeat one.
      if (n_roots == size(roots)) return
      n_roots = n_roots + 1
      roots(n_roots) = root_between(degree, p, 0.0_wp, left%angle, right%angle, left%value, &
                                    right%value, noise)
   end subroutine append

   !> The angle in [left, right] where p = level, p - level having other signs at the two ends:
   !> Newton's method, kept within the bracket by halving, until p - level is round-off.
   pure real(wp) function root_between(degree, p, level, left, right, left_value, right_value, &
                                       noise, incline) result(angle)
      integer, intent(in) :: degree
      real(wp), intent(in) :: p(0:degree, 2), level, left, right
      !> p - level at the ends, and its round-off.
      real(wp), intent(in) :: left_value, right_value, noise
      !> How the level rises with the angle, from that at 0 (default: not at all).
      real(wp), intent(in), optional :: incline
      real(wp) :: low, high, value, slope, step, trial
      integer :: k

      low = left
      high = right
      angle = left
      if (abs(left_value) <= 0.0_wp) return
      angle = right
      if (abs(right_value) <= 0.0_wp) return
      ! The first guess is that of the chord.
      angle = left + (right - left)*(left_value/(left_value - right_value))
      do k = 1, newton_steps
         call value_and_slope(degree, p, angle, value, slope)
         value = value - level
         if (present(incline)) then
            value = value - incline*angle
            slope = slope - incline
         end if
         ! The bracket shrinks on the side whose sign the value has.
         if ((value > 0.0_wp) .eqv. (left_value > 0.0_wp)) then
            low = angle
         else
            high = angle
         end if
         trial = 0.5_wp*(low + high)
         if (abs(slope) > 0.0_wp) then
            step = -value/slope
            if (angle + step > low .and. angle + step < high) trial = angle + step
         end if
         ! Either criterion: on a flat root the value is round-off long before the angle settles.
         if (abs(value) <= noise .or. high - low <= angle_tolerance*(1.0_wp + angle)) return
         step = trial - angle
         angle = trial
         if (abs(step) <= angle_tolerance*(1.0_wp + angle)) return
      end do
   end function root_between

end module fw_event_roots
