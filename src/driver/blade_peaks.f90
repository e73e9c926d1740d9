!> The largest amplitude of all blades over a range of frequencies: rows, and where they are asked
!> for the maxima between them.
!>
!> Near a resonance u = R/(i omega - p) the inverse square of an amplitude is a parabola of omega:
!> through three samples around a maximum of a blade it says how high the maximum is, and where.
!> Whichever promises most is solved for, until none promises more than is known.
module fw_blade_peaks
   use fw_error, only: error_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: blade_response, blade_peaks

   !> How a disk answers, whoever solves it.
   type, abstract :: blade_response
      !> Observed quantities of a sector.
      integer :: n_observed = 0
      integer :: n_sectors = 1
      !> A point costs so little that every interval between rows is looked into.
      logical :: is_cheap = .false.
      !> The frequency that is asked for next is one that other disks are asked for too.
      logical :: is_shared = .false.
   contains
      procedure(begin_pattern), deferred :: begin
      procedure(solve_at), deferred :: at
   end type blade_response

   abstract interface
      !> Go to a pattern, from 1; 0: the tuned disk.
      subroutine begin_pattern(self, pattern, error)
         import :: blade_response, error_type
         implicit none (type, external)
         class(blade_response), intent(inout), target :: self
         integer, intent(in) :: pattern
         type(error_type), allocatable, intent(out) :: error
      end subroutine begin_pattern

      !> Amplitudes of all blades at a frequency [rad/s] (n_observed, n_sectors).
      subroutine solve_at(self, omega, amplitude, converged, error)
         import :: blade_response, error_type, wp
         implicit none (type, external)
         class(blade_response), intent(inout), target :: self
         real(wp), intent(in) :: omega
         real(wp), intent(out) :: amplitude(:, :)
         logical, intent(out) :: converged
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_at
   end interface

   type :: blade_peaks
      !> Of each observed quantity: the largest, its sector from 0, its frequency [rad/s]; sector -1
      !> where nothing was solved (n_observed).
      real(wp), allocatable :: amplitude(:), omega(:)
      integer, allocatable :: sector(:)
      !> Points solved, and those of them that converged; maxima that took more than their share.
      integer :: n_solved = 0, n_converged = 0, n_open = 0
      !> By ascending frequency (n), (n_observed, n_sectors, n).
      real(wp), allocatable, private :: at(:), height(:, :, :)
      !> Samples known, and whether the parabola on each was found true (n_observed, n_sectors, n).
      integer, private :: n = 0
      logical, allocatable, private :: is_sure(:, :, :)
   contains
      procedure :: find
   end type blade_peaks

   !> A maximum between three samples of a blade.
   type :: top_type
      !> How high it may be, and the sample that it stands on.
      real(wp) :: bound = 0.0_wp, from = 0.0_wp
      !> Where to solve [rad/s], and how high the blade is to be there.
      real(wp) :: omega = 0.0_wp, there = 0.0_wp
      !> The sample is as high as the maximum, which a solution beside it confirms.
      logical :: is_check = .false.
      !> The sample is at an end of the range.
      logical :: is_end = .false.
   end type top_type

   !> More solutions for one quantity than these are not spent between the rows.
   integer, parameter :: most_solved = 60
   !> Parts of a height that count as none: what is left of it, and what differs beside it, of which
   !> the error of the height is the square.
   real(wp), parameter :: same_height = 1.0e-10_wp, same_slope = 1.0e-7_wp
   !> Samples are no nearer to each other than this part of their frequency.
   real(wp), parameter :: same_place = 1.0e-11_wp
   !> Parts of a gap between samples: where a maximum is confirmed, and how far one is looked for.
   real(wp), parameter :: beside = 0.05_wp, most_of_gap = 0.9_wp
   !> Gaps on both sides of a maximum that differ by more than this ratio.
   real(wp), parameter :: lopsided = 0.1_wp
   !> Intervals between rows are halved so often, where the middle is off the line between the ends
   !> by this part of the highest amplitude: a resonance of 1/40 of the interval stands out so.
   integer, parameter :: most_halvings = 6
   real(wp), parameter :: off_line = 0.05_wp
   !> A maximum may be higher than its parabola says by these parts of what it rises above its
   !> sample, and of how far that stands above the lower one beside it.
   real(wp), parameter :: doubt_of_rise = 2.0_wp, doubt_of_fall = 0.1_wp
   !> The same of an end of the range.
   real(wp), parameter :: doubt_of_end = 0.2_wp
   !> Heights that a parabola tells, in parts of the sample.
   real(wp), parameter :: endless = 1.0e3_wp

contains

   !> Rows in their order, then maxima between them.
   subroutine find(self, response, rows, looks_between, error)
      class(blade_peaks), intent(inout) :: self
      !> At its pattern.
      class(blade_response), intent(inout), target :: response
      !> [rad/s]
      real(wp), intent(in) :: rows(:)
      !> Whether maxima between rows count.
      logical, intent(in) :: looks_between
      type(error_type), allocatable, intent(out) :: error
      integer :: i, k

      i = size(rows)
      if (response%is_cheap) i = 2**most_halvings*i
      call reserve(self, response, i + most_solved*response%n_observed)
      response%is_shared = .true.
      do i = 1, size(rows)
         call sample(self, response, rows(i), k, error)
         if (allocated(error)) return
      end do
      if (looks_between .and. response%is_cheap) call look_into_all(self, response, error)
      if (allocated(error)) return
      response%is_shared = .false.
      do i = 1, response%n_observed
         if (.not. looks_between) exit
         call climb(self, response, i, error)
         if (allocated(error)) return
      end do
      self%sector = -1
      self%amplitude = 0.0_wp
      self%omega = 0.0_wp
      do i = 1, response%n_observed
         call take_largest(self, i)
      end do
   end subroutine find

   !> Nothing is known, with room for n samples.
   subroutine reserve(self, response, n)
      class(blade_peaks), intent(inout) :: self
      class(blade_response), intent(in) :: response
      integer, intent(in) :: n

      self%n = 0
      self%n_solved = 0
      self%n_converged = 0
      self%n_open = 0
      if (allocated(self%at)) then
         if (size(self%at) >= n .and. size(self%amplitude) == response%n_observed) return
         deallocate (self%at, self%height, self%is_sure, self%amplitude, self%omega, self%sector)
      end if
      associate (m => response%n_observed, sectors => response%n_sectors)
         allocate (self%at(n), self%height(m, sectors, n), self%is_sure(m, sectors, n))
         allocate (self%amplitude(m), self%omega(m), self%sector(m))
      end associate
   end subroutine reserve

   !> Solve at a frequency, and put what is found in its place among the others.
   subroutine sample(self, response, omega, place, error)
      class(blade_peaks), intent(inout) :: self
      class(blade_response), intent(inout), target :: response
      real(wp), intent(in) :: omega
      !> 0 where it did not converge, or is known.
      integer, intent(out) :: place
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: found(response%n_observed, response%n_sectors)
      logical :: converged
      integer :: k

      place = 0
      call response%at(omega, found, converged, error)
      if (allocated(error)) return
      self%n_solved = self%n_solved + 1
      if (.not. converged) return
      self%n_converged = self%n_converged + 1
      k = count(self%at(:self%n) < omega) + 1
      if (k <= self%n) then
         if (.not. self%at(k) > omega) return
      end if
      self%at(k + 1:self%n + 1) = self%at(k:self%n)
      self%height(:, :, k + 1:self%n + 1) = self%height(:, :, k:self%n)
      self%is_sure(:, :, k + 1:self%n + 1) = self%is_sure(:, :, k:self%n)
      self%n = self%n + 1
      self%at(k) = omega
      self%height(:, :, k) = found
      self%is_sure(:, :, k) = .false.
      place = k
   end subroutine sample

   !> Divide intervals until the line between their ends tells what is in the middle.
   subroutine look_into_all(self, response, error)
      class(blade_peaks), intent(inout) :: self
      class(blade_response), intent(inout), target :: response
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: rows(self%n)
      integer :: k

      rows = self%at(:self%n)
      do k = 1, size(rows) - 1
         call divide(self, response, rows(k:k + 1), 1, error)
         if (allocated(error)) return
      end do
   end subroutine look_into_all

   !> One interval, and its halves where they differ from the line.
   recursive subroutine divide(self, response, ends, halving, error)
      class(blade_peaks), intent(inout) :: self
      class(blade_response), intent(inout), target :: response
      !> Samples next to each other [rad/s].
      real(wp), intent(in) :: ends(2)
      integer, intent(in) :: halving
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: highest, middle, off
      integer :: i, k

      middle = 0.5_wp*(ends(1) + ends(2))
      call sample(self, response, middle, k, error)
      if (allocated(error) .or. k < 2 .or. k >= self%n) return
      off = 0.0_wp
      do i = 1, response%n_observed
         highest = maxval(self%height(i, :, :self%n))
         if (highest <= 0.0_wp) cycle
         off = max(off, maxval(abs(self%height(i, :, k) - 0.5_wp*( &
                                   self%height(i, :, k - 1) + self%height(i, :, k + 1))))/highest)
      end do
      if (off <= off_line .or. halving == most_halvings) return
      call divide(self, response, [ends(1), middle], halving + 1, error)
      if (.not. allocated(error)) call divide(self, response, [middle, ends(2)], halving + 1, error)
   end subroutine divide

   !> Solve where a maximum of a quantity may be the highest.
   subroutine climb(self, response, i, error)
      class(blade_peaks), intent(inout) :: self
      class(blade_response), intent(inout), target :: response
      integer, intent(in) :: i
      type(error_type), allocatable, intent(out) :: error
      type(top_type) :: top
      integer :: j, k, step

      do step = 1, most_solved
         call find_promise(self, i, j, top)
         if (j == 0) return
         call sample(self, response, top%omega, k, error)
         if (allocated(error)) return
         if (k == 0) exit
         if (top%is_end) then
            ! Lower inside: the end is the place.
            if (k == 2) self%is_sure(i, j, 1) = self%height(i, j, 2) <= self%height(i, j, 1)
            if (k == self%n - 1) self%is_sure(i, j, self%n) = &
               self%height(i, j, k) <= self%height(i, j, self%n)
         end if
         if (.not. top%is_check) cycle
         ! The sample beside it is the middle one where it stands higher.
         if (abs(self%height(i, j, k) - top%there) > same_slope*top%there) cycle
         k = k + merge(-1, 1, self%at(k) > top%from)
         self%is_sure(i, j, k) = .true.
      end do
      self%n_open = self%n_open + 1
   end subroutine climb

   !> The blade whose maximum may be highest, above what is known; 0 where there is none.
   subroutine find_promise(self, i, sector, top)
      class(blade_peaks), intent(in) :: self
      !> Which quantity.
      integer, intent(in) :: i
      integer, intent(out) :: sector
      type(top_type), intent(out) :: top
      type(top_type) :: candidate
      real(wp) :: h(3), known
      integer :: j, k

      sector = 0
      if (self%n < 3) return
      known = maxval(self%height(i, :, :self%n))
      top%bound = known
      call look_at_end(self, i, 1, 2, known, sector, top)
      call look_at_end(self, i, self%n, self%n - 1, known, sector, top)
      do k = 2, self%n - 1
         if (self%at(k + 1) - self%at(k - 1) <= 4.0_wp*same_place*self%at(k)) cycle
         do j = 1, size(self%height, 2)
            h = self%height(i, j, k - 1:k + 1)
            if (self%is_sure(i, j, k) .or. h(2) < h(1) .or. h(2) < h(3)) cycle
            if (.not. (h(2) > h(1) .or. h(2) > h(3))) cycle
            call find_top(self%at(k - 1:k + 1), h, candidate)
            if (candidate%bound <= top%bound) cycle
            top = candidate
            sector = j
         end do
      end do
   end subroutine find_promise

   !> A blade that is highest at the end of the range may rise right inside.
   subroutine look_at_end(self, i, last, before, known, sector, top)
      class(blade_peaks), intent(in) :: self
      !> Which quantity; the sample at the end, and its neighbour.
      integer, intent(in) :: i, last, before
      real(wp), intent(in) :: known
      integer, intent(inout) :: sector
      type(top_type), intent(inout) :: top
      real(wp) :: bound, gap
      integer :: j

      gap = self%at(before) - self%at(last)
      if (abs(gap) <= 4.0_wp*same_place*self%at(last)/beside) return
      do j = 1, size(self%height, 2)
         associate (h => self%height(i, j, last))
            if (self%is_sure(i, j, last) .or. h <= self%height(i, j, before)) cycle
            bound = h*(1.0_wp + doubt_of_end)
            if (bound <= top%bound .or. bound <= known) cycle
            top = top_type(bound=bound, from=self%at(last), omega=self%at(last) + beside*gap, &
                           there=h, is_end=.true.)
            sector = j
         end associate
      end do
   end subroutine look_at_end

   !> The top of the parabola through 1/h**2, and where to solve for it.
   pure subroutine find_top(x, h, top)
      !> Ascending, and heights of which the middle one is the highest.
      real(wp), intent(in) :: x(3), h(3)
      type(top_type), intent(out) :: top
      real(wp) :: bend, g(3), gap(2), reach, rise, slope(2), step

      gap = [x(2) - x(1), x(3) - x(2)]
      g = 1.0_wp/max(h/h(2), 1.0_wp/endless)**2
      slope = [(g(2) - g(1))/gap(1), (g(3) - g(2))/gap(2)]
      bend = (slope(2) - slope(1))/(x(3) - x(1))
      ! From now on the slope in the middle.
      slope(1) = slope(1) + bend*gap(1)
      step = min(max(-0.5_wp*slope(1)/bend, -most_of_gap*gap(1)), most_of_gap*gap(2))
      rise = h(2)*(height_at(step) - 1.0_wp)
      top%bound = h(2) + (1.0_wp + doubt_of_rise)*rise + doubt_of_fall*(h(2) - minval(h))
      top%from = x(2)
      top%is_check = rise <= same_height*h(2) .or. abs(step) <= 2.0_wp*same_place*x(2)
      ! A sample far away bends the parabola: the wider gap is divided near the middle.
      reach = 0.0_wp
      if (top%is_check) then
         reach = beside*maxval(gap)
      else if (minval(gap) < lopsided*maxval(gap)) then
         reach = min(4.0_wp*minval(gap), 0.5_wp*maxval(gap))
      end if
      if (reach > 0.0_wp) step = merge(-reach, reach, gap(1) > gap(2))
      top%omega = x(2) + step
      top%there = h(2)*height_at(step)

   contains

      !> In parts of the middle one.
      pure real(wp) function height_at(way)
         real(wp), intent(in) :: way

         height_at = 1.0_wp/sqrt(max(1.0_wp + way*(slope(1) + bend*way), endless**(-2)))
      end function height_at

   end subroutine find_top

   !> What counts of a quantity.
   pure subroutine take_largest(self, i)
      class(blade_peaks), intent(inout) :: self
      integer, intent(in) :: i
      integer :: at(2)

      if (self%n == 0) return
      at = maxloc(self%height(i, :, :self%n))
      self%sector(i) = at(1) - 1
      self%amplitude(i) = self%height(i, at(1), at(2))
      self%omega(i) = self%at(at(2))
   end subroutine take_largest

end module fw_blade_peaks
