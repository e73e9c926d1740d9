!> Solutions with the LU factors of a complex matrix in single precision, few right-hand sides at a
!> time and many times over. The factors are packed once into panels of rows, in the order in which
!> a solution reads them; BLAS packs them at every call, which takes longer than a solution with a
!> dozen columns.
!>
!> With the diagonal block L_pp of panel p and b_p its part of the right-hand side,
!>
!>   x_p = L_pp^-1 b_p - (L_pp^-1 L_p<) x_<,
!>
!> one product with [-L_pp^-1 L_p<, L_pp^-1], which is what a panel holds. Likewise of U, backwards.
!> Columns do not touch each other: their numbers are the same however threads share them.
module fw_panel_solve
   use fw_column_panels, only: multiply_column, panel_count, panel_height
   use fw_kinds, only: sp
   use fw_lapack, only: ctrsm, strsm
   use omp_lib, only: omp_get_max_threads
   implicit none (type, external)
   private

   public :: panel_factors, group_width

   !> Right-hand sides of a group: products of a panel with them fill the vector registers.
   integer, parameter :: group_width = 4

   type :: panel_factors
      integer, private :: n = 0
      !> Panels of L from the first on, of U from the last on, with real and imaginary parts:
      !> (panel_height, 2, 16), (panel_height, 2, 32), ...; of a real matrix without the latter.
      real(sp), allocatable, private :: lower(:), upper(:)
      !> Where row i of the permuted right-hand side comes from (n).
      integer, allocatable, private :: source(:)
      !> Right-hand sides (group_width, 2, rows, groups).
      real(sp), allocatable, private :: right(:, :, :, :)
      !> One right-hand side (2, rows), and one of a real matrix (rows).
      real(sp), allocatable, private :: single(:, :), column(:)
   contains
      procedure :: pack_factors
      procedure :: pack_real
      procedure :: reserve_groups
      procedure :: solve
      procedure :: solve_groups
      procedure :: solve_real
      procedure :: solve_one
   end type panel_factors

contains

   !> Entries before panel q, of which number r is r panels wide.
   pure integer function entries_before(q)
      integer, intent(in) :: q

      entries_before = panel_height**2*(q*(q - 1)/2)
   end function entries_before

   !> Groups of so many right-hand sides.
   pure integer function group_count(n_columns)
      integer, intent(in) :: n_columns

      group_count = (n_columns + group_width - 1)/group_width
   end function group_count

   !> Copy factors as cgetrf leaves them; none of the pivots is zero.
   subroutine pack_factors(self, n, matrix, pivot)
      class(panel_factors), intent(inout) :: self
      integer, intent(in) :: n
      complex(sp), intent(in) :: matrix(:, :)
      integer, intent(in) :: pivot(:)
      integer :: n_panels, p

      n_panels = panel_count(n)
      call reserve(self, n, 2, pivot)
      !$omp parallel do default(none) private(p) shared(n_panels, n, matrix, self) &
      !$omp schedule(dynamic, 4)
      do p = 1, n_panels
         associate (first => (p - 1)*panel_height + 1, last => min(p*panel_height, n), &
                    q => n_panels - p + 1)
            call pack_lower(n, p, matrix(first:last, :last), p*panel_height, &
                            self%lower(2*entries_before(p) + 1))
            call pack_upper(n, p, matrix(first:last, first:n), q*panel_height, &
                            self%upper(2*entries_before(q) + 1))
         end associate
      end do
      !$omp end parallel do
   end subroutine pack_factors

   !> The same of a real matrix, as sgetrf leaves its factors.
   subroutine pack_real(self, n, matrix, pivot)
      class(panel_factors), intent(inout) :: self
      integer, intent(in) :: n
      real(sp), intent(in) :: matrix(:, :)
      integer, intent(in) :: pivot(:)
      integer :: n_panels, p

      n_panels = panel_count(n)
      call reserve(self, n, 1, pivot)
      if (allocated(self%column)) deallocate (self%column)
      allocate (self%column(n_panels*panel_height))
      !$omp parallel do default(none) private(p) shared(n_panels, n, matrix, self) &
      !$omp schedule(dynamic, 4)
      do p = 1, n_panels
         associate (first => (p - 1)*panel_height + 1, last => min(p*panel_height, n), &
                    q => n_panels - p + 1)
            call pack_real_lower(n, p, matrix(first:last, :last), p*panel_height, &
                                 self%lower(entries_before(p) + 1))
            call pack_real_upper(n, p, matrix(first:last, first:n), q*panel_height, &
                                 self%upper(entries_before(q) + 1))
         end associate
      end do
      !$omp end parallel do
   end subroutine pack_real

   !> Room for the panels, which only grows, and the order of the rows.
   subroutine reserve(self, n, n_parts, pivot)
      type(panel_factors), intent(inout) :: self
      integer, intent(in) :: n, n_parts
      integer, intent(in) :: pivot(:)
      integer :: i, n_entries

      self%n = n
      n_entries = n_parts*entries_before(panel_count(n) + 1)
      if (allocated(self%lower)) then
         if (size(self%lower) < n_entries) deallocate (self%lower, self%upper)
      end if
      if (.not. allocated(self%lower)) allocate (self%lower(n_entries), self%upper(n_entries))
      self%source = [(i, i=1, n)]
      do i = 1, n
         self%source([i, pivot(i)]) = self%source([pivot(i), i])
      end do
   end subroutine reserve

   !> [-L_pp^-1 L_p<, L_pp^-1].
   subroutine pack_lower(n, p, strip, n_inner, panel)
      integer, intent(in) :: n, p, n_inner
      !> Rows of the panel up to the end of its diagonal block.
      complex(sp), intent(in) :: strip(:, :)
      real(sp), intent(inout) :: panel(panel_height, 2, n_inner)
      complex(sp) :: rows(panel_height, n_inner), diagonal(panel_height, panel_height)
      integer :: i, first, n_rows

      first = (p - 1)*panel_height
      n_rows = min(panel_height, n - first)
      rows = (0.0_sp, 0.0_sp)
      rows(:n_rows, :first) = -strip(:, :first)
      do i = 1, n_rows
         rows(i, first + i) = (1.0_sp, 0.0_sp)
      end do
      diagonal(:n_rows, :n_rows) = strip(:, first + 1:)
      call ctrsm('L', 'L', 'N', 'U', n_rows, n_inner, (1.0_sp, 0.0_sp), &
                 diagonal, panel_height, rows, panel_height)
      panel(:, 1, :) = real(rows, sp)
      panel(:, 2, :) = aimag(rows)
   end subroutine pack_lower

   !> [U_pp^-1, -U_pp^-1 U_p>]; rows behind the last one stay zero.
   subroutine pack_upper(n, p, strip, n_inner, panel)
      integer, intent(in) :: n, p, n_inner
      !> Rows of the panel from its diagonal block on.
      complex(sp), intent(in) :: strip(:, :)
      real(sp), intent(inout) :: panel(panel_height, 2, n_inner)
      complex(sp) :: rows(panel_height, n_inner), diagonal(panel_height, panel_height)
      integer :: i, first, n_rows

      first = (p - 1)*panel_height
      n_rows = min(panel_height, n - first)
      rows = (0.0_sp, 0.0_sp)
      rows(:n_rows, panel_height + 1:n - first) = -strip(:, panel_height + 1:)
      do i = 1, n_rows
         rows(i, i) = (1.0_sp, 0.0_sp)
      end do
      diagonal(:n_rows, :n_rows) = strip(:, :n_rows)
      call ctrsm('L', 'U', 'N', 'N', n_rows, n_inner, (1.0_sp, 0.0_sp), &
                 diagonal, panel_height, rows, panel_height)
      panel(:, 1, :) = real(rows, sp)
      panel(:, 2, :) = aimag(rows)
   end subroutine pack_upper

   !> The same of real strips, where they stay.
   subroutine pack_real_lower(n, p, strip, n_inner, panel)
      integer, intent(in) :: n, p, n_inner
      real(sp), intent(in) :: strip(:, :)
      real(sp), intent(inout) :: panel(panel_height, n_inner)
      real(sp) :: diagonal(panel_height, panel_height)
      integer :: i, first, n_rows

      first = (p - 1)*panel_height
      n_rows = min(panel_height, n - first)
      panel(n_rows + 1:, :) = 0.0_sp
      panel(:n_rows, :first) = -strip(:, :first)
      panel(:, first + 1:) = 0.0_sp
      do i = 1, n_rows
         panel(i, first + i) = 1.0_sp
      end do
      diagonal(:n_rows, :n_rows) = strip(:, first + 1:)
      call strsm('L', 'L', 'N', 'U', n_rows, n_inner, 1.0_sp, diagonal, panel_height, panel, &
                 panel_height)
   end subroutine pack_real_lower

   subroutine pack_real_upper(n, p, strip, n_inner, panel)
      integer, intent(in) :: n, p, n_inner
      real(sp), intent(in) :: strip(:, :)
      real(sp), intent(inout) :: panel(panel_height, n_inner)
      real(sp) :: diagonal(panel_height, panel_height)
      integer :: i, first, n_rows

      first = (p - 1)*panel_height
      n_rows = min(panel_height, n - first)
      panel = 0.0_sp
      panel(:n_rows, panel_height + 1:n - first) = -strip(:, panel_height + 1:)
      do i = 1, n_rows
         panel(i, i) = 1.0_sp
      end do
      diagonal(:n_rows, :n_rows) = strip(:, :n_rows)
      call strsm('L', 'U', 'N', 'N', n_rows, n_inner, 1.0_sp, diagonal, panel_height, panel, &
                 panel_height)
   end subroutine pack_real_upper

   !> Room for so many right-hand sides at once.
   subroutine reserve_groups(self, n_columns)
      class(panel_factors), intent(inout) :: self
      integer, intent(in) :: n_columns
      integer :: n_rows

      n_rows = panel_count(self%n)*panel_height
      if (allocated(self%right)) then
         if (size(self%right, 4) < group_count(n_columns) .or. size(self%right, 3) /= n_rows) then
            deallocate (self%right)
         end if
      end if
      if (.not. allocated(self%right)) then
         allocate (self%right(group_width, 2, n_rows, group_count(n_columns)))
      end if
   end subroutine reserve_groups

   !> Solve in place (n, n_columns).
   subroutine solve(self, n_columns, b)
      class(panel_factors), intent(inout) :: self
      integer, intent(in) :: n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)
      integer :: n_groups, n_shares, share

      n_groups = group_count(n_columns)
      call self%reserve_groups(n_columns)
      n_shares = min(n_groups, omp_get_max_threads())
      !$omp parallel do default(none) private(share) if(n_shares > 1) &
      !$omp shared(self, n_groups, n_shares, n_columns, b)
      do share = 1, n_shares
         call self%solve_groups((share - 1)*n_groups/n_shares + 1, share*n_groups/n_shares, &
                                n_columns, b)
      end do
      !$omp end parallel do
   end subroutine solve

   !> Solve in place for one right-hand side (n).
   subroutine solve_one(self, b)
      class(panel_factors), intent(inout) :: self
      complex(sp), intent(inout) :: b(:)
      real(sp) :: tile(panel_height, 2)
      integer :: first, n_panels, p, q

      n_panels = panel_count(self%n)
      if (allocated(self%single)) then
         if (size(self%single, 2) /= n_panels*panel_height) deallocate (self%single)
      end if
      if (.not. allocated(self%single)) allocate (self%single(2, n_panels*panel_height))
      self%single(1, :self%n) = real(b(self%source), sp)
      self%single(2, :self%n) = aimag(b(self%source))
      self%single(:, self%n + 1:) = 0.0_sp
      do p = 1, n_panels
         first = (p - 1)*panel_height
         call multiply_column(p*panel_height, self%lower(2*entries_before(p) + 1), &
                              self%single, tile)
         self%single(:, first + 1:first + panel_height) = transpose(tile)
      end do
      do p = n_panels, 1, -1
         first = (p - 1)*panel_height
         q = n_panels - p + 1
         call multiply_column(q*panel_height, self%upper(2*entries_before(q) + 1), &
                              self%single(1, first + 1), tile)
         self%single(:, first + 1:first + panel_height) = transpose(tile)
      end do
      b = cmplx(self%single(1, :self%n), self%single(2, :self%n), sp)
   end subroutine solve_one

   !> A run of groups, each panel with all of them: it comes from memory once. Several threads may
   !> do it at the same time, each with groups of its own.
   subroutine solve_groups(self, g_first, g_last, n_columns, b)
      class(panel_factors), intent(inout) :: self
      integer, intent(in) :: g_first, g_last, n_columns
      complex(sp), intent(inout), contiguous :: b(:, :)
      integer :: first, g, k, n_panels, p, q

      n_panels = panel_count(self%n)
      do g = g_first, g_last
         k = (g - 1)*group_width
         call take_columns(self%source, b(:, k + 1:min(k + group_width, n_columns)), &
                           self%right(:, :, :, g))
      end do
      do p = 1, n_panels
         first = (p - 1)*panel_height + 1
         do g = g_first, g_last
            call replace_rows(p*panel_height, self%lower(2*entries_before(p) + 1), &
                              1, first, self%right(:, :, :, g))
         end do
      end do
      do p = n_panels, 1, -1
         first = (p - 1)*panel_height + 1
         q = n_panels - p + 1
         do g = g_first, g_last
            call replace_rows(q*panel_height, self%upper(2*entries_before(q) + 1), &
                              first, first, self%right(:, :, :, g))
         end do
      end do
      do g = g_first, g_last
         k = (g - 1)*group_width
         call give_columns(self%right(:, :, :, g), b(:, k + 1:min(k + group_width, n_columns)))
      end do
   end subroutine solve_groups

   !> Solve in place with the factors of a real matrix (n).
   subroutine solve_real(self, b)
      class(panel_factors), intent(inout) :: self
      real(sp), intent(inout) :: b(:)
      real(sp) :: tile(panel_height)
      integer :: first, n_panels, p, q

      n_panels = panel_count(self%n)
      associate (x => self%column)
         x(:self%n) = b(self%source)
         x(self%n + 1:) = 0.0_sp
         do p = 1, n_panels
            first = (p - 1)*panel_height
            call multiply_real_column(p*panel_height, self%lower(entries_before(p) + 1), x, tile)
            x(first + 1:first + panel_height) = tile
         end do
         do p = n_panels, 1, -1
            first = (p - 1)*panel_height
            q = n_panels - p + 1
            call multiply_real_column(q*panel_height, self%upper(entries_before(q) + 1), &
                                 x(first + 1), tile)
            x(first + 1:first + panel_height) = tile
         end do
         b = x(:self%n)
      end associate
   end subroutine solve_real

   !> One real panel times one column: four sums, for each has to wait for its last term.
   pure subroutine multiply_real_column(n_inner, panel, x, tile)
      integer, intent(in) :: n_inner
      real(sp), intent(in) :: panel(panel_height, n_inner), x(n_inner)
      real(sp), intent(out) :: tile(panel_height)
      real(sp) :: sums(panel_height, 4)
      integer :: i, j

      sums = 0.0_sp
      ! Panels are a multiple of four wide.
      do j = 1, n_inner, 4
         !$omp simd
         do i = 1, panel_height
            sums(i, 1) = sums(i, 1) + panel(i, j)*x(j)
            sums(i, 2) = sums(i, 2) + panel(i, j + 1)*x(j + 1)
            sums(i, 3) = sums(i, 3) + panel(i, j + 2)*x(j + 2)
            sums(i, 4) = sums(i, 4) + panel(i, j + 3)*x(j + 3)
         end do
      end do
      tile = (sums(:, 1) + sums(:, 2)) + (sums(:, 3) + sums(:, 4))
   end subroutine multiply_real_column

   !> Right-hand sides, permuted, into a group; zeros fill it up.
   pure subroutine take_columns(source, b, right)
      integer, intent(in) :: source(:)
      complex(sp), intent(in) :: b(:, :)
      real(sp), intent(out) :: right(:, :, :)
      integer :: i, k

      right = 0.0_sp
      do k = 1, size(b, 2)
         do i = 1, size(b, 1)
            right(k, 1, i) = real(b(source(i), k), sp)
            right(k, 2, i) = aimag(b(source(i), k))
         end do
      end do
   end subroutine take_columns

   pure subroutine give_columns(right, b)
      real(sp), intent(in) :: right(:, :, :)
      complex(sp), intent(inout) :: b(:, :)
      integer :: k

      do k = 1, size(b, 2)
         b(:, k) = cmplx(right(k, 1, :size(b, 1)), right(k, 2, :size(b, 1)), sp)
      end do
   end subroutine give_columns

   !> Replace the rows of one panel by its product with the rows from `first` on.
   pure subroutine replace_rows(n_inner, panel, first, row, right)
      integer, intent(in) :: n_inner, first
      real(sp), intent(in) :: panel(panel_height, 2, n_inner)
      !> First row of the panel.
      integer, intent(in) :: row
      real(sp), intent(inout) :: right(group_width, 2, *)
      real(sp) :: tile(panel_height, group_width, 2)
      integer :: i

      call multiply_tile(n_inner, panel, right(1, 1, first), tile)
      do i = 1, panel_height
         right(:, :, row + i - 1) = tile(i, :, :)
      end do
   end subroutine replace_rows

   !> One panel times one group; its sums stay in registers.
   pure subroutine multiply_tile(n_inner, panel, right, tile)
      integer, intent(in) :: n_inner
      real(sp), intent(in) :: panel(panel_height, 2, n_inner), right(group_width, 2, n_inner)
      real(sp), intent(out) :: tile(panel_height, group_width, 2)
      real(sp), dimension(panel_height, group_width) :: re, im
      integer :: i, j

      re = 0.0_sp
      im = 0.0_sp
      do j = 1, n_inner
         ! Column by column of the group by hand: gfortran keeps these sums in registers.
         !$omp simd
         do i = 1, panel_height
            re(i, 1) = re(i, 1) + panel(i, 1, j)*right(1, 1, j) - panel(i, 2, j)*right(1, 2, j)
            im(i, 1) = im(i, 1) + panel(i, 1, j)*right(1, 2, j) + panel(i, 2, j)*right(1, 1, j)
            re(i, 2) = re(i, 2) + panel(i, 1, j)*right(2, 1, j) - panel(i, 2, j)*right(2, 2, j)
            im(i, 2) = im(i, 2) + panel(i, 1, j)*right(2, 2, j) + panel(i, 2, j)*right(2, 1, j)
            re(i, 3) = re(i, 3) + panel(i, 1, j)*right(3, 1, j) - panel(i, 2, j)*right(3, 2, j)
            im(i, 3) = im(i, 3) + panel(i, 1, j)*right(3, 2, j) + panel(i, 2, j)*right(3, 1, j)
            re(i, 4) = re(i, 4) + panel(i, 1, j)*right(4, 1, j) - panel(i, 2, j)*right(4, 2, j)
            im(i, 4) = im(i, 4) + panel(i, 1, j)*right(4, 2, j) + panel(i, 2, j)*right(4, 1, j)
         end do
      end do
      tile(:, :, 1) = re
      tile(:, :, 2) = im
   end subroutine multiply_tile

end module fw_panel_solve
