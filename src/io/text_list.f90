!> Growing lists of texts.
module fw_text_list
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: append, words_of, name_sectors

contains

   !> Add a text at the end. Element by element: gfortran 12 loses the texts of an array
   !> constructor of such elements in places.
   pure subroutine append(list, text)
      !> Must be allocated.
      type(string_type), allocatable, intent(inout) :: list(:)
      character(*), intent(in) :: text
      type(string_type), allocatable :: longer(:)
      integer :: i

      allocate (longer(size(list) + 1))
      do i = 1, size(list)
         call move_alloc(list(i)%text, longer(i)%text)
      end do
      longer(size(longer))%text = text
      call move_alloc(longer, list)
   end subroutine append

   !> The words of a text, in order.
   pure function words_of(text, separator) result(words)
      character(*), intent(in) :: text
      character, intent(in) :: separator
      type(string_type), allocatable :: words(:)
      integer :: first, i, last, n

      n = 1
      do i = 1, len_trim(text)
         if (text(i:i) == separator) n = n + 1
      end do
      allocate (words(n))
      first = 1
      do i = 1, n
         last = index(text(first:), separator)
         if (last == 0 .or. i == n) last = len_trim(text) - first + 2
         words(i)%text = text(first:first + last - 2)
         first = first + last
      end do
   end function words_of

   !> What a sector has, for each of all: name@0, .., name@1, ..
   subroutine name_sectors(n_sectors, names)
      integer, intent(in) :: n_sectors
      type(string_type), allocatable, intent(inout) :: names(:)
      type(string_type), allocatable :: all(:)
      integer :: i, j, n

      n = size(names)
      allocate (all(n*n_sectors))
      do j = 0, n_sectors - 1
         do i = 1, n
            all(j*n + i)%text = names(i)%text//'@'//to_text(j)
         end do
      end do
      call move_alloc(all, names)
   end subroutine name_sectors

end module fw_text_list
