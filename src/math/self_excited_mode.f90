!> One linear mode with its damping, and the self-excitation xi that cancels it:
!>
!>   (K - theta M + i omega C) U = 0,   theta = omega^2 + i omega xi,   exact whatever the damping.
!>
!> i omega is an eigenvalue of lambda^2 M + lambda (C - xi M) + K. K and C are any matrices, so that
!> Coriolis forces, those of the air and dampers of any size take part.
module fw_self_excited_mode
   use fw_hermitian, only: real_form
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   implicit none (type, external)
   private

   public :: mode_pencil, self_excited_mode, refine_mode

   type :: mode_pencil
      !> (n, n)
      complex(wp), allocatable :: k(:, :), m(:, :), c(:, :)
   end type mode_pencil

   type :: self_excited_mode
      !> [rad/s]
      real(wp) :: omega = 0.0_wp, self_excitation = 0.0_wp
      !> U of any size (n).
      complex(wp), allocatable :: shape(:)
      !> The mode at rest that it is, 0: none.
      integer :: at_rest = 0
   contains
      procedure :: is_overdamped
      procedure :: is_nearly
   end type self_excited_mode

contains

   !> Of a damping ratio of one or more: nothing oscillates.
   pure logical function is_overdamped(self)
      class(self_excited_mode), intent(in) :: self

      is_overdamped = self%self_excitation >= 2.0_wp*self%omega
   end function is_overdamped

   !> Whether another has the same frequency and damping, to a part of the frequency.
   pure logical function is_nearly(self, other, part)
      class(self_excited_mode), intent(in) :: self
      type(self_excited_mode), intent(in) :: other
      real(wp), intent(in) :: part

      is_nearly = max(abs(self%omega - other%omega), &
                      abs(self%self_excitation - other%self_excitation)) <= part*abs(other%omega)
   end function is_nearly

   !> By Newton's method on the complex shape, omega and xi; b^T U = 1 holds throughout.
   subroutine refine_mode(pencil, row, mode, done)
      type(mode_pencil), intent(in) :: pencil
      !> The row b (n).
      complex(wp), intent(in) :: row(:)
      !> The start on entry.
      type(self_excited_mode), intent(inout) :: mode
      logical, intent(out) :: done
      integer, parameter :: most_steps = 30
      !> Steps of this part of the unknowns are round-off.
      real(wp), parameter :: small = 1.0e-13_wp
      type(lu_type) :: lu
      real(wp) :: step(2*size(row) + 2)
      logical :: singular
      integer :: j, n

      n = size(row)
      mode%shape = mode%shape/sum(row*mode%shape)
      done = .false.
      call lu%reserve(2*n + 2)
      do j = 1, most_steps
         call fill(pencil, row, mode, lu%matrix(:2*n + 2, :2*n + 2), step)
         call lu%factor(singular)
         if (singular) return
         call lu%solve(step)
         mode%shape = mode%shape - cmplx(step(:n), step(n + 1:2*n), wp)
         mode%omega = mode%omega - step(2*n + 1)
         mode%self_excitation = mode%self_excitation - step(2*n + 2)
         done = norm2(step(:2*n)) <= small*norm2(abs(mode%shape)) .and. &
                maxval(abs(step(2*n + 1:))) <= small*abs(mode%omega)
         if (done) exit
      end do
      ! Ill-conditioned modes stop short of round-off of their best digits.
      if (.not. done) done = maxval(abs(step(2*n + 1:))) <= sqrt(small)*abs(mode%omega)
   end subroutine refine_mode

   !> Matrix and residual of a step in real and imaginary parts: of (K - theta M + i omega C) U,
   !> theta = omega^2 + i omega xi, then of b^T U - 1.
   subroutine fill(pencil, row, mode, matrix, r)
      type(mode_pencil), intent(in) :: pencil
      complex(wp), intent(in) :: row(:)
      type(self_excited_mode), intent(in) :: mode
      real(wp), intent(out) :: matrix(:, :), r(:)
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      complex(wp) :: z(size(row), size(row)), part(size(row)), condition
      integer :: n

      n = size(row)
      associate (k => pencil%k, m => pencil%m, c => pencil%c, u => mode%shape, &
                 omega => mode%omega, xi => mode%self_excitation)
         z = k - cmplx(omega**2, omega*xi, wp)*m + i*omega*c
         matrix = 0.0_wp
         matrix(:2*n, :2*n) = real_form(z)
         part = i*matmul(c, u) - cmplx(2.0_wp*omega, xi, wp)*matmul(m, u)
         matrix(:n, 2*n + 1) = real(part, wp)
         matrix(n + 1:2*n, 2*n + 1) = aimag(part)
         part = -i*omega*matmul(m, u)
         matrix(:n, 2*n + 2) = real(part, wp)
         matrix(n + 1:2*n, 2*n + 2) = aimag(part)
         matrix(2*n + 1:, :2*n) = real_form(reshape(row, [1, n]))
         part = matmul(z, u)
         r(:n) = real(part, wp)
         r(n + 1:2*n) = aimag(part)
         condition = sum(row*u) - 1.0_wp
         r(2*n + 1:) = [real(condition, wp), aimag(condition)]
      end associate
   end subroutine fill

end module fw_self_excited_mode
