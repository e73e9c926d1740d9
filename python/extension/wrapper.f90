!> Sessions for the Python module fretwear._core, which f2py makes of this file and functions.f90:
!> plain arguments, no copies of Fortran-ordered arrays, the interpreter lock released.
!> python/fretwear/ checks arguments; texts are arrays of bytes, lists of texts have null bytes
!> between them.
module fw_python
   use fw_error, only: error_type, status_ok
   use fw_kinds, only: i8, wp
   use fw_model_file, only: list_unread
   use fw_python_parts, only: case_part, namelist_words, quantity_lines
   use fw_python_session, only: handle_of, handle_type, new_handle
   use fw_text, only: join, string_type
   use fw_version, only: version
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   public :: open_session, close_session, library_version
   public :: new_model, put_reals, put_integers, put_texts, observe, add_law
   public :: give_case, prepare, check_case, run_case, run_piece, copy_session
   public :: start, solve, count_frequencies, frequencies
   public :: count_values, get_values, count_bytes, get_bytes, parse_namelist, unread_parts

contains

   subroutine library_version(text)
      character(16), intent(out) :: text

      text = version
   end subroutine library_version

   subroutine open_session(number)
      integer(i8), intent(out) :: number

      number = new_handle()
   end subroutine open_session

   !> A session with the case of another one, as it was read.
   subroutine copy_session(other, number)
      integer(i8), intent(in) :: other
      integer(i8), intent(out) :: number
      type(handle_type), pointer :: handle, source

      number = new_handle()
      handle => handle_of(number)
      source => handle_of(other)
      call handle%session%copy(source%session)
   end subroutine copy_session

   subroutine close_session(number)
      integer(i8), intent(in) :: number
      type(handle_type), pointer :: handle

      handle => handle_of(number)
      deallocate (handle)
   end subroutine close_session

   !> Begin a model in memory, with its parts to follow.
   subroutine new_model(number, n_dof, n_pairs, status)
      integer(i8), intent(in) :: number
      integer, intent(in) :: n_dof, n_pairs
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      handle => handle_of(number)
      call handle%session%new_model(n_dof, n_pairs, error)
      call handle%conclude(error, status)
   end subroutine new_model

   !> A real part of the model by the name of its dataset in a model file, flattened.
   subroutine put_reals(number, name, n, values, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      !f2py threadsafe

      handle => handle_of(number)
      call handle%session%put(name, values, error)
      call handle%conclude(error, status)
   end subroutine put_reals

   !> Signed dof numbers of a side of the pairs, flattened.
   subroutine put_integers(number, name, n, values, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer, intent(in) :: n
      integer, intent(in) :: values(n)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      handle => handle_of(number)
      call handle%session%put(name, values, error)
      call handle%conclude(error, status)
   end subroutine put_integers

   !> 'title', 'unit_system' or 'contact/patch'.
   subroutine put_texts(number, name, n, texts, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer, intent(in) :: n
      integer(1), intent(in) :: texts(n)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      handle => handle_of(number)
      call handle%session%put(name, list_of(texts), error)
      call handle%conclude(error, status)
   end subroutine put_texts

   !> An element with a law of its own, by the address of its function, of a step where there are
   !> states; `flags` as in fretwear.h.
   subroutine add_law(number, name, n_in, side_1, side_2, n_parameters, parameters, n_state, &
                      start, flags, address, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer, intent(in) :: n_in, n_parameters, n_state, flags
      integer, intent(in) :: side_1(n_in), side_2(n_in)
      real(wp), intent(in) :: parameters(n_parameters), start(n_state)
      integer(i8), intent(in) :: address
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      type(user_element) :: element

      handle => handle_of(number)
      element%name = name
      element%n_in = n_in
      element%side_1 = side_1
      element%side_2 = side_2
      element%parameters = parameters
      element%n_state = n_state
      element%start = start
      element%is_odd = btest(flags, 0)
      element%has_derivative = .not. btest(flags, 2)
      element%function = transfer(address, element%function)
      call handle%session%add_element(element)
      call handle%conclude(error, status)
   end subroutine add_law

   !> Observed quantities: names, and a column of factors of the dofs each.
   subroutine observe(number, n, names, n_dof, n_observed, columns, status)
      integer(i8), intent(in) :: number
      integer, intent(in) :: n, n_dof, n_observed
      integer(1), intent(in) :: names(n)
      real(wp), intent(in) :: columns(n_dof, n_observed)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      handle => handle_of(number)
      call handle%session%observe_all(list_of(names), columns, error)
      call handle%conclude(error, status)
   end subroutine observe

   !> Take namelist text, and set keys on top of it: a key, then its value, and so on.
   subroutine give_case(number, n_text, text, n_path, path, n_keys, keys, status)
      integer(i8), intent(in) :: number
      integer, intent(in) :: n_text, n_path, n_keys
      integer(1), intent(in) :: text(n_text), path(n_path), keys(n_keys)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      type(string_type), allocatable :: words(:)
      integer :: i

      handle => handle_of(number)
      call handle%session%load_text(from_bytes(text), from_bytes(path))
      words = list_of(keys)
      do i = 1, size(words) - 1, 2
         if (.not. allocated(error)) then
            call handle%session%set(words(i)%text, words(i + 1)%text, error)
         end if
      end do
      call handle%conclude(error, status)
   end subroutine give_case

   !> Read and validate the case; the status is that of fw_run.
   subroutine prepare(number, status)
      integer(i8), intent(in) :: number
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      !f2py threadsafe

      handle => handle_of(number)
      call handle%session%prepare(error)
      call handle%conclude(error, status)
   end subroutine prepare

   subroutine check_case(number, status)
      integer(i8), intent(in) :: number
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      !f2py threadsafe

      handle => handle_of(number)
      call handle%session%check(error)
      call handle%conclude(error, status)
   end subroutine check_case

   !> Run the case. Another thread may set control(1) to stop the run, and read how many points
   !> are done in control(2), of control(3); of the last one, as the bits of a real, the frequency
   !> [rad/s] in control(4), the largest amplitude, cycles and depth of wear (-1: not known). A
   !> sweep ends after control(8) points, where that is set.
   subroutine run_case(number, control, in_memory, status)
      integer(i8), intent(in) :: number
      integer(i8), intent(inout) :: control(8)
      integer, intent(in) :: in_memory
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      !f2py threadsafe

      handle => handle_of(number)
      call handle%run(control, in_memory /= 0, status)
   end subroutine run_case

   !> Run a piece of a sweep in memory: first and last point, points on the way to it, and the last
   !> point that this session has solved, which it goes on from (0: none).
   subroutine run_piece(number, piece, control, status)
      integer(i8), intent(in) :: number
      integer, intent(in) :: piece(4)
      integer(i8), intent(inout) :: control(8)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      !f2py threadsafe

      handle => handle_of(number)
      call handle%run(control, .true., status, piece)
   end subroutine run_piece

   !> Prepare for steps from frequency to frequency.
   subroutine start(number, status)
      integer(i8), intent(in) :: number
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      !f2py threadsafe

      handle => handle_of(number)
      call handle%session%start(error)
      call handle%conclude(error, status)
   end subroutine start

   !> One step; see run_case for `control`.
   subroutine solve(number, omega, control, status)
      integer(i8), intent(in) :: number
      real(wp), intent(in) :: omega
      integer(i8), intent(inout) :: control(8)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      !f2py threadsafe

      handle => handle_of(number)
      call handle%solve(omega, control, status)
   end subroutine solve

   subroutine count_frequencies(number, n)
      integer(i8), intent(in) :: number
      integer, intent(out) :: n
      type(handle_type), pointer :: handle

      handle => handle_of(number)
      n = handle%session%n_frequencies()
   end subroutine count_frequencies

   !> The frequencies of the sweep [rad/s], to the bit those that a run takes.
   subroutine frequencies(number, n, omega, status)
      integer(i8), intent(in) :: number
      integer, intent(in) :: n
      real(wp), intent(inout) :: omega(n)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      integer :: k

      handle => handle_of(number)
      do k = 1, n
         if (.not. allocated(error)) call handle%session%frequency(k, omega(k), error)
      end do
      call handle%conclude(error, status)
   end subroutine frequencies

   !> How many numbers `get_values` gives.
   subroutine count_values(number, what, name, n, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: what, name
      integer, intent(out) :: n, status
      real(wp), allocatable :: values(:)

      call find_values(number, what, name, values, status)
      n = size(values)
   end subroutine count_values

   !> Numbers, the last index running fastest: 'point': of the last step, by the name of the
   !> dataset in a result file; 'case': of the effective case, see fw_python_parts.
   subroutine get_values(number, what, name, n, values, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: what, name
      integer, intent(in) :: n
      real(wp), intent(inout) :: values(n)
      integer, intent(out) :: status
      real(wp), allocatable :: found(:)

      call find_values(number, what, name, found, status)
      values = found(:n)
   end subroutine get_values

   subroutine find_values(number, what, name, values, status)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: what, name
      real(wp), allocatable, intent(out) :: values(:)
      integer, intent(out) :: status
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      handle => handle_of(number)
      if (what == 'point') then
         call handle%session%get(name, 0, values, error)
      else
         call case_part(handle%session%case, name, values, error)
      end if
      if (.not. allocated(values)) allocate (values(0))
      call handle%conclude(error, status)
   end subroutine find_values

   !> Bytes of a text or of the result in memory; -1 where there is no such name.
   subroutine count_bytes(number, name, n)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer(i8), intent(out) :: n
      integer(1), allocatable :: bytes(:)
      logical :: found

      call find_bytes(number, name, bytes, found)
      n = -1_i8
      if (found) n = size(bytes, kind=i8)
   end subroutine count_bytes

   subroutine get_bytes(number, name, n, bytes)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer(i8), intent(in) :: n
      integer(1), intent(inout) :: bytes(n)
      integer(1), allocatable :: found(:)
      logical :: is_known

      call find_bytes(number, name, found, is_known)
      if (is_known) bytes = found(:n)
   end subroutine get_bytes

   !> 'message', 'summary', 'remarks', 'image' (the result file), or of the case that was read
   !> 'namelist', 'output' (path of its result file), 'inputs' (paths of the files that were
   !> read), 'observed' (names) or 'quantities'.
   subroutine find_bytes(number, name, bytes, found)
      integer(i8), intent(in) :: number
      character(*), intent(in) :: name
      integer(1), allocatable, intent(out) :: bytes(:)
      logical, intent(out) :: found
      type(handle_type), pointer :: handle
      character(:), allocatable :: text

      handle => handle_of(number)
      found = .true.
      text = ''
      associate (case => handle%session%case)
         select case (name)
         case ('message')
            text = handle%message
         case ('summary')
            text = handle%summary
         case ('remarks')
            text = handle%remarks
         case ('namelist')
            if (allocated(case%namelist)) text = case%namelist
         case ('output')
            if (allocated(case%output%file)) text = case%output%file
         case ('observed')
            if (allocated(case%model%observe_name)) then
               text = join(case%model%observe_name, new_line('a'))
            end if
         case ('inputs')
            if (allocated(case%inputs)) text = join(case%inputs, new_line('a'))
         case ('quantities')
            call quantity_lines(case, text)
         case ('image')
            if (allocated(handle%image)) bytes = handle%image
         case default
            found = .false.
         end select
      end associate
      if (.not. allocated(bytes)) bytes = transfer(text, 0_1, len(text))
   end subroutine find_bytes

   !> The keys of a namelist, see namelist_words, with a null byte after each word; the message
   !> where it is none. Called twice: for the number of bytes, then for them.
   subroutine parse_namelist(n_text, text, n, bytes, n_found, status)
      integer, intent(in) :: n_text, n
      integer(1), intent(in) :: text(n_text)
      integer(1), intent(inout) :: bytes(n)
      integer(i8), intent(out) :: n_found
      integer, intent(out) :: status
      type(string_type), allocatable :: words(:)
      type(error_type), allocatable :: error

      call namelist_words(from_bytes(text), words, error)
      call answer(words, error, bytes, n_found, status)
   end subroutine parse_namelist

   !> What stands in a model file and nothing reads, as parse_namelist gives its words; refused as
   !> a run refuses it.
   subroutine unread_parts(n_path, path, n, bytes, n_found, status)
      integer, intent(in) :: n_path, n
      integer(1), intent(in) :: path(n_path)
      integer(1), intent(inout) :: bytes(n)
      integer(i8), intent(out) :: n_found
      integer, intent(out) :: status
      type(string_type), allocatable :: words(:)
      type(error_type), allocatable :: error

      call list_unread(from_bytes(path), words, error)
      call answer(words, error, bytes, n_found, status)
   end subroutine unread_parts

   !> Words with null bytes behind them as far as there is room, or the message of an error.
   subroutine answer(words, error, bytes, n_found, status)
      type(string_type), allocatable, intent(inout) :: words(:)
      type(error_type), allocatable, intent(in) :: error
      integer(1), intent(inout) :: bytes(:)
      integer(i8), intent(out) :: n_found
      integer, intent(out) :: status
      integer(i8) :: first
      integer :: i

      status = status_ok
      if (allocated(error)) then
         status = error%status
         if (allocated(words)) deallocate (words)
         allocate (words(1))
         words(1)%text = error%message
      end if
      n_found = 0_i8
      do i = 1, size(words)
         first = n_found + 1_i8
         n_found = n_found + len(words(i)%text, kind=i8) + 1_i8
         if (n_found <= size(bytes)) bytes(first:n_found) = &
            transfer(words(i)%text//char(0), 0_1, len(words(i)%text) + 1)
      end do
   end subroutine answer

   pure function from_bytes(bytes) result(text)
      integer(1), intent(in) :: bytes(:)
      character(size(bytes)) :: text

      text = transfer(bytes, text)
   end function from_bytes

   !> The texts between null bytes; every text ends in one.
   pure function list_of(bytes) result(list)
      integer(1), intent(in) :: bytes(:)
      type(string_type), allocatable :: list(:)
      integer :: first, i, last

      allocate (list(count(bytes == 0_1)))
      first = 1
      do i = 1, size(list)
         last = first + findloc(bytes(first:), 0_1, dim=1) - 2
         list(i)%text = from_bytes(bytes(first:last))
         first = last + 2
      end do
   end function list_of

end module fw_python
