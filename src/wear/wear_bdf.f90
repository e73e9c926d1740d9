!> Vibration and wear depth as a differential-algebraic system over the cycles N,
!>
!>   0 = R(q, w),   0 = w' - rate(q, w),
!>
!> by backward differentiation formulas of variable order and step: IDA (SUNDIALS; Hindmarsh et al.
!> 2005) with SPGMR, whose preconditioner is the linear solution of the coupled system: one Krylov
!> iteration mostly does, and the derivative is kept while it serves. Errors are controlled for the
!> depths; the vibration follows them.
module fw_wear_bdf
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_set_flag, &
      ieee_set_halting_mode, ieee_usual
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_funloc, c_int, &
      c_loc, c_long, c_null_ptr, c_ptr
   use fida_mod, only: fidacreate, fidafree, fidagetnumprecsolves, fidainit, fidaseterrhandlerfn, &
      fidasetid, fidasetinitstep, fidasetmaxstep, fidasetpreconditioner, fidasetstoptime, &
      fidasetsuppressalg, fidasetuserdata, fidasolve, fidawftolerances, ida_one_step
   use fsundials_linearsolver_mod, only: fsunlinsolfree, sun_prec_left, sunlinearsolver
   use fsundials_nvector_mod, only: n_vector
   use fsunlinsol_spgmr_mod, only: fsunlinsol_spgmr
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_sundials, only: callback_fatal, callback_ok, callback_smaller, close_context, &
      ignore_message, open_context, release, values, wrap
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: bdf_integrator

   !> What the callbacks need.
   type :: bdf_state
      type(wear_system), pointer :: system => null()
      type(linear_step_type), pointer :: linear => null()
      !> Whether `linear` holds the derivative that was prepared last: others use it too.
      logical :: prepared = .false.
      !> Error of a step, as a part of the largest depth; depth below which that stops falling.
      real(wp) :: tolerance = 0.0_wp, least_depth = 0.0_wp
      real(wp), allocatable :: r(:), step(:)
   end type bdf_state

   !> An integration from one state; not to be copied while it runs.
   type :: bdf_integrator
      !> What the callbacks see, and the objects of SUNDIALS; null between two integrations.
      type(bdf_state), pointer, private :: state => null()
      type(c_ptr), private :: context = c_null_ptr, memory = c_null_ptr
      type(n_vector), pointer, private :: y => null(), slope => null(), kind_of => null()
      type(sunlinearsolver), pointer, private :: spgmr => null()
      real(wp), pointer, contiguous, private :: y_values(:) => null(), slope_values(:) => null(), &
                                                kind_values(:) => null()
      !> Linear solutions so far.
      integer :: n_solved = 0
   contains
      procedure :: is_started
      procedure :: start
      procedure :: limit_step
      procedure :: forget_derivative
      procedure :: advance
      procedure :: finish
   end type bdf_integrator

   integer(c_int), parameter :: krylov_length = 5
   !> Relative residual of the linear solutions.
   real(wp), parameter :: linear_tolerance = 1.0e-3_wp
   !> Vibration that lags behind wears what is never given back: however much of the depth may be in
   !> error, the vibration is at least this accurate, as a part of the depth.
   real(wp), parameter :: loosest = 1.0e-2_wp

   !> The Fortran interface of this function cannot say that there is no matrix: it takes an
   !> object where C takes a null pointer. This is the function behind that interface.
   interface
      integer(c_int) function set_linear_solver(memory, solver, matrix) &
         bind(c, name='_wrap_FIDASetLinearSolver')
         import :: c_int, c_ptr
         type(c_ptr), value :: memory, solver, matrix
      end function set_linear_solver
   end interface

contains

   !> Between `start` and `finish`.
   logical function is_started(self)
      class(bdf_integrator), intent(in) :: self

      is_started = c_associated(self%memory)
   end function is_started

   !> Begin at x, where the depths grow by `rate`.
   subroutine start(self, system, linear, x, rate, cycles, first_step, n_cycles, tolerance, &
                    least_depth, done)
      class(bdf_integrator), intent(inout) :: self
      type(wear_system), intent(in), target :: system
      type(linear_step_type), intent(in), target :: linear
      !> Unknowns, vibration and depths, and rates of the pairs (n_pairs).
      real(wp), intent(in) :: x(:), rate(:)
      !> Cycles now, those of the first step, and where the integration has to end.
      real(wp), intent(in) :: cycles, first_step, n_cycles
      !> See bdf_state.
      real(wp), intent(in) :: tolerance, least_depth
      logical, intent(out) :: done
      integer :: n

      n = system%n_vibration()
      allocate (self%state)
      allocate (self%y_values(size(x)), self%slope_values(size(x)), self%kind_values(size(x)))
      allocate (self%state%r(size(x)), self%state%step(size(x)))
      self%state%system => system
      self%state%linear => linear
      self%state%tolerance = tolerance
      self%state%least_depth = least_depth
      self%y_values = x
      self%slope_values = 0.0_wp
      ! IDA takes w' from its vector of slopes; q' is of no equation.
      self%slope_values(n + 1:) = rate
      ! 1 marks what is differential: the depths.
      self%kind_values = 0.0_wp
      self%kind_values(n + 1:) = 1.0_wp
      call open_context(self%context, done)
      if (.not. done) return
      self%y => wrap(self%y_values, self%context)
      self%slope => wrap(self%slope_values, self%context)
      self%kind_of => wrap(self%kind_values, self%context)
      self%memory = fidacreate(self%context)
      done = c_associated(self%memory) .and. associated(self%y) .and. associated(self%slope) &
             .and. associated(self%kind_of)
      if (.not. done) return
      self%spgmr => fsunlinsol_spgmr(self%y, sun_prec_left, krylov_length, self%context)
      done = associated(self%spgmr)
      if (done) call configure(self, cycles, first_step, n_cycles, done)
   end subroutine start

   !> Each status is looked at once all are set.
   subroutine configure(self, cycles, first_step, n_cycles, done)
      class(bdf_integrator), intent(inout) :: self
      real(wp), intent(in) :: cycles, first_step, n_cycles
      logical, intent(out) :: done
      integer(c_int) :: status(9)

      status = 0
      associate (memory => self%memory)
         status(1) = fidaseterrhandlerfn(memory, c_funloc(ignore_message), c_null_ptr)
         status(2) = fidainit(memory, c_funloc(evaluate), cycles, self%y, self%slope)
         status(3) = fidasetuserdata(memory, c_loc(self%state))
         status(4) = fidawftolerances(memory, c_funloc(weigh))
         status(5) = fidasetid(memory, self%kind_of)
         ! Errors are those of the depths alone.
         status(6) = fidasetsuppressalg(memory, 1_c_int)
         status(7) = set_linear_solver(memory, c_loc(self%spgmr), c_null_ptr)
         status(8) = fidasetpreconditioner(memory, c_funloc(set_up), c_funloc(precondition))
         status(9) = fidasetinitstep(memory, first_step)
         ! The last step then ends at n_cycles, instead of passing it.
         if (n_cycles < huge(1.0_wp)) status(9) = max(status(9), fidasetstoptime(memory, n_cycles))
      end associate
      done = all(status == 0)
   end subroutine configure

   !> Make no step longer than this from the next one on that is not planned yet.
   subroutine limit_step(self, cycles, done)
      class(bdf_integrator), intent(inout) :: self
      real(wp), intent(in) :: cycles
      logical, intent(out) :: done

      done = fidasetmaxstep(self%memory, cycles) == 0
   end subroutine limit_step

   !> The linear problem has served another system in between: prepare it again when it is needed.
   subroutine forget_derivative(self)
      class(bdf_integrator), intent(inout) :: self

      if (associated(self%state)) self%state%prepared = .false.
   end subroutine forget_derivative

   !> One step of the length and order that the error allows.
   subroutine advance(self, x, cycles, n_solved, done)
      class(bdf_integrator), intent(inout) :: self
      real(wp), intent(out) :: x(:)
      real(wp), intent(out) :: cycles
      !> Linear solutions of this step.
      integer, intent(out) :: n_solved
      logical, intent(out) :: done
      real(c_double) :: reached(1)
      integer(c_long) :: solved(1)
      logical :: halting(size(ieee_usual))
      integer(c_int) :: status

      ! A power within IDA may overflow, after which it goes on all the same: a host program that
      ! traps overflow must not end here.
      call ieee_get_halting_mode(ieee_usual, halting)
      call ieee_set_halting_mode(ieee_usual, .false.)
      status = fidasolve(self%memory, huge(1.0_wp), reached, self%y, self%slope, ida_one_step)
      call ieee_set_flag(ieee_usual, .false.)
      call ieee_set_halting_mode(ieee_usual, halting)
      done = status >= 0
      x = self%y_values
      cycles = reached(1)
      status = fidagetnumprecsolves(self%memory, solved)
      n_solved = int(solved(1)) - self%n_solved
      self%n_solved = int(solved(1))
   end subroutine advance

   !> The reverse order of `start`; harmless where that failed half-way.
   subroutine finish(self)
      class(bdf_integrator), intent(inout) :: self
      integer(c_int) :: status

      if (c_associated(self%memory)) call fidafree(self%memory)
      self%memory = c_null_ptr
      if (associated(self%spgmr)) status = fsunlinsolfree(self%spgmr)
      nullify (self%spgmr)
      call release(self%y)
      call release(self%slope)
      call release(self%kind_of)
      call close_context(self%context)
      if (associated(self%state)) deallocate (self%state)
      if (associated(self%y_values)) deallocate (self%y_values, self%slope_values, self%kind_values)
      self%n_solved = 0
   end subroutine finish

   !> Callback: weights of errors; the vibration has to be as accurate as the depths, relative to
   !> its largest unknown.
   integer(c_int) function weigh(y, weight, data) bind(c, name='') result(status)
      type(n_vector), intent(inout) :: y, weight
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: x(:), w(:)
      real(wp) :: depth, largest, mean
      integer :: n

      call c_f_pointer(data, state)
      n = state%system%n_vibration()
      x => values(y, state%system%n)
      w => values(weight, state%system%n)
      depth = max(maxval(abs(x(n + 1:))), state%least_depth)
      largest = max(maxval(abs(x(:n))), tiny(1.0_wp))
      ! IDA takes the mean over all unknowns: its norm is made that of the vector itself, which
      ! bounds the error of each pair.
      mean = sqrt(real(size(x), wp))
      w(:n) = mean/(min(state%tolerance, loosest)*min(depth, largest))
      w(n + 1:) = mean/(state%tolerance*depth)
      status = callback_ok
   end function weigh

   !> Callback: residual of the system.
   integer(c_int) function evaluate(cycles, y, slope, residual, data) bind(c, name='') &
      result(status)
      real(c_double), value :: cycles
      type(n_vector), intent(inout) :: y, slope, residual
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: x(:), dx(:), f(:)
      integer :: n

      associate (cycles => cycles)
      end associate
      call c_f_pointer(data, state)
      n = state%system%n_vibration()
      x => values(y, state%system%n)
      dx => values(slope, state%system%n)
      f => values(residual, state%system%n)
      ! The rates of wear at x come with the residual of the vibration.
      call state%system%residual(x, f)
      ! In units of force, so that both parts of the residual have one scale.
      f(n + 1:) = state%system%force_of_depth(dx(n + 1:) - state%system%rate)
      status = callback_ok
      if (.not. ieee_is_finite(norm2(f))) status = callback_smaller
      if (state%system%is_interrupted()) status = callback_fatal
   end function evaluate

   !> Callback: derivative of the coupled system; an implicit step of 1/factor cycles has it.
   integer(c_int) function set_up(cycles, y, slope, residual, factor, data) bind(c, name='') &
      result(status)
      real(c_double), value :: cycles, factor
      type(n_vector), intent(inout) :: y, slope, residual
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      logical :: done

      associate (cycles => cycles, slope => slope, residual => residual)
      end associate
      call c_f_pointer(data, state)
      call prepare(state, values(y, state%system%n), factor, done)
      status = merge(callback_ok, callback_smaller, done)
   end function set_up

   !> The derivative of an implicit step of 1/factor cycles at x.
   subroutine prepare(state, x, factor, done)
      type(bdf_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: factor
      logical, intent(out) :: done

      call state%system%begin_step(x(state%system%n_vibration() + 1:), 1.0_wp/factor)
      call state%system%residual(x, state%r)
      call state%linear%prepare(state%system, done)
      state%prepared = done
   end subroutine prepare

   !> Callback: solve with that derivative.
   integer(c_int) function precondition(cycles, y, slope, residual, right, solution, factor, &
                                        accuracy, data) bind(c, name='') result(status)
      real(c_double), value :: cycles, factor, accuracy
      type(n_vector), intent(inout) :: y, slope, residual, right, solution
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: z(:)
      integer :: n
      logical :: done

      associate (cycles => cycles, accuracy => accuracy, slope => slope, residual => residual)
      end associate
      call c_f_pointer(data, state)
      status = callback_smaller
      if (.not. state%prepared) then
         call prepare(state, values(y, state%system%n), factor, done)
         if (.not. done) return
      end if
      n = state%system%n_vibration()
      z => values(solution, state%system%n)
      state%r = -values(right, state%system%n)
      ! Its equations of the depths are those of the step, 1/factor times these.
      state%r(n + 1:) = state%system%cycles*state%r(n + 1:)
      call state%linear%solve_prepared(state%system, state%r, linear_tolerance, state%step, done)
      z = state%step
      status = merge(callback_ok, callback_smaller, done)
      if (.not. ieee_is_finite(norm2(z))) status = callback_fatal
   end function precondition

end module fw_wear_bdf
