!> SIGINT and SIGTERM ask a run to end, so that its result file is complete as far as it goes; a
!> second one ends the program at once.
module fw_signals
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_funloc, c_funptr, c_int, &
      c_intptr_t, c_long, c_null_funptr, c_size_t
   implicit none (type, external)
   private

   public :: catch_interrupts, was_interrupted

   integer(c_int), parameter :: sigint = 2, sigterm = 15, sigxfsz = 25

   !> The one thing that a signal can reach.
   logical, volatile :: interrupted = .false.

   character(*), parameter :: announcement = new_line('a')// &
      'fw_run: ends with the points that are done; once more ends it at once'//new_line('a')

   interface
      function c_signal(number, handler) bind(c, name='signal') result(previous)
         import :: c_funptr, c_int
         implicit none (type, external)
         integer(c_int), value :: number
         type(c_funptr), value :: handler
         type(c_funptr) :: previous
      end function c_signal

      function c_write(descriptor, buffer, size) bind(c, name='write') result(written)
         import :: c_char, c_int, c_long, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: buffer(*)
         integer(c_size_t), value :: size
         integer(c_long) :: written
      end function c_write
   end interface

contains

   !> From now on the two signals only leave a note. One that is ignored stays ignored, as for
   !> programs behind nohup or in the background of a script. And a file that may not grow any
   !> further is an error of writing, as on a full disk, and not the end of the program.
   subroutine catch_interrupts()
      type(c_funptr) :: previous

      call catch(sigint)
      call catch(sigterm)
      previous = c_signal(sigxfsz, ignore_signal())
   end subroutine catch_interrupts

   logical function was_interrupted()
      was_interrupted = interrupted
   end function was_interrupted

   subroutine catch(number)
      integer(c_int), intent(in) :: number
      type(c_funptr) :: previous

      previous = c_signal(number, c_funloc(on_signal))
      if (c_associated(previous, ignore_signal())) previous = c_signal(number, ignore_signal())
   end subroutine catch

   !> SIG_IGN, which is the address 1 in every C library in use.
   function ignore_signal() result(handler)
      type(c_funptr) :: handler

      handler = transfer(1_c_intptr_t, handler)
   end function ignore_signal

   !> Nothing here but what a handler may call.
   subroutine on_signal(number) bind(c)
      integer(c_int), value :: number
      integer(c_int), parameter :: standard_error = 2
      type(c_funptr) :: previous
      integer(c_long) :: written

      interrupted = .true.
      previous = c_signal(sigint, c_null_funptr) ! SIG_DFL
      previous = c_signal(sigterm, c_null_funptr)
      written = c_write(standard_error, announcement, len(announcement, c_size_t))
      associate (unused => number, unused_count => written)
      end associate
   end subroutine on_signal

end module fw_signals
