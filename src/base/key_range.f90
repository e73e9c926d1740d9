!> What the number of a key may be: `above(0.0_wp) .and. below(1.0_wp)`, `from_to(1, 99)`.
!>
!> A range is a value that declarations of keys put together and that one procedure tests, so that
!> the reader, the list of keys and the documents tell the same. NaN and infinities hold in no
!> range.
module fw_key_range
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: range_type
   public :: above, at_least, at_most, below, from_to, dof_numbers, side_numbers, whole
   public :: operator(.and.)

   !> What a number may be; a bound that is huge does not bind.
   type :: range_type
      !> Strict bounds.
      real(wp) :: above = -huge(1.0_wp), below = huge(1.0_wp)
      !> Bounds that the number may take.
      real(wp) :: least = -huge(1.0_wp), most = huge(1.0_wp)
      !> Name of the size that bounds the number on either side of 0, or blank.
      !> The bound itself is known only with the model, so the reader tests it, not `holds`.
      character(16) :: within = ''
      !> Whether a real has to be a whole number.
      logical :: whole = .false.
   contains
      procedure :: holds
   end type range_type

   interface at_least
      module procedure at_least_real
      module procedure at_least_integer
   end interface at_least

   interface from_to
      module procedure from_to_real
      module procedure from_to_integer
   end interface from_to

   !> Both ranges.
   interface operator(.and.)
      module procedure both
   end interface operator(.and.)

contains

   !> Any number larger than this one.
   pure type(range_type) function above(number) result(range)
      real(wp), intent(in) :: number

      range%above = number
   end function above

   !> Any number smaller than this one.
   pure type(range_type) function below(number) result(range)
      real(wp), intent(in) :: number

      range%below = number
   end function below

   !> This number or larger.
   pure type(range_type) function at_least_real(number) result(range)
      real(wp), intent(in) :: number

      range%least = number
   end function at_least_real

   !> Ranges are of reals throughout: whole numbers in use are exact in them.
   pure type(range_type) function at_least_integer(number) result(range)
      integer, intent(in) :: number

      range%least = real(number, wp)
   end function at_least_integer

   !> This number or smaller.
   pure type(range_type) function at_most(number) result(range)
      real(wp), intent(in) :: number

      range%most = number
   end function at_most

   !> Both ends included.
   pure type(range_type) function from_to_real(least, most) result(range)
      real(wp), intent(in) :: least, most

      range%least = least
      range%most = most
   end function from_to_real

   pure type(range_type) function from_to_integer(least, most) result(range)
      integer, intent(in) :: least, most

      range = from_to_real(real(least, wp), real(most, wp))
   end function from_to_integer

   !> Numbers of dofs, negative for those whose sign is turned.
   !> 0 stands for the ground; what counts as a dof is known with the model only.
   pure type(range_type) function dof_numbers() result(range)
      range%within = 'n_dof'
   end function dof_numbers

   !> Numbers of dofs, or of rows of the model, which follow them.
   pure type(range_type) function side_numbers() result(range)
      range%within = '(n_dof+n_rows)'
   end function side_numbers

   !> Both ends included, and nothing between whole numbers.
   pure type(range_type) function whole(least, most) result(range)
      integer, intent(in) :: least, most

      range = from_to_integer(least, most)
      range%whole = .true.
   end function whole

   !> The narrower of each bound; the name of a size is the first one's.
   pure type(range_type) function both(first, second) result(range)
      type(range_type), intent(in) :: first, second

      range%above = max(first%above, second%above)
      range%below = min(first%below, second%below)
      range%least = max(first%least, second%least)
      range%most = min(first%most, second%most)
      range%within = first%within
      range%whole = first%whole .or. second%whole
   end function both

   !> Whether a number is in the range, `within` aside.
   pure logical function holds(self, number)
      class(range_type), intent(in) :: self
      real(wp), intent(in) :: number

      ! By itself: comparisons with what is no number may trap.
      holds = ieee_is_finite(number)
      if (.not. holds) return
      holds = number > self%above .and. number >= self%least .and. number <= self%most
      if (self%whole) holds = holds .and. abs(number - anint(number)) <= 0.0_wp
      ! Tested only where it binds: huge(1.0) itself is a number below no bound.
      if (self%below < huge(1.0_wp)) holds = holds .and. number < self%below
   end function holds

end module fw_key_range
