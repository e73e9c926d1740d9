!> Counts allocations: the program's own malloc, calloc and realloc stand before those of the C
!> library (glibc), count the call and hand it on. Works for every library that is linked.
!>
!> The malloc of a sanitizer has to stand before everything. There the linker leads the calls of the
!> program here (--wrap), and those of shared libraries are not counted.
#ifdef WRAPPED
#define OWN '__wrap_'
#define NEXT '__real_'
#else
#define OWN ''
#define NEXT '__libc_'
#endif
module support_malloc
   use, intrinsic :: iso_c_binding, only: c_ptr, c_size_t
   use, intrinsic :: iso_fortran_env, only: int64
   implicit none (type, external)
   private

   public :: allocation_count, malloc, calloc, realloc

   integer(int64) :: count = 0

   interface
      type(c_ptr) function next_malloc(size) bind(c, name=NEXT//'malloc')
         import :: c_ptr, c_size_t
         integer(c_size_t), value :: size
      end function next_malloc

      type(c_ptr) function next_calloc(number, size) bind(c, name=NEXT//'calloc')
         import :: c_ptr, c_size_t
         integer(c_size_t), value :: number, size
      end function next_calloc

      type(c_ptr) function next_realloc(old, size) bind(c, name=NEXT//'realloc')
         import :: c_ptr, c_size_t
         type(c_ptr), value :: old
         integer(c_size_t), value :: size
      end function next_realloc
   end interface

contains

   !> Allocations since the program started, by all threads.
   integer(int64) function allocation_count()
      !$omp atomic read
      allocation_count = count
   end function allocation_count

   type(c_ptr) function malloc(size) bind(c, name=OWN//'malloc')
      integer(c_size_t), value :: size

      !$omp atomic
      count = count + 1
      malloc = next_malloc(size)
   end function malloc

   type(c_ptr) function calloc(number, size) bind(c, name=OWN//'calloc')
      integer(c_size_t), value :: number, size

      !$omp atomic
      count = count + 1
      calloc = next_calloc(number, size)
   end function calloc

   type(c_ptr) function realloc(old, size) bind(c, name=OWN//'realloc')
      type(c_ptr), value :: old
      integer(c_size_t), value :: size

      !$omp atomic
      count = count + 1
      realloc = next_realloc(old, size)
   end function realloc

end module support_malloc
