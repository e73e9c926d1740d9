!> The datasets of a result file with one row per solution point.
module fw_result_rows
   use fw_case, only: analysis_frf
   use fw_case, only: analysis_point
   use fw_case, only: analysis_wear
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_hdf5, only: growing_dataset
   use fw_hdf5, only: growing_integer
   use fw_hdf5, only: growing_logical
   use fw_hdf5, only: growing_real
   use fw_hdf5, only: get_shape
   use fw_hdf5, only: hdf5_file
   use fw_hdf5, only: write_attribute
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_point, only: served_words
   use fw_result_labels, only: label_dataset
   use fw_solver_options, only: continuation_arclength
   use fw_text, only: string_type
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: row_set

   !> The datasets.
   integer, parameter :: d_omega = 1, d_coefficients = 2, d_amplitude = 3, d_converged = 4, &
                         d_iterations = 5, d_residual = 6, d_seconds = 7, d_force = 8, &
                         d_fraction = 9, d_dissipation = 10, d_observed = 11, &
                         d_force_history = 12, d_slip_history = 13, d_fold = 14, &
                         d_stable = 15, d_multipliers = 16, d_served_by = 17, d_harmonics = 18, &
                         d_instants = 19, d_error = 20
   integer, parameter :: n_datasets = 20

   !> Rows of a run that ends when it is done: its limit says little, and may be far away.
   integer, parameter :: usual_rows = 128

   type :: row_set
      integer, private :: n_rows = 0, n_coefficients = 1, expected = 1
      character(:), allocatable, private :: unit_system
      type(growing_dataset), private :: list(n_datasets)
   contains
      procedure :: create
      procedure :: append
      procedure :: copy
      procedure :: close
      procedure, private :: new, new_late, append_contact, append_histories
   end type row_set

contains

   !> Create the datasets of every point; those of histories come with the first history.
   subroutine create(self, file, case, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: scalar(0) = [integer ::]
      integer :: n_observed, n_pairs

      if (allocated(case%model%unit_system)) self%unit_system = case%model%unit_system
      n_observed = 0
      if (allocated(case%model%observe_matrix)) n_observed = size(case%model%observe_matrix, 1)
      self%n_coefficients = 2*case%harmonics%n_harmonics + 1
      self%expected = expected_rows(case)
      call self%new(file, d_omega, '/omega', scalar, error)
      if (allocated(error)) return
      call self%new(file, d_coefficients, '/coefficients', [n_observed, self%n_coefficients], error)
      if (allocated(error)) return
      call self%new(file, d_amplitude, '/amplitude', [n_observed], error)
      if (allocated(error)) return
      call self%new(file, d_converged, '/converged', scalar, error, kind_of=growing_logical)
      if (allocated(error)) return
      call self%new(file, d_iterations, '/iterations', scalar, error, kind_of=growing_integer)
      if (allocated(error)) return
      call self%new(file, d_residual, '/residual', scalar, error)
      if (allocated(error)) return
      call self%new(file, d_seconds, '/seconds', scalar, error)
      if (allocated(error)) return
      if (case%analysis == analysis_frf .or. case%analysis == analysis_point) then
         call create_served_by(self, file, error)
         if (allocated(error)) return
      end if
      if (case%sweep%continuation == continuation_arclength) then
         call self%new(file, d_fold, '/fold', scalar, error, kind_of=growing_logical)
      end if
      if (.not. allocated(error)) call create_levels(self, file, case, error)
      if (.not. allocated(error) .and. case%sweep%stability) then
         call self%new(file, d_stable, '/floquet/stable', scalar, error, kind_of=growing_integer)
      end if
      n_pairs = case%contact%n_pairs
      if (allocated(error) .or. .not. case%output%contact .or. n_pairs == 0) return
      call self%new(file, d_force, '/contact/force', [3, n_pairs, self%n_coefficients], error)
      if (allocated(error)) return
      call self%new(file, d_fraction, '/contact/fraction', [3, n_pairs], error)
      if (allocated(error)) return
      call self%new(file, d_dissipation, '/contact/dissipation', [n_pairs], error)
   end subroutine create

   !> How many rows are likely.
   pure integer function expected_rows(case)
      type(case_type), intent(in) :: case

      expected_rows = 1
      if (case%analysis == analysis_wear) then
         expected_rows = min(usual_rows - 1, case%wear%max_steps) + 1
      else if (case%analysis == analysis_frf) then
         expected_rows = max(1, case%sweep%n_points)
         if (case%sweep%continuation == continuation_arclength) then
            expected_rows = min(usual_rows, case%sweep%max_points)
         end if
      end if
   end function expected_rows

   !> Append a row to every dataset.
   subroutine append(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      self%n_rows = self%n_rows + 1
      call self%list(d_omega)%append(file, point%omega, error)
      if (allocated(error)) return
      call append_coefficients(self%list(d_coefficients), file, self%n_coefficients, &
                               point%coefficients, error)
      if (allocated(error)) return
      if (allocated(point%amplitude)) then
         call self%list(d_amplitude)%append(file, point%amplitude, error)
      else
         call self%list(d_amplitude)%skip(file, 1, error)
      end if
      if (allocated(error)) return
      call self%list(d_converged)%append(file, point%converged, error)
      if (allocated(error)) return
      call self%list(d_iterations)%append(file, point%iterations, error)
      if (allocated(error)) return
      call self%list(d_residual)%append(file, point%residual, error)
      if (allocated(error)) return
      call self%list(d_seconds)%append(file, point%seconds, error)
      if (allocated(error)) return
      if (self%list(d_served_by)%is_created()) then
         call self%list(d_served_by)%append(file, point%served_by, error)
         if (allocated(error)) return
      end if
      if (self%list(d_fold)%is_created()) call self%list(d_fold)%append(file, point%fold, error)
      if (allocated(error)) return
      call append_levels(self, file, point, error)
      if (.not. allocated(error)) call append_stability(self, file, point, error)
      if (.not. allocated(error)) call self%append_contact(file, point, error)
      if (.not. allocated(error)) call self%append_histories(file, point, error)
   end subroutine append

   !> Begin with the first n rows of another result of the same sizes.
   subroutine copy(self, file, source, n, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: late(3) = [d_observed, d_force_history, d_slip_history]
      character(*), parameter :: late_name(3) = [character(30) :: '/history/observed', &
         '/history/force', '/history/relative_displacement']
      integer(hsize_t), allocatable :: dims(:)
      integer :: i

      do i = 1, size(late)
         if (.not. source%exists(trim(late_name(i)))) cycle
         call get_shape(source, trim(late_name(i)), dims, error)
         if (allocated(error)) return
         call self%new(file, late(i), trim(late_name(i)), int(dims(:size(dims) - 1)), error)
         if (allocated(error)) return
      end do
      do i = 1, n_datasets
         call self%list(i)%copy_rows(file, source, n, error)
         if (allocated(error)) return
      end do
      self%n_rows = n
   end subroutine copy

   subroutine close(self)
      class(row_set), intent(inout) :: self
      integer :: i

      do i = 1, n_datasets
         call self%list(i)%close()
      end do
   end subroutine close

   !> Codes of what gave the solutions, with the words for them as the attribute `names`.
   subroutine create_served_by(self, file, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: name = '/served_by'
      integer, parameter :: scalar(0) = [integer ::]
      type(string_type) :: words(size(served_words))
      integer :: i

      call self%new(file, d_served_by, name, scalar, error, kind_of=growing_integer)
      if (allocated(error)) return
      do i = 1, size(words)
         words(i)%text = trim(served_words(i - 1))
      end do
      call write_attribute(file, name, 'names', words, error)
   end subroutine create_served_by

   !> Harmonics of each point where they differ; instants and error where the program saw to both.
   subroutine create_levels(self, file, case, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: scalar(0) = [integer ::]

      if (.not. (case%harmonics%adaptive .or. case%harmonics%accuracy > 0.0_wp)) return
      call self%new(file, d_harmonics, '/harmonics', scalar, error, kind_of=growing_integer)
      if (allocated(error) .or. case%harmonics%adaptive) return
      call self%new(file, d_instants, '/instants', scalar, error, kind_of=growing_integer)
      if (allocated(error)) return
      call self%new(file, d_error, '/error_estimate', scalar, error)
   end subroutine create_levels

   subroutine append_levels(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%list(d_harmonics)%is_created()) return
      call self%list(d_harmonics)%append(file, point%n_harmonics, error)
      if (allocated(error) .or. .not. self%list(d_instants)%is_created()) return
      call self%list(d_instants)%append(file, point%n_time, error)
      if (allocated(error)) return
      if (point%converged .and. point%error_estimate < huge(1.0_wp)) then
         call self%list(d_error)%append(file, point%error_estimate, error)
      else
         call self%list(d_error)%skip(file, 1, error)
      end if
   end subroutine append_levels

   subroutine new(self, file, i, name, row_shape, error, kind_of)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: i
      character(*), intent(in) :: name
      integer, intent(in) :: row_shape(:)
      type(error_type), allocatable, intent(out) :: error
      !> Kind of the elements (default: growing_real).
      integer, intent(in), optional :: kind_of
      integer :: element_kind

      element_kind = growing_real
      if (present(kind_of)) element_kind = kind_of
      call self%list(i)%create(file, name, element_kind, row_shape, error, self%expected)
      if (.not. allocated(error)) call label_dataset(file, name, self%unit_system, error)
   end subroutine new

   !> (2H+1, n_observed) turned to (n_observed, 2H+1), zero for harmonics not carried.
   subroutine append_coefficients(dataset, file, n_coefficients, coefficients, error)
      type(growing_dataset), intent(inout) :: dataset
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: n_coefficients
      real(wp), allocatable, intent(in) :: coefficients(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: row(:, :)
      integer :: n

      if (.not. allocated(coefficients)) then
         call dataset%skip(file, 1, error)
         return
      end if
      n = size(coefficients, 1)
      allocate (row(size(coefficients, 2), max(n, n_coefficients)), source=0.0_wp)
      row(:, :n) = transpose(coefficients)
      call dataset%append(file, row, error)
   end subroutine append_coefficients

   !> 1 stable, 0 unstable, -1 not known; multipliers as (n_multipliers, real and imaginary part).
   subroutine append_stability(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: row(:, :)

      if (.not. self%list(d_stable)%is_created()) return
      if (.not. allocated(point%multipliers)) then
         call self%list(d_stable)%append(file, -1, error)
         if (allocated(error) .or. .not. self%list(d_multipliers)%is_created()) return
         call self%list(d_multipliers)%skip(file, 1, error)
         return
      end if
      call self%list(d_stable)%append(file, merge(1, 0, point%stable), error)
      if (allocated(error)) return
      allocate (row(2, size(point%multipliers)))
      row(1, :) = real(point%multipliers, wp)
      row(2, :) = aimag(point%multipliers)
      if (.not. self%list(d_multipliers)%is_created()) then
         call self%new_late(file, d_multipliers, '/floquet/multipliers', shape(row), error)
         if (allocated(error)) return
      end if
      call self%list(d_multipliers)%append(file, row, error)
   end subroutine append_stability

   subroutine append_contact(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: force(:, :, :)
      integer :: n

      if (.not. self%list(d_force)%is_created()) return
      if (allocated(point%force)) then
         n = size(point%force, 3)
         allocate (force(3, size(point%force, 2), max(n, self%n_coefficients)), source=0.0_wp)
         force(:, :, :n) = point%force
      end if
      call append_or_skip(self%list(d_force), file, force, error)
      if (allocated(error)) return
      if (allocated(point%fraction)) then
         call self%list(d_fraction)%append(file, point%fraction, error)
      else
         call self%list(d_fraction)%skip(file, 1, error)
      end if
      if (allocated(error)) return
      if (allocated(point%dissipation)) then
         call self%list(d_dissipation)%append(file, point%dissipation, error)
      else
         call self%list(d_dissipation)%skip(file, 1, error)
      end if
   end subroutine append_contact

   !> Histories exist from the first point that has one; the rows of other points are NaN.
   subroutine append_histories(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      call append_observed(self, file, point%history, error)
      if (allocated(error)) return
      call append_history(self, file, d_force_history, '/history/force', point%force_history, &
                          error)
      if (allocated(error)) return
      call append_history(self, file, d_slip_history, '/history/relative_displacement', &
                          point%slip_history, error)
   end subroutine append_histories

   !> (n_time, n_observed) turned to (n_observed, n_time).
   subroutine append_observed(self, file, history, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      real(wp), allocatable, intent(in) :: history(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: row(:, :)
      logical :: created

      created = self%list(d_observed)%is_created()
      if (.not. allocated(history)) then
         if (created) call self%list(d_observed)%skip(file, 1, error)
         return
      end if
      if (.not. created) then
         call self%new_late(file, d_observed, '/history/observed', &
                            [size(history, 2), size(history, 1)], error)
         if (allocated(error)) return
      end if
      row = transpose(history)
      call self%list(d_observed)%append(file, row, error)
   end subroutine append_observed

   !> Rows of (3, n_pairs, n_time).
   subroutine append_history(self, file, i, name, row, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: i
      character(*), intent(in) :: name
      real(wp), allocatable, intent(in) :: row(:, :, :)
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%list(i)%is_created()) then
         if (.not. allocated(row)) return
         call self%new_late(file, i, name, shape(row), error)
         if (allocated(error)) return
      end if
      call append_or_skip(self%list(i), file, row, error)
   end subroutine append_history

   !> Create a dataset after the first points, whose rows stay NaN.
   subroutine new_late(self, file, i, name, row_shape, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: i
      character(*), intent(in) :: name
      integer, intent(in) :: row_shape(:)
      type(error_type), allocatable, intent(out) :: error

      call self%new(file, i, name, row_shape, error)
      if (.not. allocated(error)) call self%list(i)%skip(file, self%n_rows - 1, error)
   end subroutine new_late

   subroutine append_or_skip(dataset, file, row, error)
      type(growing_dataset), intent(inout) :: dataset
      type(hdf5_file), intent(in) :: file
      real(wp), allocatable, intent(in) :: row(:, :, :)
      type(error_type), allocatable, intent(out) :: error

      if (allocated(row)) then
         call dataset%append(file, row, error)
      else
         call dataset%skip(file, 1, error)
      end if
   end subroutine append_or_skip

end module fw_result_rows
