!> Kind parameters used throughout the library.
module fw_kinds
   use, intrinsic :: iso_fortran_env, only: real32, real64, int64
   implicit none (type, external)
   private

   public :: wp, sp, i8, pi

   !> Working precision of every real number that a result depends on.
   integer, parameter :: wp = real64
   !> Single precision, for what only has to be near: preconditioners.
   integer, parameter :: sp = real32
   !> Integers that count bytes, operations or clock ticks.
   integer, parameter :: i8 = int64
   real(wp), parameter :: pi = 3.141592653589793238462643383279502884_wp

end module fw_kinds
