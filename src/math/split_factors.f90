!> Factors that precondition all harmonics with two matrices: P_0, real, for harmonic 0, and
!> A_n = P_1 + X S_n V^T for all others, with S_n of low rank (Woodbury's formula):
!>
!>   A_n^-1 x = y - U T_n V^T y,   y = P_1^-1 x,   U = P_1^-1 X,   T_n = S_n (1 + V^T U S_n)^-1.
!>
!> Of rank 0 the harmonics differ by nothing. In single precision, all harmonics of P_1 at a time.
module fw_split_factors
   use fw_kinds, only: sp, wp
   use fw_lapack, only: cgemm, sgetrf, strsm
   use fw_linalg, only: complex_lu_type
   use fw_panel_solve, only: group_width, panel_factors
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use omp_lib, only: omp_get_max_threads
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
      !> P_1 and P_0 as they are solved with; pivots of P_0.
      type(panel_factors), private :: panels
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(panel_factors), allocatable, private :: constant_panels
      integer, allocatable, private :: pivot(:)
      !> T_n (rank, rank, harmonic).
      complex(sp), allocatable, private :: t(:, :, :)
      !> Right-hand sides in single precision (n, harmonics) and their patterns; of harmonic 0 (n).
      complex(sp), allocatable, private :: rhs(:, :), pattern(:, :), turned(:, :)
      real(sp), allocatable, private :: mean(:)
      !> Scales of the right-hand sides (harmonics).
      real(wp), allocatable, private :: largest(:)
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
                                         self%turned, self%mean, self%largest)
      allocate (self%u(n, rank), self%v(n, rank), self%t(rank, rank, n_harmonics))
      allocate (self%rhs(n, n_harmonics), self%pattern(rank, n_harmonics))
      allocate (self%turned(rank, n_harmonics))
      allocate (self%mean(n), self%largest(n_harmonics))
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
      if (first == 2) then
         call mend_pivots(self%constant(:self%n, :self%n))
         if (.not. allocated(self%constant_panels)) allocate (self%constant_panels)
         call self%constant_panels%pack_real(self%n, self%constant, self%pivot)
      end if
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

   !> Solve in place for all harmonics, real coefficients side by side (any rows, n_coefficients).
   !> Threads share harmonic 0 and the groups of four others: whoever has harmonic 0, which is the
   !> lightest, has no more groups than anybody else.
   subroutine solve(self, harmonic, column, from, threaded, vector)
      class(split_factors), intent(inout) :: self
      !> Harmonics and the columns of their coefficients.
      integer, intent(in) :: harmonic(:), column(:)
      !> Row of each unknown in the vector, 0 for one that is not there (n).
      integer, intent(in) :: from(:)
      logical, intent(in) :: threaded
      real(wp), intent(inout) :: vector(:, :)
      integer :: first, n_shares, n_units, share

      if (size(harmonic) == 0) return
      first = merge(2, 1, harmonic(1) == 0)
      call self%panels%reserve_groups(size(harmonic) - first + 1)
      n_units = (size(harmonic) - first + group_width)/group_width + first - 1
      n_shares = merge(min(n_units, omp_get_max_threads()), 1, threaded)
      !$omp parallel do default(none) private(share) if(n_shares > 1) &
      !$omp shared(self, harmonic, column, from, vector, first, n_shares, n_units)
      do share = 1, n_shares
         call solve_units(self, harmonic, column, from, first, rounded((share - 1)*n_units) + 1, &
                          rounded(share*n_units), vector)
      end do
      !$omp end parallel do

   contains

      pure integer function rounded(units)
         integer, intent(in) :: units

         rounded = (units + n_shares - 1)/n_shares
      end function rounded

   end subroutine solve

   !> Units of work: harmonic 0, where there is one, then groups.
   subroutine solve_units(self, harmonic, column, from, first, unit_first, unit_last, vector)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: harmonic(:), column(:), from(:)
      !> As in `factor`.
      integer, intent(in) :: first
      integer, intent(in) :: unit_first, unit_last
      real(wp), intent(inout) :: vector(:, :)
      integer :: g, g_first, g_last, h, last, h_last

      if (first == 2 .and. unit_first == 1) then
         call take_harmonic(self, .true., column(1), from, vector, self%largest(1), self%rhs(:, 1))
         self%mean = real(self%rhs(:, 1), sp)
         call self%constant_panels%solve_real(self%mean)
         self%rhs(:, 1) = cmplx(self%mean, kind=sp)
         call give_harmonic(self, .true., column(1), from, vector, self%largest(1), self%rhs(:, 1))
      end if
      g_first = max(unit_first - first + 1, 1)
      g_last = unit_last - first + 1
      if (g_first > g_last) return
      last = size(harmonic)
      h_last = min(last, first + g_last*group_width - 1)
      do h = first + (g_first - 1)*group_width, h_last
         call take_harmonic(self, .false., column(h), from, vector, self%largest(h), self%rhs(:, h))
      end do
      call self%panels%solve_groups(g_first, g_last, last - first + 1, self%rhs(:, first:last))
      if (self%rank > 0) then
         ! Group by group, whoever does them: sizes of products decide on their last bits.
         do g = g_first, g_last
            h = first + (g - 1)*group_width
            call subtract_group(self, h, min(last, h + group_width - 1))
         end do
      end if
      do h = first + (g_first - 1)*group_width, h_last
         call give_harmonic(self, .false., column(h), from, vector, self%largest(h), self%rhs(:, h))
      end do
   end subroutine solve_units

   !> A right-hand side of the order of one, because single precision ends at 1e38.
   pure subroutine take_harmonic(self, is_constant, k, from, vector, largest, rhs)
      class(split_factors), intent(in) :: self
      logical, intent(in) :: is_constant
      !> Column of its first coefficient.
      integer, intent(in) :: k
      integer, intent(in) :: from(:)
      real(wp), intent(in) :: vector(:, :)
      real(wp), intent(out) :: largest
      complex(sp), intent(out) :: rhs(:)
      real(wp) :: factor
      integer :: i, last

      last = merge(k, k + 1, is_constant)
      largest = 0.0_wp
      !$omp simd reduction(max:largest)
      do i = 1, self%n
         if (from(i) > 0) largest = max(largest, abs(vector(from(i), k)), &
                                        abs(vector(from(i), last)))
      end do
      ! Its reciprocal is to be finite.
      if (.not. largest > tiny(1.0_wp)) largest = 1.0_wp
      factor = 1.0_wp/largest
      do i = 1, self%n
         rhs(i) = (0.0_sp, 0.0_sp)
         if (from(i) == 0) cycle
         rhs(i) = cmplx(factor*vector(from(i), k), -factor*vector(from(i), last), sp)
      end do
   end subroutine take_harmonic

   !> Back, and out of the scale of the matrices: A^-1 = scale (scale A)^-1.
   pure subroutine give_harmonic(self, is_constant, k, from, vector, largest, rhs)
      class(split_factors), intent(in) :: self
      logical, intent(in) :: is_constant
      integer, intent(in) :: k
      integer, intent(in) :: from(:)
      real(wp), intent(inout) :: vector(:, :)
      real(wp), intent(in) :: largest
      complex(sp), intent(in) :: rhs(:)
      real(wp) :: factor
      integer :: i

      factor = self%moving%scale*largest
      do i = 1, self%n
         if (from(i) == 0) cycle
         vector(from(i), k) = factor*real(rhs(i), wp)
         if (.not. is_constant) vector(from(i), k + 1) = -factor*real(aimag(rhs(i)), wp)
      end do
   end subroutine give_harmonic

   !> Of A_n^-1 what the patterns add, of the harmonics of one group.
   subroutine subtract_group(self, first, last)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: first, last
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)
      integer :: h

      call cgemm('T', 'N', self%rank, last - first + 1, self%n, one, self%v, self%n, &
                 self%rhs(1, first), self%n, zero, self%pattern(1, first), self%rank)
      do h = first, last
         self%turned(:, h) = matmul(self%t(:, :, h), self%pattern(:, h))
      end do
      call cgemm('N', 'N', self%n, last - first + 1, self%rank, -one, self%u, self%n, &
                 self%turned(1, first), self%rank, one, self%rhs(1, first), self%n)
   end subroutine subtract_group

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

end module fw_split_factors
