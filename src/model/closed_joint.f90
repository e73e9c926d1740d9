!> A joint that is closed: relative displacements that springs join, or that do not move at all.
!> Structures are what has rows of them (fw_sector).
module fw_closed_joint
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: closed_joint

   !> Rows of one sector, of which all others have the same.
   type :: closed_joint
      !> Signed dofs and rows of the model, 0 for the ground, and the sector of the second (n_rows).
      integer, allocatable :: side_1(:), side_2(:), sector_2(:)
      !> Springs [force/length], and rows that do not move, which have none (n_rows).
      real(wp), allocatable :: stiffness(:)
      logical, allocatable :: is_held(:)
   contains
      procedure :: n_rows
      procedure :: add_row
   end type closed_joint

contains

   pure integer function n_rows(self)
      class(closed_joint), intent(in) :: self

      n_rows = 0
      if (allocated(self%stiffness)) n_rows = size(self%stiffness)
   end function n_rows

   !> A spring, or a row that is held where no stiffness is given.
   pure subroutine add_row(self, side_1, side_2, sector_2, stiffness)
      class(closed_joint), intent(inout) :: self
      integer, intent(in) :: side_1, side_2, sector_2
      !> [force/length]
      real(wp), intent(in), optional :: stiffness
      real(wp) :: spring

      spring = 0.0_wp
      if (present(stiffness)) spring = stiffness
      if (.not. allocated(self%stiffness)) then
         self%side_1 = [side_1]
         self%side_2 = [side_2]
         self%sector_2 = [sector_2]
         self%stiffness = [spring]
         self%is_held = [.not. present(stiffness)]
      else
         self%side_1 = [self%side_1, side_1]
         self%side_2 = [self%side_2, side_2]
         self%sector_2 = [self%sector_2, sector_2]
         self%stiffness = [self%stiffness, spring]
         self%is_held = [self%is_held, .not. present(stiffness)]
      end if
   end subroutine add_row

end module fw_closed_joint
