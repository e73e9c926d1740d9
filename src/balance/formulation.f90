!> The unknowns in which a balance is solved: its coefficients, or the values at the instants
!> (hdhb). The builder of a problem says which; who solves sees a system and two conversions.
module fw_formulation
   use fw_balance_state, only: balance_state
   use fw_hdhb, only: hdhb_system, new_hdhb
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: formulation_type

   type :: formulation_type
      type(balance_state), pointer, private :: balance => null()
      !> Only used where values at the instants are the unknowns.
      type(hdhb_system), private :: values
   contains
      procedure :: begin
      procedure :: as_solved
      procedure :: from_coefficients
      procedure :: to_coefficients
   end type formulation_type

contains

   !> Take a balance, which has to live as long.
   subroutine begin(self, balance)
      class(formulation_type), intent(inout) :: self
      type(balance_state), intent(inout), target :: balance

      self%balance => balance
      if (balance%problem%solves_values) call new_hdhb(balance, self%values)
   end subroutine begin

   !> The system that solvers take, with as many unknowns as the balance.
   function as_solved(self) result(system)
      class(formulation_type), intent(in), target :: self
      class(parameter_system), pointer :: system

      system => self%balance
      if (self%balance%problem%solves_values) system => self%values
   end function as_solved

   !> The unknowns of that system from coefficients.
   subroutine from_coefficients(self, coefficients, unknowns)
      class(formulation_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: coefficients(:)
      real(wp), intent(out), contiguous :: unknowns(:)

      if (self%balance%problem%solves_values) then
         call self%values%to_values(self%balance%problem%structure%n_coordinates, coefficients, &
                                    unknowns)
      else
         unknowns = coefficients
      end if
   end subroutine from_coefficients

   !> The inverse of from_coefficients.
   subroutine to_coefficients(self, unknowns, coefficients)
      class(formulation_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: unknowns(:)
      real(wp), intent(out), contiguous :: coefficients(:)

      if (self%balance%problem%solves_values) then
         call self%values%to_coefficients(self%balance%problem%structure%n_coordinates, unknowns, &
                                          coefficients)
      else
         coefficients = unknowns
      end if
   end subroutine to_coefficients

end module fw_formulation
