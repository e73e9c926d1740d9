!> The largest amplitude at which pairs that vibrate can stick for some constant offset of their
!> tangential forces (Melan's bound): with offsets x and the amplitude A
!>
!>   |T_i(t)| <= mu_i N_i(t),   T_i = x_i + A c_i(t),   N_i = N_0i + sum_j C_ij x_j + A n_i(t)
!>
!> at every instant, maximise A. The set is convex. Newton's method on A and the logarithms of what
!> is left to the limits, with ever less weight on these, leads to its end through the inside.
module fw_shakedown_bound
   use fw_kinds, only: pi, wp
   use fw_linalg, only: lu_type
   implicit none (type, external)
   private

   public :: shakedown_type

   type :: shakedown_type
      !> Pairs, and unknowns: offsets and the amplitude behind them.
      integer :: n_pairs = 0, n = 0
      !> Friction coefficients (n_pairs); places of the offsets of each pair among the unknowns, 0
      !> where it has no such direction (2, n_pairs).
      real(wp), allocatable :: mu(:)
      integer, allocatable :: place(:, :)
      !> Normal forces without vibration or offset (n_pairs), and what offsets add (n_pairs, n - 1).
      real(wp), allocatable :: normal(:), coupling(:, :)
      !> Of t1, t2 and the normal force, for a unit amplitude: A Re(cycle exp(i t)) (3, n_pairs).
      complex(wp), allocatable :: cycle(:, :)
      !> Instants at which laws decide, 0: all the time.
      integer :: n_time = 0
   contains
      procedure :: maximise
   end type shakedown_type

   !> Rows times squared unknowns of a step that take no time, and instants of a period.
   real(wp), parameter :: light = 5.0e5_wp
   integer, parameter :: fewest = 96, most = 1440

contains

   !> From offsets that bear an amplitude to the largest one; both are scaled to be of order one.
   subroutine maximise(self, x, done)
      class(shakedown_type), intent(in) :: self
      !> Offsets, then the amplitude (n).
      real(wp), intent(inout) :: x(:)
      logical, intent(out) :: done
      !> Part of the amplitude that the weight of the limits may take, growth of the weight of the
      !> amplitude, and steps for each.
      real(wp), parameter :: small = 1.0e-7_wp, growth = 30.0_wp
      integer, parameter :: most_steps = 25
      real(wp) :: weight, rows
      integer :: k, n_time
      logical :: failed

      n_time = instants(self)
      rows = 2.0_wp*n_time*self%n_pairs
      weight = 1.0_wp/x(self%n)
      done = allowed(self, n_time, x)
      do while (done)
         do k = 1, most_steps
            call improve(self, n_time, weight, x, done, failed)
            if (done .or. failed) exit
         end do
         ! What bears any amplitude has no bound, and what ends on the way is none.
         done = x(self%n) < 1.0e6_wp .and. .not. failed
         if (.not. done) exit
         if (rows < small*weight*x(self%n)) exit
         weight = growth*weight
      end do
   end subroutine maximise

   pure integer function instants(self) result(n_time)
      type(shakedown_type), intent(in) :: self

      n_time = self%n_time
      if (n_time > 0) return
      n_time = min(most, max(fewest, int(light/(real(self%n_pairs, wp)*self%n**2))))
   end function instants

   !> Limits mu^2 N^2 - |T|^2 of a pair at an instant, N, and their slopes.
   pure subroutine limits(self, i, wave, x, left, pressure, by_x, normal_by_x)
      type(shakedown_type), intent(in) :: self
      integer, intent(in) :: i
      complex(wp), intent(in) :: wave
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: left, pressure, by_x(:, :), normal_by_x(:)
      real(wp) :: force
      integer :: c, n

      n = self%n
      normal_by_x(:n - 1) = self%coupling(i, :)
      normal_by_x(n) = real(self%cycle(3, i)*wave, wp)
      pressure = self%normal(i) + dot_product(normal_by_x, x)
      left = (self%mu(i)*pressure)**2
      by_x = 0.0_wp
      do c = 1, 2
         if (self%place(c, i) == 0) cycle
         by_x(self%place(c, i), c) = 1.0_wp
         by_x(n, c) = real(self%cycle(c, i)*wave, wp)
         force = dot_product(by_x(:, c), x)
         left = left - force**2
      end do
   end subroutine limits

   !> Whether every pair bears, below its limit.
   pure logical function allowed(self, n_time, x)
      type(shakedown_type), intent(in) :: self
      integer, intent(in) :: n_time
      real(wp), intent(in) :: x(:)
      real(wp) :: left, pressure, by_x(size(x), 2), normal_by_x(size(x))
      integer :: i, k

      allowed = .false.
      do i = 1, self%n_pairs
         do k = 1, n_time
            call limits(self, i, wave_at(k, n_time), x, left, pressure, by_x, normal_by_x)
            if (.not. pressure > 0.0_wp) return
            if (any(self%place(:, i) > 0) .and. .not. left > 0.0_wp) return
         end do
      end do
      allowed = x(size(x)) > 0.0_wp
   end function allowed

   pure complex(wp) function wave_at(k, n_time) result(wave)
      integer, intent(in) :: k, n_time
      real(wp) :: angle

      angle = 2.0_wp*pi*real(k - 1, wp)/real(n_time, wp)
      wave = cmplx(cos(angle), sin(angle), wp)
   end function wave_at

   !> A step of Newton's method, shortened to stay inside; done where it changes nothing.
   subroutine improve(self, n_time, weight, x, done, failed)
      type(shakedown_type), intent(in) :: self
      integer, intent(in) :: n_time
      real(wp), intent(in) :: weight
      real(wp), intent(inout) :: x(:)
      logical, intent(out) :: done
      !> No step was found.
      logical, intent(out) :: failed
      real(wp), parameter :: no_change = 1.0e-6_wp
      real(wp) :: gradient(size(x)), step(size(x)), length, decrement
      type(lu_type) :: lu
      logical :: singular
      integer :: halving

      call lu%reserve(self%n)
      call slopes(self, n_time, x, gradient, lu%matrix(:self%n, :self%n))
      gradient(self%n) = gradient(self%n) - weight
      call lu%factor(singular)
      done = .false.
      failed = singular
      if (singular) return
      step = -gradient
      call lu%solve(step)
      decrement = sqrt(max(0.0_wp, -dot_product(gradient, step)))
      done = decrement <= no_change
      ! Within one over the decrement such functions are near to their parabola.
      length = 1.0_wp
      if (decrement > 0.25_wp) length = 1.0_wp/(1.0_wp + decrement)
      do halving = 1, 60
         if (allowed(self, n_time, x + length*step)) exit
         length = 0.5_wp*length
      end do
      if (halving > 60) then
         done = .true.
         return
      end if
      x = x + length*step
   end subroutine improve

   !> First and second derivatives of minus the logarithms of all limits.
   subroutine slopes(self, n_time, x, gradient, curvature)
      type(shakedown_type), intent(in) :: self
      integer, intent(in) :: n_time
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: gradient(:), curvature(:, :)
      real(wp), dimension(size(x)) :: normal_by_x, slope
      real(wp) :: left, pressure, by_x(size(x), 2)
      integer :: c, i, k

      gradient = 0.0_wp
      curvature = 0.0_wp
      do i = 1, self%n_pairs
         do k = 1, n_time
            call limits(self, i, wave_at(k, n_time), x, left, pressure, by_x, normal_by_x)
            if (all(self%place(:, i) == 0)) then
               slope = normal_by_x/pressure
               gradient = gradient - slope
               call add_square(1.0_wp, slope, curvature)
               cycle
            end if
            slope = 2.0_wp*self%mu(i)**2*pressure*normal_by_x
            do c = 1, 2
               slope = slope - 2.0_wp*dot_product(by_x(:, c), x)*by_x(:, c)
               call add_square(2.0_wp/left, by_x(:, c), curvature)
            end do
            gradient = gradient - slope/left
            call add_square(1.0_wp/left**2, slope, curvature)
            call add_square(-2.0_wp*self%mu(i)**2/left, normal_by_x, curvature)
         end do
      end do
   end subroutine slopes

   pure subroutine add_square(factor, vector, matrix)
      real(wp), intent(in) :: factor, vector(:)
      real(wp), intent(inout) :: matrix(:, :)
      integer :: j

      do j = 1, size(vector)
         if (.not. abs(vector(j)) > 0.0_wp) cycle
         matrix(:, j) = matrix(:, j) + factor*vector(j)*vector
      end do
   end subroutine add_square

end module fw_shakedown_bound
