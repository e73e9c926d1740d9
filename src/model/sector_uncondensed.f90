!> What acts on the coordinates of a sector and is never condensed: the skew part of the stiffness
!> in harmonic 0, and what a rotation speed that follows the frequency adds to the dynamic stiffness
!> and to the load. Where there is either, every internal mode is a coordinate.
module fw_sector_uncondensed
   use fw_kinds, only: wp
   use fw_sector, only: sector_speed
   use fw_sector_reduction, only: sector_reduction
   implicit none (type, external)
   private

   public :: add_uncondensed, add_speed_slope, add_multiple

contains

   !> Add it to the stiffness and the load of a harmonic.
   pure subroutine add_uncondensed(basis, harmonic, conjugated, omega, matrix, load)
      type(sector_reduction), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> Whether the conjugates of the basis act.
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: matrix(:, :), load(:)

      if (allocated(basis%circulatory) .and. harmonic == 0) matrix = matrix + &
         merge(conjg(basis%circulatory), basis%circulatory, conjugated)
      if (allocated(basis%speed)) call add_speed(basis%speed, harmonic, &
                                                 conjugated, omega, matrix, load)
   end subroutine add_uncondensed

   !> Add what follows the frequency, at Omega = omega/order.
   pure subroutine add_speed(speed, harmonic, conjugated, omega, matrix, load)
      type(sector_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      complex(wp), intent(inout) :: matrix(:, :), load(:)
      real(wp) :: rate, s

      rate = omega/speed%order
      s = harmonic*omega
      call add_multiple(speed%coriolis, conjugated, cmplx(0.0_wp, rate*s, wp), matrix)
      call add_multiple(speed%circulatory, conjugated, cmplx(rate, kind=wp), matrix)
      call add_multiple(speed%stiffness, conjugated, cmplx(rate**2, kind=wp), matrix)
      call add_multiple(speed%damping, conjugated, cmplx(0.0_wp, rate**2*s, wp), matrix)
      if (harmonic > 0) then
         call add_multiple(speed%structural, conjugated, cmplx(0.0_wp, rate**2, wp), matrix)
      else if (allocated(speed%load)) then
         load = load + rate**2*speed%load
      end if
   end subroutine add_speed

   !> The same by the frequency.
   pure subroutine add_speed_slope(speed, harmonic, conjugated, omega, load_factor, q, derivative)
      type(sector_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      real(wp), intent(in) :: omega
      !> Of the loads of the basis.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(inout) :: derivative(:)
      complex(wp), allocatable :: matrix(:, :)
      real(wp) :: rate, s, slope

      rate = omega/speed%order
      s = harmonic*omega
      slope = 1.0_wp/speed%order
      allocate (matrix(size(q), size(q)), source=(0.0_wp, 0.0_wp))
      call add_multiple(speed%coriolis, conjugated, &
                        cmplx(0.0_wp, slope*s + rate*harmonic, wp), matrix)
      call add_multiple(speed%circulatory, conjugated, cmplx(slope, kind=wp), matrix)
      call add_multiple(speed%stiffness, conjugated, cmplx(2.0_wp*rate*slope, kind=wp), matrix)
      call add_multiple(speed%damping, conjugated, &
                        cmplx(0.0_wp, 2.0_wp*rate*slope*s + rate**2*harmonic, wp), matrix)
      if (harmonic > 0) then
         call add_multiple(speed%structural, conjugated, &
                           cmplx(0.0_wp, 2.0_wp*rate*slope, wp), matrix)
      else if (allocated(speed%load)) then
         derivative = derivative - load_factor*2.0_wp*rate*slope*speed%load
      end if
      derivative = derivative + matmul(matrix, q)
   end subroutine add_speed_slope

   !> sum = sum + factor matrix or its conjugate, of a matrix that may not be there.
   pure subroutine add_multiple(matrix, conjugated, factor, sum)
      complex(wp), allocatable, intent(in) :: matrix(:, :)
      logical, intent(in) :: conjugated
      complex(wp), intent(in) :: factor
      complex(wp), intent(inout) :: sum(:, :)

      if (.not. allocated(matrix)) return
      if (conjugated) then
         sum = sum + factor*conjg(matrix)
      else
         sum = sum + factor*matrix
      end if
   end subroutine add_multiple

end module fw_sector_uncondensed
