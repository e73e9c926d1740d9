!> A cyclic structure under a travelling wave, behind the face of any structure: one sector, of
!> which harmonic n moves in the nodal diameter n engine_order modulo n_sectors. The condensation of
!> every nodal diameter is that of a plain structure with Hermitian matrices; only one basis is kept
!> for k and N - k, whose matrices are conjugates. Z_r is formed at each frequency.
module fw_cyclic_structure
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_cyclic_data, only: nodal_matrices, nodal_speed
   use fw_cyclic_relative, only: cyclic_relative
   use fw_error, only: error_type, fatal_error, status_input
   use fw_formed_stiffness, only: formed_stiffness
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_sector, only: sector_at, speed_at
   use fw_sector_changes, only: changes_at, nodal_change
   use fw_sector_field, only: change_sector, complete_sector, condense_sector, observe_sector, &
      work_on_sector
   use fw_sector_means, only: sector_means
   use fw_sector_reduction, only: sector_reduction
   use fw_sector_stiffness, only: derive_sector, form_sector, harmonic_point, &
      observed_sector_slope, recover_sector, slopes_of, work_of_sector
   use fw_size_options, only: sizes
   use fw_sector_uncondensed, only: add_speed_slope, add_uncondensed
   use fw_sector_work, only: structural_work_of
   use fw_structure_operator, only: by_frequency, lay_out_coefficients, structure_operator, &
      structure_state
   use fw_text, only: to_text
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: cyclic_structure, new_cyclic_structure

   !> A mode may stiffen up to this many times the frequency of its stuck motion.
   real(wp), parameter :: reach_of_mode = 2.0_wp
   !> More internal modes than any nodal diameter has.
   integer, parameter :: most_modes = 1000000

   !> A sector under a travelling wave: harmonic n has the nodal diameter n times that of the wave.
   type, extends(structure_operator) :: cyclic_structure
      !> Bases of the nodal diameters in use; the one of each harmonic, and whether its conjugates
      !> act (n_retained).
      type(sector_reduction), allocatable :: basis(:)
      integer, allocatable :: basis_of(:)
      logical, allocatable :: conjugated(:)
      !> Over all nodal diameters.
      type(sector_means) :: means
   contains
      procedure :: new_state
      procedure :: at
      procedure :: multiply
      procedure :: restrict
      procedure :: multiply_active
      procedure :: multiply_nearly
      procedure :: has_near_product
      procedure :: block => block_of_all
      procedure :: active_block => block_in_use
      procedure :: diagonal
      procedure :: derivative
      procedure :: recover
      procedure :: static_stiffness
      procedure :: split
      procedure :: mass
      procedure :: parts
      procedure :: held_modes
      procedure :: magnitudes
      procedure :: observed_slope
      procedure :: load_work
      procedure :: structural_work
      procedure :: whole_size
      procedure :: condense_field
      procedure :: complete_field
      procedure :: observe_field
      procedure :: change_field
      procedure :: field_work
   end type cyclic_structure

   !> Blocks of one frequency.
   type, extends(structure_state) :: cyclic_state
      type(harmonic_point), allocatable :: point(:)
      type(formed_stiffness) :: formed
      !> Whether rows in use are those of the present frequency; whether copies of them are there,
      !> exact ones and near ones.
      logical :: restricted = .false., gathered = .false., packed = .false.
   end type cyclic_state

contains

   !> Condense a sector in the nodal diameters of the harmonics.
   subroutine new_cyclic_structure(model, relative, harmonic, omega_range, means, self, error, &
                                   of_mode, keep_all, keep_none)
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      !> Harmonics in use.
      integer, intent(in) :: harmonic(:)
      !> Lowest and highest frequency that will be asked for [rad/s].
      real(wp), intent(in) :: omega_range(2)
      !> means_none, means_static or means_split.
      integer, intent(in) :: means
      type(cyclic_structure), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> For a nonlinear mode of about the highest frequency: nothing is condensed in harmonic 1.
      logical, intent(in), optional :: of_mode
      !> Of matrices that change: every free dof is a coordinate, or no internal mode is, whatever a
      !> harmonic may hit.
      logical, intent(in), optional :: keep_all, keep_none
      logical :: keeps_first, whole, none

      keeps_first = .false.
      if (present(of_mode)) keeps_first = of_mode
      whole = allocated(model%cyclic%speed)
      if (present(keep_all)) whole = whole .or. keep_all
      none = .false.
      if (present(keep_none)) none = keep_none
      call lay_out_coefficients(self, harmonic)
      self%n_relative = relative%n_coordinates
      self%n_observed = size(model%observe_matrix, 1)
      call find_bases(model, relative, omega_range, keeps_first, whole, none, self, error)
      if (allocated(error)) return
      ! With a speed that follows the frequency they would be those of one.
      if (.not. allocated(model%cyclic%speed)) call find_norms(self)
      call self%means%take(model, relative, means, self%basis, error)
   end subroutine new_cyclic_structure

   !> Norms of K and M of the harmonics.
   pure subroutine find_norms(self)
      type(cyclic_structure), intent(inout) :: self
      integer :: h

      allocate (self%norms(2, size(self%harmonic)))
      do h = 1, size(self%harmonic)
         self%norms(:, h) = self%basis(self%basis_of(h))%norms()
      end do
   end subroutine find_norms

   !> A basis for each nodal diameter in use, with coordinates at places that all share.
   subroutine find_bases(model, relative, omega_range, keeps_first, whole, none, self, error)
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      real(wp), intent(in) :: omega_range(2)
      !> In harmonic 1 every internal mode is a coordinate; every free dof is; nothing more is.
      logical, intent(in) :: keeps_first, whole, none
      type(cyclic_structure), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices), allocatable :: nodal(:)
      type(nodal_speed) :: speed
      integer, allocatable :: used(:), slot(:)
      integer :: h, j, n_kept

      call require_air(model, self, error)
      if (allocated(error)) return
      call list_diameters(model, self, used)
      allocate (self%basis(size(used)), nodal(size(used)))
      do j = 1, size(used)
         call require_diameter(model, self, used(j), error)
         if (.not. allocated(error)) call sector_at(model, used(j), nodal(j), error)
         if (allocated(error)) return
         if (whole) then
            call self%basis(j)%keep_dofs(used(j), size(nodal(j)%mass, 1), relative%at(used(j) + 1))
            cycle
         end if
         call self%basis(j)%find_modes(used(j), nodal(j), relative%at(used(j) + 1), error)
         if (.not. allocated(error) .and. used(j) == 0) then
            call check_free_modes(self%basis(j), nodal(j), error)
         end if
         if (allocated(error)) return
         if (allocated(nodal(j)%circulatory)) then
            call self%basis(j)%keep_all()
            cycle
         end if
         if (keeps_first) then
            call self%basis(j)%keep_of_mode(any(self%harmonic == 1 .and. self%basis_of == j), &
                                            reach_of_mode*omega_range(2)* &
                                            maxval(self%harmonic, mask=self%basis_of == j), &
                                            nodal(j)%has_whirl())
            cycle
         end if
         if (.not. none) call self%basis(j)%keep_resonances( &
            pack(self%harmonic, self%basis_of == j), omega_range, nodal(j)%has_whirl(), nodal(j))
      end do
      ! Free dofs are those of all nodal diameters, modes are of one.
      n_kept = sum([(size(self%basis(j)%kept), j=1, size(used))])
      if (whole) n_kept = maxval([(size(self%basis(j)%kept), j=1, size(used))])
      self%n_coordinates = self%n_relative + n_kept
      self%kept = [(h, h=1, merge(n_kept, 0, whole))]
      n_kept = 0
      do j = 1, size(used)
         slot = [relative%slots(used(j)), (self%n_relative + n_kept + h, &
                                          h=1, size(self%basis(j)%kept))]
         if (allocated(model%cyclic%speed)) then
            call speed_at(model, used(j), speed)
            call self%basis(j)%take_speed(speed, self%n_coordinates, slot)
         end if
         if (.not. whole) then
            n_kept = n_kept + size(self%basis(j)%kept)
            ! Numbers that tell nodal diameters apart too.
            self%kept = [self%kept, used(j)*most_modes + self%basis(j)%kept]
         end if
         call transform(model, nodal(j), slot, self%n_coordinates, self%basis(j), error)
         if (allocated(error)) return
      end do
   end subroutine find_bases

   !> All blocks of a nodal diameter, with what parameters change of them.
   subroutine transform(model, nodal, slot, n_coordinates, basis, error)
      type(model_type), intent(in) :: model
      type(nodal_matrices), intent(in) :: nodal
      !> See transform of sector_reduction.
      integer, intent(in) :: slot(:), n_coordinates
      type(sector_reduction), intent(inout) :: basis
      type(error_type), allocatable, intent(out) :: error
      type(nodal_change), allocatable :: changes(:)

      if (allocated(model%changes)) call changes_at(model, basis%nodal_diameter, nodal, changes, &
                                                    error)
      if (.not. allocated(error)) call basis%transform(nodal, slot, n_coordinates, changes)
   end subroutine transform

   !> Nodal diameters of the harmonics, 0 to N/2, and which harmonics take their conjugates.
   subroutine list_diameters(model, self, used)
      type(model_type), intent(in) :: model
      type(cyclic_structure), intent(inout) :: self
      integer, allocatable, intent(out) :: used(:)
      integer :: h, k

      allocate (used(0))
      allocate (self%basis_of(size(self%harmonic)), self%conjugated(size(self%harmonic)))
      do h = 1, size(self%harmonic)
         k = model%cyclic%nodal_diameter(self%harmonic(h))
         self%conjugated(h) = k < 0
         if (.not. any(used == abs(k))) used = [used, abs(k)]
         self%basis_of(h) = findloc(used, abs(k), dim=1)
      end do
   end subroutine list_diameters

   !> Refuse a harmonic whose nodal diameter the model does not hold.
   subroutine require_diameter(model, self, k, error)
      type(model_type), intent(in) :: model
      type(cyclic_structure), intent(in) :: self
      integer, intent(in) :: k
      type(error_type), allocatable, intent(out) :: error
      integer :: h

      if (model%cyclic%holds(k)) return
      do h = 1, size(self%harmonic)
         if (abs(model%cyclic%nodal_diameter(self%harmonic(h))) == k) exit
      end do
      call fatal_error(error, 'harmonic '//to_text(self%harmonic(h))//' has nodal diameter '// &
                       to_text(k)//', of which the model holds no matrices: must have '// &
                       '/nodal_diameter/'//to_text(k)//', or fewer harmonics', status_input)
   end subroutine require_diameter

   !> Refuse a harmonic of whose nodal diameter the model does not say the forces of the air.
   subroutine require_air(model, self, error)
      type(model_type), intent(in) :: model
      type(cyclic_structure), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: stiffness(:, :)
      integer :: h, k

      if (.not. allocated(model%cyclic%air)) return
      do h = 1, size(self%harmonic)
         if (self%harmonic(h) == 0) cycle
         k = model%cyclic%nodal_diameter(self%harmonic(h))
         call model%cyclic%air_stiffness(k, stiffness)
         if (allocated(stiffness)) cycle
         call fatal_error(error, 'harmonic '//to_text(self%harmonic(h))//' has nodal diameter '// &
                          to_text(k)//', of which the model holds no forces of the air: must '// &
                          'have /aero/nodal_diameter/'//to_text(k)//', or fewer harmonics', &
                          status_input)
         return
      end do
   end subroutine require_air

   !> A free internal mode has no static position: refuse a static load on it.
   subroutine check_free_modes(basis, nodal, error)
      type(sector_reduction), intent(in) :: basis
      type(nodal_matrices), intent(in) :: nodal
      type(error_type), allocatable, intent(out) :: error

      ! Forces across a motion may hold it.
      if (allocated(nodal%circulatory)) return
      if (.not. basis%pushes_free_mode(nodal)) return
      call fatal_error(error, '&load static pushes a part of the sectors that neither '// &
                       'stiffness nor contact holds; hold it or remove the load', status_input)
   end subroutine check_free_modes

   subroutine new_state(self, state)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), allocatable, intent(out) :: state
      type(cyclic_state), allocatable :: cyclic
      integer :: m, nh

      m = self%n_coordinates
      nh = size(self%harmonic)
      allocate (cyclic)
      allocate (cyclic%point(nh))
      cyclic%point%harmonic = self%harmonic
      cyclic%point%conjugated = self%conjugated
      call cyclic%reserve_loads(m, nh)
      allocate (cyclic%used(m), source=0)
      call cyclic%formed%reserve(m, nh)
      call move_alloc(cyclic, state)
   end subroutine new_state

   subroutine at(self, state, omega, self_excitation, error)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: omega, self_excitation
      type(error_type), allocatable, intent(out) :: error
      integer :: n_failed

      if (abs(omega - state%omega) <= 0.0_wp .and. &
          abs(self_excitation - state%self_excitation) <= 0.0_wp) return
      n_failed = 0
      ! Nowhere until it has come there: what a failure leaves belongs to no frequency.
      state%omega = -1.0_wp
      select type (state)
      type is (cyclic_state)
         state%point%s = self%harmonic*omega
         state%point%theta = cmplx(state%point%s**2, state%point%s*self_excitation, wp)
         if (self%n_coordinates > 0) call form_all(self, state, omega, n_failed)
         call state%scale_loads()
         state%restricted = .false.
      end select
      if (n_failed > 0) then
         call fatal_error(error, 'the structure resonates without damping at omega = '// &
                          to_text(omega)//' rad/s in a mode that no contact pair touches; '// &
                          'give it damping or shift the frequency', status_input)
         return
      end if
      state%omega = omega
      state%self_excitation = self_excitation
   end subroutine at

   !> The matrices and loads of all harmonics.
   subroutine form_all(self, state, omega, n_failed)
      class(cyclic_structure), intent(in) :: self
      type(cyclic_state), intent(inout) :: state
      real(wp), intent(in) :: omega
      integer, intent(inout) :: n_failed
      logical :: failed
      integer :: h

      !$omp parallel do default(none) shared(self, state, omega) private(h, failed) &
      !$omp reduction(+:n_failed) schedule(dynamic) &
      !$omp if(self%n_coordinates >= coordinates_for_threads)
      do h = 1, size(self%harmonic)
         call form_sector(self%basis(self%basis_of(h)), state%point(h), &
                          state%formed%matrix(:, :, h), state%unit_load(:, h), failed)
         if (failed) n_failed = n_failed + 1
         call add_uncondensed(self%basis(self%basis_of(h)), self%harmonic(h), self%conjugated(h), &
                              omega, state%formed%matrix(:, :, h), state%unit_load(:, h))
      end do
      !$omp end parallel do
   end subroutine form_all

   !> Z q of all harmonics.
   subroutine multiply(self, state, q, product)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: product(*)

      select type (state)
      type is (cyclic_state)
         call state%formed%multiply(self%harmonic, self%column, self%n_coordinates, q, product)
      end select
   end subroutine multiply

   !> Products and blocks from now on are of some coordinates alone.
   subroutine restrict(self, state, n_active, n_used, used)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: n_active, n_used
      integer, intent(in) :: used(:)

      associate (unused => self)
      end associate
      select type (state)
      type is (cyclic_state)
         if (state%restricted .and. state%n_active == n_active .and. state%n_used == n_used) then
            if (all(state%used(:n_used) == used(:n_used))) return
         end if
         state%n_active = n_active
         state%n_used = n_used
         state%used(:n_used) = used(:n_used)
         state%restricted = .true.
         ! Copies not before they are asked for: steps mostly need the near ones alone.
         state%gathered = .false.
         state%packed = .false.
      end select
   end subroutine restrict

   !> Z v of these.
   subroutine multiply_active(self, state, v, product)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)

      select type (state)
      type is (cyclic_state)
         if (.not. state%gathered) call state%formed%gather(state%n_active, state%n_used, &
                                                            state%used)
         state%gathered = .true.
         call state%formed%multiply_active(self%harmonic, self%column, state%n_active, &
                                           state%n_used, v, self%n_coordinates, product)
      end select
   end subroutine multiply_active

   !> The harmonics have matrices of their own, which differ in more than a few patterns: nothing of
   !> low rank, but copies in single precision.
   subroutine multiply_nearly(self, state, v, product)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)

      select type (state)
      type is (cyclic_state)
         if (.not. state%packed) call state%formed%pack_near(state%n_active, state%n_used, &
                                                             state%used)
         state%packed = .true.
         call state%formed%multiply_near(self%harmonic, self%column, state%n_active, &
                                         state%n_used, v, self%n_coordinates, product)
      end select
   end subroutine multiply_nearly

   pure logical function has_near_product(self)
      class(cyclic_structure), intent(in) :: self

      has_near_product = self%n_coordinates >= sizes%single_matrices
   end function has_near_product

   !> Z_n as a real matrix.
   subroutine block_of_all(self, state, h, matrix)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)

      associate (unused => self)
      end associate
      select type (state)
      type is (cyclic_state)
         matrix = state%formed%matrix(:, :, h)
      end select
   end subroutine block_of_all

   !> The same of the coordinates in use.
   subroutine block_in_use(self, state, h, matrix)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)
      integer :: j

      if (state%n_active == self%n_coordinates) then
         call self%block(state, h, matrix)
         return
      end if
      select type (state)
      type is (cyclic_state)
         do j = 1, state%n_active
            matrix(:, j) = state%formed%matrix(state%used(:state%n_used), state%used(j), h)
         end do
      end select
   end subroutine block_in_use

   complex(wp) function diagonal(self, state, h, coordinate)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h, coordinate

      associate (unused => self)
      end associate
      diagonal = (0.0_wp, 0.0_wp)
      select type (state)
      type is (cyclic_state)
         diagonal = state%formed%matrix(coordinate, coordinate, h)
      end select
   end function diagonal

   subroutine derivative(self, state, parameter, q, slope)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: parameter
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      complex(wp) :: amplitude(self%n_coordinates, size(self%harmonic))
      complex(wp) :: slopes(self%n_coordinates, size(self%harmonic))
      integer :: h, m

      m = self%n_coordinates
      call amplitudes_of(self%harmonic, self%column, m, q, m, amplitude)
      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            call derive_sector(self%basis(self%basis_of(h)), state%point(h), &
                               slopes_of(state%point(h), state%self_excitation, parameter), &
                               state%load_factor(h), amplitude(:, h), slopes(:, h))
            if (parameter /= by_frequency) cycle
            call add_speed_slope(self%basis(self%basis_of(h)), self%harmonic(h), &
                                 self%conjugated(h), state%omega, state%load_factor(h), &
                                 amplitude(:, h), slopes(:, h))
         end do
      end select
      call coefficients_of(self%harmonic, self%column, m, m, slopes, slope)
   end subroutine derivative

   subroutine recover(self, state, q, observed)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      complex(wp), intent(in), contiguous :: q(:, :)
      complex(wp), intent(out), contiguous :: observed(:, :)
      integer :: h

      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            call recover_sector(self%basis(self%basis_of(h)), state%point(h), &
                                state%load_factor(h), q(:, h), observed(:, h))
         end do
      end select
   end subroutine recover

   !> Of a coordinate against all others held, in harmonic 0.
   pure real(wp) function static_stiffness(self, coordinate)
      class(cyclic_structure), intent(in) :: self
      integer, intent(in) :: coordinate

      static_stiffness = self%means%static_stiffness(coordinate)
   end function static_stiffness

   pure subroutine split(self, coordinate, limit, m, c, k)
      class(cyclic_structure), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k

      call self%means%split(coordinate, limit, m, c, k)
   end subroutine split

   !> Of the nodal diameter of the first harmonic, the real part: what flows in pseudo-time would
   !> take, which cyclic structures do not have.
   pure subroutine mass(self, matrix)
      class(cyclic_structure), intent(in) :: self
      real(wp), intent(out) :: matrix(:, :)

      matrix = real(self%basis(of_first_harmonic(self))%blocks(:self%n_coordinates, :, 2), wp)
   end subroutine mass

   !> Of the nodal diameter of the harmonic, for its wave; Coriolis with the damping, the air with
   !> the stiffness.
   pure subroutine parts(self, h, stiffness, mass, damping, observe)
      class(cyclic_structure), intent(in) :: self
      integer, intent(in) :: h
      complex(wp), intent(out) :: stiffness(:, :), mass(:, :), damping(:, :), observe(:, :)

      associate (m => self%n_coordinates, b => self%basis(self%basis_of(h)))
         stiffness = b%blocks(:m, :, 1)
         mass = b%blocks(:m, :, 2)
         damping = (0.0_wp, 0.0_wp)
         if (b%n_blocks == 3) damping = b%blocks(:m, :, 3)
         if (allocated(b%coriolis)) damping = damping + b%coriolis(:m, :m)
         observe = b%observe_q
         if (self%conjugated(h)) then
            stiffness = conjg(stiffness)
            mass = conjg(mass)
            damping = conjg(damping)
            observe = conjg(observe)
         end if
         if (allocated(b%aero) .and. self%harmonic(h) > 0) stiffness = stiffness + &
            b%aero(:m, :m, merge(2, 1, self%conjugated(h)))
      end associate
   end subroutine parts

   !> Which basis harmonic 1 has, or else the first harmonic.
   pure integer function of_first_harmonic(self) result(basis)
      class(cyclic_structure), intent(in) :: self

      basis = self%basis_of(max(1, findloc(self%harmonic, 1, dim=1)))
   end function of_first_harmonic

   !> In the nodal diameter of the first harmonic.
   pure subroutine held_modes(self, frequency, half_width)
      class(cyclic_structure), intent(in) :: self
      real(wp), allocatable, intent(out) :: frequency(:), half_width(:)
      logical, allocatable :: vibrates(:)

      associate (b => self%basis(of_first_harmonic(self)))
         vibrates = b%k_i > 0.0_wp .and. b%m_i > 0.0_wp
         frequency = sqrt(pack(b%k_i, vibrates)/pack(b%m_i, vibrates))
         half_width = 0.5_wp*pack(b%c_i, vibrates)/pack(b%m_i, vibrates)
      end associate
   end subroutine held_modes

   !> Sums of the absolute values in a row of Z_n q: the size of its round-off.
   pure subroutine magnitudes(self, state, h, amplitude, sums)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      real(wp), intent(in) :: amplitude(:)
      real(wp), intent(out) :: sums(:)
      real(wp) :: theta
      integer :: j, m

      m = self%n_coordinates
      theta = self%harmonic(h)*abs(cmplx(self%harmonic(h)*state%omega**2, &
                                         state%omega*state%self_excitation, wp))
      sums = 0.0_wp
      associate (b => self%basis(self%basis_of(h))%blocks)
         do j = 1, m
            sums = sums + (abs(b(:m, j, 1)) + theta*abs(b(:m, j, 2)))*amplitude(j)
         end do
      end associate
      associate (b => self%basis(self%basis_of(h)))
         if (.not. allocated(b%speed)) return
         ! Damping in proportion to it is small beside it.
         do j = 1, b%speed%n_powers()
            sums = sums + (state%omega/b%speed%order)**(2*j)* &
                   matmul(abs(b%speed%stiffness(:, :, j)), amplitude(:m))
         end do
      end associate
   end subroutine magnitudes

   subroutine observed_slope(self, state, q, slope)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(out) :: slope(:, :)
      integer :: h

      slope = (0.0_wp, 0.0_wp)
      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            if (self%harmonic(h) == 0) cycle
            call observed_sector_slope(self%basis(self%basis_of(h)), state%point(h), &
                                       slopes_of(state%point(h), 0.0_wp, by_frequency), &
                                       state%load_factor(h), q(:, h), slope(:, h))
         end do
      end select
   end subroutine observed_slope

   subroutine load_work(self, state, h, q, work, slope, row)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: work
      complex(wp), intent(out), optional :: slope, row(:)

      select type (state)
      type is (cyclic_state)
         call work_of_sector(self%basis(self%basis_of(h)), state%point(h), &
                             slopes_of(state%point(h), 0.0_wp, by_frequency), &
                             state%load_factor(h), q, work, slope, row)
      end select
   end subroutine load_work

   !> Of one sector.
   real(wp) function structural_work(self, state, q) result(work)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      integer :: h

      work = 0.0_wp
      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            work = work + structural_work_of(self%basis(self%basis_of(h)), state%point(h), &
                                             state%omega, state%load_factor(h), q(:, h))
         end do
      end select
   end function structural_work

   !> Coordinates, and as many condensed unknowns as any nodal diameter has.
   pure integer function whole_size(self)
      class(cyclic_structure), intent(in) :: self

      whole_size = self%n_coordinates + maxval(self%basis%n_internal)
   end function whole_size

   subroutine condense_field(self, state, field, load)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: load(:, :)
      integer :: h

      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            call condense_sector(self%basis(self%basis_of(h)), state%point(h), field(:, h), &
                                 load(:, h))
         end do
      end select
   end subroutine condense_field

   subroutine complete_field(self, state, q, load, field)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(in), optional :: load(:, :)
      complex(wp), intent(out) :: field(:, :)
      integer :: h

      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            associate (basis => self%basis(self%basis_of(h)), factor => state%load_factor(h))
               if (present(load)) then
                  call complete_sector(basis, state%point(h), factor, q(:, h), field(:, h), &
                                       load(:, h))
               else
                  call complete_sector(basis, state%point(h), factor, q(:, h), field(:, h))
               end if
            end associate
         end do
      end select
   end subroutine complete_field

   !> Of sector 0.
   pure subroutine observe_field(self, field, observed)
      class(cyclic_structure), intent(in) :: self
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: observed(:, :)
      integer :: h

      do h = 1, size(self%harmonic)
         call observe_sector(self%basis(self%basis_of(h)), harmonic_point( &
                             harmonic=self%harmonic(h), conjugated=self%conjugated(h)), &
                             field(:, h), observed(:, h))
      end do
   end subroutine observe_field

   pure subroutine change_field(self, state, number, field, slope)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: number
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: slope(:, :)
      integer :: h

      select type (state)
      type is (cyclic_state)
         do h = 1, size(self%harmonic)
            call change_sector(self%basis(self%basis_of(h)), state%point(h), &
                               state%load_factor(h), number, field(:, h), slope(:, h))
         end do
      end select
   end subroutine change_field

   !> Work of the loads of harmonic 1.
   pure complex(wp) function field_work(self, state, field) result(work)
      class(cyclic_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      integer :: h

      work = (0.0_wp, 0.0_wp)
      h = findloc(self%harmonic, 1, dim=1)
      if (h == 0) return
      select type (state)
      type is (cyclic_state)
         work = work_on_sector(self%basis(self%basis_of(h)), state%point(h), &
                               state%load_factor(h), field(:, h))
      end select
   end function field_work

end module fw_cyclic_structure
