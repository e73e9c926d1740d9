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
   use fw_error, only: error_type, fatal_error, status_input
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_condensed_structure, only: condensed_state, condensed_structure
   use fw_formed_stiffness, only: form_block, formed_stiffness, harmonic_load
   use fw_dynamic_part, only: dynamic_part, find_dynamic_part
   use fw_model, only: model_type
   use fw_plain_slopes, only: derive, derive_formed, slopes_of
   use fw_real_products, only: harmonic_factors, real_products
   use fw_reduction, only: held_basis, new_reduction
   use fw_relative, only: relative_type
   use fw_size_options, only: sizes
   use fw_split_product, only: split_product
   use fw_structure_operator, only: by_frequency, lay_out_coefficients, structure_state
   use fw_text, only: to_text
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: plain_structure, new_plain_structure

   !> A structure that is no sector.
   type, extends(condensed_structure) :: plain_structure
      !> Whether Z_r is formed at each frequency.
      logical :: forms_blocks = .true.
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
      procedure :: recover => recover_observed
      procedure :: undetermined
      procedure :: split_rank
      procedure :: multiply_nearly
      procedure :: has_near_product
      procedure :: static_block
      procedure :: dynamic_block
   end type plain_structure

   !> Blocks of one frequency.
   type, extends(condensed_state) :: plain_state
      !> The one or the other.
      type(formed_stiffness) :: formed
      type(real_products) :: products
      type(split_product) :: split
      !> Whether rows in use are those of the present frequency, and real products have them.
      logical :: restricted = .false., gathered = .false.
      !> Whether formed matrices have them in single precision.
      logical :: packed = .false.
   end type plain_state

   !> Entries of all complex matrices from which real products pay (1 MB, more than the cache of a
   !> core holds), and internal modes for each coordinate up to which they do. Measured on sweeps
   !> of 48 pairs from 3 harmonics on, where they save a quarter to a third of the time.
   real(wp), parameter :: most_entries = 7.0e4_wp, most_internal = 0.5_wp

contains

   !> Prepare the condensation of a model to its relative coordinates.
   subroutine new_plain_structure(model, relative, harmonic, omega_range, self, error, keep_all, &
                                  forms_blocks, held, keep_none)
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
      !> Condense every internal mode, whatever a harmonic may hit.
      logical, intent(in), optional :: keep_none
      logical :: is_whole

      call new_reduction(model, relative, harmonic, omega_range, self%basis, error, keep_all, &
                         held, keep_none)
      if (allocated(error)) return
      self%knows_field = .true.
      self%n_coordinates = self%basis%n_coordinates
      self%n_relative = relative%n_coordinates
      self%kept = self%basis%kept
      self%n_observed = size(self%basis%observe_q, 1)
      call lay_out_coefficients(self, harmonic)
      call find_norms(self)
      self%forms_blocks = real(self%n_coordinates, wp)**2*size(harmonic) < most_entries .or. &
                          self%basis%n_internal > most_internal*self%n_coordinates
      is_whole = .false.
      if (present(keep_all)) is_whole = keep_all
      ! Products of K and M cannot lift a pivot.
      if (.not. is_whole) self%forms_blocks = self%forms_blocks .or. any(self%basis%alone)
      if (present(forms_blocks)) self%forms_blocks = forms_blocks
      if (self%forms_blocks) return
      ! Kept modes have no stiffness of their own to trust.
      if (size(self%kept) == 0 .and. self%basis%loss <= 0.0_wp) call find_dynamic_part(self%basis, &
                                     maxval(harmonic)*omega_range(2), self%dynamic)
   end subroutine new_plain_structure

   !> Of K and M, which are the same in all harmonics.
   pure subroutine find_norms(self)
      type(plain_structure), intent(inout) :: self

      allocate (self%norms(2, size(self%harmonic)))
      associate (m => self%n_coordinates, b => self%basis)
         self%norms(1, :) = norm2(b%blocks(:m, :, 1))
         self%norms(2, :) = norm2(b%blocks(:m, :, 2))
      end associate
   end subroutine find_norms

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
      plain%factors%loss = self%basis%loss
      allocate (plain%factors%theta(nh), source=(0.0_wp, 0.0_wp))
      allocate (plain%factors%s(nh), source=0.0_wp)
      call plain%reserve_loads(m, nh)
      allocate (plain%used(m), source=0)
      if (self%forms_blocks) then
         call plain%formed%reserve(m, nh, self%basis)
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
         if (self%forms_blocks .and. any(self%basis%alone)) call lift_pivots(self, state)
      end associate
   end subroutine go_to

   !> Any pivot will do where a harmonic meets a mode that is alone: without a load it stays at
   !> rest, and with one nobody takes the motion for a solution (see `undetermined`). Where nothing
   !> is loaded the mode itself is looked for.
   subroutine lift_pivots(self, state)
      type(plain_structure), intent(in) :: self
      type(plain_state), intent(inout) :: state
      integer :: h, j

      if (.not. any(abs(state%load(:, pack([(h, h=1, size(self%harmonic))], &
                                           self%harmonic > 0))) > 0.0_wp)) return
      do h = 1, size(self%harmonic)
         if (self%harmonic(h) == 0) cycle
         do j = 1, self%n_coordinates
            if (.not. self%basis%alone(j)) cycle
            if (abs(state%formed%matrix(j, j, h)) > 0.0_wp) cycle
            state%formed%matrix(j, j, h) = cmplx(self%basis%blocks(j, j, 1), kind=wp)
         end do
      end do
   end subroutine lift_pivots

   !> Modes that are alone and meet a harmonic, to round-off, without and with a load there.
   subroutine undetermined(self, state, n_idle, n_driven)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(out) :: n_idle, n_driven
      !> Of the sizes of K and theta M: eigenvalues are good to some thousand times epsilon.
      real(wp), parameter :: round_off = 1.0e-12_wp
      real(wp) :: stiffness, inertia, damping
      integer :: h, j

      n_idle = 0
      n_driven = 0
      if (.not. any(self%basis%alone)) return
      do j = 1, self%n_coordinates
         if (.not. self%basis%alone(j)) cycle
         do h = 1, size(self%harmonic)
            if (self%harmonic(h) == 0) cycle
            associate (s => self%harmonic(h)*state%omega, b => self%basis)
               stiffness = b%blocks(j, j, 1)
               inertia = s**2*b%blocks(j, j, 2)
               damping = 0.0_wp
               if (b%n_blocks == 3) damping = s*abs(b%blocks(j, j, 3))
               damping = damping + b%loss*abs(stiffness)
            end associate
            if (abs(stiffness - inertia) + damping > round_off*(stiffness + inertia)) cycle
            if (abs(state%load(j, h)) > 0.0_wp) then
               n_driven = n_driven + 1
            else
               n_idle = n_idle + 1
            end if
         end do
      end do
   end subroutine undetermined

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
               call state%products%multiply(b, state%factors, q, m, product)
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
         ! Formed matrices are not copied before a step asks for them: mostly for the near ones.
         state%gathered = .false.
         state%packed = .false.
         if (.not. self%forms_blocks) then
            if (self%dynamic%rank > 0) call state%split%pack_rows(self%basis, self%dynamic, &
                                            self%n_coefficients, n_active, n_used, used)
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
               if (.not. state%gathered) call state%formed%gather(state%n_active, state%n_used, &
                                                                  state%used)
               state%gathered = .true.
               call state%formed%multiply_active(self%harmonic, self%column, state%n_active, &
                                                 state%n_used, v, m, product)
            else if (state%n_active == m) then
               call state%products%multiply(b, state%factors, v, m, product)
            else
               ! Not before it is asked for: mostly the product of low rank serves.
               if (.not. state%gathered) call state%products%gather_active( &
                  b, state%n_active, state%n_used, state%used)
               state%gathered = .true.
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
         if (.not. self%forms_blocks) then
            call state%split%multiply(self%dynamic%rank, state%factors, v, self%n_coefficients, &
                                      self%n_coordinates, product)
            return
         end if
         if (state%formed%is_static) then
            ! One product for all harmonics costs less than one each in single precision.
            call self%multiply_active(state, v, product)
            return
         end if
         if (.not. state%packed) call state%formed%pack_near(state%n_active, state%n_used, &
                                                             state%used)
         state%packed = .true.
         call state%formed%multiply_near(self%harmonic, self%column, state%n_active, &
                                         state%n_used, v, self%n_coordinates, product)
      end select
   end subroutine multiply_nearly

   pure logical function has_near_product(self)
      class(plain_structure), intent(in) :: self

      has_near_product = self%forms_blocks .and. self%n_coordinates >= sizes%single_matrices
   end function has_near_product

   subroutine static_block(self, state, matrix)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      real(wp), intent(out), contiguous :: matrix(:, :)
      integer :: j

      !$omp parallel do default(none) private(j) shared(self, state, matrix) &
      !$omp if(state%n_active >= coordinates_for_threads)
      do j = 1, state%n_active
         matrix(:, j) = self%basis%blocks(state%used(:state%n_used), state%used(j), 1)
      end do
      !$omp end parallel do
      do j = 1, self%dynamic%rank
         matrix(:, state%n_active + j) = self%dynamic%v(state%used(:state%n_used), j)
      end do
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

   !> Factors of D are at hand where Z_r is not formed.
   subroutine recover_observed(self, state, q, observed)
      class(plain_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      complex(wp), intent(in), contiguous :: q(:, :)
      complex(wp), intent(out), contiguous :: observed(:, :)

      if (self%forms_blocks) then
         call self%recover_anew(state, q, observed)
         return
      end if
      select type (state)
      type is (plain_state)
         call self%recover_by(state, state%products, q, observed)
      end select
   end subroutine recover_observed

   !> Formed matrices derive as they round.
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
            call derive_formed(self%basis, state%factors, state%load_factor, q, slope)
         else
            call derive(self%basis, self%n_coefficients, state%factors, &
                        slopes_of(state%factors, state%self_excitation, parameter), &
                        state%load_factor, q, slope)
         end if
      end select
   end subroutine derivative

end module fw_plain_structure
