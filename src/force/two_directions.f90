!> Exact derivative of the marched correction of one pair by the Fourier coefficients of its
!> predicted forces. The inputs are ordered (coefficient, component), component slowest.
!>
!> With E_k the base functions at instant k, d the derivative by all inputs, n = (-e_2, e_1) and
!> w = n . (dy - dx):
!>
!>   open   d lambda_t = 0,                               dx = dy
!>   stick  d lambda_t = dy - dx,                         dx unchanged
!>   slip   d lambda_t = (mu p/|d|) n w + mu e dp,        dx = dy - d lambda_t
!>
!> starting from dx = 0 at the stated memory, through all turns of the march; or, where the limit
!> of the march does not depend on its start, from the derivative dx of the limit itself,
!> dx = M dx + N, with M and N the derivatives of a turn by its start and by the inputs. As
!> lambda_t = y - x at every instant, the start adds -(d x_k/d x_0) dx to the rows of one march
!> from dx = 0; no second one is needed.
!>
!> All that an instant of slip needs beside the base functions is w, and all that a run of stick
!> needs is the dx on which it stands: few vectors, which one product takes to the harmonics. What
!> depends on the positions at the instants is summed from the same vectors (`sum_positions`).
module fw_two_directions
   use fw_fourier, only: fourier_type
   use fw_instant_sum, only: instant_sum
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_wave_sums, only: wave_sums, wave_table
   implicit none (type, external)
   private

   public :: turn_derivative, add_start

   integer, parameter :: sticks = 1, slips = 2, opens = 3

   !> The derivative of a turn.
   type :: turn_derivative
      !> Derivative of the position, at the start, then at the end (inputs, tangential component).
      real(wp), allocatable :: dx(:, :)
      !> The same where the last turn starts.
      real(wp), allocatable :: start(:, :)
      !> Slope of the pressure by the normal input at the instants, where that is no pressure itself
      !> (n_time).
      real(wp), allocatable :: pressing(:)
      !> Of each instant: its state, and its vector, or the first of two that a run of stick stands
      !> on (0: none, dx = 0).
      integer, allocatable, private :: state(:), vector(:)
      !> (mu p/|d|) n and -mu e of instants of slip (2, n_time).
      real(wp), allocatable, private :: turning(:, :), pull(:, :)
      !> Scratch (n_time).
      real(wp), allocatable, private :: weight(:)
      !> w of instants of slip, dx of runs of stick (inputs, n_vectors).
      integer, private :: n_vectors = 0
      real(wp), allocatable, private :: vectors(:, :)
      !> Scratch: weights of the vectors (2 n_coefficients, n_vectors); base functions and weights
      !> of instants of slip (n_coefficients or twice as many, n_time); a block between
      !> coefficients.
      real(wp), allocatable, private :: weights(:, :), chosen(:, :), factors(:, :), square(:, :)
      !> Of pull, where the analysis is the projection.
      type(wave_sums), private :: pulled
   contains
      procedure :: reserve
      procedure :: march
      procedure :: to_limit
      procedure :: project
      procedure :: sum_positions
      procedure :: numbers_at
      procedure :: replay
   end type turn_derivative

contains

   !> Room for pairs of a balance.
   pure subroutine reserve(self, n_coef, n_time)
      class(turn_derivative), intent(inout) :: self
      integer, intent(in) :: n_coef, n_time

      if (allocated(self%dx)) return
      allocate (self%dx(3*n_coef, 2), self%start(3*n_coef, 2), source=0.0_wp)
      allocate (self%state(n_time), self%vector(n_time), source=0)
      allocate (self%turning(2, n_time), self%pull(2, n_time), self%weight(n_time), source=0.0_wp)
      ! Runs of stick are fewer than the instants that part them, and take two vectors each.
      allocate (self%vectors(3*n_coef, 2*n_time + 2), self%weights(2*n_coef, 2*n_time + 2))
      allocate (self%chosen(n_coef, n_time), self%factors(2*n_coef, n_time))
      allocate (self%square(n_coef, n_coef))
   end subroutine reserve

   !> Through n_turns turns, of which the last is kept.
   pure subroutine march(self, n_time, n_coef, n_turns, base, y, mu, touch, present, remembers, x)
      class(turn_derivative), intent(inout) :: self
      integer, intent(in) :: n_time, n_coef, n_turns
      !> Base functions (n_coef, n_time) and predicted forces (3, n_time).
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      !> Coefficient of friction, and distance from the cone within which the pair counts as
      !> slipping [force].
      real(wp), intent(in) :: mu, touch
      !> Which of t1, t2, n exist.
      logical, intent(in) :: present(3)
      !> Whether the position is carried from instant to instant (false: velocity-level law).
      logical, intent(in) :: remembers
      !> Corrected position at the start, then at the end of each turn.
      real(wp), intent(inout) :: x(2)
      real(wp) :: p, d(2), length, normal(2), share, pull(2)
      integer :: turn, k, standing
      logical :: moved

      self%dx = 0.0_wp
      moved = .false.
      do turn = 1, n_turns
         self%n_vectors = 0
         if (turn == n_turns) self%start = self%dx
         ! Vectors of the run of stick at work, 0 where dx = 0, -1 where they are not kept yet.
         standing = merge(-1, 0, moved)
         do k = 1, n_time
            p = max(-y(3, k), 0.0_wp)
            d = y(1:2, k) - x
            length = sqrt(d(1)**2 + d(2)**2)
            if (p > 0.0_wp .and. length <= mu*p - touch) then
               ! Runs of turns before the last serve nobody.
               if (standing < 0 .and. turn == n_turns) call keep_position(self, standing)
               self%state(k) = sticks
               self%vector(k) = max(standing, 0)
            else
               if (p <= 0.0_wp) then
                  call open(self, k, n_coef, base(1, k), present)
                  x = y(1:2, k)
               else
                  normal(1) = -d(2)/length
                  normal(2) = d(1)/length
                  pull(1) = -mu*normal(2)
                  pull(2) = mu*normal(1)
                  ! dp = -p' dy_n.
                  if (allocated(self%pressing)) pull = self%pressing(k)*pull
                  ! With one direction there is nothing to turn.
                  share = 0.0_wp
                  if (present(1) .and. present(2)) share = mu*p/length
                  call slip(self, k, n_coef, base(1, k), present, normal, share, pull, &
                            turn == n_turns)
                  x = y(1:2, k) - mu*p*d/length
               end if
               moved = .true.
               standing = -1
            end if
            if (remembers) cycle
            x = 0.0_wp
            self%dx = 0.0_wp
            moved = .false.
            standing = 0
         end do
      end do
   end subroutine march

   pure subroutine keep_position(self, standing)
      type(turn_derivative), intent(inout) :: self
      integer, intent(out) :: standing

      standing = self%n_vectors + 1
      self%n_vectors = standing + 1
      self%vectors(:, standing:standing + 1) = self%dx
   end subroutine keep_position

   !> dx = dy.
   pure subroutine open(self, k, n_coef, base, present)
      type(turn_derivative), intent(inout) :: self
      integer, intent(in) :: k, n_coef
      real(wp), intent(in) :: base(n_coef)
      logical, intent(in) :: present(3)
      integer :: c

      self%state(k) = opens
      self%vector(k) = 0
      self%dx = 0.0_wp
      do c = 1, 2
         if (present(c)) self%dx((c - 1)*n_coef + 1:c*n_coef, c) = base
      end do
   end subroutine open

   !> w of an instant, and dx = dy - d lambda.
   pure subroutine slip(self, k, n_coef, base, present, normal, share, pull, is_kept)
      type(turn_derivative), intent(inout) :: self
      integer, intent(in) :: k, n_coef
      !> n, mu p/|d| and -mu e.
      real(wp), intent(in) :: base(n_coef), normal(2), share, pull(2)
      logical, intent(in) :: present(3), is_kept
      integer :: c, i, v

      v = self%n_vectors + 1
      if (is_kept) self%n_vectors = v
      self%state(k) = slips
      self%vector(k) = v
      self%turning(:, k) = share*normal
      self%pull(:, k) = pull
      associate (w => self%vectors(:, v), dx => self%dx, n => n_coef)
         do i = 1, 3*n
            w(i) = -normal(1)*dx(i, 1) - normal(2)*dx(i, 2)
         end do
         if (present(1)) w(:n) = w(:n) + normal(1)*base
         if (present(2)) w(n + 1:2*n) = w(n + 1:2*n) + normal(2)*base
         do c = 1, 2
            dx(:, c) = -self%turning(c, k)*w
            if (present(c)) dx((c - 1)*n + 1:c*n, c) = dx((c - 1)*n + 1:c*n, c) + base
            ! dp = -dy_n where the pair bears.
            if (present(3)) dx(2*n + 1:, c) = dx(2*n + 1:, c) - pull(c)*base
         end do
      end associate
   end subroutine slip

   !> One turn at the limit x, without what the start of the turn adds, which is for those who have
   !> by_start; dx becomes the derivative of the limit. (I - M)^-1 is given.
   pure subroutine to_limit(self, n_time, n_coef, base, y, mu, touch, present, inverse, x)
      class(turn_derivative), intent(inout) :: self
      integer, intent(in) :: n_time, n_coef
      real(wp), intent(in) :: base(n_coef, n_time), y(3, n_time)
      real(wp), intent(in) :: mu, touch, inverse(2, 2)
      logical, intent(in) :: present(3)
      real(wp), intent(in) :: x(2)
      real(wp) :: after(2), first
      integer :: i

      after = x
      call self%march(n_time, n_coef, 1, base, y, mu, touch, present, .true., after)
      ! (I - M)^-1 N, input by input.
      do i = 1, 3*n_coef
         first = self%dx(i, 1)
         self%dx(i, 1) = inverse(1, 1)*first + inverse(1, 2)*self%dx(i, 2)
         self%dx(i, 2) = inverse(2, 1)*first + inverse(2, 2)*self%dx(i, 2)
      end do
      self%start = self%dx
   end subroutine to_limit

   !> The transposed derivative between coefficients whose outputs are tangential.
   subroutine project(self, fourier, waves, present, sums, jacobian)
      class(turn_derivative), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Of its harmonics, where the analysis is the projection.
      type(wave_table), intent(in) :: waves
      type(instant_sum), intent(inout) :: sums
      logical, intent(in) :: present(3)
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      integer :: c, k, nc, v

      nc = fourier%n_coefficients
      associate (a => fourier%analysis, weights => self%weights)
         weights(:, :self%n_vectors) = 0.0_wp
         do k = 1, fourier%n_time
            v = self%vector(k)
            if (v == 0) cycle
            do c = 1, 2
               associate (first => (c - 1)*nc + 1, last => c*nc)
                  if (self%state(k) == slips) then
                     weights(first:last, v) = self%turning(c, k)*a(:, k)
                  else
                     weights(first:last, v + c - 1) = weights(first:last, v + c - 1) - a(:, k)
                  end if
               end associate
            end do
         end do
         call dgemm('N', 'T', 3*nc, 2*nc, self%n_vectors, 1.0_wp, self%vectors, 3*nc, weights, &
                    2*nc, 0.0_wp, jacobian, 3*nc)
      end associate
      if (present(3)) call project_pull(self, fourier, waves, jacobian)
      ! In stick the prediction itself.
      sums%wanted = self%state == sticks
      if (.not. any(sums%wanted)) return
      call sums%form(fourier, waves, nc, self%square)
      do c = 1, 2
         if (.not. present(c)) cycle
         associate (first => (c - 1)*nc + 1, last => c*nc)
            jacobian(first:last, first:last) = jacobian(first:last, first:last) + self%square
         end associate
      end do
   end subroutine project

   !> Of slip, the part of the normal prediction: mu e dp.
   subroutine project_pull(self, fourier, waves, jacobian)
      class(turn_derivative), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      type(wave_table), intent(in) :: waves
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      integer :: c, k, n, nc

      nc = fourier%n_coefficients
      if (.not. any(self%state == slips)) return
      if (fourier%projects) then
         call self%pulled%reserve(waves)
         do c = 1, 2
            ! A weight at each instant: its sums with the waves make the block.
            self%weight = merge(self%pull(c, :), 0.0_wp, self%state == slips)
            call self%pulled%of_values(waves, self%weight)
            call self%pulled%add_products(waves, 3*nc, jacobian(2*nc + 1, (c - 1)*nc + 1))
         end do
         return
      end if
      n = 0
      associate (a => fourier%analysis)
         do k = 1, fourier%n_time
            if (self%state(k) /= slips) cycle
            n = n + 1
            self%chosen(:, n) = fourier%synthesis(:, k)
            self%factors(:nc, n) = self%pull(1, k)*a(:, k)
            self%factors(nc + 1:, n) = self%pull(2, k)*a(:, k)
         end do
      end associate
      call dgemm('N', 'T', nc, 2*nc, n, 1.0_wp, self%chosen, nc, self%factors, 2*nc, 1.0_wp, &
                 jacobian(2*nc + 1, 1), 3*nc)
   end subroutine project_pull

   !> total = the sum of weight(c, k) times the derivative of x_c at instant k, by the inputs, from
   !> dx = 0 at the start of the turn.
   pure subroutine sum_positions(self, n_coef, base, present, weight, total)
      class(turn_derivative), intent(in) :: self
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(:, :)
      logical, intent(in) :: present(3)
      !> (2, n_time)
      real(wp), intent(in) :: weight(:, :)
      real(wp), intent(out) :: total(:)
      integer :: c, k, v

      total = 0.0_wp
      do k = 1, size(weight, 2)
         ! Most instants stick or are open from one to the next: S does not know their positions.
         if (all(abs(weight(:, k)) <= 0.0_wp)) cycle
         v = self%vector(k)
         if (self%state(k) == sticks) then
            if (v > 0) total = total + weight(1, k)*self%vectors(:, v) &
                               + weight(2, k)*self%vectors(:, v + 1)
            cycle
         end if
         ! dx = dy - d lambda.
         do c = 1, 2
            if (present(c)) total((c - 1)*n_coef + 1:c*n_coef) = &
               total((c - 1)*n_coef + 1:c*n_coef) + weight(c, k)*base(:, k)
         end do
         if (self%state(k) /= slips) cycle
         total = total - dot_product(weight(:, k), self%turning(:, k))*self%vectors(:, v)
         if (.not. present(3)) cycle
         total(2*n_coef + 1:) = total(2*n_coef + 1:) - &
                                dot_product(weight(:, k), self%pull(:, k))*base(:, k)
      end do
   end subroutine sum_positions

   !> The last turn by few numbers for each instant, see fw_march_derivative, but for whether the
   !> pair bears.
   pure subroutine numbers_at(self, numbers)
      class(turn_derivative), intent(in) :: self
      !> (numbers_of_instant, n_time)
      real(wp), intent(inout) :: numbers(:, :)
      integer :: k

      do k = 1, size(numbers, 2)
         numbers(:5, k) = 0.0_wp
         if (self%state(k) == sticks) numbers(1, k) = 1.0_wp
         if (self%state(k) == slips) numbers(2:5, k) = [self%turning(:, k), self%pull(:, k)]
      end do
   end subroutine numbers_at

   !> The last turn once more from such numbers, and from the derivative of its start.
   pure subroutine replay(self, n_coef, base, numbers, start, present)
      class(turn_derivative), intent(inout) :: self
      integer, intent(in) :: n_coef
      real(wp), intent(in) :: base(:, :), numbers(:, :), start(:, :)
      logical, intent(in) :: present(3)
      real(wp) :: share, normal(2)
      integer :: k, standing

      self%dx = start
      self%n_vectors = 0
      standing = -1
      do k = 1, size(numbers, 2)
         if (numbers(1, k) > 0.0_wp) then
            if (standing < 0) call keep_position(self, standing)
            self%state(k) = sticks
            self%vector(k) = standing
            cycle
         end if
         standing = -1
         if (all(abs(numbers(2:5, k)) <= 0.0_wp)) then
            call open(self, k, n_coef, base(:, k), present)
            cycle
         end if
         share = norm2(numbers(2:3, k))
         ! Where nothing turns the direction does not matter.
         normal = numbers(2:3, k)/max(share, tiny(1.0_wp))
         call slip(self, k, n_coef, base(:, k), present, normal, share, numbers(4:5, k), .true.)
      end do
   end subroutine replay

   !> What the start of a turn adds to such a sum, where it moves too.
   pure subroutine add_start(n_inputs, n_time, by_start, dx, weight, total)
      integer, intent(in) :: n_inputs, n_time
      !> Derivative of the position at the instants by the one at the start, and of that.
      real(wp), intent(in) :: by_start(2, 2, n_time), dx(n_inputs, 2)
      real(wp), intent(in) :: weight(2, n_time)
      real(wp), intent(inout) :: total(n_inputs)
      real(wp) :: share(2)
      integer :: k

      share = 0.0_wp
      do k = 1, n_time
         share = share + weight(1, k)*by_start(1, :, k) + weight(2, k)*by_start(2, :, k)
      end do
      total = total + share(1)*dx(:, 1) + share(2)*dx(:, 2)
   end subroutine add_start

end module fw_two_directions
