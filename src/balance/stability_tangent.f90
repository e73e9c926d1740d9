!> Derivative of the nonlinear forces at a periodic solution, as an operator between the Fourier
!> coefficients 0..H' of a perturbation, one term a row of the joint: force = block * displacement.
!>
!> Springs and unilateral contact act at an instant, so that the block is the multiplication by
!> the slope s(tau). That of a spring is a polynomial in tau, integrated without error. That of a
!> contact jumps between 0 and k: its coefficients come from the instants where the gap closes
!> and opens, found on the polynomial itself, so that the sampling leaves no error either.
!>
!> Friction that slips depends on the past and has no place here: see fw_stability_march.
module fw_stability_tangent
   use fw_force_law, only: pair_stuck
   use fw_fourier, only: coefficient_count, fourier_type, new_fourier
   use fw_balance_state, only: balance_state
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: tangent_type, new_tangent, relative_displacements

   type :: tangent_type
      !> Harmonics of the perturbation, H', and its real coefficients per row.
      integer :: n_harmonics = 0
      integer :: n_coefficients = 0
      integer :: n_terms = 0
      !> Rows of the joint (n_terms).
      integer, allocatable :: row(:)
      !> (output coefficient, input coefficient, term) [force/length].
      real(wp), allocatable :: block(:, :, :)
   end type tangent_type

   !> Points per harmonic between which a gap is taken to change its sign once at most.
   integer, parameter :: points_per_harmonic = 32

contains

   !> The derivative at the solution x of a system (penalty law and springs).
   subroutine new_tangent(system, x, state, n_harmonics, self)
      class(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      !> What the pairs do (n_pairs); those with friction are stuck or open.
      integer, intent(in) :: state(:)
      !> H', at least the highest harmonic of the solution.
      integer, intent(in) :: n_harmonics
      type(tangent_type), intent(out) :: self
      real(wp), allocatable :: rows(:, :)
      integer :: k, n_terms

      self%n_harmonics = n_harmonics
      self%n_coefficients = coefficient_count(n_harmonics)
      n_terms = 0
      do k = 1, system%problem%forces%n_laws
         ! At most: pairs without friction have one term, open ones none.
         n_terms = n_terms + count(system%problem%forces%entry(k)%row > 0)
      end do
      allocate (self%row(n_terms))
      allocate (self%block(self%n_coefficients, self%n_coefficients, n_terms))
      call relative_displacements(system, system%problem%structure%n_coordinates, x, &
                                  n_harmonics, rows)
      call add_pointwise(system, rows, self)
      call add_gaps(system, rows, self)
      call add_stuck(system, state, self)
   end subroutine new_tangent

   !> Coefficients 0..H' of the relative displacement of every row (2H'+1, n_rows).
   pure subroutine relative_displacements(system, m, q, n_harmonics, rows)
      class(balance_state), intent(in) :: system
      integer, intent(in) :: m, n_harmonics
      real(wp), intent(in) :: q(m, *)
      real(wp), allocatable, intent(out) :: rows(:, :)
      real(wp) :: u(system%problem%fourier%n_coefficients)
      integer :: row, h, n, k

      associate (b => system%problem%incidence, f => system%problem%fourier)
         allocate (rows(coefficient_count(n_harmonics), b%n_rows), source=0.0_wp)
         do row = 1, b%n_rows
            call b%gather_row(row, b%identity, m, 1.0_wp, q, u)
            do h = 1, f%n_retained
               n = f%harmonic(h)
               k = f%column(h)
               if (n == 0) rows(1, row) = u(k)
               if (n > 0) rows(2*n:2*n + 1, row) = u(k:k + 1)
            end do
         end do
      end associate
   end subroutine relative_displacements

   !> Laws other than that of the pairs, whose force depends on the displacement at the instant.
   subroutine add_pointwise(system, rows, self)
      class(balance_state), intent(in) :: system
      real(wp), intent(in) :: rows(:, :)
      type(tangent_type), intent(inout) :: self
      type(fourier_type) :: fourier
      real(wp), allocatable :: elongation(:)
      integer :: i, k, row

      do k = 1, system%problem%forces%n_laws
         if (k == system%problem%forces%pairs) cycle
         associate (law => system%problem%forces%entry(k)%law)
            ! Exact: the slope has power - 1 times the harmonics, the block adds two times H'.
            fourier = new_fourier(self%n_harmonics, &
                                  max(4, law%facts%instants_per_harmonic)*self%n_harmonics + 2)
            do i = 1, law%n_elements
               row = system%problem%forces%entry(k)%row(1, i)
               ! Where the solution is at the instants; the force is pointwise, and so is its
               ! slope.
               elongation = matmul(rows(:, row), fourier%synthesis)
               call add_multiplication(fourier, law%slope_at(i, elongation), row, self)
            end do
         end associate
      end do
   end subroutine add_pointwise

   !> Pairs that bear without friction.
   subroutine add_gaps(system, rows, self)
      class(balance_state), intent(in) :: system
      real(wp), intent(in) :: rows(:, :)
      type(tangent_type), intent(inout) :: self
      type(fourier_type) :: fourier, wide
      real(wp), allocatable :: gap(:), slope(:)
      integer :: i, row

      ! A slope of 2 H' harmonics times a perturbation and a test function of H' each: 4 H'
      ! harmonics, which 4 H' + 2 instants integrate without error.
      fourier = new_fourier(self%n_harmonics, 4*self%n_harmonics + 2)
      wide = new_fourier(2*self%n_harmonics, 4*self%n_harmonics + 2)
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         do i = 1, system%problem%n_pairs
            row = system%problem%joint%row(3, i)
            ! Those with friction are stuck or open throughout: add_stuck has the former.
            if (row == 0 .or. has_friction(system, i)) cycle
            gap = rows(:, row)
            if (allocated(p%gap_motion)) call p%gap_motion%add_to_row(i, gap)
            ! Negative where the pair is pressed: wear opens it.
            gap(1) = gap(1) + p%gap(i) + system%depth(i)
            ! Harmonics above 2 H' of the slope couple nothing.
            slope = matmul(closed_share(gap, 2*self%n_harmonics), wide%synthesis)
            slope = p%stiffness(i, 3)*slope
            call add_multiplication(fourier, slope, row, self)
         end do
      end associate
   end subroutine add_gaps

   !> Whether anything resists a tangential motion of the pair.
   pure logical function has_friction(system, pair)
      class(balance_state), intent(in) :: system
      integer, intent(in) :: pair

      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         has_friction = law%slope_at_rest(pair, 1) > 0.0_wp .or. law%slope_at_rest(pair, 2) > 0.0_wp
      end associate
   end function has_friction

   !> The operator of a product with slope(tau), projected: a term from a row to itself.
   pure subroutine add_multiplication(fourier, slope, row, self)
      type(fourier_type), intent(in) :: fourier
      !> At the instants (n_time).
      real(wp), intent(in) :: slope(:)
      integer, intent(in) :: row
      type(tangent_type), intent(inout) :: self
      real(wp) :: weighted(fourier%n_time, fourier%n_coefficients)
      integer :: k

      do k = 1, fourier%n_time
         weighted(k, :) = slope(k)*fourier%synthesis(:, k)
      end do
      self%n_terms = self%n_terms + 1
      self%row(self%n_terms) = row
      ! analysis diag(slope) synthesis^T: to instants, times the slope, back to coefficients.
      self%block(:, :, self%n_terms) = matmul(fourier%analysis, weighted)
   end subroutine add_multiplication

   !> Coefficients 0..n_harmonics of the function that is 1 where the gap is negative, else 0.
   pure function closed_share(gap, n_harmonics) result(share)
      !> Coefficients of the gap.
      real(wp), intent(in) :: gap(:)
      integer, intent(in) :: n_harmonics
      real(wp) :: share(coefficient_count(n_harmonics))
      real(wp) :: before, after, tau, sign, spacing
      integer :: k, m, n_points

      n_points = points_per_harmonic*max(1, size(gap)/2)
      spacing = 2.0_wp*pi/real(n_points, wp)
      share = 0.0_wp
      after = value_at(gap, 0.0_wp)
      if (after < 0.0_wp) share(1) = 1.0_wp
      do k = 1, n_points
         before = after
         after = value_at(gap, modulo(k, n_points)*spacing)
         if ((before < 0.0_wp) .eqv. (after < 0.0_wp)) cycle
         tau = crossing(gap, (k - 1)*spacing, k*spacing, before < 0.0_wp)
         ! The primitive of the base functions counts where contact ends, less where it begins.
         sign = merge(1.0_wp, -1.0_wp, before < 0.0_wp)
         ! Mean of the indicator over [begin, end]: (end - begin)/(2 pi); that begun before 0 has
         ! been given the whole period first.
         share(1) = share(1) + sign*tau/(2.0_wp*pi)
         do m = 1, n_harmonics
            share(2*m) = share(2*m) + sign*sin(m*tau)/(m*pi)
            share(2*m + 1) = share(2*m + 1) - sign*cos(m*tau)/(m*pi)
         end do
      end do
   end function closed_share

   !> Where the gap changes its sign, by bisection.
   pure real(wp) function crossing(gap, from, to, negative) result(middle)
      real(wp), intent(in) :: gap(:), from, to
      !> Whether the gap is negative at the lower end.
      logical, intent(in) :: negative
      ! Leaves 2**-50 of a spacing below 0.2, the round-off of tau.
      integer, parameter :: n_halvings = 50
      real(wp) :: low, high
      integer :: i

      low = from
      high = to
      do i = 1, n_halvings
         middle = 0.5_wp*(low + high)
         if ((value_at(gap, middle) < 0.0_wp) .eqv. negative) then
            low = middle
         else
            high = middle
         end if
      end do
   end function crossing

   !> c_1 + sum over n of c_2n cos n tau + c_2n+1 sin n tau.
   pure real(wp) function value_at(coefficients, tau) result(value)
      real(wp), intent(in) :: coefficients(:), tau
      integer :: n

      value = coefficients(1)
      do n = 1, size(coefficients)/2
         value = value + coefficients(2*n)*cos(n*tau) + coefficients(2*n + 1)*sin(n*tau)
      end do
   end function value_at

   !> Pairs that stick through the period are springs in every direction.
   pure subroutine add_stuck(system, state, self)
      class(balance_state), intent(in) :: system
      integer, intent(in) :: state(:)
      type(tangent_type), intent(inout) :: self
      integer :: i, c, j

      do i = 1, system%problem%n_pairs
         if (.not. has_friction(system, i) .or. state(i) /= pair_stuck) cycle
         do c = 1, 3
            if (system%problem%joint%row(c, i) == 0) cycle
            self%n_terms = self%n_terms + 1
            self%row(self%n_terms) = system%problem%joint%row(c, i)
            self%block(:, :, self%n_terms) = 0.0_wp
            do j = 1, self%n_coefficients
               self%block(j, j, self%n_terms) = &
                  system%problem%forces%entry( &
                     system%problem%forces%pairs)%law%prediction%stiffness(i, c)
            end do
         end do
      end do
   end subroutine add_stuck

end module fw_stability_tangent
