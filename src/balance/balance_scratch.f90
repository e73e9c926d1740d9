!> Room for products of the balance, so that none of them allocates.
module fw_balance_scratch
   use fw_fourier, only: fourier_type, new_fourier
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: balance_scratch

   type :: balance_scratch
      !> (n_coordinates, n_coefficients)
      real(wp), allocatable :: product(:, :), active_out(:, :)
      !> (n_coordinates, n_retained)
      complex(wp), allocatable :: complex_in(:, :), complex_out(:, :)
      !> Operators of all harmonics of a result at the instants of the balance, whatever harmonics
      !> that retains: made at the first point that wants them.
      type(fourier_type) :: all_harmonics
      !> First waves on the grid where peaks of the response are looked for, made at the first point
      !> (see fw_recovery).
      real(wp), allocatable :: grid_waves(:, :)
   contains
      procedure :: reserve
      procedure :: make_all_harmonics
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

   !> Operators of the harmonics 0..n_harmonics at n_time instants in `all_harmonics`.
   subroutine make_all_harmonics(self, n_harmonics, n_time)
      class(balance_scratch), intent(inout) :: self
      integer, intent(in) :: n_harmonics, n_time

      if (self%all_harmonics%n_time == n_time .and. &
          self%all_harmonics%n_retained == n_harmonics + 1) return
      self%all_harmonics = new_fourier(n_harmonics, n_time)
   end subroutine make_all_harmonics

end module fw_balance_scratch
