!> Harmonics as many as a point needs (adaptive = .true.): a point is solved again with more of them
!> until the force left out of the balance is within the tolerance; the next starts with fewer
!> where these would have done.
module fw_adaptive
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_left_out, only: force_left_out
   use fw_level, only: describe_levels, harmonic_levels, level_type
   use fw_point, only: point_type
   use fw_run_state, only: run_state
   use fw_reduction, only: held_basis
   use fw_strategy, only: point_request, point_strategy, solver_memory
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: adaptive_solver

   !> Harmonics are given up only where fewer leave out this part of the tolerance.
   real(wp), parameter :: with_margin = 0.5_wp

   type, extends(point_strategy) :: adaptive_solver
      !> Numbers of harmonics to choose from, ascending.
      integer, allocatable :: n_harmonics(:)
      !> The one in use.
      integer :: current = 1
      !> Points that would have needed more than the most.
      integer :: n_short = 0
      !> One for each of these numbers, built when it is first needed.
      type(level_type), allocatable :: level(:)
      !> Modes of the structure with its contact held, which all of them share.
      type(held_basis), private :: held
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: remember
      procedure :: recall
   end type adaptive_solver

contains

   !> The case gives the largest number of harmonics.
   subroutine start(self, case, error)
      class(adaptive_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      self%n_harmonics = harmonic_levels(case%harmonics%n_harmonics, &
                                         case%model%waves%highest())
      allocate (self%level(size(self%n_harmonics)))
      call self%level(1)%build(case, self%n_harmonics(1), error, held=self%held)
   end subroutine start

   !> Solve at a frequency; the point says how many harmonics it took.
   subroutine solve(self, case, request, point, error)
      class(adaptive_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(level_type), pointer :: level
      real(wp) :: seconds
      integer :: iterations

      ! Work is summed over all levels that the point took.
      iterations = 0
      seconds = 0.0_wp
      do
         level => self%level(self%current)
         call level%solve(case, request, point, error)
         if (allocated(error)) return
         iterations = iterations + point%iterations
         seconds = seconds + point%seconds
         if (.not. point%converged) exit
         if (force_left_out(level%system, self%n_harmonics(self%current)) &
             <= case%harmonics%adaptive_tolerance) exit
         ! The best there is: the point counts, and the summary tells.
         if (self%current == size(self%level)) then
            self%n_short = self%n_short + 1
            exit
         end if
         call change(self, case, self%current + 1, error)
         if (allocated(error)) return
      end do
      point%iterations = iterations
      point%seconds = seconds
      ! Only behind the point: it is reported with the harmonics that it was solved with.
      if (self%current == 1 .or. .not. point%converged) return
      if (force_left_out(level%system, self%n_harmonics(self%current - 1)) &
          <= with_margin*case%harmonics%adaptive_tolerance) then
         call change(self, case, self%current - 1, error)
      end if
   end subroutine solve

   !> The work of all levels, and how many points would have needed more.
   subroutine describe(self, case, state, summary, message)
      class(adaptive_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message
      character(10) :: text

      call describe_levels(size(self%level), self%level, case%solver%kind, &
                           state%all_converged(), summary)
      call summary%line('harmonics', to_text(summary%harmonics(1))//' to '// &
                        to_text(summary%harmonics(2)))
      if (self%n_short > 0) then
         write (text, '(es8.1)') case%harmonics%adaptive_tolerance
         call summary%line('', 'too few at '//to_text(self%n_short)//' points, which leave out '// &
                           'more than '//trim(adjustl(text))//' of the force: raise '// &
                           'harmonics%n_harmonics')
      end if
      message = ''
   end subroutine describe

   !> Go over to another number of harmonics, with the present solution as the last known one.
   subroutine change(self, case, next, error)
      class(adaptive_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: next
      type(error_type), allocatable, intent(out) :: error

      call self%level(next)%build(case, self%n_harmonics(next), error, held=self%held)
      if (allocated(error)) return
      call self%level(next)%take_over(self%level(self%current))
      self%current = next
   end subroutine change

   !> The level in use and its last solution.
   subroutine remember(self, memory)
      class(adaptive_solver), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      memory%level(1) = self%current
      associate (solver => self%level(self%current)%solver)
         if (solver%walk%known%kept == 0) return
         memory%x = solver%walk%known%x(:, 1)
         memory%omega = solver%walk%known%place(1)
      end associate
   end subroutine remember

   !> Go on with that level: a solution fits no other.
   subroutine recall(self, memory)
      class(adaptive_solver), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      self%current = memory%level(1)
      call self%level(self%current)%solver%walk%known%begin_with(memory%omega, memory%x)
   end subroutine recall

end module fw_adaptive
