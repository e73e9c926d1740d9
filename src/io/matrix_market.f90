!> Matrices in the Matrix Market exchange format (Boisvert, Pozo, Remington 1996): coordinate and
!> array, real and integer, general and symmetric. What can be no structural matrix is refused:
!> complex (the library works with real matrices), pattern (no values), skew-symmetric.
module fw_matrix_market
   use fw_error, only: error_type, fatal_error, status_input, status_io
   use fw_kinds, only: wp
   use fw_matrix_market_lines, only: line_reader
   use fw_raw_model, only: raw_model
   use fw_text, only: lower_case, string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: read_matrix_market, read_matrix_market_model

   !> No more elements than 4 GB: every matrix is held dense.
   integer, parameter :: max_elements = 2**29

   !> What the first line and the size line say.
   type :: header_type
      !> Entries with their places, or all elements in order; only the lower triangle is given.
      logical :: coordinate = .false., symmetric = .false.
      integer :: n_rows = 0, n_columns = 0, n_entries = 0
   end type header_type

contains

   !> Read a matrix; entries given twice are summed, absent ones are zero.
   subroutine read_matrix_market(path, matrix, error)
      character(*), intent(in) :: path
      real(wp), allocatable, intent(out) :: matrix(:, :)
      !> status_io where the file cannot be opened, else status_input with file and line.
      type(error_type), allocatable, intent(out) :: error
      type(line_reader) :: lines
      type(header_type) :: header

      call lines%open(path, error)
      if (allocated(error)) return
      call read_banner(lines, header, error)
      if (.not. allocated(error)) call read_size(lines, header, error)
      if (.not. allocated(error)) then
         allocate (matrix(header%n_rows, header%n_columns), source=0.0_wp)
         if (header%coordinate) then
            call read_coordinates(lines, header, matrix, error)
         else
            call read_array(lines, header, matrix, error)
         end if
      end if
      if (.not. allocated(error)) call lines%expect_end(error)
      call lines%close()
   end subroutine read_matrix_market

   !> Read <prefix>_mass.mtx, <prefix>_stiffness.mtx and, where there is one,
   !> <prefix>_damping.mtx, or their like in a folder.
   subroutine read_matrix_market_model(path, model, error)
      !> A prefix, a folder, or the path of one of the files.
      character(*), intent(in) :: path
      !> Only mass, stiffness, damping and the files are set.
      type(raw_model), intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: prefix
      integer :: n

      prefix = prefix_of(path)
      allocate (model%files(0))
      ! Also those that are missing, as an empty text.
      call append(model%files, found_file(prefix, 'mass'))
      call append(model%files, found_file(prefix, 'stiffness'))
      call append(model%files, found_file(prefix, 'damping'))
      call read_part(prefix, 'mass', 0, model%mass, error)
      if (allocated(error)) return
      n = size(model%mass, 1)
      call read_part(prefix, 'stiffness', n, model%stiffness, error)
      if (allocated(error)) return
      if (len(found_file(prefix, 'damping')) == 0) return
      call read_part(prefix, 'damping', n, model%damping, error)
   end subroutine read_matrix_market_model

   !> Read one of the matrices, square and of order n (0: any).
   subroutine read_part(prefix, part, n, matrix, error)
      character(*), intent(in) :: prefix, part
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: path, expected
      integer :: i

      path = found_file(prefix, part)
      if (len(path) == 0) then
         path = candidate(prefix, part, 1)
         do i = 2, 4
            path = path//', '//candidate(prefix, part, i)
         end do
         call fatal_error(error, prefix//': no file with the '//part//' matrix; tried '//path, &
                          status_io)
         return
      end if
      call read_matrix_market(path, matrix, error)
      if (allocated(error)) return
      if (size(matrix, 1) == size(matrix, 2) .and. (n == 0 .or. size(matrix, 1) == n)) return
      expected = 'a square matrix'
      if (n > 0) expected = to_text(n)//' x '//to_text(n)//' as the mass matrix'
      call fatal_error(error, path//': the '//part//' matrix is '//to_text(size(matrix, 1))// &
                       ' x '//to_text(size(matrix, 2))//', expected '//expected, status_input)
   end subroutine read_part

   !> Where a matrix may be; the order says which is taken.
   pure function candidate(prefix, part, i) result(path)
      character(*), intent(in) :: prefix, part
      integer, intent(in) :: i
      character(:), allocatable :: path
      ! beam_mass.mtx, beam.mass.mtx, beam/mass.mtx, and beam followed by mass.mtx at once.
      character(*), parameter :: joints(*) = ['_', '.', '/', ' ']

      path = prefix//trim(joints(i))//part//'.mtx'
   end function candidate

   !> The first candidate that exists, '' where none does.
   function found_file(prefix, part) result(path)
      character(*), intent(in) :: prefix, part
      character(:), allocatable :: path
      logical :: found
      integer :: i

      do i = 1, 4
         path = candidate(prefix, part, i)
         inquire (file=path, exist=found)
         if (found) return
      end do
      path = ''
   end function found_file

   !> A path of one of the files themselves stands for its prefix.
   pure function prefix_of(path) result(prefix)
      character(*), intent(in) :: path
      character(:), allocatable :: prefix
      character(*), parameter :: parts(*) = [character(9) :: 'mass', 'stiffness', 'damping']
      character(:), allocatable :: ending
      integer :: i, j, start

      prefix = path
      do i = 1, size(parts)
         do j = 1, 4
            ending = candidate('', trim(parts(i)), j)
            start = len(path) - len(ending) + 1
            if (start < 1) cycle
            if (path(start:) /= ending) cycle
            prefix = path(:start - 1)
            if (len(prefix) == 0) prefix = './'
            return
         end do
      end do
   end function prefix_of

   !> The first line, which looks like a comment: "%%MatrixMarket matrix <format> <field>
   !> <symmetry>".
   subroutine read_banner(lines, header, error)
      type(line_reader), intent(inout) :: lines
      type(header_type), intent(inout) :: header
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: words(:)
      integer :: i

      call lines%next(words, error, comments=.false.)
      if (allocated(error)) return
      do i = 1, size(words)
         words(i)%text = lower_case(words(i)%text)
      end do
      if (size(words) /= 5) then
         call lines%failure('is not "%%MatrixMarket matrix <format> <field> <symmetry>"', error)
      else if (words(1)%text /= '%%matrixmarket' .or. words(2)%text /= 'matrix') then
         call lines%failure('does not start with "%%MatrixMarket matrix"', error)
      else if (.not. any(words(3)%text == [character(10) :: 'coordinate', 'array'])) then
         call refuse(lines, words(3)%text, 'coordinate or array', error)
      else if (words(4)%text == 'complex') then
         call refuse(lines, 'complex', 'real or integer: structural matrices are real', error)
      else if (words(4)%text == 'pattern') then
         call refuse(lines, 'pattern', 'real or integer: a pattern has no values', error)
      else if (.not. any(words(4)%text == [character(7) :: 'real', 'double', 'integer'])) then
         call refuse(lines, words(4)%text, 'real or integer', error)
      else if (words(5)%text == 'skew-symmetric' .or. words(5)%text == 'hermitian') then
         call refuse(lines, words(5)%text, 'general or symmetric: mass, stiffness and damping '// &
                     'are real symmetric', error)
      else if (.not. any(words(5)%text == [character(9) :: 'general', 'symmetric'])) then
         call refuse(lines, words(5)%text, 'general or symmetric', error)
      end if
      if (allocated(error)) return
      header%coordinate = words(3)%text == 'coordinate'
      header%symmetric = words(5)%text == 'symmetric'
   end subroutine read_banner

   !> What the first line says, and what it should.
   subroutine refuse(lines, found, expected, error)
      type(line_reader), intent(in) :: lines
      character(*), intent(in) :: found, expected
      type(error_type), allocatable, intent(out) :: error

      call lines%failure('says "'//found//'", expected '//expected, error)
   end subroutine refuse

   !> Rows and columns, and with coordinates the number of entries.
   subroutine read_size(lines, header, error)
      type(line_reader), intent(inout) :: lines
      type(header_type), intent(inout) :: header
      type(error_type), allocatable, intent(out) :: error
      integer :: numbers(3), n

      n = merge(3, 2, header%coordinate)
      numbers = 0
      call lines%next_integers(numbers(:n), error)
      if (allocated(error)) return
      header%n_rows = numbers(1)
      header%n_columns = numbers(2)
      header%n_entries = numbers(3)
      if (any(numbers(:2) < 1) .or. numbers(3) < 0) then
         call lines%failure('gives a size that is not positive', error)
      else if (header%n_rows > max_elements/header%n_columns) then
         ! As a quotient: the product may leave the range of the numbers.
         call lines%failure('gives a matrix too large to be held dense', error)
      else if (header%symmetric .and. header%n_rows /= header%n_columns) then
         call lines%failure('gives a symmetric matrix that is not square', error)
      end if
   end subroutine read_size

   !> One entry a line: row, column and value.
   subroutine read_coordinates(lines, header, matrix, error)
      type(line_reader), intent(inout) :: lines
      type(header_type), intent(in) :: header
      real(wp), intent(inout) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: k, place(2)
      real(wp) :: value

      do k = 1, header%n_entries
         call lines%next_entry(place, value, error)
         if (allocated(error)) return
         if (any(place < 1) .or. any(place > shape(matrix))) then
            call lines%failure('names element ('//to_text(place(1))//', '//to_text(place(2))// &
                               ') outside of the matrix (counted from 1)', error)
            return
         end if
         ! Added up, as finite element programs write what they assemble.
         matrix(place(1), place(2)) = matrix(place(1), place(2)) + value
         if (.not. header%symmetric .or. place(1) == place(2)) cycle
         ! An entry of the upper triangle would be counted twice beside its mirror.
         if (place(1) < place(2)) then
            call lines%failure('gives an element above the diagonal; a symmetric matrix is '// &
                               'stored by its lower triangle', error)
            return
         end if
         matrix(place(2), place(1)) = matrix(place(2), place(1)) + value
      end do
   end subroutine read_coordinates

   !> Column after column; of a symmetric matrix from the diagonal downwards.
   subroutine read_array(lines, header, matrix, error)
      type(line_reader), intent(inout) :: lines
      type(header_type), intent(in) :: header
      real(wp), intent(inout) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: i, j

      do j = 1, header%n_columns
         do i = merge(j, 1, header%symmetric), header%n_rows
            call lines%next_value(matrix(i, j), error)
            if (allocated(error)) return
            if (header%symmetric) matrix(j, i) = matrix(i, j)
         end do
      end do
   end subroutine read_array

end module fw_matrix_market
