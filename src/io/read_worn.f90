!> Key `worn` of &contact: the wear depth that an earlier result ends with, at which the joint of
!> this case starts.
module fw_read_worn
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_contact_data, only: contact_type
   use fw_contact_keys, only: bind_worn
   use fw_error, only: error_type, fatal_error, status_input, status_io
   use fw_hdf5, only: hdf5_file, read_dataset
   use fw_kinds, only: wp
   use fw_paths, only: resolve_path
   use fw_reader, only: reader_type
   use fw_result_target, only: is_result
   use fw_text, only: to_text
   use fw_trial, only: trial_type, try_file
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: read_worn

   !> Reading the depths in a process of its own, in case the file is damaged.
   type, extends(trial_type) :: worn_trial
   contains
      procedure :: read => read_in_trial
   end type worn_trial

contains

   !> Keys `worn` and `worn_step`. The depth of every pair is allocated on leaving, zero where
   !> nothing is worn.
   subroutine read_worn(reader, directory, contact, path, error)
      type(reader_type), intent(inout) :: reader
      !> Of the namelist; relative files start there.
      character(*), intent(in) :: directory
      !> Its number of pairs is known.
      type(contact_type), intent(inout) :: contact
      !> The result that was read, not allocated where there is none.
      character(:), allocatable, intent(out) :: path
      !> status_io where the file cannot be read at all; anything else is refused by the reader.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: depth(:, :)
      integer :: i, step

      step = 0
      call bind_worn(reader, path, step)
      allocate (contact%depth(contact%n_pairs), source=0.0_wp)
      if (.not. allocated(path)) then
         if (step > 0) call reader%refuse('contact', 'worn_step', '= '//to_text(step)// &
                                          ': is a row of the result that worn names: give worn')
         return
      end if
      path = resolve_path(path, directory)
      call reader%amend('contact', 'worn', quoted_text(path))
      call read_depths(reader, path, depth, error)
      if (allocated(error) .or. reader%failed()) return
      call check_depths(reader, path, step, depth, contact)
      if (reader%failed()) return
      if (step == 0) step = size(depth, 2)
      contact%depth = depth(:, step)
      ! Of a wave: all sectors are worn alike.
      if (size(depth, 1) < contact%n_pairs) contact%depth = [(depth(:, step), i=1, contact%n_alike)]
   end subroutine read_worn

   !> Every row of /wear/depth (n_pairs, n_steps).
   subroutine read_depths(reader, path, depth, error)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: path
      real(wp), allocatable, intent(out) :: depth(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure

      if (reader%tries_files) call try_file(worn_trial(), path, failure)
      if (.not. allocated(failure)) call load_depths(path, depth, failure)
      if (.not. allocated(failure)) return
      ! What cannot be read at all ends the reading; what is wrong in it is one problem among
      ! others.
      if (failure%status == status_io) then
         failure%message = reader%place_of('contact', 'worn')//': '//failure%message
         call move_alloc(failure, error)
      else
         call reader%refuse('contact', 'worn', failure%message)
      end if
   end subroutine read_depths

   !> Open, check and read; the file is closed on every way out.
   subroutine load_depths(path, depth, error)
      character(*), intent(in) :: path
      real(wp), allocatable, intent(out) :: depth(:, :)
      !> status_io where the file cannot be read, status_input where it is no result of a wear run.
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file

      call file%open_read(path, error)
      if (allocated(error)) return
      if (.not. is_result(file)) then
         call fatal_error(error, path//': is no result file of fw_run: name one '// &
                          "of analysis = 'wear'", status_input)
      else if (.not. file%exists('/wear/depth')) then
         call fatal_error(error, path//': is a result without wear: name one of '// &
                          "analysis = 'wear'", status_input)
      else
         call read_dataset(file, '/wear/depth', depth, error)
      end if
      call file%close(ignored)
   end subroutine load_depths

   !> As that of model files: nothing is kept.
   subroutine read_in_trial(self, path)
      class(worn_trial), intent(in) :: self
      character(*), intent(in) :: path
      real(wp), allocatable :: depth(:, :)
      type(error_type), allocatable :: ignored

      associate (unused => self)
      end associate
      call load_depths(path, depth, ignored)
   end subroutine read_in_trial

   !> Refuse depths of another joint, and rows that are not there or not complete.
   subroutine check_depths(reader, path, step, depth, contact)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: path
      integer, intent(in) :: step
      real(wp), intent(in) :: depth(:, :)
      type(contact_type), intent(in) :: contact
      integer :: last

      last = size(depth, 2)
      if (size(depth, 1) /= contact%n_pairs .and. &
          size(depth, 1)*contact%n_alike /= contact%n_pairs) then
         call reader%refuse('contact', 'worn', path//': holds the depths of '// &
                            to_text(size(depth, 1))//' pairs: this case has '// &
                            to_text(contact%n_pairs)//'; name the result of the same joint')
      else if (last == 0) then
         call reader%refuse('contact', 'worn', path//': holds no step yet')
      else if (step > last) then
         call reader%refuse('contact', 'worn_step', '= '//to_text(step)//': '//path//' has '// &
                            to_text(last)//' steps; 0 takes the last')
      else if (.not. all(ieee_is_finite(depth(:, merge(step, last, step > 0))))) then
         call reader%refuse('contact', 'worn', path//': that step holds depths that are not '// &
                            'finite (a run that was killed while it wrote?): choose an '// &
                            'earlier one with worn_step')
      end if
   end subroutine check_depths

end module fw_read_worn
