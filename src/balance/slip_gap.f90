!> Whether a solution of a rigid law is one of the friction problem. Where |lambda| <= Q holds and v
!> is the velocity of slip, Q |v| - lambda v is nowhere below zero, and zero at all times only where
!> friction opposes slip. What a period lacks of it,
!>
!>   g = 1 - D/P,   D = int lambda v,   P = int Q |v|,
!>
!> falls like 1/H for solutions that truncation alone keeps from the law: g H is 0.05 to 0.6 on
!> masses. Where the ripple of the truncated force decides the direction of slip, g stays, and g H
!> comes out at 3 and above: equations are solved, and friction is not.
!>
!> Only pairs are judged whose mass outweighs their spring above H. There the force of those
!> harmonics moves the pair against itself, -n**2 m omega**2 x_n = -lambda_n, while the law lets it
!> give way as a spring does. Massless pairs have the right sign, and g H is no measure of them:
!> they are right within a percent at g H = 1.5.
module fw_slip_gap
   use fw_balance_state, only: balance_state
   use fw_force_law, only: prediction_type
   use fw_kinds, only: pi, wp
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: lacks_friction

   !> g H above which friction is not solved.
   real(wp), parameter :: limit = 1.0_wp
   !> The same where no pair that is judged has a mass of its own: below what ripple makes of it.
   real(wp), parameter :: massless_limit = 3.0_wp
   !> Mass of its own, as a part of what moves along with it, below which a pair has none.
   real(wp), parameter :: least_mass = 1.0e-9_wp
   !> Above every mode [rad/s].
   real(wp), parameter :: above_all = 1.0e60_wp
   !> Slip below this part of Q/eps, in the mean of the pairs, is not judged: of pairs that hardly
   !> move, the ripple is all there is.
   real(wp), parameter :: least_slip = 0.05_wp
   !> Harmonics below which g is truncation, whatever it is.
   integer, parameter :: fewest_harmonics = 5
   !> Instants for each harmonic: kinks of |v| are then seen to a part in a thousand.
   integer, parameter :: instants_per_harmonic = 16

contains

   !> Whether the solution x, where the system was evaluated last, misses friction by more than its
   !> truncation.
   logical function lacks_friction(system, x) result(lacks)
      type(balance_state), intent(in) :: system
      !> (n_coordinates * n_coefficients).
      real(wp), intent(in), contiguous :: x(:)
      real(wp) :: done, possible, slip, size_of_slip, all_slip, all_sizes, most
      logical :: governs, is_massive
      integer :: i

      lacks = .false.
      if (system%problem%n_pairs == 0) return
      if (maxval(system%problem%fourier%harmonic) < fewest_harmonics) return
      done = 0.0_wp
      possible = 0.0_wp
      all_slip = 0.0_wp
      all_sizes = 0.0_wp
      most = massless_limit
      associate (problem => system%problem, &
                 p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         if (.not. p%takes_balance) return
         do i = 1, problem%n_pairs
            call judge_mass(system, i, governs, is_massive)
            if (p%drags(i)) cycle
            if (knows_tail(p, i) .or. .not. governs .or. .not. p%takes(i)) cycle
            if (is_massive) most = limit
            call add_pair(system, size(system%balance, 1), x, i, done, possible, slip, size_of_slip)
            all_slip = all_slip + slip
            all_sizes = all_sizes + size_of_slip
         end do
         if (all_slip <= least_slip*all_sizes) return
         ! g H > limit, without a division by a path of zero.
         lacks = maxval(problem%fourier%harmonic)*(possible - done) > most*possible
      end associate
   end function lacks_friction

   !> Whether the motion of a pair has harmonics above those of the balance: x is not its slip then.
   pure logical function knows_tail(prediction, pair)
      type(prediction_type), intent(in) :: prediction
      integer, intent(in) :: pair

      knows_tail = .false.
      if (prediction%has_inertia) knows_tail = any(prediction%inertia(pair, 1:2) > 0.0_wp)
   end function knows_tail

   !> Whether the structure is a mass rather than a spring to a tangential direction of a pair, at
   !> the first harmonic that the balance lacks, and whether that is a mass of its own: one that
   !> stays where every mode of the structure follows by its inertia.
   pure subroutine judge_mass(system, pair, governs, is_massive)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: pair
      logical, intent(out) :: governs, is_massive
      real(wp) :: first, m, c, k, own
      integer :: j

      governs = .false.
      is_massive = .false.
      associate (problem => system%problem)
         first = (maxval(problem%fourier%harmonic) + 1)*system%frequency()
         do j = 1, 2
            if (problem%joint%row(j, pair) == 0) cycle
            call problem%structure%split(problem%coordinate_of(j, pair), first, m, c, k)
            if (m*first**2 <= k) cycle
            governs = .true.
            call problem%structure%split(problem%coordinate_of(j, pair), above_all, own, &
                                         c, k)
            is_massive = is_massive .or. own > least_mass*m
         end do
      end associate
   end subroutine judge_mass

   !> Add int lambda v and int Q |v| of a pair; slip is its share of the latter times eps, and its
   !> size mean(Q)**2.
   subroutine add_pair(system, m, q, i, done, possible, slip, size_of_slip)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: m, i
      real(wp), intent(in) :: q(m, *)
      real(wp), intent(inout) :: done, possible
      real(wp), intent(out) :: slip, size_of_slip
      real(wp) :: u(2, system%problem%fourier%n_coefficients)
      real(wp) :: path, work
      integer :: c, h, k, n

      work = 0.0_wp
      u = 0.0_wp
      associate (problem => system%problem, fourier => system%problem%fourier, &
                 force => system%work(system%problem%forces%pairs)%force)
         do c = 1, 2
            if (problem%joint%row(c, i) == 0) cycle
            u(c, :) = q(problem%coordinate_of(c, i), :fourier%n_coefficients)
            do h = 1, fourier%n_retained
               n = fourier%harmonic(h)
               if (n == 0) cycle
               k = fourier%column(h)
               ! int lambda du over a period, u = u_c cos n tau + u_s sin n tau.
               work = work + pi*n*(force(i, c, k)*u(c, k + 1) - force(i, c, k + 1)*u(c, k))
            end do
         end do
         call friction_path(system, i, u, path, size_of_slip)
         slip = path*problem%forces%entry(problem%forces%pairs)%law%prediction%stiffness(i, 1)
      end associate
      done = done + work
      possible = possible + path
   end subroutine add_pair

   !> int mu N |v| of a pair over the period, and the square of the mean of mu N.
   subroutine friction_path(system, i, u, path, square)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: i
      !> Tangential displacement (2, n_coefficients).
      real(wp), intent(in) :: u(:, :)
      real(wp), intent(out) :: path, square
      real(wp) :: v(2), pressure, tau, mean
      integer :: h, k, n, step, n_steps

      associate (fourier => system%problem%fourier, pairs => system%problem%forces%pairs)
         n_steps = instants_per_harmonic*maxval(fourier%harmonic)
         path = 0.0_wp
         mean = 0.0_wp
         do step = 1, n_steps
            tau = 2.0_wp*pi*step/n_steps
            v = 0.0_wp
            pressure = normal_load(system, i, tau)
            do h = 1, fourier%n_retained
               n = fourier%harmonic(h)
               if (n == 0) cycle
               k = fourier%column(h)
               ! dx/dtau.
               v = v + n*(u(:, k + 1)*cos(n*tau) - u(:, k)*sin(n*tau))
            end do
            path = path + pressure*norm2(v)
            mean = mean + pressure
         end do
      end associate
      ! The rule of rectangles, which is that of trapezoids for a period.
      path = path*2.0_wp*pi/n_steps
      square = (mean/n_steps)**2
   end subroutine friction_path

   !> mu N at an angle: of the harmonics of the balance, and not below zero.
   pure real(wp) function normal_load(system, i, tau) result(limit_force)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: i
      real(wp), intent(in) :: tau
      integer :: h, k, n

      associate (problem => system%problem, list => system%problem%forces, &
                 fourier => system%problem%fourier)
         limit_force = list%entry(list%pairs)%law%prediction%load(i)
         if (problem%joint%row(3, i) > 0) then
            limit_force = 0.0_wp
            associate (force => system%work(list%pairs)%force)
               do h = 1, fourier%n_retained
                  n = fourier%harmonic(h)
                  k = fourier%column(h)
                  ! A pressure is minus the force, which opens.
                  limit_force = limit_force - force(i, 3, k)*cos(n*tau)
                  if (n > 0) limit_force = limit_force - force(i, 3, k + 1)*sin(n*tau)
               end do
            end associate
         end if
         select type (law => list%entry(list%pairs)%law)
         class is (pair_law)
            limit_force = law%friction_of(i, system%work(list%pairs))*max(limit_force, 0.0_wp)
         end select
      end associate
   end function normal_load

end module fw_slip_gap
