!> The functions of fretwear.h. Each turns its arguments into those of Fortran and hands over to
!> fw_calls; what they mean stands in the header.
!>
!> A handle is a number in the guise of a pointer, never an address: a stale or invented one is
!> refused by its number instead of being followed. Null pointers are refused with a message before
!> anything is touched; texts end in a null and are copied at once; arrays are read in place for the
!> time of the call. No function returns through an exception or ends the program.
module fw_c_interface
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_funptr, &
      c_int, c_intptr_t, c_loc, c_null_char, c_null_ptr, c_ptr, c_size_t
   use fw_calls, only: call_check, call_count, call_frequency, call_get, call_get_text, &
      call_load_file, call_load_text, call_message, call_new_model, call_observe, &
      call_put_integers, call_put_reals, call_refuse, call_run, call_set, call_size, call_solve, &
      call_start
   use fw_error, only: error_type, status_ok, status_usage
   use fw_handles, only: ask_to_stop, delete_handle, enter, handle_type, leave, new_handle
   use fw_kinds, only: i8
   use fw_text, only: to_text
   use fw_version, only: version
   implicit none (type, external)
   private

   public :: take_text

   !> Changes when a program that was built with an older header can no longer be linked.
   integer(c_int), parameter :: interface_version = 1_c_int

   ! With its null, in static memory: the pointer stays valid as long as the library is loaded.
   character(kind=c_char, len=len(version) + 1), target :: version_text = &
      version//c_null_char

   ! Texts between C and Fortran.
   !
   ! Letters are copied one by one: a Fortran text has no null at its end and a length of its own.

   interface
      integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: text
      end function c_strlen
   end interface

contains

   !> Static text, not to be freed.
   type(c_ptr) function c_get_version() bind(c, name='fw_get_version') result(text)
      text = c_loc(version_text)
   end function c_get_version

   !> For a program that loads the library at run time, to compare with the header it was built
   !> with.
   integer(c_int) function c_get_interface_version() bind(c, name='fw_get_interface_version') &
      result(number)
      number = interface_version
   end function c_get_interface_version

   !> Puts a new handle to *handle, or null where none is left (status as in fw_handles).
   integer(c_int) function c_create(handle) bind(c, name='fw_create') result(status)
      type(c_ptr), value :: handle
      type(c_ptr), pointer :: created
      integer :: id

      status = int(status_usage, c_int)
      if (.not. c_associated(handle)) return
      call c_f_pointer(handle, created)
      status = int(new_handle(id), c_int)
      ! The number itself in the bits of the pointer.
      created = transfer(int(id, c_intptr_t), c_null_ptr)
   end function c_create

   !> status_usage for a handle that is at work in another call: a callback cannot destroy its own.
   integer(c_int) function c_destroy(handle) bind(c, name='fw_destroy') result(status)
      type(c_ptr), value :: handle

      status = int(delete_handle(id_of(handle)), c_int)
   end function c_destroy

   !> The length of the whole message without the null, as snprintf has it: a length of buffer_size
   !> or more says that the buffer holds only its beginning.
   integer(c_size_t) function c_get_message(handle, buffer, buffer_size) &
      bind(c, name='fw_get_message') result(length)
      type(c_ptr), value :: handle, buffer
      integer(c_size_t), value :: buffer_size
      character(:), allocatable :: text

      call call_message(id_of(handle), text)
      call give_text(text, buffer, buffer_size)
      length = len(text, c_size_t)
   end function c_get_message

   !> Names of files in the namelist count from the folder of the file.
   integer(c_int) function c_load_file(handle, path) bind(c, name='fw_load_file') result(status)
      type(c_ptr), value :: handle, path
      character(:), allocatable :: path_text

      call take_text(path, path_text)
      if (allocated(path_text)) then
         status = int(call_load_file(id_of(handle), path_text), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_load_file: null pointer'), c_int)
      end if
   end function c_load_file

   !> As fw_load_file with the text in memory; `name` stands for its path in messages and for the
   !> folder from which names of files count.
   integer(c_int) function c_load_text(handle, text, name) bind(c, name='fw_load_text') &
      result(status)
      type(c_ptr), value :: handle, text, name
      character(:), allocatable :: text_text, name_text

      call take_text(text, text_text)
      call take_text(name, name_text)
      if (allocated(text_text) .and. allocated(name_text)) then
         status = int(call_load_text(id_of(handle), text_text, name_text), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_load_text: null pointer'), c_int)
      end if
   end function c_load_text

   !> The value is text of a namelist: words need no quotes.
   integer(c_int) function c_set(handle, key, value) bind(c, name='fw_set') result(status)
      type(c_ptr), value :: handle, key, value
      character(:), allocatable :: key_text, value_text

      call take_text(key, key_text)
      call take_text(value, value_text)
      if (allocated(key_text) .and. allocated(value_text)) then
         status = int(call_set(id_of(handle), key_text, value_text), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_set: null pointer'), c_int)
      end if
   end function c_set

   !> Through a text that reads back to the same bits.
   integer(c_int) function c_set_real(handle, key, value) bind(c, name='fw_set_real') result(status)
      type(c_ptr), value :: handle, key
      real(c_double), value :: value
      character(:), allocatable :: key_text

      call take_text(key, key_text)
      if (allocated(key_text)) then
         status = int(call_set(id_of(handle), key_text, to_text(value)), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_set_real: null pointer'), c_int)
      end if
   end function c_set_real

   !> As fw_set_real for a whole number.
   integer(c_int) function c_set_integer(handle, key, value) bind(c, name='fw_set_integer') &
      result(status)
      type(c_ptr), value :: handle, key
      integer(c_int), value :: value
      character(:), allocatable :: key_text

      call take_text(key, key_text)
      if (allocated(key_text)) then
         status = int(call_set(id_of(handle), key_text, to_text(value)), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_set_integer: null pointer'), c_int)
      end if
   end function c_set_integer

   !> The sizes are needed first: they decide the shapes that fw_put_reals accepts.
   integer(c_int) function c_new_model(handle, n_dof, n_pairs) bind(c, name='fw_new_model') &
      result(status)
      type(c_ptr), value :: handle
      integer(c_int), value :: n_dof, n_pairs

      status = int(call_new_model(id_of(handle), int(n_dof), int(n_pairs)), c_int)
   end function c_new_model

   !> n is the number of values, whatever the rank of the part; a matrix stands by columns.
   integer(c_int) function c_put_reals(handle, name, n, values) bind(c, name='fw_put_reals') &
      result(status)
      type(c_ptr), value :: handle, name, values
      integer(c_size_t), value :: n
      character(:), allocatable :: name_text
      real(c_double), pointer :: array(:)

      call take_text(name, name_text)
      ! n = 0 with a null pointer is refused too: there is no part of a model that is empty.
      if (allocated(name_text) .and. c_associated(values) .and. n >= 0_c_size_t) then
         call c_f_pointer(values, array, [n])
         status = int(call_put_reals(id_of(handle), name_text, array), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_put_reals: null pointer'), c_int)
      end if
   end function c_put_reals

   !> As fw_put_reals for dof numbers, which count from 1, 0 for the ground.
   integer(c_int) function c_put_integers(handle, name, n, values) bind(c, name='fw_put_integers') &
      result(status)
      type(c_ptr), value :: handle, name, values
      integer(c_size_t), value :: n
      character(:), allocatable :: name_text
      integer(c_int), pointer :: array(:)

      call take_text(name, name_text)
      if (allocated(name_text) .and. c_associated(values) .and. n >= 0_c_size_t) then
         call c_f_pointer(values, array, [n])
         status = int(call_put_integers(id_of(handle), name_text, array), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_put_integers: null pointer'), c_int)
      end if
   end function c_put_integers

   !> A row of n = n_dof factors, by which the displacements of the dofs are added up; none where it
   !> stands with the nodal diameters.
   integer(c_int) function c_observe(handle, name, n, row) bind(c, name='fw_observe') result(status)
      type(c_ptr), value :: handle, name, row
      integer(c_size_t), value :: n
      character(:), allocatable :: name_text
      real(c_double), pointer :: array(:)

      call take_text(name, name_text)
      if (allocated(name_text) .and. n == 0_c_size_t) then
         status = int(call_observe(id_of(handle), name_text, [real(c_double) ::]), c_int)
      else if (allocated(name_text) .and. c_associated(row) .and. n >= 0_c_size_t) then
         call c_f_pointer(row, array, [n])
         status = int(call_observe(id_of(handle), name_text, array), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_observe: null pointer'), c_int)
      end if
   end function c_observe

   !> A null function takes the callback off. `user` is handed back untouched.
   integer(c_int) function c_on_progress(handle, callback, user) bind(c, name='fw_on_progress') &
      result(status)
      type(c_ptr), value :: handle, user
      type(c_funptr), value :: callback
      type(handle_type), pointer :: handle_data
      type(error_type), allocatable :: error

      status = int(status_usage, c_int)
      call enter(id_of(handle), handle_data)
      ! Set while no run is under way only: `enter` gives no handle that is at work.
      if (.not. associated(handle_data)) return
      handle_data%observer%progress = callback
      handle_data%observer%progress_user = user
      status = int(leave(handle_data, error), c_int)
   end function c_on_progress

   !> As fw_on_progress, for lines of text.
   integer(c_int) function c_on_message(handle, callback, user) bind(c, name='fw_on_message') &
      result(status)
      type(c_ptr), value :: handle, user
      type(c_funptr), value :: callback
      type(handle_type), pointer :: handle_data
      type(error_type), allocatable :: error

      status = int(status_usage, c_int)
      call enter(id_of(handle), handle_data)
      if (.not. associated(handle_data)) return
      handle_data%observer%message = callback
      handle_data%observer%message_user = user
      status = int(leave(handle_data, error), c_int)
   end function c_on_message

   !> Reads and checks everything, computes nothing.
   integer(c_int) function c_check(handle) bind(c, name='fw_check') result(status)
      type(c_ptr), value :: handle

      status = int(call_check(id_of(handle)), c_int)
   end function c_check

   !> Makes fw_solve possible; points of an earlier start are forgotten.
   integer(c_int) function c_start(handle) bind(c, name='fw_start') result(status)
      type(c_ptr), value :: handle

      status = int(call_start(id_of(handle)), c_int)
   end function c_start

   !> status_not_converged where points failed: the others are there to be read.
   integer(c_int) function c_run_case(handle) bind(c, name='fw_run_case') result(status)
      type(c_ptr), value :: handle

      status = int(call_run(id_of(handle)), c_int)
   end function c_run_case

   !> From any thread, while a call is at work on the handle; status_usage where none is.
   integer(c_int) function c_stop(handle) bind(c, name='fw_stop') result(status)
      type(c_ptr), value :: handle

      status = int(ask_to_stop(id_of(handle)), c_int)
   end function c_stop

   !> omega in rad/s, in any order; the last converged point is the first guess.
   integer(c_int) function c_solve(handle, omega) bind(c, name='fw_solve') result(status)
      type(c_ptr), value :: handle
      real(c_double), value :: omega

      status = int(call_solve(id_of(handle), omega), c_int)
   end function c_solve

   !> k counts from 0; there is no -1 for the last one here.
   integer(c_int) function c_get_frequency(handle, k, omega) bind(c, name='fw_get_frequency') &
      result(status)
      type(c_ptr), value :: handle, omega
      integer(c_int), value :: k
      real(c_double), pointer :: found

      if (c_associated(omega) .and. k < huge(k)) then
         call c_f_pointer(omega, found)
         status = int(call_frequency(id_of(handle), int(k) + 1, found), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_get_frequency: null pointer'), c_int)
      end if
   end function c_get_frequency

   !> What may be counted stands at call_count.
   integer(c_int) function c_count(handle, what, n) bind(c, name='fw_count') result(status)
      type(c_ptr), value :: handle, what, n
      character(:), allocatable :: what_text
      integer(c_int), pointer :: found
      integer :: number

      call take_text(what, what_text)
      if (allocated(what_text) .and. c_associated(n)) then
         call c_f_pointer(n, found)
         status = int(call_count(id_of(handle), what_text, number), c_int)
         ! Also with an error, when it is 0: the caller's variable is never left undefined.
         found = int(number, c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_count: null pointer'), c_int)
      end if
   end function c_count

   !> The length to allocate for fw_get.
   integer(c_int) function c_size(handle, name, point, n) bind(c, name='fw_size') result(status)
      type(c_ptr), value :: handle, name, n
      integer(c_int), value :: point
      character(:), allocatable :: name_text
      integer(c_size_t), pointer :: found
      integer(i8) :: number

      call take_text(name, name_text)
      if (allocated(name_text) .and. c_associated(n)) then
         call c_f_pointer(n, found)
         status = int(call_size(id_of(handle), name_text, point_of(point), number), c_int)
         found = int(number, c_size_t)
      else
         status = int(call_refuse(id_of(handle), 'fw_size: null pointer'), c_int)
      end if
   end function c_size

   !> Writes nothing where n is too small; `n` may be larger than needed.
   integer(c_int) function c_get(handle, name, point, n, values) bind(c, name='fw_get') &
      result(status)
      type(c_ptr), value :: handle, name, values
      integer(c_int), value :: point
      integer(c_size_t), value :: n
      character(:), allocatable :: name_text
      real(c_double), pointer :: buffer(:)

      call take_text(name, name_text)
      if (allocated(name_text) .and. c_associated(values) .and. n >= 0_c_size_t) then
         call c_f_pointer(values, buffer, [n])
         status = int(call_get(id_of(handle), name_text, point_of(point), buffer), c_int)
      else
         status = int(call_refuse(id_of(handle), 'fw_get: null pointer'), c_int)
      end if
   end function c_get

   !> As fw_get_message: cut to the buffer, and the whole length in *length, which may be null.
   integer(c_int) function c_get_text(handle, what, k, buffer, buffer_size, length) &
      bind(c, name='fw_get_text') result(status)
      type(c_ptr), value :: handle, what, buffer, length
      integer(c_int), value :: k
      integer(c_size_t), value :: buffer_size
      character(:), allocatable :: what_text, text
      integer(c_size_t), pointer :: needed

      call take_text(what, what_text)
      if (.not. allocated(what_text)) then
         status = int(call_refuse(id_of(handle), 'fw_get_text: null pointer'), c_int)
         return
      end if
      status = int(call_get_text(id_of(handle), what_text, point_of(k), text), c_int)
      if (status /= status_ok) return
      call give_text(text, buffer, buffer_size)
      if (.not. c_associated(length)) return
      call c_f_pointer(length, needed)
      needed = len(text, c_size_t)
   end function c_get_text

   !> A pointer of a newer or a wrong library has no small number as its bits, and is no handle
   !> then.
   !> The number behind a handle; 0, which is none, for a pointer that cannot be one.
   pure integer function id_of(handle) result(id)
      type(c_ptr), intent(in) :: handle
      integer(c_intptr_t) :: address

      address = transfer(handle, address)
      id = 0
      if (address > 0_c_intptr_t .and. address <= huge(id)) id = int(address)
   end function id_of

   !> From 0 in C, with -1 for the last one, to 1 and 0.
   pure integer function point_of(point) result(k)
      integer(c_int), intent(in) :: point

      k = int(point)
      ! The largest number stays as it is: adding 1 would overflow; there is no such point anyway.
      if (point < huge(point)) k = k + 1
   end function point_of

   !> A copy of a text of C; not allocated for a null pointer.
   subroutine take_text(pointer, text)
      type(c_ptr), intent(in) :: pointer
      character(:), allocatable, intent(out) :: text
      character(kind=c_char), pointer :: letters(:)
      integer(c_size_t) :: i, n

      if (.not. c_associated(pointer)) return
      n = c_strlen(pointer)
      call c_f_pointer(pointer, letters, [n])
      allocate (character(n) :: text)
      do i = 1, n
         text(i:i) = letters(i)
      end do
   end subroutine take_text

   !> Copy a text to a buffer of C as far as it fits, always with a null at the end.
   subroutine give_text(text, buffer, buffer_size)
      !> Text of any length; it may hold nulls, which C will take for its end.
      character(*), intent(in) :: text
      !> Null, or a size of 0: only the length is of interest, and nothing is written.
      type(c_ptr), intent(in) :: buffer
      !> Letters of the buffer, the null included.
      integer(c_size_t), intent(in) :: buffer_size
      character(kind=c_char), pointer :: letters(:)
      integer(c_size_t) :: i, n

      if (.not. c_associated(buffer) .or. buffer_size < 1_c_size_t) return
      call c_f_pointer(buffer, letters, [buffer_size])
      n = min(len(text, c_size_t), buffer_size - 1_c_size_t)
      do i = 1, n
         letters(i) = text(i:i)
      end do
      letters(n + 1) = c_null_char
   end subroutine give_text

end module fw_c_interface
