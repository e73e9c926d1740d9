!> What two effective inputs differ in.
module fw_case_difference
   use fw_error, only: error_type
   use fw_namelist, only: parse_namelist
   use fw_namelist_data, only: entry_type, last_entry, multiply_out, namelist_type, value_type
   implicit none (type, external)
   private

   public :: find_difference

   !> Longer values are not shown.
   integer, parameter :: most_shown = 60

contains

   !> The first key that two namelists, as effective inputs have them, do not agree in, and both of
   !> its values: `&wear order = 2` and `&wear order = 3`; '' where they agree.
   subroutine find_difference(first, second, ignored, in_first, in_second, error)
      character(*), intent(in) :: first, second
      !> `group%key` each: keys that may differ.
      character(*), intent(in) :: ignored(:)
      character(:), allocatable, intent(out) :: in_first, in_second
      type(error_type), allocatable, intent(out) :: error
      type(namelist_type) :: a, b

      in_first = ''
      in_second = ''
      call parse_namelist(first, '', a, error)
      if (.not. allocated(error)) call parse_namelist(second, '', b, error)
      if (allocated(error)) return
      call compare(a, b, ignored, in_first, in_second)
      if (len(in_first) > 0) return
      ! Keys that only the second namelist has.
      call compare(b, a, ignored, in_second, in_first)
   end subroutine find_difference

   !> The keys of the first against those of the second.
   subroutine compare(a, b, ignored, in_a, in_b)
      type(namelist_type), intent(in) :: a, b
      character(*), intent(in) :: ignored(:)
      character(:), allocatable, intent(inout) :: in_a, in_b
      character(:), allocatable :: name, text, other
      integer :: i, j

      do i = 1, a%n_entries
         name = a%entries(i)%group//'%'//a%entries(i)%key
         if (any(ignored == name)) cycle
         j = last_entry(b, a%entries(i)%group, a%entries(i)%key)
         text = text_of(a%entries(i))
         other = 'not given'
         if (j > 0) other = text_of(b%entries(j))
         if (text == other) cycle
         in_a = shown(name, text)
         in_b = shown(name, other)
         return
      end do
   end subroutine compare

   !> All values of an assignment as one text.
   function text_of(entry) result(text)
      type(entry_type), intent(in) :: entry
      character(:), allocatable :: text
      type(value_type), allocatable :: values(:)
      integer :: i

      ! So that 2*0.5 and 0.5, 0.5 are the same.
      call multiply_out(entry%values, values)
      text = ''
      do i = 1, size(values)
         if (i > 1) text = text//', '
         if (values(i)%quoted) then
            text = text//"'"//values(i)%text//"'"
         else
            text = text//values(i)%text
         end if
      end do
   end function text_of

   pure function shown(name, text) result(words)
      character(*), intent(in) :: name, text
      character(:), allocatable :: words

      if (text == 'not given') then
         words = name//' not given'
      else if (len(text) > most_shown) then
         words = name//' = '//text(:most_shown)//' ...'
      else
         words = name//' = '//text
      end if
   end function shown

end module fw_case_difference
