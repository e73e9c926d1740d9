!> The cyclic parts of a model file: the interfaces of a sector, or complex matrices of every nodal
!> diameter. Files that have `phase = 'advance'` tie u_right = exp(2 pi i k/N) u_left, the other way
!> round: what they hold is conjugated as it is read.
module fw_cyclic_file
   use fw_cyclic_parts, only: check_physical, check_rows, cyclic_parts, nodal_parts
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: dataset_failure, has_attribute, hdf5_file, read_attribute, read_dataset, &
      read_text
   use fw_kinds, only: wp
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: count_sectors, read_complex, read_cyclic_file

   character(*), parameter :: group = '/cyclic'

contains

   !> Number of sectors; 0 where the file has no group /cyclic.
   subroutine count_sectors(file, n_sectors, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(out) :: n_sectors
      type(error_type), allocatable, intent(out) :: error

      n_sectors = 0
      if (.not. file%exists(group)) return
      call read_attribute(file, group, 'n_sectors', n_sectors, error)
      if (allocated(error) .or. n_sectors >= 1) return
      call fatal_error(error, file%path//': attribute n_sectors of /cyclic is '// &
                       to_text(n_sectors)//', expected at least 1', status_input)
   end subroutine count_sectors

   !> What the file says of its sectors, once they are counted.
   subroutine read_cyclic_file(file, parts, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(inout) :: parts
      type(error_type), allocatable, intent(out) :: error

      ! Only matrices of nodal diameters have coordinates beyond displacements.
      if (has_attribute(file, group, 'n_physical')) then
         call read_nodal(file, parts, error)
      else
         call read_interfaces(file, parts, error)
      end if
   end subroutine read_cyclic_file

   !> Dofs that a sector shares with its neighbours, in pairs.
   subroutine read_interfaces(file, parts, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(inout) :: parts
      type(error_type), allocatable, intent(out) :: error

      if (file%exists('/nodal_diameter')) then
         call fatal_error(error, file%path//': /nodal_diameter needs attribute n_physical of '// &
                          '/cyclic', status_input)
         return
      else if (has_attribute(file, group, 'phase')) then
         call fatal_error(error, file%path//': attribute phase of /cyclic is that of '// &
                          'matrices of nodal diameters, and there are none: remove it', &
                          status_input)
         return
      end if
      ! Sectors that only contact joins have neither.
      if (.not. (file%exists('/cyclic/left') .or. file%exists('/cyclic/right'))) return
      call read_dataset(file, '/cyclic/left', parts%left, error)
      if (.not. allocated(error)) call read_dataset(file, '/cyclic/right', parts%right, error)
      if (allocated(error)) return
      if (size(parts%left) /= size(parts%right)) then
         call dataset_failure(file, '/cyclic/right', 'has '//to_text(size(parts%right))// &
                              ' values, expected as many as /cyclic/left: '// &
                              to_text(size(parts%left)), error)
      end if
   end subroutine read_interfaces

   !> Matrices of nodal diameters in the place of those of a sector.
   subroutine read_nodal(file, parts, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(inout) :: parts
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: others(*) = [character(19) :: '/mass', '/stiffness', '/damping', &
         '/stiffness_rotation', '/coriolis', '/cyclic/left', '/cyclic/right']
      character(:), allocatable :: phase
      logical :: turns
      integer :: i, k

      call read_attribute(file, group, 'n_physical', parts%n_physical, error)
      if (allocated(error)) return
      do i = 1, size(others)
         if (.not. file%exists(trim(others(i)))) cycle
         call fatal_error(error, file%path//': '//trim(others(i))//' beside matrices of nodal '// &
                          'diameters (attribute n_physical of /cyclic): expected one of both', &
                          status_input)
         return
      end do
      phase = 'delay'
      if (has_attribute(file, group, 'phase')) then
         call read_attribute(file, group, 'phase', phase, error)
         if (allocated(error)) return
      end if
      turns = phase == 'advance'
      if (turns .and. file%exists('/aero/nodal_diameter')) then
         call fatal_error(error, file%path//': /aero/nodal_diameter does not go with phase '// &
                          '"advance" of /cyclic: give /aero/sector', status_input)
         return
      end if
      if (phase /= 'delay' .and. .not. turns) then
         call fatal_error(error, file%path//': attribute phase of /cyclic is "'//phase// &
                          '", expected "delay" or "advance"', status_input)
         return
      end if
      allocate (parts%nodal(parts%n_sectors/2 + 1))
      do k = 0, parts%n_sectors/2
         if (.not. file%exists('/nodal_diameter/'//to_text(k))) cycle
         call read_diameter(file, '/nodal_diameter/'//to_text(k)//'/', turns, parts%n_physical, &
                            parts%nodal(k + 1), error)
         if (allocated(error)) return
      end do
      call check_observed(file, parts, error)
   end subroutine read_nodal

   !> Rows of observed quantities stand with all nodal diameters or with none.
   subroutine check_observed(file, parts, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(in) :: parts
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: names(:)
      integer :: k
      logical :: has_rows

      has_rows = any([(allocated(parts%nodal(k)%observe), k=1, size(parts%nodal))])
      if (.not. has_rows .and. (file%exists('/observe/dof') .or. file%exists('/observe/matrix') &
                                .or. .not. file%exists('/observe'))) return
      call read_text(file, '/observe/name', names, error)
      if (allocated(error)) return
      call check_rows(parts, size(names), k)
      if (k < 0) return
      call fatal_error(error, file%path//': /nodal_diameter/'//to_text(k)// &
                       '/observe/matrix must have a row for each of the '// &
                       to_text(size(names))//' names of /observe/name', status_input)
   end subroutine check_observed

   subroutine read_diameter(file, name, turns, n_physical, nodal, error)
      type(hdf5_file), intent(in) :: file
      !> Of the group, with a slash behind.
      character(*), intent(in) :: name
      logical, intent(in) :: turns
      integer, intent(in) :: n_physical
      type(nodal_parts), intent(inout) :: nodal
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      integer :: n

      n = 0
      call read_square('mass', .true., nodal%mass)
      if (allocated(error)) return
      n = size(nodal%mass, 1)
      call check_physical(n_physical, n, name//'mass', message)
      if (allocated(message)) then
         call fatal_error(error, file%path//': attribute n_physical of /cyclic '//message, &
                          status_input)
         return
      end if
      call read_square('stiffness', .true., nodal%stiffness)
      if (.not. allocated(error)) call read_square('damping', .false., nodal%damping)
      if (.not. allocated(error)) call read_square('stiffness_rotation', .false., &
                                                   nodal%stiffness_rotation)
      if (.not. allocated(error)) call read_square('coriolis', .false., nodal%coriolis)
      if (.not. allocated(error)) call read_load('load/static', nodal%load_static)
      if (.not. allocated(error)) call read_load('load/cosine', nodal%load_cosine)
      if (.not. allocated(error)) call read_load('load/sine', nodal%load_sine)
      if (.not. allocated(error)) call read_load('load/static_rotation', nodal%load_static_rotation)
      if (allocated(error) .or. .not. file%exists(name//'observe/matrix')) return
      call read_complex(file, name//'observe/matrix', turns, nodal%observe, error)
      if (allocated(error)) return
      if (size(nodal%observe, 2) /= n) call dataset_failure(file, name//'observe/matrix', 'has '// &
         to_text(size(nodal%observe, 2))//' columns, expected '//to_text(n), error)

   contains

      !> One matrix of the nodal diameter, square and of its size.
      subroutine read_square(key, needed, matrix)
         character(*), intent(in) :: key
         logical, intent(in) :: needed
         complex(wp), allocatable, intent(inout) :: matrix(:, :)

         if (.not. (needed .or. file%exists(name//key))) return
         call read_complex(file, name//key, turns, matrix, error)
         if (allocated(error)) return
         if (size(matrix) == 0 .or. size(matrix, 1) /= size(matrix, 2) .or. &
             (n > 0 .and. size(matrix, 1) /= n)) then
            call dataset_failure(file, name//key, 'is '//to_text(size(matrix, 1))//' x '// &
                                 to_text(size(matrix, 2))//', expected a square matrix of the '// &
                                 'order of the mass', error)
         end if
      end subroutine read_square

      subroutine read_load(key, load)
         character(*), intent(in) :: key
         complex(wp), allocatable, intent(inout) :: load(:)
         real(wp), allocatable :: found(:, :)

         if (.not. file%exists(name//key)) return
         call read_dataset(file, name//key, found, error)
         if (allocated(error)) return
         if (size(found, 1) /= 2 .or. size(found, 2) /= n) then
            call dataset_failure(file, name//key, 'has '//to_text(size(found, 2))//' rows of '// &
                                 to_text(size(found, 1))//', expected '//to_text(n)// &
                                 ' of 2, real and imaginary part', error)
            return
         end if
         load = cmplx(found(1, :), merge(-1.0_wp, 1.0_wp, turns)*found(2, :), wp)
      end subroutine read_load

   end subroutine read_diameter

   !> A matrix with real and imaginary part in the last dimension of h5py.
   subroutine read_complex(file, name, turns, matrix, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      logical, intent(in) :: turns
      complex(wp), allocatable, intent(out) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: found(:, :, :)

      call read_dataset(file, name, found, error)
      if (allocated(error)) return
      if (size(found, 1) /= 2) then
         call dataset_failure(file, name, 'has '//to_text(size(found, 1))//' numbers for each '// &
                              'entry, expected 2, real and imaginary part', error)
         return
      end if
      matrix = transpose(cmplx(found(1, :, :), merge(-1.0_wp, 1.0_wp, turns)*found(2, :, :), wp))
   end subroutine read_complex

end module fw_cyclic_file
