!> A system whose derivative comes from differences of its residual, to check an analytic one. Only
!> the preconditioner stays the system's own.
module difference_system_module
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: difference_system, new_difference_system

   !> Step relative to the unknowns: the root of the unit round-off.
   ! Truncation grows with the step, round-off with its inverse: both are some 1e-8 there. Near a
   ! corner of the contact law a difference mixes two pieces, which no step avoids.
   real(wp), parameter :: relative_step = 1.0e-8_wp

   type, extends(parameter_system) :: difference_system
      class(parameter_system), pointer, private :: inner => null()
      !> The last point and its residual.
      !> Scratch of the same length stands behind them (n each).
      real(wp), allocatable, private :: x(:), r(:), trial(:), ahead(:)
   contains
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: precondition
      procedure :: assemble
   end type difference_system

contains

   !> All unknowns take part: what a reduction leaves out rests on the analytic derivative.
   function new_difference_system(inner) result(self)
      !> Has to outlive the new system, which changes its `reduced`.
      class(parameter_system), intent(inout), target :: inner
      type(difference_system) :: self

      self%inner => inner
      self%interrupt => inner%interrupt
      self%n = inner%n
      self%reference = inner%reference
      inner%reduced = .false.
      self%reduced = .false.
      allocate (self%x(inner%n), self%r(inner%n), self%trial(inner%n), self%ahead(inner%n), &
         source=0.0_wp)
   end function new_difference_system

   !> The last point is of the old parameter then: evaluate before anything else.
   subroutine set_parameter(self, parameter, error)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%inner%set_parameter(parameter, error)
   end subroutine set_parameter

   !> That of the system itself, which is smooth.
   subroutine parameter_derivative(self, x, dr)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      integer :: n

      call self%inner%residual(x, self%ahead)
      call self%inner%linearize(n)
      call self%inner%parameter_derivative(x, dr)
   end subroutine parameter_derivative

   !> Keeps the point, from which differences are taken.
   subroutine residual(self, x, r)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)

      call self%inner%residual(x, r)
      self%reference = self%inner%reference
      self%x = x
      self%r = r
   end subroutine residual

   !> Nothing is prepared; all n unknowns stay.
   subroutine linearize(self, n_linear)
      class(difference_system), intent(inout) :: self
      integer, intent(out) :: n_linear

      n_linear = self%n
   end subroutine linearize

   !> The whole right-hand side.
   subroutine reduce(self, r, rhs)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)

      associate (self => self)
      end associate
      rhs = -r
   end subroutine reduce

   !> The solution is the step.
   subroutine expand(self, r, solution, step)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)

      associate (self => self, r => r)
      end associate
      step = solution
   end subroutine expand

   !> One residual for a product, and the inner system is left at the displaced point.
   subroutine apply(self, vector, product)
      class(difference_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      real(wp) :: length

      product = 0.0_wp
      length = maxval(abs(vector))
      if (length <= 0.0_wp) return
      ! Scaled so that no unknown moves by more than the step.
      call difference(self, vector, step_size(self)/length, product)
   end subroutine apply

   !> product = (R(x + h vector) - R(x))/h.
   subroutine difference(self, vector, h, product)
      type(difference_system), intent(inout) :: self
      real(wp), intent(in) :: vector(:), h
      real(wp), intent(out) :: product(:)

      self%trial = self%x + h*vector
      call self%inner%residual(self%trial, self%ahead)
      product = (self%ahead - self%r)/h
   end subroutine difference

   !> Unknowns are of one kind: one step for all, relative to the largest, does not drown the small
   !> ones of a piecewise smooth system in round-off.
   pure real(wp) function step_size(self)
      class(difference_system), intent(in) :: self

      step_size = relative_step*max(maxval(abs(self%x)), tiny(1.0_wp)/relative_step**2)
   end function step_size

   !> From the analytic derivative: what only speeds up need not be checked.
   subroutine build_preconditioner(self)
      class(difference_system), intent(inout) :: self
      integer :: n

      call self%inner%residual(self%x, self%ahead)
      call self%inner%linearize(n)
      call self%inner%build_preconditioner()
   end subroutine build_preconditioner

   !> The system's own, of the point where it was built.
   subroutine precondition(self, vector)
      class(difference_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)

      call self%inner%precondition(vector)
   end subroutine precondition

   !> n residuals for the whole matrix (n, n).
   subroutine assemble(self, matrix)
      class(difference_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      real(wp) :: unit(self%n)
      integer :: j

      do j = 1, self%n
         if (self%is_interrupted()) return
         unit = 0.0_wp
         unit(j) = 1.0_wp
         call difference(self, unit, step_size(self), matrix(:self%n, j))
      end do
   end subroutine assemble

end module difference_system_module
