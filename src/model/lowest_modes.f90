!> The lowest modes of K x = omega**2 M x, without the whole eigenvalue problem.
!>
!> A space of blocks V, A V, A (A V), ... with A = (K + shift M)^-1 M, orthonormal in M, holds the
!> lowest modes when it has a few times as many vectors as there are modes. What a block leaves
!> beyond the space is the residual of every mode in it. Modes of one frequency may still be missing
!> there: the signs of the pivots of K - omega**2 M tell how many there have to be.
module fw_lowest_modes
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm, dpotrf, dsytrf, dtrsm
   use fw_linalg, only: diagonalize
   implicit none (type, external)
   private

   public :: find_lowest_modes

   !> Vectors of a block: more than the six rigid motions of a body.
   integer, parameter :: width = 8
   !> Columns that are factored at once.
   integer, parameter :: block_width = 64
   !> Orders below which the whole problem takes no longer.
   integer, parameter :: small = 300
   !> Shifts over the square of the highest frequency, tried until K + shift M is definite: a
   !> structure that rotation softens has negative squares.
   real(wp), parameter :: shifts(*) = [0.01_wp, 1.0_wp, 100.0_wp]
   !> Residual of a mode over its eigenvalue.
   real(wp), parameter :: accuracy = 1.0e-12_wp
   !> A vector of which less than this is its own, by squares, is a combination of others.
   real(wp), parameter :: dependent = 1.0e-26_wp

   !> The space, in columns: V, M V and A V.
   type :: space_type
      integer :: n = 0
      real(wp), allocatable :: v(:, :), mv(:, :), av(:, :)
   end type space_type

contains

   !> All modes up to a frequency.
   subroutine find_lowest_modes(mass, stiffness, highest, squares, moved, done, error)
      !> Symmetric (n, n), the mass positive semidefinite.
      real(wp), contiguous, intent(in) :: mass(:, :), stiffness(:, :)
      !> [rad/s]
      real(wp), intent(in) :: highest
      !> Squares of their frequencies (m) [(rad/s)**2], in ascending order.
      real(wp), allocatable, intent(out) :: squares(:)
      !> M Phi (n, m), with Phi^T M Phi = 1.
      real(wp), allocatable, intent(out) :: moved(:, :)
      !> False where they are too many, or the matrices are not what they should be.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(space_type) :: space
      real(wp), allocatable :: factor(:, :), block(:, :), beyond(:, :), small_matrix(:, :)
      real(wp), allocatable :: values(:)
      real(wp) :: shift
      integer :: n, most, before, k
      logical :: is_whole

      n = size(mass, 1)
      done = .false.
      if (n < small) return
      call factor_shifted(mass, stiffness, highest**2, factor, shift, done)
      if (.not. done) return
      most = n/3
      allocate (space%v(n, most), space%mv(n, most), space%av(n, most))
      block = first_block(n)
      call solve(factor, block)
      allocate (beyond(n, width))
      call multiply('N', mass, block, beyond)
      is_whole = .false.
      do
         before = space%n
         call add_block(mass, factor, block, beyond, space, done)
         if (.not. done) return
         is_whole = space%n == before
         if (.not. is_whole) then
            block = space%av(:, before + 1:space%n)
            call leave_out(space, block)
            beyond = block
            call multiply('N', mass, block, beyond)
         end if
         allocate (small_matrix(space%n, space%n))
         call multiply('T', space%mv(:, :space%n), space%av(:, :space%n), small_matrix)
         do k = 2, space%n
            small_matrix(:k - 1, k) = 0.5_wp*(small_matrix(:k - 1, k) + small_matrix(k, :k - 1))
         end do
         call diagonalize(small_matrix, values, 'modal_damping', error)
         if (allocated(error)) return
         if (are_found(block, beyond, small_matrix, values, shift, highest**2, is_whole)) exit
         deallocate (small_matrix)
         done = space%n + width <= most
         if (.not. done) return
      end do
      call take_modes(space, small_matrix, values, shift, highest**2, squares, moved)
      done = size(squares) == n_below(mass, stiffness, highest**2)
   end subroutine find_lowest_modes

   !> Cholesky factor of K + shift M.
   subroutine factor_shifted(mass, stiffness, square, factor, shift, done)
      !> [mass], [force/length] (n, n), [(rad/s)**2].
      real(wp), intent(in) :: mass(:, :), stiffness(:, :), square
      !> Lower triangle (n, n).
      real(wp), allocatable, intent(out) :: factor(:, :)
      !> The first of the trials that makes it positive definite [(rad/s)**2].
      real(wp), intent(out) :: shift
      !> False where none does.
      logical, intent(out) :: done
      integer :: n, k, info

      n = size(mass, 1)
      do k = 1, size(shifts)
         shift = shifts(k)*square
         factor = stiffness + shift*mass
         call dpotrf('L', n, factor, n, info)
         done = info == 0
         if (done) return
      end do
   end subroutine factor_shifted

   !> Number of modes below a square of a frequency, by Sylvester's law; -1 where it is not known.
   function n_below(mass, stiffness, square) result(count_below)
      !> As above.
      real(wp), intent(in) :: mass(:, :), stiffness(:, :), square
      integer :: count_below
      real(wp), allocatable :: factors(:, :), work(:)
      integer, allocatable :: pivot(:)
      integer :: n, k, info

      n = size(mass, 1)
      factors = stiffness - square*mass
      allocate (pivot(n), work(n*block_width))
      call dsytrf('L', n, factors, n, pivot, work, size(work), info)
      count_below = -1
      if (info /= 0) return
      ! A block of order two counts by its two rows, one of them negative.
      count_below = count(pivot < 0)/2
      do k = 1, n
         if (pivot(k) > 0 .and. factors(k, k) < 0.0_wp) count_below = count_below + 1
      end do
   end function n_below

   !> Without any symmetry, and the same every time.
   pure function first_block(n) result(block)
      !> Order of the pencil.
      integer, intent(in) :: n
      real(wp), allocatable :: block(:, :)
      integer :: i, j

      allocate (block(n, width))
      do j = 1, width
         do i = 1, n
            block(i, j) = cos(real(i, wp)**1.1_wp*(1.0_wp + 0.37_wp*j))
         end do
      end do
   end function first_block

   !> Vectors that are the block's own join the space; none where the space holds all.
   subroutine add_block(mass, factor, block, moved, space, done)
      !> (n, n)
      real(wp), contiguous, intent(in) :: mass(:, :), factor(:, :)
      !> What vectors have beyond the space, and M times it; of no use on return (n, width).
      real(wp), contiguous, intent(inout) :: block(:, :), moved(:, :)
      !> Grows by the block.
      type(space_type), intent(inout) :: space
      !> False where a vector has a negative mass.
      logical, intent(out) :: done
      integer :: first, kept, times

      first = space%n
      kept = size(block, 2)
      ! Twice: the second time takes away the round-off of the first. The matrix goes past all
      ! vectors at once, as reading it is what takes the time.
      do times = 1, 2
         if (times == 2) then
            call leave_out(space, block(:, :kept))
            call multiply('N', mass, block(:, :kept), moved(:, :kept))
         end if
         call part_from_each_other(block, moved, kept, done)
         if (.not. done) return
      end do
      space%n = first + kept
      if (kept == 0) return
      space%v(:, first + 1:space%n) = block(:, :kept)
      space%mv(:, first + 1:space%n) = moved(:, :kept)
      space%av(:, first + 1:space%n) = space%mv(:, first + 1:space%n)
      call solve(factor, space%av(:, first + 1:space%n))
   end subroutine add_block

   !> Vectors of a block orthonormal in M; those that depend on others go.
   subroutine part_from_each_other(block, moved, kept, done)
      !> Vectors, and M times them (n, width).
      real(wp), intent(inout) :: block(:, :), moved(:, :)
      !> How many of them, the first ones, are there.
      integer, intent(inout) :: kept
      !> False where a vector has a negative mass.
      logical, intent(out) :: done
      real(wp) :: whole, left, share
      integer :: n_given, j, k, times

      n_given = kept
      kept = 0
      done = .true.
      do j = 1, n_given
         whole = dot_product(block(:, j), moved(:, j))
         do times = 1, 2
            do k = 1, kept
               share = dot_product(moved(:, k), block(:, j))
               block(:, j) = block(:, j) - share*block(:, k)
               moved(:, j) = moved(:, j) - share*moved(:, k)
            end do
         end do
         left = dot_product(block(:, j), moved(:, j))
         done = whole >= 0.0_wp .and. left >= -dependent*whole
         if (.not. done) return
         if (left <= dependent*max(whole, tiny(whole))) cycle
         kept = kept + 1
         block(:, kept) = block(:, j)/sqrt(left)
         moved(:, kept) = moved(:, j)/sqrt(left)
      end do
   end subroutine part_from_each_other

   !> What a block has beyond the space.
   subroutine leave_out(space, block)
      type(space_type), intent(in) :: space
      real(wp), intent(inout) :: block(:, :)
      real(wp) :: share(space%n, size(block, 2)), inside(size(block, 1), size(block, 2))

      if (space%n == 0) return
      call multiply('T', space%mv(:, :space%n), block, share)
      call multiply('N', space%v(:, :space%n), share, inside)
      block = block - inside
   end subroutine leave_out

   !> Whether all modes up to the bound, and one above it, are in the space.
   function are_found(beyond, moved, vectors, values, shift, square, is_whole) result(found)
      !> What the last block leaves, and M times it (n, width).
      real(wp), contiguous, intent(in) :: beyond(:, :), moved(:, :)
      !> Eigenvectors of the space and their values.
      real(wp), intent(in) :: vectors(:, :), values(:)
      !> Of the factorization, and the highest that is wanted [(rad/s)**2].
      real(wp), intent(in) :: shift, square
      !> Whether the space holds everything.
      logical, intent(in) :: is_whole
      logical :: found
      real(wp) :: gram(size(beyond, 2), size(beyond, 2)), last(size(beyond, 2))
      integer :: k, m

      found = is_whole
      if (found) return
      m = size(values)
      call multiply('T', beyond, moved, gram)
      ! Ascending values 1/(omega**2 + shift): the lowest modes are the last.
      do k = m, 1, -1
         last = vectors(m - size(beyond, 2) + 1:, k)
         if (dot_product(last, matmul(gram, last)) > (accuracy*values(k))**2) return
         found = values(k) > 0.0_wp
         if (found) found = 1.0_wp/values(k) - shift > square
         if (found) return
      end do
   end function are_found

   subroutine take_modes(space, vectors, values, shift, square, squares, moved)
      type(space_type), intent(in) :: space
      real(wp), intent(in) :: vectors(:, :), values(:), shift, square
      real(wp), allocatable, intent(out) :: squares(:), moved(:, :)
      integer :: k, m

      m = 0
      do k = size(values), 1, -1
         if (values(k)*(square + shift) < 1.0_wp) exit
         m = m + 1
      end do
      allocate (squares(m), moved(size(space%mv, 1), m))
      do k = 1, m
         squares(k) = 1.0_wp/values(size(values) - k + 1) - shift
      end do
      call multiply('N', space%mv(:, :space%n), vectors(:, size(values):size(values) - m + 1:-1), &
                    moved)
   end subroutine take_modes

   !> Solutions by the Cholesky factor, in place of the right-hand sides.
   subroutine solve(factor, block)
      !> (n, n)
      real(wp), contiguous, intent(in) :: factor(:, :)
      !> Solved in place (n, width).
      real(wp), intent(inout) :: block(:, :)
      real(wp), allocatable :: right(:, :)
      integer :: n

      n = size(factor, 1)
      right = block
      call dtrsm('L', 'L', 'N', 'N', n, size(right, 2), 1.0_wp, factor, n, right, n)
      call dtrsm('L', 'L', 'T', 'N', n, size(right, 2), 1.0_wp, factor, n, right, n)
      block = right
   end subroutine solve

   !> C = op(A) B.
   subroutine multiply(transposed, a, b, c)
      character, intent(in) :: transposed
      real(wp), contiguous, intent(in) :: a(:, :), b(:, :)
      real(wp), contiguous, intent(inout) :: c(:, :)

      if (size(c) == 0) return
      call dgemm(transposed, 'N', size(c, 1), size(c, 2), size(b, 1), 1.0_wp, a, size(a, 1), &
                 b, size(b, 1), 0.0_wp, c, size(c, 1))
   end subroutine multiply

end module fw_lowest_modes
