!> The linear problem of a continuation step as one matrix,
!>
!>   [ J    R_p ] [ dx ]     [ r ]
!>   [ b^T  b_p ] [ dp ] = - [ s ] ,
!>
!> which is regular where J alone is singular: at folds, and along a branch that runs away at a
!> constant p. Solutions with J that are combined afterwards lose all digits there (Govaerts 2000,
!> Numerical methods for bifurcations of dynamical equilibria, section 3.2).
module fw_bordered
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: bordered_type

   type :: bordered_type
      type(lu_type) :: lu
      !> R_p and b (n); b_p.
      real(wp), allocatable :: slope(:), border(:)
      real(wp) :: border_p = 0.0_wp
      !> Unknowns of J that are left after those that are solved at once.
      integer :: n_linear = 0
   contains
      procedure :: prepare
      procedure :: solve
   end type bordered_type

contains

   !> Linearize the system at its last point x and factor the matrix.
   subroutine prepare(self, system, x, border, border_p, singular)
      class(bordered_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:), border(:)
      real(wp), intent(in) :: border_p
      logical, intent(out) :: singular
      real(wp), allocatable :: unit(:), nothing(:), column(:)
      integer :: j, n

      call system%linearize(self%n_linear)
      n = self%n_linear
      self%border = border
      self%border_p = border_p
      self%slope = x
      call system%parameter_derivative(x, self%slope)
      allocate (unit(n), nothing(system%n), column(system%n), source=0.0_wp)
      call self%lu%reserve(n + 1)
      associate (matrix => self%lu%matrix)
         call system%assemble(matrix)
         call system%reduce(self%slope, unit)
         matrix(:n, n + 1) = -unit
         do j = 1, n
            unit = 0.0_wp
            unit(j) = 1.0_wp
            call system%expand(nothing, unit, column)
            matrix(n + 1, j) = dot_product(border, column)
         end do
         unit = 0.0_wp
         call system%expand(self%slope, unit, column)
         matrix(n + 1, n + 1) = border_p + dot_product(border, column)
      end associate
      call self%lu%factor(singular)
   end subroutine prepare

   !> dx and dp for right-hand sides r and s.
   subroutine solve(self, system, r, s, dx, dp)
      class(bordered_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(in) :: s
      real(wp), intent(out), contiguous :: dx(:)
      real(wp), intent(out) :: dp
      real(wp) :: rhs(self%n_linear + 1), nothing(self%n_linear)
      integer :: n

      n = self%n_linear
      call system%reduce(r, rhs(:n))
      nothing = 0.0_wp
      call system%expand(r, nothing, dx)
      rhs(n + 1) = -s - dot_product(self%border, dx)
      call self%lu%solve(rhs)
      dp = rhs(n + 1)
      call system%expand(r + dp*self%slope, rhs(:n), dx)
   end subroutine solve

end module fw_bordered
