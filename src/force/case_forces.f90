!> From the pairs, springs and other elements of a case to the laws of their forces.
module fw_case_forces
   use fw_contact_data, only: contact_type, spring_type
   use fw_elements, only: element_list, n_element_kinds
   use fw_force_law, only: force_law
   use fw_force_list, only: force_list
   use fw_laws, only: build_law
   use fw_pair_law, only: pair_law
   use fw_polynomial_law, only: new_polynomial
   implicit none (type, external)
   private

   public :: element_rows, new_forces

   !> Rows of the elements of a kind (n_components, n_elements), as their law has components.
   type :: element_rows
      integer, allocatable :: row(:, :)
   end type element_rows

contains

   !> The list of laws: springs, other elements, if there are any, and the pairs, if need be none.
   subroutine new_forces(contact, springs, elements, pair_row, spring_row, element_row, &
                         by_events, highest_harmonic, forces)
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      !> Rows of the components of the pairs (3, n_pairs) and of the springs (n_springs).
      integer, intent(in) :: pair_row(:, :), spring_row(:)
      !> Of the inputs of the other elements, for each kind.
      type(element_rows), intent(in) :: element_row(:)
      !> Follow the pairs from event to event, where their law can.
      logical, intent(in) :: by_events
      !> Of the elongations of springs; 0: no limit.
      integer, intent(in) :: highest_harmonic
      type(force_list), intent(out) :: forces
      class(pair_law), allocatable :: law, located

      if (springs%n_springs > 0) then
         call forces%add(new_polynomial(springs%coefficient, springs%power, highest_harmonic), &
                         reshape(spring_row, [1, springs%n_springs]))
         forces%springs = forces%n_laws
      end if
      call add_elements(elements, element_row, forces)
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

   !> A law for each kind that there is.
   subroutine add_elements(elements, element_row, forces)
      type(element_list), intent(in) :: elements
      type(element_rows), intent(in) :: element_row(:)
      type(force_list), intent(inout) :: forces
      class(force_law), allocatable :: law
      integer :: k

      allocate (forces%elements(n_element_kinds), source=0)
      do k = 1, size(element_row)
         associate (group => elements%slot(k)%group, rows => element_row(k)%row)
            if (group%n_elements == 0) cycle
            call group%make_law(size(rows, 2)/group%n_elements, law)
            call forces%add(law, rows)
            forces%elements(k) = forces%n_laws
         end associate
      end do
   end subroutine add_elements

end module fw_case_forces
