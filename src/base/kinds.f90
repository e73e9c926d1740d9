!> Kind parameters used throughout the library.
module fw_kinds
   use, intrinsic :: iso_fortran_env, only: real64, int64
   implicit none (type, external)
   private

   public :: wp, i8, pi

   !> Working precision of every real number.
   integer, parameter :: wp = real64
   !> Integers that count bytes, operations or clock ticks.
   integer, parameter :: i8 = int64
   real(wp), parameter :: pi = 3.141592653589793238462643383279502884_wp

end module fw_kinds
