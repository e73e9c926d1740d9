!> Coulomb friction with a unilateral normal force, decided instant by instant: predicted forces
!> in, contact forces out, marched through stick, slip and separation until the period repeats.
!>
!> One correction serves three laws, which differ in their prediction alone: 'dlft' and
!> 'dlft_velocity' predict from the balance, and are rigid; 'penalty' predicts from stiffnesses.
module fw_friction
   use fw_coming_to_rest, only: come_to_rest, rest_type
   use fw_correction, only: march_turn_1d, march_turn_2d, project_turn
   use fw_force_law, only: force_workspace, law_facts, law_room, pair_mixed, pair_open, &
      pair_stuck, prediction_type
   use fw_contact_data, only: contact_type
   use fw_fourier, only: fourier_type
   use fw_friction_events, only: follow_events
   use fw_key, only: key_visitor
   use fw_kinds, only: pi, wp
   use fw_normal_law, only: bind_normal_constants, curved_pairs
   use fw_pair_law, only: bind_speeds, normal_stiffness_key, pair_law, tangential_stiffness_key
   use fw_sampled_turn, only: settle_samples
   use fw_settling, only: periodic_tolerance, shakedown_turns
   use fw_slip, only: slip_work
   use fw_threads, only: pairs_for_threads
   use fw_wave_sums, only: wave_table
   implicit none (type, external)
   private

   public :: friction_law, friction_room
   public :: rigid_friction, rigid_friction_of_rates, elastic_friction

   !> Pairs marched together: one cache line, and a whole number of vector registers.
   integer, parameter :: block_size = 8
   !> Turns after which the limit of a march is looked for by Newton's method. One direction needs
   !> one; a random sample with two needed 4 at most, pairs of a blade root that creep thousands.
   integer, parameter :: plain_turns = 4
   !> Pairs, and coefficients of a component, from which a march pays; of many pairs, whose blocks
   !> no cache holds, it does so with fewer. By sweeps of the sector with 16 to 384 pairs: how many
   !> instants there are does not matter, since forming a block takes as much longer with more.
   integer, parameter :: pairs_of_march(2) = [8, 96], coefficients_of_march(2) = [27, 15]

   type, extends(pair_law) :: friction_law
   contains
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: take_facts
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: form_jacobian
      procedure :: fractions
      procedure :: located
      procedure :: by_constant
   end type friction_law

   !> What the march leaves beside the workspace.
   type, extends(law_room) :: friction_room
      !> Smallest mu p - |d| (n_pairs).
      real(wp), allocatable :: margin(:)
      !> Whether the march ends at the limit that `settle` found (n_pairs).
      logical, allocatable :: settled(:)
      !> Whether a pair that rests was moved on the way to its rest (n_pairs).
      logical, allocatable :: moved(:)
      !> Of pairs whose residual traction is given: half of the distance between its ends, 0 of
      !> pairs that no traction keeps from slipping [force] (n_pairs), and the instants of the lower
      !> and of the upper end (2, n_pairs).
      real(wp), allocatable :: reach(:)
      integer, allocatable :: ends(:, :)
      !> Of the harmonics, where the analysis is the projection.
      type(wave_table) :: waves
      !> Room for derivatives of one pair after the other, from step to step.
      class(law_room), allocatable :: derivatives
      !> The jacobian of before, while that of now waits.
      real(wp), allocatable :: jacobian(:, :, :)
   end type friction_room

   interface
      !> See fw_friction_derivative.
      module subroutine linearize(self, fourier, work)
         class(friction_law), intent(in) :: self
         type(fourier_type), intent(in) :: fourier
         type(force_workspace), intent(inout) :: work
      end subroutine linearize
      module subroutine form_jacobian(self, fourier, work)
         class(friction_law), intent(in) :: self
         type(fourier_type), intent(in) :: fourier
         type(force_workspace), intent(inout) :: work
      end subroutine form_jacobian
   end interface

contains

   !> Friction of rigid pairs, predicted from positions.
   pure type(friction_law) function rigid_friction() result(law)
      law%prediction = prediction_type(takes_balance=.true.)
      law%facts = law_facts(remembers=.true., needs_independent=.true., has_events=.true., &
                            measures_slip=.true., is_integrated=.true.)
   end function rigid_friction

   !> Friction of rigid pairs, predicted from velocities, which need no memory.
   pure type(friction_law) function rigid_friction_of_rates() result(law)
      law = rigid_friction()
      ! A derivative by tau in both tangential directions, none in the normal one.
      law%prediction%order = [1, 1, 0]
      law%facts%remembers = .false.
   end function rigid_friction_of_rates

   !> Friction of pairs with stiffnesses (elastic dry friction), which are functions of the
   !> displacements: perturbations can be followed.
   pure type(friction_law) function elastic_friction() result(law)
      law = rigid_friction()
      law%prediction%takes_balance = .false.
      law%facts%needs_independent = .false.
      law%facts%has_multipliers = .true.
   end function elastic_friction

   !> Stiffnesses belong to elastic pairs, which cannot do without them.
   subroutine bind_keys(self, keys, contact, slides, closes)
      class(friction_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      call bind_speeds(keys, contact)
      if (self%prediction%takes_balance) return
      call contact%constants%bind(keys, tangential_stiffness_key(), slides)
      call contact%constants%bind(keys, normal_stiffness_key(), closes)
      call bind_normal_constants(keys, contact)
   end subroutine bind_keys

   subroutine take_constants(self, contact)
      class(friction_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      integer :: i

      call self%take_speeds(contact)
      call self%take_facts(contact)
      if (self%prediction%takes_balance) return
      do i = 1, self%n_elements
         ! One stiffness for both tangential directions: friction prefers no direction either.
         if (any(self%present(1:2, i))) self%prediction%stiffness(i, 1:2) = &
            contact%tangential_stiffness(i)
      end do
      call self%take_normal(contact)
   end subroutine take_constants

   !> Pressure along a curve is taken at instants, and has no polynomial pieces between events.
   !> Perturbations and motions in time know it where nothing rubs.
   subroutine take_facts(self, contact)
      class(friction_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      if (contact%slides()) then
         self%facts%is_odd = .false.
         self%facts%has_multipliers = .false.
      end if
      if (self%prediction%takes_balance .or. .not. any(curved_pairs(contact))) return
      call self%note_curves(contact)
      self%facts%has_events = .false.
      self%facts%acts_at_once = .not. any(contact%mu > 0.0_wp)
      self%facts%has_multipliers = self%facts%acts_at_once
      self%facts%is_integrated = self%facts%acts_at_once
   end subroutine take_facts

   !> Blocks of pairs are marched together, so that all arrays run over the pairs first.
   subroutine reserve(self, fourier, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work

      type(friction_room), allocatable :: room

      call work%reserve(self%n_elements, self%n_components, fourier)
      call self%reserve_normal(fourier, work)
      allocate (room)
      allocate (room%margin(self%n_elements), source=0.0_wp)
      allocate (room%settled(self%n_elements), room%moved(self%n_elements), source=.false.)
      allocate (room%reach(self%n_elements), source=0.0_wp)
      allocate (room%ends(2, self%n_elements), source=0)
      if (fourier%projects .and. self%n_elements > 0) call room%waves%build(fourier)
      if (march_pays(self, fourier)) then
         allocate (work%march)
         call work%march%reserve(fourier%synthesis, fourier%analysis, self%n_elements)
      end if
      call move_alloc(room, work%room)
   end subroutine reserve

   !> Whether steps with derivatives that are marched take less than with blocks between all
   !> coefficients.
   pure logical function march_pays(self, fourier)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier

      march_pays = self%facts%remembers .and. self%two_directions .and. &
                   .not. self%facts%is_curved .and. &
                   any(self%n_elements >= pairs_of_march .and. &
                       fourier%n_coefficients >= coefficients_of_march)
   end function march_pays

   subroutine evaluate(self, fourier, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      if (self%n_elements == 0) return
      select type (room => work%room)
      type is (friction_room)
         call evaluate_at_instants(self, fourier, work, room)
      end select
   end subroutine evaluate

   subroutine evaluate_at_instants(self, fourier, work, room)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      logical :: wanted(3)
      integer :: n_blocks, block, k

      call self%take_friction(work)
      call self%take_start(work)
      do k = 1, size(wanted)
         wanted(k) = any(self%present(k, :))
      end do
      call fourier%to_time(3*self%n_elements, work%prediction, work%prediction_time, &
                           work%fft, wanted)
      do k = 1, fourier%n_time
         ! Gap, wear and constant loads: means that are no part of the coefficients.
         work%prediction_time(:, 3, k) = work%prediction_time(:, 3, k) + work%offset
      end do
      call self%take_pressures(work)
      if (allocated(self%prediction%speed)) call enter_frame(self, fourier%n_time, work)
      ! Before the march: what counts as repeated is relative to the largest prediction.
      call work%measure_scale()
      n_blocks = (self%n_elements + block_size - 1)/block_size
      if (self%n_elements < pairs_for_threads) then
         do block = 1, n_blocks
            call follow_block(self, work, room, fourier, block)
         end do
      else
         !$omp parallel do default(none) shared(self, work, room, n_blocks, fourier) &
         !$omp private(block) schedule(dynamic)
         do block = 1, n_blocks
            call follow_block(self, work, room, fourier, block)
         end do
         !$omp end parallel do
      end if
      call fourier%to_coefficients(3*self%n_elements, work%force_time, work%force, work%fft, &
                                   wanted)
      call classify(room, work)
      ! A pair that sticks presses along its curve all the same: no identity.
      if (self%facts%is_curved) then
         where (work%state == pair_stuck) work%state = pair_mixed
      end if
      ! Nor is one whose position follows from its own inputs.
      where (room%reach > 0.0_wp) work%state = pair_mixed
      if (work%measures_slip) then
         ! The march has ended where it started, so one more turn over the same prediction is the
         ! period.
         call slip_work(self%n_elements, fourier%n_time, work%mu, work%prediction_time, &
                        self%facts%remembers, work%x, work%slip)
         where (work%rests .or. room%reach > 0.0_wp) work%slip = 0.0_wp
      end if
   end subroutine evaluate_at_instants

   !> The march of a block of pairs, to its rest where the law has no memory of positions.
   subroutine follow_block(self, work, room, fourier, block)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: block
      integer :: first, last, pair

      first = (block - 1)*block_size + 1
      last = min(first + block_size - 1, self%n_elements)
      call march(self, work, room, fourier%n_time, first, last)
      if (allocated(self%share) .and. self%facts%remembers) then
         do pair = first, last
            call hold(self, work, room, fourier%n_time, pair)
         end do
      end if
      if (self%facts%remembers .or. .not. fourier%has_constant()) return
      do pair = first, last
         ! On a side that slides nothing comes to rest.
         if (self%prediction%drags(pair)) cycle
         call lead_to_rest(self, work, room, fourier%n_time, pair)
      end do
   end subroutine follow_block

   !> State of every pair over the whole march.
   pure subroutine classify(room, work)
      type(friction_room), intent(in) :: room
      type(force_workspace), intent(inout) :: work
      integer :: i, k

      do i = 1, size(work%state)
         if (work%rests(i)) then
            work%state(i) = merge(pair_mixed, pair_stuck, room%moved(i))
            cycle
         end if
         ! Margin and pressure are the smallest over all turns, warm-up included.
         if (room%margin(i) >= 0.0_wp .and. work%pressure(i) > 0.0_wp) then
            work%state(i) = pair_stuck
            cycle
         end if
         ! The smallest pressure is zero for mixed and open pairs alike: the forces tell.
         work%state(i) = pair_open
         if (work%pressure(i) > 0.0_wp) work%state(i) = pair_mixed
         do k = 1, size(work%force_time, 3)
            if (work%state(i) == pair_mixed) exit
            if (work%force_time(i, 3, k) < 0.0_wp) work%state(i) = pair_mixed
         end do
      end do
   end subroutine classify

   !> A pair of a law of rates that slips in no period: forces of where it comes to rest.
   subroutine lead_to_rest(self, work, room, n_time, pair)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, pair
      type(rest_type) :: rest
      real(wp) :: start(2)
      integer :: c, k

      start = work%x_start(pair, :) - work%mean(pair, :)
      call come_to_rest(self%n_elements, n_time, pair, work%prediction_time, work%mu(pair), &
                        work%scale(pair) + sum(abs(start)), start, rest)
      work%rests(pair) = rest%found
      if (.not. rest%found) then
         if (room%margin(pair) < 0.0_wp .or. work%pressure(pair) <= 0.0_wp) return
         ! It never slips, though the march to its rest has not ended: it rests where it starts.
         work%rests(pair) = .true.
         rest = rest_type(found=.true., z=start)
      end if
      room%margin(pair) = max(room%margin(pair), 0.0_wp)
      room%moved(pair) = rest%moved
      room%settled(pair) = rest%settled
      work%turns(pair) = rest%turns
      work%x(pair, :) = rest%z + work%mean(pair, :)
      do k = 1, n_time
         do c = 1, 2
            work%force_time(pair, c, k) = work%prediction_time(pair, c, k) - rest%z(c)
         end do
      end do
   end subroutine lead_to_rest

   !> March pairs first..last until their state repeats after a period.
   subroutine march(self, work, room, n_time, first, last)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, first, last
      integer :: i

      ! The start is stated, never left from before: a residual must not depend on the one before
      ! it.
      work%x(first:last, :) = work%x_start(first:last, :)
      room%margin(first:last) = huge(1.0_wp)
      work%pressure(first:last) = huge(1.0_wp)
      room%settled(first:last) = .false.
      if (.not. self%facts%remembers) then
         ! At velocity level there is no position that could drift.
         work%drift(first:last) = 0.0_wp
         call project_turn(self%n_elements, n_time, first, last, work%mu, work%prediction_time, &
                           work%force_time, room%margin, work%pressure)
         work%turns(first:last) = 1
         return
      end if
      if (allocated(self%prediction%speed)) then
         do i = first, last
            if (self%prediction%drags(i)) then
               call march_along(self, work, room, n_time, i)
            else
               call march_to_limit(self, work, room, n_time, i, i)
            end if
         end do
         return
      end if
      call march_to_limit(self, work, room, n_time, first, last)
   end subroutine march

   !> A pair with one tangential direction that some residual traction keeps from slipping: its
   !> position stands between the ends of what its bounds P - Q and P + Q leave over the period,
   !> where its share says. Where they leave nothing the march has the last word.
   subroutine hold(self, work, room, n_time, pair)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, pair
      real(wp) :: lower, upper, p, q
      integer :: k, t

      room%reach(pair) = 0.0_wp
      ! An anchor that is carried along holds no pair for ever.
      if (count(self%present(1:2, pair)) /= 1 .or. self%prediction%drags(pair)) return
      t = merge(1, 2, self%present(1, pair))
      lower = -huge(1.0_wp)
      upper = huge(1.0_wp)
      do k = 1, n_time
         p = work%prediction_time(pair, t, k)
         ! Not cut off at 0: of a pair that opens the bounds then leave nothing.
         q = -work%mu(pair)*work%prediction_time(pair, 3, k)
         if (p - q > lower) then
            lower = p - q
            room%ends(1, pair) = k
         end if
         if (p + q < upper) then
            upper = p + q
            room%ends(2, pair) = k
         end if
      end do
      if (.not. lower < upper) return
      room%reach(pair) = 0.5_wp*(upper - lower)
      work%x(pair, t) = 0.5_wp*(1.0_wp - self%share(pair))*lower + &
                        0.5_wp*(1.0_wp + self%share(pair))*upper
      work%force_time(pair, t, :) = work%prediction_time(pair, t, :) - work%x(pair, t)
      ! Nothing of the march counts.
      room%margin(pair) = 0.0_wp
      room%settled(pair) = .false.
      work%turns(pair) = 1
      work%drift(pair) = 0.0_wp
   end subroutine hold

   !> From the stated start to where a turn repeats.
   subroutine march_to_limit(self, work, room, n_time, first, last)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, first, last
      integer :: turn

      work%turns(first:last) = 0
      do turn = 1, plain_turns
         call march_turn(self, work, room, n_time, first, last, turn)
         ! Blocks go on until their slowest pair repeats; the others only repeat on.
         if (all(work%turns(first:last) > 0)) return
      end do
      call find_limits(self, work, room, n_time, first, last)
      ! The turn from the limit fills the forces; it also judges whether the limit is one.
      call march_turn(self, work, room, n_time, first, last, plain_turns + 1)
      ! Not settled: the derivative carries as many turns as are worth their cost.
      where (work%turns(first:last) == 0) work%turns(first:last) = shakedown_turns
   end subroutine march_to_limit

   !> The predictions in a frame that slides with side 2: anchors stand there where a pair sticks,
   !> and from turn to turn they go on by what the frame has moved in a period. Predictions from
   !> velocities take the relative one.
   subroutine enter_frame(self, n_time, work)
      class(friction_law), intent(in) :: self
      integer, intent(in) :: n_time
      type(force_workspace), intent(inout) :: work
      real(wp) :: drift
      integer :: c, i, k

      do c = 1, 2
         do i = 1, self%n_elements
            if (.not. self%prediction%drags(i)) cycle
            drift = frame_drift(self, work%rate, i, c)
            do k = 1, n_time
               work%prediction_time(i, c, k) = work%prediction_time(i, c, k) - &
                  drift*merge(real(k, wp)/real(n_time, wp), 0.5_wp/pi, self%facts%remembers)
            end do
         end do
      end do
   end subroutine enter_frame

   !> What the frame of a pair moves in a period, times the stiffness [force]; nothing at rest.
   pure real(wp) function frame_drift(self, omega, pair, component) result(drift)
      class(friction_law), intent(in) :: self
      real(wp), intent(in) :: omega
      integer, intent(in) :: pair, component

      drift = 0.0_wp
      if (omega > 0.0_wp) drift = 2.0_wp*pi/omega*self%prediction%stiffness(pair, component)* &
                                  self%prediction%speed(pair, component)
   end function frame_drift

   !> A pair whose anchor is carried along has one limit, since it cannot stick for ever. It is
   !> looked for from an anchor far ahead, where friction has always pulled it back: with one
   !> direction a turn leads from there to the limit.
   subroutine march_along(self, work, room, n_time, pair)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, pair
      real(wp) :: drift(2), start(2), far, x(2)
      integer :: k, turn

      drift = [frame_drift(self, work%rate, pair, 1), frame_drift(self, work%rate, pair, 2)]
      far = 0.0_wp
      do k = 1, n_time
         associate (y => work%prediction_time)
            far = max(far, abs(y(pair, 1, k)) + abs(y(pair, 2, k)) + &
                           work%mu(pair)*abs(y(pair, 3, k)))
         end associate
      end do
      far = norm2(drift) + 2.0_wp*far
      start = 0.0_wp
      if (norm2(drift) > 0.0_wp) start = drift/norm2(drift)*far
      work%x(pair, :) = start
      do turn = 1, plain_turns
         start = work%x(pair, :)
         call march_turn(self, work, room, n_time, pair, pair, 1)
         work%x(pair, :) = work%x(pair, :) + drift
         work%drift(pair) = maxval(abs(work%x(pair, :) - start))
         if (work%drift(pair) <= periodic_tolerance*(work%scale(pair) + norm2(drift))) exit
      end do
      if (turn > plain_turns) then
         x = work%x(pair, :)
         call settle_samples(self%n_elements, n_time, pair, work%prediction_time, work%mu(pair), &
                             work%scale(pair) + norm2(drift), periodic_tolerance, x, &
                             room%settled(pair), drift)
         work%x(pair, :) = x
         start = x
         call march_turn(self, work, room, n_time, pair, pair, 1)
         work%x(pair, :) = work%x(pair, :) + drift
         work%drift(pair) = maxval(abs(work%x(pair, :) - start))
      end if
      room%settled(pair) = .true.
      ! Its start is where the derivative of a turn begins.
      work%turns(pair) = 1
      ! It slips in every period.
      room%margin(pair) = min(room%margin(pair), -tiny(1.0_wp))
   end subroutine march_along

   !> One turn, and which pairs repeat after it.
   subroutine march_turn(self, work, room, n_time, first, last, turn)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, first, last, turn
      real(wp) :: start(block_size, 2)
      integer :: i

      start(:last - first + 1, :) = work%x(first:last, :)
      if (self%two_directions) then
         call march_turn_2d(self%n_elements, n_time, first, last, work%mu, work%prediction_time, &
                            work%x, work%force_time, room%margin, work%pressure)
      else
         ! A limit that was looked for is not where the last turn ended.
         call march_turn_1d(self%n_elements, n_time, first, last, work%mu, work%prediction_time, &
                            work%x, work%force_time, room%margin, work%pressure, &
                            again=turn > 1 .and. turn <= plain_turns)
      end if
      do i = first, last
         work%drift(i) = maxval(abs(work%x(i, :) - start(i - first + 1, :)))
         if (work%turns(i) > 0 .or. room%settled(i)) cycle
         if (work%drift(i) <= periodic_tolerance*work%scale(i)) work%turns(i) = turn
      end do
   end subroutine march_turn

   !> Bring the pairs that do not repeat yet to the limit of their march.
   subroutine find_limits(self, work, room, n_time, first, last)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(friction_room), intent(inout) :: room
      integer, intent(in) :: n_time, first, last
      real(wp) :: x(2)
      integer :: i

      do i = first, last
         if (work%turns(i) > 0) cycle
         x = work%x(i, :)
         call settle_samples(self%n_elements, n_time, i, work%prediction_time, work%mu(i), &
                             work%scale(i), periodic_tolerance, x, room%settled(i))
         work%x(i, :) = x
      end do
   end subroutine find_limits

   !> The share of a residual traction; all else acts through the inputs.
   pure subroutine by_constant(self, element, name, fourier, work, force, is_known)
      class(friction_law), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known

      is_known = .false.
      force = 0.0_wp
      if (.not. self%facts%remembers) return
      select type (room => work%room)
      type is (friction_room)
         call self%by_share(element, name, fourier, room%reach(element), force, is_known)
      end select
   end subroutine by_constant

   subroutine located(self, law)
      class(friction_law), intent(in) :: self
      class(pair_law), allocatable, intent(out) :: law

      allocate (law, source=follow_events(self))
   end subroutine located

   pure subroutine fractions(self, work, share)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)

      select type (room => work%room)
      type is (friction_room)
         call fractions_of_instants(self, work, room, share)
      end select
   end subroutine fractions

   pure subroutine fractions_of_instants(self, work, room, share)
      class(friction_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      type(friction_room), intent(in) :: room
      real(wp), intent(out) :: share(:, :)
      integer :: i, k, n_time
      real(wp) :: tangential, limit
      logical :: sticks
      ! A slipping force lies on the cone to round-off.
      real(wp), parameter :: on_cone = 1.0_wp - 1.0e-12_wp

      n_time = size(work%force_time, 3)
      share = 0.0_wp
      do k = 1, n_time
         do i = 1, self%n_elements
            ! lambda_n is negative in contact.
            limit = -work%mu(i)*work%force_time(i, 3, k)
            tangential = norm2(work%force_time(i, 1:2, k))
            if (work%force_time(i, 3, k) >= 0.0_wp) then
               share(3, i) = share(3, i) + 1.0_wp
               cycle
            end if
            sticks = tangential < on_cone*limit .or. room%margin(i) >= 0.0_wp
            if (sticks) then
               share(1, i) = share(1, i) + 1.0_wp
            else
               share(2, i) = share(2, i) + 1.0_wp
            end if
         end do
      end do
      share = share/real(n_time, wp)
   end subroutine fractions_of_instants

end module fw_friction
