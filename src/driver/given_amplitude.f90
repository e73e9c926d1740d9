!> A response of given amplitude as a vibration (group &control): the load is found with the motion.
!>
!> Started from the points before, from the linear solution scaled to the amplitude, and where these
!> fail along a path: from the last solution by halves of the way, or from a small amplitude up.
module fw_given_amplitude
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_case, only: case_type
   use fw_continuation, only: arclength_type, branch_point
   use fw_control_options, only: of_first_harmonic
   use fw_control_system, only: control_system, new_control_system
   use fw_error, only: error_type
   use fw_guess, only: free_guess, stuck_guess
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   use fw_point, only: point_type, served_by_free_guess, served_by_newton, served_by_other_guess, &
      served_by_raised_load, served_by_smaller_steps
   use fw_response, only: response
   use fw_recovery, only: observed_coefficients
   use fw_remarks, only: remark_list
   use fw_sensitivity_solver, only: sensitivity_solver
   use fw_solution_history, only: history_options, position, solution_history
   use fw_strategy, only: point_request
   use fw_text, only: to_text
   use fw_vibration, only: ends, walk_options, walk_type, way_guesses_by_lu, way_own, way_rise, &
      way_steps, way_type
   implicit none (type, external)
   private

   public :: given_amplitude

   !> The response of a given amplitude: the vibratory load is one more unknown, the amplitude one
   !> more equation.
   type, extends(response) :: given_amplitude
      type(control_system) :: control
      !> load%harmonic_scale of the case.
      real(wp) :: base = 1.0_wp
      !> Whether loads change their sign half a period later.
      logical :: can_turn = .true.
      !> Where no load gives the present amplitude: the largest that one does, and the amplitudes on
      !> both sides of a jump with its load; 0 where that is not so.
      real(wp) :: limit = 0.0_wp, jump(3) = 0.0_wp
      !> Largest vibratory load [force], 0 where it is not known so, and what holds and what carries
      !> the place that is observed, of the model alone [force/length, mass].
      real(wp) :: force = 0.0_wp, held_by = 0.0_wp, carried = 0.0_wp
      !> Unit of the load along a curve, while a point of it is at work.
      real(wp), private :: unit = 1.0_wp
      real(wp), allocatable :: r(:)
      !> Points where other loads gave the same amplitude, and the first of them with two loads.
      integer :: n_others = 0
      type(point_request) :: other_at
      real(wp) :: other_loads(2) = 0.0_wp
   contains
      procedure :: build
      procedure :: plan
      procedure :: begin
      procedure :: stand
      procedure :: solve
      procedure :: evaluate
      procedure :: make_guess
      procedure :: offers
      procedure :: try_own
      procedure :: look_further
      procedure :: explain
      procedure :: add_to
      procedure :: remark
      procedure :: curve_system
      procedure :: begin_curve
      procedure :: take_from_curve
      procedure :: back_to_curve
      procedure :: observe_beside
   end type given_amplitude

   ! fw_control_load
   interface
      !> By responses to given loads, where friction holds what is observed.
      module subroutine search_loads(self, walk, at, x, report, error)
         class(given_amplitude), intent(inout) :: self
         type(walk_type), intent(inout) :: walk
         type(position), intent(in) :: at
         real(wp), intent(inout), contiguous :: x(:)
         !> Of the ways before on entry, which stays where none is tried.
         type(solver_report), intent(inout) :: report
         type(error_type), allocatable, intent(out) :: error
      end subroutine search_loads
   end interface

   !> An observed quantity below this part of all others rests.
   real(wp), parameter :: at_rest = 1.0e-10_wp
   !> So does one that moves by less than this part of what the largest load would do right there:
   !> round-off of the response, a thousandfold near a resonance.
   real(wp), parameter :: round_off = 1.0e-12_wp
   !> Along a curve: the least norm that residuals are compared to, over that of the first point, as
   !> the load may all but vanish at a resonance; and the least size of the unknowns that matters,
   !> over the amplitude, as rigid pairs that stick do not move at all.
   real(wp), parameter :: least_reference = 1.0e-4_wp, least_size = 1.0e-3_wp
   !> Rounds in which the norm that residuals are compared to follows the load.
   integer, parameter :: most_rounds = 4
   !> Smallest amplitude that one is raised from, over the amplitude.
   real(wp), parameter :: smallest_start = 1.0e-3_wp
   !> By this part of itself another load differs.
   real(wp), parameter :: another = 1.0e-5_wp
   !> Ways of its own.
   integer, parameter :: way_first_harmonic = way_own, way_loads = way_own + 1
   type(way_type), parameter :: ways_to_amplitude(*) = [ &
      way_type('smaller steps', way_steps, served_by_smaller_steps, as_first=.false.), &
      way_type('raised amplitude', way_rise, served_by_raised_load), &
      way_type('first harmonic', way_first_harmonic, served_by_smaller_steps), &
      way_type('given loads', way_loads, served_by_raised_load), &
      way_type('guesses, with LU', way_guesses_by_lu)]

contains

   subroutine build(self, case, error)
      class(given_amplitude), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call self%response%build(case, error)
      if (allocated(error)) return
      self%n_guesses = 4
      ! Whatever is made of the points before serves as Newton's method does.
      self%served_by_first = served_by_newton
      self%served_by = [served_by_newton, served_by_newton, served_by_other_guess, &
                        served_by_free_guess]
      call new_control_system(self%state, case%control%observed, case%control%of, self%control)
      self%base = case%model%harmonic_scale
      call weigh_place(self, case%model, case%control%observed)
      self%can_turn = .true.
      if (allocated(case%model%waves%harmonic)) then
         self%can_turn = all(modulo(case%model%waves%harmonic, 2) == 1)
      end if
      self%n = self%control%n
      allocate (self%r(self%n), source=0.0_wp)
   end subroutine build

   subroutine plan(self, n, walk)
      class(given_amplitude), intent(in) :: self
      integer, intent(in) :: n
      type(walk_type), intent(inout) :: walk

      associate (unused => self)
      end associate
      walk%limits = walk_options(from_nothing=.true., first_rise=smallest_start)
      walk%ways = ways_to_amplitude
      ! A line through two points of one amplitude at two places, or none.
      call walk%known%start(n, history_options(most=2, same=-1.0_wp))
   end subroutine plan

   !> What a load right at the place that is observed would meet there.
   pure subroutine weigh_place(self, model, observed)
      type(given_amplitude), intent(inout) :: self
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

   !> Another point is wanted, of no curve.
   subroutine begin(self, case, request)
      class(given_amplitude), intent(inout) :: self
      type(case_type), intent(in), target :: case
      type(point_request), intent(in) :: request

      call self%response%begin(case, request)
      self%control%interrupt => request%interrupt
      self%control%load_unit = 1.0_wp
      self%control%least_reference = 0.0_wp
      self%limit = 0.0_wp
      self%jump = 0.0_wp
   end subroutine begin

   subroutine stand(self, at, error)
      class(given_amplitude), intent(inout) :: self
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error

      call self%control%stand(at%along, error)
      self%control%amplitude = at%level
   end subroutine stand

   !> Evaluate at the unknowns, where it stands.
   subroutine evaluate(self, x)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)

      call self%control%residual(x, self%r)
   end subroutine evaluate

   !> A guess by its first harmonic says nothing where the amplitude is that of it already.
   logical function offers(self, way)
      class(given_amplitude), intent(in) :: self
      type(way_type), intent(in) :: way

      offers = way%kind /= way_first_harmonic .or. self%control%of /= of_first_harmonic
   end function offers

   !> Loads one after another, or the balance of the first harmonic alone.
   subroutine try_own(self, way, walk, at, x, report, error)
      class(given_amplitude), intent(inout) :: self
      type(way_type), intent(in) :: way
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error

      if (way%kind == way_loads) then
         call search_loads(self, walk, at, x, report, error)
      else
         call by_first_harmonic(self, walk, at, x, report, error)
      end if
   end subroutine try_own

   !> Extrapolated, the nearest solution scaled, all stuck, all free.
   subroutine make_guess(self, guess, at, known, x, is_there, error)
      class(given_amplitude), intent(inout) :: self
      integer, intent(in) :: guess
      type(position), intent(in) :: at
      type(solution_history), intent(in) :: known
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: is_there
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: step
      integer :: n

      n = self%state%n
      is_there = .true.
      select case (guess)
      case (1)
         is_there = known%kept > 1 .and. is_near(known, 1, at)
         if (is_there) is_there = is_near(known, 2, at) .and. &
                                  abs(known%place(1) - known%place(2)) > 0.0_wp
         if (.not. is_there) return
         step = (at%along - known%place(1))/(known%place(1) - known%place(2))
         ! Further than the points are apart, an extrapolation says nothing.
         is_there = abs(step) <= 2.0_wp
         x = known%x(:, 1) + step*(known%x(:, 1) - known%x(:, 2))
      case (2)
         is_there = known%kept > 0
         if (.not. is_there) return
         call scale_nearest(self, known, at, x)
      case default
         call self%state%set_parameter(self%base, error)
         if (allocated(error)) return
         if (guess == 3) call stuck_guess(self%state, x(:n))
         if (guess == 4) call free_guess(self%state, x(:n))
         call scale_linear(self, at%level, guess == 3, x, is_there)
      end select
   end subroutine make_guess

   !> Whether a point is one of the same amplitude.
   pure logical function is_near(known, k, at)
      type(solution_history), intent(in) :: known
      integer, intent(in) :: k
      type(position), intent(in) :: at

      is_near = abs(known%level(k) - at%level) <= 0.0_wp .and. &
                abs(known%place(k) - at%along) > 0.0_wp
   end function is_near

   !> Another amplitude of the last solution, or of the first of the last amplitude, whichever is
   !> nearer: vibration and load in proportion.
   subroutine scale_nearest(self, known, at, x)
      class(given_amplitude), intent(inout) :: self
      type(solution_history), intent(in) :: known
      type(position), intent(in) :: at
      real(wp), intent(inout) :: x(:)
      logical :: from_head

      from_head = known%has_head
      if (from_head) from_head = abs(known%head_place - at%along) < abs(known%place(1) - at%along)
      if (from_head) then
         x = known%head
         call multiply_vibration(self, at%level/known%head_level, x)
      else
         x = known%x(:, 1)
         call multiply_vibration(self, at%level/known%level(1), x)
      end if
   end subroutine scale_nearest

   !> Unknowns above harmonic 0, and the load.
   subroutine multiply_vibration(self, factor, x)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(in) :: factor
      real(wp), intent(inout) :: x(:)
      integer :: first

      first = 1
      ! Harmonic 0 is the first of those retained.
      if (self%problem%fourier%has_constant()) first = self%problem%structure%n_coordinates + 1
      x(first:) = factor*x(first:)
   end subroutine multiply_vibration

   !> The linear solution under the load of the case, scaled to the amplitude.
   subroutine scale_linear(self, amplitude, stuck, x, is_there)
      type(given_amplitude), intent(inout) :: self
      real(wp), intent(in) :: amplitude
      !> That with stuck pairs, which comes first: keep its static part as that of the response.
      logical, intent(in) :: stuck
      real(wp), intent(inout) :: x(:)
      !> False where what is observed rests.
      logical, intent(out) :: is_there
      complex(wp), allocatable :: at_rest_motion(:)
      real(wp) :: vibration, others, static
      integer :: n

      n = self%state%n
      x(n + 1) = self%base
      call self%control%move(x(:n), self%base)
      at_rest_motion = self%control%motion
      static = 0.0_wp
      if (self%problem%fourier%has_constant()) then
         static = real(at_rest_motion(1), wp)
         self%control%motion(1) = (0.0_wp, 0.0_wp)
      end if
      vibration = self%control%size_of_motion()
      others = norm2(x(:n))
      is_there = vibration > at_rest*others .and. vibration > 0.0_wp .and. &
                 vibration*(self%held_by + self%state%frequency()**2*self%carried) >= &
                 round_off*self%force
      ! Stuck pairs may hold what moves freely, and pass on a motion to what rests otherwise.
      self%is_hopeless = .not. is_there .and. (stuck .or. self%is_hopeless)
      if (.not. is_there) return
      ! The largest of the period has the static part on top.
      if (self%control%of /= of_first_harmonic) then
         if (stuck) self%rest = abs(static)
         if (abs(static) < amplitude) vibration = vibration*amplitude/(amplitude - abs(static))
      end if
      call multiply_vibration(self, amplitude/vibration, x)
   end subroutine scale_linear

   !> Newton's method from a guess. The norm that residuals are compared to is that of the
   !> load in the end; while it is solved for, that of a guess.
   subroutine solve(self, x, report, error)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      integer :: n, round

      n = self%state%n
      do round = 1, most_rounds
         call self%state%set_parameter(x(n + 1), error)
         if (allocated(error)) return
         self%control%reference = self%state%reference
         call self%newton%solve(self%control, x, report)
         self%iterations = self%iterations + report%iterations
         if (report%interrupted) return
         call self%control%residual(x, self%r)
         ! Where residuals belong: the state has just been brought to the load.
         report%residual = norm2(self%r)/self%state%reference
         if (report%residual <= self%newton%options%tolerance) then
            report%converged = x(n + 1) >= 0.0_wp
            if (report%converged .or. .not. self%can_turn) exit
            call turn(self, x)
         else if (.not. report%converged) then
            exit
         end if
         report%converged = .false.
      end do
      if (report%converged) call self%refuse(self%state, x(:n), report, keeps=.true.)
      ! What is observed is round-off of what moves elsewhere.
      if (self%control%size_of_motion() <= at_rest*norm2(x(:n))) report%converged = .false.
   end subroutine solve

   !> A load with the other sign is one half a period later: U_n (-1)^n. Paths that start at rest
   !> may depend on where the period starts: what is turned is solved again.
   subroutine turn(self, x)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(inout) :: x(:)
      integer :: first, h, last, m, n

      n = self%state%n
      m = self%problem%structure%n_coordinates
      associate (fourier => self%problem%fourier)
         do h = 1, fourier%n_retained
            if (modulo(fourier%harmonic(h), 2) == 0) cycle
            first = (fourier%column(h) - 1)*m + 1
            last = first + 2*m - 1
            x(first:last) = -x(first:last)
         end do
      end associate
      x(n + 1) = -x(n + 1)
   end subroutine turn

   !> Of a solution whose load is negative the same half a period later; `report` says whether
   !> there is one.
   subroutine turn_to_positive(self, x, report, error)
      type(given_amplitude), intent(inout) :: self
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: again

      if (x(self%state%n + 1) >= 0.0_wp) return
      report%converged = self%can_turn
      if (.not. self%can_turn) return
      call turn(self, x)
      call self%solve(x, again, error)
      report%converged = again%converged
      report%residual = again%residual
      report%iterations = report%iterations + again%iterations
   end subroutine turn_to_positive

   !> The largest of a period has corners where another instant takes over, which the first
   !> harmonic has not: to where the one has the amplitude along the other, by secants.
   subroutine by_first_harmonic(self, walk, at, x, report, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_secants = 20
      type(solution_history) :: kept
      real(wp) :: first(2), largest(2), next
      integer :: k, of
      logical :: is_there

      is_there = .false.
      kept = walk%known
      walk%known%kept = 0
      of = self%control%of
      next = max(at%level - self%rest, smallest_start*at%level)
      first = 0.0_wp
      largest = 0.0_wp
      do k = 1, most_secants
         self%control%of = of_first_harmonic
         call walk%from_guesses(self, position(at%along, next), x, report, error)
         self%control%of = of
         if (allocated(error) .or. .not. report%converged) exit
         first = [first(2), next]
         largest = [largest(2), self%control%size_of_motion()]
         is_there = abs(largest(2) - at%level) <= self%newton%options%tolerance*at%level
         if (is_there) exit
         next = first(2)*at%level/largest(2)
         if (k == 1 .or. .not. abs(largest(2) - largest(1)) > 0.0_wp) cycle
         next = first(2) + (at%level - largest(2))*(first(2) - first(1))/(largest(2) - largest(1))
         next = min(max(next, 0.3_wp*first(2)), 3.0_wp*first(2))
      end do
      walk%known = kept
      if (allocated(error) .or. .not. report%converged) return
      self%control%amplitude = at%level
      if (.not. is_there) call self%solve(x, report, error)
      if (allocated(error)) return
      if (report%converged) call walk%known%remember(at%along, x, at%level)
   end subroutine by_first_harmonic

   !> Where friction sticks or slips several loads may give one amplitude: whether other guesses
   !> lead to another load. A point that goes on from two of its amplitude is one of the same curve:
   !> nothing is learned there. The solution stays.
   subroutine look_further(self, walk, request, x, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(in) :: walk
      type(point_request), intent(in) :: request
      real(wp), intent(inout), contiguous :: x(:)
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: found(size(x)), loads(2)
      integer :: guess, n
      logical :: is_there

      if (.not. may_have_others(self, walk)) return
      found = x
      n = size(x)
      ! All stuck and all free: the two ends of what friction may do.
      do guess = 3, 4
         if (guess == walk%guess .and. walk%served_by /= served_by_smaller_steps) cycle
         call self%make_guess(guess, walk%wanted, walk%known, x, is_there, error)
         if (allocated(error)) return
         if (.not. is_there) cycle
         call self%solve(x, report, error)
         if (allocated(error) .or. report%interrupted) exit
         loads = [found(n), x(n)]
         if (.not. (report%converged .and. abs(loads(2) - loads(1)) > another*loads(1))) cycle
         self%n_others = self%n_others + 1
         if (self%n_others == 1) then
            self%other_at = request
            self%other_loads = [minval(loads), maxval(loads)]
         end if
         exit
      end do
      x = found
   end subroutine look_further

   !> Whether another load may give the same amplitude: friction remembers, and the point was not
   !> reached straight from the last one.
   pure logical function may_have_others(self, walk)
      class(given_amplitude), intent(in) :: self
      type(walk_type), intent(in) :: walk

      associate (forces => self%problem%forces)
         may_have_others = forces%entry(forces%pairs)%law%facts%remembers .and. &
                           self%problem%n_pairs > 0 .and. &
                           .not. (walk%guess == 1 .and. walk%served_by == served_by_newton)
      end associate
   end function may_have_others

   !> The load of the point, and its derivatives with those of the motion.
   subroutine add_to(self, case, request, x, report, sensitivity, point, error)
      class(given_amplitude), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      real(wp), intent(in), contiguous :: x(:)
      type(solver_report), intent(in) :: report
      type(sensitivity_solver), intent(inout) :: sensitivity
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error

      associate (unused => allocated(error))
      end associate
      ! Where none was found the last trial is no load, and may be negative.
      point%load_scale = ieee_value(1.0_wp, ieee_quiet_nan)
      if (report%converged) point%load_scale = x(size(x))
      point%control = request%amplitude
      if (report%converged .and. request%sensitivity) then
         call sensitivity%find_controlled(case, self%control, x, point)
      end if
   end subroutine add_to

   !> Why the amplitude was not found, where that is known; left unallocated otherwise.
   subroutine explain(self, case, request, note)
      class(given_amplitude), intent(in) :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      character(:), allocatable, intent(inout) :: note
      character(:), allocatable :: place, quantity

      place = 'control: at '//trim(request%describe())//' '
      quantity = case%model%observe_name(case%control%observed)%text
      if (self%rest >= request%amplitude) then
         note = place//'static loads alone move '//quantity//' by '//to_text(self%rest)// &
                ', more than the amplitude '//to_text(request%amplitude)// &
                "; give a larger one, or control%of = 'first_harmonic'"
      else if (self%is_hopeless) then
         note = place//quantity//' rests under the load (a node): no load gives it an '// &
                'amplitude; observe another place, or leave this frequency out'
      else if (self%limit > 0.0_wp) then
         note = place//quantity//' does not move by more than '//to_text(self%limit)// &
                ' however large the load is, as only friction passes it on; the amplitude '// &
                to_text(request%amplitude)//' is out of reach: give a smaller one, observe '// &
                'another place, or give more normal load'
      else if (self%jump(2) > self%jump(1)) then
         note = place//'the amplitude of '//quantity//' jumps from '//to_text(self%jump(1))// &
                ' to '//to_text(self%jump(2))//' at the load '//to_text(self%jump(3))// &
                ', and no response of '//to_text(request%amplitude)//' was found between; '// &
                "follow it over the load (sweep%parameter = 'load%harmonic_scale', "// &
                "continuation = 'arclength')"
      end if
   end subroutine explain

   !> That other loads were seen.
   subroutine remark(self, n_points, remarks)
      class(given_amplitude), intent(in) :: self
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

   !> Over the frequency, or over another parameter.
   function curve_system(self) result(system)
      class(given_amplitude), intent(in), target :: self
      class(parameter_system), pointer :: system

      system => self%control
   end function curve_system

   !> The load counts as much as the motion.
   subroutine begin_curve(self, level, x, curve)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(in) :: level
      real(wp), intent(inout) :: x(:)
      class(arclength_type), intent(inout) :: curve
      real(wp) :: size_of_motion
      integer :: n

      n = size(x) - 1
      associate (control => self%control)
         size_of_motion = max(norm2(x(:n)), level)
         if (x(n + 1) > 0.0_wp) control%load_unit = x(n + 1)/size_of_motion
         x(n + 1) = x(n + 1)/control%load_unit
         control%least_reference = least_reference*control%reference
         curve%x_scale = least_size*level
      end associate
   end subroutine begin_curve

   !> Points know no unit, and no negative load.
   subroutine take_from_curve(self, found, at, x, report, ending, error)
      class(given_amplitude), intent(inout) :: self
      type(branch_point), intent(in) :: found
      type(point_request), intent(in) :: at
      real(wp), intent(out), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      character(:), allocatable, intent(out) :: ending
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = size(x) - 1
      report = found%report
      self%unit = self%control%load_unit
      call self%control%stand(found%p, error)
      if (allocated(error)) return
      x = found%x
      x(n + 1) = self%unit*found%x(n + 1)
      self%control%load_unit = 1.0_wp
      call turn_to_positive(self, x, report, error)
      if (.not. report%converged) ending = 'the load vanishes at '//trim(at%describe())// &
                                           ': the structure vibrates by itself'
   end subroutine take_from_curve

   !> The unit of the load that the curve was scaled with.
   subroutine back_to_curve(self)
      class(given_amplitude), intent(inout) :: self

      self%control%load_unit = self%unit
   end subroutine back_to_curve

   subroutine observe_beside(self, at, x, n_harmonics, coefficients, error)
      class(given_amplitude), intent(inout) :: self
      type(position), intent(in) :: at
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: n_harmonics
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = self%state%n
      ! A negative load is one half a period later.
      if (x(n + 1) < 0.0_wp) return
      call self%control%stand(at%along, error)
      if (.not. allocated(error)) call self%control%take(x(n + 1:), error)
      if (allocated(error)) return
      call observed_coefficients(self%state, x(:n), n_harmonics, coefficients)
   end subroutine observe_beside

end module fw_given_amplitude
