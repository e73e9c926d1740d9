!> Backward differentiation formulas of variable order and step in pseudo-time, by CVODE
!> (SUNDIALS; Cohen and Hindmarsh 1996) with SPGMR. Its matrix 1 + gamma P^-1 J is preconditioned
!> by solutions with J + P/gamma: factors where the system is small, so that one or two Krylov
!> iterations do, the system's own preconditioner where it is large.
module fw_pseudo_bdf
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_funloc, c_int, &
      c_loc, c_long, c_null_funptr, c_null_ptr, c_ptr
   use fcvode_mod, only: cv_bdf, cv_one_step, fcvode, fcvodecreate, fcvodefree, &
      fcvodegetcurrentstep, fcvodegetlastorder, fcvodegetnumerrtestfails, &
      fcvodegetnumnonlinsolvconvfails, fcvodegetnumnonlinsolviters, fcvodeinit, &
      fcvodeseterrhandlerfn, fcvodesetinitstep, fcvodesetjactimes, fcvodesetmaxord, &
      fcvodesetpreconditioner, fcvodesetstablimdet, fcvodesetstoptime, fcvodesetuserdata, &
      fcvodewftolerances
   use fsundials_linearsolver_mod, only: fsunlinsolfree, sun_prec_left, sunlinearsolver
   use fsundials_nvector_mod, only: n_vector
   use fsunlinsol_spgmr_mod, only: fsunlinsol_spgmr
   use fw_kinds, only: wp
   use fw_pseudo_linear, only: shifted_linear
   use fw_pseudo_scheme, only: pseudo_scheme
   use fw_pseudo_system, only: pseudo_system
   use fw_sundials, only: callback_fatal, callback_ok, callback_smaller, close_context, &
      ignore_message, open_context, release, values, wrap
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: bdf_scheme

   !> What the callbacks need: C pointers cannot point to a polymorphic object itself.
   type :: bdf_state
      class(pseudo_system), pointer :: system => null()
      type(shifted_linear) :: linear
      !> Shift behind the preconditioner.
      real(wp) :: gamma = 0.0_wp
      !> The point evaluated last without a shift and whether the system is linearized there.
      real(wp), allocatable :: seen(:), work(:)
      logical :: linearized = .false.
      !> Accuracy of a step now, and the size of the unknowns that it is relative to.
      real(wp) :: accuracy = 0.0_wp
      real(wp) :: unknown = 1.0_wp
   end type bdf_state

   type, extends(pseudo_scheme) :: bdf_scheme
      !> Error of a step, relative to the unknowns, at the start; it falls with the residual, as
      !> CVODE leaves unknowns where they are once they are that accurate.
      real(wp) :: accuracy = 3.0e-2_wp
      !> Highest order, 1 to 5. Formulas above order 2 are not A-stable (Dahlquist 1963): on flows
      !> with eigenvalues near the imaginary axis, as the rotated one of lightly damped structures,
      !> they are held to short steps. On a Duffing oscillator with 5 harmonics 82 of 84 starts
      !> arrived with order 2, some 30 with order 5.
      integer :: max_order = 2
      !> Norm of the residual at the start.
      real(wp) :: first = 1.0_wp
      !> Order of the last step.
      integer :: order = 0
      !> Where positive, the integration ends exactly there.
      real(wp) :: stop_time = 0.0_wp
      type(bdf_state), pointer :: state => null()
      !> Objects of SUNDIALS; null where there are none.
      type(c_ptr) :: context = c_null_ptr
      type(c_ptr) :: memory = c_null_ptr
      type(n_vector), pointer :: x => null()
      type(sunlinearsolver), pointer :: spgmr => null()
   contains
      procedure :: start
      procedure :: advance
      procedure :: finish
   end type bdf_scheme

   integer(c_int), parameter :: krylov_length = 30
   !> First step, relative to the scale of pseudo-time.
   real(wp), parameter :: first_step = 1.0e-3_wp
   !> Share of the fall of the residual that the accuracy follows, and the end of it.
   ! The accuracy starts to fall once the residual has fallen a hundredfold.
   real(wp), parameter :: following = 100.0_wp, finest = 1.0e-9_wp

   !> The Fortran interface of this function cannot say that there is no matrix: it takes an
   !> object where C takes a null pointer. This is the function behind that interface.
   interface
      integer(c_int) function set_linear_solver(memory, solver, matrix) &
         bind(c, name='_wrap_FCVodeSetLinearSolver')
         import :: c_int, c_ptr
         type(c_ptr), value :: memory, solver, matrix
      end function set_linear_solver
   end interface

contains

   !> A step given by the user is the first one only; CVODE chooses all others.
   subroutine start(self, system, x, done)
      class(bdf_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done

      allocate (self%state)
      self%first = norm2(self%r)
      self%state%system => system
      self%state%linear%kind = self%solver%linear
      self%state%seen = x
      allocate (self%state%work(size(x)))
      self%state%accuracy = self%accuracy
      self%state%unknown = self%scales%unknown
      self%step = self%options%step
      if (self%step <= 0.0_wp) self%step = first_step*self%scales%time
      call open_context(self%context, done)
      if (.not. done) return
      ! CVODE works on the array of the caller: x is the state after every step.
      self%x => wrap(x, self%context)
      self%memory = fcvodecreate(cv_bdf, self%context)
      done = associated(self%x) .and. c_associated(self%memory)
      if (.not. done) return
      self%spgmr => fsunlinsol_spgmr(self%x, sun_prec_left, krylov_length, self%context)
      done = associated(self%spgmr)
      if (done) call configure(self, done)
   end subroutine start

   !> Each status is looked at once all are set.
   subroutine configure(self, done)
      class(bdf_scheme), intent(inout) :: self
      logical, intent(out) :: done
      integer(c_int) :: status(11)

      status = 0
      associate (memory => self%memory)
         status(1) = fcvodeseterrhandlerfn(memory, c_funloc(ignore_message), c_null_ptr)
         status(2) = fcvodeinit(memory, c_funloc(evaluate), 0.0_c_double, self%x)
         status(3) = fcvodesetuserdata(memory, c_loc(self%state))
         status(4) = fcvodewftolerances(memory, c_funloc(weigh))
         status(5) = set_linear_solver(memory, c_loc(self%spgmr), c_null_ptr)
         status(6) = fcvodesetjactimes(memory, c_null_funptr, c_funloc(multiply))
         status(7) = fcvodesetpreconditioner(memory, c_funloc(set_up), c_funloc(precondition))
         status(8) = fcvodesetmaxord(memory, int(self%max_order, c_int))
         ! Where order 3 and more are allowed, watch for their instability.
         status(9) = fcvodesetstablimdet(memory, 1_c_int)
         status(10) = fcvodesetinitstep(memory, self%step)
         if (self%stop_time > 0.0_wp) status(11) = fcvodesetstoptime(memory, self%stop_time)
      end associate
      done = all(status == 0)
   end subroutine configure

   !> One internal step of CVODE, of the length and the order that its error allows.
   subroutine advance(self, system, x, done)
      class(bdf_scheme), intent(inout) :: self
      class(pseudo_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous, target :: x(:)
      logical, intent(out) :: done
      real(c_double) :: reached(1), far
      integer(c_int) :: status

      ! Newton's method may have used the system meanwhile.
      self%state%linearized = .false.
      self%state%seen = huge(1.0_wp)
      call tighten(self)
      ! Out of reach, so that one step ends where its error says.
      far = self%time + max(1.0e3_wp*self%step, self%scales%time)
      status = fcvode(self%memory, far, self%x, reached, cv_one_step)
      done = status >= 0
      if (done) then
         self%time = reached(1)
         self%accepted = self%accepted + 1
         call count_work(self)
      else
         self%message = 'BDF: CVODE gave up with status '//to_text(int(status))
      end if
      ! CVODE leaves the system wherever it looked last.
      call system%residual(x, self%r)
   end subroutine advance

   !> The accuracy before a step; it never gets worse again.
   subroutine tighten(self)
      class(bdf_scheme), intent(inout) :: self
      real(wp) :: share

      share = max(finest, following*norm2(self%r)/max(self%first, tiny(1.0_wp)))
      self%state%accuracy = min(self%state%accuracy, share*self%accuracy)
   end subroutine tighten

   !> CVODE counts from its start: the numbers replace, not add.
   subroutine count_work(self)
      class(bdf_scheme), intent(inout) :: self
      integer(c_long) :: errors(1), failures(1), iterations(1)
      integer(c_int) :: order(1), status(5)
      real(c_double) :: next(1)

      status(1) = fcvodegetnumerrtestfails(self%memory, errors)
      status(2) = fcvodegetnumnonlinsolvconvfails(self%memory, failures)
      status(3) = fcvodegetnumnonlinsolviters(self%memory, iterations)
      status(4) = fcvodegetlastorder(self%memory, order)
      status(5) = fcvodegetcurrentstep(self%memory, next)
      if (any(status /= 0)) return
      self%rejected = int(errors(1) + failures(1))
      self%linear_solves = int(iterations(1))
      self%order = int(order(1))
      self%step = next(1)
   end subroutine count_work

   !> The reverse order of `start`; harmless where that failed half-way.
   subroutine finish(self)
      class(bdf_scheme), intent(inout) :: self
      integer(c_int) :: status

      if (c_associated(self%memory)) call fcvodefree(self%memory)
      self%memory = c_null_ptr
      if (associated(self%spgmr)) status = fsunlinsolfree(self%spgmr)
      nullify (self%spgmr)
      call release(self%x)
      call close_context(self%context)
      if (associated(self%state)) deallocate (self%state)
   end subroutine finish

   !> Callback: weights of errors.
   integer(c_int) function weigh(x, weight, data) bind(c, name='') result(status)
      type(n_vector), intent(inout) :: x, weight
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: w(:)

      call c_f_pointer(data, state)
      w => values(weight, state%system%n)
      ! Absolute and relative at once: unknowns that are small beside the others need no digits.
      w = 1.0_wp/(state%accuracy*(state%unknown + abs(values(x, state%system%n))))
      status = callback_ok
   end function weigh

   !> Callback: rate of the flow.
   integer(c_int) function evaluate(time, x, rate, data) bind(c, name='') result(status)
      real(c_double), value :: time
      type(n_vector), intent(inout) :: x, rate
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: x_values(:), rate_values(:)

      associate (time => time)
      end associate
      call c_f_pointer(data, state)
      x_values => values(x, state%system%n)
      rate_values => values(rate, state%system%n)
      call state%system%rate(x_values, rate_values)
      state%seen = x_values
      state%linearized = .false.
      status = callback_ok
      ! CVODE then tries a smaller step.
      if (.not. ieee_is_finite(norm2(rate_values))) status = callback_smaller
      if (state%system%is_interrupted()) status = callback_fatal
   end function evaluate

   !> Callback: -P^-1 J times vector.
   integer(c_int) function multiply(vector, product, time, x, rate, data, work) &
      bind(c, name='') result(status)
      type(n_vector), intent(inout) :: vector, product, x, rate, work
      real(c_double), value :: time
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: v(:), p(:), x_values(:)
      integer :: n_linear

      associate (time => time, rate => rate, work => work)
      end associate
      call c_f_pointer(data, state)
      x_values => values(x, state%system%n)
      v => values(vector, state%system%n)
      p => values(product, state%system%n)
      ! Products belong to the point that was evaluated last.
      if (any(abs(x_values - state%seen) > 0.0_wp)) then
         call state%system%residual(x_values, state%work)
         state%seen = x_values
         state%linearized = .false.
      end if
      if (.not. state%linearized) call state%system%linearize(n_linear)
      state%linearized = .true.
      call state%system%apply(v, p)
      p = -p
      call state%system%flow_solve(p)
      status = merge(callback_fatal, callback_ok, state%system%is_interrupted())
   end function multiply

   !> Callback: preconditioner for 1 + gamma P^-1 J.
   integer(c_int) function set_up(time, x, rate, as_before, renewed, gamma, data) bind(c, name='') &
      result(status)
      real(c_double), value :: time, gamma
      type(n_vector), intent(inout) :: x, rate
      integer(c_int), value :: as_before
      integer(c_int), intent(inout) :: renewed
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: x_values(:)
      logical :: done

      associate (time => time, rate => rate, as_before => as_before)
      end associate
      call c_f_pointer(data, state)
      x_values => values(x, state%system%n)
      state%gamma = gamma
      ! The shifted system is R + P (x - x_0)/gamma, whose derivative is wanted.
      call state%system%set_shift(gamma, x_values)
      call state%linear%prepare(state%system, x_values, state%work, done)
      call state%system%clear_shift()
      ! What the system knows of x belongs to the shift.
      state%seen = huge(1.0_wp)
      state%linearized = .false.
      ! Always: the derivative is that of this point.
      renewed = 1
      status = merge(callback_ok, callback_smaller, done)
   end function set_up

   !> Callback: (1 + gamma P^-1 J)^-1 right = (J + P/gamma)^-1 P right/gamma, about.
   integer(c_int) function precondition(time, x, rate, right, solution, gamma, accuracy, &
                                        side, data) &
      bind(c, name='') result(status)
      real(c_double), value :: time, gamma, accuracy
      type(n_vector), intent(inout) :: x, rate, right, solution
      integer(c_int), value :: side
      type(c_ptr), value :: data
      type(bdf_state), pointer :: state
      real(wp), pointer, contiguous :: z(:)

      associate (time => time, gamma => gamma, accuracy => accuracy, x => x, rate => rate, &
                 side => side)
      end associate
      call c_f_pointer(data, state)
      z => values(solution, state%system%n)
      call state%system%flow_product(values(right, state%system%n), z)
      z = z/state%gamma
      call state%linear%precondition(state%system, z)
      status = callback_ok
      if (.not. ieee_is_finite(norm2(z))) status = callback_fatal
   end function precondition

end module fw_pseudo_bdf
