!> Strings of HDF5, in datasets and attributes: variable length or fixed, UTF-8 or ASCII, as
!> h5py and MATLAB write them. Written are variable-length UTF-8 strings, which h5py shows as str.
!>
!> Datasets and attributes have the same strings behind different routines of HDF5: `is_attribute`
!> says which. All procedures leave closing what they were given to the caller.
module fw_hdf5_string
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_loc, c_null_char, &
      c_ptr, c_size_t
   use fw_text, only: string_type
   use hdf5, only: hid_t, hsize_t, size_t, h5aread_f, h5awrite_f, h5aget_type_f, h5dread_f, &
      h5dwrite_f, h5dget_type_f, h5dvlen_reclaim_f, h5pclose_f, h5pcreate_f, h5pset_buffer_f, &
      h5p_dataset_xfer_f, h5p_default_f, h5screate_simple_f, h5sclose_f, h5tclose_f, h5tcopy_f, &
      h5tget_cset_f, h5tget_size_f, h5tget_strpad_f, h5tis_variable_str_f, h5tset_cset_f, &
      h5t_cset_utf8_f, h5t_str_spacepad_f, h5t_string
   implicit none (type, external)
   private

   public :: get_strings, put_strings, new_string_type

   !> A longer fixed length is damage, not a name.
   integer(size_t), parameter :: max_length = 2_size_t**24
   !> Room for the addresses of texts on their way into a file [bytes].
   integer(hsize_t), parameter :: text_buffer = 4096_hsize_t

   interface
      pure function c_strlen(text) bind(c, name='strlen') result(n)
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), intent(in), value :: text
         integer(c_size_t) :: n
      end function c_strlen
   end interface

contains

   !> The type of variable-length UTF-8 strings; the caller closes it.
   integer(hid_t) function new_string_type() result(type_id)
      integer :: status

      call h5tcopy_f(h5t_string, type_id, status)
      call h5tset_cset_f(type_id, h5t_cset_utf8_f, status)
   end function new_string_type

   !> Read the n strings of an open dataset or attribute; status < 0 on failure.
   subroutine get_strings(id, is_attribute, n, strings, status)
      integer(hid_t), intent(in) :: id
      logical, intent(in) :: is_attribute
      integer, intent(in) :: n
      type(string_type), allocatable, intent(out) :: strings(:)
      integer, intent(out) :: status
      integer(hid_t) :: file_type
      logical :: variable
      integer :: ignored

      allocate (strings(n))
      status = 0
      ! HDF5 would read nothing from an address of nothing.
      if (n == 0) return
      if (is_attribute) then
         call h5aget_type_f(id, file_type, status)
      else
         call h5dget_type_f(id, file_type, status)
      end if
      call h5tis_variable_str_f(file_type, variable, status)
      if (variable) then
         call get_variable(id, is_attribute, file_type, strings, status)
      else
         call get_fixed(id, is_attribute, file_type, strings, status)
      end if
      call h5tclose_f(file_type, ignored)
   end subroutine get_strings

   !> Strings of variable length: HDF5 gives addresses of memory that it has allocated.
   subroutine get_variable(id, is_attribute, file_type, strings, status)
      integer(hid_t), intent(in) :: id, file_type
      logical, intent(in) :: is_attribute
      type(string_type), intent(inout) :: strings(:)
      integer, intent(out) :: status
      type(c_ptr), target :: texts(size(strings))
      type(c_ptr) :: buffer
      integer(hid_t) :: memory_type, space
      integer :: i, character_set, ignored

      ! HDF5 refuses to convert between ASCII and UTF-8: memory takes what the file has.
      call h5tcopy_f(h5t_string, memory_type, status)
      call h5tget_cset_f(file_type, character_set, status)
      call h5tset_cset_f(memory_type, character_set, status)
      call get_raw(id, is_attribute, memory_type, c_loc(texts), status)
      if (status >= 0) then
         do i = 1, size(strings)
            strings(i)%text = text_at(texts(i))
         end do
         ! Given back to HDF5, or it would leak with every file.
         call h5screate_simple_f(1, [size(strings, kind=hsize_t)], space, ignored)
         buffer = c_loc(texts)
         call h5dvlen_reclaim_f(memory_type, space, h5p_default_f, buffer, ignored)
         call h5sclose_f(space, ignored)
      end if
      call h5tclose_f(memory_type, ignored)
   end subroutine get_variable

   !> Strings of one fixed length, padded by nulls or blanks.
   subroutine get_fixed(id, is_attribute, file_type, strings, status)
      integer(hid_t), intent(in) :: id, file_type
      logical, intent(in) :: is_attribute
      type(string_type), intent(inout) :: strings(:)
      integer, intent(out) :: status
      character(kind=c_char), allocatable, target :: buffer(:, :)
      integer(size_t) :: length
      integer :: i, padding

      call h5tget_size_f(file_type, length, status)
      ! Before the buffer is allocated.
      if (length < 1 .or. length > max_length) status = -1
      if (status < 0) return
      call h5tget_strpad_f(file_type, padding, status)
      allocate (buffer(length, size(strings)), source=c_null_char)
      call get_raw(id, is_attribute, file_type, c_loc(buffer), status)
      if (status < 0) return
      do i = 1, size(strings)
         strings(i)%text = unpadded(buffer(:, i), padding == h5t_str_spacepad_f)
      end do
   end subroutine get_fixed

   !> Write strings to an open dataset or attribute whose type is that of new_string_type.
   subroutine put_strings(id, type_id, is_attribute, strings, status)
      !> The dataset or attribute, and the type.
      integer(hid_t), intent(in) :: id, type_id
      logical, intent(in) :: is_attribute
      type(string_type), intent(in) :: strings(:)
      integer, intent(out) :: status
      character(kind=c_char), allocatable, target :: buffer(:)
      type(c_ptr), target :: texts(size(strings))
      integer(hid_t) :: transfer_list
      integer :: i, j, at, ignored

      ! All strings in one buffer, each with its null, and addresses into it.
      allocate (buffer(sum([(len(strings(i)%text) + 1, i=1, size(strings))])))
      at = 1
      do i = 1, size(strings)
         texts(i) = c_loc(buffer(at))
         do j = 1, len(strings(i)%text)
            buffer(at + j - 1) = strings(i)%text(j:j)
         end do
         at = at + len(strings(i)%text) + 1
         buffer(at - 1) = c_null_char
      end do
      if (is_attribute) then
         call h5awrite_f(id, type_id, c_loc(texts), status)
      else
         ! HDF5 would clear a megabyte for the addresses of a few texts.
         call h5pcreate_f(h5p_dataset_xfer_f, transfer_list, ignored)
         call h5pset_buffer_f(transfer_list, text_buffer, ignored)
         call h5dwrite_f(id, type_id, c_loc(texts), status, xfer_prp=transfer_list)
         call h5pclose_f(transfer_list, ignored)
      end if
   end subroutine put_strings

   !> Read to an address with a type of memory.
   subroutine get_raw(id, is_attribute, memory_type, address, status)
      integer(hid_t), intent(in) :: id, memory_type
      logical, intent(in) :: is_attribute
      type(c_ptr), intent(in) :: address
      integer, intent(out) :: status
      type(c_ptr) :: buffer

      buffer = address
      if (is_attribute) then
         call h5aread_f(id, memory_type, buffer, status)
      else
         call h5dread_f(id, memory_type, buffer, status)
      end if
   end subroutine get_raw

   !> The text of C at an address; empty strings may have none.
   function text_at(address) result(text)
      type(c_ptr), intent(in) :: address
      character(:), allocatable :: text
      character(kind=c_char), pointer :: letters(:)

      text = ''
      if (.not. c_associated(address)) return
      call c_f_pointer(address, letters, [c_strlen(address)])
      text = unpadded(letters, .false.)
   end function text_at

   !> Letters up to the first null, without trailing blanks where blanks are padding.
   pure function unpadded(letters, blanks) result(text)
      character(kind=c_char), intent(in) :: letters(:)
      logical, intent(in) :: blanks
      character(:), allocatable :: text
      integer :: i, n

      n = findloc(letters, c_null_char, dim=1) - 1
      ! No null: the letters fill the fixed length.
      if (n < 0) n = size(letters)
      allocate (character(n) :: text)
      do i = 1, n
         text(i:i) = letters(i)
      end do
      if (blanks) text = trim(text)
   end function unpadded

end module fw_hdf5_string
