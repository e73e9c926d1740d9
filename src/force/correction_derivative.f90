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
!> dx = M dx + N, with M and N the derivatives of a turn by its start and by the inputs. As
!> lambda_t = y - x at every instant, the start adds -(d x_k/d x_0) dx to the rows of one march
!> from dx = 0; no second one is needed.
module fw_correction_derivative
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: march_derivative, limit_derivative, add_start

contains

   !> One turn at the limit x: rows as march_derivative, but without what the start of the turn
   !> adds, which is for `add_start`. (I - M)^-1 is given.
   pure subroutine limit_derivative(n_time, n_coef, base, y, mu, touch, present, inverse, x, &
                                    rows, dx)
      integer, intent(in) :: n_time, n_coef
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      !> Distance from the friction cone within which the pair counts as slipping [force].
      real(wp), intent(in) :: mu, touch, inverse(2, 2)
      logical, intent(in) :: present(3)
      real(wp), intent(in) :: x(2)
      real(wp), intent(inout) :: rows(n_coef, 3, 2, n_time)
      !> Derivative of the limit.
      real(wp), intent(out) :: dx(n_coef, 3, 2)
      real(wp) :: after(2), first
      integer :: c, k

      after = x
      dx = 0.0_wp
      call march_derivative(n_time, n_coef, 1, base, y, mu, touch, present, .true., after, rows, &
                            dx)
      ! (I - M)^-1 N, input by input.
      do c = 1, 3
         do k = 1, n_coef
            first = dx(k, c, 1)
            dx(k, c, 1) = inverse(1, 1)*first + inverse(1, 2)*dx(k, c, 2)
            dx(k, c, 2) = inverse(2, 1)*first + inverse(2, 2)*dx(k, c, 2)
         end do
      end do
   end subroutine limit_derivative

   !> Add to the rows of limit_derivative what the start of the turn adds.
   pure subroutine add_start(n_inputs, n_time, by_start, dx, rows)
      integer, intent(in) :: n_inputs, n_time
      !> Derivative of the position at the instants by the one at the start, and of that.
      real(wp), intent(in) :: by_start(2, 2, n_time), dx(n_inputs, 2)
      real(wp), intent(inout) :: rows(n_inputs, 2, n_time)
      integer :: c, k

      do k = 1, n_time
         do c = 1, 2
            rows(:, c, k) = rows(:, c, k) - by_start(c, 1, k)*dx(:, 1) - by_start(c, 2, k)*dx(:, 2)
         end do
      end do
   end subroutine add_start

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
      real(wp) :: p, d(2), length
      integer :: turn, k, at

      do turn = 1, n_turns
         do k = 1, n_time
            ! The rows of turns before the last serve nobody: one place is enough for them.
            at = merge(k, 1, turn == n_turns)
            p = max(-y(3, k), 0.0_wp)
            d = y(1:2, k) - x
            length = sqrt(d(1)**2 + d(2)**2)
            if (p > 0.0_wp .and. length <= mu*p - touch) then
               if (turn == n_turns) call stick_rows(n_coef, base(:, k), present, dx, rows(:, :, &
                  :, k))
            else if (p <= 0.0_wp) then
               call open_rows(n_coef, base(1, k), present, dx, rows(1, 1, 1, at))
               x = y(1:2, k)
            else
               call slip_rows(n_coef, base(1, k), present, mu, p, d/length, length, dx, &
                              rows(1, 1, 1, at))
               x = y(1:2, k) - mu*p*d/length
            end if
            if (remembers) cycle
            x = 0.0_wp
            dx = 0.0_wp
         end do
      end do
   end subroutine march_derivative

   !> Rows of an instant of stick: d lambda_t = dy - dx, and dx stays.
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

   !> Rows of an instant of slip, and dx = dy - rows in the same pass.
   pure subroutine slip_rows(n_coef, base, present, mu, p, e, length, dx, rows)
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(n_coef), mu, p, e(2), length
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: dx(3*n_coef, 2), rows(3*n_coef, 2)
      real(wp) :: turning(2), across
      integer :: k, n

      n = n_coef
      turning = 0.0_wp
      ! Turning of the slip direction: the part of dy - dx across e.
      if (present(1) .and. present(2)) turning = (mu*p/length)*[-e(2), e(1)]
      do k = 1, 3*n
         ! I - e e^T is n n^T in the plane, n = (-e_2, e_1).
         across = e(2)*dx(k, 1) - e(1)*dx(k, 2)
         rows(k, 1) = across*turning(1)
         rows(k, 2) = across*turning(2)
         dx(k, 1) = -rows(k, 1)
         dx(k, 2) = -rows(k, 2)
      end do
      if (present(1)) call add_input(dx(:n, :), rows(:n, :), -e(2)*turning, [1.0_wp, 0.0_wp])
      if (present(2)) then
         call add_input(dx(n + 1:2*n, :), rows(n + 1:2*n, :), e(1)*turning, [0.0_wp, 1.0_wp])
      end if
      if (present(3)) then
         ! dp = -dy_n where the pair bears.
         call add_input(dx(2*n + 1:, :), rows(2*n + 1:, :), -mu*e, [0.0_wp, 0.0_wp])
      end if

   contains

      !> Rows by one component of the prediction itself, where dy is `moves`.
      pure subroutine add_input(dx, rows, factor, moves)
         real(wp), intent(inout) :: dx(:, :), rows(:, :)
         real(wp), intent(in) :: factor(2), moves(2)
         integer :: c, i

         do c = 1, 2
            do i = 1, n_coef
               rows(i, c) = rows(i, c) + factor(c)*base(i)
               dx(i, c) = dx(i, c) + (moves(c) - factor(c))*base(i)
            end do
         end do
      end subroutine add_input

   end subroutine slip_rows

   !> Rows of an instant of separation: dx = dy.
   pure subroutine open_rows(n_coef, base, present, dx, rows)
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(n_coef)
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: dx(n_coef, 3, 2), rows(n_coef, 3, 2)
      integer :: c

      rows = 0.0_wp
      dx = 0.0_wp
      do c = 1, 2
         if (present(c)) dx(:, c, c) = base
      end do
   end subroutine open_rows

end module fw_correction_derivative
