!> Files that appear under their name only when they are complete: written as '<name>.part' and
!> renamed. Where that is occupied, by another run at work or by the remains of a killed one, the
!> next free of '<name>.part.2', '<name>.part.3', ... is taken.
!>
!> Remains are kept until a later run has published its result under the same name, because they
!> hold points that nothing else has; then they go. A run at work is told from a killed one by the
!> lock that HDF5 holds on an open file, so a part says on which machine its lock works: nothing
!> else is removed, nor a part that is whole.
module fw_result_part
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
   use fw_error, only: error_type, fatal_error, status_io
   use fw_hdf5, only: has_attribute, hdf5_file, read_attribute, write_attribute
   use fw_paths, only: is_locked, is_there, machine_name
   use fw_result_target, only: check_replaceable, find_target
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: create_part, publish_part, delete_part, at_work

   !> As many parts of one result are told apart.
   integer, parameter :: most_parts = 100

   !> Attribute of a part: the machine on which its lock can be seen.
   character(*), parameter :: lock_attribute = 'locked_on'
   !> Status of a part until its run has written everything.
   character(*), parameter :: at_work = 'incomplete'

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
      do i = 1, most_parts
         part = part_name(target, i)
         inquire (file=part, exist=occupied)
         if (occupied) cycle
         ! Exclusive: of two runs that find the name free only one gets it.
         call file%create(part, error, exclusive=.true.)
         if (.not. allocated(error)) then
            if (is_locked(part)) call write_attribute(file, '/', lock_attribute, &
                                                      machine_name(), error)
            return
         end if
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
      else if (c_rename(part//c_null_char, path//c_null_char) /= 0) then
         call fatal_error(error, path//': cannot be replaced; the result is complete in '// &
                          part, status_io)
      else
         call delete_remains(path)
      end if
   end subroutine publish_part

   !> Remove what killed runs have left beside a result that is complete now.
   subroutine delete_remains(path)
      character(*), intent(in) :: path
      character(:), allocatable :: part
      integer :: i

      do i = 1, most_parts
         part = part_name(path, i)
         if (.not. is_there(part)) cycle
         if (is_locked(part)) cycle
         if (was_killed_here(part)) call delete_part(part)
      end do
   end subroutine delete_remains

   !> Whether a file without a lock is the part of a run that had one on this machine, and was
   !> killed at work: one that is whole is about to get its name, or could not get it.
   logical function was_killed_here(part)
      character(*), intent(in) :: part
      type(error_type), allocatable :: error
      type(hdf5_file) :: file
      character(:), allocatable :: machine, status

      was_killed_here = .false.
      call file%open_read(part, error)
      if (allocated(error)) return
      if (has_attribute(file, '/', lock_attribute)) then
         call read_attribute(file, '/', lock_attribute, machine, error)
         if (.not. allocated(error)) was_killed_here = machine == machine_name()
      end if
      if (was_killed_here .and. has_attribute(file, '/', 'status')) then
         call read_attribute(file, '/', 'status', status, error)
         was_killed_here = .not. allocated(error)
         if (was_killed_here) was_killed_here = status == at_work
      end if
      call file%close(error)
   end function was_killed_here

   !> `<target>.part`, then `<target>.part.2` and so on.
   pure function part_name(target, i) result(part)
      character(*), intent(in) :: target
      integer, intent(in) :: i
      character(:), allocatable :: part

      part = target//'.part'
      if (i > 1) part = part//'.'//to_text(i)
   end function part_name

   !> Remove a closed temporary file.
   subroutine delete_part(part)
      character(*), intent(in) :: part
      integer(c_int) :: ignored

      ignored = c_unlink(part//c_null_char)
   end subroutine delete_part

end module fw_result_part
