!> Points of a branch R(x, p) = 0 with their tangents, and the lengths they are measured with.
module fw_branch_point
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   implicit none (type, external)
   private

   public :: branch_point, metric_type, reverse

   !> A point of the branch with its unit tangent (dx/ds, dp/ds).
   type :: branch_point
      real(wp), allocatable :: x(:), t(:)
      real(wp) :: p = 0.0_wp
      real(wp) :: t_p = 0.0_wp
      !> How it was found; all converged but perhaps for one on a bound.
      type(solver_report) :: report
      !> Whether p turns here.
      logical :: fold = .false.
      !> Sign of det(dR/dx) dp/ds; 0 where it is not known.
      integer :: orientation = 0
   end type branch_point

   !> Lengths: x over the size it has about here and p over the length of its interval, so that a
   !> step means the same in every system of units, and a narrow resonance bends the branch.
   type :: metric_type
      real(wp) :: x_scale = 1.0_wp
      real(wp) :: p_scale = 1.0_wp
   contains
      procedure :: inner
      procedure :: length
      procedure :: normalize
      procedure :: chord
   end type metric_type

contains

   pure real(wp) function inner(self, x1, p1, x2, p2)
      class(metric_type), intent(in) :: self
      real(wp), intent(in) :: x1(:), p1, x2(:), p2

      inner = dot_product(x1, x2)/self%x_scale**2 + p1*p2/self%p_scale**2
   end function inner

   pure real(wp) function length(self, x, p)
      class(metric_type), intent(in) :: self
      real(wp), intent(in) :: x(:), p

      length = hypot(norm2(x)/self%x_scale, p/self%p_scale)
   end function length

   !> Give the tangent of a point the length one.
   pure subroutine normalize(self, point)
      class(metric_type), intent(in) :: self
      type(branch_point), intent(inout) :: point
      real(wp) :: size

      size = self%length(point%t, point%t_p)
      if (.not. size > 0.0_wp) return
      point%t = point%t/size
      point%t_p = point%t_p/size
   end subroutine normalize

   !> Distance between two points.
   pure real(wp) function chord(self, a, b)
      class(metric_type), intent(in) :: self
      type(branch_point), intent(in) :: a, b

      chord = self%length(b%x - a%x, b%p - a%p)
   end function chord

   !> Turn the tangent round.
   pure subroutine reverse(point)
      type(branch_point), intent(inout) :: point

      point%t = -point%t
      point%t_p = -point%t_p
      point%orientation = -point%orientation
   end subroutine reverse

end module fw_branch_point
