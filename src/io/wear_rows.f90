!> What group /wear of a result file says besides the rows of the steps, which are quantities of the
!> points. Nothing is written where there is no file. HDF5 serves one thread at a time: every
!> procedure waits for its turn.
module fw_wear_rows
   use fw_contact_data, only: contact_type
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset, write_text
   use fw_kinds, only: wp
   use fw_patches, only: number_patches
   use fw_result_labels, only: label_dataset
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: start_wear, state_outcome, state_halved

contains

   !> Names of the patches, and what the cycles are counted in.
   subroutine start_wear(file, contact, cycles_units, error)
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(in) :: contact
      !> 'cycles', or what stands for them.
      character(*), intent(in) :: cycles_units
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: patches(:)
      integer, allocatable :: patch_of(:)

      if (file%id < 0) return
      !$omp critical (fretwear_io)
      call number_patches(contact, patches, patch_of)
      call write_text(file, '/wear/patch', patches, error)
      if (.not. allocated(error)) then
         call write_attribute(file, '/wear/cycles', 'units', cycles_units, error)
      end if
      !$omp end critical (fretwear_io)
   end subroutine start_wear

   !> The profile that the same run has with steps of half the size, and how far it is from this
   !> one.
   subroutine state_halved(file, depth, change, unit_system, error)
      type(hdf5_file), intent(in) :: file
      !> (n_pairs) [length].
      real(wp), intent(in) :: depth(:)
      !> Largest difference, as a part of the largest depth.
      real(wp), intent(in) :: change
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (file%id < 0) return
      !$omp critical (fretwear_io)
      call write_dataset(file, '/wear/depth_halved', depth, error)
      if (.not. allocated(error)) then
         call label_dataset(file, '/wear/depth_halved', unit_system, error)
      end if
      if (.not. allocated(error)) call write_attribute(file, '/wear', 'profile_change', change, &
                                                       error)
      !$omp end critical (fretwear_io)
   end subroutine state_halved

   !> Whether a steady state was reached, on the group and at the root of the file.
   subroutine state_outcome(file, steady_state, ending, error, counts)
      type(hdf5_file), intent(in) :: file
      !> 'reached', 'not reached' or 'none: gross slip'.
      character(*), intent(in) :: steady_state
      !> In words, how the run ended.
      character(*), intent(in) :: ending
      type(error_type), allocatable, intent(out) :: error
      !> Steps that were left to the implicit scheme, leaps, jumps of the vibration.
      integer, intent(in), optional :: counts(3)

      if (file%id < 0) return
      !$omp critical (fretwear_io)
      call write_attribute(file, '/wear', 'steady_state', steady_state, error)
      if (present(counts)) call write_counts(file, counts, error)
      if (.not. allocated(error)) call write_attribute(file, '/wear', 'ending', ending, error)
      if (.not. allocated(error)) call write_attribute(file, '/', 'steady_state', steady_state, &
                                                       error)
      !$omp end critical (fretwear_io)
   end subroutine state_outcome

   !> Steps that went otherwise than by the scheme of the case.
   subroutine write_counts(file, counts, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: counts(3)
      type(error_type), allocatable, intent(inout) :: error

      if (.not. allocated(error)) call write_attribute(file, '/wear', 'n_implicit', counts(1), &
                                                       error)
      if (.not. allocated(error)) call write_attribute(file, '/wear', 'n_leaps', counts(2), error)
      if (.not. allocated(error)) call write_attribute(file, '/wear', 'n_jumps', counts(3), error)
   end subroutine write_counts

end module fw_wear_rows
