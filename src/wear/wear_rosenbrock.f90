!> A Rosenbrock step for vibration and wear depth: linearly implicit, of order 3, with one
!> derivative for four linear solutions.
!>
!> The system R(q, w) = 0, dw/dN = rate(q, w) is a differential-algebraic one of index 1. With
!> J the derivative of the coupled system for gamma times the step, each stage solves
!>
!>   J u_i = (-R(y_i), gamma (h rate(y_i) + sum c_ij u_j)),   y_i = y_n + sum a_ij u_j
!>
!> Source: RODAS3 of Sandu, Verwer, Blom, Spee, Carmichael and Potra, Atmospheric Environment 31
!> (1997): stiffly accurate and L-stable, as is the embedded method of order 2.
module fw_wear_rosenbrock
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: rosenbrock_step, rosenbrock_order

   integer, parameter :: rosenbrock_order = 3, n_stages = 4
   real(wp), parameter :: gamma = 0.5_wp
   real(wp), parameter :: a(n_stages, n_stages) = reshape([ &
      0.0_wp, 0.0_wp, 2.0_wp, 2.0_wp, &
      0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, &
      0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [n_stages, n_stages])
   real(wp), parameter :: c(n_stages, n_stages) = reshape([ &
      0.0_wp, 4.0_wp, 1.0_wp, 1.0_wp, &
      0.0_wp, 0.0_wp, -1.0_wp, -1.0_wp, &
      0.0_wp, 0.0_wp, 0.0_wp, -8.0_wp/3.0_wp, &
      0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [n_stages, n_stages])
   real(wp), parameter :: weight(n_stages) = [2.0_wp, 0.0_wp, 1.0_wp, 1.0_wp]

contains

   !> From x to x_after, `cycles` later.
   subroutine rosenbrock_step(system, linear, tolerance, x, cycles, x_after, error, n_solved, done)
      type(wear_system), intent(inout) :: system
      type(linear_step_type), intent(inout) :: linear
      !> Residual of the linear solutions, over the right-hand side of the first.
      real(wp), intent(in) :: tolerance
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: cycles
      real(wp), intent(out), contiguous :: x_after(:)
      !> Estimate of the error of the depths (n_pairs).
      real(wp), intent(out) :: error(:)
      integer, intent(out) :: n_solved
      logical, intent(out) :: done
      real(wp) :: u(size(x), n_stages), r(size(x))
      real(wp) :: scale
      integer :: i, n

      n = system%n_vibration()
      n_solved = 0
      scale = 0.0_wp
      u = 0.0_wp
      error = 0.0_wp
      call system%begin_step(x(n + 1:), gamma*cycles)
      call system%residual(x, r)
      call linear%prepare(system, done)
      do i = 1, n_stages
         if (.not. done) return
         ! The second stage stands where the first does.
         if (i /= 2) then
            x_after = x + matmul(u, a(i, :))
            call system%residual(x_after, r)
         end if
         r(n + 1:) = -gamma*system%force_of_depth(cycles*system%rate + &
                                                  matmul(u(n + 1:, :), c(i, :)))
         ! Errors of all stages weigh alike in the step, however small its later ones are. The
         ! second differs from the first in what the first has worn.
         call linear%solve_prepared(system, r, tolerance, u(:, i), done, scale, is_alike=i == 2)
         if (i == 1 .and. done) scale = norm2(linear%rhs)
         n_solved = n_solved + 1
      end do
      x_after = x + matmul(u, weight)
      ! Within its error a step may take a little wear back; a joint does not.
      x_after(n + 1:) = max(x_after(n + 1:), x(n + 1:))
      ! The embedded method leaves the last stage out.
      error = u(n + 1:, n_stages)
      done = done .and. all(ieee_is_finite(x_after))
   end subroutine rosenbrock_step

end module fw_wear_rosenbrock
