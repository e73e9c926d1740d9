!> Functions of arrays for the Python module fretwear._core, beside the sessions of wrapper.f90 and
!> in their style: transforms, condensation, contact forces.
module fw_python_functions
   use fw_error, only: error_type, status_ok
   use fw_force_law, only: force_workspace
   use fw_fourier, only: fourier_type, new_fourier
   use fw_friction, only: friction_law, rigid_friction, rigid_friction_of_rates
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_plain_structure, only: plain_structure
   use fw_python_operators, only: build_condensation, unpack_jacobian
   use fw_recovery, only: largest_magnitude
   use fw_structure_operator, only: structure_state
   implicit none (type, external)
   private

   public :: harmonic_operators, to_time, to_coefficients, differentiate, amplitudes
   public :: dynamic_stiffness, condense, recover, contact_forces

contains

   !> Values of the base functions at the instants, and weights of the projection.
   subroutine harmonic_operators(n_harmonics, odd_only, n_coefficients, n_time, synthesis, analysis)
      integer, intent(in) :: n_harmonics, odd_only, n_coefficients, n_time
      real(wp), intent(inout) :: synthesis(n_coefficients, n_time)
      real(wp), intent(inout) :: analysis(n_coefficients, n_time)
      type(fourier_type) :: fourier
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, n_time, odd_only /= 0)
      synthesis = fourier%synthesis
      analysis = fourier%analysis
   end subroutine harmonic_operators

   subroutine to_time(n_harmonics, odd_only, n_rows, n_coefficients, n_time, coefficients, values)
      integer, intent(in) :: n_harmonics, odd_only, n_rows, n_coefficients, n_time
      real(wp), intent(in) :: coefficients(n_rows, n_coefficients)
      real(wp), intent(inout) :: values(n_rows, n_time)
      type(fourier_type) :: fourier
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, n_time, odd_only /= 0)
      call fourier%to_time(n_rows, coefficients, values)
   end subroutine to_time

   subroutine to_coefficients(n_harmonics, odd_only, n_rows, n_coefficients, n_time, values, &
                              coefficients)
      integer, intent(in) :: n_harmonics, odd_only, n_rows, n_coefficients, n_time
      real(wp), intent(in) :: values(n_rows, n_time)
      real(wp), intent(inout) :: coefficients(n_rows, n_coefficients)
      type(fourier_type) :: fourier
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, n_time, odd_only /= 0)
      call fourier%to_coefficients(n_rows, values, coefficients)
   end subroutine to_coefficients

   subroutine differentiate(n_harmonics, odd_only, n_rows, n_coefficients, coefficients, derivative)
      integer, intent(in) :: n_harmonics, odd_only, n_rows, n_coefficients
      real(wp), intent(in) :: coefficients(n_rows, n_coefficients)
      real(wp), intent(inout) :: derivative(n_rows, n_coefficients)
      type(fourier_type) :: fourier
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, 2*n_harmonics + 1, odd_only /= 0)
      call fourier%differentiate(n_rows, coefficients, derivative)
   end subroutine differentiate

   !> Largest magnitude over the period of every row.
   subroutine amplitudes(n_rows, n_coefficients, coefficients, largest)
      integer, intent(in) :: n_rows, n_coefficients
      real(wp), intent(in) :: coefficients(n_rows, n_coefficients)
      real(wp), intent(inout) :: largest(n_rows)
      integer :: i
      !f2py threadsafe

      do i = 1, n_rows
         largest(i) = largest_magnitude(coefficients(i, :))
      end do
   end subroutine amplitudes

   !> Z = K - s^2 M + i s C, s = n omega, for every harmonic n.
   subroutine dynamic_stiffness(n, n_harmonics, mass, damping, stiffness, harmonic, omega, z)
      integer, intent(in) :: n, n_harmonics
      real(wp), intent(in) :: mass(n, n), damping(n, n), stiffness(n, n)
      integer, intent(in) :: harmonic(n_harmonics)
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: z(n, n, n_harmonics)
      real(wp) :: s
      integer :: h
      !f2py threadsafe

      do h = 1, n_harmonics
         s = real(harmonic(h), wp)*omega
         z(:, :, h) = cmplx(stiffness - s**2*mass, s*damping, wp)
      end do
   end subroutine dynamic_stiffness

   !> Condensed stiffness and load of the relative displacements.
   subroutine condense(n, n_rows, n_harmonics, mass, damping, stiffness, load, side_1, side_2, &
                       harmonic, omega, z, f, status, message)
      integer, intent(in) :: n, n_rows, n_harmonics
      real(wp), intent(in) :: mass(n, n), damping(n, n), stiffness(n, n), load(n, 3)
      integer, intent(in) :: side_1(n_rows), side_2(n_rows), harmonic(n_harmonics)
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: z(n_rows, n_rows, n_harmonics), f(n_rows, n_harmonics)
      integer, intent(out) :: status
      character(512), intent(out) :: message
      type(plain_structure) :: structure
      class(structure_state), allocatable :: state
      type(error_type), allocatable :: error
      integer :: h
      !f2py threadsafe

      call build_condensation(model_of(n, mass, damping, stiffness, load), side_1, side_2, &
                              harmonic, omega, structure, state, error)
      call pass_on(error, status, message)
      if (status /= status_ok) return
      do h = 1, n_harmonics
         call structure%block(state, h, z(:, :, h))
      end do
      f = state%load
   end subroutine condense

   !> All displacements from the relative ones.
   subroutine recover(n, n_rows, n_harmonics, mass, damping, stiffness, load, side_1, side_2, &
                      harmonic, omega, q, u, status, message)
      integer, intent(in) :: n, n_rows, n_harmonics
      real(wp), intent(in) :: mass(n, n), damping(n, n), stiffness(n, n), load(n, 3)
      integer, intent(in) :: side_1(n_rows), side_2(n_rows), harmonic(n_harmonics)
      real(wp), intent(in) :: omega
      complex(wp), intent(in) :: q(n_rows, n_harmonics)
      complex(wp), intent(inout) :: u(n, n_harmonics)
      integer, intent(out) :: status
      character(512), intent(out) :: message
      type(plain_structure) :: structure
      class(structure_state), allocatable :: state
      type(error_type), allocatable :: error
      !f2py threadsafe

      call build_condensation(model_of(n, mass, damping, stiffness, load), side_1, side_2, &
                              harmonic, omega, structure, state, error)
      call pass_on(error, status, message)
      if (status == status_ok) call structure%recover(state, q, u)
   end subroutine recover

   !> A structure of which every displacement is observed.
   pure function model_of(n, mass, damping, stiffness, load) result(model)
      integer, intent(in) :: n
      real(wp), intent(in) :: mass(n, n), damping(n, n), stiffness(n, n), load(n, 3)
      type(model_type) :: model
      integer :: i

      model%n_dof = n
      model%mass = mass
      model%damping = damping
      model%stiffness = stiffness
      model%load_static = load(:, 1)
      model%load_cosine = load(:, 2)
      model%load_sine = load(:, 3)
      allocate (model%observe_matrix(n, n), source=0.0_wp)
      do i = 1, n
         model%observe_matrix(i, i) = 1.0_wp
      end do
   end function model_of

   pure subroutine pass_on(error, status, message)
      type(error_type), allocatable, intent(in) :: error
      integer, intent(out) :: status
      character(512), intent(out) :: message

      status = status_ok
      message = ''
      if (.not. allocated(error)) return
      status = error%status
      message = error%message
   end subroutine pass_on

   !> Contact forces of all pairs over a period from the predicted ones, and on request their
   !> derivative: (coefficient, component) of the prediction, then of the force, pair.
   subroutine contact_forces(n_harmonics, odd_only, n_pairs, n_coefficients, n_time, remembers, &
                             mu, present_components, offset, start, prediction, force, &
                             force_time, finish, state, fraction, periodic, with_jacobian, &
                             n_jacobian, n_blocks, jacobian)
      integer, intent(in) :: n_harmonics, odd_only, n_pairs, n_coefficients, n_time, remembers
      real(wp), intent(in) :: mu(n_pairs)
      integer, intent(in) :: present_components(3, n_pairs)
      real(wp), intent(in) :: offset(n_pairs), start(n_pairs, 2)
      real(wp), intent(in) :: prediction(n_pairs, 3, n_coefficients)
      real(wp), intent(inout) :: force(n_pairs, 3, n_coefficients)
      real(wp), intent(inout) :: force_time(n_pairs, 3, n_time), finish(n_pairs, 2)
      integer, intent(inout) :: state(n_pairs)
      real(wp), intent(inout) :: fraction(3, n_pairs)
      integer, intent(out) :: periodic
      integer, intent(in) :: with_jacobian, n_jacobian, n_blocks
      !> (3 n_coefficients, 3 n_coefficients, n_pairs), or (0, 0, 0) where it is not wanted.
      real(wp), intent(inout) :: jacobian(n_jacobian, n_jacobian, n_blocks)
      type(fourier_type) :: fourier
      type(friction_law) :: law
      type(force_workspace) :: work
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, n_time, odd_only /= 0)
      if (remembers /= 0) then
         law = rigid_friction()
      else
         law = rigid_friction_of_rates()
      end if
      call law%take_pairs(mu, present_components /= 0)
      call law%reserve(fourier, work)
      work%offset = offset
      work%x_start = start
      work%prediction = prediction
      call law%evaluate(fourier, work)
      force = work%force
      force_time = work%force_time
      finish = work%x
      state = work%state
      call law%fractions(work, fraction)
      periodic = merge(1, 0, work%all_periodic())
      if (with_jacobian == 0) return
      call law%linearize(fourier, work)
      call unpack_jacobian(work, present_components /= 0, n_coefficients, jacobian)
   end subroutine contact_forces

end module fw_python_functions
