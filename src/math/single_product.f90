!> Products of one real matrix in single precision with few columns, many times over, for what only
!> has to be near. The matrix is packed once into panels of rows, in the order in which they are
!> read: panels are (row of the panel, column of the matrix, panel), right-hand sides (column of a
!> group, row, group), both filled up with zeros. Panels are independent of each other: threads
!> share them, and the numbers are the same for any count of threads.
module fw_single_product
   use fw_kinds, only: sp, wp
   implicit none (type, external)
   private

   public :: panel_height, group_width, panel_count, group_count, multiply_panels, multiply_tile

   !> Rows of a panel and columns of a group: their products fill the vector registers.
   integer, parameter :: panel_height = 16, group_width = 4

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

   !> product = scale matrix right, n_rows of its n_stored rows.
   subroutine multiply_panels(n_rows, n_inner, n_columns, panels, right, scale, threaded, &
                              n_stored, product)
      integer, intent(in) :: n_rows, n_inner, n_columns, n_stored
      !> (row of the panel, column, panel) and (column of a group, row, group).
      real(sp), intent(in) :: panels(panel_height, n_inner, *)
      real(sp), intent(in) :: right(group_width, n_inner, *)
      real(wp), intent(in) :: scale
      logical, intent(in) :: threaded
      !> Rows 1..n_rows of it are set (n_stored, n_columns).
      real(wp), intent(inout) :: product(n_stored, *)
      integer :: p

      if (.not. threaded) then
         do p = 1, panel_count(n_rows)
            call multiply_panel(n_rows, n_inner, n_columns, panels(1, 1, p), right, scale, &
                                (p - 1)*panel_height, n_stored, product)
         end do
         return
      end if
      !$omp parallel do default(none) private(p) schedule(static) &
      !$omp shared(n_rows, n_inner, n_columns, panels, right, scale, n_stored, product)
      do p = 1, panel_count(n_rows)
         call multiply_panel(n_rows, n_inner, n_columns, panels(1, 1, p), right, scale, &
                             (p - 1)*panel_height, n_stored, product)
      end do
      !$omp end parallel do
   end subroutine multiply_panels

   !> One panel with all right-hand sides, tile by tile.
   pure subroutine multiply_panel(n_rows, n_inner, n_columns, panel, right, scale, first, &
                                  n_stored, product)
      integer, intent(in) :: n_rows, n_inner, n_columns, first, n_stored
      real(sp), intent(in) :: panel(panel_height, n_inner)
      real(sp), intent(in) :: right(group_width, n_inner, *)
      real(wp), intent(in) :: scale
      real(wp), intent(inout) :: product(n_stored, *)
      real(sp) :: tile(panel_height, group_width)
      integer :: g, k, n

      n = min(panel_height, n_rows - first)
      do g = 1, group_count(n_columns)
         call multiply_tile(n_inner, panel, right(1, 1, g), tile)
         ! Whole tiles are computed, the zeros that fill them up included; what exists is copied.
         do k = 1, min(group_width, n_columns - (g - 1)*group_width)
            product(first + 1:first + n, (g - 1)*group_width + k) = scale*real(tile(:n, k), wp)
         end do
      end do
   end subroutine multiply_panel

   !> One panel times one group; its sums stay in registers.
   pure subroutine multiply_tile(n_inner, panel, right, tile)
      integer, intent(in) :: n_inner
      real(sp), intent(in) :: panel(panel_height, n_inner), right(group_width, n_inner)
      real(sp), intent(out) :: tile(panel_height, group_width)
      real(sp) :: sums(panel_height, group_width)
      integer :: i, j

      sums = 0.0_sp
      do j = 1, n_inner
         ! As a loop over the rows: whole arrays of so many rows gfortran does not keep in vectors.
         !$omp simd
         do i = 1, panel_height
            sums(i, 1) = sums(i, 1) + panel(i, j)*right(1, j)
            sums(i, 2) = sums(i, 2) + panel(i, j)*right(2, j)
            sums(i, 3) = sums(i, 3) + panel(i, j)*right(3, j)
            sums(i, 4) = sums(i, 4) + panel(i, j)*right(4, j)
         end do
      end do
      tile = sums
   end subroutine multiply_tile

end module fw_single_product
