!> What a force law is to the rest of the program: facts that hold whatever it is solved with, a
!> prediction that says what its forces are computed from, and forces with their exact derivative.
!>
!> A law belongs to elements (pairs, springs) with up to three components each. It is written once,
!> when it is built, and may be shared; what an evaluation leaves stands in a workspace, one for
!> each that evaluates. For a law of n elements and nc Fourier coefficients:
!>
!>   y = stiffness ((d/dtau)**order u_r + gap)  [+ the balance without the law's own force],
!>   evaluate: y -> force,   linearize: d force/d y, element by element.
!>
!> Nobody asks a law by its name: who needs to know something of it reads `facts` or `prediction`.
module fw_force_law
   use fw_displacement_path, only: displacement_path
   use fw_fft, only: fft_type
   use fw_fourier, only: fourier_type
   use fw_gap_motion, only: gap_motion
   use fw_kinds, only: wp
   use fw_march_derivative, only: march_derivative
   implicit none (type, external)
   private

   public :: force_law, force_workspace, law_room
   public :: input_facts, prediction_type, law_facts, refusal_type
   public :: pair_stuck, pair_open, pair_mixed

   !> State of an element over the whole period: its derivative is the identity, zero, or any other
   !> and then stored.
   integer, parameter :: pair_stuck = 1, pair_open = 2, pair_mixed = 3

   !> What the input of one element is made of, see prediction_type.
   type :: input_facts
      integer :: order(3) = 0
      logical :: by_time = .false., takes_balance = .false., has_inertia = .false.
   end type input_facts

   !> What the input y of a law is made of.
   type :: prediction_type
      !> Derivative of the relative displacement that each component takes: 0, or 1.
      integer :: order(3) = 0
      !> Derivatives are by t, not by tau: times omega for each order.
      logical :: by_time = .false.
      !> The balance without the law's own force is a part of y: the law is rigid, and stiffness is
      !> a number of the method, of the order of the structure's own.
      logical :: takes_balance = .false.
      !> Of a law whose elements differ in these and in `has_inertia`, what each takes
      !> (n_elements): those of the law are then the highest order, and whether any element does.
      !> Who deals with one element asks `order_of`, `in_time` and `takes`.
      type(input_facts), allocatable :: own(:)
      !> Forces depend on the frequency while their inputs are held, as a law makes rates of
      !> displacements by itself: `by_frequency` has the derivative.
      logical :: has_frequency = .false.
      !> Makes the input of the displacement or its derivative (n_elements, 3 or 1): [force/length]
      !> where y is a force.
      real(wp), allocatable :: stiffness(:, :)
      !> Multiplies the stiffness that the structure gives a law that takes the balance.
      real(wp) :: scale = 1.0_wp
      !> Beside the stiffness stand a mass and a damping of the structure, for derivatives by t
      !> (n_elements, 3) [force time**2/length], [force time/length]; 0 where they do not matter:
      !> y takes E_n = stiffness - (n omega)**2 inertia + i n omega damping of each harmonic.
      logical :: has_inertia = .false.
      real(wp), allocatable :: inertia(:, :), damping(:, :)
      !> Added to the displacement of the last component [length], and what its input is where it
      !> does not exist: minus the dead load [force] (n_elements).
      real(wp), allocatable :: gap(:), load(:)
      !> What is added to them for each square of the frequency, where a rotation speed follows it;
      !> not allocated elsewhere (n_elements).
      real(wp), allocatable :: gap_growth(:), load_growth(:)
      !> What the gaps have in harmonics of the response; not allocated where they stand still.
      type(gap_motion), allocatable :: gap_motion
      !> Velocities of side 2 along t1 and t2, where the anchors of elements that stick are carried
      !> along (n_elements, 2) [length/time]; not allocated elsewhere.
      real(wp), allocatable :: speed(:, :)
   contains
      procedure :: gap_at
      procedure :: load_at
      procedure :: move_gaps
      procedure :: gap_swing
      procedure :: drags
      procedure :: grows
      procedure :: order_of
      procedure :: in_time
      procedure :: takes
      procedure :: some_are_free
      procedure :: take_eps
      procedure :: impedance_ratio
   end type prediction_type

   !> What holds of a law wherever it is used.
   type :: law_facts
      !> The force of the opposite motion is the opposite one, as long as no offset acts: odd
      !> harmonics answer odd harmonics.
      logical :: is_odd = .true.
      !> The force depends on the past of the period.
      logical :: remembers = .false.
      !> Forces are determined only where no displacement follows from that of other elements.
      logical :: needs_independent = .false.
      !> Its paths can be followed from event to event, without instants.
      logical :: has_events = .false.
      !> They are followed so: forces at the instants are there after `sample` only.
      logical :: follows_events = .false.
      !> Every path that has events is followed so: beside pairs of a law without any, forces are
      !> there at the instants all the same.
      logical :: locates_events = .false.
      !> Its forces are the projection of their histories alone, not a collocation.
      logical :: needs_projection = .false.
      !> It follows from the turning points of one tangential displacement, under a constant normal
      !> load and from the assembly on: pairs have no other component.
      logical :: is_hysteretic = .false.
      !> Sliding under pressure, with its derivative: what wear takes. The law leaves both in its
      !> workspace where that asks for them (`work%slip`, `work%slip_derivative`).
      logical :: measures_slip = .false.
      !> Its forces are known in every harmonic (`tail`), where a pair has one tangential direction.
      logical :: has_tail = .false.
      !> A perturbation can be followed through the period: Floquet multipliers. With pairs that
      !> is done for Coulomb's law behind springs, and for laws that act at once
      !> (`src/balance/stability_history.f90`): any other would get the multipliers of the first.
      logical :: has_multipliers = .false.
      !> The integration in time (`src/time`) knows the law: Coulomb's, rigid or behind springs, or
      !> one that acts at once.
      logical :: is_integrated = .false.
      !> Forces at an instant follow from the inputs at the same instant alone: `at_instant` of
      !> fw_pair_law gives them, with their slopes.
      logical :: acts_at_once = .false.
      !> How hard elements press is no straight line of their normal input.
      logical :: is_curved = .false.
      !> Instants below which the sampling error exceeds that of the truncation: in all, for each
      !> harmonic, and for each harmonic where elements may separate or the normal load varies.
      !> (The defaults are those of friction.)
      integer :: fewest_instants = 64
      integer :: instants_per_harmonic = 16, instants_with_separation = 32
      !> Beyond those for each harmonic.
      integer :: further_instants = 0
   end type law_facts

   !> Room that only one law knows.
   type, abstract :: law_room
   end type law_room

   !> The last motion that a law had no force for, and what it said to it: of which element, at
   !> which instant, with which displacements and rates (of the first inputs).
   type :: refusal_type
      integer :: element = 0, instant = 0, status = 0
      real(wp) :: omega = 0.0_wp, u(4) = 0.0_wp, v(4) = 0.0_wp
   end type refusal_type

   !> What evaluations of one law leave: one for each that evaluates. Sizes are (n_elements,
   !> n_components, n_coefficients or n_time).
   type :: force_workspace
      !> Coefficients of y and of the forces.
      real(wp), allocatable :: prediction(:, :, :), force(:, :, :)
      !> The same at the instants; forces only after `sample` where events are followed.
      real(wp), allocatable :: prediction_time(:, :, :), force_time(:, :, :)
      !> Of elements that press along a curve, whose normal input at the instants is minus the
      !> pressure: its slope by the input (n_elements, n_time).
      real(wp), allocatable :: pressing(:, :)
      !> Constant part of the input of the last component: stiffness times gap with the wear depth,
      !> or minus the dead load (n_elements).
      real(wp), allocatable :: offset(:)
      !> Friction coefficient of pairs at their depth, and the part of it by which it changes with
      !> that (n_elements) [-, 1/length].
      real(wp), allocatable :: mu(:), mu_growth(:)
      !> Of a law of rates: what the mean position adds to the tangential inputs of an element that
      !> comes to rest, stiffness times the mean (n_elements, 2); a rate says nothing of it.
      real(wp), allocatable :: mean(:, :)
      !> Whether an element of a law of rates comes to rest, so that its mean counts (n_elements),
      !> and the same at which `linearize` was called last.
      logical, allocatable :: rests(:), linear_rests(:)
      !> Size of the tangential inputs, change of x over the last turn, smallest pressure, turns
      !> of the march (n_elements).
      real(wp), allocatable :: scale(:), drift(:), pressure(:)
      integer, allocatable :: turns(:)
      !> Corrected position where the period starts and where it ends, in units of y
      !> (n_elements, 2).
      real(wp), allocatable :: x_start(:, :), x(:, :)
      !> pair_stuck, pair_open or pair_mixed (n_elements), and the same at which `linearize` was
      !> called last: a derivative may be kept while the forces move on.
      integer, allocatable :: state(:), linear_state(:)
      !> Transposed derivative of the force by the input of each mixed element:
      !> (coefficient, component) of the input, then of the output, element.
      real(wp), allocatable :: jacobian(:, :, :)
      !> The same of many harmonics as a march, for products that only have to be near: of laws that
      !> have it, where it pays.
      type(march_derivative), allocatable :: march
      !> Whether `linearize` may leave the jacobian to `form_jacobian`, and whether it has: nobody
      !> has it until then.
      logical :: may_wait = .false., waits = .false.
      !> Inputs and outputs of a product with the derivative (coefficient and component, element).
      real(wp), allocatable :: input(:, :), output(:, :)
      !> Sliding under pressure over the period [force**2] (n_elements), and its derivative by the
      !> input (coefficient, component; element): only where asked for.
      logical :: measures_slip = .false.
      real(wp), allocatable :: slip(:), slip_derivative(:, :)
      !> Whether anybody wants that derivative: at held depths only the sliding itself.
      logical :: differentiates_slip = .false.
      !> Not 0 where the last evaluation has no force: above 0 the run is to end.
      integer :: failed = 0
      type(refusal_type) :: refusal
      !> Angular frequency of the period: makes a derivative by tau one by t.
      real(wp) :: rate = 1.0_wp
      class(law_room), allocatable :: room
      !> Of laws of hysteresis: the path of each element, and points and weights of the rules that
      !> integrate along it.
      type(displacement_path), allocatable :: path(:)
      real(wp), allocatable :: rule(:, :)
      !> Plans and buffers of long transforms, where there are such.
      type(fft_type), allocatable :: fft
   contains
      procedure :: reserve => reserve_workspace
      procedure :: measure_slip
      procedure :: measure_scale
      procedure :: always_closed
      procedure :: all_open
      procedure :: all_periodic
   end type force_workspace

   !> Change of x over the last turn, as a part of the largest predicted force, above which a march
   !> counts as not periodic.
   real(wp), parameter :: negligible_drift = 1.0e-9_wp

   type, abstract :: force_law
      integer :: n_elements = 0
      integer :: n_components = 1
      !> Which components exist (n_components, n_elements).
      logical, allocatable :: present(:, :)
      type(prediction_type) :: prediction
      type(law_facts) :: facts
   contains
      procedure :: reserve
      procedure :: take_elements
      procedure :: set_offset
      procedure :: set_friction
      procedure :: take_prediction
      procedure(evaluate_interface), deferred :: evaluate
      procedure :: evaluate_free
      procedure :: evaluate_rigid
      procedure(linearize_interface), deferred :: linearize
      procedure :: form_jacobian
      procedure :: sample
      procedure :: coefficients
      procedure :: tail
      procedure :: fractions
      procedure :: slope_at_rest
      procedure :: slope_at
      procedure :: press_at
      procedure :: input_of_slope
      procedure :: input_of_pressure
      procedure :: pressing_constant
      procedure :: slopes_about
      procedure :: n_parameters
      procedure :: find_parameter
      procedure :: by_frequency
      procedure :: complaint
      procedure :: by_parameter
      procedure :: by_constant
      procedure :: instants_wanted
   end type force_law

   abstract interface
      !> Forces from the inputs, both coefficients, and the states.
      subroutine evaluate_interface(self, fourier, work)
         import :: force_law, force_workspace, fourier_type
         implicit none (type, external)
         class(force_law), intent(in) :: self
         type(fourier_type), intent(in) :: fourier
         type(force_workspace), intent(inout) :: work
      end subroutine evaluate_interface

      !> Derivatives of the mixed elements at the last evaluation.
      subroutine linearize_interface(self, fourier, work)
         import :: force_law, force_workspace, fourier_type
         implicit none (type, external)
         class(force_law), intent(in) :: self
         type(fourier_type), intent(in) :: fourier
         type(force_workspace), intent(inout) :: work
      end subroutine linearize_interface
   end interface

contains

   !> Room for evaluations; every path starts from x = 0, the unstrained assembly.
   subroutine reserve_workspace(self, n_elements, n_components, fourier)
      class(force_workspace), intent(inout) :: self
      integer, intent(in) :: n_elements, n_components
      type(fourier_type), intent(in) :: fourier
      integer :: n

      n = n_elements
      allocate (self%prediction(n, n_components, fourier%n_coefficients), source=0.0_wp)
      allocate (self%force, source=self%prediction)
      allocate (self%prediction_time(n, n_components, fourier%n_time), source=0.0_wp)
      allocate (self%force_time, source=self%prediction_time)
      allocate (self%input(n_components*fourier%n_coefficients, n), source=0.0_wp)
      allocate (self%output, source=self%input)
      allocate (self%offset(n), self%scale(n), self%drift(n), self%pressure(n), source=0.0_wp)
      allocate (self%mu(n), self%mu_growth(n), source=0.0_wp)
      allocate (self%x_start(n, 2), self%x(n, 2), self%mean(n, 2), source=0.0_wp)
      allocate (self%rests(n), self%linear_rests(n), source=.false.)
      allocate (self%turns(n), source=0)
      allocate (self%state(n), self%linear_state(n), source=pair_stuck)
      call fourier%plan_fft(n*n_components, self%fft)
   end subroutine reserve_workspace

   !> Ask for `slip`, and for its derivative after `linearize`, from now on.
   pure subroutine measure_slip(self)
      class(force_workspace), intent(inout) :: self

      self%measures_slip = .true.
      self%differentiates_slip = .true.
      allocate (self%slip(size(self%input, 2)), source=0.0_wp)
      allocate (self%slip_derivative, source=self%input)
   end subroutine measure_slip

   !> Derivative of the relative displacement that a component of an element takes.
   elemental integer function order_of(self, element, component) result(order)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element, component

      order = 0
      ! Elements of more components take displacements.
      if (component <= size(self%order)) order = self%order(component)
      if (allocated(self%own)) order = self%own(element)%order(component)
   end function order_of

   !> Whether derivatives that an element takes are by t.
   elemental logical function in_time(self, element)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element

      in_time = self%by_time
      if (allocated(self%own)) in_time = self%own(element)%by_time
   end function in_time

   !> Whether the balance is a part of the input of an element.
   elemental logical function takes(self, element)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element

      takes = self%takes_balance
      if (allocated(self%own)) takes = self%own(element)%takes_balance
   end function takes

   !> Whether the inputs of some elements are without the balance.
   pure logical function some_are_free(self)
      class(prediction_type), intent(in) :: self

      some_are_free = .not. self%takes_balance
      if (allocated(self%own)) some_are_free = .not. all(self%own%takes_balance)
   end function some_are_free

   !> Of the elements that take the balance, the stiffness, mass and damping that the structure gave
   !> another prediction of the same elements.
   pure subroutine take_eps(self, other)
      class(prediction_type), intent(inout) :: self
      class(prediction_type), intent(in) :: other
      integer :: i

      do i = 1, size(self%stiffness, 1)
         if (self%takes(i)) self%stiffness(i, :) = other%stiffness(i, :)
      end do
      if (.not. allocated(other%inertia)) return
      self%inertia = other%inertia
      self%damping = other%damping
   end subroutine take_eps

   !> E_n over the stiffness, a factor of the complex coefficient uc - i us of a displacement.
   elemental complex(wp) function impedance_ratio(self, element, component, harmonic, omega) &
      result(ratio)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element, component, harmonic
      !> Angular frequency [rad/s].
      real(wp), intent(in) :: omega
      real(wp) :: s

      ratio = (1.0_wp, 0.0_wp)
      if (.not. allocated(self%inertia)) return
      if (.not. self%inertia(element, component) > 0.0_wp) return
      s = omega*harmonic
      ratio = ratio + cmplx(-s**2*self%inertia(element, component), &
                            s*self%damping(element, component), wp) &
              /self%stiffness(element, component)
   end function impedance_ratio

   !> Elements without gap, load or stiffness.
   pure subroutine take_elements(self, present)
      class(force_law), intent(inout) :: self
      !> Which components exist (n_components, n_elements).
      logical, intent(in) :: present(:, :)
      integer :: n

      n = size(present, 2)
      self%n_components = size(present, 1)
      self%n_elements = n
      self%present = present
      allocate (self%prediction%stiffness(n, self%n_components), source=0.0_wp)
      allocate (self%prediction%gap(n), self%prediction%load(n), source=0.0_wp)
   end subroutine take_elements

   !> The prediction was given other numbers from outside: nothing of most laws depends on them
   !> but what asks the prediction itself.
   subroutine take_prediction(self)
      class(force_law), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine take_prediction

   !> `evaluate` for the elements whose inputs are without the balance alone: of a law that has
   !> both, whose other inputs need these forces first.
   subroutine evaluate_free(self, fourier, work)
      class(force_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      if (self%prediction%some_are_free()) call self%evaluate(fourier, work)
   end subroutine evaluate_free

   !> And for those that take the balance alone.
   subroutine evaluate_rigid(self, fourier, work)
      class(force_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      if (self%prediction%takes_balance) call self%evaluate(fourier, work)
   end subroutine evaluate_rigid

   !> What `linearize` has left to whoever needs the jacobian: nothing of most laws.
   subroutine form_jacobian(self, fourier, work)
      class(force_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      work%waits = .false.
      associate (unused => self, unused_too => fourier)
      end associate
   end subroutine form_jacobian

   !> The gap of an element at a frequency [rad/s].
   elemental real(wp) function gap_at(self, element, omega)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: omega

      gap_at = self%gap(element)
      if (allocated(self%gap_growth)) gap_at = gap_at + omega**2*self%gap_growth(element)
   end function gap_at

   !> Add what the gaps have in harmonics to the coefficients of the relative displacements, before
   !> these become inputs.
   pure subroutine move_gaps(self, fourier, u)
      class(prediction_type), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> (n_elements, n_components, n_coefficients) [length].
      real(wp), intent(inout) :: u(:, :, :)

      if (allocated(self%gap_motion)) call self%gap_motion%add_to(fourier, u(:, size(u, 2), :))
   end subroutine move_gaps

   !> How far gaps depart from their constants at most (n_elements) [length].
   pure function gap_swing(self) result(swing)
      class(prediction_type), intent(in) :: self
      real(wp) :: swing(size(self%gap))

      swing = 0.0_wp
      if (allocated(self%gap_motion)) swing = self%gap_motion%swing()
   end function gap_swing

   !> Whether side 2 of an element takes its anchor along.
   elemental logical function drags(self, element)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element

      drags = .false.
      if (allocated(self%speed)) drags = any(abs(self%speed(element, :)) > 0.0_wp)
   end function drags

   !> The dead load of an element at a frequency [rad/s].
   elemental real(wp) function load_at(self, element, omega)
      class(prediction_type), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: omega

      load_at = self%load(element)
      ! A load that has gone presses no more.
      if (allocated(self%load_growth)) load_at = max(0.0_wp, load_at + &
                                                     omega**2*self%load_growth(element))
   end function load_at

   !> Whether gaps or dead loads depend on the frequency.
   pure logical function grows(self)
      class(prediction_type), intent(in) :: self

      grows = allocated(self%gap_growth) .or. allocated(self%load_growth)
   end function grows

   !> The constant part of the inputs, before evaluations at `work%rate`, and what wear does to
   !> friction.
   pure subroutine set_offset(self, depth, work)
      class(force_law), intent(in) :: self
      !> Wear depth, on top of the gap (n_elements) [length].
      real(wp), intent(in) :: depth(:)
      type(force_workspace), intent(inout) :: work
      integer :: i, last

      last = self%n_components
      associate (p => self%prediction)
         do i = 1, self%n_elements
            work%offset(i) = -p%load_at(i, work%rate)
            if (self%present(last, i)) work%offset(i) = p%stiffness(i, last)* &
                                                        (p%gap_at(i, work%rate) + depth(i))
         end do
      end associate
      call self%set_friction(depth, work)
   end subroutine set_offset

   !> What wear does to friction, before evaluations: nothing to that of most laws.
   pure subroutine set_friction(self, depth, work)
      class(force_law), intent(in) :: self
      real(wp), intent(in) :: depth(:)
      type(force_workspace), intent(inout) :: work

      associate (unused => self, unused_depth => depth, unused_work => work)
      end associate
   end subroutine set_friction

   !> Instants that the forces at the last evaluation ask for: none where the law is content with
   !> what `facts` say.
   pure integer function instants_wanted(self, work) result(n)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(in) :: work

      n = 0
      associate (unused => self, unused_work => work)
      end associate
   end function instants_wanted

   !> Room for evaluations of this law.
   subroutine reserve(self, fourier, work)
      class(force_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work

      call work%reserve(self%n_elements, self%n_components, fourier)
   end subroutine reserve

   !> Make the forces at the instants available in `force_time`; after sampling they are.
   subroutine sample(self, work)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work

      associate (unused => self, unused_work => work)
      end associate
   end subroutine sample

   !> Coefficients of the forces on another set of harmonics over the same instants
   !> (n_elements, n_components, n_coefficients).
   subroutine coefficients(self, work, computed, fourier, force)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      !> Harmonics of the last evaluation, and those wanted.
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:, :, :)

      associate (unused => computed)
      end associate
      call fourier%to_coefficients(self%n_elements*self%n_components, work%force_time, force)
   end subroutine coefficients

   !> Coefficients of the forces of the harmonics 0..highest at the last evaluation, whatever
   !> harmonics it had (n_elements, n_components, 2 highest + 1); left alone where facts say
   !> that there is none.
   subroutine tail(self, work, highest, force)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: highest
      real(wp), intent(inout) :: force(:, :, :)

      associate (unused => self, unused_work => work, unused_highest => highest, &
                 unused_force => force)
      end associate
   end subroutine tail

   !> Share of the period that each element spends in stick, slip and open (3, n_elements): without
   !> a law's own say it slips where it bears, the last component being the pressure.
   pure subroutine fractions(self, work, share)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)
      integer :: i

      share = 0.0_wp
      do i = 1, self%n_elements
         share(3, i) = real(count(work%force_time(i, self%n_components, :) >= 0.0_wp), wp) &
                       /real(size(work%force_time, 3), wp)
         share(2, i) = 1.0_wp - share(3, i)
      end do
   end subroutine fractions

   !> Slope of the force by its input about the position at rest of an element that bears, 0 where
   !> it holds nothing: with it a first guess is made.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element, component

      slope = merge(1.0_wp, 0.0_wp, self%present(component, element))
   end function slope_at_rest

   !> Slope of the force of one component that depends on its input at the same instant alone.
   elemental real(wp) function slope_at(self, element, y) result(slope)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y

      slope = 0.0_wp
      associate (unused => self, unused_element => element, unused_input => y)
      end associate
   end function slope_at

   !> Normal force of an element at a mean input, and its slope there, where both follow from the
   !> input alone: those of a spring that bears.
   pure subroutine press_at(self, element, y, force, slope)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y
      real(wp), intent(out) :: force, slope

      force = y
      slope = 1.0_wp
      associate (unused => self, unused_element => element)
      end associate
   end subroutine press_at

   !> A normal input at which an element is about as steep as a stiffness that is given.
   pure real(wp) function input_of_slope(self, element, wanted) result(y)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: wanted

      y = 0.0_wp
      associate (unused => self, unused_element => element, unused_slope => wanted)
      end associate
   end function input_of_slope

   !> From coefficients of the normal input of an element to those of the change of it that raises
   !> the pressure in proportion: the input itself, as a pressure is proportional to it.
   pure subroutine input_of_pressure(self, element, y)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      !> (n_coefficients), the constant first.
      real(wp), intent(inout) :: y(:)

      associate (unused => self, unused_element => element, unused_input => y)
      end associate
   end subroutine input_of_pressure

   !> The constant that the pressure of an element is in proportion to, by its key, where its normal
   !> input is the relative displacement itself; blank where a stiffness makes the input of that.
   pure function pressing_constant(self, element) result(name)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      character(24) :: name

      name = ''
      associate (unused => self, unused_element => element)
      end associate
   end function pressing_constant

   !> Slopes of the forces of an element about a position at rest y (component): (output, input).
   subroutine slopes_about(self, element, y, slope)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: slope(:, :)
      integer :: c

      slope = 0.0_wp
      do c = 1, size(y)
         slope(c, c) = self%slope_at(element, y(c))
      end do
   end subroutine slopes_about

   !> Derivative of the forces by the frequency where the inputs are held, at the last evaluation,
   !> in `work%output`: of most laws there is none, and the
   !> prediction says so.
   subroutine by_frequency(self, fourier, work)
      class(force_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      work%output = 0.0_wp
      associate (unused => self, unused_fourier => fourier)
      end associate
   end subroutine by_frequency

   !> What the law could not say of the last motion that it had no force for: nothing of most laws.
   subroutine complaint(self, work, text)
      class(force_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      ! allow(C072): a text of the caller
      character(*), intent(out) :: text

      text = ''
      associate (unused => self, unused_work => work)
      end associate
   end subroutine complaint

   !> Which element, and which of its constants, the value of a parameter is (see by_parameter).
   pure subroutine find_parameter(self, value, element, number)
      class(force_law), intent(in) :: self
      !> Its place among those of the input.
      integer, intent(in) :: value
      integer, intent(out) :: element, number

      element = value
      number = 1
      associate (unused => self)
      end associate
   end subroutine find_parameter

   !> Constants of each element by which `by_parameter` differentiates.
   pure integer function n_parameters(self)
      class(force_law), intent(in) :: self

      n_parameters = 0
      associate (unused => self)
      end associate
   end function n_parameters

   !> Derivative of the coefficients of each element's force by its own constant of a number, the
   !> inputs being held, at the last evaluation (n_elements, n_components, n_coefficients).
   subroutine by_parameter(self, number, fourier, work, force)
      class(force_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)

      force = 0.0_wp
      associate (unused => self, unused_number => number, unused_fourier => fourier, &
                 unused_work => work)
      end associate
   end subroutine by_parameter

   !> Derivative of the force of one element by a constant of it, named by its key, the inputs being
   !> held, at the last evaluation; where `is_known` says no, the constant acts through the inputs.
   pure subroutine by_constant(self, element, name, fourier, work, force, is_known)
      class(force_law), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      !> (n_coefficients, n_components).
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known

      is_known = .false.
      force = 0.0_wp
      associate (unused => self, unused_element => element, unused_name => name, &
                 unused_fourier => fourier, unused_work => work)
      end associate
   end subroutine by_constant

   !> Bound of the tangential inputs of each element, of three components.
   pure subroutine measure_scale(self)
      class(force_workspace), intent(inout) :: self
      integer :: k

      self%scale = 0.0_wp
      do k = 1, size(self%prediction, 3)
         self%scale = self%scale + abs(self%prediction(:, 1, k)) + abs(self%prediction(:, 2, k))
      end do
   end subroutine measure_scale

   !> Whether an element bears at every instant.
   elemental logical function always_closed(self, element)
      class(force_workspace), intent(in) :: self
      integer, intent(in) :: element

      always_closed = self%pressure(element) > 0.0_wp
   end function always_closed

   !> Whether the march of every element has become periodic.
   pure logical function all_periodic(self)
      class(force_workspace), intent(in) :: self

      all_periodic = all(self%drift <= negligible_drift*self%scale)
   end function all_periodic

   !> Whether no element bears at any instant.
   pure logical function all_open(self)
      class(force_workspace), intent(in) :: self

      all_open = all(self%state == pair_open)
   end function all_open

end module fw_force_law
