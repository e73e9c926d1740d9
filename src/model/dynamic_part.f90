!> What vibration adds to the static stiffness of a condensed structure, as a matrix of low rank.
!> With the static constraint modes in the basis,
!>
!>   Z_n = K + D_n,   D_n = -theta_n M_qq + i s C_qq - z_n D^-1 z_n^T,
!>   z_n = -theta_n M_qi + i s C_qi,
!>
!> K is the same real matrix in all harmonics and at all frequencies, and of many coordinates D_n
!> matters in a few patterns only. In units in which every coordinate has the stiffness 1
!> (e = diag(K)^(-1/2)) they are spanned by the leading left singular vectors Q of
!>
!>   X = [e M_qi k_i^(-1/2)  e M_qq e  e C_qq e / omega_h] omega_h^2,
!>
!> omega_h being the highest n omega. With V = e^-1 Q, W = e Q:  D_n ~ V S_n V^T, S_n = W^T D_n W.
!> Good enough for the steps of an iterative solver, never for a residual.
module fw_dynamic_part
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_linalg, only: diagonalize
   use fw_error, only: error_type
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: dynamic_part, find_dynamic_part

   type :: dynamic_part
      !> 0 where no low rank serves.
      integer :: rank = 0
      !> V (n_coordinates, rank).
      real(wp), allocatable :: v(:, :)
      !> W^T M_qq W and W^T C_qq W (rank, rank); W^T M_qi and W^T C_qi, transposed
      !> (n_internal, rank).
      real(wp), allocatable, private :: mass(:, :), damping(:, :), mass_i(:, :), damping_i(:, :)
   contains
      procedure :: at_harmonic
   end type dynamic_part

   !> Share of the static stiffness that may be left out, and patterns for each coordinate from
   !> which they are too many.
   real(wp), parameter :: negligible = 1.0e-3_wp
   real(wp), parameter :: most_patterns = 0.15_wp
   !> Patterns that are looked for beside those that are kept.
   integer, parameter :: spare = 10

contains

   !> The patterns of a structure for frequencies up to omega_h; rank 0 where they are too many, or
   !> where a coordinate has no static stiffness.
   subroutine find_dynamic_part(basis, omega_h, self)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: omega_h
      type(dynamic_part), intent(out) :: self
      real(wp), allocatable :: q(:, :), values(:), e(:), w(:, :), rows(:, :)
      integer :: j, m, n

      m = basis%n_coordinates
      if (m < 4*spare) return
      e = [(basis%blocks(j, j, 1), j=1, m)]
      if (any(e <= 0.0_wp) .or. any(basis%k_i <= 0.0_wp)) return
      e = 1.0_wp/sqrt(e)
      ! As many as are needed, from few to more.
      n = 2*spare
      do
         call find_patterns(basis, omega_h, e, n, q, values)
         self%rank = count(values > negligible)
         if (self%rank <= n - spare) exit
         self%rank = 0
         n = 2*n
         if (n - spare > most_patterns*m) return
      end do
      if (self%rank == 0) return
      self%v = q(:, :self%rank)
      w = q(:, :self%rank)
      do j = 1, self%rank
         self%v(:, j) = self%v(:, j)/e
         w(:, j) = w(:, j)*e
      end do
      rows = product_of('N', 'N', basis%blocks(:, :, 2), w)
      self%mass = product_of('T', 'N', w, rows(:m, :))
      self%mass_i = rows(m + 1:, :)
      allocate (self%damping(self%rank, self%rank), self%damping_i(basis%n_internal, self%rank), &
                source=0.0_wp)
      if (basis%n_blocks == 2) return
      rows = product_of('N', 'N', basis%blocks(:, :, 3), w)
      self%damping = product_of('T', 'N', w, rows(:m, :))
      self%damping_i = rows(m + 1:, :)
   end subroutine find_dynamic_part

   !> X of the module header times a matrix; X itself would take as much room as M and C.
   function times_motion(basis, omega_h, e, other) result(product)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: omega_h, e(:), other(:, :)
      real(wp), allocatable :: product(:, :)
      real(wp), allocatable :: right(:, :)
      integer :: j, m, n_i

      m = basis%n_coordinates
      n_i = basis%n_internal
      allocate (right(m + n_i, size(other, 2)))
      do j = 1, size(other, 2)
         right(:m, j) = omega_h**2*e*other(n_i + 1:n_i + m, j)
         right(m + 1:, j) = omega_h**2/sqrt(basis%k_i)*other(:n_i, j)
      end do
      product = product_of('T', 'N', basis%blocks(:, :, 2), right)
      if (basis%n_blocks == 3) then
         do j = 1, size(other, 2)
            right(:m, j) = omega_h*e*other(n_i + m + 1:, j)
            right(m + 1:, j) = 0.0_wp
         end do
         product = product + product_of('T', 'N', basis%blocks(:, :, 3), right)
      end if
      do j = 1, size(other, 2)
         product(:, j) = e*product(:, j)
      end do
   end function times_motion

   !> The transpose of X times a matrix.
   function times_motion_transposed(basis, omega_h, e, q) result(product)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: omega_h, e(:), q(:, :)
      real(wp), allocatable :: product(:, :)
      real(wp), allocatable :: rows(:, :), right(:, :)
      integer :: j, m, n_i

      m = basis%n_coordinates
      n_i = basis%n_internal
      allocate (product(n_i + (basis%n_blocks - 1)*m, size(q, 2)), right(m, size(q, 2)))
      do j = 1, size(q, 2)
         right(:, j) = e*q(:, j)
      end do
      rows = product_of('N', 'N', basis%blocks(:, :, 2), right)
      do j = 1, size(q, 2)
         product(:n_i, j) = omega_h**2/sqrt(basis%k_i)*rows(m + 1:, j)
         product(n_i + 1:n_i + m, j) = omega_h**2*e*rows(:m, j)
      end do
      if (basis%n_blocks == 2) return
      rows = product_of('N', 'N', basis%blocks(:, :, 3), right)
      do j = 1, size(q, 2)
         product(n_i + m + 1:, j) = omega_h*e*rows(:m, j)
      end do
   end function times_motion_transposed

   !> Leading left singular vectors of X in columns, and singular values in descending order, from
   !> products of X with a few vectors (two passes of a randomized search, a fixed seed).
   subroutine find_patterns(basis, omega_h, e, n, q, values)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: omega_h, e(:)
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: q(:, :), values(:)
      real(wp), allocatable :: other(:, :), small(:, :)
      type(error_type), allocatable :: error
      integer :: i, j, n_kept, pass

      allocate (other(basis%n_internal + (basis%n_blocks - 1)*basis%n_coordinates, n))
      do j = 1, n
         do i = 1, size(other, 1)
            ! Numbers without a pattern, the same in every run.
            other(i, j) = modulo(sin(12.9898_wp*i + 78.233_wp*j)*43758.5453_wp, 1.0_wp) - 0.5_wp
         end do
      end do
      do pass = 1, 3
         q = times_motion(basis, omega_h, e, other)
         call orthonormalize(q)
         other = times_motion_transposed(basis, omega_h, e, q)
      end do
      ! Singular values and vectors of Q^T X = other^T by those of its square.
      small = product_of('T', 'N', other, other)
      call diagonalize(small, values, 'patterns of a structure', error)
      if (allocated(error)) then
         values = 0.0_wp*values
         return
      end if
      n_kept = size(values)
      q = product_of('N', 'N', q, small(:, n_kept:1:-1))
      values = sqrt(max(0.0_wp, values(n_kept:1:-1)))
   end subroutine find_patterns

   !> An orthonormal basis of the columns, in their place: twice by the square of the matrix.
   subroutine orthonormalize(q)
      real(wp), allocatable, intent(inout) :: q(:, :)
      real(wp), parameter :: least = 1.0e-12_wp
      real(wp), allocatable :: square(:, :), values(:)
      type(error_type), allocatable :: error
      integer :: j, n, pass, first

      do pass = 1, 2
         ! Nothing is left of a structure whose motion adds nothing, such as one without mass.
         if (size(q, 2) == 0) return
         square = product_of('T', 'N', q, q)
         call diagonalize(square, values, 'patterns of a structure', error)
         if (allocated(error)) return
         n = size(values)
         ! Directions that round-off has made are left out.
         first = count(values <= least*values(n)) + 1
         do j = first, n
            square(:, j) = square(:, j)/sqrt(values(j))
         end do
         q = product_of('N', 'N', q, square(:, first:))
      end do
   end subroutine orthonormalize

   !> op(a) op(b).
   function product_of(op_a, op_b, a, b) result(c)
      character, intent(in) :: op_a, op_b
      real(wp), intent(in), contiguous :: a(:, :), b(:, :)
      real(wp), allocatable :: c(:, :)
      integer :: m, n, k

      m = merge(size(a, 1), size(a, 2), op_a == 'N')
      k = merge(size(a, 2), size(a, 1), op_a == 'N')
      n = merge(size(b, 2), size(b, 1), op_b == 'N')
      allocate (c(m, n))
      call dgemm(op_a, op_b, m, n, k, 1.0_wp, a, size(a, 1), b, size(b, 1), 0.0_wp, c, m)
   end function product_of

   !> S_n = -theta W^T M W + i s W^T C W - z D^-1 z^T, D being factored.
   subroutine at_harmonic(self, internal, theta, s, matrix)
      class(dynamic_part), intent(in) :: self
      type(internal_block), intent(in) :: internal
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      !> (rank, rank)
      complex(wp), intent(out) :: matrix(:, :)
      complex(wp) :: z(size(self%mass_i, 1), self%rank), solved(size(self%mass_i, 1), self%rank)

      z = -theta*self%mass_i + cmplx(0.0_wp, s, wp)*self%damping_i
      solved = z
      if (size(z, 1) > 0) call internal%solve(self%rank, solved)
      matrix = -theta*self%mass + cmplx(0.0_wp, s, wp)*self%damping - &
               matmul(transpose(z), solved)
   end subroutine at_harmonic

end module fw_dynamic_part
