!> A block of a mission as a case of its own: the case with the change of the block on top.
module fw_mission_block
   use fw_case, only: case_type
   use fw_changed_case, only: read_changed
   use fw_error, only: error_type, fatal_error, status_input
   use fw_contact_data, only: contact_type
   use fw_kinds, only: wp
   use fw_read_mission, only: split_change
   use fw_text, only: string_type, to_text
   use fw_wear_options, only: mu_by_energy, wear_archard
   implicit none (type, external)
   private

   public :: read_block

contains

   !> Read a block, which wears for its cycles of a flight.
   subroutine read_block(case, number, block, error)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      type(case_type), intent(out) :: block
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: items(:)

      call split_change(case%mission%change(number)%text, items)
      call read_changed(case, items, '&mission change('//to_text(number)//')', block, error)
      if (.not. allocated(error)) call check_alike(case, number, block, error)
      if (allocated(error)) return
      block%mission%n_blocks = 0
      block%wear%n_cycles = case%mission%cycles(number)
   end subroutine read_block

   !> Depths pass from block to block, and rows are all alike.
   subroutine check_alike(case, number, block, error)
      type(case_type), intent(in) :: case, block
      integer, intent(in) :: number
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: what
      associate (c => case%contact, own => block%contact)
         if (own%n_pairs /= c%n_pairs) then
            what = 'has '//to_text(own%n_pairs)//' contact pairs, the case '//to_text(c%n_pairs)
         else if (any(own%side_1 /= c%side_1) .or. any(own%side_2 /= c%side_2)) then
            what = 'has contact pairs between other dofs than the case'
         else if (any(abs(own%area - c%area) > 1.0e-12_wp*c%area)) then
            what = 'has contact pairs of other areas than the case'
         else if (case%wear%mu_by == mu_by_energy .and. &
                  differs(case%wear%coefficient, block%wear%coefficient)) then
            what = "has other wear%coefficient than the case, with wear%mu_by = 'energy': its "// &
                   "depth would not tell the energy; use 'depth'"
         else if (changes_energy(case, block)) then
            what = "has other friction than the case, with wear%mu_by = 'energy': its depth "// &
                   "would not tell the energy; use 'depth', or wear%law = 'energy'"
         else if (block%harmonics%n_harmonics > case%harmonics%n_harmonics) then
            what = 'has more harmonics than the case, whose rows hold '// &
                   to_text(case%harmonics%n_harmonics)
         else if (block%model%n_observed() /= case%model%n_observed()) then
            what = 'observes '//to_text(block%model%n_observed())//' quantities, the case '// &
                   to_text(case%model%n_observed())
         else
            if (any(laws_of(c) /= laws_of(own))) what = 'has pairs of other laws than the case'
         end if
      end associate
      if (.not. allocated(what)) return
      call fatal_error(error, '&mission change('//to_text(number)//'): '// &
                       trim(case%mission%title(number))//' '//what//': the blocks of a mission '// &
                       'wear the same pairs', status_input)
   end subroutine check_alike

   !> Whether energy follows from the depth by the friction on the way, and that is another one.
   pure logical function changes_energy(case, block)
      type(case_type), intent(in) :: case, block

      changes_energy = .false.
      if (case%wear%mu_by /= mu_by_energy .or. case%wear%law /= wear_archard) return
      changes_energy = differs(case%contact%mu, block%contact%mu) .or. &
                       differs(case%wear%mu_final, block%wear%mu_final) .or. &
                       differs(case%wear%mu_scale, block%wear%mu_scale)
   end function changes_energy

   pure logical function differs(a, b)
      real(wp), intent(in) :: a(:), b(:)

      differs = any(abs(a - b) > 0.0_wp)
   end function differs

   !> Number of the law of every pair (n_pairs).
   pure function laws_of(contact) result(numbers)
      type(contact_type), intent(in) :: contact
      integer :: numbers(contact%n_pairs)

      numbers = contact%law
      if (allocated(contact%law_of)) numbers = contact%law_of
   end function laws_of

end module fw_mission_block
