!> Units by their names, as factors to SI and powers of length, mass and time. Angles have no
!> dimension, but hertz are 2 pi rad/s and revolutions 2 pi rad: 1 Hz is never 1 rad/s.
!>
!> Names and prefixes are those of pint, of which this is a part: a test takes every name of the
!> table with every prefix to pint, and what pint reads otherwise is not read here.
module fw_unit_table
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: unit_type, read_unit, is_same_kind

   !> A unit, or a product of them.
   type :: unit_type
      !> What one of it is in metres, kilograms, seconds and radians.
      real(wp) :: factor = 1.0_wp
      !> Powers of length, mass and time; angles have none, so that a rate is 1/s, rad/s or Hz.
      integer :: powers(3) = 0
   end type unit_type

   !> One line of the table.
   type :: named_unit
      character(24) :: name
      real(wp) :: factor
      integer :: powers(3)
      !> Whether prefixes go before it: of letters before symbols, of words before words.
      logical :: takes_symbols = .false., takes_words = .false.
   end type named_unit

   !> A power of ten before a unit.
   type :: prefix_type
      character(5) :: symbol, word
      integer :: power
   end type prefix_type

   real(wp), parameter :: turn = 8.0_wp*atan(1.0_wp), inch = 0.0254_wp, foot = 0.3048_wp, &
                          pound = 0.45359237_wp, gravity = 9.80665_wp
   !> Powers of ten that a factor to SI has at most.
   real(wp), parameter :: most_digits = 100.0_wp
   logical, parameter :: yes = .true., no = .false.
   ! Powers of metre, kilogram and second in each kind of quantity.
   integer, parameter :: none(3) = 0, length(3) = [1, 0, 0], mass(3) = [0, 1, 0], &
                         time(3) = [0, 0, 1], rate(3) = [0, 0, -1], force(3) = [1, 1, -2], &
                         pressure(3) = [-1, 1, -2], energy(3) = [2, 1, -2], power(3) = [2, 1, -3]

   ! In UTF-8; Unicode has two letters for micro.
   character(*), parameter :: micro_sign = char(194)//char(181), mu_letter = char(206)//char(188), &
                              degree_sign = char(194)//char(176)

   ! Those of mechanics, metric and customary. Where a prefix would make a name that means
   ! something else (pt is a pint, not a picotonne), the unit takes none.
   type(named_unit), parameter :: units(*) = [ &
      named_unit('m', 1.0_wp, length, yes), named_unit('meter', 1.0_wp, length, no, yes), &
      named_unit('metre', 1.0_wp, length, no, yes), named_unit('micron', 1.0e-6_wp, length), &
      named_unit('in', inch, length), named_unit('inch', inch, length), &
      named_unit('thou', 1.0e-3_wp*inch, length), named_unit('ft', foot, length), &
      named_unit('foot', foot, length), &
      named_unit('g', 1.0e-3_wp, mass, yes), named_unit('gram', 1.0e-3_wp, mass, no, yes), &
      named_unit('t', 1.0e3_wp, mass), named_unit('tonne', 1.0e3_wp, mass), &
      named_unit('metric_ton', 1.0e3_wp, mass), named_unit('lb', pound, mass), &
      named_unit('pound', pound, mass), named_unit('slug', pound*gravity/foot, mass), &
      named_unit('slinch', 12.0_wp*pound*gravity/foot, mass), &
      named_unit('s', 1.0_wp, time, yes), named_unit('second', 1.0_wp, time, no, yes), &
      named_unit('min', 60.0_wp, time), named_unit('minute', 60.0_wp, time), &
      named_unit('h', 3600.0_wp, time), named_unit('hr', 3600.0_wp, time), &
      named_unit('hour', 3600.0_wp, time), named_unit('d', 86400.0_wp, time), &
      named_unit('day', 86400.0_wp, time), &
      named_unit('N', 1.0_wp, force, yes), named_unit('newton', 1.0_wp, force, no, yes), &
      named_unit('lbf', pound*gravity, force), named_unit('pound_force', pound*gravity, force), &
      named_unit('kip', 1.0e3_wp*pound*gravity, force), named_unit('kgf', gravity, force), &
      named_unit('dyn', 1.0e-5_wp, force), named_unit('dyne', 1.0e-5_wp, force), &
      named_unit('Pa', 1.0_wp, pressure, yes), named_unit('pascal', 1.0_wp, pressure, no, yes), &
      named_unit('bar', 1.0e5_wp, pressure), &
      named_unit('psi', pound*gravity/inch**2, pressure), &
      named_unit('ksi', 1.0e3_wp*pound*gravity/inch**2, pressure), &
      named_unit('J', 1.0_wp, energy, yes), named_unit('joule', 1.0_wp, energy, no, yes), &
      named_unit('W', 1.0_wp, power, yes), named_unit('watt', 1.0_wp, power, no, yes), &
      named_unit('Hz', turn, rate, yes), named_unit('hertz', turn, rate, no, yes), &
      named_unit('rpm', turn/60.0_wp, rate), &
      named_unit('revolutions_per_minute', turn/60.0_wp, rate), &
      named_unit('rad', 1.0_wp, none, yes), named_unit('radian', 1.0_wp, none, no, yes), &
      named_unit('deg', turn/360.0_wp, none), named_unit('degree', turn/360.0_wp, none), &
      named_unit('turn', turn, none), named_unit('revolution', turn, none), &
      named_unit(degree_sign, turn/360.0_wp, none), &
      named_unit('dimensionless', 1.0_wp, none), named_unit('1', 1.0_wp, none)]

   ! Larger and smaller ones are more likely a slip of the finger than a force or a gap.
   type(prefix_type), parameter :: prefixes(*) = [ &
      prefix_type('p', 'pico', -12), prefix_type('n', 'nano', -9), &
      prefix_type('u', 'micro', -6), prefix_type(micro_sign, 'micro', -6), &
      prefix_type(mu_letter, 'micro', -6), prefix_type('m', 'milli', -3), &
      prefix_type('c', 'centi', -2), prefix_type('d', 'deci', -1), prefix_type('k', 'kilo', 3), &
      prefix_type('M', 'mega', 6), prefix_type('G', 'giga', 9)]

contains

   !> A product of units such as `N/mm^2`, `kg*m/s**2`, `N s/mm`, from left to right.
   subroutine read_unit(text, unit, ok, system)
      character(*), intent(in) :: text
      type(unit_type), intent(out) :: unit
      !> False where a part of it is not known.
      logical, intent(out) :: ok
      !> Units of a model in which L, M, s and F of a key are.
      type(unit_type), intent(in), optional :: system(4)
      type(unit_type) :: part
      integer :: at, last, power, sign

      at = 1
      sign = 1
      ok = len_trim(text) > 0
      do while (ok)
         at = next(text, at)
         ! The name ends where a blank or a sign stands.
         last = scan(text(at:)//' ', ' */^') + at - 2
         call find_unit(text(at:last), part, ok, system)
         if (.not. ok) return
         call read_power(text, last + 1, power, at, ok)
         ! Powers may be absurd, and nothing here may overflow.
         ok = ok .and. abs(log10(unit%factor) + sign*power*log10(part%factor)) < most_digits
         if (.not. ok) return
         unit%factor = unit%factor*part%factor**(sign*power)
         unit%powers = unit%powers + sign*power*part%powers
         at = next(text, at)
         if (at > len(text)) return
         ! Nothing between two units is a product.
         sign = merge(-1, 1, text(at:at) == '/')
         if (scan(text(at:at), '*/') > 0) at = at + 1
         ! A sign with nothing behind it is no unit.
         ok = next(text, at) <= len(text)
      end do
   end subroutine read_unit

   !> The place of the next letter that is no blank.
   pure integer function next(text, at)
      character(*), intent(in) :: text
      integer, intent(in) :: at

      next = len(text) + 1
      if (at > len(text)) return
      if (verify(text(at:), ' ') > 0) next = at + verify(text(at:), ' ') - 1
   end function next

   !> The whole power behind a unit, after ^ or **; 1 where there is none.
   pure subroutine read_power(text, from, power, at, ok)
      character(*), intent(in) :: text
      integer, intent(in) :: from
      integer, intent(out) :: power
      !> Behind it.
      integer, intent(out) :: at
      logical, intent(out) :: ok
      integer :: first, last, status

      power = 1
      ok = .true.
      at = next(text, from)
      if (at > len(text)) return
      if (text(at:at) == '^') then
         first = next(text, at + 1)
      else if (text(at:min(at + 1, len(text))) == '**') then
         first = next(text, at + 2)
      else
         return
      end if
      last = first
      ! A sign, then digits.
      do while (last <= len(text))
         if (verify(text(last:last), '0123456789') > 0 .and. &
             .not. (last == first .and. scan(text(last:last), '+-') > 0)) exit
         last = last + 1
      end do
      at = last
      ! More digits than this are no power of a unit.
      ok = last > first .and. last - first <= 3
      if (.not. ok) return
      read (text(first:last - 1), *, iostat=status) power
      ok = status == 0
   end subroutine read_power

   !> One unit by its name, with a prefix or in the plural.
   subroutine find_unit(name, unit, ok, system)
      character(*), intent(in) :: name
      type(unit_type), intent(out) :: unit
      logical, intent(out) :: ok
      type(unit_type), intent(in), optional :: system(4)
      character(*), parameter :: of_model = 'LMsF'
      integer :: n

      ok = .true.
      n = len(name)
      if (present(system) .and. n == 1) then
         if (index(of_model, name) > 0) then
            unit = system(index(of_model, name))
            return
         end if
      end if
      call find_prefixed(name, unit, ok)
      ! Words, and no symbols, have a plural: ms are not m.
      if (.not. ok .and. n > 4) then
         if (name(n:n) == 's') call find_prefixed(name(:n - 1), unit, ok)
      end if
   end subroutine find_unit

   !> One unit by its name, in the singular.
   subroutine find_prefixed(name, unit, ok)
      character(*), intent(in) :: name
      type(unit_type), intent(out) :: unit
      logical, intent(out) :: ok
      integer :: i, k

      ! What is a unit by itself has no prefix: min is no milli-inch.
      i = findloc(units%name == name .and. len_trim(name) == len(name), .true., dim=1)
      ok = i > 0
      if (ok) unit = unit_type(units(i)%factor, units(i)%powers)
      if (ok) return
      do i = 1, size(units)
         do k = 1, size(prefixes)
            ok = (units(i)%takes_symbols .and. &
                  name == trim(prefixes(k)%symbol)//trim(units(i)%name)) .or. &
                 (units(i)%takes_words .and. &
                  name == trim(prefixes(k)%word)//trim(units(i)%name))
            if (.not. ok) cycle
            unit = unit_type(units(i)%factor*10.0_wp**prefixes(k)%power, units(i)%powers)
            return
         end do
      end do
   end subroutine find_prefixed

   !> Whether one can be counted in the other.
   pure logical function is_same_kind(one, other)
      type(unit_type), intent(in) :: one, other

      is_same_kind = all(one%powers == other%powers)
   end function is_same_kind

end module fw_unit_table
