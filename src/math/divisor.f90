!> Whole numbers.
module fw_divisor
   implicit none (type, external)
   private

   public :: common_divisor

contains

   !> The largest common divisor, by Euclid; 0 and n have n.
   pure integer function common_divisor(a, b) result(divisor)
      integer, intent(in) :: a, b
      integer :: other, rest

      divisor = a
      other = b
      do while (other > 0)
         rest = modulo(divisor, other)
         divisor = other
         other = rest
      end do
   end function common_divisor

end module fw_divisor
