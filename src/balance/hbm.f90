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
module fw_hbm
   use fw_kinds, only: wp
   use fw_error, only: error_type
   use fw_force_law, only: force_workspace
   use fw_force_law, only: pair_stuck
   use fw_force_law, only: prediction_type
   use fw_force_list, only: force_entry
   use fw_force_list, only: force_list
   use fw_complex_form, only: amplitudes_of
   use fw_complex_form, only: coefficients_of
   use fw_fourier, only: fourier_type
   use fw_incidence, only: incidence_type
   use fw_incidence, only: new_incidence
   use fw_joint, only: joint_type
   use fw_parameter_system, only: parameter_system
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_structure_operator, only: structure_operator
   use fw_structure_operator, only: structure_state
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: hbm_system, new_hbm, to_complex, to_real

   type, extends(parameter_system) :: hbm_system
      type(joint_type) :: joint
      !> B, from the coordinates to the rows of the joint.
      type(incidence_type) :: incidence
      !> The structure, and where it stands.
      class(structure_operator), allocatable :: structure
      class(structure_state), allocatable :: structure_state
      type(fourier_type) :: fourier
      !> The laws of the forces, which are not written after construction, and what their
      !> evaluations leave (n_laws).
      type(force_list) :: forces
      type(force_workspace), allocatable :: work(:)
      integer :: n_pairs = 0
      !> Wear depth of the pairs (n_pairs) [length].
      real(wp), allocatable :: depth(:)
      !> F - Z q less the forces that do not take the balance, and the loads (n_coordinates,
      !> n_coefficients).
      real(wp), allocatable :: balance(:, :), load(:, :)
      !> Scratch (n_coordinates, n_coefficients).
      real(wp), allocatable :: product(:, :)
      !> What a step of pseudo-time adds to the derivative, P/h, outside of the contact laws
      !> (n_coordinates, n_coordinates, n_retained); only allocated during such a step.
      complex(wp), allocatable :: shift(:, :, :)
      !> Share of the vibratory load that acts; below 1 only on the way to a first solution.
      real(wp) :: load_share = 1.0_wp
      !> Workspace (n_coordinates, n_retained).
      complex(wp), allocatable :: complex_in(:, :), complex_out(:, :)
      !> Let normal components that always bear leave the linear problem.
      logical :: pins_normals = .true.
      ! The remaining linear problem, see fw_hbm_linear.
      integer :: n_linear = 0
      integer :: n_active = 0
      integer :: n_used = 0
      integer, allocatable :: used(:), place(:)
      real(wp), allocatable :: active_out(:, :)
      type(preconditioner_lu_type), allocatable :: preconditioner(:)
      !> Coordinates for which the preconditioner was built (first n_preconditioned entries).
      integer :: n_preconditioned = 0
      !> Whether it was built with a shift.
      logical :: preconditioned_shift = .false.
      integer, allocatable :: preconditioned(:)
      !> Place there of each active coordinate, 0 for one that has become active since; prediction
      !> stiffness of those.
      integer, allocatable :: kept_place(:)
      real(wp), allocatable :: unknown_stiffness(:)
   contains
      procedure :: set_parameter => set_frequency
      procedure :: set_frequency
      procedure :: frequency
      procedure :: parameter_derivative
      procedure :: coordinate_of
      procedure :: rate_unit
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: preconditioner_fits
      procedure :: precondition
      procedure :: assemble
   end type hbm_system

   ! The linear problem of a Newton step (fw_hbm_linear).
   interface
      module subroutine linearize(self, n_linear)
         class(hbm_system), intent(inout) :: self
         integer, intent(out) :: n_linear
      end subroutine linearize

      module subroutine reduce(self, r, rhs)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:)
         real(wp), intent(out), contiguous :: rhs(:)
      end subroutine reduce

      module subroutine expand(self, r, solution, step)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:), solution(:)
         real(wp), intent(out), contiguous :: step(:)
      end subroutine expand

      module subroutine parameter_derivative(self, x, dr)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: x(:)
         real(wp), intent(out), contiguous :: dr(:)
      end subroutine parameter_derivative

      module subroutine apply(self, vector, product)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine apply

      module subroutine assemble(self, matrix)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: matrix(:, :)
      end subroutine assemble

      !> complex_in = complex form of a vector of the active coordinates.
      module subroutine active_to_complex(self, na, vector)
         type(hbm_system), intent(inout) :: self
         integer, intent(in) :: na
         real(wp), intent(in) :: vector(na, *)
      end subroutine active_to_complex
   end interface

   ! Its preconditioner (fw_hbm_preconditioner).
   interface
      module subroutine build_preconditioner(self)
         class(hbm_system), intent(inout) :: self
      end subroutine build_preconditioner

      !> Find the active coordinates in the preconditioner from before.
      module subroutine place_kept(self)
         type(hbm_system), intent(inout) :: self
      end subroutine place_kept

      pure module logical function preconditioner_fits(self)
         class(hbm_system), intent(in) :: self
      end function preconditioner_fits

      module subroutine precondition(self, vector)
         class(hbm_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: vector(:)
      end subroutine precondition
   end interface

contains

   !> Build the system of a joint; call set_frequency before the first residual.
   subroutine new_hbm(joint, structure, state, fourier, forces, depth, self)
      type(joint_type), intent(in) :: joint
      class(structure_operator), intent(in) :: structure
      !> At a frequency (its stiffness sets eps); moved into the system.
      class(structure_state), allocatable, intent(inout) :: state
      type(fourier_type), intent(in) :: fourier
      type(force_list), intent(in) :: forces
      !> Wear depth of the pairs (n_pairs) [length]; zero where it is not allocated.
      real(wp), allocatable, intent(in) :: depth(:)
      type(hbm_system), intent(out) :: self
      integer :: k, m, nc, nh

      self%joint = joint
      call new_incidence(joint%relative, structure%n_coordinates, self%incidence)
      self%structure = structure
      call move_alloc(state, self%structure_state)
      self%fourier = fourier
      m = structure%n_coordinates
      nc = fourier%n_coefficients
      nh = fourier%n_retained
      self%n = m*nc
      self%forces = forces
      self%n_pairs = forces%entry(forces%pairs)%law%n_elements
      allocate (self%depth(self%n_pairs), source=0.0_wp)
      if (allocated(depth)) self%depth = depth
      do k = 1, self%forces%n_laws
         associate (law => self%forces%entry(k)%law)
            if (law%prediction%takes_balance) call set_stiffness(self, law%prediction)
         end associate
      end do
      call self%forces%reserve(fourier, self%work)
      allocate (self%balance(m, nc), self%load(m, nc), self%product(m, nc), source=0.0_wp)
      allocate (self%complex_in(m, nh), self%complex_out(m, nh), source=(0.0_wp, 0.0_wp))
      allocate (self%active_out(m, nc), self%used(m), self%place(m), self%preconditioned(m))
      allocate (self%kept_place(m), self%unknown_stiffness(m))
      allocate (self%preconditioner(nh))
   end subroutine new_hbm

   !> eps of the order of the local static stiffness (that of another direction where a coordinate
   !> has none: any value above zero serves), one for both tangential directions (the
   !> friction law is isotropic) and one for the normal. Directions that nothing moves do not
   !> count, whether they are left out or not.
   subroutine set_stiffness(self, prediction)
      type(hbm_system), intent(in) :: self
      type(prediction_type), intent(inout) :: prediction
      real(wp) :: stiffness(3)
      logical :: counts(2)
      integer :: i, c

      do i = 1, self%n_pairs
         stiffness = 0.0_wp
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            stiffness(c) = local_stiffness(self, self%coordinate_of(c, i))
         end do
         counts = self%joint%row(1:2, i) > 0 .and. .not. self%joint%idle(1:2, i)
         if (.not. any(counts)) counts = self%joint%row(1:2, i) > 0
         stiffness(1:2) = sum(stiffness(1:2), mask=counts)/real(max(1, count(counts)), wp)
         if (maxval(stiffness) <= 0.0_wp) stiffness = largest_stiffness(self)
         where (stiffness <= 0.0_wp .and. self%joint%row(:, i) > 0) stiffness = maxval(stiffness)
         prediction%stiffness(i, :) = prediction%scale*stiffness
      end do
      if (prediction%has_inertia) call set_inertia(self, prediction)
   end subroutine set_stiffness

   !> What the structure is to motions above the harmonics of the balance, in place of its static
   !> stiffness; its mass and damping where they matter to a pair with one tangential direction.
   subroutine set_inertia(self, prediction)
      type(hbm_system), intent(in) :: self
      type(prediction_type), intent(inout) :: prediction
      real(wp) :: m(3), c(3), k(3)
      logical :: counts(3)
      integer :: i, j, n

      allocate (prediction%inertia(self%n_pairs, 3), prediction%damping(self%n_pairs, 3), &
                source=0.0_wp)
      n = maxval(self%fourier%harmonic)
      do i = 1, self%n_pairs
         counts = self%joint%row(:, i) > 0 .and. .not. self%joint%idle(:, i)
         k = 0.0_wp
         do j = 1, 3
            if (.not. counts(j)) cycle
            call self%structure%split(self%coordinate_of(j, i), (n + 1)*self%frequency(), m(j), &
                                      c(j), k(j))
            if (k(j) > 0.0_wp) prediction%stiffness(i, j) = prediction%scale*k(j)
         end do
         if (count(counts(1:2)) == 2) then
            ! One stiffness for both: friction is isotropic.
            if (all(k(1:2) > 0.0_wp)) then
               prediction%stiffness(i, 1:2) = prediction%scale*0.5_wp*sum(k(1:2))
            end if
            cycle
         end if
         j = findloc(counts(1:2), .true., dim=1)
         if (j == 0) cycle
         if (all(self%joint%row(1:2, i) > 0)) cycle
         if (.not. k(j) > 0.0_wp) cycle
         call take_inertia(4*n*self%frequency(), m(j), c(j), k(j))
         prediction%inertia(i, j) = prediction%scale*m(j)
         prediction%damping(i, j) = prediction%scale*c(j)
      end do
   end subroutine set_inertia

   !> Mass and damping of an oscillator as its law takes them: none where neither matters up to a
   !> frequency, else a mass above zero, and a damping that keeps resonances finite.
   pure subroutine take_inertia(frequency, m, c, k)
      real(wp), intent(in) :: frequency, k
      real(wp), intent(inout) :: m, c
      real(wp), parameter :: mass_matters = 0.02_wp, damping_matters = 0.05_wp
      real(wp), parameter :: least_mass = 1.0e-3_wp, least_damping = 1.0e-9_wp

      if (m*frequency**2 < mass_matters*k .and. c*frequency < damping_matters*k) then
         m = 0.0_wp
         c = 0.0_wp
         return
      end if
      m = max(m, least_mass*k/frequency**2)
      c = max(c, least_damping*sqrt(k*m))
   end subroutine take_inertia

   !> Largest static stiffness of all coordinates, or 1.
   real(wp) function largest_stiffness(self) result(stiffness)
      type(hbm_system), intent(in) :: self
      integer :: j

      stiffness = 0.0_wp
      do j = 1, self%structure%n_coordinates
         stiffness = max(stiffness, local_stiffness(self, j))
      end do
      if (stiffness <= 0.0_wp) stiffness = 1.0_wp
   end function largest_stiffness

   !> Static stiffness of a coordinate, or the dynamic one where nothing holds it statically.
   real(wp) function local_stiffness(self, coordinate) result(stiffness)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp) :: dynamic
      real(wp), parameter :: unheld = 1.0e-6_wp
      integer :: h

      stiffness = abs(self%structure%static_stiffness(coordinate))
      h = findloc(self%structure%harmonic, 1, dim=1)
      dynamic = abs(self%structure%diagonal(self%structure_state, h, coordinate))
      if (stiffness <= unheld*dynamic) stiffness = dynamic
   end function local_stiffness

   !> Coordinate of a component that is one.
   pure integer function coordinate_of(self, component, pair) result(coordinate)
      class(hbm_system), intent(in) :: self
      integer, intent(in) :: component, pair

      coordinate = self%incidence%coordinate_of(self%joint%row(component, pair))
   end function coordinate_of

   !> Bring matrices and loads to a frequency.
   subroutine set_frequency(self, parameter, error)
      class(hbm_system), intent(inout) :: self
      !> Angular frequency [rad/s].
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%structure%at(self%structure_state, parameter, 0.0_wp, error)
      if (allocated(error)) return
      call to_real(self%fourier, self%structure%n_coordinates, self%structure_state%load, &
                   self%load)
      self%reference = load_norm(self)
      if (self%fourier%has_constant()) then
         self%load(:, 2:) = self%load_share*self%load(:, 2:)
      else
         self%load = self%load_share*self%load
      end if
   end subroutine set_frequency

   !> Present angular frequency [rad/s].
   pure real(wp) function frequency(self)
      class(hbm_system), intent(in) :: self

      frequency = self%structure_state%omega
   end function frequency

   !> The norm to which residuals are compared: that of the vibratory load. A large static load
   !> must not hide the vibration, but its round-off must not forbid convergence either.
   real(wp) function load_norm(self)
      type(hbm_system), intent(in) :: self
      real(wp), parameter :: static_share = 1.0e-5_wp
      real(wp) :: static

      static = 0.0_wp
      load_norm = norm2(self%load)
      if (self%fourier%has_constant()) then
         load_norm = norm2(self%load(:, 2:))
         ! What a fit presses together acts like a static load, even where no load moves the joint.
         static = norm2(self%load(:, 1)) + press_of(self)
      end if
      load_norm = max(load_norm, static_share*static)
      if (load_norm <= 0.0_wp) then
         associate (p => self%forces%entry(self%forces%pairs)%law%prediction)
            load_norm = norm2(p%load) + norm2(p%stiffness(:, 3)*p%gap)
         end associate
      end if
      if (load_norm <= 0.0_wp) load_norm = 1.0_wp
   end function load_norm

   !> Forces that interferences would have where nothing gave way.
   real(wp) function press_of(self)
      type(hbm_system), intent(in) :: self

      press_of = 0.0_wp
      if (size(self%depth) == 0) return
      associate (p => self%forces%entry(self%forces%pairs)%law%prediction)
         press_of = norm2(p%stiffness(:, 3)*min(p%gap, 0.0_wp))
      end associate
   end function press_of

   !> R(x); see the module header.
   subroutine residual(self, x, r)
      class(hbm_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: k, m, nc

      m = self%structure%n_coordinates
      nc = self%fourier%n_coefficients
      if (m == 0) return
      call multiply_stiffness(self, m, nc, x)
      do k = 1, self%forces%n_laws
         associate (entry => self%forces%entry(k), work => self%work(k))
            work%rate = self%frequency()
            call predict(self, entry, m, nc, x, work)
            if (k == self%forces%pairs) call entry%law%set_offset(self%depth, work)
            call entry%law%evaluate(self%fourier, work)
            if (entry%law%prediction%takes_balance) then
               call hold_stuck_means(self, entry, m, nc, x, work)
            else
               call self%incidence%scatter(entry%rows, m, nc, -1.0_wp, work%force, self%balance)
            end if
         end associate
      end do
      call collect(self, m, nc, r)
   end subroutine residual

   !> balance = F - Z q.
   subroutine multiply_stiffness(self, m, nc, q)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)

      call self%structure%multiply(self%structure_state, q, self%balance)
      self%balance = self%load - self%balance
   end subroutine multiply_stiffness

   !> Predicted inputs of a law.
   subroutine predict(self, entry, m, nc, q, work)
      type(hbm_system), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      type(force_workspace), intent(inout) :: work
      integer :: j

      associate (p => entry%law%prediction, y => work%prediction)
         call self%incidence%gather(entry%rows, m, nc, q, y)
         do j = 1, nc
            y(:, :, j) = p%stiffness*y(:, :, j)
         end do
         if (any(p%order > 0)) call take_rates(self%fourier, self%rate_unit(p), p%order, y)
         if (p%has_inertia) call take_inertias(self%fourier, self%frequency(), p, y)
         if (p%takes_balance) call add_balance(self, entry%row, y)
      end associate
   end subroutine predict

   !> What makes a derivative by tau one by what a law takes: omega where that is the time.
   pure real(wp) function rate_unit(self, prediction)
      class(hbm_system), intent(in) :: self
      type(prediction_type), intent(in) :: prediction

      rate_unit = merge(self%frequency(), 1.0_wp, prediction%by_time)
   end function rate_unit

   !> Replace inputs from displacements by inputs from velocities, where the law takes these.
   subroutine take_rates(fourier, unit, order, y)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: unit
      integer, intent(in) :: order(:)
      real(wp), intent(inout) :: y(:, :, :)
      real(wp) :: cosine, n
      integer :: i, c, h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         n = unit*real(fourier%harmonic(h), wp)
         do c = 1, size(y, 2)
            if (order(c) == 0) cycle
            if (fourier%harmonic(h) == 0) then
               y(:, c, k) = 0.0_wp
               cycle
            end if
            do i = 1, size(y, 1)
               cosine = y(i, c, k)
               y(i, c, k) = n*y(i, c, k + 1)
               y(i, c, k + 1) = -n*cosine
            end do
         end do
      end do
   end subroutine take_rates

   !> Bring inputs from displacements times a stiffness to those times E_n.
   subroutine take_inertias(fourier, omega, prediction, y)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      type(prediction_type), intent(in) :: prediction
      real(wp), intent(inout) :: y(:, :, :)
      complex(wp) :: turned
      integer :: i, c, h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         if (fourier%harmonic(h) == 0) cycle
         do c = 1, size(y, 2)
            do i = 1, size(y, 1)
               turned = prediction%impedance_ratio(i, c, fourier%harmonic(h), omega)* &
                        cmplx(y(i, c, k), -y(i, c, k + 1), wp)
               y(i, c, k) = real(turned, wp)
               y(i, c, k + 1) = -aimag(turned)
            end do
         end do
      end do
   end subroutine take_inertias

   !> What elements must transmit for equilibrium.
   subroutine add_balance(self, row, y)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: row(:, :)
      real(wp), intent(inout) :: y(:, :, :)
      integer :: i, c, j

      do j = 1, size(y, 3)
         do c = 1, size(y, 2)
            do i = 1, size(y, 1)
               if (row(c, i) == 0) cycle
               y(i, c, j) = y(i, c, j) + self%balance(self%incidence%coordinate_of(row(c, i)), j)
            end do
         end do
      end do
   end subroutine add_balance

   !> Velocities say nothing of the mean position of an element that sticks through the period: it
   !> stays where it was assembled.
   subroutine hold_stuck_means(self, entry, m, nc, q, work)
      type(hbm_system), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      type(force_workspace), intent(inout) :: work
      integer :: i, c

      if (.not. self%fourier%has_constant()) return
      associate (p => entry%law%prediction, row => entry%row)
         if (all(p%order == 0)) return
         do i = 1, size(row, 2)
            if (work%state(i) /= pair_stuck) cycle
            do c = 1, size(row, 1)
               if (row(c, i) == 0 .or. p%order(c) == 0) cycle
               work%force(i, c, 1) = work%force(i, c, 1) + &
                                     p%stiffness(i, c)*q(self%incidence%coordinate_of(row(c, i)), 1)
            end do
         end do
      end associate
   end subroutine hold_stuck_means

   !> r = -balance + B^T lambda of the laws that take the balance; those of the others it holds.
   subroutine collect(self, m, nc, r)
      class(hbm_system), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(out) :: r(m, nc)
      integer :: k

      r = -self%balance
      do k = 1, self%forces%n_laws
         associate (entry => self%forces%entry(k))
            if (.not. entry%law%prediction%takes_balance) cycle
            call self%incidence%scatter(entry%rows, m, nc, 1.0_wp, self%work(k)%force, r)
         end associate
      end do
   end subroutine collect

   !> U_n = uc_n - i us_n of each retained harmonic (n_rows, n_retained).
   pure subroutine to_complex(fourier, n_rows, coefficients, harmonics)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: coefficients(n_rows, *)
      complex(wp), intent(inout) :: harmonics(n_rows, *)

      call amplitudes_of(fourier%harmonic, fourier%column, n_rows, coefficients, n_rows, harmonics)
   end subroutine to_complex

   !> The inverse of to_complex.
   pure subroutine to_real(fourier, n_rows, harmonics, coefficients)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      complex(wp), intent(in) :: harmonics(n_rows, *)
      real(wp), intent(inout) :: coefficients(n_rows, *)

      call coefficients_of(fourier%harmonic, fourier%column, n_rows, n_rows, harmonics, &
                           coefficients)
   end subroutine to_real

end module fw_hbm
