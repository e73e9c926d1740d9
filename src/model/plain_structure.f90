!> One structure, condensed to its relative coordinates. u = T_q q + T_i x: the relative coordinates
!> q with their static constraint modes, and modes x of the structure with q held, so that the
!> internal block is diagonal (but for damping that is not proportional). Then, with s = n omega,
!>
!>   D_j = k_j - theta_n m_j + i s c_j,   Z_qi = K_qi - theta_n M_qi + i s C_qi,
!>   Z_r = Z_qq - Z_qi D^-1 Z_qi^T,   F_r = F_q - Z_qi D^-1 F_i,   x = D^-1 (F_i - Z_qi^T q).
!>
!> This is (B Z^-1 B^T)^-1 in exact arithmetic, and needs neither a regular mass nor a stiffness
!> that holds the structure without its contact. At an undamped mode of the held structure Z_r has
!> a pole; internal modes that a harmonic of the given range of frequencies may hit so are kept as
!> coordinates.
!>
!> Of many coordinates no matrix Z_r is formed: K, M and C are real and the same for all harmonics
!> and frequencies, so that one real product serves all harmonics (fw_real_products). Complex
!> matrices of few coordinates stay in the cache, and need fewer operations: there Z_r is formed
!> once at each frequency (fw_formed_stiffness).
module fw_plain_structure
   use fw_kinds, only: wp
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_input
   use fw_complex_form, only: amplitudes_of
   use fw_complex_form, only: coefficients_of
   use fw_formed_stiffness, only: form_block
   use fw_formed_stiffness, only: formed_stiffness
   use fw_field_slopes, only: follow_frequency
   use fw_field_slopes, only: work_of_load
   use fw_formed_stiffness, only: harmonic_load
   use fw_formed_stiffness, only: load_slope
   use fw_dynamic_part, only: dynamic_part
   use fw_dynamic_part, only: find_dynamic_part
   use fw_internal_block, only: internal_block
   use fw_model, only: model_type
   use fw_real_products, only: harmonic_factors
   use fw_real_products, only: packed_blocks
   use fw_real_products, only: real_products
   use fw_reduction, only: held_basis
   use fw_reduction, only: reduction_type
   use fw_reduction, only: new_reduction
   use fw_relative, only: relative_type
   use fw_split, only: split_coordinate
   use fw_split_product, only: split_product
   use fw_structure_operator, only: by_frequency
   use fw_structure_operator, only: lay_out_coefficients
   use fw_structure_operator, only: structure_operator
   use fw_structure_operator, only: structure_state
   use fw_text, only: to_text
   use fw_whole_field, only: complete_harmonic
   use fw_whole_field, only: condense_harmonic
   implicit none (type, external)
   private

   public :: plain_structure, new_plain_structure

   type, extends(structure_operator) :: plain_structure
      type(reduction_type) :: basis
      !> Whether Z_r is formed at each frequency.
      logical :: forms_blocks = .true.
      !> All rows and columns for real products, where it is not.
      type(packed_blocks) :: packed
      !> What vibration adds to the static stiffness; of rank 0 where Z_r is formed.
      type(dynamic_part) :: dynamic
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
      procedure :: scale_loads
      procedure :: observed_slope
      procedure :: load_work
      procedure :: whole_size
      procedure :: condense_field
      procedure :: complete_field
      procedure :: observe_field
      procedure :: observe_back
      procedure :: change_field
      procedure :: field_work
      procedure :: split_rank
      procedure :: multiply_nearly
      procedure :: static_block
      procedure :: dynamic_block
   end type plain_structure

   type, extends(structure_state) :: plain_state
      type(harmonic_factors) :: factors
      !> The one or the other.
      type(formed_stiffness) :: formed
      type(real_products) :: products
      type(split_product) :: split
      !> Whether rows in use are those of the present frequency.
      logical :: restricted = .false.
   end type plain_state

   !> Entries of all complex matrices from which real products pay (8 MB, more than caches near
   !> a processor hold), and internal modes for each coordinate up to which they do. Measured by
   !> bench/speed/products.f90, and on sweeps of 48 and 96 pairs.
   real(wp), parameter :: most_entries = 5.0e5_wp, most_internal = 0.5_wp

contains

   !> Prepare the condensation of a model to its relative coordinates.
   subroutine new_plain_structure(model, relative, harmonic, omega_range, self, error, keep_all, &
                                  forms_blocks, held)
      type(model_type), intent(in) :: model
      type(relative_type), intent(in) :: relative
      !> Harmonics in use.
      integer, intent(in) :: harmonic(:)
      !> Lowest and highest frequency that will be asked for [rad/s].
      real(wp), intent(in) :: omega_range(2)
      type(plain_structure), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Condense nothing: every internal mode becomes a coordinate.
      logical, intent(in), optional :: keep_all
      !> Form Z_r at each frequency, or never; chosen by size where it is not given.
      logical, intent(in), optional :: forms_blocks
      !> Modes of the model with these relative coordinates held, see new_reduction.
      type(held_basis), intent(inout), optional :: held
      integer :: j

      call new_reduction(model, relative, harmonic, omega_range, self%basis, error, keep_all, &
                         held)
      if (allocated(error)) return
      self%knows_field = .true.
      self%n_coordinates = self%basis%n_coordinates
      self%n_relative = relative%n_coordinates
      self%kept = self%basis%kept
      self%n_observed = size(self%basis%observe_q, 1)
      call lay_out_coefficients(self, harmonic)
      self%forms_blocks = real(self%n_coordinates, wp)**2*size(harmonic) < most_entries .or. &
                          self%basis%n_internal > most_internal*self%n_coordinates
      if (present(forms_blocks)) self%forms_blocks = forms_blocks
      if (self%forms_blocks) return
      call self%packed%pack_blocks(self%basis, self%n_coordinates, self%n_coordinates, &
                                   [(j, j=1, self%n_coordinates)])
      ! Kept modes have no stiffness of their own to trust.
      if (size(self%kept) == 0) call find_dynamic_part(self%basis, &
                                     maxval(harmonic)*omega_range(2), self%dynamic)
   end subroutine new_plain_structure

   !> Room for one thread: formed matrices, or what real products need.
   subroutine new_state(self, state)
      class(plain_structure), intent(in) :: self
      class(structure_state), allocatable, intent(out) :: state
      type(plain_state), allocatable :: plain
      integer :: m, nh

      m = self%n_coordinates
      nh = size(self%harmonic)
      allocate (plain)
      plain%factors%harmonic = self%harmonic
      plain%factors%column = self%column
      allocate (plain%factors%theta(nh), source=(0.0_wp, 0.0_wp))
      allocate (plain%factors%s(nh), source=0.0_wp)
      call plain%reserve_loads(m, nh)
      allocate (plain%used(m), source=0)
      if (self%forms_blocks) then
         call plain%formed%reserve(m, nh)
      else
         call plain%products%reserve(self%basis, nh, self%n_coefficients)
      end if
      call move_alloc(plain, state)
   end subroutine new_state

   !> Only an internal mode without damping can fail: D_j = 0 at its own frequency.
   subroutine at(self, state, omega, self_excitation, error)
      class(plain_structure), intent(in) :: self
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
      type is (plain_state)
         call go_to(self, state, omega, self_excitation, n_failed)
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

   !> Factors theta_n and s_n of all harmonics, D factored, loads condensed, and Z_r where it is
   !> formed.
   subroutine go_to(self, state, omega, self_excitation, n_failed)
      type(plain_structure), intent(in) :: self
      type(plain_state), intent(inout) :: state
      real(wp), intent(in) :: omega, self_excitation
      integer, intent(out) :: n_failed

      n_failed = 0
      associate (f => state%factors)
         f%s = self%harmonic*omega
         f%theta = cmplx(f%s**2, f%s*self_excitation, wp)
         ! A structure without joint: nothing is condensed, and its motion is recovered from loads
         ! alone.
         if (self%n_coordinates == 0) return
         if (self%forms_blocks) then
            call state%formed%form(self%basis, f%harmonic, f%theta, f%s, state%unit_load, n_failed)
            state%restricted = .false.
         else
            call state%products%factor(self%basis, f, n_failed)
            call condense_load(self, f, state%products, state%unit_load)
            if (self%dynamic%rank > 0) call find_dynamic(self, f, state)
         end if
         call state%scale_loads()
      end associate
   end subroutine go_to

   !> S_n of all harmonics.
   subroutine find_dynamic(self, factors, state)
      type(plain_structure), intent(in) :: self
      type(harmonic_factors), intent(in) :: factors
      type(plain_state), intent(inout) :: state
      integer :: h

      associate (rank => self%dynamic%rank, s => state%split)
         if (.not. allocated(s%dynamic)) allocate (s%dynamic(rank, rank, size(factors%harmonic)))
         do h = 1, size(factors%harmonic)
            call self%dynamic%at_harmonic(state%products%internal(h), factors%theta(h), &
                                          factors%s(h), s%dynamic(:, :, h))
         end do
      end associate
   end subroutine find_dynamic

   !> F_q - Z_qi D^-1 F_i of all harmonics.
   subroutine condense_load(self, factors, products, load)
      type(plain_structure), intent(in) :: self
      type(harmonic_factors), intent(in) :: factors
      type(real_products), intent(inout) :: products
      complex(wp), intent(inout) :: load(:, :)
      real(wp) :: coefficients(self%n_coordinates, self%n_coefficients)
      integer :: h, m, n_i

      m = self%n_coordinates
      n_i = self%basis%n_internal
      do h = 1, size(factors%harmonic)
         ! F_q here, F_i in the place of the amplitudes of the internal modes.
         associate (b => self%basis, n => factors%harmonic(h), s => factors%s(h))
            load(:, h) = harmonic_load(b%load_q, b%waves, n, s)
            products%amplitudes(:, h) = harmonic_load(b%load_i, b%waves, n, s)
         end associate
      end do
      if (n_i == 0) return
      call coefficients_of(factors%harmonic, factors%column, m, m, load, coefficients)
      call coefficients_of(factors%harmonic, factors%column, n_i, n_i, products%amplitudes, &
                           products%modes)
      call products%solve_internal(factors)
      call products%subtract_modes(self%basis, factors, coefficients)
      call amplitudes_of(factors%harmonic, factors%column, m, coefficients, m, load)
   end subroutine condense_load

   subroutine multiply(self, state, q, product)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: product(*)

      associate (m => self%n_coordinates, b => self%basis)
         select type (state)
         type is (plain_state)
            if (self%forms_blocks) then
               call state%formed%multiply(self%harmonic, self%column, m, q, product)
            else
               call state%products%multiply(b, state%factors, self%packed, q, m, product)
            end if
         end select
      end associate
   end subroutine multiply

   subroutine restrict(self, state, n_active, n_used, used)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: n_active, n_used
      integer, intent(in) :: used(:)

      select type (state)
      type is (plain_state)
         ! Mostly the same coordinates as in the step before: nothing is gathered again.
         if (state%restricted .and. state%n_active == n_active .and. state%n_used == n_used) then
            if (all(state%used(:n_used) == used(:n_used))) return
         end if
         state%n_active = n_active
         state%n_used = n_used
         state%used(:n_used) = used(:n_used)
         state%restricted = .true.
         if (self%forms_blocks) then
            call state%formed%gather(n_active, n_used, used)
         else
            if (self%dynamic%rank > 0) call state%split%pack_rows(self%basis, self%dynamic, &
                                            self%n_coefficients, n_active, n_used, used)
            ! `packed` has all rows already.
            if (n_active == self%n_coordinates) return
            call state%products%active%pack_blocks(self%basis, n_active, n_used, used)
         end if
      end select
   end subroutine restrict

   subroutine multiply_active(self, state, v, product)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)

      associate (m => self%n_coordinates, b => self%basis)
         select type (state)
         type is (plain_state)
            if (self%forms_blocks) then
               call state%formed%multiply_active(self%harmonic, self%column, state%n_active, &
                                                 state%n_used, v, m, product)
            else if (state%n_active == m) then
               call state%products%multiply(b, state%factors, self%packed, v, m, product)
            else
               call state%products%multiply_active(b, state%factors, v, m, product)
            end if
         end select
      end associate
   end subroutine multiply_active

   pure integer function split_rank(self) result(rank)
      class(plain_structure), intent(in) :: self

      rank = self%dynamic%rank
   end function split_rank

   subroutine multiply_nearly(self, state, v, product)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)

      select type (state)
      type is (plain_state)
         call state%split%multiply(self%dynamic%rank, state%factors, v, self%n_coefficients, &
                                   self%n_coordinates, product)
      end select
   end subroutine multiply_nearly

   subroutine static_block(self, state, matrix)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      real(wp), intent(out), contiguous :: matrix(:, :)
      integer :: j

      associate (used => state%used(:state%n_used))
         do j = 1, state%n_active
            matrix(:, j) = self%basis%blocks(used, state%used(j), 1)
         end do
         do j = 1, self%dynamic%rank
            matrix(:, state%n_active + j) = self%dynamic%v(used, j)
         end do
      end associate
   end subroutine static_block

   subroutine dynamic_block(self, state, h, matrix)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)

      matrix = (0.0_wp, 0.0_wp)
      select type (state)
      type is (plain_state)
         matrix = state%split%dynamic(:, :, h)
      end select
      associate (unused => self)
      end associate
   end subroutine dynamic_block

   !> Z_r of a harmonic: as it is formed, or from K, M, C and the factors of D for this one call.
   subroutine block_of_all(self, state, h, matrix)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)
      integer :: j

      associate (m => self%n_coordinates, b => self%basis)
         select type (state)
         type is (plain_state)
            if (self%forms_blocks) then
               matrix = state%formed%matrix(:, :, h)
            else
               call form_block(b, state%factors%theta(h), state%factors%s(h), &
                               state%products%internal(h), m, [(j, j=1, m)], matrix)
            end if
         end select
      end associate
   end subroutine block_of_all

   !> Rows in use and active columns of Z_r.
   subroutine block_in_use(self, state, h, matrix)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)
      integer :: j

      if (state%n_active == self%n_coordinates) then
         call self%block(state, h, matrix)
         return
      end if
      select type (state)
      type is (plain_state)
         if (self%forms_blocks) then
            do j = 1, state%n_active
               matrix(:, j) = state%formed%matrix(state%used(:state%n_used), state%used(j), h)
            end do
         else
            ! The active ones are the first of those in use: leading columns.
            call form_block(self%basis, state%factors%theta(h), state%factors%s(h), &
                            state%products%internal(h), state%n_active, &
                            state%used(:state%n_used), matrix)
         end if
      end select
   end subroutine block_in_use

   complex(wp) function diagonal(self, state, h, coordinate)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h, coordinate
      complex(wp) :: matrix(1, 1)

      diagonal = (0.0_wp, 0.0_wp)
      select type (state)
      type is (plain_state)
         if (self%forms_blocks) then
            diagonal = state%formed%matrix(coordinate, coordinate, h)
         else
            call form_block(self%basis, state%factors%theta(h), state%factors%s(h), &
                            state%products%internal(h), 1, [coordinate], matrix)
            diagonal = matrix(1, 1)
         end if
      end select
   end function diagonal

   !> With ' = d/dp and x recovered:  Z'_qq q + Z'_qi x - Z_qi D^-1 (Z'_iq q + D' x).
   subroutine derivative(self, state, parameter, q, slope)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      integer, intent(in) :: parameter
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)

      select type (state)
      type is (plain_state)
         if (self%forms_blocks .and. parameter == by_frequency .and. &
             abs(state%self_excitation) <= 0.0_wp) then
            call derive_formed(self, state, q, slope)
         else
            call derive(self, state%factors, slopes_of(state, parameter), state%load_factor, q, &
                        slope)
         end if
      end select
   end subroutine derivative

   !> By frequency, harmonic by harmonic, from complex matrices that round as Z_r does: near the
   !> sharp turns of a branch the last digits decide where it goes on.
   subroutine derive_formed(self, state, q, slope)
      class(plain_structure), intent(in) :: self
      type(plain_state), intent(in) :: state
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      complex(wp) :: amplitude(self%n_coordinates, size(self%harmonic))
      complex(wp) :: derivative(self%n_coordinates, size(self%harmonic))
      integer :: h, m

      m = self%n_coordinates
      call amplitudes_of(self%harmonic, self%column, m, q, m, amplitude)
      do h = 1, size(self%harmonic)
         call derive_harmonic(self%basis, self%harmonic(h), state%factors%s(h), &
                              state%load_factor(h), amplitude(:, h), derivative(:, h))
      end do
      call coefficients_of(self%harmonic, self%column, m, m, derivative, slope)
   end subroutine derive_formed

   !> One harmonic, with the terms named in `derivative`; without self-excitation theta = s^2 and,
   !> by omega, ' = n d/ds: Z' = n (-2 s M + i C).
   subroutine derive_harmonic(b, harmonic, s, load_factor, q, derivative)
      type(reduction_type), intent(in) :: b
      integer, intent(in) :: harmonic
      !> n omega, and the factor of the loads.
      real(wp), intent(in) :: s, load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: derivative(:)
      type(internal_block) :: internal
      complex(wp), allocatable :: coupling(:, :), slope(:, :), xi(:, :)
      real(wp), allocatable :: damping(:, :)
      logical :: failed
      real(wp) :: n
      integer :: m

      m = b%n_coordinates
      n = real(harmonic, wp)
      allocate (damping(m + b%n_internal, m), xi(b%n_internal, 1))
      damping = 0.0_wp
      if (b%n_blocks == 3) damping = b%blocks(:, :, 3)
      associate (m_qq => b%blocks(:m, :, 2), c_qq => damping(:m, :), &
                 k_iq => b%blocks(m + 1:, :, 1), m_iq => b%blocks(m + 1:, :, 2), &
                 c_iq => damping(m + 1:, :))
         derivative = n*matmul(cmplx(-2.0_wp*s*m_qq, c_qq, wp), q)
         if (b%waves%acts()) derivative = derivative - load_factor* &
                                          load_slope(b%load_q, b%waves, harmonic, s, n)
         if (b%n_internal == 0) return
         coupling = cmplx(k_iq - s**2*m_iq, s*c_iq, wp)
         slope = n*cmplx(-2.0_wp*s*m_iq, c_iq, wp)
      end associate
      call internal%factor(b, cmplx(s**2, kind=wp), s, failed)
      ! x, recovered; then D^-1 (Z'_iq q + D' x).
      xi(:, 1) = load_factor*harmonic_load(b%load_i, b%waves, harmonic, s) - matmul(coupling, q)
      call internal%solve(1, xi)
      derivative = derivative + matmul(xi(:, 1), slope)
      xi(:, 1) = matmul(slope, q) + n*internal_slope(b, cmplx(2.0_wp*s, kind=wp), 1.0_wp, xi(:, 1))
      if (b%waves%acts()) xi(:, 1) = xi(:, 1) - load_factor* &
                                     load_slope(b%load_i, b%waves, harmonic, s, n)
      call internal%solve(1, xi)
      derivative = derivative - matmul(xi(:, 1), coupling)
   end subroutine derive_harmonic

   !> d/dp of the factors of K, M and C.
   pure function slopes_of(state, parameter) result(slopes)
      type(plain_state), intent(in) :: state
      integer, intent(in) :: parameter
      type(harmonic_factors) :: slopes

      slopes = state%factors
      slopes%k = 0.0_wp
      if (parameter == by_frequency) then
         ! theta = s^2 + i s xi and s = n omega: theta' = n (2 s + i xi) by omega, i s by xi.
         slopes%theta = slopes%harmonic*cmplx(2.0_wp*slopes%s, state%self_excitation, wp)
         slopes%s = real(slopes%harmonic, wp)
      else
         slopes%theta = cmplx(0.0_wp, slopes%s, wp)
         slopes%s = 0.0_wp
      end if
   end function slopes_of

   !> All harmonics at once.
   subroutine derive(self, f, slopes, load_factor, q, slope)
      class(plain_structure), intent(in) :: self
      type(harmonic_factors), intent(in) :: f, slopes
      !> Of the loads in each harmonic.
      real(wp), intent(in) :: load_factor(:)
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)
      type(real_products) :: work
      complex(wp), allocatable :: x(:, :)
      integer :: h, m, n_i, n_failed

      m = self%n_coordinates
      n_i = self%basis%n_internal
      call work%reserve(self%basis, size(self%harmonic), self%n_coefficients)
      associate (b => self%basis)
         call work%factor(b, f, n_failed)
         call recover_modes(self, f, load_factor, work, q, x)
         call work%multiply_blocks(b, slopes, q)
         call take_rows(m, n_i, self%n_coefficients, work%products, slope, work%modes)
         if (b%waves%acts()) call subtract_load_slopes(self, f, slopes, load_factor, slope)
         if (n_i > 0) then
            ! D^-1 (Z'_iq q + D' x)
            call amplitudes_of(f%harmonic, f%column, n_i, work%modes, n_i, work%amplitudes)
            do h = 1, size(f%harmonic)
               work%amplitudes(:, h) = work%amplitudes(:, h) + &
                                       internal_slope(b, slopes%theta(h), slopes%s(h), x(:, h))
               if (.not. b%waves%acts()) cycle
               work%amplitudes(:, h) = work%amplitudes(:, h) - load_factor(h)* &
                                       load_slope(b%load_i, b%waves, f%harmonic(h), f%s(h), &
                                                  slopes%s(h))
            end do
            call coefficients_of(f%harmonic, f%column, n_i, n_i, work%amplitudes, work%modes)
            call work%solve_internal(f)
            call work%subtract_modes(b, f, slope)
            ! - Z'_qi (-x)
            call coefficients_of(f%harmonic, f%column, n_i, n_i, -x, work%modes)
            call work%subtract_modes(b, slopes, slope)
         end if
      end associate
   end subroutine derive

   !> dF_q/dp of loads that grow with their frequency.
   subroutine subtract_load_slopes(self, f, slopes, load_factor, slope)
      class(plain_structure), intent(in) :: self
      type(harmonic_factors), intent(in) :: f, slopes
      real(wp), intent(in) :: load_factor(:)
      real(wp), intent(inout) :: slope(*)
      real(wp) :: loads(self%n_coordinates*self%n_coefficients)
      complex(wp) :: amplitude(self%n_coordinates, size(self%harmonic))
      integer :: h, m

      m = self%n_coordinates
      do h = 1, size(self%harmonic)
         amplitude(:, h) = load_factor(h)*load_slope(self%basis%load_q, self%basis%waves, &
                                                     f%harmonic(h), f%s(h), slopes%s(h))
      end do
      call coefficients_of(f%harmonic, f%column, m, m, amplitude, loads)
      slope(:size(loads)) = slope(:size(loads)) - loads
   end subroutine subtract_load_slopes

   !> Rows of the coordinates and of the internal modes of a product with the blocks.
   pure subroutine take_rows(m, n_i, n_columns, products, rows, modes)
      integer, intent(in) :: m, n_i, n_columns
      real(wp), intent(in) :: products(m + n_i, n_columns)
      real(wp), intent(inout) :: rows(m, n_columns), modes(n_i, n_columns)

      rows = products(:m, :)
      modes = products(m + 1:, :)
   end subroutine take_rows

   !> D' times a vector.
   pure function internal_slope(basis, theta, s, vector) result(product)
      type(reduction_type), intent(in) :: basis
      !> d theta/dp and ds/dp.
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp), intent(in) :: vector(:)
      complex(wp) :: product(size(vector))

      product = -theta*basis%m_i*vector
      if (allocated(basis%c_ii)) then
         product = product + cmplx(0.0_wp, s, wp)*matmul(basis%c_ii, vector)
      else
         product = product + cmplx(0.0_wp, s, wp)*basis%c_i*vector
      end if
   end function internal_slope

   !> x = D^-1 (F_i - Z_iq q), complex amplitudes (n_internal, n_retained); D factored in `work`.
   subroutine recover_modes(self, factors, load_factor, work, q, x)
      class(plain_structure), intent(in) :: self
      type(harmonic_factors), intent(in) :: factors
      real(wp), intent(in) :: load_factor(:)
      type(real_products), intent(inout) :: work
      real(wp), intent(in) :: q(*)
      complex(wp), allocatable, intent(out) :: x(:, :)
      real(wp) :: unused(self%n_coordinates*self%n_coefficients)
      integer :: h, m

      m = self%n_coordinates
      associate (b => self%basis)
         call work%multiply_blocks(b, factors, q)
         call take_rows(m, b%n_internal, self%n_coefficients, work%products, unused, work%modes)
         allocate (x(b%n_internal, size(factors%harmonic)))
         call amplitudes_of(factors%harmonic, factors%column, b%n_internal, work%modes, &
                            b%n_internal, x)
         do h = 1, size(factors%harmonic)
            x(:, h) = load_factor(h)*harmonic_load(b%load_i, b%waves, factors%harmonic(h), &
                                                   factors%s(h)) - x(:, h)
            call work%internal(h)%solve(1, x(:, h:h))
         end do
      end associate
   end subroutine recover_modes

   subroutine recover(self, state, q, observed)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      complex(wp), intent(in), contiguous :: q(:, :)
      complex(wp), intent(out), contiguous :: observed(:, :)
      type(real_products) :: work
      real(wp) :: coefficients(self%n_coordinates, self%n_coefficients)
      complex(wp), allocatable :: x(:, :)
      integer :: h, m, n_failed

      m = self%n_coordinates
      call work%reserve(self%basis, size(self%harmonic), self%n_coefficients)
      call coefficients_of(self%harmonic, self%column, m, m, q, coefficients)
      select type (state)
      type is (plain_state)
         ! Rarely asked for (once a point): factors of its own leave those of the state alone.
         call work%factor(self%basis, state%factors, n_failed)
         call recover_modes(self, state%factors, state%load_factor, work, coefficients, x)
      end select
      do h = 1, size(self%harmonic)
         ! Observed: T_q q + T_i x, with the matrix of observed quantities in both.
         observed(:, h) = matmul(self%basis%observe_q, q(:, h))
         if (self%basis%n_internal == 0) cycle
         observed(:, h) = observed(:, h) + matmul(self%basis%observe_i, x(:, h))
      end do
   end subroutine recover

   !> K_qq - sum K_qi^2/k_i: internal modes give way. Free ones (k_i = 0) do not count: with them
   !> the stiffness would be none.
   pure real(wp) function static_stiffness(self, coordinate)
      class(plain_structure), intent(in) :: self
      integer, intent(in) :: coordinate

      associate (b => self%basis)
         static_stiffness = b%blocks(coordinate, coordinate, 1)
         if (b%n_internal > 0) then
            static_stiffness = static_stiffness - sum(b%coupling(:, 1, coordinate)**2/b%k_i, &
                                                      mask=abs(b%k_i) > 0)
         end if
      end associate
   end function static_stiffness

   pure subroutine split(self, coordinate, limit, m, c, k)
      class(plain_structure), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k

      call split_coordinate(self%basis, coordinate, limit, m, c, k)
   end subroutine split

   pure subroutine mass(self, matrix)
      class(plain_structure), intent(in) :: self
      real(wp), intent(out) :: matrix(:, :)

      matrix = self%basis%blocks(:self%n_coordinates, :, 2)
   end subroutine mass

   !> The same in all harmonics.
   pure subroutine parts(self, h, stiffness, mass, damping, observe)
      class(plain_structure), intent(in) :: self
      integer, intent(in) :: h
      complex(wp), intent(out) :: stiffness(:, :), mass(:, :), damping(:, :), observe(:, :)

      associate (unused => h, m => self%n_coordinates, b => self%basis)
         stiffness = cmplx(b%blocks(:m, :, 1), kind=wp)
         mass = cmplx(b%blocks(:m, :, 2), kind=wp)
         damping = (0.0_wp, 0.0_wp)
         if (b%n_blocks == 3) damping = cmplx(b%blocks(:m, :, 3), kind=wp)
         observe = cmplx(b%observe_q, kind=wp)
      end associate
   end subroutine parts

   !> Of D_j: omega = sqrt(k/m), half width zeta omega = c/(2 m). Static modes (m = 0) and free ones
   !> (k = 0) do not vibrate.
   pure subroutine held_modes(self, frequency, half_width)
      class(plain_structure), intent(in) :: self
      real(wp), allocatable, intent(out) :: frequency(:), half_width(:)
      logical, allocatable :: vibrates(:)

      associate (b => self%basis)
         vibrates = b%k_i > 0.0_wp .and. b%m_i > 0.0_wp
         frequency = sqrt(pack(b%k_i, vibrates)/pack(b%m_i, vibrates))
         half_width = 0.5_wp*pack(b%c_i, vibrates)/pack(b%m_i, vibrates)
      end associate
   end subroutine held_modes

   pure subroutine magnitudes(self, state, h, amplitude, sums)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      real(wp), intent(in) :: amplitude(:)
      real(wp), intent(out) :: sums(:)
      real(wp) :: theta
      integer :: j, m

      m = self%n_coordinates
      ! Of theta_n the modulus, n |n omega^2 + i omega xi|.
      theta = self%harmonic(h)*abs(cmplx(self%harmonic(h)*state%omega**2, &
                                         state%omega*state%self_excitation, wp))
      sums = 0.0_wp
      do j = 1, m
         sums = sums + (abs(self%basis%blocks(:m, j, 1)) + &
                        theta*abs(self%basis%blocks(:m, j, 2)))*amplitude(j)
      end do
   end subroutine magnitudes

   pure integer function whole_size(self)
      class(plain_structure), intent(in) :: self

      whole_size = self%n_coordinates + self%basis%n_internal
   end function whole_size

   subroutine condense_field(self, state, field, load)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: load(:, :)
      integer :: h

      select type (state)
      type is (plain_state)
         do h = 1, size(self%harmonic)
            call condense_harmonic(self%basis, state%factors%theta(h), state%factors%s(h), &
                                   field(:, h), load(:, h))
         end do
      end select
   end subroutine condense_field

   subroutine complete_field(self, state, q, load, field)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(in), optional :: load(:, :)
      complex(wp), intent(out) :: field(:, :)
      complex(wp) :: own(self%basis%n_internal)
      integer :: h, m

      m = self%n_coordinates
      select type (state)
      type is (plain_state)
         do h = 1, size(self%harmonic)
            if (present(load)) then
               own = load(m + 1:, h)
            else
               own = state%load_factor(h)*harmonic_load(self%basis%load_i, self%basis%waves, &
                                                        self%harmonic(h), state%factors%s(h))
            end if
            field(:m, h) = q(:, h)
            call complete_harmonic(self%basis, state%factors%theta(h), state%factors%s(h), &
                                   q(:, h), own, field(m + 1:, h))
         end do
      end select
   end subroutine complete_field

   pure subroutine observe_field(self, field, observed)
      class(plain_structure), intent(in) :: self
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: observed(:, :)

      associate (m => self%n_coordinates, b => self%basis)
         observed = matmul(b%observe_q, field(:m, :)) + matmul(b%observe_i, field(m + 1:, :))
      end associate
   end subroutine observe_field

   pure subroutine observe_back(self, observed, field)
      class(plain_structure), intent(in) :: self
      complex(wp), intent(in) :: observed(:, :)
      complex(wp), intent(out) :: field(:, :)

      associate (m => self%n_coordinates, b => self%basis)
         field(:m, :) = matmul(transpose(b%observe_q), observed)
         field(m + 1:, :) = matmul(transpose(b%observe_i), observed)
      end associate
   end subroutine observe_back

   pure subroutine change_field(self, state, number, field, slope)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: number
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: slope(:, :)
      integer :: h

      associate (b => self%basis)
         slope = matmul(b%change_k(:, :, number), field)
         do h = 1, size(self%harmonic)
            if (self%harmonic(h) == 0) then
               slope(:, h) = slope(:, h) - b%change_load(:, number)
            else
               slope(:, h) = slope(:, h) + cmplx(0.0_wp, self%harmonic(h)*state%omega, wp)* &
                             matmul(b%change_c(:, :, number), field(:, h))
            end if
         end do
      end associate
   end subroutine change_field

   pure subroutine scale_loads(self, static, vibration)
      class(plain_structure), intent(inout) :: self
      real(wp), intent(in) :: static, vibration

      associate (b => self%basis)
         b%load_q(:, 1) = static*b%load_q(:, 1)
         b%load_i(:, 1) = static*b%load_i(:, 1)
         b%load_q(:, 2:) = vibration*b%load_q(:, 2:)
         b%load_i(:, 2:) = vibration*b%load_i(:, 2:)
         if (allocated(b%change_load)) b%change_load = static*b%change_load
      end associate
   end subroutine scale_loads

   subroutine observed_slope(self, state, q, slope)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(out) :: slope(:, :)
      complex(wp) :: x(self%basis%n_internal), x_slope(self%basis%n_internal)
      integer :: h

      slope = (0.0_wp, 0.0_wp)
      if (self%basis%n_internal == 0) return
      do h = 1, size(self%harmonic)
         if (self%harmonic(h) == 0) cycle
         call follow_frequency(self%basis, self%harmonic(h), state%omega, q(:, h), x, x_slope)
         slope(:, h) = matmul(self%basis%observe_i, x_slope)
      end do
   end subroutine observed_slope

   subroutine load_work(self, state, h, q, work, slope, row)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: work, slope
      complex(wp), intent(out) :: row(:)

      call work_of_load(self%basis, self%harmonic(h), state%omega, q, work, slope, row)
   end subroutine load_work

   pure complex(wp) function field_work(self, state, field) result(work)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      integer :: h

      work = (0.0_wp, 0.0_wp)
      h = findloc(self%harmonic, 1, dim=1)
      if (h == 0) return
      associate (b => self%basis, m => self%n_coordinates)
         work = sum(conjg(harmonic_load(b%load_q, b%waves, 1, state%omega))*field(:m, h)) + &
                sum(conjg(harmonic_load(b%load_i, b%waves, 1, state%omega))*field(m + 1:, h))
      end associate
   end function field_work

end module fw_plain_structure
