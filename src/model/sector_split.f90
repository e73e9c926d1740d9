!> What a coordinate of a sector is to the motion above the harmonics of a balance in one nodal
!> diameter: fw_split with Hermitian blocks.
module fw_sector_split
   use fw_kinds, only: wp
   use fw_sector_reduction, only: sector_reduction
   implicit none (type, external)
   private

   public :: split_sector

contains

   !> Mass, damping and stiffness of a coordinate of a basis without kept modes.
   pure subroutine split_sector(basis, coordinate, limit, m, c, k)
      type(sector_reduction), intent(in) :: basis
      integer, intent(in) :: coordinate
      !> Angular frequency below which modes follow by their inertia [rad/s].
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k
      complex(wp) :: coupling(3), share
      real(wp) :: own(3)
      integer :: j

      own = 0.0_wp
      own(:basis%n_blocks) = real(basis%blocks(coordinate, coordinate, :), wp)
      k = own(1)
      m = own(2)
      c = own(3)
      coupling = (0.0_wp, 0.0_wp)
      do j = 1, basis%n_internal
         associate (m_j => basis%m_i(j), k_j => basis%k_i(j), c_j => basis%c_i(j))
            coupling(:basis%n_blocks) = basis%blocks(basis%n_coordinates + j, coordinate, :)
            if (k_j < limit**2*m_j) then
               share = coupling(2)/m_j
               m = m - real(conjg(share)*coupling(2), wp)
               k = k - 2.0_wp*real(conjg(share)*coupling(1), wp) + abs(share)**2*k_j
               c = c - 2.0_wp*real(conjg(share)*coupling(3), wp) + abs(share)**2*c_j
            else if (abs(k_j) > 0.0_wp) then
               share = coupling(1)/k_j
               m = m - 2.0_wp*real(conjg(share)*coupling(2), wp) + abs(share)**2*m_j
               k = k - real(conjg(share)*coupling(1), wp)
               c = c - 2.0_wp*real(conjg(share)*coupling(3), wp) + abs(share)**2*c_j
            end if
         end associate
      end do
   end subroutine split_sector

end module fw_sector_split
