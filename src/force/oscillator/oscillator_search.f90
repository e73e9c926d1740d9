!> The first root behind an angle of a trigonometric polynomial, or of the sum of one and the
!> velocity of a free oscillator:
!>
!>   f(tau) = p(tau) - level + x'(tau - start).
!>
!> Cells of a uniform grid are certified as in fw_event_roots, with the derivatives of the free part
!> bounded by its energy where a cell begins; cells without a certificate are halved.
module fw_oscillator_search
   use fw_event_polynomial, only: value_and_slope
   use fw_event_roots, only: bounds_type, changes_sign, keeps_sign, knot_type, monotone, new_bounds
   use fw_kinds, only: pi, wp
   use fw_oscillator, only: oscillator_type
   implicit none (type, external)
   private

   public :: wave_type, motion_type, first_root

   !> A polynomial with its samples on the grid.
   type :: wave_type
      integer :: degree = 0, n_grid = 0
      !> (0:degree, cosine and sine).
      real(wp), allocatable :: p(:, :)
      !> Values and slopes at 2 pi k/n_grid, k = 0..n_grid - 1, n_grid > 2 degree.
      real(wp), allocatable :: value(:), slope(:)
      type(bounds_type) :: bounds
   contains
      procedure :: reserve
      procedure :: measure
      procedure :: at
   end type wave_type

   !> What is added to the polynomial.
   type :: motion_type
      !> What is taken off the polynomial: k x of a pair that sticks.
      real(wp) :: level = 0.0_wp
      !> Where there is a free part: X at `start`.
      logical :: is_free = .false.
      real(wp) :: start = 0.0_wp, x(2) = 0.0_wp
      type(oscillator_type) :: oscillator
   end type motion_type

   type, extends(knot_type) :: free_knot
      !> The free part there.
      real(wp) :: x(2) = 0.0_wp
   end type free_knot

   ! Deeper than in fw_event_roots: a free part may change by orders within a cell.
   integer, parameter :: max_depth = 40, newton_steps = 60
   !> Relative accuracy of an angle.
   real(wp), parameter :: angle_tolerance = 4.0e-16_wp

contains

   !> Room for a wave and its values on the grid that isolates its roots.
   pure subroutine reserve(self, degree, n_grid)
      class(wave_type), intent(inout) :: self
      integer, intent(in) :: degree, n_grid

      self%degree = degree
      self%n_grid = n_grid
      allocate (self%p(0:degree, 2), self%value(n_grid), self%slope(n_grid), source=0.0_wp)
   end subroutine reserve

   !> Bounds, once polynomial and samples are there.
   pure subroutine measure(self)
      class(wave_type), intent(inout) :: self

      self%bounds = new_bounds(self%n_grid, self%degree, self%p, self%value, sum(abs(self%p)))
   end subroutine measure

   !> Value and slope of the wave alone, without a free motion.
   pure subroutine at(self, angle, value, slope)
      class(wave_type), intent(in) :: self
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: value, slope

      call value_and_slope(self%degree, self%p, angle, value, slope)
   end subroutine at

   !> The first angle in [from, to] at which side f falls below zero; `from` itself where it is
   !> clearly below zero there.
   pure subroutine first_root(wave, motion, from, to, side, found, root)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: from, to, side
      logical, intent(out) :: found
      real(wp), intent(out) :: root
      type(free_knot) :: left, right
      real(wp) :: width
      integer :: k

      found = .false.
      root = to
      if (from >= to) return
      width = 2.0_wp*pi/real(wave%n_grid, wp)
      k = int(from/width)
      call look(wave, motion, from, right)
      ! What is round-off below zero has just begun to rise.
      if (side*right%value < -wave%bounds%noise) then
         found = .true.
         root = from
         return
      end if
      do while (right%angle < to)
         ! Nodes of the grid, of which the polynomial is known, and the two ends of the range.
         left = right
         k = k + 1
         if (width*real(k, wp) <= left%angle) cycle
         if (width*real(k, wp) < to) then
            call take_node(wave, motion, k, right)
         else
            call look(wave, motion, to, right)
         end if
         call search_cell(wave, motion, left, right, side, found, root)
         if (found) return
      end do
   end subroutine first_root

   !> f at any angle.
   pure subroutine look(wave, motion, angle, knot)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: angle
      type(free_knot), intent(out) :: knot

      call wave%at(angle, knot%value, knot%slope)
      knot%angle = angle
      call add_motion(motion, knot)
   end subroutine look

   !> f at a node of the grid.
   pure subroutine take_node(wave, motion, k, knot)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      integer, intent(in) :: k
      type(free_knot), intent(out) :: knot
      integer :: j

      j = modulo(k, wave%n_grid) + 1
      knot%angle = 2.0_wp*pi/real(wave%n_grid, wp)*real(k, wp)
      knot%value = wave%value(j)
      knot%slope = wave%slope(j)
      call add_motion(motion, knot)
   end subroutine take_node

   !> What the free motion adds at a knot: the grid knows the wave alone, for the oscillation
   !> starts anew with every event.
   pure subroutine add_motion(motion, knot)
      type(motion_type), intent(in) :: motion
      type(free_knot), intent(inout) :: knot
      real(wp) :: phi(2, 2)

      knot%value = knot%value - motion%level
      if (.not. motion%is_free) return
      associate (o => motion%oscillator)
         call o%propagate(knot%angle - motion%start, phi)
         knot%x(1) = phi(1, 1)*motion%x(1) + phi(1, 2)*motion%x(2)
         knot%x(2) = phi(2, 1)*motion%x(1) + phi(2, 2)*motion%x(2)
         knot%value = knot%value + knot%x(2)
         ! x'' = -(k x + c x')/m of a motion without load.
         knot%slope = knot%slope - (o%k*knot%x(1) + o%c*knot%x(2))/o%m
      end associate
   end subroutine add_motion

   !> Bounds that hold from a knot on.
   !> The energy of the free part never grows, hence bounds at the left end serve the whole cell.
   pure type(bounds_type) function bounds_from(wave, motion, knot) result(bounds)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      type(free_knot), intent(in) :: knot
      real(wp) :: third, fourth

      bounds = wave%bounds
      if (.not. motion%is_free) return
      call motion%oscillator%bound(knot%x, third, fourth)
      bounds%third = bounds%third + third
      bounds%fourth = bounds%fourth + fourth
   end function bounds_from

   !> The first change of sign in a cell at whose left end side f is not below zero.
   pure subroutine search_cell(wave, motion, left, right, side, found, root)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      type(free_knot), intent(in) :: left, right
      real(wp), intent(in) :: side
      logical, intent(out) :: found
      real(wp), intent(out) :: root
      type(free_knot) :: first, second, waiting(max_depth)
      type(bounds_type) :: bounds
      integer :: level(max_depth), n_waiting
      logical :: last, changes

      found = .false.
      root = right%angle
      ! Parts of the cell wait on a stack, the leftmost on top: the root found first is the first.
      first = left
      n_waiting = 1
      waiting(1) = right
      level(1) = 1
      do while (n_waiting > 0)
         second = waiting(n_waiting)
         ! Anew for each part: the free part has decayed meanwhile.
         bounds = bounds_from(wave, motion, first)
         last = level(n_waiting) >= max_depth .or. &
                second%angle - first%angle <= angle_tolerance*(1.0_wp + second%angle)
         changes = side*second%value < 0.0_wp
         if (monotone(first%knot_type, second%knot_type, bounds) .or. last) then
            if (changes) then
               found = .true.
               root = root_between(wave, motion, first, second, side)
               return
            end if
         else if (changes .or. changes_sign(first%knot_type, second%knot_type) .or. &
                  .not. keeps_sign(first%knot_type, second%knot_type, bounds)) then
            level(n_waiting) = level(n_waiting) + 1
            n_waiting = n_waiting + 1
            level(n_waiting) = level(n_waiting - 1)
            call look(wave, motion, 0.5_wp*(first%angle + second%angle), waiting(n_waiting))
            cycle
         end if
         first = second
         n_waiting = n_waiting - 1
      end do
   end subroutine search_cell

   !> Newton's method kept within the bracket by halving.
   pure real(wp) function root_between(wave, motion, left, right, side) result(angle)
      type(wave_type), intent(in) :: wave
      type(motion_type), intent(in) :: motion
      type(free_knot), intent(in) :: left, right
      real(wp), intent(in) :: side
      type(free_knot) :: knot
      real(wp) :: low, high, step, trial
      integer :: k

      ! `left` is where side f is not negative.
      low = left%angle
      high = right%angle
      angle = low
      ! f is round-off there already.
      if (side*left%value <= 0.0_wp) return
      ! Where the chord is zero.
      angle = low + (high - low)*(left%value/(left%value - right%value))
      do k = 1, newton_steps
         call look(wave, motion, angle, knot)
         if (side*knot%value < 0.0_wp) then
            high = angle
         else
            low = angle
         end if
         trial = 0.5_wp*(low + high)
         if (abs(knot%slope) > 0.0_wp) then
            step = -knot%value/knot%slope
            if (angle + step >= low .and. angle + step <= high) trial = angle + step
         end if
         step = trial - angle
         angle = trial
         if (abs(step) <= angle_tolerance*(1.0_wp + angle)) return
      end do
   end function root_between

end module fw_oscillator_search
