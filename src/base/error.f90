!> Errors are values: a procedure that can fail ends in
!> `type(error_type), allocatable, intent(out) :: error`, allocated only on failure.
!> Each error carries the exit status that the command line will return for it.
module fw_error
   implicit none (type, external)
   private

   public :: error_type, fatal_error
   public :: status_ok, status_failure, status_usage, status_input, status_not_converged, status_io
   public :: status_stopped

   !> Exit statuses; part of the interface contract of `fw_run` and of the C interface.
   integer, parameter :: status_ok = 0
   integer, parameter :: status_failure = 1
   integer, parameter :: status_usage = 2
   integer, parameter :: status_input = 3
   integer, parameter :: status_not_converged = 4
   integer, parameter :: status_io = 5
   !> Ended by the user; what was computed is kept.
   integer, parameter :: status_stopped = 6

   !> What went wrong: where, which value, and the remedy, in one message.
   type :: error_type
      !> What the program ends with; one of the constants above.
      integer :: status = status_failure
      !> What, where, the value, and the remedy.
      character(:), allocatable :: message
   end type error_type

contains

   !> Raise an error with its exit status.
   subroutine fatal_error(error, message, status)
      !> The error to be raised.
      type(error_type), allocatable, intent(out) :: error
      !> What, where, the value found, and the remedy.
      character(*), intent(in) :: message
      !> Exit status (default: status_failure).
      integer, intent(in), optional :: status

      allocate (error)
      error%message = message
      if (present(status)) error%status = status
   end subroutine fatal_error

end module fw_error
