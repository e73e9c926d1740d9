!> How hard the two sides of a pair press: p(d) of the overclosure d = -(u_n + gap + depth),
!>
!>   unilateral  p = k_n max(d, 0),           a spring that does not pull: the laws' own,
!>   power       p = c max(d, 0)**e,          e = 3/2: Hertz,
!>   exponential p = p_0 exp(d/h),            rough surfaces, never open; straight beyond 30 h,
!>   table       p linear between given (d, p), beyond the last point with its slope.
!>
!> Laws that know curved ones take the relative displacement itself for normal input, y_n = -d, and
!> put -p in its place at the instants (`press_pairs`); a change of y_n acts with the slope p'(d).
module fw_normal_law
   use fw_contact_data, only: contact_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: normal_law, normal_words, unilateral, power, exponential, table
   public :: curved_pairs, pairs_with, bind_normal_constants, take_normal_laws, press_pairs

   !> In the order of their numbers.
   character(*), parameter :: normal_words(*) = [character(11) :: 'unilateral', 'power', &
      'exponential', 'table']
   integer, parameter :: unilateral = 1, power = 2, exponential = 3, table = 4
   !> Decay lengths from which the exponential goes on straight: 1e13 reference forces.
   real(wp), parameter :: farthest = 30.0_wp
   !> Doublings of an overclosure: from the least number to the largest.
   integer, parameter :: most_doublings = 2100

   !> The law of one pair.
   type :: normal_law
      integer :: kind = power
      !> c or p_0, for the table what multiplies its forces.
      real(wp) :: factor = 1.0_wp
      real(wp) :: exponent = 1.0_wp
      !> h [length].
      real(wp) :: decay = 1.0_wp
      !> Points of the table, from (d, 0) up.
      real(wp), allocatable :: overclosure(:), force(:)
   contains
      procedure :: press
      procedure :: proportional
      procedure :: constant_name
      procedure :: overclosure_of_slope
   end type normal_law

contains

   !> Which pairs have another law than the unilateral spring (n_pairs).
   pure function curved_pairs(contact) result(curved)
      type(contact_type), intent(in) :: contact
      logical :: curved(contact%n_pairs)

      curved = .false.
      if (allocated(contact%normal_law)) curved = contact%normal_law /= unilateral
   end function curved_pairs

   !> Which pairs have the normal law of a number (n_pairs).
   pure function pairs_with(contact, number) result(have)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: number
      logical :: have(contact%n_pairs)

      have = number == unilateral
      if (allocated(contact%normal_law)) have = contact%normal_law == number
   end function pairs_with

   !> Keys of the curved laws, which every law of friction that knows them has.
   subroutine bind_normal_constants(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical :: presses, decays

      presses = any(pairs_with(contact, power))
      decays = any(pairs_with(contact, exponential))
      associate (constants => contact%constants)
         call constants%bind(keys, key('normal_coefficient', &
                                       'c of the pressure c d**e, d the overclosure; 0 for '// &
                                       'pairs of other laws', at_least(0.0_wp), 'F/L^e', &
                                       'n_pairs', &
                                       absent="of the file, else required with 'power'"), presses)
         call constants%bind(keys, key('normal_exponent', 'e of it; 1.5: Hertz', at_least(1.0_wp), &
                                       '', 'n_pairs', absent='of the file, else 1.5'), .false.)
         call constants%bind(keys, key('reference_force', &
                                       'p_0 of the pressure p_0 exp(d/h); 0 for pairs of other '// &
                                       'laws', at_least(0.0_wp), 'F', 'n_pairs', &
                                       absent="of the file, else required with 'exponential'"), &
                             decays)
         call constants%bind(keys, key('decay_length', 'h of it; 0 for pairs of other laws', &
                                       at_least(0.0_wp), 'L', 'n_pairs', &
                                       absent="of the file, else required with 'exponential'"), &
                             decays)
      end associate
   end subroutine bind_normal_constants

   !> The laws of pairs that all are curved, with their constants; not allocated where none is.
   pure subroutine take_normal_laws(contact, normal)
      type(contact_type), intent(in) :: contact
      type(normal_law), allocatable, intent(out) :: normal(:)
      real(wp), dimension(contact%n_pairs) :: coefficient, exponent, reference, decay
      integer :: i

      if (.not. any(curved_pairs(contact))) return
      associate (constants => contact%constants, n => contact%n_pairs)
         coefficient = constants%get('normal_coefficient', n)
         exponent = constants%get('normal_exponent', n, default=1.5_wp)
         reference = constants%get('reference_force', n)
         decay = constants%get('decay_length', n, default=1.0_wp)
         allocate (normal(n))
      end associate
      do i = 1, contact%n_pairs
         normal(i)%kind = contact%normal_law(i)
         select case (normal(i)%kind)
         case (power)
            normal(i)%factor = coefficient(i)
            normal(i)%exponent = exponent(i)
         case (exponential)
            normal(i)%factor = reference(i)
            normal(i)%decay = decay(i)
         case default
            normal(i)%overclosure = contact%overclosure
            normal(i)%force = contact%table_force
         end select
         if (contact%normal_per_area) normal(i)%factor = normal(i)%factor*contact%area(i)
      end do
   end subroutine take_normal_laws

   !> Pressure of an overclosure, and its slope.
   elemental subroutine press(self, d, p, slope)
      class(normal_law), intent(in) :: self
      real(wp), intent(in) :: d
      real(wp), intent(out) :: p, slope
      integer :: k

      p = 0.0_wp
      slope = 0.0_wp
      select case (self%kind)
      case (power)
         if (d <= 0.0_wp) return
         p = self%factor*d**self%exponent
         slope = self%exponent*(p/d)
      case (exponential)
         p = self%factor*exp(min(d/self%decay, farthest))
         slope = p/self%decay
         p = p + slope*max(d - farthest*self%decay, 0.0_wp)
      case default
         associate (x => self%overclosure, y => self%force)
            if (d <= x(1)) return
            k = min(max(count(x < d), 1), size(x) - 1)
            slope = self%factor*(y(k + 1) - y(k))/(x(k + 1) - x(k))
            p = self%factor*y(k) + slope*(d - x(k))
         end associate
      end select
   end subroutine press

   !> Input whose change raises the pressure in proportion, p' dy = -p: from the input itself, y,
   !> as it is for springs. (A table has none that is linear in y.)
   elemental subroutine proportional(self, is_constant, y)
      class(normal_law), intent(in) :: self
      !> Whether y is the constant part of the input, and not one that varies.
      logical, intent(in) :: is_constant
      real(wp), intent(inout) :: y

      if (self%kind == power) then
         y = y/self%exponent
      else if (is_constant) then
         y = -self%decay
      else
         y = 0.0_wp
      end if
   end subroutine proportional

   !> The constant that the pressure is in proportion to.
   pure function constant_name(self) result(name)
      class(normal_law), intent(in) :: self
      character(24) :: name

      name = 'force'
      if (self%kind == power) name = 'normal_coefficient'
      if (self%kind == exponential) name = 'reference_force'
   end function constant_name

   !> An overclosure at which the pressure is at least as steep as a given slope, or nearly the
   !> last there is.
   pure real(wp) function overclosure_of_slope(self, wanted) result(d)
      class(normal_law), intent(in) :: self
      real(wp), intent(in) :: wanted
      real(wp) :: p, slope
      integer :: k

      select case (self%kind)
      case (power)
         d = tiny(1.0_wp)
         do k = 1, most_doublings
            call self%press(d, p, slope)
            if (slope >= wanted .or. d > 0.25_wp*huge(1.0_wp)) return
            d = 2.0_wp*d
         end do
      case (exponential)
         d = self%decay*min(log(max(wanted*self%decay/self%factor, tiny(1.0_wp))), farthest)
      case default
         d = self%overclosure(size(self%overclosure))
      end select
   end function overclosure_of_slope

   !> Put the pressure in the place of the normal input: y_n = -d becomes -p(d), whose slope by the
   !> y_n of before is left in `slope`.
   pure subroutine press_pairs(n_pairs, n_time, normal, y, slope)
      integer, intent(in) :: n_pairs, n_time
      type(normal_law), intent(in) :: normal(n_pairs)
      real(wp), intent(inout) :: y(n_pairs, 3, n_time)
      real(wp), intent(inout) :: slope(n_pairs, n_time)
      real(wp) :: p
      integer :: i, k

      do k = 1, n_time
         do i = 1, n_pairs
            call normal(i)%press(-y(i, 3, k), p, slope(i, k))
            y(i, 3, k) = -p
         end do
      end do
   end subroutine press_pairs

end module fw_normal_law
