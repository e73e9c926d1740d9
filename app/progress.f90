!> Progress on the standard error: a bar on a terminal, lines otherwise.
module fw_progress
   use, intrinsic :: iso_c_binding, only: c_int
   use, intrinsic :: iso_fortran_env, only: error_unit
   use fw_kinds, only: i8, pi, wp
   use fw_observer, only: observer_type
   use fw_parameters, only: parameter_words
   use fw_point, only: point_type
   use fw_signals, only: was_interrupted
   use fw_text, only: to_text
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: progress_type, new_progress

   integer, parameter :: bar_width = 20
   !> About as many lines stand in a log for a long sweep.
   integer, parameter :: log_lines = 20
   !> Where nobody knows how many points there will be, each line comes this much later than the
   !> last: about as many again for some hundred points.
   real, parameter :: later = 1.35

   type, extends(observer_type) :: progress_type
      private
      logical :: quiet = .false.
      logical :: verbose = .false.
      logical :: draws_bar = .false.
      !> Characters of the terminal's line that the bar occupies.
      integer :: shown = 0
      !> Whether frequencies are typed in Hz, and so shown.
      logical :: in_hertz = .false.
      !> The parameter that is shown where a sweep goes over one; empty: the frequency.
      character(:), allocatable :: parameter
      !> When the first point was begun.
      integer(i8) :: started = 0
      !> Point of the next line, where it is not known how many there will be.
      integer :: next_line = 1
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
      procedure :: poll
      procedure, private :: draw_bar
      procedure, private :: clear_bar
      procedure, private :: state_of
      procedure, private :: time_left
      procedure, private :: line_of
   end type progress_type

   interface
      function c_isatty(descriptor) bind(c, name='isatty') result(answer)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: answer
      end function c_isatty
   end interface

contains

   function new_progress(quiet, verbose, in_hertz, parameter_swept) result(progress)
      logical, intent(in) :: quiet, verbose
      !> Frequencies are to be shown in Hz.
      logical, intent(in) :: in_hertz
      !> As in fw_parameters what the sweep goes over; 0: the frequency.
      integer, intent(in) :: parameter_swept
      type(progress_type) :: progress
      integer(c_int), parameter :: standard_error = 2

      progress%quiet = quiet
      progress%verbose = verbose
      progress%in_hertz = in_hertz
      progress%parameter = ''
      if (parameter_swept > 0) progress%parameter = trim(parameter_words(parameter_swept))
      progress%draws_bar = c_isatty(standard_error) == 1
      if (verbose) progress%draws_bar = .false.
   end function new_progress

   !> Signals arrive at any time.
   subroutine poll(self)
      class(progress_type), intent(inout) :: self

      if (was_interrupted()) self%stop_requested = .true.
   end subroutine poll

   subroutine on_start(self, case_title, n_points)
      class(progress_type), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points
      character(:), allocatable :: count

      self%next_line = 1
      call system_clock(self%started)
      if (self%quiet) return
      count = ''
      if (n_points == 1) count = ': 1 point'
      if (n_points > 1) count = ': '//to_text(n_points)//' points'
      write (error_unit, '(a)') case_title//count
   end subroutine on_start

   subroutine on_point(self, index, n_points, point)
      class(progress_type), intent(inout) :: self
      integer, intent(in) :: index
      integer, intent(in) :: n_points
      type(point_type), intent(in) :: point
      logical :: is_due

      if (self%quiet) return
      ! A point that failed is worth a line wherever it is shown.
      is_due = self%verbose .or. .not. point%converged
      if (.not. self%draws_bar) then
         if (n_points > 0) then
            is_due = is_due .or. index == n_points .or. &
                     mod(index - 1, max(1, n_points/log_lines)) == 0
         else if (index >= self%next_line) then
            is_due = .true.
            self%next_line = max(index + 1, ceiling(later*index))
         end if
      end if
      if (is_due) then
         call self%clear_bar()
         write (error_unit, '(a)') self%line_of(index, n_points, point)
      end if
      if (self%draws_bar) call self%draw_bar(index, n_points, point)
   end subroutine on_point

   subroutine on_message(self, text)
      class(progress_type), intent(inout) :: self
      character(*), intent(in) :: text

      if (self%quiet) return
      call self%clear_bar()
      write (error_unit, '(a)') text
   end subroutine on_message

   subroutine on_end(self)
      class(progress_type), intent(inout) :: self

      call self%clear_bar()
   end subroutine on_end

   !> The bar in place of the one before it.
   subroutine draw_bar(self, index, n_points, point)
      class(progress_type), intent(inout) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point
      character(:), allocatable :: text

      text = bar_text(index, n_points)//self%state_of(point)//self%time_left(index, n_points)
      write (error_unit, '(a)', advance='no') achar(13)//text// &
         repeat(' ', max(0, self%shown - len(text)))
      flush (error_unit)
      self%shown = len(text)
   end subroutine draw_bar

   !> Overwrite the bar with blanks and go back to the start of its line.
   subroutine clear_bar(self)
      class(progress_type), intent(inout) :: self

      if (self%shown == 0) return
      write (error_unit, '(a)', advance='no') achar(13)//repeat(' ', self%shown)//achar(13)
      flush (error_unit)
      self%shown = 0
   end subroutine clear_bar

   function bar_text(index, n_points) result(text)
      integer, intent(in) :: index, n_points
      character(:), allocatable :: text
      integer :: filled

      if (n_points < index) then
         text = 'point '//to_text(index)
         return
      end if
      filled = nint(real(bar_width)*real(index)/real(n_points))
      text = '['//repeat('=', filled)//repeat(' ', bar_width - filled)//'] '//to_text(index)// &
             '/'//to_text(n_points)
   end function bar_text

   !> Frequency, or parameter of a sweep, and amplitude of a point; of wear the cycles and the
   !> largest depth.
   function state_of(self, point) result(text)
      class(progress_type), intent(in) :: self
      type(point_type), intent(in) :: point
      character(:), allocatable :: text

      if (allocated(point%depth)) then
         text = ', cycles '//number_text(rounded(point%cycles))
         if (size(point%depth) > 0) then
            text = text//', depth '//number_text(rounded(maxval(point%depth)))
         end if
      else if (len(self%parameter) > 0) then
         text = ', '//self%parameter//' '//number_text(rounded(point%place))
      else if (self%in_hertz) then
         text = ', '//number_text(rounded(point%omega/(2.0_wp*pi)))//' Hz'
      else
         text = ', '//number_text(rounded(point%omega))//' rad/s'
      end if
      if (.not. allocated(point%amplitude)) return
      if (size(point%amplitude) == 0) return
      text = text//', amplitude '//number_text(rounded(maxval(point%amplitude)))
   end function state_of

   !> How long the rest takes, if it goes on as until now.
   function time_left(self, index, n_points) result(text)
      class(progress_type), intent(in) :: self
      integer, intent(in) :: index, n_points
      character(:), allocatable :: text
      integer(i8) :: now, rate
      integer :: seconds

      text = ''
      if (index < 1 .or. n_points <= index) return
      call system_clock(now, rate)
      if (rate <= 0) return
      seconds = nint(min(1.0e8_wp, real(now - self%started, wp)/real(rate, wp) &
                         *real(n_points - index, wp)/real(index, wp)))
      if (seconds < 600) then
         text = ', '//to_text(seconds)//' s left'
      else
         text = ', '//to_text(seconds/60)//' min left'
      end if
   end function time_left

   function line_of(self, index, n_points, point) result(text)
      class(progress_type), intent(in) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point
      character(:), allocatable :: text
      character(:), allocatable :: state

      text = 'point '//to_text(index)
      if (n_points >= index) text = text//' of '//to_text(n_points)
      state = self%state_of(point)
      text = text//':'//state(2:)
      if (.not. point%converged) text = text//', NOT CONVERGED'
      if (self%verbose .or. .not. point%converged) then
         text = text//', '//to_text(point%iterations)//' iterations, residual '// &
                number_text(rounded(point%residual))
      end if
   end function line_of

   !> Six digits are enough to read.
   function rounded(number)
      real(wp), intent(in) :: number
      real(wp) :: rounded
      character(24) :: buffer

      write (buffer, '(es24.5e3)') number
      read (buffer, *) rounded
   end function rounded

end module fw_progress
