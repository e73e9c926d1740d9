!> Harmonic balance with alternating frequency/time:
!>
!>   R(q) = Z_r q + f_springs(q) + B^T lambda(y) - F_r,
!>
!> with the prediction of the contact forces  y = F_r - Z_r q - f_springs + eps (q + gap)  (dlft)
!> or  y = k (q + gap)  (penalty); dlft_velocity takes eps dq/dtau in the tangential directions.
!> Unknowns are (coordinate, coefficient), coordinates innermost.
module fw_hbm
   use fw_kinds, only: wp
   use fw_condensation, only: condensation_type
   use fw_contact_data, only: contact_type
   use fw_contact_data, only: spring_type
   use fw_contact_data, only: law_dlft_velocity
   use fw_contact_data, only: law_penalty
   use fw_error, only: error_type
   use fw_forces, only: forces_type
   use fw_forces, only: new_forces
   use fw_forces, only: pair_stuck
   use fw_fourier, only: fourier_type
   use fw_incidence, only: incidence_type
   use fw_incidence, only: new_incidence
   use fw_joint, only: joint_type
   use fw_lapack, only: zgemv
   use fw_polynomial, only: springs_type
   use fw_polynomial, only: new_springs
   use fw_parameter_system, only: parameter_system
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: hbm_system, new_hbm, to_complex, to_real

   type, extends(parameter_system) :: hbm_system
      type(joint_type) :: joint
      !> B, from the coordinates to the rows of the joint.
      type(incidence_type) :: incidence
      type(condensation_type) :: structure
      type(fourier_type) :: fourier
      type(forces_type) :: contact
      type(springs_type) :: springs
      !> The contact law predicts from equilibrium (dlft) or from stiffness alone (penalty).
      logical :: rigid = .true.
      !> Tangential prediction from velocities, without memory (dlft_velocity).
      logical :: velocity_level = .false.
      !> Prediction stiffness: eps, or the penalty stiffness (n_pairs, 3) [force/length].
      real(wp), allocatable :: stiffness(:, :)
      !> Gap and wear depth (n_pairs) [length]; load of pairs without a normal dof (n_pairs).
      real(wp), allocatable :: gap(:), depth(:), normal_load(:)
      !> F - Z q - f_springs, and the loads (n_coordinates, n_coefficients).
      real(wp), allocatable :: balance(:, :), load(:, :)
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
      !> Frequency and coordinates (first n_gathered entries, as `used`) of `active_stiffness`.
      real(wp) :: gathered_omega = -1.0_wp
      integer :: n_gathered = 0
      integer :: n_gathered_active = 0
      integer, allocatable :: gathered(:)
      complex(wp), allocatable :: active_stiffness(:, :, :)
      real(wp), allocatable :: active_out(:, :), pair_in(:, :), pair_out(:, :)
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
      procedure :: parameter_derivative
      procedure :: coordinate_of
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

   !> Build the system of a joint. The structure must stand at a frequency already (its stiffness
   !> sets eps); call set_frequency before the first residual.
   subroutine new_hbm(joint, structure, fourier, contact, springs, self)
      type(joint_type), intent(in) :: joint
      type(condensation_type), intent(in) :: structure
      type(fourier_type), intent(in) :: fourier
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(hbm_system), intent(out) :: self
      integer :: m, nc, nh

      self%joint = joint
      call new_incidence(joint%relative, structure%n_coordinates, self%incidence)
      self%structure = structure
      self%fourier = fourier
      self%rigid = contact%law /= law_penalty
      self%velocity_level = contact%law == law_dlft_velocity
      m = structure%n_coordinates
      nc = fourier%n_coefficients
      nh = fourier%n_retained
      self%n = m*nc
      if (contact%n_pairs > 0) then
         self%contact = new_forces(contact%mu, joint%row > 0, fourier)
         self%gap = contact%gap
         self%normal_load = merge(contact%normal_load, 0.0_wp, contact%side_1(3, :) == 0 .and. &
                                  contact%side_2(3, :) == 0)
      else
         self%contact = new_forces([real(wp) ::], joint%row > 0, fourier)
         allocate (self%gap(0), self%normal_load(0))
      end if
      allocate (self%depth(contact%n_pairs), source=0.0_wp)
      if (allocated(contact%depth)) self%depth = contact%depth
      if (springs%n_springs > 0) then
         self%springs = new_springs(springs%coefficient, springs%power, fourier)
      else
         self%springs = new_springs([real(wp) ::], [integer ::], fourier)
      end if
      self%contact%remembers = .not. self%velocity_level
      call set_stiffness(self, contact)
      allocate (self%balance(m, nc), self%load(m, nc), source=0.0_wp)
      allocate (self%complex_in(m, nh), self%complex_out(m, nh), source=(0.0_wp, 0.0_wp))
      allocate (self%active_out(m, nc), self%used(m), self%place(m), self%preconditioned(m))
      allocate (self%gathered(m), self%kept_place(m), self%unknown_stiffness(m))
      allocate (self%pair_in(3*nc, contact%n_pairs), source=0.0_wp)
      allocate (self%pair_out(3*nc, contact%n_pairs), source=0.0_wp)
      allocate (self%preconditioner(nh))
   end subroutine new_hbm

   !> eps of the order of the local static stiffness (that of another direction where a coordinate
   !> has none: any value above zero serves), one for both tangential directions (the
   !> friction law is isotropic) and one for the normal. Directions that nothing moves do not
   !> count, whether they are left out or not.
   subroutine set_stiffness(self, contact)
      type(hbm_system), intent(inout) :: self
      type(contact_type), intent(in) :: contact
      real(wp) :: stiffness(3)
      logical :: counts(2)
      integer :: i, c

      allocate (self%stiffness(contact%n_pairs, 3), source=0.0_wp)
      do i = 1, contact%n_pairs
         if (self%rigid) then
            stiffness = 0.0_wp
            do c = 1, 3
               if (self%joint%row(c, i) == 0) cycle
               stiffness(c) = local_stiffness(self, self%coordinate_of(c, i))
            end do
            counts = self%joint%row(1:2, i) > 0 .and. .not. self%joint%idle(1:2, i)
            if (.not. any(counts)) counts = self%joint%row(1:2, i) > 0
            stiffness(1:2) = sum(stiffness(1:2), mask=counts)/real(max(1, count(counts)), wp)
            if (maxval(stiffness) <= 0.0_wp) stiffness = largest_stiffness(self)
            where (stiffness <= 0.0_wp .and. self%joint%row(:, i) > 0) stiffness &
               = maxval(stiffness)
            self%stiffness(i, :) = contact%penalty_scale*stiffness
         else
            if (any(self%joint%row(1:2, i) > 0)) self%stiffness(i, 1:2) &
               = contact%tangential_stiffness(i)
            if (self%joint%row(3, i) > 0) self%stiffness(i, 3) = contact%normal_stiffness(i)
         end if
      end do
   end subroutine set_stiffness

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
      dynamic = abs(self%structure%stiffness(coordinate, coordinate, h))
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

      call self%structure%update(parameter, error)
      if (allocated(error)) return
      call to_real(self%fourier, self%structure%n_coordinates, self%structure%load, self%load)
      self%reference = load_norm(self)
      if (self%fourier%has_constant()) then
         self%load(:, 2:) = self%load_share*self%load(:, 2:)
      else
         self%load = self%load_share*self%load
      end if
   end subroutine set_frequency

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
         static = norm2(self%load(:, 1))
      end if
      load_norm = max(load_norm, static_share*static)
      if (load_norm <= 0.0_wp) load_norm = norm2(self%normal_load) + norm2(self%stiffness(:, &
         3)*self%gap)
      if (load_norm <= 0.0_wp) load_norm = 1.0_wp
   end function load_norm

   !> R(x); see the module header.
   subroutine residual(self, x, r)
      class(hbm_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: m, nc

      m = self%structure%n_coordinates
      nc = self%fourier%n_coefficients
      if (m == 0) return
      call multiply_stiffness(self, m, nc, x)
      if (self%springs%n_springs > 0) call add_springs(self, m, nc, x)
      if (self%contact%n_pairs > 0) then
         call predict(self, m, nc, x)
         call self%contact%evaluate(self%fourier)
         if (self%velocity_level) call hold_stuck_means(self, m, nc, x)
      end if
      call collect(self, m, nc, r)
   end subroutine residual

   !> balance = F - Z q.
   subroutine multiply_stiffness(self, m, nc, q)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      integer :: h
      complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

      call to_complex(self%fourier, m, q, self%complex_in)
      !$omp parallel do default(none) shared(self, m) private(h) &
      !$omp if(m >= coordinates_for_threads)
      do h = 1, self%fourier%n_retained
         call zgemv('N', m, m, one, self%structure%stiffness(1, 1, h), m, &
                    self%complex_in(1, h), 1, zero, self%complex_out(1, h), 1)
      end do
      !$omp end parallel do
      call to_real(self%fourier, m, self%complex_out, self%balance)
      self%balance = self%load - self%balance
   end subroutine multiply_stiffness

   !> balance = balance - f_springs.
   subroutine add_springs(self, m, nc, q)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)

      associate (rows => self%joint%spring_row)
         call self%incidence%gather(rows, m, nc, q, self%springs%elongation)
         call self%springs%evaluate(self%fourier)
         call self%incidence%scatter(rows, m, nc, -1.0_wp, self%springs%force, self%balance)
      end associate
   end subroutine add_springs

   !> Predicted contact forces.
   subroutine predict(self, m, nc, q)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      integer :: j

      associate (y => self%contact%prediction)
         call self%incidence%gather(self%joint%pair_rows, m, nc, q, y)
         do j = 1, nc
            y(:, :, j) = self%stiffness*y(:, :, j)
         end do
         if (self%velocity_level) call tangential_rates(self, y)
         if (self%rigid) call add_balance(self, y)
         self%contact%offset = merge(self%stiffness(:, 3)*(self%gap + self%depth), &
                                     -self%normal_load, self%joint%row(3, :) > 0)
      end associate
   end subroutine predict

   !> Replace predictions from displacements by predictions from velocities du/dtau.
   subroutine tangential_rates(self, y)
      type(hbm_system), intent(in) :: self
      real(wp), intent(inout) :: y(:, :, :)
      real(wp) :: cosine, n
      integer :: i, c, h, k

      do h = 1, self%fourier%n_retained
         k = self%fourier%column(h)
         n = real(self%fourier%harmonic(h), wp)
         if (self%fourier%harmonic(h) == 0) then
            y(:, 1:2, k) = 0.0_wp
            cycle
         end if
         do c = 1, 2
            do i = 1, size(y, 1)
               cosine = y(i, c, k)
               y(i, c, k) = n*y(i, c, k + 1)
               y(i, c, k + 1) = -n*cosine
            end do
         end do
      end do
   end subroutine tangential_rates

   !> What rigid pairs must transmit for equilibrium.
   subroutine add_balance(self, y)
      type(hbm_system), intent(in) :: self
      real(wp), intent(inout) :: y(:, :, :)
      integer :: i, c, j

      do j = 1, size(y, 3)
         do c = 1, 3
            do i = 1, size(y, 1)
               if (self%joint%row(c, i) == 0) cycle
               y(i, c, j) = y(i, c, j) + self%balance(self%coordinate_of(c, i), j)
            end do
         end do
      end do
   end subroutine add_balance

   !> Velocities say nothing of the mean position of a pair that sticks through the period: it
   !> stays where it was assembled.
   subroutine hold_stuck_means(self, m, nc, q)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      integer :: i, c

      if (.not. self%fourier%has_constant()) return
      do i = 1, self%contact%n_pairs
         if (self%contact%state(i) /= pair_stuck) cycle
         do c = 1, 2
            if (self%joint%row(c, i) == 0) cycle
            self%contact%force(i, c, 1) = self%contact%force(i, c, 1) + &
                                          self%stiffness(i, c)*q(self%coordinate_of(c, i), 1)
         end do
      end do
   end subroutine hold_stuck_means

   !> r = -balance + B^T lambda.
   subroutine collect(self, m, nc, r)
      class(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(out) :: r(m, nc)

      r = -self%balance
      call self%incidence%scatter(self%joint%pair_rows, m, nc, 1.0_wp, self%contact%force, r)
   end subroutine collect

   !> U_n = uc_n - i us_n of each retained harmonic (n_rows, n_retained).
   pure subroutine to_complex(fourier, n_rows, coefficients, harmonics)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: coefficients(n_rows, *)
      complex(wp), intent(inout) :: harmonics(n_rows, *)
      integer :: h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         if (fourier%harmonic(h) == 0) then
            harmonics(:, h) = cmplx(coefficients(:, k), kind=wp)
         else
            harmonics(:, h) = cmplx(coefficients(:, k), -coefficients(:, k + 1), wp)
         end if
      end do
   end subroutine to_complex

   !> The inverse of to_complex.
   pure subroutine to_real(fourier, n_rows, harmonics, coefficients)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      complex(wp), intent(in) :: harmonics(n_rows, *)
      real(wp), intent(inout) :: coefficients(n_rows, *)
      integer :: h, k

      do h = 1, fourier%n_retained
         k = fourier%column(h)
         coefficients(:, k) = real(harmonics(:, h), wp)
         if (fourier%harmonic(h) > 0) coefficients(:, k + 1) = -aimag(harmonics(:, h))
      end do
   end subroutine to_real

end module fw_hbm
