!> Parts of a model, declared once: one call names a part, says its shape, its meaning and whether
!> it is needed, and binds it to the component that holds it,
!>
!>    call to%bind(part('load/cosine', 'dof', 'in phase with cos(omega t)'), self%load_cosine)
!>
!> Whoever goes through these calls is a `part_source`: a model file and the values of a calling
!> program fill the components, the list of `fw_run --parts` writes down what there is. Texts have
!> fixed lengths, so that no part needs memory of its own.
module fw_part
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_key, only: key_type
   use fw_kinds, only: wp
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: part, part_source, part_type, by_columns, by_rows, either_way

   !> How h5py shows a matrix: row after row as it is here, or a column of ours in each of its rows.
   !> A symmetric one that a program gives may be either.
   integer, parameter :: by_rows = 1, by_columns = 2, either_way = 3

   !> Everything about a part but its value.
   type :: part_type
      !> Path from the root. K stands for a nodal diameter, M for the number of a sector or of a
      !> signed nodal diameter; what follows a @ is an attribute of the group before it.
      character(40) :: name = ''
      !> Of the numbers: complex ones have real and imaginary part in one more dimension.
      character(7) :: kind = ''
      !> Extents as h5py shows them, in words; `one_or` before them: a scalar holds for all.
      character(20) :: shape = ''
      !> Blank: may be absent.
      character(32) :: needed = ''
      character(150) :: meaning = ''
      integer :: storage = by_rows
   end type part_type

   character(*), parameter, public :: scalar = 'one_or '

   !> Words of shapes that stand for extents which parts share, at most.
   integer, parameter :: most_words = 32

   !> Goes through the parts of a model. After a failure nothing more is taken.
   type, abstract :: part_source
      type(error_type), allocatable :: error
      !> Keys of the constants of pairs that laws declare.
      type(key_type), allocatable :: constants(:)
      !> What K or M stands for in the parts that follow, and whether complex ones are conjugates.
      integer :: number = 0
      logical :: conjugates = .false.
      !> Whether symmetric matrices stand row after row: where they are not, messages say where.
      logical :: stands_by_rows = .true.
      !> What `seek` has found: extents in the order of Fortran, and the values.
      integer, allocatable :: dims(:)
      real(wp), pointer :: reals(:) => null()
      integer, allocatable :: integers(:)
      type(string_type), allocatable :: texts(:)
      character(12), private :: word(most_words) = ''
      integer, private :: extent(most_words) = -1
   contains
      generic :: bind => bind_text, bind_texts, bind_integer, bind_integers, bind_integer_matrix, &
         bind_reals, bind_matrix, bind_tensor, bind_complex, bind_complex_matrix, &
         bind_complex_tensor
      procedure(seek_part), deferred :: seek
      procedure(list_numbers), deferred :: numbers
      procedure :: note
      procedure :: fail
      procedure :: refuse
      procedure :: name_of
      procedure :: extents_of
      procedure :: set_extent
      procedure :: extent_of
      procedure, private :: bind_text, bind_texts, bind_integer, bind_integers
      procedure, private :: bind_integer_matrix, bind_reals, bind_matrix, bind_complex
      procedure, private :: bind_complex_matrix, bind_complex_tensor, bind_tensor
   end type part_source

   abstract interface
      !> Find a part and take its values, checked against the extents that are known.
      subroutine seek_part(self, part, found)
         import :: part_source, part_type
         implicit none (type, external)
         class(part_source), intent(inout) :: self
         type(part_type), intent(in) :: part
         logical, intent(out) :: found
      end subroutine seek_part

      !> Which numbers there are of a part that has K or M in its name.
      subroutine list_numbers(self, part, least, most, list)
         import :: part_source, part_type
         implicit none (type, external)
         class(part_source), intent(inout) :: self
         type(part_type), intent(in) :: part
         integer, intent(in) :: least, most
         integer, allocatable, intent(out) :: list(:)
      end subroutine list_numbers
   end interface

contains

   !> A part without its kind, which is that of the component.
   pure type(part_type) function part(name, shape, meaning, needed, storage)
      character(*), intent(in) :: name, shape, meaning
      character(*), intent(in), optional :: needed
      integer, intent(in), optional :: storage

      part%name = name
      part%shape = shape
      part%meaning = meaning
      if (present(needed)) part%needed = needed
      if (present(storage)) part%storage = storage
   end function part

   !> A part that somebody else reads; it is listed only.
   subroutine note(self, kind, part)
      class(part_source), intent(inout) :: self
      character(*), intent(in) :: kind
      type(part_type), intent(in) :: part

      associate (unused => self, of => kind, neither => part)
      end associate
   end subroutine note

   !> An error: `text` continues the name of the part.
   subroutine fail(self, part, text)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: text

      call fatal_error(self%error, trim(self%name_of(part))//' '//text, status_input)
   end subroutine fail

   !> A value that is not what it has to be.
   subroutine refuse(self, part, found, expected)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: found, expected

      call self%fail(part, 'has '//found//': must be '//expected)
   end subroutine refuse

   !> The name with its number.
   pure function name_of(self, part) result(name)
      class(part_source), intent(in) :: self
      type(part_type), intent(in) :: part
      character(60) :: name
      integer :: at

      name = part%name
      ! Places of numbers are the only capital letters.
      at = max(index(part%name, '/K'), index(part%name, '/M'), index(part%name, '/I'), &
               index(part%name, '/J'))
      if (at > 0) name = part%name(:at)//to_text(self%number)//part%name(at + 2:)
   end function name_of

   !> Extents in the order of Fortran; -1 where one is not known.
   pure function extents_of(self, part) result(dims)
      class(part_source), intent(in) :: self
      type(part_type), intent(in) :: part
      integer, allocatable :: dims(:)
      integer :: first, last, n

      allocate (dims(0))
      first = 1
      if (index(part%shape, scalar) == 1) first = len(scalar) + 1
      do while (first <= len_trim(part%shape))
         last = first + index(part%shape(first:)//' ', ' ') - 2
         n = self%extent_of(part%shape(first:last))
         dims = [n, dims]
         first = last + 2
      end do
      if (part%kind == 'complex') dims = [2, dims]
   end function extents_of

   !> What a word of a shape stands for; -1 where it is not known.
   pure integer function extent_of(self, word) result(n)
      class(part_source), intent(in) :: self
      character(*), intent(in) :: word
      integer :: k

      n = index('0123456789', word) - 1
      k = findloc(self%word == word, .true., dim=1)
      if (k > 0) n = self%extent(k)
   end function extent_of

   !> From now on a word of shapes stands for this extent.
   subroutine set_extent(self, word, n)
      class(part_source), intent(inout) :: self
      character(*), intent(in) :: word
      integer, intent(in) :: n
      integer :: k

      k = findloc(self%word == word, .true., dim=1)
      if (k == 0) k = findloc(self%word == '', .true., dim=1)
      self%word(k) = word
      self%extent(k) = n
   end subroutine set_extent

   !> Whether there is such a part; then its values are taken.
   logical function has(self, part, kind)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: kind
      type(part_type) :: asked

      has = .false.
      if (allocated(self%error)) return
      asked = part
      asked%kind = kind
      call self%seek(asked, has)
      has = has .and. .not. allocated(self%error)
   end function has

   !> A word or a name.
   subroutine bind_text(self, part, value)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(:), allocatable, intent(inout) :: value

      if (has(self, part, 'text')) value = self%texts(1)%text
   end subroutine bind_text

   !> A list of them.
   subroutine bind_texts(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      type(string_type), allocatable, intent(inout) :: values(:)

      if (has(self, part, 'text')) values = self%texts
   end subroutine bind_texts

   !> One whole number.
   subroutine bind_integer(self, part, value)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, intent(inout) :: value

      if (has(self, part, 'integer')) value = self%integers(1)
   end subroutine bind_integer

   !> Whole numbers, flat in the order of Fortran.
   subroutine bind_integers(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, allocatable, intent(inout) :: values(:)

      if (has(self, part, 'integer')) values = self%integers
   end subroutine bind_integers

   !> A column in each row of the file.
   subroutine bind_integer_matrix(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, allocatable, intent(inout) :: values(:, :)

      if (has(self, part, 'integer')) values = reshape(self%integers, [self%dims(1), self%dims(2)])
   end subroutine bind_integer_matrix

   !> Numbers, flat in the order of Fortran.
   subroutine bind_reals(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      real(wp), allocatable, intent(inout) :: values(:)

      if (has(self, part, 'real')) values = self%reals
   end subroutine bind_reals

   !> Two extents.
   subroutine bind_matrix(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      real(wp), allocatable, intent(inout) :: values(:, :)
      real(wp), pointer :: found(:, :)
      integer :: dims(2), status
      logical :: turns

      if (.not. has(self, part, 'real')) return
      found(1:self%dims(1), 1:self%dims(2)) => self%reals
      dims = self%dims
      turns = part%storage == by_rows .or. (part%storage == either_way .and. self%stands_by_rows)
      if (turns) dims = dims([2, 1])
      if (allocated(values)) deallocate (values)
      allocate (values(dims(1), dims(2)), stat=status)
      if (status /= 0) then
         call fatal_error(self%error, trim(self%name_of(part))//': no memory for a matrix of '// &
                          'order '//to_text(dims(1)), status_failure)
      else if (turns) then
         values = transpose(found)
      else
         values = found
      end if
   end subroutine bind_matrix

   !> Three extents, in the order of Fortran.
   subroutine bind_tensor(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      real(wp), allocatable, intent(inout) :: values(:, :, :)

      if (has(self, part, 'real')) values = reshape(self%reals, [self%dims(1), self%dims(2), &
                                                                    self%dims(3)])
   end subroutine bind_tensor

   !> Real and imaginary part innermost.
   subroutine bind_complex(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      complex(wp), allocatable, intent(inout) :: values(:)

      if (has(self, part, 'complex')) values = complex_of(self)
   end subroutine bind_complex

   !> The same of two extents.
   subroutine bind_complex_matrix(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      complex(wp), allocatable, intent(inout) :: values(:, :)

      if (has(self, part, 'complex')) values = &
         transpose(reshape(complex_of(self), [self%dims(2), self%dims(3)]))
   end subroutine bind_complex_matrix

   !> The same of three extents, the last one first.
   subroutine bind_complex_tensor(self, part, values)
      class(part_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      complex(wp), allocatable, intent(inout) :: values(:, :, :)

      if (has(self, part, 'complex')) values = &
         reshape(complex_of(self), [self%dims(2), self%dims(3), self%dims(4)])
   end subroutine bind_complex_tensor

   !> Pairs of reals as complex numbers.
   pure function complex_of(self) result(values)
      class(part_source), intent(in) :: self
      complex(wp) :: values(size(self%reals)/2)

      values = cmplx(self%reals(1::2), merge(-1.0_wp, 1.0_wp, self%conjugates)*self%reals(2::2), wp)
   end function complex_of

end module fw_part
