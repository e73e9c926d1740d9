!> What a branch is measured by, where that is not the unknowns themselves.
!>
!> The unknowns of a condensed system are what it takes to solve it, and may say little of the
!> response: the slip of a joint grows by leaps where the motion of the structure hardly bends.
module fw_branch_view
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: branch_view

   type, abstract :: branch_view
      !> Values.
      integer :: n = 0
   contains
      procedure(look), deferred :: see
   end type branch_view

   abstract interface
      !> The values y(x, p), affine in x, at the p where the system stands.
      subroutine look(self, x, y)
         import :: branch_view, wp
         class(branch_view), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         !> (n)
         real(wp), intent(out), contiguous :: y(:)
      end subroutine look
   end interface

end module fw_branch_view
