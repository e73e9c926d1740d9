!> The predicted forces of one pair with two tangential directions as trigonometric polynomials: P
!> (2) and N = -y_n with two derivatives, R = mu N, at the points of the cells and at any angle.
!>
!> Where side 2 slides, P is taken in a frame that goes along, P - drift tau: anchors stand there
!> while the pair sticks, whatever carries them.
module fw_event_motion
   use fw_event_cells, only: cells_type
   use fw_event_stages, only: cosine_and_sine, n_points
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: motion_type, instant_type, stretch_type
   public :: on_cone, point_of

   !> Violation of the cone that is round-off, relative to the square of the size of P; and of R,
   !> relative to that size.
   real(wp), parameter :: on_cone = 1.0e-14_wp

   !> P, N, R and their derivatives at an angle.
   type :: instant_type
      real(wp) :: angle = 0.0_wp, p(2) = 0.0_wp, dp(2) = 0.0_wp, ddp(2) = 0.0_wp
      real(wp) :: normal = 0.0_wp, dnormal = 0.0_wp, ddnormal = 0.0_wp
      real(wp) :: radius = 0.0_wp, dradius = 0.0_wp, ddradius = 0.0_wp
   end type instant_type

   !> The same at the points of a stretch from one angle to another (point, direction).
   type :: stretch_type
      !> The cell that it covers; 0 where it does not cover one.
      integer :: cell = 0
      real(wp) :: from = 0.0_wp, to = 0.0_wp
      real(wp), dimension(n_points, 2) :: p = 0.0_wp, dp = 0.0_wp, ddp = 0.0_wp
      real(wp), dimension(n_points) :: normal = 0.0_wp
      real(wp), dimension(n_points) :: radius = 0.0_wp, dradius = 0.0_wp, ddradius = 0.0_wp
   end type stretch_type

   type :: motion_type
      integer :: degree = 0
      real(wp) :: mu = 0.0_wp
      !> False: velocity-level law, T = P projected onto the disc of radius R.
      logical :: remembers = .true.
      !> What the frame moves in an angle of 1 [force].
      real(wp) :: drift(2) = 0.0_wp
      !> P of the frame at rest (0:degree, cosine and sine, direction) and N (0:degree, cosine
      !> and sine).
      real(wp), allocatable :: tangential(:, :, :), normal(:, :)
      !> Sum of the amplitudes of P, and of those of R; and N is constant.
      real(wp) :: scale = 0.0_wp, largest_radius = 0.0_wp
      logical :: steady = .false.
      !> N and N' at the instants (n_time).
      real(wp), allocatable :: values(:), slopes(:)
      !> P_x, P_y, P_x', P_y', P_x'', P_y'', N, N', N'' at the points of the cells
      !> (n_points, n_cells, 9).
      real(wp), allocatable :: point(:, :, :)
      !> P_x, P_y, N of a harmonic (3 and room for one, cosine and sine, 0:degree).
      real(wp), allocatable, private :: packed(:, :, :)
      !> Coefficients of what `point` holds (n_coefficients, 9).
      real(wp), allocatable, private :: series(:, :)
   contains
      procedure :: reserve
      procedure :: fill
      procedure :: can_rest
      procedure :: is_carried
      procedure :: look
      procedure :: stretch
   end type motion_type

contains

   !> Room for the inputs of one pair on the cells, used again by the next.
   pure subroutine reserve(self, cells)
      class(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells

      self%degree = cells%degree
      allocate (self%tangential(0:self%degree, 2, 2), self%normal(0:self%degree, 2), source=0.0_wp)
      allocate (self%packed(4, 2, 0:self%degree), source=0.0_wp)
      allocate (self%point(n_points, cells%n_cells, 9), source=0.0_wp)
      allocate (self%values(cells%n_time), self%slopes(cells%n_time), source=0.0_wp)
      allocate (self%series(cells%n_coefficients, 9), source=0.0_wp)
   end subroutine reserve

   !> State the predicted forces.
   subroutine fill(self, cells, prediction, offset, mean)
      class(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      !> Coefficients (3, n_coefficients), and what y_n has in the mean beside.
      real(wp), intent(in) :: prediction(:, :), offset
      !> What P has in the mean beside, where harmonic 0 is retained.
      real(wp), intent(in), optional :: mean(2)
      integer :: c, h, j, k, n, nc

      nc = cells%n_coefficients
      do c = 1, 3
         do k = 1, nc
            ! N = -y_n: pressures are positive.
            self%series(k, merge(7, c, c == 3)) = merge(-1.0_wp, 1.0_wp, c == 3)*prediction(c, k)
         end do
      end do
      if (present(mean)) self%series(1, 1:2) = self%series(1, 1:2) + mean
      do h = 1, cells%n_retained
         n = cells%harmonic(h)
         k = cells%column(h)
         ! Harmonic 0 has a cosine only.
         do j = 0, merge(0, 1, n == 0)
            self%tangential(n, j + 1, :) = prediction(1:2, k + j)
            self%normal(n, j + 1) = -prediction(3, k + j)
         end do
         if (n == 0) cycle
         ! Columns 1, 2 -> 3, 4 -> 5, 6 are P, P', P''; 7 -> 8 is N -> N'; 9 = N'' comes below.
         do c = 1, 7
            if (c == 5 .or. c == 6) cycle
            associate (to => self%series(:, merge(8, c + 2, c == 7)))
               to(k) = n*self%series(k + 1, c)
               to(k + 1) = -n*self%series(k, c)
            end associate
         end do
         self%series(k:k + 1, 9) = -real(n, wp)**2*self%series(k:k + 1, 7)
      end do
      if (present(mean)) self%tangential(0, 1, :) = self%tangential(0, 1, :) + mean
      ! Parity carries no constant; the offset is all that there is then.
      if (cells%harmonic(1) > 0) self%normal(0, 1) = 0.0_wp
      self%normal(0, 1) = self%normal(0, 1) - offset
      self%scale = sum(abs(self%tangential)) + 2.0_wp*pi*sum(abs(self%drift))
      self%largest_radius = self%mu*sum(abs(self%normal))
      self%steady = .not. any(abs(self%normal(1:, :)) > 0.0_wp)
      do n = 0, self%degree
         do j = 1, 2
            ! Packed so that one pass over the harmonics yields all three at an angle.
            self%packed(1:3, j, n) = [self%tangential(n, j, :), self%normal(n, j)]
         end do
      end do
      n = n_points*cells%n_cells
      call dgemm('N', 'N', n, 9, nc, 1.0_wp, cells%wave, n, self%series, nc, 0.0_wp, self%point, n)
      self%point(:, :, 7) = self%point(:, :, 7) - offset
      if (self%is_carried()) call enter_frame(self, cells)
      call fill_instants(self, cells, offset)
   end subroutine fill

   !> Whether side 2 takes the anchors along.
   pure logical function is_carried(self)
      class(motion_type), intent(in) :: self

      is_carried = any(abs(self%drift) > 0.0_wp)
   end function is_carried

   !> The points of the cells in the frame that goes along.
   pure subroutine enter_frame(self, cells)
      type(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      integer :: c, k

      do c = 1, 2
         do k = 1, cells%n_cells
            associate (from => cells%start_of(k), to => cells%start_of(k + 1))
               self%point(:, k, c) = self%point(:, k, c) - &
                                     self%drift(c)*(from + (to - from)*cells%rule%place)
            end associate
         end do
         self%point(:, :, c + 2) = self%point(:, :, c + 2) - self%drift(c)
      end do
   end subroutine enter_frame

   !> N and N' at the instants.
   pure subroutine fill_instants(self, cells, offset)
      class(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: offset
      real(wp) :: value, slope
      integer :: i, k

      do k = 1, cells%n_time
         value = 0.0_wp
         slope = 0.0_wp
         !$omp simd reduction(+:value, slope)
         do i = 1, cells%n_coefficients
            value = value + cells%instant(i, k)*self%series(i, 7)
            slope = slope + cells%instant(i, k)*self%series(i, 8)
         end do
         self%values(k) = value - offset
         self%slopes(k) = slope
      end do
   end subroutine fill_instants

   !> Whether a position may exist that bears all instants without slip: in each of four directions
   !> the discs at the points of the cells share a value.
   pure logical function can_rest(self)
      class(motion_type), intent(in) :: self
      real(wp), parameter :: half = sqrt(0.5_wp)
      real(wp), parameter :: along(2, 4) = reshape([1.0_wp, 0.0_wp, half, half, 0.0_wp, 1.0_wp, &
                                                    -half, half], [2, 4])
      real(wp) :: lower, upper, p, radius
      integer :: d, i, k

      can_rest = .false.
      if (any(self%point(:, :, 7) <= 0.0_wp)) return
      do d = 1, size(along, 2)
         lower = -huge(1.0_wp)
         upper = huge(1.0_wp)
         do k = 1, size(self%point, 2)
            do i = 1, n_points
               p = along(1, d)*self%point(i, k, 1) + along(2, d)*self%point(i, k, 2)
               radius = self%mu*self%point(i, k, 7)
               lower = max(lower, p - radius)
               upper = min(upper, p + radius)
            end do
         end do
         if (lower > upper) return
      end do
      can_rest = .true.
   end function can_rest

   !> N and R = mu N with two derivatives each.
   pure subroutine set_normal(self, normal, at)
      type(motion_type), intent(in) :: self
      real(wp), intent(in) :: normal(3)
      type(instant_type), intent(inout) :: at

      at%normal = normal(1)
      at%dnormal = normal(2)
      at%ddnormal = normal(3)
      at%radius = self%mu*normal(1)
      at%dradius = self%mu*normal(2)
      at%ddradius = self%mu*normal(3)
   end subroutine set_normal

   !> Any angle.
   pure type(instant_type) function look(self, angle) result(at)
      class(motion_type), intent(in) :: self
      real(wp), intent(in) :: angle
      real(wp) :: value(4), slope(4), curvature(4), wave(4), conjugate(4)
      real(wp) :: c, s, c_1, s_1, c_next, w
      integer :: m

      at%angle = angle
      c_1 = cos(angle)
      s_1 = sin(angle)
      c = c_1
      s = s_1
      value = self%packed(:, 1, 0)
      slope = 0.0_wp
      curvature = 0.0_wp
      do m = 1, self%degree
         w = real(m, wp)
         ! wave is the term of harmonic m, w times its conjugate the slope of it.
         wave = self%packed(:, 1, m)*c + self%packed(:, 2, m)*s
         conjugate = self%packed(:, 2, m)*c - self%packed(:, 1, m)*s
         value = value + wave
         slope = slope + w*conjugate
         curvature = curvature - w**2*wave
         c_next = c*c_1 - s*s_1
         s = s*c_1 + c*s_1
         c = c_next
      end do
      at%p = value(1:2)
      at%dp = slope(1:2)
      if (self%is_carried()) then
         at%p = at%p - self%drift*angle
         at%dp = at%dp - self%drift
      end if
      at%ddp = curvature(1:2)
      call set_normal(self, [value(3), slope(3), curvature(3)], at)
   end function look

   !> The points of a stretch: a cell's, or those between any two angles.
   pure subroutine stretch(self, cells, cell, from, to, out)
      class(motion_type), intent(in) :: self
      type(cells_type), intent(in) :: cells
      !> Cell (0: none).
      integer, intent(in) :: cell
      real(wp), intent(in) :: from, to
      type(stretch_type), intent(out) :: out
      real(wp), dimension(n_points) :: c, s, c_1, s_1, wave, conjugate
      real(wp) :: w
      integer :: i, j, m

      out%cell = cell
      out%from = from
      out%to = to
      if (cell > 0) then
         do j = 1, 2
            out%p(:, j) = self%point(:, cell, j)
            out%dp(:, j) = self%point(:, cell, j + 2)
            out%ddp(:, j) = self%point(:, cell, j + 4)
         end do
         out%normal = max(self%point(:, cell, 7), 0.0_wp)
         out%radius = self%mu*out%normal
         out%dradius = self%mu*self%point(:, cell, 8)
         out%ddradius = self%mu*self%point(:, cell, 9)
         return
      end if
      call cosine_and_sine(from + (to - from)*cells%rule%place, c_1, s_1)
      c = c_1
      s = s_1
      do j = 1, 2
         out%p(:, j) = self%packed(j, 1, 0)
      end do
      out%normal = self%packed(3, 1, 0)
      ! All points of a stretch at once: one harmonic after the other, points innermost.
      do m = 1, self%degree
         w = real(m, wp)
         do j = 1, 3
            do i = 1, n_points
               wave(i) = self%packed(j, 1, m)*c(i) + self%packed(j, 2, m)*s(i)
               conjugate(i) = w*(self%packed(j, 2, m)*c(i) - self%packed(j, 1, m)*s(i))
            end do
            if (j < 3) then
               out%p(:, j) = out%p(:, j) + wave
               out%dp(:, j) = out%dp(:, j) + conjugate
               out%ddp(:, j) = out%ddp(:, j) - w**2*wave
            else
               out%normal = out%normal + wave
               out%dradius = out%dradius + self%mu*conjugate
               out%ddradius = out%ddradius - (self%mu*w**2)*wave
            end if
         end do
         wave = c*c_1 - s*s_1
         s = s*c_1 + c*s_1
         c = wave
      end do
      if (self%is_carried()) then
         do j = 1, 2
            out%p(:, j) = out%p(:, j) - self%drift(j)*(from + (to - from)*cells%rule%place)
            out%dp(:, j) = out%dp(:, j) - self%drift(j)
         end do
      end if
      ! Where contact begins or ends, N is round-off of either sign.
      out%normal = max(out%normal, 0.0_wp)
      out%radius = self%mu*out%normal
   end subroutine stretch

   !> A point of a stretch (N' and N'' are left out).
   pure type(instant_type) function point_of(cells, stretch, i) result(at)
      type(cells_type), intent(in) :: cells
      type(stretch_type), intent(in) :: stretch
      integer, intent(in) :: i

      at%angle = stretch%from + (stretch%to - stretch%from)*cells%rule%place(i)
      if (i == n_points) at%angle = stretch%to
      at%p = stretch%p(i, :)
      at%dp = stretch%dp(i, :)
      at%ddp = stretch%ddp(i, :)
      at%radius = stretch%radius(i)
      at%dradius = stretch%dradius(i)
      at%ddradius = stretch%ddradius(i)
      at%normal = stretch%normal(i)
   end function point_of

end module fw_event_motion
