!> Means over all nodal diameters of a cyclic structure: the diagonal of the static stiffness of all
!> sectors together, and what a coordinate is to motion above the harmonics. Waves in both
!> directions count, but those that stand; of nodal diameters without matrices nothing is known.
module fw_sector_means
   use fw_cyclic_data, only: nodal_matrices
   use fw_cyclic_relative, only: cyclic_relative
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_sector, only: sector_at
   use fw_sector_reduction, only: sector_reduction, static_diagonal
   use fw_sector_split, only: split_sector
   implicit none (type, external)
   private

   public :: sector_means
   public :: means_none, means_static, means_split

   !> What laws ask of the mean over all nodal diameters: nothing, the static stiffness, or what a
   !> coordinate is to motion above the harmonics as well.
   integer, parameter :: means_none = 0, means_static = 1, means_split = 2

   !> Means over the sectors, where one number stands for all of them.
   type :: sector_means
      !> Mean of the static stiffness of a coordinate of a sector (n_coordinates) [force/length].
      real(wp), allocatable, private :: static(:)
      !> Bases of all nodal diameters without kept modes, their weights among all of them, and the
      !> place of each coordinate there; only where the split is asked for.
      type(sector_reduction), allocatable, private :: all(:)
      real(wp), allocatable, private :: share(:)
      integer, allocatable, private :: place(:, :)
   contains
      procedure :: take
      procedure :: static_stiffness
      procedure :: split
   end type sector_means

contains

   subroutine take(self, model, relative, means, bases, error)
      class(sector_means), intent(out) :: self
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      !> means_none, means_static or means_split.
      integer, intent(in) :: means
      !> Of nodal diameters that are condensed already.
      type(sector_reduction), intent(in) :: bases(:)
      type(error_type), allocatable, intent(out) :: error

      if (means >= means_static) call take_static(model, relative, self, error)
      if (allocated(error)) return
      if (means == means_split) call take_all(model, relative, bases, self, error)
   end subroutine take

   subroutine take_static(model, relative, self, error)
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      type(sector_means), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      real(wp), allocatable :: diagonal(:)
      real(wp) :: weight(relative%n_coordinates), share
      integer, allocatable :: slot(:)
      integer :: j, k

      allocate (self%static(relative%n_coordinates), source=0.0_wp)
      weight = 0.0_wp
      do k = 0, model%cyclic%n_sectors/2
         if (.not. model%cyclic%holds(k)) cycle
         call sector_at(model, k, nodal, error)
         if (.not. allocated(error)) call static_diagonal(k, nodal, relative%at(k + 1), diagonal, &
                                                          error)
         if (allocated(error)) return
         share = share_of(model, k)
         slot = relative%slots(k)
         do j = 1, size(slot)
            if (slot(j) == 0) cycle
            self%static(slot(j)) = self%static(slot(j)) + share*diagonal(j)
            weight(slot(j)) = weight(slot(j)) + share
         end do
      end do
      where (weight > 0.0_wp) self%static = self%static/weight
   end subroutine take_static

   pure real(wp) function share_of(model, k) result(share)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k

      share = merge(1.0_wp, 2.0_wp, k == 0 .or. 2*k == model%cyclic%n_sectors)
   end function share_of

   !> Bases of all nodal diameters.
   subroutine take_all(model, relative, bases, self, error)
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      type(sector_reduction), intent(in) :: bases(:)
      type(sector_means), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      integer, allocatable :: slot(:)
      integer :: i, j, k, n

      n = model%cyclic%n_sectors/2 + 1
      allocate (self%all(n), self%share(n), self%place(relative%n_coordinates, n))
      self%share = 0.0_wp
      self%place = 0
      do k = 0, n - 1
         if (.not. model%cyclic%holds(k)) cycle
         slot = relative%slots(k)
         i = as_it_is(bases, k, slot)
         if (i > 0) then
            self%all(k + 1) = bases(i)
         else
            call sector_at(model, k, nodal, error)
            if (.not. allocated(error)) then
               call self%all(k + 1)%find_modes(k, nodal, relative%at(k + 1), error)
            end if
            if (allocated(error)) return
            call self%all(k + 1)%transform(nodal, [(j, j=1, size(slot))], size(slot))
         end if
         self%share(k + 1) = share_of(model, k)
         do j = 1, size(slot)
            if (slot(j) > 0) self%place(slot(j), k + 1) = j
         end do
      end do
   end subroutine take_all

   !> The basis of a nodal diameter, with its own coordinates in their order and no kept mode; 0 for
   !> none.
   pure integer function as_it_is(bases, k, slot) result(place)
      type(sector_reduction), intent(in) :: bases(:)
      integer, intent(in) :: k, slot(:)
      integer :: i, j

      place = 0
      do j = 1, size(bases)
         if (bases(j)%nodal_diameter /= k .or. bases(j)%n_coordinates /= size(slot)) cycle
         if (size(bases(j)%kept) > 0) cycle
         if (any(slot /= [(i, i=1, size(slot))])) cycle
         place = j
         return
      end do
   end function as_it_is

   !> 0 where it was not asked for.
   pure real(wp) function static_stiffness(self, coordinate)
      class(sector_means), intent(in) :: self
      integer, intent(in) :: coordinate

      static_stiffness = 0.0_wp
      if (.not. allocated(self%static)) return
      if (coordinate <= size(self%static)) static_stiffness = self%static(coordinate)
   end function static_stiffness

   !> As of structure_operator; nothing where it was not asked for.
   pure subroutine split(self, coordinate, limit, m, c, k)
      class(sector_means), intent(in) :: self
      integer, intent(in) :: coordinate
      real(wp), intent(in) :: limit
      real(wp), intent(out) :: m, c, k
      real(wp) :: part(3), total
      integer :: j

      m = 0.0_wp
      c = 0.0_wp
      k = 0.0_wp
      if (.not. allocated(self%all)) return
      if (coordinate > size(self%place, 1)) return
      total = 0.0_wp
      do j = 1, size(self%all)
         if (self%place(coordinate, j) == 0) cycle
         call split_sector(self%all(j), self%place(coordinate, j), limit, part(1), part(2), part(3))
         m = m + self%share(j)*part(1)
         c = c + self%share(j)*part(2)
         k = k + self%share(j)*part(3)
         total = total + self%share(j)
      end do
      if (total <= 0.0_wp) return
      m = max(m/total, 0.0_wp)
      c = max(c/total, 0.0_wp)
      k = k/total
   end subroutine split

end module fw_sector_means
