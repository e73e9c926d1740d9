!> Options of a free decay (group &ringdown). Defaults live here and nowhere else.
module fw_ringdown_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, from_to
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: ringdown_options

   type :: ringdown_options
      !> Of the elastic modes of the structure with its closed pairs stuck, from 1.
      integer :: number = 1
      !> Of the first observed quantity, about the position at rest [length].
      real(wp) :: amplitude = 0.0_wp
      !> Periods of the stuck mode that are followed.
      integer :: n_cycles = 20
      !> Steps of each before refinement.
      integer :: steps_per_period = 2000
   contains
      procedure :: bind_keys
   end type ringdown_options

contains

   !> The keys of group &ringdown.
   subroutine bind_keys(self, keys, is_wanted)
      class(ringdown_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is 'ringdown'.
      logical, intent(in) :: is_wanted

      call keys%open('ringdown', 'free decay from the shape of a mode')
      call keys%bind(key('number', 'of the elastic modes with closed pairs stuck', at_least(1)), &
                     self%number)
      call keys%bind(key('amplitude', 'of the first observed quantity, from its rest', &
                         above(0.0_wp), unit='L', absent='required', &
                         only="analysis = 'ringdown'"), self%amplitude, needed=is_wanted)
      call keys%bind(key('n_cycles', 'periods of the stuck mode', from_to(1, 100000)), &
                     self%n_cycles)
      call keys%bind(key('steps_per_period', 'changes of stick and slip are located within', &
                         from_to(16, 100000)), self%steps_per_period)
   end subroutine bind_keys

end module fw_ringdown_options
