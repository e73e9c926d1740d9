!> Datasets of strings, rank 0 and 1.
!>
!> Read are all kinds of strings that fw_hdf5_string knows, written those of variable length.
module fw_hdf5_text
   use fw_error, only: error_type
   use fw_hdf5_dataset, only: dataset_type, open_dataset, kind_string
   use fw_hdf5_file, only: hdf5_file, dataset_failure
   use fw_hdf5_string, only: get_strings, put_strings, new_string_type
   use fw_hdf5_write, only: new_dataset, new_space
   use fw_text, only: string_type
   use hdf5, only: hid_t, h5dclose_f, h5sclose_f, h5tclose_f
   implicit none (type, external)
   private

   public :: read_text, write_text

   !> `call read_text(file, name, texts, error)`.
   interface read_text
      module procedure read_text_0
      module procedure read_text_1
   end interface read_text

   !> `call write_text(file, name, texts, error)`.
   interface write_text
      module procedure write_text_0
      module procedure write_text_1
   end interface write_text

contains

   !> A scalar; not allocated with an error.
   subroutine read_text_0(file, name, text, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      character(:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: strings(:)

      call read_strings(file, name, 0, strings, error)
      if (.not. allocated(error)) call move_alloc(strings(1)%text, text)
   end subroutine read_text_0

   !> A list, one dimension long.
   subroutine read_text_1(file, name, texts, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(string_type), allocatable, intent(out) :: texts(:)
      type(error_type), allocatable, intent(out) :: error

      call read_strings(file, name, 1, texts, error)
   end subroutine read_text_1

   subroutine write_text_0(file, name, text, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name, text
      type(error_type), allocatable, intent(out) :: error
      type(string_type) :: strings(1)

      ! Not by a structure constructor, whose text gfortran 12 does not free.
      strings(1)%text = text
      call write_strings(file, name, [integer ::], strings, error)
   end subroutine write_text_0

   subroutine write_text_1(file, name, texts, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(string_type), intent(in) :: texts(:)
      type(error_type), allocatable, intent(out) :: error

      call write_strings(file, name, shape(texts), texts, error)
   end subroutine write_text_1

   !> All strings of a dataset of a rank, in the order of the file.
   subroutine read_strings(file, name, rank, strings, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: rank
      type(string_type), allocatable, intent(out) :: strings(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset
      integer :: status, ignored

      call open_dataset(file, name, kind_string, rank, dataset, error)
      if (allocated(error)) return
      call get_strings(dataset%id, .false., int(product(dataset%dims)), strings, status)
      call h5dclose_f(dataset%id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be read (damaged file?)', error)
   end subroutine read_strings

   !> A dataset and the groups above it; no dimensions make a scalar.
   subroutine write_strings(file, name, dims, strings, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: dims(:)
      type(string_type), intent(in) :: strings(:)
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: type_id, space, id
      integer :: status, ignored

      type_id = new_string_type()
      space = new_space(dims)
      call new_dataset(file, name, type_id, space, id, error)
      call h5sclose_f(space, ignored)
      status = 0
      ! An empty list is a dataset all the same.
      if (size(strings) > 0 .and. .not. allocated(error)) then
         call put_strings(id, type_id, .false., strings, status)
      end if
      call h5tclose_f(type_id, ignored)
      if (allocated(error)) return
      call h5dclose_f(id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be written (disk full?)', error)
   end subroutine write_strings

end module fw_hdf5_text
