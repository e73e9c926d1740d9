!> Modal damping by the modes of motions that leave some rows alone: u = B v, with the modes phi of
!> B^T M B and B^T K B. Of all dofs the modes are B phi, and
!>
!>   C = 2 zeta M B phi diag(omega) phi^T B^T M = X C_v X^T,   X = M B (B^T M B)^-1,
!>
!> with C_v the modal damping of v. Where B^T M B is singular, so is M in the directions that it
!> lacks, and a pseudo-inverse leaves them out of X as they are left out of C_v.
module fw_held_damping
   use fw_damping, only: add_modal_damping, multiply, rank_tolerance
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_linalg, only: diagonalize
   implicit none (type, external)
   private

   public :: add_held_damping

contains

   !> Add the damping of all such modes, or of the lowest ones; of all modes without a basis.
   subroutine add_held_damping(mass, stiffness, ratio, damping, error, up_to, basis)
      !> Symmetric (n, n), the mass positive semidefinite.
      real(wp), contiguous, intent(in) :: mass(:, :), stiffness(:, :)
      !> Fraction of critical damping of every mode.
      real(wp), intent(in) :: ratio
      real(wp), intent(inout) :: damping(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> As in add_modal_damping [rad/s].
      real(wp), intent(in), optional :: up_to
      !> B (n, m).
      real(wp), contiguous, intent(in), optional :: basis(:, :)
      real(wp), allocatable :: moved(:, :), inner_mass(:, :), inner(:, :), inner_damping(:, :)
      real(wp), allocatable :: half(:, :)

      if (.not. present(basis)) then
         call add_modal_damping(mass, stiffness, ratio, damping, error, up_to)
         return
      end if
      ! Nothing moves that is not held.
      if (size(basis, 2) == 0) return
      call multiply('N', stiffness, 'N', basis, moved)
      call multiply('T', basis, 'N', moved, inner)
      call multiply('N', mass, 'N', basis, moved)
      call multiply('T', basis, 'N', moved, inner_mass)
      call share_round_off(inner)
      call share_round_off(inner_mass)
      allocate (inner_damping(size(inner, 1), size(inner, 2)), source=0.0_wp)
      call add_modal_damping(inner_mass, inner, ratio, inner_damping, error, up_to)
      if (allocated(error)) return
      call divide(moved, inner_mass, error)
      if (allocated(error)) return
      call multiply('N', moved, 'N', inner_damping, half)
      call multiply('N', half, 'T', moved, inner)
      call share_round_off(inner)
      damping = damping + inner
   end subroutine add_held_damping

   !> Times the inverse of a mass, or the pseudo-inverse.
   subroutine divide(moved, mass, error)
      !> M B, then X (n, m).
      real(wp), allocatable, intent(inout) :: moved(:, :)
      !> (m, m)
      real(wp), intent(in) :: mass(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :), values(:), shares(:, :)
      real(wp) :: scale(size(mass, 1))
      integer :: i, j

      ! Mixed units do not decide what counts as massless.
      scale = [(1.0_wp/sqrt(merge(mass(i, i), 1.0_wp, mass(i, i) > 0.0_wp)), i=1, size(scale))]
      vectors = mass
      do j = 1, size(scale)
         vectors(:, j) = scale*vectors(:, j)*scale(j)
         moved(:, j) = moved(:, j)*scale(j)
      end do
      call diagonalize(vectors, values, 'modal_damping', error)
      if (allocated(error)) return
      call multiply('N', moved, 'N', vectors, shares)
      do j = 1, size(values)
         if (values(j) > rank_tolerance*values(size(values))) then
            shares(:, j) = shares(:, j)/values(j)
         else
            shares(:, j) = 0.0_wp
         end if
      end do
      call multiply('N', shares, 'T', vectors, moved)
      do j = 1, size(scale)
         moved(:, j) = moved(:, j)*scale(j)
      end do
   end subroutine divide

   !> The matrix is symmetric, but for round-off.
   pure subroutine share_round_off(matrix)
      real(wp), intent(inout) :: matrix(:, :)
      integer :: j

      do j = 2, size(matrix, 1)
         matrix(:j - 1, j) = 0.5_wp*(matrix(:j - 1, j) + matrix(j, :j - 1))
         matrix(j, :j - 1) = matrix(:j - 1, j)
      end do
   end subroutine share_round_off

end module fw_held_damping
