!> A resonance from value to value of a parameter: a first one from a sweep, then steps that are
!> halved where they fail, from the polynomial through the points before.
module fw_resonance_track
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_extrapolation, only: extrapolate
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
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
   use fw_strategy, only: new_request, point_request, solver_memory
   use fw_sweep, only: sweep_frequency
   implicit none (type, external)
   private

   public :: resonance_track

   type :: resonance_track
      type(parameter_problem) :: mover
      type(one_level) :: strategy
      type(response_curve) :: curve
      type(phase_system) :: phase
      type(newton_solver) :: newton
      !> Lowest and highest frequency of a resonance [rad/s].
      real(wp) :: range(2) = 0.0_wp
      !> Whether residuals have second derivatives, piece by piece.
      logical :: is_smooth = .true.
      !> Whether events are located.
      logical :: is_located = .false.
      !> Unknowns (q, omega) of the present resonance.
      real(wp), allocatable :: x(:)
      type(search_outcome) :: outcome
      !> The last points, the newest first: what steps are even in, unknowns (n + 1, 3), and how
      !> many there are.
      real(wp) :: p(3) = 0.0_wp
      real(wp), allocatable :: y(:, :)
      integer :: kept = 0
      !> Step that served last.
      real(wp) :: step = huge(1.0_wp)
      !> Iterations since the last point.
      integer :: iterations = 0
   contains
      procedure :: start
      procedure :: find_first
      procedure :: sweep
      procedure :: reach
      procedure :: bring
      procedure :: restore
   end type resonance_track

   !> Shortest step of what steps are even in, over the whole, and how steps grow.
   real(wp), parameter :: shortest = 1.0e-5_wp, growth = 1.5_wp
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
            allocate (self%x(level%system%n + 1), self%y(level%system%n + 1, 3), source=0.0_wp)
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
         call solve(self, self%x, error)
         if (allocated(error)) return
      end if
      self%iterations = self%iterations + self%outcome%iterations
      if (self%outcome%kind /= outcome_found) return
      self%p(1) = self%mover%case%resonance%coordinate_of(self%mover%value)
      self%y(:, 1) = self%x
      self%kept = 1
   end subroutine find_first

   !> A resonance at the present value, from a guess; the curve has looked at it then.
   subroutine solve(self, guess, error)
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
   end subroutine solve

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

   !> Go on to a value by as many steps as it takes; the outcome says whether it was reached, else
   !> the point is the last that was.
   subroutine reach(self, value, reached, error)
      class(resonance_track), intent(inout), target :: self
      real(wp), intent(in) :: value
      !> The last value.
      real(wp), intent(out) :: reached
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: p, next, whole, guess(size(self%x))
      logical :: done

      associate (r => self%mover%case%resonance)
         p = r%coordinate_of(value)
         whole = abs(r%coordinate_of(r%end) - r%coordinate_of(r%start))
         reached = r%value_at(self%p(1))
         do
            next = self%p(1) + sign(min(abs(p - self%p(1)), self%step), p - self%p(1))
            ! A rest that is nothing beside the step is taken with it.
            if (abs(p - next) < 0.1_wp*self%step) next = p
            call self%bring(merge(value, r%value_at(next), abs(next - p) <= 0.0_wp), error)
            if (allocated(error)) return
            call extrapolate(self%p(:self%kept), self%y, next, guess)
            call solve(self, guess, error)
            if (allocated(error)) return
            self%iterations = self%iterations + self%outcome%iterations
            done = self%outcome%kind == outcome_found
            if (done) done = self%curve%size_of(self%x - self%y(:, 1)) <= most_moved
            if (done) then
               call remember(self, next)
               reached = r%value_at(next)
               self%step = growth*min(self%step, whole)
               if (abs(next - p) <= 0.0_wp) return
            else
               if (self%outcome%kind == outcome_found) self%outcome%kind = outcome_unsolved
               self%step = 0.5_wp*min(self%step, abs(next - self%p(1)))
               if (self%step >= shortest*whole) cycle
               self%x = self%y(:, 1)
               return
            end if
         end do
      end associate
   end subroutine reach

   subroutine remember(self, p)
      class(resonance_track), intent(inout) :: self
      real(wp), intent(in) :: p

      self%p = [p, self%p(1), self%p(2)]
      self%y(:, 3) = self%y(:, 2)
      self%y(:, 2) = self%y(:, 1)
      self%y(:, 1) = self%x
      self%kept = min(3, self%kept + 1)
   end subroutine remember

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
