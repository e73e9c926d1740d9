!> Excitation that stays at a resonance: the frequency at which the first observed quantity is
!> largest, at given wear depths.
!>
!> A peak is bracketed from the present frequency and then approached by the vertex of the parabola
!> through three frequencies, or by a golden section where that makes the bracket no smaller. Every
!> solution starts from that at the best frequency so far. Once the amplitude falls by no more than
!> `flat` to the ends of the bracket, the vertex is the answer: what a parabola leaves out is then
!> of the order of `flat`, relative to the half-width of the resonance. The next search starts with
!> frequencies so close that three solutions, of a few iterations each, are the rule.
module fw_resonance
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_recovery, only: recover_point
   use fw_wear_options, only: follow_range
   use fw_wear_step, only: wear_state, wear_stepper
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: resonance_type

   real(wp), parameter :: flat = 2.0e-3_wp
   !> Frequencies tried at most on the way up and within the bracket.
   integer, parameter :: max_climb = 40, max_refinements = 30
   !> First distance of two frequencies, and its limits, as parts of the frequency.
   real(wp), parameter :: first_spacing = 1.0e-3_wp
   real(wp), parameter :: least_spacing = 1.0e-7_wp, largest_spacing = 2.0e-2_wp
   !> The next search starts with frequencies between which the amplitude falls by this part.
   real(wp), parameter :: next_drop = 5.0e-4_wp
   real(wp), parameter :: climb_factor = 2.0_wp, golden = 0.381966011250105_wp
   !> A bracket that was not reduced to this part by two parabolas is cut by a golden section.
   real(wp), parameter :: slow = 0.5_wp
   !> Frequencies keep at least this part of the bracket apart.
   real(wp), parameter :: closest = 5.0e-2_wp

   !> The vibration at one frequency; an amplitude below zero: it did not converge.
   type :: trial_type
      real(wp) :: omega = 0.0_wp, amplitude = -1.0_wp
      type(wear_state) :: state
   end type trial_type

   type :: resonance_type
      !> Distance of the frequencies that the next search starts with [rad/s] (0: not known yet).
      real(wp) :: spacing = 0.0_wp
      !> Harmonics that the amplitude is made of.
      integer :: n_harmonics = 1
      !> Frequency that the range is counted from [rad/s].
      real(wp) :: first = 0.0_wp
   contains
      procedure :: follow
   end type resonance_type

contains

   !> Move the frequency of the system, and the vibration of the state, to the resonance at the
   !> depths of the state. Where no frequency nearby has a larger amplitude both stay.
   subroutine follow(self, stepper, system, state, iterations, error)
      class(resonance_type), intent(inout) :: self
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(inout) :: state
      !> Grows by those of the search.
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(trial_type) :: low, best, high
      type(solver_report) :: report

      best%omega = system%vibration%frequency()
      best%state = state
      ! The system stands at the state already.
      best%amplitude = amplitude_of(self, system, state)
      if (self%first <= 0.0_wp) self%first = best%omega
      ! Later searches start with what the last parabola has told.
      if (self%spacing <= 0.0_wp) self%spacing = first_spacing*best%omega
      call bracket(self, stepper, system, low, best, high, iterations, error)
      if (allocated(error)) return
      call refine(self, stepper, system, low, best, high, iterations, error)
      if (allocated(error)) return
      self%spacing = spacing_of(low, best, high, self%spacing)
      call take_vertex(self, stepper, system, low, best, high, iterations, error)
      if (.not. allocated(error)) call system%set_parameter(best%omega, error)
      if (allocated(error)) return
      ! The system is left at the best: its forces are those of this very state.
      call stepper%settle(system, best%state, report)
      iterations = iterations + report%iterations
      state = best%state
   end subroutine follow

   !> Three frequencies of which the middle one has the largest amplitude, or the end of the range.
   subroutine bracket(self, stepper, system, low, best, high, iterations, error)
      type(resonance_type), intent(in) :: self
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(trial_type), intent(out) :: low, high
      type(trial_type), intent(inout) :: best
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: spacing
      integer :: i

      ! Both neighbours first, then on towards the higher side with growing strides.
      spacing = self%spacing
      call try(self, stepper, system, best, best%omega + spacing, high, iterations, error)
      if (.not. allocated(error)) then
         call try(self, stepper, system, best, best%omega - spacing, low, iterations, error)
      end if
      do i = 1, max_climb
         if (allocated(error) .or. system%is_interrupted()) return
         spacing = climb_factor*spacing
         if (high%amplitude > best%amplitude .and. high%amplitude >= low%amplitude) then
            low = best
            best = high
            call try(self, stepper, system, best, best%omega + spacing, high, iterations, error)
         else if (low%amplitude > best%amplitude) then
            high = best
            best = low
            call try(self, stepper, system, best, best%omega - spacing, low, iterations, error)
         else
            exit
         end if
      end do
   end subroutine bracket

   !> Narrow the bracket until the amplitude is flat in it.
   subroutine refine(self, stepper, system, low, best, high, iterations, error)
      type(resonance_type), intent(in) :: self
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(trial_type), intent(inout) :: low, best, high
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(trial_type) :: trial
      real(wp) :: omega, width(2)
      integer :: i

      width = huge(1.0_wp)
      do i = 1, max_refinements
         if (min(low%amplitude, high%amplitude) >= (1.0_wp - flat)*best%amplitude) exit
         ! Closer, differences of the amplitude would be round-off and tolerance.
         if (high%omega - low%omega <= 2.0_wp*least_spacing*best%omega) exit
         omega = vertex(low, best, high)
         if (high%omega - low%omega > slow*width(1)) then
            if (high%omega - best%omega > best%omega - low%omega) then
               ! A chord has the slope that the parabola has in the middle of its interval, and
               ! that slope is linear: from the middle of the lower interval it falls by 2
               ! curvature per frequency.
               omega = best%omega + golden*(high%omega - best%omega)
            else
               omega = best%omega - golden*(best%omega - low%omega)
            end if
         end if
         ! Two frequencies that coincide span no parabola.
         if (abs(omega - best%omega) < closest*(high%omega - low%omega)) then
            omega = best%omega + sign(closest*(high%omega - low%omega), &
                                      high%omega + low%omega - 2.0_wp*best%omega)
         end if
         width = [width(2), high%omega - low%omega]
         call try(self, stepper, system, best, omega, trial, iterations, error)
         if (allocated(error) .or. system%is_interrupted()) return
         if (trial%amplitude > best%amplitude) then
            if (trial%omega > best%omega) low = best
            if (trial%omega < best%omega) high = best
            best = trial
         else if (trial%omega > best%omega) then
            high = trial
         else
            low = trial
         end if
      end do
   end subroutine refine

   !> Go to the vertex of the last parabola, where the bracket has shown it to be a peak.
   subroutine take_vertex(self, stepper, system, low, best, high, iterations, error)
      type(resonance_type), intent(in) :: self
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(trial_type), intent(in) :: low, high
      type(trial_type), intent(inout) :: best
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(trial_type) :: trial

      ! An end of the range, or a frequency without solution: the best point stays.
      if (min(low%amplitude, high%amplitude) < (1.0_wp - flat)*best%amplitude) return
      call try(self, stepper, system, best, vertex(low, best, high), trial, iterations, error)
      if (trial%amplitude >= 0.0_wp) best = trial
   end subroutine take_vertex

   !> Frequency of the vertex of the parabola through three points; the middle one where it has
   !> none.
   pure real(wp) function vertex(low, best, high) result(omega)
      type(trial_type), intent(in) :: low, best, high
      real(wp) :: slope_low, slope_high, curvature

      slope_low = (best%amplitude - low%amplitude)/(best%omega - low%omega)
      slope_high = (high%amplitude - best%amplitude)/(high%omega - best%omega)
      curvature = (slope_high - slope_low)/(high%omega - low%omega)
      omega = best%omega
      if (curvature < 0.0_wp) omega = 0.5_wp*(low%omega + best%omega - slope_low/curvature)
   end function vertex

   !> The vibration at another frequency, from that of a neighbour.
   subroutine try(self, stepper, system, from, omega, trial, iterations, error)
      type(resonance_type), intent(in) :: self
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(trial_type), intent(in) :: from
      real(wp), intent(in) :: omega
      type(trial_type), intent(out) :: trial
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report

      trial%omega = omega
      trial%state = from%state
      ! Outside of the range: an amplitude below zero, as of a solution that failed.
      if (omega < follow_range(1)*self%first .or. omega > follow_range(2)*self%first) return
      call system%set_parameter(omega, error)
      if (allocated(error)) return
      call stepper%settle(system, trial%state, report)
      iterations = iterations + report%iterations
      if (report%converged) trial%amplitude = amplitude_of(self, system, trial%state)
   end subroutine try

   !> Largest displacement of the first observed quantity [length].
   real(wp) function amplitude_of(self, system, state) result(amplitude)
      type(resonance_type), intent(in) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      type(point_type) :: point

      call recover_point(system%vibration, state%x(:system%n_vibration()), self%n_harmonics, &
                         .false., point)
      amplitude = point%amplitude(1)
   end function amplitude_of

   !> Distance at which the amplitude falls by next_drop, as the last three frequencies tell.
   pure real(wp) function spacing_of(low, best, high, before) result(spacing)
      type(trial_type), intent(in) :: low, best, high
      real(wp), intent(in) :: before
      real(wp) :: curvature

      spacing = before
      if (min(low%amplitude, high%amplitude) < 0.0_wp) return
      curvature = ((high%amplitude - best%amplitude)/(high%omega - best%omega) - &
                   (best%amplitude - low%amplitude)/(best%omega - low%omega))/ &
                  (high%omega - low%omega)
      ! Beside the vertex the amplitude is that of the vertex + curvature d**2.
      if (curvature < 0.0_wp) spacing = sqrt(next_drop*best%amplitude/(-curvature))
      spacing = min(max(spacing, least_spacing*best%omega), largest_spacing*best%omega)
   end function spacing_of

end module fw_resonance
