!> Paths of files, and whole text files.
!>
!> What Fortran cannot ask of a system is asked through the C library of POSIX.
module fw_paths
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char, c_ptr, c_size_t, c_loc, &
      c_associated
   use fw_error, only: error_type, fatal_error, status_io
   implicit none (type, external)
   private

   public :: read_text_file, resolve_path, directory_of, stem_of, check_writable
   public :: real_path, follow_links, is_directory, is_locked, is_there, machine_name

   !> The longest path that the system takes.
   integer, parameter :: longest = 4096
   !> As many symbolic links in a row are taken for a circle.
   integer, parameter :: most_links = 40

   interface
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*), mode(*)
         type(c_ptr) :: stream
      end function c_fopen

      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: status
      end function c_fclose

      function c_fileno(stream) bind(c, name='fileno') result(descriptor)
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: stream
         integer(c_int) :: descriptor
      end function c_fileno

      function c_flock(descriptor, operation) bind(c, name='flock') result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor, operation
         integer(c_int) :: status
      end function c_flock

      function c_gethostname(buffer, size) bind(c, name='gethostname') result(status)
         import :: c_int, c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: buffer
         integer(c_size_t), value :: size
         integer(c_int) :: status
      end function c_gethostname

      function c_getcwd(buffer, size) bind(c, name='getcwd') result(pointer)
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: buffer
         integer(c_size_t), value :: size
         type(c_ptr) :: pointer
      end function c_getcwd

      function c_access(path, mode) bind(c, name='access') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
         integer(c_int) :: status
      end function c_access

      function c_realpath(path, buffer) bind(c, name='realpath') result(pointer)
         import :: c_char, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), value :: buffer
         type(c_ptr) :: pointer
      end function c_realpath

      !> The length of what stands in the buffer, without a null; -1 where it is no link.
      function c_readlink(path, buffer, size) bind(c, name='readlink') result(length)
         import :: c_char, c_ptr, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), value :: buffer
         integer(c_size_t), value :: size
         integer(c_size_t) :: length
      end function c_readlink
   end interface

contains

   !> The whole content of a text file.
   subroutine read_text_file(path, text, error)
      character(*), intent(in) :: path
      character(:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      integer :: unit, status, size
      character(256) :: reason

      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', &
            action='read', iostat=status, iomsg=reason)
      if (status == 0) then
         ! As a stream: the text keeps its ends of lines, and its length is known.
         inquire (unit=unit, size=size)
         allocate (character(max(size, 0)) :: text)
         if (size > 0) read (unit, iostat=status, iomsg=reason) text
         close (unit)
      end if
      if (status /= 0) call fatal_error(error, path//': cannot be read: '//trim(reason), status_io)
   end subroutine read_text_file

   !> A path made absolute; relative ones start at `directory` ('': the current one).
   function resolve_path(path, directory) result(resolved)
      character(*), intent(in) :: path, directory
      character(:), allocatable :: resolved

      resolved = path
      if (path(1:min(1, len(path))) == '/') return
      ! `directory` ends with its slash.
      if (len(directory) > 0) resolved = directory//path
      if (resolved(1:min(1, len(resolved))) == '/') return
      resolved = current_directory()//resolved
   end function resolve_path

   !> Everything up to the last slash, '' where there is none.
   pure function directory_of(path) result(directory)
      character(*), intent(in) :: path
      character(:), allocatable :: directory

      directory = path(:index(path, '/', back=.true.))
   end function directory_of

   !> File name without its directory and its last extension.
   pure function stem_of(path) result(stem)
      character(*), intent(in) :: path
      character(:), allocatable :: stem
      integer :: dot

      stem = path(index(path, '/', back=.true.) + 1:)
      dot = index(stem, '.', back=.true.)
      ! A name that begins with its only point has no extension.
      if (dot > 1) stem = stem(:dot - 1)
   end function stem_of

   !> Refuse a result file that could not be written, before anything is computed.
   subroutine check_writable(path, error)
      character(*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      ! F_OK and W_OK of unistd.h.
      integer(c_int), parameter :: exists = 0, writable = 2
      character(:), allocatable :: directory

      directory = directory_of(path)
      if (len(directory) == 0) directory = './'
      if (c_access(directory//c_null_char, exists) /= 0) then
         call fatal_error(error, path//': cannot be written: the directory '//directory// &
                          ' does not exist; create it or choose another file with -o', status_io)
      else if (is_directory(path)) then
         call fatal_error(error, path//': cannot be written: it is a directory; choose '// &
                          'a file with -o', status_io)
      else if (c_access(directory//c_null_char, writable) /= 0) then
         call fatal_error(error, path//': cannot be written: no permission in '//directory// &
                          '; choose another file with -o', status_io)
      end if
   end subroutine check_writable

   !> With a slash at its end; '' where the system does not tell.
   function current_directory() result(directory)
      character(:), allocatable :: directory
      character(kind=c_char), target :: buffer(longest)

      directory = ''
      if (.not. c_associated(c_getcwd(c_loc(buffer), size(buffer, kind=c_size_t)))) return
      directory = from_buffer(buffer)//'/'
   end function current_directory

   !> The one absolute name of a file without links, `.` and `..`; '' where there is none.
   function real_path(path) result(actual)
      character(*), intent(in) :: path
      character(:), allocatable :: actual
      character(kind=c_char), target :: buffer(longest + 1)

      actual = ''
      if (c_associated(c_realpath(path//c_null_char, c_loc(buffer)))) actual = from_buffer(buffer)
   end function real_path

   !> What a symbolic link points to in the end, whether that exists or not; else the path itself.
   subroutine follow_links(path, target, found)
      character(*), intent(in) :: path
      character(:), allocatable, intent(out) :: target
      !> Whether the links have an end.
      logical, intent(out) :: found
      character(kind=c_char), target :: buffer(longest + 1)
      integer(c_size_t) :: length
      integer :: i

      target = path
      do i = 0, most_links
         length = c_readlink(target//c_null_char, c_loc(buffer), int(longest, c_size_t))
         found = length < 0_c_size_t
         if (found) return
         buffer(length + 1) = c_null_char
         ! A relative link starts at the folder that holds it.
         target = resolve_path(from_buffer(buffer), directory_of(target))
      end do
   end subroutine follow_links

   !> Whether somebody, this process included, holds a lock (flock) on a file.
   logical function is_locked(path)
      character(*), intent(in) :: path
      ! LOCK_EX and LOCK_NB of sys/file.h.
      integer(c_int), parameter :: exclusive_without_waiting = 6
      type(c_ptr) :: stream
      integer(c_int) :: status

      is_locked = .false.
      stream = c_fopen(path//c_null_char, 'r'//c_null_char)
      if (.not. c_associated(stream)) return
      ! A lock that is obtained goes with the stream at once.
      is_locked = c_flock(c_fileno(stream), exclusive_without_waiting) /= 0
      status = c_fclose(stream)
   end function is_locked

   !> '' where the system does not tell.
   !> The name of the machine, for the record of a run.
   function machine_name() result(name)
      character(:), allocatable :: name
      character(kind=c_char), target :: buffer(longest)

      name = ''
      buffer = c_null_char
      if (c_gethostname(c_loc(buffer), size(buffer, kind=c_size_t)) == 0) then
         name = from_buffer(buffer)
      end if
   end function machine_name

   !> Through its own entry `.`, which only a folder has.
   logical function is_directory(path)
      character(*), intent(in) :: path
      integer(c_int), parameter :: exists = 0

      is_directory = c_access(path//'/.'//c_null_char, exists) == 0
   end function is_directory

   !> Whether there is a file of a name: what an `inquire` tells, in a tenth of its time.
   logical function is_there(path)
      character(*), intent(in) :: path
      integer(c_int), parameter :: exists = 0

      is_there = c_access(path//c_null_char, exists) == 0
   end function is_there

   !> What stands before the null.
   pure function from_buffer(buffer) result(text)
      character(kind=c_char), intent(in) :: buffer(:)
      character(:), allocatable :: text
      integer :: i, length

      length = findloc(buffer, c_null_char, 1) - 1
      if (length < 0) length = size(buffer)
      allocate (character(length) :: text)
      do i = 1, length
         text(i:i) = buffer(i)
      end do
   end function from_buffer

end module fw_paths
