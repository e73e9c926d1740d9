!> Keys of the input, declared once: one call names a key, says what it accepts, means and stands
!> in, and binds it to the component of the options that holds its value and its default,
!>
!>    call keys%open('time', 'integration in time')
!>    call keys%bind(key('n_periods', 'periods integrated at most', at_least(1)), self%n_periods)
!>
!> Whoever goes through these calls is a `key_visitor`: the reader of namelists fills the
!> components, the list of `fw_run --keys` writes down what they hold by default. Texts have fixed
!> lengths, so that no key needs memory of its own.
module fw_key
   use fw_key_range, only: range_type
   use fw_kinds, only: wp
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: key_type, key, key_visitor

   !> Everything about a key but its value.
   type :: key_type
      character(24) :: name = ''
      !> One line, for the list of keys and the user guide.
      character(160) :: help = ''
      !> Such as F/L of length L, force F, mass M and seconds s; blank: none.
      character(20) :: unit = ''
      !> Extents of an array: `n_pairs`, `3 x n_pairs`; blank: one value; a colon: as many as are
      !> given.
      character(20) :: shape = ''
      !> Whether one value holds for all elements of the array.
      logical :: repeats = .true.
      !> Where the default is not that of the component: what stands for it, or when there is none.
      character(60) :: absent = ''
      !> What it has a meaning with only.
      character(100) :: only = ''
      type(range_type) :: range
   end type key_type

   !> Goes through the keys of the options.
   type, abstract :: key_visitor
   contains
      !> The keys that follow are of this group.
      procedure(open_group), deferred :: open
      !> One value: real, integer, logical or text; arrays, flat or of two dimensions.
      generic :: bind => bind_real, bind_integer, bind_logical, bind_text, bind_reals, &
         bind_integers, bind_matrix, bind_integer_matrix
      !> A word of a list, as its position in the list.
      procedure(word_binding), deferred :: bind_word
      !> One word for all of a shape, or one for each.
      procedure(words_binding), deferred :: bind_words
      !> Numbers and texts mixed, which the visitor's owner takes apart.
      procedure(list_binding), deferred :: bind_list
      !> Tell an extent that shapes name, and what a shape stands for.
      procedure(set_extent), deferred :: set_size
      procedure(extents_of), deferred :: extents
      procedure(real_binding), deferred :: bind_real
      procedure(integer_binding), deferred :: bind_integer
      procedure(logical_binding), deferred :: bind_logical
      procedure(text_binding), deferred :: bind_text
      procedure(reals_binding), deferred :: bind_reals
      procedure(integers_binding), deferred :: bind_integers
      procedure, private :: bind_matrix
      procedure, private :: bind_integer_matrix
   end type key_visitor

   abstract interface
      subroutine open_group(self, group, help)
         import :: key_visitor
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         character(*), intent(in) :: group
         !> What the group is for, in a few words.
         character(*), intent(in) :: help
      end subroutine open_group

      subroutine real_binding(self, key, value, needed)
         import :: key_visitor, key_type, wp
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> The default on entry; one outside of the range stands for none.
         real(wp), intent(inout) :: value
         !> Whether the case has to give it (default: no).
         logical, intent(in), optional :: needed
      end subroutine real_binding

      subroutine integer_binding(self, key, value, needed)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         integer, intent(inout) :: value
         logical, intent(in), optional :: needed
      end subroutine integer_binding

      subroutine logical_binding(self, key, value)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         logical, intent(inout) :: value
      end subroutine logical_binding

      subroutine text_binding(self, key, value, needed)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> Not allocated where there is none.
         character(:), allocatable, intent(inout) :: value
         logical, intent(in), optional :: needed
      end subroutine text_binding

      subroutine word_binding(self, key, choice, words)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> Position of the word in `words`; the default on entry.
         integer, intent(inout) :: choice
         character(*), intent(in) :: words(:)
      end subroutine word_binding

      subroutine words_binding(self, key, choices, words)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> Positions in `words`, one for all or one for each of the shape; the defaults on entry.
         integer, allocatable, intent(inout) :: choices(:)
         character(*), intent(in) :: words(:)
      end subroutine words_binding

      subroutine list_binding(self, key, accepts, most, values, is_text)
         import :: key_visitor, key_type, string_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> What is accepted, in words.
         character(*), intent(in) :: accepts
         !> As many values can differ.
         integer, intent(in) :: most
         !> Empty where nothing is given.
         type(string_type), allocatable, intent(out) :: values(:)
         !> Which of them are texts, not numbers.
         logical, allocatable, intent(out) :: is_text(:)
      end subroutine list_binding

      subroutine reals_binding(self, key, values, needed, default)
         import :: key_visitor, key_type, wp
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         !> Allocated on entry: the default of every element. Left unallocated where nothing is
         !> given and there is no default.
         real(wp), allocatable, intent(inout) :: values(:)
         logical, intent(in), optional :: needed
         !> Of every element of an array that is not allocated on entry.
         real(wp), intent(in), optional :: default
      end subroutine reals_binding

      subroutine integers_binding(self, key, values, needed, default)
         import :: key_visitor, key_type
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         type(key_type), intent(in) :: key
         integer, allocatable, intent(inout) :: values(:)
         logical, intent(in), optional :: needed
         integer, intent(in), optional :: default
      end subroutine integers_binding

      subroutine set_extent(self, name, extent)
         import :: key_visitor
         implicit none (type, external)
         class(key_visitor), intent(inout) :: self
         character(*), intent(in) :: name
         integer, intent(in) :: extent
      end subroutine set_extent

      pure function extents_of(self, shape) result(extents)
         import :: key_visitor
         implicit none (type, external)
         class(key_visitor), intent(in) :: self
         character(*), intent(in) :: shape
         integer, allocatable :: extents(:)
      end function extents_of
   end interface

contains

   !> A key without its value; see key_type.
   pure type(key_type) function key(name, help, range, unit, shape, repeats, absent, only)
      character(*), intent(in) :: name, help
      type(range_type), intent(in), optional :: range
      character(*), intent(in), optional :: unit, shape
      logical, intent(in), optional :: repeats
      character(*), intent(in), optional :: absent, only

      key%name = name
      key%help = help
      if (present(range)) key%range = range
      if (present(unit)) key%unit = unit
      if (present(shape)) key%shape = shape
      if (present(repeats)) key%repeats = repeats
      if (present(absent)) key%absent = absent
      if (present(only)) key%only = only
   end function key

   !> An array of two dimensions, in Fortran order.
   subroutine bind_matrix(self, key, values, needed, default)
      class(key_visitor), intent(inout) :: self
      type(key_type), intent(in) :: key
      real(wp), allocatable, intent(inout) :: values(:, :)
      logical, intent(in), optional :: needed
      real(wp), intent(in), optional :: default
      real(wp), allocatable :: flat(:)
      integer :: extents(2)

      if (allocated(values)) flat = reshape(values, [size(values)])
      call self%bind(key, flat, needed, default)
      if (.not. allocated(flat)) return
      extents = self%extents(key%shape)
      if (allocated(values)) then
         ! A visitor that reads one key at a time has no extents of the others.
         if (size(values) == size(flat) .and. product(extents) /= size(flat)) then
            extents = shape(values)
         end if
      end if
      values = reshape(flat, extents)
   end subroutine bind_matrix

   subroutine bind_integer_matrix(self, key, values, needed, default)
      class(key_visitor), intent(inout) :: self
      type(key_type), intent(in) :: key
      integer, allocatable, intent(inout) :: values(:, :)
      logical, intent(in), optional :: needed
      integer, intent(in), optional :: default
      integer, allocatable :: flat(:)
      integer :: extents(2)

      if (allocated(values)) flat = reshape(values, [size(values)])
      call self%bind(key, flat, needed, default)
      if (.not. allocated(flat)) return
      extents = self%extents(key%shape)
      if (allocated(values)) then
         ! A visitor that reads one key at a time has no extents of the others.
         if (size(values) == size(flat) .and. product(extents) /= size(flat)) then
            extents = shape(values)
         end if
      end if
      values = reshape(flat, extents)
   end subroutine bind_integer_matrix

end module fw_key
