!> Room of one step of an element that remembers (fw_user_element, fw_user_path), so that nothing is
!> allocated while it is stepped.
module fw_step_room
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: new_step_answer, new_step_room, step_answer, step_room

   !> What a function fills: state and forces after a step, and their slopes, inputs first.
   type :: step_answer
      real(wp), allocatable :: state(:), force(:), by_before(:, :), by_after(:, :)
   end type step_answer

   type :: step_room
      !> Angles, displacements and rates at both ends, as they are and moved (n_in, 2).
      real(wp) :: tau(2) = 0.0_wp
      real(wp), allocatable :: u(:, :), v(:, :), u_at(:, :), v_at(:, :)
      !> State and forces after it, of three calls (n_state + n_in); a state that is moved.
      real(wp), allocatable :: after(:), ahead(:), behind(:), state_at(:)
      !> Sizes of (state, u, v before, u, v after), and those of the inputs (4 n_in).
      real(wp), allocatable :: scale(:), sizes(:)
      type(step_answer) :: answer
      !> Where no slopes are wanted.
      real(wp), allocatable :: none(:, :)
      !> Of a turn (n_state, n_state): its derivative and what inverts it; change and scale of the
      !> states.
      real(wp), allocatable :: turn(:, :), left(:, :), right(:, :), inverse(:, :)
      real(wp), allocatable :: change(:), size(:), column(:)
   end type step_room

contains

   pure type(step_answer) function new_step_answer(n, m) result(self)
      !> States and inputs.
      integer, intent(in) :: n, m

      allocate (self%state(n), self%force(m), source=0.0_wp)
      allocate (self%by_before(n + 4*m, n), self%by_after(n + 2*m, m), source=0.0_wp)
   end function new_step_answer

   pure type(step_room) function new_step_room(n, m) result(self)
      !> States and inputs.
      integer, intent(in) :: n, m

      allocate (self%u(m, 2), self%v(m, 2), self%u_at(m, 2), self%v_at(m, 2), source=0.0_wp)
      allocate (self%after(n + m), self%ahead(n + m), self%behind(n + m), source=0.0_wp)
      allocate (self%state_at(n), self%scale(n + 4*m), self%sizes(4*m), source=0.0_wp)
      self%answer = new_step_answer(n, m)
      allocate (self%none(n + 4*m, n + m), source=0.0_wp)
      allocate (self%turn(n, n), self%left(n, n), self%right(n, n), self%inverse(n, n), &
                source=0.0_wp)
      allocate (self%change(n), self%size(n), self%column(n), source=0.0_wp)
   end function new_step_room

end module fw_step_room
