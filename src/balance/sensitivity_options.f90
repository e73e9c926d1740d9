!> By what a response is differentiated, and what of it (group &sensitivity).
module fw_sensitivity_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: sensitivity_options, of_itself

   !> In the place of a parameter or a quantity: the value of the other one.
   integer, parameter :: of_itself = -1

   type :: sensitivity_options
      !> Numbers in parameter_words; not allocated, or empty, where nothing is asked for.
      integer, allocatable :: parameters(:)
      !> Numbers in quantity_words: all that the case has, unless some are given.
      integer, allocatable :: quantities(:)
      !> Those of value_words that come with the analysis.
      integer, allocatable :: further(:)
      !> Standard deviation of each parameter over its value; not allocated where none was given.
      real(wp), allocatable :: deviation(:)
      !> Whether the number of harmonics is given, without which derivatives are of nothing.
      logical :: has_harmonics = .false.
   contains
      procedure :: is_wanted
      procedure :: has
   end type sensitivity_options

contains

   !> Whether derivatives are asked for at all.
   pure logical function is_wanted(self)
      class(sensitivity_options), intent(in) :: self

      is_wanted = .false.
      if (allocated(self%parameters)) is_wanted = size(self%parameters) > 0
   end function is_wanted

   !> Whether a quantity is differentiated by a parameter; parameter 0: whether its deviation is
   !> asked for; `of_itself` for one of the two: whether the other one is used.
   pure logical function has(self, quantity, parameter)
      class(sensitivity_options), intent(in) :: self
      integer, intent(in) :: quantity, parameter

      has = self%is_wanted() .and. allocated(self%quantities)
      if (.not. has) return
      has = any(self%quantities == quantity) .or. quantity == of_itself
      if (allocated(self%further)) has = has .or. any(self%further == quantity)
      if (parameter > 0) then
         has = has .and. any(self%parameters == parameter)
      else if (parameter /= of_itself) then
         has = has .and. allocated(self%deviation)
      end if
   end function has

end module fw_sensitivity_options
