!> Newton's method with a backtracking line search, for systems that are only piecewise smooth.
module fw_newton
   use fw_kinds, only: wp
   use fw_norm, only: is_finite, norm_of
   use fw_linear_step, only: linear_step_type
   use fw_solver_options, only: solver_options
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: newton_solver, solver_report, tight_forcing

   !> Least relative residual that is asked of iterative linear solutions.
   real(wp), parameter :: tight_forcing = 1.0e-4_wp

   !> What came of a solution.
   type :: solver_report
      logical :: converged = .false.
      integer :: iterations = 0
      !> norm(R)/reference at the end.
      real(wp) :: residual = huge(1.0_wp)
      !> Ended from outside before its time.
      logical :: interrupted = .false.
   end type solver_report

   type :: newton_solver
      type(solver_options) :: options
      type(linear_step_type) :: linear
      !> Largest relative residual asked of iterative linear solutions.
      real(wp) :: loosest = 1.0e-2_wp
      !> Residual at the last point, step, and point that is tried (n).
      real(wp), allocatable :: r(:), step(:), trial(:)
   contains
      procedure :: solve
   end type newton_solver

   !> Shortest fraction of a step that is tried.
   ! Down to a sixteenth: at a corner shorter steps only creep towards it.
   integer, parameter :: max_halvings = 4
   !> Factor between the relative residual asked of iterative linear solutions and the square of
   !> the last decrease (Eisenstat and Walker 1996, choice 2): a step that the corners of the
   !> contact law will spoil need not be solved well.
   real(wp), parameter :: forcing_factor = 0.1_wp
   !> Part of the tolerance that the linear residual may take of the last step.
   ! So small that the last step meets the tolerance at its first trial.
   real(wp), parameter :: last_step_share = 0.03_wp
   !> Steps without a new smallest residual after which the path counts as cycling.
   integer, parameter :: patience = 6

contains

   !> Solve from the guess in x; the last point is left there.
   subroutine solve(self, system, x, report)
      class(newton_solver), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      real(wp) :: norm, best, before, forcing
      logical :: done
      integer :: stalled

      call reserve(self, system%n)
      self%linear%kind = self%options%linear
      call system%residual(x, self%r)
      norm = norm_of(self%r)/system%reference
      best = norm
      ! Nothing is known of the decrease before the first step.
      forcing = self%loosest
      stalled = 0
      do
         report%residual = norm
         report%converged = norm <= self%options%tolerance
         if (report%converged .or. report%iterations >= self%options%max_iterations) exit
         if (.not. is_finite(norm) .or. stalled > patience) exit
         report%interrupted = system%is_interrupted()
         if (report%interrupted) exit
         call self%linear%solve(system, self%r, forcing, self%step, done)
         report%iterations = report%iterations + 1
         ! A singular derivative, one that no linear solver copes with, or a stop.
         if (.not. done) report%interrupted = system%is_interrupted()
         if (.not. done) exit
         before = norm
         call search(self, system, x, norm, done)
         if (.not. done) exit
         forcing = min(self%loosest, next_forcing(before, norm, self%options%tolerance))
         stalled = stalled + 1
         ! Creeping by less than a hundredth counts as none.
         if (norm < 0.99_wp*best) stalled = 0
         best = min(best, norm)
      end do
   end subroutine solve

   !> Relative residual that is worth asking of the next linear solution.
   pure real(wp) function next_forcing(before, norm, tolerance) result(forcing)
      !> Norms of the residual before and after the last step, and the one that is wanted.
      real(wp), intent(in) :: before, norm, tolerance

      forcing = max(forcing_factor*(norm/before)**2, &
                    last_step_share*tolerance/max(norm, tolerance), tight_forcing)
   end function next_forcing

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
         trial_norm = norm_of(self%r)/system%reference
         if (is_finite(trial_norm) .and. trial_norm < best_norm) then
            best_norm = trial_norm
            best_fraction = fraction
         end if
         ! Armijo's condition, all but a plain decrease.
         if (trial_norm <= (1.0_wp - 1.0e-4_wp*fraction)*norm) exit
         if (system%is_interrupted()) exit
         fraction = 0.5_wp*fraction
      end do
      done = best_norm < huge(1.0_wp)
      if (.not. done) return
      ! The system was left at a worse trial: back to the best.
      if (fraction < best_fraction .or. halving > max_halvings) then
         self%trial = x + best_fraction*self%step
         call system%residual(self%trial, self%r)
      end if
      x = self%trial
      norm = norm_of(self%r)/system%reference
   end subroutine search

   !> Vectors of the unknowns; solutions of one system reuse them.
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
