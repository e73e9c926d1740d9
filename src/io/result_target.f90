!> Where a result file may be written: never over anything but an earlier result. Whatever else
!> bears the name, an input of the run above all, is refused.
module fw_result_target
   use, intrinsic :: iso_c_binding, only: c_null_char
   use fw_error, only: error_type, fatal_error, status_input, status_io
   use fw_hdf5, only: has_attribute, hdf5_file, read_attribute
   use fw_kinds, only: i8
   use fw_paths, only: check_writable, follow_links, is_directory, real_path
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: find_target, check_replaceable, is_result, result_format

   !> Attribute `format` of every result file.
   character(*), parameter :: result_format = 'fretwear-result'

   character(*), parameter :: remedy = 'choose another file with -o or &output file'

contains

   !> The file that a result of this name is to become; refuse what must not be written.
   subroutine find_target(path, target, error, inputs)
      character(*), intent(in) :: path
      !> `path` itself, or what it points to where it is a symbolic link.
      character(:), allocatable, intent(out) :: target
      !> status_input for a file that the run reads, else status_io.
      type(error_type), allocatable, intent(out) :: error
      !> Paths of the files that the run reads.
      type(string_type), intent(in), optional :: inputs(:)
      logical :: found

      target = path
      ! HDF5 and Fortran drop blanks at the end of a name, C ends it at a null: another file.
      if (len_trim(path) == 0 .or. len_trim(path) < len(path) &
          .or. index(path, c_null_char) > 0) then
         call fatal_error(error, "'"//path//"': cannot be written: the name of a file must "// &
                          'neither end in a blank nor hold a null; '//remedy, status_io)
         return
      end if
      call follow_links(path, target, found)
      if (.not. found) then
         call fatal_error(error, path//': cannot be written: its symbolic links lead in a '// &
                          'circle; '//remedy, status_io)
         return
      end if
      if (present(inputs)) call refuse_inputs(path, target, inputs, error)
      if (.not. allocated(error)) call check_writable(target, error)
      if (.not. allocated(error)) call check_replaceable(target, error)
   end subroutine find_target

   !> Refuse to replace anything but a result file.
   subroutine check_replaceable(path, error)
      character(*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file
      integer(i8) :: length
      logical :: found

      inquire (file=path, exist=found, size=length)
      if (.not. found) return
      if (is_directory(path)) then
         call fatal_error(error, path//': cannot be written: it is a directory; '//remedy, &
                          status_io)
         return
      end if
      ! Devices, pipes and sockets have no length either, and opening one could wait for ever.
      if (length <= 0) then
         call fatal_error(error, path//': cannot be written: it is no regular file, or an '// &
                          'empty one: only an earlier result is replaced; '//remedy, status_io)
         return
      end if
      call file%open_read(path, ignored)
      found = .false.
      if (.not. allocated(ignored)) then
         found = is_result(file)
         call file%close(ignored)
      end if
      if (found) return
      call fatal_error(error, path//': cannot be written: it exists and is no sound result '// &
                       'file, or one that is open for writing: only an earlier result is '// &
                       'replaced; remove it, or '//remedy, status_io)
   end subroutine check_replaceable

   !> Whether an open file says that it is a result.
   logical function is_result(file)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable :: ignored
      character(:), allocatable :: format

      is_result = .false.
      if (.not. has_attribute(file, '/', 'format')) return
      call read_attribute(file, '/', 'format', format, ignored)
      if (allocated(format)) is_result = format == result_format
   end function is_result

   !> Refuse a file that the run reads, under whatever name.
   subroutine refuse_inputs(path, target, inputs, error)
      character(*), intent(in) :: path, target
      type(string_type), intent(in) :: inputs(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: actual
      integer :: i

      actual = real_path(target)
      if (len(actual) == 0) return
      do i = 1, size(inputs)
         if (real_path(inputs(i)%text) /= actual) cycle
         call fatal_error(error, path//': cannot be written: it is '//inputs(i)%text// &
                          ', which this run reads; '//remedy, status_input)
         return
      end do
   end subroutine refuse_inputs

end module fw_result_target
