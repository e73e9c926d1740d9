!> Laws that a user writes: a function of a shared library or of a calling program, in C or Fortran.
!>
!> A function gets the displacements of one element and their rates by time at all instants, and
!> gives its forces, and their slopes where they are wanted. It returns 0; a negative number where
!> it has no force for this motion, so that the step is taken back; a positive one ends the run.
!> Arrays are as in C: (n_time, n_in) with inputs innermost.
!>
!> A law that remembers gives a step instead: from its state at one instant to that at the next.
module fw_user_element
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_procpointer, c_funptr, &
      c_int, c_loc, c_null_funptr, c_null_ptr, c_ptr, c_size_t
   use fw_kinds, only: wp
   use fw_step_room, only: step_answer
   implicit none (type, external)
   private

   public :: bad_number, law_call, user_call, user_element, user_law_type

   !> The status of a force that is not a number.
   !> Negative numbers are those of functions; this one is beyond what anybody returns on purpose.
   integer, parameter :: bad_number = -1000000

   !> struct fw_law_call of fretwear.h: the order and the kinds are part of the binary interface.
   type, bind(c) :: law_call
      integer(c_size_t) :: size = 0_c_size_t
      integer(c_int) :: n_time = 0_c_int, n_in = 0_c_int, n_state = 0_c_int
      integer(c_int) :: n_parameters = 0_c_int, wants_derivative = 0_c_int
      real(c_double) :: omega = 0.0_c_double
      type(c_ptr) :: tau = c_null_ptr, u = c_null_ptr, v = c_null_ptr, parameters = c_null_ptr
   end type law_call

   !> fw_law_force and fw_law_step of fretwear.h. Results are addresses, of which slopes may be
   !> null: arrays by reference could not say that they are not wanted.
   abstract interface
      integer(c_int) function c_law_force(user, call, force, du, dv) bind(c)
         import :: c_int, c_ptr, law_call
         implicit none (type, external)
         type(c_ptr), value :: user
         type(law_call), intent(in) :: call
         type(c_ptr), value :: force, du, dv
      end function c_law_force

      integer(c_int) function c_law_step(user, call, state, state_after, force, dstate, dforce) &
         bind(c)
         import :: c_int, c_ptr, law_call
         implicit none (type, external)
         type(c_ptr), value :: user
         type(law_call), intent(in) :: call
         type(c_ptr), value :: state, state_after, force, dstate, dforce
      end function c_law_step
   end interface

   !> The same for a law in Fortran: displacements and rates (n_in, n_time), inputs innermost.
   type :: user_call
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      logical :: wants_derivative = .false.
      !> omega t at the instants (n_time).
      real(wp), pointer :: tau(:) => null()
      real(wp), pointer :: u(:, :) => null(), v(:, :) => null()
      !> (n_parameters)
      real(wp), pointer :: parameters(:) => null()
   end type user_call

   !> What a program in Fortran extends, with one of the two.
   !> A law without states has `evaluate`, one with states `step`. Neither is deferred, so that a
   !> type need not write the other; which of the two is called follows from `start` of `add_law`,
   !> and the one that was not written ends the run.
   type, abstract :: user_law_type
   contains
      procedure :: evaluate
      procedure :: step
   end type user_law_type

   type :: user_element
      !> For messages: the symbol, or the name that the program gave.
      character(40) :: name = ''
      integer :: n_in = 1
      !> Signed dofs (n_in), and constants that are handed on.
      integer, allocatable :: side_1(:), side_2(:)
      real(wp), allocatable :: parameters(:)
      !> What the user promises: odd forces, calls from several threads, slopes.
      logical :: is_odd = .false., is_thread_safe = .false., has_derivative = .true.
      !> Numbers that it remembers from instant to instant, and those of the unstrained element
      !> (n_state); none: forces follow from the motion at the same instant.
      integer :: n_state = 0
      real(wp), allocatable :: start(:)
      !> A step where there are states.
      !> In C, of a library or a program, with the pointer that is handed on to it; or an object of
      !> a program in Fortran, which is pointed to, since it belongs to that program.
      type(c_funptr) :: function = c_null_funptr
      type(c_ptr) :: user = c_null_ptr
      class(user_law_type), pointer :: object => null()
   contains
      procedure :: ask
      procedure :: ask_step
   end type user_element

contains

   !> Forces and slopes of an element at all instants: of a law without states. Slopes (j, i,
   !> instant) of force i by displacement j and by rate j come in as zeros.
   subroutine evaluate(self, call, force, du, dv, status)
      class(user_law_type), intent(inout) :: self
      type(user_call), intent(in) :: call
      !> On the side of the stiffness (n_in, n_time).
      real(wp), intent(out) :: force(:, :)
      real(wp), intent(inout) :: du(:, :, :), dv(:, :, :)
      !> 0, or as a function of C returns it; comes in as 0.
      integer, intent(inout) :: status

      force = 0.0_wp
      status = 1
      associate (unused => self, unused_call => call, unused_du => du, unused_dv => dv)
      end associate
   end subroutine evaluate

   !> One step of a law with states, between the two instants of the call: the state after it, the
   !> forces there, and slopes (j, i) where they are wanted: of state i by (state, u, v before, u, v
   !> after), of force i by (state after, u, v after). They come in as zeros.
   subroutine step(self, call, state, state_after, force, dstate, dforce, status)
      class(user_law_type), intent(inout) :: self
      type(user_call), intent(in) :: call
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: state_after(:), force(:)
      real(wp), intent(inout) :: dstate(:, :), dforce(:, :)
      integer, intent(inout) :: status

      state_after = state
      force = 0.0_wp
      status = 1
      associate (unused => self, unused_call => call, unused_slopes => dstate, further => dforce)
      end associate
   end subroutine step

   !> Forces of an element, and their slopes where `wants` says so.
   subroutine ask(self, omega, tau, u, v, wants, force, du, dv, status, instant)
      class(user_element), intent(in), target :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      real(wp), intent(in), target, contiguous :: tau(:)
      !> (n_in, n_time)
      real(wp), intent(in), target, contiguous :: u(:, :), v(:, :)
      logical, intent(in) :: wants
      real(wp), intent(out), target, contiguous :: force(:, :)
      !> (n_in of the input, of the force, n_time)
      real(wp), intent(inout), target, contiguous :: du(:, :, :), dv(:, :, :)
      !> 0, what the function returned, or `bad_number`; and where that shows first.
      integer, intent(out) :: status, instant
      integer :: k

      ! Zeros everywhere: a function need not set slopes that are none.
      status = 0
      instant = 1
      force = 0.0_wp
      if (wants) du = 0.0_wp
      if (wants) dv = 0.0_wp
      if (associated(self%object)) then
         call ask_object(self, omega, tau, u, v, wants, force, du, dv, status)
      else if (c_associated(self%function)) then
         call ask_function(self, omega, tau, u, v, wants, force, du, dv, status)
      end if
      if (status /= 0) return
      ! A number that is not finite would spread over the whole balance and lose its place.
      do k = 1, size(u, 2)
         if (.not. all(ieee_is_finite(force(:, k)))) status = bad_number
         if (wants) then
            if (.not. all(ieee_is_finite(du(:, :, k)))) status = bad_number
            if (.not. all(ieee_is_finite(dv(:, :, k)))) status = bad_number
         end if
         if (status == 0) cycle
         instant = k
         return
      end do
   end subroutine ask

   !> The function of C. Arrays of the caller go in by their addresses, nothing is copied: they are
   !> contiguous with the inputs innermost, which is the order of C.
   subroutine ask_function(self, omega, tau, u, v, wants, force, du, dv, status)
      class(user_element), intent(in), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(in), target, contiguous :: tau(:)
      real(wp), intent(in), target, contiguous :: u(:, :), v(:, :)
      logical, intent(in) :: wants
      real(wp), intent(inout), target, contiguous :: force(:, :)
      real(wp), intent(inout), target, contiguous :: du(:, :, :), dv(:, :, :)
      integer, intent(out) :: status
      procedure(c_law_force), pointer :: function
      type(law_call) :: request
      type(c_ptr) :: by_u, by_v

      call fill_request(self, omega, tau, u, v, wants, request)
      by_u = c_null_ptr
      by_v = c_null_ptr
      if (wants) then
         by_u = c_loc(du)
         by_v = c_loc(dv)
      end if
      call c_f_procpointer(self%function, function)
      status = int(function(self%user, request, c_loc(force), by_u, by_v))
   end subroutine ask_function

   !> The object of a program in Fortran, by pointers to the same arrays.
   subroutine ask_object(self, omega, tau, u, v, wants, force, du, dv, status)
      class(user_element), intent(in), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(in), target, contiguous :: tau(:)
      real(wp), intent(in), target, contiguous :: u(:, :), v(:, :)
      logical, intent(in) :: wants
      real(wp), intent(inout), contiguous :: force(:, :)
      real(wp), intent(inout), contiguous :: du(:, :, :), dv(:, :, :)
      integer, intent(inout) :: status
      type(user_call) :: request

      call fill_call(self, omega, tau, u, v, wants, request)
      call self%object%evaluate(request, force, du, dv, status)
   end subroutine ask_object

   !> One step of an element with states.
   subroutine ask_step(self, omega, tau, u, v, wants, state, after, slope, status, answer)
      class(user_element), intent(in), target :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      !> At both ends, u and v (n_in, 2).
      real(wp), intent(in), target, contiguous :: tau(:), u(:, :), v(:, :)
      logical, intent(in) :: wants
      real(wp), intent(in), target, contiguous :: state(:)
      !> The state and the forces at the end (n_state + n_in).
      real(wp), intent(out), contiguous :: after(:)
      !> Of these by (state, u, v before, u, v after), outputs last.
      real(wp), intent(inout), contiguous :: slope(:, :)
      !> 0, what the function returned, or `bad_number`.
      integer, intent(out) :: status
      !> Of this element.
      type(step_answer), intent(inout), target :: answer
      procedure(c_law_step), pointer :: function
      type(law_call) :: request
      type(user_call) :: fortran_request
      integer :: i, j, m, n

      n = self%n_state
      m = self%n_in
      answer%state = state
      answer%force = 0.0_wp
      if (wants) answer%by_before = 0.0_wp
      if (wants) answer%by_after = 0.0_wp
      status = 0
      if (associated(self%object)) then
         call fill_call(self, omega, tau, u, v, wants, fortran_request)
         call self%object%step(fortran_request, state, answer%state, answer%force, &
                               answer%by_before, answer%by_after, status)
      else if (c_associated(self%function)) then
         call fill_request(self, omega, tau, u, v, wants, request)
         call c_f_procpointer(self%function, function)
         if (wants) then
            status = int(function(self%user, request, c_loc(state), c_loc(answer%state), &
                                  c_loc(answer%force), c_loc(answer%by_before), &
                                  c_loc(answer%by_after)))
         else
            status = int(function(self%user, request, c_loc(state), c_loc(answer%state), &
                                  c_loc(answer%force), c_null_ptr, c_null_ptr))
         end if
      end if
      after(:n) = answer%state
      after(n + 1:) = answer%force
      if (status /= 0) return
      if (.not. all(ieee_is_finite(after))) status = bad_number
      if (.not. wants) return
      ! The function gives slopes of its forces by the state after the step, which it has at hand;
      ! the march wants them by what the step began with. d(force)/d(before) = d(force)/d(state
      ! after) d(state after)/d(before), and what the inputs at the end give directly.
      slope(:, :n) = answer%by_before
      slope(:, n + 1:) = 0.0_wp
      do i = 1, m
         do j = 1, n
            slope(:, n + i) = slope(:, n + i) + answer%by_before(:, j)*answer%by_after(j, i)
         end do
      end do
      slope(n + 2*m + 1:, n + 1:) = slope(n + 2*m + 1:, n + 1:) + answer%by_after(n + 1:, :)
      if (.not. all(ieee_is_finite(slope))) status = bad_number
   end subroutine ask_step

   !> What a function of C is told. `size` is that of this struct: later versions may be longer, and
   !> a function that was built with this one finds its numbers where they were.
   subroutine fill_request(self, omega, tau, u, v, wants, request)
      class(user_element), intent(in), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(in), target, contiguous :: tau(:), u(:, :), v(:, :)
      logical, intent(in) :: wants
      type(law_call), intent(out) :: request

      request%size = storage_size(request)/8
      request%n_time = int(size(u, 2), c_int)
      request%n_in = int(size(u, 1), c_int)
      request%n_state = int(self%n_state, c_int)
      request%n_parameters = int(size(self%parameters), c_int)
      request%omega = omega
      request%tau = c_loc(tau)
      request%u = c_loc(u)
      request%v = c_loc(v)
      if (size(self%parameters) > 0) request%parameters = c_loc(self%parameters)
      if (wants) request%wants_derivative = 1_c_int
   end subroutine fill_request

   !> What an object of Fortran is told.
   subroutine fill_call(self, omega, tau, u, v, wants, request)
      class(user_element), intent(in), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(in), target, contiguous :: tau(:), u(:, :), v(:, :)
      logical, intent(in) :: wants
      type(user_call), intent(out) :: request

      request%omega = omega
      request%wants_derivative = wants
      request%tau => tau
      request%u => u
      request%v => v
      request%parameters => self%parameters
   end subroutine fill_call

end module fw_user_element
