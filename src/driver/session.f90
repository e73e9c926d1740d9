!> A case that lives inside another program: put together from a namelist, single keys and arrays
!> in memory, then run as a whole or frequency by frequency, with the points kept for reading.
!>
!> Sessions share nothing: each may live in a thread of its own. One session serves one thread at
!> a time.
module fw_session
   use, intrinsic :: iso_c_binding, only: c_int8_t
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type, fatal_error, status_usage
   use fw_harmonics_options, only: harmonics_options
   use fw_kinds, only: wp
   use fw_memory_model, only: memory_model_type
   use fw_namelist, only: parse_override
   use fw_namelist_data, only: entry_type
   use fw_observer, only: observer_type
   use fw_run_state, only: outcome_type
   use fw_paths, only: read_text_file
   use fw_point, only: point_type
   use fw_point_quantities, only: point_quantities, quantity_type
   use fw_one_level, only: one_level
   use fw_read_case, only: case_input, read_input
   use fw_problem, only: threads_for
   use fw_run, only: check_case, check_user_laws, run_case
   use fw_session_points, only: point_list, point_recorder
   use fw_solver_options, only: continuation_natural, sweep_options
   use fw_strategy, only: kept_strategy, new_request
   use fw_sweep, only: sweep_frequency
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   use fw_threads, only: thread_scope
   use fw_user_element, only: user_element, user_law_type
   implicit none (type, external)
   private

   public :: get_point_values, session_type

   !> What messages call the input of a session without a namelist file.
   character(*), parameter :: default_name = 'case'

   type :: session_type
      !> The case as it was last read; see `prepare`.
      type(case_type) :: case
      !> Status and summary of the last run.
      type(outcome_type) :: outcome
      !> The points of the last run, or of the steps since `start`.
      type(point_list) :: points
      !> What messages call a key that was set.
      character(16) :: origin = 'set'
      !> Namelist text, its path or name, and `group%key=value` on top of it.
      character(:), allocatable, private :: text, path
      type(string_type), allocatable, private :: keys(:)
      class(memory_model_type), allocatable, private :: model
      !> Laws that the program has added.
      type(user_element), allocatable, private :: laws(:)
      !> The case agrees with what was given.
      logical, private :: is_read = .false.
      !> Only between `start` and the next change.
      class(one_level), allocatable, private :: strategy
      !> Only between pieces of one sweep.
      type(kept_strategy), private :: kept
   contains
      procedure :: load_file
      procedure :: load_text
      procedure :: set
      procedure :: new_model
      generic :: put => put_reals, put_integers, put_texts
      procedure :: observe
      procedure :: observe_all
      procedure :: add_law
      procedure :: add_element
      procedure :: prepare
      procedure :: is_ready
      procedure :: check
      procedure :: start
      procedure :: n_frequencies
      procedure :: frequency
      procedure :: solve
      procedure :: run
      procedure :: run_piece
      procedure :: copy
      procedure :: get
      procedure, private :: put_reals
      procedure, private :: put_integers
      procedure, private :: put_texts
   end type session_type

contains

   !> Take the namelist of a file; it replaces one given before, keys set stay on top.
   subroutine load_file(self, path, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: path
      !> status_io where the file cannot be read; what is wrong in it shows in `prepare`.
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: text

      call read_text_file(path, text, error)
      if (.not. allocated(error)) call self%load_text(text, path)
   end subroutine load_file

   !> Take namelist text. Relative files in it start at the directory of `path`, which is also its
   !> name in messages.
   subroutine load_text(self, text, path)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: text, path

      self%text = text
      self%path = path
      if (len_trim(path) == 0) self%path = default_name
      call forget(self)
   end subroutine load_text

   !> Set a key by its name in the namelist: 'solver%tolerance' to '1e-9', 'contact%mu' to
   !> '0.3, 0.4'. A key that is set again loses its former value.
   subroutine set(self, key, value, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: key, value
      !> status_usage where this is no key; whether it exists shows in `prepare`.
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: kept(:)
      type(entry_type) :: entry
      character(:), allocatable :: assignment
      integer :: i

      assignment = trim(adjustl(key))//'='
      ! The texts of the reader serve one thread at a time.
      !$omp critical (fretwear_io)
      call parse_override(assignment//trim(value), entry, error, trim(self%origin))
      !$omp end critical (fretwear_io)
      if (allocated(error)) return
      allocate (kept(0))
      if (allocated(self%keys)) then
         do i = 1, size(self%keys)
            if (index(self%keys(i)%text, assignment) /= 1) call append(kept, self%keys(i)%text)
         end do
      end if
      call append(kept, assignment//trim(value))
      call move_alloc(kept, self%keys)
      call forget(self)
   end subroutine set

   !> Begin a model in memory, with `put` and `observe` to follow; it stands in for group &model
   !> and for what a model file holds.
   subroutine new_model(self, n_dof, n_pairs, error)
      class(session_type), intent(inout) :: self
      integer, intent(in) :: n_dof, n_pairs
      type(error_type), allocatable, intent(out) :: error
      type(memory_model_type) :: model

      call model%start(n_dof, n_pairs, error)
      if (allocated(error)) return
      self%model = model
      call forget(self)
   end subroutine new_model

   !> Give a real part of the model; see fw_memory_model for names and sizes.
   subroutine put_reals(self, name, values, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error

      call require_model(self, error)
      if (.not. allocated(error)) call self%model%put(name, values, error)
      call forget(self)
   end subroutine put_reals

   !> Give an integer part of the model.
   subroutine put_integers(self, name, values, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      type(error_type), allocatable, intent(out) :: error

      call require_model(self, error)
      if (.not. allocated(error)) call self%model%put(name, values, error)
      call forget(self)
   end subroutine put_integers

   !> Give texts of the model: 'title', 'unit_system', or 'contact/patch', one per pair.
   subroutine put_texts(self, name, texts, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: name
      type(string_type), intent(in) :: texts(:)
      type(error_type), allocatable, intent(out) :: error

      call require_model(self, error)
      if (.not. allocated(error)) call self%model%put(name, texts, error)
      call forget(self)
   end subroutine put_texts

   !> Observe linear combinations of the dofs (n_dof, n_observed) all at once, beside earlier ones.
   subroutine observe_all(self, names, columns, error)
      class(session_type), intent(inout) :: self
      type(string_type), intent(in) :: names(:)
      real(wp), intent(in) :: columns(:, :)
      type(error_type), allocatable, intent(out) :: error

      call require_model(self, error)
      if (.not. allocated(error)) call self%model%observe_all(names, columns, error)
      call forget(self)
   end subroutine observe_all

   !> Observe a linear combination of the dofs (n_dof); without any, every dof is observed.
   subroutine observe(self, name, row, error)
      class(session_type), intent(inout) :: self
      character(*), intent(in) :: name
      real(wp), intent(in) :: row(:)
      type(error_type), allocatable, intent(out) :: error

      call require_model(self, error)
      if (.not. allocated(error)) call self%model%observe(name, row, error)
      call forget(self)
   end subroutine observe

   !> Add an element whose forces an object of the program gives; see fw_user_element. The object
   !> has to live as long as the session.
   subroutine add_law(self, name, law, side_1, side_2, parameters, odd, difference, start)
      class(session_type), intent(inout) :: self
      !> For messages.
      character(*), intent(in) :: name
      class(user_law_type), intent(inout), target :: law
      !> Signed dofs of its inputs, and those on the other side (default: the ground) (n_in).
      integer, intent(in) :: side_1(:)
      integer, intent(in), optional :: side_2(:)
      !> Constants that are handed on (default: none).
      real(wp), intent(in), optional :: parameters(:)
      !> Opposite motions have opposite forces; slopes are not given, but differences (default: no).
      logical, intent(in), optional :: odd, difference
      !> States of the unstrained element (n_state), of a law that gives a `step`.
      real(wp), intent(in), optional :: start(:)
      type(user_element) :: element

      element%name = name
      element%n_in = size(side_1)
      element%side_1 = side_1
      element%side_2 = 0*side_1
      if (present(side_2)) element%side_2 = side_2
      allocate (element%parameters(0))
      if (present(parameters)) element%parameters = parameters
      if (present(odd)) element%is_odd = odd
      if (present(difference)) element%has_derivative = .not. difference
      if (present(start)) then
         element%n_state = size(start)
         element%start = start
      end if
      element%object => law
      call self%add_element(element)
   end subroutine add_law

   !> Add an element with a law of its own, ready made.
   subroutine add_element(self, element)
      class(session_type), intent(inout) :: self
      type(user_element), intent(in) :: element

      if (.not. allocated(self%laws)) allocate (self%laws(0))
      self%laws = [self%laws, element]
      call forget(self)
   end subroutine add_element

   !> Bring `case` up to date with what was given, which forgets the points of the one before;
   !> does nothing where it is so already.
   subroutine prepare(self, error)
      class(session_type), intent(inout) :: self
      !> Everything that is wrong in the input.
      type(error_type), allocatable, intent(out) :: error
      type(thread_scope) :: threads
      type(case_input) :: input

      if (self%is_read) return
      call self%points%clear()
      if (.not. allocated(self%text)) self%text = ''
      if (.not. allocated(self%path)) self%path = default_name
      if (.not. allocated(self%keys)) allocate (self%keys(0))
      if (allocated(self%model)) call self%model%check(error)
      if (allocated(error)) return
      input%path = self%path
      input%overrides = self%keys
      input%text = self%text
      input%origin = trim(self%origin)
      if (allocated(self%laws)) input%laws = self%laws
      ! Damping and checks of a model must not depend on the threads of the BLAS.
      call threads%enter(0)
      if (allocated(self%model)) then
         call read_input(input, self%case, error, self%model%parts)
      else
         call read_input(input, self%case, error)
      end if
      call threads%leave()
      self%is_read = .not. allocated(error)
   end subroutine prepare

   !> Whether `case` agrees with what was given.
   pure logical function is_ready(self)
      class(session_type), intent(in) :: self

      is_ready = self%is_read
   end function is_ready

   !> Everything that would refuse the case before it is computed.
   subroutine check(self, error)
      class(session_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call self%prepare(error)
      if (.not. allocated(error)) call check_case(self%case, error)
   end subroutine check

   !> Build the system for steps through frequencies; forgets the points of earlier ones.
   subroutine start(self, error)
      class(session_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(thread_scope) :: threads
      type(harmonics_options) :: plain

      call self%prepare(error)
      if (allocated(error)) return
      ! What was left to the program is no obstacle to steps, which take the plain defaults.
      if (self%case%harmonics%is_chosen) then
         self%case%harmonics%n_harmonics = plain%n_harmonics
         self%case%harmonics%accuracy = plain%accuracy
         self%case%harmonics%is_chosen = .false.
      end if
      if (self%case%over%is_wanted() .or. self%case%control%is_wanted()) then
         call fatal_error(error, 'steps go through frequencies at a given load: &sweep '// &
                          'parameter and &control are for runs of the case as a whole', &
                          status_usage)
         return
      end if
      if (.not. analyses(self%case%analysis)%is_response .or. &
          self%case%sweep%continuation /= continuation_natural .or. &
          self%case%harmonics%accuracy > 0.0_wp) then
         call fatal_error(error, 'steps go through frequencies of harmonic balance: '// &
                          "case%analysis must be 'frf' or 'point', sweep%continuation "// &
                          "'natural' and harmonics%accuracy 0; run the case as a whole instead", &
                          status_usage)
         return
      end if
      call forget_system(self)
      call self%points%clear()
      allocate (self%strategy)
      call threads%enter(threads_for(self%case))
      call check_user_laws(self%case, error)
      if (.not. allocated(error)) call self%strategy%start(self%case, error)
      call threads%leave()
      if (allocated(error)) call forget_system(self)
   end subroutine start

   !> Frequencies of the sweep of the case (0: not known beforehand, or the case was not read).
   pure integer function n_frequencies(self) result(n)
      class(session_type), intent(in) :: self

      n = 0
      if (.not. self%is_read .or. self%case%sweep%continuation /= continuation_natural) return
      n = 1
      if (analyses(self%case%analysis)%is_sweep) n = self%case%sweep%n_points
   end function n_frequencies

   !> Frequency k of the sweep, to the bit the one that a run takes [rad/s].
   subroutine frequency(self, k, omega, error)
      class(session_type), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(out) :: omega
      type(error_type), allocatable, intent(out) :: error

      omega = 0.0_wp
      if (k >= 1 .and. k <= self%n_frequencies()) then
         omega = sweep_frequency(self%case%sweep, k, self%n_frequencies())
      else
         call fatal_error(error, 'frequency '//to_text(k)//' of the sweep: must be from 1 to '// &
                          to_text(self%n_frequencies())//' (0: the case was not started)', &
                          status_usage)
      end if
   end subroutine frequency

   !> Solve at a frequency, warm-started from the steps before; the point joins `points`, converged
   !> or not. Frequencies beyond the bounds of &sweep may be slow or inaccurate.
   subroutine solve(self, omega, observer, error)
      class(session_type), intent(inout), target :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error
      type(point_recorder) :: recorder
      type(thread_scope) :: threads
      type(point_type) :: point

      if (.not. allocated(self%strategy)) then
         call fatal_error(error, 'a step needs a start: nothing was started since the last '// &
                          'change of the case', status_usage)
      else if (.not. (omega > 0.0_wp .and. omega <= huge(omega))) then
         call fatal_error(error, 'omega = '//to_text(omega)//' rad/s: must be above 0 and finite', &
                          status_usage)
      end if
      if (allocated(error)) return
      observer%stop_requested = .false.
      observer%demand = ''
      recorder%list => self%points
      recorder%observer => observer
      call threads%enter(threads_for(self%case))
      call self%strategy%solve_in_time(self%case, new_request(self%case, omega, observer), point, &
                                       error)
      call threads%leave()
      if (allocated(error)) return
      if (allocated(point%note)) call recorder%on_message(point%note)
      if (allocated(self%strategy%note)) call recorder%on_message(self%strategy%note)
      call recorder%on_point(self%points%n + 1, 0, point)
   end subroutine solve

   !> Run the whole case; a result file is written where the input names one (output%file).
   subroutine run(self, observer, error, write_file, image)
      class(session_type), intent(inout), target :: self
      class(observer_type), intent(inout), target :: observer
      !> What ends the run; not converging is an outcome.
      type(error_type), allocatable, intent(out) :: error
      !> Write the result file whether the input names it or not (default: where it does).
      logical, intent(in), optional :: write_file
      !> Instead of a file and of `points`: the bytes that the file would have.
      integer(c_int8_t), allocatable, intent(out), optional :: image(:)
      type(point_recorder) :: recorder
      logical :: writes

      call self%prepare(error)
      if (allocated(error)) return
      call forget_system(self)
      call self%points%clear()
      writes = self%case%output%names_file
      if (present(write_file)) writes = write_file
      if (present(image)) then
         call run_case(self%case, observer, self%outcome, error, image=image)
      else
         recorder%list => self%points
         recorder%observer => observer
         call run_case(self%case, recorder, self%outcome, error, write_file=writes)
      end if
   end subroutine run

   !> Run points `first` to `last` of a natural sweep, in one thread, and keep the system and the
   !> last solution for the next piece.
   subroutine run_piece(self, first, last, lead, solved, observer, error, image)
      class(session_type), intent(inout), target :: self
      integer, intent(in) :: first, last
      !> Points on the way to the first, and where that begins: with the start of the sweep (0), or
      !> behind this point, the last one of the piece before.
      integer, intent(in) :: lead, solved
      class(observer_type), intent(inout), target :: observer
      !> What ends the run; not converging is an outcome.
      type(error_type), allocatable, intent(out) :: error
      !> The bytes that a result file would have.
      integer(c_int8_t), allocatable, intent(out) :: image(:)
      type(sweep_options) :: whole
      integer :: n_threads

      call self%prepare(error)
      if (allocated(error)) return
      if (solved == 0) call forget_system(self)
      ! The case stays that of the whole sweep.
      whole = self%case%sweep
      n_threads = self%case%threads
      self%case%threads = 1
      associate (sweep => self%case%sweep)
         sweep%first_point = first
         sweep%last_point = last
         sweep%lead_points = lead
         sweep%solved_point = solved
         if (.not. allocated(self%kept%strategy) .and. solved > 0) then
            ! From the start of the sweep then, by steps as long.
            sweep%solved_point = 0
            sweep%lead_points = ceiling(real(max(lead, 1), wp)*real(first - 1, wp) &
                                        /real(max(first - 1 - solved, 1), wp))
         end if
      end associate
      call run_case(self%case, observer, self%outcome, error, image=image, kept=self%kept)
      self%case%sweep = whole
      self%case%threads = n_threads
   end subroutine run_piece

   !> Take the case of another session over, read as it is there.
   subroutine copy(self, other)
      class(session_type), intent(inout) :: self
      class(session_type), intent(in) :: other

      call forget_system(self)
      call self%points%clear()
      self%case = other%case
      if (allocated(other%text)) self%text = other%text
      if (allocated(other%path)) self%path = other%path
      if (allocated(other%keys)) self%keys = other%keys
      if (allocated(other%model)) self%model = other%model
      if (allocated(other%laws)) self%laws = other%laws
      self%origin = other%origin
      self%is_read = other%is_read
   end subroutine copy

   !> Values of a point by the name of their dataset in a result file; see fw_point_quantities.
   subroutine get(self, name, index, values, error)
      class(session_type), intent(in) :: self
      character(*), intent(in) :: name
      !> From 1; 0 is the last point.
      integer, intent(in) :: index
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      k = index
      if (k == 0) k = self%points%n
      if (k < 1 .or. k > self%points%n) then
         call fatal_error(error, 'point '//to_text(index)//': there are '// &
                          to_text(self%points%n)//' points', status_usage)
      else
         call get_point_values(self%points%item(k)%point, name, self%case, values, error)
      end if
   end subroutine get

   !> Parts of a model need one that was begun: its sizes tell theirs.
   subroutine require_model(self, error)
      class(session_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      if (allocated(self%model)) return
      call fatal_error(error, 'there is no model to put this in: begin with its numbers of '// &
                       'dofs and pairs', status_usage)
   end subroutine require_model

   !> What was given has changed.
   subroutine forget(self)
      class(session_type), intent(inout) :: self

      self%is_read = .false.
      call forget_system(self)
   end subroutine forget

   !> The system of the steps goes, and with it the solutions that they start from.
   subroutine forget_system(self)
      class(session_type), intent(inout) :: self

      if (allocated(self%strategy)) deallocate (self%strategy)
      if (allocated(self%kept%strategy)) deallocate (self%kept%strategy)
   end subroutine forget_system

   !> The values of a point by the name of a dataset of a result file, laid out as a row of it: the
   !> last index of the documented shape runs fastest; a flag is 1 or 0.
   subroutine get_point_values(point, name, case, values, error)
      type(point_type), intent(in) :: point
      character(*), intent(in) :: name
      !> The case that the point is of.
      type(case_type), intent(in) :: case
      real(wp), allocatable, intent(out) :: values(:)
      !> status_usage where there is no such name, or the point does not hold it.
      type(error_type), allocatable, intent(out) :: error
      type(quantity_type), allocatable :: list(:)
      integer :: i

      call point_quantities(list)
      do i = 1, size(list)
         if (list(i)%name == name) exit
      end do
      if (i > size(list)) then
         call unknown_name(name, list, error)
         return
      end if
      call list(i)%row(point, case, values)
      if (allocated(values)) return
      call fatal_error(error, "the point holds no '"//name//"': histories need "// &
                       'output%histories = .true., contact values contact pairs and '// &
                       'output%contact = .true., Floquet multipliers sweep%stability = '// &
                       ".true., error estimates harmonics%accuracy, derivatives &sensitivity, "// &
                       "wear case%analysis = 'wear'", &
                       status_usage)
   end subroutine get_point_values

   !> Say which names there are, in the order of the table.
   subroutine unknown_name(name, list, error)
      character(*), intent(in) :: name
      type(quantity_type), intent(in) :: list(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: names
      integer :: i

      names = trim(list(1)%name)
      do i = 2, size(list)
         ! Too many to name each.
         if (any(list(i)%sensitivity /= 0)) cycle
         names = names//', '//trim(list(i)%name)
      end do
      names = names//', sensitivity/QUANTITY/PARAMETER'
      call fatal_error(error, "there is no result '"//name//"': must be one of "//names, &
                       status_usage)
   end subroutine unknown_name

end module fw_session
