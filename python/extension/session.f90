!> What one run of the Python package needs, behind an opaque handle: f2py passes no derived types.
!> A session belongs to one thread at a time; separate sessions may run side by side.
module fw_python_session
   use, intrinsic :: iso_c_binding, only: c_f_pointer
   use, intrinsic :: iso_c_binding, only: c_loc
   use, intrinsic :: iso_c_binding, only: c_ptr
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_error, only: status_ok
   use fw_kinds, only: i8
   use fw_model_file, only: file_model_type
   use fw_observer, only: observer_type
   use fw_outcome, only: outcome_type
   use fw_point, only: point_type
   use fw_read_case, only: case_input
   use fw_read_case, only: read_input
   use fw_run, only: check_case
   use fw_run, only: run_case
   use fw_text, only: join
   use fw_text, only: string_type
   use fw_threads, only: thread_scope
   implicit none (type, external)
   private

   public :: session_type, new_session, session_of

   !> Places in the array through which Python and a run see each other: Python sets the first to
   !> stop the run; the run counts its points in the second, of those in the third (0: not known).
   integer, parameter :: control_stop = 1, control_done = 2, control_total = 3

   type :: session_type
      !> The model of the calling program, where it gives one.
      type(file_model_type), allocatable :: model
      type(case_type), allocatable :: case
      !> Why the last call failed, the table of the last run, and what the run remarked.
      character(:), allocatable :: message, summary, remarks
   contains
      procedure :: read
      procedure :: check
      procedure :: run
   end type session_type

   !> Watches the array that Python shares.
   type, extends(observer_type) :: python_observer
      integer(i8), pointer :: control(:) => null()
      character(:), allocatable :: remarks
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
   end type python_observer

   character(*), parameter :: line_end = new_line('a')

contains

   function new_session() result(handle)
      integer(i8) :: handle
      type(session_type), pointer :: session

      allocate (session)
      handle = transfer(c_loc(session), handle)
   end function new_session

   !> The session behind a handle of new_session.
   function session_of(handle) result(session)
      integer(i8), intent(in) :: handle
      type(session_type), pointer :: session
      type(c_ptr) :: address

      address = transfer(handle, address)
      call c_f_pointer(address, session)
   end function session_of

   !> Read and validate a case from namelist text and overrides.
   subroutine read(self, text, path, overrides, origin, status)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: text, path
      type(string_type), intent(in) :: overrides(:)
      !> What messages put before an override.
      character(*), intent(in) :: origin
      integer, intent(out) :: status
      type(error_type), allocatable :: error
      type(thread_scope) :: threads
      type(case_input) :: input

      input%text = text
      input%path = path
      input%overrides = overrides
      input%origin = origin
      if (allocated(self%case)) deallocate (self%case)
      allocate (self%case)
      ! Damping and checks of a model must not depend on the threads of the BLAS either.
      call threads%enter(0)
      if (allocated(self%model)) then
         call read_input(input, self%case, error, self%model)
      else
         call read_input(input, self%case, error)
      end if
      call threads%leave()
      call conclude(self, error, status)
   end subroutine read

   !> Everything that would refuse the case before it is computed.
   subroutine check(self, status)
      class(session_type), intent(inout) :: self
      integer, intent(out) :: status
      type(error_type), allocatable :: error

      call check_case(self%case, error)
      call conclude(self, error, status)
   end subroutine check

   !> Run the case that was read; the array `control` is watched and updated meanwhile.
   subroutine run(self, control, status)
      class(session_type), intent(inout) :: self
      integer(i8), intent(inout), target :: control(:)
      integer, intent(out) :: status
      type(error_type), allocatable :: error
      type(outcome_type) :: outcome
      type(python_observer) :: observer

      observer%control => control
      observer%remarks = ''
      call run_case(self%case, observer, outcome, error)
      self%remarks = observer%remarks
      self%summary = ''
      if (allocated(outcome%summary)) self%summary = join(outcome%summary, line_end)
      call conclude(self, error, status)
      if (status == status_ok) status = outcome%status
   end subroutine run

   !> Keep what an error says.
   subroutine conclude(self, error, status)
      class(session_type), intent(inout) :: self
      type(error_type), allocatable, intent(in) :: error
      integer, intent(out) :: status

      self%message = ''
      status = status_ok
      if (.not. allocated(error)) return
      self%message = error%message
      status = error%status
   end subroutine conclude

   subroutine on_start(self, case_title, n_points)
      class(python_observer), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points

      self%control(control_total) = int(n_points, i8)
      self%stop_requested = self%control(control_stop) /= 0_i8
   end subroutine on_start

   subroutine on_point(self, index, n_points, point)
      class(python_observer), intent(inout) :: self
      integer, intent(in) :: index
      integer, intent(in) :: n_points
      type(point_type), intent(in) :: point

      self%control(control_done) = int(index, i8)
      self%control(control_total) = int(n_points, i8)
      self%stop_requested = self%control(control_stop) /= 0_i8
   end subroutine on_point

   subroutine on_message(self, text)
      class(python_observer), intent(inout) :: self
      character(*), intent(in) :: text

      self%remarks = self%remarks//text//line_end
      self%stop_requested = self%control(control_stop) /= 0_i8
   end subroutine on_message

   subroutine on_end(self)
      class(python_observer), intent(inout) :: self

      self%stop_requested = self%control(control_stop) /= 0_i8
   end subroutine on_end

end module fw_python_session
