!> Which coordinates are left in the linear problem of a Newton step.
module fw_active_set
   implicit none (type, external)
   private

   public :: active_set, element_list

   !> Numbers of elements of a law (the first n of `number`), those whose inputs are without the
   !> balance before those that take it.
   type :: element_list
      integer :: n = 0, n_free = 0
      integer, allocatable :: number(:)
   end type element_list

   type :: active_set
      !> Unknowns of the linear problem.
      integer :: n_linear = 0
      !> Coordinates that stay (the first n_active entries of `used`), and those whose rows of the
      !> structure are needed still (up to n_used).
      integer :: n_active = 0
      integer :: n_used = 0
      integer, allocatable :: used(:)
      !> Place of each coordinate in `used`, 0 where it has none (n_coordinates).
      integer, allocatable :: place(:)
   contains
      procedure :: reserve
   end type active_set

contains

   !> Room for the lists; which coordinates are in them is decided with every derivative.
   pure subroutine reserve(self, n_coordinates)
      class(active_set), intent(inout) :: self
      integer, intent(in) :: n_coordinates

      allocate (self%used(n_coordinates), self%place(n_coordinates), source=0)
   end subroutine reserve

end module fw_active_set
