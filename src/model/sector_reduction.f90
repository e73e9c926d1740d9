!> The basis in which a tied sector is condensed in one nodal diameter: u = T_q q + T_i xi, with the
!> relative coordinates q, and modes xi of the sector with q held. As fw_reduction, with Hermitian
!> matrices in place of symmetric ones.
!>
!> Coordinates have the same numbers in all nodal diameters. One that a nodal diameter does not have
!> (a row that depends on others there, a mode kept of another nodal diameter) is padded: a spring
!> of its own that nothing loads.
module fw_sector_reduction
   use fw_cyclic_data, only: nodal_matrices, nodal_speed
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hermitian, only: cholesky, congruence, product_of, is_regular, solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_lapack, only: zpotrs
   use fw_load_waves, only: load_waves
   use fw_sector_changes, only: nodal_change
   use fw_sector_relative, only: sector_relative
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: sector_reduction, static_diagonal

   !> The matrices of one nodal diameter, condensed to the coordinates of the joint.
   type :: sector_reduction
      !> Signed as the harmonics have it, or not: matrices are those of k = 0 .. N/2.
      integer :: nodal_diameter = 0
      integer :: n_coordinates = 0
      integer :: n_internal = 0
      !> K, M and C, the last only where there is damping: rows of the coordinates, then of the
      !> internal modes (n_coordinates + n_internal, n_coordinates, n_blocks).
      integer :: n_blocks = 0
      complex(wp), allocatable :: blocks(:, :, :)
      !> Diagonals of the internal modes (n_internal).
      real(wp), allocatable :: k_i(:), m_i(:), c_i(:)
      !> Internal damping, only where it is not diagonal (n_internal, n_internal).
      complex(wp), allocatable :: c_ii(:, :)
      !> Loads in columns (n_coordinates, n_columns), (n_internal, n_columns), and what these are.
      complex(wp), allocatable :: load_q(:, :), load_i(:, :)
      type(load_waves) :: waves
      !> What is not Hermitian as the other blocks are, of coordinates and internal modes together:
      !> Coriolis, which i s goes with (m + n_internal, m + n_internal), and the air, for the wave
      !> of this nodal diameter and for the one the other way (.., 2), in the coordinates of each.
      complex(wp), allocatable :: coriolis(:, :), aero(:, :, :)
      !> The skew part of the stiffness for harmonic 0, with which nothing is condensed (m, m), and
      !> the matrix of hysteretic damping (m + n_internal, m + n_internal), see nodal_matrices.
      complex(wp), allocatable :: circulatory(:, :), structural(:, :)
      !> What a rotation speed that follows the frequency adds, in the coordinates: nothing is
      !> condensed then.
      type(nodal_speed), allocatable :: speed
      !> Observed quantities (n_observed, n_coordinates), (n_observed, n_internal).
      complex(wp), allocatable :: observe_q(:, :), observe_i(:, :)
      !> What parameters change of M, C and the static load, of coordinates and internal modes
      !> together (m + n_internal, m + n_internal, n_changes), (m + n_internal, n_changes); not
      !> allocated where none is asked for.
      complex(wp), allocatable :: change_m(:, :, :), change_c(:, :, :), change_load(:, :)
      !> Coordinates that this nodal diameter does not have (n_coordinates).
      logical, allocatable :: padded(:)
      !> Numbers of the internal modes that became coordinates.
      integer, allocatable :: kept(:)
      !> The basis, while it is built.
      complex(wp), allocatable, private :: t_q(:, :), t_i(:, :)
   contains
      procedure :: find_modes
      procedure :: keep_resonances
      procedure :: keep_all
      procedure :: keep_dofs
      procedure :: take_speed
      procedure :: keep_of_mode
      procedure :: transform
      procedure :: pushes_free_mode
      procedure :: has_whirl
      procedure :: norms
   end type sector_reduction

   !> As of fw_reduction, with the same reasons.
   real(wp), parameter :: off_diagonal_tolerance = 1.0e-12_wp, undamped_ratio = 1.0e-7_wp, &
                          free_stiffness = 1.0e-11_wp
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp]

contains

   !> Modes of the sector with its relative coordinates held, and their damping.
   subroutine find_modes(self, nodal_diameter, nodal, relative, error)
      class(sector_reduction), intent(out) :: self
      integer, intent(in) :: nodal_diameter
      type(nodal_matrices), intent(in) :: nodal
      type(sector_relative), intent(in) :: relative
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: k(:, :), m(:, :), modes(:, :), k_iq(:, :)
      real(wp) :: shift
      integer :: trial
      logical :: done

      self%nodal_diameter = nodal_diameter
      call split_basis(relative, size(nodal%mass, 1), self%t_q, self%t_i)
      k = congruence(self%t_i, nodal%stiffness, self%t_i)
      m = congruence(self%t_i, nodal%mass, self%t_i)
      do trial = merge(1, 2, is_regular(k)), size(shift_trials)
         shift = shift_trials(trial)*norm2(abs(k))/max(norm2(abs(m)), tiny(1.0_wp))
         call solve_hermitian_eigen(m, k + shift*m, self%m_i, modes, done)
         if (done) exit
      end do
      if (.not. done) then
         call fatal_error(error, 'nodal diameter '//to_text(nodal_diameter)//': the sector '// &
                          'with its contact held has a part without both stiffness and mass '// &
                          '(or a mass that is not positive); check the mass and stiffness '// &
                          'matrices', status_input)
         return
      end if
      self%k_i = 1.0_wp - shift*self%m_i
      where (abs(self%k_i) < free_stiffness) self%k_i = 0.0_wp
      self%t_i = product_of(self%t_i, modes)
      self%n_internal = size(self%t_i, 2)
      allocate (self%kept(0))
      call take_damping(self, nodal)
      if (trial > 1) return
      ! Static constraint modes: K_iq vanishes, and Z_r(0) is exact.
      k_iq = congruence(self%t_i, nodal%stiffness, self%t_q)
      self%t_q = self%t_q - product_of(self%t_i, k_iq)
   end subroutine find_modes

   !> u = t_q q + t_i eta of the relative coordinates, before any mode.
   pure subroutine split_basis(relative, n, t_q, t_i)
      type(sector_relative), intent(in) :: relative
      !> Coordinates of the nodal diameter: modal ones may stand behind those of the rows.
      integer, intent(in) :: n
      complex(wp), intent(out), allocatable :: t_q(:, :), t_i(:, :)
      integer :: j, n_free, n_rows

      n_free = size(relative%free)
      n_rows = n_free + size(relative%pivot)
      allocate (t_q(n, size(relative%pivot)), t_i(n, n - size(relative%pivot)), &
                source=(0.0_wp, 0.0_wp))
      t_q(relative%pivot, :) = relative%c
      t_i(relative%pivot, :n_free) = -relative%r
      do j = 1, n_free
         t_i(relative%free(j), j) = (1.0_wp, 0.0_wp)
      end do
      do j = 1, n - n_rows
         t_i(n_rows + j, n_free + j) = (1.0_wp, 0.0_wp)
      end do
   end subroutine split_basis

   !> Damping of the internal modes.
   subroutine take_damping(self, nodal)
      class(sector_reduction), intent(inout) :: self
      type(nodal_matrices), intent(in) :: nodal
      complex(wp), allocatable :: damping(:, :)
      integer :: j

      if (allocated(self%c_i)) deallocate (self%c_i)
      allocate (self%c_i(self%n_internal), source=0.0_wp)
      if (allocated(self%c_ii)) deallocate (self%c_ii)
      if (.not. allocated(nodal%damping)) return
      damping = congruence(self%t_i, nodal%damping, self%t_i)
      do j = 1, self%n_internal
         self%c_i(j) = real(damping(j, j), wp)
         damping(j, j) = (0.0_wp, 0.0_wp)
      end do
      if (norm2(abs(damping)) <= off_diagonal_tolerance*norm2(self%c_i)) return
      do j = 1, self%n_internal
         damping(j, j) = cmplx(self%c_i(j), kind=wp)
      end do
      self%c_ii = damping
   end subroutine take_damping

   !> Internal modes without damping that a harmonic may hit become coordinates, scaled to a largest
   !> displacement of 1, see fw_reduction.
   subroutine keep_resonances(self, harmonic, omega_range, whirls, nodal)
      class(sector_reduction), intent(inout) :: self
      !> The harmonics of this nodal diameter.
      integer, intent(in) :: harmonic(:)
      real(wp), intent(in) :: omega_range(2)
      !> Whether blocks couple the internal modes that are not Hermitian.
      logical, intent(in) :: whirls
      type(nodal_matrices), intent(in) :: nodal
      real(wp), parameter :: margin = 1.0e-2_wp
      logical :: keep(self%n_internal)
      real(wp) :: frequency
      complex(wp), allocatable :: structural(:, :)
      integer :: j

      if (allocated(nodal%structural)) structural = congruence(self%t_i, nodal%structural, self%t_i)
      keep = .false.
      do j = 1, self%n_internal
         if (self%k_i(j) <= 0.0_wp .or. self%m_i(j) <= 0.0_wp) cycle
         frequency = sqrt(self%k_i(j)/self%m_i(j))
         if (self%c_i(j) > 2.0_wp*undamped_ratio*sqrt(self%k_i(j)*self%m_i(j))) cycle
         if (allocated(structural)) then
            if (real(structural(j, j), wp) > 2.0_wp*undamped_ratio*self%k_i(j)) cycle
         end if
         ! Nobody knows where Coriolis forces move them, or what the air leaves of damping.
         keep(j) = whirls .or. any(frequency >= (1.0_wp - margin)*harmonic*omega_range(1) .and. &
                                   frequency <= (1.0_wp + margin)*harmonic*omega_range(2))
      end do
      call move_to_coordinates(self, keep)
   end subroutine keep_resonances

   !> Of a nonlinear mode: all of the nodal diameter of the mode itself; of others those that a
   !> harmonic may hit, damped or not, for the self-excitation cancels damping.
   subroutine keep_of_mode(self, is_first, highest, whirls)
      class(sector_reduction), intent(inout) :: self
      logical, intent(in) :: is_first
      !> Highest frequency of the harmonics of this nodal diameter [rad/s].
      real(wp), intent(in) :: highest
      logical, intent(in) :: whirls

      associate (vibrates => self%m_i > 0.0_wp .and. self%k_i > 0.0_wp, &
                 is_met => whirls .or. self%k_i <= highest**2*self%m_i)
         call move_to_coordinates(self, is_first .or. (vibrates .and. is_met))
      end associate
   end subroutine keep_of_mode

   !> Condense nothing: forces across the motion may take from any mode what damping it has, and
   !> hold a free one.
   subroutine keep_all(self)
      class(sector_reduction), intent(inout) :: self

      call move_to_coordinates(self, spread(.true., 1, self%n_internal))
   end subroutine keep_all

   !> Condense nothing, in a basis that no speed changes: every free dof is a coordinate.
   subroutine keep_dofs(self, nodal_diameter, n, relative)
      class(sector_reduction), intent(out) :: self
      integer, intent(in) :: nodal_diameter
      !> Coordinates of the nodal diameter.
      integer, intent(in) :: n
      type(sector_relative), intent(in) :: relative

      self%nodal_diameter = nodal_diameter
      call split_basis(relative, n, self%t_q, self%t_i)
      self%n_internal = size(self%t_i, 2)
      allocate (self%k_i(self%n_internal), self%m_i(self%n_internal), self%c_i(self%n_internal), &
                source=0.0_wp)
      allocate (self%kept(0))
      call move_to_coordinates(self, spread(.true., 1, self%n_internal))
   end subroutine keep_dofs

   !> Take what follows the frequency to the coordinates; before `transform`, which forgets the
   !> basis. All that are free stand in the places of all nodal diameters.
   subroutine take_speed(self, speed, n_coordinates, slot)
      class(sector_reduction), intent(inout) :: self
      type(nodal_speed), intent(in) :: speed
      integer, intent(in) :: n_coordinates
      !> See transform.
      integer, intent(in) :: slot(:)
      complex(wp) :: t(size(self%t_q, 1), n_coordinates)

      t = (0.0_wp, 0.0_wp)
      t(:, slot) = self%t_q
      allocate (self%speed)
      self%speed = speed%in_basis(t)
   end subroutine take_speed

   !> Make coordinates of internal modes.
   subroutine move_to_coordinates(self, keep)
      class(sector_reduction), intent(inout) :: self
      logical, intent(in) :: keep(:)
      complex(wp), allocatable :: wider(:, :)
      integer, allocatable :: others(:)
      integer :: j, m

      if (.not. any(keep)) return
      self%kept = pack([(j, j=1, size(keep))], keep)
      others = pack([(j, j=1, size(keep))], .not. keep)
      m = size(self%t_q, 2)
      allocate (wider(size(self%t_q, 1), m + size(self%kept)))
      wider(:, :m) = self%t_q
      do j = 1, size(self%kept)
         wider(:, m + j) = self%t_i(:, self%kept(j))/maxval(abs(self%t_i(:, self%kept(j))))
      end do
      self%t_q = wider
      self%t_i = self%t_i(:, others)
      self%k_i = self%k_i(others)
      self%m_i = self%m_i(others)
      self%c_i = self%c_i(others)
      self%n_internal = size(others)
   end subroutine move_to_coordinates

   !> Whether a static load acts on a mode that nothing holds.
   pure logical function pushes_free_mode(self, nodal) result(pushes)
      class(sector_reduction), intent(in) :: self
      type(nodal_matrices), intent(in) :: nodal
      real(wp), parameter :: round_off = 1.0e-9_wp
      complex(wp) :: load(self%n_internal, size(nodal%load, 2))

      load = matmul(conjg(transpose(self%t_i)), nodal%load)
      pushes = any(abs(self%k_i) <= 0.0_wp .and. abs(load(:, 1)) > 0.0_wp .and. &
                   abs(load(:, 1)) > round_off*norm2(abs(load)))
   end function pushes_free_mode

   !> All blocks in the basis, with coordinates at the places that all nodal diameters share.
   subroutine transform(self, nodal, slot, n_coordinates, changes)
      class(sector_reduction), intent(inout) :: self
      type(nodal_matrices), intent(in) :: nodal
      !> Place of each coordinate of this nodal diameter, kept modes behind the relative ones.
      integer, intent(in) :: slot(:)
      integer, intent(in) :: n_coordinates
      !> What parameters change of this nodal diameter.
      type(nodal_change), intent(in), optional :: changes(:)
      complex(wp), allocatable :: t_q(:, :)
      integer :: j

      call move_alloc(self%t_q, t_q)
      allocate (self%t_q(size(t_q, 1), n_coordinates), source=(0.0_wp, 0.0_wp))
      self%t_q(:, slot) = t_q
      self%n_coordinates = n_coordinates
      allocate (self%padded(n_coordinates), source=.true.)
      self%padded(slot) = .false.
      self%n_blocks = merge(3, 2, allocated(nodal%damping))
      allocate (self%blocks(n_coordinates + self%n_internal, n_coordinates, self%n_blocks))
      call fill_blocks(nodal%stiffness, 1, self)
      call fill_blocks(nodal%mass, 2, self)
      if (self%n_blocks == 3) call fill_blocks(nodal%damping, 3, self)
      do j = 1, n_coordinates
         if (self%padded(j)) self%blocks(j, j, 1) = cmplx(pad_stiffness(self, slot), kind=wp)
      end do
      call take_damping(self, nodal)
      self%waves = nodal%waves
      self%load_q = matmul(conjg(transpose(self%t_q)), nodal%load)
      self%load_i = matmul(conjg(transpose(self%t_i)), nodal%load)
      self%observe_q = product_of(nodal%observe, self%t_q)
      self%observe_i = product_of(nodal%observe, self%t_i)
      if (nodal%has_whirl()) call take_whirl(nodal, self)
      if (present(changes)) call take_changes(changes, self)
      deallocate (self%t_q, self%t_i)
   end subroutine transform

   !> Changes in the whole basis. It spans all motions, so that its own dependence on the parameters
   !> changes no solution.
   subroutine take_changes(changes, self)
      type(nodal_change), intent(in) :: changes(:)
      type(sector_reduction), intent(inout) :: self
      complex(wp), allocatable :: t(:, :)
      integer :: k, m, n

      m = self%n_coordinates
      n = m + self%n_internal
      allocate (t(size(self%t_q, 1), n))
      t(:, :m) = self%t_q
      t(:, m + 1:) = self%t_i
      allocate (self%change_m(n, n, size(changes)), self%change_load(n, size(changes)))
      allocate (self%change_c, mold=self%change_m)
      do k = 1, size(changes)
         self%change_m(:, :, k) = congruence(t, changes(k)%mass, t)
         self%change_c(:, :, k) = congruence(t, changes(k)%damping, t)
         self%change_load(:, k) = matmul(changes(k)%load, conjg(t))
      end do
   end subroutine take_changes

   !> Coriolis matrix and stiffness of the air in the whole basis.
   subroutine take_whirl(nodal, self)
      type(nodal_matrices), intent(in) :: nodal
      type(sector_reduction), intent(inout) :: self
      complex(wp), allocatable :: t(:, :)
      integer :: m

      m = self%n_coordinates
      allocate (t(size(self%t_q, 1), m + self%n_internal))
      t(:, :m) = self%t_q
      t(:, m + 1:) = self%t_i
      if (allocated(nodal%coriolis)) self%coriolis = congruence(t, nodal%coriolis, t)
      if (allocated(nodal%circulatory)) self%circulatory = congruence(self%t_q, nodal%circulatory, &
                                                                      self%t_q)
      if (allocated(nodal%structural)) self%structural = congruence(t, nodal%structural, t)
      if (.not. allocated(nodal%aero)) return
      allocate (self%aero(size(t, 2), size(t, 2), 2))
      self%aero(:, :, 1) = congruence(t, nodal%aero(:, :, 1), t)
      t = conjg(t)
      self%aero(:, :, 2) = congruence(t, nodal%aero(:, :, 2), t)
   end subroutine take_whirl

   !> Whether the two directions of rotation differ: a gyroscopic or a circulatory part.
   pure logical function has_whirl(self)
      class(sector_reduction), intent(in) :: self

      has_whirl = allocated(self%coriolis) .or. allocated(self%aero)
   end function has_whirl

   !> Frobenius norms of K and M of the coordinates.
   pure function norms(self)
      class(sector_reduction), intent(in) :: self
      real(wp) :: norms(2)

      norms = [norm2(abs(self%blocks(:self%n_coordinates, :, 1))), &
               norm2(abs(self%blocks(:self%n_coordinates, :, 2)))]
   end function norms

   subroutine fill_blocks(matrix, block, self)
      complex(wp), intent(in) :: matrix(:, :)
      integer, intent(in) :: block
      type(sector_reduction), intent(inout) :: self

      self%blocks(:self%n_coordinates, :, block) = congruence(self%t_q, matrix, self%t_q)
      self%blocks(self%n_coordinates + 1:, :, block) = congruence(self%t_i, matrix, self%t_q)
   end subroutine fill_blocks

   !> A spring of the size of the others.
   pure real(wp) function pad_stiffness(self, slot) result(stiffness)
      type(sector_reduction), intent(in) :: self
      integer, intent(in) :: slot(:)
      integer :: j

      stiffness = 0.0_wp
      do j = 1, size(slot)
         stiffness = max(stiffness, abs(self%blocks(slot(j), slot(j), 1)))
      end do
      if (stiffness <= 0.0_wp) stiffness = 1.0_wp
   end function pad_stiffness

   !> Diagonal of the static condensed stiffness (n_coordinates of the nodal diameter)
   !> [force/length].
   subroutine static_diagonal(nodal_diameter, nodal, relative, diagonal, error)
      integer, intent(in) :: nodal_diameter
      type(nodal_matrices), intent(in) :: nodal
      type(sector_relative), intent(in) :: relative
      real(wp), allocatable, intent(out) :: diagonal(:)
      type(error_type), allocatable, intent(out) :: error
      type(sector_reduction) :: modal
      complex(wp), allocatable :: t_q(:, :), t_i(:, :), k_ii(:, :), k_iq(:, :), solved(:, :), &
         k_qq(:, :)
      integer :: info, j, m

      call split_basis(relative, size(nodal%mass, 1), t_q, t_i)
      m = size(t_q, 2)
      allocate (diagonal(m))
      k_ii = congruence(t_i, nodal%stiffness, t_i)
      if (cholesky(k_ii)) then
         k_qq = congruence(t_q, nodal%stiffness, t_q)
         k_iq = congruence(t_i, nodal%stiffness, t_q)
         solved = k_iq
         if (size(solved) > 0) call zpotrs('U', size(k_ii, 1), m, k_ii, size(k_ii, 1), solved, &
                                           size(solved, 1), info)
         diagonal = [(real(k_qq(j, j) - dot_product(k_iq(:, j), solved(:, j)), wp), j=1, m)]
         return
      end if
      ! A part that nothing holds: over its modes, without the free ones.
      call modal%find_modes(nodal_diameter, nodal, relative, error)
      if (allocated(error)) return
      call modal%transform(nodal, [(j, j=1, m)], m)
      do j = 1, m
         diagonal(j) = real(modal%blocks(j, j, 1), wp) - &
                       sum(abs(modal%blocks(m + 1:, j, 1))**2/modal%k_i, mask=abs(modal%k_i) > 0)
      end do
   end subroutine static_diagonal

end module fw_sector_reduction
