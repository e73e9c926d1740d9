!> Restarted GMRES with right preconditioning (Saad and Schultz 1986): the norm that it watches is
!> that of the true residual. The operator knows nothing of the solver, nor the reverse.
module fw_krylov
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_lapack, only: dgemv
   implicit none (type, external)
   private

   public :: linear_operator, gmres_type

   !> A square linear operator with a preconditioner.
   type, abstract :: linear_operator
   contains
      procedure(apply_operator), deferred :: apply
      procedure(apply_preconditioner), deferred :: precondition
   end type linear_operator

   abstract interface
      !> product = A vector.
      subroutine apply_operator(self, vector, product)
         import :: linear_operator, wp
         class(linear_operator), intent(inout) :: self
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine apply_operator

      !> Replace a vector by an approximation of A^-1 vector.
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
      integer :: restart = 60
      integer :: max_iterations = 300
      !> Iterations of the last solution.
      integer :: iterations = 0
      real(wp), allocatable :: basis(:, :), hessenberg(:, :), direction(:), product(:)
      real(wp), allocatable :: cosine(:), sine(:), rhs(:), coefficients(:)
   contains
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
         deallocate (self%basis, self%hessenberg, self%direction, self%product, &
                     self%cosine, self%sine, self%rhs, self%coefficients)
      end if
      allocate (self%basis(n, self%restart + 1), self%hessenberg(self%restart + 1, self%restart))
      allocate (self%direction(n), self%product(n), self%cosine(self%restart))
      allocate (self%sine(self%restart), self%rhs(self%restart + 1))
      allocate (self%coefficients(self%restart + 1))
   end subroutine reserve

   !> Solve A x = b to norm(b - A x) <= tolerance * norm(b), from x = 0.
   subroutine solve(self, operator, b, x, tolerance, converged)
      class(gmres_type), intent(inout) :: self
      class(linear_operator), intent(inout) :: operator
      real(wp), intent(in), contiguous :: b(:)
      real(wp), intent(out), contiguous :: x(:)
      real(wp), intent(in) :: tolerance
      logical, intent(out) :: converged
      real(wp) :: target, norm, before
      integer :: used

      call self%reserve(size(b))
      x = 0.0_wp
      self%iterations = 0
      norm = norm2(b)
      target = tolerance*norm
      converged = norm <= 0.0_wp
      self%basis(:, 1) = b
      do while (.not. converged .and. self%iterations < self%max_iterations)
         before = norm
         call build_cycle(self, operator, norm, target, used)
         call add_correction(self, operator, used, x)
         ! The rotations know the residual of a regular problem only: a singular one is noticed
         ! by the residual itself, and its correction is taken back.
         call operator%apply(x, self%product)
         self%basis(:, 1) = b - self%product
         norm = norm2(self%basis(:, 1))
         converged = norm <= rounding_allowance*target
         if (converged) exit
         if (norm < before) cycle
         where (ieee_is_finite(self%direction))
            x = x - self%direction
         else where
            x = 0.0_wp
         end where
         exit
      end do
   end subroutine solve

   !> Arnoldi's process with Givens rotations, until the target or the restart length.
   subroutine build_cycle(self, operator, norm, target, used)
      type(gmres_type), intent(inout) :: self
      class(linear_operator), intent(inout) :: operator
      real(wp), intent(in) :: norm, target
      integer, intent(out) :: used
      integer :: j

      self%basis(:, 1) = self%basis(:, 1)/norm
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
         if (abs(self%rhs(j + 1)) <= target .or. self%iterations >= self%max_iterations) exit
      end do
   end subroutine build_cycle

   !> Classical Gram-Schmidt, twice: two products with the whole basis instead of j dot products.
   subroutine orthogonalize(self, j)
      type(gmres_type), intent(inout) :: self
      integer, intent(in) :: j
      integer :: n, pass

      n = size(self%product)
      self%hessenberg(:, j) = 0.0_wp
      do pass = 1, 2
         call dgemv('T', n, j, 1.0_wp, self%basis, n, self%product, 1, 0.0_wp, self%coefficients, 1)
         call dgemv('N', n, j, -1.0_wp, self%basis, n, self%coefficients, 1, 1.0_wp, &
            self%product, 1)
         self%hessenberg(:j, j) = self%hessenberg(:j, j) + self%coefficients(:j)
      end do
      self%hessenberg(j + 1, j) = norm2(self%product)
      self%basis(:, j + 1) = self%product/max(self%hessenberg(j + 1, j), tiny(1.0_wp))
   end subroutine orthogonalize

   !> Bring column j of the Hessenberg matrix to triangular form.
   subroutine rotate(self, j)
      type(gmres_type), intent(inout) :: self
      integer, intent(in) :: j
      integer :: i
      real(wp) :: upper, length

      associate (h => self%hessenberg, c => self%cosine, s => self%sine)
         do i = 1, j - 1
            upper = c(i)*h(i, j) + s(i)*h(i + 1, j)
            h(i + 1, j) = -s(i)*h(i, j) + c(i)*h(i + 1, j)
            h(i, j) = upper
         end do
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
      class(linear_operator), intent(inout) :: operator
      integer, intent(in) :: used
      real(wp), intent(inout), contiguous :: x(:)
      integer :: i, n

      n = size(x)
      do i = used, 1, -1
         self%coefficients(i) = (self%rhs(i) - dot_product(self%hessenberg(i, i + 1:used), &
                                                          self%coefficients(i + 1:used)))/ &
                                self%hessenberg(i, i)
      end do
      call dgemv('N', n, used, 1.0_wp, self%basis, n, self%coefficients, 1, 0.0_wp, &
                 self%direction, 1)
      call operator%precondition(self%direction)
      x = x + self%direction
   end subroutine add_correction

end module fw_krylov
