!> Files that appear under their name only when they are complete: written as '<name>.part' and
!> renamed. An occupied '.part' (another run at work, or the remains of a killed one) is never
!> touched: the next free of '<name>.part.<process>', '<name>.part.<process>.2', ... is taken.
module fw_result_part
   use, intrinsic :: iso_c_binding, only: c_char
   use, intrinsic :: iso_c_binding, only: c_int
   use, intrinsic :: iso_c_binding, only: c_null_char
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_io
   use fw_hdf5, only: hdf5_file
   use fw_result_target, only: check_replaceable
   use fw_result_target, only: find_target
   use fw_text, only: string_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: create_part, publish_part, delete_part

   !> One process rarely writes the same result more often than this at a time.
   integer, parameter :: most_tries = 100

   interface
      function c_rename(old, new) bind(c, name='rename') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: old(*), new(*)
         integer(c_int) :: status
      end function c_rename

      function c_unlink(path) bind(c, name='unlink') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int) :: status
      end function c_unlink

      function c_getpid() bind(c, name='getpid') result(process)
         import :: c_int
         implicit none (type, external)
         integer(c_int) :: process
      end function c_getpid
   end interface

contains

   !> Create the temporary file that will become `path`, or what `path` links to.
   subroutine create_part(path, target, file, error, inputs)
      character(*), intent(in) :: path
      !> The name to publish under.
      character(:), allocatable, intent(out) :: target
      type(hdf5_file), intent(out) :: file
      !> status_input where `path` is one of the inputs; status_io where the folder does not
      !> exist or is not writable, or where the name belongs to anything but an earlier result.
      type(error_type), allocatable, intent(out) :: error
      !> Paths of the files that the run reads.
      type(string_type), intent(in), optional :: inputs(:)
      character(:), allocatable :: part
      logical :: occupied
      integer :: i

      call find_target(path, target, error, inputs)
      if (allocated(error)) return
      do i = 0, most_tries
         part = target//'.part'
         if (i > 0) part = part//'.'//to_text(int(c_getpid()))
         if (i > 1) part = part//'.'//to_text(i)
         inquire (file=part, exist=occupied)
         if (occupied) cycle
         ! Exclusive: of two runs that find the name free only one gets it.
         call file%create(part, error, exclusive=.true.)
         if (.not. allocated(error)) return
         inquire (file=part, exist=occupied)
         if (.not. occupied) return
      end do
      call fatal_error(error, path//': cannot be written: every name like '//part// &
                       ' is taken; remove what is left of earlier runs', status_io)
   end subroutine create_part

   !> Give a closed temporary file its final name, replacing an earlier result, in one step.
   subroutine publish_part(part, path, error)
      character(*), intent(in) :: part, path
      type(error_type), allocatable, intent(out) :: error

      ! Somebody may have put another file there while the run was at work.
      call check_replaceable(path, error)
      if (allocated(error)) then
         error%message = error%message//'; the result is complete in '//part
         return
      end if
      if (c_rename(part//c_null_char, path//c_null_char) == 0) return
      call fatal_error(error, path//': cannot be replaced; the result is complete in '//part, &
                       status_io)
   end subroutine publish_part

   !> Remove a closed temporary file.
   subroutine delete_part(part)
      character(*), intent(in) :: part
      integer(c_int) :: ignored

      ignored = c_unlink(part//c_null_char)
   end subroutine delete_part

end module fw_result_part
