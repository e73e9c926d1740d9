!> The arithmetic of matrices that a sweep cannot do without, alone and on contiguous memory: by
!> BLAS and LAPACK, or by the kernels of the library that read packed matrices, for who wants the
!> faster of both. What prepares a call (packing, copies of what is overwritten) is apart from it.
!>
!> Entries are made up, but for the sizes: nothing here branches on them.
module floor_matrices
   use floor_blas, only: cgemv, sgemm
   use fw_column_panels, only: column_height => panel_height, column_panels => panel_count, &
      multiply_column
   use fw_column_product, only: multiply_columns
   use fw_condensed_group, only: condensed_group, lanes
   use fw_kinds, only: sp, wp
   use fw_lapack, only: dgemm, dgemv, zgemm, zgemv
   use fw_linalg, only: complex_lu_type
   use fw_plain_structure, only: plain_structure
   use fw_single_product, only: group_count, group_width, multiply_panels, panel_count, &
      panel_height
   use fw_tall_product, only: multiply_transposed, subtract_product
   implicit none (type, external)
   private

   public :: matrix_kernels

   type :: matrix_kernels
      !> Coordinates, internal modes, real matrices, patterns, harmonics, coefficients.
      integer :: m = 0, n_i = 0, n_blocks = 0, rank = 0, n_harmonics = 0, n_coefficients = 0
      !> Whether damping couples the internal modes, and whether Z_r is formed.
      logical :: is_coupled = .false., is_formed = .false.
      !> Whether the kernels of the library serve in place of BLAS, where it has any.
      logical :: by_panels = .false.
      !> Z_r of the harmonics, its coupling with the internal modes, solved, and vectors.
      complex(wp), allocatable, private :: stiffness(:, :, :), coupling(:, :), solved(:, :)
      complex(wp), allocatable, private :: input(:, :), output(:, :), inverse(:)
      type(complex_lu_type), private :: internal
      !> Harmonics side by side, and loads (n_i, lanes), (m, lanes).
      type(condensed_group), private :: group
      complex(wp), allocatable, private :: load_i(:, :), load(:, :)
      !> S_n and what it is made of.
      complex(wp), allocatable, private :: pattern_i(:, :), pattern_solved(:, :), dynamic(:, :)
      complex(wp), allocatable, private :: amplitude(:), turned(:)
      !> Z_r in single precision, and packed with its right-hand side.
      complex(sp), allocatable, private :: near_stiffness(:, :, :), near_input(:), near_output(:)
      real(sp), allocatable, private :: packed(:, :), column(:, :)
      !> V in single precision, patterns, [K V] with its right-hand sides and the product.
      real(sp), allocatable, private :: v(:, :), vector(:, :), patterns(:, :), rows(:), right(:)
      real(sp), allocatable, private :: near(:, :)
      !> Multiples of vectors, internal modes and products in double precision.
      real(wp), allocatable, private :: multiples(:), modes(:, :), product(:, :)
      real(wp), allocatable, private :: basis(:, :), direction(:), weights(:)
   contains
      procedure :: reserve
      procedure :: condense
      procedure :: multiply_all
      procedure :: multiply
      procedure :: orthogonalize
      procedure :: recover
   end type matrix_kernels

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> What all entries are: products of many of them stay near one.
   real(wp), parameter :: entry = 1.0e-3_wp
   !> Loads of one frequency: static, cosine and sine.
   integer, parameter :: n_loads = 3
   !> Vectors of a basis: those of a cycle of GMRES.
   integer, parameter :: longest_basis = 61

contains

   subroutine reserve(self, structure)
      class(matrix_kernels), intent(out) :: self
      type(plain_structure), intent(in) :: structure

      self%m = structure%n_coordinates
      self%n_i = structure%basis%n_internal
      self%n_blocks = structure%basis%n_blocks
      self%rank = structure%dynamic%rank
      self%n_harmonics = size(structure%harmonic)
      self%n_coefficients = structure%n_coefficients
      self%is_coupled = allocated(structure%basis%c_ii)
      self%is_formed = structure%forms_blocks
      associate (m => self%m, n_i => self%n_i, nc => self%n_coefficients, k => self%rank)
         allocate (self%input(m, self%n_harmonics), self%output(m, self%n_harmonics), source=one)
         allocate (self%inverse(n_i), source=one)
         allocate (self%modes(n_i, max(nc, n_loads)), self%product(m, max(nc, n_loads)), &
                   source=entry)
         allocate (self%multiples((m + n_i)*self%n_blocks*max(nc, n_loads)), source=entry)
         allocate (self%basis(m*nc, longest_basis), self%direction(m*nc), &
                   self%weights(longest_basis), source=entry)
         if (self%is_formed) then
            allocate (self%stiffness(m, m, self%n_harmonics), self%coupling(n_i, m), &
                      self%solved(n_i, m), source=cmplx(entry, kind=wp))
            call self%group%reserve(structure%basis, self%n_harmonics)
            allocate (self%load_i(n_i, lanes), self%load(m, lanes), source=zero)
            allocate (self%near_stiffness(m, m, self%n_harmonics), self%near_input(m), &
                      self%near_output(m), source=cmplx(entry, kind=sp))
            allocate (self%packed(2*column_height*m*column_panels(m), self%n_harmonics), &
                      self%column(2, m), source=real(entry, sp))
            return
         end if
         allocate (self%pattern_i(n_i, k), self%pattern_solved(n_i, k), self%dynamic(k, k), &
                   self%amplitude(k), self%turned(k), source=cmplx(entry, kind=wp))
         allocate (self%v(m, k), self%vector(m, nc), self%patterns(k, nc), self%near(m, nc), &
                   source=real(entry, sp))
         allocate (self%rows(panel_height*(m + k)*panel_count(m)), source=real(entry, sp))
         allocate (self%right(group_width*(m + k)*group_count(nc)), source=real(entry, sp))
      end associate
   end subroutine reserve

   !> The matrices of a frequency, and its loads.
   subroutine condense(self, structure)
      class(matrix_kernels), intent(inout) :: self
      type(plain_structure), intent(in) :: structure
      integer :: h

      if (self%is_formed .and. self%by_panels .and. self%group%serves) then
         call form_groups(self, structure)
         return
      end if
      do h = 1, self%n_harmonics
         if (self%is_coupled) call factor_internal(self)
         if (self%is_formed) then
            call form(self, structure%basis%blocks, structure%basis%coupling, h)
         else if (self%rank > 0) then
            call find_dynamic(self)
         end if
      end do
      if (self%is_formed .or. self%n_i == 0) return
      call dgemm('T', 'N', self%m, n_loads, self%n_i*self%n_blocks, -1.0_wp, &
                 structure%basis%coupling, self%n_i*self%n_blocks, self%multiples, &
                 self%n_i*self%n_blocks, 1.0_wp, self%product, self%m)
   end subroutine condense

   !> Z_r of all harmonics, several side by side.
   subroutine form_groups(self, structure)
      type(matrix_kernels), intent(inout) :: self
      type(plain_structure), intent(in) :: structure
      real(wp) :: s(self%n_harmonics)
      integer :: first, h, last, n_failed

      n_failed = 0
      s = [(entry*h, h=1, self%n_harmonics)]
      do first = 1, self%n_harmonics, lanes
         last = min(first + lanes - 1, self%n_harmonics)
         call self%group%form(structure%basis, s(first:last)**2, s(first:last), &
                              self%load_i(:, :last - first + 1), &
                              self%stiffness(:, :, first:last), &
                              self%load(:, :last - first + 1), n_failed)
      end do
   end subroutine form_groups

   !> A matrix that elimination leaves as it is takes no less time than any other.
   subroutine factor_internal(self)
      type(matrix_kernels), intent(inout) :: self
      logical :: singular
      integer :: j

      call self%internal%reserve(self%n_i)
      self%internal%matrix(:self%n_i, :self%n_i) = zero
      do j = 1, self%n_i
         self%internal%matrix(j, j) = one
      end do
      call self%internal%factor(singular)
   end subroutine factor_internal

   !> D^-1 in place.
   subroutine solve_internal(self, n_columns, right)
      type(matrix_kernels), intent(in) :: self
      integer, intent(in) :: n_columns
      complex(wp), intent(inout), contiguous :: right(:, :)
      integer :: j

      if (self%is_coupled) then
         call self%internal%solve(n_columns, right)
      else
         do j = 1, n_columns
            right(:, j) = self%inverse*right(:, j)
         end do
      end if
   end subroutine solve_internal

   !> Z_r of one harmonic: a sum of K, M and C, and half of the product, which is symmetric.
   subroutine form(self, blocks, coupling, h)
      type(matrix_kernels), intent(inout) :: self
      real(wp), intent(in) :: blocks(:, :, :), coupling(:, :, :)
      integer, intent(in) :: h
      complex(wp) :: factors(3)
      integer :: j

      factors = [one, cmplx(-entry, kind=wp), cmplx(0.0_wp, entry, wp)]
      do j = 1, self%m
         if (self%n_blocks == 3) then
            self%stiffness(:, j, h) = factors(1)*blocks(:self%m, j, 1) + &
                                      factors(2)*blocks(:self%m, j, 2) + &
                                      factors(3)*blocks(:self%m, j, 3)
            self%coupling(:, j) = factors(1)*coupling(:, 1, j) + factors(2)*coupling(:, 2, j) + &
                                  factors(3)*coupling(:, 3, j)
         else
            self%stiffness(:, j, h) = factors(1)*blocks(:self%m, j, 1) + &
                                      factors(2)*blocks(:self%m, j, 2)
            self%coupling(:, j) = factors(1)*coupling(:, 1, j) + factors(2)*coupling(:, 2, j)
         end if
      end do
      if (self%n_i == 0) return
      self%solved = self%coupling
      call solve_internal(self, self%m, self%solved)
      call zgemm('T', 'N', self%m, (self%m + 1)/2, self%n_i, -one, self%coupling, self%n_i, &
                 self%solved, self%n_i, one, self%stiffness(1, 1, h), self%m)
   end subroutine form

   !> S_n of one harmonic.
   subroutine find_dynamic(self)
      type(matrix_kernels), intent(inout) :: self

      self%pattern_solved = self%pattern_i
      call solve_internal(self, self%rank, self%pattern_solved)
      call zgemm('T', 'N', self%rank, self%rank, self%n_i, -one, self%pattern_i, self%n_i, &
                 self%pattern_solved, self%n_i, zero, self%dynamic, self%rank)
   end subroutine find_dynamic

   !> The product of all coordinates.
   subroutine multiply_all(self, blocks)
      class(matrix_kernels), intent(inout) :: self
      !> K, M, C: rows of the coordinates, then of the internal modes.
      real(wp), intent(in), contiguous :: blocks(:, :, :)

      if (self%is_formed) then
         call multiply_formed(self, self%m, self%m)
      else
         call multiply_real(self, self%m, self%m, blocks)
      end if
   end subroutine multiply_all

   !> Of the rows and columns in use; nearly, where that serves.
   subroutine multiply(self, n_active, n_used, is_near, blocks)
      class(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      logical, intent(in) :: is_near
      real(wp), intent(in), contiguous :: blocks(:, :, :)

      if (self%is_formed .and. is_near) then
         call multiply_formed_nearly(self, n_active, n_used)
      else if (self%is_formed) then
         call multiply_formed(self, n_active, n_used)
      else if (is_near .and. self%rank > 0) then
         call multiply_nearly(self, n_active, n_used)
      else
         call multiply_real(self, n_active, n_used, blocks)
      end if
   end subroutine multiply

   !> One complex matrix a harmonic.
   subroutine multiply_formed(self, n_active, n_used)
      type(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      integer :: h

      do h = 1, self%n_harmonics
         call zgemv('N', n_used, n_active, one, self%stiffness(1, 1, h), n_used, &
                    self%input(1, h), 1, zero, self%output(1, h), 1)
      end do
   end subroutine multiply_formed

   !> The same in single precision.
   subroutine multiply_formed_nearly(self, n_active, n_used)
      type(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      complex(sp), parameter :: one = (1.0_sp, 0.0_sp), zero = (0.0_sp, 0.0_sp)
      real(sp) :: tile(column_height, 2)
      integer :: h, p

      do h = 1, self%n_harmonics
         if (self%by_panels) then
            do p = 1, column_panels(n_used)
               call multiply_column(n_active, &
                                    self%packed(2*column_height*n_active*(p - 1) + 1, h), &
                                    self%column, tile)
            end do
         else
            call cgemv('N', n_used, n_active, one, self%near_stiffness(1, 1, h), n_used, &
                       self%near_input, 1, zero, self%near_output, 1)
         end if
      end do
   end subroutine multiply_formed_nearly

   !> Real matrices for all harmonics: the internal modes, then the rows with these below.
   subroutine multiply_real(self, n_active, n_used, blocks)
      type(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      real(wp), intent(in) :: blocks(n_active + self%n_i, n_used, self%n_blocks)
      integer :: b, n_inner

      n_inner = n_active + self%n_i
      associate (nc => self%n_coefficients, nb => self%n_blocks)
         do b = 1, merge(nb, 0, self%n_i > 0)
            call dgemm('N', 'N', self%n_i, nc, n_active, 1.0_wp, blocks(n_active + 1, 1, b), &
                       n_inner, self%multiples((b - 1)*n_inner + 1), n_inner*nb, &
                       merge(0.0_wp, 1.0_wp, b == 1), self%modes, self%n_i)
         end do
         if (self%by_panels) then
            call multiply_columns(n_used, n_inner, nb, nc, blocks, self%multiples, .false., &
                                  self%m, self%product)
            return
         end if
         do b = 1, nb
            call dgemm('T', 'N', n_used, nc, n_inner, 1.0_wp, blocks(1, 1, b), n_inner, &
                       self%multiples((b - 1)*n_inner + 1), n_inner*nb, &
                       merge(0.0_wp, 1.0_wp, b == 1), self%product, self%m)
         end do
      end associate
   end subroutine multiply_real

   !> One real matrix in single precision for all harmonics, with the patterns as columns of it.
   subroutine multiply_nearly(self, n_active, n_used)
      type(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      integer :: h, n_inner

      n_inner = n_active + self%rank
      associate (nc => self%n_coefficients, k => self%rank)
         call sgemm('T', 'N', k, nc, n_active, 1.0_sp, self%v, self%m, self%vector, self%m, &
                    0.0_sp, self%patterns, k)
         do h = 1, self%n_harmonics
            call zgemv('N', k, k, one, self%dynamic, k, self%amplitude, 1, zero, self%turned, 1)
         end do
         if (self%by_panels) then
            call multiply_panels(n_used, n_inner, nc, self%rows, self%right, 1.0_wp, .false., &
                                 self%m, self%product)
         else
            call sgemm('N', 'N', n_used, nc, n_inner, 1.0_sp, self%rows, n_used, self%right, &
                       n_inner, 0.0_sp, self%near, self%m)
         end if
      end associate
   end subroutine multiply_nearly

   !> Gram and Schmidt's products with a basis, twice, and the next direction.
   subroutine orthogonalize(self, n_active, n_basis)
      class(matrix_kernels), intent(inout) :: self
      integer, intent(in) :: n_active, n_basis
      integer :: j, n, pass

      n = n_active*self%n_coefficients
      j = min(n_basis, longest_basis - 1)
      do pass = 1, 2
         if (self%by_panels) then
            call multiply_transposed(n, j, self%basis, self%direction, self%weights)
            call subtract_product(n, j, self%basis, self%weights, self%direction)
         else
            call dgemv('T', n, j, 1.0_wp, self%basis, n, self%direction, 1, 0.0_wp, &
                       self%weights, 1)
            call dgemv('N', n, j, -1.0_wp, self%basis, n, self%weights, 1, 1.0_wp, &
                       self%direction, 1)
         end if
      end do
      call normalize(n, self%direction)
   end subroutine orthogonalize

   pure subroutine normalize(n, direction)
      integer, intent(in) :: n
      real(wp), intent(inout) :: direction(n)
      real(wp) :: factor

      factor = 1.0_wp/sqrt(max(entry, dot_product(direction, direction)))
      direction = factor*direction
   end subroutine normalize

   !> Internal modes, and from them what is observed.
   subroutine recover(self, structure)
      class(matrix_kernels), intent(inout) :: self
      type(plain_structure), intent(in) :: structure
      integer :: b

      associate (nc => self%n_coefficients, n_inner => self%m + self%n_i, &
                 blocks => structure%basis%blocks)
         do b = 1, merge(self%n_blocks, 0, self%n_i > 0)
            call dgemm('N', 'N', self%n_i, nc, self%m, 1.0_wp, blocks(self%m + 1, 1, b), n_inner, &
                       self%multiples((b - 1)*n_inner + 1), n_inner*self%n_blocks, &
                       merge(0.0_wp, 1.0_wp, b == 1), self%modes, self%n_i)
         end do
      end associate
   end subroutine recover

end module floor_matrices
