!> Modal damping as a matrix: C = 2 zeta M Phi diag(omega) Phi^T M over the modes of M and K.
!>
!> The mass matrix may be singular. Its massless directions carry no damping; they follow the
!> others statically, so they are condensed out of K, by a pseudo-inverse where K holds them no
!> better than M does (a node held by its contact alone). Rows are scaled to a unit diagonal
!> of M first, so that mixed units do not decide what counts as massless.
module fw_damping
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm, dpocon, dpotrf, dsygst, dsyrk, dtrmm
   use fw_linalg, only: diagonalize
   use fw_lowest_modes, only: find_lowest_modes
   implicit none (type, external)
   private

   public :: add_modal_damping
   ! For other modes than those of M and K alone, and for derivatives by what they depend on.
   public :: multiply, rank_tolerance, difference_step, difference_place, difference_weight

   !> Eigenvalues below this share of the largest count as zero: round-off of an order 1000
   !> matrix stays well below, a physical mass or stiffness ratio well above.
   real(wp), parameter :: rank_tolerance = 1.0e-12_wp
   !> Difference of the damping over stiffness or mass: the step, as a share of these, and the
   !> places in steps with their weights. Of fourth order: its error is the fourth power of the
   !> step, and what it makes of round-off is as small.
   real(wp), parameter :: difference_step = 1.0e-3_wp
   integer, parameter :: difference_place(4) = [-2, -1, 1, 2]
   real(wp), parameter :: difference_weight(4) = [1.0_wp, -8.0_wp, 8.0_wp, -1.0_wp]/12.0_wp
   !> Squares of the lowest frequencies below this share of the bound count as zero: the shift by
   !> which they are found leaves round-off of itself.
   real(wp), parameter :: zero_square = 1.0e-10_wp
   !> Reciprocal condition of the scaled M above which it has no massless direction; its factor
   !> keeps more digits than its eigenvectors do.
   real(wp), parameter :: least_condition = 1.0e-11_wp

contains

   !> Add the damping of all modes, or of the lowest ones, to a damping matrix.
   subroutine add_modal_damping(mass, stiffness, ratio, damping, error, up_to)
      !> Symmetric, positive semidefinite (n, n).
      real(wp), intent(in) :: mass(:, :)
      !> Symmetric (n, n); modes of negative or zero stiffness are not damped.
      real(wp), intent(in) :: stiffness(:, :)
      !> Fraction of critical damping of every mode.
      real(wp), intent(in) :: ratio
      real(wp), intent(inout) :: damping(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> Circular frequency above which no mode is damped [rad/s]; 0 and nothing: all are.
      real(wp), intent(in), optional :: up_to
      real(wp), allocatable :: scale(:), values(:), vectors(:, :), condensed(:, :), root(:, :)
      real(wp), allocatable :: half(:, :)
      real(wp) :: highest
      integer :: n_free
      logical :: done

      scale = unit_scale(mass, stiffness)
      highest = huge(1.0_wp)
      if (present(up_to)) then
         if (up_to > 0.0_wp) then
            highest = up_to**2
            call by_lowest_modes(scaled(mass, scale), scaled(stiffness, scale), scale, up_to, &
                                 ratio, damping, done, error)
            if (done .or. allocated(error)) return
         end if
      end if
      call by_factor(scaled(mass, scale), scaled(stiffness, scale), highest, root, done, error)
      if (allocated(error)) return
      if (done) then
         call weigh_by_mass(root, 1.0_wp/scale)
         damping = damping + 2.0_wp*ratio*root
         return
      end if
      vectors = scaled(mass, scale)
      call diagonalize(vectors, values, 'modal_damping', error)
      if (allocated(error)) return
      ! Ascending eigenvalues: the massless directions come first.
      n_free = count(values <= rank_tolerance*max(values(size(values)), 0.0_wp))
      if (n_free == size(values)) return
      call condense(scaled(stiffness, scale), vectors, n_free, condensed, error)
      if (allocated(error)) return
      ! With A = M**(-1/2) K M**(-1/2) the sum over the modes is 2 zeta M**(1/2) sqrt(A) M**(1/2),
      ! without any mode by itself. In the eigenvectors of M its powers are diagonal.
      call weigh_by_mass(condensed, 1.0_wp/sqrt(values(n_free + 1:)))
      call take_root(condensed, highest, root, error)
      if (allocated(error)) return
      call weigh_by_mass(root, sqrt(values(n_free + 1:)))
      ! Back from these vectors to the scaled dofs, and from there to the dofs.
      vectors = vectors(:, n_free + 1:)
      call multiply('N', root, 'T', vectors, half)
      call multiply('N', vectors, 'N', half, root)
      call weigh_by_mass(root, 1.0_wp/scale)
      damping = damping + 2.0_wp*ratio*root
   end subroutine add_modal_damping

   !> The modes up to a frequency by themselves, where they are few.
   subroutine by_lowest_modes(mass, stiffness, scale, up_to, ratio, damping, done, error)
      !> Scaled to a unit diagonal of M, by these factors.
      real(wp), intent(in) :: mass(:, :), stiffness(:, :), scale(:)
      real(wp), intent(in) :: up_to, ratio
      real(wp), intent(inout) :: damping(:, :)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: squares(:), moved(:, :), product(:, :)
      real(wp) :: least
      integer :: n, i, j

      call find_lowest_modes(mass, stiffness, up_to, squares, moved, done, error)
      if (allocated(error) .or. .not. done) return
      if (size(squares) == 0) return
      least = zero_square*up_to**2
      do j = 1, size(squares)
         moved(:, j) = moved(:, j)/scale*merge(sqrt(sqrt(max(squares(j), 0.0_wp))), 0.0_wp, &
                                               squares(j) > least)
      end do
      n = size(moved, 1)
      allocate (product(n, n))
      call dsyrk('L', 'N', n, size(squares), 2.0_wp*ratio, moved, n, 0.0_wp, product, n)
      do j = 1, n
         damping(j:, j) = damping(j:, j) + product(j:, j)
         do i = j + 1, n
            damping(j, i) = damping(j, i) + product(i, j)
         end do
      end do
   end subroutine by_lowest_modes

   !> M Phi diag(omega) Phi^T M where M is far from singular: with M = L L^T the modes are
   !> L^-T Y, Y the eigenvectors of L^-1 K L^-T. One eigenvalue problem instead of two.
   subroutine by_factor(mass, stiffness, highest, root, done, error)
      !> Scaled to a unit diagonal of M.
      real(wp), intent(in) :: mass(:, :), stiffness(:, :)
      !> Square of a frequency above which modes are left out.
      real(wp), intent(in) :: highest
      real(wp), allocatable, intent(out) :: root(:, :)
      !> False where M is not far from singular; there is no root then.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: factor(:, :), vectors(:, :), values(:), work(:)
      integer, allocatable :: iwork(:)
      real(wp) :: rcond, least
      integer :: n, j, info

      n = size(mass, 1)
      done = .false.
      if (n == 0) return
      factor = mass
      call dpotrf('L', n, factor, n, info)
      if (info /= 0) return
      allocate (work(3*n), iwork(n))
      call dpocon('L', n, factor, n, maxval(sum(abs(mass), dim=1)), rcond, work, iwork, info)
      if (info /= 0 .or. .not. rcond > least_condition) return
      vectors = stiffness
      call dsygst(1, 'L', n, vectors, n, factor, n, info)
      if (info /= 0) return
      do j = 2, n
         vectors(:j - 1, j) = vectors(j, :j - 1)
      end do
      call diagonalize(vectors, values, 'modal_damping', error)
      if (allocated(error)) return
      call dtrmm('L', 'L', 'N', 'N', n, n, 1.0_wp, factor, n, vectors, n)
      ! With omega = sqrt(values) the sum is W W^T, W = L Y diag(values**(1/4)).
      least = rank_tolerance*maxval(abs(values))
      do j = 1, n
         vectors(:, j) = vectors(:, j)*merge(sqrt(sqrt(max(values(j), 0.0_wp))), 0.0_wp, &
                                             values(j) > least .and. values(j) <= highest)
      end do
      allocate (root(n, n))
      call dsyrk('L', 'N', n, n, 1.0_wp, vectors, n, 0.0_wp, root, n)
      do j = 2, n
         root(:j - 1, j) = root(j, :j - 1)
      end do
      done = .true.
   end subroutine by_factor

   !> Factors that bring the diagonal of M to one, and that of K where there is no mass.
   pure function unit_scale(mass, stiffness) result(scale)
      real(wp), intent(in) :: mass(:, :), stiffness(:, :)
      real(wp) :: scale(size(mass, 1))
      ! Far below any physical ratio of masses in one model, whatever the units.
      real(wp), parameter :: no_mass = 1.0e-20_wp
      real(wp) :: largest
      integer :: i

      largest = 0.0_wp
      do i = 1, size(scale)
         largest = max(largest, mass(i, i))
      end do
      do i = 1, size(scale)
         scale(i) = 1.0_wp
         if (mass(i, i) > no_mass*largest) then
            scale(i) = 1.0_wp/sqrt(mass(i, i))
         else if (abs(stiffness(i, i)) > 0.0_wp) then
            scale(i) = 1.0_wp/sqrt(abs(stiffness(i, i)))
         end if
      end do
   end function unit_scale

   pure function scaled(matrix, scale) result(product)
      real(wp), intent(in) :: matrix(:, :), scale(:)
      real(wp), allocatable :: product(:, :)

      product = matrix
      call weigh_by_mass(product, scale)
   end function scaled

   !> diag(weight) A diag(weight), in place.
   pure subroutine weigh_by_mass(matrix, weight)
      real(wp), intent(inout) :: matrix(:, :)
      real(wp), intent(in) :: weight(:)
      integer :: i, j

      do j = 1, size(weight)
         do i = 1, size(weight)
            matrix(i, j) = matrix(i, j)*weight(i)*weight(j)
         end do
      end do
   end subroutine weigh_by_mass

   !> Stiffness of the massive directions with the first `n_free`, massless, ones following.
   subroutine condense(stiffness, vectors, n_free, condensed, error)
      real(wp), contiguous, intent(in) :: stiffness(:, :), vectors(:, :)
      integer, intent(in) :: n_free
      real(wp), allocatable, intent(out) :: condensed(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: half(:, :), rotated(:, :), free(:, :)
      real(wp), allocatable :: coupling(:, :), followed(:, :), values(:)
      integer :: j

      call multiply('N', stiffness, 'N', vectors, half)
      call multiply('T', vectors, 'N', half, rotated)
      condensed = rotated(n_free + 1:, n_free + 1:)
      if (n_free == 0) return
      ! K_mm - K_mf K_ff^-1 K_fm of massive (m) and free (f) directions, by the eigenvectors of
      ! K_ff.
      free = rotated(:n_free, :n_free)
      call diagonalize(free, values, 'modal_damping', error)
      if (allocated(error)) return
      followed = rotated(:n_free, n_free + 1:)
      call multiply('T', free, 'N', followed, coupling)
      followed = coupling
      do j = 1, n_free
         if (abs(values(j)) > rank_tolerance*maxval(abs(values))) then
            followed(j, :) = coupling(j, :)/values(j)
         else
            ! Held by nothing: it stays where it is.
            followed(j, :) = 0.0_wp
         end if
      end do
      call multiply('T', coupling, 'N', followed, half)
      condensed = condensed - half
   end subroutine condense

   !> Symmetric square root, with zero for eigenvalues that are not positive.
   subroutine take_root(matrix, highest, root, error)
      real(wp), intent(in) :: matrix(:, :)
      !> Eigenvalues above it are left out.
      real(wp), intent(in) :: highest
      real(wp), allocatable, intent(out) :: root(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :), scaled_vectors(:, :), values(:)
      real(wp) :: least
      integer :: j

      vectors = matrix
      call diagonalize(vectors, values, 'modal_damping', error)
      if (allocated(error)) return
      least = rank_tolerance*maxval(abs(values))
      scaled_vectors = vectors
      do j = 1, size(values)
         scaled_vectors(:, j) = vectors(:, j)* &
                                merge(sqrt(max(values(j), 0.0_wp)), 0.0_wp, &
                                      values(j) > least .and. values(j) <= highest)
      end do
      call multiply('N', scaled_vectors, 'T', vectors, root)
   end subroutine take_root

   !> c = op(a) op(b), op: 'N' as it is, 'T' transposed.
   subroutine multiply(op_a, a, op_b, b, c)
      character, intent(in) :: op_a, op_b
      real(wp), contiguous, intent(in) :: a(:, :), b(:, :)
      real(wp), allocatable, intent(out) :: c(:, :)
      integer :: m, n, k

      m = size(a, merge(1, 2, op_a == 'N'))
      k = size(a, merge(2, 1, op_a == 'N'))
      n = size(b, merge(2, 1, op_b == 'N'))
      allocate (c(m, n))
      call dgemm(op_a, op_b, m, n, k, 1.0_wp, a, size(a, 1), b, size(b, 1), 0.0_wp, c, m)
   end subroutine multiply

end module fw_damping
