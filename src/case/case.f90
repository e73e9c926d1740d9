!> A case: everything that one run needs, validated. Composed of the option types of the layers
!> that use them; see each for its defaults.
module fw_case
   use fw_bounds_options, only: bounds_options
   use fw_campbell_options, only: campbell_options
   use fw_case_source, only: case_source
   use fw_body, only: body_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least, from_to
   use fw_kinds, only: wp
   use fw_mission_options, only: mission_options
   use fw_mode_options, only: mode_options
   use fw_parameter_sweep, only: parameter_sweep
   use fw_population_options, only: population_options
   use fw_control_options, only: control_options
   use fw_harmonics_options, only: harmonics_options
   use fw_resonance_options, only: resonance_options
   use fw_ringdown_options, only: ringdown_options
   use fw_sensitivity_options, only: sensitivity_options
   use fw_solver_options, only: solver_options, pseudo_time_options, sweep_options
   use fw_stress_options, only: stress_options
   use fw_text, only: string_type
   use fw_wear_options, only: wear_options
   use fw_time_options, only: time_options
   implicit none (type, external)
   private

   public :: analyses, case_type, output_options
   public :: analysis_words, analysis_frf, analysis_point, analysis_wear, analysis_time, &
             analysis_modes, analysis_mode, analysis_resonance, analysis_campbell, &
             analysis_population, analysis_bounds, analysis_ringdown

   !> What the program knows of an analysis beside its word. A new one is a row of `analyses`, a
   !> line in fw_run and a file of its own.
   type :: analysis_facts
      !> The result has points: natural frequencies are none.
      logical :: has_points = .true.
      !> Harmonic balance.
      logical :: is_balanced = .true.
      !> Each point is a response that stands by itself, with other ways to it where one fails.
      logical :: is_response = .false.
      !> Points one behind the other over a range.
      logical :: is_sweep = .false.
      !> The frequency is an unknown; without a load.
      logical :: finds_frequency = .false., is_free = .false.
      logical :: wears = .false., is_resonance = .false., is_integrated = .false.
      !> Over the rotation speed, which other analyses have one of.
      logical :: is_campbell = .false.
      !> Points of many disks, of which the largest counts: none is a row of the result.
      logical :: is_population = .false.
      !> Over the residual tractions of the pairs, which other analyses have one set of.
      logical :: is_range = .false.
      !> A free motion, from a start that is given.
      logical :: is_ringdown = .false.
   end type analysis_facts

   integer, parameter :: analysis_frf = 1, analysis_point = 2, analysis_wear = 3, &
                         analysis_time = 4, analysis_modes = 5, analysis_mode = 6, &
                         analysis_resonance = 7, analysis_campbell = 8, &
                         analysis_population = 9, analysis_bounds = 10, analysis_ringdown = 11
   !> In the order of the constants.
   character(*), parameter :: analysis_words(*) = &
      [character(10) :: 'frf', 'point', 'wear', 'time', 'modes', 'mode', 'resonance', &
                        'campbell', 'population', 'bounds', 'ringdown']
   type(analysis_facts), parameter :: analyses(*) = [ &
      analysis_facts(is_response=.true., is_sweep=.true.), &
      analysis_facts(is_response=.true.), &
      analysis_facts(wears=.true.), &
      analysis_facts(is_integrated=.true., is_balanced=.false.), &
      analysis_facts(has_points=.false., is_balanced=.false.), &
      analysis_facts(is_free=.true., finds_frequency=.true.), &
      analysis_facts(is_resonance=.true., finds_frequency=.true.), &
      analysis_facts(is_campbell=.true., has_points=.false., is_balanced=.false.), &
      analysis_facts(is_population=.true., is_response=.true., is_sweep=.true.), &
      analysis_facts(is_range=.true., is_response=.true., is_sweep=.true.), &
      analysis_facts(is_ringdown=.true., has_points=.false., is_balanced=.false., &
                     is_integrated=.true.)]

   !> What is written (group &output).
   type :: output_options
      !> Path of the result file.
      character(:), allocatable :: file
      !> The input names the file; otherwise it has the name of the namelist.
      logical :: names_file = .false.
      !> Write one period of every observed quantity.
      logical :: histories = .false.
      !> Write the contact forces, states and dissipation.
      logical :: contact = .true.
      !> Highest harmonic of the answer that is given back, where it is above those of the balance.
      integer :: tail = 0
   contains
      procedure :: bind_keys => bind_output_keys
   end type output_options

   !> All that a run is asked for.
   type, extends(body_type) :: case_type
      character(:), allocatable :: title
      integer :: analysis = analysis_frf
      !> OpenMP threads (0: all).
      integer :: threads = 0
      !> Time after which the run ends with what is done [s] (0: none).
      real(wp) :: max_seconds = 0.0_wp
      type(harmonics_options) :: harmonics
      type(sweep_options) :: sweep
      !> What the sweep goes over where that is not the frequency.
      type(parameter_sweep) :: over
      !> Amplitudes that are given in place of the load.
      type(control_options) :: control
      type(solver_options) :: solver
      type(pseudo_time_options) :: pseudo_time
      type(wear_options) :: wear
      !> Blocks that wear in turn, in place of the cycles of one.
      type(mission_options) :: mission
      type(time_options) :: time
      type(output_options) :: output
      !> The effective input, as a namelist.
      character(:), allocatable :: namelist
      !> Absolute paths of the files it was read from: no result replaces them.
      type(string_type), allocatable :: inputs(:)
      !> What stands in the model file and nothing reads.
      type(string_type), allocatable :: unread(:)
      !> Up to which frequency the model was reduced [Hz]; 0: it does not say.
      real(wp) :: reduced_up_to = 0.0_wp
      !> Whether modes are damped by a ratio, and up to which frequency [Hz]; 0: all are.
      logical :: damps_modes = .false.
      real(wp) :: damps_modes_up_to = 0.0_wp
      !> Groups &contact and &spring that are given where there are no pairs and no springs.
      logical :: idle_contact = .false., idle_spring = .false.
      !> Result file of a wear run that is to be continued; not allocated to start anew. No key of
      !> the namelist.
      character(:), allocatable :: restart
      type(sensitivity_options) :: sensitivity
      type(mode_options) :: mode
      type(resonance_options) :: resonance
      type(stress_options) :: stress
      type(campbell_options) :: campbell
      type(bounds_options) :: bounds
      type(ringdown_options) :: ringdown
      !> Not allocated of a case that is none.
      type(population_options), allocatable :: population
      !> What others are read from; not allocated where none is.
      type(case_source), allocatable :: source
   contains
      procedure :: is_source
      procedure :: bind_keys => bind_case_keys
   end type case_type

contains

   !> Whether other cases are read from this one.
   pure logical function is_source(self)
      class(case_type), intent(in) :: self

      is_source = self%mission%is_wanted() .or. analyses(self%analysis)%is_campbell
   end function is_source

   !> The keys of group &case.
   subroutine bind_case_keys(self, keys)
      class(case_type), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('case', 'title, kind of analysis, threads')
      call keys%bind(key('title', 'stands in the result file', &
                         absent='title of the model file, or name of the namelist'), self%title)
      call keys%bind_word(key('analysis', &
                              'sweep, one frequency, wear, integration in time, linear modes, '// &
                              'nonlinear mode, resonance, Campbell diagram, mistuned disks, '// &
                              'range, free decay'), self%analysis, analysis_words)
      call keys%bind(key('threads', 'OpenMP threads; 0: as OpenMP gives', from_to(0, 1024)), &
                     self%threads)
      call keys%bind(key('max_seconds', &
                         'of the run, which ends with the points done; 0: no limit', &
                         at_least(0.0_wp), unit='s'), self%max_seconds)
   end subroutine bind_case_keys

   !> The keys of group &output but for what is observed.
   subroutine bind_output_keys(self, keys)
      class(output_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('output', 'result file, observed quantities')
      call keys%bind(key('file', 'result file, relative to the namelist', &
                         absent='name of the namelist with .h5'), self%file)
      call keys%bind(key('histories', 'one period of every quantity at every point; large'), &
                     self%histories)
      call keys%bind(key('contact', 'forces, states and dissipation'), self%contact)
      call keys%bind(key('tail', &
                         'highest harmonic of the answer above those of the balance; 0: theirs', &
                         from_to(0, 10000), only="law = 'rigid'"), self%tail)
   end subroutine bind_output_keys

end module fw_case
