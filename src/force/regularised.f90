!> Regularised Coulomb friction: the friction force is a smooth function of the sliding velocity,
!>
!>   lambda_t = p mu(|v|) tanh(|v|/v_0) v/|v|,    v = du_t/dt - V [length/s],    p = max(-y_n, 0),
!>   mu(s) = mu_d + (mu - mu_d) exp(-(s/v_w)**e) + mu_v s,
!>
!> with one or two tangential directions. p is the constant normal load, or that of a unilateral
!> spring, y_n = k_n (u_n + gap + depth). Friction may weaken with the speed, from mu to mu_d over
!> v_w (Stribeck), and grow with it (viscous); V is the speed of side 2, of a belt or a disk. There
!> is no stick: below v_0 a pair creeps, so that a tangential static load is never carried. For v_0
!> towards 0 it is the law 'dlft_velocity'.
module fw_regularised
   use fw_contact_data, only: contact_type
   use fw_force_law, only: force_workspace, law_facts, pair_mixed, pair_open
   use fw_fourier, only: fourier_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, at_most, operator(.and.)
   use fw_kinds, only: wp
   use fw_normal_law, only: bind_normal_constants
   use fw_lapack, only: dgemm
   use fw_pair_law, only: bind_speeds, normal_stiffness_key, pair_law
   implicit none (type, external)
   private

   public :: regularised_law, regularised_friction, sliding_type

   !> What friction does beside mu and v_0 where a pair slides.
   type :: sliding_type
      !> Whether it weakens to mu_d, over v_w with an exponent.
      logical :: weakens = .false.
      real(wp) :: mu_dynamic = 0.0_wp, weakening_speed = 1.0_wp, exponent = 1.0_wp
      !> mu_v [time/length].
      real(wp) :: viscous = 0.0_wp
      !> V along t1 and t2 [length/time].
      real(wp) :: speed(2) = 0.0_wp
   end type sliding_type

   type, extends(pair_law) :: regularised_law
      !> v_0: tanh(1) = 76 % of the friction acts there (n_elements) [length/s].
      real(wp), allocatable :: slip_speed(:)
      !> (n_elements)
      type(sliding_type), allocatable :: sliding(:)
   contains
      procedure :: bind_keys
      procedure :: take_pairs
      procedure :: take_constants
      procedure :: take_facts
      procedure :: evaluate
      procedure :: linearize
      procedure :: slope_at_rest
      procedure :: n_parameters
      procedure :: by_parameter
      procedure :: by_constant
      procedure :: instants_wanted
      procedure :: at_instant
   end type regularised_law

   !> Constants by which the forces have derivatives with their inputs held.
   character(*), parameter :: constant_words(*) = [character(12) :: 'mu', 'slip_speed', &
                                                   'mu_dynamic']
   integer, parameter :: of_mu = 1, of_slip_speed = 2, of_mu_dynamic = 3
   !> Instants while a velocity of full swing passes from -v_0 to v_0, times pi: one in each half.
   real(wp), parameter :: instants_of_turn = 8.0_wp
   !> Sliding speed over v_0 from which tanh is 1 to 1e-7, whatever the instants.
   real(wp), parameter :: far_from_turns = 8.0_wp
   !> Square of |v|/v_0 below which tanh(s)/s is 1 - s**2/3 to the last bit.
   real(wp), parameter :: negligible = 1.0e-9_wp

contains

   !> The tangential inputs are velocities [length/s], the normal one is a force. Instants resolve
   !> tanh, which is steep where velocities are many times v_0.
   pure type(regularised_law) function regularised_friction() result(law)
      law%prediction%order = [1, 1, 0]
      law%prediction%by_time = .true.
      law%facts = law_facts(fewest_instants=256, instants_per_harmonic=32, &
                            instants_with_separation=64, acts_at_once=.true., &
                            has_multipliers=.true., is_integrated=.true.)
   end function regularised_friction

   subroutine bind_keys(self, keys, contact, slides, closes)
      class(regularised_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      associate (unused => self)
      end associate
      call contact%constants%bind(keys, key('slip_speed', &
                                            'sliding velocity at which tanh(1) = 76 % of the '// &
                                            'friction acts', above(0.0_wp), 'L/s', 'n_pairs', &
                                            absent='of the file, else required with tangential '// &
                                                   'dofs'), slides)
      call contact%constants%bind(keys, normal_stiffness_key(), closes)
      call bind_normal_constants(keys, contact)
      associate (constants => contact%constants)
         call constants%bind(keys, key('mu_dynamic', 'mu of fast sliding', at_least(0.0_wp), '', &
                                       'n_pairs', absent='of the file, else mu'), .false.)
         call constants%bind(keys, key('weakening_speed', 'over which mu falls to mu_dynamic', &
                                       above(0.0_wp), 'L/s', 'n_pairs', &
                                       absent='of the file, else required with mu_dynamic'), &
                             constants%has('mu_dynamic'))
         call constants%bind(keys, key('weakening_exponent', 'e of exp(-(v/weakening_speed)**e)', &
                                       at_least(1.0_wp) .and. at_most(2.0_wp), '', 'n_pairs', &
                                       absent='of the file, else 1'), .false.)
         call constants%bind(keys, key('mu_viscous', 'gain of mu with the sliding speed', &
                                       at_least(0.0_wp), 's/L', 'n_pairs', &
                                       absent='of the file, else 0'), .false.)
      end associate
      call bind_speeds(keys, contact)
   end subroutine bind_keys

   !> Pairs without weakening.
   pure subroutine take_pairs(self, mu, present)
      class(regularised_law), intent(inout) :: self
      real(wp), intent(in) :: mu(:)
      logical, intent(in) :: present(:, :)

      call self%take_elements(present)
      self%mu = mu
      self%two_directions = any(present(2, :))
      if (allocated(self%sliding)) deallocate (self%sliding)
      allocate (self%sliding(size(mu)))
   end subroutine take_pairs

   !> A moving side tells one direction from the other.
   subroutine take_facts(self, contact)
      class(regularised_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      integer :: n

      n = contact%n_pairs
      associate (constants => contact%constants)
         self%facts%is_odd = all(abs(constants%get('speed_1', n)) <= 0.0_wp) .and. &
                             all(abs(constants%get('speed_2', n)) <= 0.0_wp)
      end associate
      call self%note_curves(contact)
   end subroutine take_facts

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
      end associate
      call self%take_normal(contact)
      call take_sliding(self, contact)
      call self%take_speeds(contact)
      call self%take_facts(contact)
   end subroutine take_constants

   subroutine take_sliding(self, contact)
      class(regularised_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      integer :: n

      n = self%n_elements
      associate (constants => contact%constants)
         self%sliding%weakens = constants%has('mu_dynamic')
         self%sliding%mu_dynamic = constants%get('mu_dynamic', n)
         self%sliding%weakening_speed = constants%get('weakening_speed', n, default=1.0_wp)
         self%sliding%exponent = constants%get('weakening_exponent', n, default=1.0_wp)
         self%sliding%viscous = constants%get('mu_viscous', n)
         self%sliding%speed(1) = constants%get('speed_1', n)
         self%sliding%speed(2) = constants%get('speed_2', n)
      end associate
   end subroutine take_sliding

   !> mu at a sliding speed.
   elemental real(wp) function friction_at(sliding, mu, s) result(friction)
      type(sliding_type), intent(in) :: sliding
      real(wp), intent(in) :: mu, s

      friction = mu
      if (sliding%weakens) friction = sliding%mu_dynamic + (mu - sliding%mu_dynamic)* &
                                      exp(-(s/sliding%weakening_speed)**sliding%exponent)
      friction = friction + sliding%viscous*s
   end function friction_at

   !> Its slope.
   elemental real(wp) function friction_slope(sliding, mu, s) result(slope)
      type(sliding_type), intent(in) :: sliding
      real(wp), intent(in) :: mu, s
      real(wp) :: r

      slope = sliding%viscous
      if (.not. sliding%weakens) return
      associate (e => sliding%exponent)
         r = s/sliding%weakening_speed
         slope = slope - (mu - sliding%mu_dynamic)*e*r**(e - 1.0_wp)*exp(-r**e)/ &
                 sliding%weakening_speed
      end associate
   end function friction_slope

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
      call self%take_pressures(work)
      ! One pass over the instants is the period: there is no memory to march.
      call rub(self%n_elements, fourier%n_time, self%mu, self%slip_speed, self%sliding, &
               work%prediction_time, work%force_time, work%pressure)
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
      real(wp) :: fastest, narrowest
      integer :: i

      fastest = 0.0_wp
      do i = 1, self%n_elements
         if (.not. self%mu(i) > 0.0_wp .or. work%state(i) == pair_open) cycle
         narrowest = self%slip_speed(i)
         if (self%sliding(i)%weakens) narrowest = min(narrowest, self%sliding(i)%weakening_speed)
         ! On a side that is always faster friction does not turn round.
         if (slowest_of(work%prediction_time(i, 1:2, :), self%sliding(i)%speed) > &
             far_from_turns*narrowest) cycle
         fastest = max(fastest, norm2(maxval(abs(work%prediction_time(i, 1:2, :)), dim=2)) &
                       /narrowest)
      end do
      n = ceiling(min(instants_of_turn*fastest, 0.5_wp*real(huge(n), wp)))
   end function instants_wanted

   !> The smallest sliding speed over the instants.
   pure real(wp) function slowest_of(v, speed) result(slowest)
      real(wp), intent(in) :: v(:, :), speed(:)
      integer :: k

      slowest = huge(1.0_wp)
      do k = 1, size(v, 2)
         slowest = min(slowest, norm2(v(:, k) - speed))
      end do
   end function slowest_of

   !> Forces at the instants, and the smallest pressure of each pair.
   pure subroutine rub(n_pairs, n_time, mu, slip_speed, sliding, y, lambda, pressure)
      integer, intent(in) :: n_pairs, n_time
      real(wp), intent(in) :: mu(n_pairs), slip_speed(n_pairs), y(n_pairs, 3, n_time)
      type(sliding_type), intent(in) :: sliding(n_pairs)
      real(wp), intent(inout) :: lambda(n_pairs, 3, n_time), pressure(n_pairs)
      real(wp) :: p, factor, speed, v(2)
      integer :: i, k

      pressure = huge(1.0_wp)
      do k = 1, n_time
         do i = 1, n_pairs
            p = max(-y(i, 3, k), 0.0_wp)
            ! mu p tanh(s) v/|v| with s = |v|/v_0, written without the quotient v/|v|.
            v = y(i, 1:2, k) - sliding(i)%speed
            speed = sqrt(v(1)**2 + v(2)**2)
            factor = friction_at(sliding(i), mu(i), speed)*p/slip_speed(i)* &
                     tanh_over(speed/slip_speed(i))
            lambda(i, 1, k) = factor*v(1)
            lambda(i, 2, k) = factor*v(2)
            lambda(i, 3, k) = -p
            pressure(i) = min(pressure(i), p)
         end do
      end do
   end subroutine rub

   pure subroutine at_instant(self, element, y, force, slope)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(3)
      real(wp), intent(out) :: force(3), slope(3, 3)
      real(wp) :: pressing, pressure(1), values(1, 3, 1), lambda(1, 3, 1)

      values(1, :, 1) = y
      pressing = 1.0_wp
      if (allocated(self%normal)) call self%press_at(element, y(3), values(1, 3, 1), pressing)
      lambda = 0.0_wp
      associate (e => element)
         call rub(1, 1, self%mu(e:e), self%slip_speed(e:e), self%sliding(e:e), values, lambda, &
                  pressure)
         call differentiate(self%mu(e), self%slip_speed(e), self%sliding(e), values(1, :, 1), slope)
      end associate
      force = lambda(1, :, 1)
      slope(3, :) = pressing*slope(3, :)
   end subroutine at_instant

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
            call differentiate(self%mu(i), self%slip_speed(i), self%sliding(i), &
                               work%prediction_time(i, :, k), slope(:, :, k))
            ! The normal input is a pressure, or makes one along a curve.
            if (allocated(work%pressing)) slope(3, :, k) = work%pressing(i, k)*slope(3, :, k)
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
   pure subroutine differentiate(mu, slip_speed, sliding, y, slope)
      real(wp), intent(in) :: mu, slip_speed, y(3)
      type(sliding_type), intent(in) :: sliding
      real(wp), intent(out) :: slope(3, 3)
      real(wp) :: e(2), v(2), speed, s, turning, along, friction
      integer :: a, b

      slope = 0.0_wp
      if (y(3) >= 0.0_wp) return
      v = y(1:2) - sliding%speed
      speed = sqrt(v(1)**2 + v(2)**2)
      s = speed/slip_speed
      e = 0.0_wp
      if (speed > 0.0_wp) e = v/speed
      friction = friction_at(sliding, mu, speed)
      ! y(3) = -p. The matrix is turning (1 - e e^T) + along e e^T (docs/theory.md, The balance).
      turning = -friction*y(3)/slip_speed*tanh_over(s)
      along = -friction*y(3)/slip_speed*(1.0_wp - tanh(s)**2) &
              - y(3)*friction_slope(sliding, mu, speed)*tanh(s)
      do b = 1, 2
         do a = 1, 2
            slope(a, b) = (along - turning)*e(a)*e(b)
         end do
         slope(b, b) = slope(b, b) + turning
         slope(3, b) = -friction*tanh(s)*e(b)
      end do
      slope(3, 3) = 1.0_wp
   end subroutine differentiate

   !> With a constant normal load a pair about rest is a damper; how much it bears otherwise only
   !> the solution tells, and a guess without friction serves. On a moving side it is one of the
   !> mean force over the mean speed.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: element, component

      real(wp) :: speed

      slope = merge(1.0_wp, 0.0_wp, self%present(component, element))
      if (component == 3) return
      speed = norm2(self%sliding(element)%speed)
      slope = slope*friction_at(self%sliding(element), self%mu(element), speed)* &
              self%prediction%load(element)/self%slip_speed(element)* &
              tanh_over(speed/self%slip_speed(element))
   end function slope_at_rest

   !> The friction coefficient, slip_speed and mu_dynamic.
   pure integer function n_parameters(self)
      class(regularised_law), intent(in) :: self

      n_parameters = merge(size(constant_words), 0, self%n_elements > 0)
   end function n_parameters

   subroutine by_parameter(self, number, fourier, work, force)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: values(self%n_elements, 3, fourier%n_time)
      integer :: i, k

      values = 0.0_wp
      do k = 1, fourier%n_time
         do i = 1, self%n_elements
            values(i, 1:2, k) = slope_by(self, number, i, work%prediction_time(i, 1:2, k), &
                                         -work%force_time(i, 3, k))
         end do
      end do
      call fourier%to_coefficients(3*self%n_elements, values, force)
   end subroutine by_parameter

   !> Friction in proportion to mu is known by its inputs.
   pure subroutine by_constant(self, element, name, fourier, work, force, is_known)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known
      real(wp) :: values(2)
      integer :: c, k, number

      number = findloc(constant_words, name, dim=1)
      associate (sliding => self%sliding(element))
         is_known = number > of_mu .or. (number == of_mu .and. (sliding%weakens .or. &
                                                                sliding%viscous > 0.0_wp))
      end associate
      force = 0.0_wp
      if (.not. is_known) return
      do k = 1, fourier%n_time
         values = slope_by(self, number, element, work%prediction_time(element, 1:2, k), &
                           -work%force_time(element, 3, k))
         do c = 1, 2
            force(:, c) = force(:, c) + values(c)*fourier%analysis(:, k)
         end do
      end do
   end subroutine by_constant

   !> Derivative of the friction at an instant, of inputs y under a pressure p:
   !>
   !>   by mu    exp(-(s/v_w)**e) p tanh(s/v_0) v/s    by mu_d   the rest to 1 of exp in its place
   !>   by v_0   -mu(s) p/v_0**2 (1 - tanh(s/v_0)**2) v
   pure function slope_by(self, number, element, y, p) result(slope)
      class(regularised_law), intent(in) :: self
      integer, intent(in) :: number, element
      real(wp), intent(in) :: y(2), p
      real(wp) :: slope(2)
      real(wp) :: v(2), s, share

      associate (v_0 => self%slip_speed(element), sliding => self%sliding(element))
         v = y - sliding%speed
         s = norm2(v)
         share = 1.0_wp
         if (sliding%weakens) share = exp(-(s/sliding%weakening_speed)**sliding%exponent)
         select case (number)
         case (of_slip_speed)
            slope = -friction_at(sliding, self%mu(element), s)*p/v_0**2*(1.0_wp - &
                                                                         tanh(s/v_0)**2)*v
         case (of_mu_dynamic)
            slope = (1.0_wp - share)*p/v_0*tanh_over(s/v_0)*v
         case default ! mu
            slope = share*p/v_0*tanh_over(s/v_0)*v
         end select
      end associate
   end function slope_by

end module fw_regularised
