!> Namelist text as data: groups and assignments, each with its line.
module fw_namelist_data
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: namelist_type, group_type, entry_type, value_type, section_type
   public :: add_entry, value_count, stray_word, location, is_entry, last_entry, multiply_out

   !> One value, or `repeat` equal ones.
   type :: value_type
      !> Without its quotes; whether it had any.
      character(:), allocatable :: text
      logical :: quoted = .false.
      !> What stands before the star, 2 in 2*1.5, and the line in the file.
      integer :: repeat = 1
      integer :: line = 0
   end type value_type

   !> One subscript: first to last, where `last = 0` is the end of the dimension.
   type :: section_type
      integer :: first = 1
      integer :: last = 0
   end type section_type

   !> One assignment `key(subscripts) = values`.
   type :: entry_type
      !> In lower case.
      character(:), allocatable :: group, key
      type(section_type), allocatable :: sections(:)
      type(value_type), allocatable :: values(:)
      !> Where it begins; 0 of an override.
      integer :: line = 0
      !> Of an override: what messages call it, and its value as it was typed.
      character(:), allocatable :: option, raw
   end type entry_type

   type :: group_type
      character(:), allocatable :: name
      integer :: line = 0
   end type group_type

   type :: namelist_type
      !> Name of the file, for messages.
      character(:), allocatable :: source
      type(group_type), allocatable :: groups(:)
      type(entry_type), allocatable :: entries(:)
      integer :: n_entries = 0
   end type namelist_type

contains

   !> Append an assignment.
   subroutine add_entry(namelist, entry)
      type(namelist_type), intent(inout) :: namelist
      type(entry_type), intent(in) :: entry
      type(entry_type), allocatable :: larger(:)

      if (namelist%n_entries == size(namelist%entries)) then
         ! Doubled, so that the cost stays in proportion to the length of the file.
         allocate (larger(2*size(namelist%entries)))
         larger(:namelist%n_entries) = namelist%entries
         call move_alloc(larger, namelist%entries)
      end if
      namelist%n_entries = namelist%n_entries + 1
      namelist%entries(namelist%n_entries) = entry
   end subroutine add_entry

   !> Number of values with the repeat counts multiplied out.
   pure integer function value_count(entry)
      type(entry_type), intent(in) :: entry
      integer :: i

      value_count = 0
      do i = 1, size(entry%values)
         ! Repeat counts are whatever the file says: the sum must not overflow.
         if (entry%values(i)%repeat > huge(1) - value_count) then
            value_count = huge(1)
            return
         end if
         value_count = value_count + entry%values(i)%repeat
      end do
   end function value_count

   !> Hint at a word among several values: it may be a key whose = was forgotten.
   pure function stray_word(entry) result(hint)
      type(entry_type), intent(in) :: entry
      character(:), allocatable :: hint
      integer :: i

      hint = ''
      do i = 2, size(entry%values)
         associate (value => entry%values(i))
            if (value%quoted .or. len(value%text) < 2 .or. allocated(entry%option)) cycle
            if (scan(value%text(1:1), '.+-0123456789') > 0) cycle
            hint = '; if '//value%text//' is a key, it lacks its ='
            return
         end associate
      end do
   end function stray_word

   !> Where an assignment stands: `file:line`, or the option of the command line.
   pure function location(entry, source) result(place)
      type(entry_type), intent(in) :: entry
      character(*), intent(in), optional :: source
      character(:), allocatable :: place

      if (allocated(entry%option)) then
         place = entry%option
      else
         place = to_text(entry%line)
         if (present(source)) place = source//':'//place
      end if
   end function location

   !> Whether an assignment is to a key.
   pure logical function is_entry(entry, group, key)
      type(entry_type), intent(in) :: entry
      character(*), intent(in) :: group, key

      is_entry = .false.
      if (entry%key == key) is_entry = entry%group == group
   end function is_entry

   !> The last assignment to a key, 0 for none.
   pure integer function last_entry(input, group, key) result(i)
      type(namelist_type), intent(in) :: input
      character(*), intent(in) :: group, key

      ! From the end: the later assignment holds, and overrides stand behind the file.
      do i = input%n_entries, 1, -1
         if (is_entry(input%entries(i), group, key)) return
      end do
      i = 0
   end function last_entry

   !> Values with their repeat counts written out.
   pure subroutine multiply_out(values, repeated)
      type(value_type), intent(in) :: values(:)
      type(value_type), allocatable, intent(out) :: repeated(:)
      integer :: i, n

      allocate (repeated(sum(values%repeat)))
      n = 0
      do i = 1, size(values)
         repeated(n + 1:n + values(i)%repeat) = values(i)
         n = n + values(i)%repeat
      end do
   end subroutine multiply_out

end module fw_namelist_data
