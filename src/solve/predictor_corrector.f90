!> One step of a branch: a predictor along the cubic through the last points, a corrector across the
!> tangent, the tests that the step has to pass, and the length of the next one.
!>
!> A step counts only if the corrector stays near its predictor, the angles between chord and
!> tangents are small, the cubic through points and tangents is true to the curve, and no resonance
!> of the linearized system is passed over; otherwise it is shortened (fw_corrector,
!> fw_branch_step, fw_near_response). Only steps that are next to nothing may turn sharply: those of
!> a corner (fw_branch_turn).
module fw_predictor_corrector
   use fw_branch_crossing, only: goes_through
   use fw_branch_point, only: branch_point, reverse
   use fw_branch_step, only: allowed_error, extrapolate, interpolate, missed, misses_of, &
      step_history, turns_between
   use fw_branch_turn, only: turn_at_corner
   use fw_corrector, only: corrector_type, differ
   use fw_curve_options, only: limits
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_near_response, only: near_response
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: predictor_corrector

   type :: predictor_corrector
      type(corrector_type) :: corrector
      !> Longest step of p over the interval.
      real(wp) :: longest = 0.0625_wp
      !> The least size of x that matters.
      real(wp) :: x_scale = 0.0_wp
      !> Resonances of what x does not show, heeded where x does not move at all: where they are in
      !> p, and half their half-power widths.
      real(wp), allocatable :: pole(:), pole_width(:)
      !> Steps that were tried and not taken.
      integer :: n_rejected = 0
      !> Where the branch has come to, the point before, and the length of the next step.
      type(branch_point) :: here
      type(step_history) :: history
      real(wp) :: ds = 0.0_wp
      !> Resonances about `here`, and about the point that is tried, where they were looked for.
      type(near_response) :: near
      type(near_response), allocatable, private :: near_ahead
      integer, private :: n_failed = 0
   contains
      procedure :: shorten_until_taken
      procedure :: plan
      procedure :: forget_ahead
      procedure :: scale_metric
      procedure :: limit_step
   end type predictor_corrector

contains

   !> Attempts from the present step on, each shorter than the one before.
   subroutine shorten_until_taken(self, system, least, factor, ahead, done, error)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      !> Shortest step, and what a failure makes of one.
      real(wp), intent(in) :: least, factor
      type(branch_point), intent(out) :: ahead
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: shortening

      self%n_failed = 0
      do
         ahead = self%here
         self%corrector%careful = self%ds < limits%turning .or. .not. self%history%known
         call extrapolate(self%corrector%metric, self%history, self%here, self%ds, ahead)
         call attempt(self, system, ahead, shortening, error)
         done = shortening >= 1.0_wp
         if (allocated(error) .or. done) return
         self%n_rejected = self%n_rejected + 1
         self%n_failed = self%n_failed + 1
         if (self%ds < limits%turning .and. self%corrector%oriented) then
            call turn_at_corner(self%corrector, system, self%here, self%ds, ahead, error)
            done = ahead%report%converged
            if (allocated(error) .or. done) return
         end if
         if (self%ds < least) exit
         ! An attempt that has only failed says nothing of the length that would do; a measured
         ! error does.
         self%ds = self%ds*merge(factor, shortening, abs(shortening - limits%halved) <= 0.0_wp)
      end do
   end subroutine shorten_until_taken

   !> One step; a shortening below one: it does not count, and this part of it may.
   subroutine attempt(self, system, ahead, shortening, error)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      !> In: the predictor.
      type(branch_point), intent(inout) :: ahead
      real(wp), intent(out) :: shortening
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: guess(:)
      real(wp) :: guess_p
      logical :: done, far

      shortening = limits%halved
      call self%forget_ahead()
      guess = ahead%y
      guess_p = ahead%p
      call self%corrector%correct(system, self%here, max(self%ds, limits%corner), ahead, error)
      if (allocated(error)) return
      if (.not. ahead%report%converged .and. goes_across(self)) then
         call extrapolate(self%corrector%metric, self%history, self%here, self%ds, ahead)
         call self%corrector%correct_across(system, self%here, ahead, error)
         if (allocated(error)) return
      end if
      if (.not. ahead%report%converged) return
      associate (metric => self%corrector%metric)
         far = metric%length(ahead%y - guess, ahead%p - guess_p) &
               > max(limits%max_distance*self%ds, limits%corner)
      end associate
      ! Converged, but on something else than what was predicted.
      if (far) return
      if (self%ds <= limits%corner) then
         call look_at_corner(self, system, ahead, done, error)
         if (done) shortening = 1.0_wp
      else
         if (.not. bends_little(self, ahead)) return
         if (turns_between(self%corrector%metric, self%here, ahead)) return
         if (differ(ahead, self%here)) then
            call goes_through(self%corrector, system, self%here, ahead, done, error)
            if (allocated(error) .or. .not. done) return
         end if
         call measure(self, system, ahead, shortening, error)
      end if
   end subroutine attempt

   !> Whether a step in p alone is worth trying where the corrector has failed more than once: many
   !> pairs make it go round between pieces, and a search along its steps does not.
   pure logical function goes_across(self)
      class(predictor_corrector), intent(in) :: self

      goes_across = associated(self%corrector%view) .and. &
                    self%n_failed >= limits%most_failed .and. &
                    self%ds >= limits%turning .and. &
                    abs(self%here%t_p) > limits%least_share*self%corrector%metric%p_scale
   end function goes_across

   !> Whether the angles between tangents and chord are those of one smooth piece.
   pure logical function bends_little(self, ahead)
      class(predictor_corrector), intent(in) :: self
      type(branch_point), intent(in) :: ahead
      real(wp) :: chord, cosine(3)

      associate (metric => self%corrector%metric, here => self%here)
         ! Cosines of the angles: tangent to tangent, and either tangent to the chord.
         chord = metric%chord(here, ahead)
         cosine = [metric%inner(here%t_y, here%t_p, ahead%t_y, ahead%t_p), &
                   metric%inner(here%t_y, here%t_p, ahead%y - here%y, ahead%p - here%p)/chord, &
                   metric%inner(ahead%t_y, ahead%t_p, ahead%y - here%y, ahead%p - here%p)/chord]
      end associate
      bends_little = cosine(1) >= cos(limits%max_turn) .and. &
                     all(cosine(2:) >= cos(limits%max_chord))
   end function bends_little

   !> At a step that is next to nothing, the tangent of the smaller angle leads back where the
   !> orientation is the other one and the branch turns sharply: it is reversed. Where it does not
   !> turn, the step has gone across to another piece; what is left of that at the shortest steps is
   !> a bifurcation, beyond which a branch has the other orientation.
   subroutine look_at_corner(self, system, ahead, done, error)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: ahead
      !> Whether the step counts.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error

      done = .false.
      call self%corrector%find_orientation(system, self%here, error)
      if (allocated(error)) return
      call self%corrector%find_orientation(system, ahead, error)
      if (allocated(error)) return
      done = .true.
      if (.not. differ(ahead, self%here)) return
      if (self%corrector%metric%inner(self%here%t_y, self%here%t_p, ahead%t_y, ahead%t_p) &
          <= limits%sharp) then
         call reverse(ahead)
      else
         done = self%ds < limits%bifurcation
      end if
   end subroutine look_at_corner

   !> 1 where the cubic of the step is true to the curve, else what part of it would be.
   subroutine measure(self, system, ahead, shortening, error)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      real(wp), intent(out) :: shortening
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: smooth, corner_error, place, found

      shortening = 1.0_wp
      call missed(self%corrector%metric, self%history, self%here, ahead, smooth, corner_error, &
                  place)
      ! The error of a cubic grows like ds^4: its fourth root gives the step.
      if (smooth > allowed_error) then
         shortening = max(limits%least_growth, &
                          min(0.8_wp, (limits%aim*allowed_error/smooth)**0.25_wp))
      else if (self%here%t_p*ahead%t_p > 0.0_wp) then
         if (self%near%misses(ahead%p - self%here%p) > limits%passed*allowed_error) then
            shortening = 0.7_wp
         end if
      end if
      if (shortening < 1.0_wp) return
      ! While the system stands there.
      if (.not. allocated(self%near_ahead)) allocate (self%near_ahead)
      call self%near_ahead%find(self%corrector, system, ahead, x_scale_at(self, ahead))
      if (corner_error <= allowed_error) return
      ! The estimate of a corner may be a false alarm: one correction there tells. One that lies
      ! where neither a smooth curve nor a single corner has it stands for several of them.
      if (place < limits%around_from .or. place > limits%around_to) then
         call look_between(self, system, ahead, limits%amidst, found, error)
         if (found > limits%looked_at*allowed_error) shortening = limits%amidst
         if (allocated(error) .or. shortening < 1.0_wp .or. place < limits%least_place) return
      end if
      place = max(limits%least_place, min(1.0_wp - limits%least_place, place))
      call look_between(self, system, ahead, place, found, error)
      if (found > limits%looked_at*allowed_error) shortening = place
   end subroutine measure

   !> What the cubic of a step misses at a place of it: a correction there at a constant p.
   subroutine look_between(self, system, ahead, place, found, error)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      !> Share of the step.
      real(wp), intent(in) :: place
      real(wp), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: between
      real(wp), allocatable :: change(:)
      logical :: done

      found = 0.0_wp
      call interpolate(self%corrector%metric, self%here, ahead, place, between)
      call self%corrector%try(system, between, change, done, error)
      if (allocated(error) .or. .not. done) return
      found = misses_of(self%corrector%metric, self%here, ahead, between, change)
   end subroutine look_between

   !> Sizes are those of a point.
   pure subroutine scale_metric(self, point)
      class(predictor_corrector), intent(inout) :: self
      type(branch_point), intent(in) :: point

      associate (metric => self%corrector%metric)
         metric%y_scale = y_scale_at(self, point)
         if (metric%n_seen == 0) return
         ! From point to point scales fall by `fading` at most: a response near zero keeps one.
         metric%x_scale = max(norm2(point%x)/limits%weight_x, &
                              limits%fading*metric%x_scale, self%x_scale/limits%weight_x)
      end associate
   end subroutine scale_metric

   !> The scale of y at the next point.
   pure real(wp) function y_scale_at(self, ahead) result(scale)
      class(predictor_corrector), intent(in) :: self
      type(branch_point), intent(in) :: ahead

      associate (metric => self%corrector%metric)
         scale = max(limits%fading*metric%y_scale, self%x_scale)
         if (metric%n_seen == 0) then
            scale = max(norm2(ahead%y), scale)
         else
            scale = max(norm2(ahead%y(:metric%n_seen)), scale)
         end if
      end associate
   end function y_scale_at

   !> The scale of x at the next point: that of y where the branch is measured by x itself.
   pure real(wp) function x_scale_at(self, ahead) result(scale)
      class(predictor_corrector), intent(in) :: self
      type(branch_point), intent(in) :: ahead

      scale = y_scale_at(self, ahead)
      if (associated(self%corrector%view)) scale = self%corrector%x_scale(ahead%x)
   end function x_scale_at

   !> Go on to a point, and choose the step from there.
   subroutine plan(self, system, ahead)
      class(predictor_corrector), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      real(wp) :: error, unused(2), growth, turn

      associate (metric => self%corrector%metric)
         growth = limits%largest_growth
         call missed(metric, self%history, self%here, ahead, error, unused(1), unused(2))
         ! The least of three: by the error of the cubic, by the turn of the tangent, and by the
         ! work that the corrector had.
         if (error > 0.0_wp) growth = min(growth, (limits%aim*allowed_error/error)**0.25_wp)
         turn = acos(max(-1.0_wp, min(1.0_wp, metric%inner(self%here%t_y, self%here%t_p, &
                                                           ahead%t_y, ahead%t_p))))
         if (turn > 0.0_wp) growth = min(growth, max(limits%least_growth, limits%aimed_turn/turn))
         if (ahead%report%iterations >= limits%slow) growth = min(growth, limits%slower)
         self%history%known = .true.
         self%history%before = self%here
         self%here = ahead
         ! Resonances are alike at every size: a step keeps its length when the scale changes.
         self%ds = metric%chord(self%history%before, self%here)
         call self%scale_metric(ahead)
         call metric%normalize(self%here)
         self%ds = max(growth*self%ds, min(limits%corner, limits%largest_growth*self%ds))
      end associate
      if (allocated(self%near_ahead)) then
         self%near = self%near_ahead
      else
         call self%near%find(self%corrector, system, self%here, x_scale_at(self, self%here))
      end if
      call self%limit_step()
   end subroutine plan

   !> Another point than the one that was tried follows: what was found about that one is not its.
   pure subroutine forget_ahead(self)
      class(predictor_corrector), intent(inout) :: self

      if (allocated(self%near_ahead)) deallocate (self%near_ahead)
   end subroutine forget_ahead

   !> No step beyond what p and x may change, nor over a resonance.
   subroutine limit_step(self)
      class(predictor_corrector), intent(inout) :: self
      real(wp) :: change, reach

      associate (metric => self%corrector%metric, here => self%here)
         change = abs(here%t_p)/metric%p_scale
         ! In shares of the scales of p and of y.
         if (change*self%ds > self%longest) self%ds = self%longest/change
         change = metric%size(here%t_y)
         if (change*self%ds > limits%longest_y) self%ds = limits%longest_y/change
         if (self%near%n == 0 .and. allocated(self%pole)) then
            ! By the distance to the nearest pole, and by its width: a resonance there takes
            ! several steps.
            reach = limits%beside_pole*minval(hypot(here%p - self%pole, self%pole_width))
            if (self%ds*abs(here%t_p) > reach) self%ds = reach/abs(here%t_p)
         end if
         self%ds = self%near%bound(self%ds, here%t_p/metric%p_scale, metric%p_scale)
      end associate
   end subroutine limit_step

end module fw_predictor_corrector
