!> The two ends of a namelist assignment: its subscripts and its values.
!>
!> Of a line  key(2:3) = 2*1.5, 'text'  this is  (2:3)  and  2*1.5, 'text'. What the values mean is
!> up to the key: here they stay text, with their line for messages.
module fw_namelist_values
   use fw_cursor, only: cursor_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_namelist_data, only: entry_type, value_type, section_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: parse_sections, parse_values

contains

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

end module fw_namelist_values
