!> Which value of which assignment each element of an array takes.
!>
!> Several assignments may fill one array, as mu(1) = 0.3 and mu(2:3) = 2*0.4. No element may be
!> given twice in a file; an override of the command line replaces what the file gave.
module fw_array_entries
   use fw_namelist_data, only: namelist_type, entry_type, section_type, value_count, stray_word
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: source_type, spread_entry

   !> For every element, in Fortran order, the entry and the value within it (0: none given).
   type :: source_type
      integer, allocatable :: entry(:), value(:)
   end type source_type

contains

   !> Add one assignment to the sources of an array. On failure `message` says why.
   subroutine spread_entry(input, i_entry, dims, repeats, source, message, tile)
      type(namelist_type), intent(in) :: input
      !> Number of the assignment in it.
      integer, intent(in) :: i_entry
      !> Shape of the whole array.
      integer, intent(in) :: dims(:)
      !> Whether one value holds for all elements.
      logical, intent(in) :: repeats
      !> Of all elements (product(dims)), with 0 where none is given yet.
      type(source_type), intent(inout) :: source
      character(:), allocatable, intent(out) :: message
      !> So many values hold over and over, where the array is assigned as a whole; 0 for none.
      integer, intent(in), optional :: tile
      integer, allocatable :: elements(:)
      integer :: n_tile, n_values, i

      n_tile = 0
      if (present(tile)) n_tile = tile
      associate (entry => input%entries(i_entry))
         call list_elements(entry%sections, dims, elements, message)
         if (allocated(message)) return
         n_values = value_count(entry)
         ! One value stands for all elements where the key allows it, whatever the subscripts name.
         if (size(entry%sections) > 0) n_tile = 0
         if (n_values /= size(elements) .and. .not. (repeats .and. n_values == 1) .and. &
             .not. (n_values == n_tile .and. n_tile > 0)) then
            message = 'has '//to_text(n_values)//plural(' value', n_values)//': must be '// &
                      to_text(size(elements))//count_text(dims, size(entry%sections) > 0)
            if (n_tile > 0) message = message//', '//to_text(n_tile)//' for all sectors alike'
            if (repeats) message = message//', or one value for all'
            message = message//stray_word(entry)
            return
         end if
         do i = 1, size(elements)
            if (source%entry(elements(i)) == 0) cycle
            ! An override may give what the file has given.
            if (allocated(entry%option)) cycle
            message = 'is given twice (first in line '// &
                      to_text(input%entries(source%entry(elements(i)))%line)//'): keep one'
            return
         end do
         source%entry(elements) = i_entry
         call number_values(entry, elements, n_values == 1, source%value)
         if (n_values == n_tile .and. n_values < size(elements)) then
            do i = n_values + 1, size(elements)
               source%value(elements(i)) = source%value(elements(i - n_values))
            end do
         end if
      end associate
   end subroutine spread_entry

   !> Multiply out the repeat counts.
   !> Which value of the entry each of its elements takes.
   subroutine number_values(entry, elements, single, value)
      type(entry_type), intent(in) :: entry
      integer, intent(in) :: elements(:)
      logical, intent(in) :: single
      integer, intent(inout) :: value(:)
      integer :: i, k, done

      if (single) then
         value(elements) = 1
         return
      end if
      done = 0
      do i = 1, size(entry%values)
         do k = 1, entry%values(i)%repeat
            done = done + 1
            value(elements(done)) = i
         end do
      end do
   end subroutine number_values

   !> Positions, in Fortran order, of the elements that subscripts name.
   subroutine list_elements(sections, dims, elements, message)
      type(section_type), intent(in) :: sections(:)
      integer, intent(in) :: dims(:)
      integer, allocatable, intent(out) :: elements(:)
      character(:), allocatable, intent(out) :: message
      integer :: i, last, stride
      integer, allocatable :: offsets(:)

      if (size(sections) /= 0 .and. size(sections) /= size(dims)) then
         message = 'has '//to_text(size(sections))//plural(' subscript', size(sections))// &
                   ': must have '//to_text(size(dims))
         return
      end if
      ! Element (i, j, ..) stands at 1 + (i - 1) + (j - 1) dims(1) + ..: dimension by dimension,
      ! every offset is combined with what is there.
      elements = [1]
      stride = 1
      do i = 1, size(dims)
         last = dims(i)
         offsets = [integer ::]
         ! Without subscripts the whole dimension.
         if (size(sections) == 0) then
            offsets = sequence(1, last)
         else
            ! An open end is the last one.
            if (sections(i)%last > 0) last = sections(i)%last
            if (last > dims(i) .or. sections(i)%first > dims(i)) then
               message = 'has the subscript '//to_text(max(last, sections(i)%first))// &
                         ' in dimension '//to_text(i)//': must be at most '//to_text(dims(i))
               return
            end if
            offsets = sequence(sections(i)%first, last)
         end if
         elements = combine(elements, (offsets - 1)*stride)
         stride = stride*dims(i)
      end do
   end subroutine list_elements

   !> first..last; empty where last is before it.
   pure function sequence(first, last) result(numbers)
      integer, intent(in) :: first, last
      integer, allocatable :: numbers(:)
      integer :: i

      allocate (numbers(max(0, last - first + 1)))
      do i = 1, size(numbers)
         numbers(i) = first + i - 1
      end do
   end function sequence

   !> Every element shifted by every offset, elements innermost.
   pure function combine(elements, offsets) result(all_elements)
      integer, intent(in) :: elements(:), offsets(:)
      integer, allocatable :: all_elements(:)
      integer :: j, n

      n = size(elements)
      allocate (all_elements(n*size(offsets)))
      do j = 1, size(offsets)
         all_elements((j - 1)*n + 1:j*n) = elements + offsets(j)
      end do
   end function combine

   !> ` (3 x 4)` for a whole array of several dimensions: a bare product says little.
   pure function count_text(dims, has_sections) result(text)
      integer, intent(in) :: dims(:)
      logical, intent(in) :: has_sections
      character(:), allocatable :: text
      integer :: i

      text = ''
      if (has_sections .or. size(dims) < 2) return
      text = ' ('//to_text(dims(1))
      do i = 2, size(dims)
         text = text//' x '//to_text(dims(i))
      end do
      text = text//')'
   end function count_text

   !> The word with an s where there is not just one.
   pure function plural(word, n) result(text)
      character(*), intent(in) :: word
      integer, intent(in) :: n
      character(:), allocatable :: text

      text = word
      if (n /= 1) text = word//'s'
   end function plural

end module fw_array_entries
