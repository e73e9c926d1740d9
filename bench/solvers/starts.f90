!> Solutions of a case from many starts, by the solver of the case alone: no other guess, no
!> fallback. Reads the name of a file with
!>
!>    &starts  case = 'case.nml'             a namelist of fw_run; the solver stands there
!>             frequencies = 1.3, 1.4        [rad/s]
!>             n_starts = 21, seed = 1       at each frequency
!>             spread = 3.0                  coefficients are drawn from (-spread, spread) [length]
!>             first_guess = .false.         the first start is the first guess of a run instead
!>             budget = 0.1                  repetitions of a solution stop after this time [s] /
!>
!> and writes one line for each start, separated by semicolons: frequency, number of the start,
!> converged, iterations, median time [s], relative residual, why it failed, and the coefficients of
!> the first observed quantity in the order (0, c1, s1, ..).
program starts
   use, intrinsic :: iso_fortran_env, only: error_unit, int64, output_unit
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_guess, only: stuck_guess
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_read_case, only: read_case
   use fw_recovery, only: recover_point
   use fw_response, only: response
   use fw_solver_options, only: solver_pseudo_time
   use fw_text, only: string_type
   implicit none (type, external)

   integer, parameter :: most_frequencies = 20, most_repetitions = 5
   type :: starts_options
      character(1000) :: case = ''
      real(wp) :: frequencies(most_frequencies) = -1.0_wp
      integer :: n_starts = 1, seed = 1
      real(wp) :: spread = 0.0_wp
      logical :: first_guess = .false.
      real(wp) :: budget = 0.1_wp
   end type starts_options

   type(starts_options) :: options
   type(case_type) :: input
   type(balance_problem), target :: problem
   type(balance_state), target :: system
   type(response) :: method
   type(error_type), allocatable :: error
   integer :: k

   call read_options(options)
   call read_case(trim(options%case), [string_type ::], input, error)
   call stop_on(error)
   call build_system(input, problem, system, error)
   call stop_on(error)
   call method%start(input, input%harmonics)
   call seed_random(options%seed)
   write (output_unit, '(a)') 'omega;start;converged;iterations;seconds;residual;message;'// &
      'coefficients'
   do k = 1, count(options%frequencies > 0.0_wp)
      call solve_all(options%frequencies(k))
   end do

contains

   subroutine read_options(options)
      type(starts_options), intent(out) :: options
      character(1000) :: path, case
      character(200) :: message
      real(wp) :: frequencies(most_frequencies), spread, budget
      integer :: n_starts, seed, unit, iostat
      logical :: first_guess
      namelist /starts/ case, frequencies, n_starts, seed, spread, first_guess, budget

      case = options%case
      frequencies = options%frequencies
      n_starts = options%n_starts
      seed = options%seed
      spread = options%spread
      first_guess = options%first_guess
      budget = options%budget
      call get_command_argument(1, path)
      open (newunit=unit, file=trim(path), status='old', action='read', iostat=iostat, &
            iomsg=message)
      if (iostat == 0) read (unit, nml=starts, iostat=iostat, iomsg=message)
      if (iostat /= 0) then
         write (error_unit, '(4a)') 'starts: ', trim(path), ': ', trim(message)
         error stop 3
      end if
      close (unit)
      options = starts_options(case, frequencies, n_starts, seed, spread, first_guess, budget)
   end subroutine read_options

   !> The same numbers for every solver.
   subroutine seed_random(seed)
      integer, intent(in) :: seed
      integer, allocatable :: state(:)
      integer :: i, n

      call random_seed(size=n)
      state = [(seed + 7919*i, i=1, n)]
      call random_seed(put=state)
   end subroutine seed_random

   subroutine solve_all(omega)
      real(wp), intent(in) :: omega
      real(wp), allocatable :: start(:)
      integer :: i

      allocate (start(system%n))
      do i = 1, options%n_starts
         call random_number(start)
         start = options%spread*(2.0_wp*start - 1.0_wp)
         call system%set_frequency(omega, error)
         call stop_on(error)
         if (i == 1 .and. options%first_guess) call stuck_guess(system, start)
         call solve_start(omega, i, start)
      end do
   end subroutine solve_all

   !> Repeat a solution, and write its line.
   subroutine solve_start(omega, number, start)
      real(wp), intent(in) :: omega, start(:)
      integer, intent(in) :: number
      type(solver_report) :: report
      real(wp), allocatable :: x(:)
      real(wp) :: seconds(most_repetitions)
      character(:), allocatable :: message
      integer :: n

      n = 0
      do
         n = n + 1
         x = start
         call solve_once(x, report, message, seconds(n))
         if (n == most_repetitions .or. sum(seconds(:n)) > options%budget) exit
      end do
      call write_line(omega, number, x, report, message, median(seconds(:n)))
   end subroutine solve_start

   !> The frequency is set again each time, so that every repetition does the same work.
   subroutine solve_once(x, report, message, seconds)
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      character(:), allocatable, intent(out) :: message
      real(wp), intent(out) :: seconds
      integer(int64) :: clock, clock_end, rate

      call system_clock(clock, rate)
      if (input%solver%kind == solver_pseudo_time) then
         call method%solve_by_flow(input, input%pseudo_time, system, x, report, error)
         call stop_on(error)
      else
         call method%solve_in(system, x, report)
      end if
      call system_clock(clock_end)
      seconds = real(clock_end - clock, wp)/real(rate, wp)
      message = reason(report)
   end subroutine solve_once

   !> Why a solution failed.
   function reason(report) result(message)
      type(solver_report), intent(in) :: report
      character(:), allocatable :: message

      message = ''
      if (report%converged) return
      if (input%solver%kind == solver_pseudo_time .and. allocated(method%message)) then
         message = method%message
      else if (report%residual <= input%solver%tolerance) then
         message = 'a solution that does not last: the structure has left its contact'
      else if (report%iterations >= input%solver%max_iterations) then
         message = 'iterations run out'
      else
         message = 'the residual does not fall any more'
      end if
   end function reason

   subroutine write_line(omega, number, x, report, message, seconds)
      real(wp), intent(in) :: omega, seconds
      integer, intent(in) :: number
      real(wp), intent(in), contiguous :: x(:)
      type(solver_report), intent(in) :: report
      character(*), intent(in) :: message
      type(point_type) :: point

      call recover_point(system, x, input%harmonics%n_harmonics, .false., point)
      write (output_unit, '(es22.15, ";", i0, ";", i0, ";", i0, 2(";", es12.5), ";", a, ";", &
         &*(es22.15, :, " "))') omega, number, merge(1, 0, report%converged), report%iterations, &
         seconds, min(report%residual, 1.0e99_wp), message, point%coefficients(:, 1)
   end subroutine write_line

   pure real(wp) function median(values)
      real(wp), intent(in) :: values(:)
      real(wp) :: sorted(size(values)), smallest
      integer :: i, j

      sorted = values
      do i = 2, size(sorted)
         smallest = sorted(i)
         do j = i - 1, 1, -1
            if (sorted(j) <= smallest) exit
            sorted(j + 1) = sorted(j)
         end do
         sorted(j + 1) = smallest
      end do
      median = sorted((size(sorted) + 1)/2)
   end function median

   subroutine stop_on(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      write (error_unit, '(2a)') 'starts: ', error%message
      error stop 3
   end subroutine stop_on

end program starts
