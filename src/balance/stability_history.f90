!> The nonlinear forces along one period of a solution, and their derivatives at each instant: what
!> the march of a perturbation needs. Rows are those of the joint.
module fw_stability_history
   use fw_force_law, only: force_law, force_workspace, pair_mixed, pair_stuck
   use fw_fourier, only: fourier_type, new_fourier
   use fw_friction, only: elastic_friction
   use fw_instant_law, only: element_motion, instant_law, reserve_motion
   use fw_balance_state, only: balance_state
   use fw_kinds, only: pi, wp
   use fw_pair_law, only: pair_law
   use fw_stability_tangent, only: relative_displacements
   implicit none (type, external)
   private

   public :: history_type, new_history

   !> Steps per period at least: the error of Newmark's rule is (w step)**2/12 of the phase.
   integer, parameter :: fewest_steps = 1024
   integer, parameter :: steps_per_harmonic = 32

   !> Elements of several rows each, whose forces follow from displacements and velocities at the
   !> same instant.
   type :: element_slopes
      !> Row of the joint, 0 where there is none (input, element).
      integer, allocatable :: row(:, :)
      !> (input, output, element, n_time) [force/length], [force time/length].
      real(wp), allocatable :: by_u(:, :, :, :), by_v(:, :, :, :)
      !> An element that has no force at one of the instants, which may be more than those of the
      !> balance; 0: none.
      integer :: refuses = 0
   end type element_slopes

   type :: history_type
      integer :: n_time = 0
      !> Row of each component, 0 where there is none (3, n_pairs), and of each element whose force
      !> depends on the displacement at the instant alone.
      integer, allocatable :: row(:, :), pointwise_row(:)
      !> Prediction stiffness of each row of the pairs, 0 of others (n_rows) [force/length].
      real(wp), allocatable :: stiffness(:)
      !> Tangential rows of pairs that slip, which remember their position (n_rows).
      logical, allocatable :: remembers(:)
      !> Pairs along the period.
      class(pair_law), allocatable :: law
      type(force_workspace) :: forces
      !> Of a law that acts at once: slopes of its forces by displacements and by velocities
      !> (output, input, n_pairs, n_time).
      logical :: acts_at_once = .false.
      real(wp), allocatable :: by_displacement(:, :, :, :), by_velocity(:, :, :, :)
      !> Slopes of the other elements (as pointwise_row, n_time).
      real(wp), allocatable :: slope(:, :)
      !> The groups of elements (0 without any), and whether forces of the motion follow its
      !> velocities.
      type(element_slopes), allocatable :: elements(:)
      logical :: has_rates = .false.
   contains
      procedure :: rubs
      procedure :: derivatives
   end type history_type

contains

   !> Follow the solution x of a system through a period.
   subroutine new_history(system, x, self, halved)
      class(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(history_type), intent(out) :: self
      !> Half the steps that half the harmonics would take (default: no).
      logical, intent(in), optional :: halved
      type(fourier_type) :: fourier
      real(wp), allocatable :: rows(:, :)
      integer :: i, c, h

      h = maxval(system%problem%fourier%harmonic)
      self%n_time = max(fewest_steps, system%problem%fourier%n_time, steps_per_harmonic*h)
      if (present(halved)) then
         if (halved) self%n_time = max(fewest_steps, steps_per_harmonic*h/2)/2
      end if
      fourier = new_fourier(h, self%n_time)
      call relative_displacements(system, system%problem%structure%n_coordinates, x, h, rows)
      self%row = system%problem%joint%row
      allocate (self%stiffness(size(rows, 2)), source=0.0_wp)
      allocate (self%remembers(size(rows, 2)), source=.false.)
      call take_law(system%problem%forces%entry(system%problem%forces%pairs)%law, self%law)
      call self%law%reserve(fourier, self%forces)
      associate (p => self%law%prediction)
         do i = 1, system%problem%n_pairs
            do c = 1, 3
               if (self%row(c, i) == 0) cycle
               self%stiffness(self%row(c, i)) = p%stiffness(i, c)
               self%forces%prediction(i, c, :) = rows(:, self%row(c, i))
            end do
         end do
         call p%move_gaps(fourier, self%forces%prediction)
         do c = 1, 3
            do i = 1, size(self%forces%prediction, 1)
               self%forces%prediction(i, c, :) = p%stiffness(i, c)*self%forces%prediction(i, c, :)
            end do
         end do
      end associate
      ! The march of the pairs starts where that of the balance did, and so comes to the same
      ! limit.
      if (self%law%facts%acts_at_once) then
         call differentiate_at_once(system, rows, fourier, self)
         call take_slopes(system, rows, fourier, self)
         return
      end if
      self%forces%x_start = system%work(system%problem%forces%pairs)%x_start
      call self%law%set_offset(system%depth, self%forces)
      call self%law%evaluate(fourier, self%forces)
      call find_settled(self)
      call find_memory(self)
      call take_slopes(system, rows, fourier, self)
   end subroutine new_history

   !> The pairs of a law, decided at instants whatever the balance does.
   subroutine take_law(law, at_instants)
      class(force_law), intent(in) :: law
      class(pair_law), allocatable, intent(out) :: at_instants

      select type (law)
      class is (pair_law)
         if (law%facts%acts_at_once) then
            allocate (at_instants, source=law)
            return
         end if
         allocate (at_instants, source=elastic_friction())
         call at_instants%take_pairs(law%mu, law%present)
      end select
      at_instants%prediction = law%prediction
   end subroutine take_law

   !> Slopes of forces that follow from displacement and velocity at the same instant.
   subroutine differentiate_at_once(system, rows, fourier, self)
      class(balance_state), intent(in) :: system
      !> Coefficients of the relative displacements (2H+1, n_rows).
      real(wp), intent(in) :: rows(:, :)
      type(fourier_type), intent(in) :: fourier
      type(history_type), intent(inout) :: self
      real(wp) :: u(self%n_time, size(rows, 2)), v(self%n_time, size(rows, 2))
      real(wp) :: rates(size(rows, 1), size(rows, 2))
      real(wp) :: here(3), moves(3), force(3), slope(3, 3), depth
      integer :: c, i, k, n

      self%acts_at_once = .true.
      self%has_rates = .true.
      rates = rates_of(rows, system%frequency())
      u = matmul(transpose(fourier%synthesis), rows)
      v = matmul(transpose(fourier%synthesis), rates)
      n = size(self%row, 2)
      allocate (self%by_displacement(3, 3, n, self%n_time), source=0.0_wp)
      allocate (self%by_velocity, source=self%by_displacement)
      associate (p => self%law%prediction)
         do k = 1, self%n_time
            do i = 1, n
               here = 0.0_wp
               moves = 0.0_wp
               do c = 1, 3
                  if (self%row(c, i) == 0) cycle
                  here(c) = u(k, self%row(c, i))
                  moves(c) = v(k, self%row(c, i))
               end do
               depth = system%depth(i)
               if (allocated(p%gap_motion)) depth = depth + &
                  p%gap_motion%at_angle(i, 2.0_wp*pi*real(k - 1, wp)/self%n_time)
               call self%law%at_instant(i, self%law%input_at(i, here, moves, depth), force, slope)
               do c = 1, 3
                  if (p%order_of(i, c) > 0) then
                     self%by_velocity(:, c, i, k) = slope(c, :)*p%stiffness(i, c)
                  else
                     self%by_displacement(:, c, i, k) = slope(c, :)*p%stiffness(i, c)
                  end if
               end do
            end do
         end do
      end associate
   end subroutine differentiate_at_once

   !> Coefficients of the velocities.
   pure function rates_of(rows, omega) result(rates)
      real(wp), intent(in) :: rows(:, :), omega
      real(wp) :: rates(size(rows, 1), size(rows, 2))
      integer :: n

      rates = 0.0_wp
      do n = 1, (size(rows, 1) - 1)/2
         rates(2*n, :) = n*omega*rows(2*n + 1, :)
         rates(2*n + 1, :) = -n*omega*rows(2*n, :)
      end do
   end function rates_of

   !> Slopes of elements of several rows, or of velocities, along the period.
   subroutine differentiate_elements(law, row, rows, omega, fourier, self)
      class(instant_law), intent(in) :: law
      !> (input, element)
      integer, intent(in) :: row(:, :)
      real(wp), intent(in) :: rows(:, :), omega
      type(fourier_type), intent(in) :: fourier
      type(element_slopes), intent(out) :: self
      type(element_motion) :: motion
      real(wp) :: rates(size(rows, 1), size(rows, 2))
      integer :: c, i, n

      n = size(row, 1)
      self%row = row
      allocate (self%by_u(n, n, size(row, 2), fourier%n_time), source=0.0_wp)
      allocate (self%by_v, source=self%by_u)
      rates = rates_of(rows, omega)
      call reserve_motion(n, fourier%n_time, law%needs_scratch, motion)
      motion%omega = omega
      motion%wants_slopes = .true.
      do i = 1, size(row, 2)
         motion%element = i
         motion%u = 0.0_wp
         motion%v = 0.0_wp
         motion%by_u = 0.0_wp
         motion%by_v = 0.0_wp
         do c = 1, n
            if (row(c, i) == 0) cycle
            motion%u(c, :) = matmul(rows(:, row(c, i)), fourier%synthesis)
            motion%v(c, :) = matmul(rates(:, row(c, i)), fourier%synthesis)
         end do
         call law%act(motion)
         if (motion%status /= 0) self%refuses = i
         motion%status = 0
         self%by_u(:, :, i, :) = motion%by_u
         self%by_v(:, :, i, :) = motion%by_v
      end do
   end subroutine differentiate_elements

   !> Slopes of the laws other than that of the pairs.
   subroutine take_slopes(system, rows, fourier, self)
      class(balance_state), intent(in) :: system
      real(wp), intent(in) :: rows(:, :)
      type(fourier_type), intent(in) :: fourier
      type(history_type), intent(inout) :: self
      real(wp), allocatable :: elongation(:)
      integer :: i, k, n
      logical :: of_elements(system%problem%forces%n_laws)

      do k = 1, system%problem%forces%n_laws
         select type (law => system%problem%forces%entry(k)%law)
         class is (instant_law)
            of_elements(k) = .true.
         class default
            of_elements(k) = .false.
         end select
      end do
      allocate (self%elements(count(of_elements)))
      n = 0
      do k = 1, system%problem%forces%n_laws
         select type (law => system%problem%forces%entry(k)%law)
         class is (instant_law)
            n = n + 1
            call differentiate_elements(law, system%problem%forces%entry(k)%row, rows, &
                                        system%frequency(), fourier, self%elements(n))
            self%has_rates = self%has_rates .or. law%takes_rates
         end select
      end do
      allocate (self%pointwise_row(0))
      do k = 1, system%problem%forces%n_laws
         if (k == system%problem%forces%pairs .or. of_elements(k)) cycle
         self%pointwise_row = [self%pointwise_row, system%problem%forces%entry(k)%row(1, :)]
      end do
      allocate (self%slope(size(self%pointwise_row), self%n_time))
      n = 0
      do k = 1, system%problem%forces%n_laws
         if (k == system%problem%forces%pairs .or. of_elements(k)) cycle
         do i = 1, size(system%problem%forces%entry(k)%row, 2)
            n = n + 1
            elongation = matmul(rows(:, self%pointwise_row(n)), fourier%synthesis)
            self%slope(n, :) = system%problem%forces%entry(k)%law%slope_at(i, elongation)
         end do
      end do
   end subroutine take_slopes

   !> Pairs that slipped on the way to their period and stick in all of it (shakedown) stick: where
   !> they rest is no vibration.
   pure subroutine find_settled(self)
      class(history_type), intent(inout) :: self
      ! At the ends of its path such a pair touches the cone, to round-off.
      real(wp), parameter :: round_off = 1.0e-9_wp
      real(wp) :: d(2), p
      integer :: i, k, before
      logical :: sticks

      do i = 1, size(self%row, 2)
         if (.not. self%rubs(i)) cycle
         sticks = .true.
         ! A settled pair has d = y - x within its cone at every instant, x being that of the
         ! instant before.
         do k = 1, self%n_time
            before = modulo(k - 2, self%n_time) + 1
            p = -self%forces%prediction_time(i, 3, k)
            associate (y => self%forces%prediction_time(i, 1:2, :), &
                       force => self%forces%force_time(i, 1:2, :))
               d = y(:, k) - (y(:, before) - force(:, before))
            end associate
            sticks = p > 0.0_wp .and. norm2(d) <= self%law%mu(i)*p*(1.0_wp + round_off)
            if (.not. sticks) exit
         end do
         if (sticks) self%forces%state(i) = pair_stuck
      end do
   end subroutine find_settled

   !> Positions that slip or open pairs set anew. That of a pair that sticks throughout stays
   !> where it was put: a multiplier of exactly 1, which says nothing and is left out.
   pure subroutine find_memory(self)
      class(history_type), intent(inout) :: self
      integer :: i, c

      do i = 1, size(self%row, 2)
         if (.not. self%rubs(i)) cycle
         do c = 1, 2
            if (self%row(c, i) > 0) self%remembers(self%row(c, i)) = .true.
         end do
      end do
   end subroutine find_memory

   !> Whether a pair slips or opens at some time, with friction: its force depends on the past.
   pure logical function rubs(self, pair)
      class(history_type), intent(in) :: self
      integer, intent(in) :: pair

      rubs = .not. self%acts_at_once .and. self%law%mu(pair) > 0.0_wp .and. &
             any(self%row(1:2, pair) > 0) .and. &
             self%forces%state(pair) == pair_mixed
   end function rubs

   !> d force = by_u d u_r + by_v d v_r + by_x d x at an instant, and which rows keep their position
   !> there.
   pure subroutine derivatives(self, k, by_u, by_v, by_x, keeps)
      class(history_type), intent(in) :: self
      integer, intent(in) :: k
      !> (output row, input row) [force/length], [force time/length] and [1].
      real(wp), intent(out) :: by_u(:, :), by_v(:, :), by_x(:, :)
      logical, intent(out) :: keeps(:)
      real(wp) :: d(2), p, length
      integer :: i, before

      by_u = 0.0_wp
      by_v = 0.0_wp
      by_x = 0.0_wp
      keeps = .false.
      do i = 1, size(self%pointwise_row)
         by_u(self%pointwise_row(i), self%pointwise_row(i)) = self%slope(i, k)
      end do
      do i = 1, size(self%elements)
         call add_elements(self%elements(i), k, by_u, by_v)
      end do
      if (self%acts_at_once) then
         call take_at_once(self, k, by_u, by_v)
         return
      end if
      before = modulo(k - 2, self%n_time) + 1
      do i = 1, size(self%row, 2)
         p = -self%forces%prediction_time(i, 3, k)
         ! Open: no force, and x follows y. All derivatives stay zero.
         if (p <= 0.0_wp) cycle
         ! Whatever the state of a pair, its position is y - lambda.
         d = self%forces%prediction_time(i, 1:2, k) - &
             (self%forces%prediction_time(i, 1:2, before) - self%forces%force_time(i, 1:2, before))
         ! Predictor from the position of the instant before: beyond the cone mu p it slips.
         length = norm2(d)
         if (length > self%law%mu(i)*p) then
            call slip(self, i, self%law%mu(i)*p/length, d/length, by_u, by_x)
         else if (self%law%mu(i) > 0.0_wp) then
            call stick(self, i, by_u, by_x, keeps)
         end if
         if (self%row(3, i) > 0) then
            by_u(self%row(3, i), self%row(3, i)) = self%stiffness(self%row(3, i))
         end if
      end do
   end subroutine derivatives

   !> By the rows of the joint, which elements may share.
   pure subroutine add_elements(self, k, by_u, by_v)
      type(element_slopes), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(inout) :: by_u(:, :), by_v(:, :)
      integer :: b, c, i

      do i = 1, size(self%row, 2)
         do c = 1, size(self%row, 1)
            do b = 1, size(self%row, 1)
               associate (out => self%row(c, i), in => self%row(b, i))
                  if (out == 0 .or. in == 0) cycle
                  by_u(out, in) = by_u(out, in) + self%by_u(b, c, i, k)
                  by_v(out, in) = by_v(out, in) + self%by_v(b, c, i, k)
               end associate
            end do
         end do
      end do
   end subroutine add_elements

   !> By the rows of the joint.
   pure subroutine take_at_once(self, k, by_u, by_v)
      class(history_type), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(inout) :: by_u(:, :), by_v(:, :)
      integer :: b, c, i

      do i = 1, size(self%row, 2)
         do b = 1, 3
            do c = 1, 3
               associate (out => self%row(c, i), in => self%row(b, i))
                  if (out == 0 .or. in == 0) cycle
                  by_u(out, in) = self%by_displacement(c, b, i, k)
                  by_v(out, in) = self%by_velocity(c, b, i, k)
               end associate
            end do
         end do
      end do
   end subroutine take_at_once

   !> df = k du - dx, with x in units of force.
   pure subroutine stick(self, pair, by_u, by_x, keeps)
      class(history_type), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(inout) :: by_u(:, :), by_x(:, :)
      logical, intent(inout) :: keeps(:)
      integer :: c, row

      do c = 1, 2
         row = self%row(c, pair)
         if (row == 0) cycle
         by_u(row, row) = self%stiffness(row)
         by_x(row, row) = -1.0_wp
         keeps(row) = .true.
      end do
   end subroutine stick

   !> The force turns with the slip direction e and grows with the pressure.
   pure subroutine slip(self, pair, share, e, by_u, by_x)
      class(history_type), intent(in) :: self
      integer, intent(in) :: pair
      !> mu p/|d|.
      real(wp), intent(in) :: share, e(2)
      real(wp), intent(inout) :: by_u(:, :), by_x(:, :)
      real(wp) :: turn
      integer :: c, b, row, column, normal

      normal = self%row(3, pair)
      do c = 1, 2
         row = self%row(c, pair)
         if (row == 0) cycle
         do b = 1, 2
            column = self%row(b, pair)
            ! With one direction there is nothing to turn.
            if (any(self%row(1:2, pair) == 0)) cycle
            ! mu p d/|d|: its derivative by d is mu p/|d| (I - e e^T), by p it is mu e, with dp =
            ! -dy_n.
            turn = share*(merge(1.0_wp, 0.0_wp, b == c) - e(c)*e(b))
            by_u(row, column) = turn*self%stiffness(column)
            by_x(row, column) = -turn
         end do
         if (normal > 0) by_u(row, normal) = -self%law%mu(pair)*e(c)*self%stiffness(normal)
      end do
   end subroutine slip

end module fw_stability_history
