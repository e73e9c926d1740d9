!> Result files: one row per solution point, appended as soon as the point is known.
!>
!> The file is written as '<name>.part' with status 'incomplete' and takes its name when it is
!> closed. It is flushed after every point, unless flushing would take more than a twentieth of
!> the time: then a killed run loses at most the points of the last 20 times the time a flush
!> takes (some milliseconds). Rows follow the order of Fortran reversed, as h5py shows them.
module fw_result
   use, intrinsic :: iso_c_binding, only: c_int8_t
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_case, only: analyses, case_type
   use fw_contact_data, only: contact_type
   use fw_cyclic_group, only: write_cyclic
   use fw_error, only: error_type, fatal_error, status_input
   use fw_harmonics_options, only: sampling_words
   use fw_hdf5, only: hdf5_file, write_attribute
   use fw_kinds, only: wp
   use fw_law_text, only: law_of_pairs, normal_law_of_pairs
   use fw_point, only: point_type
   use fw_result_group, only: group_writer, result_group
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
      !> The open file, for rows that an analysis adds by itself.
      type(hdf5_file) :: file
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, private :: unit_system
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
      procedure :: add
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
      if (allocated(case%model%unit_system)) self%unit_system = case%model%unit_system
      call write_head(self, case, error)
      ! Natural frequencies are no points, and those of a population are not kept.
      if (.not. allocated(error) .and. analyses(case%analysis)%has_points .and. &
          .not. analyses(case%analysis)%is_population) then
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

   !> A group beside the rows of the points.
   subroutine add(self, group, error)
      class(result_writer), intent(inout) :: self
      class(result_group), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error

      if (self%file%id < 0) return
      !$omp critical (fretwear_io)
      call write_group(self, group, error)
      !$omp end critical (fretwear_io)
   end subroutine add

   subroutine write_group(self, group, error)
      class(result_writer), intent(in) :: self
      class(result_group), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      type(group_writer) :: to

      to%file = self%file
      if (allocated(self%unit_system)) to%unit_system = self%unit_system
      call group%write(to)
      call move_alloc(to%error, error)
   end subroutine write_group

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

   !> What holds for all points.
   subroutine write_head(self, case, error)
      class(result_writer), intent(in) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(group_writer) :: to

      to%file = self%file
      if (allocated(self%unit_system)) to%unit_system = self%unit_system
      call write_header(case, to)
      if (case%contact%n_pairs > 0) call write_pairs(case%contact, to)
      call write_cyclic(case%model%cyclic, analyses(case%analysis)%has_points, &
                        case%harmonics%n_harmonics, to)
      call move_alloc(to%error, error)
   end subroutine write_head

   !> Formats, versions, the case as it was read.
   subroutine write_header(case, to)
      type(case_type), intent(in) :: case
      type(group_writer), intent(inout) :: to

      call to%note('/', 'format', result_format)
      call to%note('/', 'format_version', result_format_version)
      call to%note('/', 'fretwear_version', version)
      ! Until the run is over; a file that is cut short keeps it.
      call to%note('/', 'status', at_work)
      call to%note('/', 'elapsed', 0.0_wp)
      call note_optional('title', case%title)
      call note_optional('namelist', case%namelist)
      if (allocated(to%unit_system)) call to%note('/', 'unit_system', to%unit_system)
      if (.not. allocated(case%model%observe_name)) return
      call to%put('/observed/name', case%model%observe_name, '', 'observed', &
                  'names of the observed quantities')

   contains

      !> Blank where there is no text.
      subroutine note_optional(name, text)
         character(*), intent(in) :: name
         character(:), allocatable, intent(in) :: text

         if (allocated(text)) then
            call to%note('/', name, text)
         else
            call to%note('/', name, '')
         end if
      end subroutine note_optional

   end subroutine write_header

   !> Where the pairs are, for pictures: what the case knows of it.
   subroutine write_pairs(contact, to)
      type(contact_type), intent(in) :: contact
      type(group_writer), intent(inout) :: to
      type(string_type), allocatable :: words(:)

      if (allocated(contact%position)) then
         call to%put('/contact/position', contact%position, '<length>', 'pair axis', &
                     'centre of the pair x, y, z')
      end if
      if (allocated(contact%area)) then
         call to%put('/contact/area', contact%area, '<area>', 'pair', 'area of the pair')
      end if
      if (allocated(contact%patch)) then
         call to%put('/contact/patch', contact%patch, '', 'pair', 'patch that the pair belongs to')
      end if
      if (allocated(contact%law_of)) then
         call law_of_pairs(contact, words)
         call to%put('/contact/law', words, '', 'pair', 'law of the pair')
      end if
      if (allocated(contact%normal_law)) then
         call normal_law_of_pairs(contact, words)
         call to%put('/contact/normal_law', words, '', 'pair', 'normal law of the pair')
      end if
   end subroutine write_pairs

end module fw_result
