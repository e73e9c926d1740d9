!> New contacts at the rim of a growing scar. A cell that touches takes its share of the load within
!> a few cycles, so that its rate all but jumps: a step across it is as accurate as what of it lies
!> behind the touch is short, whatever its order. Openings tell when the next pair will touch, and
!> each step across a touch tells how far the next one may go.
module fw_wear_touch
   use fw_kinds, only: wp
   use fw_wear_step, only: wear_state
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: touch_guard

   type :: touch_guard
      !> Depth that may grow behind a touch within one step, as a part of the largest depth; huge
      !> where no step has told it yet.
      real(wp) :: reach = huge(1.0_wp)
      !> Cycles from the last state to the next touch; huge where none is in sight.
      real(wp) :: in_cycles = huge(1.0_wp)
      !> Of the pairs at the last state (n_pairs) [length]: zero where they touch.
      real(wp), allocatable, private :: opening(:)
   contains
      procedure :: look
      procedure :: pass
      procedure :: retry
   end type touch_guard

   !> Change of `reach` in one step.
   real(wp), parameter :: shrink = 0.3_wp, growth = 2.0_wp, safety = 0.9_wp
   !> A step that was refused is cut to this part of it at most.
   real(wp), parameter :: retried = 0.7_wp

contains

   !> Note the openings at the state where the system stands, the start of a step.
   subroutine look(self, system)
      class(touch_guard), intent(inout) :: self
      type(wear_system), intent(in) :: system

      self%opening = system%openings()
   end subroutine look

   !> A step was taken, which may have brought pairs into contact; the next one heeds those to come.
   !> The system stands at its end.
   subroutine pass(self, system, after, cycles, error, next_cycles)
      class(touch_guard), intent(inout) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: after
      !> Of the step, and its error as a part of the one that is allowed.
      real(wp), intent(in) :: cycles, error
      !> The next step by its error; no longer on return.
      real(wp), intent(inout) :: next_cycles
      real(wp) :: rate

      rate = growth_rate(system, after)
      call learn(self, cycles, rate, error)
      call move_on(self, system, cycles)
      if (.not. knows(self)) return
      if (self%in_cycles < next_cycles) then
         next_cycles = min(next_cycles, self%in_cycles + self%reach/rate)
      end if
   end subroutine pass

   !> A step was refused, maybe for what lies behind a touch.
   subroutine retry(self, system, after, cycles, error, next_cycles)
      class(touch_guard), intent(inout) :: self
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: after
      real(wp), intent(in) :: cycles, error
      !> The step to try by its error; longer on return where the touch tells more.
      real(wp), intent(inout) :: next_cycles
      real(wp) :: rate

      rate = growth_rate(system, after)
      call learn(self, cycles, rate, error)
      if (.not. knows(self) .or. self%in_cycles >= cycles) return
      next_cycles = max(next_cycles, min(retried*cycles, self%in_cycles + self%reach/rate))
   end subroutine retry

   !> Whether a touch is in sight, and how far a step may go beyond it.
   pure logical function knows(self)
      type(touch_guard), intent(in) :: self

      knows = self%in_cycles < huge(1.0_wp) .and. self%reach < huge(1.0_wp)
   end function knows

   !> What a step, taken or refused, tells: its error is that of what lies behind the touch.
   pure subroutine learn(self, cycles, rate, error)
      type(touch_guard), intent(inout) :: self
      real(wp), intent(in) :: cycles, rate, error
      real(wp) :: behind

      behind = (cycles - self%in_cycles)*rate
      if (.not. behind > 0.0_wp) return
      self%reach = behind*min(growth, max(shrink, safety/sqrt(max(error, tiny(1.0_wp)))))
   end subroutine learn

   !> How soon the next pair touches, by how much the pairs have closed in a step.
   subroutine move_on(self, system, cycles)
      type(touch_guard), intent(inout) :: self
      type(wear_system), intent(in) :: system
      real(wp), intent(in) :: cycles
      real(wp) :: opening(size(self%opening))
      integer :: i

      opening = system%openings()
      self%in_cycles = huge(1.0_wp)
      do i = 1, size(opening)
         if (opening(i) > 0.0_wp .and. opening(i) < self%opening(i)) then
            self%in_cycles = min(self%in_cycles, &
                                 cycles*opening(i)/(self%opening(i) - opening(i)))
         end if
      end do
      self%opening = opening
   end subroutine move_on

   !> Growth of the largest depth in a cycle, as a part of it.
   pure real(wp) function growth_rate(system, state)
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state

      growth_rate = max(tiny(1.0_wp), maxval(state%rate)/ &
                        max(maxval(state%x(system%n_vibration() + 1:)), tiny(1.0_wp)))
   end function growth_rate

end module fw_wear_touch
