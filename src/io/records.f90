!> The keys that a reader was asked for: what each is and its effective value.
module fw_records
   use fw_key, only: key_type
   use fw_text, only: string_type
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: record_type, record_list

   type :: record_type
      character(:), allocatable :: group
      !> Its place in the list of groups, which finds a record faster than its name.
      integer :: group_number = 0
      type(key_type) :: key
      !> real, integer, logical, text, word or list.
      character(7) :: kind = ''
      !> What is accepted, in words.
      character(:), allocatable :: accepts
      !> The words of a word.
      character(32), allocatable :: words(:)
      !> The default as namelist text; unallocated where there is none.
      character(:), allocatable :: default
      !> The value in effect as namelist text; unallocated where there is none.
      character(:), allocatable :: value
   end type record_type

   type :: record_list
      !> The first `n` are registered; the rest is room for more.
      type(record_type), allocatable :: records(:)
      integer :: n = 0
      !> Groups in the order of their first keys, and what they are for.
      type(string_type), allocatable :: groups(:), purposes(:)
   contains
      procedure :: open
      procedure :: add
      procedure :: set
      procedure :: has
      procedure :: has_group
      procedure :: keys
      procedure :: to_namelist
      procedure, private :: find
      procedure, private :: group_number
   end type record_list

   !> Room for the keys of all groups, so that the list is hardly ever moved.
   integer, parameter :: usual_records = 320

contains

   !> Register a group (once).
   pure subroutine open(self, group, purpose)
      class(record_list), intent(inout) :: self
      character(*), intent(in) :: group, purpose

      if (.not. allocated(self%records)) then
         allocate (self%records(usual_records), self%groups(0), self%purposes(0))
      end if
      if (self%has_group(group)) return
      call append(self%groups, group)
      call append(self%purposes, purpose)
   end subroutine open

   !> Register a key (once).
   pure subroutine add(self, record)
      class(record_list), intent(inout) :: self
      type(record_type), intent(in) :: record
      type(record_type), allocatable :: longer(:)

      if (self%has(record%group, record%key%name)) return
      if (self%n == size(self%records)) then
         allocate (longer(2*self%n))
         longer(:self%n) = self%records
         call move_alloc(longer, self%records)
      end if
      self%n = self%n + 1
      self%records(self%n) = record
      self%records(self%n)%group_number = self%group_number(record%group)
   end subroutine add

   !> Set the effective value of a registered key; an empty one is none.
   pure subroutine set(self, group, key, value)
      class(record_list), intent(inout) :: self
      character(*), intent(in) :: group, key, value
      integer :: i

      i = self%find(group, key)
      if (i == 0) return
      if (len(value) > 0) then
         self%records(i)%value = value
      else if (allocated(self%records(i)%value)) then
         deallocate (self%records(i)%value)
      end if
   end subroutine set

   !> Whether a key was given.
   pure logical function has(self, group, key)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group, key

      has = self%find(group, key) > 0
   end function has

   pure logical function has_group(self, group)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group

      has_group = self%group_number(group) > 0
   end function has_group

   !> Place of a group in the list, 0 where it is not there; the last ones are asked for most.
   pure integer function group_number(self, group) result(g)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group

      do g = size(self%groups), 1, -1
         if (self%groups(g)%text == group) return
      end do
      g = 0
   end function group_number

   !> The keys of a group.
   pure function keys(self, group) result(names)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group
      type(string_type), allocatable :: names(:)
      integer :: i

      allocate (names(0))
      do i = 1, self%n
         if (self%records(i)%group /= group) cycle
         call append(names, trim(self%records(i)%key%name))
      end do
   end function keys

   !> All values in effect, with what is accepted beside the short ones.
   pure function to_namelist(self) result(text)
      class(record_list), intent(in) :: self
      character(:), allocatable :: text
      integer :: g, i

      text = ''
      do g = 1, size(self%groups)
         text = text//'&'//self%groups(g)%text//new_line('a')
         do i = 1, self%n
            if (self%records(i)%group_number /= g) cycle
            if (allocated(self%records(i)%value)) text = text//record_text(self%records(i))
         end do
         text = text//'/'//new_line('a')
      end do
   end function to_namelist

   !> `key = value`, and what is accepted behind it where both fit a line.
   pure function record_text(record) result(text)
      type(record_type), intent(in) :: record
      character(:), allocatable :: text
      integer, parameter :: comment_column = 40

      text = '   '//trim(record%key%name)//' = '//record%value
      if (index(record%value, new_line('a')) == 0 .and. len(text) < comment_column) then
         text = text//repeat(' ', comment_column - len(text))//'! '//record%accepts
      end if
      text = text//new_line('a')
   end function record_text

   !> From the last one on: what was registered last is set next.
   pure integer function find(self, group, key) result(i)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group, key
      integer :: g

      g = self%group_number(group)
      do i = self%n, 1, -1
         if (self%records(i)%group_number /= g) cycle
         if (self%records(i)%key%name == key) return
      end do
      i = 0
   end function find

end module fw_records
