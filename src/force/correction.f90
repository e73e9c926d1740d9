!> The correction kernel that every contact law shares: from predicted forces y(t) to contact
!> forces lambda(t) in separation, stick or slip, marched through the instants of a period.
!>
!> With p = max(-y_n, 0) and d = y_t - x, x the corrected position in units of force:
!>
!>   open   p = 0            lambda = 0,                           x = y_t
!>   stick  |d| <= mu p      lambda_t = d,          lambda_n = -p, x unchanged
!>   slip   otherwise        lambda_t = mu p d/|d|, lambda_n = -p, x = y_t - lambda_t
!>
!> Source: Nacivet, Pierre, Thouverez, Jezequel (2003), A dynamic Lagrangian frequency-time method.
!> Arrays are (pair, component, instant) with components (t1, t2, n): pairs lie innermost, so that
!> one instant of many pairs is one vector operation.
module fw_correction
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: march_turn_1d, march_turn_2d, project_turn

   !> Pairs that are marched one by one: below, vectors of pairs are too short to pay.
   integer, parameter :: few_pairs = 3
   !> Pairs of a full block, which a caller marches together: with their number known, what belongs
   !> to them stays in registers.
   integer, parameter :: full_block = 8

contains

   !> One turn for pairs first..last with one tangential direction.
   pure subroutine march_turn_1d(n_pairs, n_time, first, last, mu, y, x, lambda, margin, pressure, &
                                 again)
      integer, intent(in) :: n_pairs, n_time, first, last
      real(wp), intent(in) :: mu(n_pairs), y(n_pairs, 3, n_time)
      !> Corrected position at the start, then at the end of the turn.
      real(wp), intent(inout) :: x(n_pairs, 2)
      real(wp), intent(inout) :: lambda(n_pairs, 3, n_time)
      !> Smallest mu p - |d| and smallest p so far: negative margin means that the pair slipped.
      real(wp), intent(inout) :: margin(n_pairs), pressure(n_pairs)
      !> lambda holds the turn that ended at x (default: no): what repeats it need not be marched.
      logical, intent(in), optional :: again
      integer :: i
      logical :: is_again

      if (last - first < few_pairs) then
         is_again = .false.
         if (present(again)) is_again = again
         do i = first, last
            call march_one(n_pairs, n_time, i, mu(i), y, is_again, x(i, 1), lambda, margin(i), &
                           pressure(i))
         end do
         return
      end if
      do i = first, last, full_block
         if (i + full_block - 1 <= last) then
            call march_block(full_block, n_pairs, n_time, mu(i), y(i, 1, 1), x(i, 1), &
                             lambda(i, 1, 1), margin(i), pressure(i))
         else
            call march_block(last - i + 1, n_pairs, n_time, mu(i), y(i, 1, 1), x(i, 1), &
                             lambda(i, 1, 1), margin(i), pressure(i))
         end if
      end do
   end subroutine march_turn_1d

   !> The same turn of n pairs side by side, at most a full block.
   pure subroutine march_block(n, n_pairs, n_time, mu, y, x, lambda, margin, pressure)
      integer, intent(in) :: n, n_pairs, n_time
      real(wp), intent(in) :: mu(n), y(n_pairs, 3, *)
      real(wp), intent(inout) :: x(n), lambda(n_pairs, 3, *), margin(n), pressure(n)
      real(wp), dimension(full_block) :: least, lowest, place, rough
      real(wp) :: p, d, limit, force
      integer :: i, k

      rough(:n) = mu
      place(:n) = x
      least(:n) = margin
      lowest(:n) = pressure
      do k = 1, n_time
         !$omp simd private(p, d, limit, force)
         do i = 1, n
            p = max(-y(i, 3, k), 0.0_wp)
            limit = rough(i)*p
            d = y(i, 1, k) - place(i)
            ! Onto a disc of one dimension: a clamp, in which stick and open are no cases of their
            ! own.
            force = max(-limit, min(limit, d))
            ! x stays to the last bit where the pair sticks, so that stick wears nothing.
            place(i) = merge(place(i), y(i, 1, k) - force, abs(d) <= limit)
            lambda(i, 1, k) = force
            lambda(i, 3, k) = -p
            least(i) = min(least(i), limit - abs(d))
            lowest(i) = min(lowest(i), p)
         end do
      end do
      x = place(:n)
      margin = least(:n)
      pressure = lowest(:n)
   end subroutine march_block

   !> The same turn of one pair. Stick and slip last for many instants, so that a processor foresees
   !> which of them comes: in slip it need not wait for the position before, as the clamp has to.
   !> Where a pair slips as it did in the turn before, the rest of the turn is the same too.
   pure subroutine march_one(n_pairs, n_time, i, mu, y, again, x, lambda, margin, pressure)
      integer, intent(in) :: n_pairs, n_time, i
      real(wp), intent(in) :: mu, y(n_pairs, 3, n_time)
      logical, intent(in) :: again
      real(wp), intent(inout) :: x, lambda(n_pairs, 3, n_time), margin, pressure
      integer :: k
      real(wp) :: p, d, limit, start

      start = x
      do k = 1, n_time
         p = max(-y(i, 3, k), 0.0_wp)
         limit = mu*p
         d = y(i, 1, k) - x
         margin = min(margin, limit - abs(d))
         pressure = min(pressure, p)
         if (abs(d) > limit) then
            d = sign(limit, d)
            x = y(i, 1, k) - d
            if (again .and. abs(lambda(i, 1, k) - d) <= 0.0_wp) then
               x = start
               return
            end if
         end if
         lambda(i, 1, k) = d
         lambda(i, 3, k) = -p
      end do
   end subroutine march_one

   !> One turn for pairs first..last with two tangential directions.
   pure subroutine march_turn_2d(n_pairs, n_time, first, last, mu, y, x, lambda, margin, pressure)
      integer, intent(in) :: n_pairs, n_time, first, last
      real(wp), intent(in) :: mu(n_pairs), y(n_pairs, 3, n_time)
      !> As march_turn_1d.
      real(wp), intent(inout) :: x(n_pairs, 2)
      real(wp), intent(inout) :: lambda(n_pairs, 3, n_time)
      real(wp), intent(inout) :: margin(n_pairs), pressure(n_pairs)
      integer :: i, k
      real(wp) :: p, d1, d2, length, limit, scale
      logical :: sticks

      do k = 1, n_time
         !$omp simd private(p, d1, d2, length, limit, scale, sticks)
         do i = first, last
            p = max(-y(i, 3, k), 0.0_wp)
            limit = mu(i)*p
            d1 = y(i, 1, k) - x(i, 1)
            d2 = y(i, 2, k) - x(i, 2)
            length = sqrt(d1**2 + d2**2)
            sticks = length <= limit
            ! lambda_t = scale d: 1 in stick, mu p/|d| in slip, 0 where the pair is open.
            scale = merge(1.0_wp, limit/max(length, tiny(1.0_wp)), sticks)
            lambda(i, 1, k) = scale*d1
            lambda(i, 2, k) = scale*d2
            lambda(i, 3, k) = -p
            x(i, 1) = merge(x(i, 1), y(i, 1, k) - scale*d1, sticks)
            x(i, 2) = merge(x(i, 2), y(i, 2, k) - scale*d2, sticks)
            margin(i) = min(margin(i), limit - length)
            pressure(i) = min(pressure(i), p)
         end do
      end do
   end subroutine march_turn_2d

   !> Pointwise projection onto the friction disc, without memory: the velocity-level law.
   pure subroutine project_turn(n_pairs, n_time, first, last, mu, y, lambda, margin, pressure)
      integer, intent(in) :: n_pairs, n_time, first, last
      real(wp), intent(in) :: mu(n_pairs), y(n_pairs, 3, n_time)
      !> As march_turn_1d.
      real(wp), intent(inout) :: lambda(n_pairs, 3, n_time)
      real(wp), intent(inout) :: margin(n_pairs), pressure(n_pairs)
      integer :: i, k
      real(wp) :: p, length, limit, scale

      do k = 1, n_time
         !$omp simd private(p, length, limit, scale)
         do i = first, last
            p = max(-y(i, 3, k), 0.0_wp)
            limit = mu(i)*p
            length = sqrt(y(i, 1, k)**2 + y(i, 2, k)**2)
            scale = merge(1.0_wp, limit/max(length, tiny(1.0_wp)), length <= limit)
            lambda(i, 1, k) = scale*y(i, 1, k)
            lambda(i, 2, k) = scale*y(i, 2, k)
            lambda(i, 3, k) = -p
            margin(i) = min(margin(i), limit - length)
            pressure(i) = min(pressure(i), p)
         end do
      end do
   end subroutine project_turn

end module fw_correction
