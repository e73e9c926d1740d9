!> The arrays of the reader: as many values as their shape says, from several assignments.
submodule (fw_reader) fw_reader_arrays
   use fw_array_entries, only: source_type
   use fw_reader_text, only: dims_text, element_text, number_list
   use fw_key_range, only: range_type
   use fw_values, only: number_text
   implicit none (type, external)

contains

   module procedure bind_reals
      call take_numbers(self, key, real_kind, values, needed, default)
   end procedure bind_reals

   !> By way of reals, in which every whole number of 32 bits is exact.
   module procedure bind_integers
      real(wp), allocatable :: numbers(:)

      if (allocated(values)) numbers = real(values, wp)
      if (present(default)) then
         call take_numbers(self, key, integer_kind, numbers, needed, real(default, wp))
      else
         call take_numbers(self, key, integer_kind, numbers, needed)
      end if
      if (allocated(numbers)) values = nint(numbers)
   end procedure bind_integers

   !> An array, in Fortran order.
   subroutine take_numbers(self, key, kind, numbers, needed, default)
      type(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(*), intent(in) :: kind
      real(wp), allocatable, intent(inout) :: numbers(:)
      logical, intent(in), optional :: needed
      real(wp), intent(in), optional :: default
      type(range_type) :: range
      type(source_type) :: source
      character(:), allocatable :: accepts, text
      integer, allocatable :: dims(:)
      logical :: is_given, ok

      range = with_sizes(self, key%range)
      accepts = range_text(kind, range)
      dims = self%extents(key%shape)
      text = ''
      if (present(default)) text = kind_text(default, kind)
      call self%note(key, kind_name(kind), accepts, text)
      ! What the model holds is checked even where the namelist replaces all of it.
      if (allocated(numbers)) call check_held(self, key, range, dims, accepts, numbers)
      is_given = self%given(self%group, trim(key%name))
      if (.not. is_given) call blame_missing(self, key, accepts, dims, needed)
      if (present(default) .and. .not. allocated(numbers)) then
         allocate (numbers(product(dims)), source=default)
      end if
      if (.not. is_given) return
      if (key%shape == ':') then
         call self%find_list(self%group, trim(key%name), accepts, dims, source)
         ! Empty where it is refused: it was given.
         if (.not. allocated(source%entry)) allocate (numbers(0))
      else
         ! Elements may be left out where they have a value already.
         call self%find_elements(self%group, trim(key%name), accepts, dims, key%repeats, &
                                 allocated(numbers), source, sum(pack(self%sizes%tile, &
                                                                     self%sizes%name == key%shape)))
      end if
      if (.not. allocated(source%entry)) return
      if (.not. allocated(numbers)) allocate (numbers(size(source%entry)), source=0.0_wp)
      call read_elements(self, source, kind, range, dims, numbers, ok)
      if (ok) call self%amend(self%group, trim(key%name), &
                              number_list(numbers, kind, dims, key%repeats))
   end subroutine take_numbers

   !> The elements that are given; the first that is wrong is recorded.
   subroutine read_elements(self, source, kind, range, dims, numbers, ok)
      type(reader_type), intent(inout) :: self
      type(source_type), intent(in) :: source
      character(*), intent(in) :: kind
      type(range_type), intent(in) :: range
      integer, intent(in) :: dims(:)
      real(wp), intent(inout) :: numbers(:)
      logical, intent(out) :: ok
      integer :: k

      ok = .true.
      do k = 1, size(numbers)
         if (source%entry(k) == 0) cycle
         associate (value => self%namelist%entries(source%entry(k))%values(source%value(k)))
            call read_number(value, kind, range, numbers(k), ok)
            if (ok) cycle
            call self%refuse_value(source%entry(k), range_text(kind, range), value, k, dims)
            return
         end associate
      end do
   end subroutine read_elements

   !> Values that the model holds pass the checks of those that the namelist gives.
   subroutine check_held(self, key, range, dims, accepts, numbers)
      type(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      type(range_type), intent(in) :: range
      integer, intent(in) :: dims(:)
      character(*), intent(in) :: accepts
      real(wp), intent(in) :: numbers(:)
      integer :: k

      ! The expected size may itself be wrong where something failed before.
      if (self%failed()) return
      if (size(numbers) /= product(dims)) then
         call self%refuse_model(to_text(size(numbers))//' values of '//trim(key%name)// &
                                ': must be '//to_text(product(dims)))
         return
      end if
      do k = 1, size(numbers)
         if (range%holds(numbers(k))) cycle
         call self%refuse_model(trim(key%name)//element_text(k, dims)//' = '// &
                                number_text(numbers(k))//': must be '//accepts)
         return
      end do
   end subroutine check_held

   !> Record that an array is not given, where it is needed.
   subroutine blame_missing(self, key, accepts, dims, needed)
      type(reader_type), intent(inout) :: self
      type(key_type), intent(in) :: key
      character(*), intent(in) :: accepts
      integer, intent(in) :: dims(:)
      logical, intent(in), optional :: needed
      character(:), allocatable :: count

      if (.not. present(needed)) return
      if (.not. needed) return
      count = ', '//dims_text(dims)//' of them'
      if (key%repeats) count = ', one for all or '//dims_text(dims)//' of them'
      if (any(dims == 0) .or. all(dims == 1)) count = ''
      call self%blame(0, '&'//self%group//' '//trim(key%name)//' is missing: must be '//accepts// &
                      count)
   end subroutine blame_missing

   !> A range whose bounds are all numbers.
   pure type(range_type) function with_sizes(self, range) result(bounded)
      class(reader_type), intent(in) :: self
      type(range_type), intent(in) :: range
      integer :: extent(1)

      bounded = range
      if (len_trim(range%within) == 0) return
      extent = self%extents(range%within)
      ! A size that nobody has told bounds nothing.
      if (extent(1) == 0) return
      bounded%least = -real(extent(1), wp)
      bounded%most = real(extent(1), wp)
   end function with_sizes

end submodule fw_reader_arrays
