!> Implicit Euler in pseudo-time: each step is a Newton solution of R(x) + P (x - x_old)/h = 0. The
!> step grows while these converge and shrinks at once where one does not; only the end of the path
!> matters, so that no error is estimated.
module fw_pseudo_euler
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
   use fw_pseudo_scheme, only: pseudo_scheme
   use fw_pseudo_system, only: pseudo_system
   implicit none (type, external)
   private

   public :: euler_scheme

   type, extends(pseudo_scheme) :: euler_scheme
      !> Factors of the step after a success that was easy, one that was not, and a failure.
      real(wp) :: growth = 2.0_wp
      real(wp) :: growth_hard = 1.6_wp
      real(wp) :: shrinkage = 0.25_wp
      !> Residual of a step, relative to that at its start.
      real(wp) :: accuracy = 1.0e-2_wp
      !> Shortest step ever taken, relative to the scale of pseudo-time.
      real(wp) :: shortest = 1.0e-10_wp
      type(newton_solver) :: newton
      real(wp), allocatable :: x_old(:)
   contains
      procedure :: start
      procedure :: advance
   end type euler_scheme

   !> Iterations that a step may take, and up to which it counts as easy.
   integer, parameter :: max_iterations = 8, easy = 3
   !> First step, relative to the scale of pseudo-time.
   real(wp), parameter :: first_step = 0.1_wp

contains

   !> Workspace, and the first step: that of the user, or one from the scale of pseudo-time.
   subroutine start(self, system, x, done)
      class(euler_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done

      self%newton%options = self%solver
      self%newton%options%max_iterations = max_iterations
      ! A shift keeps the derivative from being singular: a step that fails all the same is one
      ! whose preconditioner does not serve.
      self%newton%linear%lu_follows = .true.
      self%x_old = x
      self%step = self%options%step
      if (self%step <= 0.0_wp) self%step = first_step*self%scales%time
      done = size(x) == system%n
   end subroutine start

   !> One accepted step, shortened until Newton's method converges; self%r is the residual at its
   !> end.
   subroutine advance(self, system, x, done)
      class(euler_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done
      type(solver_report) :: report

      self%x_old = x
      ! A hundredth of the residual at hand: nothing is gained by following the path more closely.
      self%newton%options%tolerance = max(self%solver%tolerance, &
                                          self%accuracy*norm2(self%r)/system%reference)
      do
         call system%set_shift(self%step, self%x_old)
         call self%newton%solve(system, x, report)
         self%linear_solves = self%linear_solves + report%iterations
         done = report%converged
         if (done) exit
         self%rejected = self%rejected + 1
         x = self%x_old
         if (report%interrupted) exit
         self%step = self%shrinkage*self%step
         if (self%step < self%shortest*self%scales%time) exit
         if (self%accepted + self%rejected >= self%options%max_steps) exit
      end do
      if (done) then
         call system%accept(x)
         self%accepted = self%accepted + 1
         self%time = self%time + self%step
         ! Long steps become Newton's method on R itself.
         self%step = merge(self%growth, self%growth_hard, report%iterations <= easy)*self%step
      else
         self%message = 'implicit Euler: no step converges, however short'
      end if
      call system%clear_shift()
      call system%residual(x, self%r)
   end subroutine advance

end module fw_pseudo_euler
