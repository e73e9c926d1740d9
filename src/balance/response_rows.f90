!> Quantities of a response that are differentiated, and their slopes by what they are made of:
!> observed amplitudes U_n, forces of the pairs, relative displacements.
!>
!>   first harmonic   |U_1|,                dA = Re(conj(U_1) dU_1)/|U_1|
!>   largest          |u(tau)| at its peak, dA = s Re(sum dU_n exp(i n tau)), tau held: u' = 0 there
!>   dissipation      D = sum over pairs of pi sum n (lambda_c u_s - lambda_s u_c)
!>   wear volume      k_w sum over pairs of D/mu: friction works mu p a length
module fw_response_rows
   use fw_balance_state, only: balance_state
   use fw_force_law, only: prediction_type
   use fw_kinds, only: pi, wp
   use fw_recovery, only: observe, observed_coefficients, peak_angles
   implicit none (type, external)
   private

   public :: response_row, new_rows, quantity_words, first_harmonic, largest, dissipation, &
             wear_volume, is_of_pairs
   public :: value_words, resonance_omega, mode_omega, mode_damping_ratio, load_scale

   character(*), parameter :: quantity_words(*) = &
      [character(14) :: 'first_harmonic', 'largest', 'dissipation', 'wear_volume']
   integer, parameter :: first_harmonic = 1, largest = 2, dissipation = 3, wear_volume = 4

   !> All numbers that are differentiated: behind those that are chosen stand those that come with
   !> an analysis, one for each point.
   character(*), parameter :: value_words(*) = &
      [character(18) :: quantity_words, 'resonance_omega', 'mode_omega', 'mode_damping_ratio', &
       'load_scale']
   integer, parameter :: resonance_omega = 5, mode_omega = 6, mode_damping_ratio = 7, load_scale = 8

   !> One number that is differentiated. What it does not depend on is not allocated.
   type :: response_row
      !> One of the constants above, and which observed quantity it is of (0: of all pairs).
      integer :: quantity = 0
      integer :: observed = 0
      real(wp) :: value = 0.0_wp
      !> Two peaks are alike: the slope is one-sided, and this is the mean of both sides.
      logical :: is_tied = .false.
      !> dQ = Re(sum conj(by_observed) dU) (n_observed, n_retained).
      complex(wp), allocatable :: by_observed(:, :)
      !> By the coefficients of forces and of relative displacements (n_pairs, 3, n_coefficients).
      real(wp), allocatable :: by_force(:, :, :), by_motion(:, :, :)
      !> By the friction coefficients themselves (n_pairs).
      real(wp), allocatable :: by_friction(:)
   end type response_row

contains

   !> Whether a quantity is one number, of the pairs or of the motion, not of what is observed.
   elemental logical function is_of_pairs(quantity)
      integer, intent(in) :: quantity

      is_of_pairs = quantity >= dissipation
   end function is_of_pairs

   !> The rows of quantities at the motion x of a state, which has been evaluated there.
   subroutine new_rows(state, x, quantities, mu, wear_coefficient, by_energy, rows)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      !> Quantities that are wanted, in this order.
      integer, intent(in) :: quantities(:)
      !> Friction coefficients (n_pairs), and k_w [area/force].
      real(wp), intent(in) :: mu(:), wear_coefficient(:)
      !> Whether wear follows the energy, whatever mu is.
      logical, intent(in) :: by_energy
      type(response_row), allocatable, intent(out) :: rows(:)
      complex(wp), allocatable :: observed(:, :)
      real(wp), allocatable :: coefficients(:, :)
      integer :: i, k, n, n_rows

      n = state%problem%structure%n_observed
      allocate (observed(n, state%problem%fourier%n_retained))
      call observe(state, x, observed)
      call observed_coefficients(state, x, maxval(state%problem%fourier%harmonic), coefficients)
      n_rows = 0
      do k = 1, size(quantities)
         n_rows = n_rows + merge(1, n, is_of_pairs(quantities(k)))
      end do
      allocate (rows(n_rows))
      n_rows = 0
      do k = 1, size(quantities)
         do i = 1, merge(1, n, is_of_pairs(quantities(k)))
            n_rows = n_rows + 1
            rows(n_rows)%quantity = quantities(k)
            rows(n_rows)%observed = merge(0, i, is_of_pairs(quantities(k)))
            select case (quantities(k))
            case (first_harmonic)
               call set_first_harmonic(state, observed, rows(n_rows))
            case (largest)
               call set_largest(state, coefficients(:, i), rows(n_rows))
            case default
               call set_work(state, x, mu, wear_coefficient, by_energy, rows(n_rows))
            end select
         end do
      end do
   end subroutine new_rows

   !> At rest the amplitude has no slope: it is left at 0.
   subroutine set_first_harmonic(state, observed, row)
      type(balance_state), intent(in) :: state
      complex(wp), intent(in) :: observed(:, :)
      type(response_row), intent(inout) :: row
      integer :: h

      h = findloc(state%problem%fourier%harmonic, 1, dim=1)
      allocate (row%by_observed(size(observed, 1), size(observed, 2)), source=(0.0_wp, 0.0_wp))
      if (h == 0) return
      associate (u => observed(row%observed, h))
         row%value = abs(u)
         if (row%value > 0.0_wp) row%by_observed(row%observed, h) = u/row%value
      end associate
   end subroutine set_first_harmonic

   subroutine set_largest(state, coefficients, row)
      type(balance_state), intent(in) :: state
      !> (0, c1, s1, ...) of the observed quantity.
      real(wp), intent(in) :: coefficients(:)
      type(response_row), intent(inout) :: row
      real(wp) :: angle(2), side(2)
      integer :: h, k, n_peaks

      associate (f => state%problem%fourier)
         allocate (row%by_observed(state%problem%structure%n_observed, f%n_retained), &
                   source=(0.0_wp, 0.0_wp))
         call peak_angles(coefficients, row%value, n_peaks, angle, side)
         ! The half-wave symmetry of odd harmonics makes peaks alike without being a tie.
         row%is_tied = n_peaks > 1 .and. f%has_constant()
         do k = 1, n_peaks
            do h = 1, f%n_retained
               row%by_observed(row%observed, h) = row%by_observed(row%observed, h) + &
                  side(k)/n_peaks*cmplx(cos(f%harmonic(h)*angle(k)), -sin(f%harmonic(h)*angle(k)), &
                                        wp)
            end do
         end do
      end associate
   end subroutine set_largest

   !> Work of friction over a cycle, weighted where it wears.
   subroutine set_work(state, x, mu, wear_coefficient, by_energy, row)
      type(balance_state), intent(in) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: mu(:), wear_coefficient(:)
      logical, intent(in) :: by_energy
      type(response_row), intent(inout) :: row
      real(wp) :: weight(size(mu)), work(size(mu))
      real(wp), allocatable :: u(:, :, :)
      integer :: h, i, k

      associate (f => state%problem%fourier, pairs => state%problem%forces%pairs, &
                 incidence => state%problem%incidence)
         allocate (u(size(mu), 3, f%n_coefficients))
         allocate (row%by_force, row%by_motion, mold=u)
         row%by_force = 0.0_wp
         row%by_motion = 0.0_wp
         weight = 1.0_wp
         if (row%quantity == wear_volume) then
            weight = 0.0_wp
            where (mu > 0.0_wp) weight = wear_coefficient/merge(1.0_wp, mu, by_energy)
         end if
         call incidence%gather(state%problem%forces%entry(pairs)%rows, &
                               state%problem%structure%n_coordinates, f%n_coefficients, x, u)
         ! Against obstacles that move it is heat.
         call state%problem%forces%entry(pairs)%law%prediction%move_gaps(f, u)
         work = 0.0_wp
         associate (force => state%work(pairs)%force)
            do h = 1, f%n_retained
               if (f%harmonic(h) == 0) cycle
               k = f%column(h)
               do i = 1, size(mu)
                  associate (w => weight(i)*pi*f%harmonic(h))
                     work(i) = work(i) + pi*f%harmonic(h)*sum(force(i, :, k)*u(i, :, k + 1) - &
                                                              force(i, :, k + 1)*u(i, :, k))
                     row%by_force(i, :, k) = w*u(i, :, k + 1)
                     row%by_force(i, :, k + 1) = -w*u(i, :, k)
                     row%by_motion(i, :, k) = -w*force(i, :, k + 1)
                     row%by_motion(i, :, k + 1) = w*force(i, :, k)
                  end associate
               end do
            end do
            call add_speeds(state, state%problem%forces%entry(pairs)%law%prediction, force, &
                            weight, work, row)
         end associate
      end associate
      row%value = sum(weight*work)
      if (row%quantity /= wear_volume) return
      allocate (row%by_friction(size(mu)), source=0.0_wp)
      if (by_energy) return
      where (mu > 0.0_wp) row%by_friction = -weight*work/mu
   end subroutine set_work

   !> What the mean forces do on sides that slide.
   subroutine add_speeds(state, prediction, force, weight, work, row)
      type(balance_state), intent(in) :: state
      type(prediction_type), intent(in) :: prediction
      real(wp), intent(in) :: force(:, :, :), weight(:)
      real(wp), intent(inout) :: work(:)
      type(response_row), intent(inout) :: row
      real(wp) :: way(size(work))
      integer :: c

      if (.not. (allocated(prediction%speed) .and. state%problem%fourier%has_constant())) return
      do c = 1, 2
         way = 2.0_wp*pi/state%frequency()*prediction%speed(:, c)
         work = work - way*force(:, c, 1)
         row%by_force(:, c, 1) = row%by_force(:, c, 1) - weight*way
      end do
   end subroutine add_speeds

end module fw_response_rows
