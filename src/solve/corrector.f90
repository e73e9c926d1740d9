!> The corrector of arc-length continuation: Newton's method on R(x, p) = 0 in the plane across the
!> tangent, held close to where it starts.
!>
!> Newton's method takes what solution it finds, and on a curve with folds or narrow resonances
!> that may be another piece of the branch. It is therefore on a leash: a corrector that goes
!> further from its predictor than a part of the step, or whose corrections do not contract, has
!> failed, and the step is to be shorter (Allgower and Georg 1990, Numerical continuation methods,
!> chapter 6).
module fw_corrector
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_bordered, only: bordered_type
   use fw_branch_point, only: branch_point, metric_type
   use fw_branch_view, only: branch_view
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_linear_step, only: linear_step_type
   use fw_newton, only: newton_solver, solver_report
   use fw_parameter_system, only: parameter_system
   use fw_plane_system, only: plane_system
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_auto, linear_lu, solver_options
   implicit none (type, external)
   private

   public :: corrector_type, differ, max_corrections, branch_forcing

   type :: corrector_type
      type(solver_options) :: options
      type(linear_step_type) :: linear
      !> What it takes where the derivative by x alone is close to singular.
      type(bordered_type) :: bordered
      type(plane_system) :: plane
      type(metric_type) :: metric
      !> What the branch is measured by; the unknowns themselves where it is not associated.
      class(branch_view), pointer :: view => null()
      !> The least size of x that matters.
      real(wp) :: least_x = 0.0_wp
      !> Take no risk, whatever it costs: direct solutions of the bordered matrix, and corrections
      !> cut short where the residual does not decrease. For corners.
      logical :: careful = .false.
      !> Whether orientations are looked at; without, the smaller angle between tangents decides.
      logical :: oriented = .true.
   contains
      procedure :: reset
      procedure :: correct
      procedure :: correct_across
      procedure :: try
      procedure :: find_tangent
      procedure :: find_orientation
      procedure :: stands
      procedure :: see
      procedure :: x_scale
   end type corrector_type

   !> Corrector iterations: more are a failure.
   integer, parameter :: max_corrections = 14
   !> Corrections without a smaller residual that end an attempt: a cycle.
   integer, parameter :: patience = 4
   !> Corrections that are longer than the one before, likewise.
   integer, parameter :: max_longer = 2
   !> Halvings of a correction.
   integer, parameter :: max_halvings = 4
   !> How far the corrector may go from its predictor on its way, in steps.
   real(wp), parameter :: leash = 1.0_wp
   !> The part of p in a tangent below which dR/dx is too close to singular to be divided by.
   real(wp), parameter :: steep = 1.0e-4_wp
   !> The part of p in a tangent below which p does not move.
   real(wp), parameter :: constant = 1.0e-6_wp
   !> Iterative linear solutions: the tangent needs more digits than a Newton step.
   real(wp), parameter :: branch_forcing = 1.0e-6_wp
   real(wp), parameter :: step_forcing = 1.0e-3_wp

contains

   !> Make ready for a branch of a system.
   subroutine reset(self, system)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(in) :: system

      self%linear%kind = self%options%linear
      if (self%linear%kind == linear_auto .and. system%n <= sizes%lu_of_branch) then
         self%linear%kind = linear_lu
      end if
      ! Derivatives near folds and runaway branches are too close to singular for old factors.
      self%linear%keeps = .false.
      self%linear%lu_follows = .true.
      self%oriented = system%n <= sizes%orientation
   end subroutine reset

   !> From a guess in `next` to the branch, across the tangent of `here`; report%converged says
   !> whether it got there, with the tangent there.
   subroutine correct(self, system, here, ds, next, error)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      !> Length of the step, in which the leash is measured.
      real(wp), intent(in) :: ds
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: r(:), step(:), guess(:)
      real(wp) :: dp, best, guess_p, size, last_size, x_scale
      logical :: done
      integer :: stalled, longer

      allocate (r(system%n), step(system%n))
      ! What the branch is measured by, not the unknowns: the leash is to hold what is seen.
      guess = next%y
      guess_p = next%p
      x_scale = self%x_scale(here%x)
      next%report = solver_report()
      best = huge(1.0_wp)
      last_size = huge(1.0_wp)
      stalled = 0
      longer = 0
      do
         call stop_run(system%interrupt, error)
         if (.not. allocated(error)) call system%set_parameter(next%p, error)
         if (allocated(error)) return
         call self%see(next%x, next%y)
         ! Before the residual: a point that has left the neighbourhood is not worth one.
         if (self%metric%length(next%y - guess, next%p - guess_p) > leash*ds) exit
         call system%residual(next%x, r)
         associate (report => next%report)
            report%residual = norm2(r)/system%reference
            report%converged = report%residual <= self%options%tolerance
            if (report%converged .or. report%iterations == max_corrections) exit
            if (.not. ieee_is_finite(report%residual)) exit
            stalled = stalled + 1
            if (report%residual < 0.9_wp*best) stalled = 0
            best = min(best, report%residual)
            ! A cycle makes no progress; what has grown a thousandfold does not come back.
            if (stalled >= patience .or. report%residual > 1.0e3_wp*best) exit
            call newton_step(self, system, here, next, r, step, dp, done)
            if (.not. done) exit
            report%iterations = report%iterations + 1
         end associate
         if (self%careful) call cut_short(system, next, r, step, dp, error)
         if (allocated(error)) return
         next%x = next%x + step
         next%p = next%p + dp
         ! Quadratic convergence shortens each correction; those that grow again and again go
         ! elsewhere.
         size = hypot(norm2(step)/x_scale, dp/self%metric%p_scale)
         if (size > last_size) longer = longer + 1
         last_size = size
         if (longer > max_longer) exit
      end do
      if (.not. next%report%converged) return
      ! A solution without a tangent is no point of the branch: nothing can go on from it.
      call self%find_tangent(system, here, next, done)
      next%report%converged = done
   end subroutine correct

   !> From a guess in `next` to the branch at the p of the guess, by Newton's method with its search
   !> along each step.
   subroutine correct_across(self, system, here, next, error)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here
      type(branch_point), intent(inout) :: next
      type(error_type), allocatable, intent(out) :: error
      type(newton_solver) :: newton
      logical :: done

      newton%options = self%options
      newton%options%max_iterations = min(newton%options%max_iterations, max_corrections)
      newton%linear%lu_follows = .true.
      next%report = solver_report()
      call system%set_parameter(next%p, error)
      if (allocated(error)) return
      call newton%solve(system, next%x, next%report)
      call self%linear%add_work(newton%linear)
      if (next%report%interrupted) call stop_run(system%interrupt, error)
      if (allocated(error) .or. .not. next%report%converged) return
      call self%find_tangent(system, here, next, done)
      next%report%converged = done
   end subroutine correct_across

   !> The change of y that a correction of a point makes at a constant p; the system stays there.
   subroutine try(self, system, point, change, done, error)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: point
      real(wp), allocatable, intent(out) :: change(:)
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      !> One digit of it is enough.
      real(wp), parameter :: forcing = 0.05_wp
      real(wp), allocatable :: r(:), step(:), at_point(:)

      done = .false.
      call system%set_parameter(point%p, error)
      if (allocated(error)) return
      allocate (r(system%n), step(system%n))
      call system%residual(point%x, r)
      call self%linear%solve(system, r, forcing, step, done)
      if (.not. done) return
      if (associated(self%view)) then
         call self%see(point%x, at_point)
         call self%see(point%x + step, change)
         change = change - at_point
      else
         change = step
      end if
   end subroutine try

   !> Halve a correction until the residual decreases; where it never does, what leaves the least.
   !> The test is that of Armijo: a share s of a Newton step should leave 1 - s of the residual, and
   !> has to gain 1e-4 of that.
   subroutine cut_short(system, from, r, step, dp, error)
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: from
      real(wp), intent(inout), contiguous :: r(:), step(:)
      real(wp), intent(inout) :: dp
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: share, best, best_share, norm
      integer :: k

      share = 1.0_wp
      best = huge(1.0_wp)
      best_share = 1.0_wp
      do k = 0, max_halvings
         call stop_run(system%interrupt, error)
         if (.not. allocated(error)) call system%set_parameter(from%p + share*dp, error)
         if (allocated(error)) return
         call system%residual(from%x + share*step, r)
         norm = norm2(r)/system%reference
         if (norm < best) then
            best = norm
            best_share = share
         end if
         if (norm <= (1.0_wp - 1.0e-4_wp*share)*from%report%residual) exit
         share = 0.5_wp*share
      end do
      step = best_share*step
      dp = best_share*dp
   end subroutine cut_short

   !> Two solutions with dR/dx where that is regular enough, else the bordered matrix.
   subroutine newton_step(self, system, here, next, r, step, dp, done)
      type(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done

      ! Beyond that size a dense matrix of all unknowns costs too much.
      if (self%oriented .and. (self%careful .or. &
                               abs(here%t_p) < steep*self%metric%p_scale)) then
         call bordered_step(self, system, here, next, r, step, dp, done)
      else
         call combined_step(self, system, here, next, r, step, dp, done)
      end if
   end subroutine newton_step

   !> One step of the corrector from two solutions with the derivative by x.
   subroutine combined_step(self, system, here, next, r, step, dp, done)
      type(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done
      real(wp), allocatable :: slope(:), dx_dp(:), at_step(:), along(:)

      allocate (slope(system%n), dx_dp(system%n))
      ! With dx = a + b dp, a = -J^-1 R and b = -J^-1 R_p, the plane t . dx + t_p dp = 0 gives dp =
      ! -(t . a)/(t . b + t_p).
      dp = 0.0_wp
      call self%linear%solve(system, r, step_forcing, step, done)
      if (.not. done) return
      call system%parameter_derivative(next%x, slope)
      call self%linear%solve_prepared(system, slope, step_forcing, dx_dp, done)
      if (.not. done) return
      if (associated(self%view)) then
         ! y is affine in x; its own change with p is taken from `here`.
         call self%see(next%x + step, at_step)
         call self%see(next%x + dx_dp, along)
         along = along - next%y + here%y_p
         dp = -self%metric%inner(here%t_y, here%t_p, at_step - next%y, 0.0_wp)/ &
              self%metric%inner(here%t_y, here%t_p, along, 1.0_wp)
      else
         dp = -self%metric%inner(here%t, here%t_p, step, 0.0_wp)/ &
              self%metric%inner(here%t, here%t_p, dx_dp, 1.0_wp)
      end if
      step = step + dp*dx_dp
   end subroutine combined_step

   !> The same from the bordered matrix.
   subroutine bordered_step(self, system, here, next, r, step, dp, done)
      type(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done
      real(wp) :: residuals(system%n + 1), steps(system%n + 1)
      logical :: singular

      dp = 0.0_wp
      ! Through the point where the correction stands: its condition is met.
      call self%plane%cut(system, next%x, next%p, here%t, &
                          here%t_p*(self%x_scale(here%x)/self%metric%p_scale)**2)
      call self%bordered%prepare(self%plane, singular)
      self%linear%factorizations = self%linear%factorizations + 1
      done = .not. singular
      if (.not. done) return
      residuals(:system%n) = r
      residuals(system%n + 1) = 0.0_wp
      call self%bordered%solve(self%plane, residuals, steps)
      step = steps(:system%n)
      dp = steps(system%n + 1)
   end subroutine bordered_step

   !> Unit tangent at a point of the branch where the system stands, in the direction of another
   !> one's, and the orientation where the factors of a direct solution tell it.
   subroutine find_tangent(self, system, previous, point, done)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: previous
      type(branch_point), intent(inout) :: point
      logical, intent(out) :: done
      real(wp), allocatable :: r(:), slope(:), t(:)

      allocate (r(system%n), slope(system%n), t(system%n))
      call find_own_slope(self, system, point, done)
      if (.not. done) return
      call system%residual(point%x, r)
      call self%linear%prepare(system, done)
      if (.not. done) return
      call system%parameter_derivative(point%x, slope)
      call self%linear%solve_prepared(system, slope, branch_forcing, t, done)
      if (.not. done) return
      done = all(ieee_is_finite(t))
      if (.not. done) return
      point%t = t
      point%t_y = t
      if (associated(self%view)) then
         call self%see(point%x, point%y)
         point%t_y = point%y
         call self%see(point%x + t, point%t_y)
         point%t_y = point%t_y - point%y + point%y_p
      end if
      ! (t, 1) is tangent with either sign: the one that makes the smaller angle with that before.
      point%t_p = sign(1.0_wp, self%metric%inner(point%t_y, 1.0_wp, previous%t_y, previous%t_p))
      point%t = point%t_p*point%t
      point%t_y = point%t_p*point%t_y
      call self%metric%normalize(point)
      point%orientation = 0
      if (self%stands(point)) return
      if (size(self%linear%rhs) == 0) then
         point%orientation = 1
      else if (self%linear%factored) then
         point%orientation = self%linear%lu%determinant_sign()
      end if
      if (point%t_p < 0.0_wp) point%orientation = -point%orientation
   end subroutine find_tangent

   !> What the branch is measured by, where the system stands.
   subroutine see(self, x, y)
      class(corrector_type), intent(in) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), allocatable, intent(inout) :: y(:)

      if (associated(self%view)) then
         if (.not. allocated(y)) allocate (y(self%view%n + size(x)))
         call self%view%see(x, y(:self%view%n))
         y(self%view%n + 1:) = x
      else
         y = x
      end if
   end subroutine see

   !> Change of what is measured with p alone, by a difference; the system comes back to the point.
   subroutine find_own_slope(self, system, point, done)
      type(corrector_type), intent(in) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: point
      logical, intent(out) :: done
      !> Beside the widths of resonances, over p.
      real(wp), parameter :: difference = 1.0e-7_wp
      type(error_type), allocatable :: error
      real(wp) :: dp

      done = .true.
      if (.not. associated(self%view)) return
      dp = difference*abs(point%p)
      if (.not. dp > 0.0_wp) dp = difference*self%metric%p_scale
      call self%see(point%x, point%y)
      call system%set_parameter(point%p + dp, error)
      done = .not. allocated(error)
      if (.not. done) return
      call self%see(point%x, point%y_p)
      point%y_p = (point%y_p - point%y)/dp
      call system%set_parameter(point%p, error)
      done = .not. allocated(error)
   end subroutine find_own_slope

   !> The size of x about a point.
   pure real(wp) function x_scale(self, x)
      class(corrector_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      x_scale = self%metric%y_scale
      if (associated(self%view)) x_scale = max(norm2(x), self%least_x, tiny(1.0_wp))
   end function x_scale

   !> Sign of det(dR/dx) dp/ds. It is the same all along a branch: det(dR/dx) changes its sign where
   !> p turns, in a smooth fold as at a kink. 0 where p does not move and dR/dx is singular: the
   !> sign would be that of round-off.
   subroutine find_orientation(self, system, point, error)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      type(lu_type) :: lu
      real(wp), allocatable :: r(:)
      logical :: singular
      integer :: n

      if (point%orientation /= 0 .or. .not. self%oriented .or. self%stands(point)) return
      call stop_run(system%interrupt, error)
      if (.not. allocated(error)) call system%set_parameter(point%p, error)
      if (allocated(error)) return
      allocate (r(system%n))
      call system%residual(point%x, r)
      call system%linearize(n)
      point%orientation = 1
      if (n > 0) then
         call lu%reserve(n)
         call system%assemble(lu%matrix)
         call lu%factor(singular)
         self%linear%factorizations = self%linear%factorizations + 1
         point%orientation = 0
         if (.not. singular) point%orientation = lu%determinant_sign()
      end if
      if (point%t_p < 0.0_wp) point%orientation = -point%orientation
   end subroutine find_orientation

   !> Whether p does not move along the branch at a point.
   pure logical function stands(self, point)
      class(corrector_type), intent(in) :: self
      type(branch_point), intent(in) :: point

      stands = abs(point%t_p) <= constant*self%metric%p_scale
   end function stands

   !> Whether the orientations of two points are known and differ.
   pure logical function differ(a, b)
      type(branch_point), intent(in) :: a, b

      differ = a%orientation*b%orientation < 0
   end function differ

end module fw_corrector
