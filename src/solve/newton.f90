!> Newton's method with a backtracking line search, for systems that are only piecewise smooth.
module fw_newton
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_solver_options, only: solver_options
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: newton_solver, solver_report

   !> What came of a solution.
   type :: solver_report
      logical :: converged = .false.
      integer :: iterations = 0
      !> norm(R)/reference at the end.
      real(wp) :: residual = huge(1.0_wp)
   end type solver_report

   type :: newton_solver
      type(solver_options) :: options
      type(linear_step_type) :: linear
      real(wp), allocatable :: r(:), step(:), trial(:)
   contains
      procedure :: solve
   end type newton_solver

   !> Shortest fraction of a step that is tried.
   integer, parameter :: max_halvings = 4
   !> Relative residual asked of iterative linear solutions: Newton's last step then reaches the
   !> tolerance of the nonlinear solution from a residual of its square root.
   real(wp), parameter :: forcing = 1.0e-4_wp
   !> Steps without a new smallest residual after which the path counts as cycling.
   integer, parameter :: patience = 6

contains

   !> Solve from the guess in x; the last point is left there.
   subroutine solve(self, system, x, report)
      class(newton_solver), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      real(wp) :: norm, best
      logical :: done
      integer :: stalled

      call reserve(self, system%n)
      self%linear%kind = self%options%linear
      call system%residual(x, self%r)
      norm = norm2(self%r)/system%reference
      best = norm
      stalled = 0
      do
         report%residual = norm
         report%converged = norm <= self%options%tolerance
         if (report%converged .or. report%iterations >= self%options%max_iterations) exit
         if (.not. ieee_is_finite(norm) .or. stalled > patience) exit
         call self%linear%solve(system, self%r, forcing, self%step, done)
         report%iterations = report%iterations + 1
         if (.not. done) exit
         call search(self, system, x, norm, done)
         if (.not. done) exit
         stalled = stalled + 1
         if (norm < 0.99_wp*best) stalled = 0
         best = min(best, norm)
      end do
   end subroutine solve

   !> Halve the step until the residual decreases; if it never does, take the best of the trials,
   !> which lets the path leave the corner between two states of a pair.
   subroutine search(self, system, x, norm, done)
      type(newton_solver), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      real(wp), intent(inout) :: norm
      !> False where no trial is finite; x stays then.
      logical, intent(out) :: done
      real(wp) :: fraction, trial_norm, best_fraction, best_norm
      integer :: halving

      fraction = 1.0_wp
      best_norm = huge(1.0_wp)
      best_fraction = 1.0_wp
      do halving = 0, max_halvings
         self%trial = x + fraction*self%step
         call system%residual(self%trial, self%r)
         trial_norm = norm2(self%r)/system%reference
         if (ieee_is_finite(trial_norm) .and. trial_norm < best_norm) then
            best_norm = trial_norm
            best_fraction = fraction
         end if
         if (trial_norm <= (1.0_wp - 1.0e-4_wp*fraction)*norm) exit
         fraction = 0.5_wp*fraction
      end do
      done = best_norm < huge(1.0_wp)
      if (.not. done) return
      if (fraction < best_fraction .or. halving > max_halvings) then
         self%trial = x + best_fraction*self%step
         call system%residual(self%trial, self%r)
      end if
      x = self%trial
      norm = norm2(self%r)/system%reference
   end subroutine search

   subroutine reserve(self, n)
      type(newton_solver), intent(inout) :: self
      integer, intent(in) :: n

      if (allocated(self%r)) then
         if (size(self%r) == n) return
         deallocate (self%r, self%step, self%trial)
      end if
      allocate (self%r(n), self%step(n), self%trial(n))
   end subroutine reserve

end module fw_newton
