!> Points along curves by arc length, whatever these are curves of: one curve after the other, each
!> from a first point that its kind solves for. A kind says what is followed, makes a row of each
!> point, and what follows from the end of a curve.
module fw_curve_source
   use fw_bifurcation, only: bifurcation_list, bifurcation_type, kind_fold, kind_undecided, &
      way_bracket, way_turn
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_parameter_system, only: parameter_system
   use fw_point, only: point_type
   use fw_solver_options, only: solver_options
   use fw_stability_crossing, only: critical_multiplier, crossing_plus
   use fw_sweep, only: path_ends, point_source
   implicit none (type, external)
   private

   public :: curve_source

   !> A curve by arc length. A kind says what is followed, what a row is and what ends it.
   type, abstract, extends(point_source) :: curve_source
      !> The curve that is followed, or the last one that was, and what it is a curve of.
      class(arclength_type), allocatable :: curve
      class(parameter_system), pointer :: solved => null()
      !> Frequencies where it begins and ends, or values of the parameter that it goes along.
      real(wp) :: ends(2) = 0.0_wp
      !> Where curves turn, and where the stability on them changes.
      type(bifurcation_list) :: bifurcations
      !> Curves that have not begun, and whether one is followed now.
      integer :: n_left = 1
      logical :: follows = .false.
   contains
      procedure(begin_next), deferred :: begin
      procedure(add_point), deferred :: add
      procedure :: close => note_end
      procedure :: next
      procedure :: is_covered
      procedure :: set_out
      procedure :: set_out_on_path
      procedure :: follow
      procedure :: is_within
      procedure :: note_fold
      procedure, nopass :: point_along
   end type curve_source

   abstract interface
      !> The first point of the next curve, which is followed from there where it converged (by
      !> `set_out` or `set_out_on_path`, and `follow`); `more` is false where there is none at all.
      subroutine begin_next(self, case, observer, point, more, error)
         import :: curve_source, case_type, observer_type, point_type, error_type
         implicit none (type, external)
         class(curve_source), intent(inout), target :: self
         type(case_type), intent(in) :: case
         class(observer_type), intent(inout), target :: observer
         type(point_type), intent(inout) :: point
         logical, intent(out) :: more
         type(error_type), allocatable, intent(out) :: error
      end subroutine begin_next

      !> A point of the curve as one of the result; `more` is false where it is none: then the curve
      !> is at its end.
      subroutine add_point(self, case, observer, found, point, more, error)
         import :: curve_source, case_type, observer_type, branch_point, point_type, error_type
         implicit none (type, external)
         class(curve_source), intent(inout), target :: self
         type(case_type), intent(in) :: case
         class(observer_type), intent(inout), target :: observer
         type(branch_point), intent(in) :: found
         type(point_type), intent(inout) :: point
         logical, intent(out) :: more
         type(error_type), allocatable, intent(out) :: error
      end subroutine add_point
   end interface

   !> First step where n_points leaves the choice: this part of the interval.
   integer, parameter :: default_steps = 100

contains

   !> Points of one curve after those of the other; `more` is false after the last of them.
   subroutine next(self, case, observer, point, more, error)
      class(curve_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: found

      more = .not. observer%is_stopping()
      if (.not. more) return
      if (self%follows) then
         call self%curve%next(self%solved, found, more, error)
         if (more .and. .not. allocated(error)) then
            call self%add(case, observer, found, point, more, error)
         end if
         if (more .or. allocated(error)) return
         self%follows = .false.
         call self%close(case, observer, error)
         if (allocated(error)) return
      end if
      more = self%n_left > 0
      if (.not. more) return
      self%n_left = self%n_left - 1
      call self%begin(case, observer, point, more, error)
   end subroutine next

   !> A curve that never began has nothing left to follow.
   pure logical function is_covered(self)
      class(curve_source), intent(in) :: self

      is_covered = self%n_left == 0 .and. .not. (self%falls_short .or. self%follows)
   end function is_covered

   !> A curve is at its end.
   subroutine note_end(self, case, observer, error)
      class(curve_source), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error

      associate (unused => case, unused_observer => observer, unused_error => allocated(error))
      end associate
      self%falls_short = self%falls_short .or. .not. self%curve%complete
   end subroutine note_end

   !> A curve along a range, with steps as so many points of it ask for.
   subroutine set_out(self, options, ends, n_points, max_points)
      class(curve_source), intent(inout) :: self
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: ends(2)
      integer, intent(in) :: n_points, max_points

      self%ends = ends
      if (allocated(self%curve)) deallocate (self%curve)
      allocate (self%curve)
      associate (curve => self%curve)
         curve%options = options
         curve%start = ends(1)
         curve%finish = ends(2)
         curve%max_points = max_points
         curve%step = 1.0_wp/real(default_steps, wp)
         if (n_points > 1) curve%step = 1.0_wp/real(n_points - 1, wp)
      end associate
   end subroutine set_out

   !> A curve along the path of the sweep.
   subroutine set_out_on_path(self, case)
      class(curve_source), intent(inout) :: self
      type(case_type), intent(in) :: case

      call self%set_out(case%solver, path_ends(case), case%sweep%n_points, case%sweep%max_points)
      ! Between its points a table of the load is straight.
      if (allocated(case%model%waves%table_frequency) .and. .not. case%over%is_wanted()) then
         self%curve%corner = case%model%waves%table_frequency
      end if
   end subroutine set_out_on_path

   !> From a solution at the start of the range, which counts as the first of max_points. The system
   !> has to outlive the curve.
   subroutine follow(self, system, x, error)
      class(curve_source), intent(inout) :: self
      class(parameter_system), intent(inout), target :: system
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error

      self%solved => system
      self%follows = .true.
      call self%curve%begin(system, x, error)
   end subroutine follow

   !> Whether a place lies in the range of the sweep.
   pure logical function is_within(self, place)
      class(curve_source), intent(in) :: self
      real(wp), intent(in) :: place

      is_within = (place - self%ends(1))*(place - self%ends(2)) <= 0.0_wp
   end function is_within

   !> Where the curve turns; one just beyond a bound belongs to no point of the sweep. A place that
   !> would not settle may be one of round-off: it is left open.
   subroutine note_fold(self, found, point)
      class(curve_source), intent(inout) :: self
      type(branch_point), intent(in) :: found
      type(point_type), intent(in) :: point
      type(bifurcation_type) :: fold

      if (.not. self%is_within(found%p)) return
      fold%kind = kind_fold
      fold%found_by = way_turn
      if (found%unsettled > 0.0_wp) then
         fold%kind = kind_undecided
         fold%found_by = way_bracket
         fold%error = found%unsettled
      end if
      fold%place = point%place
      fold%amplitude = point%amplitude
      fold%coefficients = point%coefficients
      if (allocated(point%multipliers)) then
         fold%multiplier = critical_multiplier(point%multipliers, crossing_plus)
      end if
      call self%bifurcations%add(fold)
   end subroutine note_fold

   !> The direction of the curve at a point, in the place, and how far along its tangent differences
   !> are taken.
   pure subroutine point_along(case, found, size_of_place, point, step)
      type(case_type), intent(in) :: case
      type(branch_point), intent(in) :: found
      !> To which what a difference may change of the place is compared.
      real(wp), intent(in) :: size_of_place
      type(point_type), intent(inout) :: point
      real(wp), intent(out) :: step
      !> Of the tangent, and what it may change of the frequency or the parameter.
      real(wp), parameter :: longest = 1.0e-4_wp, difference = 1.0e-7_wp

      if (case%over%is_wanted()) then
         point%tangent_parameter = found%t_p
      else
         point%tangent_omega = found%t_p
      end if
      step = longest
      if (abs(found%t_p)*step > difference*size_of_place) then
         step = difference*size_of_place/abs(found%t_p)
      end if
   end subroutine point_along

end module fw_curve_source
