!> Products of a real matrix with few columns, row by row: row i of the product takes column i of a
!> stored matrix, so that a symmetric matrix serves as it lies in memory. BLAS packs a matrix at
!> every call, which takes longer than a product with a dozen columns.
!>
!> Rows are independent of each other: threads share them, and the numbers are the same for any
!> count of threads.
module fw_column_product
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: multiply_columns

   !> Rows and right-hand sides whose sums stay in registers.
   integer, parameter :: tile = 4

contains

   !> product(i, k) = sum over j and b of matrix(j, i, b) right(j, b, k).
   subroutine multiply_columns(n_rows, n_inner, n_blocks, n_columns, matrix, right, threaded, &
                               n_stored, product)
      integer, intent(in) :: n_rows, n_inner, n_blocks, n_columns, n_stored
      real(wp), intent(in) :: matrix(n_inner, n_rows, n_blocks)
      real(wp), intent(in) :: right(n_inner, n_blocks, n_columns)
      logical, intent(in) :: threaded
      !> Rows 1..n_rows of it are set (n_stored, n_columns).
      real(wp), intent(inout) :: product(n_stored, n_columns)
      integer :: i

      !$omp parallel do default(none) private(i) schedule(static) if(threaded) &
      !$omp shared(n_rows, n_inner, n_blocks, n_columns, matrix, right, n_stored, product)
      do i = 1, n_rows, tile
         call multiply_rows(i, min(tile, n_rows - i + 1), n_rows, n_inner, n_blocks, n_columns, &
                            matrix, right, n_stored, product)
      end do
      !$omp end parallel do
   end subroutine multiply_columns

   !> n rows from row i on.
   pure subroutine multiply_rows(i, n, n_rows, n_inner, n_blocks, n_columns, matrix, right, &
                                 n_stored, product)
      integer, intent(in) :: i, n, n_rows, n_inner, n_blocks, n_columns, n_stored
      real(wp), intent(in) :: matrix(n_inner, n_rows, n_blocks)
      real(wp), intent(in) :: right(n_inner, n_blocks, n_columns)
      real(wp), intent(inout) :: product(n_stored, n_columns)
      real(wp) :: sums(tile, tile)
      integer :: b, j, k, width

      do k = 1, n_columns, tile
         width = min(tile, n_columns - k + 1)
         sums = 0.0_wp
         do b = 1, n_blocks
            if (n == tile .and. width == tile) then
               call add_tile(n_inner, matrix(1, i, b), n_inner*n_blocks, right(1, b, k), sums)
            else
               do j = 1, width
                  call add_column(n, n_inner, matrix(1, i, b), right(1, b, k + j - 1), sums(1, j))
               end do
            end if
         end do
         product(i:i + n - 1, k:k + width - 1) = sums(:n, :width)
      end do
   end subroutine multiply_rows

   !> Four rows by four right-hand sides, `apart` entries from one to the next.
   pure subroutine add_tile(n, a, apart, r, sums)
      integer, intent(in) :: n, apart
      real(wp), intent(in) :: a(n, tile), r(apart, tile)
      real(wp), intent(inout) :: sums(tile, tile)
      real(wp) :: s11, s21, s31, s41, s12, s22, s32, s42, s13, s23, s33, s43, s14, s24, s34, s44
      integer :: j

      s11 = 0.0_wp; s21 = 0.0_wp; s31 = 0.0_wp; s41 = 0.0_wp
      s12 = 0.0_wp; s22 = 0.0_wp; s32 = 0.0_wp; s42 = 0.0_wp
      s13 = 0.0_wp; s23 = 0.0_wp; s33 = 0.0_wp; s43 = 0.0_wp
      s14 = 0.0_wp; s24 = 0.0_wp; s34 = 0.0_wp; s44 = 0.0_wp
      !$omp simd reduction(+: s11, s21, s31, s41, s12, s22, s32, s42, s13, s23, s33, s43, s14, &
      !$omp s24, s34, s44)
      do j = 1, n
         s11 = s11 + a(j, 1)*r(j, 1)
         s21 = s21 + a(j, 2)*r(j, 1)
         s31 = s31 + a(j, 3)*r(j, 1)
         s41 = s41 + a(j, 4)*r(j, 1)
         s12 = s12 + a(j, 1)*r(j, 2)
         s22 = s22 + a(j, 2)*r(j, 2)
         s32 = s32 + a(j, 3)*r(j, 2)
         s42 = s42 + a(j, 4)*r(j, 2)
         s13 = s13 + a(j, 1)*r(j, 3)
         s23 = s23 + a(j, 2)*r(j, 3)
         s33 = s33 + a(j, 3)*r(j, 3)
         s43 = s43 + a(j, 4)*r(j, 3)
         s14 = s14 + a(j, 1)*r(j, 4)
         s24 = s24 + a(j, 2)*r(j, 4)
         s34 = s34 + a(j, 3)*r(j, 4)
         s44 = s44 + a(j, 4)*r(j, 4)
      end do
      sums(:, 1) = sums(:, 1) + [s11, s21, s31, s41]
      sums(:, 2) = sums(:, 2) + [s12, s22, s32, s42]
      sums(:, 3) = sums(:, 3) + [s13, s23, s33, s43]
      sums(:, 4) = sums(:, 4) + [s14, s24, s34, s44]
   end subroutine add_tile

   !> Up to four rows by one right-hand side.
   pure subroutine add_column(n_rows, n, a, r, sums)
      integer, intent(in) :: n_rows, n
      real(wp), intent(in) :: a(n, n_rows), r(n)
      real(wp), intent(inout) :: sums(tile)
      real(wp) :: s1, s2, s3, s4
      integer :: i, j

      if (n_rows == tile) then
         s1 = 0.0_wp
         s2 = 0.0_wp
         s3 = 0.0_wp
         s4 = 0.0_wp
         !$omp simd reduction(+: s1, s2, s3, s4)
         do j = 1, n
            s1 = s1 + a(j, 1)*r(j)
            s2 = s2 + a(j, 2)*r(j)
            s3 = s3 + a(j, 3)*r(j)
            s4 = s4 + a(j, 4)*r(j)
         end do
         sums = sums + [s1, s2, s3, s4]
         return
      end if
      do i = 1, n_rows
         s1 = 0.0_wp
         !$omp simd reduction(+: s1)
         do j = 1, n
            s1 = s1 + a(j, i)*r(j)
         end do
         sums(i) = sums(i) + s1
      end do
   end subroutine add_column

end module fw_column_product
