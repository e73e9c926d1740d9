!> What multipliers say of the stability of a solution, given how far off they may be.
!>
!> A verdict stands only where no error of the size that is estimated could turn it: a multiplier
!> whose modulus is as near to 1 as its error leaves it undecided.
module fw_stability_verdict
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: verdict_of, multiplier_errors
   public :: verdict_stable, verdict_unstable, verdict_undecided

   !> As they stand in results; not known reads as undecided there.
   integer, parameter :: verdict_stable = 1, verdict_unstable = 0, verdict_undecided = -1

   !> A modulus above 1 by less than this is round-off: undamped structures lie on the circle.
   real(wp), parameter :: round_off = 1.0e-8_wp
   !> The difference of two approximations stands for the error of the worse one where the better
   !> one halves it at least. Friction that switches between the steps of a march leaves errors that
   !> are less regular: the difference is short of them by a factor up to 3.6 (300 points, H = 3).
   real(wp), parameter :: safety = 2.0_wp, safety_of_march = 8.0_wp
   !> Round-off of the eigenvalues, of the largest of them.
   real(wp), parameter :: least = 1.0e-13_wp

contains

   !> Unstable where a perturbation grows beyond doubt, stable where none can.
   pure integer function verdict_of(multipliers, errors) result(verdict)
      complex(wp), intent(in) :: multipliers(:)
      !> Of each multiplier, huge(1.0_wp) where nothing is known (n).
      real(wp), intent(in) :: errors(:)

      if (any(abs(multipliers) - errors > 1.0_wp + round_off)) then
         verdict = verdict_unstable
      else if (all(abs(multipliers) + errors <= 1.0_wp + round_off)) then
         verdict = verdict_stable
      else
         verdict = verdict_undecided
      end if
   end function verdict_of

   !> How far off multipliers may be by a second, better approximation of them in any order: each
   !> with the nearest that is left, nearest pairs first (n).
   pure function multiplier_errors(multipliers, better, marched) result(errors)
      complex(wp), intent(in) :: multipliers(:)
      !> As many (n).
      complex(wp), intent(in) :: better(:)
      !> Whether either comes from a march through a period.
      logical, intent(in) :: marched
      real(wp) :: errors(size(multipliers))
      real(wp) :: distance(size(multipliers))
      integer :: nearest(size(multipliers))
      logical :: left(size(multipliers)), free(size(multipliers))
      integer :: i, j, k, n

      n = size(multipliers)
      left = .true.
      free = .true.
      do i = 1, n
         call find_nearest(multipliers(i), better, free, nearest(i), distance(i))
      end do
      do k = 1, n
         i = minloc(distance, dim=1, mask=left)
         errors(i) = merge(safety_of_march, safety, marched)*distance(i) + &
                     least*max(1.0_wp, maxval(abs(multipliers)))
         left(i) = .false.
         free(nearest(i)) = .false.
         ! Those that wanted what is taken now look again.
         do j = 1, n
            if (.not. left(j) .or. nearest(j) /= nearest(i)) cycle
            call find_nearest(multipliers(j), better, free, nearest(j), distance(j))
         end do
      end do
   end function multiplier_errors

   !> The nearest multiplier that has no partner yet, and how far it is.
   pure subroutine find_nearest(value, others, free, place, distance)
      complex(wp), intent(in) :: value, others(:)
      logical, intent(in) :: free(:)
      integer, intent(out) :: place
      real(wp), intent(out) :: distance

      place = minloc(abs(others - value), dim=1, mask=free)
      distance = abs(others(place) - value)
   end subroutine find_nearest

end module fw_stability_verdict
