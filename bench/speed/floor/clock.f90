!> Processor time of the program: what other programs take of the processor does not count.
module floor_clock
   use, intrinsic :: iso_c_binding, only: c_int, c_long
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: processor_time, time_of_reading

   !> POSIX: processor time of the process.
   integer(c_int), parameter :: clock_process = 2_c_int

   type, bind(c) :: timespec
      integer(c_long) :: seconds = 0_c_long
      integer(c_long) :: nanoseconds = 0_c_long
   end type timespec

   interface
      integer(c_int) function clock_gettime(clock, time) bind(c)
         import :: c_int, timespec
         integer(c_int), value :: clock
         type(timespec), intent(out) :: time
      end function clock_gettime
   end interface

contains

   !> Processor time of the program [s].
   real(wp) function processor_time()
      type(timespec) :: now
      integer(c_int) :: status

      status = clock_gettime(clock_process, now)
      processor_time = real(now%seconds, wp) + 1.0e-9_wp*real(now%nanoseconds, wp)
   end function processor_time

   !> What reading the clock takes [s].
   real(wp) function time_of_reading()
      integer, parameter :: n_trials = 1000
      real(wp) :: start, now
      integer :: i

      start = processor_time()
      do i = 1, n_trials
         now = processor_time()
      end do
      time_of_reading = (now - start)/real(n_trials, wp)
   end function time_of_reading

end module floor_clock
