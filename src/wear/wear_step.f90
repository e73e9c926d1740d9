!> One step of the wear depth over many cycles, by any of the schemes; the control of the steps is
!> the caller's (fw_wear_march).
module fw_wear_step
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report, tight_forcing
   use fw_solver_options, only: scheme_rosenbrock
   use fw_wear_rosenbrock, only: rosenbrock_order, rosenbrock_step
   use fw_wear_options, only: wear_explicit, wear_options, wear_pseudo_time
   use fw_wear_system, only: wear_system
   use fw_wear_tableau, only: new_tableau, tableau_type
   implicit none (type, external)
   private

   public :: wear_state, wear_step_report, wear_stepper, new_wear_stepper, largest_lag
   public :: is_another

   !> Where a wear run stands.
   type :: wear_state
      !> Cycles of vibration so far.
      real(wp) :: cycles = 0.0_wp
      !> Vibration, then depths (n).
      real(wp), allocatable :: x(:)
      !> Depth per cycle (n_pairs) [length].
      real(wp), allocatable :: rate(:)
      !> norm(R)/norm(F) of the vibration.
      real(wp) :: residual = 0.0_wp
   end type wear_state

   type :: wear_step_report
      logical :: converged = .false.
      !> Less accurate than was asked for, and left as it was found: not in equilibrium.
      logical :: is_refused = .false.
      integer :: iterations = 0
      !> Estimate of the error of the depths (n_pairs) [length]; zero where the scheme has none.
      real(wp), allocatable :: error(:)
   end type wear_step_report

   type :: wear_stepper
      !> wear_explicit, wear_implicit or wear_pseudo_time.
      integer :: scheme = wear_explicit
      !> Scheme of the pseudo-time.
      integer :: pseudo_scheme = scheme_rosenbrock
      integer :: order = 1
      type(newton_solver) :: newton
      !> Largest depth that a step may add, which pseudo-time enforces [length].
      real(wp) :: max_depth_step = huge(1.0_wp)
      !> Stages of the implicit scheme, and those of steps that are left to it.
      type(tableau_type), private :: tableau, other_tableau
      !> The next steps are left to the implicit scheme.
      logical, private :: falls_back = .false.
      !> Estimate the error; the explicit scheme then advances with the corrected depths.
      logical, private :: controls_error = .false.
      !> Error of a step over the largest depth.
      real(wp), private :: tolerance = huge(1.0_wp)
      real(wp), allocatable, private :: r(:), step(:)
   contains
      procedure :: advance
      procedure :: evaluate
      procedure :: settle
      procedure :: fall_back
   end type wear_stepper

   !> Relative residual of the linear solution of a pseudo-time step, and the growth of the
   !> residual of the vibration above which such a step is corrected.
   ! The next step starts from what a solution leaves: with a tenth of this, profiles of 5 to 320
   ! steps are the same.
   real(wp), parameter :: linear_tolerance = 1.0e-3_wp, largest_lag = 1.0e-2_wp
   !> The same of a step of high order, whose stages mend what the solutions before them left; above
   !> the lag its depths are not to be trusted.
   real(wp), parameter :: stage_tolerance = 1.0e-3_wp, farthest_lag = 0.3_wp
   !> What linear solutions may leave, as a part of the error that a step may have.
   real(wp), parameter :: noise = 0.3_wp
   !> Residual at which a step that lags too far has caught up: well within what others may lag.
   real(wp), parameter :: settled = 1.0e-1_wp*largest_lag
   !> Change of a vibration, as a part of it, at which another one was found.
   real(wp), parameter :: other_vibration = 5.0e-2_wp
   integer, parameter :: max_corrections = 5
   !> A pseudo-time step may exceed the growth of the depth that was aimed at by this factor.
   real(wp), parameter :: depth_allowance = 1.5_wp

contains

   !> The stepper of a case; the Newton solver brings its options.
   function new_wear_stepper(options, pseudo_scheme, newton) result(self)
      type(wear_options), intent(in) :: options
      !> Scheme of the pseudo-time (fw_solver_options).
      integer, intent(in) :: pseudo_scheme
      type(newton_solver), intent(in) :: newton
      type(wear_stepper) :: self

      self%scheme = options%scheme
      self%newton = newton
      ! The guesses of small steps are good: a looser solution only adds a step.
      self%newton%loosest = tight_forcing
      ! The linearly implicit schemes have no Newton's method to judge a solution.
      self%newton%linear%lu_follows = .true.
      self%controls_error = options%controls_error()
      if (self%controls_error) self%tolerance = options%tolerance()
      self%order = options%order
      if (self%order == 0) self%order = automatic_order(options)
      self%pseudo_scheme = pseudo_scheme
      if (options%scheme == wear_pseudo_time) then
         self%order = merge(rosenbrock_order, 1, pseudo_scheme == scheme_rosenbrock)
      end if
      self%tableau = new_tableau(self%order)
      if (options%max_depth_step > 0.0_wp) self%max_depth_step = options%max_depth_step
   end function new_wear_stepper

   !> Where steps follow an error 2 (explicit) or 3, else Euler.
   pure integer function automatic_order(options) result(order)
      type(wear_options), intent(in) :: options

      order = 1
      if (.not. options%controls_error()) return
      order = merge(2, 3, options%scheme == wear_explicit)
   end function automatic_order

   !> From a state to one that many cycles later. Where it does not converge, `after` is undefined
   !> and the system stands anywhere.
   subroutine advance(self, system, before, cycles, after, report, refuses)
      class(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      type(wear_state), intent(out) :: after
      type(wear_step_report), intent(out) :: report
      !> Whether a step that misses the tolerance may be left as it is (default: no).
      logical, intent(in), optional :: refuses
      logical :: may_refuse

      may_refuse = .false.
      if (present(refuses)) may_refuse = refuses
      allocate (report%error(size(before%rate)), source=0.0_wp)
      if (self%falls_back) then
         call implicit_step(self, system, before, cycles, after, report)
         after%cycles = before%cycles + cycles
         return
      end if
      select case (self%scheme)
      case (wear_explicit)
         call explicit_step(self, system, before, cycles, after, report)
      case (wear_pseudo_time)
         if (self%pseudo_scheme == scheme_rosenbrock) then
            call high_order_step(self, system, before, cycles, may_refuse, after, report)
         else
            call linear_step(self, system, before, cycles, after, report)
         end if
         ! At a kink linear steps may go to and fro; Newton's method with its line search does not.
         if (.not. (report%converged .or. system%is_interrupted())) then
            call try_implicitly(self, system, before, cycles, after, report)
         end if
      case default
         call implicit_step(self, system, before, cycles, after, report)
      end select
      after%cycles = before%cycles + cycles
   end subroutine advance

   !> An implicit step of the same order where a linear one has failed.
   subroutine try_implicitly(self, system, before, cycles, after, report)
      type(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      type(wear_state), intent(inout) :: after
      type(wear_step_report), intent(inout) :: report
      type(wear_state) :: implicit_after

      call implicit_step(self, system, before, cycles, implicit_after, report)
      after = implicit_after
   end subroutine try_implicitly

   !> Leave the steps to come to the implicit scheme of its usual order, or no longer.
   subroutine fall_back(self, is_wanted)
      class(wear_stepper), intent(inout) :: self
      logical, intent(in) :: is_wanted
      type(tableau_type) :: tableau

      if (is_wanted .eqv. self%falls_back) return
      if (is_wanted) self%other_tableau = new_tableau(merge(3, 1, self%controls_error))
      tableau = self%tableau
      self%tableau = self%other_tableau
      self%other_tableau = tableau
      self%order = self%tableau%order
      self%falls_back = is_wanted
   end subroutine fall_back

   !> The vibration at given depths, from the guess in state%x; its rates.
   subroutine settle(self, system, state, report, tolerance)
      class(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(inout) :: state
      type(solver_report), intent(out) :: report
      !> Relative residual that is enough (default: that of the solver).
      real(wp), intent(in), optional :: tolerance
      real(wp) :: strict
      integer :: n

      n = system%n_vibration()
      system%vibration%depth = state%x(n + 1:)
      strict = self%newton%options%tolerance
      if (present(tolerance)) self%newton%options%tolerance = max(strict, tolerance)
      call system%hold_depths(.true.)
      call self%newton%solve(system%vibration, state%x(:n), report)
      call system%hold_depths(.false.)
      self%newton%options%tolerance = strict
      ! The last point of Newton's method is the last one that it evaluated.
      if (report%converged) call system%remember(state%x, self%newton%r)
      call system%update_rate()
      state%rate = system%rate
      state%residual = report%residual
   end subroutine settle

   !> Euler, or Heun where the error is controlled: the trapezoidal rule then gives the depths, and
   !> its difference to Euler the error.
   subroutine explicit_step(self, system, before, cycles, after, report)
      type(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      type(wear_state), intent(out) :: after
      type(wear_step_report), intent(inout) :: report
      type(solver_report) :: solution
      integer :: n

      n = system%n_vibration()
      after%x = before%x
      after%x(n + 1:) = before%x(n + 1:) + cycles*before%rate
      call self%settle(system, after, solution)
      report%converged = solution%converged
      report%iterations = solution%iterations
      if (.not. solution%converged) return
      report%error = 0.5_wp*cycles*(after%rate - before%rate)
      if (self%order == 1) return
      after%x(n + 1:) = after%x(n + 1:) + report%error
      call self%settle(system, after, solution)
      report%converged = solution%converged
      report%iterations = report%iterations + solution%iterations
   end subroutine explicit_step

   !> The stages of the tableau, each an implicit Euler step from a base of its own.
   subroutine implicit_step(self, system, before, cycles, after, report)
      type(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      type(wear_state), intent(out) :: after
      type(wear_step_report), intent(inout) :: report
      type(solver_report) :: solution
      real(wp) :: rate(size(before%rate), 0:self%tableau%n_stages)
      real(wp) :: base(size(before%rate)), point(size(before%x), 0:self%tableau%n_stages)
      integer :: n, s

      n = system%n_vibration()
      after%x = before%x
      point(:, 0) = before%x
      rate(:, 0) = before%rate
      associate (t => self%tableau)
         do s = 1, t%n_stages
            ! What the stages before give at this one; its own rate is the unknown.
            base = before%x(n + 1:) + cycles*matmul(rate(:, 1:s - 1), t%a(s, 1:s - 1))
            call system%begin_step(base, t%gamma*cycles)
            call guess_stage(t, s, point, after%x)
            call self%newton%solve(system, after%x, solution)
            report%iterations = report%iterations + solution%iterations
            report%converged = solution%converged
            if (.not. solution%converged) return
            rate(:, s) = system%rate
            ! Exactly what this rate gives: a stage that grows by less than the solver's tolerance
            ! converges where it starts.
            after%x(n + 1:) = base + t%gamma*cycles*system%rate
            point(:, s) = after%x
         end do
         report%error = cycles*matmul(rate, t%error)
         ! Stiffly accurate: the last stage is the end of the step.
         after%rate = rate(:, t%n_stages)
      end associate
      after%residual = solution%residual
   end subroutine implicit_step

   !> A stage starts from the line through the start of the step and the stage before: vibration and
   !> depths move together, as in a scar that lowers the body. Depths alone would open all of the
   !> joint where they grow by more than its compression.
   subroutine guess_stage(tableau, stage, point, x)
      type(tableau_type), intent(in) :: tableau
      integer, intent(in) :: stage
      !> Start of the step (0) and solutions of its stages.
      real(wp), intent(in) :: point(:, 0:)
      real(wp), intent(inout) :: x(:)
      real(wp) :: fraction

      x = point(:, 0)
      if (stage == 1) return
      fraction = tableau%time(stage)/tableau%time(stage - 1)
      x = x + fraction*(point(:, stage - 1) - x)
   end subroutine guess_stage

   !> Linearly implicit Euler: one linear solution for vibration and depths together. Depths only
   !> grow, and by no more than the allowance. What the vibration lags behind is corrected where
   !> it is not small: wear cannot be taken back.
   subroutine linear_step(self, system, before, cycles, after, report)
      type(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      type(wear_state), intent(out) :: after
      type(wear_step_report), intent(inout) :: report
      real(wp) :: norm
      integer :: n, k
      logical :: done

      n = system%n_vibration()
      call system%begin_step(before%x(n + 1:), cycles)
      if (.not. allocated(self%r)) allocate (self%r(system%n), self%step(system%n))
      after%x = before%x
      call system%residual(after%x, self%r)
      do k = 1, max_corrections
         call self%newton%linear%solve(system, self%r, linear_tolerance, self%step, done)
         report%iterations = k
         if (.not. done .or. system%is_interrupted()) return
         after%x = after%x + self%step
         associate (depth => after%x(n + 1:), start => before%x(n + 1:))
            depth = min(max(depth, start), start + depth_allowance*self%max_depth_step)
         end associate
         call system%residual(after%x, self%r)
         norm = norm2(self%r(:n))/system%reference
         if (.not. ieee_is_finite(norm)) return
         report%converged = norm <= largest_lag
         if (report%converged) exit
      end do
      after%rate = system%rate
      after%residual = norm
   end subroutine linear_step

   !> Rosenbrock's method; the depths of a step that overshoots are its error estimate's business.
   subroutine high_order_step(self, system, before, cycles, may_refuse, after, report)
      type(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: before
      real(wp), intent(in) :: cycles
      !> Leave a step that misses the tolerance as it is.
      logical, intent(in) :: may_refuse
      type(wear_state), intent(out) :: after
      type(wear_step_report), intent(inout) :: report
      type(solver_report) :: solution
      real(wp) :: grown, tolerance, lagging(size(before%x))
      integer :: n
      logical :: done

      n = system%n_vibration()
      allocate (after%x(system%n))
      ! What the solutions leave has to be small beside the error that the step may have.
      grown = max(cycles*maxval(before%rate), tiny(1.0_wp))
      tolerance = min(stage_tolerance, max(tight_forcing, noise*self%tolerance* &
                                           (maxval(before%x(n + 1:)) + grown)/grown))
      call rosenbrock_step(system, self%newton%linear, tolerance, before%x, cycles, &
                           after%x, report%error, report%iterations, done)
      if (.not. done) return
      call self%evaluate(system, after)
      if (may_refuse .and. ieee_is_finite(after%residual)) then
         ! What its error refuses need not come to equilibrium first.
         report%is_refused = maxval(abs(report%error)) > self%tolerance*maxval(after%x(n + 1:))
      end if
      ! Beyond a fold of the vibration there is no equilibrium to lag behind.
      report%converged = after%residual <= settled .or. report%is_refused
      if (report%converged .or. .not. after%residual <= farthest_lag) return
      ! Its depths are as good as its estimate says: back to the equilibrium at these, which keeps
      ! the order and is far cheaper than the stages of an implicit step.
      lagging = after%x
      call self%settle(system, after, solution, tolerance=settled)
      report%iterations = report%iterations + solution%iterations
      report%converged = solution%converged
      if (report%converged) report%converged = .not. is_another(system, lagging, after%x)
   end subroutine high_order_step

   !> Whether a vibration, without its mean, is another one than that which it should be near to.
   pure logical function is_another(system, near, x)
      type(wear_system), intent(in) :: system
      !> Unknowns of the coupled system.
      real(wp), intent(in) :: near(:), x(:)
      integer :: first, last

      first = 1
      last = system%n_vibration()
      associate (problem => system%vibration%problem)
         if (problem%fourier%has_constant()) first = problem%structure%n_coordinates + 1
      end associate
      is_another = norm2(x(first:last) - near(first:last)) > &
                   other_vibration*norm2(near(first:last))
   end function is_another

   !> Rates and residual of the vibration at a state.
   subroutine evaluate(self, system, state)
      class(wear_stepper), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(inout) :: state

      if (.not. allocated(self%r)) allocate (self%r(system%n), self%step(system%n))
      call system%residual(state%x, self%r)
      state%rate = system%rate
      state%residual = norm2(self%r(:system%n_vibration()))/system%reference
   end subroutine evaluate

end module fw_wear_step
