!> Free decay of a structure with contact: it is released at rest, away from its equilibrium, and
!> integrated in time (fw_time_stepper) without a load that vibrates.
!>
!> Pairs remember how they came to the start: from the equilibrium along a straight way, on which
!> the elastic ones slip as far as their normal forces let them.
module fw_free_decay
   use fw_error, only: error_type, fatal_error, status_failure
   use fw_interrupt, only: interrupt_type, stop_run
   use fw_kinds, only: pi, wp
   use fw_time_solution, only: row_memory, time_state
   use fw_time_stepper, only: new_time_stepper, time_stepper
   use fw_time_structure, only: time_structure
   implicit none (type, external)
   private

   public :: bring_to_start, find_extremes, integrate_decay

   !> Steps of the way from the equilibrium: normal forces may change on it, and with them the limit
   !> of slip.
   integer, parameter :: steps_of_way = 1000

contains

   !> Move from the equilibrium in `state` to the start, `state` plus `shape`, and what pairs
   !> remember with it.
   subroutine bring_to_start(structure, shape, state)
      type(time_structure), intent(in) :: structure
      !> Displacement that is added (n_dof) [length].
      real(wp), intent(in) :: shape(:)
      type(time_state), intent(inout) :: state
      real(wp) :: rest(structure%n_rows), way(structure%n_rows), here(structure%n_rows)
      integer :: i, k

      rest = matmul(state%displacement, structure%rows)
      way = matmul(shape, structure%rows)
      do k = 1, steps_of_way
         here = rest + real(k, wp)/real(steps_of_way, wp)*way
         do i = 1, structure%n_pairs
            if (.not. structure%at_once(i)) call slip_to(structure, i, here, state%corrected(:, i))
         end do
      end do
      state%displacement = state%displacement + shape
      state%velocity = 0.0_wp
   end subroutine bring_to_start

   !> The corrected position of a pair follows where its force would be beyond the limit.
   pure subroutine slip_to(structure, pair, here, corrected)
      type(time_structure), intent(in) :: structure
      integer, intent(in) :: pair
      !> Relative displacements (n_rows) [length].
      real(wp), intent(in) :: here(:)
      !> Tangential (2) [length].
      real(wp), intent(inout) :: corrected(2)
      real(wp) :: force(2), limit, pressure, size_of_force
      integer :: c, r

      pressure = structure%normal_load(pair)
      r = structure%row(3, pair)
      ! Rigid normals: their row does not move along the way, and neither do rigid tangents.
      if (r > 0) then
         if (structure%compliance(r) > 0.0_wp) pressure = &
            max(0.0_wp, -(here(r) + structure%gap(pair))/structure%compliance(r))
      end if
      force = 0.0_wp
      do c = 1, 2
         r = structure%row(c, pair)
         if (r == 0) cycle
         if (structure%compliance(r) > 0.0_wp) then
            force(c) = (here(r) - corrected(c))/structure%compliance(r)
         else
            corrected(c) = here(r)
         end if
      end do
      limit = structure%mu(pair)*pressure
      size_of_force = norm2(force)
      if (size_of_force <= limit) return
      do c = 1, 2
         r = structure%row(c, pair)
         if (r == 0) cycle
         if (structure%compliance(r) > 0.0_wp) corrected(c) = here(r) - &
            structure%compliance(r)*force(c)*limit/size_of_force
      end do
   end subroutine slip_to

   !> Integrate over n periods of omega [rad/time].
   subroutine integrate_decay(structure, observe, omega, n_cycles, steps_per_period, start, &
                              time, observed, error, interrupt)
      type(time_structure), intent(in) :: structure
      !> Observed quantities (n_observed, n_dof).
      real(wp), intent(in) :: observe(:, :)
      real(wp), intent(in) :: omega
      integer, intent(in) :: n_cycles, steps_per_period
      type(time_state), intent(in) :: start
      !> (n_cycles steps_per_period) [time], and the observed quantities then
      !> (n_observed, n_cycles steps_per_period).
      real(wp), allocatable, intent(out) :: time(:), observed(:, :)
      !> status_failure where a step is not solved, status_stopped where the run is to end.
      type(error_type), allocatable, intent(out) :: error
      class(interrupt_type), pointer, intent(in) :: interrupt
      type(time_stepper) :: stepper
      real(wp), allocatable :: state(:), finish(:)
      real(wp) :: range
      integer :: i, k, n
      logical :: done

      call new_time_stepper(structure, observe, omega, steps_per_period, stepper, error)
      if (allocated(error)) return
      stepper%interrupt => interrupt
      state = stepper%pack_state(start%displacement, start%velocity, &
                                 row_memory(structure, start%corrected))
      allocate (finish, mold=state)
      n = steps_per_period
      allocate (time(n*n_cycles), observed(size(observe, 1), n*n_cycles))
      do k = 1, n_cycles
         call stepper%integrate(state, finish, range, done)
         call stop_run(interrupt, error)
         if (.not. allocated(error) .and. stepper%complaint /= '') then
            call fatal_error(error, 'free decay: '//trim(stepper%complaint), status_failure)
         else if (.not. allocated(error) .and. (stepper%record%n_failed > 0 .or. .not. done)) then
            call fatal_error(error, 'free decay: the contact of a step was not solved: take '// &
                             'more ringdown%steps_per_period', status_failure)
         end if
         if (allocated(error)) return
         time((k - 1)*n + 1:k*n) = 2.0_wp*pi/omega* &
            [(real(k - 1, wp) + real(i - 1, wp)/real(n, wp), i=1, n)]
         observed(:, (k - 1)*n + 1:k*n) = stepper%record%observed + stepper%record%observed_mean
         state = finish
      end do
   end subroutine integrate_decay

   !> Extremes of the first of several series, its start included, as the tops of parabolas through
   !> three samples, and the others there.
   subroutine find_extremes(time, observed, least, at, value)
      !> (n) [time]
      real(wp), intent(in) :: time(:)
      !> (n_observed, n) [length]
      real(wp), intent(in) :: observed(:, :)
      !> Swings below it are round-off [length].
      real(wp), intent(in) :: least
      !> (n_extremes) [time], and all series then (n_observed, n_extremes) [length].
      real(wp), allocatable, intent(out) :: at(:), value(:, :)
      real(wp) :: place, before, behind
      real(wp) :: top(size(observed, 1))
      real(wp), allocatable :: found_at(:), found(:, :)
      integer :: k, n

      allocate (found_at(size(time)), found(size(observed, 1), size(time)))
      n = 1
      found_at(1) = time(1)
      found(:, 1) = observed(:, 1)
      do k = 2, size(time) - 1
         before = observed(1, k) - observed(1, k - 1)
         behind = observed(1, k + 1) - observed(1, k)
         if (.not. before*behind < 0.0_wp) cycle
         ! Of the parabola, whose curvature is behind - before.
         place = 0.5_wp*(before + behind)/(before - behind)
         top = observed(:, k) + 0.5_wp*place*(observed(:, k + 1) - observed(:, k - 1)) + &
               0.5_wp*place**2*(observed(:, k + 1) - 2.0_wp*observed(:, k) + observed(:, k - 1))
         if (abs(top(1) - found(1, n)) <= least) cycle
         n = n + 1
         found_at(n) = time(k) + place*(time(2) - time(1))
         found(:, n) = top
      end do
      at = found_at(:n)
      value = found(:, :n)
   end subroutine find_extremes

end module fw_free_decay
