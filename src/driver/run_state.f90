!> How far a run has come, and with which status it ends.
module fw_run_state
   use fw_error, only: status_not_converged, status_ok, status_stopped
   use fw_point, only: point_type
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: run_state, outcome_type

   type :: run_state
      !> Points that count, and those of them that converged.
      integer :: n_points = 0
      integer :: n_converged = 0
      !> The run ended before it had covered what was asked for.
      logical :: is_incomplete = .false.
      !> Somebody asked for its end.
      logical :: was_stopped = .false.
   contains
      procedure :: note
      procedure :: all_converged
      procedure :: status
      procedure :: words
   end type run_state

   !> What a run leaves besides its result file.
   type :: outcome_type
      !> status_ok, status_not_converged, or status_stopped where the observer ended the run.
      integer :: status = status_ok
      !> Its time was over (case%max_seconds).
      logical :: out_of_time = .false.
      !> A short table for people, one line each.
      type(string_type), allocatable :: summary(:)
   end type outcome_type

contains

   !> Take a point into account.
   pure subroutine note(self, point)
      class(run_state), intent(inout) :: self
      type(point_type), intent(in) :: point

      self%n_points = self%n_points + 1
      if (point%converged) self%n_converged = self%n_converged + 1
   end subroutine note

   !> Whether every point so far converged; true before the first.
   pure logical function all_converged(self)
      class(run_state), intent(in) :: self

      all_converged = self%n_converged == self%n_points
   end function all_converged

   !> A stop that came too late to leave anything out is none: then the points decide.
   pure integer function status(self)
      class(run_state), intent(in) :: self

      status = status_ok
      if (self%is_incomplete .or. .not. self%all_converged()) status = status_not_converged
      if (self%is_incomplete .and. self%was_stopped) status = status_stopped
   end function status

   !> What a result file says of a run that came to its end.
   pure function words(self)
      class(run_state), intent(in) :: self
      character(13) :: words

      select case (self%status())
      case (status_ok)
         words = 'complete'
      case (status_stopped)
         words = 'stopped'
      case default
         words = 'not converged'
      end select
   end function words

end module fw_run_state
