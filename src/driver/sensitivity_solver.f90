!> Derivatives of a point by the parameters of its case, laid out for the result; what there is to
!> say of them over a run.
module fw_sensitivity_solver
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_control_sensitivity, only: find_control_slopes
   use fw_control_system, only: control_system
   use fw_error, only: error_type
   use fw_force_law, only: pair_mixed, pair_stuck
   use fw_kinds, only: wp
   use fw_mode_sensitivity, only: find_mode_slopes
   use fw_mode_system, only: mode_system
   use fw_parameter_slopes, only: parameter_entry
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: is_of_matrices, is_per_element
   use fw_point, only: point_sensitivity, point_type
   use fw_remarks, only: remark_list
   use fw_response_rows, only: load_scale, mode_damping_ratio, mode_omega, resonance_omega
   use fw_sensitivity, only: sensitivity_finder
   use fw_sensitivity_options, only: of_itself
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   use fw_wear_options, only: wear_energy
   implicit none (type, external)
   private

   public :: sensitivity_solver

   !> A pair within this of the cone that never slips, or that slips for no longer than this part
   !> of the period, is at the onset of slip.
   real(wp), parameter :: onset = 1.0e-3_wp

   type :: sensitivity_solver
      type(sensitivity_finder) :: finder
      !> Points that were asked for, and of them those at a fold, with peaks alike, and with a pair
      !> at the onset of slip or of contact.
      integer :: n_points = 0
      integer :: n_singular = 0, n_tied = 0, n_onset = 0
      logical, private :: is_started = .false.
   contains
      procedure :: find
      procedure :: find_mode
      procedure :: find_controlled
      procedure :: renew
      procedure :: follow
      procedure :: report
   end type sensitivity_solver

contains

   !> Fill the derivatives of a point; x is the solution, where the system was evaluated last.
   subroutine find(self, case, system, x, point, error)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      if (.not. self%is_started) call start(self, case)
      call self%finder%find(system%problem, system, x, done, error)
      if (allocated(error)) return
      ! A located fold is singular but for round-off.
      call take_point(self, case, system, done .and. .not. point%fold, point)
   end subroutine find

   !> Count a point with its derivatives, and lay them out. At a fold quantities have none: NaN, and
   !> a remark.
   subroutine take_point(self, case, system, done, point)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout) :: system
      logical, intent(in) :: done
      type(point_type), intent(inout) :: point

      self%n_points = self%n_points + 1
      if (.not. done) then
         self%n_singular = self%n_singular + 1
         if (.not. allocated(self%finder%derivative)) then
            allocate (self%finder%derivative(size(self%finder%rows), size(self%finder%parameters)))
         end if
         self%finder%derivative = ieee_value(1.0_wp, ieee_quiet_nan)
      end if
      if (any(self%finder%rows%is_tied)) self%n_tied = self%n_tied + 1
      if (is_at_onset(case, system)) self%n_onset = self%n_onset + 1
      call lay_out(self, case, point)
   end subroutine take_point

   !> The same for a response of given amplitude, with its load.
   subroutine find_controlled(self, case, control, y, point)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(control_system), intent(inout) :: control
      !> The solution, where the system stands.
      real(wp), intent(in), contiguous :: y(:)
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: load_by(:)
      logical :: done

      if (.not. self%is_started) call start(self, case)
      allocate (load_by(size(self%finder%parameters)))
      call find_control_slopes(control, y, self%finder, load_by, done)
      done = done .and. .not. point%fold
      if (.not. done) load_by = ieee_value(1.0_wp, ieee_quiet_nan)
      call take_point(self, case, control%state, done, point)
      call add_one(self, case, load_scale, point%load_scale, load_by, point)
   end subroutine find_controlled

   !> The same for a nonlinear mode at a held amplitude, with its frequency and damping.
   subroutine find_mode(self, case, system, y, point)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(mode_system), intent(inout) :: system
      !> The solution, at the amplitude where the system stands.
      real(wp), intent(in), contiguous :: y(:)
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: omega_by(:), ratio_by(:)
      logical :: done

      if (.not. self%is_started) call start(self, case)
      allocate (omega_by(size(self%finder%parameters)), ratio_by(size(self%finder%parameters)))
      call find_mode_slopes(system, y, self%finder, omega_by, ratio_by, done)
      if (.not. done) then
         omega_by = ieee_value(1.0_wp, ieee_quiet_nan)
         ratio_by = omega_by
      end if
      call take_point(self, case, system%balance, done, point)
      call add_one(self, case, mode_omega, point%omega, omega_by, point)
      associate (xi => system%frequency_unit*y(system%n))
         call add_one(self, case, mode_damping_ratio, 0.5_wp*xi/point%omega, ratio_by, point)
      end associate
   end subroutine find_mode

   !> The numbers that the words of the case stand for.
   subroutine start(self, case)
      type(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(parameter_entry) :: entry
      real(wp), allocatable :: values(:)
      integer :: i, k

      associate (finder => self%finder, options => case%sensitivity)
         finder%quantities = options%quantities
         finder%parameters = [parameter_entry ::]
         do k = 1, size(options%parameters)
            entry = parameter_entry(number=options%parameters(k))
            if (is_of_matrices(entry%number)) then
               entry%change = findloc(case%model%changes%parameter, entry%number, dim=1)
            end if
            call get_parameter(case, entry%number, values)
            do i = 1, size(values)
               entry%value = values(i)
               if (is_per_element(entry%number)) entry%element = i
               finder%parameters = [finder%parameters, entry]
            end do
         end do
         finder%mu = spread(0.0_wp, 1, case%contact%n_pairs)
         if (case%contact%n_pairs > 0) finder%mu = case%contact%mu
         finder%wear_coefficient = max(case%wear%coefficient, 0.0_wp)
         finder%wears_by_energy = case%wear%law == wear_energy
      end associate
      self%is_started = .true.
   end subroutine start

   !> The case has other values now, and its problem other constants.
   subroutine renew(self, case)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case

      call self%finder%clear()
      call start(self, case)
   end subroutine renew

   !> From derivatives at a held frequency to those along a resonance whose frequency follows the
   !> parameters, and those of the frequency itself.
   subroutine follow(self, case, by_omega, omega_by_parameter, point)
      class(sensitivity_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Derivatives of the quantities by the frequency (n_rows), and of the frequency by the
      !> parameters (n_parameters).
      real(wp), intent(in) :: by_omega(:), omega_by_parameter(:)
      type(point_type), intent(inout) :: point
      integer :: p

      do p = 1, size(omega_by_parameter)
         self%finder%derivative(:, p) = self%finder%derivative(:, p) + &
                                        by_omega*omega_by_parameter(p)
      end do
      deallocate (point%sensitivity)
      call lay_out(self, case, point)
      call add_one(self, case, resonance_omega, point%omega, omega_by_parameter, point)
   end subroutine follow

   !> Derivatives of one number that is no row of the response.
   subroutine add_one(self, case, quantity, value, derivative, point)
      type(sensitivity_solver), intent(in) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: quantity
      real(wp), intent(in) :: value
      !> (n_parameters)
      real(wp), intent(in) :: derivative(:)
      type(point_type), intent(inout) :: point
      type(point_sensitivity) :: block
      integer :: p

      block%quantity = quantity
      associate (options => case%sensitivity, parameters => self%finder%parameters)
         do p = 1, size(options%parameters)
            block%parameter = options%parameters(p)
            block%values = pack(derivative, parameters%number == options%parameters(p))
            point%sensitivity = [point%sensitivity, block]
         end do
         block%parameter = of_itself
         block%values = [value]
         point%sensitivity = [point%sensitivity, block]
         if (.not. allocated(options%deviation)) return
         block%parameter = 0
         block%values = [deviation_of(case, parameters, derivative)]
         point%sensitivity = [point%sensitivity, block]
      end associate
   end subroutine add_one

   !> From the table of derivatives to blocks of the point, one for each quantity and parameter.
   subroutine lay_out(self, case, point)
      type(sensitivity_solver), intent(in) :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(inout) :: point
      type(point_sensitivity) :: block
      integer :: k, p, q

      allocate (point%sensitivity(0))
      associate (options => case%sensitivity, finder => self%finder)
         do q = 1, size(options%quantities)
            do p = 1, size(options%parameters)
               block%quantity = options%quantities(q)
               block%parameter = options%parameters(p)
               block%values = [real(wp) ::]
               do k = 1, size(finder%rows)
                  if (finder%rows(k)%quantity /= options%quantities(q)) cycle
                  block%values = [block%values, pack(finder%derivative(k, :), &
                                                     finder%parameters%number == &
                                                     options%parameters(p))]
               end do
               point%sensitivity = [point%sensitivity, block]
            end do
            block%parameter = of_itself
            block%values = pack(finder%rows%value, finder%rows%quantity == options%quantities(q))
            point%sensitivity = [point%sensitivity, block]
            if (.not. allocated(options%deviation)) cycle
            block%parameter = 0
            block%values = [real(wp) ::]
            do k = 1, size(finder%rows)
               if (finder%rows(k)%quantity /= options%quantities(q)) cycle
               block%values = [block%values, deviation_of(case, finder%parameters, &
                                                          finder%derivative(k, :))]
            end do
            point%sensitivity = [point%sensitivity, block]
         end do
         block%quantity = of_itself
         do p = 1, size(options%parameters)
            block%parameter = options%parameters(p)
            block%values = pack(finder%parameters%value, &
                                finder%parameters%number == options%parameters(p))
            point%sensitivity = [point%sensitivity, block]
         end do
      end associate
   end subroutine lay_out

   !> To first order, parameters being independent of each other; all pairs (springs) share the
   !> deviation of theirs, as parts of one lot do.
   pure real(wp) function deviation_of(case, parameters, derivative) result(deviation)
      type(case_type), intent(in) :: case
      type(parameter_entry), intent(in) :: parameters(:)
      !> (n_parameters)
      real(wp), intent(in) :: derivative(:)
      integer :: p

      deviation = 0.0_wp
      do p = 1, size(case%sensitivity%parameters)
         deviation = deviation + (case%sensitivity%deviation(p)* &
                                  sum(parameters%value*derivative, mask=parameters%number == &
                                      case%sensitivity%parameters(p)))**2
      end do
      deviation = sqrt(deviation)
   end function deviation_of

   !> Whether a pair just slips or just does not, or just touches: derivatives are one-sided there.
   logical function is_at_onset(case, system)
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout) :: system
      real(wp), allocatable :: share(:, :)
      real(wp) :: used
      integer :: i, k

      is_at_onset = .false.
      if (case%contact%n_pairs == 0) return
      allocate (share(3, case%contact%n_pairs))
      call system%pair_shares(share)
      associate (pairs => system%problem%forces%pairs, work => &
                 system%work(system%problem%forces%pairs))
         call system%problem%forces%entry(pairs)%law%sample(work)
         do i = 1, case%contact%n_pairs
            if (work%state(i) == pair_stuck) then
               do k = 1, size(work%force_time, 3)
                  used = norm2(work%force_time(i, 1:2, k))
                  is_at_onset = is_at_onset .or. used > -(1.0_wp - onset)*case%contact%mu(i)* &
                                work%force_time(i, 3, k) .and. used > 0.0_wp
               end do
            else if (work%state(i) == pair_mixed) then
               is_at_onset = is_at_onset .or. any(share(:, i) > 0.0_wp .and. share(:, i) < onset)
            end if
         end do
      end associate
   end function is_at_onset

   !> How derivatives were found, and what makes them less than they seem.
   subroutine report(self, case, system, summary)
      class(sensitivity_solver), intent(in) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      type(summary_type), intent(inout) :: summary
      character(:), allocatable :: text

      if (self%n_points == 0) return
      text = 'direct: '//to_text(self%finder%n_direct)
      if (self%finder%n_adjoint > 0) text = 'adjoint: '//to_text(self%finder%n_adjoint)
      text = to_text(size(self%finder%parameters))//' parameters of '// &
             to_text(size(self%finder%rows))//' quantities, '//text//' solutions at '// &
             to_text(self%n_points)//' points, '// &
             to_text(self%finder%linear%factorizations)//' factorizations'
      if (self%finder%linear%krylov_iterations > 0) then
         text = text//', '//to_text(self%finder%linear%krylov_iterations)//' of GMRES'
      end if
      call summary%line('derivatives', text)
      call remark(self, case, system, summary%remarks)
   end subroutine report

   subroutine remark(self, case, system, remarks)
      type(sensitivity_solver), intent(in) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      type(remark_list), intent(inout) :: remarks

      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         if (case%contact%n_pairs > 0 .and. law%facts%has_events .and. &
             .not. law%facts%locates_events) then
            call remarks%add('derivatives of instants', 'contact is decided at instants: '// &
                             'derivatives are those of the discretised response, which jumps '// &
                             "between instants (1 % off is usual); take harmonics%sampling = "// &
                             "'events'")
         end if
         if (law%prediction%takes_balance .and. &
             any(is_of_matrices(case%sensitivity%parameters))) then
            call remarks%add('derivatives at held eps', 'the eps of a rigid law follows the '// &
                             'matrices; derivatives by them hold it, as solutions of many '// &
                             'harmonics do not depend on it; with few they may be far off')
         end if
      end associate
      if (self%n_onset > 0) call remarks%add('one-sided derivatives', 'at '// &
         to_text(self%n_onset)//' of '//to_text(self%n_points)//' points a pair is at the '// &
         'onset of slip or contact: derivatives are those of one side')
      if (self%n_tied > 0) call remarks%add('tied peaks', 'at '//to_text(self%n_tied)//' of '// &
         to_text(self%n_points)//' points two peaks of a period are alike: the derivative '// &
         "of 'largest' is the mean of both sides")
      if (self%n_singular > 0) call remarks%add('no derivatives', 'at '// &
         to_text(self%n_singular)//' of '//to_text(self%n_points)//' points the response has '// &
         'no derivative (a fold): NaN')
   end subroutine remark

end module fw_sensitivity_solver
