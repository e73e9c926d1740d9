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
      !> What the branch is measured by at x, and its derivative along the branch: x and t where
      !> that is the unknowns themselves.
      real(wp), allocatable :: y(:), t_y(:)
      !> Its derivative by p at a constant x, where it is not x.
      real(wp), allocatable :: y_p(:)
      real(wp) :: p = 0.0_wp
      real(wp) :: t_p = 0.0_wp
      !> How it was found; all converged but perhaps for one on a bound.
      type(solver_report) :: report
      !> Whether p turns here.
      logical :: fold = .false.
      !> Sign of det(dR/dx) dp/ds; 0 where it is not known.
      integer :: orientation = 0
      !> Interval of p that such a turn was brought down to, where it did not settle; else 0.
      real(wp) :: unsettled = 0.0_wp
   end type branch_point

   !> Lengths: y over the size it has about here and p over the length of its interval, so that a
   !> step means the same in every system of units, and a narrow resonance bends the branch.
   type :: metric_type
      real(wp) :: y_scale = 1.0_wp
      !> Values in front of the unknowns in y, and the scale of these unknowns.
      integer :: n_seen = 0
      real(wp) :: x_scale = 1.0_wp
      real(wp) :: p_scale = 1.0_wp
   contains
      procedure :: inner
      procedure :: length
      procedure :: size => size_of
      procedure :: normalize
      procedure :: chord
   end type metric_type

contains

   pure real(wp) function inner(self, y1, p1, y2, p2)
      class(metric_type), intent(in) :: self
      real(wp), intent(in) :: y1(:), p1, y2(:), p2

      associate (n => self%n_seen)
         if (n == 0) then
            inner = dot_product(y1, y2)/self%y_scale**2 + p1*p2/self%p_scale**2
         else
            inner = dot_product(y1(:n), y2(:n))/self%y_scale**2 + &
                    dot_product(y1(n + 1:), y2(n + 1:))/self%x_scale**2 + p1*p2/self%p_scale**2
         end if
      end associate
   end function inner

   pure real(wp) function length(self, y, p)
      class(metric_type), intent(in) :: self
      real(wp), intent(in) :: y(:), p

      length = hypot(self%size(y), p/self%p_scale)
   end function length

   !> Length of a change of y alone.
   pure real(wp) function size_of(self, y)
      class(metric_type), intent(in) :: self
      real(wp), intent(in) :: y(:)

      associate (n => self%n_seen)
         if (n == 0) then
            size_of = norm2(y)/self%y_scale
         else
            size_of = hypot(norm2(y(:n))/self%y_scale, norm2(y(n + 1:))/self%x_scale)
         end if
      end associate
   end function size_of

   !> Give the tangent of a point the length one.
   pure subroutine normalize(self, point)
      class(metric_type), intent(in) :: self
      type(branch_point), intent(inout) :: point
      real(wp) :: size

      size = self%length(point%t_y, point%t_p)
      if (.not. size > 0.0_wp) return
      point%t = point%t/size
      point%t_y = point%t_y/size
      point%t_p = point%t_p/size
   end subroutine normalize

   !> Distance between two points.
   pure real(wp) function chord(self, a, b)
      class(metric_type), intent(in) :: self
      type(branch_point), intent(in) :: a, b

      chord = self%length(b%y - a%y, b%p - a%p)
   end function chord

   !> Turn the tangent round.
   pure subroutine reverse(point)
      type(branch_point), intent(inout) :: point

      point%t = -point%t
      point%t_y = -point%t_y
      point%t_p = -point%t_p
      point%orientation = -point%orientation
   end subroutine reverse

end module fw_branch_point
