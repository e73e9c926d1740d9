!> Several solutions of one point (solver%n_solutions): the first is that of any point; further ones
!> are searched for by Newton's method that those known repel (fw_deflation). What it comes to is
!> solved once more as every point is, so that a row of the result is a solution of the equations
!> themselves, and no less refused where it is no vibration.
module fw_several_solutions
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_deflation, only: deflated_newton
   use fw_error, only: error_type
   use fw_formulation, only: formulation_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_observer, only: observer_type
   use fw_one_level, only: one_level
   use fw_parameter_system, only: parameter_system
   use fw_point, only: point_type
   use fw_strategy, only: new_request, note_time_limit, point_request, solver_memory
   use fw_summary, only: summary_type
   use fw_sweep, only: point_source, sweep_places
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: several_source

   !> Gives the solutions of the point of a case, by rising amplitude.
   type, extends(point_source) :: several_source
      !> How points are solved; it is started, and has to live as long.
      type(one_level), pointer :: strategy => null()
      !> Solutions found, in their order, and how many were given.
      type(point_type), allocatable, private :: found(:)
      integer, private :: n_found = 0, n_given = 0
      !> Starts that were tried for further ones, their iterations, and solutions of the equations
      !> that were refused.
      integer, private :: n_starts = 0, iterations = 0, n_refused = 0
      logical, private :: is_solved = .false.
   contains
      procedure :: next
      procedure :: is_covered
      procedure :: summarize
   end type several_source

   !> A search while it is at work.
   type :: search_type
      type(deflated_newton) :: newton
      type(formulation_type) :: formulation
      class(parameter_system), pointer :: system => null()
      !> The present unknowns as coefficients, and in the formulation (n).
      real(wp), allocatable :: x(:), unknowns(:)
      !> How far each of the known ones may be off.
      real(wp), allocatable :: error(:)
      !> The largest motion that each coordinate has in any guess or solution.
      real(wp), allocatable :: span(:)
      !> State of the generator of starts: the same in every run.
      integer :: seed = 1
   end type search_type

   !> Rounds over all starts without a new solution that end a search.
   integer, parameter :: most_rounds = 3
   !> Starts beside each known solution: how far they are, over the largest value that each unknown
   !> has in any solution; and the part of the scale for unknowns that no solution has any of.
   real(wp), parameter :: beside(*) = [0.02_wp, 0.3_wp, 1.2_wp], least_share = 1.0e-3_wp
   !> All starts for each known solution in a round: those beside it, some far away in directions
   !> that it yields to, and the rest anywhere.
   integer, parameter :: starts_each = 12, starts_soft = 4
   !> How far the others are, over the largest solution: powers of ten between these. Jumps of
   !> resonances go that far.
   real(wp), parameter :: nearest = -1.0_wp, farthest = 1.6_wp
   !> Those anywhere are up to this many times the motion of any guess or solution.
   real(wp), parameter :: widest = 4.0_wp
   !> Solutions that differ by less than this part of their vibration are one, and by less than this
   !> many times what they may be off.
   real(wp), parameter :: same = 1.0e-6_wp, margin = 10.0_wp
   !> The usual guesses that a search starts from: every pair stuck, all free (fw_response).
   integer, parameter :: usual_guesses(*) = [3, 4]

contains

   !> All are found before the first is given: their order is that of their amplitudes.
   subroutine next(self, case, observer, point, more, error)
      class(several_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      more = .false.
      if (.not. self%is_solved) then
         if (observer%is_stopping()) return
         call find_all(self, case, observer, error)
         if (allocated(error)) return
         self%is_solved = .true.
      end if
      more = self%n_given < self%n_found .and. .not. observer%is_stopping()
      if (.not. more) return
      self%n_given = self%n_given + 1
      point = self%found(self%n_given)
   end subroutine next

   pure logical function is_covered(self)
      class(several_source), intent(in) :: self

      is_covered = self%is_solved .and. self%n_given == self%n_found
   end function is_covered

   !> The first solution, and those that a search finds beside it.
   subroutine find_all(self, case, observer, error)
      type(several_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(point_type) :: point
      type(solver_memory) :: memory
      type(search_type), target :: search
      real(wp) :: places(1)

      allocate (self%found(case%solver%n_solutions))
      places = sweep_places(case)
      request = new_request(case, places(1), observer)
      call observer%limit_point(case%solver%max_seconds)
      call self%strategy%solve(case, request, point, error)
      if (allocated(error)) return
      if (.not. point%converged) call note_time_limit(observer, case%solver%max_seconds, point)
      if (allocated(point%note)) call observer%on_message(point%note)
      if (allocated(self%strategy%note)) call observer%on_message(self%strategy%note)
      call self%strategy%remember(memory)
      ! Without a first solution there is nothing to be repelled by; without unknowns there is one
      ! solution only.
      if (.not. (point%converged .and. allocated(memory%x))) then
         call keep(self, point)
      else if (size(memory%x) == 0) then
         call keep(self, point)
      else
         call begin(self, case, memory%x, search)
         call take(self, case, request, search, point%iterations, error)
         if (allocated(error)) return
         call search_on(self, case, request, search, error)
         associate (work => self%strategy%level%solver%method%newton%linear)
            call work%add_work(search%newton%linear)
         end associate
      end if
      call observer%limit_point(0.0_wp)
   end subroutine find_all

   !> The first solution sets the scale.
   subroutine begin(self, case, x, search)
      type(several_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: x(:)
      type(search_type), intent(inout), target :: search
      real(wp) :: size_of_first

      associate (system => self%strategy%level%system)
         call search%formulation%begin(system)
         search%system => search%formulation%as_solved()
         search%x = x
         allocate (search%unknowns(size(x)), search%error(0))
         call search%formulation%from_coefficients(search%x, search%unknowns)
         size_of_first = norm2(search%unknowns)
         search%newton%options = case%solver
         call search%newton%start(size(x), case%solver%n_solutions, &
                                  merge(size_of_first, 1.0_wp, size_of_first > 0.0_wp))
      end associate
   end subroutine begin

   !> Rounds over all starts, until nothing new is found or enough is.
   subroutine search_on(self, case, request, search, error)
      type(several_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(search_type), intent(inout), target :: search
      type(error_type), allocatable, intent(out) :: error
      integer :: round, start, before
      logical :: at_end, is_there

      round = 1
      do while (round <= most_rounds)
         before = self%n_found
         start = 1
         ! Those found on the way are starts of the same round.
         do while (start <= size(usual_guesses) + starts_each*search%newton%n_known)
            call make_start(self, search, start, round == 1, is_there)
            at_end = .false.
            if (is_there) call try(self, case, request, search, at_end, error)
            if (allocated(error) .or. at_end) return
            start = start + 1
         end do
         round = merge(1, round + 1, self%n_found > before)
      end do
   end subroutine search_on

   !> A start of a round: a usual guess, which another round would only repeat; beside a known
   !> solution; or from it in a direction that it yields to.
   subroutine make_start(self, search, start, is_first, is_there)
      type(several_source), intent(inout) :: self
      type(search_type), intent(inout), target :: search
      integer, intent(in) :: start
      !> Of the rounds without a new solution.
      logical, intent(in) :: is_first
      logical, intent(out) :: is_there
      type(error_type), allocatable :: unused
      real(wp) :: width(size(search%x)), drawn(size(search%x)), length, largest
      integer :: k, kind

      k = start - size(usual_guesses)
      search%newton%repels = .true.
      if (k <= 0) then
         is_there = is_first
         if (.not. is_there) return
         associate (method => self%strategy%level%solver%method, &
                    walk => self%strategy%level%solver%walk)
            call method%make_guess(usual_guesses(start), walk%wanted, walk%known, search%x, &
                                   is_there, unused)
            call widen(self%strategy%level%system, search)
            call search%formulation%from_coefficients(search%x, search%unknowns)
         end associate
         return
      end if
      is_there = .true.
      call draw(search%seed, drawn)
      associate (known => search%newton%known(:, :search%newton%n_known), &
                 of => (k - 1)/starts_each + 1)
         kind = modulo(k - 1, starts_each) + 1
         if (kind <= size(beside)) then
            ! Each unknown by what the solutions have of it: higher harmonics are small in all.
            width = max(maxval(abs(known), dim=2), least_share*maxval(abs(known)))
            search%unknowns = known(:, of) + beside(kind)*width*drawn
            return
         else if (kind > size(beside) + starts_soft) then
            call draw(search%seed, width(:1))
            ! What repels bends the way to all others as well: every second start goes without.
            search%newton%repels = modulo(k, 2) == 0
            call draw_anywhere(self%strategy%level%system, abs(width(1))*widest, drawn, search)
            return
         end if
         call search%newton%soften(search%system, known(:, of), drawn, search%unknowns, is_there)
         if (.not. is_there) return
         call draw(search%seed, width(:1))
         largest = maxval(norm2(known, dim=1))
         length = largest*10.0_wp**(0.5_wp*(nearest + farthest) + &
                                    0.5_wp*(farthest - nearest)*width(1))
         is_there = norm2(search%unknowns) > 0.0_wp
         if (is_there) search%unknowns = known(:, of) + &
                                         search%unknowns*(length/norm2(search%unknowns))
      end associate
   end subroutine make_start

   !> The motion that coordinates have in the present coefficients counts from now on.
   subroutine widen(system, search)
      type(balance_state), intent(in) :: system
      type(search_type), intent(inout) :: search
      integer :: m

      m = system%problem%structure%n_coordinates
      if (.not. allocated(search%span)) allocate (search%span(m), source=0.0_wp)
      search%span = max(search%span, norm2(reshape(search%x, [m, size(search%x)/m]), dim=2))
   end subroutine widen

   !> A start around nothing: coefficients fall as those of a motion do that has corners in its
   !> velocity.
   subroutine draw_anywhere(system, share, drawn, search)
      type(balance_state), intent(in) :: system
      !> Of the largest motion known.
      real(wp), intent(in) :: share
      !> (n_coordinates*n_coefficients)
      real(wp), intent(in) :: drawn(:)
      type(search_type), intent(inout), target :: search
      integer :: c, h, k, m

      m = system%problem%structure%n_coordinates
      associate (f => system%problem%fourier)
         do h = 1, f%n_retained
            do c = 0, merge(0, 1, f%harmonic(h) == 0)
               k = m*(f%column(h) + c - 1)
               search%x(k + 1:k + m) = share*search%span*drawn(k + 1:k + m)/ &
                                       real(max(1, f%harmonic(h))**2, wp)
            end do
         end do
      end associate
      call search%formulation%from_coefficients(search%x, search%unknowns)
   end subroutine draw_anywhere

   !> From a start to what it leads to; `at_end` where nothing more is to be tried.
   subroutine try(self, case, request, search, at_end, error)
      type(several_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(search_type), intent(inout), target :: search
      logical, intent(out) :: at_end
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report

      call search%newton%solve(search%system, search%unknowns, report)
      self%n_starts = self%n_starts + 1
      self%iterations = self%iterations + report%iterations
      ! The time of the point is over, or somebody asks for the end: only the latter is an error.
      at_end = report%interrupted
      if (at_end) call stop_run(request%interrupt, error)
      if (at_end .or. .not. report%converged) return
      call search%formulation%to_coefficients(search%unknowns, search%x)
      call take(self, case, request, search, report%iterations, error)
      at_end = self%n_found == case%solver%n_solutions
   end subroutine try

   !> A solution of the equations becomes a row if it is new and a vibration; either way it repels
   !> from now on, where it is not one that does so already.
   subroutine take(self, case, request, search, iterations, error)
      type(several_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(search_type), intent(inout), target :: search
      !> That led to it.
      integer, intent(in) :: iterations
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: again
      type(point_type) :: point
      type(solver_memory) :: memory
      real(wp) :: off
      integer :: n

      n = iterations
      call search%newton%refine(search%system, search%unknowns, off, n)
      if (is_known(self%strategy%level%system, search, off)) return
      memory%x = search%x
      memory%omega = request%place()
      call self%strategy%recall(memory)
      again = request
      again%fallback = .false.
      call self%strategy%solve(case, again, point, error)
      if (allocated(error)) return
      search%x = memory%x
      call widen(self%strategy%level%system, search)
      call search%newton%add(search%unknowns)
      search%error = [search%error, off]
      point%iterations = n + point%iterations
      if (point%converged) then
         call keep(self, point)
      else
         self%n_refused = self%n_refused + 1
      end if
   end subroutine take

   !> Whether the present unknowns are those of a solution that is known.
   logical function is_known(system, search, off)
      type(balance_state), intent(in) :: system
      type(search_type), intent(inout), target :: search
      !> How far these may be off.
      real(wp), intent(in) :: off
      real(wp) :: vibration, distance
      integer :: k, m

      is_known = .false.
      call search%formulation%to_coefficients(search%unknowns, search%x)
      m = merge(system%problem%structure%n_coordinates, 0, system%problem%fourier%has_constant())
      vibration = norm2(search%x(m + 1:))
      do k = 1, search%newton%n_known
         distance = norm2(search%unknowns - search%newton%known(:, k))
         is_known = distance <= max(same*vibration, margin*(off + search%error(k)))
         if (is_known) return
      end do
   end function is_known

   !> Among those found, by the amplitude of what is observed first.
   subroutine keep(self, point)
      type(several_source), intent(inout) :: self
      type(point_type), intent(in) :: point
      integer :: k

      k = self%n_found + 1
      do while (k > 1)
         if (height(self%found(k - 1)) <= height(point)) exit
         self%found(k) = self%found(k - 1)
         k = k - 1
      end do
      self%found(k) = point
      self%n_found = self%n_found + 1
   end subroutine keep

   !> What rows are ordered by.
   pure real(wp) function height(point)
      type(point_type), intent(in) :: point

      height = 0.0_wp
      if (.not. allocated(point%amplitude)) return
      if (size(point%amplitude) > 0) height = point%amplitude(1)
   end function height

   !> What was found and what that took. No search proves that it was all.
   subroutine summarize(self, case, summary)
      class(several_source), intent(in) :: self
      type(case_type), intent(in) :: case
      type(summary_type), intent(inout) :: summary
      character(:), allocatable :: words

      if (.not. self%is_solved) return
      words = to_text(self%n_found)//' found, '//to_text(self%n_starts)//' starts for further '// &
              'ones, '//to_text(self%iterations)//' iterations'
      if (self%n_refused > 0) words = words//', '//to_text(self%n_refused)//' refused'
      if (self%n_found == case%solver%n_solutions) then
         words = words//'; as many as n_solutions: there may be others'
      else
         words = words//'; there may be others'
      end if
      call summary%line('solutions', words)
   end subroutine summarize

   !> Numbers between -1 and 1 of a generator of its own (Park and Miller 1988): starts must not
   !> depend on what else was drawn.
   subroutine draw(seed, numbers)
      integer, intent(inout) :: seed
      real(wp), intent(out) :: numbers(:)
      integer, parameter :: factor = 16807, modulus = 2147483647, quotient = 127773, rest = 2836
      integer :: i

      do i = 1, size(numbers)
         seed = factor*modulo(seed, quotient) - rest*(seed/quotient)
         if (seed <= 0) seed = seed + modulus
         numbers(i) = 2.0_wp*real(seed, wp)/real(modulus, wp) - 1.0_wp
      end do
   end subroutine draw

end module fw_several_solutions
