!> From displacements times a stiffness to the inputs of a law that takes rates, or of springs with
!> a damper and a mass: for all elements, and for one row of coefficients.
!>
!> Coefficients uc, us of a harmonic are the complex amplitude uc - i us.
module fw_input_rates
   use fw_force_law, only: prediction_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: take_inertias, take_means, take_rate, take_rates, turn_row

contains

   !> Rates say nothing of mean positions: an element that comes to rest takes them beside.
   pure subroutine take_means(fourier, prediction, y, mean)
      type(fourier_type), intent(in) :: fourier
      type(prediction_type), intent(in) :: prediction
      real(wp), intent(in) :: y(:, :, :)
      !> (element, tangential component).
      real(wp), intent(inout) :: mean(:, :)
      integer :: c, i

      mean = 0.0_wp
      if (.not. fourier%has_constant()) return
      do c = 1, min(size(mean, 2), size(y, 2))
         do i = 1, size(y, 1)
            if (prediction%order_of(i, c) > 0) mean(i, c) = y(i, c, 1)
         end do
      end do
   end subroutine take_means

   !> Replace inputs from displacements by inputs from velocities, where the law takes these.
   pure subroutine take_rates(fourier, omega, prediction, y)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      type(prediction_type), intent(in) :: prediction
      real(wp), intent(inout) :: y(:, :, :)
      real(wp) :: cosine, n
      integer :: i, c, h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         do c = 1, size(y, 2)
            if (prediction%order(c) == 0) cycle
            do i = 1, size(y, 1)
               if (prediction%order_of(i, c) == 0) cycle
               if (fourier%harmonic(h) == 0) then
                  y(i, c, k) = 0.0_wp
                  cycle
               end if
               n = merge(omega, 1.0_wp, prediction%in_time(i))*real(fourier%harmonic(h), wp)
               ! d/dtau (a cos n tau + b sin n tau) = n b cos n tau - n a sin n tau.
               cosine = y(i, c, k)
               y(i, c, k) = n*y(i, c, k + 1)
               y(i, c, k + 1) = -n*cosine
            end do
         end do
      end do
   end subroutine take_rates

   !> Bring inputs from displacements times a stiffness to those times E_n.
   pure subroutine take_inertias(fourier, omega, prediction, y)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      type(prediction_type), intent(in) :: prediction
      real(wp), intent(inout) :: y(:, :, :)
      complex(wp) :: turned
      integer :: i, c, h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         if (fourier%harmonic(h) == 0) cycle
         do c = 1, size(y, 2)
            do i = 1, size(y, 1)
               turned = prediction%impedance_ratio(i, c, fourier%harmonic(h), omega)* &
                        cmplx(y(i, c, k), -y(i, c, k + 1), wp)
               y(i, c, k) = real(turned, wp)
               y(i, c, k + 1) = -aimag(turned)
            end do
         end do
      end do
   end subroutine take_inertias

   !> Coefficients of one row times E_n over the stiffness, or divided by it.
   pure subroutine turn_row(fourier, omega, prediction, element, component, divides, row)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      type(prediction_type), intent(in) :: prediction
      integer, intent(in) :: element, component
      logical, intent(in) :: divides
      real(wp), intent(inout) :: row(:)
      complex(wp) :: ratio, turned
      integer :: h, k

      do h = 1, fourier%n_retained
         if (fourier%harmonic(h) == 0) cycle
         k = fourier%column(h)
         ratio = prediction%impedance_ratio(element, component, fourier%harmonic(h), omega)
         if (divides) ratio = (1.0_wp, 0.0_wp)/ratio
         turned = ratio*cmplx(row(k), -row(k + 1), wp)
         row(k) = real(turned, wp)
         row(k + 1) = -aimag(turned)
      end do
   end subroutine turn_row

   !> Derivative in place, unit times that by tau; the mean of a pair at rest stays, see
   !> take_means.
   pure subroutine take_rate(fourier, keep_mean, unit, inputs)
      type(fourier_type), intent(in) :: fourier
      logical, intent(in) :: keep_mean
      real(wp), intent(in) :: unit
      real(wp), intent(inout) :: inputs(:)
      real(wp) :: cosine, n
      integer :: h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         n = unit*real(fourier%harmonic(h), wp)
         if (fourier%harmonic(h) == 0) then
            if (.not. keep_mean) inputs(k) = 0.0_wp
            cycle
         end if
         ! d/dtau (a cos n tau + b sin n tau) = n b cos n tau - n a sin n tau.
         cosine = inputs(k)
         inputs(k) = n*inputs(k + 1)
         inputs(k + 1) = -n*cosine
      end do
   end subroutine take_rate

end module fw_input_rates
