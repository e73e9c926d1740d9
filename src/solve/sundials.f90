!> What the solvers of SUNDIALS share: serial vectors over Fortran arrays, a context, silence.
module fw_sundials
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_int, c_int64_t, &
      c_loc, c_null_ptr, c_ptr
   use fnvector_serial_mod, only: fn_vmake_serial
   use fsundials_context_mod, only: fsuncontext_create, fsuncontext_free
   use fsundials_nvector_mod, only: fn_vdestroy, fn_vgetarraypointer, n_vector
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: open_context, close_context, wrap, release, values, ignore_message
   public :: callback_ok, callback_smaller, callback_fatal

   !> What a callback returns: done, try a smaller step, give up.
   integer(c_int), parameter :: callback_ok = 0, callback_smaller = 1, callback_fatal = -1

contains

   !> Contexts belong to one solution: they are not safe to share between threads.
   subroutine open_context(context, done)
      type(c_ptr), intent(out) :: context
      logical, intent(out) :: done

      context = c_null_ptr
      done = fsuncontext_create(c_null_ptr, context) == 0
      done = done .and. c_associated(context)
   end subroutine open_context

   !> Last of all objects; harmless where there is none.
   subroutine close_context(context)
      type(c_ptr), intent(inout) :: context
      integer(c_int) :: status

      if (c_associated(context)) status = fsuncontext_free(context)
      context = c_null_ptr
   end subroutine close_context

   !> A vector whose entries are those of the array; null where there is no memory.
   function wrap(array, context) result(vector)
      real(wp), intent(inout), contiguous, target :: array(:)
      type(c_ptr), intent(in) :: context
      type(n_vector), pointer :: vector

      ! Without a copy: the array has to outlive the vector, and be passed on as a target.
      vector => fn_vmake_serial(size(array, kind=c_int64_t), array, context)
   end function wrap

   !> The array stays.
   subroutine release(vector)
      type(n_vector), pointer, intent(inout) :: vector

      if (associated(vector)) call fn_vdestroy(vector)
      nullify (vector)
   end subroutine release

   !> The n entries of a vector. The interface of SUNDIALS gives the first one only.
   function values(vector, n) result(array)
      type(n_vector), intent(inout), target :: vector
      integer, intent(in) :: n
      real(wp), pointer, contiguous :: array(:)
      real(c_double), pointer :: first(:)

      first => fn_vgetarraypointer(vector)
      ! The interface declares one entry; the memory behind it has n.
      call c_f_pointer(c_loc(first(1)), array, [n])
   end function values

   !> Error handler: messages of SUNDIALS go nowhere, since failures are outcomes here.
   subroutine ignore_message(code, module_name, function_name, text, data) bind(c, name='')
      integer(c_int), value :: code
      type(c_ptr), value :: module_name, function_name, text, data

      associate (code => code, module_name => module_name, function_name => function_name, &
                 text => text, data => data)
      end associate
   end subroutine ignore_message

end module fw_sundials
