!> Group &user: elements with laws of a user, by functions of a shared library; and those that a
!> calling program adds, which have no keys.
!>
!> The keys tell the functions apart by the name of the symbol; all elements of the group come from
!> one library and have as many inputs and constants each. Elements of a program have sides, inputs
!> and constants of their own (`take_laws`), so that rows are filled from the elements and not from
!> the keys. A model file holds none of this: a function is no number.
module fw_user_group
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_int, c_ptr
   use fw_element_group, only: element_group, group_name_length
   use fw_error, only: error_type, fatal_error, status_io, status_input
   use fw_force_law, only: force_law
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, side_numbers, from_to
   use fw_kinds, only: wp
   use fw_shared_library, only: find_address, find_function, open_library, why_not
   use fw_text, only: string_type, to_text
   use fw_user_element, only: user_element
   use fw_user_law, only: new_user_law
   implicit none (type, external)
   private

   public :: user_group

   !> Whose slopes Newton's method takes: those of the functions, or central differences.
   character(*), parameter :: derivative_words(*) = [character(10) :: 'given', 'difference']
   integer, parameter :: given = 1
   !> The number of the interface of fretwear.h that a library has to have.
   integer, parameter :: interface_number = 1
   !> Limits of the keys: far above any use, low enough that a mistyped number asks for no memory.
   integer, parameter :: most = 100000, most_inputs = 100, most_states = 1000

   type, extends(element_group) :: user_group
      !> As it stands in the namelist; `load` looks for it beside the namelist.
      character(:), allocatable :: library
      !> Names of the functions: one for all elements, or one for each.
      type(string_type), allocatable :: symbol(:)
      !> Of each element: inputs and constants. `n_in` of the parent is that of the widest element,
      !> and may be larger than `inputs` once a program has added laws of its own.
      integer :: inputs = 1, n_parameters = 0, derivative = given
      !> (n_in, n_elements), and (n_parameters, n_elements).
      integer, allocatable :: side_1(:, :), side_2(:, :)
      real(wp), allocatable :: parameters(:, :)
      !> What is promised of all functions of the library.
      logical :: odd = .false., thread_safe = .false.
   contains
      procedure :: name
      procedure :: count_key
      procedure :: bind_count
      procedure :: bind_keys
      procedure :: n_held
      procedure :: find_fault
      procedure :: is_in_models
      procedure :: load
      procedure :: take_laws
      procedure :: settle
      procedure :: make_law
      procedure :: is_odd
      procedure :: is_linear
   end type user_group

contains

   !> Of the namelist; no group of a model file has it.
   pure function name(self)
      class(user_group), intent(in) :: self
      character(group_name_length) :: name

      name = 'user'
      associate (unused => self)
      end associate
   end function name

   !> The key that `n_given` is read from.
   pure function count_key(self)
      class(user_group), intent(in) :: self
      character(group_name_length) :: count_key

      count_key = 'n_elements'
      associate (unused => self)
      end associate
   end function count_key

   !> The number goes first: the shapes of the other keys are made of it.
   subroutine bind_count(self, keys)
      class(user_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('user', 'elements with laws of your own')
      call keys%bind(key('n_elements', 'number of elements', from_to(0, most)), self%n_given)
      call keys%set_size('n_elements', self%n_given)
   end subroutine bind_count

   !> Extents are set as soon as they are read, since the arrays that follow have them. What is only
   !> needed with elements is required where there are some, so that an empty group says nothing.
   subroutine bind_keys(self, keys)
      class(user_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      logical, allocatable :: is_text(:)
      logical :: needed

      needed = self%n_given > 0
      call keys%bind(key('library', 'with the functions, relative to the namelist', &
                         absent='required with n_elements'), self%library, needed)
      call keys%bind_list(key('symbol', 'function of all elements, or of each', &
                              absent='required with n_elements'), 'names of functions', most, &
                          self%symbol, is_text)
      call keys%bind(key('n_in', 'displacements of each element', from_to(1, most_inputs)), &
                     self%inputs)
      call keys%set_size('n_in', self%inputs)
      call keys%bind(key('side_1', 'dofs of its inputs', side_numbers(), &
                         shape='n_in x n_elements', repeats=.false., &
                         absent='required with n_elements'), self%side_1, needed)
      call keys%bind(key('side_2', 'dofs on the other side, 0: ground', side_numbers(), &
                         shape='n_in x n_elements', repeats=.false.), self%side_2, default=0)
      call keys%bind(key('n_parameters', 'constants of each function', from_to(0, most)), &
                     self%n_parameters)
      call keys%set_size('n_par', self%n_parameters)
      call keys%bind(key('parameters', 'n_par = n_parameters of each element', &
                         shape='n_par x n_elements', repeats=.false., &
                         absent='required with n_parameters'), self%parameters, &
                     needed .and. self%n_parameters > 0)
      call keys%bind_word(key('derivative', &
                              'functions give slopes, or differences stand for them'), &
                          self%derivative, derivative_words)
      call keys%bind(key('odd', 'you promise that opposite motions have opposite forces'), self%odd)
      call keys%bind(key('thread_safe', 'functions may be called from several threads'), &
                     self%thread_safe)
      call keys%bind(key('check', 'try functions before the run: slopes, symmetry, memory'), &
                     self%check)
      call keys%bind(key('check_tolerance', 'of slopes and odd forces, relative', above(0.0_wp), &
                         only='check'), self%check_tolerance)
   end subroutine bind_keys

   !> Nothing of it stands in a model file.
   pure integer function n_held(self)
      class(user_group), intent(in) :: self

      n_held = 0
      associate (unused => self)
      end associate
   end function n_held

   !> A file that held the sides without the functions would be half a model.
   pure logical function is_in_models(self)
      class(user_group), intent(in) :: self

      is_in_models = .false.
      associate (unused => self)
      end associate
   end function is_in_models

   !> What the ranges of the keys do not say: as many symbols as elements, and two sides of an input
   !> that differ. One that has the same dof on both sides moves by nothing whatever the structure
   !> does, and is a misprint.
   pure subroutine find_fault(self, key, text)
      class(user_group), intent(in) :: self
      character(24), intent(out) :: key
      character(160), intent(out) :: text
      integer :: i, n

      key = ''
      text = ''
      n = 0
      if (allocated(self%symbol)) n = size(self%symbol)
      if (n /= 1 .and. n /= self%n_given) then
         key = 'symbol'
         text = 'has '//to_text(n)//' names: must be one for all, or one for each of '// &
                'n_elements = '//to_text(self%n_given)
         return
      end if
      do i = 1, self%n_given
         if (.not. any(abs(self%side_1(:, i)) == abs(self%side_2(:, i)))) cycle
         key = 'side_1'
         text = 'and side_2: element '//to_text(i)//' has the same dof, or the ground, on both '// &
                'sides of an input: they must differ'
         return
      end do
   end subroutine find_fault

   !> Open the library and find the functions.
   !> It is opened when the case is read, so that what is missing is told before any work is done,
   !> and never closed (see `open_library`). A library that is not found is a fault of a file
   !> (status 5), one without the function a fault of the input (status 3).
   subroutine load(self, folder, error)
      class(user_group), intent(inout) :: self
      !> Of the namelist; empty where the case came as a text.
      character(*), intent(in) :: folder
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: path
      character(200) :: reason
      type(c_ptr) :: library
      integer :: i

      if (allocated(self%function)) deallocate (self%function)
      allocate (self%function(self%n_given))
      if (self%n_given == 0) return
      path = self%library
      if (path(:1) /= '/' .and. len(folder) > 0) path = folder//'/'//path
      ! Names without a folder are looked for among the libraries of the system.
      if (index(path, '/') == 0) path = './'//path
      if (.not. open_library(path, library)) then
         call why_not(reason)
         call fatal_error(error, '&user library: '//trim(reason)//'; name a shared library, '// &
                          'made as in docs/user_laws.md', status_io)
         return
      end if
      call check_interface(self%library, library, error)
      do i = 1, self%n_given
         if (.not. allocated(error)) call find_element(self, library, i, error)
      end do
   end subroutine load

   !> Whether the library was made for this program.
   !> A number that the library exports stands for the layout of `fw_law_call` that it was built
   !> with: a function that read another layout would give wrong forces without a word.
   subroutine check_interface(path, library, error)
      !> As it is named in the namelist, for the messages.
      character(*), intent(in) :: path
      type(c_ptr), intent(in) :: library
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: address
      integer(c_int), pointer :: number

      address = find_address(library, 'fw_law_interface')
      if (.not. c_associated(address)) then
         call fatal_error(error, "&user library = '"//path//"': has no fw_law_interface; add "// &
                          '`const int fw_law_interface = 1;`', status_input)
         return
      end if
      call c_f_pointer(address, number)
      if (number == interface_number) return
      call fatal_error(error, "&user library = '"//path//"': fw_law_interface is "// &
                       to_text(int(number))//': must be 1; build it with the header of this '// &
                       'version', status_input)
   end subroutine check_interface

   !> Element i with what the keys say of it, and its function. Whether it remembers is not said by
   !> a key: the library says so by exporting the number of states beside the function, so that a
   !> step cannot be called as a force, nor the other way round.
   subroutine find_element(self, library, i, error)
      class(user_group), intent(inout) :: self
      type(c_ptr), intent(in) :: library
      integer, intent(in) :: i
      type(error_type), allocatable, intent(out) :: error

      associate (element => self%function(i), symbol => self%symbol(min(i, size(self%symbol)))%text)
         element%name = symbol
         element%n_in = self%inputs
         element%side_1 = self%side_1(:, i)
         element%side_2 = self%side_2(:, i)
         allocate (element%parameters(self%n_parameters))
         if (self%n_parameters > 0) element%parameters = self%parameters(:, i)
         element%is_odd = self%odd
         element%is_thread_safe = self%thread_safe
         element%has_derivative = self%derivative == given
         call find_states(library, symbol, element, error)
         if (allocated(error)) return
         element%function = find_function(library, symbol)
         if (c_associated(element%function)) return
         call fatal_error(error, "&user symbol = '"//symbol//"': there is no such function in "// &
                          self%library//'; give its name, declared extern "C" in C++', status_input)
      end associate
   end subroutine find_element

   !> Its states: their number, and those of the unstrained element, 0 where nothing is said.
   subroutine find_states(library, symbol, element, error)
      type(c_ptr), intent(in) :: library
      character(*), intent(in) :: symbol
      type(user_element), intent(inout) :: element
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: address
      integer(c_int), pointer :: number
      real(c_double), pointer :: values(:)

      ! Without that number the function gives forces, and keeps nothing.
      address = find_address(library, symbol//'_states')
      if (.not. c_associated(address)) return
      call c_f_pointer(address, number)
      if (number < 1 .or. number > most_states) then
         call fatal_error(error, "&user symbol = '"//symbol//"': "//symbol//'_states is '// &
                          to_text(int(number))//': must be from 1 to '//to_text(most_states), &
                          status_input)
         return
      end if
      element%n_state = int(number)
      allocate (element%start(element%n_state), source=0.0_wp)
      ! A copy: what the library does with its own numbers later changes no run.
      address = find_address(library, symbol//'_start')
      if (.not. c_associated(address)) return
      call c_f_pointer(address, values, [number])
      element%start = values
   end subroutine find_states

   !> Rows of the elements, from the elements themselves: those of a library and those of a program
   !> may have different numbers of inputs. What an element has less than the widest one stays 0 on
   !> both sides, which is no input.
   subroutine settle(self)
      class(user_group), intent(inout) :: self
      integer :: e

      call self%reserve_rows(maxval([1, self%function%n_in]), size(self%function))
      do e = 1, size(self%function)
         associate (element => self%function(e))
            self%row_side_1(:element%n_in, e) = element%side_1
            self%row_side_2(:element%n_in, e) = element%side_2
         end associate
      end do
   end subroutine settle

   !> Once: a case is read anew where laws are added.
   !> Elements of a program come behind those of the library, whose numbers stay as the keys count
   !> them.
   subroutine take_laws(self, laws)
      class(user_group), intent(inout) :: self
      type(user_element), intent(in) :: laws(:)

      if (.not. allocated(self%function)) allocate (self%function(0))
      self%function = [self%function, laws]
      call self%settle()
   end subroutine take_laws

   !> Sectors share the functions; each has elements of its own, one sector after the other.
   subroutine make_law(self, n_sectors, law)
      class(user_group), intent(in) :: self
      integer, intent(in) :: n_sectors
      class(force_law), allocatable, intent(out) :: law

      allocate (law, source=new_user_law(self%function, n_sectors))
   end subroutine make_law

   !> One function without the promise takes the symmetry from the whole balance.
   pure logical function is_odd(self)
      class(user_group), intent(in) :: self

      is_odd = all(self%function%is_odd)
   end function is_odd

   !> Nobody knows.
   !> A function that is a spring in fact costs the iterations of a nonlinear one, no more.
   pure logical function is_linear(self)
      class(user_group), intent(in) :: self

      is_linear = self%n_elements == 0
   end function is_linear

end module fw_user_group
