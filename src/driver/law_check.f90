!> Slopes that laws of a user give, compared with differences of their forces before a run.
!>
!> Motions are those of the linear solution with all pairs closed, at 0.1, 1 and 3 times its size
!> and with 1 % of noise. Central differences with three steps, of which the best counts; where the
!> differences to both sides disagree the force has a corner, and nothing is compared.
module fw_law_check
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_element_group, only: element_group
   use fw_error, only: error_type, fatal_error, status_input
   use fw_guess, only: stuck_guess
   use fw_kinds, only: pi, wp
   use fw_problem, only: build_system
   use fw_text, only: to_text
   use fw_user_element, only: law_report, user_element
   implicit none (type, external)
   private

   public :: check_user_laws, clear_reports, raise_of_laws

   integer, parameter :: n_instants = 20
   real(wp), parameter :: sizes(*) = [0.1_wp, 1.0_wp, 3.0_wp], noise = 0.01_wp, &
                          steps(*) = [1.0e-3_wp, 1.0e-4_wp, 1.0e-5_wp]
   !> Disagreement of one-sided differences, over the largest slope, that is a corner with the
   !> smallest step: curvature leaves less.
   real(wp), parameter :: corner = 1.0e-2_wp

   !> Motions of one element (n_in, n_instants), and what it says of them.
   type :: trial_type
      real(wp) :: omega = 0.0_wp
      real(wp), allocatable :: tau(:), u(:, :), v(:, :), force(:, :), by_u(:, :, :), by_v(:, :, :)
   end type trial_type

contains

   !> Nothing has been said so far.
   subroutine clear_reports(case)
      type(case_type), intent(in) :: case
      type(law_report), pointer :: report
      integer :: i, k

      if (.not. allocated(case%elements%slot)) return
      do k = 1, size(case%elements%slot)
         associate (group => case%elements%slot(k)%group)
            if (.not. allocated(group%function)) cycle
            do i = 1, size(group%function)
               report => group%function(i)%report
               if (associated(report)) report%text = ''
            end do
         end associate
      end do
   end subroutine clear_reports

   !> The error of a function that has asked for the end of the run, in place of another one.
   subroutine raise_of_laws(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(inout) :: error
      integer :: i, k

      if (.not. allocated(case%elements%slot)) return
      do k = 1, size(case%elements%slot)
         associate (group => case%elements%slot(k)%group)
            if (.not. allocated(group%function)) cycle
            do i = 1, size(group%function)
               if (.not. associated(group%function(i)%report)) cycle
               if (group%function(i)%report%text == '') cycle
               if (allocated(error)) deallocate (error)
               call fatal_error(error, trim(group%function(i)%report%text))
               return
            end do
         end associate
      end do
   end subroutine raise_of_laws

   subroutine check_user_laws(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(case%elements%slot)) return
      do k = 1, size(case%elements%slot)
         associate (group => case%elements%slot(k)%group)
            if (.not. group%check .or. .not. allocated(group%function)) cycle
            if (.not. any(group%function%has_derivative)) cycle
            call check_group(case, k, group, error)
            if (allocated(error)) return
         end associate
      end do
   end subroutine check_user_laws

   subroutine check_group(case, kind, group, error)
      type(case_type), intent(in) :: case
      integer, intent(in) :: kind
      class(element_group), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      type(balance_problem), target :: problem
      type(balance_state) :: system
      real(wp), allocatable :: x(:), y(:, :, :)
      integer :: i, s

      call build_system(case, problem, system, error)
      if (allocated(error)) return
      if (system%n == 0) return
      call system%set_frequency(case%sweep%start, error)
      if (allocated(error)) return
      allocate (x(system%n))
      call stuck_guess(system, x)
      associate (entry => problem%forces%entry(problem%forces%elements(kind)))
         allocate (y(size(entry%row, 2), size(entry%row, 1), problem%fourier%n_coefficients))
         call problem%incidence%gather(entry%rows, problem%structure%n_coordinates, &
                                       problem%fourier%n_coefficients, x, y)
      end associate
      do i = 1, group%n_elements
         if (.not. group%function(i)%has_derivative) cycle
         do s = 1, size(sizes)
            call check_element(case, group, i, sizes(s), problem, y(i, :, :), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine check_group

   !> One element at motions of a size.
   subroutine check_element(case, group, i, size_of, problem, y, error)
      type(case_type), intent(in) :: case
      class(element_group), intent(in) :: group
      integer, intent(in) :: i
      real(wp), intent(in) :: size_of
      type(balance_problem), intent(in) :: problem
      !> Coefficients of the inputs (n_in, n_coefficients).
      real(wp), intent(in) :: y(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(trial_type) :: trial
      real(wp), allocatable :: slope(:, :, :)
      integer :: j, status, instant
      logical :: of_rate
      integer :: turn

      associate (element => group%function(i))
         call make_motion(case%sweep%start, size_of, problem, y(:element%n_in, :), trial)
         call element%ask(trial%omega, trial%tau, trial%u, trial%v, .true., trial%force, &
                          trial%by_u, trial%by_v, status, instant)
         ! What it has no force for shows in the solution, if that comes there.
         if (status /= 0) return
         do turn = 1, 2
            of_rate = turn == 2
            do j = 1, element%n_in
               slope = trial%by_u
               if (of_rate) slope = trial%by_v
               call check_input(group, i, j, of_rate, trial, slope, error)
               if (allocated(error)) return
            end do
         end do
      end associate
   end subroutine check_element

   !> Slopes by one displacement or rate.
   subroutine check_input(group, i, j, of_rate, trial, slope, error)
      class(element_group), intent(in) :: group
      integer, intent(in) :: i, j
      logical, intent(in) :: of_rate
      type(trial_type), intent(inout) :: trial
      real(wp), intent(in) :: slope(:, :, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(trial%u, 1), n_instants) :: ahead, behind, found, best, apart, given
      real(wp) :: largest, step, unit
      integer :: at(2), k

      given = slope(j, :, :)
      best = huge(1.0_wp)
      found = 0.0_wp
      unit = merge(maxval(abs(trial%v(j, :))), maxval(abs(trial%u(j, :))), of_rate)
      if (.not. unit > 0.0_wp) return
      do k = 1, size(steps)
         step = steps(k)*unit
         call force_at(group%function(i), trial, j, of_rate, step, ahead)
         call force_at(group%function(i), trial, j, of_rate, -step, behind)
         apart = abs(ahead + behind - 2.0_wp*trial%force)/step
         ahead = 0.5_wp*(ahead - behind)/step
         where (abs(ahead - given) < abs(best))
            best = ahead - given
            found = ahead
         end where
      end do
      largest = max(maxval(abs(given)), maxval(abs(found)))
      if (.not. largest > 0.0_wp) return
      ! Corners are left out.
      where (apart > corner*largest) best = 0.0_wp
      if (maxval(abs(best)) <= group%check_tolerance*largest) return
      at = maxloc(abs(best))
      call fatal_error(error, 'the derivative of user law '//trim(group%function(i)%name)// &
                       ' (element '//to_text(i)//') is wrong: of force '//to_text(at(1))//' by '// &
                       trim(merge('velocity    ', 'displacement', of_rate))//' '//to_text(j)// &
                       ' at u = '//to_text(trial%u(j, at(2)))//', v = '// &
                       to_text(trial%v(j, at(2)))//' it gives '// &
                       to_text(given(at(1), at(2)))//', differences '// &
                       to_text(found(at(1), at(2)))//"; mend it, or take derivative = "// &
                       "'difference' (check = .false. leaves this test out)", status_input)
   end subroutine check_input

   !> Forces where one input is shifted.
   subroutine force_at(element, trial, j, of_rate, shift, force)
      type(user_element), intent(in) :: element
      type(trial_type), intent(inout) :: trial
      integer, intent(in) :: j
      logical, intent(in) :: of_rate
      real(wp), intent(in) :: shift
      real(wp), intent(out), contiguous :: force(:, :)
      real(wp) :: none(size(force, 1), size(force, 1), 0)
      integer :: status, instant

      call move(shift)
      call element%ask(trial%omega, trial%tau, trial%u, trial%v, .false., force, none, none, &
                       status, instant)
      call move(-shift)
      if (status /= 0) force = trial%force

   contains

      subroutine move(by)
         real(wp), intent(in) :: by

         if (of_rate) then
            trial%v(j, :) = trial%v(j, :) + by
         else
            trial%u(j, :) = trial%u(j, :) + by
         end if
      end subroutine move

   end subroutine force_at

   !> The motion at the instants, with noise of numbers that always are the same.
   subroutine make_motion(omega, size_of, problem, y, trial)
      real(wp), intent(in) :: omega, size_of
      type(balance_problem), intent(in) :: problem
      real(wp), intent(in) :: y(:, :)
      type(trial_type), intent(out) :: trial
      real(wp) :: n, unit
      integer :: h, j, k, m, seed

      m = size(y, 1)
      trial%omega = omega
      trial%tau = [(2.0_wp*pi*k/n_instants, k=0, n_instants - 1)]
      allocate (trial%u(m, n_instants), trial%v(m, n_instants), trial%force(m, n_instants), &
                source=0.0_wp)
      allocate (trial%by_u(m, m, n_instants), trial%by_v(m, m, n_instants), source=0.0_wp)
      do h = 1, problem%fourier%n_retained
         n = real(problem%fourier%harmonic(h), wp)
         k = problem%fourier%column(h)
         do j = 1, m
            trial%u(j, :) = trial%u(j, :) + size_of*y(j, k)*cos(n*trial%tau)
            if (problem%fourier%harmonic(h) == 0) cycle
            trial%u(j, :) = trial%u(j, :) + size_of*y(j, k + 1)*sin(n*trial%tau)
            trial%v(j, :) = trial%v(j, :) + size_of*omega*n* &
                            (y(j, k + 1)*cos(n*trial%tau) - y(j, k)*sin(n*trial%tau))
         end do
      end do
      ! Where nothing moves, something has to, by the size of what does, or by 1.
      unit = maxval(abs(trial%u))
      if (.not. unit > 0.0_wp) unit = size_of
      seed = 12345
      do k = 1, n_instants
         do j = 1, m
            trial%u(j, k) = trial%u(j, k) + noise*unit*next()
            trial%v(j, k) = trial%v(j, k) + noise*unit*omega*next()
         end do
      end do

   contains

      !> From -1 to 1.
      real(wp) function next()
         ! A small generator: its products stay within 32 bits.
         seed = modulo(seed*171, 30269)
         next = 2.0_wp*seed/30269.0_wp - 1.0_wp
      end function next

   end subroutine make_motion

end module fw_law_check
