!> LU factors in parts, between which somebody may ask for the end: a matrix of thousands of
!> unknowns takes dgetrf alone for seconds.
!>
!> Right-looking elimination by panels (Golub and Van Loan 2013, Matrix computations, section 3.4):
!> dgetrf on a panel, then its swaps and its product on the columns behind it, strip by strip. It
!> takes some 8 % longer than one call, which shares the packing of its products.
module fw_lu_in_parts
   use fw_interrupt, only: interrupt_type, must_end
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm, dgetrf, dlaswp, dtrsm
   implicit none (type, external)
   private

   public :: factor_in_parts, whole_up_to

   !> Order up to which one call of dgetrf is short enough (some 0.5 s).
   integer, parameter :: whole_up_to = 3000
   !> Columns of a panel, and of the strips that its product is formed in: wide enough for dgemm.
   integer, parameter :: panel = 256, strip = 512

contains

   !> Factors in place, as dgetrf leaves them; `singular` where a pivot is zero, or where the work
   !> ended early.
   subroutine factor_in_parts(n, a, lda, pivot, singular, interrupt)
      integer, intent(in) :: n, lda
      real(wp), intent(inout) :: a(lda, *)
      integer, intent(out) :: pivot(*)
      logical, intent(out) :: singular
      class(interrupt_type), pointer, intent(in) :: interrupt
      integer :: first, info, k, last, width

      singular = .false.
      do k = 1, n, panel
         width = min(panel, n - k + 1)
         last = k + width - 1
         if (must_end(interrupt)) exit
         call dgetrf(n - k + 1, width, a(k, k), lda, pivot(k), info)
         singular = singular .or. info /= 0
         pivot(k:last) = pivot(k:last) + k - 1
         call dlaswp(k - 1, a, lda, k, last, pivot, 1)
         do first = last + 1, n, strip
            if (must_end(interrupt)) exit
            call update(k, width, first, min(strip, n - first + 1), n, a, lda, pivot)
         end do
      end do
      ! What somebody ends is not factored, however far it came.
      singular = singular .or. must_end(interrupt)
   end subroutine factor_in_parts

   !> What a panel of columns leaves of a strip behind it.
   subroutine update(k, width, first, n_columns, n, a, lda, pivot)
      !> First column of the panel and their number, and of the strip.
      integer, intent(in) :: k, width, first, n_columns
      integer, intent(in) :: n, lda
      real(wp), intent(inout) :: a(lda, *)
      integer, intent(in) :: pivot(*)
      integer :: below

      below = k + width
      call dlaswp(n_columns, a(1, first), lda, k, below - 1, pivot, 1)
      call dtrsm('L', 'L', 'N', 'U', width, n_columns, 1.0_wp, a(k, k), lda, a(k, first), lda)
      if (below > n) return
      call dgemm('N', 'N', n - below + 1, n_columns, width, -1.0_wp, a(below, k), lda, &
                 a(k, first), lda, 1.0_wp, a(below, first), lda)
   end subroutine update

end module fw_lu_in_parts
