!> Where a pair of a law of rates comes to rest, decided instant by instant.
!>
!> A rate says nothing of a mean position: every position that bears all instants of the period,
!>
!>   |y(t) + mean - x| <= mu p(t) for all t,      mean = stiffness times the mean of u_r,
!>
!> balances. Taken is the one that the pair is led to from its assembly, as a law with memory has
!> it: the limit x of the march driven by y + mean (fw_settling). In it the force is y + mean - x,
!> so that the balance holds where stiffness u_r = x.
!>
!> Source: Moreau (1977), Evolution problem associated with a moving convex set in a Hilbert space
!> (the sweeping process, of which the march is the catching-up scheme).
module fw_coming_to_rest
   use fw_kinds, only: wp
   use fw_sampled_turn, only: settle_samples
   use fw_settling, only: periodic_tolerance, shakedown_turns
   implicit none (type, external)
   private

   public :: come_to_rest, rest_type

   !> Distance from a disc, as a part of the largest predicted force, that round-off leaves of a
   !> pair that is held by it.
   real(wp), parameter :: held_by = 1.0e-10_wp
   !> Turns after which the limit of the march is looked for by Newton's method.
   integer, parameter :: plain_turns = 4

   type :: rest_type
      !> Whether the pair comes to rest, and whether it was moved on its way.
      logical :: found = .false., moved = .false.
      !> Turns that count in the derivative, and whether the march ends at a limit searched for.
      integer :: turns = 1
      logical :: settled = .false.
      !> Limit less the mean [force], so that lambda = y - z.
      real(wp) :: z(2) = 0.0_wp
   end type rest_type

contains

   !> Follow a pair from z to its rest.
   subroutine come_to_rest(n_pairs, n_time, pair, y, mu, scale, z, rest)
      integer, intent(in) :: n_pairs, n_time, pair
      !> Predicted forces, friction coefficient, size of the tangential forces of the pair.
      real(wp), intent(in) :: y(n_pairs, 3, n_time)
      real(wp), intent(in) :: mu, scale
      !> Start of the march less the mean [force].
      real(wp), intent(in) :: z(2)
      type(rest_type), intent(out) :: rest
      real(wp) :: before(2), margin
      integer :: turn
      logical :: repeats

      if (.not. can_rest(n_pairs, n_time, pair, y, mu)) return
      rest%z = z
      do turn = 1, plain_turns
         before = rest%z
         call march_once(n_pairs, n_time, pair, y, mu, rest%z, margin)
         rest%moved = rest%moved .or. margin < 0.0_wp
         repeats = maxval(abs(rest%z - before)) <= periodic_tolerance*scale
         rest%turns = turn
         if (repeats) exit
      end do
      if (.not. repeats) then
         call settle_samples(n_pairs, n_time, pair, y, mu, scale, periodic_tolerance, rest%z, &
                             rest%settled)
         call march_once(n_pairs, n_time, pair, y, mu, rest%z, margin)
         rest%turns = shakedown_turns
      end if
      rest%found = margin >= -held_by*scale .and. (repeats .or. rest%settled)
   end subroutine come_to_rest

   !> Whether the discs of all instants share a value in each of four directions: else they share no
   !> point, and nothing has to be marched.
   pure logical function can_rest(n_pairs, n_time, pair, y, mu)
      integer, intent(in) :: n_pairs, n_time, pair
      real(wp), intent(in) :: y(n_pairs, 3, n_time), mu
      real(wp), parameter :: half = sqrt(0.5_wp)
      real(wp) :: lower(4), upper(4), along(4), radius
      integer :: k

      can_rest = .false.
      lower = -huge(1.0_wp)
      upper = huge(1.0_wp)
      do k = 1, n_time
         radius = -mu*y(pair, 3, k)
         if (y(pair, 3, k) >= 0.0_wp) return
         along(1) = y(pair, 1, k)
         along(2) = y(pair, 2, k)
         along(3) = half*(y(pair, 1, k) + y(pair, 2, k))
         along(4) = half*(y(pair, 1, k) - y(pair, 2, k))
         lower = max(lower, along - radius)
         upper = min(upper, along + radius)
      end do
      can_rest = all(lower <= upper)
   end function can_rest

   !> One turn of the march, and the smallest mu p - |y - z| before its instants move z.
   pure subroutine march_once(n_pairs, n_time, pair, y, mu, z, margin)
      integer, intent(in) :: n_pairs, n_time, pair
      real(wp), intent(in) :: y(n_pairs, 3, n_time), mu
      real(wp), intent(inout) :: z(2)
      real(wp), intent(out) :: margin
      real(wp) :: d(2), length, limit
      integer :: k

      margin = huge(1.0_wp)
      do k = 1, n_time
         limit = -mu*y(pair, 3, k)
         d(1) = y(pair, 1, k) - z(1)
         d(2) = y(pair, 2, k) - z(2)
         length = sqrt(d(1)**2 + d(2)**2)
         margin = min(margin, limit - length)
         if (length <= limit) cycle
         z(1) = y(pair, 1, k) - limit*d(1)/length
         z(2) = y(pair, 2, k) - limit*d(2)/length
      end do
   end subroutine march_once

end module fw_coming_to_rest
