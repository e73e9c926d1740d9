!> Integrals along the path of a pair with two tangential directions: the coefficients of its
!> forces, shares of stick, slip and open, and the path of friction. Stick and contact are
!> integrated exactly, slip by the Gauss points of its steps.
!>
!> In stick T = P - z, so that with the sets chi the coefficients are G(chi_stick) P less those of z
!> on the sticks; in slip T = R t at the Gauss points; F_n = -G(chi_contact) N.
module fw_event_planar_force
   use fw_event_cells, only: cells_type, instant_of, waves_of_step
   use fw_event_moments, only: moments_type
   use fw_event_motion, only: instant_type, motion_type, stretch_type
   use fw_event_planar_path, only: phase_stick, piece_type, planar_path_type
   use fw_event_polynomial, only: fill_waves
   use fw_event_slide, only: pulls
   use fw_event_stages, only: angle_at, cosine_and_sine, direction_of, n_points, n_stages
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: planar_force_type, first_instant

   type :: planar_force_type
      !> Projected coefficients (n_coefficients, 3), and mean of the tangential forces.
      real(wp), allocatable :: projected(:, :)
      real(wp) :: mean(2) = 0.0_wp
      !> Shares of stick, slip and open; int N |dz|.
      real(wp) :: share(3) = 0.0_wp, friction_path = 0.0_wp
      !> Sets of stick and contact; stick weighted by z.
      type(moments_type) :: stick
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(moments_type), allocatable :: contact, held(:)
      !> Tangential forces at the points of the cells times the weights of the quadrature
      !> (n_points, n_cells, 2).
      real(wp), allocatable, private :: node(:, :, :)
      !> Workspace: waves up to 2 degree at an angle, and the retained ones of a step with their
      !> slopes.
      real(wp), allocatable, private :: cosines(:), sines(:), wave(:, :), slope(:, :)
   contains
      procedure :: reserve
      procedure :: integrate
      procedure :: sample
   end type planar_force_type

contains

   !> Room for cells of one size, used again by every pair.
   pure subroutine reserve(self, cells)
      class(planar_force_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells

      allocate (self%projected(cells%n_coefficients, 3), source=0.0_wp)
      allocate (self%node(n_points, cells%n_cells, 2), source=0.0_wp)
      call self%stick%reserve(cells%degree)
      allocate (self%contact, self%held(2))
      call self%contact%reserve(cells%degree)
      call self%held(1)%reserve(cells%degree)
      call self%held(2)%reserve(cells%degree)
      allocate (self%cosines(0:2*cells%degree), self%sines(0:2*cells%degree))
      allocate (self%wave(n_points, cells%n_coefficients))
      allocate (self%slope, mold=self%wave)
   end subroutine reserve

   !> Everything from a path.
   subroutine integrate(self, path, motion, cells)
      class(planar_force_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer :: c, i, n, nc

      nc = cells%n_coefficients
      n = n_points*cells%n_cells
      self%projected = 0.0_wp
      self%mean = 0.0_wp
      self%share = 0.0_wp
      self%friction_path = 0.0_wp
      self%node = 0.0_wp
      call self%stick%clear()
      call self%held(1)%clear()
      call self%held(2)%clear()
      ! Whole cells only collect their forces here: one product for all of them below.
      do i = 1, path%n_pieces
         associate (piece => path%piece(i))
            if (piece%phase == phase_stick) then
               call add_stick(self, piece%from, -1.0_wp, piece%z)
               call add_stick(self, piece%to, 1.0_wp, piece%z)
               self%share(1) = self%share(1) + 0.5_wp/pi*(piece%to - piece%from)
            else
               call add_slip(self, motion, cells, piece)
            end if
         end associate
      end do
      ! Every node meets its waves once, whatever the number of stretches that have added to it.
      call add_contact(self, path)
      call dgemm('T', 'N', nc, 2, n, 1.0_wp, cells%wave, n, self%node, n, 1.0_wp, &
                 self%projected, nc)
      do c = 1, 2
         self%mean(c) = self%mean(c) + 0.5_wp/pi*sum(self%node(:, :, c))
         self%projected(:, c) = cells%weight*self%projected(:, c)
      end do
      if (motion%is_carried()) call add_carried(self, path, motion%drift)
      call add_sets(self, motion, cells)
   end subroutine integrate

   !> One end of a stick: what the set and z lose there.
   pure subroutine add_stick(self, angle, drop, z)
      type(planar_force_type), intent(inout) :: self
      !> `drop` is what the weight of the set loses there: -1 at the start, 1 at the end.
      real(wp), intent(in) :: angle, drop, z(2)
      integer :: c

      call fill_waves(size(self%cosines) - 1, angle, self%cosines, self%sines)
      call self%stick%add_step(drop, angle, self%cosines, self%sines)
      do c = 1, 2
         call self%held(c)%add_step(drop*z(c), angle, self%cosines, self%sines)
      end do
   end subroutine add_stick

   !> What side 2 carries z along while the pair sticks, drift tau.
   pure subroutine add_carried(self, path, drift)
      class(planar_force_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      real(wp), intent(in) :: drift(2)
      real(wp) :: angle
      integer :: c, i, k

      do i = 1, path%n_pieces
         if (path%piece(i)%phase /= phase_stick) cycle
         do k = -1, 1, 2
            angle = merge(path%piece(i)%from, path%piece(i)%to, k < 0)
            call fill_waves(size(self%cosines) - 1, angle, self%cosines, self%sines)
            do c = 1, 2
               call self%held(c)%add_ramp(k*drift(c), angle, self%cosines, self%sines)
            end do
         end do
      end do
   end subroutine add_carried

   !> One step of slip.
   pure subroutine add_slip(self, motion, cells, piece)
      type(planar_force_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      type(stretch_type) :: stretch
      real(wp) :: force(n_points, 2), f(n_points), width
      integer :: c, j, k

      width = piece%to - piece%from
      if (width <= 0.0_wp) return
      self%share(2) = self%share(2) + 0.5_wp/pi*width
      call motion%stretch(cells, piece%cell, piece%from, piece%to, stretch)
      call pulls(motion, stretch, piece%phi, f)
      ! Normal and tangential forces at the points of the step, not those of a grid: the same points
      ! carry the direction, whose order the integrals then share.
      do j = 2, n_stages + 1
         ! The integral of N times the speed of z, which is the pull.
         self%friction_path = self%friction_path + &
                              cells%rule%weight(j)*width*stretch%normal(j)*max(f(j), 0.0_wp)
      end do
      call cosine_and_sine(piece%phi, force(:, 1), force(:, 2))
      do c = 1, 2
         force(:, c) = width*cells%rule%weight*stretch%radius*force(:, c)
      end do
      ! A whole cell meets its waves together with the others; the rest of a cell has its own.
      if (piece%cell > 0) then
         self%node(:, piece%cell, :) = self%node(:, piece%cell, :) + force
         return
      end if
      call waves_of_step(cells, piece%from, width, self%wave, self%slope)
      do c = 1, 2
         self%mean(c) = self%mean(c) + 0.5_wp/pi*sum(force(:, c))
         do k = 1, size(self%wave, 2)
            self%projected(k, c) = self%projected(k, c) + dot_product(self%wave(:, k), force(:, c))
         end do
      end do
   end subroutine add_slip

   !> Moments of contact: steps at 0, at the roots of N and at 2 pi.
   pure subroutine add_contact(self, path)
      type(planar_force_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      integer :: k
      logical :: before, behind

      call self%contact%clear()
      ! As if the set began before 0 with weight 1: the first knot then only enters where it is
      ! open, and at the angle 0 that is the same as a start there.
      before = .true.
      do k = 1, path%n_knots
         ! Behind the last knot nothing bears.
         behind = k == path%n_knots .or. path%lifted(k)
         if (behind .neqv. before) then
            call fill_waves(size(self%cosines) - 1, path%knot(k), self%cosines, self%sines)
            call self%contact%add_step(merge(1.0_wp, -1.0_wp, behind), path%knot(k), &
                                       self%cosines, self%sines)
         end if
         before = behind
      end do
      call self%contact%finish()
      ! What is open of a pair that never opens is round-off, of either sign.
      self%share(3) = max(0.0_wp, 1.0_wp - 0.5_wp/pi*self%contact%cosine(0))
   end subroutine add_contact

   !> What stick and contact leave in the coefficients.
   pure subroutine add_sets(self, motion, cells)
      type(planar_force_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer :: c, h, k

      call self%stick%finish()
      associate (n => cells%n_retained, harmonic => cells%harmonic, column => cells%column)
         call self%contact%project(-1.0_wp, motion%normal, n, harmonic, column, &
                                   self%projected(:, 3))
         do c = 1, 2
            call self%held(c)%finish()
            call self%stick%project(1.0_wp, motion%tangential(:, :, c), n, harmonic, column, &
                                    self%projected(:, c))
            ! The mean by itself, since harmonic 0 may not be among the retained ones.
            call self%stick%project(1.0_wp, motion%tangential(:, :, c), 1, [0], [1], &
                                    self%mean(c:c))
            self%mean(c) = self%mean(c) - 0.5_wp/pi*self%held(c)%cosine(0)
            do h = 1, n
               k = column(h)
               self%projected(k, c) = self%projected(k, c) - &
                                      cells%weight(k)*self%held(c)%cosine(harmonic(h))
               if (harmonic(h) > 0) self%projected(k + 1, c) = self%projected(k + 1, c) - &
                  cells%weight(k + 1)*self%held(c)%sine(harmonic(h))
            end do
         end do
      end associate
   end subroutine add_sets

   !> Forces at uniform instants (3, number of them), for collocation and histories.
   pure subroutine sample(self, path, motion, cells, values)
      class(planar_force_type), intent(in) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      real(wp), intent(out) :: values(:, :)
      type(instant_type) :: at
      real(wp) :: width
      integer :: i, k, n

      n = size(values, 2)
      values(1:2, :) = 0.0_wp
      do k = 1, n
         at = motion%look(instant_of(n, k))
         ! Open where N < 0.
         values(3, k) = min(-at%normal, 0.0_wp)
      end do
      if (motion%mu <= 0.0_wp .or. .not. allocated(self%projected)) return
      do i = 1, path%n_pieces
         associate (piece => path%piece(i))
            width = piece%to - piece%from
            do k = first_instant(n, piece%from), n
               if (instant_of(n, k) >= piece%to) exit
               at = motion%look(instant_of(n, k))
               if (piece%phase == phase_stick) then
                  ! T = P - z.
                  values(1:2, k) = at%p - piece%z
               else if (motion%remembers) then
                  ! On the polynomial of the step, which is the direction itself at its start.
                  values(1:2, k) = at%radius* &
                     direction_of(angle_at(cells%rule, width, piece%phi(1), piece%slope, &
                                           (at%angle - piece%from)/width))
               else
                  values(1:2, k) = at%radius*at%p/max(norm2(at%p), tiny(1.0_wp))
               end if
            end do
         end associate
      end do
   end subroutine sample

   !> The first of n instants that is not before an angle.
   pure integer function first_instant(n, angle) result(k)
      integer, intent(in) :: n
      real(wp), intent(in) :: angle

      ! By division, then corrected for its rounding, in either direction.
      k = int(0.5_wp/pi*angle*real(n, wp)) + 1
      if (instant_of(n, k) < angle) k = k + 1
      if (k > 1) then
         if (instant_of(n, k - 1) >= angle) k = k - 1
      end if
   end function first_instant

end module fw_event_planar_force
