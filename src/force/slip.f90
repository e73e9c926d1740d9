!> Sliding under pressure over a period, which is what wears a pair, and its exact derivative:
!>
!>   S = sum_k (p_k + p_(k-1))/2 |x_k - x_(k-1)|
!>
!> with x the corrected position of the march (fw_correction) in units of force and p the pressure
!> force. A pair that sticks does not move x: S is exactly zero, not small. At velocity level there
!> is no x; its rate is what the projection takes away, y - lambda.
module fw_slip
   use fw_kinds, only: wp, pi
   implicit none (type, external)
   private

   public :: slip_work, slip_weights

contains

   !> S of every pair [force**2].
   !> The trapezoidal rule in the pressure, over the moves of x from instant to instant.
   pure subroutine slip_work(n_pairs, n_time, mu, y, remembers, x_end, work)
      integer, intent(in) :: n_pairs, n_time
      real(wp), intent(in) :: mu(n_pairs)
      !> Predicted forces.
      real(wp), intent(in) :: y(n_pairs, 3, n_time)
      !> False at velocity level, where each instant slips at the rate y - lambda from x = 0.
      logical, intent(in) :: remembers
      !> Corrected position at the end of a periodic march.
      real(wp), intent(in) :: x_end(n_pairs, 2)
      real(wp), intent(inout) :: work(n_pairs)
      integer :: i, k
      real(wp) :: p, before, path, x(2), here(3)

      do i = 1, n_pairs
         work(i) = 0.0_wp
         x = x_end(i, :)
         ! The pressure of the last instant: the period closes on itself.
         before = max(-y(i, 3, n_time), 0.0_wp)
         do k = 1, n_time
            ! Three numbers that lie apart: without this the call would allocate room for them.
            here = y(i, :, k)
            call advance(mu(i), here, x, p, path)
            if (remembers) then
               work(i) = work(i) + 0.5_wp*(p + before)*path
            else
               ! The rate is per radian, so that the spacing of the instants is the measure.
               work(i) = work(i) + 2.0_wp*pi/real(n_time, wp)*p*path
               x = 0.0_wp
            end if
            before = p
         end do
      end do
   end subroutine slip_work

   !> Move x through one instant as the march does.
   pure subroutine advance(mu, y, x, p, path, direction)
      real(wp), intent(in) :: mu, y(3)
      real(wp), intent(inout) :: x(2)
      !> Pressure force, and length of the move of x.
      real(wp), intent(out) :: p, path
      !> Unit vector of the move; zero where there is none.
      real(wp), intent(out), optional :: direction(2)
      real(wp) :: d(2), length, move(2)

      p = max(-y(3), 0.0_wp)
      d = y(1:2) - x
      length = sqrt(d(1)**2 + d(2)**2)
      path = 0.0_wp
      if (present(direction)) direction = 0.0_wp
      ! Stick. An open pair (p = 0) follows y.
      if (length <= mu*p) return
      move = d - (mu*p/length)*d
      path = length - mu*p
      if (present(direction)) direction = d/length
      x = x + move
   end subroutine advance

   !> dS of one pair by its corrected positions and pressures at the instants.
   pure subroutine slip_weights(n_time, y, mu, remembers, x_end, by_x, by_p)
      integer, intent(in) :: n_time
      !> Predicted forces.
      real(wp), intent(in) :: y(3, n_time), mu
      logical, intent(in) :: remembers
      real(wp), intent(in) :: x_end(2)
      !> By p = max(-y_n, 0): zero where the pair is open.
      real(wp), intent(out) :: by_x(2, n_time), by_p(n_time)

      if (remembers) then
         call weights_of_path(n_time, y, mu, x_end, by_x, by_p)
      else
         call weights_of_rate(n_time, y, mu, by_x, by_p)
      end if
   end subroutine slip_weights

   !> S is a function of the positions and pressures at the instants: its derivatives by both,
   !> summed by the two intervals that meet in an instant.
   pure subroutine weights_of_path(n_time, y, mu, x_end, by_x, by_p)
      integer, intent(in) :: n_time
      real(wp), intent(in) :: y(3, n_time), mu, x_end(2)
      real(wp), intent(out) :: by_x(2, n_time), by_p(n_time)
      real(wp) :: x(2), p, path, before, direction(2)
      integer :: k, last

      x = x_end
      by_x = 0.0_wp
      by_p = 0.0_wp
      last = n_time
      before = max(-y(3, n_time), 0.0_wp)
      do k = 1, n_time
         call advance(mu, y(:, k), x, p, path, direction)
         by_x(:, k) = by_x(:, k) + 0.5_wp*(p + before)*direction
         by_x(:, last) = by_x(:, last) - 0.5_wp*(p + before)*direction
         by_p(k) = by_p(k) + 0.5_wp*path
         by_p(last) = by_p(last) + 0.5_wp*path
         before = p
         last = k
      end do
      ! p = max(-y_n, 0): an open instant does not answer.
      where (y(3, :) >= 0.0_wp) by_p = 0.0_wp
   end subroutine weights_of_path

   !> As weights_of_path at velocity level, where instants do not know of each other.
   pure subroutine weights_of_rate(n_time, y, mu, by_x, by_p)
      integer, intent(in) :: n_time
      real(wp), intent(in) :: y(3, n_time), mu
      real(wp), intent(out) :: by_x(2, n_time), by_p(n_time)
      real(wp) :: x(2), p, path, direction(2), spacing
      integer :: k

      spacing = 2.0_wp*pi/real(n_time, wp)
      do k = 1, n_time
         x = 0.0_wp
         call advance(mu, y(:, k), x, p, path, direction)
         by_x(:, k) = spacing*p*direction
         by_p(k) = spacing*path
      end do
      where (y(3, :) >= 0.0_wp) by_p = 0.0_wp
   end subroutine weights_of_rate

end module fw_slip
