!> Pairs on a side 2 that slides steadily: friction leans from what presses alone, and so do its
!> derivative and what it wears.
!>
!> A motion along the surface changes no force of such a pair, but how far it slides: the part of
!> the inputs that nobody else asks for.
module fw_steady_slide
   use fw_force_law, only: force_workspace, pair_mixed, pair_open, pair_stuck, prediction_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: differentiate_slide, find_slide, lean_block

contains

   !> The block of a pair that leans, from that of its member: of a pair that always bears, too.
   pure subroutine lean_block(lean, nc, state, block)
      real(wp), intent(in) :: lean(2)
      integer, intent(in) :: nc
      integer, intent(inout) :: state
      !> Transposed derivative (input, output).
      real(wp), intent(inout) :: block(:, :)
      integer :: c, k

      if (state == pair_open) return
      if (state == pair_stuck) then
         block = 0.0_wp
         do k = 2*nc + 1, 3*nc
            block(k, k) = 1.0_wp
         end do
         state = pair_mixed
      end if
      do c = 1, 2
         block(:, (c - 1)*nc + 1:c*nc) = lean(c)*block(:, 2*nc + 1:)
      end do
   end subroutine lean_block

   !> Sliding under pressure of a pair that leans, against the surface that moves, and what it
   !> depends on:
   !>
   !>   S = k int p (|v| - du_r/dt . v/|v|) dt,    p = -lambda_n,
   !>
   !> in coefficients: both are known without instants. k makes forces of lengths (fw_slip).
   pure subroutine find_slide(prediction, lean, fourier, pair, work, slide, by_along, by_force)
      type(prediction_type), intent(in) :: prediction
      !> Where side 2 slides to, v/|v|, in the directions that the pair has.
      real(wp), intent(in) :: lean(2)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: pair
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: slide
      !> By the input along v, and by the normal force (n_coefficients each).
      real(wp), intent(out), optional :: by_along(:), by_force(:)
      real(wp), dimension(size(work%force, 3)) :: along, slope, turned
      real(wp) :: own, weight
      integer :: h, j, k, n

      associate (p => prediction, force => work%force(pair, 3, :), &
                 is_rate => prediction%order_of(pair, 1) > 0)
         along = lean(1)*work%prediction(pair, 1, :) + &
                 lean(2)*work%prediction(pair, 2, :)
         ! The balance is a part of a rigid input, with the friction that the motion has not; of a
         ! displacement that does no work on the pressure that it follows.
         own = 0.0_wp
         if (is_rate .and. p%takes(pair)) own = work%mu(pair)*sum(lean**2)
         slope = 0.0_wp
         turned = 0.0_wp
         do h = 1, fourier%n_retained
            n = fourier%harmonic(h)
            k = fourier%column(h)
            if (is_rate) then
               ! A rate by t is one by tau times the frequency.
               weight = merge(2.0_wp, 1.0_wp, n == 0)*pi
               if (p%in_time(pair)) weight = weight/work%rate
               do j = k, k + merge(0, 1, n == 0)
                  turned(j) = weight*(along(j) - own*force(j))
                  slope(j) = weight*force(j)
               end do
            else if (n > 0) then
               turned(k:k + 1) = pi*n*[along(k + 1), -along(k)]
               slope(k:k + 1) = pi*n*[-force(k + 1), force(k)]
            end if
         end do
         if (fourier%has_constant()) turned(1) = turned(1) - 2.0_wp*pi/work%rate* &
            norm2(p%speed(pair, :))*maxval(p%stiffness(pair, 1:2))
         slide = dot_product(turned, force)
         if (present(by_along)) by_along = slope
         if (present(by_force)) by_force = turned - own*slope
      end associate
   end subroutine find_slide

   !> The derivative of that sliding by the inputs, from the block of the pair.
   pure subroutine differentiate_slide(prediction, lean, fourier, pair, work)
      type(prediction_type), intent(in) :: prediction
      !> Where side 2 slides to, v/|v|, in the directions that the pair has.
      real(wp), intent(in) :: lean(2)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: pair
      type(force_workspace), intent(inout) :: work
      real(wp), dimension(size(work%force, 3)) :: by_along, by_force
      real(wp) :: slide
      integer :: c, k, nc

      nc = size(work%force, 3)
      work%slip_derivative(:, pair) = 0.0_wp
      if (work%linear_state(pair) == pair_open) return
      call find_slide(prediction, lean, fourier, pair, work, slide, by_along, by_force)
      do c = 1, 2
         work%slip_derivative((c - 1)*nc + 1:c*nc, pair) = lean(c)*by_along
      end do
      ! The block is transposed: what its last rows of outputs depend on.
      do k = 1, nc
         work%slip_derivative(:, pair) = work%slip_derivative(:, pair) + &
                                         by_force(k)*work%jacobian(:, 2*nc + k, pair)
      end do
   end subroutine differentiate_slide

end module fw_steady_slide
