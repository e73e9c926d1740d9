!> Threads of a run: OpenMP over pairs and harmonics, and one thread inside each BLAS call, so
!> that the two do not oversubscribe the machine. What was set before is restored.
module fw_threads
   use, intrinsic :: iso_c_binding, only: c_int
   use omp_lib, only: omp_get_max_threads
   use omp_lib, only: omp_set_num_threads
   implicit none (type, external)
   private

   public :: thread_scope, pairs_for_threads, coordinates_for_threads

   !> Contact pairs, and coordinates of a joint, from which parallel regions pay. One rule for all
   !> of them, because threads that wait for the next region spin for a while (app/idle_threads.c):
   !> below, a run stays in one thread altogether (docs/benchmarks/limit.md).
   integer, parameter :: pairs_for_threads = 64
   integer, parameter :: coordinates_for_threads = 3*pairs_for_threads

   type :: thread_scope
      private
      !> Threads of OpenMP before the scope.
      integer :: outer = 0
   contains
      procedure :: enter
      procedure :: leave
   end type thread_scope

   !> Scopes that are open, and the threads of OpenBLAS before the first one. The switch of
   !> OpenBLAS holds for the whole process, so what belongs to it does so too: of the scopes of
   !> several threads, which may overlap, the first one sets it and the last one restores it.
   integer :: n_open = 0
   integer(c_int) :: blas_before = 1_c_int

   interface
      integer(c_int) function get_blas_threads() bind(c, name='fretwear_blas_threads')
         import :: c_int
      end function get_blas_threads

      ! Of a BLAS that is not OpenBLAS it does nothing (blas_kernel.c).
      subroutine set_blas_threads(n) bind(c, name='fretwear_set_blas_threads')
         import :: c_int
         integer(c_int), value :: n
      end subroutine set_blas_threads
   end interface

contains

   !> Use n_threads threads (0: all that OpenMP was given).
   subroutine enter(self, n_threads)
      class(thread_scope), intent(inout) :: self
      integer, intent(in) :: n_threads

      self%outer = omp_get_max_threads()
      if (n_threads > 0) call omp_set_num_threads(n_threads)
      !$omp critical (fretwear_threads)
      if (n_open == 0) then
         blas_before = get_blas_threads()
         call set_blas_threads(1_c_int)
      end if
      n_open = n_open + 1
      !$omp end critical (fretwear_threads)
   end subroutine enter

   !> Take back what `enter` has set.
   subroutine leave(self)
      class(thread_scope), intent(in) :: self

      call omp_set_num_threads(self%outer)
      !$omp critical (fretwear_threads)
      n_open = n_open - 1
      if (n_open == 0) call set_blas_threads(blas_before)
      !$omp end critical (fretwear_threads)
   end subroutine leave

end module fw_threads
