!> A response of given accuracy (accuracy > 0): harmonics and instants are raised at each point
!> until an estimate of the error is within it.
!>
!> The error is that of the Fourier coefficients of an observed quantity, in the root mean square
!> over the period and relative to its vibration; the largest of all observed quantities counts.
!> What the harmonics leave out is estimated from the tail, which the forces of the solution tell
!> (fw_known_tail): once the motion above H is known, the answer moves from u to u2, and would move
!> on to u3. u2 is the answer; its error is about |u3 - u2|, which, or a part of |u2 - u|, is taken
!> three times. Nothing is claimed where the first change is so large, or the second so little
!> smaller, that the linearization says nothing. For slip in two directions, and where a law cannot
!> tell its tail, a solution with less than half of the harmonics is compared with: if errors fall
!> at least like H**(-p),
!>
!>    error <= |u_fine - u_coarse| / ((H_fine/H_coarse)**p - 1).
!>
!> Two solutions that lack the same harmonics agree, for one where a harmonic above both meets a
!> mode: so the error is no less than a multiple of |u2 - u|, which knows the motion above H; and
!> that of rigid pairs no less than what is left if steps from one number to the next go on falling
!> as they fell last.
!>
!> What instants leave out is estimated by solving again with half of them.
!>
!> A point whose estimates do not come nearer is left: finer balances that only other ways than
!> Newton's method reach cost many times the others, and seldom end in a claim.
!>
!> Rigid friction with one tangential direction is solved by the oscillator law whatever its word
!> is: it is the same friction, and its tail is the right one.
module fw_accuracy
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_accuracy_options, only: limits
   use fw_case, only: case_type
   use fw_claim_counts, only: claim_counts
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_harmonics_options, only: sampling_uniform
   use fw_known_tail, only: all_know_tails, is_like_structure, known_tail, relative_distance, &
      unknown
   use fw_laws, only: is_rigid, law_under_accuracy
   use fw_level, only: describe_levels, harmonic_levels, level_type
   use fw_linear_step, only: linear_step_type
   use fw_point, only: point_type
   use fw_run_state, only: run_state
   use fw_reduction, only: held_basis
   use fw_solver_options, only: solver_newton
   use fw_strategy, only: point_request, point_strategy, solver_memory
   use fw_summary, only: summary_type
   implicit none (type, external)
   private

   public :: accuracy_solver

   !> Halvings of the instants that are tried, below 0; doublings are in `limits`.
   integer, parameter :: fewest = -1

   type, extends(point_strategy) :: accuracy_solver
      !> Numbers of harmonics to choose from, ascending.
      integer, allocatable :: n_harmonics(:)
      !> The level in use.
      integer :: current = 2, doublings = 0
      !> What half of the instants changes is multiplied by this (0: they leave no error).
      real(wp) :: factor_time = 0.0_wp
      !> What became of the points.
      type(claim_counts) :: counts
      !> (numbers of harmonics, doublings of the instants)
      type(level_type), allocatable :: level(:, :)
      !> Modes of the structure with its contact held, which all of them share.
      type(held_basis), private :: held
      type(known_tail), allocatable, private :: tail(:, :)
      !> What instants were last found to leave out.
      real(wp), allocatable, private :: by_instants(:, :)
      !> How far the tail of the last solution moved it, where that was looked for.
      real(wp), private :: change = unknown
      !> The case with the law that is solved; whether a pair has two tangential directions.
      class(case_type), allocatable, private :: case
      logical, private :: planar = .false.
      !> What may end the work on the present point.
      class(interrupt_type), pointer, private :: interrupt => null()
      !> What is asked of it.
      type(point_request), private :: asked
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: remember
      procedure :: recall
      procedure :: account
   end type accuracy_solver

contains

   !> The case gives the largest number of harmonics.
   subroutine start(self, case, error)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      self%n_harmonics = harmonic_levels(case%harmonics%n_harmonics, &
                                         max(case%model%waves%highest(), &
                                             case%contact%highest_gap()))
      allocate (self%level(size(self%n_harmonics), fewest:limits%most_doublings))
      allocate (self%tail(size(self%n_harmonics), fewest:limits%most_doublings))
      allocate (self%by_instants(size(self%n_harmonics), fewest:limits%most_doublings), &
                source=unknown/limits%safety)
      if (case%contact%n_pairs > 0) self%factor_time = limits%factor_instants
      if (allocated(self%case)) deallocate (self%case)
      allocate (self%case, source=case)
      self%case%contact%law = law_under_accuracy(case%contact, &
                                                 case%harmonics%sampling == sampling_uniform)
      call need(self, self%current, self%doublings, error)
      if (allocated(error)) return
      associate (system => self%level(self%current, self%doublings)%system)
         associate (row => system%problem%joint%row)
            self%planar = any(row(1, :) > 0 .and. row(2, :) > 0)
         end associate
         if (system%problem%forces%entry(system%problem%forces%pairs)%law%facts%follows_events) then
            self%factor_time = 0.0_wp
         end if
      end associate
   end subroutine start

   !> Build a level if it is not there.
   subroutine need(self, k, doublings, error)
      class(accuracy_solver), intent(inout) :: self
      integer, intent(in) :: k, doublings
      type(error_type), allocatable, intent(out) :: error

      call self%level(k, doublings)%build(self%case, self%n_harmonics(k), error, doublings, &
                                          held=self%held)
   end subroutine need

   !> Solve at a frequency; the point says at which level, and how accurately.
   subroutine solve(self, case, request, point, error)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: best
      !> Estimated errors of truncation and sampling, and those of the best solution: a finer one
      !> that fails tells nothing of either.
      real(wp) :: errors(2), of_best(2)
      type(point_request) :: asked
      integer :: iterations, failures, first, at_best(2)
      integer(int64) :: clock, clock_end, rate
      logical :: finer

      self%interrupt => request%interrupt
      self%asked = request
      asked = request
      iterations = 0
      failures = 0
      first = -1
      at_best = [self%current, self%doublings]
      call system_clock(clock, rate)
      do
         associate (level => self%level(self%current, self%doublings))
            call level%solve(self%case, asked, point, error)
         end associate
         if (allocated(error)) return
         iterations = iterations + point%iterations
         errors = [unknown, 0.0_wp]
         if (point%converged) then
            call estimate(self, point, errors, iterations, error)
            if (allocated(error)) return
            point%error_estimate = total(errors)
            best = point
            of_best = errors
            at_best = [self%current, self%doublings]
            if (point%error_estimate <= case%harmonics%accuracy) exit
         else
            failures = failures + 1
            if (best%converged) call self%counts%note_left(request%omega, iterations, &
                                                           self%n_harmonics(self%current))
            if (best%converged .or. failures > limits%most_failures) exit
         end if
         if (best%converged .and. case%solver%kind == solver_newton) then
            if (first < 0) first = iterations
            asked%most_work = first + limits%most_work - iterations
            if (is_left(self, errors(1), iterations - first)) then
               call self%counts%note_left(request%omega, iterations, &
                                          self%n_harmonics(self%current))
               exit
            end if
         end if
         call refine(self, errors, finer, error)
         if (allocated(error)) return
         if (.not. finer) exit
      end do
      if (.not. point%converged) then
         ! The next point starts where this one did, or where it was solved.
         self%current = at_best(1)
         self%doublings = at_best(2)
         if (best%converged) then
            point = best
            errors = of_best
         end if
      end if
      if (point%converged) call improve(self, case, request, at_best, point)
      point%iterations = iterations
      call system_clock(clock_end)
      point%seconds = real(clock_end - clock, wp)/real(rate, wp)
      if (point%converged) call self%counts%note(point%error_estimate, case%harmonics%accuracy, &
                                                 point%omega)
      if (.not. point%converged) return
      call coarsen(self, errors, error)
   end subroutine solve

   !> Whether finer balances are not worth their work.
   pure logical function is_left(self, error, work)
      class(accuracy_solver), intent(in) :: self
      !> By harmonics, so far.
      real(wp), intent(in) :: error
      !> Iterations on finer levels.
      integer, intent(in) :: work
      real(wp) :: nearest

      is_left = work >= limits%most_work
      if (is_left .or. work < limits%much_work) return
      nearest = (real(self%n_harmonics(self%current), wp)/ &
                 real(maxval(self%n_harmonics), wp))**limits%fastest*min(error, self%change)
      is_left = nearest > self%case%harmonics%accuracy .and. nearest < sqrt(unknown)
   end function is_left

   !> Bounds of what the harmonics and the instants of the present solution leave out.
   subroutine estimate(self, point, errors, iterations, error)
      class(accuracy_solver), intent(inout) :: self
      type(point_type), intent(in) :: point
      real(wp), intent(out) :: errors(2)
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: seen, unused
      logical :: told

      errors = [unknown, 0.0_wp]
      self%change = unknown
      seen = 0.0_wp
      told = .false.
      if (.not. self%planar) then
         call bound_by_tail(self, point, errors(1), seen, iterations, told, error)
         if (allocated(error)) return
      end if
      if (.not. told) then
         call bound_by_order(self, point, errors(1), iterations, error)
         if (allocated(error)) return
         ! Slip in two directions: what is about to be claimed is worth another evaluation.
         if (self%planar .and. errors(1) <= self%case%harmonics%accuracy) then
            call bound_by_tail(self, point, unused, seen, iterations, told, error)
            if (allocated(error)) return
         end if
         errors(1) = max(errors(1), seen)
      end if
      if (self%factor_time <= 0.0_wp) return
      call bound_by_instants(self, point, errors(2), iterations, error)
   end subroutine estimate

   !> How far the solution with half of the instants is, times a factor.
   subroutine bound_by_instants(self, point, bound, iterations, error)
      class(accuracy_solver), intent(inout) :: self
      type(point_type), intent(in) :: point
      real(wp), intent(out) :: bound
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      associate (known => self%by_instants(self%current, self%doublings))
         call check(self, self%current, self%doublings - 1, iterations, error)
         if (allocated(error)) return
         bound = unknown
         associate (level => self%level(self%current, self%doublings - 1))
            if (is_solved(level, self%asked%place())) bound = self%factor_time* &
               relative_distance(point%coefficients, level%coefficients)
         end associate
         known = min(bound, unknown/limits%safety)
      end associate
   end subroutine bound_by_instants

   !> What the known tail changes, times a factor, and what is left above it; told is false where it
   !> does not tell.
   subroutine bound_by_tail(self, point, bound, seen, iterations, told, error)
      class(accuracy_solver), intent(inout) :: self
      type(point_type), intent(in) :: point
      real(wp), intent(out) :: bound
      !> Where it does not tell: what any other bound must not go below.
      real(wp), intent(out) :: seen
      integer, intent(inout) :: iterations
      logical, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: change, next

      bound = unknown
      seen = 0.0_wp
      associate (level => self%level(self%current, self%doublings), &
                 tail => self%tail(self%current, self%doublings))
         tail%is_better = .false.
         told = is_like_structure(level%system)
         if (.not. told) return
         call tail%start(self%case, level%harmonics, level%system, level%solver%x, told, error, &
                         self%held)
         if (allocated(error) .or. .not. told) return
         ! The derivative at the solution: as much work as another iteration.
         iterations = iterations + 1
         call tail%correct(level%system, change)
         self%change = change
         ! The tails of coupled directions do not contract for sure: they tell, and bound nothing.
         told = .not. self%planar
         if (.not. change <= limits%linear_up_to) then
            seen = change
            return
         end if
         call tail%next_change(level%system, next)
         if (next > max(limits%contraction*change, limits%round_off)) then
            seen = limits%factor_seen_only*max(tail%distance_from(point%coefficients), next)
            ! Rigid pairs may find other states of stick and slip with more harmonics.
            told = told .and. is_rigid(self%case%contact) .and. self%case%contact%n_pairs > 0
            return
         end if
         seen = limits%factor_seen*tail%distance_from(point%coefficients)
         if (.not. told) return
         if (.not. all_know_tails(level%system) .and. &
             level%harmonics%n_harmonics <= limits%few_harmonics) return
         tail%is_better = change <= limits%better_below
         if (tail%is_better) then
            bound = limits%factor_of_tail*max(next, limits%least_part*change) &
                    + tail%left_above(self%case%harmonics%n_harmonics)
         else
            bound = limits%factor_of_tail*tail%distance_from(point%coefficients)
         end if
         if (is_rigid(self%case%contact) .and. .not. all_know_tails(level%system)) then
            bound = max(bound, limits%part_of_step*last_step(self, point))
         end if
      end associate
   end subroutine bound_by_tail

   !> How far the answer moved from the number of harmonics below, if that was solved here.
   real(wp) function last_step(self, point) result(step)
      class(accuracy_solver), intent(in) :: self
      type(point_type), intent(in) :: point

      step = 0.0_wp
      if (self%current < 2) return
      associate (coarser => self%level(self%current - 1, self%doublings), &
                 below => self%tail(self%current - 1, self%doublings), &
                 here => self%tail(self%current, self%doublings))
         if (.not. is_solved(coarser, self%asked%place())) return
         if (here%is_better .and. below%is_better) then
            step = here%distance_apart(below)
         else if (here%is_better) then
            step = here%distance_from(coarser%coefficients)
         else
            step = relative_distance(point%coefficients, coarser%coefficients)
         end if
      end associate
   end function last_step

   !> How far a solution with less than half of the harmonics is, times what the order allows.
   subroutine bound_by_order(self, point, bound, iterations, error)
      class(accuracy_solver), intent(inout) :: self
      type(point_type), intent(in) :: point
      real(wp), intent(out) :: bound
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: order
      integer :: k

      bound = unknown
      order = limits%order_elastic
      if (is_rigid(self%case%contact)) then
         order = limits%order_rigid
         if (is_like_structure(self%level(self%current, self%doublings)%system)) then
            order = limits%order_massless
         end if
      end if
      do k = max(1, self%current - 2), self%current - 1
         if (order <= limits%order_rigid .and. self%n_harmonics(k) < limits%fewest_on_mass) cycle
         call check(self, k, self%doublings, iterations, error)
         if (allocated(error)) return
         if (.not. is_solved(self%level(k, self%doublings), self%asked%place())) cycle
         bound = factor_harmonics(self%n_harmonics(self%current), self%n_harmonics(k), order)* &
                 relative_distance(point%coefficients, self%level(k, self%doublings)%coefficients)
         exit
      end do
      if (is_rigid(self%case%contact) .and. bound <= self%case%harmonics%accuracy) then
         call bound_by_decay(self, point, bound, iterations, error)
      end if
   end subroutine bound_by_order

   !> A rigid pair that slips nearly always turns round in so short a time that solutions with few
   !> harmonics agree and are all wrong, by as much: the next step is then no smaller than the last
   !> one. What is left is no less than what follows if steps go on falling as they did.
   subroutine bound_by_decay(self, point, bound, iterations, error)
      class(accuracy_solver), intent(inout) :: self
      type(point_type), intent(in) :: point
      real(wp), intent(inout) :: bound
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: last, before
      integer :: k
      logical :: known

      known = self%n_harmonics(self%current) > limits%few_harmonics .and. self%current > 2
      do k = self%current - 1, max(self%current - 2, 1), -1
         if (.not. known) exit
         call check(self, k, self%doublings, iterations, error)
         if (allocated(error)) return
         known = is_solved(self%level(k, self%doublings), self%asked%place())
      end do
      if (known) then
         associate (finer => self%level(self%current - 1, self%doublings)%coefficients)
            last = relative_distance(point%coefficients, finer)
            before = relative_distance(finer, &
                                       self%level(self%current - 2, self%doublings)%coefficients)
         end associate
         if (last <= limits%round_off) return
         known = last < before
      end if
      if (known) bound = max(bound, last*last/(before - last))
      if (.not. known) bound = unknown
   end subroutine bound_by_decay

   !> The answer with its tail, where that is the better one.
   subroutine improve(self, case, request, at, point)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      integer, intent(in) :: at(2)
      type(point_type), intent(inout) :: point

      if (.not. self%tail(at(1), at(2))%is_better) return
      call self%tail(at(1), at(2))%take(case%harmonics%n_harmonics, request%contact, point)
   end subroutine improve

   !> A coarser solution to compare with, from the present one: nothing is asked of it but its
   !> observed coefficients, and fallbacks would look too far away.
   subroutine check(self, k, doublings, iterations, error)
      class(accuracy_solver), intent(inout) :: self
      integer, intent(in) :: k, doublings
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      if (is_solved(self%level(k, doublings), self%asked%place())) return
      call need(self, k, doublings, error)
      if (allocated(error)) return
      associate (level => self%level(k, doublings))
         call level%take_over(self%level(self%current, self%doublings))
         call level%solve(self%case, point_request(omega=self%asked%omega, &
                                              has_value=self%asked%has_value, &
                                              value=self%asked%value, &
                                              interrupt=self%interrupt, fallback=.false., &
                                              histories=self%case%output%histories), point, error)
      end associate
      if (allocated(error)) return
      ! A tail that was known here was that of another place.
      self%tail(k, doublings)%is_better = .false.
      iterations = iterations + point%iterations
   end subroutine check

   !> A level that was solved at this very place last is not solved again.
   pure logical function is_solved(level, place)
      type(level_type), intent(in) :: level
      real(wp), intent(in) :: place

      is_solved = level%is_solved .and. abs(level%place - place) <= 0.0_wp
   end function is_solved

   !> What the distance of two solutions is multiplied by to bound the error of the finer.
   pure real(wp) function factor_harmonics(fine, coarse, order) result(factor)
      !> Numbers of harmonics.
      integer, intent(in) :: fine, coarse
      real(wp), intent(in) :: order

      factor = 1.0_wp/((real(fine, wp)/real(coarse, wp))**order - 1.0_wp)
      factor = max(factor, merge(limits%least_factor_of_few, limits%least_factor, &
                                 fine <= limits%few_for_order))
   end function factor_harmonics

   !> Sum of estimates, of which one may be unknown.
   pure real(wp) function total(errors)
      real(wp), intent(in) :: errors(2)

      total = unknown
      if (all(errors < unknown)) total = sum(errors)
   end function total

   !> More of what the error comes from.
   subroutine refine(self, errors, finer, error)
      class(accuracy_solver), intent(inout) :: self
      real(wp), intent(in) :: errors(2)
      logical, intent(out) :: finer
      type(error_type), allocatable, intent(out) :: error
      logical :: more(2), possible(2)

      ! Either of both may take half of what is allowed.
      more = errors > 0.5_wp*self%case%harmonics%accuracy
      possible = [self%current < size(self%n_harmonics), self%doublings < limits%most_doublings]
      finer = all(possible .or. .not. more)
      if (finer) call move(self, self%current + merge(1, 0, more(1)), &
                           self%doublings + merge(1, 0, more(2)), error)
   end subroutine refine

   !> Less of what the next point will hardly need.
   subroutine coarsen(self, errors, error)
      class(accuracy_solver), intent(inout) :: self
      real(wp), intent(in) :: errors(2)
      type(error_type), allocatable, intent(out) :: error
      logical :: less(2)

      ! Down to the second number, which still has one below to be compared with.
      less = errors <= limits%with_margin*self%case%harmonics%accuracy .and. &
             [self%current > 2, self%doublings > 0]
      if (any(less)) call move(self, self%current - merge(1, 0, less(1)), &
                               self%doublings - merge(1, 0, less(2)), error)
   end subroutine coarsen

   !> Go over to another level, with the present solution as the last known one.
   subroutine move(self, k, doublings, error)
      class(accuracy_solver), intent(inout) :: self
      integer, intent(in) :: k, doublings
      type(error_type), allocatable, intent(out) :: error

      call need(self, k, doublings, error)
      if (allocated(error)) return
      if (self%level(self%current, self%doublings)%solver%walk%known%kept > 0) then
         call self%level(k, doublings)%take_over(self%level(self%current, self%doublings))
      end if
      self%current = k
      self%doublings = doublings
   end subroutine move

   !> What the points took, and where they miss the accuracy that was asked for.
   subroutine describe(self, case, state, summary, message)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message
      type(linear_step_type) :: work
      integer :: j, k

      do j = fewest, limits%most_doublings
         do k = 1, size(self%n_harmonics)
            call work%add_work(self%tail(k, j)%linear)
         end do
      end do
      call describe_levels(size(self%level), self%level, case%solver%kind, &
                           state%all_converged(), summary, work)
      call summary%describe_accuracy(self%counts%worst_claimed, case%harmonics%accuracy, &
                                     self%counts%n_claimed, self%counts%n_short)
      call self%counts%tell(case%harmonics%accuracy, message)
   end subroutine describe

   !> The level in use and its last solution.
   subroutine remember(self, memory)
      class(accuracy_solver), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      memory%level = [self%current, self%doublings]
      associate (solver => self%level(self%current, self%doublings)%solver)
         if (solver%walk%known%kept == 0) return
         memory%x = solver%walk%known%x(:, 1)
         memory%omega = solver%walk%known%place(1)
      end associate
   end subroutine remember

   !> What was tried for the last point at the level in use.
   function account(self) result(words)
      class(accuracy_solver), intent(in) :: self
      character(480) :: words

      words = self%level(self%current, self%doublings)%solver%walk%account()
   end function account

   !> Go on with that level: a solution fits no other.
   subroutine recall(self, memory)
      class(accuracy_solver), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      self%current = memory%level(1)
      self%doublings = memory%level(2)
      associate (walk => self%level(self%current, self%doublings)%solver%walk)
         call walk%known%begin_with(memory%omega, memory%x)
      end associate
   end subroutine recall

end module fw_accuracy
