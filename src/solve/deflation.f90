!> Newton's method for further solutions of a system of which some are known (Farrell, Birkisson
!> and Funke 2015, Deflation techniques for finding distinct solutions).
!>
!> The residual is multiplied by a factor that grows without bound at every known solution x_k,
!>
!>   M(x) = prod (1/||(x - x_k)/s||^p + shift),
!>
!> so that no iteration comes back to one of them. The derivative of M R is M J + R (grad M)^T; by
!> the formula of Sherman and Morrison its Newton step is the usual one, d = -J^-1 R, times
!> 1/(1 - grad M . d/M): nothing of the linear problem changes.
module fw_deflation
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_newton, only: solver_report, tight_forcing
   use fw_norm, only: is_finite, norm_of
   use fw_solver_options, only: solver_options
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: deflated_newton

   type :: deflated_newton
      type(linear_step_type) :: linear
      type(solver_options) :: options
      !> Solutions that repel (n, 1:n_known), and the distance that counts as 1.
      integer :: n_known = 0
      !> Whether they do at present: without them it is Newton's method as ever.
      logical :: repels = .true.
      real(wp) :: scale = 1.0_wp
      real(wp), allocatable :: known(:, :)
      !> Residual, step, and point that is tried (n).
      real(wp), allocatable, private :: r(:), step(:), trial(:)
   contains
      procedure :: start
      procedure :: add
      procedure :: solve
      procedure :: refine
      procedure :: soften
      procedure, private :: log_factor
      procedure, private :: log_slope
   end type deflated_newton

   !> Shortest fraction of a step that is tried: 1/256. Beside a known solution the factor is steep,
   !> and steps that fit it are short.
   integer, parameter :: max_halvings = 8, usual_halvings = 4
   !> Steps without a new smallest M |R| after which the path counts as cycling.
   integer, parameter :: patience = 10
   !> The factor of a step, where 1 - grad M . d/M is all but 0: far steps are cut by the line
   !> search.
   real(wp), parameter :: largest_factor = 10.0_wp
   !> A step leads no further than this many sizes of x and of the scale.
   real(wp), parameter :: furthest = 3.0_wp
   !> Steps that a solution is refined by, at most.
   integer, parameter :: most_refinements = 4

contains

   !> No solution is known yet of n unknowns.
   subroutine start(self, n, most, scale)
      class(deflated_newton), intent(inout) :: self
      integer, intent(in) :: n
      !> Solutions that may be added.
      integer, intent(in) :: most
      real(wp), intent(in) :: scale

      allocate (self%known(n, most), self%r(n), self%step(n), self%trial(n), source=0.0_wp)
      self%n_known = 0
      self%scale = scale
      self%linear%kind = self%options%linear
      self%linear%keeps = self%options%skips
   end subroutine start

   !> A solution repels from now on; beyond the room that was asked for the list grows.
   subroutine add(self, x)
      class(deflated_newton), intent(inout) :: self
      real(wp), intent(in) :: x(:)
      real(wp), allocatable :: longer(:, :)

      if (self%n_known == size(self%known, 2)) then
         allocate (longer(size(x), 2*self%n_known + 1), source=0.0_wp)
         longer(:, :self%n_known) = self%known
         call move_alloc(longer, self%known)
      end if
      self%n_known = self%n_known + 1
      self%known(:, self%n_known) = x
   end subroutine add

   !> From the guess in x to a solution that is none of those known; the last point is left there.
   !> It has converged where the residual has without its factor.
   subroutine solve(self, system, x, report)
      class(deflated_newton), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      real(wp) :: norm, best, slope, length
      logical :: done
      integer :: stalled

      call system%residual(x, self%r)
      norm = norm_of(self%r)/system%reference
      best = log_of(norm) + self%log_factor(x)
      stalled = 0
      do
         report%residual = norm
         report%converged = norm <= self%options%tolerance
         if (report%converged .or. report%iterations >= self%options%max_iterations) exit
         if (.not. is_finite(norm) .or. stalled > patience) exit
         report%interrupted = system%is_interrupted()
         if (report%interrupted) exit
         ! The factor of the step takes differences of it: it is solved well.
         call self%linear%solve(system, self%r, tight_forcing, self%step, done)
         report%iterations = report%iterations + 1
         if (.not. done) report%interrupted = system%is_interrupted()
         if (.not. done) exit
         slope = 1.0_wp - self%log_slope(x, self%step)
         ! Near 0 the step grows without bound, and beyond it turns round, away from what is known.
         self%step = self%step/sign(max(abs(slope), 1.0_wp/largest_factor), slope)
         length = norm2(self%step)
         if (.not. is_finite(length)) exit
         length = length/(furthest*(norm2(x) + self%scale))
         if (length > 1.0_wp) self%step = self%step/length
         call search(self, system, x, norm, done)
         if (.not. done) exit
         stalled = stalled + 1
         associate (value => log_of(norm) + self%log_factor(x))
            ! Creeping by less than a hundredth counts as none.
            if (value < best - 0.01_wp) stalled = 0
            best = min(best, value)
         end associate
      end do
   end subroutine solve

   !> Halve the step until M |R| decreases; if it never does, take the best of the trials: the
   !> system is smooth in pieces only, and a path may have to cross a corner.
   subroutine search(self, system, x, norm, done)
      type(deflated_newton), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      !> Without the factor.
      real(wp), intent(inout) :: norm
      !> False where no trial is finite; x stays then.
      logical, intent(out) :: done
      real(wp) :: fraction, before, value, best, best_fraction
      integer :: halving

      before = log_of(norm) + self%log_factor(x)
      fraction = 1.0_wp
      best = huge(1.0_wp)
      best_fraction = 1.0_wp
      do halving = 0, merge(max_halvings, usual_halvings, self%repels)
         self%trial = x + fraction*self%step
         call system%residual(self%trial, self%r)
         norm = norm_of(self%r)/system%reference
         value = huge(1.0_wp)
         if (is_finite(norm)) value = log_of(norm) + self%log_factor(self%trial)
         if (value < best) then
            best = value
            best_fraction = fraction
         end if
         if (value <= before + log(1.0_wp - 1.0e-4_wp*fraction)) exit
         if (norm <= self%options%tolerance .or. system%is_interrupted()) exit
         fraction = 0.5_wp*fraction
      end do
      done = best < huge(1.0_wp)
      if (.not. done) return
      ! The system was left at a worse trial: back to the best.
      if (fraction < best_fraction .or. halving > merge(max_halvings, usual_halvings, &
                                                        self%repels)) then
         self%trial = x + best_fraction*self%step
         call system%residual(self%trial, self%r)
         norm = norm_of(self%r)/system%reference
      end if
      x = self%trial
   end subroutine search

   !> Steps of the usual kind from a solution, for as long as its residual decreases: what tells two
   !> solutions apart is how far each may be off, which the last step says.
   subroutine refine(self, system, x, error, iterations)
      class(deflated_newton), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      !> Norm of the last step; huge where the derivative is singular.
      real(wp), intent(out) :: error
      integer, intent(inout) :: iterations
      real(wp) :: norm, next
      logical :: done
      integer :: k

      error = huge(1.0_wp)
      call system%residual(x, self%r)
      norm = norm_of(self%r)
      do k = 1, most_refinements
         call self%linear%solve(system, self%r, tight_forcing, self%step, done)
         if (.not. done) exit
         iterations = iterations + 1
         self%trial = x + self%step
         call system%residual(self%trial, self%r)
         next = norm_of(self%r)
         if (.not. is_finite(next)) exit
         error = norm2(self%step)
         if (.not. next < norm) exit
         norm = next
         x = self%trial
      end do
      ! Left where x is, whatever was tried last.
      call system%residual(x, self%r)
   end subroutine refine

   !> The answer -J^-1 w of the system at x to a disturbance: what it yields to most is largest.
   subroutine soften(self, system, x, w, answer, done)
      class(deflated_newton), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:), w(:)
      real(wp), intent(out), contiguous :: answer(:)
      logical, intent(out) :: done

      call system%residual(x, self%r)
      call self%linear%solve(system, w, tight_forcing, answer, done)
   end subroutine soften

   !> log M at x: products of many factors leave the range of numbers.
   pure real(wp) function log_factor(self, x) result(logarithm)
      class(deflated_newton), intent(in) :: self
      real(wp), intent(in) :: x(:)
      integer :: k

      logarithm = 0.0_wp
      if (.not. self%repels) return
      do k = 1, self%n_known
         associate (distance => max(norm2(x - self%known(:, k))/self%scale, tiny(1.0_wp)))
            ! 1/d^p + shift, without an overflow of the power near a known solution.
            logarithm = logarithm - self%options%deflation_power*log(distance) + &
                        log(1.0_wp + self%options%deflation_shift* &
                            distance**self%options%deflation_power)
         end associate
      end do
   end function log_factor

   !> grad M . d / M at x.
   pure real(wp) function log_slope(self, x, d) result(slope)
      class(deflated_newton), intent(in) :: self
      real(wp), intent(in) :: x(:), d(:)
      real(wp) :: square
      integer :: k

      slope = 0.0_wp
      if (.not. self%repels) return
      associate (p => self%options%deflation_power, shift => self%options%deflation_shift)
         do k = 1, self%n_known
            square = max(sum((x - self%known(:, k))**2), tiny(1.0_wp))
            slope = slope - p*dot_product(x - self%known(:, k), d)/square/ &
                    (1.0_wp + shift*(sqrt(square)/self%scale)**p)
         end do
      end associate
   end function log_slope

   !> The logarithm of a norm that may be 0.
   pure real(wp) function log_of(norm)
      real(wp), intent(in) :: norm

      log_of = log(max(norm, tiny(1.0_wp)))
   end function log_of

end module fw_deflation
