!> A resonance as a vibration: its place is what steps are even in along a parameter. The first one
!> comes from a sweep.
module fw_resonance_track
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_observer, only: observer_type
   use fw_one_level, only: one_level
   use fw_parameter_problem, only: parameter_problem, renew_state
   use fw_phase_system, only: phase_system
   use fw_point, only: point_type
   use fw_resonance_options, only: as_factor, condition_phase
   use fw_resonance_search, only: find_maximum, outcome_bound, outcome_found, outcome_unsolved, &
      search_outcome
   use fw_response_curve, only: response_curve
   use fw_response_quantity, only: of_first_harmonic
   use fw_solution_history, only: history_options, position, solution_history
   use fw_strategy, only: new_request, point_request, solver_memory
   use fw_sweep, only: sweep_frequency
   use fw_vibration, only: vibration, walk_options, walk_type
   implicit none (type, external)
   private

   public :: resonance_track

   type, extends(vibration) :: resonance_track
      type(parameter_problem) :: mover
      type(one_level) :: strategy
      type(response_curve) :: curve
      type(phase_system) :: phase
      !> Lowest and highest frequency of a resonance [rad/s].
      real(wp) :: range(2) = 0.0_wp
      !> Whether residuals have second derivatives, piece by piece.
      logical :: is_smooth = .true.
      !> Whether events are located.
      logical :: is_located = .false.
      !> Unknowns (q, omega) of the present resonance.
      real(wp), allocatable :: x(:)
      type(search_outcome) :: outcome
      !> The value that is on the way to, which its place may miss by round-off.
      real(wp) :: wanted = 0.0_wp
   contains
      procedure :: start
      procedure :: begin_walk
      procedure :: find_first
      procedure :: sweep
      procedure :: stand
      procedure :: solve
      procedure :: is_same
      procedure :: bring
      procedure :: restore
   end type resonance_track

   !> Shortest step, over the whole.
   real(wp), parameter :: shortest = 1.0e-5_wp
   !> Part of its size by which a resonance may move in a step: beyond, it is another.
   real(wp), parameter :: most_moved = 0.5_wp

contains

   !> Build the problem at the first value.
   subroutine start(self, case, error)
      class(resonance_track), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: half

      associate (r => case%resonance)
         call self%mover%start(case, r%parameter, r%as == as_factor)
         call self%mover%begin(r%value_of(1), error)
         if (allocated(error)) return
         call self%strategy%start(self%mover%case, error)
         if (allocated(error)) return
         associate (level => self%strategy%level)
            call self%curve%start(level%problem, level%system, case%solver)
            self%curve%kind = r%quantity
            allocate (self%x(level%system%n + 1), source=0.0_wp)
            associate (law => level%problem%forces%entry(level%problem%forces%pairs)%law)
               self%is_located = law%facts%locates_events
               self%is_smooth = case%contact%n_pairs == 0 .or. law%facts%locates_events .or. &
                                .not. law%facts%has_events
            end associate
            if (r%condition == condition_phase) then
               call self%phase%build(self%mover, level%problem, self%curve%state, r)
            end if
         end associate
         self%newton%options = self%curve%newton%options
      end associate
      self%range = case%sweep%range()
      half = 0.5_wp*(self%range(2) - self%range(1))
      self%range = [max(self%range(1) - half, 0.1_wp*self%range(1)), self%range(2) + half]
   end subroutine start

   !> Where the sweep of the case is largest at the present value; not allocated where no point
   !> converged.
   subroutine sweep(self, observer, x, value, error)
      class(resonance_track), intent(inout), target :: self
      class(observer_type), intent(inout), target :: observer
      real(wp), allocatable, intent(out) :: x(:)
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(solver_memory) :: memory
      type(point_type) :: point
      real(wp) :: found
      integer :: k

      value = -1.0_wp
      associate (case => self%mover%case)
         do k = 1, case%sweep%n_points
            request = new_request(case, sweep_frequency(case%sweep, k, case%sweep%n_points), &
                                  observer)
            request%contact = .false.
            request%histories = .false.
            request%sensitivity = .false.
            call self%strategy%solve_in_time(case, request, point, error)
            if (allocated(error)) return
            self%iterations = self%iterations + point%iterations
            if (.not. point%converged) cycle
            found = point%amplitude(1)
            if (self%curve%kind == of_first_harmonic) found = norm2(point%coefficients(2:3, 1))
            if (found <= value) cycle
            value = found
            call self%strategy%remember(memory)
            x = [memory%x, point%omega]
         end do
      end associate
   end subroutine sweep

   !> The first resonance, from the largest point of the sweep.
   subroutine find_first(self, observer, error)
      class(resonance_track), intent(inout), target :: self
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)
      real(wp) :: value

      self%outcome = search_outcome()
      call self%sweep(observer, x, value, error)
      if (allocated(error) .or. .not. allocated(x)) return
      self%x = x
      self%curve%state%interrupt => observer
      call find_maximum(self%curve, x, .true., self%range, self%is_smooth, self%outcome, error)
      if (allocated(error)) return
      if (self%outcome%kind /= outcome_found) return
      self%x = self%curve%x
      if (self%mover%case%resonance%condition == condition_phase) then
         call find(self, self%x, error)
         if (allocated(error)) return
      end if
      self%iterations = self%iterations + self%outcome%iterations
   end subroutine find_first

   !> From the first resonance on, through all the points before: steps as long as they may be.
   subroutine begin_walk(self, walk)
      class(resonance_track), intent(in) :: self
      type(walk_type), intent(inout) :: walk

      associate (r => self%mover%case%resonance)
         walk%limits = walk_options(first=huge(1.0_wp), longest=huge(1.0_wp), growth=1.5_wp, &
                                    whole=abs(r%coordinate_of(r%end) - r%coordinate_of(r%start)))
         walk%limits%shortest = shortest*walk%limits%whole
         call walk%known%start(size(self%x), history_options(most=3, far=0.0_wp, by_all=.true.))
         call walk%restart(r%coordinate_of(self%mover%value), self%x)
      end associate
   end subroutine begin_walk

   !> To the place of a value: the value itself where it is the one that is wanted.
   subroutine stand(self, at, error)
      class(resonance_track), intent(inout) :: self
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: value

      associate (r => self%mover%case%resonance)
         value = r%value_at(at%along)
         if (abs(at%along - r%coordinate_of(self%wanted)) <= 0.0_wp) value = self%wanted
      end associate
      call self%bring(value, error)
   end subroutine stand

   subroutine solve(self, x, report, error)
      class(resonance_track), intent(inout) :: self
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      call find(self, x, error)
      if (allocated(error)) return
      self%iterations = self%iterations + self%outcome%iterations
      report%converged = self%outcome%kind == outcome_found
      report%iterations = self%outcome%iterations
      report%residual = self%outcome%residual
      x = self%x
   end subroutine solve

   !> A resonance that has moved too far is another.
   logical function is_same(self, x, guess, known)
      class(resonance_track), intent(inout) :: self
      real(wp), intent(in) :: x(:), guess(:)
      type(solution_history), intent(in) :: known

      associate (unused => guess)
      end associate
      is_same = self%curve%size_of(x - known%x(:, 1)) <= most_moved
      if (.not. is_same) self%outcome%kind = outcome_unsolved
   end function is_same

   !> A resonance at the present value, from a guess; the curve has looked at it then.
   subroutine find(self, guess, error)
      class(resonance_track), intent(inout), target :: self
      real(wp), intent(in) :: guess(:)
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: y(size(guess))
      logical :: done

      if (self%mover%case%resonance%condition /= condition_phase) then
         call find_maximum(self%curve, guess, .false., self%range, self%is_smooth, self%outcome, &
                           error)
         self%x = self%curve%x
         return
      end if
      self%outcome = search_outcome()
      call stop_run(self%curve%state%interrupt, error)
      if (allocated(error)) return
      call self%curve%state%set_frequency(guess(size(guess)), error)
      if (allocated(error)) return
      self%phase%interrupt => self%curve%state%interrupt
      call self%phase%scale(guess)
      call self%phase%pack_point(guess, y)
      call self%newton%solve(self%phase, y, report)
      if (report%interrupted) call stop_run(self%curve%state%interrupt, error)
      if (allocated(error)) return
      self%outcome%iterations = report%iterations
      self%outcome%residual = report%residual
      call self%phase%pack_point(y, self%x, back=.true.)
      if (.not. report%converged) return
      self%outcome%kind = outcome_found
      associate (omega => self%x(size(y)))
         if (omega < self%range(1) .or. omega > self%range(2)) self%outcome%kind = outcome_bound
      end associate
      self%curve%x = self%x
      call self%curve%look(done, error)
   end subroutine find

   !> Bring everything to a value.
   subroutine bring(self, value, error)
      class(resonance_track), intent(inout), target :: self
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      associate (level => self%strategy%level)
         call self%mover%bring(value, level%problem, level%system, error)
         if (.not. allocated(error)) call self%curve%renew(level%system)
         self%phase%reference = self%curve%state%reference
      end associate
   end subroutine bring

   !> All states stand at a value again, after one of them has moved the problem by itself.
   subroutine restore(self, value, error)
      class(resonance_track), intent(inout), target :: self
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      associate (level => self%strategy%level)
         call self%mover%bring(value, level%problem, level%system, error)
         if (allocated(error)) return
         call renew_state(level%problem, level%system)
         call self%curve%renew(level%system)
      end associate
   end subroutine restore

end module fw_resonance_track
