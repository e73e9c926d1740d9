!> What a coordinate is to the motion above the harmonics of a balance: a mass, a dashpot and a
!> spring. Modes of the structure with its coordinates held that lie below a frequency follow such
!> a motion by their inertia, the others statically. With a mode j of m_j, k_j, c_j and its coupling
!> m_qj, k_qj, c_qj, expanding (k_qj - s**2 m_qj + i s c_qj)**2/(k_j - s**2 m_j + i s c_j) in 1/s,
!>
!>   m = m_qq - m_qj**2/m_j,
!>   k = k_qq - 2 k_qj m_qj/m_j + k_j (m_qj/m_j)**2,
!>   c = c_qq - 2 c_qj m_qj/m_j + c_j (m_qj/m_j)**2    summed over the modes below,
!>
!> and in s, k - k_qj**2/k_j, m - 2 k_qj m_qj/k_j + m_j (k_qj/k_j)**2 for those above.
module fw_split
   use fw_kinds, only: wp
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: split_coordinate

contains

   !> Mass, damping and stiffness of a coordinate; m and c are not below zero.
   pure subroutine split_coordinate(basis, coordinate, limit, m, c, k)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: coordinate
      !> Angular frequency below which modes follow by their inertia [rad/s].
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k
      real(wp) :: damping
      !> K, M and C of an entry; without damping the last stays 0.
      real(wp) :: own(3), mode(3), coupling(3)
      integer :: i, j, nb

      i = coordinate
      own = 0.0_wp
      mode = 0.0_wp
      coupling = 0.0_wp
      associate (b => basis)
         nb = b%n_blocks
         own(:nb) = b%blocks(i, i, :)
         k = own(1)
         m = own(2)
         c = own(3)
         ! Modes that were kept as coordinates stand behind the others.
         do j = b%n_coordinates - size(b%kept) + 1, b%n_coordinates
            if (j == i) cycle
            mode(:nb) = b%blocks(j, j, :)
            coupling(:nb) = b%blocks(j, i, :)
            call take_mode(mode(2), mode(3), mode(1), coupling(2), coupling(3), coupling(1), &
                           limit, m, c, k)
         end do
         do j = 1, b%n_internal
            damping = b%c_i(j)
            ! Of coupled damping the diagonal alone.
            if (allocated(b%c_ii)) damping = b%c_ii(j, j)
            coupling(:nb) = b%coupling(j, :, i)
            call take_mode(b%m_i(j), damping, b%k_i(j), coupling(2), coupling(3), coupling(1), &
                           limit, m, c, k)
         end do
      end associate
      m = max(m, 0.0_wp)
      c = max(c, 0.0_wp)
   end subroutine split_coordinate

   !> The terms of the header: a mode below the limit follows by m_qj/m_j, one above by k_qj/k_j.
   pure subroutine take_mode(m_j, c_j, k_j, m_qj, c_qj, k_qj, limit, m, c, k)
      real(wp), intent(in) :: m_j, c_j, k_j, m_qj, c_qj, k_qj, limit
      real(wp), intent(inout) :: m, c, k
      real(wp) :: share

      if (k_j < limit**2*m_j) then
         share = m_qj/m_j
         m = m - share*m_qj
         k = k - 2.0_wp*share*k_qj + share**2*k_j
         c = c - 2.0_wp*share*c_qj + share**2*c_j
      else if (abs(k_j) > 0.0_wp) then
         share = k_qj/k_j
         m = m - 2.0_wp*share*m_qj + share**2*m_j
         k = k - share*k_qj
         c = c - 2.0_wp*share*c_qj + share**2*c_j
      end if
   end subroutine take_mode

end module fw_split
