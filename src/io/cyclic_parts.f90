!> What a model says of its sectors, from a file or from the calling program, and the checks that
!> are the same for both.
module fw_cyclic_parts
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_cyclic_data, only: influence_type
   use fw_kinds, only: wp
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: cyclic_parts, nodal_parts
   public :: check_physical, check_rows, add_influence, finish_influence

   !> Of one nodal diameter; a component is not allocated where the model has none.
   type :: nodal_parts
      complex(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      complex(wp), allocatable :: stiffness_rotation(:, :)
      complex(wp), allocatable :: load_static(:), load_cosine(:), load_sine(:)
      !> Per square of the rotation speed.
      complex(wp), allocatable :: load_static_rotation(:)
      complex(wp), allocatable :: observe(:, :)
      !> Per rotation speed.
      complex(wp), allocatable :: coriolis(:, :)
   end type nodal_parts

   type :: cyclic_parts
      !> 0: the model is no sector.
      integer :: n_sectors = 0
      integer, allocatable :: left(:), right(:)
      !> Sector of side 2 of the pairs (n_pairs).
      integer, allocatable :: sector_2(:)
      !> Displacements in front of the coordinates of all nodal diameters; 0 where there are none.
      integer :: n_physical = 0
      !> Nodal diameter k at place k + 1.
      type(nodal_parts), allocatable :: nodal(:)
      !> Forces of the air.
      type(influence_type), allocatable :: air
   end type cyclic_parts

contains

   !> Displacements in front are some of the coordinates of a nodal diameter.
   pure subroutine check_physical(n_physical, order, mass, message)
      integer, intent(in) :: n_physical, order
      !> What the mass is called.
      character(*), intent(in) :: mass
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message

      if (n_physical >= 1 .and. n_physical <= order) return
      message = 'is '//to_text(n_physical)//', expected from 1 to '//to_text(order)// &
                ', the order of '//mass
   end subroutine check_physical

   !> Rows of observed quantities stand with all nodal diameters.
   pure subroutine check_rows(parts, n_names, diameter)
      type(cyclic_parts), intent(in) :: parts
      integer, intent(in) :: n_names
      !> The first that has no row for each name; -1 where there is none.
      integer, intent(out) :: diameter
      integer :: k

      diameter = -1
      do k = 0, size(parts%nodal) - 1
         associate (nodal => parts%nodal(k + 1))
            if (.not. allocated(nodal%mass)) cycle
            if (allocated(nodal%observe)) then
               if (size(nodal%observe, 1) == n_names) cycle
            end if
            diameter = k
            return
         end associate
      end do
   end subroutine check_rows

   !> Forces of the air by a further sector, or nodal diameter.
   pure subroutine add_influence(air, number, n_sectors, matrix, message)
      type(influence_type), intent(inout) :: air
      integer, intent(in) :: number, n_sectors
      complex(wp), intent(in) :: matrix(:, :)
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      complex(wp), allocatable :: longer(:, :, :)
      integer :: j, m, n, place

      if (.not. allocated(air%number)) allocate (air%number(0))
      m = size(air%number)
      n = size(matrix, 1)
      if (m > 0) n = size(air%matrix, 1)
      if (n == 0 .or. any(shape(matrix) /= n)) then
         message = 'is '//to_text(size(matrix, 1))//' x '//to_text(size(matrix, 2))// &
                   ', expected square matrices of one order'
         return
      else if (.not. all(ieee_is_finite(abs(matrix)))) then
         message = 'holds a number that is not finite'
         return
      end if
      do j = 1, m
         if (modulo(air%number(j) - number, n_sectors) /= 0) cycle
         message = 'is the same sector or wave as '//to_text(air%number(j))//' around '// &
                   to_text(n_sectors)//' sectors, expected one of both'
         return
      end do
      ! By their numbers, so that sums do not depend on the order in which they come.
      place = count(air%number < number) + 1
      allocate (longer(n, n, m + 1))
      if (m > 0) then
         longer(:, :, :place - 1) = air%matrix(:, :, :place - 1)
         longer(:, :, place + 1:) = air%matrix(:, :, place:)
      end if
      longer(:, :, place) = matrix
      call move_alloc(longer, air%matrix)
      air%number = [air%number(:place - 1), number, air%number(place:)]
   end subroutine add_influence

   !> Without rows of motion, each dof is one.
   pure subroutine finish_influence(air, n_dof, message)
      type(influence_type), intent(inout) :: air
      integer, intent(in) :: n_dof
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      integer :: i, n

      n = size(air%matrix, 1)
      if (allocated(air%modes)) then
         if (size(air%modes, 1) == n .and. size(air%modes, 2) == n_dof) return
         message = 'aero/modes is '//to_text(size(air%modes, 1))//' x '// &
                   to_text(size(air%modes, 2))//', expected '//to_text(n)//' rows of the '// &
                   to_text(n_dof)//' dofs'
      else if (n /= n_dof) then
         message = 'are of order '//to_text(n)//', expected '//to_text(n_dof)//', the dofs, or '// &
                   '/aero/modes, the motions that they are of'
      else
         allocate (air%modes(n, n), source=0.0_wp)
         do i = 1, n
            air%modes(i, i) = 1.0_wp
         end do
      end if
   end subroutine finish_influence

end module fw_cyclic_parts
