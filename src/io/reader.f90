!> Reads the keys of the options from a namelist: checks of range, count and repetition, the nearest
!> key for an unknown one, and the effective input, all from the declarations of the keys.
!>
!> A problem is recorded, not raised: reading goes on, so that one run tells everything that is
!> wrong. A value that is refused leaves its component as it was, and `finish` raises what was
!> recorded.
module fw_reader
   use fw_error, only: error_type
   use fw_former_keys, only: hint_of_former_key
   use fw_input, only: input_type
   use fw_key, only: key_type
   use fw_kinds, only: wp
   use fw_namelist_data, only: value_type, value_count, multiply_out
   use fw_records, only: record_type, record_list
   use fw_reader_text, only: near, near_part, did_you_mean, shown, to_strings, words_text
   use fw_text, only: string_type, lower_case, to_text
   use fw_text_list, only: append
   use fw_values, only: range_text, read_logical, read_number, quoted_text, real_kind, &
      integer_kind, kind_name, kind_text
   implicit none (type, external)
   private

   public :: reader_type, new_reader

   !> A list of mixed values has no shape to be checked against.
   integer, parameter :: most_listed = 1000000

   !> An extent of arrays.
   type :: size_type
      !> As shapes have it: n_dof, n_pairs, ..
      character(16) :: name
      !> Number of elements along it.
      integer :: extent
      !> Values that may be given for as many elements after the other; 0 where only all may.
      integer :: tile = 0
   end type size_type

   type, extends(input_type) :: reader_type
      !> Model files are tried in a process of their own first: for programs of one thread.
      logical :: tries_files = .false.
      !> Every key that was asked for, with its text in the effective input.
      type(record_list) :: records
      !> The group that was opened last; extents that were told so far.
      character(:), allocatable, private :: group
      type(size_type), allocatable, private :: sizes(:)
   contains
      procedure :: open
      procedure :: bind_real
      procedure :: bind_integer
      procedure :: bind_logical
      procedure :: bind_text
      procedure :: bind_word
      procedure :: bind_words
      procedure :: bind_list
      procedure :: bind_reals
      procedure :: bind_integers
      procedure :: extents
      procedure :: set_size
      procedure :: set_tile
      procedure :: amend
      procedure :: finish
      procedure :: effective
      procedure, private :: note
      procedure, private :: take_number
      procedure, private :: find_unknown
   end type reader_type

   interface
      module subroutine bind_reals(self, key, values, needed, default)
         class(reader_type), intent(inout) :: self
         type(key_type), intent(in) :: key
         real(wp), allocatable, intent(inout) :: values(:)
         logical, intent(in), optional :: needed
         real(wp), intent(in), optional :: default
      end subroutine bind_reals

      module subroutine bind_integers(self, key, values, needed, default)
         class(reader_type), intent(inout) :: self
         type(key_type), intent(in) :: key
         integer, allocatable, intent(inout) :: values(:)
         logical, intent(in), optional :: needed
         integer, intent(in), optional :: default
      end subroutine bind_integers
   end interface

contains

   !> A reader of the text of a namelist file with the overrides on top.
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

      allocate (reader%sizes(0))
      call reader%parse(text, source, overrides, error, origin)
      if (.not. allocated(error)) call take_renamed(reader)
   end subroutine new_reader

   !> A key under the name that it had.
   subroutine take_renamed(self)
      class(reader_type), intent(inout) :: self
      integer :: i

      do i = 1, self%namelist%n_entries
         associate (entry => self%namelist%entries(i))
            if (entry%group /= 'sweep' .or. entry%key /= 'frequencies') cycle
            if (.not. self%given('sweep', 'values')) entry%key = 'values'
         end associate
      end do
   end subroutine take_renamed

   !> Keys bound from now on belong to this group; its help is for the list of keys.
   subroutine open(self, group, help)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, help

      self%group = group
      call self%records%open(group, help)
   end subroutine open

   !> Note down what a key of the present group is, once.
   subroutine note(self, key, kind, accepts, default, words)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      !> As of record_type.
      character(*), intent(in) :: kind, accepts
      !> Blank for none.
      character(*), intent(in) :: default
      character(*), intent(in), optional :: words(:)
      type(record_type) :: record

      record%group = self%group
      record%key = key
      record%kind = kind
      record%accepts = accepts
      if (len(default) > 0) record%default = default
      if (present(words)) record%words = words
      call self%records%add(record)
   end subroutine note

   !> A real in its range; the component holds the default.
   subroutine bind_real(self, key, value, needed)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      real(wp), intent(inout) :: value
      !> A key that is needed and not given is a problem.
      logical, intent(in), optional :: needed

      call self%take_number(key, real_kind, value, needed)
   end subroutine bind_real

   !> A whole number in its range, exact as a real in between.
   subroutine bind_integer(self, key, value, needed)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, intent(inout) :: value
      logical, intent(in), optional :: needed
      real(wp) :: number

      number = real(value, wp)
      call self%take_number(key, integer_kind, number, needed)
      value = nint(number)
   end subroutine bind_integer

   !> A number of either kind: note the key, read it if it is given, keep what holds.
   subroutine take_number(self, key, kind, number, needed)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      !> real_kind or integer_kind.
      character(*), intent(in) :: kind
      real(wp), intent(inout) :: number
      logical, intent(in), optional :: needed
      character(:), allocatable :: accepts, default
      real(wp) :: found
      integer :: i
      logical :: ok

      accepts = range_text(kind, key%range)
      default = ''
      ! A default outside of the range stands for "none" and cannot be written down.
      if (key%range%holds(number)) default = kind_text(number, kind)
      call self%note(key, kind_name(kind), accepts, default)
      call self%find_scalar(self%group, trim(key%name), accepts, needed, i)
      if (i > 0) then
         call read_number(self%namelist%entries(i)%values(1), kind, key%range, found, ok)
         ! A value that is refused leaves the default, so that later checks find something sound.
         if (ok) number = found
         if (.not. ok) call self%refuse_value(i, accepts)
      end if
      if (key%range%holds(number)) then
         call self%amend(self%group, trim(key%name), kind_text(number, kind))
      end if
   end subroutine take_number

   !> A truth value, in any of the forms that Fortran reads.
   subroutine bind_logical(self, key, value)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      logical, intent(inout) :: value
      character(*), parameter :: accepts = '.true. or .false.'
      integer :: i
      logical :: ok, flag

      call self%note(key, 'logical', accepts, to_text(value))
      call self%find_scalar(self%group, trim(key%name), accepts, .false., i)
      if (i > 0) then
         call read_logical(self%namelist%entries(i)%values(1)%text, flag, ok)
         if (ok) value = flag
         if (.not. ok) call self%refuse_value(i, accepts)
      end if
      call self%amend(self%group, trim(key%name), to_text(value))
   end subroutine bind_logical

   !> A text; it stays unallocated where it is not given.
   subroutine bind_text(self, key, value, needed)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(:), allocatable, intent(inout) :: value
      logical, intent(in), optional :: needed
      character(*), parameter :: accepts = 'a text in quotes'
      integer :: i

      call self%note(key, 'text', accepts, '')
      call self%find_scalar(self%group, trim(key%name), accepts, needed, i, free_text=.true.)
      if (i > 0) then
         associate (entry => self%namelist%entries(i))
            if (entry%values(1)%quoted) then
               value = entry%values(1)%text
            else if (allocated(entry%raw)) then
               ! Overrides need no quotes: everything behind the = is the text.
               value = entry%raw
            else
               call self%refuse_value(i, accepts)
            end if
         end associate
      end if
      if (allocated(value)) call self%amend(self%group, trim(key%name), quoted_text(value))
   end subroutine bind_text

   !> One of several words, as its number in their list; upper and lower case are the same.
   subroutine bind_word(self, key, choice, words)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, intent(inout) :: choice
      character(*), intent(in) :: words(:)
      character(:), allocatable :: accepts
      integer :: i

      accepts = words_text(words)
      call self%note(key, 'word', accepts, quoted_text(trim(words(choice))), words)
      call self%find_scalar(self%group, trim(key%name), accepts, .false., i)
      if (i > 0) call take_word(self, i, self%namelist%entries(i)%values(1), accepts, words, choice)
      call self%amend(self%group, trim(key%name), quoted_text(trim(words(choice))))
   end subroutine bind_word

   !> The place of a value among words; left alone where it is none of them.
   subroutine take_word(self, i_entry, value, accepts, words, choice)
      type(reader_type), intent(inout) :: self
      integer, intent(in) :: i_entry
      type(value_type), intent(in) :: value
      character(*), intent(in) :: accepts, words(:)
      integer, intent(inout) :: choice
      integer :: found, k

      found = 0
      do k = 1, size(words)
         if (lower_case(value%text) == lower_case(words(k))) found = k
      end do
      ! The right word without quotes: what a namelist READ would not take either.
      if (found > 0 .and. .not. value%quoted .and. &
          .not. allocated(self%namelist%entries(i_entry)%raw)) then
         call self%refuse_value(i_entry, quoted_text(trim(words(found)))//', in quotes', value)
      else if (found > 0) then
         choice = found
      else
         call self%refuse_value(i_entry, accepts//did_you_mean(lower_case(value%text), &
                                                               to_strings(words)), value)
      end if
   end subroutine take_word

   subroutine bind_words(self, key, choices, words)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, allocatable, intent(inout) :: choices(:)
      character(*), intent(in) :: words(:)
      type(value_type), allocatable :: values(:)
      character(:), allocatable :: accepts, text
      integer :: i, k, n

      accepts = words_text(words)
      call self%note(key, 'word', accepts, quoted_text(trim(words(choices(1)))), words)
      call self%find_last(self%group, trim(key%name), accepts, i)
      if (i > 0) then
         n = product(self%extents(key%shape))
         k = value_count(self%namelist%entries(i))
         ! Of nothing any words will do.
         if (k /= 1 .and. k /= n .and. n > 0) then
            call self%refuse(self%group, trim(key%name), 'has '//to_text(k)//' values: must be '// &
                             'one for all, or one for each of '//trim(key%shape)//' = '// &
                             to_text(n)//', '//accepts)
            return
         end if
         call multiply_out(self%namelist%entries(i)%values, values)
         choices = [(choices(1), k=1, size(values))]
         do k = 1, size(values)
            call take_word(self, i, values(k), accepts, words, choices(k))
         end do
      end if
      if (all(choices == choices(1))) choices = choices(:1)
      text = ''
      do k = 1, size(choices)
         if (k > 1) text = text//', '
         text = text//quoted_text(trim(words(choices(k))))
      end do
      call self%amend(self%group, trim(key%name), text)
   end subroutine bind_words

   !> Values that may be numbers or texts, as `observe` has them; what they are is up to the caller.
   subroutine bind_list(self, key, accepts, most, values, is_text)
      class(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(*), intent(in) :: accepts
      !> No more values than this.
      integer, intent(in) :: most
      type(string_type), allocatable, intent(out) :: values(:)
      logical, allocatable, intent(out) :: is_text(:)
      type(value_type), allocatable :: found(:)
      character(:), allocatable :: text
      integer :: i, k

      allocate (values(0), is_text(0))
      call self%note(key, 'list', accepts, '')
      call self%find_last(self%group, trim(key%name), accepts, i)
      ! How many values there may be is not known where something failed before.
      if (i == 0 .or. self%failed()) return
      k = value_count(self%namelist%entries(i))
      if (k > min(most, most_listed)) then
         call self%refuse(self%group, trim(key%name), 'has '//to_text(k)//' values: must be '// &
                          'at most '//to_text(min(most, most_listed))//' '//accepts// &
                          ', none of them twice')
         return
      end if
      call multiply_out(self%namelist%entries(i)%values, found)
      text = ''
      do k = 1, size(found)
         ! Written back in quotes, an unquoted name reads the same again.
         if (verify(found(k)%text, '+-0123456789') > 0) found(k)%quoted = .true.
         call append(values, found(k)%text)
         if (k > 1) text = text//', '
         text = text//shown(found(k))
      end do
      is_text = found%quoted
      call self%amend(self%group, trim(key%name), text)
   end subroutine bind_list

   !> Tell an extent that shapes name.
   subroutine set_size(self, name, extent)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: extent

      ! A size told anew replaces the old one.
      self%sizes = [pack(self%sizes, self%sizes%name /= name), size_type(name, extent, 0)]
   end subroutine set_size

   !> So many values hold for all of an extent that was told, over and over.
   subroutine set_tile(self, name, tile)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: tile

      where (self%sizes%name == name) self%sizes%tile = tile
   end subroutine set_tile

   !> A size that was not told is 0.
   !> Numbers of a shape such as '3 x n_pairs', in Fortran order.
   pure function extents(self, shape)
      class(reader_type), intent(in) :: self
      character(*), intent(in) :: shape
      integer, allocatable :: extents(:)
      character(:), allocatable :: rest
      integer :: extent, blank, k, status

      allocate (extents(0))
      rest = trim(shape)
      do while (len(rest) > 0)
         blank = index(rest//' ', ' ')
         ! A number, or else the name of a size.
         read (rest(:blank - 1), '(i12)', iostat=status) extent
         if (status /= 0) then
            extent = 0
            do k = 1, size(self%sizes)
               if (self%sizes(k)%name == rest(:blank - 1)) extent = self%sizes(k)%extent
            end do
         end if
         if (rest(:blank - 1) /= 'x') extents = [extents, extent]
         rest = trim(rest(min(blank + 1, len(rest) + 1):))
      end do
   end function extents

   !> Set the text of a key in the effective input; an empty one takes it out.
   subroutine amend(self, group, key, text)
      class(reader_type), intent(inout) :: self
      character(*), intent(in) :: group, key, text

      call self%records%set(group, key, text)
   end subroutine amend

   !> Check for unknown groups and keys; return everything that was found wrong as one error.
   !> Call when every key has been asked for.
   subroutine finish(self, error)
      class(reader_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call self%find_unknown()
      call self%raise(error)
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
      type(string_type), allocatable :: others(:)
      integer :: i

      call move_alloc(self%problems, others)
      allocate (self%problems(0))
      do i = 1, size(self%namelist%groups)
         associate (group => self%namelist%groups(i))
            if (self%records%has_group(group%name)) cycle
            call append(self%problems, self%namelist%source//':'//to_text(group%line)// &
                        ': there is no group &'//group%name//near(group%name, self%records%groups))
         end associate
      end do
      do i = 1, self%namelist%n_entries
         associate (entry => self%namelist%entries(i))
            if (.not. self%records%has_group(entry%group)) then
               if (allocated(entry%option)) call self%blame(i, 'there is no group &'// &
                                                            entry%group// &
                                                    near(entry%group, self%records%groups))
            else if (.not. self%records%has(entry%group, entry%key)) then
               call self%blame(i, '&'//entry%group//' has no key '//entry%key// &
                               hint_for(self, entry%group, entry%key))
            end if
         end associate
      end do
      do i = 1, size(others)
         call append(self%problems, others(i)%text)
      end do
   end subroutine find_unknown

   !> Where a key that a group does not have may belong: in another group that has it, or among the
   !> longer names of this one.
   function hint_for(self, group, name) result(hint)
      class(reader_type), intent(in) :: self
      character(*), intent(in) :: group, name
      character(:), allocatable :: hint
      integer :: i

      hint = hint_of_former_key(group, name)
      if (len(hint) > 0) return
      ! A part of a name of the group itself is nearer than a key of another.
      hint = near_part(name, self%records%keys(group))
      if (len(hint) > 0) return
      do i = 1, size(self%records%groups)
         if (.not. self%records%has(self%records%groups(i)%text, name)) cycle
         if (len(hint) > 0) hint = hint//', &'//self%records%groups(i)%text
         if (len(hint) == 0) hint = '; it is a key of &'//self%records%groups(i)%text
      end do
      if (len(hint) == 0) hint = near(name, self%records%keys(group))
   end function hint_for

end module fw_reader
