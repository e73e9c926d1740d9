!> What the parts of a model file must be to each other. Which of them stand there is checked before
!> any is read, what they hold behind.
module fw_model_file_rules
   use fw_cyclic_parts, only: check_physical, check_rows, cyclic_parts, finish_influence
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: dataset_failure, get_shape, has_attribute, hdf5_file, read_attribute, &
      shape_text
   use fw_part_file, only: file_source
   use fw_raw_model, only: raw_model
   use fw_text, only: to_text
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: check_after, check_before

   character(*), parameter :: group = '/cyclic', wave_names(*) = &
      [character(21) :: '/load/harmonic_cosine', '/load/harmonic_sine'], &
      air_groups(*) = [character(20) :: '/aero/sector', '/aero/nodal_diameter']

contains

   !> The number of sectors is known.
   subroutine check_before(source, model, error)
      type(file_source), intent(inout) :: source
      type(raw_model), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error

      associate (file => source%file)
         ! Only matrices of nodal diameters have coordinates beyond displacements.
         source%is_nodal = has_attribute(file, group, 'n_physical')
         if (source%is_nodal) then
            call check_nodal(file, model%cyclic, source%conjugates, error)
            if (.not. allocated(error)) call check_orders(file, model%cyclic, error)
            call source%set_extent('dof', model%cyclic%n_physical)
         else
            call check_interfaces(file, error)
         end if
         if (.not. allocated(error)) call check_waves(file, error)
         if (.not. allocated(error) .and. file%exists('/aero')) then
            call expect_one(file, '/aero', air_groups, 'groups sector and nodal_diameter', error)
         end if
      end associate
   end subroutine check_before

   !> Of two parts one has to be there.
   subroutine expect_one(file, holder, names, words, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: holder, names(2), words
      type(error_type), allocatable, intent(out) :: error
      logical :: first

      first = file%exists(trim(names(1)))
      if (first .neqv. file%exists(trim(names(2)))) return
      call fatal_error(error, file%path//': '//holder//' holds '// &
                       trim(merge('both   ', 'neither', first))//' of the '//words// &
                       ', expected one', status_input)
   end subroutine expect_one

   !> Dofs that a sector shares with its neighbours, in pairs.
   subroutine check_interfaces(file, error)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error

      if (file%exists('/nodal_diameter')) then
         call fatal_error(error, file%path//': /nodal_diameter needs attribute n_physical of '// &
                          '/cyclic', status_input)
      else if (has_attribute(file, group, 'phase')) then
         call fatal_error(error, file%path//': attribute phase of /cyclic is that of '// &
                          'matrices of nodal diameters, and there are none: remove it', &
                          status_input)
      else if (file%exists('/cyclic/left') .neqv. file%exists('/cyclic/right')) then
         ! Sectors that only contact joins have neither.
         call dataset_failure(file, '/cyclic/'//trim(merge('right', 'left ', &
                              file%exists('/cyclic/left'))), 'is missing', error)
      end if
   end subroutine check_interfaces

   !> Matrices of nodal diameters in the place of those of a sector. Files that have
   !> `phase = 'advance'` tie u_right = exp(2 pi i k/N) u_left, the other way round: what they hold
   !> is conjugated as it is read.
   subroutine check_nodal(file, parts, conjugates, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(inout) :: parts
      logical, intent(out) :: conjugates
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: others(*) = [character(22) :: '/mass', '/stiffness', '/damping', &
         '/speed', &
         '/stiffness_rotation', '/coriolis', '/structural_damping', '/circulatory', &
         '/stiffness_unsymmetric', '/damping_unsymmetric', '/cyclic/left', '/cyclic/right']
      character(:), allocatable :: phase
      integer :: i

      conjugates = .false.
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
      if (has_attribute(file, group, 'phase')) call read_attribute(file, group, 'phase', phase, &
                                                                   error)
      if (allocated(error)) return
      conjugates = phase == 'advance'
      allocate (parts%nodal(parts%n_sectors/2 + 1))
      if (conjugates .and. file%exists('/aero/nodal_diameter')) then
         call fatal_error(error, file%path//': /aero/nodal_diameter does not go with phase '// &
                          '"advance" of /cyclic: give /aero/sector', status_input)
      else if (phase /= 'delay' .and. .not. conjugates) then
         call fatal_error(error, file%path//': attribute phase of /cyclic is "'//phase// &
                          '", expected "delay" or "advance"', status_input)
      end if
   end subroutine check_nodal

   !> Displacements in front are some of the coordinates of every nodal diameter.
   subroutine check_orders(file, parts, error)
      type(hdf5_file), intent(in) :: file
      type(cyclic_parts), intent(in) :: parts
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      character(:), allocatable :: message, name
      integer :: k

      do k = 0, parts%n_sectors/2
         name = '/nodal_diameter/'//to_text(k)//'/mass'
         if (.not. file%exists(name)) cycle
         call get_shape(file, name, dims, error)
         if (allocated(error)) return
         if (size(dims) /= 3) cycle
         if (dims(2) /= dims(3)) cycle
         call check_physical(parts%n_physical, int(dims(3)), name, message)
         if (.not. allocated(message)) cycle
         call fatal_error(error, file%path//': attribute n_physical of /cyclic '//message, &
                          status_input)
         return
      end do
   end subroutine check_orders

   !> Loads of other harmonics than the first need these, and these need loads.
   subroutine check_waves(file, error)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      integer :: j

      if (file%exists('/load/harmonic')) return
      do j = 1, size(wave_names)
         if (allocated(error) .or. .not. file%exists(trim(wave_names(j)))) cycle
         call dataset_failure(file, trim(wave_names(j)), 'needs /load/harmonic, the '// &
                              'harmonics of its rows', error)
      end do
   end subroutine check_waves

   !> What was read.
   subroutine check_after(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(raw_model), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error

      if (allocated(model%springs%side_1)) model%springs%n_springs = size(model%springs%side_1)
      if (allocated(model%load_harmonic)) call check_rows_of_loads(file, model, error)
      if (.not. allocated(error)) call check_air(file, model, error)
      if (.not. allocated(error)) call check_observed(file, allocated(model%cyclic%nodal), error)
      if (allocated(error) .or. .not. allocated(model%cyclic%nodal)) return
      call check_diameters(file, model, error)
   end subroutine check_after

   !> Quantities by dof numbers, or by a matrix of factors.
   subroutine check_observed(file, is_nodal, error)
      type(hdf5_file), intent(in) :: file
      logical, intent(in) :: is_nodal
      type(error_type), allocatable, intent(out) :: error

      if (.not. file%exists('/observe')) return
      ! The rows may stand with the nodal diameters.
      if (is_nodal .and. .not. (file%exists('/observe/dof') .or. &
                                file%exists('/observe/matrix'))) return
      call expect_one(file, 'group /observe', [character(15) :: '/observe/dof', &
                                               '/observe/matrix'], 'datasets dof and matrix', error)
   end subroutine check_observed

   !> Loads of no harmonics have no rows.
   subroutine check_rows_of_loads(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(raw_model), intent(in) :: model
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      integer :: j

      if (size(model%load_harmonic) > 0) then
         if (allocated(model%harmonic_cosine) .or. allocated(model%harmonic_sine)) return
         call dataset_failure(file, '/load/harmonic', 'needs their loads, '// &
                              '/load/harmonic_cosine or /load/harmonic_sine', error)
         return
      end if
      do j = 1, size(wave_names)
         if (.not. file%exists(trim(wave_names(j)))) cycle
         call get_shape(file, trim(wave_names(j)), dims, error)
         if (allocated(error)) return
         if (product(dims) == 0) cycle
         call dataset_failure(file, trim(wave_names(j)), 'has shape '//shape_text(dims)// &
                              ', but /load/harmonic is empty', error)
         return
      end do
   end subroutine check_rows_of_loads

   !> Matrices of the air, on rows of motion.
   subroutine check_air(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(raw_model), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message, name
      integer :: n

      if (.not. file%exists('/aero')) return
      name = trim(air_groups(merge(1, 2, file%exists(trim(air_groups(1))))))
      n = max(1, model%cyclic%n_sectors) - 1
      message = ' holds no matrix named by a number from '//to_text(-n)//' to '//to_text(n)
      if (allocated(model%cyclic%air)) then
         if (allocated(model%cyclic%air%number)) then
            call finish_influence(model%cyclic%air, model%order(), message)
            if (allocated(message)) message = ' '//message
            name = 'matrices of '//name
         end if
      end if
      if (allocated(message)) call fatal_error(error, file%path//': '//name//message, status_input)
   end subroutine check_air

   !> Rows of observed quantities stand with all nodal diameters or with none.
   subroutine check_diameters(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(raw_model), intent(in) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: k, n
      logical :: has_rows

      associate (parts => model%cyclic)
         has_rows = any([(allocated(parts%nodal(k)%observe), k=1, size(parts%nodal))])
         if (.not. has_rows .and. (allocated(model%observe_matrix) .or. &
                                   .not. file%exists('/observe'))) return
         n = 0
         if (allocated(model%observe_name)) n = size(model%observe_name)
         call check_rows(parts, n, k)
      end associate
      if (.not. allocated(model%observe_name)) then
         call dataset_failure(file, '/observe/name', 'is missing', error)
      else if (k >= 0) then
         call fatal_error(error, file%path//': /nodal_diameter/'//to_text(k)// &
                          '/observe/matrix must have a row for each of the '//to_text(n)// &
                          ' names of /observe/name', status_input)
      end if
   end subroutine check_diameters

end module fw_model_file_rules
