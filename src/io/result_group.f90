!> Groups of a result file beside the rows of its points: peaks, bifurcations, modes, ...
!>
!> A group extends `result_group` and puts what it holds, each dataset in one call with its numbers,
!> unit, dimensions and meaning; `result_writer%add` writes it. A new group is one file and the line
!> that adds it. After a failure nothing more is written, and `error` says what failed.
!>
!> Every dataset says of itself `long_name`, `units` and the names of its dimensions
!> (DIMENSION_LABELS, as HDF5's dimension scales have them). Units follow the unit system of the
!> model file, four words 'length-mass-time-force' such as 'mm-tonne-s-N'. Where it says nothing of
!> the kind, only what does not depend on it has units.
module fw_result_group
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset, write_text
   use fw_kinds, only: wp
   use fw_text, only: string_type
   use fw_text_list, only: words_of
   implicit none (type, external)
   private

   public :: group_writer, label_dataset, result_group, unknown_below

   !> Where datasets of a group go.
   type :: group_writer
      type(hdf5_file) :: file
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable :: unit_system
      !> The first failure: what comes behind it is left out.
      type(error_type), allocatable :: error
   contains
      generic :: put => put_reals, put_integers, put_texts
      generic :: note => note_text, note_integer, note_real
      procedure :: put_places
      procedure, private :: put_reals, put_integers, put_texts
      procedure, private :: note_text, note_integer, note_real
      procedure, private :: label
   end type group_writer

   !> What a result holds beside its points.
   type, abstract :: result_group
   contains
      procedure(write_group), deferred :: write
   end type result_group

   abstract interface
      !> Put all that the group holds; nothing where it is empty.
      subroutine write_group(self, to)
         import :: group_writer, result_group
         implicit none (type, external)
         class(result_group), intent(in) :: self
         type(group_writer), intent(inout) :: to
      end subroutine write_group
   end interface

contains

   !> Numbers of any rank; h5py shows their shape reversed. `name` is the path of the dataset,
   !> `dimensions` their names in the order of h5py, separated by blanks; `unit` as in `unit_of`.
   subroutine put_reals(self, name, values, unit, dimensions, long_name)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: name, unit, dimensions, long_name
      real(wp), intent(in), contiguous :: values(..)

      if (allocated(self%error)) return
      call write_dataset(self%file, name, values, self%error)
      call self%label(name, unit, dimensions, long_name)
   end subroutine put_reals

   subroutine put_integers(self, name, values, unit, dimensions, long_name)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: name, unit, dimensions, long_name
      integer, intent(in), contiguous :: values(..)

      if (allocated(self%error)) return
      call write_dataset(self%file, name, values, self%error)
      call self%label(name, unit, dimensions, long_name)
   end subroutine put_integers

   !> Texts say themselves what they are where nothing else is given.
   subroutine put_texts(self, name, values, unit, dimensions, long_name)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: name
      type(string_type), intent(in) :: values(:)
      character(*), intent(in), optional :: unit, dimensions, long_name

      if (allocated(self%error)) return
      call write_text(self%file, name, values, self%error)
      if (present(long_name)) call self%label(name, unit, dimensions, long_name)
   end subroutine put_texts

   !> Places in a list of words, from 0; the words are the attribute `names`.
   subroutine put_places(self, name, places, words, dimensions, long_name)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: name, dimensions, long_name
      integer, intent(in), contiguous :: places(:)
      character(*), intent(in) :: words(0:)
      type(string_type) :: names(size(words))
      integer :: k

      do k = 1, size(names)
         names(k)%text = trim(words(k - 1))
      end do
      call self%put(name, places, '', dimensions, long_name)
      if (allocated(self%error)) return
      call write_attribute(self%file, name, 'names', names, self%error)
   end subroutine put_places

   !> An attribute of a group or a dataset that exists.
   subroutine note_text(self, object, name, value)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: object, name, value

      if (.not. allocated(self%error)) call write_attribute(self%file, object, name, value, &
                                                            self%error)
   end subroutine note_text

   subroutine note_integer(self, object, name, value)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: object, name
      integer, intent(in) :: value

      if (.not. allocated(self%error)) call write_attribute(self%file, object, name, value, &
                                                            self%error)
   end subroutine note_integer

   subroutine note_real(self, object, name, value)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: object, name
      real(wp), intent(in) :: value

      if (.not. allocated(self%error)) call write_attribute(self%file, object, name, value, &
                                                            self%error)
   end subroutine note_real

   subroutine label(self, name, unit, dimensions, long_name)
      class(group_writer), intent(inout) :: self
      character(*), intent(in) :: name, unit, dimensions, long_name

      if (.not. allocated(self%error)) call label_dataset(self%file, name, unit, dimensions, &
                                                          long_name, self%unit_system, self%error)
   end subroutine label

   !> Negative stands for unknown inside the program, NaN in a file.
   elemental real(wp) function unknown_below(value)
      real(wp), intent(in) :: value

      unknown_below = value
      if (value < 0.0_wp) unknown_below = ieee_value(1.0_wp, ieee_quiet_nan)
   end function unknown_below

   !> Write the attributes of a dataset that exists. No attribute `units` where the unit is not
   !> known: a blank one would say that there is none.
   subroutine label_dataset(file, name, unit, dimensions, long_name, unit_system, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name, unit, dimensions, long_name
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: units

      call write_attribute(file, name, 'long_name', long_name, error)
      if (allocated(error)) return
      call write_attribute(file, name, 'DIMENSION_LABELS', words_of(dimensions, ' '), error)
      if (allocated(error)) return
      units = unit_of(unit, unit_system)
      if (len(units) > 0) call write_attribute(file, name, 'units', units, error)
   end subroutine label_dataset

   !> The unit of a quantity: '<length>', '<area>', '<volume>', '<force>', '<energy>' or '<stress>'
   !> of the unit system, '' where that is not known; anything else is a unit already.
   function unit_of(quantity, unit_system) result(unit)
      character(*), intent(in) :: quantity
      character(:), allocatable, intent(in) :: unit_system
      character(:), allocatable :: unit
      integer, parameter :: length = 1, force = 4
      type(string_type), allocatable :: words(:)

      unit = quantity
      if (index(quantity, '<') /= 1) return
      unit = ''
      if (.not. allocated(unit_system)) return
      words = words_of(unit_system, '-')
      if (size(words) /= force) return
      select case (quantity)
      case ('<length>')
         unit = words(length)%text
      case ('<area>')
         unit = words(length)%text//'^2'
      case ('<volume>')
         unit = words(length)%text//'^3'
      case ('<force>')
         unit = words(force)%text
      case ('<stress>')
         unit = words(force)%text//'/'//words(length)%text//'^2'
      case ('<energy>')
         unit = words(force)%text//' '//words(length)%text
      case default ! a number
      end select
   end function unit_of

end module fw_result_group
