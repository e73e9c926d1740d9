!> The bound of the stuck motion of a mode: the shakedown of its pairs (fw_shakedown_bound), from a
!> solution that sticks. It holds where the pairs are all that is not linear, and all of them bear
!> at rest; above it nothing can stick, whatever the assembly left.
module fw_onset_bound
   use fw_balance_problem, only: balance_problem
   use fw_force_law, only: pair_open
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_mode_system, only: mode_system
   use fw_onset_departure, only: evaluate_motion
   use fw_shakedown_bound, only: shakedown_type
   implicit none (type, external)
   private

   public :: find_bound

contains

   subroutine find_bound(system, amplitude, y, mu, bound, done)
      type(mode_system), intent(inout) :: system
      !> A solution that sticks.
      real(wp), intent(in) :: amplitude, y(:)
      !> Friction coefficients (n_pairs).
      real(wp), intent(in) :: mu(:)
      real(wp), intent(out) :: bound
      logical, intent(out) :: done
      type(shakedown_type) :: pairs
      real(wp), allocatable :: x(:)

      bound = huge(1.0_wp)
      associate (problem => system%balance%problem)
         done = problem%forces%n_laws == 1 .and. problem%fourier%has_constant() .and. &
                all(mu > 0.0_wp) .and. amplitude > 0.0_wp
         ! Forces of the motion are in proportion to it where pressures are.
         if (done) done = .not. problem%forces%entry(problem%forces%pairs)%law%facts%is_curved
         if (.not. done) return
         call evaluate_motion(system, amplitude, y)
         done = all(system%balance%work(problem%forces%pairs)%state /= pair_open)
         pairs%mu = mu
         if (done) call describe(system, pairs, x, done)
         if (done) call couple(problem, system%n_static, pairs, done)
      end associate
      if (.not. done) return
      ! Normal forces without offsets: those of the motion hold with its own.
      pairs%normal = pairs%normal - matmul(pairs%coupling, x(:pairs%n - 1))
      ! A smaller motion about the same position is inside of all limits.
      x(pairs%n) = 0.5_wp
      call pairs%maximise(x, done)
      if (.not. done) return
      bound = x(pairs%n)*amplitude
   end subroutine find_bound

   !> Forces of the motion, over their size, of which its amplitude is one.
   subroutine describe(system, pairs, x, done)
      type(mode_system), intent(in) :: system
      type(shakedown_type), intent(inout) :: pairs
      real(wp), allocatable, intent(out) :: x(:)
      logical, intent(out) :: done
      real(wp) :: unit
      real(wp), allocatable :: offset(:, :)
      logical, allocatable :: slides(:, :)
      integer :: i

      associate (law => system%balance%problem%forces%pairs)
         associate (entry => system%balance%problem%forces%entry(law), &
                    force => system%balance%work(law)%force)
            pairs%n_pairs = size(force, 1)
            if (.not. entry%law%facts%follows_events) then
               pairs%n_time = system%balance%problem%fourier%n_time
            end if
            unit = maxval(abs(force(:, 3, 1)))
            done = unit > 0.0_wp
            if (.not. done) return
            slides = entry%row(1:2, :) > 0
            ! Normal forces of contact are negative.
            pairs%cycle = transpose(cmplx(force(:, :, system%cosine), &
                                          -force(:, :, system%cosine + 1), wp))/unit
            pairs%cycle(3, :) = -pairs%cycle(3, :)
            pairs%normal = -force(:, 3, 1)/unit
            offset = transpose(force(:, 1:2, 1))/unit
         end associate
      end associate
      pairs%n = count(slides) + 1
      pairs%place = unpack([(i, i=1, pairs%n)], slides, 0)
      x = [pack(offset, slides), 1.0_wp]
   end subroutine describe

   !> What a constant tangential force of each offset does to the normal forces, of which only
   !> changes count from here on.
   subroutine couple(problem, m, pairs, done)
      type(balance_problem), intent(in) :: problem
      !> Coordinates.
      integer, intent(in) :: m
      type(shakedown_type), intent(inout) :: pairs
      logical, intent(out) :: done
      complex(wp) :: block(m, m), free(m, m), mass(m, m), damping(m, m), row(m), &
                     observe(problem%structure%n_observed, m)
      logical :: held(m)
      real(wp) :: moved(m)
      type(lu_type) :: lu
      integer, allocatable :: kept(:)
      logical :: singular
      integer :: c, i, j

      call problem%structure%parts(1, block, mass, damping, observe)
      free = block
      held = .false.
      call hold(problem, free, held)
      kept = pack([(j, j=1, m)], .not. held)
      done = size(kept) > 0 .and. .not. any(abs(aimag(free)) > 0.0_wp)
      if (.not. done) return
      call lu%reserve(size(kept))
      lu%matrix(:lu%n, :lu%n) = real(free(kept, kept), wp)
      call lu%factor(singular)
      done = .not. singular
      if (singular) return
      allocate (pairs%coupling(pairs%n_pairs, pairs%n - 1), source=0.0_wp)
      associate (entry => problem%forces%entry(problem%forces%pairs))
         do i = 1, pairs%n_pairs
            do c = 1, 2
               j = pairs%place(c, i)
               if (j == 0) cycle
               row = (0.0_wp, 0.0_wp)
               call problem%incidence%scatter_harmonic(entry%row(c, i), 1, (-1.0_wp, 0.0_wp), row)
               moved = solved(lu, kept, real(row, wp))
               call press(problem, real(block, wp), moved, pairs%coupling(:, j))
            end do
         end do
      end associate
      done = all(abs(pairs%coupling) < huge(1.0_wp))
   end subroutine couple

   !> Normal directions of pairs: springs in the stiffness, rigid ones hold their coordinates.
   subroutine hold(problem, block, held)
      type(balance_problem), intent(in) :: problem
      complex(wp), intent(inout) :: block(:, :)
      logical, intent(inout) :: held(:)
      integer :: i

      associate (entry => problem%forces%entry(problem%forces%pairs))
         do i = 1, size(entry%row, 2)
            if (entry%row(3, i) == 0) cycle
            if (entry%law%prediction%takes(i)) then
               held(problem%incidence%coordinate_of(entry%row(3, i))) = .true.
            else
               call problem%incidence%add_block(entry%row(3, i), 1, &
                  cmplx(entry%law%prediction%stiffness(i, 3), kind=wp), block)
            end if
         end do
      end associate
   end subroutine hold

   function solved(lu, kept, load) result(u)
      type(lu_type), intent(in) :: lu
      integer, intent(in) :: kept(:)
      real(wp), intent(in) :: load(:)
      real(wp) :: part(size(kept)), u(size(load))

      part = load(kept)
      call lu%solve(part)
      u = 0.0_wp
      u(kept) = part
   end function solved

   !> What a static displacement adds to the normal forces.
   subroutine press(problem, stiffness, u, normal)
      type(balance_problem), intent(in) :: problem
      real(wp), intent(in) :: stiffness(:, :), u(:)
      real(wp), intent(out) :: normal(:)
      complex(wp) :: row(size(u))
      integer :: i

      normal = 0.0_wp
      associate (entry => problem%forces%entry(problem%forces%pairs))
         do i = 1, size(normal)
            if (entry%row(3, i) == 0) cycle
            if (entry%law%prediction%takes(i)) then
               normal(i) = dot_product(stiffness(problem%incidence%coordinate_of(entry%row(3, i)), &
                                                 :), u)
            else
               row = (0.0_wp, 0.0_wp)
               call problem%incidence%scatter_harmonic(entry%row(3, i), 1, (1.0_wp, 0.0_wp), row)
               normal(i) = -entry%law%prediction%stiffness(i, 3)*dot_product(real(row, wp), u)
            end if
         end do
      end associate
   end subroutine press

end module fw_onset_bound
