!> Keys that are sound one by one and cannot be run together: a row each, with what to do instead.
!>
!> A row names two features of a case in the words of fw_features; the first row whose features are
!> both asked for is told, as `asks does not go with forbids: remedy`. `fw_run --rules` lists them.
!> What needs numbers of the case (sizes, ranges between keys) is in fw_combinations.
module fw_rules
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_features, only: growing_stability, asks_for, feature_length, feature_text, hysteretic, &
      in_time, matrices_alone, moving_gaps, of_air, of_bounds, of_campbell, of_population, &
      of_ringdown, sliding_side, stress
   implicit none (type, external)
   private

   public :: apply_rules, rule_type, rules, write_rules

   !> Two phrases that do not go together, and what to use instead.
   type :: rule_type
      character(feature_length) :: asks, forbids
      character(128) :: remedy
   end type rule_type

   character(*), parameter :: between = ' does not go with ', &
                              of_residual = "contact%memory = 'residual'"

   !> Nonlinear modes and resonances are balances of given harmonics with borders of their own,
   !> followed by Newton's method.
   type(rule_type), parameter :: of_modes(*) = [ &
      rule_type("case%analysis = 'mode'", "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type("case%analysis = 'mode'", 'harmonics%accuracy', 'give n_harmonics'), &
      rule_type("case%analysis = 'mode'", "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type("case%analysis = 'mode'", "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type("case%analysis = 'mode'", 'output%histories', 'leave it out'), &
      rule_type("case%analysis = 'mode'", 'output%tail', 'take more n_harmonics'), &
      rule_type("case%analysis = 'mode'", 'a law of velocities, whose pairs do not stick', &
                "no mode starts from stuck pairs; use 'penalty' or 'dlft'"), &
      rule_type('mode%synthesis', 'a case without a load in harmonic 1 for the mode', &
                'set load%cosine or load%sine'), &
      rule_type("case%analysis = 'resonance'", "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type("case%analysis = 'resonance'", 'harmonics%accuracy', 'give n_harmonics'), &
      rule_type("case%analysis = 'resonance'", "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type("case%analysis = 'resonance'", "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type("case%analysis = 'resonance'", 'output%histories', 'leave it out'), &
      rule_type("case%analysis = 'resonance'", 'output%tail', 'take more n_harmonics'), &
      rule_type("case%analysis = 'resonance'", "sweep%continuation = 'arclength'", &
                "&sweep is where the first resonance is looked for: use 'natural' "// &
                '(resonance%continuation follows folds)'), &
      rule_type("case%analysis = 'resonance'", 'sweep%stability = .true.', 'leave it out'), &
      rule_type("case%analysis = 'resonance'", 'a sweep of fewer than three points', &
                'a resonance is looked for between sweep%start and end: give three n_points '// &
                'at least'), &
      rule_type("case%analysis = 'resonance'", 'a case without a vibratory load', &
                'set load%cosine or load%sine'), &
      rule_type("resonance%condition = 'phase'", 'a case without a load in harmonic 1', &
                "use 'amplitude'")]

   !> Points of a sweep stand by themselves, have one length, or are compared with each other.
   type(rule_type), parameter :: of_sweeps(*) = [ &
      rule_type('sweep%stability = .true.', in_time, &
                'what an integration comes to is stable by itself; leave it out'), &
      rule_type("contact%memory = 'carried'", "sweep%continuation = 'arclength'", &
                "a branch turns back on itself; use 'assembly'"), &
      rule_type('sweep%refine = .true.', "case%analysis other than 'frf'", 'leave it out'), &
      rule_type('sweep%refine = .true.', 'sweep%n_points = 1', 'leave it out'), &
      rule_type('sweep%refine = .true.', "sweep%continuation = 'arclength'", 'leave it out'), &
      rule_type('sweep%refine = .true.', "contact%memory = 'carried'", &
                'a point depends on those before; leave it out'), &
      rule_type('a piece of a sweep', "case%analysis other than 'frf'", 'run it whole'), &
      rule_type('a piece of a sweep', "sweep%continuation = 'arclength'", 'run it whole'), &
      rule_type('a piece of a sweep', 'group &control', 'run it whole'), &
      rule_type('a piece of a sweep', "contact%memory = 'carried'", &
                'a point depends on all those before; run it whole'), &
      rule_type('sweep%parameter', 'group &sensitivity', &
                'derivatives are those at the values of the case; leave one of the two out'), &
      rule_type('model%modal_damping_up_to', 'group &cyclic', &
                'all modes of the tied sectors are damped; leave it out'), &
      rule_type('sweep%parameter', 'output%tail', 'take more n_harmonics'), &
      rule_type('sweep%parameter', 'sweep%refine = .true.', &
                'no maxima are looked for; leave it out'), &
      rule_type('harmonics%accuracy', "case%analysis other than 'frf' or 'point'", &
                'leave it out, and give n_harmonics'), &
      rule_type('harmonics%accuracy', "sweep%continuation = 'arclength'", &
                'leave it out, and give n_harmonics'), &
      rule_type('harmonics%accuracy', 'output%histories', &
                'they have one length: leave it out, and give n_harmonics and n_time as large '// &
                'as a run with accuracy reports'), &
      rule_type('harmonics%accuracy', "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type('contact%slider_1 or slider_2', "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type('contact%slider_1 or slider_2', in_time, "use 'frf' or 'point'"), &
      rule_type('contact%slider_1 or slider_2', "case%analysis = 'mode'", 'leave it out'), &
      rule_type('contact%slider_1 or slider_2', 'a law that does not remember where pairs start', &
                "use 'penalty' or 'dlft'"), &
      rule_type('contact%slider_1 or slider_2', &
                'a law of hysteresis, whose paths start at the assembly', 'leave it out'), &
      rule_type('contact%slider_1 or slider_2', 'a law that takes integrals between its events', &
                "use 'penalty' or 'dlft'"), &
      rule_type('contact%residual', "contact%memory other than 'residual'", &
                "set memory = 'residual'"), &
      rule_type(of_residual, 'pairs with two tangential directions', &
                "use 'assembly' with contact%slider_1 and slider_2"), &
      rule_type(of_residual, in_time, "use 'frf' or 'point'"), &
      rule_type(of_residual, "case%analysis = 'mode'", "use 'assembly'"), &
      rule_type(of_residual, 'sweep%stability = .true.', 'leave stability out'), &
      rule_type(of_residual, 'a law that does not remember where pairs start', &
                "use 'penalty' or 'dlft'"), &
      rule_type(of_residual, 'a law of hysteresis, whose paths start at the assembly', &
                "use 'assembly'"), &
      rule_type(of_residual, 'a law that takes integrals between its events', &
                "use 'penalty' or 'dlft'")]

   !> Further solutions are looked for in one balance by Newton's method, from none but itself.
   type(rule_type), parameter :: of_solutions(*) = [ &
      rule_type('solver%n_solutions > 1', "case%analysis other than 'point'", &
                "use 'point', frequency by frequency; a branch (sweep%continuation = "// &
                "'arclength') follows folds"), &
      rule_type('solver%n_solutions > 1', "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type('solver%n_solutions > 1', 'harmonics%accuracy', 'give n_harmonics'), &
      rule_type('solver%n_solutions > 1', 'group &control', 'give the load'), &
      rule_type('solver%n_solutions > 1', "contact%memory = 'carried'", "use 'assembly'")]

   !> The factor of the load is an unknown of its own: what follows solves without such a border,
   !> or for a load that the case gives.
   type(rule_type), parameter :: of_control(*) = [ &
      rule_type('group &control', "case%analysis other than 'frf' or 'point'", &
                "use 'frf' or 'point'"), &
      rule_type('group &control', "sweep%parameter = 'load%harmonic_scale'", &
                'the load is found for each amplitude; sweep frequencies, or another parameter'), &
      rule_type('group &control', "sweep%parameter = 'load%static_scale' through 0", &
                'sweep on one side of it'), &
      rule_type('group &control', "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type('group &control', "harmonics%method = 'hdhb'", "use 'hbm'"), &
      rule_type('group &control', 'harmonics%accuracy', 'give n_harmonics'), &
      rule_type('group &control', "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type('group &control', 'sweep%refine = .true.', &
                'no maxima are looked for; leave it out'), &
      rule_type('group &control', 'output%tail', 'take more n_harmonics'), &
      rule_type('group &control', 'load%harmonic_scale = 0', &
                'a vibratory load is scaled: give another scale'), &
      rule_type('group &control', 'a case without a vibratory load', &
                'set load%cosine or load%sine'), &
      rule_type("control%of = 'first_harmonic'", 'a case without a load in harmonic 1', &
                "use 'largest'")]

   !> Derivatives are those of a balance of given harmonics; carried positions depend on all points
   !> before.
   type(rule_type), parameter :: of_derivatives(*) = [ &
      rule_type('group &sensitivity', &
                "case%analysis other than 'frf', 'point', 'resonance' or 'mode'", &
                'leave one of the two out'), &
      rule_type('group &sensitivity', "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type('group &sensitivity', "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type('group &sensitivity', "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type('group &sensitivity', 'harmonics%accuracy', 'give n_harmonics')]

   !> What waves around a cyclic structure, and the motion of all its sectors, are not solved with.
   type(rule_type), parameter :: of_sectors(*) = [ &
      rule_type('cyclic%mistuned = .true.', of_campbell, "use 'frf' along a line of the diagram"), &
      rule_type('cyclic%mistuned = .true.', "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type('cyclic%mistuned = .true.', 'harmonics%accuracy', &
                'give n_harmonics (left out, an accuracy chooses them), as many as a run of '// &
                'the tuned wave reports'), &
      rule_type('cyclic%mistuned = .true.', 'group &control', 'give the load'), &
      rule_type('group &cyclic', in_time, &
                "use 'frf' or 'point', or model all sectors"), &
      rule_type('group &cyclic', 'sweep%stability = .true.', &
                'a wave may become unstable to motions of other nodal diameters; leave it out'), &
      rule_type('group &cyclic', "solver%kind = 'pseudo_time'", "use 'newton'"), &
      rule_type('group &cyclic', 'output%tail', 'take more n_harmonics')]

   !> The speed goes from one end of the diagram to the other.
   type(rule_type), parameter :: of_diagrams(*) = [ &
      rule_type(of_campbell, 'model%rotation_speed', 'give campbell%start and end'), &
      rule_type(of_population, "sweep%continuation = 'arclength'", "use 'natural'"), &
      rule_type(of_population, 'sweep%parameter', 'sweep over the frequency'), &
      rule_type(of_population, 'sweep%refine = .true.', 'rows are not kept; leave it out'), &
      rule_type(of_population, 'output%histories', 'points are not kept; leave it out'), &
      rule_type(of_population, "contact%memory = 'carried'", "use 'assembly'")]

   !> A range is over residual tractions at given frequencies, by derivatives of a balance of given
   !> harmonics.
   type(rule_type), parameter :: of_ranges(*) = [ &
      rule_type(of_bounds, "contact%memory = 'carried'", "use 'assembly'"), &
      rule_type(of_bounds, 'a case without contact pairs', &
                'give group &contact, or take a model file with contact'), &
      rule_type(of_bounds, "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type(of_bounds, "solver%kind other than 'newton'", "use 'newton'"), &
      rule_type(of_bounds, "sweep%continuation = 'arclength'", "use 'natural'"), &
      rule_type(of_bounds, 'sweep%parameter', 'sweep over the frequency')]

   !> Matrices without a time domain, or those that this part of the program does not take.
   type(rule_type), parameter :: of_matrices(*) = [ &
      rule_type(hysteretic, in_time, &
                "has no time domain: use 'frf' or 'point', or viscous damping"), &
      rule_type(hysteretic, 'sweep%stability = .true.', &
                'has no time domain: leave stability out, or use viscous damping'), &
      rule_type(matrices_alone, in_time, "use 'frf' or 'point'"), &
      rule_type(matrices_alone, "solver%kind = 'pseudo_time'", "use 'newton'"), &
      rule_type(matrices_alone, 'output%tail', 'take more n_harmonics'), &
      rule_type('sweep%speed_order', &
                "case%analysis other than 'frf', 'point', 'population' or 'resonance'", &
                'give model%rotation_speed'), &
      rule_type('sweep%speed_order', 'a resonance%parameter of the matrices', &
                'the speed follows the frequency, and the matrices with it: follow another one'), &
      rule_type('sweep%speed_order', growing_stability, &
                'leave stability out, or give model%rotation_speed, speed by speed'), &
      rule_type('sweep%speed_order', 'sweep%parameter', &
                'the speed follows the frequency: sweep over this')]

   !> By what the law of the pairs can do, not by its name: a new law needs no new row.
   type(rule_type), parameter :: of_laws(*) = [ &
      rule_type('a law that takes integrals between its events', &
                "harmonics%method other than 'hbm'", "use 'hbm'"), &
      rule_type('a law that takes integrals between its events', &
                "harmonics%sampling = 'uniform'", "leave it out, or take 'events'"), &
      rule_type("contact%memory = 'carried'", &
                'a law of hysteresis, whose paths start at the assembly', "use 'assembly'"), &
      rule_type('output%tail', 'a law without forces above the harmonics of the balance', &
                "use contact%law = 'rigid'"), &
      rule_type('output%tail', 'pairs with two tangential directions', 'leave it out'), &
      rule_type('output%tail', 'harmonics%accuracy', 'give n_harmonics'), &
      rule_type('output%tail', "sweep%continuation = 'arclength'", 'leave it out'), &
      rule_type('output%tail', "case%analysis other than 'frf' or 'point'", 'leave it out'), &
      rule_type('a law without events, whose force is smooth', "harmonics%sampling = 'events'", &
                "leave it to 'auto'"), &
      rule_type('a law that is not integrated in time', in_time, &
                "use 'penalty' or 'dlft', or 'frf' and 'point'"), &
      rule_type('a law that does not measure slip', "case%analysis = 'wear'", &
                "use 'dlft' (nodes without mass), 'dlft_velocity' or 'penalty'"), &
      rule_type('sweep%stability = .true.', 'a law without Floquet multipliers', &
                "use contact%law = 'penalty' without normal_law, or leave stability out")]

   !> Obstacles that move drive the vibration, and are no part of a perturbation.
   type(rule_type), parameter :: of_obstacles(*) = [ &
      rule_type("case%analysis = 'mode'", moving_gaps, &
                'a mode is a motion without excitation: leave them out'), &
      rule_type("case%analysis = 'mode'", sliding_side, &
                'a mode is a motion without excitation: leave the speeds out'), &
      rule_type('sweep%stability = .true.', sliding_side, 'leave stability out'), &
      rule_type("contact%memory = 'carried'", sliding_side, "use 'assembly'")]

   !> Released, it is left alone.
   type(rule_type), parameter :: of_free_decay(*) = [ &
      rule_type(of_ringdown, moving_gaps, 'a free decay has no excitation: leave them out'), &
      rule_type(of_ringdown, sliding_side, &
                'a free decay has no excitation: leave the speeds out')]

   !> Loads of supports are those of stiffness, damping and mass.
   type(rule_type), parameter :: of_base(*) = [ &
      rule_type('group &base', of_air, 'give the load that the base makes')]

   !> Groups of elements that are neither pairs nor springs.
   type(rule_type), parameter :: of_elements(*) = [ &
      rule_type('states of a law of a user', in_time, &
                "use 'frf' or 'point'"), &
      rule_type('states of a law of a user', 'sweep%stability = .true.', &
                'perturbations of its states are not followed: leave stability out')]

   type(rule_type), parameter :: of_wear(*) = [ &
      rule_type("case%analysis = 'wear'", 'a case without contact pairs', &
                'give group &contact, or take a model file with contact'), &
      rule_type('wear%follow_resonance = .true.', &
                "wear by pseudo_time%scheme = 'bdf', which builds on earlier steps", &
                "use 'rosenbrock', or wear%scheme = 'implicit'"), &
      rule_type("case%analysis = 'wear'", "wear by pseudo_time%scheme = 'runge_kutta'", &
                "wear is stiff: use 'implicit_euler', 'rosenbrock' or 'bdf'"), &
      rule_type('wear%error_tolerance', "wear by pseudo_time%scheme = 'implicit_euler'", &
                'it estimates no error: give wear%max_depth_step, or use '// &
                "'rosenbrock' or 'bdf'"), &
      rule_type("wear%mu_by other than 'none'", "case%analysis other than 'wear'", &
                "use 'wear'"), &
      rule_type("wear%mu_by other than 'none'", 'a pair without a normal dof', &
                'give it one, which a static load presses'), &
      rule_type("wear%mu_by other than 'none'", "contact%normal_law other than 'unilateral'", &
                "use 'unilateral'"), &
      rule_type("wear%mu_by other than 'none'", 'sweep%stability = .true.', 'leave it out'), &
      rule_type('group &mission', "case%analysis other than 'wear'", "use 'wear'"), &
      rule_type('group &mission', 'wear%n_cycles', 'mission%cycles has those of each block'), &
      rule_type('group &mission', &
                "wear by pseudo_time%scheme = 'bdf', which builds on earlier steps", &
                "use 'rosenbrock', or wear%scheme = 'implicit'"), &
      rule_type('group &mission', 'wear%check_steps = .true.', &
                'leave it out, and compare with a smaller wear%error_tolerance'), &
      rule_type('group &mission', "contact%memory = 'carried'", "use 'assembly'")]

   type(rule_type), parameter :: of_stress(*) = [ &
      rule_type(stress, "harmonics%method = 'hdhb'", "use 'hbm', or stress%output = 'none'"), &
      rule_type(stress, in_time, &
                "use 'frf' or 'point', or stress%output = 'none'"), &
      rule_type(stress, "resonance%parameter = 'model%rotation_speed'", &
                "stress without motion changes with it: set stress%output = 'none'")]

   type(rule_type), parameter :: rules(*) = [of_modes, of_sweeps, of_control, of_sectors, &
                                             of_matrices, of_laws, of_base, of_elements, of_wear, &
                                             of_derivatives, of_stress, of_diagrams, of_ranges, &
                                             of_obstacles, of_free_decay, of_solutions]

contains

   !> Refuse the first pair of features that do not go together.
   subroutine apply_rules(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(rule_type) :: rule
      integer :: i

      do i = 1, size(rules)
         rule = rules(i)
         if (.not. asks_for(case, rule%asks)) cycle
         if (.not. asks_for(case, rule%forbids)) cycle
         call fatal_error(error, trim(feature_text(case, rule%asks))//between// &
                          trim(feature_text(case, rule%forbids))//': '//trim(rule%remedy), &
                          status_input)
         return
      end do
   end subroutine apply_rules

   !> A line for each rule.
   subroutine write_rules(unit)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      integer :: i

      do i = 1, size(rules)
         write (unit, '(5a)') trim(rules(i)%asks), between, trim(rules(i)%forbids), ': ', &
            trim(rules(i)%remedy)
      end do
   end subroutine write_rules

end module fw_rules
