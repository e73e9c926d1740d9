!> An observer that calls back into a program written in C or in Fortran 77.
!>
!> Callbacks run on the thread that runs the case, between two points: they may read the points that
!> there are, and ask for the end by their return value; a function that is not set is passed over.
module fw_callbacks
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_procpointer, &
      c_funptr, c_int, c_null_char, c_null_funptr, c_null_ptr, c_ptr
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: callback_observer, fortran77_progress

   !> The order and the kinds of the components are part of the binary interface.
   !> struct fw_progress of fretwear.h.
   type, bind(c) :: c_progress
      !> From 0, of n_points; n_points is 0 where their number is not known (a branch).
      integer(c_int) :: point = 0_c_int
      integer(c_int) :: n_points = 0_c_int
      !> [rad/s].
      real(c_double) :: omega = 0.0_c_double
      !> 1 or 0.
      integer(c_int) :: converged = 0_c_int
      integer(c_int) :: iterations = 0_c_int
      !> norm(R) over the reference of the loads, and the largest amplitude of the
      !> observed quantities [length].
      real(c_double) :: residual = 0.0_c_double
      real(c_double) :: amplitude = 0.0_c_double
   end type c_progress

   abstract interface
      !> Any value but 0 ends the run behind this point.
      integer(c_int) function c_progress_callback(user, progress) bind(c)
         import :: c_int, c_progress, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: user
         type(c_progress), intent(in) :: progress
      end function c_progress_callback

      !> The text ends in a null and belongs to the library: it lives for the time of the call.
      subroutine c_message_callback(user, text) bind(c)
         import :: c_char, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: user
         character(kind=c_char), intent(in) :: text(*)
      end subroutine c_message_callback

      !> `stop_flag` is 0 on entry; anything else on return ends the run after this point.
      subroutine fortran77_progress(handle, index, n_points, omega, converged, stop_flag)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: handle, index, n_points, converged
         real(wp), intent(in) :: omega
         integer, intent(inout) :: stop_flag
      end subroutine fortran77_progress
   end interface

   !> One object serves both languages: whichever functions are set are called.
   type, extends(observer_type) :: callback_observer
      !> Set by another thread to end the call at work.
      logical :: asked_to_stop = .false.
      !> Number of the handle, for programs in Fortran 77.
      integer :: handle = 0
      !> Function pointers and the data that go back to them, of fw_on_progress and fw_on_message.
      type(c_funptr) :: progress = c_null_funptr
      type(c_ptr) :: progress_user = c_null_ptr
      type(c_funptr) :: message = c_null_funptr
      type(c_ptr) :: message_user = c_null_ptr
      procedure(fortran77_progress), pointer, nopass :: fortran77 => null()
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
      procedure :: poll
   end type callback_observer

contains

   !> Another thread may set the flag at any time: hence atomic.
   subroutine poll(self)
      class(callback_observer), intent(inout) :: self
      logical :: asked

      !$omp atomic read
      asked = self%asked_to_stop
      if (asked) self%stop_requested = .true.
   end subroutine poll

   !> There is nothing to say before the first point.
   subroutine on_start(self, case_title, n_points)
      class(callback_observer), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points

      associate (unused => self, unused_title => case_title, unused_number => n_points)
      end associate
   end subroutine on_start

   !> The request to stop is only noted here: the sweep looks at it when the point is written.
   subroutine on_point(self, index, n_points, point)
      class(callback_observer), intent(inout) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point
      procedure(c_progress_callback), pointer :: progress
      integer :: stop_flag

      if (c_associated(self%progress)) then
         call c_f_procpointer(self%progress, progress)
         stop_flag = int(progress(self%progress_user, described(index, n_points, point)))
         if (stop_flag /= 0) self%stop_requested = .true.
      end if
      if (associated(self%fortran77)) then
         stop_flag = 0
         call self%fortran77(self%handle, index, n_points, point%omega, &
                             merge(1, 0, point%converged), stop_flag)
         if (stop_flag /= 0) self%stop_requested = .true.
      end if
   end subroutine on_point

   !> Lines of text go to C alone.
   subroutine on_message(self, text)
      class(callback_observer), intent(inout) :: self
      character(*), intent(in) :: text
      procedure(c_message_callback), pointer :: message

      if (.not. c_associated(self%message)) return
      call c_f_procpointer(self%message, message)
      call message(self%message_user, text//c_null_char)
   end subroutine on_message

   !> The end of the run is the return of the call that started it.
   subroutine on_end(self)
      class(callback_observer), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine on_end

   !> Points count from 0 in C.
   pure function described(index, n_points, point) result(progress)
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point
      type(c_progress) :: progress

      progress%point = int(index - 1, c_int)
      progress%n_points = int(n_points, c_int)
      progress%omega = point%omega
      progress%converged = merge(1_c_int, 0_c_int, point%converged)
      progress%iterations = int(point%iterations, c_int)
      progress%residual = point%residual
      if (.not. allocated(point%amplitude)) return
      ! An observer without observed quantities reports an amplitude of 0.
      if (size(point%amplitude) > 0) progress%amplitude = maxval(point%amplitude)
   end function described

end module fw_callbacks
