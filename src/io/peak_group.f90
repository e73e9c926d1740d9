!> Group /peak of a result file: one row for every maximum of an observed quantity.
module fw_peak_group
   use fw_kinds, only: wp
   use fw_pair_cycle, only: pair_cycle
   use fw_peak, only: found_words, peak_type
   use fw_result_group, only: group_writer, result_group, unknown_below
   implicit none (type, external)
   private

   public :: peak_group

   type, extends(result_group) :: peak_group
      type(peak_type), allocatable :: peaks(:)
      !> Of the case: those that a peak does not carry read as zero.
      integer :: n_harmonics = 0
      !> One period at the highest peak of the pairs that dissipate most, where it is known, and its
      !> frequency [rad/s].
      type(pair_cycle), allocatable :: cycle
      real(wp) :: omega = 0.0_wp
   contains
      procedure :: write => write_peaks
   end type peak_group

contains

   subroutine write_peaks(self, to)
      class(peak_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      real(wp), allocatable :: coefficients(:, :)
      integer :: k, n

      if (size(self%peaks) > 0) then
         n = 2*self%n_harmonics + 1
         do k = 1, size(self%peaks)
            n = max(n, size(self%peaks(k)%coefficients))
         end do
         allocate (coefficients(n, size(self%peaks)), source=0.0_wp)
         do k = 1, size(self%peaks)
            ! Adaptive runs carry fewer harmonics at some peaks.
            coefficients(:size(self%peaks(k)%coefficients), k) = self%peaks(k)%coefficients
         end do
         call to%put('/peak/omega', [self%peaks%omega], 'rad/s', 'peak', &
                     'angular frequency of the maximum')
         call to%put('/peak/amplitude', [self%peaks%amplitude], '<length>', 'peak', &
                     'largest magnitude over the period')
         call to%put('/peak/bandwidth', [unknown_below(self%peaks%bandwidth)], 'rad/s', 'peak', &
                     'width at half of the power')
         call to%put('/peak/tolerance', [unknown_below(self%peaks%tolerance)], '1', 'peak', &
                     'amplitude known to this part of it')
         call to%put('/peak/coefficients', coefficients, '<length>', 'peak coefficient', &
                     'Fourier coefficients 0, c1, s1, ... of the quantity')
         ! Places count from 0 in a file, from 1 here.
         call to%put('/peak/observed', self%peaks%observed - 1, '', 'peak', &
                     'observed quantity, its column from 0')
         call to%put_places('/peak/found_by', [self%peaks%found_by], found_words, 'peak', &
                            'how it was found, an index into names')
      end if
      if (allocated(self%cycle)) call write_cycle(self%omega, self%cycle, to)
   end subroutine write_peaks

   subroutine write_cycle(omega, cycle, to)
      real(wp), intent(in) :: omega
      type(pair_cycle), intent(in) :: cycle
      type(group_writer), intent(inout) :: to

      call to%put('/peak/cycle/omega', [omega], 'rad/s', 'one', 'angular frequency of this period')
      call to%put('/peak/cycle/pair', cycle%pair - 1, '', 'cycle_pair', &
                  'pairs that dissipate most, from 0')
      call to%put('/peak/cycle/relative_displacement', cycle%displacement, '<length>', &
                  'time cycle_pair component', 'relative displacement (t1, t2, n)')
      call to%put('/peak/cycle/force', cycle%force, '<force>', 'time cycle_pair component', &
                  'contact force (t1, t2, n), as the law gives it')
   end subroutine write_cycle

end module fw_peak_group
