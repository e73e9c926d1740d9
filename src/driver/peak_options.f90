!> Limits of the search for maxima between the rows of a sweep, in one place. What halving and
!> doubling each of them changes is in docs/robustness/thresholds.md.
module fw_peak_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: limits

   type :: peak_options
      ! What counts as a maximum.
      !> Rise above both neighbours below which a maximum is round-off of the solutions, relative.
      real(wp) :: round_off = 1.0e-7_wp
      !> The same of quantities that hardly move, as a part of the largest one.
      real(wp) :: negligible = 1.0e-11_wp
      !> Samples closer than this, relative, are one frequency.
      real(wp) :: same_frequency = 1.0e-7_wp
      !> Solutions of one point from two guesses, both within the tolerance, differ by this much.
      real(wp) :: same_amplitude = 1.0e-6_wp

      ! When its height is known.
      !> A peak is known where the parabola promises no more than this, relative.
      real(wp) :: small_gain = 1.0e-4_wp
      !> The part of it that a third difference may promise: it says little of a corner.
      real(wp) :: borne_out = 0.2_wp
      !> A neighbour of at least this part of the height belongs to the peak: what is left of the
      !> parabola, of third order in the distance, is below the gain there.
      real(wp) :: near = 0.9_wp
      !> The same of a peak that may be the highest: three points of two peaks side by side look
      !> like one.
      real(wp) :: nearest = 0.97_wp
      !> The same of a peak that is cut off: it is no parabola towards that side.
      real(wp) :: nearest_cut = 0.995_wp
      !> Part of the rise of 1/A**2 up to a neighbour that is far below at which the next is tried.
      real(wp) :: inside = 0.65_wp
      !> Part of an interval that is kept between samples.
      real(wp) :: margin = 0.02_wp

      ! What may stand beyond it.
      !> A fall to this part of the height, over a way so many times as long as what is known of
      !> the peak, may hide more of it; a neighbour behind a gap so many times as long as the way
      !> on the other side, too.
      real(wp) :: deep = 0.5_wp, far_beyond = 8.0_wp, as_long = 2.0_wp
      !> Longest step over what is known, so as to stay on the branch: to a vertex, and past the
      !> last sample of a peak.
      real(wp) :: onwards = 1.5_wp, onwards_past = 2.0_wp
      !> Over what is known of the peak: how near a neighbour on another branch is, and how far to
      !> go past it.
      real(wp) :: next_to = 0.02_wp, past = 0.1_wp
      !> An edge is known where a sample has fallen so many times deeper, or has this part of the
      !> height.
      real(wp) :: far = 2.0_wp, at_edge = 0.9_wp
      !> Part of the height at which a peak goes on behind an edge, and of the way to it that is
      !> tried next.
      real(wp) :: goes_on = 0.9_wp, nearer = 0.3_wp

      ! Where else to look.
      !> Part of the way to the neighbours of the highest samples: nearer to the sample, from whose
      !> solution they go on.
      real(wp) :: part = 0.45_wp
      !> Part by which a bulge stands above the line between its neighbours.
      real(wp) :: bulge = 0.03_wp
      !> Part of the first interval at which it is seen whether the amplitude rises into the range.
      real(wp) :: step_inside = 0.1_wp
      !> How far the flank of a resonance between rows should stand out of them.
      real(wp) :: stands_out = 5.0_wp
      !> By which it stands out less until its points fit: rows for each point, but so many points.
      real(wp) :: fewer = 0.8_wp
      integer :: rows_per_point = 4, least_points = 10

      ! What it may cost.
      !> Solutions for the resonance of an interval, and failures next to a maximum that end its
      !> search; each halves the way that is tried.
      integer :: most_trials = 6, most_failures = 5
      !> Looks at an edge (a first solution between the peak and a sample behind another mode may
      !> miss it), and behind one.
      integer :: looks_at_edge = 2, looks_behind = 3
      !> Solutions of a search in all: so many, or one for so many rows, but no more than the last.
      integer :: least_budget = 80, budget_share = 20, most_budget = 200
      !> Samples from which on those far from maxima are thinned out: long sweeps need no more
      !> memory.
      integer :: most_samples = 128
   end type peak_options

   type(peak_options), parameter :: limits = peak_options()

end module fw_peak_options
