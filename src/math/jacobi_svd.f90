!> Singular values of small complex matrices by one-sided Jacobi rotations: values far below the
!> norm of the matrix come out as well as its columns have them, without squares of it.
module fw_jacobi_svd
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: singular_vectors

   !> Cosines of angles between columns below which they count as orthogonal.
   real(wp), parameter :: orthogonal = 1.0e-15_wp
   !> Sweeps over all pairs of columns; about ten do.
   integer, parameter :: most_sweeps = 60

contains

   !> A = U diag(values) V^H: the values, in no order, and V.
   pure subroutine singular_vectors(matrix, values, v)
      !> (n, n)
      complex(wp), intent(in) :: matrix(:, :)
      !> (n) and (n, n).
      real(wp), intent(out) :: values(:)
      complex(wp), intent(out) :: v(:, :)
      complex(wp) :: a(size(matrix, 1), size(matrix, 2))
      integer :: j, k, n, sweep
      logical :: turned

      n = size(matrix, 2)
      a = matrix
      v = (0.0_wp, 0.0_wp)
      do j = 1, n
         v(j, j) = (1.0_wp, 0.0_wp)
      end do
      do sweep = 1, most_sweeps
         turned = .false.
         do j = 1, n - 1
            do k = j + 1, n
               call turn(a, v, j, k, turned)
            end do
         end do
         if (.not. turned) exit
      end do
      values = norm2(abs(a), dim=1)
   end subroutine singular_vectors

   !> Make two columns orthogonal.
   pure subroutine turn(a, v, j, k, turned)
      complex(wp), intent(inout) :: a(:, :), v(:, :)
      integer, intent(in) :: j, k
      logical, intent(inout) :: turned
      complex(wp) :: product
      real(wp) :: squares(2), angle, cosine, sine, tangent

      squares = [sum(abs(a(:, j))**2), sum(abs(a(:, k))**2)]
      product = dot_product(a(:, j), a(:, k))
      if (abs(product) <= orthogonal*sqrt(squares(1))*sqrt(squares(2))) return
      turned = .true.
      angle = (squares(2) - squares(1))/(2.0_wp*abs(product))
      tangent = sign(1.0_wp, angle)/(abs(angle) + sqrt(1.0_wp + angle**2))
      cosine = 1.0_wp/sqrt(1.0_wp + tangent**2)
      sine = cosine*tangent
      call mix(product/abs(product), cosine, sine, a(:, j), a(:, k))
      call mix(product/abs(product), cosine, sine, v(:, j), v(:, k))
   end subroutine turn

   !> One rotation of two vectors, the second of which is brought into phase first.
   pure subroutine mix(phase, cosine, sine, x, y)
      complex(wp), intent(in) :: phase
      real(wp), intent(in) :: cosine, sine
      complex(wp), intent(inout) :: x(:), y(:)
      complex(wp) :: old(size(x))

      old = x
      y = conjg(phase)*y
      x = cosine*old - sine*y
      y = sine*old + cosine*y
   end subroutine mix

end module fw_jacobi_svd
