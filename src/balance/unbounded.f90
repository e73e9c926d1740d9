!> Whether a solution has grown until nothing of it is known: at a mode that neither damping nor
!> contact limits, linear algebra returns some huge amplitude, 1/epsilon, with a small residual.
module fw_unbounded
   use fw_kinds, only: wp
   use fw_balance_state, only: balance_state
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
      real(wp) :: square
      integer :: h, k, m

      m = system%problem%structure%n_coordinates
      square = 0.0_wp
      do h = 1, system%problem%fourier%n_retained
         if (system%problem%fourier%harmonic(h) == 0) cycle
         k = (system%problem%fourier%column(h) - 1)*m
         square = square + cancelling(system, h, x(k + 1:k + m), x(k + m + 1:k + 2*m))
      end do
      lost = .not. epsilon(1.0_wp)*sqrt(square) <= limit*system%reference
   end function is_lost_in_round_off

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
