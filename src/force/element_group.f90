!> Elements that are neither pairs nor springs: a group of the namelist (and of a model file) that
!> gives some of one kind, and the law that is made of them.
!>
!> An element acts on rows of its own: each of its inputs is a relative displacement
!> u(side_1) - u(side_2) between signed dofs, 0 for the ground, as that of a pair; side 2 may lie in
!> another sector. A law of n_in inputs has as many components; one of velocities makes these of
!> the displacements by itself (fw_instant_law).
!>
!> A kind is a type that extends `element_group`, and a line in fw_elements. What is bound in
!> `bind_keys` is read from the namelist and is a part of a model file as well; all parts of one
!> file or program have as many elements as the first array.
module fw_element_group
   use fw_error, only: error_type
   use fw_force_law, only: force_law
   use fw_key, only: key_visitor
   use fw_kinds, only: wp
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   public :: element_group, group_name_length

   !> Names of groups are short, so that they fit into keys as `group%key`.
   integer, parameter :: group_name_length = 12

   type, abstract :: element_group
      !> As the input counts them: dampers, terms. Of one sector.
      integer :: n_given = 0
      !> Sectors whose motion is solved for: what stands here is of one.
      integer :: n_sectors = 1
      !> What each of them is multiplied by (n_given): the parameter `<group>%coefficient`.
      real(wp), allocatable :: coefficient(:)
      !> Elements of the law, of one sector, and their inputs; none where both sides are 0 (n_in,
      !> n_elements). Filled by `settle`.
      integer :: n_elements = 0, n_in = 0
      integer, allocatable :: row_side_1(:, :), row_side_2(:, :), row_sector_2(:, :)
      !> Functions of a user that give the forces, where a kind has such, whether their slopes are
      !> to be checked before a run, and what they may be off.
      type(user_element), allocatable :: function(:)
      logical :: check = .true.
      real(wp) :: check_tolerance = 1.0e-5_wp
   contains
      !> The group of the namelist.
      procedure(name_interface), deferred :: name
      !> The key of their number.
      procedure(name_interface), deferred :: count_key
      !> The number of elements, and what they are. Arrays that are needed and not given stay
      !> unallocated.
      procedure(bind_interface), deferred :: bind_count
      procedure(bind_interface), deferred :: bind_keys
      !> Elements that the arrays hold, which a model file has filled; 0 without any.
      procedure(count_interface), deferred :: n_held
      !> What is wrong with values that pass their ranges: a key and a text that continues its name.
      procedure(fault_interface), deferred :: find_fault
      !> The rows of the elements, of values that are all there.
      procedure(settle_interface), deferred :: settle
      !> The law of the elements of as many sectors, one sector after the other.
      procedure(law_interface), deferred :: make_law
      !> Whether opposite motions have opposite forces, and whether forces are in proportion to the
      !> motion.
      procedure(is_interface), deferred :: is_odd
      procedure(is_interface), deferred :: is_linear
      procedure :: is_in_models
      procedure :: load
      procedure :: take_laws
      procedure :: reserve_rows
   end type element_group

   abstract interface
      pure function name_interface(self) result(name)
         import :: element_group, group_name_length
         implicit none (type, external)
         class(element_group), intent(in) :: self
         character(group_name_length) :: name
      end function name_interface

      subroutine bind_interface(self, keys)
         import :: element_group, key_visitor
         implicit none (type, external)
         class(element_group), intent(inout) :: self
         class(key_visitor), intent(inout) :: keys
      end subroutine bind_interface

      pure integer function count_interface(self)
         import :: element_group
         implicit none (type, external)
         class(element_group), intent(in) :: self
      end function count_interface

      pure subroutine fault_interface(self, key, text)
         import :: element_group
         implicit none (type, external)
         class(element_group), intent(in) :: self
         !> Blank where nothing is wrong.
         character(24), intent(out) :: key
         character(160), intent(out) :: text
      end subroutine fault_interface

      subroutine settle_interface(self)
         import :: element_group
         implicit none (type, external)
         class(element_group), intent(inout) :: self
      end subroutine settle_interface

      subroutine law_interface(self, n_sectors, law)
         import :: element_group, force_law
         implicit none (type, external)
         class(element_group), intent(in) :: self
         integer, intent(in) :: n_sectors
         class(force_law), allocatable, intent(out) :: law
      end subroutine law_interface

      pure logical function is_interface(self)
         import :: element_group
         implicit none (type, external)
         class(element_group), intent(in) :: self
      end function is_interface
   end interface

contains

   !> Whether the arrays of the keys are parts of a model too.
   pure logical function is_in_models(self)
      class(element_group), intent(in) :: self

      is_in_models = .true.
      associate (unused => self)
      end associate
   end function is_in_models

   !> Bring in what stands in files beside the namelist, whose folder is given: nothing of most
   !> kinds.
   subroutine load(self, folder, error)
      class(element_group), intent(inout) :: self
      character(*), intent(in) :: folder
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, neither => folder)
      end associate
   end subroutine load

   !> Elements with laws of a program, behind those that the input gives: nothing to most kinds.
   subroutine take_laws(self, laws)
      class(element_group), intent(inout) :: self
      type(user_element), intent(in) :: laws(:)

      associate (unused => self, neither => laws)
      end associate
   end subroutine take_laws

   !> Rows of elements, all absent.
   pure subroutine reserve_rows(self, n_in, n_elements)
      class(element_group), intent(inout) :: self
      integer, intent(in) :: n_in, n_elements

      self%n_in = n_in
      self%n_elements = n_elements
      if (allocated(self%row_side_1)) deallocate (self%row_side_1)
      if (allocated(self%row_side_2)) deallocate (self%row_side_2)
      if (allocated(self%row_sector_2)) deallocate (self%row_sector_2)
      allocate (self%row_side_1(n_in, n_elements), self%row_side_2(n_in, n_elements), &
                self%row_sector_2(n_in, n_elements), source=0)
   end subroutine reserve_rows

end module fw_element_group
