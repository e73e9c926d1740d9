!> Group /campbell of a result file: frequencies over the rotation speed, where engine orders meet
!> them, and the maximum of the response near each crossing.
module fw_campbell_group
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: campbell_group

   type, extends(result_group) :: campbell_group
      !> [rad/s] (n_speeds)
      real(wp), allocatable :: speed(:)
      integer, allocatable :: nodal_diameter(:)
      !> Without contact, and with every pair closed (n_modes, n_diameters, n_speeds) [rad/s].
      real(wp), allocatable :: open(:, :, :), closed(:, :, :)
      !> Of each crossing; modes count from 1.
      integer, allocatable :: order(:), diameter(:), mode(:)
      real(wp), allocatable :: crossing_speed(:), crossing_omega(:), damping_ratio(:)
      !> NaN where there is no maximum; not allocated where none was looked for (n_crossings), and
      !> the first harmonic of what is observed (n_observed, n_crossings).
      real(wp), allocatable :: peak_omega(:), peak_speed(:), peak_amplitude(:, :)
   contains
      procedure :: write => write_campbell
   end type campbell_group

contains

   subroutine write_campbell(self, to)
      class(campbell_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      character(*), parameter :: c = 'crossing', of_speeds = 'speed diameter mode'

      call to%put('/campbell/speed', self%speed, 'rad/s', 'speed', 'rotation speed')
      call to%put('/campbell/nodal_diameter', self%nodal_diameter, '', 'diameter', &
                  'nodal diameter, in the rotating frame')
      call to%put('/campbell/open', self%open, 'rad/s', of_speeds, &
                  'natural frequencies without contact')
      call to%put('/campbell/closed', self%closed, 'rad/s', of_speeds, &
                  'natural frequencies with every pair closed')
      call to%put('/campbell/crossing/order', self%order, '', c, 'engine order')
      call to%put('/campbell/crossing/nodal_diameter', self%diameter, '', c, &
                  'nodal diameter that the order excites')
      call to%put('/campbell/crossing/mode', self%mode, '', c, &
                  'mode of the nodal diameter, from 1')
      call to%put('/campbell/crossing/speed', self%crossing_speed, 'rad/s', c, 'rotation speed')
      call to%put('/campbell/crossing/omega', self%crossing_omega, 'rad/s', c, &
                  'frequency, order times speed')
      call to%put('/campbell/crossing/damping_ratio', self%damping_ratio, '1', c, &
                  'damping of the mode with its pairs closed, over the critical one')
      if (.not. allocated(self%peak_omega)) return
      call to%put('/campbell/peak/omega', self%peak_omega, 'rad/s', c, &
                  'frequency of the largest first harmonic near the crossing')
      call to%put('/campbell/peak/speed', self%peak_speed, 'rad/s', c, 'rotation speed there')
      call to%put('/campbell/peak/amplitude', self%peak_amplitude, '<length>', &
                  'crossing observed', 'first harmonic of the observed quantities there')
   end subroutine write_campbell

end module fw_campbell_group
