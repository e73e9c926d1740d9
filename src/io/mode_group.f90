!> Groups /mode and /synthesis of a result file: what a nonlinear mode has beside its points, one
!> row for each of them, its limit cycles, and responses that are put together from it.
module fw_mode_group
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_result_labels, only: label_dataset
   implicit none (type, external)
   private

   public :: mode_table, mode_row, write_mode

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

   type :: mode_table
      !> Number of the mode, its frequency [rad/s] and damping with stuck pairs, and the amplitude
      !> from which on a pair slips or separates; NaN where none does.
      integer :: number = 1
      real(wp) :: stuck_omega = 0.0_wp, stuck_damping_ratio = 0.0_wp, onset_amplitude = 0.0_wp
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

   !> Write the groups; nothing where there is no point.
   subroutine write_mode(file, table, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(mode_table), intent(in) :: table
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (table%n == 0) return
      call write_points(file, table, unit_system, error)
      if (.not. allocated(error)) call write_number(file, table, error)
      if (.not. allocated(error) .and. allocated(table%cycle_amplitude)) then
         call write_one(file, '/mode/limit_cycle/amplitude', table%cycle_amplitude, unit_system, &
                        error)
         if (.not. allocated(error)) call write_one(file, '/mode/limit_cycle/omega', &
                                                    table%cycle_omega, unit_system, error)
         if (.not. allocated(error)) call write_dataset(file, '/mode/limit_cycle/stable', &
                                                        table%cycle_stable, error)
         if (.not. allocated(error)) call label_dataset(file, '/mode/limit_cycle/stable', &
                                                        unit_system, error)
      end if
      if (.not. allocated(error) .and. allocated(table%scale)) then
         call write_synthesis(file, table, unit_system, error)
      end if
   end subroutine write_mode

   subroutine write_points(file, table, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(mode_table), intent(in) :: table
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: shape_of(:, :, :)
      integer :: k

      ! Shapes are those of h5py reversed.
      allocate (shape_of(2, size(table%row(1)%first, 2), table%n))
      do k = 1, table%n
         shape_of(:, :, k) = table%row(k)%first/table%row(k)%modal_amplitude
      end do
      call write_dataset(file, '/mode/shape', shape_of, error)
      if (.not. allocated(error)) call label_dataset(file, '/mode/shape', unit_system, error)
      if (allocated(error) .or. .not. any(table%row(:table%n)%force > 0.0_wp)) return
      call write_one(file, '/mode/resonant_scale', &
                     [(resonant_scale(table%row(k)), k=1, table%n)], unit_system, error)
   end subroutine write_points

   !> The factor of the load with which a point is a resonance: its work balances the damping.
   pure real(wp) function resonant_scale(row) result(scale)
      type(mode_row), intent(in) :: row

      scale = 0.0_wp
      if (row%force > 0.0_wp) scale = row%self_excitation*row%omega*row%modal_amplitude/row%force
   end function resonant_scale

   subroutine write_number(file, table, error)
      type(hdf5_file), intent(in) :: file
      type(mode_table), intent(in) :: table
      type(error_type), allocatable, intent(out) :: error

      call write_attribute(file, '/mode', 'number', table%number, error)
      if (.not. allocated(error)) call write_attribute(file, '/mode', 'stuck_omega', &
                                                       table%stuck_omega, error)
      if (.not. allocated(error)) call write_attribute(file, '/mode', 'stuck_damping_ratio', &
                                                       table%stuck_damping_ratio, error)
      if (.not. allocated(error)) call write_attribute(file, '/mode', 'onset_amplitude', &
                                                       table%onset_amplitude, error)
   end subroutine write_number

   subroutine write_synthesis(file, table, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(mode_table), intent(in) :: table
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: first(table%n)
      integer :: k

      do k = 1, table%n
         first(k) = hypot(table%row(k)%first(1, 1), table%row(k)%first(2, 1))
      end do
      call write_one(file, '/synthesis/scale', table%scale, unit_system, error)
      if (allocated(error)) return
      call write_dataset(file, '/synthesis/omega', table%response_omega, error)
      if (.not. allocated(error)) call label_dataset(file, '/synthesis/omega', unit_system, error)
      if (.not. allocated(error)) call write_one(file, '/synthesis/first_harmonic', first, &
                                                 unit_system, error)
   end subroutine write_synthesis

   !> A list of numbers with what it is.
   subroutine write_one(file, name, values, unit_system, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      real(wp), intent(in), contiguous :: values(:)
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      call write_dataset(file, name, values, error)
      if (.not. allocated(error)) call label_dataset(file, name, unit_system, error)
   end subroutine write_one

end module fw_mode_group
