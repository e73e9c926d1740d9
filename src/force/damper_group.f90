!> Group &damper: forces c u**q |v|**(p - 1) v of the relative displacement u and its rate v.
!>
!> p = 1, q = 0 is a viscous damper, p = 2 drag, p between 1 and 2 a shock absorber, q = 2 a damper
!> that grips with the motion. The work over a period is never negative where q is even.
module fw_damper_group
   use fw_element_group, only: element_group, group_name_length
   use fw_force_law, only: force_law, force_workspace, law_facts
   use fw_fourier, only: fourier_type
   use fw_instant_law, only: element_motion, instant_law
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least, at_most, side_numbers, from_to, operator(.and.)
   use fw_kinds, only: wp
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: damper_group, damper_law, new_dampers

   character(*), parameter :: of_file = 'of the file', or_needed = 'of the file, else required'
   !> More dampers are taken for a mistake; higher powers, too.
   integer, parameter :: most = 1000000, most_power = 99
   !> Instants of forces that are no polynomials of the motion.
   integer, parameter :: of_broken_power = 512, for_each_harmonic = 16

   !> Dampers with powers of velocity and displacement.
   type, extends(element_group) :: damper_group
      !> Signed dofs, 0 for the ground, and the sector of side 2 (n_dampers).
      integer, allocatable :: side_1(:), side_2(:), sector_2(:)
      !> p and q (n_dampers).
      real(wp), allocatable :: power(:)
      integer, allocatable :: position_power(:)
   contains
      procedure :: name
      procedure :: count_key
      procedure :: bind_count
      procedure :: bind_keys
      procedure :: n_held
      procedure :: find_fault
      procedure :: settle
      procedure :: make_law
      procedure :: is_odd
      procedure :: is_linear
   end type damper_group

   !> Their force at an instant, of a displacement and a velocity.
   type, extends(instant_law) :: damper_law
      !> (n_elements)
      real(wp), allocatable :: coefficient(:), power(:)
      integer, allocatable :: position_power(:)
   contains
      procedure :: act
      procedure :: n_parameters
      procedure :: by_parameter
   end type damper_law

contains

   pure function name(self)
      class(damper_group), intent(in) :: self
      character(group_name_length) :: name

      name = 'damper'
      associate (unused => self)
      end associate
   end function name

   !> The key that says how many there are.
   pure function count_key(self)
      class(damper_group), intent(in) :: self
      character(group_name_length) :: count_key

      count_key = 'n_dampers'
      associate (unused => self)
      end associate
   end function count_key

   !> What has to be known before the other keys have their sizes.
   subroutine bind_count(self, keys)
      class(damper_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('damper', 'nonlinear dampers')
      call keys%bind(key('n_dampers', '0 switches the dampers of a file off', from_to(0, most), &
                         absent=of_file), self%n_given)
      call keys%set_size('n_dampers', self%n_given)
   end subroutine bind_count

   subroutine bind_keys(self, keys)
      class(damper_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      logical :: needed

      needed = self%n_given > 0 .and. .not. allocated(self%side_1)
      call keys%bind(key('side_1', 'dof on one side', side_numbers(), shape='n_dampers', &
                         absent=or_needed), self%side_1, needed)
      call keys%bind(key('side_2', 'dof on the other side, 0: ground', side_numbers(), &
                         shape='n_dampers', absent=of_file), self%side_2, default=0)
      call keys%bind(key('sector_2', 'of side 2, counted from that of side 1', shape='n_dampers', &
                         absent=of_file, only='&cyclic'), self%sector_2, default=0)
      call keys%bind(key('coefficient', &
                         'c of c u**position_power abs(v)**(power - 1) v, v = du/dt', &
                         shape='n_dampers', absent=or_needed), self%coefficient, &
                     self%n_given > 0 .and. .not. allocated(self%coefficient))
      call keys%bind(key('power', 'of the velocity: 1 viscous, 2 drag', &
                         at_least(1.0_wp) .and. at_most(real(most_power, wp)), &
                         shape='n_dampers', absent=of_file), self%power, default=1.0_wp)
      call keys%bind(key('position_power', 'of the displacement; odd ones have even harmonics', &
                         from_to(0, most_power), shape='n_dampers', absent=of_file), &
                     self%position_power, default=0)
   end subroutine bind_keys

   pure integer function n_held(self)
      class(damper_group), intent(in) :: self

      n_held = 0
      if (allocated(self%side_1)) n_held = size(self%side_1)
   end function n_held

   !> The first value that no damper has, with its key.
   pure subroutine find_fault(self, key, text)
      class(damper_group), intent(in) :: self
      character(24), intent(out) :: key
      character(160), intent(out) :: text
      integer :: i

      key = ''
      text = ''
      do i = 1, self%n_given
         if (abs(self%side_1(i)) /= abs(self%side_2(i)) .or. self%sector_2(i) /= 0) cycle
         key = 'side_1'
         text = 'and side_2: damper '//to_text(i)//' has dof '//to_text(self%side_1(i))// &
                ' on both sides: they must differ'
         return
      end do
   end subroutine find_fault

   !> Fill in what was not given.
   subroutine settle(self)
      class(damper_group), intent(inout) :: self

      call self%reserve_rows(1, self%n_given)
      if (self%n_given == 0) return
      self%row_side_1(1, :) = self%side_1
      self%row_side_2(1, :) = self%side_2
      self%row_sector_2(1, :) = self%sector_2
   end subroutine settle

   subroutine make_law(self, n_sectors, law)
      class(damper_group), intent(in) :: self
      integer, intent(in) :: n_sectors
      class(force_law), allocatable, intent(out) :: law

      allocate (law, source=new_dampers(self%coefficient, self%power, self%position_power, &
                                        n_sectors))
   end subroutine make_law

   !> Whether the force changes its sign with the motion.
   pure logical function is_odd(self)
      class(damper_group), intent(in) :: self

      is_odd = all(modulo(self%position_power, 2) == 0)
   end function is_odd

   !> Whether all of them are viscous dampers.
   pure logical function is_linear(self)
      class(damper_group), intent(in) :: self

      is_linear = all(self%position_power == 0 .and. abs(self%power - 1.0_wp) <= 0.0_wp)
   end function is_linear

   !> Dampers of one sector, repeated for as many as there are.
   pure type(damper_law) function new_dampers(coefficient, power, position_power, n_sectors) &
      result(self)
      real(wp), intent(in) :: coefficient(:), power(:)
      integer, intent(in) :: position_power(:), n_sectors
      integer :: degree, j

      call self%take_inputs(1, size(coefficient)*n_sectors, .true.)
      self%coefficient = [(coefficient, j=1, n_sectors)]
      self%power = [(power, j=1, n_sectors)]
      self%position_power = [(position_power, j=1, n_sectors)]
      degree = maxval([0, ceiling(power) + position_power])
      self%facts = law_facts(is_odd=all(modulo(position_power, 2) == 0))
      ! Polynomials are sampled without any error from (degree + 1) H + 1 instants on.
      self%facts%fewest_instants = merge(0, of_broken_power, all(is_polynomial(power)))
      self%facts%instants_per_harmonic = max(for_each_harmonic, degree + 1)
      self%facts%instants_with_separation = self%facts%instants_per_harmonic
      self%facts%further_instants = for_each_harmonic
   end function new_dampers

   !> Whether |v|**(p - 1) v is a polynomial: odd whole powers.
   elemental logical function is_polynomial(power)
      real(wp), intent(in) :: power

      is_polynomial = abs(power - anint(power)) <= 0.0_wp .and. modulo(nint(power), 2) == 1
   end function is_polynomial

   !> Forces and slopes; at v = 0 the slope of powers above 1 is 0.
   subroutine act(self, motion)
      class(damper_law), intent(in) :: self
      type(element_motion), intent(inout) :: motion
      real(wp) :: grip, rate, u, v
      integer :: k

      associate (c => self%coefficient(motion%element), p => self%power(motion%element), &
                 q => self%position_power(motion%element))
         do k = 1, motion%n_time
            u = motion%u(1, k)
            v = motion%v(1, k)
            grip = c
            if (q > 0) grip = c*u**q
            rate = 1.0_wp
            if (p > 1.0_wp) rate = abs(v)**(p - 1.0_wp)
            motion%force(1, k) = grip*rate*v
            if (.not. motion%wants_slopes) cycle
            motion%by_v(1, 1, k) = p*grip*rate
            if (q > 0) motion%by_u(1, 1, k) = c*q*u**(q - 1)*rate*v
         end do
      end associate
   end subroutine act

   !> One for each coefficient.
   pure integer function n_parameters(self) result(n)
      class(damper_law), intent(in) :: self

      n = merge(1, 0, self%n_elements > 0)
   end function n_parameters

   !> The force of a unit coefficient of each damper.
   subroutine by_parameter(self, number, fourier, work, force)
      class(damper_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)
      type(element_motion) :: motion
      real(wp) :: values(self%n_elements, 1, fourier%n_time)
      integer :: i

      associate (unused => number)
      end associate
      motion%n_time = fourier%n_time
      allocate (motion%u(1, fourier%n_time), motion%v(1, fourier%n_time))
      do i = 1, self%n_elements
         call self%take_motion(work, i, motion)
         values(i, 1, :) = sign(abs(motion%v(1, :))**self%power(i), motion%v(1, :))
         if (self%position_power(i) > 0) values(i, 1, :) = values(i, 1, :)* &
                                                           motion%u(1, :)**self%position_power(i)
      end do
      call fourier%to_coefficients(self%n_elements, values, force)
   end subroutine by_parameter

end module fw_damper_group
