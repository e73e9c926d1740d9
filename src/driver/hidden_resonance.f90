!> Resonances that two neighbouring rows of a sweep pass by: a phase that turns back between them,
!> or a mode of the joint there that is narrow beside their distance.
module fw_hidden_resonance
   use fw_joint_modes, only: joint_mode_type, state_free, state_sliding, state_stuck
   use fw_kinds, only: pi, wp
   use fw_peak_options, only: limits
   use fw_samples, only: phase_step, sample_type
   implicit none (type, external)
   private

   public :: hides_resonance, hides_mode, turns_back

   !> Phase that an interval turns back by where it is taken for a skipped resonance.
   real(wp), parameter :: turn = 0.6_wp*pi
   !> Mode whose resonance is wider than this many intervals shows in the rows.
   real(wp), parameter :: intervals_of_width = 3.0_wp
   !> Linear response at a mode, over the present vibration, below which it hides no maximum.
   real(wp), parameter :: least_part = 0.1_wp
   !> Mean share of the period in one state from which the joint counts as in it; and from which it
   !> may well be free at the resonance of its free mode, where it moves more than at either row.
   real(wp), parameter :: mostly = 0.9_wp, often = 0.5_wp

contains

   !> Whether a resonance may lie between two rows that does not show in either.
   pure logical function hides_resonance(modes, below, above)
      type(joint_mode_type), intent(in) :: modes(:)
      type(sample_type), intent(in) :: below, above
      integer :: i

      hides_resonance = .false.
      do i = 1, size(below%amplitude)
         hides_resonance = hides_resonance .or. turns_back(below, above, i)
      end do
      do i = 1, size(modes)
         hides_resonance = hides_resonance .or. hides_mode(modes(i), below, above)
      end do
   end function hides_resonance

   !> Whether the first harmonic turns back by about pi, as it does over a resonance.
   pure logical function turns_back(below, above, i)
      type(sample_type), intent(in) :: below, above
      integer, intent(in) :: i

      ! What is round-off beside the other quantities has no phase.
      turns_back = min(below%first(i), above%first(i)) > &
                   limits%negligible*max(maxval(below%first), maxval(above%first)) .and. &
                   phase_step(below, above, i) < -turn
   end function turns_back

   !> Whether a mode lies between two rows, and would show in neither.
   pure logical function hides_mode(mode, below, above)
      type(joint_mode_type), intent(in) :: mode
      type(sample_type), intent(in) :: below, above

      ! In the interval, and so narrow that rows may pass it by.
      hides_mode = mode%omega > below%omega .and. mode%omega < above%omega .and. &
                   intervals_of_width*(above%omega - below%omega) > mode%width
      if (.not. hides_mode) return
      ! High enough to make a maximum of what vibrates here, and of a joint that is as the mode
      ! needs it.
      hides_mode = any(mode%amplitude > least_part*max(below%amplitude - below%mean, &
                                                       above%amplitude - above%mean)) .and. &
                   (is_in_state(mode%state, below) .or. is_in_state(mode%state, above))
   end function hides_mode

   !> Whether the joint is in a state for most of the period, as far as that is known.
   pure logical function is_in_state(state, sample)
      integer, intent(in) :: state
      type(sample_type), intent(in) :: sample
      integer, parameter :: stick = 1, slip = 2, open = 3

      is_in_state = .true.
      if (sample%fraction(stick) < 0.0_wp) return
      select case (state)
      case (state_stuck)
         is_in_state = sample%fraction(stick) >= mostly
      case (state_sliding)
         is_in_state = sample%fraction(slip) >= 1.0_wp - mostly .and. &
                       sample%fraction(open) < mostly
      case (state_free)
         is_in_state = sample%fraction(open) + sample%fraction(slip) >= often
      case default ! there is no joint
      end select
   end function is_in_state

end module fw_hidden_resonance
