!> The response about one of its points, x = (q, omega): its curve R(q, omega) = 0 at a held
!> parameter, and the surface that a parameter p makes of it. With the border b across the curve,
!>
!>   [ R_q  R_w ] t    = [ 0 ]     [ R_q  R_w ] x_ss = [ -R_tt ]
!>   [ b^T      ]        [ 1 ],    [ b^T      ]        [   0   ],   likewise x_p, x_sp
!>
!> which is regular at folds, where R_q alone is not. R_tt and R_tp are differences of first order
!> of the exact derivatives R_q t + R_w t_w and R_q x_p + R_w x_pw + R_p along t: no second
!> derivatives of laws, and no difference of the second order. With Q along the curve
!>
!>   Q_s = 0                       at a resonance, a maximum where Q_ss < 0,
!>   dQ/dp = Q_p,   domega/dp = x_pw - t_w Q_sp/Q_ss     along it as p changes.
module fw_response_curve
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_error, only: error_type
   use fw_fourier, only: to_complex
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_newton, only: newton_solver, solver_report
   use fw_parameter_slopes, only: parameter_entry, parameter_slope, slope_finder
   use fw_plane_system, only: plane_system
   use fw_recovery, only: observe
   use fw_response_quantity, only: of_first_harmonic, response_quantity
   use fw_response_rows, only: new_rows, response_row
   use fw_sensitivity, only: sensitivity_finder
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_krylov, linear_lu, solver_options
   use fw_structure_operator, only: by_frequency
   implicit none (type, external)
   private

   public :: response_curve

   !> Relative residual asked of GMRES.
   real(wp), parameter :: krylov_tolerance = 1.0e-12_wp
   !> Step of the differences, as a change of q over its size: its square is their error.
   real(wp), parameter :: difference = 3.0e-5_wp
   !> Part of what is observed that q counts for at least.
   real(wp), parameter :: smallest_share = 1.0e-3_wp

   type :: response_curve
      !> As in fw_response_quantity, of the first observed quantity.
      integer :: kind = of_first_harmonic
      !> The point (n + 1), the direction of the curve and its bend, of any length.
      real(wp), allocatable :: x(:), t(:), bend(:)
      type(response_quantity) :: q
      !> dQ/ds and d2Q/ds2.
      real(wp) :: slope = 0.0_wp, second = 0.0_wp
      type(newton_solver) :: newton
      type(linear_step_type) :: linear
      type(balance_state), pointer :: state => null()
      type(balance_problem), pointer, private :: problem => null()
      type(balance_state), pointer, private :: shifted => null()
      type(plane_system), pointer, private :: plane => null()
      !> Across the curve (n + 1), of the size of the residual.
      real(wp), allocatable, private :: border(:)
      !> Amplitudes of the first observed quantity along t, and its second derivative (n_retained).
      complex(wp), allocatable, private :: u_s(:)
      real(wp), private :: step = 0.0_wp
      !> Size of q, where that is next to nothing (rigid pairs that stick) of what is observed.
      real(wp), private :: q_size = 1.0_wp
   contains
      procedure :: start
      procedure :: renew
      procedure :: omega
      procedure :: correct
      procedure :: look
      procedure :: move_parameters
      procedure :: rows_by_frequency
      procedure :: value_at
      procedure :: curvature
      procedure :: size_of
      procedure :: clear
      final :: release
   end type response_curve

contains

   !> Take a problem, which has to outlive the curve, with states of its own.
   subroutine start(self, problem, system, options)
      class(response_curve), intent(inout) :: self
      type(balance_problem), intent(in), target :: problem
      !> Whose loads act, and whose interrupt is listened to.
      type(balance_state), intent(in) :: system
      type(solver_options), intent(in) :: options

      call self%clear()
      self%problem => problem
      allocate (self%state, self%shifted, self%plane)
      self%newton%options = options
      call self%renew(system)
   end subroutine start

   !> The problem has changed: states are made anew, the direction across the curve is kept.
   subroutine renew(self, system)
      class(response_curve), intent(inout) :: self
      type(balance_state), intent(in) :: system

      call new_balance_state(self%problem, self%state)
      call new_balance_state(self%problem, self%shifted)
      call self%state%like(system)
      call self%shifted%like(system)
      self%state%reduced = .false.
      self%shifted%reduced = .false.
      self%linear%kind = self%newton%options%linear
      if (self%linear%kind /= linear_lu .and. self%linear%kind /= linear_krylov) then
         self%linear%kind = merge(linear_lu, linear_krylov, self%state%n <= sizes%lu_of_slopes)
      end if
      self%linear%keeps = .false.
      self%linear%lu_follows = .true.
      self%newton%options%linear = self%linear%kind
      if (allocated(self%border)) then
         if (size(self%border) /= self%state%n + 1) deallocate (self%border)
      end if
   end subroutine renew

   pure real(wp) function omega(self)
      class(response_curve), intent(in) :: self

      omega = self%x(size(self%x))
   end function omega

   !> Size of a change of x: of q over its size, and of omega over its value.
   pure real(wp) function size_of(self, change) result(length)
      class(response_curve), intent(in) :: self
      real(wp), intent(in) :: change(:)
      integer :: n

      n = size(change) - 1
      length = hypot(norm2(change(:n))/self%q_size, change(n + 1)/self%x(n + 1))
   end function size_of

   !> Newton's method from a guess, in the plane across the curve through it, or at its frequency
   !> where nothing is known of the curve. x is the last point where it does not converge.
   subroutine correct(self, guess, report, error, held)
      class(response_curve), intent(inout) :: self
      real(wp), intent(in) :: guess(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error
      !> Hold the frequency.
      logical, intent(in), optional :: held
      integer :: n

      n = size(guess) - 1
      if (present(held)) then
         if (held .and. allocated(self%border)) deallocate (self%border)
      end if
      self%x = guess
      ! Of the point that was looked at last, else of the guess.
      if (.not. allocated(self%t)) self%q_size = max(norm2(guess(:n)), tiny(1.0_wp))
      call self%state%set_frequency(guess(n + 1), error)
      if (allocated(error)) return
      call cut_across(self)
      call self%newton%solve(self%plane, self%x, report)
   end subroutine correct

   !> The plane through x; the frequency alone before the first direction is known.
   subroutine cut_across(self)
      class(response_curve), intent(inout) :: self
      integer :: n

      n = self%state%n
      if (.not. allocated(self%border)) then
         allocate (self%border(n + 1), source=0.0_wp)
         self%border(n + 1) = self%state%reference/self%x(n + 1)
      end if
      call self%plane%cut(self%state, self%x(:n), self%x(n + 1), self%border(:n), &
                          self%border(n + 1))
   end subroutine cut_across

   !> Direction and bend of the curve at the converged point x, and Q with its derivatives along
   !> it; done is false where the bordered matrix is singular. From now on the plane is across t.
   subroutine look(self, done, error)
      class(response_curve), intent(inout) :: self
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: r(self%state%n), rhs(self%state%n + 1)
      real(wp) :: change(self%state%n, -1:1), scale
      complex(wp), allocatable :: u(:), u_ss(:), side(:, :)
      integer :: k, n

      n = self%state%n
      done = .false.
      call self%state%set_frequency(self%omega(), error)
      if (allocated(error)) return
      call self%state%residual(self%x(:n), r)
      call cut_across(self)
      call self%linear%prepare(self%plane, done)
      if (.not. done) return
      call set_size(self%t, n + 1)
      call set_size(self%bend, n + 1)
      rhs = 0.0_wp
      rhs(n + 1) = -self%state%reference
      call self%linear%solve_prepared(self%plane, rhs, krylov_tolerance, self%t, done)
      if (.not. done) return
      call amplitudes_at(self%state, self%x, u)
      call self%q%take(self%kind, self%problem%fourier%harmonic, u)
      if (.not. allocated(self%u_s)) allocate (self%u_s, mold=u)
      call observe_along(self%state, self%x, self%t, self%u_s)
      self%q_size = max(norm2(self%x(:n)), smallest_share*norm2(abs(u)), tiny(1.0_wp))
      ! Of length one in what moves most. Forward is up in frequency, where that says something.
      scale = 1.0_wp/max(self%size_of(self%t), norm2(abs(self%u_s))/max(norm2(abs(u)), &
                                                                        tiny(1.0_wp)))
      if (self%t(n + 1) < 0.0_wp) scale = -scale
      self%t = scale*self%t
      self%u_s = scale*self%u_s
      self%step = difference
      allocate (side(size(self%problem%fourier%harmonic), -1:1))
      do k = -1, 1, 2
         call shift(self, k, error)
         if (allocated(error)) return
         call change_along(self%shifted, self%x + k*self%step*self%t, self%t, change(:, k))
         call observe_along(self%shifted, self%x + k*self%step*self%t, self%t, side(:, k))
      end do
      rhs(:n) = (change(:, 1) - change(:, -1))/(2.0_wp*self%step)
      rhs(n + 1) = 0.0_wp
      call self%linear%solve_prepared(self%plane, rhs, krylov_tolerance, self%bend, done)
      if (.not. done) return
      allocate (u_ss, mold=u)
      call observe_along(self%state, self%x, self%bend, u_ss)
      u_ss = u_ss + (side(:, 1) - side(:, -1))/(2.0_wp*self%step)
      self%slope = self%q%slope(self%u_s)
      self%second = self%q%second(self%u_s, self%u_s, u_ss)
      call turn_border(self)
   end subroutine look

   !> Q at x, where the state was evaluated last.
   real(wp) function value_at(self) result(value)
      class(response_curve), intent(inout) :: self
      type(response_quantity) :: q
      complex(wp), allocatable :: u(:)

      call amplitudes_at(self%state, self%x, u)
      call q%take(self%kind, self%problem%fourier%harmonic, u)
      value = q%value
   end function value_at

   !> d2Q/d omega2 along the curve.
   pure real(wp) function curvature(self)
      class(response_curve), intent(in) :: self

      associate (n => size(self%t))
         curvature = -huge(1.0_wp)
         if (abs(self%t(n)) > 0.0_wp) curvature = &
            (self%second - self%slope*self%bend(n)/self%t(n))/self%t(n)**2
      end associate
   end function curvature

   !> Across t for the next point; the present factors keep the border that they were made with.
   subroutine turn_border(self)
      class(response_curve), intent(inout) :: self
      integer :: n

      n = self%state%n
      associate (r => self%state%reference, b => self%border)
         b(:n) = r*self%t(:n)/self%q_size**2
         b(n + 1) = r*self%t(n + 1)/self%x(n + 1)**2
      end associate
   end subroutine turn_border

   !> Room for n values; what it held is lost.
   subroutine set_size(vector, n)
      real(wp), allocatable, intent(inout) :: vector(:)
      integer, intent(in) :: n

      if (allocated(vector)) then
         if (size(vector) == n) return
         deallocate (vector)
      end if
      allocate (vector(n))
   end subroutine set_size

   !> Evaluate and linearize the other state at a point beside x.
   subroutine shift(self, k, error)
      class(response_curve), intent(inout) :: self
      integer, intent(in) :: k
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: y(self%state%n + 1), r(self%state%n)
      integer :: n, n_linear

      n = self%state%n
      y = self%x + k*self%step*self%t
      call self%shifted%set_frequency(y(n + 1), error)
      if (allocated(error)) return
      call self%shifted%residual(y(:n), r)
      call self%shifted%linearize(n_linear)
   end subroutine shift

   !> R_q v + R_w v_w where a state was linearized, at x.
   subroutine change_along(state, x, v, change)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:), v(:)
      real(wp), intent(out), contiguous :: change(:)
      real(wp) :: by_omega(state%n)
      integer :: n

      n = state%n
      call state%apply(v(:n), change)
      call state%derivative_by(by_frequency, x(:n), by_omega)
      change = change + v(n + 1)*by_omega
   end subroutine change_along

   !> Amplitudes of the first observed quantity (n_retained).
   subroutine amplitudes_at(state, x, u)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      complex(wp), allocatable, intent(out) :: u(:)
      complex(wp) :: observed(state%problem%structure%n_observed, &
                              size(state%problem%fourier%harmonic))

      call observe(state, x(:state%n), observed)
      u = observed(1, :)
   end subroutine amplitudes_at

   !> Their change along v where a state stands at x.
   subroutine observe_along(state, x, v, u)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:), v(:)
      complex(wp), intent(out) :: u(:)
      complex(wp), dimension(state%problem%structure%n_observed, size(u)) :: moved, at_rest, slope
      real(wp) :: nothing(state%n)
      integer :: n

      n = state%n
      nothing = 0.0_wp
      ! Affine in the coordinates.
      call observe(state, v(:n), moved)
      call observe(state, nothing, at_rest)
      call observed_by_frequency(state, x(:n), slope)
      u = moved(1, :) - at_rest(1, :) + v(n + 1)*slope(1, :)
   end subroutine observe_along

   !> What the frequency changes of the observed quantities while the coordinates stay.
   subroutine observed_by_frequency(state, x, slope)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in), contiguous :: x(:)
      complex(wp), intent(out) :: slope(:, :)
      complex(wp), allocatable :: q(:, :)

      associate (s => state%problem%structure, f => state%problem%fourier)
         allocate (q(s%n_coordinates, f%n_retained))
         call to_complex(f, s%n_coordinates, x, q)
         call s%observed_slope(state%structure_state, q, slope)
      end associate
   end subroutine observed_by_frequency

   !> Along the resonance as each of some parameters changes: derivatives of its frequency and of
   !> Q, at the point that was looked at last.
   subroutine move_parameters(self, parameters, by_omega, by_value, done, error)
      class(response_curve), intent(inout) :: self
      type(parameter_entry), intent(in) :: parameters(:)
      !> (n_parameters)
      real(wp), intent(out) :: by_omega(:), by_value(:)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(slope_finder) :: finder(-1:1)
      type(parameter_slope) :: slope
      real(wp), allocatable :: moved(:, :), mixed(:, :)
      complex(wp), allocatable :: u_p(:, :), u_sp(:, :), along(:)
      real(wp) :: rhs(self%state%n + 1), change(self%state%n), second
      integer :: k, n, p

      n = self%state%n
      allocate (moved(n + 1, size(parameters)), mixed(n, size(parameters)), source=0.0_wp)
      allocate (u_p(size(self%u_s), size(parameters)), u_sp(size(self%u_s), size(parameters)), &
                source=(0.0_wp, 0.0_wp))
      allocate (along, mold=self%u_s)
      call finder(0)%start(self%state)
      call finder(0)%prepare(self%state, self%x(:n))
      do p = 1, size(parameters)
         call finder(0)%find(self%state, parameters(p), slope)
         rhs(:n) = reshape(slope%residual, [n])
         rhs(n + 1) = 0.0_wp
         call self%linear%solve_prepared(self%plane, rhs, krylov_tolerance, moved(:, p), done)
         if (.not. done) return
         call observe_along(self%state, self%x, moved(:, p), along)
         u_p(:, p) = along + slope%observed(1, :)
      end do
      do k = -1, 1, 2
         call shift(self, k, error)
         if (allocated(error)) return
         call finder(k)%start(self%shifted)
         associate (y => self%x + k*self%step*self%t, weight => real(k, wp)/(2.0_wp*self%step))
            call finder(k)%prepare(self%shifted, y(:n))
            do p = 1, size(parameters)
               call finder(k)%find(self%shifted, parameters(p), slope)
               call change_along(self%shifted, y, moved(:, p), change)
               mixed(:, p) = mixed(:, p) + weight*(change + reshape(slope%residual, [n]))
               call observe_along(self%shifted, y, moved(:, p), along)
               u_sp(:, p) = u_sp(:, p) + weight*(along + slope%observed(1, :))
            end do
         end associate
      end do
      do p = 1, size(parameters)
         rhs(:n) = mixed(:, p)
         rhs(n + 1) = 0.0_wp
         call solve_mixed(self, rhs, along, done)
         if (.not. done) return
         u_sp(:, p) = u_sp(:, p) + along
         second = self%q%second(self%u_s, u_p(:, p), u_sp(:, p))
         by_value(p) = self%q%slope(u_p(:, p)) - self%slope*second/self%second
         by_omega(p) = moved(n + 1, p) - self%t(n + 1)*second/self%second
      end do
   end subroutine move_parameters

   !> Derivatives by the frequency of the quantities of the finder, along the curve (n_rows).
   subroutine rows_by_frequency(self, finder, by_omega, error)
      class(response_curve), intent(inout) :: self
      type(sensitivity_finder), intent(in) :: finder
      real(wp), allocatable, intent(out) :: by_omega(:)
      type(error_type), allocatable, intent(out) :: error
      type(response_row), allocatable :: rows(:)
      integer :: k, n

      n = self%state%n
      do k = -1, 1, 2
         call shift(self, k, error)
         if (allocated(error)) return
         associate (y => self%x + k*self%step*self%t)
            call new_rows(self%shifted, y(:n), finder%quantities, finder%mu, &
                          finder%wear_coefficient, finder%wears_by_energy, rows)
         end associate
         if (k < 0) allocate (by_omega(size(rows)), source=0.0_wp)
         by_omega = by_omega + k*rows%value/(2.0_wp*self%step*self%t(n + 1))
      end do
   end subroutine rows_by_frequency

   !> Amplitudes along x_sp.
   subroutine solve_mixed(self, rhs, u, done)
      class(response_curve), intent(inout) :: self
      real(wp), intent(in), contiguous :: rhs(:)
      complex(wp), intent(out) :: u(:)
      logical, intent(out) :: done
      real(wp) :: mixed(size(rhs))

      call self%linear%solve_prepared(self%plane, rhs, krylov_tolerance, mixed, done)
      if (done) call observe_along(self%state, self%x, mixed, u)
   end subroutine solve_mixed

   !> Leave the problem, which need not live on.
   subroutine clear(self)
      class(response_curve), intent(inout) :: self

      if (associated(self%state)) deallocate (self%state)
      if (associated(self%shifted)) deallocate (self%shifted)
      if (associated(self%plane)) deallocate (self%plane)
      nullify (self%state, self%shifted, self%plane, self%problem)
   end subroutine clear

   subroutine release(self)
      type(response_curve), intent(inout) :: self

      call self%clear()
   end subroutine release

end module fw_response_curve
