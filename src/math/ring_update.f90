!> What forces on rows of every sector of a ring become where the sectors differ:
!>
!>   f = X y,   X = D (I + Gamma D)^-1,
!>
!> Gamma being block circulant, the rows of all sectors by forces on them, and D one block a sector.
!> The waves have in common what a sector does to itself, L; few shapes hold what else there is,
!>
!>   Gamma = L + U g V^H,   X = F - F U (I + g T)^-1 g V^H F,
!>   F_j = D_j (I + L D_j)^-1,   T_j = V^H F_j U,
!>
!> with g block circulant of the order of the shapes. Rows are to be scaled so that the largest
!> entries of D are of the order of one: shapes are left out by their size in Gamma alone.
module fw_ring_update
   use fw_hermitian, only: solve_hermitian_eigen
   use fw_kinds, only: pi, wp
   use fw_lapack, only: zgemm, zgemv, zgetrf, zgetrs
   implicit none (type, external)
   private

   public :: ring_update

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

   !> The inverse of what a ring of equal sectors is with a deviation of each, by factors of sectors
   !> and a few shapes that join them.
   type :: ring_update
      integer :: n_rows = 0, n_sectors = 0, n_shapes = 0
      !> Transposed F_j (n_rows, n_rows, n_sectors), the shapes (n_rows, n_shapes), and V^H F_j
      !> (n_shapes, n_rows, n_sectors), F_j U (n_rows, n_shapes, n_sectors).
      complex(wp), allocatable, private :: own(:, :, :), u(:, :), v(:, :), left(:, :, :), &
                                           right(:, :, :)
      !> (I + g T)^-1 g, of the order n_shapes n_sectors.
      complex(wp), allocatable, private :: ring(:, :)
      !> Scratch.
      complex(wp), allocatable, private :: shape(:), answer(:), row(:)
   contains
      procedure :: build
      procedure :: apply
      procedure :: apply_transposed
   end type ring_update

contains

   !> Factors for one set of deviations; the shapes are those of what joins the sectors.
   subroutine build(self, gamma, block, left_out, most, done)
      class(ring_update), intent(inout) :: self
      !> Gamma of the waves k = 0 .. n_sectors - 1, and D of the sectors (n_rows, n_rows,
      !> n_sectors).
      complex(wp), intent(in), contiguous :: gamma(:, :, :), block(:, :, :)
      !> What may be left out of Gamma; the most that the order of I + g T may be.
      real(wp), intent(in) :: left_out
      integer, intent(in) :: most
      !> False where a matrix is singular.
      logical, intent(out) :: done
      complex(wp), allocatable :: local(:, :), rest(:, :, :)
      integer :: k, most_shapes

      self%n_rows = size(gamma, 1)
      self%n_sectors = size(gamma, 3)
      local = sum(gamma, dim=3)/self%n_sectors
      call find_own(self, local, block, done)
      if (.not. done) return
      rest = gamma
      do k = 1, self%n_sectors
         rest(:, :, k) = rest(:, :, k) - local
      end do
      most_shapes = min(self%n_rows, most/self%n_sectors)
      call find_shapes(self, rest, left_out, most_shapes, done)
      if (done) call find_ring(self, rest, done)
      if (allocated(self%row)) deallocate (self%row)
      allocate (self%row(self%n_rows))
   end subroutine build

   !> F of every sector.
   subroutine find_own(self, local, block, done)
      type(ring_update), intent(inout) :: self
      complex(wp), intent(in), contiguous :: local(:, :), block(:, :, :)
      logical, intent(out) :: done
      complex(wp), allocatable :: matrix(:, :)
      integer, allocatable :: pivot(:)
      integer :: a, info, j, r

      r = self%n_rows
      allocate (matrix(r, r), pivot(r))
      if (allocated(self%own)) deallocate (self%own)
      allocate (self%own(r, r, self%n_sectors))
      done = .true.
      do j = 1, self%n_sectors
         call zgemm('N', 'N', r, r, r, one, local, r, block(:, :, j), r, zero, matrix, r)
         do a = 1, r
            matrix(a, a) = matrix(a, a) + one
         end do
         call zgetrf(r, r, matrix, r, pivot, info)
         done = done .and. info == 0
         if (.not. done) return
         self%own(:, :, j) = transpose(block(:, :, j))
         call zgetrs('T', r, r, matrix, r, pivot, self%own(:, :, j), r, info)
      end do
   end subroutine find_own

   !> The shapes that the rest of Gamma moves, and those that move it: eigenvectors of what it is
   !> squared, over all waves.
   subroutine find_shapes(self, rest, left_out, most, done)
      type(ring_update), intent(inout) :: self
      complex(wp), intent(in), contiguous :: rest(:, :, :)
      real(wp), intent(in) :: left_out
      integer, intent(in) :: most
      logical, intent(out) :: done
      complex(wp), allocatable :: squared(:, :), first(:, :), second(:, :)
      real(wp), allocatable :: value_1(:), value_2(:)
      integer :: k, n, r

      r = self%n_rows
      n = self%n_sectors
      allocate (squared(r, r))
      call zgemm('N', 'C', r, r, r*n, one, rest, r, rest, r, zero, squared, r)
      call decompose(squared, value_1, first, done)
      if (.not. done) return
      squared = zero
      do k = 1, n
         call zgemm('C', 'N', r, r, r, one, rest(:, :, k), r, rest(:, :, k), r, one, squared, r)
      end do
      call decompose(squared, value_2, second, done)
      if (.not. done) return
      self%n_shapes = min(most, max(count(value_1 > left_out**2), count(value_2 > left_out**2)))
      ! Largest last.
      self%u = first(:, r - self%n_shapes + 1:)
      self%v = second(:, r - self%n_shapes + 1:)
   end subroutine find_shapes

   subroutine decompose(matrix, values, vectors, done)
      complex(wp), intent(in) :: matrix(:, :)
      real(wp), allocatable, intent(out) :: values(:)
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      logical, intent(out) :: done
      complex(wp), allocatable :: identity(:, :)
      integer :: a

      allocate (identity(size(matrix, 1), size(matrix, 1)), source=zero)
      do a = 1, size(matrix, 1)
         identity(a, a) = one
      end do
      call solve_hermitian_eigen(matrix, identity, values, vectors, done)
   end subroutine decompose

   !> What shapes of all sectors do to each other.
   subroutine find_ring(self, rest, done)
      type(ring_update), intent(inout) :: self
      complex(wp), intent(in), contiguous :: rest(:, :, :)
      logical, intent(out) :: done
      complex(wp), allocatable :: wave(:, :, :), between(:, :, :), small(:, :), matrix(:, :)
      integer, allocatable :: pivot(:)
      integer :: d, i, info, j, k, n, p, r

      n = self%n_sectors
      p = self%n_shapes
      r = self%n_rows
      if (allocated(self%left)) deallocate (self%left, self%right, self%ring, self%shape, &
                                            self%answer)
      allocate (self%left(p, r, n), self%right(r, p, n), self%ring(n*p, n*p))
      allocate (self%shape(n*p), self%answer(n*p))
      done = .true.
      if (p == 0) return
      allocate (wave(p, p, n), between(p, p, n), small(p, r), matrix(n*p, n*p), pivot(n*p))
      do k = 1, n
         call zgemm('C', 'N', p, r, r, one, self%u, r, rest(:, :, k), r, zero, small, p)
         call zgemm('N', 'N', p, p, r, one, small, p, self%v, r, zero, wave(:, :, k), p)
      end do
      between = zero
      do d = 0, n - 1
         do k = 0, n - 1
            between(:, :, d + 1) = between(:, :, d + 1) + wave(:, :, k + 1)/n* &
               exp(cmplx(0.0_wp, -2.0_wp*pi*modulo(d*k, n)/n, wp))
         end do
      end do
      do j = 1, n
         call zgemm('C', 'T', p, r, r, one, self%v, r, self%own(:, :, j), r, zero, &
                    self%left(:, :, j), p)
         call zgemm('T', 'N', r, p, r, one, self%own(:, :, j), r, self%u, r, zero, &
                    self%right(:, :, j), r)
         call zgemm('N', 'N', p, p, r, one, self%left(:, :, j), p, self%u, r, zero, &
                    wave(:, :, j), p)
      end do
      do j = 1, n
         do i = 1, n
            associate (block => between(:, :, modulo(i - j, n) + 1))
               self%ring((i - 1)*p + 1:i*p, (j - 1)*p + 1:j*p) = block
               matrix((i - 1)*p + 1:i*p, (j - 1)*p + 1:j*p) = matmul(block, wave(:, :, j))
            end associate
         end do
      end do
      do i = 1, n*p
         matrix(i, i) = matrix(i, i) + one
      end do
      call zgetrf(n*p, n*p, matrix, n*p, pivot, info)
      done = info == 0
      if (done) call zgetrs('N', n*p, n*p, matrix, n*p, pivot, self%ring, n*p, info)
   end subroutine find_ring

   !> X y, in place (n_rows, n_sectors).
   subroutine apply(self, rows)
      class(ring_update), intent(inout) :: self
      complex(wp), intent(inout) :: rows(self%n_rows, self%n_sectors)
      integer :: j, n, p, r

      n = self%n_sectors
      p = self%n_shapes
      r = self%n_rows
      if (p > 0) then
         do j = 1, n
            call zgemv('N', p, r, one, self%left(1, 1, j), p, rows(1, j), 1, zero, &
                       self%shape((j - 1)*p + 1), 1)
         end do
         call zgemv('N', n*p, n*p, one, self%ring, n*p, self%shape, 1, zero, self%answer, 1)
      end if
      do j = 1, n
         self%row = rows(:, j)
         if (p > 0) call zgemv('N', r, p, -one, self%u, r, self%answer((j - 1)*p + 1), 1, one, &
                               self%row, 1)
         call zgemv('T', r, r, one, self%own(1, 1, j), r, self%row, 1, zero, rows(1, j), 1)
      end do
   end subroutine apply

   !> X^T y, in place.
   subroutine apply_transposed(self, rows)
      class(ring_update), intent(inout) :: self
      complex(wp), intent(inout) :: rows(self%n_rows, self%n_sectors)
      integer :: a, j, n, p, r

      n = self%n_sectors
      p = self%n_shapes
      r = self%n_rows
      if (p > 0) then
         do j = 1, n
            call zgemv('T', r, p, one, self%right(1, 1, j), r, rows(1, j), 1, zero, &
                       self%answer((j - 1)*p + 1), 1)
         end do
         call zgemv('T', n*p, n*p, one, self%ring, n*p, self%answer, 1, zero, self%shape, 1)
      end if
      do j = 1, n
         self%row = rows(:, j)
         do a = 1, p
            self%row = self%row - conjg(self%v(:, a))*self%shape((j - 1)*p + a)
         end do
         call zgemv('N', r, r, one, self%own(1, 1, j), r, self%row, 1, zero, rows(1, j), 1)
      end do
   end subroutine apply_transposed

end module fw_ring_update
