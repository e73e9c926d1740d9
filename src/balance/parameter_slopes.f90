!> What a parameter changes while the coordinates are held: the residual R_p, the forces of the
!> pairs, the observed quantities. With G the derivative of the forces by their inputs y,
!>
!>   mu             dT = dT/d(mu p) p: T depends on mu y_n alone, so that dT = G_tn y_n/mu
!>   normal load    dy_n = -1,     gap  dy_n = k_n    (constants, hence G of all harmonics)
!>   k_t, k_n       dy = y/k, of pairs that start from k_t times a slider dy_t = (y_t - x_start)/k_t
!>   slider         dy_t = -k_t in harmonic 0: inputs and start that move alike change no force
!>   residual       dT in harmonic 0, with the inputs held
!>   c, p_0         of curved normal laws, dy_n = -p/(p' c): the pressure is in proportion to them,
!>                  and T to mu p, so that dy_n = -p/(p' mu) by mu
!>   v_0, mu_d      of friction at a sliding speed, and mu where it weakens with the speed: dT with
!>                  the inputs held
!>   coefficient    the force of a unit coefficient
!>   loads, matrices, sectors    dr = d(Z q - F)/dp, which laws that take the balance lose from
!>                  their input.
!>
!> Where harmonic 0 is left out of the balance, or a pair has no normal dof, its derivative by the
!> constant part of y_n is not in the balance: a twin of the law, with all harmonics and a normal
!> input of every pair, is differentiated in the same motion.
module fw_parameter_slopes
   use fw_balance_state, only: balance_state
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_elements, only: element_kind
   use fw_force_law, only: force_law, force_workspace, pair_mixed, pair_open, pair_stuck
   use fw_fourier, only: fourier_type, new_fourier
   use fw_kinds, only: wp
   use fw_lapack, only: dgemv
   use fw_parameters, only: blade_frequency, friction_coefficient, gap, harmonic_scale, &
      is_of_elements, is_of_matrices, is_of_sectors, is_per_pair, normal_coefficient, normal_load, &
      normal_stiffness, parameter_group, parameter_key, reference_force, slider_1, slider_2, &
      spring_coefficient, static_scale, tangential_stiffness
   use fw_recovery, only: observe
   implicit none (type, external)
   private

   public :: parameter_entry, parameter_slope, slope_finder

   !> One number by which responses are differentiated.
   type :: parameter_entry
      !> As in parameter_words, and which pair or spring it is of (0: it is none's).
      integer :: number = 0
      integer :: element = 0
      !> Value in the case.
      real(wp) :: value = 0.0_wp
      !> Which of the changes of the model, of those that change matrices.
      integer :: change = 0
   end type parameter_entry

   !> Derivatives by a parameter at held coordinates.
   type :: parameter_slope
      !> R_p (n_coordinates, n_coefficients) [force by the parameter].
      real(wp), allocatable :: residual(:, :)
      !> Of the pairs (n_pairs, 3, n_coefficients).
      real(wp), allocatable :: force(:, :, :)
      !> Complex amplitudes (n_observed, n_retained).
      complex(wp), allocatable :: observed(:, :)
      !> Of the work F_1^H U_1, by parameters of matrices alone.
      complex(wp) :: work = (0.0_wp, 0.0_wp)
   end type parameter_slope

   type :: slope_finder
      !> The law of the pairs with all harmonics and normal inputs, its workspace, and the columns
      !> that the coefficients of the balance have there.
      class(force_law), allocatable :: law
      type(force_workspace) :: work
      type(fourier_type) :: fourier
      integer, allocatable :: column(:)
      !> Observed quantities where all coordinates rest (n_observed, n_retained), and the field of
      !> the solution (whole_size, n_retained).
      complex(wp), allocatable :: at_rest(:, :), field(:, :)
      !> The motion (n_coordinates * n_coefficients).
      real(wp), allocatable :: x(:)
      !> Work of the load in harmonic 1 where all coordinates rest.
      complex(wp) :: work_at_rest = (0.0_wp, 0.0_wp)
   contains
      procedure :: start
      procedure :: prepare
      procedure :: find
   end type slope_finder

contains

   !> Build the twin of the pairs' law.
   subroutine start(self, state)
      class(slope_finder), intent(inout) :: self
      type(balance_state), intent(in) :: state
      integer :: c, h

      associate (problem => state%problem, f => state%problem%fourier)
         allocate (self%law, source=problem%forces%entry(problem%forces%pairs)%law)
         ! Where no dof presses, a constant does: an input all the same.
         if (problem%n_pairs > 0) self%law%present(3, :) = .true.
         call self%law%take_prediction()
         self%fourier = new_fourier(maxval(f%harmonic), f%n_time)
         call self%law%reserve(self%fourier, self%work)
         allocate (self%column(f%n_coefficients))
         do h = 1, f%n_retained
            do c = 0, merge(0, 1, f%harmonic(h) == 0)
               self%column(f%column(h) + c) = max(1, 2*f%harmonic(h)) + c
            end do
         end do
         allocate (self%at_rest(problem%structure%n_observed, f%n_retained))
         allocate (self%field(problem%structure%whole_size(), f%n_retained))
      end associate
   end subroutine start

   !> Take the motion x of a state, which has been evaluated and linearized there.
   subroutine prepare(self, state, x, residual_only)
      class(slope_finder), intent(inout) :: self
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      !> Slopes of the residual by pairs and springs are all that is asked for (default: no).
      logical, intent(in), optional :: residual_only
      real(wp) :: rest(size(x))
      complex(wp), allocatable :: q(:, :)
      logical :: wants_all

      self%x = x
      rest = 0.0_wp
      wants_all = .true.
      if (present(residual_only)) wants_all = .not. residual_only
      if (wants_all) then
         call observe(state, rest, self%at_rest)
         call find_work_at_rest(self, state)
      end if
      associate (problem => state%problem, m => state%problem%structure%n_coordinates)
         if (wants_all) then
            allocate (q(m, problem%fourier%n_retained))
            call amplitudes_of(problem%fourier%harmonic, problem%fourier%column, m, x, m, q)
            call problem%structure%complete_field(state%structure_state, q, field=self%field)
         end if
         if (problem%n_pairs == 0) return
         associate (source => state%work(problem%forces%pairs), work => self%work)
            work%prediction = 0.0_wp
            work%prediction(:, :, self%column) = source%prediction
            work%offset = source%offset
            work%x_start = source%x_start
            work%mean = source%mean
            work%rate = source%rate
            call self%law%evaluate(self%fourier, work)
            call self%law%linearize(self%fourier, work)
         end associate
      end associate
   end subroutine prepare

   subroutine find_work_at_rest(self, state)
      class(slope_finder), intent(inout) :: self
      type(balance_state), intent(in) :: state
      complex(wp) :: rest(state%problem%structure%n_coordinates)
      integer :: h

      h = findloc(state%problem%fourier%harmonic, 1, dim=1)
      if (h == 0) return
      rest = (0.0_wp, 0.0_wp)
      call state%problem%structure%load_work(state%structure_state, h, rest, self%work_at_rest)
   end subroutine find_work_at_rest

   !> The slope by one parameter.
   subroutine find(self, state, parameter, slope)
      class(slope_finder), intent(inout) :: self
      type(balance_state), intent(inout) :: state
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(inout) :: slope
      character(24) :: group

      call clear(state, slope)
      if (is_per_pair(parameter%number)) then
         call by_pair(self, state, parameter, slope)
         ! Rigid pairs feel what elastic ones beside them change, but not one another.
         if (.not. self%law%prediction%takes(parameter%element)) call answer_balance(state, slope)
      else
         select case (parameter%number)
         case (spring_coefficient)
            call by_element(state, state%problem%forces%springs, parameter%element, slope)
         case (harmonic_scale, static_scale)
            call by_load(self, state, parameter, slope)
         case default
            if (is_of_elements(parameter%number)) then
               call parameter_group(parameter%number, group)
               call by_element(state, state%problem%forces%elements(element_kind(trim(group))), &
                               parameter%element, slope)
            end if
            if (is_of_matrices(parameter%number)) call by_matrices(self, state, parameter, slope)
            if (is_of_sectors(parameter%number)) call state%problem%structure%own_slope( &
               state%structure_state, parameter%number - blade_frequency + 1, parameter%element, &
               self%x, slope%residual)
         end select
         ! Laws that take the balance feel what the structure and the springs have changed.
         call answer_balance(state, slope)
      end if
   end subroutine find

   subroutine clear(state, slope)
      type(balance_state), intent(in) :: state
      type(parameter_slope), intent(inout) :: slope

      associate (p => state%problem)
         if (.not. allocated(slope%residual)) then
            allocate (slope%residual(p%structure%n_coordinates, p%fourier%n_coefficients))
            allocate (slope%force(p%n_pairs, 3, p%fourier%n_coefficients))
            allocate (slope%observed(p%structure%n_observed, p%fourier%n_retained))
         end if
      end associate
      slope%residual = 0.0_wp
      slope%work = (0.0_wp, 0.0_wp)
      slope%force = 0.0_wp
      slope%observed = (0.0_wp, 0.0_wp)
   end subroutine clear

   !> By a number of one pair.
   subroutine by_pair(self, state, parameter, slope)
      class(slope_finder), intent(inout) :: self
      type(balance_state), intent(inout) :: state
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(inout) :: slope
      real(wp) :: input(self%fourier%n_coefficients, 3), output(self%fourier%n_coefficients, 3)
      character(24) :: key
      logical :: is_known
      integer :: c, i

      i = parameter%element
      associate (pairs => state%problem%forces%pairs, p => self%law%prediction, work => self%work)
         call parameter_key(parameter%number, key)
         call self%law%by_constant(i, trim(key), self%fourier, work, output, is_known)
         if (.not. is_known) then
            call input_of(self, state, parameter, input)
            call multiply_twin(work, i, input, output)
         end if
         ! mu acts on friction alone, and not on what presses.
         if (parameter%number == friction_coefficient) output(:, 3) = 0.0_wp
         do c = 1, 3
            if (state%problem%forces%entry(pairs)%row(c, i) == 0) cycle
            slope%force(i, c, :) = output(self%column, c)
            call state%problem%incidence%scatter_row(state%problem%forces%entry(pairs)%row(c, i), &
                                                     state%problem%incidence%identity, &
                                                     size(slope%residual, 1), &
                                                     size(slope%residual, 1), 1.0_wp, &
                                                     output(self%column, c), slope%residual)
         end do
      end associate
   end subroutine by_pair

   !> Derivative of the inputs of a pair by a number of it (n_coefficients of the twin, 3).
   subroutine input_of(self, state, parameter, input)
      class(slope_finder), intent(in) :: self
      type(balance_state), intent(in) :: state
      type(parameter_entry), intent(in) :: parameter
      real(wp), intent(out) :: input(:, :)
      character(24) :: pressing
      integer :: c, i

      input = 0.0_wp
      i = parameter%element
      pressing = self%law%pressing_constant(i)
      associate (p => self%law%prediction, y => self%work%prediction, offset => self%work%offset)
         select case (parameter%number)
         case (friction_coefficient)
            if (.not. parameter%value > 0.0_wp) return
            if (len_trim(pressing) > 0) then
               call press_in_proportion(self, i, parameter%value, input(:, 3))
               return
            end if
            input(:, 3) = y(i, 3, :)/parameter%value
            input(1, 3) = input(1, 3) + offset(i)/parameter%value
         case (normal_load)
            if (p%load(i) > 0.0_wp .or. .not. presses(state, i)) input(1, 3) = -1.0_wp
         case (gap)
            if (presses(state, i)) input(1, 3) = p%stiffness(i, 3)
         case (tangential_stiffness)
            ! Of pairs whose law has none it is no number of theirs.
            if (p%takes(i)) return
            do c = 1, 2
               if (p%order_of(i, c) > 0) cycle
               call elongation(self, state, i, c, input(:, c))
               ! Laws of hysteresis have no start of their own, and absent directions no stiffness.
               if (.not. (allocated(self%work%x_start) .and. p%stiffness(i, c) > 0.0_wp)) cycle
               input(1, c) = input(1, c) - self%work%x_start(i, c)/p%stiffness(i, c)
            end do
         case (slider_1, slider_2)
            c = merge(1, 2, parameter%number == slider_1)
            if (p%order_of(i, c) == 0) input(1, c) = -p%stiffness(i, c)
         case (normal_coefficient)
            if (pressing == 'normal_coefficient') call press_in_proportion( &
               self, i, parameter%value, input(:, 3))
         case (reference_force)
            if (pressing == 'reference_force') call press_in_proportion( &
               self, i, parameter%value, input(:, 3))
         case (normal_stiffness)
            if (p%takes(i) .or. len_trim(pressing) > 0) return
            call elongation(self, state, i, 3, input(:, 3))
            if (presses(state, i)) input(1, 3) = input(1, 3) + &
               p%gap_at(i, state%frequency()) + state%depth(i)
         case default ! acts through no input
         end select
      end associate
   end subroutine input_of

   !> The change of a curved pair's normal input by which its pressure grows as with a factor of it.
   subroutine press_in_proportion(self, pair, factor, input)
      class(slope_finder), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(in) :: factor
      real(wp), intent(out) :: input(:)

      input = self%work%prediction(pair, 3, :)
      input(1) = input(1) + self%work%offset(pair)
      call self%law%input_of_pressure(pair, input)
      input = input/factor
   end subroutine press_in_proportion

   !> Whether a normal dof presses a pair.
   pure logical function presses(state, pair)
      type(balance_state), intent(in) :: state
      integer, intent(in) :: pair

      presses = state%problem%forces%entry(state%problem%forces%pairs)%row(3, pair) > 0
   end function presses

   !> Relative displacement of a component, in the columns of the twin.
   subroutine elongation(self, state, pair, component, values)
      class(slope_finder), intent(in) :: self
      type(balance_state), intent(in) :: state
      integer, intent(in) :: pair, component
      real(wp), intent(out) :: values(:)
      real(wp) :: own(size(self%column))

      values = 0.0_wp
      associate (p => state%problem, &
                 row => state%problem%forces%entry(state%problem%forces%pairs)%row)
         if (row(component, pair) == 0) return
         call p%incidence%gather_row(row(component, pair), p%incidence%identity, &
                                     p%structure%n_coordinates, 1.0_wp, self%x, own)
      end associate
      values(self%column) = own
   end subroutine elongation

   !> output = G input of one pair of the twin.
   subroutine multiply_twin(work, pair, input, output)
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      real(wp), intent(in) :: input(:, :)
      real(wp), intent(out) :: output(:, :)
      integer :: n

      n = size(input)
      select case (work%linear_state(pair))
      case (pair_mixed)
         call dgemv('T', n, n, 1.0_wp, work%jacobian(1, 1, pair), n, input, 1, 0.0_wp, output, 1)
      case (pair_stuck)
         output = input
      case default ! open: no force, and none that changes
         output = 0.0_wp
      end select
   end subroutine multiply_twin

   !> The force of a unit coefficient of one spring or other element.
   subroutine by_element(state, law, value, slope)
      type(balance_state), intent(inout) :: state
      !> Its place in the list.
      integer, intent(in) :: law
      !> Place of the coefficient among those of the input.
      integer, intent(in) :: value
      type(parameter_slope), intent(inout) :: slope
      real(wp), allocatable :: unit(:, :, :)
      integer :: c, element, number

      associate (entry => state%problem%forces%entry(law))
         call entry%law%find_parameter(value, element, number)
         allocate (unit, mold=state%work(law)%force)
         call entry%law%by_parameter(number, state%problem%fourier, state%work(law), unit)
         do c = 1, size(entry%row, 1)
            if (entry%row(c, element) == 0) cycle
            call state%problem%incidence%scatter_row(entry%row(c, element), &
                                                     state%problem%incidence%identity, &
                                                     size(slope%residual, 1), &
                                                     size(slope%residual, 1), 1.0_wp, &
                                                     unit(element, c, :), slope%residual)
         end do
      end associate
   end subroutine by_element

   !> Loads are proportional to their factors: those above harmonic 0, or those of it.
   subroutine by_load(self, state, parameter, slope)
      class(slope_finder), intent(in) :: self
      type(balance_state), intent(in) :: state
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(inout) :: slope
      integer :: c, h, k

      associate (f => state%problem%fourier)
         do h = 1, f%n_retained
            if ((f%harmonic(h) == 0) .neqv. (parameter%number == static_scale)) cycle
            slope%observed(:, h) = self%at_rest(:, h)/parameter%value
            do c = 0, merge(0, 1, f%harmonic(h) == 0)
               k = f%column(h) + c
               slope%residual(:, k) = -state%load(:, k)/parameter%value
            end do
         end do
      end associate
   end subroutine by_load

   !> dZ u - dF of the whole field, condensed; the condensed part answers at once.
   subroutine by_matrices(self, state, parameter, slope)
      class(slope_finder), intent(in) :: self
      type(balance_state), intent(in) :: state
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(inout) :: slope
      complex(wp) :: change(size(self%field, 1), size(self%field, 2))
      complex(wp) :: field(size(self%field, 1), size(self%field, 2))
      complex(wp) :: rest(size(slope%residual, 1), size(self%field, 2))

      associate (s => state%problem%structure, f => state%problem%fourier, &
                 m => size(slope%residual, 1))
         call s%change_field(state%structure_state, parameter%change, self%field, change)
         call s%condense_field(state%structure_state, change, rest)
         call coefficients_of(f%harmonic, f%column, m, m, rest, slope%residual)
         rest = (0.0_wp, 0.0_wp)
         call s%complete_field(state%structure_state, rest, -change, field)
         call s%observe_field(field, slope%observed)
         slope%work = s%field_work(state%structure_state, field)
      end associate
   end subroutine by_matrices

   !> Forces of the pairs that take the balance follow its change, -dr.
   subroutine answer_balance(state, slope)
      type(balance_state), intent(inout) :: state
      type(parameter_slope), intent(inout) :: slope
      real(wp) :: change(size(slope%residual, 1), size(slope%residual, 2))
      integer :: c, i, nc

      call state%form_jacobians()
      nc = size(change, 2)
      change = slope%residual
      associate (entry => state%problem%forces%entry(state%problem%forces%pairs), &
                 work => state%work(state%problem%forces%pairs), b => state%problem%incidence)
         if (.not. entry%law%prediction%takes_balance) return
         do i = 1, size(entry%row, 2)
            if (work%linear_state(i) == pair_open .or. .not. entry%law%prediction%takes(i)) cycle
            do c = 1, 3
               work%input((c - 1)*nc + 1:c*nc, i) = 0.0_wp
               if (entry%row(c, i) == 0) cycle
               work%input((c - 1)*nc + 1:c*nc, i) = -change(b%coordinate_of(entry%row(c, i)), :)
            end do
            call multiply_own(work, i)
            do c = 1, 3
               if (entry%row(c, i) == 0) cycle
               slope%force(i, c, :) = work%output((c - 1)*nc + 1:c*nc, i)
               call b%scatter_row(entry%row(c, i), b%identity, size(change, 1), size(change, 1), &
                                  1.0_wp, slope%force(i, c, :), slope%residual)
            end do
         end do
      end associate
   end subroutine answer_balance

   !> output = G input of one pair of the balance.
   subroutine multiply_own(work, pair)
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: pair
      integer :: n

      n = size(work%input, 1)
      if (work%linear_state(pair) == pair_mixed) then
         call dgemv('T', n, n, 1.0_wp, work%jacobian(1, 1, pair), n, work%input(1, pair), 1, &
                    0.0_wp, work%output(1, pair), 1)
      else
         work%output(:, pair) = work%input(:, pair)
      end if
   end subroutine multiply_own

end module fw_parameter_slopes
