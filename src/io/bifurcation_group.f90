!> Group /bifurcation of a result file: one row for every place where the response turns or its
!> stability changes.
module fw_bifurcation_group
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_bifurcation, only: bifurcation_list, kind_words, way_words
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_result_labels, only: label_dataset
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: write_bifurcations

contains

   !> Write the group; nothing where there is none.
   subroutine write_bifurcations(file, list, n_harmonics, unit_system, frequency, error)
      type(hdf5_file), intent(in) :: file
      type(bifurcation_list), intent(in) :: list
      !> Of the case: those that a solution does not carry read as zero.
      integer, intent(in) :: n_harmonics
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      !> That of a sweep over another parameter [rad/s]; 0 where it is the frequency that changes.
      real(wp), intent(in) :: frequency
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: coefficients(:, :, :), multiplier(:, :), amplitude(:, :), width(:)
      ! Components of the list side by side: a write of `list%item%place` would copy them unseen.
      real(wp), allocatable :: place(:)
      integer, allocatable :: kind(:), found_by(:)
      integer :: k, n, n_observed

      if (list%n == 0) return
      n_observed = size(list%item(1)%amplitude)
      n = 2*n_harmonics + 1
      do k = 1, list%n
         n = max(n, size(list%item(k)%coefficients, 1))
      end do
      ! Shapes are those of h5py reversed.
      allocate (coefficients(n_observed, n, list%n), source=0.0_wp)
      allocate (multiplier(2, list%n), amplitude(n_observed, list%n), width(list%n))
      do k = 1, list%n
         associate (item => list%item(k))
            amplitude(:, k) = item%amplitude
            coefficients(:, :size(item%coefficients, 1), k) = transpose(item%coefficients)
            multiplier(:, k) = [real(item%multiplier, wp), aimag(item%multiplier)]
            width(k) = item%error
            if (item%error < 0.0_wp) width(k) = ieee_value(1.0_wp, ieee_quiet_nan)
            if (abs(item%multiplier) <= 0.0_wp) multiplier(:, k) = ieee_value(1.0_wp, &
               ieee_quiet_nan)
         end associate
      end do
      place = list%item(:list%n)%place
      kind = list%item(:list%n)%kind
      found_by = list%item(:list%n)%found_by
      if (frequency > 0.0_wp) then
         call write_place(file, place, width, unit_system, error)
         if (allocated(error)) return
         ! The frequency is what it is.
         place = frequency
         width = 0.0_wp
      end if
      call write_dataset(file, '/bifurcation/omega', place, error)
      if (allocated(error)) return
      call write_dataset(file, '/bifurcation/error', width, error)
      if (allocated(error)) return
      call write_dataset(file, '/bifurcation/amplitude', amplitude, error)
      if (allocated(error)) return
      call write_dataset(file, '/bifurcation/coefficients', coefficients, error)
      if (allocated(error)) return
      call write_dataset(file, '/bifurcation/multiplier', multiplier, error)
      if (allocated(error)) return
      call write_words(file, '/bifurcation/kind', kind, kind_words, error)
      if (allocated(error)) return
      call write_words(file, '/bifurcation/found_by', found_by, way_words, error)
      if (allocated(error)) return
      call label_all(file, unit_system, error)
   end subroutine write_bifurcations

   !> Values of the parameter that a sweep goes over, and how far they may be off.
   subroutine write_place(file, place, width, unit_system, error)
      type(hdf5_file), intent(in) :: file
      real(wp), intent(in), contiguous :: place(:), width(:)
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      call write_dataset(file, '/bifurcation/parameter', place, error)
      if (allocated(error)) return
      call label_dataset(file, '/bifurcation/parameter', unit_system, error)
      if (allocated(error)) return
      call write_dataset(file, '/bifurcation/parameter_error', width, error)
      if (allocated(error)) return
      call label_dataset(file, '/bifurcation/parameter_error', unit_system, error)
   end subroutine write_place

   !> Places in words, from 0.
   subroutine write_words(file, name, places, words, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in), contiguous :: places(:)
      character(*), intent(in) :: words(0:)
      type(error_type), allocatable, intent(out) :: error
      type(string_type) :: names(size(words))
      integer :: k

      call write_dataset(file, name, places, error)
      if (allocated(error)) return
      do k = 1, size(names)
         names(k)%text = trim(words(k - 1))
      end do
      call write_attribute(file, name, 'names', names, error)
   end subroutine write_words

   !> Units and meanings, as every dataset of the file has them.
   subroutine label_all(file, unit_system, error)
      type(hdf5_file), intent(in) :: file
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: names(7) = [character(12) :: 'omega', 'error', 'amplitude', &
                                             'coefficients', 'multiplier', 'kind', 'found_by']
      integer :: k

      do k = 1, size(names)
         call label_dataset(file, '/bifurcation/'//trim(names(k)), unit_system, error)
         if (allocated(error)) return
      end do
   end subroutine label_all

end module fw_bifurcation_group
