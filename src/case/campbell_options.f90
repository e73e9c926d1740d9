!> Options of a Campbell diagram (group &campbell): speeds, engine orders, and whether the peak at
!> each crossing is looked for.
module fw_campbell_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, from_to
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: campbell_options

   !> Orders of one diagram.
   integer, parameter, public :: most_orders = 100

   !> Speeds, engine orders, and what is solved at their crossings.
   type :: campbell_options
      !> Rotation speeds [rad/s].
      real(wp) :: start = -1.0_wp, end = -1.0_wp
      integer :: n_speeds = 15
      !> Engine orders, signed as cyclic%engine_order (n_orders).
      integer, allocatable :: orders(:)
      !> Factor of the vibratory load of each order, or of all.
      real(wp), allocatable :: order_scale(:)
      logical :: peaks = .true.
      !> Frequencies across the window of a peak.
      integer :: n_points = 41
   contains
      procedure :: bind_keys
      procedure :: scale_of
   end type campbell_options

contains

   !> The keys of group &campbell.
   subroutine bind_keys(self, keys, is_wanted)
      class(campbell_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is 'campbell'.
      logical, intent(in) :: is_wanted
      character(*), parameter :: of_campbell = "analysis = 'campbell'"

      call keys%open('campbell', 'frequencies over the rotation speed, and where engine orders '// &
                     'meet them')
      call keys%bind(key('start', 'lowest rotation speed', at_least(0.0_wp), 'rad/s', &
                         absent='required', only=of_campbell), self%start, needed=is_wanted)
      call keys%bind(key('end', 'highest rotation speed', above(0.0_wp), 'rad/s', &
                         absent='required', only=of_campbell), self%end, needed=is_wanted)
      call keys%bind(key('n_speeds', 'from start to end', from_to(2, 10000)), self%n_speeds)
      call keys%bind(key('orders', 'engine orders, signed as cyclic%engine_order; not 0', &
                         shape=':', repeats=.false., absent='required', only=of_campbell), &
                     self%orders, needed=is_wanted)
      call keys%bind(key('order_scale', 'factor of the vibratory load, of all orders or each', &
                         above(0.0_wp), shape=':', repeats=.false., absent='1'), self%order_scale)
      call keys%bind(key('peaks', 'look for the maximum near each crossing, with friction'), &
                     self%peaks)
      call keys%bind(key('n_points', 'frequencies across each of them', from_to(5, 100000)), &
                     self%n_points)
   end subroutine bind_keys

   !> Of the order at a place.
   pure real(wp) function scale_of(self, place)
      class(campbell_options), intent(in) :: self
      integer, intent(in) :: place

      scale_of = 1.0_wp
      if (.not. allocated(self%order_scale)) return
      if (size(self%order_scale) == 0) return
      scale_of = self%order_scale(min(place, size(self%order_scale)))
   end function scale_of

end module fw_campbell_options
