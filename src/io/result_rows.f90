!> The datasets of a result file with one row per solution point, as the table of quantities
!> declares them.
module fw_result_rows
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type
   use fw_hdf5, only: get_shape, growing_dataset, growing_integer, growing_logical, hdf5_file, &
      read_dataset, write_attribute
   use fw_kinds, only: wp
   use fw_parameters, only: parameter_words
   use fw_point, only: point_type, served_words
   use fw_point_quantities, only: point_quantities, quantity_type, unknown_size
   use fw_result_group, only: label_dataset
   use fw_solver_options, only: continuation_arclength
   use fw_text, only: string_type
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: row_set, row_names

   !> Rows of a run that ends when it is done: its limit says little, and may be far away.
   integer, parameter :: usual_rows = 128

   !> A quantity and its dataset, which exists from the start where the case tells its shape, else
   !> from the first point that knows the quantity: the rows of points before it stay unknown.
   type :: column_type
      type(quantity_type) :: quantity
      type(growing_dataset) :: dataset
      !> Shape of a row in Fortran.
      integer, allocatable :: row_shape(:)
   contains
      procedure :: create => create_column
      procedure :: append => append_row
      procedure :: copy => copy_rows
   end type column_type

   !> The rows of a result, one for each point, in as many datasets as its case has quantities.
   type :: row_set
      !> Rows so far; how many are likely, which sets the size of the chunks.
      integer, private :: n_rows = 0, expected = 1
      !> What of the case tells the shapes of rows; see fw_point_quantities.
      class(case_type), allocatable, private :: case
      type(column_type), allocatable, private :: columns(:)
   contains
      procedure :: create
      procedure :: append
      procedure :: copy
      procedure :: sort
      procedure :: drain
      procedure :: close
   end type row_set

contains

   !> Create the datasets of every point.
   subroutine create(self, file, case, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(quantity_type), allocatable :: list(:)
      integer :: i

      call take_sizes(case, self%case)
      self%expected = expected_rows(case)
      call point_quantities(list)
      list = pack(list, [(list(i)%is_there(case), i=1, size(list))])
      allocate (self%columns(size(list)))
      do i = 1, size(list)
         associate (column => self%columns(i))
            column%quantity = list(i)
            column%row_shape = list(i)%row_shape(case)
            ! Created late, by the first point that knows it.
            if (any(column%row_shape == unknown_size)) cycle
            call column%create(file, self%case, self%expected, error)
            if (allocated(error)) return
         end associate
      end do
   end subroutine create

   !> A case without its model: rows need the sizes only.
   subroutine take_sizes(case, sizes)
      type(case_type), intent(in) :: case
      class(case_type), allocatable, intent(out) :: sizes

      allocate (sizes)
      ! Matrices of thousands of dofs must not be held a second time.
      sizes%harmonics = case%harmonics
      sizes%over = case%over
      sizes%contact%n_pairs = case%contact%n_pairs
      sizes%springs%n_springs = case%springs%n_springs
      sizes%elements = case%elements
      sizes%model%cyclic%is_mistuned = case%model%cyclic%is_mistuned
      sizes%model%cyclic%n_sectors = case%model%cyclic%n_sectors
      if (allocated(case%model%unit_system)) sizes%model%unit_system = case%model%unit_system
      if (allocated(case%model%observe_matrix)) then
         allocate (sizes%model%observe_matrix(case%model%n_observed(), 0))
      end if
   end subroutine take_sizes

   !> How many rows are likely.
   pure integer function expected_rows(case)
      type(case_type), intent(in) :: case

      expected_rows = 1
      if (case%mission%is_wanted()) then
         expected_rows = 1 + min(usual_rows, case%mission%n_flights)*case%mission%n_blocks
      else if (analyses(case%analysis)%wears) then
         ! The state before any wear is a row of its own.
         expected_rows = min(usual_rows - 1, case%wear%max_steps) + 1
      else if (analyses(case%analysis)%is_free) then
         expected_rows = case%mode%n_points
      else if (analyses(case%analysis)%is_resonance) then
         expected_rows = case%resonance%n_points
      else if (analyses(case%analysis)%is_sweep) then
         expected_rows = max(1, case%sweep%n_points)
         if (case%control%is_wanted()) expected_rows = expected_rows*size(case%control%amplitude)
         if (case%sweep%continuation == continuation_arclength) then
            expected_rows = min(usual_rows, case%sweep%max_points)
         end if
      end if
   end function expected_rows

   !> The datasets that a result of the case has from its start.
   subroutine row_names(case, names)
      type(case_type), intent(in) :: case
      type(string_type), allocatable, intent(out) :: names(:)
      type(quantity_type), allocatable :: list(:)
      logical, allocatable :: is_there(:)
      integer :: i

      call point_quantities(list)
      allocate (is_there(size(list)))
      do i = 1, size(list)
         is_there(i) = list(i)%is_there(case) .and. all(list(i)%row_shape(case) /= unknown_size)
      end do
      list = pack(list, is_there)
      allocate (names(size(list)))
      do i = 1, size(list)
         names(i)%text = '/'//trim(list(i)%name)
      end do
   end subroutine row_names

   !> Append a row to every dataset.
   subroutine append(self, file, point, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: values(:)
      integer :: i

      do i = 1, size(self%columns)
         associate (column => self%columns(i))
            call column%quantity%row(point, self%case, values, usual=product(column%row_shape))
            if (allocated(values) .and. .not. column%dataset%is_created()) then
               call create_late(column, file, self%case, self%expected, size(values), self%n_rows, &
                                error)
               if (allocated(error)) return
            end if
            call column%append(file, values, error)
            if (allocated(error)) return
         end associate
      end do
      self%n_rows = self%n_rows + 1
   end subroutine append

   !> Begin with the first n rows of another result of the same sizes.
   subroutine copy(self, file, source, n, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(self%columns)
         call self%columns(i)%copy(file, source, n, self%case, self%expected, error)
         if (allocated(error)) return
      end do
      self%n_rows = n
   end subroutine copy

   !> Bring all rows into the order of their frequencies.
   subroutine sort(self, file, descending, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      logical, intent(in) :: descending
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: omega(:)
      integer, allocatable :: order(:)
      integer :: i, k

      call self%drain(file, error)
      if (.not. allocated(error)) call read_dataset(file, '/omega', omega, error)
      if (allocated(error)) return
      if (descending) omega = -omega
      ! By insertion: few rows are out of place.
      order = [(i, i=1, size(omega))]
      do i = 2, size(order)
         do k = i, 2, -1
            if (omega(order(k - 1)) <= omega(order(k))) exit
            order(k - 1:k) = order([k, k - 1])
         end do
      end do
      do i = 1, size(self%columns)
         call self%columns(i)%dataset%permute(file, order, error)
         if (allocated(error)) return
      end do
   end subroutine sort

   !> Bring all rows into the file, where they wait to be written together. Harmless before the rows
   !> are created.
   subroutine drain(self, file, error)
      class(row_set), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (.not. allocated(self%columns)) return
      do i = 1, size(self%columns)
         call self%columns(i)%dataset%drain(file, error)
         if (allocated(error)) return
      end do
   end subroutine drain

   !> Harmless before the rows are created.
   subroutine close(self)
      class(row_set), intent(inout) :: self
      integer :: i

      if (.not. allocated(self%columns)) return
      do i = 1, size(self%columns)
         call self%columns(i)%dataset%close()
      end do
   end subroutine close

   !> Create the dataset with its labels.
   subroutine create_column(self, file, case, expected, error)
      class(column_type), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      integer, intent(in) :: expected
      type(error_type), allocatable, intent(out) :: error
      type(string_type) :: words(size(served_words))
      type(hdf5_file) :: place
      integer :: i

      call self%dataset%create(file, '/'//trim(self%quantity%name), self%quantity%kind_of, &
                               self%row_shape, error, expected)
      if (allocated(error)) return
      self%dataset%waits = .true.
      place = self%dataset%place(file)
      call label_dataset(place, '.', trim(self%quantity%unit), self%quantity%dimensions, &
                         trim(self%quantity%long_name), case%model%unit_system, error)
      if (allocated(error)) return
      if (self%quantity%names_parameter) then
         call write_attribute(place, '.', 'name', trim(parameter_words(case%over%number)), error)
      end if
      if (allocated(error) .or. .not. self%quantity%is_served_by) return
      do i = 1, size(words)
         ! Places count from 0.
         words(i)%text = trim(served_words(i - 1))
      end do
      call write_attribute(place, '.', 'names', words, error)
   end subroutine create_column

   !> Create a dataset after the first points, whose rows stay unknown.
   subroutine create_late(column, file, case, expected, n_values, n_rows, error)
      class(column_type), intent(inout) :: column
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      integer, intent(in) :: expected
      !> Numbers in a row, which tell the dimension that was not known; rows before this one.
      integer, intent(in) :: n_values, n_rows
      type(error_type), allocatable, intent(out) :: error
      integer :: known, i

      i = findloc(column%row_shape, unknown_size, 1)
      known = product(column%row_shape, mask=column%row_shape /= unknown_size)
      if (i > 0) column%row_shape(i) = n_values/max(known, 1)
      call column%create(file, case, expected, error)
      if (.not. allocated(error)) call column%dataset%skip(file, n_rows, error)
   end subroutine create_late

   !> A row of numbers, or of none (not allocated). Where the rows are steps, a point that is none
   !> has no row.
   subroutine append_row(self, file, values, error)
      class(column_type), intent(inout) :: self
      type(hdf5_file), intent(in) :: file
      real(wp), allocatable, intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error

      ! No point has known it so far.
      if (.not. self%dataset%is_created()) return
      if (.not. allocated(values)) then
         if (index(self%quantity%dimensions, 'step') == 1) return
         ! Integers have no NaN: each says by itself what stands for unknown.
         if (self%quantity%kind_of == growing_integer) then
            call self%dataset%append_flat(file, self%row_shape, &
                                          spread(self%quantity%missing, 1, &
                                                 product(self%row_shape)), error)
         else
            call self%dataset%skip(file, 1, error)
         end if
         return
      end if
      select case (self%quantity%kind_of)
      case (growing_integer)
         call self%dataset%append_flat(file, self%row_shape, nint(values), error)
      case (growing_logical)
         call self%dataset%append(file, values(1) > 0.0_wp, error)
      case default
         call self%dataset%append_flat(file, self%row_shape, values, error)
      end select
   end subroutine append_row

   !> Rows of another result; a quantity that it does not hold stays unknown.
   subroutine copy_rows(self, file, source, n, case, expected, error)
      class(column_type), intent(inout) :: self
      type(hdf5_file), intent(in) :: file, source
      integer, intent(in) :: n
      type(case_type), intent(in) :: case
      integer, intent(in) :: expected
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: name
      integer(hsize_t), allocatable :: dims(:)

      name = '/'//trim(self%quantity%name)
      if (.not. source%exists(name)) then
         if (self%dataset%is_created()) call self%dataset%skip(file, n, error)
         return
      end if
      if (.not. self%dataset%is_created()) then
         call get_shape(source, name, dims, error)
         if (allocated(error)) return
         ! The shape that this run cannot know yet is that of the earlier one.
         self%row_shape = int(dims(:size(dims) - 1))
         call self%create(file, case, expected, error)
         if (allocated(error)) return
      end if
      call self%dataset%copy_rows(file, source, n, error)
   end subroutine copy_rows

end module fw_result_rows
