!> Namelist values as numbers, numbers as namelist text, and ranges in words.
!>
!> Text is checked letter by letter before it is read: a list-directed READ would take '2*3', '/' or
!> nothing at all for a number. Numbers are written so that they read back to the same bits.
module fw_values
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_set_flag, &
      ieee_set_halting_mode, ieee_usual
   use fw_key_range, only: range_type
   use fw_kinds, only: wp
   use fw_namelist_data, only: value_type
   use fw_text, only: lower_case, to_text
   implicit none (type, external)
   private

   public :: read_real, read_integer, read_logical, read_number
   public :: real_kind, integer_kind, kind_name, kind_text
   public :: number_text, quoted_text, range_text

   !> The kinds of numbers, as what is accepted.
   character(*), parameter :: real_kind = 'a finite real', integer_kind = 'an integer'

contains

   !> What a range accepts, in words: `a finite real above 0`.
   function range_text(of, range) result(text)
      !> `a finite real`, `an integer` or the like.
      character(*), intent(in) :: of
      type(range_type), intent(in) :: range
      character(:), allocatable :: text, kind
      logical :: has_least, has_most

      has_least = range%least > -huge(1.0_wp)
      has_most = range%most < huge(1.0_wp)
      kind = of
      if (range%whole) kind = 'a whole number'
      text = kind
      ! In the order in which one says it: above or at least, then below or at most.
      if (range%above > -huge(1.0_wp)) text = text//' above '//number_text(range%above)
      if (has_least .and. has_most) then
         text = kind//' from '//number_text(range%least)//' to '//number_text(range%most)
      else if (has_least) then
         text = kind//' of at least '//number_text(range%least)
      else if (has_most) then
         text = text//' and at most '//number_text(range%most)
      end if
      if (len_trim(range%within) > 0 .and. .not. has_most) then
         text = text//' within +-'//trim(range%within)
      end if
      if (range%below < huge(1.0_wp)) text = text//' and below '//number_text(range%below)
   end function range_text

   !> A finite real; Fortran d-exponents are understood.
   subroutine read_real(text, number, ok)
      character(*), intent(in) :: text
      real(wp), intent(out) :: number
      logical, intent(out) :: ok
      character(:), allocatable :: lower
      logical :: halting(size(ieee_usual))
      integer :: mark, status

      number = 0.0_wp
      lower = lower_case(text)
      mark = scan(lower, 'edq')
      ! 1d-3 and 1q-3 are what Fortran programs write.
      if (mark > 0) lower(mark:mark) = 'e'
      ok = is_decimal(lower(:merge(mark - 1, len(lower), mark > 0)))
      if (ok .and. mark > 0) ok = is_whole(lower(mark + 1:))
      if (.not. ok) return
      ! A literal beyond the range raises overflow in the run-time library: a host program that
      ! traps it must not end here, for it gets a message instead.
      call ieee_get_halting_mode(ieee_usual, halting)
      call ieee_set_halting_mode(ieee_usual, .false.)
      read (lower, *, iostat=status) number
      call ieee_set_flag(ieee_usual, .false.)
      call ieee_set_halting_mode(ieee_usual, halting)
      ok = status == 0 .and. ieee_is_finite(number)
   end subroutine read_real

   !> A whole number that fits 32 bits; more than that is no number here.
   subroutine read_integer(text, number, ok)
      character(*), intent(in) :: text
      integer, intent(out) :: number
      logical, intent(out) :: ok
      integer :: status

      number = 0
      ok = is_whole(text)
      if (.not. ok) return
      read (text, *, iostat=status) number
      ok = status == 0
   end subroutine read_integer

   !> What a namelist READ takes for a truth value, and no other words that begin with t or f.
   subroutine read_logical(text, flag, ok)
      character(*), intent(in) :: text
      logical, intent(out) :: flag
      logical, intent(out) :: ok

      flag = .false.
      ok = .true.
      select case (lower_case(text))
      case ('.true.', 't', 'true', '.t.')
         flag = .true.
      case ('.false.', 'f', 'false', '.f.')
         flag = .false.
      case default
         ok = .false.
      end select
   end subroutine read_logical

   !> The shortest usual text that reads back to the same bits.
   function number_text(number) result(text)
      real(wp), intent(in) :: number
      character(:), allocatable :: text
      ! Digits: six where they are enough, then up to the 17 that always are.
      integer, parameter :: trials(*) = [6, 15, 16, 17]
      real(wp), parameter :: whole_up_to = 1.0e6_wp
      character(40) :: buffer, form
      real(wp) :: back
      logical :: ok
      integer :: i

      ! Only for messages: no key takes it.
      if (.not. ieee_is_finite(number)) then
         write (buffer, *) number
         text = trim(adjustl(buffer))
         return
      end if
      ! Most numbers are small and whole, and need no trial; the sign of a zero is to be kept.
      if (abs(number) < whole_up_to .and. abs(number - anint(number)) <= 0.0_wp .and. &
          (abs(number) >= 1.0_wp .or. sign(1.0_wp, number) > 0.0_wp)) then
         text = to_text(nint(number))
         return
      end if
      do i = 1, size(trials)
         write (form, '(a, i0, a)') '(es40.', trials(i) - 1, 'e3)'
         write (buffer, form) number
         ! The largest numbers, rounded to few digits, lie beyond the range.
         call read_real(trim(adjustl(buffer)), back, ok)
         if (.not. ok) cycle
         if (abs(back - number) <= 0.0_wp) exit
      end do
      text = plain_text(adjustl(buffer))
   end function number_text

   !> `1.250000E-002` as `0.0125`, `1.000000E-008` as `1e-8`.
   function plain_text(scientific) result(text)
      character(*), intent(in) :: scientific
      character(:), allocatable :: text
      character(:), allocatable :: sign, digits
      integer :: mark, exponent

      mark = index(scientific, 'E')
      sign = scientific(:merge(1, 0, scientific(1:1) == '-'))
      digits = scientific(len(sign) + 1:len(sign) + 1)//scientific(len(sign) + 3:mark - 1)
      ! Zeros at the end are needless.
      digits = digits(:max(1, verify(digits, '0', back=.true.)))
      read (scientific(mark + 1:), *) exponent
      ! As one would write it by hand, up to a million and down to a thousandth.
      if (exponent >= 0 .and. exponent < 7) then
         if (len(digits) < exponent + 1) digits = digits//repeat('0', exponent + 1 - len(digits))
         text = sign//digits(:exponent + 1)
         if (len(digits) > exponent + 1) text = text//'.'//digits(exponent + 2:)
      else if (exponent < 0 .and. exponent > -4) then
         text = sign//'0.'//repeat('0', -exponent - 1)//digits
      else
         text = sign//digits(1:1)
         if (len(digits) > 1) text = text//'.'//digits(2:)
         text = text//'e'//to_text(exponent)
      end if
   end function plain_text

   !> A text in quotes, as a namelist wants it.
   pure function quoted_text(text) result(quoted)
      character(*), intent(in) :: text
      character(:), allocatable :: quoted
      integer :: i

      quoted = "'"
      do i = 1, len(text)
         quoted = quoted//text(i:i)
         if (text(i:i) == "'") quoted = quoted//"'"
      end do
      quoted = quoted//"'"
   end function quoted_text

   !> Digits with at most one point and a sign before them.
   pure logical function is_decimal(text)
      character(*), intent(in) :: text
      integer :: point

      point = index(text, '.')
      if (point == 0) then
         is_decimal = is_whole(text)
      else
         is_decimal = is_whole(text(:point - 1)//'0'//text(point + 1:)) &
                      .and. scan(text, '0123456789') > 0
      end if
   end function is_decimal

   !> Digits with a sign before them or none.
   pure logical function is_whole(text)
      character(*), intent(in) :: text
      integer :: first

      is_whole = .false.
      if (len(text) == 0) return
      first = merge(2, 1, scan(text(1:1), '+-') > 0)
      if (first > len(text)) return
      is_whole = verify(text(first:), '0123456789') == 0
   end function is_whole

   !> A value as a number of a kind and within a range.
   subroutine read_number(value, kind, range, number, ok)
      type(value_type), intent(in) :: value
      character(*), intent(in) :: kind
      type(range_type), intent(in) :: range
      real(wp), intent(out) :: number
      logical, intent(out) :: ok
      integer :: whole

      if (kind == integer_kind) then
         call read_integer(value%text, whole, ok)
         number = real(whole, wp)
      else
         call read_real(value%text, number, ok)
      end if
      if (ok) ok = range%holds(number) .and. .not. value%quoted
   end subroutine read_number

   !> The kind as the list of keys calls it.
   pure character(7) function kind_name(kind)
      character(*), intent(in) :: kind

      kind_name = merge('integer', 'real   ', kind == integer_kind)
   end function kind_name

   !> A number of a kind as namelist text.
   function kind_text(number, kind) result(text)
      real(wp), intent(in) :: number
      character(*), intent(in) :: kind
      character(:), allocatable :: text

      if (kind == integer_kind) then
         text = to_text(nint(number))
      else
         text = number_text(number)
      end if
   end function kind_text

end module fw_values
