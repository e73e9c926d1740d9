!> Slope of the balance by the parameter that changes from point to point: by its value, or by the
!> factor that all pairs or springs share.
module fw_varied_slope
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_parameter_problem, only: parameter_problem
   use fw_parameter_slopes, only: parameter_entry
   use fw_parameter_slopes, only: parameter_slope
   use fw_parameter_slopes, only: slope_finder
   use fw_parameters, only: harmonic_scale
   use fw_parameters, only: is_of_matrices
   use fw_parameters, only: is_per_pair
   use fw_parameters, only: is_per_spring
   implicit none (type, external)
   private

   public :: find_varied_slope

contains

   !> Sum over the numbers that the parameter is made of, at the motion x where the state was
   !> evaluated and linearized; `work` is F_1^H U_1 there.
   subroutine find_varied_slope(mover, finder, state, x, slope, work)
      type(parameter_problem), intent(in) :: mover
      type(slope_finder), intent(inout) :: finder
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      type(parameter_slope), intent(out) :: slope
      complex(wp), intent(in) :: work
      type(parameter_slope) :: one
      type(parameter_entry) :: entry
      real(wp) :: rate
      integer :: i

      call finder%start(state)
      call finder%prepare(state, x)
      entry%number = mover%number
      associate (values => mover%values_at(mover%value))
         do i = 1, size(values)
            entry%value = values(i)
            if (is_per_pair(mover%number) .or. is_per_spring(mover%number)) entry%element = i
            if (is_of_matrices(mover%number)) entry%change = findloc( &
               mover%case%model%changes%parameter, mover%number, dim=1)
            call finder%find(state, entry, one)
            rate = 1.0_wp
            if (mover%by_factor) rate = mover%base(i)
            if (i == 1) then
               slope = one
               slope%residual = rate*one%residual
               slope%work = rate*one%work
            else
               slope%residual = slope%residual + rate*one%residual
               slope%work = slope%work + rate*one%work
            end if
         end do
         ! F^H U has the load twice: linear in the coordinates, quadratic behind the condensation.
         if (mover%number == harmonic_scale) then
            rate = 1.0_wp
            if (mover%by_factor) rate = mover%base(1)
            slope%work = rate*(work + finder%work_at_rest)/values(1)
         end if
      end associate
   end subroutine find_varied_slope

end module fw_varied_slope
