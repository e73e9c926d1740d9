!> The datasets of group /wear of a result file: one row per accepted step, the start included.
!> Nothing is written where there is no file. HDF5 serves one thread at a time: every procedure
!> waits for its turn.
module fw_wear_rows
   use fw_contact_data, only: contact_type
   use fw_error, only: error_type
   use fw_hdf5, only: growing_dataset
   use fw_hdf5, only: growing_real
   use fw_hdf5, only: hdf5_file
   use fw_hdf5, only: write_attribute
   use fw_hdf5, only: write_dataset
   use fw_hdf5, only: write_text
   use fw_kinds, only: wp
   use fw_result_labels, only: label_dataset
   use fw_text_list, only: append
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: wear_row_set

   integer, parameter :: d_cycles = 1, d_depth = 2, d_rate = 3, d_energy = 4, d_volume = 5
   integer, parameter :: n_datasets = 5

   type :: wear_row_set
      type(growing_dataset), private :: list(n_datasets)
      !> Area of every pair, and the number of its patch (n_pairs).
      real(wp), allocatable, private :: area(:)
      integer, allocatable, private :: patch_of(:)
      integer, private :: n_patches = 1
   contains
      procedure :: create => create_datasets
      procedure :: append => append_row
      procedure :: copy
      procedure :: state_outcome
      procedure :: state_halved
      procedure :: close => close_datasets
   end type wear_row_set

contains

   subroutine create_datasets(self, file, contact, unit_system, cycles_units, error)
      class(wear_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(in) :: contact
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      !> 'cycles', or what stands for them.
      character(*), intent(in) :: cycles_units
      type(error_type), allocatable, intent(out) :: error

      if (file%id < 0) return
      !$omp critical (fretwear_io)
      call create(self, file, contact, unit_system, cycles_units, error)
      !$omp end critical (fretwear_io)
   end subroutine create_datasets

   subroutine create(self, file, contact, unit_system, cycles_units, error)
      class(wear_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(in) :: contact
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      character(*), intent(in) :: cycles_units
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: scalar(0) = [integer ::]
      type(string_type), allocatable :: patches(:)
      integer :: n_pairs

      n_pairs = contact%n_pairs
      self%area = contact%area
      call number_patches(contact, patches, self%patch_of)
      self%n_patches = size(patches)
      call self%list(d_cycles)%create(file, '/wear/cycles', growing_real, scalar, error)
      if (allocated(error)) return
      call self%list(d_depth)%create(file, '/wear/depth', growing_real, [n_pairs], error)
      if (allocated(error)) return
      call self%list(d_rate)%create(file, '/wear/rate', growing_real, [n_pairs], error)
      if (allocated(error)) return
      call self%list(d_energy)%create(file, '/wear/energy', growing_real, [n_pairs], error)
      if (allocated(error)) return
      call self%list(d_volume)%create(file, '/wear/volume', growing_real, [self%n_patches], error)
      if (allocated(error)) return
      call write_text(file, '/wear/patch', patches, error)
      if (allocated(error)) return
      call label_dataset(file, '/wear/cycles', unit_system, error)
      if (.not. allocated(error)) then
         call write_attribute(file, '/wear/cycles', 'units', cycles_units, error)
      end if
      if (.not. allocated(error)) call label_dataset(file, '/wear/depth', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/wear/rate', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/wear/energy', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/wear/volume', unit_system, error)
   end subroutine create

   !> Patches in the order of their first pair; without names all pairs form one.
   subroutine number_patches(contact, patches, patch_of)
      type(contact_type), intent(in) :: contact
      type(string_type), allocatable, intent(out) :: patches(:)
      integer, allocatable, intent(out) :: patch_of(:)
      integer :: i, k

      allocate (patches(0))
      allocate (patch_of(contact%n_pairs), source=1)
      if (.not. allocated(contact%patch)) then
         call append(patches, 'all')
         return
      end if
      do i = 1, contact%n_pairs
         do k = 1, size(patches)
            if (patches(k)%text == contact%patch(i)%text) exit
         end do
         patch_of(i) = k
         if (k > size(patches)) call append(patches, contact%patch(i)%text)
      end do
   end subroutine number_patches

   subroutine append_row(self, file, cycles, depth, rate, energy, error)
      class(wear_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      real(wp), intent(in) :: cycles
      !> Depth, depth per cycle and accumulated friction energy (n_pairs).
      real(wp), intent(in) :: depth(:), rate(:), energy(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: volume(self%n_patches)
      integer :: k

      if (.not. self%list(d_cycles)%is_created()) return
      do k = 1, self%n_patches
         volume(k) = sum(self%area*depth, mask=self%patch_of == k)
      end do
      !$omp critical (fretwear_io)
      call self%list(d_cycles)%append(file, cycles, error)
      if (.not. allocated(error)) call self%list(d_depth)%append(file, depth, error)
      if (.not. allocated(error)) call self%list(d_rate)%append(file, rate, error)
      if (.not. allocated(error)) call self%list(d_energy)%append(file, energy, error)
      if (.not. allocated(error)) call self%list(d_volume)%append(file, volume, error)
      !$omp end critical (fretwear_io)
   end subroutine append_row

   !> Begin with the first n rows of an earlier result of the same case.
   subroutine copy(self, file, source, n, error)
      class(wear_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      !$omp critical (fretwear_io)
      do i = 1, n_datasets
         call self%list(i)%copy_rows(file, source, n, error)
         if (allocated(error)) exit
      end do
      !$omp end critical (fretwear_io)
   end subroutine copy

   !> The profile that the same run has with steps of half the size, and how far it is from this
   !> one.
   subroutine state_halved(self, file, depth, change, unit_system, error)
      class(wear_row_set), intent(in) :: self
      type(hdf5_file), intent(in) :: file
      !> (n_pairs) [length].
      real(wp), intent(in) :: depth(:)
      !> Largest difference, as a part of the largest depth.
      real(wp), intent(in) :: change
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%list(d_cycles)%is_created()) return
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
   subroutine state_outcome(self, file, steady_state, ending, error)
      class(wear_row_set), intent(in) :: self
      type(hdf5_file), intent(in) :: file
      !> 'reached', 'not reached' or 'none: gross slip'.
      character(*), intent(in) :: steady_state
      !> In words, how the run ended.
      character(*), intent(in) :: ending
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%list(d_cycles)%is_created()) return
      !$omp critical (fretwear_io)
      call write_attribute(file, '/wear', 'steady_state', steady_state, error)
      if (.not. allocated(error)) call write_attribute(file, '/wear', 'ending', ending, error)
      if (.not. allocated(error)) call write_attribute(file, '/', 'steady_state', steady_state, &
                                                       error)
      !$omp end critical (fretwear_io)
   end subroutine state_outcome

   subroutine close_datasets(self)
      class(wear_row_set), intent(inout) :: self
      integer :: i

      !$omp critical (fretwear_io)
      do i = 1, n_datasets
         call self%list(i)%close()
      end do
      !$omp end critical (fretwear_io)
   end subroutine close_datasets

end module fw_wear_rows
