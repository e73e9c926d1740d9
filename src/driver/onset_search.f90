!> A search for the amplitude at which the stuck motion of a mode ends: stuck solutions below it,
!> and what departs, or does not converge, above.
module fw_onset_search
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_nonlinear_mode, only: mode_path
   use fw_mode_system, only: mode_system
   use fw_newton, only: solver_report
   use fw_onset_bracket, only: onset_bracket
   use fw_onset_departure, only: onset_departure
   implicit none (type, external)
   private

   public :: onset_search, coarse

   type :: onset_search
      !> Amplitudes at which the motion is stuck, the highest first, their unknowns (n, 2) and how
      !> many there are; the lowest at which it is not, once there is one.
      real(wp) :: low(2) = 0.0_wp, high = huge(1.0_wp)
      real(wp), allocatable :: y(:, :)
      integer :: n_low = 0
      !> A solution that is not stuck, and its amplitude, once there is one.
      real(wp), allocatable :: y_above(:)
      real(wp) :: above = huge(1.0_wp)
      !> What slides in solutions above the onset.
      type(onset_bracket) :: sliding
      type(onset_departure) :: departure
   contains
      procedure :: take
      procedure :: take_above
      procedure :: look_from
      procedure :: judge
      procedure :: position
      procedure :: between
   end type onset_search

   !> Ratios of two amplitudes between which the onset is known well enough: by solutions, and about
   !> a position that is known.
   real(wp), parameter :: coarse = 1.0_wp + 1.0e-4_wp, fine = 1.0_wp + 1.0e-13_wp

contains

   !> A solution that is stuck.
   subroutine take(self, amplitude, y)
      class(onset_search), intent(inout) :: self
      real(wp), intent(in) :: amplitude, y(:)

      if (amplitude > self%low(1)) then
         self%low = [amplitude, self%low(1)]
         self%y(:, 2) = self%y(:, 1)
         self%y(:, 1) = y
      else if (amplitude > self%low(2)) then
         self%low(2) = amplitude
         self%y(:, 2) = y
      end if
      self%n_low = self%n_low + 1
   end subroutine take

   !> A solution that is not, where the system stands.
   subroutine take_above(self, system, y)
      class(onset_search), intent(inout) :: self
      type(mode_system), intent(in) :: system
      real(wp), intent(in) :: y(:)

      self%high = system%amplitude
      self%above = system%amplitude
      self%y_above = y
   end subroutine take_above

   !> Solve at an amplitude from a guess, which becomes the solution, and note on which side of the
   !> onset that is. A solution that is far from its guess may be one of another curve.
   subroutine look_from(self, path, amplitude, y, converged, error)
      class(onset_search), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      real(wp), intent(inout), contiguous :: y(:)
      logical, intent(out) :: converged
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: guess(size(y))

      guess = y
      converged = .false.
      call path%solve(log(amplitude), y, report, error)
      if (allocated(error)) return
      converged = report%converged .and. norm2(y - guess) <= path%mode%leash*norm2(guess)
      if (converged) call self%judge(path%mode%system, amplitude, y)
   end subroutine look_from

   !> On which side a solution is.
   subroutine judge(self, system, amplitude, y)
      class(onset_search), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      real(wp) :: departed

      departed = self%departure%by_sliding(system, amplitude, y)
      if (departed <= 0.0_wp) then
         call self%take(amplitude, y)
      else if (amplitude > self%low(1)) then
         call self%take_above(system, y)
         call self%sliding%take_above(amplitude, departed)
      end if
   end subroutine judge

   !> Unknowns of the stuck motion: positions in a straight line.
   function position(self, amplitude) result(y)
      class(onset_search), intent(in) :: self
      real(wp), intent(in) :: amplitude
      real(wp) :: y(size(self%y, 1))

      y = self%y(:, 1)
      if (self%n_low < 2) return
      y = y + (amplitude - self%low(1))/(self%low(1) - self%low(2))*(y - self%y(:, 2))
   end function position

   !> Between two solutions that are near to each other: about positions in a straight line.
   real(wp) function between(self, system) result(onset)
      class(onset_search), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      type(onset_bracket) :: bracket
      real(wp) :: middle, y(size(self%y, 1))

      bracket = self%sliding
      call bracket%forget_zero()
      bracket%low = self%low(1)
      bracket%high = min(self%high, coarse*self%low(1))
      do while (bracket%high > fine*bracket%low)
         middle = bracket%next()
         y = self%position(middle)
         call bracket%narrow(middle, self%departure%by_sliding(system, middle, y))
      end do
      onset = bracket%low
   end function between

end module fw_onset_search
