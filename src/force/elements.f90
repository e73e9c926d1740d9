!> All groups of elements that are neither pairs nor springs: the kinds that there are, and those
!> of a case.
module fw_elements
   use fw_damper_group, only: damper_group
   use fw_element_group, only: element_group, group_name_length
   use fw_kinds, only: wp
   use fw_polynomial_group, only: polynomial_group
   use fw_user_element, only: user_element
   use fw_user_group, only: user_group
   implicit none (type, external)
   private

   public :: element_list, element_kind, element_slot, n_element_kinds

   !> A new kind is a line in `new_group`, and one more here.
   integer, parameter :: n_element_kinds = 3

   !> A group by its kind: an array of one abstract type needs a box for each.
   type :: element_slot
      class(element_group), allocatable :: group
   end type element_slot

   type :: element_list
      !> A group for each kind, most of them empty; not allocated before `start`.
      type(element_slot), allocatable :: slot(:)
   contains
      procedure :: start
      procedure :: n_elements
      procedure :: are_odd
      procedure :: are_linear
      procedure :: count_of
      procedure :: extent_of
      procedure :: coefficients_of
      procedure :: set_coefficients
      procedure :: add_laws
      procedure :: set_sectors
   end type element_list

contains

   !> An empty group of a kind.
   subroutine new_group(kind, group)
      integer, intent(in) :: kind
      class(element_group), allocatable, intent(out) :: group

      select case (kind)
      case (1); allocate (polynomial_group :: group)
      case (2); allocate (damper_group :: group)
      case (3); allocate (user_group :: group)
      case default ! no such kind
      end select
   end subroutine new_group

   !> An empty group of each kind.
   subroutine start(self)
      class(element_list), intent(inout) :: self
      integer :: k

      if (allocated(self%slot)) deallocate (self%slot)
      allocate (self%slot(n_element_kinds))
      do k = 1, n_element_kinds
         call new_group(k, self%slot(k)%group)
      end do
   end subroutine start

   !> Elements with laws of a program, behind those that the input gives.
   !> All groups are asked, and that of the user alone takes them.
   subroutine add_laws(self, laws)
      class(element_list), intent(inout) :: self
      type(user_element), intent(in) :: laws(:)
      integer :: k

      do k = 1, size(self%slot)
         call self%slot(k)%group%take_laws(laws)
      end do
   end subroutine add_laws

   !> How many sectors are solved for.
   pure subroutine set_sectors(self, n)
      class(element_list), intent(inout) :: self
      integer, intent(in) :: n
      integer :: k

      do k = 1, size(self%slot)
         self%slot(k)%group%n_sectors = n
      end do
   end subroutine set_sectors

   !> Elements of all kinds, of one sector.
   pure integer function n_elements(self) result(n)
      class(element_list), intent(in) :: self
      integer :: k

      n = 0
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         n = n + self%slot(k)%group%n_elements
      end do
   end function n_elements

   !> Whether opposite motions have opposite forces.
   pure logical function are_odd(self)
      class(element_list), intent(in) :: self
      integer :: k

      are_odd = .true.
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         if (self%slot(k)%group%n_elements > 0) are_odd = are_odd .and. &
            self%slot(k)%group%is_odd()
      end do
   end function are_odd

   !> Whether all forces are in proportion to the motion.
   pure logical function are_linear(self)
      class(element_list), intent(in) :: self
      integer :: k

      are_linear = .true.
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         if (self%slot(k)%group%n_elements > 0) are_linear = are_linear .and. &
            self%slot(k)%group%is_linear()
      end do
   end function are_linear

   !> Which kind a group of the namelist is; 0 where it is none of these.
   integer function element_kind(name) result(kind)
      character(*), intent(in) :: name
      ! The names are asked of the groups: they stand nowhere else.
      type(element_list) :: list
      integer :: k

      call list%start()
      kind = 0
      do k = 1, n_element_kinds
         if (list%slot(k)%group%name() == name) kind = k
      end do
   end function element_kind

   !> How many the group of a name gives.
   pure integer function count_of(self, name) result(n)
      class(element_list), intent(in) :: self
      character(*), intent(in) :: name
      integer :: k

      n = 0
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         if (self%slot(k)%group%name() == name) n = self%slot(k)%group%n_given
      end do
   end function count_of

   !> Inputs of an element of a group (1), or elements of all sectors that are solved for (2).
   pure integer function extent_of(self, name, dimension) result(n)
      class(element_list), intent(in) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: dimension
      integer :: k

      n = 0
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         associate (group => self%slot(k)%group)
            if (group%name() == name) n = merge(group%n_in, group%n_elements*group%n_sectors, &
                                               dimension == 1)
         end associate
      end do
   end function extent_of

   !> Their coefficients.
   pure function coefficients_of(self, name) result(values)
      class(element_list), intent(in) :: self
      character(*), intent(in) :: name
      real(wp), allocatable :: values(:)
      integer :: k

      allocate (values(0))
      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         if (self%slot(k)%group%name() /= name) cycle
         if (allocated(self%slot(k)%group%coefficient)) values = self%slot(k)%group%coefficient
      end do
   end function coefficients_of

   !> A sweep over the parameter `<group>%coefficient` sets them at every point.
   pure subroutine set_coefficients(self, name, values)
      class(element_list), intent(inout) :: self
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      integer :: k

      if (.not. allocated(self%slot)) return
      do k = 1, size(self%slot)
         if (self%slot(k)%group%name() == name) self%slot(k)%group%coefficient = values
      end do
   end subroutine set_coefficients

end module fw_elements
