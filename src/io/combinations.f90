!> Combinations of sound keys that cannot be run, each with what to use instead.
!>
!> Ranges of single keys are checked where the keys are declared, and what needs the model where it
!> is built. The first combination that fails is told: others may follow from it.
module fw_combinations
   use fw_case, only: case_type, analysis_frf, analysis_mode, analysis_modes, analysis_point, &
                      analysis_time, analysis_wear
   use fw_contact_data, only: contact_type
   use fw_contact_data, only: memory_carried
   use fw_error, only: error_type, fatal_error, status_input
   use fw_force_law, only: law_facts
   use fw_kinds, only: wp
   use fw_harmonics_options, only: method_hbm
   use fw_harmonics_options, only: sampling_events
   use fw_harmonics_options, only: sampling_uniform
   use fw_laws, only: facts_of
   use fw_laws, only: is_viscous
   use fw_laws, only: law_words
   use fw_path_checks, only: check_control
   use fw_path_checks, only: check_parameter_sweep
   use fw_memory, only: require_memory
   use fw_solver_options, only: continuation_arclength
   use fw_solver_options, only: continuation_natural
   use fw_solver_options, only: jacobian_analytic
   use fw_solver_options, only: scheme_bdf
   use fw_solver_options, only: scheme_implicit_euler
   use fw_solver_options, only: scheme_runge_kutta
   use fw_solver_options, only: solver_newton
   use fw_solver_options, only: solver_pseudo_time
   use fw_text, only: to_text
   use fw_wear_options, only: wear_explicit
   use fw_wear_options, only: wear_pseudo_time
   implicit none (type, external)
   private

   public :: check_combinations, has_history, is_linear_euler

   !> Accuracy that may be asked for, as a multiple of the tolerance of the iterations.
   real(wp), parameter :: least_to_tolerance = 100.0_wp

contains

   !> Refuse what is valid key by key but cannot be run together.
   subroutine check_combinations(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call check_mode(case, error)
      if (.not. allocated(error)) call check_jacobian(case, error)
      if (.not. allocated(error)) call check_memory(case, error)
      if (.not. allocated(error)) call check_refine(case, error)
      if (.not. allocated(error)) call check_piece(case, error)
      if (.not. allocated(error)) call check_parameter_sweep(case, error)
      if (.not. allocated(error)) call check_control(case, error)
      if (.not. allocated(error)) call check_adaptive(case, error)
      if (.not. allocated(error)) call check_accuracy(case, error)
      if (.not. allocated(error)) call check_stability(case, error)
      if (.not. allocated(error)) call check_loads(case, error)
      if (.not. allocated(error)) call check_cyclic(case, error)
      if (.not. allocated(error)) call check_law(case, error)
      if (.not. allocated(error)) call check_wear(case, error)
   end subroutine check_combinations

   !> A load of a harmonic that is left out would not act.
   subroutine check_loads(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      associate (highest => case%model%waves%highest())
         if (highest <= case%harmonics%n_harmonics .or. case%analysis == analysis_modes) return
         call fatal_error(error, 'harmonics%n_harmonics = '// &
                          to_text(case%harmonics%n_harmonics)//', but &load (or /load/harmonic '// &
                          'of the model file) acts in harmonic '//to_text(highest)//': must be '// &
                          'at least '//to_text(highest), status_input)
      end associate
   end subroutine check_loads

   !> What nonlinear modes are not made for.
   subroutine check_mode(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: with = " does not go with case%analysis = 'mode': "

      if (case%analysis /= analysis_mode) return
      if (case%harmonics%method /= method_hbm) then
         call fatal_error(error, 'harmonics%method'//with//"use 'hbm'", status_input)
      else if (case%harmonics%adaptive) then
         call fatal_error(error, 'harmonics%adaptive = .true.'//with//'give n_harmonics', &
                          status_input)
      else if (case%harmonics%accuracy > 0.0_wp) then
         call fatal_error(error, 'harmonics%accuracy'//with//'give n_harmonics', status_input)
      else if (case%solver%kind /= solver_newton) then
         call fatal_error(error, 'solver%kind'//with//"use 'newton'", status_input)
      else if (case%solver%jacobian /= jacobian_analytic) then
         call fatal_error(error, "solver%jacobian = 'difference'"//with//"use 'analytic'", &
                          status_input)
      else if (case%contact%memory == memory_carried .and. case%contact%n_pairs > 0) then
         call fatal_error(error, "contact%memory = 'carried'"//with//"use 'assembly'", &
                          status_input)
      else if (case%output%histories) then
         call fatal_error(error, 'output%histories'//with//'leave it out', status_input)
      else if (allocated(case%mode%synthesis) .and. .not. is_loaded(case)) then
         call fatal_error(error, 'mode%synthesis needs a vibratory load: set load%cosine or '// &
                          'load%sine', status_input)
      else if (case%output%tail > 0) then
         call fatal_error(error, 'output%tail'//with//'take more n_harmonics', status_input)
      end if
      if (allocated(error) .or. case%contact%n_pairs == 0) return
      if (is_viscous(case%contact%law)) then
         call fatal_error(error, "contact%law = '"//trim(law_words(case%contact%law))//"'"//with// &
                          'its pairs do not stick, so that no mode starts from stuck pairs; '// &
                          "use 'penalty' or 'dlft'", status_input)
      end if
   end subroutine check_mode

   !> Whether anything drives harmonic 1.
   pure logical function is_loaded(case)
      type(case_type), intent(in) :: case

      ! Loads of matrices of every nodal diameter stand with these.
      is_loaded = case%model%cyclic%has_nodal()
      if (is_loaded) return
      is_loaded = any(abs(case%model%load_cosine) > 0.0_wp) .or. &
                  any(abs(case%model%load_sine) > 0.0_wp)
      if (allocated(case%model%waves%harmonic)) then
         is_loaded = is_loaded .or. any(case%model%waves%harmonic == 1)
      end if
   end function is_loaded

   !> What waves around a cyclic structure cannot do.
   subroutine check_cyclic(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: with = ' does not go with a cyclic structure (&cyclic): '

      if (.not. case%model%cyclic%is_cyclic) return
      if (case%model%cyclic%is_mistuned) call check_mistuned(case, error)
      if (allocated(error)) return
      if (case%analysis == analysis_time) then
         call fatal_error(error, "case%analysis = 'time'"//with//"use 'frf' or 'point', or "// &
                          'model all sectors', status_input)
      else if (case%sweep%stability .and. case%analysis /= analysis_modes) then
         call fatal_error(error, 'sweep%stability = .true.'//with//'a wave may lose its '// &
                          'stability to motions of other nodal diameters; leave it out', &
                          status_input)
      else if (case%solver%kind == solver_pseudo_time) then
         call fatal_error(error, "solver%kind = 'pseudo_time'"//with//"use 'newton'", status_input)
      else if (case%output%tail > 0) then
         call fatal_error(error, 'output%tail'//with//'take more n_harmonics', status_input)
      end if
   end subroutine check_cyclic

   !> What the motion of all sectors is not solved with.
   subroutine check_mistuned(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: with = ' does not go with cyclic%mistuned = .true.: '

      if (all(case%analysis /= [analysis_frf, analysis_point, analysis_wear])) then
         call fatal_error(error, "case%analysis"//with//"use 'frf', 'point' or 'wear', or "// &
                          'leave mistuned out', status_input)
      else if (case%harmonics%method /= method_hbm) then
         call fatal_error(error, 'harmonics%method'//with//"use 'hbm'", status_input)
      else if (case%harmonics%adaptive) then
         call fatal_error(error, 'harmonics%adaptive = .true.'//with//'give n_harmonics', &
                          status_input)
      else if (case%harmonics%accuracy > 0.0_wp) then
         call fatal_error(error, 'harmonics%accuracy (also by leaving n_harmonics out)'//with// &
                          'give n_harmonics, as many as a run of the tuned wave with accuracy '// &
                          'reports', status_input)
      else if (case%sensitivity%is_wanted()) then
         call fatal_error(error, 'group &sensitivity'//with//'leave it out', status_input)
      else if (case%over%is_wanted()) then
         call fatal_error(error, 'sweep%parameter'//with//'sweep over the frequency', status_input)
      else if (case%control%is_wanted()) then
         call fatal_error(error, 'group &control'//with//'give the load', status_input)
      else
         call require_sectors(case, error)
      end if
   end subroutine check_mistuned

   !> Room for the blocks of all nodal diameters, complex ones and factors of the preconditioner in
   !> single precision: asked for before any of them is begun.
   subroutine require_sectors(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: n_slots, blocks

      associate (n => case%model%cyclic%n_sectors)
         ! Relative coordinates of a sector at most; few modes are kept beside.
         n_slots = (3.0_wp*case%contact%n_pairs + case%springs%n_springs)/n
         blocks = 3.0_wp*n_slots**2*n*(case%harmonics%n_harmonics + 1.0_wp)
         call require_memory(blocks, '&cyclic mistuned = .true. with n_sectors = '// &
                             to_text(n)//', '//to_text(case%contact%n_pairs/n)//' pairs in '// &
                             'each and &harmonics n_harmonics = '// &
                             to_text(case%harmonics%n_harmonics), 'take fewer harmonics or '// &
                             'pairs, or the tuned wave (mistuned = .false.)', error)
      end associate
   end subroutine require_sectors

   !> What the law of the pairs cannot do.
   subroutine check_law(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(law_facts) :: facts
      character(:), allocatable :: law

      if (case%contact%n_pairs == 0) return
      ! By what the law can do, not by its name: a new law needs no new check.
      facts = facts_of(case%contact%law)
      law = "contact%law = '"//trim(law_words(case%contact%law))//"'"
      if (facts%needs_projection .and. case%harmonics%method /= method_hbm) then
         call fatal_error(error, law//" needs harmonics%method = 'hbm': its forces are "// &
                          "integrals between events, which collocation does not take", status_input)
      else if (facts%needs_projection .and. case%harmonics%sampling == sampling_uniform) then
         call fatal_error(error, law//" follows events: leave harmonics%sampling out, or take "// &
                          "'events'", status_input)
      else if (case%output%tail > 0 .and. .not. facts%has_tail) then
         call fatal_error(error, "output%tail needs contact%law = 'rigid', whose forces are "// &
                          'known in every harmonic', status_input)
      else if (case%output%tail > 0 .and. any(both_tangents(case%contact))) then
         call fatal_error(error, 'output%tail needs pairs with one tangential direction', &
                          status_input)
      else if (case%output%tail > 0 .and. &
               (case%harmonics%adaptive .or. case%harmonics%accuracy > 0.0_wp .or. &
                case%sweep%continuation == continuation_arclength .or. &
                .not. any(case%analysis == [analysis_frf, analysis_point]))) then
         call fatal_error(error, 'output%tail goes with natural sweeps and points of given '// &
                          'n_harmonics: leave it out', status_input)
      else if (case%harmonics%sampling == sampling_events .and. .not. facts%has_events) then
         call fatal_error(error, law//" does not go with harmonics%sampling = 'events': its "// &
                          "force is smooth; leave it to 'auto'", status_input)
      else if (case%analysis == analysis_time .and. .not. facts%is_integrated) then
         call fatal_error(error, law//" does not go with case%analysis = 'time', which does "// &
                          'not know the law', status_input)
      else if (case%analysis == analysis_wear .and. .not. facts%measures_slip) then
         call fatal_error(error, law//" does not wear yet: use 'dlft' (nodes without mass), "// &
                          "'dlft_velocity' or 'penalty' for analysis = 'wear'", status_input)
      end if
   end subroutine check_law

   !> Which pairs have two tangential directions (n_pairs).
   pure function both_tangents(contact) result(both)
      type(contact_type), intent(in) :: contact
      logical :: both(contact%n_pairs)

      both = all(contact%side_1(1:2, :) /= 0 .or. contact%side_2(1:2, :) /= 0, dim=1)
   end function both_tangents

   !> What wear needs, and which schemes step it.
   subroutine check_wear(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%analysis /= analysis_wear) return
      if (case%contact%n_pairs == 0) then
         call fatal_error(error, "case%analysis = 'wear' needs contact pairs, and there are "// &
                          "none: give group &contact, or take a model file with contact", &
                          status_input)
         return
      end if
      call check_order(case, error)
      if (allocated(error)) return
      if (has_history(case) .and. case%wear%follow_resonance) then
         call fatal_error(error, "wear%follow_resonance = .true. does not go with "// &
                          "pseudo_time%scheme = 'bdf', which builds on earlier steps: use "// &
                          "'rosenbrock', or wear%scheme = 'implicit'", status_input)
         return
      end if
      if (case%wear%scheme == wear_pseudo_time .and. &
          case%pseudo_time%scheme == scheme_runge_kutta) then
         call fatal_error(error, "pseudo_time%scheme = 'runge_kutta' does not step wear, "// &
                          "which is stiff: use 'implicit_euler', 'rosenbrock' or 'bdf'", &
                          status_input)
      end if
   end subroutine check_wear

   !> What sets the steps has to be something that the scheme has.
   subroutine check_order(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%wear%scheme == wear_explicit .and. case%wear%order > 2) then
         call fatal_error(error, 'wear%order = '//to_text(case%wear%order)// &
                          ": scheme = 'explicit' has orders 1 and 2, 'implicit' 1 to 4", &
                          status_input)
      else if (case%wear%scheme == wear_pseudo_time .and. case%wear%order > 0) then
         call fatal_error(error, 'wear%order = '//to_text(case%wear%order)// &
                          ": with scheme = 'pseudo_time' pseudo_time%scheme sets the order; "// &
                          'leave wear%order out', status_input)
      else if (is_linear_euler(case) .and. case%wear%error_tolerance > 0.0_wp) then
         call fatal_error(error, 'wear%error_tolerance does not go with '// &
                          "pseudo_time%scheme = 'implicit_euler', which estimates no error: "// &
                          "give wear%max_depth_step, or use 'rosenbrock' or 'bdf'", &
                          status_input)
      end if
   end subroutine check_order

   !> Rigid contact has no derivative in the state from which a multiplier could be computed.
   subroutine check_stability(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(law_facts) :: facts

      if (.not. case%sweep%stability) return
      if (case%contact%n_pairs == 0) return
      facts = facts_of(case%contact%law)
      if (facts%has_multipliers) return
      call fatal_error(error, "sweep%stability = .true. needs contact%law = 'penalty' (or "// &
                       "no contact pairs): the law has no Floquet multipliers", status_input)
   end subroutine check_stability

   !> Differences serve the solution of a point at given depths; the rest takes the derivative
   !> apart.
   subroutine check_jacobian(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%solver%jacobian == jacobian_analytic) return
      if (case%solver%kind /= solver_pseudo_time .and. case%analysis /= analysis_wear .and. &
          case%sweep%continuation == continuation_natural) return
      call fatal_error(error, "solver%jacobian = 'difference' goes with natural sweeps and "// &
                       "points by 'newton', 'powell' or 'kinsol': use 'analytic'", &
                       status_input)
   end subroutine check_jacobian

   !> A branch turns back on itself: there is no one last point to carry the memory from.
   subroutine check_memory(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%contact%memory /= memory_carried) return
      if (case%sweep%continuation /= continuation_arclength) return
      call fatal_error(error, &
         "contact%memory = 'carried' does not go with sweep%continuation "// &
                       "= 'arclength': use 'assembly'", status_input)
   end subroutine check_memory

   !> Where no maxima are looked for there is nothing that could become a row.
   subroutine check_refine(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%sweep%refine) return
      if (case%analysis /= analysis_frf .or. case%sweep%n_points < 2 .or. &
          case%sweep%continuation /= continuation_natural) then
         call fatal_error(error, "sweep%refine = .true. goes with natural sweeps of "// &
                          "analysis = 'frf' with more than one point: leave it out", status_input)
      else if (case%contact%memory == memory_carried) then
         call fatal_error(error, "sweep%refine = .true. does not go with contact%memory = "// &
                          "'carried', where a point depends on those before: leave it out", &
                          status_input)
      end if
   end subroutine check_refine

   !> A piece of a sweep lies within it, and does not depend on the points before.
   subroutine check_piece(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: n_points

      if (.not. case%sweep%is_piece()) return
      n_points = case%sweep%n_points
      if (case%analysis /= analysis_frf .or. case%sweep%continuation /= continuation_natural .or. &
          case%control%is_wanted()) then
         call fatal_error(error, 'sweep%first_point, last_point and lead_points are of natural '// &
                          "sweeps of analysis = 'frf' without &control: leave them out", &
                          status_input)
      else if (case%contact%memory == memory_carried) then
         call fatal_error(error, "sweep%first_point, last_point and lead_points do not go with "// &
                          "contact%memory = 'carried', where a point depends on all those "// &
                          "before: leave them out", status_input)
      else if (case%sweep%first_point > n_points) then
         call fatal_error(error, 'sweep%first_point = '//to_text(case%sweep%first_point)// &
                          ': must be one of the '//to_text(n_points)//' points', status_input)
      else if (case%sweep%last_point > n_points .or. &
               (case%sweep%last_point > 0 .and. &
                case%sweep%last_point < case%sweep%first_point)) then
         call fatal_error(error, 'sweep%last_point = '//to_text(case%sweep%last_point)// &
                          ': must be from first_point = '//to_text(case%sweep%first_point)// &
                          ' to '//to_text(n_points)//', or 0', status_input)
      end if
   end subroutine check_piece

   !> Harmonics change from point to point of a natural sweep; a history has one length.
   subroutine check_adaptive(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%harmonics%adaptive) return
      if (all(case%analysis /= [analysis_frf, analysis_point]) .or. &
          case%sweep%continuation /= continuation_natural) then
         call fatal_error(error, 'harmonics%adaptive = .true. goes with natural sweeps and '// &
                          'points: use .false.', status_input)
      else if (case%output%histories .and. case%harmonics%n_time == 0) then
         call fatal_error(error, 'harmonics%adaptive = .true. with output%histories needs '// &
                          'a given harmonics%n_time', status_input)
      end if
   end subroutine check_adaptive

   !> Levels change from point to point; the estimate compares solutions that start alike, and sees
   !> no error below that of the iterations.
   subroutine check_accuracy(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%harmonics%accuracy <= 0.0_wp) return
      if (all(case%analysis /= [analysis_frf, analysis_point]) .or. &
          case%sweep%continuation /= continuation_natural) then
         call fatal_error(error, 'harmonics%accuracy goes with natural sweeps and points: '// &
                          'leave it out, and give n_harmonics', status_input)
      else if (case%output%histories) then
         call fatal_error(error, 'harmonics%accuracy does not go with output%histories, '// &
                          'which have one length: leave it out, and give n_harmonics and '// &
                          'n_time as large as a run with accuracy reports', status_input)
      else if (case%contact%memory == memory_carried) then
         call fatal_error(error, "harmonics%accuracy does not go with contact%memory = "// &
                          "'carried': use 'assembly'", status_input)
      else if (case%harmonics%accuracy < least_to_tolerance*case%solver%tolerance) then
         call fatal_error(error, 'harmonics%accuracy must be at least 100 times '// &
                          'solver%tolerance: lower the tolerance', status_input)
      end if
   end subroutine check_accuracy

   !> Whether wear steps are linearly implicit Euler steps in pseudo-time.
   pure logical function is_linear_euler(case)
      type(case_type), intent(in) :: case

      is_linear_euler = case%wear%scheme == wear_pseudo_time .and. &
                        case%pseudo_time%scheme == scheme_implicit_euler
   end function is_linear_euler

   !> Whether the steps of a wear run build on earlier ones.
   pure logical function has_history(case)
      type(case_type), intent(in) :: case

      has_history = case%wear%scheme == wear_pseudo_time .and. &
                    case%pseudo_time%scheme == scheme_bdf
   end function has_history

end module fw_combinations
