!> Points of a vibration along its curve over the frequency, or over another parameter: one branch
!> after the other, one for each level that is asked for (the amplitudes of group &control with
!> continuation = 'arclength').
!>
!> At a given amplitude the response has no folds of a resonance, but those of internal resonances
!> are left, and the steps follow the curve: they are short where the load passes its minimum and
!> the phase turns.
module fw_vibration_branch
   use fw_bifurcation, only: bifurcation_list
   use fw_branch_fold, only: described_fold
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report, tight_forcing
   use fw_observer, only: observer_type
   use fw_parameter_system, only: parameter_system
   use fw_point, only: point_type, served_by_arclength
   use fw_solution_history, only: position
   use fw_strategy, only: new_request, point_request
   use fw_sweep, only: path_ends, point_source
   use fw_text, only: to_text
   use fw_walked_points, only: walked_points
   implicit none (type, external)
   private

   public :: vibration_branch

   type, extends(point_source) :: vibration_branch
      !> Solves the first point of each branch; the curve is that of its vibration.
      type(walked_points), pointer, private :: strategy => null()
      class(parameter_system), pointer, private :: system => null()
      !> Levels, and which of them is at work.
      real(wp), allocatable, private :: amplitude(:)
      integer, private :: k = 0
      !> The branch that is followed; none between two of them.
      type(arclength_type), allocatable, private :: curve
      real(wp), private :: ends(2) = 0.0_wp
      !> Where branches turn back.
      type(bifurcation_list) :: folds
   contains
      procedure :: begin
      procedure :: next
      procedure :: is_covered
   end type vibration_branch

   !> First step where n_points leaves the choice: this part of the interval.
   integer, parameter :: default_steps = 100

contains

   !> Take a strategy that was started, which has to live as long.
   subroutine begin(self, case, strategy)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(walked_points), intent(inout), target :: strategy

      self%strategy => strategy
      self%amplitude = [0.0_wp]
      if (case%control%is_wanted()) self%amplitude = case%control%amplitude
      self%ends = path_ends(case)
      ! What the first point leaves, the whole path inherits.
      strategy%v%newton%loosest = tight_forcing
      self%system => strategy%v%curve_system()
   end subroutine begin

   !> Points of the branch of one amplitude after those of the other; `more` is false after the
   !> last of them.
   subroutine next(self, case, observer, point, more, error)
      class(vibration_branch), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: found

      more = .not. observer%is_stopping()
      if (.not. more) return
      do
         if (allocated(self%curve)) then
            call self%curve%next(self%system, found, more, error)
            if (allocated(error)) return
            if (more) call add_point(self, case, observer, found, point, more, error)
            if (allocated(error) .or. more) return
            call close_branch(self, observer)
         else
            more = self%k < size(self%amplitude)
            if (more) call first_point(self, case, observer, point, error)
            return
         end if
      end do
   end subroutine next

   !> The first point of the next amplitude, as in a natural sweep.
   subroutine first_point(self, case, observer, point, error)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request

      self%k = self%k + 1
      request = request_at(self, case, observer, self%ends(1))
      call self%strategy%solve_in_time(case, request, point, error)
      if (allocated(error)) return
      if (allocated(point%note)) call observer%on_message(point%note)
      if (.not. point%converged) then
         self%falls_short = .true.
         call observer%on_message('the first point'//trim(level_words(self))// &
                                  ' did not converge: no branch to follow')
         return
      end if
      allocate (self%curve)
      call begin_curve(self, case, error)
      if (allocated(error)) return
      call point_along(self, case, self%curve%here, point, error)
   end subroutine first_point

   !> The curve from the solution that the strategy holds.
   subroutine begin_curve(self, case, error)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: x(size(self%strategy%x))

      associate (curve => self%curve)
         x = self%strategy%x
         curve%options = case%solver
         curve%start = self%ends(1)
         curve%finish = self%ends(2)
         curve%max_points = case%sweep%max_points
         curve%step = 1.0_wp/real(default_steps, wp)
         if (case%sweep%n_points > 1) curve%step = 1.0_wp/real(case%sweep%n_points - 1, wp)
         ! Between its points a table of the load is straight.
         if (allocated(case%model%waves%table_frequency) .and. .not. case%over%is_wanted()) then
            curve%corner = case%model%waves%table_frequency
         end if
         call self%strategy%v%begin_curve(self%amplitude(self%k), x, curve)
         call curve%begin(self%system, x, error)
      end associate
   end subroutine begin_curve

   !> A point of the curve as one of the result; `more` is false where it is none.
   subroutine add_point(self, case, observer, found, point, more, error)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: at
      type(solver_report) :: report
      character(:), allocatable :: ending

      at = request_at(self, case, observer, found%p)
      ! There derivatives by parameters are none.
      point%fold = found%fold
      associate (strategy => self%strategy, v => self%strategy%v)
         call v%take_from_curve(found, at, strategy%x, report, ending, error)
         if (allocated(error)) return
         more = report%converged
         if (more) call strategy%describe_point(case, at, report, served_by_arclength, point, error)
         call v%back_to_curve()
      end associate
      if (allocated(error)) return
      if (.not. more) then
         self%falls_short = .true.
         call self%curve%end_early(ending)
         return
      end if
      if (found%fold .and. (found%p - self%ends(1))*(found%p - self%ends(2)) <= 0.0_wp) then
         call self%folds%add(described_fold(found, point))
      end if
      call point_along(self, case, found, point, error)
      call self%strategy%about%note_seconds(point)
   end subroutine add_point

   !> What is asked of the points of the branch at work.
   function request_at(self, case, observer, place) result(request)
      class(vibration_branch), intent(in) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      real(wp), intent(in) :: place
      type(point_request) :: request

      request = new_request(case, place, observer)
      request%amplitude = self%amplitude(self%k)
   end function request_at

   !> The direction of the branch at a point, by a difference along the tangent; of a motion that
   !> is that of the curve half a period later, that of its place alone.
   subroutine point_along(self, case, found, point, error)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      !> Of the tangent, and what it may change of the frequency or the parameter.
      real(wp), parameter :: longest = 1.0e-4_wp, difference = 1.0e-7_wp
      real(wp), allocatable :: beside(:, :)
      type(position) :: at
      real(wp) :: most, step
      integer :: side

      at = self%strategy%walk%wanted
      step = longest
      if (case%over%is_wanted()) then
         point%tangent_parameter = found%t_p
         ! It may be 0.
         most = difference*maxval(abs(self%ends))
      else
         point%tangent_omega = found%t_p
         most = difference*found%p
      end if
      if (abs(found%t_p)*step > most) step = most/abs(found%t_p)
      do side = -1, 1, 2
         at%along = found%p + side*step*found%t_p
         call self%strategy%v%observe_beside(at, found%x + side*step*found%t, &
                                             case%harmonics%n_harmonics, beside, error)
         if (allocated(error) .or. .not. allocated(beside)) return
         if (side < 0) then
            point%tangent = -beside
         else
            point%tangent = (point%tangent + beside)/(2.0_wp*step)
         end if
      end do
   end subroutine point_along

   !> Why a branch ended; the next amplitude comes after it.
   subroutine close_branch(self, observer)
      class(vibration_branch), intent(inout) :: self
      class(observer_type), intent(inout) :: observer

      call observer%on_message('branch'//trim(level_words(self))//': '//self%curve%ending)
      self%falls_short = self%falls_short .or. .not. self%curve%complete
      call self%strategy%v%newton%linear%add_work(self%curve%corrector%linear)
      deallocate (self%curve)
   end subroutine close_branch

   !> Which of several branches is meant.
   function level_words(self) result(words)
      class(vibration_branch), intent(in) :: self
      character(40) :: words

      words = ''
      if (self%amplitude(self%k) > 0.0_wp) words = ' of amplitude '// &
                                                   to_text(self%amplitude(self%k))
   end function level_words

   !> A branch that never began has nothing left to follow, but the run says that it fell short.
   pure logical function is_covered(self)
      class(vibration_branch), intent(in) :: self

      is_covered = self%k == size(self%amplitude) .and. .not. (self%falls_short .or. &
                                                               allocated(self%curve))
   end function is_covered

end module fw_vibration_branch
