!> What a balance leaves out: the part of the nonlinear forces in harmonics above its own.
module fw_left_out
   use fw_fourier, only: fourier_type, new_fourier
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: force_left_out

contains

   !> Root mean square of the contact and spring forces in harmonics above n_harmonics, as a part of
   !> that of their vibratory harmonics, or of the vibratory load where that is larger, at the point
   !> that was evaluated last.
   function force_left_out(system, n_harmonics) result(share)
      type(balance_state), intent(inout) :: system
      integer, intent(in) :: n_harmonics
      real(wp) :: share
      type(fourier_type) :: kept
      real(wp) :: all_power, kept_power
      integer :: k, n_time

      n_time = system%problem%fourier%n_time
      ! Instants n_time resolve harmonics below n_time/2.
      kept = new_fourier(min(n_harmonics, (n_time - 1)/2), n_time)
      all_power = 0.0_wp
      kept_power = 0.0_wp
      do k = 1, system%problem%forces%n_laws
         associate (law => system%problem%forces%entry(k)%law, work => system%work(k))
            if (law%n_elements == 0) cycle
            call law%sample(work)
            call add_power(kept, law%n_elements*law%n_components, n_time, work%force_time, &
                           all_power, kept_power)
         end associate
      end do
      share = 0.0_wp
      if (all_power > kept_power) then
         ! Powers are means over the period: a load of norm f has f^2/2.
         share = sqrt((all_power - kept_power)/max(all_power, 0.5_wp*system%reference**2))
      end if
   end function force_left_out

   !> Add the vibratory power of rows of values, and its part in the harmonics of `kept`.
   !> By Parseval's identity the latter is half the sum of their squares.
   subroutine add_power(kept, n_rows, n_time, values, all_power, kept_power)
      type(fourier_type), intent(in) :: kept
      integer, intent(in) :: n_rows, n_time
      real(wp), intent(in) :: values(n_rows, n_time)
      real(wp), intent(inout) :: all_power, kept_power
      real(wp) :: coefficients(n_rows, kept%n_coefficients), vibratory(n_rows, n_time)

      vibratory = values - spread(sum(values, dim=2)/real(n_time, wp), 2, n_time)
      call kept%to_coefficients(n_rows, vibratory, coefficients)
      all_power = all_power + sum(vibratory**2)/real(n_time, wp)
      kept_power = kept_power + 0.5_wp*sum(coefficients(:, 2:)**2)
   end subroutine add_power

end module fw_left_out
