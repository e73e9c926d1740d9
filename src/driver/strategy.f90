!> How the point at a frequency is solved: with the harmonics of the case, with as many as it needs,
!> to a given accuracy, or by integration in time.
module fw_strategy
   use fw_case, only: analyses, case_type
   use fw_contact_data, only: memory_carried
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_run_state, only: run_state
   use fw_solution_history, only: position
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: point_strategy, point_request, new_request, note_time_limit, solver_memory
   public :: keeps_cycles, kept_strategy

   !> What is asked of a point.
   type :: point_request
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      !> Value of the parameter that the sweep goes over, if it does.
      logical :: has_value = .false.
      real(wp) :: value = 0.0_wp
      !> That the response is to have, where the load is found [length].
      real(wp) :: amplitude = 0.0_wp
      !> Look for other ways where the first fails.
      logical :: fallback = .true.
      !> The same point as before, of the same equations: starts that failed are not tried again.
      logical :: again = .false.
      !> By Newton's method, whatever the case asks for: between solved points it needs a few steps.
      logical :: by_newton = .false.
      !> Floquet multipliers; contact forces, states and energies; histories over the period.
      logical :: stability = .false., contact = .false., histories = .false.
      !> One period of the pairs that dissipate most.
      logical :: cycle = .false.
      !> What may end the work on it; null where nothing does.
      class(interrupt_type), pointer :: interrupt => null()
      !> Derivatives by parameters.
      logical :: sensitivity = .false.
      !> Relative residual that is enough, where less than the case asks for is wanted.
      real(wp) :: tolerance = 0.0_wp
      !> From one guess, with no more iterations than these (0: as the case has it).
      integer :: most_iterations = 0
      !> Iterations from which on no other way is begun, if these are fewer than for any point.
      integer :: most_work = huge(1)
   contains
      procedure :: place
      procedure :: at
      procedure :: describe => describe_request
   end type point_request

   !> A solution to go on from, wherever the points have gone since.
   type :: solver_memory
      !> Unknowns at the frequency; not allocated where there is no solution.
      real(wp), allocatable :: x(:)
      !> [rad/s], or the value of the parameter.
      real(wp) :: omega = 0.0_wp
      !> Harmonics and instants that it is of, where these differ from point to point.
      integer :: level(2) = 0
   end type solver_memory

   type, abstract :: point_strategy
      !> What is worth telling of the last point; not allocated where nothing is.
      character(:), allocatable :: note
   contains
      procedure(start_strategy), deferred :: start
      procedure(solve_point), deferred :: solve
      procedure(describe_work), deferred :: describe
      procedure :: solve_in_time
      procedure :: remember => remember_nothing
      procedure :: recall => recall_nothing
      procedure :: start_anew => keep_all
      procedure :: account => nothing_to_tell
   end type point_strategy

   !> What one run leaves for the next one over the same sweep.
   type :: kept_strategy
      !> Started; not allocated where there is nothing to go on from.
      class(point_strategy), allocatable :: strategy
      !> The last solution among the rows.
      type(solver_memory) :: memory
   end type kept_strategy

   abstract interface
      !> Build what every point needs.
      subroutine start_strategy(self, case, error)
         import :: point_strategy, case_type, error_type
         implicit none (type, external)
         class(point_strategy), intent(inout), target :: self
         type(case_type), intent(in) :: case
         type(error_type), allocatable, intent(out) :: error
      end subroutine start_strategy

      !> Solve from what is known of the points before; not converging is an outcome, marked in the
      !> point.
      subroutine solve_point(self, case, request, point, error)
         import :: point_strategy, case_type, point_request, point_type, error_type
         implicit none (type, external)
         class(point_strategy), intent(inout), target :: self
         type(case_type), intent(in) :: case
         type(point_request), intent(in) :: request
         type(point_type), intent(out) :: point
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_point

      !> What was chosen and done over all points; `message` where they miss what was asked, and
      !> why.
      subroutine describe_work(self, case, state, summary, message)
         import :: point_strategy, case_type, run_state, summary_type
         implicit none (type, external)
         class(point_strategy), intent(inout), target :: self
         type(case_type), intent(in) :: case
         type(run_state), intent(in) :: state
         type(summary_type), intent(inout) :: summary
         character(:), allocatable, intent(out) :: message
      end subroutine describe_work
   end interface

contains

   !> Where on the path: omega, or the value of the parameter.
   pure real(wp) function place(self)
      class(point_request), intent(in) :: self

      place = merge(self%value, self%omega, self%has_value)
   end function place

   !> The same with the level that is asked for: an amplitude, or all of the load.
   pure type(position) function at(self)
      class(point_request), intent(in) :: self

      at = position(self%place())
      if (self%amplitude > 0.0_wp) at%level = self%amplitude
   end function at

   !> Where it is asked for, in words.
   pure function describe_request(self) result(words)
      class(point_request), intent(in) :: self
      character(80) :: words

      words = 'omega = '//to_text(self%omega)//' rad/s'
      if (self%has_value) words = trim(words)//', '//to_text(self%value)//' of the parameter'
   end function describe_request

   !> The last solution; none of a strategy that does not go on from solutions of its choice.
   subroutine remember_nothing(self, memory)
      class(point_strategy), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      associate (unused => self, unused_memory => memory)
      end associate
   end subroutine remember_nothing

   !> Start the next point from a solution that `remember` gave.
   subroutine recall_nothing(self, memory)
      class(point_strategy), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      associate (unused => self, unused_memory => memory)
      end associate
   end subroutine recall_nothing

   !> Start the next point as if it were the first; a strategy may go on from what it knows.
   subroutine keep_all(self)
      class(point_strategy), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine keep_all

   !> What was tried for the last point where it was not found; '' of a strategy that does not tell.
   function nothing_to_tell(self) result(words)
      class(point_strategy), intent(in) :: self
      character(480) :: words

      associate (unused => self)
      end associate
      words = ''
   end function nothing_to_tell

   !> Solve within the time that the case gives a point. A stop is an error of status_stopped.
   subroutine solve_in_time(self, case, request, point, error)
      class(point_strategy), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      if (associated(request%interrupt)) call request%interrupt%limit_point(case%solver%max_seconds)
      call self%solve(case, request, point, error)
      if (.not. associated(request%interrupt)) return
      if (.not. (allocated(error) .or. point%converged)) then
         call note_time_limit(request%interrupt, case%solver%max_seconds, point)
      end if
      call request%interrupt%limit_point(0.0_wp)
   end subroutine solve_in_time

   !> Say of a point without a solution that its time was over, where it was.
   subroutine note_time_limit(interrupt, seconds, point)
      class(interrupt_type), intent(inout) :: interrupt
      real(wp), intent(in) :: seconds
      type(point_type), intent(inout) :: point

      if (seconds <= 0.0_wp .or. .not. interrupt%is_due()) return
      point%note = 'time limit: no solution at omega = '//to_text(point%omega)// &
                   ' rad/s within solver%max_seconds = '//to_text(seconds)//' s'
   end subroutine note_time_limit

   !> What a case asks of its points.
   function new_request(case, place, interrupt) result(request)
      type(case_type), intent(in) :: case
      !> [rad/s], or the value of the parameter that the case goes over at its one frequency.
      real(wp), intent(in) :: place
      class(interrupt_type), intent(inout), target, optional :: interrupt
      type(point_request) :: request

      if (present(interrupt)) request%interrupt => interrupt
      request%omega = place
      request%has_value = case%over%is_wanted()
      if (request%has_value) then
         request%value = place
         request%omega = case%sweep%start
      end if
      request%fallback = case%solver%fallback
      request%stability = case%sweep%stability
      request%contact = case%output%contact
      request%histories = case%output%histories
      request%cycle = keeps_cycles(case)
      request%sensitivity = case%sensitivity%is_wanted()
   end function new_request

   !> Whether every point keeps one period of its pairs: where none could be solved again, as it
   !> depends on those before or takes too long.
   pure logical function keeps_cycles(case)
      type(case_type), intent(in) :: case

      keeps_cycles = case%output%contact .and. case%contact%n_pairs > 0 .and. &
                     (case%contact%memory == memory_carried .or. &
                      analyses(case%analysis)%is_integrated)
   end function keeps_cycles

end module fw_strategy
