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
!> b being the row of the first observed quantity and V the motion of a point before. Unknowns are
!> those of the balance over a size of their own, the amplitude A for harmonics above 0, then omega
!> and xi over a frequency; equations are over A; the parameter is ln A. So a step means the same
!> over decades, and a curve below the onset of slip is constant but for A.
!>
!> The motion may be shifted in time, so that the derivative by the unknowns of the balance alone is
!> singular at every solution: it is never solved with, only with its two borders. The structure
!> is to have nothing condensed: with rigid contact the stuck mode is an internal mode of a
!> condensation, whose damping xi cancels, and its pole lies on the curve.
module fw_mode_system
   use fw_balance_state, only: balance_state
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemv
   use fw_mode_options, only: control_observed
   use fw_parameter_system, only: parameter_system
   use fw_structure_operator, only: by_frequency
   use fw_structure_operator, only: by_self_excitation
   implicit none (type, external)
   private

   public :: mode_system, new_mode_system

   type, extends(parameter_system) :: mode_system
      !> Only pointed at; it has to live as long as this system.
      type(balance_state), pointer :: balance => null()
      integer :: control = control_observed
      !> exp of the parameter, in the unit of the control.
      real(wp) :: amplitude = 1.0_wp
      !> Unit of omega and xi among the unknowns [rad/s].
      real(wp) :: frequency_unit = 1.0_wp
      !> Norm of the inertia of the stuck mode per unit of amplitude, to which residuals are
      !> compared, and norm of the static load.
      real(wp) :: inertia = 1.0_wp, static_load = 0.0_wp
      !> Size of the harmonic 0 among the unknowns [length].
      real(wp) :: static_unit = 1.0_wp
      !> M, nothing being condensed (n_coordinates, n_coordinates), and the row b (n_coordinates).
      real(wp), allocatable :: mass(:, :), observed(:)
      !> M V over its modal amplitude, cosine and sine (n_coordinates).
      real(wp), allocatable :: before_cosine(:), before_sine(:)
      !> Columns of cosine and sine of harmonic 1, and unknowns of harmonic 0 (0 or n_coordinates).
      integer, private :: cosine = 1, sine = 2, n_static = 0
      !> Unknowns of the balance and residual at the last point; columns of omega and xi; the two
      !> rows of the conditions in the cosine and sine of harmonic 1 (n_coordinates, 2).
      real(wp), allocatable, private :: q(:), r(:), columns(:, :), row_cosine(:, :), row_sine(:, :)
      real(wp), allocatable, private :: scratch(:)
   contains
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: to_balance
      procedure :: from_balance
      procedure :: remember
      procedure :: modal_amplitude
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: precondition
      procedure :: assemble
   end type mode_system

   !> Residual, over the reference, where the balance cannot be brought: a trial step there is cut
   !> short.
   real(wp), parameter :: out_of_reach = 1.0e30_wp
   !> Part of the static load that round-off leaves of it: no residual is asked to be below.
   real(wp), parameter :: static_share = 1.0e-5_wp

contains

   !> Take a balance of which nothing is condensed; V is set by `remember`.
   subroutine new_mode_system(balance, control, frequency_unit, static_unit, observed, self)
      type(balance_state), intent(inout), target :: balance
      integer, intent(in) :: control
      !> [rad/s] and [length]
      real(wp), intent(in) :: frequency_unit, static_unit
      !> Row of the first observed quantity (n_coordinates).
      real(wp), intent(in) :: observed(:)
      type(mode_system), intent(out) :: self
      integer :: m

      self%balance => balance
      ! Every coordinate stays in the linear problem: the borders see all of them.
      balance%reduced = .false.
      ! No vibratory load acts on a mode; the static one does.
      balance%load_share = 0.0_wp
      self%control = control
      self%frequency_unit = frequency_unit
      self%static_unit = static_unit
      self%observed = observed
      self%n = balance%n + 2
      self%reduced = .false.
      m = balance%problem%structure%n_coordinates
      associate (fourier => balance%problem%fourier)
         self%cosine = fourier%column(findloc(fourier%harmonic, 1, dim=1))
         self%sine = self%cosine + 1
         if (fourier%has_constant()) self%n_static = m
      end associate
      allocate (self%mass(m, m))
      call balance%problem%structure%mass(self%mass)
      allocate (self%q(balance%n), self%r(balance%n), self%columns(balance%n, 2), &
                self%scratch(balance%n), source=0.0_wp)
      allocate (self%row_cosine(m, 2), self%row_sine(m, 2), source=0.0_wp)
      allocate (self%before_cosine(m), self%before_sine(m), source=0.0_wp)
   end subroutine new_mode_system

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
      q(self%n_static + 1:) = self%amplitude*y(self%n_static + 1:n)
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
      y(self%n_static + 1:n) = q(self%n_static + 1:)/self%amplitude
      y(n + 1) = omega/self%frequency_unit
      y(n + 2) = self_excitation/self%frequency_unit
   end subroutine from_balance

   !> The phases of the next points are measured against this one.
   subroutine remember(self, y)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: size_of_mode

      size_of_mode = self%modal_amplitude(y)
      call multiply_mass(self, part(self, y, self%cosine), self%before_cosine)
      call multiply_mass(self, part(self, y, self%sine), self%before_sine)
      self%before_cosine = self%before_cosine/size_of_mode
      self%before_sine = self%before_sine/size_of_mode
   end subroutine remember

   !> sqrt(U_1^H M U_1) for unknowns of the mode, over the amplitude.
   real(wp) function modal_amplitude(self, y)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: product(size(self%mass, 1))

      call multiply_mass(self, part(self, y, self%cosine), product)
      modal_amplitude = dot_product(part(self, y, self%cosine), product)
      call multiply_mass(self, part(self, y, self%sine), product)
      modal_amplitude = sqrt(modal_amplitude + dot_product(part(self, y, self%sine), product))
   end function modal_amplitude

   subroutine multiply_mass(self, vector, product)
      type(mode_system), intent(in) :: self
      real(wp), intent(in) :: vector(:)
      real(wp), intent(inout) :: product(:)
      integer :: m

      m = size(self%mass, 1)
      call dgemv('N', m, m, 1.0_wp, self%mass, m, vector, 1, 0.0_wp, product, 1)
   end subroutine multiply_mass

   !> The coordinates of one coefficient.
   pure function part(self, y, column) result(values)
      type(mode_system), intent(in) :: self
      real(wp), intent(in) :: y(:)
      integer, intent(in) :: column
      real(wp) :: values(size(self%mass, 1))
      integer :: m

      m = size(self%mass, 1)
      values = y((column - 1)*m + 1:column*m)
   end function part

   !> The parameter is ln A.
   subroutine set_parameter(self, parameter, error)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      self%amplitude = exp(parameter)
      self%reference = max(self%inertia, static_share*self%static_load/self%amplitude)
      associate (unused => allocated(error))
      end associate
   end subroutine set_parameter

   !> Of the balance over A, then the conditions in units of a force over A.
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
      r(:n) = self%r/self%amplitude
      call set_rows(self, x)
      associate (c => part(self, x, self%cosine), s => part(self, x, self%sine))
         r(n + 1) = dot_product(self%row_cosine(:, 1), c) + dot_product(self%row_sine(:, 1), s)
         r(n + 2) = dot_product(self%row_cosine(:, 2), c) + dot_product(self%row_sine(:, 2), s)
      end associate
      if (self%control == control_observed) then
         r(n + 1) = r(n + 1) - self%inertia
      else
         ! The row is that of the derivative: half of it is the quadratic form itself.
         r(n + 1) = 0.5_wp*(r(n + 1) - self%inertia)
      end if
   end subroutine residual

   !> Derivatives of the two conditions by the cosines and sines of harmonic 1, U = c - i s.
   subroutine set_rows(self, y)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in) :: y(:)

      if (self%control == control_observed) then
         self%row_cosine(:, 1) = self%inertia*self%observed
         self%row_sine(:, 2) = self%inertia*self%observed
      else
         ! (U^H M U - 1)/2 and Im(V^H M U), M being symmetric.
         call multiply_mass(self, part(self, y, self%cosine), self%row_cosine(:, 1))
         call multiply_mass(self, part(self, y, self%sine), self%row_sine(:, 1))
         self%row_cosine(:, 1) = self%inertia*self%row_cosine(:, 1)
         self%row_sine(:, 1) = self%inertia*self%row_sine(:, 1)
         self%row_cosine(:, 2) = self%inertia*self%before_sine
         self%row_sine(:, 2) = -self%inertia*self%before_cosine
      end if
   end subroutine set_rows

   subroutine linearize(self, n_linear)
      class(mode_system), intent(inout) :: self
      integer, intent(out) :: n_linear

      call self%balance%linearize(n_linear)
      n_linear = n_linear + 2
      call self%balance%derivative_by(by_frequency, self%q, self%columns(:, 1))
      call self%balance%derivative_by(by_self_excitation, self%q, self%columns(:, 2))
      self%columns = self%frequency_unit/self%amplitude*self%columns
   end subroutine linearize

   !> Nothing leaves the linear problem.
   subroutine reduce(self, r, rhs)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)

      associate (unused => self)
      end associate
      rhs = -r
   end subroutine reduce

   subroutine expand(self, r, solution, step)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)

      associate (unused => self, unused_residual => r)
      end associate
      step = solution
   end subroutine expand

   subroutine apply(self, vector, product)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: n

      n = self%balance%n
      self%scratch(:self%n_static) = self%static_unit/self%amplitude*vector(:self%n_static)
      self%scratch(self%n_static + 1:) = vector(self%n_static + 1:n)
      call self%balance%apply(self%scratch, product(:n))
      product(:n) = product(:n) + vector(n + 1)*self%columns(:, 1) + &
                    vector(n + 2)*self%columns(:, 2)
      call multiply_rows(self, vector, product(n + 1:))
   end subroutine apply

   subroutine multiply_rows(self, vector, product)
      class(mode_system), intent(in) :: self
      real(wp), intent(in) :: vector(:)
      real(wp), intent(out) :: product(:)
      integer :: first_c, first_s, k, m

      m = size(self%mass, 1)
      first_c = (self%cosine - 1)*m
      first_s = (self%sine - 1)*m
      do k = 1, 2
         product(k) = dot_product(self%row_cosine(:, k), vector(first_c + 1:first_c + m)) + &
                      dot_product(self%row_sine(:, k), vector(first_s + 1:first_s + m))
      end do
   end subroutine multiply_rows

   !> The derivative of the balance as it assembles it, then the borders.
   subroutine assemble(self, matrix)
      class(mode_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: first_c, first_s, m, n

      n = self%balance%n
      m = size(self%mass, 1)
      call self%balance%assemble(matrix)
      matrix(:n, :self%n_static) = self%static_unit/self%amplitude*matrix(:n, :self%n_static)
      matrix(:n, n + 1:n + 2) = self%columns
      matrix(n + 1:n + 2, :n + 2) = 0.0_wp
      first_c = (self%cosine - 1)*m
      first_s = (self%sine - 1)*m
      matrix(n + 1:n + 2, first_c + 1:first_c + m) = transpose(self%row_cosine)
      matrix(n + 1:n + 2, first_s + 1:first_s + m) = transpose(self%row_sine)
   end subroutine assemble

   !> Linear problems are solved by LU: iterations go without help.
   subroutine build_preconditioner(self)
      class(mode_system), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine build_preconditioner

   subroutine precondition(self, vector)
      class(mode_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)

      associate (unused => self, unused_vector => vector)
      end associate
   end subroutine precondition

   !> d/d ln A of R(A psi, u_0)/A: J (A psi)/A - R/A; the conditions do not see A.
   subroutine parameter_derivative(self, x, dr)
      class(mode_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      integer :: n

      n = self%balance%n
      self%scratch(:self%n_static) = 0.0_wp
      self%scratch(self%n_static + 1:) = x(self%n_static + 1:n)
      call self%balance%apply(self%scratch, dr(:n))
      dr(:n) = dr(:n) - self%r/self%amplitude
      dr(n + 1:) = 0.0_wp
   end subroutine parameter_derivative

end module fw_mode_system
