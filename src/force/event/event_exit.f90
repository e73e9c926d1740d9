!> Where a pair with two tangential directions leaves the cone of friction: roots of the excess
!> |P - z|**2 - R**2, z being the position that it sticks at.
module fw_event_exit
   use fw_event_cells, only: cells_type
   use fw_event_motion, only: instant_type, motion_type, on_cone, point_of, stretch_type
   use fw_event_segment, only: new_segment, segment_type
   use fw_event_slide, only: first_guess, summit
   use fw_event_stages, only: n_points
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: is_pushed, find_exit

   !> Trials for the angle where slip begins, and its accuracy.
   !> Halvings alone take a cell to round-off in some fifty. The rough tolerance is that on the
   !> quintic, whose own error is larger.
   integer, parameter :: max_trials = 80, max_climbs = 12, max_halvings = 26
   real(wp), parameter :: angle_tolerance = 1.0e-15_wp, rough_tolerance = 1.0e-9_wp

contains

   !> Whether a pair at a position slips: outside of the cone, or pushed where it is on it.
   !> On the cone to round-off the slope decides: a position that a stop of slip left there must not
   !> slip again at once.
   pure logical function is_pushed(motion, at, z)
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)
      real(wp) :: f

      f = excess(at, z)
      is_pushed = f > noise_of(motion) .or. &
                  (f > -noise_of(motion) .and. excess_slope(at, z) > 0.0_wp)
   end function is_pushed

   !> First angle after which the pair leaves the cone in a stretch that starts with stick.
   !> Two exits between two points that both return inside are seen as none: one summit is looked
   !> for.
   pure subroutine find_exit(motion, cells, z, stretch, at, found)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: z(2)
      type(stretch_type), intent(in) :: stretch
      !> Where stick ends.
      type(instant_type), intent(inout) :: at
      logical, intent(out) :: found
      type(instant_type) :: last
      real(wp), dimension(n_points) :: x, y, f, df
      real(wp) :: noise
      integer :: i

      ! Of differences, not of expanded squares, as in `excess`.
      x = stretch%p(:, 1) - z(1)
      y = stretch%p(:, 2) - z(2)
      f = x**2 + y**2 - stretch%radius**2
      df = 2.0_wp*(x*stretch%dp(:, 1) + y*stretch%dp(:, 2) - stretch%radius*stretch%dradius)
      noise = noise_of(motion)
      found = .false.
      do i = 1, n_points - 1
         if (f(i + 1) <= noise .and. (df(i) <= 0.0_wp .or. df(i + 1) >= 0.0_wp)) cycle
         last = point_of(cells, stretch, i + 1)
         at = point_of(cells, stretch, i)
         if (f(i + 1) <= noise) then
            call climb(motion, z, f(i:i + 1), df(i:i + 1), at%angle, last)
            if (excess(last, z) <= noise) cycle
         end if
         found = .true.
         ! Round-off there would be taken for a root.
         if (i == 1) call leave_start(motion, z, at, last)
         call find_crossing(motion, z, last, at)
         return
      end do
   end subroutine find_exit

   !> A start within the cone: where stick begins the excess and its slope vanish to round-off.
   pure subroutine leave_start(motion, z, at, last)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: z(2)
      !> The start, and an instant outside of the cone.
      type(instant_type), intent(inout) :: at, last
      type(instant_type) :: trial
      integer :: k

      do k = 1, max_halvings
         trial = motion%look(0.5_wp*(at%angle + last%angle))
         if (excess(trial, z) < 0.0_wp) then
            at = trial
            return
         end if
         last = trial
      end do
   end subroutine leave_start

   !> To the summit of the excess between two angles, or to anywhere above zero.
   pure subroutine climb(motion, z, f, df, from, last)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: z(2)
      !> Excess and slope at both ends, rising and then falling.
      real(wp), intent(in) :: f(2), df(2), from
      !> The upper end, then the summit.
      type(instant_type), intent(inout) :: last
      real(wp) :: angle(2), value(2), slope(2), noise
      integer :: end, k

      angle = [from, last%angle]
      value = f
      slope = df
      noise = noise_of(motion)
      do k = 1, max_climbs
         last = motion%look(angle(1) + summit(value, slope, angle(2) - angle(1)))
         end = merge(1, 2, excess_slope(last, z) > 0.0_wp)
         angle(end) = last%angle
         value(end) = excess(last, z)
         slope(end) = excess_slope(last, z)
         ! Outside of the cone: an exit, wherever the summit is.
         if (value(end) > noise) return
         ! No higher than the lines through both ends meet; most summits are far below zero.
         if (min(value(1) + slope(1)*(angle(2) - angle(1)), &
                 value(2) - slope(2)*(angle(2) - angle(1))) <= noise) return
      end do
   end subroutine climb

   !> Root of the excess between two angles: first on the quintic through both, then on the series.
   pure subroutine find_crossing(motion, z, last, at)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: z(2)
      type(instant_type), intent(in) :: last
      type(instant_type), intent(inout) :: at
      type(segment_type) :: segment
      real(wp) :: low, high, trial

      low = at%angle
      high = last%angle
      trial = low + (high - low)* &
              first_guess([excess(at, z), excess(last, z)], &
                          (high - low)*[excess_slope(at, z), excess_slope(last, z)])
      segment = new_segment(motion, at, last)
      ! Most steps on the quintic, which is cheaper than the series; the last ones where it counts.
      call refine(motion, segment, .false., z, low, high, rough_tolerance, trial, at)
      call refine(motion, segment, .true., z, low, high, angle_tolerance*(1.0_wp + high), trial, at)
   end subroutine find_crossing

   !> Newton's method within a bracket.
   pure subroutine refine(motion, segment, on_series, z, left, right, tolerance, trial, at)
      type(motion_type), intent(in) :: motion
      type(segment_type), intent(in) :: segment
      !> Look at the series, not at the segment.
      logical, intent(in) :: on_series
      real(wp), intent(in) :: z(2), left, right, tolerance
      !> The root, and the instant there.
      real(wp), intent(inout) :: trial
      type(instant_type), intent(inout) :: at
      real(wp) :: low, high, step, value, slope
      integer :: k

      low = left
      high = right
      do k = 1, max_trials
         if (on_series) then
            at = motion%look(trial)
         else
            at = segment%at(trial)
         end if
         value = excess(at, z)
         slope = excess_slope(at, z)
         if (value > 0.0_wp) then
            high = trial
         else
            low = trial
         end if
         ! Halving is the fallback that is always there; Newton's step only where it stays in the
         ! bracket.
         step = 0.5_wp*(low + high) - trial
         if (abs(slope) > 0.0_wp) then
            if (trial - value/slope > low .and. trial - value/slope < high) step = -value/slope
         end if
         if (abs(step) <= tolerance) return
         trial = trial + step
      end do
   end subroutine refine

   !> Excess below which the cone counts as touched.
   pure real(wp) function noise_of(motion)
      !> The excess is a square: its round-off goes with the square of the size of P.
      type(motion_type), intent(in) :: motion

      noise_of = on_cone*(motion%scale**2 + tiny(1.0_wp))
   end function noise_of

   !> |P - z|**2 - R**2: positive outside of the cone.
   pure real(wp) function excess(at, z)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)

      ! Of differences, not of expanded squares: near the cone the terms would cancel.
      excess = (at%p(1) - z(1))**2 + (at%p(2) - z(2))**2 - at%radius**2
   end function excess

   !> d/dtau of the excess |P - z|^2 - R^2: its sign tells whether a stick is being left.
   pure real(wp) function excess_slope(at, z) result(slope)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)

      slope = 2.0_wp*((at%p(1) - z(1))*at%dp(1) + (at%p(2) - z(2))*at%dp(2) - at%radius*at%dradius)
   end function excess_slope

end module fw_event_exit
