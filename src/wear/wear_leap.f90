!> A step where no other one is short enough: over a fold of the vibration, beyond which the one so
!> far does not exist, or over a kink of the rates.
!>
!> Depths go on by the rates at the start of the step, as in Euler's explicit method, over so few
!> cycles that even those of another vibration stay within the error that a step may have. The
!> vibration at its end is the one next to that before, where there is one; else it is sought anew,
!> as that of an unworn joint is. So a joint whose vibration jumps as it wears, from one branch to
!> another, wears on: the jump takes no time beside the cycles of wear.
module fw_wear_leap
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_wear_step, only: is_another, wear_state, wear_stepper
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: vibration_finder, leap_type, leap_over

   !> Finds a vibration at given depths without knowing one near to it.
   type :: vibration_finder
   contains
      procedure :: find
   end type vibration_finder

   !> What is asked of a leap, and what came of it.
   type :: leap_type
      !> Cycles at most, and the error that the depths may have [length].
      real(wp) :: longest = 0.0_wp, allowed = 0.0_wp
      !> Whether one was found, whether there is a vibration at the end of the shortest one, and
      !> whether it is another one than before.
      logical :: found = .false., exists = .false., jumped = .false.
      integer :: iterations = 0
   end type leap_type

   !> Lengths that are tried, each a quarter of the one before: with the vibration next to that
   !> before alone, then with any. A joint does not jump for want of one of Newton's steps.
   integer, parameter :: n_near = 4, n_any = 8

contains

   !> Without one who knows how, none is found.
   subroutine find(self, system, x, found, iterations, error)
      class(vibration_finder), intent(inout) :: self
      !> Its vibration has the depths, which are held.
      type(wear_system), intent(inout) :: system
      !> Unknowns of the vibration.
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: found
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_system => system, unused_x => x)
      end associate
      found = .false.
      iterations = 0
   end subroutine find

   !> The longest leap from a state that is as accurate as is asked for.
   subroutine leap_over(finder, stepper, system, before, leap, after, error)
      class(vibration_finder), intent(inout) :: finder
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      type(leap_type), intent(inout) :: leap
      type(wear_state), intent(out) :: after
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: cycles
      integer :: k

      do k = 1, n_near + n_any
         cycles = leap%longest*0.25_wp**(k - merge(1, n_near + 1, k <= n_near))
         call go_ahead(finder, stepper, system, before, cycles, k > n_near, leap, after, error)
         if (allocated(error) .or. system%is_interrupted()) return
         leap%found = leap%exists
         if (leap%exists) leap%found = 0.5_wp*cycles*maxval(abs(after%rate - before%rate)) <= &
                                  leap%allowed
         if (leap%found) exit
      end do
      ! Over growth of a part in a thousand or less a vibration changes by about as much.
      if (leap%found) leap%jumped = is_another(system, before%x, after%x)
   end subroutine leap_over

   !> Depths after some cycles at the rates of a state, and a vibration at these.
   subroutine go_ahead(finder, stepper, system, before, cycles, any_will_do, leap, after, error)
      class(vibration_finder), intent(inout) :: finder
      type(wear_stepper), intent(inout) :: stepper
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      !> Whether another vibration than the one before is sought where that has none beside it.
      logical, intent(in) :: any_will_do
      type(leap_type), intent(inout) :: leap
      type(wear_state), intent(out) :: after
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: solution
      integer :: iterations, n

      n = system%n_vibration()
      after = before
      after%cycles = before%cycles + cycles
      after%x(n + 1:) = before%x(n + 1:) + cycles*before%rate
      call stepper%settle(system, after, solution)
      leap%iterations = leap%iterations + solution%iterations
      leap%exists = solution%converged
      ! What Newton's method finds may be another one too.
      if (leap%exists .and. .not. any_will_do) leap%exists = .not. is_another(system, before%x, &
                                                                              after%x)
      if (leap%exists .or. .not. any_will_do .or. system%is_interrupted()) return
      after%x(:n) = before%x(:n)
      system%vibration%depth = after%x(n + 1:)
      call system%hold_depths(.true.)
      call finder%find(system, after%x(:n), leap%exists, iterations, error)
      call system%hold_depths(.false.)
      leap%iterations = leap%iterations + iterations
      if (allocated(error) .or. .not. leap%exists) return
      ! For its rates: it starts where it ends.
      call stepper%settle(system, after, solution)
      leap%exists = solution%converged
   end subroutine go_ahead

end module fw_wear_leap
