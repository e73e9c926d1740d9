!> A problem that follows a parameter of its case: states multiply loads, laws are made anew in
!> place, and only what changes matrices condenses the structure again.
module fw_parameter_problem
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_balance_state, only: new_balance_state
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

   public :: parameter_problem, renew_state

   type :: parameter_problem
      !> The case at the present value.
      type(case_type) :: case
      !> As in parameter_words, and whether values are factors of those of the case.
      integer :: number = 0
      logical :: by_factor = .false.
      !> Of the case as it was read.
      real(wp), allocatable :: base(:)
      !> Present value or factor, and the numbers that the problem was built with.
      real(wp) :: value = 0.0_wp
      real(wp), allocatable, private :: built(:)
      !> Counts changes: what was made of an earlier problem has to be made anew.
      integer :: version = 0
   contains
      procedure :: start
      procedure :: begin
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
      self%built = self%base
      self%value = 1.0_wp
      if (.not. by_factor) self%value = self%base(1)
   end subroutine start

   !> Bring the case to a value before anything is built of it.
   subroutine begin(self, value, error)
      class(parameter_problem), intent(inout) :: self
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      call put_parameter(self%case, self%number, self%values_at(value), error)
      if (allocated(error)) return
      self%value = value
      self%built = self%values_at(value)
   end subroutine begin

   !> What the parameter is at a value or factor, each pair or spring its own.
   pure function values_at(self, value) result(values)
      class(parameter_problem), intent(in) :: self
      real(wp), intent(in) :: value
      real(wp) :: values(size(self%base))

      values = value
      if (self%by_factor) values = value*self%base
   end function values_at

   !> Bring case, problem and a state of it to a value or factor. States are made anew, as
   !> `renew_state` does with others of the problem; their unknowns stay those that they were,
   !> unless the structure keeps other modes then.
   subroutine bring(self, value, problem, system, error)
      class(parameter_problem), intent(inout) :: self
      real(wp), intent(in) :: value
      type(balance_problem), intent(inout), target :: problem
      type(balance_state), intent(inout) :: system
      type(error_type), allocatable, intent(out) :: error
      type(balance_state), allocatable :: unused
      real(wp), allocatable :: now(:)

      if (abs(value - self%value) <= 0.0_wp) return
      now = self%values_at(value)
      call put_parameter(self%case, self%number, now, error)
      if (allocated(error)) return
      self%value = value
      self%version = self%version + 1
      if (self%number == harmonic_scale) then
         call system%set_load_factors(1.0_wp, now(1)/self%built(1))
      else if (self%number == static_scale) then
         call system%set_load_factors(now(1)/self%built(1), 1.0_wp)
      else if (is_of_matrices(self%number)) then
         allocate (unused)
         call build_system(self%case, problem, unused, error)
      else
         call renew_forces(self%case, problem)
      end if
      if (.not. allocated(error)) call renew_state(problem, system)
   end subroutine bring

   !> A state of a problem that has changed, with the choices of the one before; it goes to its
   !> frequency again (set_frequency).
   subroutine renew_state(problem, state)
      type(balance_problem), intent(in), target :: problem
      type(balance_state), intent(inout) :: state
      type(balance_state), allocatable :: new

      allocate (new)
      call new_balance_state(problem, new)
      new%interrupt => state%interrupt
      new%reduced = state%reduced
      new%load_share = state%load_share
      call new%take_loads(state)
      state = new
   end subroutine renew_state

end module fw_parameter_problem
