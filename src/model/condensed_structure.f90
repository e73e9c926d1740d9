!> A structure condensed to its relative coordinates, in whatever form its products are taken:
!> what follows from the basis (fw_reduction) and from the factors of a frequency alone.
module fw_condensed_structure
   use fw_kinds, only: pi, wp
   use fw_complex_form, only: coefficients_of
   use fw_field_slopes, only: follow_frequency, work_of_load
   use fw_formed_stiffness, only: harmonic_load
   use fw_plain_slopes, only: recover_modes
   use fw_real_products, only: harmonic_factors, real_products
   use fw_reduction, only: reduction_type
   use fw_split, only: split_coordinate
   use fw_structure_operator, only: structure_operator, structure_state
   use fw_whole_field, only: complete_harmonic, condense_harmonic
   implicit none (type, external)
   private

   public :: condensed_structure, condensed_state

   !> What plain structures and sectors have in common once they are condensed to their coordinates.
   type, abstract, extends(structure_operator) :: condensed_structure
      type(reduction_type) :: basis
   contains
      procedure :: recover => recover_anew
      procedure :: recover_anew
      procedure :: recover_by
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
      procedure :: observe_back
      procedure :: change_field
      procedure :: field_work
   end type condensed_structure

   type, abstract, extends(structure_state) :: condensed_state
      type(harmonic_factors) :: factors
   end type condensed_state

contains

   subroutine recover_anew(self, state, q, observed)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(inout) :: state
      complex(wp), intent(in), contiguous :: q(:, :)
      complex(wp), intent(out), contiguous :: observed(:, :)
      type(real_products) :: work
      integer :: h, n_failed

      if (self%basis%n_internal == 0) then
         ! Nothing but the coordinates moves.
         do h = 1, size(self%harmonic)
            observed(:, h) = matmul(self%basis%observe_q, q(:, h))
         end do
         return
      end if
      call work%reserve(self%basis, size(self%harmonic), self%n_coefficients)
      select type (state)
      class is (condensed_state)
         ! Rarely asked for (once a point), where the state has no factors of its own.
         call work%factor(self%basis, state%factors, n_failed)
         call self%recover_by(state, work, q, observed)
      end select
   end subroutine recover_anew

   !> The same with D factored in `work`.
   subroutine recover_by(self, state, work, q, observed)
      class(condensed_structure), intent(in) :: self
      class(condensed_state), intent(in) :: state
      type(real_products), intent(inout) :: work
      complex(wp), intent(in), contiguous :: q(:, :)
      complex(wp), intent(out), contiguous :: observed(:, :)
      real(wp) :: coefficients(self%n_coordinates, self%n_coefficients)
      complex(wp), allocatable :: x(:, :)
      integer :: h, m

      m = self%n_coordinates
      call coefficients_of(self%harmonic, self%column, m, m, q, coefficients)
      call recover_modes(self%basis, state%factors, state%load_factor, work, coefficients, x)
      do h = 1, size(self%harmonic)
         ! Observed: T_q q + T_i x, with the matrix of observed quantities in both.
         observed(:, h) = matmul(self%basis%observe_q, q(:, h))
         if (self%basis%n_internal == 0) cycle
         observed(:, h) = observed(:, h) + matmul(self%basis%observe_i, x(:, h))
      end do
   end subroutine recover_by

   !> K_qq - sum K_qi^2/k_i: internal modes give way. Free ones (k_i = 0) do not count: with them
   !> the stiffness would be none.
   pure real(wp) function static_stiffness(self, coordinate)
      class(condensed_structure), intent(in) :: self
      integer, intent(in) :: coordinate

      associate (b => self%basis)
         static_stiffness = b%blocks(coordinate, coordinate, 1)
         if (b%n_internal > 0) then
            static_stiffness = static_stiffness - sum(b%coupling(:, 1, coordinate)**2/b%k_i, &
                                                      mask=abs(b%k_i) > 0)
         end if
      end associate
   end function static_stiffness

   !> Mass, damping and stiffness of one coordinate alone.
   pure subroutine split(self, coordinate, limit, m, c, k)
      class(condensed_structure), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k

      call split_coordinate(self%basis, coordinate, limit, m, c, k)
   end subroutine split

   !> Mass between the coordinates, as the reduction has it.
   pure subroutine mass(self, matrix)
      class(condensed_structure), intent(in) :: self
      real(wp), intent(out) :: matrix(:, :)

      matrix = self%basis%blocks(:self%n_coordinates, :, 2)
   end subroutine mass

   !> The same in all harmonics, but for hysteretic damping with the stiffness.
   pure subroutine parts(self, h, stiffness, mass, damping, observe)
      class(condensed_structure), intent(in) :: self
      integer, intent(in) :: h
      complex(wp), intent(out) :: stiffness(:, :), mass(:, :), damping(:, :), observe(:, :)

      associate (m => self%n_coordinates, b => self%basis)
         stiffness = cmplx(b%blocks(:m, :, 1), kind=wp)
         if (self%harmonic(h) > 0 .and. b%loss > 0.0_wp) then
            stiffness = cmplx(1.0_wp, b%loss, wp)*stiffness
         end if
         mass = cmplx(b%blocks(:m, :, 2), kind=wp)
         damping = (0.0_wp, 0.0_wp)
         if (b%n_blocks == 3) damping = cmplx(b%blocks(:m, :, 3), kind=wp)
         observe = cmplx(b%observe_q, kind=wp)
      end associate
   end subroutine parts

   !> Of D_j: omega = sqrt(k/m), half width zeta omega = c/(2 m). Static modes (m = 0) and free ones
   !> (k = 0) do not vibrate.
   pure subroutine held_modes(self, frequency, half_width)
      class(condensed_structure), intent(in) :: self
      real(wp), allocatable, intent(out) :: frequency(:), half_width(:)
      logical, allocatable :: vibrates(:)

      associate (b => self%basis)
         vibrates = b%k_i > 0.0_wp .and. b%m_i > 0.0_wp
         frequency = sqrt(pack(b%k_i, vibrates)/pack(b%m_i, vibrates))
         half_width = 0.5_wp*pack(b%c_i, vibrates)/pack(b%m_i, vibrates)
         if (b%loss > 0.0_wp) half_width = half_width + 0.5_wp*b%loss*frequency
      end associate
   end subroutine held_modes

   !> Sizes of the terms that an entry sums up: round-off of a residual is measured by them.
   pure subroutine magnitudes(self, state, h, amplitude, sums)
      class(condensed_structure), intent(in) :: self
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

   !> Degrees of freedom before condensation.
   pure integer function whole_size(self)
      class(condensed_structure), intent(in) :: self

      whole_size = self%n_coordinates + self%basis%n_internal
   end function whole_size

   !> Forces on all degrees of freedom, as loads on the coordinates.
   subroutine condense_field(self, state, field, load)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: load(:, :)
      integer :: h

      select type (state)
      class is (condensed_state)
         do h = 1, size(self%harmonic)
            call condense_harmonic(self%basis, state%factors%theta(h), state%factors%s(h), &
                                   field(:, h), load(:, h))
         end do
      end select
   end subroutine condense_field

   !> The motion of all degrees of freedom that belongs to coordinates and loads.
   subroutine complete_field(self, state, q, load, field)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(in), optional :: load(:, :)
      complex(wp), intent(out) :: field(:, :)
      complex(wp) :: own(self%basis%n_internal)
      integer :: h, m

      m = self%n_coordinates
      select type (state)
      class is (condensed_state)
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

   !> Observed quantities of a motion of all degrees of freedom.
   pure subroutine observe_field(self, field, observed)
      class(condensed_structure), intent(in) :: self
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: observed(:, :)

      associate (m => self%n_coordinates, b => self%basis)
         observed = matmul(b%observe_q, field(:m, :)) + matmul(b%observe_i, field(m + 1:, :))
      end associate
   end subroutine observe_field

   !> Transposed: a motion whose product with any other is that of what is observed.
   pure subroutine observe_back(self, observed, field)
      class(condensed_structure), intent(in) :: self
      complex(wp), intent(in) :: observed(:, :)
      complex(wp), intent(out) :: field(:, :)

      associate (m => self%n_coordinates, b => self%basis)
         field(:m, :) = matmul(transpose(b%observe_q), observed)
         field(m + 1:, :) = matmul(transpose(b%observe_i), observed)
      end associate
   end subroutine observe_back

   !> What moves when an entry of the matrices changes: forces on all degrees of freedom.
   pure subroutine change_field(self, state, number, field, slope)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: number
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: slope(:, :)
      integer :: h

      associate (b => self%basis)
         slope = matmul(b%change_k(:, :, number), field)
         do h = 1, size(self%harmonic)
            if (b%change_loss(number)) then
               slope(:, h) = merge((0.0_wp, 1.0_wp), (0.0_wp, 0.0_wp), self%harmonic(h) > 0)* &
                             slope(:, h)
            else if (self%harmonic(h) == 0) then
               slope(:, h) = slope(:, h) - state%load_factor(h)*b%change_load(:, number)
            else
               if (b%loss > 0.0_wp) slope(:, h) = cmplx(1.0_wp, b%loss, wp)*slope(:, h)
               slope(:, h) = slope(:, h) + cmplx(0.0_wp, self%harmonic(h)*state%omega, wp)* &
                             matmul(b%change_c(:, :, number), field(:, h))
               ! With the self-excitation of a mode, which is in proportion to mass.
               if (allocated(b%change_m)) slope(:, h) = slope(:, h) - &
                  cmplx((self%harmonic(h)*state%omega)**2, self%harmonic(h)*state%omega* &
                        state%self_excitation, wp)*matmul(b%change_m(:, :, number), field(:, h))
            end if
         end do
      end associate
   end subroutine change_field

   !> Derivative of what is observed by the frequency, at held coordinates.
   subroutine observed_slope(self, state, q, slope)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(out) :: slope(:, :)
      complex(wp) :: x(self%basis%n_internal), x_slope(self%basis%n_internal)
      integer :: h

      slope = (0.0_wp, 0.0_wp)
      if (self%basis%n_internal == 0) return
      do h = 1, size(self%harmonic)
         if (self%harmonic(h) == 0) cycle
         call follow_frequency(self%basis, self%harmonic(h), state%omega, &
                               state%load_factor(h), q(:, h), x, x_slope)
         slope(:, h) = matmul(self%basis%observe_i, x_slope)
      end do
   end subroutine observed_slope

   !> Work of the loads in harmonic h, with its derivatives by frequency and coordinates.
   subroutine load_work(self, state, h, q, work, slope, row)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: work
      complex(wp), intent(out), optional :: slope, row(:)

      call work_of_load(self%basis, self%harmonic(h), state%omega, state%load_factor(h), q, work, &
                        slope, row)
   end subroutine load_work

   !> eta sum n pi U^H K U.
   real(wp) function structural_work(self, state, q) result(work)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      complex(wp) :: field(self%n_coordinates + self%basis%n_internal, size(self%harmonic))
      integer :: h

      work = 0.0_wp
      if (self%basis%loss <= 0.0_wp) return
      call self%complete_field(state, q, field=field)
      associate (b => self%basis, m => self%n_coordinates)
         do h = 1, size(self%harmonic)
            associate (u => field(:m, h), x => field(m + 1:, h))
               work = work + self%harmonic(h)*( &
                      real(dot_product(u, matmul(b%blocks(:m, :, 1), u)), wp) + &
                      2.0_wp*real(dot_product(x, matmul(b%blocks(m + 1:, :, 1), u)), wp) + &
                      sum(b%k_i*abs(x)**2))
            end associate
         end do
      end associate
      work = pi*self%basis%loss*work
   end function structural_work

   !> Work of the loads on a motion of all degrees of freedom.
   pure complex(wp) function field_work(self, state, field) result(work)
      class(condensed_structure), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      integer :: h

      work = (0.0_wp, 0.0_wp)
      h = findloc(self%harmonic, 1, dim=1)
      if (h == 0) return
      associate (b => self%basis, m => self%n_coordinates)
         work = sum(conjg(harmonic_load(b%load_q, b%waves, 1, state%omega))*field(:m, h)) + &
                sum(conjg(harmonic_load(b%load_i, b%waves, 1, state%omega))*field(m + 1:, h))
         work = state%load_factor(h)*work
      end associate
   end function field_work

end module fw_condensed_structure
