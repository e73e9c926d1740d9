!> Rosenbrock 2(3) in pseudo-time: the linearly implicit pair of Shampine and Reichelt (1997,
!> "ode23s"), of order 2 and L-stable, with an error estimate from a third stage; with
!> W = 1 + h d P^-1 J and f = -P^-1 R,
!>
!>   W k1 = f(x0),   W (k2 - k1) = f(x0 + h k1/2) - k1,   x1 = x0 + h k2,
!>   W k3 = f(x1) - e (k2 - f(x0 + h k1/2)) - 2 (k1 - f(x0)),   error = h (k1 - 2 k2 + k3)/6.
!>
!> Multiplied by P/(h d) the matrix is J + P/(h d), that of a shift by h d, and P f = -R: no
!> solution with P is needed. Residuals are taken with the shift set, less P (x - x0)/(h d).
module fw_pseudo_rosenbrock
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_pseudo_linear, only: shifted_linear
   use fw_pseudo_scheme, only: pseudo_scheme
   use fw_pseudo_system, only: pseudo_system
   implicit none (type, external)
   private

   public :: rosenbrock_scheme

   type, extends(pseudo_scheme) :: rosenbrock_scheme
      !> Error of a step, relative to the unknowns. The path is of no interest, only its end.
      real(wp) :: accuracy = 1.0e-2_wp
      !> Adapt the step to the error.
      logical :: adaptive = .true.
      type(shifted_linear) :: linear
      !> Start of the step, P k and residuals of the stages (n each).
      real(wp), allocatable :: x_old(:), r0(:), r1(:), k1(:), k2(:), k3(:), p1(:), p2(:)
   contains
      procedure :: start
      procedure :: advance
   end type rosenbrock_scheme

   ! d makes the pair L-stable, e the third stage of order 3 (Shampine and Reichelt 1997).
   real(wp), parameter :: d = 1.0_wp/(2.0_wp + sqrt(2.0_wp)), e = 6.0_wp + sqrt(2.0_wp)
   !> First step, relative to the scale of pseudo-time, and the shortest one.
   real(wp), parameter :: first_step = 1.0e-2_wp, shortest = 1.0e-12_wp
   !> Limits of the change of a step; the error goes with its third power.
   real(wp), parameter :: least_change = 0.2_wp, largest_change = 5.0_wp, safety = 0.8_wp

contains

   !> Workspace, and the first step as implicit Euler chooses it.
   subroutine start(self, system, x, done)
      class(rosenbrock_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done
      integer :: n

      n = size(x)
      done = n == system%n
      self%linear%kind = self%solver%linear
      self%step = self%options%step
      if (self%step <= 0.0_wp) self%step = first_step*self%scales%time
      allocate (self%x_old(n), self%r0(n), self%r1(n), self%k1(n), self%k2(n), self%k3(n))
      allocate (self%p1(n), self%p2(n))
   end subroutine start

   !> One accepted step: one whose error is too large is repeated with a shorter one.
   subroutine advance(self, system, x, done)
      class(rosenbrock_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done
      real(wp) :: error, taken

      self%x_old = x
      do
         taken = self%step
         call try_step(self, system, x, error)
         ! With a fixed step only failure is refused.
         done = error <= 1.0_wp .or. (.not. self%adaptive .and. ieee_is_finite(error))
         if (self%adaptive) self%step = taken*change(error)
         if (done) exit
         x = self%x_old
         self%rejected = self%rejected + 1
         if (system%is_interrupted()) exit
         if (self%step < shortest*self%scales%time .or. .not. self%adaptive .or. &
             self%accepted + self%rejected >= self%options%max_steps) exit
      end do
      if (done) then
         self%accepted = self%accepted + 1
         self%time = self%time + taken
         ! Memory of the contact moves on with the flow, if it is carried.
         call system%accept(x)
         call system%clear_shift()
      else
         self%message = 'Rosenbrock: no step keeps the error small, however short'
         call system%clear_shift()
         call system%residual(x, self%r)
      end if
   end subroutine advance

   !> One step of length self%step from x_old to x; the residual at its end in self%r. A step that
   !> fails has an infinite error.
   subroutine try_step(self, system, x, error)
      type(rosenbrock_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      real(wp), intent(out) :: error
      real(wp) :: h
      logical :: done

      h = self%step
      ! What a failure returns; change() then shortens the step as far as it may.
      error = huge(1.0_wp)
      call system%set_shift(h*d, self%x_old)
      call self%linear%prepare(system, self%x_old, self%r0, done)
      if (.not. done) return
      ! r0 is R(x_old): at the start of the step the shift adds nothing. All stages are those of
      ! the header times P/(h d).
      self%k1 = -self%r0/(h*d)
      call solve_stage(self, system, self%k1, done)
      if (.not. done) return
      ! P k1 is needed twice: in the shifted residual and in the next right-hand side.
      call system%flow_product(self%k1, self%p1)

      x = self%x_old + 0.5_wp*h*self%k1
      call residual_of(self, system, x, 0.5_wp/d, self%p1, self%r1)
      self%k2 = -(self%r1 + self%p1)/(h*d)
      call solve_stage(self, system, self%k2, done)
      if (.not. done) return
      self%k2 = self%k2 + self%k1
      call system%flow_product(self%k2, self%p2)

      x = self%x_old + h*self%k2
      call residual_of(self, system, x, 1.0_wp/d, self%p2, self%r)
      self%k3 = -(self%r + e*(self%p2 + self%r1) + 2.0_wp*(self%p1 + self%r0))/(h*d)
      call solve_stage(self, system, self%k3, done)
      if (.not. done) return
      ! The estimate h (k1 - 2 k2 + k3)/6, in the place of k3, which has served.
      self%k3 = h*(self%k1 - 2.0_wp*self%k2 + self%k3)/6.0_wp
      error = relative_norm(self, self%k3, x)
   end subroutine try_step

   !> Every stage has the same matrix: its factors, or its preconditioner, serve them all.
   subroutine solve_stage(self, system, b, done)
      type(rosenbrock_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: b(:)
      logical, intent(out) :: done

      call self%linear%solve(system, b, done)
      self%linear_solves = self%linear_solves + 1
      if (done) done = ieee_is_finite(norm2(b))
   end subroutine solve_stage

   !> R(x) out of the shifted residual, where P (x - x_old)/(h d) = factor * product.
   subroutine residual_of(self, system, x, factor, product, r)
      type(rosenbrock_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:), product(:)
      real(wp), intent(in) :: factor
      real(wp), intent(inout), contiguous :: r(:)

      call system%residual(x, r)
      call self%linear%left()
      r = r - factor*product
   end subroutine residual_of

   !> Root mean square of an error over what is allowed.
   real(wp) function relative_norm(self, error, x) result(norm)
      type(rosenbrock_scheme), intent(in) :: self
      real(wp), intent(in), contiguous :: error(:), x(:)
      integer :: i

      norm = 0.0_wp
      do i = 1, size(x)
         norm = norm + (error(i)/(self%scales%unknown + abs(x(i))))**2
      end do
      norm = sqrt(norm/real(max(1, size(x)), wp))/self%accuracy
      if (.not. ieee_is_finite(norm)) norm = huge(1.0_wp)
   end function relative_norm

   !> Factor of the step after an error.
   !> An error of zero leaves the largest growth.
   pure real(wp) function change(error)
      real(wp), intent(in) :: error

      change = largest_change
      if (error > 0.0_wp) change = safety*error**(-1.0_wp/3.0_wp)
      change = min(largest_change, max(least_change, change))
   end function change

end module fw_pseudo_rosenbrock
