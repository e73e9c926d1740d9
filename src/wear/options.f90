!> Options of fretting wear (group &wear). Defaults live here and nowhere else.
module fw_wear_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: wear_options
   public :: wear_scheme_words, wear_explicit, wear_implicit, wear_pseudo_time

   character(*), parameter :: wear_scheme_words(*) = &
      [character(11) :: 'explicit', 'implicit', 'pseudo_time']
   integer, parameter :: wear_explicit = 1, wear_implicit = 2, wear_pseudo_time = 3

   type :: wear_options
      integer :: scheme = wear_implicit
      !> Archard's wear coefficient k_w [area / force]; required, no default.
      real(wp) :: coefficient = -1.0_wp
      !> Vibration cycles to be covered.
      real(wp) :: n_cycles = huge(1.0_wp)
      !> Largest growth of the depth in one step [length] (0: chosen).
      real(wp) :: max_depth_step = 0.0_wp
      real(wp) :: error_tolerance = 1.0e-3_wp
      real(wp) :: steady_tolerance = 1.0e-6_wp
      integer :: max_steps = 1000
   end type wear_options

end module fw_wear_options
