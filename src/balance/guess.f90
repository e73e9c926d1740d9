!> First guess of a solution: the linear one with every pair closed and stuck, but open where that
!> would take tension on average.
module fw_guess
   use fw_force_law, only: force_law
   use fw_kinds, only: wp
   use fw_balance_state, only: balance_state
   use fw_fourier, only: to_real
   use fw_linalg, only: complex_lu_type, is_positive_definite
   use fw_threads, only: coordinates_for_threads
   use omp_lib, only: omp_get_thread_num
   implicit none (type, external)
   private

   public :: stuck_guess, free_guess, held_without_contact, held_without_friction
   ! For the submodule alone, which gfortran lets reach no private procedures.
   public :: find_mean_slopes, elastic_slope, solve_free, find_tension, gap_of, rest_type

   !> Rounds of opening pairs under tension; each opens at least one pair or is the last. Those of
   !> them that also close pairs.
   integer, parameter :: max_rounds = 20, rounds_of_both = 12

   !> Steps of Newton's method to where curved pairs rest, and change of their inputs that ends it.
   integer, parameter :: most_steps = 60
   real(wp), parameter :: rest_tolerance = 1.0e-9_wp
   !> Part of the largest pressure below which such a pair counts as open.
   real(wp), parameter :: no_pressure = 1.0e-9_wp

   !> Pairs of a law whose pressure is curved, about where they rest: springs of a slope, from a gap
   !> on (n_pairs). Of other laws nothing is allocated.
   type :: rest_type
      !> Normal inputs.
      real(wp), allocatable :: y(:)
      !> [force/length], [length]
      real(wp), allocatable :: slope(:), gap(:)
   end type rest_type

   ! The same where equal sectors are told apart (fw_wave_guess).
   interface
      !> Whether static loads are held: with pairs open, or closed but free of friction.
      module logical function waves_are_held(system, closed)
         type(balance_state), intent(in) :: system
         logical, intent(in) :: closed
      end function waves_are_held

      module subroutine solve_sectors(system, closed, rest, x, tension)
         type(balance_state), intent(in) :: system
         logical, intent(in) :: closed(:)
         type(rest_type), intent(in) :: rest
         real(wp), intent(out), contiguous :: x(:)
         real(wp), intent(out) :: tension(:)
      end subroutine solve_sectors
   end interface

contains

   !> The linear solution with pairs stuck where they bear (n_coordinates * n_coefficients).
   subroutine stuck_guess(system, x)
      type(balance_state), intent(in) :: system
      real(wp), intent(out), contiguous :: x(:)
      logical :: closed(system%problem%n_pairs), bears(system%problem%n_pairs)
      real(wp) :: tension(system%problem%n_pairs)
      type(rest_type) :: rest
      integer :: round

      closed = .true.
      do round = 1, merge(max_rounds, 0, size(closed) > 0)
         call come_to_rest(system, closed, x, tension, rest)
         bears = .not. tension > 0.0_wp
         ! Of late only opened: rounds that close pairs again could go on for ever.
         if (round > rounds_of_both .or. .not. closes_again(system)) bears = bears .and. closed
         if (all(bears .eqv. closed)) exit
         closed = bears
      end do
      call linear_solution(system, closed, .false., rest, x, tension)
   end subroutine stuck_guess

   !> The position at rest with closed pairs stuck: linear, or by Newton's method where pressures
   !> are curved. Steep as the structure to begin with, they come down to it step by step.
   subroutine come_to_rest(system, closed, x, tension, rest)
      type(balance_state), intent(in) :: system
      logical, intent(in) :: closed(:)
      real(wp), intent(out), contiguous :: x(:)
      real(wp), intent(out) :: tension(:)
      type(rest_type), intent(inout) :: rest
      real(wp) :: opening(size(closed)), before(size(closed)), change
      integer :: i, m, step

      m = system%problem%structure%n_coordinates
      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         if (.not. law%facts%is_curved .or. .not. system%problem%fourier%has_constant()) then
            call linear_solution(system, closed, .true., rest, x, tension)
            return
         end if
         if (.not. allocated(rest%y)) call start_rest(system, law, rest)
         do step = 1, most_steps
            before = rest%y
            call lean_on(system, law, rest)
            call linear_solution(system, closed, .true., rest, x, tension)
            call system%problem%incidence%gather(system%problem%joint%row(3, :), m, 1, x(:m), &
                                                 opening)
            do i = 1, size(opening)
               rest%y(i) = law%prediction%stiffness(i, 3)*(opening(i) + &
                           law%prediction%gap_at(i, system%frequency()) + system%depth(i))
            end do
            change = maxval(abs(rest%y - before), mask=closed)
            if (change <= rest_tolerance*maxval(abs(rest%y), mask=closed)) exit
         end do
         call lean_on(system, law, rest)
         call drop_unpressed(law, rest, tension)
      end associate
   end subroutine come_to_rest

   !> Inputs at which curved pairs are as steep as the structure.
   subroutine start_rest(system, law, rest)
      type(balance_state), intent(in) :: system
      class(force_law), intent(in) :: law
      type(rest_type), intent(inout) :: rest
      complex(wp), allocatable :: stiffness(:, :)
      real(wp) :: wanted
      integer :: i, j, m

      m = system%problem%structure%n_coordinates
      ! Of very many coordinates no matrix is formed; tangential springs are about as stiff.
      wanted = maxval(law%prediction%stiffness(:, 1:2))
      if (system%problem%fits_whole()) then
         allocate (stiffness(m, m))
         call system%problem%structure%block(system%structure_state, 1, stiffness)
         wanted = max(wanted, maxval([(abs(stiffness(j, j)), j=1, m)]))
      end if
      rest%y = [(law%input_of_slope(i, wanted), i=1, system%problem%n_pairs)]
      allocate (rest%slope, rest%gap, mold=rest%y)
   end subroutine start_rest

   !> Springs that press as the pairs do at their inputs.
   subroutine lean_on(system, law, rest)
      type(balance_state), intent(in) :: system
      class(force_law), intent(in) :: law
      type(rest_type), intent(inout) :: rest
      real(wp) :: force, slope
      integer :: i

      do i = 1, size(rest%y)
         call law%press_at(i, rest%y(i), force, slope)
         rest%slope(i) = law%prediction%stiffness(i, 3)*slope
         rest%gap(i) = law%prediction%gap_at(i, system%frequency()) + system%depth(i)
         if (rest%slope(i) > 0.0_wp) rest%gap(i) = rest%gap(i) + force/rest%slope(i) - &
                                                   rest%y(i)/law%prediction%stiffness(i, 3)
      end do
   end subroutine lean_on

   !> Pairs that do not press, or as good as not, count as under tension.
   subroutine drop_unpressed(law, rest, tension)
      class(force_law), intent(in) :: law
      type(rest_type), intent(in) :: rest
      real(wp), intent(inout) :: tension(:)
      real(wp) :: force(size(tension)), slope
      integer :: i

      do i = 1, size(force)
         call law%press_at(i, rest%y(i), force(i), slope)
      end do
      where (law%present(3, :) .and. force >= no_pressure*minval(force, mask=law%present(3, :))) &
         tension = 1.0_wp
   end subroutine drop_unpressed

   !> Whether the tension of open pairs is known, negative where they would bear: of elastic pairs,
   !> whose sectors differ (open ones of neighbours let each other close).
   logical function closes_again(system)
      type(balance_state), intent(in) :: system

      closes_again = system%problem%structure%n_alike > 1
      if (.not. closes_again) return
      associate (forces => system%problem%forces)
         closes_again = .not. forces%entry(forces%pairs)%law%prediction%takes_balance
      end associate
   end function closes_again

   !> The linear solution without any contact force.
   subroutine free_guess(system, x)
      type(balance_state), intent(in) :: system
      real(wp), intent(out), contiguous :: x(:)
      logical :: closed(system%problem%n_pairs)
      real(wp) :: tension(system%problem%n_pairs)
      type(rest_type) :: rest

      closed = .false.
      call linear_solution(system, closed, .false., rest, x, tension)
   end subroutine free_guess

   !> Whether the structure, with every law but that of its contact, holds a static load where it
   !> was evaluated last. (Without a static harmonic there is no static position to lose.)
   logical function held_without_contact(system) result(held)
      type(balance_state), intent(in) :: system
      complex(wp), allocatable :: stiffness(:, :)
      integer :: k

      held = .true.
      if (.not. system%problem%fourier%has_constant()) return
      if (system%problem%structure%n_alike > 1) then
         held = waves_are_held(system, .false.)
         return
      end if
      allocate (stiffness(system%problem%structure%n_coordinates, &
                          system%problem%structure%n_coordinates))
      ! Harmonic 0 is the first of those retained.
      call system%problem%structure%block(system%structure_state, 1, stiffness)
      do k = 1, system%problem%forces%n_laws
         if (k /= system%problem%forces%pairs) call add_law(system, k, stiffness)
      end do
      held = is_positive_definite(real(stiffness, wp))
   end function held_without_contact

   !> Stiffness of the elements of a law at rest, as of linear springs, and what they gain on
   !> average over the motion: a spring that hardens holds, too, what has gone off far enough.
   subroutine add_law(system, k, stiffness)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: k
      !> Of harmonic 0 (n_coordinates, n_coordinates).
      complex(wp), intent(inout) :: stiffness(:, :)
      real(wp) :: slope(system%problem%forces%entry(k)%law%n_components, &
                        system%problem%forces%entry(k)%law%n_components)
      integer :: c, d, i

      associate (law => system%problem%forces%entry(k)%law, &
                 row => system%problem%forces%entry(k)%row)
         do i = 1, law%n_elements
            call find_mean_slopes(system, k, i, slope)
            do d = 1, size(slope, 2)
               do c = 1, size(slope, 1)
                  if (row(c, i) == 0 .or. row(d, i) == 0) cycle
                  call system%problem%incidence%add_coupling( &
                     row(c, i), row(d, i), 1, &
                     cmplx(slope(c, d)*law%prediction%stiffness(i, d), kind=wp), stiffness)
               end do
            end do
         end do
      end associate
   end subroutine add_law

   !> Slopes of an element (output, input): their mean over the motion where it is the stiffer.
   subroutine find_mean_slopes(system, k, element, mean)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: k, element
      real(wp), intent(out) :: mean(:, :)
      real(wp) :: slope(size(mean, 1), size(mean, 2))
      integer :: c, j

      associate (law => system%problem%forces%entry(k)%law, work => system%work(k))
         mean = 0.0_wp
         do j = 1, size(work%prediction_time, 3)
            call law%slopes_about(element, work%prediction_time(element, :, j), slope)
            mean = mean + slope
         end do
         mean = mean/size(work%prediction_time, 3)
         call law%slopes_about(element, [(0.0_wp, c=1, size(mean, 1))], slope)
         if (sum([(mean(c, c) - slope(c, c), c=1, size(mean, 1))]) < 0.0_wp) mean = slope
      end associate
   end subroutine find_mean_slopes

   !> Whether the structure holds a static load with its pairs closed but free of friction.
   logical function held_without_friction(system) result(held)
      type(balance_state), intent(in) :: system
      complex(wp), allocatable :: stiffness(:, :)
      logical :: free(system%problem%structure%n_coordinates)
      integer, allocatable :: kept(:)
      integer :: i, j, row

      held = .true.
      if (.not. system%problem%fourier%has_constant()) return
      if (system%problem%structure%n_alike > 1) then
         held = waves_are_held(system, .true.)
         return
      end if
      free = .true.
      allocate (stiffness(size(free), size(free)))
      call system%problem%structure%block(system%structure_state, 1, stiffness)
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         ! Closed without friction: rigid normal rows are held, elastic ones keep their stiffness.
         do i = 1, system%problem%n_pairs
            row = system%problem%joint%row(3, i)
            if (row == 0) cycle
            if (p%takes(i)) then
               free(system%problem%incidence%coordinate_of(row)) = .false.
            else
               call system%problem%incidence%add_block(row, 1, cmplx(p%stiffness(i, 3), kind=wp), &
                                                stiffness)
            end if
         end do
      end associate
      kept = pack([(j, j=1, size(free))], free)
      held = is_positive_definite(real(stiffness(kept, kept), wp))
   end function held_without_friction

   !> Solve with closed pairs stuck; tension is their mean normal force (positive: it pulls).
   subroutine linear_solution(system, closed, at_rest, rest, x, tension)
      type(balance_state), intent(in) :: system
      !> Pairs that are taken for stuck (n_pairs).
      logical, intent(in) :: closed(:)
      !> Harmonic 0 alone; the others are zero.
      logical, intent(in) :: at_rest
      !> Springs in the place of curved pairs.
      type(rest_type), intent(in) :: rest
      real(wp), intent(out), contiguous :: x(:)
      !> Zero where there is no normal dof, and without a harmonic 0.
      real(wp), intent(out) :: tension(:)
      complex(wp), allocatable :: q(:, :)
      integer :: h, last, m
      logical :: ended, skipped

      if (system%problem%structure%n_alike > 1 .and. .not. system%problem%fits_whole()) then
         call solve_sectors(system, closed, rest, x, tension)
         return
      end if
      m = system%problem%structure%n_coordinates
      allocate (q(m, system%problem%fourier%n_retained), source=(0.0_wp, 0.0_wp))
      tension = 0.0_wp
      last = system%problem%fourier%n_retained
      if (at_rest) last = count(system%problem%fourier%harmonic == 0)
      if (m < coordinates_for_threads) then
         ! A region of one thread takes as long as a few harmonics of a small structure.
         do h = 1, last
            if (.not. system%is_interrupted()) call solve_harmonic(system, closed, h, rest, &
                                                                   q(:, h), tension)
         end do
         call to_real_vector(system, q, x)
         return
      end if
      ended = .false.
      !$omp parallel do default(none) private(h, skipped) schedule(dynamic) &
      !$omp shared(system, closed, rest, q, tension, last, ended) if(last > 1)
      do h = 1, last
         ! A harmonic of many pairs takes tenths of a second; nobody looks at the rest then. Only
         ! one thread asks: others may not call what listens for the end.
         if (omp_get_thread_num() == 0) then
            skipped = system%is_interrupted()
            !$omp atomic write
            ended = skipped
         else
            !$omp atomic read
            skipped = ended
         end if
         if (.not. skipped) call solve_harmonic(system, closed, h, rest, q(:, h), tension)
      end do
      !$omp end parallel do
      call to_real_vector(system, q, x)
   end subroutine linear_solution

   !> One harmonic of it, in a thread of its own.
   subroutine solve_harmonic(system, closed, h, rest, q, tension)
      type(balance_state), intent(in) :: system
      logical, intent(in) :: closed(:)
      integer, intent(in) :: h
      type(rest_type), intent(in) :: rest
      complex(wp), intent(inout) :: q(:)
      !> Set by harmonic 0.
      real(wp), intent(inout) :: tension(:)
      complex(wp), allocatable :: force(:), stiffness(:, :)
      logical :: held(size(q)), is_idle
      integer :: j

      held = .false.
      call hold_pairs(system, closed, h, held, q)
      force = system%structure_state%load(:, h)
      ! Only the vibratory load is raised from zero; the static one acts throughout.
      if (system%problem%fourier%harmonic(h) > 0) force = system%load_share*force
      ! Nothing moves, or nothing makes it move: no matrix is formed. Elastic pairs that are closed
      ! may press at rest.
      if (any(abs(q) > 0.0_wp)) then
         is_idle = .false.
      else if (system%problem%n_pairs > 0 .and. gaps_move(system)) then
         is_idle = all(held)
      else if (system%problem%fourier%harmonic(h) > 0 .or. system%problem%n_pairs == 0) then
         is_idle = all(held) .or. .not. any(abs(force) > 0.0_wp)
      else
         is_idle = all(held)
      end if
      if (is_idle) then
         if (system%problem%fourier%harmonic(h) == 0) then
            call find_tension(system, rest, real(force, wp), q, tension)
         end if
         return
      end if
      allocate (stiffness(size(q), size(q)))
      call system%problem%structure%block(system%structure_state, h, stiffness)
      call add_pairs(system, closed, h, rest, stiffness, force)
      call solve_free(stiffness, force, held, q)
      if (system%problem%fourier%harmonic(h) > 0) return
      ! Elastic pairs are in both.
      call find_tension(system, rest, [(real(force(j), wp) - real(sum(stiffness(j, :)*q), wp), &
                                  j=1, size(q))], q, tension)
   end subroutine solve_harmonic

   !> Whether gaps have harmonics of their own, which load pairs that are closed.
   pure logical function gaps_move(system)
      type(balance_state), intent(in) :: system

      gaps_move = allocated(system%problem%forces%entry( &
                            system%problem%forces%pairs)%law%prediction%gap_motion)
   end function gaps_move

   !> Rigid pairs hold their coordinates, at minus the gap.
   subroutine hold_pairs(system, closed, h, held, q)
      type(balance_state), intent(in) :: system
      logical, intent(in) :: closed(:)
      integer, intent(in) :: h
      !> Coordinates of closed pairs, whose values stand in q.
      logical, intent(inout) :: held(:)
      complex(wp), intent(inout) :: q(:)
      integer :: i, c, j, row

      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         if (.not. law%prediction%takes_balance) return
         do i = 1, size(closed)
            if (.not. closed(i) .or. .not. law%prediction%takes(i)) cycle
            do c = 1, 3
               row = system%problem%joint%row(c, i)
               if (row == 0 .or. .not. law%slope_at_rest(i, c) > 0.0_wp) cycle
               j = system%problem%incidence%coordinate_of(row)
               held(j) = .true.
               q(j) = -gap_of(system, h, i, c)
            end do
         end do
      end associate
   end subroutine hold_pairs

   !> Elastic pairs add their stiffness; none of their coordinates is held.
   subroutine add_pairs(system, closed, h, rest, stiffness, force)
      type(balance_state), intent(in) :: system
      logical, intent(in) :: closed(:)
      integer, intent(in) :: h
      type(rest_type), intent(in) :: rest
      !> Of one harmonic: (n_coordinates, n_coordinates) and (n_coordinates).
      complex(wp), intent(inout) :: stiffness(:, :), force(:)
      integer :: i, c, row
      complex(wp) :: slope

      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         if (.not. law%prediction%some_are_free()) return
         do i = 1, size(closed)
            if (.not. closed(i) .or. law%prediction%takes(i)) cycle
            do c = 1, 3
               row = system%problem%joint%row(c, i)
               if (row == 0 .or. .not. law%slope_at_rest(i, c) > 0.0_wp) cycle
               slope = elastic_slope(system, law, i, c, system%problem%fourier%harmonic(h), rest)
               call system%problem%incidence%scatter_harmonic( &
                  row, h, -slope*gap_of(system, h, i, c, rest), force)
               call system%problem%incidence%add_block(row, h, slope, stiffness)
            end do
         end do
      end associate
   end subroutine add_pairs

   !> What a component of a pair has to close in a harmonic: the gap, of the normal one.
   pure complex(wp) function gap_of(system, h, pair, component, rest) result(gap)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h, pair, component
      type(rest_type), intent(in), optional :: rest

      gap = (0.0_wp, 0.0_wp)
      if (component /= 3) return
      if (system%problem%fourier%harmonic(h) /= 0) then
         associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
            if (allocated(p%gap_motion)) gap = p%gap_motion%amplitude_of( &
               pair, system%problem%fourier%harmonic(h))
         end associate
         return
      end if
      if (present(rest)) then
         if (allocated(rest%gap)) then
            gap = cmplx(rest%gap(pair), kind=wp)
            return
         end if
      end if
      gap = cmplx(system%problem%forces%entry(system%problem%forces%pairs)%law%prediction%gap_at( &
                  pair, system%frequency()) + system%depth(pair), kind=wp)
   end function gap_of

   !> Force of an elastic pair about its position at rest over the amplitude of its displacement in
   !> a harmonic n: each derivative by tau is a factor i n.
   complex(wp) function elastic_slope(system, law, pair, component, harmonic, rest) &
      result(slope)
      type(balance_state), intent(in) :: system
      class(force_law), intent(in) :: law
      integer, intent(in) :: pair, component, harmonic
      type(rest_type), intent(in) :: rest

      if (component == 3 .and. allocated(rest%slope)) then
         slope = cmplx(rest%slope(pair), kind=wp)
         return
      end if
      slope = cmplx(law%prediction%stiffness(pair, component)*law%slope_at_rest(pair, component), &
                    kind=wp)
      if (law%prediction%order_of(pair, component) > 0) then
         slope = cmplx(0.0_wp, system%rate_unit(law%prediction, pair)*harmonic, wp)*slope
      end if
   end function elastic_slope

   !> Solve for the coordinates that are not held.
   subroutine solve_free(stiffness, force, held, q)
      !> Of one harmonic (n_coordinates, n_coordinates) and (n_coordinates).
      complex(wp), intent(in) :: stiffness(:, :), force(:)
      logical, intent(in) :: held(:)
      !> Held values on entry, all values on leaving (n_coordinates).
      complex(wp), intent(inout) :: q(:)
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: rhs(:, :)
      integer, allocatable :: free(:), fixed(:)
      logical :: singular
      integer :: j

      free = pack([(j, j=1, size(held))], .not. held)
      fixed = pack([(j, j=1, size(held))], held)
      if (size(free) == 0) return
      allocate (rhs(size(free), 1))
      ! Held coordinates act as a load on the free ones.
      rhs(:, 1) = force(free) - matmul(stiffness(free, fixed), q(fixed))
      call lu%reserve(size(free))
      lu%matrix = stiffness(free, free)
      call lu%factor(singular)
      ! A guess of zero is as good as any: whether there is a solution is not decided here.
      if (singular) return
      call lu%solve(1, rhs)
      q(free) = rhs(:, 1)
   end subroutine solve_free

   !> Mean normal force of every pair at a static position.
   subroutine find_tension(system, rest, left, q, tension)
      type(balance_state), intent(in) :: system
      type(rest_type), intent(in) :: rest
      !> What is left of the balance, F_0 - Z_0 q less elastic forces (n_coordinates).
      real(wp), intent(in) :: left(:)
      !> Coordinates at rest (n_coordinates).
      complex(wp), intent(in) :: q(:)
      real(wp), intent(out) :: tension(:)
      real(wp) :: opening(size(tension))
      integer :: i, row

      tension = 0.0_wp
      call system%problem%incidence%gather(system%problem%joint%row(3, :), size(q), 1, &
                                           real(q, wp), opening)
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         do i = 1, size(tension)
            row = system%problem%joint%row(3, i)
            if (row == 0) cycle
            if (p%takes(i)) then
               ! What is left of the balance of a held row is the force that holds it.
               tension(i) = left(system%problem%incidence%coordinate_of(row))
            else if (allocated(rest%slope)) then
               tension(i) = rest%slope(i)*(opening(i) + rest%gap(i))
            else
               tension(i) = p%stiffness(i, 3)*(opening(i) + p%gap_at(i, system%frequency()) + &
                                              system%depth(i))
            end if
         end do
      end associate
   end subroutine find_tension

   !> Complex amplitudes as the unknowns of the balance; a shape for what comes as a vector.
   subroutine to_real_vector(system, q, x)
      type(balance_state), intent(in) :: system
      complex(wp), intent(in) :: q(:, :)
      real(wp), intent(out) :: x(size(q, 1), system%problem%fourier%n_coefficients)

      call to_real(system%problem%fourier, size(q, 1), q, x)
   end subroutine to_real_vector

end module fw_guess
