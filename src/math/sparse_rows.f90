!> Products with a matrix most of whose rows have few entries: a change of variables that takes
!> most dofs as they are, and a few as combinations of all. A product of order n then costs n**2
!> operations for each of those few, in place of n**3.
module fw_sparse_rows
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: sparse_rows, new_sparse_rows, few_entries

   !> Entries up to which a row is multiplied entry by entry: a relative displacement has two.
   integer, parameter :: few_entries = 4

   !> A matrix T (n_rows, n_columns).
   type :: sparse_rows
      private
      integer :: n_rows = 0, n_columns = 0
      !> What is not zero of the rows with few entries: where it stands, and its value.
      integer, allocatable :: row(:), column(:)
      real(wp), allocatable :: entry(:)
      !> The other rows: their numbers, and themselves (n_full, n_columns).
      integer, allocatable :: full(:)
      real(wp), allocatable :: full_rows(:, :)
   contains
      procedure :: times_left
      procedure :: times_transposed
   end type sparse_rows

contains

   !> Sort the rows of T.
   function new_sparse_rows(t) result(self)
      real(wp), intent(in) :: t(:, :)
      type(sparse_rows) :: self
      integer :: count_of(size(t, 1))
      integer :: i, j, k

      self%n_rows = size(t, 1)
      self%n_columns = size(t, 2)
      count_of = 0
      do j = 1, self%n_columns
         do i = 1, self%n_rows
            if (abs(t(i, j)) > 0.0_wp) count_of(i) = count_of(i) + 1
         end do
      end do
      self%full = pack([(i, i=1, self%n_rows)], count_of > few_entries)
      self%full_rows = t(self%full, :)
      k = sum(count_of, mask=count_of <= few_entries)
      allocate (self%row(k), self%column(k), self%entry(k))
      k = 0
      do j = 1, self%n_columns
         do i = 1, self%n_rows
            if (count_of(i) > few_entries .or. .not. abs(t(i, j)) > 0.0_wp) cycle
            k = k + 1
            self%row(k) = i
            self%column(k) = j
            self%entry(k) = t(i, j)
         end do
      end do
   end function new_sparse_rows

   !> a T.
   function times_left(self, a) result(product)
      class(sparse_rows), intent(in) :: self
      !> (n, n_rows)
      real(wp), intent(in) :: a(:, :)
      !> (n, n_columns)
      real(wp), allocatable :: product(:, :)
      real(wp), allocatable :: columns(:, :)
      integer :: k

      allocate (product(size(a, 1), self%n_columns), source=0.0_wp)
      if (size(product) == 0) return
      if (size(self%full) > 0) then
         columns = a(:, self%full)
         call dgemm('N', 'N', size(a, 1), self%n_columns, size(self%full), 1.0_wp, columns, &
                    size(a, 1), self%full_rows, size(self%full), 0.0_wp, product, size(a, 1))
      end if
      do k = 1, size(self%entry)
         product(:, self%column(k)) = product(:, self%column(k)) + self%entry(k)*a(:, self%row(k))
      end do
   end function times_left

   !> T^T b.
   function times_transposed(self, b) result(product)
      class(sparse_rows), intent(in) :: self
      !> (n_rows, n)
      real(wp), intent(in) :: b(:, :)
      !> (n_columns, n)
      real(wp), allocatable :: product(:, :)
      real(wp), allocatable :: rows(:, :)
      integer :: j, k

      allocate (product(self%n_columns, size(b, 2)), source=0.0_wp)
      if (size(product) == 0) return
      if (size(self%full) > 0) then
         rows = b(self%full, :)
         call dgemm('T', 'N', self%n_columns, size(b, 2), size(self%full), 1.0_wp, &
                    self%full_rows, size(self%full), rows, size(self%full), 0.0_wp, product, &
                    self%n_columns)
      end if
      do j = 1, size(b, 2)
         do k = 1, size(self%entry)
            product(self%column(k), j) = product(self%column(k), j) + &
                                         self%entry(k)*b(self%row(k), j)
         end do
      end do
   end function times_transposed

end module fw_sparse_rows
