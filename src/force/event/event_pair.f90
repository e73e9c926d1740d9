!> Contact force of one pair with at most one tangential direction, integrated exactly along its
!> path: with the Gram matrices G(chi) of the waves under the sets of stick, slip and contact,
!>
!>   F_t = G(stick) P + (G(forward) - G(backward)) Q - sum_i z_i g_i,   F_n = -G(contact) N,
!>   dF_t/dP = G(stick) - sum_i g_i e_i^T,
!>   dF_t/dQ = G(forward) - G(backward) - sum_i s_i g_i e_i^T,
!>
!> g_i being the waves integrated over stick i, e_i the waves at the angle where its z was set and
!> s_i its weight (-1 at the end of forward slip, +1 of backward slip, -P'/Q' at a landing). The
!> angles of all other events drop out of the derivative, because the force is continuous there.
module fw_event_pair
   use fw_event_curves, only: curves_type
   use fw_event_moments, only: moments_type
   use fw_event_path, only: path_type, phase_backward, phase_forward, phase_open, phase_stick
   use fw_event_polynomial, only: differentiate, fill_waves, value_of
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: event_pair_type

   type :: event_pair_type
      type(curves_type) :: curves
      type(path_type) :: path
      !> Whether the tangential prediction is that of the velocity-level law.
      logical :: remembers = .true.
      !> Whether there are a tangential direction and a normal one.
      logical :: rubs = .true.
      logical :: presses = .true.
      !> Sets of stick, forward less backward slip, contact, and stick weighted by z.
      !> As weights: 1 on stick, 1 and -1 on forward and backward slip, 1 on contact, z on stick.
      type(moments_type) :: stick, slip, contact, held
      !> Workspace: waves of an angle (0:2 degree), waves at an origin and integrals of one stick.
      real(wp), allocatable, private :: cosines(:), sines(:), origin(:), integral(:)
      !> Waves by which the z of a pair with a given residual traction follows Q.
      real(wp), allocatable, private :: across(:)
      !> P' and N' (0:degree, cosine and sine); see set_rates.
      real(wp), allocatable, private :: rate(:, :), normal_rate(:, :)
      !> Of a set that is used for a moment.
      type(moments_type) :: one
   contains
      procedure :: reserve
      procedure :: follow
      procedure :: can_rest
      procedure :: follow_to_rest
      procedure :: fill_moments
      procedure :: force
      procedure :: force_to
      procedure :: derivative
      procedure :: values_at
      procedure :: rows_at
      procedure :: friction_path
      procedure :: path_derivative
      procedure :: shares
   end type event_pair_type

contains

   !> Room for polynomials of a degree, sampled on a grid, and n_coefficients waves.
   pure subroutine reserve(self, degree, n_grid, n_coefficients)
      class(event_pair_type), intent(inout) :: self
      integer, intent(in) :: degree, n_grid, n_coefficients

      call self%curves%reserve(degree, n_grid)
      call self%path%reserve(degree)
      call self%stick%reserve(degree)
      call self%slip%reserve(degree)
      call self%contact%reserve(degree)
      call self%held%reserve(degree)
      call self%one%reserve(degree)
      allocate (self%cosines(0:2*degree), self%sines(0:2*degree))
      allocate (self%origin(n_coefficients), self%integral(n_coefficients))
      allocate (self%across(n_coefficients))
      allocate (self%rate(0:degree, 2), self%normal_rate(0:degree, 2))
   end subroutine reserve

   !> Find the path of the pair from x_start, and the moments of its sets. The curves have been
   !> filled before.
   pure subroutine follow(self, x_start)
      class(event_pair_type), intent(inout) :: self
      !> Position at the start of the period [force]; without effect at velocity level.
      real(wp), intent(in) :: x_start

      if (.not. self%rubs) then
         call self%path%trace_contact(self%curves)
      else if (self%remembers) then
         call self%path%trace(self%curves, x_start)
      else
         call self%path%trace_rates(self%curves)
      end if
      call self%fill_moments()
   end subroutine follow

   !> Whether a position may exist that bears all instants without slip, as far as the grid tells;
   !> of a pair without memory, which follows no position.
   pure logical function can_rest(self)
      class(event_pair_type), intent(in) :: self

      can_rest = .false.
      if (self%remembers .or. .not. self%rubs) return
      associate (c => self%curves)
         if (minval(c%samples(:, 4)) <= 0.0_wp) return
         can_rest = maxval(c%samples(:, 1) - c%mu*c%samples(:, 4)) <= &
                    minval(c%samples(:, 1) + c%mu*c%samples(:, 4))
      end associate
   end function can_rest

   !> As `follow` with memory; `rests` tells whether the path comes to rest. Where it does not,
   !> nothing of it counts.
   pure subroutine follow_to_rest(self, x_start, rests)
      class(event_pair_type), intent(inout) :: self
      real(wp), intent(in) :: x_start
      logical, intent(out) :: rests

      call self%path%trace(self%curves, x_start)
      associate (path => self%path)
         rests = path%closed .and. all(path%phase(:path%n_segments) == phase_stick)
      end associate
      if (rests) call self%fill_moments()
   end subroutine follow_to_rest

   !> The moments of the sets of the path.
   pure subroutine fill_moments(self)
      class(event_pair_type), intent(inout) :: self
      real(wp) :: before(4), behind(4)
      integer :: j

      call self%stick%clear()
      call self%slip%clear()
      call self%contact%clear()
      call self%held%clear()
      ! Weights of the four sets before and behind the start of segment j; only where they change do
      ! the moments gain anything.
      before = 0.0_wp
      do j = 1, self%path%n_segments + 1
         behind = 0.0_wp
         ! Behind the last segment comes the end of the period, where all weights fall to 0.
         if (j <= self%path%n_segments) then
            select case (self%path%phase(j))
            case (phase_stick)
               behind = [1.0_wp, 0.0_wp, 1.0_wp, self%path%z(j)]
            case (phase_forward)
               behind = [0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp]
            case (phase_backward)
               behind = [0.0_wp, -1.0_wp, 1.0_wp, 0.0_wp]
            case default ! open: no force at all
            end select
         end if
         ! A segment a..b of weight w has the moments w (sin(m b) - sin(m a))/m and w (cos(m a) -
         ! cos(m b))/m: each breakpoint adds the fall of the weight times the waves there.
         before = before - behind
         call set_waves(self, j)
         associate (angle => self%path%angle(j), c => self%cosines, s => self%sines)
            if (abs(before(1)) > 0.0_wp) call self%stick%add_step(before(1), angle, c, s)
            if (abs(before(2)) > 0.0_wp) call self%slip%add_step(before(2), angle, c, s)
            if (abs(before(3)) > 0.0_wp) call self%contact%add_step(before(3), angle, c, s)
            if (abs(before(4)) > 0.0_wp) call self%held%add_step(before(4), angle, c, s)
         end associate
         before = behind
      end do
      call self%stick%finish()
      call self%slip%finish()
      call self%contact%finish()
      if (abs(self%path%carry) > 0.0_wp) call add_carried(self)
      call self%held%finish()
   end subroutine fill_moments

   !> What side 2 carries z along while the pair sticks, carry tau.
   pure subroutine add_carried(self)
      class(event_pair_type), intent(inout) :: self
      integer :: j, k

      do j = 1, self%path%n_segments
         if (self%path%phase(j) /= phase_stick) cycle
         do k = j, j + 1
            call set_waves(self, k)
            call self%held%add_ramp(merge(-1.0_wp, 1.0_wp, k == j)*self%path%carry, &
                                    self%path%angle(k), self%cosines, self%sines)
         end do
      end do
   end subroutine add_carried

   !> Waves at the start of segment j; those at both ends of the period are the same to the last
   !> bit.
   pure subroutine set_waves(self, j)
      type(event_pair_type), intent(inout) :: self
      integer, intent(in) :: j

      if (j == 1 .or. j > self%path%n_segments) then
         self%cosines = 1.0_wp
         self%sines = 0.0_wp
      else
         call fill_waves(2*self%curves%degree, self%path%angle(j), self%cosines, self%sines)
      end if
   end subroutine set_waves

   !> Coefficients of the contact forces.
   pure subroutine force(self, n_retained, harmonic, column, tangential, normal)
      class(event_pair_type), intent(in) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> (n_coefficients).
      real(wp), intent(out) :: tangential(:), normal(:)

      normal = 0.0_wp
      tangential = 0.0_wp
      associate (c => self%curves)
         ! Of a normal force that is constant only the means of the sets are wanted.
         if (c%steady) then
            call add_means(self%contact, -c%normal(0, 1), n_retained, harmonic, column, normal)
         else
            call self%contact%project(-1.0_wp, c%normal, n_retained, harmonic, column, normal)
         end if
         if (.not. self%rubs) return
         ! T = P - z on stick, +-mu N on slip: three projections and the mean of z over the sticks.
         call self%stick%project(1.0_wp, c%tangential, n_retained, harmonic, column, tangential)
         if (c%steady) then
            call add_means(self%slip, c%mu*c%normal(0, 1), n_retained, harmonic, column, tangential)
         else
            call self%slip%project(c%mu, c%normal, n_retained, harmonic, column, tangential)
         end if
         call add_means(self%held, -1.0_wp, n_retained, harmonic, column, tangential)
      end associate
   end subroutine force

   !> Coefficients of the contact forces of the harmonics 0..highest, above those of the curves: the
   !> path has all of them.
   pure subroutine force_to(self, highest, tangential, normal)
      class(event_pair_type), intent(in) :: self
      integer, intent(in) :: highest
      !> (2 highest + 1).
      real(wp), intent(out) :: tangential(:), normal(:)
      type(event_pair_type) :: wide
      integer :: harmonic(highest + 1), n

      ! The same path with room for more moments; above their degree the curves are zero.
      harmonic = [(n, n=0, highest)]
      n = self%curves%degree
      call wide%reserve(max(highest, n), 1, 2*highest + 1)
      wide%rubs = self%rubs
      wide%curves%mu = self%curves%mu
      wide%curves%tangential(0:n, :) = self%curves%tangential
      wide%curves%normal(0:n, :) = self%curves%normal
      wide%path = self%path
      call wide%fill_moments()
      call wide%force(highest + 1, harmonic, max(1, 2*harmonic), tangential, normal)
   end subroutine force_to

   !> Add factor times the coefficients of the weight of `moments` itself.
   pure subroutine add_means(moments, factor, n_retained, harmonic, column, coefficient)
      type(moments_type), intent(in) :: moments
      real(wp), intent(in) :: factor
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> Grows by them (n_coefficients).
      real(wp), intent(inout) :: coefficient(:)
      integer :: h, k

      do h = 1, n_retained
         k = harmonic(h)
         associate (to => coefficient(column(h):))
            if (k == 0) then
               ! The same factors as in moments_type: 1/(2 pi) for the constant, 1/pi for the
               ! others.
               to(1) = to(1) + 0.5_wp/pi*factor*moments%cosine(0)
            else
               to(1) = to(1) + factor/pi*moments%cosine(k)
               to(2) = to(2) + factor/pi*moments%sine(k)
            end if
         end associate
      end do
   end subroutine add_means

   !> Transposed derivatives (input, output) of the tangential force by the tangential and normal
   !> predictions, and of the normal force by the normal one.
   pure subroutine derivative(self, n_retained, harmonic, column, by_tangential, by_normal, normal)
      class(event_pair_type), intent(inout) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> (n_coefficients, n_coefficients); overwritten.
      real(wp), intent(inout) :: by_tangential(:, :), by_normal(:, :), normal(:, :)
      integer :: j, k

      by_tangential = 0.0_wp
      by_normal = 0.0_wp
      normal = 0.0_wp
      if (self%presses) call self%contact%add_gram(1.0_wp, n_retained, harmonic, column, normal)
      if (.not. self%rubs) return
      call self%stick%add_gram(1.0_wp, n_retained, harmonic, column, by_tangential)
      ! Q = -mu y_n.
      if (self%presses) call self%slip%add_gram(-self%curves%mu, n_retained, harmonic, column, &
                                                by_normal)
      do j = 1, self%path%n_segments
         ! A z that was not set within the turn (stuck throughout) is that of the start: it depends
         ! on no input.
         if (self%path%phase(j) /= phase_stick .or. .not. self%path%set(j)) cycle
         call integrate_segment(self, j)
         self%integral = 0.0_wp
         call add_means(self%one, 1.0_wp, n_retained, harmonic, column, self%integral)
         if (self%path%reach > 0.0_wp) then
            call waves_of_ends(self, n_retained, harmonic, column)
            do k = 1, size(self%integral)
               by_tangential(:, k) = by_tangential(:, k) - self%integral(k)*self%origin
               if (self%presses) by_normal(:, k) = by_normal(:, k) + &
                                              (self%curves%mu*self%integral(k))*self%across
            end do
            cycle
         end if
         call waves_at(self, self%path%set_at(j), n_retained, harmonic, column)
         do k = 1, size(self%integral)
            by_tangential(:, k) = by_tangential(:, k) - self%integral(k)*self%origin
            if (.not. self%presses) cycle
            ! z = P - Q (or P + Q): dz/dQ is the weight, and dQ = -mu dy_n.
            by_normal(:, k) = by_normal(:, k) + &
                              (self%curves%mu*self%path%weight(j)*self%integral(k))*self%origin
         end do
      end do
   end subroutine derivative

   !> Moments of one segment.
   pure subroutine integrate_segment(self, j)
      type(event_pair_type), intent(inout) :: self
      integer, intent(in) :: j

      call self%one%clear()
      call set_waves(self, j)
      call self%one%add_step(-1.0_wp, self%path%angle(j), self%cosines, self%sines)
      call set_waves(self, j + 1)
      call self%one%add_step(1.0_wp, self%path%angle(j + 1), self%cosines, self%sines)
      call self%one%finish()
   end subroutine integrate_segment

   !> Waves of the coefficients at an angle, such as that where the z of a stick was set.
   pure subroutine waves_at(self, angle, n_retained, harmonic, column)
      type(event_pair_type), intent(inout) :: self
      real(wp), intent(in) :: angle
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      integer :: h

      call fill_waves(self%curves%degree, angle, self%cosines, self%sines)
      do h = 1, n_retained
         self%origin(column(h)) = self%cosines(harmonic(h))
         if (harmonic(h) > 0) self%origin(column(h) + 1) = self%sines(harmonic(h))
      end do
   end subroutine waves_at

   !> Of a residual traction that is given: dz/dP in `origin` and dz/dQ in `across`, from the waves
   !> at the angles of both ends of z, z = (1 - t)/2 (P - Q)(a) + (1 + t)/2 (P + Q)(b).
   pure subroutine waves_of_ends(self, n_retained, harmonic, column)
      type(event_pair_type), intent(inout) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)

      associate (path => self%path)
         call waves_at(self, path%end_at(1), n_retained, harmonic, column)
         self%across = -0.5_wp*(1.0_wp - path%share)*self%origin
         call waves_at(self, path%end_at(2), n_retained, harmonic, column)
         self%across = self%across + 0.5_wp*(1.0_wp + path%share)*self%origin
         ! (1 - t)/2 of the lower end and (1 + t)/2 of the upper one.
         self%origin = (1.0_wp + path%share)*self%origin - self%across
      end associate
   end subroutine waves_of_ends

   !> Contact forces at n_time uniform instants: what collocation and histories take.
   pure subroutine values_at(self, n_time, tangential, normal)
      class(event_pair_type), intent(inout) :: self
      !> The instants are those of collocation or of a history, not the grid of the curves.
      integer, intent(in) :: n_time
      real(wp), intent(out) :: tangential(n_time), normal(n_time)
      real(wp) :: angle, pressure, p
      integer :: j, k

      tangential = 0.0_wp
      normal = 0.0_wp
      ! Instants and segments both ascend: one pass through the segments serves all instants.
      j = 1
      do k = 1, n_time
         angle = 2.0_wp*pi*real(k - 1, wp)/real(n_time, wp)
         call advance(self%path, angle, j)
         if (self%path%phase(j) == phase_open) cycle
         call fill_waves(self%curves%degree, angle, self%cosines, self%sines)
         pressure = value_of(self%curves%degree, self%curves%normal, self%cosines, self%sines)
         normal(k) = -pressure
         if (.not. self%rubs) cycle
         select case (self%path%phase(j))
         case (phase_stick)
            p = value_of(self%curves%degree, self%curves%tangential, self%cosines, self%sines)
            tangential(k) = p - self%path%z(j) - self%path%carry*angle
         case (phase_forward)
            tangential(k) = self%curves%mu*pressure
         case (phase_backward)
            tangential(k) = -self%curves%mu*pressure
         case default ! open: no force at all
         end select
      end do
   end subroutine values_at

   !> Move j on to the segment that holds an angle.
   pure subroutine advance(path, angle, j)
      type(path_type), intent(in) :: path
      real(wp), intent(in) :: angle
      integer, intent(inout) :: j

      do while (j < path%n_segments)
         if (path%angle(j + 1) > angle) exit
         j = j + 1
      end do
   end subroutine advance

   !> Derivatives of the tangential force at the instants of a set of waves (n_coefficients,
   !> n_time), by the tangential and the normal prediction; and whether the pair bears there.
   pure subroutine rows_at(self, n_retained, harmonic, column, waves, by_tangential, by_normal, &
                           bears)
      class(event_pair_type), intent(inout) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      real(wp), intent(in) :: waves(:, :)
      real(wp), intent(out) :: by_tangential(:, :), by_normal(:, :)
      logical, intent(out) :: bears(:)
      real(wp) :: angle
      integer :: j, k, last

      by_tangential = 0.0_wp
      by_normal = 0.0_wp
      j = 1
      last = 0
      do k = 1, size(waves, 2)
         angle = 2.0_wp*pi*real(k - 1, wp)/real(size(waves, 2), wp)
         call advance(self%path, angle, j)
         bears(k) = self%path%phase(j) /= phase_open
         if (.not. self%rubs) cycle
         select case (self%path%phase(j))
         case (phase_stick)
            by_tangential(:, k) = waves(:, k)
            if (.not. self%path%set(j)) cycle
            if (self%path%reach > 0.0_wp) then
               if (j /= last) call waves_of_ends(self, n_retained, harmonic, column)
               last = j
               by_tangential(:, k) = by_tangential(:, k) - self%origin
               by_normal(:, k) = self%curves%mu*self%across
               cycle
            end if
            ! One set of waves serves all instants of a stick.
            if (j /= last) call waves_at(self, self%path%set_at(j), n_retained, harmonic, column)
            last = j
            by_tangential(:, k) = by_tangential(:, k) - self%origin
            by_normal(:, k) = (self%curves%mu*self%path%weight(j))*self%origin
         case (phase_forward)
            by_normal(:, k) = -self%curves%mu*waves(:, k)
         case (phase_backward)
            by_normal(:, k) = self%curves%mu*waves(:, k)
         case default ! open: no force at all
         end select
      end do
   end subroutine rows_at

   !> int N |dx| over the period, x the corrected position in units of force: what wears. With chi
   !> the sets of forward less backward slip and of all slip, it is
   !>
   !>   int chi_slip N P' - mu int chi_all N N'        (x moves with the bound that pushes it),
   !>   int chi_slip N P - mu int chi_all N N          at velocity level, where x moves by P - T.
   real(wp) function friction_path(self) result(path)
      class(event_pair_type), intent(inout) :: self

      path = 0.0_wp
      if (.not. self%rubs) return
      ! P' and N' where x moves with its bound: x' = P' -+ Q'.
      call set_rates(self)
      associate (c => self%curves)
         path = self%slip%pairing(c%normal, self%rate) - &
                c%mu*self%one%pairing(c%normal, self%normal_rate)
      end associate
   end function friction_path

   !> P' and N' (P and N at velocity level), and the moments of all slip in self%one.
   pure subroutine set_rates(self)
      type(event_pair_type), intent(inout) :: self

      ! All slip is contact less stick; a difference of moments, since both sets are exact.
      self%one%cosine = self%contact%cosine - self%stick%cosine
      self%one%sine = self%contact%sine - self%stick%sine
      associate (c => self%curves)
         if (self%remembers) then
            call differentiate(c%degree, c%tangential, self%rate)
            call differentiate(c%degree, c%normal, self%normal_rate)
            ! Against the surface that moves.
            self%rate(0, 1) = self%rate(0, 1) - c%carry
         else
            self%rate = c%tangential
            self%normal_rate = c%normal
         end if
      end associate
   end subroutine set_rates

   !> Derivative of the friction path by the coefficients of P and of y_n = -N. Where slip begins
   !> out of stick the rate jumps, at an angle that moves until the bound L meets z: that adds
   !> N (dL - dz) forward, -N (dL - dz) backward.
   pure subroutine path_derivative(self, n_retained, harmonic, column, by_tangential, by_normal)
      class(event_pair_type), intent(inout) :: self
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> (n_coefficients).
      real(wp), intent(inout) :: by_tangential(:), by_normal(:)
      ! Against the waves: slip N, slip P', all slip N', all slip N (P and N at velocity level).
      real(wp) :: raw(size(by_normal), 4)
      integer :: j

      raw = 0.0_wp
      call set_rates(self)
      associate (c => self%curves, n => n_retained)
         ! pi undoes the factor 1/pi of a coefficient: plain integrals are wanted.
         call self%slip%project(pi, c%normal, n, harmonic, column, raw(:, 1))
         call self%slip%project(pi, self%rate, n, harmonic, column, raw(:, 2))
         call self%one%project(pi, self%normal_rate, n, harmonic, column, raw(:, 3))
         call self%one%project(pi, c%normal, n, harmonic, column, raw(:, 4))
         ! Projections halve the constant.
         if (harmonic(1) == 0) raw(column(1), :) = 2.0_wp*raw(column(1), :)
         if (self%remembers) then
            ! There the input acts through its slope P' or N'.
            call transpose_slope(n, harmonic, column, raw(:, 1))
            call transpose_slope(n, harmonic, column, raw(:, 4))
         end if
         ! Of int slip N P' - mu int all N N', with dN = -dy_n.
         by_tangential = raw(:, 1)
         by_normal = -raw(:, 2) + c%mu*(raw(:, 3) + raw(:, 4))
      end associate
      ! Without memory the rate is continuous where slip begins: |P| - Q grows from 0.
      if (.not. self%remembers) return
      do j = 1, self%path%n_segments
         select case (self%path%phase(j))
         case (phase_forward)
            call add_onset(self, j, 1.0_wp, n_retained, harmonic, column, by_tangential, by_normal)
         case (phase_backward)
            call add_onset(self, j, -1.0_wp, n_retained, harmonic, column, by_tangential, by_normal)
         case default ! stuck or open: no slip has an onset
         end select
      end do
   end subroutine path_derivative

   !> Integrals of p times the slopes of the waves from those of p times the waves.
   pure subroutine transpose_slope(n_retained, harmonic, column, integral)
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> (n_coefficients), replaced.
      real(wp), intent(inout) :: integral(*)
      real(wp) :: on_cosine
      integer :: h, k

      do h = 1, n_retained
         k = column(h)
         ! The slope of cos(n tau) is -n sin(n tau), that of sin(n tau) is n cos(n tau).
         on_cosine = integral(k)
         if (harmonic(h) == 0) then
            integral(k) = 0.0_wp
         else
            integral(k) = -real(harmonic(h), wp)*integral(k + 1)
            integral(k + 1) = real(harmonic(h), wp)*on_cosine
         end if
      end do
   end subroutine transpose_slope

   !> What the angle adds where slip begins; nothing where the pair lands, N being 0.
   pure subroutine add_onset(self, j, side, n_retained, harmonic, column, by_tangential, by_normal)
      class(event_pair_type), intent(inout) :: self
      integer, intent(in) :: j, n_retained, harmonic(n_retained), column(n_retained)
      !> +1 forward, -1 backward.
      real(wp), intent(in) :: side
      real(wp), intent(inout) :: by_tangential(:), by_normal(:)
      real(wp) :: normal

      associate (c => self%curves, path => self%path)
         if (j > 1) then
            ! Behind slip of the other side N = 0, since both bounds meet z: nothing is added there
            ! either.
            if (path%phase(j - 1) == phase_open) return
         end if
         call waves_at(self, path%angle(j), n_retained, harmonic, column)
         normal = value_of(c%degree, c%normal, self%cosines, self%sines)
         ! dL = dP - side dQ, dQ = -mu dy_n.
         by_tangential = by_tangential + side*normal*self%origin
         by_normal = by_normal + normal*c%mu*self%origin
         ! z itself depends on the inputs at the angle where it was set.
         if (.not. path%set(j)) return
         call waves_at(self, path%set_at(j), n_retained, harmonic, column)
         by_tangential = by_tangential - side*normal*self%origin
         by_normal = by_normal + side*normal*c%mu*path%weight(j)*self%origin
      end associate
   end subroutine add_onset

   !> Share of the period in stick, slip and open.
   pure function shares(self)
      class(event_pair_type), intent(in) :: self
      real(wp) :: shares(3)
      real(wp) :: length
      integer :: j

      shares = 0.0_wp
      do j = 1, self%path%n_segments
         length = (self%path%angle(j + 1) - self%path%angle(j))/(2.0_wp*pi)
         select case (self%path%phase(j))
         case (phase_stick)
            shares(1) = shares(1) + length
         case (phase_open)
            shares(3) = shares(3) + length
         case default
            shares(2) = shares(2) + length
         end select
      end do
   end function shares

end module fw_event_pair
