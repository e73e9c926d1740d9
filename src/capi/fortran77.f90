! The layer for Fortran 77: external subroutines with names of up to six letters, default INTEGER
! and DOUBLE PRECISION arguments, and texts of any length, of which blanks at the end do not count.
! A handle is an INTEGER. ISTAT is 0 or one of the statuses of fw_error; FWMSG has the words.
! Texts are trimmed on the way in and filled with blanks on the way out: blanks at the end cannot be
! part of a name here. Arrays are of assumed size with N beside them, of which a negative one counts
! as none.
! Points and frequencies count from 1; 0 is the last point, but no frequency. docs/library.md lists
! the routines.

!> Create a handle.
!> HANDLE is 0 where none is left.
subroutine fwnew(handle, istat)
   use fw_handles, only: new_handle
   implicit none (type, external)
   integer, intent(out) :: handle, istat

   istat = new_handle(handle)
end subroutine fwnew

!> Destroy a handle.
subroutine fwfree(handle, istat)
   use fw_handles, only: delete_handle
   implicit none (type, external)
   integer, intent(inout) :: handle
   integer, intent(out) :: istat

   istat = delete_handle(handle)
   ! So that a second FWFREE is refused instead of hitting the next owner of the number.
   handle = 0
end subroutine fwfree

!> What the last call that failed had to say, cut or filled with blanks.
subroutine fwmsg(handle, text)
   use fw_calls, only: call_message
   implicit none (type, external)
   integer, intent(in) :: handle
   character(*), intent(out) :: text
   character(:), allocatable :: message

   call call_message(handle, message)
   text = message
end subroutine fwmsg

!> Version of the library.
subroutine fwvers(text)
   use fw_version, only: version
   implicit none (type, external)
   character(*), intent(out) :: text

   text = version
end subroutine fwvers

!> Take the namelist of a file.
!> Names of files in it count from its folder; the keys set before stay on top of it.
subroutine fwload(handle, path, istat)
   use fw_calls, only: call_load_file
   implicit none (type, external)
   integer, intent(in) :: handle
   character(*), intent(in) :: path
   integer, intent(out) :: istat

   istat = call_load_file(handle, trim(path))
end subroutine fwload

!> Set a key, such as 'solver%kind' to 'newton'.
subroutine fwset(handle, key, value, istat)
   use fw_calls, only: call_set
   implicit none (type, external)
   integer, intent(in) :: handle
   character(*), intent(in) :: key, value
   integer, intent(out) :: istat

   istat = call_set(handle, trim(key), trim(value))
end subroutine fwset

!> Set a key to a number.
subroutine fwsetd(handle, key, value, istat)
   use fw_calls, only: call_set
   use fw_text, only: to_text
   implicit none (type, external)
   integer, intent(in) :: handle
   character(*), intent(in) :: key
   double precision, intent(in) :: value
   integer, intent(out) :: istat

   istat = call_set(handle, trim(key), to_text(value))
end subroutine fwsetd

!> Set a key to a whole number.
subroutine fwseti(handle, key, value, istat)
   use fw_calls, only: call_set
   use fw_text, only: to_text
   implicit none (type, external)
   integer, intent(in) :: handle, value
   character(*), intent(in) :: key
   integer, intent(out) :: istat

   istat = call_set(handle, trim(key), to_text(value))
end subroutine fwseti

!> Begin a model in memory.
!> Its sizes come first, for the shapes of the parts.
subroutine fwmodl(handle, n_dof, n_pairs, istat)
   use fw_calls, only: call_new_model
   implicit none (type, external)
   integer, intent(in) :: handle, n_dof, n_pairs
   integer, intent(out) :: istat

   istat = call_new_model(handle, n_dof, n_pairs)
end subroutine fwmodl

!> Give a real part of the model.
!> VALUES by columns, N of them.
subroutine fwputd(handle, name, n, values, istat)
   use fw_calls, only: call_put_reals
   implicit none (type, external)
   integer, intent(in) :: handle, n
   character(*), intent(in) :: name
   double precision, intent(in) :: values(*)
   integer, intent(out) :: istat

   istat = call_put_reals(handle, trim(name), values(:max(n, 0)))
end subroutine fwputd

!> Give an integer part of the model.
!> Dof numbers count from 1, 0 for the ground.
subroutine fwputi(handle, name, n, values, istat)
   use fw_calls, only: call_put_integers
   implicit none (type, external)
   integer, intent(in) :: handle, n
   character(*), intent(in) :: name
   integer, intent(in) :: values(*)
   integer, intent(out) :: istat

   istat = call_put_integers(handle, trim(name), values(:max(n, 0)))
end subroutine fwputi

!> Observe a linear combination of the dofs.
!> VALUES has a factor for each dof.
subroutine fwobs(handle, name, n, values, istat)
   use fw_calls, only: call_observe
   implicit none (type, external)
   integer, intent(in) :: handle, n
   character(*), intent(in) :: name
   double precision, intent(in) :: values(*)
   integer, intent(out) :: istat

   istat = call_observe(handle, trim(name), values(:max(n, 0)))
end subroutine fwobs

!> Have SUBROUTINE PROGRESS(HANDLE, K, N, OMEGA, ICONV, ISTOP) called after every point.
!> ISTOP /= 0 on return ends the run; PROGRESS may read points but change nothing.
subroutine fwprog(handle, progress, istat)
   use fw_callbacks, only: fortran77_progress
   use fw_error, only: error_type, status_usage
   use fw_handles, only: enter, handle_type, leave
   implicit none (type, external)
   integer, intent(in) :: handle
   procedure(fortran77_progress) :: progress
   integer, intent(out) :: istat
   type(handle_type), pointer :: handle_data
   type(error_type), allocatable :: error

   istat = status_usage
   call enter(handle, handle_data)
   if (.not. associated(handle_data)) return
   handle_data%observer%fortran77 => progress
   istat = leave(handle_data, error)
end subroutine fwprog

!> Everything that would refuse the case before it is computed.
!> Nothing is computed.
subroutine fwchk(handle, istat)
   use fw_calls, only: call_check
   implicit none (type, external)
   integer, intent(in) :: handle
   integer, intent(out) :: istat

   istat = call_check(handle)
end subroutine fwchk

!> Begin to go through frequencies.
!> Afterwards FWSOLV solves at any frequency, each from the last converged point.
subroutine fwstrt(handle, istat)
   use fw_calls, only: call_start
   implicit none (type, external)
   integer, intent(in) :: handle
   integer, intent(out) :: istat

   istat = call_start(handle)
end subroutine fwstrt

!> Run the whole case.
!> ISTAT tells of points that failed; the others can be read.
subroutine fwrun(handle, istat)
   use fw_calls, only: call_run
   implicit none (type, external)
   integer, intent(in) :: handle
   integer, intent(out) :: istat

   istat = call_run(handle)
end subroutine fwrun

!> Frequency k of the sweep [rad/s].
!> Defined, as 0, also with an error.
subroutine fwfreq(handle, k, omega, istat)
   use fw_calls, only: call_frequency
   implicit none (type, external)
   integer, intent(in) :: handle, k
   double precision, intent(out) :: omega
   integer, intent(out) :: istat

   istat = call_frequency(handle, k, omega)
end subroutine fwfreq

!> Solve at a frequency [rad/s].
!> ISTAT is status_not_converged where it failed; the point is kept and marked.
subroutine fwsolv(handle, omega, istat)
   use fw_calls, only: call_solve
   implicit none (type, external)
   integer, intent(in) :: handle
   double precision, intent(in) :: omega
   integer, intent(out) :: istat

   istat = call_solve(handle, omega)
end subroutine fwsolv

!> How many there are of something.
!> WHAT may be 'points', 'frequencies', 'dofs', 'pairs', 'observed', 'coefficients'.
subroutine fwcnt(handle, what, n, istat)
   use fw_calls, only: call_count
   implicit none (type, external)
   integer, intent(in) :: handle
   character(*), intent(in) :: what
   integer, intent(out) :: n, istat

   istat = call_count(handle, trim(what), n)
end subroutine fwcnt

!> Number of values that point k holds of a result.
!> Counts beyond the range of INTEGER are cut to its largest value.
subroutine fwsize(handle, name, k, n, istat)
   use fw_calls, only: call_size
   use fw_kinds, only: i8
   implicit none (type, external)
   integer, intent(in) :: handle, k
   character(*), intent(in) :: name
   integer, intent(out) :: n, istat
   integer(i8) :: number

   istat = call_size(handle, trim(name), k, number)
   n = int(min(number, int(huge(n), i8)))
end subroutine fwsize

!> Copy a result of point k; VALUES has room for N.
!> VALUES stays as it is where N is too small.
subroutine fwget(handle, name, k, n, values, istat)
   use fw_calls, only: call_get
   implicit none (type, external)
   integer, intent(in) :: handle, k, n
   character(*), intent(in) :: name
   double precision, intent(inout) :: values(*)
   integer, intent(out) :: istat

   istat = call_get(handle, trim(name), k, values(:max(n, 0)))
end subroutine fwget

!> Copy a text, cut or filled with blanks.
!> K matters for 'observed' alone: the number of the quantity.
subroutine fwtext(handle, what, k, text, istat)
   use fw_calls, only: call_get_text
   implicit none (type, external)
   integer, intent(in) :: handle, k
   character(*), intent(in) :: what
   character(*), intent(inout) :: text
   integer, intent(out) :: istat
   character(:), allocatable :: found

   istat = call_get_text(handle, trim(what), k, found)
   ! With an error TEXT keeps what it had.
   if (istat == 0) text = found
end subroutine fwtext
