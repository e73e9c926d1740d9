!> Powell's hybrid method through MINPACK's hybrj (Powell 1970; Moré, Garbow, Hillstrom 1980): a
!> dogleg between Newton's step and the steepest descent, with the analytic Jacobian, updated by
!> Broyden's formula from step to step and evaluated anew where two steps have failed.
!>
!> The method factors the whole Jacobian, n x n: it is meant for some hundreds of unknowns.
module fw_powell
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_solver_options, only: solver_options
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: powell_solver

   !> What the callback of a solution needs and leaves behind.
   type :: powell_state
      class(nonlinear_system), pointer :: system => null()
      real(wp) :: tolerance = 0.0_wp
      !> Jacobians that are allowed, and those so far.
      integer :: max_jacobians = 0
      integer :: n_jacobians = 0
      !> The smallest norm and its point (n).
      real(wp) :: best = huge(1.0_wp)
      real(wp), allocatable :: best_x(:)
      !> The point that the system saw last (n), and a residual to throw away (n).
      real(wp), allocatable :: seen(:), r(:)
   end type powell_state

   type :: powell_solver
      !> max_iterations limits the Jacobians; between two of them there are updates.
      type(solver_options) :: options
      !> Residuals evaluated in the last solution.
      integer :: evaluations = 0
      !> Workspace of hybrj (n), (n, n), packed triangle n (n + 1)/2, and four vectors.
      real(wp), allocatable :: f(:), jacobian(:, :), scale(:), triangle(:), qtf(:), work(:, :)
   contains
      procedure :: solve
   end type powell_solver

   !> hybrj has no argument for the caller's data, so that the callback finds the solution it
   !> belongs to here. One pointer per thread: solutions in different threads do not meet, and
   !> `solve` restores the pointer, so that a residual may itself call the solver.
   type(powell_state), pointer :: current => null()
   !$omp threadprivate(current)

   !> Residuals for each Jacobian allowed.
   integer, parameter :: evaluations_per_jacobian = 10
   !> Times that hybrj starts anew from the best point, as long as each start gains this factor.
   ! A start that went astray leaves Broyden's updates and a radius behind that no longer serve.
   integer, parameter :: max_restarts = 5
   real(wp), parameter :: worth_restarting = 0.9_wp
   !> First trust radius, times the norm of the scaled unknowns; the second value is for restarts,
   !> which the first one has led astray.
   real(wp), parameter :: radius_first = 100.0_wp, radius_restart = 0.1_wp

   !> What stands in for a residual that is not finite: so much worse than the best that the step
   !> is refused.
   real(wp), parameter :: refused = 1.0e3_wp

   abstract interface
      subroutine hybrj_callback(n, x, f, jacobian, ld, task)
         import :: wp
         integer, intent(in) :: n, ld
         real(wp), intent(in) :: x(n)
         real(wp), intent(inout) :: f(n), jacobian(ld, n)
         integer, intent(inout) :: task
      end subroutine hybrj_callback
   end interface

   interface
      subroutine hybrj(fcn, n, x, fvec, fjac, ldfjac, xtol, maxfev, diag, mode, factor, nprint, &
                       info, nfev, njev, r, lr, qtf, wa1, wa2, wa3, wa4)
         import :: hybrj_callback, wp
         procedure(hybrj_callback) :: fcn
         integer, intent(in) :: n, ldfjac, maxfev, mode, nprint, lr
         integer, intent(out) :: info, nfev, njev
         real(wp), intent(in) :: xtol, factor
         real(wp), intent(inout) :: x(n), fvec(n), fjac(ldfjac, n), diag(n), r(lr), qtf(n)
         real(wp), intent(inout) :: wa1(n), wa2(n), wa3(n), wa4(n)
      end subroutine hybrj
   end interface

contains

   !> Solve from the guess in x; the best point found is left there. `iterations` of the report
   !> counts the Jacobians.
   subroutine solve(self, system, x, report)
      class(powell_solver), intent(inout) :: self
      class(nonlinear_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(powell_state), pointer :: caller, state
      logical :: reduced

      reduced = system%reduced
      system%reduced = .false.
      allocate (state)
      state%system => system
      state%tolerance = self%options%tolerance
      state%max_jacobians = self%options%max_iterations
      state%best_x = x
      state%seen = x
      allocate (state%r(system%n))
      caller => current
      current => state
      call run(self, state)
      current => caller
      system%reduced = reduced

      ! The system is left at the point that is returned, and the verdict is not hybrj's.
      x = state%best_x
      call system%residual(x, state%r)
      report%residual = norm2(state%r)/system%reference
      report%converged = report%residual <= self%options%tolerance
      report%iterations = state%n_jacobians
      report%interrupted = .not. report%converged .and. system%is_interrupted()
      deallocate (state)
   end subroutine solve

   !> hybrj until the tolerance is met or a start no longer gains.
   subroutine run(self, state)
      type(powell_solver), intent(inout) :: self
      type(powell_state), intent(inout) :: state
      real(wp) :: before, radius
      real(wp), allocatable :: x(:)
      integer :: n, start, info, evaluations, jacobians

      n = state%system%n
      call reserve(self, n)
      self%evaluations = 0
      if (n == 0) return
      radius = radius_first
      do start = 0, max_restarts
         x = state%best_x
         before = state%best
         ! xtol = 0: a short step alone is no solution; the callback ends a converged run.
         call hybrj(evaluate, n, x, self%f, self%jacobian, n, 0.0_wp, &
                    max(1, evaluations_per_jacobian*state%max_jacobians - self%evaluations), &
                    self%scale, 1, radius, 0, info, evaluations, jacobians, self%triangle, &
                    size(self%triangle), self%qtf, self%work(:, 1), self%work(:, 2), &
                    self%work(:, 3), self%work(:, 4))
         self%evaluations = self%evaluations + evaluations
         ! Less than zero: ended by the callback; 2: no evaluations left.
         if (info < 0 .or. info == 2) exit
         if (.not. state%best < worth_restarting*before) exit
         radius = radius_restart
      end do
   end subroutine run

   !> The callback: the scaled residual (task 1) or its Jacobian (task 2). A negative task ends
   !> the run.
   subroutine evaluate(n, x, f, jacobian, ld, task)
      integer, intent(in) :: n, ld
      real(wp), intent(in) :: x(n)
      real(wp), intent(inout) :: f(n), jacobian(ld, n)
      integer, intent(inout) :: task

      if (task == 1) then
         call evaluate_residual(current, x, f, task)
      else
         call evaluate_jacobian(current, x, jacobian, task)
      end if
   end subroutine evaluate

   !> Task 1: the residual over its reference; its point is remembered where it is the best so far.
   subroutine evaluate_residual(state, x, f, task)
      type(powell_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(inout), contiguous :: f(:)
      integer, intent(inout) :: task
      real(wp) :: norm

      call state%system%residual(x, f)
      state%seen = x
      ! Scaled, since hybrj compares norms of residuals with numbers of the order of one.
      f = f/state%system%reference
      norm = norm2(f)
      if (.not. ieee_is_finite(norm)) then
         ! Nothing finite so far: the guess itself is hopeless.
         if (state%best >= huge(1.0_wp)) task = -1
         ! Some finite vector in a residual's place; huge numbers would make NaN of the updates.
         f = refused*min(state%best, 1.0_wp/epsilon(1.0_wp))
         return
      end if
      if (norm < state%best) then
         state%best = norm
         state%best_x = x
      end if
      if (norm <= state%tolerance .or. state%system%is_interrupted()) task = -1
   end subroutine evaluate_residual

   !> Task 2: the Jacobian over the same reference. One more than is allowed ends the run.
   subroutine evaluate_jacobian(state, x, jacobian, task)
      type(powell_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(inout), contiguous :: jacobian(:, :)
      integer, intent(inout) :: task
      integer :: n_linear

      if (state%n_jacobians >= state%max_jacobians) then
         task = -1
         return
      end if
      ! A refused trial may have been the last point that the system saw.
      if (any(abs(x - state%seen) > 0.0_wp)) then
         call state%system%residual(x, state%r)
         state%seen = x
      end if
      state%n_jacobians = state%n_jacobians + 1
      call state%system%linearize(n_linear)
      if (n_linear /= state%system%n) then
         task = -1
         return
      end if
      call state%system%assemble(jacobian)
      jacobian = jacobian/state%system%reference
   end subroutine evaluate_jacobian

   !> Dense matrices and vectors of the unknowns, used again by the next solution.
   subroutine reserve(self, n)
      type(powell_solver), intent(inout) :: self
      integer, intent(in) :: n

      if (allocated(self%f)) then
         if (size(self%f) == n) return
         deallocate (self%f, self%jacobian, self%scale, self%triangle, self%qtf, self%work)
      end if
      allocate (self%f(n), self%scale(n), self%qtf(n), source=0.0_wp)
      allocate (self%jacobian(n, n), self%work(n, 4), self%triangle((n*(n + 1))/2), source=0.0_wp)
   end subroutine reserve

end module fw_powell
