!> Where a pair with two tangential directions leaves the cone of friction: roots of the excess
!> |P - z|**2 - R**2, z being the position that it sticks at.
module fw_event_exit
   use fw_event_motion, only: instant_type
   use fw_event_motion, only: motion_type
   use fw_event_motion, only: on_cone
   use fw_event_segment, only: new_segment
   use fw_event_segment, only: segment_type
   use fw_event_slide, only: first_guess
   use fw_event_slide, only: summit
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: is_pushed, sticks_on, find_exit

   !> Trials for the angle where slip begins, and its accuracy.
   !> Halvings alone take a cell to round-off in some fifty. The rough tolerance is that on the
   !> quintic, whose own error is larger.
   integer, parameter :: max_trials = 80
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

   !> Whether a pair that sticks keeps within the cone from one node to another (fw_event_motion):
   !> inside at the end, and no summit between.
   pure logical function sticks_on(motion, z, from, to)
      ! Entries as `node` of motion_type: P, P', P'', N, N', N''.
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: z(2), from(9), to(9)
      real(wp) :: d(2), slope

      d = to(1:2) - z
      sticks_on = d(1)**2 + d(2)**2 - (motion%mu*to(7))**2 <= noise_of(motion)
      if (.not. sticks_on) return
      ! Half the slope of the excess. Inside at both ends, it can only pass the cone in between if
      ! it rises at the start and falls at the end.
      slope = d(1)*to(3) + d(2)*to(4) - motion%mu**2*to(7)*to(8)
      if (slope >= 0.0_wp) return
      d = from(1:2) - z
      slope = d(1)*from(3) + d(2)*from(4) - motion%mu**2*from(7)*from(8)
      sticks_on = slope <= 0.0_wp
   end function sticks_on

   !> First angle after which the pair leaves the cone, if it does before `to`.
   !> Two exits within one stretch that both return inside before `to` are seen as none: the cubic
   !> has one summit.
   pure subroutine find_exit(motion, z, to, at, found)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: z(2)
      type(instant_type), intent(in) :: to
      !> Where stick has begun, then where it ends.
      type(instant_type), intent(inout) :: at
      logical, intent(out) :: found
      type(instant_type) :: last
      real(wp) :: f(2), df(2)

      found = .false.
      if (to%angle <= at%angle) return
      last = to
      f(2) = excess(to, z)
      if (f(2) <= noise_of(motion)) then
         ! Perhaps between: at the largest value of the cubic through both ends.
         df(2) = excess_slope(to, z)
         if (df(2) >= 0.0_wp) return
         f(1) = excess(at, z)
         df(1) = excess_slope(at, z)
         if (df(1) <= 0.0_wp) return
         last = motion%look(at%angle + summit(f, df, to%angle - at%angle))
         if (excess(last, z) <= noise_of(motion)) return
      end if
      found = .true.
      call find_crossing(motion, z, last, at)
   end subroutine find_exit

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
