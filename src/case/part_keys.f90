!> Keys of a group of elements as parts of a model: who declares keys in `bind_keys` has declared
!> the datasets of a model file with them. The shape `8 x n_terms` of a key is `term 8` of a part,
!> and the number of elements is that of the first array.
module fw_part_keys
   use fw_key, only: key_type, key_visitor
   use fw_kinds, only: wp
   use fw_part, only: part, part_source, part_type
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: part_keys

   !> A visitor of keys that hands arrays and words on to a source of parts, and passes over the
   !> rest. Values keep their defaults where the source has none.
   type, extends(key_visitor) :: part_keys
      !> The file, the calling program or the list of parts that is gone through.
      class(part_source), pointer :: to => null()
      !> Group that is open: first part of the path of a dataset.
      character(24) :: group = ''
   contains
      procedure :: open
      procedure :: bind_word
      procedure :: bind_words
      procedure :: bind_list
      procedure :: set_size
      procedure :: extents
      procedure :: bind_real
      procedure :: bind_integer
      procedure :: bind_logical
      procedure :: bind_text
      procedure :: bind_reals
      procedure :: bind_integers
   end type part_keys

contains

   !> Keys that follow are parts of /group.
   subroutine open(self, group, help)
      class(part_keys), intent(inout) :: self
      character(*), intent(in) :: group, help

      self%group = group
      associate (unused => help)
      end associate
   end subroutine open

   !> The part of a key.
   pure type(part_type) function part_of(self, key)
      type(part_keys), intent(in) :: self
      type(key_type), intent(in) :: key
      character(32) :: needed
      character(20) :: shape

      ! What a namelist requires a file has to have, unless another key asks for it: that is judged
      ! where both are known.
      needed = ''
      if (index(key%absent, 'required') > 0 .and. key%only == '') needed = 'with /'//self%group
      shape = part_shape(key%shape)
      ! Keys that may have one value for all elements have datasets that may.
      if (key%repeats .and. index(trim(shape), ' ') == 0) shape = 'one_or '//shape(:13)
      part_of = part(trim(self%group)//'/'//trim(key%name), trim(shape), trim(key%help), needed)
   end function part_of

   !> `term 8` of `8 x n_terms`: rows of a file are columns here.
   pure function part_shape(shape) result(words)
      character(*), intent(in) :: shape
      character(20) :: words
      character(20) :: rest, word
      integer :: blank

      words = ''
      rest = shape
      ! Word by word, each put in front of those before it: the last extent of a key runs slowest.
      do while (len_trim(rest) > 0)
         blank = index(rest, ' ')
         word = rest(:blank - 1)
         rest = adjustl(rest(blank + 1:))
         if (word == 'x') cycle
         words = trim(one_of(word))//' '//words
      end do
   end function part_shape

   !> `term` of `n_terms`.
   pure function one_of(word) result(text)
      character(*), intent(in) :: word
      character(20) :: text

      text = word
      if (index(word, 'n_') == 1) text = word(3:len_trim(word) - 1)
   end function one_of

   !> A word is an attribute of the group.
   !> The choice stays as it is where the attribute is absent; a word that is none of the list is
   !> refused with the list.
   subroutine bind_word(self, key, choice, words)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, intent(inout) :: choice
      character(*), intent(in) :: words(:)
      character(:), allocatable :: text
      type(part_type) :: row
      integer :: k

      row = part(trim(self%group)//'@'//trim(key%name), '', trim(key%help))
      call self%to%bind(row, text)
      if (.not. allocated(text)) return
      do k = 1, size(words)
         if (words(k) == text) then
            choice = k
            return
         end if
      end do
      call self%to%refuse(row, '"'//text//'"', 'one of the words '//all_words(words))
   end subroutine bind_word

   !> Words in quotation marks, as a message lists them.
   pure function all_words(words) result(text)
      character(*), intent(in) :: words(:)
      character(80) :: text
      integer :: k

      text = ''
      do k = 1, size(words)
         text = trim(text)//' "'//trim(words(k))//'"'
      end do
      text = adjustl(text)
   end function all_words

   !> What follows is no part of a model: words of many, lists, single values. The numbers of
   !> elements are those of the arrays.
   subroutine bind_words(self, key, choices, words)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, allocatable, intent(inout) :: choices(:)
      character(*), intent(in) :: words(:)

      associate (unused => self, of => key, neither => choices, nor => words)
      end associate
   end subroutine bind_words

   !> An empty list is given back, since the caller looks at its size.
   subroutine bind_list(self, key, accepts, most, values, is_text)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(*), intent(in) :: accepts
      integer, intent(in) :: most
      type(string_type), allocatable, intent(out) :: values(:)
      logical, allocatable, intent(out) :: is_text(:)

      allocate (values(0), is_text(0))
      associate (unused => self, of => key, neither => accepts, nor => most)
      end associate
   end subroutine bind_list

   subroutine bind_real(self, key, value, needed)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      real(wp), intent(inout) :: value
      logical, intent(in), optional :: needed

      associate (unused => self, of => key, neither => value, nor => needed)
      end associate
   end subroutine bind_real

   subroutine bind_integer(self, key, value, needed)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, intent(inout) :: value
      logical, intent(in), optional :: needed

      associate (unused => self, of => key, neither => value, nor => needed)
      end associate
   end subroutine bind_integer

   subroutine bind_logical(self, key, value)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      logical, intent(inout) :: value

      associate (unused => self, of => key, neither => value)
      end associate
   end subroutine bind_logical

   subroutine bind_text(self, key, value, needed)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(:), allocatable, intent(inout) :: value
      logical, intent(in), optional :: needed

      associate (unused => self, of => key, neither => value, nor => needed)
      end associate
   end subroutine bind_text

   !> An array is a dataset; it stays unallocated where the file has none.
   subroutine bind_reals(self, key, values, needed, default)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      real(wp), allocatable, intent(inout) :: values(:)
      logical, intent(in), optional :: needed
      real(wp), intent(in), optional :: default

      call self%to%bind(part_of(self, key), values)
      associate (unused => needed, neither => default)
      end associate
   end subroutine bind_reals

   !> Likewise, of dofs and other whole numbers.
   subroutine bind_integers(self, key, values, needed, default)
      class(part_keys), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, allocatable, intent(inout) :: values(:)
      logical, intent(in), optional :: needed
      integer, intent(in), optional :: default

      call self%to%bind(part_of(self, key), values)
      associate (unused => needed, neither => default)
      end associate
   end subroutine bind_integers

   !> Extents are those of the datasets, not of keys.
   subroutine set_size(self, name, extent)
      class(part_keys), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: extent

      associate (unused => self, of => name, neither => extent)
      end associate
   end subroutine set_size

   !> Those of the first dataset that had the words of the shape.
   pure function extents(self, shape)
      class(part_keys), intent(in) :: self
      character(*), intent(in) :: shape
      integer, allocatable :: extents(:)
      type(part_type) :: of_shape

      of_shape%shape = part_shape(shape)
      extents = self%to%extents_of(of_shape)
   end function extents

end module fw_part_keys
