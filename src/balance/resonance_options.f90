!> Options of a resonance that is followed over a parameter (group &resonance). Defaults live here
!> and nowhere else.
module fw_resonance_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least, from_to
   use fw_kinds, only: wp
   use fw_parameters, only: parameter_words
   use fw_solver_options, only: continuation_natural, continuation_words, most_points
   implicit none (type, external)
   private

   public :: resonance_options
   public :: condition_words, condition_amplitude, condition_phase
   public :: spacing_linear, spacing_log
   public :: as_words, as_value, as_factor
   public :: resonance_words

   !> What makes a point a resonance: the response is largest, or the load does no reactive work.
   character(*), parameter :: condition_words(*) = [character(9) :: 'amplitude', 'phase']
   integer, parameter :: condition_amplitude = 1, condition_phase = 2

   character(*), parameter :: spacing_words(*) = [character(6) :: 'linear', 'log']
   integer, parameter :: spacing_linear = 1, spacing_log = 2

   !> What start and end are: values, or factors of those of the case.
   character(*), parameter :: as_words(*) = [character(6) :: 'value', 'factor']
   integer, parameter :: as_value = 1, as_factor = 2

   !> In the order of fw_response_quantity.
   character(*), parameter :: resonance_words(*) = [character(14) :: 'first_harmonic', 'largest']

   type :: resonance_options
      !> As in parameter_words.
      integer :: parameter = 1
      !> Values or factors, the first and the last.
      real(wp) :: start = 0.0_wp
      real(wp) :: end = 0.0_wp
      integer :: n_points = 20
      integer :: spacing = spacing_linear
      integer :: as = as_value
      integer :: condition = condition_amplitude
      !> Of the first observed quantity, as in resonance_words.
      integer :: quantity = 1
      integer :: continuation = continuation_natural
      !> A branch may turn round without end.
      integer :: max_points = 1000
   contains
      procedure :: bind_keys
      procedure :: value_of
      procedure :: coordinate_of
      procedure :: value_at
      procedure :: rate_at
   end type resonance_options

contains

   !> The keys of group &resonance.
   subroutine bind_keys(self, keys, is_resonance)
      class(resonance_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is that of a resonance.
      logical, intent(in) :: is_resonance
      character(*), parameter :: only = "analysis = 'resonance'"

      call keys%open('resonance', 'a resonance over a parameter of the case')
      call keys%bind_word(key('parameter', 'what changes from point to point', &
                              absent='required', only=only), self%parameter, &
                          parameter_words)
      call keys%bind(key('start', 'first value, or factor', absent='required', only=only), &
                     self%start, needed=is_resonance)
      call keys%bind(key('end', 'last value, or factor', absent='required', only=only), &
                     self%end, needed=is_resonance)
      call keys%bind(key('n_points', 'values; of a branch: its longest step', &
                         from_to(2, most_points)), self%n_points)
      call keys%bind_word(key('spacing', 'even steps, or in the logarithm'), self%spacing, &
                          spacing_words)
      call keys%bind_word(key('as', &
                              'values, or factors of those of the case (all pairs or springs '// &
                              'together)'), self%as, as_words)
      call keys%bind_word(key('condition', 'the response is largest, or the load does no '// &
                              'reactive work'), self%condition, condition_words)
      call keys%bind_word(key('quantity', 'of the first observed quantity, what is largest'), &
                          self%quantity, resonance_words)
      call keys%bind_word(key('continuation', &
                              "given values, or a branch through folds (condition = 'phase')"), &
                          self%continuation, continuation_words)
      call keys%bind(key('max_points', 'of a branch', at_least(2), &
                         only="continuation = 'arclength'"), self%max_points)
   end subroutine bind_keys

   !> Value of point k.
   pure real(wp) function value_of(self, k)
      class(resonance_options), intent(in) :: self
      integer, intent(in) :: k
      real(wp) :: share

      value_of = self%start
      if (k == self%n_points) value_of = self%end
      if (k == 1 .or. k == self%n_points) return
      share = real(k - 1, wp)/real(self%n_points - 1, wp)
      value_of = self%value_at((1.0_wp - share)*self%coordinate_of(self%start) + &
                               share*self%coordinate_of(self%end))
   end function value_of

   !> What steps are even in.
   elemental real(wp) function coordinate_of(self, value)
      class(resonance_options), intent(in) :: self
      real(wp), intent(in) :: value

      coordinate_of = value
      if (self%spacing == spacing_log) coordinate_of = log(value)
   end function coordinate_of

   !> The inverse.
   elemental real(wp) function value_at(self, coordinate)
      class(resonance_options), intent(in) :: self
      real(wp), intent(in) :: coordinate

      value_at = coordinate
      if (self%spacing == spacing_log) value_at = exp(coordinate)
   end function value_at

   !> d(value) by the coordinate.
   pure real(wp) function rate_at(self, value)
      class(resonance_options), intent(in) :: self
      real(wp), intent(in) :: value

      rate_at = 1.0_wp
      if (self%spacing == spacing_log) rate_at = value
   end function rate_at

end module fw_resonance_options
