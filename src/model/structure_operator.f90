!> A linear structure as the balance sees it: per harmonic n a dynamic stiffness and a load,
!>
!>   Z_n q_n - F_n,   Z_n = K - theta_n M + i n omega C,   theta_n = (n omega)^2 + i n omega xi,
!>
!> on coordinates of which the first are relative displacements. xi is a self-excitation in
!> proportion to mass, 0 in a response to a load. The structure knows no forces of contact.
!>
!> The operator is built once and only read then, so that threads may share it. Where it stands
!> (frequency, what depends on it, the rows in use, scratch) is in a `structure_state`, one for each
!> thread. Vectors are real coefficients (coordinate, coefficient), ordered as those of
!> fourier_type. Products are exact; a matrix Z_n is formed only where one is asked for.
module fw_structure_operator
   use fw_deviation, only: deviation_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: structure_operator, structure_state, lay_out_coefficients
   public :: by_frequency, by_self_excitation

   !> What a derivative is taken by.
   integer, parameter :: by_frequency = 1, by_self_excitation = 2

   !> Where a structure stands.
   type, abstract :: structure_state
      !> Angular frequency and self-excitation [rad/s]; below 0 before the first.
      real(wp) :: omega = -1.0_wp
      real(wp) :: self_excitation = 0.0_wp
      !> F_n (n_coordinates, n_retained) [force], and the same with the loads of the model as they
      !> are, to which each harmonic gives a factor (n_retained).
      complex(wp), allocatable :: load(:, :), unit_load(:, :)
      real(wp), allocatable :: load_factor(:)
      !> Coordinates in use (first n_used entries), of which the first n_active are multiplied.
      integer :: n_active = 0
      integer :: n_used = 0
      integer, allocatable :: used(:)
   contains
      procedure :: reserve_loads
      procedure :: scale_loads
   end type structure_state

   !> What a balance asks of a structure, whichever kind it is; it does not change in a run.
   type, abstract :: structure_operator
      integer :: n_coordinates = 0
      !> The first coordinates, relative displacements; behind them internal modes `kept`.
      integer :: n_relative = 0
      integer, allocatable :: kept(:)
      integer :: n_observed = 0
      !> Equal sectors that the coordinates are of; 1 where none are told apart. Coordinates of each
      !> (n_slots, n_alike), and back which of which sector each is (n_coordinates).
      integer :: n_alike = 1
      integer :: n_slots = 0
      integer, allocatable :: coordinate(:, :), slot(:), sector(:)
      !> Harmonics in use and the columns of their coefficients (n_retained).
      integer, allocatable :: harmonic(:), column(:)
      integer :: n_coefficients = 0
      !> Frobenius norms of K and M of each harmonic, which bound what `magnitudes` sums up
      !> (2, n_retained); only of structures that do not change.
      real(wp), allocatable :: norms(:, :)
      !> Whether the Z_n are symmetric, and the procedures of the whole field answer: those from
      !> `whole_size` on.
      logical :: knows_field = .false.
   contains
      procedure(make_state), deferred :: new_state
      procedure(stand_at), deferred :: at
      procedure(multiply_all), deferred :: multiply
      procedure(choose_rows), deferred :: restrict
      procedure(multiply_restricted), deferred :: multiply_active
      procedure(form_block), deferred :: block
      procedure(form_block), deferred :: active_block
      procedure(read_diagonal), deferred :: diagonal
      procedure(derive), deferred :: derivative
      procedure(recover_observed), deferred :: recover
      procedure(read_static), deferred :: static_stiffness
      procedure(split_one), deferred :: split
      procedure(read_mass), deferred :: mass
      procedure(read_parts), deferred :: parts
      procedure(list_modes), deferred :: held_modes
      procedure(sum_magnitudes), deferred :: magnitudes
      procedure(derive_observed), deferred :: observed_slope
      procedure(find_load_work), deferred :: load_work
      procedure :: undetermined => none_undetermined
      procedure :: structural_work
      procedure :: whole_size
      procedure :: condense_field
      procedure :: complete_field
      procedure :: observe_field
      procedure :: observe_back
      procedure :: change_field
      procedure :: field_work
      procedure :: split_rank
      procedure :: multiply_nearly
      procedure :: has_near_product
      procedure :: static_block
      procedure :: dynamic_block
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
   end type structure_operator

   abstract interface
      subroutine make_state(self, state)
         import :: structure_operator, structure_state
         class(structure_operator), intent(in) :: self
         class(structure_state), allocatable, intent(out) :: state
      end subroutine make_state

      !> Go to a frequency; nothing is done if the state stands there already.
      subroutine stand_at(self, state, omega, self_excitation, error)
         import :: structure_operator, structure_state, wp, error_type
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         !> [rad/s]
         real(wp), intent(in) :: omega, self_excitation
         type(error_type), allocatable, intent(out) :: error
      end subroutine stand_at

      !> product = Z q, all harmonics (n_coordinates * n_coefficients).
      subroutine multiply_all(self, state, q, product)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         real(wp), intent(in) :: q(*)
         real(wp), intent(inout) :: product(*)
      end subroutine multiply_all

      !> From now on, `multiply_active` and `active_block` take rows `used`, and its first n_active
      !> as columns. At every frequency anew.
      subroutine choose_rows(self, state, n_active, n_used, used)
         import :: structure_operator, structure_state
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         integer, intent(in) :: n_active, n_used
         integer, intent(in) :: used(:)
      end subroutine choose_rows

      !> product = Z(used, active) v: v (n_active, n_coefficients), product (n_coordinates,
      !> n_coefficients), of which the first n_used rows are set.
      subroutine multiply_restricted(self, state, v, product)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         real(wp), intent(in) :: v(*)
         real(wp), intent(inout) :: product(*)
      end subroutine multiply_restricted

      !> Z_n of the h-th harmonic: of all coordinates (n_coordinates, n_coordinates), or of those
      !> in use (n_used, n_active). Threads may ask for different harmonics at the same time.
      subroutine form_block(self, state, h, matrix)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         complex(wp), intent(out), contiguous :: matrix(:, :)
      end subroutine form_block

      !> An entry on the diagonal of Z_n of the h-th harmonic [force/length].
      complex(wp) function read_diagonal(self, state, h, coordinate)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h, coordinate
      end function read_diagonal

      !> slope = d(Z q - F)/dp at fixed q (n_coordinates * n_coefficients).
      subroutine derive(self, state, parameter, q, slope)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         !> by_frequency or by_self_excitation.
         integer, intent(in) :: parameter
         real(wp), intent(in) :: q(*)
         real(wp), intent(inout) :: slope(*)
      end subroutine derive

      !> Observed quantities from the coordinates, all harmonics, complex amplitudes.
      subroutine recover_observed(self, state, q, observed)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(inout) :: state
         !> (n_coordinates, n_retained)
         complex(wp), intent(in), contiguous :: q(:, :)
         !> (n_observed, n_retained)
         complex(wp), intent(out), contiguous :: observed(:, :)
      end subroutine recover_observed

      !> Static stiffness of a coordinate, the scale of its penalty [force/length].
      pure real(wp) function read_static(self, coordinate)
         import :: structure_operator, wp
         class(structure_operator), intent(in) :: self
         integer, intent(in) :: coordinate
      end function read_static

      !> What a coordinate is to motion above the harmonics, see fw_split: mass, dashpot, spring.
      pure subroutine split_one(self, coordinate, limit, m, c, k)
         import :: structure_operator, wp
         class(structure_operator), intent(in) :: self
         integer, intent(in) :: coordinate
         !> Angular frequency below which modes follow by their inertia [rad/s].
         real(wp), intent(in) :: limit
         real(wp), intent(out) :: m, c, k
      end subroutine split_one

      !> Mass of the coordinates, without what is condensed (n_coordinates, n_coordinates).
      pure subroutine read_mass(self, matrix)
         import :: structure_operator, wp
         class(structure_operator), intent(in) :: self
         real(wp), intent(out) :: matrix(:, :)
      end subroutine read_mass

      !> What a harmonic is made of, without what is condensed: K, M and C of the coordinates
      !> (n_coordinates, n_coordinates), and rows of the observed quantities (n_observed,
      !> n_coordinates).
      pure subroutine read_parts(self, h, stiffness, mass, damping, observe)
         import :: structure_operator, wp
         class(structure_operator), intent(in) :: self
         !> Place of the harmonic among those in use.
         integer, intent(in) :: h
         complex(wp), intent(out) :: stiffness(:, :), mass(:, :), damping(:, :), observe(:, :)
      end subroutine read_parts

      !> Modes of the structure with its relative coordinates held, as it vibrates while all of its
      !> contact sticks: angular frequencies and half-power half widths [rad/s] (n_modes).
      pure subroutine list_modes(self, frequency, half_width)
         import :: structure_operator, wp
         class(structure_operator), intent(in) :: self
         real(wp), allocatable, intent(out) :: frequency(:), half_width(:)
      end subroutine list_modes

      !> (|K| + |theta_n| |M|) times amplitudes, without what is condensed: elastic and inertial
      !> forces before they cancel (n_coordinates).
      pure subroutine sum_magnitudes(self, state, h, amplitude, sums)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         real(wp), intent(in) :: amplitude(:)
         real(wp), intent(out) :: sums(:)
      end subroutine sum_magnitudes

      !> Derivative of the observed quantities by omega at held coordinates: what the condensed part
      !> makes of it (n_observed, n_retained).
      subroutine derive_observed(self, state, q, slope)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(in) :: state
         complex(wp), intent(in) :: q(:, :)
         complex(wp), intent(out) :: slope(:, :)
      end subroutine derive_observed

      !> Work of the load in the h-th harmonic, F^H u of the whole field, its derivative by omega
      !> at held coordinates, and its row by them (n_coordinates).
      subroutine find_load_work(self, state, h, q, work, slope, row)
         import :: structure_operator, structure_state, wp
         class(structure_operator), intent(in) :: self
         class(structure_state), intent(in) :: state
         integer, intent(in) :: h
         complex(wp), intent(in) :: q(:)
         complex(wp), intent(out) :: work
         complex(wp), intent(out), optional :: slope, row(:)
      end subroutine find_load_work
   end interface

contains

   !> Columns of the harmonics: constant or cosine, then sine.
   pure subroutine lay_out_coefficients(self, harmonic)
      class(structure_operator), intent(inout) :: self
      integer, intent(in) :: harmonic(:)
      integer :: h

      self%harmonic = harmonic
      allocate (self%column(size(harmonic)))
      self%n_coefficients = 0
      do h = 1, size(harmonic)
         self%column(h) = self%n_coefficients + 1
         self%n_coefficients = self%n_coefficients + merge(1, 2, harmonic(h) == 0)
      end do
   end subroutine lay_out_coefficients

   !> Room for the loads of m coordinates; factors are 1.
   pure subroutine reserve_loads(self, m, n_retained)
      class(structure_state), intent(inout) :: self
      integer, intent(in) :: m, n_retained

      allocate (self%load(m, n_retained), self%unit_load(m, n_retained), source=(0.0_wp, 0.0_wp))
      allocate (self%load_factor(n_retained), source=1.0_wp)
   end subroutine reserve_loads

   !> F_n from the loads of the model at the present frequency and the factors.
   pure subroutine scale_loads(self)
      class(structure_state), intent(inout) :: self
      integer :: h

      do h = 1, size(self%load_factor)
         self%load(:, h) = self%load_factor(h)*self%unit_load(:, h)
      end do
   end subroutine scale_loads

   !> Where the state stands, motions that no equation determines and that no load drives, and those
   !> that a load drives: harmonics that meet modes without damping and without a coupling to what
   !> is solved for.
   subroutine none_undetermined(self, state, n_idle, n_driven)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(out) :: n_idle, n_driven

      n_idle = 0
      n_driven = 0
      associate (unused => self, unused_state => state)
      end associate
   end subroutine none_undetermined

   !> Work of hysteretic damping in one cycle [energy], of complex amplitudes of the coordinates
   !> (n_coordinates, n_retained).
   real(wp) function structural_work(self, state, q) result(work)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)

      work = 0.0_wp
      associate (unused => self, unused_state => state, unused_q => q)
      end associate
   end function structural_work

   ! The whole field: the coordinates and what is condensed behind them, complex amplitudes
   ! (whole_size, n_retained). Structures without it leave these as they are.

   !> Coordinates and condensed unknowns of one harmonic.
   pure integer function whole_size(self)
      class(structure_operator), intent(in) :: self

      whole_size = self%n_coordinates
   end function whole_size

   !> Loads of the whole field as loads of the coordinates: F_q - Z_qi D^-1 F_i.
   subroutine condense_field(self, state, field, load)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)
      !> (n_coordinates, n_retained)
      complex(wp), intent(out) :: load(:, :)

      load = field(:self%n_coordinates, :)
      associate (unused => state)
      end associate
   end subroutine condense_field

   !> The condensed part from the coordinates and its own load: x = D^-1 (F_i - Z_iq q).
   subroutine complete_field(self, state, q, load, field)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: q(:, :)
      !> Loads of the whole field, or those of the structure itself where it is not given.
      complex(wp), intent(in), optional :: load(:, :)
      complex(wp), intent(out) :: field(:, :)

      field = q
      associate (unused => self, unused_state => state, unused_load => load)
      end associate
   end subroutine complete_field

   !> Observed quantities of a field (n_observed, n_retained).
   pure subroutine observe_field(self, field, observed)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: observed(:, :)

      observed = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_field => field)
      end associate
   end subroutine observe_field

   !> The transpose of `observe_field`.
   pure subroutine observe_back(self, observed, field)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(in) :: observed(:, :)
      complex(wp), intent(out) :: field(:, :)

      field = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_observed => observed)
      end associate
   end subroutine observe_back

   !> Slope of the equations of the whole field by a change of the model (`changes` of model_type):
   !> (dK + i n omega dC) u - dF.
   pure subroutine change_field(self, state, number, field, slope)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: number
      complex(wp), intent(in) :: field(:, :)
      complex(wp), intent(out) :: slope(:, :)

      slope = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_state => state, unused_number => number, &
                 unused_field => field)
      end associate
   end subroutine change_field

   !> F_1^H u of a field in the first harmonic.
   pure complex(wp) function field_work(self, state, field) result(work)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      complex(wp), intent(in) :: field(:, :)

      work = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_state => state, unused_field => field)
      end associate
   end function field_work

   ! Z_n ~ K + V S_n V^T with K and V real, the same for all harmonics and frequencies: near enough
   ! for steps of iterative solvers and their preconditioners. A structure of rank 0 has no such
   ! form; of it nothing below is asked.

   !> Columns of V.
   pure integer function split_rank(self) result(rank)
      class(structure_operator), intent(in) :: self

      rank = 0
      associate (unused => self)
      end associate
   end function split_rank

   !> As `multiply_active`, nearly.
   subroutine multiply_nearly(self, state, v, product)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(inout) :: state
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(*)

      call self%multiply_active(state, v, product)
   end subroutine multiply_nearly

   !> Whether `multiply_nearly` is a product of its own although nothing of low rank is known.
   pure logical function has_near_product(self)
      class(structure_operator), intent(in) :: self

      has_near_product = .false.
      associate (unused => self)
      end associate
   end function has_near_product

   !> [K V] of the rows in use: active columns of K, then all of V (n_used, n_active + rank).
   subroutine static_block(self, state, matrix)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      real(wp), intent(out), contiguous :: matrix(:, :)

      matrix = 0.0_wp
      associate (unused => self, unused_state => state)
      end associate
   end subroutine static_block

   !> S_n of the h-th harmonic (rank, rank).
   subroutine dynamic_block(self, state, h, matrix)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: matrix(:, :)

      matrix = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_state => state, unused_number => h)
      end associate
   end subroutine dynamic_block

   ! Equal sectors: waves of nodal diameters k = 0 .. n_alike - 1, which the structure does not
   ! couple. Structures that tell no sectors apart leave these as they are.

   !> Z_n of the h-th harmonic in a nodal diameter (n_slots, n_slots).
   subroutine wave_block(self, state, h, k, matrix)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h, k
      complex(wp), intent(out), contiguous :: matrix(:, :)

      associate (unused => k)
      end associate
      call self%block(state, h, matrix)
   end subroutine wave_block

   !> Amplitudes of waves from those of the sectors (n_slots, n_alike), see fw_ring_fft.
   subroutine find_waves(self, sectors, waves)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(inout), contiguous :: sectors(:, :), waves(:, :)

      waves = sectors
      associate (unused => self)
      end associate
   end subroutine find_waves

   !> And back.
   subroutine add_waves(self, waves, sectors)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(inout), contiguous :: waves(:, :), sectors(:, :)

      sectors = waves
      associate (unused => self)
      end associate
   end subroutine add_waves

   ! What sectors have beside each other: matrices on rows of each, without their mean, which the
   ! waves have. Structures whose sectors are alike have no such row, and nothing below is asked.

   !> Rows of a sector.
   pure integer function n_own(self)
      class(structure_operator), intent(in) :: self

      n_own = 0
      associate (unused => self)
      end associate
   end function n_own

   !> The rows in nodal diameter k = 0 .. n_alike - 1 (n_own, n_slots).
   subroutine own_rows(self, k, rows)
      class(structure_operator), intent(in) :: self
      integer, intent(in) :: k
      complex(wp), intent(out) :: rows(:, :)

      rows = (0.0_wp, 0.0_wp)
      associate (unused => self, neither => k)
      end associate
   end subroutine own_rows

   !> The matrices of all sectors in the h-th harmonic (n_own, n_own, n_alike).
   subroutine own_block(self, state, h, matrix)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      integer, intent(in) :: h
      complex(wp), intent(out) :: matrix(:, :, :)

      matrix = (0.0_wp, 0.0_wp)
      associate (unused => self, unused_state => state, neither => h)
      end associate
   end subroutine own_block

   !> The rows of all sectors (n_own, n_alike) from the coordinates of these (n_slots, n_alike).
   subroutine read_own(self, sectors, rows)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(in) :: sectors(:, :)
      complex(wp), intent(out) :: rows(:, :)

      rows = (0.0_wp, 0.0_wp)
      associate (unused => self, neither => sectors)
      end associate
   end subroutine read_own

   !> Forces on the rows, added to those on the coordinates.
   subroutine add_own(self, rows, sectors)
      class(structure_operator), intent(in) :: self
      complex(wp), intent(in) :: rows(:, :)
      complex(wp), intent(inout) :: sectors(:, :)

      associate (unused => self, neither => rows, nor => sectors)
      end associate
   end subroutine add_own

   !> Derivative of Z q - F by one of the values in which sectors differ, at held q (n_coordinates *
   !> n_coefficients).
   subroutine own_slope(self, state, of, number, q, slope)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(in) :: state
      !> As in fw_deviation, and which value of the kind.
      integer, intent(in) :: of, number
      real(wp), intent(in) :: q(*)
      real(wp), intent(inout) :: slope(*)

      slope(:self%n_coordinates*self%n_coefficients) = 0.0_wp
      associate (unused => state, neither => of, nor => number, nothing => q(1))
      end associate
   end subroutine own_slope

   !> Sectors differ by other matrices on the same rows; states are to be made anew.
   pure subroutine take_deviation(self, deviation)
      class(structure_operator), intent(inout) :: self
      type(deviation_type), intent(in) :: deviation

      associate (unused => self, neither => deviation)
      end associate
   end subroutine take_deviation

   !> Whether the Z_n are symmetric, and `pull_observed` answers.
   pure logical function pulls_observed(self)
      class(structure_operator), intent(in) :: self

      pulls_observed = .false.
      associate (unused => self)
      end associate
   end function pulls_observed

   !> Slopes by observed amplitudes become slopes by the coordinates: with U = O q the product of
   !> the conjugate transpose of O, harmonic by harmonic (n_coordinates, n_retained).
   subroutine pull_observed(self, state, observed, slope)
      class(structure_operator), intent(in) :: self
      class(structure_state), intent(inout) :: state
      !> (n_observed, n_retained)
      complex(wp), intent(in) :: observed(:, :)
      complex(wp), intent(out) :: slope(:, :)

      slope = (0.0_wp, 0.0_wp)
      associate (unused => self, neither => state, nor => observed)
      end associate
   end subroutine pull_observed

end module fw_structure_operator
