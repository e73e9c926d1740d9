!> Integration over a period without contact, springs and other elements, by CVODE (Hindmarsh et
!> al. 2005): Adams-Moulton formulas of variable order and step to tolerances near round-off, values
!> at uniform instants from its dense output. For structures with a regular mass whose highest
!> frequency is not far above that of the load; others go through fw_time_stepper.
module fw_smooth_integration
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_funloc, c_int, &
      c_loc, c_long, c_null_ptr, c_ptr
   use fcvode_mod, only: cv_adams, cv_normal, fcvode, fcvodecreate, fcvodefree, fcvodeinit, &
      fcvodeseterrfile, fcvodesetlinearsolver, fcvodesetmaxnumsteps, fcvodesetstoptime, &
      fcvodesetuserdata, fcvodesstolerances
   use fnvector_serial_mod, only: fn_vmake_serial
   use fsundials_context_mod, only: fsuncontext_create, fsuncontext_free
   use fsundials_linearsolver_mod, only: fsunlinsolfree, sunlinearsolver
   use fsundials_matrix_mod, only: fsunmatdestroy, sunmatrix
   use fsundials_nvector_mod, only: fn_vdestroy, fn_vgetarraypointer, n_vector
   use fsunlinsol_dense_mod, only: fsunlinsol_dense
   use fsunmatrix_dense_mod, only: fsundensematrix
   use fw_element_forces, only: element_forces
   use fw_interrupt, only: must_end
   use fw_kinds, only: i8, pi, wp
   use fw_linalg, only: lu_type
   use fw_load_waves, only: load_waves
   use fw_period_record, only: new_period_record, period_record
   use fw_periodic_state, only: period_map
   use fw_time_structure, only: time_structure
   implicit none (type, external)
   private

   public :: smooth_integration, new_smooth_integration, is_smooth

   !> Relative tolerance, and absolute tolerance as a share of the largest entry of the state or
   !> of the displacement that the load would give the mass alone.
   real(wp), parameter :: relative_tolerance = 1.0e-12_wp, absolute_share = 1.0e-13_wp
   !> Highest frequency over that of the load up to which the steps of the Adams formulas, which
   !> it bounds, are not too many.
   real(wp), parameter :: moderate_ratio = 200.0_wp
   integer(c_long), parameter :: max_steps = 1000000_c_long
   !> Motions of a period that a law of a user may have no force for.
   integer, parameter :: most_refusals = 200

   !> In tau = omega t, with w = dx/dtau: dw/dtau = load - stiffness x - damping w - springs, all
   !> divided by the mass and omega**2, so that both halves of the state have one unit.
   type :: acceleration_type
      integer :: n = 0
      !> Stiffness and damping (n, n), loads (n, n_columns) and rows of springs (n, n_springs).
      real(wp), allocatable :: stiffness(:, :), damping(:, :), load(:, :), springs(:, :)
      !> Springs as they are: rows of B (n, n_springs), coefficients and powers.
      real(wp), allocatable :: rows(:, :), coefficient(:)
      integer, allocatable :: power(:)
      !> What the loads behind the third are; their frequency is in them.
      type(load_waves) :: waves
      !> Elements that are neither pairs nor springs, if there are any, and the frequency, which
      !> they are told.
      type(element_forces), allocatable :: elements
      real(wp) :: omega = 0.0_wp
   end type acceleration_type

   type, extends(period_map) :: smooth_integration
      type(acceleration_type) :: acceleration
      real(wp) :: omega = 0.0_wp
      !> Observed quantities (n_observed, n_dof).
      real(wp), allocatable :: observe(:, :)
      type(period_record) :: record
      !> What the law of an element said that ended the last period; blank: none did.
      character(400) :: complaint = ''
   contains
      procedure :: integrate
   end type smooth_integration

contains

   !> Whether a structure is for this module.
   logical function is_smooth(structure, omega)
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: omega
      type(acceleration_type) :: acceleration

      is_smooth = structure%n_pairs == 0 .and. .not. allocated(structure%massive)
      if (.not. is_smooth) return
      call divide_by_mass(structure, omega, acceleration)
      ! The largest sum of a row bounds the eigenvalues of M^-1 K/omega**2, the squares of the
      ! natural frequencies over that of the load.
      is_smooth = sqrt(maxval(sum(abs(acceleration%stiffness), dim=2))) <= moderate_ratio
   end function is_smooth

   !> Prepare; samples are taken at n_samples uniform instants of the period.
   subroutine new_smooth_integration(structure, observe, omega, n_samples, self)
      type(time_structure), intent(in) :: structure
      !> Observed quantities (n_observed, n_dof).
      real(wp), intent(in) :: observe(:, :)
      real(wp), intent(in) :: omega
      integer, intent(in) :: n_samples
      type(smooth_integration), intent(out) :: self
      integer :: i, n

      n = structure%n_dof
      call divide_by_mass(structure, omega, self%acceleration)
      self%omega = omega
      self%observe = observe
      self%record = new_period_record(size(observe, 1), 0, n_samples)
      allocate (self%weight(2*n))
      ! Square roots of energies, in which positions and velocities compare.
      do i = 1, n
         self%weight(i) = sqrt(abs(structure%stiffness(i, i)) + omega**2*structure%mass(i, i))
         self%weight(n + i) = sqrt(structure%mass(i, i))
      end do
   end subroutine new_smooth_integration

   !> Once for the run: M^-1 K, M^-1 C and M^-1 F, so that a step needs products alone.
   subroutine divide_by_mass(structure, omega, acceleration)
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: omega
      type(acceleration_type), intent(out) :: acceleration
      type(lu_type) :: mass
      logical :: singular
      integer :: w

      acceleration%n = structure%n_dof
      call mass%reserve(structure%n_dof)
      mass%matrix = structure%mass
      call mass%factor(singular)
      acceleration%stiffness = structure%stiffness
      acceleration%damping = structure%damping
      acceleration%load = structure%load
      acceleration%waves = structure%waves
      do w = 1, structure%waves%n_waves()
         associate (f => acceleration%load(:, 2*w + 2:2*w + 3), n => structure%waves%harmonic(w))
            f = structure%waves%factor(w, n, n*omega)*f
         end associate
      end do
      acceleration%rows = structure%rows
      acceleration%springs = structure%rows
      acceleration%coefficient = structure%coefficient
      acceleration%power = structure%power
      call solve_columns(mass, acceleration%stiffness)
      call solve_columns(mass, acceleration%damping)
      call solve_columns(mass, acceleration%load)
      call solve_columns(mass, acceleration%springs)
      ! d2x/dtau2 is omega**-2 times d2x/dt2, and dx/dt = omega w leaves one omega with the
      ! damping.
      acceleration%stiffness = acceleration%stiffness/omega**2
      acceleration%damping = acceleration%damping/omega
      acceleration%load = acceleration%load/omega**2
      acceleration%springs = acceleration%springs/omega**2
      acceleration%omega = omega
      if (.not. allocated(structure%elements)) return
      acceleration%elements = structure%elements
      do w = 1, size(acceleration%elements%kind)
         associate (kind => acceleration%elements%kind(w))
            kind%push = kind%rows
            call solve_columns(mass, kind%push)
            kind%push = kind%push/omega**2
         end associate
      end do
   end subroutine divide_by_mass

   !> In place, column by column of a matrix.
   subroutine solve_columns(lu, columns)
      type(lu_type), intent(in) :: lu
      !> Right-hand sides, then solutions, in columns.
      real(wp), intent(inout), contiguous :: columns(:, :)
      integer :: j

      do j = 1, size(columns, 2)
         call lu%solve(columns(:, j))
      end do
   end subroutine solve_columns

   !> Right-hand side for CVODE.
   integer(c_int) function evaluate(t, y_vector, slope_vector, user_data) bind(c, name='') &
      result(status)
      real(c_double), value :: t
      type(n_vector), intent(inout) :: y_vector, slope_vector
      type(c_ptr), value :: user_data
      type(acceleration_type), pointer :: a
      real(c_double), pointer :: y(:), slope(:)
      integer :: i, k, n

      call c_f_pointer(user_data, a)
      y => fn_vgetarraypointer(y_vector)
      slope => fn_vgetarraypointer(slope_vector)
      n = a%n
      slope(:n) = y(n + 1:2*n)
      slope(n + 1:2*n) = a%load(:, 1) + cos(t)*a%load(:, 2) + sin(t)*a%load(:, 3)
      do i = 1, a%waves%n_waves()
         slope(n + 1:2*n) = slope(n + 1:2*n) + cos(a%waves%harmonic(i)*t)*a%load(:, 2*i + 2) + &
                            sin(a%waves%harmonic(i)*t)*a%load(:, 2*i + 3)
      end do
      ! Column by column, as the matrices lie in memory.
      do i = 1, n
         slope(n + 1:2*n) = slope(n + 1:2*n) - y(i)*a%stiffness(:, i) - y(n + i)*a%damping(:, i)
      end do
      ! Rows of springs stand behind those of elements.
      k = size(a%rows, 2) - size(a%coefficient)
      do i = 1, size(a%coefficient)
         slope(n + 1:2*n) = slope(n + 1:2*n) - a%springs(:, k + i)*a%coefficient(i)* &
                            dot_product(a%rows(:, k + i), y(:n))**a%power(i)
      end do
      status = 0
      if (.not. allocated(a%elements)) return
      call a%elements%add(t, a%omega, y(:n), a%omega*y(n + 1:2*n), slope(n + 1:2*n))
      ! Without a force for this motion CVODE tries a shorter step; what ends the run ends it here.
      if (a%elements%status < 0) status = 1_c_int
      if (a%elements%status > 0 .or. a%elements%n_refused > most_refusals) status = -1_c_int
   end function evaluate

   !> One period from a state (displacements, velocities); see period_map.
   subroutine integrate(self, start, finish, range, done)
      class(smooth_integration), intent(inout) :: self
      !> Displacements and velocities by time (2 n_dof).
      real(wp), intent(in), contiguous :: start(:)
      real(wp), intent(out), contiguous :: finish(:)
      real(wp), intent(out) :: range
      logical, intent(out) :: done
      type(acceleration_type), target :: acceleration
      type(n_vector), pointer :: y_vector
      type(sunmatrix), pointer :: matrix
      type(sunlinearsolver), pointer :: solver
      type(c_ptr) :: context, memory
      real(c_double), allocatable, target :: y(:)
      integer(c_int) :: status
      integer :: n

      acceleration = self%acceleration
      n = acceleration%n
      ! Velocities by tau from here on: both halves of y are lengths.
      y = [start(:n), start(n + 1:)/self%omega]
      finish = start
      range = 0.0_wp
      done = fsuncontext_create(c_null_ptr, context) == 0
      if (.not. done) return
      ! The vector has y for its storage: what CVODE writes is read there without a copy.
      y_vector => fn_vmake_serial(int(size(y), i8), y, context)
      matrix => fsundensematrix(int(size(y), i8), int(size(y), i8), context)
      solver => fsunlinsol_dense(y_vector, matrix, context)
      memory = fcvodecreate(cv_adams, context)
      done = c_associated(memory)
      if (done) then
         done = fcvodeinit(memory, c_funloc(evaluate), 0.0_wp, y_vector) == 0
         status = fcvodesstolerances(memory, relative_tolerance, absolute_share*max( &
                                     maxval(abs(y)), maxval(abs(acceleration%load)), tiny(1.0_wp)))
         ! A failure is reported to the caller, not on the terminal.
         status = fcvodeseterrfile(memory, c_null_ptr)
         status = fcvodesetuserdata(memory, c_loc(acceleration))
         ! CVODE forms the Jacobian of its implicit steps by differences; n is small here.
         status = fcvodesetlinearsolver(memory, solver, matrix)
         status = fcvodesetmaxnumsteps(memory, max_steps)
         if (done) call march(self, memory, y_vector, start, y, range, done)
         call fcvodefree(memory)
      end if
      finish = [y(:n), self%omega*y(n + 1:)]
      self%complaint = ''
      if (.not. done .and. allocated(acceleration%elements)) then
         self%complaint = acceleration%elements%complaint
      end if
      status = fsunlinsolfree(solver)
      call fsunmatdestroy(matrix)
      call fn_vdestroy(y_vector)
      status = fsuncontext_free(context)
   end subroutine integrate

   !> From sample to sample, through the period.
   subroutine march(self, memory, y_vector, start, y, range, done)
      class(smooth_integration), intent(inout) :: self
      type(c_ptr), intent(inout) :: memory
      type(n_vector), intent(inout) :: y_vector
      !> The start of the period, as in `integrate`.
      real(wp), intent(in) :: start(:)
      !> The state of CVODE, velocities by tau (2 n_dof): it changes with every call.
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: range
      logical, intent(out) :: done
      real(c_double) :: reached(1)
      real(wp) :: instant
      integer :: k, n

      n = self%acceleration%n
      range = 0.0_wp
      ! A step ends exactly there, so that the state that goes into the next period is not
      ! interpolated as the samples are.
      done = fcvodesetstoptime(memory, 2.0_wp*pi) == 0
      do k = 1, self%record%n_steps
         ! Before the step: the end of the period is the first sample of the next one.
         self%record%observed(:, k) = matmul(self%observe, y(:n))
         instant = 2.0_wp*pi*real(k, wp)/real(self%record%n_steps, wp)
         done = fcvode(memory, instant, y_vector, reached, cv_normal) >= 0
         done = done .and. .not. must_end(self%interrupt)
         if (.not. done) return
         range = max(range, norm2(self%weight*([y(:n), self%omega*y(n + 1:)] - start)))
      end do
   end subroutine march

end module fw_smooth_integration
