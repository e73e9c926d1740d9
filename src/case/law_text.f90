!> The words of the laws of a case's pairs, as messages show them.
module fw_law_text
   use fw_contact_data, only: contact_type
   use fw_laws, only: law_words, laws_of
   use fw_normal_law, only: normal_words
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: all_laws, law_of_pairs, normal_law_of_pairs, law_text, law_text_length

   !> Of all words, each in quotes, with a comma between.
   integer, parameter :: law_text_length = size(law_words)*(len(law_words) + 4)

contains

   !> In quotes, each law once: 'penalty', or 'penalty', 'dlft'.
   pure function law_text(contact) result(text)
      type(contact_type), intent(in) :: contact
      character(law_text_length) :: text
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      text = "'"//trim(law_words(numbers(1)))//"'"
      do k = 2, size(numbers)
         text = trim(text)//", '"//trim(law_words(numbers(k)))//"'"
      end do
   end function law_text

   !> The words that there are, in quotes.
   pure function all_laws() result(text)
      character(law_text_length) :: text
      integer :: k

      text = "'"//trim(law_words(1))//"'"
      do k = 2, size(law_words)
         text = trim(text)//", '"//trim(law_words(k))//"'"
      end do
   end function all_laws

   !> The word of each pair, of a contact whose pairs differ (n_pairs).
   pure subroutine law_of_pairs(contact, words)
      type(contact_type), intent(in) :: contact
      type(string_type), allocatable, intent(out) :: words(:)
      integer :: i

      allocate (words(contact%n_pairs))
      do i = 1, size(words)
         words(i)%text = trim(law_words(contact%law_of(i)))
      end do
   end subroutine law_of_pairs

   !> How each pair presses, of a contact that says so (n_pairs).
   pure subroutine normal_law_of_pairs(contact, words)
      type(contact_type), intent(in) :: contact
      type(string_type), allocatable, intent(out) :: words(:)
      integer :: i

      allocate (words(contact%n_pairs))
      do i = 1, size(words)
         words(i)%text = trim(normal_words(contact%normal_law(i)))
      end do
   end subroutine normal_law_of_pairs

end module fw_law_text
