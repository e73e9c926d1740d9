!> Factors that precondition all harmonics with two matrices: A_n = P_j + X_j S_n V^T, P_0 for
!> harmonic 0 and P_1 for all others, with S_n of low rank (Woodbury's formula):
!>
!>   A_n^-1 x = y - U_j T_n V^T y,   y = P_j^-1 x,   U_j = P_j^-1 X_j,
!>   T_n = S_n (1 + V^T U_j S_n)^-1.
!>
!> In single precision, all harmonics of one matrix at a time.
module fw_split_factors
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   use fw_lapack, only: cgemm
   use fw_linalg, only: complex_lu_type
   use fw_preconditioner_lu, only: preconditioner_lu_type
   implicit none (type, external)
   private

   public :: split_factors

   type :: split_factors
      !> P_0 and P_1; the caller fills their matrices.
      type(preconditioner_lu_type) :: static(0:1)
      !> Order and rank.
      integer :: n = 0, rank = 0
      !> X_j, then U_j (n, rank), and V (n, rank).
      complex(sp), allocatable :: u(:, :, :), v(:, :)
      !> T_n (rank, rank, harmonic).
      complex(sp), allocatable, private :: t(:, :, :)
      !> Right-hand sides in single precision (n, harmonics) and their patterns.
      complex(sp), allocatable, private :: rhs(:, :), pattern(:, :), turned(:, :)
   contains
      procedure :: reserve
      procedure :: factor
      procedure :: solve
   end type split_factors

contains

   !> Room for matrices of order n with entries up to `largest`.
   subroutine reserve(self, n, rank, n_harmonics, largest)
      class(split_factors), intent(inout) :: self
      integer, intent(in) :: n, rank, n_harmonics
      real(wp), intent(in) :: largest
      integer :: j

      do j = 0, 1
         call self%static(j)%reserve(n, largest)
      end do
      if (self%n == n .and. self%rank == rank) return
      self%n = n
      self%rank = rank
      if (allocated(self%u)) deallocate (self%u, self%v, self%t, self%rhs, self%pattern, &
                                         self%turned)
      allocate (self%u(n, rank, 0:1), self%v(n, rank), self%t(rank, rank, n_harmonics))
      allocate (self%rhs(n, n_harmonics), self%pattern(rank, n_harmonics))
      allocate (self%turned(rank, n_harmonics))
   end subroutine reserve

   !> Factor P_0 and P_1, and find U_j and T_n; harmonics are numbered from `first` on, below which
   !> stands harmonic 0.
   subroutine factor(self, first, dynamic)
      class(split_factors), intent(inout) :: self
      !> 1 without harmonic 0, else 2.
      integer, intent(in) :: first
      !> S_n in units of the matrices before they were scaled (rank, rank, harmonic).
      complex(wp), intent(in) :: dynamic(:, :, :)
      complex(sp) :: square(self%rank, self%rank)
      type(complex_lu_type) :: lu
      complex(wp) :: transposed(self%rank, self%rank)
      logical :: singular
      integer :: h, i, j

      call lu%reserve(self%rank)
      do j = merge(0, 1, first == 2), 1
         call self%static(j)%factor()
         call self%static(j)%solve_scaled(self%rank, self%u(:, :, j))
         call cgemm('T', 'N', self%rank, self%rank, self%n, (1.0_sp, 0.0_sp), self%v, self%n, &
                    self%u(1, 1, j), self%n, (0.0_sp, 0.0_sp), square, self%rank)
         do h = merge(1, first, j == 0), merge(1, size(dynamic, 3), j == 0)
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
      end do
   end subroutine factor

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
      if (first == 2) call solve_with(self, 0, 1, 1)
      if (last >= first) call solve_with(self, 1, first, last)
      do h = 1, last
         ! Of matrices that were scaled: A^-1 = scale (scale A)^-1.
         b(:self%n, h) = self%static(1)%scale*largest(h)*cmplx(self%rhs(:, h), kind=wp)
      end do
   end subroutine solve

   !> Harmonics that share a matrix.
   subroutine solve_with(self, j, first, last)
      type(split_factors), intent(inout) :: self
      integer, intent(in) :: j, first, last
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)
      integer :: h, n_columns

      n_columns = last - first + 1
      call self%static(j)%solve_scaled(n_columns, self%rhs(:, first:last))
      call cgemm('T', 'N', self%rank, n_columns, self%n, one, self%v, self%n, &
                 self%rhs(1, first), self%n, zero, self%pattern(1, first), self%rank)
      do h = first, last
         self%turned(:, h) = matmul(self%t(:, :, h), self%pattern(:, h))
      end do
      call cgemm('N', 'N', self%n, n_columns, self%rank, -one, self%u(1, 1, j), self%n, &
                 self%turned(1, first), self%rank, one, self%rhs(1, first), self%n)
   end subroutine solve_with

end module fw_split_factors
