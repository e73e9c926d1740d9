!> Numbers in fields of fixed length: what `to_text` takes the length of its result from.
!>
!> A module of its own, because gfortran sees no explicit interface in a function that a length is
!> declared with where both are in one module.
module fw_number_field
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: integer_field, real_field

   !> Room for any number.
   integer, parameter :: field_length = 32

contains

   !> An integer at the left of its field. Digit by digit: a `write` takes ten times as long, and
   !> texts of a case hold thousands.
   pure function integer_field(number) result(field)
      integer, intent(in) :: number
      character(field_length) :: field
      character(field_length) :: digits
      integer :: first, rest

      rest = number
      do first = field_length, 2, -1
         ! The remainder has the sign of the number: there is no absolute value of the least one.
         digits(first:first) = achar(iachar('0') + abs(mod(rest, 10)))
         rest = rest/10
         if (rest == 0) exit
      end do
      if (number >= 0) then
         field = digits(first:)
      else
         field = '-'//digits(first:)
      end if
   end function integer_field

   !> A real that reads back to the same bits, without needless digits, at the left of its field.
   pure function real_field(number) result(field)
      real(wp), intent(in) :: number
      character(field_length) :: field
      real(wp) :: back
      integer :: status

      write (field, '(g0.6)') number
      field = adjustl(field)
      if (.not. ieee_is_finite(number)) return
      read (field, *, iostat=status) back
      if (status == 0 .and. abs(back - number) <= 0.0_wp) return
      write (field, '(es24.16e3)') number
      field = adjustl(field)
   end function real_field

end module fw_number_field
