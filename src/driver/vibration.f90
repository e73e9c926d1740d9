!> What a point is the solution of, whatever it is: a response, one of a given amplitude, a
!> nonlinear mode, a resonance. And the walk that leads to it from what is known: every kind of
!> vibration is brought to a place, solved there from a guess, and says what else it offers; the
!> walk tries its ways in their order.
module fw_vibration
   use fw_balance_state, only: balance_state
   use fw_error, only: error_type
   use fw_failed_starts, only: failed_starts
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver, solver_report
   use fw_point, only: served_by_newton, served_by_none, served_by_other_guess
   use fw_solution_history, only: position, solution_history
   implicit none (type, external)
   private

   public :: ends, looks_again, six_digits, vibration, walk_options, walk_type, way_type
   public :: way_guesses_by_lu, way_last_guess, way_own, way_rise, way_steps

   !> Kinds of ways behind the guesses. Of every vibration: the guesses with LU where GMRES failed;
   !> the guess behind all others; smaller steps from the last solution; a level that is raised.
   !> Further ones are its own, from way_own on.
   integer, parameter :: way_guesses_by_lu = 1, way_last_guess = 2, way_steps = 3, way_rise = 4, &
                         way_own = 5

   !> A way to a point, and when it is gone.
   type :: way_type
      character(24) :: word = ''
      integer :: kind = way_steps
      !> What the point says where it served; served_by_none: the way says it.
      integer :: served_by = served_by_none
      !> Where no solution is known to come from, or where one is.
      logical :: as_first = .true., as_next = .true.
      !> Unknowns: more than the first, no more than the second.
      integer :: more_than = -1, up_to = huge(1)
      !> Also where solutions of the point were refused for friction that is ripple.
      logical :: after_ripple = .true.
      !> Left out where many points in a row have failed.
      logical :: is_costly = .false.
      !> Its iterations do not count against the work that a point is worth.
      logical :: is_last = .false.
      !> Halvings of a step.
      integer :: halvings = 6
   end type way_type

   !> Thresholds of a walk.
   type :: walk_options
      !> Steps of `reach`: the first, the longest, the shortest, how they grow after one that
      !> served, and the whole way, of which no step is longer.
      real(wp) :: first = 0.25_wp, longest = 0.5_wp, shortest = 1.0e-5_wp, growth = 1.5_wp, &
                  whole = huge(1.0_wp)
      !> Steps of a level that is raised, over the whole of it: the first, the shortest, and how
      !> they grow: slower up than down, for a failure costs more than a step.
      real(wp) :: first_rise = 0.25_wp, shortest_rise = 1.0_wp/512.0_wp, rise_growth = 1.5_wp
      !> From nearly nothing, where guesses are exact: the same for the first tenth, of which the
      !> shortest step is a part of what is reached, and a first step that fails is the last. Each
      !> step is solved from all guesses.
      logical :: from_nothing = .false.
      real(wp) :: early_growth = 2.0_wp
      !> Go no way twice from the same start.
      logical :: skips_failed = .false.
      !> Iterations spent on a point after which no other way to it is begun, over max_iterations,
      !> of which at least as many count; 0: no limit. (Where a sector loses its hold,
      !> points take 470 at most, and none of those with a solution took more than 25.)
      integer :: work = 0, least_counted = 60
      !> The same of raising the level, over what was spent before: it advances step by step, and
      !> where it gets there no other way did.
      integer :: raising_work = 50
   end type walk_options

   !> Natural steps along a path: what is known, how far steps go, what the present point has cost.
   type :: walk_type
      type(walk_options) :: limits
      type(solution_history) :: known
      !> Ways behind its guesses, in their order.
      type(way_type), allocatable :: ways(:)
      !> Step that served last.
      real(wp) :: step = 0.25_wp
      !> The place that is wanted, and the best that was found of it where nothing converged.
      type(position) :: wanted
      real(wp) :: best_residual = huge(1.0_wp)
      real(wp), allocatable :: best(:)
      !> Points without a solution since the last one with it.
      integer :: failures = 0
      !> Iterations of a point from which on no other way is begun, the most that its request
      !> allows, and whether that was so.
      integer :: work_limit = huge(1), most_allowed = huge(1)
      !> Iterations of a solver while a level is raised.
      integer :: raise_unit = 0
      logical :: out_of_work = .false.
      !> Only the first of the guesses is tried.
      logical :: one_guess = .false.
      !> Friction of the present point was ripple in a solution of its solver, or of any way. Then
      !> smaller steps, LU and the free guess came to no other one (0 of 180 such points of dlft on
      !> masses), and other balances neither where the solver had found it (0 of 140).
      logical :: found_ripple = .false., ripples = .false.
      !> Ways behind the guesses that were gone to the present point.
      character(160) :: tried = ''
      !> What gave the present solution, the guess that did, and whether it was the first.
      integer :: served_by = served_by_none, guess = 0
      logical :: was_first = .false.
      !> Where the present point was started from in vain.
      type(failed_starts) :: failed
      !> Iterations that do not count, and whether LU follows GMRES.
      integer, private :: spent_last = 0
      logical, private :: by_lu = .false.
   contains
      procedure :: begin_point
      procedure :: go
      procedure :: from_guesses
      procedure :: by_steps
      procedure :: reach
      procedure :: goes_on
      procedure :: restart
      procedure :: is_new
      procedure :: note_attempt
      procedure :: note_best
      procedure :: account
   end type walk_type

   type, abstract :: vibration
      !> Where forces and states are of the solution: what is recovered, and what stability reads.
      type(balance_state), pointer :: balance => null()
      !> Solves it, or the balance behind it.
      type(newton_solver) :: newton
      !> Guesses of `from_guesses`, in their order, and what a point says that each has served; the
      !> first that is there goes before those that are another one.
      integer :: n_guesses = 2
      integer :: served_by_first = served_by_newton, served_by(4) = served_by_other_guess
      !> Iterations since it was set to 0.
      integer :: iterations = 0
      !> The last solution was refused: its friction is ripple.
      logical :: ripples = .false.
      !> No way leads to the present point, as its guesses have shown.
      logical :: is_hopeless = .false.
      !> The level below which none can be asked for.
      real(wp) :: rest = 0.0_wp
   contains
      procedure(bring_to_place), deferred :: stand
      procedure(solve_from_guess), deferred :: solve
      procedure :: make_guess => guess_from_known
      procedure :: is_same
      procedure :: offers
      procedure :: try_own
   end type vibration

   abstract interface
      !> Bring all that it is made of to a place.
      subroutine bring_to_place(self, at, error)
         import :: vibration, position, error_type
         implicit none (type, external)
         class(vibration), intent(inout) :: self
         type(position), intent(in) :: at
         type(error_type), allocatable, intent(out) :: error
      end subroutine bring_to_place

      !> From a guess to a solution where it stands; not converged where what solves the equations
      !> is no vibration. It counts its iterations.
      subroutine solve_from_guess(self, x, report, error)
         import :: vibration, wp, solver_report, error_type
         implicit none (type, external)
         class(vibration), intent(inout) :: self
         real(wp), intent(inout), contiguous :: x(:)
         type(solver_report), intent(out) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_from_guess
   end interface

   !> Points that fail in a row after which a sweep spends less on a point: it has gone where no
   !> solution exists, or where none is found in this way. After 4, 8, 16, .. of them it looks
   !> again: a sweep that begins where nothing is found comes to where something is.
   integer, parameter :: most_point_failures = 2

   !> Share of a level below which one that is raised from nothing counts as early.
   real(wp), parameter :: early = 0.1_wp
   !> Marks of a start that was tried with LU behind GMRES.
   integer, parameter :: mark_solver = 1, mark_lu = 2

contains

   !> Whether a point is worth every way to it, with it the number of points in a row that failed.
   pure logical function looks_again(n_failed)
      integer, intent(in) :: n_failed

      looks_again = n_failed <= most_point_failures .or. popcnt(n_failed) == 1
   end function looks_again

   !> Nothing more is to be tried.
   pure logical function ends(report)
      type(solver_report), intent(in) :: report

      ends = report%converged .or. report%interrupted
   end function ends

   !> Extrapolated from the last solutions, then the last one.
   subroutine guess_from_known(self, guess, at, known, x, is_there, error)
      class(vibration), intent(inout) :: self
      !> 1, 2, .. in the order in which they are tried.
      integer, intent(in) :: guess
      type(position), intent(in) :: at
      type(solution_history), intent(in) :: known
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: is_there
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_error => allocated(error))
      end associate
      call known%guess(guess, at%along, x, is_there)
   end subroutine guess_from_known

   !> Whether a solution is one of the curve that its guess was made of.
   logical function is_same(self, x, guess, known)
      class(vibration), intent(inout) :: self
      real(wp), intent(in) :: x(:), guess(:)
      type(solution_history), intent(in) :: known

      associate (unused => self, unused_x => x, unused_guess => guess, unused_known => known)
      end associate
      is_same = .true.
   end function is_same

   !> What was tried for a point that was not found, and what that met.
   function account(self) result(words)
      class(walk_type), intent(in) :: self
      character(480) :: words

      words = 'tried were every pair stuck'
      if (self%known%kept > 0) words = 'tried were the last solutions, every pair stuck'
      words = trim(words)//self%tried
      if (self%best_residual < huge(1.0_wp)) then
         words = trim(words)//'; the best ended at a residual of '//six_digits(self%best_residual)
      end if
      if (self%found_ripple .or. self%ripples) then
         words = trim(words)//'; what solved the equations had friction that is ripple'
      end if
      if (self%out_of_work) words = trim(words)//'; the iterations that a point is worth were spent'
      if (self%known%kept == 0) return
      if (abs(self%known%place(1) - self%wanted%along) > 0.0_wp) then
         words = trim(words)//'; the last solution is at '//six_digits(self%known%place(1))
         if (turns(self%known)) words = trim(words)//', where the curve grows steeper, as '// &
                                        'before a fold: continuation = ''arclength'' follows one'
      end if
   end function account

   !> Whether the last solutions change ever faster, by their distances over those of their places.
   pure logical function turns(known)
      type(solution_history), intent(in) :: known
      !> The last two slopes over each other: those of a root whose end is within the next step are
      !> 1.3 to 2.4.
      real(wp), parameter :: steeper = 1.3_wp
      real(wp) :: slope(2), step
      integer :: k

      turns = .false.
      if (known%kept < 3) return
      do k = 1, 2
         step = abs(known%place(k) - known%place(k + 1))
         if (.not. step > 0.0_wp) return
         slope(k) = norm2(known%x(:, k) - known%x(:, k + 1))/step
      end do
      turns = slope(1) > steeper*slope(2)
   end function turns

   !> A number to read.
   function six_digits(number) result(words)
      real(wp), intent(in) :: number
      character(24) :: words

      write (words, '(es12.5)') number
      words = adjustl(words)
   end function six_digits

   !> Whether a way of its table can be gone now.
   logical function offers(self, way)
      class(vibration), intent(in) :: self
      type(way_type), intent(in) :: way

      associate (unused => self, unused_way => way)
      end associate
      offers = .true.
   end function offers

   !> Go a way of its own.
   subroutine try_own(self, way, walk, at, x, report, error)
      class(vibration), intent(inout) :: self
      type(way_type), intent(in) :: way
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      !> Of the ways before on entry.
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_way => way, unused_walk => walk, unused_at => at, &
                 unused_x => x, unused_report => report, unused_error => allocated(error))
      end associate
   end subroutine try_own

   !> A point is wanted: nothing of the last one counts any more.
   subroutine begin_point(self, v, wanted, max_iterations, most_work)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: wanted
      !> Of the solver of the case, and of all ways together at the most.
      integer, intent(in) :: max_iterations, most_work

      self%wanted = wanted
      self%best_residual = huge(1.0_wp)
      self%out_of_work = .false.
      self%found_ripple = .false.
      self%ripples = .false.
      self%tried = ''
      self%spent_last = 0
      v%iterations = 0
      self%most_allowed = most_work
      self%work_limit = most_work
      associate (limits => self%limits)
         if (limits%work > 0) self%work_limit = min(most_work, limits%work* &
                                                    max(max_iterations, limits%least_counted))
      end associate
   end subroutine begin_point

   !> To a place by ways in their order, until one of them serves.
   subroutine go(self, v, at, x, report, error)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      !> That of the guesses on entry.
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: found
      integer :: before, k

      if (.not. self%goes_on(v, report)) return
      do k = 1, size(self%ways)
         if (.not. is_open(self, v, self%ways(k), size(x))) cycle
         before = v%iterations
         found = report
         call try(self, v, self%ways(k), at, x, found, error)
         if (allocated(error)) return
         if (index(self%tried, trim(self%ways(k)%word)) == 0) then
            self%tried = trim(self%tried)//', '//trim(self%ways(k)%word)
         end if
         if (self%ways(k)%is_last) self%spent_last = self%spent_last + v%iterations - before
         report = found
         if (report%converged .and. self%ways(k)%served_by /= served_by_none) then
            self%served_by = self%ways(k)%served_by
         end if
         if (.not. self%goes_on(v, report)) return
      end do
   end subroutine go

   !> Whether a way is to be gone, as things stand.
   logical function is_open(self, v, way, n)
      type(walk_type), intent(in) :: self
      class(vibration), intent(in) :: v
      type(way_type), intent(in) :: way
      !> Unknowns.
      integer, intent(in) :: n

      is_open = merge(way%as_next, way%as_first, self%known%kept > 0) .and. &
                n > way%more_than .and. n <= way%up_to .and. &
                (way%after_ripple .or. .not. self%ripples) .and. &
                (.not. way%is_costly .or. looks_again(self%failures + 1))
      if (is_open .and. way%kind == way_guesses_by_lu) is_open = v%newton%linear%lu_left_out
      if (is_open) is_open = v%offers(way)
   end function is_open

   !> Go one way.
   subroutine try(self, v, way, at, x, report, error)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(way_type), intent(in) :: way
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error

      select case (way%kind)
      case (way_guesses_by_lu)
         self%by_lu = .true.
         v%newton%linear%lu_follows = .true.
         call self%from_guesses(v, at, x, report, error)
         v%newton%linear%lu_follows = .false.
         self%by_lu = .false.
      case (way_last_guess)
         call from_last_guess(self, v, at, x, report, error)
      case (way_steps)
         call self%by_steps(v, at, way%halvings, x, report, error)
      case (way_rise)
         call rise(self, v, at, x, report, error)
      case default
         call v%try_own(way, self, at, x, report, error)
      end select
   end subroutine try

   !> From the guesses at a place, the solution being remembered.
   subroutine from_guesses(self, v, at, x, report, error)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: start(size(x))
      integer :: guess, first
      logical :: is_there

      call v%stand(at, error)
      if (allocated(error)) return
      first = 0
      do guess = 1, v%n_guesses
         call v%make_guess(guess, at, self%known, x, is_there, error)
         if (allocated(error)) return
         if (.not. is_there) cycle
         if (first == 0) first = guess
         report = solver_report()
         if (self%is_new(at, x)) then
            start = x
            call v%solve(x, report, error)
            if (allocated(error)) return
            call self%note_attempt(v, at, start, x, report)
         end if
         if (ends(report) .or. self%one_guess) exit
      end do
      if (.not. report%converged) return
      self%guess = guess
      self%served_by = v%served_by(guess)
      if (guess == first .and. self%served_by == served_by_other_guess) then
         self%served_by = v%served_by_first
      end if
      call self%known%remember(at%along, x, at%level)
   end subroutine from_guesses

   !> The last resort: the guess behind those of every point.
   subroutine from_last_guess(self, v, at, x, report, error)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      logical :: is_there

      call v%make_guess(v%n_guesses + 1, at, self%known, x, is_there, error)
      if (allocated(error) .or. .not. is_there) return
      call attempt(self, v, at, x, report, error)
      if (allocated(error)) return
      if (report%converged) call self%known%remember(at%along, x, at%level)
   end subroutine from_last_guess

   !> Solve from x, unless that is known to fail.
   subroutine attempt(self, v, at, x, report, error)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: start(size(x))

      if (.not. self%is_new(at, x)) return
      start = x
      call v%solve(x, report, error)
      if (.not. allocated(error)) call self%note_attempt(v, at, start, x, report)
   end subroutine attempt

   !> First half of the way from the last point, which may take halves of its own, then the rest.
   recursive subroutine by_steps(self, v, at, halvings, x, report, error)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      !> Left on the way here, this one included.
      integer, intent(in) :: halvings
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      type(position) :: last, middle

      ! The last place moves on with every success, also within this procedure. Levels by their
      ! ratio.
      last = self%known%newest()
      middle = position(0.5_wp*(last%along + at%along), sqrt(last%level*at%level))
      call self%from_guesses(v, middle, x, report, error)
      if (allocated(error)) return
      if (halves_again(self, v, halvings, report)) then
         call self%by_steps(v, middle, halvings - 1, x, report, error)
         if (allocated(error)) return
      end if
      if (report%converged) then
         call self%from_guesses(v, at, x, report, error)
         if (allocated(error)) return
         if (halves_again(self, v, halvings, report)) then
            call self%by_steps(v, at, halvings - 1, x, report, error)
            if (allocated(error)) return
         end if
      end if
      ! Left at the place that was asked for.
      if (.not. report%converged) call v%stand(at, error)
   end subroutine by_steps

   !> Whether half of the way is tried. In two statements: `goes_on` notes why not, and the compiler
   !> may leave out what stands behind .and., or not.
   logical function halves_again(self, v, halvings, report)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(in) :: v
      integer, intent(in) :: halvings
      type(solver_report), intent(in) :: report

      halves_again = halvings > 1
      if (halves_again) halves_again = self%goes_on(v, report)
   end function halves_again

   !> From rest to the whole level, by steps that adapt: each from the one before, or from all
   !> guesses, of which those of other places are none.
   subroutine rise(self, v, at, x, report, error)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(position) :: last, next
      real(wp) :: reached(size(x)), share, step
      logical :: had_last

      if (v%rest >= at%level) return
      call allow_rise(self, v)
      share = 0.0_wp
      step = self%limits%first_rise
      had_last = self%known%kept > 0
      if (self%limits%from_nothing) then
         ! What is known of other places is no guess here, and comes back where this fails.
         last = self%known%newest()
         reached = self%known%x(:, 1)
         self%known%kept = 0
      else
         call begin_at_rest(self, v, position(at%along, v%rest), x, error)
         if (allocated(error)) return
         reached = x
      end if
      next = at
      do
         ! What rests is known once it was solved for at this very place.
         next%level = v%rest + min(1.0_wp, share + step)*(at%level - v%rest)
         if (self%limits%from_nothing) then
            call self%from_guesses(v, next, x, report, error)
         else
            call v%stand(next, error)
            if (.not. allocated(error)) call attempt(self, v, next, x, report, error)
         end if
         if (allocated(error) .or. report%interrupted) exit
         if (report%converged) then
            share = min(1.0_wp, share + step)
            if (share >= 1.0_wp) exit
            step = step*merge(self%limits%early_growth, self%limits%rise_growth, &
                              self%limits%from_nothing .and. share < early)
         else
            step = 0.5_wp*step
            if (is_too_short(self, step, share)) exit
         end if
         if (self%limits%from_nothing) cycle
         if (report%converged) then
            reached = x
         else
            x = reached
            if (self%ripples .or. .not. self%goes_on(v, report)) exit
         end if
      end do
      if (report%converged .and. .not. allocated(error)) then
         if (.not. self%limits%from_nothing) call self%known%remember(at%along, x, at%level)
      else if (self%limits%from_nothing) then
         self%known%kept = 0
         if (had_last) call self%known%give_back(last, reached)
      else
         ! The vibration serves other points after this one, on every way out.
         call v%stand(at, ignored)
         if (.not. allocated(error)) call move_alloc(ignored, error)
      end if
   end subroutine rise

   !> The guess of every first point, at rest.
   subroutine begin_at_rest(self, v, at, x, error)
      type(walk_type), intent(in) :: self
      class(vibration), intent(inout) :: v
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      logical :: is_there

      call v%stand(at, error)
      if (.not. allocated(error)) call v%make_guess(v%n_guesses, at, self%known, x, is_there, error)
   end subroutine begin_at_rest

   !> Whether a step of the level is shorter than those that are tried.
   pure logical function is_too_short(self, step, share)
      type(walk_type), intent(in) :: self
      real(wp), intent(in) :: step, share

      associate (shortest => self%limits%shortest_rise)
         if (self%limits%from_nothing) then
            is_too_short = share <= 0.0_wp .or. step < shortest*min(1.0_wp, share/early)
         else
            is_too_short = step < shortest
         end if
      end associate
   end function is_too_short

   !> Raising a level is worth more work than the ways before it.
   pure subroutine allow_rise(self, v)
      type(walk_type), intent(inout) :: self
      class(vibration), intent(in) :: v

      if (self%limits%work == 0) return
      self%work_limit = min(self%most_allowed, max(self%work_limit, v%iterations + &
                                                   self%limits%raising_work* &
                                                   max(self%raise_unit, &
                                                       self%limits%least_counted)))
   end subroutine allow_rise

   !> Whether other ways to the point are worth beginning.
   logical function goes_on(self, v, report)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(in) :: v
      type(solver_report), intent(in) :: report

      goes_on = .not. ends(report)
      if (.not. goes_on) return
      self%out_of_work = v%iterations - self%spent_last >= self%work_limit
      goes_on = .not. self%out_of_work
   end function goes_on

   !> Go on to a place by as many steps as it takes, each from the one before; report%converged
   !> says whether it was reached, else x is the last point that was, at `reached`.
   subroutine reach(self, v, place, x, report, reached, error)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(inout) :: v
      real(wp), intent(in) :: place
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      real(wp), intent(out) :: reached
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: next, guess(size(x))
      logical :: done

      x = self%known%x(:, 1)
      reached = self%known%place(1)
      do
         associate (last => self%known%place(1), limits => self%limits)
            next = last + sign(min(abs(place - last), self%step), place - last)
            ! A rest that is nothing beside the step is taken with it.
            if (abs(place - next) < 0.1_wp*self%step) next = place
            call self%known%predict(next, x)
            guess = x
            call v%stand(position(next), error)
            if (allocated(error)) return
            call v%solve(x, report, error)
            if (allocated(error)) return
            done = report%converged
            if (done) done = v%is_same(x, guess, self%known)
            if (done) then
               call self%known%remember(next, x)
               reached = next
               self%step = min(limits%longest, limits%growth*min(self%step, limits%whole))
               if (abs(next - place) <= 0.0_wp) return
            else
               report%converged = .false.
               self%step = 0.5_wp*min(self%step, abs(next - last))
               if (self%step >= limits%shortest) cycle
               x = self%known%x(:, 1)
               reached = last
               self%step = 0.5_wp*limits%longest
               return
            end if
         end associate
      end do
   end subroutine reach

   !> Go on from a point alone: those before are of another curve.
   subroutine restart(self, place, x)
      class(walk_type), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)

      self%step = self%limits%first
      call self%known%begin_with(place, x)
   end subroutine restart

   !> Whether a start has not failed before in the way that is tried now.
   logical function is_new(self, at, x, kind)
      class(walk_type), intent(in) :: self
      type(position), intent(in) :: at
      real(wp), intent(in) :: x(:)
      !> Of an own way.
      integer, intent(in), optional :: kind

      is_new = .true.
      if (self%limits%skips_failed) is_new = .not. self%failed%hold(mark_of(self, kind), &
                                                                    at%along, at%level, x)
   end function is_new

   pure integer function mark_of(self, kind) result(mark)
      type(walk_type), intent(in) :: self
      integer, intent(in), optional :: kind

      mark = merge(mark_lu, mark_solver, self%by_lu)
      if (present(kind)) mark = kind
   end function mark_of

   !> What an attempt came to: the start that failed, and the best that fails at the point
   !> itself.
   subroutine note_attempt(self, v, at, start, x, report, kind)
      class(walk_type), intent(inout) :: self
      class(vibration), intent(in) :: v
      type(position), intent(in) :: at
      real(wp), intent(in) :: start(:), x(:)
      type(solver_report), intent(in) :: report
      !> Of an own way.
      integer, intent(in), optional :: kind

      if (ends(report)) return
      if (self%limits%skips_failed) call self%failed%add(mark_of(self, kind), at%along, at%level, &
                                                         start)
      call self%note_best(at, x, report)
      if (.not. is_wanted(self, at)) return
      self%ripples = self%ripples .or. v%ripples
      if (.not. present(kind)) self%found_ripple = self%found_ripple .or. v%ripples
   end subroutine note_attempt

   !> Keep the unknowns of the smallest residual, where they failed at the point itself:
   !> intermediate places are no answer to what was asked. NaN is never smaller.
   subroutine note_best(self, at, x, report)
      class(walk_type), intent(inout) :: self
      type(position), intent(in) :: at
      real(wp), intent(in) :: x(:)
      type(solver_report), intent(in) :: report

      if (report%converged .or. .not. is_wanted(self, at)) return
      if (.not. report%residual < self%best_residual) return
      self%best_residual = report%residual
      self%best = x
   end subroutine note_best

   !> Whether a place is the one that the point is wanted at.
   pure logical function is_wanted(self, at)
      type(walk_type), intent(in) :: self
      type(position), intent(in) :: at

      is_wanted = .not. (abs(at%along - self%wanted%along) > 0.0_wp .or. &
                         abs(at%level - self%wanted%level) > 0.0_wp)
   end function is_wanted

end module fw_vibration
