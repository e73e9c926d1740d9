!> Exact derivative of the marched correction of one pair with respect to the Fourier coefficients
!> of its predicted forces. The inputs are ordered (coefficient, component), component slowest.
!>
!> With E_k the base functions at instant k and d the derivative by all inputs:
!>
!>   open   d lambda_t = 0,                                               dx = dy
!>   stick  d lambda_t = dy - dx,                                         dx unchanged
!>   slip   d lambda_t = mu p/|d| (I - e e^T)(dy - dx) + mu e dp,         dx = dy - d lambda_t
!>
!> starting from dx = 0 at the stated memory, through all turns of the march; or, where the limit
!> of the march does not depend on its start, from the derivative dx of the limit itself,
!> dx = M dx + N, with M and N the derivatives of a turn by its start and by the inputs.
module fw_correction_derivative
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: march_derivative, limit_derivative

contains

   !> One turn at the limit x: rows as march_derivative. (I - M)^-1 is given.
   pure subroutine limit_derivative(n_time, n_coef, base, y, mu, touch, present, inverse, x, &
                                    rows, dx)
      integer, intent(in) :: n_time, n_coef
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      !> Distance from the friction cone within which the pair counts as slipping [force].
      real(wp), intent(in) :: mu, touch, inverse(2, 2)
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: x(2)
      real(wp), intent(inout) :: rows(n_coef, 3, 2, n_time)
      real(wp), intent(inout) :: dx(n_coef, 3, 2)
      real(wp) :: limit(2), first
      integer :: c, k

      limit = x
      dx = 0.0_wp
      call march_derivative(n_time, n_coef, 1, base, y, mu, touch, present, .true., x, rows, &
                            dx)
      do c = 1, 3
         do k = 1, n_coef
            first = dx(k, c, 1)
            dx(k, c, 1) = inverse(1, 1)*first + inverse(1, 2)*dx(k, c, 2)
            dx(k, c, 2) = inverse(2, 1)*first + inverse(2, 2)*dx(k, c, 2)
         end do
      end do
      x = limit
      call march_derivative(n_time, n_coef, 1, base, y, mu, touch, present, .true., x, rows, &
                            dx)
   end subroutine limit_derivative

   !> March one pair through n_turns turns; the rows of the last turn are returned.
   pure subroutine march_derivative(n_time, n_coef, n_turns, base, y, mu, touch, present, &
                                    remembers, x, &
                                    rows, dx)
      integer, intent(in) :: n_time, n_coef, n_turns
      !> Base functions (n_coef, n_time) and predicted forces (3, n_time).
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      !> As limit_derivative.
      real(wp), intent(in) :: mu, touch
      !> Which of t1, t2, n exist.
      logical, intent(in) :: present(3)
      !> Whether the position is carried from instant to instant (false: velocity-level law).
      logical, intent(in) :: remembers
      !> Corrected position at the start, then at the end of each turn.
      real(wp), intent(inout) :: x(2)
      !> d lambda_t / d inputs (n_coef, 3, tangential component, instant).
      real(wp), intent(inout) :: rows(n_coef, 3, 2, n_time)
      !> Derivative of x at the start, then at the end (n_coef, 3, 2).
      real(wp), intent(inout) :: dx(n_coef, 3, 2)
      integer :: turn, k
      real(wp) :: p, d(2), length

      do turn = 1, n_turns
         do k = 1, n_time
            p = max(-y(3, k), 0.0_wp)
            d = y(1:2, k) - x
            length = sqrt(d(1)**2 + d(2)**2)
            if (p > 0.0_wp .and. length <= mu*p - touch) then
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
