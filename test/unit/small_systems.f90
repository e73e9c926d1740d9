!> Small analytic systems for the tests of the solvers, written for obviousness.
module small_systems
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_kinds, only: wp
   use fw_pseudo_system, only: pseudo_system
   implicit none (type, external)
   private

   public :: dense_system, circle_system, linear_system, arctan_system, corner_system
   public :: rootless_system, spring_system, broken_system, hump_system

   !> A system given by its residual and its whole derivative. P is diagonal.
   type, abstract, extends(pseudo_system) :: dense_system
      real(wp), allocatable :: flow(:), point(:), jacobian(:, :), diagonal(:)
      real(wp) :: inverse_step = 0.0_wp
      real(wp), allocatable :: x_old(:)
      !> Unknowns at the end that leave the reduced problem (n = 1 stays): see reduce.
      integer :: n_left_out = 0
      integer :: n_linear = 0
      integer :: n_residuals = 0
   contains
      procedure(evaluate), deferred :: value
      procedure(differentiate), deferred :: derivative
      procedure :: create
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: precondition
      procedure :: assemble
      procedure :: flow_product
      procedure :: flow_solve
      procedure :: set_shift
      procedure :: clear_shift
   end type dense_system

   abstract interface
      subroutine evaluate(self, x, r)
         import :: dense_system, wp
         class(dense_system), intent(in) :: self
         real(wp), intent(in) :: x(:)
         real(wp), intent(out) :: r(:)
      end subroutine evaluate

      subroutine differentiate(self, x, matrix)
         import :: dense_system, wp
         class(dense_system), intent(in) :: self
         real(wp), intent(in) :: x(:)
         real(wp), intent(out) :: matrix(:, :)
      end subroutine differentiate
   end interface

   !> x1^2 + x2^2 = 2, x1 = x2 times `scale`: roots (1, 1) and (-1, -1).
   type, extends(dense_system) :: circle_system
      real(wp) :: scale = 1.0_wp
   contains
      procedure :: value => circle_value
      procedure :: derivative => circle_derivative
   end type circle_system

   !> A x = b.
   type, extends(dense_system) :: linear_system
      real(wp), allocatable :: matrix(:, :), rhs(:)
   contains
      procedure :: value => linear_value
      procedure :: derivative => linear_derivative
   end type linear_system

   !> atan(x) = 0 for each unknown: Newton's method without a line search diverges from |x| > 1.39.
   type, extends(dense_system) :: arctan_system
   contains
      procedure :: value => arctan_value
      procedure :: derivative => arctan_derivative
   end type arctan_system

   !> x/(1 + x^2) = 0: beyond the hump at |x| = 1 Newton's direction leads away from the root, the
   !> flow does not.
   type, extends(dense_system) :: hump_system
   contains
      procedure :: value => hump_value
      procedure :: derivative => hump_derivative
   end type hump_system

   !> A chain with stops, x_i - 0.4 (neighbours) + 10 max(x_i - 1, 0) = load: a corner in each.
   type, extends(dense_system) :: corner_system
      real(wp) :: load = 5.0_wp
   contains
      procedure :: value => corner_value
      procedure :: derivative => corner_derivative
   end type corner_system

   !> x^2 + 1 = 0.
   type, extends(dense_system) :: rootless_system
   contains
      procedure :: value => rootless_value
      procedure :: derivative => rootless_derivative
   end type rootless_system

   !> A chain of n cubic springs between walls, load 1: larger, smooth, one root.
   type, extends(dense_system) :: spring_system
      real(wp) :: cubic = 1.0_wp
   contains
      procedure :: value => spring_value
      procedure :: derivative => spring_derivative
   end type spring_system

   !> sqrt(1 - x^2) = 1/2 for each unknown, not a number from |x| > 1.
   type, extends(dense_system) :: broken_system
   contains
      procedure :: value => broken_value
      procedure :: derivative => broken_derivative
   end type broken_system

contains

   subroutine create(self, n)
      class(dense_system), intent(inout) :: self
      integer, intent(in) :: n

      self%n = n
      allocate (self%flow(n), source=1.0_wp)
      allocate (self%jacobian(n, n), self%point(n), self%x_old(n), self%diagonal(n), source=0.0_wp)
   end subroutine create

   subroutine residual(self, x, r)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)

      self%n_residuals = self%n_residuals + 1
      self%point = x
      ! A derivative taken elsewhere is worth nothing: misuse must show.
      self%jacobian = 0.0_wp
      call self%value(x, r)
      r = r + self%inverse_step*self%flow*(x - self%x_old)
   end subroutine residual

   subroutine linearize(self, n_linear)
      class(dense_system), intent(inout) :: self
      integer, intent(out) :: n_linear
      integer :: i

      call self%derivative(self%point, self%jacobian)
      do i = 1, self%n
         self%jacobian(i, i) = self%jacobian(i, i) + self%inverse_step*self%flow(i)
      end do
      self%n_linear = self%n
      if (self%reduced) self%n_linear = self%n - self%n_left_out
      n_linear = self%n_linear
   end subroutine linearize

   !> The rows left out have to be diagonal: their unknowns are solved at once.
   subroutine reduce(self, r, rhs)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)
      integer :: j

      rhs = -r(:self%n_linear)
      do j = self%n_linear + 1, self%n
         rhs = rhs + self%jacobian(:self%n_linear, j)*r(j)/self%jacobian(j, j)
      end do
   end subroutine reduce

   subroutine expand(self, r, solution, step)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)
      integer :: j

      step(:self%n_linear) = solution
      do j = self%n_linear + 1, self%n
         step(j) = -r(j)/self%jacobian(j, j)
      end do
   end subroutine expand

   subroutine apply(self, vector, product)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)

      product = matmul(self%jacobian(:self%n_linear, :self%n_linear), vector)
   end subroutine apply

   subroutine build_preconditioner(self)
      class(dense_system), intent(inout) :: self
      integer :: i

      do i = 1, self%n
         self%diagonal(i) = self%jacobian(i, i)
      end do
   end subroutine build_preconditioner

   !> Jacobi.
   subroutine precondition(self, vector)
      class(dense_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)

      vector = vector/self%diagonal(:size(vector))
   end subroutine precondition

   subroutine assemble(self, matrix)
      class(dense_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)

      matrix(:self%n_linear, :self%n_linear) = self%jacobian(:self%n_linear, :self%n_linear)
   end subroutine assemble

   subroutine flow_product(self, vector, product)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)

      product = self%flow*vector
   end subroutine flow_product

   subroutine flow_solve(self, vector)
      class(dense_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)

      vector = vector/self%flow
   end subroutine flow_solve

   subroutine set_shift(self, h, x_old)
      class(dense_system), intent(inout) :: self
      real(wp), intent(in) :: h
      real(wp), intent(in), contiguous :: x_old(:)

      self%inverse_step = 1.0_wp/h
      self%x_old = x_old
   end subroutine set_shift

   subroutine clear_shift(self)
      class(dense_system), intent(inout) :: self

      self%inverse_step = 0.0_wp
   end subroutine clear_shift

   subroutine circle_value(self, x, r)
      class(circle_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      r(1) = self%scale*(x(1)**2 + x(2)**2 - 2.0_wp)
      r(2) = self%scale*(x(2) - x(1))
   end subroutine circle_value

   subroutine circle_derivative(self, x, matrix)
      class(circle_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)

      matrix(1, :) = 2.0_wp*self%scale*x
      matrix(2, :) = self%scale*[-1.0_wp, 1.0_wp]
   end subroutine circle_derivative

   subroutine linear_value(self, x, r)
      class(linear_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      r = matmul(self%matrix, x) - self%rhs
   end subroutine linear_value

   subroutine linear_derivative(self, x, matrix)
      class(linear_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)

      associate (x => x)
      end associate
      matrix = self%matrix
   end subroutine linear_derivative

   subroutine arctan_value(self, x, r)
      class(arctan_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      associate (self => self)
      end associate
      r = atan(x)
   end subroutine arctan_value

   subroutine arctan_derivative(self, x, matrix)
      class(arctan_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = 1.0_wp/(1.0_wp + x(i)**2)
      end do
   end subroutine arctan_derivative

   subroutine hump_value(self, x, r)
      class(hump_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      associate (self => self)
      end associate
      r = x/(1.0_wp + x**2)
   end subroutine hump_value

   subroutine hump_derivative(self, x, matrix)
      class(hump_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = (1.0_wp - x(i)**2)/(1.0_wp + x(i)**2)**2
      end do
   end subroutine hump_derivative

   subroutine corner_value(self, x, r)
      class(corner_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      r = x + 10.0_wp*max(x - 1.0_wp, 0.0_wp) - self%load
      r(2:) = r(2:) - 0.4_wp*x(:self%n - 1)
      r(:self%n - 1) = r(:self%n - 1) - 0.4_wp*x(2:)
   end subroutine corner_value

   subroutine corner_derivative(self, x, matrix)
      class(corner_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = 1.0_wp + merge(10.0_wp, 0.0_wp, x(i) > 1.0_wp)
      end do
      do i = 2, self%n
         matrix(i, i - 1) = -0.4_wp
         matrix(i - 1, i) = -0.4_wp
      end do
   end subroutine corner_derivative

   subroutine rootless_value(self, x, r)
      class(rootless_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      associate (self => self)
      end associate
      r = x**2 + 1.0_wp
   end subroutine rootless_value

   subroutine rootless_derivative(self, x, matrix)
      class(rootless_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = 2.0_wp*x(i)
      end do
   end subroutine rootless_derivative

   subroutine spring_value(self, x, r)
      class(spring_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      r = 2.5_wp*x + self%cubic*x**3 - 1.0_wp
      r(2:) = r(2:) - x(:self%n - 1)
      r(:self%n - 1) = r(:self%n - 1) - x(2:)
   end subroutine spring_value

   subroutine spring_derivative(self, x, matrix)
      class(spring_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = 2.5_wp + 3.0_wp*self%cubic*x(i)**2
      end do
      do i = 2, self%n
         matrix(i, i - 1) = -1.0_wp
         matrix(i - 1, i) = -1.0_wp
      end do
   end subroutine spring_derivative

   subroutine broken_value(self, x, r)
      class(broken_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: r(:)

      associate (self => self)
      end associate
      where (abs(x) <= 1.0_wp)
         r = sqrt(1.0_wp - min(1.0_wp, x**2)) - 0.5_wp
      else where
         r = ieee_value(1.0_wp, ieee_quiet_nan)
      end where
   end subroutine broken_value

   subroutine broken_derivative(self, x, matrix)
      class(broken_system), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: matrix(:, :)
      integer :: i

      matrix = 0.0_wp
      do i = 1, self%n
         matrix(i, i) = -x(i)/sqrt(1.0_wp - min(0.999_wp, x(i)**2))
      end do
   end subroutine broken_derivative

end module small_systems
