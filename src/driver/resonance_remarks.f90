!> What a resonance over a parameter makes worth saying: an optimum, another peak that has become
!> the larger one.
module fw_resonance_remarks
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_parameters, only: parameter_words
   use fw_remarks, only: remark_list
   use fw_resonance_group, only: resonance_table
   use fw_resonance_options, only: condition_phase
   use fw_resonance_track, only: resonance_track
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: remark_resonance

   !> By how much another point has to be larger: a phase resonance is not the largest itself.
   real(wp), parameter :: larger = 1.0e-6_wp, larger_by_phase = 0.05_wp

contains

   !> After the last point.
   subroutine remark_resonance(case, track, table, n_corners, observer, remarks, error)
      type(case_type), intent(in) :: case
      type(resonance_track), intent(inout), target :: track
      type(resonance_table), intent(in) :: table
      !> Points at which the maximum is a corner.
      integer, intent(in) :: n_corners
      class(observer_type), intent(inout), target :: observer
      type(remark_list), intent(inout) :: remarks
      type(error_type), allocatable, intent(out) :: error

      if (n_corners > 0) call remarks%add('corner at the resonance', 'at '// &
         to_text(n_corners)//' of '//to_text(table%n)//' points the response has a corner at '// &
         'its maximum (a pair changes its state there, or contact is decided at instants): '// &
         'frequencies are good to a millionth, and have no derivative')
      call remark_optimum(case, table, remarks)
      call remark_other_peak(case, track, table, observer, remarks, error)
   end subroutine remark_resonance

   !> The smallest value where it is no end.
   subroutine remark_optimum(case, table, remarks)
      type(case_type), intent(in) :: case
      type(resonance_table), intent(in) :: table
      type(remark_list), intent(inout) :: remarks
      integer :: k

      if (table%n < 3) return
      associate (row => table%row(:table%n))
         k = minloc(row%value, dim=1)
         if (k == 1 .or. k == table%n) return
         call remarks%add('optimum', 'the resonance is smallest near '// &
                          trim(parameter_words(case%resonance%parameter))//' = '// &
                          to_text(row(k)%parameter)//' ('//to_text(row(k)%value)//' at '// &
                          to_text(row(k)%omega)//' rad/s)')
      end associate
   end subroutine remark_optimum

   !> A sweep at the last value shows whether the peak that was followed still is the largest.
   subroutine remark_other_peak(case, track, table, observer, remarks, error)
      type(case_type), intent(in) :: case
      type(resonance_track), intent(inout), target :: track
      type(resonance_table), intent(in) :: table
      class(observer_type), intent(inout), target :: observer
      type(remark_list), intent(inout) :: remarks
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)
      real(wp) :: value, margin

      call track%sweep(observer, x, value, error)
      if (allocated(error) .or. .not. allocated(x)) return
      margin = larger
      if (case%resonance%condition == condition_phase) margin = larger_by_phase
      associate (last => table%row(table%n))
         if (value <= (1.0_wp + margin)*last%value) return
         call remarks%add('another peak', 'at '// &
                          trim(parameter_words(case%resonance%parameter))//' = '// &
                          to_text(last%parameter)//' the sweep is larger at '// &
                          to_text(x(size(x)))//' rad/s ('//to_text(value)//') than at the '// &
                          'resonance that was followed ('//to_text(last%value)//' at '// &
                          to_text(last%omega)//' rad/s): another peak has become the largest')
      end associate
   end subroutine remark_other_peak

end module fw_resonance_remarks
