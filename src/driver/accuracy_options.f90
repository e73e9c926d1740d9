!> Limits of the estimate of an error and of the search for harmonics, in one place. What halving
!> and doubling each of them changes is in docs/robustness/thresholds.md.
module fw_accuracy_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: limits

   type :: accuracy_options
      ! The estimate by the tail.
      !> Factor of the changes that bounds the error, and the part of |u2 - u| that counts at
      !> least.
      real(wp) :: factor_of_tail = 3.0_wp, least_part = 0.2_wp
      !> |u2 - u| above which nothing is claimed, and from which on u2 is no better than u.
      real(wp) :: linear_up_to = 0.1_wp, better_below = 0.03_wp
      !> Part of |u2 - u| that the next change may be, unless both are round-off.
      real(wp) :: contraction = 0.5_wp, round_off = 1.0e-9_wp
      !> Harmonics up to which rigid pairs that are no oscillators may stick where they should
      !> slip.
      integer :: few_harmonics = 5
      !> Part of the last step that bounds what the next ones come to.
      real(wp) :: part_of_step = 0.5_wp
      !> What |u2 - u| is multiplied by where solutions are compared: as it converges, or does not.
      real(wp) :: factor_seen = 2.0_wp, factor_seen_only = 3.0_wp
      !> Harmonics of the tail: times*H + more, but no more than twice as many as H above the last.
      integer :: tail_times = 4, tail_more = 8, tail_most = 128
      !> Residual asked of an iterative solution: a part of the correction that nobody sees.
      real(wp) :: linear_tolerance = 1.0e-4_wp
      !> Quantities that vibrate less than this part of the largest are measured against that part.
      real(wp) :: least_vibration = 1.0e-3_wp
      !> Power of what is left above the tail, over that of its last octave.
      real(wp) :: falls_to = 0.25_wp
      !> Factor within which the structure above H is what a rigid law takes it for.
      real(wp) :: alike_within = 2.0_wp

      ! The estimate by fewer harmonics, where the tail does not tell.
      !> Order of the error in 1/H: elastic contact and springs; rigid contact on nodes that answer
      !> as if they had no mass, and on others.
      real(wp) :: order_elastic = 1.5_wp, order_massless = 1.25_wp, order_rigid = 0.3_wp
      !> Harmonics up to which no order shows yet; and the fewest that a solution is compared with
      !> where friction acts on mass.
      integer :: few_for_order = 5, fewest_on_mass = 3
      !> Factors that the order must not go below, and those with few harmonics.
      real(wp) :: least_factor = 1.0_wp/3.0_wp, least_factor_of_few = 1.0_wp

      ! Instants.
      !> What half of the instants changes is multiplied by this where they decide: first order,
      !> and fluctuating. Located events leave no error of theirs.
      real(wp) :: factor_instants = 2.0_wp
      !> How much more instants may leave out at one point than at others.
      real(wp) :: safety = 8.0_wp
      !> Doublings of the instants that are tried.
      integer :: most_doublings = 5

      ! What it may cost.
      !> Levels at which a point may fail before it is given up.
      integer :: most_failures = 1
      !> Iterations on finer levels after which no finer one is begun: in any case, and where
      !> errors that fall like H**(-fastest) would not come to the accuracy. (Of 1,000 random
      !> points three took more than 200 to a claim, and those that took more than 260 made none.)
      integer :: most_work = 250, much_work = 100
      real(wp) :: fastest = 6.0_wp
      !> Harmonics or instants are given up where the error is this part of the accuracy.
      real(wp) :: with_margin = 1.0_wp/8.0_wp
   end type accuracy_options

   type(accuracy_options), parameter :: limits = accuracy_options()

end module fw_accuracy_options
