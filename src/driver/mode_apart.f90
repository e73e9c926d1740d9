!> The first solution of a mode whose pairs touch without being pressed: they part and close at
!> every amplitude, however small, and the linear motion that a curve begins with is none of its.
!>
!> With the pairs a little apart there is one, below their gap; it is followed to the lowest
!> amplitude, at which the gaps are then closed.
module fw_mode_apart
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_nonlinear_mode, only: mode_path
   use fw_newton, only: solver_report
   implicit none (type, external)
   private

   public :: begin_apart

   !> Gaps to begin with, over the largest motion at the lowest amplitude: small beside it, so that
   !> closing them changes little, or larger where that finds nothing.
   real(wp), parameter :: gaps(3) = [1.0e-3_wp, 1.0e-2_wp, 1.0e-1_wp]
   !> The amplitude at which none of them closes yet, over that of the gap.
   real(wp), parameter :: open = 0.5_wp

contains

   !> report%converged says whether y is a solution at the amplitude `lowest`.
   subroutine begin_apart(path, linear, lowest, y, report, error)
      type(mode_path), intent(inout) :: path
      !> Unknowns of the linear motion.
      real(wp), intent(in) :: linear(:), lowest
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: depth(:)
      real(wp) :: largest, reached
      integer :: k

      associate (balance => path%mode%system%balance)
         if (size(balance%depth) == 0) return
         depth = balance%depth
         largest = path%mode%system%motion_unit*lowest*maxval(abs(path%mode%system%motion(linear)))
         do k = 1, size(gaps)
            balance%depth = depth + gaps(k)*largest
            y = linear
            call path%solve(log(open*gaps(k)*lowest), y, report, error)
            if (allocated(error)) exit
            if (report%converged) then
               call path%walk%restart(log(open*gaps(k)*lowest), y)
               call path%reach(log(lowest), y, report, reached, error)
               if (allocated(error)) exit
            end if
            balance%depth = depth
            if (report%converged) call path%solve(log(lowest), y, report, error)
            if (allocated(error) .or. report%converged) exit
         end do
         balance%depth = depth
      end associate
   end subroutine begin_apart

end module fw_mode_apart
