!> A solved vibration becomes a point: all that is known of it but what one kind of vibration adds
!> of its own, as the load of a given amplitude.
module fw_describe
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_cycle_recovery, only: recover_cycle
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_recovery, only: recover_histories, recover_point
   use fw_sensitivity_solver, only: sensitivity_solver
   use fw_stability_solver, only: stability_solver
   use fw_strategy, only: point_request
   use fw_stress_recovery, only: stress_recovery
   use fw_tail, only: recover_tail
   implicit none (type, external)
   private

   public :: describer

   !> Serves all points of one number of harmonics.
   type :: describer
      type(stability_solver) :: stability
      !> Derivatives take the equations that were solved: whoever has these finds them.
      type(sensitivity_solver) :: sensitivity
      class(stress_recovery), allocatable, private :: stress
      integer(int64), private :: clock = 0
   contains
      procedure :: start_clock
      procedure :: describe
      procedure :: note_seconds
   end type describer

contains

   !> The work on a point begins.
   subroutine start_clock(self)
      class(describer), intent(inout) :: self

      call system_clock(self%clock)
   end subroutine start_clock

   !> Fill a point from the solution x, where the system was evaluated last. Of one that failed as
   !> well: it is written with its mark.
   subroutine describe(self, case, request, n_harmonics, system, x, report, served_by, point, error)
      class(describer), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Where the point lies, and what is asked of it.
      type(point_request), intent(in) :: request
      !> H of the result, whatever harmonics were computed.
      integer, intent(in) :: n_harmonics
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(solver_report), intent(in) :: report
      !> What gave the solution.
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error

      point%omega = request%omega
      if (case%sweep%speed_order > 0.0_wp) point%speed = request%omega/case%sweep%speed_order
      point%place = request%place()
      point%load_scale = case%model%harmonic_scale*system%load_factor(static=.false.)
      if (allocated(case%model%base_parts)) then
         point%base = case%model%motion_of_base(point%omega, point%load_scale, n_harmonics)
      end if
      point%n_harmonics = n_harmonics
      point%n_time = system%problem%fourier%n_time
      point%converged = report%converged
      point%residual = report%residual
      point%iterations = report%iterations
      if (report%converged) point%served_by = served_by
      call recover_point(system, x, n_harmonics, request%contact, point)
      call recover_tail(system, case%model, case%contact, point%omega, case%output%tail, point)
      associate (n_coordinates => size(system%balance, 1))
         if (request%histories) call recover_histories(system, n_coordinates, x, n_harmonics, point)
         if (request%cycle) call recover_cycle(system, n_coordinates, x, point)
      end associate
      if (case%stress%is_wanted()) then
         if (.not. allocated(self%stress)) allocate (self%stress)
         call self%stress%find(case, system, x, n_harmonics, point, error)
         if (allocated(error)) return
      end if
      if (report%converged .and. request%stability) then
         call self%stability%find(case, system, x, point, error)
      end if
   end subroutine describe

   !> Seconds since the clock was started or read: those of a point hold what was solved to find it.
   subroutine note_seconds(self, point)
      class(describer), intent(inout) :: self
      type(point_type), intent(inout) :: point
      integer(int64) :: now, rate

      call system_clock(now, rate)
      point%seconds = real(now - self%clock, wp)/real(rate, wp)
      self%clock = now
   end subroutine note_seconds

end module fw_describe
