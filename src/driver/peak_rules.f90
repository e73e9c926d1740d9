!> What is known of a maximum from the samples around it: whether it is one, whether it is known
!> well enough, where to look next, and how wide it is.
module fw_peak_rules
   use fw_kinds, only: wp
   use fw_peak, only: found_bound, found_jump, found_row, found_search, found_unresolved, peak_type
   use fw_peak_options, only: limits
   use fw_samples, only: position_of, sample_list, sample_type, swing_of, vertex_of
   implicit none (type, external)
   private

   public :: is_maximum, is_bound, highest_of, place_of_highest
   public :: find_next, find_edge, find_gap, find_way_past, list_peaks

contains

   !> Whether sample k is a maximum of quantity i: the first of the highest among neighbours that
   !> differ by round-off, above what lies next to these on both sides.
   pure logical function is_maximum(samples, k, i)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      real(wp) :: rise

      is_maximum = .false.
      if (k <= 1 .or. k >= samples%n) return
      rise = rise_of(samples, k, i)
      if (place_below(samples, k, i, -1, rise) < 0) return
      if (place_below(samples, k, i, 1, rise) < 0) return
      ! What is level up to an end of the range is highest there.
      is_maximum = is_lower(samples, k, i, -1, rise) .and. is_lower(samples, k, i, 1, rise)
   end function is_maximum

   !> What two amplitudes next to sample k may differ by without a meaning.
   pure real(wp) function rise_of(samples, k, i) result(rise)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i

      associate (at => samples%item(k)%at)
         rise = max(limits%round_off*swing_of(at, i, at%mean(i)), &
                    limits%negligible*maxval(at%amplitude))
      end associate
   end function rise_of

   !> Whether the first sample in a direction that differs from sample k by more than the rise is
   !> lower; false where none differs.
   pure logical function is_lower(samples, k, i, direction, rise)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i, direction
      real(wp), intent(in) :: rise
      real(wp) :: change
      integer :: j

      is_lower = .false.
      j = k + direction
      do while (j >= 1 .and. j <= samples%n)
         change = samples%item(j)%at%amplitude(i) - samples%item(k)%at%amplitude(i)
         if (abs(change) > rise) then
            is_lower = change < 0.0_wp
            return
         end if
         j = j + direction
      end do
   end function is_lower

   !> The first sample from k on in a direction that is lower by more than the rise: 0 where there
   !> is none, below 0 where a higher one comes first.
   pure integer function place_below(samples, k, i, direction, rise) result(place)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i, direction
      real(wp), intent(in) :: rise
      real(wp) :: a, other

      a = samples%item(k)%at%amplitude(i)
      place = k + direction
      do while (place >= 1 .and. place <= samples%n)
         other = samples%item(place)%at%amplitude(i)
         if (other < a - rise) return
         ! Of equal ones the first counts.
         if (other > a .or. other >= a .and. direction < 0) then
            place = -1
            return
         end if
         place = place + direction
      end do
      place = 0
   end function place_below

   !> Where to solve next for the maximum of quantity i at sample k; `done` where it is known.
   pure subroutine find_next(samples, k, i, omega, promise, done)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      !> [rad/s]
      real(wp), intent(out) :: omega
      !> Rise above the mean position that may be found.
      real(wp), intent(out) :: promise
      logical, intent(out) :: done
      real(wp) :: curvature, vertex, share, mean
      logical :: left_is_known, right_is_known, is_high

      share = limits%near
      is_high = samples%item(k)%at%amplitude(i) >= limits%near*highest_of(samples, i)
      if (is_high) share = limits%nearest
      associate (left => samples%item(k - 1)%at, middle => samples%item(k)%at, &
                 right => samples%item(k + 1)%at)
         call vertex_of(left, middle, right, i, vertex, promise, curvature)
         mean = position_of(left, middle, right, i)
         if (is_cut_off(samples, k, i, mean)) share = limits%nearest_cut
         left_is_known = side_is_known(left, middle, right, i, mean, share)
         right_is_known = side_is_known(right, middle, left, i, mean, share)
         ! A side that is not far below is one of the parabola.
         if (min(swing_of(left, i, mean), swing_of(right, i, mean)) < &
             limits%near*swing_of(middle, i, mean) .and. (left_is_known .neqv. right_is_known)) then
            vertex = further(samples, k, i, merge(1, -1, left_is_known), vertex)
         end if
         omega = within(vertex, left%omega, middle%omega, right%omega)
         done = promise <= (1.0_wp + limits%small_gain)*swing_of(middle, i, mean)
         if (.not. done) then
            ! A vertex next to the middle tells nothing where a neighbour is far below.
            done = abs(omega - middle%omega) <= limits%same_frequency*middle%omega
            if (.not. done) return
         end if
         done = left_is_known .and. right_is_known
         if (done) then
            if (is_high) call find_corner(samples, k, i, mean, omega, promise, done)
            return
         end if
         if (right_is_known) then
            omega = beside(left, middle, i, mean, curvature, share)
         else
            omega = beside(right, middle, i, mean, curvature, share)
         end if
         done = abs(omega - middle%omega) <= limits%same_frequency*middle%omega
      end associate
   end subroutine find_next

   !> Where to solve next for a peak that may be a corner, which three samples show as a parabola
   !> that it is not; `done` where five bear out the parabola, or leave no room for a corner that
   !> is higher than the tolerance.
   pure subroutine find_corner(samples, k, i, mean, omega, promise, done)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      !> Position of the three [length].
      real(wp), intent(in) :: mean
      real(wp), intent(inout) :: omega, promise
      logical, intent(out) :: done
      real(wp) :: gain, place, most
      integer :: direction

      most = 0.0_wp
      do direction = -1, 1, 2
         call bound_corner(samples, k, i, direction, mean, place, gain)
         if (gain <= most) cycle
         most = gain
         omega = place
      end do
      done = most <= limits%small_gain .or. misses_parabola(samples, k, i, mean) &
             <= limits%borne_out*limits%small_gain
      if (done) return
      associate (middle => samples%item(k)%at)
         promise = (1.0_wp + most)*swing_of(middle, i, mean)
         done = abs(omega - middle%omega) <= limits%same_frequency*middle%omega
      end associate
   end subroutine find_corner

   !> How much higher than sample k the response may be on one side: up to where the lines through
   !> the two samples before and the two behind meet, if it bends down elsewhere.
   pure subroutine bound_corner(samples, k, i, direction, mean, omega, gain)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i, direction
      real(wp), intent(in) :: mean
      !> [rad/s], and relative to the height.
      real(wp), intent(out) :: omega, gain
      real(wp) :: rise, fall, way, share

      omega = samples%item(k)%at%omega
      gain = 0.0_wp
      associate (before => samples%item(k - direction)%at, middle => samples%item(k)%at, &
                 behind => samples%item(k + direction)%at)
         way = abs(behind%omega - middle%omega)
         if (way <= limits%same_frequency*middle%omega .or. &
             abs(middle%omega - before%omega) <= limits%same_frequency*middle%omega) return
         rise = (middle%amplitude(i) - before%amplitude(i))/abs(middle%omega - before%omega)
         ! Of the part that lies on the line behind, if one is known, and of all else.
         share = 0.5_wp
         gain = rise*way*share
         if (k + 2*direction >= 1 .and. k + 2*direction <= samples%n) then
            associate (last => samples%item(k + 2*direction)%at)
               fall = (behind%amplitude(i) - last%amplitude(i))/ &
                      max(abs(last%omega - behind%omega), tiny(1.0_wp))
            end associate
            if (rise + fall > 0.0_wp) share = ((behind%amplitude(i) - middle%amplitude(i))/way &
                                               + fall)/(rise + fall)
            share = min(max(share, limits%margin), 1.0_wp - limits%margin)
            gain = rise*way*share
         end if
         omega = middle%omega + direction*share*way
         gain = gain/swing_of(middle, i, mean)
      end associate
   end subroutine bound_corner

   !> How much the parabola through a maximum and its neighbours may miss between them, relative to
   !> the height: what the samples beyond say of its third difference.
   pure real(wp) function misses_parabola(samples, k, i, mean) result(missed)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      real(wp), intent(in) :: mean
      real(wp) :: s(4), g(4), third, swing
      integer :: direction, j, side

      missed = 0.0_wp
      swing = swing_of(samples%item(k)%at, i, mean)
      do direction = -1, 1, 2
         if (k + 2*direction < 1 .or. k + 2*direction > samples%n) cycle
         do j = 1, 4
            associate (at => samples%item(k + direction*(j - 2))%at)
               s(j) = at%omega**2 - samples%item(k)%at%omega**2
               g(j) = (swing/swing_of(at, i, mean))**2
            end associate
         end do
         if (abs(s(4) - s(3)) <= limits%same_frequency*samples%item(k)%at%omega**2) cycle
         third = abs(divided_difference(s, g))
         do side = 1, 2
            associate (middle => 0.5_wp*(s(side) + s(side + 1)))
               missed = max(missed, 0.5_wp*third*abs(product(middle - s(:3))))
            end associate
         end do
      end do
   end function misses_parabola

   !> Of third order, of four points.
   pure real(wp) function divided_difference(s, g) result(third)
      real(wp), intent(in) :: s(4), g(4)
      real(wp) :: d(4)
      integer :: order, j

      d = g
      do order = 1, 3
         do j = 4, order + 1, -1
            d(j) = (d(j) - d(j - 1))/(s(j) - s(j - order))
         end do
      end do
      third = d(4)
   end function divided_difference

   !> Whether the response falls behind a neighbour of the peak faster than any resonance does: it
   !> jumps there.
   pure logical function is_cut_off(samples, k, i, mean)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      real(wp), intent(in) :: mean
      integer :: direction

      is_cut_off = .false.
      do direction = -1, 1, 2
         if (k + 2*direction < 1 .or. k + 2*direction > samples%n) cycle
         associate (middle => samples%item(k)%at, side => samples%item(k + direction)%at, &
                    behind => samples%item(k + 2*direction)%at)
            if (swing_of(side, i, mean) < limits%near*swing_of(middle, i, mean)) cycle
            is_cut_off = is_cut_off .or. &
                         swing_of(behind, i, mean) < limits%deep*swing_of(middle, i, mean) .and. &
                         abs(behind%omega - side%omega) <= &
                         limits%as_long*abs(side%omega - middle%omega)
         end associate
      end do
   end function is_cut_off

   !> Whether nothing higher can lie between the middle and a neighbour: it belongs to the peak, or
   !> what rises towards the middle from the other side cannot gain more on the way.
   pure logical function side_is_known(side, middle, other, i, mean, share) &
      result(known)
      type(sample_type), intent(in) :: side, middle, other
      integer, intent(in) :: i
      !> Position of the three [length].
      real(wp), intent(in) :: mean
      !> Of the height, from which on a neighbour belongs to the peak.
      real(wp), intent(in) :: share
      real(wp) :: slope, swing

      swing = swing_of(middle, i, mean)
      known = swing_of(side, i, mean) >= share*swing .or. &
              abs(side%omega - middle%omega) <= limits%same_frequency*middle%omega
      if (known .or. swing_of(other, i, mean) < share*swing) return
      slope = (middle%amplitude(i) - other%amplitude(i))/ &
              max(abs(middle%omega - other%omega), tiny(1.0_wp))
      known = slope*abs(side%omega - middle%omega) <= limits%small_gain*swing
   end function side_is_known

   !> A frequency towards a neighbour that is far below, where the peak would have fallen a little.
   pure real(wp) function beside(side, middle, i, mean, curvature, share) result(omega)
      type(sample_type), intent(in) :: side, middle
      integer, intent(in) :: i
      real(wp), intent(in) :: mean, curvature
      !> What a neighbour should have of the height, at least.
      real(wp), intent(in) :: share
      real(wp) :: distance, half, rise

      rise = limits%inside*(1.0_wp/share**2 - 1.0_wp)
      half = 0.5_wp*abs(side%omega - middle%omega)
      distance = half
      if (curvature > 0.0_wp) then
         distance = sqrt(rise/curvature)/swing_of(middle, i, mean) &
                    /(2.0_wp*middle%omega)
      end if
      distance = min(max(distance, 2.0_wp*limits%margin*half), half)
      omega = middle%omega + sign(distance, side%omega - middle%omega)
   end function beside

   !> The vertex, or where the near side of the peak leads if that is further: behind an edge where
   !> the response jumps, the far side stands on another branch and tells nothing of the peak.
   pure real(wp) function further(samples, k, i, direction, vertex) result(omega)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      !> Of the side that is not known: 1 above, -1 below.
      integer, intent(in) :: direction
      real(wp), intent(in) :: vertex
      real(wp) :: step(2), slope(2), way

      omega = vertex
      if (k - 2*direction < 1 .or. k - 2*direction > samples%n) return
      associate (middle => samples%item(k)%at, last => samples%item(k - direction)%at, &
                 before => samples%item(k - 2*direction)%at, &
                 beyond => samples%item(k + direction)%at)
         step = abs([middle%omega - last%omega, last%omega - before%omega])
         if (.not. all(step > 0.0_wp)) return
         slope = [middle%amplitude(i) - last%amplitude(i), &
                  last%amplitude(i) - before%amplitude(i)]/step
         if (.not. slope(1) > 0.0_wp) return
         ! Where the slope, which falls from one step to the next, comes to nothing.
         way = min(0.5_wp*abs(beyond%omega - middle%omega), limits%onwards*step(1))
         if (slope(2) > slope(1)) then
            way = min(way, 0.5_wp*sum(step)*slope(1)/(slope(2) - slope(1)) - 0.5_wp*step(1))
         end if
         if (way > direction*(vertex - middle%omega)) omega = middle%omega + direction*way
      end associate
   end function further

   !> Keep a frequency off the samples.
   pure real(wp) function within(omega, left, middle, right) result(inside)
      real(wp), intent(in) :: omega, left, middle, right

      inside = min(max(omega, left + limits%margin*(middle - left)), &
                   right - limits%margin*(right - middle))
   end function within

   !> A place beyond what is known of a peak, where the response falls far on a long way that no
   !> solution is known of: the peak may go on there.
   pure subroutine find_gap(samples, k, i, omega, from, found)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      !> [rad/s]
      real(wp), intent(out) :: omega
      !> The sample before it.
      integer, intent(out) :: from
      logical, intent(out) :: found
      real(wp) :: peak, mean, known
      integer :: direction, j

      omega = 0.0_wp
      from = 0
      found = .false.
      mean = samples%item(k)%at%mean(i)
      peak = swing_of(samples%item(k)%at, i, mean)
      do direction = -1, 1, 2
         j = k
         do
            j = j + direction
            if (j < 1 .or. j > samples%n) exit
            if (swing_of(samples%item(j)%at, i, mean) < limits%near*peak) exit
         end do
         from = j - direction
         if (j < 1 .or. j > samples%n .or. from == k) cycle
         if (swing_of(samples%item(j)%at, i, mean) > limits%deep*peak) cycle
         known = abs(samples%item(from)%at%omega - samples%item(k)%at%omega)
         found = abs(samples%item(j)%at%omega - samples%item(from)%at%omega) &
                 > limits%far_beyond*known
         if (.not. found) cycle
         omega = samples%item(from)%at%omega + direction*limits%onwards_past*known
         return
      end do
   end subroutine find_gap

   !> A place just past a neighbour that stands far below a peak and next to it: on another branch,
   !> while that of the peak may go on.
   pure subroutine find_way_past(samples, k, i, side, omega, found)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      !> The neighbour.
      integer, intent(out) :: side
      !> [rad/s]
      real(wp), intent(out) :: omega
      logical, intent(out) :: found
      real(wp) :: peak, mean, known
      integer :: direction, j

      omega = 0.0_wp
      side = 0
      found = .false.
      mean = samples%item(k)%at%mean(i)
      peak = swing_of(samples%item(k)%at, i, mean)
      do direction = -1, 1, 2
         side = k + direction
         if (side <= 1 .or. side >= samples%n) cycle
         if (samples%item(side)%at%is_edge) cycle
         if (swing_of(samples%item(side)%at, i, mean) > limits%near*peak) cycle
         j = k - direction
         do while (j > 1 .and. j < samples%n)
            if (swing_of(samples%item(j)%at, i, mean) < limits%near*peak) exit
            j = j - direction
         end do
         if (j < 1 .or. j > samples%n) cycle
         known = abs(samples%item(j)%at%omega - samples%item(k)%at%omega)
         associate (at => samples%item(side)%at, next => samples%item(side + direction)%at)
            found = abs(at%omega - samples%item(k)%at%omega) < limits%next_to*known
            if (.not. found) cycle
            omega = at%omega + direction*min(limits%past*known, 0.5_wp*abs(next%omega - at%omega))
         end associate
         return
      end do
   end subroutine find_way_past

   !> Whether the response falls from the peak all at once.
   pure logical function lies_on_jump(samples, k, i)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i

      associate (left => samples%item(k - 1)%at, middle => samples%item(k)%at, &
                 right => samples%item(k + 1)%at, mean => samples%item(k)%at%mean(i))
         lies_on_jump = min(swing_of(left, i, mean), swing_of(right, i, mean)) &
                        < limits%near*swing_of(middle, i, mean)
      end associate
   end function lies_on_jump

   !> Width at half of the power of the vibration [rad/s], below 0 where there is none: between
   !> samples the root of what 1/A**2 rises by is a straight line in omega**2, as it is for a single
   !> mode.
   pure real(wp) function width_of(samples, k, i) result(width)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i
      real(wp) :: edge(2)
      logical :: found, known
      integer :: side

      width = -1.0_wp
      do side = 1, 2
         call find_edge(samples, k, i, 2*side - 3, edge(side), found, known)
         if (.not. known) return
      end do
      width = edge(2) - edge(1)
   end function width_of

   !> Where the vibration has fallen to that of the peak over the root of 2, going up or down from
   !> sample k. It is known where a sample is near: one that has fallen `far` times deeper may stand
   !> behind another mode.
   pure subroutine find_edge(samples, k, i, direction, omega, found, known)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i, direction
      !> [rad/s]
      real(wp), intent(out) :: omega
      logical, intent(out) :: found, known
      real(wp) :: peak, inner(2), outer(2), share
      integer :: j

      omega = -1.0_wp
      found = .false.
      known = .false.
      peak = swing_of(samples%item(k)%at, i, samples%item(k)%at%mean(i))
      inner = [samples%item(k)%at%omega**2, 0.0_wp]
      j = k
      do
         j = j + direction
         if (j < 1 .or. j > samples%n) return
         associate (at => samples%item(j)%at)
            outer = [at%omega**2, sqrt(max((peak/swing_of(at, i, samples%item(k)%at%mean(i)))**2 &
                                           - 1.0_wp, 0.0_wp))]
         end associate
         if (outer(2) >= 1.0_wp) exit
         inner = outer
      end do
      found = .true.
      known = outer(2) <= limits%far .or. inner(2) >= limits%at_edge
      share = (1.0_wp - inner(2))/(outer(2) - inner(2))
      omega = sqrt(inner(1) + share*(outer(1) - inner(1)))
   end subroutine find_edge

   !> The sample with the largest amplitude of a quantity.
   pure integer function place_of_highest(samples, i) result(place)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: i
      integer :: k

      place = 1
      do k = 2, samples%n
         if (samples%item(k)%at%amplitude(i) > samples%item(place)%at%amplitude(i)) place = k
      end do
   end function place_of_highest

   !> The largest amplitude of a quantity, never 0: others are divided by it.
   pure real(wp) function highest_of(samples, i) result(highest)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: i
      integer :: k

      highest = tiny(1.0_wp)
      do k = 1, samples%n
         highest = max(highest, samples%item(k)%at%amplitude(i))
      end do
   end function highest_of

   !> Whether the amplitude rises towards an end of the range, which this sample stands on: by more
   !> than round-off, or it is none that another way to the same solutions comes to.
   pure logical function is_bound(samples, k, i)
      type(sample_list), intent(in) :: samples
      integer, intent(in) :: k, i

      is_bound = (k == 1 .or. k == samples%n) .and. samples%item(k)%at%amplitude(i) > 0.0_wp
      if (.not. is_bound .or. samples%n == 1) return
      is_bound = is_lower(samples, k, i, merge(1, -1, k == 1), rise_of(samples, k, i))
   end function is_bound

   !> The maxima of every quantity by ascending frequency, and the ends of the range where the
   !> amplitude still rises.
   subroutine list_peaks(samples, failed, list)
      type(sample_list), intent(in) :: samples
      !> Frequencies at which rows failed [rad/s].
      real(wp), intent(in) :: failed(:)
      type(peak_type), allocatable, intent(out) :: list(:)
      type(peak_type), allocatable :: found(:)
      integer :: i, k, n

      allocate (list(0))
      n = samples%n
      if (n == 0) return
      allocate (found(n*size(samples%item(1)%at%amplitude)))
      n = 0
      do i = 1, size(samples%item(1)%at%amplitude)
         do k = 1, samples%n
            if (.not. (is_maximum(samples, k, i) .or. is_bound(samples, k, i))) cycle
            if (.not. allocated(samples%item(k)%at%coefficients)) cycle
            n = n + 1
            found(n) = describe(samples, failed, k, i)
         end do
      end do
      deallocate (list)
      allocate (list(n))
      do k = 1, n
         list(k) = found(k)
      end do
   end subroutine list_peaks

   !> What is known of a maximum.
   function describe(samples, failed, k, i) result(peak)
      type(sample_list), intent(in) :: samples
      real(wp), intent(in) :: failed(:)
      integer, intent(in) :: k, i
      type(peak_type) :: peak
      real(wp) :: omega, promise
      logical :: done, has_gap
      integer :: from

      associate (at => samples%item(k)%at)
         peak%observed = i
         peak%omega = at%omega
         peak%amplitude = at%amplitude(i)
         peak%coefficients = at%coefficients(:, i)
         peak%bandwidth = width_of(samples, k, i)
         peak%found_by = found_bound
         if (k == 1 .or. k == samples%n) return
         call find_next(samples, k, i, omega, promise, done)
         ! Lower ones are not looked at so closely.
         has_gap = place_of_highest(samples, i) == k
         if (has_gap) then
            call find_gap(samples, k, i, omega, from, has_gap)
            if (.not. has_gap) call find_way_past(samples, k, i, from, omega, has_gap)
         end if
         peak%found_by = merge(found_row, found_search, at%row > 0)
         if (lies_on_jump(samples, k, i)) peak%found_by = found_jump
         if (.not. done .or. has_gap .or. any(failed > samples%item(k - 1)%at%omega .and. &
                                 failed < samples%item(k + 1)%at%omega)) then
            peak%found_by = found_unresolved
         else if (at%amplitude(i) >= limits%near*highest_of(samples, i)) then
            ! Lower ones may hide a corner.
            peak%tolerance = limits%small_gain
         end if
      end associate
   end function describe

end module fw_peak_rules
