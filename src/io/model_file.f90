!> Model files: the structure, its contact pairs, loads and observed quantities (HDF5).
!>
!> Datasets are named and shaped as the user guide says; here every shape is reversed, because
!> HDF5 counts the slowest dimension first, and matrices are transposed back, so that element
!> (i, j) is the one h5py calls [i-1, j-1].
module fw_model_file
   use fw_air_file, only: read_air_file
   use fw_contact_data, only: spring_type
   use fw_cyclic_file, only: count_sectors, read_cyclic_file
   use fw_cyclic_parts, only: cyclic_parts
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: dataset_failure, get_shape, hdf5_file, has_attribute, read_attribute, &
      read_dataset, shape_text
   use fw_kinds, only: wp
   use fw_law_constants, only: law_constants
   use fw_laws, only: law_words
   use fw_model_file_parts, only: read_dofs, read_matrix, read_names, read_pair_values, &
      read_positions, read_vector
   use fw_parts, only: law_constant_names
   use fw_reader_text, only: words_text
   use fw_spring_file, only: read_spring_file
   use fw_strangers, only: find_strangers
   use fw_text, only: string_type, to_text
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: file_model_type, list_unread, read_model_hdf5

   ! What a file must say of itself in its attributes, so that any other HDF5 file is told apart.
   character(*), parameter :: format_name = 'fretwear-model'
   integer, parameter :: known_version = 1

   character(*), parameter :: wave_names(*) = &
      [character(21) :: '/load/harmonic_cosine', '/load/harmonic_sine']

   !> What a model file holds; a component is not allocated where the file has none.
   type :: file_model_type
      character(:), allocatable :: title, unit_system
      !> Paths of the files it was read from.
      type(string_type), allocatable :: files(:)
      !> What stands in the file and nothing reads.
      type(string_type), allocatable :: unread(:)
      !> Structure (n_dof, n_dof), not checked for symmetry.
      real(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      !> Stiffness per square of the rotation speed (n_dof, n_dof) [force/length/(rad/s)**2].
      real(wp), allocatable :: stiffness_rotation(:, :)
      !> Signed dof numbers of (t1, t2, n), not checked for range (3, n_pairs).
      integer, allocatable :: side_1(:, :), side_2(:, :)
      !> Friction coefficient, gap [length] and area [length**2] of the pairs (n_pairs).
      real(wp), allocatable :: mu(:), gap(:), area(:)
      !> Constant normal load of the pairs (n_pairs) [force], and what it offers of the constants
      !> of laws.
      real(wp), allocatable :: normal_load(:)
      type(law_constants) :: constants
      !> The law of the pairs, a number in `law_words`; 0: left to the case.
      integer :: law = 0
      !> Coordinates of the pairs (3, n_pairs) [length] and the names of their patches (n_pairs).
      real(wp), allocatable :: position(:, :)
      type(string_type), allocatable :: patch(:)
      !> Nonlinear springs, with what the file says of them.
      type(spring_type) :: springs
      !> Loads (n_dof) [force]; the last per square of the rotation speed.
      real(wp), allocatable :: load_static(:), load_cosine(:), load_sine(:)
      real(wp), allocatable :: load_static_rotation(:)
      !> Observed quantities: rows of linear combinations of the dofs (n_observed, n_dof).
      type(string_type), allocatable :: observe_name(:)
      real(wp), allocatable :: observe_matrix(:, :)
      !> What makes the model a sector of a cyclic structure.
      type(cyclic_parts) :: cyclic
      !> Harmonics that loads act in (m), and their cosine and sine parts (n_dof, m) [force].
      integer, allocatable :: load_harmonic(:)
      real(wp), allocatable :: harmonic_cosine(:, :), harmonic_sine(:, :)
      !> Coriolis matrix per rotation speed, skew (n_dof, n_dof) [force/length/(rad/s)^2].
      real(wp), allocatable :: coriolis(:, :)
   contains
      procedure :: order
   end type file_model_type

contains

   !> Number of dofs: of matrices of nodal diameters, the displacements in front.
   pure integer function order(self)
      class(file_model_type), intent(in) :: self

      order = self%cyclic%n_physical
      if (allocated(self%stiffness)) order = size(self%stiffness, 1)
   end function order

   !> Read a model file.
   subroutine read_model_hdf5(path, model, error)
      character(*), intent(in) :: path
      type(file_model_type), intent(out) :: model
      !> status_io where the file cannot be read, status_input for what is wrong in it.
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file

      call file%open_read(path, error)
      if (allocated(error)) return
      allocate (model%files(1))
      model%files(1)%text = path
      ! In this order: the mass gives n_dof, the dofs of side 1 the number of pairs.
      call read_header(file, model, error)
      if (.not. allocated(error)) call read_members(file, model%cyclic%n_sectors, model%unread, &
                                                    error)
      if (.not. allocated(error)) call read_cyclic_file(file, model%cyclic, error)
      if (.not. allocated(error)) call read_structure(file, model, error)
      if (.not. allocated(error)) call read_air_file(file, model%order(), &
                                                     max(1, model%cyclic%n_sectors), &
                                                     model%cyclic%air, error)
      if (.not. allocated(error)) call read_contact(file, model, error)
      if (.not. allocated(error)) call read_spring_file(file, model%springs, error)
      if (.not. allocated(error)) call read_loads(file, model, error)
      if (.not. allocated(error)) call read_observed(file, model, error)
      call file%close(ignored)
   end subroutine read_model_hdf5

   !> What stands in a model file and nothing reads; an error where that is refused.
   subroutine list_unread(path, unread, error)
      character(*), intent(in) :: path
      type(string_type), allocatable, intent(out) :: unread(:)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file
      integer :: n_sectors

      ! HDF5 and functions of texts serve one thread at a time.
      !$omp critical (fretwear_io)
      call file%open_read(path, error)
      if (.not. allocated(error)) call read_members(file, n_sectors, unread, error)
      call file%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine list_unread

   !> The number of sectors, and what nothing reads: first, for a part that is missing may stand
   !> there under another name.
   subroutine read_members(file, n_sectors, unread, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(out) :: n_sectors
      type(string_type), allocatable, intent(out) :: unread(:)
      type(error_type), allocatable, intent(out) :: error
      !> Takes every number for that of a nodal diameter, where nothing says how many there are.
      integer, parameter :: many = 1000
      type(error_type), allocatable :: uncounted

      call count_sectors(file, n_sectors, uncounted)
      call find_strangers(file, merge(many, n_sectors, allocated(uncounted)), unread, error)
      if (.not. allocated(error)) call move_alloc(uncounted, error)
   end subroutine read_members

   !> Format and version, which are required, title and system of units, which are not.
   subroutine read_header(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: format
      integer :: format_version

      call read_attribute(file, '/', 'format', format, error)
      if (allocated(error)) return
      if (format /= format_name) then
         call fatal_error(error, file%path//': attribute format is "'//format// &
                          '", expected "'//format_name//'"', status_input)
         return
      end if
      call read_attribute(file, '/', 'format_version', format_version, error)
      if (allocated(error)) return
      if (format_version /= known_version) then
         call fatal_error(error, file%path//': attribute format_version is '// &
                          to_text(format_version)//', expected '//to_text(known_version), &
                          status_input)
         return
      end if
      if (has_attribute(file, '/', 'title')) then
         call read_attribute(file, '/', 'title', model%title, error)
         if (allocated(error)) return
      end if
      if (has_attribute(file, '/', 'unit_system')) then
         call read_attribute(file, '/', 'unit_system', model%unit_system, error)
      end if
   end subroutine read_header

   !> Matrices; only mass and stiffness are required. Symmetry is checked later (fw_read_model).
   subroutine read_structure(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      if (allocated(model%cyclic%nodal)) return
      call read_matrix(file, '/mass', 0, model%mass, error, required=.true.)
      if (allocated(error)) return
      n = size(model%mass, 1)
      call read_matrix(file, '/stiffness', n, model%stiffness, error, required=.true.)
      if (allocated(error)) return
      call read_matrix(file, '/damping', n, model%damping, error)
      if (allocated(error)) return
      call read_matrix(file, '/stiffness_rotation', n, model%stiffness_rotation, error)
      if (.not. allocated(error)) call read_matrix(file, '/coriolis', n, model%coriolis, error)
   end subroutine read_structure

   !> Pairs; a file without group /contact has none.
   subroutine read_contact(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      character(24), allocatable :: names(:)
      real(wp), allocatable :: values(:)
      integer :: k, n

      if (.not. file%exists('/contact')) return
      call read_dofs(file, '/contact/side_1', -1, model%side_1, error)
      if (allocated(error)) return
      n = size(model%side_1, 2)
      call read_dofs(file, '/contact/side_2', n, model%side_2, error)
      if (allocated(error)) return
      call read_pair_values(file, '/contact/mu', n, model%mu, error)
      if (allocated(error)) return
      call read_pair_values(file, '/contact/gap', n, model%gap, error)
      if (allocated(error)) return
      call read_pair_values(file, '/contact/area', n, model%area, error)
      if (allocated(error)) return
      call read_pair_values(file, '/contact/normal_load', n, model%normal_load, error)
      if (allocated(error)) return
      names = law_constant_names()
      do k = 1, size(names)
         call read_pair_values(file, '/contact/'//trim(names(k)), n, values, error)
         if (allocated(error)) return
         if (allocated(values)) call model%constants%offer(trim(names(k)), values)
      end do
      call read_law(file, model%law, error)
      if (allocated(error)) return
      call read_positions(file, '/contact/position', n, model%position, error)
      if (allocated(error)) return
      call read_names(file, '/contact/patch', n, model%patch, error)
      if (allocated(error) .or. .not. file%exists('/contact/sector_2')) return
      call read_dataset(file, '/contact/sector_2', model%cyclic%sector_2, error)
      if (allocated(error)) return
      if (size(model%cyclic%sector_2) == n) return
      call dataset_failure(file, '/contact/sector_2', 'has '// &
                           to_text(size(model%cyclic%sector_2))//' values, expected '// &
                           to_text(n), error)
   end subroutine read_contact

   !> The law of the pairs, by its word; a file need not have one.
   subroutine read_law(file, law, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(inout) :: law
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: word

      if (.not. has_attribute(file, '/contact', 'law')) return
      call read_attribute(file, '/contact', 'law', word, error)
      if (allocated(error)) return
      law = findloc(law_words == word, .true., dim=1)
      ! Left to the case, another law than the one that was meant would be solved.
      if (law > 0) return
      call fatal_error(error, file%path//': attribute law of /contact is "'//word// &
                       '", expected '//words_text(law_words), status_input)
   end subroutine read_law

   !> Loads; an absent one is zero.
   subroutine read_loads(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = model%order()
      call read_vector(file, '/load/static', n, model%load_static, error)
      if (allocated(error)) return
      call read_vector(file, '/load/cosine', n, model%load_cosine, error)
      if (allocated(error)) return
      call read_vector(file, '/load/sine', n, model%load_sine, error)
      if (allocated(error)) return
      call read_vector(file, '/load/static_rotation', n, model%load_static_rotation, error)
      if (.not. allocated(error)) call read_harmonic_loads(file, n, model, error)
   end subroutine read_loads

   !> Loads of other harmonics than the first.
   subroutine read_harmonic_loads(file, n, model, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: n
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: j, m

      if (.not. file%exists('/load/harmonic')) then
         do j = 1, size(wave_names)
            if (.not. file%exists(trim(wave_names(j)))) cycle
            call dataset_failure(file, trim(wave_names(j)), 'needs /load/harmonic, the '// &
                                 'harmonics of its rows', error)
            return
         end do
         return
      end if
      call read_dataset(file, '/load/harmonic', model%load_harmonic, error)
      if (allocated(error)) return
      m = size(model%load_harmonic)
      if (any(model%load_harmonic < 0)) then
         call dataset_failure(file, '/load/harmonic', 'holds '// &
                              to_text(minval(model%load_harmonic))//', expected 0, 1, ..', error)
         return
      end if
      if (m > 0 .and. .not. any([(file%exists(trim(wave_names(j))), j=1, size(wave_names))])) then
         call dataset_failure(file, '/load/harmonic', 'needs their loads, '// &
                              '/load/harmonic_cosine or /load/harmonic_sine', error)
         return
      end if
      if (m == 0) call refuse_rows(file, error)
      if (m == 0) return
      ! Rows of the file are columns here: `read_matrix` turns them, for it takes matrices.
      call read_rows(trim(wave_names(1)), model%harmonic_cosine)
      if (.not. allocated(error)) call read_rows(trim(wave_names(2)), model%harmonic_sine)

   contains

      subroutine read_rows(name, columns)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(inout) :: columns(:, :)
         real(wp), allocatable :: rows(:, :)

         if (.not. file%exists(name)) return
         call read_matrix(file, name, n, rows, error, n_rows=m)
         if (.not. allocated(error)) columns = transpose(rows)
      end subroutine read_rows

   end subroutine read_harmonic_loads

   !> Loads of no harmonics have no rows.
   subroutine refuse_rows(file, error)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      integer :: j

      do j = 1, size(wave_names)
         if (.not. file%exists(trim(wave_names(j)))) cycle
         call get_shape(file, trim(wave_names(j)), dims, error)
         if (allocated(error)) return
         if (product(dims) == 0) cycle
         call dataset_failure(file, trim(wave_names(j)), 'has shape '//shape_text(dims)// &
                              ', but /load/harmonic is empty', error)
         return
      end do
   end subroutine refuse_rows

   !> Observed quantities: by dof numbers, or by a matrix of factors.
   subroutine read_observed(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      logical :: by_dof, by_matrix

      if (.not. file%exists('/observe')) return
      by_dof = file%exists('/observe/dof')
      by_matrix = file%exists('/observe/matrix')
      if (allocated(model%cyclic%nodal) .and. .not. (by_dof .or. by_matrix)) then
         ! The rows stand with the nodal diameters.
         call read_names(file, '/observe/name', -1, model%observe_name, error, required=.true.)
         return
      end if
      if (by_dof .eqv. by_matrix) then
         call fatal_error(error, file%path//': group /observe holds '// &
                          trim(merge('both   ', 'neither', by_dof))// &
                          ' of the datasets dof and matrix, expected one', status_input)
         return
      end if
      call read_names(file, '/observe/name', -1, model%observe_name, error, required=.true.)
      if (allocated(error)) return
      if (by_matrix) then
         call read_matrix(file, '/observe/matrix', model%order(), model%observe_matrix, &
                          error, n_rows=size(model%observe_name))
      else
         call read_observed_dofs(file, model, error)
      end if
   end subroutine read_observed

   !> Turn signed dof numbers into rows of the observation matrix.
   subroutine read_observed_dofs(file, model, error)
      type(hdf5_file), intent(in) :: file
      type(file_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: dof(:)
      integer :: i, n

      n = model%order()
      call read_dataset(file, '/observe/dof', dof, error)
      if (allocated(error)) return
      if (size(dof) /= size(model%observe_name)) then
         call dataset_failure(file, '/observe/dof', 'has '//to_text(size(dof))// &
                              ' values, expected one per name: '// &
                              to_text(size(model%observe_name)), error)
         return
      end if
      allocate (model%observe_matrix(size(dof), n), source=0.0_wp)
      do i = 1, size(dof)
         if (dof(i) == 0 .or. abs(dof(i)) > n) then
            call dataset_failure(file, '/observe/dof', 'holds '//to_text(dof(i))// &
                                 ' at index '//to_text(i - 1)//', expected 1 to '//to_text(n)// &
                                 ' or its negative', error)
            return
         end if
         ! A negative number observes the dof with its sign turned.
         model%observe_matrix(i, abs(dof(i))) = real(sign(1, dof(i)), wp)
      end do
   end subroutine read_observed_dofs

end module fw_model_file
