!> What a sweep goes over in place of the frequency: a parameter of the case, at one frequency.
module fw_parameter_sweep
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above
   use fw_kinds, only: wp
   use fw_parameters, only: parameter_words
   implicit none (type, external)
   private

   public :: parameter_sweep, as_value, as_factor

   character(*), parameter :: words(*) = [character(28) :: 'frequency', parameter_words]
   character(*), parameter :: as_words(*) = [character(6) :: 'value', 'factor']
   integer, parameter :: as_value = 1, as_factor = 2

   !> Keys of group &sweep.
   type :: parameter_sweep
      !> As in fw_parameters; 0: the frequency.
      integer :: number = 0
      !> What the values are: the parameter itself, or factors of what the case has.
      integer :: as = as_value
      !> The one frequency [rad/s]; while it is read in the unit of the sweep.
      real(wp) :: frequency = 0.0_wp
      !> First and last value, and all of them where they are a list.
      real(wp) :: start = 0.0_wp, end = 0.0_wp
      real(wp), allocatable :: values(:)
   contains
      procedure :: bind_parameter
      procedure :: bind_values
      procedure :: is_wanted
      procedure :: value
      procedure :: ends
      procedure :: is_ordered
   end type parameter_sweep

contains

   !> Which parameter, before the ends of the sweep, whose range follows from it.
   subroutine bind_parameter(self, keys)
      class(parameter_sweep), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      integer :: choice

      choice = self%number + 1
      call keys%bind_word(key('parameter', 'what start, end and values are of', &
                              only="analysis = 'frf'"), choice, words)
      self%number = choice - 1
   end subroutine bind_parameter

   !> The frequency of another parameter, and the list of values of either.
   subroutine bind_values(self, keys)
      class(parameter_sweep), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%bind(key('values', 'in any order, in place of start, end, n_points', shape=':', &
                         repeats=.false., absent='none', &
                         only="analysis = 'frf', 'time', continuation = 'natural'"), self%values)
      call keys%bind(key('frequency', 'of a sweep over another parameter', above(0.0_wp), &
                         unit='unit', absent='required with another parameter'), self%frequency, &
                     needed=self%is_wanted())
      call keys%bind_word(key('as', 'values, or factors of those of the case', &
                              only="parameter other than 'frequency'"), self%as, as_words)
   end subroutine bind_values

   !> Whether it is another parameter than the frequency.
   pure logical function is_wanted(self)
      class(parameter_sweep), intent(in) :: self

      is_wanted = self%number > 0
   end function is_wanted

   !> Value k of n: of the list, or evenly spaced from start to end, both exact.
   pure real(wp) function value(self, k, n)
      class(parameter_sweep), intent(in) :: self
      integer, intent(in) :: k, n
      real(wp) :: share

      value = self%start
      if (allocated(self%values)) value = self%values(k)
      if (n == 1 .or. allocated(self%values)) return
      share = real(k - 1, wp)/real(n - 1, wp)
      value = (1.0_wp - share)*self%start + share*self%end
   end function value

   !> Lowest and highest of the values.
   pure function ends(self) result(span)
      class(parameter_sweep), intent(in) :: self
      real(wp) :: span(2)

      span = [min(self%start, self%end), max(self%start, self%end)]
      if (.not. allocated(self%values)) return
      span = [min(span(1), minval(self%values)), max(span(2), maxval(self%values))]
   end function ends

   !> Whether values only rise or only fall.
   pure logical function is_ordered(self)
      class(parameter_sweep), intent(in) :: self
      integer :: n

      is_ordered = .true.
      if (.not. allocated(self%values)) return
      n = size(self%values)
      is_ordered = all(self%values(2:) > self%values(:n - 1)) .or. &
                   all(self%values(2:) < self%values(:n - 1))
   end function is_ordered

end module fw_parameter_sweep
