!> The predicted forces of one pair with two tangential directions as trigonometric polynomials: P
!> (2) and N = -y_n with two derivatives, R = mu N, on the cells of a grid and at any angle; and the
!> rotations of slip over every half of a cell, each made when it is first asked for.
module fw_event_motion
   use fw_event_cells, only: cells_type
   use fw_event_rotation, only: gauss_point
   use fw_event_rotation, only: new_rotation
   use fw_event_rotation, only: rotation_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: motion_type, instant_type, gauss_type
   public :: on_cone

   !> Violation of the cone that is round-off, relative to the square of the size of P; and of R,
   !> relative to that size.
   real(wp), parameter :: on_cone = 1.0e-14_wp

   !> P, N, R and their derivatives at an angle.
   type :: instant_type
      real(wp) :: angle = 0.0_wp, p(2) = 0.0_wp, dp(2) = 0.0_wp, ddp(2) = 0.0_wp
      real(wp) :: normal = 0.0_wp, dnormal = 0.0_wp, ddnormal = 0.0_wp
      real(wp) :: radius = 0.0_wp, dradius = 0.0_wp, ddradius = 0.0_wp
   end type instant_type

   !> P' and R at the two Gauss points of a step, R kept above round-off where N ends; R' and P''
   !> too where a pair lands.
   !> The floor keeps a = P'/R finite; behind a landing, where a is truly infinite, the arc of
   !> fw_event_rotation takes over and the floor is never felt.
   type :: gauss_type
      real(wp) :: dp(2, 2) = 0.0_wp, radius(2) = 0.0_wp
      real(wp) :: ddp(2, 2) = 0.0_wp, dradius(2) = 0.0_wp
   end type gauss_type

   type :: motion_type
      integer :: degree = 0
      real(wp) :: mu = 0.0_wp
      !> False: velocity-level law, T = P projected onto the disc of radius R.
      logical :: remembers = .true.
      !> P (0:degree, cosine and sine, direction) and N (0:degree, cosine and sine).
      real(wp), allocatable :: tangential(:, :, :), normal(:, :)
      !> Sum of the amplitudes of P, and N is constant.
      real(wp) :: scale = 0.0_wp
      logical :: steady = .false.
      !> P_x, P_y, P_x', P_y', P_x'', P_y'', N, N', N'' at the nodes of the cells (9, 2 n_cells).
      real(wp), allocatable :: node(:, :)
      !> P_x', P_y', N at the Gauss points (3, point, 2 n_cells).
      real(wp), allocatable, private :: gauss(:, :, :)
      !> P_x, P_y, N of a harmonic (3 and room for one, cosine and sine, 0:degree).
      real(wp), allocatable, private :: packed(:, :, :)
      !> Coefficients of what `node` holds (n_coefficients, 9), and of P_x', P_y', N.
      real(wp), allocatable, private :: series(:, :), gauss_series(:, :)
      !> Exponentials of the halves of the cells (2 n_cells), and which of them are made since
      !> `fill`.
      type(rotation_type), allocatable, private :: rotation(:)
      logical, allocatable, private :: known(:)
   contains
      procedure :: reserve
      procedure :: fill
      procedure :: can_rest
      procedure :: at_node
      procedure :: look
      procedure :: half_cell
      procedure :: look_gauss
      procedure :: rotation_of
   end type motion_type

contains

   !> Room for the inputs of one pair on the cells, used again by the next.
   pure subroutine reserve(self, cells)
      class(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      integer :: n

      self%degree = cells%degree
      n = 2*cells%n_cells
      allocate (self%tangential(0:self%degree, 2, 2), self%normal(0:self%degree, 2), source=0.0_wp)
      allocate (self%packed(4, 2, 0:self%degree), source=0.0_wp)
      allocate (self%node(9, n), self%gauss(3, 2, n), source=0.0_wp)
      allocate (self%series(cells%n_coefficients, 9), source=0.0_wp)
      allocate (self%gauss_series(cells%n_coefficients, 3), source=0.0_wp)
      allocate (self%rotation(n), self%known(n))
   end subroutine reserve

   !> State the predicted forces.
   !> Costs two products for all nodes; the rotations follow on demand, because pairs that stick
   !> need none.
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
      self%gauss_series(:, 1:2) = self%series(:, 3:4)
      self%gauss_series(:, 3) = self%series(:, 7)
      self%scale = sum(abs(self%tangential))
      self%steady = .not. any(abs(self%normal(1:, :)) > 0.0_wp)
      do n = 0, self%degree
         do j = 1, 2
            ! Packed so that one pass over the harmonics yields all three at an angle.
            self%packed(1:3, j, n) = [self%tangential(n, j, :), self%normal(n, j)]
         end do
      end do
      n = size(self%known)
      call dgemm('T', 'N', 9, n, nc, 1.0_wp, self%series, nc, cells%node, nc, 0.0_wp, self%node, 9)
      call dgemm('T', 'N', 3, 2*n, nc, 1.0_wp, self%gauss_series, nc, cells%gauss, nc, 0.0_wp, &
                 self%gauss, 3)
      self%node(7, :) = self%node(7, :) - offset
      self%gauss(3, :, :) = self%gauss(3, :, :) - offset
      self%known = .false.
   end subroutine fill

   !> Whether a position may exist that bears all instants without slip: in each of four directions
   !> the discs at the nodes share a value.
   pure logical function can_rest(self)
      class(motion_type), intent(in) :: self
      real(wp), parameter :: half = sqrt(0.5_wp)
      real(wp), parameter :: along(2, 4) = reshape([1.0_wp, 0.0_wp, half, half, 0.0_wp, 1.0_wp, &
                                                    -half, half], [2, 4])
      real(wp) :: lower, upper, p, radius
      integer :: d, k

      can_rest = .false.
      if (any(self%node(7, :) <= 0.0_wp)) return
      do d = 1, size(along, 2)
         lower = -huge(1.0_wp)
         upper = huge(1.0_wp)
         do k = 1, size(self%node, 2)
            p = along(1, d)*self%node(1, k) + along(2, d)*self%node(2, k)
            radius = self%mu*self%node(7, k)
            lower = max(lower, p - radius)
            upper = min(upper, p + radius)
         end do
         if (lower > upper) return
      end do
      can_rest = .true.
   end function can_rest

   !> A node of the cells; the one behind the last is the first, at 2 pi.
   pure type(instant_type) function at_node(self, cells, node) result(at)
      class(motion_type), intent(in) :: self
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: node
      integer :: j

      ! Values of the first node, but the angle 2 pi: pieces of the path keep their order by angle.
      j = merge(1, node, node > size(self%known))
      at%angle = cells%node_angle(node)
      at%p = self%node(1:2, j)
      at%dp = self%node(3:4, j)
      at%ddp = self%node(5:6, j)
      call set_normal(self, self%node(7:9, j), at)
   end function at_node

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
   !> Costs a sine, a cosine and three recurrences of `degree` steps: nodes are far cheaper.
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
      at%ddp = curvature(1:2)
      call set_normal(self, [value(3), slope(3), curvature(3)], at)
   end function look

   !> The Gauss points of half a cell.
   pure type(gauss_type) function half_cell(self, half) result(gauss)
      class(motion_type), intent(in) :: self
      integer, intent(in) :: half

      gauss%dp = self%gauss(1:2, :, half)
      ! Where contact ends N may be round-off of either sign: the floor keeps the direction finite
      ! where the force vanishes anyway.
      gauss%radius = max(self%mu*self%gauss(3, :, half), on_cone*self%scale, tiny(1.0_wp))
   end function half_cell

   !> Those of any step.
   !> Of a step from the angle `from` over h, off the grid; with R' and P'', for a landing.
   pure type(gauss_type) function look_gauss(self, from, h) result(gauss)
      class(motion_type), intent(in) :: self
      real(wp), intent(in) :: from, h
      type(instant_type) :: at
      integer :: i

      do i = 1, 2
         at = self%look(from + gauss_point(i)*h)
         gauss%dp(:, i) = at%dp
         gauss%ddp(:, i) = at%ddp
         gauss%dradius(i) = at%dradius
         gauss%radius(i) = max(at%radius, on_cone*self%scale, tiny(1.0_wp))
      end do
   end function look_gauss

   !> The rotation of slip over half a cell.
   pure subroutine rotation_of(self, cells, half, rotation)
      class(motion_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      !> Half of a cell, 1..2 n_cells.
      integer, intent(in) :: half
      type(rotation_type), intent(out) :: rotation
      type(gauss_type) :: gauss

      if (.not. self%known(half)) then
         gauss = self%half_cell(half)
         self%rotation(half) = new_rotation(cells%half, gauss%dp(:, 1)/gauss%radius(1), &
                                            gauss%dp(:, 2)/gauss%radius(2))
         self%known(half) = .true.
      end if
      rotation = self%rotation(half)
   end subroutine rotation_of

end module fw_event_motion
