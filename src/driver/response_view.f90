!> A branch measured by its response: the vibration of the observed quantities, and not the unknowns
!> of a condensed structure. These are the relative displacements of its joint, which may be a
!> thousandth of the response and begin to move one after the other.
module fw_response_view
   use fw_branch_view, only: branch_view
   use fw_balance_state, only: balance_state
   use fw_hdhb, only: hdhb_system
   use fw_kinds, only: wp
   use fw_recovery, only: observe
   implicit none (type, external)
   private

   public :: response_view

   type, extends(branch_view) :: response_view
      type(balance_state), pointer, private :: system => null()
      !> Turns values at instants into coefficients, where they are the unknowns.
      type(hdhb_system), pointer, private :: in_time => null()
      ! (n_observed, n_retained)
      complex(wp), allocatable, private :: observed(:, :)
   contains
      procedure :: begin
      procedure :: see
   end type response_view

contains

   !> Get ready to look at a system, which has to outlive the view.
   subroutine begin(self, system, in_time)
      class(response_view), intent(inout) :: self
      type(balance_state), intent(inout), target :: system
      type(hdhb_system), intent(inout), target, optional :: in_time
      integer :: n_observed

      self%system => system
      if (present(in_time)) self%in_time => in_time
      n_observed = system%problem%structure%n_observed
      allocate (self%observed(n_observed, system%problem%fourier%n_retained))
      ! A static load moves every point alike, and would hide the vibration.
      self%n = 2*n_observed*count(system%problem%fourier%harmonic > 0)
   end subroutine begin

   subroutine see(self, x, y)
      class(response_view), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: y(:)
      real(wp), allocatable :: coefficients(:)
      integer :: h, i, k

      if (associated(self%in_time)) then
         allocate (coefficients, mold=x)
         call self%in_time%to_coefficients(self%system%problem%structure%n_coordinates, x, &
                                           coefficients)
         call observe(self%system, coefficients, self%observed)
      else
         call observe(self%system, x, self%observed)
      end if
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
