!> From a stuck solution up to where the stuck motion of a mode ends, at the latest its bound
!> (fw_onset_bound), by solutions of its own: no step of the curve enters.
!>
!> One solution just below the bound may tell it all. Where tangential motion changes normal forces
!> the assembly may not lead to the offsets that the bound needs; the stuck motion ends before.
!> There it slips, or parts and turns back to lower amplitudes, so that nothing is found above.
module fw_onset_climb
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_nonlinear_mode, only: mode_path
   use fw_onset_search, only: coarse, onset_search
   implicit none (type, external)
   private

   public :: climb

contains

   !> Up to the bound, or to the highest amplitude that counts: `stuck` where all of them are.
   subroutine climb(search, path, top, stuck, error)
      type(onset_search), intent(inout) :: search
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: top
      logical, intent(out) :: stuck
      type(error_type), allocatable, intent(out) :: error
      !> Times that a bracket is opened again.
      integer, parameter :: most_openings = 8
      real(wp) :: before
      integer :: k

      call look(search, path, top, error)
      do k = 1, most_openings
         if (allocated(error)) return
         stuck = search%low(1) >= top
         if (stuck) return
         call close_in(search, path, error)
         if (allocated(error)) return
         before = search%low(1)
         call step_up(search, path, top, error)
         if (search%low(1) <= before) exit
      end do
   end subroutine climb

   !> At an amplitude above the last stuck solution; what does not converge is none.
   subroutine look(search, path, amplitude, error)
      type(onset_search), intent(inout) :: search
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: amplitude
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: y(size(search%y, 1))
      logical :: converged

      if (search%low(1) >= amplitude) return
      y = search%position(amplitude)
      call search%look_from(path, amplitude, y, converged, error)
      if (allocated(error) .or. converged) return
      search%high = amplitude
      search%above = huge(1.0_wp)
   end subroutine look

   !> Halve what is between the last stuck solution and what is none, or go where the line through
   !> the squares of what slides ends.
   subroutine close_in(search, path, error)
      type(onset_search), intent(inout) :: search
      type(mode_path), intent(inout) :: path
      type(error_type), allocatable, intent(out) :: error

      call search%sliding%forget_zero()
      do while (search%high > coarse*search%low(1))
         search%sliding%low = search%low(1)
         search%sliding%high = search%high
         call look(search, path, search%sliding%next(), error)
         if (allocated(error)) return
      end do
   end subroutine close_in

   !> A short step beyond the bracket, then longer ones: near to the last stuck solution another one
   !> may be found where from far below none was.
   subroutine step_up(search, path, top, error)
      type(onset_search), intent(inout) :: search
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: top
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: amplitude, ratio

      ratio = coarse
      do while (search%low(1) < top)
         ratio = ratio**2
         amplitude = min(top, ratio*search%low(1))
         call look(search, path, amplitude, error)
         if (allocated(error) .or. search%low(1) < amplitude) return
      end do
   end subroutine step_up

end module fw_onset_climb
