!> A curve R(x, p) = 0 cut by a plane,
!>
!>   R(x, p) = 0,    b . (x - x_0) + b_p (p - p_0) = 0,
!>
!> with p as a further unknown: regular where dR/dx alone is singular, at folds and along a branch
!> that runs away at a constant p.
!> As an augmented system it has one further unknown, p, and one condition, the plane: g_q = b^T and
!> g_z = b_p. The inner system may solve some unknowns at once; what these do enters the column, the
!> corner and the right-hand side of the condition through `expand`.
module fw_plane_system
   use fw_augmented_system, only: augmented_system
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: plane_system

   type, extends(augmented_system) :: plane_system
      !> A point of the plane.
      real(wp), allocatable, private :: x_0(:)
      !> The last point.
      real(wp), allocatable :: x(:)
      real(wp), private :: p_0 = 0.0_wp
      !> b (n) and b_p.
      real(wp), allocatable :: border(:)
      real(wp) :: border_p = 0.0_wp
      !> dR/dp at the last point (n), the same in the linear problem, and g_p there.
      real(wp), allocatable :: slope(:), column(:)
      real(wp) :: corner_p = 0.0_wp
      !> Scratch (n), (n_linear_inner).
      real(wp), allocatable, private :: whole(:), nothing(:)
   contains
      procedure :: cut
      procedure :: take
      procedure :: conditions
      procedure :: choose
      procedure :: settle
      procedure :: reduce_rows
      procedure :: add_columns
      procedure :: rows
      procedure :: subtract_rows
      procedure :: corner
      procedure :: assemble
   end type plane_system

contains

   !> Take the plane through (x_0, p_0), where the system stands and was evaluated last.
   subroutine cut(self, system, x_0, p_0, border, border_p)
      class(plane_system), intent(inout) :: self
      !> Only pointed at: not to be used once the system is gone.
      class(parameter_system), intent(inout), target :: system
      real(wp), intent(in) :: x_0(:), p_0, border(:), border_p

      call self%augment(system, 1)
      self%x_0 = x_0
      self%x = x_0
      self%p_0 = p_0
      self%border = border
      self%border_p = border_p
      self%slope = x_0
      self%whole = x_0
   end subroutine cut

   !> The further unknown is the parameter of the inner system.
   subroutine take(self, z, error)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in) :: z(:)
      type(error_type), allocatable, intent(out) :: error

      call self%inner%set_parameter(z(1), error)
   end subroutine take

   !> The distance from the plane, in the units of b.
   subroutine conditions(self, q, z, g)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in) :: q(:), z(:)
      real(wp), intent(out) :: g(:)

      self%x = q
      g = dot_product(self%border, q - self%x_0) + self%border_p*(z - self%p_0)
   end subroutine conditions

   !> The column of p follows from dR/dp by what the inner system solves at once.
   subroutine choose(self)
      class(plane_system), intent(inout) :: self

      call self%inner%linearize(self%n_linear_inner)
      self%n_linear_extra = 1
      call self%inner%parameter_derivative(self%x, self%slope)
      if (allocated(self%column)) deallocate (self%column, self%nothing)
      allocate (self%column(self%n_linear_inner), self%nothing(self%n_linear_inner), source=0.0_wp)
      ! `reduce` gives the right-hand side for a residual, which is minus the column of p.
      call self%inner%reduce(self%slope, self%column)
      self%column = -self%column
      ! Unknowns that are solved at once move by `whole` for each unit of p, and the plane sees
      ! them.
      call self%inner%expand(self%slope, self%nothing, self%whole)
      self%corner_p = self%border_p + dot_product(self%border, self%whole)
   end subroutine choose

   !> Unknowns that are solved at once see the change of p as well: R + R_p dp.
   subroutine settle(self, g, dz, r)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in) :: g(:), dz(:)
      real(wp), intent(inout), contiguous :: r(:)

      associate (unused => g)
      end associate
      r = r + dz(1)*self%slope
   end subroutine settle

   !> -g, less what the unknowns that are solved at once do to the plane.
   subroutine reduce_rows(self, r, g, rhs)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), g(:)
      real(wp), intent(out), contiguous :: rhs(:)

      call self%inner%expand(r, self%nothing, self%whole)
      rhs = -g - dot_product(self%border, self%whole)
   end subroutine reduce_rows

   !> product + R_p dp, in the linear problem.
   subroutine add_columns(self, dz, product)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in) :: dz(:)
      real(wp), intent(inout), contiguous :: product(:)

      product = product + dz(1)*self%column
   end subroutine add_columns

   !> b . v + g_p dp.
   subroutine rows(self, v, dz, product)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: v(:), dz(:)
      real(wp), intent(out), contiguous :: product(:)

      product = self%corner_p*dz + border_times(self, v)
   end subroutine rows

   !> Exact here: the border is a row of numbers, whatever the preconditioner leaves out elsewhere.
   subroutine subtract_rows(self, v, rows, is_built)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: v(:, :)
      real(wp), intent(inout) :: rows(:, :)
      logical, intent(in) :: is_built
      integer :: j

      associate (unused => is_built)
      end associate
      do j = 1, size(v, 2)
         rows(1, j) = rows(1, j) - border_times(self, v(:, j))
      end do
   end subroutine subtract_rows

   !> b . v for unknowns of the linear problem.
   real(wp) function border_times(self, v)
      class(plane_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: v(:)
      real(wp) :: r(self%inner%n)

      r = 0.0_wp
      call self%inner%expand(r, v, self%whole)
      border_times = dot_product(self%border, self%whole)
   end function border_times

   !> g_p, with what p does through the unknowns that are solved at once.
   subroutine corner(self, matrix)
      class(plane_system), intent(inout) :: self
      real(wp), intent(out) :: matrix(:, :)

      matrix = self%corner_p
   end subroutine corner

   !> The inner matrix as the inner system assembles it, then the borders.
   subroutine assemble(self, matrix)
      class(plane_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      real(wp) :: unit(self%n_linear_inner)
      integer :: j, n

      n = self%n_linear_inner
      if (n > 0) call self%inner%assemble(matrix)
      matrix(:n, n + 1) = self%column
      ! A row of the border in the linear problem is b . expand(e_j): unknown by unknown, since
      ! `expand` is all that is known of how they lie in x.
      do j = 1, n
         unit = 0.0_wp
         unit(j) = 1.0_wp
         matrix(n + 1, j) = border_times(self, unit)
      end do
      matrix(n + 1, n + 1) = self%corner_p
   end subroutine assemble

end module fw_plane_system
