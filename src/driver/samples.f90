!> Points of a curve in the order of their frequencies, and what three of them say of a peak.
!>
!> Near a resonance that one mode dominates, 1/A**2 is a parabola in omega**2, far beyond the width
!> of the peak: peaks are looked for, and widths are read, in these variables.
module fw_samples
   use fw_kinds, only: pi, wp
   use fw_point, only: point_type
   use fw_strategy, only: solver_memory
   implicit none (type, external)
   private

   public :: sample_type, sample_list, new_sample, phase_step, vertex_of, balance_point
   public :: swing_of, position_of

   type :: sample_type
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      !> Largest magnitude over the period, magnitude and phase of the first harmonic (n_observed).
      real(wp), allocatable :: amplitude(:), first(:), phase(:)
      !> Magnitude of the mean over the period (n_observed).
      real(wp), allocatable :: mean(:)
      !> Observed coefficients (2H+1, n_observed), and from where to go on; only where a peak may be
      !> near.
      real(wp), allocatable :: coefficients(:, :)
      type(solver_memory) :: memory
      !> Row of the result (0: none, found by the search).
      integer :: row = 0
      !> Searches next to this sample that failed.
      integer :: n_failed = 0
      !> States of the pairs, as shares of the period (stick, slip, open), mean over the pairs;
      !> below 0 where they are not known.
      real(wp) :: fraction(3) = -1.0_wp
      !> A search may start from here.
      logical :: is_needed = .false.
      !> No way was found from a neighbour far above, on another branch, past this sample.
      logical :: is_edge = .false.
   contains
      procedure :: forget
   end type sample_type

   type :: sample_pointer
      type(sample_type), pointer :: at => null()
   end type sample_pointer

   !> Samples by ascending frequency; the list owns them.
   type :: sample_list
      integer :: n = 0
      type(sample_pointer), allocatable :: item(:)
   contains
      procedure :: insert
      procedure :: drop
      procedure :: thin
      procedure :: clear
   end type sample_list

contains

   !> What is kept of a point.
   function new_sample(point) result(sample)
      type(point_type), intent(in) :: point
      type(sample_type) :: sample
      integer :: c

      sample%omega = point%omega
      sample%amplitude = point%amplitude
      sample%coefficients = point%coefficients
      sample%mean = abs(point%coefficients(1, :))
      allocate (sample%first, sample%phase, mold=point%amplitude)
      sample%first = 0.0_wp
      sample%phase = 0.0_wp
      if (size(point%coefficients, 1) >= 3) then
         sample%first = hypot(point%coefficients(2, :), point%coefficients(3, :))
         where (sample%first > 0.0_wp)
            sample%phase = atan2(-point%coefficients(3, :), point%coefficients(2, :))
         end where
      end if
      if (.not. allocated(point%fraction)) return
      if (size(point%fraction, 2) == 0) return
      do c = 1, 3
         sample%fraction(c) = sum(point%fraction(c, :))/size(point%fraction, 2)
      end do
   end function new_sample

   !> Put a sample in its place; of two at one frequency the new one comes last.
   subroutine insert(self, sample, place)
      class(sample_list), intent(inout) :: self
      type(sample_type), intent(in) :: sample
      integer, intent(out) :: place
      integer, parameter :: first_size = 64
      type(sample_pointer), allocatable :: longer(:)
      integer :: i

      if (.not. allocated(self%item)) allocate (self%item(first_size))
      if (self%n == size(self%item)) then
         allocate (longer(2*self%n))
         longer(:self%n) = self%item
         call move_alloc(longer, self%item)
      end if
      place = self%n + 1
      do while (place > 1)
         if (self%item(place - 1)%at%omega <= sample%omega) exit
         place = place - 1
      end do
      do i = self%n, place, -1
         self%item(i + 1) = self%item(i)
      end do
      allocate (self%item(place)%at)
      self%item(place)%at = sample
      self%n = self%n + 1
   end subroutine insert

   !> Forget a sample.
   subroutine drop(self, place)
      class(sample_list), intent(inout) :: self
      integer, intent(in) :: place
      integer :: i

      deallocate (self%item(place)%at)
      do i = place, self%n - 1
         self%item(i) = self%item(i + 1)
      end do
      self%n = self%n - 1
   end subroutine drop

   !> Drop every second sample that no search needs. Those that are left enclose the same maxima:
   !> what lies between them rises or falls all the way.
   subroutine thin(self)
      class(sample_list), intent(inout) :: self
      !> Samples at both ends that stay.
      integer, parameter :: at_ends = 4
      integer :: k, n
      logical :: dropped

      n = 0
      dropped = .false.
      do k = 1, self%n
         dropped = .not. (dropped .or. self%item(k)%at%is_needed .or. k <= at_ends .or. &
                          k > self%n - at_ends)
         if (dropped) then
            deallocate (self%item(k)%at)
         else
            n = n + 1
            self%item(n) = self%item(k)
         end if
      end do
      self%n = n
   end subroutine thin

   !> Drop what only a search needs, unless one may.
   subroutine forget(self)
      class(sample_type), intent(inout) :: self

      if (self%is_needed) return
      if (allocated(self%coefficients)) deallocate (self%coefficients)
      if (allocated(self%memory%x)) deallocate (self%memory%x)
   end subroutine forget

   !> Samples stand behind pointers, so that inserting one moves no solutions.
   subroutine clear(self)
      class(sample_list), intent(inout) :: self
      integer :: i

      do i = 1, self%n
         deallocate (self%item(i)%at)
      end do
      self%n = 0
   end subroutine clear

   !> How far the phase turns from one sample to the next above, in (-pi, pi]; a resonance turns it
   !> back by pi.
   pure real(wp) function phase_step(below, above, i)
      type(sample_type), intent(in) :: below, above
      !> Observed quantity.
      integer, intent(in) :: i

      phase_step = modulo(above%phase(i) - below%phase(i) + pi, 2.0_wp*pi) - pi
   end function phase_step

   !> Where a single undamped mode would have its resonance that makes the first harmonics of two
   !> samples on either side of it [rad/s].
   pure real(wp) function balance_point(below, above, i) result(omega)
      type(sample_type), intent(in) :: below, above
      integer, intent(in) :: i
      real(wp) :: total

      ! Of one undamped mode a (omega_r^2 - omega^2) is its load over its mass, up to a sign the
      ! same for both samples: a_1 (omega_r^2 - omega_1^2) = a_2 (omega_2^2 - omega_r^2).
      total = below%first(i) + above%first(i)
      omega = 0.5_wp*(below%omega + above%omega)
      if (total <= 0.0_wp) return
      omega = sqrt((below%first(i)*below%omega**2 + above%first(i)*above%omega**2)/total)
   end function balance_point

   !> What an amplitude rises above a mean position: a static load moves every sample alike, and
   !> must not make a small vibration look flat. Contact moves samples of large vibration further:
   !> a small one is measured from its own place then, else it would seem to rest.
   pure real(wp) function swing_of(sample, i, mean) result(swing)
      type(sample_type), intent(in) :: sample
      integer, intent(in) :: i
      !> The position [length], the same for samples that are compared.
      real(wp), intent(in) :: mean
      !> Part of an amplitude that is round-off.
      real(wp), parameter :: least = 1.0e-12_wp

      swing = max(sample%amplitude(i) - min(mean, sample%mean(i)), least*sample%amplitude(i))
   end function swing_of

   !> The one position from which three samples are measured: a parabola through them wants the same
   !> for all.
   pure real(wp) function position_of(left, middle, right, i) result(mean)
      type(sample_type), intent(in) :: left, middle, right
      integer, intent(in) :: i

      mean = min(left%mean(i), middle%mean(i), right%mean(i))
   end function position_of

   !> The parabola through three samples of which the middle one is the highest.
   pure subroutine vertex_of(left, middle, right, i, omega, amplitude, curvature)
      type(sample_type), intent(in) :: left, middle, right
      integer, intent(in) :: i
      !> Of the vertex [rad/s], and its rise above the position of the three; the middle where there
      !> is none.
      real(wp), intent(out) :: omega, amplitude
      !> Half of the second derivative of 1/A**2, A above the mean position, by omega**2.
      real(wp), intent(out) :: curvature
      real(wp) :: s(2), g(2), slope, least, swing, mean

      mean = position_of(left, middle, right, i)
      swing = swing_of(middle, i, mean)
      ! Steps from the middle.
      s = [left%omega, right%omega]**2 - middle%omega**2
      g = [swing_of(left, i, mean), swing_of(right, i, mean)]
      omega = middle%omega
      amplitude = swing
      curvature = 0.0_wp
      if (.not. all(abs(s) > 0.0_wp)) return
      ! What hardly moves has no maximum, and the inverse of its square no number.
      if (.not. min(swing, minval(g))**2 > tiny(1.0_wp)) return
      g = 1.0_wp/g**2 - 1.0_wp/swing**2
      curvature = (g(2)/s(2) - g(1)/s(1))/(s(2) - s(1))
      slope = g(1)/s(1) - curvature*s(1)
      if (.not. curvature > 0.0_wp) return
      omega = sqrt(max(middle%omega**2 - 0.5_wp*slope/curvature, left%omega**2))
      least = 1.0_wp/swing**2 - 0.25_wp*slope**2/curvature
      ! Three points far out on the flanks may put the vertex below zero: no height follows.
      amplitude = huge(1.0_wp)
      if (least > 0.0_wp) amplitude = 1.0_wp/sqrt(least)
   end subroutine vertex_of

end module fw_samples
