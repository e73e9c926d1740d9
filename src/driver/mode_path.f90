!> A nonlinear mode from amplitude to amplitude: natural steps in ln A that are halved where they
!> fail, from the points before.
module fw_mode_path
   use fw_error, only: error_type
   use fw_extrapolation, only: best_order, extrapolate
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_mode_system, only: mode_system
   use fw_newton, only: newton_solver, solver_report
   use fw_solver_options, only: solver_options
   implicit none (type, external)
   private

   public :: mode_path

   !> Points that are kept, and the first step in ln A.
   integer, parameter :: most_kept = 4
   real(wp), parameter :: first_step = 0.25_wp

   type :: mode_path
      type(newton_solver) :: newton
      type(mode_system), pointer :: system => null()
      !> The last points, the newest first: ln A, unknowns (n, most_kept), and how many there are.
      real(wp) :: p(most_kept) = 0.0_wp
      real(wp), allocatable :: y(:, :)
      integer :: kept = 0
      !> Orders of the polynomials through them, of harmonic 0 and of all else.
      integer, private :: order(2) = 0
      !> Iterations so far.
      integer :: iterations = 0
      !> Part of their size by which unknowns may be off their guess: beyond, the solution may be
      !> one of another curve. Behind a kink guesses come as near as steps are short, behind a fold
      !> they never do.
      real(wp) :: leash = 0.1_wp
      !> Step that served last, in ln A.
      real(wp) :: step = first_step
   contains
      procedure :: start
      procedure :: reach
      procedure :: solve
      procedure :: remember
      procedure :: restart
   end type mode_path

   !> Longest and shortest step in ln A, and how steps grow and shrink.
   real(wp), parameter :: longest = 0.5_wp, shortest = 1.0e-5_wp, growth = 1.5_wp
   !> Newton steps from which on a step is too long.
   integer, parameter :: most_iterations = 25
   !> ln A closer than this are one amplitude.
   real(wp), parameter :: same = 1.0e-9_wp
   !> Of two orders of guesses the one that did better serves, by however little.
   real(wp), parameter :: any_nearer = 1.0_wp

contains

   subroutine start(self, system, options)
      class(mode_path), intent(inout) :: self
      !> Has to outlive the path.
      type(mode_system), intent(inout), target :: system
      type(solver_options), intent(in) :: options

      self%system => system
      self%newton%options = options
      ! A step that GMRES leaves unsolved may lead to another curve.
      self%newton%linear%lu_follows = .true.
      self%newton%options%max_iterations = min(options%max_iterations, most_iterations)
      allocate (self%y(system%n, most_kept), source=0.0_wp)
   end subroutine start

   !> Solve at an amplitude from a guess.
   subroutine solve(self, p, y, report, error)
      class(mode_path), intent(inout) :: self
      !> ln A
      real(wp), intent(in) :: p
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      call stop_run(self%system%interrupt, error)
      if (.not. allocated(error)) call self%system%set_parameter(p, error)
      if (allocated(error)) return
      call self%newton%solve(self%system, y, report)
      self%iterations = self%iterations + report%iterations
      if (report%interrupted) call stop_run(self%system%interrupt, error)
   end subroutine solve

   !> Go on to an amplitude, by as many steps as it takes; report%converged says whether it was
   !> reached, else y is the last point that was, at `reached`.
   subroutine reach(self, p, y, report, reached, error)
      class(mode_path), intent(inout) :: self
      real(wp), intent(in) :: p
      real(wp), intent(out), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      real(wp), intent(out) :: reached
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: next, guess(size(y))
      logical :: done

      y = self%y(:, 1)
      reached = self%p(1)
      do
         next = self%p(1) + sign(min(abs(p - self%p(1)), self%step), p - self%p(1))
         ! A rest that is nothing beside the step is taken with it.
         if (abs(p - next) < 0.1_wp*self%step) next = p
         call predict(self, next, y)
         guess = y
         call self%solve(next, y, report, error)
         if (allocated(error)) return
         done = report%converged
         if (done) done = norm2(y - guess) <= self%leash*norm2(self%y(:, 1))
         if (done) then
            call self%remember(next, y)
            reached = next
            self%step = min(longest, growth*self%step)
            if (abs(next - p) <= 0.0_wp) return
         else
            report%converged = .false.
            self%step = 0.5_wp*min(self%step, abs(next - self%p(1)))
            if (self%step >= shortest) cycle
            y = self%y(:, 1)
            reached = self%p(1)
            self%step = longest*0.5_wp
            return
         end if
      end do
   end subroutine reach

   !> The polynomials through the last points: of harmonic 0 over the amplitude, in proportion to
   !> which pairs that settle elsewhere move it, of all else over its logarithm.
   subroutine predict(self, p, y)
      class(mode_path), intent(in) :: self
      real(wp), intent(in) :: p
      real(wp), intent(out), contiguous :: y(:)
      integer :: n

      n = self%system%n_static
      call extrapolate(exp(self%p(:self%order(1) + 1) - p), self%y(:n, :), 1.0_wp, y(:n))
      call extrapolate(self%p(:self%order(2) + 1), self%y(n + 1:, :), p, y(n + 1:))
   end subroutine predict

   !> A point for the guesses of the next ones; the same amplitude again replaces it.
   subroutine remember(self, p, y)
      class(mode_path), intent(inout) :: self
      real(wp), intent(in) :: p, y(:)

      if (self%kept > 0) then
         if (abs(p - self%p(1)) <= same) then
            self%y(:, 1) = y
            return
         end if
      end if
      call choose_orders(self, p, y)
      self%p = [p, self%p(:most_kept - 1)]
      self%y(:, 2:) = self%y(:, :most_kept - 1)
      self%y(:, 1) = y
      self%kept = min(most_kept, self%kept + 1)
   end subroutine remember

   !> Go on from a point alone: those before are of another curve.
   subroutine restart(self, p, y)
      class(mode_path), intent(inout) :: self
      real(wp), intent(in) :: p, y(:)

      self%kept = 0
      self%step = first_step
      call self%remember(p, y)
   end subroutine restart

   !> The orders that would have come nearest to a new point.
   subroutine choose_orders(self, p, y)
      class(mode_path), intent(inout) :: self
      real(wp), intent(in) :: p, y(:)
      integer :: k, n

      k = self%kept
      n = self%system%n_static
      self%order = [best_order(exp(self%p(:k) - p), self%y(:n, :), 1.0_wp, y(:n), any_nearer), &
                    best_order(self%p(:k), self%y(n + 1:, :), p, y(n + 1:), any_nearer)]
      ! With the new point one more has become possible; nothing is known of it.
      if (k == 1) self%order = 1
   end subroutine choose_orders

end module fw_mode_path
