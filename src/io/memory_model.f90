!> A model that the calling program holds in arrays, put together part by part. The parts bear the
!> names of the datasets of a model file, and have their sizes.
!>
!> Each part is checked for its size as it comes, so that the call that is wrong is the one that is
!> told; what the values must be (finite, symmetric) is checked with those of files later.
module fw_memory_model
   use fw_contact_data, only: spring_type
   use fw_cyclic_parts, only: check_physical, check_rows, cyclic_parts, finish_influence
   use fw_error, only: error_type, fatal_error, status_input, status_usage
   use fw_kinds, only: i8, wp
   use fw_part_names, only: meant_part
   use fw_part_values, only: value_source
   use fw_parts, only: keys_of_laws, names_to_put
   use fw_raw_model, only: raw_model
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
      type(raw_model) :: parts
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

   !> A real part, as a flat array, row after row; symmetric matrices may stand in either order,
   !> contact/position is (3, n_pairs) with the coordinate innermost.
   subroutine put_reals(self, name, values, error)
      class(memory_model_type), intent(inout) :: self
      !> The name of a dataset, such as 'load/cosine'.
      character(*), intent(in) :: name
      real(wp), intent(in), target, contiguous :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(value_source) :: source
      character(:), allocatable :: message
      integer :: k

      source%reals => values
      call take(self, name, 'real', size(values, kind=i8), source, error)
      if (allocated(error) .or. .not. allocated(self%parts%cyclic%nodal)) return
      self%parts%cyclic%n_physical = self%n_dof
      do k = 1, size(self%parts%cyclic%nodal)
         associate (nodal => self%parts%cyclic%nodal(k))
            if (.not. allocated(nodal%mass)) cycle
            call check_physical(self%n_dof, size(nodal%mass, 1), 'this matrix', message)
            if (.not. allocated(message)) cycle
            deallocate (nodal%mass)
            call fatal_error(error, name//' does not fit n_dof, which '//message, status_input)
            return
         end associate
      end do
   end subroutine put_reals

   !> An integer part, in the order of a file: the signed dof numbers (t1, t2, n) of a side, pair
   !> after pair.
   subroutine put_integers(self, name, values, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(value_source) :: source
      integer :: before

      source%integers = values
      associate (parts => self%parts%cyclic)
         before = parts%n_sectors
         call take(self, name, 'integer', size(values, kind=i8), source, error)
         if (allocated(error) .or. name /= 'cyclic/n_sectors') return
         if (parts%n_sectors < 1) then
            call fatal_error(error, name//' is '//to_text(parts%n_sectors)//': must be at '// &
                             'least 1', status_input)
         else if (allocated(parts%nodal) .or. allocated(parts%air)) then
            call fatal_error(error, name//' comes after nodal diameters or forces of the air: '// &
                             'put it before them', status_input)
         end if
         if (allocated(error)) parts%n_sectors = before
      end associate
   end subroutine put_integers

   !> A text, or a list of them with one for each pair.
   subroutine put_texts(self, name, texts, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name
      type(string_type), intent(in) :: texts(:)
      type(error_type), allocatable, intent(out) :: error
      type(value_source) :: source

      source%texts = texts
      call take(self, name, 'text', size(texts, kind=i8), source, error)
   end subroutine put_texts

   !> Put the values of a source into the part of that name; an error where it has none of that
   !> kind, with the names that there are.
   subroutine take(self, name, kind, n_values, source, error)
      class(memory_model_type), intent(inout) :: self
      character(*), intent(in) :: name, kind
      integer(i8), intent(in) :: n_values
      type(value_source), intent(inout) :: source
      type(error_type), allocatable, intent(out) :: error

      logical :: had_diameters

      had_diameters = allocated(self%parts%cyclic%nodal)
      source%name = name
      source%kind = kind
      source%n_values = n_values
      source%stands_by_rows = .false.
      ! Functions of texts serve one thread at a time.
      !$omp critical (fretwear_io)
      source%constants = keys_of_laws()
      call source%set_extent('dof', self%n_dof)
      call source%set_extent('pair', self%n_pairs)
      call self%parts%bind_parts(source)
      call move_alloc(source%error, error)
      if (.not. (source%is_taken .or. allocated(error))) then
         ! The name may have begun as that of a nodal diameter.
         if (allocated(self%parts%cyclic%nodal) .and. .not. had_diameters) then
            deallocate (self%parts%cyclic%nodal)
         end if
         call fatal_error(error, "'"//name//"' is no "//kind//' part of a model: must be one '// &
                          'of '//names_to_put(kind, name)//meant_part(name), &
                          status_usage)
      end if
      !$omp end critical (fretwear_io)
   end subroutine take

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
         call check_sectors(self%n_dof, n_names, allocated(parts%observe_matrix), &
                            allocated(parts%mass) .or. allocated(parts%stiffness), parts%cyclic, &
                            message)
         if (allocated(message)) then
            call fatal_error(error, message, status_input)
            return
         end if
         if (.not. allocated(parts%cyclic%nodal)) then
            if (.not. allocated(parts%mass)) missing = 'mass'
            if (.not. (allocated(parts%stiffness) .or. allocated(parts%speeds%at))) then
               missing = 'stiffness'
            end if
         end if
      end associate
      associate (contact => self%parts%contact)
         if (self%n_pairs > 0 .and. .not. allocated(contact%side_1)) missing = 'contact/side_1'
         if (len(missing) > 0) then
            call fatal_error(error, 'the model in memory lacks '//missing, status_input)
         else if (self%n_pairs > 0 .and. .not. allocated(contact%side_2)) then
            ! Everything against the ground.
            allocate (contact%side_2(3, self%n_pairs), source=0)
         end if
      end associate
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
      type(raw_model), intent(in) :: parts
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

   !> What the parts must be to each other once all are there.
   subroutine check_sectors(n_dof, n_names, has_rows, has_sector, parts, message)
      integer, intent(in) :: n_dof
      !> Observed quantities; rows of the displacements go with them.
      integer, intent(in) :: n_names
      logical, intent(in) :: has_rows
      !> Whether there are matrices of a sector.
      logical, intent(in) :: has_sector
      type(cyclic_parts), intent(inout) :: parts
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      integer :: n_left, n_right

      n_left = 0
      n_right = 0
      if (allocated(parts%left)) n_left = size(parts%left)
      if (allocated(parts%right)) n_right = size(parts%right)
      if (n_left /= n_right) then
         message = 'cyclic/left and cyclic/right have '//to_text(n_left)//' and '// &
                   to_text(n_right)//' dofs: must be as many'
         return
      end if
      if (allocated(parts%nodal)) then
         call check_diameters(n_names, has_rows, has_sector, parts, message)
      else if (n_names > 0 .and. .not. has_rows) then
         message = 'observed quantities have names and no rows: give n_dof factors for each'
      end if
      if (allocated(message) .or. .not. allocated(parts%air)) return
      if (.not. allocated(parts%air%number)) then
         message = 'aero/modes comes without aero/sector/M or aero/nodal_diameter/M'
         return
      end if
      call finish_influence(parts%air, n_dof, message)
      if (allocated(message)) message = 'matrices of the air '//message
   end subroutine check_sectors

   subroutine check_diameters(n_names, has_rows, has_sector, parts, message)
      integer, intent(in) :: n_names
      logical, intent(in) :: has_rows, has_sector
      type(cyclic_parts), intent(in) :: parts
      character(:), allocatable, intent(out) :: message
      logical :: has_own
      integer :: k

      if (has_sector) then
         message = 'mass or stiffness stands beside matrices of nodal diameters: must be one '// &
                   'of both'
         return
      end if
      has_own = .false.
      do k = 0, size(parts%nodal) - 1
         has_own = has_own .or. allocated(parts%nodal(k + 1)%observe)
         if (.not. allocated(parts%nodal(k + 1)%mass)) cycle
         if (allocated(parts%nodal(k + 1)%stiffness)) cycle
         message = 'the model in memory lacks '//'nodal_diameter/'//to_text(k)//'/stiffness'
         return
      end do
      if (has_own .and. has_rows) then
         message = 'rows of observed quantities stand with the nodal diameters: give their '// &
                   'names without factors'
      else if (n_names > 0 .and. .not. has_rows) then
         call check_rows(parts, n_names, k)
         if (k >= 0) message = 'nodal_diameter/'//to_text(k)//'/observe/matrix must have a row '// &
                               'for each of the '//to_text(n_names)//' observed quantities'
      else if (has_own) then
         message = 'rows of nodal diameters observe quantities without names: give these, '// &
                   'without factors'
      end if
   end subroutine check_diameters

end module fw_memory_model
