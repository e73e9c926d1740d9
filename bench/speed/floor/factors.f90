!> Factorisations of the preconditioner and solutions with them, in single precision: one complex
!> matrix a harmonic, or a real one for harmonic 0 and a complex one for all others with a part of
!> low rank. By LAPACK, or by the kernels of the library that read packed factors.
module floor_factors
   use floor_blas, only: cgemv, strsv
   use fw_kinds, only: sp, wp
   use fw_lapack, only: cgemm, cgetrf, ctrsm, ctrsv, sgetrf
   use fw_linalg, only: complex_lu_type
   use fw_panel_solve, only: group_width, panel_factors
   use fw_preconditioner_lu, only: preconditioner_lu_type
   implicit none (type, external)
   private

   public :: factor_kernels

   type :: factor_kernels
      !> Most coordinates, patterns, harmonics, and whether harmonic 0 is among these.
      integer :: m = 0, rank = 0, n_harmonics = 0
      logical :: has_constant = .true.
      !> Whether the kernels of the library serve in place of LAPACK.
      logical :: by_panels = .false.
      !> Order of the matrices in use, whether two serve all harmonics, and order of what is packed.
      integer, private :: n = 0, n_packed = 0
      logical, private :: has_two = .false.
      !> Matrices, and room for their factors (m, m); of the complex ones as many as harmonics at
      !> most.
      complex(sp), allocatable, private :: moving(:, :, :), moving_factors(:, :)
      real(sp), allocatable, private :: constant(:, :), constant_factors(:, :)
      integer, allocatable, private :: pivot(:)
      type(preconditioner_lu_type), private :: lu
      type(panel_factors), allocatable, private :: panels(:)
      type(panel_factors), private :: real_panels
      complex(sp), allocatable, private :: u(:, :), v(:, :), square(:, :), t(:, :)
      complex(sp), allocatable, private :: right(:, :), pattern(:, :), turned(:, :)
      real(sp), allocatable, private :: mean(:)
      type(complex_lu_type), private :: small
      complex(wp), allocatable, private :: dynamic(:, :)
   contains
      procedure :: reserve
      procedure :: prepare
      procedure :: factor
      procedure :: prepare_solution
      procedure :: solve
   end type factor_kernels

   complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)

contains

   subroutine reserve(self, m, rank, n_harmonics, has_constant, n_complex)
      class(factor_kernels), intent(out) :: self
      integer, intent(in) :: m, rank, n_harmonics
      !> Harmonic 0 is there.
      logical, intent(in) :: has_constant
      !> Complex matrices that are kept apart: one, or one a harmonic.
      integer, intent(in) :: n_complex
      integer :: i, j, k

      self%m = m
      self%rank = rank
      self%n_harmonics = n_harmonics
      self%has_constant = has_constant
      allocate (self%panels(n_complex), self%pivot(m))
      allocate (self%moving(m, m, n_complex), self%moving_factors(m, m))
      do k = 1, n_complex
         ! A diagonal that outweighs its row: no rows are swapped.
         do j = 1, m
            do i = 1, m
               self%moving(i, j, k) = cmplx(1.0/(m + i + 2*j), 1.0/(m + 2*i + j), sp)
            end do
            self%moving(j, j, k) = cmplx(2.0, 1.0, sp)
         end do
      end do
      self%constant = real(self%moving(:, :, 1), sp)
      allocate (self%constant_factors(m, m), source=0.0_sp)
      allocate (self%square(rank, rank), self%t(rank, rank), source=cmplx(1.0e-3, kind=sp))
      allocate (self%pattern(rank, n_harmonics), self%turned(rank, n_harmonics), source=one)
      allocate (self%dynamic(rank, rank), source=(0.0_wp, 0.0_wp))
   end subroutine reserve

   !> Matrices before they are factored.
   subroutine prepare(self, n, has_two)
      class(factor_kernels), intent(inout) :: self
      integer, intent(in) :: n
      !> Two matrices serve all harmonics.
      logical, intent(in) :: has_two

      call take_order(self, n, has_two)
      self%moving_factors(:n, :n) = self%moving(:n, :n, 1)
      if (has_two) self%constant_factors(:n, :n) = self%constant(:n, :n)
      if (self%by_panels) then
         call self%lu%reserve(n, 1.0_wp)
         self%lu%matrix(:n, :n) = self%moving(:n, :n, 1)
      end if
      self%u = cmplx(1.0e-3, kind=sp)
   end subroutine prepare

   !> Right-hand sides, which a solution overwrites: small ones would slow processors down.
   subroutine prepare_solution(self, n, has_two)
      class(factor_kernels), intent(inout) :: self
      integer, intent(in) :: n
      logical, intent(in) :: has_two

      call take_order(self, n, has_two)
      self%right = one
      self%mean = 1.0_sp
   end subroutine prepare_solution

   !> Vectors of an order, and the matrices packed.
   subroutine take_order(self, n, has_two)
      type(factor_kernels), intent(inout) :: self
      integer, intent(in) :: n
      logical, intent(in) :: has_two
      integer :: i, k

      self%has_two = has_two
      if (self%n /= n) then
         if (allocated(self%u)) deallocate (self%u, self%v, self%right, self%mean)
         self%n = n
         allocate (self%u(n, self%rank), self%v(n, self%rank), source=cmplx(1.0e-3, kind=sp))
         allocate (self%right(n, self%n_harmonics), source=one)
         allocate (self%mean(n), source=1.0_sp)
      end if
      if (self%n_packed == n .or. .not. self%by_panels) return
      self%n_packed = n
      self%pivot(:n) = [(i, i=1, n)]
      do k = 1, size(self%panels)
         call self%panels(k)%pack_factors(n, self%moving(:, :, k), self%pivot)
      end do
      call self%real_panels%pack_real(n, self%constant, self%pivot)
   end subroutine take_order

   !> LU factors of all matrices, and of two for all harmonics U and T_n. Where each harmonic has
   !> a matrix of its own, the factors of one are those of the next: nothing slows down by that.
   subroutine factor(self)
      class(factor_kernels), intent(inout) :: self
      integer :: info, k

      if (self%has_two .and. self%has_constant) then
         call sgetrf(self%n, self%n, self%constant_factors, self%m, self%pivot, info)
      end if
      do k = 1, merge(1, self%n_harmonics, self%has_two)
         if (self%by_panels) then
            call self%lu%factor()
         else
            call cgetrf(self%n, self%n, self%moving_factors, self%m, self%pivot, info)
         end if
      end do
      if (self%has_two .and. self%rank > 0) call find_patterns(self)
   end subroutine factor

   !> U = P^-1 X, V^T U, and T_n of all harmonics but 0.
   subroutine find_patterns(self)
      type(factor_kernels), intent(inout) :: self
      integer :: h

      call solve_many(self, self%rank, self%u)
      call cgemm('T', 'N', self%rank, self%rank, self%n, one, self%v, self%n, self%u, self%n, &
                 zero, self%square, self%rank)
      call self%small%reserve(self%rank)
      do h = merge(2, 1, self%has_constant), self%n_harmonics
         call find_turned(self)
      end do
   end subroutine find_patterns

   !> T_n of one harmonic: a product, factors and a solution of the order of the rank.
   subroutine find_turned(self)
      type(factor_kernels), intent(inout) :: self
      logical :: singular
      integer :: i

      self%small%matrix = matmul(self%square, self%t)
      do i = 1, self%rank
         self%small%matrix(i, i) = self%small%matrix(i, i) + 1.0_wp
      end do
      self%dynamic = self%t
      call self%small%factor(singular)
      if (.not. singular) call self%small%solve(self%rank, self%dynamic)
   end subroutine find_turned

   !> All harmonics.
   subroutine solve(self)
      class(factor_kernels), intent(inout) :: self
      integer :: h, n_columns

      if (.not. self%has_two) then
         do h = 1, self%n_harmonics
            call solve_one(self, h)
         end do
         return
      end if
      if (self%has_constant) call solve_constant(self)
      n_columns = self%n_harmonics - merge(1, 0, self%has_constant)
      if (n_columns == 0) return
      call solve_many(self, n_columns, self%right)
      if (self%rank > 0) call subtract_patterns(self, n_columns)
   end subroutine solve

   subroutine solve_constant(self)
      type(factor_kernels), intent(inout) :: self

      if (self%by_panels) then
         call self%real_panels%solve_real(self%mean(:self%n))
      else
         call strsv('L', 'N', 'U', self%n, self%constant, self%m, self%mean, 1)
         call strsv('U', 'N', 'N', self%n, self%constant, self%m, self%mean, 1)
      end if
   end subroutine solve_constant

   !> One harmonic with a matrix of its own.
   subroutine solve_one(self, h)
      type(factor_kernels), intent(inout) :: self
      integer, intent(in) :: h
      integer :: k

      k = min(h, size(self%panels))
      if (self%by_panels) then
         call self%panels(k)%solve_one(self%right(:self%n, h))
      else
         call ctrsv('L', 'N', 'U', self%n, self%moving(1, 1, k), self%m, self%right(1, h), 1)
         call ctrsv('U', 'N', 'N', self%n, self%moving(1, 1, k), self%m, self%right(1, h), 1)
      end if
   end subroutine solve_one

   !> Columns at once, in place.
   subroutine solve_many(self, n_columns, right)
      type(factor_kernels), intent(inout) :: self
      integer, intent(in) :: n_columns
      complex(sp), intent(inout), contiguous :: right(:, :)

      if (self%by_panels) then
         call self%panels(1)%reserve_groups(n_columns)
         call self%panels(1)%solve_groups(1, (n_columns + group_width - 1)/group_width, &
                                          n_columns, right)
      else
         call ctrsm('L', 'L', 'N', 'U', self%n, n_columns, one, self%moving, self%m, right, &
                    size(right, 1))
         call ctrsm('L', 'U', 'N', 'N', self%n, n_columns, one, self%moving, self%m, right, &
                    size(right, 1))
      end if
   end subroutine solve_many

   !> What the patterns add to a solution.
   subroutine subtract_patterns(self, n_columns)
      type(factor_kernels), intent(inout) :: self
      integer, intent(in) :: n_columns
      integer :: h

      associate (k => self%rank, n => self%n)
         call cgemm('T', 'N', k, n_columns, n, one, self%v, n, self%right, n, zero, &
                    self%pattern, k)
         do h = 1, n_columns
            call cgemv('N', k, k, one, self%t, k, self%pattern(1, h), 1, zero, &
                       self%turned(1, h), 1)
         end do
         call cgemm('N', 'N', n, n_columns, k, -one, self%u, n, self%turned, k, one, &
                    self%right, n)
      end associate
   end subroutine subtract_patterns

end module floor_factors
