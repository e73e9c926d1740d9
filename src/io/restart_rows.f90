!> Group /restart of the result of a wear run: what is needed, besides the other datasets, to go on
!> from a step as if the run had never stopped.
!>
!> /restart/vibration     unknowns of the vibration (n_steps, n_unknowns)
!> /restart/checked_rate  rates at which gross slip was last looked for (n_steps, n_pairs)
!> /restart/control       the control of the steps (n_steps, see the attribute `columns`)
!> /restart/mission       of a mission what it has counted (n_steps, 4)
!> /restart/pairs         constants of the pairs (see the attribute `columns`; n_pairs)
!>
!> Nothing is written where there is no file. HDF5 serves one thread at a time: every procedure
!> waits for its turn.
module fw_restart_rows
   use fw_contact_data, only: contact_type
   use fw_error, only: error_type
   use fw_hdf5, only: growing_dataset, growing_real, hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_text, only: string_type
   use fw_wear_march, only: wear_march
   implicit none (type, external)
   private

   public :: restart_row_set, pair_constants
   public :: pair_keys, n_controls, n_counts, n_notes
   public :: c_next_cycles, c_largest_rate, c_checked_depth, c_spacing, c_steps, c_rejected, &
             c_converged, c_unsettled, c_reach, c_touch, c_provisional, c_implicit, c_leaps, &
             c_jumps, c_first_jump, c_noted

   !> Columns of /restart/control.
   integer, parameter :: c_next_cycles = 1, c_largest_rate = 2, c_checked_depth = 3, &
                         c_spacing = 4, c_steps = 5, c_rejected = 6, c_converged = 7, &
                         c_unsettled = 8, c_reach = 9, c_touch = 10, c_provisional = 11, &
                         c_implicit = 12, c_leaps = 13, c_jumps = 14, c_first_jump = 15, &
                         c_noted = 16
   !> From c_noted on what the observer of the march has noted.
   integer, parameter :: n_notes = 4, n_controls = c_noted - 1 + n_notes
   character(*), parameter :: control_words(n_controls) = [character(17) :: 'next_cycles', &
      'largest_rate', 'checked_depth', 'frequency_spacing', 'n_steps', 'n_rejected', 'converged', &
      'n_unsettled', 'touch_reach', 'touch_cycles', 'provisional', &
      'n_implicit', 'n_leaps', 'n_jumps', 'first_jump', 'n_finer', 'n_coarse', &
      'coarse_pair', 'coarse_cycle']
   !> Columns of /restart/pairs: keys of &contact, and the depth of `worn`.
   character(*), parameter :: pair_keys(*) = [character(20) :: 'mu', 'gap', 'area', &
      'normal_load', 'tangential_stiffness', 'normal_stiffness', 'worn']

   !> Places of the datasets in `list`.
   integer, parameter :: d_vibration = 1, d_checked_rate = 2, d_control = 3, d_mission = 4
   integer, parameter :: n_datasets = 4
   !> Of a mission: error of its jumps, jumps taken and refused, marches of a block.
   integer, parameter :: n_counts = 4

   type :: restart_row_set
      type(growing_dataset), private :: list(n_datasets)
   contains
      procedure :: create => create_datasets
      procedure :: append => append_row
      procedure :: copy
      procedure :: close => close_datasets
   end type restart_row_set

contains

   !> Datasets of `create`, alone with the library: HDF5 is not called from two threads at once.
   subroutine create_datasets(self, file, contact, n_unknowns, error, of_mission)
      class(restart_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(in) :: contact
      !> Unknowns of the vibration.
      integer, intent(in) :: n_unknowns
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: of_mission

      if (file%id < 0) return
      !$omp critical (fretwear_io)
      call create(self, file, contact, n_unknowns, error)
      if (present(of_mission) .and. .not. allocated(error)) then
         call self%list(d_mission)%create(file, '/restart/mission', growing_real, [n_counts], error)
      end if
      !$omp end critical (fretwear_io)
   end subroutine create_datasets

   !> What a march needs to go on from a row bit for bit, beside what the row itself holds.
   subroutine create(self, file, contact, n_unknowns, error)
      class(restart_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: n_unknowns
      type(error_type), allocatable, intent(out) :: error

      call self%list(d_vibration)%create(file, '/restart/vibration', growing_real, [n_unknowns], &
                                         error)
      if (allocated(error)) return
      call self%list(d_checked_rate)%create(file, '/restart/checked_rate', growing_real, &
                                            [contact%n_pairs], error)
      if (allocated(error)) return
      call self%list(d_control)%create(file, '/restart/control', growing_real, [n_controls], error)
      if (allocated(error)) return
      ! Once, not step by step: they tell whether a later case has the same joint.
      call write_dataset(file, '/restart/pairs', pair_constants(contact), error)
      if (.not. allocated(error)) call write_attribute(file, '/restart/control', 'columns', &
                                                       strings_of(control_words), error)
      if (.not. allocated(error)) call write_attribute(file, '/restart/pairs', 'columns', &
                                                       strings_of(pair_keys), error)
   end subroutine create

   !> One row per pair key (n_pairs, n_keys).
   pure function pair_constants(contact) result(constants)
      type(contact_type), intent(in) :: contact
      real(wp) :: constants(contact%n_pairs, size(pair_keys))

      constants = 0.0_wp
      if (contact%n_pairs == 0) return
      constants(:, 1) = contact%mu
      constants(:, 2) = contact%gap
      if (allocated(contact%area)) constants(:, 3) = contact%area
      constants(:, 4) = contact%normal_load
      constants(:, 5) = contact%tangential_stiffness
      constants(:, 6) = contact%normal_stiffness
      if (allocated(contact%depth)) constants(:, 7) = contact%depth
   end function pair_constants

   !> The march when its observer sees a state, and the vibration of that state.
   subroutine append_row(self, file, march, vibration, converged, notes, error, counts)
      class(restart_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(wear_march), intent(in) :: march
      real(wp), intent(in) :: vibration(:)
      !> Whether the state counts as converged.
      logical, intent(in) :: converged
      !> What the observer has noted so far.
      real(wp), intent(in) :: notes(n_notes)
      type(error_type), allocatable, intent(out) :: error
      !> Of a mission.
      real(wp), intent(in), optional :: counts(n_counts)
      real(wp) :: control(n_controls)

      if (.not. self%list(d_vibration)%is_created()) return
      control(c_next_cycles) = march%next_cycles
      control(c_largest_rate) = march%largest_rate
      control(c_checked_depth) = march%checked_depth
      control(c_spacing) = march%resonance%spacing
      control(c_steps) = real(march%n_steps, wp)
      control(c_rejected) = real(march%n_rejected, wp)
      control(c_converged) = merge(1.0_wp, 0.0_wp, converged)
      control(c_unsettled) = real(march%n_unsettled, wp)
      control(c_reach) = march%touch%reach
      control(c_touch) = march%touch%in_cycles
      control(c_provisional) = merge(1.0_wp, 0.0_wp, march%is_provisional)
      control(c_implicit) = real(march%n_implicit, wp)
      control(c_leaps) = real(march%n_leaps, wp)
      control(c_jumps) = real(march%n_jumps, wp)
      control(c_first_jump) = march%first_jump
      control(c_noted:) = notes
      !$omp critical (fretwear_io)
      call self%list(d_vibration)%append(file, vibration, error)
      if (.not. allocated(error)) call self%list(d_control)%append(file, control, error)
      if (present(counts) .and. .not. allocated(error)) then
         call self%list(d_mission)%append(file, counts, error)
      end if
      if (.not. allocated(error)) then
         if (allocated(march%checked_rate)) then
            call self%list(d_checked_rate)%append(file, march%checked_rate, error)
         else
            ! Gross slip was not looked for yet: the row reads as NaN.
            call self%list(d_checked_rate)%skip(file, 1, error)
         end if
      end if
      !$omp end critical (fretwear_io)
   end subroutine append_row

   !> Begin with the first n rows of an earlier result of the same case.
   subroutine copy(self, file, source, n, error)
      class(restart_row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      !$omp critical (fretwear_io)
      do i = 1, n_datasets
         if (.not. self%list(i)%is_created()) cycle
         call self%list(i)%copy_rows(file, source, n, error)
         if (allocated(error)) exit
      end do
      !$omp end critical (fretwear_io)
   end subroutine copy

   !> Handles stay open over the run: a row is appended without looking up its dataset.
   subroutine close_datasets(self)
      class(restart_row_set), intent(inout) :: self
      integer :: i

      !$omp critical (fretwear_io)
      do i = 1, n_datasets
         call self%list(i)%close()
      end do
      !$omp end critical (fretwear_io)
   end subroutine close_datasets

   !> Words of their own length from words of one length.
   pure function strings_of(words) result(strings)
      character(*), intent(in) :: words(:)
      type(string_type) :: strings(size(words))
      integer :: i

      do i = 1, size(words)
         strings(i)%text = trim(words(i))
      end do
   end function strings_of

end module fw_restart_rows
