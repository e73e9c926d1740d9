!> What a case asks for, in the words of the rules (fw_rules): one phrase and one condition each.
!>
!> The phrases stand in messages, so they name keys as the namelist has them. Those that begin with
!> 'a law' are facts of the law of the pairs: a new law needs no new phrase.
module fw_features
   use fw_case, only: analyses, analysis_bounds, analysis_campbell, analysis_frf, analysis_mode, &
      analysis_modes, analysis_point, analysis_population, analysis_resonance, analysis_wear, &
      case_type
   use fw_contact_data, only: memory_carried, memory_residual
   use fw_control_options, only: of_first_harmonic
   use fw_force_law, only: law_facts
   use fw_harmonics_options, only: method_hbm, method_hdhb, sampling_events, sampling_uniform
   use fw_kinds, only: wp
   use fw_law_text, only: law_text, law_text_length
   use fw_laws, only: facts_of, is_viscous
   use fw_normal_law, only: curved_pairs
   use fw_parameters, only: harmonic_scale, is_of_matrices, loss_factor, rotation_speed, &
      static_scale
   use fw_resonance_options, only: condition_phase
   use fw_solver_options, only: continuation_arclength, scheme_bdf, scheme_implicit_euler, &
      scheme_runge_kutta, solver_newton, solver_pseudo_time
   use fw_wear_options, only: mu_by_none, wear_pseudo_time
   implicit none (type, external)
   private

   public :: asks_for, feature_length, feature_text, knows_feature

   !> Longest phrase.
   integer, parameter :: feature_length = 72
   character(*), parameter :: law_mark = 'a law '
   !> What makes a structure the only sector of a cyclic one, what has no time domain, and rows of
   !> the model whose stress is found unless the case says no.
   character(*), parameter, public :: &
      matrices_alone = 'coriolis, structural damping, air or unsymmetric matrices', &
      hysteretic = 'structural damping (loss_factor) or forces of the air', &
      stress = 'stress (group &stress, /stress of the model file)', &
      moving_gaps = 'gaps in harmonics (contact%n_gap_terms, /contact/gap_harmonic)', &
      sliding_side = 'a side 2 that slides (contact%speed_1, speed_2)', &
      growing_stability = 'sweep%stability = .true. where gaps or normal loads grow', &
      of_air = 'forces of the air', &
      of_campbell = "case%analysis = 'campbell'", &
      of_population = "case%analysis = 'population'", &
      of_bounds = "case%analysis = 'bounds'", &
      of_ringdown = "case%analysis = 'ringdown'", &
      in_time = "case%analysis = 'time' or 'ringdown'"

contains

   !> Whether a case asks for what a phrase says.
   logical function asks_for(case, phrase)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical :: known

      call look_up(case, phrase, asks_for, known)
   end function asks_for

   !> Whether there is such a phrase: a rule with another one would never hold.
   logical function knows_feature(phrase)
      character(*), intent(in) :: phrase
      class(case_type), allocatable :: case
      logical :: asked

      allocate (case)
      allocate (case%model%load_cosine(0), case%model%load_sine(0))
      call look_up(case, phrase, asked, knows_feature)
   end function knows_feature

   !> A phrase as a message shows it: facts of a law with the word of the law.
   pure function feature_text(case, phrase) result(text)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      character(feature_length + law_text_length + 20) :: text

      text = phrase
      if (index(phrase, law_mark) == 1) text = 'contact%law = '//trim(law_text(case%contact))// &
         ' ('//trim(phrase)//')'
   end function feature_text

   !> Whoever of those below knows the phrase answers.
   subroutine look_up(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known

      call of_analysis(case, phrase, asked, known)
      if (.not. known) call of_method(case, phrase, asked, known)
      if (.not. known) call of_sweep(case, phrase, asked, known)
      if (.not. known) call of_joint(case, phrase, asked, known)
      if (.not. known) call of_wear(case, phrase, asked, known)
      if (.not. known) call of_load(case, phrase, asked, known)
   end subroutine look_up

   !> The analysis, the structure, and what goes with one analysis alone.
   subroutine of_analysis(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known
      integer :: a

      a = case%analysis
      known = .true.
      select case (phrase)
      case ("case%analysis = 'mode'")
         asked = a == analysis_mode
      case ("case%analysis = 'resonance'")
         asked = a == analysis_resonance
      case (in_time)
         asked = analyses(a)%is_integrated
      case (of_ringdown)
         asked = analyses(a)%is_ringdown
      case ("resonance%parameter = 'model%rotation_speed'")
         asked = a == analysis_resonance .and. case%resonance%parameter == rotation_speed
      case ('a resonance%parameter of the matrices')
         asked = a == analysis_resonance .and. is_of_matrices(case%resonance%parameter)
      case ("case%analysis = 'wear'")
         asked = a == analysis_wear
      case ("case%analysis other than 'wear'")
         asked = a /= analysis_wear
      case ("case%analysis other than 'point'")
         asked = a /= analysis_point
      case ("case%analysis other than 'frf'")
         asked = a /= analysis_frf
      case ("case%analysis other than 'frf' or 'point'")
         asked = all(a /= [analysis_frf, analysis_point])
      case (of_population)
         asked = a == analysis_population
      case (of_bounds)
         asked = a == analysis_bounds
      case ("case%analysis other than 'frf', 'point', 'population' or 'resonance'")
         asked = all(a /= [analysis_frf, analysis_point, analysis_population, analysis_resonance])
      case ("case%analysis other than 'frf', 'point', 'resonance' or 'mode'")
         asked = all(a /= [analysis_frf, analysis_point, analysis_resonance, analysis_mode])
      case (of_campbell)
         asked = a == analysis_campbell
      case ('model%rotation_speed')
         asked = case%stress%rotation_speed > 0.0_wp
      case ('group &sensitivity')
         asked = case%sensitivity%is_wanted()
      case (stress)
         asked = case%stress%is_wanted()
      case ('group &control')
         asked = case%control%is_wanted()
      case ('mode%synthesis')
         asked = a == analysis_mode .and. allocated(case%mode%synthesis)
      case ('model%modal_damping_up_to')
         asked = case%damps_modes_up_to > 0.0_wp
      case ('group &cyclic')
         asked = case%model%cyclic%has_sectors()
      case (matrices_alone)
         asked = case%model%cyclic%is_alone
      case (hysteretic)
         asked = case%model%loss_factor > 0.0_wp .or. case%varied == loss_factor .or. &
                 allocated(case%model%cyclic%structural) .or. allocated(case%model%cyclic%air)
      case (of_air)
         asked = allocated(case%model%cyclic%air)
      case ('cyclic%mistuned = .true.')
         asked = case%model%cyclic%is_cyclic .and. case%model%cyclic%is_mistuned
      case default
         asked = .false.
         known = .false.
      end select
   end subroutine of_analysis

   !> Harmonics, solver, output.
   subroutine of_method(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known

      known = .true.
      select case (phrase)
      case ("harmonics%method other than 'hbm'")
         asked = case%harmonics%method /= method_hbm
      case ("harmonics%method = 'hdhb'")
         asked = case%harmonics%method == method_hdhb
      case ('harmonics%accuracy')
         asked = case%harmonics%accuracy > 0.0_wp
      case ("harmonics%sampling = 'events'")
         asked = case%harmonics%sampling == sampling_events
      case ("harmonics%sampling = 'uniform'")
         asked = case%harmonics%sampling == sampling_uniform
      case ("solver%kind other than 'newton'")
         asked = case%solver%kind /= solver_newton
      case ('solver%n_solutions > 1')
         asked = case%solver%n_solutions > 1
      case ("solver%kind = 'pseudo_time'")
         asked = case%solver%kind == solver_pseudo_time
      case ('output%histories')
         asked = case%output%histories
      case ('output%tail')
         asked = case%output%tail > 0
      case default
         asked = .false.
         known = .false.
      end select
   end subroutine of_method

   !> The path of the points.
   subroutine of_sweep(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known

      known = .true.
      associate (sweep => case%sweep)
         select case (phrase)
         case ("sweep%continuation = 'arclength'")
            asked = sweep%continuation == continuation_arclength
         case ('sweep%stability = .true.')
            ! Natural frequencies have no stability to look at.
            asked = sweep%stability .and. case%analysis /= analysis_modes
         case ('sweep%speed_order')
            asked = sweep%speed_order > 0.0_wp
         case (growing_stability)
            asked = sweep%stability .and. case%contact%has_growth()
         case ('sweep%refine = .true.')
            asked = sweep%refine
         case ('a piece of a sweep')
            asked = sweep%is_piece()
         case ('sweep%n_points = 1')
            asked = sweep%n_points < 2
         case ('a sweep of fewer than three points')
            asked = sweep%n_points < 3 .or. .not. abs(sweep%end - sweep%start) > 0.0_wp
         case ('sweep%parameter')
            asked = case%over%is_wanted()
         case ("sweep%parameter = 'load%harmonic_scale'")
            asked = case%over%number == harmonic_scale
         case ("sweep%parameter = 'load%static_scale' through 0")
            asked = .false.
            if (case%over%number == static_scale) asked = product(case%over%ends()) <= 0.0_wp
         case default
            asked = .false.
            known = .false.
         end select
      end associate
   end subroutine of_sweep

   !> Pairs and their law, springs, other elements, the base.
   subroutine of_joint(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known
      type(law_facts) :: facts
      logical :: pairs

      pairs = case%contact%n_pairs > 0
      if (pairs) facts = facts_of(case%contact)
      known = .true.
      select case (phrase)
      case ("contact%normal_law other than 'unilateral'")
         asked = .false.
         if (pairs) asked = any(curved_pairs(case%contact))
      case ('a pair without a normal dof')
         asked = .false.
         if (pairs) asked = any(case%contact%side_1(3, :) == 0 .and. case%contact%side_2(3, :) == 0)
      case ('a case without contact pairs')
         asked = .not. pairs
      case ('group &base')
         asked = allocated(case%model%base_parts)
      case ('states of a law of a user')
         asked = has_states(case)
      case ('a law that does not remember where pairs start')
         asked = pairs .and. .not. facts%remembers
      case ('contact%slider_1 or slider_2')
         asked = pairs .and. (allocated(case%contact%slider_1) .or. &
                              allocated(case%contact%slider_2))
      case ("contact%memory = 'residual'")
         asked = pairs .and. case%contact%memory == memory_residual
      case ("contact%memory other than 'residual'")
         asked = case%contact%memory /= memory_residual
      case ('contact%residual')
         asked = pairs .and. allocated(case%contact%residual)
      case ("contact%memory = 'carried'")
         asked = pairs .and. case%contact%memory == memory_carried
      case (moving_gaps)
         asked = pairs .and. case%contact%highest_gap() > 0
      case (sliding_side)
         asked = pairs
         if (pairs) asked = case%contact%slides() .and. .not. facts%acts_at_once
      case ('pairs with two tangential directions')
         asked = has_two_tangents(case)
      case ('a law of velocities, whose pairs do not stick')
         asked = pairs
         if (pairs) asked = is_viscous(case%contact)
      case ('a law that takes integrals between its events')
         asked = pairs .and. facts%needs_projection
      case ('a law without forces above the harmonics of the balance')
         asked = pairs .and. .not. facts%has_tail
      case ('a law of hysteresis, whose paths start at the assembly')
         asked = pairs .and. facts%is_hysteretic
      case ('a law without events, whose force is smooth')
         asked = pairs .and. .not. facts%has_events
      case ('a law that is not integrated in time')
         asked = pairs .and. .not. facts%is_integrated
      case ('a law that does not measure slip')
         asked = pairs .and. .not. facts%measures_slip
      case ('a law without Floquet multipliers')
         asked = pairs .and. .not. facts%has_multipliers
         ! Where it is the side that slides, another law does not help, and a rule names the side.
         if (asked) asked = facts%acts_at_once .or. .not. case%contact%slides()
      case default
         asked = .false.
         known = .false.
      end select
   end subroutine of_joint

   !> Whether a function of a user steps states of its own.
   pure logical function has_states(case)
      type(case_type), intent(in) :: case
      integer :: k

      has_states = .false.
      if (.not. allocated(case%elements%slot)) return
      do k = 1, size(case%elements%slot)
         associate (group => case%elements%slot(k)%group)
            if (.not. allocated(group%function)) cycle
            has_states = has_states .or. any(group%function%n_state > 0)
         end associate
      end do
   end function has_states

   !> Whether a pair slides in two directions.
   pure logical function has_two_tangents(case)
      type(case_type), intent(in) :: case

      has_two_tangents = .false.
      if (case%contact%n_pairs == 0) return
      associate (c => case%contact)
         has_two_tangents = any(all(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1))
      end associate
   end function has_two_tangents

   !> Wear and missions.
   subroutine of_wear(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known
      logical :: flows

      flows = case%analysis == analysis_wear .and. case%wear%scheme == wear_pseudo_time
      known = .true.
      select case (phrase)
      case ('wear%follow_resonance = .true.')
         asked = case%analysis == analysis_wear .and. case%wear%follow_resonance
      case ('group &mission')
         asked = case%mission%is_wanted()
      case ("wear%mu_by other than 'none'")
         asked = case%wear%mu_by /= mu_by_none
      case ('wear%n_cycles')
         asked = case%wear%n_cycles < huge(1.0_wp)
      case ('wear%check_steps = .true.')
         asked = case%wear%check_steps
      case ('wear%error_tolerance')
         asked = case%analysis == analysis_wear .and. case%wear%error_tolerance > 0.0_wp
      case ("wear by pseudo_time%scheme = 'bdf', which builds on earlier steps")
         asked = flows .and. case%pseudo_time%scheme == scheme_bdf
      case ("wear by pseudo_time%scheme = 'runge_kutta'")
         asked = flows .and. case%pseudo_time%scheme == scheme_runge_kutta
      case ("wear by pseudo_time%scheme = 'implicit_euler'")
         asked = flows .and. case%pseudo_time%scheme == scheme_implicit_euler
      case default
         asked = .false.
         known = .false.
      end select
   end subroutine of_wear

   !> Loads of sectors are known by their waves only: one that does not drive what is asked for
   !> shows at the first point.
   subroutine of_load(case, phrase, asked, known)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: phrase
      logical, intent(out) :: asked, known
      logical :: first, any_harmonic

      known = .true.
      asked = .false.
      select case (phrase)
      case ('a case without a load in harmonic 1 for the mode')
         ! Loads of matrices of every nodal diameter stand with these.
         if (case%model%cyclic%has_nodal()) return
         call find_loads(case, first, any_harmonic)
         asked = .not. first
      case ('load%harmonic_scale = 0')
         asked = .not. abs(case%model%harmonic_scale) > 0.0_wp
      case ('a case without a vibratory load')
         if (case%model%cyclic%has_sectors()) return
         call find_loads(case, first, any_harmonic)
         asked = .not. any_harmonic
      case ('a case without a load in harmonic 1')
         if (case%model%cyclic%has_sectors()) return
         call find_loads(case, first, any_harmonic)
         asked = any_harmonic .and. .not. first
      case ("control%of = 'first_harmonic'")
         asked = case%control%is_wanted() .and. case%control%of == of_first_harmonic
      case ("resonance%condition = 'phase'")
         asked = case%analysis == analysis_resonance .and. &
                 case%resonance%condition == condition_phase
      case default
         known = .false.
      end select
   end subroutine of_load

   !> Whether a load acts in harmonic 1, and in any.
   pure subroutine find_loads(case, first, any_harmonic)
      type(case_type), intent(in) :: case
      logical, intent(out) :: first, any_harmonic

      first = .false.
      associate (model => case%model)
         if (allocated(model%load_cosine)) first = any(abs(model%load_cosine) > 0.0_wp)
         if (allocated(model%load_sine)) first = first .or. any(abs(model%load_sine) > 0.0_wp)
         any_harmonic = first
         if (allocated(model%load_wave)) then
            any_harmonic = first .or. any(abs(model%load_wave) > 0.0_wp)
            if (allocated(model%waves%harmonic)) first = first .or. &
               (any(abs(model%load_wave) > 0.0_wp) .and. any(model%waves%harmonic == 1))
         end if
      end associate
   end subroutine find_loads

end module fw_features
