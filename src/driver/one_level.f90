!> Points with the harmonics of the case, each started from what is known of those before.
module fw_one_level
   use fw_case, only: case_type
   use fw_contact_data, only: memory_carried
   use fw_diagnosis, only: explain_failure, finer, takes_scale
   use fw_error, only: error_type
   use fw_level, only: level_type
   use fw_other_starts, only: start_elsewhere
   use fw_point, only: point_type
   use fw_remarks, only: is_undamped, remark_undetermined
   use fw_run_state, only: run_state
   use fw_strategy, only: point_request, point_strategy, solver_memory
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   use fw_vibration, only: looks_again
   implicit none (type, external)
   private

   public :: one_level

   !> Stick-slip that no balance of few harmonics follows is no trouble to an integration in time.
   character(*), parameter :: in_time = &
      '; analysis = ''time'' integrates what no balance converges to, such as slow stick-slip'

   !> The strategy of a given number of harmonics: one system and one solver serve all points.
   type, extends(point_strategy) :: one_level
      type(level_type) :: level
      !> The last one with fewer harmonics that a point was started from: it goes along with the
      !> sweep where points fail.
      class(level_type), pointer, private :: below => null()
      !> Points that other balances of the case led to, and what did so last.
      integer :: n_elsewhere = 0
      character(:), allocatable :: way
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: remember
      procedure :: recall
      procedure :: start_anew
      procedure :: account
      procedure :: begin_run
      final :: forget
   end type one_level

contains

   !> Build the system; an error is a case that cannot be computed.
   subroutine start(self, case, error)
      class(one_level), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call self%level%build(case, case%harmonics%n_harmonics, error)
   end subroutine start

   !> A point; `note` has what the observer should be told of it, if anything.
   subroutine solve(self, case, request, point, error)
      class(one_level), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      ! Of the point before.
      if (allocated(self%note)) deallocate (self%note)
      call self%level%solver%solve(case, self%level%system, request, point, error)
      if (allocated(error)) return
      if (.not. point%converged .and. goes_on(self, case, request)) then
         call start_elsewhere(case, self%level, self%below, request, &
                              looks_again(self%level%solver%walk%failures), point, error)
         if (allocated(error)) return
         if (point%converged) then
            self%level%solver%walk%failures = 0
            self%n_elsewhere = self%n_elsewhere + 1
            if (allocated(point%note)) self%way = point%note
         end if
      end if
      associate (method => self%level%solver%method)
         ! Pseudo-time says why it failed; the other solvers have no more to tell than the point.
         if (.not. point%converged .and. allocated(method%message)) then
            self%note = 'pseudo-time: '//method%message
         end if
      end associate
   end subroutine solve

   !> Whether other balances of the case are worth their solutions: nothing ended the work on the
   !> point.
   logical function goes_on(self, case, request)
      class(one_level), intent(in) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request

      goes_on = request%fallback .and. .not. self%level%solver%method%unbounded &
                .and. .not. self%level%solver%walk%found_ripple &
                .and. case%has_joint() &
                .and. case%contact%memory /= memory_carried
      if (goes_on .and. associated(request%interrupt)) goes_on = .not. request%interrupt%is_due()
   end function goes_on

   !> The work done, and why points failed.
   subroutine describe(self, case, state, summary, message)
      class(one_level), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message

      message = ''
      associate (system => self%level%system, solver => self%level%solver)
         call summary%describe_work(system, solver%method%newton%linear, case%solver%kind, &
                                    state%all_converged())
         call solver%about%sensitivity%report(case, system, summary)
         call remark_undetermined(solver%method%undetermined, summary%remarks)
         if (solver%method%n_by_flow > 0) call summary%line('fallback', 'pseudo-time served '// &
                                                     to_text(solver%method%n_by_flow)//' points')
         if (self%n_elsewhere > 0) call summary%line('other balances', 'served '// &
                                                     to_text(self%n_elsewhere)//' points, '// &
                                                     self%way)
         if (state%was_stopped .or. state%all_converged()) return
         if (case%model%cyclic%is_cyclic .and. case%solver%fallback) call summary%line( &
            'left out', 'pseudo-time, which cyclic structures do not have')
         ! What cannot help in this case is left out.
         message = 'try a finer sweep, the other direction'
         if (is_undamped(case)) message = 'nothing but contact damps the structure: a '// &
            'resonance needs damping (model%damping, model%modal_damping); else '//message
         if (takes_scale(system)) message = message//', another penalty_scale (0.3 or 3)'
         message = message//' or '//trim(finer(system))//' for the points above'
         ! Costs solutions of its own: worth it only where the run gave nothing at all.
         if (state%n_converged == 0) call explain_failure(system, solver%method, message)
         if (solver%method%rippled) then
            message = message//'; some were solved with friction that is ripple, not slip '// &
                      "(dissipation short of mu N |v| by more than 1/H): take "// &
                      "contact%law = 'rigid' where friction acts on mass"
         end if
         message = 'not converged: '//message
         associate (pairs => system%problem%forces%entry(system%problem%forces%pairs)%law)
            if (pairs%facts%is_integrated .and. case%contact%n_pairs > 0) then
               message = message//in_time
            end if
         end associate
      end associate
   end subroutine describe

   !> Another run with the same system: what it tells of its work is not that of the one before.
   subroutine begin_run(self, case)
      class(one_level), intent(inout) :: self
      type(case_type), intent(in) :: case

      call self%level%renew(case)
      call forget(self)
      self%n_elsewhere = 0
      if (allocated(self%way)) deallocate (self%way)
      if (allocated(self%note)) deallocate (self%note)
   end subroutine begin_run

   impure elemental subroutine forget(self)
      type(one_level), intent(inout) :: self

      if (associated(self%below)) deallocate (self%below)
      nullify (self%below)
   end subroutine forget

   !> The last converged solution, so that points of a search start from it.
   subroutine remember(self, memory)
      class(one_level), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      if (self%level%solver%walk%known%kept == 0) return
      memory%x = self%level%solver%walk%known%x(:, 1)
      memory%omega = self%level%solver%walk%known%place(1)
   end subroutine remember

   !> Go on from such a solution.
   subroutine recall(self, memory)
      class(one_level), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      call self%level%solver%walk%known%begin_with(memory%omega, memory%x)
   end subroutine recall

   !> What was tried for the last point; other balances of the case are gone to behind its own.
   function account(self) result(words)
      class(one_level), intent(in) :: self
      character(480) :: words

      words = self%level%solver%walk%account()
   end function account

   !> Neither solutions nor failures are known.
   subroutine start_anew(self)
      class(one_level), intent(inout) :: self

      self%level%solver%walk%known%kept = 0
      self%level%solver%walk%failures = 0
   end subroutine start_anew

end module fw_one_level
