!> The linear structure of a case: groups &model and &load, from the namelist, a model file or
!> the calling program.
!>
!> The source is chosen first, because it decides which other keys may be given. `raw` collects the
!> parts from whatever source; finish_model checks them and adds rotation and damping.
module fw_read_model
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_cyclic_data, only: cyclic_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_hdf5, only: has_attribute, hdf5_file, read_attribute
   use fw_load_terms, only: add_wave, load_terms
   use fw_matrix_checks, only: check_entries, check_matrix, check_skew, check_vector
   use fw_matrix_market, only: read_matrix_market_model
   use fw_model, only: model_type
   use fw_model_file, only: read_model_hdf5
   use fw_raw_model, only: raw_model
   use fw_model_forming, only: find_changes, finish_structure, form_matrices, goes_alone, &
      model_origin
   use fw_model_keys, only: model_options, bind_order, bind_matrices, bind_n_rows, bind_rows, &
      bind_loads, bind_table, source_words, source_inline, source_hdf5, source_matrix_market, &
      source_memory
   use fw_paths, only: resolve_path
   use fw_read_base, only: check_supports, read_motion => read_base
   use fw_read_nodal, only: finish_nodal
   use fw_read_waves, only: gather_waves, read_terms
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   use fw_trial, only: trial_type, try_file
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: read_model, read_loads, read_motion, finish_model, find_unit_system, stand_alone

   !> Rows are divided by their largest weight.
   real(wp), parameter :: least_weight = 1.0e-100_wp

   !> HDF5 can crash over a damaged file: reading is tried in a process of its own first.
   type, extends(trial_type) :: model_trial
   contains
      procedure :: read => read_in_trial
   end type model_trial

contains

   !> Group &model: the matrices as they are given, before rotation and damping.
   subroutine read_model(reader, directory, options, raw, n_dof, error, memory_model)
      type(reader_type), intent(inout) :: reader
      !> Of the namelist; relative files start there.
      character(*), intent(in) :: directory
      type(model_options), intent(inout) :: options
      !> What the model consists of, whatever its source.
      type(raw_model), intent(out) :: raw
      integer, intent(out) :: n_dof
      type(error_type), allocatable, intent(out) :: error
      !> What the calling program hands over, with mass and stiffness.
      type(raw_model), intent(in), optional :: memory_model
      character(:), allocatable :: message
      logical :: is_inline, is_file

      call choose_source(reader, present(memory_model), options)
      is_inline = options%source == source_inline
      is_file = options%source == source_hdf5 .or. options%source == source_matrix_market
      call options%bind_file(reader)
      n_dof = 0
      if (present(memory_model)) then
         raw = memory_model
         reader%in_memory = .true.
      else if (is_file .and. allocated(options%file)) then
         call read_file(reader, directory, options, raw, error)
         if (allocated(error)) return
      end if
      ! Before the order is asked for, which a stiffness at rest may have to give.
      call raw%find_growth(message)
      if (allocated(message)) call reader%refuse_model(message)
      n_dof = raw%order()
      if (allocated(options%file) .and. .not. is_file) then
         call reader%refuse('model', 'file', "is given, but source = '"// &
                            trim(source_words(options%source))//"': give source = "// &
                            "'hdf5' or 'matrix_market', or remove file")
      end if
      call take_unit_system(reader, options, raw)
      if (.not. allocated(raw%bodies)) allocate (raw%bodies)
      call read_matrices(reader, is_inline, n_dof, raw, needed=is_inline .and. &
                         .not. allocated(options%file))
      call read_rows(reader, n_dof, raw)
      call options%bind_additions(reader)
      call read_bodies(reader, n_dof, raw)
   end subroutine read_model

   !> Bodies that no spring holds join the mass and the load of the rotation.
   subroutine read_bodies(reader, n_dof, raw)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_dof
      type(raw_model), intent(inout) :: raw
      character(100) :: fault

      if (raw%bodies%count() == 0 .and. reader%given('body', 'mass')) then
         call reader%refuse('body', 'mass', 'is given, but the model has no bodies (/body): '// &
                            'remove it, or make the model with fretwear.damper')
      end if
      call raw%bodies%bind_keys(reader)
      if (reader%failed() .or. raw%bodies%count() == 0) return
      call raw%bodies%find_fault(n_dof, fault)
      if (len_trim(fault) > 0) then
         call reader%refuse_model(trim(fault))
         return
      end if
      ! Matrices of nodal diameters take them one by one.
      if (allocated(raw%mass)) call raw%bodies%join(n_dof, raw%mass, raw%growth%load)
   end subroutine read_bodies

   !> Displacements that are combinations of dofs, on top of those of a file.
   subroutine read_rows(reader, n_dof, raw)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_dof
      type(raw_model), intent(inout) :: raw
      integer :: n, n_file, r

      n_file = 0
      if (allocated(raw%rows)) n_file = size(raw%rows, 2)
      n = n_file
      call bind_n_rows(reader, n_dof, n)
      if (reader%given('model', 'row') .and. .not. reader%given('model', 'n_rows')) then
         call reader%refuse('model', 'n_rows', 'is missing: must be the number of rows')
      end if
      ! Other rows than those of the file.
      if (n /= n_file .and. allocated(raw%rows)) deallocate (raw%rows)
      call bind_rows(reader, n > 0 .and. .not. allocated(raw%rows), raw%rows)
      if (reader%failed() .or. .not. allocated(raw%rows)) return
      if (n == 0) then
         deallocate (raw%rows)
         return
      end if
      if (size(raw%rows, 1) /= n_dof) then
         call reader%refuse_model('a row/matrix with rows of '//to_text(size(raw%rows, 1))// &
                                  ' dofs: must be '//to_text(n_dof))
         return
      end if
      do r = 1, n
         if (.not. all(ieee_is_finite(raw%rows(:, r)))) then
            call refuse_row('has a weight that is not finite: must be numbers')
         else if (maxval(abs(raw%rows(:, r))) < least_weight) then
            call refuse_row('has no weight: must not be zero')
         else
            cycle
         end if
         return
      end do

   contains

      !> Where it was given.
      subroutine refuse_row(message)
         character(*), intent(in) :: message

         if (reader%given('model', 'row')) then
            call reader%refuse('model', 'row', 'of number '//to_text(r)//' '//message)
         else
            call reader%refuse_model('a row/matrix whose row '//to_text(r)//' '//message)
         end if
      end subroutine refuse_row

   end subroutine read_rows

   !> What the case says of the units, or the model; not both, where they differ.
   subroutine take_unit_system(reader, options, raw)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(inout) :: raw

      if (.not. allocated(options%unit_system)) return
      if (allocated(raw%unit_system)) then
         if (len_trim(raw%unit_system) > 0 .and. raw%unit_system /= options%unit_system) then
            call reader%refuse('model', 'unit_system', '= '//quoted_text(options%unit_system)// &
                               ': the model says '//quoted_text(raw%unit_system)//': remove it')
            return
         end if
      end if
      raw%unit_system = options%unit_system
   end subroutine take_unit_system

   !> The units of the model before anything else of it is read; empty where nothing says them, or
   !> where the file cannot be read, which is told when the model is.
   subroutine find_unit_system(reader, directory, system, memory_model)
      type(reader_type), intent(in) :: reader
      character(*), intent(in) :: directory
      character(:), allocatable, intent(out) :: system
      type(raw_model), intent(in), optional :: memory_model
      type(hdf5_file) :: file
      type(error_type), allocatable :: error
      character(:), allocatable :: path

      system = reader%text_of('model', 'unit_system')
      if (len(system) > 0) return
      if (present(memory_model)) then
         if (allocated(memory_model%unit_system)) system = memory_model%unit_system
         return
      end if
      ! A prefix of Matrix Market files is no file, or none of HDF5: it says no units.
      path = in_directory(reader%text_of('model', 'file'), directory)
      if (path == directory) return
      ! A damaged file ends the trial, and not the program.
      if (reader%tries_files) call try_file(model_trial(), path, error)
      if (.not. allocated(error)) call file%open_read(path, error)
      if (allocated(error)) return
      if (has_attribute(file, '/', 'unit_system')) then
         call read_attribute(file, '/', 'unit_system', system, error)
         if (.not. allocated(system)) system = ''
      end if
      call file%close(error)
   end subroutine find_unit_system

   !> Key `source`; the matrices of the calling program need no group &model.
   subroutine choose_source(reader, in_memory, options)
      type(reader_type), intent(inout) :: reader
      logical, intent(in) :: in_memory
      type(model_options), intent(inout) :: options

      if (in_memory) then
         options%source = source_memory
      else
         call reader%require_group('model', 'the matrices: source and file, or n_dof, '// &
                                   'mass and stiffness')
      end if
      call options%bind_source(reader)
      if (in_memory .and. options%source /= source_memory) then
         call reader%refuse('model', 'source', "= '"//trim(source_words(options%source))// &
                            "': the calling program gives its own matrices: leave source out")
      else if (options%source == source_memory .and. .not. in_memory) then
         call reader%refuse('model', 'source', "= 'memory': is for programs that hand their "// &
                            "matrices to the library: use 'hdf5', 'matrix_market' or 'inline'")
      end if
   end subroutine choose_source

   !> A model file; the effective input holds its absolute path.
   subroutine read_file(reader, directory, options, raw, error)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: directory
      type(model_options), intent(inout) :: options
      type(raw_model), intent(out) :: raw
      type(error_type), allocatable, intent(out) :: error

      call reader%amend('model', 'file', quoted_text(resolve_path(options%file, directory)))
      if (options%source == source_hdf5) then
         if (reader%tries_files) then
            call try_file(model_trial(), in_directory(options%file, directory), error)
         end if
         if (.not. allocated(error)) then
            call read_model_hdf5(in_directory(options%file, directory), raw, error)
         end if
      else
         call read_matrix_market_model(in_directory(options%file, directory), raw, error)
      end if
      if (allocated(error)) error%message = reader%place_of('model', 'file')//': '//error%message
   end subroutine read_file

   !> What is read is forgotten: the trial only has to return from it.
   subroutine read_in_trial(self, path)
      class(model_trial), intent(in) :: self
      character(*), intent(in) :: path
      type(raw_model) :: model
      type(error_type), allocatable :: ignored

      associate (unused => self)
      end associate
      call read_model_hdf5(path, model, ignored)
   end subroutine read_in_trial

   !> The inline matrices, or the refusal of them beside a model file.
   subroutine read_matrices(reader, is_inline, n_dof, raw, needed)
      type(reader_type), intent(inout) :: reader
      logical, intent(in) :: is_inline
      !> Dofs of the model file on entry.
      integer, intent(inout) :: n_dof
      type(raw_model), intent(inout) :: raw
      !> Not beside a file whose source is missing: that is said, and is enough.
      logical, intent(in) :: needed
      real(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :), structural(:, :)
      real(wp), allocatable :: circulatory(:, :), more_stiffness(:, :), more_damping(:, :)
      integer :: n_file

      n_file = n_dof
      call bind_order(reader, n_dof, needed)
      if (.not. is_inline .and. n_dof /= n_file) then
         call reader%refuse('model', 'n_dof', '= '//to_text(n_dof)//': the model has '// &
                            to_text(n_file)//' dofs; remove n_dof')
      end if
      call bind_matrices(reader, needed, mass, stiffness, damping, structural, circulatory, &
                         more_stiffness, more_damping)
      call take('mass', mass, raw%mass)
      call take('stiffness', stiffness, raw%stiffness)
      call take('damping', damping, raw%damping)
      call take('structural_damping', structural, raw%structural_damping)
      call take('circulatory', circulatory, raw%circulatory)
      call take('stiffness_unsymmetric', more_stiffness, raw%stiffness_unsymmetric)
      call take('damping_unsymmetric', more_damping, raw%damping_unsymmetric)

   contains

      !> An inline matrix becomes the model's; beside a complete model it is refused.
      subroutine take(key, given, matrix)
         character(*), intent(in) :: key
         real(wp), allocatable, intent(inout) :: given(:, :), matrix(:, :)

         if (is_inline) then
            call move_alloc(given, matrix)
         else if (allocated(given)) then
            call reader%refuse('model', key, 'is given beside a model that is complete: remove '// &
                               "it, or give source = 'inline'")
         end if
      end subroutine take

   end subroutine read_matrices

   !> Group &load: replaces the loads of a model file, then scales.
   subroutine read_loads(reader, options, raw, terms)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(inout) :: options
      type(raw_model), intent(inout) :: raw
      !> Loads in any harmonic.
      type(load_terms), intent(inout) :: terms

      call bind_loads(reader, raw%load_static, raw%load_cosine, raw%load_sine)
      call read_terms(reader, terms)
      call read_table(reader, raw)
      call options%bind_scales(reader)
   end subroutine read_loads

   !> The table of the frequency; that of a file stays where nothing is given.
   subroutine read_table(reader, raw)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(inout) :: raw
      integer :: k, n, n_file

      n_file = 0
      if (allocated(raw%table_frequency)) n_file = size(raw%table_frequency)
      n = n_file
      if (reader%given('load', 'table_frequency') .and. .not. reader%given('load', 'n_table')) then
         call reader%refuse('load', 'n_table', 'is missing: must be the number of points')
      end if
      if (reader%given('load', 'n_table') .and. allocated(raw%table_frequency)) then
         deallocate (raw%table_frequency, raw%table_scale)
      end if
      call bind_table(reader, n, raw%table_frequency, raw%table_scale)
      if (reader%failed()) return
      if (n == 0) then
         if (allocated(raw%table_frequency)) deallocate (raw%table_frequency)
         if (allocated(raw%table_scale)) deallocate (raw%table_scale)
         return
      end if
      if (n == 1) call reader%refuse('load', 'n_table', '= 1: must be 0, or 2 points at least')
      do k = 2, n
         if (raw%table_frequency(k) > raw%table_frequency(k - 1)) cycle
         call reader%refuse('load', 'table_frequency', 'does not rise at point '//to_text(k)// &
                            ': must rise from point to point')
         return
      end do
   end subroutine read_table

   !> With a table all vibratory loads are waves, which it multiplies.
   pure subroutine take_table(raw, model)
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model
      integer :: w

      if (.not. allocated(raw%table_scale)) return
      w = model%waves%place(1, 0)
      if (w == 0) then
         call add_wave(1, 0, size(model%load_cosine), model%waves, model%load_wave)
         w = model%waves%n_waves()
      end if
      model%load_wave(:, 2*w - 1) = model%load_wave(:, 2*w - 1) + model%load_cosine
      model%load_wave(:, 2*w) = model%load_wave(:, 2*w) + model%load_sine
      model%load_cosine = 0.0_wp
      model%load_sine = 0.0_wp
      model%waves%table_frequency = raw%table_frequency
      model%waves%table_scale = raw%table_scale
      model%base_waves%table_frequency = raw%table_frequency
      model%base_waves%table_scale = raw%table_scale
   end subroutine take_table

   !> Check the parts and put them together: rotation, damping, scales.
   subroutine finish_model(reader, options, raw, terms, model, origin, error, wanted)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(inout) :: raw
      type(load_terms), intent(in) :: terms
      type(model_type), intent(inout) :: model
      !> Filled where it is allocated, for a structure that is to be formed again.
      type(model_origin), allocatable, intent(inout) :: origin
      type(error_type), allocatable, intent(out) :: error
      !> Parameters of fw_parameters by which responses are to be differentiated.
      integer, intent(in) :: wanted(:)
      real(wp) :: static(raw%order())

      if (allocated(raw%unit_system)) model%unit_system = raw%unit_system
      if (allocated(raw%rows)) model%rows = raw%rows
      if (options%speed_order > 0.0_wp) call check_speed_order(reader, options, raw, model)
      call take_whirl(reader, options, raw, model)
      call gather_waves(reader, raw, terms, model%cyclic, size(static), model%waves, &
                        model%load_wave, static)
      model%harmonic_scale = options%harmonic_scale
      model%static_scale = options%static_scale
      if (allocated(model%load_wave)) model%load_wave = options%harmonic_scale*model%load_wave
      if (allocated(raw%cyclic%nodal)) then
         if (allocated(raw%table_scale)) call reader%refuse('load', 'n_table', 'does not go '// &
            'with matrices of nodal diameters: give a load that holds at all frequencies')
         call finish_nodal(reader, options, raw, static, model, error)
         if (.not. allocated(error)) call find_changes(options, raw, wanted, model, error)
         return
      end if
      call check_parts(reader, raw, options%source == source_inline)
      if (reader%failed()) return
      model%load_cosine = options%harmonic_scale*raw%load_cosine
      model%load_sine = options%harmonic_scale*raw%load_sine
      call check_rotation(reader, options%rotation_speed, options%speed_order, raw)
      if (allocated(origin)) then
         origin%options = options
         origin%raw = raw
         origin%static = static
         origin%wanted = wanted
      end if
      call form_matrices(options, raw, static, model)
      call check_supports(reader, raw%base, allocated(raw%coriolis), model)
      if (reader%failed()) return
      call raw%base%apply(options%harmonic_scale, options%static_scale, options%rotation_speed, &
                          raw%coriolis, model)
      call take_table(raw, model)
      ! Large ones make room for what is to come.
      if (size(wanted) == 0 .and. .not. allocated(origin)) then
         deallocate (raw%mass, raw%stiffness)
         if (allocated(raw%damping)) deallocate (raw%damping)
         if (allocated(raw%growth%stiffness)) deallocate (raw%growth%stiffness)
      end if
      call finish_structure(options, raw, wanted, model, error)
   end subroutine finish_model

   !> A speed that nothing depends on, or at which the model is not known.
   subroutine check_rotation(reader, speed, order, raw)
      type(reader_type), intent(inout) :: reader
      !> [rad/s]; order: of a speed that follows the frequency, else 0.
      real(wp), intent(in) :: speed, order
      type(raw_model), intent(in) :: raw

      if (order <= 0.0_wp .and. (speed < raw%growth%lowest .or. &
                                 speed > raw%growth%highest)) then
         call reader%refuse('model', 'rotation_speed', '= '//to_text(speed)//': the model is '// &
                            'known at speeds (speed/value) from '// &
                            to_text(raw%growth%lowest)//' to '//to_text(raw%growth%highest)// &
                            ' rad/s: must be one of these')
         return
      end if
      if (speed <= 0.0_wp .or. rotates(raw)) return
      call reader%refuse('model', 'rotation_speed', 'is given, but the model has no '// &
                         'stiffness_rotation, no coriolis, no circulatory, no load '// &
                         'static_rotation, no body with a radius and no contact gap_rotation '// &
                         'or normal_load_rotation: remove it, or use a model file that holds them')
   end subroutine check_rotation

   !> A speed that follows the frequency.
   subroutine check_speed_order(reader, options, raw, model)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(in) :: model
      character(:), allocatable :: reason

      if (options%rotation_speed > 0.0_wp) then
         reason = 'does not go with model%rotation_speed: the speed follows the frequency; '// &
                  'keep one of the two'
      else if (model%cyclic%has_nodal()) then
         reason = 'does not go with matrices of nodal diameters: give model%rotation_speed, '// &
                  'speed by speed'
      else if (.not. rotates(raw)) then
         reason = 'is given, but nothing of the model depends on the rotation speed '// &
                  '(stiffness_rotation, coriolis, circulatory, load static_rotation, contact '// &
                  'gap_rotation, normal_load_rotation): remove it'
      else if (options%modal_damping > 0.0_wp .and. (model%cyclic%has_sectors() &
               .or. allocated(raw%growth%stiffness))) then
         reason = 'does not go with model%modal_damping, whose modes would change with '// &
                  'the speed: give damping, or rayleigh_stiffness'
      end if
      if (allocated(reason)) call reader%refuse('sweep', 'speed_order', reason)
   end subroutine check_speed_order

   !> Whether anything depends on the rotation speed.
   pure logical function rotates(raw)
      type(raw_model), intent(in) :: raw

      rotates = raw%growth%exists() .or. allocated(raw%load_static_rotation) .or. &
                allocated(raw%coriolis) .or. allocated(raw%circulatory) .or. &
                raw%contact%has_growth()
   end function rotates

   !> A model that is no sector becomes the only one where its matrices ask for it.
   subroutine stand_alone(options, raw, cyclic)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(cyclic_type), intent(inout) :: cyclic

      if (cyclic%is_cyclic) return
      cyclic%is_alone = goes_alone(options, raw)
      if (.not. cyclic%is_alone) return
      cyclic%is_cyclic = .true.
      cyclic%n_sectors = 1
      cyclic%engine_order = 0
   end subroutine stand_alone

   !> Coriolis forces at speed and forces of the air, which cyclic structures have.
   subroutine take_whirl(reader, options, raw, model)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(inout) :: raw
      type(model_type), intent(inout) :: model
      character(:), allocatable :: message

      if (allocated(raw%cyclic%air)) model%cyclic%air = raw%cyclic%air
      if (.not. allocated(raw%coriolis)) return
      call check_skew(raw%coriolis, raw%order(), message)
      if (allocated(message)) then
         call reader%refuse_model('a coriolis matrix that '//message)
      else if (options%rotation_speed > 0.0_wp) then
         model%cyclic%coriolis = options%rotation_speed*raw%coriolis
      end if
   end subroutine take_whirl

   !> Finite, symmetric, of the same size.
   subroutine check_parts(reader, raw, is_inline)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(inout) :: raw
      logical, intent(in) :: is_inline
      character(:), allocatable :: message
      integer :: i, n_dof

      if (reader%failed()) return
      n_dof = size(raw%stiffness, 1)
      call check_one('mass', raw%mass)
      call check_one('stiffness', raw%stiffness)
      if (allocated(raw%damping)) call check_one('damping', raw%damping)
      if (allocated(raw%growth%stiffness) .and. .not. allocated(raw%speeds%at)) then
         call check_one('stiffness_rotation', raw%growth%stiffness(:, :, 1))
      end if
      if (allocated(raw%speeds%at)) then
         do i = 1, size(raw%speeds%at)
            associate (here => raw%speeds%at(i))
               if (allocated(here%stiffness)) call check_one('speed/'//to_text(i - 1)// &
                                                             '/stiffness', here%stiffness)
            end associate
         end do
         deallocate (raw%speeds%at)
      end if
      if (allocated(raw%structural_damping)) then
         call check_one('structural_damping', raw%structural_damping)
      end if
      call check_any('circulatory', raw%circulatory)
      call check_any('stiffness_unsymmetric', raw%stiffness_unsymmetric)
      call check_any('damping_unsymmetric', raw%damping_unsymmetric)
      if (.not. allocated(raw%growth%load)) return
      call check_vector(raw%growth%load(:, 1), n_dof, message)
      if (allocated(message)) then
         call reader%refuse_model('a load '//trim(merge('speed/I/static ', 'static_rotation', &
                                  allocated(raw%speeds%value)))//' that '//message)
      end if

   contains

      !> What is wrong inline is blamed on the key, else on whoever holds the model.
      subroutine check_one(key, matrix)
         character(*), intent(in) :: key
         real(wp), intent(inout) :: matrix(:, :)
         character(:), allocatable :: message

         call check_matrix(matrix, n_dof, key == 'mass', message)
         call blame(key, message)
      end subroutine check_one

      !> A matrix of any shape, which may not be there.
      subroutine check_any(key, matrix)
         character(*), intent(in) :: key
         real(wp), allocatable, intent(in) :: matrix(:, :)
         character(:), allocatable :: message

         if (.not. allocated(matrix)) return
         call check_entries(matrix, n_dof, message)
         call blame(key, message)
      end subroutine check_any

      subroutine blame(key, message)
         character(*), intent(in) :: key
         character(:), allocatable, intent(in) :: message

         if (.not. allocated(message)) return
         if (is_inline) then
            call reader%refuse('model', key, message)
         else
            call reader%refuse_model('a '//key//' that '//message)
         end if
      end subroutine blame

   end subroutine check_parts

   !> A relative file starts at the folder of the namelist, whose name ends in its slash.
   pure function in_directory(file, directory) result(path)
      character(*), intent(in) :: file, directory
      character(:), allocatable :: path

      path = file
      if (index(file, '/') /= 1) path = directory//file
   end function in_directory

end module fw_read_model
