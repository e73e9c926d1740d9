!> Opening a dataset for reading: type, rank and size are checked before anything is allocated.
module fw_hdf5_dataset
   use, intrinsic :: iso_c_binding, only: c_ptr
   use fw_error, only: error_type
   use fw_hdf5_file, only: hdf5_file, dataset_failure, shape_text
   use fw_text, only: to_text
   use hdf5, only: hid_t, hsize_t, h5dopen_f, h5dclose_f, h5dread_f, h5dget_space_f, &
      h5dget_type_f, h5dget_storage_size_f, h5sget_simple_extent_ndims_f, &
      h5sget_simple_extent_dims_f, h5sget_simple_extent_type_f, h5sclose_f, h5s_null_f, &
      h5tget_class_f, h5tclose_f, h5t_integer_f, h5t_float_f, h5t_string_f, h5t_compound_f, &
      h5t_enum_f
   implicit none (type, external)
   private

   public :: dataset_type, open_dataset, read_dataset_raw, get_shape
   public :: kind_real, kind_integer, kind_string

   !> What the elements must be; integers are accepted where reals are expected.
   integer, parameter :: kind_real = 1, kind_integer = 2, kind_string = 3
   character(*), parameter :: kind_words(*) = &
      [character(14) :: 'real numbers', 'integers', 'strings']

   ! More than any dataset of a model or a result has.
   integer, parameter :: max_rank = 8
   !> No more elements than 4 GB of reals: a dense model beyond that cannot be solved here, and
   !> a damaged file can claim any size.
   integer(hsize_t), parameter :: max_elements = 2_hsize_t**29
   !> Compression stores at least a byte per about 1000; large data with less behind it are void.
   integer(hsize_t), parameter :: large_bytes = 2_hsize_t**26, best_compression = 2000_hsize_t

   !> An open dataset.
   type :: dataset_type
      integer(hid_t) :: id = -1_hid_t
      integer :: rank = 0
      !> Dimensions in the order of Fortran; 1 beyond the rank.
      integer(hsize_t) :: dims(max_rank) = 1_hsize_t
   end type dataset_type

contains

   !> Open a dataset of a given kind and rank. The caller reads it with read_dataset_raw, which
   !> closes it; after an error it is closed already.
   subroutine open_dataset(file, name, kind, rank, dataset, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      !> One of the kinds above, and the rank that is expected.
      integer, intent(in) :: kind, rank
      !> Its dimensions are known before anything is allocated.
      type(dataset_type), intent(out) :: dataset
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      call inspect(file, name, dataset, error)
      if (allocated(error)) return
      call check_kind(file, name, dataset, kind, error)
      if (.not. allocated(error)) call check_size(file, name, dataset, rank, error)
      if (allocated(error)) call h5dclose_f(dataset%id, status)
   end subroutine open_dataset

   !> Dimensions of a dataset in the order of Fortran, the reverse of what h5py shows.
   subroutine get_shape(file, name, dims, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer(hsize_t), allocatable, intent(out) :: dims(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset
      integer :: status

      call inspect(file, name, dataset, error)
      if (allocated(error)) return
      dims = dataset%dims(:dataset%rank)
      call h5dclose_f(dataset%id, status)
   end subroutine get_shape

   !> Read all elements to an address, converted to a type of memory, and close the dataset.
   subroutine read_dataset_raw(file, name, dataset, type_id, address, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(in) :: dataset
      integer(hid_t), intent(in) :: type_id
      type(c_ptr), intent(in) :: address
      type(error_type), allocatable, intent(out) :: error
      integer :: status, ignored
      type(c_ptr) :: buffer

      status = 0
      buffer = address
      ! Nothing to read: HDF5 refuses an address of no elements.
      if (product(dataset%dims) > 0) call h5dread_f(dataset%id, type_id, buffer, status)
      call h5dclose_f(dataset%id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be read (damaged file?)', error)
   end subroutine read_dataset_raw

   !> Open a dataset and note its dimensions.
   subroutine inspect(file, name, dataset, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(out) :: dataset
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t) :: dims(max_rank), max_dims(max_rank)
      integer(hid_t) :: space
      integer :: status, extent

      ! Asked first: opening what is missing would be reported like damage.
      if (.not. file%exists(name)) then
         call dataset_failure(file, name, 'is missing', error)
         return
      end if
      call h5dopen_f(file%id, name, dataset%id, status)
      if (status < 0) then
         call dataset_failure(file, name, 'cannot be opened (a group, not a dataset?)', error)
         return
      end if
      call h5dget_space_f(dataset%id, space, status)
      call h5sget_simple_extent_type_f(space, extent, status)
      call h5sget_simple_extent_ndims_f(space, dataset%rank, status)
      if (status < 0 .or. extent == h5s_null_f .or. dataset%rank > max_rank) then
         call dataset_failure(file, name, 'is empty or of too high a rank', error)
         call h5dclose_f(dataset%id, status)
      else if (dataset%rank > 0) then
         call h5sget_simple_extent_dims_f(space, dims, max_dims, status)
         dataset%dims(:dataset%rank) = dims(:dataset%rank)
      end if
      call h5sclose_f(space, status)
   end subroutine inspect

   !> Refuse elements of another class, with what they are and what is expected.
   subroutine check_kind(file, name, dataset, kind, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(in) :: dataset
      integer, intent(in) :: kind
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: type_id
      integer :: class, status
      logical :: accepted

      call h5dget_type_f(dataset%id, type_id, status)
      ! Any width and order of bytes is accepted, since HDF5 converts them.
      call h5tget_class_f(type_id, class, status)
      call h5tclose_f(type_id, status)
      select case (kind)
      case (kind_real)
         accepted = class == h5t_float_f .or. class == h5t_integer_f
      case (kind_integer)
         accepted = class == h5t_integer_f
      case default
         accepted = class == h5t_string_f
      end select
      if (accepted) return
      call dataset_failure(file, name, 'holds '//class_word(class)//', expected '// &
                           trim(kind_words(kind)), error)
   end subroutine check_kind

   !> Refuse another rank, and a size that cannot be meant or is not stored.
   subroutine check_size(file, name, dataset, rank, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(in) :: dataset
      integer, intent(in) :: rank
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t) :: stored, elements
      integer :: i, status

      if (dataset%rank /= rank) then
         call dataset_failure(file, name, 'has shape '//shape_text(dataset%dims(:dataset%rank)) &
                              //', expected '//to_text(rank)//' dimensions', error)
         return
      end if
      elements = 1
      do i = 1, rank
         ! Each factor is bounded before the product, which therefore cannot overflow.
         if (dataset%dims(i) < 0 .or. dataset%dims(i) > max_elements) elements = max_elements + 1
         if (elements <= max_elements) elements = elements*dataset%dims(i)
      end do
      call h5dget_storage_size_f(dataset%id, stored, status)
      ! HDF5 1.10 calls it a failure, and sets nothing, where nothing is stored.
      if (status < 0) stored = 0
      if (elements <= max_elements) then
         if (8*elements <= large_bytes .or. 8*elements/best_compression <= stored) return
      end if
      call dataset_failure(file, name, 'has shape '//shape_text(dataset%dims(:rank))// &
                           ', more than can be read or is stored (damaged file?)', error)
   end subroutine check_size

   !> The class of elements, as h5py's users know it.
   pure function class_word(class) result(word)
      integer, intent(in) :: class
      character(:), allocatable :: word

      if (class == h5t_float_f) then
         word = 'real numbers'
      else if (class == h5t_integer_f) then
         word = 'integers'
      else if (class == h5t_string_f) then
         word = 'strings'
      else if (class == h5t_compound_f) then
         word = 'compound (such as complex) elements'
      else if (class == h5t_enum_f) then
         word = 'enumerated or logical elements'
      else
         word = 'elements of another kind'
      end if
   end function class_word

end module fw_hdf5_dataset
