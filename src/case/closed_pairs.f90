!> What the joint of a case is where it is closed: linear springs, and pairs that stick, those with
!> a gap too. Elastic pairs are their springs; of all others the rows do not move. A pressure along
!> a curve has no stiffness before it is known: closed is its limit, a row that does not move. What
!> slides steadily is not held along its surface.
module fw_closed_pairs
   use fw_closed_joint, only: closed_joint
   use fw_contact_data, only: contact_type, sliding_steady, spring_type
   use fw_kinds, only: wp
   use fw_laws, only: build_law
   use fw_normal_law, only: curved_pairs
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: add_springs, add_pairs, takes_part, is_held

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
            if (.not. takes_part(contact, i, c)) cycle
            associate (a => contact%side_1(c, i), b => contact%side_2(c, i))
               if (is_held(contact, law, i, c)) then
                  call joint%add_row(a, b, contact%sector_2(i))
               else
                  call joint%add_row(a, b, contact%sector_2(i), sum( &
                     [(law%prediction%stiffness(j, c), j=i, contact%n_pairs, n)])/contact%n_alike)
               end if
            end associate
         end do
      end do
   end subroutine add_pairs

   !> Whether a direction of a pair is closed: it is there, and does not slide steadily.
   pure logical function takes_part(contact, pair, component) result(takes)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: pair, component
      real(wp) :: speed(contact%n_pairs, 2)

      takes = contact%side_1(component, pair) /= 0 .or. contact%side_2(component, pair) /= 0
      if (component == 3 .or. contact%sliding /= sliding_steady) return
      speed = contact%speeds()
      takes = takes .and. .not. any(abs(speed(pair, :)) > 0.0_wp)
   end function takes_part

   !> Whether it does not move where it is closed.
   pure logical function is_held(contact, law, pair, component)
      type(contact_type), intent(in) :: contact
      !> Of all pairs.
      class(pair_law), intent(in) :: law
      integer, intent(in) :: pair, component
      logical :: curved(contact%n_pairs)

      is_held = law%prediction%takes(pair) .or. law%prediction%order_of(pair, component) > 0
      if (component < 3 .or. is_held) return
      curved = curved_pairs(contact)
      is_held = curved(pair)
   end function is_held

end module fw_closed_pairs
