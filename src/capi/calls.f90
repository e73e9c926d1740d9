!> What C and Fortran 77 may ask of a session, by its number and with a status in return. Both
!> interfaces are conversions of arguments around these.
!>
!> Statuses are those of fw_error; the words that go with one are kept with the session. Points
!> and frequencies count from 1 here; 0 is the last point, but no frequency.
!>
!> A call that changes the session takes it with `enter`, which fails while another call is at work
!> on it (another thread, or a callback of the run itself), and gives it back with `leave`. Calls
!> that only read use `find_handle`, so that a callback may ask for the points there are so far.
module fw_calls
   use fw_error, only: error_type, fatal_error, status_not_converged, status_ok, status_stopped, &
      status_usage
   use fw_handles, only: enter, find_handle, handle_type, leave
   use fw_kinds, only: i8, wp
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: call_load_file, call_load_text, call_set
   public :: call_new_model, call_put_reals, call_put_integers, call_observe
   public :: call_check, call_start, call_frequency, call_solve, call_run
   public :: call_count, call_size, call_get, call_get_text, call_message, call_refuse

   !> What stands where no handle can keep a message.
   character(*), parameter :: no_handle = 'there is no such handle: it was never created, was '// &
      'destroyed, or is at work in another call'

contains

   !> Read a namelist file; the keys that were set before stay on top of it.
   integer function call_load_file(id, path) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: path
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%load_file(path, error)
      status = leave(handle, error)
   end function call_load_file

   !> As call_load_file with the namelist in memory; `path` is its name in messages and the folder
   !> of its files. Nothing is parsed before the case is checked or started.
   integer function call_load_text(id, text, path) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: text, path
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%load_text(text, path)
      status = leave(handle, error)
   end function call_load_text

   !> Set 'group%key'; the value is checked with the rest of the case, not here.
   integer function call_set(id, key, value) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: key, value
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%set(key, value, error)
      status = leave(handle, error)
   end function call_set

   !> Begin a model of n_dof dofs and n_pairs contact pairs in place of one of a file.
   integer function call_new_model(id, n_dof, n_pairs) result(status)
      integer, intent(in) :: id
      integer, intent(in) :: n_dof, n_pairs
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%new_model(n_dof, n_pairs, error)
      status = leave(handle, error)
   end function call_new_model

   !> Give a real part of the model (any rank, by columns); the names are those of model files.
   integer function call_put_reals(id, name, values) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%put(name, values, error)
      status = leave(handle, error)
   end function call_put_reals

   !> As call_put_reals for whole numbers.
   integer function call_put_integers(id, name, values) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%put(name, values, error)
      status = leave(handle, error)
   end function call_put_integers

   !> Observe sum_i row(i) u(i) under a name (n_dof).
   integer function call_observe(id, name, row) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: name
      real(wp), intent(in) :: row(:)
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%observe(name, row, error)
      status = leave(handle, error)
   end function call_observe

   !> Build everything of the case short of a solution: whatever refuses it, refuses it here.
   integer function call_check(id) result(status)
      integer, intent(in) :: id
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%check(error)
      status = leave(handle, error)
   end function call_check

   !> Begin to go through frequencies: what call_solve continues from.
   integer function call_start(id) result(status)
      integer, intent(in) :: id
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%start(error)
      status = leave(handle, error)
   end function call_start

   !> Frequency k of the sweep [rad/s], from 1; there is no 0 for the last one here.
   integer function call_frequency(id, k, omega) result(status)
      integer, intent(in) :: id, k
      real(wp), intent(out) :: omega
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      ! Defined on every way out: a caller who ignores the status reads no garbage.
      omega = 0.0_wp
      status = status_usage
      call find_handle(id, handle)
      if (.not. associated(handle)) return
      call handle%session%frequency(k, omega, error)
      status = outcome_of(handle, error)
   end function call_frequency

   !> Solve at omega [rad/s] from the last converged point. A point that does not converge is kept,
   !> with the smallest residual that was found, and status_not_converged says so.
   !> status_stopped where the callback asks for it, also of a point that did not converge.
   integer function call_solve(id, omega) result(status)
      integer, intent(in) :: id
      real(wp), intent(in) :: omega
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%solve(omega, handle%observer, error)
      if (.not. allocated(error)) call judge_point(handle, error)
      status = leave(handle, error)
   end function call_solve

   !> What became of the last point, where it is not what was asked for.
   subroutine judge_point(handle, error)
      type(handle_type), pointer, intent(in) :: handle
      type(error_type), allocatable, intent(out) :: error

      associate (points => handle%session%points)
         associate (point => points%item(points%n)%point)
            if (handle%observer%stop_requested) then
               call fatal_error(error, 'stopped by the callback', status_stopped)
            else if (.not. point%converged) then
               call fatal_error(error, 'omega = '//to_text(point%omega)//' rad/s did not '// &
                                'converge: '//to_text(point%iterations)//' iterations, '// &
                                'residual '//to_text(point%residual), status_not_converged)
            end if
         end associate
      end associate
   end subroutine judge_point

   !> The whole case with its output files. A failure at single points is no error of the run: what
   !> there is of results is kept, and the status tells.
   integer function call_run(id) result(status)
      integer, intent(in) :: id
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      call enter(id, handle)
      status = status_usage
      if (.not. associated(handle)) return
      call handle%session%run(handle%observer, error)
      if (.not. allocated(error)) then
         select case (handle%session%outcome%status)
         case (status_stopped)
            call fatal_error(error, 'stopped by '//trim(stopped_by(handle))//' after '// &
                             to_text(handle%session%points%n)//' points', status_stopped)
         case (status_not_converged)
            call fatal_error(error, 'not every point converged, or the branch ended early: see '// &
                             'the summary', status_not_converged)
         ! `complete`: nothing to say.
         case default ! complete
         end select
      end if
      status = leave(handle, error)
   end function call_run

   !> Who ended a run.
   pure function stopped_by(handle) result(words)
      type(handle_type), intent(in) :: handle
      character(16) :: words

      words = 'the callback'
      if (handle%observer%asked_to_stop) words = 'fw_stop'
      if (handle%session%outcome%out_of_time) words = 'case%max_seconds'
   end function stopped_by

   !> How many there are of something: 'points', 'frequencies', 'dofs', 'pairs', 'observed',
   !> 'coefficients'.
   integer function call_count(id, what, n) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: what
      integer, intent(out) :: n
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error

      n = 0
      status = status_usage
      call find_handle(id, handle)
      if (.not. associated(handle)) return
      associate (session => handle%session)
         select case (what)
         case ('points')
            n = session%points%n
         case ('frequencies')
            n = session%n_frequencies()
         case ('dofs')
            n = session%case%model%n_dof
         case ('pairs')
            n = session%case%contact%n_pairs
         case ('observed')
            if (allocated(session%case%model%observe_name)) then
               n = size(session%case%model%observe_name)
            end if
         case ('coefficients')
            n = 2*session%case%harmonics%n_harmonics + 1
         case default
            call fatal_error(error, "there is no number of '"//what//"': must be points, "// &
                             'frequencies, dofs, pairs, observed or coefficients', status_usage)
         end select
         ! Defaults and files decide these numbers: before the case is read they would be of the
         ! case before it.
         if (.not. allocated(error) .and. what /= 'points' .and. .not. session%is_ready()) then
            n = 0
            call fatal_error(error, "the number of '"//what//"' is known once the case was "// &
                             'checked, started or run since its last change', status_usage)
         end if
      end associate
      status = outcome_of(handle, error)
   end function call_count

   !> Number of values that a point holds of a result.
   !> The values themselves are formed for it: some results exist only as a function of the point.
   !> Count in 64 bits: fields of all dofs and instants may pass 2**31 values.
   integer function call_size(id, name, k, n) result(status)
      integer, intent(in) :: id, k
      character(*), intent(in) :: name
      integer(i8), intent(out) :: n
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:)

      n = 0_i8
      status = status_usage
      call find_handle(id, handle)
      if (.not. associated(handle)) return
      call handle%session%get(name, k, values, error)
      if (allocated(values)) n = size(values, kind=i8)
      status = outcome_of(handle, error)
   end function call_size

   !> Copy the values of a result; a buffer that is too small stays as it is.
   !> `values` of a smaller result fill the beginning only.
   integer function call_get(id, name, k, buffer) result(status)
      integer, intent(in) :: id, k
      character(*), intent(in) :: name
      real(wp), intent(inout) :: buffer(:)
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:)

      status = status_usage
      call find_handle(id, handle)
      if (.not. associated(handle)) return
      call handle%session%get(name, k, values, error)
      if (allocated(values)) then
         if (size(values) <= size(buffer)) then
            buffer(:size(values)) = values
         else
            call fatal_error(error, name//' has '//to_text(size(values))//' values: the buffer '// &
                             'has room for '//to_text(size(buffer)), status_usage)
         end if
      end if
      status = outcome_of(handle, error)
   end function call_get

   !> A text: 'title', 'namelist' (the effective input), 'summary' (of a run, line by line), or
   !> 'observed', the name of observed quantity k.
   !> Blank where the case has none; only a name or a number that cannot be is an error.
   integer function call_get_text(id, what, k, text) result(status)
      integer, intent(in) :: id, k
      character(*), intent(in) :: what
      character(:), allocatable, intent(out) :: text
      type(handle_type), pointer :: handle
      type(error_type), allocatable :: error
      integer :: i, n

      text = ''
      status = status_usage
      call find_handle(id, handle)
      if (.not. associated(handle)) return
      associate (session => handle%session)
         select case (what)
         case ('title')
            if (allocated(session%case%title)) text = session%case%title
         case ('namelist')
            if (allocated(session%case%namelist)) text = session%case%namelist
         case ('summary')
            n = 0
            if (allocated(session%outcome%summary)) n = size(session%outcome%summary)
            do i = 1, n
               text = text//session%outcome%summary(i)%text//new_line('a')
            end do
         case ('observed')
            n = 0
            if (allocated(session%case%model%observe_name)) then
               n = size(session%case%model%observe_name)
            end if
            if (k >= 1 .and. k <= n) then
               text = session%case%model%observe_name(k)%text
            else
               call fatal_error(error, 'observed quantity '//to_text(k)//': there are '// &
                                to_text(n), status_usage)
            end if
         case default
            call fatal_error(error, "there is no text '"//what//"': must be title, namelist, "// &
                             'summary or observed', status_usage)
         end select
      end associate
      status = outcome_of(handle, error)
   end function call_get_text

   !> What the last call that failed had to say.
   !> A call that may change the session clears it at its start; one that only reads does not.
   subroutine call_message(id, text)
      integer, intent(in) :: id
      character(:), allocatable, intent(out) :: text
      type(handle_type), pointer :: handle

      text = no_handle
      call find_handle(id, handle)
      if (associated(handle)) text = handle%message
   end subroutine call_message

   !> Keep the words for arguments that an interface cannot pass on.
   !> Always status_usage, with or without a handle to keep the words.
   integer function call_refuse(id, message) result(status)
      integer, intent(in) :: id
      character(*), intent(in) :: message
      type(handle_type), pointer :: handle

      status = status_usage
      call find_handle(id, handle)
      if (associated(handle)) handle%message = message
   end function call_refuse

   !> Of a call that only reads, which may come from a callback in the middle of another one.
   !> It must not give the handle back: the call that it interrupts still has it.
   integer function outcome_of(handle, error) result(status)
      type(handle_type), pointer, intent(in) :: handle
      type(error_type), allocatable, intent(in) :: error

      status = status_ok
      if (.not. allocated(error)) return
      status = error%status
      handle%message = error%message
   end function outcome_of

end module fw_calls
