!> Wear from cycle 0 to the end: the control of the steps, and what counts as an end.
!>
!> A step is accepted when it converged and, where the error is controlled, its estimate is within
!> the tolerance; a step that fails is halved, never skipped. Steps aim at a growth of the largest
!> depth, so that they lengthen as the rate decays.
!>
!> A pair that a step makes slip although its start held it stuck may be an artefact of a long step,
!> or of too few harmonics, and what it wears is never given back: such a step is compared with its
!> two halves, and taken only where they give that pair the same depth; else the first half is the
!> next one to be judged. Where it stays, the observer is told.
!>
!> Where steps would have to become all but nothing, a leap (fw_wear_leap) takes the march over the
!> place: the vibration there has a fold, and jumps, or the rates have a kink. Steps of 'bdf' that
!> its integrator does not get done are first tried by the implicit scheme.
!>
!> A joint is steady when the largest rate has fallen to steady_tolerance of the largest so far:
!> no pair both slips and bears. There need not be such a state. The whole joint is in gross slip
!> when every pair that bears also wears, by rates that no longer change although the depth has
!> doubled and exceeds the elastic compression of the pairs: then nothing will stop it.
module fw_wear_march
   use fw_kinds, only: wp
   use fw_resonance, only: resonance_type
   use fw_error, only: error_type
   use fw_solver_options, only: scheme_bdf
   use fw_text, only: to_text
   use fw_wear_bdf, only: bdf_integrator
   use fw_wear_leap, only: leap_over, leap_type, vibration_finder
   use fw_wear_options, only: wear_explicit, wear_options, wear_pseudo_time
   use fw_wear_step, only: is_another, wear_state, wear_step_report, wear_stepper
   use fw_wear_system, only: wear_system
   use fw_wear_touch, only: touch_guard
   use fw_newton, only: solver_report
   implicit none (type, external)
   private

   public :: wear_march, wear_observer
   public :: steady_words, steady_reached, steady_not_reached, steady_gross_slip

   character(*), parameter :: steady_words(*) = &
      [character(16) :: 'reached', 'not reached', 'none: gross slip']
   integer, parameter :: steady_reached = 1, steady_not_reached = 2, steady_gross_slip = 3

   !> Halvings of a step in a row after which the march gives up.
   integer, parameter :: max_halvings = 20
   !> The same for steps in a row that miss the tolerance: far more than a smooth rate takes.
   integer, parameter :: max_inaccurate = 40
   !> Limits of the change of the step from one to the next, and its safety factor.
   real(wp), parameter :: largest_growth = 8.0_wp, smallest_shrink = 0.2_wp, safety = 0.9_wp
   !> Growth of the first step, where only the error is controlled, as a part of the elastic
   !> compression of the pairs.
   real(wp), parameter :: first_growth = 2.0e-2_wp
   !> Difference in the depth of a pair that begins to slip, of a step from its halves, as a part
   !> of the largest depth, that counts as none; and halvings after which the step is taken so.
   real(wp), parameter :: same_depth = 1.0e-3_wp
   integer, parameter :: max_onset_halvings = 12
   !> Wear that the integrator of 'bdf' may take back, as a part of its tolerance.
   real(wp), parameter :: trifle = 1.0e-2_wp
   !> Growth of a step, as a part of the error that it may have, below which it counts as nothing,
   !> and that of a leap.
   real(wp), parameter :: nothing = 1.0e-3_wp, leap_growth = 0.5_wp
   !> An error of depths that the round-off of vibrations hides, as a part of the largest.
   real(wp), parameter :: tightest = 1.0e-10_wp
   !> Change of the rates, as a part of the largest, that counts as none; a pair bears and wears
   !> above these parts of the largest pressure and rate.
   real(wp), parameter :: unchanged = 1.0e-2_wp, bears = 1.0e-6_wp, wears = 1.0e-3_wp

   !> As a finder of vibrations it finds none, unless it knows better.
   type, abstract, extends(vibration_finder) :: wear_observer
   contains
      !> A state of the march, the first included.
      procedure(state_callback), deferred :: take
      procedure :: begin_slip
   end type wear_observer

   type :: wear_march
      type(wear_options) :: options
      type(wear_stepper) :: stepper
      type(resonance_type) :: resonance
      !> Outcome.
      integer :: steady = steady_not_reached
      !> Steps taken, and tried in vain.
      integer :: n_steps = 0
      integer :: n_rejected = 0
      !> A part of something longer: only cycles and a joint that does not wear at all end it.
      logical :: is_part = .false.
      !> All that was asked for has been covered: a steady state, the cycles, or gross slip.
      logical :: complete = .false.
      !> No step was short enough to converge.
      logical :: gave_up = .false.
      !> How the march ended.
      character(:), allocatable :: ending
      !> Step that the error allows next (0: not known yet).
      real(wp) :: next_cycles = 0.0_wp
      !> Where the error is controlled: pairs that are about to touch.
      type(touch_guard) :: touch
      !> Largest rate so far, and depth and rates at which gross slip was last looked for.
      real(wp) :: largest_rate = 0.0_wp
      real(wp) :: checked_depth = 0.0_wp
      real(wp), allocatable :: checked_rate(:)
      !> Pairs that begin to slip in the last step, though its start held them stuck (n_pairs);
      !> steps in which what they wear depends on the step, however short.
      logical, allocatable :: begins(:)
      integer :: n_unsettled = 0
      !> Steps that the integrator of 'bdf' left to the implicit scheme, and leaps, with those over
      !> which the vibration jumped and the cycle at the first of these.
      integer :: n_implicit = 0, n_leaps = 0, n_jumps = 0
      real(wp) :: first_jump = 0.0_wp
      !> The last step is not the one of a longer march, or what it leaves is not all that the next
      !> one needs: who goes on takes it once more.
      logical :: is_provisional = .false.
      type(bdf_integrator), private :: bdf
   contains
      procedure :: run
      procedure :: begin_anew
   end type wear_march

   abstract interface
      subroutine state_callback(self, march, system, state, iterations, go_on, error)
         import :: wear_observer, wear_march, wear_system, wear_state, error_type
         class(wear_observer), intent(inout) :: self
         !> Where it stands: what it needs besides the state to go on.
         class(wear_march), intent(in) :: march
         !> Evaluated at the state.
         type(wear_system), intent(inout) :: system
         type(wear_state), intent(in) :: state
         integer, intent(in) :: iterations
         !> False ends the march.
         logical, intent(out) :: go_on
         type(error_type), allocatable, intent(out) :: error
      end subroutine state_callback
   end interface

contains

   !> Pairs begin to slip that were held stuck: without an observer's own say nothing is made of it.
   subroutine begin_slip(self, march, system, state, error)
      class(wear_observer), intent(inout) :: self
      !> `begins` says which.
      class(wear_march), intent(in) :: march
      type(wear_system), intent(inout) :: system
      !> At the end of the step.
      type(wear_state), intent(in) :: state
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_march => march, unused_system => system, &
                 unused_state => state)
      end associate
   end subroutine begin_slip

   !> Forget an earlier march, but for the options, the stepper and what is known of the resonance.
   subroutine begin_anew(self)
      class(wear_march), intent(inout) :: self

      self%steady = steady_not_reached
      self%n_steps = 0
      self%n_rejected = 0
      self%complete = .false.
      self%gave_up = .false.
      if (allocated(self%ending)) deallocate (self%ending)
      self%next_cycles = 0.0_wp
      self%touch = touch_guard()
      self%largest_rate = 0.0_wp
      self%checked_depth = 0.0_wp
      if (allocated(self%checked_rate)) deallocate (self%checked_rate)
      self%n_unsettled = 0
      self%n_implicit = 0
      self%n_leaps = 0
      self%n_jumps = 0
      self%first_jump = 0.0_wp
      self%is_provisional = .false.
      ! Whoever continues a run from here has no preconditioners from before.
      self%stepper%newton%linear%worth_keeping = .false.
   end subroutine begin_anew

   !> March from a settled state (residual, rates known); the last state is left in it.
   subroutine run(self, system, state, observer, error, resumed)
      class(wear_march), intent(inout), target :: self
      type(wear_system), intent(inout), target :: system
      type(wear_state), intent(inout) :: state
      class(wear_observer), intent(inout) :: observer
      type(error_type), allocatable, intent(out) :: error
      !> The observer has taken this state before (default: no).
      logical, intent(in), optional :: resumed
      type(wear_state) :: after
      integer :: iterations
      logical :: go_on, is_taken

      iterations = 0
      go_on = .true.
      is_taken = .false.
      if (present(resumed)) is_taken = resumed
      do
         if (.not. is_taken) call observer%take(self, system, state, iterations, go_on, error)
         if (allocated(error)) exit
         is_taken = .false.
         call judge(self, system, state)
         if (allocated(self%ending)) exit
         if (.not. go_on) then
            self%ending = 'stopped by its observer'
            exit
         end if
         ! A run that is continued from here has no preconditioners from before either.
         self%stepper%newton%linear%worth_keeping = .false.
         self%begins = spread(.false., 1, size(state%rate))
         self%is_provisional = .false.
         if (self%options%scheme == wear_pseudo_time .and. &
             self%stepper%pseudo_scheme == scheme_bdf) then
            call one_bdf_step(self, observer, system, state, after, iterations, error)
         else
            call one_step(self, observer, system, state, after, iterations, error)
         end if
         if (allocated(error)) exit
         if (any(self%begins) .and. .not. allocated(self%ending)) then
            call observer%begin_slip(self, system, after, error)
            if (allocated(error)) exit
         end if
         ! Between steps: within one the frequency is held (docs/theory.md, Wear).
         if (self%options%follow_resonance .and. .not. (allocated(self%ending) .or. &
             system%is_interrupted())) then
            call self%resonance%follow(self%stepper, system, after, iterations, error)
            if (allocated(error)) exit
         end if
         ! The step at work when the stop came is not taken.
         if (system%is_interrupted()) then
            self%ending = 'stopped by its observer'
            self%gave_up = .false.
         end if
         if (allocated(self%ending)) exit
         state = after
      end do
      call self%bdf%finish()
   end subroutine run

   !> Whether the march ends at this state, and why.
   subroutine judge(self, system, state)
      type(wear_march), intent(inout) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      real(wp) :: rate

      rate = maxval(state%rate)
      self%largest_rate = max(self%largest_rate, rate)
      if (gains(state%rate, system%mean_pressure()) > 0) then
         ! Neither a steady state nor a wear that goes on: the model of the sliding does not hold.
         self%ending = 'pair '//to_text(gains(state%rate, system%mean_pressure()))//' would '// &
                       'gain what it should lose: its vibration is faster than the surface '// &
                       '(contact%speed_1, speed_2), which sliding = ''steady'' leaves out: '// &
                       "take sliding = 'path'"
      else if (rate <= self%options%steady_tolerance*self%largest_rate .and. &
          .not. (self%is_part .and. rate > 0.0_wp)) then
         self%steady = steady_reached
         self%complete = .true.
         if (self%n_steps == 0) then
            self%ending = 'no pair slips under pressure: nothing wears'
            if (system%slides()) then
               self%ending = 'no pair has friction: by energy nothing wears'
            end if
         else
            self%ending = 'steady state after '//to_text(self%n_steps)//' steps'
         end if
      else if (.not. self%is_part .and. in_gross_slip(self, system, state)) then
         self%steady = steady_gross_slip
         self%complete = .true.
         self%ending = 'the whole joint keeps sliding and wears at a constant rate: there is '// &
                       'no steady state'
      else if (state%cycles >= self%options%n_cycles) then
         self%complete = .true.
         self%ending = 'n_cycles reached'
      else if (self%n_steps >= self%options%max_steps) then
         self%ending = 'max_steps = '//to_text(self%options%max_steps)// &
                       ' steps done: raise wear%max_steps or the size of the steps'
      end if
   end subroutine judge

   !> The pair that bears and whose depth falls fastest; 0 where none falls beyond what the rates of
   !> a solution may be off. Friction that turns with the motion has no such pair, that of a side
   !> that slides steadily has where the pressure is high while the pair runs ahead of the surface.
   pure integer function gains(rate, pressure)
      real(wp), intent(in) :: rate(:), pressure(:)

      gains = 0
      if (size(rate) == 0) return
      gains = minloc(rate, dim=1, mask=pressure > bears*maxval(pressure))
      if (gains == 0) return
      if (rate(gains) >= -wears*maxval(abs(rate))) gains = 0
   end function gains

   !> See the module header. Looked for at every doubling of the depth.
   logical function in_gross_slip(self, system, state) result(found)
      type(wear_march), intent(inout) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      real(wp) :: pressure(size(state%rate)), depth
      logical :: changed

      found = .false.
      depth = maxval(state%x(system%n_vibration() + 1:))
      if (allocated(self%checked_rate) .and. depth < 2.0_wp*self%checked_depth) return
      if (depth <= 0.0_wp) return
      ! The first time there is nothing to compare with: the rates are noted, and looked at again
      ! when the depth has doubled.
      changed = .true.
      if (allocated(self%checked_rate)) then
         changed = maxval(abs(state%rate - self%checked_rate)) > unchanged*maxval(state%rate)
      end if
      self%checked_depth = depth
      self%checked_rate = state%rate
      ! Rates of today say nothing of tomorrow while friction is on its way.
      if (changed .or. .not. system%friction_rests(unchanged)) return
      if (depth < system%compression()) return
      pressure = system%mean_pressure()
      ! Every pair wears, or bears nothing.
      found = all(state%rate >= wears*maxval(state%rate) .or. pressure <= bears*maxval(pressure))
   end function in_gross_slip

   !> One accepted step, or an ending.
   subroutine one_step(self, observer, system, state, after, iterations, failure)
      type(wear_march), intent(inout) :: self
      class(wear_observer), intent(inout) :: observer
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      type(wear_state), intent(out) :: after
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: failure
      type(wear_step_report) :: report
      real(wp) :: cycles, error, missed(2), allowed, least
      type(wear_state) :: before
      integer :: halvings, n_inaccurate
      logical :: held(size(state%rate)), refined

      held = is_held(self, system, state)
      call self%touch%look(system)
      allowed = allowed_error(self, system, state)
      least = nothing*allowed/maxval(state%rate)
      before = state
      iterations = 0
      halvings = 0
      n_inaccurate = 0
      missed = 0.0_wp
      cycles = next_step(self, system, state)
      if (self%options%max_depth_step > 0.0_wp) self%stepper%max_depth_step = depth_step(self, &
                                                                                      system, state)
      do
         call self%stepper%advance(system, before, cycles, after, report, refuses=.true.)
         iterations = iterations + report%iterations
         if (report%converged .and. .not. report%is_refused) then
            call confirm(self, system, after, report, iterations)
         end if
         if (system%is_interrupted()) return
         if (.not. report%converged) then
            halvings = halvings + 1
            if (halvings > max_halvings .or. 0.5_wp*cycles <= least) then
               call leap(self, observer, system, state, allowed, held, after, &
                         iterations, failure)
               return
            end if
            if (halvings == 1) call catch_up(self, system, before, iterations)
            self%n_rejected = self%n_rejected + 1
            cycles = 0.5_wp*cycles
            self%next_cycles = cycles
            cycle
         end if
         refined = .false.
         if (.not. report%is_refused) then
            call judge_onset(self, system, before, held, cycles, after, report, iterations, refined)
            if (system%is_interrupted()) return
         end if
         if (refined) then
            call confirm(self, system, after, report, iterations)
            exit
         end if
         if (.not. self%options%controls_error()) exit
         error = maxval(abs(report%error))/ &
                 max(maxval(after%x(system%n_vibration() + 1:)), tiny(1.0_wp))
         ! Whether the step is taken or refused, the next one has this length.
         call adapt(self, cycles, error, missed)
         if (error <= self%options%tolerance()) then
            call self%touch%pass(system, after, cycles, error/self%options%tolerance(), &
                                 self%next_cycles)
            exit
         end if
         call self%touch%retry(system, after, cycles, error/self%options%tolerance(), &
                               self%next_cycles)
         missed = [cycles, error]
         n_inaccurate = n_inaccurate + 1
         self%gave_up = n_inaccurate > max_inaccurate
         if (self%gave_up) then
            call end_inaccurate(self, state, cycles)
            return
         end if
         if (self%next_cycles <= least) then
            call leap(self, observer, system, state, allowed, held, after, &
                         iterations, failure)
            return
         end if
         self%n_rejected = self%n_rejected + 1
         cycles = self%next_cycles
      end do
      ! The growth of the depth then limits the next step alone (next_step).
      if (.not. self%options%controls_error()) self%next_cycles = largest_growth*cycles
      ! What needed short steps may need them again.
      if (refined) self%next_cycles = 2.0_wp*cycles
      self%n_steps = self%n_steps + 1
   end subroutine one_step

   !> Error that the depths of a step from a state may have [length], where the system stands there.
   real(wp) function allowed_error(self, system, state) result(allowed)
      type(wear_march), intent(in) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state

      allowed = self%options%tolerance()*max(maxval(state%x(system%n_vibration() + 1:)), &
                                             first_growth*system%depth_scale())
   end function allowed_error

   !> No step is accurate enough, down to so many cycles.
   subroutine end_inaccurate(self, state, cycles)
      type(wear_march), intent(inout) :: self
      type(wear_state), intent(in) :: state
      real(wp), intent(in) :: cycles

      self%ending = 'no step from cycle '//to_text(state%cycles)//' on is as accurate as '// &
                    'wear%error_tolerance = '//to_text(self%options%tolerance())//', down to '// &
                    to_text(cycles)//' cycles: raise it'
   end subroutine end_inaccurate

   !> From a state over the place that no step passes, or an ending that says so.
   subroutine leap(self, observer, system, before, allowed, held, after, iterations, error)
      type(wear_march), intent(inout) :: self
      class(wear_observer), intent(inout) :: observer
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      !> Error that its depths may have [length].
      real(wp), intent(in) :: allowed
      !> Pairs that are stuck at the start of the step.
      logical, intent(in) :: held(:)
      type(wear_state), intent(out) :: after
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(leap_type) :: asked
      real(wp) :: growth

      asked%allowed = allowed
      growth = leap_growth*asked%allowed
      if (self%options%max_depth_step > 0.0_wp) growth = min(growth, self%options%max_depth_step)
      asked%longest = min(growth/maxval(before%rate), self%options%n_cycles - before%cycles)
      call leap_over(observer, self%stepper, system, before, asked, after, error)
      iterations = iterations + asked%iterations
      if (allocated(error) .or. system%is_interrupted()) return
      self%gave_up = .not. asked%found
      if (self%gave_up .and. asked%exists) then
         call end_inaccurate(self, before, asked%longest)
      else if (self%gave_up) then
         self%ending = 'no step from cycle '//to_text(before%cycles)//' on converges, and no '// &
                       'other vibration was found to which the joint might jump, up to '// &
                       to_text(asked%longest)//' cycles ahead'
      end if
      if (self%gave_up) return
      self%begins = held .and. wears_at(self, after)
      self%n_leaps = self%n_leaps + 1
      if (asked%jumped) then
         self%n_jumps = self%n_jumps + 1
         if (self%n_jumps == 1) self%first_jump = after%cycles
      end if
      self%next_cycles = after%cycles - before%cycles
      self%touch%in_cycles = huge(1.0_wp)
      self%n_steps = self%n_steps + 1
   end subroutine leap

   !> Pairs that bear at a state and do not wear.
   pure function is_held(self, system, state) result(held)
      type(wear_march), intent(in) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      logical :: held(size(state%rate))
      real(wp) :: pressure(size(state%rate))

      pressure = system%mean_pressure()
      held = .not. wears_at(self, state) .and. pressure > bears*maxval(pressure)
   end function is_held

   !> Pairs that wear at a state more than what counts as steady.
   pure function wears_at(self, state) result(worn)
      type(wear_march), intent(in) :: self
      type(wear_state), intent(in) :: state
      logical :: worn(size(state%rate))

      worn = state%rate > self%options%steady_tolerance*self%largest_rate
   end function wears_at

   !> See the module header. The step that is left may be a part of the one that was tried.
   subroutine judge_onset(self, system, before, held, cycles, after, report, iterations, refined)
      type(wear_march), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      !> Pairs that are stuck at the start of the step.
      logical, intent(in) :: held(:)
      !> Of the step.
      real(wp), intent(inout) :: cycles
      type(wear_state), intent(inout) :: after
      type(wear_step_report), intent(inout) :: report
      integer, intent(inout) :: iterations
      !> Whether the step is another one than that which was tried, and to be taken as it is.
      logical, intent(out) :: refined
      type(wear_state) :: half, whole
      integer :: k

      refined = .false.
      self%begins = held .and. wears_at(self, after)
      if (.not. any(self%begins)) return
      do k = 1, max_onset_halvings
         call self%stepper%advance(system, before, 0.5_wp*cycles, half, report)
         iterations = iterations + report%iterations
         if (.not. report%converged .or. system%is_interrupted()) exit
         if (any(held .and. wears_at(self, half))) then
            call self%stepper%advance(system, half, 0.5_wp*cycles, whole, report)
            iterations = iterations + report%iterations
            if (.not. report%converged .or. system%is_interrupted()) exit
            if (is_same(self, system, cycles, after, whole)) then
               after = whole
               refined = .true.
               return
            end if
         end if
         self%n_rejected = self%n_rejected + 1
         refined = .true.
         cycles = 0.5_wp*cycles
         after = half
         self%begins = held .and. wears_at(self, after)
         if (.not. any(self%begins)) return
      end do
      if (system%is_interrupted()) return
      ! No half of it converges, or none is short enough: it is taken, and said.
      self%n_unsettled = self%n_unsettled + 1
      report%converged = .true.
      refined = .true.
      call self%stepper%evaluate(system, after)
   end subroutine judge_onset

   !> Whether a step and its halves agree about the pairs that begin to slip.
   logical function is_same(self, system, cycles, one, two)
      type(wear_march), intent(in) :: self
      type(wear_system), intent(in) :: system
      real(wp), intent(in) :: cycles
      type(wear_state), intent(in) :: one, two
      real(wp) :: difference(size(one%rate))
      integer :: n

      n = system%n_vibration()
      difference = abs(one%x(n + 1:) - two%x(n + 1:))
      ! The explicit scheme wears what slips now in the step to come.
      if (self%options%scheme == wear_explicit) difference = difference + &
                                                             cycles*abs(one%rate - two%rate)
      is_same = maxval(difference, mask=self%begins) <= &
                same_depth*maxval(max(one%x(n + 1:), two%x(n + 1:)))
   end function is_same

   !> One step of the differential-algebraic system: its integrator chooses length and order.
   subroutine one_bdf_step(self, observer, system, state, after, iterations, error)
      type(wear_march), intent(inout), target :: self
      class(wear_observer), intent(inout) :: observer
      type(wear_system), intent(inout), target :: system
      type(wear_state), intent(in) :: state
      type(wear_state), intent(out) :: after
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(wear_step_report) :: report
      type(solver_report) :: solution
      real(wp) :: scale, largest, taken_back
      integer :: n

      report%converged = .true.
      largest = huge(1.0_wp)
      if (self%options%max_depth_step > 0.0_wp) largest = self%options%max_depth_step
      if (.not. self%bdf%is_started()) then
         scale = first_growth*system%depth_scale()
         call self%bdf%start(system, self%stepper%newton%linear, state%x, state%rate, &
                             state%cycles, min(scale, largest)/maxval(state%rate), &
                             self%options%n_cycles, self%options%tolerance(), scale, &
                             report%converged)
      end if
      iterations = 0
      allocate (after%x(size(state%x)))
      if (report%converged .and. self%options%max_depth_step > 0.0_wp) then
         call self%bdf%limit_step(largest/maxval(state%rate), report%converged)
      end if
      if (report%converged) then
         call self%bdf%advance(after%x, after%cycles, iterations, report%converged)
      end if
      if (report%converged) then
         ! Within its tolerance the integrator may take a little wear back; a joint does not. Where
         ! it is more than a trifle the integrator begins anew from what is left.
         n = system%n_vibration()
         taken_back = maxval(state%x(n + 1:) - after%x(n + 1:))
         after%x(n + 1:) = max(after%x(n + 1:), state%x(n + 1:))
         if (taken_back > trifle*self%options%tolerance()*maxval(after%x(n + 1:))) then
            call self%bdf%finish()
            call self%stepper%settle(system, after, solution)
            iterations = iterations + solution%iterations
            report%converged = solution%converged
         else
            call self%stepper%evaluate(system, after)
         end if
         if (report%converged) call confirm(self, system, after, report, iterations)
         ! What the integrator knows of earlier steps is nowhere else.
         if (self%bdf%is_started()) self%is_provisional = .true.
      end if
      if (report%converged) then
         ! The length that a step of another scheme would begin with.
         self%next_cycles = after%cycles - state%cycles
         self%n_steps = self%n_steps + 1
      else if (.not. system%is_interrupted()) then
         call step_implicitly(self, observer, system, state, after, iterations, error)
      end if
   end subroutine one_bdf_step

   !> A step that the integrator did not get done; it begins anew after it.
   subroutine step_implicitly(self, observer, system, state, after, iterations, error)
      type(wear_march), intent(inout), target :: self
      class(wear_observer), intent(inout) :: observer
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      type(wear_state), intent(out) :: after
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(wear_state) :: before
      integer :: more, n_leaps

      call self%bdf%finish()
      self%is_provisional = .false.
      self%gave_up = self%options%tolerance() < tightest
      if (self%gave_up) then
         self%ending = 'wear%error_tolerance = '//to_text(self%options%tolerance())// &
                       ' is below '//to_text(tightest)//', what round-off of the vibration '// &
                       'leaves: raise it'
         return
      end if
      n_leaps = self%n_leaps
      before = state
      call catch_up(self, system, before, iterations)
      call self%stepper%fall_back(.true.)
      call one_step(self, observer, system, before, after, more, error)
      call self%stepper%fall_back(.false.)
      iterations = iterations + more
      if (allocated(error) .or. self%gave_up .or. self%n_leaps > n_leaps) return
      self%n_implicit = self%n_implicit + 1
   end subroutine step_implicitly

   !> Pseudo-time steps leave a residual: a state that looks like the last has to be in equilibrium.
   subroutine confirm(self, system, after, report, iterations)
      type(wear_march), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(inout) :: after
      type(wear_step_report), intent(inout) :: report
      integer, intent(inout) :: iterations
      type(solver_report) :: solution

      if (self%options%scheme /= wear_pseudo_time) return
      if (maxval(after%rate) > self%options%steady_tolerance*self%largest_rate .and. &
          after%cycles < self%options%n_cycles) then
         if (self%n_steps + 1 < self%options%max_steps) return
         ! With more steps it would have been left as it was.
         self%is_provisional = .true.
      end if
      call self%stepper%settle(system, after, solution)
      call self%bdf%forget_derivative()
      iterations = iterations + solution%iterations
      report%converged = solution%converged
   end subroutine confirm

   !> The vibration of a pseudo-time step may lag behind its depths; where no step from there
   !> converges, steps have to start from equilibrium.
   subroutine catch_up(self, system, state, iterations)
      type(wear_march), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(inout) :: state
      integer, intent(inout) :: iterations
      type(wear_state) :: settled
      type(solver_report) :: solution

      if (self%options%scheme /= wear_pseudo_time) return
      settled = state
      call self%stepper%settle(system, settled, solution)
      iterations = iterations + solution%iterations
      if (.not. solution%converged) return
      ! To where the joint would have to jump it does not catch up.
      if (.not. is_another(system, state%x, settled%x)) state = settled
   end subroutine catch_up

   !> Cycles of the next step.
   real(wp) function next_step(self, system, state) result(cycles)
      type(wear_march), intent(in) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      real(wp) :: rate

      rate = maxval(state%rate)
      cycles = self%next_cycles
      if (cycles <= 0.0_wp) then
         cycles = huge(1.0_wp)
         if (self%options%controls_error()) cycles = first_growth*system%depth_scale()/rate
      end if
      if (self%options%max_depth_step > 0.0_wp) then
         cycles = min(cycles, depth_step(self, system, state)/rate)
      end if
      if (cycles >= self%options%n_cycles - state%cycles) then
         cycles = self%options%n_cycles - state%cycles
      else if (2.0_wp*cycles > self%options%n_cycles - state%cycles) then
         ! Two steps of a kind rather than a last one of next to nothing.
         cycles = 0.5_wp*(self%options%n_cycles - state%cycles)
      end if
   end function next_step

   !> Largest growth of the depth in the step from a state.
   pure real(wp) function depth_step(self, system, state)
      type(wear_march), intent(in) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state

      depth_step = max(self%options%max_depth_step, self%options%relative_step* &
                       maxval(state%x(system%n_vibration() + 1:)))
   end function depth_step

   !> The step that the error allows next.
   subroutine adapt(self, cycles, error, missed)
      type(wear_march), intent(inout) :: self
      real(wp), intent(in) :: cycles, error
      !> Cycles and error of the try before, which missed the tolerance; 0 where there was none.
      real(wp), intent(in) :: missed(2)
      real(wp) :: factor, exponent

      ! The power of the step that the estimate goes with; halve_steps counts on the same.
      exponent = real(max(2, self%stepper%order), wp)
      if (self%options%scheme == wear_explicit) exponent = 2.0_wp
      ! Across a kink, as where a pair opens, it goes with less, which a second miss tells.
      if (cycles < missed(1) .and. error > self%options%tolerance()) then
         exponent = min(exponent, max(1.0_wp, log(missed(2)/error)/log(missed(1)/cycles)))
      end if
      factor = largest_growth
      if (error > 0.0_wp) factor = safety*(self%options%tolerance()/error)**(1.0_wp/exponent)
      self%next_cycles = cycles*min(largest_growth, max(smallest_shrink, factor))
   end subroutine adapt

end module fw_wear_march
