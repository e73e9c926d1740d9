!> The lowest and the highest value of a response over the residual tractions of its pairs, shares
!> from -1 to 1: descents with projection from several shares, each solved from the one before.
!>
!> Every share that is solved is kept: ends are often corners, which several descents come to.
!>
!> The response over the shares may fold: behind a fold there is none near by, and a step that is
!> too long jumps to another branch. Where one of the steps shows that, the search begins anew with
!> ways in steps so short that none jumps. What it finds then are shares that a straight way from
!> the centre leads to, so that anyone can go there.
module fw_share_search
   use fw_box_steps, only: box_steps, gain_left
   use fw_error, only: error_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: share_point, share_search, share_solver
   public :: jumps

   !> A response at some shares.
   type :: share_point
      !> Shares, and derivatives of the value by them (n_pairs).
      real(wp), allocatable :: t(:)
      real(wp), allocatable :: slope(:)
      !> Unknowns of the balance.
      real(wp), allocatable :: x(:)
      real(wp) :: value = 0.0_wp
      !> Whether a descent to the lowest and one to the highest value has gone on from here.
      logical :: is_left(2) = .false.
      !> Whether the straight way from the centre leads here, and whether it leads elsewhere.
      logical :: is_straight = .false., is_lost = .false.
      !> Number of the straight way that it lies on; 0 of what a descent found.
      integer :: way = 0
   end type share_point

   !> Who solves responses.
   type, abstract :: share_solver
      !> Ways are to be followed in steps without a jump.
      logical :: is_careful = .false.
   contains
      procedure(solve_shares), deferred :: solve
   end type share_solver

   abstract interface
      !> On the way to shares from the response at others; the last one is that at the shares where
      !> it is done.
      subroutine solve_shares(self, from, shares, way, done, error)
         import :: share_solver, share_point, error_type, wp
         implicit none (type, external)
         class(share_solver), intent(inout) :: self
         type(share_point), intent(in) :: from
         real(wp), intent(in) :: shares(:)
         type(share_point), allocatable, intent(out) :: way(:)
         logical, intent(out) :: done
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_shares
   end interface

   !> A search at one frequency.
   type :: share_search
      !> Places in `known` of the lowest and the highest value.
      integer :: at(2) = 1
      !> Responses that are known, the centre first, and shares that could not be solved for.
      integer :: n_known = 0, n_failed = 0
      type(share_point), allocatable :: known(:)
      !> Responses after which no further one is solved.
      integer, private :: most = huge(1)
      !> Whether some step has shown that the response folds.
      logical :: folds = .false.
      !> Number of the straight way that is gone.
      integer, private :: way = 0
   contains
      procedure :: find
      procedure, private :: find_by_steps
      procedure, private :: find_by_ways
      procedure, private :: settle_end
      procedure, private :: keep
      procedure, private :: begin_at
      procedure, private :: go_to
      procedure, private :: descend
      procedure, private :: search_along
   end type share_search

   !> Part of the value that the slope may still promise at an end: what is left there is of second
   !> order in it.
   real(wp), parameter :: enough = 1.0e-7_wp
   !> Shares that are one and the same, and slopes that are round-off of the value.
   real(wp), parameter :: same = 1.0e-12_wp, round_off = 1.0e-10_wp
   integer, parameter :: most_steps = 15, most_trials = 8
   !> Starts that each search has, and responses for each pair that four starts may take, with
   !> enough for the line searches of few pairs.
   integer, parameter :: usual_starts = 4, most_for_pair = 15, fewest = 30
   !> Pairs up to which all corners are looked at, and responses for each of them beside.
   integer, parameter :: few_pairs = 6, beside_corners = 10
   !> Shares drawn for each pair, and descents to each end, where the response folds.
   integer, parameter :: ways_for_pair = 20, most_descents = 6
   !> Part of the value that two ways to the same shares may differ by.
   real(wp), parameter :: one_value = 1.0e-7_wp

contains

   !> Both ends, from a centre that is solved.
   subroutine find(self, solver, centre, n_starts, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      type(share_point), intent(in) :: centre
      !> The centre, both ends of its slope, and shares that are drawn.
      integer, intent(in) :: n_starts
      type(error_type), allocatable, intent(out) :: error

      solver%is_careful = .false.
      call self%find_by_steps(solver, centre, n_starts, error)
      if (allocated(error) .or. .not. self%folds) return
      solver%is_careful = .true.
      call self%find_by_ways(solver, centre, n_starts, error)
   end subroutine find

   !> Where nothing folds any step may be taken.
   subroutine find_by_steps(self, solver, centre, n_starts, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      type(share_point), intent(in) :: centre
      integer, intent(in) :: n_starts
      type(error_type), allocatable, intent(out) :: error
      integer :: side, start, from(2), state

      allocate (self%known(8))
      self%known(1) = centre
      call drop_round_off(self%known(1))
      self%n_known = 1
      associate (n => size(centre%t))
         self%most = max(fewest, most_for_pair*n)
         if (n <= few_pairs) self%most = max(self%most, 2**n + beside_corners*n)
      end associate
      self%most = self%most*n_starts/usual_starts
      ! The same draws at each frequency: no row depends on those before.
      state = 1
      do start = 1, n_starts
         call self%begin_at(solver, start, state, from, error)
         if (allocated(error) .or. self%folds) return
         do side = 1, 2
            if (from(side) == 0) cycle
            call self%descend(solver, side, from(side), error)
            if (allocated(error) .or. self%folds) return
         end do
      end do
      associate (values => self%known(:self%n_known)%value)
         self%at = [minloc(values, dim=1), maxloc(values, dim=1)]
      end associate
   end subroutine find_by_steps

   !> Straight ways from the centre to shares that are drawn and to corners, then descents from the
   !> best responses on them.
   subroutine find_by_ways(self, solver, centre, n_starts, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      type(share_point), intent(in) :: centre
      integer, intent(in) :: n_starts
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: shares(:, :)
      logical, allocatable :: is_used(:)
      integer :: at, k, side, state

      self%known(1) = centre
      call drop_round_off(self%known(1))
      self%known(1)%is_straight = .true.
      self%known(1)%way = 1
      self%n_known = 1
      self%n_failed = 0
      self%most = huge(1)
      state = 1
      call draw_shares(size(centre%t), ways_for_pair*n_starts/usual_starts*size(centre%t), state, &
                       shares)
      do k = 1, size(shares, 2)
         self%way = k + 1
         call self%go_to(solver, 1, shares(:, k), at, error)
         if (allocated(error)) return
      end do
      self%way = 0
      do side = 1, 2
         is_used = spread(.false., 1, size(shares, 2) + 1)
         ! From different ways: neighbours on one lead to one end.
         do k = 1, min(most_descents, size(is_used))
            at = best_of(self, side, is_used)
            ! Folds may leave fewer ways with a response.
            if (at == 0) exit
            is_used(self%known(at)%way) = .true.
            call self%descend(solver, side, at, error)
            if (allocated(error)) return
         end do
      end do
      do side = 1, 2
         call self%settle_end(solver, side, error)
         if (allocated(error)) return
      end do
   end subroutine find_by_ways

   !> Shares inside, and corners: all of few pairs (n_pairs, number of them).
   pure subroutine draw_shares(n, n_inside, state, shares)
      integer, intent(in) :: n, n_inside
      !> Of the numbers that are drawn.
      integer, intent(inout) :: state
      real(wp), allocatable, intent(out) :: shares(:, :)
      integer :: i, k, n_corners

      ! All corners of few pairs: tractions that oppose each other leave most of the middle behind.
      n_corners = merge(2**min(n, few_pairs), 4*n, n <= few_pairs)
      allocate (shares(n, n_inside + n_corners))
      do k = 1, n_inside + n_corners
         do i = 1, n
            state = next_number(state)
            shares(i, k) = 2.0_wp*real(state, wp)/real(huge(1), wp) - 1.0_wp
            if (k <= n_inside) cycle
            shares(i, k) = sign(1.0_wp, shares(i, k))
            if (n <= few_pairs) shares(i, k) = merge(1.0_wp, -1.0_wp, btest(k - n_inside, i - 1))
         end do
      end do
   end subroutine draw_shares

   !> The place of the lowest (side 1) or the highest value that the centre may lead to; on ways
   !> that are not used, or anywhere.
   pure integer function best_of(self, side, is_used) result(at)
      class(share_search), intent(in) :: self
      integer, intent(in) :: side
      logical, intent(in), optional :: is_used(:)
      logical :: counts(self%n_known)
      integer :: k

      do k = 1, self%n_known
         counts(k) = .not. self%known(k)%is_lost
         if (.not. present(is_used)) cycle
         counts(k) = self%known(k)%way > 0
         if (counts(k)) counts(k) = .not. is_used(self%known(k)%way)
      end do
      associate (values => self%known(:self%n_known)%value)
         at = merge(minloc(values, dim=1, mask=counts), maxloc(values, dim=1, mask=counts), &
                    side == 1)
      end associate
   end function best_of

   !> The best response that the straight way from the centre leads to: descents may have gone round
   !> a fold.
   subroutine settle_end(self, solver, side, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: side
      type(error_type), allocatable, intent(out) :: error
      type(share_point), allocatable :: way(:)
      logical :: done

      do
         self%at(side) = best_of(self, side)
         associate (best => self%known(self%at(side)))
            if (best%is_straight) return
            call solver%solve(self%known(1), best%t, way, done, error)
            if (allocated(error)) return
            if (done) done = abs(way(size(way))%value - best%value) <= one_value*abs(best%value)
            best%is_straight = done
            best%is_lost = .not. done
         end associate
      end do
   end subroutine settle_end

   !> Slopes by shares that do nothing.
   pure subroutine drop_round_off(point)
      type(share_point), intent(inout) :: point

      where (abs(point%slope) <= round_off*abs(point%value)) point%slope = 0.0_wp
   end subroutine drop_round_off

   !> Places where the descents to the lowest and to the highest value of a start begin; 0 where
   !> there is none. Of what is drawn, inside and at corners, they are the lowest and the highest:
   !> where all pairs stick, the vibration depends on no share, and many draws say nothing.
   subroutine begin_at(self, solver, number, state, from, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: number
      !> Of the numbers that are drawn.
      integer, intent(inout) :: state
      integer, intent(out) :: from(2)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: shares(:, :), t(:)
      integer :: at, k

      from = 1
      if (number == 1) return
      if (number <= 3) then
         associate (slope => self%known(1)%slope)
            t = merge(0.0_wp, sign(1.0_wp, slope), abs(slope) <= 0.0_wp)
            if (all(abs(slope) <= 0.0_wp)) t = 1.0_wp
         end associate
         if (number == 3) t = -t
         call self%go_to(solver, 1, t, at, error)
         from = at
         return
      end if
      from = 0
      associate (n => size(self%known(1)%t))
         call draw_shares(n, n + 2, state, shares)
      end associate
      do k = 1, size(shares, 2)
         call self%go_to(solver, 1, shares(:, k), at, error)
         if (allocated(error) .or. self%folds) return
         if (at == 0) cycle
         if (all(abs(self%known(at)%slope) <= 0.0_wp)) cycle
         if (from(1) == 0) from = at
         if (self%known(at)%value < self%known(from(1))%value) from(1) = at
         if (self%known(at)%value > self%known(from(2))%value) from(2) = at
      end do
   end subroutine begin_at

   !> Park and Miller's generator by Schrage's method, which needs no wider integers.
   pure integer function next_number(state) result(next)
      integer, intent(in) :: state
      !> Quotient and rest of huge(1) by the factor.
      integer, parameter :: factor = 16807, whole = 127773, rest = 2836

      next = factor*modulo(state, whole) - rest*(state/whole)
      if (next <= 0) next = next + huge(1)
   end function next_number

   !> The response at shares: known already, or solved from that at place `from`; 0 where there is
   !> none.
   subroutine go_to(self, solver, from, shares, at, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: from
      real(wp), intent(in) :: shares(:)
      integer, intent(out) :: at
      type(error_type), allocatable, intent(out) :: error
      type(share_point), allocatable :: way(:)
      logical :: done
      integer :: k

      do at = 1, self%n_known
         if (maxval(abs(self%known(at)%t - shares)) <= same) return
      end do
      at = 0
      if (self%n_known + self%n_failed >= self%most) return
      call solver%solve(self%known(from), shares, way, done, error)
      if (allocated(error)) return
      do k = 1, size(way)
         call self%keep(way(k), from, done .and. k == size(way), at)
      end do
      if (done) return
      at = 0
      self%folds = .true.
      if (from == 1) self%n_failed = self%n_failed + 1
   end subroutine go_to

   !> Note a response: that at the shares wanted, or one on the way which is lower or higher than
   !> all before.
   subroutine keep(self, point, from, is_wanted, at)
      class(share_search), intent(inout) :: self
      type(share_point), intent(inout) :: point
      integer, intent(in) :: from
      logical, intent(in) :: is_wanted
      !> Its place.
      integer, intent(inout) :: at
      type(share_point), allocatable :: longer(:)

      associate (values => self%known(:self%n_known)%value)
         if (.not. is_wanted .and. point%value >= minval(values) .and. &
             point%value <= maxval(values)) return
      end associate
      if (self%n_known == size(self%known)) then
         allocate (longer(2*self%n_known))
         longer(:self%n_known) = self%known
         call move_alloc(longer, self%known)
      end if
      call drop_round_off(point)
      point%is_straight = from == 1
      point%way = self%way
      self%n_known = self%n_known + 1
      at = self%n_known
      self%known(at) = point
   end subroutine keep

   !> Whether the value of two responses differs by more than their slopes can say: a step to
   !> another branch, or one that is too long to tell.
   pure logical function jumps(from, to)
      type(share_point), intent(in) :: from, to
      real(wp) :: mean, most

      associate (way => to%t - from%t)
         mean = 0.5_wp*dot_product(from%slope + to%slope, way)
         ! A kink between both says half as much at most.
         most = abs(dot_product(from%slope, way)) + abs(dot_product(to%slope, way))
      end associate
      jumps = abs(to%value - from%value - mean) > most + enough*abs(from%value)
   end function jumps

   !> Down to the lowest value (side 1) or up to the highest (2) that shares near by lead to. The
   !> value has kinks, where a pair begins to slip or the instant of an end changes: there the least
   !> slope between those of both sides says whether it is an end.
   subroutine descend(self, solver, side, start, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: side, start
      type(error_type), allocatable, intent(out) :: error
      type(box_steps) :: steps
      real(wp), allocatable :: beyond(:), g(:), step(:)
      real(wp) :: turn
      logical :: at_kink
      integer :: at, k, next

      turn = merge(1.0_wp, -1.0_wp, side == 1)
      at = start
      at_kink = .false.
      do k = 1, most_steps
         associate (p => self%known(at))
            if (p%is_left(side) .and. .not. at_kink) return
            p%is_left(side) = .true.
            g = turn*p%slope
            if (at_kink) then
               g = least_between(g, beyond)
               call steps%forget()
            end if
            if (gain_left(p%t, g) <= enough*abs(p%value)) return
            step = max(-1.0_wp, min(1.0_wp, p%t + steps%direction(p%t, g))) - p%t
            if (dot_product(g, step) >= 0.0_wp) return
         end associate
         call self%search_along(solver, turn, at, step, next, beyond, error)
         if (allocated(error)) return
         associate (p => self%known(at), q => self%known(next))
            if (next == at .and. (at_kink .or. .not. allocated(beyond))) return
            if (.not. (at_kink .or. allocated(beyond))) call steps%learn(q%t - p%t, &
                                                                  turn*(q%slope - p%slope))
            ! What is gained no more is not looked for.
            if (next /= at .and. abs(q%value - p%value) <= 0.1_wp*enough*abs(p%value)) return
         end associate
         at_kink = allocated(beyond)
         at = next
      end do
   end subroutine descend

   !> The shortest slope between two: 0 where they point at each other.
   pure function least_between(a, b) result(g)
      real(wp), intent(in) :: a(:), b(:)
      real(wp) :: g(size(a))
      real(wp) :: length, part

      length = dot_product(a - b, a - b)
      part = 1.0_wp
      if (length > 0.0_wp) part = max(0.0_wp, min(1.0_wp, dot_product(b, b - a)/length))
      g = part*a + (1.0_wp - part)*b
   end function least_between

   !> The best response along a step. Where the whole step goes past it, the two best ones around
   !> it are brought together where their tangents meet, which is exact at a kink: `beyond` has the
   !> slope on its other side then.
   subroutine search_along(self, solver, turn, at, step, best, beyond, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      real(wp), intent(in) :: turn, step(:)
      integer, intent(in) :: at
      integer, intent(out) :: best
      real(wp), allocatable, intent(out) :: beyond(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: shorter = 0.25_wp, inexact = 0.1_wp, off_ends = 0.05_wp
      real(wp) :: length(2), slope(2), change, descent, gap, now, part, value, width
      integer :: k, other, trial

      best = at
      other = 0
      length = 0.0_wp
      now = 1.0_wp
      do k = 1, most_trials
         call self%go_to(solver, at, self%known(at)%t + now*step, trial, error)
         if (allocated(error)) return
         if (trial == 0) then
            now = length(1) + shorter*(now - length(1))
            cycle
         end if
         value = turn*(self%known(trial)%value - self%known(best)%value)
         if (value < 0.0_wp) then
            descent = turn*dot_product(self%known(trial)%slope, step)
            if (other == 0 .and. descent <= 0.0_wp) then
               best = trial
               return
            end if
            ! What is behind it is between this one and the other, or between this one and the best
            ! one until now.
            if (other == 0 .or. descent*(length(2) - now) >= 0.0_wp) then
               other = best
               length(2) = length(1)
            end if
            best = trial
            length(1) = now
         else
            other = trial
            length(2) = now
         end if
         associate (p => self%known(best), q => self%known(other))
            ! Slopes and the change of value from the best one to the other.
            width = length(2) - length(1)
            slope = turn*width*[dot_product(p%slope, step), dot_product(q%slope, step)]
            change = turn*(q%value - p%value)
            if (slope(1) >= 0.0_wp) return
            part = 0.3_wp
            if (slope(2) > change .and. slope(1) < change) then
               part = (change - slope(2))/(slope(1) - slope(2))
               gap = -part*slope(1)
               if (gap <= enough*abs(p%value)) then
                  beyond = turn*q%slope
                  return
               end if
               if (gap <= inexact*turn*(self%known(at)%value - p%value)) return
            end if
            now = length(1) + max(off_ends, min(1.0_wp - off_ends, part))*width
         end associate
      end do
   end subroutine search_along

end module fw_share_search
