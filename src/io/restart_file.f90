!> An interrupted wear run as its result file tells it, read to be continued.
!>
!> A run that is continued gives the numbers of one that was never interrupted. So everything that
!> they depend on is compared: the keys, the constants of the pairs, and by its first vibration the
!> structure, whose matrices the file does not hold.
module fw_restart_file
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_case, only: analyses, analysis_words, case_type
   use fw_error, only: error_type, fatal_error, status_input, status_usage
   use fw_hdf5, only: get_shape, hdf5_file, read_attribute, read_dataset
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_restart_rows, only: c_checked_depth, c_converged, c_first_jump, c_implicit, c_jumps, &
      c_largest_rate, c_leaps, c_next_cycles, c_provisional, c_rejected, c_spacing, c_steps, &
      c_reach, c_touch, c_unsettled, n_controls, pair_constants, pair_keys
   use fw_result_rows, only: row_names
   use fw_result_target, only: is_result
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   use fw_values, only: number_text
   use fw_wear_march, only: wear_march
   use fw_wear_step, only: wear_state
   use hdf5, only: hsize_t
   use fw_namelist, only: parse_namelist
   use fw_namelist_data, only: entry_type, last_entry, multiply_out, namelist_type, value_type
   implicit none (type, external)
   private

   public :: restart_type, read_restart

   !> Keys in which a case may differ from the run that it continues. What matters of the files is
   !> compared by itself.
   character(*), parameter :: free_keys(*) = [character(18) :: 'case%title', 'case%threads', &
      'case%max_seconds', 'model%file', 'contact%worn', 'contact%worn_step', 'wear%n_cycles', &
      'wear%max_steps', 'wear%check_steps', 'mission%n_flights', 'output%file']

   !> The datasets of a step besides those of every point.
   character(*), parameter :: own_names(*) = [character(21) :: '/restart/vibration', &
      '/restart/checked_rate', '/restart/control']

   !> Model matrices and loads count as the same where they give the same first vibration, within
   !> what the round-off of another processor or thread count may change.
   real(wp), parameter :: same_vibration = 1.0e-6_wp

   type :: restart_type
      character(:), allocatable :: path
      !> Steps that the file holds, up to the one from which the run goes on.
      integer :: n_rows = 0
      !> What is known of these steps without the contact.
      type(point_type), allocatable :: points(:)
      !> State after the last step, frequency included, and the control of the march.
      type(wear_state) :: state
      real(wp) :: omega = 0.0_wp
      real(wp), allocatable :: control(:), checked_rate(:)
      !> Friction energy after the last step (n_pairs); not allocated where the file has none.
      real(wp), allocatable :: energy(:)
      !> Unknowns and rates of the first state.
      type(wear_state) :: first
      !> Of a mission every row up to there: flight and block, unknowns of the vibration, depth and
      !> rate (n_pairs, n_rows), residual, control and counts.
      integer, allocatable :: flight(:), block(:)
      real(wp), allocatable :: vibrations(:, :), depths(:, :), rates(:, :), residuals(:), &
                               controls(:, :), mission(:, :)
   contains
      procedure :: check_first
      procedure :: give_control
   end type restart_type

   ! What two effective inputs differ in.

   !> Longer values are not shown.
   integer, parameter :: most_shown = 60

contains

   !> Read what a case needs to go on from the last step of a file.
   subroutine read_restart(path, case, self, error)
      character(*), intent(in) :: path
      type(case_type), intent(in) :: case
      type(restart_type), intent(out) :: self
      !> status_io where the file cannot be read, status_input where it is not that of a wear run
      !> of this case.
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      type(error_type), allocatable :: ignored

      if (.not. analyses(case%analysis)%wears) then
         call fatal_error(error, "--restart continues a run of analysis = 'wear', but this "// &
                          "case has analysis = '"//trim(analysis_words(case%analysis))// &
                          "'; a natural sweep goes on by fretwear run --restart", status_usage)
         return
      end if
      self%path = path
      !$omp critical (fretwear_io)
      call file%open_read(path, error)
      if (.not. allocated(error)) call check_kind(file, error)
      if (.not. allocated(error)) call check_case(file, case, error)
      if (.not. allocated(error)) call count_rows(file, case, self%n_rows, error)
      if (.not. allocated(error)) call read_rows(file, case%contact%n_pairs, self, error)
      call file%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine read_restart

   !> Refuse files of other programs, other analyses, and versions without what is needed.
   subroutine check_kind(file, error)
      type(hdf5_file), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error

      if (.not. is_result(file)) then
         call fatal_error(error, file%path//': is no result file of fw_run: --restart takes '// &
                          'the result of a wear run', status_input)
      else if (.not. file%exists('/wear/depth')) then
         call fatal_error(error, file%path//": is not the result of analysis = 'wear': there "// &
                          'is nothing to be continued', status_input)
      else if (.not. file%exists('/restart/control')) then
         call fatal_error(error, file%path//': holds no group /restart, so its run cannot be '// &
                          'continued; &contact worn starts another from its depths', status_input)
      end if
   end subroutine check_kind

   !> Refuse to go on with anything that would change the numbers.
   subroutine check_case(file, case, error)
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: namelist, there, here
      real(wp), allocatable :: constants(:, :), own(:, :)
      integer :: i, k

      call read_attribute(file, '/', 'namelist', namelist, error)
      if (allocated(error)) return
      call find_difference(namelist, case%namelist, free_keys, there, here, error)
      if (allocated(error)) return
      if (len(there) > 0) then
         call fatal_error(error, file%path//': its run had '//there//', this case has '//here// &
                          ': only wear%n_cycles, mission%n_flights, wear%max_steps and the '// &
                          'name of the result may change; take the value back, or start '// &
                          'anew', status_input)
         return
      end if
      call read_dataset(file, '/restart/pairs', constants, error)
      if (allocated(error)) return
      ! To the last bit: they were written as they are.
      own = pair_constants(case%contact)
      if (any(shape(constants) /= shape(own))) then
         call fatal_error(error, file%path//': its run had '//to_text(size(constants, 1))// &
                          ' contact pairs, this case has '//to_text(size(own, 1)), status_input)
         return
      end if
      do k = 1, size(own, 2)
         i = findloc(abs(own(:, k) - constants(:, k)) > 0.0_wp, .true., 1)
         if (i == 0) cycle
         call fatal_error(error, file%path//': its run had contact%'//trim(pair_keys(k))//'('// &
                          to_text(i)//') = '//number_text(constants(i, k))//', this case has '// &
                          number_text(own(i, k))//': has the model file changed?', status_input)
         return
      end do
   end subroutine check_case

   !> Steps that every dataset holds: a killed run may have left some a row longer than others.
   subroutine count_rows(file, case, n_rows, error)
      type(hdf5_file), intent(in) :: file
      type(case_type), intent(in) :: case
      integer, intent(out) :: n_rows
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: names(:)
      integer(hsize_t), allocatable :: dims(:)
      integer :: i

      n_rows = huge(1)
      call row_names(case, names)
      do i = 1, size(own_names)
         call append(names, trim(own_names(i)))
      end do
      call append(names, '/restart/mission')
      do i = 1, size(names)
         ! An earlier version may have known fewer quantities.
         if (.not. file%exists(names(i)%text)) cycle
         call get_shape(file, names(i)%text, dims, error)
         if (allocated(error)) return
         n_rows = min(n_rows, int(dims(size(dims))))
      end do
      if (n_rows > 0) return
      call fatal_error(error, file%path//': no step was saved before the run ended: start anew', &
                       status_input)
   end subroutine count_rows

   !> State and control after the last complete step, and the first state for check_first.
   subroutine read_rows(file, n_pairs, self, error)
      type(hdf5_file), intent(in) :: file
      integer, intent(in) :: n_pairs
      type(restart_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: cycles(:), residual(:), omega(:)
      real(wp), allocatable :: vibration(:, :), depth(:, :), rate(:, :), checked(:, :)
      real(wp), allocatable :: control(:, :), energy(:, :)
      integer :: n

      call read_dataset(file, '/wear/cycles', cycles, error)
      if (.not. allocated(error)) call read_dataset(file, '/residual', residual, error)
      if (.not. allocated(error)) call read_dataset(file, '/omega', omega, error)
      if (.not. allocated(error)) call read_dataset(file, '/restart/vibration', vibration, error)
      if (.not. allocated(error)) call read_dataset(file, '/wear/depth', depth, error)
      if (.not. allocated(error)) call read_dataset(file, '/wear/rate', rate, error)
      if (.not. allocated(error)) call read_dataset(file, '/restart/checked_rate', checked, error)
      if (.not. allocated(error)) call read_dataset(file, '/restart/control', control, error)
      if (allocated(error)) return
      if (size(depth, 1) /= n_pairs .or. size(rate, 1) /= n_pairs .or. &
          size(checked, 1) /= n_pairs .or. size(control, 1) /= n_controls) then
         call fatal_error(error, file%path//': its datasets do not fit each other (damaged, or '// &
                          'of another version?)', status_input)
         return
      end if
      ! What another march would have left otherwise is taken once more. The first state is no step.
      n = min(self%n_rows, size(control, 2))
      n = max(1, findloc(control(c_provisional, :n) <= 0.0_wp, .true., 1, back=.true.))
      self%n_rows = n
      if (file%exists('/wear/energy')) then
         call read_dataset(file, '/wear/energy', energy, error)
         if (allocated(error)) return
         if (size(energy, 1) == n_pairs .and. size(energy, 2) >= n) self%energy = energy(:, n)
      end if
      self%omega = omega(n)
      self%state%cycles = cycles(n)
      self%state%residual = residual(n)
      ! Unknowns of the march: the vibration, then the depths.
      self%state%x = [vibration(:, n), depth(:, n)]
      self%state%rate = rate(:, n)
      self%control = control(:, n)
      ! Not looked for yet: no rates.
      if (all(ieee_is_finite(checked(:, n)))) self%checked_rate = checked(:, n)
      self%first%x = [vibration(:, 1), depth(:, 1)]
      self%first%rate = rate(:, 1)
      if (.not. all(ieee_is_finite(self%state%x))) then
         call fatal_error(error, file%path//': its last step is not complete (damaged file?)', &
                          status_input)
         return
      end if
      call read_points(file, omega, residual, control(c_converged, :), self%points, error)
      if (allocated(error) .or. .not. file%exists('/restart/mission')) return
      call read_dataset(file, '/wear/flight', self%flight, error)
      if (.not. allocated(error)) call read_dataset(file, '/wear/block', self%block, error)
      if (.not. allocated(error)) call read_dataset(file, '/restart/mission', self%mission, error)
      self%vibrations = vibration(:, :n)
      self%depths = depth(:, :n)
      self%rates = rate(:, :n)
      self%residuals = residual(:n)
      self%controls = control(:, :n)
   end subroutine read_rows

   !> What the summary and the observers want of earlier steps.
   subroutine read_points(file, omega, residual, converged, points, error)
      type(hdf5_file), intent(in) :: file
      real(wp), intent(in) :: omega(:), residual(:), converged(:)
      type(point_type), allocatable, intent(out) :: points(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: amplitude(:, :)
      integer, allocatable :: iterations(:)
      integer :: i

      call read_dataset(file, '/amplitude', amplitude, error)
      if (.not. allocated(error)) call read_dataset(file, '/iterations', iterations, error)
      if (allocated(error)) return
      ! A killed run may have left some datasets a row longer.
      allocate (points(min(size(converged), size(omega), size(iterations), size(amplitude, 2))))
      do i = 1, size(points)
         points(i)%omega = omega(i)
         points(i)%residual = residual(i)
         points(i)%amplitude = amplitude(:, i)
         points(i)%iterations = iterations(i)
         points(i)%converged = converged(i) > 0.0_wp
      end do
   end subroutine read_points

   !> Refuse to go on where the unworn joint of the case is not that of the file.
   subroutine check_first(self, state, error)
      class(restart_type), intent(in) :: self
      !> First state of the case.
      type(wear_state), intent(in) :: state
      type(error_type), allocatable, intent(out) :: error
      logical :: agrees

      ! Each test only where the one before holds: sizes come first.
      agrees = size(state%x) == size(self%first%x)
      if (agrees) agrees = norm2(state%x - self%first%x) <= same_vibration*norm2(self%first%x)
      if (agrees) agrees = norm2(state%rate - self%first%rate) <= &
                           same_vibration*norm2(self%first%rate)
      if (agrees) return
      call fatal_error(error, self%path//': its joint vibrates otherwise than that of this '// &
                       'case before any wear: the matrices or loads of &model have changed; '// &
                       'start anew, or use &contact worn to go on from its depths', status_input)
   end subroutine check_first

   !> Set a march to where it stood after the last step.
   subroutine give_control(self, march)
      class(restart_type), intent(in) :: self
      type(wear_march), intent(inout) :: march

      march%next_cycles = self%control(c_next_cycles)
      march%largest_rate = self%control(c_largest_rate)
      march%checked_depth = self%control(c_checked_depth)
      march%resonance%spacing = self%control(c_spacing)
      march%n_steps = nint(self%control(c_steps))
      march%n_rejected = nint(self%control(c_rejected))
      march%n_unsettled = nint(self%control(c_unsettled))
      march%n_implicit = nint(self%control(c_implicit))
      march%n_leaps = nint(self%control(c_leaps))
      march%n_jumps = nint(self%control(c_jumps))
      march%first_jump = self%control(c_first_jump)
      march%touch%reach = self%control(c_reach)
      march%touch%in_cycles = self%control(c_touch)
      if (allocated(self%checked_rate)) march%checked_rate = self%checked_rate
   end subroutine give_control

   !> The first key that two namelists, as effective inputs have them, do not agree in, and both of
   !> its values: `&wear order = 2` and `&wear order = 3`; '' where they agree.
   subroutine find_difference(first, second, ignored, in_first, in_second, error)
      character(*), intent(in) :: first, second
      !> `group%key` each: keys that may differ.
      character(*), intent(in) :: ignored(:)
      character(:), allocatable, intent(out) :: in_first, in_second
      type(error_type), allocatable, intent(out) :: error
      type(namelist_type) :: a, b

      in_first = ''
      in_second = ''
      call parse_namelist(first, '', a, error)
      if (.not. allocated(error)) call parse_namelist(second, '', b, error)
      if (allocated(error)) return
      call compare(a, b, ignored, in_first, in_second)
      if (len(in_first) > 0) return
      ! Keys that only the second namelist has.
      call compare(b, a, ignored, in_second, in_first)
   end subroutine find_difference

   !> The keys of the first against those of the second.
   subroutine compare(a, b, ignored, in_a, in_b)
      type(namelist_type), intent(in) :: a, b
      character(*), intent(in) :: ignored(:)
      character(:), allocatable, intent(inout) :: in_a, in_b
      character(:), allocatable :: name, text, other
      integer :: i, j

      do i = 1, a%n_entries
         name = a%entries(i)%group//'%'//a%entries(i)%key
         if (any(ignored == name)) cycle
         j = last_entry(b, a%entries(i)%group, a%entries(i)%key)
         text = text_of(a%entries(i))
         other = 'not given'
         if (j > 0) other = text_of(b%entries(j))
         if (text == other) cycle
         in_a = shown(name, text)
         in_b = shown(name, other)
         return
      end do
   end subroutine compare

   !> All values of an assignment as one text.
   function text_of(entry) result(text)
      type(entry_type), intent(in) :: entry
      character(:), allocatable :: text
      type(value_type), allocatable :: values(:)
      integer :: i

      ! So that 2*0.5 and 0.5, 0.5 are the same.
      call multiply_out(entry%values, values)
      text = ''
      do i = 1, size(values)
         if (i > 1) text = text//', '
         if (values(i)%quoted) then
            text = text//"'"//values(i)%text//"'"
         else
            text = text//values(i)%text
         end if
      end do
   end function text_of

   pure function shown(name, text) result(words)
      character(*), intent(in) :: name, text
      character(:), allocatable :: words

      if (text == 'not given') then
         words = name//' not given'
      else if (len(text) > most_shown) then
         words = name//' = '//text(:most_shown)//' ...'
      else
         words = name//' = '//text
      end if
   end function shown

end module fw_restart_file
