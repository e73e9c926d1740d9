!> Group /peak of a result file: one row for every maximum of an observed quantity.
module fw_peak_group
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_pair_cycle, only: pair_cycle
   use fw_peak, only: found_words, peak_type
   use fw_result_labels, only: label_dataset
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: write_peaks, write_peak_cycle

contains

   !> Write the group; nothing without peaks.
   subroutine write_peaks(file, peaks, n_harmonics, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(peak_type), intent(in) :: peaks(:)
      !> Of the case: those that a peak does not carry read as zero.
      integer, intent(in) :: n_harmonics
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      ! Components of the peaks side by side: a write of `peaks%omega` would copy them unseen.
      real(wp), allocatable :: coefficients(:, :), omega(:), amplitude(:), width(:), &
                               tolerance(:)
      integer, allocatable :: observed(:), found_by(:)
      type(string_type) :: words(size(found_words))
      integer :: k, n

      if (size(peaks) == 0) return
      n = 2*n_harmonics + 1
      do k = 1, size(peaks)
         n = max(n, size(peaks(k)%coefficients))
      end do
      allocate (coefficients(n, size(peaks)), source=0.0_wp)
      do k = 1, size(peaks)
         ! Adaptive runs carry fewer harmonics at some peaks.
         coefficients(:size(peaks(k)%coefficients), k) = peaks(k)%coefficients
      end do
      omega = peaks%omega
      amplitude = peaks%amplitude
      found_by = peaks%found_by
      ! Places count from 0 in a file, from 1 here.
      observed = peaks%observed - 1
      ! Negative stands for unknown inside the program, NaN in a file.
      width = peaks%bandwidth
      where (width < 0.0_wp) width = ieee_value(1.0_wp, ieee_quiet_nan)
      tolerance = peaks%tolerance
      where (tolerance < 0.0_wp) tolerance = ieee_value(1.0_wp, ieee_quiet_nan)
      call write_dataset(file, '/peak/omega', omega, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/amplitude', amplitude, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/bandwidth', width, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/tolerance', tolerance, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/coefficients', coefficients, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/observed', observed, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/found_by', found_by, error)
      if (allocated(error)) return
      do k = 1, size(words)
         words(k)%text = trim(found_words(k - 1))
      end do
      call write_attribute(file, '/peak/found_by', 'names', words, error)
      if (.not. allocated(error)) call label(file, 'omega')
      if (.not. allocated(error)) call label(file, 'amplitude')
      if (.not. allocated(error)) call label(file, 'bandwidth')
      if (.not. allocated(error)) call label(file, 'tolerance')
      if (.not. allocated(error)) call label(file, 'coefficients')
      if (.not. allocated(error)) call label(file, 'observed')
      if (.not. allocated(error)) call label(file, 'found_by')

   contains

      subroutine label(file, name)
         type(hdf5_file), intent(in) :: file
         character(*), intent(in) :: name

         call label_dataset(file, '/peak/'//name, unit_system, error)
      end subroutine label

   end subroutine write_peaks

   !> One period at the highest peak of the pairs that dissipate most.
   subroutine write_peak_cycle(file, omega, cycle, unit_system, error)
      type(hdf5_file), intent(in) :: file
      !> [rad/s]
      real(wp), intent(in) :: omega
      type(pair_cycle), intent(in) :: cycle
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      call write_dataset(file, '/peak/cycle/omega', [omega], error)
      if (allocated(error)) return
      ! Counted from 0 in a file.
      call write_dataset(file, '/peak/cycle/pair', cycle%pair - 1, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/cycle/relative_displacement', cycle%displacement, error)
      if (allocated(error)) return
      call write_dataset(file, '/peak/cycle/force', cycle%force, error)
      if (.not. allocated(error)) call label_dataset(file, '/peak/cycle/omega', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/peak/cycle/pair', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/peak/cycle/relative_displacement', &
                                                     unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/peak/cycle/force', unit_system, error)
   end subroutine write_peak_cycle

end module fw_peak_group
