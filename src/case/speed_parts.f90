!> Matrices of a model at several rotation speeds (group /speed): polynomials in the square of the
!> speed go through all of them.
module fw_speed_parts
   use fw_kinds, only: wp
   use fw_part, only: part, part_source
   use fw_speed_growth, only: speed_growth
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: most_speeds, speed_parts

   !> Of one speed.
   type :: speed_point
      real(wp), allocatable :: stiffness(:, :), static(:)
   end type speed_point

   !> Matrices of a model at several rotation speeds.
   type :: speed_parts
      !> Speeds [rad/s], and what the model is there; that of number I at place I + 1.
      real(wp), allocatable :: value(:)
      type(speed_point), allocatable :: at(:)
   contains
      procedure :: bind_parts
      procedure :: interpolate
   end type speed_parts

   integer, parameter :: most_speeds = 4
   character(*), parameter :: of_speed = 'speed/I'

contains

   !> The speeds first: their number is the extent of no other part, but of the groups that follow.
   subroutine bind_parts(self, to)
      class(speed_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      integer, allocatable :: numbers(:)
      integer :: i

      call to%bind(part('speed/value', 'speed', '2 to 4 rotation speeds [rad/s], ascending: '// &
                        'polynomials in their square go through the matrices there, and hold '// &
                        'between the first and the last'), self%value)
      call to%numbers(part(of_speed, '', ''), 0, most_speeds - 1, numbers)
      do i = 1, size(numbers)
         to%number = numbers(i)
         if (.not. allocated(self%at)) allocate (self%at(most_speeds))
         associate (here => self%at(numbers(i) + 1))
            call to%bind(part(of_speed//'/stiffness', 'dof dof', 'at speed I from 0, '// &
                              'symmetric; in place of stiffness and stiffness_rotation'), &
                         here%stiffness)
            call to%bind(part(of_speed//'/static', 'dof', 'constant load there, beside '// &
                              'load/static; in place of load/static_rotation'), here%static)
         end associate
      end do
   end subroutine bind_parts

   !> Stiffness at rest, and what grows with the speed; a message where the parts do not fit.
   pure subroutine interpolate(self, stiffness, growth, message)
      class(speed_parts), intent(in) :: self
      !> That of the model: compared where it is there, filled where it is not.
      real(wp), allocatable, intent(inout) :: stiffness(:, :)
      !> Takes the powers of stiffness and load, and between which speeds they hold.
      type(speed_growth), intent(inout) :: growth
      !> What does not fit; not allocated where all does.
      character(:), allocatable, intent(out) :: message
      !> Round-off of what a program writes, of the largest entry.
      real(wp), parameter :: same = 1.0e-8_wp
      real(wp), allocatable :: factors(:, :), rest(:, :)
      integer :: i, m, p

      call check(self, message)
      if (allocated(message)) return
      m = size(self%value)
      allocate (factors(0:m - 1, m))
      factors(:, :) = coefficients_of(self%value)
      growth%lowest = self%value(1)
      growth%highest = self%value(m)
      if (allocated(self%at(1)%stiffness)) then
         associate (first => self%at(1)%stiffness)
            allocate (growth%stiffness(size(first, 1), size(first, 2), m - 1), source=0.0_wp)
            rest = 0.0_wp*first
         end associate
         do i = 1, m
            rest = rest + factors(0, i)*symmetric(self%at(i)%stiffness)
            do p = 1, m - 1
               growth%stiffness(:, :, p) = growth%stiffness(:, :, p) + &
                                           factors(p, i)*symmetric(self%at(i)%stiffness)
            end do
         end do
         if (allocated(stiffness)) then
            if (any(shape(stiffness) /= shape(rest))) then
               message = 'speed/0/stiffness of another order than stiffness'
            else if (maxval(abs(stiffness - rest)) > same*maxval(abs(rest))) then
               message = 'a stiffness that differs from what speed/I/stiffness say at speed 0: '// &
                         'leave one of them out'
            end if
            if (allocated(message)) return
         end if
         call move_alloc(rest, stiffness)
      end if
      if (.not. allocated(self%at(1)%static)) return
      allocate (growth%load(size(self%at(1)%static), m - 1), source=0.0_wp)
      growth%load_at_rest = 0.0_wp*self%at(1)%static
      do i = 1, m
         growth%load_at_rest = growth%load_at_rest + factors(0, i)*self%at(i)%static
         do p = 1, m - 1
            growth%load(:, p) = growth%load(:, p) + factors(p, i)*self%at(i)%static
         end do
      end do
   end subroutine interpolate

   !> Without round-off: whether the matrix is symmetric is checked with the others.
   pure function symmetric(matrix)
      real(wp), intent(in) :: matrix(:, :)
      real(wp) :: symmetric(size(matrix, 1), size(matrix, 2))

      symmetric = 0.5_wp*(matrix + transpose(matrix))
   end function symmetric

   !> Whether there are speeds, in order, each with the same parts.
   pure subroutine check(self, message)
      class(speed_parts), intent(in) :: self
      character(:), allocatable, intent(out) :: message
      integer :: i, m

      if (.not. allocated(self%value)) then
         message = 'matrices of speed/I without speed/value'
         return
      end if
      m = size(self%value)
      if (m < 2 .or. m > most_speeds) then
         message = to_text(m)//' values of speed/value: must be 2 to '//to_text(most_speeds)
      else if (self%value(1) < 0.0_wp .or. any(self%value(2:) <= self%value(:m - 1))) then
         message = 'speed/value that is negative or does not ascend'
      else if (.not. allocated(self%at)) then
         message = 'speed/value without speed/0/stiffness or speed/0/static'
      end if
      if (allocated(message)) return
      ! A polynomial goes through all of them or is none.
      do i = 1, m
         if ((allocated(self%at(i)%stiffness) .neqv. allocated(self%at(1)%stiffness)) .or. &
             (allocated(self%at(i)%static) .neqv. allocated(self%at(1)%static)) .or. &
             .not. (allocated(self%at(i)%stiffness) .or. allocated(self%at(i)%static))) then
            message = 'a group speed/'//to_text(i - 1)//' that holds other parts than '// &
                      'speed/0: each of the '//to_text(m)//' speeds needs the same of '// &
                      'stiffness and static'
            return
         end if
      end do
      ! A group that no speed is given for would not count.
      do i = m + 1, most_speeds
         if (allocated(self%at(i)%stiffness) .or. allocated(self%at(i)%static)) message = &
            'a group speed/'//to_text(i - 1)//', but '//to_text(m)//' values of speed/value'
      end do
   end subroutine check

   !> Coefficients of the polynomials in x = Omega**2 that are 1 at one speed and 0 at the others
   !> (0:m-1, m).
   pure function coefficients_of(speeds) result(factors)
      real(wp), intent(in) :: speeds(:)
      real(wp) :: factors(0:size(speeds) - 1, size(speeds))
      real(wp) :: x(size(speeds)), scale
      integer :: i, j, m, p

      m = size(speeds)
      ! Powers of numbers up to one, taken back at the end.
      scale = speeds(m)**2
      x = speeds**2/scale
      factors = 0.0_wp
      factors(0, :) = 1.0_wp
      do i = 1, m
         do j = 1, m
            if (j == i) cycle
            factors(1:, i) = (factors(:m - 2, i) - x(j)*factors(1:, i))/(x(i) - x(j))
            factors(0, i) = -x(j)*factors(0, i)/(x(i) - x(j))
         end do
      end do
      do p = 1, m - 1
         factors(p, :) = factors(p, :)/scale**p
      end do
   end function coefficients_of

end module fw_speed_parts
