!> A frequency response along its branch, through folds: continuation = 'arclength'.
module fw_branch
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type
   use fw_continuation, only: branch_point
   use fw_error, only: error_type
   use fw_harmonics_options, only: method_hdhb
   use fw_hbm, only: hbm_system
   use fw_hdhb, only: hdhb_system
   use fw_hdhb, only: new_hdhb
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

   public :: branch_type, run_branch

   !> First step where n_points leaves the choice: this part of the interval.
   integer, parameter :: default_steps = 100

   !> The points of a branch as points of a result, one after the other.
   type :: branch_type
      type(arclength_type) :: curve
      type(hbm_system), pointer :: system => null()
      !> The balance with values at instants as unknowns, where `hdhb` is asked for.
      type(hdhb_system) :: in_time
      logical :: is_in_time = .false.
      integer(int64) :: clock = 0
      real(wp), allocatable :: r(:)
   contains
      procedure :: begin
      procedure :: next
      procedure :: closing_words
   end type branch_type

contains

   !> The first point as in a natural sweep, then along the branch until a bound or max_points.
   subroutine run_branch(case, system, solver, observer, writer, summary, error)
      type(case_type), intent(in) :: case
      type(hbm_system), intent(inout), target :: system
      type(point_solver), intent(inout) :: solver
      class(observer_type), intent(inout) :: observer
      type(result_writer), intent(inout) :: writer
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(out) :: error
      type(branch_type) :: branch
      type(point_type) :: point
      integer :: n_points
      logical :: more

      ! What the first point leaves, the whole path inherits.
      solver%method%newton%loosest = tight_forcing
      call solver%solve(case, system, case%sweep%start, point, error)
      if (allocated(error)) return
      n_points = 0
      call publish(point, n_points, observer, writer, summary, error)
      if (allocated(error)) return
      if (.not. point%converged) then
         call observer%on_message('the first point did not converge: no branch to follow')
         return
      end if
      call branch%begin(case, system, solver%x, error)
      do while (.not. (allocated(error) .or. observer%stop_requested))
         call branch%next(case, point, more, error)
         if (allocated(error) .or. .not. more) exit
         call publish(point, n_points, observer, writer, summary, error)
      end do
      call solver%method%newton%linear%add_work(branch%curve%linear)
      if (allocated(error)) return
      call observer%on_message(branch%closing_words(case))
      if (.not. branch%curve%complete) call summary%mark_incomplete()
   end subroutine run_branch

   !> Start at a converged point x of the system at sweep%start, which counts as the first of
   !> sweep%max_points. The system has to outlive the branch.
   subroutine begin(self, case, system, x, error)
      class(branch_type), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: values(:)

      self%system => system
      call system_clock(self%clock)
      allocate (self%r(system%n))
      associate (curve => self%curve)
         curve%options = case%solver
         curve%start = case%sweep%start
         curve%finish = case%sweep%end
         curve%max_points = case%sweep%max_points
         curve%x_scale = displacement_scale(system)
         curve%step = 1.0_wp/real(default_steps, wp)
         if (case%sweep%n_points > 1) curve%step = 1.0_wp/real(case%sweep%n_points - 1, wp)
      end associate
      self%is_in_time = case%harmonics%method == method_hdhb
      if (self%is_in_time) then
         self%in_time = new_hdhb(system)
         allocate (values(system%n))
         call self%in_time%to_values(system%structure%n_coordinates, x, values)
         call self%curve%begin(self%in_time, values, error)
      else
         call self%curve%begin(system, x, error)
      end if
   end subroutine begin

   !> The next point of the branch; `more` is false where there is none.
   subroutine next(self, case, point, more, error)
      class(branch_type), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: found
      integer(int64) :: clock, rate

      if (self%is_in_time) then
         call self%curve%next(self%in_time, found, more, error)
      else
         call self%curve%next(self%system, found, more, error)
      end if
      if (allocated(error) .or. .not. more) return
      call describe(self, case, found, point, error)
      call system_clock(clock, rate)
      point%seconds = real(clock - self%clock, wp)/real(rate, wp)
      self%clock = clock
   end subroutine next

   !> Why the branch ended, once it has.
   function closing_words(self, case) result(words)
      class(branch_type), intent(in) :: self
      type(case_type), intent(in) :: case
      character(:), allocatable :: words

      if (.not. self%curve%ended) then
         words = 'branch: stopped by the user'
         return
      end if
      words = 'branch: '//self%curve%ending
      if (self%curve%runs_away .and. case%contact%n_pairs > 0) then
         words = words//': from this frequency on the contact no longer holds the structure '// &
                 'in place: all of it slips, and no periodic response exists without a support '// &
                 'in that direction'
      end if
   end function closing_words

   !> The size of displacements to expect, for a branch that may start fully stuck: what the load
   !> makes of the stiffness of the joint.
   pure real(wp) function displacement_scale(system) result(scale)
      type(hbm_system), intent(in) :: system

      scale = 0.0_wp
      if (any(system%stiffness > 0.0_wp)) then
         scale = system%reference/maxval(system%stiffness)
      end if
   end function displacement_scale

   !> What is known of a point of the curve.
   subroutine describe(self, case, found, point, error)
      type(branch_type), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: coefficients(:)

      ! A fold is located by steps of its own: the system may stand at another frequency.
      call self%system%set_frequency(found%p, error)
      if (allocated(error)) return
      coefficients = found%x
      if (self%is_in_time) then
         call self%in_time%to_coefficients(self%system%structure%n_coordinates, found%x, &
                                           coefficients)
      end if
      call self%system%residual(coefficients, self%r)
      point%omega = found%p
      point%converged = found%report%converged
      if (point%converged) point%converged = is_lasting(self%system)
      if (point%converged) point%served_by = served_by_arclength
      point%iterations = found%report%iterations
      point%residual = found%report%residual
      point%fold = found%fold
      call recover_point(self%system, coefficients, case%harmonics%n_harmonics, &
                         case%output%contact, point)
      if (case%output%histories) then
         call recover_histories(self%system, size(self%system%balance, 1), coefficients, &
                                case%harmonics%n_harmonics, point)
      end if
      if (point%converged .and. case%sweep%stability) then
         call find_stability(self%system, case%model, coefficients, point, error)
      end if
   end subroutine describe

   subroutine publish(point, n_points, observer, writer, summary, error)
      type(point_type), intent(in) :: point
      integer, intent(inout) :: n_points
      class(observer_type), intent(inout) :: observer
      type(result_writer), intent(inout) :: writer
      type(summary_type), intent(inout) :: summary
      type(error_type), allocatable, intent(out) :: error

      call writer%add_point(point, error)
      if (allocated(error)) return
      n_points = n_points + 1
      call summary%add(point)
      ! How many points a branch takes is not known beforehand.
      call observer%on_point(n_points, 0, point)
   end subroutine publish

end module fw_branch
