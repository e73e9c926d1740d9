!> Stand-in for the part of pFUnit that the tests in test/unit use. It is not pFUnit: where that
!> is installed the build takes it, and the same files run under either. Same module name, same
!> assertion names, argument names and meaning (Assert_*.tmpl of pFUnit 4): expected comes
!> first, |found - expected| <= tolerance passes, a NaN never passes, equal infinities do.
!>
!> The counters are module variables, which the library itself never has: a test program is one
!> thread and pFUnit's own interface (anyExceptions without arguments) leaves no other place.
module funit
   use, intrinsic :: iso_fortran_env, only: output_unit, real64, int64
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_is_finite
   implicit none (type, external)
   private

   public :: SourceLocation, anyExceptions
   public :: assertFail, assertTrue, assertFalse, assertEqual, assertNotEqual
   public :: assertLessThan, assertLessThanOrEqual, assertGreaterThan, assertGreaterThanOrEqual
   public :: assertRelativelyEqual, assertIsNaN, assertIsFinite
   public :: standin_begin, standin_end, standin_finish

   integer, parameter :: wp = real64

   !> File and line of an assertion.
   type :: SourceLocation
      character(100) :: file = 'unknown'
      integer :: line = 0
   end type SourceLocation

   interface assertTrue
      module procedure true_scalar
      module procedure true_vector
   end interface assertTrue

   interface assertFalse
      module procedure false_scalar
      module procedure false_vector
   end interface assertFalse

   interface assertEqual
      module procedure equal_real
      module procedure equal_real_exact
      module procedure equal_complex
      module procedure equal_complex_exact
      module procedure equal_integer
      module procedure equal_integer_8
      module procedure equal_logical
      module procedure equal_text
   end interface assertEqual

   interface assertRelativelyEqual
      module procedure relatively_equal
   end interface assertRelativelyEqual

   interface assertNotEqual
      module procedure not_equal_real
      module procedure not_equal_integer
   end interface assertNotEqual

   interface assertLessThan
      module procedure less_real
      module procedure less_integer
   end interface assertLessThan

   interface assertLessThanOrEqual
      module procedure less_equal_real
      module procedure less_equal_integer
   end interface assertLessThanOrEqual

   interface assertGreaterThan
      module procedure greater_real
      module procedure greater_integer
   end interface assertGreaterThan

   interface assertGreaterThanOrEqual
      module procedure greater_equal_real
      module procedure greater_equal_integer
   end interface assertGreaterThanOrEqual

   !> An array of any rank up to 3 as a list, so that each comparison is written once.
   interface flat
      module procedure flat_real
      module procedure flat_complex
      module procedure flat_integer
      module procedure flat_integer_8
   end interface flat

   integer :: n_passed = 0, n_failed = 0
   logical :: failing = .false.
   character(:), allocatable :: running

contains

   !> Has an assertion of the running test failed?
   logical function anyExceptions()
      anyExceptions = failing
   end function anyExceptions

   !> A test starts. Its name is shown at once, so that a crash names its test.
   subroutine standin_begin(name)
      character(*), intent(in) :: name

      running = name
      failing = .false.
      write (output_unit, '(a)') 'test '//name
      flush (output_unit)
   end subroutine standin_begin

   !> A test is over, its @after included.
   subroutine standin_end()
      if (failing) then
         n_failed = n_failed + 1
      else
         n_passed = n_passed + 1
      end if
   end subroutine standin_end

   !> The closing line. A run without any test counts as failed: it has shown nothing.
   subroutine standin_finish()
      write (output_unit, '(i0,a,i0,a)') n_passed, ' passed, ', n_failed, ' failed'
      flush (output_unit)
      if (n_failed > 0 .or. n_passed == 0) stop 1, quiet=.true.
   end subroutine standin_finish

   !> Record one verdict: where, the user's message, and what was found.
   subroutine check(passed, found, message, location)
      logical, intent(in) :: passed
      character(*), intent(in) :: found
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      character(:), allocatable :: line
      character(20) :: digits

      if (passed) return
      failing = .true.
      line = ''
      if (present(location)) then
         write (digits, '(i0)') location%line
         line = trim(location%file)//':'//trim(digits)//': '
      end if
      line = 'FAILED '//line//running//': '
      if (present(message)) line = line//trim(message)//' '
      write (output_unit, '(a)') line//found
      flush (output_unit)
   end subroutine check

   subroutine assertFail(message, location)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(.false., '(intentional failure)', message, location)
   end subroutine assertFail

   subroutine true_scalar(condition, message, location)
      logical, intent(in) :: condition
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(condition, '(expected true)', message, location)
   end subroutine true_scalar

   subroutine true_vector(condition, message, location)
      logical, intent(in) :: condition(:)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(all(condition), '(expected true)', message, location)
   end subroutine true_vector

   subroutine false_scalar(condition, message, location)
      logical, intent(in) :: condition
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(.not. condition, '(expected false)', message, location)
   end subroutine false_scalar

   subroutine false_vector(condition, message, location)
      logical, intent(in) :: condition(:)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(.not. any(condition), '(expected false)', message, location)
   end subroutine false_vector

   subroutine equal_real(expected, found, tolerance, message, location)
      real(wp), intent(in) :: expected(..), found(..)
      real(wp), intent(in) :: tolerance
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (.not. conformable(shape(expected), shape(found), message, location)) return
      call compare(cmplx(flat(expected), kind=wp), cmplx(flat(found), kind=wp), &
         & [tolerance], .false., message, location)
   end subroutine equal_real

   subroutine equal_real_exact(expected, found, message, location)
      real(wp), intent(in) :: expected(..), found(..)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call equal_real(expected, found, 0.0_wp, message, location)
   end subroutine equal_real_exact

   subroutine equal_complex(expected, found, tolerance, message, location)
      complex(wp), intent(in) :: expected(..), found(..)
      real(wp), intent(in) :: tolerance
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (.not. conformable(shape(expected), shape(found), message, location)) return
      call compare(flat(expected), flat(found), [tolerance], .true., message, location)
   end subroutine equal_complex

   subroutine equal_complex_exact(expected, found, message, location)
      complex(wp), intent(in) :: expected(..), found(..)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call equal_complex(expected, found, 0.0_wp, message, location)
   end subroutine equal_complex_exact

   !> |found - expected| <= tolerance * |expected|, pFUnit's relative comparison.
   subroutine relatively_equal(expected, found, tolerance, message, location)
      real(wp), intent(in) :: expected(..), found(..)
      real(wp), intent(in) :: tolerance
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (.not. conformable(shape(expected), shape(found), message, location)) return
      call compare(cmplx(flat(expected), kind=wp), cmplx(flat(found), kind=wp), &
         & tolerance*abs(flat(expected)), .false., message, location)
   end subroutine relatively_equal

   !> Compare two lists; a list of one expected value or tolerance holds for all. The first
   !> difference is shown. Nothing is subtracted or ordered before NaN and equal values are out
   !> of the way: a build that traps invalid operations must report a NaN, not die of it.
   subroutine compare(expected, found, tolerance, is_complex, message, location)
      complex(wp), intent(in) :: expected(:), found(:)
      real(wp), intent(in) :: tolerance(:)
      logical, intent(in) :: is_complex
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      complex(wp) :: e
      integer :: i

      do i = 1, size(found)
         e = expected(min(i, size(expected)))
         if (within(e, found(i), tolerance(min(i, size(tolerance))))) cycle
         call check(.false., 'expected '//number(e, is_complex)//', found ' &
            & //number(found(i), is_complex)//place(i, size(found))//', tolerance ' &
            & //real_text(tolerance(min(i, size(tolerance)))), message, location)
         return
      end do
   end subroutine compare

   pure logical function within(expected, found, tolerance)
      complex(wp), intent(in) :: expected, found
      real(wp), intent(in) :: tolerance

      within = .false.
      if (ieee_is_nan(real(expected)) .or. ieee_is_nan(aimag(expected))) return
      if (ieee_is_nan(real(found)) .or. ieee_is_nan(aimag(found))) return
      if (ieee_is_nan(tolerance)) return
      ! Infinities are equal, though their difference is no number.
      within = same(real(expected), real(found)) .and. same(aimag(expected), aimag(found))
      if (within) return
      if (.not. (ieee_is_finite(abs(expected)) .and. ieee_is_finite(abs(found)))) return
      within = abs(found - expected) <= tolerance
   end function within

   pure logical function same(a, b)
      real(wp), intent(in) :: a, b

      same = a <= b .and. a >= b
   end function same

   subroutine equal_integer(expected, found, message, location)
      integer, intent(in) :: expected(..), found(..)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (.not. conformable(shape(expected), shape(found), message, location)) return
      call compare_integer(int(flat(expected), int64), int(flat(found), int64), message, location)
   end subroutine equal_integer

   subroutine equal_integer_8(expected, found, message, location)
      integer(int64), intent(in) :: expected(..), found(..)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (.not. conformable(shape(expected), shape(found), message, location)) return
      call compare_integer(flat(expected), flat(found), message, location)
   end subroutine equal_integer_8

   subroutine compare_integer(expected, found, message, location)
      integer(int64), intent(in) :: expected(:), found(:)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      character(80) :: text
      integer :: i

      do i = 1, size(found)
         if (expected(min(i, size(expected))) == found(i)) cycle
         write (text, '(a,i0,a,i0)') 'expected ', expected(min(i, size(expected))), &
            & ', found ', found(i)
         call check(.false., trim(text)//place(i, size(found)), message, location)
         return
      end do
   end subroutine compare_integer

   subroutine equal_logical(expected, found, message, location)
      logical, intent(in) :: expected, found
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(expected .eqv. found, merge('expected true ', 'expected false', expected), &
         & message, location)
   end subroutine equal_logical

   !> Blanks at both ends do not count, as in pFUnit's default.
   subroutine equal_text(expected, found, message, location)
      character(*), intent(in) :: expected, found
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(trim(adjustl(expected)) == trim(adjustl(found)), &
         & 'expected "'//expected//'", found "'//found//'"', message, location)
   end subroutine equal_text

   subroutine not_equal_real(expected, found, message, location)
      real(wp), intent(in) :: expected, found
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(unequal(expected, found), 'both '//real_text(found), message, location)
   end subroutine not_equal_real

   !> A NaN fails here as well: pFUnit wants a difference that is known.
   pure logical function unequal(a, b)
      real(wp), intent(in) :: a, b
      unequal = .false.
      if (.not. ordered(a, b)) return
      unequal = a < b .or. b < a
   end function unequal

   subroutine not_equal_integer(expected, found, message, location)
      integer, intent(in) :: expected, found
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(expected /= found, 'both '//integer_text(found), message, location)
   end subroutine not_equal_integer

   subroutine less_real(a, b, message, location)
      real(wp), intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      logical :: passed

      passed = ordered(a, b)
      if (passed) passed = a < b
      call check(passed, real_text(a)//' is not less than '//real_text(b), message, location)
   end subroutine less_real

   subroutine less_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(a < b, integer_text(a)//' is not less than '//integer_text(b), &
         & message, location)
   end subroutine less_integer

   subroutine less_equal_real(a, b, message, location)
      real(wp), intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      logical :: passed

      passed = ordered(a, b)
      if (passed) passed = a <= b
      call check(passed, real_text(a)//' is greater than '//real_text(b), message, location)
   end subroutine less_equal_real

   subroutine less_equal_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(a <= b, integer_text(a)//' is greater than '//integer_text(b), &
         & message, location)
   end subroutine less_equal_integer

   subroutine greater_real(a, b, message, location)
      real(wp), intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      logical :: passed

      passed = ordered(a, b)
      if (passed) passed = a > b
      call check(passed, real_text(a)//' is not greater than '//real_text(b), message, location)
   end subroutine greater_real

   subroutine greater_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(a > b, integer_text(a)//' is not greater than '//integer_text(b), &
         & message, location)
   end subroutine greater_integer

   subroutine greater_equal_real(a, b, message, location)
      real(wp), intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      logical :: passed

      passed = ordered(a, b)
      if (passed) passed = a >= b
      call check(passed, real_text(a)//' is less than '//real_text(b), message, location)
   end subroutine greater_equal_real

   subroutine greater_equal_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(a >= b, integer_text(a)//' is less than '//integer_text(b), message, location)
   end subroutine greater_equal_integer

   subroutine assertIsNaN(x, message, location)
      real(wp), intent(in) :: x
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(ieee_is_nan(x), real_text(x)//' is a number', message, location)
   end subroutine assertIsNaN

   subroutine assertIsFinite(x, message, location)
      real(wp), intent(in) :: x
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      call check(ieee_is_finite(x), real_text(x)//' is not finite', message, location)
   end subroutine assertIsFinite

   !> Neither is a NaN: ordering one is an invalid operation, which may be trapped.
   pure logical function ordered(a, b)
      real(wp), intent(in) :: a, b
      ordered = .not. (ieee_is_nan(a) .or. ieee_is_nan(b))
   end function ordered

   !> An expected scalar fits every shape; otherwise the shapes must agree.
   logical function conformable(expected, found, message, location)
      integer, intent(in) :: expected(:), found(:)
      character(*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      character(120) :: text

      conformable = size(expected) == 0
      if (conformable) return
      conformable = size(expected) == size(found)
      if (conformable) conformable = all(expected == found)
      if (conformable) return
      write (text, '(*(g0,1x))') 'expected shape', expected, 'found shape', found
      call check(.false., trim(text), message, location)
   end function conformable

   function flat_real(x) result(list)
      real(wp), intent(in) :: x(..)
      real(wp), allocatable :: list(:)

      select rank (x)
      rank (0)
         list = [x]
      rank (1)
         list = x
      rank (2)
         list = reshape(x, [size(x)])
      rank (3)
         list = reshape(x, [size(x)])
      rank default
         error stop 'stand-in for funit: assertions take arrays of rank 3 at most'
      end select
   end function flat_real

   function flat_complex(x) result(list)
      complex(wp), intent(in) :: x(..)
      complex(wp), allocatable :: list(:)

      select rank (x)
      rank (0)
         list = [x]
      rank (1)
         list = x
      rank (2)
         list = reshape(x, [size(x)])
      rank (3)
         list = reshape(x, [size(x)])
      rank default
         error stop 'stand-in for funit: assertions take arrays of rank 3 at most'
      end select
   end function flat_complex

   function flat_integer(x) result(list)
      integer, intent(in) :: x(..)
      integer, allocatable :: list(:)

      select rank (x)
      rank (0)
         list = [x]
      rank (1)
         list = x
      rank (2)
         list = reshape(x, [size(x)])
      rank (3)
         list = reshape(x, [size(x)])
      rank default
         error stop 'stand-in for funit: assertions take arrays of rank 3 at most'
      end select
   end function flat_integer

   function flat_integer_8(x) result(list)
      integer(int64), intent(in) :: x(..)
      integer(int64), allocatable :: list(:)

      select rank (x)
      rank (0)
         list = [x]
      rank (1)
         list = x
      rank (2)
         list = reshape(x, [size(x)])
      rank (3)
         list = reshape(x, [size(x)])
      rank default
         error stop 'stand-in for funit: assertions take arrays of rank 3 at most'
      end select
   end function flat_integer_8

   !> Which element differs (column-major position); nothing for a scalar.
   pure function place(i, n) result(text)
      integer, intent(in) :: i, n
      character(:), allocatable :: text

      text = ''
      if (n > 1) text = ' at element '//integer_text(i)//' of '//integer_text(n)
   end function place

   pure function integer_text(i) result(text)
      integer, intent(in) :: i
      character(:), allocatable :: text
      character(20) :: digits

      write (digits, '(i0)') i
      text = trim(digits)
   end function integer_text

   pure function real_text(x) result(text)
      real(wp), intent(in) :: x
      character(:), allocatable :: text
      character(40) :: digits

      write (digits, '(g0)') x
      text = trim(digits)
   end function real_text

   pure function number(x, is_complex) result(text)
      complex(wp), intent(in) :: x
      logical, intent(in) :: is_complex
      character(:), allocatable :: text

      text = real_text(real(x, wp))
      if (is_complex) text = '('//text//', '//real_text(aimag(x))//')'
   end function number

end module funit
