!> The keys that a reader asked for: what each accepts and its effective value.
module fw_records
   use fw_text, only: string_type
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: record_list

   type :: record_type
      character(:), allocatable :: group, key
      !> What is accepted, in words.
      character(:), allocatable :: accepts
      !> The value in effect as namelist text; unallocated where there is none.
      character(:), allocatable :: value
   end type record_type

   type :: record_list
      private
      type(record_type), allocatable :: records(:)
   contains
      procedure :: add
      procedure :: set
      procedure :: has
      procedure :: has_group
      procedure :: groups
      procedure :: keys
      procedure :: to_namelist
      procedure, private :: find
   end type record_list

contains

   !> Register a key (once).
   pure subroutine add(self, group, key, accepts)
      class(record_list), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      type(record_type) :: record

      if (.not. allocated(self%records)) allocate (self%records(0))
      if (self%has(group, key)) return
      record%group = group
      record%key = key
      record%accepts = accepts
      self%records = [self%records, record]
   end subroutine add

   !> Set the effective value of a registered key.
   pure subroutine set(self, group, key, value)
      class(record_list), intent(inout) :: self
      character(*), intent(in) :: group, key, value
      integer :: i

      i = self%find(group, key)
      if (i > 0) self%records(i)%value = value
   end subroutine set

   pure logical function has(self, group, key)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group, key

      has = self%find(group, key) > 0
   end function has

   pure logical function has_group(self, group)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group
      integer :: i

      has_group = .false.
      if (.not. allocated(self%records)) return
      do i = 1, size(self%records)
         has_group = has_group .or. self%records(i)%group == group
      end do
   end function has_group

   !> The groups in the order of their first keys.
   pure function groups(self) result(names)
      class(record_list), intent(in) :: self
      type(string_type), allocatable :: names(:)
      integer :: i, k
      logical :: known

      allocate (names(0))
      do i = 1, size(self%records)
         known = .false.
         do k = 1, size(names)
            known = known .or. names(k)%text == self%records(i)%group
         end do
         if (.not. known) call append(names, self%records(i)%group)
      end do
   end function groups

   !> The keys of a group.
   pure function keys(self, group) result(names)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group
      type(string_type), allocatable :: names(:)
      integer :: i

      allocate (names(0))
      if (.not. allocated(self%records)) return
      do i = 1, size(self%records)
         if (self%records(i)%group /= group) cycle
         call append(names, self%records(i)%key)
      end do
   end function keys

   !> All values in effect, with what is accepted beside the short ones.
   pure function to_namelist(self) result(text)
      class(record_list), intent(in) :: self
      character(:), allocatable :: text
      type(string_type), allocatable :: names(:)
      integer :: g, i

      text = ''
      names = self%groups()
      do g = 1, size(names)
         text = text//'&'//names(g)%text//new_line('a')
         do i = 1, size(self%records)
            if (self%records(i)%group /= names(g)%text) cycle
            if (allocated(self%records(i)%value)) text = text//record_text(self%records(i))
         end do
         text = text//'/'//new_line('a')
      end do
   end function to_namelist

   pure function record_text(record) result(text)
      type(record_type), intent(in) :: record
      character(:), allocatable :: text
      integer, parameter :: comment_column = 40

      text = '   '//record%key//' = '//record%value
      if (index(record%value, new_line('a')) == 0 .and. len(text) < comment_column) then
         text = text//repeat(' ', comment_column - len(text))//'! '//record%accepts
      end if
      text = text//new_line('a')
   end function record_text

   pure integer function find(self, group, key) result(i)
      class(record_list), intent(in) :: self
      character(*), intent(in) :: group, key

      if (allocated(self%records)) then
         do i = 1, size(self%records)
            if (self%records(i)%group == group .and. self%records(i)%key == key) return
         end do
      end if
      i = 0
   end function find

end module fw_records
