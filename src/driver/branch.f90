!> A frequency response along its branch, through folds: continuation = 'arclength'.
module fw_branch
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type
   use fw_continuation, only: branch_observer
   use fw_error, only: error_type
   use fw_harmonics_options, only: method_hdhb
   use fw_hbm, only: hbm_system
   use fw_hdhb, only: hdhb_system
   use fw_hdhb, only: new_hdhb
   use fw_newton, only: solver_report
   use fw_newton, only: tight_forcing
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_point, only: served_by_arclength
   use fw_point_solver, only: point_solver
   use fw_recovery, only: recover_histories
   use fw_recovery, only: recover_point
   use fw_result, only: result_writer
   use fw_solution, only: find_stability
   use fw_solution, only: is_lasting
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: run_branch

   !> First step where n_points leaves the choice: this part of the interval.
   integer, parameter :: default_steps = 100

   !> Turns branch points into results.
   type, extends(branch_observer) :: branch_recorder
      type(case_type), pointer :: case => null()
      type(hbm_system), pointer :: system => null()
      type(hdhb_system), pointer :: in_time => null()
      class(observer_type), pointer :: observer => null()
      type(result_writer), pointer :: writer => null()
      type(summary_type), pointer :: summary => null()
      integer :: n_points = 0
      integer(int64) :: clock = 0
      real(wp), allocatable :: r(:)
   contains
      procedure :: take
   end type branch_recorder

contains

   !> The first point as in a natural sweep, then along the branch until a bound or max_points.
   subroutine run_branch(case, system, solver, observer, writer, summary, error)
      type(case_type), intent(in), target :: case
      type(hbm_system), intent(inout), target :: system
      type(point_solver), intent(inout) :: solver
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(error_type), allocatable, intent(out) :: error
      type(branch_recorder) :: recorder
      type(arclength_type) :: branch
      type(hdhb_system), target :: in_time
      type(point_type) :: point
      real(wp), allocatable :: values(:)

      ! What the first point leaves, the whole path inherits.
      solver%method%newton%loosest = tight_forcing
      call solver%solve(case, system, case%sweep%start, point, error)
      if (allocated(error)) return
      allocate (recorder%r(system%n))
      recorder%case => case
      recorder%system => system
      recorder%observer => observer
      recorder%writer => writer
      recorder%summary => summary
      call system_clock(recorder%clock)
      call publish(recorder, point, error)
      if (allocated(error)) return
      if (.not. point%converged) then
         call observer%on_message('the first point did not converge: no branch to follow')
         return
      end if
      if (observer%stop_requested) then
         call summary%mark_incomplete()
         return
      end if
      branch%options = case%solver
      branch%start = case%sweep%start
      branch%finish = case%sweep%end
      branch%max_points = case%sweep%max_points
      branch%x_scale = displacement_scale(system)
      branch%step = 1.0_wp/real(default_steps, wp)
      if (case%sweep%n_points > 1) branch%step = 1.0_wp/real(case%sweep%n_points - 1, wp)
      if (case%harmonics%method == method_hdhb) then
         in_time = new_hdhb(system)
         recorder%in_time => in_time
         allocate (values(system%n))
         call in_time%to_values(system%structure%n_coordinates, solver%x, values)
         call branch%trace(in_time, values, recorder, error)
      else
         call branch%trace(system, solver%x, recorder, error)
      end if
      call solver%method%newton%linear%add_work(branch%linear)
      if (allocated(error)) return
      call observer%on_message('branch: '//branch%ending)
      if (branch%runs_away .and. case%contact%n_pairs > 0) then
         call observer%on_message('from this frequency on the contact no longer holds the '// &
            'structure in place: all of it slips, and no periodic response exists without a '// &
            'support in that direction')
      end if
      if (.not. branch%complete) call summary%mark_incomplete()
   end subroutine run_branch

   !> The size of displacements to expect, for a branch that may start fully stuck: what the load
   !> makes of the stiffness of the joint.
   pure real(wp) function displacement_scale(system) result(scale)
      type(hbm_system), intent(in) :: system

      scale = 0.0_wp
      if (any(system%stiffness > 0.0_wp)) then
         scale = system%reference/maxval(system%stiffness)
      end if
   end function displacement_scale

   !> A converged point of the branch becomes a row of the result.
   subroutine take(self, x, p, report, fold, error)
      class(branch_recorder), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: p
      type(solver_report), intent(in) :: report
      logical, intent(in) :: fold
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      real(wp), allocatable :: coefficients(:)
      integer(int64) :: clock, rate

      ! A fold is located by steps of its own: the system may stand at another frequency.
      call self%system%set_frequency(p, error)
      if (allocated(error)) return
      coefficients = x
      if (associated(self%in_time)) then
         call self%in_time%to_coefficients(self%system%structure%n_coordinates, x, coefficients)
      end if
      call self%system%residual(coefficients, self%r)
      point%omega = p
      point%converged = report%converged
      if (point%converged) point%converged = is_lasting(self%system)
      if (point%converged) point%served_by = served_by_arclength
      point%iterations = report%iterations
      point%residual = report%residual
      point%fold = fold
      call recover_point(self%system, coefficients, self%case%harmonics%n_harmonics, &
                         self%case%output%contact, point)
      if (self%case%output%histories) then
         call recover_histories(self%system, size(self%system%balance, 1), coefficients, &
                                self%case%harmonics%n_harmonics, point)
      end if
      if (point%converged .and. self%case%sweep%stability) then
         call find_stability(self%system, self%case%model, coefficients, point, error)
         if (allocated(error)) return
      end if
      call system_clock(clock, rate)
      point%seconds = real(clock - self%clock, wp)/real(rate, wp)
      self%clock = clock
      call publish(self, point, error)
   end subroutine take

   subroutine publish(self, point, error)
      class(branch_recorder), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%writer%add_point(point, error)
      if (allocated(error)) return
      self%n_points = self%n_points + 1
      call self%summary%add(point)
      ! How many points a branch takes is not known beforehand.
      call self%observer%on_point(self%n_points, 0, point)
      self%stop_requested = self%observer%stop_requested
   end subroutine publish

end module fw_branch
