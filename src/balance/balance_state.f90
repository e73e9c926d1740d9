!> Harmonic balance with alternating frequency/time:
!>
!>   R(q) = Z_r q + sum over laws of B^T lambda(y) - F_r,
!>
!> with the prediction of each law, of the order that it declares,
!>
!>   y = k (B (d/dtau)**order q + gap),
!>   y = k (B (d/dtau)**order q + gap) + F_r - Z_r q - sum over those above   (takes the balance).
!>
!> Unknowns are (coordinate, coefficient), coordinates innermost.
module fw_balance_state
   use fw_kinds, only: i8, wp
   use fw_error, only: error_type
   use fw_active_set, only: active_set, element_list
   use fw_balance_problem, only: balance_problem
   use fw_balance_scratch, only: balance_scratch
   use fw_force_law, only: force_workspace, prediction_type
   use fw_force_list, only: force_entry
   use fw_fourier, only: to_real
   use fw_input_rates, only: take_inertias, take_means, take_rates
   use fw_kept_factors, only: kept_factors
   use fw_near_derivative, only: near_derivative
   use fw_parameter_system, only: parameter_system
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_size_options, only: sizes
   use fw_structure_operator, only: structure_state
   use fw_threads, only: coordinates_for_threads, watch_team
   implicit none (type, external)
   private

   public :: balance_state, new_balance_state, parameter_mover, moving_parameter

   !> A parameter of the problem that a path follows, in place of the frequency.
   type, abstract :: parameter_mover
   contains
      procedure(apply_value), deferred :: apply
      procedure(derive_by_value), deferred :: derive
   end type parameter_mover

   !> One that moves, where there is one, and its value.
   type :: moving_parameter
      class(parameter_mover), allocatable :: mover
      real(wp) :: value = 0.0_wp
   end type moving_parameter

   !> A problem where one worker stands.
   type, extends(parameter_system) :: balance_state
      !> Only read; it has to live as long as the state.
      type(balance_problem), pointer :: problem => null()
      class(structure_state), allocatable :: structure_state
      !> What evaluations of the laws leave (n_laws).
      type(force_workspace), allocatable :: work(:)
      !> Wear depth of the pairs (n_pairs) [length].
      real(wp), allocatable :: depth(:)
      !> F - Z q less the forces that do not take the balance, and the loads (n_coordinates,
      !> n_coefficients).
      real(wp), allocatable :: balance(:, :), load(:, :)
      !> Share of the vibratory load that acts; below 1 only on the way to a first solution.
      real(wp) :: load_share = 1.0_wp
      !> The parameter that `set_parameter` moves, and its value; the frequency where none is given.
      !> The problem belongs to one state then, or to several that stand at one value.
      type(moving_parameter) :: moved
      !> Of a response whose load is what `set_parameter` moves: the parameter that it goes along
      !> (`set_place`); the frequency where none is given.
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(moving_parameter), allocatable :: along
      !> What a step of pseudo-time adds to the derivative, P/h, outside of the contact laws
      !> (n_coordinates, n_coordinates, n_retained); only allocated during such a step.
      complex(wp), allocatable :: shift(:, :, :)
      !> Let normal components that always bear leave the linear problem.
      logical :: pins_normals = .true.
      !> Who changes the derivatives of laws after `linearize` marks them by a number: factors of
      !> other numbers do not fit. 0: as the laws left them.
      real(wp), private :: alteration = 0.0_wp
      !> Whether the inputs of the laws are displacements alone, the same in all harmonics.
      logical, private :: has_static_laws = .false.
      !> Whether the structure is nearly one at rest and a low rank.
      logical, private :: has_split = .false.
      !> Whether near products take the derivatives of the laws in single precision.
      logical, private :: has_large_blocks = .false.
      !> Whether the blocks Z_n of all harmonics are one, and the frequency and the value of the
      !> parameter where they were compared.
      logical, private :: is_alike = .false.
      real(wp), private :: compared_at(2) = -huge(1.0_wp)
      !> The linear problem of a step, see fw_balance_linear.
      type(active_set) :: active
      !> Elements of each law whose forces reach that problem (n_laws).
      type(element_list), allocatable, private :: acting(:)
      type(kept_factors) :: preconditioner
      !> Derivatives of the laws for products that only have to be near (n_laws).
      type(near_derivative), allocatable, private :: near(:)
      type(balance_scratch) :: scratch
      !> Goes up with every residual and frequency: who kept a residual knows by it whether the
      !> state still stands there. Depths, factors of the loads, and where marches start may be set
      !> without it.
      integer(i8), private :: n_moves = 0_i8
   contains
      procedure :: set_parameter
      procedure :: set_place
      procedure :: goes_along
      procedure :: set_frequency
      procedure :: set_load_factors
      procedure :: load_factor
      procedure :: renew_structure
      procedure :: renew_workspaces
      procedure :: parameter
      procedure :: follow
      procedure :: like
      procedure :: set_point
      procedure :: frequency
      procedure :: parameter_derivative
      procedure :: derivative_by
      procedure :: derivative_by_loads
      procedure :: rate_unit
      procedure :: pair_states
      procedure :: pair_shares
      procedure :: n_turns
      procedure :: moves
      procedure :: residual
      procedure :: heed
      procedure :: linearize
      procedure :: form_jacobians
      procedure :: take_near
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: fill_harmonic
      procedure :: preconditioner_fits
      procedure :: precondition
      procedure :: precondition_columns
      procedure :: strengthen_preconditioner => take_whole
      procedure :: splits
      procedure :: assemble
   end type balance_state

   abstract interface
      !> Change the problem of a state, and the state itself; the frequency is set behind it. An
      !> error is a value that the problem cannot be brought to.
      subroutine apply_value(self, state, value, error)
         import :: parameter_mover, balance_state, wp, error_type
         implicit none (type, external)
         class(parameter_mover), intent(inout) :: self
         class(balance_state), intent(inout) :: state
         real(wp), intent(in) :: value
         type(error_type), allocatable, intent(out) :: error
      end subroutine apply_value

      !> dR/dvalue at the last evaluated and linearized point x, and what it makes of observed
      !> quantities while the coordinates stay (n_observed, n_retained).
      subroutine derive_by_value(self, state, value, x, dr, observed)
         import :: parameter_mover, balance_state, wp
         implicit none (type, external)
         class(parameter_mover), intent(in) :: self
         class(balance_state), intent(inout) :: state
         real(wp), intent(in) :: value
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
         complex(wp), intent(out), optional :: observed(:, :)
      end subroutine derive_by_value
   end interface

   ! The linear problem of a Newton step (fw_balance_linear, fw_balance_matrix), and derivatives by
   ! what is not an unknown (fw_balance_slopes).
   interface
      module subroutine linearize(self, n_linear)
         class(balance_state), intent(inout) :: self
         integer, intent(out) :: n_linear
      end subroutine linearize

      !> Take over the derivative of a law for near products, where there are any: part of
      !> `linearize`, and for who changes what that has left in the workspace of the law, marked by
      !> a number (`alteration`).
      module subroutine take_near(self, law, alteration)
         class(balance_state), intent(inout) :: self
         !> Its number.
         integer, intent(in) :: law
         real(wp), intent(in), optional :: alteration
      end subroutine take_near

      module subroutine reduce(self, r, rhs)
         class(balance_state), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:)
         real(wp), intent(out), contiguous :: rhs(:)
      end subroutine reduce

      module subroutine expand(self, r, solution, step)
         class(balance_state), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:), solution(:)
         real(wp), intent(out), contiguous :: step(:)
      end subroutine expand

      module subroutine parameter_derivative(self, x, dr)
         class(balance_state), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine parameter_derivative

      !> dR/dp, p being by_frequency or by_self_excitation (fw_structure_operator), at the last
      !> evaluated and linearized point x.
      module subroutine derivative_by(self, parameter, x, dr)
         class(balance_state), intent(inout) :: self
         integer, intent(in) :: parameter
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine derivative_by

      !> dR by the loads of the model where these change by their `static` and `vibratory` parts, at
      !> the last evaluated and linearized point.
      module subroutine derivative_by_loads(self, static, vibratory, dr)
         class(balance_state), intent(inout) :: self
         real(wp), intent(in) :: static, vibratory
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine derivative_by_loads

      module subroutine apply(self, vector, product)
         class(balance_state), intent(inout) :: self
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine apply

      module subroutine assemble(self, matrix)
         class(balance_state), intent(inout) :: self
         real(wp), intent(inout), contiguous :: matrix(:, :)
      end subroutine assemble

      !> complex_in = complex form of a vector of the active coordinates.
      module subroutine active_to_complex(self, na, vector)
         type(balance_state), intent(inout) :: self
         integer, intent(in) :: na
         real(wp), intent(in) :: vector(na, *)
      end subroutine active_to_complex
   end interface

   ! Its preconditioner (fw_balance_preconditioner), by waves where equal sectors are told apart
   ! (fw_balance_waves).
   interface
      !> Factors for each harmonic and nodal diameter.
      module subroutine build_waves(self)
         class(balance_state), intent(inout) :: self
      end subroutine build_waves

      !> Solve with them, in scratch%complex_in of the active coordinates.
      module subroutine solve_waves(self, h)
         type(balance_state), intent(inout) :: self
         integer, intent(in) :: h
      end subroutine solve_waves

      !> Mean over cosine and sine of a block of a transposed derivative, as a complex factor.
      pure module function mean_block(block, harmonic, input, output) result(mean)
         real(wp), intent(in) :: block(:, :)
         integer, intent(in) :: harmonic
         !> Columns of the cosine coefficient in the input and the output.
         integer, intent(in) :: input, output
         complex(wp) :: mean
      end function mean_block

      module subroutine build_preconditioner(self)
         class(balance_state), intent(inout) :: self
      end subroutine build_preconditioner

      !> The matrix of one harmonic, not factored, with room for rows and columns behind it.
      module subroutine fill_harmonic(self, h, n_more, factors)
         class(balance_state), intent(in) :: self
         integer, intent(in) :: h, n_more
         type(preconditioner_lu_type), intent(inout) :: factors
      end subroutine fill_harmonic

      !> Find the active coordinates in the preconditioner from before.
      module subroutine place_kept(self)
         type(balance_state), intent(inout) :: self
      end subroutine place_kept

      !> From waves to matrices of all sectors, where these are not too large.
      module subroutine take_whole(self, is_stronger)
         class(balance_state), intent(inout) :: self
         logical, intent(out) :: is_stronger
      end subroutine take_whole

      pure module logical function preconditioner_fits(self)
         class(balance_state), intent(in) :: self
      end function preconditioner_fits

      module subroutine precondition(self, vector)
         class(balance_state), intent(inout) :: self
         real(wp), intent(inout), contiguous :: vector(:)
      end subroutine precondition

      module subroutine precondition_columns(self, columns)
         class(balance_state), intent(inout) :: self
         real(wp), intent(inout), contiguous :: columns(:, :)
      end subroutine precondition_columns
   end interface

contains

   !> A state of a problem; set_frequency comes before the first residual.
   subroutine new_balance_state(problem, self, stand)
      !> Not to be moved from now on.
      type(balance_problem), intent(in), target :: problem
      type(balance_state), intent(out) :: self
      !> Where the structure stands; moved into the state, made anew where it is not given.
      class(structure_state), allocatable, intent(inout), optional :: stand
      integer :: m, nc

      self%problem => problem
      if (present(stand)) then
         call move_alloc(stand, self%structure_state)
      else
         call problem%structure%new_state(self%structure_state)
      end if
      m = problem%structure%n_coordinates
      nc = problem%fourier%n_coefficients
      self%n = problem%n
      self%reduced = problem%reduced
      self%depth = problem%depth
      call problem%forces%reserve(problem%fourier, self%work)
      allocate (self%balance(m, nc), self%load(m, nc), source=0.0_wp)
      call self%active%reserve(m)
      call self%preconditioner%reserve(m, problem%fourier%n_retained)
      self%has_static_laws = all_are_static(problem)
      self%has_split = problem%structure%split_rank() > 0 .and. self%has_static_laws
      allocate (self%near(problem%forces%n_laws), self%acting(problem%forces%n_laws))
      self%has_large_blocks = blocks_are_large(problem)
      self%nearly = offers_nearly(self)
      if (problem%structure%n_alike > 1) call self%preconditioner%around%reserve( &
         problem%structure%n_slots, problem%structure%n_alike, problem%fourier%n_retained)
      call self%scratch%reserve(m, problem%fourier%n_retained, nc)
   end subroutine new_balance_state

   !> The blocks of laws that `linearize` has left to whoever reads them.
   subroutine form_jacobians(self)
      class(balance_state), intent(inout) :: self
      integer :: k

      do k = 1, self%problem%forces%n_laws
         if (.not. self%work(k)%waits) cycle
         call self%problem%forces%entry(k)%law%form_jacobian(self%problem%fourier, self%work(k))
      end do
   end subroutine form_jacobians

   !> Whether any part of a step has a form that is nearly right and cheaper.
   pure logical function offers_nearly(self)
      type(balance_state), intent(in) :: self

      offers_nearly = self%has_split .or. self%has_large_blocks .or. &
                      self%problem%structure%has_near_product()
   end function offers_nearly

   !> Whether near products and the preconditioner take the structure for one of low rank.
   pure logical function splits(self)
      class(balance_state), intent(in) :: self

      splits = self%nearly .and. self%has_split
   end function splits

   !> Whether the derivatives of the laws are larger than what processors keep at hand.
   pure logical function blocks_are_large(problem)
      type(balance_problem), intent(in) :: problem
      ! Of thousands of pairs more than an integer holds.
      real(wp) :: n_numbers
      integer :: k

      n_numbers = 0.0_wp
      do k = 1, problem%forces%n_laws
         associate (law => problem%forces%entry(k)%law)
            n_numbers = n_numbers + real(law%n_elements, wp)* &
                        real(law%n_components*problem%fourier%n_coefficients, wp)**2
         end associate
      end do
      blocks_are_large = n_numbers >= real(sizes%single_blocks, wp)
   end function blocks_are_large

   !> Bring the problem to a value of the parameter that moves, at the present frequency, or to a
   !> frequency where none does.
   subroutine set_parameter(self, parameter, error)
      class(balance_state), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      if (.not. allocated(self%moved%mover)) then
         call self%set_point(parameter, 0.0_wp, error)
         return
      end if
      call move(self, self%moved, parameter, error)
      if (allocated(error)) return
      call self%set_point(self%frequency(), 0.0_wp, error)
   end subroutine set_parameter

   !> Bring the problem to a place on the path of a response whose load is found: a frequency, or a
   !> value of the parameter that it goes along.
   subroutine set_place(self, place, error)
      class(balance_state), intent(inout) :: self
      real(wp), intent(in) :: place
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%goes_along()) then
         call self%set_frequency(place, error)
         return
      end if
      call move(self, self%along, place, error)
      if (allocated(error)) return
      call self%set_point(self%frequency(), 0.0_wp, error)
   end subroutine set_place

   !> Whether the path of a response whose load is found goes over a parameter.
   pure logical function goes_along(self)
      class(balance_state), intent(in) :: self

      goes_along = .false.
      if (allocated(self%along)) goes_along = allocated(self%along%mover)
   end function goes_along

   !> Let a mover do it, which is no part of the state meanwhile.
   subroutine move(self, parameter, value, error)
      class(balance_state), intent(inout) :: self
      type(moving_parameter), intent(inout) :: parameter
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error
      class(parameter_mover), allocatable :: mover

      call move_alloc(parameter%mover, mover)
      call mover%apply(self, value, error)
      call move_alloc(mover, parameter%mover)
      if (.not. allocated(error)) parameter%value = value
   end subroutine move

   !> Where `set_parameter` has brought it.
   pure real(wp) function parameter(self)
      class(balance_state), intent(in) :: self

      parameter = self%frequency()
      if (allocated(self%moved%mover)) parameter = self%moved%value
   end function parameter

   !> Be like another state of the case where it stands: its frequency, its value of the parameter.
   subroutine follow(self, other, error)
      class(balance_state), intent(inout) :: self
      class(balance_state), intent(in) :: other
      type(error_type), allocatable, intent(out) :: error

      if (self%goes_along() .and. other%goes_along()) then
         call move(self, self%along, other%along%value, error)
         if (allocated(error)) return
      end if
      if (allocated(self%moved%mover) .and. allocated(other%moved%mover)) then
         call move(self, self%moved, other%moved%value, error)
         if (allocated(error)) return
      end if
      if (self%problem%origin%borrows_laws) call take_stiffness(self, other%problem)
      call self%like(other)
      call self%set_frequency(other%frequency(), error)
   end subroutine follow

   !> What another state of the case has beside its place: depths, where the march starts, what may
   !> end the work, and of the same problem the factors of its loads.
   subroutine like(self, other)
      class(balance_state), intent(inout) :: self
      class(balance_state), intent(in) :: other
      integer :: k

      if (associated(self%problem, other%problem)) then
         self%structure_state%load_factor = other%structure_state%load_factor
         call self%structure_state%scale_loads()
      end if
      self%interrupt => other%interrupt
      self%depth = other%depth
      do k = 1, size(self%work)
         if (allocated(other%work(k)%x_start)) self%work(k)%x_start = other%work(k)%x_start
      end do
   end subroutine like

   !> Rigid laws of another problem of the case: one and the same law has one eps.
   subroutine take_stiffness(self, other)
      class(balance_state), intent(inout) :: self
      type(balance_problem), intent(in) :: other
      integer :: k

      do k = 1, self%problem%forces%n_laws
         associate (own => self%problem%forces%entry(k)%law%prediction, &
                    given => other%forces%entry(k)%law%prediction)
            if (.not. given%takes_balance) cycle
            call own%take_eps(given)
         end associate
         call self%problem%forces%entry(k)%law%take_prediction()
      end do
      call self%renew_workspaces()
   end subroutine take_stiffness

   !> The structure of the problem has changed: the state stands where it stood, under its loads.
   subroutine renew_structure(self, error)
      class(balance_state), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      class(structure_state), allocatable :: before

      call move_alloc(self%structure_state, before)
      call self%problem%structure%new_state(self%structure_state)
      self%structure_state%load_factor = before%load_factor
      self%has_split = self%problem%structure%split_rank() > 0 .and. self%has_static_laws
      self%nearly = offers_nearly(self)
      self%compared_at = -huge(1.0_wp)
      if (before%omega < 0.0_wp) return
      call self%problem%structure%at(self%structure_state, before%omega, before%self_excitation, &
                                     error)
   end subroutine renew_structure

   !> Laws of the problem have other constants, which workspaces hold; where the march starts
   !> stays.
   subroutine renew_workspaces(self)
      class(balance_state), intent(inout) :: self
      type(force_workspace), allocatable :: work(:)
      integer :: k

      call self%problem%forces%reserve(self%problem%fourier, work)
      do k = 1, size(work)
         if (allocated(self%work(k)%x_start)) work(k)%x_start = self%work(k)%x_start
      end do
      call move_alloc(work, self%work)
   end subroutine renew_workspaces

   !> Factors of the static and of the vibratory loads of the model.
   subroutine set_load_factors(self, static, vibratory)
      class(balance_state), intent(inout) :: self
      real(wp), intent(in) :: static, vibratory

      self%structure_state%load_factor = &
         merge(static, vibratory, self%problem%fourier%harmonic == 0)
      call self%structure_state%scale_loads()
   end subroutine set_load_factors

   !> The factor of the vibratory loads, or of the static ones: 1 where none are in the balance.
   pure real(wp) function load_factor(self, static) result(factor)
      class(balance_state), intent(in) :: self
      logical, intent(in) :: static
      integer :: h

      factor = 1.0_wp
      h = findloc((self%problem%fourier%harmonic == 0) .eqv. static, .true., dim=1)
      if (h > 0) factor = self%structure_state%load_factor(h)
   end function load_factor

   !> Whether the derivatives of all laws are alike in all harmonics: functions of displacements.
   pure logical function all_are_static(problem)
      type(balance_problem), intent(in) :: problem
      integer :: k

      all_are_static = .true.
      do k = 1, problem%forces%n_laws
         associate (p => problem%forces%entry(k)%law%prediction)
            all_are_static = all_are_static .and. all(p%order == 0) .and. .not. p%has_inertia
         end associate
      end do
   end function all_are_static

   !> Bring matrices and loads to a frequency.
   subroutine set_frequency(self, parameter, error)
      class(balance_state), intent(inout) :: self
      !> Angular frequency [rad/s].
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%set_point(parameter, 0.0_wp, error)
   end subroutine set_frequency

   !> The same with a self-excitation in proportion to mass, as of a mode.
   subroutine set_point(self, omega, self_excitation, error)
      class(balance_state), intent(inout) :: self
      !> [rad/s]
      real(wp), intent(in) :: omega, self_excitation
      type(error_type), allocatable, intent(out) :: error

      self%n_moves = self%n_moves + 1_i8
      call self%problem%structure%at(self%structure_state, omega, self_excitation, error)
      if (allocated(error)) return
      call to_real(self%problem%fourier, self%problem%structure%n_coordinates, &
                   self%structure_state%load, &
                   self%load)
      self%reference = load_norm(self)
      if (self%problem%fourier%has_constant()) then
         ! The static load acts in full: only the vibration is brought on by steps.
         self%load(:, 2:) = self%load_share*self%load(:, 2:)
      else
         self%load = self%load_share*self%load
      end if
   end subroutine set_point

   !> Present angular frequency [rad/s].
   pure real(wp) function frequency(self)
      class(balance_state), intent(in) :: self

      frequency = self%structure_state%omega
   end function frequency

   !> States of the pairs at the last point: pair_stuck, pair_open or pair_mixed.
   pure function pair_states(self) result(states)
      class(balance_state), intent(in) :: self
      integer :: states(self%problem%n_pairs)

      states = self%work(self%problem%forces%pairs)%state
   end function pair_states

   !> Shares of the period in stick, slip and open at the last point (3, n_pairs).
   pure subroutine pair_shares(self, share)
      class(balance_state), intent(in) :: self
      real(wp), intent(out) :: share(:, :)

      associate (pairs => self%problem%forces%pairs)
         call self%problem%forces%entry(pairs)%law%fractions(self%work(pairs), share)
      end associate
   end subroutine pair_shares

   !> Residuals and frequencies so far.
   pure integer(i8) function moves(self)
      class(balance_state), intent(in) :: self

      moves = self%n_moves
   end function moves

   !> Turns of the march that all pairs took together at the last point.
   pure integer function n_turns(self)
      class(balance_state), intent(in) :: self

      n_turns = sum(self%work(self%problem%forces%pairs)%turns)
   end function n_turns

   !> The norm to which residuals are compared: that of the vibratory load. A large static load
   !> must not hide the vibration, but its round-off must not forbid convergence either.
   real(wp) function load_norm(self)
      type(balance_state), intent(in) :: self
      real(wp), parameter :: static_share = 1.0e-5_wp
      !> Of the load on the structure: what does not reach the joint but as round-off, amplified by
      !> a resonance, and what such round-off is compared to.
      real(wp), parameter :: round_off = 1.0e-13_wp, idle_share = 1.0e-5_wp
      real(wp) :: static

      static = 0.0_wp
      load_norm = norm2(self%load)
      if (self%problem%fourier%has_constant()) then
         load_norm = norm2(self%load(:, 2:))
         ! What a fit presses together acts like a static load, even where no load moves the joint.
         static = norm2(self%load(:, 1)) + press_of(self)
      end if
      ! As does an obstacle that swings, even where its harmonics are the only ones.
      static = static + swing_of(self)
      load_norm = max(load_norm, static_share*static)
      if (load_norm <= round_off*self%problem%load_size) then
         load_norm = idle_share*self%problem%load_size
      end if
      ! Where nothing loads the joint: what its pairs are pressed by, or pressed together by.
      if (load_norm <= 0.0_wp) then
         associate (p => self%problem%forces%entry(self%problem%forces%pairs)%law%prediction)
            load_norm = norm2(p%load) + norm2(p%stiffness(:, 3)*p%gap) + swing_of(self)
         end associate
      end if
      if (load_norm <= 0.0_wp) load_norm = 1.0_wp
   end function load_norm

   !> Forces that interferences would have where nothing gave way.
   real(wp) function press_of(self)
      type(balance_state), intent(in) :: self

      press_of = 0.0_wp
      if (size(self%depth) == 0) return
      associate (p => self%problem%forces%entry(self%problem%forces%pairs)%law%prediction)
         press_of = norm2(p%stiffness(:, 3)*min(p%gap, 0.0_wp))
      end associate
   end function press_of

   !> Forces that the swings of gaps would have where nothing gave way.
   real(wp) function swing_of(self)
      type(balance_state), intent(in) :: self

      swing_of = 0.0_wp
      if (size(self%depth) == 0) return
      associate (p => self%problem%forces%entry(self%problem%forces%pairs)%law%prediction)
         if (allocated(p%gap_motion)) swing_of = norm2(p%stiffness(:, 3)*p%gap_swing())
      end associate
   end function swing_of

   !> R(x); see the module header.
   subroutine residual(self, x, r)
      class(balance_state), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: k, m, nc

      m = self%problem%structure%n_coordinates
      nc = self%problem%fourier%n_coefficients
      self%n_moves = self%n_moves + 1_i8
      if (m == 0) return
      call watch_team(m)
      call multiply_stiffness(self, m, nc, x)
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k), work => self%work(k))
            work%rate = self%frequency()
            call predict(self, entry, m, nc, x, work)
            if (k == self%problem%forces%pairs) call entry%law%set_offset(self%depth, work)
            ! Forces without the balance come before those with it, which take what is left.
            if (entry%law%prediction%some_are_free()) then
               call entry%law%evaluate_free(self%problem%fourier, work)
               call self%problem%incidence%scatter(entry%free_rows, m, nc, -1.0_wp, work%force, &
                                                   self%balance)
               if (work%failed > 0) call self%heed(k)
            end if
            if (entry%law%prediction%takes_balance) then
               call add_balance(self, entry, work%prediction)
               call entry%law%evaluate_rigid(self%problem%fourier, work)
            end if
         end associate
      end do
      call collect(self, m, nc, r)
   end subroutine residual

   !> A law that has asked for the end of the run has it, and says why.
   subroutine heed(self, number)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: number

      if (.not. associated(self%interrupt)) return
      if (self%interrupt%demand /= '') return
      self%interrupt%stop_requested = .true.
      call self%problem%forces%entry(number)%law%complaint(self%work(number), &
                                                           self%interrupt%demand)
   end subroutine heed

   !> balance = F - Z q.
   subroutine multiply_stiffness(self, m, nc, q)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)

      call self%problem%structure%multiply(self%structure_state, q, self%balance)
      self%balance = self%load - self%balance
   end subroutine multiply_stiffness

   !> Predicted inputs of a law, without the balance.
   subroutine predict(self, entry, m, nc, q, work)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      type(force_workspace), intent(inout) :: work
      integer :: j

      associate (p => entry%law%prediction, y => work%prediction)
         call self%problem%incidence%gather(entry%rows, m, nc, q, y)
         call p%move_gaps(self%problem%fourier, y)
         do j = 1, nc
            y(:, :, j) = p%stiffness*y(:, :, j)
         end do
         if (any(p%order > 0)) call take_means(self%problem%fourier, p, y, work%mean)
         if (any(p%order > 0)) call take_rates(self%problem%fourier, self%frequency(), p, y)
         if (p%has_inertia) call take_inertias(self%problem%fourier, self%frequency(), p, y)
      end associate
   end subroutine predict

   !> What makes a derivative by tau one by what a law takes: omega where that is the time.
   pure real(wp) function rate_unit(self, prediction, element)
      class(balance_state), intent(in) :: self
      type(prediction_type), intent(in) :: prediction
      integer, intent(in) :: element

      rate_unit = merge(self%frequency(), 1.0_wp, prediction%in_time(element))
   end function rate_unit

   !> What elements must transmit for equilibrium.
   subroutine add_balance(self, entry, y)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      real(wp), intent(inout) :: y(:, :, :)
      integer :: i, c, j, row

      do j = 1, size(y, 3)
         do c = 1, size(y, 2)
            do i = 1, size(y, 1)
               row = entry%rigid_rows((c - 1)*size(y, 1) + i)
               if (row == 0) cycle
               y(i, c, j) = y(i, c, j) + &
                  self%balance(self%problem%incidence%coordinate_of(row), j)
            end do
         end do
      end do
   end subroutine add_balance

   !> r = -balance + B^T lambda of the laws that take the balance; those of the others it holds.
   subroutine collect(self, m, nc, r)
      class(balance_state), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(out) :: r(m, nc)
      integer :: k

      r = -self%balance
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k))
            if (.not. entry%law%prediction%takes_balance) cycle
            call self%problem%incidence%scatter(entry%rigid_rows, m, nc, 1.0_wp, &
                                                self%work(k)%force, r)
         end associate
      end do
   end subroutine collect

end module fw_balance_state
