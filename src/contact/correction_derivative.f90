!> Exact derivative of the marched correction of one pair with respect to the Fourier coefficients
!> of its predicted forces. The inputs are ordered (coefficient, component), component slowest.
!>
!> With E_k the base functions at instant k and d the derivative by all inputs:
!>
!>   open   d lambda_t = 0,                                               dx = dy
!>   stick  d lambda_t = dy - dx,                                         dx unchanged
!>   slip   d lambda_t = mu p/|d| (I - e e^T)(dy - dx) + mu e dp,         dx = dy - d lambda_t
!>
!> starting from dx = 0 at the stated memory, through all turns of the march.
module fw_correction_derivative
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: march_derivative

contains

   !> March one pair through n_turns turns; the rows of the last turn are returned.
   pure subroutine march_derivative(n_time, n_coef, n_turns, base, y, mu, present, remembers, x, &
                                    rows, dx)
      integer, intent(in) :: n_time, n_coef, n_turns
      !> Base functions (n_coef, n_time) and predicted forces (3, n_time).
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      real(wp), intent(in) :: mu
      !> Which of t1, t2, n exist.
      logical, intent(in) :: present(3)
      !> Whether the position is carried from instant to instant (false: velocity-level law).
      logical, intent(in) :: remembers
      !> Corrected position at the start, then at the end of each turn.
      real(wp), intent(inout) :: x(2)
      !> d lambda_t / d inputs (n_coef, 3, tangential component, instant).
      real(wp), intent(inout) :: rows(n_coef, 3, 2, n_time)
      !> Workspace: derivative of x (n_coef, 3, 2).
      real(wp), intent(inout) :: dx(n_coef, 3, 2)
      integer :: turn, k
      real(wp) :: p, d(2), length

      dx = 0.0_wp
      do turn = 1, n_turns
         do k = 1, n_time
            p = max(-y(3, k), 0.0_wp)
            d = y(1:2, k) - x
            length = sqrt(d(1)**2 + d(2)**2)
            if (p > 0.0_wp .and. length <= mu*p) then
               if (turn == n_turns) call stick_rows(n_coef, base(:, k), present, dx, rows(:, :, &
                  :, k))
            else if (p <= 0.0_wp) then
               rows(:, :, :, k) = 0.0_wp
               call follow(n_coef, base(:, k), present, rows(:, :, :, k), dx)
               x = y(1:2, k)
            else
               call slip_rows(n_coef, base(:, k), present, mu, p, d/length, length, dx, &
                              rows(:, :, :, k))
               call follow(n_coef, base(:, k), present, rows(:, :, :, k), dx)
               x = y(1:2, k) - mu*p*d/length
            end if
            if (remembers) cycle
            x = 0.0_wp
            dx = 0.0_wp
         end do
      end do
   end subroutine march_derivative

   pure subroutine stick_rows(n_coef, base, present, dx, rows)
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(n_coef), dx(n_coef, 3, 2)
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: rows(n_coef, 3, 2)
      integer :: c

      rows = -dx
      do c = 1, 2
         if (present(c)) rows(:, c, c) = rows(:, c, c) + base
      end do
   end subroutine stick_rows

   pure subroutine slip_rows(n_coef, base, present, mu, p, e, length, dx, rows)
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(n_coef), dx(n_coef, 3, 2), mu, p, e(2), length
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: rows(n_coef, 3, 2)
      integer :: c

      rows = 0.0_wp
      if (present(1) .and. present(2)) then
         ! Turning of the slip direction: the part of dy - dx across e.
         rows(:, :, 1) = e(2)*(e(1)*dx(:, :, 2) - e(2)*dx(:, :, 1))
         rows(:, :, 2) = e(1)*(e(2)*dx(:, :, 1) - e(1)*dx(:, :, 2))
         rows(:, 1, 1) = rows(:, 1, 1) + e(2)**2*base
         rows(:, 2, 1) = rows(:, 2, 1) - e(1)*e(2)*base
         rows(:, 1, 2) = rows(:, 1, 2) - e(1)*e(2)*base
         rows(:, 2, 2) = rows(:, 2, 2) + e(1)**2*base
         rows = (mu*p/length)*rows
      end if
      if (.not. present(3)) return
      do c = 1, 2
         rows(:, 3, c) = rows(:, 3, c) - (mu*e(c))*base
      end do
   end subroutine slip_rows

   !> dx = dy - d lambda.
   pure subroutine follow(n_coef, base, present, rows, dx)
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(n_coef), rows(n_coef, 3, 2)
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: dx(n_coef, 3, 2)
      integer :: c

      dx = -rows
      do c = 1, 2
         if (present(c)) dx(:, c, c) = dx(:, c, c) + base
      end do
   end subroutine follow

end module fw_correction_derivative
