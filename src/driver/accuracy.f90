!> A response of given accuracy (accuracy > 0): harmonics and instants are raised at each point
!> until an estimate of the error is within it.
!>
!> The error is that of the Fourier coefficients of an observed quantity, in the root mean square
!> over the period and relative to its vibration; the largest of all observed quantities counts.
!> It is estimated by solving again with less than half of the harmonics: where the error falls at
!> least like H**(-p), the finer solution is off by no more than
!>
!>    |u_fine - u_coarse| / ((H_fine/H_coarse)**p - 1),
!>
!> and likewise with half of the instants, where these leave an error. The finer solution is the
!> answer. Orders p are below those seen on exact references, so that the estimate is a bound.
module fw_accuracy
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_laws, only: is_rigid
   use fw_level, only: describe_levels
   use fw_level, only: harmonic_levels
   use fw_level, only: level_type
   use fw_point, only: point_type
   use fw_run_state, only: run_state
   use fw_strategy, only: point_request
   use fw_strategy, only: point_strategy
   use fw_strategy, only: solver_memory
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: accuracy_solver

   !> Order of the error in 1/H: elastic contact and springs; rigid contact without and with mass.
   real(wp), parameter :: order_elastic = 1.5_wp, order_massless = 1.25_wp, order_rigid = 0.3_wp
   !> Factors that the order must not go below: with few harmonics no order shows yet.
   integer, parameter :: few_harmonics = 5
   real(wp), parameter :: least_factor = 1.0_wp/3.0_wp, least_factor_of_few = 1.0_wp
   !> The same for half of the instants: first order and fluctuating where they decide, and below
   !> the fourth order of slip in two directions between events.
   real(wp), parameter :: factor_instants = 2.0_wp, factor_planar = 1.0_wp/3.0_wp
   !> Halvings and doublings of the instants that are tried.
   integer, parameter :: fewest = -1, most = 5
   !> Levels at which a point may fail before it is given up.
   integer, parameter :: most_failures = 1
   !> Harmonics or instants are given up where the error is this part of the accuracy.
   real(wp), parameter :: with_margin = 1.0_wp/8.0_wp
   !> Quantities that vibrate less than this part of the largest are measured against that part.
   real(wp), parameter :: least_vibration = 1.0e-3_wp
   !> Where no coarser solution was found.
   real(wp), parameter :: unknown = huge(1.0_wp)

   type, extends(point_strategy) :: accuracy_solver
      !> Numbers of harmonics to choose from, ascending.
      integer, allocatable :: n_harmonics(:)
      !> The level in use.
      integer :: current = 2, doublings = 0
      !> Order of the error in 1/H that the estimate counts on.
      real(wp) :: order = order_elastic
      !> What half of the instants changes is multiplied by this (0: they leave no error).
      real(wp) :: factor_time = 0.0_wp
      !> Points that miss the accuracy, the largest estimate, and where it is [rad/s].
      integer :: n_short = 0
      real(wp) :: worst = 0.0_wp, worst_omega = 0.0_wp
      !> (numbers of harmonics, doublings of the instants)
      type(level_type), allocatable :: level(:, :)
      !> What may end the work on the present point.
      class(interrupt_type), pointer, private :: interrupt => null()
   contains
      procedure :: start
      procedure :: solve
      procedure :: describe
      procedure :: remember
      procedure :: recall
   end type accuracy_solver

contains

   !> The case gives the largest number of harmonics.
   subroutine start(self, case, error)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      self%n_harmonics = harmonic_levels(case%harmonics%n_harmonics)
      allocate (self%level(size(self%n_harmonics), fewest:most))
      if (case%contact%n_pairs > 0) then
         if (is_rigid(case%contact%law)) then
            self%order = merge(order_massless, order_rigid, without_mass(case))
         end if
         self%factor_time = factor_instants
      end if
      call need(self, case, self%current, self%doublings, error)
      if (allocated(error)) return
      associate (system => self%level(self%current, self%doublings)%system)
         if (system%problem%forces%entry(system%problem%forces%pairs)%law%facts%follows_events) then
            self%factor_time = merge(factor_planar, 0.0_wp, any(system%problem%joint%row(2, :) > 0))
         end if
      end associate
   end subroutine start

   !> Whether one side of every contact component carries no mass.
   pure logical function without_mass(case)
      type(case_type), intent(in) :: case
      integer :: i, c, dof(2)

      without_mass = .true.
      do i = 1, case%contact%n_pairs
         do c = 1, 3
            dof = abs([case%contact%side_1(c, i), case%contact%side_2(c, i)])
            if (all(dof == 0)) cycle
            without_mass = without_mass .and. (lacks_mass(dof(1)) .or. lacks_mass(dof(2)))
         end do
      end do

   contains

      !> The ground, dof 0, does not move.
      pure logical function lacks_mass(k)
         integer, intent(in) :: k

         lacks_mass = .false.
         if (k > 0) lacks_mass = abs(case%model%mass(k, k)) <= 0.0_wp
      end function lacks_mass

   end function without_mass

   !> Build a level if it is not there.
   subroutine need(self, case, k, doublings, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: k, doublings
      type(error_type), allocatable, intent(out) :: error

      call self%level(k, doublings)%build(case, self%n_harmonics(k), error, doublings)
   end subroutine need

   !> Solve at a frequency; the point says at which level, and how accurately.
   subroutine solve(self, case, request, point, error)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(point_request), intent(in) :: request
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: best
      !> Estimated errors of truncation and sampling.
      real(wp) :: errors(2), seconds
      integer :: iterations, failures, at_best(2)
      logical :: finer

      self%interrupt => request%interrupt
      iterations = 0
      failures = 0
      at_best = [self%current, self%doublings]
      seconds = 0.0_wp
      do
         associate (level => self%level(self%current, self%doublings))
            call level%solve(case, request, point, error)
         end associate
         if (allocated(error)) return
         iterations = iterations + point%iterations
         seconds = seconds + point%seconds
         errors = [unknown, 0.0_wp]
         if (point%converged) then
            call estimate(self, case, request%omega, point%coefficients, errors, iterations, &
                          seconds, error)
            if (allocated(error)) return
            point%error_estimate = total(errors)
            best = point
            at_best = [self%current, self%doublings]
            if (point%error_estimate <= case%harmonics%accuracy) exit
         else
            failures = failures + 1
            if (best%converged .or. failures > most_failures) exit
         end if
         call refine(self, case, errors, finer, error)
         if (allocated(error)) return
         if (.not. finer) exit
      end do
      if (.not. point%converged) then
         ! The next point starts where this one did, or where it was solved.
         self%current = at_best(1)
         self%doublings = at_best(2)
         if (best%converged) point = best
      end if
      point%iterations = iterations
      point%seconds = seconds
      call note(self, case, point)
      if (.not. point%converged) return
      call coarsen(self, case, errors, error)
   end subroutine solve

   !> A coarser solution to compare with, from the present one: nothing is asked of it but its
   !> observed coefficients, and fallbacks would look too far away.
   subroutine check(self, case, omega, k, doublings, iterations, seconds, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: omega
      integer, intent(in) :: k, doublings
      integer, intent(inout) :: iterations
      real(wp), intent(inout) :: seconds
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      if (is_solved(self%level(k, doublings), omega)) return
      call need(self, case, k, doublings, error)
      if (allocated(error)) return
      associate (level => self%level(k, doublings))
         call level%take_over(self%level(self%current, self%doublings))
         call level%solve(case, point_request(omega=omega, interrupt=self%interrupt, &
                                              fallback=.false., &
                                              histories=case%output%histories), point, error)
      end associate
      if (allocated(error)) return
      iterations = iterations + point%iterations
      seconds = seconds + point%seconds
   end subroutine check

   !> A level that was solved at this very frequency last is not solved again.
   pure logical function is_solved(level, omega)
      type(level_type), intent(in) :: level
      real(wp), intent(in) :: omega

      is_solved = abs(level%omega - omega) <= 0.0_wp
   end function is_solved

   !> Bounds of what the harmonics and the instants of the present solution leave out.
   subroutine estimate(self, case, omega, coefficients, errors, iterations, seconds, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: omega, coefficients(:, :)
      real(wp), intent(out) :: errors(2)
      integer, intent(inout) :: iterations
      real(wp), intent(inout) :: seconds
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      errors = [unknown, 0.0_wp]
      ! With the number two below; with that one below where the other has no solution.
      do k = max(1, self%current - 2), self%current - 1
         call check(self, case, omega, k, self%doublings, iterations, seconds, error)
         if (allocated(error)) return
         if (.not. is_solved(self%level(k, self%doublings), omega)) cycle
         errors(1) = factor_harmonics(self%n_harmonics(self%current), self%n_harmonics(k), &
                                      self%order)* &
                     distance(coefficients, self%level(k, self%doublings)%coefficients)
         exit
      end do
      if (self%factor_time <= 0.0_wp) return
      ! The same harmonics with half of the instants.
      call check(self, case, omega, self%current, self%doublings - 1, iterations, seconds, error)
      if (allocated(error)) return
      errors(2) = unknown
      associate (level => self%level(self%current, self%doublings - 1))
         if (is_solved(level, omega)) errors(2) = self%factor_time* &
                                                  distance(coefficients, level%coefficients)
      end associate
   end subroutine estimate

   !> What the distance of two solutions is multiplied by to bound the error of the finer.
   pure real(wp) function factor_harmonics(fine, coarse, order) result(factor)
      !> Numbers of harmonics.
      integer, intent(in) :: fine, coarse
      real(wp), intent(in) :: order

      factor = 1.0_wp/((real(fine, wp)/real(coarse, wp))**order - 1.0_wp)
      factor = max(factor, merge(least_factor_of_few, least_factor, fine <= few_harmonics))
   end function factor_harmonics

   !> Largest relative distance of the quantities in two sets of coefficients (2H+1, n_observed),
   !> of which the second may hold fewer harmonics.
   pure real(wp) function distance(fine, coarse)
      real(wp), intent(in) :: fine(:, :), coarse(:, :)
      real(wp) :: vibration(size(fine, 2)), change(size(fine, 1))
      integer :: i, n

      distance = 0.0_wp
      n = size(coarse, 1)
      do i = 1, size(fine, 2)
         vibration(i) = norm2(fine(2:, i))
      end do
      if (maxval([vibration, 0.0_wp]) <= 0.0_wp) return
      vibration = max(vibration, least_vibration*maxval(vibration))
      do i = 1, size(fine, 2)
         change(:n) = fine(:n, i) - coarse(:, i)
         change(n + 1:) = fine(n + 1:, i)
         ! The mean square of a constant is twice that of a harmonic of its size.
         change(1) = sqrt(2.0_wp)*change(1)
         distance = max(distance, norm2(change)/vibration(i))
      end do
   end function distance

   !> Sum of estimates, of which one may be unknown.
   pure real(wp) function total(errors)
      real(wp), intent(in) :: errors(2)

      total = unknown
      if (all(errors < unknown)) total = sum(errors)
   end function total

   !> More of what the error comes from.
   subroutine refine(self, case, errors, finer, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: errors(2)
      logical, intent(out) :: finer
      type(error_type), allocatable, intent(out) :: error
      logical :: more(2), possible(2)

      ! Either of both may take half of what is allowed.
      more = errors > 0.5_wp*case%harmonics%accuracy
      possible = [self%current < size(self%n_harmonics), self%doublings < most]
      finer = all(possible .or. .not. more)
      if (finer) call move(self, case, self%current + merge(1, 0, more(1)), &
                           self%doublings + merge(1, 0, more(2)), error)
   end subroutine refine

   !> Less of what the next point will hardly need.
   subroutine coarsen(self, case, errors, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: errors(2)
      type(error_type), allocatable, intent(out) :: error
      logical :: less(2)

      ! Down to the second number, which still has one below to be compared with.
      less = errors <= with_margin*case%harmonics%accuracy .and. &
             [self%current > 2, self%doublings > 0]
      if (any(less)) call move(self, case, self%current - merge(1, 0, less(1)), &
                               self%doublings - merge(1, 0, less(2)), error)
   end subroutine coarsen

   !> Go over to another level, with the present solution as the last known one.
   subroutine move(self, case, k, doublings, error)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: k, doublings
      type(error_type), allocatable, intent(out) :: error

      call need(self, case, k, doublings, error)
      if (allocated(error)) return
      if (self%level(self%current, self%doublings)%solver%n_converged > 0) then
         call self%level(k, doublings)%take_over(self%level(self%current, self%doublings))
      end if
      self%current = k
      self%doublings = doublings
   end subroutine move

   !> Count a point that misses the accuracy.
   subroutine note(self, case, point)
      class(accuracy_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(point_type), intent(in) :: point

      if (.not. point%converged) return
      if (point%error_estimate > self%worst .and. point%error_estimate < unknown) then
         self%worst = point%error_estimate
         self%worst_omega = point%omega
      end if
      if (point%error_estimate > case%harmonics%accuracy) self%n_short = self%n_short + 1
   end subroutine note

   !> What the points took, and where they miss the accuracy that was asked for.
   subroutine describe(self, case, state, summary, message)
      class(accuracy_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(run_state), intent(in) :: state
      type(summary_type), intent(inout) :: summary
      character(:), allocatable, intent(out) :: message
      character(12) :: wanted, reached, where

      call describe_levels(size(self%level), self%level, case%solver%kind, &
                           state%all_converged(), summary)
      call summary%describe_accuracy(self%worst, case%harmonics%accuracy)
      message = ''
      if (self%n_short == 0) return
      write (wanted, '(es9.2)') case%harmonics%accuracy
      write (reached, '(es9.2)') self%worst
      write (where, '(es11.4)') self%worst_omega
      message = 'accuracy'//trim(wanted)//' is missed at '//to_text(self%n_short)// &
                trim(merge(' point ', ' points', self%n_short == 1))
      if (self%worst > case%harmonics%accuracy) message = message//', by estimates up to '// &
         trim(adjustl(reached))//' (at '//trim(adjustl(where))//' rad/s)'
      message = message//': raise harmonics%n_harmonics, or ask for less'
   end subroutine describe

   !> The level in use and its last solution.
   subroutine remember(self, memory)
      class(accuracy_solver), intent(in) :: self
      type(solver_memory), intent(out) :: memory

      memory%level = [self%current, self%doublings]
      associate (solver => self%level(self%current, self%doublings)%solver)
         if (solver%n_converged == 0) return
         memory%x = solver%last
         memory%omega = solver%omega_last
      end associate
   end subroutine remember

   !> Go on with that level: a solution fits no other.
   subroutine recall(self, memory)
      class(accuracy_solver), intent(inout) :: self
      type(solver_memory), intent(in) :: memory

      self%current = memory%level(1)
      self%doublings = memory%level(2)
      call self%level(self%current, self%doublings)%solver%know(memory%x, memory%omega)
   end subroutine recall

end module fw_accuracy
