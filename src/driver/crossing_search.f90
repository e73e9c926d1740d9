!> Where between two solutions of a branch, or of a sweep, a multiplier passes the unit circle.
!>
!> The place is bracketed by the counts of multipliers outside of the circle and narrowed by regula
!> falsi (Illinois) on the distance of the one that passes, with bisections in between. Where the
!> bracket shrinks to nothing and the distance does not, the multiplier has jumped.
module fw_crossing_search
   use fw_bifurcation, only: bifurcation_list, bifurcation_type, kind_branch, kind_doubling, &
      kind_fold, kind_nonsmooth, kind_symmetry, kind_torus, kind_undecided, way_bracket, &
      way_multiplier
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_stability_crossing, only: critical_multiplier, crossing_between, crossing_minus, &
      crossing_none, crossing_pair, crossing_plus, crossing_several, may_hide, movement_between, &
      signature_of, test_value
   implicit none (type, external)
   private

   public :: probe_type, search_crossings

   !> Gives solutions between two.
   type, abstract :: probe_type
      !> Solutions given, and their iterations.
      integer :: n_solved = 0, iterations = 0
      !> Distances from the first to where the branch turns between the two: a multiplier passes 1
      !> there.
      real(wp), allocatable :: folds(:)
      !> Distance from the first to the solution given last.
      real(wp) :: reached = 0.0_wp
   contains
      procedure(solution_at), deferred :: at
   end type probe_type

   abstract interface
      !> The solution at a share of the way from the first to the second; not converged where there
      !> is none.
      subroutine solution_at(self, share, point, error)
         import :: probe_type, point_type, error_type, wp
         implicit none (type, external)
         class(probe_type), intent(inout) :: self
         real(wp), intent(in) :: share
         type(point_type), intent(out) :: point
         type(error_type), allocatable, intent(out) :: error
      end subroutine solution_at
   end interface

   !> One end of a bracket.
   type :: end_type
      real(wp) :: share = 0.0_wp
      type(point_type) :: point
      !> Distance from the first.
      real(wp) :: reached = 0.0_wp
   end type end_type

   !> Solutions for one place, of which so many before there is nothing but bisection: roots take
   !> fewer, a jump takes the others. Halvings of an interval that holds more than one place.
   integer, parameter :: most_trials = 40, most_secants = 12, most_halvings = 6
   !> Halvings of an interval that may hide two places.
   integer, parameter :: most_looks = 3
   !> A multiplier this near to the circle is on it.
   real(wp), parameter :: on_circle = 1.0e-8_wp
   !> Share of the way below which a bracket is a place.
   real(wp), parameter :: narrow = 1.0e-7_wp
   !> Distance that a multiplier keeps from the circle where it jumps over it; next to a fold it
   !> comes as near as the root of the share, 3e-4.
   real(wp), parameter :: jump = 1.0e-2_wp
   !> Parts of the response: even harmonics of a symmetric one, and what it changes by where it does
   !> not jump.
   real(wp), parameter :: no_part = 1.0e-6_wp, same = 1.0e-3_wp
   !> Distance from 1 up to which a multiplier belongs to a fold that a response jumps from.
   real(wp), parameter :: near_fold = 0.1_wp

contains

   !> Add all changes of stability between two solutions to a list.
   subroutine search_crossings(probe, first, second, movement, after, on_branch, list, error)
      class(probe_type), intent(inout) :: probe
      type(point_type), intent(in) :: first, second
      !> Of the multipliers towards the first, see movement_between.
      real(wp), intent(in) :: movement(2)
      !> Number of the first among the solutions with multipliers.
      integer, intent(in) :: after
      !> Whether they lie on one branch, of which folds are known.
      logical, intent(in) :: on_branch
      type(bifurcation_list), intent(inout) :: list
      type(error_type), allocatable, intent(out) :: error

      call split(probe, end_type(0.0_wp, first), end_type(1.0_wp, second, huge(1.0_wp)), movement, &
                 0, after, on_branch, list, error)
   end subroutine search_crossings

   !> One place at a time: a bracket is halved while it holds more than one, or may hide two. What
   !> most_halvings have not parted is added as one place that is left open.
   recursive subroutine split(probe, low, high, movement, halvings, after, on_branch, list, error)
      class(probe_type), intent(inout) :: probe
      type(end_type), intent(in) :: low, high
      real(wp), intent(in) :: movement(2)
      !> Of the first interval, so far.
      integer, intent(in) :: halvings, after
      logical, intent(in) :: on_branch
      type(bifurcation_list), intent(inout) :: list
      type(error_type), allocatable, intent(out) :: error
      type(end_type) :: middle
      integer :: crossing, n_folds
      logical :: is_none, holds_more

      n_folds = folds_between(probe, low, high)
      associate (a => low%point%multipliers, b => high%point%multipliers)
         crossing = crossing_between(signature_of(a), signature_of(b))
         ! A fold passes one multiplier: one that none has passed hides another that came back.
         is_none = crossing == merge(crossing_plus, crossing_none, n_folds == 1)
         holds_more = crossing == crossing_several .or. n_folds > 1 .or. n_folds == 1 .and. &
                      .not. is_none
         if (holds_more .and. halvings < most_halvings .or. is_none .and. &
             halvings < most_looks .and. may_hide(a, b, movement, n_folds > 0)) then
            middle%share = 0.5_wp*(low%share + high%share)
            call probe%at(middle%share, middle%point, error)
            middle%reached = probe%reached
            if (allocated(error)) return
         end if
         if (is_known(middle%point)) then
            call split(probe, low, middle, movement_between(a, middle%point%multipliers), &
                       halvings + 1, after, on_branch, list, error)
            if (allocated(error)) return
            call split(probe, middle, high, movement_between(a, middle%point%multipliers), &
                       halvings + 1, after, on_branch, list, error)
            return
         end if
      end associate
      ! Folds that were not parted are known as such; what passes with them cannot be told.
      if (is_none .or. n_folds > 1) return
      if (holds_more) crossing = crossing_several
      call locate(probe, low, high, crossing, after, on_branch, list, error)
   end subroutine split

   !> How often the branch turns within a bracket. Distances from the first grow along a step, so
   !> they put folds and solutions in order, which frequencies beside a fold do not.
   pure integer function folds_between(probe, low, high) result(n)
      class(probe_type), intent(in) :: probe
      type(end_type), intent(in) :: low, high

      n = 0
      if (.not. allocated(probe%folds)) return
      n = count(probe%folds > low%reached .and. probe%folds <= high%reached)
   end function folds_between

   !> Narrow a bracket down to the place.
   subroutine locate(probe, first, second, crossing, after, on_branch, list, error)
      class(probe_type), intent(inout) :: probe
      type(end_type), intent(in) :: first, second
      integer, intent(in) :: crossing, after
      logical, intent(in) :: on_branch
      type(bifurcation_list), intent(inout) :: list
      type(error_type), allocatable, intent(out) :: error
      type(end_type) :: low, high, middle
      real(wp) :: at_low, at_high, value, slope
      integer :: before(3), k, side

      low = first
      high = second
      if (crossing == crossing_several) then
         call list%add(described(low, high, crossing, 0.0_wp, after, on_branch))
         return
      end if
      before = signature_of(low%point%multipliers)
      at_low = test_value(low%point%multipliers, crossing, before)
      at_high = test_value(high%point%multipliers, crossing, before)
      slope = 0.0_wp
      side = 0
      do k = 1, most_trials
         if (high%share - low%share <= narrow) exit
         middle%share = low%share + (high%share - low%share)* &
                        next_share(at_low, at_high, &
                                   bisect=modulo(k, 4) == 0 .or. k > most_secants)
         call probe%at(middle%share, middle%point, error)
         if (allocated(error)) return
         if (.not. is_known(middle%point)) exit
         value = test_value(middle%point%multipliers, crossing, before)
         if (abs(high%point%place - low%point%place) > 0.0_wp .and. high%share - low%share > &
             1.0e3_wp*narrow) then
            slope = abs((test_value(high%point%multipliers, crossing, before) - &
                         test_value(low%point%multipliers, crossing, before))/ &
                        (high%point%place - low%point%place))
         end if
         if (value > 0.0_wp) then
            high = middle
            at_high = value
            if (side > 0) at_low = 0.5_wp*at_low
            side = 1
         else
            low = middle
            at_low = value
            if (side < 0) at_high = 0.5_wp*at_high
            side = -1
         end if
         if (abs(value) <= on_circle) exit
      end do
      call list%add(described(low, high, crossing, slope, after, on_branch))
   end subroutine locate

   !> Share of a bracket to try next, not too near to its ends.
   pure real(wp) function next_share(at_low, at_high, bisect) result(share)
      real(wp), intent(in) :: at_low, at_high
      logical, intent(in) :: bisect

      share = 0.5_wp
      if (bisect .or. .not. at_high - at_low > 0.0_wp) return
      share = min(max(-at_low/(at_high - at_low), 1.0e-3_wp), 1.0_wp - 1.0e-3_wp)
   end function next_share

   !> What a bracket holds.
   function described(low, high, crossing, slope, after, on_branch) result(found)
      type(end_type), intent(in) :: low, high
      integer, intent(in) :: crossing
      !> Of the distance from the circle, by the frequency; 0 where it is not known.
      real(wp), intent(in) :: slope
      integer, intent(in) :: after
      logical, intent(in) :: on_branch
      type(bifurcation_type) :: found
      real(wp) :: distance(2), error
      integer :: passed

      passed = crossing
      if (crossing == crossing_several) passed = crossing_plus
      distance = [distance_of(low%point, passed), distance_of(high%point, passed)]
      associate (nearest => merge(1, 2, distance(1) <= distance(2)))
         if (nearest == 1) then
            call take(low%point)
         else
            call take(high%point)
         end if
      end associate
      found%after = after
      found%found_by = way_multiplier
      if (minval(distance) > on_circle .and. high%share - low%share > narrow) then
         found%found_by = way_bracket
         found%error = abs(high%point%place - low%point%place)
      end if
      found%kind = kind_of(low%point, high%point, crossing, distance, found%found_by, on_branch)

   contains

      subroutine take(point)
         type(point_type), intent(in) :: point

         found%place = point%place
         found%amplitude = point%amplitude
         found%coefficients = point%coefficients
         found%multiplier = critical_multiplier(point%multipliers, passed)
         error = maxval(point%multiplier_error, &
                        mask=abs(point%multipliers - found%multiplier) <= 0.0_wp)
         if (slope > 0.0_wp .and. error < huge(1.0_wp)) found%error = error/slope
      end subroutine take

   end function described

   !> How far a point is from the crossing: what an interpolation brings to zero.
   pure real(wp) function distance_of(point, crossing)
      type(point_type), intent(in) :: point
      integer, intent(in) :: crossing

      distance_of = abs(test_value(point%multipliers, crossing, [-1, -1, -1]))
   end function distance_of

   !> The name of a change of stability.
   pure integer function kind_of(low, high, crossing, distance, way, on_branch) result(kind)
      type(point_type), intent(in) :: low, high
      integer, intent(in) :: crossing
      !> Of the multiplier from the circle, at both ends.
      real(wp), intent(in) :: distance(2)
      integer, intent(in) :: way
      logical, intent(in) :: on_branch
      logical :: jumps

      jumps = .not. on_branch .and. any(abs(high%amplitude - low%amplitude) > &
                                        same*maxval(abs(low%amplitude)))
      kind = kind_undecided
      if (crossing == crossing_several .or. way == way_bracket .and. .not. jumps) return
      if (jumps) then
         ! The response went over to another branch; what it left by is a fold where a multiplier
         ! had come to 1.
         kind = kind_nonsmooth
         if (crossing == crossing_plus .and. minval(distance) <= near_fold) kind = kind_fold
      else if (minval(distance) > jump) then
         kind = kind_nonsmooth
      else if (crossing == crossing_minus) then
         kind = kind_doubling
      else if (crossing == crossing_pair) then
         kind = kind_torus
      else
         kind = kind_branch
         if (is_symmetric(low) .and. is_symmetric(high)) kind = kind_symmetry
      end if
   end function kind_of

   !> Whether the second half of the period mirrors the first: no observed quantity has even
   !> harmonics.
   pure logical function is_symmetric(point)
      type(point_type), intent(in) :: point
      real(wp) :: even, all_of_it
      integer :: n

      even = sum(point%coefficients(1, :)**2)
      all_of_it = sum(point%coefficients**2)
      do n = 2, size(point%coefficients, 1)/2, 2
         even = even + sum(point%coefficients(2*n:2*n + 1, :)**2)
      end do
      is_symmetric = even <= no_part**2*all_of_it
   end function is_symmetric

   !> Whether a point tells anything of its stability.
   pure logical function is_known(point)
      type(point_type), intent(in) :: point

      is_known = point%converged .and. allocated(point%multipliers)
   end function is_known

end module fw_crossing_search
