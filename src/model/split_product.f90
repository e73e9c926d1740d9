!> The product of a step of an iterative solver: Z_n v ~ K v + V S_n V^T v (fw_dynamic_part), of
!> rows and columns in use. One real matrix in single precision, [K V], serves all harmonics.
module fw_split_product
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_dynamic_part, only: dynamic_part
   use fw_kinds, only: sp, wp
   use fw_lapack, only: dgemm
   use fw_real_products, only: harmonic_factors
   use fw_reduction, only: reduction_type
   use fw_single_product, only: group_count, group_width, multiply_panels, panel_count, &
      panel_height
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: split_product

   !> Entries of vectors from which threads share their columns: fewer are done sooner than threads
   !> are called.
   integer, parameter :: entries_for_threads = 8000
   !> Columns that are copied together: a line of memory of each is read once.
   integer, parameter :: columns_at_hand = 16

   !> A product by a matrix that is split into a static part and one of low rank.
   type :: split_product
      !> S_n (rank, rank, n_retained).
      complex(wp), allocatable :: dynamic(:, :, :)
      !> Rows, and columns among them.
      integer, private :: n_used = 0, n_active = 0
      !> [K/scale V/sqrt(scale)] of the rows in use in panels, V of the columns (n_active, rank).
      real(sp), allocatable, private :: rows(:)
      !> The largest stiffness, because single precision ends at 1e38.
      real(wp), private :: scale = 1.0_wp
      real(wp), allocatable, private :: v(:, :)
      !> Right-hand sides in groups; patterns (rank, n_coefficients) and their amplitudes.
      real(sp), allocatable, private :: groups(:)
      real(wp), allocatable, private :: patterns(:, :)
      complex(wp), allocatable, private :: amplitude(:, :), turned(:, :)
   contains
      procedure :: pack_rows
      procedure :: multiply
   end type split_product

contains

   !> Copy the rows and columns in use.
   subroutine pack_rows(self, basis, part, n_coefficients, n_active, n_used, used)
      class(split_product), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(dynamic_part), intent(in) :: part
      integer, intent(in) :: n_coefficients, n_active, n_used
      !> First n_used entries; the first n_active of them are columns.
      integer, intent(in) :: used(:)
      integer :: j, n_stored

      self%n_used = n_used
      self%n_active = n_active
      n_stored = panel_height*(n_active + part%rank)*panel_count(n_used)
      if (allocated(self%rows)) then
         if (size(self%rows) < n_stored) deallocate (self%rows)
      end if
      if (.not. allocated(self%rows)) allocate (self%rows(n_stored + n_stored/10))
      self%v = part%v(used(:n_active), :)
      if (.not. allocated(self%groups)) then
         allocate (self%groups(group_width*(size(part%v, 1) + part%rank)* &
                               group_count(n_coefficients)))
      end if
      ! Of a static stiffness the largest entry is on the diagonal. Its reciprocal is to be finite.
      self%scale = maxval([(abs(basis%blocks(used(j), used(j), 1)), j=1, n_active)])
      if (.not. self%scale > tiny(1.0_wp)) self%scale = 1.0_wp
      call fill_rows(basis, part, n_active, n_used, used, n_active + part%rank, &
                     1.0_wp/self%scale, self%rows)
   end subroutine pack_rows

   !> A few columns of the matrix at a time, which stay at hand while the panels go through their
   !> rows; threads share them.
   subroutine fill_rows(basis, part, n_active, n_used, used, n_inner, factor, panels)
      type(reduction_type), intent(in) :: basis
      type(dynamic_part), intent(in) :: part
      integer, intent(in) :: n_active, n_used, n_inner
      integer, intent(in) :: used(:)
      !> Of K, and of V its root.
      real(wp), intent(in) :: factor
      real(sp), intent(inout) :: panels(panel_height, n_inner, *)
      real(wp) :: root
      integer :: first, i, j, k, n, p

      root = sqrt(factor)
      !$omp parallel do default(none) private(first, i, j, k, n, p) &
      !$omp shared(basis, part, n_active, n_used, n_inner, used, factor, root, panels) &
      !$omp if(n_used >= coordinates_for_threads)
      do k = 1, n_inner, columns_at_hand
         do p = 1, panel_count(n_used)
            first = (p - 1)*panel_height
            n = min(panel_height, n_used - first)
            do j = k, min(k + columns_at_hand - 1, n_inner)
               ! The last panel may have rows to spare.
               panels(n + 1:, j, p) = 0.0_sp
               if (j <= n_active) then
                  do i = 1, n
                     panels(i, j, p) = real(factor*basis%blocks(used(first + i), used(j), 1), sp)
                  end do
               else
                  do i = 1, n
                     panels(i, j, p) = real(root*part%v(used(first + i), j - n_active), sp)
                  end do
               end if
            end do
         end do
      end do
      !$omp end parallel do
   end subroutine fill_rows

   !> product = Z(used, active) v, nearly; n_stored rows of memory.
   subroutine multiply(self, rank, factors, v, n_coefficients, n_stored, product)
      class(split_product), intent(inout) :: self
      integer, intent(in) :: rank
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_coefficients, n_stored
      !> (n_active, n_coefficients)
      real(wp), intent(in) :: v(self%n_active, n_coefficients)
      real(wp), intent(inout) :: product(n_stored, *)
      real(wp) :: largest
      integer :: h, n_inner
      logical :: threaded, shares_columns

      n_inner = self%n_active + rank
      if (.not. allocated(self%patterns)) then
         allocate (self%patterns(rank, n_coefficients))
         allocate (self%amplitude(rank, size(factors%harmonic)))
         allocate (self%turned(rank, size(factors%harmonic)))
      end if
      threaded = self%n_used >= coordinates_for_threads
      shares_columns = threaded .and. size(v) >= entries_for_threads
      call find_patterns(self, rank, n_coefficients, shares_columns, v, largest)
      call amplitudes_of(factors%harmonic, factors%column, rank, self%patterns, rank, &
                         self%amplitude)
      do h = 1, size(factors%harmonic)
         self%turned(:, h) = matmul(self%dynamic(:, :, h), self%amplitude(:, h))
      end do
      call coefficients_of(factors%harmonic, factors%column, rank, rank, self%turned, &
                           self%patterns)
      call fill_groups(self%n_active, rank, n_inner, n_coefficients, largest, self%scale, v, &
                       self%patterns, shares_columns, self%groups)
      call multiply_panels(self%n_used, n_inner, n_coefficients, self%rows, self%groups, &
                           self%scale*largest, threaded, n_stored, product)
   end subroutine multiply

   !> V^T v, and the largest entry of v. Threads share groups of columns.
   subroutine find_patterns(self, rank, n_columns, threaded, v, largest)
      class(split_product), intent(inout) :: self
      integer, intent(in) :: rank, n_columns
      logical, intent(in) :: threaded
      real(wp), intent(in) :: v(self%n_active, n_columns)
      !> Above zero.
      real(wp), intent(out) :: largest
      integer :: k, n

      largest = tiny(1.0_wp)
      !$omp parallel do default(none) private(k, n) shared(self, rank, n_columns, v) &
      !$omp reduction(max:largest) if(threaded)
      do k = 1, n_columns, group_width
         n = min(group_width, n_columns - k + 1)
         call dgemm('T', 'N', rank, n, self%n_active, 1.0_wp, self%v, self%n_active, v(1, k), &
                    self%n_active, 0.0_wp, self%patterns(1, k), rank)
         largest = max(largest, maxval(abs(v(:, k:k + n - 1))))
      end do
      !$omp end parallel do
   end subroutine find_patterns

   !> [v; S V^T v/sqrt(scale)] over the largest entry of v, in groups of columns.
   subroutine fill_groups(n_active, rank, n_inner, n_columns, largest, scale, v, patterns, &
                          threaded, groups)
      integer, intent(in) :: n_active, rank, n_inner, n_columns
      real(wp), intent(in) :: largest, scale, v(n_active, n_columns), patterns(rank, n_columns)
      logical, intent(in) :: threaded
      real(sp), intent(inout) :: groups(group_width, n_inner, *)
      real(wp) :: factor, of_patterns
      integer :: g, i, k, p

      factor = 1.0_wp/largest
      of_patterns = 1.0_wp/sqrt(scale)
      !$omp parallel do default(none) private(g, i, k, p) if(threaded) &
      !$omp shared(n_active, rank, n_columns, factor, of_patterns, v, patterns, groups)
      do g = 1, group_count(n_columns)
         do p = 1, group_width
            k = (g - 1)*group_width + p
            if (k > n_columns) then
               groups(p, :n_active + rank, g) = 0.0_sp
               cycle
            end if
            do i = 1, n_active
               groups(p, i, g) = real(factor*v(i, k), sp)
            end do
            do i = 1, rank
               groups(p, n_active + i, g) = real(factor*(of_patterns*patterns(i, k)), sp)
            end do
         end do
      end do
      !$omp end parallel do
   end subroutine fill_groups

end module fw_split_product
