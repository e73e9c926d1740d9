!> Relative coordinates: rows u(side_1) - u(side_2) of dofs and rows of the model, reduced to an
!> independent set q, and the change of variables u = T (q, eta) that carries it.
!>
!> Gauss-Jordan elimination keeps C and R with  u(pivot) = C q - R eta,  u(free) = eta, where the
!> pivots are one dof a coordinate. Rows that depend on earlier ones (a chain whose masses rub
!> both each other and the ground) become combinations of the coordinates.
module fw_relative
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_side, only: add_side, largest_weight
   implicit none (type, external)
   private

   public :: relative_type, new_relative

   !> Relative displacements of pairs and springs, as rows of a model.
   type :: relative_type
      integer :: n_dof = 0
      !> Rows given, and independent coordinates among them.
      integer :: n_rows = 0
      integer :: n_coordinates = 0
      !> Row r is sum_e row_weight(e) q(row_coordinate(e)), e = row_start(r) .. row_start(r+1)-1.
      integer, allocatable :: row_start(:), row_coordinate(:)
      real(wp), allocatable :: row_weight(:)
      !> In place of row_weight where weights differ from harmonic to harmonic (entries,
      !> n_retained).
      complex(wp), allocatable :: turned(:, :)
      !> Dofs that are eliminated (n_coordinates) and the others.
      integer, allocatable :: pivot(:), free(:)
      !> u(pivot) = c q - r eta  (n_coordinates, n_coordinates) and (n_coordinates, n_free).
      real(wp), allocatable :: c(:, :), r(:, :)
      !> Whether a row introduced a coordinate, or depends on earlier rows (n_rows).
      logical, allocatable :: independent(:)
   contains
      procedure :: rows => rows_of_dofs
   end type relative_type

   !> Entries below this are round-off of the elimination, which adds and subtracts +-1; of rows of
   !> a model beside their largest weight.
   real(wp), parameter :: negligible = 1.0e-10_wp

contains

   !> Build the coordinates of the given rows; a row with both sides 0 is refused by the caller.
   subroutine new_relative(n_dof, side_1, side_2, self, rows)
      integer, intent(in) :: n_dof
      !> Signed numbers of dofs and rows, 0 for ground (n_rows).
      integer, intent(in) :: side_1(:), side_2(:)
      type(relative_type), intent(out) :: self
      !> Rows of the model, as in fw_side.
      real(wp), intent(in), optional :: rows(:, :)
      real(wp), allocatable :: echelon(:, :), row(:), combination(:)
      real(wp) :: scale(size(side_1))
      integer :: r, m, n_rows, most

      n_rows = size(side_1)
      self%n_dof = n_dof
      self%n_rows = n_rows
      most = min(n_rows, n_dof) ! rows that can be independent
      allocate (echelon(most, n_dof), source=0.0_wp)
      allocate (self%c(most, most), source=0.0_wp)
      allocate (self%pivot(most), self%row_start(n_rows + 1), row(n_dof), combination(most))
      allocate (self%row_coordinate(0), self%row_weight(0), self%independent(n_rows))
      scale = [(max(largest_weight(side_1(r), rows), largest_weight(side_2(r), rows)), &
                r=1, n_rows)]
      m = 0
      self%row_start(1) = 1
      do r = 1, n_rows
         row = 0.0_wp
         call add_side(side_1(r), 1.0_wp, row, rows)
         call add_side(side_2(r), -1.0_wp, row, rows)
         call reduce(self, m, echelon, row, combination)
         self%independent(r) = maxval(abs(row)) > negligible*scale(r)
         if (self%independent(r)) then
            call append(self, m, echelon, row, combination)
            self%row_coordinate = [self%row_coordinate, m]
            self%row_weight = [self%row_weight, 1.0_wp]
         else
            call express(self, m, combination, negligible*scale(r)/maxval(scale))
         end if
         self%row_start(r + 1) = size(self%row_coordinate) + 1
      end do
      call finish(self, m, echelon)
   end subroutine new_relative

   !> Subtract the echelon rows from a row; `combination` holds what was subtracted.
   subroutine reduce(self, m, echelon, row, combination)
      type(relative_type), intent(in) :: self
      integer, intent(in) :: m
      real(wp), intent(in) :: echelon(:, :)
      real(wp), intent(inout) :: row(:)
      real(wp), intent(out) :: combination(:)
      integer :: i

      combination = 0.0_wp
      do i = 1, m
         combination(i) = row(self%pivot(i))
      end do
      do i = 1, m
         if (abs(combination(i)) > 0.0_wp) row = row - combination(i)*echelon(i, :)
      end do
   end subroutine reduce

   !> Make an independent row the next echelon row and clear its pivot column above.
   subroutine append(self, m, echelon, row, combination)
      type(relative_type), intent(inout) :: self
      integer, intent(inout) :: m
      real(wp), intent(inout) :: echelon(:, :)
      real(wp), intent(in) :: row(:), combination(:)
      integer :: i, column
      real(wp) :: scale, factor

      column = maxloc(abs(row), dim=1)
      scale = 1.0_wp/row(column)
      echelon(m + 1, :) = scale*row
      do i = 1, m
         if (abs(combination(i)) > 0.0_wp) then
            self%c(m + 1, :m) = self%c(m + 1, :m) - scale*combination(i)*self%c(i, :m)
         end if
      end do
      m = m + 1
      self%c(m, m) = scale
      self%pivot(m) = column
      do i = 1, m - 1
         factor = echelon(i, column)
         if (abs(factor) <= 0.0_wp) cycle
         echelon(i, :) = echelon(i, :) - factor*echelon(m, :)
         self%c(i, :m) = self%c(i, :m) - factor*self%c(m, :m)
      end do
   end subroutine append

   !> Write a dependent row as a combination of the coordinates.
   subroutine express(self, m, combination, least)
      type(relative_type), intent(inout) :: self
      integer, intent(in) :: m
      real(wp), intent(in) :: combination(:)
      !> Weights up to this are round-off.
      real(wp), intent(in) :: least
      real(wp) :: weight
      integer :: j

      do j = 1, m
         weight = dot_product(combination(:m), self%c(:m, j))
         if (abs(weight) <= least) cycle
         self%row_coordinate = [self%row_coordinate, j]
         self%row_weight = [self%row_weight, weight]
      end do
   end subroutine express

   !> Echelon form as dofs that follow (pivots) and dofs that are free, u_p = c q - r u_f.
   subroutine finish(self, m, echelon)
      type(relative_type), intent(inout) :: self
      integer, intent(in) :: m
      real(wp), intent(in) :: echelon(:, :)
      logical, allocatable :: is_free(:)
      integer :: i

      self%n_coordinates = m
      self%pivot = self%pivot(:m)
      self%c = self%c(:m, :m)
      allocate (is_free(self%n_dof), source=.true.)
      is_free(self%pivot) = .false.
      self%free = pack([(i, i=1, self%n_dof)], is_free)
      self%r = echelon(:m, self%free)
   end subroutine finish

   !> The coordinates as combinations of the dofs, q = rows u (n_coordinates, n_dof).
   subroutine rows_of_dofs(self, rows)
      class(relative_type), intent(in) :: self
      real(wp), allocatable, intent(out) :: rows(:, :)
      type(lu_type) :: lu
      logical :: singular
      integer :: i, j

      allocate (rows(self%n_coordinates, self%n_dof), source=0.0_wp)
      if (self%n_coordinates == 0) return
      do i = 1, self%n_coordinates
         rows(i, self%pivot(i)) = 1.0_wp
      end do
      rows(:, self%free) = self%r
      call lu%reserve(self%n_coordinates)
      lu%matrix = self%c
      ! Regular: the rows are independent.
      call lu%factor(singular)
      do j = 1, self%n_dof
         if (maxval(abs(rows(:, j))) > 0.0_wp) call lu%solve(rows(:, j))
      end do
   end subroutine rows_of_dofs

end module fw_relative
