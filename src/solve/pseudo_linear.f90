!> The linear problem of the linearly implicit schemes, (J + P/h) v = b, at one point: prepared
!> once, solved several times.
module fw_pseudo_linear
   use fw_kinds, only: wp
   use fw_krylov, only: gmres_type
   use fw_linalg, only: lu_type
   use fw_pseudo_system, only: pseudo_system
   use fw_size_options, only: sizes
   use fw_solver_options, only: linear_auto, linear_lu
   implicit none (type, external)
   private

   public :: shifted_linear

   !> Relative residual of iterative solutions. The schemes estimate their errors from differences
   !> of such solutions.
   ! Far looser solutions would be taken for errors of the step, and shorten it.
   real(wp), parameter :: tolerance = 1.0e-6_wp

   type :: shifted_linear
      !> linear_auto, linear_lu or linear_krylov.
      integer :: kind = linear_auto
      !> Factors, or GMRES with the preconditioner.
      logical :: direct = .true.
      !> The point (n), and whether the system is linearized there.
      real(wp), allocatable :: x(:)
      logical :: current = .false.
      type(lu_type) :: lu
      type(gmres_type) :: gmres
      real(wp), allocatable :: rhs(:)
   contains
      procedure :: prepare
      procedure :: solve
      procedure :: precondition
      procedure :: left
   end type shifted_linear

contains

   !> Linearize at x and factor, or build the preconditioner. A shift is set, and the system is
   !> told to leave no unknown out (reduced = .false.). r is the (shifted) residual at x.
   subroutine prepare(self, system, x, r, done)
      class(shifted_linear), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(inout), contiguous :: r(:)
      logical, intent(out) :: done
      integer :: n_linear
      logical :: singular

      self%x = x
      if (.not. allocated(self%rhs)) allocate (self%rhs(size(x)))
      call system%residual(x, r)
      call system%linearize(n_linear)
      self%current = .true.
      ! A system that leaves rows out in spite of `reduced` cannot be handled here.
      done = n_linear == system%n
      if (.not. done) return
      self%direct = self%kind == linear_lu .or. &
                    (self%kind == linear_auto .and. n_linear <= sizes%lu_of_step)
      if (self%direct) then
         call self%lu%reserve(n_linear)
         call system%assemble(self%lu%matrix)
         call self%lu%factor(singular, system%interrupt)
         done = .not. singular
      else
         ! Without a shift of its own: the system knows that one is set.
         call system%build_preconditioner()
      end if
   end subroutine prepare

   !> Replace b by the solution.
   subroutine solve(self, system, b, done)
      class(shifted_linear), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: b(:)
      logical, intent(out) :: done
      integer :: n_linear

      done = .true.
      if (self%direct) then
         call self%lu%solve(b)
         return
      end if
      ! Products belong to the point that was evaluated last.
      if (.not. self%current) then
         call system%residual(self%x, self%rhs)
         call system%linearize(n_linear)
         self%current = .true.
      end if
      self%rhs = b
      call self%gmres%solve(system, self%rhs, b, tolerance, done)
   end subroutine solve

   !> Replace b by an approximation of the solution; it does not touch the system's point.
   subroutine precondition(self, system, b)
      class(shifted_linear), intent(inout) :: self
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(inout), contiguous :: b(:)

      if (self%direct) then
         call self%lu%solve(b)
      else
         call system%precondition(b)
      end if
   end subroutine precondition

   !> The system was evaluated elsewhere.
   subroutine left(self)
      class(shifted_linear), intent(inout) :: self

      self%current = .false.
   end subroutine left

end module fw_pseudo_linear
