!> Pseudo-arclength continuation of R(x, p) = 0 (Keller 1977) with analytic dR/dp, point by point:
!> predictor along a cubic through the last points, Newton corrector across the tangent, a step
!> that follows from the curve, folds located on the way.
!>
!> A step counts only if the corrector stays near its predictor, the angles between chord and
!> tangents are small, the cubic through points and tangents is true to the curve, and no resonance
!> of the linearized system is passed over; otherwise it is halved (fw_corrector, fw_branch_step,
!> fw_near_response). Only steps that are next to nothing may turn sharply: those of a corner
!> (fw_branch_turn).
module fw_continuation
   use fw_branch_crossing, only: goes_through
   use fw_branch_mark, only: find_fold
   use fw_branch_mark, only: land
   use fw_branch_point, only: branch_point
   use fw_branch_point, only: reverse
   use fw_branch_retrace, only: branch_trail
   use fw_branch_step, only: allowed_error
   use fw_branch_step, only: extrapolate
   use fw_branch_step, only: interpolate
   use fw_branch_step, only: missed
   use fw_branch_step, only: misses_of
   use fw_branch_step, only: step_history
   use fw_branch_step, only: turns_between
   use fw_branch_turn, only: all_around
   use fw_branch_turn, only: far_ahead
   use fw_branch_turn, only: leap
   use fw_branch_turn, only: only_ahead
   use fw_branch_turn, only: turn_at_corner
   use fw_branch_way, only: branch_way
   use fw_corrector, only: corrector_type
   use fw_corrector, only: differ
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_near_response, only: near_response
   use fw_parameter_system, only: parameter_system
   use fw_solver_options, only: solver_options
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: arclength_type, branch_point

   type :: arclength_type
      type(solver_options) :: options
      type(corrector_type) :: corrector
      !> The interval of p: from start to finish.
      real(wp) :: start = 0.0_wp
      real(wp) :: finish = 1.0_wp
      !> First step as a share of the interval.
      real(wp) :: step = 0.01_wp
      integer :: max_points = 1000
      !> Longest step of p over the interval.
      real(wp) :: longest = 0.0625_wp
      !> The least size of x that matters.
      real(wp) :: x_scale = 0.0_wp
      !> Resonances of what x does not show, heeded where x does not move at all: where they are in
      !> p, and half their half-power widths.
      real(wp), allocatable :: pole(:), pole_width(:)
      !> Why the branch ended.
      character(:), allocatable :: ending
      logical :: ended = .false.
      !> Whether it ended at finish.
      logical :: complete = .false.
      !> Whether it ended because x runs away while p stays.
      logical :: runs_away = .false.
      !> Steps that were tried and not taken.
      integer :: n_rejected = 0
      ! Where the branch began and has come to, the point after a fold that waits, and the step.
      type(branch_point) :: first, here, waiting
      type(step_history) :: history
      type(near_response) :: near, near_ahead
      logical :: waits = .false., knows_ahead = .false.
      real(wp) :: ds = 0.0_wp
      integer :: n_points = 0, n_constant = 0, n_failed = 0
      ! The last points, and how far p has been.
      type(branch_trail) :: trail
      type(branch_way), private :: way
      real(wp) :: furthest = 0.0_wp
   contains
      procedure :: begin
      procedure :: next
      procedure :: end_early => end_branch
   end type arclength_type

   !> Corrector iterations from which on steps get shorter.
   integer, parameter :: slow = 7
   real(wp), parameter :: slower = 0.6_wp
   !> Growth and shortening of a step.
   real(wp), parameter :: largest_growth = 2.5_wp, least_growth = 0.3_wp
   real(wp), parameter :: halved = 0.5_wp
   !> Steps aim at this part of the error that is allowed.
   real(wp), parameter :: aim = 0.4_wp
   !> What the model of the resonances may say of a step that has been taken, of the error that is
   !> allowed.
   real(wp), parameter :: passed = 0.6_wp
   !> What may be found at one place of a step, of the error that is allowed.
   real(wp), parameter :: looked_at = 0.7_wp
   !> What unknowns count beside the response that they make, where that is what is measured: they
   !> may run away where the vibration stays.
   real(wp), parameter :: weight_x = 0.02_wp
   !> Failures of a step from which on it is tried in p alone, where p is this part of it at least.
   integer, parameter :: most_failed = 1
   real(wp), parameter :: least_share = 2.0e-2_wp
   !> Share of a step at its ends where no corner is looked for.
   real(wp), parameter :: least_place = 0.25_wp
   !> Places of single corners, and where several are looked for.
   real(wp), parameter :: around(2) = [0.35_wp, 0.72_wp], amidst = 0.42_wp
   !> Longest step of y over its size.
   real(wp), parameter :: longest_y = 0.5_wp
   !> Step over the distance of a simple pole at which a cubic misses (0.45)^4/16 of it, 0.3 %.
   real(wp), parameter :: beside_pole = 0.45_wp
   !> What is left of the size of x from one point to the next where x itself gets smaller.
   real(wp), parameter :: fading = 0.4_wp
   !> Angles of a step (rad): between its tangents, between a tangent and its chord, and what
   !> the next step aims at.
   real(wp), parameter :: max_turn = 0.9_wp, max_chord = 0.55_wp, aimed_turn = 0.6_wp
   !> Distance of the corrected point from the predictor, in steps.
   real(wp), parameter :: max_distance = 0.5_wp
   !> Length up to which a step may turn at any angle and the corrector go as far: corners, and
   !> what the instants of sampled contact make of a curve, are not to be told apart there. A cubic
   !> misses at most a quarter of it.
   real(wp), parameter :: corner = 1.0e-2_wp
   !> Length from which on the tangent beyond a corner is tried.
   real(wp), parameter :: turning = 2.5e-3_wp
   !> Length below which the other orientation is that of a bifurcation.
   real(wp), parameter :: bifurcation = 1.0e-5_wp
   !> Shortest step.
   real(wp), parameter :: shortest = 1.0e-7_wp
   !> Points without a part in p: a fold has one, a branch that has so many in a row runs away.
   integer, parameter :: max_constant = 8
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
      call scale_metric(self, towards_finish)
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
      call limit_step(self)
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
      if (self%corrector%metric%chord(self%here, ahead) > corner) return
      call self%trail%is_retraced(self%corrector, system, ahead, retraced, error)
      if (allocated(error)) return
      if (retraced) then
         call pass_over(self, system, ahead, done, error)
         self%knows_ahead = .false.
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

   !> A step has come to `ahead`: it is the next point, unless a fold or a bound lies before it.
   !> A fold between the two is given out first and `ahead` waits: `next` gives it out afterwards.
   subroutine settle(self, system, ahead, point, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      type(branch_point), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: before
      real(wp) :: bound

      before = self%here
      ! Outside of both bounds: the one on whose side it lies.
      if ((ahead%p - self%start)*(ahead%p - self%finish) > 0.0_wp) then
         bound = merge(self%start, self%finish, (ahead%p - self%start)*(self%finish - &
            self%start) < 0.0_wp)
         call land(self%corrector, system, before, ahead, bound, point, error)
         if (.not. allocated(error)) call end_at_bound(self, point, bound)
         self%waiting = point
      else
         call plan(self, system, ahead)
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
         call shorten_until_taken(self, system, turning, 0.5_wp, ahead, done, error)
         if (allocated(error) .or. done) return
         call leap(self%corrector, system, self%here, far_ahead, ahead, error)
         if (.not. allocated(error)) call leads_on(self, system, ahead, done, error)
         if (allocated(error) .or. done) return
      end if
      call shorten_until_taken(self, system, shortest, 0.5_wp, ahead, done, error)
      if (allocated(error) .or. done) return
      ! A predictor from before a corner leads away from it: along the tangent, then.
      self%ds = corner
      self%history%known = .false.
      call shorten_until_taken(self, system, bifurcation, 0.7_wp, ahead, done, error)
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

   !> Attempts from the present step on, each shorter than the one before.
   subroutine shorten_until_taken(self, system, least, factor, ahead, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      !> Shortest step, and what a failure makes of one.
      real(wp), intent(in) :: least, factor
      type(branch_point), intent(out) :: ahead
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: shortening

      self%n_failed = 0
      do
         ahead = self%here
         self%corrector%careful = self%ds < turning .or. .not. self%history%known
         call extrapolate(self%corrector%metric, self%history, self%here, self%ds, ahead)
         call attempt(self, system, ahead, shortening, error)
         done = shortening >= 1.0_wp
         if (allocated(error) .or. done) return
         self%n_rejected = self%n_rejected + 1
         self%n_failed = self%n_failed + 1
         if (self%ds < turning .and. self%corrector%oriented) then
            call turn_at_corner(self%corrector, system, self%here, self%ds, ahead, error)
            done = ahead%report%converged
            if (allocated(error) .or. done) return
         end if
         if (self%ds < least) exit
         ! An attempt that has only failed says nothing of the length that would do; a measured
         ! error does.
         self%ds = self%ds*merge(factor, shortening, abs(shortening - halved) <= 0.0_wp)
      end do
   end subroutine shorten_until_taken

   !> One step; a shortening below one: it does not count, and this part of it may.
   subroutine attempt(self, system, ahead, shortening, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      !> In: the predictor.
      type(branch_point), intent(inout) :: ahead
      real(wp), intent(out) :: shortening
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: guess(:)
      real(wp) :: guess_p
      logical :: done, far

      shortening = halved
      self%knows_ahead = .false.
      guess = ahead%y
      guess_p = ahead%p
      call self%corrector%correct(system, self%here, max(self%ds, corner), ahead, error)
      if (allocated(error)) return
      if (.not. ahead%report%converged .and. goes_across(self)) then
         call extrapolate(self%corrector%metric, self%history, self%here, self%ds, ahead)
         call self%corrector%correct_across(system, self%here, ahead, error)
         if (allocated(error)) return
      end if
      if (.not. ahead%report%converged) return
      associate (metric => self%corrector%metric)
         far = metric%length(ahead%y - guess, ahead%p - guess_p) > max(max_distance*self%ds, corner)
      end associate
      ! Converged, but on something else than what was predicted.
      if (far) return
      if (self%ds <= corner) then
         call look_at_corner(self, system, ahead, done, error)
         if (done) shortening = 1.0_wp
      else
         if (.not. bends_little(self, ahead)) return
         if (turns_between(self%corrector%metric, self%here, ahead)) return
         if (differ(ahead, self%here)) then
            call goes_through(self%corrector, system, self%here, ahead, done, error)
            if (allocated(error) .or. .not. done) return
         end if
         call measure(self, system, ahead, shortening, error)
      end if
   end subroutine attempt

   !> Whether a step in p alone is worth trying where the corrector has failed more than once: many
   !> pairs make it go round between pieces, and a search along its steps does not.
   pure logical function goes_across(self)
      class(arclength_type), intent(in) :: self

      goes_across = associated(self%corrector%view) .and. self%n_failed >= most_failed .and. &
                    self%ds >= turning .and. &
                    abs(self%here%t_p) > least_share*self%corrector%metric%p_scale
   end function goes_across

   !> Whether the angles between tangents and chord are those of one smooth piece.
   pure logical function bends_little(self, ahead)
      class(arclength_type), intent(in) :: self
      type(branch_point), intent(in) :: ahead
      real(wp) :: chord, cosine(3)

      associate (metric => self%corrector%metric, here => self%here)
         ! Cosines of the angles: tangent to tangent, and either tangent to the chord.
         chord = metric%chord(here, ahead)
         cosine = [metric%inner(here%t_y, here%t_p, ahead%t_y, ahead%t_p), &
                   metric%inner(here%t_y, here%t_p, ahead%y - here%y, ahead%p - here%p)/chord, &
                   metric%inner(ahead%t_y, ahead%t_p, ahead%y - here%y, ahead%p - here%p)/chord]
      end associate
      bends_little = cosine(1) >= cos(max_turn) .and. all(cosine(2:) >= cos(max_chord))
   end function bends_little

   !> At a step that is next to nothing, the tangent of the smaller angle leads back where the
   !> orientation is the other one and the branch turns sharply: it is reversed. Where it does not
   !> turn, the step has gone across to another piece; what is left of that at the shortest steps is
   !> a bifurcation, beyond which a branch has the other orientation.
   subroutine look_at_corner(self, system, ahead, done, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: ahead
      !> Whether the step counts.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      !> Cosine of the angle between tangents below which a branch turns sharply.
      real(wp), parameter :: sharp = 0.8_wp

      done = .false.
      call self%corrector%find_orientation(system, self%here, error)
      if (allocated(error)) return
      call self%corrector%find_orientation(system, ahead, error)
      if (allocated(error)) return
      done = .true.
      if (.not. differ(ahead, self%here)) return
      if (self%corrector%metric%inner(self%here%t_y, self%here%t_p, ahead%t_y, ahead%t_p) &
          <= sharp) then
         call reverse(ahead)
      else
         done = self%ds < bifurcation
      end if
   end subroutine look_at_corner

   !> 1 where the cubic of the step is true to the curve, else what part of it would be.
   subroutine measure(self, system, ahead, shortening, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      real(wp), intent(out) :: shortening
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: smooth, corner_error, place, found

      shortening = 1.0_wp
      call missed(self%corrector%metric, self%history, self%here, ahead, smooth, corner_error, &
                  place)
      ! The error of a cubic grows like ds^4: its fourth root gives the step.
      if (smooth > allowed_error) then
         shortening = max(least_growth, min(0.8_wp, (aim*allowed_error/smooth)**0.25_wp))
      else if (self%here%t_p*ahead%t_p > 0.0_wp) then
         if (self%near%misses(ahead%p - self%here%p) > passed*allowed_error) shortening = 0.7_wp
      end if
      if (shortening < 1.0_wp) return
      ! While the system stands there.
      call self%near_ahead%find(self%corrector, system, ahead, x_scale_at(self, ahead))
      self%knows_ahead = .true.
      if (corner_error <= allowed_error) return
      ! The estimate of a corner may be a false alarm: one correction there tells. One that lies
      ! where neither a smooth curve nor a single corner has it stands for several of them.
      if (place < around(1) .or. place > around(2)) then
         call look_between(self, system, ahead, amidst, found, error)
         if (found > looked_at*allowed_error) shortening = amidst
         if (allocated(error) .or. shortening < 1.0_wp .or. place < least_place) return
      end if
      place = max(least_place, min(1.0_wp - least_place, place))
      call look_between(self, system, ahead, place, found, error)
      if (found > looked_at*allowed_error) shortening = place
   end subroutine measure

   !> What the cubic of a step misses at a place of it: a correction there at a constant p.
   subroutine look_between(self, system, ahead, place, found, error)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      !> Share of the step.
      real(wp), intent(in) :: place
      real(wp), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: between
      real(wp), allocatable :: change(:)
      logical :: done

      found = 0.0_wp
      call interpolate(self%corrector%metric, self%here, ahead, place, between)
      call self%corrector%try(system, between, change, done, error)
      if (allocated(error) .or. .not. done) return
      found = misses_of(self%corrector%metric, self%here, ahead, between, change)
   end subroutine look_between

   !> Sizes are those of a point.
   pure subroutine scale_metric(self, point)
      class(arclength_type), intent(inout) :: self
      type(branch_point), intent(in) :: point

      associate (metric => self%corrector%metric)
         metric%y_scale = y_scale_at(self, point)
         if (metric%n_seen == 0) return
         ! From point to point scales fall by `fading` at most: a response near zero keeps one.
         metric%x_scale = max(norm2(point%x)/weight_x, fading*metric%x_scale, self%x_scale/weight_x)
      end associate
   end subroutine scale_metric

   !> The scale of y at the next point.
   pure real(wp) function y_scale_at(self, ahead) result(scale)
      class(arclength_type), intent(in) :: self
      type(branch_point), intent(in) :: ahead

      associate (metric => self%corrector%metric)
         scale = max(fading*metric%y_scale, self%x_scale)
         if (metric%n_seen == 0) then
            scale = max(norm2(ahead%y), scale)
         else
            scale = max(norm2(ahead%y(:metric%n_seen)), scale)
         end if
      end associate
   end function y_scale_at

   !> The scale of x at the next point: that of y where the branch is measured by x itself.
   pure real(wp) function x_scale_at(self, ahead) result(scale)
      class(arclength_type), intent(in) :: self
      type(branch_point), intent(in) :: ahead

      scale = y_scale_at(self, ahead)
      if (associated(self%corrector%view)) scale = self%corrector%x_scale(ahead%x)
   end function x_scale_at

   !> Go on to a point, and choose the step from there.
   subroutine plan(self, system, ahead)
      class(arclength_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      real(wp) :: error, unused(2), growth, turn

      associate (metric => self%corrector%metric)
         growth = largest_growth
         call missed(metric, self%history, self%here, ahead, error, unused(1), unused(2))
         ! The least of three: by the error of the cubic, by the turn of the tangent, and by the
         ! work that the corrector had.
         if (error > 0.0_wp) growth = min(growth, (aim*allowed_error/error)**0.25_wp)
         turn = acos(max(-1.0_wp, min(1.0_wp, metric%inner(self%here%t_y, self%here%t_p, &
                                                           ahead%t_y, ahead%t_p))))
         if (turn > 0.0_wp) growth = min(growth, max(least_growth, aimed_turn/turn))
         if (ahead%report%iterations >= slow) growth = min(growth, slower)
         self%history%known = .true.
         self%history%before = self%here
         self%here = ahead
         ! Resonances are alike at every size: a step keeps its length when the scale changes.
         self%ds = metric%chord(self%history%before, self%here)
         call scale_metric(self, ahead)
         call metric%normalize(self%here)
         call self%way%add(self%here)
         self%ds = max(growth*self%ds, min(corner, largest_growth*self%ds))
      end associate
      if (self%knows_ahead) then
         self%near = self%near_ahead
      else
         call self%near%find(self%corrector, system, self%here, x_scale_at(self, self%here))
      end if
      call limit_step(self)
   end subroutine plan

   !> No step beyond what p and x may change, nor over a resonance.
   subroutine limit_step(self)
      class(arclength_type), intent(inout) :: self
      real(wp) :: change, reach

      associate (metric => self%corrector%metric, here => self%here)
         change = abs(here%t_p)/metric%p_scale
         ! In shares of the scales of p and of y.
         if (change*self%ds > self%longest) self%ds = self%longest/change
         change = metric%size(here%t_y)
         if (change*self%ds > longest_y) self%ds = longest_y/change
         if (self%near%n == 0 .and. allocated(self%pole)) then
            ! By the distance to the nearest pole, and by its width: a resonance there takes
            ! several steps.
            reach = beside_pole*minval(hypot(here%p - self%pole, self%pole_width))
            if (self%ds*abs(here%t_p) > reach) self%ds = reach/abs(here%t_p)
         end if
         self%ds = self%near%bound(self%ds, here%t_p/metric%p_scale, metric%p_scale)
      end associate
   end subroutine limit_step

end module fw_continuation
