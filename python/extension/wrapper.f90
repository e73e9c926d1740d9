!> What f2py turns into the Python module fretwear._core: plain arguments, no copies of
!> Fortran-ordered arrays, the interpreter lock released. python/fretwear/ checks arguments; texts
!> are arrays of bytes, lists of texts have null bytes between them.
module fw_python
   use fw_condensation, only: condensation_type
   use fw_error, only: error_type
   use fw_error, only: status_ok
   use fw_forces, only: forces_type
   use fw_forces, only: new_forces
   use fw_fourier, only: fourier_type
   use fw_fourier, only: new_fourier
   use fw_kinds, only: i8
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_python_operators, only: build_condensation
   use fw_python_operators, only: unpack_jacobian
   use fw_python_session, only: new_session
   use fw_python_session, only: session_of
   use fw_python_session, only: session_type
   use fw_recovery, only: largest_magnitude
   use fw_text, only: string_type
   use fw_version, only: version
   implicit none (type, external)
   private

   public :: open_session, close_session, give_matrix, give_vector, give_sides, give_text
   public :: read_case, check_case, run_case, text_length, fetch_text, library_version
   public :: harmonic_operators, to_time, to_coefficients, differentiate, amplitudes
   public :: dynamic_stiffness, condense, recover, contact_forces

contains

   ! -------------------------------------------------------------------------------- sessions

   subroutine library_version(text)
      character(16), intent(out) :: text

      text = version
   end subroutine library_version

   subroutine open_session(handle)
      integer(i8), intent(out) :: handle

      handle = new_session()
   end subroutine open_session

   subroutine close_session(handle)
      integer(i8), intent(in) :: handle
      type(session_type), pointer :: session

      session => session_of(handle)
      deallocate (session)
   end subroutine close_session

   !> A matrix of the model in memory: 'mass', 'stiffness', 'damping', 'stiffness_rotation',
   !> 'observe_matrix' or 'position'.
   subroutine give_matrix(handle, name, n_rows, n_columns, values)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      integer, intent(in) :: n_rows, n_columns
      real(wp), intent(in) :: values(n_rows, n_columns)
      type(session_type), pointer :: session
      !f2py threadsafe

      session => session_of(handle)
      if (.not. allocated(session%model)) allocate (session%model)
      select case (name)
      case ('mass')
         session%model%mass = values
      case ('stiffness')
         session%model%stiffness = values
      case ('damping')
         session%model%damping = values
      case ('stiffness_rotation')
         session%model%stiffness_rotation = values
      case ('observe_matrix')
         session%model%observe_matrix = values
      case default ! 'position'
         session%model%position = values
      end select
   end subroutine give_matrix

   !> Values per pair or dof: 'mu', 'gap', 'area', 'load_static', 'load_cosine', 'load_sine' or
   !> 'load_static_rotation'.
   subroutine give_vector(handle, name, n, values)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      type(session_type), pointer :: session

      session => session_of(handle)
      if (.not. allocated(session%model)) allocate (session%model)
      select case (name)
      case ('mu')
         session%model%mu = values
      case ('gap')
         session%model%gap = values
      case ('area')
         session%model%area = values
      case ('load_static')
         session%model%load_static = values
      case ('load_cosine')
         session%model%load_cosine = values
      case ('load_sine')
         session%model%load_sine = values
      case default ! 'load_static_rotation'
         session%model%load_static_rotation = values
      end select
   end subroutine give_vector

   !> Signed dof numbers of the contact pairs.
   subroutine give_sides(handle, n_pairs, side_1, side_2)
      integer(i8), intent(in) :: handle
      integer, intent(in) :: n_pairs
      integer, intent(in) :: side_1(3, n_pairs), side_2(3, n_pairs)
      type(session_type), pointer :: session

      session => session_of(handle)
      if (.not. allocated(session%model)) allocate (session%model)
      session%model%side_1 = side_1
      session%model%side_2 = side_2
   end subroutine give_sides

   !> 'title', or a list: 'observe_name' or 'patch'.
   subroutine give_text(handle, name, n, text)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      integer, intent(in) :: n
      integer(1), intent(in) :: text(n)
      type(session_type), pointer :: session

      session => session_of(handle)
      if (.not. allocated(session%model)) allocate (session%model)
      select case (name)
      case ('title')
         session%model%title = from_bytes(text)
      case ('observe_name')
         session%model%observe_name = list_of(text)
      case default ! 'patch'
         session%model%patch = list_of(text)
      end select
   end subroutine give_text

   !> Read and validate a case; the status is that of fw_run.
   subroutine read_case(handle, n_text, text, n_path, path, n_overrides, overrides, origin, status)
      integer(i8), intent(in) :: handle
      integer, intent(in) :: n_text, n_path, n_overrides
      integer(1), intent(in) :: text(n_text), path(n_path), overrides(n_overrides)
      character(*), intent(in) :: origin
      integer, intent(out) :: status
      type(session_type), pointer :: session
      !f2py threadsafe

      session => session_of(handle)
      call session%read(from_bytes(text), from_bytes(path), list_of(overrides), origin, status)
   end subroutine read_case

   subroutine check_case(handle, status)
      integer(i8), intent(in) :: handle
      integer, intent(out) :: status
      type(session_type), pointer :: session
      !f2py threadsafe

      session => session_of(handle)
      call session%check(status)
   end subroutine check_case

   !> Run the case that was read. Another thread may set control(1) to stop the run after the
   !> present point, and read how many points are done in control(2), of control(3).
   subroutine run_case(handle, control, status)
      integer(i8), intent(in) :: handle
      integer(i8), intent(inout) :: control(3)
      integer, intent(out) :: status
      type(session_type), pointer :: session
      !f2py threadsafe

      session => session_of(handle)
      call session%run(control, status)
   end subroutine run_case

   subroutine text_length(handle, name, n)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      integer, intent(out) :: n

      n = len(text_of(handle, name))
   end subroutine text_length

   subroutine fetch_text(handle, name, n, text)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      integer, intent(in) :: n
      integer(1), intent(inout) :: text(n)

      text = transfer(text_of(handle, name), 0_1, n)
   end subroutine fetch_text

   !> 'message', 'summary', 'remarks', or of the case that was read 'namelist' or 'output'.
   function text_of(handle, name) result(text)
      integer(i8), intent(in) :: handle
      character(*), intent(in) :: name
      character(:), allocatable :: text
      type(session_type), pointer :: session

      session => session_of(handle)
      text = ''
      select case (name)
      case ('message')
         if (allocated(session%message)) text = session%message
      case ('summary')
         if (allocated(session%summary)) text = session%summary
      case ('remarks')
         if (allocated(session%remarks)) text = session%remarks
      case ('namelist')
         if (allocated(session%case%namelist)) text = session%case%namelist
      case default ! 'output'
         if (allocated(session%case%output%file)) text = session%case%output%file
      end select
   end function text_of

   pure function from_bytes(bytes) result(text)
      integer(1), intent(in) :: bytes(:)
      character(size(bytes)) :: text

      text = transfer(bytes, text)
   end function from_bytes

   !> The texts between null bytes; every text ends in one.
   pure function list_of(bytes) result(list)
      integer(1), intent(in) :: bytes(:)
      type(string_type), allocatable :: list(:)
      integer :: first, i, last

      allocate (list(count(bytes == 0_1)))
      first = 1
      do i = 1, size(list)
         last = first + findloc(bytes(first:), 0_1, dim=1) - 2
         list(i)%text = from_bytes(bytes(first:last))
         first = last + 2
      end do
   end function list_of

   ! ------------------------------------------------------------------------------- operators

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
      type(condensation_type) :: structure
      type(error_type), allocatable :: error
      !f2py threadsafe

      call build_condensation(model_of(n, mass, damping, stiffness, load), side_1, side_2, &
                              harmonic, omega, structure, error)
      call pass_on(error, status, message)
      if (status /= status_ok) return
      z = structure%stiffness
      f = structure%load
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
      type(condensation_type) :: structure
      type(error_type), allocatable :: error
      !f2py threadsafe

      call build_condensation(model_of(n, mass, damping, stiffness, load), side_1, side_2, &
                              harmonic, omega, structure, error)
      call pass_on(error, status, message)
      if (status == status_ok) call structure%recover(q, u)
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
      type(forces_type) :: contact
      !f2py threadsafe

      fourier = new_fourier(n_harmonics, n_time, odd_only /= 0)
      contact = new_forces(mu, present_components /= 0, fourier)
      contact%remembers = remembers /= 0
      contact%offset = offset
      contact%x_start = start
      contact%prediction = prediction
      call contact%evaluate(fourier)
      force = contact%force
      force_time = contact%force_time
      finish = contact%x
      state = contact%state
      call contact%fractions(fraction)
      periodic = merge(1, 0, contact%all_periodic())
      if (with_jacobian == 0) return
      call contact%linearize(fourier)
      call unpack_jacobian(contact, n_coefficients, jacobian)
   end subroutine contact_forces

end module fw_python
