!> Where a nonlinear mode starts: the structure with nothing condensed, at rest, and its mode with
!> closed pairs stuck.
module fw_mode_start
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_force_law, only: pair_open
   use fw_fourier, only: to_real
   use fw_guess, only: stuck_guess
   use fw_kinds, only: wp
   use fw_memory, only: require_memory
   use fw_mode_options, only: control_observed
   use fw_mode_system, only: mode_system, new_mode_system
   use fw_newton, only: newton_solver, solver_report
   use fw_problem, only: build_system
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_lu
   use fw_structure_operator, only: structure_state
   use fw_stuck_modes, only: find_stuck_modes, stuck_modes
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: mode_start, node

   !> Frequencies of linear modes with stuck and with sliding pairs [rad/s].
   type :: joint_frequencies
      real(wp), allocatable :: stuck(:), sliding(:)
   end type joint_frequencies

   !> Everything that a curve needs; not to be moved once it is built.
   type :: mode_start
      !> The case, as the structure of a mode is built from it.
      class(case_type), allocatable :: case
      class(balance_problem), allocatable :: problem
      class(balance_state), allocatable :: balance
      class(mode_system), allocatable :: system
      !> Number among the elastic modes with stuck pairs.
      integer :: number = 0
      !> Frequency and self-excitation there [rad/s].
      real(wp) :: omega = 0.0_wp, self_excitation = 0.0_wp
      !> With stuck pairs there is no mode: this is the one with sliding pairs, which the curve
      !> tends to at high amplitudes.
      logical :: slides = .false.
      !> Those that each harmonic may meet (n_retained).
      type(joint_frequencies), allocatable :: met(:)
      !> The stuck motion as unknowns of the mode.
      real(wp), allocatable :: y(:)
      !> Vibratory load of the case, harmonic 1 (n_coordinates) [force].
      complex(wp), allocatable :: load(:)
   contains
      procedure :: build
   end type mode_start

   !> Part of its size below which a mode has a node.
   real(wp), parameter :: node = 1.0e-8_wp
   !> Residual of the position at rest: the first guess of the curve, not its result.
   real(wp), parameter :: rest_tolerance = 1.0e-6_wp

contains

   !> Build the problem and find the mode; refuse what has no such mode. Its onset is looked for
   !> later, from points of the curve (fw_mode_onset).
   subroutine build(self, case, error)
      class(mode_start), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(stuck_modes) :: modes
      real(wp), allocatable :: x(:)

      allocate (self%problem, self%balance, self%system)
      allocate (self%case, source=case)
      self%case%sweep%start = rough_frequency(case)
      call check_size(case, error)
      if (.not. allocated(error)) call at_rest(self, x, modes, error)
      if (.not. allocated(error)) call choose(self, modes, error)
      if (allocated(error)) return
      if (is_wave(case)) then
         ! Waves of other nodal diameters that harmonics may meet stay as coordinates.
         self%case%sweep%start = modes%frequency()
         call at_rest(self, x, modes, error)
      else if (self%problem%forces%takes_balance()) then
         ! Their numbers of the method are those of the structure near the frequency of the mode.
         self%case%sweep%start = modes%frequency()
         call scale_anew(self, x, modes, error)
      end if
      ! Of other modes: the same one.
      if (.not. allocated(error) .and. modes%choice%number == 0) call choose(self, modes, error)
      if (allocated(error)) return
      call note_frequencies(self, modes)
      call take_mode(self, modes, x, error)
   end subroutine build

   !> A frequency of the structure's order [rad/s]; of a cyclic one far below, so that no modes of
   !> other nodal diameters are kept for it.
   pure real(wp) function rough_frequency(case) result(omega)
      type(case_type), intent(in) :: case
      real(wp), parameter :: far_below = 1.0e-3_wp
      real(wp) :: stiffness, mass

      omega = 1.0_wp
      associate (cyclic => case%model%cyclic)
         if (cyclic%has_nodal()) then
            associate (nodal => cyclic%nodal(abs(cyclic%nodal_diameter(1)) + 1))
               if (.not. allocated(nodal%mass)) return
               stiffness = norm2(abs(nodal%stiffness))
               mass = norm2(abs(nodal%mass))
            end associate
         else
            stiffness = norm2(case%model%stiffness)
            mass = norm2(case%model%mass)
         end if
         if (mass > 0.0_wp .and. stiffness > 0.0_wp) omega = sqrt(stiffness/mass)
         if (cyclic%is_cyclic) omega = far_below*omega
      end associate
   end function rough_frequency

   !> Nothing is condensed: linear modes of all dofs, a matrix of them for each harmonic, and
   !> directions of GMRES.
   subroutine check_size(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: directions = 70.0_wp
      real(wp) :: n, nh
      integer :: m

      m = case%model%n_dof
      if (case%model%cyclic%has_nodal()) then
         associate (nodal => case%model%cyclic%nodal(abs(case%model%cyclic%nodal_diameter(1)) + 1))
            if (allocated(nodal%mass)) m = size(nodal%mass, 1)
         end associate
      end if
      m = m*case%model%cyclic%n_solved()
      n = real(m, wp)
      nh = real(case%harmonics%n_harmonics + 1, wp)
      if (m > sizes%dofs_of_mode) then
         call fatal_error(error, "case%analysis = 'mode' condenses nothing: the model has "// &
                          to_text(m)//' dofs, '//to_text(sizes%dofs_of_mode)// &
                          ' at most; reduce it (fretwear reduce)', status_input)
         return
      end if
      call require_memory(3.0_wp*nh*n**2 + 2.0_wp*directions*nh*n, &
                          "analysis = 'mode' with "//to_text(m)// &
                          ' dofs and harmonics%n_harmonics = '// &
                          to_text(case%harmonics%n_harmonics), &
                          'reduce the model (fretwear reduce), or take fewer harmonics', error)
   end subroutine check_size

   !> A wave of one nodal diameter: not all sectors together, nor a structure that is none.
   pure logical function is_wave(case)
      type(case_type), intent(in) :: case

      is_wave = case%model%cyclic%is_cyclic .and. .not. case%model%cyclic%is_mistuned
   end function is_wave

   !> The problem, and its modes about the position at rest x.
   subroutine at_rest(self, x, modes, error)
      class(mode_start), intent(inout), target :: self
      real(wp), allocatable, intent(out) :: x(:)
      type(stuck_modes), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error

      call build_system(self%case, self%problem, self%balance, error, keep_all=.true.)
      if (allocated(error)) return
      if (self%balance%n == 0) then
         call fatal_error(error, "case%analysis = 'mode' needs contact pairs or springs: of a "// &
                          "linear structure take 'modes'", status_input)
         return
      end if
      if (self%case%solver%linear == linear_lu .and. self%balance%n > sizes%unknowns_of_mode) then
         call fatal_error(error, "solver%linear = 'lu' with case%analysis = 'mode' factors a "// &
                          'dense matrix of all unknowns: '//to_text(self%balance%n)//' here, '// &
                          to_text(sizes%unknowns_of_mode)// &
                          " at most; leave it to 'auto'", status_input)
         return
      end if
      allocate (x(self%balance%n), source=0.0_wp)
      call come_to_rest(self, .true., x, error)
      if (.not. allocated(error)) call find_modes(self, modes, error)
   end subroutine at_rest

   !> The problem of a structure of which nothing is condensed, at another frequency: its laws take
   !> their stiffness there, all else is as it was.
   subroutine scale_anew(self, x, modes, error)
      class(mode_start), intent(inout), target :: self
      !> The position at rest and the modes about it.
      real(wp), intent(inout), contiguous :: x(:)
      type(stuck_modes), intent(inout) :: modes
      type(error_type), allocatable, intent(out) :: error
      class(structure_state), allocatable :: stand
      integer, allocatable :: before(:)

      associate (pairs => self%problem%forces%pairs)
         before = self%balance%work(pairs)%state
         call move_alloc(self%balance%structure_state, stand)
         call self%problem%structure%at(stand, self%case%sweep%start, 0.0_wp, error)
         if (allocated(error)) return
         call self%problem%scale_forces(stand, self%case%sweep%start)
         call new_balance_state(self%problem, self%balance, stand)
         call come_to_rest(self, .false., x, error)
         if (allocated(error)) return
         ! Stuck pairs are held whatever their stiffness; what is open, and slopes of springs, may
         ! have changed.
         if (self%problem%forces%n_laws == 1 .and. &
             all((before == pair_open) .eqv. (self%balance%work(pairs)%state == pair_open))) return
      end associate
      call find_modes(self, modes, error)
   end subroutine scale_anew

   !> The position at rest, or the guess where none is found.
   subroutine come_to_rest(self, guesses, x, error)
      class(mode_start), intent(inout), target :: self
      !> Take a guess of its own, not the one in x.
      logical, intent(in) :: guesses
      real(wp), intent(inout), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      type(solver_report) :: report
      real(wp) :: r(size(x)), guess(size(x))

      call take_load(self)
      self%balance%load_share = 0.0_wp
      call self%balance%set_point(self%case%sweep%start, 0.0_wp, error)
      if (allocated(error)) return
      if (guesses) call stuck_guess(self%balance, x)
      guess = x
      newton%options = self%case%solver
      newton%options%tolerance = max(rest_tolerance, self%case%solver%tolerance)
      call newton%solve(self%balance, x, report)
      if (.not. report%converged) x = guess
      call self%balance%residual(x, r)
   end subroutine come_to_rest

   !> The modes where the balance was evaluated last.
   subroutine find_modes(self, modes, error)
      class(mode_start), intent(inout) :: self
      type(stuck_modes), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      call find_stuck_modes(self%balance, modes, done)
      if (done) done = size(modes%omega) > 0
      self%slides = .not. done .and. self%problem%n_pairs > 0
      if (self%slides) call find_stuck_modes(self%balance, modes, done, slides=.true.)
      if (done) return
      call fatal_error(error, "case%analysis = 'mode': with its closed pairs stuck nothing of "// &
                       'the structure can vibrate, or a part has neither stiffness nor mass', &
                       status_input)
   end subroutine find_modes

   !> Frequencies that harmonics of the curve may meet: of a cyclic structure each has its own nodal
   !> diameter.
   subroutine note_frequencies(self, modes)
      class(mode_start), intent(inout) :: self
      type(stuck_modes), intent(in) :: modes
      type(stuck_modes) :: other
      logical :: done
      integer :: h

      allocate (self%met(self%problem%fourier%n_retained))
      do h = 1, size(self%met)
         ! Forces of the air act above harmonic 0 alone.
         if (h > merge(2, 1, self%case%model%cyclic%is_cyclic) .and. .not. is_wave(self%case)) then
            self%met(h) = self%met(h - 1)
            cycle
         end if
         allocate (self%met(h)%stuck(0), self%met(h)%sliding(0))
         if (self%slides) then
            call modes%list(self%met(h)%sliding)
            cycle
         end if
         call find_stuck_modes(self%balance, other, done, harmonic=h)
         if (done) call other%list(self%met(h)%stuck)
         if (self%problem%n_pairs == 0) cycle
         call find_stuck_modes(self%balance, other, done, slides=.true., harmonic=h)
         if (done) call other%list(self%met(h)%sliding)
      end do
   end subroutine note_frequencies

   !> The load that a response of the same case has.
   subroutine take_load(self)
      class(mode_start), intent(inout) :: self

      associate (h => findloc(self%problem%fourier%harmonic, 1, dim=1))
         self%load = self%balance%structure_state%load(:, h)
      end associate
   end subroutine take_load

   !> By number or by frequency; double modes are refused.
   subroutine choose(self, modes, error)
      class(mode_start), intent(inout) :: self
      type(stuck_modes), intent(inout) :: modes
      type(error_type), allocatable, intent(out) :: error
      ! Texts that functions return are kept in static memory: a variable here.
      character(:), allocatable :: name, left_out

      call modes%choose(self%case%mode%number, self%case%mode%near)
      associate (choice => modes%choice)
         self%number = choice%number
         name = '&mode number = '//to_text(choice%number)
         left_out = ''
         if (choice%n_overdamped > 0) left_out = ' that oscillate; '// &
            to_text(choice%n_overdamped)//' with damping ratios of 1 and more do not count'
         if (.not. choice%done) then
            call fatal_error(error, "case%analysis = 'mode': the linear modes with closed "// &
                             'pairs stuck were not found: check mass, stiffness and damping of '// &
                             'the model for entries that are out of proportion', status_input)
         else if (choice%n_modes + choice%n_overdamped == 0) then
            call fatal_error(error, "case%analysis = 'mode': with its closed pairs stuck the "// &
                             'structure has no elastic mode (rigid motions do not count): '// &
                             'check the stiffness', status_input)
         else if (choice%n_modes == 0) then
            call fatal_error(error, "case%analysis = 'mode': with its closed pairs stuck the "// &
                             'structure has no elastic mode that oscillates ('// &
                             to_text(choice%n_overdamped)//' are overdamped): lower the '// &
                             'damping', status_input)
         else if (choice%number > choice%n_modes) then
            call fatal_error(error, name//': the structure with its closed pairs stuck has '// &
                             to_text(choice%n_modes)//' elastic modes'//left_out, status_input)
         else if (choice%twin > 0) then
            call fatal_error(error, name//': modes '//to_text(min(choice%twin, choice%number))// &
                             ' and '//to_text(max(choice%twin, choice%number))//' with stuck '// &
                             'pairs have one frequency ('//to_text(choice%mode%omega)// &
                             ' rad/s) and one damping, so that the plane of the motion is '// &
                             'free: detune the structure', status_input)
         end if
      end associate
   end subroutine choose

   !> The mode with its damping, and the system of its curve at the lowest amplitude.
   subroutine take_mode(self, modes, x, error)
      class(mode_start), intent(inout), target :: self
      type(stuck_modes), intent(in) :: modes
      real(wp), intent(in) :: x(:)
      type(error_type), allocatable, intent(out) :: error
      complex(wp), dimension(size(modes%observe, 2)) :: shape, about, phi
      logical :: done

      ! Without phase of its own where the first observed quantity does not move.
      about = modes%observe(1, :)
      phi = modes%shape_of()
      if (abs(sum(about*phi)) <= node*norm2(abs(about))*norm2(abs(phi))) then
         if (self%case%mode%control == control_observed) then
            call fatal_error(error, 'output%observe: the first observed quantity is at a '// &
                             'node of mode '//to_text(self%number)//': name another, or '// &
                             "take &mode control = 'modal'", status_input)
            return
         end if
         about = conjg(phi)
      end if
      call modes%refine(about, self%omega, self%self_excitation, shape, done)
      if (.not. done) then
         call fatal_error(error, '&mode number = '//to_text(self%number)//': the mode at '// &
                          to_text(modes%choice%mode%omega)//' rad/s was not found exactly with '// &
                          'its damping, since another is next to it: detune the structure, or '// &
                          'check the damping', status_input)
         return
      end if
      call new_mode_system(self%balance, self%case%mode%control, self%omega, self%system)
      call scale_mode(self, x, shape)
   end subroutine take_mode

   !> A mode of amplitude one, and the sizes to which residuals are compared.
   subroutine scale_mode(self, x, shape)
      class(mode_start), intent(inout) :: self
      real(wp), intent(in) :: x(:)
      !> U_1 (n_coordinates).
      complex(wp), intent(in) :: shape(:)
      type(error_type), allocatable :: ignored
      real(wp), allocatable :: q(:)
      complex(wp), allocatable :: amplitude(:, :)
      real(wp) :: modal, size_of_shape
      integer :: m

      m = size(shape)
      associate (fourier => self%problem%fourier, system => self%system)
         system%amplitude = 1.0_wp
         modal = 1.0_wp
         size_of_shape = 1.0_wp
         if (system%control /= control_observed) then
            modal = sqrt(real(dot_product(shape, matmul(system%mass, shape)), wp))
            size_of_shape = norm2(abs(shape))
         end if
         system%inertia = self%omega**2*norm2(abs(matmul(system%mass, shape)))/size_of_shape
         call system%measure_by(size_of_shape/modal, &
                                self%case%mode%end*maxval(abs(real(shape, wp)))/modal)
         allocate (amplitude(m, fourier%n_retained), source=(0.0_wp, 0.0_wp))
         amplitude(:, system%first) = shape/modal
         allocate (q(size(x)), self%y(system%n))
         call to_real(fourier, m, amplitude, q)
         if (fourier%has_constant()) q(:m) = x(:m)
         call system%from_balance(q, self%omega, self%self_excitation, self%y)
         call system%remember(self%y)
         system%static_load = static_size(self%balance)
         call system%set_parameter(log(self%case%mode%start), ignored)
      end associate
   end subroutine scale_mode

   !> Static loads, and what interferences would press with [force].
   real(wp) function static_size(balance) result(force)
      type(balance_state), intent(in) :: balance
      real(wp) :: pressing(size(balance%depth)), slope
      integer :: i

      force = 0.0_wp
      if (.not. balance%problem%fourier%has_constant()) return
      force = norm2(balance%load(:, 1))
      associate (law => balance%problem%forces%entry(balance%problem%forces%pairs)%law)
         if (size(balance%depth) == 0) return
         do i = 1, size(pressing)
            call law%press_at(i, law%prediction%stiffness(i, 3)*min(law%prediction%gap(i), &
                                                                    0.0_wp), pressing(i), slope)
         end do
         force = force + norm2(pressing)
      end associate
   end function static_size

end module fw_mode_start
