!> The true maxima of a response between the rows of its sweep.
!>
!> A sweep passes its points by; what may hide a peak is noted on the way: a local maximum of an
!> observed amplitude, and an interval in which a resonance may have been stepped over, because the
!> phase turns back by about pi there or because a mode of the joint, in the state that it is in,
!> lies there and is narrow for the interval. After the sweep a few more solutions find the maxima;
!> rows do not change by it.
module fw_peak_finder
   use fw_case, only: analyses, case_type
   use fw_contact_data, only: memory_carried
   use fw_error, only: error_type
   use fw_hidden_resonance, only: hides_mode, hides_resonance, turns_back
   use fw_joint_modes, only: find_joint_modes, joint_mode_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_mixed_bands, only: find_bands, mixed_band, opens
   use fw_peak, only: peak_type
   use fw_peak_gaps, only: gap_list
   use fw_peak_options, only: limits
   use fw_peak_rules, only: find_edge, find_gap, find_next, find_way_past, highest_of, is_bound, &
      is_maximum, list_peaks, place_of_highest
   use fw_point, only: point_type
   use fw_samples, only: balance_point, new_sample, sample_list, sample_type
   use fw_session_points, only: point_list
   use fw_sinks, only: point_sink
   use fw_strategy, only: new_request, point_request, point_strategy
   use fw_sweep, only: point_source
   implicit none (type, external)
   private

   public :: peak_finder

   !> An interval between two rows [rad/s].
   type :: interval_type
      real(wp) :: below = 0.0_wp, above = 0.0_wp
   end type interval_type

   type, extends(point_sink) :: peak_finder
      !> Where points come from, and who solves more of them.
      class(point_source), pointer :: source => null()
      class(point_strategy), pointer :: strategy => null()
      class(interrupt_type), pointer :: interrupt => null()
      !> Modes of the joint in the range of the sweep.
      type(joint_mode_type), allocatable :: modes(:)
      !> Between those of the free joint and of the held one.
      type(mixed_band), allocatable, private :: bands(:)
      !> Solutions of the search, and their iterations.
      integer :: n_solved = 0, iterations = 0
      !> The points of these solutions, where they are to become rows.
      type(point_list) :: added
      type(sample_list), private :: samples
      type(interval_type), allocatable, private :: suspects(:)
      !> Where modes that the joint changes may lie below the rows.
      type(gap_list), private :: gaps
      !> Frequencies at which rows failed [rad/s].
      real(wp), allocatable, private :: failed(:)
      !> Rows taken, and those of them since the last that failed.
      integer, private :: n_rows = 0, n_following = 0
      !> Whether rows are taken at all, and whether their frequencies only rise or only fall.
      logical, private :: is_active = .false.
      logical :: in_order = .false.
   contains
      procedure :: start
      procedure :: take
      procedure :: search
      procedure :: peaks
      procedure :: find_open
      procedure :: go_to
      procedure :: clear
   end type peak_finder

contains

   !> Get ready for a sweep over frequencies.
   subroutine start(self, case, omega, source, strategy, interrupt)
      class(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> In the order of the rows (n_points) [rad/s].
      real(wp), intent(in) :: omega(:)
      class(point_source), intent(in), target :: source
      class(point_strategy), intent(in), target :: strategy
      !> What may end the search.
      class(interrupt_type), intent(in), target :: interrupt
      integer :: n

      self%source => source
      self%strategy => strategy
      self%interrupt => interrupt
      self%is_active = .true.
      n = size(omega)
      self%in_order = all(omega(2:) > omega(:n - 1)) .or. all(omega(2:) < omega(:n - 1))
      call find_modes(self, case, minval(omega), maxval(omega))
      allocate (self%suspects(0), self%failed(0))
   end subroutine start

   !> Modes of the joint in the range, and where those lie that it changes.
   subroutine find_modes(self, case, lowest, highest)
      class(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Of the range [rad/s].
      real(wp), intent(in) :: lowest, highest
      type(joint_mode_type), allocatable :: modes(:)
      integer :: j, n

      call find_joint_modes(case, [0.0_wp, highest], modes)
      call find_bands(case, modes, self%bands)
      allocate (self%modes(count(modes%omega >= lowest)))
      n = 0
      ! Element by element, as in fw_joint_modes.
      do j = 1, size(modes)
         if (modes(j)%omega < lowest) cycle
         n = n + 1
         self%modes(n) = modes(j)
      end do
   end subroutine find_modes

   !> A row of the sweep.
   subroutine take(self, point, error)
      class(peak_finder), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      type(sample_type) :: sample
      integer :: place

      if (.not. self%is_active) return
      self%n_rows = self%n_rows + 1
      if (.not. point%converged) then
         self%failed = [self%failed, point%omega]
         self%n_following = 0
         return
      end if
      sample = new_sample(point)
      sample%row = self%n_rows
      ! In order, look_back decides of each row what of it is kept; in no order, all are kept.
      sample%is_needed = .not. self%in_order
      ! The same solution once more, as in a list that names a frequency twice, is no neighbour.
      if (.not. self%in_order) then
         if (is_known(self%samples, sample)) return
      end if
      call self%source%remember(sample%memory)
      call self%samples%insert(sample, place)
      self%n_following = self%n_following + 1
      ! Two neighbours without a failure between them, which says nothing of the interval.
      if (self%in_order .and. self%n_following >= 2) call look_back(self, place)
      if (modulo(self%n_rows, limits%most_samples) == 0 .and. &
          self%samples%n >= limits%most_samples) then
         call self%samples%thin()
      end if
   end subroutine take

   !> Whether a sample has the frequency and the amplitudes of one before.
   pure logical function is_known(samples, sample)
      type(sample_list), intent(in) :: samples
      type(sample_type), intent(in) :: sample
      integer :: k

      is_known = .false.
      do k = 1, samples%n
         associate (other => samples%item(k)%at)
            if (abs(other%omega - sample%omega) > limits%same_frequency*sample%omega) cycle
            is_known = is_known .or. all(abs(other%amplitude - sample%amplitude) <= &
                                         limits%same_amplitude*maxval(sample%amplitude))
         end associate
      end do
   end function is_known

   !> Whether the last row and those before hide something; what is not needed is forgotten.
   subroutine look_back(self, place)
      type(peak_finder), intent(inout) :: self
      !> Of the last row, at one end of the samples.
      integer, intent(in) :: place
      integer :: back, i
      logical :: is_peak

      back = merge(-1, 1, place > 1)
      associate (item => self%samples%item, n => self%samples%n)
         associate (below => item(min(place, place + back))%at, &
                    above => item(max(place, place + back))%at)
            if (hides_resonance(self%modes, below, above)) then
               self%suspects = [self%suspects, interval_type(below%omega, above%omega)]
               below%is_needed = .true.
               above%is_needed = .true.
            end if
            call self%gaps%note(self%bands, below, above)
         end associate
         if (n < 3) return
         ! The row before the last has neighbours on both sides now.
         is_peak = .false.
         do i = 1, size(item(place)%at%amplitude)
            is_peak = is_peak .or. is_maximum(self%samples, place + back, i)
         end do
         if (is_peak) then
            item(place)%at%is_needed = .true.
            item(place + back)%at%is_needed = .true.
            item(place + 2*back)%at%is_needed = .true.
         end if
         ! The first row and the last may hold the largest amplitude.
         if (n > 3) call item(place + 2*back)%at%forget()
      end associate
   end subroutine look_back

   !> Intervals between rows that came in no order.
   subroutine suspect_all(self)
      type(peak_finder), intent(inout) :: self
      integer :: k

      do k = 1, self%samples%n - 1
         associate (below => self%samples%item(k)%at, above => self%samples%item(k + 1)%at)
            if (hides_resonance(self%modes, below, above)) then
               self%suspects = [self%suspects, interval_type(below%omega, above%omega)]
            end if
            call self%gaps%note(self%bands, below, above)
         end associate
      end do
   end subroutine suspect_all

   !> Solve between rows below which a resonance of a joint that opens may lie, and may be the
   !> highest: so near to each other that its flank would stand out.
   subroutine look_between(self, case, budget, error)
      class(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: share
      integer :: j, k, known

      if (self%gaps%n == 0) return
      ! Half of what may be spent: the maxima that are found have to be climbed.
      call self%gaps%plan(self%samples, highest_of_all(self), self%n_rows, &
                          (budget - self%n_solved)/2)
      do k = 1, self%gaps%n
         associate (gap => self%gaps%item(k))
            do j = 1, gap%points
               share = real(j, wp)/real(gap%points + 1, wp)
               known = self%samples%n
               call solve_at(self, case, gap%below + share*(gap%above - gap%below), budget, error, &
                             fallback=.true.)
               if (allocated(error)) return
               if (self%samples%n > known) gap%solved = gap%solved + 1
            end do
         end associate
      end do
   end subroutine look_between

   !> A flank is hollow towards its resonance. A sample that stands above the line between its
   !> neighbours, and is no maximum, is on the flank of another one that lies beside it.
   subroutine look_at_bulges(self, case, budget, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: highest(:)
      real(wp) :: omega(2*self%samples%n)
      integer :: k, n

      if (size(self%bands) == 0 .or. self%samples%n < 3) return
      highest = highest_of_all(self)
      n = 0
      do k = 2, self%samples%n - 1
         if (.not. is_bulge(self, k, highest)) cycle
         associate (item => self%samples%item)
            omega(n + 1) = item(k)%at%omega - limits%part*(item(k)%at%omega - item(k - 1)%at%omega)
            omega(n + 2) = item(k)%at%omega + limits%part*(item(k + 1)%at%omega - item(k)%at%omega)
         end associate
         n = n + 2
      end do
      do k = 1, n
         call solve_at(self, case, omega(k), budget, error, fallback=.true.)
         if (allocated(error)) return
      end do
   end subroutine look_at_bulges

   !> Whether a sample of a joint that opens is one, where a resonance may be the highest.
   pure logical function is_bulge(self, k, highest)
      type(peak_finder), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(in) :: highest(:)
      real(wp) :: line(size(highest)), share
      integer :: i, j
      logical :: is_near

      is_bulge = .false.
      associate (below => self%samples%item(k - 1)%at, at => self%samples%item(k)%at, &
                 above => self%samples%item(k + 1)%at)
         if (.not. (opens(below) .or. opens(at) .or. opens(above))) return
         is_near = .false.
         do j = 1, size(self%bands)
            is_near = is_near .or. (above%omega > self%bands(j)%free .and. &
                                    below%omega < self%bands(j)%held .and. &
                                    any(self%bands(j)%height > highest))
         end do
         if (.not. is_near) return
         if (above%omega - below%omega <= limits%same_frequency*above%omega) return
         if (any([(is_maximum(self%samples, k - 1, i) .or. is_maximum(self%samples, k, i) .or. &
                   is_maximum(self%samples, k + 1, i), i=1, size(highest))])) return
         share = (at%omega - below%omega)/(above%omega - below%omega)
         line = below%amplitude + share*(above%amplitude - below%amplitude)
         is_bulge = any(at%amplitude > (1.0_wp + limits%bulge)*line)
      end associate
   end function is_bulge

   !> The largest amplitude of every quantity.
   pure function highest_of_all(self) result(highest)
      type(peak_finder), intent(in) :: self
      real(wp), allocatable :: highest(:)
      integer :: i

      highest = [(highest_of(self%samples, i), i=1, size(self%samples%item(1)%at%amplitude))]
   end function highest_of_all

   !> The range in which a joint that opens may have a higher maximum than all that were found.
   pure subroutine find_open(self, range, n_open)
      class(peak_finder), intent(in) :: self
      !> [rad/s]
      real(wp), intent(out) :: range(2)
      !> Intervals between rows; 0 where none is left.
      integer, intent(out) :: n_open

      n_open = 0
      range = 0.0_wp
      if (self%samples%n > 0) call self%gaps%find_open(highest_of_all(self), range, n_open)
   end subroutine find_open

   !> Look for every maximum that the rows leave open.
   subroutine search(self, case, error)
      class(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: k, budget
      logical :: more

      if (.not. self%is_active) return
      ! There a point depends on those before, or takes too long.
      if (case%contact%memory == memory_carried .or. analyses(case%analysis)%is_integrated) return
      if (.not. self%in_order) call suspect_all(self)
      budget = min(max(limits%least_budget, self%n_rows/limits%budget_share), limits%most_budget)
      ! In the order of what they may find: resonances that no row shows, ends of the range,
      ! summits of maxima that rows show, and last the widths, which change no maximum.
      do k = 1, size(self%suspects)
         call look_into(self, case, self%suspects(k), budget, error)
         if (allocated(error)) return
      end do
      call look_between(self, case, budget, error)
      if (.not. allocated(error)) call look_at_bulges(self, case, budget, error)
      if (.not. allocated(error)) call look_inside(self, case, budget, error)
      more = .true.
      do while (more .and. .not. allocated(error))
         call climb(self, case, budget, error)
         if (.not. allocated(error)) call measure_widths(self, case, budget, error)
         if (.not. allocated(error)) call look_beyond(self, case, budget, more, error)
         if (.not. allocated(error)) call look_past(self, case, budget, more, error)
      end do
      ! What was solved for widths and branches may tell of corners.
      if (.not. allocated(error)) call climb(self, case, budget, error)
      ! What becomes a row now is known here already.
      self%is_active = .false.
   end subroutine search

   !> Where an end of the range seems to hold the highest amplitude, the maximum may lie just
   !> inside.
   subroutine look_inside(self, case, budget, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega(2)
      logical :: is_high(2)
      integer :: i, side, n

      n = self%samples%n
      if (n < 2) return
      is_high = .false.
      do i = 1, size(self%samples%item(1)%at%amplitude)
         ! A low end is no candidate for the highest amplitude, whichever way it slopes.
         associate (item => self%samples%item, highest => highest_of(self%samples, i))
            is_high = is_high .or. [is_bound(self%samples, 1, i), is_bound(self%samples, n, i)] &
                      .and. [item(1)%at%amplitude(i), item(n)%at%amplitude(i)] >= 0.5_wp*highest
         end associate
      end do
      associate (item => self%samples%item)
         omega(1) = item(1)%at%omega + limits%step_inside*(item(2)%at%omega - item(1)%at%omega)
         omega(2) = item(n)%at%omega + limits%step_inside*(item(n - 1)%at%omega - item(n)%at%omega)
      end associate
      do side = 1, 2
         if (.not. is_high(side)) cycle
         call solve_at(self, case, omega(side), budget, error)
         if (allocated(error)) return
      end do
   end subroutine look_inside

   !> Solve where a resonance may hide in an interval, until a maximum shows in it.
   subroutine look_into(self, case, suspect, budget, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(interval_type), intent(in) :: suspect
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega
      integer :: trial, j
      logical :: found

      do j = 1, size(self%modes)
         associate (mode => self%modes(j))
            if (mode%omega <= suspect%below .or. mode%omega >= suspect%above) cycle
            ! The maximum of displacement, omega sqrt(1 - 2 zeta^2), with the width 2 zeta omega.
            omega = sqrt(mode%omega**2 - 0.5_wp*min(mode%width, mode%omega)**2)
         end associate
         if (.not. is_open(self, self%modes(j), omega)) cycle
         call solve_at(self, case, omega, budget, error)
         if (allocated(error)) return
      end do
      ! Then where the phase turns: each solution divides the interval, or shows the maximum.
      do trial = 1, limits%most_trials
         call find_turn(self, suspect, omega, found)
         if (.not. found) exit
         call solve_at(self, case, omega, budget, error)
         if (allocated(error)) return
      end do
   end subroutine look_into

   !> Whether a mode may still hide between the samples on both sides of a frequency.
   pure logical function is_open(self, mode, omega)
      type(peak_finder), intent(in) :: self
      type(joint_mode_type), intent(in) :: mode
      real(wp), intent(in) :: omega
      integer :: k

      is_open = .false.
      do k = 1, self%samples%n - 1
         associate (below => self%samples%item(k)%at, above => self%samples%item(k + 1)%at)
            if (below%omega >= omega .or. above%omega <= omega) cycle
            is_open = hides_mode(mode, below, above) .and. &
                      min(omega - below%omega, above%omega - omega) > limits%same_frequency*omega
         end associate
      end do
   end function is_open

   !> The place in an interval where the phase turns back and no maximum shows yet.
   pure subroutine find_turn(self, suspect, omega, found)
      type(peak_finder), intent(in) :: self
      type(interval_type), intent(in) :: suspect
      real(wp), intent(out) :: omega
      logical, intent(out) :: found
      integer :: i, k

      omega = 0.0_wp
      do k = 1, self%samples%n - 1
         associate (below => self%samples%item(k)%at, above => self%samples%item(k + 1)%at)
            if (below%omega < suspect%below .or. above%omega > suspect%above) cycle
            if (above%omega - below%omega <= limits%same_frequency*above%omega) cycle
            do i = 1, size(below%amplitude)
               found = turns_back(below, above, i) .and. .not. is_maximum(self%samples, k, i) &
                       .and. .not. is_maximum(self%samples, k + 1, i)
               if (.not. found) cycle
               omega = balance_point(below, above, i)
               return
            end do
         end associate
      end do
      found = .false.
   end subroutine find_turn

   !> Solve at the summit that promises most, again and again, until all are known.
   subroutine climb(self, case, budget, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega
      integer :: k
      logical :: found

      do while (self%n_solved < budget)
         call find_summit(self, k, omega, found)
         if (.not. found) exit
         call solve_at(self, case, omega, budget, error, k)
         if (allocated(error)) return
      end do
   end subroutine climb

   !> Solve at the edges of the highest peak of every quantity where no row is near them.
   subroutine measure_widths(self, case, budget, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      ! A first solution between the peak and a sample behind another mode may miss the edge.
      real(wp) :: omega
      integer :: i, k, side, look
      logical :: found, known

      if (self%samples%n < 3) return
      do i = 1, size(self%samples%item(1)%at%amplitude)
         do side = -1, 1, 2
            do look = 1, limits%looks_at_edge
               ! Found anew, for a solution moves the places.
               k = place_of_highest(self%samples, i)
               if (.not. is_maximum(self%samples, k, i)) exit
               call find_edge(self%samples, k, i, side, omega, found, known)
               if (known .or. .not. found) exit
               call solve_at(self, case, omega, budget, error, k)
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine measure_widths

   !> Solve beyond what is known of the highest peaks, where they may go on; `more` where one does.
   subroutine look_beyond(self, case, budget, more, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega
      integer :: i, k, from, trial
      logical :: found

      more = .false.
      if (self%samples%n < 3) return
      do i = 1, size(self%samples%item(1)%at%amplitude)
         do trial = 1, limits%most_trials
            k = place_of_highest(self%samples, i)
            if (.not. is_maximum(self%samples, k, i) .or. self%n_solved >= budget) exit
            call find_gap(self%samples, k, i, omega, from, found)
            if (.not. found) exit
            associate (at => self%samples%item(from)%at)
               if (at%n_failed >= limits%most_failures) exit
               omega = at%omega + (omega - at%omega)*0.5_wp**at%n_failed
            end associate
            call solve_at(self, case, omega, budget, error, from)
            if (allocated(error)) return
            more = more .or. place_of_highest(self%samples, i) /= k
         end do
      end do
   end subroutine look_beyond

   !> Solve past a sample that stands on another branch, right next to the highest peak: this goes
   !> on there, or the response falls.
   subroutine look_past(self, case, budget, more, error)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: budget
      !> Set where a peak goes on.
      logical, intent(inout) :: more
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega, edge, height, way
      integer :: i, k, look, side
      logical :: found

      if (self%samples%n < 3) return
      do i = 1, size(self%samples%item(1)%at%amplitude)
         k = place_of_highest(self%samples, i)
         if (self%n_solved >= budget) exit
         if (.not. is_maximum(self%samples, k, i)) cycle
         call find_way_past(self%samples, k, i, side, omega, found)
         if (.not. found) cycle
         height = limits%goes_on*self%samples%item(k)%at%amplitude(i)
         self%samples%item(side)%at%is_edge = .true.
         edge = self%samples%item(side)%at%omega
         way = omega - edge
         do look = 1, limits%looks_behind
            call solve_at(self, case, edge + way, budget, error, place_of_highest(self%samples, i))
            if (allocated(error)) return
            call leave_edge(self, edge, edge + way, height, i, found)
            more = more .or. found
            if (found) exit
            ! The branch may end sooner.
            way = limits%nearer*way
         end do
      end do
   end subroutine look_past

   !> Where the response past a sample on another branch is as high as the peak, that is no edge.
   subroutine leave_edge(self, edge, omega, height, i, goes_on)
      type(peak_finder), intent(inout) :: self
      !> The sample, and one past it [rad/s].
      real(wp), intent(in) :: edge, omega
      !> What is high, of quantity i.
      real(wp), intent(in) :: height
      integer, intent(in) :: i
      logical, intent(out) :: goes_on
      integer :: j

      goes_on = .false.
      do j = 2, self%samples%n - 1
         if (abs(self%samples%item(j)%at%omega - omega) > 0.0_wp) cycle
         if (self%samples%item(j)%at%amplitude(i) < height) return
         goes_on = .true.
         call self%samples%drop(merge(j - 1, j + 1, omega > edge))
         return
      end do
   end subroutine leave_edge

   !> The maximum that is not known well enough and may be the highest, relative to what is known of
   !> its quantity.
   pure subroutine find_summit(self, place, omega, found)
      type(peak_finder), intent(in) :: self
      !> Its sample.
      integer, intent(out) :: place
      !> Where to solve for it [rad/s].
      real(wp), intent(out) :: omega
      logical, intent(out) :: found
      !> Of the highest sample: more than that is not told apart.
      real(wp), parameter :: endless = 1.0e30_wp
      real(wp) :: best, candidate, promise, highest, share
      integer :: i, k
      logical :: done

      found = .false.
      place = 0
      omega = 0.0_wp
      best = 0.0_wp
      if (self%samples%n < 3) return
      do i = 1, size(self%samples%item(1)%at%amplitude)
         highest = highest_of(self%samples, i)
         if (.not. highest > 0.0_wp) cycle
         do k = 2, self%samples%n - 1
            if (.not. is_maximum(self%samples, k, i)) cycle
            if (self%samples%item(k)%at%n_failed >= limits%most_failures) cycle
            call find_next(self%samples, k, i, candidate, promise, done)
            ! A promise without height is `huge`, and would overflow.
            share = min(promise, endless*highest)/highest
            if (done .or. share <= best) cycle
            best = share
            associate (at => self%samples%item(k)%at)
               omega = at%omega + (candidate - at%omega)*0.5_wp**at%n_failed
            end associate
            place = k
            found = .true.
         end do
      end do
   end subroutine find_summit

   !> One more solution, started from the sample given, else from the nearest that can be.
   subroutine solve_at(self, case, omega, budget, error, from, fallback)
      type(peak_finder), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: omega
      integer, intent(in) :: budget
      type(error_type), allocatable, intent(out) :: error
      integer, intent(in), optional :: from
      !> Whether the methods that a row falls back to are tried as well.
      logical, intent(in), optional :: fallback
      type(sample_type) :: sample
      type(point_request) :: request
      type(point_type) :: point
      integer :: start, place

      if (self%n_solved >= budget) return
      start = nearest_to(self%samples, omega)
      if (present(from)) then
         if (allocated(self%samples%item(from)%at%memory%x)) start = from
      end if
      if (start == 0) return
      call self%strategy%recall(self%samples%item(start)%at%memory)
      request = point_request(omega=omega, by_newton=.true.)
      if (case%sweep%refine) request = new_request(case, omega)
      request%fallback = .false.
      if (present(fallback)) request%fallback = fallback
      request%interrupt => self%interrupt
      call self%strategy%solve_in_time(case, request, point, error)
      if (allocated(error)) return
      self%n_solved = self%n_solved + 1
      self%iterations = self%iterations + point%iterations
      if (.not. point%converged) then
         if (present(from)) then
            self%samples%item(from)%at%n_failed = self%samples%item(from)%at%n_failed + 1
         end if
         return
      end if
      if (case%sweep%refine) call self%added%add(point)
      sample = new_sample(point)
      sample%is_needed = .true.
      sample%fraction = self%samples%item(start)%at%fraction
      call self%strategy%remember(sample%memory)
      call self%samples%insert(sample, place)
   end subroutine solve_at

   !> The sample with a solution to go on from that is nearest to a frequency; 0 where none has one.
   pure integer function nearest_to(samples, omega) result(place)
      type(sample_list), intent(in) :: samples
      real(wp), intent(in) :: omega
      integer :: k

      place = 0
      do k = 1, samples%n
         if (.not. allocated(samples%item(k)%at%memory%x)) cycle
         if (place > 0) then
            if (abs(samples%item(k)%at%omega - omega) >= &
                abs(samples%item(place)%at%omega - omega)) cycle
         end if
         place = k
      end do
   end function nearest_to

   !> The maxima of every quantity by ascending frequency, and the ends of the range where the
   !> amplitude still rises.
   subroutine peaks(self, list)
      class(peak_finder), intent(in) :: self
      type(peak_type), allocatable, intent(out) :: list(:)

      call list_peaks(self%samples, self%failed, list)
   end subroutine peaks

   !> Go on from the sample that is nearest to a frequency; `found` where there is one.
   subroutine go_to(self, omega, found)
      class(peak_finder), intent(inout) :: self
      real(wp), intent(in) :: omega
      logical, intent(out) :: found
      integer :: place

      place = nearest_to(self%samples, omega)
      found = place > 0
      if (found) call self%strategy%recall(self%samples%item(place)%at%memory)
   end subroutine go_to

   !> Samples stand behind pointers.
   subroutine clear(self)
      class(peak_finder), intent(inout) :: self

      call self%samples%clear()
   end subroutine clear

end module fw_peak_finder
