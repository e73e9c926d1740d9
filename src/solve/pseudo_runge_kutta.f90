!> Explicit multistage scheme in pseudo-time (Jameson, Schmidt, Turkel 1981; Jameson 1985): from
!> stage to stage  x_k = x_0 + a_k h dx/dt(x_(k-1)),  with two vectors of storage. Stable where the
!> eigenvalues of P^-1 J have positive real parts, and then only for steps of some Courant number;
!> each unknown may have its own step.
module fw_pseudo_runge_kutta
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_pseudo_scheme, only: pseudo_scheme
   use fw_pseudo_system, only: pseudo_system
   implicit none (type, external)
   private

   public :: runge_kutta_scheme

   !> Coefficients of the stages. Four: order 4 for linear systems; five: order 2, with damping.
   real(wp), parameter :: four_stages(4) = [0.25_wp, 1.0_wp/3.0_wp, 0.5_wp, 1.0_wp]
   real(wp), parameter :: five_stages(5) = [0.25_wp, 1.0_wp/6.0_wp, 0.375_wp, 0.5_wp, 1.0_wp]

   type, extends(pseudo_scheme) :: runge_kutta_scheme
      !> 4 or 5.
      integer :: n_stages = 5
      real(wp) :: cfl = 0.8_wp
      !> The residual grew in the last step.
      logical :: grew = .false.
      !> Steps (n), the start of a step (n), rates at its stages and its start (n).
      real(wp), allocatable :: steps(:), x_old(:), rate(:), rate_old(:)
   contains
      procedure :: start
      procedure :: advance
   end type runge_kutta_scheme

   !> Steps after which the steps are computed anew, if the residual has not grown before: the
   !> stiffness of contact follows its state. A reduced Courant number recovers at that pace.
   integer, parameter :: refresh = 20
   !> Growth of the residual in one step that shows instability; a transient stays far below.
   real(wp), parameter :: unstable = 10.0_wp
   !> Change of the rate times the step over the change of the unknowns: a stable step keeps below
   !> the radius of stability (2.6), or twice that where P^-1 J is not normal. What exceeds it has
   !> stepped over a region stiffer than where it started.
   real(wp), parameter :: too_stiff = 5.0_wp
   ! Shorter steps would not arrive within any number of them.
   real(wp), parameter :: smallest_cfl = 1.0e-3_wp
   !> Relative to the scale of pseudo-time: where the derivative nearly vanishes.
   real(wp), parameter :: longest_step = 1.0e3_wp

contains

   !> Workspace alone: the steps follow from the derivative, when they are first needed.
   subroutine start(self, system, x, done)
      class(runge_kutta_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done

      self%cfl = self%options%cfl
      self%x_old = x
      allocate (self%steps(size(x)), self%rate(size(x)), self%rate_old(size(x)))
      done = size(x) == system%n
   end subroutine start

   !> One accepted step: one that proves unstable is repeated with half the Courant number.
   subroutine advance(self, system, x, done)
      class(runge_kutta_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done
      real(wp) :: before, after

      self%x_old = x
      before = norm2(self%r)
      ! Doubling at the pace of the refreshes lets a bad region be left slowly.
      if (modulo(self%accepted, refresh) == 0) self%cfl = min(self%options%cfl, 2.0_wp*self%cfl)
      if (modulo(self%accepted, refresh) == 0 .or. self%grew) call choose_steps(self, system, x)
      do
         call take_step(self, system, x, done)
         after = norm2(self%r)
         if (done) done = after <= unstable*before
         if (done) exit
         self%rejected = self%rejected + 1
         x = self%x_old
         ! Back at the start of the step, also for the system.
         call system%residual(x, self%r)
         self%cfl = 0.5_wp*self%cfl
         if (self%cfl < smallest_cfl .or. &
             self%accepted + self%rejected >= self%options%max_steps) then
            self%message = 'Runge-Kutta: unstable at every Courant number'
            return
         end if
         call choose_steps(self, system, x)
      end do
      self%grew = after > before
      self%accepted = self%accepted + 1
      self%time = self%time + self%step
   end subroutine advance

   !> An explicit step given by the user is the longest one.
   subroutine choose_steps(self, system, x)
      class(runge_kutta_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)

      call system%local_steps(x, self%cfl, self%steps)
      self%steps = min(self%steps, longest_step*self%scales%time)
      if (self%options%step > 0.0_wp) then
         self%steps = min(self%steps, self%options%step*self%cfl/self%options%cfl)
      end if
      ! For the record only: with local steps there is no common time.
      self%step = minval(self%steps)
   end subroutine choose_steps

   !> The residual at x is known; that at the end is left in self%r. Not done where a stage shows
   !> that the step is too long.
   subroutine take_step(self, system, x, done)
      class(runge_kutta_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: done
      real(wp) :: coefficient
      integer :: stage

      self%rate_old = self%r
      call system%flow_solve(self%rate_old)
      self%rate = self%rate_old
      do stage = 1, self%n_stages
         if (self%n_stages == size(four_stages)) then
            coefficient = four_stages(stage)
         else
            coefficient = five_stages(stage)
         end if
         ! All stages start at x_old: the scheme keeps two vectors, whatever its stages.
         x = self%x_old - coefficient*self%steps*self%rate
         call system%residual(x, self%r)
         done = ieee_is_finite(norm2(self%r))
         if (.not. done) return
         self%rate = self%r
         call system%flow_solve(self%rate)
         done = .not. is_too_long(self, x)
         if (.not. done) return
      end do
   end subroutine take_step

   !> Compares the change of the rate with the motion that caused it: an estimate of h |P^-1 J|.
   pure logical function is_too_long(self, x)
      type(runge_kutta_scheme), intent(in) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp) :: change, motion
      integer :: i

      change = 0.0_wp
      motion = 0.0_wp
      do i = 1, size(x)
         change = change + (self%steps(i)*(self%rate(i) - self%rate_old(i)))**2
         motion = motion + (x(i) - self%x_old(i))**2
      end do
      is_too_long = change > too_stiff**2*motion
   end function is_too_long

end module fw_pseudo_runge_kutta
