!> A session of the library (fw_session) with what the Python package needs beside it, behind an
!> opaque handle: f2py passes no derived types. A handle belongs to one thread at a time; separate
!> ones may run side by side.
module fw_python_session
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int8_t, c_loc, c_ptr
   use fw_error, only: error_type, status_ok
   use fw_kinds, only: i8, wp
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_session, only: session_type
   use fw_text, only: join
   implicit none (type, external)
   private

   public :: handle_type, new_handle, handle_of

   !> Places in the array through which Python and a run see each other: Python sets the first to
   !> stop the run; the run counts its points in the second, of those in the third (0: not known).
   integer, parameter :: control_stop = 1, control_done = 2, control_total = 3
   !> Of the last point, as the bits of reals.
   integer, parameter :: control_omega = 4, control_amplitude = 5, control_cycles = 6, &
                         control_depth = 7
   !> Python sets how many points are enough (0: all).
   integer, parameter :: control_wanted = 8

   type :: handle_type
      type(session_type) :: session
      !> Why the last call failed, the table of the last run, and what was remarked.
      character(:), allocatable :: message, summary, remarks
      !> The bytes of the result file of the last run in memory.
      integer(c_int8_t), allocatable :: image(:)
   contains
      procedure :: conclude
      procedure :: run
      procedure :: solve
   end type handle_type

   !> Watches the array that Python shares.
   type, extends(observer_type) :: python_observer
      integer(i8), pointer :: control(:) => null()
      character(:), allocatable :: remarks
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
      procedure :: poll
   end type python_observer

   character(*), parameter :: line_end = new_line('a')

contains

   function new_handle() result(number)
      integer(i8) :: number
      type(handle_type), pointer :: handle

      allocate (handle)
      handle%message = ''
      handle%summary = ''
      handle%remarks = ''
      handle%session%origin = 'argument'
      number = transfer(c_loc(handle), number)
   end function new_handle

   !> The object behind a number of new_handle.
   function handle_of(number) result(handle)
      integer(i8), intent(in) :: number
      type(handle_type), pointer :: handle
      type(c_ptr) :: address

      address = transfer(number, address)
      call c_f_pointer(address, handle)
   end function handle_of

   !> Run the case; the array `control` is watched and updated meanwhile.
   subroutine run(self, control, in_memory, status, piece)
      class(handle_type), intent(inout) :: self
      integer(i8), intent(inout), target :: control(:)
      !> Keep the bytes of the result file in `image` instead of writing it.
      logical, intent(in) :: in_memory
      integer, intent(out) :: status
      !> In memory, of a sweep: first and last point, points on the way, and the one solved before
      !> (0: none).
      integer, intent(in), optional :: piece(4)
      type(error_type), allocatable :: error
      type(python_observer) :: observer

      observer%control => control
      observer%remarks = ''
      if (allocated(self%image)) deallocate (self%image)
      if (present(piece)) then
         call self%session%run_piece(piece(1), piece(2), piece(3), piece(4), observer, error, &
                                     self%image)
      else if (in_memory) then
         call self%session%run(observer, error, image=self%image)
      else
         call self%session%run(observer, error, write_file=.true.)
      end if
      ! The file has them, or the image.
      call self%session%points%clear()
      self%remarks = observer%remarks
      self%summary = ''
      if (allocated(self%session%outcome%summary)) then
         self%summary = join(self%session%outcome%summary, line_end)
      end if
      call self%conclude(error, status)
      if (status == status_ok) status = self%session%outcome%status
   end subroutine run

   !> One step at a frequency [rad/s]; see `solve` of the session.
   subroutine solve(self, omega, control, status)
      class(handle_type), intent(inout) :: self
      real(wp), intent(in) :: omega
      integer(i8), intent(inout), target :: control(:)
      integer, intent(out) :: status
      type(error_type), allocatable :: error
      type(python_observer) :: observer

      observer%control => control
      observer%remarks = ''
      call self%session%solve(omega, observer, error)
      self%remarks = observer%remarks
      call self%conclude(error, status)
   end subroutine solve

   !> Keep what an error says.
   subroutine conclude(self, error, status)
      class(handle_type), intent(inout) :: self
      type(error_type), allocatable, intent(in) :: error
      integer, intent(out) :: status

      self%message = ''
      status = status_ok
      if (.not. allocated(error)) return
      self%message = error%message
      status = error%status
   end subroutine conclude

   !> Python may set the flag at any time.
   subroutine poll(self)
      class(python_observer), intent(inout) :: self

      self%stop_requested = self%stop_requested .or. self%control(control_stop) /= 0_i8
      if (self%control(control_wanted) > 0_i8) then
         self%n_wanted = int(self%control(control_wanted))
      end if
   end subroutine poll

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

      self%control(control_omega) = transfer(point%omega, 0_i8)
      self%control(control_amplitude) = largest(point%amplitude)
      self%control(control_cycles) = transfer(point%cycles, 0_i8)
      self%control(control_depth) = largest(point%depth)
      self%control(control_done) = int(index, i8)
      self%control(control_total) = int(n_points, i8)
      self%stop_requested = self%control(control_stop) /= 0_i8
   end subroutine on_point

   !> Bits of the largest of some values, of -1 where there are none.
   function largest(values) result(bits)
      real(wp), allocatable, intent(in) :: values(:)
      integer(i8) :: bits

      bits = transfer(-1.0_wp, 0_i8)
      if (.not. allocated(values)) return
      if (size(values) > 0) bits = transfer(maxval(values), 0_i8)
   end function largest

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
