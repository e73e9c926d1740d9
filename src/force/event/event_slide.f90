!> One step of slip of a pair with two tangential directions, to the end of a stretch or to where
!> slip stops.
!>
!> Slip stops where its pull P'.t - R' falls to zero, t being its direction: then the position
!> z = P - R t no longer moves. At velocity level phi is the angle of P, and the pull |P| - R.
module fw_event_slide
   use fw_event_cells, only: cells_type
   use fw_event_motion, only: instant_type, motion_type, point_of, stretch_type
   use fw_event_stages, only: angle_at, cosine_and_sine, direction_of, n_points, solve_step, &
      stages_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: slide_type, slide_along
   public :: landing_slope, summit, first_guess, pulls

   !> Part of the largest force that a step may leave out, by the last coefficient of its direction
   !> (calibrated: the error of the force is far below that).
   real(wp), parameter :: step_tolerance = 1.0e-6_wp
   !> Steps are not divided below this width.
   real(wp), parameter :: narrowest = 1.0e-6_wp
   !> Trials for the angle of a stop, and the step of Newton's method that is the last one: the
   !> position is stationary at a stop, so that errors count by their square.
   integer, parameter :: max_trials = 60, max_shortenings = 6
   real(wp), parameter :: angle_tolerance = 1.0e-8_wp

   !> A step of slip, and how it ends.
   type :: slide_type
      type(stretch_type) :: stretch
      type(stages_type) :: stages
      !> The step is too wide for the tolerance; slip stops at its end.
      logical :: divides = .false., stops = .false.
   end type slide_type

contains

   !> Slip over self%stretch from the direction self%stages%phi(1), unless it stops before.
   pure subroutine slide_along(motion, cells, lands, may_divide, self)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      !> R vanishes at the start; whether the caller can take less.
      logical, intent(in) :: lands, may_divide
      !> The stretch and the first direction; the stretch ends at the stop on return.
      type(slide_type), intent(inout) :: self
      real(wp), dimension(n_points) :: f, df
      real(wp) :: angle, from, step
      integer :: k, interval

      self%stops = .false.
      call take_step(motion, cells, lands, may_divide, self)
      if (self%divides) return
      call pulls_and_rates(motion, self, f, df)
      call find_stop(motion, cells, self, f, df, interval, angle)
      if (interval == 0) return
      self%stops = .true.
      ! The step again up to there, where its error is that of the end of a step, until the pull
      ! vanishes at its end.
      from = self%stretch%from
      do k = 1, max_shortenings
         call motion%stretch(cells, 0, from, angle, self%stretch)
         if (angle <= from) then
            self%stages%phi = self%stages%phi(1)
            self%stages%gain = 1.0_wp
            return
         end if
         call take_step(motion, cells, lands, may_divide, self)
         call pulls_and_rates(motion, self, f, df)
         ! A pull that does not fall there has no root near by: the first one is kept.
         if (.not. df(n_points) < 0.0_wp) return
         step = -f(n_points)/df(n_points)
         if (abs(step) <= angle_tolerance) return
         angle = max(angle + min(step, 0.5_wp*cells%width), from)
      end do
   end subroutine slide_along

   !> Directions at the points of the stretch.
   pure subroutine take_step(motion, cells, lands, may_divide, self)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      logical, intent(in) :: lands, may_divide
      type(slide_type), intent(inout) :: self
      real(wp) :: slope, h
      logical :: done

      associate (s => self%stretch, stages => self%stages)
         h = s%to - s%from
         if (motion%remembers) then
            slope = 0.0_wp
            if (lands) slope = landing_slope(s)
            ! R at a root of N is round-off, which phi' at the start must not be divided by.
            if (lands) s%radius(1) = 0.0_wp
            call solve_step(cells%rule, h, s%dp, s%radius, slope, stages, done)
            ! Whatever was before, phi starts at the angle of P'.
            if (lands) stages%gain = 0.0_wp
         else
            ! Nothing to integrate: the direction is that of P, whatever came before.
            stages%phi = atan2(s%p(:, 2), s%p(:, 1))
            stages%slope = (s%p(:, 1)*s%dp(:, 2) - s%p(:, 2)*s%dp(:, 1))/ &
                           max(s%p(:, 1)**2 + s%p(:, 2)**2, tiny(1.0_wp))
            stages%gain = 0.0_wp
            stages%last = h*dot_product(cells%rule%last, stages%slope)
            done = .true.
         end if
         ! The last coefficient weighs more than what the step leaves out, which is of twice its
         ! order where phi is smooth; where it is not, as before contact ends, it is all there is.
         ! Without room for more pieces the step is taken as it is.
         self%divides = may_divide .and. h > narrowest .and. (.not. done .or. &
            h*abs(stages%last)*maxval(s%radius) > step_tolerance*motion%largest_radius)
      end associate
   end subroutine take_step

   !> phi' at a landing by l'Hospital's rule: R' phi' = P''.n - |P'| phi'.
   pure real(wp) function landing_slope(stretch) result(slope)
      type(stretch_type), intent(in) :: stretch
      real(wp) :: length

      associate (dp => stretch%dp(1, :), ddp => stretch%ddp(1, :))
         length = max(norm2(dp), tiny(1.0_wp))
         slope = (dp(1)*ddp(2) - dp(2)*ddp(1))/(length*(stretch%dradius(1) + length))
      end associate
   end function landing_slope

   !> What drives slip on, P'.t - R', at the points of a stretch: while it is positive, the edge of
   !> the cone takes z along.
   pure subroutine pulls(motion, stretch, phi, f)
      type(motion_type), intent(in) :: motion
      type(stretch_type), intent(in) :: stretch
      real(wp), intent(in) :: phi(n_points)
      real(wp), intent(out) :: f(n_points)
      real(wp), dimension(n_points) :: c, d

      associate (s => stretch)
         if (motion%remembers) then
            call cosine_and_sine(phi, c, d)
            f = c*s%dp(:, 1) + d*s%dp(:, 2) - s%dradius
         else
            f = sqrt(s%p(:, 1)**2 + s%p(:, 2)**2) - s%radius
         end if
      end associate
   end subroutine pulls

   !> The same with its rate P''.t - R'' + P'.n phi' (at velocity level P'.t - R').
   pure subroutine pulls_and_rates(motion, self, f, df)
      type(motion_type), intent(in) :: motion
      type(slide_type), intent(in) :: self
      real(wp), intent(out) :: f(n_points), df(n_points)
      !> Part of the largest R below which P'.n/R is not taken for phi'.
      real(wp), parameter :: small = 1.0e-6_wp
      real(wp), dimension(n_points) :: c, d, across, slope
      integer :: i

      associate (s => self%stretch, stages => self%stages)
         call cosine_and_sine(stages%phi, c, d)
         if (.not. motion%remembers) then
            f = c*s%p(:, 1) + d*s%p(:, 2) - s%radius
            df = c*s%dp(:, 1) + d*s%dp(:, 2) - s%dradius
            return
         end if
         across = c*s%dp(:, 2) - d*s%dp(:, 1)
         slope = stages%slope
         do i = 1, n_points, n_points - 1
            ! The ends are no Gauss points: the equation itself says phi' there, unless R vanishes.
            if (s%radius(i) > small*motion%largest_radius) slope(i) = across(i)/s%radius(i)
         end do
         f = c*s%dp(:, 1) + d*s%dp(:, 2) - s%dradius
         df = c*s%ddp(:, 1) + d*s%ddp(:, 2) - s%ddradius + across*slope
      end associate
   end subroutine pulls_and_rates

   !> The first interval between two points in which the pull becomes negative (0: none), and where
   !> that is on the polynomial of the step.
   pure subroutine find_stop(motion, cells, self, f, df, interval, angle)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(in) :: self
      !> Pull and its rate at the points.
      real(wp), intent(in) :: f(n_points), df(n_points)
      integer, intent(out) :: interval
      real(wp), intent(out) :: angle
      type(instant_type) :: ends(2)
      real(wp) :: g(2), dg(2)
      integer :: i

      interval = 0
      angle = self%stretch%to
      do i = 1, n_points - 1
         if (f(i + 1) >= 0.0_wp .and. (df(i) >= 0.0_wp .or. df(i + 1) <= 0.0_wp)) cycle
         ends = [point_of(cells, self%stretch, i), point_of(cells, self%stretch, i + 1)]
         g = f(i:i + 1)
         dg = df(i:i + 1)
         if (g(2) >= 0.0_wp) then
            ! Falling and then rising: perhaps at the least value of the cubic through both.
            ends(2)%angle = ends(1)%angle + summit(-g, -dg, ends(2)%angle - ends(1)%angle)
            call pull_at(motion, cells, self, ends(2)%angle, g(2), dg(2))
            if (g(2) >= 0.0_wp) cycle
         end if
         interval = i
         ! No pull at the start: slip stops there.
         angle = ends(1)%angle
         if (g(1) > 0.0_wp) call find_zero(motion, cells, self, ends%angle, g, dg, angle)
         return
      end do
   end subroutine find_stop

   !> The pull anywhere in the step, on its polynomial.
   pure subroutine pull_at(motion, cells, self, angle, f, slope)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(in) :: self
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: f, slope
      type(instant_type) :: at
      real(wp) :: t(2), h, across

      at = motion%look(angle)
      if (.not. motion%remembers) then
         f = norm2(at%p) - at%radius
         slope = dot_product(at%p, at%dp)/max(norm2(at%p), tiny(1.0_wp)) - at%dradius
         return
      end if
      h = self%stretch%to - self%stretch%from
      t = direction_of(angle_at(cells%rule, h, self%stages%phi(1), self%stages%slope, &
                                (angle - self%stretch%from)/h))
      across = t(1)*at%dp(2) - t(2)*at%dp(1)
      f = dot_product(t, at%dp) - at%dradius
      slope = dot_product(t, at%ddp) - at%ddradius + across**2/max(at%radius, tiny(1.0_wp))
   end subroutine pull_at

   !> Where the pull becomes zero between two angles: Newton's method within the bracket, from the
   !> root of the cubic through both ends.
   pure subroutine find_zero(motion, cells, self, ends, f_ends, df_ends, angle)
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(in) :: self
      !> Pull and slope at both ends.
      real(wp), intent(in) :: ends(2), f_ends(2), df_ends(2)
      real(wp), intent(out) :: angle
      real(wp) :: low, high, f, slope, last
      integer :: k

      low = ends(1)
      high = ends(2)
      angle = low + (high - low)*first_guess(f_ends, df_ends*(high - low))
      do k = 1, max_trials
         call pull_at(motion, cells, self, angle, f, slope)
         if (f >= 0.0_wp) then
            low = angle
         else
            high = angle
         end if
         last = angle
         angle = 0.5_wp*(low + high)
         ! A slope that is not negative points the wrong way: halve.
         if (slope < 0.0_wp) then
            if (last - f/slope > low .and. last - f/slope < high) angle = last - f/slope
         end if
         ! The step is taken again to this angle, which is then corrected.
         if (abs(angle - last) <= 1.0e-3_wp*(ends(2) - ends(1))) return
      end do
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
