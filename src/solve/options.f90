!> Options of the nonlinear solvers. Defaults live here and nowhere else; the words are those
!> of the namelist, in the order of the constants.
module fw_solver_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, below, from_to, operator(.and.), range_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: solver_options, pseudo_time_options, sweep_options
   public :: solver_newton, solver_powell, solver_kinsol, solver_pseudo_time
   public :: linear_auto, linear_lu, linear_krylov
   public :: flow_rotated, flow_identity, flow_preconditioned
   public :: scheme_words, scheme_implicit_euler, scheme_bdf, scheme_rosenbrock, &
             scheme_runge_kutta
   public :: unit_words, unit_rad_per_second, unit_hertz
   public :: continuation_words, continuation_natural, continuation_arclength, most_points

   character(*), parameter :: solver_words(*) = &
      [character(11) :: 'newton', 'powell', 'kinsol', 'pseudo_time']
   integer, parameter :: solver_newton = 1, solver_powell = 2, solver_kinsol = 3, &
                         solver_pseudo_time = 4

   character(*), parameter :: linear_words(*) = [character(6) :: 'auto', 'lu', 'krylov']
   integer, parameter :: linear_auto = 1, linear_lu = 2, linear_krylov = 3

   character(*), parameter :: flow_words(*) = &
      [character(14) :: 'rotated', 'identity', 'preconditioned']
   integer, parameter :: flow_rotated = 1, flow_identity = 2, flow_preconditioned = 3

   character(*), parameter :: scheme_words(*) = &
      [character(14) :: 'implicit_euler', 'bdf', 'rosenbrock', 'runge_kutta']
   integer, parameter :: scheme_implicit_euler = 1, scheme_bdf = 2, scheme_rosenbrock = 3, &
                         scheme_runge_kutta = 4

   character(*), parameter :: unit_words(*) = [character(5) :: 'rad/s', 'Hz']
   integer, parameter :: unit_rad_per_second = 1, unit_hertz = 2

   character(*), parameter :: continuation_words(*) = [character(9) :: 'natural', 'arclength']
   integer, parameter :: continuation_natural = 1, continuation_arclength = 2
   !> Points of a sweep at most: a number that is larger was not meant, and its rows fill a disk.
   integer, parameter :: most_points = 10000000
   !> Solutions of a point, power and shift: each solution found costs searches beside all others;
   !> beyond these a factor is nothing but steep, or nothing but constant.
   integer, parameter :: most_solutions = 1000
   real(wp), parameter :: most_power = 8.0_wp, most_shift = 1000.0_wp

   !> Options of a nonlinear solution (group &solver).
   type :: solver_options
      !> One of the constants above, as are all whole numbers with words.
      integer :: kind = solver_newton
      integer :: linear = linear_auto
      !> On norm(R)/norm(F).
      real(wp) :: tolerance = 1.0e-8_wp
      !> Steps of Newton's method from each guess; Jacobians of Powell's; nonlinear iterations of
      !> KINSOL.
      integer :: max_iterations = 60
      !> Time after which a point counts as not converged [s] (0: none).
      real(wp) :: max_seconds = 0.0_wp
      !> Try other ways to the solution where the first fails.
      logical :: fallback = .true.
      !> Leave out work that a case does not need (stuck pairs, components that nothing moves).
      logical :: skips = .true.
      !> Solutions of one point at most, and how those that are known repel the search for further
      !> ones (fw_deflation).
      integer :: n_solutions = 1
      real(wp) :: deflation_power = 2.0_wp, deflation_shift = 1.0_wp
   contains
      procedure :: bind_keys => bind_solver_keys
   end type solver_options

   !> Options of pseudo-time integration (group &pseudo_time).
   type :: pseudo_time_options
      integer :: flow = flow_rotated
      integer :: scheme = scheme_implicit_euler
      !> First step of pseudo-time (0: chosen by the scheme).
      real(wp) :: step = 0.0_wp
      !> Courant number of the explicit scheme.
      real(wp) :: cfl = 0.8_wp
      integer :: max_steps = 500
   contains
      procedure :: bind_keys => bind_pseudo_time_keys
   end type pseudo_time_options

   !> The frequencies of a case (group &sweep).
   type :: sweep_options
      !> In the unit of `unit` while it is read, in rad/s from then on. Below start the sweep goes
      !> down.
      real(wp) :: start = 0.0_wp
      real(wp) :: end = 0.0_wp
      !> Points of a natural sweep, both ends included; of a branch the number that sets its first
      !> step.
      integer :: n_points = 1
      !> Frequencies one by one (key `values`), which start, end and n_points then follow from.
      real(wp), allocatable :: frequencies(:)
      integer :: unit = unit_rad_per_second
      integer :: continuation = continuation_natural
      !> A branch may turn round without end.
      integer :: max_points = 1000
      !> Compute the Floquet multipliers of every point.
      logical :: stability = .false.
      !> Frequency over the rotation speed, where this follows it (0: it does not).
      real(wp) :: speed_order = 0.0_wp
      !> Points that are solved to find maxima become rows of the result.
      logical :: refine = .false.
      !> A piece of the sweep, which sessions ask for (no keys): its rows (0: up to the last), and
      !> how many points on the way from the start lead to the first of them.
      integer :: first_point = 1, last_point = 0, lead_points = 0
      !> The point that the run goes on from, solved by the one before it (0: none).
      integer :: solved_point = 0
   contains
      procedure :: bind_keys => bind_sweep_keys
      procedure :: is_piece
      procedure :: range => sweep_range
   end type sweep_options

contains

   !> The keys of group &solver.
   subroutine bind_solver_keys(self, keys)
      class(solver_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('solver', 'nonlinear solver, tolerance')
      call keys%bind_word(key('kind', &
                              "Newton with line search, MINPACK's hybrid method, KINSOL, "// &
                              "pseudo-time"), self%kind, solver_words)
      call keys%bind_word(key('linear', 'of Newton steps; ''auto'': by the size', &
                              only="kind = 'newton', 'pseudo_time'"), self%linear, linear_words)
      call keys%bind(key('tolerance', 'norm of the residual over that of the vibratory load', &
                         above(0.0_wp) .and. below(1.0_wp)), self%tolerance)
      call keys%bind(key('max_iterations', 'from each guess', at_least(1)), self%max_iterations)
      call keys%bind(key('max_seconds', &
                         'of a point, which then is not converged; 0: no limit; of a branch: '// &
                         'of its first point', at_least(0.0_wp), unit='s'), self%max_seconds)
      call keys%bind(key('fallback', 'try other ways where the first guess fails'), self%fallback)
      call keys%bind(key('skips', 'leave out stuck pairs and what nothing moves'), self%skips)
      call keys%bind(key('n_solutions', &
                         'at most, rows by rising amplitude; above 1 searched for by deflation', &
                         from_to(1, most_solutions), only="analysis = 'point'"), self%n_solutions)
      call keys%bind(key('deflation_power', 'of the distance by which known solutions repel', &
                         from_to(1.0_wp, most_power), only='n_solutions > 1'), self%deflation_power)
      call keys%bind(key('deflation_shift', 'of the factor that repels, far away', &
                         from_to(0.0_wp, most_shift), only='n_solutions > 1'), self%deflation_shift)
   end subroutine bind_solver_keys

   !> The keys of group &pseudo_time.
   subroutine bind_pseudo_time_keys(self, keys)
      class(pseudo_time_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('pseudo_time', 'pseudo-time integration')
      call keys%bind_word(key('flow', &
                              'P of P dU/dt* = -R(U): 2 i n omega M, identity, the linear '// &
                              'joint with closed pairs'), self%flow, flow_words)
      call keys%bind_word(key('scheme', &
                              'by Newton, CVODE (wear: IDA), linearly implicit, explicit'), &
                          self%scheme, scheme_words)
      call keys%bind(key('step', 'the first; 0: chosen', at_least(0.0_wp)), self%step)
      call keys%bind(key('cfl', 'Courant number', above(0.0_wp), only="scheme = 'runge_kutta'"), &
                     self%cfl)
      call keys%bind(key('max_steps', 'steps taken and refused', at_least(1)), self%max_steps)
   end subroutine bind_pseudo_time_keys

   !> The keys of group &sweep.
   subroutine bind_sweep_keys(self, keys, is_sweep, needs_start, is_listed, is_other)
      class(sweep_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is one of a range.
      logical, intent(in) :: is_sweep
      !> Whether it has a frequency at all (default: yes).
      logical, intent(in), optional :: needs_start
      !> Whether a list is given, and whether the ends are those of another parameter, which may be
      !> any number (default: no).
      logical, intent(in), optional :: is_listed, is_other
      type(range_type) :: first, last
      logical :: is_range, needs

      call keys%open('sweep', 'frequencies')
      is_range = is_sweep
      needs = .true.
      if (present(needs_start)) needs = needs_start
      if (present(is_listed)) needs = needs .and. .not. is_listed
      if (present(is_listed)) is_range = is_range .and. .not. is_listed
      first = above(0.0_wp)
      last = at_least(0.0_wp)
      if (present(is_other)) then
         if (is_other) then
            first = range_type()
            last = range_type()
         end if
      end if
      call keys%bind(key('start', 'the first, or the only one', first, unit='unit', &
                         absent='required'), self%start, needed=needs)
      call keys%bind(key('end', 'the last; below start the sweep goes down', last, unit='unit', &
                         absent='required for frf'), self%end, needed=is_range)
      call keys%bind_word(key('unit', 'of frequencies given; results are in rad/s'), self%unit, &
                          unit_words)
      call keys%bind_word(key('continuation', 'given frequencies, or a branch through folds'), &
                          self%continuation, continuation_words)
      call keys%bind(key('n_points', 'evenly spaced, with both ends; of a branch: its first step', &
                         from_to(1, most_points), absent='required for a natural frf'), &
                     self%n_points, needed=is_range .and. self%continuation == continuation_natural)
      call keys%bind(key('max_points', 'of a branch', at_least(1), &
                         only="continuation = 'arclength'"), self%max_points)
      call keys%bind(key('stability', 'Floquet multipliers of every point', &
                         only="springs, law = 'penalty', 'regularised'"), self%stability)
      call keys%bind(key('speed_order', &
                         'rotation speed is the frequency over this: 1 for unbalance, an '// &
                         'engine order; 0: it does not follow', at_least(0.0_wp), &
                         only="analysis = 'frf', 'point', 'population', 'resonance'"), &
                     self%speed_order)
      call keys%bind(key('refine', 'points solved to find maxima become rows', &
                         only="analysis = 'frf', continuation = 'natural'"), self%refine)
   end subroutine bind_sweep_keys

   !> Whether only some of the points are wanted.
   pure logical function is_piece(self)
      class(sweep_options), intent(in) :: self

      is_piece = self%first_point /= 1 .or. self%last_point /= 0 .or. self%lead_points /= 0
   end function is_piece

   !> The lowest and the highest frequency.
   pure function sweep_range(self) result(range)
      class(sweep_options), intent(in) :: self
      real(wp) :: range(2)

      range = [min(self%start, self%end), max(self%start, self%end)]
      if (.not. allocated(self%frequencies)) return
      range = [minval(self%frequencies), maxval(self%frequencies)]
   end function sweep_range

end module fw_solver_options
