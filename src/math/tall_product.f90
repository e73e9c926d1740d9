!> Products with a tall matrix, its columns next to each other in memory: the basis of a Krylov
!> space, the border of an augmented system. BLAS works on them in the one thread that it is given
!> (fw_threads); here threads share blocks of a fixed size, so that the numbers are the same for any
!> count of threads.
module fw_tall_product
   use fw_kinds, only: wp
   use fw_lapack, only: dgemv
   implicit none (type, external)
   private

   public :: multiply_transposed, subtract_product

   !> Rows from which the work is cut into blocks: below, all of it is in the cache of one core.
   integer, parameter :: blocks_from = 1024
   !> Rows and columns of a block.
   integer, parameter :: block_rows = 512, block_columns = 4
   !> Entries of the matrix from which threads pay for being called.
   integer, parameter :: threads_from = 32768

contains

   !> y = A^T x.
   subroutine multiply_transposed(n_rows, n_columns, a, x, y)
      integer, intent(in) :: n_rows, n_columns
      real(wp), intent(in) :: a(n_rows, n_columns), x(n_rows)
      real(wp), intent(inout) :: y(n_columns)
      integer :: j

      if (n_rows < blocks_from) then
         call dgemv('T', n_rows, n_columns, 1.0_wp, a, max(1, n_rows), x, 1, 0.0_wp, y, 1)
         return
      end if
      !$omp parallel do default(none) private(j) shared(n_rows, n_columns, a, x, y) &
      !$omp schedule(static) if(n_rows*n_columns >= threads_from)
      do j = 1, n_columns, block_columns
         call dgemv('T', n_rows, min(block_columns, n_columns - j + 1), 1.0_wp, a(1, j), n_rows, &
                    x, 1, 0.0_wp, y(j), 1)
      end do
      !$omp end parallel do
   end subroutine multiply_transposed

   !> y = y - A x.
   subroutine subtract_product(n_rows, n_columns, a, x, y)
      integer, intent(in) :: n_rows, n_columns
      real(wp), intent(in) :: a(n_rows, n_columns), x(n_columns)
      real(wp), intent(inout) :: y(n_rows)
      integer :: i

      if (n_rows < blocks_from) then
         call dgemv('N', n_rows, n_columns, -1.0_wp, a, max(1, n_rows), x, 1, 1.0_wp, y, 1)
         return
      end if
      !$omp parallel do default(none) private(i) shared(n_rows, n_columns, a, x, y) &
      !$omp schedule(static) if(n_rows*n_columns >= threads_from)
      do i = 1, n_rows, block_rows
         call dgemv('N', min(block_rows, n_rows - i + 1), n_columns, -1.0_wp, a(i, 1), n_rows, x, &
                    1, 1.0_wp, y(i), 1)
      end do
      !$omp end parallel do
   end subroutine subtract_product

end module fw_tall_product
