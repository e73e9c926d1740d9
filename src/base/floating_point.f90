!> The floating-point environment of the caller around a call of the library: traps are off and
!> flags are clear inside, and what the caller had set holds again afterwards. A program that
!> stops at divisions by zero of its own may so call numerics that use infinities.
!>
!> This is C's fenv.h: gfortran restores the environment at the end of every procedure that uses
!> the intrinsic module, so that the pair below could not be written with it.
module fw_floating_point
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   implicit none (type, external)
   private

   public :: floating_point_scope

   !> Room for any fenv_t, in words of 8 bytes (32 bytes on x86-64).
   integer, parameter :: environment_size = 32

   type :: floating_point_scope
      private
      !> A fenv_t of C, whatever its layout.
      integer(c_int64_t) :: environment(environment_size) = 0_c_int64_t
   contains
      procedure :: enter
      procedure :: leave
   end type floating_point_scope

   interface
      integer(c_int) function c_feholdexcept(environment) bind(c, name='feholdexcept')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int64_t), intent(inout) :: environment(*)
      end function c_feholdexcept

      integer(c_int) function c_fesetenv(environment) bind(c, name='fesetenv')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int64_t), intent(in) :: environment(*)
      end function c_fesetenv
   end interface

contains

   !> Save what the caller has set, clear the flags and switch the traps off.
   subroutine enter(self)
      class(floating_point_scope), intent(inout) :: self
      integer(c_int) :: ignored

      ignored = c_feholdexcept(self%environment)
   end subroutine enter

   !> Put it back; flags that were raised inside are forgotten.
   subroutine leave(self)
      class(floating_point_scope), intent(in) :: self
      integer(c_int) :: ignored

      ignored = c_fesetenv(self%environment)
   end subroutine leave

end module fw_floating_point
