!> Group /ringdown of a result file: a free decay, its extremes, and the frequency and damping of
!> its half swings.
module fw_ringdown_group
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: ringdown_group

   type, extends(result_group) :: ringdown_group
      !> Frequency of the stuck mode from whose shape the structure is released [rad/s].
      real(wp) :: stuck_omega = 0.0_wp
      !> (n_times) [s], and the observed quantities (n_observed, n_times).
      real(wp), allocatable :: time(:), observed(:, :)
      !> Of the first observed quantity (n_extremes) [s], and all of them (n_observed, n_extremes).
      real(wp), allocatable :: extreme_time(:), extreme_value(:, :)
      !> Of half swings: half the way (n_observed, n - 1), pi over the time [rad/s] (n - 1), and
      !> from the one before to the one behind (n - 3).
      real(wp), allocatable :: amplitude(:, :), omega(:), damping_ratio(:)
   contains
      procedure :: write => write_ringdown
   end type ringdown_group

contains

   subroutine write_ringdown(self, to)
      class(ringdown_group), intent(in) :: self
      type(group_writer), intent(inout) :: to

      call to%put('/ringdown/time', self%time, 's', 'time', 'time from the release')
      call to%put('/ringdown/observed', self%observed, '<length>', 'time observed', &
                  'observed quantities')
      call to%put('/ringdown/extreme/time', self%extreme_time, 's', 'extreme', &
                  'time of the extremes of the first observed quantity, the release included')
      call to%put('/ringdown/extreme/value', self%extreme_value, '<length>', 'extreme observed', &
                  'observed quantities there')
      call to%put('/ringdown/amplitude', self%amplitude, '<length>', 'half_swing observed', &
                  'half the way from one extreme to the next')
      call to%put('/ringdown/omega', self%omega, 'rad/s', 'half_swing', &
                  'pi over the time from one extreme to the next')
      call to%put('/ringdown/damping_ratio', self%damping_ratio, '1', 'inner_half_swing', &
                  'd/sqrt(4 pi**2 + d**2), d the logarithmic decrement from the half swing '// &
                  'before to the one behind')
      call to%note('/ringdown', 'stuck_omega', self%stuck_omega)
   end subroutine write_ringdown

end module fw_ringdown_group
