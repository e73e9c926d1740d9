!> A named parameter of a case that moves while its problem stays: what a sweep over a load or a
!> friction coefficient goes along, and what a resonance is tracked over.
!>
!> Loads get factors. Pairs and springs get laws made anew from their data, as the builder makes
!> them; the stiffness that the structure gave a rigid law stays, as a number of the method on which
!> its solutions do not depend.
module fw_moved_parameter
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_balance_state, only: parameter_mover
   use fw_case, only: case_type
   use fw_case_forces, only: new_forces
   use fw_contact_data, only: contact_type
   use fw_contact_data, only: spring_type
   use fw_force_law, only: force_workspace
   use fw_force_list, only: force_list
   use fw_kinds, only: wp
   use fw_parameter_slopes, only: parameter_entry
   use fw_parameter_slopes, only: parameter_slope
   use fw_parameter_slopes, only: slope_finder
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: friction_coefficient
   use fw_parameters, only: gap
   use fw_parameters, only: harmonic_scale
   use fw_parameters, only: normal_load
   use fw_parameters, only: normal_stiffness
   use fw_parameters, only: static_scale
   use fw_parameters, only: tangential_stiffness
   implicit none (type, external)
   private

   public :: moved_parameter, new_moved_parameter, renew_laws

   type, extends(parameter_mover) :: moved_parameter
      !> As in fw_parameters.
      integer :: number = 0
      !> The value is a factor of those of the case, or the value itself of all elements.
      logical :: is_factor = .false.
      !> Values of the case: one, or one for each element.
      real(wp), allocatable :: base(:)
      !> Pairs and springs of the case; not allocated for loads.
      type(contact_type), allocatable, private :: contact
      type(spring_type), allocatable, private :: springs
      integer, private :: filter_harmonics = 0
   contains
      procedure :: apply
      procedure :: derive
   end type moved_parameter

contains

   !> A parameter of a case, which the case has (fw_parameter_checks).
   function new_moved_parameter(case, number, is_factor) result(self)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      logical, intent(in) :: is_factor
      type(moved_parameter) :: self

      self%number = number
      self%is_factor = is_factor
      call get_parameter(case, number, self%base)
      if (is_load(number)) return
      self%contact = case%contact
      self%springs = case%springs
      self%filter_harmonics = case%harmonics%filter_harmonics
   end function new_moved_parameter

   !> Loads are moved by factors of the state, all else by new laws.
   pure logical function is_load(number)
      integer, intent(in) :: number

      is_load = any(number == [harmonic_scale, static_scale])
   end function is_load

   !> The values that a value of the parameter stands for.
   pure function elements_at(self, value) result(values)
      type(moved_parameter), intent(in) :: self
      real(wp), intent(in) :: value
      real(wp) :: values(size(self%base))

      values = value
      if (self%is_factor) values = value*self%base
   end function elements_at

   subroutine apply(self, state, value)
      class(moved_parameter), intent(in) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in) :: value
      real(wp) :: factor, values(size(self%base))

      values = elements_at(self, value)
      if (.not. is_load(self%number)) then
         call take_values(self, state, values)
         return
      end if
      factor = values(1)/self%base(1)
      if (self%number == harmonic_scale) then
         call state%set_load_factors(1.0_wp, factor)
      else
         call state%set_load_factors(factor, 1.0_wp)
      end if
   end subroutine apply

   !> Laws of other constants, and workspaces that go with them.
   subroutine take_values(self, state, values)
      type(moved_parameter), intent(in) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in) :: values(:)
      type(contact_type) :: contact
      type(spring_type) :: springs

      contact = self%contact
      springs = self%springs
      select case (self%number)
      case (friction_coefficient)
         contact%mu = values
      case (normal_load)
         contact%normal_load = values
      case (gap)
         contact%gap = values
      case (tangential_stiffness)
         contact%tangential_stiffness = values
      case (normal_stiffness)
         contact%normal_stiffness = values
      case default
         springs%coefficient = values
      end select
      call renew_laws(state%problem, contact, springs, self%filter_harmonics)
      call renew_workspaces(state)
   end subroutine take_values

   !> The laws of a problem anew, from pairs and springs whose constants have changed since it was
   !> built. States take new workspaces then.
   subroutine renew_laws(problem, contact, springs, filter_harmonics)
      type(balance_problem), intent(inout) :: problem
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      !> As in harmonics_options.
      integer, intent(in) :: filter_harmonics
      type(force_list) :: laws
      integer :: k

      call new_forces(contact, springs, problem%joint%row, problem%joint%spring_row, &
                      problem%forces%entry(problem%forces%pairs)%law%facts%follows_events, &
                      filter_harmonics, laws)
      do k = 1, laws%n_laws
         associate (old => problem%forces%entry(k)%law%prediction, &
                    new => laws%entry(k)%law%prediction)
            if (.not. new%takes_balance) cycle
            ! The structure gave it, and has not changed.
            new%stiffness = old%stiffness
            if (.not. allocated(old%inertia)) cycle
            new%inertia = old%inertia
            new%damping = old%damping
         end associate
      end do
      do k = 1, laws%n_laws
         call move_alloc(laws%entry(k)%law, problem%forces%entry(k)%law)
      end do
   end subroutine renew_laws

   !> Workspaces hold constants of their laws; where the march starts stays.
   subroutine renew_workspaces(state)
      class(balance_state), intent(inout) :: state
      type(force_workspace), allocatable :: work(:)
      integer :: k

      call state%problem%forces%reserve(state%problem%fourier, work)
      do k = 1, size(work)
         if (allocated(state%work(k)%x_start)) work(k)%x_start = state%work(k)%x_start
      end do
      call move_alloc(work, state%work)
   end subroutine renew_workspaces

   !> Of elements that move together the sum.
   subroutine derive(self, state, x, dr)
      class(moved_parameter), intent(in) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      type(slope_finder) :: finder
      type(parameter_slope) :: slope
      type(parameter_entry) :: entry
      real(wp) :: rate(size(self%base)), values(size(self%base))
      integer :: i

      rate = 1.0_wp
      if (self%is_factor) rate = self%base
      if (is_load(self%number)) then
         call state%derivative_by_loads(merge(rate(1), 0.0_wp, self%number == static_scale)/ &
                                        self%base(1), &
                                        merge(rate(1), 0.0_wp, self%number == harmonic_scale)/ &
                                        self%base(1), dr)
         return
      end if
      values = elements_at(self, state%value)
      call finder%start(state)
      call finder%prepare(state, x, residual_only=.true.)
      dr = 0.0_wp
      entry%number = self%number
      do i = 1, size(self%base)
         if (.not. abs(rate(i)) > 0.0_wp) cycle
         entry%element = i
         entry%value = values(i)
         call finder%find(state, entry, slope)
         dr = dr + rate(i)*reshape(slope%residual, [size(dr)])
      end do
   end subroutine derive

end module fw_moved_parameter
