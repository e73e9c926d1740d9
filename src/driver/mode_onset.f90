!> The amplitude from which on the stuck motion of a mode slips or separates.
!>
!> What that motion does to a pair only grows with its amplitude. But the position about which a
!> pair vibrates may move: under a static load it slips in the first turns, not in the cycle, and
!> shakes down to another one, in one direction in proportion to the amplitude while nothing else
!> begins to. So no position of before says where the onset is: it lies between two solutions, of
!> which the lower is stuck and the other, just above, is not.
!>
!> Where the stuck motion has a bound (fw_onset_bound) it is followed up to there, from the first
!> solution and by none of the curve's steps (fw_onset_climb). Where it has none, solutions of the
!> curve are where to begin, and positions in a straight line through two stuck ones say where to
!> look.
module fw_mode_onset
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mode_group, only: onset_at_bound, onset_below, onset_every, onset_none, onset_solutions, &
      onset_stuck, onset_type
   use fw_nonlinear_mode, only: mode_path
   use fw_mode_system, only: mode_system
   use fw_newton, only: solver_report
   use fw_onset_bound, only: find_bound
   use fw_onset_bracket, only: onset_bracket
   use fw_onset_climb, only: climb
   use fw_onset_departure, only: evaluate_motion
   use fw_onset_search, only: coarse, onset_search
   implicit none (type, external)
   private

   public :: onset_finder

   type, extends(onset_search) :: onset_finder
      !> The first stuck solution, and its amplitude.
      real(wp), allocatable, private :: first_y(:)
      real(wp), private :: first = 0.0_wp
      !> Whether a solution of the curve is not stuck, and how many have been noted since.
      logical, private :: departed = .false.
      integer, private :: n_above = 0
      !> Shares that change in solutions above the onset.
      type(onset_bracket), private :: shares
   contains
      procedure :: begin
      procedure :: is_stuck
      procedure :: note
      procedure :: find
   end type onset_finder

   !> Amplitude over the lowest one at which the motion is that near rest.
   real(wp), parameter :: near_rest = 1.0e-6_wp
   !> Ratios of two amplitudes between which the onset is known well enough: about positions in a
   !> line, and about a position that is known.
   real(wp), parameter :: near = 1.0_wp + 1.0e-3_wp, fine = 1.0_wp + 1.0e-13_wp
   !> What the bound is known to, and what is clearly beside it.
   real(wp), parameter :: known = 1.0_wp + 3.0e-6_wp, beside = 1.0_wp + 1.0e-5_wp

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
         if (.not. self%departed) call self%take_above(system, y)
         self%departed = .true.
         self%n_above = self%n_above + 1
         call self%sliding%take_above(system%amplitude, departed)
         call self%shares%take_above(system%amplitude, self%departure%by_shares(system))
      else if (system%amplitude > self%low(1)) then
         if (self%n_low == 0) then
            self%first = system%amplitude
            self%first_y = y
         end if
         call self%take(system%amplitude, y)
      end if
   end subroutine note

   !> NaN where nothing departs up to the highest amplitude, or up to where the curve ended and no
   !> bound leads further; 0 where a pair departs at every amplitude, as one that closes without a
   !> gap or an interference.
   subroutine find(self, path, highest, complete, found, error)
      class(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: highest
      !> Whether the curve came to it.
      logical, intent(in) :: complete
      type(onset_type), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      logical :: bounded

      found%amplitude = ieee_value(1.0_wp, ieee_quiet_nan)
      found%bound = found%amplitude
      if (self%departure%at_every_amplitude()) then
         found%amplitude = 0.0_wp
         found%known_by = onset_every
         return
      end if
      if (size(self%departure%rest) == 0) return
      if (self%n_low == 0) then
         if (self%departed) found%known_by = onset_below
         return
      end if
      if (complete .and. .not. self%departed) return
      call find_bound(path%mode%system, self%first, self%first_y, self%departure%mu, found%bound, &
                      bounded)
      if (bounded) call below_bound(self, path, highest, found, error)
      if (.not. bounded) found%bound = ieee_value(1.0_wp, ieee_quiet_nan)
      if (allocated(error) .or. found%known_by /= onset_none) return
      if (self%departed) call between_rows(self, path, found, error)
   end subroutine find

   !> From the first solution up to the bound.
   subroutine below_bound(self, path, highest, found, error)
      class(onset_finder), intent(in) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: highest
      type(onset_type), intent(inout) :: found
      type(error_type), allocatable, intent(out) :: error
      type(onset_search) :: search
      logical :: reduced, stuck

      search%departure = self%departure
      allocate (search%y(size(self%y, 1), 2), source=0.0_wp)
      call search%take(self%first, self%first_y)
      associate (system => path%mode%system)
         ! As the curve began: with the phase of the stuck motion, whatever its rows have turned to.
         call system%remember(self%first_y)
         reduced = system%reduced
         system%reduced = system%balance%reduced
         call climb(search, path, min(found%bound/beside, highest), stuck, error)
         if (.not. allocated(error)) then
            if (.not. stuck) then
               found%amplitude = search%low(1)
               found%known_by = onset_stuck
               if (search%above <= coarse*coarse*search%low(1)) then
                  found%amplitude = min(found%bound, search%between(system))
                  found%known_by = onset_solutions
               end if
            else if (highest > found%bound) then
               search%high = beside*found%bound
               found%amplitude = search%between(system)
               ! About positions in a line it is known to all digits, but for what slides unseen.
               if (found%amplitude > known*found%bound) found%amplitude = found%bound
               found%known_by = onset_at_bound
            end if
         end if
         system%reduced = reduced
      end associate
   end subroutine below_bound

   !> From the solutions of the curve between which something departs.
   subroutine between_rows(self, path, found, error)
      class(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      type(onset_type), intent(inout) :: found
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      found%known_by = onset_solutions
      call find_first_slip(self, path, found%amplitude, done, error)
      if (allocated(error) .or. done) return
      call close_in(self, path, error)
      if (allocated(error)) return
      found%amplitude = self%low(1)
      if (self%above > self%low(1) .and. self%above <= coarse*coarse*self%low(1)) then
         found%amplitude = self%between(path%mode%system)
      else
         found%known_by = onset_stuck
      end if
   end subroutine between_rows

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
      call bisect(self, path%mode%system, near, onset, high)
      before = path%mode%iterations
      call look(self, path, onset, error)
      if (allocated(error) .or. self%low(1) < onset .or. path%mode%iterations > before) return
      call bisect(self, path%mode%system, fine, onset, high)
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
         call bracket%narrow(middle, by_shares(self, system, middle, self%position(middle)))
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

   !> Solve at an amplitude, and note on which side of the onset it is: from positions in a line,
   !> then in steps, then from above.
   subroutine look(self, path, amplitude, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: reached, y(size(self%y, 1))
      logical :: converged

      y = self%position(amplitude)
      call self%look_from(path, amplitude, y, converged, error)
      if (allocated(error) .or. converged) return
      if (amplitude > self%low(1)) then
         call path%walk%restart(log(self%low(1)), self%y(:, 1))
         call path%reach(log(amplitude), y, report, reached, error)
         if (allocated(error)) return
         if (report%converged .or. exp(reached) > self%low(1)) then
            call self%judge(path%mode%system, exp(reached), y)
            if (report%converged .or. self%high < amplitude) return
         end if
      end if
      y = self%y_above
      call self%look_from(path, amplitude, y, converged, error)
      if (allocated(error) .or. converged) return
      if (amplitude > self%low(1)) self%high = amplitude
   end subroutine look

   !> Largest change of a share in a motion.
   real(wp) function by_shares(self, system, amplitude, y)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)

      call evaluate_motion(system, amplitude, y)
      by_shares = self%departure%by_shares(system)
   end function by_shares

end module fw_mode_onset
