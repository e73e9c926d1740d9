!> Fortran namelist text as data: groups, keys, subscripts and values, each with its line.
!>
!> Written instead of a namelist READ so that every message can name the line, the key and the
!> value found. Understood: `&group ... /` (or `&end`), `!` comments, texts in either quote,
!> repeat counts, subscripts with sections, names in any case, values over several lines.
module fw_namelist
   use fw_cursor, only: cursor_type, is_digit
   use fw_error, only: error_type, fatal_error, status_input, status_usage
   use fw_text, only: lower_case, to_text
   implicit none (type, external)
   private

   public :: namelist_type, group_type, entry_type, value_type, section_type
   public :: parse_namelist, parse_override, add_entry, value_count, location

   !> One value, or `repeat` equal ones.
   type :: value_type
      character(:), allocatable :: text
      logical :: quoted = .false.
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
      character(:), allocatable :: group, key
      type(section_type), allocatable :: sections(:)
      type(value_type), allocatable :: values(:)
      integer :: line = 0
      !> Of an override: the option as it was typed, and its value as it was typed.
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

   !> Parse the whole text of a namelist file.
   subroutine parse_namelist(text, source, namelist, error)
      character(*), intent(in) :: text
      !> Name of the file, for messages.
      character(*), intent(in) :: source
      type(namelist_type), intent(out) :: namelist
      type(error_type), allocatable, intent(out) :: error
      type(cursor_type) :: cursor

      namelist%source = source
      allocate (namelist%groups(0), namelist%entries(16))
      cursor%text = text
      if (index(text, byte_order_mark()) == 1) cursor%position = 4
      do
         call cursor%skip_blank()
         if (cursor%at_end()) return
         call parse_group(cursor, namelist, error)
         if (allocated(error)) return
      end do
   end subroutine parse_namelist

   !> Parse `group%key=value` or `group%key(subscripts)=value` of a command line.
   subroutine parse_override(option, entry, error)
      character(*), intent(in) :: option
      type(entry_type), intent(out) :: entry
      type(error_type), allocatable, intent(out) :: error
      type(cursor_type) :: cursor
      character(:), allocatable :: name
      integer :: percent

      entry%option = option
      cursor%in_file = .false.
      cursor%text = trim(adjustl(option))
      call cursor%take_name(name)
      percent = index(name, '%')
      entry%group = name(:max(percent - 1, 0))
      entry%key = name(percent + 1:)
      if (len(entry%group) > 0 .and. len(entry%key) > 0 .and. index(entry%key, '%') == 0) then
         call parse_sections(cursor, location(entry), entry, error)
         if (allocated(error)) return
         if (cursor%peek() == '=') then
            cursor%position = cursor%position + 1
            entry%raw = trim(adjustl(cursor%text(cursor%position:)))
            call parse_values(cursor, location(entry), entry, error)
            ! Any text may follow the =, also one that is no list of values: `case%title=it's`.
            if (allocated(error) .and. len(entry%raw) > 0) then
               deallocate (error)
               entry%values = [value_type(text=entry%raw)]
            end if
            if (.not. allocated(error)) return
            deallocate (error)
         end if
      end if
      call fatal_error(error, location(entry)//': must have the form '// &
                       '--set group%key=value, such as --set solver%tolerance=1e-9', status_usage)
   end subroutine parse_override

   !> One group, from its & to its /.
   subroutine parse_group(cursor, namelist, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(inout) :: namelist
      type(error_type), allocatable, intent(out) :: error
      type(group_type) :: group
      type(entry_type) :: entry

      call parse_group_name(cursor, namelist, group, error)
      do while (.not. allocated(error))
         call cursor%skip_blank()
         if (cursor%at_end()) then
            call fatal_error(error, at_line(namelist, group%line)//': &'//group%name// &
                             ' is not closed: end the group with a /', status_input)
         else if (cursor%peek() == '/') then
            cursor%position = cursor%position + 1
            return
         else if (cursor%peek() == '&') then
            call close_by_name(cursor, namelist, group, error)
            return
         else
            call parse_entry(cursor, namelist%source, group, entry, error)
            if (.not. allocated(error)) call add_entry(namelist, entry)
         end if
      end do
   end subroutine parse_group

   !> The & and the name; a group may be given once.
   subroutine parse_group_name(cursor, namelist, group, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(inout) :: namelist
      type(group_type), intent(out) :: group
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: rest
      logical :: found
      integer :: i

      group%line = cursor%line
      if (cursor%peek() /= '&') then
         call cursor%take_through(achar(10), rest, found)
         call fatal_error(error, at_line(namelist, group%line)//': "'//trim(rest)// &
                          '" stands outside of any group: a group is &name ... /, and a / '// &
                          'outside of quotes ends it', status_input)
         return
      end if
      cursor%position = cursor%position + 1
      call cursor%take_name(group%name)
      do i = 1, size(namelist%groups)
         if (namelist%groups(i)%name /= group%name) cycle
         call fatal_error(error, at_line(namelist, group%line)//': group &'//group%name// &
                          ' is given twice (first in line '// &
                          to_text(namelist%groups(i)%line)//'): join the two', status_input)
         return
      end do
      namelist%groups = [namelist%groups, group]
   end subroutine parse_group_name

   !> `&end` closes a group; any other &name shows that the / was forgotten.
   subroutine close_by_name(cursor, namelist, group, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(in) :: namelist
      type(group_type), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: name

      cursor%position = cursor%position + 1
      call cursor%take_name(name)
      if (name == 'end') return
      call fatal_error(error, at_line(namelist, group%line)//': &'//group%name// &
                       ' is not closed: put a / before &'//name//' in line '// &
                       to_text(cursor%line), status_input)
   end subroutine close_by_name

   subroutine parse_entry(cursor, source, group, entry, error)
      type(cursor_type), intent(inout) :: cursor
      character(*), intent(in) :: source
      type(group_type), intent(in) :: group
      type(entry_type), intent(out) :: entry
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: place

      entry%group = group%name
      entry%line = cursor%line
      place = source//':'//to_text(cursor%line)//': &'//group%name
      call cursor%take_name(entry%key)
      if (len(entry%key) == 0) then
         call fatal_error(error, place//': "'//cursor%peek()//'" stands where a key is expected: '// &
                          'write key = value', status_input)
         return
      end if
      place = place//' '//entry%key
      call parse_sections(cursor, place, entry, error)
      if (allocated(error)) return
      call cursor%skip_blank()
      if (cursor%peek() /= '=') then
         call fatal_error(error, place//': the = is missing: write '//entry%key// &
                          ' = value', status_input)
         return
      end if
      cursor%position = cursor%position + 1
      call parse_values(cursor, place, entry, error)
   end subroutine parse_entry

   !> Subscripts in parentheses, if any; the cursor is left behind them.
   subroutine parse_sections(cursor, place, entry, error)
      type(cursor_type), intent(inout) :: cursor
      character(*), intent(in) :: place
      type(entry_type), intent(inout) :: entry
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: content
      logical :: ok
      integer :: comma

      allocate (entry%sections(0))
      call cursor%skip_blank()
      if (cursor%peek() /= '(') return
      cursor%position = cursor%position + 1
      call cursor%take_through(')', content, ok)
      content = content//','
      do while (ok .and. len(content) > 0)
         comma = index(content, ',')
         entry%sections = [entry%sections, to_section(content(:comma - 1), ok)]
         content = content(comma + 1:)
      end do
      call cursor%skip_blank()
      if (.not. ok) call fatal_error(error, place//': subscripts must be positive numbers or '// &
                                     'sections such as (2), (1:3) or (:,1)', status_input)
   end subroutine parse_sections

   !> One subscript: `2`, `1:3`, `2:`, `:4` or `:`.
   type(section_type) function to_section(text, ok) result(section)
      character(*), intent(in) :: text
      logical, intent(out) :: ok
      integer :: colon, status

      ok = verify(text, '0123456789: ') == 0 .and. len_trim(text) > 0
      if (.not. ok) return
      status = 0
      colon = index(text, ':')
      if (colon == 0) then
         read (text, *, iostat=status) section%first
         section%last = section%first
      else
         if (len_trim(text(:colon - 1)) > 0) read (text(:colon - 1), *, iostat=status) section%first
         ok = status == 0
         if (len_trim(text(colon + 1:)) > 0) then
            read (text(colon + 1:), *, iostat=status) section%last
            ok = ok .and. section%last >= section%first
         end if
      end if
      ok = ok .and. status == 0 .and. section%first > 0 .and. index(text, ':', .true.) == colon
   end function to_section

   !> Values up to the next key or the end of the group.
   subroutine parse_values(cursor, place, entry, error)
      type(cursor_type), intent(inout) :: cursor
      character(*), intent(in) :: place
      type(entry_type), intent(inout) :: entry
      type(error_type), allocatable, intent(out) :: error
      type(value_type), allocatable :: values(:)
      integer :: n
      logical :: after_value

      allocate (values(8))
      n = 0
      after_value = .false.
      do
         call cursor%skip_blank()
         if (cursor%at_end() .or. cursor%is_at_key()) exit
         if (cursor%in_file .and. scan(cursor%peek(), '/&') > 0) exit
         if (cursor%peek() == ',' .and. after_value) then
            cursor%position = cursor%position + 1
            after_value = .false.
            cycle
         end if
         if (n == size(values)) call grow(values)
         n = n + 1
         call parse_value(cursor, place, values(n), error)
         if (allocated(error)) return
         after_value = .true.
      end do
      if (n == 0) call fatal_error(error, place//': has no value', status_input)
      entry%values = values(:n)
   end subroutine parse_values

   !> One value with its repeat count.
   subroutine parse_value(cursor, place, value, error)
      type(cursor_type), intent(inout) :: cursor
      character(*), intent(in) :: place
      type(value_type), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      integer :: star, status
      logical :: ok

      value%line = cursor%line
      call cursor%take_word(value%text)
      star = index(value%text, '*')
      ok = .true.
      if (star > 1) then
         ok = verify(value%text(:star - 1), '0123456789') == 0
         if (ok) read (value%text(:star - 1), *, iostat=status) value%repeat
         if (ok) ok = status == 0 .and. value%repeat > 0
         value%text = value%text(star + 1:)
      end if
      if (ok .and. len(value%text) == 0 .and. scan(cursor%peek(), '''"') > 0) then
         value%quoted = .true.
         call cursor%take_quoted(value%text, ok)
         if (.not. ok) call fatal_error(error, place//': a text is not closed by its quote in '// &
                                        'line '//to_text(value%line), status_input)
      else if (len(value%text) == 0 .or. .not. ok) then
         call fatal_error(error, place//': "'//cursor%peek()//'" stands where a value is '// &
                          'expected (line '//to_text(value%line)//')', status_input)
      end if
   end subroutine parse_value

   !> Append an assignment.
   subroutine add_entry(namelist, entry)
      type(namelist_type), intent(inout) :: namelist
      type(entry_type), intent(in) :: entry
      type(entry_type), allocatable :: larger(:)

      if (namelist%n_entries == size(namelist%entries)) then
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
         if (entry%values(i)%repeat > huge(1) - value_count) then
            value_count = huge(1)
            return
         end if
         value_count = value_count + entry%values(i)%repeat
      end do
   end function value_count

   !> Where an assignment stands: `file:line`, or the option of the command line.
   pure function location(entry, source) result(place)
      type(entry_type), intent(in) :: entry
      character(*), intent(in), optional :: source
      character(:), allocatable :: place

      if (allocated(entry%option)) then
         place = '--set '//entry%option
      else
         place = to_text(entry%line)
         if (present(source)) place = source//':'//place
      end if
   end function location

   pure function at_line(namelist, line) result(place)
      type(namelist_type), intent(in) :: namelist
      integer, intent(in) :: line
      character(:), allocatable :: place

      place = namelist%source//':'//to_text(line)
   end function at_line

   pure subroutine grow(values)
      type(value_type), allocatable, intent(inout) :: values(:)
      type(value_type), allocatable :: larger(:)

      allocate (larger(2*size(values)))
      larger(:size(values)) = values
      call move_alloc(larger, values)
   end subroutine grow

   !> Some editors begin a UTF-8 file with these three bytes.
   pure function byte_order_mark() result(mark)
      character(3) :: mark

      mark = char(239)//char(187)//char(191)
   end function byte_order_mark

end module fw_namelist
