!> Relative coordinates of a sector in a nodal diameter: the rows that are independent there, and
!> the change of variables u = T (q, eta) that carries them, as fw_relative has it for real rows:
!> u(pivot) = c q - r eta, u(free) = eta.
module fw_sector_relative
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: sector_relative, new_sector_relative, held_basis

   type :: sector_relative
      !> Rows that are coordinates, in their order (n_coordinates).
      integer, allocatable :: row(:)
      !> Every row as a combination of the coordinates (n_rows, n_coordinates).
      complex(wp), allocatable :: weight(:, :)
      integer, allocatable :: pivot(:), free(:)
      !> (n_coordinates, n_coordinates) and (n_coordinates, n_free).
      complex(wp), allocatable :: c(:, :), r(:, :)
   end type sector_relative

   !> Entries below this are round-off of the elimination of rows with factors of magnitude one, and
   !> of others beside their largest.
   real(wp), parameter :: negligible = 1.0e-10_wp

contains

   !> Gauss-Jordan elimination of the rows in their order.
   subroutine new_sector_relative(rows, self, largest)
      !> (n_rows, n).
      complex(wp), intent(in) :: rows(:, :)
      type(sector_relative), intent(out) :: self
      !> The largest factors of their sides (n_rows), 1 without it.
      real(wp), intent(in), optional :: largest(:)
      real(wp) :: scale(size(rows, 1))
      complex(wp), allocatable :: echelon(:, :), row(:), combination(:)
      integer :: i, m, r, most

      scale = 1.0_wp
      if (present(largest)) scale = largest
      most = min(size(rows, 1), size(rows, 2))
      allocate (echelon(most, size(rows, 2)), self%c(most, most), source=(0.0_wp, 0.0_wp))
      allocate (self%weight(size(rows, 1), most), source=(0.0_wp, 0.0_wp))
      allocate (self%pivot(most), self%row(most), combination(most))
      m = 0
      do r = 1, size(rows, 1)
         row = rows(r, :)
         combination = (0.0_wp, 0.0_wp)
         do i = 1, m
            combination(i) = row(self%pivot(i))
         end do
         do i = 1, m
            if (abs(combination(i)) > 0.0_wp) row = row - combination(i)*echelon(i, :)
         end do
         if (maxval(abs(row)) > negligible*scale(r)) then
            call append(self, m, echelon, row, combination)
            self%row(m) = r
            self%weight(r, m) = (1.0_wp, 0.0_wp)
         else
            self%weight(r, :m) = matmul(combination(:m), self%c(:m, :m))
            where (abs(self%weight(r, :)) <= negligible*scale(r)/maxval(scale))
               self%weight(r, :) = (0.0_wp, 0.0_wp)
            end where
         end if
      end do
      call finish(self, m, echelon)
   end subroutine new_sector_relative

   !> Make an independent row the next echelon row and clear its pivot column above.
   subroutine append(self, m, echelon, row, combination)
      type(sector_relative), intent(inout) :: self
      integer, intent(inout) :: m
      complex(wp), intent(inout) :: echelon(:, :)
      complex(wp), intent(in) :: row(:), combination(:)
      complex(wp) :: scale, entry
      integer :: i, column

      column = maxloc(abs(row), dim=1)
      scale = 1.0_wp/row(column)
      echelon(m + 1, :) = scale*row
      self%c(m + 1, :m) = -scale*matmul(combination(:m), self%c(:m, :m))
      m = m + 1
      self%c(m, m) = scale
      self%pivot(m) = column
      do i = 1, m - 1
         entry = echelon(i, column)
         if (abs(entry) <= 0.0_wp) cycle
         echelon(i, :) = echelon(i, :) - entry*echelon(m, :)
         self%c(i, :m) = self%c(i, :m) - entry*self%c(m, :m)
      end do
   end subroutine append

   !> The same of complex rows: turned dofs of other sectors are one dof of this one.
   subroutine finish(self, m, echelon)
      type(sector_relative), intent(inout) :: self
      integer, intent(in) :: m
      complex(wp), intent(in) :: echelon(:, :)
      logical :: is_free(size(echelon, 2))
      integer :: i

      self%row = self%row(:m)
      self%pivot = self%pivot(:m)
      self%c = self%c(:m, :m)
      self%weight = self%weight(:, :m)
      is_free = .true.
      is_free(self%pivot) = .false.
      self%free = pack([(i, i=1, size(is_free))], is_free)
      self%r = echelon(:m, self%free)
   end subroutine finish

   !> Motions in which no held row moves.
   pure subroutine held_basis(relative, n, basis)
      type(sector_relative), intent(in) :: relative
      integer, intent(in) :: n
      complex(wp), allocatable, intent(out) :: basis(:, :)
      integer :: j, n_free, n_rows

      n_free = size(relative%free)
      n_rows = n_free + size(relative%pivot)
      allocate (basis(n, n - size(relative%pivot)), source=(0.0_wp, 0.0_wp))
      basis(relative%pivot, :n_free) = -relative%r
      do j = 1, n_free
         basis(relative%free(j), j) = (1.0_wp, 0.0_wp)
      end do
      do j = 1, n - n_rows
         basis(n_rows + j, n_free + j) = (1.0_wp, 0.0_wp)
      end do
   end subroutine held_basis

end module fw_sector_relative
