!> What a motion comes to: it is followed for some periods as it is. The search for a periodic state
!> is accelerated, may come to one that no motion stays at, and runs away with a body that leaves.
module fw_motion
   use fw_kinds, only: wp
   use fw_periodic_state, only: find_periodic_state, period_map, periodic_report
   implicit none (type, external)
   private

   public :: motion_failed, motion_grows, motion_irregular, motion_leaves, motion_repeats, &
             motion_settles, motion_type, motion_unknown, follow_motion

   !> It cannot be integrated; repeats after some periods; is on its way to that; moves away for
   !> good; grows; or does none of these.
   integer, parameter :: motion_unknown = 0, motion_failed = 1, motion_repeats = 2, &
                         motion_settles = 3, motion_leaves = 4, motion_grows = 5, &
                         motion_irregular = 6

   !> What an integration in time from a failed point comes to.
   type :: motion_type
      integer :: kind = motion_unknown
      !> Periods of the load after which it repeats.
      integer :: repeats_after = 0
      !> Change over a period in the end, relative to the range within it.
      real(wp) :: change = 0.0_wp
      !> Periods that were looked at.
      integer :: n_periods = 0
   end type motion_type

   !> Periods that are looked at, the longest repetition, the last periods, and how many before each
   !> of these it is compared with: what is longer ago may be a transient.
   integer, parameter :: n_looked_at = 72, longest = 12, n_last = 12, n_compared = 24
   !> States closer than this share of their range are the same.
   real(wp), parameter :: same = 1.0e-3_wp
   !> What repeats after several periods of the load changes from one to the next by this share of
   !> its range at least, ten times more than after those, and does not become less: a slow
   !> transient meets itself too.
   real(wp), parameter :: differs = 0.02_wp, clearly = 0.1_wp, lasts = 0.9_wp
   !> Changes over a period that fall to this share from the first quarter to the last settle, and
   !> those that rise by its inverse grow with the range.
   real(wp), parameter :: share = 0.5_wp
   !> What has moved by so much of its path goes one way, and by so many ranges of a period leaves:
   !> an amplitude that grows is within them.
   real(wp), parameter :: one_way = 0.9_wp, far = 3.0_wp
   !> The search for a periodic state goes wherever its differences point: what is so many times
   !> larger than what it began with is none.
   real(wp), parameter :: beyond = 1.0e6_wp
   !> Share of the way from a periodic state to the motion before it by which the state is moved:
   !> from one that lasts it gets no further away.
   real(wp), parameter :: moved = 0.02_wp, nearly = 1.1_wp

contains

   !> Follow a motion; where that is not at its end, look for a periodic state and whether it lasts.
   subroutine follow_motion(map, n_periods, tolerance, state, report, motion)
      class(period_map), intent(inout) :: map
      !> As of `find_periodic_state`.
      integer, intent(in) :: n_periods
      real(wp), intent(in) :: tolerance
      real(wp), intent(inout), contiguous :: state(:)
      !> Converged where the motion repeats with the load.
      type(periodic_report), intent(out) :: report
      type(motion_type), intent(out) :: motion
      type(motion_type) :: further
      real(wp) :: trial(size(state)), beside(size(state)), size_of, range, distance
      integer :: n_before
      logical :: found

      size_of = norm2(map%weight*state)
      call look_at_motion(map, state, motion)
      n_before = motion%n_periods
      if (motion%kind == motion_settles .or. motion%kind == motion_irregular) then
         size_of = max(size_of, norm2(map%weight*state))
         trial = state
         call find_periodic_state(map, n_periods, tolerance, trial, report)
         found = report%converged .and. norm2(map%weight*trial) <= beyond*size_of
         if (found) then
            n_before = n_before + report%n_periods
            beside = trial + moved*(state - trial)
            distance = norm2(map%weight*(beside - trial))
            call look_at_motion(map, beside, further)
            if (norm2(map%weight*(beside - trial)) <= nearly*distance) then
               motion = motion_type(motion_repeats, 1, report%change, report%n_periods)
               ! The record is of the last period that was integrated.
               call map%integrate(trial, state, range, found)
               if (.not. found) motion%kind = motion_failed
            else
               motion = further
            end if
         end if
      end if
      report%converged = motion%kind == motion_repeats .and. motion%repeats_after == 1
      report%n_periods = n_before
      report%change = motion%change
   end subroutine follow_motion

   !> Follow a motion from a state on, and say what it does.
   subroutine look_at_motion(map, state, motion)
      class(period_map), intent(inout) :: map
      !> At the start of a period, and at that of the last one on return (n_state).
      real(wp), intent(inout), contiguous :: state(:)
      type(motion_type), intent(out) :: motion
      real(wp) :: section(size(state), 0:n_looked_at), next(size(state)), range(n_looked_at)
      real(wp) :: change(n_looked_at)
      logical :: done
      integer :: k

      section(:, 0) = map%weight*state
      do k = 1, n_looked_at
         call map%integrate(state, next, range(k), done)
         if (.not. done .or. .not. all(abs(next) < huge(1.0_wp))) then
            motion%kind = motion_failed
            return
         end if
         state = next
         section(:, k) = map%weight*state
         change(k) = norm2(section(:, k) - section(:, k - 1))
         motion%n_periods = k
      end do
      call judge(section, range, change, motion)
   end subroutine look_at_motion

   !> By the states at the ends of periods.
   pure subroutine judge(section, range, change, motion)
      !> Weighted (n_state, 0:n).
      real(wp), intent(in) :: section(:, 0:)
      !> Range of the state within each period, and change over it (n).
      real(wp), intent(in) :: range(:), change(:)
      type(motion_type), intent(inout) :: motion
      real(wp) :: size_of, path, first, last, once
      integer :: m, n, quarter

      n = size(change)
      quarter = n/4
      size_of = max(maxval(range(n - quarter + 1:)), tiny(1.0_wp))
      motion%change = change(n)/size_of
      first = sum(change(:quarter))
      last = sum(change(n - quarter + 1:))
      once = repeated(section, 1)
      do m = 1, longest
         if (repeated(section, m) > same*size_of) cycle
         if (m > 1 .and. .not. (once > differs*size_of .and. &
                                repeated(section, m) < clearly*once .and. &
                                last > lasts*sum(change(quarter + 1:2*quarter)))) cycle
         motion%kind = motion_repeats
         motion%repeats_after = m
         return
      end do
      path = sum(change)
      motion%kind = motion_irregular
      if (last < share*first) then
         motion%kind = motion_settles
      else if (norm2(section(:, n) - section(:, 0)) > max(one_way*path, far*size_of)) then
         motion%kind = motion_leaves
      else if (share*last > first .and. share*sum(range(n - quarter + 1:)) > &
               sum(range(:quarter))) then
         motion%kind = motion_grows
      end if
   end subroutine judge

   !> The most that the last states differ from those m, 2 m, .. periods before: what creeps differs
   !> little from one to the next.
   pure real(wp) function repeated(section, m)
      real(wp), intent(in) :: section(:, 0:)
      integer, intent(in) :: m
      integer :: before, k, n

      n = ubound(section, 2)
      repeated = 0.0_wp
      do k = n - n_last + 1, n
         do before = m, n_compared, m
            repeated = max(repeated, norm2(section(:, k) - section(:, k - before)))
         end do
      end do
   end function repeated

end module fw_motion
