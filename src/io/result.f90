!> Result files: one row per solution point, appended as soon as the point is known.
!>
!> The file is written as '<name>.part' with status 'incomplete' and takes its name when it is
!> closed. It is flushed after every point, unless flushing would take more than a twentieth of
!> the time: then a killed run loses at most the points of the last 20 times the time a flush
!> takes (some milliseconds). Rows follow the order of Fortran reversed, as h5py shows them.
module fw_result
   use, intrinsic :: iso_c_binding, only: c_int8_t
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_bifurcation, only: bifurcation_list
   use fw_bifurcation_group, only: write_bifurcations
   use fw_case, only: analysis_modes, case_type
   use fw_cyclic_group, only: write_cyclic, write_modes
   use fw_error, only: error_type, fatal_error, status_input
   use fw_harmonics_options, only: sampling_words
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset, write_text
   use fw_kinds, only: wp
   use fw_mode_group, only: mode_table, write_mode
   use fw_peak, only: peak_type
   use fw_pair_cycle, only: pair_cycle
   use fw_peak_group, only: write_peak_cycle, write_peaks
   use fw_point, only: point_type
   use fw_resonance_group, only: resonance_table, write_resonance
   use fw_resonance_options, only: resonance_options
   use fw_result_labels, only: label_dataset
   use fw_result_part, only: at_work, create_part, delete_part, publish_part
   use fw_result_target, only: result_format
   use fw_result_rows, only: row_set
   use fw_text, only: string_type
   use fw_version, only: version
   implicit none (type, external)
   private

   public :: result_writer

   integer, parameter :: result_format_version = 1

   !> A flush waits until this many times its own duration has passed since the last.
   integer, parameter :: flush_patience = 20

   !> Writes one result file, or nothing where it was never opened. Not to be copied while it is
   !> open. HDF5 and the handling of texts serve one thread at a time: every procedure waits for
   !> its turn.
   type :: result_writer
      !> The open file, for analyses that add groups of their own.
      type(hdf5_file) :: file
      !> The name that the file takes at the end.
      character(:), allocatable, private :: path
      type(row_set), private :: rows
      !> When the file was flushed last, and how long that took [counts of the clock].
      integer(int64), private :: last_flush = 0_int64, flush_duration = 0_int64
      !> The result stays in memory; once it is closed, its bytes are `image`.
      logical, private :: in_memory = .false.
      integer(c_int8_t), allocatable :: image(:)
   contains
      procedure :: open
      procedure :: add_point
      procedure :: copy_points
      procedure :: add_peaks
      procedure :: add_bifurcations
      procedure :: add_remarks
      procedure :: add_modes
      procedure :: add_mode
      procedure :: add_resonance
      procedure :: sort_points
      procedure :: flush
      procedure :: close
      procedure :: discard
   end type result_writer

contains

   !> Create the file with everything but the points.
   subroutine open(self, case, error, in_memory)
      class(result_writer), intent(out) :: self
      !> Case whose output file, title, namelist, sizes and choices of output are taken.
      type(case_type), intent(in) :: case
      !> status_input where the file is one that the case was read from; status_io where it
      !> cannot be written or is anything but an earlier result.
      type(error_type), allocatable, intent(out) :: error
      !> Touch no file: leave the bytes of one in `image` (default: no).
      logical, intent(in), optional :: in_memory

      if (present(in_memory)) self%in_memory = in_memory
      !$omp critical (fretwear_io)
      call create_file(self, case, error)
      !$omp end critical (fretwear_io)
   end subroutine open

   !> Procedures without a critical section are called within one: such sections do not nest.
   subroutine create_file(self, case, error)
      class(result_writer), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (self%in_memory) then
         call self%file%create_in_memory(error)
      else if (.not. allocated(case%output%file)) then
         call fatal_error(error, 'no result file is named: set output%file', status_input)
      else if (allocated(case%inputs)) then
         call create_part(case%output%file, self%path, self%file, error, case%inputs)
      else
         call create_part(case%output%file, self%path, self%file, error)
      end if
      if (allocated(error)) return
      call write_header(self%file, case, error)
      if (.not. allocated(error)) call write_pairs(self%file, case, error)
      if (.not. allocated(error)) call write_cyclic(self%file, case, error)
      ! Natural frequencies are no points.
      if (.not. allocated(error) .and. case%analysis /= analysis_modes) then
         call self%rows%create(self%file, case, error)
      end if
      if (.not. allocated(error)) call flush_file(self, error)
      if (allocated(error)) call discard_file(self)
   end subroutine create_file

   !> Append a solution point. What it does not know (no allocated component) reads as NaN, and
   !> harmonics it does not carry read as zero.
   subroutine add_point(self, point, error)
      class(result_writer), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call append_point(self, point, error)
      !$omp end critical (fretwear_io)
   end subroutine add_point

   !> Begin with the first n points of an earlier result of the same case.
   subroutine copy_points(self, source, n, error)
      class(result_writer), intent(inout) :: self
      type(hdf5_file), intent(in) :: source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call self%rows%copy(self%file, source, n, error)
      !$omp end critical (fretwear_io)
   end subroutine copy_points

   !> What is known of the maxima of the response.
   subroutine add_peaks(self, peaks, n_harmonics, unit_system, omega, cycle, error)
      class(result_writer), intent(inout) :: self
      type(peak_type), intent(in) :: peaks(:)
      !> Of the case.
      integer, intent(in) :: n_harmonics
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      !> One period of the pairs at the highest of them, where it is known, and its frequency
      !> [rad/s].
      real(wp), intent(in) :: omega
      type(pair_cycle), allocatable, intent(in) :: cycle
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_peaks(self%file, peaks, n_harmonics, unit_system, error)
      if (allocated(cycle) .and. .not. allocated(error)) then
         call write_peak_cycle(self%file, omega, cycle, unit_system, error)
      end if
      !$omp end critical (fretwear_io)
   end subroutine add_peaks

   !> Where the response turns or its stability changes.
   subroutine add_bifurcations(self, list, n_harmonics, unit_system, error, frequency)
      class(result_writer), intent(inout) :: self
      type(bifurcation_list), intent(in) :: list
      !> Of the case.
      integer, intent(in) :: n_harmonics
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      !> That of a sweep over another parameter [rad/s]; 0 where it is the frequency that changes.
      real(wp), intent(in) :: frequency

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_bifurcations(self%file, list, n_harmonics, unit_system, frequency, error)
      !$omp end critical (fretwear_io)
   end subroutine add_bifurcations

   !> Natural frequencies of the nodal diameters.
   subroutine add_modes(self, nodal_diameter, open, closed, unit_system, error, open_damping, &
                        closed_damping)
      class(result_writer), intent(inout) :: self
      integer, intent(in), contiguous :: nodal_diameter(:)
      !> (n_modes, n_diameters) [rad/s].
      real(wp), intent(in), contiguous :: open(:, :), closed(:, :)
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      !> Fractions of critical damping, only where waves in both directions differ.
      real(wp), allocatable, intent(in) :: open_damping(:, :), closed_damping(:, :)

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_modes(self%file, nodal_diameter, open, closed, unit_system, error, open_damping, &
                       closed_damping)
      !$omp end critical (fretwear_io)
   end subroutine add_modes

   !> A nonlinear mode, beside its points.
   subroutine add_mode(self, table, unit_system, error)
      class(result_writer), intent(inout) :: self
      type(mode_table), intent(in) :: table
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_mode(self%file, table, unit_system, error)
      !$omp end critical (fretwear_io)
   end subroutine add_mode

   !> A resonance over a parameter, beside its points.
   subroutine add_resonance(self, table, options, unit_system, error)
      class(result_writer), intent(inout) :: self
      type(resonance_table), intent(in) :: table
      type(resonance_options), intent(in) :: options
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_resonance(self%file, table, options, unit_system, error)
      !$omp end critical (fretwear_io)
   end subroutine add_resonance

   !> Bring the rows into the order of their frequencies.
   subroutine sort_points(self, descending, error)
      class(result_writer), intent(inout) :: self
      logical, intent(in) :: descending
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call self%rows%sort(self%file, descending, error)
      !$omp end critical (fretwear_io)
   end subroutine sort_points

   !> What is allowed in the case and seldom meant.
   subroutine add_remarks(self, name, text, error)
      class(result_writer), intent(inout) :: self
      !> Names by which programs know them, and the words (n_remarks).
      type(string_type), intent(in) :: name(:), text(:)
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_text(self%file, '/remarks/name', name, error)
      if (.not. allocated(error)) call write_text(self%file, '/remarks/text', text, error)
      !$omp end critical (fretwear_io)
   end subroutine add_remarks

   !> One more entry in every dataset, flushed where that takes a small part of the time since then.
   subroutine append_point(self, point, error)
      class(result_writer), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      integer(int64) :: clock

      call self%rows%append(self%file, point, error)
      if (allocated(error)) return
      call system_clock(clock)
      if (clock - self%last_flush >= flush_patience*self%flush_duration) then
         call flush_file(self, error)
      end if
   end subroutine append_point

   !> Make what was written so far safe against the end of the program.
   subroutine flush(self, error)
      class(result_writer), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call flush_file(self, error)
      !$omp end critical (fretwear_io)
   end subroutine flush

   !> For who reads the growing file, and for what a crash leaves; it is timed, see append_point.
   subroutine flush_file(self, error)
      class(result_writer), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer(int64) :: start

      call system_clock(start)
      call self%rows%drain(self%file, error)
      if (.not. allocated(error)) call self%file%flush(error)
      call system_clock(self%last_flush)
      self%flush_duration = self%last_flush - start
   end subroutine flush_file

   !> Complete the file and give it its name.
   subroutine close(self, status, elapsed, error, skipped, sampling)
      class(result_writer), intent(inout) :: self
      !> 'complete', 'not converged', or what else became of the run.
      character(*), intent(in) :: status
      !> Time of the whole run [s].
      real(wp), intent(in) :: elapsed
      type(error_type), allocatable, intent(out) :: error
      !> What the case did not need, in words.
      type(string_type), intent(in), optional :: skipped(:)
      !> How contact was sampled, left to the program or not; not present where none was.
      integer, intent(in), optional :: sampling

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call close_file(self, status, elapsed, error, skipped, sampling)
      !$omp end critical (fretwear_io)
   end subroutine close

   !> How it ended is written last: a file without it was cut short.
   subroutine close_file(self, status, elapsed, error, skipped, sampling)
      class(result_writer), intent(inout) :: self
      character(*), intent(in) :: status
      real(wp), intent(in) :: elapsed
      type(error_type), allocatable, intent(out) :: error
      type(string_type), intent(in), optional :: skipped(:)
      integer, intent(in), optional :: sampling
      type(error_type), allocatable :: close_error

      call self%rows%drain(self%file, error)
      if (.not. allocated(error)) then
         call write_attribute(self%file, '/', 'elapsed', elapsed, error)
      end if
      if (present(skipped) .and. .not. allocated(error)) then
         if (size(skipped) > 0) call write_attribute(self%file, '/', 'skipped', skipped, error)
      end if
      if (present(sampling) .and. .not. allocated(error)) then
         call write_attribute(self%file, '/', 'sampling', trim(sampling_words(sampling)), error)
      end if
      if (.not. allocated(error)) then
         ! The last attribute: whoever finds it finds everything else too.
         call write_attribute(self%file, '/', 'status', trim(status), error)
      end if
      ! Before the file: open datasets would keep it open.
      call self%rows%close()
      if (self%in_memory .and. .not. allocated(error)) call self%file%image(self%image, error)
      call self%file%close(close_error)
      if (allocated(close_error) .and. .not. allocated(error)) then
         call move_alloc(close_error, error)
      end if
      if (allocated(error) .or. self%in_memory) return
      call publish_part(self%file%path, self%path, error)
   end subroutine close_file

   !> Give the file up: nothing of it stays.
   subroutine discard(self)
      class(result_writer), intent(inout) :: self

      !$omp critical (fretwear_io)
      call discard_file(self)
      !$omp end critical (fretwear_io)
   end subroutine discard

   subroutine discard_file(self)
      class(result_writer), intent(inout) :: self
      type(error_type), allocatable :: ignored

      if (self%file%id < 0) return
      call self%rows%close()
      call self%file%close(ignored)
      if (.not. self%in_memory) call delete_part(self%file%path)
   end subroutine discard_file

   !> What holds for all points: formats, versions, the case as it was read.
   subroutine write_header(file, case, error)
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call write_attribute(file, '/', 'format', result_format, error)
      if (allocated(error)) return
      call write_attribute(file, '/', 'format_version', result_format_version, error)
      if (allocated(error)) return
      call write_attribute(file, '/', 'fretwear_version', version, error)
      if (allocated(error)) return
      ! Until the run is over; a file that is cut short keeps it.
      call write_attribute(file, '/', 'status', at_work, error)
      if (allocated(error)) return
      call write_attribute(file, '/', 'elapsed', 0.0_wp, error)
      if (allocated(error)) return
      call write_optional(file, 'title', case%title, error)
      if (allocated(error)) return
      call write_optional(file, 'namelist', case%namelist, error)
      if (allocated(error)) return
      if (allocated(case%model%unit_system)) then
         call write_attribute(file, '/', 'unit_system', case%model%unit_system, error)
      end if
      if (allocated(error) .or. .not. allocated(case%model%observe_name)) return
      call write_text(file, '/observed/name', case%model%observe_name, error)
      if (.not. allocated(error)) then
         call label_dataset(file, '/observed/name', case%model%unit_system, error)
      end if
   end subroutine write_header

   !> Where the pairs are, for pictures: what the case knows of it.
   subroutine write_pairs(file, case, error)
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%contact%n_pairs == 0) return
      if (allocated(case%contact%position)) then
         call write_dataset(file, '/contact/position', case%contact%position, error)
         if (.not. allocated(error)) then
            call label_dataset(file, '/contact/position', case%model%unit_system, error)
         end if
         if (allocated(error)) return
      end if
      if (allocated(case%contact%area)) then
         call write_dataset(file, '/contact/area', case%contact%area, error)
         if (.not. allocated(error)) then
            call label_dataset(file, '/contact/area', case%model%unit_system, error)
         end if
         if (allocated(error)) return
      end if
      if (.not. allocated(case%contact%patch)) return
      call write_text(file, '/contact/patch', case%contact%patch, error)
      if (.not. allocated(error)) then
         call label_dataset(file, '/contact/patch', case%model%unit_system, error)
      end if
   end subroutine write_pairs

   !> Nothing where there is no text.
   subroutine write_optional(file, name, text, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      character(:), allocatable, intent(in) :: text
      type(error_type), allocatable, intent(out) :: error

      if (allocated(text)) then
         call write_attribute(file, '/', name, text, error)
      else
         call write_attribute(file, '/', name, '', error)
      end if
   end subroutine write_optional

end module fw_result
