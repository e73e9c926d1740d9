!> What the signed number of a side stands for: 0 is the ground, 1 .. n_dof are dofs, and numbers
!> beyond are rows of the model, displacements that are combinations of dofs. Negative numbers count
!> the other way. Who has no rows leaves them out.
module fw_side
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_side, largest_weight, terms_of

contains

   !> The dofs that a side is made of, and their weights; none of the ground.
   pure subroutine terms_of(side, dof, weight, rows)
      integer, intent(in) :: side
      integer, allocatable, intent(out) :: dof(:)
      real(wp), allocatable, intent(out) :: weight(:)
      !> Of the model (n_dof, n_rows).
      real(wp), intent(in), optional :: rows(:, :)
      integer :: i, r

      r = 0
      if (present(rows)) r = max(abs(side) - size(rows, 1), 0)
      if (r > 0) then
         dof = pack([(i, i=1, size(rows, 1))], abs(rows(:, r)) > 0.0_wp)
         weight = sign(1, side)*rows(dof, r)
      else if (side /= 0) then
         dof = [abs(side)]
         weight = [real(sign(1, side), wp)]
      else
         allocate (dof(0), weight(0))
      end if
   end subroutine terms_of

   !> Add a side with a factor to a row of all dofs.
   pure subroutine add_side(side, factor, row, rows)
      integer, intent(in) :: side
      real(wp), intent(in) :: factor
      !> (n_dof)
      real(wp), intent(inout) :: row(:)
      real(wp), intent(in), optional :: rows(:, :)
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)

      call terms_of(side, dof, weight, rows)
      row(dof) = row(dof) + factor*weight
   end subroutine add_side

   !> The largest weight of a side, 1 of a dof: what round-off of its sums is measured by.
   pure real(wp) function largest_weight(side, rows) result(largest)
      integer, intent(in) :: side
      real(wp), intent(in), optional :: rows(:, :)
      integer :: r

      r = 0
      if (present(rows)) r = max(abs(side) - size(rows, 1), 0)
      largest = real(min(abs(side), 1), wp)
      if (r > 0) largest = maxval(abs(rows(:, r)))
   end function largest_weight

end module fw_side
