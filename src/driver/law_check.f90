!> Laws of a user are looked at before a run: whether forces follow from the motion at the same
!> instant, or from that and the states, whether they are odd where that is promised, and whether
!> slopes that they give are those of their forces. None of this would show in a solution.
!>
!> Motions are those of the linear solution with all pairs closed, at 0.1, 1 and 3 times its size
!> and with 1 % of noise. Slopes: central differences with three steps, of which the best counts;
!> where the differences to both sides disagree the force has a corner, and nothing is compared.
module fw_law_check
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_element_group, only: element_group
   use fw_error, only: error_type, fatal_error, status_input
   use fw_guess, only: stuck_guess
   use fw_kinds, only: pi, wp
   use fw_step_room, only: new_step_answer, new_step_room, step_answer, step_room
   use fw_text, only: to_text
   use fw_user_element, only: user_element
   use fw_user_path, only: step_slopes
   implicit none (type, external)
   private

   public :: check_group

   !> Of what comes out of a step, over the whole size of what goes in: a hundred times the
   !> round-off of differences.
   real(wp), parameter :: negligible = 1.0e-9_wp
   !> Enough to meet both signs of displacements and rates several times.
   integer, parameter :: n_instants = 20
   !> Motions over the linear one; and steps of the differences over the size of the input: the
   !> longest serves forces with much round-off, the shortest those with much curvature.
   real(wp), parameter :: sizes(*) = [0.1_wp, 1.0_wp, 3.0_wp], noise = 0.01_wp, &
                          steps(*) = [1.0e-3_wp, 1.0e-4_wp, 1.0e-5_wp]
   !> Disagreement of one-sided differences, over the largest slope, that is a corner with the
   !> smallest step: curvature leaves less.
   real(wp), parameter :: corner = 1.0e-2_wp
   !> Of the largest force: what the same motion may be answered by again. A function does the same
   !> operations, but for sums whose order differs.
   real(wp), parameter :: same = 1.0e-9_wp

   !> Motions of one element (n_in, n_instants), and what it says of them.
   type :: trial_type
      real(wp) :: omega = 0.0_wp
      real(wp), allocatable :: tau(:), u(:, :), v(:, :), force(:, :), by_u(:, :, :), by_v(:, :, :)
   end type trial_type

contains

   !> Elements of a group, whose law has this place.
   subroutine check_group(problem, system, law, group, error)
      type(balance_problem), intent(in) :: problem
      type(balance_state), intent(inout) :: system
      integer, intent(in) :: law
      class(element_group), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), y(:, :, :)
      integer :: i, s

      ! A balance without joint has no motion of its elements that would be worth a test.
      if (system%n == 0) return
      ! With the joint stuck: no law has to be solved to have a motion of the right size.
      allocate (x(system%n))
      call stuck_guess(system, x)
      associate (entry => problem%forces%entry(law))
         allocate (y(size(entry%row, 2), size(entry%row, 1), problem%fourier%n_coefficients))
         call problem%incidence%gather(entry%rows, problem%structure%n_coordinates, &
                                       problem%fourier%n_coefficients, x, y)
      end associate
      do i = 1, group%n_elements
         do s = 1, size(sizes)
            call check_element(system%frequency(), group, i, sizes(s), problem, y(i, :, :), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine check_group

   !> One element at motions of a size.
   subroutine check_element(omega, group, i, size_of, problem, y, error)
      real(wp), intent(in) :: omega
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
         call make_motion(omega, size_of, problem, y(:element%n_in, :), trial)
         if (element%n_state > 0) then
            call check_walk(group, i, trial, error)
            if (element%has_derivative .and. .not. allocated(error)) then
               call check_step(group, i, trial, error)
            end if
            return
         end if
         call element%ask(trial%omega, trial%tau, trial%u, trial%v, element%has_derivative, &
                          trial%force, trial%by_u, trial%by_v, status, instant)
         ! What it has no force for shows in the solution, if that comes there.
         if (status /= 0) return
         call check_forces(group, i, trial, error)
         if (allocated(error) .or. .not. element%has_derivative) return
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

   !> Forces at the same motion again, its instants in reverse, and at the opposite motion half a
   !> period later.
   subroutine check_forces(group, i, trial, error)
      class(element_group), intent(in) :: group
      integer, intent(in) :: i
      type(trial_type), intent(in) :: trial
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: half = n_instants/2
      real(wp), dimension(size(trial%u, 1), n_instants) :: u, v, force
      real(wp) :: none(size(trial%u, 1), size(trial%u, 1), 0), largest, tau(n_instants)
      integer :: status, instant

      largest = maxval(abs(trial%force))
      associate (element => group%function(i))
         tau = trial%tau(n_instants:1:-1)
         u = trial%u(:, n_instants:1:-1)
         v = trial%v(:, n_instants:1:-1)
         call element%ask(trial%omega, tau, u, v, .false., force, none, none, status, instant)
         if (any(abs(u - trial%u(:, n_instants:1:-1)) > 0.0_wp) .or. &
             any(abs(v - trial%v(:, n_instants:1:-1)) > 0.0_wp)) then
            call refuse(element, i, 'writes into u or v: both are of the program; copy them', error)
            return
         end if
         ! A motion that has forces once and none the next time is another one to the function.
         if (status /= 0 .or. any(abs(force(:, n_instants:1:-1) - trial%force) > same*largest)) then
            call refuse(element, i, 'gives other forces at the same motion when its instants '// &
                        'come in another order: forces have to follow from u, v, t and omega '// &
                        'at the same instant; what remembers is a step with states', error)
            return
         end if
         if (.not. element%is_odd) return
         u = -cshift(trial%u, half, dim=2)
         v = -cshift(trial%v, half, dim=2)
         call element%ask(trial%omega, trial%tau, u, v, .false., force, none, none, status, instant)
         force = cshift(force, -half, dim=2)
      end associate
      if (status /= 0) return
      if (any(abs(force + trial%force) > group%check_tolerance*largest)) then
         call refuse_even(group%function(i), i, error)
      end if
   end subroutine check_forces

   !> A turn of steps, the same once more, and the opposite one half a period later.
   subroutine check_walk(group, i, trial, error)
      class(element_group), intent(in) :: group
      integer, intent(in) :: i
      type(trial_type), intent(in) :: trial
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(trial%u, 1), n_instants) :: first, again
      integer :: status

      associate (element => group%function(i))
         call walk(element, trial%omega, trial%tau, trial%u, trial%v, first, status)
         ! What it has no force for shows in the solution, if that comes there.
         if (status /= 0) return
         call walk(element, trial%omega, trial%tau, trial%u, trial%v, again, status)
         if (status /= 0 .or. any(abs(again - first) > same*maxval(abs(first)))) then
            call refuse(element, i, 'gives other forces at the same motion from the same '// &
                        'states: all that it remembers has to be in its states', error)
            return
         end if
         ! From a start that is not at rest the opposite motion need not have the opposite forces.
         if (.not. element%is_odd .or. any(abs(element%start) > 0.0_wp)) return
         call walk(element, trial%omega, trial%tau + pi, -trial%u, -trial%v, again, status)
      end associate
      if (status /= 0) return
      if (any(abs(again + first) > group%check_tolerance*maxval(abs(first)))) then
         call refuse_even(group%function(i), i, error)
      end if
   end subroutine check_walk

   !> What a function does that no solution would show.
   subroutine refuse(element, i, what, error)
      type(user_element), intent(in) :: element
      integer, intent(in) :: i
      character(*), intent(in) :: what
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, 'user law '//trim(element%name)//' (element '//to_text(i)//') '// &
                       what//' (check = .false. leaves this test out)', status_input)
   end subroutine refuse

   !> Odd harmonics alone would leave out what its forces have of even ones.
   subroutine refuse_even(element, i, error)
      type(user_element), intent(in) :: element
      integer, intent(in) :: i
      type(error_type), allocatable, intent(out) :: error

      call refuse(element, i, 'is promised to be odd, but opposite motions have other than '// &
                  'opposite forces: take odd = .false.', error)
   end subroutine refuse_even

   !> Steps of one turn from the start of the element.
   subroutine walk(element, omega, tau, u, v, force, status)
      type(user_element), intent(in) :: element
      real(wp), intent(in) :: omega, tau(:), u(:, :), v(:, :)
      !> At the ends of the steps (n_in, n_instants).
      real(wp), intent(out) :: force(:, :)
      integer, intent(out) :: status
      real(wp) :: after(element%n_state + element%n_in), ends(2), state(element%n_state)
      real(wp), dimension(element%n_in, 2) :: u_ends, v_ends
      real(wp) :: none(element%n_state + 4*element%n_in, element%n_state + element%n_in)
      type(step_answer) :: answer
      integer :: before, k

      answer = new_step_answer(element%n_state, element%n_in)
      force = 0.0_wp
      state = element%start
      do k = 1, n_instants
         before = merge(n_instants, k - 1, k == 1)
         ends = tau(k) - [2.0_wp*pi/n_instants, 0.0_wp]
         u_ends = u(:, [before, k])
         v_ends = v(:, [before, k])
         call element%ask_step(omega, ends, u_ends, v_ends, .false., state, after, none, status, &
                               answer)
         if (status /= 0) return
         state = after(:element%n_state)
         force(:, k) = after(element%n_state + 1:)
      end do
   end subroutine walk

   !> Slopes of the steps of one turn, by all that they take.
   subroutine check_step(group, i, trial, error)
      class(element_group), intent(in) :: group
      integer, intent(in) :: i
      type(trial_type), intent(in) :: trial
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable, dimension(:, :) :: apart, best, by, found, given, other
      real(wp), allocatable :: state(:)
      type(step_room) :: room
      integer :: at(2), j, k, m, n, s, status

      associate (element => group%function(i))
         n = element%n_state
         m = element%n_in
         allocate (given(n + 4*m, n + m), source=0.0_wp)
         allocate (by, best, found, other, apart, source=given)
         room = new_step_room(n, m)
         state = element%start
         do k = 1, n_instants
            j = merge(n_instants, k - 1, k == 1)
            room%u = trial%u(:, [j, k])
            room%v = trial%v(:, [j, k])
            room%tau = trial%tau(k) - [2.0_wp*pi/n_instants, 0.0_wp]
            call element%ask_step(trial%omega, room%tau, room%u, room%v, .true., state, &
                                  room%after, given, status, room%answer)
            if (status /= 0) return
            room%scale(:n) = max(maxval(abs(state)), maxval(abs(room%after(:n))))
            room%scale(n + 1:) = [(maxval(abs(trial%u)), s=1, m), (maxval(abs(trial%v)), s=1, m), &
                                  (maxval(abs(trial%u)), s=1, m), (maxval(abs(trial%v)), s=1, m)]
            where (.not. room%scale > 0.0_wp) room%scale = 1.0_wp
            best = huge(1.0_wp)
            other = 0.0_wp
            do s = 1, size(steps)
               call step_slopes(element, trial%omega, state, steps(s), room, by, status)
               if (status /= 0) return
               where (abs(by - given) < abs(best))
                  best = by - given
                  found = by
               end where
               apart = abs(by - other)
               other = by
            end do
            ! In the size of what each input changes; where differences of two steps disagree there
            ! is a corner.
            do s = 1, n + m
               best(:, s) = best(:, s)*room%scale
               apart(:, s) = apart(:, s)*room%scale
               by(:, s) = max(abs(given(:, s)), abs(found(:, s)))*room%scale
               where (apart(:, s) > group%check_tolerance*maxval(by(:, s))) best(:, s) = 0.0_wp
               if (maxval(abs(best(:, s))) <= group%check_tolerance*maxval(by(:, s))) cycle
               ! Where nothing that goes in changes what comes out, all slopes are round-off.
               if (maxval(abs(best(:, s))) <= negligible*abs(room%after(s))) cycle
               at = maxloc(abs(best(:, s:s)))
               call fatal_error(error, 'the derivative of user law '//trim(element%name)// &
                                ' (element '//to_text(i)//') is wrong: of '// &
                                trim(merge('state', 'force', s <= n))//' '// &
                                to_text(merge(s, s - n, s <= n))//' by number '//to_text(at(1))// &
                                ' of (state, u, v before, u, v after) it gives '// &
                                to_text(given(at(1), s))//', differences '// &
                                to_text(found(at(1), s))//"; mend it, or take derivative = "// &
                                "'difference' (check = .false. leaves this test out)", status_input)
               return
            end do
            state = room%after(:n)
         end do
      end associate
   end subroutine check_step

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
