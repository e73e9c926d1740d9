!> A named parameter of a case that moves while its problem stays: what a sweep over a load or a
!> friction coefficient goes along, and what a resonance is tracked over.
!>
!> Loads get factors. Pairs and springs get laws made anew from their data, as the builder makes
!> them; the stiffness that the structure gave a rigid law stays, as a number of the method on which
!> its solutions do not depend. What changes matrices condenses the structure again.
module fw_moved_parameter
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state, parameter_mover
   use fw_body, only: body_type
   use fw_case_forces, only: new_forces
   use fw_contact_data, only: contact_type, spring_type
   use fw_elements, only: element_list
   use fw_error, only: error_type
   use fw_force_list, only: force_list
   use fw_kinds, only: wp
   use fw_moved_structure, only: move_structure
   use fw_parameter_slopes, only: parameter_entry, parameter_slope, slope_finder
   use fw_parameter_values, only: get_parameter, put_parameter
   use fw_parameters, only: harmonic_scale, is_of_loads, is_of_matrices, is_of_sectors, &
      is_per_element, static_scale
   implicit none (type, external)
   private

   public :: moved_parameter

   type, extends(parameter_mover) :: moved_parameter
      !> As in fw_parameters.
      integer :: number = 0
      !> The value is a factor of those of the case, or the value itself of all elements.
      logical :: by_factor = .false.
      !> Values of the case as it was read: one, or one for each element.
      real(wp), allocatable :: base(:)
      !> What vibrates, at the present value: pairs and springs, and the rest where matrices change;
      !> none of it for loads.
      class(body_type), allocatable :: body
      !> As in harmonics_options; the frequency where the case begins [rad/s].
      integer :: filter_harmonics = 0
      real(wp) :: first = 0.0_wp
      !> The eps of rigid laws stays where matrices change, so that a residual has the slope that
      !> `derive` gives.
      logical :: holds_eps = .false.
      !> What the problem was built with.
      real(wp), allocatable :: built(:)
   contains
      procedure :: take
      procedure :: apply
      procedure :: change
      procedure :: derive
      procedure :: find_slope
      procedure :: values_at
   end type moved_parameter

contains

   !> A parameter of a case, which the case has (fw_parameter_checks).
   subroutine take(self, body, number, by_factor)
      class(moved_parameter), intent(inout) :: self
      class(body_type), intent(in) :: body
      integer, intent(in) :: number
      logical, intent(in) :: by_factor

      self%number = number
      self%by_factor = by_factor
      call get_parameter(body, number, self%base)
      self%built = self%base
      if (is_of_matrices(number)) then
         allocate (self%body, source=body)
      else if (.not. is_of_loads(number)) then
         ! Loads are moved by factors of the state, all else by other laws or matrices. Matrices
         ! are large, and stay.
         allocate (self%body)
         self%body%contact = body%contact
         self%body%springs = body%springs
         self%body%elements = body%elements
         if (is_of_sectors(number)) self%body%model%cyclic%deviation = body%model%cyclic%deviation
      end if
   end subroutine take

   !> What the parameter is at a value or factor, each pair or spring its own.
   pure function values_at(self, value) result(values)
      class(moved_parameter), intent(in) :: self
      real(wp), intent(in) :: value
      real(wp) :: values(size(self%base))

      values = value
      if (self%by_factor) values = value*self%base
   end function values_at

   subroutine apply(self, state, value, error)
      class(moved_parameter), intent(inout) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      if (.not. is_of_loads(self%number)) then
         call put_parameter(self%body, self%number, self%values_at(value), error)
         if (allocated(error)) return
      end if
      call self%change(state, value, error)
   end subroutine apply

   !> Bring the problem of a state, and the state, to a value at which the case is.
   subroutine change(self, state, value, error)
      class(moved_parameter), intent(in) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      associate (factor => self%values_at(value)/self%built)
         if (self%number == harmonic_scale) then
            call state%set_load_factors(state%load_factor(static=.true.), factor(1))
         else if (self%number == static_scale) then
            call state%set_load_factors(factor(1), state%load_factor(static=.false.))
         else if (is_of_matrices(self%number)) then
            call move_structure(self%body%model, self%first, self%holds_eps, state, error)
         else if (is_of_sectors(self%number)) then
            call state%problem%structure%take_deviation(self%body%model%cyclic%deviation)
            call state%renew_structure(error)
         else
            call renew_laws(state%problem, self%body%contact, self%body%springs, &
                            self%body%elements, self%filter_harmonics)
            call state%renew_workspaces()
         end if
      end associate
   end subroutine change

   !> The laws of a problem anew, from pairs and springs whose constants have changed since it was
   !> built. States take new workspaces then.
   subroutine renew_laws(problem, contact, springs, elements, filter_harmonics)
      type(balance_problem), intent(inout) :: problem
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      !> As in harmonics_options.
      integer, intent(in) :: filter_harmonics
      type(force_list) :: laws
      integer :: k

      call new_forces(contact, springs, elements, problem%joint%row, problem%joint%spring_row, &
                      problem%joint%element_row, &
                      problem%forces%entry(problem%forces%pairs)%law%facts%locates_events, &
                      filter_harmonics, laws)
      do k = 1, laws%n_laws
         associate (old => problem%forces%entry(k)%law%prediction, &
                    new => laws%entry(k)%law%prediction)
            if (.not. new%takes_balance) cycle
            ! The structure gave it, and has not changed.
            call new%take_eps(old)
         end associate
         call laws%entry(k)%law%take_prediction()
      end do
      do k = 1, laws%n_laws
         call move_alloc(laws%entry(k)%law, problem%forces%entry(k)%law)
      end do
   end subroutine renew_laws

   !> Of elements that move together the sum.
   subroutine derive(self, state, value, x, dr, observed)
      class(moved_parameter), intent(in) :: self
      class(balance_state), intent(inout) :: state
      real(wp), intent(in) :: value
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      complex(wp), intent(out), optional :: observed(:, :)
      type(slope_finder) :: finder
      type(parameter_slope) :: slope
      real(wp) :: rate

      if (is_of_loads(self%number) .and. .not. present(observed)) then
         ! Its value may be 0.
         rate = merge(1.0_wp, 1.0_wp/self%base(1), self%by_factor)
         call state%derivative_by_loads(merge(rate, 0.0_wp, self%number == static_scale), &
                                        merge(rate, 0.0_wp, self%number == harmonic_scale), dr)
         return
      end if
      call self%find_slope(finder, state, x, value, slope, residual_only= &
                           .not. (is_of_matrices(self%number) .or. is_of_loads(self%number)))
      dr = reshape(slope%residual, [size(dr)])
      if (present(observed)) observed = slope%observed
   end subroutine derive

   !> Slope by the value or the factor that all elements share, at the motion x where the state was
   !> evaluated and linearized: the sum over the numbers that the parameter is made of.
   subroutine find_slope(self, finder, state, x, value, slope, residual_only)
      class(moved_parameter), intent(in) :: self
      type(slope_finder), intent(inout) :: finder
      class(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: value
      type(parameter_slope), intent(out) :: slope
      !> As in slope_finder%prepare.
      logical, intent(in), optional :: residual_only
      type(parameter_slope) :: one
      type(parameter_entry) :: entry
      real(wp) :: rate, values(size(self%base))
      integer :: i

      call finder%start(state)
      call finder%prepare(state, x, residual_only)
      values = self%values_at(value)
      entry%number = self%number
      if (is_of_matrices(self%number)) then
         entry%change = findloc(self%body%model%changes%parameter, self%number, dim=1)
      end if
      do i = 1, size(values)
         entry%value = values(i)
         if (is_per_element(self%number)) entry%element = i
         rate = 1.0_wp
         if (self%by_factor) rate = self%base(i)
         call finder%find(state, entry, one)
         if (i == 1) then
            slope = one
            slope%residual = rate*one%residual
            slope%observed = rate*one%observed
            slope%work = rate*one%work
         else
            slope%residual = slope%residual + rate*one%residual
            slope%observed = slope%observed + rate*one%observed
            slope%work = slope%work + rate*one%work
         end if
      end do
   end subroutine find_slope

end module fw_moved_parameter
