!> A complex matrix in single precision times one column, many times over. The matrix is packed into
!> panels of rows, real beside imaginary parts, in the order in which a product reads them: BLAS
!> takes several times as long for a column, and twice that in double precision. The last panel is
!> filled up with zeros.
module fw_column_panels
   use fw_kinds, only: sp, wp
   implicit none (type, external)
   private

   public :: panel_height, panel_count, multiply_column, pack_columns, multiply_panels

   !> Rows of a panel: their sums fill the vector registers.
   integer, parameter :: panel_height = 16
   !> Columns for which room of a fixed size serves, which needs no allocation.
   integer, parameter :: usual = 512

contains

   !> Panels of so many rows.
   pure integer function panel_count(n_rows)
      integer, intent(in) :: n_rows

      panel_count = (n_rows + panel_height - 1)/panel_height
   end function panel_count

   !> One panel times the column; its sums stay in registers.
   pure subroutine multiply_column(n_inner, panel, right, tile)
      integer, intent(in) :: n_inner
      !> Real and imaginary parts in the second dimension, in the first of the column.
      real(sp), intent(in) :: panel(panel_height, 2, n_inner), right(2, n_inner)
      real(sp), intent(out) :: tile(panel_height, 2)
      !> Four sums, so that none waits for another.
      real(sp), dimension(panel_height) :: re_re, im_im, re_im, im_re
      integer :: i, j

      re_re = 0.0_sp
      im_im = 0.0_sp
      re_im = 0.0_sp
      im_re = 0.0_sp
      do j = 1, n_inner
         !$omp simd
         do i = 1, panel_height
            re_re(i) = re_re(i) + panel(i, 1, j)*right(1, j)
            im_im(i) = im_im(i) + panel(i, 2, j)*right(2, j)
            re_im(i) = re_im(i) + panel(i, 1, j)*right(2, j)
            im_re(i) = im_re(i) + panel(i, 2, j)*right(1, j)
         end do
      end do
      tile(:, 1) = re_re - im_im
      tile(:, 2) = re_im + im_re
   end subroutine multiply_column

   !> Pack rows and columns of a matrix, to the order of one: single precision ends at 1e38.
   pure subroutine pack_columns(matrix, n_columns, rows, panels, largest)
      complex(wp), intent(in) :: matrix(:, :)
      !> Numbers of the rows; the first n_columns of them are those of the columns.
      integer, intent(in) :: n_columns, rows(:)
      real(sp), intent(inout) :: panels(panel_height, 2, n_columns, *)
      !> What the panels are to be multiplied by.
      real(wp), intent(out) :: largest
      real(wp) :: factor
      integer :: i, j, p

      largest = 0.0_wp
      do j = 1, n_columns
         do i = 1, size(rows)
            associate (entry => matrix(rows(i), rows(j)))
               largest = max(largest, abs(real(entry, wp)), abs(aimag(entry)))
            end associate
         end do
      end do
      ! Its reciprocal is to be finite.
      if (.not. largest > tiny(1.0_wp)) largest = 1.0_wp
      factor = 1.0_wp/largest
      panels(:, :, :, panel_count(size(rows))) = 0.0_sp
      do j = 1, n_columns
         do p = 1, panel_count(size(rows))
            associate (first => (p - 1)*panel_height)
               do i = 1, min(panel_height, size(rows) - first)
                  associate (entry => matrix(rows(first + i), rows(j)))
                     panels(i, 1, j, p) = real(factor*real(entry, wp), sp)
                     panels(i, 2, j, p) = real(factor*aimag(entry), sp)
                  end associate
               end do
            end associate
         end do
      end do
   end subroutine pack_columns

   !> product = scale panels column.
   pure subroutine multiply_panels(n_rows, n_columns, panels, scale, column, product)
      integer, intent(in) :: n_rows, n_columns
      real(sp), intent(in) :: panels(panel_height, 2, n_columns, *)
      real(wp), intent(in) :: scale
      complex(wp), intent(in) :: column(n_columns)
      complex(wp), intent(inout) :: product(n_rows)
      real(sp) :: usual_room(2, usual)
      real(sp), allocatable :: room(:, :)

      if (n_columns <= usual) then
         call multiply_in(n_rows, n_columns, panels, scale, column, usual_room, product)
      else
         allocate (room(2, n_columns))
         call multiply_in(n_rows, n_columns, panels, scale, column, room, product)
      end if
   end subroutine multiply_panels

   pure subroutine multiply_in(n_rows, n_columns, panels, scale, column, right, product)
      integer, intent(in) :: n_rows, n_columns
      real(sp), intent(in) :: panels(panel_height, 2, n_columns, *)
      real(wp), intent(in) :: scale
      complex(wp), intent(in) :: column(n_columns)
      !> Room.
      real(sp), intent(inout) :: right(2, n_columns)
      complex(wp), intent(inout) :: product(n_rows)
      real(sp) :: tile(panel_height, 2)
      real(wp) :: largest
      integer :: first, i, n, p

      ! To the order of one, as the panels are.
      largest = 0.0_wp
      do i = 1, n_columns
         largest = max(largest, abs(real(column(i), wp)), abs(aimag(column(i))))
      end do
      if (.not. largest > 0.0_wp) largest = 1.0_wp
      do i = 1, n_columns
         right(1, i) = real(real(column(i), wp)/largest, sp)
         right(2, i) = real(aimag(column(i))/largest, sp)
      end do
      do p = 1, panel_count(n_rows)
         first = (p - 1)*panel_height
         n = min(panel_height, n_rows - first)
         call multiply_column(n_columns, panels(1, 1, 1, p), right, tile)
         product(first + 1:first + n) = scale*(largest*cmplx(tile(:n, 1), tile(:n, 2), wp))
      end do
   end subroutine multiply_in

end module fw_column_panels
