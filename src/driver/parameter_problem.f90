!> A problem that follows a parameter of its case: loads are multiplied and laws made anew in place,
!> and only what changes matrices condenses the structure again.
module fw_parameter_problem
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_values, only: get_parameter
   use fw_parameter_values, only: put_parameter
   use fw_parameters, only: harmonic_scale
   use fw_parameters, only: is_of_matrices
   use fw_parameters, only: static_scale
   use fw_problem, only: build_system
   use fw_problem, only: renew_forces
   implicit none (type, external)
   private

   public :: parameter_problem

   type :: parameter_problem
      !> The case at the present value.
      type(case_type) :: case
      !> As in parameter_words, and whether values are factors of those of the case.
      integer :: number = 0
      logical :: by_factor = .false.
      !> Of the case as it was read.
      real(wp), allocatable :: base(:)
      !> Present value or factor.
      real(wp) :: value = 0.0_wp
      !> Counts changes: what was made of an earlier problem has to be made anew.
      integer :: version = 0
   contains
      procedure :: start
      procedure :: bring
      procedure :: values_at
   end type parameter_problem

contains

   !> Take a case with its own values; the problem is one of this case.
   subroutine start(self, case, number, by_factor)
      class(parameter_problem), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      logical, intent(in) :: by_factor

      self%case = case
      self%number = number
      self%by_factor = by_factor
      call get_parameter(case, number, self%base)
      self%value = 1.0_wp
      if (.not. by_factor) self%value = self%base(1)
   end subroutine start

   !> What the parameter is at a value or factor, each pair or spring its own.
   pure function values_at(self, value) result(values)
      class(parameter_problem), intent(in) :: self
      real(wp), intent(in) :: value
      real(wp) :: values(size(self%base))

      values = value
      if (self%by_factor) values = value*self%base
   end function values_at

   !> Bring case, problem and state to a value or factor. The state goes to its frequency again
   !> afterwards (set_frequency), and keeps its interrupt; solutions keep their unknowns, unless
   !> the number of these is another.
   subroutine bring(self, value, problem, system, error)
      class(parameter_problem), intent(inout) :: self
      real(wp), intent(in) :: value
      type(balance_problem), intent(inout), target :: problem
      type(balance_state), intent(inout) :: system
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: ratio
      real(wp), allocatable :: before(:)

      if (abs(value - self%value) <= 0.0_wp) return
      call get_parameter(self%case, self%number, before)
      call put_parameter(self%case, self%number, self%values_at(value), error)
      if (allocated(error)) return
      self%value = value
      self%version = self%version + 1
      select case (self%number)
      case (harmonic_scale, static_scale)
         associate (now => self%values_at(value))
            ratio = now(1)/before(1)
         end associate
         if (self%number == static_scale) then
            call problem%structure%scale_loads(ratio, 1.0_wp)
         else
            call problem%structure%scale_loads(1.0_wp, ratio)
         end if
         system%structure_state%omega = -1.0_wp
      case default
         if (is_of_matrices(self%number)) then
            call build_again(self%case, problem, system, error)
         else
            call renew_forces(self%case, problem)
            call problem%forces%reserve(problem%fourier, system%work)
         end if
      end select
   end subroutine bring

   !> Matrices are condensed anew.
   subroutine build_again(case, problem, system, error)
      type(case_type), intent(in) :: case
      type(balance_problem), intent(inout), target :: problem
      type(balance_state), intent(inout) :: system
      type(error_type), allocatable, intent(out) :: error
      type(balance_state) :: new

      call build_system(case, problem, new, error)
      if (allocated(error)) return
      new%interrupt => system%interrupt
      new%reduced = system%reduced
      new%load_share = system%load_share
      system = new
   end subroutine build_again

end module fw_parameter_problem
