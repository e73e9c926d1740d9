!> The periodic limit of the march of one pair with two tangential directions.
!>
!> Every instant of a turn projects the corrected position x onto the disc of radius mu p about the
!> predicted force y_t; a turn x -> T(x) is a composition of such projections, and never takes two
!> positions further apart. There are two kinds of limits:
!>
!> * The discs share no point: the pair slips in every period. A projection keeps the distance of
!>   two positions only if it moves neither, so that T has one fixed point, whatever the start.
!> * The discs share points: the pair shakes down to one of them, and the start decides to which.
!>
!> Either way the last approach is a smooth map with the 2 x 2 derivative M, and may be slow: plain
!> turns gain the factor of the largest eigenvalue of M, 1 - s where the slip of a turn is s
!> times the radius. Newton's method on T(x) = x gains digits instead. It is never allowed to step
!> among positions that no disc moves: there plain turns have the last word, which end on the
!> edge.
!>
!> Source of the view as projections: Bauschke, Borwein (1996), On projection algorithms for solving
!> convex feasibility problems.
module fw_settling
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: period_map, settle, invert
   public :: shakedown_turns, periodic_tolerance

   !> A turn of one pair.
   type, abstract :: period_map
   contains
      procedure(turn_interface), deferred :: turn
   end type period_map

   abstract interface
      !> From a position x, to that a period after, with its derivative m by x.
      subroutine turn_interface(self, x, after, m)
         import :: period_map, wp
         implicit none (type, external)
         class(period_map), intent(inout) :: self
         real(wp), intent(in) :: x(2)
         real(wp), intent(out) :: after(2), m(2, 2)
      end subroutine turn_interface
   end interface

   !> Turns that count in the derivative of a pair that shook down after more than a few.
   integer, parameter :: shakedown_turns = 60
   !> A march is periodic when x repeats to this part of the largest predicted force of the pair:
   !> far below the tolerance of any balance, well above round-off.
   real(wp), parameter :: periodic_tolerance = 1.0e-12_wp

   !> Turns with their derivatives before a pair is given up.
   integer, parameter :: max_turns = 100
   !> Halvings of a Newton step. A step must make the movement in a turn smaller, by at least this
   !> part of what the derivative promises.
   integer, parameter :: max_halvings = 5
   real(wp), parameter :: progress = 0.1_wp
   !> Determinant of I - M, between 0 and 1, that round-off leaves of a singular one.
   real(wp), parameter :: singular = 1.0e-12_wp
   !> Movement that is round-off of the forces.
   real(wp), parameter :: round_off = 4.0_wp*epsilon(1.0_wp)

contains

   !> From a position to the limit of the turns that follow.
   subroutine settle(map, scale, tolerance, x, done)
      class(period_map), intent(inout) :: map
      !> Size of the tangential forces of the pair.
      real(wp), intent(in) :: scale
      !> On the distance from the limit, over the scale.
      real(wp), intent(in) :: tolerance
      !> Corrected position [force].
      real(wp), intent(inout) :: x(2)
      logical, intent(out) :: done
      real(wp) :: after(2), m(2, 2), step(2), trial(2), trial_after(2), trial_m(2, 2)
      real(wp) :: movement
      integer :: turn, k
      logical :: better

      call map%turn(x, after, m)
      turn = 1
      do
         call newton_step(m, after - x, step)
         done = maxval(abs(after - x)) <= round_off*scale .or. maxval(abs(step)) <= tolerance*scale
         ! At rest to round-off, or as near to the limit as the next step tells.
         if (done) x = after
         if (done .or. turn >= max_turns) return
         better = .false.
         do k = 0, max_halvings
            trial = x + 0.5_wp**k*step
            call map%turn(trial, trial_after, trial_m)
            turn = turn + 1
            movement = norm2(trial_after - trial)
            better = movement > 0.0_wp .and. &
                     movement <= (1.0_wp - progress*0.5_wp**k)*norm2(after - x)
            if (better) exit
         end do
         if (better) then
            x = trial
            after = trial_after
            m = trial_m
         else
            x = after
            ! A plain turn, which never leads away from the limit, where no length of the step is
            ! better.
            call map%turn(x, after, m)
            turn = turn + 1
         end if
      end do
   end subroutine settle

   !> Solve (I - M) step = move; the movement itself where I - M is singular.
   pure subroutine newton_step(m, move, step)
      real(wp), intent(in) :: m(2, 2), move(2)
      real(wp), intent(out) :: step(2)
      real(wp) :: inverse(2, 2)
      logical :: regular

      call invert(m, inverse, regular)
      step = move
      if (.not. regular) return
      step(1) = inverse(1, 1)*move(1) + inverse(1, 2)*move(2)
      step(2) = inverse(2, 1)*move(1) + inverse(2, 2)*move(2)
   end subroutine newton_step

   !> (I - M)^-1.
   pure subroutine invert(m, inverse, regular)
      real(wp), intent(in) :: m(2, 2)
      real(wp), intent(out) :: inverse(2, 2)
      logical, intent(out) :: regular
      real(wp) :: determinant

      determinant = (1.0_wp - m(1, 1))*(1.0_wp - m(2, 2)) - m(1, 2)*m(2, 1)
      regular = determinant > singular
      inverse = 0.0_wp
      if (.not. regular) return
      inverse(1, 1) = (1.0_wp - m(2, 2))/determinant
      inverse(1, 2) = m(1, 2)/determinant
      inverse(2, 1) = m(2, 1)/determinant
      inverse(2, 2) = (1.0_wp - m(1, 1))/determinant
   end subroutine invert

end module fw_settling
