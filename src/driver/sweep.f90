!> Where the points of a run come from: given places, in their order, or a source that chooses.
module fw_sweep
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_solver_options, only: sweep_options
   use fw_strategy, only: new_request, note_time_limit, point_request, point_strategy, &
      solver_memory
   implicit none (type, external)
   private

   public :: point_source, list_source, sweep_frequency, sweep_places, lead_places, path_ends

   !> Where points come from: given frequencies, or a branch that chooses its own.
   type, abstract :: point_source
      !> It ended before it had covered what was asked for.
      logical :: falls_short = .false.
   contains
      procedure(next_point), deferred :: next
      procedure :: is_covered
      procedure :: finish
      procedure :: remember
   end type point_source

   abstract interface
      !> The next point; `more` is false where there is none.
      subroutine next_point(self, case, observer, point, more, error)
         import :: point_source, case_type, observer_type, point_type, error_type
         implicit none (type, external)
         class(point_source), intent(inout), target :: self
         type(case_type), intent(in) :: case
         !> Told what is worth knowing on the way.
         class(observer_type), intent(inout), target :: observer
         type(point_type), intent(out) :: point
         logical, intent(out) :: more
         type(error_type), allocatable, intent(out) :: error
      end subroutine next_point
   end interface

   !> Given frequencies, or values of the parameter that the sweep goes over, in their order.
   type, extends(point_source) :: list_source
      !> (n_points)
      real(wp), allocatable :: place(:)
      !> Amplitude that each is to have, where the load is found; else not allocated.
      real(wp), allocatable :: amplitude(:)
      !> On the way to the first of them, solved and not given (n_lead).
      real(wp), allocatable :: lead(:)
      !> Points given so far, and those that are enough.
      integer :: n_given = 0, n_wanted = huge(1)
      !> How each of them is solved.
      class(point_strategy), pointer :: strategy => null()
   contains
      procedure :: next => next_of_list
      procedure :: is_covered => all_given
      procedure :: remember => remember_strategy
   end type list_source

contains

   !> Whether everything that was asked for has been given.
   pure logical function is_covered(self)
      class(point_source), intent(in) :: self

      is_covered = .not. self%falls_short
   end function is_covered

   !> After the last point: what is worth telling of the whole; nothing unless a source has more.
   subroutine finish(self, case, observer)
      class(point_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout) :: observer

      associate (unused => self, unused_case => case, unused_observer => observer)
      end associate
   end subroutine finish

   !> The solution of the last point, to go on from; none of a source that gives no such.
   subroutine remember(self, memory)
      class(point_source), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      associate (unused => self, unused_memory => memory)
      end associate
   end subroutine remember

   !> What the strategy knows: the list itself holds nothing.
   subroutine remember_strategy(self, memory)
      class(list_source), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      call self%strategy%remember(memory)
   end subroutine remember_strategy

   !> Solve at the next place of the list; a point that fails is given all the same.
   subroutine next_of_list(self, case, observer, point, more, error)
      class(list_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request

      ! Who asks for the end may ask for fewer points.
      more = .not. observer%is_stopping()
      self%n_wanted = observer%n_wanted
      more = more .and. .not. self%is_covered()
      if (.not. more) return
      if (self%n_given == 0 .and. allocated(self%lead)) then
         call come_to_first(self, case, observer, error)
         if (allocated(error)) return
      end if
      request = new_request(case, self%place(self%n_given + 1), observer)
      if (allocated(self%amplitude)) request%amplitude = self%amplitude(self%n_given + 1)
      call observer%limit_point(case%solver%max_seconds)
      call self%strategy%solve(case, request, point, error)
      if (allocated(error)) return
      if (.not. point%converged) call note_time_limit(observer, case%solver%max_seconds, point)
      call observer%limit_point(0.0_wp)
      if (allocated(point%note)) call observer%on_message(point%note)
      if (allocated(self%strategy%note)) call observer%on_message(self%strategy%note)
      self%n_given = self%n_given + 1
   end subroutine next_of_list

   !> Solve on the way to the first row: what is solved there only tells solutions apart. Where the
   !> way is too rough for its steps, the first row starts as that of a sweep does: it costs less
   !> than failures that follow each other, and takes no guess from afar.
   subroutine come_to_first(self, case, observer, error)
      class(list_source), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(point_type) :: point
      !> Residual that is enough.
      real(wp), parameter :: on_the_way = 1.0e-2_wp
      !> Iterations of a step that is short enough.
      integer, parameter :: most_iterations = 8
      integer :: k

      do k = 1, size(self%lead)
         request = new_request(case, self%lead(k), observer)
         ! Nothing but its solution is wanted.
         request%fallback = .false.
         request%stability = .false.
         request%contact = .false.
         request%histories = .false.
         request%sensitivity = .false.
         request%tolerance = on_the_way
         request%most_iterations = most_iterations
         call self%strategy%solve_in_time(case, request, point, error)
         if (allocated(error)) return
         if (point%converged) cycle
         call self%strategy%start_anew()
         exit
      end do
      deallocate (self%lead)
   end subroutine come_to_first

   !> A run that was stopped or failed has not given all.
   pure logical function all_given(self)
      class(list_source), intent(in) :: self

      all_given = self%n_given >= min(size(self%place), self%n_wanted)
   end function all_given

   !> The frequencies that a case asks for [rad/s], or the values of its parameter: those of the
   !> rows, of a piece of a sweep too.
   pure function sweep_places(case) result(places)
      type(case_type), intent(in) :: case
      real(wp), allocatable :: places(:)

      places = all_places(case)
      associate (piece => case%sweep)
         if (.not. piece%is_piece()) return
         places = places(piece%first_point:merge(piece%last_point, size(places), &
                                                 piece%last_point > 0))
      end associate
   end function sweep_places

   !> Those on the way to a piece, from the start of the sweep, or behind the point that is solved,
   !> in steps that shorten evenly: the rows that follow are close to each other, and extrapolate
   !> the last ones.
   pure function lead_places(case) result(places)
      type(case_type), intent(in) :: case
      real(wp), allocatable :: places(:)
      integer :: before, k, n, n_steps

      before = case%sweep%first_point - 1 - case%sweep%solved_point
      n = min(case%sweep%lead_points, before)
      ! The start of the sweep is one of them; a point that is solved is left by a first step.
      n_steps = merge(n, n + 1, case%sweep%solved_point == 0)
      places = all_places(case)
      places = places([(lead_point(k), k=1, n)])

   contains

      !> Each once, where there are hardly more points than these.
      pure integer function lead_point(k)
         integer, intent(in) :: k
         real(wp) :: left

         left = real(n + 1 - k, wp)/real(n_steps, wp)
         lead_point = min(1 + int(real(before, wp)*(1.0_wp - left**2)), before - n + k)
         lead_point = lead_point + case%sweep%solved_point
      end function lead_point

   end function lead_places

   !> Those of the whole sweep.
   pure function all_places(case) result(places)
      type(case_type), intent(in) :: case
      real(wp), allocatable :: places(:)
      integer :: k, n_points

      n_points = 1
      if (analyses(case%analysis)%is_sweep) n_points = case%sweep%n_points
      if (analyses(case%analysis)%is_integrated .and. case%sweep%end > 0.0_wp) then
         n_points = case%sweep%n_points
      end if
      if (case%over%is_wanted()) then
         places = [(case%over%value(k, n_points), k=1, n_points)]
      else
         places = [(sweep_frequency(case%sweep, k, n_points), k=1, n_points)]
      end if
   end function all_places

   !> Where a sweep begins and where it ends.
   pure function path_ends(case) result(ends)
      type(case_type), intent(in) :: case
      real(wp) :: ends(2)

      ends = [case%sweep%start, case%sweep%end]
      if (case%over%is_wanted()) ends = [case%over%start, case%over%end]
   end function path_ends

   !> Point k of a sweep: of the list, or evenly spaced from start to end, both exact [rad/s].
   pure real(wp) function sweep_frequency(sweep, k, n_points) result(omega)
      type(sweep_options), intent(in) :: sweep
      integer, intent(in) :: k, n_points
      real(wp) :: share

      omega = sweep%start
      if (allocated(sweep%frequencies)) omega = sweep%frequencies(k)
      if (n_points == 1 .or. allocated(sweep%frequencies)) return
      share = real(k - 1, wp)/real(n_points - 1, wp)
      omega = (1.0_wp - share)*sweep%start + share*sweep%end
   end function sweep_frequency

end module fw_sweep
