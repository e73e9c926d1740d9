!> Pseudo-arclength continuation of R(x, p) = 0 (Keller 1977) with analytic dR/dp, point by point:
!> steps (fw_predictor_corrector) one after the other, folds and bounds located on the way, and what
!> is tried where no step counts.
module fw_continuation
   use fw_branch_mark, only: find_fold, land
   use fw_branch_point, only: branch_point
   use fw_branch_retrace, only: branch_trail
   use fw_branch_turn, only: all_around, far_ahead, leap, only_ahead
   use fw_branch_way, only: branch_way
   use fw_curve_options, only: limits
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   use fw_predictor_corrector, only: predictor_corrector
   use fw_solver_options, only: solver_options
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: arclength_type, branch_point

   type, extends(predictor_corrector) :: arclength_type
      type(solver_options) :: options
      !> The interval of p: from start to finish.
      real(wp) :: start = 0.0_wp
      real(wp) :: finish = 1.0_wp
      !> First step as a share of the interval.
      real(wp) :: step = 0.01_wp
      integer :: max_points = 1000
      !> Values of p where the equations turn a corner: a point lies on each.
      real(wp), allocatable :: corner(:)
      !> Why the branch ended.
      character(:), allocatable :: ending
      logical :: ended = .false.
      !> Whether it ended at finish.
      logical :: complete = .false.
      !> Whether it ended because x runs away while p stays.
      logical :: runs_away = .false.
      ! Where the branch began, and the point after a fold that waits.
      type(branch_point) :: first
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(branch_point), allocatable :: waiting
      logical :: waits = .false.
      integer :: n_points = 0, n_constant = 0
      ! The last points, and how far p has been.
      type(branch_trail) :: trail
      type(branch_way), private :: way
      real(wp) :: furthest = 0.0_wp
   contains
      procedure :: begin
      procedure :: next
      procedure :: end_early => end_branch
   end type arclength_type

   !> Shortest step.
   real(wp), parameter :: shortest = 1.0e-7_wp
   !> Points without a part in p: a fold has one, a branch that has so many in a row runs away.
   integer, parameter :: max_constant = 8
   !> Part of the interval from its end that is none.
   real(wp), parameter :: round_off = 1.0e-13_wp
   !> Two points of a branch that closes are the same to this part of their size.
   real(wp), parameter :: same = 1.0e-4_wp

contains

   !> Start at a converged x at p = start, towards finish; that point is the first of max_points.
   subroutine begin(self, system, x, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: towards_finish
      logical :: done

      self%corrector%options = self%options
      call self%corrector%reset(system)
      self%corrector%metric%p_scale = max(abs(self%finish - self%start), tiny(1.0_wp))
      self%x_scale = max(self%x_scale, tiny(1.0_wp))
      self%corrector%least_x = self%x_scale
      self%n_points = 1
      self%furthest = self%start
      self%n_constant = 0
      self%ended = .false.
      self%waits = .false.
      self%history%known = .false.
      towards_finish%x = x
      towards_finish%p = self%start
      allocate (towards_finish%t(size(x)), source=0.0_wp)
      towards_finish%t_p = sign(self%corrector%metric%p_scale, self%finish - self%start)
      call system%set_parameter(self%start, error)
      if (allocated(error)) return
      call self%corrector%see(x, towards_finish%y)
      if (associated(self%corrector%view)) self%corrector%metric%n_seen = self%corrector%view%n
      self%corrector%metric%y_scale = 0.0_wp
      self%corrector%metric%x_scale = 0.0_wp
      call self%scale_metric(towards_finish)
      allocate (towards_finish%t_y, mold=towards_finish%y)
      towards_finish%t_y = 0.0_wp
      self%here = towards_finish
      call self%corrector%find_tangent(system, towards_finish, self%here, done)
      self%first = self%here
      call self%way%forget()
      call self%way%add(self%here)
      if (.not. done) then
         call end_branch(self, 'the derivative at its first point is singular')
         return
      end if
      call self%near%find(self%corrector, system, self%here, self%corrector%x_scale(x))
      self%ds = self%step*self%corrector%metric%p_scale/abs(self%here%t_p)
      call self%limit_step()
   end subroutine begin

   !> The next point, in either direction of p; the system may stand at another p then. `more` is
   !> false where there is none: the branch has ended, for the reason in `ending`.
   subroutine next(self, system, point, more, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: ahead
      logical :: done

      more = .true.
      if (self%waits) then
         self%waits = .false.
         point = self%waiting
         call pass(self, point)
         return
      end if
      if (self%n_points >= self%max_points) call end_branch(self, 'max_points was reached')
      more = .not. self%ended
      if (.not. more) return
      call advance(self, system, ahead, done, error)
      if (allocated(error)) return
      if (done) call leave_own_way(self, system, ahead, done, error)
      if (allocated(error)) return
      if (.not. done) then
         call end_branch(self, 'no continuation was found at '//to_text(self%here%p))
         more = .false.
         return
      end if
      call settle(self, system, ahead, point, error)
   end subroutine next

   !> Where a corner leads back along the branch itself, a step in p alone goes on, if there is one.
   subroutine leave_own_way(self, system, ahead, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: ahead
      !> Whether `ahead` is a new point.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: r(system%n)
      logical :: retraced

      done = .true.
      call self%trail%keep(self%corrector%metric, self%here)
      if (self%here%t_p*ahead%t_p >= 0.0_wp .and. .not. self%trail%has_turned) return
      if (self%corrector%metric%chord(self%here, ahead) > limits%corner) return
      call self%trail%is_retraced(self%corrector, system, ahead, retraced, error)
      if (allocated(error)) return
      if (retraced) then
         call pass_over(self, system, ahead, done, error)
         call self%forget_ahead()
      end if
      if (allocated(error) .or. .not. done) return
      ! What follows takes the system and its factors at the point.
      call system%set_parameter(ahead%p, error)
      if (allocated(error)) return
      call system%residual(ahead%x, r)
      call self%corrector%linear%prepare(system, done)
   end subroutine leave_own_way

   !> Step over a corner in p alone: from the point before it, and from some further back, whose
   !> pieces lead elsewhere.
   subroutine pass_over(self, system, ahead, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: ahead
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_back = 12, every = 3
      type(branch_point) :: from
      real(wp) :: corner_p
      integer :: k

      done = .false.
      call self%trail%back(0, from)
      corner_p = from%p
      do k = 0, min(most_back, self%trail%n_kept() - 1), every
         call self%trail%back(k, from)
         call leap(self%corrector, system, from, only_ahead, ahead, error)
         if (allocated(error)) return
         ! Beyond the corner, not beside the points before it.
         done = ahead%report%converged .and. (ahead%p - corner_p)*from%t_p > 0.0_wp
         if (done) exit
      end do
      if (done) call self%trail%forget()
   end subroutine pass_over

   !> A step has come to `passed`: it is the next point, unless a corner of the equations, a fold or
   !> a bound lies before it.
   !> A fold between the two is given out first and `ahead` waits: `next` gives it out afterwards.
   subroutine settle(self, system, passed, point, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: passed
      type(branch_point), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: before, ahead
      real(wp) :: bound
      logical :: on_corner

      before = self%here
      call stop_at_corner(self, system, passed, ahead, on_corner, error)
      if (allocated(error)) return
      ! Outside of both bounds: the one on whose side it lies.
      if ((ahead%p - self%start)*(ahead%p - self%finish) > 0.0_wp) then
         bound = merge(self%start, self%finish, (ahead%p - self%start)*(self%finish - &
            self%start) < 0.0_wp)
         call land(self%corrector, system, before, ahead, bound, point, error)
         if (.not. allocated(error)) call end_at_bound(self, point, bound)
         self%waiting = point
      else if (abs(ahead%p - self%finish) <= round_off*abs(self%finish - self%start)) then
         ! Another step, of nothing, would lead to a second point there.
         self%waiting = ahead
         call end_at_bound(self, ahead, self%finish)
      else
         call self%plan(system, ahead)
         ! No cubic goes round a corner.
         if (on_corner) self%history%known = .false.
         call self%way%add(self%here)
         self%waiting = ahead
      end if
      if (allocated(error)) return
      ! dp/ds has changed its sign.
      self%waits = before%t_p*ahead%t_p < 0.0_wp
      if (self%waits) call find_fold(self%corrector, system, before, ahead, point, error)
      if (allocated(error)) return
      if (self%waits .and. point%fold) return
      self%waits = .false.
      point = self%waiting
      call pass(self, point)
   end subroutine settle

   !> The first corner between the last point and one that was reached, if there is any.
   subroutine stop_at_corner(self, system, passed, ahead, found, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: passed
      type(branch_point), intent(out) :: ahead
      !> Whether `ahead` lies on a corner.
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: landed
      real(wp) :: corner, r(system%n)
      integer :: k

      ahead = passed
      found = .false.
      if (.not. allocated(self%corner)) return
      corner = passed%p
      associate (here => self%here%p, least => round_off*abs(self%finish - self%start))
         do k = 1, size(self%corner)
            if ((self%corner(k) - here)*(self%corner(k) - corner) >= 0.0_wp) cycle
            if (min(abs(self%corner(k) - here), abs(self%corner(k) - corner)) <= least) cycle
            corner = self%corner(k)
            found = .true.
         end do
      end associate
      if (.not. found) return
      call land(self%corrector, system, self%here, passed, corner, landed, error)
      if (allocated(error)) return
      if (landed%report%converged) then
         call turn_round_corner(self, system, passed, landed, error)
         if (allocated(error)) return
         call self%forget_ahead()
         ahead = landed
      end if
      ! What follows takes the system and its factors at the point.
      call system%set_parameter(ahead%p, error)
      if (allocated(error)) return
      call system%residual(ahead%x, r)
      call self%corrector%linear%prepare(system, found)
      found = landed%report%converged
   end subroutine stop_at_corner

   !> The tangent of the far side of a corner, along the way that p goes.
   subroutine turn_round_corner(self, system, passed, point, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: passed
      type(branch_point), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      !> Beyond the differences that slopes are found by, over p.
      real(wp), parameter :: beside = 1.0e-6_wp
      real(wp) :: corner
      logical :: done

      corner = point%p
      point%p = corner + sign(beside*abs(corner), passed%p - self%here%p)
      call system%set_parameter(point%p, error)
      if (.not. allocated(error)) then
         call self%corrector%find_tangent(system, passed, point, done)
      end if
      point%p = corner
      ! A sharp corner may turn it round in the measure of the curve.
      if (point%t_p*(passed%p - self%here%p) >= 0.0_wp) return
      point%t = -point%t
      point%t_y = -point%t_y
      point%t_p = -point%t_p
      point%orientation = -point%orientation
   end subroutine turn_round_corner

   !> Count a point and see whether the branch runs away.
   subroutine pass(self, point)
      class(arclength_type), intent(inout) :: self
      type(branch_point), intent(in) :: point

      self%n_points = self%n_points + 1
      if (abs(point%p - self%start) > abs(self%furthest - self%start)) self%furthest = point%p
      self%n_constant = merge(self%n_constant + 1, 0, self%corrector%stands(point))
      self%runs_away = self%n_constant >= max_constant .and. .not. self%ended
      if (self%runs_away) call end_branch(self, 'its points run away at a constant parameter')
   end subroutine pass

   !> At the far bound the branch is complete; at the near one it has come back, to its first point
   !> or to another solution of the same frequency.
   subroutine end_at_bound(self, point, bound)
      class(arclength_type), intent(inout) :: self
      type(branch_point), intent(in) :: point
      real(wp), intent(in) :: bound

      if (abs(bound - self%start) > 0.0_wp) then
         self%complete = point%report%converged
         call end_branch(self, 'followed to the end of the sweep')
      else if (is_first(self, point)) then
         ! A curve that began at the bound cannot come back there as another part of itself.
         call end_branch(self, 'it turned back on itself, no further from the start than '// &
                         to_text(self%furthest)//', and came to its first point again; the '// &
                         'end was not reached')
      else
         call end_branch(self, 'it returned to the start of the sweep with another response; '// &
                         'the end was not reached')
      end if
   end subroutine end_at_bound

   !> Whether a point is the first, by the size of what is measured there.
   pure logical function is_first(self, point)
      class(arclength_type), intent(in) :: self
      type(branch_point), intent(in) :: point

      associate (metric => self%corrector%metric)
         is_first = metric%size(point%y - self%first%y) <= &
                    same*max(metric%size(point%y), metric%size(self%first%y))
      end associate
   end function is_first

   !> The first reason is the one that counts.
   subroutine end_branch(self, reason)
      class(arclength_type), intent(inout) :: self
      character(*), intent(in) :: reason

      if (self%ended) return
      self%ending = reason
      self%ended = .true.
   end subroutine end_branch

   !> Take a step, shortening it until it counts. Where none does, again from a step that reaches
   !> beyond a corner: steps that have become tiny before it have not tried those.
   subroutine advance(self, system, ahead, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(out) :: ahead
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error

      if (associated(self%corrector%view)) then
         ! With many pairs, places where pieces meet lie close together: across them.
         call self%shorten_until_taken(system, limits%turning, 0.5_wp, ahead, done, error)
         if (allocated(error) .or. done) return
         call leap(self%corrector, system, self%here, far_ahead, ahead, error)
         if (.not. allocated(error)) call leads_on(self, system, ahead, done, error)
         if (allocated(error) .or. done) return
      end if
      call self%shorten_until_taken(system, shortest, 0.5_wp, ahead, done, error)
      if (allocated(error) .or. done) return
      ! A predictor from before a corner leads away from it: along the tangent, then.
      self%ds = limits%corner
      self%history%known = .false.
      call self%shorten_until_taken(system, limits%bifurcation, 0.7_wp, ahead, done, error)
      if (allocated(error) .or. done) return
      self%corrector%careful = .false.
      call leap(self%corrector, system, self%here, all_around, ahead, error)
      if (.not. allocated(error)) call leads_on(self, system, ahead, done, error)
      if (allocated(error) .or. done) return
      call self%trail%keep(self%corrector%metric, self%here)
      call pass_over(self, system, ahead, done, error)
      if (done) call leads_on(self, system, ahead, done, error)
   end subroutine advance

   !> Whether a leap has found something, and not the way that the branch has come.
   subroutine leads_on(self, system, ahead, answer, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      logical, intent(out) :: answer
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: r(system%n)
      logical :: is_old

      answer = .false.
      if (.not. ahead%report%converged) return
      call self%way%holds(self%corrector, system, ahead, is_old, error)
      if (allocated(error) .or. is_old) return
      ! What follows takes the system and its factors at the point.
      call system%set_parameter(ahead%p, error)
      if (allocated(error)) return
      call system%residual(ahead%x, r)
      call self%corrector%linear%prepare(system, answer)
   end subroutine leads_on

end module fw_continuation
