!> Options of time integration (group &time). Defaults live here and nowhere else.
module fw_time_options
   implicit none (type, external)
   private

   public :: time_options

   type :: time_options
      !> Largest number of periods to integrate.
      integer :: n_periods = 500
      integer :: steps_per_period = 1000
   end type time_options

end module fw_time_options
