!> Contact force of one pair with two tangential directions along its path through a period.
!>
!> Between the angles of a uniform grid and the roots of N the pair sticks, slips or is open. It
!> starts to slip at a root of |P - z|**2 - (mu N)**2; slipping, it turns as fw_event_rotation
!> says, two steps for each cell of the grid; it stops where P'.t - mu N' falls to zero, t being the
!> direction of slip. Sticking and bearing are integrated exactly, slip by Simpson's rule: the
!> error is of fourth order in the width of the grid.
!>
!> Derivatives by the inputs - coefficients of P_x, P_y and y_n = -N - are carried along the same
!> path, every switch included: at an onset of slip the tangent projection n.(dP - dz)/R turns the
!> force, at a stop dz = dP - dT, and a landing moves with the root of N.
module fw_event_planar
   use fw_event_moments, only: moments_type
   use fw_event_polynomial, only: fill_waves
   use fw_event_rotation, only: arc_type
   use fw_event_rotation, only: direction_of
   use fw_event_rotation, only: gauss_point
   use fw_event_rotation, only: half_angle
   use fw_event_rotation, only: new_arc
   use fw_event_rotation, only: rotate
   use fw_event_rotation, only: rotation_derivative
   use fw_event_roots, only: find_roots
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: planar_pair_type

   integer, parameter :: phase_open = 1, phase_stick = 2, phase_slip = 3
   !> Turns after which a march that is not periodic is given up.
   integer, parameter :: max_turns = 100
   !> Change of z over a turn, and violation of the cone, that are round-off (relative to the size
   !> of P and its square).
   real(wp), parameter :: periodic_tolerance = 1.0e-12_wp, on_cone = 1.0e-14_wp
   !> Switches in one cell after which the rest of it counts as slip: they crowd at round-off only.
   integer, parameter :: max_switches = 12
   !> Trials for the angle of a switch, and its accuracy.
   integer, parameter :: max_trials = 80
   real(wp), parameter :: angle_tolerance = 1.0e-15_wp
   !> Slipping nodes whose derivatives are projected by one matrix product.
   integer, parameter :: buffer_size = 64

   !> P, its derivatives, R = mu N and its derivative at an angle.
   type :: instant_type
      real(wp) :: angle = 0.0_wp, p(2) = 0.0_wp, dp(2) = 0.0_wp, ddp(2) = 0.0_wp
      real(wp) :: radius = 0.0_wp, dradius = 0.0_wp, ddradius = 0.0_wp
   end type instant_type

   type :: state_type
      integer :: phase = phase_stick
      !> Position of a pair that sticks; half-angle vector of one that slips.
      real(wp) :: z(2) = 0.0_wp, v(2) = 0.0_wp
      !> Whether slip starts here at R = 0.
      logical :: lands = .false.
   end type state_type

   type :: planar_pair_type
      integer :: degree = 0, n_grid = 0
      real(wp) :: mu = 0.0_wp
      !> False: velocity-level law, T = P projected onto the disc of radius R.
      logical :: remembers = .true.
      !> P (0:degree, cosine and sine, direction) and N (0:degree, cosine and sine).
      real(wp), allocatable :: tangential(:, :, :), normal(:, :)
      !> Samples of N and N' on the grid.
      real(wp), allocatable :: values(:), slopes(:)
      !> Results: coefficients (n_coefficients, 3), z at the end, change over the last turn, shares
      !> of stick, slip and open, int N |dz|, and tangential forces on the grid (2, n_grid).
      real(wp), allocatable :: force(:, :), on_grid(:, :)
      !> Projection of the forces, whatever `force` is, and mean of the tangential ones.
      real(wp), allocatable, private :: projected(:, :)
      real(wp), private :: mean(2) = 0.0_wp
      real(wp) :: z_end(2) = 0.0_wp, drift = 0.0_wp, share(3) = 0.0_wp, friction_path = 0.0_wp
      logical :: closed = .true., open = .false., moved = .false.
      integer :: turns = 0
      !> Sets of stick and contact; stick weighted by z.
      type(moments_type), private :: stick, contact, held(2)
      real(wp), private :: scale = 0.0_wp, stick_from = 0.0_wp
      integer, private :: n_knots = 0
      real(wp), allocatable, private :: knot(:), lift(:)
      !> Index on the grid of each knot, 0 of roots of N; whether the pair is open behind it.
      integer, allocatable, private :: place(:)
      logical, allocatable, private :: lifted(:)
      real(wp), allocatable, private :: cosines(:), sines(:)
      !> Weights of the waves in the coefficients, and waves and slopes at an angle.
      real(wp), allocatable, private :: weight(:), wave(:), wave_slope(:)
      !> Derivatives of z and phi (n_coefficients, input, direction).
      real(wp), allocatable, private :: dz(:, :, :), dphi(:, :)
      !> Rows to be projected: (n_coefficients, input, direction, node), (n_coefficients, node).
      real(wp), allocatable, private :: rows(:, :, :, :), projector(:, :)
      integer, private :: n_rows = 0
      !> Derivative of the projected forces (n_coefficients, input, n_coefficients, direction), and
      !> workspace (n_coefficients).
      real(wp), allocatable, private :: gradient(:, :, :, :), integral(:)
      !> Derivatives are carried along; and this is the turn that counts.
      logical, private :: deriving = .false., recording = .false.
   contains
      procedure :: reserve
      procedure :: follow
      procedure :: derivative
      procedure :: coefficients
   end type planar_pair_type

contains

   !> Room for polynomials of a degree, sampled on a grid, and n_coefficients waves.
   pure subroutine reserve(self, degree, n_grid, n_coefficients)
      class(planar_pair_type), intent(inout) :: self
      integer, intent(in) :: degree, n_grid, n_coefficients
      integer :: n

      self%degree = degree
      self%n_grid = n_grid
      allocate (self%tangential(0:degree, 2, 2), self%normal(0:degree, 2), source=0.0_wp)
      allocate (self%values(n_grid), self%slopes(n_grid), source=0.0_wp)
      allocate (self%force(n_coefficients, 3), self%on_grid(2, n_grid), source=0.0_wp)
      allocate (self%projected(n_coefficients, 3), source=0.0_wp)
      call self%stick%reserve(degree)
      call self%contact%reserve(degree)
      call self%held(1)%reserve(degree)
      call self%held(2)%reserve(degree)
      n = n_grid + 2*degree + 2
      allocate (self%knot(n), self%place(n), self%lifted(n), self%lift(2*degree + 1))
      allocate (self%cosines(0:2*degree), self%sines(0:2*degree))
      allocate (self%weight(n_coefficients), self%wave(n_coefficients))
      allocate (self%wave_slope(n_coefficients))
   end subroutine reserve

   !> March from x_start until the position repeats; forces of the last turn.
   subroutine follow(self, fourier, x_start)
      class(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: x_start(2)
      type(state_type) :: state
      real(wp) :: before(2)

      call find_knots(self)
      call set_weights(self, fourier)
      self%scale = sum(abs(self%tangential))
      self%deriving = .false.
      self%moved = .not. self%closed
      call start(self, fourier, x_start, state)
      before = position(self, state)
      do
         self%turns = self%turns + 1
         call turn(self, fourier, state)
         self%z_end = position(self, state)
         self%drift = maxval(abs(self%z_end - before))
         if (self%drift <= periodic_tolerance*self%scale) exit
         if (self%turns >= max_turns .or. .not. self%remembers) exit
         before = self%z_end
      end do
      if (.not. self%remembers) self%drift = 0.0_wp
      call collect(self, fourier)
   end subroutine follow

   !> Angles between which N has one sign: the grid and the roots of N.
   subroutine find_knots(self)
      type(planar_pair_type), intent(inout) :: self
      integer :: j, k, n, n_lifts
      logical :: lifted

      n_lifts = 0
      lifted = self%normal(0, 1) <= 0.0_wp
      if (any(abs(self%normal(1:, :)) > 0.0_wp)) then
         call find_roots(self%n_grid, self%degree, self%normal, self%values, self%slopes, &
                         sum(abs(self%normal)), n_lifts, self%lift)
         lifted = self%values(1) < 0.0_wp
      end if
      self%closed = n_lifts == 0 .and. .not. lifted
      self%open = n_lifts == 0 .and. lifted
      n = 0
      j = 1
      do k = 1, self%n_grid + 1
         do while (j <= n_lifts)
            if (self%lift(j) >= grid_angle(self, k)) exit
            lifted = .not. lifted
            call add(self%lift(j), 0)
            j = j + 1
         end do
         call add(grid_angle(self, k), k)
      end do
      self%n_knots = n

   contains

      subroutine add(angle, place)
         real(wp), intent(in) :: angle
         integer, intent(in) :: place

         n = n + 1
         self%knot(n) = angle
         self%place(n) = place
         self%lifted(n) = lifted
      end subroutine add

   end subroutine find_knots

   pure real(wp) function grid_angle(self, k)
      type(planar_pair_type), intent(in) :: self
      integer, intent(in) :: k

      grid_angle = 2.0_wp*pi*real(k - 1, wp)/real(self%n_grid, wp)
   end function grid_angle

   pure subroutine set_weights(self, fourier)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier

      self%turns = 0
      self%weight = 1.0_wp/pi
      if (fourier%has_constant()) self%weight(1) = 0.5_wp/pi
   end subroutine set_weights

   !> P and R at an angle.
   pure function look(self, angle) result(at)
      type(planar_pair_type), intent(in) :: self
      real(wp), intent(in) :: angle
      type(instant_type) :: at
      real(wp) :: c, s, c_1, s_1, c_next, w
      integer :: m

      at%angle = angle
      c_1 = cos(angle)
      s_1 = sin(angle)
      c = c_1
      s = s_1
      at%p = self%tangential(0, 1, :)
      at%radius = self%normal(0, 1)
      do m = 1, self%degree
         w = real(m, wp)
         associate (a => self%tangential(m, 1, :), b => self%tangential(m, 2, :))
            at%p = at%p + (a*c + b*s)
            at%dp = at%dp + w*(b*c - a*s)
            at%ddp = at%ddp - w**2*(a*c + b*s)
         end associate
         at%radius = at%radius + (self%normal(m, 1)*c + self%normal(m, 2)*s)
         at%dradius = at%dradius + w*(self%normal(m, 2)*c - self%normal(m, 1)*s)
         at%ddradius = at%ddradius - w**2*(self%normal(m, 1)*c + self%normal(m, 2)*s)
         c_next = c*c_1 - s*s_1
         s = s*c_1 + c*s_1
         c = c_next
      end do
      at%radius = self%mu*at%radius
      at%dradius = self%mu*at%dradius
      at%ddradius = self%mu*at%ddradius
   end function look

   !> The waves of the coefficients and their slopes at an angle.
   pure subroutine set_waves(self, fourier, angle)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: angle
      integer :: h, k, n

      call fill_waves(self%degree, angle, self%cosines(:self%degree), self%sines(:self%degree))
      do h = 1, fourier%n_retained
         n = fourier%harmonic(h)
         k = fourier%column(h)
         self%wave(k) = self%cosines(n)
         self%wave_slope(k) = -real(n, wp)*self%sines(n)
         if (n == 0) cycle
         self%wave(k + 1) = self%sines(n)
         self%wave_slope(k + 1) = real(n, wp)*self%cosines(n)
      end do
   end subroutine set_waves

   !> State at tau = 0 for a given position.
   subroutine start(self, fourier, x_start, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: x_start(2)
      type(state_type), intent(out) :: state
      type(instant_type) :: at

      if (self%remembers) state%z = x_start
      if (self%deriving) then
         self%dz = 0.0_wp
         self%dphi = 0.0_wp
      end if
      if (self%lifted(1)) then
         state%phase = phase_open
         return
      end if
      at = look(self, 0.0_wp)
      if (excess(at, state%z) > 0.0_wp) call begin_slip(self, fourier, at, state)
   end subroutine start

   !> |P - z|**2 - R**2: positive outside of the cone.
   pure real(wp) function excess(at, z)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)

      excess = sum((at%p - z)**2) - at%radius**2
   end function excess

   !> Corrected position at tau = 0.
   pure function position(self, state) result(z)
      type(planar_pair_type), intent(in) :: self
      type(state_type), intent(in) :: state
      real(wp) :: z(2)
      type(instant_type) :: at

      z = state%z
      if (state%phase == phase_stick) return
      at = look(self, 0.0_wp)
      z = at%p
      if (state%phase == phase_slip) z = at%p - at%radius*direction_of(state%v)
   end function position

   !> One period.
   subroutine turn(self, fourier, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(state_type), intent(inout) :: state
      integer :: k

      self%projected = 0.0_wp
      self%mean = 0.0_wp
      self%share = 0.0_wp
      self%friction_path = 0.0_wp
      call self%stick%clear()
      call self%held(1)%clear()
      call self%held(2)%clear()
      if (state%phase == phase_stick) call open_stick(self, 0.0_wp, state)
      do k = 1, self%n_knots - 1
         if (self%lifted(k)) then
            if (state%phase == phase_stick) call close_stick(self, fourier, self%knot(k), state)
            state%phase = phase_open
            self%share(3) = self%share(3) + (self%knot(k + 1) - self%knot(k))
         else if (state%phase == phase_open) then
            call land(self, fourier, look(self, self%knot(k)), state)
         end if
         if (self%place(k) > 0) call sample(self, fourier, self%place(k), state)
         if (.not. self%lifted(k)) call bear(self, fourier, self%knot(k), self%knot(k + 1), state)
      end do
      if (state%phase == phase_stick) call close_stick(self, fourier, 2.0_wp*pi, state)
   end subroutine turn

   !> Contact begins, at a root of N: the pair sticks where it lands if R grows faster than P moves.
   subroutine land(self, fourier, at, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: at
      type(state_type), intent(inout) :: state
      integer :: c

      state%z = 0.0_wp
      if (.not. self%remembers) then
         call begin_slip(self, fourier, at, state)
      else if (norm2(at%dp) < at%dradius) then
         state%phase = phase_stick
         state%z = at%p
         if (self%deriving) then
            call set_waves(self, fourier, at%angle)
            self%dz = 0.0_wp
            do c = 1, 2
               self%dz(:, c, c) = self%wave
               ! The root of N moves by -dN/N', with N = -y_n.
               self%dz(:, 3, c) = (self%mu*at%dp(c)/at%dradius)*self%wave
            end do
         end if
         call open_stick(self, at%angle, state)
      else
         state%phase = phase_slip
         state%v = half_angle(at%dp)
         state%lands = .true.
      end if
   end subroutine land

   !> Contact from one knot to the next.
   subroutine bear(self, fourier, from, to, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: from, to
      type(state_type), intent(inout) :: state
      real(wp) :: angle
      logical :: found
      integer :: k

      if (self%mu <= 0.0_wp) then
         call slide_freely(self, from, to, state)
         return
      end if
      angle = from
      do k = 1, max_switches
         if (state%phase == phase_stick) then
            call find_exit(self, angle, to, state%z, found)
            if (.not. found) return
            call close_stick(self, fourier, angle, state)
            call begin_slip(self, fourier, look(self, angle), state)
         end if
         call slide(self, fourier, angle, to, state)
         if (state%phase == phase_slip) return
         call open_stick(self, angle, state)
      end do
   end subroutine bear

   !> Without friction the pair moves at no cost.
   subroutine slide_freely(self, from, to, state)
      type(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: from, to
      type(state_type), intent(inout) :: state
      type(instant_type) :: at
      real(wp) :: rate, normal
      integer :: k

      if (state%phase == phase_stick) self%stick_from = 0.0_wp
      state%phase = phase_slip
      state%v = [1.0_wp, 0.0_wp]
      self%moved = .true.
      self%share(2) = self%share(2) + (to - from)
      do k = 0, 2
         at = look(self, from + 0.5_wp*real(k, wp)*(to - from))
         normal = normal_at(self, at%angle)
         rate = merge(norm2(at%dp), norm2(at%p), self%remembers)
         self%friction_path = self%friction_path + simpson(k)*(to - from)*normal*rate
      end do
   end subroutine slide_freely

   pure real(wp) function simpson(k)
      !> 0, 1 or 2.
      integer, intent(in) :: k

      simpson = merge(4.0_wp, 1.0_wp, k == 1)/6.0_wp
   end function simpson

   pure real(wp) function normal_at(self, angle)
      type(planar_pair_type), intent(in) :: self
      real(wp), intent(in) :: angle
      integer :: m

      normal_at = 0.0_wp
      do m = 0, self%degree
         normal_at = normal_at + self%normal(m, 1)*cos(m*angle) + self%normal(m, 2)*sin(m*angle)
      end do
   end function normal_at

   !> First angle after which the pair leaves the cone, if it does before `to`.
   pure subroutine find_exit(self, angle, to, z, found)
      type(planar_pair_type), intent(in) :: self
      !> Where stick has begun, then where it ends.
      real(wp), intent(inout) :: angle
      real(wp), intent(in) :: to, z(2)
      logical, intent(out) :: found
      type(instant_type) :: at
      real(wp) :: low, high, step, value, slope, noise, f(2), df(2), trial
      integer :: k

      found = .false.
      if (to <= angle) return
      noise = on_cone*(self%scale**2 + tiny(1.0_wp))
      high = to
      at = look(self, to)
      f(2) = excess(at, z)
      if (f(2) <= noise) then
         ! Perhaps between: at the largest value of the cubic through both ends.
         df(2) = excess_slope(at, z)
         at = look(self, angle)
         f(1) = excess(at, z)
         df(1) = excess_slope(at, z)
         if (df(1) <= 0.0_wp .or. df(2) >= 0.0_wp) return
         high = angle + summit(f, df, to - angle)
         if (excess(look(self, high), z) <= noise) return
      end if
      found = .true.
      low = angle
      trial = 0.5_wp*(low + high)
      do k = 1, max_trials
         at = look(self, trial)
         value = excess(at, z)
         slope = excess_slope(at, z)
         if (value > 0.0_wp) then
            high = trial
         else
            low = trial
         end if
         step = 0.5_wp*(low + high) - trial
         if (abs(slope) > 0.0_wp) then
            if (trial - value/slope > low .and. trial - value/slope < high) step = -value/slope
         end if
         trial = trial + step
         if (abs(step) <= angle_tolerance*(1.0_wp + trial)) exit
      end do
      angle = trial
   end subroutine find_exit

   pure real(wp) function excess_slope(at, z)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)

      excess_slope = 2.0_wp*(dot_product(at%p - z, at%dp) - at%radius*at%dradius)
   end function excess_slope

   !> Where the cubic with values f and slopes df at 0 and width, rising and then falling, is
   !> largest.
   pure real(wp) function summit(f, df, width)
      real(wp), intent(in) :: f(2), df(2), width
      real(wp) :: a(3), root

      a(1) = df(1)*width
      a(2) = 3.0_wp*(f(2) - f(1)) - width*(2.0_wp*df(1) + df(2))
      a(3) = 2.0_wp*(f(1) - f(2)) + width*(df(1) + df(2))
      root = sqrt(max(a(2)**2 - 3.0_wp*a(3)*a(1), 0.0_wp))
      ! The falling root of a1 + 2 a2 t + 3 a3 t**2, without cancellation.
      if (a(2) > 0.0_wp) then
         summit = width*(-(a(2) + root)/(3.0_wp*a(3)))
      else
         summit = width*a(1)/(root - a(2))
      end if
   end function summit

   !> Slip begins: the force keeps its place on the cone and turns with n.(dP - dz)/|P - z|.
   subroutine begin_slip(self, fourier, at, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: at
      type(state_type), intent(inout) :: state
      real(wp) :: d(2), n(2)
      integer :: c

      d = at%p - state%z
      state%phase = phase_slip
      state%v = half_angle(d)
      state%lands = .false.
      self%moved = .true.
      if (.not. self%deriving) return
      n = [-d(2), d(1)]/dot_product(d, d)
      call set_waves(self, fourier, at%angle)
      self%dphi = 0.0_wp
      if (self%remembers) self%dphi = -(n(1)*self%dz(:, :, 1) + n(2)*self%dz(:, :, 2))
      do c = 1, 2
         self%dphi(:, c) = self%dphi(:, c) + n(c)*self%wave
      end do
   end subroutine begin_slip

   !> Slip from `angle` to `to`, or to where it stops: two steps, and Simpson's rule.
   subroutine slide(self, fourier, angle, to, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Where slip begins, then where it has come to.
      real(wp), intent(inout) :: angle
      real(wp), intent(in) :: to
      type(state_type), intent(inout) :: state
      type(instant_type) :: at(3)
      real(wp) :: v(2, 3), width, last
      integer :: k
      logical :: stops

      at(1) = look(self, angle)
      v(:, 1) = state%v
      call take_steps(self, to, state%lands, at, v)
      do k = 2, 3
         last = at(k)%angle
         call find_stop(self, at(k - 1:k), v(:, k - 1:k), state%lands .and. k == 2, last, stops)
         if (.not. stops) cycle
         call take_steps(self, last, state%lands, at, v)
         exit
      end do
      width = at(3)%angle - at(1)%angle
      if (width > 0.0_wp) then
         call add_node(self, fourier, at(1), v(:, 1), simpson(0)*width)
         call turn_derivative(self, fourier, at(1), at(2), v(:, 1), state%lands)
         call add_node(self, fourier, at(2), v(:, 2), simpson(1)*width)
         call turn_derivative(self, fourier, at(2), at(3), v(:, 2), .false.)
         call add_node(self, fourier, at(3), v(:, 3), simpson(2)*width)
         self%share(2) = self%share(2) + width
         state%lands = .false.
      end if
      state%v = v(:, 3)
      angle = at(3)%angle
      if (stops) call begin_stick(self, fourier, at(3), state)
   end subroutine slide

   !> Directions in the middle and at the end of a stretch of slip.
   pure subroutine take_steps(self, to, lands, at, v)
      type(planar_pair_type), intent(in) :: self
      real(wp), intent(in) :: to
      logical, intent(in) :: lands
      !> The first of three is given.
      type(instant_type), intent(inout) :: at(3)
      real(wp), intent(inout) :: v(2, 3)

      at(3) = look(self, to)
      at(2) = look(self, 0.5_wp*(at(1)%angle + to))
      v(:, 2) = turned(self, at(1), at(2), v(:, 1), lands)
      v(:, 3) = turned(self, at(2), at(3), v(:, 2), .false.)
   end subroutine take_steps

   !> What drives slip on; it stops where this is negative.
   pure real(wp) function pull(self, at, v)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)

      if (self%remembers) then
         pull = dot_product(at%dp, direction_of(v)) - at%dradius
      else
         pull = norm2(at%p) - at%radius
      end if
   end function pull

   !> Rate of `pull` along the path.
   pure real(wp) function pull_slope(self, at, v) result(slope)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)
      real(wp) :: t(2)

      slope = 0.0_wp
      if (at%radius <= 0.0_wp) return
      t = direction_of(v)
      if (self%remembers) then
         slope = dot_product(at%ddp, t) - at%ddradius + &
                 (t(1)*at%dp(2) - t(2)*at%dp(1))**2/at%radius
      else
         slope = dot_product(at%p, at%dp)/norm2(at%p) - at%dradius
      end if
   end function pull_slope

   !> Whether and where slip stops in a step: with a negative pull at its end, or between where the
   !> cubic through both ends dips below zero.
   pure subroutine find_stop(self, at, v, lands, angle, stops)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: at(2)
      real(wp), intent(in) :: v(2, 2)
      logical, intent(in) :: lands
      real(wp), intent(inout) :: angle
      logical, intent(out) :: stops
      type(instant_type) :: dip
      real(wp) :: f(2), df(2)

      f = [pull(self, at(1), v(:, 1)), pull(self, at(2), v(:, 2))]
      stops = f(2) < 0.0_wp
      angle = at(2)%angle
      if (.not. stops) then
         df = [pull_slope(self, at(1), v(:, 1)), pull_slope(self, at(2), v(:, 2))]
         if (df(1) >= 0.0_wp .or. df(2) <= 0.0_wp) return
         angle = at(1)%angle + summit(-f, -df, angle - at(1)%angle)
         dip = look(self, angle)
         stops = pull(self, dip, turned(self, at(1), dip, v(:, 1), lands)) < 0.0_wp
      end if
      if (stops) angle = stop_angle(self, at(1), v(:, 1), lands, angle)
   end subroutine find_stop

   !> Where slip stops before `to`, by regula falsi with halved weights (Illinois).
   pure real(wp) function stop_angle(self, from, v, lands, to) result(angle)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: from
      real(wp), intent(in) :: v(2), to
      logical, intent(in) :: lands
      type(instant_type) :: at
      real(wp) :: low, high, f_low, f_high, f
      integer :: k, side

      low = from%angle
      high = to
      angle = low
      f_low = pull(self, from, v)
      if (f_low <= 0.0_wp) return
      at = look(self, to)
      f_high = pull(self, at, turned(self, from, at, v, lands))
      angle = high
      if (f_high >= 0.0_wp) return
      side = 0
      do k = 1, max_trials
         angle = (f_low*high - f_high*low)/(f_low - f_high)
         at = look(self, angle)
         f = pull(self, at, turned(self, from, at, v, lands))
         if (f >= 0.0_wp) then
            if (side == 1) f_high = 0.5_wp*f_high
            if (angle - low <= angle_tolerance*(1.0_wp + angle)) return
            low = angle
            f_low = f
            side = 1
         else
            if (side == -1) f_low = 0.5_wp*f_low
            if (high - angle <= angle_tolerance*(1.0_wp + angle)) return
            high = angle
            f_high = f
            side = -1
         end if
         if (abs(f) <= 0.0_wp) return
      end do
   end function stop_angle

   !> Direction of slip after a step.
   pure function turned(self, from, to, v, lands) result(after)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: from, to
      real(wp), intent(in) :: v(2)
      logical, intent(in) :: lands
      real(wp) :: after(2)
      type(instant_type) :: gauss(2)
      type(arc_type) :: arc
      real(wp) :: h, phi

      after = v
      h = to%angle - from%angle
      if (h <= 0.0_wp) return
      if (.not. self%remembers) then
         after = half_angle(to%p)
         return
      end if
      gauss = gauss_instants(self, from%angle, h)
      if (lands) then
         arc = landing_arc(from, gauss, v, h)
         phi = 0.5_wp*h*(arc%slope + arc%curvature*h)
         after = [v(1)*cos(phi) - v(2)*sin(phi), v(2)*cos(phi) + v(1)*sin(phi)]
      else
         after = rotate(h, gauss(1)%dp/gauss(1)%radius, gauss(2)%dp/gauss(2)%radius, v)
      end if
   end function turned

   !> The two Gauss points of a step; R is kept above round-off where N ends.
   pure function gauss_instants(self, from, h) result(gauss)
      type(planar_pair_type), intent(in) :: self
      real(wp), intent(in) :: from, h
      type(instant_type) :: gauss(2)
      integer :: i

      do i = 1, 2
         gauss(i) = look(self, from + gauss_point(i)*h)
         gauss(i)%radius = max(gauss(i)%radius, on_cone*self%scale)
      end do
   end function gauss_instants

   pure type(arc_type) function landing_arc(from, gauss, v, h) result(arc)
      type(instant_type), intent(in) :: from, gauss(2)
      real(wp), intent(in) :: v(2), h
      real(wp) :: t(2), p_slope(2, 2)

      t = direction_of(v)
      p_slope(:, 1) = gauss(1)%dp
      p_slope(:, 2) = gauss(2)%dp
      arc = new_arc(h, v, p_slope, [gauss(1)%radius, gauss(2)%radius], &
                    (t(1)*from%ddp(2) - t(2)*from%ddp(1))/(from%dradius + norm2(from%dp)))
   end function landing_arc

   !> Slip stops: the position stays where the force leaves it.
   subroutine begin_stick(self, fourier, at, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: at
      type(state_type), intent(inout) :: state
      integer :: c

      state%phase = phase_stick
      state%z = 0.0_wp
      if (.not. self%remembers) return
      state%z = at%p - at%radius*direction_of(state%v)
      if (.not. self%deriving) return
      call set_waves(self, fourier, at%angle)
      call slip_rows(self, at, state%v, self%dz)
      self%dz = -self%dz
      do c = 1, 2
         self%dz(:, c, c) = self%dz(:, c, c) + self%wave
      end do
   end subroutine begin_stick

   !> dT of slip where the waves are set: dR t + R n dphi.
   pure subroutine slip_rows(self, at, v, rows)
      type(planar_pair_type), intent(in) :: self
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)
      real(wp), intent(inout) :: rows(:, :, :)
      real(wp) :: t(2)

      t = direction_of(v)
      rows(:, :, 1) = (-at%radius*t(2))*self%dphi
      rows(:, :, 2) = (at%radius*t(1))*self%dphi
      rows(:, 3, 1) = rows(:, 3, 1) - (self%mu*t(1))*self%wave
      rows(:, 3, 2) = rows(:, 3, 2) - (self%mu*t(2))*self%wave
   end subroutine slip_rows

   !> One node of the quadrature over slip.
   subroutine add_node(self, fourier, at, v, width)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2), width
      real(wp) :: t(2), rate
      integer :: c

      call set_waves(self, fourier, at%angle)
      t = direction_of(v)
      rate = max(pull(self, at, v), 0.0_wp)
      self%friction_path = self%friction_path + width*at%radius/self%mu*rate
      do c = 1, 2
         self%mean(c) = self%mean(c) + 0.5_wp/pi*width*at%radius*t(c)
         self%projected(:, c) = self%projected(:, c) + &
                                (width*at%radius*t(c))*self%weight*self%wave
      end do
      if (.not. (self%deriving .and. self%recording .and. fourier%projects)) return
      call slip_rows(self, at, v, self%rows(:, :, :, self%n_rows + 1))
      self%projector(:, self%n_rows + 1) = width*self%weight*self%wave
      call keep_row(self)
   end subroutine add_node

   !> Count a row; project the rows once there is no room for more.
   subroutine keep_row(self)
      type(planar_pair_type), intent(inout) :: self

      self%n_rows = self%n_rows + 1
      if (self%n_rows == buffer_size) call project_rows(self)
   end subroutine keep_row

   subroutine project_rows(self)
      type(planar_pair_type), intent(inout) :: self
      integer :: c, nc

      nc = size(self%wave)
      do c = 1, 2
         if (self%n_rows == 0) exit
         call dgemm('N', 'T', 3*nc, nc, self%n_rows, 1.0_wp, self%rows(1, 1, c, 1), 6*nc, &
                    self%projector, nc, 1.0_wp, self%gradient(1, 1, 1, c), 3*nc)
      end do
      self%n_rows = 0
   end subroutine project_rows

   !> dphi over a step.
   subroutine turn_derivative(self, fourier, from, to, v, lands)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: from, to
      real(wp), intent(in) :: v(2)
      logical, intent(in) :: lands
      type(instant_type) :: gauss(2)
      real(wp) :: gain, by(2, 2), h, n(2)
      integer :: i

      h = to%angle - from%angle
      if (.not. self%deriving .or. h <= 0.0_wp) return
      if (.not. self%remembers) then
         n = [-to%p(2), to%p(1)]/dot_product(to%p, to%p)
         call set_waves(self, fourier, to%angle)
         self%dphi(:, 1) = n(1)*self%wave
         self%dphi(:, 2) = n(2)*self%wave
         self%dphi(:, 3) = 0.0_wp
         return
      end if
      gauss = gauss_instants(self, from%angle, h)
      if (lands) then
         call landing_derivative(self, fourier, from, gauss, v, h)
         return
      end if
      call rotation_derivative(h, gauss(1)%dp/gauss(1)%radius, gauss(2)%dp/gauss(2)%radius, v, &
                               gain, by(:, 1), by(:, 2))
      self%dphi = gain*self%dphi
      do i = 1, 2
         call set_waves(self, fourier, gauss(i)%angle)
         ! a = P'/R, dR = -mu dy_n.
         by(:, i) = by(:, i)/gauss(i)%radius
         self%dphi(:, 1) = self%dphi(:, 1) + by(1, i)*self%wave_slope
         self%dphi(:, 2) = self%dphi(:, 2) + by(2, i)*self%wave_slope
         self%dphi(:, 3) = self%dphi(:, 3) + &
            (self%mu*dot_product(by(:, i), gauss(i)%dp)/gauss(i)%radius)*self%wave
      end do
   end subroutine turn_derivative

   !> dphi at the end of the step behind a landing, whose angle moves by dtheta = wave/N' for each
   !> input y_n; so do its Gauss points, by the share of the step that is still ahead of them.
   subroutine landing_derivative(self, fourier, from, gauss, v, h)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(instant_type), intent(in) :: from, gauss(2)
      real(wp), intent(in) :: v(2), h
      type(arc_type) :: arc
      real(wp) :: t(2), n(2), s, phi, slope, dtheta(size(self%wave)), first(size(self%wave), 3)
      real(wp) :: condition(size(self%wave), 3), change(size(self%wave), 3, 2)
      integer :: i

      arc = landing_arc(from, gauss, v, h)
      ! phi at the landing is the angle of P'.
      call set_waves(self, fourier, from%angle)
      dtheta = self%mu/from%dradius*self%wave
      n = [-from%dp(2), from%dp(1)]/dot_product(from%dp, from%dp)
      first(:, 1) = n(1)*self%wave_slope
      first(:, 2) = n(2)*self%wave_slope
      first(:, 3) = dot_product(n, from%ddp)*dtheta
      change = 0.0_wp
      phi = 2.0_wp*atan2(v(2), v(1))
      do i = 1, 2
         s = gauss_point(i)*h
         slope = arc%slope + 2.0_wp*arc%curvature*s
         n(1) = phi + s*(arc%slope + s*arc%curvature)
         t = [cos(n(1)), sin(n(1))]
         n = [-t(2), t(1)]
         call set_waves(self, fourier, gauss(i)%angle)
         condition = dot_product(t, gauss(i)%dp)*first
         condition(:, 1) = condition(:, 1) - n(1)*self%wave_slope
         condition(:, 2) = condition(:, 2) - n(2)*self%wave_slope
         condition(:, 3) = condition(:, 3) - (slope*self%mu)*self%wave + dtheta* &
            ((1.0_wp - gauss_point(i))*(gauss(i)%dradius*slope - dot_product(n, gauss(i)%ddp)) - &
             gauss_point(i)*(2.0_wp*arc%curvature*gauss(i)%radius + &
                             dot_product(t, gauss(i)%dp)*slope))
         change(:, :, 1) = change(:, :, 1) - arc%inverse(1, i)*condition
         change(:, :, 2) = change(:, :, 2) - arc%inverse(2, i)*condition
      end do
      self%dphi = first + h*change(:, :, 1) + h**2*change(:, :, 2)
      self%dphi(:, 3) = self%dphi(:, 3) - (arc%slope + 2.0_wp*arc%curvature*h)*dtheta
   end subroutine landing_derivative

   pure subroutine open_stick(self, angle, state)
      type(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: angle
      type(state_type), intent(in) :: state

      self%stick_from = angle
      call fill_waves(2*self%degree, angle, self%cosines, self%sines)
      call add_steps(self, -1.0_wp, angle, state%z)
   end subroutine open_stick

   pure subroutine add_steps(self, drop, angle, z)
      type(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: drop, angle, z(2)
      integer :: c

      call self%stick%add_step(drop, angle, self%cosines, self%sines)
      do c = 1, 2
         call self%held(c)%add_step(drop*z(c), angle, self%cosines, self%sines)
      end do
   end subroutine add_steps

   !> Stick ends: its integrals, and those of its derivative.
   subroutine close_stick(self, fourier, angle, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: angle
      type(state_type), intent(in) :: state
      real(wp) :: n
      integer :: c, h, k

      call fill_waves(2*self%degree, angle, self%cosines, self%sines)
      call add_steps(self, 1.0_wp, angle, state%z)
      self%share(1) = self%share(1) + (angle - self%stick_from)
      if (.not. (self%deriving .and. self%recording .and. fourier%projects)) return
      ! The waves integrated over the stick; the slopes of the waves are n times their conjugates.
      call set_waves(self, fourier, angle)
      self%integral = self%wave_slope
      call set_waves(self, fourier, self%stick_from)
      self%integral = self%integral - self%wave_slope
      do h = 1, fourier%n_retained
         n = real(fourier%harmonic(h), wp)
         k = fourier%column(h)
         if (n > 0.0_wp) then
            self%integral(k:k + 1) = -self%integral(k:k + 1)/n**2
         else
            self%integral(k) = angle - self%stick_from
         end if
      end do
      self%integral = self%weight*self%integral
      do c = 1, 2
         do k = 1, size(self%integral)
            self%gradient(:, :, k, c) = self%gradient(:, :, k, c) - &
                                        self%integral(k)*self%dz(:, :, c)
         end do
      end do
   end subroutine close_stick

   !> The force at an angle of the grid, and its derivative for a collocation.
   subroutine sample(self, fourier, place, state)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: place
      type(state_type), intent(in) :: state
      type(instant_type) :: at
      integer :: c

      self%on_grid(:, place) = 0.0_wp
      if (state%phase == phase_open) return
      at = look(self, grid_angle(self, place))
      self%on_grid(:, place) = at%p - state%z
      if (state%phase == phase_slip) self%on_grid(:, place) = at%radius*direction_of(state%v)
      if (.not. (self%deriving .and. self%recording) .or. fourier%projects) return
      call set_waves(self, fourier, at%angle)
      associate (rows => self%rows(:, :, :, self%n_rows + 1))
         if (state%phase == phase_slip) then
            call slip_rows(self, at, state%v, rows)
         else
            rows = -self%dz
            if (.not. self%remembers) rows = 0.0_wp
            do c = 1, 2
               rows(:, c, c) = rows(:, c, c) + self%wave
            end do
         end if
      end associate
      self%projector(:, self%n_rows + 1) = fourier%analysis(:, place)
      call keep_row(self)
   end subroutine sample

   !> Coefficients of the forces from what the last turn has left.
   subroutine collect(self, fourier)
      type(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      integer :: c, h, k

      call self%stick%finish()
      call fill_contact(self)
      self%share = self%share/(2.0_wp*pi)
      associate (n => fourier%n_retained, harmonic => fourier%harmonic, column => fourier%column)
         call self%contact%project(-1.0_wp, self%normal, n, harmonic, column, self%projected(:, 3))
         do c = 1, 2
            call self%held(c)%finish()
            call self%stick%project(1.0_wp, self%tangential(:, :, c), n, harmonic, column, &
                                    self%projected(:, c))
            call self%stick%project(1.0_wp, self%tangential(:, :, c), 1, [0], [1], &
                                    self%mean(c:c))
            self%mean(c) = self%mean(c) - 0.5_wp/pi*self%held(c)%cosine(0)
            do h = 1, n
               k = column(h)
               self%projected(k, c) = self%projected(k, c) - &
                                      self%weight(k)*self%held(c)%cosine(harmonic(h))
               if (harmonic(h) > 0) self%projected(k + 1, c) = self%projected(k + 1, c) - &
                  self%weight(k + 1)*self%held(c)%sine(harmonic(h))
            end do
         end do
      end associate
      self%force = self%projected
      if (fourier%projects) return
      self%force = 0.0_wp
      do k = 1, self%n_grid
         do c = 1, 2
            self%force(:, c) = self%force(:, c) + self%on_grid(c, k)*fourier%analysis(:, k)
         end do
         self%force(:, 3) = self%force(:, 3) + min(-self%values(k), 0.0_wp)*fourier%analysis(:, k)
      end do
   end subroutine collect

   !> Moments of contact: steps at 0, at the roots of N and at 2 pi.
   pure subroutine fill_contact(self)
      type(planar_pair_type), intent(inout) :: self
      integer :: k
      logical :: before

      call self%contact%clear()
      before = .true.
      do k = 1, self%n_knots
         ! Behind the last knot nothing bears.
         if (k == self%n_knots) self%lifted(k) = .true.
         if (self%lifted(k) .neqv. before) then
            call fill_waves(2*self%degree, self%knot(k), self%cosines, self%sines)
            call self%contact%add_step(merge(1.0_wp, -1.0_wp, self%lifted(k)), self%knot(k), &
                                       self%cosines, self%sines)
         end if
         before = self%lifted(k)
      end do
      call self%contact%finish()
   end subroutine fill_contact

   !> Transposed derivative of the forces: (coefficient, component) of the input, then of the
   !> output. The last `follow` must have started from the same x_start.
   subroutine derivative(self, fourier, x_start, jacobian)
      class(planar_pair_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: x_start(2)
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      type(state_type) :: state
      integer :: c, k, n, nc

      nc = fourier%n_coefficients
      allocate (self%gradient(nc, 3, nc, 2), source=0.0_wp)
      allocate (self%rows(nc, 3, 2, buffer_size), self%projector(nc, buffer_size), source=0.0_wp)
      allocate (self%dz(nc, 3, 2), self%dphi(nc, 3), self%integral(nc), source=0.0_wp)
      self%deriving = .true.
      self%n_rows = 0
      call start(self, fourier, x_start, state)
      do k = 1, self%turns
         self%recording = k == self%turns
         call turn(self, fourier, state)
      end do
      call project_rows(self)
      self%deriving = .false.
      call collect(self, fourier)
      jacobian(:, :2*nc) = reshape(self%gradient, [3*nc, 2*nc])
      jacobian(:, 2*nc + 1:) = 0.0_wp
      if (fourier%projects) then
         associate (harmonic => fourier%harmonic, column => fourier%column)
            n = fourier%n_retained
            do c = 1, 2
               associate (from => (c - 1)*nc + 1, to => c*nc)
                  call self%stick%add_gram(1.0_wp, n, harmonic, column, &
                                           jacobian(from:to, from:to))
               end associate
            end do
            call self%contact%add_gram(1.0_wp, n, harmonic, column, &
                                       jacobian(2*nc + 1:, 2*nc + 1:))
         end associate
      else
         do k = 1, self%n_grid
            if (self%values(k) < 0.0_wp) cycle
            do c = 1, nc
               jacobian(2*nc + 1:, 2*nc + c) = jacobian(2*nc + 1:, 2*nc + c) + &
                                               fourier%analysis(c, k)*fourier%synthesis(:, k)
            end do
         end do
      end if
      deallocate (self%gradient, self%rows, self%projector, self%dz, self%dphi, self%integral)
   end subroutine derivative

   !> Coefficients of the forces on any set of harmonics; those that were not computed vanish, being
   !> even ones left out by symmetry, but the means.
   subroutine coefficients(self, fourier, computed, force)
      class(planar_pair_type), intent(inout) :: self
      !> Harmonics wanted, and those of the last evaluation.
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: computed(:)
      !> (n_coefficients, 3).
      real(wp), intent(out) :: force(:, :)
      integer :: h, k, place

      force = 0.0_wp
      k = 1
      do h = 1, size(computed)
         place = findloc(fourier%harmonic, computed(h), dim=1)
         if (place > 0) then
            associate (to => fourier%column(place))
               force(to, :) = self%projected(k, :)
               if (computed(h) > 0) force(to + 1, :) = self%projected(k + 1, :)
            end associate
         end if
         k = k + merge(1, 2, computed(h) == 0)
      end do
      if (.not. fourier%has_constant()) return
      force(1, 1:2) = self%mean
      force(1, 3) = 0.0_wp
      call self%contact%project(-1.0_wp, self%normal, 1, [0], [1], force(:, 3))
   end subroutine coefficients

end module fw_event_planar
