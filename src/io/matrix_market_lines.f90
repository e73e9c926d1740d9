!> The lines of a Matrix Market file as words and numbers, with the line number in every error.
!> Numbers are checked letter by letter, because a list-directed read takes '2*3', '/' or a
!> missing value for valid.
module fw_matrix_market_lines
   use, intrinsic :: iso_fortran_env, only: iostat_end
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_overflow, ieee_set_flag, &
      ieee_set_halting_mode
   use fw_error, only: error_type, fatal_error, status_input, status_io
   use fw_kinds, only: wp
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: line_reader

   !> The format allows 1024 characters in a line; the spare one shows that there are more.
   integer, parameter :: line_length = 1025

   type :: line_reader
      character(:), allocatable, private :: path
      !> Unit of the open file, -1: none; number of the last line that was read.
      integer, private :: unit = -1, line = 0
   contains
      procedure :: open
      procedure :: next
      procedure :: next_integers
      procedure :: next_entry
      procedure :: next_value
      procedure :: expect_end
      procedure :: failure
      procedure :: close
      procedure, private :: get_words
   end type line_reader

contains

   !> status_io where the file cannot be opened.
   subroutine open(self, path, error)
      class(line_reader), intent(out) :: self
      character(*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      character(200) :: reason
      integer :: status

      self%path = path
      open (newunit=self%unit, file=path, status='old', action='read', iostat=status, &
            iomsg=reason)
      if (status == 0) return
      self%unit = -1
      call fatal_error(error, path//': cannot be opened: '//trim(reason), status_io)
   end subroutine open

   !> Harmless where nothing is open.
   subroutine close(self)
      class(line_reader), intent(inout) :: self

      if (self%unit /= -1) close (self%unit)
      self%unit = -1
   end subroutine close

   !> The words of the next line that is not blank, nor a comment unless comments = .false.;
   !> an error at the end of the file.
   subroutine next(self, words, error, comments)
      class(line_reader), intent(inout) :: self
      type(string_type), allocatable, intent(out) :: words(:)
      type(error_type), allocatable, intent(out) :: error
      !> Pass over lines that start with % (default: .true.).
      logical, intent(in), optional :: comments

      call self%get_words(words, error, comments)
      if (allocated(error)) return
      if (size(words) == 0) call self%failure('is the last one, expected more values '// &
                                              '(truncated file?)', error)
   end subroutine next

   !> A line of exactly so many integers.
   subroutine next_integers(self, numbers, error)
      class(line_reader), intent(inout) :: self
      integer, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: words(:)
      integer :: i, status

      numbers = 0
      call self%next(words, error)
      if (allocated(error)) return
      call check_count(self, size(words), size(numbers), error)
      if (allocated(error)) return
      do i = 1, size(numbers)
         call to_integer(words(i)%text, numbers(i), status)
         if (status == 0) cycle
         call self%failure('holds "'//words(i)%text//'", expected an integer', error)
         return
      end do
   end subroutine next_integers

   !> A line of row, column and value.
   subroutine next_entry(self, place, value, error)
      class(line_reader), intent(inout) :: self
      !> Row and column, from 1; the caller knows the size of the matrix.
      integer, intent(out) :: place(2)
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: words(:)
      integer :: i, status

      place = 0
      value = 0.0_wp
      call self%next(words, error)
      if (allocated(error)) return
      call check_count(self, size(words), 3, error)
      if (allocated(error)) return
      do i = 1, 2
         call to_integer(words(i)%text, place(i), status)
         if (status == 0) cycle
         call self%failure('holds "'//words(i)%text//'", expected an integer', error)
         return
      end do
      call to_real(words(3)%text, value, status)
      if (status /= 0) call self%failure('holds "'//words(3)%text// &
                                         '", expected a finite number', error)
   end subroutine next_entry

   !> A line of one value.
   subroutine next_value(self, value, error)
      class(line_reader), intent(inout) :: self
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: words(:)
      integer :: status

      value = 0.0_wp
      call self%next(words, error)
      if (allocated(error)) return
      call check_count(self, size(words), 1, error)
      if (allocated(error)) return
      call to_real(words(1)%text, value, status)
      if (status /= 0) call self%failure('holds "'//words(1)%text// &
                                         '", expected a finite number', error)
   end subroutine next_value

   !> Nothing but blank lines and comments may follow.
   subroutine expect_end(self, error)
      class(line_reader), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: words(:)

      call self%get_words(words, error)
      if (allocated(error)) return
      if (size(words) > 0) call self%failure('follows after the last value that the size line '// &
                                             'announces', error)
   end subroutine expect_end

   !> Raise an error: `text` continues "<file>: line <number> ".
   subroutine failure(self, text, error)
      class(line_reader), intent(in) :: self
      character(*), intent(in) :: text
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, self%path//': line '//to_text(self%line)//' '//text, status_input)
   end subroutine failure

   !> As next, but without words at the end of the file.
   subroutine get_words(self, words, error, comments)
      class(line_reader), intent(inout) :: self
      type(string_type), allocatable, intent(out) :: words(:)
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: comments
      character(line_length) :: text
      logical :: pass_over
      integer :: status

      pass_over = .true.
      if (present(comments)) pass_over = comments
      do
         read (self%unit, '(a)', iostat=status) text
         if (status == iostat_end) then
            if (allocated(words)) deallocate (words) ! of a blank line
            allocate (words(0))
            return
         end if
         self%line = self%line + 1
         ! A letter in the spare place: the line goes on.
         if (status /= 0 .or. text(line_length:) /= ' ') then
            call self%failure('cannot be read (not text, or longer than 1024 characters)', error)
            return
         end if
         if (pass_over .and. text(1:1) == '%') cycle
         call split(text, words)
         if (size(words) > 0) return
      end do
   end subroutine get_words

   !> Refuse a line with more or fewer words than expected.
   subroutine check_count(self, found, expected, error)
      class(line_reader), intent(in) :: self
      integer, intent(in) :: found, expected
      type(error_type), allocatable, intent(out) :: error

      if (found /= expected) call self%failure('has '//to_text(found)//' values, expected '// &
                                               to_text(expected), error)
   end subroutine check_count

   !> Words between blanks, tabs and carriage returns.
   pure subroutine split(text, words)
      character(*), intent(in) :: text
      type(string_type), allocatable, intent(out) :: words(:)
      ! More than any line has: what is behind them is too much all the same.
      integer, parameter :: most = 8
      character(*), parameter :: blanks = ' '//achar(9)//achar(13)
      integer :: n, start, length, first(most), last(most)

      n = 0
      start = 1
      do while (n < most .and. start <= len(text))
         ! `verify` finds where the next word begins, `scan` the blank behind it.
         length = verify(text(start:), blanks)
         if (length == 0) exit
         n = n + 1
         first(n) = start + length - 1
         length = scan(text(first(n):), blanks)
         last(n) = merge(first(n) + length - 2, len(text), length > 0)
         start = last(n) + 1
      end do
      allocate (words(n))
      do start = 1, n
         words(start)%text = text(first(start):last(start))
      end do
   end subroutine split

   !> A whole number; status /= 0 where the word is none.
   pure subroutine to_integer(word, number, status)
      character(*), intent(in) :: word
      integer, intent(out) :: number, status

      number = 0
      status = verify(word, '+-0123456789')
      ! allow(C181): the caller does
      if (status == 0) read (word, *, iostat=status) number
   end subroutine to_integer

   !> A finite number; status /= 0 where the word is none.
   pure subroutine to_real(word, number, status)
      character(*), intent(in) :: word
      real(wp), intent(out) :: number
      integer, intent(out) :: status
      logical :: halting

      number = 0.0_wp
      status = verify(word, '+-.0123456789eEdD')
      if (status /= 0) return
      ! '1e999' is an error in the file, even where the program traps overflows of its own.
      call ieee_get_halting_mode(ieee_overflow, halting)
      call ieee_set_halting_mode(ieee_overflow, .false.)
      read (word, *, iostat=status) number
      call ieee_set_flag(ieee_overflow, .false.)
      call ieee_set_halting_mode(ieee_overflow, halting)
      if (status == 0 .and. .not. ieee_is_finite(number)) status = 1
   end subroutine to_real

end module fw_matrix_market_lines
