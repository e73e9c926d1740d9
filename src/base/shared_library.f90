!> Functions and numbers of a shared library that is opened while the program runs.
module fw_shared_library
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_funptr, c_int, &
      c_null_char, c_null_funptr, c_null_ptr, c_ptr
   implicit none (type, external)
   private

   public :: find_address, find_function, open_library, why_not

   !> All symbols at once, and for nobody else.
   integer(c_int), parameter :: now = 2_c_int

   interface
      type(c_ptr) function dlopen(path, flags) bind(c, name='dlopen')
         import :: c_char, c_int, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: flags
      end function dlopen

      type(c_ptr) function dlsym(library, name) bind(c, name='dlsym')
         import :: c_char, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: library
         character(kind=c_char), intent(in) :: name(*)
      end function dlsym

      !> The same entry, by which C has data and functions alike: in Fortran they are different
      !> types.
      type(c_funptr) function dlsym_function(library, name) bind(c, name='dlsym')
         import :: c_char, c_funptr, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: library
         character(kind=c_char), intent(in) :: name(*)
      end function dlsym_function

      type(c_ptr) function dlerror() bind(c, name='dlerror')
         import :: c_ptr
         implicit none (type, external)
      end function dlerror
   end interface

contains

   !> A library stays open until the program ends: laws of it may be in use anywhere.
   logical function open_library(path, library) result(done)
      character(*), intent(in) :: path
      type(c_ptr), intent(out) :: library

      library = dlopen(trim(path)//c_null_char, now)
      done = c_associated(library)
   end function open_library

   !> The address of a number; null where there is none.
   type(c_ptr) function find_address(library, name) result(address)
      type(c_ptr), intent(in) :: library
      character(*), intent(in) :: name

      address = c_null_ptr
      if (c_associated(library)) address = dlsym(library, trim(name)//c_null_char)
   end function find_address

   !> A function; null where there is none.
   type(c_funptr) function find_function(library, name) result(address)
      type(c_ptr), intent(in) :: library
      character(*), intent(in) :: name

      address = c_null_funptr
      if (c_associated(library)) address = dlsym_function(library, trim(name)//c_null_char)
   end function find_function

   !> What the last call that found nothing had to say.
   subroutine why_not(reason)
      ! allow(C072): a text of the caller
      character(*), intent(out) :: reason
      type(c_ptr) :: address
      character(kind=c_char), pointer :: text(:)
      integer :: k

      reason = ''
      address = dlerror()
      if (.not. c_associated(address)) return
      call c_f_pointer(address, text, [len(reason)])
      do k = 1, len(reason)
         if (text(k) == c_null_char) exit
         reason(k:k) = text(k)
      end do
   end subroutine why_not

end module fw_shared_library
