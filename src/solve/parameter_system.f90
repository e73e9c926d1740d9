!> A nonlinear system R(x, p) = 0 with a parameter: what continuation needs to know of it.
!>
!> Extends nonlinear_system: unknowns, residual, derivative and preconditioner are those at the
!> value of the parameter that was set last. In a frequency response p is omega [rad/s].
module fw_parameter_system
   use fw_kinds, only: wp
   use fw_error, only: error_type
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: parameter_system

   type, abstract, extends(nonlinear_system) :: parameter_system
   contains
      procedure(bring_to_parameter), deferred :: set_parameter
      procedure(derive_by_parameter), deferred :: parameter_derivative
   end type parameter_system

   abstract interface
      !> Bring the system to a value of the parameter.
      !> Afterwards nothing of the former point holds: the residual comes first. An error is a value
      !> that the system cannot be brought to, such as one where its condensation is singular.
      subroutine bring_to_parameter(self, parameter, error)
         import :: parameter_system, wp, error_type
         class(parameter_system), intent(inout) :: self
         real(wp), intent(in) :: parameter
         type(error_type), allocatable, intent(out) :: error
      end subroutine bring_to_parameter

      !> dr = dR/dp at the last evaluated and linearized point x.
      !> For predictors and tangents of a branch; x is that point, for systems that do not keep it.
      subroutine derive_by_parameter(self, x, dr)
         import :: parameter_system, wp
         class(parameter_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine derive_by_parameter
   end interface

end module fw_parameter_system
