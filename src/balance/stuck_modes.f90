!> Linear modes of a structure about its position at rest, with closed pairs stuck: elastic ones as
!> their springs, rigid ones held; nonlinear springs as their slopes. Nonlinear modes start from
!> them, and are them below the onset of slip.
!>
!> First real ones without damping, which are numbered; then the one in question with its damping
!> and the self-excitation xi that cancels it,
!>
!>   (K - theta M + i omega C) U = 0,   theta = omega^2 + i omega xi,   exact whatever the damping.
module fw_stuck_modes
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_open
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_linalg, only: solve_symmetric_eigen
   implicit none (type, external)
   private

   public :: stuck_modes, find_stuck_modes

   type :: stuck_modes
      !> Of the elastic modes in ascending order: frequencies [rad/s] (n_modes) and shapes in the
      !> coordinates, of any size (n_coordinates, n_modes).
      real(wp), allocatable :: omega(:), shape(:, :)
      !> K with its stuck pairs, M and C of the coordinates.
      real(wp), allocatable, private :: stiffness(:, :), mass(:, :), damping(:, :)
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

   !> The modes where the balance was evaluated last: at rest. Nothing of its
   !> structure is condensed; it stands at a frequency above 0 without self-excitation.
   subroutine find_stuck_modes(system, modes, done, slides)
      type(balance_state), intent(in) :: system
      type(stuck_modes), intent(out) :: modes
      !> False where a part has neither stiffness nor mass.
      logical, intent(out) :: done
      !> Pairs hold nothing tangentially (default: they do).
      logical, intent(in), optional :: slides
      complex(wp), allocatable :: block(:, :)
      logical, allocatable :: held(:)
      real(wp) :: omega
      integer :: first, h, j, m

      m = system%problem%structure%n_coordinates
      omega = system%frequency()
      h = findloc(system%problem%fourier%harmonic, 1, dim=1)
      allocate (block(m, m), modes%mass(m, m), held(m))
      call system%problem%structure%mass(modes%mass)
      call system%problem%structure%block(system%structure_state, h, block)
      ! Z_1 = K - omega^2 M + i omega C, and C alone in its imaginary part.
      modes%damping = aimag(block)/omega
      held = .false.
      first = 1
      if (present(slides)) first = merge(3, 1, slides)
      call add_laws(system, h, first, block, held)
      modes%stiffness = real(block, wp) + omega**2*modes%mass
      modes%free = pack([(j, j=1, m)], .not. held)
      call solve_real(modes, done)
   end subroutine find_stuck_modes

   !> Slopes of all laws; rigid pairs that bear hold their coordinates.
   subroutine add_laws(system, h, first, block, held)
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
   end subroutine add_laws

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
   subroutine solve_real(self, done)
      type(stuck_modes), intent(inout) :: self
      logical, intent(out) :: done
      real(wp), allocatable :: k(:, :), m(:, :), values(:), vectors(:, :), square(:)
      real(wp) :: shift
      integer, allocatable :: order(:)
      integer :: j, trial

      k = self%stiffness(self%free, self%free)
      m = self%mass(self%free, self%free)
      done = size(self%free) > 0
      if (.not. done) return
      do trial = 1, size(shift_trials)
         shift = shift_trials(trial)*norm2(k)/max(norm2(m), tiny(1.0_wp))
         call solve_symmetric_eigen(m, k + shift*m, values, vectors, done)
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
      allocate (self%shape(size(self%stiffness, 1), size(order)), source=0.0_wp)
      self%shape(self%free, :) = vectors(:, order)
   end subroutine solve_real

   !> A mode with its damping, by Newton's method on the complex shape, omega and xi, which starts
   !> at the real one; b^T U = 1 holds throughout.
   subroutine refine(self, number, row, omega, self_excitation, cosine, sine, done)
      class(stuck_modes), intent(in) :: self
      integer, intent(in) :: number
      !> The row b (n_coordinates).
      real(wp), intent(in) :: row(:)
      !> [rad/s]
      real(wp), intent(out) :: omega, self_excitation
      !> U = cosine - i sine (n_coordinates).
      real(wp), intent(out) :: cosine(:), sine(:)
      logical, intent(out) :: done
      integer, parameter :: most_steps = 30
      !> Steps of this part of the unknowns are round-off.
      real(wp), parameter :: small = 1.0e-13_wp
      type(lu_type) :: lu
      real(wp) :: step(2*size(self%free) + 2), shape(size(self%free))
      logical :: singular
      integer :: k, n

      n = size(self%free)
      shape = self%shape(self%free, number)/dot_product(row, self%shape(:, number))
      omega = self%omega(number)
      self_excitation = dot_product(shape, matmul(self%damping(self%free, self%free), shape))/ &
                        dot_product(shape, matmul(self%mass(self%free, self%free), shape))
      cosine = 0.0_wp
      sine = 0.0_wp
      cosine(self%free) = shape
      done = .false.
      call lu%reserve(2*n + 2)
      do k = 1, most_steps
         call fill(self, row, omega, self_excitation, cosine(self%free), sine(self%free), &
                   lu%matrix(:2*n + 2, :2*n + 2), step)
         call lu%factor(singular)
         if (singular) return
         call lu%solve(step)
         cosine(self%free) = cosine(self%free) - step(:n)
         sine(self%free) = sine(self%free) - step(n + 1:2*n)
         omega = omega - step(2*n + 1)
         self_excitation = self_excitation - step(2*n + 2)
         done = norm2(step(:2*n)) <= small*norm2(cosine) .and. &
                maxval(abs(step(2*n + 1:))) <= small*abs(omega)
         if (done) return
      end do
      ! Ill-conditioned modes stop short of round-off of their best digits.
      done = maxval(abs(step(2*n + 1:))) <= sqrt(small)*abs(omega)
   end subroutine refine

   !> Matrix and residual of a step: real and imaginary part of (K - theta M + i omega C) U, with
   !> U = c - i s, theta = omega^2 + i omega xi, then b^T c - 1 and b^T s.
   subroutine fill(self, row, omega, xi, c, s, matrix, r)
      type(stuck_modes), intent(in) :: self
      real(wp), intent(in) :: row(:), omega, xi, c(:), s(:)
      real(wp), intent(out) :: matrix(:, :), r(:)
      real(wp), allocatable :: z_real(:, :), z_imag(:, :), m(:, :), damping(:, :)
      integer :: n

      n = size(self%free)
      m = self%mass(self%free, self%free)
      damping = self%damping(self%free, self%free)
      z_real = self%stiffness(self%free, self%free) - omega**2*m
      z_imag = omega*damping - omega*xi*m
      matrix = 0.0_wp
      ! (Z_r + i Z_i)(c - i s) = Z_r c + Z_i s + i (Z_i c - Z_r s).
      matrix(:n, :n) = z_real
      matrix(:n, n + 1:2*n) = z_imag
      matrix(n + 1:2*n, :n) = z_imag
      matrix(n + 1:2*n, n + 1:2*n) = -z_real
      matrix(:n, 2*n + 1) = matmul(-2.0_wp*omega*m, c) + matmul(damping - xi*m, s)
      matrix(n + 1:2*n, 2*n + 1) = matmul(damping - xi*m, c) + matmul(2.0_wp*omega*m, s)
      matrix(:n, 2*n + 2) = -omega*matmul(m, s)
      matrix(n + 1:2*n, 2*n + 2) = -omega*matmul(m, c)
      matrix(2*n + 1, :n) = row(self%free)
      matrix(2*n + 2, n + 1:2*n) = row(self%free)
      r(:n) = matmul(z_real, c) + matmul(z_imag, s)
      r(n + 1:2*n) = matmul(z_imag, c) - matmul(z_real, s)
      r(2*n + 1) = dot_product(row(self%free), c) - 1.0_wp
      r(2*n + 2) = dot_product(row(self%free), s)
   end subroutine fill

end module fw_stuck_modes
