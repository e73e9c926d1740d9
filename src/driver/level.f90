!> One number of harmonics, and of instants, at which a case can be solved: its system and solver.
!>
!> Systems are built when they are first needed, and kept; the solution at one level is the guess
!> at the next. Solvers that choose a level for each frequency extend level_solver.
module fw_level
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_hbm, only: hbm_system
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: level_type, level_solver, harmonic_levels, describe_levels

   !> From one number of harmonics to the next; numbers are odd, for the sake of odd-only balances.
   real(wp), parameter :: growth = 1.5_wp

   type :: level_type
      type(case_type) :: case
      type(hbm_system) :: system
      type(point_solver) :: solver
      !> The last frequency that was solved, and the observed coefficients there.
      real(wp) :: omega = -1.0_wp
      real(wp), allocatable :: coefficients(:, :)
      logical, private :: is_built = .false.
   contains
      procedure :: build
      procedure :: solve
      procedure :: take_over
   end type level_type

   type, abstract :: level_solver
   contains
      procedure(start_solver), deferred :: start
      procedure(solve_frequency), deferred :: solve
      procedure(describe_solver), deferred :: describe
   end type level_solver

   abstract interface
      !> Build what every case needs.
      subroutine start_solver(self, case, error)
         import :: level_solver, case_type, error_type
         implicit none (type, external)
         class(level_solver), intent(inout) :: self
         type(case_type), intent(in) :: case
         type(error_type), allocatable, intent(out) :: error
      end subroutine start_solver

      !> Solve at a frequency; the point says at which level.
      subroutine solve_frequency(self, case, omega, point, error)
         import :: level_solver, case_type, error_type, point_type, wp
         implicit none (type, external)
         class(level_solver), intent(inout), target :: self
         type(case_type), intent(in) :: case
         real(wp), intent(in) :: omega
         type(point_type), intent(out) :: point
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_frequency

      !> What was chosen and done over all points; `message` where the points miss what was asked.
      subroutine describe_solver(self, case, summary, message)
         import :: level_solver, case_type, summary_type
         implicit none (type, external)
         class(level_solver), intent(in) :: self
         type(case_type), intent(in) :: case
         type(summary_type), intent(inout) :: summary
         character(:), allocatable, intent(out) :: message
      end subroutine describe_solver
   end interface

contains

   !> Numbers of harmonics to choose from, ascending: 1, 3, 5, 9, 15, ... and the most.
   pure function harmonic_levels(most) result(levels)
      integer, intent(in) :: most
      integer, allocatable :: levels(:)
      integer :: h

      levels = [integer ::]
      h = 1
      do while (h < most)
         levels = [levels, h]
         h = max(h + 2, 2*(nint(growth*h)/2) + 1)
      end do
      levels = [levels, most]
   end function harmonic_levels

   !> The work of all levels, with the unknowns of the largest that was needed.
   subroutine describe_levels(n, levels, kind, summary)
      integer, intent(in) :: n
      type(level_type), intent(in) :: levels(n)
      !> The solver of the case.
      integer, intent(in) :: kind
      type(summary_type), intent(inout) :: summary
      type(linear_step_type) :: work
      integer :: k, largest

      largest = 0
      do k = 1, n
         if (.not. levels(k)%is_built) cycle
         call work%add_work(levels(k)%solver%method%newton%linear)
         if (largest == 0) largest = k
         if (levels(k)%system%n > levels(largest)%system%n) largest = k
      end do
      call summary%describe_work(levels(largest)%system, work, kind)
   end subroutine describe_levels

   !> Build the system, unless it is there.
   subroutine build(self, case, n_harmonics, error, doublings)
      class(level_type), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: n_harmonics
      type(error_type), allocatable, intent(out) :: error
      !> Of the instants that the input leaves the choice of (default: none).
      integer, intent(in), optional :: doublings

      if (self%is_built) return
      self%case = case
      self%case%harmonics%n_harmonics = n_harmonics
      if (present(doublings)) self%case%harmonics%doublings = doublings
      call build_system(self%case, self%system, error)
      if (allocated(error)) return
      call self%solver%start(self%case, self%system%n)
      self%is_built = .true.
   end subroutine build

   !> Solve at a frequency.
   subroutine solve(self, omega, point, error)
      class(level_type), intent(inout), target :: self
      real(wp), intent(in) :: omega
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%solver%solve(self%case, self%system, omega, point, error)
      point%n_harmonics = self%case%harmonics%n_harmonics
      point%n_time = self%system%fourier%n_time
      self%omega = -1.0_wp
      if (allocated(error) .or. .not. point%converged) return
      self%omega = omega
      self%coefficients = point%coefficients
   end subroutine solve

   !> Take the last solution of another level for the last known one.
   subroutine take_over(self, source)
      class(level_type), intent(inout) :: self
      class(level_type), intent(in) :: source
      real(wp) :: x(self%system%n)

      call carry_solution(source%system, source%solver%last, self%system, x)
      call self%solver%know(x, source%solver%omega_last)
      self%system%contact%x_start = source%system%contact%x_start
   end subroutine take_over

end module fw_level
