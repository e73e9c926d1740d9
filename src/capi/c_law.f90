!> fw_add_law of fretwear.h: an element whose forces a function of the calling program gives.
module fw_c_law
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_funptr, c_int, &
      c_intptr_t, c_null_funptr, c_null_ptr, c_ptr, c_size_t
   use fw_c_interface, only: take_text
   use fw_calls, only: call_refuse
   use fw_error, only: error_type, status_usage
   use fw_handles, only: enter, handle_type, leave
   use fw_kinds, only: wp
   use fw_text, only: to_text
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   !> What lies beyond is memory that was not filled in.
   integer, parameter :: most_inputs = 100, most_parameters = 1000000, most_states = 1000
   !> Bits of flags: FW_LAW_ODD, FW_LAW_THREAD_SAFE, FW_LAW_NO_DERIVATIVE.
   integer, parameter :: bit_odd = 0, bit_thread_safe = 1, bit_no_derivative = 2

   !> struct fw_law: the order and the kinds are part of the binary interface.
   type, bind(c) :: c_law
      integer(c_size_t) :: size = 0_c_size_t
      integer(c_int) :: n_in = 0_c_int, n_state = 0_c_int, n_parameters = 0_c_int
      type(c_ptr) :: side_1 = c_null_ptr, side_2 = c_null_ptr, parameters = c_null_ptr
      type(c_ptr) :: start = c_null_ptr
      integer(c_int) :: flags = 0_c_int
      type(c_funptr) :: force = c_null_funptr, step = c_null_funptr
      type(c_ptr) :: user = c_null_ptr
   end type c_law

contains

   !> The struct and its arrays are copied; the function and `user` have to live as long as the
   !> handle.
   integer(c_int) function c_add_law(handle, name, law) bind(c, name='fw_add_law') result(status)
      type(c_ptr), value :: handle, name, law
      type(c_law), pointer :: given
      type(user_element) :: element
      type(handle_type), pointer :: session
      type(error_type), allocatable :: error
      character(:), allocatable :: name_text
      character(80) :: fault
      integer :: id

      id = 0
      if (transfer(handle, 0_c_intptr_t) <= huge(id)) id = int(transfer(handle, 0_c_intptr_t))
      call take_text(name, name_text)
      fault = 'null pointer'
      if (allocated(name_text) .and. c_associated(law)) then
         call c_f_pointer(law, given)
         call take_law(given, name_text, element, fault)
      end if
      if (fault /= '') then
         status = int(call_refuse(id, 'fw_add_law: '//trim(fault)), c_int)
         return
      end if
      call enter(id, session)
      status = int(status_usage, c_int)
      if (.not. associated(session)) return
      call session%session%add_element(element)
      status = int(leave(session, error), c_int)
   end function c_add_law

   !> An element of what the struct says. Each pointer is looked at before it is followed: the fault
   !> of a program in C is told in words where it can be.
   subroutine take_law(given, name, element, fault)
      type(c_law), intent(in) :: given
      character(*), intent(in) :: name
      type(user_element), intent(out) :: element
      !> Blank where nothing is wrong.
      ! allow(C072): a text of the caller
      character(*), intent(out) :: fault
      integer(c_int), pointer :: sides(:)
      real(c_double), pointer :: constants(:)

      fault = ''
      if (given%size /= storage_size(given)/8) then
         fault = 'law.size is '//to_text(int(given%size))//': must be sizeof(fw_law) = '// &
                 to_text(storage_size(given)/8)
      else if (given%n_in < 1 .or. given%n_in > most_inputs) then
         fault = 'law.n_in is '//to_text(int(given%n_in))//': must be from 1 to '// &
                 to_text(most_inputs)
      else if (given%n_state < 0 .or. given%n_state > most_states) then
         fault = 'law.n_state is '//to_text(int(given%n_state))//': must be from 0 to '// &
                 to_text(most_states)
      else if (.not. c_associated(given%side_1)) then
         fault = 'law.side_1 is null'
      else if (given%n_state == 0 .and. (c_associated(given%step) .or. &
                                         .not. c_associated(given%force))) then
         fault = 'law.force is null, or law.step is not, without states'
      else if (given%n_state > 0 .and. (c_associated(given%force) .or. &
                                        .not. c_associated(given%step))) then
         fault = 'law.step is null, or law.force is not, with states'
      else if (given%n_parameters < 0 .or. given%n_parameters > most_parameters .or. &
               (given%n_parameters > 0 .and. .not. c_associated(given%parameters))) then
         fault = 'law.n_parameters is negative, or law.parameters is null'
      end if
      if (fault /= '') return
      element%name = name
      element%n_in = int(given%n_in)
      call c_f_pointer(given%side_1, sides, [given%n_in])
      element%side_1 = int(sides)
      element%side_2 = 0*element%side_1
      if (c_associated(given%side_2)) then
         call c_f_pointer(given%side_2, sides, [given%n_in])
         element%side_2 = int(sides)
      end if
      allocate (element%parameters(given%n_parameters))
      if (given%n_parameters > 0) then
         call c_f_pointer(given%parameters, constants, [given%n_parameters])
         element%parameters = constants
      end if
      element%is_odd = btest(given%flags, bit_odd)
      element%is_thread_safe = btest(given%flags, bit_thread_safe)
      element%has_derivative = .not. btest(given%flags, bit_no_derivative)
      element%function = given%force
      element%n_state = int(given%n_state)
      if (element%n_state > 0) then
         element%function = given%step
         allocate (element%start(element%n_state), source=0.0_wp)
         if (c_associated(given%start)) then
            call c_f_pointer(given%start, constants, [given%n_state])
            element%start = constants
         end if
      end if
      element%user = given%user
   end subroutine take_law

end module fw_c_law
