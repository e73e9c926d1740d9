!> What a result file says of sectors and of natural frequencies.
module fw_cyclic_group
   use fw_case, only: analysis_modes, case_type
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_result_labels, only: label_dataset
   implicit none (type, external)
   private

   public :: write_cyclic, write_modes

contains

   !> Sectors, engine order, and the signed nodal diameter of every harmonic; nothing of a structure
   !> that is not cyclic.
   subroutine write_cyclic(file, case, error)
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: h

      associate (cyclic => case%model%cyclic)
         if (.not. cyclic%is_cyclic) return
         call write_attribute(file, '/', 'n_sectors', cyclic%n_sectors, error)
         if (allocated(error) .or. case%analysis == analysis_modes) return
         call write_attribute(file, '/', 'engine_order', cyclic%engine_order, error)
         if (.not. allocated(error) .and. cyclic%is_mistuned) then
            call write_attribute(file, '/', 'mistuned', 1, error)
         end if
         if (allocated(error)) return
         call write_dataset(file, '/cyclic/nodal_diameter', &
                            [(cyclic%nodal_diameter(h), h=0, case%harmonics%n_harmonics)], error)
      end associate
      if (.not. allocated(error)) call label_dataset(file, '/cyclic/nodal_diameter', &
                                                     case%model%unit_system, error)
   end subroutine write_cyclic

   !> Natural frequencies of the nodal diameters, NaN where there are fewer.
   subroutine write_modes(file, nodal_diameter, open, closed, unit_system, error, open_damping, &
                          closed_damping)
      type(hdf5_file), intent(in) :: file
      integer, intent(in), contiguous :: nodal_diameter(:)
      !> Without contact, and with every pair closed (n_modes, n_diameters) [rad/s].
      real(wp), intent(in), contiguous :: open(:, :), closed(:, :)
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      !> Fractions of critical damping; not allocated where frequencies are undamped ones.
      real(wp), allocatable, intent(in) :: open_damping(:, :), closed_damping(:, :)

      call write_dataset(file, '/modes/nodal_diameter', nodal_diameter, error)
      if (.not. allocated(error)) call write_dataset(file, '/modes/open', open, error)
      if (.not. allocated(error)) call write_dataset(file, '/modes/closed', closed, error)
      if (.not. allocated(error)) call label_dataset(file, '/modes/nodal_diameter', unit_system, &
                                                     error)
      if (.not. allocated(error)) call label_dataset(file, '/modes/open', unit_system, error)
      if (.not. allocated(error)) call label_dataset(file, '/modes/closed', unit_system, error)
      if (.not. allocated(open_damping) .or. allocated(error)) return
      call write_dataset(file, '/modes/open_damping', open_damping, error)
      if (.not. allocated(error)) call write_dataset(file, '/modes/closed_damping', &
                                                     closed_damping, error)
      if (.not. allocated(error)) call label_dataset(file, '/modes/open_damping', unit_system, &
                                                     error)
      if (.not. allocated(error)) call label_dataset(file, '/modes/closed_damping', unit_system, &
                                                     error)
   end subroutine write_modes

end module fw_cyclic_group
