!> Derivatives of a response of given amplitude by parameters of its case: with g the condition of
!> the amplitude and s the load,
!>
!>   [ J    R_s ] [ dq ]     [ R_p ]        dQ/dp = Q_p + Q_q dq + Q_s ds       (direct)
!>   [ g_q  g_s ] [ ds ] = - [ g_p ] ,            = Q_p - (w, v) . (R_p, g_p)   (adjoint),
!>
!>   the transposed matrix times (w, v) being (Q_q, Q_s), or (0, 1) for the load itself.
!>
!> The bordered matrix is regular where J alone is not: at folds of the response to a given load.
module fw_control_sensitivity
   use fw_control_system, only: control_system
   use fw_kinds, only: wp
   use fw_parameter_slopes, only: parameter_entry, parameter_slope, slope_finder
   use fw_parameters, only: harmonic_scale
   use fw_response_rows, only: new_rows
   use fw_sensitivity, only: by_adjoint, by_counts, change_of, follow, held_change, pull_row, &
      sensitivity_finder
   use fw_solver_options, only: linear_krylov, linear_lu
   use fw_transposed_balance, only: transposed_balance
   implicit none (type, external)
   private

   public :: find_control_slopes, multiply_transposed

   !> Relative residual asked of GMRES, and what a derivative may be left with.
   real(wp), parameter :: krylov_tolerance = 1.0e-12_wp, worst_residual = 1.0e-8_wp

contains

   !> Fill rows and derivatives of the finder, whose parameters are set, and give those of the load.
   !> False where the bordered matrix is singular, as at a fold over the place.
   subroutine find_control_slopes(control, y, finder, load_by, done)
      type(control_system), intent(inout) :: control
      !> The solution, where the system stands: unknowns of the balance, then the load.
      real(wp), intent(in), contiguous :: y(:)
      type(sensitivity_finder), intent(inout) :: finder
      !> (n_parameters)
      real(wp), intent(out) :: load_by(:)
      logical, intent(out) :: done
      type(slope_finder) :: slopes
      type(parameter_slope) :: by_load
      real(wp) :: r(size(y))
      logical :: adjoint, nearly, reduced

      reduced = control%reduced
      nearly = control%state%nearly
      ! Whole: the transposed problem knows no coordinates that are solved at once.
      control%reduced = .false.
      control%state%nearly = .false.
      load_by = 0.0_wp
      call control%residual(y, r)
      associate (state => control%state, n => size(y) - 1)
         call new_rows(state, y(:n), finder%quantities, finder%mu, finder%wear_coefficient, &
                       finder%wears_by_energy, finder%rows)
         finder%linear%kind = merge(linear_lu, linear_krylov, size(y) <= finder%lu_up_to)
         finder%linear%keeps = .false.
         if (allocated(finder%derivative)) deallocate (finder%derivative)
         allocate (finder%derivative(size(finder%rows), size(finder%parameters)), source=0.0_wp)
         ! A load that vanishes has no unit of itself.
         done = y(n + 1) > 0.0_wp
         if (done) call finder%linear%prepare(control, done)
         if (done) then
            call slopes%start(state)
            call slopes%prepare(state, y(:n))
            call slopes%find(state, parameter_entry(number=harmonic_scale, value=y(n + 1)), by_load)
            adjoint = state%problem%structure%knows_field .and. finder%linear%factored
            if (finder%way == by_counts) then
               adjoint = adjoint .and. size(finder%rows) + 1 < size(finder%parameters)
            else
               adjoint = adjoint .and. finder%way == by_adjoint
            end if
            if (adjoint) then
               call find_adjoint(control, finder, slopes, by_load, load_by, done)
            else
               call find_direct(control, finder, slopes, by_load, load_by, done)
            end if
         end if
         state%nearly = nearly
      end associate
      control%reduced = reduced
   end subroutine find_control_slopes

   !> (R_p, g_p), and all else that the parameter changes while the unknowns stay.
   subroutine find_slope(control, slopes, parameter, slope, r)
      type(control_system), intent(inout) :: control
      type(slope_finder), intent(inout) :: slopes
      type(parameter_entry), intent(in) :: parameter
      type(parameter_slope), intent(inout) :: slope
      real(wp), intent(out) :: r(:)

      call slopes%find(control%state, parameter, slope)
      r(:size(r) - 1) = reshape(slope%residual, [size(r) - 1])
      r(size(r)) = control%condition_slope(slope%observed)
   end subroutine find_slope

   !> One solution for each parameter.
   subroutine find_direct(control, finder, slopes, by_load, load_by, done)
      type(control_system), intent(inout) :: control
      type(sensitivity_finder), intent(inout) :: finder
      type(slope_finder), intent(inout) :: slopes
      !> What the load changes while the coordinates stay.
      type(parameter_slope), intent(in) :: by_load
      real(wp), intent(out) :: load_by(:)
      logical, intent(out) :: done
      type(parameter_slope) :: slope
      real(wp) :: r(control%n), v(control%n), product(control%n)
      integer :: k, n, p

      n = control%state%n
      done = .true.
      do p = 1, size(finder%parameters)
         call find_slope(control, slopes, finder%parameters(p), slope, r)
         v = 0.0_wp
         if (norm2(r) > 0.0_wp) then
            call finder%linear%solve_prepared(control, r, krylov_tolerance, v, done)
            finder%n_direct = finder%n_direct + 1
         end if
         ! Its inner product leaves what forces follow by.
         call control%apply(v, product)
         if (done) done = norm2(product + r) <= worst_residual*norm2(r)
         if (.not. done) return
         load_by(p) = v(n + 1)
         slope%observed = slope%observed + v(n + 1)*by_load%observed
         slope%force = slope%force + v(n + 1)*by_load%force
         call follow(control%state, slopes%at_rest, v(:n), slope)
         do k = 1, size(finder%rows)
            finder%derivative(k, p) = change_of(control%state, finder%rows(k), &
                                                finder%parameters(p), slope, v(:n))
         end do
      end do
   end subroutine find_direct

   !> One solution with the transposed matrix for each quantity, and one for the load.
   subroutine find_adjoint(control, finder, slopes, by_load, load_by, done)
      type(control_system), intent(inout) :: control
      type(sensitivity_finder), intent(inout) :: finder
      type(slope_finder), intent(inout) :: slopes
      type(parameter_slope), intent(in) :: by_load
      real(wp), intent(out) :: load_by(:)
      logical, intent(out) :: done
      type(parameter_slope) :: slope
      real(wp), allocatable :: w(:, :)
      real(wp) :: r(control%n), rhs(control%n), product(control%n)
      integer :: k, n, p

      n = control%state%n
      allocate (w(n + 1, size(finder%rows) + 1))
      do k = 1, size(w, 2)
         rhs = 0.0_wp
         if (k <= size(finder%rows)) then
            call pull_row(control%state, finder%rows(k), rhs(:n))
            rhs(n + 1) = held_change(finder%rows(k), load_entry(), by_load)
         else
            rhs(n + 1) = 1.0_wp
         end if
         w(:, k) = rhs
         call finder%linear%lu%solve_transposed(w(:, k))
         finder%n_adjoint = finder%n_adjoint + 1
         call multiply_transposed(control, w(:, k), product)
         done = norm2(product - rhs) <= worst_residual*norm2(rhs)
         if (.not. done) return
      end do
      do p = 1, size(finder%parameters)
         call find_slope(control, slopes, finder%parameters(p), slope, r)
         do k = 1, size(finder%rows)
            finder%derivative(k, p) = held_change(finder%rows(k), finder%parameters(p), slope) - &
                                      dot_product(w(:, k), r)
         end do
         load_by(p) = -dot_product(w(:, size(w, 2)), r)
      end do
   end subroutine find_adjoint

   !> No quantity has the load but through what it moves.
   pure type(parameter_entry) function load_entry() result(entry)
      entry%number = harmonic_scale
   end function load_entry

   !> The transposed bordered matrix times a vector, where it was linearized whole.
   subroutine multiply_transposed(control, vector, product)
      type(control_system), intent(inout) :: control
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      type(transposed_balance) :: transposed
      integer :: n

      n = size(vector) - 1
      transposed%state => control%state
      call transposed%apply(vector(:n), product(:n))
      product(:n) = product(:n) + vector(n + 1)*control%border
      product(n + 1) = dot_product(control%column, vector(:n)) + control%corner_p*vector(n + 1)
   end subroutine multiply_transposed

end module fw_control_sensitivity
