!> Threads of a run: OpenMP over pairs and harmonics, and one thread inside each BLAS call, so
!> that the two do not oversubscribe the machine. What was set before is restored.
module fw_threads
   use, intrinsic :: iso_c_binding, only: c_int
   use omp_lib, only: omp_get_max_threads
   use omp_lib, only: omp_set_num_threads
   implicit none (type, external)
   private

   public :: thread_scope

   type :: thread_scope
      private
      integer :: outer = 0
      integer(c_int) :: blas = 0
   contains
      procedure :: enter
      procedure :: leave
   end type thread_scope

   interface
      integer(c_int) function openblas_get_num_threads() bind(c)
         import :: c_int
      end function openblas_get_num_threads

      subroutine openblas_set_num_threads(n) bind(c)
         import :: c_int
         integer(c_int), value :: n
      end subroutine openblas_set_num_threads
   end interface

contains

   !> Use n_threads threads (0: all that OpenMP was given).
   subroutine enter(self, n_threads)
      class(thread_scope), intent(inout) :: self
      integer, intent(in) :: n_threads

      self%outer = omp_get_max_threads()
      self%blas = openblas_get_num_threads()
      if (n_threads > 0) call omp_set_num_threads(n_threads)
      call openblas_set_num_threads(1_c_int)
   end subroutine enter

   subroutine leave(self)
      class(thread_scope), intent(in) :: self

      call omp_set_num_threads(self%outer)
      call openblas_set_num_threads(self%blas)
   end subroutine leave

end module fw_threads
