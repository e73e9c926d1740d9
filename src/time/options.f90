!> Options of time integration (group &time). Defaults live here and nowhere else.
module fw_time_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least
   implicit none (type, external)
   private

   public :: time_options

   type :: time_options
      !> Largest number of periods to integrate.
      integer :: n_periods = 500
      !> Steps of a period before refinement; the error of the midpoint rule falls with its square.
      integer :: steps_per_period = 1000
   contains
      procedure :: bind_keys
   end type time_options

contains

   !> The keys of group &time.
   subroutine bind_keys(self, keys)
      class(time_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('time', 'time integration')
      call keys%bind(key('n_periods', 'at most', at_least(1)), self%n_periods)
      call keys%bind(key('steps_per_period', &
                         'at least max(16, 4H); also the instants of histories', at_least(2)), &
                     self%steps_per_period)
   end subroutine bind_keys

end module fw_time_options
