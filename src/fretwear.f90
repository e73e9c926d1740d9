!> Everything that a program in Fortran needs of the library, behind one `use fretwear`.
!>
!> A `session_type` takes a namelist, single keys and a model in memory, and runs the case as a
!> whole or frequency by frequency; what it computes is in its list of points. Underneath stand
!> `read_case` and `run_case`, which are what the program fw_run consists of.
!>
!> Errors are values: `type(error_type), allocatable :: error` is allocated where a call failed,
!> with the message in `error%message` and one of the statuses below in `error%status`. Nothing
!> prints, and nothing ends the program. Sessions are independent of each other: one for each
!> thread.
!>
!> Modules of other names (`fw_...`) are installed because these need them; they may change from
!> version to version.
module fretwear
   ! A case that lives in the calling program; see docs/library.md.
   use fw_session, only: session_type
   ! A case as data, from a namelist, and run with a result file.
   use fw_case, only: case_type
   use fw_run_state, only: outcome_type
   use fw_read_case, only: read_case, read_case_text
   use fw_run, only: check_case, run_case
   ! Laws of one's own: extend the abstract type, `session%add_law`.
   use fw_user_element, only: user_call, user_law_type
   ! Progress, messages and stops: extend the abstract type, or take the silent one.
   use fw_observer, only: observer_type, silent_observer
   ! What is known of a solution point.
   use fw_point, only: point_type
   ! Errors and statuses.
   use fw_error, only: error_type, status_failure, status_input, status_io, status_not_converged, &
      status_ok, status_stopped, status_usage
   ! The kind of every real, a text of its own length, and the version of the library.
   use fw_kinds, only: wp
   use fw_text, only: string_type
   use fw_version, only: version
   implicit none (type, external)
   private

   public :: session_type
   public :: user_call, user_law_type
   public :: case_type, outcome_type, read_case, read_case_text, check_case, run_case
   public :: observer_type, silent_observer, point_type
   public :: error_type, status_ok, status_failure, status_usage, status_input
   public :: status_not_converged, status_io, status_stopped
   public :: wp, string_type, version

end module fretwear
