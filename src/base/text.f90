!> Small text helpers: numbers to text, lower case, the nearest word of a list.
!>
!> `to_text` declares its length instead of returning an allocatable text: gfortran keeps the
!> length of the latter in static memory, which two threads would share, and numbers are put into
!> texts in every layer.
module fw_text
   use fw_kinds, only: wp
   use fw_number_field, only: integer_field, real_field
   implicit none (type, external)
   private

   public :: to_text, lower_case, nearest_word, edit_distance, join, string_type

   !> A text of its own length, for lists of texts.
   type :: string_type
      character(:), allocatable :: text
   end type string_type

   !> Shortest readable text of a number.
   interface to_text
      module procedure integer_to_text
      module procedure real_to_text
      module procedure logical_to_text
   end interface to_text

contains

   !> Two passes: the first for the length. Numbers are rare and short, allocation is not safe here.
   pure function integer_to_text(number) result(text)
      integer, intent(in) :: number
      character(len_trim(integer_field(number))) :: text

      text = integer_field(number)
   end function integer_to_text

   !> A real that reads back to the same bits, without needless digits.
   pure function real_to_text(number) result(text)
      real(wp), intent(in) :: number
      character(len_trim(real_field(number))) :: text

      text = real_field(number)
   end function real_to_text

   pure function logical_to_text(flag) result(text)
      logical, intent(in) :: flag
      ! 7 letters for false, 6 for true: what a function of fixed length can declare.
      character(7 - count([flag])) :: text

      text = merge('.true. ', '.false.', flag)
   end function logical_to_text

   !> ASCII letters only: keys and words of the input have no others.
   pure function lower_case(text) result(lower)
      character(*), intent(in) :: text
      character(len(text)) :: lower
      integer :: i, code

      do i = 1, len(text)
         code = iachar(text(i:i))
         if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
         lower(i:i) = achar(code)
      end do
   end function lower_case

   !> The word of a list with the smallest edit distance, or '' where none is near.
   pure function nearest_word(word, words) result(nearest)
      !> Compared letter by letter: lower case is up to the caller.
      character(*), intent(in) :: word
      !> First of the nearest counts where several are as near.
      type(string_type), intent(in) :: words(:)
      character(:), allocatable :: nearest
      integer :: i, distance, best

      nearest = ''
      ! A third of the letters may be wrong, at least two: farther words would be mere guesses.
      best = max(2, len(word)/3) + 1
      do i = 1, size(words)
         distance = edit_distance(word, words(i)%text)
         if (distance >= best) cycle
         best = distance
         nearest = words(i)%text
      end do
   end function nearest_word

   !> Least number of letters to insert, delete or replace, or of neighbours to swap, that turns one
   !> word into the other.
   pure integer function edit_distance(a, b) result(distance)
      character(*), intent(in) :: a, b
      integer :: rows(0:len(b), 0:2), i, j

      ! Columns of `rows`: this row of the table, and the two above it.
      rows = 0
      rows(:, 0) = [(j, j=0, len(b))]
      do i = 1, len(a)
         rows(:, 2) = rows(:, 1)
         rows(:, 1) = rows(:, 0)
         rows(0, 0) = i
         do j = 1, len(b)
            rows(j, 0) = min(rows(j, 1) + 1, rows(j - 1, 0) + 1, &
                             rows(j - 1, 1) + merge(0, 1, a(i:i) == b(j:j)))
            if (i == 1 .or. j == 1) cycle
            if (a(i:i) == b(j - 1:j - 1) .and. a(i - 1:i - 1) == b(j:j)) then
               ! max: a compiler that does not see the line above warns of an index below 0.
               rows(j, 0) = min(rows(j, 0), rows(max(j - 2, 0), 2) + 1)
            end if
         end do
      end do
      distance = rows(len(b), 0)
   end function edit_distance

   !> The texts of a list with a separator between them.
   pure function join(words, separator) result(text)
      type(string_type), intent(in) :: words(:)
      character(*), intent(in) :: separator
      character(:), allocatable :: text
      integer :: i

      text = ''
      do i = 1, size(words)
         if (i > 1) text = text//separator
         text = text//words(i)%text
      end do
   end function join

end module fw_text
