!> The amplitude from which on the stuck motion of a mode slips or separates.
!>
!> What that motion does to a pair only grows with its amplitude. But the position about which a
!> pair vibrates may move: under a static load it slips in the first turns, not in the cycle, and
!> shakes down to another one, in one direction in proportion to the amplitude while nothing else
!> begins to. So no position of before says where the onset is: it lies between two solutions, of
!> which the lower is stuck and the other, just above, is not. Positions in a straight line through
!> two stuck ones say where to look, and what is left between the two.
module fw_mode_onset
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mode_path, only: mode_path
   use fw_mode_system, only: mode_system
   use fw_newton, only: solver_report
   use fw_onset_bound, only: find_bound
   use fw_onset_bracket, only: onset_bracket
   use fw_onset_departure, only: evaluate_motion, onset_departure
   implicit none (type, external)
   private

   public :: onset_finder

   type :: onset_finder
      !> Amplitudes at which the motion is stuck, the highest first, their unknowns (n, 2) and how
      !> many there are; the lowest at which it is not, once there is one.
      real(wp), private :: low(2) = 0.0_wp, high = huge(1.0_wp)
      real(wp), allocatable, private :: y(:, :)
      integer, private :: n_low = 0
      !> A solution that is not stuck, its amplitude, and whether there is one.
      real(wp), allocatable, private :: y_above(:)
      real(wp), private :: above = huge(1.0_wp)
      logical, private :: departed = .false.
      !> What departs in solutions above the onset, to begin a search with: shares and sliding.
      type(onset_bracket), private :: shares, sliding
      integer, private :: n_above = 0
      !> Whether the bound is known, so that what does not converge needs no more trials.
      logical, private :: bounded = .false.
      type(onset_departure), private :: departure
   contains
      procedure :: begin
      procedure :: is_stuck
      procedure :: note
      procedure :: find
   end type onset_finder

   !> Amplitude over the lowest one at which the motion is that near rest.
   real(wp), parameter :: near_rest = 1.0e-6_wp
   !> Ratios of two amplitudes between which the onset is known well enough: about positions in a
   !> line, by solutions, and about a position that is known.
   real(wp), parameter :: near = 1.0_wp + 1.0e-3_wp, coarse = 1.0_wp + 1.0e-4_wp, &
                          fine = 1.0_wp + 1.0e-13_wp
   !> What the bound is known to.
   real(wp), parameter :: beside = 1.0_wp + 1.0e-5_wp

contains

   !> Take the shares at rest; an amplitude to begin with: the lowest one, or where the motion about
   !> the position at rest is stuck.
   subroutine begin(self, system, y, lowest, mu, amplitude)
      class(onset_finder), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: y(:)
      real(wp), intent(in) :: lowest
      !> Friction coefficients (n_pairs).
      real(wp), intent(in) :: mu(:)
      real(wp), intent(out) :: amplitude
      real(wp), parameter :: apart = 1.02_wp, below = 0.99_wp
      real(wp) :: high, low, middle

      amplitude = lowest
      low = near_rest*lowest
      allocate (self%y(size(y), 2), source=0.0_wp)
      call self%departure%begin(system, low, y, mu)
      if (size(mu) == 0) return
      if (by_shares(self, system, lowest, y) <= 0.0_wp) return
      high = lowest
      do while (high > apart*low)
         middle = sqrt(low*high)
         if (by_shares(self, system, middle, y) > 0.0_wp) then
            high = middle
         else
            low = middle
         end if
      end do
      amplitude = below*low
   end subroutine begin

   !> Whether no pair slides within the period, or parts, in a motion where the system stands.
   logical function is_stuck(self, system, y)
      class(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: y(:)
      real(wp) :: amplitude

      ! A copy: the system is brought to this amplitude once more.
      amplitude = system%amplitude
      is_stuck = self%departure%by_sliding(system, amplitude, y) <= 0.0_wp
   end function is_stuck

   !> Take a solution of the curve, where the system stands.
   subroutine note(self, system, y)
      class(onset_finder), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: y(:)
      real(wp) :: amplitude, departed

      if (self%n_above == 2 .or. size(self%departure%rest) == 0) return
      amplitude = system%amplitude
      departed = self%departure%by_sliding(system, amplitude, y)
      if (departed > 0.0_wp .or. self%departed) then
         if (.not. self%departed) call take_above(self, system, y)
         self%departed = .true.
         self%n_above = self%n_above + 1
         call self%sliding%take_above(system%amplitude, departed)
         call self%shares%take_above(system%amplitude, self%departure%by_shares(system))
      else if (system%amplitude > self%low(1)) then
         call take(self, system%amplitude, y)
      end if
   end subroutine note

   subroutine take_above(self, system, y)
      type(onset_finder), intent(inout) :: self
      type(mode_system), intent(in) :: system
      real(wp), intent(in) :: y(:)

      self%high = system%amplitude
      self%above = system%amplitude
      self%y_above = y
   end subroutine take_above

   subroutine take(self, amplitude, y)
      type(onset_finder), intent(inout) :: self
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

   !> NaN where no row departs; 0 where a pair does at every amplitude, as one that closes without a
   !> gap or an interference.
   subroutine find(self, path, onset, error)
      class(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(out) :: onset
      type(error_type), allocatable, intent(out) :: error
      logical :: found, known
      real(wp) :: bound, y(size(self%y, 1))

      onset = ieee_value(1.0_wp, ieee_quiet_nan)
      if (self%departure%at_every_amplitude()) then
         onset = 0.0_wp
         return
      end if
      if (.not. self%departed) return
      onset = self%low(1)
      if (self%n_low == 0) return
      call find_bound(path%system, self%low(1), self%y(:, 1), self%departure%mu, bound, y, known)
      if (.not. known) bound = huge(1.0_wp)
      self%bounded = known
      if (known) call look_at_bound(self, path, bound, y, found, error)
      if (allocated(error)) return
      if (known .and. found) then
         onset = bound
         if (coarse*self%low(1) >= bound) onset = min(bound, between(self, path%system))
         return
      end if
      call find_first_slip(self, path, onset, found, error)
      if (allocated(error) .or. found) return
      call close_in(self, path, error)
      if (allocated(error)) return
      onset = self%low(1)
      if (self%above > self%low(1) .and. self%above <= coarse*coarse*self%low(1)) then
         onset = between(self, path%system)
      end if
      onset = min(bound, onset)
   end subroutine find

   !> Just below the bound of the stuck motion: whether that sticks, or nothing says the contrary.
   !> Solutions that slip below it, though the bound would allow them to stick, show that the
   !> assembly does not lead to what it allows.
   subroutine look_at_bound(self, path, bound, motion, sticks, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: bound
      !> The stuck motion there, to begin with.
      real(wp), intent(in) :: motion(:)
      logical, intent(out) :: sticks
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: below, y(size(motion))

      below = bound/beside
      ! What slips above the bound only leaves nothing to ask.
      sticks = self%high >= bound .or. self%low(1) >= below
      if (self%low(1) < below) then
         y = motion
         call solve_near(path, below, y, report, error)
         if (allocated(error)) return
         if (report%converged) then
            ! What slips below it is another motion then.
            if (self%departure%by_sliding(path%system, below, y) <= 0.0_wp) sticks = .true.
            if (sticks) call judge(self, path%system, below, y)
            sticks = sticks .and. self%low(1) >= below
         end if
      end if
      if (.not. sticks) return
      self%high = beside*bound
      self%above = self%high
   end subroutine look_at_bound

   !> About a position that does not move: the onset to all digits, unless the pair that slips there
   !> shakes down.
   subroutine find_first_slip(self, path, onset, found, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(out) :: onset
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      integer :: before
      real(wp) :: high

      found = .false.
      onset = self%low(1)
      high = self%high
      call bisect(self, path%system, near, onset, high)
      before = path%iterations
      call look(self, path, onset, error)
      if (allocated(error) .or. self%low(1) < onset .or. path%iterations > before) return
      call bisect(self, path%system, fine, onset, high)
      if (self%high > coarse*onset) call look(self, path, coarse*onset, error)
      found = self%high <= coarse*onset*(1.0_wp + epsilon(1.0_wp))
   end subroutine find_first_slip

   !> Where shares of the period change about positions in a straight line.
   subroutine bisect(self, system, ratio, low, high)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: ratio
      real(wp), intent(inout) :: low, high
      type(onset_bracket) :: bracket
      real(wp) :: middle

      bracket = self%shares
      call bracket%forget_zero()
      bracket%low = low
      bracket%high = high
      do while (bracket%high > ratio*bracket%low)
         middle = bracket%next()
         call bracket%narrow(middle, by_shares(self, system, middle, position(self, middle)))
      end do
      low = bracket%low
      high = bracket%high
   end subroutine bisect

   !> By solutions, to a stuck one and one just above that is not.
   subroutine close_in(self, path, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      type(error_type), allocatable, intent(out) :: error
      !> Times that what did not converge is passed over.
      integer, parameter :: most_blind = 4
      integer :: blind

      do blind = 1, most_blind
         call self%sliding%forget_zero()
         do while (self%high > coarse*self%low(1))
            self%sliding%low = self%low(1)
            self%sliding%high = self%high
            call look(self, path, self%sliding%next(), error)
            if (allocated(error)) return
         end do
         if (self%above <= coarse*self%high) return
         ! What did not converge is no proof that nothing sticks above it.
         self%high = self%above
         call look(self, path, sqrt(self%low(1)*self%above), error)
         if (allocated(error)) return
         if (self%high < self%above) return
      end do
   end subroutine close_in

   !> Between two solutions that are near to each other: about positions in a straight line.
   real(wp) function between(self, system) result(onset)
      type(onset_finder), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      type(onset_bracket) :: bracket
      real(wp) :: middle, y(size(self%y, 1))

      bracket = self%sliding
      call bracket%forget_zero()
      bracket%low = self%low(1)
      bracket%high = min(self%high, coarse*self%low(1))
      do while (bracket%high > fine*bracket%low)
         middle = bracket%next()
         y = position(self, middle)
         call bracket%narrow(middle, self%departure%by_sliding(system, middle, y))
      end do
      onset = bracket%low
   end function between

   !> Unknowns of the stuck motion: positions in a straight line.
   function position(self, amplitude) result(y)
      type(onset_finder), intent(in) :: self
      real(wp), intent(in) :: amplitude
      real(wp) :: y(size(self%y, 1))

      y = self%y(:, 1)
      if (self%n_low < 2) return
      y = y + (amplitude - self%low(1))/(self%low(1) - self%low(2))*(y - self%y(:, 2))
   end function position

   !> Solve at an amplitude, and note on which side of the onset it is: from positions in a line,
   !> then in steps, then from above.
   subroutine look(self, path, amplitude, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: reached, y(size(self%y, 1))

      y = position(self, amplitude)
      call solve_near(path, amplitude, y, report, error)
      if (allocated(error)) return
      if (.not. (report%converged .or. self%bounded) .and. amplitude > self%low(1)) then
         call path%restart(log(self%low(1)), self%y(:, 1))
         call path%reach(log(amplitude), y, report, reached, error)
         if (allocated(error)) return
         if (.not. report%converged .and. exp(reached) > self%low(1)) then
            call judge(self, path%system, exp(reached), y)
            if (self%high < amplitude) return
         end if
      end if
      if (.not. report%converged) then
         y = self%y_above
         call solve_near(path, amplitude, y, report, error)
         if (allocated(error)) return
      end if
      if (report%converged) then
         call judge(self, path%system, amplitude, y)
      else if (amplitude > self%low(1)) then
         self%high = amplitude
      end if
   end subroutine look

   !> A solution that is far from its guess may be one of another curve.
   subroutine solve_near(path, amplitude, y, report, error)
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: guess(size(y))

      guess = y
      call path%solve(log(amplitude), y, report, error)
      if (allocated(error)) return
      report%converged = report%converged .and. norm2(y - guess) <= path%leash*norm2(guess)
   end subroutine solve_near

   !> On which side a solution is.
   subroutine judge(self, system, amplitude, y)
      type(onset_finder), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      real(wp) :: departed

      departed = self%departure%by_sliding(system, amplitude, y)
      if (departed <= 0.0_wp) then
         call take(self, amplitude, y)
      else if (amplitude > self%low(1)) then
         self%high = amplitude
         call take_above(self, system, y)
         call self%sliding%take_above(amplitude, departed)
      end if
   end subroutine judge

   !> Largest change of a share in a motion.
   real(wp) function by_shares(self, system, amplitude, y)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)

      call evaluate_motion(system, amplitude, y)
      by_shares = self%departure%by_shares(system)
   end function by_shares

end module fw_mode_onset
