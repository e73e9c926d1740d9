!> Time of the contact forces and their derivative for each pair, with events and with uniform
!> sampling, in one and in two tangential directions. Writes comma-separated lines; the error is
!> the largest one of a coefficient against events on 2048 angles.
program events
   use, intrinsic :: iso_fortran_env, only: int64, output_unit
   use fw_force_law, only: force_workspace
   use fw_fourier, only: fourier_type
   use fw_fourier, only: new_fourier
   use fw_friction, only: friction_law
   use fw_friction, only: rigid_friction
   use fw_kinds, only: wp
   use fw_pair_law, only: pair_law
   implicit none (type, external)

   integer, parameter :: n_pairs = 24, n_samples = 7
   integer, parameter :: harmonics(*) = [3, 7, 15]
   real(wp) :: numbers(n_pairs, 3, 2*maxval(harmonics) + 1)
   integer :: h, d

   call random_init(.true., .true.)
   call random_number(numbers)
   numbers = 2.0_wp*numbers - 1.0_wp
   write (output_unit, '(a)') 'directions,n_harmonics,sampling,n_time,'// &
      'evaluate_us,linearize_us,error'
   do d = 1, 2
      do h = 1, size(harmonics)
         call compare(d, harmonics(h))
      end do
   end do

contains

   subroutine compare(directions, n_harmonics)
      integer, intent(in) :: directions, n_harmonics
      type(force_workspace) :: exact
      real(wp) :: unused(2)

      call measure(directions, n_harmonics, .true., 2048, exact, unused)
      call report(directions, n_harmonics, .true., merge(4, 8, directions == 1)*n_harmonics, exact)
      call report(directions, n_harmonics, .false., 64, exact)
      call report(directions, n_harmonics, .false., 1024, exact)
   end subroutine compare

   subroutine report(directions, n_harmonics, by_events, n_time, exact)
      integer, intent(in) :: directions, n_harmonics, n_time
      logical, intent(in) :: by_events
      type(force_workspace), intent(in) :: exact
      type(force_workspace) :: forces
      real(wp) :: seconds(2)

      call measure(directions, n_harmonics, by_events, n_time, forces, seconds)
      write (output_unit, '(2(i0, ","), a, ",", i0, 3(",", es10.3))') directions, n_harmonics, &
         trim(merge('events ', 'uniform', by_events)), n_time, 1.0e6_wp*seconds/n_pairs, &
         maxval(abs(forces%force - exact%force))
   end subroutine report

   !> Medians of the times of evaluate and linearize [s].
   subroutine measure(directions, n_harmonics, by_events, n_time, forces, seconds)
      integer, intent(in) :: directions, n_harmonics, n_time
      logical, intent(in) :: by_events
      type(force_workspace), intent(out) :: forces
      real(wp), intent(out) :: seconds(2)
      type(fourier_type) :: fourier
      type(friction_law) :: at_instants
      class(pair_law), allocatable :: law
      logical :: present(3, n_pairs)
      real(wp) :: samples(2, n_samples)
      integer(int64) :: clock(3), rate
      integer :: i, k

      fourier = new_fourier(n_harmonics, n_time)
      present = .true.
      present(2, :) = directions == 2
      at_instants = rigid_friction()
      call at_instants%take_pairs([(0.1_wp + 0.9_wp*i/n_pairs, i=1, n_pairs)], present)
      if (by_events) then
         call at_instants%located(law)
      else
         allocate (law, source=at_instants)
      end if
      call law%reserve(fourier, forces)
      do k = 1, fourier%n_coefficients
         forces%prediction(:, :, k) = numbers(:, :, k)/(1 + k/2)
      end do
      if (directions == 1) forces%prediction(:, 2, :) = 0.0_wp
      forces%offset = -1.0_wp
      do i = 1, n_samples
         call system_clock(clock(1), rate)
         call law%evaluate(fourier, forces)
         call system_clock(clock(2))
         call law%linearize(fourier, forces)
         call system_clock(clock(3))
         samples(:, i) = real(clock(2:3) - clock(1:2), wp)/real(rate, wp)
      end do
      do k = 1, 2
         seconds(k) = median(samples(k, :))
      end do
   end subroutine measure

   !> The middle of an odd number of values.
   pure real(wp) function median(values)
      real(wp), intent(in) :: values(:)
      integer :: i

      median = values(1)
      do i = 1, size(values)
         if (count(values < values(i)) > size(values)/2) cycle
         if (count(values > values(i)) > size(values)/2) cycle
         median = values(i)
      end do
   end function median

end program events
