!> Hysteresis of Bouc and Wen, lambda_t = mu N z with
!>
!>   dz/ds = 1 - |z|**n (beta sgn(z ds) + 1 - beta),    s = y/(mu N),  n = 1 or 2,
!>
!> in closed form between turning points. With w = z sgn(ds), d the way from where it begins and
!> c = 2 beta - 1: where w < 0, |w| falls to 0 with slope 1 + c |w|**n, and from there on w rises
!> to 1 with slope 1 - w**n. The force is the one that repeats after a period; at rest there is
!> none.
module fw_bouc_wen
   use fw_contact_data, only: contact_type
   use fw_displacement_path, only: anchor_type, displacement_path
   use fw_key, only: key, key_visitor
   use fw_key_range, only: at_least, at_most, operator(.and.), whole
   use fw_kinds, only: wp
   use fw_pair_law, only: tangential_stiffness_key
   use fw_path_law, only: path_facts, path_law
   implicit none (type, external)
   private

   public :: bouc_wen_friction, bouc_wen_law

   type, extends(path_law) :: bouc_wen_law
      !> n and beta (n_elements).
      integer, allocatable :: exponent(:)
      real(wp), allocatable :: beta(:)
   contains
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: follow
      procedure :: respond
      procedure :: respond_at_rest
   end type bouc_wen_law

   !> Turns before the start that repeats is looked for by Newton's method.
   integer, parameter :: plain_turns = 4
   integer, parameter :: newton_steps = 100
   !> Change of the start over the largest |z| that is round-off.
   real(wp), parameter :: round_off = 4.0_wp*epsilon(1.0_wp)

contains

   pure type(bouc_wen_law) function bouc_wen_friction() result(law)
      law%facts = path_facts()
   end function bouc_wen_friction

   subroutine bind_keys(self, keys, contact, slides, closes)
      class(bouc_wen_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      associate (unused => self, unused_closes => closes, constants => contact%constants)
         call constants%bind(keys, tangential_stiffness_key(), slides)
         call constants%bind(keys, key('bouc_wen_exponent', &
                                       'n of abs(z)**n: how sharp the turn to the limit is', &
                                       whole(1, 2), '', 'n_pairs', absent='of the file, else 1'), &
                             .false.)
         call constants%bind(keys, key('bouc_wen_beta', &
                                       '0.5 unloads with the tangential stiffness, 1 from the '// &
                                       'limit with twice of it', &
                                       at_least(0.5_wp) .and. at_most(1.0_wp), '', 'n_pairs', &
                                       absent='of the file, else 0.5'), .false.)
      end associate
   end subroutine bind_keys

   subroutine take_constants(self, contact)
      class(bouc_wen_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      self%prediction%stiffness(:, 1) = contact%tangential_stiffness
      self%exponent = nint(contact%constants%get('bouc_wen_exponent', self%n_elements, 1.0_wp))
      self%beta = contact%constants%get('bouc_wen_beta', self%n_elements, 0.5_wp)
   end subroutine take_constants

   !> w at the way d from w_a, its slope by d, and the logarithm of its derivative by w_a, which is
   !> the ratio of the slopes at both ends.
   elemental subroutine move(exponent, beta, w_a, d, w, slope, log_carry)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: beta, w_a, d
      real(wp), intent(out) :: w, slope, log_carry
      real(wp) :: crossing, log_further, start

      start = w_a
      log_carry = 0.0_wp
      crossing = 0.0_wp
      if (w_a < 0.0_wp) then
         crossing = way_to_zero(exponent, beta, -w_a)
         call fall(exponent, beta, -w_a, min(d, crossing), w, slope, log_carry)
         w = -w
         if (d <= crossing) return
         start = 0.0_wp
      end if
      call rise(exponent, start, d - crossing, w, slope, log_further)
      log_carry = log_carry + log_further
   end subroutine move

   !> d to where w passes 0, from v = -w.
   elemental real(wp) function way_to_zero(exponent, beta, v) result(d)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: beta, v
      real(wp) :: c, x

      c = 2.0_wp*beta - 1.0_wp
      x = merge(c, sqrt(c), exponent == 1)*v
      d = v
      ! log(1 + x)/x and atan(x)/x.
      if (exponent == 1) then
         if (x > 0.0_wp) d = v*log_1_over(x)
      else if (x > 0.0_wp) then
         d = v*atan(x)/x
      end if
   end function way_to_zero

   !> log(1 + x)/x for x > 0, to the last digits where x is small.
   elemental real(wp) function log_1_over(x) result(ratio)
      real(wp), intent(in) :: x
      real(wp) :: u

      u = 1.0_wp + x
      ratio = 1.0_wp
      ! Kahan: the rounding of 1 + x divides out.
      if (u > 1.0_wp) ratio = log(u)/(u - 1.0_wp)
   end function log_1_over

   !> exp(x) - 1.
   elemental real(wp) function exp_1(x) result(value)
      real(wp), intent(in) :: x

      value = tanh(0.5_wp*x)*(exp(x) + 1.0_wp)
   end function exp_1

   !> v = |w| on its way to 0.
   elemental subroutine fall(exponent, beta, v_a, d, v, slope, log_carry)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: beta, v_a, d
      real(wp), intent(out) :: v, slope, log_carry
      real(wp) :: c, t

      c = 2.0_wp*beta - 1.0_wp
      if (exponent == 1) then
         ! v + 1/c falls as exp(-c d).
         v = v_a - d
         if (c*d > 0.0_wp) v = v_a + exp_1(-c*d)*(v_a + 1.0_wp/c)
         v = max(v, 0.0_wp)
         log_carry = -c*d
         slope = 1.0_wp + c*v
      else
         c = sqrt(c)
         t = d
         if (c > 0.0_wp) t = tan(c*d)/c
         v = max((v_a - t)/(1.0_wp + c**2*v_a*t), 0.0_wp)
         slope = 1.0_wp + (c*v)**2
         log_carry = log(slope/(1.0_wp + (c*v_a)**2))
      end if
   end subroutine fall

   !> w >= 0 on its way to 1.
   elemental subroutine rise(exponent, w_a, d, w, slope, log_carry)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: w_a, d
      real(wp), intent(out) :: w, slope, log_carry
      real(wp) :: t

      if (exponent == 1) then
         w = w_a - exp_1(-d)*(1.0_wp - w_a)
         log_carry = -d
         slope = (1.0_wp - w_a)*exp(-d)
      else
         t = tanh(d)
         w = (w_a + t)/(1.0_wp + w_a*t)
         ! 1/(cosh d + w_a sinh d)**2, of which the exponential is apart.
         log_carry = -2.0_wp*(d + log(0.5_wp*(1.0_wp + w_a + (1.0_wp - w_a)*exp(-2.0_wp*d))))
         slope = (1.0_wp - w_a**2)*exp(log_carry)
      end if
   end subroutine rise

   pure subroutine respond(self, element, limit, y_a, force_a, direction, y, force, slope, carry)
      class(bouc_wen_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: limit, y_a, force_a, direction, y(:)
      real(wp), intent(out) :: force(:), slope(:), carry(:)

      call move(self%exponent(element), self%beta(element), direction*force_a/limit, &
                abs(y - y_a)/limit, force, slope, carry)
      force = direction*limit*force
      carry = exp(carry)
   end subroutine respond

   !> A pair at rest bears nothing.
   pure subroutine respond_at_rest(self, element, limit, y, force, slope)
      class(bouc_wen_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: limit, y
      real(wp), intent(out) :: force, slope

      force = 0.0_wp
      slope = 0.0_wp
      associate (unused => self, unused_element => element, unused_limit => limit, unused_y => y)
      end associate
   end subroutine respond_at_rest

   !> From turning point to turning point, with the start that repeats.
   pure subroutine follow(self, element, path)
      class(bouc_wen_law), intent(in) :: self
      integer, intent(in) :: element
      type(displacement_path), intent(inout) :: path
      real(wp) :: z, z_end, log_carry
      real(wp) :: middle, w, slope
      type(anchor_type) :: next
      integer :: k

      associate (n => self%exponent(element), beta => self%beta(element), &
                 way => path%way(:path%n_turns))
         way = (path%y_turn(2:path%n_turns + 1) - path%y_turn(:path%n_turns))/path%limit
         call find_start(n, beta, way, z)
         call march(n, beta, way, z, z_end, log_carry)
         path%repeats = .true.
         path%contraction = -exp_1(log_carry)
         path%drift = path%limit*abs(z_end - z)
         next = anchor_type(path%turn(1), path%y_turn(1), path%limit*z)
         do k = 1, path%n_turns
            call path%add_anchor(next)
            ! In two pieces where z passes 0.
            w = sign(1.0_wp, way(k))*z
            middle = path%turn(k)
            if (w < 0.0_wp) middle = path%angle_of(path%y_turn(k) + sign(path%limit* &
                                     way_to_zero(n, beta, -w), way(k)), k, middle)
            call path%add_piece(path%turn(k), middle, k, sign(1.0_wp, way(k)))
            call path%add_piece(middle, path%turn(k + 1), k, sign(1.0_wp, way(k)))
            call move(n, beta, w, abs(way(k)), z, slope, log_carry)
            z = sign(1.0_wp, way(k))*z
            next = anchor_type(path%turn(k + 1), path%y_turn(k + 1), path%limit*z, k, slope, &
                               exp(log_carry))
         end do
      end associate
      path%last = next
   end subroutine follow

   !> A turn from z: where it ends, and the logarithm of the derivative by the start.
   pure subroutine march(exponent, beta, way, z, z_end, log_carry)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: beta, way(:), z
      real(wp), intent(out) :: z_end, log_carry
      real(wp) :: further, slope, w
      integer :: k

      z_end = z
      log_carry = 0.0_wp
      do k = 1, size(way)
         call move(exponent, beta, sign(1.0_wp, way(k))*z_end, abs(way(k)), w, slope, further)
         z_end = sign(1.0_wp, way(k))*w
         log_carry = log_carry + further
      end do
   end subroutine march

   !> The start that repeats. A turn contracts, so that there is one: Newton's method within a
   !> bracket.
   pure subroutine find_start(exponent, beta, way, z)
      integer, intent(in) :: exponent
      real(wp), intent(in) :: beta, way(:)
      real(wp), intent(out) :: z
      real(wp) :: contraction, high, log_carry, low, newton, step, z_end
      integer :: k

      z = 0.0_wp
      do k = 1, plain_turns
         call march(exponent, beta, way, z, z_end, log_carry)
         z = z_end
      end do
      low = -1.0_wp
      high = 1.0_wp
      do k = 1, newton_steps
         call march(exponent, beta, way, z, z_end, log_carry)
         if (z_end > z) then
            low = z
         else
            high = z
         end if
         contraction = -exp_1(log_carry)
         step = 0.5_wp*(low + high) - z
         if (contraction > 0.0_wp) then
            newton = (z_end - z)/contraction
            if (z + newton >= low .and. z + newton <= high) step = newton
         end if
         z = z + step
         ! No |z| of the turn is below half of the longest way, or 1.
         if (abs(step) <= round_off*min(1.0_wp, maxval(abs(way)))) return
      end do
   end subroutine find_start

end module fw_bouc_wen
