!> The path of one pair with one tangential direction through a period, event by event.
!>
!> The tangential force is T = P - z, |T| <= max(0, Q): a play operator with the bounds
!>
!>   lower = P - Q <= z <= P + Q = upper,    z = P where Q < 0 (open),   Q = mu N,
!>
!> z being the corrected position. The pair slips forward (T = Q) while `lower` pushes z up, and
!> backward (T = -Q) while `upper` pushes it down; slip ends at an extremum of the bound. Between
!> breakpoints - extrema of the bounds and roots of N - both bounds are monotone, so that z after a
!> piece is z before it clamped to the bounds at its end. A composition of clamps is a clamp: one
!> turn to settle and one to record are exact.
!>
!> Bounds are evaluated once for each breakpoint and compared as stored, so that a bound that
!> holds z keeps doing so to the last bit.
!> The order matters: a bound is compared with z at breakpoints only, and the angle where it catches
!> z between two of them is found afterwards. That angle does not enter z, so its round-off does not
!> accumulate along the path.
!>
!> Where side 2 slides, z is carried along with a slope `carry` while the pair sticks. In a frame
!> that goes with it z stands, the bounds are P -+ Q - carry tau, and all of the above holds; slip
!> ends where the slope of P -+ Q passes `carry`. From turn to turn z gains what the frame has moved
!> in one: it is clamped and moved on, which has one limit, found in one turn from far ahead.
module fw_event_path
   use fw_event_curves, only: curves_type
   use fw_event_polynomial, only: value_and_slope
   use fw_event_roots, only: find_roots, root_between
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: path_type
   public :: phase_open, phase_stick, phase_forward, phase_backward

   !> What a pair does along a segment.
   integer, parameter :: phase_open = 1, phase_stick = 2, phase_forward = 3, phase_backward = 4
   !> What a breakpoint is: an end of the period, a root of N, of the lower or the upper function.
   integer, parameter :: at_end = 0, at_lift = 1, at_lower = 2, at_upper = 3
   !> Round-off of a sum of waves relative to the sum of its amplitudes.
   real(wp), parameter :: round_off = 1.0e-15_wp

   type :: path_type
      !> Segments in order; segment j lasts from angle(j) to angle(j + 1), the last to 2 pi.
      integer :: n_segments = 0
      integer, allocatable :: phase(:)
      real(wp), allocatable :: angle(:)
      !> Of sticking segments: z, the angle where z was set, and dz = e.(dP + weight dQ) with the
      !> waves e at that angle. Where `set` is false z is the given start of the march.
      real(wp), allocatable :: z(:), set_at(:), weight(:)
      logical, allocatable :: set(:)
      !> z at the end of the period, and its slope while it is carried along.
      real(wp) :: z_end = 0.0_wp, carry = 0.0_wp
      !> Whether the pair bears throughout, or never; whether z was set at all.
      logical :: closed = .true., open = .false., moved = .false.
      !> Whether the residual traction is given where the pair can stick throughout, and as which
      !> share of what balances, -1 to 1.
      logical :: has_share = .false.
      real(wp) :: share = 0.0_wp
      !> Where it does so: half of the distance between the ends of z, else 0 [force], and the
      !> angles of the lower and the upper one.
      real(wp) :: reach = 0.0_wp, end_at(2) = 0.0_wp
      !> Breakpoints, what they are, and whether the pair is open behind them.
      integer, private :: n_breaks = 0
      integer, allocatable, private :: kind(:)
      real(wp), allocatable, private :: break(:)
      logical, allocatable, private :: lifted(:)
      !> Bounds at the breakpoints, and the weight of a landing there.
      real(wp), allocatable, private :: lower(:), upper(:), landing(:)
   contains
      procedure :: reserve
      procedure :: trace
      procedure :: trace_rates
      procedure :: trace_contact
      procedure, private :: append
   end type path_type

   !> z on the way, with its origin.
   type :: position_type
      real(wp) :: z = 0.0_wp, set_at = 0.0_wp, weight = 0.0_wp
      logical :: set = .false.
   end type position_type

contains

   !> Room for the paths of polynomials of a degree: each of three functions has at most twice as
   !> many roots; each piece between them has at most two segments.
   pure subroutine reserve(self, degree)
      class(path_type), intent(inout) :: self
      integer, intent(in) :: degree
      integer :: n

      ! Three functions with 2 degree roots each, and the two ends of the period.
      n = 6*degree + 2
      allocate (self%kind(n), self%break(n), self%lifted(n))
      allocate (self%lower(n), self%upper(n), self%landing(n))
      ! A stick and a slip in each piece.
      n = 2*n
      allocate (self%phase(n), self%angle(n + 1), self%z(n), self%set_at(n), self%weight(n))
      allocate (self%set(n))
   end subroutine reserve

   !> Follow z from its start through one turn to settle and one to record.
   pure subroutine trace(self, curves, z_start)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(inout) :: curves
      !> Position that the period starts from [force].
      real(wp), intent(in) :: z_start
      type(position_type) :: position
      integer :: k

      call find_contact(self, curves)
      call add_roots(self, curves, at_lower, .true.)
      ! Under a constant load both bounds have their extrema where P has them, in any frame.
      if (.not. curves%steady) call add_roots(self, curves, at_upper, .true.)
      call finish_breaks(self)
      call evaluate_bounds(self, curves)
      self%reach = 0.0_wp
      if (self%has_share .and. self%closed) call hold(self)
      if (self%reach > 0.0_wp) return
      self%moved = .not. self%closed
      position%z = z_start
      self%carry = curves%carry
      if (abs(curves%carry) > 0.0_wp) then
         ! It slips in every turn: from ahead of both bounds friction has always pulled it back.
         self%moved = .true.
         position%z = sign(2.0_wp*curves%scale, curves%carry)
      end if
      ! A given start outside of the bounds is taken to the nearer of them.
      if (.not. self%lifted(1)) call clamp(self, 1, position)
      do k = 1, self%n_breaks - 1
         if (self%lifted(k)) then
            call let_go(self, k + 1, position)
         else
            call clamp(self, k + 1, position)
         end if
      end do
      ! The turn to settle has left z where the period starts: the same turn once more is recorded.
      position%z = position%z + 2.0_wp*pi*curves%carry
      self%n_segments = 0
      do k = 1, self%n_breaks - 1
         call record(self, curves, k, position)
      end do
      self%angle(self%n_segments + 1) = 2.0_wp*pi
      self%z_end = position%z + 2.0_wp*pi*curves%carry
   end subroutine trace

   !> Stick throughout, where the bounds leave a z: it is between the highest point of the lower
   !> bound and the lowest of the upper one, which are among the breakpoints.
   pure subroutine hold(self)
      class(path_type), intent(inout) :: self
      type(position_type) :: position
      integer :: a, b

      a = maxloc(self%lower(:self%n_breaks), dim=1)
      b = minloc(self%upper(:self%n_breaks), dim=1)
      if (.not. self%lower(a) < self%upper(b)) return
      self%reach = 0.5_wp*(self%upper(b) - self%lower(a))
      self%end_at = [self%break(a), self%break(b)]
      position%z = 0.5_wp*(1.0_wp - self%share)*self%lower(a) + &
                   0.5_wp*(1.0_wp + self%share)*self%upper(b)
      position%set = .true.
      ! z follows from the inputs: no identity as of pairs that stay where they started.
      self%moved = .true.
      self%n_segments = 0
      call self%append(0.0_wp, phase_stick, position)
      self%angle(2) = 2.0_wp*pi
      self%z_end = position%z
   end subroutine hold

   !> Open at a breakpoint: z goes with P. Where the pair lands there, z is P at a root of Q, which
   !> moves by -dQ/Q'.
   pure subroutine let_go(self, k, position)
      type(path_type), intent(inout) :: self
      integer, intent(in) :: k
      type(position_type), intent(inout) :: position

      ! Both bounds are P there.
      position = position_type(self%lower(k), self%break(k), self%landing(k), .true.)
   end subroutine let_go

   !> Take z between the bounds at a breakpoint.
   pure subroutine clamp(self, k, position)
      type(path_type), intent(inout) :: self
      integer, intent(in) :: k
      type(position_type), intent(inout) :: position

      ! Strictly: a bound that holds z already must not count as a new event.
      if (self%lower(k) > position%z) then
         position = position_type(self%lower(k), self%break(k), -1.0_wp, .true.)
         self%moved = .true.
      else if (self%upper(k) < position%z) then
         position = position_type(self%upper(k), self%break(k), 1.0_wp, .true.)
         self%moved = .true.
      end if
   end subroutine clamp

   !> The segments between breakpoint k and the next.
   pure subroutine record(self, curves, k, position)
      type(path_type), intent(inout) :: self
      type(curves_type), intent(in) :: curves
      integer, intent(in) :: k
      type(position_type), intent(inout) :: position
      real(wp) :: angle

      if (self%lifted(k)) then
         call self%append(self%break(k), phase_open, position)
         call let_go(self, k + 1, position)
      else if (self%lower(k + 1) > position%z) then
         angle = catch_angle(curves, curves%lower, self%break(k), self%break(k + 1), &
                             self%lower(k) - position%z, self%lower(k + 1) - position%z, position%z)
         ! Caught at the breakpoint itself, there is no stick before.
         if (angle > self%break(k)) call self%append(self%break(k), phase_stick, position)
         call self%append(angle, phase_forward, position)
         call clamp(self, k + 1, position)
      else if (self%upper(k + 1) < position%z) then
         angle = catch_angle(curves, curves%upper, self%break(k), self%break(k + 1), &
                             self%upper(k) - position%z, self%upper(k + 1) - position%z, position%z)
         if (angle > self%break(k)) call self%append(self%break(k), phase_stick, position)
         call self%append(angle, phase_backward, position)
         call clamp(self, k + 1, position)
      else
         call self%append(self%break(k), phase_stick, position)
      end if
   end subroutine record

   !> Where a bound that is monotone between two breakpoints catches z.
   pure real(wp) function catch_angle(curves, bound, left, right, at_left, at_right, z) &
      result(angle)
      type(curves_type), intent(in) :: curves
      real(wp), intent(in) :: bound(0:curves%degree, 2)
      !> Breakpoints, the bound less z there, and z.
      real(wp), intent(in) :: left, right, at_left, at_right, z

      angle = left
      ! The bound holds z already; or round-off has put it past.
      if (at_left*at_right >= 0.0_wp) return
      angle = root_between(curves%degree, bound, z, left, right, at_left, at_right, &
                           round_off*curves%scale, curves%carry)
   end function catch_angle

   !> Add a segment, or continue the last one.
   pure subroutine append(self, angle, phase, position)
      class(path_type), intent(inout) :: self
      real(wp), intent(in) :: angle
      integer, intent(in) :: phase
      type(position_type), intent(in) :: position
      integer :: n

      n = self%n_segments
      if (n > 0) then
         ! Breakpoints of the other bound split no slip; a stick goes on where its z was set at one
         ! angle.
         if (self%phase(n) == phase) then
            if (phase /= phase_stick) return
            if (self%set_at(n) >= position%set_at .and. self%set_at(n) <= position%set_at) return
         end if
      end if
      n = n + 1
      self%n_segments = n
      self%phase(n) = phase
      self%angle(n) = angle
      self%z(n) = position%z
      self%set_at(n) = position%set_at
      self%weight(n) = position%weight
      self%set(n) = position%set
   end subroutine append

   !> The velocity-level law, without memory: T = P clamped to -Q..Q.
   pure subroutine trace_rates(self, curves)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(inout) :: curves
      logical :: above, below
      integer :: k, phase

      call find_contact(self, curves)
      call add_roots(self, curves, at_lower, .false.)
      ! State at tau = 0, from where each root turns it over: sign conventions as in find_roots.
      above = curves%values(1) >= 0.0_wp
      call add_roots(self, curves, at_upper, .false.)
      below = curves%values(1) < 0.0_wp
      call finish_breaks(self)
      self%moved = .not. self%closed
      self%n_segments = 0
      do k = 1, self%n_breaks - 1
         if (self%kind(k) == at_lower) above = .not. above
         if (self%kind(k) == at_upper) below = .not. below
         phase = phase_stick
         ! P > Q and P < -Q at once means Q < 0, which is open.
         if (above) phase = phase_forward
         if (below) phase = phase_backward
         if (phase /= phase_stick) self%moved = .true.
         if (self%lifted(k)) phase = phase_open
         call self%append(self%break(k), phase, position_type())
      end do
      self%angle(self%n_segments + 1) = 2.0_wp*pi
   end subroutine trace_rates

   !> Contact alone, where nothing rubs: closed segments count as stick.
   pure subroutine trace_contact(self, curves)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(inout) :: curves
      integer :: k

      call find_contact(self, curves)
      call finish_breaks(self)
      self%moved = .not. self%closed
      self%n_segments = 0
      do k = 1, self%n_breaks - 1
         call self%append(self%break(k), merge(phase_open, phase_stick, self%lifted(k)), &
                          position_type())
      end do
      self%angle(self%n_segments + 1) = 2.0_wp*pi
   end subroutine trace_contact

   !> Start the list of breakpoints with the roots of N.
   pure subroutine find_contact(self, curves)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(in) :: curves
      integer :: n

      self%n_breaks = 1
      self%break(1) = 0.0_wp
      self%kind(1) = at_end
      if (curves%steady) then
         ! No pressure at all, not even an infinitesimal one, counts as open.
         self%lifted(1) = curves%normal(0, 1) <= 0.0_wp
      else
         n = 1
         call find_roots(curves%n_grid, curves%degree, curves%normal, curves%samples(:, 4), &
                         curves%samples(:, 5), sum(abs(curves%normal)), n, self%break)
         self%kind(2:n) = at_lift
         self%n_breaks = n
         self%lifted(1) = curves%samples(1, 4) < 0.0_wp
      end if
      self%closed = self%n_breaks == 1 .and. .not. self%lifted(1)
      self%open = self%n_breaks == 1 .and. self%lifted(1)
   end subroutine find_contact

   !> Add the roots of a bound, or its extrema.
   pure subroutine add_roots(self, curves, kind, of_derivative)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(inout) :: curves
      !> at_lower or at_upper.
      integer, intent(in) :: kind
      logical, intent(in) :: of_derivative
      integer :: n

      call curves%sample_bound(merge(-1.0_wp, 1.0_wp, kind == at_lower), of_derivative)
      n = self%n_breaks
      associate (values => curves%values, slopes => curves%slopes)
         if (of_derivative .and. kind == at_lower) then
            call find_roots(curves%n_grid, curves%degree, curves%lower_slope, values, slopes, &
                            curves%scale, n, self%break)
         else if (of_derivative) then
            call find_roots(curves%n_grid, curves%degree, curves%upper_slope, values, slopes, &
                            curves%scale, n, self%break)
         else if (kind == at_lower) then
            call find_roots(curves%n_grid, curves%degree, curves%lower, values, slopes, &
                            curves%scale, n, self%break)
         else
            call find_roots(curves%n_grid, curves%degree, curves%upper, values, slopes, &
                            curves%scale, n, self%break)
         end if
      end associate
      self%kind(self%n_breaks + 1:n) = kind
      self%n_breaks = n
   end subroutine add_roots

   !> Sort the breakpoints, add the end of the period, and mark where the pair is open: every root
   !> of N is a change of its sign.
   pure subroutine finish_breaks(self)
      class(path_type), intent(inout) :: self
      real(wp) :: angle
      integer :: k, j, kind

      ! Insertion: the roots of each function are in order already, and few.
      do k = 2, self%n_breaks
         angle = self%break(k)
         kind = self%kind(k)
         do j = k - 1, 1, -1
            if (self%break(j) <= angle) exit
            self%break(j + 1) = self%break(j)
            self%kind(j + 1) = self%kind(j)
         end do
         self%break(j + 1) = angle
         self%kind(j + 1) = kind
      end do
      self%n_breaks = self%n_breaks + 1
      self%break(self%n_breaks) = 2.0_wp*pi
      self%kind(self%n_breaks) = at_end
      do k = 2, self%n_breaks
         self%lifted(k) = self%lifted(k - 1) .neqv. self%kind(k) == at_lift
      end do
   end subroutine finish_breaks

   !> Both bounds at every breakpoint; where N = 0 they are P to the last bit.
   pure subroutine evaluate_bounds(self, curves)
      class(path_type), intent(inout) :: self
      type(curves_type), intent(in) :: curves
      real(wp) :: p, dp, n, dn
      integer :: k

      do k = 1, self%n_breaks - 1
         call value_and_slope(curves%degree, curves%tangential, self%break(k), p, dp)
         call value_and_slope(curves%degree, curves%normal, self%break(k), n, dn)
         self%landing(k) = 0.0_wp
         if (self%kind(k) == at_lift .and. abs(dn) > 0.0_wp) then
            ! Without friction nothing sticks, and z has no use for its derivative.
            if (curves%mu > 0.0_wp) self%landing(k) = -(dp - curves%carry)/(curves%mu*dn)
            ! N = 0 to the last bit at its root, so that both bounds are the same number there.
            n = 0.0_wp
         else if (self%lifted(k)) then
            n = 0.0_wp
         end if
         p = p - curves%carry*self%break(k)
         self%lower(k) = p - curves%mu*n
         self%upper(k) = p + curves%mu*n
      end do
      ! The end of the period is its start to the last bit, but for what the frame has moved: z
      ! repeats exactly.
      self%lower(self%n_breaks) = self%lower(1) - 2.0_wp*pi*curves%carry
      self%upper(self%n_breaks) = self%upper(1) - 2.0_wp*pi*curves%carry
      self%landing(self%n_breaks) = 0.0_wp
   end subroutine evaluate_bounds

end module fw_event_path
