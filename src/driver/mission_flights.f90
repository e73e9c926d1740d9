!> The flights of a mission, in their order or many at a time: a jump of m flights is each block
!> for (m + 1)/2 times its cycles, first to last, and then for (m - 1)/2 times, last to first. What
!> the order of the blocks is worth within m flights is kept so, and the error is of the second
!> order. A jump is compared with the two of half its length, which are taken; their difference,
!> over the largest depth, is to be within wear%error_tolerance, and tells how long the next one may
!> be. Where it would be too short to pay, flights are flown in their order for a while.
module fw_mission_flights
   use fw_block_march, only: block_type, mission_state
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mission_options, only: mission_options
   use fw_mission_rows, only: mission_rows
   use fw_point, only: point_type
   use fw_text, only: to_text
   use fw_wear_march, only: steady_gross_slip, steady_reached, wear_march
   use fw_wear_options, only: wear_options
   implicit none (type, external)
   private

   public :: mission_flights

   !> Change of the flights of a jump from one to the next, and the safety of the new length.
   real(wp), parameter :: largest_growth = 4.0_wp, smallest_shrink = 0.2_wp, safety = 0.8_wp
   !> Flights from which a jump, its two halves and what is refused take fewer marches than flights
   !> in their order; and flights in their order after a jump of so many was refused.
   integer, parameter :: least_jump = 8, patience = 16
   !> Error of the steps within jumps, as a part of that of a jump.
   real(wp), parameter :: step_share = 0.1_wp
   !> No step is asked for a smaller one because of its jump.
   real(wp), parameter :: tightest = 1.0e-9_wp
   !> As of the march of one case: a change of the growth that counts as none; a pair bears and
   !> wears above these parts of the largest.
   real(wp), parameter :: unchanged = 1.0e-2_wp, bears = 1.0e-6_wp, wears = 1.0e-3_wp

   !> The flights of a mission: its blocks, where it is, and the control of jumps over flights.
   type :: mission_flights
      type(mission_options), pointer :: mission => null()
      type(wear_options), pointer :: wear => null()
      type(block_type), allocatable :: blocks(:)
      type(mission_rows) :: rows
      !> The control of the flights, where a march has that of its steps.
      type(wear_march), allocatable :: over
      type(mission_state), allocatable :: now
      !> Of the jump that has just ended; 0 within a flight.
      integer :: n_in_jump = 0
   contains
      procedure :: fly_on
      procedure :: write_down
   end type mission_flights

contains

   !> Flight after flight, or jump after jump.
   subroutine fly_on(self, error)
      class(mission_flights), intent(inout), target :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: n
      logical :: is_cut

      associate (n_blocks => self%mission%n_blocks, now => self%now)
         do
            ! Between two flights.
            if (now%block == 0 .or. now%block == n_blocks .or. self%n_in_jump > 0) then
               call judge(self)
               if (allocated(self%over%ending)) return
               now%block = 0
               self%n_in_jump = 0
            end if
            n = wanted_flights(self)
            ! With more flights to go it would be another jump. The rest of a flight that is
            ! continued is none: its first rows have been written as they are.
            is_cut = now%block == 0 .and. n < free_flights(self)
            if (n > 1 .and. now%block == 0) then
               call jump(self, n, is_cut, error)
            else
               if (now%block == 0) call wait_for_jump(self%over%next_cycles)
               call fly_one(self, now%block + 1, .not. is_cut, error)
               if (is_cut .and. .not. allocated(error)) then
                  call self%write_down(.true., error)
               end if
            end if
            if (allocated(error) .or. allocated(self%over%ending)) return
         end do
      end associate
   end subroutine fly_on

   !> Flights of the next jump.
   pure integer function wanted_flights(self) result(n)
      type(mission_flights), intent(in) :: self

      n = min(free_flights(self), self%mission%n_flights - self%now%flight)
      if (self%mission%flights_per_jump == 0 .and. n < least_jump) n = 1
   end function wanted_flights

   !> One flight less before the next jump.
   pure subroutine wait_for_jump(next)
      real(wp), intent(inout) :: next

      if (next > 0.0_wp) return
      next = next + 1.0_wp
      if (next >= 0.0_wp) next = least_jump
   end subroutine wait_for_jump

   !> The same without an end.
   pure integer function free_flights(self) result(n)
      type(mission_flights), intent(in) :: self

      n = max(1, nint(self%over%next_cycles))
      if (self%mission%flights_per_jump > 0) n = self%mission%flights_per_jump
   end function free_flights

   !> A flight, from one of its blocks on; in the order of the blocks.
   subroutine fly_one(self, first, writes, error)
      type(mission_flights), intent(inout), target :: self
      integer, intent(in) :: first
      !> Each row at once, not behind the jump that it belongs to.
      logical, intent(in) :: writes
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      if (first == 1) self%now%flight = self%now%flight + 1
      do b = first, self%mission%n_blocks
         call wear_block(self, b, self%mission%cycles(b), 1.0_wp, writes, error)
         if (allocated(error) .or. allocated(self%over%ending)) return
      end do
   end subroutine fly_one

   !> Several flights as one: the blocks to and fro. That they go to with more of their cycles than
   !> they come back is the order within one flight; of a single flight nothing comes back.
   subroutine fly_together(self, n, error)
      type(mission_flights), intent(inout), target :: self
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: cycles, share
      integer :: b, k, last

      share = 1.0_wp
      if (self%mission%flights_per_jump == 0) share = step_share
      if (n == 1) then
         call fly_one(self, 1, .false., error)
         return
      end if
      self%now%flight = self%now%flight + n
      last = self%mission%n_blocks
      do k = 1, 2*last - 1
         b = last - abs(last - k)
         cycles = n*self%mission%cycles(b)
         if (k < last) cycles = 0.5_wp*(n + 1)*self%mission%cycles(b)
         if (k > last) cycles = 0.5_wp*(n - 1)*self%mission%cycles(b)
         call wear_block(self, b, cycles, share, .false., error)
         if (allocated(error) .or. allocated(self%over%ending)) return
      end do
   end subroutine fly_together

   !> One march of a block, and its row. A block that fails names the ending.
   subroutine wear_block(self, b, cycles, share, writes, error)
      type(mission_flights), intent(inout), target :: self
      integer, intent(in) :: b
      real(wp), intent(in) :: cycles
      !> Part of wear%error_tolerance that a step may be off.
      real(wp), intent(in) :: share
      logical, intent(in) :: writes
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      real(wp) :: begun
      logical :: stopped

      associate (block => self%blocks(b), over => self%over)
         begun = self%now%cycles
         call block%march(cycles, max(tightest, share*self%wear%tolerance()), self%now, point, &
                          stopped, error)
         self%rows%record%n_marches = self%rows%record%n_marches + 1
         if (allocated(error)) return
         call count_steps(block%joint%march, begun, over)
         if (stopped) then
            over%ending = 'stopped by its observer'
         else if (allocated(block%failure)) then
            over%gave_up = .true.
            over%ending = 'flight '//to_text(self%now%flight)//', '// &
                          trim(self%mission%title(b))//': '//block%failure
         end if
         if (allocated(over%ending)) return
         self%now%block = b
         call self%rows%keep(block, self%now, point)
         if (writes) call self%write_down(.false., error)
      end associate
   end subroutine wear_block

   !> What the marches of the blocks have taken counts for the flights.
   subroutine count_steps(march, begun, over)
      type(wear_march), intent(in) :: march
      !> Cycles before it.
      real(wp), intent(in) :: begun
      type(wear_march), intent(inout) :: over

      over%n_steps = over%n_steps + march%n_steps
      over%n_rejected = over%n_rejected + march%n_rejected
      over%n_unsettled = over%n_unsettled + march%n_unsettled
      over%n_implicit = over%n_implicit + march%n_implicit
      over%n_leaps = over%n_leaps + march%n_leaps
      if (over%n_jumps == 0 .and. march%n_jumps > 0) over%first_jump = begun + march%first_jump
      over%n_jumps = over%n_jumps + march%n_jumps
   end subroutine count_steps

   !> A jump and the two of half its length, until they agree; the halves are taken.
   subroutine jump(self, wanted, ends_early, error)
      type(mission_flights), intent(inout), target :: self
      !> Flights to begin with, and whether they would be more with more to come.
      integer, intent(in) :: wanted
      logical, intent(in) :: ends_early
      type(error_type), allocatable, intent(out) :: error
      type(mission_state) :: before
      real(wp), allocatable :: whole(:)
      real(wp) :: difference, factor
      integer :: b, half, n
      logical :: by_error, is_cut

      before = self%now
      by_error = self%mission%flights_per_jump == 0
      n = wanted
      is_cut = ends_early
      difference = 0.0_wp
      factor = 1.0_wp
      do b = 1, size(self%blocks)
         call self%blocks(b)%keep()
      end do
      do
         if (n == 1 .or. (by_error .and. n < least_jump)) then
            ! No shorter one pays: the failure of a flight is that of the run.
            self%over%next_cycles = -real(patience, wp)
            call fly_one(self, 1, .true., error)
            return
         end if
         half = n
         if (by_error) then
            call fly_together(self, n, error)
            if (.not. (allocated(error) .or. allocated(self%over%ending))) then
               whole = self%now%depth
               call step_back(self, before, error)
               if (allocated(error)) return
               half = n/2
            end if
         end if
         if (.not. (allocated(error) .or. allocated(self%over%ending))) then
            call fly_together(self, half, error)
         end if
         if (half < n .and. .not. (allocated(error) .or. allocated(self%over%ending))) then
            call fly_together(self, n - half, error)
         end if
         if (allocated(error)) return
         if (allocated(self%over%ending)) then
            if (.not. self%over%gave_up) return
            ! Once more, with half of it.
            deallocate (self%over%ending)
            self%over%gave_up = .false.
            n = n/2
         else if (by_error) then
            difference = maxval(abs(self%now%depth - whole))
            factor = largest_growth
            if (difference > 0.0_wp) factor = safety*(self%wear%tolerance()* &
               maxval(self%now%depth)/difference)**(1.0_wp/3.0_wp)
            factor = min(largest_growth, max(smallest_shrink, factor))
            if (difference <= self%wear%tolerance()*maxval(self%now%depth)) exit
            n = max(1, min(n - 1, int(factor*n)))
         else
            exit
         end if
         self%rows%record%n_refused = self%rows%record%n_refused + 1
         call step_back(self, before, error)
         if (allocated(error)) return
      end do
      self%rows%record%n_jumps = self%rows%record%n_jumps + 1
      if (by_error) then
         self%rows%record%error = self%rows%record%error + difference
         self%over%next_cycles = real(max(least_jump, int(factor*n)), wp)
      end if
      self%n_in_jump = n
      call self%write_down(is_cut, error)
   end subroutine jump

   !> Back to where a jump began; its rows are forgotten.
   subroutine step_back(self, before, error)
      type(mission_flights), intent(inout), target :: self
      type(mission_state), intent(in) :: before
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      self%now = before
      call self%rows%forget()
      do b = 1, size(self%blocks)
         call self%blocks(b)%go_back(error)
         if (allocated(error)) return
      end do
   end subroutine step_back

   !> Whether the mission ends between two flights, and why.
   subroutine judge(self)
      type(mission_flights), intent(inout), target :: self
      real(wp) :: growth(size(self%now%depth))
      integer :: before

      associate (over => self%over, now => self%now, record => self%rows%record)
         if (now%flight > 0) then
            before = findloc(record%solved(:now%flight - 1), .true., dim=1, back=.true.) - 1
            growth = (now%depth - record%depth(:, before))/(now%flight - before)
            over%largest_rate = max(over%largest_rate, maxval(growth))
            if (maxval(growth) <= self%wear%steady_tolerance*over%largest_rate) then
               over%steady = steady_reached
               over%complete = .true.
               over%ending = 'steady state after '//to_text(now%flight)//' flights'
               if (over%largest_rate <= 0.0_wp) over%ending = 'no pair slips under pressure in '// &
                  'any block: nothing wears'
            else if (in_gross_slip(self, growth)) then
               over%steady = steady_gross_slip
               over%complete = .true.
               over%ending = 'the whole joint keeps sliding and wears at a constant rate: '// &
                             'there is no steady state'
            end if
         end if
         if (now%flight >= self%mission%n_flights .and. .not. allocated(over%ending)) then
            over%complete = .true.
            over%ending = 'n_flights reached'
         end if
      end associate
   end subroutine judge

   !> As of the march of one case (fw_wear_march), by the growth of a flight: every pair wears, or
   !> bears nothing in any block.
   logical function in_gross_slip(self, growth) result(found)
      type(mission_flights), intent(inout), target :: self
      real(wp), intent(in) :: growth(:)
      real(wp) :: pressure(size(growth)), here(size(growth)), depth, compression
      logical :: changed
      integer :: b

      found = .false.
      associate (over => self%over)
         depth = maxval(self%now%depth)
         if (allocated(over%checked_rate) .and. depth < 2.0_wp*over%checked_depth) return
         if (depth <= 0.0_wp) return
         changed = .true.
         if (allocated(over%checked_rate)) then
            changed = maxval(abs(growth - over%checked_rate)) > unchanged*maxval(growth)
         end if
         over%checked_depth = depth
         over%checked_rate = growth
         if (changed) return
      end associate
      pressure = 0.0_wp
      compression = 0.0_wp
      do b = 1, size(self%blocks)
         if (.not. self%blocks(b)%is_known) cycle
         ! Rates of today say nothing of tomorrow while friction is on its way.
         if (.not. self%blocks(b)%joint%system%friction_rests(unchanged)) return
         here = self%blocks(b)%joint%system%mean_pressure()
         if (maxval(here) > 0.0_wp) pressure = max(pressure, here/maxval(here))
         compression = max(compression, self%blocks(b)%joint%system%compression())
      end do
      if (depth < compression) return
      found = all(growth >= wears*maxval(growth) .or. pressure <= bears)
   end function in_gross_slip

   !> Rows that were waiting.
   subroutine write_down(self, is_cut, error)
      class(mission_flights), intent(inout), target :: self
      logical, intent(in) :: is_cut
      type(error_type), allocatable, intent(out) :: error

      call self%rows%write_down(self%blocks, self%over, is_cut, error)
   end subroutine write_down

end module fw_mission_flights
