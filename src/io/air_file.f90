!> Forces of the air in a model file: complex matrices of influence by the motion of every sector,
!> or of every nodal diameter, on the amplitudes of rows of motion.
module fw_air_file
   use fw_cyclic_data, only: influence_type
   use fw_cyclic_file, only: read_complex
   use fw_cyclic_parts, only: add_influence, finish_influence
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: dataset_failure, hdf5_file
   use fw_kinds, only: wp
   use fw_model_file_parts, only: read_matrix
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_air_file

   character(*), parameter :: by_sector = '/aero/sector', by_diameter = '/aero/nodal_diameter'

contains

   !> Group /aero; nothing where the file has none.
   subroutine read_air_file(file, n_dof, n_sectors, air, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: n_dof, n_sectors
      type(influence_type), allocatable, intent(inout) :: air
      type(error_type), allocatable, intent(out) :: error
      type(influence_type) :: found
      real(wp), allocatable :: modes(:, :)
      character(:), allocatable :: group, message

      if (.not. file%exists('/aero')) return
      found%by_diameter = file%exists(by_diameter)
      if (found%by_diameter .eqv. file%exists(by_sector)) then
         call fatal_error(error, file%path//': /aero holds '// &
                          trim(merge('both   ', 'neither', found%by_diameter))// &
                          ' of the groups sector and nodal_diameter, expected one', status_input)
         return
      end if
      group = by_sector
      if (found%by_diameter) group = by_diameter
      call read_matrices(file, group, n_sectors, found, error)
      if (allocated(error)) return
      if (file%exists('/aero/modes')) then
         call read_matrix(file, '/aero/modes', n_dof, modes, error, n_rows=size(found%matrix, 1))
         if (allocated(error)) return
         ! Rows as h5py shows them.
         found%modes = modes
      end if
      call finish_influence(found, n_dof, message)
      if (allocated(message)) then
         call fatal_error(error, file%path//': matrices of '//group//' '//message, status_input)
         return
      end if
      allocate (air, source=found)
   end subroutine read_air_file

   !> Matrices by their numbers, which are their names.
   subroutine read_matrices(file, group, n_sectors, air, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: group
      integer, intent(in) :: n_sectors
      type(influence_type), intent(inout) :: air
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: matrix(:, :)
      character(:), allocatable :: name, message
      integer :: k

      ! By name: nothing says how many there are, nor in what order.
      allocate (air%number(0))
      do k = 1 - n_sectors, n_sectors - 1
         name = group//'/'//to_text(k)
         if (.not. file%exists(name)) cycle
         call read_complex(file, name, .false., matrix, error)
         if (allocated(error)) return
         call add_influence(air, k, n_sectors, matrix, message)
         if (allocated(message)) then
            call dataset_failure(file, name, message, error)
            return
         end if
      end do
      if (size(air%number) > 0) return
      call fatal_error(error, file%path//': '//group//' holds no matrix named by a number from '// &
                       to_text(1 - n_sectors)//' to '//to_text(n_sectors - 1), status_input)
   end subroutine read_matrices

end module fw_air_file
