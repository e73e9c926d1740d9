!> The product of a step of an iterative solver: Z_n v ~ K v + V S_n V^T v (fw_dynamic_part), of
!> rows and columns in use. One real matrix in single precision, [K V], serves all harmonics.
module fw_split_product
   use fw_complex_form, only: amplitudes_of
   use fw_complex_form, only: coefficients_of
   use fw_dynamic_part, only: dynamic_part
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_real_products, only: harmonic_factors
   use fw_reduction, only: reduction_type
   use fw_single_product, only: group_count
   use fw_single_product, only: group_width
   use fw_single_product, only: multiply_panels
   use fw_single_product, only: panel_count
   use fw_single_product, only: panel_height
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: split_product

   type :: split_product
      !> S_n (rank, rank, n_retained).
      complex(wp), allocatable :: dynamic(:, :, :)
      !> Rows, and columns among them.
      integer, private :: n_used = 0, n_active = 0
      !> [K V] of the rows in use in panels, V of the columns (n_active, rank).
      real(sp), allocatable, private :: rows(:)
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
      integer :: n_stored

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
      call fill_rows(basis, part, n_active, n_used, used, n_active + part%rank, self%rows)
   end subroutine pack_rows

   pure subroutine fill_rows(basis, part, n_active, n_used, used, n_inner, panels)
      type(reduction_type), intent(in) :: basis
      type(dynamic_part), intent(in) :: part
      integer, intent(in) :: n_active, n_used, n_inner
      integer, intent(in) :: used(:)
      real(sp), intent(inout) :: panels(panel_height, n_inner, *)
      integer :: i, j, p

      ! The last panel may have rows to spare, which stay zero.
      panels(:, :, panel_count(n_used)) = 0.0_sp
      do j = 1, n_active
         do i = 1, n_used
            p = (i - 1)/panel_height
            panels(i - p*panel_height, j, p + 1) = real(basis%blocks(used(i), used(j), 1), sp)
         end do
      end do
      do j = 1, part%rank
         do i = 1, n_used
            p = (i - 1)/panel_height
            panels(i - p*panel_height, n_active + j, p + 1) = real(part%v(used(i), j), sp)
         end do
      end do
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

      n_inner = self%n_active + rank
      if (.not. allocated(self%patterns)) then
         allocate (self%patterns(rank, n_coefficients))
         allocate (self%amplitude(rank, size(factors%harmonic)))
         allocate (self%turned(rank, size(factors%harmonic)))
      end if
      call dgemm('T', 'N', rank, n_coefficients, self%n_active, 1.0_wp, self%v, self%n_active, v, &
                 self%n_active, 0.0_wp, self%patterns, rank)
      call amplitudes_of(factors%harmonic, factors%column, rank, self%patterns, rank, &
                         self%amplitude)
      do h = 1, size(factors%harmonic)
         self%turned(:, h) = matmul(self%dynamic(:, :, h), self%amplitude(:, h))
      end do
      call coefficients_of(factors%harmonic, factors%column, rank, rank, self%turned, &
                           self%patterns)
      ! Single precision ends at 1e38: to the order of one before, in both parts.
      largest = max(maxval(abs(v)), tiny(1.0_wp))
      call fill_groups(self%n_active, rank, n_inner, n_coefficients, largest, v, self%patterns, &
                       self%groups)
      call multiply_panels(self%n_used, n_inner, n_coefficients, self%rows, self%groups, largest, &
                           self%n_used >= coordinates_for_threads, n_stored, product)
   end subroutine multiply

   !> [v; S V^T v] over the largest entry, in groups of columns.
   pure subroutine fill_groups(n_active, rank, n_inner, n_columns, largest, v, patterns, groups)
      integer, intent(in) :: n_active, rank, n_inner, n_columns
      real(wp), intent(in) :: largest, v(n_active, n_columns), patterns(rank, n_columns)
      real(sp), intent(inout) :: groups(group_width, n_inner, *)
      integer :: g, i, k, p

      groups(:, :, group_count(n_columns)) = 0.0_sp
      do k = 1, n_columns
         g = (k - 1)/group_width + 1
         p = k - (g - 1)*group_width
         do i = 1, n_active
            groups(p, i, g) = real(v(i, k)/largest, sp)
         end do
         do i = 1, rank
            groups(p, n_active + i, g) = real(patterns(i, k)/largest, sp)
         end do
      end do
   end subroutine fill_groups

end module fw_split_product
