!> A phase resonance over a parameter p: the load does no reactive work in harmonic 1,
!>
!>   R(q, omega; p) = 0,    g = Re(F_1^H U_1) = 0,
!>
!> with omega as a further unknown. Regular at folds of the frequency response; as a system of the
!> parameter it can be followed where the resonance itself folds.
!>
!> It is the plane across a curve with another condition: the border is the row of the work.
module fw_phase_system
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_error, only: error_type, fatal_error, status_input
   use fw_fourier, only: to_complex
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_parameter_problem, only: parameter_problem
   use fw_parameter_slopes, only: parameter_entry, parameter_slope, slope_finder
   use fw_parameters, only: harmonic_scale
   use fw_plane_system, only: plane_system
   use fw_resonance_options, only: resonance_options
   implicit none (type, external)
   private

   public :: phase_system

   !> Relative residual asked of GMRES.
   real(wp), parameter :: krylov_tolerance = 1.0e-12_wp

   type, extends(plane_system) :: phase_system
      type(balance_problem), pointer :: problem => null()
      type(balance_state), pointer :: state => null()
      type(parameter_problem), pointer :: mover => null()
      type(resonance_options) :: options
      !> Unit of omega among the unknowns [rad/s], and what makes the work a part of the residual.
      real(wp) :: omega_unit = 1.0_wp, work_unit = 1.0_wp
      !> Place of harmonic 1 among those retained.
      integer, private :: first = 1
   contains
      procedure :: build
      procedure :: scale
      procedure :: pack_point
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: move_parameters
      procedure :: take
      procedure :: conditions
      procedure :: choose
   end type phase_system

contains

   !> Take a problem with a state and what moves its parameter; all of them have to stay where they
   !> are.
   subroutine build(self, mover, problem, state, options)
      class(phase_system), intent(inout) :: self
      type(parameter_problem), intent(inout), target :: mover
      type(balance_problem), intent(inout), target :: problem
      type(balance_state), intent(inout), target :: state
      type(resonance_options), intent(in) :: options
      real(wp) :: nothing(state%n)

      self%mover => mover
      self%problem => problem
      self%state => state
      self%options = options
      self%first = findloc(problem%fourier%harmonic, 1, dim=1)
      nothing = 0.0_wp
      call self%cut(state, nothing, 0.0_wp, nothing, 0.0_wp)
   end subroutine build

   !> Choose units at a point: unknowns of one size, and the phase as large as the residual.
   subroutine scale(self, x)
      class(phase_system), intent(inout) :: self
      !> q, then omega [rad/s].
      real(wp), intent(in) :: x(:)
      complex(wp) :: work
      integer :: n

      n = size(x) - 1
      self%omega_unit = x(n + 1)
      ! Of the size of the others, where these are not all at rest.
      if (norm2(x(:n)) > 0.0_wp) self%omega_unit = x(n + 1)/norm2(x(:n))
      call work_at(self, x(:n), work)
      self%work_unit = 1.0_wp
      if (abs(work) > 0.0_wp) self%work_unit = self%state%reference/abs(work)
   end subroutine scale

   !> Unknowns of the system from q and omega, or back.
   pure subroutine pack_point(self, x, y, back)
      class(phase_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: y(:)
      logical, intent(in), optional :: back
      integer :: n

      n = size(x)
      y = x
      if (present(back)) then
         y(n) = self%omega_unit*x(n)
      else
         y(n) = x(n)/self%omega_unit
      end if
   end subroutine pack_point

   !> F_1^H U_1 where the state stands, its derivative by omega, and its row by q_1.
   subroutine work_at(self, q, work, slope, row)
      class(phase_system), intent(in) :: self
      real(wp), intent(in), contiguous :: q(:)
      complex(wp), intent(out) :: work
      !> Only the linear problem asks for these: they take solutions with the condensed part.
      complex(wp), intent(out), optional :: slope, row(:)
      complex(wp) :: amplitude(self%problem%structure%n_coordinates, &
                               self%problem%fourier%n_retained)

      call to_complex(self%problem%fourier, size(amplitude, 1), q, amplitude)
      call self%problem%structure%load_work(self%state%structure_state, self%first, &
                                            amplitude(:, self%first), work, slope, row)
   end subroutine work_at

   !> The parameter is what steps are even in.
   subroutine set_parameter(self, parameter, error)
      class(phase_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega

      omega = self%state%frequency()
      call self%mover%bring(self%options%value_at(parameter), self%problem, self%state, error)
      if (.not. allocated(error) .and. omega > 0.0_wp) then
         call self%state%set_frequency(omega, error)
      end if
      self%reference = self%state%reference
   end subroutine set_parameter

   !> dR/dp and dg/dp at the last point, by what steps are even in.
   subroutine parameter_derivative(self, x, dr)
      class(phase_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      type(slope_finder) :: finder
      type(parameter_slope) :: slope
      complex(wp) :: work
      integer :: n

      n = self%state%n
      call work_at(self, x(:n), work)
      call self%mover%find_slope(finder, self%state, x(:n), self%mover%value, slope)
      if (self%mover%number == harmonic_scale) then
         ! F^H U has the load twice: linear in the coordinates, quadratic behind the condensation.
         slope%work = (work + finder%work_at_rest)/self%mover%value
      end if
      dr(:n) = reshape(slope%residual, [n])
      dr(n + 1) = self%work_unit*real(slope%work, wp)
      ! d(value)/d(what steps are even in).
      dr = self%options%rate_at(self%mover%value)*dr
   end subroutine parameter_derivative

   !> Derivatives of the frequency by parameters, at the resonance x (q, then omega [rad/s]).
   subroutine move_parameters(self, x, parameters, linear, by_omega, done, error)
      class(phase_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      type(parameter_entry), intent(in) :: parameters(:)
      type(linear_step_type), intent(inout) :: linear
      !> (n_parameters)
      real(wp), intent(out) :: by_omega(:)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(slope_finder) :: finder
      type(parameter_slope) :: slope
      complex(wp) :: work
      real(wp) :: r(size(x)), step(size(x)), y(size(x))
      integer :: n, p

      n = size(x) - 1
      done = .false.
      call self%state%set_frequency(x(n + 1), error)
      if (allocated(error)) return
      call self%scale(x)
      call self%pack_point(x, y)
      call self%residual(y, r)
      call linear%prepare(self, done)
      if (.not. done) return
      call work_at(self, x(:n), work)
      call finder%start(self%state)
      call finder%prepare(self%state, x(:n))
      do p = 1, size(parameters)
         call finder%find(self%state, parameters(p), slope)
         r(:n) = reshape(slope%residual, [n])
         if (parameters(p)%number == harmonic_scale) then
            slope%work = (work + finder%work_at_rest)/parameters(p)%value
         end if
         r(n + 1) = self%work_unit*real(slope%work, wp)
         call linear%solve_prepared(self, r, krylov_tolerance, step, done)
         if (.not. done) return
         by_omega(p) = self%omega_unit*step(n + 1)
      end do
   end subroutine move_parameters

   !> The further unknown is the frequency.
   subroutine take(self, z, error)
      class(phase_system), intent(inout) :: self
      real(wp), intent(in) :: z(:)
      type(error_type), allocatable, intent(out) :: error

      if (z(1) > 0.0_wp) then
         call self%state%set_frequency(self%omega_unit*z(1), error)
      else
         call fatal_error(error, 'a frequency of no vibration', status_input)
      end if
   end subroutine take

   !> The reactive work.
   subroutine conditions(self, q, z, g)
      class(phase_system), intent(inout) :: self
      real(wp), intent(in) :: q(:), z(:)
      real(wp), intent(out) :: g(:)
      complex(wp) :: work

      associate (unused => z)
      end associate
      self%x = q
      call work_at(self, self%x, work)
      g = self%work_unit*real(work, wp)
   end subroutine conditions

   !> The border at the last point.
   subroutine choose(self)
      class(phase_system), intent(inout) :: self
      complex(wp) :: work, slope, row(self%problem%structure%n_coordinates)
      integer :: at, m

      m = size(row)
      call work_at(self, self%x, work, slope, row)
      ! Re(row (c - i s)) of the cosines and sines of harmonic 1.
      at = (self%problem%fourier%column(self%first) - 1)*m
      self%border = 0.0_wp
      self%border(at + 1:at + m) = self%work_unit*real(row, wp)
      self%border(at + m + 1:at + 2*m) = self%work_unit*aimag(row)
      self%border_p = self%work_unit*real(slope, wp)
      call self%plane_system%choose()
      self%slope = self%omega_unit*self%slope
      self%column = self%omega_unit*self%column
      self%corner_p = self%omega_unit*self%corner_p
   end subroutine choose

end module fw_phase_system
