!> Analysis 'bounds': at each frequency of a sweep the response with residual tractions in the
!> middle of what balances, and the lowest and the highest one that other residual tractions lead
!> to.
module fw_run_bounds
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
   use fw_analysis, only: analysis, run_type
   use fw_bounds_group, only: bounds_group
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_moved_parameter, only: moved_parameter
   use fw_one_level, only: one_level
   use fw_parameters, only: residual_share
   use fw_point, only: point_type
   use fw_response_rows, only: is_of_pairs, wear_volume
   use fw_sensitivity_options, only: of_itself
   use fw_share_search, only: jumps, share_point, share_search, share_solver
   use fw_strategy, only: new_request, point_request, solver_memory
   use fw_sweep, only: sweep_places
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: bounds_analysis

   !> Responses at one frequency by the balance.
   type, extends(share_solver) :: balanced_shares
      class(one_level), allocatable :: strategy
      !> The case, with the derivatives that the search needs and the shares of now.
      class(case_type), allocatable :: one
      !> Gives the problem other shares.
      type(moved_parameter), allocatable :: mover
      type(point_request) :: request
      !> Responses that were solved at this frequency.
      integer :: n_solved = 0
      !> Vibration in the middle, by its unknowns, and the first of these.
      real(wp) :: size_of_motion = 0.0_wp
      integer :: first = 1
   contains
      procedure :: solve => solve_on_the_way
      procedure :: goes_on
      procedure :: put_shares
      procedure :: take
   end type balanced_shares

   type, extends(analysis) :: bounds_analysis
      type(balanced_shares), private :: solver
      real(wp), allocatable, private :: place(:)
      !> Rows that are done, and what is known of them.
      integer, private :: n_done = 0, n_wanted = huge(1)
      type(bounds_group), allocatable, private :: group
   contains
      procedure :: start
      procedure :: check
      procedure :: next
      procedure :: is_covered
      procedure :: conclude
   end type bounds_analysis

   !> Parts of the way between two sets of shares, at least.
   real(wp), parameter :: shortest_way = 0.125_wp
   !> Longest and shortest step in shares where nothing may jump, and how much of the vibration one
   !> may change.
   real(wp), parameter :: longest_step = 0.125_wp, shortest_step = 2.0_wp**(-12)
   real(wp), parameter :: part_of_motion = 0.05_wp

contains

   !> One system serves all points and all shares.
   subroutine start(self, case, run, error)
      class(bounds_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: none

      call check_quantity(case, error)
      if (allocated(error)) return
      associate (solver => self%solver)
         call ask_for_slopes(case, solver)
         allocate (solver%strategy)
         call solver%strategy%start(solver%one, error)
         if (allocated(error)) return
         allocate (solver%mover)
         call solver%mover%take(solver%one, residual_share, .false.)
         solver%mover%filter_harmonics = case%harmonics%filter_harmonics
         ! A factor of shares, which are 0 to begin with, is none.
         solver%mover%built = 1.0_wp
      end associate
      self%place = sweep_places(case)
      none = ieee_value(1.0_wp, ieee_quiet_nan)
      allocate (self%group)
      self%group%quantity = case%bounds%quantity
      allocate (self%group%range(3, size(self%place)), source=none)
      allocate (self%group%residual(case%contact%n_pairs, 2, size(self%place)), source=none)
      allocate (self%group%counts(2, size(self%place)), source=0)
      call run%begin_points(case, self, size(self%place))
   end subroutine start

   !> The system of the centre, without a solution.
   subroutine check(self, case, error)
      class(bounds_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call check_quantity(case, error)
      if (allocated(error)) return
      call ask_for_slopes(case, self%solver)
      allocate (self%solver%strategy)
      call self%solver%strategy%start(self%solver%one, error)
   end subroutine check

   !> What the range is of has to be there.
   subroutine check_quantity(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%bounds%quantity == wear_volume .and. .not. allocated(case%wear%coefficient)) then
         call fatal_error(error, "bounds%quantity = 'wear_volume' needs wear%coefficient: give "// &
                          'it, or take another quantity', status_input)
      else if (.not. is_of_pairs(case%bounds%quantity) .and. case%model%n_observed() == 0) then
         call fatal_error(error, "case%analysis = 'bounds' without observed quantities: must "// &
                          'have output%observe, or /observe of the model', status_input)
      end if
   end subroutine check_quantity

   !> The case with derivatives by the shares of its pairs.
   subroutine ask_for_slopes(case, solver)
      type(case_type), intent(in) :: case
      type(balanced_shares), intent(inout) :: solver

      allocate (solver%one, source=case)
      associate (options => solver%one%sensitivity)
         options%parameters = [residual_share]
         options%quantities = [case%bounds%quantity]
         options%has_harmonics = .true.
      end associate
   end subroutine ask_for_slopes

   !> The response in the middle, then the search from it; the next frequency goes on from the
   !> middle.
   subroutine next(self, case, observer, point, more, error)
      class(bounds_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(share_point) :: centre
      logical :: known

      ! Who asks for the end may ask for fewer points.
      self%n_wanted = observer%n_wanted
      more = .not. (observer%is_stopping() .or. self%is_covered())
      if (.not. more) return
      associate (solver => self%solver)
         solver%n_solved = 0
         call solver%put_shares(spread(0.0_wp, 1, case%contact%n_pairs), error)
         if (allocated(error)) return
         solver%request = new_request(solver%one, self%place(self%n_done + 1), observer)
         call solver%strategy%solve_in_time(solver%one, solver%request, point, error)
         if (allocated(error)) return
         if (allocated(point%note)) call observer%on_message(point%note)
         solver%n_solved = 1
         call solver%take(point, centre, known)
         if (known) call find_range(self, centre, observer, error)
         if (allocated(error)) return
         if (.not. known) self%group%counts(2, self%n_done + 1) = 1
         ! No row of the result has them.
         if (allocated(point%sensitivity)) deallocate (point%sensitivity)
      end associate
      self%n_done = self%n_done + 1
   end subroutine next

   !> Both ends at the present frequency.
   subroutine find_range(self, centre, observer, error)
      class(bounds_analysis), intent(inout) :: self
      type(share_point), intent(in) :: centre
      class(observer_type), intent(inout) :: observer
      type(error_type), allocatable, intent(out) :: error
      type(share_search) :: search
      integer :: i, row

      row = self%n_done + 1
      associate (solver => self%solver, group => self%group)
         ! Other ways lead to other branches, which are no matter of the assembly.
         solver%request%fallback = .false.
         solver%request%contact = .false.
         solver%request%histories = .false.
         solver%request%cycle = .false.
         associate (system => solver%strategy%level%system)
            solver%first = size(centre%x)/system%problem%fourier%n_coefficients + 1
         end associate
         solver%size_of_motion = norm2(centre%x(solver%first:))
         call search%find(solver, centre, solver%one%bounds%n_starts, error)
         if (allocated(error)) return
         do i = 1, 2
            group%range(i, row) = search%known(search%at(i))%value
            group%residual(:, i, row) = search%known(search%at(i))%t
         end do
         group%range(3, row) = centre%value
         group%counts(:, row) = [solver%n_solved, search%n_failed]
         if (search%n_failed > 0) call observer%on_message('the response folds before '// &
            to_text(search%n_failed)//' residual tractions, '//trim(solver%request%describe()))
         call go_back(solver, centre)
      end associate
   end subroutine find_range

   !> The next point starts from a response that is known.
   subroutine go_back(solver, from)
      type(balanced_shares), intent(inout) :: solver
      type(share_point), intent(in) :: from
      type(solver_memory) :: memory

      memory%x = from%x
      memory%omega = solver%request%place()
      call solver%strategy%recall(memory)
   end subroutine go_back

   !> From the response at other shares, by halves of the way where one step does not lead there.
   !> Careful, no step may change more than a small part of the vibration, however short: a fold or a
   !> jump does, and ends the way.
   subroutine solve_on_the_way(self, from, shares, way, done, error)
      class(balanced_shares), intent(inout) :: self
      type(share_point), intent(in) :: from
      real(wp), intent(in) :: shares(:)
      type(share_point), allocatable, intent(out) :: way(:)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(share_point) :: found, here
      type(point_type) :: point
      real(wp) :: at, longest, shortest, step

      allocate (way(0))
      done = .false.
      here = from
      at = 0.0_wp
      longest = 1.0_wp
      shortest = shortest_way
      if (self%is_careful) then
         associate (length => maxval(abs(shares - from%t)))
            longest = min(1.0_wp, longest_step/length)
            shortest = min(0.5_wp*longest, shortest_step/length)
         end associate
      end if
      step = longest
      do while (at < 1.0_wp)
         call go_back(self, here)
         call self%put_shares(merge(shares, from%t + (at + step)*(shares - from%t), &
                                    at + step >= 1.0_wp), error)
         if (allocated(error)) return
         call self%strategy%solve_in_time(self%one, self%request, point, error)
         if (allocated(error)) return
         self%n_solved = self%n_solved + 1
         call self%take(point, found, done)
         if (done) done = self%goes_on(here, found)
         if (done) then
            here = found
            at = min(1.0_wp, at + step)
            if (self%is_careful .or. at >= 1.0_wp) way = [way, found]
            if (self%is_careful) step = min(2.0_wp*step, longest)
         else
            step = 0.5_wp*step
            if (step < shortest) return
         end if
      end do
   end subroutine solve_on_the_way

   !> Whether two responses are on one branch.
   pure logical function goes_on(self, from, to)
      class(balanced_shares), intent(in) :: self
      type(share_point), intent(in) :: from, to

      if (self%is_careful) then
         goes_on = norm2(to%x(self%first:) - from%x(self%first:)) <= &
                   part_of_motion*self%size_of_motion
      else
         goes_on = .not. jumps(from, to)
      end if
   end function goes_on

   !> The shares of the problem that is solved, and of the case. The twin of the law that slopes are
   !> found by (fw_parameter_slopes) keeps its own, which those by shares do not depend on.
   subroutine put_shares(self, shares, error)
      class(balanced_shares), intent(inout) :: self
      real(wp), intent(in) :: shares(:)
      type(error_type), allocatable, intent(out) :: error

      self%one%contact%residual = shares
      self%mover%body%contact%residual = shares
      ! Each pair its own: no one value stands for all.
      call self%mover%change(self%strategy%level%system, 0.0_wp, error)
   end subroutine put_shares

   !> Value and slope of a point at the shares of now; not known where it has none.
   subroutine take(self, point, found, known)
      class(balanced_shares), intent(in) :: self
      type(point_type), intent(in) :: point
      type(share_point), intent(out) :: found
      logical, intent(out) :: known
      type(solver_memory) :: memory
      integer :: k

      known = point%converged .and. allocated(point%sensitivity)
      if (.not. known) return
      found%t = self%one%contact%residual
      do k = 1, size(point%sensitivity)
         associate (block => point%sensitivity(k))
            if (block%quantity /= self%one%bounds%quantity) cycle
            ! Of several observed quantities the first.
            if (block%parameter == of_itself) found%value = block%values(1)
            if (block%parameter == residual_share) found%slope = block%values(:size(found%t))
         end associate
      end do
      call self%strategy%remember(memory)
      known = allocated(memory%x) .and. all(ieee_is_finite(found%slope))
      if (known) call move_alloc(memory%x, found%x)
   end subroutine take

   !> A run that was stopped has not given all.
   pure logical function is_covered(self)
      class(bounds_analysis), intent(in) :: self

      is_covered = self%n_done >= min(size(self%place), self%n_wanted)
   end function is_covered

   !> The range of the rows that are done.
   subroutine conclude(self, case, run, error)
      class(bounds_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      integer :: n_failed

      associate (n => self%n_done, group => self%group, unused => case)
         call self%solver%strategy%describe(self%solver%one, run%state, run%summary, message)
         if (len(message) > 0) call run%observer%on_message(message)
         group%range = group%range(:, :n)
         group%residual = group%residual(:, :, :n)
         group%counts = group%counts(:, :n)
         call run%summary%line('bounds', to_text(sum(group%counts(1, :)))//' responses of '// &
                               to_text(n)//' frequencies')
         n_failed = sum(group%counts(2, :))
         if (n_failed > 0) call run%summary%remarks%add('bounds without solution', &
            to_text(n_failed)//' residual tractions (/bounds/failed) lie behind a fold of the '// &
            'response, or have none: the range is of those that a straight way from the '// &
            'middle leads to')
         call run%writer%add(group, error)
      end associate
   end subroutine conclude

end module fw_run_bounds
