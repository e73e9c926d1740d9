!> Solution by integration in pseudo-time: follow P dx/dt = -R(x) towards a steady state with one
!> of the schemes, and end with Newton's method when the residual is small or the steps are long.
!>
!> A flow need not have stable steady states, nor a scheme suit a flow. Where it does not work the
!> report says what was seen, after max_steps steps at most.
module fw_pseudo_time
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
   use fw_pseudo_bdf, only: bdf_scheme
   use fw_pseudo_euler, only: euler_scheme
   use fw_pseudo_rosenbrock, only: rosenbrock_scheme
   use fw_pseudo_runge_kutta, only: runge_kutta_scheme
   use fw_pseudo_scheme, only: estimate_scales, pseudo_scheme
   use fw_pseudo_system, only: pseudo_system
   use fw_solver_options, only: pseudo_time_options, scheme_bdf, scheme_rosenbrock, &
      scheme_runge_kutta, solver_options
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: pseudo_time_solver, pseudo_report

   !> `iterations` counts linear solutions (of the explicit scheme: steps), Newton's at the end
   !> included.
   type, extends(solver_report) :: pseudo_report
      !> Steps taken and refused, and the pseudo-time reached.
      integer :: steps = 0
      integer :: rejected = 0
      real(wp) :: time = 0.0_wp
      !> Newton's method ended the path.
      logical :: by_newton = .false.
      !> What went wrong; empty where it converged.
      character(:), allocatable :: message
   end type pseudo_report

   type :: pseudo_time_solver
      type(solver_options) :: options
      type(pseudo_time_options) :: pseudo
      !> Try Newton's method on the way; without it the flow itself must reach the tolerance.
      logical :: end_with_newton = .true.
      !> Highest order of the scheme 'bdf', 1 to 5; 0: that scheme's own choice.
      integer :: bdf_max_order = 0
      type(newton_solver) :: newton
      !> The best point and where Newton's method is tried (n).
      real(wp), allocatable :: best_x(:), trial(:)
   contains
      procedure :: solve
   end type pseudo_time_solver

   !> Where Newton's method has been tried, and what the flow started from.
   type :: progress_type
      !> Residuals over the reference: at the start, and the smallest so far.
      real(wp) :: first = huge(1.0_wp)
      real(wp) :: best = huge(1.0_wp)
      !> Residual and step where Newton's method was tried last, and what it has taken in all.
      real(wp) :: tried_norm = huge(1.0_wp)
      real(wp) :: tried_step = huge(1.0_wp)
      integer :: newton_iterations = 0
   end type progress_type

   !> Newton's method is tried again when the residual has fallen, or the step grown, this much.
   real(wp), parameter :: fall = 0.1_wp, growth = 32.0_wp
   integer, parameter :: newton_iterations = 12
   !> Residual, relative to the larger of the first one and the reference, that shows a flow
   !> running away.
   real(wp), parameter :: runaway = 1.0e6_wp

contains

   !> A scheme by its number in the options.
   !> Only the type and its options; `start` makes the workspace, once sizes and scales are known.
   subroutine new_scheme(scheme, options, pseudo)
      class(pseudo_scheme), allocatable, intent(out) :: scheme
      type(solver_options), intent(in) :: options
      type(pseudo_time_options), intent(in) :: pseudo

      select case (pseudo%scheme)
      case (scheme_bdf)
         allocate (bdf_scheme :: scheme)
      case (scheme_rosenbrock)
         allocate (rosenbrock_scheme :: scheme)
      case (scheme_runge_kutta)
         allocate (runge_kutta_scheme :: scheme)
      case default
         allocate (euler_scheme :: scheme)
      end select
      scheme%solver = options
      scheme%options = pseudo
   end subroutine new_scheme

   !> Solve from the guess in x; the best point found is left there.
   subroutine solve(self, system, x, report)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      type(pseudo_report), intent(out) :: report
      class(pseudo_scheme), allocatable :: scheme
      type(progress_type) :: progress
      logical :: done

      report%message = ''
      self%newton%options = self%options
      ! Newton's method on the way either arrives soon or not at all.
      self%newton%options%max_iterations = min(newton_iterations, self%options%max_iterations)
      self%best_x = x
      self%trial = x
      call new_scheme(scheme, self%options, self%pseudo)
      select type (scheme)
      type is (bdf_scheme)
         if (self%bdf_max_order > 0) scheme%max_order = self%bdf_max_order
      end select
      call begin(self, system, x, scheme, progress, report, done)
      do while (.not. done)
         ! Both count: a scheme that refuses for ever must end too.
         if (scheme%accepted + scheme%rejected >= self%pseudo%max_steps) then
            report%message = 'steps run out: '//to_text(scheme%accepted)//' taken, '// &
                             to_text(scheme%rejected)//' refused'
            exit
         end if
         report%interrupted = system%is_interrupted()
         if (report%interrupted) then
            report%message = 'ended from outside'
            exit
         end if
         call advance(self, system, x, scheme, done)
         if (.not. done) then
            report%message = scheme%message
            exit
         end if
         call judge(self, system, x, scheme, progress, report, done)
      end do
      ! On every way out, since SUNDIALS holds memory of its own.
      call scheme%finish()
      call system%clear_shift()
      report%interrupted = .not. done .and. system%is_interrupted()
      if (self%end_with_newton .and. len(report%message) > 0 .and. scheme%accepted > 0 .and. &
          .not. report%interrupted) then
         ! A last resort: the flow has not arrived, but may have come near.
         x = self%best_x
         call try_newton(self, system, x, progress, report, done)
      end if
      call conclude(self, system, x, scheme, progress, report)
   end subroutine solve

   !> First residual, scales, start of the scheme; done where there is nothing to integrate.
   subroutine begin(self, system, x, scheme, progress, report, done)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      class(pseudo_scheme), intent(inout) :: scheme
      type(progress_type), intent(inout) :: progress
      type(pseudo_report), intent(inout) :: report
      logical, intent(out) :: done
      logical :: started

      call system%clear_shift()
      allocate (scheme%r(size(x)))
      call system%residual(x, scheme%r)
      progress%first = norm2(scheme%r)/system%reference
      progress%best = progress%first
      done = .true.
      if (progress%first <= self%options%tolerance) return
      if (.not. ieee_is_finite(progress%first)) then
         report%message = 'the residual of the guess is not a number'
         return
      end if
      ! Time and unknowns have no natural unit: steps and errors are relative to these.
      call estimate_scales(system, self%options%linear, x, scheme%r, scheme%scales)
      call scheme%start(system, x, started)
      if (started) then
         ! Newton's method has its turn once the flow has gained something.
         progress%tried_norm = progress%first
         progress%tried_step = scheme%step
         done = .false.
      else
         report%message = 'the scheme could not be set up'
      end if
   end subroutine begin

   !> One step; all unknowns take part, since pseudo-time moves all of them.
   subroutine advance(self, system, x, scheme, done)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      class(pseudo_scheme), intent(inout) :: scheme
      logical, intent(out) :: done
      logical :: reduced

      associate (self => self)
      end associate
      reduced = system%reduced
      select type (scheme)
      type is (euler_scheme)
         ! Its steps are Newton's, which copes with a reduced problem.
      class default
         system%reduced = .false.
      end select
      call scheme%advance(system, x, done)
      system%reduced = reduced
   end subroutine advance

   !> After a step: solved, running away, or time to try Newton's method?
   subroutine judge(self, system, x, scheme, progress, report, done)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      class(pseudo_scheme), intent(in) :: scheme
      type(progress_type), intent(inout) :: progress
      type(pseudo_report), intent(inout) :: report
      logical, intent(out) :: done
      real(wp) :: norm

      norm = norm2(scheme%r)/system%reference
      if (norm < progress%best) then
         progress%best = norm
         self%best_x = x
      end if
      done = norm <= self%options%tolerance
      if (done) return
      ! Written so that NaN runs away too.
      if (.not. norm <= runaway*max(1.0_wp, progress%first)) then
         report%message = 'the flow runs away from its start: it has no stable steady state '// &
                          'there, or the steps are too long for the scheme'
         done = .true.
         return
      end if
      if (.not. self%end_with_newton) return
      if (norm > fall*progress%tried_norm .and. scheme%step < growth*progress%tried_step) return
      progress%tried_norm = norm
      progress%tried_step = scheme%step
      call try_newton(self, system, x, progress, report, done)
   end subroutine judge

   !> Newton's method from the present point; the flow goes on from there where it fails.
   subroutine try_newton(self, system, x, progress, report, done)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(progress_type), intent(inout) :: progress
      type(pseudo_report), intent(inout) :: report
      logical, intent(out) :: done
      type(solver_report) :: outcome

      self%trial = x
      call self%newton%solve(system, self%trial, outcome)
      progress%newton_iterations = progress%newton_iterations + outcome%iterations
      if (outcome%residual < progress%best) then
         progress%best = outcome%residual
         self%best_x = self%trial
      end if
      done = outcome%converged
      report%by_newton = done
   end subroutine try_newton

   !> The best point and the verdict on it.
   subroutine conclude(self, system, x, scheme, progress, report)
      class(pseudo_time_solver), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      class(pseudo_scheme), intent(inout) :: scheme
      type(progress_type), intent(in) :: progress
      type(pseudo_report), intent(inout) :: report

      x = self%best_x
      call system%clear_shift()
      ! The system is left at the point that is returned.
      call system%residual(x, scheme%r)
      report%residual = norm2(scheme%r)/system%reference
      report%converged = report%residual <= self%options%tolerance
      report%steps = scheme%accepted
      report%rejected = scheme%rejected
      report%time = scheme%time
      report%iterations = scheme%linear_solves + progress%newton_iterations
      ! An explicit scheme solves nothing: its steps are its work.
      if (scheme%linear_solves == 0) report%iterations = report%iterations + scheme%accepted + &
                                                         scheme%rejected
      if (report%converged) report%message = ''
   end subroutine conclude

end module fw_pseudo_time
