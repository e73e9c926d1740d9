!> Model files: the structure, its contact pairs, loads and observed quantities (HDF5).
!>
!> Datasets are named and shaped as the user guide says; here every shape is reversed, because
!> HDF5 counts the slowest dimension first, and matrices are transposed back, so that element
!> (i, j) is the one h5py calls [i-1, j-1].
module fw_model_file
   use fw_contact_data, only: contact_type, sliding_words
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hdf5, only: hdf5_file, has_attribute, read_attribute
   use fw_laws, only: law_words
   use fw_normal_law, only: normal_words
   use fw_model_file_rules, only: check_after, check_before
   use fw_part_file, only: file_source
   use fw_parts, only: keys_of_laws
   use fw_raw_model, only: raw_model
   use fw_reader_text, only: words_text
   use fw_strangers, only: find_strangers
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: list_unread, read_model_hdf5

   ! What a file must say of itself in its attributes, so that any other HDF5 file is told apart.
   character(*), parameter :: format_name = 'fretwear-model'
   integer, parameter :: known_version = 1

contains

   !> Read a model file.
   subroutine read_model_hdf5(path, model, error)
      character(*), intent(in) :: path
      type(raw_model), intent(out) :: model
      !> status_io where the file cannot be read, status_input for what is wrong in it.
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(file_source) :: source

      call source%file%open_read(path, error)
      if (allocated(error)) return
      allocate (model%files(1))
      model%files(1)%text = path
      call read_header(source%file, error)
      if (.not. allocated(error)) call read_members(source%file, model%cyclic%n_sectors, &
                                                    model%unread, error)
      if (.not. allocated(error)) call check_before(source, model, error)
      if (.not. allocated(error)) then
         source%constants = keys_of_laws()
         call model%bind_parts(source)
         call source%forget()
         call move_alloc(source%error, error)
      end if
      if (.not. allocated(error)) call read_law(source%file, model%contact, error)
      if (.not. allocated(error)) call read_normal_law(source%file, model%contact, error)
      if (.not. allocated(error)) call read_sliding(source%file, model%contact, error)
      if (.not. allocated(error)) call check_after(source%file, model, error)
      call source%file%close(ignored)
   end subroutine read_model_hdf5

   !> What stands in a model file and nothing reads; an error where that is refused.
   subroutine list_unread(path, unread, error)
      character(*), intent(in) :: path
      type(string_type), allocatable, intent(out) :: unread(:)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file
      integer :: n_sectors

      ! HDF5 and functions of texts serve one thread at a time.
      !$omp critical (fretwear_io)
      call file%open_read(path, error)
      if (.not. allocated(error)) call read_members(file, n_sectors, unread, error)
      call file%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine list_unread

   !> The number of sectors, and what nothing reads: first, for a part that is missing may stand
   !> there under another name.
   subroutine read_members(file, n_sectors, unread, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(out) :: n_sectors
      type(string_type), allocatable, intent(out) :: unread(:)
      type(error_type), allocatable, intent(out) :: error
      !> Takes every number for that of a nodal diameter, where nothing says how many there are.
      integer, parameter :: many = 1000
      type(error_type), allocatable :: uncounted

      call count_sectors(file, n_sectors, uncounted)
      call find_strangers(file, merge(many, n_sectors, allocated(uncounted)), unread, error)
      if (.not. allocated(error)) call move_alloc(uncounted, error)
   end subroutine read_members

   !> Format and version.
   subroutine read_header(file, error)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: format
      integer :: format_version

      call read_attribute(file, '/', 'format', format, error)
      if (allocated(error)) return
      if (format /= format_name) then
         call fatal_error(error, file%path//': attribute format is "'//format// &
                          '", expected "'//format_name//'"', status_input)
         return
      end if
      call read_attribute(file, '/', 'format_version', format_version, error)
      if (allocated(error)) return
      if (format_version /= known_version) then
         call fatal_error(error, file%path//': attribute format_version is '// &
                          to_text(format_version)//', expected '//to_text(known_version), &
                          status_input)
      end if
   end subroutine read_header

   !> The law of the pairs, by its word; a file need not have one.
   subroutine read_law(file, contact, error)
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(inout) :: contact
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: word

      if (.not. has_attribute(file, '/contact', 'law')) return
      if (contact%law_is_of_model) then
         call fatal_error(error, file%path//': attribute law of /contact stands beside '// &
                          '/contact/law: keep one', status_input)
         return
      end if
      call read_attribute(file, '/contact', 'law', word, error)
      if (allocated(error)) return
      contact%law = findloc(law_words == word, .true., dim=1)
      contact%law_is_of_model = .true.
      ! Left to the case, another law than the one that was meant would be solved.
      if (contact%law > 0) return
      call fatal_error(error, file%path//': attribute law of /contact is "'//word// &
                       '", expected '//words_text(law_words), status_input)
   end subroutine read_law

   !> The normal law of all pairs, by its word.
   subroutine read_normal_law(file, contact, error)
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(inout) :: contact
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: word
      integer :: number

      if (.not. has_attribute(file, '/contact', 'normal_law')) return
      if (allocated(contact%normal_law)) then
         call fatal_error(error, file%path//': attribute normal_law of /contact stands beside '// &
                          '/contact/normal_law: keep one', status_input)
         return
      end if
      call read_attribute(file, '/contact', 'normal_law', word, error)
      if (allocated(error)) return
      number = findloc(normal_words == word, .true., dim=1)
      if (number == 0) then
         call fatal_error(error, file%path//': attribute normal_law of /contact is "'//word// &
                          '", expected '//words_text(normal_words), status_input)
      else if (allocated(contact%side_1)) then
         contact%normal_law = spread(number, 1, size(contact%side_1, 2))
      end if
   end subroutine read_normal_law

   !> How friction follows a side that slides.
   subroutine read_sliding(file, contact, error)
      type(hdf5_file), intent(in) :: file
      type(contact_type), intent(inout) :: contact
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: word
      integer :: number

      if (.not. allocated(contact%side_1)) return
      if (.not. has_attribute(file, '/contact', 'sliding')) return
      call read_attribute(file, '/contact', 'sliding', word, error)
      if (allocated(error)) return
      number = findloc(sliding_words == word, .true., dim=1)
      if (number == 0) then
         call fatal_error(error, file%path//': attribute sliding of /contact is "'//word// &
                          '", expected '//words_text(sliding_words), status_input)
      else
         contact%sliding = number
      end if
   end subroutine read_sliding

   !> Number of sectors; 0 where the file has no group /cyclic.
   subroutine count_sectors(file, n_sectors, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(out) :: n_sectors
      type(error_type), allocatable, intent(out) :: error

      n_sectors = 0
      if (.not. file%exists('/cyclic')) return
      call read_attribute(file, '/cyclic', 'n_sectors', n_sectors, error)
      if (allocated(error) .or. n_sectors >= 1) return
      call fatal_error(error, file%path//': attribute n_sectors of /cyclic is '// &
                       to_text(n_sectors)//', expected at least 1', status_input)
   end subroutine count_sectors

end module fw_model_file
