!> Bodies that no spring holds: wedges, cylinders, strips and rings, which rotation presses against
!> what they damp (group /body of a model file). What they add to a model,
!>
!>   M <- M + m M_1,   f_0 <- f_0 + m r Omega**2 d,
!>
!> M_1 being the mass matrix for a unit of mass in the dofs of the body (x, y, z, then rotations), r
!> the radius of its centre of mass and d the direction outwards.
module fw_loose_bodies
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above
   use fw_kinds, only: wp
   use fw_part, only: by_columns, part, part_source
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: loose_bodies

   !> A component is not allocated where the model has no bodies.
   type :: loose_bodies
      type(string_type), allocatable :: name(:)
      !> [mass], [length] (n_bodies).
      real(wp), allocatable :: mass(:), radius(:)
      !> Outwards (3, n_bodies).
      real(wp), allocatable :: direction(:, :)
      !> Dofs of each, 0 for none (6, n_bodies).
      integer, allocatable :: dof(:, :)
      !> For a unit of mass (6, 6, n_bodies).
      real(wp), allocatable :: unit_mass(:, :, :)
   contains
      procedure :: bind_parts
      procedure :: bind_keys
      procedure :: count => count_bodies
      procedure :: find_fault
      procedure :: unit_matrix
      procedure :: unit_load
      procedure :: join
      procedure :: set_mass
   end type loose_bodies

contains

   subroutine bind_parts(self, to)
      class(loose_bodies), intent(inout) :: self
      class(part_source), intent(inout) :: to
      character(*), parameter :: with = 'with /body'

      call to%bind(part('body/name', 'body', 'of each body that no spring holds', with), self%name)
      call to%bind(part('body/mass', 'body', 'of each, which /mass does not hold', with), self%mass)
      call to%bind(part('body/radius', 'body', 'of its centre of mass: rotation presses it '// &
                        'outwards'), self%radius)
      call to%bind(part('body/direction', 'body 3', 'outwards, of length 1', storage=by_columns), &
                   self%direction)
      call to%bind(part('body/dof', 'body 6', 'its dofs x, y, z and rotations, from 1; 0: none', &
                        with), self%dof)
      call to%bind(part('body/unit_mass', 'body 6 6', 'mass matrix of each for a unit of mass', &
                        with), self%unit_mass)
      call to%note('real', part('body/point', 'contact_point 3', 'places of contact from the '// &
                                'centre of mass, for pictures'))
      call to%note('integer', part('body/pair', 'contact_point', 'their pairs, from 0'))
      call to%note('integer', part('body/of_point', 'contact_point', 'their bodies, from 0'))
   end subroutine bind_parts

   pure integer function count_bodies(self) result(n)
      class(loose_bodies), intent(in) :: self

      n = 0
      if (allocated(self%mass)) n = size(self%mass)
   end function count_bodies

   !> Group &body: other masses than those of the model.
   subroutine bind_keys(self, keys)
      class(loose_bodies), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('body', 'bodies of the model that no spring holds')
      call keys%set_size('n_bodies', self%count())
      call keys%bind(key('mass', 'of each body', above(0.0_wp), unit='M', shape='n_bodies', &
                         absent='of the file'), self%mass)
   end subroutine bind_keys

   !> What a model says wrong of its bodies; empty where nothing is.
   pure subroutine find_fault(self, n_dof, fault)
      class(loose_bodies), intent(in) :: self
      integer, intent(in) :: n_dof
      ! allow(C072): a text of the caller
      character(*), intent(out) :: fault
      integer :: i, k

      fault = ''
      if (.not. (allocated(self%dof) .and. allocated(self%unit_mass) .and. &
                 allocated(self%name))) then
         fault = 'a body/mass without body/name, body/dof and body/unit_mass: must have all'
         return
      else if (allocated(self%radius) .and. .not. allocated(self%direction)) then
         fault = 'a body/radius without body/direction: must have both'
         return
      end if
      do i = 1, self%count()
         associate (dofs => pack(self%dof(:, i), self%dof(:, i) /= 0), &
                    unit => self%unit_mass(:, :, i))
            if (any(dofs < 1 .or. dofs > n_dof)) then
               k = findloc(dofs < 1 .or. dofs > n_dof, .true., dim=1)
               fault = 'a body/dof of body '//to_text(i)//' that is '//to_text(dofs(k))// &
                       ': must be from 0 to '//to_text(n_dof)
            else if (size(dofs) == 0 .or. any([(count(dofs == dofs(k)) > 1, &
                                                k=1, size(dofs))])) then
               fault = 'a body/dof that is empty or stands twice, of body '//to_text(i)// &
                       ': must be another dof each'
            else if (.not. all(ieee_is_finite(unit))) then
               fault = 'a body/unit_mass of body '//to_text(i)//': must be finite'
            else if (any(abs(unit - transpose(unit)) > 1.0e-12_wp*maxval(abs(unit)))) then
               fault = 'a body/unit_mass of body '//to_text(i)//': must be symmetric'
            else if (.not. (self%mass(i) > 0.0_wp .and. self%mass(i) <= huge(1.0_wp))) then
               fault = 'a body/mass of body '//to_text(i)//': must be above 0'
            end if
         end associate
         if (len_trim(fault) > 0) return
         if (.not. allocated(self%radius)) cycle
         if (all(ieee_is_finite(self%direction(:, i))) .and. ieee_is_finite(self%radius(i))) cycle
         fault = 'a body/radius or body/direction of body '//to_text(i)//': must be finite'
         return
      end do
   end subroutine find_fault

   !> What a unit of mass of one body adds to the mass matrix (n_dof, n_dof).
   pure function unit_matrix(self, body, n_dof) result(matrix)
      class(loose_bodies), intent(in) :: self
      integer, intent(in) :: body, n_dof
      real(wp) :: matrix(n_dof, n_dof)
      integer :: i, j

      matrix = 0.0_wp
      associate (dof => self%dof(:, body))
         do j = 1, 6
            do i = 1, 6
               if (dof(i) == 0 .or. dof(j) == 0) cycle
               matrix(dof(i), dof(j)) = self%unit_mass(i, j, body)
            end do
         end do
      end associate
   end function unit_matrix

   !> And to the static load for each square of the rotation speed (n_dof).
   pure function unit_load(self, body, n_dof) result(load)
      class(loose_bodies), intent(in) :: self
      integer, intent(in) :: body, n_dof
      real(wp) :: load(n_dof)
      integer :: i

      load = 0.0_wp
      if (.not. allocated(self%radius)) return
      do i = 1, 3
         if (self%dof(i, body) == 0) cycle
         load(self%dof(i, body)) = self%radius(body)*self%direction(i, body)
      end do
   end function unit_load

   !> Add all bodies to a mass, and to what the load has for each square of the speed.
   pure subroutine join(self, n_dof, mass, load)
      class(loose_bodies), intent(in) :: self
      integer, intent(in) :: n_dof
      real(wp), allocatable, intent(inout) :: mass(:, :)
      !> (n_dof, n_powers)
      real(wp), allocatable, intent(inout) :: load(:, :)
      integer :: i

      if (.not. allocated(mass)) allocate (mass(n_dof, n_dof), source=0.0_wp)
      if (.not. allocated(load)) allocate (load(n_dof, 1), source=0.0_wp)
      do i = 1, self%count()
         mass = mass + self%mass(i)*self%unit_matrix(i, n_dof)
         load(:, 1) = load(:, 1) + self%mass(i)*self%unit_load(i, n_dof)
      end do
   end subroutine join

   !> The same mass for every body, in a mass and a load that hold them.
   pure subroutine set_mass(self, value, mass, load)
      class(loose_bodies), intent(inout) :: self
      real(wp), intent(in) :: value
      real(wp), intent(inout) :: mass(:, :), load(:, :)
      integer :: i

      do i = 1, self%count()
         mass = mass + (value - self%mass(i))*self%unit_matrix(i, size(mass, 1))
         load(:, 1) = load(:, 1) + (value - self%mass(i))*self%unit_load(i, size(mass, 1))
      end do
      self%mass = value
   end subroutine set_mass

end module fw_loose_bodies
