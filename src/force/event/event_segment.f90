!> The motion of a pair between two instants as the quintic through P, N and their two derivatives
!> at both: the first guess of where stick ends between two points of a stretch.
module fw_event_segment
   use fw_event_motion, only: instant_type, motion_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: segment_type, new_segment

   type :: segment_type
      !> Angle of its start; friction coefficient.
      real(wp), private :: from = 0.0_wp, mu = 0.0_wp
      !> P_x, P_y, N in powers of the angle behind `from`.
      real(wp), private :: c(3, 0:5) = 0.0_wp
   contains
      procedure :: at
   end type segment_type

contains

   !> From two instants with second derivatives; a width of 0 gives the parabola of the first.
   pure type(segment_type) function new_segment(motion, from, to) result(self)
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: from, to
      real(wp) :: w, d0(3), d1(3), d2(3)

      w = to%angle - from%angle
      self%from = from%angle
      self%mu = motion%mu
      self%c(:, 0) = [from%p, from%normal]
      self%c(:, 1) = [from%dp, from%dnormal]
      self%c(:, 2) = 0.5_wp*[from%ddp, from%ddnormal]
      if (w <= 0.0_wp) return
      ! Coefficients of the quintic Hermite interpolation, of value, slope and curvature at both
      ! ends.
      ! What value, slope and half the curvature at the end lack.
      d0 = ([to%p, to%normal] - self%c(:, 0) - w*(self%c(:, 1) + w*self%c(:, 2)))/w**3
      d1 = ([to%dp, to%dnormal] - self%c(:, 1) - 2.0_wp*w*self%c(:, 2))/w**2
      d2 = (0.5_wp*[to%ddp, to%ddnormal] - self%c(:, 2))/w
      self%c(:, 3) = 10.0_wp*d0 - 4.0_wp*d1 + d2
      self%c(:, 4) = (-15.0_wp*d0 + 7.0_wp*d1 - 2.0_wp*d2)/w
      self%c(:, 5) = (6.0_wp*d0 - 3.0_wp*d1 + d2)/w**2
   end function new_segment

   !> An instant on it.
   pure type(instant_type) function at(self, angle)
      class(segment_type), intent(in) :: self
      real(wp), intent(in) :: angle
      real(wp) :: s, value(3), slope(3), curvature(3)

      s = angle - self%from
      associate (c => self%c)
         value = c(:, 0) + s*(c(:, 1) + s*(c(:, 2) + s*(c(:, 3) + s*(c(:, 4) + s*c(:, 5)))))
         slope = c(:, 1) + s*(2.0_wp*c(:, 2) + s*(3.0_wp*c(:, 3) + s*(4.0_wp*c(:, 4) + &
                                                                     s*5.0_wp*c(:, 5))))
         curvature = 2.0_wp*c(:, 2) + s*(6.0_wp*c(:, 3) + s*(12.0_wp*c(:, 4) + &
                                                             s*20.0_wp*c(:, 5)))
      end associate
      at%angle = angle
      at%p = value(1:2)
      at%dp = slope(1:2)
      at%ddp = curvature(1:2)
      at%normal = value(3)
      at%dnormal = slope(3)
      at%ddnormal = curvature(3)
      at%radius = self%mu*value(3)
      at%dradius = self%mu*slope(3)
      at%ddradius = self%mu*curvature(3)
   end function at

end module fw_event_segment
