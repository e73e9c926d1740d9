!> Parts of the messages of the reader, and arrays as namelist text.
module fw_reader_text
   use fw_kinds, only: wp
   use fw_namelist_data, only: value_type
   use fw_text, only: string_type, lower_case, nearest_word, to_text, join
   use fw_values, only: kind_text, quoted_text
   implicit none (type, external)
   private

   public :: near, near_part, did_you_mean, shown, to_strings, words_text, element_text, dims_text
   public :: number_list, repeat_hint, printable

contains

   !> `; did you mean ...?` where a name of the list is near, or all of a short list.
   pure function near(word, words) result(hint)
      character(*), intent(in) :: word
      type(string_type), intent(in) :: words(:)
      character(:), allocatable :: hint

      hint = nearest_word(lower_case(word), words)
      if (len(hint) > 0) then
         hint = '; did you mean '//hint//'?'
      else if (size(words) <= 20) then
         ! A longer list would bury the message.
         hint = '; known are '//join(words, ', ')
      end if
   end function near

   !> `; did you mean ... or ...?` where a name is a whole part of some of the list, as harmonic is
   !> of term_harmonic, or nothing.
   pure function near_part(word, words) result(hint)
      character(*), intent(in) :: word
      type(string_type), intent(in) :: words(:)
      character(:), allocatable :: hint
      integer :: i

      hint = ''
      do i = 1, size(words)
         if (index('_'//words(i)%text//'_', '_'//lower_case(word)//'_') == 0) cycle
         if (len(hint) > 0) hint = hint//' or '//words(i)%text
         if (len(hint) == 0) hint = '; did you mean '//words(i)%text
      end do
      if (len(hint) > 0) hint = hint//'?'
   end function near_part

   !> `; did you mean '...'?` where a text value of the list is near, or nothing. Short words are
   !> near to any other: they have to share a letter.
   pure function did_you_mean(word, words) result(hint)
      character(*), intent(in) :: word
      type(string_type), intent(in) :: words(:)
      character(:), allocatable :: hint

      hint = nearest_word(word, words)
      if (scan(word, hint) == 0) hint = ''
      if (len(hint) > 0) hint = '; did you mean '//quoted_text(hint)//'?'
   end function did_you_mean

   !> A value as it was written: with its quotes, if it had any.
   pure function shown(value) result(text)
      type(value_type), intent(in) :: value
      character(:), allocatable :: text

      text = value%text
      if (value%quoted) text = quoted_text(value%text)
   end function shown

   !> What a `*` in a value that could not be read may have been meant for.
   pure function repeat_hint(value) result(hint)
      type(value_type), intent(in) :: value
      character(:), allocatable :: hint
      integer :: star

      hint = ''
      star = index(value%text, '*')
      if (star < 2 .or. value%quoted) return
      hint = '; the repeat count '//value%text(:star - 1)//' before the * must be a whole '// &
             'number from 1 on'
   end function repeat_hint

   !> A message that a terminal and UTF-8 readers take: every control byte and every byte that
   !> is no part of UTF-8 as `\x1b`, ends of lines excepted.
   pure function printable(message) result(text)
      character(*), intent(in) :: message
      character(:), allocatable :: text
      character(*), parameter :: digits = '0123456789abcdef'
      integer :: i, k, n, code

      ! Four letters at most for a byte.
      allocate (character(4*len(message)) :: text)
      n = 0
      i = 1
      do while (i <= len(message))
         k = sound_bytes(message(i:min(i + 3, len(message))))
         if (k > 0) then
            text(n + 1:n + k) = message(i:i + k - 1)
            n = n + k
            i = i + k
         else
            code = iachar(message(i:i))
            text(n + 1:n + 4) = '\x'//digits(code/16 + 1:code/16 + 1)// &
                                digits(mod(code, 16) + 1:mod(code, 16) + 1)
            n = n + 4
            i = i + 1
         end if
      end do
      text = text(:n)
   end function printable

   !> Length of the printable character that begins a text; 0 where there is none.
   pure integer function sound_bytes(text) result(n)
      !> Not empty; four bytes tell.
      character(*), intent(in) :: text
      integer :: first, second, i

      first = iachar(text(1:1))
      second = 0
      if (len(text) > 1) second = iachar(text(2:2))
      select case (first)
      ! Byte ranges of UTF-8 by the length of the character that they begin (RFC 3629).
      case (10, 32:126)
         n = 1
      case (194:223)
         n = 2
      case (224:239)
         n = 3
      case (240:244)
         n = 4
      case default
         n = 0
      end select
      if (n > len(text)) n = 0
      do i = 2, n
         ! Bytes that follow have the form 10xxxxxx.
         if (iand(iachar(text(i:i)), 192) == 128) cycle
         n = 0
         return
      end do
      ! Control characters of two bytes, needlessly long forms, surrogates, beyond Unicode.
      if ((first == 194 .and. second < 160) .or. (first == 224 .and. second < 160) &
          .or. (first == 237 .and. second > 159) .or. (first == 240 .and. second < 144) &
          .or. (first == 244 .and. second > 143)) n = 0
   end function sound_bytes

   !> Words of one length as texts of their own.
   pure function to_strings(words) result(strings)
      character(*), intent(in) :: words(:)
      type(string_type), allocatable :: strings(:)
      integer :: i

      allocate (strings(size(words)))
      do i = 1, size(words)
         strings(i)%text = trim(words(i))
      end do
   end function to_strings

   !> `'a', 'b' or 'c'`.
   pure function words_text(words) result(text)
      character(*), intent(in) :: words(:)
      character(:), allocatable :: text
      integer :: i

      text = quoted_text(trim(words(1)))
      do i = 2, size(words)
         text = text//trim(merge(' or', ',  ', i == size(words)))//' '//quoted_text(trim(words(i)))
      end do
   end function words_text

   !> Subscripts of an element: `(2,1)`.
   pure function element_text(element, dims) result(text)
      integer, intent(in) :: element
      integer, intent(in) :: dims(:)
      character(:), allocatable :: text
      integer :: i, rest

      text = '('
      ! The first index runs fastest.
      rest = element - 1
      do i = 1, size(dims)
         if (i > 1) text = text//','
         text = text//to_text(1 + mod(rest, dims(i)))
         rest = rest/dims(i)
      end do
      text = text//')'
   end function element_text

   !> `3 x 4`.
   pure function dims_text(dims) result(text)
      integer, intent(in) :: dims(:)
      character(:), allocatable :: text
      integer :: i

      text = to_text(dims(1))
      do i = 2, size(dims)
         text = text//' x '//to_text(dims(i))
      end do
   end function dims_text

   !> Numbers as namelist values; equal ones are written once.
   function number_list(numbers, kind, dims, repeats) result(text)
      real(wp), intent(in) :: numbers(:)
      !> real_kind or integer_kind.
      character(*), intent(in) :: kind
      integer, intent(in) :: dims(:)
      logical, intent(in) :: repeats
      character(:), allocatable :: text
      character(:), allocatable :: longer
      integer :: i, last, per_line

      text = ''
      if (size(numbers) == 0) return
      ! What may be given as one value for all is written so.
      if (repeats .and. all(abs(numbers - numbers(1)) <= 0.0_wp)) then
         text = kind_text(numbers(1), kind)
         return
      end if
      ! A column of a matrix in a line, else six numbers.
      per_line = merge(dims(1), 6, size(dims) > 1)
      text = repeat(' ', 16)
      last = 0
      do i = 1, size(numbers)
         call put(kind_text(numbers(i), kind))
         if (i == size(numbers)) exit
         if (mod(i, per_line) == 0) then
            call put(','//new_line('a')//repeat(' ', 6))
         else
            call put(', ')
         end if
      end do
      text = text(:last)

   contains

      !> Room is doubled: a text that grows number by number is copied as often.
      subroutine put(part)
         character(*), intent(in) :: part

         if (last + len(part) > len(text)) then
            longer = text//repeat(' ', len(text) + len(part))
            call move_alloc(longer, text)
         end if
         text(last + 1:last + len(part)) = part
         last = last + len(part)
      end subroutine put

   end function number_list

end module fw_reader_text
