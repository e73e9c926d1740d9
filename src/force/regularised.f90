!> Regularised Coulomb friction: the friction force is a smooth function of the sliding velocity,
!>
!>   lambda_t = mu p tanh(|v|/v_0) v/|v|,    v = du_t/dt [length/s],    p = max(-y_n, 0),
!>
!> with one or two tangential directions. p is the constant normal load, or that of a unilateral
!> spring, y_n = k_n (u_n + gap + depth). There is no stick: below v_0 a pair creeps, so that a
!> tangential static load is never carried. For v_0 towards 0 it is the law 'dlft_velocity'.
module fw_regularised
   use fw_contact_data, only: contact_type
   use fw_force_law, only: force_workspace, law_facts, pair_mixed, pair_open
   use fw_fourier, only: fourier_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_pair_law, only: normal_stiffness_key, pair_law
   implicit none (type, external)
   private

   public :: regularised_law, regularised_friction

   type, extends(pair_law) :: regularised_law
      !> v_0: tanh(1) = 76 % of the friction acts there (n_elements) [length/s].
      real(wp), allocatable :: slip_speed(:)
   contains
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: evaluate
      procedure :: linearize
      procedure :: slope_at_rest
      procedure :: n_parameters
      procedure :: by_parameter
      procedure :: instants_wanted
   end type regularised_law

   !> Instants while a velocity of full swing passes from -v_0 to v_0, times pi: one in each half.
   real(wp), parameter :: instants_of_turn = 8.0_wp
   !> Square of |v|/v_0 below which tanh(s)/s is 1 - s**2/3 to the last bit.
   real(wp), parameter :: negligible = 1.0e-9_wp

contains

   !> The tangential inputs are velocities [length/s], the normal one is a force. Instants resolve
   !> tanh, which is steep where velocities are many times v_0.
   pure type(regularised_law) function regularised_friction() result(law)
      law%prediction%order = [1, 1, 0]
      law%prediction%by_time = .true.
      law%facts = law_facts(fewest_instants=256, instants_per_harmonic=32, &
                            instants_with_separation=64)
   end function regularised_friction

   subroutine bind_keys(self, keys, contact, slides, closes)
      class(regularised_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      associate (unused => self)
      end associate
      call contact%constants%bind(keys, key('slip_speed', 'sliding velocity du/dt at which '// &
         'tanh(1) = 76 % of the friction acts', above(0.0_wp), 'L/s', 'n_pairs', &
         absent='required with tangential dofs'), slides)
      call contact%constants%bind(keys, normal_stiffness_key(), closes)
   end subroutine bind_keys

   subroutine take_constants(self, contact)
      class(regularised_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      integer :: c

      ! Pairs that do not slide need none; any will do.
      self%slip_speed = contact%constants%get('slip_speed', self%n_elements, default=1.0_wp)
      associate (p => self%prediction)
         do c = 1, 2
            p%stiffness(:, c) = merge(1.0_wp, 0.0_wp, self%present(c, :))
         end do
         where (self%present(3, :)) p%stiffness(:, 3) = contact%normal_stiffness
      end associate
   end subroutine take_constants

   subroutine evaluate(self, fourier, work)
      class(regularised_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      logical :: wanted(3)
      integer :: i, k

      if (self%n_elements == 0) return
      do k = 1, size(wanted)
         wanted(k) = any(self%present(k, :))
      end do
      call fourier%to_time(3*self%n_elements, work%prediction, work%prediction_time, &
                           work%fft, wanted)
      do k = 1, fourier%n_time
         work%prediction_time(:, 3, k) = work%prediction_time(:, 3, k) + work%offset
      end do
      ! One pass over the instants is the period: there is no memory to march.
      call rub(self%n_elements, fourier%n_time, self%mu, self%slip_speed, work%prediction_time, &
               work%force_time, work%pressure)
      call work%measure_scale()
      work%turns = 1
      call fourier%to_coefficients(3*self%n_elements, work%force_time, work%force, work%fft, &
                                   wanted)
      do i = 1, self%n_elements
         ! Never stuck: every pair that bears at some instant has a block in the derivative.
         work%state(i) = pair_open
         do k = 1, fourier%n_time
            if (work%force_time(i, 3, k) < 0.0_wp) work%state(i) = pair_mixed
         end do
      end do
   end subroutine evaluate

   !> A velocity v cos tau is within v_0 for 2 v_0/v of the angle, where friction turns round.
   pure integer function instants_wanted(self, work) result(n)
      class(regularised_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp) :: fastest
      integer :: i

      fastest = 0.0_wp
      do i = 1, self%n_elements
         if (.not. self%mu(i) > 0.0_wp .or. work%state(i) == pair_open) cycle
         fastest = max(fastest, norm2(maxval(abs(work%prediction_time(i, 1:2, :)), dim=2)) &
                       /self%slip_speed(i))
      end do
      n = ceiling(min(instants_of_turn*fastest, 0.5_wp*real(huge(n), wp)))
   end function instants_wanted

   !> Forces at the instants, and the smallest pressure of each pair.
   pure subroutine rub(n_pairs, n_time, mu, slip_speed, y, lambda, pressure)
      integer, intent(in) :: n_pairs, n_time
      real(wp), intent(in) :: mu(n_pairs), slip_speed(n_pairs), y(n_pairs, 3, n_time)
      real(wp), intent(inout) :: lambda(n_pairs, 3, n_time), pressure(n_pairs)
      real(wp) :: p, factor
      integer :: i, k

      pressure = huge(1.0_wp)
      do k = 1, n_time
         do i = 1, n_pairs
            p = max(-y(i, 3, k), 0.0_wp)
            ! mu p tanh(s) v/|v| with s = |v|/v_0, written without the quotient v/|v|.
            factor = mu(i)*p/slip_speed(i)* &
                     tanh_over(sqrt(y(i, 1, k)**2 + y(i, 2, k)**2)/slip_speed(i))
            lambda(i, 1, k) = factor*y(i, 1, k)
            lambda(i, 2, k) = factor*y(i, 2, k)
            lambda(i, 3, k) = -p
            pressure(i) = min(pressure(i), p)
         end do
      end do
   end subroutine rub

   !> tanh(s)/s.
   elemental real(wp) function tanh_over(s)
      real(wp), intent(in) :: s

      tanh_over = 1.0_wp - s**2/3.0_wp
      if (s**2 > negligible) tanh_over = tanh(s)/s
   end function tanh_over

   subroutine linearize(self, fourier, work)
      class(regularised_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      real(wp), allocatable :: slope(:, :, :), rows(:, :)
      integer :: i, c_in, c_out, k, nc

      work%linear_state = work%state
      nc = fourier%n_coefficients
      if (.not. allocated(work%jacobian)) allocate (work%jacobian(3*nc, 3*nc, self%n_elements))
      allocate (slope(3, 3, fourier%n_time), rows(nc, fourier%n_time))
      do i = 1, self%n_elements
         if (work%state(i) /= pair_mixed) cycle
         do k = 1, fourier%n_time
            call differentiate(self%mu(i), self%slip_speed(i), work%prediction_time(i, :, k), &
                               slope(:, :, k))
         end do
         do c_out = 1, 3
            do c_in = 1, 3
               do k = 1, fourier%n_time
                  ! G = analysis diag(slope) synthesis, transposed: the first index is the input.
                  rows(:, k) = slope(c_in, c_out, k)*fourier%synthesis(:, k)
               end do
               call dgemm('N', 'T', nc, nc, fourier%n_time, 1.0_wp, rows, nc, fourier%analysis, &
                          nc, 0.0_wp, work%jacobian((c_in - 1)*nc + 1, (c_out - 1)*nc + 1, i), 3*nc)
            end do
         end do
      end do
   end subroutine linearize

   !> Derivative of the force at an instant (input, output): along the velocity the slope of tanh,
   !> across it the force turns with the velocity.
   pure subroutine differentiate(mu, slip_speed, y, slope)
      real(wp), intent(in) :: mu, slip_speed, y(3)
      real(wp), intent(out) :: slope(3, 3)
      real(wp) :: e(2), speed, s, turning, along
      integer :: a, b

      slope = 0.0_wp
      if (y(3) >= 0.0_wp) return
      speed = sqrt(y(1)**2 + y(2)**2)
      s = speed/slip_speed
      e = 0.0_wp
      if (speed > 0.0_wp) e = y(1:2)/speed
      ! y(3) = -p. The matrix is turning (1 - e e^T) + along e e^T (docs/theory.md, The balance).
      turning = -mu*y(3)/slip_speed*tanh_over(s)
      along = -mu*y(3)/slip_speed*(1.0_wp - tanh(s)**2)
      do b = 1, 2
         do a = 1, 2
            slope(a, b) = (along - turning)*e(a)*e(b)
         end do
         slope(b, b) = slope(b, b) + turning
         slope(3, b) = -mu*tanh(s)*e(b)
      end do
      slope(3, 3) = 1.0_wp
   end subroutine differentiate

   !> With a constant normal load a pair about rest is a damper; how much it bears otherwise only
   !> the solution tells, and a guess without friction serves.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: element, component

      slope = merge(1.0_wp, 0.0_wp, self%present(component, element))
      if (component < 3) slope = slope*self%mu(element)*self%prediction%load(element)/ &
                                 self%slip_speed(element)
   end function slope_at_rest

   !> The friction coefficient, and slip_speed.
   pure integer function n_parameters(self)
      class(regularised_law), intent(in) :: self

      n_parameters = merge(2, 0, self%n_elements > 0)
   end function n_parameters

   subroutine by_parameter(self, number, fourier, work, force)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: values(self%n_elements, 3, fourier%n_time)
      real(wp) :: p, s, factor
      integer :: i, k

      values = 0.0_wp
      do k = 1, fourier%n_time
         do i = 1, self%n_elements
            associate (v => work%prediction_time(i, 1:2, k), v_0 => self%slip_speed(i))
               ! d lambda_t/d mu = lambda_t/mu, d lambda_t/d v_0 = -mu p/v_0**2 (1 - tanh(s)**2) v.
               p = -work%force_time(i, 3, k)
               s = norm2(v)/v_0
               factor = p/v_0*tanh_over(s)
               if (number == 2) factor = -self%mu(i)*p/v_0**2*(1.0_wp - tanh(s)**2)
               values(i, 1:2, k) = factor*v
            end associate
         end do
      end do
      call fourier%to_coefficients(3*self%n_elements, values, force)
   end subroutine by_parameter

end module fw_regularised
