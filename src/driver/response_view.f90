!> A branch measured by its response: the vibration of the observed quantities, and not the unknowns
!> of a condensed structure. These are the relative displacements of its joint, which may be a
!> thousandth of the response and begin to move one after the other.
module fw_response_view
   use fw_branch_view, only: branch_view
   use fw_balance_state, only: balance_state
   use fw_formulation, only: formulation_type
   use fw_kinds, only: wp
   use fw_recovery, only: observe
   implicit none (type, external)
   private

   public :: response_view

   type, extends(branch_view) :: response_view
      type(balance_state), pointer, private :: system => null()
      type(formulation_type), pointer, private :: formulation => null()
      ! Of the unknowns in view (n).
      real(wp), allocatable, private :: coefficients(:)
      ! (n_observed, n_retained)
      complex(wp), allocatable, private :: observed(:, :)
   contains
      procedure :: begin
      procedure :: see
   end type response_view

contains

   !> Get ready to look at a system and its unknowns, which have to outlive the view.
   subroutine begin(self, system, formulation)
      class(response_view), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      type(formulation_type), intent(inout), target :: formulation
      integer :: n_observed

      self%system => system
      self%formulation => formulation
      allocate (self%coefficients(system%n))
      n_observed = system%problem%structure%n_observed
      allocate (self%observed(n_observed, system%problem%fourier%n_retained))
      ! A static load moves every point alike, and would hide the vibration.
      self%n = 2*n_observed*count(system%problem%fourier%harmonic > 0)
   end subroutine begin

   subroutine see(self, x, y)
      class(response_view), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: y(:)
      integer :: h, i, k

      call self%formulation%to_coefficients(x, self%coefficients)
      call observe(self%system, self%coefficients, self%observed)
      k = 0
      do h = 1, size(self%observed, 2)
         if (self%system%problem%fourier%harmonic(h) == 0) cycle
         do i = 1, size(self%observed, 1)
            y(k + 1) = real(self%observed(i, h), wp)
            y(k + 2) = aimag(self%observed(i, h))
            k = k + 2
         end do
      end do
   end subroutine see

end module fw_response_view
