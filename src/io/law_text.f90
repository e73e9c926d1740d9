!> The words of the laws of a case's pairs, as messages show them.
module fw_law_text
   use fw_contact_data, only: contact_type
   use fw_laws, only: law_words, laws_of
   implicit none (type, external)
   private

   public :: law_text

contains

   !> In quotes, each law once: 'penalty', or 'penalty', 'dlft'.
   function law_text(contact) result(text)
      type(contact_type), intent(in) :: contact
      character(:), allocatable :: text
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      text = ''
      do k = 1, size(numbers)
         if (k > 1) text = text//', '
         text = text//"'"//trim(law_words(numbers(k)))//"'"
      end do
   end function law_text

end module fw_law_text
