!> Periodic response by integration in time, with the method that the structure needs: the
!> reference for harmonic balance on the same model, contact laws and loads.
module fw_time_solution
   use fw_interrupt, only: interrupt_type, stop_run
   use fw_kinds, only: wp
   use fw_error, only: error_type, fatal_error, status_failure
   use fw_motion, only: follow_motion, motion_type
   use fw_period_record, only: averaged_coefficients, largest_sample, period_record, &
      sampled_coefficients
   use fw_periodic_state, only: find_periodic_state, period_map, periodic_report
   use fw_point, only: point_type
   use fw_recovery, only: overtaking_of
   use fw_smooth_integration, only: is_smooth, new_smooth_integration, smooth_integration
   use fw_time_options, only: time_options
   use fw_time_stepper, only: new_time_stepper, time_stepper
   use fw_time_structure, only: time_structure
   implicit none (type, external)
   private

   public :: integrate_in_time, row_memory, time_state

   !> Where the integration starts, at t = 0.
   type :: time_state
      !> Displacement and velocity (n_dof).
      real(wp), allocatable :: displacement(:), velocity(:)
      !> Corrected tangential position of the pairs [length] (2, n_pairs).
      real(wp), allocatable :: corrected(:, :)
   end type time_state

contains

   !> Integrate to the periodic state and fill a point: coefficients up to n_harmonics, amplitudes,
   !> contact forces, shares and work; `iterations` are the periods, `residual` the change from
   !> one period to the next.
   subroutine integrate_in_time(structure, observe, omega, options, tolerance, state, n_harmonics, &
                                point, error, interrupt, motion)
      type(time_structure), intent(in) :: structure
      !> Observed quantities (n_observed, n_dof).
      real(wp), intent(in) :: observe(:, :)
      real(wp), intent(in) :: omega
      type(time_options), intent(in) :: options
      !> On the relative change from one period to the next.
      real(wp), intent(in) :: tolerance
      type(time_state), intent(in) :: state
      !> At most half of the steps.
      integer, intent(in) :: n_harmonics
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      !> What may end it early (default: nothing); a stop of the run is an error of status_stopped.
      class(interrupt_type), pointer, intent(in), optional :: interrupt
      !> What the motion from there does: then it is followed as it is before a search.
      type(motion_type), intent(out), optional :: motion
      type(periodic_report) :: report
      type(smooth_integration) :: smooth
      type(time_stepper) :: stepper
      real(wp), allocatable :: vector(:)
      logical :: smoothly

      smoothly = is_smooth(structure, omega)
      if (smoothly) then
         call new_smooth_integration(structure, observe, omega, options%steps_per_period, smooth)
         if (present(interrupt)) smooth%interrupt => interrupt
         vector = [state%displacement, state%velocity]
         call find_motion(smooth, options%n_periods, tolerance, vector, report, motion)
         call stop_run(smooth%interrupt, error)
         if (.not. allocated(error) .and. smooth%complaint /= '') then
            call fatal_error(error, 'integration in time: '//trim(smooth%complaint), status_failure)
         end if
         if (allocated(error)) return
         call fill_point(smooth%record, n_harmonics, point)
      else
         ! Contact, massless directions and frequencies far above the load all go through midpoint
         ! steps, which are stable for every step.
         call new_time_stepper(structure, observe, omega, options%steps_per_period, stepper, error)
         if (allocated(error)) return
         if (present(interrupt)) stepper%interrupt => interrupt
         vector = stepper%pack_state(state%displacement, state%velocity, &
                                     row_memory(structure, state%corrected))
         call find_motion(stepper, options%n_periods, tolerance, vector, report, motion)
         call stop_run(stepper%interrupt, error)
         if (.not. allocated(error) .and. stepper%complaint /= '') then
            call fatal_error(error, 'integration in time: '//trim(stepper%complaint), &
                             status_failure)
         end if
         if (allocated(error)) return
         call fill_point(stepper%record, n_harmonics, point)
         call find_overtaking(structure, stepper%record, omega, n_harmonics, point)
         ! A step whose contact problem was not solved does not obey the equations, even if the
         ! period repeats.
         report%converged = report%converged .and. stepper%record%n_failed == 0
      end if
      point%omega = omega
      point%iterations = report%n_periods
      point%residual = report%change
      point%converged = report%converged
   end subroutine integrate_in_time

   !> The periodic state, or what a motion comes to where that is asked for.
   subroutine find_motion(map, n_periods, tolerance, state, report, motion)
      class(period_map), intent(inout) :: map
      integer, intent(in) :: n_periods
      real(wp), intent(in) :: tolerance
      real(wp), intent(inout), contiguous :: state(:)
      type(periodic_report), intent(out) :: report
      type(motion_type), intent(out), optional :: motion

      if (present(motion)) then
         call follow_motion(map, n_periods, tolerance, state, report, motion)
      else
         call find_periodic_state(map, n_periods, tolerance, state, report)
      end if
   end subroutine find_motion

   !> Corrected positions by rows (n_rows).
   pure function row_memory(structure, corrected) result(memory)
      type(time_structure), intent(in) :: structure
      !> Tangential positions of the pairs [length] (2, n_pairs).
      real(wp), intent(in) :: corrected(:, :)
      real(wp) :: memory(structure%n_rows)
      integer :: i, c

      memory = 0.0_wp
      do i = 1, structure%n_pairs
         do c = 1, 2
            if (structure%row(c, i) > 0) memory(structure%row(c, i)) = corrected(c, i)
         end do
      end do
   end function row_memory

   !> Whether pairs that bear overtake the side 2 that slides under them.
   subroutine find_overtaking(structure, record, omega, n_harmonics, point)
      type(time_structure), intent(in) :: structure
      type(period_record), intent(in) :: record
      real(wp), intent(in) :: omega
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      real(wp) :: motion(2*n_harmonics + 1, 2)
      integer :: c, i

      if (.not. any(abs(structure%speed) > 0.0_wp)) return
      allocate (point%overtaking(structure%n_pairs), source=0.0_wp)
      do i = 1, structure%n_pairs
         ! Without a force nothing turns.
         if (all(abs(record%force(:, i, :)) <= 0.0_wp)) cycle
         do c = 1, 2
            motion(:, c) = averaged_coefficients(record%slip(c, i, :), n_harmonics)
         end do
         point%overtaking(i) = overtaking_of(motion, structure%speed(i, :), omega)
      end do
   end subroutine find_overtaking

   !> Harmonics of the recorded period, as those of a balance are reported.
   subroutine fill_point(record, n_harmonics, point)
      type(period_record), intent(in) :: record
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      integer :: c, i, n_observed, n_pairs

      n_observed = size(record%observed, 1)
      n_pairs = size(record%work)
      allocate (point%coefficients(2*n_harmonics + 1, n_observed), point%amplitude(n_observed))
      ! Directions with mass are known at the starts of the steps, massless ones as means over
      ! them; each observed quantity is the sum of both parts.
      point%history = transpose(record%observed + record%observed_mean)
      do i = 1, n_observed
         point%coefficients(:, i) = sampled_coefficients(record%observed(i, :), n_harmonics) + &
                                    averaged_coefficients(record%observed_mean(i, :), n_harmonics)
         point%amplitude(i) = largest_sample(point%history(:, i))
      end do
      if (n_pairs == 0) return
      allocate (point%force(3, n_pairs, 2*n_harmonics + 1))
      do i = 1, n_pairs
         do c = 1, 3
            point%force(c, i, :) = averaged_coefficients(record%force(c, i, :), n_harmonics)
         end do
      end do
      point%fraction = record%share
      point%dissipation = record%work
      point%obstacle_work = record%obstacle_work
      point%force_history = record%force
      point%slip_history = record%slip
   end subroutine fill_point

end module fw_time_solution
