!> One number of harmonics, and of instants, at which a case can be solved: its system and solver.
!>
!> Systems are built when they are first needed, and kept; the solution at one level is the guess
!> at the next.
module fw_level
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution
   use fw_reduction, only: held_basis
   use fw_remarks, only: remark_undetermined
   use fw_strategy, only: point_request
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: level_type, harmonic_levels, describe_levels

   !> From one number of harmonics to the next; numbers are odd, for the sake of odd-only balances.
   real(wp), parameter :: growth = 1.5_wp

   type :: level_type
      type(harmonics_options) :: harmonics
      class(balance_problem), allocatable :: problem
      !> Of the problem: levels are not copied once they are built.
      class(balance_state), allocatable :: system
      class(point_solver), allocatable :: solver
      !> Where on the path was solved last, if anywhere, and the observed coefficients there.
      logical :: is_solved = .false.
      real(wp) :: place = 0.0_wp
      real(wp), allocatable :: coefficients(:, :)
      logical, private :: is_built = .false.
   contains
      procedure :: build
      procedure :: renew
      procedure :: solve
      procedure :: take_over
   end type level_type

contains

   !> Numbers of harmonics to choose from, ascending: 1, 3, 5, 9, 15, ... and the most. Those that
   !> would leave out a load are no choice, but that two are left where there are two.
   pure function harmonic_levels(most, least) result(levels)
      integer, intent(in) :: most
      !> The highest harmonic of the loads.
      integer, intent(in) :: least
      integer, allocatable :: levels(:)
      integer :: h

      levels = [integer ::]
      h = 1
      do while (h < most)
         levels = [levels, h]
         h = max(h + 2, 2*(nint(growth*h)/2) + 1)
      end do
      levels = [levels, most]
      do while (size(levels) > 2 .and. levels(1) < least)
         levels = levels(2:)
      end do
   end function harmonic_levels

   !> The work of all levels, with the unknowns of the largest that was needed.
   subroutine describe_levels(n, levels, kind, all_converged, summary, further)
      integer, intent(in) :: n
      type(level_type), intent(in) :: levels(n)
      !> The solver of the case.
      integer, intent(in) :: kind
      !> Whether every point converged.
      logical, intent(in) :: all_converged
      type(summary_type), intent(inout) :: summary
      !> Work beside that of the levels.
      type(linear_step_type), intent(in), optional :: further
      type(linear_step_type) :: work
      integer :: k, largest

      if (present(further)) call work%add_work(further)
      largest = 0
      do k = 1, n
         if (.not. levels(k)%is_built) cycle
         call work%add_work(levels(k)%solver%method%newton%linear)
         if (largest == 0) largest = k
         if (levels(k)%system%n > levels(largest)%system%n) largest = k
      end do
      call summary%describe_work(levels(largest)%system, work, kind, all_converged)
      do k = 1, n
         if (.not. levels(k)%is_built) cycle
         if (.not. levels(k)%solver%method%undetermined%omega > 0.0_wp) cycle
         call remark_undetermined(levels(k)%solver%method%undetermined, summary%remarks)
         exit
      end do
   end subroutine describe_levels

   !> Build the system, unless it is there.
   subroutine build(self, case, n_harmonics, error, doublings, held)
      class(level_type), intent(inout), target :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: n_harmonics
      type(error_type), allocatable, intent(out) :: error
      !> Of the instants that the input leaves the choice of (default: none).
      integer, intent(in), optional :: doublings
      !> The modes that all levels share.
      type(held_basis), intent(inout), optional :: held

      if (self%is_built) return
      self%harmonics = case%harmonics%with_harmonics(n_harmonics)
      if (present(doublings)) self%harmonics%doublings = doublings
      if (.not. allocated(self%problem)) allocate (self%problem, self%system)
      call build_system(case, self%problem, self%system, error, of_level=self%harmonics, held=held)
      if (allocated(error)) return
      allocate (self%solver)
      call self%solver%start(case, self%harmonics, self%system%n)
      self%is_built = .true.
   end subroutine build

   !> Forget solutions and work: the system alone stays.
   subroutine renew(self, case)
      class(level_type), intent(inout) :: self
      type(case_type), intent(in) :: case

      deallocate (self%solver)
      allocate (self%solver)
      call self%solver%start(case, self%harmonics, self%system%n)
      self%is_solved = .false.
   end subroutine renew

   !> Solve at a frequency.
   subroutine solve(self, case, request, point, error)
      class(level_type), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%solver%solve(case, self%system, request, point, error)
      self%is_solved = .false.
      if (allocated(error) .or. .not. point%converged) return
      self%is_solved = .true.
      self%place = request%place()
      self%coefficients = point%coefficients
   end subroutine solve

   !> Take the last solution of another level for the last known one.
   subroutine take_over(self, source)
      class(level_type), intent(inout) :: self
      class(level_type), intent(in) :: source
      real(wp) :: x(self%system%n)

      call carry_solution(source%system, source%solver%walk%known%x(:, 1), self%system, x)
      call self%solver%walk%known%begin_with(source%solver%walk%known%place(1), x)
      call self%system%like(source%system)
   end subroutine take_over

end module fw_level
