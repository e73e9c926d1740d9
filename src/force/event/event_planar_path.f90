!> The path of one pair with two tangential directions through a period, as a list of pieces.
!>
!> Between its knots - the ends of the cells and the roots of N - the pair sticks, slips or is open.
!> It starts to slip at a root of |P - z|**2 - R**2, z being the corrected position; slipping, it
!> turns as fw_event_rotation says (fw_event_slide); it stops where its pull falls to zero. Where
!> contact begins, it sticks if R grows faster than P moves.
!>
!> A turn maps the position z at the start of a period to that at its end; its derivative is carried
!> along: slip keeps of dz what is normal to the force, a landing nothing.
!>
!> States on the way are the phase, z (stick), and the half-angle vector v (slip); with them go the
!> derivatives of z and of the angle phi by the position at the start of the turn.
module fw_event_planar_path
   use fw_event_cells, only: cells_type
   use fw_event_exit, only: find_exit
   use fw_event_exit, only: is_pushed
   use fw_event_exit, only: sticks_on
   use fw_event_motion, only: instant_type
   use fw_event_motion, only: motion_type
   use fw_event_roots, only: find_roots
   use fw_event_rotation, only: direction_of
   use fw_event_rotation, only: half_angle
   use fw_event_slide, only: glide
   use fw_event_slide, only: slide_along
   use fw_event_slide, only: slide_type
   use fw_kinds, only: pi
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: planar_path_type, piece_type, slide_of
   public :: phase_open, phase_stick, phase_slip

   integer, parameter :: phase_open = 1, phase_stick = 2, phase_slip = 3
   !> Switches in one cell, and spare pieces in a period, after which the pair sticks on: they crowd
   !> at round-off only.
   integer, parameter :: max_switches = 12, spare_pieces = 64
   !> A stick, or slip within one cell.
   type :: piece_type
      integer :: phase = phase_stick
      !> The phase before it was another one; and that was open.
      logical :: begins = .true., lands = .false.
      !> Angles, from < to.
      real(wp) :: from = 0.0_wp, to = 0.0_wp
      !> Position of a stick, or of that before slip which begins.
      real(wp) :: z(2) = 0.0_wp
      !> Of slip: half-angle vectors at its start, middle and end, and the cell that it covers.
      real(wp) :: v(2, 3) = 0.0_wp
      integer :: cell = 0
   end type piece_type

   type :: planar_path_type
      integer :: n_pieces = 0
      type(piece_type), allocatable :: piece(:)
      !> Angles between which N has one sign, whether the pair is open behind each, and the cell
      !> that starts there (0: it does not end at the next knot, or not start at this one).
      integer :: n_knots = 0
      real(wp), allocatable :: knot(:)
      logical, allocatable :: lifted(:)
      integer, allocatable :: cell(:)
      !> Whether the pair bears throughout, or never.
      logical :: closed = .true., open = .false.
      !> Whether it slipped in the last turn, and whether it landed.
      logical :: slips = .false., lands = .false.
      !> N and N' at the ends of the cells, and the roots of N.
      real(wp), allocatable, private :: values(:), slopes(:), lift(:)
      !> What the pair does on the way, and derivatives of z and phi by the z of the start.
      integer, private :: phase = phase_stick
      real(wp), private :: z(2) = 0.0_wp, v(2) = 0.0_wp, by_z(2, 2) = 0.0_wp, by_phi(2) = 0.0_wp
      logical, private :: behind_landing = .false., begins = .false.
   contains
      procedure :: reserve
      procedure :: find_knots
      procedure :: turn
      procedure :: slip_angle
   end type planar_path_type

contains

   !> Knots: the ends of the cells and at most 2 degree roots of N. Pieces: two for each knot and
   !> spare.
   pure subroutine reserve(self, cells)
      class(planar_path_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      integer :: n

      n = cells%n_cells + 2*cells%degree + 2
      allocate (self%knot(n), self%lifted(n), self%cell(n), self%lift(2*cells%degree + 1))
      allocate (self%piece(2*n + spare_pieces))
      allocate (self%values(cells%n_cells), self%slopes(cells%n_cells))
   end subroutine reserve

   !> The ends of the cells and the roots of N between them.
   pure subroutine find_knots(self, motion, cells)
      class(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer :: j, k, n_lifts
      logical :: lifted

      n_lifts = 0
      ! A constant N, which has no roots; 0 counts as open.
      lifted = motion%normal(0, 1) <= 0.0_wp
      if (.not. motion%steady) then
         self%values = motion%node(7, ::2)
         self%slopes = motion%node(8, ::2)
         call find_roots(cells%n_cells, cells%degree, motion%normal, self%values, self%slopes, &
                         sum(abs(motion%normal)), n_lifts, self%lift)
         lifted = self%values(1) < 0.0_wp
      end if
      self%closed = n_lifts == 0 .and. .not. lifted
      self%open = n_lifts == 0 .and. lifted
      self%n_knots = 0
      j = 1
      do k = 1, cells%n_cells + 1
         do while (j <= n_lifts)
            if (self%lift(j) >= cells%node_angle(2*k - 1)) exit
            lifted = .not. lifted
            call add_knot(self, self%lift(j), lifted, 0)
            ! The cell that the root splits is no whole one any more.
            if (self%n_knots > 1) self%cell(self%n_knots - 1) = 0
            j = j + 1
         end do
         call add_knot(self, cells%node_angle(2*k - 1), lifted, k)
      end do
   end subroutine find_knots

   !> A cell of 0 says that no whole cell starts there.
   pure subroutine add_knot(self, angle, lifted, cell)
      type(planar_path_type), intent(inout) :: self
      real(wp), intent(in) :: angle
      logical, intent(in) :: lifted
      integer, intent(in) :: cell

      self%n_knots = self%n_knots + 1
      self%knot(self%n_knots) = angle
      self%lifted(self%n_knots) = lifted
      self%cell(self%n_knots) = cell
   end subroutine add_knot

   !> The slip of a piece with its instants.
   !> Instants are not kept with the pieces: they are many numbers, and wanted for slip alone.
   pure type(slide_type) function slide_of(piece, motion, cells) result(slide)
      type(piece_type), intent(in) :: piece
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer :: k

      slide%cell = piece%cell
      slide%lands = piece%lands
      slide%v = piece%v
      do k = 1, 3
         if (piece%cell > 0) then
            slide%at(k) = motion%at_node(cells, 2*piece%cell - 2 + k)
         else
            slide%at(k) = motion%look(0.5_wp*((3 - k)*piece%from + (k - 1)*piece%to))
         end if
      end do
   end function slide_of

   !> One period from a position, to another one, with the derivative m of that.
   pure subroutine turn(self, motion, cells, z_start, z_end, m)
      class(planar_path_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: z_start(2)
      real(wp), intent(out) :: z_end(2), m(2, 2)
      type(instant_type) :: at
      integer :: k
      logical :: passes

      self%n_pieces = 0
      self%slips = .false.
      self%lands = .false.
      ! Identity: the position of the start is the input.
      self%by_z = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      self%by_phi = 0.0_wp
      at = motion%at_node(cells, 1)
      call start(self, motion, at, z_start)
      do k = 1, self%n_knots - 1
         ! Open from one knot to the next, since N keeps its sign there.
         if (self%lifted(k)) then
            if (self%phase == phase_stick) self%piece(self%n_pieces)%to = self%knot(k)
            self%phase = phase_open
            cycle
         end if
         ! The cheap way first; most cells hold no switch.
         call pass_cell(self, motion, cells, self%cell(k), passes)
         if (passes) cycle
         at = instant_at(self, motion, cells, k)
         ! Open until here: the knot is a root of N.
         if (self%phase == phase_open) call land(self, motion, at)
         call bear(self, motion, cells, k, at)
      end do
      if (self%phase == phase_stick) self%piece(self%n_pieces)%to = 2.0_wp*pi
      call finish(self, motion, motion%at_node(cells, 1), z_end, m)
   end subroutine turn

   !> How long the pair slipped in the last turn.
   pure real(wp) function slip_angle(self) result(angle)
      class(planar_path_type), intent(in) :: self
      integer :: i

      angle = 0.0_wp
      do i = 1, self%n_pieces
         associate (piece => self%piece(i))
            if (piece%phase == phase_slip) angle = angle + (piece%to - piece%from)
         end associate
      end do
   end function slip_angle

   !> Most cells: no switch in them, and nothing to look for beside what the nodes hold.
   pure subroutine pass_cell(self, motion, cells, cell, passes)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      !> 0 where there is none.
      integer, intent(in) :: cell
      logical, intent(out) :: passes
      real(wp) :: v(2, 3), gain
      integer :: last

      passes = .false.
      if (cell == 0 .or. self%phase == phase_open .or. motion%mu <= 0.0_wp) return
      if (self%phase == phase_stick) then
         last = 2*cell + 1
         if (cell == cells%n_cells) last = 1
         ! Both ends of the cell as columns of `node`: no instant is built.
         passes = sticks_on(motion, self%z, motion%node(:, 2*cell - 1), motion%node(:, last))
      else if (motion%remembers) then
         v(:, 1) = self%v
         call glide(motion, cells, cell, v, gain, passes)
         if (.not. passes) return
         call add_slip(self, cells%node_angle(2*cell - 1), cells%node_angle(2*cell + 1), v, cell)
         self%v = v(:, 3)
         ! The rotation of the cell turns neighbours of phi by `gain` times as much.
         self%by_phi = gain*self%by_phi
      end if
   end subroutine pass_cell

   !> A knot: a node where a cell starts or ends there, else anywhere.
   pure type(instant_type) function instant_at(self, motion, cells, knot) result(at)
      type(planar_path_type), intent(in) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: knot

      if (self%cell(knot) > 0) then
         at = motion%at_node(cells, 2*self%cell(knot) - 1)
      else
         at = motion%look(self%knot(knot))
      end if
   end function instant_at

   !> State at tau = 0 for a given position: one on the cone slips if it is pushed.
   pure subroutine start(self, motion, at, z_start)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: z_start(2)

      self%z = 0.0_wp
      if (motion%remembers) self%z = z_start
      self%phase = phase_open
      if (self%lifted(1)) return
      ! A start outside of the cone is a force too large: it slips from there in its direction.
      if (is_pushed(motion, at, self%z)) then
         call begin_slip(self, at)
      else
         call begin_stick(self, at%angle)
      end if
   end subroutine start

   !> Position at the end of the period, and its derivative.
   pure subroutine finish(self, motion, at, z_end, m)
      type(planar_path_type), intent(in) :: self
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(out) :: z_end(2), m(2, 2)

      m = self%by_z
      z_end = self%z
      if (self%phase == phase_stick) return
      m = 0.0_wp
      ! Open, or without friction: z goes with P.
      z_end = at%p
      if (self%phase == phase_open .or. motion%mu <= 0.0_wp) return
      call position_of_slip(at, self%v, self%by_phi, z_end, m)
   end subroutine finish

   !> z = P - R t, dz = -R n dphi.
   pure subroutine position_of_slip(at, v, by_phi, z, by_z)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: v(2), by_phi(2)
      real(wp), intent(out) :: z(2), by_z(2, 2)
      real(wp) :: t(2)

      t = direction_of(v)
      z = at%p - at%radius*t
      by_z(1, :) = at%radius*t(2)*by_phi
      by_z(2, :) = -at%radius*t(1)*by_phi
   end subroutine position_of_slip

   !> Contact begins, at a root of N.
   pure subroutine land(self, motion, at)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at

      self%lands = .true.
      self%by_z = 0.0_wp
      self%by_phi = 0.0_wp
      self%z = 0.0_wp
      if (.not. motion%remembers) then
         call begin_slip(self, at)
      else if (norm2(at%dp) < at%dradius) then
         ! R grows faster than P moves away from z = P(landing): the cone catches up at once.
         self%z = at%p
         call begin_stick(self, at%angle)
         self%piece(self%n_pieces)%lands = .true.
      else
         self%phase = phase_slip
         ! Slip in the direction in which P leaves; R = 0 here, so only its limit is known.
         self%v = half_angle(at%dp)
         self%begins = .true.
         self%behind_landing = .true.
         self%slips = .true.
      end if
   end subroutine land

   !> The position stays where the force leaves it.
   pure subroutine begin_stick(self, angle)
      type(planar_path_type), intent(inout) :: self
      real(wp), intent(in) :: angle

      self%phase = phase_stick
      self%n_pieces = self%n_pieces + 1
      self%piece(self%n_pieces) = piece_type(phase_stick, z=self%z, from=angle)
   end subroutine begin_stick

   !> The force keeps its place on the cone, and turns with n.(dP - dz)/|P - z|.
   pure subroutine begin_slip(self, at)
      type(planar_path_type), intent(inout) :: self
      type(instant_type), intent(in) :: at
      real(wp) :: d(2)

      d = at%p - self%z
      self%phase = phase_slip
      self%v = half_angle(d)
      self%begins = .true.
      self%behind_landing = .false.
      self%slips = .true.
      self%by_phi = (d(2)*self%by_z(1, :) - d(1)*self%by_z(2, :))/ &
                    max(dot_product(d, d), tiny(1.0_wp))
   end subroutine begin_slip

   !> Contact from one knot to the next.
   pure subroutine bear(self, motion, cells, k, at)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: k
      type(instant_type), intent(inout) :: at
      type(instant_type) :: to
      logical :: found, stops
      integer :: cell, i

      cell = self%cell(k)
      if (cell > 0) then
         to = motion%at_node(cells, 2*cell + 1)
      else
         to = instant_at(self, motion, cells, k + 1)
         ! The last knot is at 2 pi, although its instant is that of 0.
         to%angle = self%knot(k + 1)
      end if
      if (motion%mu <= 0.0_wp) then
         call slide_freely(self, motion, at, to)
         return
      end if
      ! Stick and slip by turns, until the knot is reached.
      do i = 1, max_switches
         if (self%phase == phase_stick) then
            ! Each knot to come may need two.
            if (self%n_pieces + 2*(self%n_knots - k + 2) > size(self%piece)) return
            call find_exit(motion, self%z, to, at, found)
            if (.not. found) return
            ! A switch within the cell: what is left of it is no whole cell.
            cell = 0
            self%piece(self%n_pieces)%to = at%angle
            call begin_slip(self, at)
         end if
         call slip_to(self, motion, cells, cell, to, at, stops)
         if (.not. stops) return
      end do
   end subroutine bear

   !> Slip up to the next knot, or to where it stops.
   pure subroutine slip_to(self, motion, cells, cell, to, at, stops)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: cell
      type(instant_type), intent(in) :: to
      type(instant_type), intent(inout) :: at
      logical, intent(out) :: stops
      type(slide_type) :: slide

      slide%cell = cell
      slide%at(1) = at
      slide%v(:, 1) = self%v
      slide%lands = self%behind_landing
      call slide_along(motion, cells, to, slide)
      call add_slip(self, slide%at(1)%angle, slide%at(3)%angle, slide%v, slide%cell)
      at = slide%at(3)
      stops = slide%stops
      self%v = slide%v(:, 3)
      ! Two steps, one gain each.
      self%by_phi = (slide%gain(1)*slide%gain(2))*self%by_phi
      if (.not. stops) return
      self%z = 0.0_wp
      ! At velocity level there is no position, and T = P where it sticks.
      if (motion%remembers) call position_of_slip(at, self%v, self%by_phi, self%z, self%by_z)
      call begin_stick(self, at%angle)
   end subroutine slip_to

   !> Note slip as a piece.
   pure subroutine add_slip(self, from, to, v, cell)
      type(planar_path_type), intent(inout) :: self
      real(wp), intent(in) :: from, to, v(2, 3)
      integer, intent(in) :: cell

      self%n_pieces = self%n_pieces + 1
      associate (piece => self%piece(self%n_pieces))
         piece%phase = phase_slip
         piece%begins = self%begins
         piece%lands = self%behind_landing
         piece%from = from
         piece%to = to
         piece%z = self%z
         piece%v = v
         piece%cell = cell
      end associate
      self%begins = .false.
      self%behind_landing = .false.
   end subroutine add_slip

   !> Without friction the pair moves at no cost, wherever P goes.
   pure subroutine slide_freely(self, motion, at, to)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at, to
      type(slide_type) :: slide
      integer :: k

      ! A stick that the start has opened is taken back: nothing sticks without friction.
      if (self%phase == phase_stick) self%n_pieces = self%n_pieces - 1
      self%phase = phase_slip
      self%slips = .true.
      slide%at = [at, motion%look(0.5_wp*(at%angle + to%angle)), to]
      do k = 1, 3
         slide%v(:, k) = half_angle(merge(slide%at(k)%dp, slide%at(k)%p, motion%remembers))
      end do
      call add_slip(self, at%angle, to%angle, slide%v, 0)
   end subroutine slide_freely

end module fw_event_planar_path
