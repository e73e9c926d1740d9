!> Laws of contact pairs: components (t1, t2, n), friction, and a normal force that presses,
!> either constant or from the distance of the two sides.
module fw_pair_law
   use fw_contact_data, only: contact_type, memory_residual
   use fw_force_law, only: prediction_type, force_law, force_workspace
   use fw_fourier, only: fourier_type
   use fw_gap_motion, only: take_gap_motion
   use fw_key, only: key, key_type, key_visitor
   use fw_key_range, only: at_least
   use fw_kinds, only: wp
   use fw_normal_law, only: curved_pairs, normal_law, pairs_with, power, press_pairs, table, &
      take_normal_laws
   use fw_worn_friction, only: worn_friction
   implicit none (type, external)
   private

   public :: pair_law, bind_speeds, normal_stiffness_key, tangential_stiffness_key

   type, abstract, extends(force_law) :: pair_law
      !> Friction coefficient (n_elements).
      real(wp), allocatable :: mu(:)
      !> How it changes with wear; not allocated where it does not.
      type(worn_friction), allocatable :: worn
      !> Whether a pair has two tangential directions.
      logical :: two_directions = .false.
      !> How the pairs press (n_elements); springs where it is not allocated.
      type(normal_law), allocatable :: normal(:)
      !> Tangential displacements where assembled pairs are unstrained (n_elements, 2) [length]; not
      !> allocated where they stand unstrained.
      real(wp), allocatable :: slider(:, :)
      !> Of pairs that can stick throughout: where their residual traction is between the ends of
      !> what balances, -1 to 1 (n_elements); not allocated where the march says it.
      real(wp), allocatable :: share(:)
   contains
      procedure :: build
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: take_facts
      procedure :: take_pairs
      procedure :: take_normal
      procedure :: take_speeds
      procedure :: take_memory
      procedure :: take_start
      procedure :: by_share
      procedure :: note_curves
      procedure :: reserve
      procedure :: reserve_normal
      procedure :: take_pressures
      procedure :: acts_alone
      procedure :: input_at
      procedure :: at_instant
      procedure :: press_at
      procedure :: input_of_slope
      procedure :: input_of_pressure
      procedure :: pressing_constant
      procedure :: slope_at_rest
      procedure :: set_friction
      procedure :: take_friction
      procedure :: friction_of
      procedure :: located
   end type pair_law

contains

   !> Take what the pairs of a case are; `present` marks the components in use (3, n_pairs).
   !> Stiffnesses of a rigid law are left to whoever knows the structure.
   subroutine build(self, contact, present)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      logical, intent(in) :: present(:, :)

      if (contact%n_pairs == 0) then
         call self%take_pairs([real(wp) ::], present)
         return
      end if
      call self%take_pairs(contact%mu, present)
      if (allocated(contact%worn_friction)) self%worn = contact%worn_friction
      associate (p => self%prediction)
         p%scale = contact%penalty_scale
         p%gap = contact%gap
         ! What presses a pair with a normal dof is the other side, not a load of its own.
         p%load = merge(contact%normal_load, 0.0_wp, contact%side_1(3, :) == 0 .and. &
                        contact%side_2(3, :) == 0)
      end associate
      call take_growth(contact, self%prediction)
      call take_gap_motion(contact, self%prediction%gap_motion)
      call self%take_memory(contact)
      call self%take_constants(contact)
   end subroutine build

   !> What pairs that never slip have of their assembly.
   pure subroutine take_memory(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      if (allocated(contact%slider_1) .or. allocated(contact%slider_2)) then
         allocate (self%slider(contact%n_pairs, 2), source=0.0_wp)
         if (allocated(contact%slider_1)) self%slider(:, 1) = contact%slider_1
         if (allocated(contact%slider_2)) self%slider(:, 2) = contact%slider_2
      end if
      if (contact%memory == memory_residual) self%share = contact%residual
   end subroutine take_memory

   !> Before an evaluation: the march of pairs that are unstrained elsewhere starts there. The
   !> stiffness is that of now, which a rigid law has from the structure.
   pure subroutine take_start(self, work)
      class(pair_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work

      if (allocated(self%slider)) work%x_start = self%prediction%stiffness(:, :2)*self%slider
   end subroutine take_start

   !> `by_constant` of the share of a residual traction: the tangential force is y - x, and x is
   !> between its ends.
   pure subroutine by_share(self, element, name, fourier, reach, force, is_known)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      !> Half of the distance between the ends, 0 where the march says the traction [force].
      real(wp), intent(in) :: reach
      !> (n_coefficients, n_components).
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known

      force = 0.0_wp
      is_known = name == 'residual'
      if (.not. (is_known .and. fourier%has_constant())) return
      where (self%present(1:2, element)) force(fourier%column(1), 1:2) = -reach
   end subroutine by_share

   !> Of gaps and normal loads, where the rotation speed follows the frequency.
   pure subroutine take_growth(contact, prediction)
      type(contact_type), intent(in) :: contact
      type(prediction_type), intent(inout) :: prediction

      if (contact%speed_order <= 0.0_wp) return
      if (allocated(contact%gap_rotation)) then
         prediction%gap_growth = contact%gap_rotation/contact%speed_order**2
      end if
      if (allocated(contact%normal_load_rotation)) then
         prediction%load_growth = contact%normal_load_rotation/contact%speed_order**2
      end if
   end subroutine take_growth

   !> Keys that belong to this law, for the pairs of a case: without a law's own say it has none.
   subroutine bind_keys(self, keys, contact, slides, closes)
      class(pair_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      !> Whether constants of tangential and of normal dofs are needed.
      logical, intent(in) :: slides, closes

      associate (unused => self, unused_keys => keys, unused_contact => contact, &
                 unused_slides => slides, unused_closes => closes)
      end associate
   end subroutine bind_keys

   !> The key of what presses elastic pairs together, which several laws have.
   pure type(key_type) function normal_stiffness_key()
      normal_stiffness_key = key('normal_stiffness', '0 without a normal dof', at_least(0.0_wp), &
                                 'F/L', 'n_pairs', &
                                 absent='of the file, else required with normal dofs')
   end function normal_stiffness_key

   !> The key of what holds pairs tangentially, which several laws have.
   pure type(key_type) function tangential_stiffness_key()
      tangential_stiffness_key = key('tangential_stiffness', &
                                     '0 beside a parallel pair that has one', at_least(0.0_wp), &
                                     'F/L', 'n_pairs', &
                                     absent='of the file, else required with tangential dofs')
   end function tangential_stiffness_key

   !> The keys of a side 2 that slides, which several laws have.
   subroutine bind_speeds(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact

      call contact%constants%bind(keys, key('speed_1', &
                                            'velocity of side 2 along t1: a belt, disk, casing', &
                                            unit='L/s', shape='n_pairs', &
                                            absent='of the file, else 0'), .false.)
      call contact%constants%bind(keys, key('speed_2', 'the same along t2', unit='L/s', &
         shape='n_pairs', absent='of the file, else 0'), .false.)
   end subroutine bind_speeds

   !> The velocities of side 2, where it slides.
   pure subroutine take_speeds(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      if (.not. contact%slides()) return
      self%prediction%speed = contact%speeds()
      where (.not. transpose(self%present(1:2, :))) self%prediction%speed = 0.0_wp
   end subroutine take_speeds

   !> Take what `bind_keys` declared, once the pairs are there.
   subroutine take_constants(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      associate (unused => self, unused_contact => contact)
      end associate
   end subroutine take_constants

   !> Facts that depend on the constants of the pairs, which are read but need not be built.
   subroutine take_facts(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      associate (unused => self, unused_contact => contact)
      end associate
   end subroutine take_facts

   !> Pairs that touch, without a load.
   pure subroutine take_pairs(self, mu, present)
      class(pair_law), intent(inout) :: self
      !> Friction coefficient (n_pairs).
      real(wp), intent(in) :: mu(:)
      !> Which components exist (3, n_pairs).
      logical, intent(in) :: present(:, :)

      call self%take_elements(present)
      self%mu = mu
      self%two_directions = any(present(2, :))
   end subroutine take_pairs

   !> What presses the pairs: springs with a stiffness, or curves. Inputs of these are
   !> displacements, and their forces are decided at instants.
   pure subroutine take_normal(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      call take_normal_laws(contact, self%normal)
      if (allocated(self%normal)) then
         self%prediction%stiffness(:, 3) = 1.0_wp
      else if (any(self%present(3, :))) then
         where (self%present(3, :)) self%prediction%stiffness(:, 3) = contact%normal_stiffness
      end if
   end subroutine take_normal

   !> What curved pressures change of the facts: they are taken at instants, enough of them for the
   !> corners of a table, and for the curvature of a power that jumps where the sides touch.
   subroutine note_curves(self, contact)
      class(pair_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      integer, parameter :: of_power = 1024, of_table = 2048

      self%facts%is_curved = any(curved_pairs(contact))
      if (any(pairs_with(contact, power))) self%facts%fewest_instants = &
         max(self%facts%fewest_instants, of_power)
      if (any(pairs_with(contact, table))) self%facts%fewest_instants = &
         max(self%facts%fewest_instants, of_table)
   end subroutine note_curves

   subroutine reserve(self, fourier, work)
      class(pair_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work

      call work%reserve(self%n_elements, self%n_components, fourier)
      call self%reserve_normal(fourier, work)
   end subroutine reserve

   !> Room for what `take_pressures` leaves.
   pure subroutine reserve_normal(self, fourier, work)
      class(pair_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      if (allocated(self%normal)) allocate (work%pressing(self%n_elements, fourier%n_time), &
                                            source=0.0_wp)
   end subroutine reserve_normal

   !> Put pressures in the place of normal inputs at the instants, of curved laws.
   pure subroutine take_pressures(self, work)
      class(pair_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work

      if (allocated(self%normal)) call press_pairs(self%n_elements, size(work%pressing, 2), &
                                                   self%normal, work%prediction_time, &
                                                   work%pressing)
   end subroutine take_pressures

   !> Whether the forces of an element follow from its inputs at the same instant.
   pure logical function acts_alone(self, element)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element

      acts_alone = self%facts%acts_at_once
      associate (unused => element)
      end associate
   end function acts_alone

   !> Inputs of an element at an instant, as `evaluate` has them, from its relative displacement and
   !> velocity.
   pure function input_at(self, element, u, v, depth) result(y)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      !> (t1, t2, n) [length], [length/time].
      real(wp), intent(in) :: u(3), v(3)
      !> Worn [length].
      real(wp), intent(in) :: depth
      real(wp) :: y(3)
      integer :: c

      y = 0.0_wp
      associate (p => self%prediction)
         do c = 1, 3
            if (.not. self%present(c, element)) cycle
            y(c) = p%stiffness(element, c)*merge(v(c), u(c), p%order_of(element, c) > 0)
         end do
         if (self%present(3, element)) then
            y(3) = y(3) + p%stiffness(element, 3)*(p%gap(element) + depth)
         else
            y(3) = -p%load(element)
         end if
      end associate
   end function input_at

   !> Forces of an element of a law that acts at once, and their slopes (input, output): without
   !> friction, that of what presses.
   pure subroutine at_instant(self, element, y, force, slope)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(3)
      real(wp), intent(out) :: force(3), slope(3, 3)

      force = 0.0_wp
      slope = 0.0_wp
      if (allocated(self%normal)) then
         call self%press_at(element, y(3), force(3), slope(3, 3))
      else if (y(3) < 0.0_wp) then
         force(3) = y(3)
         slope(3, 3) = 1.0_wp
      end if
   end subroutine at_instant

   pure subroutine press_at(self, element, y, force, slope)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y
      real(wp), intent(out) :: force, slope
      real(wp) :: p

      force = y
      slope = 1.0_wp
      if (.not. allocated(self%normal)) return
      call self%normal(element)%press(-y, p, slope)
      force = -p
   end subroutine press_at

   pure real(wp) function input_of_slope(self, element, wanted) result(y)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: wanted

      y = 0.0_wp
      if (allocated(self%normal)) y = -self%normal(element)%overclosure_of_slope(wanted)
   end function input_of_slope

   pure subroutine input_of_pressure(self, element, y)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(inout) :: y(:)

      if (.not. allocated(self%normal)) return
      call self%normal(element)%proportional(.true., y(1))
      call self%normal(element)%proportional(.false., y(2:))
   end subroutine input_of_pressure

   pure function pressing_constant(self, element) result(name)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      character(24) :: name

      name = ''
      if (allocated(self%normal)) name = self%normal(element)%constant_name()
   end function pressing_constant

   !> The friction of pairs at their depths.
   pure subroutine set_friction(self, depth, work)
      class(pair_law), intent(in) :: self
      real(wp), intent(in) :: depth(:)
      type(force_workspace), intent(inout) :: work

      if (.not. allocated(self%worn)) return
      call self%worn%at_depth(self%mu, depth, work%mu, work%mu_growth)
   end subroutine set_friction

   !> Before an evaluation: friction that does not wear is that of the law.
   pure subroutine take_friction(self, work)
      class(pair_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work

      if (.not. allocated(self%worn)) work%mu = self%mu
   end subroutine take_friction

   !> The friction coefficient of an element at its depth.
   pure real(wp) function friction_of(self, element, work) result(mu)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element
      type(force_workspace), intent(in) :: work

      mu = self%mu(element)
      if (allocated(self%worn)) mu = work%mu(element)
   end function friction_of

   !> A pair without friction or load holds nothing tangentially.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element, component

      slope = merge(1.0_wp, 0.0_wp, self%present(component, element))
      if (component == 3) return
      ! Nor does one whose other side slides.
      if (.not. self%mu(element) > 0.0_wp .or. self%prediction%drags(element)) slope = 0.0_wp
   end function slope_at_rest

   !> The same law with its paths followed from event to event; not allocated where `facts` know of
   !> no events.
   subroutine located(self, law)
      class(pair_law), intent(in) :: self
      class(pair_law), allocatable, intent(out) :: law

      associate (unused => self, unused_law => law)
      end associate
   end subroutine located

end module fw_pair_law
