!> Vibration and wear depth together, at the end of an implicit step over many cycles:
!>
!>   R(q, w) = 0,     w - base - cycles rate(q, w) = 0,     rate = (k_w / A) S / eps
!>
!> with S the sliding under pressure over a period (fw_slip). Unknowns are those of the balance,
!> then one depth per pair. Where a pair sticks or stays open, its depth leaves the linear problem:
!> it equals the base. The derivative dR/dw = B^T G eps e_0 and that of the rate are exact.
!>
!> The depths are further unknowns of an augmented system, the growth of each its condition; at held
!> depths the vibration is solved by itself, as any balance.
!>
!> A pair wears by its own sliding alone, which follows from its own inputs y. With s the gradient
!> of its growth by them (cycles times rate), a step of its depth is
!>
!>   dw = (s^T dy - g/weight)/D,   D = 1 - eps s_0,
!>
!> and what that does to its forces is one more term of rank one of its derivative,
!>
!>   G + eps G e_0 s^T/D.
!>
!> So the depths of slipping pairs leave the linear problem as well: what is left is that of a
!> vibration, and the preconditioner knows what wear does to a pair. With the depths as a border
!> around the preconditioner of the vibration alone GMRES takes two to four times as many
!> iterations in long steps. Only pairs of which D all but vanishes keep their depths there.
module fw_wear_system
   use fw_augmented_system, only: augmented_system
   use fw_balance_state, only: balance_state
   use fw_contact_data, only: contact_type
   use fw_error, only: error_type
   use fw_force_law, only: force_workspace, pair_mixed, pair_stuck
   use fw_kinds, only: i8, wp
   use fw_lapack, only: dgemm
   use fw_tall_product, only: multiply_transposed
   implicit none (type, external)
   private

   public :: wear_system, new_wear_system

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp)

   type, extends(augmented_system) :: wear_system
      !> The inner system; its depths are those of the last point.
      type(balance_state), pointer :: vibration => null()
      !> Cycles of the step, and the depth that it starts from (n_pairs) [length].
      real(wp) :: cycles = 0.0_wp
      real(wp), allocatable :: base(:)
      !> Depth per cycle [length] at the last point (n_pairs).
      real(wp), allocatable :: rate(:)
      !> From S to the rate: k_w/(A eps), by energy times mu, and whether it is so (n_pairs).
      real(wp), allocatable, private :: factor(:), by_slip(:)
      logical, private :: by_energy = .false.
      !> Friction that wear leads to, and the largest on the way; not allocated where it stays.
      real(wp), allocatable, private :: mu_final(:), mu_largest(:)
      !> Prediction stiffness in the normal direction (n_pairs) [force/length].
      real(wp), allocatable, private :: normal(:)
      !> Makes a force of a depth: the same, or where there is none the tangential one (n_pairs).
      real(wp), allocatable, private :: weight(:)
      !> Pairs whose depth stays in the linear problem (first n_linear_extra entries).
      integer, allocatable, private :: wearing(:)
      !> D below which a depth stays there.
      real(wp) :: least_pivot = 0.1_wp
      !> D of the pairs whose depth has left the linear problem though they slip, 0 of all others;
      !> their eps G e_0; and what pinned coordinates do to their sliding (n_pairs).
      real(wp), allocatable, private :: pivot(:)
      real(wp), allocatable, private :: response(:, :)
      real(wp), allocatable, private :: pinned_slide(:)
      !> Of the preconditioner: the rows g_q (n_linear_inner, n_linear_extra), and the pairs that
      !> they are of.
      real(wp), allocatable, private :: slopes(:, :)
      integer, allocatable, private :: built_for(:)
      !> Of a vector what they make of it (n_pairs).
      real(wp), allocatable, private :: turned(:)
      !> Where the vibration was evaluated last, depths included, its residual there, and its count
      !> of moves then.
      real(wp), allocatable, private :: last_x(:), last_r(:)
      integer(i8), private :: last_move = -1_i8
   contains
      procedure :: residual
      procedure :: remember
      procedure :: begin_step
      procedure :: n_vibration
      procedure :: update_rate
      procedure :: hold_depths
      procedure :: force_of_depth
      procedure :: mean_pressure
      procedure :: openings
      procedure :: compression
      procedure :: depth_scale
      procedure :: friction
      procedure :: friction_rests
      procedure :: slides
      procedure :: take
      procedure :: conditions
      procedure :: choose
      procedure :: settle
      procedure :: reduce_rows
      procedure :: expand_extra
      procedure :: add_columns
      procedure :: rows
      procedure :: subtract_rows
      procedure :: corner
      procedure :: preconditioner_fits
   end type wear_system

contains

   !> Add wear to a balance, which has to live as long.
   subroutine new_wear_system(balance, contact, coefficient, by_energy, self)
      type(balance_state), intent(inout), target :: balance
      type(contact_type), intent(in) :: contact
      !> Wear coefficient k_w of every pair (n_pairs) [area/force].
      real(wp), intent(in) :: coefficient(:)
      !> The coefficient multiplies friction energy (mu p ds) instead of p ds.
      logical, intent(in) :: by_energy
      type(wear_system), intent(out) :: self
      real(wp) :: tangential(contact%n_pairs)

      self%vibration => balance
      call self%augment(balance, contact%n_pairs)
      associate (problem => balance%problem)
         call balance%work(problem%forces%pairs)%measure_slip()
         associate (p => problem%forces%entry(problem%forces%pairs)%law%prediction)
            ! S takes the path in units of force, eps u: the rate divides by eps.
            tangential = maxval(p%stiffness(:, 1:2), dim=2)
            self%normal = p%stiffness(:, 3)
         end associate
      end associate
      allocate (self%base(contact%n_pairs), self%rate(contact%n_pairs), source=0.0_wp)
      allocate (self%by_slip(contact%n_pairs), source=0.0_wp)
      where (tangential > 0.0_wp) self%by_slip = coefficient/(contact%area*tangential)
      self%factor = self%by_slip
      self%by_energy = by_energy
      if (allocated(contact%worn_friction)) then
         self%mu_final = contact%worn_friction%final
         self%mu_largest = max(contact%mu, self%mu_final)
      end if
      if (by_energy) self%factor = contact%mu*self%by_slip
      self%weight = self%normal
      where (self%weight <= 0.0_wp) self%weight = tangential
      where (self%weight <= 0.0_wp) self%weight = 1.0_wp
      allocate (self%wearing(contact%n_pairs), source=0)
      allocate (self%turned(contact%n_pairs), source=0.0_wp)
      allocate (self%pivot(contact%n_pairs), self%pinned_slide(contact%n_pairs), source=0.0_wp)
      allocate (self%response(3*balance%problem%fourier%n_coefficients, contact%n_pairs), &
                source=0.0_wp)
   end subroutine new_wear_system

   !> Unknowns of the vibration; the depths follow them.
   pure integer function n_vibration(self)
      class(wear_system), intent(in) :: self

      n_vibration = self%vibration%n
   end function n_vibration

   !> State the step: residuals are those of its end from now on.
   subroutine begin_step(self, base, cycles)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: base(:), cycles

      self%base = base
      self%cycles = cycles
      call self%offer_nearly()
   end subroutine begin_step

   !> Rates at the last point of the balance.
   subroutine update_rate(self)
      class(wear_system), intent(inout) :: self

      associate (work => self%vibration%work(self%vibration%problem%forces%pairs))
         ! Friction may change with the depth.
         if (self%by_energy) self%factor = work%mu*self%by_slip
         self%rate = self%factor*work%slip
      end associate
   end subroutine update_rate

   !> Whether the vibration is solved by itself from now on: nobody wants derivatives of the rates
   !> then.
   subroutine hold_depths(self, are_held)
      class(wear_system), intent(inout) :: self
      logical, intent(in) :: are_held

      self%vibration%work(self%vibration%problem%forces%pairs)%differentiates_slip = &
         .not. are_held
   end subroutine hold_depths

   !> Whether a pair slides under pressure at the last point.
   pure logical function slides(self)
      class(wear_system), intent(in) :: self

      slides = maxval(self%vibration%work(self%vibration%problem%forces%pairs)%slip) > 0.0_wp
   end function slides

   !> Friction coefficients at the depths of the last point.
   pure function friction(self) result(mu)
      class(wear_system), intent(in) :: self
      real(wp) :: mu(self%n_extra)

      mu = self%vibration%work(self%vibration%problem%forces%pairs)%mu
   end function friction

   !> Whether no friction is further from where wear leads it than this part of its range.
   pure logical function friction_rests(self, part) result(rests)
      class(wear_system), intent(in) :: self
      real(wp), intent(in) :: part

      rests = .true.
      if (allocated(self%mu_final)) rests = all(abs(self%friction() - self%mu_final) <= &
                                                part*self%mu_largest)
   end function friction_rests

   !> Depths in the units in which residuals count them [force].
   pure function force_of_depth(self, depth) result(force)
      class(wear_system), intent(in) :: self
      real(wp), intent(in) :: depth(:)
      real(wp) :: force(size(depth))

      force = self%weight*depth
   end function force_of_depth

   !> Mean compressive force of every pair at the last point [force].
   pure function mean_pressure(self) result(pressure)
      class(wear_system), intent(in) :: self
      real(wp) :: pressure(self%n_extra)

      associate (problem => self%vibration%problem)
         associate (pairs => problem%forces%pairs, row => problem%joint%row)
            pressure = problem%forces%entry(pairs)%law%prediction%load
            where (row(3, :) > 0) pressure = -self%vibration%work(pairs)%force(:, 3, 1)
         end associate
      end associate
   end function mean_pressure

   !> Mean opening of every pair at the last point [length]; zero where it bears in the mean.
   pure function openings(self) result(opening)
      class(wear_system), intent(in) :: self
      real(wp) :: opening(self%n_extra)

      opening = 0.0_wp
      associate (problem => self%vibration%problem)
         associate (work => self%vibration%work(problem%forces%pairs))
            where (problem%joint%row(3, :) > 0 .and. self%normal > 0.0_wp) &
               opening = max(0.0_wp, work%prediction(:, 3, 1) + work%offset)/self%normal
         end associate
      end associate
   end function openings

   !> Largest elastic compression of a pair at the last point: the depth that would unload it
   !> alone [length]. Pairs pressed by dead loads do not count; zero where all are.
   pure real(wp) function compression(self)
      class(wear_system), intent(in) :: self
      real(wp) :: pressure(self%n_extra), stiffness
      integer :: i

      compression = 0.0_wp
      pressure = self%mean_pressure()
      associate (problem => self%vibration%problem)
         do i = 1, self%n_extra
            if (problem%joint%row(3, i) == 0) cycle
            stiffness = self%normal(i)
            if (takes_balance(self, i)) then
               stiffness = problem%structure%static_stiffness(problem%coordinate_of(3, i))
            end if
            if (stiffness > 0.0_wp) compression = max(compression, pressure(i)/stiffness)
         end do
      end associate
   end function compression

   !> Depth with which steps may start [length]: the compression, or the slide of a pair under a
   !> dead load.
   pure real(wp) function depth_scale(self)
      class(wear_system), intent(in) :: self

      depth_scale = self%compression()
      if (depth_scale <= 0.0_wp) depth_scale = maxval(self%mean_pressure()/self%weight)
   end function depth_scale

   !> R and g at (q, w). A step begins where the one before was judged, and R does not know the
   !> cycles: there it is known.
   subroutine residual(self, x, r)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: n

      n = self%n_vibration()
      if (stands_at(self, x)) then
         r(:n) = self%last_r
      else
         self%vibration%depth = x(n + 1:)
         call self%vibration%residual(x(:n), r(:n))
         call self%remember(x, r(:n))
      end if
      call self%conditions(x(:n), x(n + 1:), r(n + 1:))
      if (.not. self%holds_reference) self%reference = self%vibration%reference
   end subroutine residual

   !> The vibration was evaluated last at x, and has this residual.
   subroutine remember(self, x, r)
      class(wear_system), intent(inout) :: self
      !> (n), (n_vibration)
      real(wp), intent(in) :: x(:), r(:)

      self%last_x = x
      self%last_r = r
      self%last_move = self%vibration%moves()
   end subroutine remember

   !> Whether the vibration has not been evaluated elsewhere since it was at x.
   pure logical function stands_at(self, x)
      type(wear_system), intent(in) :: self
      real(wp), intent(in) :: x(:)

      stands_at = self%last_move == self%vibration%moves()
      ! Depths may have been moved without an evaluation.
      if (stands_at) stands_at = all(abs(x - self%last_x) <= 0.0_wp)
      if (stands_at) stands_at = all(abs(self%vibration%depth - x(self%n_vibration() + 1:)) <= &
                                     0.0_wp)
   end function stands_at

   !> Hold the vibration at depths; any will do.
   subroutine take(self, z, error)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: z(:)
      type(error_type), allocatable, intent(out) :: error

      associate (unused => error)
      end associate
      self%vibration%depth = z
   end subroutine take

   !> Growth of the depths times a stiffness: forces, as the residuals of the balance are, so that
   !> one norm measures both.
   subroutine conditions(self, q, z, g)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: q(:), z(:)
      real(wp), intent(out) :: g(:)

      associate (unused => q)
      end associate
      call self%update_rate()
      g = self%weight*(z - self%base - self%cycles*self%rate)
   end subroutine conditions

   !> The depth of a pair that always bears moves its normal component: that one stays, too.
   subroutine choose(self)
      class(wear_system), intent(inout) :: self
      integer :: i

      self%vibration%pins_normals = .false.
      call self%vibration%linearize(self%n_linear_inner)
      self%n_linear_extra = 0
      self%n_eliminated = 0
      self%pivot = 0.0_wp
      associate (pairs => self%vibration%problem%forces%pairs)
         do i = 1, self%n_extra
            ! Sliding under pressure of all others is zero around here, and so is its derivative.
            if (self%vibration%work(pairs)%linear_state(i) /= pair_mixed) cycle
            if (self%vibration%problem%joint%row(3, i) > 0) call find_response(self, i)
            self%pivot(i) = 1.0_wp - self%cycles*self%factor(i)*depth_slope(self, i)
            if (abs(self%pivot(i)) < self%least_pivot) then
               self%pivot(i) = 0.0_wp
               self%n_linear_extra = self%n_linear_extra + 1
               self%wearing(self%n_linear_extra) = i
               cycle
            end if
            self%n_eliminated = self%n_eliminated + 1
            if (self%vibration%problem%joint%row(3, i) > 0) then
               call eliminate(self, i, self%vibration%work(pairs)%jacobian(:, :, i))
            end if
         end do
         call self%vibration%take_near(pairs, alteration=self%cycles)
      end associate
      self%vibration%pins_normals = .true.
   end subroutine choose

   !> What the depth does to the forces of a pair: by its normal input, and by its friction, which
   !> acts on what presses alone, T(mu y_n).
   subroutine find_response(self, pair)
      class(wear_system), intent(inout) :: self
      integer, intent(in) :: pair
      integer :: c, i, nc

      associate (work => self%vibration%work(self%vibration%problem%forces%pairs))
         nc = self%vibration%problem%fourier%n_coefficients
         do c = 1, 3
            ! What a component that is not there would be pushed by was never filled.
            if (self%vibration%problem%joint%row(c, pair) == 0) cycle
            do i = (c - 1)*nc + 1, c*nc
               self%response(i, pair) = self%normal(pair)*work%jacobian(2*nc + 1, i, pair)
               if (c < 3 .and. abs(work%mu_growth(pair)) > 0.0_wp) then
                  self%response(i, pair) = self%response(i, pair) + work%mu_growth(pair)* &
                                           by_normal(work, pair, work%jacobian(:, i, pair))
               end if
            end do
         end do
      end associate
   end subroutine find_response

   !> A derivative along the whole normal input of a pair.
   pure real(wp) function by_normal(work, pair, gradient) result(slope)
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      real(wp), intent(in) :: gradient(:)
      integer :: nc

      nc = size(work%prediction, 3)
      slope = dot_product(gradient(2*nc + 1:3*nc), work%prediction(pair, 3, :)) + &
              gradient(2*nc + 1)*work%offset(pair)
   end function by_normal

   !> The derivative of a pair whose depth follows its sliding.
   subroutine eliminate(self, pair, jacobian)
      class(wear_system), intent(inout) :: self
      integer, intent(in) :: pair
      !> (input, output)
      real(wp), intent(inout) :: jacobian(:, :)
      real(wp) :: factor
      integer :: c, i, nc

      nc = self%vibration%problem%fourier%n_coefficients
      factor = self%cycles*self%factor(pair)/self%pivot(pair)
      associate (response => self%response(:, pair), &
                 slope => self%vibration%work(self%vibration%problem%forces%pairs)% &
                 slip_derivative(:, pair))
         do c = 1, 3
            ! What a component that is not there would be pushed by was never filled.
            if (self%vibration%problem%joint%row(c, pair) == 0) cycle
            do i = (c - 1)*nc + 1, c*nc
               jacobian(:, i) = jacobian(:, i) + factor*response(i)*slope
            end do
         end do
      end associate
   end subroutine eliminate

   !> Depths that leave the linear problem take their residuals first; those that stay act on no
   !> row that leaves it.
   subroutine settle(self, g, dz, r)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: g(:), dz(:)
      real(wp), intent(inout), contiguous :: r(:)
      integer :: c, i, m, nc, row

      associate (unused => dz)
      end associate
      associate (problem => self%vibration%problem, &
                 work => self%vibration%work(self%vibration%problem%forces%pairs))
         ! `reduce` finds there what the coordinates that are solved at once do to the inputs.
         work%input = 0.0_wp
         if (.not. problem%fourier%has_constant()) return
         m = problem%structure%n_coordinates
         nc = problem%fourier%n_coefficients
         do i = 1, self%n_extra
            row = problem%joint%row(3, i)
            if (row > 0 .and. abs(self%pivot(i)) > 0.0_wp) then
               do c = 1, 3
                  if (problem%joint%row(c, i) == 0) cycle
                  call problem%incidence%scatter_row( &
                     problem%joint%row(c, i), problem%incidence%identity, m, m, &
                     -g(i)/(self%weight(i)*self%pivot(i)), &
                     self%response((c - 1)*nc + 1:c*nc, i), r)
               end do
            end if
            ! dw = -g/weight shifts the normal prediction by eps dw, which a stuck pair transmits
            ! (G = 1): the residual changes by B^T eps e_0 dw. An open pair transmits nothing.
            if (row == 0 .or. work%linear_state(i) /= pair_stuck) cycle
            call problem%incidence%scatter_row(row, problem%incidence%identity, m, m, &
                                               -self%normal(i)/self%weight(i), g(i:i), r)
         end do
      end associate
   end subroutine settle

   !> -g of the depths that stay, with what the coordinates solved at once do to their sliding; of
   !> those that have left only the latter.
   subroutine reduce_rows(self, r, g, rhs)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), g(:)
      real(wp), intent(out), contiguous :: rhs(:)
      integer :: i, j

      associate (work => self%vibration%work(self%vibration%problem%forces%pairs), unused => r)
         do j = 1, self%n_linear_extra
            i = self%wearing(j)
            rhs(j) = -g(i) + self%weight(i)*self%cycles*self%factor(i)* &
                     dot_product(work%slip_derivative(:, i), work%input(:, i))
         end do
         call take_slides(self, self%pinned_slide)
      end associate
   end subroutine reduce_rows

   !> What the inputs of the last product do to the sliding of the pairs whose depth has left.
   subroutine take_slides(self, slide)
      class(wear_system), intent(in) :: self
      real(wp), intent(out) :: slide(:)
      integer :: i

      slide = 0.0_wp
      associate (work => self%vibration%work(self%vibration%problem%forces%pairs))
         do i = 1, self%n_extra
            if (abs(self%pivot(i)) <= 0.0_wp) cycle
            slide(i) = dot_product(work%slip_derivative(:, i), work%input(:, i))
         end do
      end associate
   end subroutine take_slides

   !> Depths outside of the linear problem go to their base, or follow the sliding of their pair.
   subroutine expand_extra(self, g, v, solution, dz)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: g(:), solution(:)
      real(wp), intent(in), contiguous :: v(:)
      real(wp), intent(out) :: dz(:)
      real(wp) :: slide(self%n_extra), product(size(v))
      integer :: j

      dz = -g/self%weight
      if (any(abs(self%pivot) > 0.0_wp)) then
         ! As nearly as the solution was found.
         self%vibration%asked = self%last_asked
         call self%vibration%apply(v, product)
         self%vibration%asked = 0.0_wp
         call take_slides(self, slide)
         where (abs(self%pivot) > 0.0_wp)
            dz = (dz + self%cycles*self%factor*(slide + self%pinned_slide))/self%pivot
         end where
      end if
      do j = 1, self%n_linear_extra
         dz(self%wearing(j)) = solution(j)
      end do
   end subroutine expand_extra

   !> Depths act on the forces of their pairs: product + sum of B^T G eps e_0 depth.
   subroutine add_columns(self, dz, product)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: dz(:)
      real(wp), intent(inout), contiguous :: product(:)
      integer :: c, i, j, nc

      associate (problem => self%vibration%problem, active => self%vibration%active)
         nc = problem%fourier%n_coefficients
         do j = 1, self%n_linear_extra
            i = self%wearing(j)
            ! A pair under a dead load keeps its pressure, however deep it wears.
            if (problem%joint%row(3, i) == 0 .or. abs(dz(j)) <= 0.0_wp) cycle
            do c = 1, 3
               if (problem%joint%row(c, i) == 0) cycle
               call problem%incidence%scatter_row( &
                  problem%joint%row(c, i), active%place, active%n_active, active%n_active, &
                  dz(j), self%response((c - 1)*nc + 1:c*nc, i), product)
            end do
         end do
      end associate
   end subroutine add_columns

   !> The product of the balance has left the inputs of the pairs.
   subroutine rows(self, v, dz, product)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: v(:), dz(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: i, j

      associate (work => self%vibration%work(self%vibration%problem%forces%pairs), unused => v)
         do j = 1, self%n_linear_extra
            i = self%wearing(j)
            ! S depends on the inputs by its gradient, and on the depth by that of the mean normal
            ! input.
            product(j) = self%weight(i)*(dz(j) - self%cycles*self%factor(i)*( &
                         dot_product(work%slip_derivative(:, i), work%input(:, i)) + &
                         depth_slope(self, i)*dz(j)))
         end do
      end associate
   end subroutine rows

   !> dS/dw of a pair at fixed displacements.
   pure real(wp) function depth_slope(self, pair) result(slope)
      class(wear_system), intent(in) :: self
      integer, intent(in) :: pair

      slope = 0.0_wp
      associate (problem => self%vibration%problem)
         if (problem%joint%row(3, pair) == 0) return
         associate (work => self%vibration%work(problem%forces%pairs))
            slope = self%normal(pair)*work%slip_derivative( &
                    2*problem%fourier%n_coefficients + 1, pair)
            if (.not. abs(work%mu_growth(pair)) > 0.0_wp) return
            ! S(y_t, mu y_n)/mu in terms of mu y_n: mu dS/dmu is S by y_n, less S. By energy the
            ! rate has a factor mu more.
            slope = slope + work%mu_growth(pair)*by_normal(work, pair, &
                                                           work%slip_derivative(:, pair))
            if (.not. self%by_energy) slope = slope - work%mu_growth(pair)*work%slip(pair)
         end associate
      end associate
   end function depth_slope

   !> g_z without what the depths do through the vibration: pairs wear by their own sliding, so that
   !> it is diagonal.
   subroutine corner(self, matrix)
      class(wear_system), intent(inout) :: self
      real(wp), intent(out) :: matrix(:, :)
      integer :: i, j

      matrix = 0.0_wp
      do j = 1, self%n_linear_extra
         i = self%wearing(j)
         matrix(j, j) = self%weight(i)* &
                        (1.0_wp - self%cycles*self%factor(i)*depth_slope(self, i))
      end do
   end subroutine corner

   !> Whether a pair takes the balance: its prediction needs Z_n z.
   pure logical function takes_balance(self, pair)
      class(wear_system), intent(in) :: self
      integer, intent(in) :: pair

      associate (forces => self%vibration%problem%forces)
         takes_balance = forces%entry(forces%pairs)%law%prediction%takes(pair)
      end associate
   end function takes_balance

   !> Of the balance that the pairs take, the structure alone.
   subroutine subtract_rows(self, v, rows, is_built)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: v(:, :)
      real(wp), intent(inout) :: rows(:, :)
      logical, intent(in) :: is_built
      integer :: k, n

      if (.not. is_built) call find_slopes(self)
      k = self%n_linear_inner
      n = self%n_linear_extra
      if (size(v, 2) == 1) then
         ! A product of matrices would pack the slopes for one column.
         call multiply_transposed(k, n, self%slopes, v, self%turned)
         rows(:n, 1) = rows(:n, 1) - self%turned(:n)
         return
      end if
      call dgemm('T', 'N', n, size(v, 2), k, -1.0_wp, self%slopes, max(1, k), v, &
                 max(1, size(v, 1)), 1.0_wp, rows, size(rows, 1))
   end subroutine subtract_rows

   !> The rows g_q of the depths that stay, as vectors of the active coordinates: the gradient of
   !> the sliding turned back into coordinates. A row of sliding reads
   !> -scale sum_c g_c^T (k_c B_c d v - A_c v), the last term where the law takes the balance.
   subroutine find_slopes(self)
      type(wear_system), intent(inout) :: self
      complex(wp), allocatable :: stiffness(:, :)
      logical, allocatable :: rigid(:)
      integer :: h, j

      call reserve_slopes(self)
      self%built_for = self%wearing(:self%n_linear_extra)
      associate (b => self%vibration, fourier => self%vibration%problem%fourier)
         do j = 1, self%n_linear_extra
            self%slopes(:, j) = 0.0_wp
            call add_inputs(self, self%wearing(j), self%slopes(:, j))
         end do
         rigid = [(takes_balance(self, self%wearing(j)), j=1, self%n_linear_extra)]
         if (.not. any(rigid)) return
         allocate (stiffness(b%active%n_used, b%active%n_active))
         do h = 1, fourier%n_retained
            call b%problem%structure%active_block(b%structure_state, h, stiffness)
            do j = 1, self%n_linear_extra
               if (.not. rigid(j)) cycle
               call add_balance(self, h, self%wearing(j), b%active%n_active, stiffness, &
                                self%slopes(:, j))
            end do
         end do
      end associate
   end subroutine find_slopes

   !> Their number changes with the states of the pairs.
   subroutine reserve_slopes(self)
      type(wear_system), intent(inout) :: self

      if (allocated(self%slopes)) then
         if (all(shape(self%slopes) == [self%n_linear_inner, self%n_linear_extra])) return
         deallocate (self%slopes)
      end if
      allocate (self%slopes(self%n_linear_inner, self%n_linear_extra))
   end subroutine reserve_slopes

   !> From S to the residual of the condition of a pair.
   pure real(wp) function slide_scale(self, pair)
      class(wear_system), intent(in) :: self
      integer, intent(in) :: pair

      slide_scale = self%weight(pair)*self%cycles*self%factor(pair)
   end function slide_scale

   !> slope = slope - scale sum_c k_c B_c^T d^T g_c of one pair.
   subroutine add_inputs(self, pair, slope)
      type(wear_system), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(inout) :: slope(:)
      real(wp) :: turned(self%vibration%problem%fourier%n_coefficients)
      complex(wp) :: turn
      integer :: c, h, k, n, nc, row

      associate (b => self%vibration, problem => self%vibration%problem)
         nc = problem%fourier%n_coefficients
         associate (p => problem%forces%entry(problem%forces%pairs)%law%prediction, &
                    g => b%work(problem%forces%pairs)%slip_derivative(:, pair))
            do c = 1, 3
               row = problem%joint%row(c, pair)
               if (row == 0) cycle
               do h = 1, problem%fourier%n_retained
                  n = problem%fourier%harmonic(h)
                  k = problem%fourier%column(h)
                  ! d/dtau is a factor i n of the complex coefficient. Of a factor in the inputs,
                  ! the gradient uc + i us takes the same.
                  turn = one
                  if (p%order_of(pair, c) > 0) then
                     turn = cmplx(0.0_wp, b%rate_unit(p, pair)*n, wp)
                  end if
                  turn = turn*p%impedance_ratio(pair, c, n, b%frequency())
                  turn = turn*gradient(g, (c - 1)*nc + k, n)
                  turned(k) = real(turn, wp)
                  if (n > 0) turned(k + 1) = aimag(turn)
               end do
               call problem%incidence%scatter_row(row, b%active%place, b%active%n_active, &
                                                  b%active%n_active, -slide_scale(self, pair)* &
                                                  p%stiffness(pair, c), turned, slope)
            end do
         end associate
      end associate
   end subroutine add_inputs

   !> Cosine and sine entry of a gradient, as one complex number.
   pure complex(wp) function gradient(g, k, n)
      real(wp), intent(in) :: g(:)
      integer, intent(in) :: k, n

      gradient = cmplx(g(k), kind=wp)
      if (n > 0) gradient = cmplx(g(k), g(k + 1), wp)
   end function gradient

   !> slope = slope + scale sum_c A_c^T g_c of one pair and harmonic.
   subroutine add_balance(self, h, pair, na, stiffness, slope)
      type(wear_system), intent(in) :: self
      integer, intent(in) :: h, pair, na
      !> Z_n of rows in use (n_used, n_active).
      complex(wp), intent(in) :: stiffness(:, :)
      !> (n_active, n_coefficients)
      real(wp), intent(inout) :: slope(na, *)
      complex(wp) :: factor
      integer :: c, k, n, nc, place, row

      associate (problem => self%vibration%problem)
         nc = problem%fourier%n_coefficients
         n = problem%fourier%harmonic(h)
         k = problem%fourier%column(h)
         associate (g => self%vibration%work(problem%forces%pairs)%slip_derivative(:, pair))
            do c = 1, 3
               row = problem%joint%row(c, pair)
               if (row == 0) cycle
               place = self%vibration%active%place(problem%incidence%coordinate_of(row))
               if (place == 0) cycle
               factor = slide_scale(self, pair)*gradient(g, (c - 1)*nc + k, n)
               slope(:, k) = slope(:, k) + real(factor*stiffness(place, :na), wp)
               if (n > 0) slope(:, k + 1) = slope(:, k + 1) + aimag(factor*stiffness(place, :na))
            end do
         end associate
      end associate
   end subroutine add_balance

   !> Within a step the pairs that wear and the active coordinates are mostly the same ones; the
   !> length of the step is the same in all its stages.
   pure logical function preconditioner_fits(self)
      class(wear_system), intent(in) :: self

      preconditioner_fits = self%vibration%preconditioner_fits()
      if (.not. preconditioner_fits .or. self%n_linear_extra == 0) return
      preconditioner_fits = allocated(self%built_for)
      if (.not. preconditioner_fits) return
      preconditioner_fits = size(self%built_for) == self%n_linear_extra
      if (.not. preconditioner_fits) return
      associate (factors => self%vibration%preconditioner, active => self%vibration%active)
         preconditioner_fits = all(self%built_for == self%wearing(:self%n_linear_extra)) .and. &
                               factors%n == active%n_active .and. &
                               all(factors%place(:active%n_active) > 0)
      end associate
   end function preconditioner_fits

end module fw_wear_system
