!> A problem that follows a parameter of its case, with the case itself and several states: what a
!> resonance is tracked in.
module fw_parameter_problem
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_body, only: body_type
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_moved_parameter, only: moved_parameter
   use fw_parameter_values, only: get_parameter, put_parameter
   implicit none (type, external)
   private

   public :: parameter_problem, renew_state

   !> All of it stands at the present value; not to be copied once it is started.
   type, extends(moved_parameter) :: parameter_problem
      !> The whole case, of which the body is a part.
      type(case_type), pointer :: case => null()
      !> Present value or factor.
      real(wp) :: value = 0.0_wp
      !> Counts changes: what was made of an earlier problem has to be made anew.
      integer :: version = 0
   contains
      procedure :: start
      procedure :: begin
      procedure :: bring
   end type parameter_problem

contains

   !> Take a case with its own values; the problem is one of this case.
   subroutine start(self, case, number, by_factor)
      class(parameter_problem), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      logical, intent(in) :: by_factor
      class(case_type), allocatable :: whole

      allocate (whole, source=case)
      call hold(whole, self%case, self%body)
      self%first = case%sweep%start
      self%filter_harmonics = case%harmonics%filter_harmonics
      self%number = number
      self%by_factor = by_factor
      call get_parameter(case, number, self%base)
      self%built = self%base
      self%value = 1.0_wp
      if (.not. by_factor) self%value = self%base(1)
   end subroutine start

   !> The case becomes the body, and has a name of its own there.
   subroutine hold(whole, case, body)
      class(case_type), allocatable, target, intent(inout) :: whole
      type(case_type), pointer, intent(out) :: case
      class(body_type), allocatable, intent(out) :: body

      case => whole
      call move_alloc(whole, body)
   end subroutine hold

   !> Bring the case to a value before anything is built of it.
   subroutine begin(self, value, error)
      class(parameter_problem), intent(inout) :: self
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      call put_parameter(self%body, self%number, self%values_at(value), error)
      if (allocated(error)) return
      self%value = value
      self%built = self%values_at(value)
   end subroutine begin

   !> Bring case, problem and a state of it to a value or factor. States are made anew, as
   !> `renew_state` does with others of the problem; their unknowns stay those that they were.
   subroutine bring(self, value, problem, system, error)
      class(parameter_problem), intent(inout) :: self
      real(wp), intent(in) :: value
      type(balance_problem), intent(inout), target :: problem
      type(balance_state), intent(inout) :: system
      type(error_type), allocatable, intent(out) :: error

      if (abs(value - self%value) <= 0.0_wp) return
      call put_parameter(self%body, self%number, self%values_at(value), error)
      if (allocated(error)) return
      self%value = value
      self%version = self%version + 1
      call self%change(system, value, error)
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
      new%reduced = state%reduced
      new%load_share = state%load_share
      call new%like(state)
      new%depth = problem%depth
      state = new
   end subroutine renew_state

end module fw_parameter_problem
