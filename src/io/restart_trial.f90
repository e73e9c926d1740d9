!> The result that a run goes on from, tried in a process of its own as model files are.
module fw_restart_trial
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_restart_file, only: read_restart, restart_type
   use fw_trial, only: trial_type, try_file
   implicit none (type, external)
   private

   public :: try_restart

   type, extends(trial_type) :: restart_trial
      type(case_type), pointer :: case => null()
   contains
      procedure :: read => read_in_trial
   end type restart_trial

contains

   !> Refuse the file that `case%restart` names where the library cannot survive it; nothing
   !> where none is named.
   subroutine try_restart(case, error)
      type(case_type), intent(in), target :: case
      type(error_type), allocatable, intent(out) :: error
      type(restart_trial) :: trial

      if (.not. allocated(case%restart)) return
      trial%case => case
      call try_file(trial, case%restart, error)
   end subroutine try_restart

   !> In a process of its own: a damaged file that makes the library crash ends only that.
   subroutine read_in_trial(self, path)
      class(restart_trial), intent(in) :: self
      character(*), intent(in) :: path
      type(restart_type) :: restart
      type(error_type), allocatable :: ignored

      call read_restart(path, self%case, restart, ignored)
   end subroutine read_in_trial

end module fw_restart_trial
