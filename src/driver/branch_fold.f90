!> A fold of a branch as a bifurcation of the result.
module fw_branch_fold
   use fw_bifurcation, only: bifurcation_type, kind_fold, kind_undecided, way_bracket, way_turn
   use fw_branch_point, only: branch_point
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_stability_crossing, only: critical_multiplier, crossing_plus
   implicit none (type, external)
   private

   public :: described_fold

contains

   !> A place that would not settle may be one of round-off: it is left open.
   pure function described_fold(found, point) result(fold)
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point
      type(bifurcation_type) :: fold

      fold%kind = kind_fold
      fold%found_by = way_turn
      if (found%unsettled > 0.0_wp) then
         fold%kind = kind_undecided
         fold%found_by = way_bracket
         fold%error = found%unsettled
      end if
      fold%place = point%place
      fold%amplitude = point%amplitude
      fold%coefficients = point%coefficients
      if (allocated(point%multipliers)) then
         fold%multiplier = critical_multiplier(point%multipliers, crossing_plus)
      end if
   end function described_fold

end module fw_branch_fold
