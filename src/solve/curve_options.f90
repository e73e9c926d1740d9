!> Limits of the steps along a branch, in one place. What halving and doubling each of them changes
!> is in docs/robustness/thresholds.md.
module fw_curve_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: limits

   type :: curve_options
      ! How long the next step is.
      !> Corrector iterations from which on steps get shorter, by this factor.
      integer :: slow = 7
      real(wp) :: slower = 0.6_wp
      !> Growth and shortening of a step.
      real(wp) :: largest_growth = 2.5_wp, least_growth = 0.3_wp
      real(wp) :: halved = 0.5_wp
      !> Steps aim at this part of the error that is allowed.
      real(wp) :: aim = 0.4_wp
      !> Longest step of y over its size.
      real(wp) :: longest_y = 0.5_wp
      !> Step over the distance of a simple pole at which a cubic misses (0.45)^4/16 of it, 0.3 %.
      real(wp) :: beside_pole = 0.45_wp

      ! Whether a step that was taken stands.
      !> What the model of the resonances may say of it, of the error that is allowed.
      real(wp) :: passed = 0.6_wp
      !> What may be found at one place of it, of the error that is allowed.
      real(wp) :: looked_at = 0.7_wp
      !> Angles of a step (rad): between its tangents, between a tangent and its chord, and what
      !> the next step aims at.
      real(wp) :: max_turn = 0.9_wp, max_chord = 0.55_wp, aimed_turn = 0.6_wp
      !> Distance of the corrected point from the predictor, in steps.
      real(wp) :: max_distance = 0.5_wp
      !> Failures of a step from which on it is tried in p alone, where p is this part of it at
      !> least.
      integer :: most_failed = 1
      real(wp) :: least_share = 2.0e-2_wp

      ! Corners.
      !> Share of a step at its ends where no corner is looked for.
      real(wp) :: least_place = 0.25_wp
      !> Places of single corners, from and to, and where several are looked for.
      real(wp) :: around_from = 0.35_wp, around_to = 0.72_wp, amidst = 0.42_wp
      !> Length up to which a step may turn at any angle and the corrector go as far: corners, and
      !> what the instants of sampled contact make of a curve, are not to be told apart there. A
      !> cubic misses at most a quarter of it.
      real(wp) :: corner = 1.0e-2_wp
      !> Length from which on the tangent beyond a corner is tried.
      real(wp) :: turning = 2.5e-3_wp
      !> Length below which the other orientation is that of a bifurcation.
      real(wp) :: bifurcation = 1.0e-5_wp
      !> Cosine of the angle between tangents below which a branch turns sharply.
      real(wp) :: sharp = 0.8_wp

      ! What a length is.
      !> What unknowns count beside the response that they make, where that is what is measured:
      !> they may run away where the vibration stays.
      real(wp) :: weight_x = 0.02_wp
      !> What is left of the size of x from one point to the next where x itself gets smaller.
      real(wp) :: fading = 0.4_wp
   end type curve_options

   type(curve_options), parameter :: limits = curve_options()

end module fw_curve_options
