!> What acts on the coordinates of a sector and is never condensed: the skew part of the stiffness
!> in harmonic 0, and what a rotation speed that follows the frequency adds to the dynamic stiffness
!> and to the load. Where there is either, every internal mode is a coordinate.
module fw_sector_uncondensed
   use fw_cyclic_data, only: nodal_speed
   use fw_kinds, only: wp
   use fw_sector_reduction, only: sector_reduction
   use fw_speed_growth, only: even_powers, slopes_of_powers
   implicit none (type, external)
   private

   public :: add_uncondensed, add_speed_slope, add_multiple, add_speed_loss

contains

   !> Add it to the stiffness and the load of a harmonic.
   pure subroutine add_uncondensed(basis, harmonic, conjugated, omega, matrix, load)
      type(sector_reduction), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> Whether the conjugates of the basis act.
      logical, intent(in) :: conjugated
      !> [rad/s]
      real(wp), intent(in) :: omega
      !> Of the coordinates (m, m), (m).
      complex(wp), intent(inout) :: matrix(:, :), load(:)

      if (allocated(basis%circulatory) .and. harmonic == 0) matrix = matrix + &
         merge(conjg(basis%circulatory), basis%circulatory, conjugated)
      if (allocated(basis%speed)) call add_speed(basis%speed, harmonic, conjugated, omega, matrix, &
                                                 load)
   end subroutine add_uncondensed

   !> Add what follows the frequency, at Omega = omega/order.
   pure subroutine add_speed(speed, harmonic, conjugated, omega, matrix, load)
      type(nodal_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: matrix(:, :), load(:)
      !> Speed and frequency of the harmonic [rad/s].
      real(wp) :: rate, s

      rate = omega/speed%order
      s = harmonic*omega
      call add_multiple(speed%coriolis, cmplx(0.0_wp, rate*s, wp), conjugated, matrix)
      call add_multiple(speed%circulatory, cmplx(rate, kind=wp), conjugated, matrix)
      call add_stiffness(speed, even_powers(rate, speed%n_powers())*damped(speed, harmonic, s), &
                         conjugated, matrix)
      if (harmonic == 0 .and. allocated(speed%load)) load = load + &
         matmul(speed%load, even_powers(rate, size(speed%load, 2)))
   end subroutine add_speed

   !> The same by the frequency, where anything follows it.
   pure subroutine add_speed_slope(basis, harmonic, conjugated, omega, load_factor, q, derivative)
      type(sector_reduction), intent(in) :: basis
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      !> Of the loads of the basis.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(inout) :: derivative(:)

      if (allocated(basis%speed)) call add_slope(basis%speed, harmonic, conjugated, omega, &
                                                 load_factor, q, derivative)
   end subroutine add_speed_slope

   !> Every factor is a product of the speed and the frequency of the harmonic, which both follow.
   pure subroutine add_slope(speed, harmonic, conjugated, omega, load_factor, q, derivative)
      type(nodal_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega, load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(inout) :: derivative(:)
      complex(wp), allocatable :: matrix(:, :)
      real(wp) :: rate, s, slope
      integer :: n

      rate = omega/speed%order
      s = harmonic*omega
      slope = 1.0_wp/speed%order
      allocate (matrix(size(q), size(q)), source=(0.0_wp, 0.0_wp))
      call add_multiple(speed%coriolis, cmplx(0.0_wp, slope*s + rate*harmonic, wp), conjugated, &
                        matrix)
      call add_multiple(speed%circulatory, cmplx(slope, kind=wp), conjugated, matrix)
      n = speed%n_powers()
      call add_stiffness(speed, slope*slopes_of_powers(rate, n)*damped(speed, harmonic, s) + &
                         even_powers(rate, n)*cmplx(0.0_wp, harmonic*speed%rayleigh, wp), &
                         conjugated, matrix)
      if (harmonic == 0 .and. allocated(speed%load)) derivative = derivative - &
         load_factor*slope*matmul(speed%load, slopes_of_powers(rate, size(speed%load, 2)))
      derivative = derivative + matmul(matrix, q)
   end subroutine add_slope

   !> What the damping in proportion to the stiffness, and its loss factor, make of it.
   pure complex(wp) function damped(speed, harmonic, s)
      type(nodal_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      !> Frequency of the harmonic [rad/s].
      real(wp), intent(in) :: s

      damped = cmplx(1.0_wp, s*speed%rayleigh, wp)
      if (harmonic > 0) damped = damped + cmplx(0.0_wp, speed%loss, wp)
   end function damped

   !> Add the hysteretic damping of what follows the frequency.
   pure subroutine add_speed_loss(speed, conjugated, omega, matrix)
      type(nodal_speed), intent(in) :: speed
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: matrix(:, :)

      call add_stiffness(speed, cmplx(speed%loss*even_powers(omega/speed%order, &
                                                            speed%n_powers()), kind=wp), &
                         conjugated, matrix)
   end subroutine add_speed_loss

   !> Add factors times the powers of the stiffness.
   pure subroutine add_stiffness(speed, factors, conjugated, sum)
      type(nodal_speed), intent(in) :: speed
      !> As many as there are powers.
      complex(wp), intent(in) :: factors(:)
      logical, intent(in) :: conjugated
      complex(wp), intent(inout) :: sum(:, :)
      integer :: p

      do p = 1, speed%n_powers()
         if (conjugated) then
            sum = sum + factors(p)*conjg(speed%stiffness(:, :, p))
         else
            sum = sum + factors(p)*speed%stiffness(:, :, p)
         end if
      end do
   end subroutine add_stiffness

   !> sum = sum + factor matrix, of a matrix that may not be there, or its conjugate.
   pure subroutine add_multiple(matrix, factor, conjugated, sum)
      complex(wp), allocatable, intent(in) :: matrix(:, :)
      complex(wp), intent(in) :: factor
      logical, intent(in) :: conjugated
      complex(wp), intent(inout) :: sum(:, :)

      if (.not. allocated(matrix)) return
      if (conjugated) then
         sum = sum + factor*conjg(matrix)
      else
         sum = sum + factor*matrix
      end if
   end subroutine add_multiple

end module fw_sector_uncondensed
