!> Turns the states of a march of wear into rows of the result: vibration and contact at the worn
!> depths, what was worn, the friction energy that it took, and whether more harmonics would have
!> worn the same pairs.
module fw_wear_recorder
   use fw_analysis, only: run_type
   use fw_case, only: case_type
   use fw_describe, only: describer
   use fw_error, only: error_type, status_stopped
   use fw_finer_wear, only: finer_wear
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_patches, only: patch_volumes
   use fw_point, only: point_type, served_by_none
   use fw_point_solver, only: point_solver
   use fw_restart_rows, only: restart_row_set
   use fw_response, only: is_lasting
   use fw_strategy, only: new_request, point_request
   use fw_wear_march, only: wear_march, wear_observer
   use fw_wear_options, only: wear_energy, wear_pseudo_time
   use fw_wear_step, only: largest_lag, wear_state
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: wear_recorder, friction_energy, mean_friction

   !> Rows are counted by the state of the run.
   type, extends(wear_observer) :: wear_recorder
      type(case_type), pointer :: case => null()
      type(run_type), pointer :: run => null()
      type(restart_row_set) :: restart_rows
      !> What twice the harmonics say.
      type(finer_wear) :: finer
      !> Friction energy up to the last row (n_pairs) [force*length], and the depths there.
      real(wp), allocatable :: energy(:), depth(:)
      !> Rows written so far, and what makes points of states.
      integer :: n_rows = 0
      type(describer) :: about
   contains
      procedure :: take
      procedure :: make_point
      procedure :: begin_slip
      procedure :: find
      procedure :: allowed_residual
      procedure :: count_point
   end type wear_recorder

contains

   !> A state of the march becomes a row of the result.
   subroutine take(self, march, system, state, iterations, go_on, error)
      class(wear_recorder), intent(inout) :: self
      class(wear_march), intent(in) :: march
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      integer, intent(in) :: iterations
      logical, intent(out) :: go_on
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      go_on = .false.
      call self%make_point(system, state, iterations, point, error)
      if (allocated(error)) return
      ! The pairs that slip before anything is worn.
      if (self%n_rows == 0) call self%finer%look(self%case, march, system, state, &
                                                 state%rate > 0.0_wp)
      call self%about%note_seconds(point)
      call self%restart_rows%append(self%run%writer%file, march, &
                                    state%x(:system%n_vibration()), point%converged, &
                                    self%finer%notes(), error)
      if (allocated(error)) return
      call self%run%writer%add_point(point, error)
      if (allocated(error)) return
      self%n_rows = self%n_rows + 1
      call self%count_point(point)
      call self%run%observer%on_point(self%n_rows, 0, point)
      go_on = .not. self%run%observer%stop_requested
   end subroutine take

   !> What a row says of a state; the friction energy up to it.
   subroutine make_point(self, system, state, iterations, point, error)
      class(wear_recorder), intent(inout) :: self
      !> Evaluated at the state.
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      integer, intent(in) :: iterations
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(solver_report) :: report
      integer :: n

      n = system%n_vibration()
      request = new_request(self%case, system%vibration%frequency())
      ! Energy is that of the forces, whether these are written or not.
      request%contact = .true.
      request%cycle = .false.
      report%iterations = iterations
      report%residual = state%residual
      ! A state of the march is judged as any point is.
      report%converged = is_lasting(system%vibration) .and. &
                         state%residual <= self%allowed_residual()
      call self%about%describe(self%case, request, self%case%harmonics%n_harmonics, &
                               system%vibration, state%x(:n), report, served_by_none, point, error)
      if (allocated(error)) return
      point%cycles = state%cycles
      point%depth = state%x(n + 1:)
      point%wear_rate = state%rate
      point%worn_mu = system%friction()
      point%wear_volume = patch_volumes(self%case%contact, point%depth)
      call add_energy(self, state, point%dissipation, point%worn_mu)
      point%wear_energy = self%energy
      if (.not. self%case%output%contact) then
         deallocate (point%force, point%fraction, point%dissipation)
      end if
   end subroutine make_point

   !> Pairs begin to slip: only for want of harmonics?
   subroutine begin_slip(self, march, system, state, error)
      class(wear_recorder), intent(inout) :: self
      class(wear_march), intent(in) :: march
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      type(error_type), allocatable, intent(out) :: error

      call self%finer%look(self%case, march, system, state, march%begins)
   end subroutine begin_slip

   !> A vibration at held depths by all ways to a first point.
   subroutine find(self, system, x, found, iterations, error)
      class(wear_recorder), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: found
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(point_solver) :: solver
      type(point_request) :: request
      type(point_type) :: point

      found = .false.
      iterations = 0
      request = new_request(self%case, system%vibration%frequency(), self%run%observer)
      ! Of this point the solution alone is wanted.
      request%contact = .false.
      request%histories = .false.
      request%cycle = .false.
      call solver%start(self%case, self%case%harmonics, size(x))
      call self%run%observer%limit_point(self%case%solver%max_seconds)
      call solver%solve(self%case, system%vibration, request, point, error)
      call self%run%observer%limit_point(0.0_wp)
      if (allocated(error)) then
         ! That the run was stopped the march sees itself.
         if (error%status == status_stopped) deallocate (error)
         return
      end if
      iterations = point%iterations
      found = point%converged
      if (found) x = solver%x
   end subroutine find

   !> Residual of a row that counts as converged: steps of pseudo-time are accepted with what their
   !> vibration lags behind the depths, which /residual holds.
   pure real(wp) function allowed_residual(self) result(residual)
      class(wear_recorder), intent(in) :: self

      residual = self%case%solver%tolerance
      if (self%case%wear%scheme == wear_pseudo_time) residual = max(residual, largest_lag)
   end function allowed_residual

   !> Add the friction energy of a step. Its cycles are weighted as its scheme weights them for the
   !> depth: the growth of a pair times its energy over its depth of a cycle, which are two measures
   !> of the same slip, that of forces and displacements and that of the march.
   subroutine add_energy(self, state, dissipation, mu)
      class(wear_recorder), intent(inout) :: self
      type(wear_state), intent(in) :: state
      !> Energy per cycle, friction coefficients (n_pairs).
      real(wp), intent(in) :: dissipation(:), mu(:)
      !> Of a rate, as a part of the largest: below it both are round-off, and the law's own measure
      !> stands in.
      real(wp), parameter :: measurable = 1.0e-6_wp
      real(wp), dimension(size(dissipation)) :: growth, mean, factor
      integer :: n

      n = size(state%x) - size(dissipation)
      if (.not. allocated(self%depth)) then
         self%depth = state%x(n + 1:)
         allocate (self%energy(size(dissipation)), source=0.0_wp)
         return
      end if
      growth = state%x(n + 1:) - self%depth
      mean = mean_friction(self%case, self%depth, state%x(n + 1:))
      ! Under Archard's law the energy of a depth goes with friction, which moves within the step.
      factor = 1.0_wp
      if (self%case%wear%law /= wear_energy) where (mu > 0.0_wp) factor = mean/mu
      where (state%rate > measurable*maxval(state%rate))
         self%energy = self%energy + growth*dissipation/state%rate*factor
      else where
         self%energy = self%energy + friction_energy(self%case, growth + self%case%contact%depth, &
                                                     mean)
      end where
      self%depth = state%x(n + 1:)
   end subroutine add_energy

   !> States on the way of pseudo-time need not be in equilibrium.
   subroutine count_point(self, point)
      class(wear_recorder), intent(inout) :: self
      type(point_type), intent(in) :: point

      if (self%case%wear%scheme == wear_pseudo_time .and. .not. point%converged) then
         call self%run%summary%add_transient(point)
      else
         call self%run%summary%add(point)
         call self%run%state%note(point)
      end if
   end subroutine count_point

   !> Friction energy that the depth worn by this run stands for: both laws wear in proportion
   !> to it.
   pure function friction_energy(case, depth, mu) result(energy)
      type(case_type), intent(in) :: case
      !> Depths, and the mean friction on the way to them (n_pairs).
      real(wp), intent(in) :: depth(:), mu(:)
      real(wp) :: energy(size(depth))

      ! A w/k_w is the friction energy under the law of energy; under Archard's the energy is mu of
      ! it.
      energy = case%contact%area*(depth - case%contact%depth)/case%wear%coefficient
      if (case%wear%law /= wear_energy) energy = mu*energy
   end function friction_energy

   !> Mean friction between two depths.
   pure function mean_friction(case, before, after) result(mean)
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: before(:), after(:)
      real(wp) :: mean(size(before))

      associate (contact => case%contact)
         mean = contact%mu
         if (allocated(contact%worn_friction)) then
            mean = contact%worn_friction%mean_between(contact%mu, before, after)
         end if
      end associate
   end function mean_friction

end module fw_wear_recorder
