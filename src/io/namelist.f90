!> Fortran namelist text as data: groups, keys, subscripts and values, each with its line.
!>
!> Written instead of a namelist READ so that every message can name the line, the key and the
!> value found. Understood: `&group ... /` (or `&end`), `!` comments, texts in either quote,
!> repeat counts, subscripts with sections, names in any case, values over several lines.
module fw_namelist
   use fw_cursor, only: cursor_type
   use fw_error, only: error_type, fatal_error, status_input, status_usage
   use fw_namelist_data, only: namelist_type, group_type, entry_type, add_entry, location, &
      value_type, section_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: parse_namelist, parse_override

   ! The two ends of a namelist assignment: its subscripts and its values.
   !
   ! Of a line  key(2:3) = 2*1.5, 'text'  this is  (2:3)  and  2*1.5, 'text'. What the values mean
   ! is up to the key: here they stay text, with their line for messages.

contains

   !> Parse the whole text of a namelist file.
   subroutine parse_namelist(text, source, input, error)
      character(*), intent(in) :: text
      !> Name of the file, for messages.
      character(*), intent(in) :: source
      type(namelist_type), intent(out) :: input
      type(error_type), allocatable, intent(out) :: error
      type(cursor_type) :: cursor

      input%source = source
      allocate (input%groups(0), input%entries(16))
      cursor%text = text
      ! The mark that some editors put first is three bytes long.
      if (index(text, byte_order_mark()) == 1) cursor%position = 4
      do
         call cursor%skip_blank()
         if (cursor%at_end()) return
         call parse_group(cursor, input, error)
         if (allocated(error)) return
      end do
   end subroutine parse_namelist

   !> Parse `group%key=value` or `group%key(subscripts)=value` of a command line or a program.
   subroutine parse_override(option, entry, error, origin)
      character(*), intent(in) :: option
      type(entry_type), intent(out) :: entry
      type(error_type), allocatable, intent(out) :: error
      !> What messages put before the option (default: '--set').
      character(*), intent(in), optional :: origin
      type(cursor_type) :: cursor
      character(:), allocatable :: name
      integer :: percent

      entry%option = '--set '//option
      if (present(origin)) entry%option = origin//' '//option
      cursor%in_file = .false.
      cursor%text = trim(adjustl(option))
      call cursor%take_name(name)
      ! take_name goes over the %, so that it holds group and key.
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
               if (allocated(entry%values)) deallocate (entry%values)
               allocate (entry%values(1))
               entry%values(1)%text = entry%raw
            end if
            if (.not. allocated(error)) return
            deallocate (error)
         end if
      end if
      call fatal_error(error, location(entry)//': must have the form '// &
                       'group%key=value, such as solver%tolerance=1e-9', status_usage)
   end subroutine parse_override

   !> One group, from its & to its /.
   subroutine parse_group(cursor, input, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(inout) :: input
      type(error_type), allocatable, intent(out) :: error
      type(group_type) :: group
      type(entry_type) :: entry

      call parse_group_name(cursor, input, group, error)
      do while (.not. allocated(error))
         call cursor%skip_blank()
         if (cursor%at_end()) then
            call fatal_error(error, at_line(input, group%line)//': &'//group%name// &
                             ' is not closed: end the group with a /', status_input)
         else if (cursor%peek() == '/') then
            cursor%position = cursor%position + 1
            return
         else if (cursor%peek() == '&') then
            call close_by_name(cursor, input, group, error)
            return
         else
            call parse_entry(cursor, input%source, group, entry, error)
            if (.not. allocated(error)) call add_entry(input, entry)
         end if
      end do
   end subroutine parse_group

   !> The & and the name; a group may be given once.
   subroutine parse_group_name(cursor, input, group, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(inout) :: input
      type(group_type), intent(out) :: group
      type(error_type), allocatable, intent(out) :: error
      !> A binary file may have no ends of lines.
      integer, parameter :: most_quoted = 60
      character(:), allocatable :: rest
      logical :: found
      integer :: i

      group%line = cursor%line
      if (cursor%peek() /= '&') then
         call cursor%take_through(achar(10), rest, found)
         rest = trim(rest(:min(len(rest), most_quoted)))
         call fatal_error(error, at_line(input, group%line)//': "'//rest// &
                          '" stands outside of any group: a group is &name ... /, and a / '// &
                          'outside of quotes ends it', status_input)
         return
      end if
      cursor%position = cursor%position + 1
      call cursor%take_name(group%name)
      do i = 1, size(input%groups)
         if (input%groups(i)%name /= group%name) cycle
         call fatal_error(error, at_line(input, group%line)//': group &'//group%name// &
                          ' is given twice (first in line '// &
                          to_text(input%groups(i)%line)//'): join the two', status_input)
         return
      end do
      input%groups = [input%groups, group]
   end subroutine parse_group_name

   !> `&end` closes a group; any other &name shows that the / was forgotten.
   subroutine close_by_name(cursor, input, group, error)
      type(cursor_type), intent(inout) :: cursor
      type(namelist_type), intent(in) :: input
      type(group_type), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: name

      cursor%position = cursor%position + 1
      call cursor%take_name(name)
      if (name == 'end') return
      call fatal_error(error, at_line(input, group%line)//': &'//group%name// &
                       ' is not closed: put a / before &'//name//' in line '// &
                       to_text(cursor%line), status_input)
   end subroutine close_by_name

   !> A key, its subscripts, the = and its values.
   subroutine parse_entry(cursor, source, group, entry, error)
      type(cursor_type), intent(inout) :: cursor
      character(*), intent(in) :: source
      type(group_type), intent(in) :: group
      type(entry_type), intent(out) :: entry
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: place

      entry%group = group%name
      entry%line = cursor%line
      ! What every message of this assignment begins with.
      place = source//':'//to_text(cursor%line)//': &'//group%name
      call cursor%take_name(entry%key)
      if (len(entry%key) == 0) then
         call fatal_error(error, place//': "'//cursor%peek()//'" stands where a key is '// &
                          'expected: write key = value', status_input)
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

   !> `file:line`, as compilers write it.
   pure function at_line(input, line) result(place)
      type(namelist_type), intent(in) :: input
      integer, intent(in) :: line
      character(:), allocatable :: place

      place = input%source//':'//to_text(line)
   end function at_line

   !> Some editors begin a UTF-8 file with these three bytes.
   pure function byte_order_mark() result(mark)
      character(3) :: mark

      mark = char(239)//char(187)//char(191)
   end function byte_order_mark

   !> Subscripts in parentheses, if any; the cursor is left behind them.
   subroutine parse_sections(cursor, place, entry, error)
      type(cursor_type), intent(inout) :: cursor
      !> What messages start with, such as "case.nml: &contact mu".
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
      ! So that each subscript ends in a comma.
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
      !> False where it is none, or below 1, or its end is before its start.
      logical, intent(out) :: ok
      integer :: colon, status

      ! Digits and a colon only: list-directed reading would take far more.
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
      ! With one colon at most.
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

      ! Doubled as needed: lists of matrices are long.
      allocate (values(8))
      n = 0
      after_value = .false.
      do
         call cursor%skip_blank()
         if (cursor%at_end() .or. cursor%is_at_key()) exit
         ! The end of a group; on the command line a slash may be part of a path.
         if (cursor%in_file .and. scan(cursor%peek(), '/&') > 0) exit
         ! One comma behind a value; a second one stands where a value is expected, and is refused
         ! there.
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
      character(:), allocatable :: count_text
      integer :: star, status
      logical :: ok

      value%line = cursor%line
      call cursor%take_word(value%text)
      ! A star in the first place is no repeat count.
      star = index(value%text, '*')
      ok = .true.
      if (star > 1) then
         ok = verify(value%text(:star - 1), '0123456789') == 0
         if (ok) read (value%text(:star - 1), *, iostat=status) value%repeat
         if (ok) ok = status == 0 .and. value%repeat > 0
         count_text = value%text(:star - 1)
         value%text = value%text(star + 1:)
      end if
      if (.not. ok) then
         call fatal_error(error, place//': the repeat count '//count_text//' of '//count_text// &
                          '*'//value%text//' must be a whole number from 1 to '// &
                          to_text(huge(1))//' (line '//to_text(value%line)//'); a text '// &
                          'needs quotes', status_input)
      else if (len(value%text) == 0 .and. scan(cursor%peek(), '''"') > 0) then
         ! Also behind a repeat count: 3*'text'.
         value%quoted = .true.
         call cursor%take_quoted(value%text, ok)
         if (.not. ok) call fatal_error(error, place//': a text is not closed by its quote in '// &
                                        'line '//to_text(value%line), status_input)
      else if (len(value%text) == 0) then
         call fatal_error(error, place//': "'//cursor%peek()//'" stands where a value is '// &
                          'expected (line '//to_text(value%line)//')', status_input)
      end if
   end subroutine parse_value

   !> By doubling: lists of a hundred thousand pairs are read in linear time.
   pure subroutine grow(values)
      type(value_type), allocatable, intent(inout) :: values(:)
      type(value_type), allocatable :: larger(:)

      allocate (larger(2*size(values)))
      larger(:size(values)) = values
      call move_alloc(larger, values)
   end subroutine grow

end module fw_namelist
