!> Newton-Krylov with a line search through KINSOL (SUNDIALS; Hindmarsh et al. 2005): SPGMR with
!> the system's product and its preconditioner from the right, accuracy of the linear solutions
!> after Eisenstat and Walker (1996).
module fw_kinsol
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_c_binding, only: c_associated, c_f_pointer, c_funloc, c_int, c_loc, &
      c_long, c_null_ptr, c_ptr
   use fkinsol_mod, only: fkincreate, fkinfree, fkingetnumliniters, fkingetnumnonlinsolviters, &
      fkininit, fkinseterrhandlerfn, fkinsetfuncnormtol, fkinsetjactimesvecfn, &
      fkinsetmaxnewtonstep, fkinsetmaxsetupcalls, fkinsetnummaxiters, fkinsetpreconditioner, &
      fkinsetscaledsteptol, fkinsetuserdata, fkinsol, kin_linesearch
   use fsundials_linearsolver_mod, only: fsunlinsolfree, sun_prec_right, sunlinearsolver
   use fsundials_nvector_mod, only: n_vector
   use fsunlinsol_spgmr_mod, only: fsunlinsol_spgmr, fsunlinsol_spgmrsetmaxrestarts
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_solver_options, only: solver_options
   use fw_sundials, only: callback_fatal, callback_ok, callback_smaller, close_context, &
      ignore_message, open_context, release, values, wrap
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: kinsol_solver

   type :: kinsol_solver
      type(solver_options) :: options
      !> Krylov iterations of the last solution.
      integer :: krylov_iterations = 0
   contains
      procedure :: solve
   end type kinsol_solver

   !> What the callbacks need: C pointers cannot point to a polymorphic object itself.
   type :: kinsol_state
      class(nonlinear_system), pointer :: system => null()
      real(wp) :: tolerance = 0.0_wp
      !> Smallest residual so far over the reference, and its point (n).
      real(wp) :: best = huge(1.0_wp)
      real(wp), allocatable :: best_x(:)
      !> The point that the system saw last, whether it is linearized there, and a residual to
      !> throw away.
      real(wp), allocatable :: seen(:), r(:)
      logical :: linearized = .false.
   end type kinsol_state

   !> The objects of SUNDIALS behind a solution.
   type :: kinsol_objects
      !> Null where nothing was made, so that `free` serves after any failure.
      type(c_ptr) :: context = c_null_ptr
      type(c_ptr) :: memory = c_null_ptr
      type(n_vector), pointer :: x => null()
      type(n_vector), pointer :: x_scale => null()
      type(n_vector), pointer :: r_scale => null()
      type(sunlinearsolver), pointer :: linear => null()
   contains
      procedure :: free
   end type kinsol_objects

   !> Length of a cycle of SPGMR and cycles after the first.
   integer(c_int), parameter :: krylov_length = 60, krylov_restarts = 5
   !> Shortest step, relative to the unknowns: the line search gives up below it.
   ! Far below what the tolerance of the residual asks for: it must not end a slow path.
   real(wp), parameter :: shortest_step = 1.0e-10_wp
   !> Longest step, times the size of the unknowns; generous, since that is a guess.
   real(wp), parameter :: longest_step = 1.0e4_wp

   !> The Fortran interface of this function cannot say that there is no matrix: it takes an
   !> object where C takes a null pointer. This is the function behind that interface.
   interface
      integer(c_int) function set_linear_solver(memory, solver, matrix) &
         bind(c, name='_wrap_FKINSetLinearSolver')
         import :: c_int, c_ptr
         type(c_ptr), value :: memory, solver, matrix
      end function set_linear_solver
   end interface

contains

   !> Solve from the guess in x; the best point found is left there. Every failure of KINSOL ends
   !> as a report that is not converged.
   subroutine solve(self, system, x, report)
      class(kinsol_solver), intent(inout) :: self
      class(nonlinear_system), intent(inout), target :: system
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(kinsol_state), target :: state
      logical :: reduced

      self%krylov_iterations = 0
      ! KINSOL's vectors have a fixed length, so all unknowns take part.
      reduced = system%reduced
      system%reduced = .false.
      state%system => system
      state%tolerance = self%options%tolerance
      state%best_x = x
      state%seen = x
      allocate (state%r(system%n))
      ! The guess may be the solution, and counts as the best so far.
      call look(state, x, state%r)
      ! No iterations would mean 200 to KINSOL.
      if (state%best > state%tolerance .and. state%best < huge(1.0_wp) .and. &
          self%options%max_iterations > 0) then
         call run(self, state, report%iterations)
      end if
      system%reduced = reduced

      ! The system is left at the point that is returned, and the verdict is not KINSOL's.
      x = state%best_x
      call system%residual(x, state%r)
      report%residual = norm2(state%r)/system%reference
      report%converged = report%residual <= self%options%tolerance
      report%interrupted = .not. report%converged .and. system%is_interrupted()
   end subroutine solve

   !> KINSOL over arrays of this solution; what it finds stays in the state.
   subroutine run(self, state, iterations)
      class(kinsol_solver), intent(inout) :: self
      type(kinsol_state), intent(inout), target :: state
      integer, intent(out) :: iterations
      type(kinsol_objects) :: objects
      real(wp), allocatable, target :: x(:), x_scale(:), r_scale(:)
      integer(c_long) :: count(1)
      integer(c_int) :: status
      logical :: done

      iterations = 0
      x = state%best_x
      ! Scaled unknowns and residuals are of the order of one, as the tests of KINSOL want them.
      allocate (x_scale(size(x)), source=1.0_wp/typical_size(state))
      allocate (r_scale(size(x)), source=1.0_wp/state%system%reference)
      call create(objects, x, x_scale, r_scale, done)
      if (done) call configure(self, objects, state, done)
      if (done) then
         ! The callback ends a converged run with a failure of its own: not to be believed.
         status = fkinsol(objects%memory, objects%x, kin_linesearch, objects%x_scale, &
                          objects%r_scale)
         if (fkingetnumnonlinsolviters(objects%memory, count) == 0) iterations = int(count(1))
         if (fkingetnumliniters(objects%memory, count) == 0) self%krylov_iterations = int(count(1))
      end if
      call objects%free()
   end subroutine run

   !> Root mean square of the unknowns, or of a first step where that is the larger: the guess
   !> may be zero.
   real(wp) function typical_size(state) result(size)
      type(kinsol_state), intent(inout) :: state
      logical :: done

      call linearize_at(state, state%best_x, done)
      size = 0.0_wp
      if (done) then
         call state%system%build_preconditioner()
         ! The step of the linear joint from here has the size of the answer.
         call state%system%precondition(state%r)
         size = norm2(state%r)
      end if
      if (.not. ieee_is_finite(size)) size = 0.0_wp
      size = max(size, norm2(state%best_x))/sqrt(real(state%system%n, wp))
      ! Also where it is NaN.
      if (.not. size > 0.0_wp) size = 1.0_wp
   end function typical_size

   !> Objects over arrays of the caller, which stay his; `done` is false without memory, and what
   !> was made until then is freed by `free`.
   subroutine create(objects, x, x_scale, r_scale, done)
      type(kinsol_objects), intent(inout) :: objects
      real(wp), intent(inout), contiguous, target :: x(:), x_scale(:), r_scale(:)
      logical, intent(out) :: done

      call open_context(objects%context, done)
      if (.not. done) return
      objects%x => wrap(x, objects%context)
      objects%x_scale => wrap(x_scale, objects%context)
      objects%r_scale => wrap(r_scale, objects%context)
      done = associated(objects%x) .and. associated(objects%x_scale) .and. &
             associated(objects%r_scale)
      if (.not. done) return
      objects%memory = fkincreate(objects%context)
      objects%linear => fsunlinsol_spgmr(objects%x, sun_prec_right, krylov_length, objects%context)
      done = c_associated(objects%memory) .and. associated(objects%linear)
   end subroutine create

   !> Each status is looked at once all are set: none of the calls depends on another one.
   subroutine configure(self, objects, state, done)
      class(kinsol_solver), intent(in) :: self
      type(kinsol_objects), intent(inout) :: objects
      type(kinsol_state), intent(inout), target :: state
      logical, intent(out) :: done
      real(wp) :: root_n
      integer(c_int) :: status(11)

      root_n = sqrt(real(state%system%n, wp))
      associate (memory => objects%memory)
         status(1) = fkinseterrhandlerfn(memory, c_funloc(ignore_message), c_null_ptr)
         status(2) = fkininit(memory, c_funloc(evaluate), objects%x)
         status(3) = fkinsetuserdata(memory, c_loc(state))
         status(4) = set_linear_solver(memory, c_loc(objects%linear), c_null_ptr)
         status(5) = fkinsetjactimesvecfn(memory, c_funloc(multiply))
         status(6) = fkinsetpreconditioner(memory, c_funloc(set_up), c_funloc(precondition))
         status(7) = fkinsetnummaxiters(memory, int(self%options%max_iterations, c_long))
         ! Its test is on the largest component. The callback tests the norm itself.
         status(8) = fkinsetfuncnormtol(memory, self%options%tolerance/root_n)
         status(9) = fkinsetscaledsteptol(memory, shortest_step)
         status(10) = fkinsetmaxnewtonstep(memory, longest_step*root_n)
         ! The preconditioner is built anew in every step: an old one costs more iterations than it
         ! saves.
         status(11) = fkinsetmaxsetupcalls(memory, 1_c_long)
      end associate
      done = all(status == 0)
      if (done) done = fsunlinsol_spgmrsetmaxrestarts(objects%linear, krylov_restarts) == 0
   end subroutine configure

   !> The solver before what it refers to.
   subroutine free(self)
      class(kinsol_objects), intent(inout) :: self
      integer(c_int) :: status

      if (c_associated(self%memory)) call fkinfree(self%memory)
      self%memory = c_null_ptr
      if (associated(self%linear)) status = fsunlinsolfree(self%linear)
      nullify (self%linear)
      call release(self%x)
      call release(self%x_scale)
      call release(self%r_scale)
      call close_context(self%context)
   end subroutine free

   !> Residual at a point, remembered where it is the best so far.
   subroutine look(state, x, r)
      type(kinsol_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(inout), contiguous :: r(:)
      real(wp) :: norm

      call state%system%residual(x, r)
      state%seen = x
      state%linearized = .false.
      norm = norm2(r)/state%system%reference
      if (ieee_is_finite(norm) .and. norm < state%best) then
         state%best = norm
         state%best_x = x
      end if
   end subroutine look

   !> The line search may have left the system at another point.
   subroutine linearize_at(state, x, done)
      type(kinsol_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      logical, intent(out) :: done
      integer :: n_linear

      done = .true.
      if (any(abs(x - state%seen) > 0.0_wp)) call look(state, x, state%r)
      if (state%linearized) return
      call state%system%linearize(n_linear)
      done = n_linear == state%system%n
      state%linearized = done
   end subroutine linearize_at

   !> Callback: residual.
   integer(c_int) function evaluate(x, r, data) bind(c, name='') result(status)
      type(n_vector), intent(inout) :: x, r
      type(c_ptr), value :: data
      type(kinsol_state), pointer :: state
      real(wp), pointer, contiguous :: x_values(:), r_values(:)

      call c_f_pointer(data, state)
      x_values => values(x, state%system%n)
      r_values => values(r, state%system%n)
      call look(state, x_values, r_values)
      status = callback_ok
      ! The line search shortens a step into nowhere; at the solution nothing more is wanted.
      if (.not. ieee_is_finite(norm2(r_values))) status = callback_smaller
      if (state%best <= state%tolerance .or. state%system%is_interrupted()) status = callback_fatal
   end function evaluate

   !> Callback: Jacobian times vector.
   integer(c_int) function multiply(vector, product, x, new_x, data) bind(c, name='') result(status)
      type(n_vector), intent(inout) :: vector, product, x
      integer(c_int), intent(inout) :: new_x
      type(c_ptr), value :: data
      type(kinsol_state), pointer :: state
      real(wp), pointer, contiguous :: v(:), p(:)
      logical :: done

      call c_f_pointer(data, state)
      call linearize_at(state, values(x, state%system%n), done)
      ! Zero tells KINSOL that the product has taken note of a new point.
      new_x = 0
      status = callback_fatal
      if (.not. done) return
      v => values(vector, state%system%n)
      p => values(product, state%system%n)
      call state%system%apply(v, p)
      if (.not. state%system%is_interrupted()) status = callback_ok
   end function multiply

   !> Callback: build the preconditioner.
   integer(c_int) function set_up(x, x_scale, r, r_scale, data) bind(c, name='') result(status)
      type(n_vector), intent(inout) :: x, x_scale, r, r_scale
      type(c_ptr), value :: data
      type(kinsol_state), pointer :: state
      logical :: done

      associate (x_scale => x_scale, r => r, r_scale => r_scale)
      end associate
      call c_f_pointer(data, state)
      call linearize_at(state, values(x, state%system%n), done)
      status = callback_fatal
      if (.not. done) return
      call state%system%build_preconditioner()
      status = callback_ok
   end function set_up

   !> Callback: apply the preconditioner.
   integer(c_int) function precondition(x, x_scale, r, r_scale, vector, data) bind(c, name='') &
      result(status)
      type(n_vector), intent(inout) :: x, x_scale, r, r_scale, vector
      type(c_ptr), value :: data
      type(kinsol_state), pointer :: state
      real(wp), pointer, contiguous :: v(:)

      associate (x => x, x_scale => x_scale, r => r, r_scale => r_scale)
      end associate
      call c_f_pointer(data, state)
      v => values(vector, state%system%n)
      call state%system%precondition(v)
      status = callback_ok
      if (.not. ieee_is_finite(norm2(v))) status = callback_fatal
   end function precondition

end module fw_kinsol
