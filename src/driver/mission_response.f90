!> A mission (analysis 'wear' with &mission): blocks of cycles in other conditions that wear the
!> same joint in turn, flight after flight.
module fw_mission_response
   use fw_analysis, only: analysis, build_only, run_type
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_memory, only: require_memory
   use fw_mission_block, only: read_block
   use fw_mission_flights, only: mission_flights
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_restart_file, only: restart_type
   use fw_restart_rows, only: c_noted, c_spacing
   use fw_text, only: to_text
   use fw_wear_group, only: wear_outcome, wear_patches
   use fw_wear_march, only: steady_not_reached, steady_words
   use fw_wear_response, only: remark_steps
   use fw_wear_step, only: wear_state
   implicit none (type, external)
   private

   public :: mission_analysis

   !> A mission hands on its rows by itself: a row belongs to a block that has ended, not to a
   !> frequency that is asked for.
   type, extends(analysis) :: mission_analysis
      private
      type(run_type), pointer :: run => null()
      type(case_type), pointer :: case => null()
      type(mission_flights), allocatable :: flights
   contains
      procedure :: start
      procedure :: check => check_blocks
      procedure :: next
      procedure :: conclude
   end type mission_analysis

contains

   !> Read and condense the blocks, and open what the result has beside the rows.
   subroutine start(self, case, run, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(wear_patches) :: patches
      type(wear_outcome) :: outcome

      self%run => run
      self%case => case
      allocate (self%flights)
      call build_blocks(case, run, self%flights, error)
      if (allocated(error)) return
      patches%contact => case%contact
      patches%cycles_units = 'cycles'
      call run%writer%add(patches, error)
      outcome%steady_state = trim(steady_words(steady_not_reached))
      outcome%ending = 'incomplete'
      if (.not. allocated(error)) call run%writer%add(outcome, error)
      if (allocated(error)) return
      call run%begin_points(case, self, self%flights%rows%n_expected)
   end subroutine start

   !> Read and condense the blocks.
   subroutine build_blocks(case, run, flights, error)
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(mission_flights), intent(inout), target :: flights
      type(error_type), allocatable, intent(out) :: error
      integer :: b

      flights%mission => case%mission
      flights%wear => case%wear
      associate (rows => flights%rows)
         allocate (flights%blocks(case%mission%n_blocks), flights%over, flights%now, rows%record)
         rows%run => run
         do b = 1, size(flights%blocks)
            call flights%blocks(b)%build(case, b, run, error)
            if (allocated(error)) return
            rows%longest = max(rows%longest, flights%blocks(b)%joint%balance%n)
         end do
         if (case%mission%keeps_order()) then
            rows%n_expected = 1 + case%mission%n_blocks*case%mission%n_flights
         end if
      end associate
   end subroutine build_blocks

   !> What would refuse a block.
   subroutine check_blocks(self, case, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      class(case_type), allocatable :: block
      integer :: b

      do b = 1, case%mission%n_blocks
         allocate (block)
         call read_block(case, b, block, error)
         if (.not. allocated(error)) call build_only(self, block, error)
         if (allocated(error)) return
         deallocate (block)
      end do
   end subroutine check_blocks

   !> All flights: rows are handed on as they come.
   subroutine next(self, case, observer, point, more, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      associate (unused => observer, unused_case => case, unused_point => point)
      end associate
      more = .false.
      associate (flights => self%flights)
         if (allocated(flights%over%ending)) return
         call begin(self%case, self%run, flights, error)
         if (.not. (allocated(error) .or. allocated(flights%over%ending))) then
            call flights%fly_on(error)
         end if
         call flights%rows%for_restart%close()
         self%falls_short = .not. flights%over%complete
      end associate
   end subroutine next

   !> The unworn joint in the first block, or the place where an earlier run ended.
   subroutine begin(case, run, flights, error)
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout) :: run
      type(mission_flights), intent(inout), target :: flights
      type(error_type), allocatable, intent(out) :: error

      call flights%rows%for_restart%create(run%writer%file, case%contact, flights%rows%longest, &
                                           error, of_mission=.true.)
      if (allocated(error)) return
      call require_memory(real(case%contact%n_pairs, wp)*case%mission%n_flights, &
                          '&mission n_flights = '//to_text(case%mission%n_flights)// &
                          ' with '//to_text(case%contact%n_pairs)//' pairs', &
                          'fly fewer, and go on with --restart', error)
      if (allocated(error)) return
      flights%now%depth = flights%blocks(1)%joint%balance%depth
      flights%now%energy = 0.0_wp*flights%now%depth
      call flights%rows%record%start(case%mission, flights%now%depth)
      ! The first flight is one by itself: whatever comes is measured by it. Below zero:
      ! flights in their order that come before the next jump.
      flights%over%next_cycles = -1.0_wp
      flights%over%options = flights%blocks(1)%case%wear
      if (run%restart%n_rows > 0) then
         call resume(case, run%restart, flights, error)
      else
         call take_first(case, flights, error)
      end if
   end subroutine begin

   !> The row of the unworn joint.
   subroutine take_first(case, flights, error)
      type(case_type), intent(in) :: case
      type(mission_flights), intent(inout), target :: flights
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      call flights%blocks(1)%look(flights%now, point, error)
      if (allocated(error)) return
      if (allocated(flights%blocks(1)%failure)) then
         flights%over%ending = 'nothing was worn: '//trim(case%mission%title(1))//': '// &
                            flights%blocks(1)%failure
         return
      end if
      call flights%rows%keep(flights%blocks(1), flights%now, point)
      call flights%write_down(.false., error)
   end subroutine take_first

   !> Take over the rows of an earlier run, and stand where it stood.
   subroutine resume(case, restart, flights, error)
      type(case_type), intent(in) :: case
      type(restart_type), intent(in) :: restart
      type(mission_flights), intent(inout), target :: flights
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      type(wear_state) :: state
      logical :: agrees
      integer :: b, i, n

      n = restart%n_rows
      if (restart%flight(n) > case%mission%n_flights) then
         call fatal_error(error, restart%path//': has flown '//to_text(restart%flight(n))// &
                          ' flights, and mission%n_flights = '// &
                          to_text(case%mission%n_flights)//': give at least as many', &
                          status_input)
         return
      end if
      do b = 1, size(flights%blocks)
         i = findloc(restart%block(:n), b, dim=1, back=.true.)
         if (i == 0 .and. b == 1) i = 1
         if (i == 0) cycle
         associate (m => flights%blocks(b)%joint%balance%n)
            if (m > size(restart%vibrations, 1)) then
               agrees = .false.
            else
               state%x = [restart%vibrations(:m, i), restart%depths(:, i)]
               state%rate = restart%rates(:, i)
               state%residual = restart%residuals(i)
               call flights%blocks(b)%come_to(state, restart%points(i)%omega, &
                                           restart%controls(c_spacing, i), agrees, error)
               if (allocated(error)) return
            end if
         end associate
         if (.not. agrees) then
            call fatal_error(error, restart%path//': its joint vibrates otherwise in '// &
                             trim(case%mission%title(b))//' than that of this case: its '// &
                             'matrices or loads have changed; start anew, or use &contact worn '// &
                             'to go on from its depths', status_input)
            return
         end if
         call flights%blocks(b)%recorder%finer%take_notes(restart%controls(c_noted:, i))
         ! Before its first march a block has not been looked at.
         flights%blocks(b)%recorder%has_looked = restart%block(i) > 0
      end do
      call flights%rows%copy(restart, error)
      if (allocated(error)) return
      do i = 1, n
         point = restart%points(i)
         point%flight = restart%flight(i)
         point%block = restart%block(i)
         point%depth = restart%depths(:, i)
         call flights%rows%note(flights%blocks, point)
      end do
      call restart%give_control(flights%over)
      flights%now%cycles = restart%state%cycles
      flights%now%flight = restart%flight(n)
      flights%now%block = restart%block(n)
      flights%now%depth = restart%depths(:, n)
      if (allocated(restart%energy)) flights%now%energy = restart%energy
      ! A jump ends with the first block, and the one before was in the same jump.
      if (n > 1 .and. flights%now%block == 1) then
         if (restart%flight(n - 1) == flights%now%flight) flights%n_in_jump = 1
      end if
      associate (record => flights%rows%record, counts => restart%mission(:, n))
         record%error = counts(1)
         record%n_jumps = nint(counts(2))
         record%n_refused = nint(counts(3))
         record%n_marches = nint(counts(4))
      end associate
   end subroutine resume

   !> How the wear ended, and the work of all blocks.
   subroutine conclude(self, case, run, error)
      class(mission_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(wear_outcome) :: outcome
      character(60) :: text
      integer :: b

      ! A stop before the first state leaves nothing to tell.
      if (.not. allocated(self%flights%over%ending)) return
      associate (over => self%flights%over, now => self%flights%now, &
                 record => self%flights%rows%record, blocks => self%flights%blocks)
         call run%observer%on_message('wear: '//over%ending)
         call run%summary%describe_work(blocks(1)%joint%balance, &
                                        blocks(1)%joint%march%stepper%newton%linear, &
                                        case%solver%kind, run%state%all_converged())
         write (text, '(es13.6, a, es13.6)') maxval(now%depth), ' after ', now%cycles
         call run%summary%line('steady state', trim(steady_words(over%steady)))
         call run%summary%line('largest depth', trim(adjustl(text))//' cycles')
         call run%summary%line('flights', to_text(now%flight)//' of '// &
                               to_text(case%mission%n_flights)//', '// &
                               to_text(record%n_marches)//' marches of a block')
         if (record%n_jumps > 0) call run%summary%line('jumps', &
            to_text(record%n_jumps)//', '//to_text(record%n_refused)//' refused')
         call run%summary%line('wear steps', to_text(over%n_steps)//', '// &
                               to_text(over%n_rejected)//' repeated')
         if (run%restart%n_rows > 0) call run%summary%line('continued', 'after '// &
            to_text(run%restart%n_rows)//' rows of '//run%restart%path)
         do b = 1, size(blocks)
            call blocks(b)%recorder%finer%remark(blocks(b)%case, run%summary)
            call blocks(b)%recorder%finer%finish()
         end do
         if (blocks(1)%is_known) then
            over%options = blocks(1)%joint%march%options
            over%stepper%order = blocks(1)%joint%march%stepper%order
            call remark_steps(case, over, maxval(now%depth), run%summary)
         end if
         outcome%steady_state = trim(steady_words(over%steady))
         outcome%ending = over%ending
         outcome%counts = [over%n_implicit, over%n_leaps, over%n_jumps]
         call run%writer%add(outcome, error)
         if (.not. allocated(error)) call run%writer%add(record, error)
      end associate
   end subroutine conclude

end module fw_mission_response
