!> Internal modes that are coordinates of a balance beside the relative ones: no law acts on them,
!> so that they follow from these in every harmonic.
module fw_kept_modes
   use fw_balance_state, only: balance_state
   use fw_fourier, only: to_complex, to_real
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type
   implicit none (type, external)
   private

   public :: complete_modes

contains

   !> Solve for the modes in harmonics up to a highest one; `done` is false where they resonate.
   subroutine complete_modes(system, highest, x, done)
      type(balance_state), intent(inout) :: system
      integer, intent(in) :: highest
      !> Unknowns, of which the relative coordinates are known.
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: done
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: z(:, :), q(:, :), rhs(:, :)
      logical :: singular
      integer :: h, m, n

      done = .true.
      m = system%problem%structure%n_coordinates
      n = system%problem%structure%n_relative
      if (m == n) return
      allocate (z(m, m), q(m, system%problem%fourier%n_retained), rhs(m - n, 1))
      call to_complex(system%problem%fourier, m, x, q)
      call lu%reserve(m - n)
      do h = 1, system%problem%fourier%n_retained
         if (system%problem%fourier%harmonic(h) > highest) exit
         call system%problem%structure%block(system%structure_state, h, z)
         lu%matrix = z(n + 1:, n + 1:)
         rhs(:, 1) = system%structure_state%load(n + 1:, h) - matmul(z(n + 1:, :n), q(:n, h))
         call lu%factor(singular)
         done = .not. singular
         if (singular) return
         call lu%solve(1, rhs)
         q(n + 1:, h) = rhs(:, 1)
      end do
      call to_real(system%problem%fourier, m, q, x)
   end subroutine complete_modes

end module fw_kept_modes
