!> Factors that precondition all harmonics with two matrices: P_0, real, for harmonic 0, and
!> A_n = P_1 + X S_n V^T for all others, with S_n of low rank (Woodbury's formula):
!>
!>   A_n^-1 x = y - U T_n V^T y,   y = P_1^-1 x,   U = P_1^-1 X,   T_n = S_n (1 + V^T U S_n)^-1.
!>
!> Of rank 0 the harmonics differ by nothing. In single precision, all harmonics of P_1 at a time.
module fw_split_factors
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   use fw_lapack, only: cgemm
   use fw_lapack, only: sgetrf
   use fw_lapack, only: strsm
   use fw_lapack, only: strsv
   use fw_linalg, only: complex_lu_type
   use fw_panel_solve, only: panel_factors
   use fw_preconditioner_lu, only: preconditioner_lu_type
   implicit none (type, external)
   private

   public :: split_factors

   type :: split_factors
      !> P_1, whose matrix the caller fills, and P_0, both times the scale of P_1; room
      !> that only grows.
      type(preconditioner_lu_type) :: moving
      real(sp), allocatable :: constant(:, :)
      !> Order and rank.
      integer :: n = 0, rank = 0
      !> X, then U (n, rank), and V (n, rank).
      complex(sp), allocatable :: u(:, :), v(:, :)
      !> P_1 as it is solved with; pivots of P_0.
      type(panel_factors), private :: panels
      integer, allocatable, private :: pivot(:)
      !> T_n (rank, rank, harmonic).
      complex(sp), allocatable, private :: t(:, :, :)
      !> Right-hand sides in single precision (n, harmonics) and their patterns; of harmonic 0 (n).
      complex(sp), allocatable, private :: rhs(:, :), pattern(:, :), turned(:, :)
      real(sp), allocatable, private :: mean(:)
   contains
      procedure :: reserve
      procedure :: factor
      procedure :: solve
      procedure :: solve_alike
   end type split_factors

   !> Pivots below this, of entries of the order of one, are none, as in fw_preconditioner_lu.
   real(sp), parameter :: smallest_pivot = sqrt(tiny(1.0_sp))

contains

   !> Room for matrices of order n with entries up to `largest`.
   subroutine reserve(self, n, rank, n_harmonics, largest)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: n, rank, n_harmonics
      real(wp), intent(in) :: largest

      call self%moving%reserve(n, largest)
      if (self%n == n .and. self%rank == rank) return
      self%n = n
      self%rank = rank
      if (allocated(self%u)) deallocate (self%u, self%v, self%t, self%rhs, self%pattern, &
                                         self%turned, self%mean)
      allocate (self%u(n, rank), self%v(n, rank), self%t(rank, rank, n_harmonics))
      allocate (self%rhs(n, n_harmonics), self%pattern(rank, n_harmonics))
      allocate (self%turned(rank, n_harmonics))
      allocate (self%mean(n))
      if (allocated(self%constant)) then
         if (size(self%constant, 1) >= n) return
         deallocate (self%constant, self%pivot)
      end if
      allocate (self%constant(n, n), self%pivot(n))
   end subroutine reserve

   !> Factor P_0 and P_1, and find U and T_n.
   subroutine factor(self, first, dynamic)
      class(split_factors), intent(inout) :: self
      !> Number of the first harmonic that is not 0: 1 without harmonic 0, else 2.
      integer, intent(in) :: first
      !> S_n in units of the matrices before they were scaled (rank, rank, harmonic).
      complex(wp), intent(in) :: dynamic(:, :, :)
      integer :: info

      !$omp parallel default(none) shared(self, first, info)
      !$omp single
      !$omp task default(none) shared(self, first, info)
      if (first == 2) call sgetrf(self%n, self%n, self%constant, size(self%constant, 1), &
                                  self%pivot, info)
      !$omp end task
      call self%moving%factor()
      !$omp end single
      !$omp end parallel
      if (first == 2) call mend_pivots(self%constant(:self%n, :self%n))
      call self%panels%pack_factors(self%n, self%moving%matrix, self%moving%pivot)
      if (self%rank > 0 .and. size(dynamic, 3) >= first) call find_patterns(self, first, dynamic)
   end subroutine factor

   !> A singular matrix preconditions still, and costs the iterative solver an iteration.
   pure subroutine mend_pivots(matrix)
      real(sp), intent(inout) :: matrix(:, :)
      integer :: i

      do i = 1, size(matrix, 1)
         if (abs(matrix(i, i)) < smallest_pivot) matrix(i, i) = 1.0_sp
      end do
   end subroutine mend_pivots

   !> U and T_n.
   subroutine find_patterns(self, first, dynamic)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: first
      complex(wp), intent(in) :: dynamic(:, :, :)
      complex(sp) :: square(self%rank, self%rank)
      type(complex_lu_type) :: lu
      complex(wp) :: transposed(self%rank, self%rank)
      logical :: singular
      integer :: h, i

      call lu%reserve(self%rank)
      call self%panels%solve(self%rank, self%u)
      call cgemm('T', 'N', self%rank, self%rank, self%n, (1.0_sp, 0.0_sp), self%v, self%n, &
                 self%u, self%n, (0.0_sp, 0.0_sp), square, self%rank)
      do h = first, size(dynamic, 3)
         ! T (1 + V^T U S) = S, solved as transposed.
         lu%matrix = transpose(matmul(cmplx(square, kind=wp), dynamic(:, :, h)))
         do i = 1, self%rank
            lu%matrix(i, i) = lu%matrix(i, i) + 1.0_wp
         end do
         transposed = transpose(dynamic(:, :, h))
         call lu%factor(singular)
         if (singular) transposed = (0.0_wp, 0.0_wp)
         if (.not. singular) call lu%solve(self%rank, transposed)
         self%t(:, :, h) = cmplx(transpose(transposed), kind=sp)
      end do
   end subroutine find_patterns

   !> Solve in place for all harmonics (n, n_harmonics).
   subroutine solve(self, first, b)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: first
      complex(wp), intent(inout) :: b(:, :)
      real(wp) :: largest(size(b, 2))
      integer :: h, last

      last = size(b, 2)
      do h = 1, last
         ! To the order of one, because single precision ends at 1e38.
         largest(h) = max(maxval(abs(real(b(:self%n, h), wp))), &
                          maxval(abs(aimag(b(:self%n, h)))))
         if (.not. largest(h) > 0.0_wp) largest(h) = 1.0_wp
         self%rhs(:, h) = cmplx(b(:self%n, h)/largest(h), kind=sp)
      end do
      if (first == 2) call solve_constant(self, self%rhs(:, 1))
      if (last >= first) call solve_moving(self, first, last)
      do h = 1, last
         ! Of matrices that were scaled: A^-1 = scale (scale A)^-1.
         b(:self%n, h) = self%moving%scale*largest(h)*cmplx(self%rhs(:, h), kind=wp)
      end do
   end subroutine solve

   !> Right-hand sides of the order of one in place, `n_columns` of a harmonic, one harmonic behind
   !> the other from `first` on; those of harmonic 0 (`is_constant`) are real, and by themselves.
   subroutine solve_alike(self, is_constant, first, n_columns, b)
      class(split_factors), intent(inout) :: self
      logical, intent(in) :: is_constant
      integer, intent(in) :: first, n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)

      if (is_constant) then
         call solve_constants(self, n_columns, b)
      else
         call self%panels%solve(size(b, 2), b)
         if (self%rank > 0) call subtract_patterns(self, first, n_columns, b)
      end if
   end subroutine solve_alike

   !> Of A_n^-1 what the patterns add, `n_columns` of every harmonic.
   subroutine subtract_patterns(self, first, n_columns, b)
      type(split_factors), intent(in) :: self
      integer, intent(in) :: first, n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)
      complex(sp), allocatable :: pattern(:, :), turned(:, :)
      integer :: h, k, n

      n = size(b, 2)
      allocate (pattern(self%rank, n), turned(self%rank, n))
      call cgemm('T', 'N', self%rank, n, self%n, one, self%v, self%n, b, self%n, zero, pattern, &
                 self%rank)
      do h = 1, n/n_columns
         k = (h - 1)*n_columns
         call cgemm('N', 'N', self%rank, n_columns, self%rank, one, &
                    self%t(1, 1, first + h - 1), self%rank, pattern(1, k + 1), self%rank, zero, &
                    turned(1, k + 1), self%rank)
      end do
      call cgemm('N', 'N', self%n, n, self%rank, -one, self%u, self%n, turned, self%rank, one, b, &
                 self%n)
   end subroutine subtract_patterns

   !> Harmonic 0 of many.
   subroutine solve_constants(self, n_columns, b)
      type(split_factors), intent(in) :: self
      integer, intent(in) :: n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)
      real(sp), allocatable :: means(:, :)
      integer :: i, ld

      ld = size(self%constant, 1)
      means = real(b(:, :n_columns), sp)
      do i = 1, self%n
         if (self%pivot(i) /= i) means([i, self%pivot(i)], :) = means([self%pivot(i), i], :)
      end do
      call strsm('L', 'L', 'N', 'U', self%n, n_columns, 1.0_sp, self%constant, ld, means, self%n)
      call strsm('L', 'U', 'N', 'N', self%n, n_columns, 1.0_sp, self%constant, ld, means, self%n)
      b(:, :n_columns) = cmplx(means, kind=sp)
   end subroutine solve_constants

   !> Harmonic 0, which is real.
   subroutine solve_constant(self, b)
      type(split_factors), intent(inout) :: self
      complex(sp), intent(inout) :: b(:)
      integer :: i, ld

      ld = size(self%constant, 1)
      self%mean = real(b, sp)
      do i = 1, self%n
         self%mean([i, self%pivot(i)]) = self%mean([self%pivot(i), i])
      end do
      call strsv('L', 'N', 'U', self%n, self%constant, ld, self%mean, 1)
      call strsv('U', 'N', 'N', self%n, self%constant, ld, self%mean, 1)
      b = cmplx(self%mean, kind=sp)
   end subroutine solve_constant

   !> All others at once.
   subroutine solve_moving(self, first, last)
      type(split_factors), intent(inout) :: self
      integer, intent(in) :: first, last
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)
      integer :: h, n_columns

      n_columns = last - first + 1
      call self%panels%solve(n_columns, self%rhs(:, first:last))
      if (self%rank == 0) return
      call cgemm('T', 'N', self%rank, n_columns, self%n, one, self%v, self%n, &
                 self%rhs(1, first), self%n, zero, self%pattern(1, first), self%rank)
      do h = first, last
         self%turned(:, h) = matmul(self%t(:, :, h), self%pattern(:, h))
      end do
      call cgemm('N', 'N', self%n, n_columns, self%rank, -one, self%u, self%n, &
                 self%turned(1, first), self%rank, one, self%rhs(1, first), self%n)
   end subroutine solve_moving

end module fw_split_factors
