!> What the keys of the namelist groups with options mean together.
!>
!> Single values have passed the range of their key already (fw_key_range). Here are the refusals
!> that need two keys or the analysis, and what follows from other keys where one is left out.
module fw_read_options
   use fw_campbell_options, only: campbell_options, most_orders
   use fw_case, only: analyses
   use fw_harmonics_options, only: harmonics_options, method_hbm, method_hdhb, sampling_events, &
      instants_per_event_wave, most_for_accuracy
   use fw_kinds, only: wp, pi
   use fw_mode_options, only: mode_options
   use fw_parameter_sweep, only: parameter_sweep
   use fw_parameters, only: parameter_words
   use fw_read_mission, only: read_mission
   use fw_read_population, only: read_population
   use fw_reader, only: reader_type
   use fw_solver_options, only: sweep_options, unit_hertz, continuation_arclength, &
      continuation_natural
   use fw_stress_options, only: stress_options
   use fw_text, only: to_text
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: read_campbell, read_harmonics, read_mission, read_mode, read_population, read_stress, &
             read_sweep

   !> Responses that are put together from a mode.
   integer, parameter :: most_scales = 100
   !> Part of an amplitude that two texts of it may differ by.
   real(wp), parameter :: round_off = 1.0e-12_wp

contains

   !> Group &harmonics.
   subroutine read_harmonics(reader, options)
      type(reader_type), intent(inout) :: reader
      type(harmonics_options), intent(inout) :: options
      integer :: least

      call options%bind_keys(reader)
      if (options%accuracy > 0.0_wp) call choose_for_accuracy(reader, options)
      if (options%sampling == sampling_events .and. options%method == method_hdhb) then
         call reader%refuse('harmonics', 'sampling', "= 'events': method 'hdhb' is defined by "// &
                            "its 2*n_harmonics + 1 instants; use 'hbm' or 'tcm', or 'uniform'")
      end if
      least = 2*options%n_harmonics + 1
      ! With an accuracy n_time has been refused already.
      if (options%n_time == 0 .or. options%accuracy > 0.0_wp) return
      if (options%n_time < least) then
         call reader%refuse('harmonics', 'n_time', '= '//to_text(options%n_time)// &
                            ': must be at least 2*n_harmonics + 1 = '//to_text(least)// &
                            ', or 0 to have it chosen')
      else if (options%sampling == sampling_events .and. &
               options%n_time < instants_per_event_wave*options%n_harmonics) then
         call reader%refuse('harmonics', 'n_time', '= '//to_text(options%n_time)// &
                            ": sampling = 'events' needs at least 4*n_harmonics = "// &
                            to_text(instants_per_event_wave*options%n_harmonics)// &
                            ', or 0 to have it chosen')
      else if (options%method == method_hdhb .and. options%n_time /= least) then
         call reader%refuse('harmonics', 'n_time', '= '//to_text(options%n_time)//': method '// &
                            "'hdhb' takes 2*n_harmonics + 1 = "//to_text(least)//' instants')
      end if
   end subroutine read_harmonics

   !> With an accuracy n_harmonics is the most.
   subroutine choose_for_accuracy(reader, options)
      type(reader_type), intent(inout) :: reader
      !> n_harmonics is amended where it was left out, also in the effective input.
      type(harmonics_options), intent(inout) :: options

      if (.not. reader%given('harmonics', 'n_harmonics')) then
         options%n_harmonics = most_for_accuracy
         call reader%amend('harmonics', 'n_harmonics', to_text(options%n_harmonics))
      else if (options%n_harmonics < 3) then
         call reader%refuse('harmonics', 'n_harmonics', '= '//to_text(options%n_harmonics)// &
                            ': with accuracy it is the most that may be used, at least 3; '// &
                            'leave it out for '//to_text(most_for_accuracy))
      end if
      if (options%n_time > 0) then
         call reader%refuse('harmonics', 'n_time', '= '//to_text(options%n_time)//': with '// &
                            'accuracy the program chooses it; leave it out')
      else if (options%method /= method_hbm) then
         call reader%refuse('harmonics', 'accuracy', "goes with method = 'hbm': collocation "// &
                            'leaves an error of first order in 1/H that no estimate bounds; '// &
                            "use 'hbm', or leave accuracy out")
      end if
   end subroutine choose_for_accuracy

   !> Group &sweep; frequencies leave in rad/s. A sweep over another parameter leaves its one
   !> frequency in `options`, as start and end, and the values in `over`.
   subroutine read_sweep(reader, analysis, options, over)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(inout) :: options
      type(parameter_sweep), intent(inout) :: over
      logical :: has_frequency

      has_frequency = analyses(analysis)%has_points .and. .not. analyses(analysis)%is_free
      if (has_frequency) then
         call reader%require_group('sweep', &
                                   'the frequency: start (and end and n_points of a sweep)')
      end if
      call reader%open('sweep', 'frequencies, or values of a parameter')
      call over%bind_parameter(reader)
      call options%bind_keys(reader, &
                             analyses(analysis)%is_sweep .or. analyses(analysis)%is_resonance, &
                             has_frequency, reader%given('sweep', 'values'), over%is_wanted())
      call over%bind_values(reader)
      if (analyses(analysis)%is_free) call refuse_sweep(reader)
      call check_ends(reader, analysis, options)
      call take_values(reader, analysis, options, over)
      ! Everything inside is in rad/s; the effective input keeps the unit of the user.
      if (options%unit == unit_hertz) then
         if (allocated(options%frequencies)) options%frequencies = 2.0_wp*pi*options%frequencies
         options%start = 2.0_wp*pi*options%start
         options%end = 2.0_wp*pi*options%end
      end if
   end subroutine read_sweep

   !> A list of values is one of frequencies, or of what else the sweep goes over; the ends are.
   subroutine take_values(reader, analysis, options, over)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(inout) :: options
      type(parameter_sweep), intent(inout) :: over

      if (.not. over%is_wanted()) then
         call refuse_of_parameter(reader)
         if (.not. allocated(over%values)) return
         if (any(over%values <= 0.0_wp)) then
            call reader%refuse('sweep', 'values', 'are frequencies: must be above 0')
         else
            call move_alloc(over%values, options%frequencies)
            call take_list(reader, analysis, options)
         end if
         return
      end if
      if (.not. analyses(analysis)%is_sweep) call reader%refuse('sweep', 'parameter', "= '"// &
         trim(parameter_words(over%number))//"' goes with analysis = 'frf': leave it out")
      if (allocated(over%values)) then
         call refuse_list(reader, analysis, options)
         options%n_points = size(over%values)
         if (options%n_points > 0) over%start = over%values(1)
         if (options%n_points > 0) over%end = over%values(options%n_points)
      else
         over%start = options%start
         over%end = options%end
      end if
      options%start = over%frequency
      options%end = over%frequency
   end subroutine take_values

   !> Keys that a sweep over frequencies has no use for.
   subroutine refuse_of_parameter(reader)
      type(reader_type), intent(inout) :: reader
      character(*), parameter :: keys(*) = [character(9) :: 'frequency', 'as']
      integer :: i

      do i = 1, size(keys)
         if (reader%given('sweep', trim(keys(i)))) call reader%refuse('sweep', trim(keys(i)), &
            'goes with a parameter other than the frequency: name it, or leave this out')
         ! Nor in the effective input.
         call reader%amend('sweep', trim(keys(i)), '')
      end do
   end subroutine refuse_of_parameter

   !> The frequencies of a mode are its own.
   subroutine refuse_sweep(reader)
      type(reader_type), intent(inout) :: reader
      character(*), parameter :: keys(*) = [character(12) :: 'parameter', 'values', 'start', &
                                            'end', 'unit', 'continuation', 'n_points', &
                                            'max_points', 'stability', 'speed_order', 'refine']
      integer :: i

      do i = 1, size(keys)
         if (.not. reader%given('sweep', trim(keys(i)))) then
            ! The effective input shall run again.
            call reader%amend('sweep', trim(keys(i)), '')
            cycle
         end if
         call reader%refuse('sweep', trim(keys(i)), "does not go with case%analysis = 'mode', "// &
                            'whose frequencies follow from its amplitudes: leave &sweep out, '// &
                            'and give &mode start and end')
      end do
   end subroutine refuse_sweep

   !> Group &mode; a frequency leaves in rad/s.
   subroutine read_mode(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(mode_options), intent(inout) :: options

      call options%bind_keys(reader, analyses(analysis)%is_free)
      if (options%unit == unit_hertz) options%near = 2.0_wp*pi*options%near
      if (.not. analyses(analysis)%is_free) return
      if (reader%given('mode', 'near') .and. reader%given('mode', 'number')) then
         call reader%refuse('mode', 'near', 'is given beside number: keep one of the two')
      end if
      ! Nor shall both stand in the effective input.
      if (reader%given('mode', 'near')) then
         call reader%amend('mode', 'number', '')
      else
         call reader%amend('mode', 'near', '')
      end if
      if (allocated(options%amplitudes)) then
         call take_amplitudes(reader, options)
      else if (reader%given('mode', 'start') .and. reader%given('mode', 'end') .and. &
               options%end <= options%start) then
         call reader%refuse('mode', 'end', '= '//number_text(options%end)//': must be above '// &
                            'start = '//number_text(options%start)//', the lowest amplitude')
      end if
      if (.not. allocated(options%synthesis)) return
      if (size(options%synthesis) > most_scales) then
         call reader%refuse('mode', 'synthesis', 'has '//to_text(size(options%synthesis))// &
                            ' factors: at most '//to_text(most_scales)//' are served')
      end if
   end subroutine read_mode

   !> Group &campbell.
   subroutine read_campbell(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(campbell_options), intent(inout) :: options
      integer :: n

      call options%bind_keys(reader, analyses(analysis)%is_campbell)
      if (.not. analyses(analysis)%is_campbell .or. reader%failed()) return
      if (options%end <= options%start) then
         call reader%refuse('campbell', 'end', '= '//number_text(options%end)//': must be '// &
                            'above start = '//number_text(options%start)//', the lowest speed')
      end if
      n = size(options%orders)
      if (n == 0 .or. any(options%orders == 0)) then
         call reader%refuse('campbell', 'orders', 'must be engine orders other than 0, whose '// &
                            'loads vibrate')
      else if (n > most_orders) then
         call reader%refuse('campbell', 'orders', 'has '//to_text(n)//' orders: at most '// &
                            to_text(most_orders)//' are served')
      end if
      if (.not. allocated(options%order_scale)) return
      if (all(size(options%order_scale) /= [1, n])) then
         call reader%refuse('campbell', 'order_scale', 'has '// &
                            to_text(size(options%order_scale))//' factors: must be one, or one '// &
                            'for each of the '//to_text(n)//' orders')
      end if
   end subroutine read_campbell

   !> Group &stress, behind what the model says of it.
   subroutine read_stress(reader, options)
      type(reader_type), intent(inout) :: reader
      type(stress_options), intent(inout) :: options

      call options%bind_keys(reader)
      if (reader%failed()) return
      if (options%n_points == 0) then
         if (.not. options%asks_for_rows()) return
         call reader%refuse_model('no stress/matrix (six components at each point, for each '// &
                                  'dof), which group &stress needs')
      else if (.not. options%fits()) then
         call reader%refuse_model('stress/static, static_rotation, endurance or ultimate of '// &
                                  'another number of points than stress/matrix: must be '// &
                                  to_text(options%n_points))
      else if (allocated(options%endurance) .neqv. allocated(options%ultimate)) then
         call reader%refuse('stress', trim(merge('ultimate ', 'endurance', &
                            allocated(options%endurance))), 'is missing: utilisation takes '// &
                            'both endurance and ultimate, of the case or of the model file')
      end if
   end subroutine read_stress

   !> Amplitudes one by one.
   subroutine take_amplitudes(reader, options)
      type(reader_type), intent(inout) :: reader
      type(mode_options), intent(inout) :: options
      character(*), parameter :: others(*) = [character(8) :: 'start', 'end', 'n_points']
      integer :: i, n

      if (reader%given('mode', 'continuation') .and. &
          options%continuation == continuation_arclength) then
         call reader%refuse('mode', 'amplitudes', "does not go with continuation = "// &
                            "'arclength', whose points are its own: give start and end")
      end if
      options%continuation = continuation_natural
      call reader%amend('mode', 'continuation', "'natural'")
      ! Refused before: it was given, but not as it must be.
      n = size(options%amplitudes)
      if (n == 0) return
      if (any(options%amplitudes(2:) <= options%amplitudes(:n - 1))) then
         call reader%refuse('mode', 'amplitudes', 'must rise from each to the next')
      end if
      associate (list => options%amplitudes)
         call refuse_other(reader, 'start', abs(options%start - list(1)) > round_off*list(1))
         call refuse_other(reader, 'end', abs(options%end - list(n)) > round_off*list(n))
      end associate
      call refuse_other(reader, 'n_points', options%n_points /= n)
      do i = 1, size(others)
         call reader%amend('mode', trim(others(i)), '')
      end do
      options%n_points = n
      options%start = options%amplitudes(1)
      options%end = options%amplitudes(n)
   end subroutine take_amplitudes

   !> A key that says something else than the list.
   subroutine refuse_other(reader, name, differs)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: name
      logical, intent(in) :: differs

      if (.not. (differs .and. reader%given('mode', name))) return
      call reader%refuse('mode', name, 'does not agree with amplitudes, which says it: leave '// &
                         'it out')
   end subroutine refuse_other

   !> Frequencies one by one.
   subroutine take_list(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(inout) :: options

      call refuse_list(reader, analysis, options)
      ! Refused before: it was given, but not as it must be.
      if (size(options%frequencies) == 0) return
      options%n_points = size(options%frequencies)
      options%start = options%frequencies(1)
      options%end = options%frequencies(options%n_points)
   end subroutine take_list

   !> A list stands for start, end and n_points.
   subroutine refuse_list(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(in) :: options
      character(*), parameter :: others(*) = [character(8) :: 'start', 'end', 'n_points']
      integer :: i

      do i = 1, size(others)
         if (reader%given('sweep', trim(others(i)))) then
            call reader%refuse('sweep', trim(others(i)), 'is given beside values, which say '// &
                               'it: keep one of the two')
         end if
         ! None of the three shall stand in the effective input beside the list.
         call reader%amend('sweep', trim(others(i)), '')
      end do
      if (.not. (analyses(analysis)%is_sweep .or. analyses(analysis)%is_integrated)) then
         call reader%refuse('sweep', 'values', "go with analysis = 'frf' or 'time': "// &
                            'give start, the one frequency, instead')
      else if (options%continuation == continuation_arclength) then
         call reader%refuse('sweep', 'values', "do not go with continuation = "// &
                            "'arclength', whose points are its own: give start and end")
      end if
   end subroutine refuse_list

   !> A branch is followed from one end to the other: it needs two.
   subroutine check_ends(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(in) :: options

      if (.not. analyses(analysis)%is_sweep) return
      if (options%continuation /= continuation_arclength) return
      if (.not. (reader%given('sweep', 'start') .and. reader%given('sweep', 'end'))) return
      ! To round-off, since both may come from a computation.
      if (abs(options%end - options%start) > epsilon(1.0_wp)*abs(options%start)) return
      call reader%refuse('sweep', 'end', '= '//number_text(options%end)//': must differ '// &
                         "from start with continuation = 'arclength', which follows the "// &
                         "branch from start to end: give another end, or analysis = 'point'")
   end subroutine check_ends

end module fw_read_options
