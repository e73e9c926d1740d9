!> Restarted GMRES with right preconditioning (Saad and Schultz 1986): the norm that it watches is
!> that of the true residual. The operator knows nothing of the solver, nor the reverse.
!>
!> It solves A P^-1 (P x) = b. From x = 0 only: a restart passes the remaining residual to a new
!> cycle instead of a guess. Both vectors and their products may hold physical units; the only norm
!> taken is the Euclidean one of the right-hand side's space, so the caller scales where it matters.
module fw_krylov
   use fw_interrupt, only: interrupt_type, must_end
   use fw_kinds, only: wp
   use fw_lapack, only: dgemv
   use fw_norm, only: is_finite, norm_of
   use fw_tall_product, only: multiply_transposed, subtract_product
   implicit none (type, external)
   private

   public :: linear_operator, gmres_type

   !> A square linear operator with a preconditioner.
   type, abstract :: linear_operator
      !> What may end work with it early; null where nothing does.
      class(interrupt_type), pointer :: interrupt => null()
      !> Relative residual that the solution at work is asked for; 0 outside of solutions, where
      !> products are exact. An operator that has a cheaper product of such a precision may take it.
      real(wp) :: asked = 0.0_wp
      !> Whether it has cheaper products or a preconditioner that rest on such an approximation; who
      !> solves takes that back where a solution fails with them.
      logical :: nearly = .false.
   contains
      procedure :: is_interrupted
      procedure(apply_operator), deferred :: apply
      procedure(apply_preconditioner), deferred :: precondition
   end type linear_operator

   abstract interface
      !> product = A vector.
      subroutine apply_operator(self, vector, product)
         import :: linear_operator, wp
         class(linear_operator), intent(inout) :: self
         ! Both of the order of the system; apply must not change what `precondition` works with.
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine apply_operator

      !> Replace a vector by an approximation of A^-1 vector.
      ! P is linear and the same for all vectors of a solution: a method that varies would need
      ! flexible GMRES, which keeps a second basis.
      subroutine apply_preconditioner(self, vector)
         import :: linear_operator, wp
         class(linear_operator), intent(inout) :: self
         real(wp), intent(inout), contiguous :: vector(:)
      end subroutine apply_preconditioner
   end interface

   !> The residual may exceed the estimate of the rotations by round-off.
   real(wp), parameter :: rounding_allowance = 2.0_wp

   !> Workspace of GMRES for vectors of one length; belongs to one thread.
   type :: gmres_type
      !> Directions in a cycle: its cost grows with the square of it, its memory is n times as many.
      integer :: restart = 60
      !> Over all cycles of a solution.
      integer :: max_iterations = 300
      !> Iterations of the last solution.
      integer :: iterations = 0
      !> Orthonormal directions (n, restart + 1); Hessenberg matrix, made triangular column by
      !> column (restart + 1, restart); P^-1 v and A P^-1 v of the direction at work, both (n).
      real(wp), allocatable :: basis(:, :), hessenberg(:, :), direction(:), product(:)
      !> Rotations (restart); norm of the residual in their coordinates and the small unknowns
      !> (restart + 1).
      real(wp), allocatable :: cosine(:), sine(:), rhs(:), coefficients(:)
      !> First direction of the last solution (n), and its number of directions where they all are
      !> of one cycle, else 0: what `start_alike` needs.
      real(wp), allocatable, private :: first(:)
      integer, private :: n_directions = 0
   contains
      procedure :: start_alike
      procedure :: forget
      procedure :: reserve
      procedure :: solve
   end type gmres_type

contains

   !> Make room for vectors of n entries.
   subroutine reserve(self, n)
      class(gmres_type), intent(inout) :: self
      integer, intent(in) :: n

      if (allocated(self%basis)) then
         if (size(self%basis, 1) == n) return
         deallocate (self%basis, self%hessenberg, self%direction, self%product, self%first, &
                     self%cosine, self%sine, self%rhs, self%coefficients)
      end if
      allocate (self%basis(n, self%restart + 1), self%hessenberg(self%restart + 1, self%restart))
      allocate (self%direction(n), self%product(n), self%first(n), self%cosine(self%restart))
      allocate (self%sine(self%restart), self%rhs(self%restart + 1))
      allocate (self%coefficients(self%restart + 1))
   end subroutine reserve

   !> Whether work with it is to end.
   logical function is_interrupted(self)
      class(linear_operator), intent(in) :: self

      is_interrupted = must_end(self%interrupt)
   end function is_interrupted

   !> Solve A x = b to norm(b - A x) <= tolerance * norm(b), from x = 0.
   subroutine solve(self, operator, b, x, tolerance, converged)
      !> Workspace, with the counts of this solution on return.
      class(gmres_type), intent(inout) :: self
      !> The operator may keep caches of its own, hence inout.
      class(linear_operator), intent(inout) :: operator
      !> Right-hand side (n), and the solution (n): the best of the cycles where not converged.
      real(wp), intent(in), contiguous :: b(:)
      real(wp), intent(out), contiguous :: x(:)
      !> Relative to the norm of b.
      real(wp), intent(in) :: tolerance
      !> False where max_iterations were used up or a cycle did not reduce the residual: what x
      !> holds then has no larger residual than x = 0.
      logical, intent(out) :: converged
      real(wp) :: target, norm, before
      integer :: used

      call self%reserve(size(b))
      x = 0.0_wp
      self%iterations = 0
      self%n_directions = 0
      norm = norm_of(b)
      target = tolerance*norm
      converged = norm <= 0.0_wp
      operator%asked = tolerance
      self%basis(:, 1) = b
      do while (.not. converged .and. self%iterations < self%max_iterations)
         if (operator%is_interrupted()) exit
         before = norm
         call build_cycle(self, operator, norm, target, used)
         ! Of later cycles the first direction is one of many: they are not kept.
         self%n_directions = merge(used, 0, self%iterations == used)
         call add_correction(self, operator, used, x)
         ! The rotations know the residual of a regular problem only: a singular one is noticed
         ! by the residual itself, and its correction is taken back.
         call operator%apply(x, self%product)
         self%basis(:, 1) = b - self%product
         norm = norm_of(self%basis(:, 1))
         converged = norm <= rounding_allowance*target
         if (converged) exit
         ! Less than nothing gained in a whole cycle: another one from here would repeat it.
         if (norm < before) cycle
         ! Infinite corrections come of a singular small matrix; with them the earlier cycles are
         ! lost, because infinity cannot be subtracted again.
         where (is_finite(self%direction))
            x = x - self%direction
         else where
            x = 0.0_wp
         end where
         exit
      end do
      operator%asked = 0.0_wp
   end subroutine solve

   !> The operator or its preconditioner is another one from here on.
   pure subroutine forget(self)
      class(gmres_type), intent(inout) :: self

      self%n_directions = 0
   end subroutine forget

   !> The best x among the directions of the last solution, which was of the same operator with the
   !> same preconditioner: right-hand sides that are alike have most of their solution there. b
   !> becomes what x leaves of it; both stay as they are where it leaves more.
   subroutine start_alike(self, operator, b, x)
      class(gmres_type), intent(inout) :: self
      class(linear_operator), intent(inout) :: operator
      real(wp), intent(inout), contiguous :: b(:)
      !> Zero on entry.
      real(wp), intent(inout), contiguous :: x(:)
      real(wp) :: upper
      integer :: i, n

      n = self%n_directions
      if (n == 0) return
      if (size(b) /= size(self%first)) return
      ! The residual took its place.
      self%basis(:, 1) = self%first
      call multiply_transposed(size(b), n + 1, self%basis, b, self%rhs)
      do i = 1, n
         upper = self%cosine(i)*self%rhs(i) + self%sine(i)*self%rhs(i + 1)
         self%rhs(i + 1) = -self%sine(i)*self%rhs(i) + self%cosine(i)*self%rhs(i + 1)
         self%rhs(i) = upper
      end do
      call add_correction(self, operator, n, x)
      call operator%apply(x, self%product)
      if (norm_of(b - self%product) < norm_of(b)) then
         b = b - self%product
      else
         x = 0.0_wp
      end if
   end subroutine start_alike

   !> Arnoldi's process with Givens rotations, until the target or the restart length.
   subroutine build_cycle(self, operator, norm, target, used)
      !> basis(:, 1) holds the residual on entry, not yet normalised.
      type(gmres_type), intent(inout) :: self
      class(linear_operator), intent(inout) :: operator
      !> Norm of that residual, and the norm at which the cycle may end.
      real(wp), intent(in) :: norm, target
      !> Number of directions that were built; at least one.
      integer, intent(out) :: used
      integer :: j

      self%basis(:, 1) = self%basis(:, 1)/norm
      self%first = self%basis(:, 1)
      self%rhs = 0.0_wp
      self%rhs(1) = norm
      used = 0
      do j = 1, self%restart
         self%direction = self%basis(:, j)
         call operator%precondition(self%direction)
         call operator%apply(self%direction, self%product)
         call orthogonalize(self, j)
         call rotate(self, j)
         self%iterations = self%iterations + 1
         used = j
         ! abs(rhs(j + 1)) is the norm of the residual by the least-squares theory: no product is
         ! spent on watching it.
         if (abs(self%rhs(j + 1)) <= target .or. self%iterations >= self%max_iterations) exit
         if (operator%is_interrupted()) exit
      end do
   end subroutine build_cycle

   !> Classical Gram-Schmidt, twice: two products with the whole basis instead of j dot products.
   subroutine orthogonalize(self, j)
      type(gmres_type), intent(inout) :: self
      !> Column of the Hessenberg matrix that is made; direction j + 1 comes of it.
      integer, intent(in) :: j
      integer :: n, pass

      n = size(self%product)
      self%hessenberg(:, j) = 0.0_wp
      ! One pass loses orthogonality where the product lies almost in the basis; after the second it
      ! is orthogonal to working precision ("twice is enough").
      do pass = 1, 2
         call multiply_transposed(n, j, self%basis, self%product, self%coefficients)
         call subtract_product(n, j, self%basis, self%coefficients, self%product)
         self%hessenberg(:j, j) = self%hessenberg(:j, j) + self%coefficients(:j)
      end do
      self%hessenberg(j + 1, j) = norm_of(self%product)
      ! A product within the span of the basis leaves nothing: x is then exact, and the division
      ! must only not fail.
      self%basis(:, j + 1) = self%product/max(self%hessenberg(j + 1, j), tiny(1.0_wp))
   end subroutine orthogonalize

   !> Bring column j of the Hessenberg matrix to triangular form.
   subroutine rotate(self, j)
      type(gmres_type), intent(inout) :: self
      !> Column at work; the rotations 1 to j - 1 are known.
      integer, intent(in) :: j
      integer :: i
      real(wp) :: upper, length

      associate (h => self%hessenberg, c => self%cosine, s => self%sine)
         ! First the rotations of earlier columns, in the order in which they were found ...
         do i = 1, j - 1
            upper = c(i)*h(i, j) + s(i)*h(i + 1, j)
            h(i + 1, j) = -s(i)*h(i, j) + c(i)*h(i + 1, j)
            h(i, j) = upper
         end do
         ! ... then a new one, which removes the entry below the diagonal. For a zero column it is
         ! the null rotation c = s = 0; the true residual at the end of the cycle notices.
         length = max(hypot(h(j, j), h(j + 1, j)), tiny(1.0_wp))
         c(j) = h(j, j)/length
         s(j) = h(j + 1, j)/length
         h(j, j) = length
         h(j + 1, j) = 0.0_wp
         self%rhs(j + 1) = -s(j)*self%rhs(j)
         self%rhs(j) = c(j)*self%rhs(j)
      end associate
   end subroutine rotate

   !> x = x + P^-1 V y with the minimising y of a cycle.
   subroutine add_correction(self, operator, used, x)
      type(gmres_type), intent(inout) :: self
      !> Directions that the cycle built.
      class(linear_operator), intent(inout) :: operator
      integer, intent(in) :: used
      !> Solution so far (n).
      real(wp), intent(inout), contiguous :: x(:)
      integer :: i, n

      n = size(x)
      ! Back substitution in the triangular matrix that the rotations left.
      do i = used, 1, -1
         self%coefficients(i) = (self%rhs(i) - dot_product(self%hessenberg(i, i + 1:used), &
                                                          self%coefficients(i + 1:used)))/ &
                                self%hessenberg(i, i)
      end do
      call dgemv('N', n, used, 1.0_wp, self%basis, n, self%coefficients, 1, 0.0_wp, &
                 self%direction, 1)
      ! Once for the sum of all directions instead of once for each of them: P is linear.
      call operator%precondition(self%direction)
      x = x + self%direction
   end subroutine add_correction

end module fw_krylov
