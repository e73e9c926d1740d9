!> Whether a program links with the archive of OpenBLAS (ProgramArchives.cmake).
program blas_archive
   use, intrinsic :: iso_c_binding, only: c_int
   implicit none (type, external)

   interface
      integer(c_int) function get_threads() bind(c, name='openblas_get_num_threads')
         import :: c_int
      end function get_threads

      subroutine dgetrf(m, n, a, lda, pivot, info)
         implicit none (type, external)
         integer, intent(in) :: m, n, lda
         double precision, intent(inout) :: a(lda, *)
         integer, intent(out) :: pivot(*), info
      end subroutine dgetrf
   end interface
   double precision :: a(1, 1)
   integer :: pivot(1), info

   a = 1.0d0
   call dgetrf(1, 1, a, 1, pivot, info)
   if (get_threads() < 1 .or. info /= 0) error stop
end program blas_archive
