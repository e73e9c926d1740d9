!> Attributes of HDF5 objects: one string, integer or real number, and lists of strings (which are
!> written only).
!>
!> An attribute is named by its object, an absolute name ('/' is the file), and its own name.
!> Messages have both, and the path of the file. Many of one dataset take less time where the file
!> stands at that (`growing_dataset%place`): the object is '.' then.
module fw_hdf5_attribute
   use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
   use fw_error, only: error_type, fatal_error
   use fw_hdf5_file, only: hdf5_file
   use fw_hdf5_string, only: get_strings, put_strings, new_string_type
   use fw_hdf5_write, only: new_space
   use fw_kinds, only: wp, i8
   use fw_text, only: string_type
   use hdf5, only: hid_t, hsize_t, h5aclose_f, h5acreate_by_name_f, h5adelete_by_name_f, &
      h5aexists_by_name_f, h5aget_space_f, h5aget_type_f, h5aopen_by_name_f, h5aread_f, &
      h5awrite_f, h5kind_to_type, h5_integer_kind, h5_real_kind, h5sclose_f, &
      h5sget_simple_extent_npoints_f, h5tclose_f, h5tget_class_f, h5t_float_f, h5t_integer_f, &
      h5t_string_f
   implicit none (type, external)
   private

   public :: has_attribute, read_attribute, write_attribute

   !> `call read_attribute(file, object, name, value, error)`; object '/' is the file.
   interface read_attribute
      module procedure read_attribute_text
      module procedure read_attribute_integer
      module procedure read_attribute_real
   end interface read_attribute

   !> `call write_attribute(file, object, name, value, error)` replaces what is there.
   interface write_attribute
      module procedure write_attribute_text
      module procedure write_attribute_texts
      module procedure write_attribute_integer
      module procedure write_attribute_real
   end interface write_attribute

contains

   !> Has this object such an attribute?
   !> False also where the object itself is missing: optional attributes are asked for first.
   logical function has_attribute(file, object, name) result(found)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer :: status

      call h5aexists_by_name_f(file%id, object, name, found, status)
      found = found .and. status >= 0
   end function has_attribute

   !> One string, of variable or fixed length.
   subroutine read_attribute_text(file, object, name, text, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      character(:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: strings(:)
      integer(hid_t) :: id
      integer :: status, ignored

      call open_attribute(file, object, name, [h5t_string_f], id, error)
      if (allocated(error)) return
      call get_strings(id, .true., 1, strings, status)
      call h5aclose_f(id, ignored)
      if (status < 0) then
         call attribute_failure(file, object, name, 'cannot be read', error)
      else
         call move_alloc(strings(1)%text, text)
      end if
   end subroutine read_attribute_text

   !> One whole number of any width, read as 64 bits, because HDF5 clips silently what does not fit.
   subroutine read_attribute_integer(file, object, name, value, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer, intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      integer(i8), target :: wide
      integer(hid_t) :: id

      value = 0
      wide = 0_i8
      call open_attribute(file, object, name, [h5t_integer_f], id, error)
      if (allocated(error)) return
      call read_and_close(file, object, name, id, h5kind_to_type(i8, h5_integer_kind), &
                          c_loc(wide), error)
      if (allocated(error)) return
      if (abs(wide) > huge(0)) then
         call attribute_failure(file, object, name, 'does not fit 32 bits', error)
      else
         value = int(wide)
      end if
   end subroutine read_attribute_integer

   !> One number; whole ones are welcome.
   subroutine read_attribute_real(file, object, name, value, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      real(wp), target :: found
      integer(hid_t) :: id

      value = 0.0_wp
      found = 0.0_wp
      call open_attribute(file, object, name, [h5t_float_f, h5t_integer_f], id, error)
      if (allocated(error)) return
      call read_and_close(file, object, name, id, h5kind_to_type(wp, h5_real_kind), &
                          c_loc(found), error)
      value = found
   end subroutine read_attribute_real

   !> A string, as a scalar.
   subroutine write_attribute_text(file, object, name, value, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name, value
      type(error_type), allocatable, intent(out) :: error
      type(string_type) :: strings(1)

      ! Not by a structure constructor, whose text gfortran 12 does not free.
      strings(1)%text = value
      call put_attribute(file, object, name, [integer ::], strings, error)
   end subroutine write_attribute_text

   !> A list, one dimension long.
   subroutine write_attribute_texts(file, object, name, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      type(string_type), intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error

      call put_attribute(file, object, name, [size(values)], values, error)
   end subroutine write_attribute_texts

   !> Strings of variable length; no dimensions make a scalar.
   subroutine put_attribute(file, object, name, dims, strings, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer, intent(in) :: dims(:)
      type(string_type), intent(in) :: strings(:)
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: id, type_id
      integer :: status, ignored

      type_id = new_string_type()
      call new_attribute(file, object, name, dims, type_id, id, error)
      if (.not. allocated(error)) then
         call put_strings(id, type_id, .true., strings, status)
         call h5aclose_f(id, ignored)
      end if
      call h5tclose_f(type_id, ignored)
      if (allocated(error)) return
      if (status < 0) call attribute_failure(file, object, name, 'cannot be written', error)
   end subroutine put_attribute

   subroutine write_attribute_integer(file, object, name, value, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer, intent(in) :: value
      type(error_type), allocatable, intent(out) :: error
      integer, target :: buffer

      ! A target of its own, whose address can be taken.
      buffer = value
      call write_number(file, object, name, h5kind_to_type(kind(0), h5_integer_kind), &
                        c_loc(buffer), error)
   end subroutine write_attribute_integer

   subroutine write_attribute_real(file, object, name, value, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error
      real(wp), target :: buffer

      buffer = value
      call write_number(file, object, name, h5kind_to_type(wp, h5_real_kind), c_loc(buffer), &
                        error)
   end subroutine write_attribute_real

   !> Open an attribute of one element whose class is among those accepted.
   subroutine open_attribute(file, object, name, classes, id, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer, intent(in) :: classes(:)
      integer(hid_t), intent(out) :: id
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: type_id, space
      integer(hsize_t) :: n
      integer :: class, status

      id = -1_hid_t
      if (.not. has_attribute(file, object, name)) then
         call attribute_failure(file, object, name, 'is missing', error)
         return
      end if
      call h5aopen_by_name_f(file%id, object, name, id, status)
      call h5aget_type_f(id, type_id, status)
      ! The class alone: HDF5 converts every width and order of bytes.
      call h5tget_class_f(type_id, class, status)
      call h5tclose_f(type_id, status)
      call h5aget_space_f(id, space, status)
      call h5sget_simple_extent_npoints_f(space, n, status)
      call h5sclose_f(space, status)
      ! A list of one is taken for a scalar: MATLAB writes no other.
      if (n == 1 .and. any(class == classes)) return
      call h5aclose_f(id, status)
      call attribute_failure(file, object, name, 'is of the wrong type, expected one '// &
                             class_words(classes(1)), error)
   end subroutine open_attribute

   !> What was expected, in words.
   pure function class_words(class) result(words)
      integer, intent(in) :: class
      character(:), allocatable :: words

      words = 'integer'
      if (class == h5t_string_f) words = 'string'
      if (class == h5t_float_f) words = 'real number'
   end function class_words

   !> Read one element to an address, converted to a type of memory, and close the attribute.
   subroutine read_and_close(file, object, name, id, type_id, address, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer(hid_t), intent(in) :: id, type_id
      type(c_ptr), intent(in) :: address
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: buffer
      integer :: status, ignored

      ! The interface wants a variable, although the address stays.
      buffer = address
      call h5aread_f(id, type_id, buffer, status)
      call h5aclose_f(id, ignored)
      if (status < 0) call attribute_failure(file, object, name, 'cannot be read', error)
   end subroutine read_and_close

   !> Create an attribute, removing one of the same name; no dimensions make a scalar.
   subroutine new_attribute(file, object, name, dims, type_id, id, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer, intent(in) :: dims(:)
      integer(hid_t), intent(in) :: type_id
      integer(hid_t), intent(out) :: id
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: space
      integer :: status, ignored

      space = new_space(dims)
      call h5acreate_by_name_f(file%id, object, name, type_id, space, id, status)
      ! HDF5 cannot change the type or the shape of an attribute. Few are there already: none is
      ! asked for.
      if (status < 0) then
         call h5adelete_by_name_f(file%id, object, name, status)
         call h5acreate_by_name_f(file%id, object, name, type_id, space, id, status)
      end if
      call h5sclose_f(space, ignored)
      if (status < 0) call attribute_failure(file, object, name, 'cannot be created', error)
   end subroutine new_attribute

   !> One number from an address, as a scalar.
   subroutine write_number(file, object, name, type_id, address, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name
      integer(hid_t), intent(in) :: type_id
      type(c_ptr), intent(in) :: address
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: id
      integer :: status, ignored

      call new_attribute(file, object, name, [integer ::], type_id, id, error)
      if (allocated(error)) return
      call h5awrite_f(id, type_id, address, status)
      call h5aclose_f(id, ignored)
      if (status < 0) call attribute_failure(file, object, name, 'cannot be written', error)
   end subroutine write_number

   !> Raise an error: `text` continues "<file>: attribute <name> of <object> ".
   subroutine attribute_failure(file, object, name, text, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object, name, text
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, file%path//': attribute '//name//' of '//object//' '//text, &
                       file%status)
   end subroutine attribute_failure

end module fw_hdf5_attribute
