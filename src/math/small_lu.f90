!> LU factors of small real matrices, whose columns stay in the cache: the library takes about twice
!> as long there, for copies that only larger matrices pay.
!>
!> Right-looking elimination with partial pivoting by panels of four columns (Golub and Van Loan
!> 2013, Matrix computations, section 3.4): what a panel takes from two other columns is one loop
!> along the rows. Factors and pivots are those of dgetrf, but for the order of sums.
module fw_small_lu
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: factor_small, small_up_to, solve_small

   !> Order up to which this is the faster one (at 96 it still is, by a quarter).
   integer, parameter :: small_up_to = 64
   !> Columns of a panel; `update_columns` is written for it.
   integer, parameter :: width = 4

contains

   !> Factors in place, as dgetrf leaves them; `singular` where a pivot is exactly zero.
   pure subroutine factor_small(n, lda, a, pivot, singular)
      integer, intent(in) :: n, lda
      real(wp), intent(inout) :: a(lda, *)
      !> Row that was swapped with row i at step i.
      integer, intent(inout) :: pivot(*)
      logical, intent(out) :: singular
      integer :: first, j, last

      singular = .false.
      do first = 1, n, width
         last = min(first + width - 1, n)
         call factor_panel(n, first, last, lda, a, pivot, singular)
         do j = 1, first - 1
            call swap(first, last, pivot, a(1, j))
         end do
         do j = last + 1, n - 1, 2
            call swap(first, last, pivot, a(1, j))
            call swap(first, last, pivot, a(1, j + 1))
            call update_columns(n, first, 2, lda, a(1, first), a(1, j))
         end do
         if (modulo(n - last, 2) == 0) cycle
         call swap(first, last, pivot, a(1, n))
         call update_columns(n, first, 1, lda, a(1, first), a(1, n))
      end do
   end subroutine factor_small

   !> Columns first..last column by column, with their swaps among themselves.
   pure subroutine factor_panel(n, first, last, lda, a, pivot, singular)
      integer, intent(in) :: n, first, last, lda
      real(wp), intent(inout) :: a(lda, *)
      integer, intent(inout) :: pivot(*)
      logical, intent(inout) :: singular
      real(wp) :: entry, largest
      integer :: i, j, k, row

      do k = first, last
         largest = 0.0_wp
         !$omp simd reduction(max:largest)
         do i = k, n
            largest = max(largest, abs(a(i, k)))
         end do
         row = k
         do i = k, n
            if (abs(a(i, k)) < largest) cycle
            row = i
            exit
         end do
         pivot(k) = row
         if (largest <= 0.0_wp) then
            singular = .true.
            cycle
         end if
         do j = first, last
            entry = a(row, j)
            a(row, j) = a(k, j)
            a(k, j) = entry
         end do
         entry = 1.0_wp/a(k, k)
         do i = k + 1, n
            a(i, k) = entry*a(i, k)
         end do
         do j = k + 1, last
            entry = a(k, j)
            do i = k + 1, n
               a(i, j) = a(i, j) - a(i, k)*entry
            end do
         end do
      end do
   end subroutine factor_panel

   !> The swaps of a panel in another column.
   pure subroutine swap(first, last, pivot, column)
      integer, intent(in) :: first, last, pivot(*)
      real(wp), intent(inout) :: column(*)
      real(wp) :: entry
      integer :: k

      do k = first, last
         entry = column(pivot(k))
         column(pivot(k)) = column(k)
         column(k) = entry
      end do
   end subroutine swap

   !> What a full panel takes from one or two columns behind it.
   pure subroutine update_columns(n, first, n_columns, lda, panel, column)
      integer, intent(in) :: n, first, n_columns, lda
      real(wp), intent(in) :: panel(lda, width)
      real(wp), intent(inout) :: column(lda, *)
      real(wp) :: u(width, 2)
      integer :: c, i, k

      do c = 1, n_columns
         ! The rows of U: a triangle of the panel with ones on its diagonal.
         do k = 1, width
            u(k, c) = column(first + k - 1, c)
            do i = 1, k - 1
               u(k, c) = u(k, c) - panel(first + k - 1, i)*u(i, c)
            end do
            column(first + k - 1, c) = u(k, c)
         end do
      end do
      if (n_columns == 1) then
         do i = first + width, n
            column(i, 1) = column(i, 1) - panel(i, 1)*u(1, 1) - panel(i, 2)*u(2, 1) - &
                           panel(i, 3)*u(3, 1) - panel(i, 4)*u(4, 1)
         end do
         return
      end if
      do i = first + width, n
         column(i, 1) = column(i, 1) - panel(i, 1)*u(1, 1) - panel(i, 2)*u(2, 1) - &
                        panel(i, 3)*u(3, 1) - panel(i, 4)*u(4, 1)
         column(i, 2) = column(i, 2) - panel(i, 1)*u(1, 2) - panel(i, 2)*u(2, 2) - &
                        panel(i, 3)*u(3, 2) - panel(i, 4)*u(4, 2)
      end do
   end subroutine update_columns

   !> Solve in place for one right-hand side.
   pure subroutine solve_small(n, lda, a, pivot, b)
      integer, intent(in) :: n, lda
      real(wp), intent(in) :: a(lda, *)
      integer, intent(in) :: pivot(*)
      real(wp), intent(inout) :: b(*)
      real(wp) :: entry
      integer :: i, k

      call swap(1, n, pivot, b)
      do k = 1, n
         entry = b(k)
         do i = k + 1, n
            b(i) = b(i) - a(i, k)*entry
         end do
      end do
      do k = n, 1, -1
         entry = b(k)/a(k, k)
         b(k) = entry
         do i = 1, k - 1
            b(i) = b(i) - a(i, k)*entry
         end do
      end do
   end subroutine solve_small

end module fw_small_lu
