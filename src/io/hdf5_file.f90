!> HDF5 files and the inspection of what they hold, with errors as values.
!>
!> Shapes are written in messages as h5py shows them; the arrays of the library carry the same
!> dimensions in reversed order, because HDF5 counts the slowest dimension first.
!> HDF5 itself is not thread-safe here: one thread at a time may use this layer.
module fw_hdf5_file
   use, intrinsic :: iso_c_binding, only: c_int8_t, c_loc, c_null_ptr, c_ptr
   use fw_error, only: error_type, fatal_error, status_input, status_io
   use hdf5, only: h5dont_atexit_f, hid_t, hsize_t, size_t, h5open_f, h5eset_auto_f, &
      h5iis_valid_f, h5fopen_f, h5fcreate_f, h5fclose_f, h5fflush_f, h5fis_hdf5_f, &
      h5fget_file_image_f, h5f_acc_rdonly_f, h5f_acc_excl_f, h5f_acc_trunc_f, h5f_scope_local_f, &
      h5p_file_access_f, h5pclose_f, h5pcreate_f, h5pset_fapl_core_f, h5lexists_f, &
      h5oexists_by_name_f, h5t_native_double
   implicit none (type, external)
   private

   public :: hdf5_file, dataset_failure, shape_text

   !> Files in memory grow by so much [bytes].
   integer(size_t), parameter :: memory_step = 262144_size_t
   !> So many files in memory are told apart, under names that no file can have.
   integer, parameter :: most_in_memory = 100000
   character(*), parameter :: memory_name = '/dev/null/fretwear.'

   !> An open file. A copy shares the handle: pass it along, never store two.
   type :: hdf5_file
      !> Negative where no file is open.
      integer(hid_t) :: id = -1_hid_t
      character(:), allocatable :: path
      !> Exit status of a failed access: what is read is input, what is written is output.
      integer :: status = status_input
   contains
      procedure :: open_read
      procedure :: create
      procedure :: create_in_memory
      procedure :: image
      procedure :: flush
      procedure :: close
      procedure :: exists
   end type hdf5_file

contains

   !> Open an existing file for reading.
   subroutine open_read(self, path, error)
      class(hdf5_file), intent(out) :: self
      character(*), intent(in) :: path
      !> status_io where the file cannot be read, status_input where it is no sound HDF5 file.
      type(error_type), allocatable, intent(out) :: error
      logical :: found
      integer :: status

      self%path = path
      call start_library()
      inquire (file=path, exist=found)
      if (.not. found) then
         call fatal_error(error, path//': no such file', status_io)
         return
      end if
      ! Three failures apart: no access, no HDF5, and HDF5 that is damaged.
      call h5fis_hdf5_f(path, found, status)
      if (status < 0) then
         call fatal_error(error, path//': cannot be read (a folder, or not permitted?)', status_io)
      else if (.not. found) then
         call fatal_error(error, path//': is not an HDF5 file, must be one', status_input)
      end if
      if (allocated(error)) return
      call h5fopen_f(path, h5f_acc_rdonly_f, self%id, status)
      if (status >= 0) return
      self%id = -1_hid_t
      call fatal_error(error, path//': the HDF5 file is truncated, damaged or still being '// &
                       'written; expected a complete file', status_input)
   end subroutine open_read

   !> Create a file for writing.
   subroutine create(self, path, error, exclusive)
      class(hdf5_file), intent(out) :: self
      character(*), intent(in) :: path
      !> status_io where the file cannot be created.
      type(error_type), allocatable, intent(out) :: error
      !> Fail where the file exists already (default: replace it).
      logical, intent(in), optional :: exclusive
      integer :: status, access_flag

      self%path = path
      self%status = status_io
      call start_library()
      access_flag = h5f_acc_trunc_f
      if (present(exclusive)) access_flag = merge(h5f_acc_excl_f, h5f_acc_trunc_f, exclusive)
      call h5fcreate_f(path, access_flag, self%id, status)
      if (status >= 0) return
      self%id = -1_hid_t
      call fatal_error(error, path//': cannot be created (does the folder exist, is it '// &
                       'writable, is the file in use?)', status_io)
   end subroutine create

   !> Create a file that lives in memory only, and is gone when it is closed.
   subroutine create_in_memory(self, error)
      class(hdf5_file), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      character(12) :: number
      integer(hid_t) :: access
      integer :: i, ignored, status

      self%status = status_io
      call start_library()
      call h5pcreate_f(h5p_file_access_f, access, status)
      if (status >= 0) then
         call h5pset_fapl_core_f(access, memory_step, .false., status)
         ! HDF5 takes two open files of one name for one file, and refuses the second.
         do i = 1, most_in_memory
            if (status < 0) exit
            write (number, '(i0)') i
            self%path = memory_name//trim(number)
            call h5fcreate_f(self%path, h5f_acc_trunc_f, self%id, status, access_prp=access)
            if (status >= 0) exit
            status = 0
            self%id = -1_hid_t
         end do
         call h5pclose_f(access, ignored)
      end if
      if (self%id < 0) call fatal_error(error, 'no memory for a result file in memory', status_io)
   end subroutine create_in_memory

   !> The bytes that the file would have on a disk.
   subroutine image(self, bytes, error)
      class(hdf5_file), intent(in) :: self
      !> What a file on a disk would hold, byte by byte.
      integer(c_int8_t), allocatable, target, intent(out) :: bytes(:)
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: address
      integer(size_t) :: n
      integer :: problem, status

      call self%flush(error)
      if (allocated(error)) return
      n = 0_size_t
      address = c_null_ptr
      ! First the size, then the bytes.
      call h5fget_file_image_f(self%id, address, 0_size_t, status, n)
      problem = 0
      if (status >= 0) allocate (bytes(n), stat=problem)
      if (status >= 0 .and. problem == 0) then
         address = c_loc(bytes)
         call h5fget_file_image_f(self%id, address, n, status)
      end if
      if (status < 0 .or. problem /= 0) then
         call fatal_error(error, 'no memory for a copy of a result file in memory', status_io)
      end if
   end subroutine image

   !> Hand everything written so far to the operating system.
   subroutine flush(self, error)
      class(hdf5_file), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      call h5fflush_f(self%id, h5f_scope_local_f, status)
      if (status < 0) call fatal_error(error, self%path//': writing failed (disk full?)', status_io)
   end subroutine flush

   !> Close the file; harmless where it is not open.
   subroutine close(self, error)
      class(hdf5_file), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      if (self%id < 0) return
      call h5fclose_f(self%id, status)
      ! Also after a failure: HDF5 does not take a second attempt.
      self%id = -1_hid_t
      if (status < 0) call fatal_error(error, self%path//': closing failed (disk full?)', status_io)
   end subroutine close

   !> Is there an object of this absolute name, such as '/contact/mu'?
   logical function exists(self, name)
      class(hdf5_file), intent(in) :: self
      character(*), intent(in) :: name
      integer :: i, status

      ! HDF5 answers for the last link only, so every group on the way is asked for first.
      exists = .true.
      do i = 2, len(name)
         if (name(i:i) /= '/') cycle
         call h5lexists_f(self%id, name(:i - 1), exists, status)
         exists = exists .and. status >= 0
         if (.not. exists) return
      end do
      if (name == '/') return
      call h5lexists_f(self%id, name, exists, status)
      exists = exists .and. status >= 0
      if (.not. exists) return
      call h5oexists_by_name_f(self%id, name, exists, status)
      exists = exists .and. status >= 0
   end function exists

   !> Raise an error about a dataset: `text` continues "<file>: dataset <name> ".
   subroutine dataset_failure(file, name, text, error)
      class(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name, text
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, file%path//': dataset '//name//' '//text, file%status)
   end subroutine dataset_failure

   !> A shape as h5py shows it, from the dimensions in the order of Fortran.
   pure function shape_text(dims) result(text)
      integer(hsize_t), intent(in) :: dims(:)
      character(:), allocatable :: text
      character(24) :: number
      integer :: i

      text = '('
      do i = size(dims), 1, -1
         write (number, '(i0)') dims(i)
         text = text//trim(number)
         if (i > 1) text = text//', '
      end do
      if (size(dims) == 1) text = text//','
      text = text//')'
   end function shape_text

   !> Start HDF5 once and switch off its own printing of errors.
   subroutine start_library()
      logical :: started
      integer :: status

      ! Every file is closed here. What HDF5 would do at the end of the program crashes where a file
      ! could not be closed because the disk is full. It has to be told before its first call.
      call h5dont_atexit_f(status)
      ! The predefined types are valid handles if and only if the library runs; starting it a
      ! second time would leak a set of them.
      call h5iis_valid_f(h5t_native_double, started, status)
      if (status < 0 .or. .not. started) call h5open_f(status)
      call h5eset_auto_f(0, status)
   end subroutine start_library

end module fw_hdf5_file
