!> One stretch of slip of a pair with two tangential directions: over a cell of the grid, or what a
!> switch leaves of it, in two equal steps, to its end or to where slip stops.
!>
!> Slip stops where its pull P'.t - R' falls to zero, t being its direction: then the position
!> z = P - R t no longer moves. At velocity level the pull is |P| - R.
module fw_event_slide
   use fw_event_cells, only: cells_type
   use fw_event_motion, only: gauss_type
   use fw_event_motion, only: instant_type
   use fw_event_motion, only: motion_type
   use fw_event_rotation, only: arc_type
   use fw_event_rotation, only: direction_of
   use fw_event_rotation, only: half_angle
   use fw_event_rotation, only: new_arc
   use fw_event_rotation, only: new_rotation
   use fw_event_rotation, only: rotate
   use fw_event_rotation, only: rotation_type
   use fw_event_segment, only: new_segment
   use fw_event_segment, only: segment_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: slide_type, slide_along, glide
   public :: landing_arc, pull, summit, first_guess

   !> Trials for the angle of a stop, and the step of Newton's method that is the last one: the
   !> position is stationary at a stop, so that errors count by their square.
   integer, parameter :: max_trials = 60
   real(wp), parameter :: angle_tolerance = 1.0e-8_wp

   ! State of slip along the stretch; what the path notes of it is in piece_type.
   type :: slide_type
      !> Start, middle and end with the half-angle vectors there.
      type(instant_type) :: at(3)
      real(wp) :: v(2, 3) = 0.0_wp
      !> Derivative of phi at the end of each step by that at its start.
      real(wp) :: gain(2) = 1.0_wp
      !> The cell that it covers; 0 where it does not cover one.
      integer :: cell = 0
      !> Slip starts here at R = 0; slip stops at the end.
      logical :: lands = .false., stops = .false.
   end type slide_type

contains

   !> Slip over a whole cell, if it passes without a stop.
   !> The cheap way through most cells: rotations of the grid only, no series, no instants.
   pure subroutine glide(motion, cells, cell, v, gain, passes)
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      !> Number of the cell, 1..n_cells.
      integer, intent(in) :: cell
      !> Half-angle vectors at the three nodes; the first is given.
      real(wp), intent(inout) :: v(2, 3)
      !> Derivative of phi at the end by that at the start.
      real(wp), intent(out) :: gain
      logical, intent(out) :: passes
      type(rotation_type) :: rotation
      real(wp) :: f, slope, before, part
      integer :: k, node

      gain = 1.0_wp
      call pull_at_node(motion, 2*cell - 1, v(:, 1), f, before)
      passes = f >= 0.0_wp
      ! The pull must not be negative at a node: without friction enough to stop it, slip goes on.
      do k = 1, 2
         if (.not. passes) return
         call motion%rotation_of(cells, 2*cell + k - 2, rotation)
         call rotate(rotation, v(:, k), v(:, k + 1), part)
         gain = gain*part
         node = 2*cell - 1 + k
         if (node > 2*cells%n_cells) node = 1
         call pull_at_node(motion, node, v(:, k + 1), f, slope)
         ! Falling and then rising, it might dip below zero.
         passes = f >= 0.0_wp .and. .not. (before < 0.0_wp .and. slope > 0.0_wp)
         before = slope
      end do
   end subroutine glide

   !> Pull and its rate from what a node holds (fw_event_motion).
   pure subroutine pull_at_node(motion, node, v, f, slope)
      type(motion_type), intent(in) :: motion
      integer, intent(in) :: node
      real(wp), intent(in) :: v(2)
      real(wp), intent(out) :: f, slope
      real(wp) :: t(2), across, radius

      ! across is P'.n, hence the rate of the direction is across/R.
      t = direction_of(v)
      associate (at => motion%node(:, node))
         across = t(1)*at(4) - t(2)*at(3)
         radius = max(motion%mu*at(7), tiny(1.0_wp))
         f = t(1)*at(3) + t(2)*at(4) - motion%mu*at(8)
         slope = t(1)*at(5) + t(2)*at(6) - motion%mu*at(9) + across**2/radius
      end associate
   end subroutine pull_at_node

   !> Slip from self%at(1) in the direction self%v(:, 1) to an end, unless it stops before.
   pure subroutine slide_along(motion, cells, to, self)
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      !> The end, on the cell self%cell if that is not 0.
      type(instant_type), intent(in) :: to
      !> Start and its direction on entry; `stops` and the end on return.
      type(slide_type), intent(inout) :: self
      type(instant_type) :: last
      integer :: k
      logical :: stops

      self%at(3) = to
      call take_steps(motion, cells, self)
      self%stops = .false.
      ! The first half that stops ends the stretch; what the second half found is void.
      do k = 1, 2
         call find_stop(motion, self, k, last, stops)
         if (.not. stops) cycle
         self%stops = .true.
         self%cell = 0
         ! Two equal steps again over the shorter stretch, so that the quadrature keeps its form.
         self%at(3) = last
         call take_steps(motion, cells, self)
         return
      end do
   end subroutine slide_along

   !> Directions in the middle and at the end.
   pure subroutine take_steps(motion, cells, self)
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(inout) :: self
      type(rotation_type) :: rotation
      integer :: k

      if (self%cell == 0) then
         ! No cell: three instants of the series, and quintics between them.
         self%at(2) = motion%look(0.5_wp*(self%at(1)%angle + self%at(3)%angle))
         do k = 1, 2
            call turned(motion, new_segment(motion, self%at(k), self%at(k + 1)), self%at(k), &
                        self%at(k + 1), self%v(:, k), self%lands .and. k == 1, &
                        self%v(:, k + 1), self%gain(k))
         end do
         return
      end if
      self%at(2) = motion%at_node(cells, 2*self%cell)
      do k = 1, 2
         if (motion%remembers) then
            call motion%rotation_of(cells, 2*self%cell + k - 2, rotation)
            call rotate(rotation, self%v(:, k), self%v(:, k + 1), self%gain(k))
         else
            self%v(:, k + 1) = half_angle(self%at(k + 1)%p)
         end if
      end do
   end subroutine take_steps

   !> Direction of slip after a step of any length on a segment that starts with it.
   pure subroutine turned(motion, segment, from, to, v, lands, after, gain)
      !> From `from` to `to`, on the segment between them (or a longer one that starts with it).
      type(motion_type), intent(in) :: motion
      type(segment_type), intent(in) :: segment
      type(instant_type), intent(in) :: from, to
      real(wp), intent(in) :: v(2)
      logical, intent(in) :: lands
      real(wp), intent(out) :: after(2), gain
      type(gauss_type) :: gauss
      type(arc_type) :: arc
      real(wp) :: h, phi

      after = v
      gain = 1.0_wp
      h = to%angle - from%angle
      if (h <= 0.0_wp) return
      ! At velocity level the direction is that of P at once.
      if (.not. motion%remembers) then
         after = half_angle(to%p)
         return
      end if
      if (lands) then
         gauss = motion%look_gauss(from%angle, h)
         arc = landing_arc(from, gauss, v, h)
         phi = 0.5_wp*h*(arc%slope + arc%curvature*h)
         after = [v(1)*cos(phi) - v(2)*sin(phi), v(2)*cos(phi) + v(1)*sin(phi)]
         ! Whatever was before, phi starts at the angle of P'.
         gain = 0.0_wp
      else
         gauss = segment%gauss(h)
         call rotate(new_rotation(h, gauss%dp(:, 1)/gauss%radius(1), &
                                  gauss%dp(:, 2)/gauss%radius(2)), v, after, gain)
      end if
   end subroutine turned

   !> The quadratic behind a landing.
   !> phi' at the landing by l'Hospital's rule: R' phi' = P''.n - |P'| phi'.
   pure type(arc_type) function landing_arc(from, gauss, v, h) result(arc)
      type(instant_type), intent(in) :: from
      type(gauss_type), intent(in) :: gauss
      real(wp), intent(in) :: v(2), h
      real(wp) :: t(2)

      t = direction_of(v)
      arc = new_arc(h, v, gauss%dp, gauss%radius, &
                    (t(1)*from%ddp(2) - t(2)*from%ddp(1))/(from%dradius + norm2(from%dp)))
   end function landing_arc

   !> What drives slip on.
   !> P'.t - R': while it is positive, the edge of the cone takes z along.
   pure real(wp) function pull(motion, at, v)
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)

      if (motion%remembers) then
         pull = dot_product(at%dp, direction_of(v)) - at%dradius
      else
         pull = norm2(at%p) - at%radius
      end if
   end function pull

   !> Its rate along the path.
   !> d/dtau (P'.t - R') = P''.t - R'' + P'.n phi', with phi' = P'.n/R.
   pure real(wp) function pull_slope(motion, at, v) result(slope)
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)
      real(wp) :: t(2)

      slope = 0.0_wp
      if (at%radius <= 0.0_wp) return
      if (motion%remembers) then
         t = direction_of(v)
         slope = dot_product(at%ddp, t) - at%ddradius + &
                 (t(1)*at%dp(2) - t(2)*at%dp(1))**2/at%radius
      else
         slope = dot_product(at%p, at%dp)/max(norm2(at%p), tiny(1.0_wp)) - at%dradius
      end if
   end function pull_slope

   !> Whether and where slip stops in a step: with a negative pull at its end, or between where the
   !> cubic through both ends dips below zero.
   !> Rising pulls at both ends, or falling at both, cannot hide a dip that the cubic would show.
   pure subroutine find_stop(motion, self, step, last, stops)
      type(motion_type), intent(in) :: motion
      type(slide_type), intent(in) :: self
      !> 1 or 2.
      integer, intent(in) :: step
      type(instant_type), intent(out) :: last
      logical, intent(out) :: stops
      type(segment_type) :: segment
      real(wp) :: f(2), df(2), v(2), angle, gain
      logical :: lands

      f(2) = pull(motion, self%at(step + 1), self%v(:, step + 1))
      df(2) = pull_slope(motion, self%at(step + 1), self%v(:, step + 1))
      stops = f(2) < 0.0_wp
      ! A pull that ends rising has not fallen below zero unless it dips.
      if (.not. stops .and. df(2) <= 0.0_wp) return
      lands = self%lands .and. step == 1
      associate (from => self%at(step), from_v => self%v(:, step))
         last = self%at(step + 1)
         f(1) = pull(motion, from, from_v)
         df(1) = pull_slope(motion, from, from_v)
         if (.not. stops .and. df(1) >= 0.0_wp) return
         segment = new_segment(motion, from, last)
         if (.not. stops) then
            angle = from%angle + summit(-f, -df, last%angle - from%angle)
            last = segment%at(angle)
            call turned(motion, segment, from, last, from_v, lands, v, gain)
            f(2) = pull(motion, last, v)
            df(2) = pull_slope(motion, last, v)
            stops = f(2) < 0.0_wp
         end if
         if (.not. stops) then
            last = self%at(step + 1)
         else if (f(1) <= 0.0_wp) then
            ! No pull at the start of the step: slip stops there.
            last = from
         else
            call find_zero(motion, segment, from, from_v, lands, f, df, last)
         end if
      end associate
   end subroutine find_stop

   !> Where the pull becomes zero before `last`: Newton's method within the bracket, from the root
   !> of the cubic through both ends.
   !> The direction is integrated anew from `from` to every trial: its error is that of one step.
   pure subroutine find_zero(motion, segment, from, v, lands, f_ends, df_ends, last)
      type(motion_type), intent(in) :: motion
      type(segment_type), intent(in) :: segment
      type(instant_type), intent(in) :: from
      real(wp), intent(in) :: v(2)
      logical, intent(in) :: lands
      !> Pull and slope at both ends.
      real(wp), intent(in) :: f_ends(2), df_ends(2)
      type(instant_type), intent(inout) :: last
      real(wp) :: low, high, trial, f, slope, after(2), gain
      integer :: k

      low = from%angle
      high = last%angle
      trial = low + (high - low)*first_guess(f_ends, df_ends*(high - low))
      do k = 1, max_trials
         last = segment%at(trial)
         call turned(motion, segment, from, last, v, lands, after, gain)
         f = pull(motion, last, after)
         slope = pull_slope(motion, last, after)
         if (f >= 0.0_wp) then
            low = trial
         else
            high = trial
         end if
         if (slope < 0.0_wp) then
            trial = last%angle - f/slope
         else
            ! A slope that is not negative points the wrong way: halve.
            trial = low
         end if
         if (trial <= low .or. trial >= high) trial = 0.5_wp*(low + high)
         if (abs(trial - last%angle) <= angle_tolerance .or. high - low <= angle_tolerance) exit
      end do
      last = motion%look(trial)
   end subroutine find_zero

   !> Root in 0..1 of the cubic with values f of other signs and slopes df at 0 and 1, nearly.
   !> Three steps of Newton's method from the chord, or fewer; a start, not a result.
   pure real(wp) function first_guess(f, df) result(t)
      real(wp), intent(in) :: f(2), df(2)
      real(wp) :: a(2), value, slope
      integer :: k

      a = [3.0_wp*(f(2) - f(1)) - 2.0_wp*df(1) - df(2), 2.0_wp*(f(1) - f(2)) + df(1) + df(2)]
      t = f(1)/(f(1) - f(2))
      do k = 1, 3
         value = f(1) + t*(df(1) + t*(a(1) + t*a(2)))
         slope = df(1) + t*(2.0_wp*a(1) + t*3.0_wp*a(2))
         if (slope*(f(2) - f(1)) <= 0.0_wp) return
         t = min(max(t - value/slope, 0.0_wp), 1.0_wp)
      end do
   end function first_guess

   !> Where the cubic with values f and slopes df at 0 and width, rising and then falling, is
   !> largest.
   !> Rising at 0 and falling at width: the caller has seen to it.
   pure real(wp) function summit(f, df, width)
      real(wp), intent(in) :: f(2), df(2), width
      real(wp) :: a(3), root

      a(1) = df(1)*width
      a(2) = 3.0_wp*(f(2) - f(1)) - width*(2.0_wp*df(1) + df(2))
      a(3) = 2.0_wp*(f(1) - f(2)) + width*(df(1) + df(2))
      root = sqrt(max(a(2)**2 - 3.0_wp*a(3)*a(1), 0.0_wp))
      ! The falling root of a1 + 2 a2 t + 3 a3 t**2, without cancellation.
      if (a(2) > 0.0_wp) then
         summit = width*(-(a(2) + root)/(3.0_wp*a(3)))
      else
         summit = width*a(1)/(root - a(2))
      end if
   end function summit

end module fw_event_slide
