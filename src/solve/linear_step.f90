!> The linear problem of a Newton step: dense LU for small ones, GMRES with the system's
!> preconditioner for large ones. A preconditioner is kept from step to step and from point to
!> point while it fits and GMRES needs few more iterations than it did with it fresh.
module fw_linear_step
   use fw_kinds, only: wp
   use fw_krylov, only: gmres_type
   use fw_linalg, only: lu_type
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_auto, linear_lu, linear_krylov
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: linear_step_type

   !> A kept preconditioner may cost this much more than a fresh one, in iterations: a build takes
   !> as long as about five of them.
   real(wp), parameter :: kept_factor = 1.3_wp
   integer, parameter :: kept_excess = 4

   !> Relative residual of a solution that takes an iteration or two, whose rate tells nothing.
   real(wp), parameter :: loosest = 0.3_wp

   !> Iterations from which on a stronger preconditioner is taken, where the system has one.
   integer, parameter :: too_many = 30

   type :: linear_step_type
      !> linear_auto, linear_lu or linear_krylov.
      integer :: kind = linear_auto
      type(lu_type) :: lu
      type(gmres_type) :: gmres
      !> Of the reduced problem (n_linear).
      real(wp), allocatable :: rhs(:), solution(:)
      !> Whether `lu` holds the factors of the last derivative.
      logical :: factored = .false.
      !> Iterations for a tenth of the residual with the preconditioner when it was fresh, and
      !> whether those of the last solution still were few enough to keep it.
      real(wp) :: fresh_rate = 0.0_wp
      logical :: worth_keeping = .false.
      !> Whether the preconditioner in use is one from before the last `prepare`.
      logical :: kept = .false.
      !> Whether another preconditioner has been chosen that is not built yet.
      logical, private :: has_chosen = .false.
      !> Whether LU follows where GMRES has failed: along a branch, whose tangents have to be right
      !> near folds, and in implicit steps of pseudo-time and wear. Of Newton's method at a point,
      !> an exact step of an all but singular derivative leads far away.
      logical :: lu_follows = .false.
      !> Whether LU could have followed and did not.
      logical :: lu_left_out = .false.
      !> Whether preconditioners are kept at all.
      logical :: keeps = .true.
      !> Work done so far.
      integer :: factorizations = 0
      integer :: preconditioners = 0
      integer :: krylov_iterations = 0
      !> Linear problems with unknowns left, and the sum of the shares that had left them.
      integer :: n_problems = 0
      real(wp) :: share_skipped = 0.0_wp
      !> Linear problems without any unknown left.
      integer :: n_empty = 0
   contains
      procedure :: solve
      procedure :: prepare
      procedure :: solve_prepared
      procedure :: add_work
   end type linear_step_type

contains

   !> step = -J^-1 r at the last point of the system, which is linearized.
   subroutine solve(self, system, r, tolerance, step, done)
      class(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: r(:)
      !> Relative residual asked of an iterative solution.
      real(wp), intent(in) :: tolerance
      real(wp), intent(out), contiguous :: step(:)
      !> False where the matrix is singular; GMRES that fails is no reason (see solve_prepared).
      logical, intent(out) :: done

      call self%prepare(system, done)
      if (done) call self%solve_prepared(system, r, tolerance, step, done)
   end subroutine solve

   !> Count the work of another as done here.
   pure subroutine add_work(self, other)
      class(linear_step_type), intent(inout) :: self
      type(linear_step_type), intent(in) :: other

      self%factorizations = self%factorizations + other%factorizations
      self%preconditioners = self%preconditioners + other%preconditioners
      self%krylov_iterations = self%krylov_iterations + other%krylov_iterations
      self%n_problems = self%n_problems + other%n_problems
      self%share_skipped = self%share_skipped + other%share_skipped
      self%n_empty = self%n_empty + other%n_empty
   end subroutine add_work

   !> Linearize the system at its last point, and factor or build the preconditioner.
   subroutine prepare(self, system, done)
      class(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      logical, intent(out) :: done
      integer :: n

      call system%linearize(n)
      call self%gmres%forget()
      call reserve(self, n)
      done = .true.
      self%factored = .false.
      if (n > 0) then
         self%n_problems = self%n_problems + 1
         self%share_skipped = self%share_skipped + 1.0_wp - &
                              real(n + system%n_eliminated, wp)/real(system%n, wp)
         if (self%kind == linear_lu .or. &
             (self%kind == linear_auto .and. n <= sizes%lu_of_step)) then
            call factor(self, system, n, done)
         else
            ! The system knows whether its state is still that of the preconditioner.
            self%kept = self%keeps .and. self%worth_keeping .and. system%preconditioner_fits()
            if (.not. self%kept .or. self%has_chosen) call build(self, system)
         end if
      else
         self%n_empty = self%n_empty + 1
      end if
   end subroutine prepare

   !> The preconditioner anew, for the derivative that was prepared last.
   subroutine build(self, system)
      type(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system

      call system%build_preconditioner()
      call self%gmres%forget()
      self%preconditioners = self%preconditioners + 1
      self%kept = .false.
      self%has_chosen = .false.
   end subroutine build

   !> GMRES; where a kept preconditioner does not serve after all, again with a fresh one.
   subroutine iterate(self, system, tolerance, done)
      type(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(in) :: tolerance
      logical, intent(out) :: done
      real(wp) :: decades
      integer :: limit, most
      logical :: is_stronger

      ! A further right-hand side of the same derivative.
      if (self%has_chosen) call build(self, system)
      ! Iterations grow with the digits asked for: only their rate compares.
      decades = -log10(tolerance)
      if (self%kept) then
         limit = int(kept_factor*self%fresh_rate*decades) + kept_excess
         most = self%gmres%max_iterations
         ! Twice the limit: what is nearly done is let finish, what is hopeless is cut.
         self%gmres%max_iterations = min(most, 2*limit)
         call self%gmres%solve(system, self%rhs, self%solution, tolerance, done)
         self%gmres%max_iterations = most
         self%krylov_iterations = self%krylov_iterations + self%gmres%iterations
         self%worth_keeping = done .and. self%gmres%iterations <= limit
         if (done .or. system%is_interrupted()) return
         call build(self, system)
      end if
      call self%gmres%solve(system, self%rhs, self%solution, tolerance, done)
      self%krylov_iterations = self%krylov_iterations + self%gmres%iterations
      if (self%gmres%iterations > too_many .and. .not. system%is_interrupted()) then
         call system%strengthen_preconditioner(is_stronger)
         self%has_chosen = is_stronger
         if (is_stronger .and. .not. done) then
            call build(self, system)
            self%solution = 0.0_wp
            call self%gmres%solve(system, self%rhs, self%solution, tolerance, done)
            self%krylov_iterations = self%krylov_iterations + self%gmres%iterations
         end if
      end if
      if (system%nearly .and. .not. done .and. .not. system%is_interrupted()) then
         ! Once more with what is exact, and from now on where that has helped: a derivative that is
         ! all but singular is no reason to pay for it at all later steps.
         system%nearly = .false.
         call build(self, system)
         call self%gmres%solve(system, self%rhs, self%solution, tolerance, done)
         self%krylov_iterations = self%krylov_iterations + self%gmres%iterations
         system%nearly = .not. done
      end if
      self%fresh_rate = real(self%gmres%iterations, wp)/decades
      self%worth_keeping = done
   end subroutine iterate

   !> step = -J^-1 r with the derivative that was prepared.
   subroutine solve_prepared(self, system, r, tolerance, step, done, scale, is_alike)
      class(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(in) :: tolerance
      real(wp), intent(out), contiguous :: step(:)
      logical, intent(out) :: done
      !> Norm of a right-hand side that the tolerance is meant of, where it is larger than its own.
      real(wp), intent(in), optional :: scale
      !> The right-hand side resembles the last one, which was of the same derivative.
      logical, intent(in), optional :: is_alike
      integer :: n

      n = size(self%rhs)
      done = .true.
      ! LU solves all the way, whatever is asked for.
      if (.not. self%factored) system%asked = tolerance
      call system%reduce(r, self%rhs)
      system%asked = 0.0_wp
      self%solution = 0.0_wp
      if (n > 0 .and. .not. self%factored) then
         call iterate_from_start(self, system, tolerance, done, scale, is_alike)
         if (.not. done .and. self%kind /= linear_krylov .and. n <= sizes%lu_possible) then
            if (self%lu_follows .and. .not. system%is_interrupted()) then
               call factor(self, system, n, done)
               if (.not. done) return
            else
               self%lu_left_out = .true.
            end if
         end if
         ! Without LU, Newton's method judges what GMRES has reached.
         done = .true.
      end if
      if (self%factored) then
         self%solution = self%rhs
         call self%lu%solve(self%solution)
      end if
      ! Steps of the rows that left the problem are added, and stand in the right-hand side already.
      call system%expand(r, self%solution, step)
   end subroutine solve_prepared

   !> `iterate` for what the start leaves, as far as the tolerance asks for it.
   subroutine iterate_from_start(self, system, tolerance, done, scale, is_alike)
      type(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      real(wp), intent(in) :: tolerance
      logical, intent(out) :: done
      real(wp), intent(in), optional :: scale
      logical, intent(in), optional :: is_alike
      real(wp), allocatable :: start(:), whole(:)
      real(wp) :: target, norm
      logical :: starts

      target = norm2(self%rhs)
      if (present(scale)) target = max(target, scale)
      target = tolerance*target
      starts = .false.
      if (present(is_alike)) starts = is_alike
      if (starts) then
         allocate (start(size(self%rhs)), source=0.0_wp)
         whole = self%rhs
         system%asked = tolerance
         call self%gmres%start_alike(system, self%rhs, start)
         system%asked = 0.0_wp
      end if
      norm = norm2(self%rhs)
      done = norm <= target
      if (.not. done) call iterate(self, system, min(loosest, target/norm), done)
      if (.not. starts) return
      self%solution = self%solution + start
      self%rhs = whole
   end subroutine iterate_from_start

   !> LU of the whole remaining matrix (n, n).
   subroutine factor(self, system, n, done)
      type(linear_step_type), intent(inout) :: self
      class(nonlinear_system), intent(inout) :: system
      integer, intent(in) :: n
      logical, intent(out) :: done
      logical :: singular

      call self%lu%reserve(n)
      call system%assemble(self%lu%matrix)
      call self%lu%factor(singular, system%interrupt)
      self%factorizations = self%factorizations + 1
      done = .not. singular
      self%factored = done
   end subroutine factor

   !> The number of unknowns that remain changes with the states of the pairs.
   subroutine reserve(self, n)
      type(linear_step_type), intent(inout) :: self
      integer, intent(in) :: n

      if (allocated(self%rhs)) then
         if (size(self%rhs) == n) return
         deallocate (self%rhs, self%solution)
      end if
      allocate (self%rhs(n), self%solution(n))
   end subroutine reserve

end module fw_linear_step
