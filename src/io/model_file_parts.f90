!> The kinds of datasets in a model file: each is read with its shape and its values checked.
!> An absent dataset leaves its target not allocated, unless it is required.
!> Indices in messages count from 0, as in h5py.
!>
!> Shapes are checked before values, and both before anything is used: a message names file,
!> dataset, what was found and what was expected. All procedures start with the file and the
!> absolute name.
module fw_model_file_parts
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_error, only: error_type
   use fw_hdf5, only: dataset_failure, get_shape, hdf5_file, read_dataset, read_text, shape_text
   use fw_kinds, only: wp
   use fw_text, only: string_type, to_text
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: read_matrix, read_vector, read_dofs, read_pair_values, read_positions, read_names

contains

   !> A matrix of n columns (0: as many as rows); n_rows rows (default: square).
   subroutine read_matrix(file, name, n, matrix, error, required, n_rows)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> Absence is an error (default: it is not).
      logical, intent(in), optional :: required
      integer, intent(in), optional :: n_rows
      real(wp), allocatable :: found(:, :)
      integer :: rows, columns

      if (skipped(file, name, required)) return
      call read_dataset(file, name, found, error)
      if (allocated(error)) return
      ! `found` has the dimensions of h5py reversed: columns first.
      columns = n
      if (n == 0) columns = size(found, 1)
      rows = columns
      if (present(n_rows)) rows = n_rows
      call check_shape(file, name, shape(found), [columns, rows], error)
      if (allocated(error)) return
      if (rows*columns == 0) then
         call dataset_failure(file, name, 'is empty: no degrees of freedom', error)
         return
      end if
      call check_finite(file, name, shape(found), found, error)
      if (allocated(error)) return
      ! Back to the order that h5py shows.
      matrix = transpose(found)
   end subroutine read_matrix

   !> A vector of n values.
   subroutine read_vector(file, name, n, vector, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: vector(:)
      type(error_type), allocatable, intent(out) :: error

      if (skipped(file, name)) return
      call read_dataset(file, name, vector, error)
      if (allocated(error)) return
      call check_shape(file, name, shape(vector), [n], error)
      if (.not. allocated(error)) call check_finite(file, name, [n], vector, error)
   end subroutine read_vector

   !> Dof numbers of the pairs (3, n); n < 0 takes any number of pairs. Always required.
   subroutine read_dofs(file, name, n, dofs, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      !> Component innermost: h5py shows (n, 3).
      integer, allocatable, intent(out) :: dofs(:, :)
      type(error_type), allocatable, intent(out) :: error

      call read_dataset(file, name, dofs, error)
      if (allocated(error)) return
      call check_shape(file, name, shape(dofs), [3, merge(n, size(dofs, 2), n >= 0)], error)
   end subroutine read_dofs

   !> One value per pair; a scalar holds for all.
   subroutine read_pair_values(file, name, n, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      real(wp) :: single

      if (skipped(file, name)) return
      call get_shape(file, name, dims, error)
      if (allocated(error)) return
      ! The rank decides before anything is read.
      if (size(dims) == 1) then
         ! Values of all sectors are as many times those of one.
         call read_vector(file, name, merge(int(dims(1)), n, is_multiple(dims(1), n)), values, &
                          error)
         return
      else if (size(dims) > 0) then
         call read_vector(file, name, n, values, error)
         return
      end if
      call read_dataset(file, name, single, error)
      if (allocated(error)) return
      call check_finite(file, name, [integer ::], [single], error)
      if (.not. allocated(error)) allocate (values(n), source=single)
   end subroutine read_pair_values

   !> Whether there are n values, or n for each of some sectors.
   pure logical function is_multiple(extent, n)
      integer(hsize_t), intent(in) :: extent
      integer, intent(in) :: n

      is_multiple = n > 0 .and. extent > 0
      if (is_multiple) is_multiple = modulo(extent, int(n, hsize_t)) == 0
   end function is_multiple

   !> Coordinates of the pairs (3, n).
   subroutine read_positions(file, name, n, position, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: position(:, :)
      type(error_type), allocatable, intent(out) :: error

      if (skipped(file, name)) return
      call read_dataset(file, name, position, error)
      if (allocated(error)) return
      call check_shape(file, name, shape(position), [3, n], error)
      if (.not. allocated(error)) call check_finite(file, name, [3, n], position, error)
   end subroutine read_positions

   !> n names (n < 0: any number).
   subroutine read_names(file, name, n, names, error, required)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      type(string_type), allocatable, intent(out) :: names(:)
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: required

      if (skipped(file, name, required)) return
      call read_text(file, name, names, error)
      if (allocated(error) .or. n < 0) return
      call check_shape(file, name, shape(names), [n], error)
   end subroutine read_names

   !> Is the dataset absent, and may it be?
   logical function skipped(file, name, required)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      logical, intent(in), optional :: required

      skipped = .not. file%exists(name)
      if (present(required)) skipped = skipped .and. .not. required
   end function skipped

   !> Refuse another shape than the one expected, both in the order of Fortran.
   subroutine check_shape(file, name, found, expected, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: found(:), expected(:)
      type(error_type), allocatable, intent(out) :: error

      if (all(found == expected)) return
      call dataset_failure(file, name, 'has shape '//shape_text(int(found, hsize_t))// &
                           ', expected '//shape_text(int(expected, hsize_t)), error)
   end subroutine check_shape

   !> Refuse NaN and infinity, with the place of the first.
   subroutine check_finite(file, name, dims, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: dims(:)
      real(wp), intent(in) :: values(product(dims))
      type(error_type), allocatable, intent(out) :: error
      integer :: i, j, rest
      integer(hsize_t) :: place(size(dims))

      do i = 1, size(values)
         if (ieee_is_finite(values(i))) cycle
         rest = i - 1
         do j = 1, size(dims)
            ! Indices from 0, as h5py counts; shape_text turns their order.
            place(j) = mod(rest, dims(j))
            rest = rest/dims(j)
         end do
         call dataset_failure(file, name, 'holds '//to_text(values(i))//' at index '// &
                              shape_text(place)//', expected a finite number', error)
         return
      end do
   end subroutine check_finite

end module fw_model_file_parts
