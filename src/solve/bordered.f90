!> The linear problem of an augmented system as one matrix,
!>
!>   [ R_q  R_z ] [ dq ]     [ R ]
!>   [ g_q  g_z ] [ dz ] = - [ g ] ,
!>
!> which is regular where R_q alone is singular: at folds, and along a branch that runs away at a
!> constant parameter. Solutions with R_q that are combined afterwards lose all digits there
!> (Govaerts 2000, Numerical methods for bifurcations of dynamical equilibria, section 3.2).
module fw_bordered
   use fw_augmented_system, only: augmented_system
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   implicit none (type, external)
   private

   public :: bordered_type

   type :: bordered_type
      type(lu_type) :: lu
   contains
      procedure :: prepare
      procedure :: solve
   end type bordered_type

contains

   !> Linearize the system at its last point and factor the matrix.
   subroutine prepare(self, system, singular)
      class(bordered_type), intent(inout) :: self
      class(augmented_system), intent(inout) :: system
      logical, intent(out) :: singular
      integer :: n

      call system%linearize(n)
      call self%lu%reserve(n)
      call system%assemble(self%lu%matrix)
      call self%lu%factor(singular, system%interrupt)
   end subroutine prepare

   !> The step for residuals r of the system, then of the conditions.
   subroutine solve(self, system, r, step)
      class(bordered_type), intent(inout) :: self
      class(augmented_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp) :: rhs(self%lu%n)

      call system%reduce(r, rhs)
      call self%lu%solve(rhs)
      call system%expand(r, rhs, step)
   end subroutine solve

end module fw_bordered
