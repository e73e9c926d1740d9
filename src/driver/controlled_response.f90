!> Points of given amplitude (group &control): the load is found with the motion.
!>
!> Started from the points before, from the linear solution scaled to the amplitude, and where these
!> fail along a path: from the last solution by halves of the way, or from a small amplitude up.
module fw_controlled_response
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_control_options, only: of_first_harmonic
   use fw_control_system, only: control_system, new_control_system
   use fw_describe, only: describer
   use fw_error, only: error_type
   use fw_guess, only: free_guess, stuck_guess
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_newton, only: solver_report
   use fw_point, only: point_type, served_by_free_guess, served_by_newton, served_by_none, &
      served_by_other_guess, served_by_raised_load, served_by_smaller_steps
   use fw_problem, only: build_system
   use fw_remarks, only: remark_list, remark_undetermined
   use fw_run_state, only: run_state
   use fw_solution, only: solution_method
   use fw_strategy, only: point_request, point_strategy
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: controlled_response
   ! For its submodule alone.
   public :: attempt, ends, from_guesses, make_guess, remember

   !> A solution to go on from.
   type :: known_point
      logical :: is_known = .false.
      !> The frequency, or the value of the parameter that the response goes along.
      real(wp) :: place = 0.0_wp
      real(wp) :: amplitude = 0.0_wp
      !> Unknowns of the balance, then the scale of the load.
      real(wp), allocatable :: y(:)
   end type known_point

   type, extends(point_strategy) :: controlled_response
      type(balance_problem) :: problem
      type(balance_state) :: system
      type(control_system) :: control
      type(solution_method) :: method
      type(describer) :: about
      !> load%harmonic_scale of the case.
      real(wp) :: base = 1.0_wp
      !> Whether loads change their sign half a period later.
      logical :: can_turn = .true.
      !> The last two solutions, and the first of an amplitude.
      type(known_point) :: last, before, head
      integer :: iterations = 0, served_by = served_by_none
      !> The present point cannot be: what is observed rests where the load acts.
      logical :: is_node = .false.
      !> Where no load gives the present amplitude: the largest that one does, and the amplitudes on
      !> both sides of a jump with its load; 0 where that is not so.
      real(wp) :: limit = 0.0_wp, jump(3) = 0.0_wp
      !> Points that were not found, and no reason was either.
      integer :: n_unexplained = 0
      !> What of the amplitude stands still in the linear solution, under static loads.
      real(wp) :: rest = 0.0_wp
      !> Largest vibratory load [force], 0 where it is not known so, and what holds and what carries
      !> the place that is observed, of the model alone [force/length, mass].
      real(wp) :: force = 0.0_wp, held_by = 0.0_wp, carried = 0.0_wp
      real(wp), allocatable :: y(:), r(:)
      !> Which of the guesses led to the last solution.
      integer :: guess = 0
      !> Points where other loads gave the same amplitude, and the first of them with two loads.
      integer :: n_others = 0
      type(point_request) :: other_at
      real(wp) :: other_loads(2) = 0.0_wp
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: describe_point
      procedure :: remark
      procedure :: turn_to_positive
   end type controlled_response

   ! Ways to a point that its guesses do not reach (fw_control_ways, fw_control_load).
   interface
      !> First half of the way from the last point, which may take halves of its own, then the rest.
      recursive module subroutine approach(self, place, amplitude, depth, report, error)
         class(controlled_response), intent(inout) :: self
         real(wp), intent(in) :: place, amplitude
         integer, intent(in) :: depth
         type(solver_report), intent(out) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine approach

      !> From a small amplitude up, by steps that adapt.
      module subroutine raise_amplitude(self, place, amplitude, report, error)
         class(controlled_response), intent(inout) :: self
         real(wp), intent(in) :: place, amplitude
         type(solver_report), intent(out) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine raise_amplitude

      !> The largest of a period has corners where another instant takes over, which the first
      !> harmonic has not: to where the one has the amplitude along the other, by secants.
      module subroutine by_first_harmonic(self, place, amplitude, report, error)
         class(controlled_response), intent(inout) :: self
         real(wp), intent(in) :: place, amplitude
         type(solver_report), intent(out) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine by_first_harmonic

      !> By responses to given loads, where friction holds what is observed.
      module subroutine search_loads(self, place, amplitude, report, error)
         class(controlled_response), intent(inout) :: self
         real(wp), intent(in) :: place, amplitude
         !> Of the ways before on entry, which stays where none is tried.
         type(solver_report), intent(inout) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine search_loads

      !> Why the amplitude was not found, where that is known; left unallocated otherwise.
      module subroutine explain(self, case, request, note)
         class(controlled_response), intent(in) :: self
         type(case_type), intent(in) :: case
         type(point_request), intent(in) :: request
         character(:), allocatable, intent(inout) :: note
      end subroutine explain

      !> Whether other guesses lead to another load of the same amplitude; the solution stays.
      module subroutine look_for_others(self, request, error)
         class(controlled_response), intent(inout) :: self
         type(point_request), intent(in) :: request
         type(error_type), allocatable, intent(out) :: error
      end subroutine look_for_others
   end interface

   !> An observed quantity below this part of all others rests.
   real(wp), parameter :: at_rest = 1.0e-10_wp
   !> So does one that moves by less than this part of what the largest load would do right there:
   !> round-off of the response, a thousandfold near a resonance.
   real(wp), parameter :: round_off = 1.0e-12_wp
   !> Rounds in which the norm that residuals are compared to follows the load.
   integer, parameter :: most_rounds = 4

contains

   subroutine start(self, case, error)
      class(controlled_response), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call build_system(case, self%problem, self%system, error)
      if (allocated(error)) return
      call self%method%start(case, case%harmonics)
      call new_control_system(self%system, case%control%observed, case%control%of, self%control)
      self%base = case%model%harmonic_scale
      call weigh_place(self, case%model, case%control%observed)
      self%can_turn = .true.
      if (allocated(case%model%waves%harmonic)) then
         self%can_turn = all(modulo(case%model%waves%harmonic, 2) == 1)
      end if
      allocate (self%y(self%control%n), self%r(self%control%n), source=0.0_wp)
   end subroutine start

   !> What a load right at the place that is observed would meet there.
   pure subroutine weigh_place(self, model, observed)
      class(controlled_response), intent(inout) :: self
      type(model_type), intent(in) :: model
      integer, intent(in) :: observed
      real(wp) :: length
      integer :: i, k

      self%force = 0.0_wp
      ! Loads of matrices of nodal diameters are none of dofs, those of powers wait for a frequency.
      if (model%cyclic%has_nodal()) return
      if (allocated(model%waves%power)) then
         if (any(model%waves%power > 0)) return
      end if
      self%force = abs(self%base)*max(maxval(abs(model%load_cosine)), maxval(abs(model%load_sine)))
      if (allocated(model%load_wave)) then
         self%force = max(self%force, abs(self%base)*maxval(abs([0.0_wp, model%load_wave])))
      end if
      ! Sectors that are all solved for observe the same rows, one after the other.
      k = modulo(observed - 1, size(model%observe_matrix, 1)) + 1
      associate (row => model%observe_matrix(k, :))
         length = max(sum(row**2)**2, tiny(1.0_wp))
         self%held_by = sum([(row(i)**2*abs(model%stiffness(i, i)), i=1, size(row))])/length
         self%carried = sum([(row(i)**2*abs(model%mass(i, i)), i=1, size(row))])/length
      end associate
   end subroutine weigh_place

   !> The load and the motion at a frequency and an amplitude.
   subroutine solve(self, case, request, point, error)
      class(controlled_response), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report

      call self%about%start_clock()
      if (allocated(self%note)) deallocate (self%note)
      self%system%interrupt => request%interrupt
      self%control%interrupt => request%interrupt
      self%iterations = 0
      self%is_node = .false.
      self%limit = 0.0_wp
      self%jump = 0.0_wp
      call reach(self, request%place(), request%amplitude, request%fallback, report, error)
      if (report%interrupted .and. .not. allocated(error)) call stop_run(request%interrupt, error)
      if (allocated(error)) return
      if (report%converged .and. request%fallback .and. may_have_others(self)) then
         call look_for_others(self, request, error)
         if (allocated(error)) return
      end if
      report%iterations = self%iterations
      call self%describe_point(case, request, report, self%served_by, point, error)
      if (allocated(error)) return
      if (.not. report%converged) call explain(self, case, request, point%note)
      if (.not. (report%converged .or. allocated(point%note))) then
         self%n_unexplained = self%n_unexplained + 1
      end if
      call self%about%note_seconds(point)
   end subroutine solve

   !> What is known of the solution in y, at the frequency and the amplitude where it was found.
   subroutine describe_point(self, case, request, report, served_by, point, error)
      class(controlled_response), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(solver_report), intent(in) :: report
      integer, intent(in) :: served_by
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = self%system%n
      call self%control%residual(self%y, self%r)
      call self%about%describe(case, request, case%harmonics%n_harmonics, self%system, &
                               self%y(:n), report, served_by, point, error)
      if (allocated(error)) return
      ! Where none was found the last trial is no load, and may be negative.
      point%load_scale = ieee_value(1.0_wp, ieee_quiet_nan)
      if (report%converged) point%load_scale = self%y(n + 1)
      point%control = request%amplitude
      if (report%converged .and. request%sensitivity) then
         call self%about%sensitivity%find_controlled(case, self%control, self%y, point)
      end if
   end subroutine describe_point

   !> Where friction sticks or slips several loads may give one amplitude. A point that goes on from
   !> two of its amplitude is one of the same curve: nothing is learned there.
   pure logical function may_have_others(self)
      class(controlled_response), intent(in) :: self

      associate (forces => self%problem%forces)
         may_have_others = forces%entry(forces%pairs)%law%facts%remembers .and. &
                           self%problem%n_pairs > 0 .and. &
                           .not. (self%guess == 1 .and. self%served_by == served_by_newton)
      end associate
   end function may_have_others

   !> From what is known of the points before, then from linear solutions, then along a path.
   subroutine reach(self, place, amplitude, tries_all, report, error)
      class(controlled_response), intent(inout) :: self
      real(wp), intent(in) :: place, amplitude
      logical, intent(in) :: tries_all
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      self%method%newton%linear%lu_left_out = .false.
      call from_guesses(self, place, amplitude, report, error)
      if (allocated(error) .or. ends(report)) return
      if (.not. tries_all .or. self%is_node) return
      if (self%last%is_known) then
         call approach(self, place, amplitude, 1, report, error)
         self%served_by = served_by_smaller_steps
         if (allocated(error) .or. ends(report)) return
      end if
      call raise_amplitude(self, place, amplitude, report, error)
      self%served_by = served_by_raised_load
      if (allocated(error) .or. ends(report)) return
      if (self%control%of /= of_first_harmonic) then
         call by_first_harmonic(self, place, amplitude, report, error)
         self%served_by = served_by_smaller_steps
         if (allocated(error) .or. ends(report)) return
      end if
      call search_loads(self, place, amplitude, report, error)
      self%served_by = served_by_raised_load
      if (allocated(error) .or. ends(report)) return
      if (.not. self%method%newton%linear%lu_left_out) return
      self%method%newton%linear%lu_follows = .true.
      call from_guesses(self, place, amplitude, report, error)
      self%method%newton%linear%lu_follows = .false.
   end subroutine reach

   !> Nothing more is to be tried.
   pure logical function ends(report)
      type(solver_report), intent(in) :: report

      ends = report%converged .or. report%interrupted
   end function ends

   !> Extrapolated, the nearest solution scaled, all stuck, all free.
   subroutine from_guesses(self, place, amplitude, report, error)
      class(controlled_response), intent(inout) :: self
      real(wp), intent(in) :: place, amplitude
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      integer :: guess
      logical :: is_there

      call self%control%stand(place, error)
      if (allocated(error)) return
      self%control%amplitude = amplitude
      do guess = 1, 4
         call make_guess(self, guess, place, amplitude, is_there, error)
         if (allocated(error)) return
         if (.not. is_there) cycle
         call attempt(self, report, error)
         if (allocated(error)) return
         if (ends(report)) exit
      end do
      if (.not. report%converged) return
      call remember(self, place, amplitude)
      self%guess = guess
      self%served_by = served_by_newton
      if (guess == 3 .and. self%before%is_known) self%served_by = served_by_other_guess
      if (guess == 4) self%served_by = served_by_free_guess
   end subroutine from_guesses

   subroutine make_guess(self, guess, place, amplitude, is_there, error)
      class(controlled_response), intent(inout) :: self
      integer, intent(in) :: guess
      real(wp), intent(in) :: place, amplitude
      logical, intent(out) :: is_there
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: step

      is_there = .true.
      select case (guess)
      case (1)
         is_there = self%before%is_known .and. is_near(self%last, place, amplitude)
         if (is_there) is_there = is_near(self%before, place, amplitude) .and. &
                                  abs(self%last%place - self%before%place) > 0.0_wp
         if (.not. is_there) return
         step = (place - self%last%place)/(self%last%place - self%before%place)
         ! Further than the points are apart, an extrapolation says nothing.
         is_there = abs(step) <= 2.0_wp
         self%y = self%last%y + step*(self%last%y - self%before%y)
      case (2)
         is_there = self%last%is_known
         if (.not. is_there) return
         if (self%head%is_known .and. &
             abs(self%head%place - place) < abs(self%last%place - place)) then
            call scale(self, self%head, amplitude)
         else
            call scale(self, self%last, amplitude)
         end if
      case default
         call self%system%set_parameter(self%base, error)
         if (allocated(error)) return
         if (guess == 3) call stuck_guess(self%system, self%y(:self%system%n))
         if (guess == 4) call free_guess(self%system, self%y(:self%system%n))
         call scale_linear(self, amplitude, guess == 3, is_there)
      end select
   end subroutine make_guess

   !> Whether a point is one of the same amplitude.
   pure logical function is_near(point, place, amplitude)
      type(known_point), intent(in) :: point
      real(wp), intent(in) :: place, amplitude

      is_near = point%is_known .and. abs(point%amplitude - amplitude) <= 0.0_wp .and. &
                abs(point%place - place) > 0.0_wp
   end function is_near

   !> Another amplitude of a solution: its vibration and its load in proportion.
   subroutine scale(self, point, amplitude)
      class(controlled_response), intent(inout) :: self
      type(known_point), intent(in) :: point
      real(wp), intent(in) :: amplitude

      self%y = point%y
      call multiply_vibration(self, amplitude/point%amplitude)
   end subroutine scale

   !> Unknowns above harmonic 0, and the load.
   subroutine multiply_vibration(self, factor)
      class(controlled_response), intent(inout) :: self
      real(wp), intent(in) :: factor
      integer :: first

      first = 1
      ! Harmonic 0 is the first of those retained.
      if (self%problem%fourier%has_constant()) first = self%problem%structure%n_coordinates + 1
      self%y(first:) = factor*self%y(first:)
   end subroutine multiply_vibration

   !> The linear solution under the load of the case, scaled to the amplitude.
   subroutine scale_linear(self, amplitude, stuck, is_there)
      class(controlled_response), intent(inout) :: self
      real(wp), intent(in) :: amplitude
      !> That with stuck pairs, which comes first: keep its static part as that of the response.
      logical, intent(in) :: stuck
      !> False where what is observed rests.
      logical, intent(out) :: is_there
      complex(wp), allocatable :: at_rest_motion(:)
      real(wp) :: vibration, others, static
      integer :: n

      n = self%system%n
      self%y(n + 1) = self%base
      call self%control%move(self%y(:n), self%base)
      at_rest_motion = self%control%motion
      static = 0.0_wp
      if (self%problem%fourier%has_constant()) then
         static = real(at_rest_motion(1), wp)
         self%control%motion(1) = (0.0_wp, 0.0_wp)
      end if
      vibration = self%control%size_of_motion()
      others = norm2(self%y(:n))
      is_there = vibration > at_rest*others .and. vibration > 0.0_wp .and. &
                 vibration*(self%held_by + self%system%frequency()**2*self%carried) >= &
                 round_off*self%force
      ! Stuck pairs may hold what moves freely, and pass on a motion to what rests otherwise.
      self%is_node = .not. is_there .and. (stuck .or. self%is_node)
      if (.not. is_there) return
      ! The largest of the period has the static part on top.
      if (self%control%of /= of_first_harmonic) then
         if (stuck) self%rest = abs(static)
         if (abs(static) < amplitude) vibration = vibration*amplitude/(amplitude - abs(static))
      end if
      call multiply_vibration(self, amplitude/vibration)
   end subroutine scale_linear

   !> Newton's method from the guess in y. The norm that residuals are compared to is that of the
   !> load in the end; while it is solved for, that of a guess.
   subroutine attempt(self, report, error)
      class(controlled_response), intent(inout) :: self
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      integer :: n, round

      n = self%system%n
      do round = 1, most_rounds
         call self%system%set_parameter(self%y(n + 1), error)
         if (allocated(error)) return
         self%control%reference = self%system%reference
         call self%method%newton%solve(self%control, self%y, report)
         self%iterations = self%iterations + report%iterations
         if (report%interrupted) return
         call self%control%residual(self%y, self%r)
         ! Where residuals belong: the state has just been brought to the load.
         report%residual = norm2(self%r)/self%system%reference
         if (report%residual <= self%method%newton%options%tolerance) then
            report%converged = self%y(n + 1) >= 0.0_wp
            if (report%converged .or. .not. self%can_turn) exit
            call turn(self)
         else if (.not. report%converged) then
            exit
         end if
         report%converged = .false.
      end do
      if (report%converged) call self%method%refuse(self%system, self%y(:n), &
                                                       report, keeps=.true.)
      ! What is observed is round-off of what moves elsewhere.
      if (self%control%size_of_motion() <= at_rest*norm2(self%y(:n))) report%converged = .false.
   end subroutine attempt

   !> A load with the other sign is one half a period later: U_n (-1)^n. Paths that start at rest
   !> may depend on where the period starts: what is turned is solved again.
   subroutine turn(self)
      class(controlled_response), intent(inout) :: self
      integer :: first, h, last, m, n

      n = self%system%n
      m = self%problem%structure%n_coordinates
      associate (fourier => self%problem%fourier)
         do h = 1, fourier%n_retained
            if (modulo(fourier%harmonic(h), 2) == 0) cycle
            first = (fourier%column(h) - 1)*m + 1
            last = first + 2*m - 1
            self%y(first:last) = -self%y(first:last)
         end do
      end associate
      self%y(n + 1) = -self%y(n + 1)
   end subroutine turn

   !> Of a solution in y whose load is negative the same half a period later; `report` says whether
   !> there is one.
   subroutine turn_to_positive(self, report, error)
      class(controlled_response), intent(inout) :: self
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: again

      if (self%y(self%system%n + 1) >= 0.0_wp) return
      report%converged = self%can_turn
      if (.not. self%can_turn) return
      call turn(self)
      call attempt(self, again, error)
      report%converged = again%converged
      report%residual = again%residual
      report%iterations = report%iterations + again%iterations
   end subroutine turn_to_positive

   !> A solution for the guesses of the next points.
   subroutine remember(self, place, amplitude)
      class(controlled_response), intent(inout) :: self
      real(wp), intent(in) :: place, amplitude

      if (self%last%is_known) then
         if (abs(self%last%amplitude - amplitude) > 0.0_wp) then
            ! The next amplitude begins where this one did.
            self%head%is_known = .false.
         end if
      end if
      self%before = self%last
      self%last%is_known = .true.
      self%last%place = place
      self%last%amplitude = amplitude
      self%last%y = self%y
      if (.not. self%head%is_known) self%head = self%last
   end subroutine remember

   !> The work done, and why points failed.
   subroutine describe(self, case, state, summary, message)
      class(controlled_response), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message

      message = ''
      call summary%describe_work(self%system, self%method%newton%linear, case%solver%kind, &
                                 state%all_converged())
      call self%about%sensitivity%report(case, self%system, summary)
      call self%remark(state%n_points, summary%remarks)
      call remark_undetermined(self%method%undetermined, summary%remarks)
      if (state%was_stopped .or. state%all_converged()) return
      message = 'not converged: for the reasons above'
      if (self%n_unexplained > 0) then
         message = 'not converged: try smaller steps of frequency or amplitude, or more '// &
                   'harmonics%n_harmonics, for the points above'
      end if
      if (self%method%rippled) message = message//'; some were solved with friction that is '// &
         "ripple, not slip: take contact%law = 'rigid' where friction acts on mass"
   end subroutine describe

   !> That other loads were seen.
   subroutine remark(self, n_points, remarks)
      class(controlled_response), intent(in) :: self
      integer, intent(in) :: n_points
      type(remark_list), intent(inout) :: remarks

      if (self%n_others == 0) return
      call remarks%add('several loads', 'at '//to_text(self%n_others)//' of '// &
                       to_text(n_points)//' points another load gives the same amplitude, as '// &
                       'pairs stick or slip: at '//trim(self%other_at%describe())// &
                       ', amplitude '//to_text(self%other_at%amplitude)//', both '// &
                       to_text(self%other_loads(1))//' and '//to_text(self%other_loads(2))// &
                       "; follow the response over the load (sweep%parameter = "// &
                       "'load%harmonic_scale', continuation = 'arclength') to see which is meant")
   end subroutine remark

end module fw_controlled_response
