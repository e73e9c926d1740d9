!> The short table that a run ends with: how many points, the peak, the work done and what was
!> skipped.
module fw_summary
   use fw_kinds, only: wp, pi
   use fw_bifurcation, only: bifurcation_list, kind_words
   use fw_case, only: case_type
   use fw_contact_data, only: sliding_steady
   use fw_harmonics_options, only: sampling_events, sampling_uniform
   use fw_balance_state, only: balance_state
   use fw_linear_step, only: linear_step_type
   use fw_mode_group, only: mode_table
   use fw_parameters, only: parameter_words, parameter_key
   use fw_peak, only: found_bound, found_jump, found_unresolved, peak_type
   use fw_point, only: point_type
   use fw_remarks, only: remark_list
   use fw_resonance_group, only: resonance_table
   use fw_run_state, only: run_state
   use fw_solver_options, only: solver_newton
   use fw_stability_verdict, only: verdict_stable, verdict_undecided, verdict_unstable
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: summary_type, new_summary

   !> Observed quantities that the table shows.
   integer, parameter :: max_shown = 6
   !> Bifurcations that it shows.
   integer, parameter :: most_places = 12
   !> Damping ratios below are none.
   real(wp), parameter :: no_damping = 1.0e-9_wp

   type :: summary_type
      !> Of all points, those on the way included.
      integer :: iterations = 0
      !> Fewest and most harmonics of a point, where they adapt.
      integer :: harmonics(2) = [huge(0), 0]
      !> Fewest and most instants of a point, where they are chosen.
      integer :: instants(2) = [huge(0), 0]
      !> Points by their verdict on stability (undecided, unstable, stable).
      integer :: verdicts(verdict_undecided:verdict_stable) = 0
      type(string_type), allocatable :: name(:)
      !> Largest amplitude of each observed quantity among converged points, and where: at a
      !> frequency [rad/s], or at a value of the parameter that is named.
      real(wp), allocatable :: peak(:), peak_place(:)
      character(28) :: parameter = ''
      !> The least and the largest scale of the load at converged points, where it is a result.
      real(wp) :: load_scale(2) = [huge(1.0_wp), -huge(1.0_wp)]
      logical :: is_controlled = .false.
      !> What else there is to say of the peak of each; not allocated where nothing is.
      type(string_type), allocatable :: peak_note(:)
      !> What is allowed and seldom meant.
      type(remark_list) :: remarks
      !> Lines about the work that was done.
      !> Places where stability changes, in words.
      type(string_type), allocatable :: bifurcation(:)
      type(string_type), allocatable :: work(:)
      !> Whether modal damping is that of modes with stuck contact.
      logical :: damps_stuck = .false.
      !> What the case did not need, in words.
      type(string_type), allocatable :: skipped(:)
      !> How contact was sampled; not allocated where the work is not described.
      integer, allocatable :: sampling
      !> Converged points whose forces ask for more instants than they had, and the most of these.
      integer :: n_coarse = 0, instants_wanted = 0
      !> Whether friction has the direction of surfaces that slide, whatever the vibration; points
      !> at which this overtakes its surface, the most of it, and its pair.
      logical :: slides_steadily = .false.
      integer :: n_overtaken = 0, overtaking_pair = 0
      real(wp) :: overtaking = 0.0_wp
      !> Lines about a nonlinear mode, in place of the peaks.
      type(string_type), allocatable :: mode(:)
   contains
      procedure :: add
      procedure :: add_transient
      procedure :: remark_instants
      procedure :: remark_sliding
      procedure :: describe_work
      procedure :: describe_peaks
      procedure :: describe_bifurcations
      procedure :: line
      procedure :: describe_accuracy
      procedure :: describe_mode
      procedure :: describe_resonance
      procedure :: lines
   end type summary_type

contains

   !> Nothing is known yet but the names of the observed quantities.
   pure function new_summary(case) result(self)
      type(case_type), intent(in) :: case
      type(summary_type) :: self

      self%name = case%model%observe_name
      allocate (self%peak(size(self%name)), self%peak_place(size(self%name)), source=0.0_wp)
      if (case%over%is_wanted()) self%parameter = parameter_words(case%over%number)
      self%is_controlled = case%control%is_wanted()
      self%damps_stuck = case%damps_modes .and. allocated(case%model%damped_joint)
      self%slides_steadily = case%contact%sliding == sliding_steady
      allocate (self%work(0), self%skipped(0))
   end function new_summary

   !> Take a point into account.
   subroutine add(self, point)
      class(summary_type), intent(inout) :: self
      type(point_type), intent(in) :: point
      integer :: i

      self%iterations = self%iterations + point%iterations
      self%harmonics = [min(self%harmonics(1), point%n_harmonics), &
                        max(self%harmonics(2), point%n_harmonics)]
      self%instants = [min(self%instants(1), point%n_time), max(self%instants(2), point%n_time)]
      if (.not. point%converged) return
      self%load_scale = [min(self%load_scale(1), point%load_scale), &
                         max(self%load_scale(2), point%load_scale)]
      ! What instants leave out is a part of the estimate of an error.
      if (point%instants_wanted > 0 .and. .not. point%error_estimate > 0.0_wp) then
         self%n_coarse = self%n_coarse + 1
         self%instants_wanted = max(self%instants_wanted, point%instants_wanted)
      end if
      if (self%slides_steadily .and. allocated(point%overtaking)) then
         if (any(point%overtaking > 1.0_wp)) self%n_overtaken = self%n_overtaken + 1
         if (maxval(point%overtaking) > self%overtaking) then
            self%overtaking = maxval(point%overtaking)
            self%overtaking_pair = maxloc(point%overtaking, dim=1)
         end if
      end if
      if (allocated(point%multipliers)) then
         self%verdicts(point%verdict) = self%verdicts(point%verdict) + 1
      end if
      do i = 1, size(self%peak)
         if (point%amplitude(i) < self%peak(i)) cycle
         self%peak(i) = point%amplitude(i)
         self%peak_place(i) = point%omega
         if (len_trim(self%parameter) > 0) self%peak_place(i) = point%place
      end do
   end subroutine add

   !> A point on the way, which is not meant to be in equilibrium.
   subroutine add_transient(self, point)
      class(summary_type), intent(inout) :: self
      type(point_type), intent(in) :: point

      self%iterations = self%iterations + point%iterations
   end subroutine add_transient

   !> Where forces turn round between two instants. Of all points.
   subroutine remark_instants(self)
      class(summary_type), intent(inout) :: self

      if (self%n_coarse == 0) return
      call self%remarks%add('few instants', 'friction turns round between two instants at '// &
         to_text(self%n_coarse)//' points, where velocities are many times '// &
         'contact%slip_speed: take harmonics%n_time = '//to_text(self%instants_wanted)// &
         ' or more (8 max|v|/slip_speed), or set harmonics%accuracy')
   end subroutine remark_instants

   !> Where the vibration is faster than the surface that it rubs on. Of all points.
   subroutine remark_sliding(self)
      class(summary_type), intent(inout) :: self

      if (self%n_overtaken == 0) return
      call self%remarks%add('sliding may turn', 'at '//to_text(self%n_overtaken)//' points the '// &
         'vibration along contact%speed_1, speed_2 is faster than these, up to '// &
         to_text(self%overtaking)//' times at pair '//to_text(self%overtaking_pair)//': '// &
         "friction turns round there, which sliding = 'steady' leaves out: compare with 'path'")
   end subroutine remark_sliding

   !> What the linear solver did, and what the case did not need.
   subroutine describe_work(self, system, linear, kind, all_converged)
      class(summary_type), intent(inout) :: self
      type(balance_state), intent(in) :: system
      type(linear_step_type), intent(in) :: linear
      !> The solver of the case; the counts are those of Newton's method.
      integer, intent(in) :: kind
      !> Whether every point converged.
      logical, intent(in) :: all_converged
      integer :: percent

      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         self%sampling = merge(sampling_events, sampling_uniform, law%facts%locates_events)
      end associate
      deallocate (self%work)
      allocate (self%work(0))
      call add_line(self%work, 'unknowns', to_text(system%n)//' ('// &
                    to_text(system%problem%structure%n_coordinates)//' coordinates, '// &
                    to_text(system%problem%fourier%n_coefficients)//' coefficients, '// &
                    to_text(system%problem%fourier%n_time)//' instants'// &
                    trim(merge(', events located', repeat(' ', 16), &
                               self%sampling == sampling_events))//')')
      call add_line(self%work, 'linear solver', &
                    to_text(linear%factorizations)//' LU factorizations, '// &
                    to_text(linear%krylov_iterations)//' Krylov iterations, '// &
                    to_text(linear%preconditioners)//' preconditioners'// &
                    trim(merge(repeat(' ', 32), ', where Newton''s method was used', &
                               kind == solver_newton)))
      if (system%splits() .and. linear%krylov_iterations > 0) then
         call add_line(self%work, 'linear products', 'static stiffness and '// &
                       to_text(system%problem%structure%split_rank())//' patterns of motion')
      end if
      if (.not. system%problem%fourier%has_constant()) then
         call skip(self, 'even harmonics (half-wave symmetry)')
      end if
      if (system%problem%joint%n_idle > 0) then
         call skip(self, to_text(system%problem%joint%n_idle)//' '// &
                   'contact components that nothing moves')
      end if
      percent = nint(100.0_wp*linear%share_skipped/real(max(linear%n_problems, 1), wp))
      if (percent > 0) then
         call skip(self, 'stuck pairs, '//to_text(percent)// &
                   ' % of the unknowns of the linear problems')
      end if
      if (linear%n_problems == 0 .and. system%problem%n_pairs > 0 .and. &
          kind == solver_newton .and. all_converged) then
         call skip(self, 'every linear problem: the joint stays stuck')
      else if (linear%n_empty > 0) then
         call skip(self, to_text(linear%n_empty)//' of '// &
                   to_text(linear%n_empty + linear%n_problems)// &
                   ' linear problems: the joint stays stuck')
      end if
   end subroutine describe_work

   !> The maxima between the points, which stand for those of the points.
   subroutine describe_peaks(self, peaks, n_solved, iterations)
      class(summary_type), intent(inout) :: self
      type(peak_type), intent(in) :: peaks(:)
      !> Points solved to find them, and their iterations.
      integer, intent(in) :: n_solved, iterations
      integer :: i, k, n_inside, n_open

      allocate (self%peak_note(size(self%peak)))
      do i = 1, size(self%peak)
         self%peak_note(i)%text = ''
         n_inside = 0
         n_open = 0
         do k = 1, size(peaks)
            if (peaks(k)%observed /= i) cycle
            if (peaks(k)%found_by /= found_bound) n_inside = n_inside + 1
            if (peaks(k)%found_by == found_unresolved) n_open = n_open + 1
            if (peaks(k)%amplitude < self%peak(i)) cycle
            self%peak(i) = peaks(k)%amplitude
            self%peak_place(i) = peaks(k)%omega
            self%peak_note(i)%text = trim(note_of(peaks(k)))
         end do
         if (n_inside > 1) self%peak_note(i)%text = self%peak_note(i)%text//', '// &
                                                    to_text(n_inside)//' maxima'
         if (n_inside > 1 .and. n_open > 0) self%peak_note(i)%text = self%peak_note(i)%text// &
            ', '//to_text(n_open)//' of them not resolved'
      end do
      if (n_solved > 0) call add_line(self%work, 'peaks', to_text(n_solved)//' more points, '// &
                                      to_text(iterations)//' iterations')
   end subroutine describe_peaks

   !> Where the response turns or its stability changes.
   subroutine describe_bifurcations(self, list, n_solved, iterations)
      class(summary_type), intent(inout) :: self
      type(bifurcation_list), intent(in) :: list
      !> Solutions made to find them, and their iterations.
      integer, intent(in) :: n_solved, iterations
      character(14) :: text
      character(48) :: where
      integer :: k

      allocate (self%bifurcation(0))
      do k = 1, min(list%n, most_places)
         write (text, '(es13.6)') list%item(k)%place
         if (len_trim(self%parameter) > 0) then
            where = trim(self%parameter)//' = '//trim(adjustl(text))
         else
            where = trim(adjustl(text))//' rad/s'
         end if
         call add_line(self%bifurcation, trim(merge('bifurcations', '            ', k == 1)), &
                       trim(kind_words(list%item(k)%kind))//' at '//trim(where))
      end do
      if (list%n > most_places) then
         call add_line(self%bifurcation, '', to_text(list%n - most_places)// &
                       ' more in the result file')
      end if
      if (n_solved > 0) call add_line(self%work, 'located by', to_text(n_solved)// &
                                      ' more points, '//to_text(iterations)//' iterations')
   end subroutine describe_bifurcations

   !> What a reader should know of a peak.
   pure function note_of(peak) result(words)
      type(peak_type), intent(in) :: peak
      character(27) :: words

      select case (peak%found_by)
      case (found_bound)
         words = ', at the end of the sweep'
      case (found_jump)
         words = ', where the response jumps'
      case (found_unresolved)
         words = ', not resolved'
      case default
         words = ''
      end select
   end function note_of

   !> Work that the case did not need: a line of the table, and an attribute of the result.
   subroutine skip(self, words)
      class(summary_type), intent(inout) :: self
      character(*), intent(in) :: words

      call append(self%skipped, words)
      call add_line(self%work, 'skipped', words)
   end subroutine skip

   !> A line about the work, of whoever knows it.
   subroutine line(self, label, text)
      class(summary_type), intent(inout) :: self
      character(*), intent(in) :: label, text

      call add_line(self%work, label, text)
   end subroutine line

   !> What the points took to be accurate.
   subroutine describe_accuracy(self, worst, accuracy, n_claimed, n_short)
      class(summary_type), intent(inout) :: self
      !> Largest estimate of the error among the points with a claim, and what was asked for.
      real(wp), intent(in) :: worst, accuracy
      !> Points with a claim, and converged ones without.
      integer, intent(in) :: n_claimed, n_short
      character(:), allocatable :: words
      character(10) :: text(2)

      write (text(1), '(es8.1)') worst
      write (text(2), '(es8.1)') accuracy
      call add_line(self%work, 'harmonics', to_text(self%harmonics(1))//' to '// &
                    to_text(self%harmonics(2)))
      call add_line(self%work, 'instants', to_text(self%instants(1))//' to '// &
                    to_text(self%instants(2)))
      if (n_claimed + n_short == 0) then
         call add_line(self%work, 'error', 'not known: no point converged')
         return
      end if
      words = 'nothing is claimed, '
      if (n_claimed > 0) words = 'at most '//trim(adjustl(text(1)))//' by estimate, '
      words = words//trim(adjustl(text(2)))//' asked for'
      if (n_claimed > 0 .and. n_short > 0) words = words//'; nothing is claimed at '// &
         to_text(n_short)//' of '//to_text(n_claimed + n_short)//' points'
      call add_line(self%work, 'error', words)
   end subroutine describe_accuracy

   !> What a nonlinear mode is, and where it slips and keeps itself alive.
   subroutine describe_mode(self, table, name, by_observed, highest)
      class(summary_type), intent(inout) :: self
      type(mode_table), intent(in) :: table
      !> Of the first observed quantity.
      character(*), intent(in) :: name
      !> Whether amplitudes are those of it, else modal.
      logical, intent(in) :: by_observed
      !> Highest amplitude that was asked for.
      real(wp), intent(in) :: highest
      character(:), allocatable :: cycles, what
      real(wp) :: damping(table%n)
      integer :: k

      allocate (self%mode(0))
      if (table%n == 0) return
      what = 'a'
      if (by_observed) what = name
      associate (row => table%row)
         call add_line(self%mode, 'mode '//to_text(table%number), trim(short(table%stuck_omega))// &
                       ' rad/s '//trim(merge('sliding', 'stuck  ', table%slides))//', '// &
                       trim(short(row(table%n)%omega))//' at the end')
         if (table%onset%amplitude > 0.0_wp) then
            call add_line(self%mode, 'slips from', what//' = '//trim(short(table%onset%amplitude)))
         end if
         damping = [(0.5_wp*row(k)%self_excitation/row(k)%omega, k=1, table%n)]
         k = maxloc(damping, dim=1)
         call add_line(self%mode, 'damping', trim(short(damping(k)))//' at most, at '//what// &
                       ' = '//trim(short(row(k)%amplitude)))
      end associate
      if (allocated(table%cycle_amplitude)) then
         cycles = to_text(size(table%cycle_amplitude))//':'
         do k = 1, size(table%cycle_amplitude)
            cycles = cycles//' '//what//' = '//trim(short(table%cycle_amplitude(k)))// &
                     trim(merge(' (stable)  ', ' (unstable)', table%cycle_stable(k) == 1))
            if (k < size(table%cycle_amplitude)) cycles = cycles//','
         end do
         call add_line(self%mode, 'limit cycles', cycles)
      else if (all(damping < -no_damping)) then
         call add_line(self%mode, 'limit cycles', 'none up to '//what//' = '//trim(short(highest)) &
                       //': the mode gains energy at every amplitude')
      end if
   end subroutine describe_mode

   !> A resonance over a parameter: where it is smallest and largest, and at both ends.
   subroutine describe_resonance(self, table, case)
      class(summary_type), intent(inout) :: self
      type(resonance_table), intent(in) :: table
      type(case_type), intent(in) :: case
      integer :: places(4), i
      character(10), parameter :: words(4) = [character(10) :: ', first', ', last', ', smallest', &
                                             ', largest']
      character(24) :: key

      allocate (self%mode(0))
      if (.not. any_converged(table)) return
      call parameter_key(case%resonance%parameter, key)
      associate (row => table%row(:table%n))
         places = [1, table%n, minloc(row%value, dim=1, mask=row%converged), &
                   maxloc(row%value, dim=1, mask=row%converged)]
         do i = 1, size(places)
            call add_line(self%mode, trim(merge('resonance', '         ', i == 1)), &
                          trim(exact(row(places(i))%value))//' at '// &
                          trim(exact(row(places(i))%omega))//' rad/s for '//trim(key)//' = '// &
                          to_text(row(places(i))%parameter)//trim(words(i)))
         end do
      end associate
   end subroutine describe_resonance

   pure logical function any_converged(table)
      type(resonance_table), intent(in) :: table

      any_converged = .false.
      if (table%n > 0) any_converged = any(table%row(:table%n)%converged)
   end function any_converged

   !> A number that is meant to be read off.
   pure function exact(value) result(text)
      real(wp), intent(in) :: value
      character(13) :: text

      write (text, '(es13.6)') value
      text = adjustl(text)
   end function exact

   !> A number for the table.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(9) :: text

      write (text, '(es9.2)') value
      text = adjustl(text)
   end function short

   !> The table (seconds: elapsed time).
   function lines(self, state, seconds) result(table)
      class(summary_type), intent(in) :: self
      type(run_state), intent(in) :: state
      real(wp), intent(in) :: seconds
      type(string_type), allocatable :: table(:)
      character(80) :: text
      integer :: i

      allocate (table(0))
      call add_line(table, 'converged', to_text(state%n_converged)//' of '// &
                    to_text(state%n_points)//' points')
      call add_line(table, 'iterations', to_text(self%iterations))
      if (self%damps_stuck) call add_line(table, 'modal damping', 'of modes with stuck contact')
      if (allocated(self%mode)) then
         do i = 1, size(self%mode)
            call append(table, self%mode(i)%text)
         end do
      end if
      if (self%is_controlled .and. state%n_converged > 0) then
         write (text, '(es13.6, a, es13.6)') self%load_scale(1), ' .. ', self%load_scale(2)
         call add_line(table, 'load scale', trim(adjustl(text)))
      end if
      do i = 1, merge(min(size(self%name), max_shown), 0, state%n_converged > 0 .and. &
                      .not. (allocated(self%mode) .or. self%is_controlled))
         write (text, '(es13.6, a, es13.6, a, es13.6, a)') self%peak(i), ' at ', &
            self%peak_place(i), &
            ' rad/s (', self%peak_place(i)/(2.0_wp*pi), ' Hz)'
         if (len_trim(self%parameter) > 0) then
            ! Of the rows: no maximum between them is looked for.
            write (text, '(es13.6, a, es13.6)') self%peak(i), ' at '//trim(self%parameter)// &
               ' = ', self%peak_place(i)
            call add_line(table, 'largest '//self%name(i)%text, trim(adjustl(text)))
         else if (allocated(self%peak_note)) then
            call add_line(table, 'peak '//self%name(i)%text, trim(adjustl(text))// &
                          self%peak_note(i)%text)
         else
            call add_line(table, 'peak '//self%name(i)%text, trim(adjustl(text)))
         end if
      end do
      if (size(self%name) > max_shown .and. .not. (allocated(self%mode) .or. &
                                                   self%is_controlled)) then
         call add_line(table, '...', to_text(size(self%name) - max_shown)// &
                       ' more in the result file')
      end if
      if (any(self%verdicts > 0)) then
         call add_line(table, 'stability', to_text(self%verdicts(verdict_stable))//' stable, '// &
                       to_text(self%verdicts(verdict_unstable))//' unstable, '// &
                       to_text(self%verdicts(verdict_undecided))//' undecided')
      end if
      if (allocated(self%bifurcation)) then
         do i = 1, size(self%bifurcation)
            call append(table, self%bifurcation(i)%text)
         end do
      end if
      do i = 1, size(self%work)
         call append(table, self%work(i)%text)
      end do
      do i = 1, self%remarks%count()
         call add_line(table, 'remark', self%remarks%text(i)%text)
      end do
      write (text, '(f20.3, a)') seconds, ' s'
      call add_line(table, 'time', trim(adjustl(text)))
   end function lines

   !> A line of the table. No function gives one: gfortran 12 loses the texts of results of such a
   !> type within array constructors and expressions, which is memory.
   pure subroutine add_line(table, label, value)
      type(string_type), allocatable, intent(inout) :: table(:)
      character(*), intent(in) :: label, value
      character(18) :: column

      column = label
      if (len(label) >= len(column)) then
         call append(table, label//' '//value)
      else
         call append(table, column//value)
      end if
   end subroutine add_line

end module fw_summary
