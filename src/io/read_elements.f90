!> Elements of all kinds: pairs and springs (fw_read_contact), and the groups of those that are
!> neither, on top of those of the model: what the case gives replaces one array after the other,
!> unless it has another number of elements.
module fw_read_elements
   use fw_element_group, only: element_group
   use fw_elements, only: element_list
   use fw_error, only: error_type, fatal_error, status_input
   use fw_read_contact, only: read_contact, read_springs
   use fw_read_obstacle, only: check_gap_orders, read_obstacle
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   public :: check_gap_orders, read_contact, read_elements, read_obstacle, read_springs, &
             user_element

contains

   !> All groups, then the laws of a calling program: these come last, so that their numbers in
   !> messages and results follow those of the keys.
   subroutine read_elements(reader, held, folder, elements, error, laws)
      type(reader_type), intent(inout) :: reader
      !> What the model holds.
      type(element_list), intent(in) :: held
      !> Of the namelist.
      character(*), intent(in) :: folder
      type(element_list), intent(out) :: elements
      type(error_type), allocatable, intent(out) :: error
      !> Elements that the calling program has added.
      type(user_element), intent(in), optional :: laws(:)
      type(element_list) :: nothing
      integer :: k

      call nothing%start()
      elements = nothing
      if (allocated(held%slot)) elements = held
      do k = 1, size(elements%slot)
         call read_group(reader, nothing%slot(k)%group, folder, elements%slot(k)%group, error)
         if (allocated(error)) return
      end do
      ! Without their number the constants would be left out, and the function would find none.
      if (reader%given('user', 'parameters') .and. .not. reader%given('user', 'n_parameters')) then
         call reader%refuse('user', 'n_parameters', 'is missing: must be how many constants '// &
                            'each function gets')
      end if
      if (.not. present(laws)) return
      if (.not. reader%failed()) call check_dofs(laws, reader%extents('(n_dof+n_rows)'), error)
      if (.not. (allocated(error) .or. reader%failed())) call elements%add_laws(laws)
   end subroutine read_elements

   !> Dofs of laws that no key has brought.
   subroutine check_dofs(laws, n_dof, error)
      type(user_element), intent(in) :: laws(:)
      integer, intent(in) :: n_dof(1)
      type(error_type), allocatable, intent(out) :: error
      integer :: c, i

      do i = 1, size(laws)
         do c = 1, laws(i)%n_in
            associate (one => laws(i)%side_1(c), two => laws(i)%side_2(c))
               if (max(abs(one), abs(two)) <= n_dof(1) .and. abs(one) /= abs(two)) cycle
               call fatal_error(error, 'user law '//trim(laws(i)%name)//': input '//to_text(c)// &
                                ' is between dofs '//to_text(one)//' and '//to_text(two)// &
                                ': must be two different ones from 0 to '//to_text(n_dof(1))// &
                                ', or their negatives', status_input)
               return
            end associate
         end do
      end do
   end subroutine check_dofs

   !> One group. Another number of elements than the model holds makes the arrays of the model
   !> useless: then all of them have to be given. Libraries are opened only once nothing else is
   !> wrong.
   subroutine read_group(reader, empty, folder, group, error)
      type(reader_type), intent(inout) :: reader
      !> Without elements, and with the defaults of its keys.
      class(element_group), intent(in) :: empty
      character(*), intent(in) :: folder
      class(element_group), allocatable, intent(inout) :: group
      type(error_type), allocatable, intent(out) :: error
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
      call group%load(folder, error)
      if (.not. allocated(error)) call group%settle()
   end subroutine read_group

end module fw_read_elements
