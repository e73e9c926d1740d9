!> Points of a vibration along its curve over the frequency, or over another parameter: one branch
!> after the other, one for each level that is asked for (the amplitudes of group &control with
!> continuation = 'arclength').
!>
!> At a given amplitude the response has no folds of a resonance, but those of internal resonances
!> are left, and the steps follow the curve: they are short where the load passes its minimum and
!> the phase turns.
module fw_vibration_branch
   use fw_case, only: case_type
   use fw_continuation, only: branch_point
   use fw_curve_source, only: curve_source
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report, tight_forcing
   use fw_observer, only: observer_type
   use fw_point, only: point_type, served_by_arclength
   use fw_solution_history, only: position
   use fw_strategy, only: new_request, point_request
   use fw_text, only: to_text
   use fw_walked_points, only: walked_points
   implicit none (type, external)
   private

   public :: vibration_branch

   !> A response along its curve, one branch for each level.
   type, extends(curve_source) :: vibration_branch
      !> Solves the first point of each branch; the curve is that of its vibration.
      type(walked_points), pointer, private :: strategy => null()
      !> Levels.
      real(wp), allocatable, private :: amplitude(:)
   contains
      procedure :: build
      procedure :: begin
      procedure :: add
      procedure :: close
   end type vibration_branch

contains

   !> Take a strategy that was started, which has to live as long.
   subroutine build(self, case, strategy)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(walked_points), intent(inout), target :: strategy

      self%strategy => strategy
      self%amplitude = [0.0_wp]
      if (case%control%is_wanted()) self%amplitude = case%control%amplitude
      self%n_left = size(self%amplitude)
      ! What the first point leaves, the whole path inherits.
      strategy%v%newton%loosest = tight_forcing
      self%solved => strategy%v%curve_system()
   end subroutine build

   !> The level at work.
   pure real(wp) function level(self)
      class(vibration_branch), intent(in) :: self

      level = self%amplitude(size(self%amplitude) - self%n_left)
   end function level

   !> The first point of the next amplitude, as in a natural sweep.
   subroutine begin(self, case, observer, point, more, error)
      class(vibration_branch), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      real(wp) :: x(size(self%strategy%x))

      more = .true.
      call self%set_out_on_path(case)
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
      x = self%strategy%x
      call self%strategy%v%begin_curve(level(self), x, self%curve)
      call self%follow(self%solved, x, error)
      if (.not. allocated(error)) call set_tangent(self, case, self%curve%here, point, error)
   end subroutine begin

   !> A point of the curve as one of the result; `more` is false where it is none.
   subroutine add(self, case, observer, found, point, more, error)
      class(vibration_branch), intent(inout), target :: self
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
      if (found%fold) call self%note_fold(found, point)
      call set_tangent(self, case, found, point, error)
      call self%strategy%about%note_seconds(point)
   end subroutine add

   !> What is asked of the points of the branch at work.
   function request_at(self, case, observer, place) result(request)
      class(vibration_branch), intent(in) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      real(wp), intent(in) :: place
      type(point_request) :: request

      request = new_request(case, place, observer)
      request%amplitude = level(self)
   end function request_at

   !> The direction of the branch at a point, by a difference along the tangent; of a motion that
   !> is that of the curve half a period later, that of its place alone.
   subroutine set_tangent(self, case, found, point, error)
      class(vibration_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: beside(:, :)
      type(position) :: at
      real(wp) :: step
      integer :: side

      at = self%strategy%walk%wanted
      ! A parameter may be 0.
      call self%point_along(case, found, merge(maxval(abs(self%ends)), found%p, &
                                               case%over%is_wanted()), point, step)
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
   end subroutine set_tangent

   !> Why a branch ended; the next amplitude comes after it.
   subroutine close(self, case, observer, error)
      class(vibration_branch), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error

      associate (unused => case, unused_error => allocated(error))
      end associate
      call observer%on_message('branch'//trim(level_words(self))//': '//self%curve%ending)
      self%falls_short = self%falls_short .or. .not. self%curve%complete
      call self%strategy%v%newton%linear%add_work(self%curve%corrector%linear)
   end subroutine close

   !> Which of several branches is meant.
   function level_words(self) result(words)
      class(vibration_branch), intent(in) :: self
      character(40) :: words

      words = ''
      if (level(self) > 0.0_wp) words = ' of amplitude '//to_text(level(self))
   end function level_words

end module fw_vibration_branch
