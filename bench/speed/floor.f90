!> Where the time of a frequency sweep goes, and the floor of it: the marches, transforms, products
!> and factorisations that it cannot do without, by the library's own kernels and LAPACK, each done
!> once more, alone, right after the part of the solution that has done it.
!>
!>    floor case.nml
!>
!> takes a case of analysis 'frf' with uniform sampling that Newton's method solves from one guess a
!> point, in one thread, and writes one line of comma-separated values for each part: its name, the
!> number of calls, the processor time in the library and that of the floor [s].
module floor_system
   use, intrinsic :: iso_c_binding, only: c_int
   use, intrinsic :: iso_c_binding, only: c_long
   use fw_correction, only: march_turn_1d
   use fw_correction, only: march_turn_2d
   use fw_error, only: error_type
   use fw_force_law, only: pair_mixed
   use fw_balance_state, only: balance_state
   use fw_balance_state, only: new_balance_state
   use fw_instant_sum, only: instant_sum
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_lapack, only: dgemv
   use fw_lapack, only: zgemm
   use fw_lapack, only: zgemv
   use fw_linalg, only: complex_lu_type
   use fw_plain_structure, only: plain_structure
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_two_directions, only: turn_derivative
   use fw_wave_sums, only: wave_table
   implicit none (type, external)
   private

   public :: measured_system, new_measured_system, processor_time
   public :: n_parts, part_names, part_condense, part_residual, part_linearize, part_build, &
      part_apply, part_precondition, part_krylov

   integer, parameter :: n_parts = 7
   integer, parameter :: part_condense = 1, part_residual = 2, part_linearize = 3, part_build = 4, &
      part_apply = 5, part_precondition = 6, part_krylov = 7
   character(*), parameter :: part_names(n_parts) = [character(30) :: 'condensation', 'residual', &
      'derivative of the forces', 'preconditioner: build', 'product with the derivative', &
      'preconditioner: solve', 'Krylov basis']
   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> POSIX: processor time of the process.
   integer(c_int), parameter :: clock_process = 2_c_int

   type, bind(c) :: timespec
      integer(c_long) :: seconds = 0_c_long
      integer(c_long) :: nanoseconds = 0_c_long
   end type timespec

   interface
      integer(c_int) function clock_gettime(clock, time) bind(c)
         import :: c_int, timespec
         integer(c_int), value :: clock
         type(timespec), intent(out) :: time
      end function clock_gettime
   end interface

   !> A balance whose parts are timed.
   type, extends(balance_state) :: measured_system
      integer :: calls(n_parts) = 0
      real(wp) :: seconds(n_parts) = 0.0_wp
      real(wp) :: floor(n_parts) = 0.0_wp
      !> What a pair of calls of the clock takes.
      real(wp) :: empty = 0.0_wp
      !> Products since the derivative was made: the size of the Krylov basis.
      integer :: n_products = 0
      ! Scratch of the floor.
      real(wp), allocatable :: mu(:), x(:, :), margin(:), pressure(:)
      real(wp), allocatable :: values(:, :, :), force(:, :, :)
      type(turn_derivative) :: turn
      type(instant_sum) :: sums
      type(wave_table) :: waves
      real(wp), allocatable :: y(:, :), jacobian(:, :)
      real(wp), allocatable :: basis(:, :), vector(:), weights(:)
      complex(wp), allocatable :: input(:), output(:), coupling(:, :), solved(:, :), square(:, :)
      complex(wp), allocatable :: stiffness(:, :, :)
      !> Internal modes of the condensation, and whether damping couples them.
      integer :: n_internal = 0
      logical :: coupled = .false.
      type(preconditioner_lu_type) :: lu
      type(complex_lu_type) :: internal
   contains
      procedure :: set_frequency
      procedure :: residual
      procedure :: linearize
      procedure :: build_preconditioner
      procedure :: apply
      procedure :: precondition
   end type measured_system

contains

   !> Processor time of the program [s].
   real(wp) function processor_time()
      type(timespec) :: now
      integer(c_int) :: status

      status = clock_gettime(clock_process, now)
      processor_time = real(now%seconds, wp) + 1.0e-9_wp*real(now%nanoseconds, wp)
   end function processor_time

   !> Take over a system that was built.
   subroutine new_measured_system(system, mu, self)
      type(balance_state), intent(in) :: system
      !> Friction coefficient (n_pairs).
      real(wp), intent(in) :: mu(:)
      type(measured_system), intent(out) :: self
      integer, parameter :: n_trials = 1000, longest_basis = 61
      integer :: i, m, n, nc, nt
      real(wp) :: start

      call new_balance_state(system%problem, self%balance_state)
      self%mu = mu
      m = self%problem%structure%n_coordinates
      n = self%problem%n_pairs
      nc = self%problem%fourier%n_coefficients
      nt = self%problem%fourier%n_time
      allocate (self%x(n, 2), self%margin(n), self%pressure(n), source=0.0_wp)
      allocate (self%values(n, 3, nt), self%force(n, 3, nc), source=0.0_wp)
      call self%turn%reserve(nc, nt)
      call self%sums%reserve(self%problem%fourier)
      call self%waves%build(self%problem%fourier)
      allocate (self%y(3, nt), self%jacobian(3*nc, 3*nc), source=0.0_wp)
      allocate (self%basis(m*nc, longest_basis), source=1.0e-3_wp)
      allocate (self%vector(m*nc), self%weights(longest_basis), source=1.0e-3_wp)
      allocate (self%input(m), self%output(m), source=one)
      select type (structure => self%problem%structure)
      type is (plain_structure)
         self%n_internal = structure%basis%n_internal
         self%coupled = allocated(structure%basis%c_ii)
      end select
      allocate (self%stiffness(m, m, self%problem%fourier%n_retained), source=one)
      associate (n_internal => self%n_internal)
         allocate (self%coupling(m, n_internal), self%solved(n_internal, m), source=one)
         allocate (self%square(m, m), source=one)
      end associate
      start = processor_time()
      do i = 1, n_trials
         self%empty = processor_time()
      end do
      self%empty = (self%empty - start)/real(n_trials, wp)
   end subroutine new_measured_system

   !> Add what has passed since two times: in the library up to `middle`, in the floor from there.
   subroutine add(self, part, start, middle)
      type(measured_system), intent(inout) :: self
      integer, intent(in) :: part
      real(wp), intent(in) :: start, middle
      real(wp) :: now

      now = processor_time()
      self%calls(part) = self%calls(part) + 1
      self%seconds(part) = self%seconds(part) + max(0.0_wp, middle - start - self%empty)
      self%floor(part) = self%floor(part) + max(0.0_wp, now - middle - self%empty)
   end subroutine add

   !> Floor: the internal block solved for its coupling, where damping fills it, and half of the
   !> product, which is symmetric.
   subroutine set_frequency(self, parameter, error)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: start, middle
      integer :: h, m, n

      start = processor_time()
      call self%balance_state%set_frequency(parameter, error)
      middle = processor_time()
      m = size(self%coupling, 1)
      n = size(self%coupling, 2)
      if (n > 0) then
         do h = 1, self%problem%fourier%n_retained
            if (self%coupled) call solve_internal(self, m, n)
            call zgemm('N', 'N', m, (m + 1)/2, n, -one, self%coupling, m, self%solved, n, one, &
                       self%square, m)
         end do
      end if
      call add(self, part_condense, start, middle)
   end subroutine set_frequency

   !> A matrix that elimination leaves as it is takes no less time than any other.
   subroutine solve_internal(self, m, n)
      type(measured_system), intent(inout) :: self
      integer, intent(in) :: m, n
      logical :: singular
      integer :: j

      call self%internal%reserve(n)
      self%internal%matrix(:n, :n) = zero
      do j = 1, n
         self%internal%matrix(j, j) = one
      end do
      call self%internal%factor(singular)
      call self%internal%solve(m, self%solved)
   end subroutine solve_internal

   !> Floor: the product with Z_r, two transforms and the turns of the march.
   subroutine residual(self, x, r)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      real(wp) :: start, middle
      integer :: h, m, n

      start = processor_time()
      call self%balance_state%residual(x, r)
      middle = processor_time()
      m = self%problem%structure%n_coordinates
      n = 3*self%problem%n_pairs
      do h = 1, self%problem%fourier%n_retained
         call zgemv('N', m, m, one, self%stiffness(1, 1, h), m, self%input, 1, zero, &
                    self%output, 1)
      end do
      associate (work => self%work(self%problem%forces%pairs))
         call self%problem%fourier%to_time(n, work%prediction, self%values, work%fft)
      end associate
      call march(self)
      associate (work => self%work(self%problem%forces%pairs))
         call self%problem%fourier%to_coefficients(n, work%force_time, self%force, work%fft)
      end associate
      call add(self, part_residual, start, middle)
   end subroutine residual

   !> As many turns as the pairs took, in the blocks of the library.
   subroutine march(self)
      type(measured_system), intent(inout) :: self
      integer, parameter :: block_size = 8
      integer :: first, last, turn

      associate (c => self%work(self%problem%forces%pairs), n => self%problem%n_pairs, &
                 nt => self%problem%fourier%n_time, &
                 planar => any(self%problem%joint%row(2, :) > 0))
         self%x = c%x
         do first = 1, n, block_size
            last = min(first + block_size - 1, n)
            do turn = 1, min(maxval(c%turns(first:last)), 5)
               if (planar) then
                  call march_turn_2d(n, nt, first, last, self%mu, c%prediction_time, self%x, &
                                     self%values, self%margin, self%pressure)
               else
                  call march_turn_1d(n, nt, first, last, self%mu, c%prediction_time, self%x, &
                                     self%values, self%margin, self%pressure)
               end if
            end do
         end do
      end associate
   end subroutine march

   !> Floor: one turn of the derivative for each mixed pair, and its projection.
   subroutine linearize(self, n_linear)
      class(measured_system), intent(inout) :: self
      integer, intent(out) :: n_linear
      real(wp) :: start, middle
      integer :: i, nc

      start = processor_time()
      call self%balance_state%linearize(n_linear)
      middle = processor_time()
      nc = self%problem%fourier%n_coefficients
      do i = 1, self%problem%n_pairs
         if (self%work(self%problem%forces%pairs)%linear_state(i) /= pair_mixed) cycle
         call derive(self, i, nc)
      end do
      call add(self, part_linearize, start, middle)
      self%n_products = 0
   end subroutine linearize

   subroutine derive(self, i, nc)
      type(measured_system), intent(inout) :: self
      integer, intent(in) :: i, nc
      real(wp) :: x(2)

      associate (f => self%problem%fourier, present => self%problem%joint%row(:, i) > 0, &
                 contact => self%work(self%problem%forces%pairs))
         self%y = contact%prediction_time(i, :, :)
         x = contact%x(i, :)
         call self%turn%march(f%n_time, nc, 1, f%synthesis, self%y, self%mu(i), 0.0_wp, present, &
                              .true., x)
         call self%turn%project(f, self%waves, present, self%sums, self%jacobian)
      end associate
   end subroutine derive

   !> Floor: the factorisations of one matrix a harmonic.
   subroutine build_preconditioner(self)
      class(measured_system), intent(inout) :: self
      real(wp) :: start, middle
      integer :: h, j

      start = processor_time()
      call self%balance_state%build_preconditioner()
      middle = processor_time()
      do h = 1, self%problem%fourier%n_retained
         call self%lu%reserve(self%active%n_active, 1.0_wp)
         do j = 1, self%active%n_active
            self%lu%matrix(:self%active%n_active, j) = &
               cmplx(self%preconditioner%harmonic(h)%scale* &
               self%stiffness(:self%active%n_active, j, h), kind=sp)
         end do
         call self%lu%factor()
      end do
      call add(self, part_build, start, middle)
   end subroutine build_preconditioner

   !> Floor: the products with the rows in use and with the derivatives of the mixed pairs. Then,
   !> as a part of its own, Gram and Schmidt's products with the basis so far, twice.
   subroutine apply(self, vector, product)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      real(wp) :: start, middle
      integer :: h, i, m, n

      start = processor_time()
      call self%balance_state%apply(vector, product)
      middle = processor_time()
      m = self%problem%structure%n_coordinates
      do h = 1, self%problem%fourier%n_retained
         call zgemv('N', self%active%n_used, self%active%n_active, one, self%stiffness(1, 1, h), &
                    m, self%input, 1, zero, self%output, 1)
      end do
      n = 3*self%problem%fourier%n_coefficients
      do i = 1, self%problem%n_pairs
         if (self%work(self%problem%forces%pairs)%linear_state(i) /= pair_mixed) cycle
         associate (work => self%work(self%problem%forces%pairs))
            call dgemv('T', n, n, 1.0_wp, work%jacobian(1, 1, i), n, work%input(1, i), 1, 0.0_wp, &
                       self%vector, 1)
         end associate
      end do
      call add(self, part_apply, start, middle)
      self%n_products = min(self%n_products + 1, size(self%basis, 2) - 1)
      start = processor_time()
      n = self%active%n_linear
      do i = 1, 2
         call dgemv('T', n, self%n_products, 1.0_wp, self%basis, size(self%basis, 1), &
                    self%vector, 1, 0.0_wp, self%weights, 1)
         call dgemv('N', n, self%n_products, -1.0_wp, self%basis, size(self%basis, 1), &
                    self%weights, 1, 1.0_wp, self%vector, 1)
      end do
      call add(self, part_krylov, start, start)
   end subroutine apply

   subroutine precondition(self, vector)
      class(measured_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      real(wp) :: start, middle
      integer :: h

      start = processor_time()
      call self%balance_state%precondition(vector)
      middle = processor_time()
      self%square(:, 1) = one
      do h = 1, self%problem%fourier%n_retained
         ! Of the order of its own factors, which may be kept from other active coordinates.
         call self%preconditioner%harmonic(h)%solve(self%square(:self%preconditioner%n, 1))
      end do
      call add(self, part_precondition, start, middle)
   end subroutine precondition

end module floor_system

!> See the module.
program floor
   use, intrinsic :: iso_fortran_env, only: error_unit
   use, intrinsic :: iso_fortran_env, only: output_unit
   use floor_system, only: measured_system
   use floor_system, only: n_parts
   use floor_system, only: new_measured_system
   use floor_system, only: part_names
   use floor_system, only: processor_time
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_guess, only: stuck_guess
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_newton, only: newton_solver
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_sweep, only: sweep_frequency
   use fw_read_case, only: read_case
   use fw_recovery, only: recover_point
   use fw_text, only: string_type
   implicit none (type, external)

   type(case_type) :: input
   type(balance_problem), target :: problem
   type(balance_state), target :: balance
   type(measured_system), target :: system
   type(newton_solver) :: newton
   type(error_type), allocatable :: error
   character(1000) :: path
   real(wp) :: building, newton_time, recovery
   integer :: iterations, part

   call get_command_argument(1, path)
   call read_case(trim(path), [string_type ::], input, error)
   call stop_on(error)
   building = processor_time()
   call build_system(input, problem, balance, error)
   call stop_on(error)
   call new_measured_system(balance, input%contact%mu, system)
   building = processor_time() - building
   newton%options = input%solver
   call sweep()
   write (output_unit, '(a)') 'part,calls,seconds,floor'
   do part = 1, n_parts
      call write_part(trim(part_names(part)), system%calls(part), system%seconds(part), &
                      system%floor(part))
   end do
   call write_part('rest of Newton and GMRES', iterations, newton_time, 0.0_wp)
   call write_part('recovery', input%sweep%n_points, recovery, 0.0_wp)
   call write_part('first matrices', 1, building, 0.0_wp)

contains

   !> The points of a natural sweep, each from the guess that the last two give.
   subroutine sweep()
      type(solver_report) :: report
      type(point_type) :: point
      real(wp), allocatable :: x(:), last(:), before(:)
      real(wp) :: start
      integer :: k

      allocate (x(system%n), last(system%n), before(system%n))
      iterations = 0
      newton_time = 0.0_wp
      recovery = 0.0_wp
      do k = 1, input%sweep%n_points
         start = processor_time() - measured()
         call system%set_frequency(sweep_frequency(input%sweep, k, input%sweep%n_points), error)
         call stop_on(error)
         select case (k)
         case (1)
            call stuck_guess(system%balance_state, x)
         case (2)
            x = last
         case default
            x = 2.0_wp*last - before
         end select
         call newton%solve(system, x, report)
         newton_time = newton_time + processor_time() - measured() - start
         if (.not. report%converged) then
            write (error_unit, '(a, i0, a)') 'point ', k, ' does not converge from its first guess'
            stop 1, quiet=.true.
         end if
         iterations = iterations + report%iterations
         before = last
         last = x
         start = processor_time()
         point = point_type()
         call recover_point(system%balance_state, x, input%harmonics%n_harmonics, &
                            input%output%contact, point)
         recovery = recovery + processor_time() - start
      end do
   end subroutine sweep

   !> What the parts have taken so far, floor included.
   real(wp) function measured()
      measured = sum(system%seconds) + sum(system%floor)
   end function measured

   subroutine write_part(name, calls, seconds, floor_seconds)
      character(*), intent(in) :: name
      integer, intent(in) :: calls
      real(wp), intent(in) :: seconds, floor_seconds

      write (output_unit, '(a, ",", i0, 2(",", es12.5))') name, calls, seconds, floor_seconds
   end subroutine write_part

   subroutine stop_on(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      write (error_unit, '(a)') error%message
      stop 1, quiet=.true.
   end subroutine stop_on

end program floor
