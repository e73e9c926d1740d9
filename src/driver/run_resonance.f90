!> Analysis 'resonance': a resonance as a function of a parameter.
module fw_run_resonance
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_analysis, only: analysis, run_type
   use fw_case, only: case_type
   use fw_continuation, only: branch_point
   use fw_curve_source, only: curve_source
   use fw_error, only: error_type
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
   use fw_solver_options, only: continuation_arclength
   use fw_strategy, only: new_request, point_request
   use fw_text, only: to_text
   use fw_vibration, only: walk_type
   implicit none (type, external)
   private

   public :: resonance_analysis

   !> The resonance at each value of a parameter, natural or by arc length; it is the source of its
   !> rows.
   type, extends(analysis) :: resonance_analysis
      private
      type(run_type), pointer :: run => null()
      !> The equations of a resonance, the walk to a value, and what is written beside the rows.
      class(resonance_track), allocatable :: track
      type(walk_type) :: walk
      type(resonance_table) :: table
      !> The source along a branch.
      type(resonance_curve), allocatable :: along
      !> Maxima that are corners.
      integer :: n_corners = 0
      logical :: has_begun = .false.
   contains
      procedure :: start
      procedure :: next
      procedure :: conclude
   end type resonance_analysis

   !> The resonance along its branch, through folds over the parameter.
   type, extends(curve_source) :: resonance_curve
      type(resonance_analysis), pointer :: of => null()
   contains
      procedure :: begin
      procedure :: add
      procedure :: close
   end type resonance_curve

   !> By how much another point has to be larger: a phase resonance is not the largest itself.
   real(wp), parameter :: larger = 1.0e-6_wp, larger_by_phase = 0.05_wp

contains

   !> The source: the values in their order, or the branch.
   subroutine start(self, case, run, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      allocate (self%track)
      call self%track%start(case, error)
      if (allocated(error)) return
      self%run => run
      if (case%resonance%continuation == continuation_arclength) then
         allocate (self%along)
         self%along%of => self
         call run%begin_points(case, self%along, 0)
      else
         call run%begin_points(case, self, case%resonance%n_points)
      end if
      call self%track%strategy%level%solver%about%start_clock()
   end subroutine start

   !> The first resonance, and on from there.
   subroutine next(self, case, observer, point, more, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(out) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%has_begun) then
         self%has_begun = .true.
         call find_first(self, case, observer, served_by_newton, point, more, error)
         return
      end if
      more = .not. self%falls_short
      if (.not. more) return
      call next_value(self, case, point, more, error)
      if (.not. (more .or. allocated(error))) call remark_resonance(case, self, observer, error)
   end subroutine next

   !> The resonance at the first value; `more` is false where there is not even a row without one.
   subroutine find_first(self, case, observer, served_by, point, more, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error

      more = .true.
      call self%track%find_first(observer, error)
      if (allocated(error)) return
      if (self%track%outcome%kind == outcome_found) then
         call self%track%begin_walk(self%walk)
         call take_row(case, self, .true., served_by, point, error)
      else
         call find_nothing(self, case, point, more, error)
      end if
   end subroutine find_first

   !> Corners, work and derivatives of the whole run.
   subroutine conclude(self, case, run, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error

      self%table%options = case%resonance
      call run%writer%add(self%table, error)
      associate (level => self%track%strategy%level, linear => self%track%curve%linear, &
                 sensitivity => self%track%strategy%level%solver%about%sensitivity)
         call linear%add_work(level%solver%method%newton%linear)
         call linear%add_work(self%track%curve%newton%linear)
         call linear%add_work(self%track%newton%linear)
         call run%summary%describe_work(level%system, linear, case%solver%kind, &
                                        run%state%all_converged())
         call run%summary%describe_resonance(self%table, case)
         call sensitivity%report(case, level%system, run%summary)
      end associate
   end subroutine conclude

   !> No maximum at the first value: a row without one, and no other.
   subroutine find_nothing(self, case, point, more, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: instants = ", or harmonics%sampling = 'uniform'"
      character(:), allocatable :: place

      self%falls_short = .true.
      associate (track => self%track)
         call name_place(case, track%mover%value, place)
         call self%run%tell('no resonance', 'no resonance to follow at '//place//': '// &
            trim(outcome_words(track%outcome%kind))//'; give &sweep a range with a '// &
            'maximum inside, or more points'//trim(merge(instants, repeat(' ', &
            len(instants)), track%is_located)))
         ! Where nothing moved there is no row either.
         more = track%x(size(track%x)) > 0.0_wp
      end associate
      if (more) call take_row(case, self, .false., served_by_newton, point, error)
   end subroutine find_nothing

   !> Name and value of the parameter.
   subroutine name_place(case, value, text)
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: value
      character(:), allocatable, intent(out) :: text

      text = trim(parameter_words(case%resonance%parameter))//' = '//to_text(value)
   end subroutine name_place

   !> The point at the next of the given values.
   subroutine next_value(self, case, point, more, error)
      class(resonance_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: reached, x(size(self%track%x))

      more = self%table%n < case%resonance%n_points
      if (.not. more) return
      associate (track => self%track, r => case%resonance)
         track%wanted = r%value_of(self%table%n + 1)
         call self%walk%reach(track, r%coordinate_of(track%wanted), x, report, reached, error)
         if (allocated(error)) return
         track%x = x
         reached = r%value_at(reached)
         more = report%converged
         if (more) then
            call take_row(case, self, .true., served_by_newton, point, error)
         else
            call end_early(self, case, reached, trim(outcome_words(track%outcome%kind)))
            ! States are those of the last value that was reached.
            call track%bring(reached, error)
         end if
      end associate
   end subroutine next_value

   !> Say where the resonance was lost short of its last value, and why it may have.
   subroutine end_early(self, case, value, reason)
      class(resonance_analysis), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: value
      character(*), intent(in) :: reason
      character(:), allocatable :: why, place

      self%falls_short = .true.
      why = ''
      if (case%resonance%continuation /= continuation_arclength) why = '; the resonance may '// &
         "fold over the parameter, which condition = 'phase' with continuation = 'arclength' "// &
         'follows, or leave the range of &sweep, from which it may go half its width'
      call name_place(case, value, place)
      call self%run%tell('lost resonance', 'the resonance was lost beyond '//place//' of '// &
                         to_text(case%resonance%end)//': '//reason//why)
   end subroutine end_early

   !> From the first resonance on.
   subroutine begin(self, case, observer, point, more, error)
      class(resonance_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: y(:)

      call find_first(self%of, case, observer, served_by_arclength, point, more, error)
      self%falls_short = self%of%falls_short
      if (allocated(error) .or. self%falls_short) return
      associate (r => case%resonance, track => self%of%track)
         call self%set_out(track%newton%options, [r%coordinate_of(r%start), &
                                                  r%coordinate_of(r%end)], r%n_points, r%max_points)
         self%curve%longest = min(self%curve%longest, self%curve%step)
         allocate (y(size(track%x)))
         call track%phase%pack_point(track%x, y)
         call self%follow(track%phase, y, error)
      end associate
   end subroutine begin

   !> The last attempt may have been elsewhere than the last row.
   subroutine close(self, case, observer, error)
      class(resonance_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error

      associate (of => self%of, curve => self%curve, last => self%of%table%row(self%of%table%n))
         call of%track%newton%linear%add_work(curve%corrector%linear)
         call of%track%restore(last%parameter, error)
         if (allocated(error)) return
         if (.not. curve%complete) call end_early(of, case, last%parameter, curve%ending)
         self%falls_short = of%falls_short
      end associate
      call remark_resonance(case, self%of, observer, error)
   end subroutine close

   !> The other states come to the value of a point first.
   subroutine add(self, case, observer, found, point, more, error)
      class(resonance_curve), intent(inout), target :: self
      type(case_type), intent(in) :: case
      class(observer_type), intent(inout), target :: observer
      type(branch_point), intent(in) :: found
      type(point_type), intent(inout) :: point
      logical, intent(out) :: more
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      associate (unused => observer)
      end associate
      more = .true.
      associate (track => self%of%track)
         call track%phase%set_parameter(found%p, error)
         if (allocated(error)) return
         call track%phase%pack_point(found%x, track%x, back=.true.)
         track%outcome%iterations = found%report%iterations
         track%outcome%residual = found%report%residual
         call track%restore(track%mover%value, error)
         if (allocated(error)) return
         track%curve%x = track%x
         call track%curve%look(done, error)
         if (allocated(error)) return
         call take_row(case, self%of, found%report%converged, served_by_arclength, point, error)
         if (allocated(error)) return
         call track%phase%set_parameter(found%p, error)
      end associate
   end subroutine add

   !> A point of the result from the present resonance.
   subroutine take_row(case, self, converged, served_by, point, error)
      type(case_type), intent(in) :: case
      class(resonance_analysis), intent(inout), target :: self
      logical, intent(in) :: converged
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      type(resonance_row) :: row
      type(solver_report) :: report
      type(point_request) :: request
      real(wp), allocatable :: r(:)
      integer :: n

      associate (track => self%track, system => self%track%strategy%level%system, &
                 about => self%track%strategy%level%solver%about)
         n = system%n
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
      if (converged .and. self%track%outcome%is_corner) self%n_corners = self%n_corners + 1
      call self%table%add(row)
   end subroutine take_row

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
   subroutine remark_resonance(case, self, observer, error)
      type(case_type), intent(in) :: case
      class(resonance_analysis), intent(inout), target :: self
      class(observer_type), intent(inout), target :: observer
      type(error_type), allocatable, intent(out) :: error

      associate (remarks => self%run%summary%remarks)
         if (self%n_corners > 0) call remarks%add('corner at the resonance', 'at '// &
            to_text(self%n_corners)//' of '//to_text(self%table%n)//' points the response has '// &
            'a corner at its maximum (a pair changes its state there, or contact is decided '// &
            'at instants): frequencies are good to a millionth, and have no derivative')
         call remark_optimum(case, self%table, remarks)
         call remark_other_peak(case, self%track, self%table, observer, remarks, error)
      end associate
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
