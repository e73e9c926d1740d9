!> Analysis 'ringdown': free decay. The structure is released at rest from where it stands without
!> vibration, moved by the shape of a mode with its closed pairs stuck, and integrated in time.
!> Frequency and damping over the amplitude follow from the extremes of the first observed quantity:
!> damping of one motion, to be held against a nonlinear mode or a measured decay.
module fw_run_ringdown
   use fw_analysis, only: analysis, run_type
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_free_decay, only: bring_to_start, find_extremes, integrate_decay
   use fw_guess, only: stuck_guess
   use fw_harmonics_options, only: harmonics_options
   use fw_kinds, only: pi, wp
   use fw_memory, only: require_memory
   use fw_newton, only: newton_solver, solver_report
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_recovery, only: recover_point
   use fw_remarks, only: remark_unused
   use fw_ringdown_group, only: ringdown_group
   use fw_stuck_modes, only: find_stuck_modes, stuck_modes
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   use fw_time_response, only: take_corrected
   use fw_time_solution, only: time_state
   use fw_time_structure, only: new_time_structure, time_structure
   implicit none (type, external)
   private

   public :: ringdown_analysis

   !> The structure at rest, and the mode from whose shape it is released.
   type, extends(analysis) :: ringdown_analysis
      type(balance_problem), private :: problem
      type(balance_state), private :: balance
      type(time_structure), private :: structure
      !> Where it stands without vibration, then where it is released.
      type(time_state), private :: state
      !> Of the stuck mode [rad/s], and its shape with the amplitude wanted (n_dof) [length].
      real(wp), private :: omega = 0.0_wp
      real(wp), allocatable, private :: shape(:)
      !> Whether another mode has its frequency: the shape is one of many.
      logical, private :: is_repeated = .false.
   contains
      procedure :: start
      procedure :: check
   end type ringdown_analysis

   !> Part of its largest entry below which the observed quantity is at a node of the mode.
   real(wp), parameter :: node = 1.0e-8_wp
   !> Frequencies nearer to each other than this part are one.
   real(wp), parameter :: alike = 1.0e-6_wp
   !> Swings below this part of the amplitude are round-off.
   real(wp), parameter :: least_swing = 1.0e-12_wp
   !> Residual of the position at rest: the decay starts from it.
   real(wp), parameter :: rest_tolerance = 1.0e-11_wp
   !> Lines of the table.
   integer, parameter :: most_shown = 10

contains

   !> All at once: there are no rows of points.
   subroutine start(self, case, run, error)
      class(ringdown_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(ringdown_group) :: group
      real(wp) :: n_reals

      call remark_unused(case, run%summary%remarks)
      associate (options => case%ringdown)
         n_reals = 3.0_wp*real(options%n_cycles, wp)*real(options%steps_per_period, wp)* &
                   real(1 + size(case%model%observe_matrix, 1), wp)
         call require_memory(n_reals, '&ringdown n_cycles = '//to_text(options%n_cycles)// &
                             ' times steps_per_period = '//to_text(options%steps_per_period), &
                             'take fewer', error)
         if (.not. allocated(error)) call self%check(case, error)
         if (allocated(error)) return
         if (self%is_repeated) call run%summary%remarks%add('repeated mode', '&ringdown '// &
            'number = '//to_text(options%number)//': another mode with closed pairs stuck has '// &
            'its frequency, and the shape of the release is one of many: decays of others '// &
            'may differ with contact')
         call integrate_decay(self%structure, case%model%observe_matrix, self%omega, &
                              options%n_cycles, options%steps_per_period, self%state, &
                              group%time, group%observed, error, run%observer)
         if (allocated(error)) return
         group%stuck_omega = self%omega
         call find_extremes(group%time, group%observed, least_swing*options%amplitude, &
                            group%extreme_time, group%extreme_value)
      end associate
      call measure_swings(group)
      call run%writer%add(group, error)
      if (.not. allocated(error)) call make_table(group, run%table)
   end subroutine start

   !> Up to the release.
   subroutine check(self, case, error)
      class(ringdown_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      class(case_type), allocatable :: still

      call case_at_rest(case, still)
      call build_system(still, self%problem, self%balance, error, keep_all=.true.)
      if (allocated(error)) return
      associate (present => self%problem%joint%row > 0)
         call new_time_structure(case%model, case%contact, case%springs, present, &
                                 self%structure, error, case%elements)
      end associate
      if (.not. allocated(error)) call come_to_rest(self, still, error)
      if (.not. allocated(error)) call take_shape(self, case, error)
      if (.not. allocated(error)) call keep_apart(self, case, error)
      if (allocated(error)) return
      ! The load that vibrates is over.
      self%structure%load(:, 2:) = 0.0_wp
      call bring_to_start(self%structure, self%shape, self%state)
   end subroutine check

   !> One harmonic balances what does not vibrate; all dofs are observed.
   subroutine case_at_rest(case, still)
      type(case_type), intent(in) :: case
      class(case_type), allocatable, intent(out) :: still
      integer :: i

      allocate (still, source=case)
      ! Nothing is condensed, nor left out because no load moves it.
      still%analysis = findloc(analyses%is_free, .true., dim=1)
      still%harmonics = harmonics_options()
      still%harmonics%n_harmonics = max(1, case%model%waves%highest())
      still%sweep%start = order_of_frequency(case)
      still%sweep%end = still%sweep%start
      deallocate (still%model%observe_matrix)
      allocate (still%model%observe_matrix(case%model%n_dof, case%model%n_dof), source=0.0_wp)
      do i = 1, case%model%n_dof
         still%model%observe_matrix(i, i) = 1.0_wp
      end do
   end subroutine case_at_rest

   !> Of the structure [rad/s].
   pure real(wp) function order_of_frequency(case) result(omega)
      type(case_type), intent(in) :: case
      real(wp) :: stiffness, mass

      omega = 1.0_wp
      stiffness = norm2(case%model%stiffness)
      mass = norm2(case%model%mass)
      if (mass > 0.0_wp .and. stiffness > 0.0_wp) omega = sqrt(stiffness/mass)
   end function order_of_frequency

   !> Displacement without vibration, and where pairs stick there.
   subroutine come_to_rest(self, still, error)
      class(ringdown_analysis), intent(inout), target :: self
      class(case_type), intent(in) :: still
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      type(solver_report) :: report
      type(point_type) :: rest
      real(wp), allocatable :: x(:), r(:)

      self%balance%load_share = 0.0_wp
      call self%balance%set_point(still%sweep%start, 0.0_wp, error)
      if (allocated(error)) return
      allocate (x(self%balance%n), r(self%balance%n), source=0.0_wp)
      call stuck_guess(self%balance, x)
      newton%options = still%solver
      newton%options%tolerance = min(rest_tolerance, still%solver%tolerance)
      call newton%solve(self%balance, x, report)
      ! As far as round-off lets it.
      if (.not. (report%converged .or. report%residual <= still%solver%tolerance)) then
         call fatal_error(error, "case%analysis = 'ringdown': no position at rest was found, "// &
                          'from which the structure could be released: see that the static '// &
                          'loads can be held', status_failure)
         return
      end if
      call self%balance%residual(x, r)
      call recover_point(self%balance, x, still%harmonics%n_harmonics, .false., rest)
      self%state%displacement = rest%coefficients(1, :)
      allocate (self%state%velocity(size(self%state%displacement)), source=0.0_wp)
      call take_corrected(self%balance, self%structure, .true., self%state)
   end subroutine come_to_rest

   !> The mode with closed pairs stuck, scaled.
   subroutine take_shape(self, case, error)
      class(ringdown_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(stuck_modes) :: modes
      complex(wp), allocatable :: coordinates(:)
      real(wp) :: observed
      logical :: done

      call find_stuck_modes(self%balance, modes, done)
      associate (number => case%ringdown%number)
         if (done) done = number <= size(modes%omega)
         if (.not. done) then
            call fatal_error(error, '&ringdown number = '//to_text(number)//': the structure '// &
                             'with its closed pairs stuck has '//to_text(n_modes())// &
                             ' elastic modes', status_input)
            return
         end if
         allocate (coordinates(size(modes%observe, 2)))
         call modes%undamped(number, coordinates)
         self%omega = modes%omega(number)
         self%is_repeated = count(abs(modes%omega - self%omega) <= alike*self%omega) > 1
      end associate
      self%shape = real(matmul(modes%observe, coordinates), wp)
      observed = dot_product(case%model%observe_matrix(1, :), self%shape)
      if (abs(observed) <= node*maxval(abs(case%model%observe_matrix(1, :)))* &
          maxval(abs(self%shape))) then
         call fatal_error(error, 'output%observe: the first observed quantity is at a node of '// &
                          'mode '//to_text(case%ringdown%number)//': name another', status_input)
         return
      end if
      self%shape = case%ringdown%amplitude/observed*self%shape

   contains

      !> None where nothing was found.
      pure integer function n_modes()
         n_modes = 0
         if (allocated(modes%omega)) n_modes = size(modes%omega)
      end function n_modes

   end subroutine take_shape

   !> A rigid pair cannot be released from behind its surface: the integration would take it for
   !> open until it comes back. Elastic ones are pressed there.
   subroutine keep_apart(self, case, error)
      class(ringdown_analysis), intent(in) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: rest(self%structure%n_rows), way(self%structure%n_rows), share, least
      integer :: i, r, first

      rest = matmul(self%state%displacement, self%structure%rows)
      way = matmul(self%shape, self%structure%rows)
      least = 1.0_wp
      first = 0
      do i = 1, self%structure%n_pairs
         r = self%structure%row(3, i)
         if (r == 0) cycle
         if (self%structure%compliance(r) > 0.0_wp) cycle
         ! The rows of closed ones are round-off in the shape.
         if (way(r) >= -node*maxval(abs(self%shape))) cycle
         share = max(0.0_wp, rest(r) + self%structure%gap(i))/(-way(r))
         if (share >= least) cycle
         least = share
         first = i
      end do
      if (first == 0) return
      call fatal_error(error, '&ringdown amplitude = '//to_text(case%ringdown%amplitude)// &
                       ': pair '//to_text(first)//', which is rigid and open at rest, would be '// &
                       'released behind its surface: take at most '// &
                       to_text(least*case%ringdown%amplitude)//", or law = 'penalty'", &
                       status_input)
   end subroutine keep_apart

   !> From one extreme to the next.
   subroutine measure_swings(group)
      type(ringdown_group), intent(inout) :: group
      integer :: m, n

      n = size(group%extreme_time)
      ! Fewer than none are an extent that the result cannot have.
      m = max(0, n - 3)
      associate (at => group%extreme_time, value => group%extreme_value)
         group%amplitude = 0.5_wp*abs(value(:, 2:) - value(:, :n - 1))
         group%omega = pi/(at(2:) - at(:n - 1))
      end associate
      associate (a => group%amplitude)
         ! Of what does not swing any more there is none.
         group%damping_ratio = log(a(1, :m)/a(1, 3:m + 2))
         ! Of a linear mode it is the fraction of critical damping, large ones included.
         group%damping_ratio = group%damping_ratio/sqrt((2.0_wp*pi)**2 + group%damping_ratio**2)
      end associate
   end subroutine measure_swings

   !> Frequency and damping over the amplitude.
   subroutine make_table(group, table)
      type(ringdown_group), intent(in) :: group
      !> For the summary, a head first.
      type(string_type), allocatable, intent(out) :: table(:)
      character(80) :: line
      integer :: i, k, n, n_rows

      allocate (table(0))
      n = size(group%damping_ratio)
      if (n == 0) then
         call append(table, 'fewer than two swings: take more ringdown%n_cycles')
         return
      end if
      call append(table, '  time [s]       amplitude      omega [rad/s]  damping ratio')
      n_rows = min(n, most_shown)
      do i = 1, n_rows
         k = 1
         if (n_rows > 1) k = 1 + ((i - 1)*(n - 1))/(n_rows - 1)
         write (line, '(4es15.6)') group%extreme_time(k + 1), group%amplitude(1, k + 1), &
            group%omega(k + 1), group%damping_ratio(k)
         call append(table, trim(line))
      end do
   end subroutine make_table

end module fw_run_ringdown
