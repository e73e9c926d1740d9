!> Contact force of one pair with two tangential directions, event by event: the path of
!> fw_event_planar_path, marched until it repeats, its integrals and their derivative.
!>
!> A limit that does not depend on the start is found by Newton's method on the map of a turn
!> (fw_settling), and has a derivative of its own. Any other is where plain turns from the start
!> lead, and carries the derivative of the way to it.
!> With x = z at tau = 0, T(x) its value after a turn and M = dT/dx, the two derivatives by inputs p
!> are dx/dp = (I - M)^-1 dT/dp of a unique limit, and M dx/dp + dT/dp carried from turn to turn
!> otherwise.
module fw_event_planar
   use fw_event_cells, only: cells_type
   use fw_event_motion, only: motion_type
   use fw_event_planar_derivative, only: new_derivative, planar_derivative_type
   use fw_event_planar_force, only: planar_force_type
   use fw_event_planar_path, only: planar_path_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_settling, only: invert, period_map, periodic_tolerance, settle, shakedown_turns
   implicit none (type, external)
   private

   public :: planar_pair_type

   !> Slip for less than this angle in a period is what the tolerance of the march leaves of none.
   ! M is all but the identity then, and (I - M)^-1 round-off.
   real(wp), parameter :: brief = 1.0e-3_wp

   !> A turn of one pair.
   type, extends(period_map) :: planar_map
      !> Predicted forces of the pair, and its path through the last turn.
      type(motion_type) :: motion
      type(planar_path_type) :: path
      ! Set while a procedure of the pair runs, so that a turn needs no argument for it.
      type(cells_type), pointer :: cells => null()
      !> The last turn: where it went from and to, and its derivative.
      real(wp) :: from(2) = 0.0_wp, to(2) = 0.0_wp, m(2, 2) = 0.0_wp
   contains
      procedure :: turn
   end type planar_map

   type :: planar_pair_type
      !> The map of a turn, and the integrals along the last one.
      type(planar_map), private :: map
      type(planar_force_type), private :: integral
      !> Results: coefficients (n_coefficients, 3), z at the end, and its change over the last turn.
      real(wp), allocatable :: force(:, :)
      real(wp) :: z_end(2) = 0.0_wp, drift = 0.0_wp
      !> Whether it bears throughout, or never; whether it ever slipped or opened.
      logical :: closed = .true., open = .false., moved = .false.
      !> Of a pair without memory: whether it has come to rest.
      logical, private :: rests = .false.
      !> Whether the law of the pair has memory.
      logical :: remembers = .true.
      !> Turns that count in the derivative.
      integer, private :: turns = 0
   contains
      procedure :: reserve
      procedure :: follow
      procedure :: follow_to_rest
      procedure :: derivative
      procedure :: coefficients
      procedure :: sample
      procedure :: share
      procedure :: friction_path
      procedure :: take_friction
      procedure :: take_drift
   end type planar_pair_type

contains

   !> Room for a pair.
   pure subroutine reserve(self, cells, mu, remembers)
      class(planar_pair_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: mu
      logical, intent(in) :: remembers

      call self%map%motion%reserve(cells)
      call self%map%path%reserve(cells)
      call self%integral%reserve(cells)
      self%map%motion%mu = mu
      self%map%motion%remembers = remembers
      self%remembers = remembers
      allocate (self%force(cells%n_coefficients, 3), source=0.0_wp)
   end subroutine reserve

   !> Friction that has changed since.
   pure subroutine take_friction(self, mu)
      class(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: mu

      self%map%motion%mu = mu
   end subroutine take_friction

   !> What side 2 takes the anchors along in an angle of 1 [force].
   pure subroutine take_drift(self, drift)
      class(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: drift(2)

      self%map%motion%drift = drift
   end subroutine take_drift

   !> A turn of period_map: the path from x [force], where it ends, and the derivative of that.
   subroutine turn(self, x, after, m)
      class(planar_map), intent(inout) :: self
      real(wp), intent(in) :: x(2)
      real(wp), intent(out) :: after(2), m(2, 2)

      call self%path%turn(self%motion, self%cells, x, after, m)
      self%from = x
      self%to = after
      self%m = m
   end subroutine turn

   !> March from x_start until the position repeats; forces of the last turn.
   subroutine follow(self, cells, fourier, prediction, offset, x_start, rate)
      class(planar_pair_type), intent(inout) :: self
      type(cells_type), intent(in), target :: cells
      type(fourier_type), intent(in) :: fourier
      !> Coefficients of P_x, P_y and y_n (3, n_coefficients), and what y_n has in the mean beside.
      real(wp), intent(in) :: prediction(:, :), offset
      real(wp), intent(in) :: x_start(2)
      !> At velocity level: the rate of side 2, which that of the pair is measured against.
      real(wp), intent(in), optional :: rate(2)

      self%rests = .false.
      self%map%motion%remembers = self%remembers
      self%map%cells => cells
      ! Knots and rotations depend on the prediction alone: made once, they serve all turns.
      if (present(rate)) then
         call self%map%motion%fill(cells, prediction, offset, -rate)
      else
         call self%map%motion%fill(cells, prediction, offset)
      end if
      call self%map%path%find_knots(self%map%motion, cells)
      self%closed = self%map%path%closed
      self%open = self%map%path%open
      if (self%map%motion%is_carried()) then
         call march_along(self)
      else
         call march(self, x_start)
      end if
      call self%integral%integrate(self%map%path, self%map%motion, cells)
      self%force = self%integral%projected
      if (.not. fourier%projects) call fit(self, cells, fourier)
      nullify (self%map%cells)
   end subroutine follow

   !> As `follow` of a pair without memory, which is led to where it comes to rest as if it had
   !> one; `rests` is false, and nothing has been followed, where it slips in every period.
   subroutine follow_to_rest(self, cells, fourier, prediction, offset, x_start, mean, rests)
      class(planar_pair_type), intent(inout) :: self
      type(cells_type), intent(in), target :: cells
      type(fourier_type), intent(in) :: fourier
      !> As follow, and what the mean position adds to P.
      real(wp), intent(in) :: prediction(:, :), offset, x_start(2), mean(2)
      logical, intent(out) :: rests

      rests = .false.
      call self%map%motion%fill(cells, prediction, offset)
      if (.not. self%map%motion%can_rest()) return
      self%map%cells => cells
      self%map%motion%remembers = .true.
      call self%map%motion%fill(cells, prediction, offset, mean)
      call self%map%path%find_knots(self%map%motion, cells)
      self%closed = self%map%path%closed
      self%open = self%map%path%open
      if (self%closed) then
         call march(self, x_start)
         rests = self%map%path%slip_angle() <= brief
      end if
      self%rests = rests
      if (rests) then
         call self%integral%integrate(self%map%path, self%map%motion, cells)
         self%force = self%integral%projected
         if (.not. fourier%projects) call fit(self, cells, fourier)
      end if
      nullify (self%map%cells)
   end subroutine follow_to_rest

   !> March to the limit; the last turn counts. Newton's method comes first: a limit that does not
   !> depend on the start is the same whatever the way to it. Where there is none such, plain turns
   !> decide.
   subroutine march(self, x_start)
      class(planar_pair_type), intent(inout) :: self
      real(wp), intent(in) :: x_start(2)
      real(wp) :: x(2), after(2), first(2), m(2, 2), inverse(2, 2)
      logical :: settled, unique

      self%moved = .not. self%closed
      associate (map => self%map, scale => self%map%motion%scale)
         ! A pair that sticks or is led to the same place repeats at once, and needs no more.
         call map%turn(x_start, after, m)
         self%moved = self%moved .or. map%path%slips
         self%turns = 1
         if (map%motion%remembers .and. &
             maxval(abs(after - x_start)) > periodic_tolerance*scale) then
            x = after
            first = after
            ! x is anywhere now; only a unique limit may be taken from there.
            call settle(map, scale, periodic_tolerance, x, settled)
            call invert(map%m, inverse, unique)
            ! A pair that slips in its limit has but one.
            unique = unique .and. (map%path%lands .or. map%path%slip_angle() > brief)
            if (.not. (settled .and. unique)) call march_plainly(self, first)
         end if
         self%z_end = map%to
         self%drift = 0.0_wp
         if (map%motion%remembers) self%drift = maxval(abs(map%to - map%from))
      end associate
   end subroutine march

   !> A pair whose anchor is carried along has one limit, since it cannot stick for ever. It is
   !> looked for from an anchor far ahead, where friction has always pulled it back.
   subroutine march_along(self)
      class(planar_pair_type), intent(inout) :: self
      real(wp) :: x(2), after(2), m(2, 2), scale
      logical :: settled

      self%moved = .true.
      self%turns = 1
      associate (map => self%map, motion => self%map%motion)
         scale = motion%scale + motion%largest_radius
         x = 2.0_wp*scale*motion%drift/norm2(motion%drift)
         call map%turn(x, after, m)
         x = after
         call settle(map, motion%scale, periodic_tolerance, x, settled)
         self%z_end = map%to
         self%drift = maxval(abs(map%to - map%from))
      end associate
   end subroutine march_along

   !> Plain turns behind the first one; Newton's method where they creep.
   subroutine march_plainly(self, first)
      class(planar_pair_type), intent(inout) :: self
      !> Where the first turn has led.
      real(wp), intent(in) :: first(2)
      real(wp) :: x(2), after(2), m(2, 2)
      logical :: settled

      x = first
      self%turns = 2
      associate (map => self%map, scale => self%map%motion%scale)
         do
            call map%turn(x, after, m)
            if (maxval(abs(after - x)) <= periodic_tolerance*scale) return
            x = after
            ! Enough: it creeps. What is left of the way is taken by Newton's method.
            if (self%turns == shakedown_turns) exit
            self%turns = self%turns + 1
         end do
         call settle(map, scale, periodic_tolerance, x, settled)
         if (.not. settled) call map%turn(x, after, m)
      end associate
   end subroutine march_plainly

   !> Coefficients that fit the forces at the instants of the collocation.
   subroutine fit(self, cells, fourier)
      class(planar_pair_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      type(fourier_type), intent(in) :: fourier
      real(wp) :: values(3, fourier%n_time)

      call self%sample(cells, values)
      call dgemm('N', 'T', fourier%n_coefficients, 3, fourier%n_time, 1.0_wp, fourier%analysis, &
                 fourier%n_coefficients, values, 3, 0.0_wp, self%force, fourier%n_coefficients)
   end subroutine fit

   !> Forces at uniform instants (3, number of them).
   subroutine sample(self, cells, values)
      class(planar_pair_type), intent(in) :: self
      type(cells_type), intent(in) :: cells
      real(wp), intent(out) :: values(:, :)

      call self%integral%sample(self%map%path, self%map%motion, cells, values)
   end subroutine sample

   !> Transposed derivative of the forces - (coefficient, component) of the input, then of the
   !> output - and that of the friction path. The last `follow` must have started from the same
   !> x_start.
   subroutine derivative(self, cells, fourier, x_start, measures, jacobian, by_path)
      class(planar_pair_type), intent(inout) :: self
      type(cells_type), intent(in), target :: cells
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: x_start(2)
      !> The friction path is wanted.
      logical, intent(in) :: measures
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      !> (3 n_coefficients).
      real(wp), intent(inout) :: by_path(:)
      type(planar_derivative_type) :: derivatives
      real(wp) :: inverse(2, 2), x(2), after(2), m(2, 2)
      logical :: unique
      integer :: k, n, nc

      nc = cells%n_coefficients
      n = 3*nc
      derivatives = new_derivative(cells, measures)
      call invert(self%map%m, inverse, unique)
      if (.not. unique) then
         self%map%cells => cells
         x = x_start
         ! One that is carried along starts where its limit does.
         if (self%map%motion%is_carried()) x = self%map%from
         ! The turns of the march once more, with the derivatives carried along: they were not known
         ! to be wanted then, and cost far more than a turn.
         do k = 1, self%turns - 1
            call self%map%turn(x, after, m)
            call derivatives%carry(self%map%path, self%map%motion, cells)
            x = after
         end do
         call self%map%turn(x, after, m)
         nullify (self%map%cells)
      end if
      call derivatives%accumulate(self%map%path, self%map%motion, cells, fourier)
      associate (gradient => derivatives%gradient)
         ! Gradient by inputs plus that by the start times dx/dp; the last two rows are the start.
         if (unique) call dgemm('N', 'N', n, 2*nc + 1, 2, 1.0_wp, &
                                matmul(derivatives%tangent%dz(:n, :), transpose(inverse)), n, &
                                gradient(n + 1:, :), 2, 1.0_wp, gradient, n + 2)
         jacobian(:, :2*nc) = gradient(:n, :2*nc)
         if (measures) by_path = gradient(:n, 2*nc + 1)
         ! What the tolerance of the march leaves of slip wears nothing.
         if (measures .and. self%rests) by_path = 0.0_wp
      end associate
      call add_sets(self, cells, fourier, jacobian)
   end subroutine derivative

   !> The derivative at a fixed z, and that of the normal force.
   subroutine add_sets(self, cells, fourier, jacobian)
      type(planar_pair_type), intent(in) :: self
      type(cells_type), intent(in) :: cells
      type(fourier_type), intent(in) :: fourier
      !> Transposed, components as sections (3 n_coefficients, 3 n_coefficients).
      real(wp), intent(inout) :: jacobian(:, :)
      integer :: c, k, n, nc

      n = cells%n_retained
      nc = cells%n_coefficients
      ! Normal forces do not depend on the tangential prediction.
      jacobian(:, 2*nc + 1:) = 0.0_wp
      if (fourier%projects) then
         do c = 1, 2
            call self%integral%stick%add_gram(1.0_wp, n, cells%harmonic, cells%column, &
                                              jacobian((c - 1)*nc + 1:c*nc, (c - 1)*nc + 1:c*nc))
         end do
         call self%integral%contact%add_gram(1.0_wp, n, cells%harmonic, cells%column, &
                                             jacobian(2*nc + 1:, 2*nc + 1:))
         return
      end if
      do k = 1, cells%n_time
         ! dy_n at the instants that bear.
         if (self%map%motion%values(k) < 0.0_wp) cycle
         do c = 1, nc
            jacobian(2*nc + 1:, 2*nc + c) = jacobian(2*nc + 1:, 2*nc + c) + &
                                            fourier%analysis(c, k)*fourier%synthesis(:, k)
         end do
      end do
   end subroutine add_sets

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
               force(to, :) = self%integral%projected(k, :)
               if (computed(h) > 0) force(to + 1, :) = self%integral%projected(k + 1, :)
            end associate
         end if
         k = k + merge(1, 2, computed(h) == 0)
      end do
      if (.not. fourier%has_constant()) return
      ! The means are known also where the balance leaves harmonic 0 out.
      force(1, 1:2) = self%integral%mean
      force(1, 3) = 0.0_wp
      call self%integral%contact%project(-1.0_wp, self%map%motion%normal, 1, [0], [1], force(:, 3))
   end subroutine coefficients

   !> Shares of the period in stick, slip and open.
   pure function share(self)
      class(planar_pair_type), intent(in) :: self
      real(wp) :: share(3)

      share = self%integral%share
   end function share

   !> int N |dz| over the period.
   pure real(wp) function friction_path(self)
      class(planar_pair_type), intent(in) :: self

      friction_path = merge(0.0_wp, self%integral%friction_path, self%rests)
   end function friction_path

end module fw_event_planar
