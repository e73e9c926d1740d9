!> Analysis 'campbell': natural frequencies over the rotation speed, the speeds at which engine
!> orders meet them, and the maximum of the response along the order near each crossing.
!>
!> An engine order e excites the nodal diameter k = e modulo N, folded to (-N/2, N/2], with the
!> frequency abs(e) Omega in the rotating frame. Each order is a case of its own, a sweep whose
!> speed follows the frequency along that order; the frequencies come from its matrices too.
module fw_run_campbell
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
   use fw_analysis, only: analysis, run_type
   use fw_body, only: body_type
   use fw_campbell_group, only: campbell_group
   use fw_scalar_search, only: find_largest, find_root, function_of_one
   use fw_case, only: case_type
   use fw_changed_case, only: read_changed
   use fw_error, only: error_type, status_stopped
   use fw_frequency_response, only: new_strategy
   use fw_kinds, only: wp
   use fw_modes, only: mode_type
   use fw_natural_modes, only: find_natural_modes, natural_modes
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_sector_modes, only: find_sector_modes
   use fw_strategy, only: new_request, point_strategy
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: campbell_analysis

   !> A mode that an order meets.
   type :: crossing_type
      !> Which of the orders, and the mode of its nodal diameter.
      integer :: line = 0, mode = 0
      !> Rotation speed, and that of the same mode without contact, where it has one.
      real(wp) :: speed = 0.0_wp, open_speed = 0.0_wp
      real(wp) :: damping_ratio = 0.0_wp
   end type crossing_type

   !> The case along one engine order.
   type :: line_type
      integer :: order = 0, nodal_diameter = 0
      class(case_type), allocatable :: case
   contains
      procedure :: turn
   end type line_type

   !> How far a mode of the nodal diameter of an order lies above the order, over the speed.
   type, extends(function_of_one) :: distance_type
      type(line_type), pointer :: line => null()
      integer :: mode = 0
      logical :: closed = .false.
   contains
      procedure :: at => distance_at
   end type distance_type

   !> The first harmonic along an order, over the frequency: below 0 where it could not be solved.
   type, extends(function_of_one) :: height_type
      type(line_type), pointer :: line => null()
      class(point_strategy), pointer :: strategy => null()
      class(observer_type), pointer :: observer => null()
      !> Of all observed quantities, at the last frequency.
      real(wp), allocatable :: amplitude(:)
      integer :: n_failed = 0, n_solved = 0
   contains
      procedure :: at => height_at
   end type height_type

   type, extends(analysis) :: campbell_analysis
      type(line_type), allocatable, private :: line(:)
      type(crossing_type), allocatable, private :: crossing(:)
      !> Frequencies of peaks that could not be solved, of how many.
      integer, private :: n_failed = 0, n_solved = 0
   contains
      procedure :: start
      procedure :: check
   end type campbell_analysis

   !> A window reaches so many half-widths to both sides of its crossings.
   real(wp), parameter :: half_widths = 4.0_wp
   !> Half-widths of a mode without damping, in parts of its frequency: a window needs some.
   real(wp), parameter :: least_ratio = 1.0e-6_wp
   !> The mode of a crossing is looked for within this part of its frequency.
   real(wp), parameter :: near = 1.0e-3_wp

contains

   !> All at once: there are no rows of points.
   subroutine start(self, case, run, error)
      class(campbell_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(campbell_group) :: group

      call read_lines(self, case, error)
      if (.not. allocated(error)) call find_frequencies(self, case, group, error)
      if (.not. allocated(error)) call find_crossings(self, case, group, error)
      if (allocated(error)) return
      call describe_crossings(self, group)
      if (case%campbell%peaks) then
         call find_peaks(self, case, run, group, error)
         ! What was found by then is a result.
         call run%forgive_stop(error)
         if (allocated(error)) return
      end if
      call run%writer%add(group, error)
      if (allocated(error)) return
      if (self%n_failed > 0) call run%tell('campbell points', to_text(self%n_failed)//' of '// &
         to_text(self%n_solved)//' points near crossings could not be solved: a peak may be missed')
      call make_table(self, group, run%table)
   end subroutine start

   !> All orders, without a solution.
   subroutine check(self, case, error)
      class(campbell_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call read_lines(self, case, error)
   end subroutine check

   !> The case of each order, its speed tied to its frequency.
   subroutine read_lines(self, case, error)
      class(campbell_analysis), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: changes(:)
      real(wp) :: ends(2)
      integer :: i, n

      n = max(1, case%model%cyclic%n_sectors)
      allocate (self%line(size(case%campbell%orders)))
      do i = 1, size(self%line)
         associate (line => self%line(i), e => case%campbell%orders(i))
            line%order = e
            line%nodal_diameter = modulo(e, n)
            if (2*line%nodal_diameter > n) line%nodal_diameter = line%nodal_diameter - n
            ends = abs(e)*[case%campbell%start, case%campbell%end]
            ends(1) = max(ends(1), near*ends(2))
            allocate (changes(0))
            call append(changes, "case%analysis='frf'")
            if (case%model%cyclic%has_sectors()) call append(changes, 'cyclic%engine_order='// &
                                                             to_text(e))
            call append(changes, "sweep%unit='rad/s'")
            call append(changes, 'sweep%start='//trim(full_number(ends(1))))
            call append(changes, 'sweep%end='//trim(full_number(ends(2))))
            call append(changes, 'sweep%n_points='//to_text(case%campbell%n_points))
            if (case%model%turns) call append(changes, 'sweep%speed_order='//to_text(abs(e)))
            call append(changes, 'load%harmonic_scale='//trim(full_number( &
                        case%model%harmonic_scale*case%campbell%scale_of(i))))
            allocate (line%case)
            call read_changed(case, changes, 'engine order '//to_text(e), line%case, error)
            if (allocated(error)) return
            deallocate (changes)
         end associate
      end do
   end subroutine read_lines

   !> All digits, in a text of fixed length: texts of others stand in static memory.
   pure function full_number(value) result(text)
      real(wp), intent(in) :: value
      character(32) :: text

      write (text, '(es24.16e3)') value
      text = adjustl(text)
   end function full_number

   !> What vibrates at a rotation speed [rad/s].
   subroutine turn(self, speed, body)
      class(line_type), intent(in) :: self
      real(wp), intent(in) :: speed
      type(body_type), intent(out) :: body

      call self%case%stand_at(abs(self%order)*speed, body)
   end subroutine turn

   !> Of all nodal diameters at all speeds.
   subroutine find_frequencies(self, case, group, error)
      class(campbell_analysis), intent(in) :: self
      type(case_type), intent(in) :: case
      !> Speeds, nodal diameters and frequencies go there.
      type(campbell_group), intent(inout) :: group
      type(error_type), allocatable, intent(out) :: error
      type(natural_modes) :: modes
      type(body_type) :: body
      integer :: i, n_modes

      associate (options => case%campbell)
         group%speed = options%start + (options%end - options%start)* &
                       [(real(i, wp)/(options%n_speeds - 1), i=0, options%n_speeds - 1)]
         n_modes = min(case%model%cyclic%n_modes, case%model%n_dof)
         do i = 1, options%n_speeds
            call self%line(1)%turn(group%speed(i), body)
            ! Without speed nothing whirls, and a nodal diameter stands for both ways.
            if (i == 1) group%nodal_diameter = diameters_of(self, group%speed(options%n_speeds))
            call find_natural_modes(body, n_modes, modes, error, &
                                    merge(group%nodal_diameter, abs(group%nodal_diameter), &
                                          body%model%cyclic%splits_waves()))
            if (allocated(error)) return
            if (i == 1) allocate (group%open(n_modes, size(group%nodal_diameter), &
                                             options%n_speeds))
            if (i == 1) allocate (group%closed, mold=group%open)
            group%open(:, :, i) = modes%open
            group%closed(:, :, i) = modes%closed
         end do
      end associate
   end subroutine find_frequencies

   !> Nodal diameters that differ at a speed.
   function diameters_of(self, speed) result(list)
      class(campbell_analysis), intent(in) :: self
      !> [rad/s]
      real(wp), intent(in) :: speed
      integer, allocatable :: list(:)
      type(body_type) :: body
      integer :: k

      call self%line(1)%turn(speed, body)
      associate (cyclic => body%model%cyclic)
         if (cyclic%splits_waves()) then
            list = [(k, k=-(cyclic%n_sectors - 1)/2, cyclic%n_sectors/2)]
         else
            list = [(k, k=0, cyclic%n_sectors/2)]
         end if
         list = pack(list, [(cyclic%holds(abs(list(k))), k=1, size(list))])
      end associate
   end function diameters_of

   !> Speeds at which an order meets a mode, pairs closed: signs of the difference change between
   !> neighbouring speeds.
   subroutine find_crossings(self, case, group, error)
      class(campbell_analysis), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> With the frequencies of all speeds.
      type(campbell_group), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      type(crossing_type), allocatable :: found(:)
      real(wp), allocatable :: speeds(:)
      integer :: i, j, m

      allocate (self%crossing(0))
      do i = 1, size(self%line)
         do m = 1, size(group%closed, 1)
            call find_roots(self%line(i), m, group, .true., speeds, error)
            if (allocated(error)) return
            allocate (found(size(speeds)))
            do j = 1, size(speeds)
               found(j) = crossing_type(line=i, mode=m, speed=speeds(j), open_speed=speeds(j))
               call find_damping(self%line(i), found(j))
            end do
            if (case%contact%n_pairs > 0 .and. size(found) > 0) then
               call find_roots(self%line(i), m, group, .false., speeds, error)
               if (allocated(error)) return
               ! Below the lowest speed if there is none.
               if (size(speeds) == 0) speeds = [group%speed(1)]
               do j = 1, size(found)
                  found(j)%open_speed = speeds(minloc(abs(speeds - found(j)%speed), dim=1))
               end do
            end if
            self%crossing = [self%crossing, found]
            deallocate (found)
         end do
      end do
   end subroutine find_crossings

   !> Where a mode of the nodal diameter of an order has its frequency.
   subroutine find_roots(line, mode, group, closed, speeds, error)
      !> The order whose nodal diameter is looked at.
      type(line_type), intent(in), target :: line
      !> Of that nodal diameter, from 1.
      integer, intent(in) :: mode
      type(campbell_group), intent(in) :: group
      !> Whether the pairs hold, or are left out.
      logical, intent(in) :: closed
      !> Ascending; none where nothing is met [rad/s].
      real(wp), allocatable, intent(out) :: speeds(:)
      type(error_type), allocatable, intent(out) :: error
      type(distance_type) :: distance
      real(wp), allocatable :: difference(:)
      real(wp) :: speed, value
      integer :: i, place

      allocate (speeds(0))
      place = findloc(group%nodal_diameter, line%nodal_diameter, dim=1)
      if (place == 0) place = findloc(group%nodal_diameter, abs(line%nodal_diameter), dim=1)
      if (place == 0) return
      if (closed) then
         difference = group%closed(mode, place, :) - abs(line%order)*group%speed
      else
         difference = group%open(mode, place, :) - abs(line%order)*group%speed
      end if
      distance%line => line
      distance%mode = mode
      distance%closed = closed
      do i = 1, size(difference) - 1
         if (ieee_is_nan(difference(i)) .or. ieee_is_nan(difference(i + 1))) cycle
         if (.not. difference(i)*difference(i + 1) <= 0.0_wp) cycle
         ! On the last speed of an interval: it is on the first of the next, if there is one.
         if (.not. abs(difference(i + 1)) > 0.0_wp .and. i < size(difference) - 1) cycle
         call find_root(distance, group%speed(i:i + 1), difference(i:i + 1), speed, error)
         if (.not. allocated(error)) call distance%at(speed, value, error)
         if (allocated(error)) return
         ! Where a mode comes or goes those above it change their numbers, and meet nothing.
         if (abs(value) <= near*abs(line%order)*speed) speeds = [speeds, speed]
      end do
   end subroutine find_roots

   !> Modes are those of the line at that speed.
   subroutine distance_at(self, x, value, error)
      class(distance_type), intent(inout) :: self
      !> Rotation speed [rad/s].
      real(wp), intent(in) :: x
      !> [rad/s]
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(natural_modes) :: modes
      type(body_type) :: body
      integer :: k

      value = 0.0_wp
      call self%line%turn(x, body)
      k = self%line%nodal_diameter
      if (.not. body%model%cyclic%splits_waves()) k = abs(k)
      call find_natural_modes(body, self%mode, modes, error, [k])
      if (allocated(error)) return
      value = -abs(self%line%order)*x
      if (self%closed) then
         value = value + modes%closed(self%mode, 1)
      else
         value = value + modes%open(self%mode, 1)
      end if
   end subroutine distance_at

   !> Of the mode with its pairs closed.
   subroutine find_damping(line, crossing)
      !> The order that meets it.
      type(line_type), intent(in) :: line
      !> Its speed and mode are known.
      type(crossing_type), intent(inout) :: crossing
      type(mode_type), allocatable :: modes(:)
      type(body_type) :: body
      real(wp) :: omega
      integer :: k

      omega = abs(line%order)*crossing%speed
      call line%turn(crossing%speed, body)
      call find_sector_modes(body, 1, 1, omega*[1.0_wp - near, 1.0_wp + near], modes)
      crossing%damping_ratio = ieee_value(1.0_wp, ieee_quiet_nan)
      if (size(modes) == 0) return
      k = minloc(abs(modes%omega - omega), dim=1)
      crossing%damping_ratio = 0.5_wp*modes(k)%width/modes(k)%omega
   end subroutine find_damping

   !> In the order of the orders, then mode, then speed.
   subroutine describe_crossings(self, group)
      class(campbell_analysis), intent(in) :: self
      !> Takes what is known of crossings.
      type(campbell_group), intent(inout) :: group

      associate (c => self%crossing)
         group%order = self%line(c%line)%order
         group%diameter = self%line(c%line)%nodal_diameter
         group%mode = c%mode
         group%crossing_speed = c%speed
         group%crossing_omega = abs(group%order)*c%speed
         group%damping_ratio = c%damping_ratio
      end associate
   end subroutine describe_crossings

   !> The largest first harmonic of the first observed quantity inside of each window.
   subroutine find_peaks(self, case, run, group, error)
      class(campbell_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      !> Takes the peaks, in the order of the crossings.
      type(campbell_group), intent(inout) :: group
      type(error_type), allocatable, intent(out) :: error
      class(point_strategy), allocatable, target :: strategy
      type(height_type) :: height
      integer :: i, line

      associate (n => size(self%crossing))
         allocate (group%peak_omega(n), group%peak_amplitude(case%model%n_observed(), n))
      end associate
      group%peak_omega = ieee_value(1.0_wp, ieee_quiet_nan)
      group%peak_amplitude = ieee_value(1.0_wp, ieee_quiet_nan)
      group%peak_speed = group%peak_omega
      line = 0
      do i = 1, size(self%crossing)
         associate (c => self%crossing(i))
            if (c%line /= line) then
               line = c%line
               if (allocated(strategy)) deallocate (strategy)
               call new_strategy(self%line(line)%case, strategy)
               call strategy%start(self%line(line)%case, error)
               if (allocated(error)) return
               height%line => self%line(line)
               height%strategy => strategy
               height%observer => run%observer
            end if
            call find_peak(c, height, group%peak_omega(i), group%peak_amplitude(:, i), error)
            self%n_solved = height%n_solved
            self%n_failed = height%n_failed
            group%peak_speed(i) = group%peak_omega(i)/abs(self%line(line)%order)
            if (allocated(error)) return
         end associate
      end do
   end subroutine find_peaks

   !> Frequencies across the window, and between the neighbours of the highest one its maximum.
   subroutine find_peak(crossing, height, omega, amplitude, error)
      !> Its window is that of the mode, open and closed.
      type(crossing_type), intent(in) :: crossing
      !> Ready for points along the order.
      type(height_type), intent(inout) :: height
      !> NaN where there is no maximum inside.
      real(wp), intent(inout) :: omega, amplitude(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: at(:), found(:)
      real(wp) :: window(2), width, top
      integer :: i, k, n

      if (size(amplitude) == 0) return
      n = height%line%case%sweep%n_points
      window = abs(height%line%order)*[min(crossing%speed, crossing%open_speed), &
                                       max(crossing%speed, crossing%open_speed)]
      width = max(merge(0.0_wp, crossing%damping_ratio, ieee_is_nan(crossing%damping_ratio)), &
                  least_ratio)*abs(height%line%order)*crossing%speed
      window = window + half_widths*width*[-1.0_wp, 1.0_wp]
      window(1) = max(window(1), near*window(2))
      at = window(1) + (window(2) - window(1))*[(real(i, wp)/(n - 1), i=0, n - 1)]
      allocate (found(n))
      do i = 1, n
         call height%at(at(i), found(i), error)
         if (allocated(error)) return
      end do
      k = maxloc(found, dim=1)
      if (k == 1 .or. k == n .or. .not. found(k) > 0.0_wp) return
      call find_largest(height, at(k - 1:k + 1), found(k), omega, error)
      if (.not. allocated(error)) call height%at(omega, top, error)
      if (.not. allocated(error)) amplitude = height%amplitude
   end subroutine find_peak

   !> From the solutions of the frequencies before.
   subroutine height_at(self, x, value, error)
      class(height_type), intent(inout) :: self
      !> [rad/s]
      real(wp), intent(in) :: x
      !> [length]
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      value = -1.0_wp
      call self%strategy%solve_in_time(self%line%case, new_request(self%line%case, x, &
                                                                   self%observer), point, error)
      if (allocated(error)) return
      self%n_solved = self%n_solved + 1
      if (.not. point%converged) then
         self%n_failed = self%n_failed + 1
         return
      end if
      self%amplitude = norm2(point%coefficients(2:3, :), dim=1)
      value = self%amplitude(1)
   end subroutine height_at

   !> A line for each crossing.
   subroutine make_table(self, group, table)
      class(campbell_analysis), intent(in) :: self
      !> With crossings, and peaks where they were looked for.
      type(campbell_group), intent(in) :: group
      !> For the summary, a head first.
      type(string_type), allocatable, intent(out) :: table(:)
      character(120) :: line
      integer :: i

      allocate (table(0))
      call append(table, '  order  diameter  mode   speed [rad/s]   omega [rad/s]   '// &
                  'damping ratio   peak at         amplitude')
      do i = 1, size(self%crossing)
         write (line, '(i7, i10, i6, 2es16.6, es16.3)') group%order(i), group%diameter(i), &
            group%mode(i), group%crossing_speed(i), group%crossing_omega(i), &
            group%damping_ratio(i)
         if (allocated(group%peak_omega)) then
            if (ieee_is_nan(group%peak_omega(i))) then
               line = trim(line)//'   no maximum'
            else
               write (line(len_trim(line) + 1:), '(es14.6, es16.6)') group%peak_omega(i), &
                  group%peak_amplitude(1, i)
            end if
         end if
         call append(table, trim(line))
      end do
      if (size(self%crossing) == 0) call append(table, '  no order meets a frequency')
   end subroutine make_table

end module fw_run_campbell
