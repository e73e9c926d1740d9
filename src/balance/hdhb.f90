!> High-dimensional harmonic balance: the balance with the values at n_time = 2H+1 instants as
!> unknowns (Hall, Thomas and Clark 2002). Its operator H_r = T^-1 Z_r T is never formed: values
!> are transformed, the harmonics multiplied one by one, and the result transformed back.
!>
!> The paper prints T and T^-1 of H_r the wrong way round.
module fw_hdhb
   use fw_kinds, only: wp
   use fw_fft, only: fft_type
   use fw_balance_state, only: balance_state
   use fw_error, only: error_type
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: hdhb_system, new_hdhb

   type, extends(parameter_system) :: hdhb_system
      !> The same balance in coefficients.
      type(balance_state), pointer :: balance => null()
      !> Workspace (n).
      real(wp), allocatable :: coefficients(:), product(:)
      !> Of all coordinates, where transforms are long.
      type(fft_type), allocatable, private :: fft
   contains
      procedure :: residual
      procedure :: linearize
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: precondition
      procedure :: assemble
      procedure :: to_values
      procedure :: to_coefficients
   end type hdhb_system

contains

   !> Wrap a balance; its number of instants must be that of its coefficients.
   !> Has no structure of its own: every call goes through the coefficients.
   subroutine new_hdhb(balance, self)
      type(balance_state), intent(inout), target :: balance
      type(hdhb_system), intent(out) :: self

      self%balance => balance
      self%interrupt => balance%interrupt
      self%n = balance%n
      self%reduced = balance%reduced
      allocate (self%coefficients(self%n), self%product(self%n), source=0.0_wp)
      call balance%problem%fourier%plan_fft(balance%problem%structure%n_coordinates, self%fft)
   end subroutine new_hdhb

   !> Values at the instants from coefficients, n_rows rows each.
   subroutine to_values(self, n_rows, coefficients, values)
      class(hdhb_system), intent(inout) :: self
      integer, intent(in) :: n_rows
      !> Both flat with the rows innermost: (n_rows, n_coefficients) and (n_rows, n_time).
      real(wp), intent(in), contiguous :: coefficients(:)
      real(wp), intent(inout), contiguous :: values(:)

      call self%balance%problem%fourier%to_time(n_rows, coefficients, values, self%fft)
   end subroutine to_values

   !> The inverse of to_values.
   subroutine to_coefficients(self, n_rows, values, coefficients)
      class(hdhb_system), intent(inout) :: self
      integer, intent(in) :: n_rows
      real(wp), intent(in), contiguous :: values(:)
      real(wp), intent(inout), contiguous :: coefficients(:)

      call self%balance%problem%fourier%to_coefficients(n_rows, values, coefficients, self%fft)
   end subroutine to_coefficients

   !> The reference is scaled so that the tolerance is met by the coefficients as well: a row of
   !> values has at least sqrt(n_time/2) times the norm of its coefficients.
   subroutine residual(self, x, r)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: m

      m = self%balance%problem%structure%n_coordinates
      self%balance%reduced = self%reduced
      self%reference = sqrt(0.5_wp*self%balance%problem%fourier%n_time)*self%balance%reference
      call self%to_coefficients(m, x, self%coefficients)
      call self%balance%residual(self%coefficients, self%product)
      call self%to_values(m, self%product, r)
   end subroutine residual

   !> [rad/s].
   subroutine set_parameter(self, parameter, error)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%balance%set_parameter(parameter, error)
   end subroutine set_parameter

   !> That in coefficients, at the instants: the transform does not depend on the frequency.
   subroutine parameter_derivative(self, x, dr)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      integer :: m

      m = self%balance%problem%structure%n_coordinates
      call self%to_coefficients(m, x, self%coefficients)
      call self%balance%parameter_derivative(self%coefficients, self%product)
      call self%to_values(m, self%product, dr)
   end subroutine parameter_derivative

   !> Coordinates leave by whole rows, so the reduced problem of the coefficients serves.
   subroutine linearize(self, n_linear)
      class(hdhb_system), intent(inout) :: self
      integer, intent(out) :: n_linear

      self%balance%reduced = self%reduced
      call self%balance%linearize(n_linear)
   end subroutine linearize

   !> The active rows of the right-hand side, at the instants.
   subroutine reduce(self, r, rhs)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)

      call self%to_coefficients(self%balance%problem%structure%n_coordinates, r, self%coefficients)
      call self%balance%reduce(self%coefficients, self%product(:size(rhs)))
      call self%to_values(self%balance%active%n_active, self%product(:size(rhs)), rhs)
   end subroutine reduce

   !> Steps of all coordinates, at the instants.
   subroutine expand(self, r, solution, step)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)
      integer :: m

      m = self%balance%problem%structure%n_coordinates
      call self%to_coefficients(self%balance%active%n_active, solution, &
                                self%product(:size(solution)))
      call self%to_coefficients(m, r, self%coefficients)
      call self%balance%expand(self%coefficients, self%product(:size(solution)), step)
      self%coefficients = step
      call self%to_values(m, self%coefficients, step)
   end subroutine expand

   !> J v with the derivative in coefficients between two transforms.
   subroutine apply(self, vector, product)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: n

      n = size(vector)
      call self%to_coefficients(self%balance%active%n_active, vector, self%coefficients(:n))
      call self%balance%apply(self%coefficients(:n), self%product(:n))
      call self%to_values(self%balance%active%n_active, self%product(:n), product)
   end subroutine apply

   subroutine build_preconditioner(self)
      class(hdhb_system), intent(inout) :: self

      call self%balance%build_preconditioner()
   end subroutine build_preconditioner

   !> Per harmonic, as in coefficients: the transforms are exact inverses of each other.
   subroutine precondition(self, vector)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      integer :: n

      n = size(vector)
      call self%to_coefficients(self%balance%active%n_active, vector, self%coefficients(:n))
      call self%balance%precondition(self%coefficients(:n))
      call self%to_values(self%balance%active%n_active, self%coefficients(:n), vector)
   end subroutine precondition

   !> Transform the columns of the matrix in coefficients, then its rows.
   subroutine assemble(self, matrix)
      class(hdhb_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      real(wp) :: line(size(matrix, 1))
      integer :: j, n, rows

      ! J_t = T^-1 J T with T from values to coefficients: columns first, then rows.
      rows = self%balance%active%n_active
      n = rows*self%balance%problem%fourier%n_coefficients
      call self%balance%assemble(matrix)
      do j = 1, n
         line(:n) = matrix(:n, j)
         call self%to_values(rows, line(:n), matrix(:n, j))
      end do
      ! Row i of J_t is the row of J times the analysis: apply its transpose to the row.
      do j = 1, n
         line(:n) = matrix(j, :n)
         matrix(j, :n) = transposed_analysis(self, rows, line(:n))
      end do
   end subroutine assemble

   !> Row vector times the analysis operator.
   function transposed_analysis(self, rows, line) result(values)
      type(hdhb_system), intent(in) :: self
      integer, intent(in) :: rows
      real(wp), intent(in) :: line(rows, self%balance%problem%fourier%n_coefficients)
      real(wp) :: values(rows*self%balance%problem%fourier%n_time)

      values = reshape(matmul(line, self%balance%problem%fourier%analysis), [size(values)])
   end function transposed_analysis

end module fw_hdhb
