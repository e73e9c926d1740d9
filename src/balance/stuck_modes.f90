!> Linear modes of a structure about its position at rest, with closed pairs stuck: elastic ones as
!> their springs, rigid ones held; nonlinear springs as their slopes. Nonlinear modes start from
!> them, and are them below the onset of slip.
!>
!> First those without damping, which are numbered; then the one in question with its damping and
!> the self-excitation xi that cancels it,
!>
!>   (K - theta M + i omega C) U = 0,   theta = omega^2 + i omega xi,   exact whatever the damping.
!>
!> Of a cyclic structure they are waves of the nodal diameter of harmonic 1, with Hermitian K and M;
!> what the air adds to K and Coriolis forces to C is left to the mode in question, too.
module fw_stuck_modes
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_open
   use fw_hermitian, only: real_form, solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type, solve_symmetric_eigen
   implicit none (type, external)
   private

   public :: stuck_modes, find_stuck_modes, add_slopes

   type :: stuck_modes
      !> Of the elastic modes in ascending order: frequencies [rad/s] (n_modes) and shapes in the
      !> coordinates, of any size (n_coordinates, n_modes).
      real(wp), allocatable :: omega(:)
      complex(wp), allocatable :: shape(:, :)
      !> K with its stuck pairs, M and C of the coordinates, rows of the observed quantities.
      complex(wp), allocatable, private :: stiffness(:, :), mass(:, :), damping(:, :)
      complex(wp), allocatable :: observe(:, :)
      !> Coordinates that rigid pairs do not hold.
      integer, allocatable, private :: free(:)
   contains
      procedure :: refine
   end type stuck_modes

   !> Shifts of a stiffness that does not hold the structure, in parts of K over M.
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-6_wp, 1.0e-3_wp, 1.0_wp]
   !> Eigenvalues below this part of the largest are massless directions: round-off.
   real(wp), parameter :: massless = 1.0e-13_wp
   !> Squares of frequencies below this part of the shift are rigid motions.
   real(wp), parameter :: rigid = 1.0e-7_wp

contains

   !> The modes where the balance was evaluated last: at rest. Nothing of its structure is condensed
   !> in harmonic 1.
   subroutine find_stuck_modes(system, modes, done, slides, harmonic)
      type(balance_state), intent(in) :: system
      type(stuck_modes), intent(out) :: modes
      !> False where a part has neither stiffness nor mass.
      logical, intent(out) :: done
      !> Pairs hold nothing tangentially (default: they do).
      logical, intent(in), optional :: slides
      !> Place of the harmonic whose waves are meant, the first where it is not given.
      integer, intent(in), optional :: harmonic
      logical, allocatable :: held(:)
      integer :: first, h, j, m

      associate (structure => system%problem%structure)
         m = structure%n_coordinates
         h = findloc(system%problem%fourier%harmonic, 1, dim=1)
         if (present(harmonic)) h = harmonic
         allocate (modes%stiffness(m, m), modes%observe(structure%n_observed, m), held(m))
         allocate (modes%mass, modes%damping, mold=modes%stiffness)
         call structure%parts(h, modes%stiffness, modes%mass, modes%damping, modes%observe)
      end associate
      held = .false.
      first = 1
      if (present(slides)) first = merge(3, 1, slides)
      call add_slopes(system, h, first, modes%stiffness, held)
      modes%free = pack([(j, j=1, m)], .not. held)
      call solve_undamped(modes, done)
   end subroutine find_stuck_modes

   !> Slopes of all laws; rigid pairs that bear hold their coordinates.
   subroutine add_slopes(system, h, first, block, held)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      !> The first component of pairs that holds.
      integer, intent(in) :: first
      complex(wp), intent(inout) :: block(:, :)
      logical, intent(inout) :: held(:)
      real(wp) :: slope
      integer :: c, i, k, row

      do k = 1, system%problem%forces%n_laws
         associate (entry => system%problem%forces%entry(k), work => system%work(k))
            do i = 1, size(entry%row, 2)
               do c = 1, size(entry%row, 1)
                  row = entry%row(c, i)
                  if (row == 0) cycle
                  ! Pairs alone open; the state of springs says nothing here.
                  if (k == system%problem%forces%pairs .and. &
                      (work%state(i) == pair_open .or. c < first)) cycle
                  slope = slope_of(system, k, i, c)
                  if (.not. abs(slope) > 0.0_wp) cycle
                  if (entry%law%prediction%takes_balance) then
                     held(system%problem%incidence%coordinate_of(row)) = .true.
                  else
                     call system%problem%incidence%add_block(row, h, &
                        cmplx(entry%law%prediction%stiffness(i, c)*slope, kind=wp), block)
                  end if
               end do
            end do
         end associate
      end do
   end subroutine add_slopes

   !> Pairs: stuck, whatever slipped on the way to rest. Springs: the slope at their elongation.
   real(wp) function slope_of(system, law, element, component) result(slope)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: law, element, component
      real(wp) :: elongation

      associate (entry => system%problem%forces%entry(law), work => system%work(law))
         if (law == system%problem%forces%pairs) then
            slope = entry%law%slope_at_rest(element, component)
         else
            elongation = 0.0_wp
            ! Harmonic 0 is the first of those retained.
            if (system%problem%fourier%has_constant()) then
               elongation = work%prediction(element, component, 1)
            end if
            slope = entry%law%slope_at(element, elongation)
         end if
      end associate
   end function slope_of

   !> M x = value (K + shift M) x, so that massless coordinates are no exception.
   subroutine solve_undamped(self, done)
      type(stuck_modes), intent(inout) :: self
      logical, intent(out) :: done
      complex(wp), allocatable :: k(:, :), m(:, :), vectors(:, :)
      real(wp), allocatable :: values(:), square(:)
      real(wp) :: shift
      integer, allocatable :: order(:)
      integer :: j, trial

      k = self%stiffness(self%free, self%free)
      ! Forces of the air are not Hermitian.
      k = 0.5_wp*(k + conjg(transpose(k)))
      m = self%mass(self%free, self%free)
      done = size(self%free) > 0
      if (.not. done) return
      do trial = 1, size(shift_trials)
         shift = shift_trials(trial)*norm2(abs(k))/max(norm2(abs(m)), tiny(1.0_wp))
         call solve_pencil(m, k + shift*m, values, vectors, done)
         if (done) exit
      end do
      if (.not. done) return
      ! In descending order of the values: ascending frequencies.
      order = [(j, j=size(values), 1, -1)]
      order = pack(order, values(order) > massless*maxval(abs(values)))
      square = 1.0_wp/values(order) - shift
      ! Rigid motions have no frequency and do not count.
      order = pack(order, square > rigid*shift)
      square = 1.0_wp/values(order) - shift
      self%omega = sqrt(square)
      allocate (self%shape(size(self%stiffness, 1), size(order)), source=(0.0_wp, 0.0_wp))
      self%shape(self%free, :) = vectors(:, order)
   end subroutine solve_undamped

   !> Real matrices have real modes, and take a quarter of the time.
   subroutine solve_pencil(a, b, values, vectors, done)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), allocatable, intent(out) :: values(:)
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      logical, intent(out) :: done
      real(wp), allocatable :: real_vectors(:, :)

      if (any(abs(aimag(a)) > 0.0_wp) .or. any(abs(aimag(b)) > 0.0_wp)) then
         call solve_hermitian_eigen(a, b, values, vectors, done)
      else
         call solve_symmetric_eigen(real(a, wp), real(b, wp), values, real_vectors, done)
         if (done) vectors = cmplx(real_vectors, kind=wp)
      end if
   end subroutine solve_pencil

   !> A mode with its damping, by Newton's method on the complex shape, omega and xi, which starts
   !> at the one without; b^T U = 1 holds throughout.
   subroutine refine(self, number, row, omega, self_excitation, shape, done)
      class(stuck_modes), intent(in) :: self
      integer, intent(in) :: number
      !> The row b (n_coordinates).
      complex(wp), intent(in) :: row(:)
      !> [rad/s]
      real(wp), intent(out) :: omega, self_excitation
      !> U (n_coordinates).
      complex(wp), intent(out) :: shape(:)
      logical, intent(out) :: done
      integer, parameter :: most_steps = 30
      !> Steps of this part of the unknowns are round-off.
      real(wp), parameter :: small = 1.0e-13_wp
      type(lu_type) :: lu
      complex(wp) :: u(size(self%free))
      complex(wp), dimension(size(self%free), size(self%free)) :: k, m, c
      real(wp) :: step(2*size(self%free) + 2)
      logical :: singular
      integer :: j, n

      n = size(self%free)
      k = self%stiffness(self%free, self%free)
      m = self%mass(self%free, self%free)
      c = self%damping(self%free, self%free)
      u = self%shape(self%free, number)/sum(row*self%shape(:, number))
      omega = self%omega(number)
      self_excitation = real(dot_product(u, matmul(c, u)), wp)/real(dot_product(u, matmul(m, u)), &
                                                                    wp)
      done = .false.
      call lu%reserve(2*n + 2)
      do j = 1, most_steps
         call fill(k, m, c, row(self%free), omega, self_excitation, u, &
                   lu%matrix(:2*n + 2, :2*n + 2), step)
         call lu%factor(singular)
         if (singular) return
         call lu%solve(step)
         u = u - cmplx(step(:n), step(n + 1:2*n), wp)
         omega = omega - step(2*n + 1)
         self_excitation = self_excitation - step(2*n + 2)
         done = norm2(step(:2*n)) <= small*norm2(abs(u)) .and. &
                maxval(abs(step(2*n + 1:))) <= small*abs(omega)
         if (done) exit
      end do
      ! Ill-conditioned modes stop short of round-off of their best digits.
      if (.not. done) done = maxval(abs(step(2*n + 1:))) <= sqrt(small)*abs(omega)
      shape = (0.0_wp, 0.0_wp)
      shape(self%free) = u
   end subroutine refine

   !> Matrix and residual of a step in real and imaginary parts: of (K - theta M + i omega C) U,
   !> theta = omega^2 + i omega xi, then of b^T U - 1.
   subroutine fill(k, m, c, row, omega, xi, u, matrix, r)
      complex(wp), intent(in) :: k(:, :), m(:, :), c(:, :), row(:), u(:)
      real(wp), intent(in) :: omega, xi
      real(wp), intent(out) :: matrix(:, :), r(:)
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      complex(wp) :: z(size(u), size(u)), part(size(u)), condition
      integer :: n

      n = size(u)
      z = k - cmplx(omega**2, omega*xi, wp)*m + i*omega*c
      matrix = 0.0_wp
      matrix(:2*n, :2*n) = real_form(z)
      part = i*matmul(c, u) - cmplx(2.0_wp*omega, xi, wp)*matmul(m, u)
      matrix(:n, 2*n + 1) = real(part, wp)
      matrix(n + 1:2*n, 2*n + 1) = aimag(part)
      part = -i*omega*matmul(m, u)
      matrix(:n, 2*n + 2) = real(part, wp)
      matrix(n + 1:2*n, 2*n + 2) = aimag(part)
      matrix(2*n + 1:, :2*n) = real_form(reshape(row, [1, n]))
      part = matmul(z, u)
      r(:n) = real(part, wp)
      r(n + 1:2*n) = aimag(part)
      condition = sum(row*u) - 1.0_wp
      r(2*n + 1:) = [real(condition, wp), aimag(condition)]
   end subroutine fill

end module fw_stuck_modes
