!> A structure of equal sectors around an axis, of which one is given, and the wave that runs around
!> it: the motion of each sector is that of the one before it, delayed by engine_order/n_sectors of
!> a period. Harmonic n has the nodal diameter k = n engine_order modulo n_sectors, and from sector
!> to sector the factor z = exp(-2 pi i k/n_sectors).
module fw_cyclic_data
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: pi, wp
   use fw_load_waves, only: load_waves
   implicit none (type, external)
   private

   public :: cyclic_type, nodal_matrices, influence_type

   !> The sector tied to its neighbours, as it moves in one nodal diameter.
   type :: nodal_matrices
      !> Hermitian (n, n); the damping is not allocated where there is none.
      complex(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      !> Static, cosine and sine loads, then those of the waves, in columns (n, n_columns); of a
      !> nodal diameter above N/2, conjugates.
      complex(wp), allocatable :: load(:, :)
      !> Observed quantities (n_observed, n).
      complex(wp), allocatable :: observe(:, :)
      !> What the columns of the loads are.
      type(load_waves) :: waves
      !> Coriolis matrix times the rotation speed, skew-Hermitian (n, n), where there is one.
      complex(wp), allocatable :: coriolis(:, :)
      !> Stiffness of the air, for the wave of this nodal diameter and for the one the other way, in
      !> the coordinates of each (n, n, 2), where there is one: neither Hermitian nor conjugates.
      complex(wp), allocatable :: aero(:, :, :)
   contains
      procedure :: has_whirl
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

   type :: cyclic_type
      logical :: is_cyclic = .false.
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
      !> Of a sector: Coriolis matrix times the rotation speed, skew (n_dof, n_dof).
      real(wp), allocatable :: coriolis(:, :)
      !> Forces of the air; not allocated where there are none.
      type(influence_type), allocatable :: air
   contains
      procedure :: nodal_diameter
      procedure :: factor
      procedure :: has_nodal
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

   !> The same of the whole model.
   pure logical function splits_waves(self)
      class(cyclic_type), intent(in) :: self
      integer :: k

      splits_waves = allocated(self%coriolis) .or. allocated(self%air)
      if (splits_waves .or. .not. allocated(self%nodal)) return
      splits_waves = any([(allocated(self%nodal(k)%coriolis), k=1, size(self%nodal))])
   end function splits_waves

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
