!> Pseudo-arclength continuation of R(x, p) = 0 (Keller 1977) with analytic dR/dp: predictor along
!> the tangent, Newton corrector orthogonal to it, adaptive step, folds located on the way.
!>
!> Contact makes R piecewise smooth, and at a kink the branch may turn by more than a right angle:
!> then no point lies ahead on the tangent, and Newton's method cycles between the two pieces. The
!> tangent of the piece beyond the kink is taken. Its direction follows from what is constant
!> along a branch of a piecewise smooth system, the sign of det(dR/dx) dp/ds (Allgower, Georg
!> 1990, Numerical continuation methods, on piecewise linear ones).
!>
!> Lengths are measured with x over its own scale and p over the length of its interval, so that
!> a step means the same in every system of units.
module fw_continuation
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_bordered, only: bordered_type
   use fw_kinds, only: wp
   use fw_error, only: error_type
   use fw_linalg, only: lu_type
   use fw_linear_step, only: linear_step_type
   use fw_newton, only: newton_solver
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   use fw_solver_options, only: solver_options
   implicit none (type, external)
   private

   public :: arclength_type, branch_point

   !> A point of the branch with its unit tangent (dx/ds, dp/ds).
   type :: branch_point
      real(wp), allocatable :: x(:), t(:)
      real(wp) :: p = 0.0_wp
      real(wp) :: t_p = 0.0_wp
      !> How it was found; all converged but perhaps for one on a bound.
      type(solver_report) :: report
      !> Whether p turns here.
      logical :: fold = .false.
   end type branch_point

   type :: arclength_type
      type(solver_options) :: options
      type(linear_step_type) :: linear
      !> What it takes where the derivative by x alone is close to singular.
      type(bordered_type) :: bordered
      !> The interval of p: from start to finish.
      real(wp) :: start = 0.0_wp
      real(wp) :: finish = 1.0_wp
      !> First step as a share of the interval.
      real(wp) :: step = 0.01_wp
      integer :: max_points = 1000
      !> Scales of x (at least; it follows the branch) and p in lengths.
      real(wp) :: x_scale = 0.0_wp
      real(wp) :: p_scale = 1.0_wp
      !> Why the branch ended.
      character(:), allocatable :: ending
      !> Whether it ended at a bound of the interval.
      logical :: complete = .false.
      !> Whether it ended because x runs away while p stays.
      logical :: runs_away = .false.
      !> Whether the orientation is looked at; without, the smaller angle between tangents decides.
      logical :: oriented = .true.
      ! Where the branch has come to, the point after a fold that waits, and the step.
      type(branch_point) :: here, waiting
      logical :: waits = .false.
      logical :: ended = .false.
      real(wp) :: ds = 0.0_wp
      integer :: n_points = 0, n_constant = 0
   contains
      procedure :: begin
      procedure :: next
   end type arclength_type

   !> Corrector iterations: more than the last is a failure; the others steer the step.
   integer, parameter :: max_corrections = 14, quick = 3, slow = 7
   !> Corrections without a smaller residual that end an attempt: a cycle.
   integer, parameter :: patience = 4
   !> A turn at a kink is tried when the step has shrunk to this multiple of the first one.
   real(wp), parameter :: turn_below = 0.1_wp
   !> A step in p alone is tried from the first step divided by two to this power.
   integer, parameter :: max_leap = 6
   !> Tangents without a part in p: a fold has one, a branch that has so many in a row runs away.
   real(wp), parameter :: constant = 1.0e-6_wp
   integer, parameter :: max_constant = 8
   !> Cosine of the angle between tangents below which a branch turns sharply.
   real(wp), parameter :: sharp = 0.8_wp
   !> Unknowns up to which the orientation is looked at: it takes the LU factors of the whole
   !> derivative, which beyond cost more than the points of the branch.
   integer, parameter :: orientation_up_to = 1000
   !> Steps between these multiples of the first one.
   real(wp), parameter :: largest_growth = 2.0_wp, smallest_share = 1.0e-5_wp
   !> Iterative linear solutions: the tangent needs more digits than a Newton step.
   real(wp), parameter :: forcing = 1.0e-6_wp
   !> A fold is located when p changes by less than this part of itself.
   real(wp), parameter :: fold_tolerance = 1.0e-10_wp
   integer, parameter :: max_fold_steps = 40

contains

   !> Start at a converged x at p = start, towards finish; that point is the first of max_points.
   subroutine begin(self, system, x, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: towards_finish
      logical :: done

      self%linear%kind = self%options%linear
      ! Derivatives near folds and runaway branches are too close to singular for old factors.
      self%linear%keeps = .false.
      self%linear%lu_follows = .true.
      self%oriented = system%n <= orientation_up_to
      self%p_scale = max(abs(self%finish - self%start), tiny(1.0_wp))
      self%x_scale = max(self%x_scale, norm2(x), tiny(1.0_wp))
      self%ds = self%step
      self%n_points = 1
      self%n_constant = 0
      self%ended = .false.
      self%waits = .false.
      towards_finish%x = x
      towards_finish%p = self%start
      allocate (towards_finish%t(size(x)), source=0.0_wp)
      towards_finish%t_p = sign(self%p_scale, self%finish - self%start)
      self%here = towards_finish
      call system%set_parameter(self%start, error)
      if (allocated(error)) return
      call find_tangent(self, system, towards_finish, self%here, done)
   end subroutine begin

   !> The next point, in either direction of p; the system may stand at another p then. `more` is
   !> false where there is none: the branch has ended, for the reason in `ending`.
   subroutine next(self, system, point, more, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: ahead, turn
      real(wp) :: ds
      logical :: done

      more = .true.
      if (self%waits) then
         call settle(self, system, self%waiting, point, error)
         return
      end if
      if (self%n_points >= self%max_points) call end_branch(self, 'max_points was reached')
      more = .not. self%ended
      if (.not. more) return
      ds = self%ds
      call advance(self, system, self%here, ds, ahead, done, error)
      if (allocated(error)) return
      self%ds = ds
      if (.not. done) then
         call end_branch(self, 'the corrector failed at the smallest step')
         more = .false.
         return
      end if
      if (self%here%t_p*ahead%t_p < 0.0_wp) then
         call find_fold(self, system, self%here, ahead, ds, turn, error)
         if (allocated(error)) return
         if (turn%fold) then
            self%waiting = ahead
            self%waits = .true.
            point = turn
            return
         end if
      end if
      call settle(self, system, ahead, point, error)
   end subroutine next

   !> A step has come to `ahead`: it is the next point, unless a bound lies before it.
   subroutine settle(self, system, ahead, point, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      type(branch_point), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error

      self%waits = .false.
      self%n_points = self%n_points + 1
      if ((ahead%p - self%start)*(ahead%p - self%finish) > 0.0_wp) then
         call land(self, system, self%here, ahead, point, error)
         return
      end if
      point = ahead
      if (point%report%iterations <= quick) self%ds = min(1.4_wp*self%ds, &
         largest_growth*self%step)
      if (point%report%iterations >= slow) self%ds = 0.6_wp*self%ds
      self%here = point
      self%n_constant = merge(self%n_constant + 1, 0, stands(self, point))
      self%runs_away = self%n_constant >= max_constant
      if (self%runs_away) call end_branch(self, 'its points run away at a constant parameter')
   end subroutine settle

   subroutine end_branch(self, reason)
      class(arclength_type), intent(inout) :: self
      character(*), intent(in) :: reason

      if (self%ended) return
      self%ending = reason
      self%ended = .true.
   end subroutine end_branch

   !> Unit tangent (dx/dp, 1) at a point, in the direction of another one's.
   subroutine find_tangent(self, system, previous, point, done)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: previous
      type(branch_point), intent(inout) :: point
      logical, intent(out) :: done
      real(wp), allocatable :: r(:), slope(:), t(:)
      real(wp) :: length, direction

      allocate (r(system%n), slope(system%n), t(system%n))
      call system%residual(point%x, r)
      call self%linear%prepare(system, done)
      if (.not. done) return
      call system%parameter_derivative(point%x, slope)
      call self%linear%solve_prepared(system, slope, forcing, t, done)
      if (.not. done) return
      length = sqrt(inner(self, t, 1.0_wp, t, 1.0_wp))
      direction = sign(1.0_wp, inner(self, t, 1.0_wp, previous%t, previous%t_p))
      point%t = direction*t/length
      point%t_p = direction/length
   end subroutine find_tangent

   pure real(wp) function inner(self, x1, p1, x2, p2)
      class(arclength_type), intent(in) :: self
      real(wp), intent(in) :: x1(:), p1, x2(:), p2

      inner = dot_product(x1, x2)/self%x_scale**2 + p1*p2/self%p_scale**2
   end function inner

   !> Take a step, halving it until the corrector converges.
   subroutine advance(self, system, here, ds, next, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      real(wp), intent(inout) :: ds
      type(branch_point), intent(out) :: next
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      integer :: orientation

      self%x_scale = max(self%x_scale, norm2(here%x))
      orientation = 0
      do
         call correct(self, system, here, ds, next, error)
         if (allocated(error)) return
         done = next%report%converged
         if (done) call look_ahead(self, system, here, ds, orientation, next, done, error)
         if (allocated(error) .or. done) return
         if (ds < turn_below*self%step .and. self%oriented) then
            call turn_at_kink(self, system, here, ds, orientation, next, error)
            if (allocated(error)) return
            done = next%report%converged
            if (done) return
         end if
         if (ds < smallest_share*self%step) exit
         ds = 0.5_wp*ds
      end do
      call leap(self, system, here, orientation, ds, next, error)
      done = next%report%converged
   end subroutine advance

   !> A step in p alone, beyond a place where many pieces meet or where the derivative has no bound
   !> (a pair whose slip of a period vanishes): Newton's method with its line search from `here`,
   !> first close by, then further away; ahead, then on the other side, where the branch may turn.
   subroutine leap(self, system, here, orientation, ds, next, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      integer, intent(inout) :: orientation
      !> Distance of the point that was reached.
      real(wp), intent(inout) :: ds
      type(branch_point), intent(out) :: next
      type(error_type), allocatable, intent(out) :: error
      integer :: k, side

      do side = 1, merge(-1, 1, self%oriented), -2
         do k = -max_leap, 0
            call leap_to(self, system, here, side*sign(2.0_wp**k*self%step*self%p_scale, &
               here%t_p), orientation, next, error)
            if (allocated(error)) return
            if (next%report%converged) exit
         end do
         if (next%report%converged) exit
      end do
      if (next%report%converged) ds = sqrt(inner(self, next%x - here%x, next%p - here%p, &
         next%x - here%x, next%p - here%p))
   end subroutine leap

   !> The point at p + dp, if the branch goes on there in the direction of dp.
   subroutine leap_to(self, system, here, dp, orientation, next, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      real(wp), intent(in) :: dp
      integer, intent(inout) :: orientation
      type(branch_point), intent(out) :: next
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      integer :: its_orientation
      logical :: done

      newton%options = self%options
      next = here
      next%p = here%p + dp
      call system%set_parameter(next%p, error)
      if (allocated(error)) return
      call newton%solve(system, next%x, next%report)
      if (.not. next%report%converged) return
      call find_tangent(self, system, here, next, done)
      next%report%converged = done
      if (.not. done) return
      ! Beyond a sharp turn the angle with the last tangent says nothing.
      if (next%t_p*dp < 0.0_wp) call reverse(next)
      if (.not. self%oriented) return
      if (orientation == 0) call find_orientation(self, system, here, orientation, error)
      if (allocated(error)) return
      call find_orientation(self, system, next, its_orientation, error)
      next%report%converged = .not. differ(its_orientation, orientation)
   end subroutine leap_to

   !> Step along the tangent of the piece just beyond `here`, in the direction that keeps the
   !> orientation of the branch.
   subroutine turn_at_kink(self, system, here, ds, orientation, next, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      real(wp), intent(in) :: ds
      !> Orientation at `here`; 0 where it is not known yet.
      integer, intent(inout) :: orientation
      type(branch_point), intent(out) :: next
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: beyond
      integer :: its_orientation
      logical :: done

      if (orientation == 0) call find_orientation(self, system, here, orientation, error)
      if (allocated(error)) return
      beyond = here
      beyond%x = here%x + ds*here%t
      beyond%p = here%p + ds*here%t_p
      call system%set_parameter(beyond%p, error)
      if (allocated(error)) return
      call find_tangent(self, system, here, beyond, done)
      if (.not. done) return
      call find_orientation(self, system, beyond, its_orientation, error)
      if (allocated(error)) return
      ! Of a tangent with no orientation, the corrector has tried the direction of `here`.
      if (stands(self, beyond) .or. differ(its_orientation, orientation)) call reverse(beyond)
      ! From the piece beyond: a plane across its tangent may meet the piece of `here` as well.
      call correct(self, system, beyond, ds, next, error)
      if (allocated(error) .or. .not. next%report%converged) return
      ! A point with the other orientation lies on the way back.
      call find_orientation(self, system, next, its_orientation, error)
      next%report%converged = .not. differ(its_orientation, orientation)
   end subroutine turn_at_kink

   !> A point with the other orientation: where the branch turns sharply, the tangent that makes the
   !> smaller angle with the last one leads back, and is reversed. Where it does not turn, the step
   !> may have gone across to another part of the branch, and a smaller one is asked for; what is
   !> left then is a bifurcation, beyond which a branch has the other orientation.
   subroutine look_ahead(self, system, here, ds, orientation, next, done, error)
      class(arclength_type), intent(in) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      real(wp), intent(in) :: ds
      !> Orientation at `here`; 0 where it is not known yet.
      integer, intent(inout) :: orientation
      type(branch_point), intent(inout) :: next
      !> Whether the step counts.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      integer :: its_orientation

      done = .true.
      if (.not. self%oriented) return
      if (orientation == 0) call find_orientation(self, system, here, orientation, error)
      if (allocated(error)) return
      call find_orientation(self, system, next, its_orientation, error)
      if (allocated(error) .or. .not. differ(its_orientation, orientation)) return
      if (inner(self, here%t, here%t_p, next%t, next%t_p) > sharp) then
         done = ds < turn_below*self%step
      else
         call reverse(next)
      end if
   end subroutine look_ahead

   !> Turn the tangent round.
   pure subroutine reverse(point)
      type(branch_point), intent(inout) :: point

      point%t = -point%t
      point%t_p = -point%t_p
   end subroutine reverse

   !> Sign of det(dR/dx) dp/ds. It is the same all along a branch: det(dR/dx) changes its sign where
   !> p turns, in a smooth fold as at a kink. 0 where p does not move and dR/dx is singular: the
   !> sign would be that of round-off.
   subroutine find_orientation(self, system, point, orientation, error)
      class(arclength_type), intent(in) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: point
      integer, intent(out) :: orientation
      type(error_type), allocatable, intent(out) :: error
      type(lu_type) :: lu
      real(wp), allocatable :: r(:)
      logical :: singular
      integer :: n

      orientation = 0
      if (stands(self, point)) return
      call system%set_parameter(point%p, error)
      if (allocated(error)) return
      allocate (r(system%n))
      call system%residual(point%x, r)
      call system%linearize(n)
      call lu%reserve(n)
      call system%assemble(lu%matrix)
      call lu%factor(singular)
      orientation = lu%determinant_sign()
      if (point%t_p < 0.0_wp) orientation = -orientation
   end subroutine find_orientation

   !> Whether p does not move along the branch at a point.
   pure logical function stands(self, point)
      class(arclength_type), intent(in) :: self
      type(branch_point), intent(in) :: point

      stands = abs(point%t_p) <= constant*self%p_scale
   end function stands

   !> Whether the orientations of two points are known and differ.
   pure logical function differ(a, b)
      integer, intent(in) :: a, b

      differ = a*b < 0
   end function differ

   !> Newton's method on R = 0 with the distance along the tangent fixed to ds.
   subroutine correct(self, system, here, ds, next, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      real(wp), intent(in) :: ds
      type(branch_point), intent(out) :: next
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: r(:), step(:)
      real(wp) :: dp, best
      logical :: done
      integer :: stalled

      allocate (r(system%n), step(system%n))
      next%x = here%x + ds*here%t
      next%p = here%p + ds*here%t_p
      best = huge(1.0_wp)
      stalled = 0
      do
         call system%set_parameter(next%p, error)
         if (allocated(error)) return
         call system%residual(next%x, r)
         next%report%residual = norm2(r)/system%reference
         next%report%converged = next%report%residual <= self%options%tolerance
         if (next%report%converged .or. next%report%iterations == max_corrections) exit
         if (.not. ieee_is_finite(next%report%residual)) exit
         stalled = stalled + 1
         if (next%report%residual < 0.9_wp*best) stalled = 0
         best = min(best, next%report%residual)
         if (stalled >= patience .or. next%report%residual > 1.0e3_wp*best) exit
         if (ds < turn_below*self%step .and. self%oriented) then
            call bordered_step(self, system, here, next, r, step, dp, done)
         else
            call combined_step(self, system, here, next, r, step, dp, done)
         end if
         if (.not. done) exit
         next%report%iterations = next%report%iterations + 1
         next%x = next%x + step
         next%p = next%p + dp
      end do
      if (next%report%converged) then
         call find_tangent(self, system, here, next, done)
         next%report%converged = done
      end if
   end subroutine correct

   !> One step of the corrector from two solutions with the derivative by x.
   subroutine combined_step(self, system, here, next, r, step, dp, done)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done
      real(wp), allocatable :: slope(:), dx_dp(:)

      allocate (slope(system%n), dx_dp(system%n))
      dp = 0.0_wp
      call self%linear%solve(system, r, forcing, step, done)
      if (.not. done) return
      call system%parameter_derivative(next%x, slope)
      call self%linear%solve_prepared(system, slope, forcing, dx_dp, done)
      if (.not. done) return
      dp = -inner(self, here%t, here%t_p, step, 0.0_wp)/inner(self, here%t, here%t_p, dx_dp, &
         1.0_wp)
      step = step + dp*dx_dp
   end subroutine combined_step

   !> The same from the bordered matrix.
   subroutine bordered_step(self, system, here, next, r, step, dp, done)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done
      logical :: singular

      dp = 0.0_wp
      call self%bordered%prepare(system, next%x, here%t, &
                                 here%t_p*(self%x_scale/self%p_scale)**2, singular)
      done = .not. singular
      if (done) call self%bordered%solve(system, r, 0.0_wp, step, dp)
   end subroutine bordered_step

   !> Between two points whose tangents differ in the sign of dp/ds lies a fold: regula falsi
   !> (Illinois) on that sign.
   subroutine find_fold(self, system, here, next, ds, middle, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in) :: ds
      !> `fold` is false where it is not found.
      type(branch_point), intent(out) :: middle
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: low, high, at_low, at_high, s, p_before
      integer :: k

      low = 0.0_wp
      high = ds
      at_low = here%t_p
      at_high = next%t_p
      p_before = huge(1.0_wp)
      do k = 1, max_fold_steps
         s = (low*at_high - high*at_low)/(at_high - at_low)
         call correct(self, system, here, s, middle, error)
         if (allocated(error)) return
         if (.not. middle%report%converged) return
         if (abs(middle%p - p_before) <= fold_tolerance*abs(middle%p)) exit
         p_before = middle%p
         if (middle%t_p*at_low > 0.0_wp) then
            low = s
            at_low = middle%t_p
            at_high = 0.5_wp*at_high
         else
            high = s
            at_high = middle%t_p
            at_low = 0.5_wp*at_low
         end if
      end do
      middle%fold = .true.
   end subroutine find_fold

   !> The branch leaves the interval: its last point lies exactly on the bound.
   subroutine land(self, system, here, next, point, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      type(branch_point), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: r(:), step(:)
      real(wp) :: bound, share
      logical :: done

      bound = merge(self%start, self%finish, (next%p - self%start)*(self%finish - &
         self%start) < 0.0_wp)
      share = (bound - here%p)/(next%p - here%p)
      point = next
      point%p = bound
      point%report = solver_report()
      point%x = here%x + share*(next%x - here%x)
      allocate (r(system%n), step(system%n))
      call system%set_parameter(bound, error)
      if (allocated(error)) return
      do
         call system%residual(point%x, r)
         point%report%residual = norm2(r)/system%reference
         point%report%converged = point%report%residual <= self%options%tolerance
         if (point%report%converged .or. point%report%iterations == max_corrections) exit
         call self%linear%solve(system, r, forcing, step, done)
         if (.not. done) exit
         point%x = point%x + step
         point%report%iterations = point%report%iterations + 1
      end do
      if (abs(bound - self%start) <= 0.0_wp) then
         call end_branch(self, 'it returned to the start of the sweep; the end was not reached')
      else
         call end_branch(self, 'followed to the end of the sweep')
         self%complete = point%report%converged
      end if
   end subroutine land

end module fw_continuation
