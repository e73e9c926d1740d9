!> What a model says of its sectors, from a file or from the calling program, and the checks that
!> are the same for both.
module fw_cyclic_parts
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_cyclic_data, only: influence_type
   use fw_kinds, only: wp
   use fw_part, only: part, part_source, part_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: cyclic_parts, nodal_parts
   public :: check_physical, check_rows, finish_influence

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
      !> Stress of the points of /stress per coordinate (n, 6, n_points).
      complex(wp), allocatable :: stress(:, :, :)
   contains
      procedure :: bind_parts => bind_diameter
   end type nodal_parts

   !> Parts of a model file that sectors have beside those of a plain structure.
   type :: cyclic_parts
      !> 0: the model is no sector.
      integer :: n_sectors = 0
      integer, allocatable :: left(:), right(:)
      !> Displacements in front of the coordinates of all nodal diameters; 0 where there are none.
      integer :: n_physical = 0
      !> Nodal diameter k at place k + 1.
      type(nodal_parts), allocatable :: nodal(:)
      !> Forces of the air.
      type(influence_type), allocatable :: air
   contains
      procedure :: bind_parts
   end type cyclic_parts

   character(*), parameter :: group = 'nodal_diameter/K/'

contains

   !> The parts of sectors.
   subroutine bind_parts(self, to)
      class(cyclic_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      integer, allocatable :: numbers(:)
      integer :: i

      call to%bind(part('cyclic@n_sectors', '', 'makes the model a sector', 'with /cyclic'), &
                   self%n_sectors)
      call to%note('integer', part('cyclic@n_physical', '', 'displacements in front of the '// &
                                   'coordinates of every nodal diameter, which take the place '// &
                                   'of matrices and interfaces of a sector', &
                                   'with /nodal_diameter'))
      call to%note('text', part('cyclic@phase', '', '"delay" (without it): matrices of nodal '// &
                                'diameters are of u_right = exp(-2 pi i K/N) u_left; '// &
                                '"advance": of the other sign'))
      call to%bind(part('cyclic/left', 'interface', 'dofs from 1 of one interface'), self%left)
      call to%bind(part('cyclic/right', 'interface', 'of the other, which moves as the left '// &
                        'one of the next sector; negative: with the sign turned'), self%right)
      call to%numbers(part(group(:len(group) - 1), '', ''), 0, self%n_sectors/2, numbers)
      do i = 1, size(numbers)
         to%number = numbers(i)
         if (.not. allocated(self%nodal)) allocate (self%nodal(self%n_sectors/2 + 1))
         call self%nodal(numbers(i) + 1)%bind_parts(to)
      end do
      call bind_air(self, to)
   end subroutine bind_parts

   !> The parts of one nodal diameter, whose mass has the order of the others.
   subroutine bind_diameter(self, to)
      class(nodal_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      character(*), parameter :: square = 'order order', needed = 'with its group'

      call to%set_extent('order', -1)
      call to%bind(part(group//'mass', square, 'Hermitian; K = 0, 1, .. N/2 as far as '// &
                        'harmonics need them, rigid laws take the mean of all that are there', &
                        needed), self%mass)
      if (allocated(self%mass)) call to%set_extent('order', size(self%mass, 1))
      call to%bind(part(group//'stiffness', square, 'Hermitian', needed), self%stiffness)
      call to%bind(part(group//'damping', square, 'Hermitian'), self%damping)
      call to%bind(part(group//'stiffness_rotation', square, 'Hermitian'), self%stiffness_rotation)
      call to%bind(part(group//'coriolis', square, 'skew-Hermitian, for each rad/s'), self%coriolis)
      call to%bind(part(group//'load/static', 'order', 'reduced load of sector 0; without it '// &
                        'that of /load, on the displacements'), self%load_static)
      call to%bind(part(group//'load/cosine', 'order', 'likewise'), self%load_cosine)
      call to%bind(part(group//'load/sine', 'order', 'likewise'), self%load_sine)
      call to%bind(part(group//'load/static_rotation', 'order', 'likewise'), &
                   self%load_static_rotation)
      call to%bind(part(group//'observe/matrix', 'quantity order', 'rows of the quantities of '// &
                        '/observe/name'), self%observe)
      call to%bind(part(group//'stress/matrix', 'stress 6 order', 'stress at points for each '// &
                        'coordinate, in place of /stress/matrix'), self%stress)
   end subroutine bind_diameter

   !> Forces of the air, by sectors or by nodal diameters.
   subroutine bind_air(self, to)
      class(cyclic_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      real(wp), allocatable :: modes(:, :)

      to%conjugates = .false.
      call bind_influence(self, to, .false., part('aero/sector/M', 'motion motion', 'forces of '// &
                          'the air by the motion of sector M, counted from the one that feels '// &
                          'them'))
      call bind_influence(self, to, .true., part('aero/nodal_diameter/M', 'motion motion', 'in '// &
                          'place of these: by signed nodal diameters'))
      call to%bind(part('aero/modes', 'motion dof', 'rows of motion that they are of; without '// &
                        'them every dof'), modes)
      if (.not. allocated(modes)) return
      if (.not. allocated(self%air)) allocate (self%air)
      call move_alloc(modes, self%air%modes)
   end subroutine bind_air

   !> Matrices by their numbers.
   subroutine bind_influence(self, to, is_diameter, row)
      class(cyclic_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      logical, intent(in) :: is_diameter
      type(part_type), intent(in) :: row
      complex(wp), allocatable :: matrix(:, :)
      character(:), allocatable :: message
      integer, allocatable :: numbers(:)
      integer :: i, n

      n = max(1, self%n_sectors)
      call to%numbers(row, 1 - n, n - 1, numbers)
      do i = 1, size(numbers)
         to%number = numbers(i)
         if (allocated(matrix)) deallocate (matrix)
         call to%bind(row, matrix)
         if (.not. allocated(matrix)) cycle
         if (.not. allocated(self%air)) allocate (self%air)
         if (allocated(self%air%number) .and. (self%air%by_diameter .neqv. is_diameter)) then
            message = 'is given beside the other kind, by sector and by nodal diameter: must '// &
                      'be one of both'
         else
            call forget(self%air, numbers(i))
            call add_influence(self%air, numbers(i), n, matrix, message)
            self%air%by_diameter = is_diameter
            call to%set_extent('motion', size(self%air%matrix, 1))
         end if
         if (allocated(message)) call to%fail(row, message)
         if (allocated(to%error)) return
      end do
   end subroutine bind_influence

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
   pure subroutine check_rows(parts, n_names, first)
      type(cyclic_parts), intent(in) :: parts
      integer, intent(in) :: n_names
      !> The first that has no row for each name; -1 where there is none.
      integer, intent(out) :: first
      integer :: k

      first = -1
      do k = 0, size(parts%nodal) - 1
         associate (nodal => parts%nodal(k + 1))
            if (.not. allocated(nodal%mass)) cycle
            if (allocated(nodal%observe)) then
               if (size(nodal%observe, 1) == n_names) cycle
            end if
            first = k
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

   !> A matrix that is given again replaces the one before it.
   pure subroutine forget(air, number)
      type(influence_type), intent(inout) :: air
      integer, intent(in) :: number
      logical, allocatable :: stays(:)
      integer, allocatable :: kept(:)
      integer :: j

      if (.not. allocated(air%number)) return
      stays = air%number /= number
      if (all(stays)) return
      kept = pack([(j, j=1, size(stays))], stays)
      air%matrix = air%matrix(:, :, kept)
      air%number = air%number(kept)
   end subroutine forget

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
