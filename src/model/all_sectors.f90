!> All sectors of a tuned cyclic structure at once, for contact that differs from sector to sector.
!> Coordinates are those of one sector, sector after sector (kept modes of all sectors behind): the
!> structure is the same in all of them, so that Z_n is block circulant, a matrix Z_n,k for each
!> nodal diameter k = 0 .. N - 1,
!>
!>   Z_n q = sum_k z_k**j Z_n,k Q_k,   Q_k = 1/N sum_j z_k**-j q_j,   z_k = exp(-2 pi i k/N),
!>
!> condensed as those of a wave are. k and N - k differ in every harmonic above 0, where the
!> amplitudes of the sectors are complex. The load is a wave. What sectors have beside each other
!> acts on rows of each (fw_ring_deviation), its mean in every wave.
module fw_all_sectors
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_cyclic_data, only: cyclic_type
   use fw_cyclic_relative, only: cyclic_relative
   use fw_deviation, only: deviation_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_lapack, only: zgemv
   use fw_model, only: model_type
   use fw_ring_deviation, only: ring_deviation
   use fw_ring_fft, only: ring_fft
   use fw_sector_means, only: sector_means
   use fw_sector_reduction, only: sector_reduction
   use fw_sector_uncondensed, only: add_speed_slope, add_uncondensed
   use fw_sector_stiffness, only: derive_sector, form_sector, harmonic_point, slopes_of
   use fw_structure_operator, only: by_frequency, lay_out_coefficients, structure_operator, &
      structure_state
   use fw_text, only: to_text
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: all_sectors, new_all_sectors
   ! For the submodules alone, which gfortran lets reach no private procedures.
   public :: basis_of, waves_of

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

   !> All sectors of a disk: waves of the tuned disk, and beside them what makes sectors differ.
   type, extends(structure_operator) :: all_sectors
      type(cyclic_type), private :: cyclic
      !> Bases of k = 0 .. N/2; those of N - k are their conjugates.
      type(sector_reduction), allocatable, private :: basis(:)
      type(sector_means), private :: means
      !> Over the sectors, of the coordinates and of what is observed.
      type(ring_fft), private :: ring, observed_ring
      !> Not allocated where the sectors are alike.
      type(ring_deviation), allocatable, private :: deviation
   contains
      procedure :: new_state
      procedure :: at
      procedure :: multiply
      procedure :: restrict
      procedure :: multiply_active
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
      procedure :: wave_block
      procedure :: find_waves
      procedure :: add_waves
      procedure :: n_own
      procedure :: own_rows
      procedure :: own_block
      procedure :: read_own
      procedure :: add_own
      procedure :: own_slope
      procedure :: take_deviation
      procedure :: pulls_observed
      procedure :: pull_observed
      procedure :: is_modal
      procedure :: drop_round_off
      procedure :: answer_by_modes
   end type all_sectors

   type, extends(structure_state) :: all_sectors_state
      type(harmonic_point), allocatable, private :: point(:, :)
      !> Z_n,k (n_slots, n_slots, n_sectors, n_retained) [force/length].
      complex(wp), allocatable, private :: wave(:, :, :, :)
      !> Scratch of products: coordinates (n_coordinates, n_retained), and those of the sectors and
      !> of the waves (n_slots, n_sectors, n_retained).
      complex(wp), allocatable, private :: amplitude(:, :), in(:, :, :), out(:, :, :)
      !> What sectors have beside their mean (n_own, n_own, n_sectors, n_retained), and the rows
      !> that it acts on (n_own, n_sectors, n_retained).
      complex(wp), allocatable, private :: own(:, :, :, :), rows(:, :, :)
      !> Observed quantities of a sector by its waves, of a frequency (n_observed of a sector,
      !> n_slots, n_sectors, n_retained).
      complex(wp), allocatable, private :: observe(:, :, :, :)
      real(wp), private :: observe_at = -1.0_wp
   end type all_sectors_state

   ! Its bases (fw_all_sectors_setup).
   interface
      !> Bases of all nodal diameters, and transforms between sectors and waves.
      module subroutine new_all_sectors(model, relative, harmonic, omega_range, means, self, &
                                        error, tuned, keep_all)
         type(model_type), intent(in) :: model
         type(cyclic_relative), intent(in) :: relative
         !> The same without the rows in which sectors differ.
         type(cyclic_relative), intent(in), optional :: tuned
         !> Condense nothing, for a nonlinear mode.
         logical, intent(in), optional :: keep_all
         !> Harmonics in use.
         integer, intent(in) :: harmonic(:)
         !> Lowest and highest frequency that will be asked for [rad/s].
         real(wp), intent(in) :: omega_range(2)
         !> Of fw_sector_means.
         integer, intent(in) :: means
         type(all_sectors), intent(out) :: self
         type(error_type), allocatable, intent(out) :: error
      end subroutine new_all_sectors
   end interface

   ! Matrices of all sectors (fw_all_sectors_blocks).
   interface
      !> Z_n of all sectors: block circulant, formed for small rings only.
      module subroutine block_of_all(self, state, h, matrix)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         complex(wp), intent(out), contiguous :: matrix(:, :)
      end subroutine block_of_all

      module subroutine block_in_use(self, state, h, matrix)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         complex(wp), intent(out), contiguous :: matrix(:, :)
      end subroutine block_in_use

      !> What flows in pseudo-time would take, which cyclic structures do not have.
      pure module subroutine mass(self, matrix)
         class(all_sectors), intent(in) :: self
         real(wp), intent(out) :: matrix(:, :)
      end subroutine mass

      !> Coriolis with the damping, the air with the stiffness, as of a wave.
      pure module subroutine parts(self, h, stiffness, mass, damping, observe)
         class(all_sectors), intent(in) :: self
         integer, intent(in) :: h
         complex(wp), intent(out) :: stiffness(:, :), mass(:, :), damping(:, :), observe(:, :)
      end subroutine parts
   end interface

   ! What leaves the coordinates (fw_all_sectors_observed).
   interface
      !> Observed quantities of a sector, sector after sector.
      module subroutine recover(self, state, q, observed)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(inout) :: state
         complex(wp), intent(in), contiguous :: q(:, :)
         complex(wp), intent(out), contiguous :: observed(:, :)
      end subroutine recover

      !> Back from what is observed, wave by wave.
      module subroutine pull_observed(self, state, observed, slope)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(inout) :: state
         complex(wp), intent(in) :: observed(:, :)
         complex(wp), intent(out) :: slope(:, :)
      end subroutine pull_observed

      !> Derivative of what is observed by the frequency, wave by wave.
      module subroutine observed_slope(self, state, q, slope)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(in) :: state
         complex(wp), intent(in) :: q(:, :)
         complex(wp), intent(out) :: slope(:, :)
      end subroutine observed_slope

      !> Take off what couples condensed modes by round-off alone, as where these give the damping:
      !> parts of the damping of each two of them below 1e-9.
      pure module subroutine drop_round_off(self)
         class(all_sectors), intent(inout) :: self
      end subroutine drop_round_off

      !> Of sectors that are condensed whole (is_modal): observed quantities of sector j by a force
      !> along each of the last of them in sector 0, and by the load, of the first harmonic.
      module subroutine answer_by_modes(self, omega, by_force, by_load, failed)
         class(all_sectors), intent(in) :: self
         !> [rad/s]
         real(wp), intent(in) :: omega
         !> (n_observed of a sector, n_forced, n_sectors), (n_observed of a sector, n_sectors).
         complex(wp), intent(out) :: by_force(:, :, :), by_load(:, :)
         logical, intent(out) :: failed
      end subroutine answer_by_modes

      !> Of all sectors: the load is one wave, on which only that wave of the motion works.
      module subroutine load_work(self, state, h, q, work, slope, row)
         class(all_sectors), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         complex(wp), intent(in) :: q(:)
         complex(wp), intent(out) :: work
         complex(wp), intent(out), optional :: slope, row(:)
      end subroutine load_work
   end interface

contains

   subroutine new_state(self, state)
      class(all_sectors), intent(in) :: self
      class(structure_state), allocatable, intent(out) :: state
      type(all_sectors_state), allocatable :: all
      integer :: h, k, m, n, nh

      m = self%n_slots
      n = self%n_alike
      nh = size(self%harmonic)
      allocate (all)
      allocate (all%point(n, nh))
      do h = 1, nh
         all%point(:, h)%harmonic = self%harmonic(h)
         all%point(:, h)%conjugated = [(2*k > n, k=0, n - 1)]
         all%point(:, h)%is_loaded = [(modulo(self%cyclic%nodal_diameter(self%harmonic(h)) - k, n) &
                                       == 0, k=0, n - 1)]
      end do
      allocate (all%wave(m, m, n, nh), all%in(m, n, nh), all%out(m, n, nh), source=zero)
      allocate (all%amplitude(self%n_coordinates, nh), source=zero)
      associate (r => self%n_own())
         allocate (all%own(r, r, n, nh), all%rows(r, n, nh), source=zero)
      end associate
      call all%reserve_loads(self%n_coordinates, nh)
      allocate (all%used(self%n_coordinates), source=0)
      call move_alloc(all, state)
   end subroutine new_state

   subroutine at(self, state, omega, self_excitation, error)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: omega, self_excitation
      type(error_type), allocatable, intent(out) :: error
      integer :: h, n_failed

      if (abs(omega - state%omega) <= 0.0_wp .and. &
          abs(self_excitation - state%self_excitation) <= 0.0_wp) return
      n_failed = 0
      ! Nowhere until it has come there, as a wave.
      state%omega = -1.0_wp
      select type (state)
      type is (all_sectors_state)
         do h = 1, size(self%harmonic)
            state%point(:, h)%s = self%harmonic(h)*omega
            state%point(:, h)%theta = cmplx((self%harmonic(h)*omega)**2, &
                                            self%harmonic(h)*omega*self_excitation, wp)
         end do
         if (self%n_coordinates > 0) call form_all(self, state, omega, n_failed)
         call state%scale_loads()
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

   !> Z_n,k of every harmonic and nodal diameter; how many could not be condensed.
   subroutine form_all(self, state, omega, n_failed)
      class(all_sectors), intent(in) :: self
      type(all_sectors_state), intent(inout) :: state
      real(wp), intent(in) :: omega
      integer, intent(inout) :: n_failed
      complex(wp), allocatable :: load(:), loads(:, :)
      integer :: h, k, task
      logical :: failed

      allocate (load(self%n_slots), loads(self%n_slots, size(self%harmonic)))
      !$omp parallel do default(none) shared(self, state, omega, loads) &
      !$omp private(h, k, task, failed) &
      !$omp firstprivate(load) reduction(+:n_failed) schedule(dynamic) &
      !$omp if(self%n_coordinates >= coordinates_for_threads)
      do task = 0, size(self%harmonic)*self%n_alike - 1
         h = task/self%n_alike + 1
         k = modulo(task, self%n_alike)
         if (is_mirrored(self, k, state%point(k + 1, h))) cycle
         call form_sector(self%basis(basis_of(self, k)), state%point(k + 1, h), &
                          state%wave(:, :, k + 1, h), load, failed)
         call add_uncondensed(self%basis(basis_of(self, k)), self%harmonic(h), &
                              2*k > self%n_alike, omega, state%wave(:, :, k + 1, h), load)
         if (failed) n_failed = n_failed + 1
         if (state%point(k + 1, h)%is_loaded) loads(:, h) = load
      end do
      !$omp end parallel do
      do h = 1, size(self%harmonic)
         do k = 0, self%n_alike - 1
            ! K, M and C of N - k are the conjugates of Hermitian matrices, their transposes.
            if (is_mirrored(self, k, state%point(k + 1, h))) state%wave(:, :, k + 1, h) = &
               transpose(state%wave(:, :, self%n_alike - k + 1, h))
         end do
         if (allocated(self%deviation)) then
            call self%deviation%form(1.0_wp, state%point(1, h)%theta, state%point(1, h)%s, &
                                     state%own(:, :, :, h))
            call self%deviation%add_mean(state%own(:, :, :, h), state%wave(:, :, :, h))
         end if
         ! The load is delayed from sector to sector.
         k = self%cyclic%nodal_diameter(self%harmonic(h))
         do task = 1, self%n_alike
            state%unit_load(self%coordinate(:, task), h) = &
               self%cyclic%factor(k, task - 1)*loads(:, h)
         end do
      end do
   end subroutine form_all

   !> Whether the matrix is the transpose of the one of the wave the other way.
   pure logical function is_mirrored(self, k, point)
      class(all_sectors), intent(in) :: self
      integer, intent(in) :: k
      type(harmonic_point), intent(in) :: point

      is_mirrored = 2*k > self%n_alike .and. .not. point%is_loaded .and. &
                    .not. self%basis(basis_of(self, k))%has_whirl()
      associate (basis => self%basis(basis_of(self, k)))
         if (allocated(basis%speed)) is_mirrored = is_mirrored .and. .not. &
            (allocated(basis%speed%coriolis) .or. allocated(basis%speed%circulatory))
      end associate
   end function is_mirrored

   !> The basis of nodal diameter k = 0 .. N - 1.
   pure integer function basis_of(self, k) result(basis)
      class(all_sectors), intent(in) :: self
      integer, intent(in) :: k

      basis = min(k, self%n_alike - k) + 1
   end function basis_of

   !> Waves of the coordinates of one harmonic, of amplitudes in `in` to those in `out`.
   subroutine multiply_waves(self, state)
      class(all_sectors), intent(in) :: self
      type(all_sectors_state), intent(inout) :: state
      integer :: h, k, m

      m = self%n_slots
      !$omp parallel do default(none) shared(self, state, m) private(h, k) &
      !$omp if(self%n_coordinates >= coordinates_for_threads)
      do h = 1, size(self%harmonic)
         if (allocated(self%deviation)) call self%deviation%read_rows(state%in(:, :, h), &
                                                                      state%rows(:, :, h))
         call self%ring%find_waves(state%in(:, :, h), state%out(:, :, h))
         do k = 1, self%n_alike
            call zgemv('N', m, m, one, state%wave(1, 1, k, h), m, state%out(1, k, h), 1, zero, &
                       state%in(1, k, h), 1)
         end do
         call self%ring%add_waves(state%in(:, :, h), state%out(:, :, h))
         if (allocated(self%deviation)) call self%deviation%add_rows( &
            state%rows(:, :, h), state%out(:, :, h), state%own(:, :, :, h))
      end do
      !$omp end parallel do
   end subroutine multiply_waves

   !> Waves of the coordinates of all sectors.
   subroutine find_waves(self, sectors, waves)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(inout), contiguous :: sectors(:, :), waves(:, :)

      call self%ring%find_waves(sectors, waves)
   end subroutine find_waves

   !> Coordinates of all sectors from their waves.
   subroutine add_waves(self, waves, sectors)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(inout), contiguous :: waves(:, :), sectors(:, :)

      call self%ring%add_waves(waves, sectors)
   end subroutine add_waves

   !> Waves of a harmonic from its amplitudes (n_coordinates).
   subroutine waves_of(self, amplitude, waves)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(in) :: amplitude(:)
      complex(wp), intent(inout), contiguous :: waves(:, :)
      complex(wp), allocatable :: sectors(:, :)
      integer :: j

      allocate (sectors(self%n_slots, self%n_alike))
      do j = 1, self%n_alike
         sectors(:, j) = amplitude(self%coordinate(:, j))
      end do
      call self%ring%find_waves(sectors, waves)
   end subroutine waves_of

   subroutine multiply(self, state, q, product)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: product(*)
      integer :: j, m

      m = self%n_coordinates
      select type (state)
      type is (all_sectors_state)
         call amplitudes_of(self%harmonic, self%column, m, q, m, state%amplitude)
         do j = 1, self%n_alike
            state%in(:, j, :) = state%amplitude(self%coordinate(:, j), :)
         end do
         call multiply_waves(self, state)
         do j = 1, self%n_alike
            state%amplitude(self%coordinate(:, j), :) = state%out(:, j, :)
         end do
         call coefficients_of(self%harmonic, self%column, m, m, state%amplitude, product)
      end select
   end subroutine multiply

   !> Products are of the coordinates in use from now on.
   subroutine restrict(self, state, n_active, n_used, used)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: n_active, n_used
      integer, intent(in) :: used(:)

      associate (unused => self)
      end associate
      state%n_active = n_active
      state%n_used = n_used
      state%used(:n_used) = used(:n_used)
   end subroutine restrict

   !> Of all coordinates: the product does not become less with fewer of them.
   subroutine multiply_active(self, state, v, product)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)
      integer :: j, m

      m = self%n_coordinates
      select type (state)
      type is (all_sectors_state)
         call amplitudes_of(self%harmonic, self%column, state%n_active, v, m, state%amplitude)
         state%in = zero
         do j = 1, state%n_active
            state%in(self%slot(state%used(j)), self%sector(state%used(j)), :) = &
               state%amplitude(j, :)
         end do
         call multiply_waves(self, state)
         do j = 1, state%n_used
            state%amplitude(j, :) = state%out(self%slot(state%used(j)), &
                                              self%sector(state%used(j)), :)
         end do
         call coefficients_of(self%harmonic, self%column, state%n_used, m, state%amplitude, product)
      end select
   end subroutine multiply_active

   !> Z_n of the h-th harmonic in nodal diameter k.
   subroutine wave_block(self, state, h, k, matrix)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h, k
      complex(wp), intent(out), contiguous :: matrix(:, :)

      associate (unused => self)
      end associate
      select type (state)
      type is (all_sectors_state)
         matrix = state%wave(:, :, k + 1, h)
      end select
   end subroutine wave_block

   !> The same for all sectors: the mean over the nodal diameters.
   complex(wp) function diagonal(self, state, h, coordinate)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h, coordinate

      diagonal = zero
      select type (state)
      type is (all_sectors_state)
         diagonal = sum(state%wave(self%slot(coordinate), self%slot(coordinate), :, h))/self%n_alike
      end select
   end function diagonal

   !> Wave by wave: the derivative of Z q - F by the frequency, or by the self-excitation.
   subroutine derivative(self, state, parameter, q, slope)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: parameter
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      complex(wp), allocatable :: amplitude(:, :), waves(:, :), slopes(:, :)
      complex(wp), allocatable :: rows(:, :), own(:, :, :)
      type(harmonic_point) :: by
      integer :: h, k, m

      m = self%n_coordinates
      allocate (amplitude(m, size(self%harmonic)))
      allocate (waves(self%n_slots, self%n_alike), slopes(self%n_slots, self%n_alike))
      call amplitudes_of(self%harmonic, self%column, m, q, m, amplitude)
      if (allocated(self%deviation)) allocate (rows(self%n_own(), self%n_alike), &
                                               own(self%n_own(), self%n_own(), self%n_alike))
      select type (state)
      type is (all_sectors_state)
         do h = 1, size(self%harmonic)
            if (allocated(self%deviation)) then
               do k = 1, self%n_alike
                  waves(:, k) = amplitude(self%coordinate(:, k), h)
               end do
               call self%deviation%read_rows(waves, rows)
               by = slopes_of(state%point(1, h), state%self_excitation, parameter)
               call self%deviation%form(0.0_wp, by%theta, by%s, own)
            end if
            call waves_of(self, amplitude(:, h), waves)
            do k = 0, self%n_alike - 1
               associate (point => state%point(k + 1, h))
                  call derive_sector(self%basis(basis_of(self, k)), point, &
                                     slopes_of(point, state%self_excitation, parameter), &
                                     state%load_factor(h), waves(:, k + 1), slopes(:, k + 1))
                  if (parameter == by_frequency) call add_speed_slope( &
                     self%basis(basis_of(self, k)), self%harmonic(h), 2*k > self%n_alike, &
                     state%omega, merge(state%load_factor(h), 0.0_wp, point%is_loaded), &
                     waves(:, k + 1), slopes(:, k + 1))
               end associate
            end do
            call self%ring%add_waves(slopes, waves)
            if (allocated(self%deviation)) call self%deviation%add_rows(rows, waves, own)
            do k = 1, self%n_alike
               amplitude(self%coordinate(:, k), h) = waves(:, k)
            end do
         end do
      end select
      call coefficients_of(self%harmonic, self%column, m, m, amplitude, slope)
   end subroutine derivative

   !> Whether everything is condensed, with nothing beside K, M and C.
   pure logical function is_modal(self)
      class(all_sectors), intent(in) :: self
      integer :: k

      is_modal = self%n_slots == 0
      do k = 1, size(self%basis)
         is_modal = is_modal .and. .not. (allocated(self%basis(k)%structural) .or. &
                                          allocated(self%basis(k)%circulatory) .or. &
                                          allocated(self%basis(k)%speed))
      end do
   end function is_modal

   !> Rows of a sector by which it deviates from the tuned one.
   pure integer function n_own(self)
      class(all_sectors), intent(in) :: self

      n_own = 0
      if (allocated(self%deviation)) n_own = self%deviation%n_rows
   end function n_own

   !> Those rows in the coordinates of the wave k.
   subroutine own_rows(self, k, rows)
      class(all_sectors), intent(in) :: self
      integer, intent(in) :: k
      complex(wp), intent(out) :: rows(:, :)

      rows = zero
      if (allocated(self%deviation)) rows(:, :size(self%deviation%wave, 2)) = &
         self%deviation%wave(:, :, k + 1)
   end subroutine own_rows

   !> The deviations of all sectors from the tuned dynamic stiffness, harmonic h.
   subroutine own_block(self, state, h, matrix)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out) :: matrix(:, :, :)

      associate (unused => self)
      end associate
      select type (state)
      type is (all_sectors_state)
         matrix = state%own(:, :, :, h)
      end select
   end subroutine own_block

   !> Values of those rows, of coordinates of all sectors.
   subroutine read_own(self, sectors, rows)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(in) :: sectors(:, :)
      complex(wp), intent(out) :: rows(:, :)

      rows = zero
      if (allocated(self%deviation)) call self%deviation%read_rows(sectors, rows)
   end subroutine read_own

   !> Their transpose: forces on the rows to forces on the coordinates.
   subroutine add_own(self, rows, sectors)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(in) :: rows(:, :)
      complex(wp), intent(inout) :: sectors(:, :)

      if (allocated(self%deviation)) call self%deviation%add_rows(rows, sectors)
   end subroutine add_own

   !> The rows of all sectors in every harmonic, through the changed matrices.
   subroutine own_slope(self, state, of, number, q, slope)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: of, number
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      complex(wp), allocatable :: amplitude(:, :), sectors(:, :), rows(:, :), own(:, :, :)
      integer :: h, j, m

      m = self%n_coordinates
      allocate (amplitude(m, size(self%harmonic)), sectors(self%n_slots, self%n_alike))
      allocate (rows(self%n_own(), self%n_alike), own(self%n_own(), self%n_own(), self%n_alike))
      call amplitudes_of(self%harmonic, self%column, m, q, m, amplitude)
      select type (state)
      type is (all_sectors_state)
         do h = 1, size(self%harmonic)
            do j = 1, self%n_alike
               sectors(:, j) = amplitude(self%coordinate(:, j), h)
            end do
            amplitude(:, h) = zero
            if (.not. allocated(self%deviation)) cycle
            call self%deviation%read_rows(sectors, rows)
            call self%deviation%form_change(of, number, state%point(1, h)%theta, &
                                            state%point(1, h)%s, own)
            sectors = zero
            call self%deviation%add_rows(rows, sectors, own)
            do j = 1, self%n_alike
               amplitude(self%coordinate(:, j), h) = sectors(:, j)
            end do
         end do
      end select
      call coefficients_of(self%harmonic, self%column, m, m, amplitude, slope)
   end subroutine own_slope

   !> Nothing tells the two directions apart.
   pure logical function pulls_observed(self)
      class(all_sectors), intent(in) :: self
      integer :: k

      pulls_observed = .not. any([(self%basis(k)%has_whirl(), k=1, size(self%basis))])
   end function pulls_observed

   !> Other deviations of the same rows, as a parameter that moves or the next disk has them.
   pure subroutine take_deviation(self, deviation)
      class(all_sectors), intent(inout) :: self
      type(deviation_type), intent(in) :: deviation

      if (allocated(self%deviation)) self%deviation%of = deviation
   end subroutine take_deviation

   !> In the mean over the sectors, which are alike but for small deviations.
   pure real(wp) function static_stiffness(self, coordinate)
      class(all_sectors), intent(in) :: self
      integer, intent(in) :: coordinate

      static_stiffness = self%means%static_stiffness(self%slot(coordinate))
   end function static_stiffness

   pure subroutine split(self, coordinate, limit, m, c, k)
      class(all_sectors), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k

      call self%means%split(self%slot(coordinate), limit, m, c, k)
   end subroutine split

   !> In the nodal diameter of the first harmonic.
   pure subroutine held_modes(self, frequency, half_width)
      class(all_sectors), intent(in) :: self
      real(wp), allocatable, intent(out) :: frequency(:), half_width(:)
      logical, allocatable :: vibrates(:)

      associate (b => self%basis(abs(self%cyclic%nodal_diameter(1)) + 1))
         vibrates = b%k_i > 0.0_wp .and. b%m_i > 0.0_wp
         frequency = sqrt(pack(b%k_i, vibrates)/pack(b%m_i, vibrates))
         half_width = 0.5_wp*pack(b%c_i, vibrates)/pack(b%m_i, vibrates)
      end associate
   end subroutine held_modes

   !> Of the wave with the largest entries: the sectors are not told apart.
   pure subroutine magnitudes(self, state, h, amplitude, sums)
      class(all_sectors), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      real(wp), intent(in) :: amplitude(:)
      real(wp), intent(out) :: sums(:)
      real(wp) :: largest(self%n_slots, self%n_slots), entries(self%n_slots, self%n_slots), theta
      integer :: j, k, m

      m = self%n_slots
      theta = self%harmonic(h)*abs(cmplx(self%harmonic(h)*state%omega**2, &
                                         state%omega*state%self_excitation, wp))
      largest = 0.0_wp
      do k = 1, size(self%basis)
         associate (b => self%basis(k)%blocks)
            entries = abs(b(:m, :, 1)) + theta*abs(b(:m, :, 2))
         end associate
         if (allocated(self%basis(k)%speed)) then
            associate (speed => self%basis(k)%speed)
               do j = 1, speed%n_powers()
                  entries = entries + (state%omega/speed%order)**(2*j)*abs(speed%stiffness(:, :, j))
               end do
            end associate
         end if
         largest = max(largest, entries)
      end do
      do j = 1, self%n_alike
         sums(self%coordinate(:, j)) = matmul(largest, amplitude(self%coordinate(:, j)))
      end do
   end subroutine magnitudes

end module fw_all_sectors
