!> A model file as a source of parts. Shapes are checked before values, and both before anything is
!> used: a message names file, part, what was found and what was expected. Indices in messages count
!> from 0, as in h5py.
module fw_part_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: dataset_failure, get_shape, has_attribute, hdf5_file, read_attribute, &
      read_dataset, read_text, shape_text
   use fw_kinds, only: wp
   use fw_part, only: part_source, part_type
   use fw_text, only: to_text
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: file_source

   type, extends(part_source) :: file_source
      type(hdf5_file) :: file
      !> Matrices of nodal diameters stand in the place of those of a sector.
      logical :: is_nodal = .false.
   contains
      procedure :: seek
      procedure :: numbers
      procedure :: fail
      procedure :: refuse
      procedure, private :: is_needed
      procedure, private :: read_numbers
      procedure, private :: read_single
      procedure, private :: read_spread
      procedure, private :: check_extents
      procedure, private :: check_complex
      procedure, private :: check_finite
      procedure :: forget
   end type file_source

contains

   subroutine seek(self, part, found)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      logical, intent(out) :: found
      character(:), allocatable :: name
      integer :: at

      found = .false.
      if (self%is_nodal .and. part%shape == 'dof dof') return
      name = '/'//trim(self%name_of(part))
      at = index(name, '@')
      if (at > 0) then
         call read_attribute_of(self, part, name(:max(1, at - 1)), name(at + 1:), found)
         return
      end if
      found = self%file%exists(name)
      ! Who reads what is missing says so.
      if (.not. (found .or. self%is_needed(part))) return
      if (part%kind == 'text') then
         call read_text(self%file, name, self%texts, self%error)
         if (.not. allocated(self%error)) self%dims = [size(self%texts)]
      else
         call self%read_numbers(part, name, found)
      end if
      if (allocated(self%error)) return
      if (part%kind == 'complex') then
         call self%check_complex(part)
      else
         call self%check_extents(part)
      end if
      if (part%kind == 'real' .and. .not. allocated(self%error)) then
         call self%check_finite(name, int(self%dims, hsize_t))
      end if
   end subroutine seek

   !> Of the file or of a group.
   subroutine read_attribute_of(self, part, object, name, found)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: object, name
      logical, intent(out) :: found

      found = has_attribute(self%file, object, name)
      if (.not. (found .or. self%is_needed(part))) return
      if (allocated(self%texts)) deallocate (self%texts)
      allocate (self%texts(1))
      self%integers = [0]
      if (part%kind == 'text') then
         call read_attribute(self%file, object, name, self%texts(1)%text, self%error)
      else
         call read_attribute(self%file, object, name, self%integers(1), self%error)
      end if
   end subroutine read_attribute_of

   !> Whether the absence of a part is an error.
   logical function is_needed(self, part)
      class(file_source), intent(in) :: self
      type(part_type), intent(in) :: part

      is_needed = part%needed == 'required' .or. part%needed == 'with its group'
      if (index(part%needed, 'with /') == 1) is_needed = self%file%exists(trim(part%needed(6:)))
      if (index(part%needed, 'without /') == 1) is_needed = .not. &
         self%file%exists(trim(part%needed(9:)))
   end function is_needed

   !> Numbers of any rank, or the one that holds for all.
   subroutine read_numbers(self, part, name, found)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: name
      logical, intent(in) :: found
      integer(hsize_t), allocatable :: dims(:)
      integer :: rank

      rank = size(self%extents_of(part))
      if (index(part%shape, 'one_or ') == 1) then
         if (.not. found) then
            call self%fail(part, 'is missing: each '//trim(part%shape(8:))//' needs one')
            return
         end if
         call get_shape(self%file, name, dims, self%error)
         if (allocated(self%error)) return
         if (size(dims) == 0) then
            call self%read_single(part, name)
            return
         end if
      end if
      if (index(part%shape, 'sector row') > 0 .and. found) then
         call get_shape(self%file, name, dims, self%error)
         if (allocated(self%error)) return
         if (size(dims) == rank - 1) then
            call self%read_spread(part, name)
            return
         end if
      end if
      if (part%kind == 'integer') then
         call read_dataset(self%file, name, rank, self%dims, self%integers, self%error)
      else
         call read_dataset(self%file, name, rank, self%dims, self%reals, self%error)
      end if
   end subroutine read_numbers

   !> One value for all.
   subroutine read_single(self, part, name)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: name
      integer :: n
      real(wp) :: value

      self%dims = self%extents_of(part)
      n = self%dims(1)
      if (part%kind == 'integer') then
         call read_dataset(self%file, name, 0, self%dims, self%integers, self%error)
         if (.not. allocated(self%error)) self%integers = spread(self%integers(1), 1, n)
      else
         call read_dataset(self%file, name, 0, self%dims, self%reals, self%error)
         if (allocated(self%error)) return
         call self%check_finite(name, [integer(hsize_t) ::])
         value = self%reals(1)
         deallocate (self%reals)
         allocate (self%reals(n), source=value)
      end if
      self%dims = [n]
   end subroutine read_single

   !> One value of each sector for all rows.
   subroutine read_spread(self, part, name)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: name
      real(wp), allocatable :: values(:)
      integer :: n, r

      call read_dataset(self%file, name, size(self%extents_of(part)) - 1, self%dims, self%reals, &
                        self%error)
      if (allocated(self%error)) return
      r = max(1, self%extent_of('row'))
      values = self%reals
      n = r*size(values)
      deallocate (self%reals)
      allocate (self%reals(n))
      self%reals = reshape(spread(values, 1, r), [n])
      self%dims = [r, self%dims]
   end subroutine read_spread

   !> Refuse other extents than those that are known, and take those that are not.
   subroutine check_extents(self, part)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, allocatable :: expected(:)

      call learn(self, part)
      expected = self%extents_of(part)
      if (any(self%dims /= expected)) then
         if (is_multiple(part, self%dims(1), expected(1))) return
         if (size(expected) == 1 .and. part%kind == 'integer') then
            call self%fail(part, 'has '//to_text(self%dims(1))//' values, expected '// &
                           counted(part, expected(1)))
         else
            call self%fail(part, 'has shape '//shape_text(int(self%dims, hsize_t))// &
                           ', expected '//shape_text(int(expected, hsize_t)))
         end if
      else if (size(expected) == 2 .and. part%kind == 'real' .and. product(expected) == 0 .and. &
               part%shape /= 'pair 3') then
         call self%fail(part, 'is empty: no degrees of freedom')
      end if
   end subroutine check_extents

   !> Extents that no part before has given.
   subroutine learn(self, part)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer :: j, last
      character(20) :: rest

      ! Words from the last one on, as the extents of Fortran stand.
      rest = part%shape
      do j = 1, size(self%dims)
         last = index(trim(rest), ' ', back=.true.)
         associate (word => rest(last + 1:len_trim(rest)))
            if (self%extent_of(word) < 0) call self%set_extent(word, self%dims(j))
         end associate
         rest = rest(:last)
      end do
   end subroutine learn

   !> Values of the pairs of all sectors are as many times those of one.
   pure logical function is_multiple(part, found, n)
      type(part_type), intent(in) :: part
      integer, intent(in) :: found, n

      is_multiple = part%shape == 'one_or pair' .and. n > 0 .and. found > 0
      if (is_multiple) is_multiple = modulo(found, n) == 0
   end function is_multiple

   !> A number of values, and why it is expected.
   pure function counted(part, n) result(text)
      type(part_type), intent(in) :: part
      integer, intent(in) :: n
      character(:), allocatable :: text

      select case (part%shape)
      case ('one_or spring')
         text = to_text(n)//', as many as /spring/side_1, or one for all'
      case ('interface')
         text = 'as many as /cyclic/left: '//to_text(n)
      case ('quantity')
         text = 'one per name: '//to_text(n)
      case default
         text = to_text(n)
      end select
   end function counted

   !> Of nodal diameters and of the air.
   subroutine check_complex(self, part)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer :: n, rows, columns

      n = self%extent_of('order')
      columns = self%dims(2)
      rows = self%dims(size(self%dims))
      if (part%shape == 'order') then
         if (self%dims(1) /= 2 .or. rows /= n) then
            call self%fail(part, 'has '//to_text(rows)//' rows of '//to_text(self%dims(1))// &
                           ', expected '//to_text(n)//' of 2, real and imaginary part')
         end if
      else if (self%dims(1) /= 2) then
         call self%fail(part, 'has '//to_text(self%dims(1))//' numbers for each entry, '// &
                        'expected 2, real and imaginary part')
      else if (part%shape == 'order order') then
         if (rows*columns > 0 .and. rows == columns .and. (n < 0 .or. rows == n)) return
         call self%fail(part, 'is '//to_text(rows)//' x '//to_text(columns)//', expected a '// &
                        'square matrix of the order of the mass')
      else if ((part%shape == 'quantity order' .or. part%shape == 'stress 6 order') .and. &
               columns /= n) then
         call self%fail(part, 'has '//to_text(columns)//' columns, expected '//to_text(n))
      end if
   end subroutine check_complex

   !> Refuse NaN and infinity, with the place of the first.
   subroutine check_finite(self, name, dims)
      class(file_source), intent(inout) :: self
      character(*), intent(in) :: name
      integer(hsize_t), intent(in) :: dims(:)
      integer(hsize_t) :: place(size(dims)), rest
      integer :: i, j

      do i = 1, size(self%reals)
         if (ieee_is_finite(self%reals(i))) cycle
         rest = i - 1
         do j = 1, size(dims)
            ! Indices from 0, as h5py counts; shape_text turns their order.
            place(j) = mod(rest, dims(j))
            rest = rest/dims(j)
         end do
         call dataset_failure(self%file, name, 'holds '//to_text(self%reals(i))//' at index '// &
                              shape_text(place)//', expected a finite number', self%error)
         return
      end do
   end subroutine check_finite

   !> By name: nothing says how many there are, nor in what order.
   subroutine numbers(self, part, least, most, list)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, intent(in) :: least, most
      integer, allocatable, intent(out) :: list(:)
      integer :: k

      allocate (list(0))
      do k = least, most
         self%number = k
         if (self%file%exists('/'//trim(self%name_of(part)))) list = [list, k]
      end do
   end subroutine numbers

   !> Text that continues the name of a dataset, or of an attribute.
   subroutine fail(self, part, text)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: text

      call dataset_failure(self%file, '/'//trim(self%name_of(part)), text, self%error)
   end subroutine fail

   subroutine refuse(self, part, found, expected)
      class(file_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: found, expected

      call self%fail(part, 'holds '//found//', expected '//expected)
   end subroutine refuse

   !> Give the room of numbers back.
   subroutine forget(self)
      class(file_source), intent(inout) :: self

      if (associated(self%reals)) deallocate (self%reals)
   end subroutine forget

end module fw_part_file
