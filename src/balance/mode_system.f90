!> The equations of a nonlinear mode (extended periodic motion, Krack 2015): a periodic motion
!> without vibratory load, kept alive by a self-excitation xi in proportion to mass,
!>
!>   Z_n(omega, xi) q_n + forces_n - static load = 0,   Z_n = K - theta_n M + i n omega C,
!>   theta_n = (n omega)^2 + i n omega xi,              damping ratio xi/(2 omega),
!>
!> and two real conditions for its amplitude A and its phase,
!>
!>   observed:  b^T U_1 = A,                       modal:  U_1^H M U_1 = A^2, Im(V^H M U_1) = 0,
!>
!> b being the row of the first observed quantity and V the motion of a point before: one complex
!> row a^T U_1, whose real part is the amplitude and whose imaginary part the phase. Unknowns are
!> those of the balance over a size of their own, A times a unit of motion for harmonics above 0,
!> then omega and xi over a frequency; equations are over that size; the parameter is ln A. So a
!> step means the same over decades and in any units, and a curve below the onset of slip is
!> constant but for A.
!>
!> The motion may be shifted in time, so that the derivative by the unknowns of the balance alone is
!> singular at every solution: it is never solved with, only with its two borders. The structure
!> is to have nothing condensed in harmonic 1: with rigid contact the stuck mode is an internal mode
!> of a condensation, whose damping xi cancels, and its pole lies on the curve.
module fw_mode_system
   use fw_balance_state, only: balance_state
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_lapack, only: zgemv
   use fw_mode_options, only: control_observed
   use fw_parameter_system, only: parameter_system
   use fw_preconditioner_lu, only: preconditioner_lu_type
   implicit none (type, external)
   private

   public :: mode_system, new_mode_system

   type, extends(parameter_system) :: mode_system
      !> Only pointed at; it has to live as long as this system.
      type(balance_state), pointer :: balance => null()
      integer :: control = control_observed
      !> exp of the parameter, in the unit of the control.
      real(wp) :: amplitude = 1.0_wp
      !> Size of the motion per unit of amplitude: 1, or a length over a modal amplitude, so that
      !> unknowns have no unit and count alike whatever the units of the model are.
      real(wp) :: motion_unit = 1.0_wp
      !> Unit of omega and xi among the unknowns [rad/s].
      real(wp) :: frequency_unit = 1.0_wp
      !> Norm of the inertia of the stuck mode per size of the motion, to which residuals are
      !> compared, and norm of the static load.
      real(wp) :: inertia = 1.0_wp, static_load = 0.0_wp
      !> Size of the harmonic 0 among the unknowns [length].
      real(wp) :: static_unit = 1.0_wp
      !> Place of harmonic 1 among those in use, its M times the square of the motion's unit,
      !> nothing being condensed (n_coordinates, n_coordinates), and the row b (n_coordinates).
      integer :: first = 1
      complex(wp), allocatable :: mass(:, :), observed(:)
      !> M V over its modal amplitude (n_coordinates).
      complex(wp), allocatable :: before(:)
      !> Unknowns of harmonic 0, which come first (0 or n_coordinates).
      integer :: n_static = 0
      !> Columns of cosine and sine of harmonic 1.
      integer :: cosine = 1, sine = 2
      !> Unknowns of the balance and residual at the last point.
      real(wp), allocatable, private :: q(:), r(:)
      !> Rows a of the amplitude and of the phase (n_coordinates, 2): that of the phase is another
      !> one where V is not U.
      complex(wp), allocatable, private :: rows(:, :)
      !> In the linear problem: columns of omega and xi, and the rows; scratch.
      real(wp), allocatable, private :: columns(:, :), scratch(:)
      complex(wp), allocatable, private :: active_rows(:, :)
      !> Preconditioner of harmonic 1 with its border, scales of its column and row, scratch.
      type(preconditioner_lu_type), private :: bordered
      real(wp), private :: column_scale = 1.0_wp, row_scale = 1.0_wp
      complex(wp), allocatable, private :: border(:), active(:)
   contains
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: measure_by
      procedure :: length
      procedure :: to_balance
      procedure :: from_balance
      procedure :: remember
      procedure :: modal_amplitude
      procedure :: motion
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: preconditioner_fits
      procedure :: precondition
      procedure :: assemble
   end type mode_system

   ! The linear problem of a Newton step (fw_mode_linear).
   interface
      module subroutine linearize(self, n_linear)
         class(mode_system), intent(inout) :: self
         integer, intent(out) :: n_linear
      end subroutine linearize

      module subroutine reduce(self, r, rhs)
         class(mode_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:)
         real(wp), intent(out), contiguous :: rhs(:)
      end subroutine reduce

      module subroutine expand(self, r, solution, step)
         class(mode_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:), solution(:)
         real(wp), intent(out), contiguous :: step(:)
      end subroutine expand

      module subroutine apply(self, vector, product)
         class(mode_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine apply

      module subroutine assemble(self, matrix)
         class(mode_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: matrix(:, :)
      end subroutine assemble

      module subroutine build_preconditioner(self)
         class(mode_system), intent(inout) :: self
      end subroutine build_preconditioner

      pure module logical function preconditioner_fits(self)
         class(mode_system), intent(in) :: self
      end function preconditioner_fits

      module subroutine precondition(self, vector)
         class(mode_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: vector(:)
      end subroutine precondition

      module subroutine parameter_derivative(self, x, dr)
         class(mode_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine parameter_derivative
   end interface

   !> Residual, over the reference, where the balance cannot be brought: a trial step there is cut
   !> short.
   real(wp), parameter :: out_of_reach = 1.0e30_wp
   !> Part of the static load that round-off leaves of it: no residual is asked to be below.
   real(wp), parameter :: static_share = 1.0e-5_wp

contains

   !> Take a balance of which nothing is condensed in harmonic 1; V is set by `remember`.
   subroutine new_mode_system(balance, control, frequency_unit, self)
      type(balance_state), intent(inout), target :: balance
      integer, intent(in) :: control
      !> [rad/s]
      real(wp), intent(in) :: frequency_unit
      type(mode_system), intent(out) :: self
      complex(wp), allocatable :: unused(:, :, :), observe(:, :)
      integer :: m

      self%balance => balance
      ! No vibratory load acts on a mode; the static one does.
      balance%load_share = 0.0_wp
      self%control = control
      self%frequency_unit = frequency_unit
      self%n = balance%n + 2
      self%reduced = balance%reduced
      m = balance%problem%structure%n_coordinates
      associate (fourier => balance%problem%fourier, structure => balance%problem%structure)
         self%first = findloc(fourier%harmonic, 1, dim=1)
         self%cosine = fourier%column(self%first)
         self%sine = self%cosine + 1
         if (fourier%has_constant()) self%n_static = m
         allocate (self%mass(m, m), unused(m, m, 2), observe(structure%n_observed, m))
         call structure%parts(self%first, unused(:, :, 1), self%mass, unused(:, :, 2), observe)
         self%observed = observe(1, :)
      end associate
      balance%preconditioner%left_out = self%first
      allocate (self%q(balance%n), self%r(balance%n), self%columns(balance%n, 2), &
                self%scratch(balance%n), source=0.0_wp)
      allocate (self%rows(m, 2), self%active_rows(m, 2), self%before(m), self%border(m + 1), &
                self%active(m), source=(0.0_wp, 0.0_wp))
   end subroutine new_mode_system

   !> Units of the motion per unit of amplitude, and of the static position.
   subroutine measure_by(self, motion_unit, static_unit)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: motion_unit, static_unit

      self%mass = (motion_unit/self%motion_unit)**2*self%mass
      self%motion_unit = motion_unit
      self%static_unit = static_unit
   end subroutine measure_by

   !> Size of the motion at the present amplitude.
   pure real(wp) function length(self)
      class(mode_system), intent(in) :: self

      length = self%amplitude*self%motion_unit
   end function length

   !> Unknowns of the balance, frequency and self-excitation from those of the mode.
   pure subroutine to_balance(self, y, q, omega, self_excitation)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: q(:)
      !> [rad/s]
      real(wp), intent(out) :: omega, self_excitation
      integer :: n

      n = size(q)
      ! Harmonic 0 is the first of those retained.
      q(:self%n_static) = self%static_unit*y(:self%n_static)
      q(self%n_static + 1:) = self%length()*y(self%n_static + 1:n)
      omega = self%frequency_unit*y(n + 1)
      self_excitation = self%frequency_unit*y(n + 2)
   end subroutine to_balance

   !> The inverse of to_balance.
   pure subroutine from_balance(self, q, omega, self_excitation, y)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: q(:), omega, self_excitation
      real(wp), intent(out) :: y(:)
      integer :: n

      n = size(q)
      y(:self%n_static) = q(:self%n_static)/self%static_unit
      y(self%n_static + 1:n) = q(self%n_static + 1:)/self%length()
      y(n + 1) = omega/self%frequency_unit
      y(n + 2) = self_excitation/self%frequency_unit
   end subroutine from_balance

   !> The phases of the next points are measured against this one.
   subroutine remember(self, y)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      complex(wp) :: shape(size(self%mass, 1))

      shape = motion(self, y)
      call multiply_mass(self, shape, self%before)
      self%before = self%before/sqrt(real(dot_product(shape, self%before), wp))
   end subroutine remember

   !> sqrt(U_1^H M U_1) for unknowns of the mode, over the amplitude.
   real(wp) function modal_amplitude(self, y)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: y(:)
      complex(wp), dimension(size(self%mass, 1)) :: shape, product

      shape = motion(self, y)
      call multiply_mass(self, shape, product)
      modal_amplitude = sqrt(real(dot_product(shape, product), wp))
   end function modal_amplitude

   subroutine multiply_mass(self, vector, product)
      type(mode_system), intent(in) :: self
      complex(wp), intent(in) :: vector(:)
      complex(wp), intent(inout) :: product(:)
      complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
      integer :: m

      m = size(self%mass, 1)
      call zgemv('N', m, m, one, self%mass, m, vector, 1, zero, product, 1)
   end subroutine multiply_mass

   !> U_1 over its size, of unknowns of the mode.
   pure function motion(self, y) result(shape)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: y(:)
      complex(wp) :: shape(size(self%mass, 1))
      integer :: c, m, s

      m = size(self%mass, 1)
      c = (self%cosine - 1)*m
      s = (self%sine - 1)*m
      shape = cmplx(y(c + 1:c + m), -y(s + 1:s + m), wp)
   end function motion

   !> The parameter is ln A.
   subroutine set_parameter(self, parameter, error)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      self%amplitude = exp(parameter)
      self%reference = max(self%inertia, static_share*self%static_load/self%length())
      associate (unused => allocated(error))
      end associate
   end subroutine set_parameter

   !> Of the balance over the size of the motion, then the conditions in the same units.
   subroutine residual(self, x, r)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      type(error_type), allocatable :: error
      real(wp) :: omega, self_excitation
      integer :: n

      n = self%balance%n
      call self%to_balance(x, self%q, omega, self_excitation)
      if (omega > 0.0_wp) call self%balance%set_point(omega, self_excitation, error)
      if (allocated(error) .or. .not. omega > 0.0_wp) then
         r = out_of_reach*self%reference
         return
      end if
      call self%balance%residual(self%q, self%r)
      r(:n) = self%r/self%length()
      call set_rows(self, x)
      associate (shape => self%motion(x))
         r(n + 1) = real(sum(self%rows(:, 1)*shape), wp)
         r(n + 2) = aimag(sum(self%rows(:, 2)*shape))
      end associate
      if (self%control == control_observed) then
         r(n + 1) = r(n + 1) - self%inertia
      else
         ! The row is that of the derivative: half of it is the quadratic form itself.
         r(n + 1) = 0.5_wp*(r(n + 1) - self%inertia)
      end if
   end subroutine residual

   !> Derivatives of the two conditions by U_1: real and imaginary part of a^T dU_1.
   subroutine set_rows(self, y)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: y(:)

      if (self%control == control_observed) then
         self%rows(:, 1) = self%inertia*self%observed
         self%rows(:, 2) = self%rows(:, 1)
      else
         ! (U^H M U - 1)/2 and Im(V^H M U), M being Hermitian.
         call multiply_mass(self, motion(self, y), self%rows(:, 1))
         self%rows(:, 1) = self%inertia*conjg(self%rows(:, 1))
         self%rows(:, 2) = self%inertia*conjg(self%before)
      end if
   end subroutine set_rows

end module fw_mode_system
