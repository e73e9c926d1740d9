!> Patterns of blade frequencies: d_ja of every blade mode a of every sector j, each pattern in
!> place of the frequencies of the model,
!>
!>   dK_j = W^T diag(w_a^2 ((1 + s d_ja)^2 - 1)) W + what else the sectors have beside each other.
module fw_blade_patterns
   use fw_deviation, only: deviation_type, of_frequency, stiffness_part
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: blade_patterns

   !> Deviations of the disks of a population.
   type :: blade_patterns
      !> Rows W (n_rows, n_dof) and their frequencies [rad/s].
      real(wp), allocatable :: rows(:, :), row_omega(:)
      real(wp) :: scale = 1.0_wp
      !> d (n_rows, n_sectors, n_patterns).
      real(wp), allocatable :: frequency(:, :, :)
   contains
      procedure :: count => count_patterns
      procedure :: add_pattern
   end type blade_patterns

contains

   pure integer function count_patterns(self) result(n)
      class(blade_patterns), intent(in) :: self

      n = 0
      if (allocated(self%frequency)) n = size(self%frequency, 3)
   end function count_patterns

   !> Add a pattern to a deviation that has the rows W among its own.
   pure subroutine add_pattern(self, pattern, deviation)
      class(blade_patterns), intent(in) :: self
      !> From 1.
      integer, intent(in) :: pattern
      !> Without frequencies, which those of the pattern stand in place of.
      type(deviation_type), intent(inout) :: deviation
      integer :: a, j

      do j = 1, size(self%frequency, 2)
         do a = 1, size(self%row_omega)
            call deviation%add(of_frequency, stiffness_part, j - 1, self%frequency(a, j, pattern), &
                               self%row_omega(a)**2, row=self%rows(a, :))
         end do
      end do
      ! Forms the matrices of all terms.
      call deviation%set_scale(self%scale)
   end subroutine add_pattern

end module fw_blade_patterns
