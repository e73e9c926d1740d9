!> How long a step along a branch may be: what a cubic through points and tangents misses of the
!> curve, from the last two steps alone.
!>
!> A cubic through the two last points and their tangents, extended over the new step, misses the
!> new point by D. Where the curve is smooth, the cubic of the new step itself misses the curve by
!> D h^2 / (16 (h_0 + h)^2) at most (h, h_0: the new step and the one before; fourth derivatives
!> of Hermite interpolation). Where contact opens, closes or begins to slip, the curve has a
!> corner, and what is missed is an eighth of the step times the change of the tangent. A corner
!> shows by a D that is much larger than the steps before it lead to expect.
!>
!> Only what lies across the tangent counts: along it, errors are those of the parameter s.
module fw_branch_step
   use fw_branch_point, only: branch_point
   use fw_branch_point, only: metric_type
   use fw_branch_point, only: reverse
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: allowed_error, extrapolate, interpolate, missed, step_history, turns_between

   !> What the cubic may miss, of the size of x.
   real(wp), parameter :: allowed_error = 5.0e-3_wp
   !> Growth of the fourth derivative from step to step beyond which there is a corner: a resonance
   !> makes it grow by (1 - h/d)^-5, at a distance d of about three steps.
   real(wp), parameter :: surprise = 10.0_wp
   !> Steepness (x over p) up to which errors of p are taken for the errors of x that they mean.
   real(wp), parameter :: steepest = 1.0e3_wp

   !> Errors are measured by the size of x at the smaller end of a step, down to this part of the
   !> scale: at an antiresonance x is all but nothing.
   real(wp), parameter :: least = 0.15_wp

   !> What the last step leaves for the next.
   type :: step_history
      logical :: known = .false.
      type(branch_point) :: before
      !> Length of the last step.
      real(wp) :: length = 0.0_wp
      !> Size of the fourth derivative over 24; 0: not known.
      real(wp) :: fourth = 0.0_wp
   end type step_history

contains

   !> The cubic through two points and their tangents at a distance s from the first of them, of h
   !> between them: point and derivative.
   pure subroutine cubic(metric, a, b, h, s, x, p, dx, dp)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: h, s
      real(wp), intent(out) :: x(:), p, dx(:), dp
      real(wp) :: u, w(4), dw(4), size_a, size_b

      u = s/h
      size_a = metric%length(a%t, a%t_p)
      size_b = metric%length(b%t, b%t_p)
      w = [(1.0_wp + 2.0_wp*u)*(1.0_wp - u)**2, u**2*(3.0_wp - 2.0_wp*u), &
           h*u*(1.0_wp - u)**2/size_a, -h*u**2*(1.0_wp - u)/size_b]
      dw = [6.0_wp*u*(u - 1.0_wp)/h, 6.0_wp*u*(1.0_wp - u)/h, &
            (1.0_wp - u)*(1.0_wp - 3.0_wp*u)/size_a, u*(3.0_wp*u - 2.0_wp)/size_b]
      x = w(1)*a%x + w(2)*b%x + w(3)*a%t + w(4)*b%t
      p = w(1)*a%p + w(2)*b%p + w(3)*a%t_p + w(4)*b%t_p
      dx = dw(1)*a%x + dw(2)*b%x + dw(3)*a%t + dw(4)*b%t
      dp = dw(1)*a%p + dw(2)*b%p + dw(3)*a%t_p + dw(4)*b%t_p
   end subroutine cubic

   !> Length of the arc between two points, from its chord and the angle of its tangents.
   pure real(wp) function arc(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp) :: cosine

      cosine = metric%inner(a%t, a%t_p, b%t, b%t_p)/ &
               (metric%length(a%t, a%t_p)*metric%length(b%t, b%t_p))
      ! (angle/2)/sin(angle/2), to the second order.
      arc = metric%chord(a, b)*(1.0_wp + (1.0_wp - max(cosine, 0.0_wp))/12.0_wp)
   end function arc

   !> Guess at a step ds: along the cubic of the last step where that serves, along the tangent
   !> otherwise.
   pure subroutine extrapolate(metric, history, here, ds, guess)
      type(metric_type), intent(in) :: metric
      type(step_history), intent(in) :: history
      type(branch_point), intent(in) :: here
      real(wp), intent(in) :: ds
      type(branch_point), intent(inout) :: guess
      real(wp), allocatable :: dx(:)
      real(wp) :: h, dp, off

      guess%x = here%x + ds*here%t
      guess%p = here%p + ds*here%t_p
      if (.not. history%known) return
      h = arc(metric, history%before, here)
      if (ds > 2.0_wp*h) return
      allocate (dx, mold=here%x)
      call cubic(metric, history%before, here, h, h + ds, guess%x, guess%p, dx, dp)
      ! Into the plane of the corrector.
      off = ds - metric%inner(here%t, here%t_p, guess%x - here%x, guess%p - here%p)
      guess%x = guess%x + off*here%t
      guess%p = guess%p + off*here%t_p
   end subroutine extrapolate

   !> Guess between two points, at a share of the way.
   pure subroutine interpolate(metric, a, b, share, guess)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: share
      type(branch_point), intent(inout) :: guess
      real(wp), allocatable :: dx(:)
      real(wp) :: h, dp

      h = arc(metric, a, b)
      allocate (dx, mold=a%x)
      guess%x = a%x
      call cubic(metric, a, b, h, share*h, guess%x, guess%p, dx, dp)
   end subroutine interpolate

   !> Whether p turns twice between two points whose tangents agree: the cubic knows.
   pure logical function turns_between(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp) :: h, first, last, middle, c(3), u

      h = arc(metric, a, b)
      first = h*a%t_p/metric%length(a%t, a%t_p)
      last = h*b%t_p/metric%length(b%t, b%t_p)
      middle = b%p - a%p
      turns_between = .false.
      if (first*last <= 0.0_wp) return
      ! dp/du = c1 + c2 u + c3 u^2
      c = [first, 6.0_wp*middle - 4.0_wp*first - 2.0_wp*last, &
           3.0_wp*(first + last) - 6.0_wp*middle]
      if (abs(c(3)) <= 0.0_wp) return
      u = -c(2)/(2.0_wp*c(3))
      if (u <= 0.0_wp .or. u >= 1.0_wp) return
      turns_between = (c(1) + 0.5_wp*c(2)*u)*first < 0.0_wp
   end function turns_between

   !> What the cubic of the step from `here` to `next` misses, of the size of x, and its fourth
   !> derivative for the step after it. 0 where nothing is known yet.
   pure subroutine missed(metric, history, here, next, error, fourth)
      type(metric_type), intent(in) :: metric
      type(step_history), intent(in) :: history
      type(branch_point), intent(in) :: here, next
      real(wp), intent(out) :: error, fourth
      real(wp), allocatable :: x(:), dx(:)
      real(wp) :: p, dp, h, h_before, d, bend, weight, smooth

      error = 0.0_wp
      fourth = 0.0_wp
      if (.not. history%known) return
      allocate (x, dx, mold=here%x)
      h_before = arc(metric, history%before, here)
      h = arc(metric, here, next)
      call cubic(metric, history%before, here, h_before, h_before + h, x, p, dx, dp)
      weight = steepness(metric, here, next, h)
      d = across(metric, next, weight, next%x - x, next%p - p)
      fourth = d/((h_before + h)*h)**2
      smooth = d*h**2/(16.0_wp*(h_before + h)**2)
      error = smooth
      if (fourth > surprise*history%fourth .and. history%fourth > 0.0_wp) then
         bend = across(metric, next, weight, next%t/metric%length(next%t, next%t_p) - dx, &
                       next%t_p/metric%length(next%t, next%t_p) - dp)
         error = max(smooth, 0.125_wp*h*bend)
      end if
      error = error*metric%x_scale/max(min(norm2(here%x), norm2(next%x)), least*metric%x_scale)
   end subroutine missed

   !> What an error of p over its scale means for x over its own, on a step.
   pure real(wp) function steepness(metric, a, b, h)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: h
      real(wp) :: part_p

      part_p = max(abs(a%t_p)/metric%length(a%t, a%t_p), abs(b%t_p)/metric%length(b%t, b%t_p), &
                   abs(b%p - a%p)/h)/metric%p_scale
      steepness = min(steepest, 1.0_wp/max(part_p, tiny(1.0_wp)))
   end function steepness

   !> The part of a difference across the tangent of a point.
   pure real(wp) function across(metric, point, weight, x, p)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: point
      real(wp), intent(in) :: weight, x(:), p
      real(wp) :: along

      along = metric%inner(point%t, point%t_p, x, p)/metric%inner(point%t, point%t_p, point%t, &
         point%t_p)
      across = hypot(norm2(x - along*point%t)/metric%x_scale, &
                     weight*(p - along*point%t_p)/metric%p_scale)
   end function across

end module fw_branch_step
