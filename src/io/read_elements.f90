!> Elements of all kinds: pairs and springs (fw_read_contact), and the groups of those that are
!> neither, on top of those of the model: what the case gives replaces one array after the other,
!> unless it has another number of elements.
module fw_read_elements
   use fw_element_group, only: element_group
   use fw_elements, only: element_list
   use fw_read_contact, only: read_contact, read_springs
   use fw_reader, only: reader_type
   implicit none (type, external)
   private

   public :: read_contact, read_elements, read_springs

contains

   subroutine read_elements(reader, held, elements)
      type(reader_type), intent(inout) :: reader
      !> What the model holds.
      type(element_list), intent(in) :: held
      type(element_list), intent(out) :: elements
      type(element_list) :: nothing
      integer :: k

      call nothing%start()
      elements = nothing
      if (allocated(held%slot)) elements = held
      do k = 1, size(elements%slot)
         call read_group(reader, nothing%slot(k)%group, elements%slot(k)%group)
      end do
   end subroutine read_elements

   subroutine read_group(reader, empty, group)
      type(reader_type), intent(inout) :: reader
      class(element_group), intent(in) :: empty
      class(element_group), allocatable, intent(inout) :: group
      character(160) :: text
      character(24) :: key
      integer :: n, n_held

      n_held = group%n_held()
      ! The default of the key is what the model holds.
      group%n_given = n_held
      call group%bind_count(reader)
      n = group%n_given
      if (n /= n_held) then
         deallocate (group)
         allocate (group, source=empty)
         group%n_given = n
      end if
      call group%bind_keys(reader)
      if (n == 0 .and. n_held == 0 .and. reader%has_group(trim(empty%name())) .and. &
          .not. reader%given(trim(empty%name()), trim(empty%count_key()))) then
         call reader%refuse(trim(empty%name()), trim(empty%count_key()), &
                            'is missing: must be how many there are')
      end if
      if (n == 0 .or. reader%failed()) return
      call group%find_fault(key, text)
      if (len_trim(key) > 0) then
         call reader%refuse(trim(empty%name()), trim(key), trim(text))
         return
      end if
      call group%settle()
   end subroutine read_group

end module fw_read_elements
