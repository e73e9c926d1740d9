!> The Euclidean norm of vectors that are formed at every iteration. That of the language scales
!> every entry against overflow, which takes as long as a division for each.
module fw_norm
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: is_finite, norm_of

contains

   pure real(wp) function norm_of(x) result(norm)
      real(wp), intent(in), contiguous :: x(:)
      ! Squares from here on have lost nothing to underflow that counts.
      real(wp), parameter :: smallest = sqrt(tiny(1.0_wp))/epsilon(1.0_wp)
      real(wp) :: square
      integer :: i

      square = 0.0_wp
      !$omp simd reduction(+: square)
      do i = 1, size(x)
         square = square + x(i)**2
      end do
      norm = sqrt(square)
      if (.not. is_finite(norm) .or. norm < smallest) norm = norm2(x)
   end function norm_of

   !> As ieee_is_finite, for what is called at every iteration: a procedure that names the intrinsic
   !> module saves the floating-point environment when it begins and restores it when it ends, which
   !> takes longer than a short norm.
   elemental logical function is_finite(x)
      real(wp), intent(in) :: x

      is_finite = abs(x) <= huge(x)
   end function is_finite

end module fw_norm
