!> How long a step along a branch may be: what a cubic through points and tangents misses of the
!> curve, from the last two steps alone.
!>
!> A cubic through the two last points and their tangents, extended over the new step, misses the
!> new point by D. Where the curve is smooth, the cubic of the new step itself misses the curve by
!> D h^2 / (16 (h_0 + h)^2) at most (h, h_0: the new step and the one before; fourth derivatives
!> of Hermite interpolation). Where contact opens, closes or begins to slip, the curve has a
!> corner, and what is missed is an eighth of the step times the change of the tangent. D cannot
!> tell one from the other: where a corner would be too much, the curve is looked at there. Two
!> corners that turn there and back leave D without a change of the tangent: D itself is missed.
!>
!> Only what lies across the tangent counts: along it, errors are those of the parameter s.
module fw_branch_step
   use fw_branch_point, only: branch_point, metric_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: allowed_error, extrapolate, interpolate, missed, misses_of, step_history, turns_between

   !> What the cubic may miss, of the size of y.
   real(wp), parameter :: allowed_error = 4.0e-3_wp
   !> Steepness (y over p) up to which errors of p are taken for the errors of y that they mean.
   real(wp), parameter :: steepest = 1.0e3_wp

   !> Errors are measured by the size of y at the smaller end of a step, down to this part of the
   !> scale: at an antiresonance y is all but nothing.
   real(wp), parameter :: least = 0.15_wp

   !> What the last step leaves for the next.
   type :: step_history
      logical :: known = .false.
      type(branch_point) :: before
   end type step_history

contains

   !> The cubic through two points and their tangents at a distance s from the first of them, of h
   !> between them.
   pure subroutine cubic(metric, a, b, h, s, guess)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: h, s
      type(branch_point), intent(inout) :: guess
      real(wp) :: u, w(4), size_a, size_b

      u = s/h
      size_a = metric%length(a%t_y, a%t_p)
      size_b = metric%length(b%t_y, b%t_p)
      w = [(1.0_wp + 2.0_wp*u)*(1.0_wp - u)**2, u**2*(3.0_wp - 2.0_wp*u), &
           h*u*(1.0_wp - u)**2/size_a, -h*u**2*(1.0_wp - u)/size_b]
      guess%x = w(1)*a%x + w(2)*b%x + w(3)*a%t + w(4)*b%t
      guess%y = w(1)*a%y + w(2)*b%y + w(3)*a%t_y + w(4)*b%t_y
      guess%p = w(1)*a%p + w(2)*b%p + w(3)*a%t_p + w(4)*b%t_p
   end subroutine cubic

   !> The same of what the branch is measured by, with its derivative.
   pure subroutine measured_cubic(metric, a, b, h, s, y, p, dy, dp)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: h, s
      real(wp), intent(out) :: y(:), p, dy(:), dp
      real(wp) :: u, w(4), dw(4), size_a, size_b

      u = s/h
      size_a = metric%length(a%t_y, a%t_p)
      size_b = metric%length(b%t_y, b%t_p)
      w = [(1.0_wp + 2.0_wp*u)*(1.0_wp - u)**2, u**2*(3.0_wp - 2.0_wp*u), &
           h*u*(1.0_wp - u)**2/size_a, -h*u**2*(1.0_wp - u)/size_b]
      dw = [6.0_wp*u*(u - 1.0_wp)/h, 6.0_wp*u*(1.0_wp - u)/h, &
            (1.0_wp - u)*(1.0_wp - 3.0_wp*u)/size_a, u*(3.0_wp*u - 2.0_wp)/size_b]
      y = w(1)*a%y + w(2)*b%y + w(3)*a%t_y + w(4)*b%t_y
      p = w(1)*a%p + w(2)*b%p + w(3)*a%t_p + w(4)*b%t_p
      dy = dw(1)*a%y + dw(2)*b%y + dw(3)*a%t_y + dw(4)*b%t_y
      dp = dw(1)*a%p + dw(2)*b%p + dw(3)*a%t_p + dw(4)*b%t_p
   end subroutine measured_cubic

   !> Length of the arc between two points, from its chord and the angle of its tangents.
   pure real(wp) function arc(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp) :: cosine

      cosine = metric%inner(a%t_y, a%t_p, b%t_y, b%t_p)/ &
               (metric%length(a%t_y, a%t_p)*metric%length(b%t_y, b%t_p))
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
      real(wp) :: h, off

      guess%x = here%x + ds*here%t
      guess%y = here%y + ds*here%t_y
      guess%p = here%p + ds*here%t_p
      if (.not. history%known) return
      h = arc(metric, history%before, here)
      if (ds > 2.0_wp*h) return
      call cubic(metric, history%before, here, h, h + ds, guess)
      ! Into the plane of the corrector.
      off = ds - metric%inner(here%t_y, here%t_p, guess%y - here%y, guess%p - here%p)
      guess%x = guess%x + off*here%t
      guess%y = guess%y + off*here%t_y
      guess%p = guess%p + off*here%t_p
   end subroutine extrapolate

   !> Guess between two points, at a share of the way.
   pure subroutine interpolate(metric, a, b, share, guess)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: share
      type(branch_point), intent(inout) :: guess
      real(wp) :: h

      h = arc(metric, a, b)
      call cubic(metric, a, b, h, share*h, guess)
      guess%t_y = (1.0_wp - share)*a%t_y + share*b%t_y
      guess%t_p = (1.0_wp - share)*a%t_p + share*b%t_p
   end subroutine interpolate

   !> Whether p turns twice between two points whose tangents agree: the cubic knows.
   pure logical function turns_between(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp) :: h, first, last, middle, c(3), u

      h = arc(metric, a, b)
      first = h*a%t_p/metric%length(a%t_y, a%t_p)
      last = h*b%t_p/metric%length(b%t_y, b%t_p)
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

   !> What the cubic of the step from `here` to `next` misses, of the size of y: of a smooth curve,
   !> and of one that has corners on the way. 0 where nothing is known yet.
   pure subroutine missed(metric, history, here, next, smooth, corner, place)
      type(metric_type), intent(in) :: metric
      type(step_history), intent(in) :: history
      type(branch_point), intent(in) :: here, next
      real(wp), intent(out) :: smooth, corner
      !> Where such a corner would be, as a share of the step.
      real(wp), intent(out) :: place
      real(wp), allocatable :: y(:), dy(:)
      !> A smooth curve and a single corner have their place above; what has come away with hardly a
      !> turn has turned twice.
      real(wp), parameter :: of_two = 0.35_wp
      real(wp) :: p, dp, h, h_before, d, bend, weight, size

      smooth = 0.0_wp
      corner = 0.0_wp
      place = 0.5_wp
      if (.not. history%known) return
      allocate (y, dy, mold=here%y)
      h_before = arc(metric, history%before, here)
      h = arc(metric, here, next)
      call measured_cubic(metric, history%before, here, h_before, h_before + h, y, p, dy, dp)
      weight = steepness(metric, here, next, h)
      d = across(metric, next, weight, next%y - y, next%p - p)
      bend = across(metric, next, weight, next%t_y/metric%length(next%t_y, next%t_p) - dy, &
                    next%t_p/metric%length(next%t_y, next%t_p) - dp)
      size = size_of(metric, here, next)
      smooth = d*h**2/(16.0_wp*(h_before + h)**2)/size
      corner = 0.125_wp*h*bend/size
      if (h*bend > 0.0_wp) place = 1.0_wp - min(d/(h*bend), 1.0_wp)
      if (place < of_two) corner = max(corner, d/size)
   end subroutine missed

   !> A change of y across the step from `here` to `next`, with none of p, of the size of y.
   pure real(wp) function misses_of(metric, here, next, between, change) result(error)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: here, next
      !> Where on the step, with its tangent.
      type(branch_point), intent(in) :: between
      real(wp), intent(in) :: change(:)

      error = across(metric, between, steepness(metric, here, next, arc(metric, here, next)), &
                     change, 0.0_wp)/size_of(metric, here, next)
   end function misses_of

   !> What errors over the scale of y are measured by.
   pure real(wp) function size_of(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b

      integer :: n

      n = size(a%y)
      if (metric%n_seen > 0) n = metric%n_seen
      size_of = max(min(norm2(a%y(:n)), norm2(b%y(:n)))/metric%y_scale, least)
   end function size_of

   !> What an error of p over its scale means for y over its own, on a step.
   pure real(wp) function steepness(metric, a, b, h)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b
      real(wp), intent(in) :: h
      real(wp) :: part_p

      part_p = max(abs(a%t_p)/metric%length(a%t_y, a%t_p), abs(b%t_p)/metric%length(b%t_y, b%t_p), &
                   abs(b%p - a%p)/h)/metric%p_scale
      steepness = min(steepest, 1.0_wp/max(part_p, tiny(1.0_wp)))
   end function steepness

   !> The part of a difference across the tangent of a point.
   pure real(wp) function across(metric, point, weight, y, p)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: point
      real(wp), intent(in) :: weight, y(:), p
      real(wp) :: along

      along = metric%inner(point%t_y, point%t_p, y, p)/ &
              metric%inner(point%t_y, point%t_p, point%t_y, point%t_p)
      across = hypot(metric%size(y - along*point%t_y), &
                     weight*(p - along*point%t_p)/metric%p_scale)
   end function across

end module fw_branch_step
