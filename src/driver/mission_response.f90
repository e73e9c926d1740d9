!> A mission (analysis 'wear' with &mission): blocks of cycles in other conditions that wear the
!> same joint in turn, flight after flight.
!>
!> Flights are flown in their order, or many at a time: a jump of m flights is each block for
!> (m + 1)/2 times its cycles, first to last, and then for (m - 1)/2 times, last to first. What the
!> order of the blocks is worth within m flights is kept so, and the error is of the second order. A
!> jump is compared with the two of half its length, which are taken; their difference, over the
!> largest depth, is to be within wear%error_tolerance, and tells how long the next one may be.
!> Where it would be too short to pay, flights are flown in their order for a while.
module fw_mission_response
   use fw_analysis, only: analysis, run_type
   use fw_block_march, only: block_type, mission_state
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: hdf5_file
   use fw_kinds, only: wp
   use fw_memory, only: require_memory
   use fw_mission_block, only: read_block
   use fw_mission_group, only: mission_record
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_restart_file, only: restart_type
   use fw_restart_rows, only: c_noted, c_spacing, n_counts, restart_row_set
   use fw_text, only: to_text
   use fw_wear_group, only: wear_outcome, wear_patches
   use fw_wear_march, only: steady_gross_slip, steady_not_reached, steady_reached, steady_words, &
      wear_march
   use fw_wear_response, only: remark_steps
   use fw_wear_step, only: wear_state
   implicit none (type, external)
   private

   public :: mission_analysis

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

   !> A row that is written once its jump is taken.
   type :: row_type
      type(point_type) :: point
      real(wp), allocatable :: vibration(:), notes(:)
      real(wp) :: spacing = 0.0_wp
   end type row_type

   type, extends(analysis) :: mission_analysis
      private
      type(run_type), pointer :: run => null()
      type(case_type), pointer :: case => null()
      type(block_type), allocatable :: blocks(:)
      type(restart_row_set), allocatable :: restart_rows
      type(mission_record), allocatable :: record
      !> The control of the flights, where a march has that of its steps.
      type(wear_march), allocatable :: over
      type(mission_state), allocatable :: now
      !> Rows of the jump at work.
      type(row_type), allocatable :: row(:)
      integer :: n_rows = 0, n_expected = 0, n_in_jump = 0
   contains
      procedure :: start
      procedure :: check => check_blocks
      procedure :: next
      procedure :: conclude
   end type mission_analysis

contains

   subroutine start(self, case, run, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(wear_patches) :: patches
      type(wear_outcome) :: outcome
      integer :: b

      self%run => run
      self%case => case
      allocate (self%blocks(case%mission%n_blocks), self%restart_rows, self%record, self%over, &
                self%now)
      do b = 1, size(self%blocks)
         call self%blocks(b)%build(case, b, run, error)
         if (allocated(error)) return
      end do
      patches%contact => case%contact
      patches%cycles_units = 'cycles'
      call run%writer%add(patches, error)
      outcome%steady_state = trim(steady_words(steady_not_reached))
      outcome%ending = 'incomplete'
      if (.not. allocated(error)) call run%writer%add(outcome, error)
      if (allocated(error)) return
      if (case%mission%keeps_order()) then
         self%n_expected = 1 + case%mission%n_blocks*case%mission%n_flights
      end if
      call run%begin_points(case, self, self%n_expected)
   end subroutine start

   !> What would refuse a block.
   subroutine check_blocks(self, case, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(case_type), allocatable :: block
      integer :: b

      associate (unused => self)
      end associate
      do b = 1, case%mission%n_blocks
         allocate (block)
         call read_block(case, b, block, error)
         if (.not. allocated(error)) call check_one(block, error)
         if (allocated(error)) return
         deallocate (block)
      end do
   end subroutine check_blocks

   subroutine check_one(block, error)
      type(case_type), intent(in) :: block
      type(error_type), allocatable, intent(out) :: error
      type(balance_problem), target :: problem
      type(balance_state) :: system

      call build_system(block, problem, system, error)
   end subroutine check_one

   !> All flights: rows are handed on as they come.
   subroutine next(self, case, observer, point, more, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      associate (unused => observer, unused_point => point)
      end associate
      more = .false.
      if (allocated(self%over%ending)) return
      call begin(self, error)
      if (.not. allocated(error) .and. .not. allocated(self%over%ending)) then
         call fly_on(self, case, error)
      end if
      call self%restart_rows%close()
      self%falls_short = .not. self%over%complete
   end subroutine next

   !> The unworn joint in the first block, or the place where an earlier run ended.
   subroutine begin(self, error)
      type(mission_analysis), intent(inout), target :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      b = maxval([(self%blocks(b)%joint%balance%n, b=1, size(self%blocks))])
      call self%restart_rows%create(self%run%writer%file, self%case%contact, b, error, &
                                    of_mission=.true.)
      if (allocated(error)) return
      call require_memory(real(self%case%contact%n_pairs, wp)*self%case%mission%n_flights, &
                          '&mission n_flights = '//to_text(self%case%mission%n_flights)// &
                          ' with '//to_text(self%case%contact%n_pairs)//' pairs', &
                          'fly fewer, and go on with --restart', error)
      if (allocated(error)) return
      self%now%depth = self%blocks(1)%joint%balance%depth
      self%now%energy = 0.0_wp*self%now%depth
      call self%record%start(self%case%mission, self%now%depth)
      ! The first flight is one by itself: whatever comes is measured by it. Below zero:
      ! flights in their order that come before the next jump.
      self%over%next_cycles = -1.0_wp
      self%over%options = self%blocks(1)%case%wear
      if (self%run%restart%n_rows > 0) then
         call resume(self, self%run%restart, error)
      else
         call take_first(self, error)
      end if
   end subroutine begin

   !> The row of the unworn joint.
   subroutine take_first(self, error)
      type(mission_analysis), intent(inout), target :: self
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      call self%blocks(1)%look(self%now, point, error)
      if (allocated(error)) return
      if (allocated(self%blocks(1)%failure)) then
         self%over%ending = 'nothing was worn: '//trim(self%case%mission%title(1))//': '// &
                            self%blocks(1)%failure
         return
      end if
      call keep_row(self, 1, point)
      call write_rows(self, .false., error)
   end subroutine take_first

   !> Flight after flight, or jump after jump.
   subroutine fly_on(self, case, error)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: n
      logical :: is_cut

      associate (n_blocks => case%mission%n_blocks, now => self%now)
         do
            ! Between two flights.
            if (now%block == 0 .or. now%block == n_blocks .or. self%n_in_jump > 0) then
               call judge(self, case)
               if (allocated(self%over%ending)) return
               now%block = 0
               self%n_in_jump = 0
            end if
            n = wanted_flights(self, case)
            ! With more flights to go it would be another jump. The rest of a flight that is
            ! continued is none: its first rows have been written as they are.
            is_cut = now%block == 0 .and. n < free_flights(self, case)
            if (n > 1 .and. now%block == 0) then
               call jump(self, case, n, is_cut, error)
            else
               if (now%block == 0) call wait_for_jump(self%over%next_cycles)
               call fly_one(self, case, now%block + 1, .not. is_cut, error)
               if (is_cut .and. .not. allocated(error) .and. allocated(self%row)) then
                  call write_rows(self, .true., error)
               end if
            end if
            if (allocated(error) .or. allocated(self%over%ending)) return
         end do
      end associate
   end subroutine fly_on

   !> Flights of the next jump.
   pure integer function wanted_flights(self, case) result(n)
      type(mission_analysis), intent(in) :: self
      type(case_type), intent(in) :: case

      n = min(free_flights(self, case), case%mission%n_flights - self%now%flight)
      if (case%mission%flights_per_jump == 0 .and. n < least_jump) n = 1
   end function wanted_flights

   !> One flight less before the next jump.
   pure subroutine wait_for_jump(next)
      real(wp), intent(inout) :: next

      if (next > 0.0_wp) return
      next = next + 1.0_wp
      if (next >= 0.0_wp) next = least_jump
   end subroutine wait_for_jump

   !> The same without an end.
   pure integer function free_flights(self, case) result(n)
      type(mission_analysis), intent(in) :: self
      type(case_type), intent(in) :: case

      n = max(1, nint(self%over%next_cycles))
      if (case%mission%flights_per_jump > 0) n = case%mission%flights_per_jump
   end function free_flights

   !> A flight, from one of its blocks on; in the order of the blocks.
   subroutine fly_one(self, case, first, writes, error)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: first
      !> Each row at once, not behind the jump that it belongs to.
      logical, intent(in) :: writes
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      if (first == 1) self%now%flight = self%now%flight + 1
      do b = first, case%mission%n_blocks
         call wear_block(self, case, b, case%mission%cycles(b), 1.0_wp, writes, error)
         if (allocated(error) .or. allocated(self%over%ending)) return
      end do
   end subroutine fly_one

   !> Several flights as one: the blocks to and fro. That they go to with more of their cycles than
   !> they come back is the order within one flight; of a single flight nothing comes back.
   subroutine fly_together(self, case, n, error)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: cycles, share
      integer :: b, k, last

      share = 1.0_wp
      if (case%mission%flights_per_jump == 0) share = step_share
      if (n == 1) then
         call fly_one(self, case, 1, .false., error)
         return
      end if
      self%now%flight = self%now%flight + n
      last = case%mission%n_blocks
      do k = 1, 2*last - 1
         b = last - abs(last - k)
         cycles = n*case%mission%cycles(b)
         if (k < last) cycles = 0.5_wp*(n + 1)*case%mission%cycles(b)
         if (k > last) cycles = 0.5_wp*(n - 1)*case%mission%cycles(b)
         call wear_block(self, case, b, cycles, share, .false., error)
         if (allocated(error) .or. allocated(self%over%ending)) return
      end do
   end subroutine fly_together

   !> One march of a block, and its row. A block that fails names the ending.
   subroutine wear_block(self, case, b, cycles, share, writes, error)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
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
         call block%march(cycles, max(tightest, share*case%wear%tolerance()), self%now, point, &
                          stopped, error)
         self%record%n_marches = self%record%n_marches + 1
         if (allocated(error)) return
         call count_steps(block%joint%march, begun, over)
         if (stopped) then
            over%ending = 'stopped by its observer'
         else if (allocated(block%failure)) then
            over%gave_up = .true.
            over%ending = 'flight '//to_text(self%now%flight)//', '// &
                          trim(case%mission%title(b))//': '//block%failure
         end if
         if (allocated(over%ending)) return
         self%now%block = b
         call keep_row(self, b, point)
         if (writes) call write_rows(self, .false., error)
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
   subroutine jump(self, case, wanted, ends_early, error)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
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
      by_error = case%mission%flights_per_jump == 0
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
            call fly_one(self, case, 1, .true., error)
            return
         end if
         half = n
         if (by_error) then
            call fly_together(self, case, n, error)
            if (.not. (allocated(error) .or. allocated(self%over%ending))) then
               whole = self%now%depth
               call step_back(self, before, error)
               if (allocated(error)) return
               half = n/2
            end if
         end if
         if (.not. (allocated(error) .or. allocated(self%over%ending))) then
            call fly_together(self, case, half, error)
         end if
         if (half < n .and. .not. (allocated(error) .or. allocated(self%over%ending))) then
            call fly_together(self, case, n - half, error)
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
            if (difference > 0.0_wp) factor = safety*(case%wear%tolerance()* &
               maxval(self%now%depth)/difference)**(1.0_wp/3.0_wp)
            factor = min(largest_growth, max(smallest_shrink, factor))
            if (difference <= case%wear%tolerance()*maxval(self%now%depth)) exit
            n = max(1, min(n - 1, int(factor*n)))
         else
            exit
         end if
         self%record%n_refused = self%record%n_refused + 1
         call step_back(self, before, error)
         if (allocated(error)) return
      end do
      self%record%n_jumps = self%record%n_jumps + 1
      if (by_error) then
         self%record%error = self%record%error + difference
         self%over%next_cycles = real(max(least_jump, int(factor*n)), wp)
      end if
      self%n_in_jump = n
      call write_rows(self, is_cut, error)
   end subroutine jump

   !> Back to where a jump began; its rows are forgotten.
   subroutine step_back(self, before, error)
      type(mission_analysis), intent(inout), target :: self
      type(mission_state), intent(in) :: before
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      self%now = before
      if (allocated(self%row)) deallocate (self%row)
      do b = 1, size(self%blocks)
         call self%blocks(b)%go_back(error)
         if (allocated(error)) return
      end do
   end subroutine step_back

   !> The row of a march that has just ended.
   subroutine keep_row(self, b, point)
      type(mission_analysis), intent(inout), target :: self
      integer, intent(in) :: b
      type(point_type), intent(in) :: point
      type(row_type), allocatable :: longer(:)
      integer :: n

      n = 0
      if (allocated(self%row)) n = size(self%row)
      allocate (longer(n + 1))
      if (n > 0) longer(:n) = self%row
      associate (row => longer(n + 1), joint => self%blocks(b)%joint)
         row%point = point
         row%point%flight = self%now%flight
         row%point%block = self%now%block
         row%vibration = joint%state%x(:joint%balance%n)
         row%notes = self%blocks(b)%recorder%finer%notes()
         row%spacing = joint%march%resonance%spacing
      end associate
      call move_alloc(longer, self%row)
   end subroutine keep_row

   !> Rows that were waiting. Of a jump all but the last are provisional: a run that is continued
   !> takes all of it or nothing.
   subroutine write_rows(self, is_cut, error)
      type(mission_analysis), intent(inout), target :: self
      !> Another n_flights would have made the jump longer.
      logical, intent(in) :: is_cut
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vibration(:)
      real(wp) :: counts(n_counts)
      integer :: k, longest

      longest = maxval([(self%blocks(k)%joint%balance%n, k=1, size(self%blocks))])
      allocate (vibration(longest))
      counts = [self%record%error, real([self%record%n_jumps, self%record%n_refused, &
                                         self%record%n_marches], wp)]
      do k = 1, size(self%row)
         associate (row => self%row(k), over => self%over)
            vibration = 0.0_wp
            vibration(:size(row%vibration)) = row%vibration
            over%is_provisional = is_cut .or. k < size(self%row)
            over%resonance%spacing = row%spacing
            call self%restart_rows%append(self%run%writer%file, over, vibration, &
                                          row%point%converged, row%notes, error, counts)
            if (.not. allocated(error)) call self%run%writer%add_point(row%point, error)
            if (allocated(error)) return
            call note_row(self, row%point)
            call self%run%observer%on_point(self%n_rows, self%n_expected, row%point)
         end associate
      end do
      deallocate (self%row)
   end subroutine write_rows

   !> A row counts, written now or by an earlier run.
   subroutine note_row(self, point)
      type(mission_analysis), intent(inout), target :: self
      type(point_type), intent(in) :: point

      self%n_rows = self%n_rows + 1
      call self%record%note(point%flight, point%block, point%depth)
      call self%blocks(max(1, point%block))%recorder%count_point(point)
   end subroutine note_row

   !> Whether the mission ends between two flights, and why.
   subroutine judge(self, case)
      type(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      real(wp) :: growth(size(self%now%depth))
      integer :: before

      associate (over => self%over, now => self%now, record => self%record)
         if (now%flight > 0) then
            before = findloc(record%solved(:now%flight - 1), .true., dim=1, back=.true.) - 1
            growth = (now%depth - record%depth(:, before))/(now%flight - before)
            over%largest_rate = max(over%largest_rate, maxval(growth))
            if (maxval(growth) <= case%wear%steady_tolerance*over%largest_rate) then
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
         if (now%flight >= case%mission%n_flights .and. .not. allocated(over%ending)) then
            over%complete = .true.
            over%ending = 'n_flights reached'
         end if
      end associate
   end subroutine judge

   !> As of the march of one case (fw_wear_march), by the growth of a flight: every pair wears, or
   !> bears nothing in any block.
   logical function in_gross_slip(self, growth) result(found)
      type(mission_analysis), intent(inout), target :: self
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

   !> Take over the rows of an earlier run, and stand where it stood.
   subroutine resume(self, restart, error)
      type(mission_analysis), intent(inout), target :: self
      type(restart_type), intent(in) :: restart
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      type(wear_state) :: state
      logical :: agrees
      integer :: b, i, n

      n = restart%n_rows
      if (restart%flight(n) > self%case%mission%n_flights) then
         call fatal_error(error, restart%path//': has flown '//to_text(restart%flight(n))// &
                          ' flights, and mission%n_flights = '// &
                          to_text(self%case%mission%n_flights)//': give at least as many', &
                          status_input)
         return
      end if
      do b = 1, size(self%blocks)
         i = findloc(restart%block(:n), b, dim=1, back=.true.)
         if (i == 0 .and. b == 1) i = 1
         if (i == 0) cycle
         associate (m => self%blocks(b)%joint%balance%n)
            if (m > size(restart%vibrations, 1)) then
               agrees = .false.
            else
               state%x = [restart%vibrations(:m, i), restart%depths(:, i)]
               state%rate = restart%rates(:, i)
               state%residual = restart%residuals(i)
               call self%blocks(b)%come_to(state, restart%points(i)%omega, &
                                           restart%controls(c_spacing, i), agrees, error)
               if (allocated(error)) return
            end if
         end associate
         if (.not. agrees) then
            call fatal_error(error, restart%path//': its joint vibrates otherwise in '// &
                             trim(self%case%mission%title(b))//' than that of this case: its '// &
                             'matrices or loads have changed; start anew, or use &contact worn '// &
                             'to go on from its depths', status_input)
            return
         end if
         call self%blocks(b)%recorder%finer%take_notes(restart%controls(c_noted:, i))
         ! Before its first march a block has not been looked at.
         self%blocks(b)%recorder%has_looked = restart%block(i) > 0
      end do
      call copy_rows(self, restart, error)
      if (allocated(error)) return
      do i = 1, n
         point = restart%points(i)
         point%flight = restart%flight(i)
         point%block = restart%block(i)
         point%depth = restart%depths(:, i)
         call note_row(self, point)
      end do
      call restart%give_control(self%over)
      self%now%cycles = restart%state%cycles
      self%now%flight = restart%flight(n)
      self%now%block = restart%block(n)
      self%now%depth = restart%depths(:, n)
      if (allocated(restart%energy)) self%now%energy = restart%energy
      ! A jump ends with the first block, and the one before was in the same jump.
      if (n > 1 .and. self%now%block == 1) then
         if (restart%flight(n - 1) == self%now%flight) self%n_in_jump = 1
      end if
      associate (record => self%record, counts => restart%mission(:, n))
         record%error = counts(1)
         record%n_jumps = nint(counts(2))
         record%n_refused = nint(counts(3))
         record%n_marches = nint(counts(4))
      end associate
   end subroutine resume

   !> The rows of the earlier run become the first of this result.
   subroutine copy_rows(self, restart, error)
      type(mission_analysis), intent(inout), target :: self
      type(restart_type), intent(in) :: restart
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: source
      type(error_type), allocatable :: ignored

      if (self%run%writer%file%id < 0) return
      !$omp critical (fretwear_io)
      call source%open_read(restart%path, error)
      !$omp end critical (fretwear_io)
      associate (file => self%run%writer%file, n => restart%n_rows)
         if (.not. allocated(error)) call self%restart_rows%copy(file, source, n, error)
         if (.not. allocated(error)) call self%run%writer%copy_points(source, n, error)
      end associate
      !$omp critical (fretwear_io)
      call source%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine copy_rows

   subroutine conclude(self, case, run, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(wear_outcome) :: outcome
      character(60) :: text
      integer :: b

      ! A stop before the first state leaves nothing to tell.
      if (.not. allocated(self%over%ending)) return
      associate (over => self%over, now => self%now)
         call run%observer%on_message('wear: '//over%ending)
         call run%summary%describe_work(self%blocks(1)%joint%balance, &
                                        self%blocks(1)%joint%march%stepper%newton%linear, &
                                        case%solver%kind, run%state%all_converged())
         write (text, '(es13.6, a, es13.6)') maxval(now%depth), ' after ', now%cycles
         call run%summary%line('steady state', trim(steady_words(over%steady)))
         call run%summary%line('largest depth', trim(adjustl(text))//' cycles')
         call run%summary%line('flights', to_text(now%flight)//' of '// &
                               to_text(case%mission%n_flights)//', '// &
                               to_text(self%record%n_marches)//' marches of a block')
         if (self%record%n_jumps > 0) call run%summary%line('jumps', &
            to_text(self%record%n_jumps)//', '//to_text(self%record%n_refused)//' refused')
         call run%summary%line('wear steps', to_text(over%n_steps)//', '// &
                               to_text(over%n_rejected)//' repeated')
         if (run%restart%n_rows > 0) call run%summary%line('continued', 'after '// &
            to_text(run%restart%n_rows)//' rows of '//run%restart%path)
         do b = 1, size(self%blocks)
            call self%blocks(b)%recorder%finer%remark(self%blocks(b)%case, run%summary)
            call self%blocks(b)%recorder%finer%finish()
         end do
         if (self%blocks(1)%is_known) then
            over%options = self%blocks(1)%joint%march%options
            over%stepper%order = self%blocks(1)%joint%march%stepper%order
            call remark_steps(case, over, maxval(now%depth), run%summary)
         end if
         outcome%steady_state = trim(steady_words(over%steady))
         outcome%ending = over%ending
         outcome%counts = [over%n_implicit, over%n_leaps, over%n_jumps]
         call run%writer%add(outcome, error)
         if (.not. allocated(error)) call run%writer%add(self%record, error)
      end associate
   end subroutine conclude

end module fw_mission_response
