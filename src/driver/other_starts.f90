!> Starts for a point that no way of its own balance reaches: the solutions of easier balances of
!> the same case, or its integration in time. In the order that pays:
!>
!> * a few periods of integration in time, where that costs little;
!> * with fewer harmonics, lifted from level to level: slow stick-slip, whose many harmonics of a
!>   square wave let Newton's method wander, has a smooth beginning. The level that led there goes
!>   along with the sweep, so that the next points that fail have a start at the price of its own;
!> * with softer elastic pairs, or another eps of rigid ones, at the harmonics of the case.
module fw_other_starts
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_integrated_start, only: can_integrate, integrate_a_few
   use fw_kinds, only: wp
   use fw_level, only: harmonic_levels, level_type
   use fw_point, only: point_type, served_by_integration, served_by_other_balance
   use fw_point_solver, only: point_solver
   use fw_solution_history, only: solution_history
   use fw_strategy, only: point_request
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: start_elsewhere

   !> Iterations of all other balances together, beyond which no other one is begun: what the point
   !> had spent before does not count, for it says nothing of these ways.
   integer, parameter :: most_work = 1200
   !> Times the stiffness of elastic pairs, and times the eps of rigid ones: softer ones lead on to
   !> stiffer ones; for eps there is no such order.
   real(wp), parameter :: softer(3) = [0.03_wp, 0.1_wp, 0.3_wp], other_eps(2) = [3.0_wp, 0.3_wp]

   !> What a solver knows, to be given back where a start leads nowhere.
   type :: known_solutions
      type(solution_history) :: solutions
      integer :: point_failures = 0
   end type known_solutions

contains

   !> Solve a point of a level that its own solver did not reach; `point` stays where this fails
   !> too.
   subroutine start_elsewhere(case, level, below, request, everywhere, point, error)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout), target :: level
      !> With fewer harmonics, of an earlier point that failed; not associated without one.
      class(level_type), pointer, intent(inout) :: below
      type(point_request), intent(in) :: request
      !> Whether the point is worth more than a step of that one.
      logical, intent(in) :: everywhere
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      integer :: work, harmonics, served, spent
      logical :: done

      work = 0
      spent = point%iterations
      served = served_by_other_balance
      done = .false.
      if (associated(below)) then
         harmonics = below%harmonics%n_harmonics
         call from_below(case, below, level, request, point, work, done, error)
         if (allocated(error)) return
      end if
      if (done) point%note = trim(started_from(harmonics))
      if (.not. done .and. everywhere .and. can_integrate(case, level)) then
         call by_integration(case, level, request, point, spent, done, error)
         if (allocated(error)) return
         if (done) served = served_by_integration
         if (done) point%note = 'started from some periods of integration in time'
      end if
      if (.not. done .and. everywhere) then
         call by_fewer_harmonics(case, level, below, request, point, work, done, harmonics, error)
         if (allocated(error)) return
         if (done) point%note = trim(started_from(harmonics))
      end if
      if (.not. done .and. everywhere .and. case%contact%n_pairs > 0 .and. work < most_work) then
         call by_stiffness(case, level, request, point, work, done, error)
         if (allocated(error)) return
         if (done) point%note = 'started from another stiffness of its pairs'
      end if
      point%iterations = spent + work
      if (done) point%served_by = served
   end subroutine start_elsewhere

   pure function started_from(harmonics) result(words)
      integer, intent(in) :: harmonics
      character(40) :: words

      words = 'started from '//to_text(harmonics)//' harmonics'
   end function started_from

   !> A step of the level with fewer harmonics, and from there.
   subroutine from_below(case, below, level, request, point, work, done, error)
      type(case_type), intent(in) :: case
      class(level_type), pointer, intent(in) :: below
      type(level_type), intent(inout), target :: level
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      integer, intent(inout) :: work
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: step

      call below%solve(case, bare_request(request, work, fallback=.false.), step, error)
      if (allocated(error)) return
      work = work + step%iterations
      done = step%converged
      if (done) call arrive(case, below, level, request, point, work, done, error, deep=.false.)
   end subroutine from_below

   !> What a balance on the way is asked for, and the work that is left for it.
   function bare_request(request, work, fallback) result(bare)
      type(point_request), intent(in) :: request
      integer, intent(in) :: work
      logical, intent(in) :: fallback
      type(point_request) :: bare

      bare = request
      bare%stability = .false.
      bare%contact = .false.
      bare%histories = .false.
      bare%fallback = fallback
      bare%most_work = min(request%most_work, most_work - work)
   end function bare_request

   !> Up the ladder of harmonics; steps between the last that has a solution and the wanted one are
   !> halved.
   subroutine by_fewer_harmonics(case, level, below, request, point, work, done, lower, error)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout), target :: level
      !> The last level with a solution takes its place.
      class(level_type), pointer, intent(inout) :: below
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      integer, intent(inout) :: work
      logical, intent(out) :: done
      !> Harmonics of the last level with a solution below (0: none).
      integer, intent(out) :: lower
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: ladder(:)
      class(level_type), pointer :: last, next
      integer :: most, upper, k

      nullify (last)
      lower = 0
      done = .false.
      most = case%harmonics%n_harmonics
      ladder = harmonic_levels(most, max(case%model%waves%highest(), &
                                         case%contact%highest_gap()))
      upper = most
      do k = 1, size(ladder) - 1
         if (work >= most_work) exit
         allocate (next)
         call climb(case, ladder(k), request, last, next, work, done, error)
         if (allocated(error)) exit
         if (done) then
            lower = ladder(k)
         else if (lower > 0) then
            ! Higher levels start from this one, which does not lead to this very one.
            upper = ladder(k)
            exit
         end if
      end do
      do while (lower > 0 .and. .not. allocated(error))
         call arrive(case, last, level, request, point, work, done, error)
         if (done .or. allocated(error) .or. work >= most_work) exit
         ! One level more, in the middle of what could not be crossed.
         do
            upper = lower + 2*((upper - lower)/4)
            if (upper <= lower .or. work >= most_work) exit
            allocate (next)
            call climb(case, upper, request, last, next, work, done, error)
            if (done .or. allocated(error)) exit
         end do
         if (.not. done .or. allocated(error)) exit
         lower = upper
         upper = most
      end do
      if (.not. associated(last)) return
      if (associated(below)) deallocate (below)
      below => last
   end subroutine by_fewer_harmonics

   !> With other stiffnesses of the pairs.
   subroutine by_stiffness(case, level, request, point, work, done, error)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout), target :: level
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      integer, intent(inout) :: work
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      class(case_type), allocatable :: easier
      class(level_type), pointer :: last, next
      real(wp), allocatable :: scales(:)
      logical :: rigid
      integer :: k

      nullify (last)
      done = .false.
      associate (forces => level%system%problem%forces)
         rigid = forces%entry(forces%pairs)%law%prediction%takes_balance
      end associate
      scales = softer
      if (rigid) scales = other_eps
      allocate (easier, source=case)
      do k = 1, size(scales)
         if (work >= most_work) exit
         if (rigid) then
            easier%contact%penalty_scale = scales(k)*case%contact%penalty_scale
         else
            easier%contact%tangential_stiffness = scales(k)*case%contact%tangential_stiffness
            easier%contact%normal_stiffness = scales(k)*case%contact%normal_stiffness
         end if
         allocate (next)
         call climb(easier, case%harmonics%n_harmonics, request, last, next, work, done, error)
         if (allocated(error)) exit
         if (.not. done .or. (.not. rigid .and. k < size(scales))) cycle
         call arrive(case, last, level, request, point, work, done, error)
         if (done .or. allocated(error)) exit
      end do
      if (associated(last)) deallocate (last)
   end subroutine by_stiffness

   !> Solve an easier balance, from the last one that has a solution; where it has one, it takes its
   !> place, else it is given back.
   subroutine climb(easier, n_harmonics, request, last, next, work, done, error)
      type(case_type), intent(in) :: easier
      integer, intent(in) :: n_harmonics
      type(point_request), intent(in) :: request
      class(level_type), pointer, intent(inout) :: last, next
      integer, intent(inout) :: work
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      done = .false.
      call next%build(easier, n_harmonics, error)
      if (.not. allocated(error)) then
         if (associated(last)) call next%take_over(last)
         call next%solve(easier, bare_request(request, work, fallback=.true.), point, error)
      end if
      if (.not. allocated(error)) then
         work = work + point%iterations
         done = point%converged
      end if
      if (done) then
         if (associated(last)) deallocate (last)
         last => next
      else
         deallocate (next)
      end if
      nullify (next)
   end subroutine climb

   !> From the solution of another balance to the wanted one.
   subroutine arrive(case, last, level, request, point, work, done, error, deep)
      type(case_type), intent(in) :: case
      type(level_type), intent(in) :: last
      type(level_type), intent(inout), target :: level
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      integer, intent(inout) :: work
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      !> Whether every way of its own balance is gone from there (default).
      logical, intent(in), optional :: deep
      type(known_solutions) :: known

      known = solutions_of(level%solver)
      call level%take_over(last)
      call go_from_here(case, level, known, request, point, work, done, error, deep)
   end subroutine arrive

   !> From the last period of an integration. What this way spends says nothing of the others, nor
   !> theirs of it.
   subroutine by_integration(case, level, request, point, spent, done, error)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout), target :: level
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      !> Iterations.
      integer, intent(inout) :: spent
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)
      type(known_solutions) :: known
      integer :: work

      call integrate_a_few(case, level, request, x, done, error)
      if (allocated(error) .or. .not. done) return
      known = solutions_of(level%solver)
      call level%solver%walk%known%begin_with(request%place(), x)
      work = 0
      call go_from_here(case, level, known, request, point, work, done, error)
      spent = spent + work
   end subroutine by_integration

   !> Solve from what the solver has just been given; it takes back what it knew where that fails.
   subroutine go_from_here(case, level, known, request, point, work, done, error, deep)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout), target :: level
      type(known_solutions), intent(in) :: known
      type(point_request), intent(in) :: request
      type(point_type), intent(inout) :: point
      integer, intent(inout) :: work
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: deep
      type(point_request) :: plain
      type(point_type) :: trial
      logical :: goes_deep

      done = .false.
      plain = request
      plain%fallback = .false.
      plain%again = .true.
      call level%solve(case, plain, trial, error)
      if (allocated(error)) return
      work = work + trial%iterations
      goes_deep = work < most_work
      if (present(deep)) goes_deep = goes_deep .and. deep
      if (.not. trial%converged .and. goes_deep) then
         ! Pseudo-time flows on from here, where Newton's method has gone astray.
         plain%fallback = .true.
         plain%most_work = min(request%most_work, most_work - work)
         level%solver%method%flow_failures = 0
         call level%solve(case, plain, trial, error)
         if (allocated(error)) return
         work = work + trial%iterations
      end if
      done = trial%converged
      if (done) then
         point = trial
      else
         call give_back(known, level%solver)
      end if
   end subroutine go_from_here

   pure function solutions_of(solver) result(known)
      type(point_solver), intent(in) :: solver
      type(known_solutions) :: known

      known%solutions = solver%walk%known
      known%point_failures = solver%walk%failures
   end function solutions_of

   pure subroutine give_back(known, solver)
      type(known_solutions), intent(in) :: known
      type(point_solver), intent(inout) :: solver

      solver%walk%known = known%solutions
      solver%walk%failures = known%point_failures
   end subroutine give_back

end module fw_other_starts
