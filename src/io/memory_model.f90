!> A model that the calling program holds in arrays, put together part by part. The parts bear the
!> names of the datasets of a model file, and have their sizes.
!>
!> Each part is checked for its size as it comes, so that the call that is wrong is the one that is
!> told; what the values must be (finite, symmetric) is checked with those of files later.
module fw_memory_model
   use fw_contact_data, only: spring_type
   use fw_error, only: error_type, fatal_error, status_failure, status_input, status_usage
   use fw_kinds, only: i8, wp
   use fw_memory_sectors, only: check_memory_sectors, is_sector_part, put_sector_integers, &
      put_sector_reals
   use fw_model_file, only: file_model_type
   use fw_part_names, only: meant_part
   use fw_parts, only: is_of_kind, names_to_put, part_to_put, part_type
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: memory_model_type

   !> More dofs or pairs are taken for a mistake: the matrices are dense.
   integer, parameter :: most_dofs = 100000, most_pairs = 1000000

   !> A model in the making; `parts` has the shape of one that was read from a file.
   type :: memory_model_type
      !> Sizes that the parts must have.
      integer :: n_dof = 0
      integer :: n_pairs = 0
      type(file_model_type) :: parts
   contains
      procedure :: start
      generic :: put => put_reals, put_integers, put_texts
      procedure :: observe
      procedure :: observe_all
      procedure :: check
      procedure, private :: put_reals
      procedure, private :: put_integers
      procedure, private :: put_texts
   end type memory_model_type

contains

   !> Begin a model, forgetting every part that was given.
   subroutine start(self, n_dof, n_pairs, error)
      class(memory_model_type), intent(out) :: self
      integer, intent(in) :: n_dof, n_pairs
      type(error_type), allocatable, intent(out) :: error

      if (n_dof < 1 .or. n_dof > most_dofs) then
         call fatal_error(error, 'n_dof = '//to_text(n_dof)//': must be from 1 to '// &
                          to_text(most_dofs), status_input)
      else if (n_pairs < 0 .or. n_pairs > most_pairs) then
         call fatal_error(error, 'n_pairs = '//to_text(n_pairs)//': must be from 0 to '// &
                          to_text(most_pairs), status_input)
      else
         self%n_dof = n_dof
         self%n_pairs = n_pairs
      end if
   end subroutine start

   !> A real part, as a flat array: the matrices are symmetric, so that their order of storage
   !> makes no difference; contact/position is (3, n_pairs) with the coordinate innermost.
   subroutine put_reals(self, name, values, error)
      class(memory_model_type), intent(inout) :: self
      !> The name of a dataset, such as 'load/cosine'.
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      type(part_type) :: part
      integer :: rows, columns

      call look_up(name, 'real', part, error)
      if (allocated(error)) return
      if (is_sector_part(name)) then
         call put_sector_reals(name, values, self%n_dof, self%parts%cyclic, message)
         if (allocated(message)) call fatal_error(error, name//' '//message, status_input)
         return
      end if
      rows = self%n_dof
      columns = 1
      select case (part%shape)
      case ('dof dof')
         columns = self%n_dof
      case ('load dof')
         ! As many as there are harmonics, which may be given later.
         columns = size(values)/rows
      case ('one_or pair')
         rows = self%n_pairs
      case ('pair 3')
         rows = 3
         columns = self%n_pairs
      case ('one_or spring')
         ! Of any number: whether it fits the others is known when all are there.
         self%parts%springs%coefficient = values
         return
      case default ! 'dof'
         continue
      end select
      ! The product in 64 bits: n_dof**2 passes the range of 32.
      call check_size(name, size(values, kind=i8), rows, columns, error)
      if (allocated(error)) return
      associate (parts => self%parts)
         select case (name)
         case ('mass')
            call take_matrix(name, values, rows, parts%mass, error)
         case ('stiffness')
            call take_matrix(name, values, rows, parts%stiffness, error)
         case ('damping')
            call take_matrix(name, values, rows, parts%damping, error)
         case ('stiffness_rotation')
            call take_matrix(name, values, rows, parts%stiffness_rotation, error)
         case ('coriolis')
            ! Row after row, as in a file: the others are symmetric.
            parts%coriolis = transpose(reshape(values, [rows, rows]))
         case ('load/static')
            parts%load_static = values
         case ('load/cosine')
            parts%load_cosine = values
         case ('load/sine')
            parts%load_sine = values
         case ('load/static_rotation')
            parts%load_static_rotation = values
         case ('load/harmonic_cosine')
            parts%harmonic_cosine = reshape(values, [rows, columns])
         case ('load/harmonic_sine')
            parts%harmonic_sine = reshape(values, [rows, columns])
         case ('contact/mu')
            parts%mu = values
         case ('contact/gap')
            parts%gap = values
         case ('contact/area')
            parts%area = values
         case ('contact/normal_load')
            parts%normal_load = values
         case ('contact/position')
            parts%position = reshape(values, [3, self%n_pairs])
         case default
            ! Of a law.
            call parts%constants%offer(name(len('contact/') + 1:), values)
         end select
      end associate
   end subroutine put_reals

   !> An integer part: the signed dof numbers (t1, t2, n) of a side, pair after pair, or the
   !> harmonics of loads.
   subroutine put_integers(self, name, values, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message
      type(part_type) :: part

      call look_up(name, 'integer', part, error)
      if (allocated(error)) return
      if (is_sector_part(name)) then
         call put_sector_integers(name, values, self%n_pairs, self%parts%cyclic, message)
         if (allocated(message)) call fatal_error(error, name//' '//message, status_input)
         return
      else if (index(name, 'spring/') == 1) then
         call put_spring_integers(name, values, self%parts%springs)
         return
      end if
      if (name == 'load/harmonic') then
         if (any(values < 0)) then
            call fatal_error(error, name//' has '//to_text(minval(values))//': must be 0, 1, ..', &
                             status_input)
            return
         end if
         self%parts%load_harmonic = values
         return
      end if
      call check_size(name, size(values, kind=i8), 3, self%n_pairs, error)
      if (allocated(error)) return
      ! Component innermost, as in a file that h5py shows as (n_pairs, 3).
      if (name == 'contact/side_1') self%parts%side_1 = reshape(values, [3, self%n_pairs])
      if (name == 'contact/side_2') self%parts%side_2 = reshape(values, [3, self%n_pairs])
   end subroutine put_integers

   !> Dofs, sectors and powers of springs, whose number is checked when all are there.
   subroutine put_spring_integers(name, values, springs)
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      type(spring_type), intent(inout) :: springs

      if (name == 'spring/side_1') springs%side_1 = values
      if (name == 'spring/side_2') springs%side_2 = values
      if (name == 'spring/sector_2') springs%sector_2 = values
      if (name == 'spring/power') springs%power = values
   end subroutine put_spring_integers

   !> A text, or a list of them with one for each pair.
   subroutine put_texts(self, name, texts, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name
      type(string_type), intent(in) :: texts(:)
      type(error_type), allocatable, intent(out) :: error
      type(part_type) :: part

      call look_up(name, 'text', part, error)
      if (allocated(error)) return
      call check_size(name, size(texts, kind=i8), 1, merge(self%n_pairs, 1, &
                                                           name == 'contact/patch'), error)
      if (allocated(error)) return
      if (name == 'title') self%parts%title = texts(1)%text
      if (name == 'unit_system') self%parts%unit_system = texts(1)%text
      if (name == 'contact/patch') self%parts%patch = texts
   end subroutine put_texts

   !> Add an observed quantity: a linear combination of the dofs (n_dof).
   subroutine observe(self, name, row, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name
      real(wp), intent(in) :: row(:)
      type(error_type), allocatable, intent(out) :: error
      type(string_type) :: names(1)

      names(1)%text = name
      call self%observe_all(names, reshape(row, [size(row), 1]), error)
   end subroutine observe

   !> Add observed quantities, a column of factors each (n_dof, n_observed); no factors at all where
   !> the rows stand with the nodal diameters.
   subroutine observe_all(self, names, columns, error)
      class(memory_model_type), intent(inout) :: self
      type(string_type), intent(in) :: names(:)
      real(wp), intent(in) :: columns(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: rows(:, :)
      integer :: i, n

      ! All are checked before any is added.
      do i = 1, size(names)
         if (size(columns, 1) > 0) then
            call check_size(names(i)%text, size(columns, 1, kind=i8), self%n_dof, 1, error)
         end if
         if (.not. allocated(error) .and. len_trim(names(i)%text) == 0) then
            call fatal_error(error, 'the name of an observed quantity is empty', status_input)
         end if
         if (allocated(error)) return
      end do
      associate (parts => self%parts)
         if (.not. allocated(parts%observe_name)) allocate (parts%observe_name(0))
         n = size(parts%observe_name)
         if (n > 0 .and. size(names) > 0 .and. &
             (allocated(parts%observe_matrix) .neqv. size(columns, 1) > 0)) then
            call fatal_error(error, 'some observed quantities have factors and some none: must '// &
                             'be all or none', status_input)
            return
         end if
         do i = 1, size(names)
            call append(parts%observe_name, trim(names(i)%text))
         end do
         if (size(columns, 1) == 0) return
         if (.not. allocated(parts%observe_matrix)) allocate (parts%observe_matrix(0, self%n_dof))
         allocate (rows(n + size(names), self%n_dof))
         rows(:n, :) = parts%observe_matrix
         ! Stored by rows, as in a model file; the caller's factors stand in columns.
         rows(n + 1:, :) = transpose(columns)
         call move_alloc(rows, parts%observe_matrix)
      end associate
   end subroutine observe_all

   !> Refuse a model that lacks what every one needs.
   subroutine check(self, error)
      class(memory_model_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: message, missing
      integer :: n_names

      missing = ''
      associate (parts => self%parts)
         n_names = 0
         if (allocated(parts%observe_name)) n_names = size(parts%observe_name)
         call check_memory_sectors(self%n_dof, n_names, allocated(parts%observe_matrix), &
                                   allocated(parts%mass) .or. allocated(parts%stiffness), &
                                   parts%cyclic, message)
         if (allocated(message)) then
            call fatal_error(error, message, status_input)
            return
         end if
         if (.not. allocated(parts%cyclic%nodal)) then
            if (.not. allocated(parts%mass)) missing = 'mass'
            if (.not. allocated(parts%stiffness)) missing = 'stiffness'
         end if
      end associate
      if (self%n_pairs > 0 .and. .not. allocated(self%parts%side_1)) missing = 'contact/side_1'
      if (len(missing) > 0) then
         call fatal_error(error, 'the model in memory lacks '//missing, status_input)
      else if (self%n_pairs > 0 .and. .not. allocated(self%parts%side_2)) then
         ! Everything against the ground.
         allocate (self%parts%side_2(3, self%n_pairs), source=0)
      end if
      if (.not. allocated(error)) call check_waves(self%parts, error)
      if (.not. allocated(error)) call count_springs(self%parts%springs, error)
   end subroutine check

   !> As many springs as have a side 1; every other part is of these, or is not given.
   subroutine count_springs(springs, error)
      type(spring_type), intent(inout) :: springs
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = 0
      if (allocated(springs%side_1)) n = size(springs%side_1)
      if (allocated(springs%coefficient)) then
         call check_size('spring/coefficient', size(springs%coefficient, kind=i8), n, 1, error)
      else if (n > 0) then
         call fatal_error(error, 'the model in memory lacks spring/coefficient', status_input)
      end if
      if (.not. allocated(error)) call check_one('spring/side_2', springs%side_2)
      if (.not. allocated(error)) call check_one('spring/sector_2', springs%sector_2)
      if (.not. allocated(error)) call check_one('spring/power', springs%power)
      if (.not. allocated(error)) springs%n_springs = n

   contains

      subroutine check_one(name, values)
         character(*), intent(in) :: name
         integer, allocatable, intent(in) :: values(:)

         if (allocated(values)) call check_size(name, size(values, kind=i8), n, 1, error)
      end subroutine check_one

   end subroutine count_springs

   !> Loads of harmonics have one column for each of these.
   subroutine check_waves(parts, error)
      type(file_model_type), intent(in) :: parts
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = 0
      if (allocated(parts%load_harmonic)) n = size(parts%load_harmonic)
      call check_one('load/harmonic_cosine', parts%harmonic_cosine)
      if (.not. allocated(error)) call check_one('load/harmonic_sine', parts%harmonic_sine)

   contains

      subroutine check_one(name, columns)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(in) :: columns(:, :)

         if (.not. allocated(columns)) return
         if (size(columns, 2) == n) return
         call fatal_error(error, name//' has loads of '//to_text(size(columns, 2))// &
                          ' harmonics: must be '//to_text(n)//', as many as load/harmonic', &
                          status_input)
      end subroutine check_one

   end subroutine check_waves

   !> Column by column, since reshape would copy the whole once more; n_dof**2 values were checked.
   subroutine take_matrix(name, values, order, matrix, error)
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: order
      real(wp), allocatable, intent(inout) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: j, status

      if (allocated(matrix)) deallocate (matrix)
      allocate (matrix(order, order), stat=status)
      if (status /= 0) then
         call fatal_error(error, name//': no memory for a matrix of order '//to_text(order), &
                          status_failure)
         return
      end if
      do j = 1, order
         matrix(:, j) = values((j - 1_i8)*order + 1:j*int(order, i8))
      end do
   end subroutine take_matrix

   !> Refuse another number of values than the part has.
   subroutine check_size(name, n_given, rows, columns, error)
      character(*), intent(in) :: name
      integer(i8), intent(in) :: n_given
      integer, intent(in) :: rows, columns
      type(error_type), allocatable, intent(out) :: error
      character(20) :: given, expected

      if (n_given == int(rows, i8)*columns) return
      write (given, '(i0)') n_given
      write (expected, '(i0)') int(rows, i8)*columns
      call fatal_error(error, name//' has '//trim(given)//' values: must be '//trim(expected), &
                       status_input)
   end subroutine check_size

   !> The row of the table for a name; an error that says which names there are.
   subroutine look_up(name, kind, part, error)
      character(*), intent(in) :: name, kind
      type(part_type), intent(out) :: part
      type(error_type), allocatable, intent(out) :: error

      ! Functions of texts serve one thread at a time.
      !$omp critical (fretwear_io)
      part = part_to_put(name)
      if (.not. is_of_kind(part, kind)) then
         call fatal_error(error, "'"//name//"' is no "//kind//' part of a model: must be one '// &
                          'of '//names_to_put(kind)//meant_part(name), status_usage)
      end if
      !$omp end critical (fretwear_io)
   end subroutine look_up

end module fw_memory_model
