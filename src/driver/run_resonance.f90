!> Analysis 'resonance': a resonance as a function of a parameter.
module fw_run_resonance
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_error, only: error_type, status_stopped
   use fw_kinds, only: pi, wp
   use fw_model, only: model_type
   use fw_newton, only: solver_report
   use fw_observer, only: observer_type
   use fw_parameters, only: parameter_words
   use fw_point, only: point_type, served_by_arclength, served_by_newton
   use fw_resonance_group, only: resonance_row, resonance_table
   use fw_resonance_options, only: condition_phase
   use fw_resonance_search, only: outcome_found, outcome_words
   use fw_resonance_track, only: resonance_track
   use fw_remarks, only: remark_list
   use fw_result, only: result_writer
   use fw_run_state, only: run_state
   use fw_sinks, only: observer_sink, sink_list, summary_sink, writer_sink
   use fw_solver_options, only: continuation_arclength
   use fw_strategy, only: new_request, point_request
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: run_resonance

   !> A track at work.
   type :: resonance_run
      type(resonance_track) :: track
      type(resonance_table) :: table
      type(sink_list) :: sinks
      type(observer_sink) :: to_observer
      !> Maxima that are corners.
      integer :: n_corners = 0
   end type resonance_run

   !> By how much another point has to be larger: a phase resonance is not the largest itself.
   real(wp), parameter :: larger = 1.0e-6_wp, larger_by_phase = 0.05_wp

contains

   !> Follow the resonance from the first value to the last.
   subroutine run_resonance(case, observer, writer, summary, state, error)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(resonance_run), allocatable, target :: run
      type(writer_sink), target :: to_file
      type(summary_sink), target :: to_summary
      character(:), allocatable :: derivatives

      allocate (run)
      call run%track%start(case, error)
      if (allocated(error)) return
      to_file%writer => writer
      to_summary%summary => summary
      run%to_observer%observer => observer
      if (case%resonance%continuation /= continuation_arclength) then
         run%to_observer%n_points = case%resonance%n_points
      end if
      call run%sinks%add(to_file)
      call run%sinks%add(to_summary)
      call run%sinks%add(run%to_observer)
      call observer%on_start(case%title, run%to_observer%n_points)
      call run%track%strategy%level%solver%about%start_clock()
      call follow(case, run, observer, summary, state, error)
      if (allocated(error)) then
         if (error%status == status_stopped) then
            deallocate (error)
            state%was_stopped = .true.
            state%is_incomplete = .true.
         end if
      end if
      call observer%on_end()
      if (allocated(error)) return
      run%table%options = case%resonance
      call writer%add(run%table, error)
      associate (level => run%track%strategy%level)
         call run%track%curve%linear%add_work(level%solver%method%newton%linear)
         call run%track%curve%linear%add_work(run%track%curve%newton%linear)
         call run%track%curve%linear%add_work(run%track%newton%linear)
         call summary%describe_work(level%system, run%track%curve%linear, case%solver%kind, &
                                    state%all_converged())
      end associate
      call summary%describe_resonance(run%table, case)
      associate (solver => run%track%strategy%level%solver%about%sensitivity, &
                 system => run%track%strategy%level%system)
         call solver%describe(derivatives)
         call summary%describe_sensitivity(derivatives)
         call solver%remark(case, system, summary%remarks)
      end associate
   end subroutine run_resonance

   !> The first resonance, and on from there.
   subroutine follow(case, run, observer, summary, state, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      class(observer_type), intent(inout), target :: observer
      type(summary_type), intent(inout) :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: instants = ", or harmonics%sampling = 'uniform'"
      character(:), allocatable :: place

      call run%track%find_first(observer, error)
      if (allocated(error)) return
      if (run%track%outcome%kind /= outcome_found) then
         call name_place(case, run%track%mover%value, place)
         call tell('no resonance', 'no resonance to follow at '//place//': '// &
                   trim(outcome_words(run%track%outcome%kind))//'; give &sweep a range with a '// &
                   'maximum inside, or more points'//trim(merge(instants, repeat(' ', &
                   len(instants)), run%track%is_located)), observer, summary)
         state%is_incomplete = .true.
         call add_row(case, run, .false., served_by_newton, state, error)
         return
      end if
      if (case%resonance%continuation == continuation_arclength) then
         call along_branch(case, run, observer, summary, state, error)
      else
         call along_values(case, run, observer, summary, state, error)
      end if
      if (.not. allocated(error)) then
         call remark_resonance(case, run, observer, summary%remarks, error)
      end if
   end subroutine follow

   !> What ended the track, at once and beside the result.
   subroutine tell(name, text, observer, summary)
      character(*), intent(in) :: name, text
      class(observer_type), intent(inout) :: observer
      type(summary_type), intent(inout) :: summary

      call observer%on_message(text)
      call summary%remarks%add(name, text)
   end subroutine tell

   !> Name and value of the parameter.
   subroutine name_place(case, value, text)
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: value
      character(:), allocatable, intent(out) :: text

      text = trim(parameter_words(case%resonance%parameter))//' = '//to_text(value)
   end subroutine name_place

   !> Points at given values.
   subroutine along_values(case, run, observer, summary, state, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      class(observer_type), intent(inout), target :: observer
      type(summary_type), intent(inout) :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: reached
      integer :: k

      call add_row(case, run, .true., served_by_newton, state, error)
      do k = 2, case%resonance%n_points
         if (allocated(error)) return
         call run%track%reach(case%resonance%value_of(k), reached, error)
         if (allocated(error)) return
         if (run%track%outcome%kind /= outcome_found) then
            call end_early(case, observer, summary, state, reached, &
                           trim(outcome_words(run%track%outcome%kind)))
            ! States are those of the last value that was reached.
            call run%track%bring(reached, error)
            return
         end if
         call add_row(case, run, .true., served_by_newton, state, error)
      end do
   end subroutine along_values

   !> Say where the resonance was lost short of its last value, and why it may have.
   subroutine end_early(case, observer, summary, state, value, reason)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout) :: observer
      type(summary_type), intent(inout) :: summary
      type(run_state), intent(inout) :: state
      real(wp), intent(in) :: value
      character(*), intent(in) :: reason
      character(:), allocatable :: why, place

      state%is_incomplete = .true.
      why = ''
      if (case%resonance%continuation /= continuation_arclength) why = '; the resonance may '// &
         "fold over the parameter, which condition = 'phase' with continuation = 'arclength' "// &
         'follows, or leave the range of &sweep, from which it may go half its width'
      call name_place(case, value, place)
      call tell('lost resonance', 'the resonance was lost beyond '//place//' of '// &
                to_text(case%resonance%end)//': '//reason//why, observer, summary)
   end subroutine end_early

   !> Points of the branch in the order in which it has them.
   subroutine along_branch(case, run, observer, summary, state, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      class(observer_type), intent(inout), target :: observer
      type(summary_type), intent(inout) :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(arclength_type) :: branch
      type(branch_point) :: found
      real(wp) :: y(size(run%track%x))
      logical :: more

      call add_row(case, run, .true., served_by_arclength, state, error)
      if (allocated(error)) return
      associate (r => case%resonance, track => run%track)
         branch%options = track%newton%options
         branch%start = r%coordinate_of(r%start)
         branch%finish = r%coordinate_of(r%end)
         branch%max_points = r%max_points
         branch%step = 1.0_wp/real(r%n_points - 1, wp)
         branch%longest = min(branch%longest, branch%step)
         call track%phase%pack_point(track%x, y)
         call branch%begin(track%phase, y, error)
         do while (.not. allocated(error))
            call branch%next(track%phase, found, more, error)
            if (allocated(error) .or. .not. more) exit
            call track%phase%set_parameter(found%p, error)
            if (allocated(error)) exit
            call track%phase%pack_point(found%x, track%x, back=.true.)
            track%outcome%iterations = found%report%iterations
            track%outcome%residual = found%report%residual
            call add_branch_row(case, run, found, state, error)
         end do
         call track%newton%linear%add_work(branch%corrector%linear)
         if (allocated(error)) return
         ! The last attempt may have been elsewhere.
         associate (last => run%table%row(run%table%n)%parameter)
            call track%restore(last, error)
            if (allocated(error) .or. branch%complete) return
            call end_early(case, observer, summary, state, last, branch%ending)
         end associate
      end associate
   end subroutine along_branch

   !> The other states come to the value of a point first.
   subroutine add_branch_row(case, run, found, state, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      type(branch_point), intent(in) :: found
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      associate (track => run%track)
         call track%restore(track%mover%value, error)
         if (allocated(error)) return
         track%curve%x = track%x
         call track%curve%look(done, error)
         if (allocated(error)) return
         call add_row(case, run, found%report%converged, served_by_arclength, state, error)
         if (allocated(error)) return
         call track%phase%set_parameter(found%p, error)
      end associate
   end subroutine add_branch_row

   !> A point of the result from the present resonance.
   subroutine add_row(case, run, converged, served_by, state, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      logical, intent(in) :: converged
      integer, intent(in) :: served_by
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      type(resonance_row) :: row
      type(solver_report) :: report
      type(point_request) :: request
      real(wp), allocatable :: r(:)
      integer :: n

      associate (track => run%track, system => run%track%strategy%level%system, &
                 about => run%track%strategy%level%solver%about)
         n = system%n
         if (track%x(n + 1) <= 0.0_wp) return
         call system%set_frequency(track%x(n + 1), error)
         if (allocated(error)) return
         allocate (r(n))
         call system%residual(track%x(:n), r)
         report%converged = converged
         report%residual = norm2(r)/system%reference
         report%iterations = track%iterations
         track%iterations = 0
         request = new_request(case, track%x(n + 1))
         call about%describe(case, request, case%harmonics%n_harmonics, system, track%x(:n), &
                             report, served_by, point, error)
         if (allocated(error)) return
         row%parameter = track%mover%value
         row%omega = point%omega
         row%converged = converged
         row%first_harmonic = norm2(point%coefficients(2:3, 1))
         row%value = track%curve%q%value
         row%phase = phase_of(track%mover%case%model, point)
         row%curvature = ieee_value(1.0_wp, ieee_quiet_nan)
         if (converged) row%curvature = track%curve%curvature()
         if (converged .and. request%sensitivity) then
            call differentiate(track, point, error)
            if (allocated(error)) return
         end if
         call about%note_seconds(point)
      end associate
      if (converged .and. run%track%outcome%is_corner) run%n_corners = run%n_corners + 1
      call run%sinks%take(point, error)
      if (allocated(error)) return
      call state%note(point)
      call run%table%add(row)
   end subroutine add_row

   !> Derivatives along the resonance.
   subroutine differentiate(track, point, error)
      type(resonance_track), intent(inout), target :: track
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: by_omega(:), omega_by(:), unused(:)
      logical :: done

      associate (case => track%mover%case, level => track%strategy%level, &
                 solver => track%strategy%level%solver%about%sensitivity, n => size(track%x) - 1)
         call solver%renew(case)
         call solver%find(case, level%system, track%x(:n), point, error)
         if (allocated(error)) return
         allocate (omega_by(size(solver%finder%parameters)))
         allocate (unused, mold=omega_by)
         ! Along the response first: the phase takes the state, which the curve has factored for.
         call track%curve%rows_by_frequency(solver%finder, by_omega, error)
         if (allocated(error)) return
         if (case%resonance%condition == condition_phase) then
            call track%phase%move_parameters(track%x, solver%finder%parameters, &
                                             track%newton%linear, omega_by, done, error)
         else
            call track%curve%move_parameters(solver%finder%parameters, omega_by, unused, done, &
                                             error)
         end if
         if (allocated(error)) return
         ! At a corner the frequency has no derivative that a second one would give.
         if (.not. done .or. track%outcome%is_corner) omega_by = ieee_value(1.0_wp, ieee_quiet_nan)
         call solver%follow(case, by_omega, omega_by, point)
      end associate
   end subroutine differentiate

   !> How far the first observed quantity is behind the load, in harmonic 1, where this is largest
   !> [rad], in (-pi, pi].
   pure real(wp) function phase_of(model, point) result(phase)
      type(model_type), intent(in) :: model
      type(point_type), intent(in) :: point
      complex(wp) :: load(size(model%load_cosine))
      integer :: i, w

      load = cmplx(model%load_cosine, -model%load_sine, wp)
      do w = 1, model%waves%n_waves()
         if (model%waves%harmonic(w) /= 1) cycle
         load = load + model%waves%factor(w, 1, point%omega)* &
                cmplx(model%load_wave(:, 2*w - 1), -model%load_wave(:, 2*w), wp)
      end do
      phase = 0.0_wp
      if (size(load) == 0) return
      i = maxloc(abs(load), dim=1)
      if (.not. abs(load(i)) > 0.0_wp) return
      associate (u => cmplx(point%coefficients(2, 1), -point%coefficients(3, 1), wp))
         if (abs(u) > 0.0_wp) phase = atan2(aimag(load(i)*conjg(u)), real(load(i)*conjg(u), wp))
      end associate
      if (phase <= -pi) phase = phase + 2.0_wp*pi
   end function phase_of

   !> What the resonance makes worth saying, after the last point.
   subroutine remark_resonance(case, run, observer, remarks, error)
      type(case_type), intent(in) :: case
      type(resonance_run), intent(inout), target :: run
      class(observer_type), intent(inout), target :: observer
      type(remark_list), intent(inout) :: remarks
      type(error_type), allocatable, intent(out) :: error

      if (run%n_corners > 0) call remarks%add('corner at the resonance', 'at '// &
         to_text(run%n_corners)//' of '//to_text(run%table%n)//' points the response has a '// &
         'corner at its maximum (a pair changes its state there, or contact is decided at '// &
         'instants): frequencies are good to a millionth, and have no derivative')
      call remark_optimum(case, run%table, remarks)
      call remark_other_peak(case, run%track, run%table, observer, remarks, error)
   end subroutine remark_resonance

   !> The smallest value where it is no end.
   subroutine remark_optimum(case, table, remarks)
      type(case_type), intent(in) :: case
      type(resonance_table), intent(in) :: table
      type(remark_list), intent(inout) :: remarks
      integer :: k

      if (table%n < 3) return
      associate (row => table%row(:table%n))
         k = minloc(row%value, dim=1)
         if (k == 1 .or. k == table%n) return
         call remarks%add('optimum', 'the resonance is smallest near '// &
                          trim(parameter_words(case%resonance%parameter))//' = '// &
                          to_text(row(k)%parameter)//' ('//to_text(row(k)%value)//' at '// &
                          to_text(row(k)%omega)//' rad/s)')
      end associate
   end subroutine remark_optimum

   !> A sweep at the last value shows whether the peak that was followed still is the largest.
   subroutine remark_other_peak(case, track, table, observer, remarks, error)
      type(case_type), intent(in) :: case
      type(resonance_track), intent(inout), target :: track
      type(resonance_table), intent(in) :: table
      class(observer_type), intent(inout), target :: observer
      type(remark_list), intent(inout) :: remarks
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)
      real(wp) :: value, margin

      call track%sweep(observer, x, value, error)
      if (allocated(error) .or. .not. allocated(x)) return
      margin = larger
      if (case%resonance%condition == condition_phase) margin = larger_by_phase
      associate (last => table%row(table%n))
         if (value <= (1.0_wp + margin)*last%value) return
         call remarks%add('another peak', 'at '// &
                          trim(parameter_words(case%resonance%parameter))//' = '// &
                          to_text(last%parameter)//' the sweep is larger at '// &
                          to_text(x(size(x)))//' rad/s ('//to_text(value)//') than at the '// &
                          'resonance that was followed ('//to_text(last%value)//' at '// &
                          to_text(last%omega)//' rad/s): another peak has become the largest')
      end associate
   end subroutine remark_other_peak

end module fw_run_resonance
