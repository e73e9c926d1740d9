!> Writing datasets of real numbers and of integers, of any rank.
!>
!> A dataset is written once and whole; what grows point by point is fw_hdf5_append's.
module fw_hdf5_write
   use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
   use fw_error, only: error_type
   use fw_hdf5_file, only: hdf5_file, dataset_failure
   use fw_kinds, only: wp
   use hdf5, only: hid_t, hsize_t, h5dcreate_f, h5dwrite_f, h5dclose_f, h5screate_f, &
      h5screate_simple_f, h5sclose_f, h5s_scalar_f, h5pcreate_f, h5pclose_f, &
      h5pset_create_inter_group_f, h5p_default_f, h5p_link_create_f, h5kind_to_type, h5_real_kind, &
      h5_integer_kind
   implicit none (type, external)
   private

   public :: write_dataset, new_dataset, new_space

   !> `call write_dataset(file, name, values, error)`: h5py shows the dimensions of `values`
   !> in reversed order. Groups on the way are created.
   interface write_dataset
      module procedure write_real
      module procedure write_integer
   end interface write_dataset

contains

   !> Create a dataset and the groups above it.
   subroutine new_dataset(file, name, type_id, space, id, error, creation, access)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer(hid_t), intent(in) :: type_id, space
      !> The caller closes it, and the space.
      integer(hid_t), intent(out) :: id
      type(error_type), allocatable, intent(out) :: error
      !> Dataset creation property list (chunks, fill value).
      integer(hid_t), intent(in), optional :: creation
      !> Dataset access property list (cache).
      integer(hid_t), intent(in), optional :: access
      integer(hid_t) :: links, properties, access_properties
      integer :: status, ignored

      properties = h5p_default_f
      if (present(creation)) properties = creation
      access_properties = h5p_default_f
      if (present(access)) access_properties = access
      call h5pcreate_f(h5p_link_create_f, links, status)
      ! Groups on the way come by themselves.
      call h5pset_create_inter_group_f(links, 1, status)
      call h5dcreate_f(file%id, name, type_id, space, id, status, properties, links, &
                       access_properties)
      call h5pclose_f(links, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be created (name taken, or disk '// &
                                           'full?)', error)
   end subroutine new_dataset

   !> A dataspace; no dimensions make a scalar.
   integer(hid_t) function new_space(dims) result(space)
      integer, intent(in) :: dims(:)
      integer :: status

      if (size(dims) == 0) then
         call h5screate_f(h5s_scalar_f, space, status)
      else
         ! An extent below 0 is one of nothing: HDF5 takes it for one of 2**64 and prints a stack.
         call h5screate_simple_f(size(dims), int(max(0, dims), hsize_t), space, status)
      end if
   end function new_space

   !> Create a dataset and write all its elements from an address.
   subroutine write_dataset_raw(file, name, dims, type_id, address, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      !> In the order of Fortran, empty for a scalar.
      integer, intent(in) :: dims(:)
      integer(hid_t), intent(in) :: type_id
      type(c_ptr), intent(in) :: address
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: space, id
      integer :: status, ignored

      space = new_space(dims)
      call new_dataset(file, name, type_id, space, id, error)
      call h5sclose_f(space, status)
      if (allocated(error)) return
      if (product(dims) > 0) call h5dwrite_f(id, type_id, address, status)
      call h5dclose_f(id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be written (disk full?)', error)
   end subroutine write_dataset_raw

   !> Elements in their order in memory.
   subroutine write_real(file, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      real(wp), intent(in), contiguous, target :: values(..)
      type(error_type), allocatable, intent(out) :: error

      call write_dataset_raw(file, name, shape(values), h5kind_to_type(wp, h5_real_kind), &
                             c_loc(values), error)
   end subroutine write_real

   !> As write_real; 32 bits in the file too.
   subroutine write_integer(file, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in), contiguous, target :: values(..)
      type(error_type), allocatable, intent(out) :: error

      call write_dataset_raw(file, name, shape(values), h5kind_to_type(kind(0), h5_integer_kind), &
                             c_loc(values), error)
   end subroutine write_integer

end module fw_hdf5_write
