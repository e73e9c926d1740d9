!> One block of a mission at work: a joint in conditions of its own, which keeps its condensation
!> and its last vibration and wears on from the depths that it is given.
module fw_block_march
   use fw_analysis, only: run_type
   use fw_case, only: case_type
   use fw_diagnosis, only: explain_failure
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mission_block, only: read_block
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_remarks, only: remark_undetermined
   use fw_resonance, only: resonance_type
   use fw_wear_joint, only: stand_at, wear_joint
   use fw_wear_march, only: wear_march
   use fw_wear_recorder, only: wear_recorder
   use fw_wear_step, only: wear_state
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: block_type, mission_state

   !> Residual that a vibration that was read back may gain, over the vibratory load.
   real(wp), parameter :: same_residual = 1.0e-6_wp

   !> What passes from block to block.
   type :: mission_state
      !> Cycles and flights so far, and the last block (0: before the first).
      real(wp) :: cycles = 0.0_wp
      integer :: flight = 0, block = 0
      !> Depth and friction energy (n_pairs).
      real(wp), allocatable :: depth(:), energy(:)
   end type mission_state

   !> Keeps the last state of a march as a point; rows are written by the mission.
   type, extends(wear_recorder) :: block_recorder
      logical :: has_looked = .false., is_begun = .false.
      integer :: iterations = 0
      type(point_type), allocatable :: last
   contains
      procedure :: take
   end type block_recorder

   !> A vibration to go back to: its unknowns with the depths, its frequency, and the distance that
   !> its resonance is sought with.
   type :: kept_vibration
      type(wear_state) :: state
      real(wp) :: omega = 0.0_wp, spacing = 0.0_wp
   end type kept_vibration

   !> Not to be moved once it is built.
   type :: block_type
      class(case_type), allocatable :: case
      class(wear_joint), allocatable :: joint
      type(block_recorder) :: recorder
      !> It has a vibration.
      logical :: is_known = .false.
      type(kept_vibration), private :: kept
      !> Why the last march failed; not allocated where it came to its end.
      character(:), allocatable :: failure
   contains
      procedure :: build
      procedure :: look
      procedure :: march
      procedure :: keep
      procedure :: go_back
      procedure :: come_to
      procedure :: omega
   end type block_type

contains

   !> Read and condense a block.
   subroutine build(self, case, number, run, error)
      class(block_type), intent(inout), target :: self
      !> Of the mission.
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      allocate (self%case, self%joint)
      call read_block(case, number, self%case, error)
      if (allocated(error)) return
      call self%joint%build(self%case, error, held=self%recorder%finer%held)
      if (allocated(error)) return
      self%recorder%case => self%case
      self%recorder%run => run
      call self%recorder%about%start_clock()
   end subroutine build

   !> What a row says of the joint before any wear.
   subroutine look(self, state, point, error)
      class(block_type), intent(inout), target :: self
      type(mission_state), intent(in) :: state
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      integer :: iterations

      call settle_first(self, state%depth, iterations, error)
      if (allocated(error) .or. allocated(self%failure)) return
      self%recorder%depth = state%depth
      self%recorder%energy = state%energy
      call self%recorder%make_point(self%joint%system, self%joint%state, iterations, point, error)
      call self%recorder%about%note_seconds(point)
   end subroutine look

   !> Wear on for some cycles. Where it fails (see `failure`) or was stopped, the state stays.
   subroutine march(self, n_cycles, tolerance, state, point, stopped, error)
      class(block_type), intent(inout), target :: self
      real(wp), intent(in) :: n_cycles
      !> Error of a step, where it is smaller than that of the case.
      real(wp), intent(in) :: tolerance
      type(mission_state), intent(inout) :: state
      !> What a row says of the end.
      type(point_type), intent(out) :: point
      logical, intent(out) :: stopped
      type(error_type), allocatable, intent(out) :: error
      integer :: iterations

      if (allocated(self%failure)) deallocate (self%failure)
      stopped = .false.
      call self%joint%march%begin_anew()
      call settle(self, state%depth, iterations, error)
      if (allocated(error)) return
      associate (joint => self%joint, recorder => self%recorder)
         if (.not. allocated(self%failure)) then
            joint%march%is_part = .true.
            joint%march%options%n_cycles = n_cycles
            if (joint%march%options%controls_error()) joint%march%options%error_tolerance = &
               min(tolerance, joint%march%options%tolerance())
            joint%state%cycles = 0.0_wp
            recorder%depth = state%depth
            recorder%energy = state%energy
            recorder%is_begun = .false.
            recorder%iterations = iterations
            call joint%march%run(joint%system, joint%state, recorder, error)
            if (allocated(error)) return
            call note_failure(self)
         end if
         stopped = recorder%run%observer%stop_requested .and. .not. joint%march%complete
         if (allocated(self%failure) .or. stopped) return
         if (allocated(recorder%last)) then
            point = recorder%last
         else
            call recorder%make_point(joint%system, joint%state, recorder%iterations, point, error)
         end if
         if (allocated(error)) return
         point%iterations = recorder%iterations
         state%depth = point%depth
         state%energy = point%wear_energy
         state%cycles = state%cycles + n_cycles
         point%cycles = state%cycles
         call recorder%about%note_seconds(point)
      end associate
   end subroutine march

   !> Bring the vibration to depths: by all ways where there is none yet, else from the last one.
   subroutine settle(self, depth, iterations, error)
      class(block_type), intent(inout), target :: self
      real(wp), intent(in) :: depth(:)
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      integer :: more, n
      logical :: moves

      iterations = 0
      n = self%joint%balance%n
      if (.not. self%is_known) then
         call settle_first(self, depth, iterations, error)
         return
      end if
      associate (joint => self%joint)
         moves = any(abs(joint%state%x(n + 1:) - depth) > 0.0_wp)
         if (.not. moves) then
            call stand_at(joint%system, joint%state%x)
            call joint%set_steps(self%case)
            return
         end if
         joint%state%x(n + 1:) = depth
         call joint%march%stepper%settle(joint%system, joint%state, report)
         iterations = report%iterations
         if (.not. report%converged .and. .not. joint%system%is_interrupted()) then
            ! As where the joint jumps: anew, then for its rates from there.
            joint%system%vibration%depth = depth
            call joint%system%hold_depths(.true.)
            call self%recorder%find(joint%system, joint%state%x(:n), report%converged, more, error)
            call joint%system%hold_depths(.false.)
            iterations = iterations + more
            if (allocated(error)) return
            if (report%converged) then
               call joint%march%stepper%settle(joint%system, joint%state, report)
            end if
         end if
         if (.not. report%converged) then
            self%failure = 'no vibration was found at the depths that the blocks before have left'
            return
         end if
         call joint%begin_march(self%case, iterations, error)
      end associate
   end subroutine settle

   !> The first vibration, at depths that other blocks may have left.
   subroutine settle_first(self, depth, iterations, error)
      class(block_type), intent(inout), target :: self
      real(wp), intent(in) :: depth(:)
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      iterations = 0
      associate (joint => self%joint, run => self%recorder%run)
         ! Ways that build a balance of their own take the depths of the case.
         self%case%contact%depth = depth
         joint%balance%depth = depth
         call joint%solve(self%case, run%observer, point, error)
         if (allocated(error)) return
         call remark_undetermined(joint%solver%method%undetermined, run%summary%remarks)
         if (.not. point%converged) then
            call explain_failure(joint%balance, joint%solver%method, self%failure)
            return
         end if
         call joint%prepare(self%case, run%observer)
         call joint%take_solution(point%residual)
         iterations = point%iterations
         call joint%begin_march(self%case, iterations, error)
         self%is_known = .true.
      end associate
   end subroutine settle_first

   !> Why a march did not come to its end, unless it was stopped.
   subroutine note_failure(self)
      class(block_type), intent(inout), target :: self
      character(:), allocatable :: reason

      associate (joint => self%joint)
         if (joint%march%complete .or. joint%system%is_interrupted()) return
         if (self%recorder%run%observer%stop_requested) return
         self%failure = joint%march%ending
         if (.not. joint%march%gave_up) return
         joint%balance%depth = joint%state%x(joint%balance%n + 1:)
         call explain_failure(joint%balance, joint%solver%method, reason)
         self%failure = self%failure//': '//reason
      end associate
   end subroutine note_failure

   !> Remember the vibration.
   subroutine keep(self)
      class(block_type), intent(inout) :: self

      if (.not. self%is_known) return
      self%kept%state = self%joint%state
      self%kept%omega = self%omega()
      self%kept%spacing = self%joint%march%resonance%spacing
   end subroutine keep

   !> Back to the vibration that was kept; of a block that had none its first one stays.
   subroutine go_back(self, error)
      class(block_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      if (.not. allocated(self%kept%state%x)) return
      self%joint%state = self%kept%state
      self%joint%march%resonance%spacing = self%kept%spacing
      call self%joint%system%set_parameter(self%kept%omega, error)
   end subroutine go_back

   !> Stand where an earlier run stood with this block; false where that is no vibration of it.
   subroutine come_to(self, state, omega, spacing, agrees, error)
      class(block_type), intent(inout), target :: self
      type(wear_state), intent(in) :: state
      real(wp), intent(in) :: omega, spacing
      logical, intent(out) :: agrees
      type(error_type), allocatable, intent(out) :: error

      agrees = .false.
      associate (joint => self%joint)
         call joint%prepare(self%case, self%recorder%run%observer)
         joint%state = state
         joint%march%resonance = resonance_type(n_harmonics=self%case%harmonics%n_harmonics, &
                                                first=self%case%sweep%start, spacing=spacing)
         call joint%system%set_parameter(omega, error)
         if (allocated(error)) return
         call stand_at(joint%system, state%x)
         call joint%set_steps(self%case)
         call joint%march%stepper%evaluate(joint%system, joint%state)
         agrees = abs(joint%state%residual - state%residual) <= same_residual
         joint%state = state
         call stand_at(joint%system, joint%state%x)
      end associate
      self%is_known = .true.
      self%recorder%has_looked = .true.
   end subroutine come_to

   !> [rad/s]
   pure real(wp) function omega(self)
      class(block_type), intent(in) :: self

      omega = self%joint%balance%frequency()
   end function omega

   !> A state of the march: what it took is counted, and the last one is kept.
   subroutine take(self, march, system, state, iterations, go_on, error)
      class(block_recorder), intent(inout) :: self
      class(wear_march), intent(in) :: march
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      integer, intent(in) :: iterations
      logical, intent(out) :: go_on
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      go_on = .not. self%run%observer%stop_requested
      if (.not. self%is_begun) then
         ! Nothing has been worn yet.
         self%is_begun = .true.
         if (allocated(self%last)) deallocate (self%last)
         if (.not. self%has_looked) call self%finer%look(self%case, march, system, state, &
                                                         state%rate > 0.0_wp)
         self%has_looked = .true.
         return
      end if
      self%iterations = self%iterations + iterations
      call self%make_point(system, state, self%iterations, point, error)
      if (.not. allocated(error)) self%last = point
   end subroutine take

end module fw_block_march
