!> Datasets that are lists of strings.
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

contains

   !> All strings of a list, in the order of the file.
   subroutine read_text(file, name, texts, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(string_type), allocatable, intent(out) :: texts(:)
      type(error_type), allocatable, intent(out) :: error
      type(dataset_type) :: dataset
      integer :: status, ignored

      call open_dataset(file, name, kind_string, 1, dataset, error)
      if (allocated(error)) return
      call get_strings(dataset%id, .false., int(product(dataset%dims)), texts, status)
      call h5dclose_f(dataset%id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be read (damaged file?)', error)
   end subroutine read_text

   !> A list, and the groups above it.
   subroutine write_text(file, name, texts, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      type(string_type), intent(in) :: texts(:)
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: type_id, space, id
      integer :: status, ignored

      type_id = new_string_type()
      space = new_space(shape(texts))
      call new_dataset(file, name, type_id, space, id, error)
      call h5sclose_f(space, ignored)
      status = 0
      ! An empty list is a dataset all the same.
      if (size(texts) > 0 .and. .not. allocated(error)) then
         call put_strings(id, type_id, .false., texts, status)
      end if
      call h5tclose_f(type_id, ignored)
      if (allocated(error)) return
      call h5dclose_f(id, ignored)
      if (status < 0) call dataset_failure(file, name, 'cannot be written (disk full?)', error)
   end subroutine write_text

end module fw_hdf5_text
