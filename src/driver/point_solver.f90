!> One solution point: warm start, other guesses, intermediate frequencies or loads, then what is
!> reported.
module fw_point_solver
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_case, only: case_type
   use fw_contact_data, only: memory_carried
   use fw_error, only: error_type
   use fw_guess, only: free_guess
   use fw_guess, only: stuck_guess
   use fw_harmonics_options, only: method_hdhb
   use fw_hbm, only: hbm_system
   use fw_hdhb, only: hdhb_system
   use fw_hdhb, only: new_hdhb
   use fw_newton, only: newton_solver
   use fw_newton, only: solver_report
   use fw_point, only: point_type
   use fw_recovery, only: recover_histories
   use fw_recovery, only: recover_point
   implicit none (type, external)
   private

   public :: point_solver

   !> Halvings of a frequency step that fails.
   integer, parameter :: max_halvings = 6
   !> First and smallest step of the load on the way to a first solution.
   real(wp), parameter :: first_load_step = 0.25_wp, smallest_load_step = 1.0_wp/512.0_wp

   type :: point_solver
      type(newton_solver) :: newton
      !> The present solution, and the last two converged ones with their frequencies.
      real(wp), allocatable :: x(:), last(:), before(:)
      real(wp) :: omega_last = -1.0_wp
      real(wp) :: omega_before = -1.0_wp
      integer :: n_converged = 0
      !> Solve for values at the instants (hdhb) instead of coefficients.
      logical :: in_time = .false.
   contains
      procedure :: start
      procedure :: solve
   end type point_solver

contains

   subroutine start(self, case, n)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: n

      self%newton%options = case%solver
      self%in_time = case%harmonics%method == method_hdhb
      allocate (self%x(n), self%last(n), self%before(n), source=0.0_wp)
   end subroutine start

   !> Solve at a frequency; not converging is an outcome, marked in the point.
   subroutine solve(self, case, system, omega, point, error)
      class(point_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      integer(int64) :: clock, clock_end, rate

      call system_clock(clock, rate)
      call reach(self, system, omega, report, point%iterations, error)
      if (allocated(error)) return
      point%omega = omega
      point%converged = report%converged
      point%residual = report%residual
      call recover_point(system, self%x, case%harmonics%n_harmonics, case%output%contact, point)
      if (case%output%histories) then
         call recover_histories(system, size(system%balance, 1), self%x, case%harmonics%n_harmonics, point)
      end if
      if (report%converged .and. case%contact%memory == memory_carried) then
         system%contact%x_start = system%contact%x
      end if
      call system_clock(clock_end)
      point%seconds = real(clock_end - clock, wp)/real(rate, wp)
   end subroutine solve

   !> Newton from the best guesses known. Where all fail: from the last point on the sweep by
   !> halves, or to the first point by raising the load; and at last from the solution without
   !> contact, which may lie on another branch.
   subroutine reach(self, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: closest(:)

      call approach(self, system, omega, 0, report, iterations, error)
      if (allocated(error)) return
      if (report%converged .or. .not. self%newton%options%fallback) return
      if (self%n_converged == 0) then
         call raise_load(self, system, omega, report, iterations, error)
         if (allocated(error) .or. report%converged) return
      end if
      closest = self%x
      call free_guess(system, self%x)
      call solve_balance(self, system, report)
      iterations = iterations + report%iterations
      if (report%converged) then
         call remember(self, omega)
      else
         self%x = closest
      end if
   end subroutine reach

   !> From the static position to the full vibratory load, by steps that adapt.
   subroutine raise_load(self, system, omega, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: reached(:)
      real(wp) :: share, step

      share = 0.0_wp
      step = first_load_step
      system%load_share = 0.0_wp
      call system%set_frequency(omega, error)
      if (allocated(error)) return
      call stuck_guess(system, self%x)
      reached = self%x
      do
         system%load_share = min(1.0_wp, share + step)
         call system%set_frequency(omega, error)
         if (allocated(error)) exit
         call solve_balance(self, system, report)
         iterations = iterations + report%iterations
         if (report%converged) then
            reached = self%x
            share = system%load_share
            if (share >= 1.0_wp) exit
            step = 1.5_wp*step
         else
            self%x = reached
            step = 0.5_wp*step
            if (step < smallest_load_step) exit
         end if
      end do
      system%load_share = 1.0_wp
      if (report%converged) then
         call remember(self, omega)
      else if (.not. allocated(error)) then
         call system%set_frequency(omega, error)
      end if
   end subroutine raise_load

   !> Newton from the guesses; where they fail, first go half of the way from the last point.
   recursive subroutine approach(self, system, omega, depth, report, iterations, error)
      class(point_solver), intent(inout) :: self
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in) :: omega
      integer, intent(in) :: depth
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      type(error_type), allocatable, intent(out) :: error

      call system%set_frequency(omega, error)
      if (allocated(error)) return
      call try_guesses(self, system, omega, report, iterations)
      if (report%converged) then
         call remember(self, omega)
         return
      end if
      if (depth == max_halvings .or. self%n_converged == 0) return
      if (.not. self%newton%options%fallback) return
      call approach(self, system, 0.5_wp*(self%omega_last + omega), depth + 1, report, iterations, error)
      if (allocated(error)) return
      if (report%converged) call approach(self, system, omega, depth + 1, report, iterations, error)
      if (allocated(error)) return
      if (.not. report%converged) call system%set_frequency(omega, error)
   end subroutine approach

   !> Extrapolation along the sweep, the last solution, all stuck.
   subroutine try_guesses(self, system, omega, report, iterations)
      class(point_solver), intent(inout) :: self
      type(hbm_system), intent(inout), target :: system
      real(wp), intent(in) :: omega
      type(solver_report), intent(out) :: report
      integer, intent(inout) :: iterations
      integer :: guess, first
      real(wp) :: step

      first = 3
      if (self%n_converged > 0) first = 2
      if (self%n_converged > 1) first = 1
      do guess = first, 3
         select case (guess)
         case (1)
            step = (omega - self%omega_last)/(self%omega_last - self%omega_before)
            self%x = self%last + step*(self%last - self%before)
         case (2)
            self%x = self%last
         case (3)
            call stuck_guess(system, self%x)
         end select
         call solve_balance(self, system, report)
         iterations = iterations + report%iterations
         if (report%converged .or. .not. self%newton%options%fallback) exit
      end do
   end subroutine try_guesses

   !> From the guess in x, in the unknowns of the method.
   subroutine solve_balance(self, system, report)
      class(point_solver), intent(inout) :: self
      type(hbm_system), intent(inout), target :: system
      type(solver_report), intent(out) :: report
      type(hdhb_system) :: in_time
      real(wp), allocatable :: values(:)
      integer :: m

      if (.not. self%in_time) then
         call self%newton%solve(system, self%x, report)
         return
      end if
      in_time = new_hdhb(system)
      m = system%structure%n_coordinates
      allocate (values(system%n))
      call in_time%to_values(m, self%x, values)
      call self%newton%solve(in_time, values, report)
      call in_time%to_coefficients(m, values, self%x)
   end subroutine solve_balance

   subroutine remember(self, omega)
      class(point_solver), intent(inout) :: self
      real(wp), intent(in) :: omega

      if (abs(omega - self%omega_last) <= 0.0_wp) return
      self%before = self%last
      self%omega_before = self%omega_last
      self%last = self%x
      self%omega_last = omega
      self%n_converged = self%n_converged + 1
   end subroutine remember

end module fw_point_solver
