!> Points of given amplitude along their branch over the frequency, or over another parameter (group
!> &control with continuation = 'arclength'): one branch after the other, one for each amplitude.
!>
!> At a given amplitude the response has no folds of a resonance, but those of internal resonances
!> are left, and the steps follow the curve: they are short where the load passes its minimum and
!> the phase turns.
module fw_control_branch
   use fw_bifurcation, only: bifurcation_list
   use fw_branch_fold, only: described_fold
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_controlled_response, only: controlled_response
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: tight_forcing
   use fw_observer, only: observer_type
   use fw_point, only: point_type, served_by_arclength
   use fw_recovery, only: observed_coefficients
   use fw_strategy, only: new_request, point_request
   use fw_sweep, only: path_ends, point_source
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: control_branch

   type, extends(point_source) :: control_branch
      !> Solves the first point of each branch; the curve is that of its system.
      type(controlled_response), pointer, private :: strategy => null()
      !> Amplitudes, and which of them is at work.
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
   end type control_branch

   !> First step where n_points leaves the choice: this part of the interval.
   integer, parameter :: default_steps = 100
   !> The least norm that residuals are compared to, over that of the first point: the load may
   !> all but vanish at a resonance.
   real(wp), parameter :: least_reference = 1.0e-4_wp
   !> The least size of the unknowns that matters, over the amplitude: rigid pairs that stick do not
   !> move at all.
   real(wp), parameter :: least_size = 1.0e-3_wp

contains

   !> Take a strategy that was started, which has to live as long.
   subroutine begin(self, case, strategy)
      class(control_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(controlled_response), intent(inout), target :: strategy

      self%strategy => strategy
      self%amplitude = case%control%amplitude
      self%ends = path_ends(case)
      ! What the first point leaves, the whole path inherits.
      strategy%method%newton%loosest = tight_forcing
   end subroutine begin

   !> Points of the branch of one amplitude after those of the other; `more` is false after the
   !> last of them.
   subroutine next(self, case, observer, point, more, error)
      class(control_branch), intent(inout), target :: self
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
            call self%curve%next(self%strategy%control, found, more, error)
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
      class(control_branch), intent(inout) :: self
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
         call observer%on_message('the first point of amplitude '// &
                                  to_text(self%amplitude(self%k))//' did not converge: no '// &
                                  'branch to follow')
         return
      end if
      allocate (self%curve)
      call begin_curve(self, case, error)
      if (allocated(error)) return
      call point_along(self, case, self%curve%here, point, error)
   end subroutine first_point

   !> The curve from the solution that the strategy holds.
   subroutine begin_curve(self, case, error)
      class(control_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: x(self%strategy%control%n), size_of_motion
      integer :: n

      associate (control => self%strategy%control, curve => self%curve)
         n = size(x) - 1
         x = self%strategy%y
         size_of_motion = max(norm2(x(:n)), self%amplitude(self%k))
         ! The load counts as much as the motion.
         if (x(n + 1) > 0.0_wp) control%load_unit = x(n + 1)/size_of_motion
         x(n + 1) = x(n + 1)/control%load_unit
         control%least_reference = least_reference*control%reference
         curve%options = case%solver
         curve%start = self%ends(1)
         curve%finish = self%ends(2)
         curve%max_points = case%sweep%max_points
         curve%x_scale = least_size*self%amplitude(self%k)
         curve%step = 1.0_wp/real(default_steps, wp)
         if (case%sweep%n_points > 1) curve%step = 1.0_wp/real(case%sweep%n_points - 1, wp)
         call curve%begin(control, x, error)
      end associate
   end subroutine begin_curve

   !> A point of the curve as one of the result; `more` is false where it is none.
   subroutine add_point(self, case, observer, found, point, more, error)
      class(control_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: here
      type(point_request) :: at
      real(wp) :: unit

      here = found
      at = request_at(self, case, observer, found%p)
      ! There derivatives by parameters are none.
      point%fold = found%fold
      associate (strategy => self%strategy, n => size(found%x) - 1)
         ! The strategy knows no unit.
         unit = strategy%control%load_unit
         call strategy%control%stand(found%p, error)
         if (allocated(error)) return
         strategy%y = found%x
         strategy%y(n + 1) = unit*found%x(n + 1)
         strategy%control%load_unit = 1.0_wp
         call strategy%turn_to_positive(here%report, error)
         more = here%report%converged
         if (more .and. .not. allocated(error)) then
            call strategy%describe_point(case, at, here%report, served_by_arclength, point, &
                                         error)
         end if
         strategy%control%load_unit = unit
      end associate
      if (allocated(error)) return
      if (.not. more) then
         self%falls_short = .true.
         call self%curve%end_early('the load vanishes at '// &
                                   trim(at%describe())//': the structure vibrates by itself')
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
      class(control_branch), intent(in) :: self
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
      class(control_branch), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      !> Of the tangent, and what it may change of the frequency or the parameter.
      real(wp), parameter :: longest = 1.0e-4_wp, difference = 1.0e-7_wp
      real(wp), allocatable :: beside(:, :)
      real(wp) :: most, step, y(size(found%x)), z(1)
      integer :: n, side

      n = size(found%x) - 1
      step = longest
      if (case%over%is_wanted()) then
         point%tangent_parameter = found%t_p
         ! It may be 0.
         most = difference*maxval(abs(self%ends))
      else
         point%tangent_omega = found%t_p
         most = difference*found%p
      end if
      if (found%x(n + 1) < 0.0_wp) return
      if (abs(found%t_p)*step > most) step = most/abs(found%t_p)
      associate (control => self%strategy%control)
         do side = -1, 1, 2
            y = found%x + side*step*found%t
            z = y(n + 1)
            call control%stand(found%p + side*step*found%t_p, error)
            if (.not. allocated(error)) call control%take(z, error)
            if (allocated(error)) return
            call observed_coefficients(control%state, y(:n), case%harmonics%n_harmonics, beside)
            if (side < 0) then
               point%tangent = -beside
            else
               point%tangent = (point%tangent + beside)/(2.0_wp*step)
            end if
         end do
      end associate
   end subroutine point_along

   !> Why a branch ended; the next amplitude comes after it.
   subroutine close_branch(self, observer)
      class(control_branch), intent(inout) :: self
      class(observer_type), intent(inout) :: observer

      associate (control => self%strategy%control)
         control%load_unit = 1.0_wp
         control%least_reference = 0.0_wp
      end associate
      call observer%on_message('branch of amplitude '//to_text(self%amplitude(self%k))//': '// &
                               self%curve%ending)
      self%falls_short = self%falls_short .or. .not. self%curve%complete
      call self%strategy%method%newton%linear%add_work(self%curve%corrector%linear)
      deallocate (self%curve)
   end subroutine close_branch

   !> A branch that never began has nothing left to follow, but the run says that it fell short.
   pure logical function is_covered(self)
      class(control_branch), intent(in) :: self

      is_covered = self%k == size(self%amplitude) .and. .not. (self%falls_short .or. &
                                                               allocated(self%curve))
   end function is_covered

end module fw_control_branch
