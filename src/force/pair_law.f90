!> Laws of contact pairs: components (t1, t2, n), friction, and a normal force that presses,
!> either constant or from the distance of the two sides.
module fw_pair_law
   use fw_contact_data, only: contact_type
   use fw_force_law, only: force_law, force_workspace
   use fw_key, only: key, key_type, key_visitor
   use fw_key_range, only: at_least
   use fw_kinds, only: wp
   use fw_worn_friction, only: worn_friction
   implicit none (type, external)
   private

   public :: pair_law, normal_stiffness_key

   type, abstract, extends(force_law) :: pair_law
      !> Friction coefficient (n_elements).
      real(wp), allocatable :: mu(:)
      !> How it changes with wear; not allocated where it does not.
      type(worn_friction), allocatable :: worn
      !> Whether a pair has two tangential directions.
      logical :: two_directions = .false.
   contains
      procedure :: build
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: take_facts
      procedure :: take_pairs
      procedure :: slope_at_rest
      procedure :: set_friction
      procedure :: take_friction
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
      call self%take_constants(contact)
   end subroutine build

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
      normal_stiffness_key = key('normal_stiffness', 'contact stiffness; 0 without a normal '// &
                                 'dof', at_least(0.0_wp), 'F/L', 'n_pairs', &
                                 absent='of the file, else required with normal dofs')
   end function normal_stiffness_key

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

   !> A pair without friction or load holds nothing tangentially.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(pair_law), intent(in) :: self
      integer, intent(in) :: element, component

      slope = merge(1.0_wp, 0.0_wp, self%present(component, element))
      if (component < 3 .and. .not. self%mu(element) > 0.0_wp) slope = 0.0_wp
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
