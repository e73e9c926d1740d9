!> Derivatives of the residual by what is not an unknown: the frequency, the self-excitation, the
!> loads, the parameter that a path follows.
submodule(fw_balance_state:fw_balance_linear) fw_balance_slopes
   use fw_complex_form, only: coefficients_of
   use fw_structure_operator, only: by_frequency
   implicit none (type, external)

contains

   !> dR/d omega = Z' q - F', with what the forces add to it; of another parameter its own.
   module procedure parameter_derivative

      if (allocated(self%moved%mover)) then
         call self%moved%mover%derive(self, self%moved%value, x, dr)
      else
         call self%derivative_by(by_frequency, x, dr)
      end if
   end procedure parameter_derivative

   module procedure derivative_by_loads
      complex(wp) :: change(size(self%structure_state%unit_load, 1), &
                            size(self%structure_state%unit_load, 2))
      real(wp) :: rest(size(dr))
      integer :: h, m

      m = self%problem%structure%n_coordinates
      associate (fourier => self%problem%fourier)
         do h = 1, fourier%n_retained
            change(:, h) = -merge(static, vibratory, fourier%harmonic(h) == 0)* &
                           self%structure_state%unit_load(:, h)
         end do
         call coefficients_of(fourier%harmonic, fourier%column, m, m, change, dr)
         ! Inputs change by the balance alone, wherever the coordinates are.
         rest = 0.0_wp
         call derivative_with_forces(self, .false., m, fourier%n_coefficients, rest, dr)
      end associate
   end procedure derivative_by_loads

   module procedure derivative_by

      call self%problem%structure%derivative(self%structure_state, parameter, x, dr)
      call derivative_with_forces(self, parameter == by_frequency, &
                                  self%problem%structure%n_coordinates, &
                                  self%problem%fourier%n_coefficients, x, dr)
   end procedure derivative_by

   !> dr from the slopes of all coordinates: the inputs of a law change by the
   !> balance that it takes, and, with the frequency, by the unit of time of its rates.
   subroutine derivative_with_forces(self, in_time, m, nc, q, dr)
      type(balance_state), intent(inout) :: self
      !> Whether it is the frequency that changes.
      logical, intent(in) :: in_time
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc)
      real(wp), intent(inout) :: dr(m, nc)
      integer :: k

      call self%form_jacobians()
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k), work => self%work(k), &
                    p => self%problem%forces%entry(k)%law%prediction)
            ! Inputs of any other law depend on q alone, and q is held. Elements that take the
            ! balance come last: what the others add is a part of it.
            if (p%some_are_free() .and. p%by_time .and. in_time) then
               call inputs_by_point(self, entry, in_time, m, nc, q, dr, work%input)
               call multiply_derivative(entry%row, work)
               call add_outputs(self, entry, work, not_open(p, work, .false.), &
                                self%problem%incidence%identity, m, dr)
            end if
            if (in_time .and. p%has_frequency) then
               call entry%law%by_frequency(self%problem%fourier, work)
               call add_outputs(self, entry, work, not_open(p, work, .false.), &
                                self%problem%incidence%identity, m, dr)
            end if
            if (in_time .and. changes_with_frequency(p) .and. p%some_are_free()) then
               call add_law_by_frequency(self, entry, entry%free_rows, work, m, nc, dr)
            end if
            if (.not. p%takes_balance) cycle
            call inputs_by_point(self, entry, in_time, m, nc, q, dr, work%input)
            call multiply_derivative(entry%row, work)
            call add_outputs(self, entry, work, not_open(p, work, .true.), &
                             self%problem%incidence%identity, m, dr)
            if (in_time .and. changes_with_frequency(p)) then
               call add_law_by_frequency(self, entry, entry%rigid_rows, work, m, nc, dr)
            else if (in_time .and. p%has_inertia) then
               call add_law_by_frequency(self, entry, entry%rows, work, m, nc, dr)
            end if
         end associate
      end do
   end subroutine derivative_with_forces

   !> Whether gaps follow a speed that the frequency sets, or anchors move by what a side slides in
   !> a period.
   pure logical function changes_with_frequency(prediction) result(changes)
      type(prediction_type), intent(in) :: prediction

      changes = prediction%grows() .or. allocated(prediction%speed)
   end function changes_with_frequency

   !> The elements that have forces, of those that take the balance or of those that do not.
   pure function not_open(prediction, work, takes) result(elements)
      type(prediction_type), intent(in) :: prediction
      type(force_workspace), intent(in) :: work
      logical, intent(in) :: takes
      integer, allocatable :: elements(:)
      integer :: i

      elements = pack([(i, i=1, size(work%linear_state))], &
                      work%linear_state /= pair_open .and. &
                      [(prediction%takes(i) .eqv. takes, i=1, size(work%linear_state))])
   end function not_open

   !> A law with inertia in units of time depends on the frequency by itself, and one whose gaps
   !> grow with a speed that follows it: a central difference, its inputs being held.
   subroutine add_law_by_frequency(self, entry, rows, work, m, nc, dr)
      type(balance_state), intent(inout) :: self
      type(force_entry), intent(in) :: entry
      !> Of the elements that are differentiated: those that do not take the balance are a part of
      !> it, and come first.
      integer, intent(in) :: rows(:)
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: m, nc
      real(wp), intent(inout) :: dr(m, nc)
      !> Where truncation and round-off of a difference meet.
      real(wp), parameter :: relative_step = 1.0e-5_wp
      real(wp) :: step
      integer :: side

      step = relative_step*self%frequency()
      ! (f(omega + step) - f(omega - step))/(2 step).
      do side = -1, 1, 2
         work%rate = self%frequency() + side*step
         if (entry%law%prediction%grows()) call entry%law%set_offset(self%depth, work)
         call entry%law%evaluate(self%problem%fourier, work)
         call self%problem%incidence%scatter(rows, m, nc, 0.5_wp*side/step, work%force, dr)
      end do
      ! And back: what an evaluation leaves in `work` belongs to the present frequency.
      work%rate = self%frequency()
      if (entry%law%prediction%grows()) call entry%law%set_offset(self%depth, work)
      call entry%law%evaluate(self%problem%fourier, work)
   end subroutine add_law_by_frequency

   !> Derivatives of the inputs by the frequency or the self-excitation.
   subroutine inputs_by_point(self, entry, in_time, m, nc, q, dr, input)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      logical, intent(in) :: in_time
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: q(m, nc), dr(m, nc)
      real(wp), intent(inout) :: input(:, :)
      integer :: i, c

      input = 0.0_wp
      associate (p => entry%law%prediction, row => entry%row)
         do i = 1, size(row, 2)
            do c = 1, size(row, 1)
               if (row(c, i) == 0) cycle
               associate (y => input((c - 1)*nc + 1:c*nc, i))
                  ! y = k omega B dq/dtau, so that dy/d omega = k B dq/dtau.
                  if (p%in_time(i) .and. p%order_of(i, c) > 0 .and. in_time) then
                     call self%problem%incidence%gather_row(row(c, i), &
                                                            self%problem%incidence%identity, m, &
                                                    p%stiffness(i, c), q, y)
                     call take_rate(self%problem%fourier, .false., 1.0_wp, y)
                  end if
                  if (p%has_inertia .and. in_time) then
                     call add_inertia_by_frequency(self, p, row(c, i), i, c, m, q, y)
                  end if
                  ! The balance in y is minus what the residual is without this law, and its slope
                  ! is -dr.
                  if (p%takes(i)) y = y - &
                     dr(self%problem%incidence%coordinate_of(row(c, i)), :)
               end associate
            end do
         end do
      end associate
   end subroutine inputs_by_point

   !> Add dE_n/d omega times the displacement of a row.
   subroutine add_inertia_by_frequency(self, prediction, row, element, component, m, q, y)
      type(balance_state), intent(in) :: self
      type(prediction_type), intent(in) :: prediction
      integer, intent(in) :: row, element, component, m
      real(wp), intent(in) :: q(m, *)
      real(wp), intent(inout) :: y(:)
      complex(wp) :: slope
      real(wp) :: u(size(y))
      integer :: h, k, n

      if (.not. prediction%inertia(element, component) > 0.0_wp) return
      call self%problem%incidence%gather_row(row, self%problem%incidence%identity, m, 1.0_wp, q, u)
      do h = 1, self%problem%fourier%n_retained
         n = self%problem%fourier%harmonic(h)
         if (n == 0) cycle
         k = self%problem%fourier%column(h)
         ! E_n = k - (n omega)**2 m + i n omega c.
         slope = cmplx(-2.0_wp*n**2*self%frequency()*prediction%inertia(element, component), &
                       n*prediction%damping(element, component), wp)* &
                 cmplx(u(k), -u(k + 1), wp)
         y(k) = y(k) + real(slope, wp)
         y(k + 1) = y(k + 1) - aimag(slope)
      end do
   end subroutine add_inertia_by_frequency

end submodule fw_balance_slopes
