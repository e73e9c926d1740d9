!> The derivative of the force of a pair with mass by the coefficients of P and of y_n = -N, exact
!> along its path. With the variation dX = (dx, dx') of the motion, dX_p that of the driven one,
!>
!>   slip, open     dX(b) = Phi (dX(a) - dX_p(a)) + dX_p(b),
!>   at a stop      d tau = -dx'/a-,   dx' = (a+/a-) dx' when it turns round, 0 when it sticks,
!>   of the period  dX_0 = (1 - M)^-1 (end of the turn from dX_0 = 0),
!>
!> and dF = G(stick) dP + (G(forward) - G(backward)) dQ - sum over sticks of k g_i dx_i
!>        + sum over stops of (lambda- - lambda+) waves d tau: the force jumps there.
submodule(fw_oscillator_pair) fw_oscillator_derivative
   implicit none (type, external)

contains

   module procedure derivative_of_oscillator
      real(wp) :: start(2, size(by_tangential, 1), 2)

      if (.not. self%swings) then
         call self%event_pair_type%derivative(n_retained, harmonic, column, by_tangential, &
                                              by_normal, normal)
         return
      end if
      by_tangential = 0.0_wp
      by_normal = 0.0_wp
      normal = 0.0_wp
      start = 0.0_wp
      call carry(self, n_retained, harmonic, column, .false., start, by_tangential, by_normal)
      call repeat(self%turn%monodromy, start)
      call self%contact%add_gram(1.0_wp, n_retained, harmonic, column, normal)
      call self%stick%add_gram(1.0_wp, n_retained, harmonic, column, by_tangential)
      call self%slip%add_gram(-self%curves%mu, n_retained, harmonic, column, by_normal)
      call carry(self, n_retained, harmonic, column, .true., start, by_tangential, by_normal)
   end procedure derivative_of_oscillator

   !> dX_0 of the period from dX at the end of a turn that starts with none.
   pure subroutine repeat(monodromy, d)
      real(wp), intent(in) :: monodromy(2, 2)
      real(wp), intent(inout) :: d(:, :, :)
      real(wp) :: x(2)
      logical :: singular
      integer :: i, k

      do i = 1, size(d, 3)
         do k = 1, size(d, 2)
            call newton_step(monodromy, d(:, k, i), x, singular)
            d(:, k, i) = x
         end do
      end do
   end subroutine repeat

   !> Carry dX by P and y_n (2, coefficient, which) through the turn; with `adds`, add what the
   !> motion does to the derivatives of the force.
   pure subroutine carry(self, n_retained, harmonic, column, adds, d, by_tangential, by_normal)
      type(oscillator_pair_type), intent(in) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      logical, intent(in) :: adds
      real(wp), intent(inout) :: d(:, :, :)
      real(wp), intent(inout) :: by_tangential(:, :), by_normal(:, :)
      real(wp) :: phi(2, 2), output(size(d, 2)), driven(2, size(d, 2)), x(2), friction
      integer :: j, k, i, side

      associate (turn => self%turn, o => self%waves%oscillator)
         do j = 1, turn%n_segments
            if (abs(turn%before(j)) > 0.0_wp) then
               if (adds) then
                  call waves_out(n_retained, harmonic, column, turn%angle(j), output)
                  output = output*(jump(self, j)/turn%before(j))
                  call add_outer(-1.0_wp, 2, d, output, by_tangential, by_normal)
               end if
               d(2, :, :) = turn%behind(j)/turn%before(j)*d(2, :, :)
            end if
            if (turn%phase(j) == phase_stick) then
               d(2, :, :) = 0.0_wp
               if (.not. adds) cycle
               call integrals_out(n_retained, harmonic, column, turn%angle(j), turn%angle(j + 1), &
                                  output)
               call add_outer(-o%k, 1, d, output, by_tangential, by_normal)
               cycle
            end if
            side = side_of(turn%phase(j))
            friction = side*self%curves%mu
            call o%propagate(turn%angle(j + 1) - turn%angle(j), phi)
            call driven_waves(o, n_retained, harmonic, column, turn%angle(j), driven)
            d(:, :, 1) = d(:, :, 1) - driven
            d(:, :, 2) = d(:, :, 2) - friction*driven
            call driven_waves(o, n_retained, harmonic, column, turn%angle(j + 1), driven)
            do i = 1, 2
               do k = 1, size(d, 2)
                  x = phi(:, 1)*d(1, k, i) + phi(:, 2)*d(2, k, i)
                  d(:, k, i) = x + merge(1.0_wp, friction, i == 1)*driven(:, k)
               end do
            end do
         end do
      end associate
   end subroutine carry

   !> The fall of the force at the stop in which a segment begins.
   pure real(wp) function jump(self, j)
      type(oscillator_pair_type), intent(in) :: self
      integer, intent(in) :: j

      ! m x'' + c x' + k x + lambda = P on both sides, with x' = 0: the acceleration takes the jump.
      jump = self%waves%oscillator%m*(self%turn%behind(j) - self%turn%before(j))
   end function jump

   !> Add factor times the products of a row of d and the output to the transposed derivatives.
   pure subroutine add_outer(factor, row, d, output, by_tangential, by_normal)
      real(wp), intent(in) :: factor
      integer, intent(in) :: row
      real(wp), intent(in) :: d(:, :, :), output(:)
      real(wp), intent(inout) :: by_tangential(:, :), by_normal(:, :)
      integer :: k

      do k = 1, size(output)
         by_tangential(:, k) = by_tangential(:, k) + factor*output(k)*d(row, :, 1)
         by_normal(:, k) = by_normal(:, k) + factor*output(k)*d(row, :, 2)
      end do
   end subroutine add_outer

   !> X under each wave of P alone: e^(i n tau)/E_n and its rate (2, n_coefficients).
   pure subroutine driven_waves(oscillator, n_retained, harmonic, column, angle, x)
      type(oscillator_type), intent(in) :: oscillator
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: x(:, :)
      complex(wp) :: answer
      integer :: h, k, n

      do h = 1, n_retained
         n = harmonic(h)
         k = column(h)
         answer = cmplx(cos(n*angle), sin(n*angle), wp)/oscillator%impedance(n)
         x(1, k) = real(answer, wp)
         x(2, k) = -n*aimag(answer)
         if (n == 0) cycle
         x(1, k + 1) = aimag(answer)
         x(2, k + 1) = n*real(answer, wp)
      end do
   end subroutine driven_waves

   !> Weights with which an impulse at an angle enters the coefficients.
   pure subroutine waves_out(n_retained, harmonic, column, angle, output)
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: output(:)
      integer :: h, k, n

      do h = 1, n_retained
         n = harmonic(h)
         k = column(h)
         output(k) = merge(0.5_wp, 1.0_wp, n == 0)*cos(n*angle)/pi
         if (n > 0) output(k + 1) = sin(n*angle)/pi
      end do
   end subroutine waves_out

   !> Coefficients of 1 between two angles.
   pure subroutine integrals_out(n_retained, harmonic, column, a, b, output)
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      real(wp), intent(in) :: a, b
      real(wp), intent(out) :: output(:)
      integer :: h, k, n

      do h = 1, n_retained
         n = harmonic(h)
         k = column(h)
         if (n == 0) then
            output(k) = 0.5_wp*(b - a)/pi
         else
            output(k) = (sin(n*b) - sin(n*a))/(n*pi)
            output(k + 1) = (cos(n*a) - cos(n*b))/(n*pi)
         end if
      end do
   end subroutine integrals_out

end submodule fw_oscillator_derivative
