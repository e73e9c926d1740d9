!> Derivatives of a nonlinear mode by parameters of its case, at held amplitude: with y the unknowns
!> of the mode and F its equations,
!>
!>   F_y v = -F_p,    F_p = (R_p/A, 0, 0),    v = (dq, domega, dxi)/dp,
!>
!> by the bordered matrix, one solution for each parameter: the conditions know no parameter, and
!> slopes R_p are those of a response. Forces of pairs follow dq, and, where they take the balance
!> or the time, omega and xi as well.
module fw_mode_sensitivity
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_open
   use fw_kinds, only: wp
   use fw_mode_system, only: mode_system
   use fw_parameter_slopes, only: parameter_slope, slope_finder
   use fw_recovery, only: observe
   use fw_response_rows, only: new_rows
   use fw_sensitivity, only: change_of, sensitivity_finder
   use fw_solver_options, only: linear_auto
   use fw_structure_operator, only: by_frequency, by_self_excitation
   implicit none (type, external)
   private

   public :: find_mode_slopes

   !> Relative residual asked of GMRES, and what a derivative may be left with.
   real(wp), parameter :: krylov_tolerance = 1.0e-12_wp, worst_residual = 1.0e-8_wp

contains

   !> Fill rows and derivatives of the finder, whose parameters are set, and give those of omega and
   !> of the damping ratio. False where the bordered matrix is singular, as at a fold of the curve.
   subroutine find_mode_slopes(system, y, finder, omega_by, ratio_by, done)
      type(mode_system), intent(inout) :: system
      !> The solution, at the amplitude where the system stands.
      real(wp), intent(in), contiguous :: y(:)
      type(sensitivity_finder), intent(inout) :: finder
      !> (n_parameters)
      real(wp), intent(out) :: omega_by(:), ratio_by(:)
      logical, intent(out) :: done
      type(slope_finder) :: slopes
      type(parameter_slope) :: slope
      real(wp) :: q(system%balance%n), r(system%n), v(system%n), product(system%n), omega, xi
      logical :: reduced
      integer :: k, p

      reduced = system%reduced
      system%reduced = .false.
      call system%residual(y, r)
      call system%to_balance(y, q, omega, xi)
      call new_rows(system%balance, q, finder%quantities, finder%mu, finder%wear_coefficient, &
                    finder%wears_by_energy, finder%rows)
      finder%linear%kind = linear_auto
      finder%linear%keeps = .false.
      call finder%linear%prepare(system, done)
      if (allocated(finder%derivative)) deallocate (finder%derivative)
      allocate (finder%derivative(size(finder%rows), size(finder%parameters)), source=0.0_wp)
      if (done) then
         call slopes%start(system%balance)
         call slopes%prepare(system%balance, q)
      end if
      do p = 1, merge(size(finder%parameters), 0, done)
         call slopes%find(system%balance, finder%parameters(p), slope)
         r = 0.0_wp
         r(:size(q)) = reshape(slope%residual, [size(q)])/system%length()
         v = 0.0_wp
         if (norm2(r) > 0.0_wp) then
            call finder%linear%solve_prepared(system, r, krylov_tolerance, v, done)
            finder%n_direct = finder%n_direct + 1
            call system%apply(v, product)
            if (done) done = norm2(product + r) <= worst_residual*norm2(r)
            if (.not. done) exit
         end if
         omega_by(p) = system%frequency_unit*v(system%n - 1)
         ! zeta = xi/(2 omega).
         ratio_by(p) = 0.5_wp*(system%frequency_unit*v(system%n) - xi/omega*omega_by(p))/omega
         call follow(system, q, v, slopes%at_rest, slope)
         do k = 1, size(finder%rows)
            finder%derivative(k, p) = change_of(system%balance, finder%rows(k), &
                                                finder%parameters(p), slope, v(:size(q)))
         end do
      end do
      system%reduced = reduced
   end subroutine find_mode_slopes

   !> From changes at held unknowns to those with the unknowns moving by v, whose first entries
   !> become changes of the coordinates.
   subroutine follow(system, q, v, at_rest, slope)
      type(mode_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: q(:)
      real(wp), intent(inout), contiguous :: v(:)
      !> Observed quantities where all coordinates rest.
      complex(wp), intent(in) :: at_rest(:, :)
      type(parameter_slope), intent(inout) :: slope
      complex(wp) :: moved(size(at_rest, 1), size(at_rest, 2))
      real(wp) :: dq(size(q)), product(size(q)), rates(2), unused(2)
      integer :: k
      integer, parameter :: parameters(*) = [by_frequency, by_self_excitation]

      rates = system%frequency_unit*v(size(q) + 1:)
      call system%to_balance(v, dq, unused(1), unused(2))
      associate (state => system%balance)
         call observe(state, dq, moved)
         slope%observed = slope%observed + moved - at_rest
         if (state%problem%n_pairs > 0) then
            call state%apply(dq, product)
            call add_forces(state, 1.0_wp, slope)
            associate (p => state%problem%forces%entry(state%problem%forces%pairs)%law%prediction)
               do k = 1, 2
                  if (.not. (p%takes_balance .or. (p%by_time .and. k == 1))) cycle
                  call state%derivative_by(parameters(k), q, product)
                  call add_forces(state, rates(k), slope)
               end do
               if (p%has_inertia) call add_law_by_frequency(state, rates(1), slope)
            end associate
         end if
      end associate
      v(:size(q)) = dq
   end subroutine follow

   !> Add the outputs of the pairs that the last product left.
   subroutine add_forces(state, factor, slope)
      type(balance_state), intent(in) :: state
      real(wp), intent(in) :: factor
      type(parameter_slope), intent(inout) :: slope
      integer :: c, i, nc

      nc = state%problem%fourier%n_coefficients
      associate (work => state%work(state%problem%forces%pairs))
         do i = 1, state%problem%n_pairs
            if (work%linear_state(i) == pair_open) cycle
            do c = 1, 3
               slope%force(i, c, :) = slope%force(i, c, :) + &
                                      factor*work%output((c - 1)*nc + 1:c*nc, i)
            end do
         end do
      end associate
   end subroutine add_forces

   !> A law with inertia depends on the frequency by itself: a central difference, as in the
   !> derivative of the balance.
   subroutine add_law_by_frequency(state, factor, slope)
      type(balance_state), intent(inout) :: state
      real(wp), intent(in) :: factor
      type(parameter_slope), intent(inout) :: slope
      real(wp), parameter :: relative_step = 1.0e-5_wp
      real(wp) :: step
      integer :: side

      step = relative_step*state%frequency()
      associate (law => state%problem%forces%entry(state%problem%forces%pairs)%law, &
                 work => state%work(state%problem%forces%pairs))
         do side = -1, 1, 2
            work%rate = state%frequency() + side*step
            call law%evaluate(state%problem%fourier, work)
            slope%force = slope%force + factor*0.5_wp*side/step*work%force
         end do
         work%rate = state%frequency()
         call law%evaluate(state%problem%fourier, work)
      end associate
   end subroutine add_law_by_frequency

end module fw_mode_sensitivity
