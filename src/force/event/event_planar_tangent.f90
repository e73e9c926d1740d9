!> Derivatives of the position z of a pair with two tangential directions and of its direction of
!> slip phi, carried along its path: at an onset of slip the tangent projection
!> dphi = n.(dP - dz)/|P - z|, at a stop dz = dP - dT, and a landing moves with the root of N.
!>
!> Over a step of slip at fixed angles, with q = P'.t and the matrix of its collocation,
!>
!>   (diag(R) + h diag(q) a) dk = n.dP' - k dR - q dphi_0,   dphi_j = dphi_0 + h sum_i a_ji dk_i.
!>
!> Behind a landing R = 0 at the start, where the equation alone says
!> dphi_0 = (n.dP' - phi' dR)/|P'|, at a fixed angle too: that the landing moves changes nothing
!> else, since the smooth solution goes on beyond it.
!>
!> Inputs are the coefficients of P_x, P_y and y_n = -N, and then the two components of z at the
!> start of the turn.
module fw_event_planar_tangent
   use fw_event_cells, only: cells_type, waves_at, waves_of_step
   use fw_event_motion, only: instant_type, motion_type, stretch_type
   use fw_event_planar_path, only: piece_type
   use fw_event_slide, only: landing_slope
   use fw_event_stages, only: cosine_and_sine, direction_of, n_points, n_stages, eliminate
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
      !> Those at the points of the step that was advanced over last (n_points, n_coefficients), and
      !> the derivatives of phi at them (input, point).
      real(wp), allocatable :: waves(:, :), slopes(:, :), dphi_at(:, :)
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
      allocate (self%waves(n_points, nc), self%slopes(n_points, nc))
      allocate (self%dphi_at(3*nc + 2, n_points))
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
   pure subroutine stop_slip(self, motion, cells, at, phi)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: phi
      real(wp) :: t(2)
      integer :: c

      self%dz = 0.0_wp
      if (.not. motion%remembers) return
      call self%set_waves(cells, at%angle)
      t = direction_of(phi)
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

   !> A step of slip: dphi at all its points, and at its end.
   pure subroutine advance(self, motion, cells, piece, stretch)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      !> That of the piece.
      type(stretch_type), intent(in) :: stretch
      integer :: j

      ! Those of whole cells are known, the same for all pairs.
      if (piece%cell > 0) then
         self%waves = cells%wave(:, piece%cell, :)
         self%slopes = cells%slope(:, piece%cell, :)
      else
         call waves_of_step(cells, piece%from, piece%to - piece%from, self%waves, self%slopes)
      end if
      if (motion%mu <= 0.0_wp) return
      if (.not. motion%remembers) then
         do j = 1, n_points
            call point_along(self, stretch, j)
         end do
      else
         if (piece%lands) call land_in_slip(self, motion, piece, stretch)
         if (piece%to > piece%from) then
            call collocate(self, motion, cells, piece, stretch)
         else
            self%dphi_at = spread(self%dphi, 2, n_points)
         end if
      end if
      self%dphi = self%dphi_at(:, n_points)
   end subroutine advance

   !> Velocity level: the force points along P itself, whatever came before.
   pure subroutine point_along(self, stretch, j)
      class(tangent_type), intent(inout) :: self
      type(stretch_type), intent(in) :: stretch
      integer, intent(in) :: j
      real(wp) :: n(2)

      n = [-stretch%p(j, 2), stretch%p(j, 1)]/max(sum(stretch%p(j, :)**2), tiny(1.0_wp))
      self%dphi_at(:, j) = 0.0_wp
      self%dphi_at(:self%nc, j) = n(1)*self%waves(j, :)
      self%dphi_at(self%nc + 1:2*self%nc, j) = n(2)*self%waves(j, :)
   end subroutine point_along

   !> dphi at the start of a step behind a landing.
   pure subroutine land_in_slip(self, motion, piece, stretch)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(piece_type), intent(in) :: piece
      type(stretch_type), intent(in) :: stretch
      real(wp) :: t(2), length
      integer :: nc

      nc = self%nc
      ! R dphi' + dR phi' = n.dP' - |P'| dphi with R = 0.
      t = direction_of(piece%phi(1))
      length = max(norm2(stretch%dp(1, :)), tiny(1.0_wp))
      self%dphi(:nc) = -t(2)/length*self%slopes(1, :)
      self%dphi(nc + 1:2*nc) = t(1)/length*self%slopes(1, :)
      ! dR = -mu dy_n.
      self%dphi(2*nc + 1:3*nc) = landing_slope(stretch)*motion%mu/length*self%waves(1, :)
      self%dphi(3*nc + 1:) = 0.0_wp
   end subroutine land_in_slip

   !> The linear collocation of a step, for all inputs at once.
   pure subroutine collocate(self, motion, cells, piece, stretch)
      class(tangent_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      type(stretch_type), intent(in) :: stretch
      real(wp) :: a(n_points, 2*n_stages + 1), along(n_points), across(n_points, 2), h, start
      real(wp) :: factor(3)
      integer :: i, j, k, nc
      logical :: regular

      nc = self%nc
      h = piece%to - piece%from
      call cosine_and_sine(piece%phi, across(:, 2), across(:, 1))
      across(:, 1) = -across(:, 1)
      along = across(:, 2)*stretch%dp(:, 1) - across(:, 1)*stretch%dp(:, 2)
      associate (rule => cells%rule)
         ! Transposed: its solutions are the rows of h a m^-1, of the points and then of the end.
         a = 0.0_wp
         do j = 1, n_stages
            a(2:n_stages + 1, j) = (h*along(j + 1))*rule%integral(j + 1, :)
            a(j + 1, j) = a(j + 1, j) + stretch%radius(j + 1)
         end do
         do j = 1, n_stages + 1
            a(2:n_stages + 1, n_stages + j) = h*rule%integral(j + 1, :)
         end do
      end associate
      call eliminate(a, 2*n_stages + 1, regular)
      ! It is that of the last step of Newton's method, which could be solved.
      if (.not. regular) a = 0.0_wp
      self%dphi_at(:, 1) = self%dphi
      do j = 2, n_points
         ! Inputs enter at the Gauss points alone, by their waves there: no solution for each input.
         associate (by => a(:, n_stages + j - 1), to => self%dphi_at(:, j))
            start = 1.0_wp - dot_product(by(2:n_stages + 1), along(2:n_stages + 1))
            to = start*self%dphi
            do i = 2, n_stages + 1
               factor = by(i)*[across(i, :), motion%mu*piece%slope(i)]
               do k = 1, nc
                  to(k) = to(k) + factor(1)*self%slopes(i, k)
                  to(nc + k) = to(nc + k) + factor(2)*self%slopes(i, k)
                  to(2*nc + k) = to(2*nc + k) + factor(3)*self%waves(i, k)
               end do
            end do
         end associate
      end do
   end subroutine collocate

end module fw_event_planar_tangent
