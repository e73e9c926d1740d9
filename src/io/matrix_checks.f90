!> Checks of matrices and vectors that come from outside; the first bad entry is named.
module fw_matrix_checks
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_text, only: to_text
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: check_entries, check_matrix, check_skew, check_vector

   !> Entries of a symmetric matrix may differ by this share of the largest one: room for a
   !> matrix written with ten digits or more.
   real(wp), parameter :: symmetry_tolerance = 1.0e-10_wp

contains

   !> A finite symmetric matrix of the right order; made exactly symmetric. `message` says what
   !> is wrong and stays unallocated otherwise.
   subroutine check_matrix(matrix, order, is_mass, message)
      real(wp), intent(inout) :: matrix(:, :)
      integer, intent(in) :: order
      !> A mass matrix has no negative diagonal entry.
      logical, intent(in) :: is_mass
      character(:), allocatable, intent(out) :: message
      integer :: i, j
      real(wp) :: largest

      call check_entries(matrix, order, message)
      if (allocated(message)) return
      largest = maxval(abs(matrix))
      do j = 1, order
         ! Zero is ordinary: massless dofs. Definiteness of the whole is not asked for.
         if (is_mass .and. matrix(j, j) < 0.0_wp) then
            message = 'has the negative diagonal entry '//entry_text(matrix, j, j)// &
                      ': a mass is at least 0'
            return
         end if
         do i = 1, j - 1
            if (abs(matrix(i, j) - matrix(j, i)) > symmetry_tolerance*largest) then
               message = 'is not symmetric: entry '//entry_text(matrix, i, j)//', but entry '// &
                         entry_text(matrix, j, i)//': they must be equal'
               return
            end if
            ! What round-off of writing has left is shared by both.
            matrix(i, j) = 0.5_wp*(matrix(i, j) + matrix(j, i))
            matrix(j, i) = matrix(i, j)
         end do
      end do
   end subroutine check_matrix

   !> A matrix of an order, all of whose entries are finite.
   subroutine check_entries(matrix, order, message)
      real(wp), intent(in) :: matrix(:, :)
      integer, intent(in) :: order
      character(:), allocatable, intent(out) :: message

      if (any(shape(matrix) /= order)) then
         message = 'has the shape '//to_text(size(matrix, 1))//' x '//to_text(size(matrix, 2))// &
                   ': must be '//to_text(order)//' x '//to_text(order)
         return
      end if
      call find_not_finite(matrix, message)
   end subroutine check_entries

   !> A finite matrix with A^T = -A; made exactly so.
   subroutine check_skew(matrix, order, message)
      real(wp), intent(inout) :: matrix(:, :)
      integer, intent(in) :: order
      character(:), allocatable, intent(out) :: message
      integer :: i, j
      real(wp) :: largest

      call check_entries(matrix, order, message)
      if (allocated(message)) return
      largest = maxval(abs(matrix))
      do j = 1, order
         do i = 1, j
            if (abs(matrix(i, j) + matrix(j, i)) > symmetry_tolerance*largest) then
               message = 'is not skew: entry '//entry_text(matrix, i, j)//', but entry '// &
                         entry_text(matrix, j, i)//': one must be the negative of the other'
               return
            end if
            matrix(i, j) = 0.5_wp*(matrix(i, j) - matrix(j, i))
            matrix(j, i) = -matrix(i, j)
         end do
      end do
   end subroutine check_skew

   !> A finite vector of the right size.
   subroutine check_vector(vector, order, message)
      real(wp), intent(in) :: vector(:)
      integer, intent(in) :: order
      character(:), allocatable, intent(out) :: message
      integer :: i

      if (size(vector) /= order) then
         message = 'has '//to_text(size(vector))//' values: must be '//to_text(order)// &
                   ', one per dof'
         return
      end if
      do i = 1, order
         if (ieee_is_finite(vector(i))) cycle
         message = 'has entry ('//to_text(i)//') = '//number_text(vector(i))//': must be finite'
         return
      end do
   end subroutine check_vector

   !> Column by column, as the elements stand in memory.
   subroutine find_not_finite(matrix, message)
      real(wp), intent(in) :: matrix(:, :)
      character(:), allocatable, intent(inout) :: message
      integer :: i, j

      do j = 1, size(matrix, 2)
         do i = 1, size(matrix, 1)
            if (ieee_is_finite(matrix(i, j))) cycle
            message = 'has entry '//entry_text(matrix, i, j)//': must be finite'
            return
         end do
      end do
   end subroutine find_not_finite

   !> `(2,3) = 1.5`, with indices from 1.
   function entry_text(matrix, i, j) result(text)
      real(wp), intent(in) :: matrix(:, :)
      integer, intent(in) :: i, j
      character(:), allocatable :: text

      text = '('//to_text(i)//','//to_text(j)//') = '//number_text(matrix(i, j))
   end function entry_text

end module fw_matrix_checks
