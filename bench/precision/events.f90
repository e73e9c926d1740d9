!> Time of the contact forces and their derivative for each pair, with events and with uniform
!> sampling, in one and in two tangential directions, the amplitudes falling as a power of the
!> harmonic. Forces are evaluated from rest, and again from where that ended. Writes comma-separated
!> lines; errors are the largest and the median one of the pairs, each in its worst coefficient,
!> against events in the period started elsewhere: that moves all steps of slip. Pairs that end
!> where their start leads them, with next to no slip, count as exact.
program events
   use, intrinsic :: iso_fortran_env, only: output_unit
   use fw_force_law, only: force_workspace
   use fw_fourier, only: fourier_type, new_fourier
   use fw_friction, only: friction_law, rigid_friction
   use fw_kinds, only: wp
   use fw_pair_law, only: pair_law
   implicit none (type, external)

   integer, parameter :: n_pairs = 96, n_samples = 21
   integer, parameter :: harmonics(*) = [1, 3, 7, 15]
   !> Where the period of the reference starts.
   real(wp), parameter :: delay = 0.37_wp
   real(wp) :: numbers(n_pairs, 3, 2*maxval(harmonics) + 1)
   logical :: slips(n_pairs)
   integer :: h, d, p

   call random_init(.true., .true.)
   call random_number(numbers)
   numbers = 2.0_wp*numbers - 1.0_wp
   write (output_unit, '(a)') 'directions,power,n_harmonics,sampling,n_time,'// &
      'from_rest_us,again_us,linearize_us,error,median_error'
   do d = 1, 2
      do p = 1, 2
         do h = 1, size(harmonics)
            call compare(d, p, harmonics(h))
         end do
      end do
   end do

contains

   subroutine compare(directions, power, n_harmonics)
      integer, intent(in) :: directions, power, n_harmonics
      type(force_workspace) :: exact
      real(wp) :: unused(3)

      call measure(directions, power, n_harmonics, .true., instants(n_harmonics), delay, exact, &
                   unused)
      call report(directions, power, n_harmonics, .true., instants(n_harmonics), exact)
      call report(directions, power, n_harmonics, .false., 16*n_harmonics, exact)
      call report(directions, power, n_harmonics, .false., 1024, exact)
   end subroutine compare

   !> Those that isolate events.
   pure integer function instants(n_harmonics)
      integer, intent(in) :: n_harmonics

      instants = max(8, 4*n_harmonics + 2)
   end function instants

   subroutine report(directions, power, n_harmonics, by_events, n_time, exact)
      integer, intent(in) :: directions, power, n_harmonics, n_time
      logical, intent(in) :: by_events
      type(force_workspace), intent(in) :: exact
      type(force_workspace) :: forces
      real(wp) :: seconds(3), error(n_pairs)
      integer :: i

      call measure(directions, power, n_harmonics, by_events, n_time, 0.0_wp, forces, seconds)
      error = 0.0_wp
      do i = 1, n_pairs
         if (.not. slips(i)) cycle
         error(i) = maxval(abs(forces%force(i, :, :) - exact%force(i, :, :)))
      end do
      write (output_unit, '(3(i0, ","), a, ",", i0, 5(",", es10.3))') directions, &
         power, n_harmonics, trim(merge('events ', 'uniform', by_events)), n_time, &
         1.0e6_wp*seconds/n_pairs, maxval(error), median(error)
   end subroutine report

   !> Medians of the processor times of evaluate, from rest and again, and linearize [s].
   subroutine measure(directions, power, n_harmonics, by_events, n_time, start, forces, seconds)
      integer, intent(in) :: directions, power, n_harmonics, n_time
      logical, intent(in) :: by_events
      !> Angle at which the period starts; the forces are turned back.
      real(wp), intent(in) :: start
      type(force_workspace), intent(out) :: forces
      real(wp), intent(out) :: seconds(3)
      type(fourier_type) :: fourier
      type(friction_law) :: at_instants
      class(pair_law), allocatable :: law
      logical :: present(3, n_pairs)
      real(wp) :: samples(3, n_samples), clock(4), share(3, n_pairs)
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
         forces%prediction(:, :, k) = numbers(:, :, k)/real(max(1, k/2), wp)**power
      end do
      if (directions == 1) forces%prediction(:, 2, :) = 0.0_wp
      call turn(forces%prediction, start)
      forces%offset = -1.6_wp
      do i = 1, n_samples
         forces%x_start = 0.0_wp
         call cpu_time(clock(1))
         call law%evaluate(fourier, forces)
         call cpu_time(clock(2))
         forces%x_start = forces%x
         call law%evaluate(fourier, forces)
         call cpu_time(clock(3))
         call law%linearize(fourier, forces)
         call cpu_time(clock(4))
         samples(:, i) = clock(2:4) - clock(1:3)
      end do
      call turn(forces%force, -start)
      if (abs(start) > 0.0_wp) then
         call law%fractions(forces, share)
         slips = share(2, :) > 0.01_wp .or. share(3, :) > 0.0_wp
      end if
      do k = 1, 3
         seconds(k) = median(samples(k, :))
      end do
   end subroutine measure

   !> Coefficients of a period that starts at another angle.
   pure subroutine turn(coefficient, angle)
      real(wp), intent(inout) :: coefficient(:, :, :)
      real(wp), intent(in) :: angle
      real(wp) :: c, s, old(2)
      integer :: i, j, k

      do k = 2, size(coefficient, 3), 2
         c = cos(angle*(k/2))
         s = sin(angle*(k/2))
         do j = 1, size(coefficient, 2)
            do i = 1, size(coefficient, 1)
               old = coefficient(i, j, k:k + 1)
               coefficient(i, j, k) = c*old(1) + s*old(2)
               coefficient(i, j, k + 1) = c*old(2) - s*old(1)
            end do
         end do
      end do
   end subroutine turn

   !> The middle value.
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
