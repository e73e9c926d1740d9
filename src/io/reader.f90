!> Typed access to a namelist file with the overrides of the command line on top.
!>
!> Every getter names its group, key and accepted values once. From these same calls come the
!> list of known keys (so the check for unknown ones and the nearest key), the checks of range,
!> count and repetition, and the effective input. Problems are gathered, not raised one by one:
!> `finish` returns all of them together, so that one run shows everything there is to mend.
module fw_reader
   use fw_array_entries, only: source_type, spread_entry
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp, i8
   use fw_namelist, only: parse_namelist, parse_override
   use fw_namelist_data, only: namelist_type, value_type, entry_type, add_entry, value_count, &
                               stray_word, location, &
                               is_entry, last_entry, multiply_out
   use fw_records, only: record_list
   use fw_reader_text, only: near, did_you_mean, shown, to_strings, words_text, element_text, &
                             dims_text, real_list, repeat_hint
   use fw_text, only: string_type, lower_case, to_text, join
   use fw_text_list, only: append
   use fw_values, only: range_type, new_range, read_real, read_integer, read_logical, &
                        number_text, quoted_text
   implicit none (type, external)
   private

   public :: reader_type, new_reader

   !> Larger arrays than this in a namelist are taken for a wrong size.
   integer(i8), parameter :: largest_array = 10000000_i8
   !> More problems than this are counted only.
   integer, parameter :: most_problems = 12
   !> A list of mixed values has no shape to be checked against.
   integer, parameter :: most_listed = 1000000

   character(*), parameter :: real_kind = 'a finite real'

   type :: reader_type
      !> Model files are tried in a process of their own first: for programs of one thread.
      logical :: tries_files = .false.
      type(namelist_type), private :: input
      type(record_list), private :: records
      type(string_type), allocatable, private :: problems(:)
   contains
      !> One value: real, integer, logical or text.
      generic :: get => get_real, get_integer, get_logical, get_text
      !> A word of a list, as its position in the list.
      procedure :: get_word
      !> Arrays, in Fortran order.
      generic :: get_array => get_reals, get_integers
      !> The values as they stand, numbers and texts mixed.
      procedure :: get_list
      procedure :: given
      procedure :: refuse
      procedure :: place_of
      procedure :: require_group
      procedure :: amend
      procedure :: failed
      procedure :: finish
      procedure :: effective
      procedure, private :: get_real
      procedure, private :: get_integer
      procedure, private :: get_logical
      procedure, private :: get_text
      procedure, private :: get_reals
      procedure, private :: get_integers
      procedure, private :: find_last
      procedure, private :: find_scalar
      procedure, private :: find_elements
      procedure, private :: refuse_value
      procedure, private :: blame
      procedure, private :: find_unknown
   end type reader_type

contains

   !> Parse the text of a namelist file and the overrides.
   subroutine new_reader(reader, text, source, overrides, error, origin)
      type(reader_type), intent(out) :: reader
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

      allocate (reader%problems(0))
      call parse_namelist(text, source, reader%input, error)
      do i = 1, size(overrides)
         if (allocated(error)) return
         call parse_override(overrides(i)%text, entry, error, origin)
         if (.not. allocated(error)) call add_entry(reader%input, entry)
      end do
   end subroutine new_reader

   subroutine get_real(self, group, key, value, above, least, most, required, below)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> The default on entry.
      real(wp), intent(inout) :: value
      real(wp), intent(in), optional :: above, least, most
      logical, intent(in), optional :: required
      real(wp), intent(in), optional :: below
      type(range_type) :: range
      real(wp) :: number
      integer :: i
      logical :: ok

      range = new_range(real_kind, above, least, most, below)
      call self%find_scalar(group, key, range%accepts, required, i)
      if (i > 0) then
         call read_real(self%input%entries(i)%values(1)%text, number, ok)
         ok = ok .and. .not. self%input%entries(i)%values(1)%quoted
         if (ok) ok = range%holds(number)
         if (ok) value = number
         if (.not. ok) call self%refuse_value(i, range%accepts)
      end if
      ! A default outside of the range stands for "none" and cannot be written down.
      if (range%holds(value)) call self%amend(group, key, number_text(value))
   end subroutine get_real

   subroutine get_integer(self, group, key, value, least, most, required)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> The default on entry.
      integer, intent(inout) :: value
      integer, intent(in), optional :: least, most
      logical, intent(in), optional :: required
      type(range_type) :: range
      integer :: number, i
      logical :: ok

      range = integer_range(least, most)
      call self%find_scalar(group, key, range%accepts, required, i)
      if (i > 0) then
         call read_integer(self%input%entries(i)%values(1)%text, number, ok)
         ok = ok .and. .not. self%input%entries(i)%values(1)%quoted
         if (ok) ok = range%holds(real(number, wp))
         if (ok) value = number
         if (.not. ok) call self%refuse_value(i, range%accepts)
      end if
      if (range%holds(real(value, wp))) call self%amend(group, key, to_text(value))
   end subroutine get_integer

   subroutine get_logical(self, group, key, value)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> The default on entry.
      logical, intent(inout) :: value
      character(*), parameter :: accepts = '.true. or .false.'
      integer :: i
      logical :: ok, flag

      call self%find_scalar(group, key, accepts, .false., i)
      if (i > 0) then
         call read_logical(self%input%entries(i)%values(1)%text, flag, ok)
         if (ok) value = flag
         if (.not. ok) call self%refuse_value(i, accepts)
      end if
      call self%amend(group, key, to_text(value))
   end subroutine get_logical

   subroutine get_text(self, group, key, value, required)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> The default on entry; may be unallocated.
      character(:), allocatable, intent(inout) :: value
      logical, intent(in), optional :: required
      character(*), parameter :: accepts = 'a text in quotes'
      integer :: i

      call self%find_scalar(group, key, accepts, required, i, free_text=.true.)
      if (i > 0) then
         associate (entry => self%input%entries(i))
            if (entry%values(1)%quoted) then
               value = entry%values(1)%text
            else if (allocated(entry%raw)) then
               value = entry%raw
            else
               call self%refuse_value(i, accepts)
            end if
         end associate
      end if
      if (allocated(value)) call self%amend(group, key, quoted_text(value))
   end subroutine get_text

   subroutine get_word(self, group, key, choice, words)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> Position of the word in `words`; the default on entry.
      integer, intent(inout) :: choice
      character(*), intent(in) :: words(:)
      character(:), allocatable :: accepts
      integer :: i, k, found

      accepts = words_text(words)
      call self%find_scalar(group, key, accepts, .false., i)
      if (i > 0) then
         found = 0
         associate (value => self%input%entries(i)%values(1))
            do k = 1, size(words)
               if (lower_case(value%text) == lower_case(words(k))) found = k
            end do
            if (found > 0 .and. .not. value%quoted &
                .and. .not. allocated(self%input%entries(i)%raw)) then
               call self%refuse_value(i, quoted_text(trim(words(found)))//', in quotes')
            else if (found > 0) then
               choice = found
            else
               call self%refuse_value(i, accepts//did_you_mean(lower_case(value%text), &
                                                              to_strings(words)))
            end if
         end associate
      end if
      call self%amend(group, key, quoted_text(trim(words(choice))))
   end subroutine get_word

   subroutine get_reals(self, group, key, values, dims, repeats, above, least, required)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> Unallocated where nothing is given; allocated on entry: the default of every element.
      real(wp), allocatable, intent(inout) :: values(:)
      !> Shape of the array.
      integer, intent(in) :: dims(:)
      !> Whether one value holds for all elements.
      logical, intent(in) :: repeats
      real(wp), intent(in), optional :: above, least
      logical, intent(in), optional :: required
      type(range_type) :: range
      type(source_type) :: source
      real(wp) :: number
      integer :: k
      logical :: ok

      range = new_range(real_kind, above, least)
      call self%find_elements(group, key, dims, repeats, range%accepts, required, &
                              allocated(values), source)
      if (.not. allocated(source%entry)) return
      if (.not. allocated(values)) allocate (values(size(source%entry)), source=0.0_wp)
      do k = 1, size(values)
         if (source%entry(k) == 0) cycle
         associate (value => self%input%entries(source%entry(k))%values(source%value(k)))
            call read_real(value%text, number, ok)
            if (ok) ok = range%holds(number) .and. .not. value%quoted
            values(k) = number
            if (ok) cycle
            call self%refuse_value(source%entry(k), range%accepts, value, k, dims)
            return
         end associate
      end do
      call self%amend(group, key, real_list(values, dims, repeats))
   end subroutine get_reals

   subroutine get_integers(self, group, key, values, dims, repeats, least, most, required)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> Unallocated where nothing is given; allocated on entry: the default of every element.
      integer, allocatable, intent(inout) :: values(:)
      !> Shape of the array.
      integer, intent(in) :: dims(:)
      !> Whether one value holds for all elements.
      logical, intent(in) :: repeats
      integer, intent(in), optional :: least, most
      logical, intent(in), optional :: required
      type(range_type) :: range
      type(source_type) :: source
      integer :: k, number
      logical :: ok

      range = integer_range(least, most)
      call self%find_elements(group, key, dims, repeats, range%accepts, required, &
                              allocated(values), source)
      if (.not. allocated(source%entry)) return
      if (.not. allocated(values)) allocate (values(size(source%entry)), source=0)
      do k = 1, size(values)
         if (source%entry(k) == 0) cycle
         associate (value => self%input%entries(source%entry(k))%values(source%value(k)))
            call read_integer(value%text, number, ok)
            if (ok) ok = range%holds(real(number, wp)) .and. .not. value%quoted
            values(k) = number
            if (ok) cycle
            call self%refuse_value(source%entry(k), range%accepts, value, k, dims)
            return
         end associate
      end do
      call self%amend(group, key, real_list(real(values, wp), dims, repeats))
   end subroutine get_integers

   subroutine get_list(self, group, key, accepts, values, most)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key
      !> What is accepted, in words.
      character(*), intent(in) :: accepts
      !> Empty where nothing is given; repeat counts are multiplied out.
      type(value_type), allocatable, intent(out) :: values(:)
      !> As many values can differ.
      integer, intent(in), optional :: most
      character(:), allocatable :: text
      integer :: i, k, limit

      allocate (values(0))
      call self%find_last(group, key, accepts, i)
      ! How many values there may be is not known where something failed before.
      if (i == 0 .or. self%failed()) return
      limit = most_listed
      if (present(most)) limit = min(most, most_listed)
      if (value_count(self%input%entries(i)) > limit) then
         call self%refuse(group, key, 'has '//to_text(value_count(self%input%entries(i)))// &
                          ' values: must be at most '//to_text(limit)//' '//accepts// &
                          ', none of them twice')
         return
      end if
      call multiply_out(self%input%entries(i)%values, values)
      text = ''
      do k = 1, size(values)
         if (k > 1) text = text//', '
         if (verify(values(k)%text, '+-0123456789') > 0) then
            text = text//quoted_text(values(k)%text)
         else
            text = text//shown(values(k))
         end if
      end do
      call self%amend(group, key, text)
   end subroutine get_list

   !> Whether a key stands in the file or in an override.
   pure logical function given(self, group, key)
      class(reader_type), intent(in) :: self
      character(*), intent(in) :: group, key

      given = last_entry(self%input, group, key) > 0
   end function given

   !> Record a problem with the value of a key; the place is found here.
   subroutine refuse(self, group, key, message)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group
      !> Empty for the group as a whole.
      character(*), intent(in) :: key
      !> What was found and what is accepted.
      character(*), intent(in) :: message

      call self%blame(last_entry(self%input, group, key), '&'//trim(group//' '//key)//' '//message)
   end subroutine refuse

   !> Where a key stands, to put before a message from elsewhere: `case.nml:12: &model file`.
   pure function place_of(self, group, key) result(place)
      class(reader_type), intent(in) :: self
      character(*), intent(in) :: group, key
      character(:), allocatable :: place
      integer :: i

      place = self%input%source
      i = last_entry(self%input, group, key)
      if (i > 0) place = location(self%input%entries(i), self%input%source)
      place = place//': &'//group//' '//key
   end function place_of

   !> Record a problem where a group is neither in the file nor in an override.
   subroutine require_group(self, group, purpose)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group
      !> What it must say, for the message.
      character(*), intent(in) :: purpose
      integer :: i

      do i = 1, size(self%input%groups)
         if (self%input%groups(i)%name == group) return
      end do
      do i = 1, self%input%n_entries
         if (self%input%entries(i)%group == group) return
      end do
      call self%blame(0, 'group &'//group//' is missing: it gives '//purpose)
   end subroutine require_group

   !> Set the text of a key in the effective input.
   subroutine amend(self, group, key, text)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key, text

      call self%records%set(group, key, text)
   end subroutine amend

   !> Whether any problem was found so far.
   pure logical function failed(self)
      class(reader_type), intent(in) :: self

      failed = size(self%problems) > 0
   end function failed

   !> Check for unknown groups and keys; return everything that was found wrong as one error.
   !> Call when every key has been asked for.
   subroutine finish(self, error)
      class(reader_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      integer :: n

      call self%find_unknown()
      n = size(self%problems)
      if (n == 0) return
      message = join(self%problems(:min(n, most_problems)), new_line('a'))
      if (n > most_problems) message = message//new_line('a')//'and '// &
                                       to_text(n - most_problems)//' more'
      call fatal_error(error, message, status_input)
   end subroutine finish

   !> The effective input as a namelist that reads back to the same case.
   function effective(self) result(text)
      class(reader_type), intent(in) :: self
      character(:), allocatable :: text

      text = self%records%to_namelist()
   end function effective

   !> Unknown groups and keys go before the other problems: they often cause them.
   subroutine find_unknown(self)
      class(reader_type), intent(inout) :: self
      type(string_type), allocatable :: others(:), groups(:), keys(:)
      integer :: i

      call move_alloc(self%problems, others)
      allocate (self%problems(0))
      groups = self%records%groups()
      do i = 1, size(self%input%groups)
         if (self%records%has_group(self%input%groups(i)%name)) cycle
         call append(self%problems, self%input%source//':'// &
                     to_text(self%input%groups(i)%line)//': there is no group &'// &
                     self%input%groups(i)%name//near(self%input%groups(i)%name, groups))
      end do
      do i = 1, self%input%n_entries
         associate (entry => self%input%entries(i))
            if (.not. self%records%has_group(entry%group)) then
               if (allocated(entry%option)) call self%blame(i, 'there is no group &'// &
                                                   entry%group//near(entry%group, groups))
            else if (.not. self%records%has(entry%group, entry%key)) then
               keys = self%records%keys(entry%group)
               call self%blame(i, '&'//entry%group//' has no key '//entry%key// &
                               near(entry%key, keys))
            end if
         end associate
      end do
      do i = 1, size(others)
         call append(self%problems, others(i)%text)
      end do
   end subroutine find_unknown

   !> Register a key and find its one value: an entry, or 0 for none or a refused one.
   subroutine find_scalar(self, group, key, accepts, required, i_entry, free_text)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      logical, intent(in), optional :: required
      integer, intent(out) :: i_entry
      !> Whether the value of an override may be any words without quotes (default: no).
      logical, intent(in), optional :: free_text
      logical :: is_alone

      call self%find_last(group, key, accepts, i_entry)
      if (i_entry == 0 .and. is_true(required) .and. .not. self%given(group, key)) then
         call self%blame(0, '&'//group//' '//key//' is missing: must be '//accepts)
      end if
      if (i_entry == 0) return
      associate (entry => self%input%entries(i_entry))
         if (allocated(entry%raw)) then
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

   !> Register a key that is assigned as a whole and find its last entry.
   subroutine find_last(self, group, key, accepts, i_entry)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      integer, intent(out) :: i_entry
      integer :: i, first

      call self%records%add(group, key, accepts)
      i_entry = last_entry(self%input, group, key)
      if (i_entry == 0) return
      first = 0
      do i = 1, self%input%n_entries
         if (.not. is_entry(self%input%entries(i), group, key)) cycle
         if (first > 0 .and. .not. allocated(self%input%entries(i)%option)) then
            call self%blame(i, '&'//group//' '//key//' is given twice (first in line '// &
                            to_text(self%input%entries(first)%line)//'): keep one')
         end if
         first = i
      end do
      if (size(self%input%entries(i_entry)%sections) == 0) return
      call self%refuse(group, key, 'has a subscript: must be assigned as a whole, '//accepts)
      i_entry = 0
   end subroutine find_last

   !> Register an array and find the value of each element; `source%entry` stays unallocated
   !> where nothing is given or a problem was found.
   subroutine find_elements(self, group, key, dims, repeats, accepts, required, has_default, source)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key, accepts
      integer, intent(in) :: dims(:)
      logical, intent(in) :: repeats, has_default
      logical, intent(in), optional :: required
      type(source_type), intent(out) :: source
      character(:), allocatable :: message
      integer :: i

      call self%records%add(group, key, accepts)
      if (.not. self%given(group, key)) then
         if (.not. is_true(required)) return
         message = ', '//dims_text(dims)//' of them'
         if (repeats) message = ', one for all or '//dims_text(dims)//' of them'
         if (any(dims == 0) .or. all(dims == 1)) message = ''
         call self%blame(0, '&'//group//' '//key//' is missing: must be '//accepts//message)
         return
      end if
      if (any(dims == 0)) return
      ! The expected size may itself be wrong where something failed before.
      if (self%failed()) return
      if (product(int(dims, i8)) > largest_array) then
         call self%refuse(group, key, 'would have '//dims_text(dims)// &
                          ' values: too many for a namelist; a model file may hold them')
         return
      end if
      allocate (source%entry(product(dims)), source%value(product(dims)), source=0)
      do i = 1, self%input%n_entries
         if (.not. is_entry(self%input%entries(i), group, key)) cycle
         call spread_entry(self%input, i, dims, repeats, source, message)
         if (allocated(message)) call self%blame(i, '&'//group//' '//key//' '//message)
      end do
      i = findloc(source%entry, 0, 1)
      if (i > 0 .and. .not. has_default .and. .not. self%failed()) then
         call self%refuse(group, key, 'lacks element '//element_text(i, dims)// &
                          ': must be '//accepts)
      end if
      if (self%failed()) deallocate (source%entry)
   end subroutine find_elements

   !> Record that a value is not what is accepted.
   subroutine refuse_value(self, i_entry, accepts, value, element, dims)
      class(reader_type), intent(inout) :: self
      integer, intent(in) :: i_entry
      character(*), intent(in) :: accepts
      type(value_type), intent(in), optional :: value
      integer, intent(in), optional :: element, dims(:)
      character(:), allocatable :: name

      associate (entry => self%input%entries(i_entry))
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
      class(reader_type), intent(inout) :: self
      integer, intent(in) :: i_entry
      character(*), intent(in) :: message
      integer, intent(in), optional :: line
      character(:), allocatable :: place

      place = self%input%source
      if (i_entry > 0) place = location(self%input%entries(i_entry), self%input%source)
      if (present(line)) then
         if (.not. allocated(self%input%entries(i_entry)%option)) then
            place = self%input%source//':'//to_text(line)
         end if
      end if
      call append(self%problems, place//': '//message)
   end subroutine blame

   type(range_type) function integer_range(least, most) result(range)
      integer, intent(in), optional :: least, most

      if (present(least) .and. present(most)) then
         range = new_range('an integer', least=real(least, wp), most=real(most, wp))
      else if (present(least)) then
         range = new_range('an integer', least=real(least, wp))
      else
         range = new_range('an integer')
      end if
   end function integer_range

   pure logical function is_true(flag)
      logical, intent(in), optional :: flag

      is_true = .false.
      if (present(flag)) is_true = flag
   end function is_true

end module fw_reader
