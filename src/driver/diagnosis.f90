!> Why a joint has no periodic vibration, where none was found: in words that say what to change.
module fw_diagnosis
   use fw_error, only: error_type
   use fw_guess, only: held_without_friction, stuck_guess
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_response, only: response
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: explain_failure, finer, takes_scale

   !> A relative residual that is a solution to every purpose: what ends there without converging
   !> was asked for more than round-off leaves.
   ! Round-off of the balance stays below 1e-13 where the load is not hidden by a resonance.
   real(wp), parameter :: as_good_as_solved = 1.0e-10_wp
   !> Halvings of the interval in which the largest share of the load is looked for that converges.
   ! To 1.6 % of the load: the number is for a reader.
   integer, parameter :: n_halvings = 6

contains

   !> Solve the static position, then for the largest share of the vibratory load that has a
   !> periodic solution, at the frequency and depths of the system; all within the time of a point.
   subroutine explain_failure(system, method, reason)
      type(balance_state), intent(inout), target :: system
      type(response), intent(inout) :: method
      character(:), allocatable, intent(out) :: reason
      real(wp) :: x(system%n), residual
      logical :: done

      call blame_law(system, reason)
      if (allocated(reason)) return
      if (method%unbounded) then
         reason = 'the vibration grows without bound: the excitation meets a mode that neither '// &
                  'damping nor contact limits; give it damping or shift the frequency'
         return
      end if
      ! The guess for the position at rest is one without the vibratory load.
      call solve_share(system, method, 0.0_wp, x, done, only_set=.true.)
      call stuck_guess(system, x)
      associate (options => method%newton%options)
         if (associated(system%interrupt)) call system%interrupt%limit_point(options%max_seconds)
         call solve_share(system, method, 0.0_wp, x, done, residual=residual)
         if (.not. done .and. residual <= as_good_as_solved) then
            call blame_tolerance(residual, options%tolerance, reason)
         else if (done) then
            call explain_vibration(system, method, x, reason)
         else
            reason = 'the joint cannot carry its static load: no position at rest was found; '// &
                     'it needs more preload, friction or support, or a smaller static load'
         end if
      end associate
      ! The whole load again, for whoever goes on with the system.
      call solve_share(system, method, 1.0_wp, x, done, only_set=.true.)
      if (system%is_interrupted()) reason = 'why was not looked for to the end'
      if (associated(system%interrupt)) call system%interrupt%limit_point(0.0_wp)
   end subroutine explain_failure

   !> A law that had no force for a motion at this frequency.
   subroutine blame_law(system, reason)
      type(balance_state), intent(in) :: system
      character(:), allocatable, intent(out) :: reason
      character(400) :: text
      integer :: k

      do k = 1, system%problem%forces%n_laws
         associate (work => system%work(k))
            if (work%refusal%element == 0) cycle
            if (abs(work%refusal%omega - system%frequency()) > 0.0_wp) cycle
            call system%problem%forces%entry(k)%law%complaint(work, text)
            reason = trim(text)//', and no way led past that'
            return
         end associate
      end do
   end subroutine blame_law

   !> The largest share of the vibratory load that has a solution, from the position at rest on.
   subroutine explain_vibration(system, method, x, reason)
      type(balance_state), intent(inout), target :: system
      type(response), intent(inout) :: method
      !> Position at rest on entry.
      real(wp), intent(inout), contiguous :: x(:)
      character(:), allocatable, intent(out) :: reason
      character(8) :: percent
      real(wp) :: lower, residual
      logical :: done

      call solve_share(system, method, 1.0_wp, x, done, residual=residual)
      if (.not. done .and. residual <= as_good_as_solved) then
         call blame_tolerance(residual, method%newton%options%tolerance, reason)
         return
      else if (done) then
         reason = 'the vibration itself converges from its position at rest; try smaller '// &
                  'steps, or another solver%kind or scheme'
         return
      end if
      ! The share that has a solution is a lower bound; where none has, it is 0.
      call find_largest_share(system, method, x, lower)
      write (percent, '(f6.1, a)') 100.0_wp*lower, ' %'
      reason = 'above '//trim(adjustl(percent))//' of the vibratory load no periodic '// &
               'vibration was found'
      if (.not. held_without_friction(system)) then
         reason = 'the joint cannot carry its static load while it slides, for only '// &
                  'friction holds it: '//reason//'; it needs more preload, friction or support'
      else if (size(system%depth) == 0) then
         reason = reason//'; try '//trim(finer(system))//', or a sweep that starts where the '// &
                  'response is small; an undamped resonance needs damping'
      else if (takes_scale(system)) then
         reason = reason//'; try another penalty_scale (0.3 or 3), '//trim(finer(system))// &
                  ', or a sweep that starts where the response is small; an undamped resonance '// &
                  'needs damping'
      else
         reason = reason//"; try law = 'dlft' where the contact is much stiffer than the "// &
                  'structure, '//trim(finer(system))//', or a sweep that starts where the '// &
                  'response is small; an undamped resonance needs damping'
      end if
   end subroutine explain_vibration

   !> Where everything converged but for the last digits.
   subroutine blame_tolerance(residual, tolerance, reason)
      real(wp), intent(in) :: residual, tolerance
      character(:), allocatable, intent(out) :: reason

      reason = 'the residual ends at '//to_text(residual)//', which is round-off, and '// &
               'solver%tolerance = '//to_text(tolerance)//' asks for less; take 1e-10 or more'
   end subroutine blame_tolerance

   !> Whether the case accepts a penalty_scale: its pairs have a rigid law.
   pure logical function takes_scale(system)
      type(balance_state), intent(in) :: system

      takes_scale = size(system%depth) > 0 .and. &
                    system%problem%forces%entry( &
                       system%problem%forces%pairs)%law%prediction%takes_balance
   end function takes_scale

   !> What resolves the contact better: located events do not depend on the instants.
   pure function finer(system) result(advice)
      type(balance_state), intent(in) :: system
      character(16) :: advice

      advice = 'more n_time'
      if (system%problem%forces%entry(system%problem%forces%pairs)%law%facts%follows_events) then
         advice = 'more n_harmonics'
      end if
   end function finer

   !> By halves of the interval between a share that has a solution and one that has none.
   subroutine find_largest_share(system, method, x, lower)
      type(balance_state), intent(inout), target :: system
      type(response), intent(inout) :: method
      real(wp), intent(inout), contiguous :: x(:)
      real(wp), intent(out) :: lower
      real(wp) :: upper, middle
      logical :: done
      integer :: k

      ! Shares of 0 and 1 have been tried: one converged, the other did not.
      lower = 0.0_wp
      upper = 1.0_wp
      do k = 1, n_halvings
         middle = 0.5_wp*(lower + upper)
         call solve_share(system, method, middle, x, done)
         if (done) then
            lower = middle
         else
            upper = middle
         end if
      end do
   end subroutine find_largest_share

   !> Solve under a share of the vibratory load, from x, which stays where that fails.
   subroutine solve_share(system, method, share, x, done, only_set, residual)
      type(balance_state), intent(inout), target :: system
      type(response), intent(inout) :: method
      real(wp), intent(in) :: share
      real(wp), intent(inout), contiguous :: x(:)
      logical, intent(out) :: done
      !> Bring the system to the share and leave it there.
      logical, intent(in), optional :: only_set
      !> Relative residual where it ended.
      real(wp), intent(out), optional :: residual
      type(error_type), allocatable :: error
      type(solver_report) :: report
      real(wp) :: trial(size(x))

      if (present(residual)) residual = huge(1.0_wp)
      system%load_share = share
      call system%set_frequency(system%frequency(), error)
      done = .not. allocated(error)
      if (.not. done .or. present(only_set)) return
      trial = x
      call method%solve_in(system, trial, report)
      done = report%converged
      if (present(residual)) residual = report%residual
      if (done) x = trial
   end subroutine solve_share

end module fw_diagnosis
