!> A maximum of the response near a point of it, and how far it lies from others: Newton's method
!> on dQ/ds along the curve, which folds do not stop; uphill where Q is not yet rounded.
module fw_resonance_search
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_response_curve, only: response_curve
   implicit none (type, external)
   private

   public :: find_maximum, search_outcome
   public :: outcome_found, outcome_unsolved, outcome_bound, outcome_minimum, outcome_words

   !> What came of a search.
   integer, parameter :: outcome_found = 1, outcome_unsolved = 2, outcome_bound = 3, &
                         outcome_minimum = 4
   character(*), parameter :: outcome_words(*) = &
      [character(60) :: 'found', 'no solution was found near the one before', &
       'the response is largest at a bound of &sweep, no resonance', &
       'the response has no maximum there']

   type :: search_outcome
      integer :: kind = outcome_unsolved
      !> Points that were looked at, and all iterations of Newton's method.
      integer :: n_points = 0, iterations = 0
      real(wp) :: residual = huge(1.0_wp)
      !> The maximum is a corner: Q rises up to it and falls behind.
      logical :: is_corner = .false.
   end type search_outcome

   !> Points (q, omega) on either side of a maximum.
   type :: bracket_type
      real(wp), allocatable :: low(:), high(:)
   contains
      procedure :: take => take_point
      procedure :: is_closed
      procedure :: width
      procedure :: middle
   end type bracket_type

   !> Longest step: of omega over itself, of q over its size.
   real(wp), parameter :: most_omega = 0.02_wp, most_moved = 0.3_wp
   !> A step is the last below the first, or below the second where steps shrink no more.
   real(wp), parameter :: arrived = 1.0e-10_wp, near = 1.0e-6_wp
   !> Looks at most, and halvings of a step.
   integer, parameter :: most_looks = 60, most_halvings = 8
   !> Looks after which a bracket is halved.
   integer, parameter :: most_free = 8
   !> A step that leads so many times across a bracket leaves it.
   real(wp), parameter :: beyond = 2.0_wp
   !> Q may fall by this part, as round-off does.
   real(wp), parameter :: round_off = 1.0e-10_wp

contains

   !> From the guess (q, omega) to a maximum of Q.
   subroutine find_maximum(curve, guess, held, range, is_smooth, outcome, error)
      type(response_curve), intent(inout) :: curve
      real(wp), intent(in) :: guess(:)
      !> Solve at the frequency of the guess first, not across the curve.
      logical, intent(in) :: held
      !> Lowest and highest frequency [rad/s].
      real(wp), intent(in) :: range(2)
      !> Whether the residual is smooth enough for the second derivative.
      logical, intent(in) :: is_smooth
      type(search_outcome), intent(out) :: outcome
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      type(bracket_type) :: bracket
      real(wp) :: ds, last
      logical :: done, is_top
      integer :: k

      call solve_at(curve, guess, held, report, outcome, error)
      if (allocated(error) .or. .not. report%converged) return
      last = huge(1.0_wp)
      do k = 1, most_looks
         call curve%look(done, error)
         if (allocated(error) .or. .not. done) return
         outcome%n_points = outcome%n_points + 1
         call bracket%take(curve)
         ds = step_of(curve)
         if (abs(ds) <= arrived .or. (abs(ds) <= near .and. abs(ds) > 0.3_wp*last)) exit
         last = abs(ds)
         ! Between slopes of both signs a rounded maximum has its zero; at a corner the step would
         ! lead far beyond.
         outcome%is_corner = bracket%width(curve) <= min(near, abs(ds)/beyond)
         if (outcome%is_corner) exit
         if (bracket%is_closed() .and. (k > most_free .or. .not. is_smooth)) then
            call solve_at(curve, bracket%middle(), .false., report, outcome, error)
         else
            call go(curve, ds, is_top, report, outcome, error)
            if (allocated(error)) return
            ! The same look would lead to the same steps again.
            outcome%is_corner = is_top
            if (is_top) exit
         end if
         if (allocated(error) .or. .not. report%converged) return
         if (curve%omega() < range(1) .or. curve%omega() > range(2)) then
            outcome%kind = outcome_bound
            return
         end if
      end do
      outcome%kind = outcome_found
      if (k > most_looks) outcome%kind = outcome_unsolved
      if (.not. (curve%second < 0.0_wp .or. outcome%is_corner)) outcome%kind = outcome_minimum
   end subroutine find_maximum

   !> Q rises at one point and falls at the other.
   subroutine take_point(self, curve)
      class(bracket_type), intent(inout) :: self
      type(response_curve), intent(in) :: curve

      if (curve%slope > 0.0_wp) then
         self%low = curve%x
      else
         self%high = curve%x
      end if
   end subroutine take_point

   pure logical function is_closed(self)
      class(bracket_type), intent(in) :: self

      is_closed = allocated(self%low) .and. allocated(self%high)
      if (.not. is_closed) return
      ! Of one branch, on which the direction is that of the frequency.
      associate (n => size(self%low))
         is_closed = self%low(n) < self%high(n)
      end associate
   end function is_closed

   !> Length along the curve between the two.
   pure real(wp) function width(self, curve)
      class(bracket_type), intent(in) :: self
      type(response_curve), intent(in) :: curve

      width = huge(1.0_wp)
      if (.not. self%is_closed()) return
      associate (n => size(self%low))
         if (abs(curve%t(n)) > 0.0_wp) width = (self%high(n) - self%low(n))/abs(curve%t(n))
      end associate
   end function width

   pure function middle(self) result(x)
      class(bracket_type), intent(in) :: self
      real(wp), allocatable :: x(:)

      x = 0.5_wp*(self%low + self%high)
   end function middle

   !> To the zero of dQ/ds where Q is rounded, else uphill, no further than steps may go.
   pure real(wp) function step_of(curve) result(ds)
      type(response_curve), intent(in) :: curve
      real(wp) :: longest

      longest = min(most_moved, most_omega*curve%omega()/max(abs(curve%t(size(curve%t))), &
                                                            tiny(1.0_wp)))
      if (curve%second < 0.0_wp) then
         ds = max(-longest, min(longest, -curve%slope/curve%second))
      else
         ds = sign(longest, curve%slope)
      end if
   end function step_of

   !> One step, halved until a solution is found that is not lower.
   subroutine go(curve, ds, is_top, report, outcome, error)
      type(response_curve), intent(inout) :: curve
      real(wp), intent(inout) :: ds
      !> All is lower uphill of where it began, next to it too: a corner.
      logical, intent(out) :: is_top
      type(solver_report), intent(out) :: report
      type(search_outcome), intent(inout) :: outcome
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:), t(:), bend(:), guess(:)
      real(wp) :: value
      logical :: is_near
      integer :: k

      x = curve%x
      t = curve%t
      bend = curve%bend
      value = curve%q%value
      is_top = .false.
      do k = 0, most_halvings
         guess = x + ds*t
         ! The bend is worth taking where it is a correction.
         if (0.5_wp*ds**2*curve%size_of(bend) < abs(ds)) guess = guess + 0.5_wp*ds**2*bend
         call solve_at(curve, guess, .false., report, outcome, error)
         if (allocated(error)) return
         if (report%converged) then
            is_near = curve%size_of(curve%x - x) <= 3.0_wp*abs(ds)
            if (is_near .and. curve%value_at() >= (1.0_wp - round_off)*value) return
         else
            is_near = .false.
         end if
         ds = 0.5_wp*ds
         report%converged = .false.
      end do
      ! Nothing higher beside it: as good as there.
      if (abs(ds) > near .or. .not. is_near) return
      call solve_at(curve, x, .false., report, outcome, error)
      is_top = report%converged
   end subroutine go

   subroutine solve_at(curve, guess, held, report, outcome, error)
      type(response_curve), intent(inout) :: curve
      real(wp), intent(in) :: guess(:)
      logical, intent(in) :: held
      type(solver_report), intent(out) :: report
      type(search_outcome), intent(inout) :: outcome
      type(error_type), allocatable, intent(out) :: error

      call stop_run(curve%state%interrupt, error)
      if (allocated(error)) return
      call curve%correct(guess, report, error, held)
      outcome%iterations = outcome%iterations + report%iterations
      outcome%residual = report%residual
      if (report%interrupted) call stop_run(curve%state%interrupt, error)
   end subroutine solve_at

end module fw_resonance_search
