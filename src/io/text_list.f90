!> Growing lists of texts.
module fw_text_list
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: append

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

end module fw_text_list
