!> LU factors of a complex matrix in single precision, to precondition with: they take half the
!> memory and half the time of double ones, and a solution, which memory bounds, less still. An
!> iterative solver in double precision needs no more of a preconditioner than a few digits.
module fw_preconditioner_lu
   use fw_kinds, only: sp, wp
   use fw_lapack, only: cgemm, cgetrf, claswp, ctrsm, ctrsv
   use fw_panel_solve, only: panel_factors
   implicit none (type, external)
   private

   public :: preconditioner_lu_type

   !> Pivots below this, of entries of the order of one, are none: two of them in a row overflow.
   real(sp), parameter :: smallest_pivot = sqrt(tiny(1.0_sp))

   !> Columns that are factored at a time, and orders from which threads share the others.
   integer, parameter :: block_width = 128, least_shared = 384
   !> Orders from which a solution with packed factors saves more than packing takes.
   integer, parameter :: least_packed = 8

   !> The storage only grows, so that refactoring does not allocate.
   type :: preconditioner_lu_type
      integer :: n = 0
      !> Times this the entries are of the order of one, whatever the units.
      real(wp) :: scale = 1.0_wp
      !> The caller fills matrix(1:n, 1:n) with `scale` times its entries.
      complex(sp), allocatable :: matrix(:, :)
      !> A right-hand side in single precision, and the pivots (n).
      complex(sp), allocatable :: rhs(:)
      integer, allocatable :: pivot(:)
      !> The factors as single right-hand sides are solved with, where there are such.
      logical, private :: is_packed = .false.
      type(panel_factors), private :: panels
   contains
      procedure :: reserve
      procedure :: factor
      procedure :: solve
      procedure :: solve_scaled
      procedure :: solve_transposed
   end type preconditioner_lu_type

contains

   !> Make room for order n and entries up to `largest` in absolute value.
   pure subroutine reserve(self, n, largest)
      class(preconditioner_lu_type), intent(inout) :: self
      integer, intent(in) :: n
      real(wp), intent(in) :: largest

      self%n = n
      self%scale = 1.0_wp
      if (largest > 0.0_wp) self%scale = 1.0_wp/largest
      if (allocated(self%matrix)) then
         if (size(self%matrix, 1) >= n) return
         deallocate (self%matrix, self%rhs, self%pivot)
      end if
      allocate (self%matrix(n, n), self%rhs(n), self%pivot(n))
   end subroutine reserve

   !> Factor the matrix in place. A pivot of zero, where the matrix is singular, becomes one: what
   !> is left preconditions still, and costs the iterative solver an iteration for each.
   subroutine factor(self, packs)
      class(preconditioner_lu_type), intent(inout) :: self
      !> Whether single right-hand sides follow in numbers.
      logical, intent(in), optional :: packs
      integer :: i, info

      if (self%n < least_shared) then
         call cgetrf(self%n, self%n, self%matrix, size(self%matrix, 1), self%pivot, info)
      else
         call factor_blocks(self%n, self%matrix, size(self%matrix, 1), self%pivot)
      end if
      do i = 1, self%n
         if (abs(self%matrix(i, i)) < smallest_pivot) self%matrix(i, i) = (1.0_sp, 0.0_sp)
      end do
      self%is_packed = .false.
      if (present(packs)) self%is_packed = packs .and. self%n >= least_packed
      if (self%is_packed) call self%panels%pack_factors(self%n, self%matrix, self%pivot)
   end subroutine factor

   !> As cgetrf; the columns beside those that are factored belong to tasks of their own, which the
   !> threads of a parallel region share. The numbers do not depend on who does them.
   subroutine factor_blocks(n, a, lda, pivot)
      integer, intent(in) :: n, lda
      complex(sp), intent(inout) :: a(lda, n)
      integer, intent(inout) :: pivot(n)
      integer :: first, info, j, n_columns

      do first = 1, n, block_width
         n_columns = min(block_width, n - first + 1)
         call cgetrf(n - first + 1, n_columns, a(first, first), lda, pivot(first), info)
         pivot(first:first + n_columns - 1) = pivot(first:first + n_columns - 1) + first - 1
         !$omp taskloop default(none) private(j) shared(n, lda, a, pivot) &
         !$omp firstprivate(first, n_columns) grainsize(1)
         do j = 1, n, block_width
            if (j == first) cycle
            call update_columns(n, lda, first, n_columns, j, min(block_width, n - j + 1), &
                                pivot, a)
         end do
         !$omp end taskloop
      end do
   end subroutine factor_blocks

   !> Swap rows of columns j to j + width - 1 as a factored block asks, and eliminate right of it.
   subroutine update_columns(n, lda, first, n_columns, j, width, pivot, a)
      integer, intent(in) :: n, lda, first, n_columns, j, width
      integer, intent(in) :: pivot(n)
      complex(sp), intent(inout) :: a(lda, n)
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp)
      integer :: below

      call claswp(width, a(1, j), lda, first, first + n_columns - 1, pivot, 1)
      if (j < first) return
      call ctrsm('L', 'L', 'N', 'U', n_columns, width, one, a(first, first), lda, a(first, j), lda)
      below = first + n_columns
      if (below > n) return
      call cgemm('N', 'N', n - below + 1, width, n_columns, -one, a(below, first), lda, &
                 a(first, j), lda, one, a(below, j), lda)
   end subroutine update_columns

   !> Solve in place for one right-hand side (n), to single precision.
   subroutine solve(self, b)
      class(preconditioner_lu_type), intent(inout) :: self
      complex(wp), intent(inout), contiguous :: b(:)
      real(wp) :: largest
      integer :: ld

      largest = max(maxval(abs(real(b, wp))), maxval(abs(aimag(b))))
      if (.not. largest > 0.0_wp) return
      ! Single precision ends at 1e38: the entries are brought to the order of one before.
      self%rhs(:self%n) = cmplx(b/largest, kind=sp)
      if (self%is_packed) then
         call self%panels%solve_one(self%rhs(:self%n))
      else
         ! Not cgetrs, which packs the factors anew for a single right-hand side.
         ld = size(self%matrix, 1)
         call claswp(1, self%rhs, ld, 1, self%n, self%pivot, 1)
         call ctrsv('L', 'N', 'U', self%n, self%matrix, ld, self%rhs, 1)
         call ctrsv('U', 'N', 'N', self%n, self%matrix, ld, self%rhs, 1)
      end if
      ! x = A^-1 b = scale largest (scale A)^-1 (b/largest).
      b = self%scale*largest*cmplx(self%rhs(:self%n), kind=wp)
   end subroutine solve

   !> (scale A)^-1 b for many right-hand sides of the order of one, in place (n, n_columns).
   subroutine solve_scaled(self, n_columns, b)
      class(preconditioner_lu_type), intent(in) :: self
      integer, intent(in) :: n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp)
      integer :: ld

      ld = size(self%matrix, 1)
      call claswp(n_columns, b, size(b, 1), 1, self%n, self%pivot, 1)
      call ctrsm('L', 'L', 'N', 'U', self%n, n_columns, one, self%matrix, ld, b, size(b, 1))
      call ctrsm('L', 'U', 'N', 'N', self%n, n_columns, one, self%matrix, ld, b, size(b, 1))
   end subroutine solve_scaled

   !> As `solve`, with the transposed matrix.
   subroutine solve_transposed(self, b)
      class(preconditioner_lu_type), intent(inout) :: self
      complex(wp), intent(inout), contiguous :: b(:)
      real(wp) :: largest
      integer :: ld

      largest = max(maxval(abs(real(b, wp))), maxval(abs(aimag(b))))
      if (.not. largest > 0.0_wp) return
      ld = size(self%matrix, 1)
      self%rhs(:self%n) = cmplx(b/largest, kind=sp)
      ! (P L U)^T = U^T L^T P^T: the other way round, and the swaps last.
      call ctrsv('U', 'T', 'N', self%n, self%matrix, ld, self%rhs, 1)
      call ctrsv('L', 'T', 'U', self%n, self%matrix, ld, self%rhs, 1)
      call claswp(1, self%rhs, ld, 1, self%n, self%pivot, -1)
      b = self%scale*largest*cmplx(self%rhs(:self%n), kind=wp)
   end subroutine solve_transposed

end module fw_preconditioner_lu
