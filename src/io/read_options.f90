!> The namelist groups that hold options only: one procedure per group.
module fw_read_options
   use fw_case, only: case_type, analysis_words, analysis_frf, analysis_wear
   use fw_harmonics_options, only: harmonics_options, method_words, method_hbm, method_hdhb, &
                                   sampling_words, sampling_events, parity_words, &
                                   instants_per_event_wave, most_for_accuracy
   use fw_kinds, only: wp, pi
   use fw_reader, only: reader_type
   use fw_solver_options, only: solver_options, pseudo_time_options, sweep_options, solver_words, &
                                linear_words, jacobian_words, flow_words, scheme_words, &
                                unit_words, unit_hertz, continuation_words, continuation_natural, &
                                continuation_arclength
   use fw_text, only: to_text
   use fw_time_options, only: time_options
   use fw_values, only: number_text
   use fw_wear_options, only: wear_options, wear_scheme_words, wear_law_words
   implicit none (type, external)
   private

   public :: read_case_group, read_harmonics, read_sweep, read_solver, read_pseudo_time, &
             read_wear, read_time

contains

   !> Group &case.
   subroutine read_case_group(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(inout) :: case

      call reader%get('case', 'title', case%title)
      call reader%get_word('case', 'analysis', case%analysis, analysis_words)
      call reader%get('case', 'threads', case%threads, least=0, most=1024)
   end subroutine read_case_group

   !> Group &harmonics.
   subroutine read_harmonics(reader, options)
      type(reader_type), intent(inout) :: reader
      type(harmonics_options), intent(inout) :: options
      integer :: least

      call reader%get_word('harmonics', 'method', options%method, method_words)
      call reader%get('harmonics', 'n_harmonics', options%n_harmonics, least=1, most=10000)
      call reader%get('harmonics', 'n_time', options%n_time, least=0, most=1000000)
      call reader%get('harmonics', 'n_collocation', options%n_collocation, least=0)
      call reader%get('harmonics', 'filter_harmonics', options%filter_harmonics, least=0)
      call reader%get_word('harmonics', 'sampling', options%sampling, sampling_words)
      call reader%get_word('harmonics', 'parity', options%parity, parity_words)
      call reader%get('harmonics', 'adaptive', options%adaptive)
      call reader%get('harmonics', 'adaptive_tolerance', options%adaptive_tolerance, above=0.0_wp)
      call reader%get('harmonics', 'accuracy', options%accuracy, least=0.0_wp, below=1.0_wp)
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
      else if (options%adaptive) then
         call reader%refuse('harmonics', 'adaptive', '= .true.: accuracy chooses harmonics by '// &
                            'the error of the response instead; leave adaptive out')
      else if (options%method /= method_hbm) then
         call reader%refuse('harmonics', 'accuracy', "goes with method = 'hbm': collocation "// &
                            'leaves an error of first order in 1/H that no estimate bounds; '// &
                            "use 'hbm', or leave accuracy out")
      end if
   end subroutine choose_for_accuracy

   !> Group &sweep; frequencies leave in rad/s.
   subroutine read_sweep(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(sweep_options), intent(inout) :: options
      logical :: is_sweep

      is_sweep = analysis == analysis_frf
      call reader%require_group('sweep', 'the frequency: start (and end and n_points of a sweep)')
      call reader%get('sweep', 'start', options%start, above=0.0_wp, required=.true.)
      call reader%get('sweep', 'end', options%end, least=0.0_wp, required=is_sweep)
      call reader%get_word('sweep', 'unit', options%unit, unit_words)
      call reader%get_word('sweep', 'continuation', options%continuation, continuation_words)
      is_sweep = is_sweep .and. options%continuation == continuation_natural
      call reader%get('sweep', 'n_points', options%n_points, least=1, required=is_sweep)
      call reader%get('sweep', 'max_points', options%max_points, least=1)
      call reader%get('sweep', 'stability', options%stability)
      call check_ends()
      if (options%unit == unit_hertz) then
         options%start = 2.0_wp*pi*options%start
         options%end = 2.0_wp*pi*options%end
      end if

   contains

      !> A branch is followed from one end to the other: it needs two.
      subroutine check_ends()
         if (analysis /= analysis_frf .or. options%continuation /= continuation_arclength) return
         if (.not. (reader%given('sweep', 'start') .and. reader%given('sweep', 'end'))) return
         if (abs(options%end - options%start) > epsilon(1.0_wp)*abs(options%start)) return
         call reader%refuse('sweep', 'end', '= '//number_text(options%end)//': must differ '// &
                            "from start with continuation = 'arclength', which follows the "// &
                            "branch from start to end: give another end, or analysis = 'point'")
      end subroutine check_ends

   end subroutine read_sweep

   !> Group &solver.
   subroutine read_solver(reader, options)
      type(reader_type), intent(inout) :: reader
      type(solver_options), intent(inout) :: options

      call reader%get_word('solver', 'kind', options%kind, solver_words)
      call reader%get_word('solver', 'linear', options%linear, linear_words)
      call reader%get_word('solver', 'jacobian', options%jacobian, jacobian_words)
      call reader%get('solver', 'tolerance', options%tolerance, above=0.0_wp, below=1.0_wp)
      call reader%get('solver', 'max_iterations', options%max_iterations, least=1)
      call reader%get('solver', 'fallback', options%fallback)
      call reader%get('solver', 'skips', options%skips)
   end subroutine read_solver

   !> Group &pseudo_time.
   subroutine read_pseudo_time(reader, options)
      type(reader_type), intent(inout) :: reader
      type(pseudo_time_options), intent(inout) :: options

      call reader%get_word('pseudo_time', 'flow', options%flow, flow_words)
      call reader%get_word('pseudo_time', 'scheme', options%scheme, scheme_words)
      call reader%get('pseudo_time', 'step', options%step, least=0.0_wp)
      call reader%get('pseudo_time', 'cfl', options%cfl, above=0.0_wp)
      call reader%get('pseudo_time', 'max_steps', options%max_steps, least=1)
   end subroutine read_pseudo_time

   !> Group &wear; required for analysis wear only, validated always.
   subroutine read_wear(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      type(wear_options), intent(inout) :: options
      ! The default, huge, stands for no limit and lies outside of what may be written.
      real(wp), parameter :: most_cycles = 1.0e300_wp

      call reader%get_word('wear', 'scheme', options%scheme, wear_scheme_words)
      call reader%get_word('wear', 'law', options%law, wear_law_words)
      call reader%get('wear', 'order', options%order, least=0, most=4)
      call reader%get('wear', 'coefficient', options%coefficient, above=0.0_wp, &
                      required=analysis == analysis_wear)
      call reader%get('wear', 'n_cycles', options%n_cycles, above=0.0_wp, most=most_cycles)
      call reader%get('wear', 'max_depth_step', options%max_depth_step, least=0.0_wp)
      call reader%get('wear', 'error_tolerance', options%error_tolerance, least=0.0_wp)
      call reader%get('wear', 'steady_tolerance', options%steady_tolerance, above=0.0_wp, &
                      below=1.0_wp)
      call reader%get('wear', 'max_steps', options%max_steps, least=1)
      call reader%get('wear', 'check_steps', options%check_steps)
      call reader%get('wear', 'follow_resonance', options%follow_resonance)
   end subroutine read_wear

   !> Group &time.
   subroutine read_time(reader, options)
      type(reader_type), intent(inout) :: reader
      type(time_options), intent(inout) :: options

      call reader%get('time', 'n_periods', options%n_periods, least=1)
      call reader%get('time', 'steps_per_period', options%steps_per_period, least=2)
   end subroutine read_time

end module fw_read_options
