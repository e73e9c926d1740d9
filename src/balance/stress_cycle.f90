!> Amplitude and mean of a cycle of stress, of the six components at a point, by von Mises:
!>
!>   by range   amplitude: half the largest von Mises stress of the difference between two instants,
!>              mean: von Mises stress half way between these, with the sign of its trace
!>   by sign    of the von Mises stress with the sign of the trace: half its range, and the middle
!>
!> Five components w of the deviator have |w| = von Mises stress, so that the first is half the
!> diameter of a closed curve. A grid of instants finds its extremes, Newton's method locates them.
module fw_stress_cycle
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: new_stress_grid, stress_cycle, stress_grid, utilisation_of
   public :: method_words, by_range, by_sign
   public :: diagram_words, goodman, gerber

   integer, parameter :: by_range = 1, by_sign = 2
   character(*), parameter :: method_words(*) = [character(6) :: 'range', 'signed']
   integer, parameter :: goodman = 1, gerber = 2
   character(*), parameter :: diagram_words(*) = [character(7) :: 'goodman', 'gerber']

   !> Waves (0, c1, s1, ...) at evenly spaced instants (2H+1, n_time).
   type :: stress_grid
      integer :: n_harmonics = 0
      real(wp), allocatable :: waves(:, :)
   end type stress_grid

   !> Squares of stress have waves up to 2 H: eight instants in each of these leave an extreme 8 %
   !> below its height at most.
   integer, parameter :: fewest_instants = 32, instants_per_harmonic = 16
   !> Ranges on the grid that may belong to the largest, and located ones that are as large.
   real(wp), parameter :: may_be_largest = 0.8_wp, as_large = 1.0_wp - 1.0e-9_wp
   integer, parameter :: most_steps = 40
   !> Newton's steps so small change the square of a distance by less than its round-off.
   real(wp), parameter :: smallest_step = 1.0e-9_wp

   !> Deviator and trace of a stress over a period.
   type :: curve_type
      !> (5, 2H+1), (2H+1)
      real(wp), allocatable :: deviator(:, :), trace(:)
   end type curve_type

contains

   pure type(stress_grid) function new_stress_grid(n_harmonics) result(self)
      integer, intent(in) :: n_harmonics
      integer :: k, n

      n = max(fewest_instants, instants_per_harmonic*n_harmonics)
      self%n_harmonics = n_harmonics
      allocate (self%waves(2*n_harmonics + 1, n))
      do k = 1, n
         self%waves(:, k) = waves_at(n_harmonics, 2.0_wp*pi*(k - 1)/n, 0)
      end do
   end function new_stress_grid

   !> Waves at an instant, or a derivative of them by tau.
   pure function waves_at(n_harmonics, tau, order) result(waves)
      integer, intent(in) :: n_harmonics, order
      real(wp), intent(in) :: tau
      real(wp) :: waves(2*n_harmonics + 1)
      integer :: n

      waves(1) = merge(1.0_wp, 0.0_wp, order == 0)
      do n = 1, n_harmonics
         ! A derivative is the same wave a quarter of its period further on.
         associate (at => n*tau + 0.5_wp*pi*order, factor => real(n, wp)**order)
            waves(2*n) = factor*cos(at)
            waves(2*n + 1) = factor*sin(at)
         end associate
      end do
   end function waves_at

   !> Amplitude and mean [force/length**2].
   subroutine stress_cycle(coefficients, grid, method, amplitude, mean, jumps)
      !> Fourier coefficients (0, c1, s1, ...) of xx, yy, zz, xy, yz, zx (2H+1, 6).
      real(wp), intent(in) :: coefficients(:, :)
      type(stress_grid), intent(in) :: grid
      integer, intent(in) :: method
      real(wp), intent(out) :: amplitude, mean
      !> Whether the signed stress jumps, as the trace changes its sign.
      logical, intent(out) :: jumps
      type(curve_type) :: curve

      curve = curve_of(coefficients)
      jumps = .false.
      if (method == by_sign) then
         call signed_range(curve, grid, amplitude, mean, jumps)
      else if (maxval([0.0_wp, abs(coefficients(4:, :))]) > 0.0_wp) then
         call largest_range(curve, grid, amplitude, mean)
      else
         call range_of_ellipse(curve, amplitude, mean)
      end if
   end subroutine stress_cycle

   !> Share of what a point endures: below 1 it lasts.
   elemental real(wp) function utilisation_of(amplitude, mean, endurance, ultimate, diagram) &
      result(share)
      real(wp), intent(in) :: amplitude, mean, endurance, ultimate
      integer, intent(in) :: diagram

      share = max(mean, 0.0_wp)/ultimate
      if (diagram == gerber) share = share**2
      share = share + amplitude/endurance
   end function utilisation_of

   pure type(curve_type) function curve_of(coefficients) result(curve)
      real(wp), intent(in) :: coefficients(:, :)

      allocate (curve%deviator(5, size(coefficients, 1)))
      associate (xx => coefficients(:, 1), yy => coefficients(:, 2), zz => coefficients(:, 3))
         curve%deviator(1, :) = xx - 0.5_wp*(yy + zz)
         curve%deviator(2, :) = 0.5_wp*sqrt(3.0_wp)*(yy - zz)
         curve%deviator(3:5, :) = sqrt(3.0_wp)*transpose(coefficients(:, 4:6))
         curve%trace = xx + yy + zz
      end associate
   end function curve_of

   !> Von Mises stress with the sign of the trace.
   pure real(wp) function with_sign(deviator, trace)
      real(wp), intent(in) :: deviator(5), trace

      with_sign = merge(-1.0_wp, 1.0_wp, trace < 0.0_wp)*norm2(deviator)
   end function with_sign

   !> One harmonic runs along an ellipse, whose half diameter is a closed form.
   pure subroutine range_of_ellipse(curve, amplitude, mean)
      type(curve_type), intent(in) :: curve
      real(wp), intent(out) :: amplitude, mean
      real(wp) :: a, b, d

      amplitude = 0.0_wp
      mean = with_sign(curve%deviator(:, 1), curve%trace(1))
      if (size(curve%trace) < 3) return
      a = sum(curve%deviator(:, 2)**2)
      d = sum(curve%deviator(:, 3)**2)
      b = dot_product(curve%deviator(:, 2), curve%deviator(:, 3))
      amplitude = sqrt(0.5_wp*(a + d) + hypot(0.5_wp*(a - d), b))
   end subroutine range_of_ellipse

   !> The two instants that are furthest apart; of several such pairs the one with the largest mean.
   pure subroutine largest_range(curve, grid, amplitude, mean)
      type(curve_type), intent(in) :: curve
      type(stress_grid), intent(in) :: grid
      real(wp), intent(out) :: amplitude, mean
      real(wp), allocatable :: w(:, :), range(:, :), found(:, :)
      integer :: i, j, n, n_found
      real(wp) :: size_of(size(grid%waves, 2))

      n = size(grid%waves, 2)
      w = matmul(curve%deviator, grid%waves)
      range = matmul(transpose(w), w)
      size_of = [(range(i, i), i=1, n)]
      do j = 1, n
         range(:, j) = size_of + size_of(j) - 2.0_wp*range(:, j)
      end do
      associate (least => may_be_largest*maxval(range))
         allocate (found(2, n*n/2))
         n_found = 0
         do j = 2, n
            do i = 1, j - 1
               if (range(i, j) < least .or. .not. is_summit(range, i, j)) cycle
               n_found = n_found + 1
               call locate(curve, grid, i, j, found(1, n_found), found(2, n_found))
            end do
         end do
      end associate
      ! Without any vibration every pair is as far apart as any other.
      amplitude = maxval(found(1, :n_found))
      mean = maxval(found(2, :n_found), mask=found(1, :n_found) >= as_large*amplitude)
      amplitude = 0.5_wp*amplitude
   end subroutine largest_range

   !> Whether no neighbour on the grid is higher.
   pure logical function is_summit(values, i, j)
      real(wp), intent(in) :: values(:, :)
      integer, intent(in) :: i, j
      integer :: n

      n = size(values, 1)
      is_summit = values(i, j) >= maxval(values([modulo(i - 2, n) + 1, i, modulo(i, n) + 1], &
                                                [modulo(j - 2, n) + 1, j, modulo(j, n) + 1]))
   end function is_summit

   !> The largest distance near two instants of the grid, and the mean stress between them.
   pure subroutine locate(curve, grid, i, j, range, mean)
      type(curve_type), intent(in) :: curve
      type(stress_grid), intent(in) :: grid
      integer, intent(in) :: i, j
      real(wp), intent(out) :: range, mean
      real(wp) :: tau(2), next(2), step(2), square, higher
      integer :: halvings, k

      associate (spacing => 2.0_wp*pi/size(grid%waves, 2), h => grid%n_harmonics)
         tau = spacing*[i - 1, j - 1]
         square = distance(tau)
         do k = 1, most_steps
            step = ascent(curve, h, tau, spacing)
            if (norm2(step) <= smallest_step) exit
            do halvings = 1, most_steps
               next = tau + step
               higher = distance(next)
               if (higher > square) exit
               step = 0.5_wp*step
            end do
            if (.not. higher > square) exit
            tau = next
            square = higher
         end do
         range = sqrt(square)
         associate (middle => 0.5_wp*(waves_at(h, tau(1), 0) + waves_at(h, tau(2), 0)))
            mean = with_sign(matmul(curve%deviator, middle), dot_product(curve%trace, middle))
         end associate
      end associate

   contains

      !> Square of the distance between two instants.
      pure real(wp) function distance(at)
         real(wp), intent(in) :: at(2)

         distance = sum(matmul(curve%deviator, waves_at(grid%n_harmonics, at(1), 0) &
                               - waves_at(grid%n_harmonics, at(2), 0))**2)
      end function distance

   end subroutine locate

   !> Newton's step towards a maximum of the distance, or one uphill where it would go elsewhere.
   pure function ascent(curve, h, tau, spacing) result(step)
      type(curve_type), intent(in) :: curve
      integer, intent(in) :: h
      real(wp), intent(in) :: tau(2), spacing
      real(wp) :: step(2), w(5, 2), v(5, 2), a(5, 2), slope(2), curvature(2, 2), det
      integer :: k

      do k = 1, 2
         w(:, k) = matmul(curve%deviator, waves_at(h, tau(k), 0))
         v(:, k) = matmul(curve%deviator, waves_at(h, tau(k), 1))
         a(:, k) = matmul(curve%deviator, waves_at(h, tau(k), 2))
      end do
      associate (d => w(:, 1) - w(:, 2))
         slope = [dot_product(d, v(:, 1)), -dot_product(d, v(:, 2))]
         curvature(1, 1) = dot_product(v(:, 1), v(:, 1)) + dot_product(d, a(:, 1))
         curvature(2, 2) = dot_product(v(:, 2), v(:, 2)) - dot_product(d, a(:, 2))
         curvature(1, 2) = -dot_product(v(:, 1), v(:, 2))
      end associate
      det = curvature(1, 1)*curvature(2, 2) - curvature(1, 2)**2
      if (curvature(1, 1) < 0.0_wp .and. det > 0.0_wp) then
         step = -[curvature(2, 2)*slope(1) - curvature(1, 2)*slope(2), &
                  curvature(1, 1)*slope(2) - curvature(1, 2)*slope(1)]/det
      else
         step = 0.5_wp*spacing*slope/max(norm2(slope), tiny(1.0_wp))
      end if
      if (norm2(step) > spacing) step = step*spacing/norm2(step)
   end function ascent

   !> Range of the von Mises stress with the sign of the trace.
   subroutine signed_range(curve, grid, amplitude, mean, jumps)
      type(curve_type), intent(in) :: curve
      type(stress_grid), intent(in) :: grid
      real(wp), intent(out) :: amplitude, mean
      logical, intent(out) :: jumps
      real(wp) :: trace(size(grid%waves, 2)), square(size(grid%waves, 2))
      real(wp) :: highest, lowest, spacing, tau
      integer :: k, n, next

      n = size(trace)
      spacing = 2.0_wp*pi/n
      trace = matmul(curve%trace, grid%waves)
      square = sum(matmul(curve%deviator, grid%waves)**2, dim=1)
      jumps = any(trace < 0.0_wp) .and. any(.not. trace < 0.0_wp)
      highest = -huge(1.0_wp)
      lowest = huge(1.0_wp)
      do k = 1, n
         call take(with_sign([sqrt(square(k)), 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], trace(k)))
         next = modulo(k, n) + 1
         tau = spacing*(k - 1)
         ! An extreme between this instant and the next: the slope changes its sign.
         call look_between(tau)
         if ((trace(k) < 0.0_wp) .neqv. (trace(next) < 0.0_wp)) then
            ! Both signs count where the trace passes zero.
            tau = root_of_trace(curve, grid%n_harmonics, tau, tau + spacing)
            call take(size_at(tau))
            call take(-size_at(tau))
         end if
      end do
      amplitude = 0.5_wp*(highest - lowest)
      mean = 0.5_wp*(highest + lowest)

   contains

      subroutine take(value)
         real(wp), intent(in) :: value

         highest = max(highest, value)
         lowest = min(lowest, value)
      end subroutine take

      subroutine look_between(start)
         real(wp), intent(in) :: start
         real(wp) :: at
         logical :: found

         call stationary(curve, grid%n_harmonics, start, start + spacing, at, found)
         if (.not. found) return
         associate (here => waves_at(grid%n_harmonics, at, 0))
            call take(with_sign(matmul(curve%deviator, here), dot_product(curve%trace, here)))
         end associate
      end subroutine look_between

      pure real(wp) function size_at(at)
         real(wp), intent(in) :: at

         size_at = norm2(matmul(curve%deviator, waves_at(grid%n_harmonics, at, 0)))
      end function size_at

   end subroutine signed_range

   !> Where the trace changes its sign between two instants, by bisection.
   pure real(wp) function root_of_trace(curve, h, first, last) result(tau)
      type(curve_type), intent(in) :: curve
      integer, intent(in) :: h
      real(wp), intent(in) :: first, last
      real(wp) :: low, high, sign_low
      integer :: k

      low = first
      high = last
      sign_low = dot_product(curve%trace, waves_at(h, first, 0))
      do k = 1, digits(1.0_wp)
         tau = 0.5_wp*(low + high)
         if ((dot_product(curve%trace, waves_at(h, tau, 0)) < 0.0_wp) .eqv. &
             (sign_low < 0.0_wp)) then
            low = tau
         else
            high = tau
         end if
      end do
   end function root_of_trace

   !> An instant in between at which the von Mises stress is largest or least, by Newton's method
   !> on its slope, with bisection where that would leave.
   pure subroutine stationary(curve, h, first, last, tau, found)
      type(curve_type), intent(in) :: curve
      integer, intent(in) :: h
      real(wp), intent(in) :: first, last
      real(wp), intent(out) :: tau
      logical, intent(out) :: found
      real(wp) :: low, high, slope_low, slope, curvature
      integer :: k

      low = first
      high = last
      tau = last
      call differentiate(curve, h, last, slope, curvature)
      call differentiate(curve, h, first, slope_low, curvature)
      found = slope_low*slope < 0.0_wp
      if (.not. found) return
      do k = 1, most_steps
         tau = 0.5_wp*(low + high)
         if (k > 1 .and. abs(curvature) > 0.0_wp) then
            associate (newton => low - slope_low/curvature)
               if (newton > low .and. newton < high) tau = newton
            end associate
         end if
         call differentiate(curve, h, tau, slope, curvature)
         if (.not. abs(slope) > 0.0_wp) return
         if (slope*slope_low < 0.0_wp) then
            high = tau
            ! The curvature belongs to the lower end.
            call differentiate(curve, h, low, slope_low, curvature)
         else
            low = tau
            slope_low = slope
         end if
      end do
   end subroutine stationary

   !> Of half the square of the von Mises stress, by tau.
   pure subroutine differentiate(curve, h, tau, slope, curvature)
      type(curve_type), intent(in) :: curve
      integer, intent(in) :: h
      real(wp), intent(in) :: tau
      real(wp), intent(out) :: slope, curvature

      associate (w => matmul(curve%deviator, waves_at(h, tau, 0)), &
                 v => matmul(curve%deviator, waves_at(h, tau, 1)), &
                 a => matmul(curve%deviator, waves_at(h, tau, 2)))
         slope = dot_product(w, v)
         curvature = dot_product(v, v) + dot_product(w, a)
      end associate
   end subroutine differentiate

end module fw_stress_cycle
