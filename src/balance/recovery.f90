!> From a solution of the balance to what is reported of it: observed quantities, amplitudes,
!> contact forces, states and friction energy.
module fw_recovery
   use fw_kinds, only: wp, pi
   use fw_fourier, only: coefficient_count, fourier_type, to_complex
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_open, prediction_type
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: observe, observed_coefficients, recover_point, recover_histories
   public :: largest_magnitude, carry_solution, overtaking_of, peak_angles

   !> Angles of the grid on which peaks are looked for, over those of the highest wave.
   integer, parameter :: points_per_wave = 16

contains

   !> Fill a point from the solution x, where the system was evaluated last; with_contact adds
   !> forces, states and dissipation.
   subroutine recover_point(system, x, n_harmonics, with_contact, point)
      type(balance_state), intent(inout) :: system
      !> Coordinates (n_coordinates, n_coefficients), flat.
      real(wp), intent(in), contiguous :: x(:)
      !> H of the result, whatever harmonics were computed.
      integer, intent(in) :: n_harmonics
      logical, intent(in) :: with_contact
      type(point_type), intent(inout) :: point
      complex(wp) :: q(system%problem%structure%n_coordinates, system%problem%fourier%n_retained)
      integer :: i

      call observed_coefficients(system, x, n_harmonics, point%coefficients)
      call to_complex(system%problem%fourier, size(q, 1), x, q)
      point%structural_work = system%problem%structure%structural_work(system%structure_state, q)
      if (allocated(system%scratch%grid_waves)) then
         ! Another number of harmonics.
         if (size(system%scratch%grid_waves, 1) /= grid_size(n_harmonics)/4 + 1) then
            deallocate (system%scratch%grid_waves)
         end if
      end if
      if (.not. allocated(system%scratch%grid_waves)) then
         system%scratch%grid_waves = grid_waves(n_harmonics)
      end if
      point%amplitude = [(largest_on(point%coefficients(:, i), system%scratch%grid_waves), &
                          i=1, system%problem%structure%n_observed)]
      associate (pairs => system%problem%forces%pairs)
         i = system%problem%forces%entry(pairs)%law%instants_wanted(system%work(pairs))
      end associate
      if (i > system%problem%fourier%n_time) point%instants_wanted = i
      if (with_contact .and. system%problem%n_pairs > 0) call recover_contact(system, x, &
         n_harmonics, point)
      if (with_contact) call find_element_work(system, n_harmonics, point)
      call find_overtaking(system, x, point)
   end subroutine recover_point

   !> Whether pairs that bear overtake the side 2 that slides under them.
   subroutine find_overtaking(system, x, point)
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(point_type), intent(inout) :: point
      real(wp) :: motion(2*maxval(system%problem%fourier%harmonic) + 1, 2)
      real(wp), allocatable :: u(:, :, :)
      integer :: h, i, k, n

      associate (problem => system%problem, entry => system%problem%forces%entry, &
                 pairs => system%problem%forces%pairs)
         if (.not. allocated(entry(pairs)%law%prediction%speed)) return
         ! Another motion of the same point.
         if (allocated(point%overtaking)) deallocate (point%overtaking)
         allocate (point%overtaking(problem%n_pairs), source=0.0_wp)
         allocate (u(problem%n_pairs, 3, problem%fourier%n_coefficients))
         call problem%incidence%gather(entry(pairs)%rows, problem%structure%n_coordinates, &
                                       problem%fourier%n_coefficients, x, u)
         do i = 1, problem%n_pairs
            if (system%work(pairs)%state(i) == pair_open) cycle
            motion = 0.0_wp
            do h = 1, problem%fourier%n_retained
               n = problem%fourier%harmonic(h)
               k = problem%fourier%column(h)
               if (n > 0) motion(2*n:2*n + 1, :) = transpose(u(i, :2, k:k + 1))
            end do
            point%overtaking(i) = overtaking_of(motion, entry(pairs)%law%prediction%speed(i, :), &
                                                system%frequency())
         end do
      end associate
   end subroutine find_overtaking

   !> The largest velocity of a motion along that of a surface, as a part of this.
   pure real(wp) function overtaking_of(motion, speed, omega) result(part)
      !> Coefficients (0, c1, s1, ...) along t1 and t2 (2H+1, 2) [length], velocity of the surface
      !> (2) [length/time] and the frequency.
      real(wp), intent(in) :: motion(:, :), speed(2), omega
      real(wp) :: along(size(motion, 1)), rate(size(motion, 1))
      integer :: n

      part = 0.0_wp
      if (.not. norm2(speed) > 0.0_wp) return
      along = matmul(motion, speed)/norm2(speed)
      rate = 0.0_wp
      do n = 1, (size(rate) - 1)/2
         rate(2*n) = n*omega*along(2*n + 1)
         rate(2*n + 1) = -n*omega*along(2*n)
      end do
      part = largest_magnitude(rate)/norm2(speed)
   end function overtaking_of

   !> Observed quantities where the system stands, complex amplitudes (n_observed, n_retained).
   subroutine observe(system, x, observed)
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      complex(wp), intent(out), contiguous :: observed(:, :)
      complex(wp), allocatable :: q(:, :)

      associate (m => system%problem%structure%n_coordinates)
         allocate (q(m, system%problem%fourier%n_retained))
         call to_complex(system%problem%fourier, m, x, q)
      end associate
      call system%problem%structure%recover(system%structure_state, q, observed)
   end subroutine observe

   !> The same as coefficients (0, c1, s1, ...) (2H+1, n_observed).
   subroutine observed_coefficients(system, x, n_harmonics, coefficients)
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: n_harmonics
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      complex(wp), allocatable :: observed(:, :)
      integer :: h, n, n_observed

      n_observed = system%problem%structure%n_observed
      allocate (observed(n_observed, system%problem%fourier%n_retained))
      call observe(system, x, observed)
      allocate (coefficients(2*n_harmonics + 1, n_observed), source=0.0_wp)
      do h = 1, system%problem%fourier%n_retained
         n = system%problem%fourier%harmonic(h)
         if (n == 0) then
            coefficients(1, :) = real(observed(:, h), wp)
         else
            coefficients(2*n, :) = real(observed(:, h), wp)
            ! U_n = uc_n - i us_n.
            coefficients(2*n + 1, :) = -aimag(observed(:, h))
         end if
      end do
   end subroutine observed_coefficients

   !> Carry a solution between systems of one case, condensed or whole, with more or fewer
   !> harmonics: the relative coordinates are the first of all; harmonics and internal modes that
   !> only the target has start at zero.
   pure subroutine carry_solution(source, x, target, y)
      type(balance_state), intent(in) :: source, target
      !> Unknowns of either system, flat with the coordinates innermost.
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: y(:)
      integer :: h, j, c

      y = 0.0_wp
      do h = 1, target%problem%fourier%n_retained
         ! By its number: retained harmonics of both may differ in their places.
         j = findloc(source%problem%fourier%harmonic, target%problem%fourier%harmonic(h), dim=1)
         if (j == 0) cycle
         do c = 0, merge(0, 1, target%problem%fourier%harmonic(h) == 0)
            call carry_coefficient(source, x, source%problem%fourier%column(j) + c, target, &
                                   target%problem%fourier%column(h) + c, y)
         end do
      end do
   end subroutine carry_solution

   !> The coordinates of one coefficient.
   pure subroutine carry_coefficient(source, x, from, target, to, y)
      type(balance_state), intent(in) :: source, target
      real(wp), intent(in) :: x(:)
      integer, intent(in) :: from, to
      real(wp), intent(inout) :: y(:)
      integer :: i, j, first_x, first_y, n_relative

      n_relative = source%problem%structure%n_relative
      ! All coordinates of a coefficient stand together: relative ones, then kept modes.
      first_x = (from - 1)*source%problem%structure%n_coordinates
      first_y = (to - 1)*target%problem%structure%n_coordinates
      y(first_y + 1:first_y + n_relative) = x(first_x + 1:first_x + n_relative)
      do i = 1, size(source%problem%structure%kept)
         j = findloc(target%problem%structure%kept, source%problem%structure%kept(i), dim=1)
         if (j > 0) y(first_y + n_relative + j) = x(first_x + n_relative + i)
      end do
   end subroutine carry_coefficient

   !> Forces, shares of stick, slip and open, and friction energy per cycle, at the point where the
   !> system was evaluated last. The forces of retained harmonics are those that balance the
   !> equations, which need not be the projection of their histories (collocation); even harmonics
   !> that are left out hold the normal load.
   subroutine recover_contact(system, x, n_harmonics, point)
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: force(:, :, :)
      integer :: n_pairs, pairs, h, k, n

      n_pairs = system%problem%n_pairs
      pairs = system%problem%forces%pairs
      allocate (force(n_pairs, 3, coefficient_count(n_harmonics)))
      ! Harmonics were left out: those come from the law, the retained ones follow below.
      if (system%problem%fourier%n_retained <= n_harmonics) then
         call system%scratch%make_all_harmonics(n_harmonics, system%problem%fourier%n_time)
         call system%problem%forces%entry(pairs)%law%coefficients(system%work(pairs), &
                                                                  system%problem%fourier, &
                                                          system%scratch%all_harmonics, force)
      end if
      do h = 1, system%problem%fourier%n_retained
         n = system%problem%fourier%harmonic(h)
         do k = 0, merge(0, 1, n == 0)
            force(:, :, max(1, 2*n) + k) = &
               system%work(pairs)%force(:, :, system%problem%fourier%column(h) + k)
         end do
      end do
      allocate (point%force(3, n_pairs, size(force, 3)))
      do k = 1, size(force, 3)
         point%force(:, :, k) = transpose(force(:, :, k))
      end do
      allocate (point%fraction(3, n_pairs))
      call system%problem%forces%entry(pairs)%law%fractions(system%work(pairs), point%fraction)
      call dissipated_energy(system, size(system%balance, 1), x, point)
   end subroutine recover_contact

   !> Work of the contact forces over a cycle, sum_n pi n (lambda_c u_s - lambda_s u_c).
   subroutine dissipated_energy(system, m, q, point)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: m
      !> Coordinates of the last evaluation (m, n_coefficients).
      real(wp), intent(in) :: q(m, *)
      type(point_type), intent(inout) :: point
      real(wp) :: u(system%problem%n_pairs, 3, system%problem%fourier%n_coefficients)
      integer :: i, h, k

      allocate (point%dissipation(system%problem%n_pairs), source=0.0_wp)
      allocate (point%obstacle_work(system%problem%n_pairs), source=0.0_wp)
      associate (f => system%work(system%problem%forces%pairs)%force, &
                 rows => system%problem%forces%entry(system%problem%forces%pairs)%rows)
         call system%problem%incidence%gather(rows, m, system%problem%fourier%n_coefficients, q, u)
         do h = 1, system%problem%fourier%n_retained
            if (system%problem%fourier%harmonic(h) == 0) cycle
            k = system%problem%fourier%column(h)
            do i = 1, system%problem%n_pairs
               ! Harmonic 0 does no work over a cycle.
               point%dissipation(i) = point%dissipation(i) + pi* &
                                      system%problem%fourier%harmonic(h)* &
                                      sum(f(i, :, k)*u(i, :, k + 1) - f(i, :, k + 1)*u(i, :, k))
            end do
         end do
         call add_obstacles( &
            system%problem%forces%entry(system%problem%forces%pairs)%law%prediction, &
            system%problem%fourier, system%frequency(), f, point)
      end associate
   end subroutine dissipated_energy

   !> What obstacles that move bring in is heat, too: their forces are minus those on the structure,
   !> so that their work is that of the contact forces along the gaps, and against the speeds.
   subroutine add_obstacles(prediction, fourier, omega, force, point)
      type(prediction_type), intent(in) :: prediction
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      real(wp), intent(in) :: force(:, :, :)
      type(point_type), intent(inout) :: point
      integer :: c

      if (allocated(prediction%gap_motion)) point%obstacle_work = &
         prediction%gap_motion%work_of(fourier, force(:, 3, :))
      if (allocated(prediction%speed) .and. fourier%has_constant()) then
         do c = 1, 2
            point%obstacle_work = point%obstacle_work - &
                                  2.0_wp*pi/omega*prediction%speed(:, c)*force(:, c, 1)
         end do
      end if
      point%dissipation = point%dissipation + point%obstacle_work
   end subroutine add_obstacles

   !> Work of the elements that are neither pairs nor springs, whose inputs are displacements, where
   !> the system was evaluated last.
   subroutine find_element_work(system, n_harmonics, point)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      integer :: h, i, k, kind

      if (.not. allocated(system%problem%forces%elements)) return
      associate (kinds => system%problem%forces%elements, fourier => system%problem%fourier)
         allocate (point%work_of(size(kinds)))
         do kind = 1, size(kinds)
            if (kinds(kind) == 0) cycle
            associate (f => system%work(kinds(kind))%force, &
                       u => system%work(kinds(kind))%prediction)
               allocate (point%work_of(kind)%values(size(f, 1)), source=0.0_wp)
               call collect_forces(fourier, f, n_harmonics, point%work_of(kind)%force)
               do h = 1, fourier%n_retained
                  if (fourier%harmonic(h) == 0) cycle
                  k = fourier%column(h)
                  do i = 1, size(f, 1)
                     point%work_of(kind)%values(i) = point%work_of(kind)%values(i) + &
                        pi*fourier%harmonic(h)*sum(f(i, :, k)*u(i, :, k + 1) - &
                                                   f(i, :, k + 1)*u(i, :, k))
                  end do
               end do
            end associate
         end do
      end associate
   end subroutine find_element_work

   !> Coefficients of forces in the order of a result.
   subroutine collect_forces(fourier, f, n_harmonics, force)
      type(fourier_type), intent(in) :: fourier
      !> (element, input, coefficient)
      real(wp), intent(in) :: f(:, :, :)
      integer, intent(in) :: n_harmonics
      real(wp), allocatable, intent(out) :: force(:, :, :)
      integer :: c, h, k, n

      allocate (force(size(f, 2), size(f, 1), coefficient_count(n_harmonics)), source=0.0_wp)
      do h = 1, fourier%n_retained
         n = fourier%harmonic(h)
         k = fourier%column(h)
         if (n > n_harmonics) cycle
         do c = 0, merge(0, 1, n == 0)
            force(:, :, max(1, 2*n) + c) = transpose(f(:, :, k + c))
         end do
      end do
   end subroutine collect_forces

   !> One period of the observed quantities and of the contact forces and displacements.
   subroutine recover_histories(system, m, q, n_harmonics, point)
      type(balance_state), intent(inout) :: system
      integer, intent(in) :: m
      real(wp), intent(in) :: q(m, *)
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: slip(:, :), slip_time(:, :)
      integer :: k, n_pairs, n_time, pairs

      n_pairs = system%problem%n_pairs
      n_time = system%problem%fourier%n_time
      call system%scratch%make_all_harmonics(n_harmonics, n_time)
      point%history = matmul(transpose(system%scratch%all_harmonics%synthesis), &
                             point%coefficients)
      if (n_pairs == 0) return
      allocate (slip(3*n_pairs, system%problem%fourier%n_coefficients))
      allocate (slip_time(3*n_pairs, n_time))
      call system%problem%incidence%gather(reshape(system%problem%joint%row, [3*n_pairs]), m, &
                                   system%problem%fourier%n_coefficients, q, slip)
      slip_time = matmul(slip, system%problem%fourier%synthesis)
      ! Rows ran component by component of each pair, as (3, n_pairs) does.
      point%slip_history = reshape(slip_time, [3, n_pairs, n_time])
      pairs = system%problem%forces%pairs
      call system%problem%forces%entry(pairs)%law%sample(system%work(pairs))
      allocate (point%force_history(3, n_pairs, n_time))
      do k = 1, n_time
         point%force_history(:, :, k) = transpose(system%work(pairs)%force_time(:, :, k))
      end do
   end subroutine recover_histories

   !> Largest magnitude over the period of u(tau) given by (0, c1, s1, ...): a grid fine enough to
   !> bracket every extremum, then Newton's method on the slope.
   pure real(wp) function largest_magnitude(coefficients) result(largest)
      !> Mean, then cosine and sine of each harmonic (2H+1).
      real(wp), intent(in) :: coefficients(:)

      largest = largest_on(coefficients, grid_waves((size(coefficients) - 1)/2))
   end function largest_magnitude

   !> The same with the first waves on the grid, which many quantities share.
   pure real(wp) function largest_on(coefficients, waves) result(largest)
      real(wp), intent(in) :: coefficients(:), waves(0:, :)
      integer, parameter :: newton_steps = 4
      real(wp) :: value, slope, curvature, tau, spacing, step, on_grid
      integer :: k, i, n_grid, n_harmonics
      real(wp), allocatable :: grid(:)

      n_harmonics = (size(coefficients) - 1)/2
      n_grid = grid_size(n_harmonics)
      spacing = 2.0_wp*pi/real(n_grid, wp)
      allocate (grid(0:n_grid + 1))
      call evaluate_grid(coefficients, n_grid, waves, grid)
      on_grid = maxval(abs(grid))
      largest = on_grid
      do k = 1, n_grid
         if (abs(grid(k)) < max(abs(grid(k - 1)), abs(grid(k + 1)))) cycle
         ! A peak between grid points exceeds the grid by at most (H spacing)^2/8 of the largest.
         if (abs(grid(k)) < 0.97_wp*on_grid) cycle
         tau = k*spacing
         do i = 1, newton_steps
            call evaluate(coefficients, tau, value, slope, curvature)
            if (abs(curvature) <= 0.0_wp) exit
            step = -slope/curvature
            ! No further than a cell: beyond it another extremum would be found twice.
            tau = tau + max(-spacing, min(spacing, step))
         end do
         call evaluate(coefficients, tau, value, slope, curvature)
         largest = max(largest, abs(value))
      end do
   end function largest_on

   !> Where |u(tau)| is largest, as largest_magnitude finds it, and where a second peak is as high;
   !> of more than two the first and the last.
   pure subroutine peak_angles(coefficients, largest, n_peaks, angle, side)
      real(wp), intent(in) :: coefficients(:)
      real(wp), intent(out) :: largest
      !> 1, or 2 where peaks are alike.
      integer, intent(out) :: n_peaks
      !> Angles of the peaks and signs of u there.
      real(wp), intent(out) :: angle(2), side(2)
      integer, parameter :: newton_steps = 8
      !> Peaks that differ by less are alike: beyond it one of the two decides.
      real(wp), parameter :: alike = 1.0e-9_wp
      real(wp) :: value, slope, curvature, tau, spacing
      real(wp), allocatable :: grid(:)
      integer :: k, i, n_grid

      n_grid = grid_size((size(coefficients) - 1)/2)
      spacing = 2.0_wp*pi/real(n_grid, wp)
      largest = largest_magnitude(coefficients)
      allocate (grid(0:n_grid + 1))
      call evaluate_grid(coefficients, n_grid, grid_waves((size(coefficients) - 1)/2), grid)
      n_peaks = 0
      angle = 0.0_wp
      side = 0.0_wp
      do k = 1, n_grid
         if (abs(grid(k)) < max(abs(grid(k - 1)), abs(grid(k + 1)))) cycle
         tau = k*spacing
         do i = 1, newton_steps
            call evaluate(coefficients, tau, value, slope, curvature)
            if (abs(curvature) <= 0.0_wp) exit
            tau = tau - max(-spacing, min(spacing, slope/curvature))
         end do
         call evaluate(coefficients, tau, value, slope, curvature)
         if (abs(value) < (1.0_wp - alike)*largest) cycle
         ! Two points of the grid that are as high share a peak.
         if (n_peaks > 0) then
            if (minval(1.0_wp - cos(tau - angle(:n_peaks))) < spacing**2/8.0_wp) cycle
         end if
         n_peaks = min(2, n_peaks + 1)
         angle(n_peaks) = tau
         side(n_peaks) = sign(1.0_wp, value)
      end do
   end subroutine peak_angles

   !> Angles of the grid on a period, a multiple of 8.
   pure integer function grid_size(n_harmonics)
      integer, intent(in) :: n_harmonics

      grid_size = points_per_wave*max(1, n_harmonics)
   end function grid_size

   !> Cosine and sine of the angles of a quarter of the grid (0:n_grid/4, 2).
   pure function grid_waves(n_harmonics) result(waves)
      integer, intent(in) :: n_harmonics
      real(wp), allocatable :: waves(:, :)
      real(wp) :: angle
      integer :: k, quarter

      quarter = grid_size(n_harmonics)/4
      allocate (waves(0:quarter, 2))
      do k = 0, quarter/2
         angle = 0.5_wp*pi*real(k, wp)/real(quarter, wp)
         ! Cosines of the one half are the sines of the other.
         waves(k, 1) = cos(angle)
         waves(k, 2) = sin(angle)
         waves(quarter - k, 1) = waves(k, 2)
         waves(quarter - k, 2) = waves(k, 1)
      end do
   end function grid_waves

   !> u at n_grid angles of a period, a multiple of 8, and one beyond each end. Cosines are even and
   !> sines odd, and waves of odd numbers turn their signs in the second quarter: a quarter of the
   !> angles serves for all. These at once, so that a processor turns several waves by one
   !> instruction.
   pure subroutine evaluate_grid(coefficients, n_grid, waves, grid)
      real(wp), intent(in) :: coefficients(:)
      integer, intent(in) :: n_grid
      !> Cosine and sine of the angles of the first quarter.
      real(wp), intent(in) :: waves(0:n_grid/4, 2)
      real(wp), intent(out) :: grid(0:n_grid + 1)
      !> Waves, and the sums of cosines and of sines, of even and of odd numbers.
      real(wp), dimension(0:n_grid/4) :: c, s
      real(wp), dimension(0:n_grid/4, 0:1) :: cosines, sines
      real(wp) :: before
      integer :: half, k, n, parity, quarter

      quarter = n_grid/4
      half = n_grid/2
      c = 1.0_wp
      s = 0.0_wp
      cosines(:, 0) = coefficients(1)
      cosines(:, 1) = 0.0_wp
      sines = 0.0_wp
      do n = 1, (size(coefficients) - 1)/2
         parity = modulo(n, 2)
         do k = 0, quarter
            before = c(k)
            c(k) = before*waves(k, 1) - s(k)*waves(k, 2)
            s(k) = before*waves(k, 2) + s(k)*waves(k, 1)
            cosines(k, parity) = cosines(k, parity) + coefficients(2*n)*c(k)
            sines(k, parity) = sines(k, parity) + coefficients(2*n + 1)*s(k)
         end do
      end do
      do k = 0, quarter
         grid(half - k) = cosines(k, 0) - cosines(k, 1) + sines(k, 1) - sines(k, 0)
         grid(half + k) = cosines(k, 0) - cosines(k, 1) - sines(k, 1) + sines(k, 0)
         grid(k) = cosines(k, 0) + cosines(k, 1) + sines(k, 1) + sines(k, 0)
         grid(n_grid - k) = cosines(k, 0) + cosines(k, 1) - sines(k, 1) - sines(k, 0)
      end do
      grid(n_grid:) = grid(:1)
   end subroutine evaluate_grid

   !> u, u' and u'' at an angle, by turning a unit vector from harmonic to harmonic.
   pure subroutine evaluate(coefficients, tau, value, slope, curvature)
      real(wp), intent(in) :: coefficients(:), tau
      real(wp), intent(out) :: value, slope, curvature
      real(wp) :: c, s
      complex(wp) :: turn, angle
      integer :: n

      turn = cmplx(cos(tau), sin(tau), wp)
      angle = (1.0_wp, 0.0_wp)
      value = coefficients(1)
      slope = 0.0_wp
      curvature = 0.0_wp
      do n = 1, (size(coefficients) - 1)/2
         angle = angle*turn
         ! The wave n, and its slope over n.
         c = coefficients(2*n)*real(angle) + coefficients(2*n + 1)*aimag(angle)
         s = coefficients(2*n + 1)*real(angle) - coefficients(2*n)*aimag(angle)
         value = value + c
         slope = slope + n*s
         curvature = curvature - real(n, wp)**2*c
      end do
   end subroutine evaluate

end module fw_recovery
