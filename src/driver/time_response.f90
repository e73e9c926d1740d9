!> Analysis 'time': the periodic response by integration in time at the frequencies of a sweep,
!> the reference for harmonic balance.
!>
!> The integration starts from the harmonic balance solution of the case, or from its first guess
!> where that does not converge: this saves periods and picks the branch. What is written is the
!> last period as integrated; it is `converged` only where it repeats by itself.
module fw_time_response
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_motion, only: motion_type
   use fw_case, only: analysis_frf, analysis_time, case_type
   use fw_combinations, only: check_combinations
   use fw_cycle_recovery, only: cycle_of_histories
   use fw_error, only: error_type, fatal_error, status_input, status_stopped
   use fw_guess, only: stuck_guess
   use fw_harmonics_options, only: method_hbm
   use fw_interrupt, only: interrupt_type
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_recovery, only: recover_point
   use fw_run_state, only: run_state
   use fw_sensitivity_options, only: sensitivity_options
   use fw_solver_options, only: continuation_natural
   use fw_stress_options, only: stress_options
   use fw_strategy, only: new_request, point_request, point_strategy
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   use fw_time_solution, only: integrate_in_time, time_state
   use fw_time_structure, only: new_time_structure, time_structure
   implicit none (type, external)
   private

   public :: look_by_integration, take_corrected, time_strategy

   !> Tightest relative change from period to period that is asked for: changes of state that move
   !> by one of the smallest steps keep it from vanishing.
   real(wp), parameter :: tightest_change = 1.0e-8_wp
   !> Where a balance fails, harmonics that are looked at over those of the balance, and instants
   !> for each of them.
   integer, parameter :: times = 4, instants = 4

   type, extends(point_strategy) :: time_strategy
      !> The case of which the harmonic balance gives the initial states, and its system.
      class(case_type), allocatable :: start_case
      type(balance_problem) :: problem
      type(balance_state) :: system
      class(point_solver), allocatable :: solver
      !> What is integrated.
      type(time_structure) :: structure
      !> What the last motion does from there on; allocated where that is wanted.
      type(motion_type), allocatable :: motion
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
   end type time_strategy

contains

   !> The harmonic balance that gives initial states, and the structure that is integrated.
   subroutine start(self, case, error)
      class(time_strategy), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call check_steps(case, error)
      if (allocated(error)) return
      allocate (self%solver)
      call case_of_start(case, self%start_case)
      call build_system(self%start_case, self%problem, self%system, error)
      if (allocated(error)) return
      call self%solver%start(self%start_case, self%start_case%harmonics, self%system%n)
      associate (present => self%system%problem%joint%row > 0)
         if (case%analysis == analysis_time) then
            call new_time_structure(case%model, case%contact, case%springs, present, &
                                    self%structure, error, case%elements)
         else
            ! A start of a balance needs a motion, not this one: pairs go on without the others.
            call new_time_structure(case%model, case%contact, case%springs, present, &
                                    self%structure, error)
         end if
      end associate
   end subroutine start

   !> Where a balance of a case has no solution: what an integration comes to at that frequency.
   subroutine look_by_integration(case, omega, interrupt, point, motion, refusal, error)
      type(case_type), intent(in) :: case
      !> [rad/s]
      real(wp), intent(in) :: omega
      class(interrupt_type), intent(inout), target :: interrupt
      type(point_type), intent(out) :: point
      type(motion_type), intent(out) :: motion
      !> Why there is none.
      character(480), intent(out) :: refusal
      !> A stop of the run.
      type(error_type), allocatable, intent(out) :: error
      type(time_strategy), allocatable, target :: integration
      type(case_type), allocatable :: timed

      refusal = ''
      if (case%over%is_wanted() .or. case%control%is_wanted()) then
         refusal = 'is not offered along a parameter or for amplitudes that are given'
         return
      end if
      allocate (timed, source=case)
      call make_timed(omega, timed)
      call check_combinations(timed, error)
      if (.not. allocated(error)) then
         allocate (integration)
         allocate (integration%motion)
         call integration%start(timed, error)
      end if
      if (allocated(error)) then
         refusal = 'is not offered: '//error%message
         deallocate (error)
         return
      end if
      ! Of the motion all that a finer balance would have.
      timed%harmonics%n_harmonics = times*case%harmonics%n_harmonics
      call integration%solve(timed, point_request(omega=omega, fallback=.false., &
                                                  interrupt=interrupt), point, error)
      motion = integration%motion
      if (.not. allocated(error)) return
      if (error%status == status_stopped) return
      refusal = 'failed: '//error%message
      deallocate (error)
   end subroutine look_by_integration

   !> The case as one of an integration, from a state that costs little.
   subroutine make_timed(omega, timed)
      real(wp), intent(in) :: omega
      type(case_type), intent(inout) :: timed

      timed%analysis = analysis_time
      timed%sweep%start = omega
      timed%sweep%end = 0.0_wp
      timed%sweep%n_points = 1
      if (allocated(timed%sweep%frequencies)) deallocate (timed%sweep%frequencies)
      timed%sweep%stability = .false.
      timed%sweep%refine = .false.
      timed%sweep%continuation = continuation_natural
      timed%solver%fallback = .false.
      timed%sensitivity = sensitivity_options()
      timed%stress = stress_options()
      timed%time%steps_per_period = max(timed%time%steps_per_period, &
                                        instants*times*timed%harmonics%n_harmonics)
      timed%harmonics%accuracy = 0.0_wp
      timed%harmonics%n_harmonics = max(1, timed%model%waves%highest())
   end subroutine make_timed

   !> Nothing that the summary shows.
   subroutine describe(self, case, state, summary, message)
      class(time_strategy), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message

      associate (unused => self, unused_case => case, unused_state => state, &
                 unused_summary => summary)
      end associate
      message = ''
   end subroutine describe

   !> The coefficients of the result need instants.
   subroutine check_steps(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: fewest = 16
      integer :: least

      ! N = 4 H instants take harmonic N - n for n: aliases come from harmonics above 3 H only.
      least = max(fewest, 4*case%harmonics%n_harmonics)
      if (case%time%steps_per_period >= least) return
      call fatal_error(error, '&time steps_per_period = '//to_text(case%time%steps_per_period)// &
                       ': must be at least max('//to_text(fewest)//', 4*n_harmonics) = '// &
                       to_text(least), status_input)
   end subroutine check_steps

   !> The case of which the harmonic balance solution gives the initial state: all dofs are
   !> observed.
   subroutine case_of_start(case, start)
      type(case_type), intent(in) :: case
      class(case_type), allocatable, intent(out) :: start
      integer :: i

      ! One solution serves: contact results and histories are those of the integration.
      allocate (start, source=case)
      start%analysis = analysis_frf
      start%harmonics%method = method_hbm
      start%output%contact = .false.
      start%output%histories = .false.
      if (case%sweep%end <= 0.0_wp .or. case%sweep%n_points == 1) start%sweep%end = case%sweep%start
      deallocate (start%model%observe_matrix)
      allocate (start%model%observe_matrix(case%model%n_dof, case%model%n_dof), source=0.0_wp)
      do i = 1, case%model%n_dof
         start%model%observe_matrix(i, i) = 1.0_wp
      end do
   end subroutine case_of_start

   !> Initial state, integration, time spent.
   subroutine solve(self, case, request, point, error)
      class(time_strategy), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(time_state) :: state
      integer(int64) :: clock, clock_end, rate

      call system_clock(clock, rate)
      if (allocated(self%note)) deallocate (self%note)
      call initial_state(self, request, state, error)
      if (allocated(error)) return
      call integrate_in_time(self%structure, case%model%observe_matrix, request%omega, case%time, &
                             max(case%solver%tolerance, tightest_change), state, &
                             case%harmonics%n_harmonics, point, error, request%interrupt, &
                             self%motion)
      if (allocated(error)) return
      ! The integration leaves all; the request says what of it a row has.
      if (request%cycle) call cycle_of_histories(point)
      if (.not. request%histories) then
         deallocate (point%history)
         if (allocated(point%force_history)) deallocate (point%force_history, point%slip_history)
      end if
      if (.not. request%contact .and. allocated(point%force)) then
         deallocate (point%force, point%fraction, point%dissipation)
      end if
      call system_clock(clock_end)
      point%seconds = real(clock_end - clock, wp)/real(rate, wp)
   end subroutine solve

   !> Displacements and velocities at t = 0 of the harmonic balance solution, and where its pairs
   !> stick.
   subroutine initial_state(self, request, state, error)
      type(time_strategy), intent(inout), target :: self
      type(point_request), intent(in) :: request
      type(time_state), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: start
      type(point_type) :: balance
      integer :: h, n_harmonics

      n_harmonics = self%start_case%harmonics%n_harmonics
      start = new_request(self%start_case, request%omega)
      start%interrupt => request%interrupt
      call self%solver%solve(self%start_case, self%system, start, balance, error)
      if (allocated(error)) return
      if (.not. balance%converged) then
         self%note = 'harmonic balance did not converge: the integration in time starts from '// &
                     'the stuck response'
         call stuck_guess(self%system, self%solver%x)
         deallocate (balance%coefficients, balance%amplitude)
         call recover_point(self%system, self%solver%x, n_harmonics, .false., balance)
      end if
      associate (c => balance%coefficients)
         ! At t = 0 the cosines add up to the displacement, n omega times the sines to the
         ! velocity.
         state%displacement = c(1, :)
         allocate (state%velocity(size(c, 2)), source=0.0_wp)
         do h = 1, n_harmonics
            state%displacement = state%displacement + c(2*h, :)
            state%velocity = state%velocity + real(h, wp)*request%omega*c(2*h + 1, :)
         end do
      end associate
      call take_corrected(self%system, self%structure, balance%converged, state)
   end subroutine initial_state

   !> Corrected positions: those of the march where there is one, the displacements themselves
   !> where the law is written in velocities, the unstrained assembly otherwise.
   subroutine take_corrected(system, structure, converged, state)
      type(balance_state), intent(in) :: system
      type(time_structure), intent(in) :: structure
      logical, intent(in) :: converged
      type(time_state), intent(inout) :: state
      integer :: i, c, r

      allocate (state%corrected(2, structure%n_pairs), source=0.0_wp)
      ! A stuck guess has pairs where they were assembled: x = 0.
      if (.not. converged) return
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction, &
                 contact => system%work(system%problem%forces%pairs))
         do i = 1, structure%n_pairs
            do c = 1, 2
               r = structure%row(c, i)
               if (r == 0) cycle
               if (p%order_of(i, c) > 0) then
                  state%corrected(c, i) = dot_product(structure%rows(:, r), state%displacement)
               else if (p%stiffness(i, c) > 0.0_wp) then
                  state%corrected(c, i) = contact%x(i, c)/p%stiffness(i, c)
               end if
            end do
         end do
      end associate
   end subroutine take_corrected

end module fw_time_response
