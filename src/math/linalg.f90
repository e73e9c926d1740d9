!> Dense linear algebra above LAPACK: factors that are kept and used many times, and symmetric
!> eigenproblems.
module fw_linalg
   use fw_error, only: error_type, fatal_error, status_failure
   use fw_floating_point, only: floating_point_scope
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgetrf, dgetrs, zgetrf, zgetrs, ztrsv, dpotrf, dsyevd, dsyevr, dsygst, &
      dsygvd, dtrsm
   use fw_lu_in_parts, only: factor_in_parts, whole_up_to
   use fw_small_lu, only: factor_small, small_up_to, solve_small
   implicit none (type, external)
   private

   public :: lu_type, complex_lu_type, solve_symmetric_eigen, diagonalize, &
             solve_symmetric_above, is_positive_definite, has_pivots

   !> LU factors of a real matrix. The storage only grows, so that refactoring does not allocate.
   type :: lu_type
      !> Order of the matrix in use, at most the order of the storage.
      integer :: n = 0
      !> The matrix, then its factors: L below the diagonal (unit diagonal), U on and above it.
      real(wp), allocatable :: matrix(:, :)
      !> Row that was swapped with row i at step i.
      integer, allocatable :: pivot(:)
   contains
      procedure :: reserve => reserve_real
      procedure :: factor => factor_real
      procedure :: solve => solve_real
      procedure :: solve_transposed
      procedure :: determinant_sign
   end type lu_type

   !> LU factors of a complex matrix; as lu_type.
   type :: complex_lu_type
      !> Components as those of lu_type.
      integer :: n = 0
      complex(wp), allocatable :: matrix(:, :)
      integer, allocatable :: pivot(:)
   contains
      procedure :: reserve => reserve_complex
      procedure :: factor => factor_complex
      procedure :: solve => solve_complex
   end type complex_lu_type

contains

   !> Make room for order n; the caller then fills matrix(1:n, 1:n).
   pure subroutine reserve_real(self, n)
      class(lu_type), intent(inout) :: self
      integer, intent(in) :: n

      self%n = n
      if (allocated(self%matrix)) then
         ! Larger storage serves as well: the leading dimension goes to LAPACK with every call.
         if (size(self%matrix, 1) >= n) return
         deallocate (self%matrix, self%pivot)
      end if
      allocate (self%matrix(n, n), self%pivot(n))
   end subroutine reserve_real

   !> Factor the matrix in place; singular is true where a pivot is exactly zero, and where an
   !> interrupt ended the work.
   subroutine factor_real(self, singular, interrupt)
      class(lu_type), intent(inout) :: self
      logical, intent(out) :: singular
      class(interrupt_type), pointer, intent(in), optional :: interrupt
      integer :: info

      if (self%n <= small_up_to) then
         call factor_small(self%n, size(self%matrix, 1), self%matrix, self%pivot, singular)
         return
      end if
      if (self%n > whole_up_to .and. present(interrupt)) then
         call factor_in_parts(self%n, self%matrix, size(self%matrix, 1), self%pivot, singular, &
                              interrupt)
         return
      end if
      call dgetrf(self%n, self%n, self%matrix, size(self%matrix, 1), self%pivot, info)
      singular = info /= 0
   end subroutine factor_real

   !> Solve in place for one right-hand side (n).
   subroutine solve_real(self, b)
      class(lu_type), intent(in) :: self
      real(wp), intent(inout), contiguous :: b(:)
      integer :: info

      if (self%n <= small_up_to) then
         call solve_small(self%n, size(self%matrix, 1), self%matrix, self%pivot, b)
      else
         call dgetrs('N', self%n, 1, self%matrix, size(self%matrix, 1), self%pivot, b, size(b), &
                     info)
      end if
   end subroutine solve_real

   !> Solve in place with the transposed matrix (n).
   subroutine solve_transposed(self, b)
      class(lu_type), intent(in) :: self
      real(wp), intent(inout), contiguous :: b(:)
      integer :: info

      call dgetrs('T', self%n, 1, self%matrix, size(self%matrix, 1), self%pivot, b, size(b), info)
   end subroutine solve_transposed

   !> Sign of the determinant of the factored matrix: -1, 1, or 0 where it is singular.
   pure integer function determinant_sign(self)
      class(lu_type), intent(in) :: self
      integer :: i

      determinant_sign = 1
      do i = 1, self%n
         ! Counted by signs only: the product of the pivots would leave the range of the numbers for
         ! the orders that occur (hundreds of unknowns in physical units).
         if (abs(self%matrix(i, i)) <= 0.0_wp) determinant_sign = 0
         ! A swap of two rows turns the sign once, as a negative pivot does.
         if ((self%matrix(i, i) < 0.0_wp) .neqv. (self%pivot(i) /= i)) then
            determinant_sign = -determinant_sign
         end if
      end do
   end function determinant_sign

   !> Make room for order n; the caller then fills matrix(1:n, 1:n).
   pure subroutine reserve_complex(self, n)
      class(complex_lu_type), intent(inout) :: self
      integer, intent(in) :: n

      self%n = n
      if (allocated(self%matrix)) then
         if (size(self%matrix, 1) >= n) return
         deallocate (self%matrix, self%pivot)
      end if
      allocate (self%matrix(n, n), self%pivot(n))
   end subroutine reserve_complex

   !> Factor the matrix in place; singular is true where a pivot is exactly zero.
   subroutine factor_complex(self, singular)
      class(complex_lu_type), intent(inout) :: self
      logical, intent(out) :: singular
      integer :: info

      if (self%n == 1) then
         ! The guess of one dof: the way into a library takes longer than its harmonics.
         self%pivot(1) = 1
         singular = abs(self%matrix(1, 1)) <= 0.0_wp
         return
      end if
      call zgetrf(self%n, self%n, self%matrix, size(self%matrix, 1), self%pivot, info)
      singular = info /= 0
   end subroutine factor_complex

   !> Solve in place for n_right right-hand sides (n, n_right).
   subroutine solve_complex(self, n_right, b)
      class(complex_lu_type), intent(in) :: self
      integer, intent(in) :: n_right
      complex(wp), intent(inout), contiguous :: b(:, :)
      integer :: info

      if (n_right == 1) then
         call solve_one(self, b)
      else
         call zgetrs('N', self%n, n_right, self%matrix, size(self%matrix, 1), self%pivot, &
                     b, size(b, 1), info)
      end if
   end subroutine solve_complex

   !> One right-hand side: the solver for many packs the factors first, which takes as long as the
   !> solution.
   subroutine solve_one(self, b)
      type(complex_lu_type), intent(in) :: self
      complex(wp), intent(inout) :: b(*)
      complex(wp) :: entry
      integer :: i

      if (self%n == 1) then
         b(1) = b(1)/self%matrix(1, 1)
         return
      end if
      do i = 1, self%n
         ! The swaps of the elimination in their order, then L with its unit diagonal, then U.
         entry = b(i)
         b(i) = b(self%pivot(i))
         b(self%pivot(i)) = entry
      end do
      call ztrsv('L', 'N', 'U', self%n, self%matrix, size(self%matrix, 1), b, 1)
      call ztrsv('U', 'N', 'N', self%n, self%matrix, size(self%matrix, 1), b, 1)
   end subroutine solve_one

   !> Eigenpairs of a x = value b x with b positive definite, ascending; x^T b x = 1.
   !> `done` is false where b is not positive definite (to working precision).
   !> The test of b is that of Cholesky's method, so a semidefinite b may pass by round-off: where
   !> this matters, ask is_positive_definite first.
   subroutine solve_symmetric_eigen(a, b, values, vectors, done)
      !> Symmetric matrices (n, n).
      real(wp), intent(in) :: a(:, :), b(:, :)
      !> Eigenvalues (n) and eigenvectors in columns (n, n).
      real(wp), intent(out), allocatable :: values(:), vectors(:, :)
      logical, intent(out) :: done
      real(wp), allocatable :: factor(:, :), work(:)
      integer, allocatable :: iwork(:)
      real(wp) :: room(1)
      integer :: n, info, iroom(1)

      n = size(a, 1)
      allocate (values(n))
      vectors = a
      factor = b
      done = .true.
      if (n == 0) return
      ! The first call only asks for the workspace.
      call dsygvd(1, 'V', 'U', n, vectors, n, factor, n, values, room, -1, iroom, -1, info)
      allocate (work(int(room(1))), iwork(iroom(1)))
      call dsygvd(1, 'V', 'U', n, vectors, n, factor, n, values, work, size(work), &
                  iwork, size(iwork), info)
      done = info == 0
   end subroutine solve_symmetric_eigen

   !> The same for the eigenvalues above a bound alone: what takes vectors of all, which is most of
   !> the work, is left out.
   subroutine solve_symmetric_above(a, b, least, values, vectors, done)
      !> Symmetric matrices (n, n), B positive definite.
      real(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), intent(in) :: least
      !> Eigenvalues (m) in ascending order, and vectors x with x^T B x = 1 in columns (n, m).
      real(wp), intent(out), allocatable :: values(:), vectors(:, :)
      logical, intent(out) :: done
      real(wp), allocatable :: factor(:, :), standard(:, :), found(:), shapes(:, :), work(:)
      integer, allocatable :: iwork(:), support(:)
      type(floating_point_scope) :: scope
      real(wp) :: highest, room(1)
      integer :: n, m, j, info, iroom(1)

      n = size(a, 1)
      factor = b
      standard = a
      m = 0
      call dpotrf('L', n, factor, n, info)
      if (info == 0) call dsygst(1, 'L', n, standard, n, factor, n, info)
      done = info == 0
      if (.not. done) return
      do j = 2, n
         standard(:j - 1, j) = standard(j, :j - 1)
      end do
      ! No eigenvalue is above any norm, but for round-off.
      highest = (1.0_wp + n*epsilon(1.0_wp))*maxval(sum(abs(standard), dim=1))
      allocate (found(n), shapes(n, n), support(2*max(1, n)))
      if (least < highest) then
         ! LAPACK tries there, by a division by zero, what the processor does with infinities.
         call scope%enter()
         call dsyevr('V', 'V', 'L', n, standard, n, least, highest, 0, 0, 0.0_wp, m, found, &
                     shapes, n, support, room, -1, iroom, -1, info)
         allocate (work(int(room(1))), iwork(iroom(1)))
         call dsyevr('V', 'V', 'L', n, standard, n, least, highest, 0, 0, 0.0_wp, m, found, &
                     shapes, n, support, work, size(work), iwork, size(iwork), info)
         call scope%leave()
         done = info == 0
         if (.not. done) return
      end if
      values = found(:m)
      vectors = shapes(:, :m)
      call dtrsm('L', 'L', 'T', 'N', n, m, 1.0_wp, factor, n, vectors, n)
   end subroutine solve_symmetric_above

   !> Eigenvalues of a symmetric matrix in ascending order; the matrix becomes its eigenvectors.
   subroutine diagonalize(matrix, values, purpose, error)
      !> Symmetric (n, n); its eigenvectors in columns on leaving.
      real(wp), contiguous, intent(inout) :: matrix(:, :)
      real(wp), allocatable, intent(out) :: values(:)
      ! The matrix has to be symmetric; its upper triangle alone is read.
      !> What the eigenvalues are for, for the message.
      character(*), intent(in) :: purpose
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: work(:)
      integer, allocatable :: iwork(:)
      integer :: n, info

      n = size(matrix, 1)
      ! Workspace as the manual of dsyevd asks for with vectors: no call is needed to ask.
      allocate (values(n), work(1 + 6*n + 2*n**2), iwork(3 + 5*n))
      ! LAPACK refuses an empty matrix, aloud: structures without mass have no modes.
      if (n == 0) return
      call dsyevd('V', 'U', n, matrix, n, values, work, size(work), iwork, size(iwork), info)
      if (info == 0) return
      call fatal_error(error, 'the eigenvalues for '//purpose//' could not be computed: check '// &
                       'the mass, stiffness and damping matrices', status_failure)
   end subroutine diagonalize

   !> Whether a symmetric matrix is positive definite, beyond the round-off of its eigenvalues,
   !> after its rows and columns are scaled to a unit diagonal.
   logical function is_positive_definite(a) result(positive)
      !> Symmetric matrix (n, n).
      real(wp), intent(in) :: a(:, :)
      ! Relative to the diagonal of the scaled matrix, which is 1: some 1e6 times the round-off of
      ! an eigenvalue, so that a rigid-body mode, 0 up to round-off of assembly and condensation, is
      ! never taken for a stiffness.
      real(wp), parameter :: round_off = 1.0e-10_wp
      real(wp), allocatable :: scaled(:, :), values(:)
      type(error_type), allocatable :: error
      integer :: i, j, n

      n = size(a, 1)
      ! A diagonal that is not positive refutes it at once, and would spoil the scaling.
      positive = all([(a(i, i) > 0.0_wp, i=1, n)])
      if (.not. positive .or. n == 0) return
      allocate (scaled(n, n))
      ! Scaling makes the verdict independent of units: displacements beside rotations or amplitudes
      ! of modes would hide a zero eigenvalue below the spread of their sizes.
      do j = 1, n
         do i = 1, n
            scaled(i, j) = a(i, j)/sqrt(a(i, i)*a(j, j))
         end do
      end do
      call diagonalize(scaled, values, 'a static check', error)
      positive = .not. allocated(error)
      if (positive) positive = values(1) > round_off
   end function is_positive_definite

   !> Whether Cholesky's pivots of a symmetric matrix are above round-off: one that is singular may
   !> pass by the sign of its last pivots. Cheaper than `is_positive_definite`, and content with
   !> less.
   logical function has_pivots(a)
      !> (n, n)
      real(wp), intent(in) :: a(:, :)
      !> Of the scaled matrix: some times the round-off of its sums.
      real(wp), parameter :: round_off = 1.0e-13_wp
      real(wp), allocatable :: scaled(:, :)
      integer :: i, info, j, n

      n = size(a, 1)
      has_pivots = all([(a(i, i) > 0.0_wp, i=1, n)])
      if (.not. has_pivots .or. n == 0) return
      allocate (scaled(n, n))
      do j = 1, n
         scaled(:, j) = a(:, j)/sqrt(a(j, j))
      end do
      do j = 1, n
         scaled(j, :) = scaled(j, :)/sqrt(a(j, j))
      end do
      call dpotrf('U', n, scaled, n, info)
      has_pivots = info == 0
      if (has_pivots) has_pivots = all([(scaled(i, i)**2 > round_off, i=1, n)])
   end function has_pivots

end module fw_linalg
