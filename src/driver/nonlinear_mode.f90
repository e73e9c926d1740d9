!> A nonlinear mode as a vibration: its place is ln A, from amplitude to amplitude by natural steps.
module fw_nonlinear_mode
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_mode_system, only: mode_system
   use fw_newton, only: solver_report
   use fw_solution_history, only: history_options, position, solution_history
   use fw_solver_options, only: solver_options
   use fw_vibration, only: vibration, walk_options, walk_type
   implicit none (type, external)
   private

   public :: mode_path, nonlinear_mode

   type, extends(vibration) :: nonlinear_mode
      type(mode_system), pointer :: system => null()
      !> Part of their size by which unknowns may be off their guess: beyond, the solution may be
      !> one of another curve. Behind a kink guesses come as near as steps are short, behind a fold
      !> they never do.
      real(wp) :: leash = 0.1_wp
   contains
      procedure :: stand
      procedure :: solve
      procedure :: is_same
   end type nonlinear_mode

   !> The mode and where it has been.
   type :: mode_path
      type(nonlinear_mode) :: mode
      type(walk_type) :: walk
   contains
      procedure :: start
      procedure :: solve => solve_at
      procedure :: reach
   end type mode_path

   !> Newton steps from which on a step is too long.
   integer, parameter :: most_iterations = 25

contains

   subroutine start(self, system, options)
      class(mode_path), intent(inout) :: self
      !> Has to outlive the path.
      type(mode_system), intent(inout), target :: system
      type(solver_options), intent(in) :: options

      associate (mode => self%mode)
         mode%system => system
         mode%balance => system%balance
         mode%newton%options = options
         ! A step that GMRES leaves unsolved may lead to another curve.
         mode%newton%linear%lu_follows = .true.
         mode%newton%options%max_iterations = min(options%max_iterations, most_iterations)
      end associate
      ! Steps in ln A. Of two orders of guesses the one that did better serves, by however little.
      ! Harmonic 0 goes with the amplitude, in proportion to which pairs that settle elsewhere move
      ! it, all else with its logarithm.
      self%walk%limits = walk_options(first=0.25_wp, longest=0.5_wp, shortest=1.0e-5_wp, &
                                      growth=1.5_wp)
      call self%walk%known%start(system%n, history_options( &
                                 most=4, far=0.0_wp, clearly=1.0_wp, lowest=0, same=1.0e-9_wp, &
                                 n_exponential=system%n_static))
   end subroutine start

   subroutine stand(self, at, error)
      class(nonlinear_mode), intent(inout) :: self
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error

      call stop_run(self%system%interrupt, error)
      if (.not. allocated(error)) call self%system%set_parameter(at%along, error)
   end subroutine stand

   subroutine solve(self, x, report, error)
      class(nonlinear_mode), intent(inout) :: self
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      call self%newton%solve(self%system, x, report)
      self%iterations = self%iterations + report%iterations
      if (report%interrupted) call stop_run(self%system%interrupt, error)
   end subroutine solve

   !> Solve at an amplitude from a guess.
   subroutine solve_at(self, p, y, report, error)
      class(mode_path), intent(inout) :: self
      !> ln A
      real(wp), intent(in) :: p
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      call self%mode%stand(position(p), error)
      if (.not. allocated(error)) call self%mode%solve(y, report, error)
   end subroutine solve_at

   !> Go on to an amplitude from the last one (walk_type%reach).
   subroutine reach(self, p, y, report, reached, error)
      class(mode_path), intent(inout) :: self
      !> ln A
      real(wp), intent(in) :: p
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      real(wp), intent(out) :: reached
      type(error_type), allocatable, intent(out) :: error

      call self%walk%reach(self%mode, p, y, report, reached, error)
   end subroutine reach

   logical function is_same(self, x, guess, known)
      class(nonlinear_mode), intent(inout) :: self
      real(wp), intent(in) :: x(:), guess(:)
      type(solution_history), intent(in) :: known

      is_same = norm2(x - guess) <= self%leash*norm2(known%x(:, 1))
   end function is_same

end module fw_nonlinear_mode
