!> The path of one displacement through the period: its turning points, and the pieces between
!> which a law of hysteresis is smooth.
!>
!> A turning point is an anchor: the force beyond it is a function of the displacement from there
!> on. Its force follows from an older anchor, so that with w(tau) the base functions
!>
!>   F(tau) = F(y(tau); y_a, F_a),    dF = slope (w - w_a) dy + carry dF_a.
!>
!> Displacements are in units of force.
module fw_displacement_path
   use fw_event_polynomial, only: differentiate, value_and_slope
   use fw_event_roots, only: find_roots, root_between
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: anchor_type, displacement_path, piece_type

   !> A turning point.
   type :: anchor_type
      real(wp) :: angle = 0.0_wp, y = 0.0_wp, force = 0.0_wp
      !> The anchor that its force follows from, 0: none; slope and carry there.
      integer :: parent = 0
      real(wp) :: slope = 0.0_wp, carry = 0.0_wp
   end type anchor_type

   type :: piece_type
      real(wp) :: start = 0.0_wp, end = 0.0_wp
      !> The anchor that its force follows from; 0: the position of the assembly, y = F = 0.
      integer :: anchor = 0
      !> Sign of the velocity.
      real(wp) :: direction = 1.0_wp
      !> Which rule integrates it.
      integer :: level = 0
   end type piece_type

   type :: displacement_path
      !> Highest harmonic, y and dy/dtau (0:degree, cosine and sine), and the sum of the amplitudes
      !> of y.
      integer :: degree = 0
      real(wp), allocatable :: y(:, :), rate(:, :)
      real(wp) :: size = 0.0_wp
      !> Largest force that the law bears.
      real(wp) :: limit = 0.0_wp
      !> Turning points, ascending from the one that is farthest from y = 0, and y there: that one
      !> once more at the end (n_turns + 1). None where the displacement rests.
      integer :: n_turns = 0
      real(wp), allocatable :: turn(:), y_turn(:)
      integer :: n_anchors = 0, n_pieces = 0
      type(anchor_type), allocatable :: anchor(:)
      type(piece_type), allocatable :: piece(:)
      !> Whether the force at the first anchor is the one that repeats: that at the end of the
      !> period, which follows from an anchor as others do.
      logical :: repeats = .false.
      type(anchor_type) :: last
      !> 1 - d(force at the end)/d(force at the start).
      real(wp) :: contraction = 1.0_wp
      !> Change of the force over the period.
      real(wp) :: drift = 0.0_wp
      !> Room for who follows it: open branches, ways between turning points.
      integer, allocatable :: stack(:)
      real(wp), allocatable :: way(:)
      !> Room for who integrates it: waves at the points of a block (0:degree, block), and three
      !> sets of integrals (0:degree, cosine and sine, 3), of a degree of their own.
      real(wp), allocatable :: cosines(:, :), sines(:, :), sums(:, :, :)
      real(wp), allocatable, private :: grid(:, :), roots(:)
   contains
      procedure :: reserve
      procedure :: reserve_waves
      procedure :: take
      procedure :: begin
      procedure :: add_anchor
      procedure :: add_piece
      procedure :: at
      procedure :: angle_of
      procedure :: piece_at
   end type displacement_path

contains

   !> Room for a degree.
   pure subroutine reserve(self, degree)
      class(displacement_path), intent(inout) :: self
      integer, intent(in) :: degree
      integer :: n_roots

      self%degree = degree
      n_roots = 2*degree + 2
      allocate (self%y(0:degree, 2), self%rate(0:degree, 2), source=0.0_wp)
      allocate (self%grid(max(16, 4*degree + 4), 2), self%roots(n_roots), source=0.0_wp)
      allocate (self%turn(n_roots + 1), self%y_turn(n_roots + 1), source=0.0_wp)
      ! A turning point closes one loop at most; every branch and every crossing may have a break.
      allocate (self%anchor(n_roots + 1), self%piece(6*n_roots + 6))
      allocate (self%stack(n_roots + 1), source=0)
      allocate (self%way(n_roots), source=0.0_wp)
   end subroutine reserve

   !> Room for integrals with the waves 0..degree, points of a block at a time; what there is serves
   !> where it is large enough.
   pure subroutine reserve_waves(self, degree, block)
      class(displacement_path), intent(inout) :: self
      integer, intent(in) :: degree, block
      integer :: n

      n = max(degree, self%degree)
      if (allocated(self%cosines)) then
         if (ubound(self%cosines, 1) >= n) return
         deallocate (self%cosines, self%sines, self%sums)
      end if
      allocate (self%cosines(0:n, block), self%sines(0:n, block), self%sums(0:n, 2, 3), &
                source=0.0_wp)
   end subroutine reserve_waves

   !> Turning points of the displacement y.
   pure subroutine take(self, limit)
      class(displacement_path), intent(inout) :: self
      real(wp), intent(in) :: limit
      real(wp) :: slope
      integer :: first, k, n, n_grid

      self%limit = limit
      self%size = sum(abs(self%y))
      call differentiate(self%degree, self%y, self%rate)
      n_grid = size(self%grid, 1)
      do k = 1, n_grid
         call value_and_slope(self%degree, self%rate, 2.0_wp*pi*real(k - 1, wp)/real(n_grid, wp), &
                              self%grid(k, 1), self%grid(k, 2))
      end do
      n = 0
      call find_roots(n_grid, self%degree, self%rate, self%grid(:, 1), self%grid(:, 2), &
                      sum(abs(self%rate)), n, self%roots)
      ! A sign that changes once changes back.
      if (n < 2) n = 0
      self%n_turns = n
      if (n == 0) return
      ! In their order until the farthest is known.
      first = 1
      do k = 1, n
         call value_and_slope(self%degree, self%y, self%roots(k), self%way(k), slope)
         if (abs(self%way(k)) > abs(self%way(first))) first = k
      end do
      do k = 1, n + 1
         associate (from => modulo(first + k - 2, n) + 1)
            self%turn(k) = self%roots(from)
            if (first + k - 1 > n) self%turn(k) = self%turn(k) + 2.0_wp*pi
            self%y_turn(k) = self%way(from)
         end associate
      end do
   end subroutine take

   !> Before a law follows the path.
   pure subroutine begin(self)
      class(displacement_path), intent(inout) :: self

      self%n_anchors = 0
      self%n_pieces = 0
      self%repeats = .false.
      self%contraction = 1.0_wp
      self%drift = 0.0_wp
   end subroutine begin

   pure subroutine add_anchor(self, anchor)
      class(displacement_path), intent(inout) :: self
      type(anchor_type), intent(in) :: anchor

      self%n_anchors = self%n_anchors + 1
      self%anchor(self%n_anchors) = anchor
   end subroutine add_anchor

   !> Pieces of no length are left out.
   pure subroutine add_piece(self, start, end, anchor, direction)
      class(displacement_path), intent(inout) :: self
      real(wp), intent(in) :: start, end
      integer, intent(in) :: anchor
      real(wp), intent(in) :: direction

      if (.not. end > start) return
      self%n_pieces = self%n_pieces + 1
      self%piece(self%n_pieces) = piece_type(start, end, anchor, direction)
   end subroutine add_piece

   !> y at an angle.
   pure real(wp) function at(self, angle) result(y)
      class(displacement_path), intent(in) :: self
      real(wp), intent(in) :: angle
      real(wp) :: slope

      call value_and_slope(self%degree, self%y, angle, y, slope)
   end function at

   !> Where y passes a level on its way from a turning point k to the next, not before an angle.
   pure real(wp) function angle_of(self, level, k, start) result(angle)
      class(displacement_path), intent(in) :: self
      real(wp), intent(in) :: level
      integer, intent(in) :: k
      real(wp), intent(in) :: start
      real(wp) :: left, right

      left = self%at(start) - level
      right = self%y_turn(k + 1) - level
      angle = self%turn(k + 1)
      if (right*(self%y_turn(k + 1) - self%y_turn(k)) <= 0.0_wp) return
      angle = start
      ! Of round-off: it is passed already.
      if (left*right >= 0.0_wp) return
      angle = root_between(self%degree, self%y, level, start, self%turn(k + 1), left, right, &
                           epsilon(1.0_wp)*self%size)
   end function angle_of

   !> The piece that an angle from 0 on lies in, and the angle there.
   pure subroutine piece_at(self, angle, piece, own)
      class(displacement_path), intent(in) :: self
      real(wp), intent(in) :: angle
      integer, intent(out) :: piece
      real(wp), intent(out) :: own

      own = angle
      if (own < self%turn(1)) own = own + 2.0_wp*pi
      do piece = 1, self%n_pieces - 1
         if (own < self%piece(piece)%end) return
      end do
      piece = self%n_pieces
   end subroutine piece_at

end module fw_displacement_path
