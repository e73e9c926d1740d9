!> The map of a turn of the march of one pair under uniform sampling, for the search of its limit
!> (fw_settling).
module fw_sampled_turn
   use fw_kinds, only: wp
   use fw_settling, only: invert, period_map, settle
   implicit none (type, external)
   private

   public :: settle_samples, limit_is_unique

   type, extends(period_map) :: sampled_map
      !> The pair in y, and its friction coefficient.
      integer :: pair = 0
      real(wp) :: mu = 0.0_wp
      !> Predicted forces (pair, component, instant).
      real(wp), pointer :: y(:, :, :) => null()
      !> What the anchor goes on by from turn to turn.
      real(wp) :: drift(2) = 0.0_wp
   contains
      procedure :: turn
   end type sampled_map

contains

   !> From a position to the limit of the turns that follow.
   subroutine settle_samples(n_pairs, n_time, pair, y, mu, scale, tolerance, x, done, drift)
      integer, intent(in) :: n_pairs, n_time, pair
      !> Predicted forces, friction coefficient, size of the tangential forces of the pair.
      real(wp), intent(in), target :: y(n_pairs, 3, n_time)
      real(wp), intent(in) :: mu, scale
      !> On the distance from the limit, over the scale.
      real(wp), intent(in) :: tolerance
      !> Corrected position [force].
      real(wp), intent(inout) :: x(2)
      logical, intent(out) :: done
      !> What the anchor goes on by from turn to turn, in the frame of a side that slides
      !> (default: nothing).
      real(wp), intent(in), optional :: drift(2)
      type(sampled_map) :: map

      map%pair = pair
      map%mu = mu
      map%y => y
      if (present(drift)) map%drift = drift
      call settle(map, scale, tolerance, x, done)
   end subroutine settle_samples

   !> A turn of period_map, with the discs as they are (touch = 0).
   subroutine turn(self, x, after, m)
      class(sampled_map), intent(inout) :: self
      real(wp), intent(in) :: x(2)
      real(wp), intent(out) :: after(2), m(2, 2)

      call turn_map(size(self%y, 1), size(self%y, 3), self%pair, self%y, self%mu, 0.0_wp, x, &
                    after, m)
      after = after + self%drift
   end subroutine turn

   !> Whether the discs that hold the limit x determine it alone, without its start: every direction
   !> of x shrinks in a turn. `inverse` is (I - M)^-1 then. A pair that has shaken down into the
   !> corner between two discs touches them, and round-off must not decide whether they count.
   pure subroutine limit_is_unique(n_pairs, n_time, pair, y, mu, touch, x, unique, inverse, &
                                   by_start)
      integer, intent(in) :: n_pairs, n_time, pair
      !> As settle_samples.
      real(wp), intent(in) :: y(n_pairs, 3, n_time), mu, touch, x(2)
      logical, intent(out) :: unique
      real(wp), intent(out) :: inverse(2, 2)
      !> Derivative of the position at the instants by the one at the start.
      real(wp), intent(out) :: by_start(2, 2, n_time)
      real(wp) :: after(2), m(2, 2)

      call turn_map(n_pairs, n_time, pair, y, mu, touch, x, after, m, by_start)
      call invert(m, inverse, unique)
   end subroutine limit_is_unique

   !> One turn from x, and its derivative by x.
   pure subroutine turn_map(n_pairs, n_time, pair, y, mu, touch, x, after, m, by_start)
      integer, intent(in) :: n_pairs, n_time, pair
      real(wp), intent(in) :: y(n_pairs, 3, n_time), mu, x(2)
      !> Distance from a disc within which the position counts as held by it [force].
      real(wp), intent(in) :: touch
      real(wp), intent(out) :: after(2), m(2, 2)
      !> m at every instant.
      real(wp), intent(out), optional :: by_start(2, 2, n_time)
      real(wp) :: d(2), e(2), along(2), length, limit
      integer :: k

      after = x
      m = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      do k = 1, n_time
         limit = mu*max(-y(pair, 3, k), 0.0_wp)
         d(1) = y(pair, 1, k) - after(1)
         d(2) = y(pair, 2, k) - after(2)
         length = sqrt(d(1)**2 + d(2)**2)
         if (length > limit - touch) then
            ! x = y - (mu p/|d|) d: what points along d is lost, the rest shrinks.
            e = d/length
            after(1) = y(pair, 1, k) - limit*e(1)
            after(2) = y(pair, 2, k) - limit*e(2)
            along = e(1)*m(1, :) + e(2)*m(2, :)
            m(1, :) = (limit/length)*(m(1, :) - e(1)*along)
            m(2, :) = (limit/length)*(m(2, :) - e(2)*along)
         end if
         if (present(by_start)) by_start(:, :, k) = m
      end do
   end subroutine turn_map

end module fw_sampled_turn
