!> Analysis 'mode': a nonlinear mode over its amplitude, its limit cycles, and responses near its
!> resonance that are put together from it.
module fw_run_mode
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
   use fw_case, only: case_type
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_continuation, only: arclength_type, branch_point
   use fw_describe, only: describer
   use fw_error, only: error_type, status_stopped
   use fw_kinds, only: wp
   use fw_mode_apart, only: begin_apart
   use fw_mode_branching, only: branch_watch
   use fw_mode_cycles, only: cycle_finder
   use fw_mode_group, only: mode_row, mode_table
   use fw_mode_options, only: control_observed
   use fw_mode_onset, only: onset_finder
   use fw_mode_path, only: mode_path
   use fw_mode_remarks, only: remark_internal, remark_jump, remark_no_onset
   use fw_mode_start, only: mode_start, node
   use fw_mode_synthesis, only: synthesize
   use fw_newton, only: solver_report
   use fw_observer, only: observer_type
   use fw_point, only: point_type, served_by_arclength, served_by_newton
   use fw_result, only: result_writer
   use fw_run_state, only: run_state
   use fw_sinks, only: observer_sink, sink_list, summary_sink, writer_sink
   use fw_solver_options, only: continuation_arclength, continuation_natural
   use fw_strategy, only: new_request
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: run_mode, check_mode_case

   !> A curve at work.
   type :: mode_curve
      type(mode_start) :: start
      type(mode_path) :: path
      type(arclength_type) :: branch
      type(mode_table) :: table
      type(sink_list) :: sinks
      type(observer_sink) :: to_observer
      type(cycle_finder) :: cycles
      type(describer) :: about
      type(branch_watch) :: watch
      type(onset_finder) :: onset
      !> ln A of the last row, and the amplitude of a fold below the first one that was passed over.
      real(wp) :: end_p = 0.0_wp, jumped_at = 0.0_wp
      !> Whether there is one at all: of what did not converge nothing is told.
      logical :: begins = .true.
      !> ln A of the first solution, below the lowest amplitude, and its unknowns.
      real(wp) :: first_p = 0.0_wp
      real(wp), allocatable :: first_y(:)
   end type mode_curve

   !> Below this part of the stuck frequency nothing holds the motion any more.
   real(wp), parameter :: lost_frequency = 1.0e-3_wp

contains

   !> What would refuse the case before anything is computed.
   subroutine check_mode_case(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(mode_start), allocatable, target :: start

      allocate (start)
      call start%build(case, error)
   end subroutine check_mode_case

   !> Follow the mode from its lowest to its highest amplitude.
   subroutine run_mode(case, observer, writer, summary, state, error)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(result_writer), intent(inout), target :: writer
      type(summary_type), intent(inout), target :: summary
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(mode_curve), allocatable, target :: curve
      type(writer_sink), target :: to_file
      type(summary_sink), target :: to_summary
      real(wp), allocatable :: y(:)
      character(:), allocatable :: derivatives

      allocate (curve)
      call curve%start%build(case, error)
      if (allocated(error)) return
      call describe_start(curve%start, curve%table)
      to_file%writer => writer
      to_summary%summary => summary
      curve%to_observer%observer => observer
      if (case%mode%continuation == continuation_natural) then
         curve%to_observer%n_points = case%mode%n_points
      end if
      call curve%sinks%add(to_file)
      call curve%sinks%add(to_summary)
      call curve%sinks%add(curve%to_observer)
      call observer%on_start(case%title, curve%to_observer%n_points)
      curve%start%system%interrupt => observer
      curve%start%balance%interrupt => observer
      allocate (y(curve%start%system%n))
      call curve%path%start(curve%start%system, case%solver)
      call follow(case, curve, observer, state, y, error)
      if (.not. allocated(error)) call curve%cycles%find(curve%path, curve%table, error)
      if (.not. allocated(error) .and. .not. curve%start%slides) then
         call curve%onset%find(curve%path, curve%table%onset_amplitude, error)
      end if
      if (allocated(error)) then
         if (error%status == status_stopped) then
            deallocate (error)
            state%was_stopped = .true.
            state%is_incomplete = .true.
         end if
      end if
      call observer%on_end()
      if (allocated(error)) return
      call remark_internal(curve%start, curve%table, summary%remarks)
      call curve%watch%remark(summary%remarks)
      call remark_jump(curve%jumped_at, case%mode%start, summary%remarks)
      if (state%is_incomplete .and. curve%begins .and. curve%start%problem%n_pairs > 0 .and. &
          ieee_is_nan(curve%table%onset_amplitude)) then
         call remark_no_onset(exp(curve%end_p), case%mode%end, summary%remarks)
      end if
      call synthesize(case%mode%synthesis, curve%table)
      call writer%add(curve%table, error)
      call summary%describe_work(curve%start%balance, curve%path%newton%linear, case%solver%kind, &
                                 state%all_converged())
      call curve%about%sensitivity%describe(derivatives)
      call summary%describe_sensitivity(derivatives)
      call curve%about%sensitivity%remark(case, curve%start%balance, summary%remarks)
      if (curve%begins) then
         call summary%describe_mode(curve%table, case%model%observe_name(1)%text, &
                                    case%mode%control == control_observed, case%mode%end)
      end if
   end subroutine run_mode

   subroutine describe_start(start, table)
      type(mode_start), intent(in) :: start
      type(mode_table), intent(inout) :: table

      table%number = start%number
      table%stuck_omega = start%omega
      table%stuck_damping_ratio = 0.5_wp*start%self_excitation/start%omega
      table%slides = start%slides
      if (.not. start%slides) table%onset_amplitude = ieee_value(1.0_wp, ieee_quiet_nan)
   end subroutine describe_start

   !> Up to the lowest amplitude from where the stuck mode is exact, then along the curve.
   subroutine follow(case, curve, observer, state, y, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      class(observer_type), intent(inout), target :: observer
      type(run_state), intent(inout) :: state
      real(wp), intent(inout), contiguous :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: reached

      call curve%about%start_clock()
      call begin(case, curve, y, report, error)
      if (allocated(error)) return
      if (report%converged) then
         call curve%path%reach(log(case%mode%start), y, report, reached, error)
         if (allocated(error)) return
         if (.not. report%converged) call jump(case, curve, y, report, reached, error)
         if (allocated(error)) return
      end if
      if (.not. report%converged) then
         call add_row(case, curve, y, report, served_by_newton, state, error)
         state%is_incomplete = .true.
         curve%begins = .false.
         call observer%on_message('the first point did not converge: no curve to follow')
      else if (case%mode%continuation == continuation_arclength) then
         call along_branch(case, curve, observer, state, y, report, error)
      else
         call along_amplitudes(case, curve, observer, state, y, report, error)
      end if
   end subroutine follow

   !> Over a fold below the lowest amplitude, which is not of the curve that was asked for: by long
   !> steps, from where it began.
   subroutine jump(case, curve, y, report, reached, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(inout) :: report
      real(wp), intent(inout) :: reached
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: longer(2) = [0.5_wp, huge(1.0_wp)]
      real(wp) :: leash
      integer :: k

      curve%jumped_at = exp(reached)
      leash = curve%path%leash
      do k = 1, size(longer)
         curve%path%leash = longer(k)
         call curve%path%restart(curve%first_p, curve%first_y)
         call curve%path%reach(log(case%mode%start), y, report, reached, error)
         if (allocated(error) .or. report%converged) exit
      end do
      curve%path%leash = leash
      if (report%converged) call curve%path%restart(reached, y)
   end subroutine jump

   !> The first solution, below the onset.
   subroutine begin(case, curve, y, report, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: smaller = 0.1_wp
      integer, parameter :: most_smaller = 8
      real(wp) :: amplitude
      real(wp), allocatable :: mu(:)
      integer :: k

      mu = spread(0.0_wp, 1, case%contact%n_pairs)
      if (case%contact%n_pairs > 0) mu = case%contact%mu
      call curve%onset%begin(curve%start%system, curve%start%y, case%mode%start, mu, amplitude)
      ! The sliding mode is the limit of high amplitudes.
      if (curve%start%slides) amplitude = case%mode%end
      do k = 1, most_smaller
         y = curve%start%y
         call curve%path%solve(log(amplitude), y, report, error)
         if (allocated(error)) return
         if (report%converged .and. (curve%start%slides .or. curve%start%problem%n_pairs == 0)) exit
         if (report%converged) then
            if (curve%onset%is_stuck(curve%start%system, y)) exit
         end if
         ! About another position, or springs: nearer to the linear mode.
         amplitude = merge(1.0_wp/smaller, smaller, curve%start%slides)*amplitude
      end do
      if (.not. (report%converged .or. curve%start%slides)) then
         amplitude = case%mode%start
         call begin_apart(curve%path, curve%start%y, amplitude, y, report, error)
         if (allocated(error)) return
      end if
      if (.not. report%converged) return
      call curve%onset%note(curve%start%system, y)
      curve%first_p = log(amplitude)
      curve%first_y = y
      call curve%path%restart(curve%first_p, y)
   end subroutine begin

   !> Points at given amplitudes.
   subroutine along_amplitudes(case, curve, observer, state, y, first, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      class(observer_type), intent(inout), target :: observer
      type(run_state), intent(inout) :: state
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(in) :: first
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: reached
      integer :: before, k

      report = first
      do k = 1, case%mode%n_points
         before = curve%path%iterations
         call curve%path%reach(amplitude_of(case, k), y, report, reached, error)
         if (allocated(error)) return
         if (.not. report%converged .or. is_lost(y)) then
            call end_early(case, observer, state, exp(reached), &
                           'no solution was found beyond')
            return
         end if
         report%iterations = curve%path%iterations - before
         call settle_phase(curve, y, report, error)
         if (.not. allocated(error)) call add_row(case, curve, y, report, served_by_newton, state, &
                                                  error)
         if (allocated(error)) return
      end do
   end subroutine along_amplitudes

   !> ln A of point k: of a list, or evenly spaced, both ends exact.
   pure real(wp) function amplitude_of(case, k) result(p)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      real(wp) :: share

      if (allocated(case%mode%amplitudes)) then
         p = log(case%mode%amplitudes(k))
         return
      end if
      share = real(k - 1, wp)/real(case%mode%n_points - 1, wp)
      p = (1.0_wp - share)*log(case%mode%start) + share*log(case%mode%end)
   end function amplitude_of

   !> Nothing holds the motion where its frequency vanishes.
   pure logical function is_lost(y)
      real(wp), intent(in) :: y(:)

      is_lost = y(size(y) - 1) < lost_frequency
   end function is_lost

   !> Say where the curve ended short of its highest amplitude, and why it may have.
   subroutine end_early(case, observer, state, amplitude, reason)
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout) :: observer
      type(run_state), intent(inout) :: state
      real(wp), intent(in) :: amplitude
      character(*), intent(in) :: reason
      character(:), allocatable :: why

      state%is_incomplete = .true.
      why = 'nothing may hold the structure once all pairs slip'
      if (case%mode%continuation == continuation_natural) why = why//", or the curve folds, "// &
         "which mode%continuation = 'arclength' follows"
      call observer%on_message('the mode ended: '//reason//' the amplitude '//to_text(amplitude)// &
                               ' of '//to_text(case%mode%end)//'; '//why)
   end subroutine end_early

   !> Turn the motion so that the first observed quantity has a positive cosine and no sine, and
   !> solve there: paths that start at rest depend on where the period starts, so that the turned
   !> motion may be no solution, and that near it have another phase again.
   subroutine settle_phase(curve, y, report, error)
      type(mode_curve), intent(inout), target :: curve
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_turns = 8
      type(solver_report) :: again
      real(wp) :: before(size(y))
      integer :: k

      associate (system => curve%start%system)
         if (system%control == control_observed) return
         do k = 1, most_turns
            before = y
            call turn(curve%start, y)
            call system%remember(y)
            call curve%path%solve(log(system%amplitude), y, again, error)
            if (allocated(error)) return
            report%iterations = report%iterations + again%iterations
            if (.not. again%converged) exit
            report%residual = again%residual
            if (again%iterations == 0) exit
         end do
         if (.not. again%converged) then
            ! A solution of another phase, rather than none.
            y = before
            call system%remember(y)
            call curve%path%solve(log(system%amplitude), y, again, error)
            if (allocated(error)) return
            report%converged = again%converged
            if (.not. again%converged) return
         end if
         call curve%path%remember(log(system%amplitude), y)
      end associate
   end subroutine settle_phase

   !> U_n exp(-i n alpha), alpha the phase of the first observed quantity in harmonic 1.
   subroutine turn(start, y)
      type(mode_start), intent(in) :: start
      real(wp), intent(inout), target, contiguous :: y(:)
      complex(wp), allocatable :: amplitude(:, :)
      complex(wp) :: first
      integer :: h, m

      m = start%problem%structure%n_coordinates
      associate (f => start%problem%fourier)
         first = sum(start%system%observed*start%system%motion(y))
         ! At a node its phase is round-off.
         if (.not. abs(first) > node*norm2(abs(start%system%observed))* &
             norm2(abs(start%system%motion(y)))) return
         first = first/abs(first)
         allocate (amplitude(m, f%n_retained))
         call amplitudes_of(f%harmonic, f%column, m, y, m, amplitude)
         do h = 1, f%n_retained
            amplitude(:, h) = conjg(first)**f%harmonic(h)*amplitude(:, h)
         end do
         call coefficients_of(f%harmonic, f%column, m, m, amplitude, y)
      end associate
   end subroutine turn

   !> Points of the branch in the order in which it has them.
   subroutine along_branch(case, curve, observer, state, y, first, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      class(observer_type), intent(inout), target :: observer
      type(run_state), intent(inout) :: state
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(in) :: first
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: found
      type(solver_report) :: report
      logical :: more

      report = first
      call settle_phase(curve, y, report, error)
      if (allocated(error)) return
      associate (branch => curve%branch)
         ! The tangent of the branch takes the whole derivative.
         curve%start%system%reduced = .false.
         branch%options = case%solver
         branch%start = log(case%mode%start)
         branch%finish = log(case%mode%end)
         branch%max_points = case%mode%max_points
         branch%step = 1.0_wp/real(case%mode%n_points - 1, wp)
         ! Nothing of the curve is known beforehand: tongues of internal resonances are narrow.
         branch%longest = min(branch%longest, branch%step)
         call branch%begin(curve%start%system, y, error)
         if (.not. allocated(error)) call add_row(case, curve, y, report, served_by_arclength, &
                                                  state, error)
         do while (.not. allocated(error))
            call branch%next(curve%start%system, found, more, error)
            if (allocated(error) .or. .not. more) exit
            if (is_lost(found%x)) then
               call end_early(case, observer, state, exp(found%p), 'its frequency '// &
                              'vanishes at')
               return
            end if
            call add_turned_row(case, curve, found, state, error)
         end do
         call curve%path%newton%linear%add_work(branch%corrector%linear)
         if (allocated(error)) return
         if (branch%complete) return
         call end_early(case, observer, state, exp(curve%end_p), branch%ending//', at')
      end associate
   end subroutine along_branch

   !> A point of the branch with the phase that results have: the branch itself keeps the one that
   !> it began with.
   subroutine add_turned_row(case, curve, found, state, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      type(branch_point), intent(in) :: found
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp), allocatable :: y(:)
      complex(wp), allocatable :: before(:)

      associate (system => curve%start%system)
         y = found%x
         report = found%report
         before = system%before
         call system%set_parameter(found%p, error)
         if (.not. allocated(error)) call settle_phase(curve, y, report, error)
         if (.not. allocated(error)) call add_row(case, curve, y, report, served_by_arclength, &
                                                  state, error)
         system%before = before
      end associate
   end subroutine add_turned_row

   !> A point of the result from the unknowns at the present amplitude.
   subroutine add_row(case, curve, unknowns, report, served_by, state, error)
      type(case_type), intent(in) :: case
      type(mode_curve), intent(inout), target :: curve
      real(wp), intent(in) :: unknowns(:)
      type(solver_report), intent(in) :: report
      integer, intent(in) :: served_by
      type(run_state), intent(inout) :: state
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point
      type(mode_row) :: row
      real(wp), allocatable :: y(:), q(:), r(:)

      y = unknowns
      associate (system => curve%start%system, balance => curve%start%balance)
         allocate (q(balance%n), r(system%n))
         ! Newton's method has left the system at this point, a branch has gone on.
         if (served_by /= served_by_newton) call system%residual(y, r)
         call system%to_balance(y, q, row%omega, row%self_excitation)
         call curve%about%describe(case, new_request(case, row%omega), &
                                   case%harmonics%n_harmonics, balance, q, report, served_by, &
                                   point, error)
         if (allocated(error)) return
         row%amplitude = system%amplitude
         row%converged = report%converged
         row%modal_amplitude = system%modal_amplitude(y)*system%amplitude
         row%first = point%coefficients(2:3, :)
         point%self_excitation = row%self_excitation
         point%modal_amplitude = row%modal_amplitude
         point%first_harmonic = hypot(row%first(1, :), row%first(2, :))
         row%force = modal_force(curve%start, y)*system%length()/row%modal_amplitude
         if (report%converged) call curve%onset%note(system, y)
         if (report%converged .and. served_by == served_by_newton) then
            call curve%watch%note(system, y)
         end if
         if (report%converged .and. case%sensitivity%is_wanted()) then
            call curve%about%sensitivity%find_mode(case, system, y, point)
         end if
      end associate
      call curve%about%note_seconds(point)
      call curve%sinks%take(point, error)
      if (allocated(error)) return
      call state%note(point)
      curve%end_p = log(row%amplitude)
      call curve%cycles%note(row, unknowns)
      call curve%table%add(row)
   end subroutine add_row

   !> |U_1^H F| for the vibratory load of the case, over the size of the motion.
   real(wp) function modal_force(start, y) result(force)
      type(mode_start), intent(in) :: start
      real(wp), intent(in) :: y(:)

      force = abs(dot_product(start%system%motion(y), start%load))
   end function modal_force

end module fw_run_mode
