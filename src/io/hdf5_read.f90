!> Reading datasets of real numbers and of integers: lists and matrices, or of any rank as flat
!> arrays with their extents. Files come from others: type, rank and size are
!> checked before anything is allocated (fw_hdf5_dataset), and arrays have the reversed order of
!> dimensions.
module fw_hdf5_read
   use, intrinsic :: iso_c_binding, only: c_loc
   use fw_error, only: error_type
   use fw_hdf5_dataset, only: dataset_type, open_dataset, read_dataset_raw, kind_real, kind_integer
   use fw_hdf5_file, only: hdf5_file, dataset_failure
   use fw_kinds, only: wp, i8
   use hdf5, only: h5kind_to_type, h5_real_kind, h5_integer_kind
   implicit none (type, external)
   private

   public :: read_dataset

   !> `call read_dataset(file, name, values, error)`: values of any real or integer type in the
   !> file are converted; the rank must agree; integers that do not fit are an error. With a rank
   !> and extents, `call read_dataset(file, name, rank, dims, values, error)`, values are flat.
   interface read_dataset
      module procedure read_real_1
      module procedure read_real_2
      module procedure read_integer_1
      module procedure read_flat_real
      module procedure read_flat_integer
   end interface read_dataset

contains

   !> Allocated only without an error in type, rank and size.
   subroutine read_real_1(file, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset

      call open_dataset(file, name, kind_real, 1, dataset, error)
      if (allocated(error)) return
      allocate (values(dataset%dims(1)))
      call fill_real(file, name, dataset, size(values), values, error)
   end subroutine read_real_1

   !> Rank 2 as rank 1, with the dimensions in the order of Fortran.
   subroutine read_real_2(file, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      real(wp), allocatable, intent(out) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset

      call open_dataset(file, name, kind_real, 2, dataset, error)
      if (allocated(error)) return
      allocate (values(dataset%dims(1), dataset%dims(2)))
      call fill_real(file, name, dataset, size(values), values, error)
   end subroutine read_real_2

   !> Integers as reals; see fill_integer for their range.
   subroutine read_integer_1(file, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset

      call open_dataset(file, name, kind_integer, 1, dataset, error)
      if (allocated(error)) return
      allocate (values(dataset%dims(1)))
      call fill_integer(file, name, dataset, size(values), values, error)
   end subroutine read_integer_1

   !> All elements one behind the other, with the extents in the order of Fortran.
   subroutine read_flat_real(file, name, rank, dims, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: rank
      integer, allocatable, intent(out) :: dims(:)
      !> What it holds is given back first; null with an error.
      real(wp), pointer, intent(inout) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset

      if (associated(values)) deallocate (values)
      call open_dataset(file, name, kind_real, rank, dataset, error)
      if (allocated(error)) return
      dims = int(dataset%dims(:rank))
      allocate (values(product(dims)))
      call fill_real(file, name, dataset, size(values), values, error)
   end subroutine read_flat_real

   subroutine read_flat_integer(file, name, rank, dims, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: rank
      integer, allocatable, intent(out) :: dims(:), values(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset

      call open_dataset(file, name, kind_integer, rank, dataset, error)
      if (allocated(error)) return
      dims = int(dataset%dims(:rank))
      allocate (values(product(dims)))
      call fill_integer(file, name, dataset, size(values), values, error)
   end subroutine read_flat_integer

   !> Fill an array of any rank, passed by its first element, and close the dataset.
   subroutine fill_real(file, name, dataset, n, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(in) :: dataset
      !> All elements, whatever the rank.
      integer, intent(in) :: n
      real(wp), intent(out), target :: values(n)
      type(error_type), allocatable, intent(out) :: error

      call read_dataset_raw(file, name, dataset, h5kind_to_type(wp, h5_real_kind), &
                            c_loc(values), error)
   end subroutine fill_real

   !> As fill_real. Read as 64 bits, because HDF5 clips silently what does not fit.
   subroutine fill_integer(file, name, dataset, n, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(dataset_type), intent(in) :: dataset
      integer, intent(in) :: n
      integer, intent(out) :: values(n)
      type(error_type), allocatable, intent(out) :: error
      integer(i8), allocatable, target :: wide(:)

      ! Half a file of garbage must not be read as numbers: they start as 0.
      allocate (wide(n), source=0_i8)
      call read_dataset_raw(file, name, dataset, h5kind_to_type(i8, h5_integer_kind), &
                            c_loc(wide), error)
      if (allocated(error)) return
      if (any(wide > huge(0) .or. wide < -huge(0))) then
         call dataset_failure(file, name, 'holds an integer that does not fit 32 bits', error)
         return
      end if
      values = int(wide)
   end subroutine fill_integer

end module fw_hdf5_read
