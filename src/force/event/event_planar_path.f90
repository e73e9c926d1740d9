!> The path of one pair with two tangential directions through a period, as a list of pieces.
!>
!> Between its knots - the ends of the cells and the roots of N - the pair sticks, slips or is open.
!> It starts to slip at a root of |P - z|**2 - R**2, z being the corrected position; slipping, it
!> turns as fw_event_stages says (fw_event_slide), in steps that are divided where the tolerance
!> asks for it; it stops where its pull falls to zero. Where contact begins, it sticks if R grows
!> faster than P moves.
!>
!> A turn maps the position z at the start of a period to that at its end; its derivative is carried
!> along: slip keeps of dz what is normal to the force, a landing nothing.
!>
!> States on the way are the phase, z (stick), and the angle phi of the force (slip); with them go
!> the derivatives of z and phi by the position at the start of the turn.
module fw_event_planar_path
   use fw_event_cells, only: cells_type
   use fw_event_exit, only: find_exit, is_pushed
   use fw_event_motion, only: instant_type, motion_type, stretch_type
   use fw_event_roots, only: find_roots
   use fw_event_slide, only: slide_along, slide_type
   use fw_event_stages, only: direction_of, n_points
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: planar_path_type, piece_type
   public :: phase_open, phase_stick, phase_slip

   integer, parameter :: phase_open = 1, phase_stick = 2, phase_slip = 3
   !> Switches in one cell, and spare pieces in a period, after which the pair sticks on: they crowd
   !> at round-off only.
   integer, parameter :: max_switches = 12, spare_pieces = 96
   !> A stick, or a step of slip.
   type :: piece_type
      integer :: phase = phase_stick
      !> The phase before it was another one; and that was open.
      logical :: begins = .true., lands = .false.
      !> Angles, from < to.
      real(wp) :: from = 0.0_wp, to = 0.0_wp
      !> Position of a stick, or of that before slip which begins.
      real(wp) :: z(2) = 0.0_wp
      !> Of slip: phi at the points of the step, phi' there, and the cell that it
      !> covers (0: none).
      real(wp) :: phi(n_points) = 0.0_wp, slope(n_points) = 0.0_wp
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
      !> The roots of N.
      real(wp), allocatable, private :: lift(:)
      !> What the pair does on the way, and derivatives of z and phi by the z of the start.
      integer, private :: phase = phase_stick
      real(wp), private :: z(2) = 0.0_wp, phi = 0.0_wp, by_z(2, 2) = 0.0_wp, by_phi(2) = 0.0_wp
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
         call find_roots(cells%n_time, cells%degree, motion%normal, motion%values, motion%slopes, &
                         sum(abs(motion%normal)), n_lifts, self%lift)
         lifted = motion%values(1) < 0.0_wp
      end if
      self%closed = n_lifts == 0 .and. .not. lifted
      self%open = n_lifts == 0 .and. lifted
      self%n_knots = 0
      j = 1
      do k = 1, cells%n_cells + 1
         do while (j <= n_lifts)
            if (self%lift(j) >= cells%start_of(k)) exit
            lifted = .not. lifted
            call add_knot(self, self%lift(j), lifted, 0)
            ! The cell that the root splits is no whole one any more.
            if (self%n_knots > 1) self%cell(self%n_knots - 1) = 0
            j = j + 1
         end do
         call add_knot(self, cells%start_of(k), lifted, k)
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

   !> One period from a position, to another one, with the derivative m of that.
   pure subroutine turn(self, motion, cells, z_start, z_end, m)
      class(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      real(wp), intent(in) :: z_start(2)
      real(wp), intent(out) :: z_end(2), m(2, 2)
      integer :: k

      self%n_pieces = 0
      self%slips = .false.
      self%lands = .false.
      ! Identity: the position of the start is the input.
      self%by_z = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      self%by_phi = 0.0_wp
      call start(self, motion, motion%look(0.0_wp), z_start)
      do k = 1, self%n_knots - 1
         ! Open from one knot to the next, since N keeps its sign there.
         if (self%lifted(k)) then
            if (self%phase == phase_stick) self%piece(self%n_pieces)%to = self%knot(k)
            self%phase = phase_open
            cycle
         end if
         ! Open until here: the knot is a root of N.
         if (self%phase == phase_open) call land(self, motion, motion%look(self%knot(k)))
         call bear(self, motion, cells, k)
      end do
      if (self%phase == phase_stick) self%piece(self%n_pieces)%to = 2.0_wp*pi
      call finish(self, motion, motion%look(0.0_wp), z_end, m)
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
      ! Seen from the frame of the next turn, which has moved on by then.
      z_end = self%z + 2.0_wp*pi*motion%drift
      if (self%phase == phase_stick) return
      m = 0.0_wp
      ! Open, or without friction: z goes with P.
      z_end = at%p
      if (self%phase == phase_open .or. motion%mu <= 0.0_wp) return
      call position_of_slip(at, self%phi, self%by_phi, z_end, m)
   end subroutine finish

   !> z = P - R t, dz = -R n dphi.
   pure subroutine position_of_slip(at, phi, by_phi, z, by_z)
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: phi, by_phi(2)
      real(wp), intent(out) :: z(2), by_z(2, 2)
      real(wp) :: t(2)

      t = direction_of(phi)
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
         self%phi = atan2(at%dp(2), at%dp(1))
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
      self%phi = atan2(d(2), d(1))
      self%begins = .true.
      self%behind_landing = .false.
      self%slips = .true.
      self%by_phi = (d(2)*self%by_z(1, :) - d(1)*self%by_z(2, :))/ &
                    max(dot_product(d, d), tiny(1.0_wp))
   end subroutine begin_slip

   !> Contact from one knot to the next.
   pure subroutine bear(self, motion, cells, k)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: k
      type(slide_type) :: slide
      type(instant_type) :: at
      logical :: found, stops
      integer :: i

      associate (to => self%knot(k + 1), stretch => slide%stretch)
         ! A whole cell has been evaluated with all others; between a root of N and a knot the
         ! series are summed here.
         call motion%stretch(cells, self%cell(k), self%knot(k), to, stretch)
         if (motion%mu <= 0.0_wp) then
            call slide_freely(self, motion, slide)
            return
         end if
         ! Stick and slip by turns, until the knot is reached.
         do i = 1, max_switches
            if (self%phase == phase_stick) then
               if (.not. has_room(self, k)) return
               call find_exit(motion, cells, self%z, stretch, at, found)
               if (.not. found) return
               ! What is left of the stretch is looked at anew, at points of its own.
               self%piece(self%n_pieces)%to = at%angle
               call begin_slip(self, at)
               call motion%stretch(cells, 0, at%angle, to, stretch)
            end if
            call slip_to(self, motion, cells, k, slide, at, stops)
            if (.not. stops) return
            call motion%stretch(cells, 0, at%angle, to, stretch)
         end do
      end associate
   end subroutine bear

   !> Whether a stretch from knot k may have more pieces: each knot to come may need two.
   pure logical function has_room(self, k)
      type(planar_path_type), intent(in) :: self
      integer, intent(in) :: k

      has_room = self%n_pieces + 2*(self%n_knots - k + 2) < size(self%piece)
   end function has_room

   !> Slip up to the next knot, or to where it stops.
   pure subroutine slip_to(self, motion, cells, k, slide, at, stops)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: k
      !> With the stretch to be taken.
      type(slide_type), intent(inout) :: slide
      !> Where slip stops.
      type(instant_type), intent(inout) :: at
      logical, intent(out) :: stops
      real(wp) :: from, width, to

      to = slide%stretch%to
      do
         ! Each step starts in the direction in which the one before has ended.
         slide%stages%phi(1) = self%phi
         call slide_along(motion, cells, self%behind_landing, has_room(self, k), slide)
         from = slide%stretch%from
         width = slide%stretch%to - from
         ! Half of it, as often as it takes: the direction turns fast only where R is small.
         if (slide%divides) then
            call motion%stretch(cells, 0, from, from + 0.5_wp*width, slide%stretch)
            cycle
         end if
         call add_slip(self, slide)
         ! A step of no width is noted too: the stick behind it takes its direction.
         self%phi = slide%stages%phi(n_points)
         self%by_phi = slide%stages%gain*self%by_phi
         stops = slide%stops
         if (stops .or. slide%stretch%to >= to) exit
         ! Twice as wide again. What is left is some whole number of widths: the limit lies between
         ! two, so that round-off does not decide.
         from = slide%stretch%to
         ! Without room for more pieces all the rest is one.
         if (to - from > 2.5_wp*width .and. has_room(self, k)) then
            call motion%stretch(cells, 0, from, from + 2.0_wp*width, slide%stretch)
         else
            call motion%stretch(cells, 0, from, to, slide%stretch)
         end if
      end do
      if (.not. stops) return
      at = motion%look(slide%stretch%to)
      self%z = 0.0_wp
      ! At velocity level there is no position, and T = P where it sticks.
      if (motion%remembers) call position_of_slip(at, self%phi, self%by_phi, self%z, self%by_z)
      call begin_stick(self, at%angle)
   end subroutine slip_to

   !> Note slip as a piece.
   pure subroutine add_slip(self, slide)
      type(planar_path_type), intent(inout) :: self
      type(slide_type), intent(in) :: slide

      self%n_pieces = self%n_pieces + 1
      associate (piece => self%piece(self%n_pieces))
         piece%phase = phase_slip
         piece%begins = self%begins
         piece%lands = self%behind_landing
         piece%from = slide%stretch%from
         piece%to = slide%stretch%to
         piece%z = self%z
         piece%phi = slide%stages%phi
         piece%slope = slide%stages%slope
         piece%cell = slide%stretch%cell
      end associate
      self%begins = .false.
      self%behind_landing = .false.
   end subroutine add_slip

   !> Without friction the pair moves at no cost, wherever P goes.
   pure subroutine slide_freely(self, motion, slide)
      type(planar_path_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(slide_type), intent(inout) :: slide
      integer :: k

      ! A stick that the start has opened is taken back: nothing sticks without friction.
      if (self%phase == phase_stick) self%n_pieces = self%n_pieces - 1
      self%phase = phase_slip
      self%slips = .true.
      associate (p => slide%stretch%p, dp => slide%stretch%dp)
         do k = 1, n_points
            if (motion%remembers) then
               slide%stages%phi(k) = atan2(dp(k, 2), dp(k, 1))
            else
               slide%stages%phi(k) = atan2(p(k, 2), p(k, 1))
            end if
         end do
      end associate
      slide%stages%slope = 0.0_wp
      call add_slip(self, slide)
   end subroutine slide_freely

end module fw_event_planar_path
