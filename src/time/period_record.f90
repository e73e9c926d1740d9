!> What is kept of one period: samples at the starts of its steps and means over them.
module fw_period_record
   use fw_kinds, only: wp, pi
   implicit none (type, external)
   private

   public :: period_record, new_period_record, sampled_coefficients, averaged_coefficients
   public :: largest_sample

   type :: period_record
      integer :: n_steps = 0
      !> Observed quantities at the starts of the steps, of directions with mass
      !> (n_observed, n_steps).
      real(wp), allocatable :: observed(:, :)
      !> Their means over the steps, of massless directions (n_observed, n_steps).
      real(wp), allocatable :: observed_mean(:, :)
      !> Contact forces, means over the steps (3, n_pairs, n_steps) [force].
      real(wp), allocatable :: force(:, :, :)
      !> Relative displacements, means over the steps (3, n_pairs, n_steps) [length].
      real(wp), allocatable :: slip(:, :, :)
      !> Share of the period in stick, slip and open (3, n_pairs).
      real(wp), allocatable :: share(:, :)
      !> Work of the contact forces (n_pairs) [force * length].
      real(wp), allocatable :: work(:)
      !> Work of obstacles that move (n_pairs).
      real(wp), allocatable :: obstacle_work(:)
      !> Steps taken, all refinements included, and contact problems that were not solved.
      integer :: n_taken = 0
      integer :: n_failed = 0
   contains
      procedure :: clear
   end type period_record

contains

   !> Sizes stay; `clear` begins a new period.
   pure function new_period_record(n_observed, n_pairs, n_steps) result(self)
      integer, intent(in) :: n_observed, n_pairs, n_steps
      type(period_record) :: self

      self%n_steps = n_steps
      allocate (self%observed(n_observed, n_steps), self%observed_mean(n_observed, n_steps))
      allocate (self%force(3, n_pairs, n_steps), self%slip(3, n_pairs, n_steps))
      allocate (self%share(3, n_pairs), self%work(n_pairs), self%obstacle_work(n_pairs))
      call self%clear()
   end function new_period_record

   !> Ready for another period, with the same room.
   pure subroutine clear(self)
      class(period_record), intent(inout) :: self

      self%observed = 0.0_wp
      self%observed_mean = 0.0_wp
      self%force = 0.0_wp
      self%slip = 0.0_wp
      self%share = 0.0_wp
      self%work = 0.0_wp
      self%obstacle_work = 0.0_wp
      self%n_taken = 0
      self%n_failed = 0
   end subroutine clear

   !> Fourier coefficients (0, c1, s1, ..) (2H+1) of samples at tau_k = 2 pi k/n, k = 0..n-1: the
   !> trapezoidal rule, exact below half of n harmonics.
   pure function sampled_coefficients(samples, n_harmonics) result(coefficients)
      !> (n_steps), n_steps > 2 n_harmonics.
      real(wp), intent(in) :: samples(:)
      integer, intent(in) :: n_harmonics
      real(wp) :: coefficients(2*n_harmonics + 1)

      coefficients = shifted_coefficients(samples, n_harmonics, 0)
   end function sampled_coefficients

   !> The same of means over the steps k..k+1 by the implicit midpoint rule, where the mean of a
   !> harmonic n is cos(n pi/n_steps) times its value in the middle.
   pure function averaged_coefficients(means, n_harmonics) result(coefficients)
      !> Means over the steps (n_steps).
      real(wp), intent(in) :: means(:)
      integer, intent(in) :: n_harmonics
      real(wp) :: coefficients(2*n_harmonics + 1)
      integer :: n

      coefficients = shifted_coefficients(means, n_harmonics, 1)
      do n = 1, n_harmonics
         ! The mean of two ends is less than the wave in the middle by that factor.
         coefficients(2*n:2*n + 1) = coefficients(2*n:2*n + 1)/cos(n*pi/size(means))
      end do
   end function averaged_coefficients

   !> Angles are reduced in integers, in units of half a step.
   pure function shifted_coefficients(samples, n_harmonics, half_steps) result(coefficients)
      !> Values so many half steps behind the instants (n_steps).
      real(wp), intent(in) :: samples(:)
      integer, intent(in) :: n_harmonics, half_steps
      real(wp) :: coefficients(2*n_harmonics + 1)
      real(wp) :: angle
      integer :: k, n, n_steps

      n_steps = size(samples)
      coefficients(1) = sum(samples)/real(n_steps, wp)
      coefficients(2:) = 0.0_wp
      do k = 1, n_steps
         do n = 1, n_harmonics
            ! In integers, because n tau_k loses digits for many steps and high harmonics.
            angle = pi*real(modulo(n*(2*(k - 1) + half_steps), 2*n_steps), wp)/real(n_steps, wp)
            coefficients(2*n) = coefficients(2*n) + samples(k)*cos(angle)
            coefficients(2*n + 1) = coefficients(2*n + 1) + samples(k)*sin(angle)
         end do
      end do
      coefficients(2:) = coefficients(2:)*2.0_wp/real(n_steps, wp)
   end function shifted_coefficients

   !> Largest magnitude over a periodic list of samples, between them by a parabola.
   pure real(wp) function largest_sample(samples) result(largest)
      real(wp), intent(in) :: samples(:)
      real(wp) :: left, mid, right, curvature
      integer :: k, n

      n = size(samples)
      k = maxloc(abs(samples), dim=1)
      mid = samples(k)
      left = samples(modulo(k - 2, n) + 1)
      right = samples(modulo(k, n) + 1)
      curvature = left - 2.0_wp*mid + right
      ! A parabola that opens away from zero has no summit between the samples.
      largest = abs(mid)
      if (curvature*mid >= 0.0_wp) return
      ! Summit of the parabola through the samples at -1, 0 and 1.
      largest = abs(mid - (right - left)**2/(8.0_wp*curvature))
   end function largest_sample

end module fw_period_record
