!> The keys of a case as text for a reader, or as JSON for a program.
!>
!> The declarations of the keys are the one source: what is printed here is what the reader does,
!> and the tables of the guide and the settings of the Python package are made from the JSON.
module fw_key_text
   use fw_error, only: error_type, fatal_error, status_usage
   use fw_key_range, only: range_type
   use fw_kinds, only: wp
   use fw_read_case, only: list_keys
   use fw_reader_text, only: near
   use fw_records, only: record_list, record_type
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: write_keys

contains

   !> Write the keys of a group ('': of all of them), for a reader or as JSON.
   subroutine write_keys(unit, group, as_json, error)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      character(*), intent(in) :: group
      logical, intent(in) :: as_json
      !> status_usage where there is no such group.
      type(error_type), allocatable, intent(out) :: error
      type(record_list) :: keys
      integer :: g

      call list_keys(keys)
      if (len(group) > 0) then
         if (.not. any([(keys%groups(g)%text == group, g=1, size(keys%groups))])) then
            call fatal_error(error, 'there is no group &'//group//near(group, keys%groups), &
                             status_usage)
            return
         end if
      end if
      if (as_json) write (unit, '(a)') '{'
      do g = 1, size(keys%groups)
         if (len(group) > 0 .and. keys%groups(g)%text /= group) cycle
         if (as_json) then
            call write_group_json(unit, keys, g, g == size(keys%groups) .or. len(group) > 0)
         else
            if (g > 1 .and. len(group) == 0) write (unit, '(a)') ''
            call write_group(unit, keys, g)
         end if
      end do
      if (as_json) write (unit, '(a)') '}'
   end subroutine write_keys

   !> A group for a reader: each key with what it accepts, its shape, unit and default, and its
   !> help.
   subroutine write_group(unit, keys, g)
      integer, intent(in) :: unit
      type(record_list), intent(in) :: keys
      integer, intent(in) :: g
      integer :: k

      write (unit, '(a)') '&'//keys%groups(g)%text//'   '//keys%purposes(g)%text
      do k = 1, keys%n
         associate (entry => keys%records(k))
            if (entry%group /= keys%groups(g)%text) cycle
            write (unit, '(a)') '   '//trim(entry%key%name)//' = '//entry%accepts// &
               shape_text(entry)//unit_text(entry)//default_text(entry)
            write (unit, '(a)') '      '//trim(entry%key%help)
            if (len_trim(entry%key%only) > 0) then
               write (unit, '(a)') '      only: '//trim(entry%key%only)
            end if
         end associate
      end do
   end subroutine write_group

   !> ` in L`, or nothing.
   function unit_text(entry) result(text)
      type(record_type), intent(in) :: entry
      character(:), allocatable :: text

      text = ''
      if (len_trim(entry%key%unit) > 0) text = ' in '//trim(entry%key%unit)
   end function unit_text

   !> ` [0.5]`, or what holds where the key is absent.
   function default_text(entry) result(text)
      type(record_type), intent(in) :: entry
      character(:), allocatable :: text

      text = trim(entry%key%absent)
      if (allocated(entry%default)) then
         if (len(text) > 0) text = text//', else '
         text = text//entry%default
      end if
      if (len(text) > 0) text = ' ['//text//']'
   end function default_text

   !> How many values there are: `, n_dof n_dof of them`.
   function shape_text(entry) result(text)
      type(record_type), intent(in) :: entry
      character(:), allocatable :: text

      text = ''
      if (len_trim(entry%key%shape) == 0) return
      text = ', '//trim(entry%key%shape)//' of them'
      if (entry%key%repeats) text = ', one for all or '//trim(entry%key%shape)//' of them'
   end function shape_text

   !> A group as a member of the object of all groups.
   subroutine write_group_json(unit, keys, g, is_last)
      integer, intent(in) :: unit
      type(record_list), intent(in) :: keys
      integer, intent(in) :: g
      logical, intent(in) :: is_last
      logical :: is_first
      integer :: k

      write (unit, '(a)') ' "'//keys%groups(g)%text//'": {"help": '// &
         json_text(keys%purposes(g)%text)//', "keys": {'
      is_first = .true.
      do k = 1, keys%n
         if (keys%records(k)%group /= keys%groups(g)%text) cycle
         ! The comma comes before each but the first: which key is the last of a group is not known.
         if (.not. is_first) write (unit, '(a)') ','
         write (unit, '(a)', advance='no') '  '//key_json(keys%records(k))
         is_first = .false.
      end do
      write (unit, '(a)') '}}'//trim(merge(' ', ',', is_last))
   end subroutine write_group_json

   !> A key as a member of its group; what does not apply to it is left out.
   function key_json(entry) result(text)
      type(record_type), intent(in) :: entry
      character(:), allocatable :: text
      integer :: i

      text = json_text(trim(entry%key%name))//': {"type": '//json_text(trim(entry%kind))
      if (allocated(entry%words)) then
         text = text//', "words": ['
         do i = 1, size(entry%words)
            if (i > 1) text = text//', '
            text = text//json_text(trim(entry%words(i)))
         end do
         text = text//']'
      end if
      text = text//range_json(entry%key%range)
      if (len_trim(entry%key%shape) > 0) then
         text = text//', "shape": '//json_text(trim(entry%key%shape))//', "repeats": '// &
                trim(merge('true ', 'false', entry%key%repeats))
      end if
      if (allocated(entry%default)) text = text//', "default": '//json_text(entry%default)
      text = text//field('unit', entry%key%unit)//field('absent', entry%key%absent)// &
             field('only', entry%key%only)//field('accepts', entry%accepts)// &
             field('help', entry%key%help)//'}'
   end function key_json

   !> The bounds that bind.
   function range_json(range) result(text)
      type(range_type), intent(in) :: range
      character(:), allocatable :: text

      text = field('within', range%within)
      if (range%above > -huge(1.0_wp)) text = text//', "above": '//number_text(range%above)
      if (range%below < huge(1.0_wp)) text = text//', "below": '//number_text(range%below)
      if (range%least > -huge(1.0_wp)) text = text//', "least": '//number_text(range%least)
      if (range%most < huge(1.0_wp)) text = text//', "most": '//number_text(range%most)
      if (range%whole) text = text//', "whole": true'
   end function range_json

   !> A text of an object; nothing where it is blank.
   function field(name, content) result(text)
      character(*), intent(in) :: name, content
      character(:), allocatable :: text

      text = ''
      if (len_trim(content) > 0) text = ', "'//name//'": '//json_text(trim(content))
   end function field

   !> Help has neither control characters nor anything beyond ASCII.
   function json_text(content) result(text)
      character(*), intent(in) :: content
      character(:), allocatable :: text
      integer :: i

      text = '"'
      do i = 1, len(content)
         ! Only these two need a backslash.
         if (scan(content(i:i), '"\') > 0) text = text//'\'
         text = text//content(i:i)
      end do
      text = text//'"'
   end function json_text

end module fw_key_text
