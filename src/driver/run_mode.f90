!> Analysis 'mode': a nonlinear mode over its amplitude, its limit cycles, and responses near its
!> resonance that are put together from it.
module fw_run_mode
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_analysis, only: analysis, run_type
   use fw_case, only: case_type
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_continuation, only: branch_point
   use fw_curve_source, only: curve_source
   use fw_describe, only: describer
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mode_apart, only: begin_apart
   use fw_mode_branching, only: branch_watch
   use fw_mode_cycles, only: cycle_finder, synthesize
   use fw_mode_group, only: mode_row, mode_table, onset_every
   use fw_mode_options, only: control_observed
   use fw_mode_onset, only: onset_finder
   use fw_nonlinear_mode, only: mode_path
   use fw_mode_remarks, only: remark_internal, remark_jump, remark_onset
   use fw_mode_start, only: mode_start, node
   use fw_newton, only: solver_report
   use fw_observer, only: observer_type
   use fw_point, only: point_type, served_by_arclength, served_by_newton
   use fw_solver_options, only: continuation_arclength, continuation_natural
   use fw_strategy, only: new_request
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: mode_analysis

   !> A nonlinear mode over its amplitude, natural or by arc length; it is the source of its rows.
   type, extends(analysis) :: mode_analysis
      private
      type(run_type), pointer :: run => null()
      type(mode_start) :: at_rest
      type(mode_path) :: path
      !> The source along a branch.
      type(mode_curve), allocatable :: along
      type(mode_table) :: table
      type(cycle_finder) :: cycles
      type(describer) :: about
      type(branch_watch) :: watch
      type(onset_finder) :: onset
      !> ln A of the last row, and the amplitude of a fold below the first one that was passed over.
      real(wp) :: end_p = 0.0_wp, jumped_at = 0.0_wp
      !> Whether there is one at all: of what did not converge nothing is told.
      logical :: begins = .true.
      !> The present unknowns, and how they were found.
      real(wp), allocatable :: y(:)
      type(solver_report) :: report
      !> ln A of the first solution, below the lowest amplitude, and its unknowns.
      real(wp) :: first_p = 0.0_wp
      real(wp), allocatable :: first_y(:)
   contains
      procedure :: start
      procedure :: check
      procedure :: next
      procedure :: conclude
   end type mode_analysis

   !> The mode along its branch, through folds over the amplitude.
   type, extends(curve_source) :: mode_curve
      type(mode_analysis), pointer :: of => null()
   contains
      procedure :: begin => begin_branch
      procedure :: add => add_branch_point
      procedure :: close => close_branch
   end type mode_curve

   !> Below this part of the stuck frequency nothing holds the motion any more.
   real(wp), parameter :: lost_frequency = 1.0e-3_wp

contains

   !> The mode at rest.
   subroutine check(self, case, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call self%at_rest%build(case, error)
   end subroutine check

   !> The mode at rest, then the source: the amplitudes in their order, or the branch.
   subroutine start(self, case, run, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      call self%check(case, error)
      if (allocated(error)) return
      self%run => run
      call describe_start(self%at_rest, self%table)
      if (case%mode%continuation == continuation_natural) then
         call run%begin_points(case, self, case%mode%n_points)
      else
         allocate (self%along)
         self%along%of => self
         call run%begin_points(case, self%along, 0)
      end if
      self%at_rest%system%interrupt => run%observer
      self%at_rest%balance%interrupt => run%observer
      allocate (self%y(self%at_rest%system%n))
      call self%path%start(self%at_rest%system, case%solver)
      call self%about%start_clock()
   end subroutine start

   !> From amplitude to amplitude.
   subroutine next(self, case, observer, point, more, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      more = self%begins
      if (more .and. self%table%n == 0) then
         call follow(self, case, observer, point, error)
         if (allocated(error) .or. .not. self%begins) return
      end if
      if (more) call next_amplitude(self, case, point, more, error)
      if (.not. (more .or. allocated(error))) call look_behind(self, case, error)
   end subroutine next

   !> Behind the last row limit cycles and the onset of slip are looked for.
   subroutine look_behind(self, case, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call self%cycles%find(self%path, self%table, error)
      if (allocated(error) .or. self%at_rest%slides) return
      call self%onset%find(self%path, case%mode%end, .not. self%falls_short, self%table%onset, &
                           error)
   end subroutine look_behind

   !> The onset of slip, the response that the mode makes, and remarks on where the curve ended.
   subroutine conclude(self, case, run, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      associate (remarks => run%summary%remarks, balance => self%at_rest%balance)
         call remark_internal(self%at_rest, self%table, remarks)
         call self%watch%remark(remarks)
         call remark_jump(self%jumped_at, case%mode%start, remarks)
         if (self%begins .and. balance%problem%n_pairs > 0) then
            call remark_onset(self%table%onset, run%state%is_incomplete, exp(self%end_p), &
                              case%mode%end, remarks)
         end if
         call synthesize(case%mode%synthesis, self%table)
         call run%writer%add(self%table, error)
         call run%summary%describe_work(balance, self%path%mode%newton%linear, case%solver%kind, &
                                        run%state%all_converged())
         call self%about%sensitivity%report(case, balance, run%summary)
      end associate
      if (self%begins) then
         call run%summary%describe_mode(self%table, case%model%observe_name(1)%text, &
                                        case%mode%control == control_observed, case%mode%end)
      end if
   end subroutine conclude

   !> The linear mode from which the curve starts.
   subroutine describe_start(start, table)
      type(mode_start), intent(in) :: start
      type(mode_table), intent(inout) :: table

      table%number = start%number
      table%stuck_omega = start%omega
      table%stuck_damping_ratio = 0.5_wp*start%self_excitation/start%omega
      table%slides = start%slides
      table%onset%bound = ieee_value(1.0_wp, ieee_quiet_nan)
      if (start%slides) then
         table%onset%known_by = onset_every
      else
         table%onset%amplitude = ieee_value(1.0_wp, ieee_quiet_nan)
      end if
   end subroutine describe_start

   !> Up to the lowest amplitude from where the stuck mode is exact; a point only where that fails.
   subroutine follow(self, case, observer, point, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: reached

      associate (report => self%report)
         call begin(case, self, self%y, report, error)
         if (allocated(error)) return
         if (report%converged) then
            call self%path%reach(log(case%mode%start), self%y, report, reached, error)
            if (allocated(error)) return
            if (.not. report%converged) call jump(case, self, self%y, report, reached, error)
            if (allocated(error)) return
         end if
         if (report%converged) return
         self%begins = .false.
         self%falls_short = .true.
         call take_row(case, self, self%y, report, served_by_newton, point, error)
         if (.not. allocated(error)) call observer%on_message( &
            'the first point did not converge: no curve to follow')
      end associate
   end subroutine follow

   !> Over a fold below the lowest amplitude, which is not of the curve that was asked for: by long
   !> steps, from where it began.
   subroutine jump(case, curve, y, report, reached, error)
      type(case_type), intent(in) :: case
      class(mode_analysis), intent(inout), target :: curve
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(inout) :: report
      real(wp), intent(inout) :: reached
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: longer(2) = [0.5_wp, huge(1.0_wp)]
      real(wp) :: leash
      integer :: k

      curve%jumped_at = exp(reached)
      leash = curve%path%mode%leash
      do k = 1, size(longer)
         curve%path%mode%leash = longer(k)
         call curve%path%walk%restart(curve%first_p, curve%first_y)
         call curve%path%reach(log(case%mode%start), y, report, reached, error)
         if (allocated(error) .or. report%converged) exit
      end do
      curve%path%mode%leash = leash
      if (report%converged) call curve%path%walk%restart(reached, y)
   end subroutine jump

   !> The first solution, below the onset.
   subroutine begin(case, curve, y, report, error)
      type(case_type), intent(in) :: case
      class(mode_analysis), intent(inout), target :: curve
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
      call curve%onset%begin(curve%at_rest%system, curve%at_rest%y, case%mode%start, mu, amplitude)
      ! The sliding mode is the limit of high amplitudes.
      if (curve%at_rest%slides) amplitude = case%mode%end
      do k = 1, most_smaller
         y = curve%at_rest%y
         call curve%path%solve(log(amplitude), y, report, error)
         if (allocated(error)) return
         if (report%converged .and. (curve%at_rest%slides .or. &
                                     curve%at_rest%problem%n_pairs == 0)) exit
         if (report%converged) then
            if (curve%onset%is_stuck(curve%at_rest%system, y)) exit
         end if
         ! About another position, or springs: nearer to the linear mode.
         amplitude = merge(1.0_wp/smaller, smaller, curve%at_rest%slides)*amplitude
      end do
      if (.not. (report%converged .or. curve%at_rest%slides)) then
         amplitude = case%mode%start
         call begin_apart(curve%path, curve%at_rest%y, amplitude, y, report, error)
         if (allocated(error)) return
      end if
      if (.not. report%converged) return
      call curve%onset%note(curve%at_rest%system, y)
      curve%first_p = log(amplitude)
      curve%first_y = y
      call curve%path%walk%restart(curve%first_p, y)
   end subroutine begin

   !> The point at the next of the given amplitudes.
   subroutine next_amplitude(self, case, point, more, error)
      class(mode_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: reached
      integer :: before

      more = self%table%n < case%mode%n_points
      if (.not. more) return
      associate (report => self%report)
         before = self%path%mode%iterations
         call self%path%reach(amplitude_of(case, self%table%n + 1), self%y, report, reached, error)
         if (allocated(error)) return
         more = report%converged .and. .not. is_lost(self%y)
         if (.not. more) then
            call end_early(self, case, exp(reached), 'no solution was found beyond')
            return
         end if
         report%iterations = self%path%mode%iterations - before
         call settle_phase(self, self%y, report, error)
         if (allocated(error)) return
         call take_row(case, self, self%y, report, served_by_newton, point, error)
      end associate
   end subroutine next_amplitude

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
   subroutine end_early(self, case, amplitude, reason)
      class(mode_analysis), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: amplitude
      character(*), intent(in) :: reason
      character(:), allocatable :: why

      self%falls_short = .true.
      why = 'nothing may hold the structure once all pairs slip'
      if (case%mode%continuation == continuation_natural) why = why//", or the curve folds, "// &
         "which mode%continuation = 'arclength' follows"
      call self%run%observer%on_message('the mode ended: '//reason//' the amplitude '// &
                                        to_text(amplitude)//' of '//to_text(case%mode%end)// &
                                        '; '//why)
   end subroutine end_early

   !> Turn the motion so that the first observed quantity has a positive cosine and no sine, and
   !> solve there: paths that start at rest depend on where the period starts, so that the turned
   !> motion may be no solution, and that near it have another phase again.
   subroutine settle_phase(curve, y, report, error)
      class(mode_analysis), intent(inout), target :: curve
      real(wp), intent(inout), contiguous :: y(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_turns = 8
      type(solver_report) :: again
      real(wp) :: before(size(y))
      integer :: k

      associate (system => curve%at_rest%system)
         if (system%control == control_observed) return
         do k = 1, most_turns
            before = y
            call turn(curve%at_rest, y)
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
         call curve%path%walk%known%remember(log(system%amplitude), y)
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

   !> The branch from the first solution, which is its first point.
   subroutine begin_branch(self, case, observer, point, more, error)
      class(mode_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      more = .true.
      associate (of => self%of)
         call follow(of, case, observer, point, error)
         self%falls_short = of%falls_short
         if (.not. (allocated(error) .or. of%begins)) call look_behind(of, case, error)
         if (allocated(error) .or. .not. of%begins) return
         call settle_phase(of, of%y, of%report, error)
         if (allocated(error)) return
         ! The tangent of the branch takes the whole derivative.
         of%at_rest%system%reduced = .false.
         call self%set_out(case%solver, log([case%mode%start, case%mode%end]), &
                           case%mode%n_points, case%mode%max_points)
         ! Nothing of the curve is known beforehand: tongues of internal resonances are narrow.
         self%curve%longest = min(self%curve%longest, self%curve%step)
         call self%follow(of%at_rest%system, of%y, error)
         if (allocated(error)) return
         call take_row(case, of, of%y, of%report, served_by_arclength, point, error)
      end associate
   end subroutine begin_branch

   !> A point with the phase that results have: the branch itself keeps the one that it began with.
   subroutine add_branch_point(self, case, observer, found, point, more, error)
      class(mode_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: y(size(found%x))
      complex(wp), allocatable :: before(:)

      associate (unused => observer)
      end associate
      y = found%x
      report = found%report
      more = .not. is_lost(y)
      if (.not. more) then
         call end_early(self%of, case, exp(found%p), 'its frequency vanishes at')
         return
      end if
      associate (system => self%of%at_rest%system)
         before = system%before
         call system%set_parameter(found%p, error)
         if (.not. allocated(error)) call settle_phase(self%of, y, report, error)
         if (.not. allocated(error)) call take_row(case, self%of, y, report, served_by_arclength, &
                                                   point, error)
         system%before = before
      end associate
   end subroutine add_branch_point

   !> Why it ended, unless that was said.
   subroutine close_branch(self, case, observer, error)
      class(mode_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error

      associate (unused => observer)
      end associate
      associate (of => self%of, curve => self%curve)
         if (.not. of%falls_short) then
            call of%path%mode%newton%linear%add_work(curve%corrector%linear)
            if (.not. curve%complete) call end_early(of, case, exp(of%end_p), curve%ending//', at')
         end if
         self%falls_short = of%falls_short
         call look_behind(of, case, error)
      end associate
   end subroutine close_branch

   !> A point of the result from the unknowns at the present amplitude.
   subroutine take_row(case, curve, unknowns, report, served_by, point, error)
      type(case_type), intent(in) :: case
      class(mode_analysis), intent(inout), target :: curve
      real(wp), intent(in) :: unknowns(:)
      type(solver_report), intent(in) :: report
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      type(mode_row) :: row
      real(wp), allocatable :: y(:), q(:), r(:)

      y = unknowns
      associate (system => curve%at_rest%system, balance => curve%at_rest%balance)
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
         row%force = modal_force(curve%at_rest, y)*system%length()/row%modal_amplitude
         if (report%converged) call curve%onset%note(system, y)
         if (report%converged .and. served_by == served_by_newton) then
            call curve%watch%note(system, y)
         end if
         if (report%converged .and. case%sensitivity%is_wanted()) then
            call curve%about%sensitivity%find_mode(case, system, y, point)
         end if
      end associate
      call curve%about%note_seconds(point)
      curve%end_p = log(row%amplitude)
      call curve%cycles%note(row, unknowns)
      call curve%table%add(row)
   end subroutine take_row

   !> |U_1^H F| for the vibratory load of the case, over the size of the motion.
   real(wp) function modal_force(start, y) result(force)
      type(mode_start), intent(in) :: start
      real(wp), intent(in) :: y(:)

      force = abs(dot_product(start%system%motion(y), start%load))
   end function modal_force

end module fw_run_mode
