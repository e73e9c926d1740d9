!> Derivatives of the position z of a pair with two tangential directions and of its direction of
!> slip phi, carried along its path: at an onset of slip the tangent projection
!> dphi = n.(dP - dz)/|P - z|, in a step that of its rotation, at a stop dz = dP - dT, and a landing
!> moves with the root of N.
!>
!> Inputs are the coefficients of P_x, P_y and y_n = -N, and then the two components of z at the
!> start of the turn.
module fw_event_planar_tangent
   use fw_event_cells, only: cells_type
   use fw_event_cells, only: waves_at
   use fw_event_motion, only: gauss_type
   use fw_event_motion, only: instant_type
   use fw_event_motion, only: motion_type
   use fw_event_rotation, only: arc_type
   use fw_event_rotation, only: direction_of
   use fw_event_rotation, only: gauss_point
   use fw_event_rotation, only: new_rotation
   use fw_event_rotation, only: rotate
   use fw_event_rotation, only: rotation_derivative
   use fw_event_rotation, only: rotation_type
   use fw_event_slide, only: landing_arc
   use fw_event_slide, only: slide_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: tangent_type, new_tangent

   type :: tangent_type
      !> Coefficients of a component, and inputs: 3 n_coefficients + 2.
      integer :: nc = 0, n_inputs = 0
      !> Derivatives of z (input, direction) and of phi (input).
      real(wp), allocatable :: dz(:, :), dphi(:)
      !> Waves and their slopes where they were looked at last (n_coefficients).
      real(wp), allocatable :: wave(:), slope(:)
   contains
      procedure :: start
      procedure :: land
      procedure :: begin_slip
      procedure :: stop_slip
      procedure :: advance
      procedure :: set_waves
   end type tangent_type

contains

   !> nc is the number of coefficients of one component.
   pure type(tangent_type) function new_tangent(nc) result(self)
      integer, intent(in) :: nc

      self%nc = nc
      self%n_inputs = 3*nc + 2
      allocate (self%dz(3*nc + 2, 2), self%dphi(3*nc + 2), self%wave(nc), self%slope(nc), &
                source=0.0_wp)
   end function new_tangent

   !> A turn starts: its position is an input.
   pure subroutine start(self)
      !> Derivatives by the coefficients go on from the turn before; the position at the start of
      !> this turn is an input of its own.
      class(tangent_type), intent(inout) :: self

      self%dphi = 0.0_wp
      self%dz(self%n_inputs - 1:, :) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
   end subroutine start

   !> Kept, because two events at one angle ask for the same waves.
   pure subroutine set_waves(self, cells, angle)
      class(tangent_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: angle

      call waves_at(cells, angle, self%wave, self%slope)
   end subroutine set_waves

   !> Contact begins with stick: z = P at a root of N, which moves by -dN/N' with N = -y_n.
   !> A position before the landing is lost, with all that it depended on.
   pure subroutine land(self, cells, at)
      class(tangent_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      type(instant_type), intent(in) :: at
      integer :: c

      call self%set_waves(cells, at%angle)
      self%dz = 0.0_wp
      do c = 1, 2
         self%dz((c - 1)*self%nc + 1:c*self%nc, c) = self%wave
         ! dz_c = P_c' dtheta, dtheta = -dN/N' = wave/N' dy_n.
         self%dz(2*self%nc + 1:3*self%nc, c) = (at%dp(c)/at%dnormal)*self%wave
      end do
   end subroutine land

   !> Slip begins at a position, where the waves have been set.
   pure subroutine begin_slip(self, at, z)
      class(tangent_type), intent(inout) :: self
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z(2)
      real(wp) :: d(2), n(2)

      d = at%p - z
      ! The angle of d changes by n.dd/|d|, n being normal to d; here n is divided by |d| already.
      n = [-d(2), d(1)]/max(dot_product(d, d), tiny(1.0_wp))
      self%dphi = -(n(1)*self%dz(:, 1) + n(2)*self%dz(:, 2))
      self%dphi(:self%nc) = self%dphi(:self%nc) + n(1)*self%wave
      self%dphi(self%nc + 1:2*self%nc) = self%dphi(self%nc + 1:2*self%nc) + n(2)*self%wave
   end subroutine begin_slip

   !> Slip ends in a direction: z = P - T.
   pure subroutine stop_slip(self, motion, cells, at, v)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2)
      real(wp) :: t(2)
      integer :: c

      self%dz = 0.0_wp
      if (.not. motion%remembers) return
      call self%set_waves(cells, at%angle)
      t = direction_of(v)
      ! z = P - R t: dz = dP - t dR - R n dphi, with dR = -mu dy_n.
      self%dz(:, 1) = at%radius*t(2)*self%dphi
      self%dz(:, 2) = -at%radius*t(1)*self%dphi
      do c = 1, 2
         associate (dp => self%dz((c - 1)*self%nc + 1:c*self%nc, c), &
                    dn => self%dz(2*self%nc + 1:3*self%nc, c))
            dp = dp + self%wave
            dn = dn + motion%mu*t(c)*self%wave
         end associate
      end do
   end subroutine stop_slip

   !> Step 1 or 2 of a stretch of slip.
   pure subroutine advance(self, motion, cells, slide, step)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(in) :: slide
      !> 1 up to the middle of the stretch, 2 from there to its end.
      integer, intent(in) :: step
      type(gauss_type) :: gauss
      type(rotation_type) :: rotation
      real(wp) :: h
      integer :: i, half

      if (motion%mu <= 0.0_wp) return
      if (.not. motion%remembers) then
         ! Velocity level: the force points along P itself, whatever came before.
         call self%set_waves(cells, slide%at(step + 1)%angle)
         self%dz = 0.0_wp
         call self%begin_slip(slide%at(step + 1), [0.0_wp, 0.0_wp])
      else if (slide%cell > 0) then
         half = 2*slide%cell + step - 2
         call motion%rotation_of(cells, half, rotation)
         call add_rotation(self, motion, rotation, motion%half_cell(half), slide%v(:, step), &
                           cells%gauss(:, :, half), cells%gauss_slope(:, :, half))
      else
         h = slide%at(step + 1)%angle - slide%at(step)%angle
         if (h <= 0.0_wp) return
         gauss = motion%look_gauss(slide%at(step)%angle, h)
         if (slide%lands .and. step == 1) then
            call add_landing(self, motion, cells, slide, gauss)
            return
         end if
         rotation = new_rotation(h, gauss%dp(:, 1)/gauss%radius(1), gauss%dp(:, 2)/gauss%radius(2))
         block
            ! Off the grid: a step that a switch cuts short, rare enough for waves on the stack.
            real(wp) :: wave(self%nc, 2), slope(self%nc, 2)

            do i = 1, 2
               call waves_at(cells, slide%at(step)%angle + gauss_point(i)*h, wave(:, i), &
                             slope(:, i))
            end do
            call add_rotation(self, motion, rotation, gauss, slide%v(:, step), wave, slope)
         end block
      end if
   end subroutine advance

   !> dphi after a rotation, by a = P'/R at its Gauss points.
   pure subroutine add_rotation(self, motion, rotation, gauss, v, wave, slope)
      type(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(rotation_type), intent(in) :: rotation
      type(gauss_type), intent(in) :: gauss
      real(wp), intent(in) :: v(2)
      !> At the Gauss points (n_coefficients, 2).
      real(wp), intent(in) :: wave(:, :), slope(:, :)
      real(wp) :: after(2), gain, by(2, 2), by_radius(2)
      integer :: i, k

      call rotate(rotation, v, after, gain)
      call rotation_derivative(rotation, gauss%dp(:, 1)/gauss%radius(1), &
                               gauss%dp(:, 2)/gauss%radius(2), v, by(:, 1), by(:, 2))
      do i = 1, 2
         by(:, i) = by(:, i)/gauss%radius(i)
         ! dR = -mu dy_n.
         by_radius(i) = motion%mu*dot_product(by(:, i), gauss%dp(:, i))/gauss%radius(i)
      end do
      associate (nc => self%nc, dphi => self%dphi)
         do k = 1, nc
            ! P' at a Gauss point depends on the coefficients by the slopes of the waves, R by the
            ! waves.
            dphi(k) = gain*dphi(k) + by(1, 1)*slope(k, 1) + by(1, 2)*slope(k, 2)
            dphi(nc + k) = gain*dphi(nc + k) + by(2, 1)*slope(k, 1) + by(2, 2)*slope(k, 2)
            dphi(2*nc + k) = gain*dphi(2*nc + k) + by_radius(1)*wave(k, 1) + &
                             by_radius(2)*wave(k, 2)
         end do
         dphi(3*nc + 1:) = gain*dphi(3*nc + 1:)
      end associate
   end subroutine add_rotation

   !> dphi at the end of the step behind a landing, whose angle moves by dtheta = wave/N' for each
   !> input y_n; so do its Gauss points, by the share of the step that is still ahead of them.
   pure subroutine add_landing(self, motion, cells, slide, gauss)
      type(tangent_type), intent(inout) :: self
      !> The stretch whose first step starts at the landing, and P', R, P'', R' at its Gauss points.
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(slide_type), intent(in) :: slide
      type(gauss_type), intent(in) :: gauss
      type(arc_type) :: arc
      real(wp) :: t(2), n(2), h, s, phi, slope, dtheta(self%nc), first(self%nc, 3)
      real(wp) :: condition(self%nc, 3), change(self%nc, 3, 2)
      integer :: i

      associate (from => slide%at(1), v => slide%v(:, 1))
         h = slide%at(2)%angle - from%angle
         arc = landing_arc(from, gauss, v, h)
         ! phi at the landing is the angle of P'.
         call self%set_waves(cells, from%angle)
         dtheta = self%wave/from%dnormal
         n = [-from%dp(2), from%dp(1)]/dot_product(from%dp, from%dp)
         first(:, 1) = n(1)*self%slope
         first(:, 2) = n(2)*self%slope
         first(:, 3) = dot_product(n, from%ddp)*dtheta
         ! v is the vector of half the angle.
         phi = 2.0_wp*atan2(v(2), v(1))
      end associate
      change = 0.0_wp
      do i = 1, 2
         s = gauss_point(i)*h
         slope = arc%slope + 2.0_wp*arc%curvature*s
         n(1) = phi + s*(arc%slope + s*arc%curvature)
         t = [cos(n(1)), sin(n(1))]
         n = [-t(2), t(1)]
         call self%set_waves(cells, slide%at(1)%angle + s)
         ! The two conditions R phi' = P'.n of the arc, differentiated; `inverse` solves them for
         ! the changes of its slope and curvature.
         condition = dot_product(t, gauss%dp(:, i))*first
         condition(:, 1) = condition(:, 1) - n(1)*self%slope
         condition(:, 2) = condition(:, 2) - n(2)*self%slope
         condition(:, 3) = condition(:, 3) - (slope*motion%mu)*self%wave + dtheta* &
            ((1.0_wp - gauss_point(i))* &
             (gauss%dradius(i)*slope - dot_product(n, gauss%ddp(:, i))) - &
             gauss_point(i)*(2.0_wp*arc%curvature*gauss%radius(i) + &
                             dot_product(t, gauss%dp(:, i))*slope))
         change(:, :, 1) = change(:, :, 1) - arc%inverse(1, i)*condition
         change(:, :, 2) = change(:, :, 2) - arc%inverse(2, i)*condition
      end do
      self%dphi(:3*self%nc) = reshape(first + h*change(:, :, 1) + h**2*change(:, :, 2), &
                                      [3*self%nc])
      ! The step ends at a fixed angle: it gets shorter as the landing comes later.
      self%dphi(2*self%nc + 1:3*self%nc) = self%dphi(2*self%nc + 1:3*self%nc) - &
         (arc%slope + 2.0_wp*arc%curvature*h)*dtheta
      self%dphi(3*self%nc + 1:) = 0.0_wp
   end subroutine add_landing

end module fw_event_planar_tangent
