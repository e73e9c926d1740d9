!> Where the time of a frequency sweep goes, and the floor of it: the marches, transforms, products
!> and factorisations that it cannot do without, each done once more, alone, as often and in the
!> order in which the solution of a point has done them.
!>
!>    floor case.nml
!>
!> takes a case of analysis 'frf' with uniform sampling, in one thread, and writes one line of
!> comma-separated values for each part: its name, the number of calls, the processor time in the
!> library and that of the floor [s].
program floor
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use floor_clock, only: processor_time
   use floor_replay, only: new_replay, replay_type
   use floor_system, only: measured_system, new_measured_system
   use floor_trace, only: event_type, n_parts, part_guess, part_names, part_newton, part_recover
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_guess, only: stuck_guess
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_read_case, only: read_case
   use fw_recovery, only: recover_point
   use fw_solution_history, only: solution_history
   use fw_sweep, only: sweep_frequency
   use fw_text, only: string_type
   implicit none (type, external)

   type(case_type) :: input
   type(balance_problem), target :: problem
   type(balance_state), target :: balance
   type(measured_system), target :: system
   type(replay_type) :: replay
   type(newton_solver) :: newton
   type(solution_history) :: known
   type(error_type), allocatable :: error
   character(1000) :: path
   real(wp) :: building, least(n_parts)
   integer :: k, part

   call get_command_argument(1, path)
   call read_case(trim(path), [string_type ::], input, error)
   call stop_on(error)
   building = processor_time()
   call build_system(input, problem, balance, error)
   call stop_on(error)
   call new_measured_system(balance, system)
   building = processor_time() - building
   call new_replay(system, input%contact%mu, replay)
   newton%options = input%solver
   call known%start(system%n)
   do k = 1, input%sweep%n_points
      call system%trace%clear()
      call solve_point(sweep_frequency(input%sweep, k, input%sweep%n_points))
      call replay%run(system%trace)
   end do
   least = replay%least()
   write (output_unit, '(a)') 'part,calls,seconds,floor'
   do part = 1, n_parts
      call write_part(trim(part_names(part)), system%calls(part), system%seconds(part), &
                      least(part))
   end do
   call write_part('first matrices', 1, building, 0.0_wp)

contains

   !> One point of a natural sweep, from the guesses that the program takes.
   subroutine solve_point(omega)
      real(wp), intent(in) :: omega
      type(solver_report) :: report
      type(point_type) :: point
      real(wp), allocatable :: x(:)
      real(wp) :: start, inside
      integer :: guess

      allocate (x(system%n))
      start = processor_time()
      inside = sum(system%seconds) + system%overhead
      call system%set_frequency(omega, error)
      call stop_on(error)
      do guess = 3 - min(known%kept, 2), 3
         call take_guess(guess, omega, x)
         call newton%solve(system, x, report)
         system%calls(part_newton) = system%calls(part_newton) + report%iterations
         if (report%converged) exit
      end do
      if (.not. report%converged) then
         write (error_unit, '(a, i0, a)') 'point ', k, ' does not converge from its guesses'
         stop 1, quiet=.true.
      end if
      call known%remember(omega, x)
      inside = sum(system%seconds) + system%overhead - inside
      system%seconds(part_newton) = system%seconds(part_newton) + processor_time() - start - inside
      start = processor_time()
      call recover_point(system%balance_state, x, input%harmonics%n_harmonics, &
                         input%output%contact, point)
      system%seconds(part_recover) = system%seconds(part_recover) + processor_time() - start
      system%calls(part_recover) = system%calls(part_recover) + 1
      call system%trace%add(event_type(part=part_recover))
   end subroutine solve_point

   !> From the points before, from the last one, or from nothing.
   subroutine take_guess(guess, omega, x)
      integer, intent(in) :: guess
      real(wp), intent(in) :: omega
      real(wp), intent(out), contiguous :: x(:)
      real(wp) :: start

      start = processor_time()
      select case (guess)
      case (1)
         call known%predict(omega, x)
      case (2)
         x = known%x(:, 1)
      case default
         call stuck_guess(system%balance_state, x)
      end select
      system%calls(part_guess) = system%calls(part_guess) + 1
      system%seconds(part_guess) = system%seconds(part_guess) + processor_time() - start
   end subroutine take_guess

   subroutine write_part(name, calls, seconds, floor_seconds)
      character(*), intent(in) :: name
      integer, intent(in) :: calls
      real(wp), intent(in) :: seconds, floor_seconds

      write (output_unit, '(a, ",", i0, 2(",", es12.5))') name, calls, seconds, floor_seconds
   end subroutine write_part

   subroutine stop_on(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      write (error_unit, '(a)') error%message
      stop 1, quiet=.true.
   end subroutine stop_on

end program floor
