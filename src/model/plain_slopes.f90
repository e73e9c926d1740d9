!> Derivatives of the condensed balance Z_r q - F_r by the frequency and the self-excitation, all
!> loads included, and the internal modes that they need. With ' = d/dp and x recovered:
!>
!>   Z'_qq q + Z'_qi x - Z_qi D^-1 (Z'_iq q + D' x).
module fw_plain_slopes
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_formed_stiffness, only: harmonic_load, load_slope
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_real_products, only: harmonic_factors, real_products
   use fw_reduction, only: reduction_type
   use fw_structure_operator, only: by_frequency
   implicit none (type, external)
   private

   public :: derive, derive_formed, recover_modes, slopes_of

contains

   !> By frequency, harmonic by harmonic, from complex matrices that round as Z_r does: near the
   !> sharp turns of a branch the last digits decide where it goes on.
   subroutine derive_formed(basis, f, load_factor, q, slope)
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: f
      !> Of the loads in each harmonic.
      real(wp), intent(in) :: load_factor(:)
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      complex(wp) :: amplitude(basis%n_coordinates, size(f%harmonic))
      complex(wp) :: derivative(basis%n_coordinates, size(f%harmonic))
      integer :: h, m

      m = basis%n_coordinates
      call amplitudes_of(f%harmonic, f%column, m, q, m, amplitude)
      do h = 1, size(f%harmonic)
         call derive_harmonic(basis, f%harmonic(h), f%s(h), load_factor(h), amplitude(:, h), &
                              derivative(:, h))
      end do
      call coefficients_of(f%harmonic, f%column, m, m, derivative, slope)
   end subroutine derive_formed

   !> One harmonic, with the terms of the module header; without self-excitation theta = s^2 and,
   !> by omega, ' = n d/ds: Z' = n (-2 s M + i C).
   subroutine derive_harmonic(b, harmonic, s, load_factor, q, derivative)
      type(reduction_type), intent(in) :: b
      integer, intent(in) :: harmonic
      !> n omega, and the factor of the loads.
      real(wp), intent(in) :: s, load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: derivative(:)
      type(internal_block) :: internal
      complex(wp), allocatable :: coupling(:, :), slope(:, :), xi(:, :)
      real(wp), allocatable :: damping(:, :)
      logical :: failed
      real(wp) :: n
      integer :: m

      m = b%n_coordinates
      n = real(harmonic, wp)
      allocate (damping(m + b%n_internal, m), xi(b%n_internal, 1))
      damping = 0.0_wp
      if (b%n_blocks == 3) damping = b%blocks(:, :, 3)
      associate (m_qq => b%blocks(:m, :, 2), c_qq => damping(:m, :), &
                 k_iq => b%blocks(m + 1:, :, 1), m_iq => b%blocks(m + 1:, :, 2), &
                 c_iq => damping(m + 1:, :))
         derivative = n*matmul(cmplx(-2.0_wp*s*m_qq, c_qq, wp), q)
         if (b%waves%acts()) derivative = derivative - load_factor* &
                                          load_slope(b%load_q, b%waves, harmonic, s, n)
         if (b%n_internal == 0) return
         coupling = cmplx(k_iq - s**2*m_iq, s*c_iq, wp)
         if (b%loss_at(s) > 0.0_wp) coupling = coupling + cmplx(0.0_wp, b%loss*k_iq, wp)
         slope = n*cmplx(-2.0_wp*s*m_iq, c_iq, wp)
      end associate
      call internal%factor(b, cmplx(s**2, kind=wp), s, failed)
      ! x, recovered; then D^-1 (Z'_iq q + D' x).
      xi(:, 1) = load_factor*harmonic_load(b%load_i, b%waves, harmonic, s) - matmul(coupling, q)
      call internal%solve(1, xi)
      derivative = derivative + matmul(xi(:, 1), slope)
      xi(:, 1) = matmul(slope, q) + n*internal_slope(b, cmplx(2.0_wp*s, kind=wp), 1.0_wp, xi(:, 1))
      if (b%waves%acts()) xi(:, 1) = xi(:, 1) - load_factor* &
                                     load_slope(b%load_i, b%waves, harmonic, s, n)
      call internal%solve(1, xi)
      derivative = derivative - matmul(xi(:, 1), coupling)
   end subroutine derive_harmonic

   !> d/dp of the factors of K, M and C.
   pure function slopes_of(factors, self_excitation, parameter) result(slopes)
      type(harmonic_factors), intent(in) :: factors
      real(wp), intent(in) :: self_excitation
      !> by_frequency, or any other for the self-excitation.
      integer, intent(in) :: parameter
      type(harmonic_factors) :: slopes

      slopes = factors
      slopes%k = 0.0_wp
      if (parameter == by_frequency) then
         ! theta = s^2 + i s xi and s = n omega: theta' = n (2 s + i xi) by omega, i s by xi.
         slopes%theta = slopes%harmonic*cmplx(2.0_wp*slopes%s, self_excitation, wp)
         slopes%s = real(slopes%harmonic, wp)
      else
         slopes%theta = cmplx(0.0_wp, slopes%s, wp)
         slopes%s = 0.0_wp
      end if
   end function slopes_of

   !> All harmonics at once.
   subroutine derive(b, n_coefficients, f, slopes, load_factor, q, slope)
      type(reduction_type), intent(in) :: b
      integer, intent(in) :: n_coefficients
      type(harmonic_factors), intent(in) :: f, slopes
      !> Of the loads in each harmonic.
      real(wp), intent(in) :: load_factor(:)
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      type(real_products) :: work
      complex(wp), allocatable :: x(:, :)
      integer :: h, m, n_i, n_failed

      m = b%n_coordinates
      n_i = b%n_internal
      call work%reserve(b, size(f%harmonic), n_coefficients)
      call work%factor(b, f, n_failed)
      call recover_modes(b, f, load_factor, work, q, x)
      call work%multiply_blocks(b, slopes, q)
      call take_rows(m, n_i, n_coefficients, work%products, slope, work%modes)
      if (b%waves%acts()) call subtract_load_slopes(b, n_coefficients, f, slopes, load_factor, &
                                                    slope)
      if (n_i > 0) then
         ! D^-1 (Z'_iq q + D' x)
         call amplitudes_of(f%harmonic, f%column, n_i, work%modes, n_i, work%amplitudes)
         do h = 1, size(f%harmonic)
            work%amplitudes(:, h) = work%amplitudes(:, h) + &
                                    internal_slope(b, slopes%theta(h), slopes%s(h), x(:, h))
            if (.not. b%waves%acts()) cycle
            work%amplitudes(:, h) = work%amplitudes(:, h) - load_factor(h)* &
                                    load_slope(b%load_i, b%waves, f%harmonic(h), f%s(h), &
                                               slopes%s(h))
         end do
         call coefficients_of(f%harmonic, f%column, n_i, n_i, work%amplitudes, work%modes)
         call work%solve_internal(f)
         call work%subtract_modes(b, f, slope)
         ! - Z'_qi (-x)
         call coefficients_of(f%harmonic, f%column, n_i, n_i, -x, work%modes)
         call work%subtract_modes(b, slopes, slope)
      end if
   end subroutine derive

   !> dF_q/dp of loads that grow with their frequency.
   subroutine subtract_load_slopes(b, n_coefficients, f, slopes, load_factor, slope)
      type(reduction_type), intent(in) :: b
      integer, intent(in) :: n_coefficients
      type(harmonic_factors), intent(in) :: f, slopes
      real(wp), intent(in) :: load_factor(:)
      real(wp), intent(inout) :: slope(*)
      real(wp) :: loads(b%n_coordinates*n_coefficients)
      complex(wp) :: amplitude(b%n_coordinates, size(f%harmonic))
      integer :: h, m

      m = b%n_coordinates
      do h = 1, size(f%harmonic)
         amplitude(:, h) = load_factor(h)*load_slope(b%load_q, b%waves, f%harmonic(h), f%s(h), &
                                                     slopes%s(h))
      end do
      call coefficients_of(f%harmonic, f%column, m, m, amplitude, loads)
      slope(:size(loads)) = slope(:size(loads)) - loads
   end subroutine subtract_load_slopes

   !> Rows of the coordinates and of the internal modes of a product with the blocks.
   pure subroutine take_rows(m, n_i, n_columns, products, rows, modes)
      integer, intent(in) :: m, n_i, n_columns
      real(wp), intent(in) :: products(m + n_i, n_columns)
      real(wp), intent(inout) :: rows(m, n_columns), modes(n_i, n_columns)

      rows = products(:m, :)
      modes = products(m + 1:, :)
   end subroutine take_rows

   !> D' times a vector.
   pure function internal_slope(basis, theta, s, vector) result(product)
      type(reduction_type), intent(in) :: basis
      !> d theta/dp and ds/dp.
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp), intent(in) :: vector(:)
      complex(wp) :: product(size(vector))

      product = -theta*basis%m_i*vector
      if (allocated(basis%c_ii)) then
         product = product + cmplx(0.0_wp, s, wp)*matmul(basis%c_ii, vector)
      else
         product = product + cmplx(0.0_wp, s, wp)*basis%c_i*vector
      end if
   end function internal_slope

   !> x = D^-1 (F_i - Z_iq q), complex amplitudes (n_internal, n_retained); D factored in `work`.
   subroutine recover_modes(b, factors, load_factor, work, q, x)
      type(reduction_type), intent(in) :: b
      type(harmonic_factors), intent(in) :: factors
      real(wp), intent(in) :: load_factor(:)
      type(real_products), intent(inout) :: work
      real(wp), intent(in) :: q(*)
      complex(wp), allocatable, intent(out) :: x(:, :)
      integer :: h

      allocate (x(b%n_internal, size(factors%harmonic)))
      ! The products below would be for nothing.
      if (b%n_internal == 0) return
      call work%multiply_internal(b, factors, q)
      call amplitudes_of(factors%harmonic, factors%column, b%n_internal, work%modes, &
                         b%n_internal, x)
      do h = 1, size(factors%harmonic)
         x(:, h) = load_factor(h)*harmonic_load(b%load_i, b%waves, factors%harmonic(h), &
                                                factors%s(h)) - x(:, h)
         call work%internal(h)%solve(1, x(:, h:h))
      end do
   end subroutine recover_modes

end module fw_plain_slopes
