!> The basis in which a structure is condensed: u = T_q q + T_i xi, with the relative coordinates
!> q and modes xi of the structure with q held; all matrices, loads and observations in it.
module fw_reduction
   use fw_kinds, only: wp
   use fw_load_waves, only: load_waves
   use fw_error, only: error_type, fatal_error, status_input
   use fw_lapack, only: dgemm
   use fw_linalg, only: diagonalize, has_pivots, solve_symmetric_eigen
   use fw_model, only: model_type
   use fw_relative, only: relative_type
   use fw_size_options, only: sizes
   use fw_sparse_rows, only: new_sparse_rows, sparse_rows
   implicit none (type, external)
   private

   public :: reduction_type, new_reduction, held_basis, may_resonate_between

   !> A plain structure, condensed to the coordinates of the joint.
   type :: reduction_type
      integer :: n_coordinates = 0
      integer :: n_internal = 0
      !> Internal modes kept as coordinates, behind the relative ones: their numbers.
      integer, allocatable :: kept(:)
      !> Those of the coordinates that are kept modes without a coupling to anything else
      !> (n_coordinates).
      logical, allocatable :: alone(:)
      !> K, M and C, the last only where there is damping: rows of the coordinates, then of the
      !> internal modes (n_coordinates + n_internal, n_coordinates, n_blocks). One array, so that
      !> products with all of them are one product.
      integer :: n_blocks = 0
      real(wp), allocatable :: blocks(:, :, :)
      !> The rows of the internal modes again, for products with the transpose
      !> (n_internal, n_blocks, n_coordinates).
      real(wp), allocatable :: coupling(:, :, :)
      !> Diagonals of the internal modes (n_internal).
      real(wp), allocatable :: k_i(:), m_i(:), c_i(:)
      !> Internal damping, only where it is not diagonal (n_internal, n_internal).
      real(wp), allocatable :: c_ii(:, :)
      !> i times this much of the stiffness is hysteretic damping in harmonics above 0.
      real(wp) :: loss = 0.0_wp
      !> Loads in columns (n_coordinates, n_columns), (n_internal, n_columns), and what these are.
      real(wp), allocatable :: load_q(:, :), load_i(:, :)
      !> Observed quantities (n_observed, n_coordinates), (n_observed, n_internal).
      real(wp), allocatable :: observe_q(:, :), observe_i(:, :)
      type(load_waves) :: waves
      !> The basis itself, [T_q, T_i]; only of few dofs (n_dof, n_dof).
      real(wp), allocatable :: basis(:, :)
      !> Changes of K and C by parameters of the model, rows and columns of the coordinates, then of
      !> the internal modes (n, n, n_changes), and of the static load (n, n_changes); not allocated
      !> where none was asked for.
      real(wp), allocatable :: change_k(:, :, :), change_c(:, :, :), change_load(:, :)
      !> The same of M, where one of them changes that.
      real(wp), allocatable :: change_m(:, :, :)
      !> Whether that of K is one of hysteretic damping (n_changes).
      logical, allocatable :: change_loss(:)
   contains
      procedure :: loss_at
   end type reduction_type

   !> What asks for the eigenproblem, and neither depends on harmonics nor on frequencies: balances
   !> of one structure with several numbers of harmonics share it.
   type :: held_basis
      !> T_q and T_i; not allocated before the first.
      real(wp), allocatable, private :: t_q(:, :), t_i(:, :)
      !> Stiffness and mass of the modes with q held.
      real(wp), allocatable, private :: k_i(:), m_i(:)
   contains
      procedure :: is_known
   end type held_basis

   !> Internal damping counts as diagonal where what is off the diagonal is round-off.
   real(wp), parameter :: off_diagonal_tolerance = 1.0e-12_wp
   !> A mode with a smaller damping ratio counts as undamped: near its resonance the condensed
   !> stiffness would lose more than half of the digits.
   real(wp), parameter :: undamped_ratio = 1.0e-7_wp
   !> Round-off of sums with a kept mode, whose largest displacement is 1, over the sizes of what it
   !> is multiplied by: each of its displacements is good to some hundred times epsilon.
   real(wp), parameter :: mode_round_off = 1.0e-13_wp
   !> Couplings of a mode are none beside its own stiffness, mass or critical damping.
   real(wp), parameter :: own_round_off = 1.0e-12_wp
   !> Relative stiffness below which an internal mode is free.
   real(wp), parameter :: free_stiffness = 1.0e-11_wp

contains

   !> Build the basis; errors where the structure has a part that nothing holds.
   subroutine new_reduction(model, relative, harmonic, omega_range, self, error, keep_all, held, &
                            keep_none)
      type(model_type), intent(in) :: model
      type(relative_type), intent(in) :: relative
      integer, intent(in) :: harmonic(:)
      !> Lowest and highest frequency of the run [rad/s].
      real(wp), intent(in) :: omega_range(2)
      type(reduction_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Condense nothing: every internal mode becomes a coordinate.
      logical, intent(in), optional :: keep_all
      !> Of the same model and relative coordinates: taken where it is known, else found and left.
      type(held_basis), intent(inout), optional :: held
      !> Condense every internal mode, whatever a harmonic may hit.
      logical, intent(in), optional :: keep_none
      type(held_basis) :: basis
      real(wp), allocatable :: t_q(:, :), t_i(:, :)
      logical, allocatable :: keep(:)
      integer :: j

      if (present(held)) basis = held
      if (.not. basis%is_known()) then
         call find_basis(model, relative, basis, error)
         if (allocated(error)) return
         if (present(held)) held = basis
      end if
      self%loss = model%loss_factor
      call move_alloc(basis%t_q, t_q)
      call move_alloc(basis%t_i, t_i)
      call move_alloc(basis%k_i, self%k_i)
      call move_alloc(basis%m_i, self%m_i)
      call transform(model, t_q, t_i, self)
      call check_free_modes(self, error)
      if (allocated(error)) return
      keep = undamped_resonances(self, harmonic, omega_range)
      if (present(keep_none)) keep = keep .and. .not. keep_none
      if (present(keep_all)) keep = keep .or. keep_all
      if (any(keep)) then
         call separate_equals(keep, t_i, self, error)
         if (allocated(error)) return
         call move_to_coordinates(keep, t_q, t_i, self)
         call transform(model, t_q, t_i, self)
      end if
      self%kept = pack([(j, j=1, size(keep))], keep)
      call clear_round_off(model, t_q, t_i, self)
      if (model%n_dof <= sizes%kept_basis) then
         self%basis = reshape([t_q, t_i], [model%n_dof, model%n_dof])
      end if
      if (allocated(model%changes)) call transform_changes(model, t_q, t_i, self)
   end subroutine new_reduction

   !> Find the kept modes that nothing couples to, and zero what round-off has left of their
   !> couplings and loads: where a harmonic meets the mode nothing else stands in its row, and their
   !> quotient would be a motion. A mode with a single coupling that is more keeps all of them, as
   !> together they may be far less than each.
   subroutine clear_round_off(model, t_q, t_i, self)
      type(model_type), intent(in) :: model
      real(wp), intent(in) :: t_q(:, :), t_i(:, :)
      type(reduction_type), intent(inout) :: self
      real(wp), allocatable :: loads(:, :)
      integer :: block, c, first, j

      allocate (self%alone(self%n_coordinates), source=.false.)
      if (size(self%kept) == 0) return
      first = self%n_coordinates - size(self%kept) + 1
      self%alone(first:) = .true.
      call find_couplings(model%stiffness, t_q, t_i, first, 1, self)
      call find_couplings(model%mass, t_q, t_i, first, 2, self)
      if (self%n_blocks == 3) call find_couplings(model%damping, t_q, t_i, first, 3, self)
      loads = model%load_columns()
      do j = first, self%n_coordinates
         if (.not. self%alone(j)) cycle
         do block = 1, self%n_blocks
            associate (own => self%blocks(j, j, block))
               self%blocks(:j - 1, j, block) = 0.0_wp
               self%blocks(j + 1:, j, block) = 0.0_wp
               if (block == 3 .and. own <= own_round_off*critical(self, j)) own = 0.0_wp
            end associate
            self%blocks(j, :, block) = self%blocks(:self%n_coordinates, j, block)
            self%coupling(:, block, j) = 0.0_wp
         end do
         do c = 1, size(loads, 2)
            if (abs(self%load_q(j, c)) > mode_round_off*sum(abs(loads(:, c)))) cycle
            self%load_q(j, c) = 0.0_wp
         end do
      end do
   end subroutine clear_round_off

   !> Modes that one matrix couples to anything by more than round-off, of its sums and beside what
   !> the mode has itself, are not alone.
   subroutine find_couplings(matrix, t_q, t_i, first, block, self)
      real(wp), intent(in) :: matrix(:, :), t_q(:, :), t_i(:, :)
      !> The first kept mode.
      integer, intent(in) :: first, block
      type(reduction_type), intent(inout) :: self
      real(wp) :: sums(size(matrix, 2)), sizes(size(self%blocks, 1)), own, limit
      integer :: i, j, m

      m = self%n_coordinates
      sums = sum(abs(matrix), dim=1)
      sizes(:m) = matmul(sums, abs(t_q))
      sizes(m + 1:) = matmul(sums, abs(t_i))
      do j = first, m
         own = critical(self, j)
         if (block < 3) own = self%blocks(j, j, block)
         do i = 1, size(sizes)
            if (i == j) cycle
            limit = min(mode_round_off*sizes(i), own_round_off*own)
            if (abs(self%blocks(i, j, block)) > limit) self%alone(j) = .false.
         end do
      end do
   end subroutine find_couplings

   !> sqrt(k m) of a coordinate: half its critical damping.
   pure real(wp) function critical(self, j)
      type(reduction_type), intent(in) :: self
      integer, intent(in) :: j

      critical = sqrt(max(self%blocks(j, j, 1), 0.0_wp)*self%blocks(j, j, 2))
   end function critical

   !> What parameters change, in the basis. It spans all motions, so that its own dependence on the
   !> parameters changes no solution.
   subroutine transform_changes(model, t_q, t_i, self)
      type(model_type), intent(in) :: model
      real(wp), intent(in) :: t_q(:, :), t_i(:, :)
      type(reduction_type), intent(inout) :: self
      real(wp), allocatable :: t(:, :)
      integer :: k, m, n

      m = size(t_q, 2)
      n = m + size(t_i, 2)
      allocate (t(size(t_q, 1), n))
      t(:, :m) = t_q
      t(:, m + 1:) = t_i
      allocate (self%change_k(n, n, size(model%changes)), self%change_load(n, size(model%changes)))
      allocate (self%change_c, mold=self%change_k)
      self%change_loss = model%changes%is_loss
      do k = 1, size(model%changes)
         self%change_k(:, :, k) = congruence(t, model%changes(k)%stiffness, t)
         self%change_c(:, :, k) = congruence(t, model%changes(k)%damping, t)
         self%change_load(:, k) = matmul(model%changes(k)%load_static, t)
         if (.not. allocated(model%changes(k)%mass)) cycle
         if (.not. allocated(self%change_m)) then
            allocate (self%change_m(n, n, size(model%changes)), source=0.0_wp)
         end if
         self%change_m(:, :, k) = congruence(t, model%changes(k)%mass, t)
      end do
   end subroutine transform_changes

   !> Whether the eigenproblem was solved before.
   pure logical function is_known(self)
      class(held_basis), intent(in) :: self

      is_known = allocated(self%t_q)
   end function is_known

   !> The part that is as dear as the cube of the dofs, and depends on nothing but the structure.
   subroutine find_basis(model, relative, basis, error)
      type(model_type), intent(in) :: model
      type(relative_type), intent(in) :: relative
      type(held_basis), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      call split_basis(relative, basis%t_q, basis%t_i)
      call internal_modes(model, basis%t_q, basis%t_i, basis%k_i, basis%m_i, error)
   end subroutine find_basis

   !> u = t_q q + t_i eta of the relative coordinates, before any mode.
   subroutine split_basis(relative, t_q, t_i)
      type(relative_type), intent(in) :: relative
      real(wp), intent(out), allocatable :: t_q(:, :), t_i(:, :)
      integer :: j

      allocate (t_q(relative%n_dof, relative%n_coordinates), source=0.0_wp)
      allocate (t_i(relative%n_dof, size(relative%free)), source=0.0_wp)
      ! Dofs that the relation solves for (pivots) follow q and the free dofs: u_p = c q - r u_f.
      t_q(relative%pivot, :) = relative%c
      t_i(relative%pivot, :) = -relative%r
      do j = 1, size(relative%free)
         t_i(relative%free(j), j) = 1.0_wp
      end do
   end subroutine split_basis

   !> Modes of the structure with q held. With K_ii positive definite they come from
   !> M x = theta K x, so that massless dofs are no exception; otherwise from a shifted pencil.
   subroutine internal_modes(model, t_q, t_i, k_i, m_i, error)
      type(model_type), intent(in) :: model
      real(wp), intent(inout), allocatable :: t_q(:, :), t_i(:, :)
      real(wp), intent(out), allocatable :: k_i(:), m_i(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp]
      real(wp), allocatable :: k(:, :), m(:, :), modes(:, :), k_iq(:, :)
      type(sparse_rows) :: coordinates
      real(wp) :: shift
      integer :: trial
      logical :: done

      k = congruence(t_i, model%stiffness, t_i)
      m = congruence(t_i, model%mass, t_i)
      do trial = merge(1, 2, has_pivots(k)), size(shift_trials)
         ! In units of the ratio of both matrices; no shift where K alone is positive definite.
         shift = shift_trials(trial)*norm2(k)/max(norm2(m), tiny(1.0_wp))
         call solve_symmetric_eigen(m, k + shift*m, m_i, modes, done)
         if (done) exit
      end do
      if (.not. done) then
         call fatal_error(error, 'the structure with its contact held has a part without both '// &
                          'stiffness and mass (or a mass that is not positive); check the mass '// &
                          'and stiffness matrices', status_input)
         return
      end if
      ! Modes come with x^T (K + shift M) x = 1 and x^T M x = theta.
      k_i = 1.0_wp - shift*m_i
      where (abs(k_i) < free_stiffness) k_i = 0.0_wp
      t_i = product_of(t_i, modes)
      if (trial > 1) return
      ! Static constraint modes: K_iq vanishes, and Z_r(0) is exact.
      ! K_ii = 1 in these modes: x = -K_iq q is the static answer to q.
      coordinates = new_sparse_rows(t_q)
      k_iq = transpose(coordinates%times_transposed(product_of(model%stiffness, t_i)))
      t_q = t_q - product_of(t_i, k_iq)
   end subroutine internal_modes

   !> All blocks in the basis.
   subroutine transform(model, t_q, t_i, self)
      type(model_type), intent(in) :: model
      real(wp), intent(in) :: t_q(:, :), t_i(:, :)
      type(reduction_type), intent(inout) :: self
      real(wp), allocatable :: loads(:, :), damping(:, :)
      type(sparse_rows) :: coordinates
      integer :: j

      self%n_coordinates = size(t_q, 2)
      self%n_internal = size(t_i, 2)
      ! Products without a third block are a third cheaper.
      self%n_blocks = merge(3, 2, any(abs(model%damping) > 0.0_wp))
      if (allocated(self%blocks)) deallocate (self%blocks, self%coupling)
      allocate (self%blocks(self%n_coordinates + self%n_internal, self%n_coordinates, &
                            self%n_blocks))
      allocate (self%coupling(self%n_internal, self%n_blocks, self%n_coordinates))
      ! The dofs of the pairs are few of the coordinates each, those between them few.
      coordinates = new_sparse_rows(t_q)
      call fill_blocks(model%stiffness, coordinates, t_i, 1, self)
      call fill_blocks(model%mass, coordinates, t_i, 2, self)
      if (self%n_blocks == 3) call fill_blocks(model%damping, coordinates, t_i, 3, self)
      damping = congruence(t_i, model%damping, t_i)
      self%c_i = [(damping(j, j), j=1, self%n_internal)]
      ! What is left off the diagonal decides.
      do j = 1, self%n_internal
         damping(j, j) = 0.0_wp
      end do
      if (allocated(self%c_ii)) deallocate (self%c_ii)
      if (norm2(damping) > off_diagonal_tolerance*norm2(self%c_i)) then
         do j = 1, self%n_internal
            damping(j, j) = self%c_i(j)
         end do
         self%c_ii = damping
      end if
      loads = model%load_columns()
      self%waves = model%waves
      self%load_q = matmul(transpose(t_q), loads)
      self%load_i = matmul(transpose(t_i), loads)
      self%observe_q = product_of(model%observe_matrix, t_q)
      self%observe_i = product_of(model%observe_matrix, t_i)
   end subroutine transform

   !> T_q^T A T_q over T_i^T A T_q, A being K (block 1), M (2) or C (3).
   subroutine fill_blocks(matrix, t_q, t_i, block, self)
      real(wp), intent(in) :: matrix(:, :)
      type(sparse_rows), intent(in) :: t_q
      real(wp), intent(in) :: t_i(:, :)
      integer, intent(in) :: block
      type(reduction_type), intent(inout) :: self
      real(wp), allocatable :: half(:, :)
      integer :: m

      m = self%n_coordinates
      half = t_q%times_left(matrix)
      self%blocks(:m, :, block) = t_q%times_transposed(half)
      self%coupling(:, block, :) = transposed_product_of(t_i, half)
      self%blocks(m + 1:, :, block) = self%coupling(:, block, :)
   end subroutine fill_blocks

   !> Internal modes that have no damping and whose frequency a harmonic may hit.
   pure function undamped_resonances(self, harmonic, omega_range) result(keep)
      type(reduction_type), intent(in) :: self
      integer, intent(in) :: harmonic(:)
      real(wp), intent(in) :: omega_range(2)
      logical :: keep(self%n_internal)
      integer :: j

      do j = 1, self%n_internal
         keep(j) = is_undamped(self, j) .and. is_hit(frequency(self, j), frequency(self, j), &
                                                     harmonic, omega_range)
      end do
   end function undamped_resonances

   !> Whether a harmonic may hit an internal mode without damping where the structure goes from one
   !> to another, mode after mode.
   pure logical function may_resonate_between(one, other, harmonic, omega_range) result(may)
      !> Of the same relative coordinates, nothing kept.
      type(reduction_type), intent(in) :: one, other
      integer, intent(in) :: harmonic(:)
      real(wp), intent(in) :: omega_range(2)
      real(wp) :: ends(2)
      integer :: j

      may = .false.
      do j = 1, one%n_internal
         if (.not. (is_undamped(one, j) .or. is_undamped(other, j))) cycle
         ends = [frequency(one, j), frequency(other, j)]
         may = may .or. is_hit(minval(ends), maxval(ends), harmonic, omega_range)
      end do
   end function may_resonate_between

   !> Damping ratio: c/(2 sqrt(k m)); static and free modes do not count.
   pure logical function is_undamped(self, mode)
      type(reduction_type), intent(in) :: self
      integer, intent(in) :: mode

      associate (k => self%k_i(mode), m => self%m_i(mode), c => self%c_i(mode))
         is_undamped = k > 0.0_wp .and. m > 0.0_wp
         if (is_undamped) is_undamped = .not. (c > 2.0_wp*undamped_ratio*sqrt(k*m) .or. &
                                               self%loss > 2.0_wp*undamped_ratio)
      end associate
   end function is_undamped

   !> Part of the stiffness that damps a harmonic: none in harmonic 0.
   elemental real(wp) function loss_at(self, s) result(loss)
      class(reduction_type), intent(in) :: self
      !> n omega.
      real(wp), intent(in) :: s

      loss = merge(self%loss, 0.0_wp, s > 0.0_wp)
   end function loss_at

   !> Of an internal mode [rad/s]; 0 where it does not vibrate.
   pure real(wp) function frequency(self, mode)
      type(reduction_type), intent(in) :: self
      integer, intent(in) :: mode

      frequency = 0.0_wp
      if (self%k_i(mode) > 0.0_wp .and. self%m_i(mode) > 0.0_wp) then
         frequency = sqrt(self%k_i(mode)/self%m_i(mode))
      end if
   end function frequency

   !> Whether a harmonic lies between two frequencies of a mode, or so near that digits are lost.
   pure logical function is_hit(lowest, highest, harmonic, omega_range)
      real(wp), intent(in) :: lowest, highest
      integer, intent(in) :: harmonic(:)
      real(wp), intent(in) :: omega_range(2)
      ! Near a pole digits are lost as well.
      real(wp), parameter :: margin = 1.0e-2_wp

      is_hit = any(highest >= (1.0_wp - margin)*harmonic*omega_range(1) .and. &
                   lowest <= (1.0_wp + margin)*harmonic*omega_range(2))
   end function is_hit

   !> Of undamped modes of one frequency any mixture is one: take those of which as many as possible
   !> move nothing else, as equal parts of a structure that move against each other.
   subroutine separate_equals(keep, t_i, self, error)
      logical, intent(in) :: keep(:)
      real(wp), intent(inout) :: t_i(:, :)
      type(reduction_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Of frequencies that are the same.
      real(wp), parameter :: alike = 1.0e-12_wp
      real(wp), allocatable :: coupling(:, :), mixture(:, :), values(:)
      logical :: waits(size(keep))
      integer, allocatable :: equals(:)
      real(wp) :: weight
      integer :: b, j

      waits = [(keep(j) .and. is_undamped(self, j), j=1, size(keep))]
      do j = 1, size(keep)
         if (.not. waits(j)) cycle
         equals = pack([(b, b=1, size(keep))], waits .and. &
                       abs(self%k_i*self%m_i(j) - self%m_i*self%k_i(j)) <= &
                       alike*self%k_i*self%m_i(j))
         waits(equals) = .false.
         if (size(equals) == 1 .or. self%n_coordinates == 0) cycle
         allocate (mixture(size(equals), size(equals)), source=0.0_wp)
         do b = 1, self%n_blocks
            ! Each matrix by itself, with the factor that it has where a harmonic meets the modes: 1
            ! of K, omega**2 of M, omega of C.
            weight = merge(1.0_wp, frequency(self, j)**merge(2, 1, b == 2), b == 1)
            coupling = weight*self%coupling(equals, b, :)
            mixture = mixture + matmul(coupling, transpose(coupling))
         end do
         call diagonalize(mixture, values, 'modes of one frequency', error)
         if (allocated(error)) return
         t_i(:, equals) = matmul(t_i(:, equals), mixture)
         deallocate (mixture)
      end do
   end subroutine separate_equals

   !> Kept modes are scaled to a largest displacement of 1: their equations are forces then, as
   !> those of the relative coordinates are, and the norm of a residual means the same in all units.
   subroutine move_to_coordinates(keep, t_q, t_i, self)
      logical, intent(in) :: keep(:)
      real(wp), intent(inout), allocatable :: t_q(:, :), t_i(:, :)
      type(reduction_type), intent(inout) :: self
      integer, allocatable :: kept(:), others(:)
      real(wp), allocatable :: wider(:, :)
      integer :: j, m

      kept = pack([(j, j=1, size(keep))], keep)
      others = pack([(j, j=1, size(keep))], .not. keep)
      m = size(t_q, 2)
      allocate (wider(size(t_q, 1), m + size(kept)))
      wider(:, :m) = t_q
      do j = 1, size(kept)
         wider(:, m + j) = t_i(:, kept(j))/maxval(abs(t_i(:, kept(j))))
      end do
      t_q = wider
      t_i = t_i(:, others)
      self%k_i = self%k_i(others)
      self%m_i = self%m_i(others)
   end subroutine move_to_coordinates

   !> A free internal mode has no static position: refuse a static load on it.
   subroutine check_free_modes(self, error)
      type(reduction_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: round_off = 1.0e-9_wp
      integer :: j

      do j = 1, self%n_internal
         if (abs(self%k_i(j)) > 0.0_wp) cycle
         if (abs(self%load_i(j, 1)) > round_off*norm2(self%load_i) .and. &
             abs(self%load_i(j, 1)) > 0.0_wp) then
            call fatal_error(error, '&load static pushes a part of the structure that neither '// &
                             'stiffness nor contact holds; hold it or remove the load', &
                             status_input)
            return
         end if
      end do
   end subroutine check_free_modes

   !> a^T b c for b (n, n).
   function congruence(a, b, c) result(value)
      real(wp), intent(in) :: a(:, :), b(:, :), c(:, :)
      real(wp), allocatable :: value(:, :)

      value = transposed_product_of(a, product_of(b, c))
   end function congruence

   !> a^T b.
   function transposed_product_of(a, b) result(value)
      real(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), allocatable :: value(:, :)

      allocate (value(size(a, 2), size(b, 2)))
      if (size(value) == 0) return
      call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_wp, a, size(a, 1), &
                 b, size(b, 1), 0.0_wp, value, size(a, 2))
   end function transposed_product_of

   !> a b.
   function product_of(a, b) result(value)
      real(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), allocatable :: value(:, :)

      allocate (value(size(a, 1), size(b, 2)))
      if (size(value) == 0) return
      call dgemm('N', 'N', size(a, 1), size(b, 2), size(a, 2), 1.0_wp, a, size(a, 1), &
                 b, max(1, size(b, 1)), 0.0_wp, value, size(a, 1))
   end function product_of

end module fw_reduction
