!> A place in a text that moves forward through namelist syntax and counts lines.
!>
!> Positions count letters of the whole text, so that values may go over several lines; the line is
!> for messages. All steps are safe at the end of the text.
module fw_cursor
   use fw_text, only: lower_case
   implicit none (type, external)
   private

   public :: cursor_type

   character(*), parameter :: tab = achar(9), newline = achar(10), return = achar(13)
   !> What ends a number or word outside of quotes.
   character(*), parameter :: word_end = ' ,/!=()&;''"'//tab//newline//return

   type :: cursor_type
      character(:), allocatable :: text
      !> Place of the letter under the cursor, and its line, both from 1.
      integer :: position = 1
      integer :: line = 1
      !> `/` ends a group and `!` starts a comment: true in a file, false on a command line.
      logical :: in_file = .true.
   contains
      procedure :: at_end
      procedure :: peek
      procedure :: skip_blank
      procedure :: take_name
      procedure :: take_word
      procedure :: take_quoted
      procedure :: take_through
      procedure :: is_at_key
   end type cursor_type

contains

   !> Nothing is left under the cursor.
   pure logical function at_end(self)
      class(cursor_type), intent(in) :: self

      at_end = self%position > len(self%text)
   end function at_end

   !> The character under the cursor; a newline at the end of the text.
   pure character function peek(self)
      class(cursor_type), intent(in) :: self

      peek = newline
      if (.not. self%at_end()) peek = self%text(self%position:self%position)
   end function peek

   !> Move over blanks, ends of lines and comments.
   pure subroutine skip_blank(self)
      class(cursor_type), intent(inout) :: self

      do while (.not. self%at_end())
         if (self%peek() == '!' .and. self%in_file) then
            do while (self%peek() /= newline)
               self%position = self%position + 1
            end do
         end if
         if (.not. is_blank(self%peek()) .or. self%at_end()) return
         ! Counted here only: names, words and quoted texts do not contain ends of lines.
         if (self%peek() == newline) self%line = self%line + 1
         self%position = self%position + 1
      end do
   end subroutine skip_blank

   !> Take a name (in lower case): a letter, then letters, digits, underscores and %.
   pure subroutine take_name(self, name)
      class(cursor_type), intent(inout) :: self
      character(:), allocatable, intent(out) :: name
      integer :: first

      first = self%position
      if (is_name_start(self%peek())) then
         do while (is_name_start(self%peek()) .or. is_digit(self%peek()) .or. self%peek() == '%')
            self%position = self%position + 1
         end do
      end if
      name = lower_case(self%text(first:self%position - 1))
   end subroutine take_name

   !> Take a number or an unquoted word.
   pure subroutine take_word(self, word)
      class(cursor_type), intent(inout) :: self
      character(:), allocatable, intent(out) :: word
      integer :: first

      first = self%position
      do while (.not. self%at_end())
         if (scan(self%peek(), word_end) > 0) then
            ! On a command line these belong to the word: paths hold slashes.
            if (self%in_file .or. scan(self%peek(), '/!=&;()') == 0) exit
         end if
         self%position = self%position + 1
      end do
      word = self%text(first:self%position - 1)
   end subroutine take_word

   !> Take a text in quotes, where a doubled quote stands for itself; it ends on its line.
   pure subroutine take_quoted(self, content, closed)
      class(cursor_type), intent(inout) :: self
      character(:), allocatable, intent(out) :: content
      logical, intent(out) :: closed
      character :: quote

      quote = self%peek()
      self%position = self%position + 1
      content = ''
      closed = .false.
      do while (self%peek() /= newline .and. self%peek() /= return)
         if (self%peek() == quote) then
            self%position = self%position + 1
            ! Two quotes in a row are one letter of the text.
            closed = self%peek() /= quote
            if (closed) return
         end if
         content = content//self%peek()
         self%position = self%position + 1
      end do
   end subroutine take_quoted

   !> Take what comes before a character of this line, and step over that character.
   pure subroutine take_through(self, last, content, found)
      class(cursor_type), intent(inout) :: self
      character, intent(in) :: last
      character(:), allocatable, intent(out) :: content
      logical, intent(out) :: found
      integer :: first

      first = self%position
      do while (self%peek() /= last .and. self%peek() /= newline)
         self%position = self%position + 1
      end do
      found = .not. self%at_end() .and. self%peek() == last
      content = self%text(first:self%position - 1)
      if (found) self%position = self%position + 1
   end subroutine take_through

   !> Whether a key follows: a name, then `=` or the parenthesis of a subscript.
   pure logical function is_at_key(self)
      class(cursor_type), intent(in) :: self
      type(cursor_type) :: ahead
      character(:), allocatable :: name
      integer :: last

      is_at_key = .false.
      if (.not. self%in_file .or. .not. is_name_start(self%peek())) return
      ! A bounded look ahead: long lists are asked this for every value.
      last = min(len(self%text), self%position + 200)
      ahead%text = self%text(self%position:last)
      call ahead%take_name(name)
      call ahead%skip_blank()
      is_at_key = ahead%peek() == '=' .or. ahead%peek() == '('
   end function is_at_key

   !> A blank, a tab or an end of a line (of either system).
   pure logical function is_blank(letter)
      character, intent(in) :: letter

      is_blank = scan(letter, ' '//tab//newline//return) > 0
   end function is_blank

   !> A decimal digit.
   pure logical function is_digit(letter)
      character, intent(in) :: letter

      is_digit = letter >= '0' .and. letter <= '9'
   end function is_digit

   !> A letter or an underscore.
   pure logical function is_name_start(letter)
      character, intent(in) :: letter
      character :: lower

      lower = lower_case(letter)
      is_name_start = (lower >= 'a' .and. lower <= 'z') .or. letter == '_'
   end function is_name_start

end module fw_cursor
