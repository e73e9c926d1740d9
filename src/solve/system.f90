!> A nonlinear system R(x) = 0 as the solvers see it: they know no physics.
!>
!> The linear problem of a Newton step may be smaller than the system: rows that the system can
!> solve by itself (stuck contact pairs) leave it. `linearize` says how many unknowns remain,
!> `reduce` and `expand` go between the two.
module fw_system
   use fw_kinds, only: wp
   use fw_krylov, only: linear_operator
   implicit none (type, external)
   private

   public :: nonlinear_system

   type, abstract, extends(linear_operator) :: nonlinear_system
      !> Unknowns.
      integer :: n = 0
      !> Norm to which residuals are compared.
      real(wp) :: reference = 1.0_wp
      !> Let `linearize` leave out unknowns that the system solves by itself. Where it is false,
      !> n_linear = n, unknowns and equations keep their order, `apply` multiplies with the whole
      !> derivative, `reduce` returns -r and `expand` the solution.
      logical :: reduced = .true.
      !> Unknowns that `linearize` has eliminated: they are worked on, not skipped.
      integer :: n_eliminated = 0
   contains
      procedure(evaluate_residual), deferred :: residual
      procedure(prepare_derivative), deferred :: linearize
      procedure(reduce_rhs), deferred :: reduce
      procedure(expand_step), deferred :: expand
      procedure(build), deferred :: build_preconditioner
      procedure :: preconditioner_fits
      procedure :: strengthen_preconditioner
      procedure :: precondition_columns
      procedure(assemble_matrix), deferred :: assemble
   end type nonlinear_system

   abstract interface
      !> r = R(x). The system remembers the point for `linearize`.
      subroutine evaluate_residual(self, x, r)
         import :: nonlinear_system, wp
         class(nonlinear_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: r(:)
      end subroutine evaluate_residual

      !> Prepare the derivative at the last point; n_linear unknowns remain in the linear problem.
      subroutine prepare_derivative(self, n_linear)
         import :: nonlinear_system
         class(nonlinear_system), intent(inout) :: self
         integer, intent(out) :: n_linear
      end subroutine prepare_derivative

      !> Right-hand side of the remaining problem for the step -J^-1 r.
      subroutine reduce_rhs(self, r, rhs)
         import :: nonlinear_system, wp
         class(nonlinear_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:)
         real(wp), intent(out), contiguous :: rhs(:)
      end subroutine reduce_rhs

      !> The whole step from the solution of the remaining problem.
      subroutine expand_step(self, r, solution, step)
         import :: nonlinear_system, wp
         class(nonlinear_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:), solution(:)
         real(wp), intent(out), contiguous :: step(:)
      end subroutine expand_step

      !> Something near the inverse of the derivative that was prepared last, for `precondition`.
      subroutine build(self)
         import :: nonlinear_system
         class(nonlinear_system), intent(inout) :: self
      end subroutine build

      !> The matrix of the remaining problem (n_linear, n_linear).
      subroutine assemble_matrix(self, matrix)
         import :: nonlinear_system, wp
         class(nonlinear_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: matrix(:, :)
      end subroutine assemble_matrix
   end interface

contains

   !> Whether the preconditioner that was built last may serve the derivative that was prepared
   !> last: the same unknowns in the same places. How well it serves is for the caller to watch.
   pure logical function preconditioner_fits(self)
      class(nonlinear_system), intent(in) :: self

      ! A system that says nothing keeps nothing.
      preconditioner_fits = self%n < 0
   end function preconditioner_fits

   !> Take a preconditioner that costs more and serves better, from the next build on, if there is
   !> one.
   subroutine strengthen_preconditioner(self, is_stronger)
      class(nonlinear_system), intent(inout) :: self
      logical, intent(out) :: is_stronger

      ! A system that says nothing has one only.
      is_stronger = self%n < 0
   end subroutine strengthen_preconditioner

   !> `precondition` of several vectors (n_linear, any number); a system may be faster at once.
   subroutine precondition_columns(self, columns)
      class(nonlinear_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: columns(:, :)
      integer :: j

      do j = 1, size(columns, 2)
         call self%precondition(columns(:, j))
      end do
   end subroutine precondition_columns

end module fw_system
