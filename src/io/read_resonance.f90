!> Group &resonance: which parameter a resonance is followed over, and whether the case has it.
module fw_read_resonance
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_parameter_checks, only: check_parameter, check_scales
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: is_of_loads, mistuning_scale, not_negative, parameter_words, &
      parameters, positive
   use fw_reader, only: reader_type
   use fw_resonance_options, only: as_factor, condition_phase, resonance_options, spacing_log
   use fw_solver_options, only: continuation_arclength
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: read_resonance, check_resonance

   character(*), parameter :: group = 'resonance'

contains

   !> The keys, read before the model, which keeps what its matrices change by.
   subroutine read_resonance(reader, analysis, options, varied)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(resonance_options), intent(inout) :: options
      !> The parameter that changes from point to point; left alone where none does.
      integer, intent(inout) :: varied

      call options%bind_keys(reader, analyses(analysis)%is_resonance)
      if (.not. analyses(analysis)%is_resonance) return
      varied = options%parameter
      if (.not. reader%given(group, 'parameter')) then
         call reader%refuse(group, 'parameter', "is missing: name what the resonance is "// &
                            "followed over, such as 'load%harmonic_scale' or "// &
                            "'contact%normal_load'")
      end if
      ! Only the phase is one more equation along a branch; the amplitude is searched for.
      if (options%continuation == continuation_arclength .and. &
          options%condition /= condition_phase) then
         call reader%refuse(group, 'continuation', "= 'arclength' goes with condition = "// &
                            "'phase': give that, or continuation = 'natural'")
      end if
      call check_ends(reader, options)
   end subroutine read_resonance

   !> Ends that differ, with signs that go with the parameter and with the spacing.
   subroutine check_ends(reader, options)
      type(reader_type), intent(inout) :: reader
      type(resonance_options), intent(in) :: options

      if (.not. (reader%given(group, 'start') .and. reader%given(group, 'end'))) return
      associate (low => min(options%start, options%end))
         if (abs(options%end - options%start) <= epsilon(1.0_wp)*abs(options%start)) then
            call reader%refuse(group, 'end', '= '//number_text(options%end)//': must differ '// &
                               'from start')
         else if (options%spacing == spacing_log .and. .not. low > 0.0_wp) then
            call reader%refuse(group, 'spacing', "= 'log': start and end must be above 0; use "// &
                               "'linear'")
         else if (needs_more(options) .and. .not. low > 0.0_wp) then
            call reader%refuse(group, 'start', 'and end must be above 0: '// &
                               trim(parameter_words(options%parameter))//' is a factor or a '// &
                               'stiffness')
         else if (is_never_below(options) .and. low < 0.0_wp) then
            call reader%refuse(group, 'start', 'and end must be at least 0: '// &
                               trim(parameter_words(options%parameter))//' is never below')
         end if
      end associate
   end subroutine check_ends

   !> Factors of loads and stiffnesses of zero leave nothing to follow.
   pure logical function needs_more(options)
      type(resonance_options), intent(in) :: options

      needs_more = is_of_loads(options%parameter)
      if (options%parameter > 0) needs_more = needs_more .or. &
         parameters(options%parameter)%sign == positive
   end function needs_more

   !> What has no meaning below zero, but may be zero.
   pure logical function is_never_below(options)
      type(resonance_options), intent(in) :: options

      is_never_below = .false.
      if (options%parameter > 0) is_never_below = parameters(options%parameter)%sign == not_negative
   end function is_never_below

   !> Refuse what a resonance over a parameter cannot be made of.
   subroutine check_resonance(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: values(:)
      character(len(parameter_words)) :: name

      if (.not. analyses(case%analysis)%is_resonance) return
      call check_parameter(case, case%resonance%parameter, 'resonance%parameter', error)
      if (allocated(error)) return
      call get_parameter(case, case%resonance%parameter, values)
      name = parameter_words(case%resonance%parameter)
      if (case%resonance%parameter == mistuning_scale) then
         call check_scales(case, [case%resonance%start, case%resonance%end]* &
                           merge(values(1), 1.0_wp, case%resonance%as == as_factor), &
                           'resonance%parameter', error)
         if (allocated(error)) return
      end if
      if (case%resonance%as == as_factor) then
         if (any(abs(values) > 0.0_wp)) return
         call fatal_error(error, "resonance%as = 'factor': "//trim(name)//' is 0 in the case, '// &
                          "and so is every multiple of it; give as = 'value'", status_input)
      else if (maxval(values) - minval(values) > epsilon(1.0_wp)*maxval(abs(values))) then
         call fatal_error(error, "resonance%as = 'value': "//trim(name)//' differs from pair '// &
                          "to pair (or spring to spring); give as = 'factor', which changes "// &
                          'all of them together', status_input)
      end if
   end subroutine check_resonance

end module fw_read_resonance
