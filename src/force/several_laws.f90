!> Pairs of several laws as one law of all pairs. A member is a law with its own pairs; here their
!> inputs, forces, states and derivatives stand in the order of all pairs, so that nobody else has
!> to know which law a pair has.
!>
!> Members that follow events keep doing so beside members that decide at instants.
module fw_several_laws
   use fw_force_law, only: force_workspace, input_facts, law_facts, law_room, pair_mixed, &
      pair_stuck
   use fw_fourier, only: fourier_type, new_fourier
   use fw_gap_motion, only: gap_motion
   use fw_kinds, only: wp
   use fw_pair_law, only: pair_law
   use fw_steady_slide, only: differentiate_slide, find_slide, lean_block
   use fw_worn_friction, only: worn_friction
   implicit none (type, external)
   private

   public :: several_laws, common_facts, lean_facts

   !> A law and the pairs that follow it.
   type :: member_type
      class(pair_law), allocatable :: law
      !> Its pairs among all (n_elements of the law).
      integer, allocatable :: pair(:)
   end type member_type

   !> Pairs of several laws, which the rest of the program takes for one.
   type, extends(pair_law) :: several_laws
      type(member_type), allocatable, private :: member(:)
      !> Of each pair its member, and its place there (n_elements).
      integer, allocatable, private :: of_member(:), place(:)
      !> Of pairs on a side that slides steadily, whose member presses alone: where it slides to,
      !> v/|v| (n_elements, 2), which leans friction of mu times the normal force; 0 elsewhere. Not
      !> allocated where there are none.
      real(wp), allocatable, private :: lean(:, :)
   contains
      procedure :: add
      procedure :: join
      procedure :: leans
      procedure :: take_prediction
      procedure :: reserve
      procedure :: evaluate
      procedure :: evaluate_free
      procedure :: evaluate_rigid
      procedure :: linearize
      procedure :: sample
      procedure :: coefficients
      procedure :: tail
      procedure :: fractions
      procedure :: slope_at_rest
      procedure :: acts_alone
      procedure :: at_instant
      procedure :: press_at
      procedure :: input_of_slope
      procedure :: input_of_pressure
      procedure :: pressing_constant
      procedure :: by_constant
      procedure :: instants_wanted
      procedure :: located
   end type several_laws

   !> Instants that isolate events, at least.
   integer, parameter :: fewest_for_events = 8

   !> A workspace for each member.
   type, extends(law_room) :: members_room
      type(force_workspace), allocatable :: work(:)
      !> Instants of the members that follow events, where others need more: as many as if all did.
      type(fourier_type), allocatable :: few
   end type members_room

contains

   !> Append a law whose pairs are built.
   subroutine add(self, law, pair)
      class(several_laws), intent(inout) :: self
      class(pair_law), allocatable, intent(inout) :: law
      !> Its pairs among all.
      integer, intent(in) :: pair(:)
      type(member_type), allocatable :: longer(:)
      integer :: m, n

      n = 0
      if (allocated(self%member)) n = size(self%member)
      allocate (longer(n + 1))
      do m = 1, n
         call move_alloc(self%member(m)%law, longer(m)%law)
         call move_alloc(self%member(m)%pair, longer(m)%pair)
      end do
      call move_alloc(law, longer(n + 1)%law)
      longer(n + 1)%pair = pair
      call move_alloc(longer, self%member)
   end subroutine add

   !> Once all members are there: what the law of all pairs is.
   subroutine join(self, present, mu, speed, worn)
      class(several_laws), intent(inout) :: self
      !> Which components exist (3, n_pairs).
      logical, intent(in) :: present(:, :)
      !> Of pairs on a side that slides steadily, whose members press alone and see no tangential
      !> directions: friction coefficients (n_pairs) and velocities (n_pairs, 2), 0 for others; and
      !> how friction changes with wear.
      real(wp), intent(in) :: mu(:), speed(:, :)
      type(worn_friction), allocatable, intent(in) :: worn
      integer :: i, m, n

      n = size(present, 2)
      call self%take_pairs([(0.0_wp, i=1, n)], present)
      allocate (self%of_member(n), self%place(n), self%prediction%own(n))
      do m = 1, size(self%member)
         associate (law => self%member(m)%law, at => self%member(m)%pair)
            self%of_member(at) = m
            self%place(at) = [(i, i=1, size(at))]
            self%mu(at) = law%mu
            if (allocated(law%worn)) call take_worn(self, at, law%worn)
            self%prediction%stiffness(at, :) = law%prediction%stiffness
            self%prediction%gap(at) = law%prediction%gap
            self%prediction%load(at) = law%prediction%load
            call join_growth(law%prediction%gap_growth, at, n, self%prediction%gap_growth)
            call join_growth(law%prediction%load_growth, at, n, self%prediction%load_growth)
            call join_speeds(law%prediction%speed, at, n, self%prediction%speed)
            call join_motion(law%prediction%gap_motion, at, n, self%prediction%gap_motion)
            self%prediction%own(at) = input_facts(law%prediction%order, law%prediction%by_time, &
                                                  law%prediction%takes_balance, &
                                                  law%prediction%has_inertia)
            ! That of the rigid members, which alone have one.
            if (law%prediction%takes_balance) self%prediction%scale = law%prediction%scale
         end associate
      end do
      associate (p => self%prediction)
         p%order = [(maxval(p%own%order(m)), m=1, 3)]
         p%by_time = any(p%own%by_time)
         p%takes_balance = any(p%own%takes_balance)
         p%has_inertia = any(p%own%has_inertia)
      end associate
      if (any(abs(speed) > 0.0_wp)) then
         call take_lean(self, mu, speed)
         if (allocated(worn)) self%worn = worn
      end if
      call find_facts(self)
   end subroutine join

   !> Friction of pairs on a side that slides steadily.
   pure subroutine take_lean(self, mu, speed)
      class(several_laws), intent(inout) :: self
      real(wp), intent(in) :: mu(:), speed(:, :)
      real(wp) :: size_of
      integer :: c, i

      allocate (self%lean(self%n_elements, 2), source=0.0_wp)
      if (.not. allocated(self%prediction%speed)) allocate (self%prediction%speed, source=self%lean)
      do i = 1, self%n_elements
         size_of = norm2(speed(i, :))
         if (.not. size_of > 0.0_wp) cycle
         self%lean(i, :) = merge(speed(i, :)/size_of, 0.0_wp, self%present(1:2, i))
         self%prediction%speed(i, :) = speed(i, :)
         self%mu(i) = mu(i)
         ! No force depends on how far they slide, but what they wear does: in lengths, where no
         ! stiffness of the structure stands for them.
         if (self%prediction%takes(i)) cycle
         do c = 1, 2
            self%prediction%stiffness(i, c) = merge(1.0_wp, 0.0_wp, self%present(c, i))
         end do
      end do
   end subroutine take_lean

   !> Whether side 2 of a pair slides steadily.
   elemental logical function leans(self, pair)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: pair

      leans = .false.
      if (allocated(self%lean)) leans = any(abs(self%lean(pair, :)) > 0.0_wp)
   end function leans

   !> Friction of the pairs that lean, from their normal forces (n_pairs, 3, :).
   pure subroutine add_lean(self, at, mu, force)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: at(:)
      !> Friction coefficients (n_pairs).
      real(wp), intent(in) :: mu(:)
      real(wp), intent(inout) :: force(:, :, :)
      integer :: c, i

      if (.not. allocated(self%lean)) return
      do i = 1, size(at)
         if (.not. self%leans(at(i))) cycle
         do c = 1, 2
            force(at(i), c, :) = mu(at(i))*self%lean(at(i), c)*force(at(i), 3, :)
         end do
      end do
   end subroutine add_lean

   !> What grows of some pairs among all.
   pure subroutine join_growth(growth, at, n, joined)
      real(wp), allocatable, intent(in) :: growth(:)
      integer, intent(in) :: at(:), n
      real(wp), allocatable, intent(inout) :: joined(:)

      if (.not. allocated(growth)) return
      if (.not. allocated(joined)) allocate (joined(n), source=0.0_wp)
      joined(at) = growth
   end subroutine join_growth

   !> Velocities of side 2 of some pairs among all.
   pure subroutine join_speeds(speed, at, n, joined)
      real(wp), allocatable, intent(in) :: speed(:, :)
      integer, intent(in) :: at(:), n
      real(wp), allocatable, intent(inout) :: joined(:, :)

      if (.not. allocated(speed)) return
      if (.not. allocated(joined)) allocate (joined(n, 2), source=0.0_wp)
      joined(at, :) = speed
   end subroutine join_speeds

   !> Gaps that move of some pairs among all: the harmonics are those of the case.
   pure subroutine join_motion(motion, at, n, joined)
      type(gap_motion), allocatable, intent(in) :: motion
      integer, intent(in) :: at(:), n
      type(gap_motion), allocatable, intent(inout) :: joined

      if (.not. allocated(motion)) return
      if (.not. allocated(joined)) then
         allocate (joined)
         joined%harmonic = motion%harmonic
         allocate (joined%amplitude(n, size(motion%harmonic)), source=(0.0_wp, 0.0_wp))
      end if
      joined%amplitude(at, :) = motion%amplitude
   end subroutine join_motion

   !> How the friction of some pairs changes: that of all has the same form.
   subroutine take_worn(self, at, worn)
      class(several_laws), intent(inout) :: self
      integer, intent(in) :: at(:)
      type(worn_friction), intent(in) :: worn

      if (.not. allocated(self%worn)) then
         allocate (self%worn)
         self%worn%form = worn%form
         allocate (self%worn%final(self%n_elements), self%worn%rate(self%n_elements), &
                   source=0.0_wp)
      end if
      self%worn%final(at) = worn%final
      self%worn%rate(at) = worn%rate
   end subroutine take_worn

   !> What holds of all members.
   subroutine find_facts(self)
      class(several_laws), intent(inout) :: self
      type(law_facts), allocatable :: facts(:)
      integer :: m

      allocate (facts(size(self%member)))
      do m = 1, size(facts)
         facts(m) = self%member(m)%law%facts
         if (self%leans(self%member(m)%pair(1))) facts(m)%measures_slip = .true.
      end do
      self%facts = common_facts(facts)
      if (allocated(self%lean)) call lean_facts(self%facts)
      self%facts%measures_slip = all(facts%measures_slip)
   end subroutine find_facts

   !> What steady sliding takes from a law of the pairs, and what it adds: friction follows from
   !> what presses, and so does what it wears.
   elemental subroutine lean_facts(facts)
      type(law_facts), intent(inout) :: facts

      facts%is_odd = .false.
      facts%measures_slip = .true.
      facts%has_multipliers = .false.
      facts%acts_at_once = .false.
   end subroutine lean_facts

   !> What holds of pairs of several laws together.
   pure type(law_facts) function common_facts(facts) result(shared)
      type(law_facts), intent(in) :: facts(:)

      shared%is_odd = all(facts%is_odd)
      shared%remembers = any(facts%remembers)
      shared%needs_independent = any(facts%needs_independent)
      shared%has_events = any(facts%has_events)
      shared%follows_events = all(facts%follows_events)
      shared%locates_events = any(facts%locates_events) .and. &
                              all(facts%locates_events .or. .not. facts%has_events)
      shared%acts_at_once = all(facts%acts_at_once)
      shared%is_curved = any(facts%is_curved)
      shared%needs_projection = any(facts%needs_projection)
      shared%is_hysteretic = any(facts%is_hysteretic)
      shared%measures_slip = all(facts%measures_slip)
      shared%has_tail = all(facts%has_tail)
      ! Multipliers are found by marching one law, or at each instant.
      shared%has_multipliers = shared%acts_at_once .and. all(facts%has_multipliers)
      shared%is_integrated = all(facts%is_integrated)
      ! Those that follow events need none.
      associate (sampled => .not. facts%follows_events .or. shared%follows_events)
         shared%fewest_instants = maxval(facts%fewest_instants, mask=sampled)
         shared%instants_per_harmonic = maxval(facts%instants_per_harmonic, mask=sampled)
         shared%instants_with_separation = maxval(facts%instants_with_separation, mask=sampled)
         shared%further_instants = maxval(facts%further_instants, mask=sampled)
      end associate
   end function common_facts

   !> Hand on what was changed from outside.
   subroutine take_prediction(self)
      class(several_laws), intent(inout) :: self
      integer :: m

      do m = 1, size(self%member)
         associate (law => self%member(m)%law, at => self%member(m)%pair)
            law%present = self%present(:, at)
            law%present(1:2, :) = law%present(1:2, :) .and. &
               .not. spread(self%leans(at), 1, 2)
            law%mu = merge(0.0_wp, self%mu(at), self%leans(at))
            law%prediction%stiffness = self%prediction%stiffness(at, :)
            law%prediction%gap = self%prediction%gap(at)
            law%prediction%load = self%prediction%load(at)
            if (allocated(self%prediction%inertia) .and. law%prediction%has_inertia) then
               law%prediction%inertia = self%prediction%inertia(at, :)
               law%prediction%damping = self%prediction%damping(at, :)
               ! No direction with mass rubs by itself.
               where (.not. transpose(law%present)) law%prediction%inertia = 0.0_wp
            end if
         end associate
      end do
   end subroutine take_prediction

   !> Room of its own for each member, too.
   subroutine reserve(self, fourier, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work
      type(members_room), allocatable :: room
      integer :: m, n

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (room)
      allocate (room%work(size(self%member)))
      n = max(fewest_for_events, 2*(2*maxval(fourier%harmonic) + 1))
      if (fourier%projects .and. fourier%n_time > n) then
         allocate (room%few)
         room%few = new_fourier(maxval(fourier%harmonic), n, .not. fourier%has_constant())
      end if
      do m = 1, size(self%member)
         if (takes_few(self, m, room)) then
            call self%member(m)%law%reserve(room%few, room%work(m))
         else
            call self%member(m)%law%reserve(fourier, room%work(m))
         end if
      end do
      call move_alloc(room, work%room)
   end subroutine reserve

   !> Whether a member has the few instants that isolate events.
   pure logical function takes_few(self, member, room)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: member
      type(members_room), intent(in) :: room

      takes_few = self%member(member)%law%facts%follows_events .and. allocated(room%few)
   end function takes_few

   !> Each member the forces of its pairs.
   subroutine evaluate(self, fourier, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      call self%evaluate_free(fourier, work)
      call self%evaluate_rigid(fourier, work)
   end subroutine evaluate

   !> Members that do not take the balance.
   subroutine evaluate_free(self, fourier, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      call evaluate_members(self, .false., fourier, work)
   end subroutine evaluate_free

   !> Members that do.
   subroutine evaluate_rigid(self, fourier, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      call evaluate_members(self, .true., fourier, work)
   end subroutine evaluate_rigid

   !> Those that take the balance, or the others.
   subroutine evaluate_members(self, takes_balance, fourier, work)
      class(several_laws), intent(in) :: self
      logical, intent(in) :: takes_balance
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: m

      call self%take_friction(work)
      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            associate (law => self%member(m)%law, own => room%work(m))
               if (law%prediction%takes_balance .neqv. takes_balance) cycle
               call take_inputs(self%member(m)%pair, work, own)
               if (takes_few(self, m, room)) then
                  call law%evaluate(room%few, own)
               else
                  call law%evaluate(fourier, own)
               end if
               call give_forces(self%member(m)%pair, own, work)
               call lean_forces(self, fourier, self%member(m)%pair, work)
            end associate
         end do
      end select
   end subroutine evaluate_members

   !> Pairs that lean slip wherever they bear, and come to rest nowhere.
   pure subroutine lean_forces(self, fourier, at, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: at(:)
      type(force_workspace), intent(inout) :: work
      real(wp) :: slide
      integer :: i

      if (.not. allocated(self%lean)) return
      call add_lean(self, at, work%mu, work%force)
      where (self%leans(at))
         work%rests(at) = .false.
         work%state(at) = merge(pair_mixed, work%state(at), work%state(at) == pair_stuck)
      end where
      if (.not. work%measures_slip) return
      do i = 1, size(at)
         if (.not. self%leans(at(i))) cycle
         call find_slide(self%prediction, self%lean(at(i), :), fourier, at(i), work, slide)
         work%slip(at(i)) = slide
      end do
   end subroutine lean_forces

   !> From the workspace of all pairs to that of a member.
   pure subroutine take_inputs(at, work, own)
      integer, intent(in) :: at(:)
      type(force_workspace), intent(in) :: work
      type(force_workspace), intent(inout) :: own

      own%prediction = work%prediction(at, :, :)
      own%offset = work%offset(at)
      own%mu = work%mu(at)
      own%mean = work%mean(at, :)
      own%x_start = work%x_start(at, :)
      own%rate = work%rate
      if (work%measures_slip .and. .not. allocated(own%slip)) call own%measure_slip()
      own%measures_slip = work%measures_slip
      own%differentiates_slip = work%differentiates_slip
   end subroutine take_inputs

   !> And back.
   pure subroutine give_forces(at, own, work)
      integer, intent(in) :: at(:)
      type(force_workspace), intent(in) :: own
      type(force_workspace), intent(inout) :: work

      work%force(at, :, :) = own%force
      work%rests(at) = own%rests
      work%scale(at) = own%scale
      work%drift(at) = own%drift
      work%pressure(at) = own%pressure
      work%turns(at) = own%turns
      work%x(at, :) = own%x
      work%x_start(at, :) = own%x_start
      work%state(at) = own%state
      if (own%measures_slip) work%slip(at) = own%slip
   end subroutine give_forces

   !> Each member at the last point of all.
   subroutine linearize(self, fourier, work)
      class(several_laws), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i, m, n

      n = self%n_components*fourier%n_coefficients
      if (.not. allocated(work%jacobian)) allocate (work%jacobian(n, n, self%n_elements))
      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            associate (law => self%member(m)%law, own => room%work(m), at => self%member(m)%pair)
               if (takes_few(self, m, room)) then
                  call law%linearize(room%few, own)
                  if (own%waits) call law%form_jacobian(room%few, own)
               else
                  call law%linearize(fourier, own)
                  if (own%waits) call law%form_jacobian(fourier, own)
               end if
               work%linear_state(at) = own%linear_state
               work%linear_rests(at) = own%linear_rests
               do i = 1, size(at)
                  if (own%linear_state(i) == pair_mixed) then
                     work%jacobian(:, :, at(i)) = own%jacobian(:, :, i)
                  end if
                  if (.not. self%leans(at(i))) cycle
                  work%linear_rests(at(i)) = .false.
                  call lean_block(work%mu(at(i))*self%lean(at(i), :), fourier%n_coefficients, &
                                  work%linear_state(at(i)), work%jacobian(:, :, at(i)))
               end do
               if (.not. own%measures_slip) cycle
               work%slip_derivative(:, at) = own%slip_derivative
               if (.not. own%differentiates_slip) cycle
               do i = 1, size(at)
                  if (self%leans(at(i))) call differentiate_slide( &
                     self%prediction, self%lean(at(i), :), fourier, at(i), work)
               end do
            end associate
         end do
      end select
   end subroutine linearize

   !> At as many instants as `force_time` has.
   subroutine sample(self, work)
      class(several_laws), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      integer :: m

      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            associate (own => room%work(m), at => self%member(m)%pair, &
                       n => size(work%force_time, 3))
               if (size(own%force_time, 3) /= n) then
                  deallocate (own%force_time)
                  allocate (own%force_time(size(at), self%n_components, n), source=0.0_wp)
               end if
               call self%member(m)%law%sample(own)
               work%force_time(at, :, :) = own%force_time
               call add_lean(self, at, work%mu, work%force_time)
            end associate
         end do
      end select
   end subroutine sample

   !> Each member writes the forces of its own pairs.
   subroutine coefficients(self, work, computed, fourier, force)
      class(several_laws), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:, :, :)
      real(wp), allocatable :: of_member(:, :, :)
      integer :: m

      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            of_member = force(self%member(m)%pair, :, :)
            call self%member(m)%law%coefficients(room%work(m), computed, fourier, of_member)
            force(self%member(m)%pair, :, :) = of_member
            call add_lean(self, self%member(m)%pair, work%mu, force)
         end do
      end select
   end subroutine coefficients

   !> Forces above those of the balance, of each member.
   subroutine tail(self, work, highest, force)
      class(several_laws), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: highest
      real(wp), intent(inout) :: force(:, :, :)
      real(wp), allocatable :: of_member(:, :, :)
      integer :: m

      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            of_member = force(self%member(m)%pair, :, :)
            call self%member(m)%law%tail(room%work(m), highest, of_member)
            force(self%member(m)%pair, :, :) = of_member
            call add_lean(self, self%member(m)%pair, work%mu, force)
         end do
      end select
   end subroutine tail

   !> Each member of its pairs.
   pure subroutine fractions(self, work, share)
      class(several_laws), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)
      real(wp), allocatable :: of_member(:, :)
      integer :: m

      share = 0.0_wp
      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            of_member = share(:, self%member(m)%pair)
            call self%member(m)%law%fractions(room%work(m), of_member)
            where (self%leans(self%member(m)%pair))
               ! Where it bears it slips.
               of_member(2, :) = of_member(1, :) + of_member(2, :)
               of_member(1, :) = 0.0_wp
            end where
            share(:, self%member(m)%pair) = of_member
         end do
      end select
   end subroutine fractions

   !> Asks the member that the element belongs to.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element, component

      slope = self%member(self%of_member(element))%law%slope_at_rest(self%place(element), component)
   end function slope_at_rest

   !> What follows asks the member that an element belongs to.
   pure logical function acts_alone(self, element)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element

      acts_alone = self%member(self%of_member(element))%law%acts_alone(self%place(element))
   end function acts_alone

   pure subroutine at_instant(self, element, y, force, slope)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(3)
      real(wp), intent(out) :: force(3), slope(3, 3)

      if (self%leans(element)) then
         ! The member presses alone.
         call self%member(self%of_member(element))%law%at_instant( &
            self%place(element), [0.0_wp, 0.0_wp, y(3)], force, slope)
         slope(:2, :) = 0.0_wp
         force(:2) = self%mu(element)*self%lean(element, :)*force(3)
         slope(3, :2) = self%mu(element)*self%lean(element, :)*slope(3, 3)
         return
      end if
      call self%member(self%of_member(element))%law%at_instant(self%place(element), y, force, slope)
   end subroutine at_instant

   pure subroutine press_at(self, element, y, force, slope)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y
      real(wp), intent(out) :: force, slope

      call self%member(self%of_member(element))%law%press_at(self%place(element), y, force, slope)
   end subroutine press_at

   pure real(wp) function input_of_slope(self, element, wanted) result(y)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: wanted

      y = self%member(self%of_member(element))%law%input_of_slope(self%place(element), wanted)
   end function input_of_slope

   pure subroutine input_of_pressure(self, element, y)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(inout) :: y(:)

      call self%member(self%of_member(element))%law%input_of_pressure(self%place(element), y)
   end subroutine input_of_pressure

   !> By a constant that the law of the element does not take the derivative is 0, and not known.
   pure subroutine by_constant(self, element, name, fourier, work, force, is_known)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known

      is_known = .false.
      force = 0.0_wp
      select type (room => work%room)
      type is (members_room)
         associate (m => self%of_member(element))
            if (takes_few(self, m, room)) then
               call self%member(m)%law%by_constant(self%place(element), name, room%few, &
                                                   room%work(m), force, is_known)
            else
               call self%member(m)%law%by_constant(self%place(element), name, fourier, &
                                                   room%work(m), force, is_known)
            end if
         end associate
      end select
   end subroutine by_constant

   pure function pressing_constant(self, element) result(name)
      class(several_laws), intent(in) :: self
      integer, intent(in) :: element
      character(24) :: name

      name = self%member(self%of_member(element))%law%pressing_constant(self%place(element))
   end function pressing_constant

   !> The most that any member wants: instants are common to all.
   pure integer function instants_wanted(self, work) result(n)
      class(several_laws), intent(in) :: self
      type(force_workspace), intent(in) :: work
      integer :: m

      n = 0
      select type (room => work%room)
      type is (members_room)
         do m = 1, size(self%member)
            n = max(n, self%member(m)%law%instants_wanted(room%work(m)))
         end do
      end select
   end function instants_wanted

   !> Members that know of events follow them, the others stay.
   subroutine located(self, law)
      class(several_laws), intent(in) :: self
      class(pair_law), allocatable, intent(out) :: law
      type(several_laws), allocatable :: copy
      class(pair_law), allocatable :: found
      integer :: m

      allocate (copy, source=self)
      do m = 1, size(copy%member)
         if (.not. copy%member(m)%law%facts%has_events) cycle
         call copy%member(m)%law%located(found)
         call move_alloc(found, copy%member(m)%law)
      end do
      call find_facts(copy)
      call move_alloc(copy, law)
   end subroutine located

end module fw_several_laws
