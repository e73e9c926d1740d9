!> Analysis 'wear': the joint wears over the cycles at the first frequency of the sweep.
module fw_wear_response
   use fw_analysis, only: analysis, run_type
   use fw_case, only: case_type
   use fw_diagnosis, only: explain_failure
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_hdf5, only: hdf5_file
   use fw_remarks, only: remark_undetermined
   use fw_resonance, only: resonance_type
   use fw_restart_file, only: restart_type
   use fw_restart_rows, only: c_noted
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   use fw_wear_march, only: steady_not_reached, steady_reached, steady_words, wear_march, &
      wear_observer
   use fw_wear_joint, only: stand_at, wear_joint
   use fw_wear_options, only: wear_explicit, wear_pseudo_time
   use fw_wear_recorder, only: friction_energy, mean_friction, wear_recorder
   use fw_wear_group, only: wear_halved, wear_outcome, wear_patches
   use fw_wear_step, only: new_wear_stepper, wear_state
   use fw_wear_system, only: wear_system
   implicit none (type, external)
   private

   public :: remark_steps, wear_analysis

   !> Part of the largest depth by which halved steps may move a profile without a remark.
   real(wp), parameter :: large_change = 2.0e-2_wp

   !> Watches nothing: the march is repeated for its end alone.
   type, extends(wear_observer) :: silent_observer
      !> Who finds vibrations.
      type(wear_recorder), pointer :: recorder => null()
   contains
      procedure :: take => pass_by
      procedure :: find => find_by_recorder
   end type silent_observer

   type, extends(analysis) :: wear_analysis
      private
      class(wear_joint), allocatable :: joint
      type(wear_recorder) :: recorder
      !> Where the run started.
      type(wear_state) :: first
      real(wp) :: first_omega = 0.0_wp
   contains
      procedure :: start
      procedure :: next
      procedure :: conclude
   end type wear_analysis

contains

   subroutine start(self, case, run, error)
      class(wear_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      allocate (self%joint)
      call self%joint%build(case, error, held=self%recorder%finer%held)
      if (.not. allocated(error)) call start_recorder(self%recorder, case, run, error)
      if (allocated(error)) return
      call run%begin_points(case, self, 0)
   end subroutine start

   !> The vibration of the unworn joint, then the march, which hands its rows on by itself: every
   !> accepted step is written as soon as it is known.
   subroutine next(self, case, observer, point, more, error)
      class(wear_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      more = .not. allocated(self%joint%march%ending)
      if (.not. more) return
      call self%joint%solve(case, observer, point, error)
      if (allocated(error)) return
      call remark_undetermined(self%joint%solver%method%undetermined, &
                               self%recorder%run%summary%remarks)
      more = .not. point%converged
      if (more) then
         ! A row marked as not converged, so that the result is not empty.
         call give_up_unworn(self)
      else
         call start_march(self, case, point, error)
         if (.not. allocated(error)) call march_on(self, self%recorder%run%restart, error)
         call self%recorder%restart_rows%close()
      end if
      self%falls_short = .not. self%joint%march%complete
   end subroutine next

   subroutine conclude(self, case, run, error)
      class(wear_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      ! A stop before the first state leaves nothing to tell.
      if (.not. allocated(self%joint%march%ending)) return
      call report_end(self, run%restart, error)
      if (.not. allocated(error) .and. case%wear%check_steps .and. allocated(self%first%x)) then
         ! Last, because it uses the system of the run for itself.
         call compare_halved(self%recorder, self%joint%system, self%joint%march, self%first, &
                             self%first_omega, self%joint%state, error)
      end if
   end subroutine conclude

   !> The rows of a result that is incomplete until the run says otherwise.
   subroutine start_recorder(recorder, case, run, error)
      type(wear_recorder), intent(inout) :: recorder
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(wear_patches) :: patches
      type(wear_outcome) :: outcome

      recorder%case => case
      recorder%run => run
      call recorder%about%start_clock()
      patches%contact => case%contact
      patches%cycles_units = cycles_units(case)
      call run%writer%add(patches, error)
      outcome%steady_state = trim(steady_words(steady_not_reached))
      outcome%ending = 'incomplete'
      if (.not. allocated(error)) call run%writer%add(outcome, error)
   end subroutine start_recorder

   !> From the vibration of the unworn joint, at its resonance where that is to be followed.
   subroutine start_march(self, case, point, error)
      class(wear_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error

      call self%joint%prepare(case, self%recorder%run%observer)
      call self%joint%take_solution(point%residual)
      call self%joint%begin_march(case, point%iterations, error)
      ! Where check_steps starts once more.
      self%first = self%joint%state
      self%first_omega = self%joint%system%vibration%frequency()
   end subroutine start_march

   !> The march to its end, and why it ended.
   subroutine march_on(self, restart, error)
      class(wear_analysis), intent(inout), target :: self
      type(restart_type), intent(in) :: restart
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: reason

      associate (recorder => self%recorder, joint => self%joint)
         call recorder%restart_rows%create(recorder%run%writer%file, recorder%case%contact, &
                                           joint%system%n_vibration(), error)
         if (allocated(error)) return
         if (restart%n_rows > 0) then
            call resume(restart, recorder, joint%system, joint%march, joint%state, error)
         end if
         if (allocated(error)) return
         call joint%march%run(joint%system, joint%state, recorder, error, &
                              resumed=restart%n_rows > 0)
         if (allocated(error) .or. .not. joint%march%gave_up) return
         ! The failure is one at these depths.
         joint%balance%depth = joint%state%x(joint%system%n_vibration() + 1:)
         call explain_failure(joint%balance, joint%solver%method, reason)
         joint%march%ending = joint%march%ending//': '//reason
      end associate
   end subroutine march_on

   !> The result of a joint whose vibration was not found.
   subroutine give_up_unworn(self)
      class(wear_analysis), intent(inout) :: self
      character(:), allocatable :: reason

      call explain_failure(self%joint%balance, self%joint%solver%method, reason)
      self%joint%march%options = self%recorder%case%wear
      self%joint%march%ending = 'nothing was worn: '//reason
   end subroutine give_up_unworn

   !> How the run ended: to the observer, the summary and the result.
   subroutine report_end(self, restart, error)
      class(wear_analysis), intent(inout) :: self
      type(restart_type), intent(in) :: restart
      type(error_type), allocatable, intent(out) :: error
      type(wear_outcome) :: outcome
      character(40) :: text

      associate (joint => self%joint, march => self%joint%march, &
                 recorder => self%recorder, &
                 summary => self%recorder%run%summary)
         call recorder%run%observer%on_message('wear: '//march%ending)
         call summary%describe_work(joint%balance, march%stepper%newton%linear, &
                                    recorder%case%solver%kind, &
                                    recorder%run%state%all_converged())
         write (text, '(es13.6, a, es13.6)') depth_of(joint%system, joint%state), ' after ', &
            joint%state%cycles
         call summary%line('steady state', trim(steady_words(march%steady)))
         call summary%line('largest depth', trim(adjustl(text))//' cycles')
         call summary%line('wear steps', to_text(march%n_steps)//', '// &
                           to_text(march%n_rejected)//' repeated')
         if (march%n_implicit > 0) call summary%line('', to_text(march%n_implicit)// &
                                                     ' of them implicit')
         if (march%n_leaps > 0) call summary%line('', to_text(march%n_leaps)// &
                                                  ' of them over what no other step passes')
         if (restart%n_rows > 0) call summary%line('continued', 'after '// &
                                                   to_text(restart%n_rows)//' rows of '// &
                                                   restart%path)
         if (.not. march%gave_up .and. allocated(joint%state%x)) then
            call recorder%finer%look_at_end(recorder%case, march, joint%system, joint%state)
         end if
         call recorder%finer%remark(recorder%case, summary)
         call remark_steps(recorder%case, march, depth_of(joint%system, joint%state), summary)
         call recorder%finer%finish()
         outcome%steady_state = trim(steady_words(march%steady))
         outcome%ending = march%ending
         outcome%counts = [march%n_implicit, march%n_leaps, march%n_jumps]
         call recorder%run%writer%add(outcome, error)
      end associate
   end subroutine report_end

   !> What may be wrong with the steps of a run.
   subroutine remark_steps(case, march, depth, summary)
      type(case_type), intent(in) :: case
      type(wear_march), intent(in) :: march
      !> The largest [length].
      real(wp), intent(in) :: depth
      type(summary_type), intent(inout) :: summary
      !> Explicit steps of a given size end half of one too deep; what others are off has no such
      !> rule: of w' = 1 - w a single step up to 63 % is 7 % off, five are 1 %.
      real(wp), parameter :: fine = 0.02_wp, coarse = 0.2_wp

      if (march%n_jumps > 0) call summary%remarks%add('vibration jumps', 'the vibration jumps '// &
         'in '//to_text(march%n_jumps)//' of the steps, first at cycle '// &
         to_text(march%first_jump)//': the one before it does not exist beyond these depths; '// &
         'which one the joint goes to was looked for without its motion: compare with '// &
         "analysis = 'time' there")
      if (march%n_unsettled > 0) call summary%remarks%add('slip begins', 'in '// &
         to_text(march%n_unsettled)//' steps pairs begin to slip that were stuck, and what '// &
         'they wear depends on the step, however short: compare with wear%check_steps and more '// &
         'harmonics%n_harmonics')
      if (march%n_steps == 0 .or. march%options%controls_error()) return
      if (march%stepper%order > 1) return
      if (case%wear%scheme /= wear_explicit) then
         if (case%wear%check_steps .or. march%options%max_depth_step <= coarse*depth) return
         call summary%remarks%add('steps too long', 'wear%max_depth_step = '// &
            to_text(march%options%max_depth_step)//' is more than a fifth of the depth, '// &
            to_text(depth)//', and nothing estimates the error of such steps: take wear%'// &
            'error_tolerance, or compare with wear%check_steps')
         return
      end if
      if (march%steady /= steady_reached .or. march%options%max_depth_step <= fine*depth) return
      call summary%remarks%add('steps too long', 'explicit steps of wear%max_depth_step = '// &
         to_text(march%options%max_depth_step)//' wear more than the joint would: below a '// &
         'fiftieth of the depth, '//to_text(fine*depth)//', it is about 1 %')
   end subroutine remark_steps

   !> Take over the steps of an earlier run, and stand where it stood after the last of them.
   subroutine resume(restart, recorder, system, march, state, error)
      type(restart_type), intent(in) :: restart
      type(wear_recorder), intent(inout) :: recorder
      type(wear_system), intent(inout) :: system
      type(wear_march), intent(inout) :: march
      !> First state of the case, replaced.
      type(wear_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call restart%check_first(state, error)
      if (allocated(error)) return
      call copy_rows(restart, recorder, error)
      if (allocated(error)) return
      do i = 1, restart%n_rows
         call recorder%count_point(restart%points(i))
      end do
      recorder%n_rows = restart%n_rows
      recorder%depth = restart%state%x(system%n_vibration() + 1:)
      recorder%energy = friction_energy(recorder%case, recorder%depth, mean_friction( &
                                        recorder%case, recorder%case%contact%depth, recorder%depth))
      if (allocated(restart%energy)) recorder%energy = restart%energy
      call recorder%finer%take_notes(restart%control(c_noted:))
      call restart%give_control(march)
      state = restart%state
      call system%set_parameter(restart%omega, error)
      if (allocated(error)) return
      call stand_at(system, state%x)
   end subroutine resume

   !> The rows of the earlier run become the first of this result.
   subroutine copy_rows(restart, recorder, error)
      type(restart_type), intent(in) :: restart
      type(wear_recorder), intent(inout) :: recorder
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: source
      type(error_type), allocatable :: ignored

      ! No file is written: nothing to copy.
      if (recorder%run%writer%file%id < 0) return
      !$omp critical (fretwear_io)
      call source%open_read(restart%path, error)
      !$omp end critical (fretwear_io)
      associate (file => recorder%run%writer%file, n => restart%n_rows)
         if (.not. allocated(error)) call recorder%restart_rows%copy(file, source, n, error)
         if (.not. allocated(error)) call recorder%run%writer%copy_points(source, n, error)
      end associate
      !$omp critical (fretwear_io)
      call source%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine copy_rows

   !> The same march with steps of half the size: how far its profile is from that at the end.
   subroutine compare_halved(recorder, system, march, first, first_omega, state, error)
      type(wear_recorder), intent(inout), target :: recorder
      type(wear_system), intent(inout), target :: system
      type(wear_march), intent(in) :: march
      type(wear_state), intent(in) :: first
      real(wp), intent(in) :: first_omega
      !> At the end of the march.
      type(wear_state), intent(in) :: state
      type(error_type), allocatable, intent(out) :: error
      type(wear_march), target :: halved
      type(silent_observer) :: silent
      type(wear_state) :: end_state
      type(wear_halved) :: profile
      real(wp) :: change
      character(16) :: text
      integer :: n

      if (.not. march%complete) then
         call recorder%run%observer%on_message('check_steps: left out, because the run did not '// &
                                           'come to its end')
         return
      end if
      n = system%n_vibration()
      halved%options = march%options
      call halved%options%halve_steps(march%stepper%order)
      halved%stepper = new_wear_stepper(halved%options, march%stepper%pseudo_scheme, &
                                        march%stepper%newton)
      halved%resonance = resonance_type(n_harmonics=march%resonance%n_harmonics, &
                                        first=march%resonance%first)
      ! From where the run itself began, its frequency included.
      end_state = first
      call system%set_parameter(first_omega, error)
      if (allocated(error)) return
      call stand_at(system, end_state%x)
      silent%recorder => recorder
      call halved%run(system, end_state, silent, error)
      if (allocated(error)) return
      if (.not. halved%complete .or. halved%steady /= march%steady) then
         call recorder%run%observer%on_message('check_steps: steps of half the size end '// &
                                               'otherwise: '//halved%ending)
      end if
      if (.not. halved%complete) return
      change = maxval(abs(end_state%x(n + 1:) - state%x(n + 1:)))
      if (change > 0.0_wp) change = change/max(maxval(state%x(n + 1:)), tiny(1.0_wp))
      write (text, '(es9.2)') change
      call recorder%run%summary%line('steps halved', 'profile moves by '//trim(adjustl(text))// &
                                     ' of the largest depth ('//to_text(halved%n_steps)//' steps)')
      if (change > large_change) call recorder%run%summary%remarks%add('profile depends on steps', &
         'steps of half the size move the worn profile by '//to_text(100.0_wp*change)// &
         ' % of its largest depth')
      profile%depth = end_state%x(n + 1:)
      profile%change = change
      call recorder%run%writer%add(profile, error)
   end subroutine compare_halved

   !> Nothing is kept of the states on the way.
   subroutine pass_by(self, march, system, state, iterations, go_on, error)
      class(silent_observer), intent(inout) :: self
      class(wear_march), intent(in) :: march
      type(wear_system), intent(inout) :: system
      type(wear_state), intent(in) :: state
      integer, intent(in) :: iterations
      logical, intent(out) :: go_on
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_march => march, unused_system => system, &
                 unused_state => state, unused_number => iterations)
      end associate
      go_on = .true.
   end subroutine pass_by

   !> As the recorder of the run does.
   subroutine find_by_recorder(self, system, x, found, iterations, error)
      class(silent_observer), intent(inout) :: self
      type(wear_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: found
      integer, intent(out) :: iterations
      type(error_type), allocatable, intent(out) :: error

      call self%recorder%find(system, x, found, iterations, error)
   end subroutine find_by_recorder

   pure function cycles_units(case) result(units)
      type(case_type), intent(in) :: case
      character(6 + 15*count([case%wear%scheme == wear_pseudo_time])) :: units

      units = 'cycles'
      if (case%wear%scheme == wear_pseudo_time) units = 'pseudo-time in cycles'
   end function cycles_units

   !> Largest depth [length]; 0 of a run that came to no state.
   pure real(wp) function depth_of(system, state) result(depth)
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state

      depth = 0.0_wp
      if (allocated(state%x)) depth = maxval(state%x(system%n_vibration() + 1:))
   end function depth_of

end module fw_wear_response
