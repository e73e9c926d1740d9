!> What a solver looks at now and then to see whether it is to end: somebody asked for that, or a
!> limit of time has passed. Looking costs next to nothing, so that every iteration can.
!>
!> A solver that ends for this reason says `interrupted` in its report: neither an error nor a
!> verdict on the point.
module fw_interrupt
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_error, only: error_type, fatal_error, status_stopped
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: interrupt_type, must_end, stop_run

   integer(int64), parameter :: never = huge(1_int64)

   type :: interrupt_type
      !> The run is to end, with what is done so far.
      logical :: stop_requested = .false.
      !> Points that are enough: less than all of them where another run has taken over the rest.
      integer :: n_wanted = huge(1)
      !> Why a law of the user has asked for the end; blank where none has.
      character(400) :: demand = ''
      !> The time of the whole run was over.
      logical :: run_out = .false.
      !> Readings of the clock at which the run and the present point are to end.
      integer(int64), private :: run_end = never, point_end = never
   contains
      procedure :: poll
      procedure :: is_stopping
      procedure :: is_due
      procedure :: limit_run
      procedure :: limit_point
   end type interrupt_type

contains

   !> Look outside, and set stop_requested where somebody asks for the end: nobody by default.
   subroutine poll(self)
      class(interrupt_type), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine poll

   !> Whether the run is to end.
   logical function is_stopping(self)
      class(interrupt_type), intent(inout) :: self
      integer(int64) :: clock

      call self%poll()
      if (self%run_end < never) then
         call system_clock(clock)
         self%run_out = self%run_out .or. clock >= self%run_end
         self%stop_requested = self%stop_requested .or. self%run_out
      end if
      is_stopping = self%stop_requested .or. self%demand /= ''
   end function is_stopping

   !> Whether the run, or only the present point, is to end.
   logical function is_due(self)
      class(interrupt_type), intent(inout) :: self
      integer(int64) :: clock

      is_due = self%is_stopping()
      if (is_due .or. self%point_end == never) return
      call system_clock(clock)
      is_due = clock >= self%point_end
   end function is_due

   !> The run may take this long from now on [s] (0: as long as it likes).
   subroutine limit_run(self, seconds)
      class(interrupt_type), intent(inout) :: self
      real(wp), intent(in) :: seconds

      self%run_out = .false.
      self%run_end = clock_after(seconds)
   end subroutine limit_run

   !> The same for the present point.
   subroutine limit_point(self, seconds)
      class(interrupt_type), intent(inout) :: self
      real(wp), intent(in) :: seconds

      self%point_end = clock_after(seconds)
   end subroutine limit_point

   integer(int64) function clock_after(seconds)
      real(wp), intent(in) :: seconds
      integer(int64) :: clock, rate

      clock_after = never
      if (seconds <= 0.0_wp) return
      call system_clock(clock, rate)
      if (seconds*real(rate, wp) < 0.5_wp*real(never - clock, wp)) then
         clock_after = clock + int(seconds*real(rate, wp), int64)
      end if
   end function clock_after

   !> The same of an interrupt that need not be there.
   logical function must_end(interrupt)
      class(interrupt_type), pointer, intent(in) :: interrupt

      must_end = .false.
      if (associated(interrupt)) must_end = interrupt%is_due()
   end function must_end

   !> How procedures without a report hand on that the run is to end; the loop over the points takes
   !> it for what it is.
   subroutine stop_run(interrupt, error)
      class(interrupt_type), pointer, intent(in) :: interrupt
      type(error_type), allocatable, intent(out) :: error

      if (.not. associated(interrupt)) return
      if (.not. interrupt%is_stopping()) return
      if (interrupt%demand /= '') then
         call fatal_error(error, trim(interrupt%demand))
      else
         call fatal_error(error, 'stopped', status_stopped)
      end if
   end subroutine stop_run

end module fw_interrupt
