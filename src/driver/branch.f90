!> A frequency response along its branch, through folds: continuation = 'arclength'.
module fw_branch
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_branch_peaks, only: branch_peaks
   use fw_branch_step, only: interpolate
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_crossing_search, only: probe_type, search_crossings
   use fw_curve_source, only: curve_source
   use fw_cycle_recovery, only: recover_cycle
   use fw_error, only: error_type
   use fw_formulation, only: formulation_type
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_newton, only: newton_solver, solver_report, tight_forcing
   use fw_observer, only: observer_type
   use fw_point, only: point_type, served_by_arclength
   use fw_level, only: level_type
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution, observed_coefficients, recover_point
   use fw_slip_gap, only: lacks_friction
   use fw_response, only: is_lasting
   use fw_stability_crossing, only: movement_between, multiplier_track, signature_of
   use fw_stability_verdict, only: verdict_undecided
   use fw_strategy, only: new_request, note_time_limit, point_request
   use fw_remarks, only: is_undamped
   use fw_response_view, only: response_view
   implicit none (type, external)
   private

   public :: branch_source

   !> Way back of the frequency between two turns, relative, that harmonics and instants of a
   !> balance may make of a curve that does not turn: of forces with corners the harmonics that are
   !> left out fall as the power 2.5 of their number only.
   real(wp), parameter :: smooth_ripple = 1.0e-5_wp, ripple = 2.0e-4_wp
   !> Unknowns up to which a branch is followed without condensation.
   integer, parameter :: whole_up_to = 150

   !> The points of a branch as points of a result, one after the other.
   type, extends(curve_source) :: branch_source
      !> Solves the first point.
      type(level_type), pointer :: level => null()
      type(balance_state), pointer :: system => null()
      !> The structure without condensation, where it is small: nothing of it is hidden from the
      !> step control then.
      class(balance_problem), pointer :: whole_problem => null()
      class(balance_state), pointer :: whole => null()
      !> What the curve is followed in.
      type(formulation_type), allocatable :: formulation
      !> What a condensed structure is measured by.
      type(response_view), pointer :: view => null()
      real(wp), allocatable :: r(:)
      type(branch_peaks), allocatable :: peaks
      !> The first row, and the last point of the curve.
      type(point_type), allocatable :: first_row
      type(branch_point), allocatable, private :: before
      !> The solution of the largest amplitude of the first observed quantity.
      type(branch_point), allocatable, private :: highest
      real(wp), private :: height = 0.0_wp
      !> Solutions made to find out where its stability changes.
      integer :: n_solved = 0, iterations = 0
      !> The whole structure was small enough, and had no solution where the branch begins.
      logical :: is_condensed = .false.
      type(multiplier_track), allocatable, private :: track
      !> The last point with multipliers, and distances to the folds behind it.
      type(branch_point), allocatable, private :: last
      type(point_type), allocatable, private :: last_point
      real(wp), allocatable, private :: folds(:)
      !> Of its multipliers since the point before it.
      real(wp), private :: movement(2) = 0.0_wp
   contains
      procedure :: build
      procedure :: begin
      procedure :: add
      procedure :: finish
      procedure :: at_highest
      final :: release
   end type branch_source

   !> Solutions between two points of a branch: maxima, or changes of stability.
   type, extends(probe_type) :: branch_probe
      type(branch_source), pointer :: branch => null()
      type(case_type), pointer :: case => null()
      type(branch_point) :: first, second
      logical :: with_stability = .false.
   contains
      procedure :: at
   end type branch_probe

contains

   !> Take a level that is built, which has to live as long.
   subroutine build(self, level)
      class(branch_source), intent(inout) :: self
      type(level_type), intent(inout), target :: level

      self%level => level
      allocate (self%peaks, self%first_row, self%track)
   end subroutine build

   !> The first point as in a natural sweep, then along the branch until a bound or max_points.
   subroutine begin(self, case, observer, point, more, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)

      more = .true.
      call self%set_out_on_path(case)
      ! What the first point leaves, the whole path inherits.
      self%level%solver%method%newton%loosest = tight_forcing
      call observer%limit_point(case%solver%max_seconds)
      call self%level%solve(case, new_request(case, self%ends(1), observer), point, error)
      if (allocated(error)) return
      if (.not. point%converged) call note_time_limit(observer, case%solver%max_seconds, point)
      call observer%limit_point(0.0_wp)
      if (allocated(point%note)) call observer%on_message(point%note)
      if (.not. point%converged) then
         call observer%on_message('the first point did not converge: no branch to follow')
         return
      end if
      self%level%system%interrupt => observer
      x = self%level%solver%x
      call begin_at(self, case, x, error)
      if (.not. allocated(error)) call set_tangent(self, case, self%curve%here, point, error)
      if (.not. allocated(error)) call note(self, case, self%curve%first, point, error)
   end subroutine begin

   !> Why the branch ended, once it has; its work joins that of the first point.
   subroutine finish(self, case, observer)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout) :: observer
      character(:), allocatable :: words

      if (.not. associated(self%solved)) return
      call self%level%solver%method%newton%linear%add_work(self%curve%corrector%linear)
      call self%bifurcations%doubt(self%track)
      call self%bifurcations%merge_turns(merge(ripple, smooth_ripple, case%contact%n_pairs > 0))
      call closing_words(self, case, observer%run_out, words)
      call observer%on_message(words)
   end subroutine finish

   !> Start at a converged point x of the level at the start of the path.
   subroutine begin_at(self, case, x, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: unknowns(:), whole_x(:)

      self%system => self%level%system
      call build_whole(self, case, self%level%system, x, whole_x, error)
      if (allocated(error)) return
      allocate (self%r(self%system%n))
      self%curve%x_scale = displacement_scale(self%system)
      ! Of a structure that is taken whole, too: a pair that sticks leaves no unknowns there.
      if (.not. case%over%is_wanted()) call find_poles(self%system, self%curve)
      if (.not. associated(self%whole)) allocate (self%view)
      allocate (self%formulation)
      call self%formulation%begin(self%system)
      allocate (unknowns(self%system%n))
      call self%formulation%from_coefficients(whole_x, unknowns)
      if (associated(self%view)) call self%view%begin(self%system, self%formulation)
      self%curve%corrector%view => self%view
      self%solved => self%formulation%as_solved()
      call self%follow(self%solved, unknowns, error)
   end subroutine begin_at

   !> Where the structure is small, take it whole: resonances of what condensation leaves out would
   !> be passed over. The point it starts from is carried over.
   subroutine build_whole(self, case, system, x, whole_x, error)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      real(wp), allocatable, intent(out) :: whole_x(:)
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      type(solver_report) :: report

      whole_x = x
      if (case%model%cyclic%is_cyclic) return
      if (case%model%n_dof*system%problem%fourier%n_coefficients > whole_up_to) return
      allocate (self%whole, self%whole_problem)
      ! One and the same law.
      call build_system(case, self%whole_problem, self%whole, error, keep_all=.true., &
                        forces=system%problem%forces)
      if (allocated(error)) return
      call self%whole%follow(system, error)
      if (allocated(error)) return
      deallocate (whole_x)
      allocate (whole_x(self%whole%n))
      call carry_solution(system, x, self%whole, whole_x)
      newton%options = case%solver
      call newton%solve(self%whole, whole_x, report)
      call self%curve%corrector%linear%add_work(newton%linear)
      if (report%interrupted) call stop_run(system%interrupt, error)
      if (allocated(error)) return
      self%is_condensed = .not. report%converged
      if (report%converged) then
         self%system => self%whole
      else
         whole_x = x
         deallocate (self%whole, self%whole_problem)
      end if
   end subroutine build_whole

   !> While all of the contact sticks, the structure vibrates with its relative coordinates held.
   pure subroutine find_poles(system, curve)
      type(balance_state), intent(in) :: system
      class(arclength_type), intent(inout) :: curve
      !> Half width of a mode without damping, over its frequency.
      real(wp), parameter :: least = 1.0e-4_wp

      call system%problem%structure%held_modes(curve%pole, curve%pole_width)
      curve%pole_width = max(curve%pole_width, least*curve%pole)
   end subroutine find_poles

   !> What was made for the view of the whole structure; the level goes with its strategy.
   subroutine release(self)
      type(branch_source), intent(inout) :: self

      if (associated(self%whole)) deallocate (self%whole)
      if (associated(self%whole_problem)) deallocate (self%whole_problem)
      if (associated(self%view)) deallocate (self%view)
   end subroutine release

   !> Every point of the curve is a row.
   subroutine add(self, case, observer, found, point, more, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      associate (unused => observer)
      end associate
      more = .true.
      call describe(self, case, found, case%sweep%stability, point, error)
      if (.not. allocated(error)) call note(self, case, found, point, error)
      if (.not. allocated(error)) call self%level%solver%about%note_seconds(point)
   end subroutine add

   !> A point has been reached: what lies between it and the last.
   subroutine note(self, case, found, point, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%over%is_wanted()) call note_peak(self, case, found, point, error)
      if (allocated(error)) return
      if (point%fold) then
         call self%note_fold(found, point)
         if (self%track%n > 0) then
            ! Counts of multipliers that pass 1 leave it out.
            self%folds = [self%folds, self%curve%corrector%metric%chord(self%last, found)]
         end if
         return
      end if
      if (.not. allocated(point%multipliers)) return
      call self%track%add(signature_of(point%multipliers), point%verdict /= verdict_undecided)
      if (self%track%n > 1) then
         call look_between(self, case, found, point, error)
         if (allocated(error)) return
         self%movement = movement_between(self%last_point%multipliers, point%multipliers)
      end if
      self%last = found
      self%last_point = point
      self%folds = [real(wp) ::]
   end subroutine note

   !> The maxima between a point and the last.
   subroutine note_peak(self, case, found, point, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      type(branch_probe) :: probe
      real(wp) :: length

      length = 0.0_wp
      if (allocated(self%before)) then
         probe%branch => self
         probe%case => case
         probe%first = self%before
         probe%second = found
         length = self%curve%corrector%metric%chord(self%before, found)
      else
         self%first_row = point
      end if
      call self%peaks%add(point, probe, length, error)
      self%before = found
   end subroutine note_peak

   !> Locate the changes of stability since the last point, the fold left out.
   subroutine look_between(self, case, found, point, error)
      class(branch_source), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      type(branch_probe) :: probe

      probe%branch => self
      probe%case => case
      probe%first = self%last
      probe%second = found
      probe%folds = self%folds
      probe%with_stability = case%sweep%stability
      call search_crossings(probe, self%last_point, point, self%movement, self%track%n - 1, &
                            .true., self%bifurcations, error)
      self%n_solved = self%n_solved + probe%n_solved
      self%iterations = self%iterations + probe%iterations
   end subroutine look_between

   !> The point of the branch at a share of the way between two.
   subroutine at(self, share, point, error)
      class(branch_probe), intent(inout) :: self
      real(wp), intent(in) :: share
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      call solve_between(self%branch, self%case, self%first, self%second, share, &
                         self%with_stability, point, error, self%reached)
      self%n_solved = self%n_solved + 1
      self%iterations = self%iterations + point%iterations
   end subroutine at

   !> Solve across the chord between two points of the branch, at a share of it: where it turns,
   !> a frequency in between would not tell which part is meant.
   subroutine solve_between(self, case, first, second, share, with_stability, point, error, &
                            reached)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: first, second
      real(wp), intent(in) :: share
      logical, intent(in) :: with_stability
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      !> Distance from the first.
      real(wp), intent(out) :: reached
      type(branch_point) :: found
      real(wp) :: ds

      associate (curve => self%curve)
         ds = curve%corrector%metric%chord(first, second)
         call interpolate(curve%corrector%metric, first, second, share, found)
         call curve%corrector%correct(self%solved, first, ds, found, error)
         reached = curve%corrector%metric%chord(first, found)
      end associate
      if (allocated(error)) return
      if (found%report%converged) call describe(self, case, found, with_stability, point, error)
      point%iterations = found%report%iterations
   end subroutine solve_between

   !> Why the branch ended, once it has.
   subroutine closing_words(self, case, out_of_time, words)
      class(branch_source), intent(in) :: self
      type(case_type), intent(in) :: case
      !> Whether a limit of time stopped it.
      logical, intent(in) :: out_of_time
      character(:), allocatable, intent(out) :: words

      if (.not. self%curve%ended) then
         words = 'branch: stopped by the user'
         if (out_of_time) words = 'branch: not at its end when the time of the run was over'
         return
      end if
      words = 'branch: '//self%curve%ending
      if (self%curve%runs_away .and. case%contact%n_pairs > 0) then
         words = words//': from here on the contact no longer holds the structure '// &
                 'in place: all of it slips, and no periodic response exists without a support '// &
                 'in that direction'
      else if (self%curve%runs_away .and. is_undamped(case)) then
         words = words//': nothing damps the structure, and a resonance without damping has no '// &
                 'height; set model%damping or model%modal_damping'
      end if
   end subroutine closing_words

   !> The size of displacements to expect, for a branch that may start fully stuck: what the load
   !> makes of the stiffness of the joint.
   pure real(wp) function displacement_scale(system) result(scale)
      type(balance_state), intent(in) :: system
      real(wp) :: stiffness
      integer :: c, i

      stiffness = 0.0_wp
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         do c = 1, size(p%stiffness, 2)
            do i = 1, size(p%stiffness, 1)
               ! A velocity in time is no displacement.
               if (p%in_time(i) .and. p%order_of(i, c) > 0) cycle
               stiffness = max(stiffness, p%stiffness(i, c))
            end do
         end do
      end associate
      scale = 0.0_wp
      if (stiffness > 0.0_wp) scale = system%reference/stiffness
   end function displacement_scale

   !> What is known of a point of the curve.
   subroutine describe(self, case, found, with_stability, point, error)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      logical, intent(in) :: with_stability
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(solver_report) :: report
      real(wp), allocatable :: coefficients(:)

      ! A fold is located by steps of its own: the system may stand at another frequency.
      call stand_at(self, found, coefficients, error)
      if (allocated(error)) return
      request = new_request(case, found%p)
      request%stability = with_stability
      report = found%report
      if (report%converged) report%converged = is_lasting(self%system) .and. .not. &
                                               lacks_friction(self%system, coefficients)
      point%fold = found%fold
      associate (about => self%level%solver%about)
         call about%describe(case, request, case%harmonics%n_harmonics, self%system, &
                             coefficients, report, served_by_arclength, point, error)
         if (point%converged .and. self%is_within(found%p)) call note_height(self, found, point)
         if (point%converged .and. request%sensitivity .and. .not. allocated(error)) then
            call about%sensitivity%find(case, self%system, coefficients, point, error)
         end if
      end associate
      if (.not. allocated(error)) call set_tangent(self, case, found, point, error)
   end subroutine describe

   !> Evaluate the system at a point of the curve.
   subroutine stand_at(self, found, coefficients, error)
      class(branch_source), intent(inout) :: self
      type(branch_point), intent(in) :: found
      real(wp), allocatable, intent(out) :: coefficients(:)
      type(error_type), allocatable, intent(out) :: error

      call self%system%set_parameter(found%p, error)
      if (allocated(error)) return
      allocate (coefficients(size(found%x)))
      call self%formulation%to_coefficients(found%x, coefficients)
      call self%system%residual(coefficients, self%r)
   end subroutine stand_at

   !> Keep the solution of the largest amplitude.
   pure subroutine note_height(self, found, point)
      class(branch_source), intent(inout) :: self
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point

      if (size(point%amplitude) == 0) return
      if (point%amplitude(1) <= self%height) return
      self%height = point%amplitude(1)
      self%highest = found
   end subroutine note_height

   !> That solution with one period of the pairs that dissipate most; not converged where there is
   !> none.
   subroutine at_highest(self, case, point, error)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: coefficients(:)

      if (.not. (allocated(self%highest) .and. case%output%contact)) return
      call stand_at(self, self%highest, coefficients, error)
      if (allocated(error)) return
      point%omega = self%system%frequency()
      point%place = self%highest%p
      point%converged = .true.
      call recover_point(self%system, coefficients, case%harmonics%n_harmonics, .true., point)
      call recover_cycle(self%system, size(self%system%balance, 1), coefficients, point)
   end subroutine at_highest

   !> The direction of the branch at a point, by a difference along the tangent: observed
   !> quantities follow from unknowns and frequency, nothing is solved for.
   subroutine set_tangent(self, case, found, point, error)
      class(branch_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: beside(:)
      real(wp) :: step, scale

      scale = abs(found%p)
      ! A parameter may pass 0.
      if (case%over%is_wanted()) scale = max(scale, abs(self%ends(2) - self%ends(1)))
      call self%point_along(case, found, scale, point, step)
      call self%system%set_parameter(found%p + step*found%t_p, error)
      if (allocated(error)) return
      allocate (beside(size(found%x)))
      call self%formulation%to_coefficients(found%x + step*found%t, beside)
      call observed_coefficients(self%system, beside, case%harmonics%n_harmonics, point%tangent)
      point%tangent = (point%tangent - point%coefficients)/step
   end subroutine set_tangent

end module fw_branch
