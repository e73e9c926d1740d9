!> A namelist with the overrides of the command line on top, and the problems found in it.
!>
!> Problems are gathered, not raised one by one: `raise` returns all of them together, so that one
!> run shows everything there is to mend.
module fw_input
   use fw_array_entries, only: source_type, spread_entry
   use fw_error, only: error_type, fatal_error, status_input
   use fw_key, only: key_visitor
   use fw_kinds, only: i8
   use fw_namelist, only: parse_namelist, parse_override
   use fw_namelist_data, only: namelist_type, value_type, entry_type, add_entry, value_count, &
      stray_word, location, is_entry, last_entry
   use fw_reader_text, only: shown, element_text, dims_text, repeat_hint
   use fw_text, only: string_type, to_text, join
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: input_type

   !> Larger arrays than this in a namelist are taken for a wrong size.
   integer(i8), parameter :: largest_array = 10000000_i8
   !> More problems than this are counted only.
   integer, parameter :: most_problems = 12

   type, abstract, extends(key_visitor) :: input_type
      !> The file, and behind it the overrides, which hold where both give a key.
      type(namelist_type) :: namelist
      !> What was found wrong so far, in the words of the message.
      type(string_type), allocatable :: problems(:)
      !> The calling program holds the model: it is read from no file.
      logical :: in_memory = .false.
   contains
      procedure :: parse
      procedure :: given
      procedure :: has_group
      procedure :: place_of
      procedure :: text_of
      procedure :: require_group
      procedure :: find_scalar
      procedure :: find_last
      procedure :: find_elements
      procedure :: find_list
      procedure :: refuse
      procedure :: refuse_model
      procedure :: refuse_value
      procedure :: blame
      procedure :: failed
      procedure :: raise
   end type input_type

contains

   !> Parse the text of a namelist file and the overrides.
   subroutine parse(self, text, source, overrides, error, origin)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: text
      !> Name of the file, for messages.
      character(*), intent(in) :: source
      !> `group%key=value` each; the last of several holds.
      type(string_type), intent(in) :: overrides(:)
      type(error_type), allocatable, intent(out) :: error
      !> What messages put before an override (default: '--set').
      character(*), intent(in), optional :: origin
      type(entry_type) :: entry
      integer :: i

      allocate (self%problems(0))
      call parse_namelist(text, source, self%namelist, error)
      do i = 1, size(overrides)
         if (allocated(error)) return
         call parse_override(overrides(i)%text, entry, error, origin)
         if (.not. allocated(error)) call add_entry(self%namelist, entry)
      end do
   end subroutine parse

   !> Whether a key stands in the file or in an override.
   pure logical function given(self, group, key)
      class(input_type), intent(in) :: self
      character(*), intent(in) :: group, key

      given = last_entry(self%namelist, group, key) > 0
   end function given

   !> Where a key stands, to put before a message from elsewhere: `case.nml:12: &model file`.
   pure function place_of(self, group, key) result(place)
      class(input_type), intent(in) :: self
      character(*), intent(in) :: group, key
      character(:), allocatable :: place
      integer :: i

      place = self%namelist%source
      i = last_entry(self%namelist, group, key)
      if (i > 0) place = location(self%namelist%entries(i), self%namelist%source)
      place = place//': &'//group//' '//key
   end function place_of

   !> The first value of a key as it was typed, without its quotes; empty where there is none.
   pure function text_of(self, group, key) result(text)
      class(input_type), intent(in) :: self
      character(*), intent(in) :: group, key
      character(:), allocatable :: text
      integer :: i

      text = ''
      i = last_entry(self%namelist, group, key)
      if (i == 0) return
      associate (entry => self%namelist%entries(i))
         if (size(entry%values) == 0) return
         text = entry%values(1)%text
         if (.not. allocated(entry%raw)) return
         ! Overrides need no quotes: everything behind the = is the text.
         if (.not. (entry%values(1)%quoted .and. size(entry%values) == 1)) text = entry%raw
      end associate
   end function text_of

   !> Whether a group stands in the file or a key of it in an override.
   pure logical function has_group(self, group)
      class(input_type), intent(in) :: self
      character(*), intent(in) :: group
      integer :: i

      has_group = .true.
      do i = 1, size(self%namelist%groups)
         if (self%namelist%groups(i)%name == group) return
      end do
      do i = 1, self%namelist%n_entries
         if (self%namelist%entries(i)%group == group) return
      end do
      has_group = .false.
   end function has_group

   !> Record a problem where a group is neither in the file nor in an override.
   subroutine require_group(self, group, purpose)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group
      !> What it must say, for the message.
      character(*), intent(in) :: purpose

      if (self%has_group(group)) return
      call self%blame(0, 'group &'//group//' is missing: it gives '//purpose)
   end subroutine require_group

   !> The entry with the one value of a key; 0 for none or a refused one.
   subroutine find_scalar(self, group, key, accepts, needed, i_entry, free_text)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      logical, intent(in), optional :: needed
      integer, intent(out) :: i_entry
      !> Whether the value of an override may be any words without quotes (default: no).
      logical, intent(in), optional :: free_text
      logical :: is_alone

      call self%find_last(group, key, accepts, i_entry)
      if (i_entry == 0 .and. is_true(needed) .and. .not. self%given(group, key)) then
         call self%blame(0, '&'//group//' '//key//' is missing: must be '//accepts)
      end if
      if (i_entry == 0) return
      associate (entry => self%namelist%entries(i_entry))
         if (allocated(entry%raw)) then
            ! A comma at the end is in `raw` only: the values have lost it.
            is_alone = size(entry%values) == 1 .and. index(entry%raw, ',', .true.) < len(entry%raw)
            if (is_true(free_text)) is_alone = is_alone .or. .not. entry%values(1)%quoted
            if (is_alone) return
            call self%refuse(group, key, '= '//entry%raw//': must be one value and nothing '// &
                             'behind it, '//accepts)
         else
            if (value_count(entry) == 1) return
            call self%refuse(group, key, 'has '//to_text(value_count(entry))// &
                             ' values: must be one, '//accepts//stray_word(entry))
         end if
         i_entry = 0
      end associate
   end subroutine find_scalar

   !> The last entry of a key that is assigned as a whole; 0 for none or a refused one.
   subroutine find_last(self, group, key, accepts, i_entry)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      integer, intent(out) :: i_entry
      integer :: i, first

      i_entry = last_entry(self%namelist, group, key)
      if (i_entry == 0) return
      first = 0
      do i = 1, self%namelist%n_entries
         if (.not. is_entry(self%namelist%entries(i), group, key)) cycle
         ! An override may repeat what the file gives; the file may not repeat itself.
         if (first > 0 .and. .not. allocated(self%namelist%entries(i)%option)) then
            call self%blame(i, '&'//group//' '//key//' is given twice (first in line '// &
                            to_text(self%namelist%entries(first)%line)//'): keep one')
         end if
         first = i
      end do
      if (size(self%namelist%entries(i_entry)%sections) == 0) return
      call self%refuse(group, key, 'has a subscript: must be assigned as a whole, '//accepts)
      i_entry = 0
   end subroutine find_last

   !> The value of each element of an array; `source%entry` stays unallocated where nothing is
   !> given or a problem was found.
   subroutine find_elements(self, group, key, accepts, dims, repeats, has_default, source, &
                            tile)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      integer, intent(in) :: dims(:)
      !> Whether one value holds for all elements; whether elements may be left out.
      logical, intent(in) :: repeats, has_default
      type(source_type), intent(out) :: source
      !> So many values hold over and over; 0 for none.
      integer, intent(in) :: tile
      character(:), allocatable :: message
      integer :: i

      if (any(dims == 0)) return
      ! The expected size may itself be wrong where something failed before.
      if (self%failed()) return
      if (product(int(dims, i8)) > largest_array) then
         call self%refuse(group, key, 'would have '//dims_text(dims)// &
                          ' values: too many for a namelist; a model file may hold them')
         return
      end if
      allocate (source%entry(product(dims)), source%value(product(dims)), source=0)
      do i = 1, self%namelist%n_entries
         if (.not. is_entry(self%namelist%entries(i), group, key)) cycle
         call spread_entry(self%namelist, i, dims, repeats, source, message, tile)
         if (allocated(message)) call self%blame(i, '&'//group//' '//key//' '//message)
      end do
      i = findloc(source%entry, 0, 1)
      if (i > 0 .and. .not. has_default .and. .not. self%failed()) then
         call self%refuse(group, key, 'lacks element '//element_text(i, dims)// &
                          ': must be '//accepts)
      end if
      if (self%failed()) deallocate (source%entry)
   end subroutine find_elements

   !> The values of an array of any length, which is assigned as a whole.
   subroutine find_list(self, group, key, accepts, dims, source)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      !> As many as are given.
      integer, allocatable, intent(out) :: dims(:)
      type(source_type), intent(out) :: source
      character(:), allocatable :: message
      integer :: i

      call self%find_last(group, key, accepts, i)
      dims = [0]
      if (i == 0) return
      dims = [value_count(self%namelist%entries(i))]
      if (dims(1) > largest_array) then
         call self%refuse(group, key, 'has '//dims_text(dims)//' values: too many')
         return
      end if
      allocate (source%entry(dims(1)), source%value(dims(1)), source=0)
      call spread_entry(self%namelist, i, dims, .false., source, message)
   end subroutine find_list

   !> Record a problem with the value of a key; the place is found here.
   subroutine refuse(self, group, key, message)
      class(input_type), intent(inout) :: self
      character(*), intent(in) :: group
      !> Empty for the group as a whole.
      character(*), intent(in) :: key
      !> What was found and what is accepted.
      character(*), intent(in) :: message

      call self%blame(last_entry(self%namelist, group, key), &
                      '&'//trim(group//' '//key)//' '//message)
   end subroutine refuse

   !> Record that a model file, or the model of the calling program, holds something wrong.
   subroutine refuse_model(self, message)
      class(input_type), intent(inout) :: self
      !> What it holds and what must be.
      character(*), intent(in) :: message

      if (self%in_memory) then
         call self%refuse('model', 'source', "= 'memory' holds "//message)
      else
         call self%refuse('model', 'file', 'holds '//message)
      end if
   end subroutine refuse_model

   !> Record that a value is not what is accepted.
   subroutine refuse_value(self, i_entry, accepts, value, element, dims)
      class(input_type), intent(inout) :: self
      integer, intent(in) :: i_entry
      character(*), intent(in) :: accepts
      type(value_type), intent(in), optional :: value
      integer, intent(in), optional :: element, dims(:)
      character(:), allocatable :: name

      associate (entry => self%namelist%entries(i_entry))
         name = '&'//entry%group//' '//entry%key
         if (present(element)) name = name//element_text(element, dims)
         if (present(value)) then
            call self%blame(i_entry, name//' = '//shown(value)//': must be '//accepts// &
                            repeat_hint(value), value%line)
         else if (allocated(entry%raw)) then
            call self%blame(i_entry, name//' = '//entry%raw//': must be '//accepts// &
                            repeat_hint(entry%values(1)))
         else
            call self%blame(i_entry, name//' = '//shown(entry%values(1))//': must be '//accepts)
         end if
      end associate
   end subroutine refuse_value

   !> Record a problem at an entry (0: at the file as a whole), or at a line of it.
   subroutine blame(self, i_entry, message, line)
      class(input_type), intent(inout) :: self
      integer, intent(in) :: i_entry
      character(*), intent(in) :: message
      integer, intent(in), optional :: line
      character(:), allocatable :: place

      place = self%namelist%source
      if (i_entry > 0) place = location(self%namelist%entries(i_entry), self%namelist%source)
      ! The line of the value, where an assignment goes over several; an override has none.
      if (present(line)) then
         if (.not. allocated(self%namelist%entries(i_entry)%option)) then
            place = self%namelist%source//':'//to_text(line)
         end if
      end if
      call append(self%problems, place//': '//message)
   end subroutine blame

   !> Whether any problem was found so far.
   pure logical function failed(self)
      class(input_type), intent(in) :: self

      failed = size(self%problems) > 0
   end function failed

   !> Everything that was found wrong as one error.
   subroutine raise(self, error)
      class(input_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      integer :: n

      n = size(self%problems)
      if (n == 0) return
      message = join(self%problems(:min(n, most_problems)), new_line('a'))
      if (n > most_problems) message = message//new_line('a')//'and '// &
                                       to_text(n - most_problems)//' more'
      call fatal_error(error, message, status_input)
   end subroutine raise

   !> A flag that may be absent: then it is false.
   pure logical function is_true(flag)
      logical, intent(in), optional :: flag

      is_true = .false.
      if (present(flag)) is_true = flag
   end function is_true

end module fw_input
