!> What arc-length continuation does where no step along the tangent succeeds, however short.
!>
!> Contact makes R piecewise smooth, and at a corner the branch may turn by more than a right
!> angle: then no point lies ahead on the tangent, and Newton's method cycles between the two
!> pieces. The tangent of the piece beyond the corner is taken. Its direction follows from what is
!> constant along a branch of a piecewise smooth system, the sign of det(dR/dx) dp/ds (Allgower,
!> Georg 1990, Numerical continuation methods, on piecewise linear ones).
module fw_branch_turn
   use fw_branch_point, only: branch_point, reverse
   use fw_corrector, only: corrector_type, differ
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: leap, turn_at_corner, all_around, far_ahead, only_ahead

   !> A step in p alone: from the longest, a part of the interval, divided by two to this power.
   real(wp), parameter :: longest_leap = 0.02_wp
   integer, parameter :: max_halvings = 7
   !> Leaps of all lengths on either side, or of the longest ahead; or of all lengths ahead,
   !> whatever the orientation there.
   integer, parameter :: all_around = 1, far_ahead = 2, only_ahead = 3
   !> How far it may take y, over the size of y.
   real(wp), parameter :: furthest = 0.3_wp

contains

   !> Step along the tangent of the piece just beyond `here`, in the direction that keeps the
   !> orientation of the branch.
   subroutine turn_at_corner(corrector, system, here, ds, next, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: here
      real(wp), intent(in) :: ds
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: beyond
      logical :: done

      next%report = solver_report()
      call corrector%find_orientation(system, here, error)
      if (allocated(error)) return
      beyond = here
      beyond%x = here%x + ds*here%t
      beyond%y = here%y + ds*here%t_y
      beyond%p = here%p + ds*here%t_p
      call system%set_parameter(beyond%p, error)
      if (allocated(error)) return
      call corrector%find_tangent(system, here, beyond, done)
      if (.not. done) return
      call corrector%find_orientation(system, beyond, error)
      if (allocated(error)) return
      ! Of a tangent with no orientation, the corrector has tried the direction of `here`.
      if (corrector%stands(beyond) .or. differ(beyond, here)) call reverse(beyond)
      ! From the piece beyond: a plane across its tangent may meet the piece of `here` as well.
      next%x = beyond%x + ds*beyond%t
      next%y = beyond%y + ds*beyond%t_y
      next%p = beyond%p + ds*beyond%t_p
      call corrector%correct(system, beyond, ds, next, error)
      if (allocated(error) .or. .not. next%report%converged) return
      ! A point with the other orientation lies on the way back.
      call corrector%find_orientation(system, next, error)
      next%report%converged = .not. differ(next, here)
   end subroutine turn_at_corner

   !> A step in p alone, beyond a place where many pieces meet or where the derivative has no bound
   !> (a pair whose slip of a period vanishes): Newton's method with its line search from `here`,
   !> first close by, then further away; ahead, then on the other side, where the branch may turn.
   subroutine leap(corrector, system, here, reach, next, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: here
      !> all_around, far_ahead or only_ahead.
      integer, intent(in) :: reach
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: dp
      integer :: k, side, first

      first = merge(-2, -max_halvings, reach == far_ahead)
      do side = 1, merge(-1, 1, corrector%oriented .and. reach == all_around), -2
         do k = first, 0
            dp = side*sign(2.0_wp**k*longest_leap*corrector%metric%p_scale, here%t_p)
            call leap_to(corrector, system, here, dp, reach /= only_ahead, 0.0_wp, next, error)
            if (next%report%converged .and. reach == far_ahead) then
               call draw_near(corrector, system, here, next, error)
            end if
            if (allocated(error) .or. next%report%converged) return
            if (reach /= only_ahead .or. corrector%stands(here)) cycle
            ! From where the piece behind leads to.
            call leap_to(corrector, system, here, dp, .false., dp/here%t_p, next, error)
            if (allocated(error) .or. next%report%converged) return
         end do
      end do
   end subroutine leap

   !> Bring the point that a leap has come to back towards where it left, along the piece that it is
   !> on: nothing is known of the branch between the two.
   subroutine draw_near(corrector, system, here, next, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: here
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      !> Halvings of the way; cosine of the angle of tangents, and distance from the tangent over
      !> the step back, up to which two points lie on one piece.
      integer, parameter :: most = 3
      real(wp), parameter :: along = 0.9_wp, beside = 0.25_wp
      type(branch_point) :: nearer, predicted
      real(wp) :: dp
      integer :: k

      do k = 1, most
         dp = 0.5_wp*(here%p - next%p)
         if (corrector%stands(next)) return
         call leap_to(corrector, system, next, dp, .false., dp/next%t_p, nearer, error)
         if (allocated(error)) return
         if (.not. nearer%report%converged) return
         ! It looks back where it was found.
         if (nearer%t_p*next%t_p < 0.0_wp) call reverse(nearer)
         call corrector%find_orientation(system, nearer, error)
         if (allocated(error)) return
         if (differ(nearer, next)) return
         predicted = next
         predicted%y = next%y + (dp/next%t_p)*next%t_y
         predicted%p = next%p + dp
         if (corrector%metric%inner(nearer%t_y, nearer%t_p, next%t_y, next%t_p) < along) return
         if (corrector%metric%chord(nearer, predicted) > &
             beside*corrector%metric%chord(next, predicted)) return
         next = nearer
      end do
   end subroutine draw_near

   !> The point at p + dp, if the branch goes on there in the direction of dp.
   subroutine leap_to(corrector, system, here, dp, keeps_side, along, next, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: here
      real(wp), intent(in) :: dp
      !> Whether the orientation has to stay.
      logical, intent(in) :: keeps_side
      !> How far along the tangent it starts.
      real(wp), intent(in) :: along
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      logical :: done

      newton%options = corrector%options
      next = here
      next%x = here%x + along*here%t
      next%p = here%p + dp
      call system%set_parameter(next%p, error)
      if (allocated(error)) return
      call newton%solve(system, next%x, next%report)
      call corrector%linear%add_work(newton%linear)
      if (.not. next%report%converged) return
      call corrector%see(next%x, next%y)
      call corrector%find_tangent(system, here, next, done)
      next%report%converged = done .and. &
         corrector%metric%length(next%y - here%y, 0.0_wp) <= furthest
      if (.not. next%report%converged) return
      ! Beyond a sharp turn the angle with the last tangent says nothing.
      if (next%t_p*dp < 0.0_wp) call reverse(next)
      if (.not. keeps_side) return
      call corrector%find_orientation(system, here, error)
      if (allocated(error)) return
      call corrector%find_orientation(system, next, error)
      next%report%converged = .not. differ(next, here)
   end subroutine leap_to

end module fw_branch_turn
