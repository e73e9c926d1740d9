!> Whether a solution has grown until nothing of it is known: at a mode that neither damping nor
!> contact limits, linear algebra returns some huge amplitude, 1/epsilon, with a small residual.
module fw_unbounded
   use fw_kinds, only: wp
   use fw_balance_state, only: balance_state
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: is_lost_in_round_off

   !> Round-off of the equations over their reference from which on a solution means nothing.
   real(wp), parameter :: limit = 1.0e-3_wp

contains

   !> Whether round-off of elastic and inertial forces, which cancel at a resonance, is no longer
   !> small beside the load. Modes that are condensed are no concern: those without damping stay
   !> among the coordinates.
   logical function is_lost_in_round_off(system, x) result(lost)
      type(balance_state), intent(in) :: system
      !> Coordinates (n_coordinates * n_coefficients).
      real(wp), intent(in), contiguous :: x(:)
      real(wp) :: squares(system%problem%fourier%n_retained)
      integer :: h, k, m

      m = system%problem%structure%n_coordinates
      ! Most solutions are so far from it that the norms of the matrices tell.
      lost = .false.
      if (allocated(system%problem%structure%norms)) then
         if (epsilon(1.0_wp)*largest_cancelling(system, m, x) <= limit*system%reference) return
      end if
      squares = 0.0_wp
      !$omp parallel do default(none) private(h, k) shared(system, x, m, squares) &
      !$omp if(m >= coordinates_for_threads)
      do h = 1, size(squares)
         if (system%problem%fourier%harmonic(h) == 0) cycle
         k = (system%problem%fourier%column(h) - 1)*m
         squares(h) = cancelling(system, h, x(k + 1:k + m), x(k + m + 1:k + 2*m))
      end do
      !$omp end parallel do
      lost = .not. epsilon(1.0_wp)*sqrt(sum(squares)) <= limit*system%reference
   end function is_lost_in_round_off

   !> A bound of the same sum: |A q| <= |A| |q| with the Frobenius norms of K and M.
   pure real(wp) function largest_cancelling(system, m, x) result(bound)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: m
      real(wp), intent(in) :: x(m, *)
      integer :: h, k, n

      bound = 0.0_wp
      associate (structure => system%problem%structure, state => system%structure_state)
         do h = 1, size(structure%harmonic)
            n = structure%harmonic(h)
            if (n == 0) cycle
            k = structure%column(h)
            bound = hypot(bound, norm2(x(:, k:k + 1))*(structure%norms(1, h) + &
                                 n*abs(cmplx(n*state%omega**2, state%omega*state%self_excitation, &
                                             wp))*structure%norms(2, h)))
         end do
      end associate
   end function largest_cancelling

   !> Square of the norm of (|K| + (n omega)^2 |M|) |q| for one harmonic.
   pure real(wp) function cancelling(system, h, cosine, sine) result(square)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      real(wp), intent(in) :: cosine(:), sine(:)
      real(wp) :: amplitude(size(cosine)), sums(size(cosine))

      amplitude = hypot(cosine, sine)
      call system%problem%structure%magnitudes(system%structure_state, h, amplitude, sums)
      square = sum(sums**2)
   end function cancelling

end module fw_unbounded
