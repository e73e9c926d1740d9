!> Groups /mode and /synthesis of a result file: what a nonlinear mode has beside its points, one
!> row for each of them, its limit cycles, and responses that are put together from it.
module fw_mode_group
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: mode_table, mode_row, onset_type
   public :: onset_none, onset_at_bound, onset_solutions, onset_stuck, onset_below, onset_every

   !> How an onset is known: none there is, or is known of; a stuck solution just below its bound;
   !> a stuck solution and one just above that is not; the highest stuck solution, above which none
   !> was found; the first solution is not stuck; what departs does at every amplitude.
   integer, parameter :: onset_none = 1, onset_at_bound = 2, onset_solutions = 3, &
                         onset_stuck = 4, onset_below = 5, onset_every = 6
   character(*), parameter :: known_by_words(6) = [character(9) :: 'none', 'bound', 'solutions', &
                                                   'stuck', 'below', 'every']

   !> From which amplitude on a pair slips or separates (NaN: not known, or none), how that is
   !> known, and the amplitude above which nothing sticks (NaN: not known).
   type :: onset_type
      real(wp) :: amplitude = 0.0_wp, bound = 0.0_wp
      integer :: known_by = onset_none
   end type onset_type

   !> What a point of the curve has beside those of a response.
   type :: mode_row
      !> Amplitude in the unit of the control.
      real(wp) :: amplitude = 0.0_wp
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      real(wp) :: self_excitation = 0.0_wp
      !> sqrt(U_1^H M U_1) [length mass**(1/2)].
      real(wp) :: modal_amplitude = 0.0_wp
      !> Cosine and sine of the first harmonic (2, n_observed) [length].
      real(wp), allocatable :: first(:, :)
      !> Modal force: |U_1^H F| over the modal amplitude, F the vibratory load of the case.
      real(wp) :: force = 0.0_wp
      logical :: converged = .true.
   end type mode_row

   type, extends(result_group) :: mode_table
      !> Number of the mode, its frequency [rad/s] and damping with stuck pairs.
      integer :: number = 1
      real(wp) :: stuck_omega = 0.0_wp, stuck_damping_ratio = 0.0_wp
      type(onset_type) :: onset
      !> Whether it is that with sliding pairs, as none with stuck pairs exists.
      logical :: slides = .false.
      integer :: n = 0
      type(mode_row), allocatable :: row(:)
      !> Where the self-excitation vanishes: amplitude, omega, and 1 where it grows with the
      !> amplitude.
      real(wp), allocatable :: cycle_amplitude(:), cycle_omega(:)
      integer, allocatable :: cycle_stable(:)
      !> Factors of the load, and frequencies of the responses (2, n_points, n_scales) [rad/s].
      real(wp), allocatable :: scale(:), response_omega(:, :, :)
   contains
      procedure :: add
      procedure :: add_cycle
      procedure :: write => write_mode
   end type mode_table

contains

   !> Element by element: gfortran 12 loses allocatable components of an array constructor in
   !> places.
   subroutine add(self, row)
      class(mode_table), intent(inout) :: self
      type(mode_row), intent(in) :: row
      type(mode_row), allocatable :: longer(:)
      integer :: k

      if (.not. allocated(self%row)) allocate (self%row(8))
      if (self%n == size(self%row)) then
         allocate (longer(2*self%n))
         do k = 1, self%n
            longer(k) = self%row(k)
         end do
         call move_alloc(longer, self%row)
      end if
      self%n = self%n + 1
      self%row(self%n) = row
   end subroutine add

   !> A limit cycle.
   subroutine add_cycle(self, amplitude, omega, is_stable)
      class(mode_table), intent(inout) :: self
      real(wp), intent(in) :: amplitude, omega
      logical, intent(in) :: is_stable

      if (.not. allocated(self%cycle_amplitude)) then
         allocate (self%cycle_amplitude(0), self%cycle_omega(0), self%cycle_stable(0))
      end if
      self%cycle_amplitude = [self%cycle_amplitude, amplitude]
      self%cycle_omega = [self%cycle_omega, omega]
      self%cycle_stable = [self%cycle_stable, merge(1, 0, is_stable)]
   end subroutine add_cycle

   subroutine write_mode(self, to)
      class(mode_table), intent(in) :: self
      type(group_writer), intent(inout) :: to

      if (self%n == 0) return
      call write_points(self, to)
      if (allocated(self%cycle_amplitude)) then
         call to%put('/mode/limit_cycle/amplitude', self%cycle_amplitude, '', 'cycle', &
                     'amplitude of the limit cycle, as the control has it')
         call to%put('/mode/limit_cycle/omega', self%cycle_omega, 'rad/s', 'cycle', &
                     'angular frequency of the limit cycle')
         call to%put('/mode/limit_cycle/stable', self%cycle_stable, '', 'cycle', &
                     '1 where damping grows with the amplitude')
      end if
      if (allocated(self%scale)) call write_synthesis(self, to)
   end subroutine write_mode

   subroutine write_points(table, to)
      type(mode_table), intent(in) :: table
      type(group_writer), intent(inout) :: to
      real(wp), allocatable :: shape_of(:, :, :)
      integer :: k

      ! Shapes are those of h5py reversed.
      allocate (shape_of(2, size(table%row(1)%first, 2), table%n))
      do k = 1, table%n
         shape_of(:, :, k) = table%row(k)%first/table%row(k)%modal_amplitude
      end do
      call to%put('/mode/shape', shape_of, '', 'point observed part', &
                  'first harmonic, cosine and sine, over the modal amplitude')
      if (any(table%row(:table%n)%force > 0.0_wp)) then
         call to%put('/mode/resonant_scale', [(resonant_scale(table%row(k)), k=1, table%n)], '1', &
                     'point', 'factor of the load with which the point is a resonance')
      end if
      call to%note('/mode', 'number', table%number)
      call to%note('/mode', 'stuck_omega', table%stuck_omega)
      call to%note('/mode', 'stuck_damping_ratio', table%stuck_damping_ratio)
      call to%note('/mode', 'onset_amplitude', table%onset%amplitude)
      call to%note('/mode', 'onset_bound', table%onset%bound)
      call to%note('/mode', 'onset_known_by', trim(known_by_words(table%onset%known_by)))
   end subroutine write_points

   !> The factor of the load with which a point is a resonance: its work balances the damping.
   pure real(wp) function resonant_scale(row) result(scale)
      type(mode_row), intent(in) :: row

      scale = 0.0_wp
      if (row%force > 0.0_wp) scale = row%self_excitation*row%omega*row%modal_amplitude/row%force
   end function resonant_scale

   subroutine write_synthesis(table, to)
      type(mode_table), intent(in) :: table
      type(group_writer), intent(inout) :: to
      real(wp) :: first(table%n)
      integer :: k

      do k = 1, table%n
         first(k) = hypot(table%row(k)%first(1, 1), table%row(k)%first(2, 1))
      end do
      call to%put('/synthesis/scale', table%scale, '1', 'scale', 'factor of the vibratory load')
      call to%put('/synthesis/omega', table%response_omega, 'rad/s', 'scale point side', &
                  'frequencies of the response put together, NaN: none')
      call to%put('/synthesis/first_harmonic', first, '<length>', 'point', &
                  'amplitude of the first observed quantity')
   end subroutine write_synthesis

end module fw_mode_group
