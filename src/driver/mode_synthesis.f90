!> Responses near the resonance of a nonlinear mode, put together from its curve.
module fw_mode_synthesis
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_kinds, only: wp
   use fw_mode_group, only: mode_table
   implicit none (type, external)
   private

   public :: synthesize

contains

   !> Responses of one mode: P^2 = a^2 ((omega^2 - W^2)^2 + (2 zeta omega W)^2), which for each
   !> amplitude a has two frequencies W, or none.
   subroutine synthesize(scales, table)
      !> Factors of the load; not allocated where nothing is asked for.
      real(wp), allocatable, intent(in) :: scales(:)
      type(mode_table), intent(inout) :: table
      real(wp) :: centre, half, force, zeta
      integer :: j, k

      if (.not. allocated(scales) .or. table%n == 0) return
      table%scale = scales
      allocate (table%response_omega(2, table%n, size(table%scale)), &
                source=ieee_value(1.0_wp, ieee_quiet_nan))
      do j = 1, size(table%scale)
         do k = 1, table%n
            associate (row => table%row(k))
               zeta = 0.5_wp*row%self_excitation/row%omega
               force = table%scale(j)*row%force/row%modal_amplitude
               half = force**2 - 4.0_wp*zeta**2*row%omega**4*(1.0_wp - zeta**2)
               if (half < 0.0_wp) cycle
               half = sqrt(half)
               centre = row%omega**2*(1.0_wp - 2.0_wp*zeta**2)
               if (centre - half > 0.0_wp) table%response_omega(1, k, j) = sqrt(centre - half)
               if (centre + half > 0.0_wp) table%response_omega(2, k, j) = sqrt(centre + half)
            end associate
         end do
      end do
   end subroutine synthesize

end module fw_mode_synthesis
