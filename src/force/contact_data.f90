!> Contact pairs and nonlinear springs as data: which dofs they join and with which constants.
!>
!> Sign convention: u_r = u(side_1) - u(side_2), components (t1, t2, n) with n pointing from
!> side 2 to side 1, so that u_n > 0 opens. Forces stand on the left-hand side of the equation
!> of motion; lambda_n <= 0 is compression.
module fw_contact_data
   use fw_kinds, only: wp
   use fw_law_constants, only: law_constants, level_values
   use fw_text, only: string_type
   use fw_worn_friction, only: worn_friction
   implicit none (type, external)
   private

   public :: contact_type, spring_type
   public :: memory_words, memory_assembly, memory_carried, memory_residual
   public :: sliding_words, sliding_path, sliding_steady

   character(*), parameter :: memory_words(*) = [character(8) :: 'assembly', 'carried', 'residual']
   integer, parameter :: memory_assembly = 1, memory_carried = 2, memory_residual = 3
   character(*), parameter :: sliding_words(*) = [character(6) :: 'path', 'steady']
   integer, parameter :: sliding_path = 1, sliding_steady = 2

   !> Contact pairs (group &contact, /contact of a model file).
   type :: contact_type
      integer :: n_pairs = 0
      !> Sectors whose pairs these are, sector after sector.
      integer :: n_alike = 1
      !> Which law, a number in `law_words` (fw_laws): of the first pair where pairs differ.
      integer :: law = 1
      !> That of each pair (n_pairs); not allocated where all pairs have one.
      integer, allocatable :: law_of(:)
      !> Signed dof numbers of (t1, t2, n), 0 where there is none (3, n_pairs).
      integer, allocatable :: side_1(:, :), side_2(:, :)
      !> Sector of side 2 from that of side 1, in cyclic structures (n_pairs); 0 where it is not
      !> allocated.
      integer, allocatable :: sector_2(:)
      !> Friction coefficient (n_pairs).
      real(wp), allocatable :: mu(:)
      !> Initial gap, negative for an interference [length] (n_pairs).
      real(wp), allocatable :: gap(:)
      !> What an obstacle that moves adds to the gap in harmonics of the response, above 0: these
      !> (n_harmonics), and their cosine and sine parts [length] (n_pairs, n_harmonics).
      integer, allocatable :: gap_harmonic(:)
      real(wp), allocatable :: gap_cosine(:, :), gap_sine(:, :)
      !> How friction follows a side 2 that moves: `speed_1`, `speed_2` of the constants.
      integer :: sliding = sliding_path
      !> Wear depth that the joint starts with, on top of the gap [length] (n_pairs); none where it
      !> is not allocated.
      real(wp), allocatable :: depth(:)
      !> Area of the pair [length**2] (n_pairs).
      real(wp), allocatable :: area(:)
      !> Constant compressive force of pairs without a normal dof [force] (n_pairs).
      real(wp), allocatable :: normal_load(:)
      !> What a rotation speed adds to gap and normal load, for each of its squares [length s**2],
      !> [force s**2] (n_pairs), and frequency over speed where this follows the frequency: where it
      !> does not, both hold them already.
      real(wp), allocatable :: gap_rotation(:), normal_load_rotation(:)
      real(wp) :: speed_order = 0.0_wp
      !> Stiffnesses of elastic pairs [force/length] (n_pairs).
      real(wp), allocatable :: tangential_stiffness(:), normal_stiffness(:)
      !> How each pair presses, a number in `normal_words` (fw_normal_law) (n_pairs); unilateral
      !> springs where it is not allocated.
      integer, allocatable :: normal_law(:)
      !> Table of pressures, one for all pairs that have one (n_table) [length], [force].
      integer :: n_table = 0
      real(wp), allocatable :: overclosure(:), table_force(:)
      !> Whether constants of curved normal laws are pressures, to be multiplied by the area.
      logical :: normal_per_area = .false.
      !> What else a law takes of the pairs.
      type(law_constants) :: constants
      !> Multiplies the automatic penalty of the DLFT laws.
      real(wp) :: penalty_scale = 1.0_wp
      !> How friction changes with the depth of wear.
      type(worn_friction), allocatable :: worn_friction
      !> Where the march through the period starts.
      integer :: memory = memory_assembly
      !> Tangential displacements of unstrained pairs, along t1 and t2 (n_pairs) [length]: 0 where
      !> they are not allocated.
      real(wp), allocatable :: slider_1(:), slider_2(:)
      !> Of pairs that can stick throughout, where their residual traction lies between the least
      !> and the largest that balance: -1 to 1 (n_pairs); allocated with memory = 'residual'.
      real(wp), allocatable :: residual(:)
      !> Coordinates of the pairs, for pictures (3, n_pairs), and the names of their patches.
      real(wp), allocatable :: position(:, :)
      type(string_type), allocatable :: patch(:)
      !> The model says which law, where the case does not; no input.
      logical :: law_is_of_model = .false.
      !> No law was given, and the program took one; no input.
      logical :: law_is_chosen = .false.
   contains
      procedure :: turn
      procedure :: has_growth
      procedure :: add_gap
      procedure :: highest_gap
      procedure :: speeds
      procedure :: slides
      procedure :: moves_obstacle
      procedure :: level => level_sectors
   end type contact_type

   !> Nonlinear springs: force coefficient * u_r**power (group &spring).
   type :: spring_type
      integer :: n_springs = 0
      !> Signed dof numbers, 0 for ground (n_springs).
      integer, allocatable :: side_1(:), side_2(:)
      real(wp), allocatable :: coefficient(:)
      integer, allocatable :: power(:)
      !> As of contact_type (n_springs).
      integer, allocatable :: sector_2(:)
   end type spring_type

contains

   !> Take a rotation speed [rad/s], or the order along which it follows the frequency.
   pure subroutine turn(self, speed, order)
      class(contact_type), intent(inout) :: self
      !> 0: none.
      real(wp), intent(in) :: speed, order

      self%speed_order = order
      if (speed <= 0.0_wp) return
      if (allocated(self%gap_rotation)) self%gap = self%gap + speed**2*self%gap_rotation
      if (.not. allocated(self%normal_load_rotation)) return
      ! A load that has gone presses no more.
      self%normal_load = max(0.0_wp, self%normal_load + speed**2*self%normal_load_rotation)
   end subroutine turn

   !> Pairs of all sectors become alike, each value the mean over the sectors.
   pure subroutine level_sectors(self)
      class(contact_type), intent(inout) :: self

      call level_values(self%n_alike, self%mu)
      call level_values(self%n_alike, self%gap)
      call level_values(self%n_alike, self%depth)
      call level_values(self%n_alike, self%area)
      call level_values(self%n_alike, self%normal_load)
      call level_values(self%n_alike, self%gap_rotation)
      call level_values(self%n_alike, self%normal_load_rotation)
      call level_values(self%n_alike, self%slider_1)
      call level_values(self%n_alike, self%slider_2)
      call level_values(self%n_alike, self%residual)
      call level_values(self%n_alike, self%tangential_stiffness)
      call level_values(self%n_alike, self%normal_stiffness)
      call self%constants%level(self%n_alike)
   end subroutine level_sectors

   !> Add to the gaps of all pairs in one harmonic; 0 is the gap itself.
   pure subroutine add_gap(self, harmonic, cosine, sine)
      class(contact_type), intent(inout) :: self
      integer, intent(in) :: harmonic
      !> (n_pairs) [length].
      real(wp), intent(in) :: cosine(:), sine(:)
      real(wp), allocatable :: wider(:, :, :)
      integer :: k, n

      if (harmonic == 0) then
         self%gap = self%gap + cosine
         return
      end if
      if (.not. allocated(self%gap_harmonic)) then
         allocate (self%gap_harmonic(0))
         allocate (self%gap_cosine(self%n_pairs, 0), self%gap_sine(self%n_pairs, 0))
      end if
      n = size(self%gap_harmonic)
      k = findloc(self%gap_harmonic, harmonic, dim=1)
      if (k == 0) then
         allocate (wider(self%n_pairs, n + 1, 2), source=0.0_wp)
         wider(:, :n, 1) = self%gap_cosine
         wider(:, :n, 2) = self%gap_sine
         k = n + 1
         self%gap_harmonic = [self%gap_harmonic, harmonic]
         self%gap_cosine = wider(:, :, 1)
         self%gap_sine = wider(:, :, 2)
      end if
      self%gap_cosine(:, k) = self%gap_cosine(:, k) + cosine
      self%gap_sine(:, k) = self%gap_sine(:, k) + sine
   end subroutine add_gap

   !> The highest harmonic of the gaps; 0 where they stand still.
   pure integer function highest_gap(self) result(highest)
      class(contact_type), intent(in) :: self

      highest = 0
      if (allocated(self%gap_harmonic)) highest = maxval([0, self%gap_harmonic])
   end function highest_gap

   !> Whether gaps have harmonics, or a side 2 slides.
   pure logical function moves_obstacle(self)
      class(contact_type), intent(in) :: self

      moves_obstacle = self%highest_gap() > 0 .or. self%slides()
   end function moves_obstacle

   !> Whether a side 2 slides.
   pure logical function slides(self)
      class(contact_type), intent(in) :: self

      slides = any(abs(self%speeds()) > 0.0_wp)
   end function slides

   !> Velocities of side 2 along t1 and t2 [length/time] (n_pairs, 2).
   pure function speeds(self) result(v)
      class(contact_type), intent(in) :: self
      real(wp) :: v(self%n_pairs, 2)

      v(:, 1) = self%constants%get('speed_1', self%n_pairs)
      v(:, 2) = self%constants%get('speed_2', self%n_pairs)
   end function speeds

   !> Whether gaps or normal loads depend on the rotation speed.
   pure logical function has_growth(self)
      class(contact_type), intent(in) :: self

      has_growth = allocated(self%gap_rotation) .or. allocated(self%normal_load_rotation)
   end function has_growth

end module fw_contact_data
