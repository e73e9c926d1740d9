!> Room for products of the balance, so that none of them allocates.
module fw_balance_scratch
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: balance_scratch

   type :: balance_scratch
      !> (n_coordinates, n_coefficients)
      real(wp), allocatable :: product(:, :), active_out(:, :)
      !> (n_coordinates, n_retained)
      complex(wp), allocatable :: complex_in(:, :), complex_out(:, :)
   contains
      procedure :: reserve
   end type balance_scratch

contains

   !> All that residuals and products need, once: neither of them allocates anything.
   pure subroutine reserve(self, n_coordinates, n_harmonics, n_coefficients)
      class(balance_scratch), intent(inout) :: self
      integer, intent(in) :: n_coordinates, n_harmonics, n_coefficients

      allocate (self%product(n_coordinates, n_coefficients), source=0.0_wp)
      allocate (self%active_out(n_coordinates, n_coefficients), source=0.0_wp)
      allocate (self%complex_in(n_coordinates, n_harmonics), source=(0.0_wp, 0.0_wp))
      allocate (self%complex_out(n_coordinates, n_harmonics), source=(0.0_wp, 0.0_wp))
   end subroutine reserve

end module fw_balance_scratch
