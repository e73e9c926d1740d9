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
   use fw_branch_point, only: branch_point
   use fw_branch_point, only: metric_type
   use fw_error, only: error_type
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_linear_step, only: linear_step_type
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   use fw_plane_system, only: plane_system
   use fw_solver_options, only: linear_auto
   use fw_solver_options, only: linear_lu
   use fw_solver_options, only: solver_options
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
      !> Take no risk, whatever it costs: direct solutions of the bordered matrix, and corrections
      !> cut short where the residual does not decrease. For corners.
      logical :: careful = .false.
      !> Whether orientations are looked at; without, the smaller angle between tangents decides.
      logical :: oriented = .true.
   contains
      procedure :: reset
      procedure :: correct
      procedure :: find_tangent
      procedure :: find_orientation
      procedure :: stands
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
   !> Unknowns up to which the orientation is looked at: it takes the LU factors of the whole
   !> derivative, which beyond cost more than the points of the branch.
   integer, parameter :: orientation_up_to = 1000
   !> Unknowns up to which LU is taken along a branch: it costs no more than the dozens of Krylov
   !> iterations that tangents and resonances take, and its factors tell the orientation.
   integer, parameter :: branch_lu_up_to = 400
   !> Iterative linear solutions: the tangent needs more digits than a Newton step.
   real(wp), parameter :: branch_forcing = 1.0e-6_wp

contains

   !> Make ready for a branch of a system.
   subroutine reset(self, system)
      class(corrector_type), intent(inout) :: self
      class(parameter_system), intent(in) :: system

      self%linear%kind = self%options%linear
      if (self%linear%kind == linear_auto .and. system%n <= branch_lu_up_to) then
         self%linear%kind = linear_lu
      end if
      ! Derivatives near folds and runaway branches are too close to singular for old factors.
      self%linear%keeps = .false.
      self%linear%lu_follows = .true.
      self%oriented = system%n <= orientation_up_to
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
      real(wp) :: dp, best, guess_p, size, last_size
      logical :: done
      integer :: stalled, longer

      allocate (r(system%n), step(system%n))
      guess = next%x
      guess_p = next%p
      next%report = solver_report()
      best = huge(1.0_wp)
      last_size = huge(1.0_wp)
      stalled = 0
      longer = 0
      do
         call stop_run(system%interrupt, error)
         if (.not. allocated(error)) call system%set_parameter(next%p, error)
         if (allocated(error)) return
         call system%residual(next%x, r)
         associate (report => next%report)
            report%residual = norm2(r)/system%reference
            report%converged = report%residual <= self%options%tolerance
            if (report%converged .or. report%iterations == max_corrections) exit
            if (.not. ieee_is_finite(report%residual)) exit
            stalled = stalled + 1
            if (report%residual < 0.9_wp*best) stalled = 0
            best = min(best, report%residual)
            if (stalled >= patience .or. report%residual > 1.0e3_wp*best) exit
            call newton_step(self, system, here, next, r, step, dp, done)
            if (.not. done) exit
            report%iterations = report%iterations + 1
         end associate
         if (self%careful) call cut_short(system, next, r, step, dp, error)
         if (allocated(error)) return
         next%x = next%x + step
         next%p = next%p + dp
         size = self%metric%length(step, dp)
         if (size > last_size) longer = longer + 1
         last_size = size
         if (longer > max_longer) exit
         if (self%metric%length(next%x - guess, next%p - guess_p) > leash*ds) exit
      end do
      if (.not. next%report%converged) return
      call self%find_tangent(system, here, next, done)
      next%report%converged = done
   end subroutine correct

   !> Halve a correction until the residual decreases; where it never does, what leaves the least.
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

   subroutine newton_step(self, system, here, next, r, step, dp, done)
      type(corrector_type), intent(inout) :: self
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, next
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp), intent(out) :: dp
      logical, intent(out) :: done

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
      real(wp), allocatable :: slope(:), dx_dp(:)

      allocate (slope(system%n), dx_dp(system%n))
      dp = 0.0_wp
      call self%linear%solve(system, r, branch_forcing, step, done)
      if (.not. done) return
      call system%parameter_derivative(next%x, slope)
      call self%linear%solve_prepared(system, slope, branch_forcing, dx_dp, done)
      if (.not. done) return
      dp = -self%metric%inner(here%t, here%t_p, step, 0.0_wp)/ &
           self%metric%inner(here%t, here%t_p, dx_dp, 1.0_wp)
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
                          here%t_p*(self%metric%x_scale/self%metric%p_scale)**2)
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
      call system%residual(point%x, r)
      call self%linear%prepare(system, done)
      if (.not. done) return
      call system%parameter_derivative(point%x, slope)
      call self%linear%solve_prepared(system, slope, branch_forcing, t, done)
      if (.not. done) return
      done = all(ieee_is_finite(t))
      if (.not. done) return
      point%t = t
      point%t_p = sign(1.0_wp, self%metric%inner(t, 1.0_wp, previous%t, previous%t_p))
      point%t = point%t_p*t
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
         point%orientation = lu%determinant_sign()
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
