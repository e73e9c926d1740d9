!> The arithmetic of the pairs that a sweep cannot do without, by the library's own kernels, alone:
!> transforms and marches of a residual, derivatives of the marches and their products.
module floor_contact
   use floor_blas, only: sgemm, sgemv
   use floor_trace, only: snapshot_type
   use fw_balance_problem, only: balance_problem
   use fw_correction, only: march_turn_1d, march_turn_2d
   use fw_fft, only: fft_type
   use fw_instant_sum, only: instant_sum
   use fw_kinds, only: sp, wp
   use fw_lapack, only: dgemm, dgemv
   use fw_march_derivative, only: march_derivative, numbers_of_instant
   use fw_sampled_turn, only: limit_is_unique
   use fw_two_directions, only: turn_derivative
   use fw_wave_sums, only: wave_table
   implicit none (type, external)
   private

   public :: contact_kernels

   type :: contact_kernels
      type(balance_problem), pointer :: problem => null()
      !> Friction coefficient (n_pairs).
      real(wp), allocatable :: mu(:)
      !> Whether the kernels of the library serve in place of BLAS, where it has any.
      logical :: by_panels = .false.
      !> Whether derivatives are marched in near products.
      logical, private :: is_marched = .false.
      !> Whether a pair has two tangential directions; components that any pair has.
      logical, private :: is_planar = .true., wanted(3) = .true.
      !> What a residual is made of: coefficients of predictions and forces, the same at the
      !> instants, constant parts, and the state of the march.
      real(wp), allocatable, private :: prediction(:, :, :), force(:, :, :), offset(:)
      real(wp), allocatable, private :: values(:, :, :), force_time(:, :, :)
      real(wp), allocatable, private :: x(:, :), margin(:), pressure(:)
      integer, allocatable, private :: turns(:)
      type(fft_type), allocatable, private :: fft
      !> Of derivatives: components of the mixed pairs, predicted forces of one, its Jacobian.
      integer, allocatable, private :: n_outputs(:)
      type(turn_derivative), private :: turn
      type(instant_sum), private :: sums
      type(wave_table), private :: waves
      real(wp), allocatable, private :: y(:, :), jacobian(:, :)
      !> Of a limit: derivative of the position by the start, its coefficients.
      real(wp), allocatable, private :: by_start(:, :, :), weight(:, :, :)
      !> Of products: blocks of all pairs, inputs and outputs.
      real(sp), allocatable, private :: near(:, :), near_input(:, :), near_output(:)
      real(wp), allocatable, private :: exact(:, :), input(:, :), output(:)
      !> Of marched products: as the library does them, and by transforms of all pairs at once, with
      !> coefficients and values (n_pairs, 3, ..) and numbers of the instants.
      type(march_derivative), private :: march_kernel
      real(wp), allocatable, private :: outputs(:, :)
      real(sp), allocatable, private :: synthesis(:, :), analysis(:, :), starts(:, :, :)
      real(sp), allocatable, private :: v(:, :), at(:, :, :), numbers(:, :, :)
   contains
      procedure :: reserve
      procedure :: prepare
      procedure :: evaluate
      procedure :: differentiate
      procedure :: multiply
   end type contact_kernels

   !> Pairs that are marched together, and turns before the limit is looked for, as in
   !> src/force/friction.f90.
   integer, parameter :: block_size = 8, plain_turns = 4
   !> Turns with their derivative that find a limit at least: a step, and a look at its end.
   integer, parameter :: limit_turns = 2

contains

   subroutine reserve(self, problem, mu, is_marched)
      class(contact_kernels), intent(out) :: self
      type(balance_problem), intent(in), target :: problem
      real(wp), intent(in) :: mu(:)
      !> Near products with derivatives are marches.
      logical, intent(in) :: is_marched
      integer :: c

      self%problem => problem
      self%mu = mu
      self%is_planar = any(problem%joint%row(1, :) > 0 .and. problem%joint%row(2, :) > 0)
      self%wanted = [(any(problem%joint%row(c, :) > 0), c=1, 3)]
      associate (n => problem%n_pairs, f => problem%fourier)
         allocate (self%prediction(n, 3, f%n_coefficients), self%force(n, 3, f%n_coefficients), &
                   self%values(n, 3, f%n_time), self%force_time(n, 3, f%n_time), &
                   self%offset(n), self%x(n, 2), self%margin(n), self%pressure(n), source=0.0_wp)
         allocate (self%turns(n), self%n_outputs(n), source=0)
         call f%plan_fft(3*n, self%fft)
         call self%turn%reserve(f%n_coefficients, f%n_time)
         call self%sums%reserve(f)
         if (f%projects) call self%waves%build(f)
         allocate (self%y(3, f%n_time), self%jacobian(3*f%n_coefficients, 3*f%n_coefficients), &
                   self%by_start(2, 2, f%n_time), self%weight(2, 2, f%n_coefficients), &
                   source=0.0_wp)
         associate (most => 3*f%n_coefficients)
            allocate (self%near(most**2, n), self%near_input(most, n), self%near_output(most), &
                      source=1.0e-3_sp)
            allocate (self%input(most, n), self%output(most), source=1.0e-3_wp)
         end associate
      end associate
      self%is_marched = is_marched
      if (is_marched) call reserve_march(self)
   end subroutine reserve

   !> Room for marched products.
   subroutine reserve_march(self)
      type(contact_kernels), intent(inout) :: self

      associate (n => self%problem%n_pairs, f => self%problem%fourier)
         call self%march_kernel%reserve(f%synthesis, f%analysis, n)
         allocate (self%outputs, source=self%input)
         self%synthesis = real(f%synthesis, sp)
         self%analysis = real(f%analysis, sp)
         allocate (self%starts(n, 3*f%n_coefficients, 2), self%v(n*3, f%n_coefficients), &
                   self%at(n, 3, f%n_time), self%numbers(n, numbers_of_instant, f%n_time), &
                   source=1.0e-3_sp)
      end associate
   end subroutine reserve_march

   !> Take what a call starts from; of a residual the predicted forces, of a derivative the pairs.
   subroutine prepare(self, snapshot)
      class(contact_kernels), intent(inout) :: self
      type(snapshot_type), intent(in) :: snapshot

      if (allocated(snapshot%prediction)) then
         self%prediction = snapshot%prediction
         self%x = snapshot%x
         self%turns = snapshot%turns
      end if
      if (.not. allocated(snapshot%n_outputs)) return
      self%n_outputs = snapshot%n_outputs
      if (self%is_marched .and. self%by_panels) call arrange_march(self)
   end subroutine prepare

   !> The mixed pairs, side by side.
   subroutine arrange_march(self)
      type(contact_kernels), intent(inout) :: self
      real(wp) :: numbers(numbers_of_instant, size(self%values, 3))
      integer :: i

      numbers = 0.5_wp
      call self%march_kernel%choose(self%n_outputs > 0)
      do i = 1, size(self%n_outputs)
         if (self%n_outputs(i) > 0) call self%march_kernel%keep(i, numbers, self%turn%dx)
      end do
      do i = 1, self%march_kernel%n_groups()
         call self%march_kernel%arrange(i)
      end do
   end subroutine arrange_march

   !> Two transforms, and as many turns as the pairs took.
   subroutine evaluate(self)
      class(contact_kernels), intent(inout) :: self
      integer :: k

      associate (n => self%problem%n_pairs, f => self%problem%fourier)
         call f%to_time(3*n, self%prediction, self%values, self%fft, self%wanted)
         do k = 1, f%n_time
            self%values(:, 3, k) = self%values(:, 3, k) + self%offset
         end do
         call march(self, n, f%n_time)
         call f%to_coefficients(3*n, self%force_time, self%force, self%fft, self%wanted)
      end associate
   end subroutine evaluate

   subroutine march(self, n, n_time)
      type(contact_kernels), intent(inout) :: self
      integer, intent(in) :: n, n_time
      integer :: first, last, turn

      do first = 1, n, block_size
         last = min(first + block_size - 1, n)
         do turn = 1, min(maxval(self%turns(first:last)), plain_turns + 1)
            if (self%is_planar) then
               call march_turn_2d(n, n_time, first, last, self%mu, self%values, self%x, &
                                  self%force_time, self%margin, self%pressure)
            else
               call march_turn_1d(n, n_time, first, last, self%mu, self%values, self%x, &
                                  self%force_time, self%margin, self%pressure)
            end if
         end do
         do turn = 1, limit_turns
            call turn_to_limits(self, first, last)
         end do
      end do
   end subroutine march

   !> Turns with their derivatives of the pairs that do not repeat by themselves.
   subroutine turn_to_limits(self, first, last)
      type(contact_kernels), intent(inout) :: self
      integer, intent(in) :: first, last
      integer :: i

      do i = first, last
         if (self%turns(i) > plain_turns) call turn_once(self, i)
      end do
   end subroutine turn_to_limits

   subroutine turn_once(self, i)
      type(contact_kernels), intent(inout) :: self
      integer, intent(in) :: i
      real(wp) :: inverse(2, 2)
      logical :: unique

      call limit_is_unique(size(self%mu), size(self%values, 3), i, self%values, self%mu(i), &
                           0.0_wp, self%x(i, :), unique, inverse, self%by_start)
   end subroutine turn_once

   !> One turn of the derivative of each mixed pair, and its projection; of a limit also that by
   !> the start.
   subroutine differentiate(self, waits)
      class(contact_kernels), intent(inout) :: self
      !> Without the projection.
      logical, intent(in) :: waits
      integer :: i

      do i = 1, size(self%n_outputs)
         if (self%n_outputs(i) > 0) call differentiate_pair(self, waits, i)
      end do
   end subroutine differentiate

   subroutine differentiate_pair(self, waits, i)
      type(contact_kernels), intent(inout) :: self
      logical, intent(in) :: waits
      integer, intent(in) :: i
      logical :: present(3)
      real(wp) :: x(2)
      integer :: place

      associate (f => self%problem%fourier, nc => self%problem%fourier%n_coefficients)
         present = self%problem%joint%row(:, i) > 0
         self%y = self%values(i, :, :)
         x = self%x(i, :)
         call self%turn%march(f%n_time, nc, 1, f%synthesis, self%y, self%mu(i), 0.0_wp, present, &
                              .true., x)
         if (self%turns(i) > plain_turns) call turn_once(self, i)
         if (waits) return
         call self%turn%project(f, self%waves, present, self%sums, self%jacobian)
         if (self%turns(i) > plain_turns) call add_start(self, nc, self%turn%dx, self%jacobian)
         ! Normal forces of pairs that bear throughout are their predictions.
         if (self%n_outputs(i) < count(present)) return
         self%sums%wanted = self%y(3, :) < 0.0_wp
         place = 2*nc + 1
         call self%sums%form(f, self%waves, 3*nc, self%jacobian(place, place))
      end associate
   end subroutine differentiate_pair

   !> What the start of a turn adds to the projection: of rank two.
   subroutine add_start(self, nc, dx, jacobian)
      type(contact_kernels), intent(inout) :: self
      integer, intent(in) :: nc
      real(wp), intent(in) :: dx(3*nc, 2)
      real(wp), intent(inout) :: jacobian(3*nc, 2*nc)
      integer :: c, j

      associate (f => self%problem%fourier)
         call dgemm('N', 'T', 4, nc, f%n_time, -1.0_wp, self%by_start, 4, f%analysis, nc, 0.0_wp, &
                    self%weight, 4)
      end associate
      do c = 1, 2
         do j = 1, nc
            associate (column => jacobian(:, (c - 1)*nc + j))
               column = column + self%weight(c, 1, j)*dx(:, 1) + self%weight(c, 2, j)*dx(:, 2)
            end associate
         end do
      end do
   end subroutine add_start

   !> Products with the derivatives of the mixed pairs.
   subroutine multiply(self, is_near)
      class(contact_kernels), intent(inout) :: self
      !> In single precision, and of what has to be computed alone.
      logical, intent(in) :: is_near
      integer :: i, n_in, n_out

      if (is_near .and. self%is_marched) then
         call multiply_marches(self)
         return
      end if
      if (.not. is_near .and. .not. allocated(self%exact)) then
         allocate (self%exact(size(self%near, 1), size(self%near, 2)), source=1.0e-3_wp)
      end if
      associate (nc => self%problem%fourier%n_coefficients)
         do i = 1, size(self%n_outputs)
            if (self%n_outputs(i) == 0) cycle
            n_in = nc*count(self%problem%joint%row(:, i) > 0)
            n_out = nc*self%n_outputs(i)
            if (is_near) then
               call sgemv('T', n_in, n_out, 1.0_sp, self%near(1, i), n_in, &
                          self%near_input(1, i), 1, 0.0_sp, self%near_output, 1)
            else
               call dgemv('T', n_in, n_out, 1.0_wp, self%exact(1, i), n_in, self%input(1, i), 1, &
                          0.0_wp, self%output, 1)
            end if
         end do
      end associate
   end subroutine multiply

   !> Transforms of all mixed pairs at once, their marches side by side, and back.
   subroutine multiply_marches(self)
      type(contact_kernels), intent(inout) :: self
      integer :: group, n, nc, nt

      if (self%by_panels) then
         do group = 1, self%march_kernel%n_groups()
            call self%march_kernel%multiply(group, self%input, self%outputs)
         end do
         return
      end if
      n = count(self%n_outputs > 0)
      nc = size(self%synthesis, 1)
      nt = size(self%synthesis, 2)
      if (n == 0) return
      call sgemm('N', 'N', 3*n, nt, nc, 1.0_sp, self%v, 3*n, self%synthesis, nc, 0.0_sp, self%at, &
                 3*n)
      call march_all(n, nt, nc, self%starts, self%numbers, self%v, self%at)
      call sgemm('N', 'T', 3*n, nc, nt, 1.0_sp, self%at, 3*n, self%analysis, nc, 0.0_sp, self%v, &
                 3*n)
      ! Small numbers would slow processors down.
      self%v = 1.0e-3_sp
   end subroutine multiply_marches

   !> See src/force/march_derivative.f90.
   pure subroutine march_all(n, n_time, nc, starts, numbers, v, y)
      integer, intent(in) :: n, n_time, nc
      real(sp), intent(in) :: starts(n, 3*nc, 2), numbers(n, numbers_of_instant, n_time)
      real(sp), intent(in) :: v(n, 3*nc)
      real(sp), intent(inout) :: y(n, 3, n_time)
      real(sp) :: x(n, 2), d_1, d_2, force_1, force_2
      integer :: i, j, k

      x = 0.0_sp
      do j = 1, 3*nc
         x(:, 1) = x(:, 1) + starts(:, j, 1)*v(:, j)
         x(:, 2) = x(:, 2) + starts(:, j, 2)*v(:, j)
      end do
      do k = 1, n_time
         !$omp simd private(d_1, d_2, force_1, force_2)
         do i = 1, n
            d_1 = y(i, 1, k) - x(i, 1)
            d_2 = y(i, 2, k) - x(i, 2)
            force_1 = numbers(i, 1, k)*d_1 + numbers(i, 2, k)*d_2 + numbers(i, 4, k)*y(i, 3, k)
            force_2 = numbers(i, 2, k)*d_1 + numbers(i, 3, k)*d_2 + numbers(i, 5, k)*y(i, 3, k)
            x(i, 1) = y(i, 1, k) - force_1
            x(i, 2) = y(i, 2, k) - force_2
            y(i, 1, k) = force_1
            y(i, 2, k) = force_2
            y(i, 3, k) = numbers(i, 6, k)*y(i, 3, k)
         end do
      end do
   end subroutine march_all

end module floor_contact
