!> What the joint of a case is where it is closed: linear springs, and pairs that stick, at a gap or
!> not. Elastic pairs are their springs; of all others the rows do not move.
module fw_closed_pairs
   use fw_closed_joint, only: closed_joint
   use fw_contact_data, only: contact_type, spring_type
   use fw_kinds, only: wp
   use fw_laws, only: build_law
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: add_springs, add_pairs

contains

   !> Springs that are linear: those of all sectors are those of the first.
   pure subroutine add_springs(springs, n_sectors, joint)
      type(spring_type), intent(in) :: springs
      !> Sectors whose springs these are.
      integer, intent(in) :: n_sectors
      type(closed_joint), intent(inout) :: joint
      integer :: i

      do i = 1, springs%n_springs/n_sectors
         if (springs%power(i) /= 1) cycle
         call joint%add_row(springs%side_1(i), springs%side_2(i), springs%sector_2(i), &
                            springs%coefficient(i))
      end do
   end subroutine add_springs

   !> Pairs of the first sector; where sectors differ, with the mean stiffness of all of them.
   subroutine add_pairs(contact, joint)
      type(contact_type), intent(in) :: contact
      type(closed_joint), intent(inout) :: joint
      class(pair_law), allocatable :: law
      integer :: c, i, j, n

      if (contact%n_pairs == 0) return
      n = contact%n_pairs/contact%n_alike
      call build_law(contact, contact%side_1 /= 0 .or. contact%side_2 /= 0, law)
      do c = 1, 3
         do i = 1, n
            associate (a => contact%side_1(c, i), b => contact%side_2(c, i))
               if (a == 0 .and. b == 0) cycle
               if (law%prediction%takes(i) .or. law%prediction%order_of(i, c) > 0) then
                  call joint%add_row(a, b, contact%sector_2(i))
               else
                  call joint%add_row(a, b, contact%sector_2(i), sum( &
                     [(law%prediction%stiffness(j, c), j=i, contact%n_pairs, n)])/contact%n_alike)
               end if
            end associate
         end do
      end do
   end subroutine add_pairs

end module fw_closed_pairs
