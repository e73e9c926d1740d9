!> Counts allocations where a sanitizer has a malloc of its own, which calls this at each of them.
module support_malloc
   use, intrinsic :: iso_c_binding, only: c_ptr
   use, intrinsic :: iso_c_binding, only: c_size_t
   use, intrinsic :: iso_fortran_env, only: int64
   implicit none (type, external)
   private

   public :: allocation_count, count_allocation

   integer(int64) :: count = 0

contains

   !> Allocations since the program started, by all threads.
   integer(int64) function allocation_count()
      !$omp atomic read
      allocation_count = count
   end function allocation_count

   subroutine count_allocation(address, size) bind(c, name='__sanitizer_malloc_hook')
      type(c_ptr), value :: address
      integer(c_size_t), value :: size

      !$omp atomic
      count = count + 1
   end subroutine count_allocation

end module support_malloc
