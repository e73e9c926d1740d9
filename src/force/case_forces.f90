!> From the pairs and springs of a case to the laws of their forces.
module fw_case_forces
   use fw_contact_data, only: contact_type, spring_type
   use fw_force_list, only: force_list
   use fw_laws, only: build_law
   use fw_pair_law, only: pair_law
   use fw_polynomial_law, only: new_polynomial
   implicit none (type, external)
   private

   public :: new_forces

contains

   !> The list of laws: springs, if there are any, and the pairs, if need be none.
   subroutine new_forces(contact, springs, pair_row, spring_row, by_events, highest_harmonic, &
                         forces)
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      !> Rows of the components of the pairs (3, n_pairs) and of the springs (n_springs).
      integer, intent(in) :: pair_row(:, :), spring_row(:)
      !> Follow the pairs from event to event, where their law can.
      logical, intent(in) :: by_events
      !> Of the elongations of springs; 0: no limit.
      integer, intent(in) :: highest_harmonic
      type(force_list), intent(out) :: forces
      class(pair_law), allocatable :: law, located

      if (springs%n_springs > 0) then
         call forces%add(new_polynomial(springs%coefficient, springs%power, highest_harmonic), &
                         reshape(spring_row, [1, springs%n_springs]))
      end if
      ! Without pairs the law is built all the same, empty: nothing has to ask whether there is one.
      call build_law(contact, pair_row > 0, law)
      if (by_events .and. law%facts%has_events) then
         call law%located(located)
         call move_alloc(located, law)
      end if
      call forces%add(law, pair_row)
      ! Where in the list the pairs stand.
      forces%pairs = forces%n_laws
   end subroutine new_forces

end module fw_case_forces
