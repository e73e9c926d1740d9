!> From a namelist file to a validated case.
module fw_read_case
   use fw_combinations, only: check_combinations
   use fw_case, only: analyses, case_type
   use fw_contact_data, only: contact_type, memory_carried, memory_residual, sliding_path
   use fw_error, only: error_type, fatal_error, status_input
   use fw_harmonics_options, only: method_hbm, most_for_accuracy, sampling_uniform, usual_accuracy
   use fw_kinds, only: wp
   use fw_laws, only: law_words, usual_law
   use fw_load_terms, only: load_terms
   use fw_raw_model, only: raw_model
   use fw_model_forming, only: find_changes, form_structure
   use fw_model_keys, only: model_options
   use fw_parameter_sweep, only: as_factor
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: is_of_matrices, is_of_sectors
   use fw_paths, only: directory_of, read_text_file, resolve_path, stem_of
   use fw_read_elements, only: check_gap_orders, read_contact, read_elements, read_obstacle, &
      read_springs, user_element
   use fw_read_cyclic, only: check_sectors, read_cyclic, read_mistuning
   use fw_read_model, only: find_unit_system, read_model, read_loads, read_motion, finish_model, &
      stand_alone
   use fw_read_nodal, only: find_nodal_stress
   use fw_read_options, only: read_campbell, read_harmonics, read_mission, read_mode, &
      read_population, read_stress, read_sweep
   use fw_read_output, only: read_control, read_output, read_observed
   use fw_read_resonance, only: check_resonance, read_resonance
   use fw_read_sensitivity, only: check_sensitivity, finish_sensitivity, read_sensitivity
   use fw_read_stuck, only: check_damped_joint, take_damped_joint
   use fw_read_worn, only: read_worn
   use fw_reader, only: reader_type, new_reader
   use fw_reader_text, only: printable
   use fw_records, only: record_list
   use fw_resonance_options, only: resonance_as_factor => as_factor
   use fw_solver_options, only: continuation_natural
   use fw_text, only: lower_case, string_type, to_text
   use fw_text_list, only: append
   use fw_unit_values, only: convert_units, has_units, needs_system
   use fw_values, only: number_text, quoted_text
   implicit none (type, external)
   private

   public :: case_input, read_case, read_case_text, read_input, list_keys

   !> What a case is read from. To be filled one by one: gfortran 12 loses texts that a structure
   !> constructor is given.
   type :: case_input
      !> Of the namelist: for messages, for relative files in it, and for the default name of the
      !> result file.
      character(:), allocatable :: path
      !> `group%key=value` each, as after --set.
      type(string_type), allocatable :: overrides(:)
      !> The namelist; where it is not allocated, the file of that path.
      character(:), allocatable :: text
      !> What messages put before an override (default: '--set').
      character(:), allocatable :: origin
      !> Try model files in a process of their own first: for programs of one thread.
      logical :: tries_files = .false.
      !> One of the cases that are read from a source which another has kept.
      logical :: is_changed = .false.
      !> Elements with laws that the calling program has added.
      type(user_element), allocatable :: laws(:)
   end type case_input

   !> Harmonics of a nonlinear mode, a resonance or a controlled response where nothing is said of
   !> them: frequencies to some 1e-5.
   integer, parameter :: usual_harmonics = 7

contains

   !> Read a case from a namelist file.
   subroutine read_case(path, overrides, case, error)
      character(*), intent(in) :: path
      !> `group%key=value` each, as after --set.
      type(string_type), intent(in) :: overrides(:)
      type(case_type), intent(out) :: case
      type(error_type), allocatable, intent(out) :: error
      type(case_input) :: input

      input%path = path
      input%overrides = overrides
      call read_input(input, case, error)
   end subroutine read_case

   !> Read a case from namelist text.
   subroutine read_case_text(text, path, overrides, case, error)
      character(*), intent(in) :: text, path
      type(string_type), intent(in) :: overrides(:)
      type(case_type), intent(out) :: case
      type(error_type), allocatable, intent(out) :: error
      type(case_input) :: input

      input%path = path
      input%overrides = overrides
      input%text = text
      call read_input(input, case, error)
   end subroutine read_case_text

   !> Read a case. The handling of texts serves one thread at a time (gfortran keeps the lengths of
   !> texts that functions return in static memory), and so does HDF5: every reading waits for its
   !> turn.
   subroutine read_input(input, case, error, memory_model)
      type(case_input), intent(in) :: input
      type(case_type), intent(out) :: case
      type(error_type), allocatable, intent(out) :: error
      !> The model where the calling program gives it, with mass and stiffness.
      type(raw_model), intent(in), optional :: memory_model

      !$omp critical (fretwear_io)
      call read_groups(input, case, error, memory_model)
      if (allocated(error)) error%message = printable(error%message)
      !$omp end critical (fretwear_io)
   end subroutine read_input

   !> The same, with messages that may hold any byte of the text.
   subroutine read_groups(input, case, error, memory_model)
      type(case_input), intent(in) :: input
      type(case_type), intent(inout) :: case
      type(error_type), allocatable, intent(out) :: error
      type(raw_model), intent(in), optional :: memory_model
      type(reader_type) :: reader
      character(:), allocatable :: text

      if (allocated(input%text)) then
         text = input%text
      else
         call read_text_file(input%path, text, error)
         if (allocated(error)) return
      end if
      call new_reader(reader, text, input%path, input%overrides, error, input%origin)
      if (allocated(error)) return
      reader%tries_files = input%tries_files
      call read_units(reader, input%path, error, memory_model)
      if (allocated(error)) return
      call read_keys(reader, input%path, case, error, memory_model, input%laws)
      if (allocated(error)) return
      call choose_law(reader, case)
      call choose_harmonics(reader, case)
      call finish_sensitivity(reader, case)
      call reader%finish(error)
      if (allocated(error)) return
      case%namelist = reader%effective()
      if (case%is_source() .and. .not. input%is_changed) then
         call keep_source(input, case, memory_model)
      end if
      call check_combinations(case, error)
      if (.not. allocated(error)) call check_resonance(case, error)
      if (.not. allocated(error)) call check_sensitivity(case, error)
   end subroutine read_groups

   !> What other cases are read from.
   subroutine keep_source(input, case, memory_model)
      type(case_input), intent(in) :: input
      type(case_type), intent(inout) :: case
      type(raw_model), intent(in), optional :: memory_model

      allocate (case%source)
      associate (source => case%source)
         source%path = input%path
         if (allocated(input%text)) source%text = input%text
         source%overrides = input%overrides
         source%tries_files = input%tries_files
         if (present(memory_model)) source%model = memory_model
         if (allocated(input%laws)) source%laws = input%laws
      end associate
   end subroutine keep_source

   !> Values with units become numbers, if there are any.
   subroutine read_units(reader, path, error, memory_model)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      type(raw_model), intent(in), optional :: memory_model
      type(record_list) :: keys
      character(:), allocatable :: system

      if (.not. has_units(reader)) return
      call list_keys(keys)
      system = reader%text_of('model', 'unit_system')
      if (needs_system(reader, keys)) then
         call find_unit_system(reader, directory_of(path), system, memory_model)
      end if
      call convert_units(reader, keys, system)
      call reader%raise(error)
   end subroutine read_units

   !> Where a law was not given, take the one that is right, in the effective input too: rigid
   !> friction of high order, which is right on masses and on nodes without mass, where the rest of
   !> the case goes with it; else rigid friction at the instants.
   subroutine choose_law(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(inout) :: case

      if (reader%given('contact', 'law') .or. case%contact%n_pairs == 0) return
      ! What was saved with the pairs is as good as given.
      if (case%contact%law_is_of_model) return
      associate (contact => case%contact)
         contact%law = usual_law(goes_with_events(case))
         ! Integrated in time, the rigid laws are one, and nothing was chosen.
         contact%law_is_chosen = .not. analyses(case%analysis)%is_integrated
         call reader%amend('contact', 'law', quoted_text(trim(law_words(contact%law))))
      end associate
   end subroutine choose_law

   !> Whether nothing asks for instants: where forces are followed from event to event by
   !> themselves. Integration in time knows one rigid law only, slip in two directions has no law of
   !> high order, and neither has a structure that feeds its vibration.
   pure logical function goes_with_events(case) result(goes)
      type(case_type), intent(in) :: case

      associate (h => case%harmonics, c => case%contact)
         goes = analyses(case%analysis)%is_balanced .and. &
                h%method == method_hbm .and. h%sampling /= sampling_uniform .and. &
                h%n_time == 0 .and. .not. case%output%histories .and. &
                .not. any(all(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1)) .and. &
                .not. feeds_energy(case) .and. &
                .not. (c%slides() .and. c%sliding == sliding_path) .and. &
                c%memory /= memory_residual .and. &
                .not. (allocated(c%slider_1) .or. allocated(c%slider_2))
      end associate
   end function goes_with_events

   !> Whether a dof is damped negatively: an oscillator that takes energy has no path to follow.
   pure logical function feeds_energy(case) result(feeds)
      type(case_type), intent(in) :: case
      integer :: i

      feeds = .false.
      if (.not. allocated(case%model%damping)) return
      do i = 1, size(case%model%damping, 1)
         feeds = feeds .or. case%model%damping(i, i) < 0.0_wp
      end do
   end function feeds_energy

   !> Where nothing is said of the harmonics, an accuracy chooses them, if the rest of the case goes
   !> with one: a single harmonic says little of friction and gaps.
   subroutine choose_harmonics(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(inout) :: case

      if (reader%given('harmonics', 'n_harmonics')) return
      if (reader%given('harmonics', 'accuracy')) return
      if (case%sensitivity%is_wanted()) return
      if (analyses(case%analysis)%finds_frequency .or. &
          analyses(case%analysis)%is_range .or. case%control%is_wanted()) then
         case%harmonics%n_harmonics = usual_harmonics
         call reader%amend('harmonics', 'n_harmonics', to_text(usual_harmonics))
         return
      end if
      if (.not. case%is_nonlinear() .or. .not. goes_with_accuracy(case)) return
      case%harmonics%accuracy = usual_accuracy
      case%harmonics%n_harmonics = most_for_accuracy
      case%harmonics%is_chosen = .true.
      call reader%amend('harmonics', 'accuracy', number_text(usual_accuracy))
      call reader%amend('harmonics', 'n_harmonics', to_text(most_for_accuracy))
   end subroutine choose_harmonics

   !> Whether an accuracy could have been asked for; see fw_combinations.
   pure logical function goes_with_accuracy(case)
      type(case_type), intent(in) :: case

      associate (harmonics => case%harmonics)
         goes_with_accuracy = analyses(case%analysis)%is_response .and. &
                              case%sweep%continuation == continuation_natural .and. &
                              harmonics%method == method_hbm .and. harmonics%n_time == 0 .and. &
                              .not. case%output%histories .and. &
                              case%contact%memory /= memory_carried .and. &
                              case%solver%n_solutions == 1 .and. &
                              100.0_wp*case%solver%tolerance <= usual_accuracy
      end associate
   end function goes_with_accuracy

   !> Every key, in the order of the effective input.
   subroutine read_keys(reader, path, case, error, memory_model, laws)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: path
      type(case_type), intent(inout) :: case
      type(error_type), allocatable, intent(out) :: error
      type(raw_model), intent(in), optional :: memory_model
      type(user_element), intent(in), optional :: laws(:)
      type(raw_model) :: raw

      ! Sizes (n_dof, n_pairs, n_springs) are told before the arrays whose shapes name them.
      call case%bind_keys(reader)
      call read_sensitivity(reader, case%sensitivity)
      call read_resonance(reader, case%analysis, case%resonance, case%varied)
      call read_structure(reader, path, case, raw, error, memory_model, laws)
      if (allocated(error)) return
      call list_inputs(path, raw, case%inputs)
      if (allocated(raw%unread)) case%unread = raw%unread
      if (allocated(raw%reduction_frequency)) case%reduced_up_to = raw%reduction_frequency(1)
      call read_harmonics(reader, case%harmonics)
      call read_sweep(reader, case%analysis, case%sweep, case%over)
      if (.not. reader%failed()) call check_order(reader, case)
      call check_damped_joint(reader, case)
      if (.not. reader%failed()) call vary_matrices(case, error)
      if (allocated(error)) return
      call case%solver%bind_keys(reader)
      call case%pseudo_time%bind_keys(reader)
      call case%wear%bind_keys(reader, analyses(case%analysis)%wears)
      if (.not. reader%failed() .and. allocated(case%contact%area)) then
         call case%wear%friction(case%contact%area, case%contact%worn_friction)
      end if
      call read_mission(reader, directory_of(path), case%mission, case%inputs)
      call case%time%bind_keys(reader)
      call read_mode(reader, case%analysis, case%mode)
      call read_campbell(reader, case%analysis, case%campbell)
      call case%bounds%bind_keys(reader)
      call case%ringdown%bind_keys(reader, analyses(case%analysis)%is_ringdown)
      call read_stress(reader, case%stress)
      case%output%file = stem_of(path)//'.h5'
      call read_output(reader, directory_of(path), case%output)
      call read_observed(reader, raw, case%model)
      if (.not. reader%failed()) call raw%base%observe(case%model%observe_matrix)
      call read_control(reader, case%model, case%control)
   end subroutine read_keys

   !> Residual tractions are what a range is over, whatever the assembly is: its middle comes
   !> first.
   subroutine open_range(contact)
      type(contact_type), intent(inout) :: contact

      ! What depends on the points before has no range, and is refused by its rule.
      if (contact%memory == memory_carried) return
      contact%memory = memory_residual
      if (allocated(contact%residual)) deallocate (contact%residual)
      allocate (contact%residual(contact%n_pairs), source=0.0_wp)
   end subroutine open_range

   !> What the model was formed by is what the key has.
   subroutine check_order(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(in) :: case
      real(wp), parameter :: round_off = 1.0e-12_wp
      real(wp) :: order, speeds(2)

      order = 0.0_wp
      if (allocated(case%model%cyclic%speed)) order = case%model%cyclic%speed%order
      if (abs(order - case%sweep%speed_order) > 0.0_wp) then
         call reader%refuse('sweep', 'speed_order', 'must be a plain number')
      else if (order > 0.0_wp) then
         ! Polynomials in the speed hold between the speeds that they go through.
         speeds = case%sweep%range()/order
         ! A resonance may leave the sweep by half of it.
         if (analyses(case%analysis)%is_resonance) speeds = &
            [max(1.5_wp*speeds(1) - 0.5_wp*speeds(2), 0.1_wp*speeds(1)), &
             1.5_wp*speeds(2) - 0.5_wp*speeds(1)]
         associate (growth => case%model%cyclic%speed%growth)
            if (speeds(1) < (1.0_wp - round_off)*growth%lowest .or. &
                speeds(2) > (1.0_wp + round_off)*growth%highest) call reader%refuse( &
               'sweep', 'speed_order', 'asks for speeds from '//to_text(speeds(1))//' to '// &
               to_text(speeds(2))//' rad/s: the model is known from '// &
               to_text(growth%lowest)//' to '//to_text(growth%highest)// &
               ' rad/s (speed/value): sweep over these times speed_order')
         end associate
      end if
   end subroutine check_order

   !> Whether the load of the base is made of matrices that a parameter may change.
   pure logical function pulls_by_matrices(raw)
      type(raw_model), intent(in) :: raw

      pulls_by_matrices = raw%base%moves_supports() .or. &
                          (raw%base%n_terms > 0 .and. allocated(raw%coriolis))
   end function pulls_by_matrices

   !> Matrices that change from point to point: what they are formed from is kept, and the values
   !> that they are to serve. Nothing is kept of others.
   subroutine vary_matrices(case, error)
      type(case_type), intent(inout) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: base(:)
      real(wp) :: span(2)
      logical :: by_factor

      if (.not. allocated(case%origin)) return
      span = case%over%ends()
      by_factor = case%over%as == as_factor
      if (analyses(case%analysis)%is_resonance) then
         span = [case%resonance%start, case%resonance%end]
         by_factor = case%resonance%as == resonance_as_factor
      else if (is_of_matrices(case%over%number) .and. allocated(case%origin%raw%stiffness)) then
         if (pulls_by_matrices(case%origin%raw)) then
            call fatal_error(error, '&sweep parameter changes the matrices, which does not go '// &
                             'with &base dof, nor with direction beside coriolis: use '// &
                             'direction without it, or sweep over the frequency', status_input)
            return
         end if
         case%varied = case%over%number
         if (all(case%origin%wanted /= case%varied)) then
            case%origin%wanted = [case%origin%wanted, case%varied]
         end if
         if (case%model%cyclic%is_cyclic) then
            call find_changes(case%origin%options, case%origin%raw, case%origin%wanted, &
                              case%model, error)
         else
            call form_structure(case%origin%options, case%origin%raw, case%origin%static, &
                                case%origin%wanted, case%model, error)
         end if
         if (allocated(error)) return
      end if
      if (is_of_matrices(case%varied)) then
         call get_parameter(case, case%varied, base)
         case%varied_span = [minval(span), maxval(span)]
         if (by_factor) case%varied_span = base(1)*case%varied_span
      else
         deallocate (case%origin)
      end if
   end subroutine vary_matrices

   !> What every key is and holds by default: the keys that an empty input is asked for.
   subroutine list_keys(keys)
      type(record_list), intent(out) :: keys
      type(reader_type) :: reader
      class(case_type), allocatable :: case
      type(string_type) :: none(0)
      type(error_type), allocatable :: ignored

      call new_reader(reader, '', '', none, ignored)
      ! What an empty input lacks is an error that nobody asks for; the keys are on record all the
      ! same.
      allocate (case)
      call read_keys(reader, '', case, ignored)
      keys = reader%records
   end subroutine list_keys

   !> The files that the case was read from, after those that are listed already.
   subroutine list_inputs(path, raw, inputs)
      character(*), intent(in) :: path
      type(raw_model), intent(in) :: raw
      type(string_type), allocatable, intent(inout) :: inputs(:)
      integer :: i

      if (.not. allocated(inputs)) allocate (inputs(0))
      call append(inputs, resolve_path(path, ''))
      if (.not. allocated(raw%files)) return
      do i = 1, size(raw%files)
         if (len(raw%files(i)%text) > 0) call append(inputs, resolve_path(raw%files(i)%text, ''))
      end do
   end subroutine list_inputs

   !> The key of the group that is read behind the model, which is formed by it; 0 where it is no
   !> number, which is told then.
   real(wp) function speed_order_of(reader) result(order)
      type(reader_type), intent(in) :: reader
      character(:), allocatable :: text
      integer :: stat

      text = reader%text_of('sweep', 'speed_order')
      order = 0.0_wp
      if (len(text) == 0) return
      read (text, *, iostat=stat) order
      if (stat /= 0 .or. .not. (order > 0.0_wp .and. order <= huge(1.0_wp))) order = 0.0_wp
   end function speed_order_of

   !> Whether derivatives are taken by what sectors have beside each other, or it moves: asked
   !> before the sweep is read.
   logical function moves_sectors(reader, case) result(moves)
      type(reader_type), intent(in) :: reader
      type(case_type), intent(in) :: case

      moves = any(is_of_sectors(case%sensitivity%parameters)) .or. is_of_sectors(case%varied) .or. &
              index(lower_case(reader%text_of('sweep', 'parameter')), 'mistuning') > 0
   end function moves_sectors

   !> The model with its contact, springs and loads.
   subroutine read_structure(reader, path, case, raw, error, memory_model, laws)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: path
      type(case_type), intent(inout) :: case
      !> The parts of the model as they were given.
      type(raw_model), intent(out) :: raw
      type(error_type), allocatable, intent(out) :: error
      type(raw_model), intent(in), optional :: memory_model
      type(user_element), intent(in), optional :: laws(:)
      type(model_options) :: options
      type(load_terms) :: terms
      character(:), allocatable :: worn
      integer, allocatable :: wanted(:)
      integer :: gap_order, n_dof

      call read_model(reader, directory_of(path), options, raw, n_dof, error, memory_model)
      if (allocated(error)) return
      call read_cyclic(reader, raw%cyclic, n_dof, analyses(case%analysis)%has_points, &
                       case%model%cyclic)
      if (.not. allocated(raw%mistuning)) allocate (raw%mistuning)
      call read_population(reader, case%analysis, case%population)
      call read_mistuning(reader, raw, moves_sectors(reader, case), case%model%cyclic, &
                          case%population)
      options%speed_order = speed_order_of(reader)
      call stand_alone(options, raw, case%model%cyclic)
      call read_contact(reader, raw%contact, analyses(case%analysis)%wears, &
                        case%model%cyclic%n_solved(), case%contact)
      if (analyses(case%analysis)%is_range) call open_range(case%contact)
      call read_obstacle(reader, case%model%cyclic, case%contact, gap_order)
      call case%contact%turn(options%rotation_speed, options%speed_order)
      ! What finds whether anything depends on the speed looks there.
      call take(case%contact%gap_rotation, raw%contact%gap_rotation)
      call take(case%contact%normal_load_rotation, raw%contact%normal_load_rotation)
      call read_worn(reader, directory_of(path), case%contact, worn, error)
      if (allocated(error)) return
      if (allocated(worn)) then
         allocate (case%inputs(0))
         call append(case%inputs, worn)
      end if
      call read_springs(reader, raw%springs, case%model%cyclic%n_solved(), case%springs)
      call read_elements(reader, raw%elements, directory_of(path), case%elements, error, laws)
      if (allocated(error)) return
      call case%elements%set_sectors(case%model%cyclic%n_solved())
      call check_sectors(reader, case%model%cyclic, case%contact, case%springs, case%elements)
      ! A number of 0 was meant.
      case%idle_contact = case%contact%n_pairs == 0 .and. reader%has_group('contact') .and. &
                          .not. reader%given('contact', 'n_pairs')
      case%idle_spring = case%springs%n_springs == 0 .and. reader%has_group('spring') .and. &
                         .not. reader%given('spring', 'n_springs')
      case%damps_modes = options%modal_damping > 0.0_wp
      case%damps_modes_up_to = options%modal_damping_up_to
      call read_loads(reader, options, raw, terms)
      if (.not. reader%failed()) call check_gap_orders(reader, gap_order, terms%fundamental, raw, &
                                                       case%model%cyclic)
      call find_nodal_stress(reader, raw)
      call case%stress%take(raw%stress, options%rotation_speed)
      call read_motion(reader, case%model%cyclic%has_sectors(), raw, case%contact, case%springs, &
                       case%elements)
      if (raw%base%moves_supports() .and. .not. reader%failed()) then
         call case%stress%ride(raw%base%dof, raw%base%carried)
      end if
      wanted = case%sensitivity%parameters
      if (case%varied > 0) then
         if (all(wanted /= case%varied)) wanted = [wanted, case%varied]
         if (is_of_matrices(case%varied)) allocate (case%origin)
      else if (reader%given('sweep', 'parameter')) then
         ! The matrices may be what the sweep goes over, which is read after them.
         allocate (case%origin)
      end if
      if (pulls_by_matrices(raw) .and. any(is_of_matrices(wanted))) call reader%refuse( &
         'base', 'n_terms', '= '//to_text(raw%base%n_terms)//' makes loads of the matrices of '// &
         'the case (dof, or direction beside coriolis): parameters that change these do not go '// &
         'with it; use direction without coriolis, or load%harmonic_scale')
      call take_damped_joint(reader, options, case)
      call finish_model(reader, options, raw, terms, case%model, case%origin, error, wanted)
      if (raw%bodies%count() > 0) case%bodies = raw%bodies
      if (.not. allocated(case%title)) then
         case%title = stem_of(path)
         if (allocated(raw%title)) case%title = raw%title
         call reader%amend('case', 'title', quoted_text(case%title))
      end if

   contains

      pure subroutine take(values, copy)
         real(wp), allocatable, intent(in) :: values(:)
         real(wp), allocatable, intent(inout) :: copy(:)

         if (allocated(copy)) deallocate (copy)
         if (allocated(values)) copy = values
      end subroutine take

   end subroutine read_structure

end module fw_read_case
