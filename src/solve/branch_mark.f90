!> Points of a branch that lie between two others: folds, and the bounds of its interval.
!> Both lie on the cubic between the points (fw_branch_step) as well as that goes, which is a guess
!> for a corrector.
module fw_branch_mark
   use fw_branch_point, only: branch_point
   use fw_branch_step, only: interpolate
   use fw_corrector, only: branch_forcing, corrector_type, max_corrections
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: find_fold, land, share_at

   !> A fold is located when p changes by less than this part of itself.
   real(wp), parameter :: fold_tolerance = 1.0e-10_wp
   integer, parameter :: max_fold_steps = 40

contains

   !> Between two points whose tangents differ in the sign of dp/ds lies a fold: regula falsi
   !> (Illinois) on that sign.
   !> An end that stays twice would hold the secant back; the Illinois rule halves its value. t_p is
   !> dp/ds of the unit tangent, which is zero where the branch turns, and changes there linearly.
   subroutine find_fold(corrector, system, here, next, fold, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      !> `fold` is false where it is not found; `unsettled` is not 0 where p did not come to rest.
      type(branch_point), intent(out) :: fold
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: low, high, at_low, at_high, share, p_before, ds
      integer :: k

      low = 0.0_wp
      high = 1.0_wp
      at_low = here%t_p
      at_high = next%t_p
      p_before = huge(1.0_wp)
      ds = corrector%metric%chord(here, next)
      do k = 1, max_fold_steps
         share = (low*at_high - high*at_low)/(at_high - at_low)
         call interpolate(corrector%metric, here, next, share, fold)
         call corrector%correct(system, here, ds, fold, error)
         if (allocated(error)) return
         if (.not. fold%report%converged) return
         ! p is stationary at the fold: it settles with the square of the error along the branch.
         fold%unsettled = abs(fold%p - p_before)
         if (fold%unsettled <= fold_tolerance*abs(fold%p)) exit
         p_before = fold%p
         if (fold%t_p*at_low > 0.0_wp) then
            low = share
            at_low = fold%t_p
            at_high = 0.5_wp*at_high
         else
            high = share
            at_high = fold%t_p
            at_low = 0.5_wp*at_low
         end if
      end do
      fold%fold = .true.
      if (fold%unsettled <= fold_tolerance*abs(fold%p)) fold%unsettled = 0.0_wp
   end subroutine find_fold

   !> The branch leaves the interval between two points: its last point lies exactly on the bound.
   !> Newton's method at constant p = bound, from the cubic.
   subroutine land(corrector, system, here, next, bound, point, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in) :: bound
      type(branch_point), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: r(:), step(:)
      integer :: iterations, k
      logical :: done

      point = next
      point%fold = .false.
      point%report = solver_report()
      ! Not quite at the bound by itself: p of the cubic is bisected, and then held there.
      call interpolate(corrector%metric, here, next, share_at(corrector, here, next, bound), point)
      point%p = bound
      allocate (r(system%n), step(system%n))
      call system%set_parameter(bound, error)
      if (allocated(error)) return
      do
         call stop_run(system%interrupt, error)
         if (allocated(error)) return
         call system%residual(point%x, r)
         associate (report => point%report)
            report%residual = norm2(r)/system%reference
            report%converged = report%residual <= corrector%options%tolerance
            if (report%converged .or. report%iterations == max_corrections) exit
            call corrector%linear%solve(system, r, branch_forcing, step, done)
            if (.not. done) exit
            point%x = point%x + step
            report%iterations = report%iterations + 1
         end associate
      end do
      if (point%report%converged) then
         call corrector%find_tangent(system, next, point, done)
         return
      end if
      ! Between pieces it goes round: with a search along each step, from here and from beyond.
      iterations = point%report%iterations
      do k = 1, 3
         select case (k)
         case (1)
            call interpolate(corrector%metric, here, next, &
                             share_at(corrector, here, next, bound), point)
         case (2)
            point%x = here%x
         case default
            point%x = next%x
         end select
         point%p = bound
         call corrector%correct_across(system, next, point, error)
         if (allocated(error)) return
         iterations = iterations + point%report%iterations
         point%report%iterations = iterations
         if (point%report%converged) return
      end do
      call corrector%see(point%x, point%y)
   end subroutine land

   !> The share of the way at which the cubic between two points has a value of p, by bisection.
   !> Where the cubic takes the value several times, one of them: `next` lies beyond the value, so
   !> that there is one.
   pure real(wp) function share_at(corrector, here, next, p)
      type(corrector_type), intent(in) :: corrector
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in) :: p
      integer, parameter :: n_halvings = 40
      type(branch_point) :: middle
      real(wp) :: low, high
      integer :: k

      low = 0.0_wp
      high = 1.0_wp
      do k = 1, n_halvings
         share_at = 0.5_wp*(low + high)
         call interpolate(corrector%metric, here, next, share_at, middle)
         if ((middle%p - p)*(next%p - p) > 0.0_wp) then
            high = share_at
         else
            low = share_at
         end if
      end do
   end function share_at

end module fw_branch_mark
