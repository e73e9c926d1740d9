!> The internal block of a condensation at one harmonic, D_j = k_j - theta m_j + i s c_j, with a
!> loss factor k_j (1 + i eta) in place of k_j: a diagonal, or factors where the damping couples the
!> internal modes. A sector fills its own (fw_sector_stiffness).
module fw_internal_block
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: internal_block

   !> The part of a structure that is condensed: its matrices, and their factors at one frequency.
   type :: internal_block
      !> D^-1, of coupled modes that of the diagonal without damping; 0 of a free mode (n_internal).
      complex(wp), allocatable :: inverse(:)
      !> Whether damping couples the modes; `lu` has the factors of D then.
      logical :: coupled = .false.
      type(complex_lu_type) :: lu
   contains
      procedure :: factor
      procedure :: solve
   end type internal_block

contains

   !> Fails where a mode resonates without damping.
   subroutine factor(self, basis, theta, s, failed)
      class(internal_block), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      complex(wp), intent(in) :: theta
      !> n omega.
      real(wp), intent(in) :: s
      logical, intent(out) :: failed
      integer :: j

      failed = .false.
      self%coupled = allocated(basis%c_ii)
      self%inverse = cmplx(basis%k_i - real(theta, wp)*basis%m_i, -aimag(theta)*basis%m_i, wp)
      if (basis%loss_at(s) > 0.0_wp) then
         self%inverse = self%inverse + cmplx(0.0_wp, basis%loss*basis%k_i, wp)
      end if
      if (self%coupled) then
         call self%lu%reserve(basis%n_internal)
         self%lu%matrix = cmplx(0.0_wp, s*basis%c_ii, wp)
         do j = 1, basis%n_internal
            self%lu%matrix(j, j) = self%lu%matrix(j, j) + self%inverse(j)
            ! A free mode in harmonic 0: any pivot will do, since `solve` puts its row to zero.
            if (abs(self%inverse(j)) <= 0.0_wp .and. s <= 0.0_wp) self%lu%matrix(j, j) = 1.0_wp
         end do
         call self%lu%factor(failed)
      else
         self%inverse = self%inverse + cmplx(0.0_wp, s*basis%c_i, wp)
         failed = s > 0.0_wp .and. any(abs(self%inverse) <= 0.0_wp)
      end if
      ! A free internal mode carries no static load (checked on construction): it stays at rest.
      do j = 1, basis%n_internal
         if (abs(self%inverse(j)) > 0.0_wp) then
            self%inverse(j) = 1.0_wp/self%inverse(j)
         else if (s > 0.0_wp) then
            ! Not zero, which `solve` takes for a free mode: coupled damping holds this one, and
            ! where nothing does `failed` says so.
            self%inverse(j) = (1.0_wp, 0.0_wp)
         end if
      end do
   end subroutine factor

   !> D x = rhs in place (n_internal, n_right).
   subroutine solve(self, n_right, rhs)
      class(internal_block), intent(in) :: self
      integer, intent(in) :: n_right
      complex(wp), intent(inout), contiguous :: rhs(:, :)
      integer :: j

      if (self%coupled) then
         call self%lu%solve(n_right, rhs)
         do j = 1, size(self%inverse)
            if (abs(self%inverse(j)) <= 0.0_wp) rhs(j, :n_right) = (0.0_wp, 0.0_wp)
         end do
      else
         do j = 1, n_right
            rhs(:, j) = self%inverse*rhs(:, j)
         end do
      end if
   end subroutine solve

end module fw_internal_block
