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
      real(wp) :: start(2, size(by_tangential, 1), 2), unused(0, 2)

      if (.not. self%swings) then
         ! Held or open throughout: the play operator, whose path was taken.
         call self%event_pair_type%derivative(n_retained, harmonic, column, by_tangential, &
                                              by_normal, normal)
         return
      end if
      by_tangential = 0.0_wp
      by_normal = 0.0_wp
      normal = 0.0_wp
      ! A turn from dX = 0 first: its end is what (1 - M)^-1 turns into the dX_0 that repeats.
      start = 0.0_wp
      call carry(self, n_retained, harmonic, column, .false., start, by_tangential, by_normal, &
                 unused)
      call repeat(self%turn%monodromy, start)
      call self%contact%add_gram(1.0_wp, n_retained, harmonic, column, normal)
      call self%stick%add_gram(1.0_wp, n_retained, harmonic, column, by_tangential)
      call self%slip%add_gram(-self%curves%mu, n_retained, harmonic, column, by_normal)
      call carry(self, n_retained, harmonic, column, .true., start, by_tangential, by_normal, &
                 unused)
   end procedure derivative_of_oscillator

   !> With W = k int N |x'|, dW/k = int dN |x'| + int N s dx', s the side of slip: stops add
   !> nothing, for x' = 0 there.
   module procedure path_of_oscillator
      real(wp) :: start(2, size(by_normal), 2), none(0, 0), slope(size(by_normal), 2)
      integer :: j

      if (.not. self%swings) then
         call self%event_pair_type%path_derivative(n_retained, harmonic, column, by_tangential, &
                                                   by_normal)
         return
      end if
      slope = 0.0_wp
      start = 0.0_wp
      call carry(self, n_retained, harmonic, column, .false., start, none, none, none)
      call repeat(self%turn%monodromy, start)
      call carry(self, n_retained, harmonic, column, .false., start, none, none, slope)
      call add_driven_slip(self, n_retained, harmonic, column, slope)
      do j = 1, self%turn%n_segments
         if (side_of(self%turn%phase(j)) == 0) cycle
         call add_free_slip(self, j, n_retained, harmonic, column, slope(:, 2))
      end do
      by_tangential = self%waves%oscillator%k*slope(:, 1)
      by_normal = self%waves%oscillator%k*slope(:, 2)
   end procedure path_of_oscillator

   !> The driven velocity under dN, and the variation of the driven velocity under N.
   pure subroutine add_driven_slip(self, n_retained, harmonic, column, slope)
      type(oscillator_pair_type), intent(inout) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> By P and by y_n (n_coefficients, 2).
      real(wp), intent(inout) :: slope(:, :)
      real(wp) :: raw(size(slope, 1), 3)
      complex(wp) :: answer
      integer :: c, h, k, n

      self%one%cosine = self%contact%cosine - self%stick%cosine
      self%one%sine = self%contact%sine - self%stick%sine
      raw = 0.0_wp
      associate (w => self%waves, normal => self%curves%normal, nr => n_retained)
         ! Of the driven velocities in both directions of slip the half-sum answers to P, the
         ! half-difference to -Q; -pi because dN = -dy_n.
         self%answer = 0.5_wp*(w%rate(1)%p + w%rate(-1)%p)
         call self%slip%project(-pi, self%answer, nr, harmonic, column, raw(:, 3))
         self%answer = 0.5_wp*(w%rate(1)%p - w%rate(-1)%p)
         call self%one%project(-pi, self%answer, nr, harmonic, column, raw(:, 3))
         call self%slip%project(pi, normal, nr, harmonic, column, raw(:, 1))
         call self%one%project(pi*self%curves%mu, normal, nr, harmonic, column, raw(:, 2))
      end associate
      ! Projections halve the constant.
      if (harmonic(1) == 0) raw(column(1), :) = 2.0_wp*raw(column(1), :)
      slope(:, 2) = slope(:, 2) + raw(:, 3)
      do h = 1, n_retained
         n = harmonic(h)
         if (n == 0) cycle
         k = column(h)
         do c = 1, 2
            ! The driven x' under cos(n tau) is the real part of i n e^(i n tau)/E_n, under sin(n
            ! tau) the imaginary one.
            answer = cmplx(0.0_wp, n, wp)*cmplx(raw(k, c), raw(k + 1, c), wp) &
                     /self%waves%oscillator%impedance(n)
            slope(k, c) = slope(k, c) + real(answer, wp)
            slope(k + 1, c) = slope(k + 1, c) + aimag(answer)
         end do
      end do
   end subroutine add_driven_slip

   !> The free velocity of a segment under dN = -dy_n.
   pure subroutine add_free_slip(self, j, n_retained, harmonic, column, slope)
      type(oscillator_pair_type), intent(in) :: self
      integer, intent(in) :: j, n_retained, harmonic(n_retained), column(n_retained)
      !> By y_n (n_coefficients).
      real(wp), intent(inout) :: slope(:)
      real(wp) :: phi(2, 2)
      complex(wp) :: row(2), integral
      integer :: h, k, side

      side = side_of(self%turn%phase(j))
      associate (a => self%turn%angle(j), b => self%turn%angle(j + 1), o => self%waves%oscillator)
         call o%propagate(b - a, phi)
         do h = 1, n_retained
            k = column(h)
            call integrate_wave(o, harmonic(h), a, b, phi, row)
            ! x' of the free motion is linear in where it starts.
            integral = row(1)*self%turn%free(1, j) + row(2)*self%turn%free(2, j)
            slope(k) = slope(k) - side*real(integral, wp)
            if (harmonic(h) > 0) slope(k + 1) = slope(k + 1) - side*aimag(integral)
         end do
      end associate
   end subroutine add_free_slip

   !> dX_0 of the period from dX at the end of a turn that starts with none.
   pure subroutine repeat(monodromy, d)
      !> M of the turn; 1 - M is regular where the periodic motion stands alone.
      real(wp), intent(in) :: monodromy(2, 2)
      !> Variations of x and x' (2, n_coefficients, by P and by y_n).
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
   !> motion does to the derivatives of the force, and where by_slip has rows, what the free motion
   !> does to int N s dx'.
   pure subroutine carry(self, n_retained, harmonic, column, adds, d, by_tangential, by_normal, &
                         by_slip)
      type(oscillator_pair_type), intent(in) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      logical, intent(in) :: adds
      !> Variations of x and x' (2, n_coefficients, by P and by y_n).
      real(wp), intent(inout) :: d(:, :, :)
      !> Transposed, (input, output); (n_coefficients, 2) by slip.
      real(wp), intent(inout) :: by_tangential(:, :), by_normal(:, :), by_slip(:, :)
      real(wp) :: phi(2, 2), output(size(d, 2)), driven(2, size(d, 2)), x(2), friction, weight(2)
      integer :: j, k, i, side

      associate (turn => self%turn, o => self%waves%oscillator)
         do j = 1, turn%n_segments
            ! The segment begins at a stop that moves by d tau = -dx'/a-.
            if (abs(turn%before(j)) > 0.0_wp) then
               if (adds) then
                  call waves_out(n_retained, harmonic, column, turn%angle(j), output)
                  output = output*(jump(self, j)/turn%before(j))
                  call add_outer(-1.0_wp, 2, d, output, by_tangential, by_normal)
               end if
               ! The velocity behind the stop changes as the stop moves.
               d(2, :, :) = turn%behind(j)/turn%before(j)*d(2, :, :)
            end if
            ! x stays, and with it its variation; the force takes P - k x.
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
            ! From the motion to its free part, which Phi carries ...
            d(:, :, 1) = d(:, :, 1) - driven
            d(:, :, 2) = d(:, :, 2) - friction*driven
            if (size(by_slip, 1) > 0 .and. side /= 0) then
               call integrate_free(o, self%curves, turn%angle(j), turn%angle(j + 1), weight)
               by_slip = by_slip + side*(weight(1)*d(1, :, :) + weight(2)*d(2, :, :))
            end if
            call driven_waves(o, n_retained, harmonic, column, turn%angle(j + 1), driven)
            do i = 1, 2
               do k = 1, size(d, 2)
                  x = phi(:, 1)*d(1, k, i) + phi(:, 2)*d(2, k, i)
                  ! ... and back; the driven part answers to P and, in slip, to -side mu N = side mu
                  ! y_n.
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

   !> With X' = A X, the second row of (A + i n)^-1 (e^(i n b) Phi(b - a) - e^(i n a)).
   module procedure integrate_wave
      complex(wp) :: difference(2, 2), inverse(2), wave

      difference = cmplx(cos(n*b), sin(n*b), wp)*phi
      wave = cmplx(cos(n*a), sin(n*a), wp)
      difference(1, 1) = difference(1, 1) - wave
      difference(2, 2) = difference(2, 2) - wave
      ! Second row of (A + i n)^-1, times m: (k, i n m) over k - n**2 m - i n c.
      inverse = [cmplx(oscillator%k, kind=wp), cmplx(0.0_wp, n*oscillator%m, wp)] &
                /conjg(oscillator%impedance(n))
      row = inverse(1)*difference(1, :) + inverse(2)*difference(2, :)
   end procedure integrate_wave

   !> The integral of N times the velocity of a free motion X, over X at its start.
   module procedure integrate_free
      real(wp) :: phi(2, 2)
      complex(wp) :: row(2), amplitude
      integer :: n

      weight = 0.0_wp
      call oscillator%propagate(b - a, phi)
      do n = 0, curves%degree
         amplitude = cmplx(curves%normal(n, 1), -curves%normal(n, 2), wp)
         if (.not. abs(amplitude) > 0.0_wp) cycle
         call integrate_wave(oscillator, n, a, b, phi, row)
         weight = weight + real(amplitude*row, wp)
      end do
   end procedure integrate_free

end submodule fw_oscillator_derivative
