!> Derivatives of a response by parameters of its case, at a converged motion q:
!>
!>   dQ/dp = Q_p + Q_q v,    J v = -R_p          (direct: one solution for each parameter)
!>   dQ/dp = Q_p - w . R_p,  J^T w = Q_q         (adjoint: one for each quantity)
!>
!> J is linearized whole, by a state of its own, so that the solution of other points is left alone.
!> One factorization, or one preconditioner, serves all solutions.
module fw_sensitivity
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_complex_form, only: coefficients_of
   use fw_error, only: error_type
   use fw_force_law, only: pair_open
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_parameter_slopes, only: parameter_entry, parameter_slope, slope_finder
   use fw_parameters, only: friction_coefficient
   use fw_recovery, only: observe
   use fw_response_rows, only: new_rows, response_row
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_krylov, linear_lu
   use fw_transposed_balance, only: pull_forces, transposed_balance
   implicit none (type, external)
   private

   public :: sensitivity_finder, by_counts, by_direct, by_adjoint, change_of
   ! For responses of given amplitude too.
   public :: follow, held_change, pull_row

   !> How derivatives are found: by whichever way takes fewer solutions, or by one of the two.
   integer, parameter :: by_counts = 0, by_direct = 1, by_adjoint = 2

   !> Relative residual asked of GMRES, and what a derivative may be left with.
   real(wp), parameter :: krylov_tolerance = 1.0e-12_wp, worst_residual = 1.0e-8_wp

   type :: sensitivity_finder
      type(parameter_entry), allocatable :: parameters(:)
      !> As in quantity_words.
      integer, allocatable :: quantities(:)
      !> Friction coefficients, and k_w [area/force] (n_pairs).
      real(wp), allocatable :: mu(:), wear_coefficient(:)
      !> Whether the volume is that coefficient times the energy, not times the energy over mu.
      logical :: wears_by_energy = .false.
      integer :: way = by_counts
      !> Unknowns above which GMRES solves (below 0: as many as is usual).
      integer :: lu_up_to = -1
      !> The rows of the last response, and their derivatives (row, parameter).
      type(response_row), allocatable :: rows(:)
      real(wp), allocatable :: derivative(:, :)
      !> Work so far.
      type(linear_step_type) :: linear
      integer :: n_direct = 0, n_adjoint = 0
      type(slope_finder), pointer, private :: slopes => null()
      type(balance_state), pointer, private :: state => null()
      !> Of the last motion; another one takes another state.
      type(balance_problem), pointer, private :: problem => null()
   contains
      procedure :: find
      procedure :: clear
      final :: release
   end type sensitivity_finder

contains

   !> Derivatives at the motion x of a system that has converged there; done is false where the
   !> derivative is singular, as at a fold.
   subroutine find(self, problem, system, x, done, error)
      class(sensitivity_finder), intent(inout) :: self
      type(balance_problem), intent(in), target :: problem
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      logical :: adjoint

      done = .false.
      call stand(self, problem, system, x, error)
      if (allocated(error)) return
      associate (state => self%state)
         call new_rows(state, x, self%quantities, self%mu, self%wear_coefficient, &
                       self%wears_by_energy, self%rows)
         self%linear%kind = merge(linear_lu, linear_krylov, state%n <= merge( &
            self%lu_up_to, sizes%lu_of_slopes, self%lu_up_to >= 0))
         self%linear%keeps = .false.
         ! The transposed problem takes the factors of the harmonics.
         state%nearly = .false.
         call self%linear%prepare(state, done)
         if (.not. done) return
         call self%slopes%prepare(state, x)
         if (allocated(self%derivative)) deallocate (self%derivative)
         allocate (self%derivative(size(self%rows), size(self%parameters)), source=0.0_wp)
         adjoint = (problem%structure%knows_field .or. problem%structure%pulls_observed()) .and. &
                   size(self%rows) < size(self%parameters)
         if (self%way /= by_counts) adjoint = self%way == by_adjoint
         if (adjoint) then
            call find_adjoint(self, state, done)
         else
            call find_direct(self, state, done)
         end if
      end associate
   end subroutine find

   !> Bring a state of its own to the motion.
   subroutine stand(self, problem, system, x, error)
      class(sensitivity_finder), intent(inout) :: self
      type(balance_problem), intent(in), target :: problem
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: r(size(x))

      if (associated(self%state) .and. .not. associated(self%problem, problem)) call self%clear()
      if (.not. associated(self%state)) then
         self%problem => problem
         allocate (self%state, self%slopes)
         call new_balance_state(problem, self%state)
         self%state%reduced = .false.
         call self%slopes%start(self%state)
      end if
      call self%state%like(system)
      call self%state%set_frequency(system%frequency(), error)
      if (allocated(error)) return
      call self%state%residual(x, r)
   end subroutine stand

   !> One solution for each parameter.
   subroutine find_direct(self, state, done)
      class(sensitivity_finder), intent(inout) :: self
      type(balance_state), intent(inout) :: state
      logical, intent(out) :: done
      type(parameter_slope) :: slope
      real(wp), allocatable :: v(:), product(:)
      integer :: k, p

      allocate (v(state%n), product(state%n))
      done = .true.
      do p = 1, size(self%parameters)
         call self%slopes%find(state, self%parameters(p), slope)
         associate (r => reshape(slope%residual, [state%n]))
            if (norm2(r) > 0.0_wp) then
               call self%linear%solve_prepared(state, r, krylov_tolerance, v, done)
               self%n_direct = self%n_direct + 1
            else
               v = 0.0_wp
            end if
            call state%apply(v, product)
            if (done) done = norm2(product + r) <= worst_residual*norm2(r)
            if (.not. done) return
         end associate
         call follow(state, self%slopes%at_rest, v, slope)
         do k = 1, size(self%rows)
            self%derivative(k, p) = change_of(state, self%rows(k), self%parameters(p), slope, v)
         end do
      end do
   end subroutine find_direct

   !> From changes at held coordinates to those with the coordinates moving by v, to which the
   !> derivative has just been applied.
   subroutine follow(state, at_rest, v, slope)
      type(balance_state), intent(inout) :: state
      !> Observed quantities where all coordinates rest.
      complex(wp), intent(in) :: at_rest(:, :)
      real(wp), intent(in), contiguous :: v(:)
      type(parameter_slope), intent(inout) :: slope
      complex(wp) :: moved(size(at_rest, 1), size(at_rest, 2))
      integer :: c, i, nc

      ! Affine in the coordinates: the loads' own part goes.
      call observe(state, v, moved)
      slope%observed = slope%observed + moved - at_rest
      nc = state%problem%fourier%n_coefficients
      associate (work => state%work(state%problem%forces%pairs))
         do i = 1, state%problem%n_pairs
            if (work%linear_state(i) == pair_open) cycle
            do c = 1, 3
               slope%force(i, c, :) = slope%force(i, c, :) + work%output((c - 1)*nc + 1:c*nc, i)
            end do
         end do
      end associate
   end subroutine follow

   !> Change of a quantity with everything that it is made of.
   real(wp) function change_of(state, row, parameter, slope, v) result(change)
      type(balance_state), intent(in) :: state
      type(response_row), intent(in) :: row
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(in) :: slope
      !> Change of the coordinates (n_coordinates * n_coefficients).
      real(wp), intent(in) :: v(:)
      real(wp), allocatable :: u(:, :, :)

      change = held_change(row, parameter, slope)
      if (.not. allocated(row%by_motion)) return
      allocate (u, mold=row%by_motion)
      associate (p => state%problem)
         call p%incidence%gather(p%forces%entry(p%forces%pairs)%rows, p%structure%n_coordinates, &
                                 p%fourier%n_coefficients, v, u)
      end associate
      change = change + sum(row%by_motion*u)
   end function change_of

   !> Change of a quantity by forces, observed quantities and the parameter itself.
   pure real(wp) function held_change(row, parameter, slope) result(change)
      type(response_row), intent(in) :: row
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(in) :: slope

      change = 0.0_wp
      if (allocated(row%by_observed)) change = sum(real(conjg(row%by_observed)*slope%observed, wp))
      if (allocated(row%by_force)) change = change + sum(row%by_force*slope%force)
      if (allocated(row%by_friction) .and. parameter%number == friction_coefficient) then
         change = change + row%by_friction(parameter%element)
      end if
   end function held_change

   !> One solution with the transpose for each quantity.
   subroutine find_adjoint(self, state, done)
      class(sensitivity_finder), intent(inout) :: self
      type(balance_state), intent(inout), target :: state
      logical, intent(out) :: done
      type(transposed_balance) :: transposed
      type(parameter_slope) :: slope
      real(wp), allocatable :: w(:, :), rhs(:), product(:)
      integer :: k, p

      allocate (w(state%n, size(self%rows)), rhs(state%n), product(state%n))
      transposed%state => state
      transposed%interrupt => state%interrupt
      do k = 1, size(self%rows)
         call pull_row(state, self%rows(k), rhs)
         call solve_adjoint(self, transposed, rhs, w(:, k))
         call transposed%apply(w(:, k), product)
         done = norm2(product - rhs) <= worst_residual*norm2(rhs)
         if (.not. done) return
      end do
      do p = 1, size(self%parameters)
         call self%slopes%find(state, self%parameters(p), slope)
         do k = 1, size(self%rows)
            self%derivative(k, p) = held_change(self%rows(k), self%parameters(p), slope) - &
                                    dot_product(w(:, k), reshape(slope%residual, [state%n]))
         end do
      end do
   end subroutine find_adjoint

   !> J^T w = rhs.
   subroutine solve_adjoint(self, transposed, rhs, w)
      class(sensitivity_finder), intent(inout) :: self
      type(transposed_balance), intent(inout) :: transposed
      real(wp), intent(in), contiguous :: rhs(:)
      real(wp), intent(out), contiguous :: w(:)
      logical :: unused

      w = 0.0_wp
      if (.not. norm2(rhs) > 0.0_wp) return
      self%n_adjoint = self%n_adjoint + 1
      if (self%linear%factored) then
         w = rhs
         call self%linear%lu%solve_transposed(w)
         return
      end if
      ! What it has reached is judged by the residual.
      call self%linear%gmres%solve(transposed, rhs, w, krylov_tolerance, unused)
      self%linear%krylov_iterations = self%linear%krylov_iterations + self%linear%gmres%iterations
   end subroutine solve_adjoint

   !> Slope of a row by the coordinates.
   subroutine pull_row(state, row, rhs)
      type(balance_state), intent(inout) :: state
      type(response_row), intent(in) :: row
      real(wp), intent(out), contiguous :: rhs(:)
      real(wp), allocatable :: slope(:, :)
      complex(wp), allocatable :: field(:, :), load(:, :)
      integer :: m

      associate (p => state%problem, s => state%problem%structure, f => state%problem%fourier)
         m = s%n_coordinates
         allocate (slope(m, f%n_coefficients), source=0.0_wp)
         if (allocated(row%by_observed)) then
            ! Symmetric: the transpose is the condensation itself, of the conjugate.
            allocate (load(m, f%n_retained))
            if (s%knows_field) then
               allocate (field(s%whole_size(), f%n_retained))
               call s%observe_back(conjg(row%by_observed), field)
               call s%condense_field(state%structure_state, field, load)
               load = conjg(load)
            else
               call s%pull_observed(state%structure_state, row%by_observed, load)
            end if
            call coefficients_of(f%harmonic, f%column, m, m, load, slope)
         end if
         if (allocated(row%by_force)) call pull_forces(state, row%by_force, slope)
         if (allocated(row%by_motion)) then
            call p%incidence%scatter(p%forces%entry(p%forces%pairs)%rows, m, f%n_coefficients, &
                                     1.0_wp, row%by_motion, slope)
         end if
      end associate
      rhs = reshape(slope, [size(rhs)])
   end subroutine pull_row

   !> Leave the problem, which need not live on.
   subroutine clear(self)
      class(sensitivity_finder), intent(inout) :: self

      if (associated(self%state)) deallocate (self%state)
      if (associated(self%slopes)) deallocate (self%slopes)
      nullify (self%state, self%slopes, self%problem)
   end subroutine clear

   subroutine release(self)
      type(sensitivity_finder), intent(inout) :: self

      call self%clear()
   end subroutine release

end module fw_sensitivity
