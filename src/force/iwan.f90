!> Joints of Iwan with four parameters (Segalman 2005): Jenkins elements without number, whose
!> sliding limits phi have the density
!>
!>   rho(phi) = R phi**chi + S delta(phi - phi_max),     chi > -1.
!>
!> They slip one after the other, from the smallest motion on: in small motion the work of a cycle
!> grows with amplitude**(chi + 3). With s = y/F_S, F_S = mu N and b = (chi + 1)/(chi + 2), the
!> force on the way from the assembly is F_S f(s),
!>
!>   f(s) = s - (s/s_max)**(chi + 2)/((chi + 2)(beta + b)),  s < s_max = (1 + beta)/(beta + b),
!>
!> and 1 beyond. From a turning point (y_a, F_a) on it is F_a +- 2 F_S f(|y - y_a|/(2 F_S)); a
!> branch that comes to the turning point before goes on along the branch before (Madelung). The
!> path starts at the assembly, and one turn settles it.
module fw_iwan
   use fw_contact_data, only: contact_type
   use fw_displacement_path, only: anchor_type, displacement_path
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least
   use fw_kinds, only: wp
   use fw_pair_law, only: tangential_stiffness_key
   use fw_path_law, only: path_facts, path_law
   implicit none (type, external)
   private

   public :: iwan_friction, iwan_law

   type, extends(path_law) :: iwan_law
      !> Exponent of the density, ratio of the stiffness that is lost at once where the last
      !> elements slip to what was lost before (n_elements).
      real(wp), allocatable :: chi(:), beta(:)
   contains
      procedure :: bind_keys
      procedure :: take_constants
      procedure :: follow
      procedure :: respond
      procedure :: respond_at_rest
   end type iwan_law

contains

   pure type(iwan_law) function iwan_friction() result(law)
      law%facts = path_facts()
   end function iwan_friction

   subroutine bind_keys(self, keys, contact, slides, closes)
      class(iwan_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      associate (unused => self, unused_closes => closes, constants => contact%constants)
         call constants%bind(keys, tangential_stiffness_key(), slides)
         call constants%bind(keys, key('iwan_chi', &
                                       'work of a small cycle grows with amplitude**(chi + 3)', &
                                       above(-1.0_wp), '', 'n_pairs', &
                                       absent='of the file, else required with tangential dofs'), &
                             slides)
         call constants%bind(keys, key('iwan_beta', &
                                       'stiffness lost where the last elements slip, over that '// &
                                       'lost before', at_least(0.0_wp), '', 'n_pairs', &
                                       absent='of the file, else 0'), .false.)
      end associate
   end subroutine bind_keys

   subroutine take_constants(self, contact)
      class(iwan_law), intent(inout) :: self
      type(contact_type), intent(in) :: contact

      self%prediction%stiffness(:, 1) = contact%tangential_stiffness
      ! Pairs that do not slide need none; any will do.
      self%chi = contact%constants%get('iwan_chi', self%n_elements)
      self%beta = contact%constants%get('iwan_beta', self%n_elements)
   end subroutine take_constants

   !> f and its slope.
   elemental subroutine load_curve(chi, beta, s, f, slope)
      real(wp), intent(in) :: chi, beta, s
      real(wp), intent(out) :: f, slope
      real(wp) :: part

      part = s/largest_of(chi, beta)
      f = 1.0_wp
      slope = 0.0_wp
      if (part >= 1.0_wp) return
      part = part**(chi + 1.0_wp)/(1.0_wp + beta)
      f = s*(1.0_wp - part/(chi + 2.0_wp))
      slope = 1.0_wp - part
   end subroutine load_curve

   !> s_max.
   elemental real(wp) function largest_of(chi, beta) result(s)
      real(wp), intent(in) :: chi, beta

      s = (1.0_wp + beta)/(beta + (chi + 1.0_wp)/(chi + 2.0_wp))
   end function largest_of

   pure subroutine respond(self, element, limit, y_a, force_a, direction, y, force, slope, carry)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: limit, y_a, force_a, direction, y(:)
      real(wp), intent(out) :: force(:), slope(:), carry(:)

      associate (chi => self%chi(element), beta => self%beta(element))
         if (abs(direction) > 0.0_wp) then
            call load_curve(chi, beta, 0.5_wp*abs(y - y_a)/limit, force, slope)
            force = force_a + 2.0_wp*direction*limit*force
         else
            call load_curve(chi, beta, abs(y)/limit, force, slope)
            force = sign(limit*force, y)
         end if
      end associate
      carry = 1.0_wp
   end subroutine respond

   pure subroutine respond_at_rest(self, element, limit, y, force, slope)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: limit, y
      real(wp), intent(out) :: force, slope

      call load_curve(self%chi(element), self%beta(element), abs(y)/limit, force, slope)
      force = sign(limit*force, y)
   end subroutine respond_at_rest

   !> From the turning point that is farthest from the assembly, where nothing of before counts,
   !> with a stack of the turning points whose branches are not closed.
   pure subroutine follow(self, element, path)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element
      type(displacement_path), intent(inout) :: path
      integer :: depth, k
      real(wp) :: direction, next

      depth = 0
      direction = 0.0_wp
      do k = 1, path%n_turns
         next = sign(1.0_wp, path%y_turn(k + 1) - path%y_turn(k))
         ! Turning points that round-off puts upside down are none.
         if (k == 1 .or. direction*next < 0.0_wp) then
            call turn(self, element, path, k, direction, depth)
         end if
         direction = next
         call advance(self, element, path, k, direction, depth)
      end do
   end subroutine follow

   !> An anchor at a turning point, at the end of the branch on top.
   pure subroutine turn(self, element, path, k, direction, depth)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element, k
      type(displacement_path), intent(inout) :: path
      !> Of the branch, before it turns.
      real(wp), intent(in) :: direction
      integer, intent(inout) :: depth
      type(anchor_type) :: new
      real(wp), dimension(1) :: force, slope, carry

      new = anchor_type(path%turn(k), path%y_turn(k))
      if (depth > 0) then
         new%parent = path%stack(depth)
         associate (old => path%anchor(new%parent))
            call self%respond(element, path%limit, old%y, old%force, direction, [new%y], force, &
                              slope, carry)
         end associate
      else
         call self%respond(element, path%limit, 0.0_wp, 0.0_wp, 0.0_wp, [new%y], force, slope, &
                           carry)
      end if
      new%force = force(1)
      new%slope = slope(1)
      new%carry = carry(1)
      call path%add_anchor(new)
      depth = depth + 1
      path%stack(depth) = path%n_anchors
   end subroutine turn

   !> From a turning point to the next, over the loops that are closed on the way.
   pure subroutine advance(self, element, path, k, direction, depth)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element, k
      type(displacement_path), intent(inout) :: path
      real(wp), intent(in) :: direction
      integer, intent(inout) :: depth
      real(wp) :: at, passed
      logical :: closes

      at = path%turn(k)
      closes = .true.
      do while (closes)
         if (depth == 0) then
            ! Beyond all turning points by round-off.
            call path%add_piece(at, path%turn(k + 1), 0, 0.0_wp)
            return
         end if
         closes = .false.
         passed = path%turn(k + 1)
         if (depth > 1) then
            associate (before => path%anchor(path%stack(depth - 1)))
               closes = direction*(path%y_turn(k + 1) - before%y) >= 0.0_wp
               if (closes) passed = path%angle_of(before%y, k, at)
            end associate
         end if
         call add_branch(self, element, path, k, direction, path%stack(depth), at, passed)
         at = passed
         if (closes) depth = depth - 2
      end do
   end subroutine advance

   !> A branch, in two pieces where all elements slip on the way.
   pure subroutine add_branch(self, element, path, k, direction, anchor, start, end)
      class(iwan_law), intent(in) :: self
      integer, intent(in) :: element, k, anchor
      type(displacement_path), intent(inout) :: path
      real(wp), intent(in) :: direction, start, end
      real(wp) :: middle

      middle = path%angle_of(path%anchor(anchor)%y + 2.0_wp*direction*path%limit* &
                             largest_of(self%chi(element), self%beta(element)), k, start)
      middle = min(middle, end)
      call path%add_piece(start, middle, anchor, direction)
      call path%add_piece(middle, end, anchor, direction)
   end subroutine add_branch

end module fw_iwan
