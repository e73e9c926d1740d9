!> A few periods of integration in time, from the stuck response on, as a start of a balance: what
!> is left of the way is a Newton iteration. Slow stick-slip, whose square waves no balance of few
!> harmonics resembles, dies out to its periodic motion within some periods.
module fw_integrated_start
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type, status_stopped
   use fw_kept_modes, only: complete_modes
   use fw_kinds, only: wp
   use fw_level, only: level_type
   use fw_point, only: point_type
   use fw_strategy, only: point_request
   use fw_time_response, only: time_strategy
   implicit none (type, external)
   private

   public :: can_integrate, integrate_a_few

   !> Periods at most, and the relative change of the last one that is enough.
   integer, parameter :: few_periods = 60
   real(wp), parameter :: close_enough = 1.0e-4_wp
   !> Steps of a period: at least so many, and this many for each harmonic.
   integer, parameter :: fewest_steps = 1024, steps_per_harmonic = 16
   !> Dofs up to which the dense steps of the integration cost no more than the balances would.
   integer, parameter :: most_dofs = 100

contains

   !> Whether the motion of the case can be integrated, at the price of a start.
   logical function can_integrate(case, level)
      type(case_type), intent(in) :: case
      type(level_type), intent(in) :: level

      can_integrate = analyses(case%analysis)%is_response &
                      .and. .not. case%model%cyclic%is_cyclic .and. .not. case%over%is_wanted() &
                      .and. .not. case%control%is_wanted() .and. case%model%n_dof <= most_dofs &
                      .and. level%system%problem%structure%n_relative > 0
      if (.not. can_integrate .or. case%contact%n_pairs == 0) return
      associate (forces => level%system%problem%forces)
         can_integrate = forces%entry(forces%pairs)%law%facts%is_integrated
      end associate
   end function can_integrate

   !> Unknowns of the level from the last period of an integration.
   subroutine integrate_a_few(case, level, request, x, done, error)
      type(case_type), intent(in) :: case
      type(level_type), intent(inout) :: level
      type(point_request), intent(in) :: request
      real(wp), allocatable, intent(out) :: x(:)
      !> Whether there is a motion at all, periodic or not.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      class(time_strategy), allocatable :: integration
      class(case_type), allocatable :: fast
      type(point_request) :: bare
      type(point_type) :: point

      call case_of_integration(case, level, fast)
      allocate (integration)
      done = .false.
      call integration%start(fast, error)
      call forgive(error)
      if (allocated(error) .or. .not. allocated(integration%structure%mass)) return
      bare = point_request(omega=request%omega, fallback=.false., interrupt=request%interrupt)
      ! All harmonics of the level, where few served for the state to start from.
      fast%harmonics%n_harmonics = level%harmonics%n_harmonics
      call integration%solve(fast, bare, point, error)
      call forgive(error)
      if (allocated(error) .or. .not. allocated(point%coefficients)) return
      allocate (x(level%system%n), source=0.0_wp)
      done = all(abs(point%coefficients) < huge(1.0_wp))
      if (done) call take_coefficients(level, point%coefficients, x)
      if (done) call complete_modes(level%system, level%harmonics%n_harmonics, x, done)
   end subroutine integrate_a_few

   !> A start that does not exist is no reason to end the run; that somebody asks for the end is.
   subroutine forgive(error)
      type(error_type), allocatable, intent(inout) :: error

      if (.not. allocated(error)) return
      if (error%status /= status_stopped) deallocate (error)
   end subroutine forgive

   !> The case with its relative coordinates observed, and a first state that costs little.
   subroutine case_of_integration(case, level, fast)
      type(case_type), intent(in) :: case
      type(level_type), intent(in) :: level
      class(case_type), allocatable, intent(out) :: fast

      allocate (fast, source=case)
      fast%harmonics%n_harmonics = max(1, case%model%waves%highest(), case%contact%highest_gap())
      fast%solver%fallback = .false.
      fast%solver%tolerance = close_enough
      fast%time%n_periods = few_periods
      fast%time%steps_per_period = max(fewest_steps, &
                                       steps_per_harmonic*level%harmonics%n_harmonics)
      call level%system%problem%joint%relative%rows(fast%model%observe_matrix)
   end subroutine case_of_integration

   !> Coefficients (0, c1, s1, ..) of the relative coordinates into the harmonics of the level.
   pure subroutine take_coefficients(level, coefficients, x)
      type(level_type), intent(in) :: level
      !> (2H+1, n_relative).
      real(wp), intent(in) :: coefficients(:, :)
      real(wp), intent(inout) :: x(:)
      integer :: c, first, h, n

      associate (fourier => level%system%problem%fourier, &
                 structure => level%system%problem%structure)
         do h = 1, fourier%n_retained
            n = fourier%harmonic(h)
            if (2*n + 1 > size(coefficients, 1)) cycle
            do c = 0, merge(0, 1, n == 0)
               first = (fourier%column(h) + c - 1)*structure%n_coordinates
               x(first + 1:first + structure%n_relative) = coefficients(max(1, 2*n) + c, :)
            end do
         end do
      end associate
   end subroutine take_coefficients

end module fw_integrated_start
