!> Natural frequencies of all sectors of a disk whose sectors differ. In waves U_k, k = 0 .. N - 1,
!>
!>   (K_k - w^2 M_k) U_k + 1/N R_k^H sum_j conj(z_k^j) (D_j - w^2 E_j) y_j = 0,
!>   y_j = sum_k z_k^j R_k U_k,   z_k = exp(-2 pi i k/N),
!>
!> with rows R of a sector on which sectors differ: those of their deviations, and of pairs that are
!> springs of different stiffness. Few unknowns are solved for at once, others by subspace iteration
!> with the inverse of the waves, corrected on the rows, until the residual of the whole is small.
module fw_ring_modes
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_cyclic_data, only: cyclic_type
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_hermitian, only: cholesky, product_of, solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_lapack, only: zgemm, zgetrf, zgetrs, zpotrs
   implicit none (type, external)
   private

   public :: ring_pencil, ring_wave

   !> Of one nodal diameter.
   type :: ring_wave
      complex(wp), allocatable :: stiffness(:, :), mass(:, :), rows(:, :)
      !> K + s M by Cholesky.
      complex(wp), allocatable :: factor(:, :)
   end type ring_wave

   type :: ring_pencil
      integer :: n_sectors = 0
      !> Unknowns up to which all modes are found at once.
      integer :: dense_up_to = 500
      type(ring_wave), allocatable :: wave(:)
      !> Unknowns before those of each wave (n_sectors + 1).
      integer, allocatable, private :: before(:)
      !> D_j and E_j (rows, rows, n_sectors), and exp(-2 pi i k/N) (0:n_sectors - 1).
      real(wp), allocatable :: stiffness(:, :, :), mass(:, :, :)
      complex(wp), allocatable, private :: turn(:)
      real(wp), private :: shift = 0.0_wp
      !> I + Gamma (D + s E)/N, factored.
      complex(wp), allocatable, private :: small(:, :)
      integer, allocatable, private :: pivot(:)
   contains
      procedure :: solve
      procedure, private :: start
      procedure, private :: multiply
      procedure, private :: invert
      procedure, private :: read_rows
      procedure, private :: add_rows
   end type ring_pencil

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> As of natural_modes.
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-6_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp]
   real(wp), parameter :: massless = 1.0e-13_wp, rigid = 1.0e-7_wp
   !> Residual of the whole, relative to the inertia of a mode, and rounds to reach it.
   real(wp), parameter :: small_residual = 1.0e-10_wp
   integer, parameter :: most_rounds = 100

contains

   !> The lowest frequencies, NaN where there are fewer, and what share each nodal diameter 0 .. N/2
   !> has of the tuned inertia of each mode (N/2 + 1, modes).
   subroutine solve(self, cyclic, frequency, content, error)
      class(ring_pencil), intent(inout) :: self
      !> How sectors stand around, and how they differ.
      type(cyclic_type), intent(in) :: cyclic
      !> Ascending [rad/s] (n_modes), and shares of nodal diameters, 1 in all (0:N/2, n_modes).
      real(wp), intent(out) :: frequency(:), content(0:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: theta(:)
      complex(wp), allocatable :: vectors(:, :)
      real(wp) :: square
      integer :: i, n

      frequency = ieee_value(1.0_wp, ieee_quiet_nan)
      content = frequency(1)
      call self%start(cyclic, error)
      if (allocated(error)) return
      n = self%before(self%n_sectors + 1)
      if (n <= max(self%dense_up_to, 2*size(frequency))) then
         call solve_dense(self, theta, vectors, error)
      else
         call iterate(self, size(frequency), theta, vectors, error)
      end if
      if (allocated(error)) return
      do i = 1, min(size(frequency), size(theta))
         if (theta(i) <= massless*theta(1)) exit
         square = 1.0_wp/theta(i) - self%shift
         if (abs(square) <= rigid*self%shift) square = 0.0_wp
         ! Unstable at rest: no frequency.
         if (square < 0.0_wp) cycle
         frequency(i) = sqrt(square)
         content(:, i) = shares(self, vectors(:, i))
      end do
   end subroutine solve

   !> Factor the waves, with a shift where the stiffness does not hold them.
   subroutine start(self, cyclic, error)
      class(ring_pencil), intent(inout) :: self
      type(cyclic_type), intent(in) :: cyclic
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: scale
      integer :: k, trial
      logical :: done

      self%n_sectors = cyclic%n_sectors
      self%turn = [(cyclic%factor(k, 1), k=0, self%n_sectors - 1)]
      allocate (self%before(self%n_sectors + 1), source=0)
      scale = 0.0_wp
      do k = 1, self%n_sectors
         self%before(k + 1) = self%before(k) + size(self%wave(k)%mass, 1)
         scale = max(scale, norm2(abs(self%wave(k)%stiffness))/ &
                     max(norm2(abs(self%wave(k)%mass)), tiny(1.0_wp)))
      end do
      do trial = 1, size(shift_trials)
         self%shift = scale*shift_trials(trial)
         done = .true.
         do k = 1, self%n_sectors
            self%wave(k)%factor = self%wave(k)%stiffness + self%shift*self%wave(k)%mass
            if (done) done = is_held(self%wave(k)%factor)
         end do
         if (done) exit
      end do
      if (.not. done) then
         call fatal_error(error, 'the sectors have a part without both stiffness and mass (or '// &
                          'a mass that is not positive); check the mass and stiffness matrices', &
                          status_input)
         return
      end if
      call factor_small(self)
   end subroutine start

   !> Factor a matrix that is positive definite by more than round-off.
   logical function is_held(matrix)
      !> Its Cholesky factor on return.
      complex(wp), intent(inout) :: matrix(:, :)
      real(wp) :: least, diagonal(size(matrix, 1))
      integer :: i

      diagonal = [(real(matrix(i, i), wp), i=1, size(matrix, 1))]
      is_held = cholesky(matrix)
      if (.not. is_held .or. size(diagonal) == 0) return
      least = minval([(real(matrix(i, i), wp)**2/diagonal(i), i=1, size(diagonal))])
      is_held = least > 1.0e-12_wp
   end function is_held

   !> I + Gamma (D + s E)/N.
   subroutine factor_small(self)
      class(ring_pencil), intent(inout) :: self
      complex(wp), allocatable :: gamma(:, :, :), answer(:, :), of_wave(:, :)
      integer :: d, i, info, j, k, n, r

      n = self%n_sectors
      r = size(self%stiffness, 1)
      allocate (gamma(r, r, 0:n - 1), source=zero)
      do k = 0, n - 1
         associate (wave => self%wave(k + 1))
            answer = conjg(transpose(wave%rows))
            if (size(answer) == 0) cycle
            call zpotrs('U', size(answer, 1), r, wave%factor, size(answer, 1), answer, &
                        size(answer, 1), info)
            of_wave = matmul(wave%rows, answer)
         end associate
         do d = 0, n - 1
            gamma(:, :, d) = gamma(:, :, d) + self%turn(modulo(k*d, n) + 1)*of_wave
         end do
      end do
      allocate (self%small(n*r, n*r), self%pivot(n*r))
      do j = 0, n - 1
         do i = 0, n - 1
            self%small(i*r + 1:(i + 1)*r, j*r + 1:(j + 1)*r) = &
               matmul(gamma(:, :, modulo(i - j, n)), self%stiffness(:, :, j + 1) + &
                      self%shift*self%mass(:, :, j + 1))/n
         end do
      end do
      do i = 1, n*r
         self%small(i, i) = self%small(i, i) + one
      end do
      if (n*r > 0) call zgetrf(n*r, n*r, self%small, n*r, self%pivot, info)
   end subroutine factor_small

   !> The rows of all sectors of vectors in columns (r n_sectors, columns).
   function read_rows(self, x) result(y)
      class(ring_pencil), intent(in) :: self
      !> Coordinates of all waves, in columns.
      complex(wp), intent(in) :: x(:, :)
      complex(wp), allocatable :: y(:, :), of_wave(:, :)
      integer :: j, k, n, r

      n = self%n_sectors
      r = size(self%stiffness, 1)
      allocate (y(n*r, size(x, 2)), source=zero)
      do k = 0, n - 1
         of_wave = matmul(self%wave(k + 1)%rows, x(self%before(k + 1) + 1:self%before(k + 2), :))
         do j = 0, n - 1
            y(j*r + 1:(j + 1)*r, :) = y(j*r + 1:(j + 1)*r, :) + &
                                      self%turn(modulo(k*j, n) + 1)*of_wave
         end do
      end do
   end function read_rows

   !> Add what forces on the rows of sectors are to the waves: the adjoint.
   subroutine add_rows(self, f, x)
      class(ring_pencil), intent(in) :: self
      !> On the rows of all sectors, in columns.
      complex(wp), intent(in) :: f(:, :)
      !> Coordinates of all waves, in columns.
      complex(wp), intent(inout) :: x(:, :)
      complex(wp) :: of_wave(size(self%stiffness, 1), size(f, 2))
      integer :: j, k, n, r

      n = self%n_sectors
      r = size(self%stiffness, 1)
      do k = 0, n - 1
         of_wave = zero
         do j = 0, n - 1
            of_wave = of_wave + conjg(self%turn(modulo(k*j, n) + 1))*f(j*r + 1:(j + 1)*r, :)
         end do
         associate (own => x(self%before(k + 1) + 1:self%before(k + 2), :))
            own = own + matmul(conjg(transpose(self%wave(k + 1)%rows)), of_wave)
         end associate
      end do
   end subroutine add_rows

   !> (K + s M) x or M x of the whole.
   subroutine multiply(self, of_mass, x, product)
      class(ring_pencil), intent(in) :: self
      !> Of the mass, not of the stiffness.
      logical, intent(in) :: of_mass
      complex(wp), intent(in), contiguous :: x(:, :)
      complex(wp), intent(out), contiguous :: product(:, :)
      complex(wp), allocatable :: f(:, :), matrix(:, :)
      integer :: j, k, r

      do k = 1, self%n_sectors
         associate (wave => self%wave(k))
            matrix = wave%mass
            if (.not. of_mass) matrix = wave%stiffness + self%shift*wave%mass
         end associate
         product(self%before(k) + 1:self%before(k + 1), :) = &
            product_of(matrix, x(self%before(k) + 1:self%before(k + 1), :))
      end do
      r = size(self%stiffness, 1)
      if (r == 0) return
      f = self%read_rows(x)
      do j = 0, self%n_sectors - 1
         if (of_mass) then
            f(j*r + 1:(j + 1)*r, :) = matmul(self%mass(:, :, j + 1), f(j*r + 1:(j + 1)*r, :))
         else
            f(j*r + 1:(j + 1)*r, :) = matmul(self%stiffness(:, :, j + 1) + &
                                             self%shift*self%mass(:, :, j + 1), &
                                             f(j*r + 1:(j + 1)*r, :))
         end if
      end do
      call self%add_rows(f/self%n_sectors, product)
   end subroutine multiply

   !> (K + s M)^-1 x of the whole, in place.
   subroutine invert(self, x)
      class(ring_pencil), intent(in) :: self
      complex(wp), intent(inout) :: x(:, :)
      complex(wp), allocatable :: f(:, :), correction(:, :)
      integer :: info, j, n, r

      call solve_waves(self, x)
      n = self%n_sectors
      r = size(self%stiffness, 1)
      if (r == 0) return
      f = self%read_rows(x)
      call zgetrs('N', n*r, size(f, 2), self%small, n*r, self%pivot, f, n*r, info)
      do j = 0, n - 1
         f(j*r + 1:(j + 1)*r, :) = matmul(self%stiffness(:, :, j + 1) + &
                                          self%shift*self%mass(:, :, j + 1), &
                                          f(j*r + 1:(j + 1)*r, :))/n
      end do
      allocate (correction(size(x, 1), size(x, 2)), source=zero)
      call self%add_rows(f, correction)
      call solve_waves(self, correction)
      x = x - correction
   end subroutine invert

   subroutine solve_waves(self, x)
      class(ring_pencil), intent(in) :: self
      complex(wp), intent(inout) :: x(:, :)
      complex(wp), allocatable :: own(:, :)
      integer :: info, k, m

      do k = 1, self%n_sectors
         m = self%before(k + 1) - self%before(k)
         if (m == 0) cycle
         own = x(self%before(k) + 1:self%before(k + 1), :)
         call zpotrs('U', m, size(own, 2), self%wave(k)%factor, m, own, m, info)
         x(self%before(k) + 1:self%before(k + 1), :) = own
      end do
   end subroutine solve_waves

   !> All modes at once, from the highest 1/(w^2 + s) down.
   subroutine solve_dense(self, theta, vectors, error)
      class(ring_pencil), intent(in) :: self
      !> 1/(w**2 + s), from the highest down.
      real(wp), allocatable, intent(out) :: theta(:)
      !> In columns.
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: unit(:, :)
      integer :: i, n

      n = self%before(self%n_sectors + 1)
      allocate (unit(n, n), source=zero)
      do i = 1, n
         unit(i, i) = one
      end do
      call ritz(self, unit, theta, vectors, error)
   end subroutine solve_dense

   !> Modes in a space, from the highest 1/(w^2 + s) down.
   subroutine ritz(self, space, theta, vectors, error)
      class(ring_pencil), intent(in) :: self
      complex(wp), intent(in) :: space(:, :)
      real(wp), allocatable, intent(out) :: theta(:)
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: product(:, :), mass(:, :), stiffness(:, :), found(:, :)
      integer :: i, n
      logical :: done

      n = size(space, 2)
      allocate (product(size(space, 1), n))
      call self%multiply(.true., space, product)
      mass = times(space, product)
      call self%multiply(.false., space, product)
      stiffness = times(space, product)
      call solve_hermitian_eigen(mass, stiffness, theta, found, done)
      if (.not. done) then
         call fatal_error(error, 'the sectors as they are have a part that stiffness does not '// &
                          'hold, or one of negative stiffness: reduce mistuning%scale', &
                          status_input)
         return
      end if
      theta = theta(n:1:-1)
      found = found(:, n:1:-1)
      allocate (vectors(size(space, 1), n))
      call zgemm('N', 'N', size(space, 1), n, n, one, space, size(space, 1), found, n, zero, &
                 vectors, size(space, 1))
      do i = 1, n
         if (theta(i) > 0.0_wp) vectors(:, i) = vectors(:, i)/sqrt(theta(i))
      end do
   end subroutine ritz

   !> a^H b.
   function times(a, b) result(value)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      complex(wp) :: value(size(a, 2), size(b, 2))

      call zgemm('C', 'N', size(a, 2), size(b, 2), size(a, 1), one, a, size(a, 1), b, size(b, 1), &
                 zero, value, size(a, 2))
   end function times

   !> The lowest n modes, from those of the waves.
   subroutine iterate(self, n, theta, vectors, error)
      class(ring_pencil), intent(in) :: self
      !> Modes that are wanted.
      integer, intent(in) :: n
      !> 1/(w**2 + s), from the highest down, of the whole space.
      real(wp), allocatable, intent(out) :: theta(:)
      !> In columns, the wanted ones first.
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: space(:, :), product(:, :), whole(:, :)
      integer :: i, round
      real(wp) :: residual

      call tuned_space(self, n + max(2*self%n_sectors, n/2), space)
      allocate (product(size(space, 1), n), whole(size(space, 1), n))
      do round = 1, most_rounds
         call ritz(self, space, theta, vectors, error)
         if (allocated(error)) return
         call self%multiply(.true., vectors(:, :n), product)
         call self%multiply(.false., vectors(:, :n), whole)
         residual = 0.0_wp
         do i = 1, n
            residual = max(residual, norm2(abs(theta(i)*whole(:, i) - product(:, i)))/ &
                           max(norm2(abs(product(:, i))), tiny(1.0_wp)))
         end do
         if (residual <= small_residual) return
         call self%multiply(.true., vectors, space)
         call self%invert(space)
         ! Columns of one size, so that the next problem is not badly scaled.
         do i = 1, size(space, 2)
            space(:, i) = space(:, i)/max(norm2(abs(space(:, i))), tiny(1.0_wp))
         end do
      end do
      call fatal_error(error, 'natural frequencies of all sectors were not found to a residual '// &
                       'of 1e-10: take fewer cyclic%n_modes', status_failure)
   end subroutine iterate

   !> Modes of the waves, as many of each as it takes to have m of all.
   subroutine tuned_space(self, m, space)
      class(ring_pencil), intent(in) :: self
      !> Vectors at least.
      integer, intent(in) :: m
      complex(wp), allocatable, intent(out) :: space(:, :)
      real(wp), allocatable :: theta(:)
      complex(wp), allocatable :: found(:, :)
      integer :: each, k, last, n
      logical :: done

      each = (m - 1)/self%n_sectors + 1
      n = 0
      do k = 1, self%n_sectors
         n = n + min(each, size(self%wave(k)%mass, 1))
      end do
      allocate (space(self%before(self%n_sectors + 1), n), source=zero)
      n = 0
      do k = 1, self%n_sectors
         associate (wave => self%wave(k))
            last = size(wave%mass, 1)
            call solve_hermitian_eigen(wave%mass, wave%stiffness + self%shift*wave%mass, theta, &
                                       found, done)
            space(self%before(k) + 1:self%before(k + 1), n + 1:n + min(each, last)) = &
               found(:, last:max(last - each, 0) + 1:-1)
            n = n + min(each, last)
         end associate
      end do
   end subroutine tuned_space

   !> Shares of nodal diameters, which add up to 1.
   function shares(self, vector) result(share)
      class(ring_pencil), intent(in) :: self
      !> Coordinates of all waves.
      complex(wp), intent(in) :: vector(:)
      real(wp) :: share(0:self%n_sectors/2)
      integer :: k, n

      share = 0.0_wp
      do k = 0, self%n_sectors - 1
         n = min(k, self%n_sectors - k)
         associate (own => vector(self%before(k + 1) + 1:self%before(k + 2)))
            share(n) = share(n) + max(0.0_wp, real(dot_product(own, matmul( &
                                      self%wave(k + 1)%mass, own)), wp))
         end associate
      end do
      if (sum(share) > 0.0_wp) share = share/sum(share)
   end function shares

end module fw_ring_modes
