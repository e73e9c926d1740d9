!> What one sector has beside the others: matrices of each sector on rows that all of them share,
!>
!>   dK_j = B^T K_j B,   dM_j = B^T M_j B,   dC_j = B^T C_j B,   j = 0 .. N - 1,
!>
!> with few rows B, whatever the deviation was given by. A further kind of deviation is one more
!> call of `add`.
module fw_deviation
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: deviation_type, stiffness_part, mass_part, damping_part

   !> Which matrix of a sector.
   integer, parameter :: stiffness_part = 1, mass_part = 2, damping_part = 3

   type :: deviation_type
      !> B (r, n_dof).
      real(wp), allocatable :: rows(:, :)
      !> K_j, M_j and C_j (r, r, n_sectors, 3).
      real(wp), allocatable :: part(:, :, :, :)
   contains
      procedure :: start
      procedure :: add_rows
      procedure :: add_range
      procedure :: settle
      procedure :: add_to
   end type deviation_type

   !> Parts of a row, and of a matrix, that are round-off.
   real(wp), parameter :: dependent = 1.0e-10_wp, round_off = 1.0e-13_wp

contains

   pure subroutine start(self, n_dof)
      class(deviation_type), intent(inout) :: self
      !> Of a sector.
      integer, intent(in) :: n_dof

      if (allocated(self%rows)) deallocate (self%rows)
      allocate (self%rows(0, n_dof))
   end subroutine start

   !> Rows that deviations act on.
   pure subroutine add_rows(self, rows)
      class(deviation_type), intent(inout) :: self
      !> (n_rows, n_dof)
      real(wp), intent(in) :: rows(:, :)
      real(wp) :: row(size(rows, 2)), size_of_row
      integer :: i

      do i = 1, size(rows, 1)
         row = rows(i, :)
         size_of_row = norm2(row)
         if (size_of_row <= 0.0_wp) cycle
         call append(self, row, dependent*size_of_row)
      end do
   end subroutine add_rows

   !> What is left of a row beside those that there are, made a row where it is no round-off.
   pure subroutine append(self, row, limit)
      class(deviation_type), intent(inout) :: self
      !> (n_dof)
      real(wp), intent(inout) :: row(:)
      !> Length up to which what is left is round-off.
      real(wp), intent(in) :: limit
      real(wp), allocatable :: longer(:, :)
      integer :: pass, r

      r = size(self%rows, 1)
      ! Twice is enough.
      do pass = 1, 2
         row = row - matmul(matmul(self%rows, row), self%rows)
      end do
      if (norm2(row) <= limit) return
      allocate (longer(r + 1, size(row)))
      longer(:r, :) = self%rows
      longer(r + 1, :) = row/norm2(row)
      call move_alloc(longer, self%rows)
   end subroutine append

   !> Rows that a symmetric matrix acts on.
   pure subroutine add_range(self, matrix, size_of_tuned)
      class(deviation_type), intent(inout) :: self
      !> Symmetric (n_dof, n_dof).
      real(wp), intent(in) :: matrix(:, :)
      !> Of the matrices whose difference it is; 0 of one that was given.
      real(wp), intent(in) :: size_of_tuned
      real(wp), allocatable :: left(:, :)
      real(wp) :: limit, squares(size(matrix, 2)), row(size(matrix, 2))
      integer :: j, r

      limit = max(round_off*sqrt(maxval(sum(matrix**2, dim=1))), &
                  4.0_wp*epsilon(1.0_wp)*size_of_tuned)
      left = matrix - matmul(transpose(self%rows), matmul(self%rows, matrix))
      do
         squares = sum(left**2, dim=1)
         j = maxloc(squares, dim=1)
         if (sqrt(squares(j)) <= limit) exit
         r = size(self%rows, 1)
         row = left(:, j)
         call append(self, row, 0.5_wp*limit)
         if (size(self%rows, 1) == r) then
            left(:, j) = 0.0_wp
            cycle
         end if
         row = self%rows(r + 1, :)
         call deflate(row, left)
      end do
   end subroutine add_range

   !> Take off what acts on a row.
   pure subroutine deflate(row, left)
      !> Of unit length (n_dof).
      real(wp), intent(in) :: row(:)
      !> The matrix, without what acts on rows that there are (n_dof, n_dof).
      real(wp), intent(inout) :: left(:, :)
      real(wp) :: along(size(left, 2))
      integer :: j

      along = matmul(row, left)
      do j = 1, size(left, 2)
         left(:, j) = left(:, j) - along(j)*row
      end do
   end subroutine deflate

   !> All rows are there: those of single dofs where they say as much. Nothing deviates yet.
   pure subroutine settle(self, n_sectors)
      class(deviation_type), intent(inout) :: self
      !> N.
      integer, intent(in) :: n_sectors
      integer, allocatable :: touched(:)
      integer :: i, n

      n = size(self%rows, 2)
      touched = pack([(i, i=1, n)], any(abs(self%rows) > 0.0_wp, dim=1))
      if (size(touched) <= size(self%rows, 1)) then
         deallocate (self%rows)
         allocate (self%rows(size(touched), n), source=0.0_wp)
         do i = 1, size(touched)
            self%rows(i, touched(i)) = 1.0_wp
         end do
      end if
      n = size(self%rows, 1)
      if (allocated(self%part)) deallocate (self%part)
      allocate (self%part(n, n, n_sectors, 3), source=0.0_wp)
   end subroutine settle

   !> A matrix on its own rows V of a sector: V^T diag(d) V, or the whole matrix; V lies in the rows
   !> that there are.
   pure subroutine add_to(self, part, sector, rows, weight, matrix)
      class(deviation_type), intent(inout) :: self
      !> stiffness_part, mass_part or damping_part, and the sector from 0.
      integer, intent(in) :: part, sector
      real(wp), intent(in), optional :: rows(:, :), weight(:), matrix(:, :)
      real(wp), allocatable :: along(:, :)
      integer :: a

      associate (own => self%part(:, :, sector + 1, part))
         if (present(matrix)) own = own + matmul(self%rows, matmul(matrix, transpose(self%rows)))
         if (.not. present(rows)) return
         along = matmul(self%rows, transpose(rows))
         do a = 1, size(weight)
            own = own + weight(a)*spread(along(:, a), 2, size(own, 2))* &
                  spread(along(:, a), 1, size(own, 1))
         end do
      end associate
   end subroutine add_to

end module fw_deviation
