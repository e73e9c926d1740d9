!> One period of a mass under dry friction, from event to event:
!>
!>   m x'' + c x' + k x + lambda = P(tau),   lambda in Q Sgn(x'),   lambda = 0 where Q < 0 (open).
!>
!> In slip and where open, x is the answer to P - Q, P + Q or P plus a free part in closed form; it
!> slips until x' = 0. There it sticks if |P - k x| <= Q and turns round if not. Stick ends where
!> P - k x leaves -Q..Q. Angles where Q changes its sign are given.
module fw_oscillator_turn
   use fw_event_path, only: phase_backward, phase_forward, phase_open, phase_stick
   use fw_event_polynomial, only: value_and_slope
   use fw_kinds, only: pi, wp
   use fw_oscillator, only: oscillator_type
   use fw_oscillator_search, only: first_root, motion_type, wave_type
   implicit none (type, external)
   private

   public :: turn_type, side_of, newton_step
   public :: waves_type

   !> What drives the mass.
   type :: waves_type
      type(oscillator_type) :: oscillator
      !> Answers without a free part to P + Q, P and P - Q: position (0:degree, cosine and sine,
      !> -1:1), and velocity.
      real(wp), allocatable :: position(:, :, :)
      type(wave_type) :: rate(-1:1)
      !> P - Q (forward) and P + Q (backward).
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(wave_type), allocatable :: lower, upper
      !> Angles at which Q changes its sign, ascending, and whether it is below zero at 0.
      integer :: n_lifts = 0
      real(wp), allocatable :: lift(:)
      logical :: starts_open = .false.
   end type waves_type

   type :: turn_type
      !> Segments: segment j lasts from angle(j) to angle(j + 1), the last to 2 pi.
      integer :: n_segments = 0
      integer, allocatable :: phase(:)
      real(wp), allocatable :: angle(:)
      !> X where a segment begins, and its free part there (2, segment).
      real(wp), allocatable :: x(:, :), free(:, :)
      !> Acceleration before and behind the stop in which a segment begins; 0 before where it begins
      !> otherwise.
      real(wp), allocatable :: before(:), behind(:)
      !> X at the end of the period, and its derivative by that at the start.
      real(wp) :: last(2) = 0.0_wp, monodromy(2, 2) = 0.0_wp
      !> False: there were more events than there is room for.
      logical :: complete = .true.
   contains
      procedure :: reserve
      procedure :: run
   end type turn_type

   !> Least angle behind the start of a slip at which its end is looked for: a shorter one cannot be
   !> told from none.
   real(wp), parameter :: least_slip = 1.0e-9_wp

contains

   !> Room for the events of polynomials of a degree and of some ringing.
   pure subroutine reserve(self, degree)
      class(turn_type), intent(inout) :: self
      integer, intent(in) :: degree
      integer :: n

      ! A light mass may ring between two switches: many more stops than roots of the bounds.
      n = 64*(degree + 4)
      allocate (self%phase(n), self%angle(n + 1), self%x(2, n), self%free(2, n))
      allocate (self%before(n), self%behind(n))
   end subroutine reserve

   !> Sign of the velocity of a phase; 0 where it is open or stuck.
   elemental integer function side_of(phase)
      integer, intent(in) :: phase

      side_of = 0
      if (phase == phase_forward) side_of = 1
      if (phase == phase_backward) side_of = -1
   end function side_of

   !> Follow the mass from X at 0.
   pure subroutine run(self, waves, start)
      class(turn_type), intent(inout) :: self
      type(waves_type), intent(in) :: waves
      !> X = (x, dx/dtau) at tau = 0.
      real(wp), intent(in) :: start(2)
      real(wp) :: x(2), angle, upto, before, behind
      integer :: phase, lift
      logical :: open

      self%n_segments = 0
      self%complete = .true.
      ! dX by dX(0), carried from event to event (saltation at stops).
      self%monodromy = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      x = start
      angle = 0.0_wp
      lift = 0
      before = 0.0_wp
      behind = 0.0_wp
      open = waves%starts_open
      phase = phase_at(waves, open, angle, x)
      do
         upto = 2.0_wp*pi
         ! Up to the next change of sign of Q at most; the end of the period is the last one.
         if (lift < waves%n_lifts) upto = waves%lift(lift + 1)
         if (self%n_segments == size(self%phase)) then
            self%complete = .false.
            exit
         end if
         call append(self, waves, phase, angle, x, before, behind)
         if (phase == phase_stick) then
            ! Stick has no velocity to vary.
            self%monodromy(2, :) = 0.0_wp
            call stick(waves, upto, angle, x, phase, before, behind)
         else
            call slide(self, waves, upto, angle, x, phase, before, behind)
         end if
         ! A stop or the end of a stick; phase is that behind it.
         if (angle < upto) cycle
         if (upto >= 2.0_wp*pi) exit
         lift = lift + 1
         open = .not. open
         phase = phase_at(waves, open, angle, x)
      end do
      self%angle(self%n_segments + 1) = 2.0_wp*pi
      self%last = x
   end subroutine run

   !> What a mass does from X on.
   pure integer function phase_at(waves, open, angle, x) result(phase)
      type(waves_type), intent(in) :: waves
      logical, intent(in) :: open
      real(wp), intent(in) :: angle, x(2)
      real(wp) :: low, high, slope

      if (open) then
         phase = phase_open
      else if (x(2) > 0.0_wp) then
         phase = phase_forward
      else if (x(2) < 0.0_wp) then
         phase = phase_backward
      else
         call waves%lower%at(angle, low, slope)
         call waves%upper%at(angle, high, slope)
         phase = phase_stick
         ! At rest outside of P -+ Q: it starts in the direction of the larger force.
         if (waves%oscillator%k*x(1) < low) phase = phase_forward
         if (waves%oscillator%k*x(1) > high) phase = phase_backward
      end if
   end function phase_at

   !> Begin a segment; its free part is what the motion has beyond the driven one there.
   pure subroutine append(self, waves, phase, angle, x, before, behind)
      type(turn_type), intent(inout) :: self
      type(waves_type), intent(in) :: waves
      integer, intent(in) :: phase
      real(wp), intent(in) :: angle, x(2), before, behind
      real(wp) :: driven(2)
      integer :: n

      n = self%n_segments + 1
      self%n_segments = n
      self%phase(n) = phase
      self%angle(n) = angle
      self%x(:, n) = x
      self%free(:, n) = 0.0_wp
      self%before(n) = before
      self%behind(n) = behind
      if (phase == phase_stick) return
      call driven_at(waves, side_of(phase), angle, driven)
      self%free(:, n) = x - driven
   end subroutine append

   !> X of the answer without a free part.
   pure subroutine driven_at(waves, side, angle, x)
      type(waves_type), intent(in) :: waves
      integer, intent(in) :: side
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: x(2)

      call value_and_slope(waves%lower%degree, waves%position(:, :, side), angle, x(1), x(2))
   end subroutine driven_at

   !> Slip, or fly, up to a stop or an angle.
   pure subroutine slide(self, waves, upto, angle, x, phase, before, behind)
      type(turn_type), intent(inout) :: self
      type(waves_type), intent(in) :: waves
      real(wp), intent(in) :: upto
      real(wp), intent(inout) :: angle, x(2)
      integer, intent(inout) :: phase
      real(wp), intent(out) :: before, behind
      type(motion_type) :: motion
      real(wp) :: phi(2, 2), driven(2), to
      logical :: stops
      integer :: side

      before = 0.0_wp
      behind = 0.0_wp
      side = side_of(phase)
      motion = motion_type(is_free=.true., start=angle, x=self%free(:, self%n_segments), &
                           oscillator=waves%oscillator)
      stops = .false.
      to = upto
      ! Nothing stops a mass that flies.
      if (phase /= phase_open) then
         call first_root(waves%rate(side), motion, search_start(waves, motion, side, angle, x), &
                         upto, real(side, wp), stops, to)
      end if
      call waves%oscillator%propagate(to - angle, phi)
      call driven_at(waves, side, to, driven)
      ! In closed form from where the segment began: no error accumulates within it.
      x = driven + matmul_2(phi, motion%x)
      call turn_on(self, phi)
      angle = to
      if (stops) call stop_at(self, waves, angle, x, phase, before, behind)
   end subroutine slide

   !> Where a slip that starts from rest surely goes on: with a and a' where it starts, x' is above
   !> (a + a' t/2 - M t**2/6) t, M the bound of the third derivative.
   pure real(wp) function search_start(waves, motion, side, angle, x) result(from)
      type(waves_type), intent(in) :: waves
      type(motion_type), intent(in) :: motion
      integer, intent(in) :: side
      real(wp), intent(in) :: angle, x(2)
      real(wp) :: a, b, force, slope, third, fourth, root

      from = angle
      ! Moving already: the first zero of x' is a stop.
      if (abs(x(2)) > 0.0_wp) return
      if (side > 0) then
         call waves%lower%at(angle, force, slope)
      else
         call waves%upper%at(angle, force, slope)
      end if
      associate (o => waves%oscillator)
         a = (force - o%k*x(1))/o%m
         ! m x''' + c x'' + k x' = slope, with x' = 0.
         b = (slope - o%c*a)/o%m
         call o%bound(motion%x, third, fourth)
      end associate
      third = third + waves%rate(side)%bounds%third
      a = max(side*a, 0.0_wp)
      b = side*b
      ! Half the positive root of a + b t/2 - M t**2/6 is taken, with a and b times the side.
      root = sqrt(0.25_wp*b**2 + 2.0_wp/3.0_wp*third*a)
      from = angle
      if (third > 0.0_wp) from = angle + 0.5_wp*max(0.5_wp*b + root, 0.0_wp)*3.0_wp/third
      from = max(from, angle + least_slip)
   end function search_start

   !> Stick or turn round where x' = 0.
   pure subroutine stop_at(self, waves, angle, x, phase, before, behind)
      type(turn_type), intent(inout) :: self
      type(waves_type), intent(in) :: waves
      real(wp), intent(in) :: angle
      real(wp), intent(inout) :: x(2)
      integer, intent(inout) :: phase
      real(wp), intent(out) :: before, behind
      real(wp) :: forward, backward, slope

      ! Exactly, or round-off would start the next slip in the wrong direction.
      x(2) = 0.0_wp
      call waves%lower%at(angle, forward, slope)
      call waves%upper%at(angle, backward, slope)
      associate (o => waves%oscillator)
         forward = (forward - o%k*x(1))/o%m
         backward = (backward - o%k*x(1))/o%m
      end associate
      before = merge(forward, backward, phase == phase_forward)
      behind = 0.0_wp
      ! Neither direction accelerates: friction holds it.
      if (forward <= 0.0_wp .and. backward >= 0.0_wp) then
         phase = phase_stick
      else
         phase = merge(phase_forward, phase_backward, forward > 0.0_wp)
         behind = merge(forward, backward, phase == phase_forward)
      end if
      ! The saltation of a stop: d tau = -dx'/a-, behind which dx' = a+ d tau turned round.
      if (abs(before) > 0.0_wp) then
         self%monodromy(2, :) = behind/before*self%monodromy(2, :)
      else
         self%monodromy(2, :) = 0.0_wp
      end if
   end subroutine stop_at

   !> Stick up to its end or an angle.
   pure subroutine stick(waves, upto, angle, x, phase, before, behind)
      type(waves_type), intent(in) :: waves
      real(wp), intent(in) :: upto, x(2)
      real(wp), intent(inout) :: angle
      integer, intent(inout) :: phase
      real(wp), intent(out) :: before, behind
      type(motion_type) :: motion
      real(wp) :: to, root
      logical :: found

      before = 0.0_wp
      behind = 0.0_wp
      ! k x between P - Q and P + Q holds; the earlier of both ends counts.
      motion%level = waves%oscillator%k*x(1)
      to = upto
      call first_root(waves%lower, motion, angle, to, -1.0_wp, found, root)
      if (found) phase = phase_forward
      to = root
      call first_root(waves%upper, motion, angle, to, 1.0_wp, found, root)
      if (found) phase = phase_backward
      angle = root
   end subroutine stick

   !> monodromy = phi monodromy.
   pure subroutine turn_on(self, phi)
      type(turn_type), intent(inout) :: self
      real(wp), intent(in) :: phi(2, 2)
      integer :: j

      do j = 1, 2
         self%monodromy(:, j) = matmul_2(phi, self%monodromy(:, j))
      end do
   end subroutine turn_on

   !> (1 - M)^-1 defect.
   pure subroutine newton_step(m, defect, step, singular)
      real(wp), intent(in) :: m(2, 2), defect(2)
      real(wp), intent(out) :: step(2)
      logical, intent(out) :: singular
      real(wp) :: determinant, size_of_matrix
      real(wp), parameter :: round_off = 1.0e-13_wp

      determinant = (1.0_wp - m(1, 1))*(1.0_wp - m(2, 2)) - m(1, 2)*m(2, 1)
      size_of_matrix = 1.0_wp + maxval(abs(m))
      step = 0.0_wp
      ! A held pair has M with eigenvalue 1: any position repeats.
      singular = abs(determinant) <= round_off*size_of_matrix**2
      if (singular) return
      step(1) = ((1.0_wp - m(2, 2))*defect(1) + m(1, 2)*defect(2))/determinant
      step(2) = (m(2, 1)*defect(1) + (1.0_wp - m(1, 1))*defect(2))/determinant
   end subroutine newton_step

   !> a x of two by two, without the call of the library: it stands in the innermost loop.
   pure function matmul_2(a, x) result(product)
      real(wp), intent(in) :: a(2, 2), x(2)
      real(wp) :: product(2)

      product = a(:, 1)*x(1) + a(:, 2)*x(2)
   end function matmul_2

end module fw_oscillator_turn
