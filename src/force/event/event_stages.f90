!> Gauss collocation of the direction of slip over a step. A pair that slips has T = R (cos phi,
!> sin phi), R = mu N, and
!>
!>   R phi' = P'.n,   n = (-sin phi, cos phi).
!>
!> phi is a polynomial of degree s that satisfies this at the s Gauss points of the step; in the
!> slopes k_j = phi' at them, phi_j = phi_0 + h sum_i a_ji k_i, Newton's method has the matrix
!> diag(R) + h diag(P'.t) a. Its order is 2s, and that of integrals by the same points (Hairer,
!> Norsett, Wanner 1993, II.7). R may vanish: where a pair lands nothing is divided by it, and the
!> polynomial follows the one solution that is smooth there.
module fw_event_stages
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: n_stages, n_points
   public :: rule_type, new_rule, stages_type, direction_of
   public :: solve_step, eliminate, angle_at, cosine_and_sine

   !> Gauss points of a step; and with its ends, where the motion is looked at.
   integer, parameter :: n_stages = 6, n_points = n_stages + 2
   integer, parameter :: max_iterations = 6
   real(wp), parameter :: quarter_turn = 0.5_wp*pi
   !> Change of phi behind which Newton's method leaves round-off: its square.
   real(wp), parameter :: last_change = 1.0e-7_wp
   !> Bound of the change of phi in a step; a larger one is divided by the caller.
   real(wp), parameter :: most_turning = 20.0_wp

   !> The quadrature on 0..1, and the integrals of the polynomials through its points.
   type :: rule_type
      !> 0, the Gauss points, 1; weights of the Gauss points, 0 at the ends.
      real(wp) :: place(n_points) = 0.0_wp, weight(n_points) = 0.0_wp
      !> Integral of polynomial i up to point j: none at the start, a_ji, the weights at the end.
      real(wp) :: integral(n_points, n_stages) = 0.0_wp
      !> phi' at all points from phi - phi_0 at the Gauss points.
      real(wp) :: difference(n_points, n_stages) = 0.0_wp
      !> phi' at the start and at the end from that at the Gauss points.
      real(wp) :: at_ends(n_stages, 2) = 0.0_wp
      !> Integral of polynomial i up to x: sum of power(m, i) x**m.
      real(wp) :: power(n_stages, n_stages) = 0.0_wp
      !> The slopes times these are the last Legendre coefficient of phi over h.
      real(wp) :: last(n_points) = 0.0_wp
   end type rule_type

   !> Slip over a step: phi and phi' at its points, the derivative of phi at the end by that at the
   !> start, and the last Legendre coefficient of phi.
   type :: stages_type
      real(wp) :: phi(n_points) = 0.0_wp, slope(n_points) = 0.0_wp
      real(wp) :: gain = 1.0_wp, last = 0.0_wp
   end type stages_type

contains

   !> Once for all pairs.
   pure type(rule_type) function new_rule() result(self)
      real(wp) :: x, p(3), slope, polynomial(0:n_stages), matrix(n_points, 2*n_stages)
      integer :: i, j, k, m
      logical :: regular

      self%place(n_points) = 1.0_wp
      do j = 1, n_stages
         ! Newton's method on Legendre's polynomial of degree s from the usual first guess.
         x = -cos(pi*(j - 0.25_wp)/(n_stages + 0.5_wp))
         do k = 1, 10
            call legendre(x, p, slope)
            x = x - p(3)/slope
         end do
         call legendre(x, p, slope)
         self%place(j + 1) = 0.5_wp*(1.0_wp + x)
         self%weight(j + 1) = 1.0_wp/((1.0_wp - x**2)*slope**2)
         ! phi' has 2s - 1 times the mean of phi' P_(s-1); h/2/(2s - 1) of it goes to P_s in phi.
         self%last(j + 1) = 0.5_wp*self%weight(j + 1)*p(2)
      end do
      matrix = 0.0_wp
      do j = 1, n_stages
         polynomial = 0.0_wp
         polynomial(0) = 1.0_wp
         do i = 1, n_stages
            if (i == j) cycle
            associate (from => self%place(i + 1), to => self%place(j + 1))
               ! Times (x - from)/(to - from).
               polynomial(1:) = (polynomial(:n_stages - 1) - from*polynomial(1:))/(to - from)
               polynomial(0) = -from*polynomial(0)/(to - from)
            end associate
         end do
         self%at_ends(j, :) = [polynomial(0), sum(polynomial)]
         do m = 1, n_stages
            self%power(m, j) = polynomial(m - 1)/real(m, wp)
         end do
         do i = 1, n_points
            self%integral(i, j) = sum([(self%power(m, j)*self%place(i)**m, m=1, n_stages)])
         end do
         matrix(j + 1, n_stages + j) = 1.0_wp
      end do
      matrix(:, :n_stages) = self%integral
      call eliminate(matrix, 2*n_stages, regular)
      self%difference = matrix(:, n_stages + 1:)
      do j = 1, n_stages
         do k = 1, 2
            self%difference(merge(1, n_points, k == 1), j) = &
               dot_product(self%at_ends(:, k), matrix(2:n_stages + 1, n_stages + j))
         end do
      end do
   end function new_rule

   !> Legendre's polynomials of degree s - 2 to s, and the slope of the last.
   pure subroutine legendre(x, p, slope)
      real(wp), intent(in) :: x
      real(wp), intent(out) :: p(3), slope
      integer :: n

      p = [0.0_wp, 1.0_wp, x]
      do n = 2, n_stages
         p = [p(2), p(3), ((2*n - 1)*x*p(3) - (n - 1)*p(2))/n]
      end do
      slope = n_stages*(x*p(3) - p(2))/(x**2 - 1.0_wp)
   end subroutine legendre

   !> Unit vector of an angle.
   pure function direction_of(phi) result(t)
      real(wp), intent(in) :: phi
      real(wp) :: t(2)

      t = [cos(phi), sin(phi)]
   end function direction_of

   !> Cosine and sine of the angles of a step.
   pure subroutine cosine_and_sine(phi, cosine, sine)
      real(wp), intent(in) :: phi(n_points)
      real(wp), intent(out) :: cosine(n_points), sine(n_points)
      real(wp) :: both(2*n_points)

      ! One function of all: compilers make calls one by one of a cosine and a sine of one angle.
      both(:n_points) = phi
      both(n_points + 1:) = phi - quarter_turn
      both = cos(both)
      cosine = both(:n_points)
      sine = both(n_points + 1:)
   end subroutine cosine_and_sine

   !> phi at the part x of a step of length h.
   pure real(wp) function angle_at(rule, h, phi_0, slope, x)
      type(rule_type), intent(in) :: rule
      real(wp), intent(in) :: h, phi_0, slope(n_points), x
      integer :: m

      angle_at = 0.0_wp
      do m = n_stages, 1, -1
         angle_at = x*(angle_at + dot_product(rule%power(m, :), slope(2:n_stages + 1)))
      end do
      angle_at = phi_0 + h*angle_at
   end function angle_at

   !> Slip over a step of length h from the direction stages%phi(1).
   !> All points at once: the ends, which are no unknowns, go along.
   pure subroutine solve_step(rule, h, dp, radius, slope_0, stages, done)
      type(rule_type), intent(in) :: rule
      real(wp), intent(in) :: h
      !> P' and R at the points of the step; R is not negative.
      real(wp), intent(in) :: dp(n_points, 2), radius(n_points)
      !> phi' at the start, where R vanishes there.
      real(wp), intent(in) :: slope_0
      type(stages_type), intent(inout) :: stages
      !> False: the step is to be divided.
      logical, intent(out) :: done
      real(wp) :: a(n_points, n_stages + 2)
      real(wp), dimension(n_points) :: cosine, sine, along, change
      integer :: i, j, k
      logical :: regular

      ! Two or three steps of Newton's method from there.
      call guess(rule, h, dp, radius, slope_0, stages)
      done = .false.
      do k = 1, max_iterations
         call cosine_and_sine(stages%phi, cosine, sine)
         along = cosine*dp(:, 1) + sine*dp(:, 2)
         do i = 1, n_stages
            do j = 1, n_points
               a(j, i) = (h*along(j))*rule%integral(j, i)
            end do
            a(i + 1, i) = a(i + 1, i) + radius(i + 1)
         end do
         ! The last column is that of phi_0, for the gain.
         ! The residual R phi' - P'.n; at the ends it is meaningless, and harmless.
         a(:, n_stages + 1) = radius*stages%slope + sine*dp(:, 1) - cosine*dp(:, 2)
         a(:, n_stages + 2) = along
         call eliminate(a, n_stages + 2, regular)
         if (.not. regular) return
         ! phi_0 is given: the row of the start is zero in `integral`.
         change = 0.0_wp
         do i = 1, n_stages
            do j = 1, n_points
               change(j) = change(j) + (h*a(i + 1, n_stages + 1))*rule%integral(j, i)
            end do
         end do
         stages%slope(2:n_stages + 1) = stages%slope(2:n_stages + 1) - &
                                        a(2:n_stages + 1, n_stages + 1)
         stages%phi = stages%phi - change
         done = maxval(abs(change)) <= last_change
         if (done) exit
         if (.not. maxval(abs(change)) < most_turning) return
      end do
      do k = 1, 2
         i = merge(1, n_points, k == 1)
         stages%slope(i) = dot_product(rule%at_ends(:, k), stages%slope(2:n_stages + 1))
      end do
      stages%phi(n_points) = stages%phi(1) + h*dot_product(rule%weight, stages%slope)
      stages%gain = 1.0_wp - h*dot_product(rule%weight, a(:, n_stages + 2))
      stages%last = h*dot_product(rule%last, stages%slope)
   end subroutine solve_step

   !> From point to point in closed form, with the mean of P'/R: the half-angle vector
   !> v = (cos phi/2, sin phi/2) obeys a linear equation, whose exponential is known.
   pure subroutine guess(rule, h, dp, radius, slope_0, stages)
      type(rule_type), intent(in) :: rule
      real(wp), intent(in) :: h, dp(n_points, 2), radius(n_points), slope_0
      type(stages_type), intent(inout) :: stages
      real(wp), parameter :: smallest = 1.0e-100_wp
      real(wp) :: v(2), w(2), d(2), a(n_points, 2), length, ratio, x
      integer :: i, j

      if (radius(1) <= 0.0_wp) then
         ! Straight on behind a landing.
         stages%slope = slope_0
         stages%phi(2:) = stages%phi(1) + (h*slope_0)*rule%place(2:)
         return
      end if
      ! A mean direction for each gap: stable however stiff, and near enough for Newton's method.
      v = direction_of(0.5_wp*stages%phi(1))
      ! Finite where R vanishes, and its square too.
      x = max(smallest*h*maxval(abs(dp)), tiny(1.0_wp))
      do j = 1, 2
         a(:, j) = (0.25_wp*h)*dp(:, j)/max(radius, x)
      end do
      do j = 2, n_stages + 1
         d = (rule%place(j) - rule%place(j - 1))*(a(j - 1, :) + a(j, :))
         length = sqrt(d(1)**2 + d(2)**2) + tiny(1.0_wp)
         ! tanh, nearly; 1 far out.
         x = min(length, 3.0_wp)
         ratio = x*(27.0_wp + x**2)/((27.0_wp + 9.0_wp*x**2)*length)
         w(1) = v(1) + ratio*(d(1)*v(1) + d(2)*v(2))
         w(2) = v(2) + ratio*(d(2)*v(1) - d(1)*v(2))
         ! Twice the angle between both; the arctangent nearly.
         x = (v(1)*w(2) - v(2)*w(1))/max(v(1)*w(1) + v(2)*w(2), tiny(1.0_wp))
         if (abs(x) <= 1.0_wp) then
            x = x/(1.0_wp + 0.28_wp*x**2)
         else
            x = atan(x)
         end if
         stages%phi(j) = stages%phi(j - 1) + 2.0_wp*x
         v = w/sqrt(w(1)**2 + w(2)**2)
      end do
      stages%phi(n_points) = stages%phi(n_points - 1)
      stages%slope = 0.0_wp
      do i = 1, n_stages
         x = (stages%phi(i + 1) - stages%phi(1))/h
         do j = 1, n_points
            stages%slope(j) = stages%slope(j) + rule%difference(j, i)*x
         end do
      end do
   end subroutine guess

   !> Solve by elimination, all rows at once: the equations are rows 2 to s + 1 of the first s
   !> columns, right-hand sides the columns behind them, which hold the solutions on return.
   !> Without exchanges: R and P'.t are not negative where slip goes on, and then no pivot vanishes;
   !> elsewhere the step is divided, which leaves the diagonal R.
   pure subroutine eliminate(a, n, regular)
      integer, intent(in) :: n
      real(wp), intent(inout) :: a(n_points, n)
      logical, intent(out) :: regular
      !> Part of a column below which its pivot is round-off.
      real(wp), parameter :: vanishing = 1.0e-10_wp
      real(wp) :: factor(n_points), largest(n_stages), pivot, row
      integer :: c, i, j

      ! As the columns are given: rows of pivots that were taken are divided by them.
      do j = 1, n_stages
         largest(j) = maxval(abs(a(2:n_stages + 1, j)))
      end do
      do j = 1, n_stages
         regular = abs(a(j + 1, j)) > vanishing*largest(j)
         if (.not. regular) return
         pivot = a(j + 1, j)
         factor = a(:, j)/pivot
         ! All rows have one formula; that of the pivot is divided by it, whatever its size.
         factor(j + 1) = 0.0_wp
         do c = j + 1, n
            row = a(j + 1, c)
            do i = 1, n_points
               a(i, c) = a(i, c) - factor(i)*row
            end do
            a(j + 1, c) = row/pivot
         end do
      end do
   end subroutine eliminate

end module fw_event_stages
