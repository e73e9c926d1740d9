!> The amplitude from which on the stuck motion of a mode slips or separates.
!>
!> What that motion does to a pair only grows with its amplitude. But the position about which a
!> pair vibrates may move: under a static load it slips in the first turns, not in the cycle, and
!> shakes down to another one, in proportion to the amplitude while nothing else begins to. So the
!> onset is looked for between two rows of the curve, of which one is stuck and the next is not,
!> about positions in a straight line, and confirmed by a solution just below.
module fw_mode_onset
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mode_path, only: mode_path
   use fw_mode_system, only: mode_system
   use fw_newton, only: solver_report
   use fw_onset_bracket, only: onset_bracket
   implicit none (type, external)
   private

   public :: onset_finder

   type :: onset_finder
      !> Amplitudes at which the motion is stuck, the highest first, their unknowns (n, 2) and how
      !> many there are; the lowest at which it is not, once there is one.
      real(wp), private :: low(2) = 0.0_wp, high = huge(1.0_wp)
      real(wp), allocatable, private :: y(:, :)
      integer, private :: n_low = 0
      logical, private :: departed = .false.
      !> What departs in rows and solutions above the onset, to begin a search with, and the rows.
      type(onset_bracket), private :: known
      integer, private :: n_above = 0
      !> Shares of stick, slip and separation at rest (3, n_pairs).
      real(wp), allocatable, private :: rest(:, :)
   contains
      procedure :: begin
      procedure :: is_stuck
      procedure :: note
      procedure :: find
   end type onset_finder

   !> Change of the shares of the period that is no round-off of the march.
   real(wp), parameter :: share_change = 1.0e-9_wp
   !> Amplitude over the lowest one at which the motion is that near rest.
   real(wp), parameter :: near_rest = 1.0e-6_wp
   !> Ratios of two amplitudes between which the onset is known well enough: by solutions, to look
   !> at the position there, about positions in a line that is to be confirmed, about those in one
   !> that was, and about a position that is known.
   real(wp), parameter :: rough = 1.0_wp + 4.0e-3_wp, near = 1.0_wp + 1.0e-3_wp, &
                          coarse = 1.0_wp + 1.0e-4_wp, fine = 1.0_wp + 1.0e-13_wp

contains

   !> Take the shares at rest; an amplitude to begin with: the lowest one, or where the motion about
   !> the position at rest is stuck.
   subroutine begin(self, system, y, lowest, amplitude)
      class(onset_finder), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: y(:)
      real(wp), intent(in) :: lowest
      real(wp), intent(out) :: amplitude
      real(wp), parameter :: apart = 1.02_wp, below = 0.99_wp
      real(wp) :: high, low, middle

      amplitude = lowest
      allocate (self%rest(3, system%balance%problem%n_pairs), source=0.0_wp)
      allocate (self%y(size(y), 2), source=0.0_wp)
      if (size(self%rest) == 0) return
      low = near_rest*lowest
      call evaluate(system, low, y)
      call system%balance%pair_shares(self%rest)
      if (departure(self, system, lowest, y) <= 0.0_wp) return
      high = lowest
      do while (high > apart*low)
         middle = sqrt(low*high)
         if (departure(self, system, middle, y) > 0.0_wp) then
            high = middle
         else
            low = middle
         end if
      end do
      amplitude = below*low
   end subroutine begin

   !> Whether all pairs have the shares that they have at rest, where the system stands.
   logical function is_stuck(self, system)
      class(onset_finder), intent(in) :: self
      type(mode_system), intent(in) :: system

      is_stuck = departed_by(self, system) <= 0.0_wp
   end function is_stuck

   !> Largest change of a share from that at rest; none where it is round-off.
   real(wp) function departed_by(self, system)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(in) :: system
      real(wp) :: share(3, size(self%rest, 2))

      departed_by = 0.0_wp
      if (size(share) == 0) return
      call system%balance%pair_shares(share)
      departed_by = maxval(abs(share - self%rest))
      if (departed_by <= share_change) departed_by = 0.0_wp
   end function departed_by

   !> Take a solution of the curve, where the system stands.
   subroutine note(self, system, y)
      class(onset_finder), intent(inout) :: self
      type(mode_system), intent(in) :: system
      real(wp), intent(in) :: y(:)

      if (self%n_above == 2 .or. size(self%rest) == 0) return
      if (self%departed) then
         call self%known%take_above(system%amplitude, departed_by(self, system))
         self%n_above = 2
      else if (is_stuck(self, system)) then
         if (system%amplitude > self%low(1)) call take(self, system%amplitude, y)
      else
         self%departed = .true.
         self%high = system%amplitude
         call self%known%take_above(system%amplitude, departed_by(self, system))
         self%n_above = 1
      end if
   end subroutine note

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
      type(solver_report) :: report
      real(wp) :: high, ratio, y(size(self%y, 1))

      onset = ieee_value(1.0_wp, ieee_quiet_nan)
      if (any(self%rest > share_change .and. self%rest < 1.0_wp - share_change)) then
         onset = 0.0_wp
         return
      end if
      if (.not. self%departed) return
      onset = self%low(1)
      if (self%n_low == 0) return
      high = self%high
      call bisect(self, path%system, near, onset, high)
      y = position(self, onset)
      call path%solve(log(onset), y, report, error)
      if (allocated(error)) return
      if (report%converged .and. is_stuck(self, path%system)) then
         if (report%iterations == 0) then
            ! About the position just below nothing moves any more up to the onset.
            call bisect(self, path%system, fine, onset, high)
            return
         end if
         call take(self, onset, y)
         call close_in(self, path, high, ratio, error)
      else
         self%high = onset
         ratio = coarse
         call come_down(self, path, high, error)
      end if
      if (allocated(error)) return
      onset = self%low(1)
      call bisect(self, path%system, ratio, onset, high)
   end subroutine find

   !> From a solution just below: another one tells how the position moves from there up to `high`,
   !> where the motion departed about positions in the line before.
   subroutine close_in(self, path, high, ratio, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(inout) :: high
      !> What the bracket is worth: all digits where the line down to the row below is one.
      real(wp), intent(out) :: ratio
      type(error_type), allocatable, intent(out) :: error
      integer :: before

      before = path%iterations
      call look(self, path, self%low(1)/rough, error)
      if (allocated(error)) return
      ratio = merge(fine, coarse, path%iterations == before)
      if (departure(self, path%system, high, position(self, high)) <= 0.0_wp) high = self%high
   end subroutine close_in

   !> From a solution just above. The onset is near: what positions in a straight line say is off by
   !> little. Two solutions below it, apart enough to tell how the position moves, save halvings
   !> from the row below.
   subroutine come_down(self, path, high, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(out) :: high
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: below
      integer :: k

      high = self%high
      do k = 1, 2
         below = self%high/rough**k
         if (below <= self%low(2)) exit
         call look(self, path, below, error)
         if (allocated(error)) return
         if (self%high < high) exit
      end do
      call bisect_solutions(self, path, rough, error)
      if (allocated(error)) return
      ! One row tells nothing of how the position moves.
      if (self%n_low < 2) call bisect_solutions(self, path, coarse, error)
      if (allocated(error)) return
      call descend(self, path%system, high)
   end subroutine come_down

   !> By growing steps from a solution above the onset, to where the motion last departs about
   !> positions in a straight line.
   subroutine descend(self, system, high)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(out) :: high
      real(wp) :: trial, ratio

      high = self%high
      ratio = coarse
      do
         trial = high/ratio
         if (trial <= self%low(1)) return
         if (departure(self, system, trial, position(self, trial)) <= 0.0_wp) return
         high = trial
         ratio = ratio**2
      end do
   end subroutine descend

   !> Unknowns of the stuck motion: positions in a straight line.
   function position(self, amplitude) result(y)
      type(onset_finder), intent(in) :: self
      real(wp), intent(in) :: amplitude
      real(wp) :: y(size(self%y, 1))

      y = self%y(:, 1)
      if (self%n_low < 2) return
      y = y + (amplitude - self%low(1))/(self%low(1) - self%low(2))*(y - self%y(:, 2))
   end function position

   !> Where the motion departs about positions in a straight line.
   subroutine bisect(self, system, ratio, low, high)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: ratio
      real(wp), intent(inout) :: low, high
      type(onset_bracket) :: bracket
      real(wp) :: middle

      bracket = self%known
      call bracket%forget_zero()
      bracket%low = low
      bracket%high = high
      do while (bracket%high > ratio*bracket%low)
         middle = bracket%next()
         call bracket%narrow(middle, departure(self, system, middle, position(self, middle)))
      end do
      low = bracket%low
      high = bracket%high
   end subroutine bisect

   !> The same by a solution at each amplitude, where positions follow no straight line but very
   !> near the onset. Towards it two directions settle ever more slowly.
   subroutine bisect_solutions(self, path, ratio, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: ratio
      type(error_type), allocatable, intent(out) :: error

      ! By halves: solutions that lie together tell little of how the position moves.
      do while (self%high > ratio*self%low(1))
         call look(self, path, sqrt(self%low(1)*self%high), error)
         if (allocated(error)) return
      end do
   end subroutine bisect_solutions

   !> Solve at an amplitude, and note on which side of the onset it is.
   subroutine look(self, path, amplitude, error)
      type(onset_finder), intent(inout) :: self
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: departed, y(size(self%y, 1))

      y = position(self, amplitude)
      call path%solve(log(amplitude), y, report, error)
      if (allocated(error)) return
      departed = departed_by(self, path%system)
      if (report%converged .and. departed <= 0.0_wp) then
         call take(self, amplitude, y)
      else if (amplitude > self%low(1)) then
         self%high = amplitude
         if (report%converged) call self%known%take_above(amplitude, departed)
      end if
   end subroutine look

   !> That of a motion.
   real(wp) function departure(self, system, amplitude, y)
      type(onset_finder), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)

      call evaluate(system, amplitude, y)
      departure = departed_by(self, system)
   end function departure

   subroutine evaluate(system, amplitude, y)
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      type(error_type), allocatable :: ignored
      real(wp) :: r(system%n), x(system%n)

      x = y
      call system%set_parameter(log(amplitude), ignored)
      call system%residual(x, r)
   end subroutine evaluate

end module fw_mode_onset
