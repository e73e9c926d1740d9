!> HDF5 files from anywhere, tried first in a process of its own: releases of HDF5 in wide use
!> crash, or search for ever, where the inner structure of a file is damaged, and no call says
!> beforehand whether one will. The trial ends instead of the program.
!>
!> For programs with one thread at work: between fork and exit the child calls much more than a
!> program with several threads may.
module fw_trial
   use, intrinsic :: iso_c_binding, only: c_int, c_long
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: i8
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: trial_type, try_file

   !> What is going to be read: the calls of a trial are those of the reading.
   type, abstract :: trial_type
   contains
      procedure(read_in_trial), deferred :: read
   end type trial_type

   !> Processor time of a trial [s]: so much, and one more for every so many bytes of the file.
   integer(c_long), parameter :: least_seconds = 2_c_long
   integer(i8), parameter :: bytes_per_second = 10000000_i8

   abstract interface
      !> Read the file; nothing of it is kept, nor what is wrong with it.
      subroutine read_in_trial(self, path)
         import :: trial_type
         implicit none (type, external)
         class(trial_type), intent(in) :: self
         character(*), intent(in) :: path
      end subroutine read_in_trial
   end interface

   interface
      function c_fork() bind(c, name='fork') result(process)
         import :: c_int
         implicit none (type, external)
         integer(c_int) :: process
      end function c_fork

      function c_waitpid(process, status, options) bind(c, name='waitpid') result(found)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: process, options
         integer(c_int), intent(out) :: status
         integer(c_int) :: found
      end function c_waitpid

      function c_setrlimit(resource, limits) bind(c, name='setrlimit') result(status)
         import :: c_int, c_long
         implicit none (type, external)
         integer(c_int), value :: resource
         integer(c_long), intent(in) :: limits(2)
         integer(c_int) :: status
      end function c_setrlimit

      function c_close(descriptor) bind(c, name='close') result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: status
      end function c_close

      subroutine c_exit_now(status) bind(c, name='_exit')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: status
      end subroutine c_exit_now
   end interface

contains

   !> Refuse a file that the library cannot survive. What is wrong in one that it can is left to
   !> the reading itself; so is everything where the system gives no second process.
   subroutine try_file(trial, path, error)
      class(trial_type), intent(in) :: trial
      character(*), intent(in) :: path
      !> status_input where the trial crashed or found no end.
      type(error_type), allocatable, intent(out) :: error
      integer(c_int), parameter :: end_of_time = 24, killed = 9
      integer(c_int) :: process, status, signal
      integer(c_long) :: seconds
      integer(i8) :: length
      character(:), allocatable :: ending

      inquire (file=path, size=length)
      seconds = least_seconds + int(max(length, 0_i8)/bytes_per_second, c_long)
      process = c_fork()
      if (process < 0) return
      if (process == 0) call run_trial(trial, path, seconds)
      if (c_waitpid(process, status, 0) /= process .or. status == 0) return
      signal = iand(status, 127)
      if (signal == end_of_time .or. signal == killed) then
         ending = 'finds no end ('//to_text(int(seconds))//' s)'
      else if (signal /= 0) then
         ending = 'crashes (signal '//to_text(int(signal))//')'
      else
         ending = 'crashes (status '//to_text(int(iand(ishft(status, -8), 255)))//')'
      end if
      call fatal_error(error, path//': the file is damaged: the HDF5 library '//ending// &
                       ' while reading it; write the file again', status_input)
   end subroutine try_file

   !> The child: it reads and ends, without a word.
   subroutine run_trial(trial, path, seconds)
      class(trial_type), intent(in) :: trial
      character(*), intent(in) :: path
      integer(c_long), intent(in) :: seconds
      integer(c_int), parameter :: processor_time = 0, core_file = 4, standard_error = 2
      integer(c_int) :: status

      ! No core file, an end to endless loops, and none of the library's words on the terminal.
      status = c_setrlimit(core_file, [0_c_long, 0_c_long])
      status = c_setrlimit(processor_time, [seconds, seconds + 1_c_long])
      status = c_close(standard_error)
      call trial%read(path)
      call c_exit_now(0_c_int)
   end subroutine run_trial

end module fw_trial
