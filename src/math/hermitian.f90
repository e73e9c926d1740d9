!> Hermitian matrices: eigenpairs, products and congruences. Of real entries they are symmetric, so
!> that all holds for real structures too.
module fw_hermitian
   use fw_kinds, only: wp
   use fw_lapack, only: zgemm, zhegvd, zpotrf
   implicit none (type, external)
   private

   public :: solve_hermitian_eigen, congruence, product_of, cholesky, real_form, complex_part
   public :: is_regular

contains

   !> Eigenpairs of a x = value b x with b positive definite, ascending; x^H b x = 1. `done` is
   !> false where b is not positive definite, to working precision.
   subroutine solve_hermitian_eigen(a, b, values, vectors, done)
      !> Hermitian matrices (n, n).
      complex(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), intent(out), allocatable :: values(:)
      !> In columns (n, n).
      complex(wp), intent(out), allocatable :: vectors(:, :)
      logical, intent(out) :: done
      complex(wp), allocatable :: factor(:, :), work(:)
      real(wp), allocatable :: rwork(:)
      integer, allocatable :: iwork(:)
      complex(wp) :: room(1)
      real(wp) :: rroom(1)
      integer :: n, info, iroom(1)

      n = size(a, 1)
      allocate (values(n))
      vectors = a
      factor = b
      done = .true.
      if (n == 0) return
      ! The first call only asks for the workspace.
      call zhegvd(1, 'V', 'U', n, vectors, n, factor, n, values, room, -1, rroom, -1, iroom, -1, &
                  info)
      allocate (work(int(real(room(1), wp))), rwork(int(rroom(1))), iwork(iroom(1)))
      call zhegvd(1, 'V', 'U', n, vectors, n, factor, n, values, work, size(work), rwork, &
                  size(rwork), iwork, size(iwork), info)
      done = info == 0
   end subroutine solve_hermitian_eigen

   !> a^H b c for b (n, n).
   function congruence(a, b, c) result(value)
      complex(wp), intent(in) :: a(:, :), b(:, :), c(:, :)
      complex(wp), allocatable :: value(:, :), half(:, :)
      integer :: n

      n = size(b, 1)
      half = product_of(b, c)
      allocate (value(size(a, 2), size(c, 2)))
      if (size(value) == 0) return
      call zgemm('C', 'N', size(a, 2), size(c, 2), n, (1.0_wp, 0.0_wp), a, n, half, n, &
                 (0.0_wp, 0.0_wp), value, size(a, 2))
   end function congruence

   !> a b.
   function product_of(a, b) result(value)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      complex(wp), allocatable :: value(:, :)

      allocate (value(size(a, 1), size(b, 2)))
      if (size(value) == 0) return
      call zgemm('N', 'N', size(a, 1), size(b, 2), size(a, 2), (1.0_wp, 0.0_wp), a, size(a, 1), &
                 b, max(1, size(b, 1)), (0.0_wp, 0.0_wp), value, size(a, 1))
   end function product_of

   !> Upper factor of Cholesky in place of the matrix; false where it is not positive definite.
   logical function cholesky(matrix) result(done)
      complex(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: info

      info = 0
      if (size(matrix) > 0) call zpotrf('U', size(matrix, 1), matrix, size(matrix, 1), info)
      done = info == 0
   end function cholesky

   !> Whether a matrix is positive definite, and not by round-off: after its diagonal is scaled to
   !> one, what each row adds to those before it is above that.
   logical function is_regular(matrix)
      complex(wp), intent(in) :: matrix(:, :)
      !> A singular matrix leaves some 1e-8 there, the root of its round-off.
      real(wp), parameter :: round_off = 1.0e-6_wp
      complex(wp), allocatable :: scaled(:, :)
      real(wp) :: diagonal(size(matrix, 1))
      integer :: i, j

      diagonal = [(real(matrix(i, i), wp), i=1, size(matrix, 1))]
      is_regular = all(diagonal > 0.0_wp)
      if (.not. is_regular) return
      allocate (scaled(size(diagonal), size(diagonal)))
      do j = 1, size(diagonal)
         scaled(:, j) = matrix(:, j)/sqrt(diagonal*diagonal(j))
      end do
      is_regular = cholesky(scaled)
      if (.not. is_regular) return
      is_regular = all([(real(scaled(j, j), wp) > round_off, j=1, size(diagonal))])
   end function is_regular

   !> [[Re A, -Im A], [Im A, Re A]], which multiplies real parts above imaginary ones.
   pure function real_form(matrix) result(form)
      complex(wp), intent(in) :: matrix(:, :)
      real(wp) :: form(2*size(matrix, 1), 2*size(matrix, 2))
      integer :: m, n

      m = size(matrix, 1)
      n = size(matrix, 2)
      form(:m, :n) = real(matrix, wp)
      form(m + 1:, n + 1:) = real(matrix, wp)
      form(:m, n + 1:) = -aimag(matrix)
      form(m + 1:, :n) = aimag(matrix)
   end function real_form

   !> The inverse of real_form, round-off between the two halves shared.
   pure function complex_part(form) result(matrix)
      real(wp), intent(in) :: form(:, :)
      complex(wp) :: matrix(size(form, 1)/2, size(form, 2)/2)
      integer :: m, n

      m = size(matrix, 1)
      n = size(matrix, 2)
      matrix = 0.5_wp*cmplx(form(:m, :n) + form(m + 1:, n + 1:), &
                            form(m + 1:, :n) - form(:m, n + 1:), wp)
   end function complex_part

end module fw_hermitian
