!> Products of one real matrix with few columns, many times over. The matrix is packed once into
!> panels of rows, so that it is read in the order in which it lies; BLAS packs it at every call,
!> which takes longer than a product with a dozen columns.
!>
!> Panels are (row of the panel, column of the matrix, panel), right-hand sides (column of a group,
!> row, group). Both are filled up with zeros. Panels are independent of each other: threads share
!> them, and the numbers are the same for any count of threads.
module fw_panel_product
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: panel_height, group_width, panel_count, group_count, multiply_panels

   !> Rows of a panel and columns of a group: their products fill the vector registers.
   integer, parameter :: panel_height = 8, group_width = 4

contains

   !> Panels of a matrix with so many rows; the last is filled up with zeros.
   pure integer function panel_count(n_rows)
      integer, intent(in) :: n_rows

      panel_count = (n_rows + panel_height - 1)/panel_height
   end function panel_count

   !> Groups of so many right-hand sides, filled up likewise.
   pure integer function group_count(n_columns)
      integer, intent(in) :: n_columns

      group_count = (n_columns + group_width - 1)/group_width
   end function group_count

   !> product = matrix right, n_rows of its n_stored rows.
   subroutine multiply_panels(n_rows, n_inner, n_columns, panels, right, threaded, n_stored, &
                              product)
      integer, intent(in) :: n_rows, n_inner, n_columns, n_stored
      !> The matrix in panels and the right-hand sides in groups, see the module header.
      real(wp), intent(in) :: panels(panel_height, n_inner, *)
      real(wp), intent(in) :: right(group_width, n_inner, *)
      logical, intent(in) :: threaded
      !> Rows 1..n_rows of it are set (n_stored, n_columns).
      real(wp), intent(inout) :: product(n_stored, *)
      integer :: p

      !$omp parallel do default(none) private(p) schedule(static) if(threaded) &
      !$omp shared(n_rows, n_inner, n_columns, panels, right, n_stored, product)
      do p = 1, panel_count(n_rows)
         call multiply_panel(n_rows, n_inner, n_columns, panels(1, 1, p), right, &
                             (p - 1)*panel_height, n_stored, product)
      end do
      !$omp end parallel do
   end subroutine multiply_panels

   !> One panel with all right-hand sides, tile by tile.
   pure subroutine multiply_panel(n_rows, n_inner, n_columns, panel, right, first, n_stored, &
                                  product)
      integer, intent(in) :: n_rows, n_inner, n_columns, first, n_stored
      real(wp), intent(in) :: panel(panel_height, n_inner)
      real(wp), intent(in) :: right(group_width, n_inner, *)
      real(wp), intent(inout) :: product(n_stored, *)
      real(wp) :: tile(panel_height, group_width)
      integer :: g, k, n

      n = min(panel_height, n_rows - first)
      do g = 1, group_count(n_columns)
         call multiply_tile(n_inner, panel, right(1, 1, g), tile)
         ! Whole tiles are computed, the zeros that fill them up included; what exists is copied.
         do k = 1, min(group_width, n_columns - (g - 1)*group_width)
            product(first + 1:first + n, (g - 1)*group_width + k) = tile(:n, k)
         end do
      end do
   end subroutine multiply_panel

   !> One panel times one group; its sums stay in registers.
   pure subroutine multiply_tile(n_inner, panel, right, tile)
      integer, intent(in) :: n_inner
      real(wp), intent(in) :: panel(panel_height, n_inner), right(group_width, n_inner)
      real(wp), intent(out) :: tile(panel_height, group_width)
      real(wp), dimension(panel_height) :: sum_1, sum_2, sum_3, sum_4
      integer :: j

      sum_1 = 0.0_wp
      sum_2 = 0.0_wp
      sum_3 = 0.0_wp
      sum_4 = 0.0_wp
      do j = 1, n_inner
         sum_1 = sum_1 + panel(:, j)*right(1, j)
         sum_2 = sum_2 + panel(:, j)*right(2, j)
         sum_3 = sum_3 + panel(:, j)*right(3, j)
         sum_4 = sum_4 + panel(:, j)*right(4, j)
      end do
      tile(:, 1) = sum_1
      tile(:, 2) = sum_2
      tile(:, 3) = sum_3
      tile(:, 4) = sum_4
   end subroutine multiply_tile

end module fw_panel_product
