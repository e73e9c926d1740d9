!> Datasets that grow along their first dimension as h5py shows them, one row at a time.
!>
!> Rows not given (skipped) read as NaN for reals and 0 otherwise. A chunk holds about 64 kB, so
!> that a flush, which writes whole chunks, stays cheap, and never more rows than are expected.
!> Only the chunk that grows is kept in memory: HDF5 would keep a megabyte of each dataset.
!>
!> Where rows may wait they are gathered here, up to a chunk, and written together: HDF5 takes
!> as long for a chunk as for a row.
module fw_hdf5_append
   use, intrinsic :: iso_c_binding, only: c_int8_t, c_f_pointer, c_loc, c_ptr, c_size_t
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_hdf5_dataset, only: get_shape
   use fw_hdf5_file, only: hdf5_file, dataset_failure, shape_text
   use fw_hdf5_write, only: new_dataset
   use fw_kinds, only: wp
   use fw_text, only: to_text
   use hdf5, only: hid_t, hsize_t, size_t, h5dclose_f, h5dget_space_f, h5dopen_f, h5dread_f, &
      h5dset_extent_f, h5dwrite_f, h5kind_to_type, h5_integer_kind, h5_real_kind, h5pclose_f, &
      h5pcreate_f, h5pset_chunk_cache_f, h5pset_chunk_f, h5pset_fill_value_f, &
      h5p_dataset_access_f, h5p_dataset_create_f, h5sclose_f, h5screate_simple_f, &
      h5sselect_hyperslab_f, h5s_select_set_f, h5s_unlimited_f, h5tclose_f, h5tcopy_f, &
      h5tenum_create_f, h5tenum_insert_f, h5tget_size_f
   implicit none (type, external)
   private

   public :: growing_dataset, growing_real, growing_integer, growing_logical

   !> Kinds of elements; a logical is what h5py shows as bool.
   integer, parameter :: growing_real = 1, growing_integer = 2, growing_logical = 3

   ! The rows of scalars would else fill chunks of thousands, and the file with them.
   integer, parameter :: chunk_bytes = 65536, max_chunk_rows = 1024
   !> Of the table that finds a chunk in memory: any number serves for one chunk.
   integer(size_t), parameter :: cache_slots = 7_size_t

   !> A dataset of rows, in the file while that is open. Not to be copied.
   type :: growing_dataset
      !> Rows so far, those that were skipped included.
      integer :: n_rows = 0
      !> Rows wait for `drain` (or until they fill a chunk): for files that are drained before each
      !> flush. Set after `create`.
      logical :: waits = .false.
      integer(hid_t), private :: id = -1_hid_t, type_id = -1_hid_t
      character(:), allocatable, private :: name
      !> Dimensions of a row in the order of Fortran, then 1 for the row itself.
      integer(hsize_t), allocatable, private :: row(:)
      !> Rows that the file knows of; bytes of the last rows, which it does not have yet, their
      !> number and the most of them.
      integer, private :: n_stored = 0
      integer(c_int8_t), allocatable, private :: waiting(:)
      integer, private :: n_waiting = 0, most_waiting = 1
   contains
      procedure :: create
      procedure :: is_created
      procedure :: place
      procedure :: skip
      procedure :: copy_rows
      procedure :: permute
      procedure :: close
      !> `call dataset%append(file, values, error)`: one row, of exactly the shape created.
      generic :: append => append_real, append_logical
      procedure, private :: append_real, append_logical
      !> One row of numbers whose elements follow one another.
      generic :: append_flat => append_flat_real, append_flat_integer
      procedure, private :: append_flat_real, append_flat_integer
      !> `call dataset%drain(file, error)`: write what waits.
      procedure :: drain
      procedure, private :: append_raw
   end type growing_dataset

   interface
      !> Of C: bytes of one array to another.
      function copy_memory(to, from, n) bind(c, name='memcpy') result(address)
         import :: c_int8_t, c_ptr, c_size_t
         implicit none (type, external)
         integer(c_int8_t), intent(out) :: to(*)
         integer(c_int8_t), intent(in) :: from(*)
         integer(c_size_t), intent(in), value :: n
         type(c_ptr) :: address
      end function copy_memory
   end interface

contains

   !> Create the dataset without rows.
   subroutine create(self, file, name, kind_of, row_shape, error, expected_rows)
      class(growing_dataset), intent(out) :: self
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      !> growing_real, growing_integer or growing_logical.
      integer, intent(in) :: kind_of
      !> Shape of a row in Fortran, empty for scalars.
      integer, intent(in) :: row_shape(:)
      type(error_type), allocatable, intent(out) :: error
      !> How many rows are likely (default: not known); more may come.
      integer, intent(in), optional :: expected_rows
      integer(hid_t) :: space, creation, access
      integer(hsize_t) :: limit(size(row_shape) + 1), chunk(size(row_shape) + 1)
      integer :: status

      self%name = name
      ! The row itself is the last dimension in Fortran: the first one as h5py shows it.
      self%row = [int(row_shape, hsize_t), 1_hsize_t]
      self%type_id = element_type(kind_of)
      limit = self%row
      limit(size(limit)) = h5s_unlimited_f
      ! Chunks must have an extent; rows of size 0 are stored as nothing.
      chunk = max(self%row, 1_hsize_t)
      chunk(size(chunk)) = rows_per_chunk(self, expected_rows)
      call h5pcreate_f(h5p_dataset_create_f, creation, status)
      call h5pset_chunk_f(creation, size(chunk), chunk, status)
      if (kind_of == growing_real) then
         ! Rows that are skipped read as what they are: not there.
         call h5pset_fill_value_f(creation, self%type_id, &
                                  ieee_value(1.0_wp, ieee_quiet_nan), status)
      end if
      call h5screate_simple_f(size(limit), [self%row(:size(row_shape)), 0_hsize_t], space, &
                              status, limit)
      self%most_waiting = int(chunk(size(chunk)))
      access = cache_of_one(self, product(chunk))
      call new_dataset(file, name, self%type_id, space, self%id, error, creation, access)
      call h5sclose_f(space, status)
      call h5pclose_f(creation, status)
      call h5pclose_f(access, status)
   end subroutine create

   !> Access properties of a dataset that keeps a single chunk in memory.
   integer(hid_t) function cache_of_one(self, n_elements) result(access)
      type(growing_dataset), intent(in) :: self
      !> Elements of a chunk.
      integer(hsize_t), intent(in) :: n_elements
      integer(size_t) :: bytes
      integer :: status

      call h5tget_size_f(self%type_id, bytes, status)
      call h5pcreate_f(h5p_dataset_access_f, access, status)
      call h5pset_chunk_cache_f(access, cache_slots, bytes*int(n_elements, size_t), 1.0, status)
   end function cache_of_one

   !> Optional results are never created; callers ask before they append.
   pure logical function is_created(self)
      class(growing_dataset), intent(in) :: self

      is_created = self%id >= 0
   end function is_created

   !> The file as seen from the dataset, which is '.' there: for its attributes.
   pure function place(self, file) result(at)
      class(growing_dataset), intent(in) :: self
      type(hdf5_file), intent(in) :: file
      type(hdf5_file) :: at

      at = file
      at%id = self%id
      at%path = file%path//self%name
   end function place

   !> Leave n rows at their fill value.
   !> As rows of points that do not have this result.
   subroutine skip(self, file, n, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      !> Rows to copy, from the first on; the source has at least that many.
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error

      if (n <= 0) return
      ! What waits are the last rows, without gaps.
      call self%drain(file, error)
      if (allocated(error)) return
      self%n_rows = self%n_rows + n
      if (.not. self%waits) call self%drain(file, error)
   end subroutine skip

   !> Append the first n rows of the dataset of the same name in another file, bit by bit; nothing
   !> where this one was never created.
   subroutine copy_rows(self, file, source, n, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      integer(hid_t) :: id
      integer :: rank, status, i

      if (self%id < 0) return
      call get_shape(source, self%name, dims, error)
      if (allocated(error)) return
      rank = size(self%row)
      if (size(dims) /= rank) then
         call dataset_failure(source, self%name, 'has shape '//shape_text(dims)//', expected '// &
                              to_text(rank)//' dimensions', error)
      else if (any(dims(:rank - 1) /= self%row(:rank - 1)) .or. dims(rank) < n) then
         call dataset_failure(source, self%name, 'has shape '//shape_text(dims)//', expected '// &
                              'at least '//shape_text([self%row(:rank - 1), int(n, hsize_t)]), &
                              error)
      end if
      if (allocated(error)) return
      ! Opened once for all rows, which go over one by one: the whole may not fit memory.
      call h5dopen_f(source%id, self%name, id, status)
      do i = 1, n
         call copy_row(self, file, source, id, i, error)
         if (allocated(error)) exit
      end do
      call h5dclose_f(id, status)
   end subroutine copy_rows

   !> As bytes: no conversion can change a bit.
   subroutine copy_row(self, file, source, id, i, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      !> The dataset in the source.
      integer(hid_t), intent(in) :: id
      integer, intent(in) :: i
      type(error_type), allocatable, intent(out) :: error
      integer(c_int8_t), allocatable, target :: buffer(:)
      type(c_ptr) :: address
      integer(hid_t) :: memory, space
      integer(hsize_t) :: start(size(self%row))
      integer(size_t) :: bytes
      integer :: rank, status, ignored

      rank = size(self%row)
      call h5tget_size_f(self%type_id, bytes, status)
      allocate (buffer(max(1_size_t, bytes*int(product(self%row), size_t))), source=0_c_int8_t)
      address = c_loc(buffer)
      if (product(self%row) > 0) then
         start = 0
         ! HDF5 counts from 0.
         start(rank) = i - 1
         call h5dget_space_f(id, space, status)
         call h5sselect_hyperslab_f(space, h5s_select_set_f, start, self%row, status)
         call h5screate_simple_f(rank, self%row, memory, status)
         call h5dread_f(id, self%type_id, address, status, memory, space)
         call h5sclose_f(memory, ignored)
         call h5sclose_f(space, ignored)
         if (status < 0) then
            call dataset_failure(source, self%name, 'cannot be read (damaged file?)', error)
            return
         end if
      end if
      call self%append_raw(file, int(self%row(:rank - 1)), buffer, error)
   end subroutine copy_row

   !> Put row order(k) in the place of row k, bit by bit; nothing where this was never created.
   subroutine permute(self, file, order, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: order(:)
      type(error_type), allocatable, intent(out) :: error
      integer(c_int8_t), allocatable, target :: buffer(:), sorted(:)
      type(c_ptr) :: address
      integer(size_t) :: bytes
      integer :: status, k, n

      if (self%id < 0) return
      call self%drain(file, error)
      if (allocated(error)) return
      if (self%n_rows == 0 .or. product(self%row) == 0) return
      if (size(order) /= self%n_rows) then
         call dataset_failure(file, self%name, 'has another number of rows', error)
         return
      end if
      call h5tget_size_f(self%type_id, bytes, status)
      n = int(bytes)*int(product(self%row))
      allocate (buffer(n*self%n_rows), sorted(n*self%n_rows))
      address = c_loc(buffer)
      call h5dread_f(self%id, self%type_id, address, status)
      do k = 1, self%n_rows
         sorted((k - 1)*n + 1:k*n) = buffer((order(k) - 1)*n + 1:order(k)*n)
      end do
      address = c_loc(sorted)
      if (status >= 0) call h5dwrite_f(self%id, self%type_id, address, status)
      if (status < 0) call dataset_failure(file, self%name, 'cannot be sorted (disk full?)', error)
   end subroutine permute

   !> Release the handles; harmless where nothing was created. Who wants to know whether the last
   !> rows could be written drains before.
   subroutine close(self)
      class(growing_dataset), intent(inout) :: self
      integer :: status

      if (self%id < 0) return
      call write_waiting(self, status)
      call h5dclose_f(self%id, status)
      call h5tclose_f(self%type_id, status)
      self%id = -1_hid_t
   end subroutine close

   !> Numbers of a row, of any rank.
   subroutine append_real(self, file, values, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      real(wp), intent(in), contiguous, target :: values(..)
      type(error_type), allocatable, intent(out) :: error

      call self%append_raw(file, shape(values), bytes_of(c_loc(values), &
                                                         storage_size(0.0_wp)/8*size(values)), &
                           error)
   end subroutine append_real

   !> A row of any shape, its elements in their order in memory: h5py shows the dimensions reversed.
   subroutine append_flat_real(self, file, dims, values, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      !> Shape of the row.
      integer, intent(in) :: dims(:)
      real(wp), intent(in), target :: values(product(dims))
      type(error_type), allocatable, intent(out) :: error

      call self%append_raw(file, dims, bytes_of(c_loc(values), &
                                                  storage_size(values)/8*size(values)), error)
   end subroutine append_flat_real

   !> The same of whole numbers; one without a dimension.
   subroutine append_flat_integer(self, file, dims, values, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: dims(:)
      integer, intent(in), target :: values(product(dims))
      type(error_type), allocatable, intent(out) :: error

      call self%append_raw(file, dims, bytes_of(c_loc(values), &
                                                storage_size(values)/8*size(values)), error)
   end subroutine append_flat_integer

   !> One truth value a row, a byte in the file.
   subroutine append_logical(self, file, values, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      logical, intent(in) :: values
      type(error_type), allocatable, intent(out) :: error
      integer(c_int8_t) :: buffer

      buffer = merge(1_c_int8_t, 0_c_int8_t, values)
      call self%append_raw(file, [integer ::], [buffer], error)
   end subroutine append_logical

   !> Memory as bytes.
   function bytes_of(address, n) result(bytes)
      type(c_ptr), intent(in) :: address
      integer, intent(in) :: n
      integer(c_int8_t), pointer :: bytes(:)

      call c_f_pointer(address, bytes, [n])
   end function bytes_of

   !> One row from its bytes, which are those of the file, of a shape that is checked.
   subroutine append_raw(self, file, dims, bytes, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: dims(:)
      integer(c_int8_t), intent(in), contiguous :: bytes(:)
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: ignored
      integer :: n

      n = size(self%row)
      if (size(dims) /= n - 1) then
         call dataset_failure(file, self%name, 'takes rows of another rank', error)
      else if (any(dims /= self%row(:n - 1))) then
         call dataset_failure(file, self%name, 'takes rows of another shape', error)
      end if
      if (allocated(error)) return
      if (self%n_waiting == self%most_waiting) then
         call self%drain(file, error)
         if (allocated(error)) return
      end if
      ! A row of size 0 still counts as one.
      self%n_rows = self%n_rows + 1
      if (product(self%row) > 0) then
         n = size(bytes)
         if (.not. allocated(self%waiting)) allocate (self%waiting(n*self%most_waiting))
         ! A loop over bytes takes ten times as long.
         ignored = copy_memory(self%waiting(self%n_waiting*n + 1), bytes, int(n, c_size_t))
         self%n_waiting = self%n_waiting + 1
      end if
      if (.not. self%waits) call self%drain(file, error)
   end subroutine append_raw

   !> Write the rows that wait. Nothing where nothing was created.
   subroutine drain(self, file, error)
      class(growing_dataset), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      if (self%id < 0) return
      call write_waiting(self, status)
      if (status < 0) call dataset_failure(file, self%name, 'cannot take row '// &
                                           to_text(self%n_rows)//' (disk full?)', error)
   end subroutine drain

   !> New rows read as the fill value until they are written.
   subroutine write_waiting(self, status)
      class(growing_dataset), intent(inout), target :: self
      integer, intent(out) :: status
      type(c_ptr) :: address
      integer(hid_t) :: memory, space
      integer(hsize_t) :: extent(size(self%row)), start(size(self%row))
      integer :: ignored, n

      status = 0
      n = size(self%row)
      extent = self%row
      if (self%n_stored < self%n_rows) then
         extent(n) = self%n_rows
         call h5dset_extent_f(self%id, extent, status)
         if (status < 0) return
         self%n_stored = self%n_rows
      end if
      if (self%n_waiting == 0) return
      start = 0
      ! HDF5 counts from 0.
      start(n) = self%n_rows - self%n_waiting
      extent(n) = self%n_waiting
      ! Written or given up, whatever comes of it.
      self%n_waiting = 0
      call h5dget_space_f(self%id, space, status)
      call h5sselect_hyperslab_f(space, h5s_select_set_f, start, extent, status)
      call h5screate_simple_f(n, extent, memory, status)
      address = c_loc(self%waiting)
      call h5dwrite_f(self%id, self%type_id, address, status, memory, space)
      ! Closed whatever came of the writing, or handles would leak with a full disk.
      call h5sclose_f(memory, ignored)
      call h5sclose_f(space, ignored)
   end subroutine write_waiting

   !> At least one, however large it is.
   integer(hsize_t) function rows_per_chunk(self, expected_rows) result(rows)
      class(growing_dataset), intent(in) :: self
      integer, intent(in), optional :: expected_rows
      integer(size_t) :: bytes
      integer :: status

      call h5tget_size_f(self%type_id, bytes, status)
      rows = chunk_bytes/max(1_hsize_t, int(bytes, hsize_t)*product(self%row))
      rows = min(rows, int(max_chunk_rows, hsize_t))
      if (present(expected_rows)) rows = min(rows, int(expected_rows, hsize_t))
      rows = max(rows, 1_hsize_t)
   end function rows_per_chunk

   !> The type in the file; a type of its own for logicals, as h5py has it.
   integer(hid_t) function element_type(kind_of) result(type_id)
      integer, intent(in) :: kind_of
      integer(c_int8_t), target :: flag
      integer(hid_t) :: byte
      integer :: status

      select case (kind_of)
      case (growing_real)
         type_id = copied(h5kind_to_type(wp, h5_real_kind))
      case (growing_integer)
         type_id = copied(h5kind_to_type(kind(0), h5_integer_kind))
      case default
         ! An enumeration of bytes with FALSE = 0 and TRUE = 1 is what h5py takes for bool.
         byte = h5kind_to_type(c_int8_t, h5_integer_kind)
         call h5tenum_create_f(byte, type_id, status)
         flag = 0
         call h5tenum_insert_f(type_id, 'FALSE', c_loc(flag), status)
         flag = 1
         call h5tenum_insert_f(type_id, 'TRUE', c_loc(flag), status)
      end select
   end function element_type

   !> A copy of our own, so that every type can be closed alike.
   integer(hid_t) function copied(predefined) result(type_id)
      integer(hid_t), intent(in) :: predefined
      integer :: status

      call h5tcopy_f(predefined, type_id, status)
   end function copied

end module fw_hdf5_append
