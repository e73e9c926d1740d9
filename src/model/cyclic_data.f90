!> A structure of equal sectors around an axis, of which one is given, and the wave that runs around
!> it: the motion of each sector is that of the one before it, delayed by engine_order/n_sectors of
!> a period. Harmonic n has the nodal diameter k = n engine_order modulo n_sectors, and from sector
!> to sector the factor z = exp(-2 pi i k/n_sectors).
module fw_cyclic_data
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_deviation, only: deviation_type
   use fw_kinds, only: pi, wp
   use fw_load_waves, only: load_waves
   use fw_speed_growth, only: speed_growth
   implicit none (type, external)
   private

   public :: cyclic_type, nodal_matrices, influence_type, nodal_speed, speed_matrices

   !> The sector tied to its neighbours, as it moves in one nodal diameter.
   type :: nodal_matrices
      !> Hermitian (n, n); the damping is not allocated where there is none.
      complex(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      !> Static, cosine and sine loads, then those of the waves, in columns (n, n_columns); of a
      !> nodal diameter above N/2, conjugates.
      complex(wp), allocatable :: load(:, :)
      !> Observed quantities (n_observed, n).
      complex(wp), allocatable :: observe(:, :)
      !> Rows of stress that stand with this nodal diameter (6 n_points, n), where there are any.
      complex(wp), allocatable :: stress(:, :)
      !> What the columns of the loads are.
      type(load_waves) :: waves
      !> Coriolis matrix times the rotation speed, skew-Hermitian (n, n), where there is one.
      !> With it stands the skew part of an unsymmetric damping.
      complex(wp), allocatable :: coriolis(:, :)
      !> Stiffness of the air, for the wave of this nodal diameter and for the one the other way, in
      !> the coordinates of each (n, n, 2), where there is one: neither Hermitian nor conjugates.
      !> Hysteretic damping i D is in it, which harmonic 0 does not have either, and the skew part
      !> of the stiffness.
      complex(wp), allocatable :: aero(:, :, :)
      !> The latter, which harmonic 0 has too (n, n), and D (n, n), where there are any.
      complex(wp), allocatable :: circulatory(:, :), structural(:, :)
   contains
      procedure :: has_whirl
      procedure :: add_structural
      procedure :: add_circulatory
   end type nodal_matrices

   !> Forces of the air by the motion of the sectors, linear in it: on sector 0 by that of sector m,
   !>
   !>   f_0 = W^T sum_m Q_m W u_m = W^T (sum_m Q_m z**m) W u_0,
   !>
   !> given by the sectors m, or by the sums themselves for signed nodal diameters. Not in harmonic
   !> 0.
   type :: influence_type
      !> Sectors, or nodal diameters (f).
      integer, allocatable :: number(:)
      logical :: by_diameter = .false.
      !> Q [force/length] (a, a, f), and the rows W (a, n_dof).
      complex(wp), allocatable :: matrix(:, :, :)
      real(wp), allocatable :: modes(:, :)
   end type influence_type

   !> What a rotation speed Omega that follows the frequency adds to the matrices and to the static
   !> load: Omega (G u' + R u) + Omega**2 (K_r u - f_r), and likewise higher even powers, with the
   !> damping that follows K_r.
   type :: speed_matrices
      !> Frequency over speed; 0: the speed does not follow.
      real(wp) :: order = 0.0_wp
      !> G and R (n_dof, n_dof).
      real(wp), allocatable :: coriolis(:, :), circulatory(:, :)
      !> K_r and f_r.
      type(speed_growth) :: growth
      !> Damping in proportion to K_r [s], and its loss factor.
      real(wp) :: rayleigh = 0.0_wp, loss = 0.0_wp
   end type speed_matrices

   !> The same of a tied sector in a nodal diameter 0 .. N/2 (n, n), with powers of the stiffness
   !> (n, n, n_powers) and of the load (n, n_powers), which acts in harmonic 0 alone.
   type :: nodal_speed
      real(wp) :: order = 0.0_wp, rayleigh = 0.0_wp, loss = 0.0_wp
      complex(wp), allocatable :: coriolis(:, :), circulatory(:, :), stiffness(:, :, :)
      complex(wp), allocatable :: load(:, :)
   contains
      procedure :: n_powers
      procedure :: in_basis
   end type nodal_speed

   !> How many sectors there are, what joins them, and which wave is solved for.
   type :: cyclic_type
      logical :: is_cyclic = .false.
      !> Whether it is so for its matrices alone: one sector, which no neighbour has.
      logical :: is_alone = .false.
      integer :: n_sectors = 1
      integer :: engine_order = 0
      !> Whether contact differs from sector to sector, and the motion of all of them is looked for.
      logical :: is_mistuned = .false.
      !> Dofs of the interfaces: the right one of a sector is the left one of the next; a negative
      !> number on the right with its sign turned (n_interface).
      integer, allocatable :: left(:), right(:)
      !> Frequencies of each nodal diameter that analysis 'modes' lists.
      integer :: n_modes = 10
      !> Fraction of critical damping of every mode of every nodal diameter, where the matrices are
      !> those of a sector.
      real(wp) :: modal_damping = 0.0_wp
      !> In place of the matrices of a sector: those of nodal diameter k at place k + 1. What is
      !> not given is not allocated there.
      type(nodal_matrices), allocatable :: nodal(:)
      !> Of a sector: Coriolis matrix times the rotation speed and skew part of the damping, skew
      !> part of the stiffness, and the matrix of hysteretic damping (n_dof, n_dof).
      real(wp), allocatable :: coriolis(:, :), circulatory(:, :), structural(:, :)
      !> Hysteretic damping of matrices of nodal diameters, in proportion to their stiffness.
      real(wp) :: loss_factor = 0.0_wp
      !> What follows the frequency.
      type(speed_matrices), allocatable :: speed
      !> Forces of the air; not allocated where there are none.
      type(influence_type), allocatable :: air
      !> What sectors have beside each other; not allocated where they are alike.
      type(deviation_type), allocatable :: deviation
   contains
      procedure :: nodal_diameter
      procedure :: factor
      procedure :: has_nodal
      procedure :: has_sectors
      procedure :: holds
      procedure :: air_stiffness
      procedure :: splits_waves
      procedure :: n_solved
   end type cyclic_type

contains

   !> Signed nodal diameter of a harmonic, above -N/2 up to N/2: positive towards higher sectors.
   elemental integer function nodal_diameter(self, harmonic) result(k)
      class(cyclic_type), intent(in) :: self
      integer, intent(in) :: harmonic
      integer(int64) :: turn

      turn = int(modulo(self%engine_order, self%n_sectors), int64)*harmonic
      k = int(modulo(turn, int(self%n_sectors, int64)))
      if (2_int64*k > self%n_sectors) k = k - self%n_sectors
   end function nodal_diameter

   !> exp(-2 pi i k sectors/N), exact where it is real or imaginary.
   elemental complex(wp) function factor(self, k, sectors) result(z)
      class(cyclic_type), intent(in) :: self
      integer, intent(in) :: k, sectors
      integer(int64) :: n, steps
      real(wp) :: angle

      n = self%n_sectors
      steps = modulo(int(k, int64)*sectors, n)
      if (modulo(4*steps, n) == 0) then
         select case (4*steps/n)
         case (0)
            z = (1.0_wp, 0.0_wp)
         case (1)
            z = (0.0_wp, -1.0_wp)
         case (2)
            z = (-1.0_wp, 0.0_wp)
         case default ! three quarters
            z = (0.0_wp, 1.0_wp)
         end select
         return
      end if
      ! Conjugates are conjugates to the last bit.
      angle = -2.0_wp*pi*real(min(steps, n - steps), wp)/real(n, wp)
      z = cmplx(cos(angle), merge(sin(angle), -sin(angle), 2*steps < n), wp)
   end function factor

   !> Sectors whose motion is solved for.
   elemental integer function n_solved(self) result(n)
      class(cyclic_type), intent(in) :: self

      n = merge(max(1, self%n_sectors), 1, self%is_mistuned)
   end function n_solved

   !> Whether the model holds matrices of nodal diameters, not of a sector.
   pure logical function has_nodal(self)
      class(cyclic_type), intent(in) :: self

      has_nodal = allocated(self%nodal)
   end function has_nodal

   !> Whether sectors stand around an axis: not of a structure that goes this way for its matrices.
   elemental logical function has_sectors(self)
      class(cyclic_type), intent(in) :: self

      has_sectors = self%is_cyclic .and. .not. self%is_alone
   end function has_sectors

   !> Whether the model holds what nodal diameter k = 0 .. N/2 needs.
   pure logical function holds(self, k)
      class(cyclic_type), intent(in) :: self
      integer, intent(in) :: k

      holds = .not. allocated(self%nodal)
      if (holds) return
      if (k >= size(self%nodal)) return
      holds = allocated(self%nodal(k + 1)%mass)
   end function holds

   !> Whether waves in both directions differ, and blocks are not Hermitian.
   pure logical function has_whirl(self)
      class(nodal_matrices), intent(in) :: self

      has_whirl = allocated(self%coriolis) .or. allocated(self%aero)
   end function has_whirl

   !> Powers of the stiffness.
   pure integer function n_powers(self)
      class(nodal_speed), intent(in) :: self

      n_powers = 0
      if (allocated(self%stiffness)) n_powers = size(self%stiffness, 3)
   end function n_powers

   !> The coordinates of u = T q.
   pure function in_basis(self, t) result(reduced)
      class(nodal_speed), intent(in) :: self
      complex(wp), intent(in) :: t(:, :)
      type(nodal_speed) :: reduced
      integer :: p

      reduced%order = self%order
      reduced%rayleigh = self%rayleigh
      reduced%loss = self%loss
      call take(self%coriolis, reduced%coriolis)
      call take(self%circulatory, reduced%circulatory)
      if (allocated(self%stiffness)) then
         allocate (reduced%stiffness(size(t, 2), size(t, 2), size(self%stiffness, 3)))
         ! Power by power: each is Hermitian.
         do p = 1, size(self%stiffness, 3)
            reduced%stiffness(:, :, p) = matmul(conjg(transpose(t)), &
                                                matmul(self%stiffness(:, :, p), t))
         end do
      end if
      if (allocated(self%load)) reduced%load = matmul(conjg(transpose(t)), self%load)

   contains

      pure subroutine take(matrix, changed)
         complex(wp), allocatable, intent(in) :: matrix(:, :)
         complex(wp), allocatable, intent(inout) :: changed(:, :)

         if (allocated(matrix)) changed = matmul(conjg(transpose(t)), matmul(matrix, t))
      end subroutine take

   end function in_basis

   !> Add hysteretic damping i D, D being Hermitian, to what the waves in both directions feel.
   pure subroutine add_structural(self, matrix)
      class(nodal_matrices), intent(inout) :: self
      complex(wp), intent(in) :: matrix(:, :)
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)

      call add_to_waves(self, i*matrix, i*conjg(matrix))
      if (.not. allocated(self%structural)) then
         self%structural = matrix
      else
         self%structural = self%structural + matrix
      end if
   end subroutine add_structural

   !> Add the skew part of a stiffness.
   pure subroutine add_circulatory(self, matrix)
      class(nodal_matrices), intent(inout) :: self
      complex(wp), intent(in) :: matrix(:, :)

      call add_to_waves(self, matrix, conjg(matrix))
      self%circulatory = matrix
   end subroutine add_circulatory

   !> Add to what the wave of this nodal diameter feels, and that the other way.
   pure subroutine add_to_waves(self, forward, backward)
      class(nodal_matrices), intent(inout) :: self
      complex(wp), intent(in) :: forward(:, :), backward(:, :)

      if (.not. allocated(self%aero)) then
         allocate (self%aero(size(forward, 1), size(forward, 2), 2), source=(0.0_wp, 0.0_wp))
      end if
      self%aero(:, :, 1) = self%aero(:, :, 1) + forward
      self%aero(:, :, 2) = self%aero(:, :, 2) + backward
   end subroutine add_to_waves

   !> The same of the whole model.
   pure logical function splits_waves(self)
      class(cyclic_type), intent(in) :: self
      integer :: k

      splits_waves = allocated(self%coriolis) .or. allocated(self%air) .or. &
                     allocated(self%circulatory) .or. turns(self%speed) .or. (self%is_alone .and. &
                                                       allocated(self%structural))
      if (splits_waves .or. .not. allocated(self%nodal)) return
      splits_waves = any([(allocated(self%nodal(k)%coriolis), k=1, size(self%nodal))])
   end function splits_waves

   !> Whether forces follow a speed that differ for waves in both directions.
   pure logical function turns(speed)
      type(speed_matrices), allocatable, intent(in) :: speed

      turns = .false.
      if (allocated(speed)) turns = allocated(speed%coriolis) .or. allocated(speed%circulatory)
   end function turns

   !> - sum_m Q_m z**m of a signed nodal diameter (a, a); allocated only where it is known.
   pure subroutine air_stiffness(self, k, stiffness)
      class(cyclic_type), intent(in) :: self
      integer, intent(in) :: k
      complex(wp), allocatable, intent(out) :: stiffness(:, :)
      integer :: j

      associate (air => self%air)
         if (.not. air%by_diameter) then
            allocate (stiffness(size(air%matrix, 1), size(air%matrix, 2)), source=(0.0_wp, 0.0_wp))
            do j = 1, size(air%number)
               stiffness = stiffness - air%matrix(:, :, j)*self%factor(k, air%number(j))
            end do
            return
         end if
         do j = 1, size(air%number)
            if (modulo(air%number(j) - k, self%n_sectors) == 0) stiffness = -air%matrix(:, :, j)
         end do
      end associate
   end subroutine air_stiffness

end module fw_cyclic_data
