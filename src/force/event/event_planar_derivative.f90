!> Derivative of the force and of the friction path of a pair with two tangential directions, by the
!> inputs of fw_event_planar_tangent: of the integrals of fw_event_planar_force along the same path.
!> The force is continuous at every switch, so that no switch moves its integral; the rate of the
!> friction path N pull jumps where slip begins out of stick, at an angle that moves by
!>
!>   dtheta = -(t.(dP - dz) - dR)/pull.
module fw_event_planar_derivative
   use fw_event_cells, only: cells_type, instant_of
   use fw_event_moments, only: moments_type
   use fw_event_motion, only: instant_type, motion_type, stretch_type
   use fw_event_planar_force, only: first_instant
   use fw_event_planar_path, only: phase_slip, phase_stick, piece_type, planar_path_type
   use fw_event_planar_tangent, only: new_tangent, tangent_type
   use fw_event_polynomial, only: fill_waves
   use fw_event_slide, only: pulls
   use fw_event_stages, only: direction_of, n_points, n_stages
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: planar_derivative_type, new_derivative

   !> Rows that one matrix product takes.
   ! Enough for the product to run at the speed of dgemm, and small beside the gradient.
   integer, parameter :: buffer_size = 128

   type :: planar_derivative_type
      !> Derivatives of z and phi on the way along the path.
      type(tangent_type) :: tangent
      !> Of the tangential coefficients and the friction path (input, coefficient and direction and
      !> then the path).
      real(wp), allocatable :: gradient(:, :)
      !> The friction path is wanted.
      logical, private :: measures = .false.
      !> Inputs and weights of products that add up to the gradient (input, row), (output, row).
      real(wp), allocatable, private :: row(:, :), projector(:, :)
      integer, private :: n_rows = 0
      !> Directions of slip at the points of the cells times the weights of the quadrature
      !> (n_points, n_cells, 2), and their moments (0:2 degree, direction).
      real(wp), allocatable, private :: node(:, :, :), cosine(:, :), sine(:, :)
   contains
      procedure :: carry
      procedure :: accumulate
      procedure, private :: add_row
      procedure, private :: flush_rows
   end type planar_derivative_type

contains

   !> Room for cells of one size; gradients start from zero with each period.
   pure type(planar_derivative_type) function new_derivative(cells, measures) result(self)
      type(cells_type), intent(in) :: cells
      logical, intent(in) :: measures
      integer :: n

      self%tangent = new_tangent(cells%n_coefficients)
      self%measures = measures
      ! Outputs: the coefficients of both tangential components, then the friction path.
      n = 2*cells%n_coefficients + 1
      allocate (self%gradient(self%tangent%n_inputs, n), source=0.0_wp)
      allocate (self%row(self%tangent%n_inputs, buffer_size), self%projector(n, buffer_size))
      allocate (self%node(n_points, cells%n_cells, 2), source=0.0_wp)
      allocate (self%cosine(0:2*cells%degree, 2), self%sine(0:2*cells%degree, 2), source=0.0_wp)
   end function new_derivative

   !> Carry the derivatives through a turn.
   pure subroutine carry(self, path, motion, cells)
      class(planar_derivative_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(stretch_type) :: stretch
      integer :: i

      ! Sticks change nothing along their way: dz holds from their start to their end.
      call self%tangent%start()
      do i = 1, path%n_pieces
         call begin_piece(self, path, motion, cells, i, .false.)
         associate (piece => path%piece(i))
            if (piece%phase == phase_stick) cycle
            call motion%stretch(cells, piece%cell, piece%from, piece%to, stretch)
            call self%tangent%advance(motion, cells, piece, stretch)
         end associate
      end do
      call end_turn(self, path, motion, cells)
   end subroutine carry

   !> The same, and the derivative of the integrals over the turn; self%gradient is complete then.
   subroutine accumulate(self, path, motion, cells, fourier)
      class(planar_derivative_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(fourier_type), intent(in) :: fourier
      integer :: i

      call self%tangent%start()
      do i = 1, path%n_pieces
         call begin_piece(self, path, motion, cells, i, self%measures)
         associate (piece => path%piece(i))
            if (.not. fourier%projects) call add_samples(self, motion, cells, piece, fourier)
            if (piece%phase == phase_slip) then
               call add_slip(self, motion, cells, piece, fourier%projects)
            else if (fourier%projects) then
               call add_stick(self, cells, piece)
            end if
         end associate
      end do
      call self%flush_rows()
      call end_turn(self, path, motion, cells)
      if (fourier%projects) call add_turning(self, motion, cells)
   end subroutine accumulate

   !> What the switch at the start of a piece does.
   pure subroutine begin_piece(self, path, motion, cells, i, records)
      type(planar_derivative_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer, intent(in) :: i
      !> The friction path is differentiated too.
      logical, intent(in) :: records
      type(instant_type) :: at

      associate (piece => path%piece(i), tangent => self%tangent)
         ! A piece that goes on from the one before has no switch.
         if (.not. piece%begins .or. motion%mu <= 0.0_wp) return
         at = motion%look(piece%from)
         if (piece%phase == phase_stick) then
            if (piece%lands) then
               call tangent%land(cells, at)
            else if (i > 1) then
               ! Stick behind slip: its position is that of the last direction.
               call tangent%stop_slip(motion, cells, at, path%piece(i - 1)%phi(n_points))
            else if (.not. motion%remembers) then
               ! At velocity level a stick holds no position that could depend on anything.
               tangent%dz = 0.0_wp
            end if
         else if (.not. piece%lands) then
            ! Slip behind a landing starts within `advance`, with the angle of P'.
            call tangent%set_waves(cells, piece%from)
            if (.not. motion%remembers) tangent%dz = 0.0_wp
            call tangent%begin_slip(at, piece%z)
            if (records .and. motion%remembers) call add_onset(self, motion, at, piece%phi(1))
         end if
      end associate
   end subroutine begin_piece

   !> The friction path loses -N pull dtheta = N (t.(dP - dz) - dR), dR = -mu dy_n.
   pure subroutine add_onset(self, motion, at, phi)
      type(planar_derivative_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(instant_type), intent(in) :: at
      real(wp), intent(in) :: phi
      real(wp) :: t(2)
      integer :: path, nc

      t = direction_of(phi)
      nc = self%tangent%nc
      path = size(self%gradient, 2)
      associate (to => self%gradient(:, path), wave => self%tangent%wave)
         to = to - at%normal*(t(1)*self%tangent%dz(:, 1) + t(2)*self%tangent%dz(:, 2))
         to(:nc) = to(:nc) + at%normal*t(1)*wave
         to(nc + 1:2*nc) = to(nc + 1:2*nc) + at%normal*t(2)*wave
         to(2*nc + 1:3*nc) = to(2*nc + 1:3*nc) + at%normal*motion%mu*wave
      end associate
   end subroutine add_onset

   !> Position at the end of the turn, in the place of that at its start.
   pure subroutine end_turn(self, path, motion, cells)
      type(planar_derivative_type), intent(inout) :: self
      type(planar_path_type), intent(in) :: path
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      integer :: c

      associate (last => path%piece(max(path%n_pieces, 1)), tangent => self%tangent)
         ! Open (or without friction) at the end: z goes with P, and has forgotten its start.
         if (path%lifted(path%n_knots - 1) .or. motion%mu <= 0.0_wp) then
            tangent%dz = 0.0_wp
            call tangent%set_waves(cells, 0.0_wp)
            do c = 1, 2
               tangent%dz((c - 1)*tangent%nc + 1:c*tangent%nc, c) = tangent%wave
            end do
         else if (last%phase == phase_slip) then
            call tangent%stop_slip(motion, cells, motion%look(0.0_wp), last%phi(n_points))
         end if
      end associate
   end subroutine end_turn

   !> A row with its projector; products are made once there is no room for more.
   subroutine add_row(self, row, projector)
      class(planar_derivative_type), intent(inout) :: self
      !> Derivative of something by the inputs (n_inputs), and what it adds to each coefficient
      !> (n_output).
      real(wp), intent(in) :: row(:), projector(:)

      if (self%n_rows == buffer_size) call self%flush_rows()
      ! Gathered, since one product of many rows is far faster than as many updates of rank one.
      self%n_rows = self%n_rows + 1
      self%row(:, self%n_rows) = row
      self%projector(:, self%n_rows) = projector
   end subroutine add_row

   !> gradient += row projector^T over the rows gathered so far.
   subroutine flush_rows(self)
      class(planar_derivative_type), intent(inout) :: self
      integer :: n, n_out

      n = self%tangent%n_inputs
      n_out = size(self%projector, 1)
      if (self%n_rows > 0) then
         call dgemm('N', 'T', n, n_out, self%n_rows, 1.0_wp, self%row, n, self%projector, n_out, &
                    1.0_wp, self%gradient, n)
      end if
      self%n_rows = 0
   end subroutine flush_rows

   !> Stick: -dz times the waves integrated over it; their slopes are n times their conjugates.
   subroutine add_stick(self, cells, piece)
      type(planar_derivative_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      real(wp) :: integral(cells%n_coefficients), projector(2*cells%n_coefficients + 1), n
      integer :: c, h, k, nc

      nc = cells%n_coefficients
      call self%tangent%set_waves(cells, piece%to)
      ! The waves' antiderivative is -slope/n**2: int cos = sin/n.
      integral = self%tangent%slope
      call self%tangent%set_waves(cells, piece%from)
      integral = integral - self%tangent%slope
      do h = 1, cells%n_retained
         n = real(cells%harmonic(h), wp)
         k = cells%column(h)
         if (n > 0.0_wp) then
            integral(k:k + 1) = -integral(k:k + 1)/n**2
         else
            integral(k) = piece%to - piece%from
         end if
      end do
      do c = 1, 2
         projector = 0.0_wp
         ! T = P - z; the part of P is in the Gram matrix of the sticks (fw_event_planar).
         projector((c - 1)*nc + 1:c*nc) = -cells%weight*integral
         call self%add_row(self%tangent%dz(:, c), projector)
      end do
   end subroutine add_stick

   !> One step of slip: dT = dR t + R n dphi at its Gauss points.
   subroutine add_slip(self, motion, cells, piece, projects)
      type(planar_derivative_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      logical, intent(in) :: projects
      type(stretch_type) :: stretch
      real(wp) :: t(2), weight, wave(cells%n_coefficients)
      real(wp) :: projector(2*cells%n_coefficients + 1)
      integer :: j, nc

      call motion%stretch(cells, piece%cell, piece%from, piece%to, stretch)
      call self%tangent%advance(motion, cells, piece, stretch)
      if (self%measures) call add_path(self, motion, cells, piece, stretch)
      if (motion%mu <= 0.0_wp .or. .not. (projects .or. self%measures)) return
      if (projects) call turn_step(self, cells, piece)
      nc = cells%n_coefficients
      do j = 2, n_stages + 1
         ! The quadrature of the force (fw_event_planar_force), so that derivative and force agree.
         weight = cells%rule%weight(j)*(piece%to - piece%from)
         projector = 0.0_wp
         ! n = (-t_2, t_1).
         t = direction_of(piece%phi(j))
         if (projects) then
            ! The force turns by R n dphi; its coefficients are the quadrature against the waves.
            wave = (weight*stretch%radius(j))*cells%weight*self%tangent%waves(j, :)
            projector(:nc) = -t(2)*wave
            projector(nc + 1:2*nc) = t(1)*wave
         end if
         if (self%measures .and. motion%remembers) then
            ! d(P'.t) = P'.n dphi.
            projector(2*nc + 1) = weight*stretch%normal(j)* &
                                  (t(1)*stretch%dp(j, 2) - t(2)*stretch%dp(j, 1))
         end if
         call self%add_row(self%tangent%dphi_at(:, j), projector)
      end do
   end subroutine add_slip

   !> The directions of slip of a step, for the Gram matrix of dR.
   pure subroutine turn_step(self, cells, piece)
      type(planar_derivative_type), intent(inout) :: self
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      real(wp) :: t(2), angle, width, cosines(0:2*cells%degree), sines(0:2*cells%degree)
      integer :: c, j

      width = piece%to - piece%from
      do j = 2, n_stages + 1
         t = (cells%rule%weight(j)*width)*direction_of(piece%phi(j))
         ! Cells are collected over the period, and meet their waves in one product at the end.
         if (piece%cell > 0) then
            self%node(j, piece%cell, :) = self%node(j, piece%cell, :) + t
            cycle
         end if
         angle = piece%from + width*cells%rule%place(j)
         call fill_waves(2*cells%degree, angle, cosines, sines)
         do c = 1, 2
            self%cosine(:, c) = self%cosine(:, c) + t(c)*cosines
            self%sine(:, c) = self%sine(:, c) + t(c)*sines
         end do
      end do
   end subroutine turn_step

   !> What the friction path takes of a step beside dphi: d(N pull), with t fixed.
   pure subroutine add_path(self, motion, cells, piece, stretch)
      type(planar_derivative_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      type(stretch_type), intent(in) :: stretch
      real(wp) :: f(n_points), t(2), rate, normal
      integer :: j, nc, path

      nc = self%tangent%nc
      path = size(self%gradient, 2)
      call pulls(motion, stretch, piece%phi, f)
      do j = 2, n_stages + 1
         t = direction_of(piece%phi(j))
         normal = cells%rule%weight(j)*(piece%to - piece%from)
         ! As in the force: a pull just below zero, before a stop, is none.
         rate = normal*max(f(j), 0.0_wp)
         normal = normal*stretch%normal(j)
         associate (to => self%gradient(:, path), wave => self%tangent%waves(j, :), &
                    slope => self%tangent%slopes(j, :))
            ! d(N pull) = dN pull + N (t.dP' - dR'), with dN = -dy_n and dR' = -mu dy_n'; at
            ! velocity level the pull is t.P - R.
            if (motion%remembers) then
               to(:nc) = to(:nc) + normal*t(1)*slope
               to(nc + 1:2*nc) = to(nc + 1:2*nc) + normal*t(2)*slope
               to(2*nc + 1:3*nc) = to(2*nc + 1:3*nc) + normal*motion%mu*slope - rate*wave
            else
               to(:nc) = to(:nc) + normal*t(1)*wave
               to(nc + 1:2*nc) = to(nc + 1:2*nc) + normal*t(2)*wave
               to(2*nc + 1:3*nc) = to(2*nc + 1:3*nc) + (normal*motion%mu - rate)*wave
            end if
         end associate
      end do
   end subroutine add_path

   !> dT by dR: the Gram matrix of the waves under t, over the nodes.
   subroutine add_turning(self, motion, cells)
      type(planar_derivative_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(moments_type) :: moments
      integer :: c, k, n, nc

      n = 2*cells%degree + 1
      k = n_points*cells%n_cells
      nc = cells%n_coefficients
      call dgemm('N', 'N', n, 2, k, 1.0_wp, cells%cosine, n, self%node, k, 1.0_wp, self%cosine, n)
      call dgemm('N', 'N', n, 2, k, 1.0_wp, cells%sine, n, self%node, k, 1.0_wp, self%sine, n)
      call moments%reserve(cells%degree)
      do c = 1, 2
         ! Moments of t by quadrature in the place of exact ones: then the Gram matrix is the same
         ! formula.
         call moments%set(self%cosine(:, c), self%sine(:, c))
         call moments%add_gram(-motion%mu, cells%n_retained, cells%harmonic, cells%column, &
                               self%gradient(2*nc + 1:3*nc, (c - 1)*nc + 1:c*nc))
      end do
   end subroutine add_turning

   !> Forces at the instants of a piece, fitted instead of projected.
   subroutine add_samples(self, motion, cells, piece, fourier)
      type(planar_derivative_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      type(cells_type), intent(in) :: cells
      type(piece_type), intent(in) :: piece
      type(fourier_type), intent(in) :: fourier
      real(wp) :: t(2), projector(2*cells%n_coefficients + 1)
      type(instant_type) :: at
      integer :: c, k, nc

      nc = cells%n_coefficients
      if (motion%mu <= 0.0_wp) return
      do k = first_instant(cells%n_time, piece%from), cells%n_time
         if (instant_of(cells%n_time, k) >= piece%to) exit
         associate (weight => fourier%analysis(:, k))
            ! Collocation may skip instants.
            if (.not. any(abs(weight) > 0.0_wp)) cycle
            if (piece%phase == phase_slip) then
               ! Slip: dT = R n dphi + t dR, with dR = -mu dy_n.
               at = motion%look(instant_of(cells%n_time, k))
               ! Instants are starts of cells, and a step covers no more than a cell: its start.
               t = direction_of(piece%phi(1))
               projector(:nc) = -at%radius*t(2)*weight
               projector(nc + 1:2*nc) = at%radius*t(1)*weight
               projector(2*nc + 1) = 0.0_wp
               call self%add_row(self%tangent%dphi, projector)
               do c = 1, 2
                  call add_outer(self, 3, c, -motion%mu*t(c), fourier%synthesis(:, k), weight)
               end do
               cycle
            end if
            ! Stick: dT = dP - dz.
            do c = 1, 2
               projector = 0.0_wp
               projector((c - 1)*nc + 1:c*nc) = -weight
               call self%add_row(self%tangent%dz(:, c), projector)
               call add_outer(self, c, c, 1.0_wp, fourier%synthesis(:, k), weight)
            end do
         end associate
      end do
   end subroutine add_samples

   !> Add a product of waves and weights to one block of the gradient.
   pure subroutine add_outer(self, input, output, factor, wave, weight)
      type(planar_derivative_type), intent(inout) :: self
      integer, intent(in) :: input, output
      real(wp), intent(in) :: factor, wave(:), weight(:)
      integer :: k, nc

      nc = self%tangent%nc
      do k = 1, nc
         associate (to => self%gradient((input - 1)*nc + 1:input*nc, (output - 1)*nc + k))
            to = to + (factor*weight(k))*wave
         end associate
      end do
   end subroutine add_outer

end module fw_event_planar_derivative
