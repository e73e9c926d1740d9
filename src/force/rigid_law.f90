!> Rigid friction of high order. A balance with the prediction y = F - Z q + E q and the law
!> lambda + E x = y corrects the motion q to x, which has all harmonics; above those of the
!> balance it obeys E_n x_n + lambda_n = 0. The law so takes -E_n**-1 lambda_n for what the
!> structure answers to the force there, -Z_n**-1 lambda_n, and E is chosen like Z: an oscillator
!> with the mass, damping and stiffness that the structure has above the balance (fw_split),
!>
!>   E_n = k - (n omega)**2 m + i n omega c.
!>
!> Pairs with one tangential direction where that mass matters follow it (fw_oscillator_pair). All
!> others, and all normal directions, keep the displacement law with the stiffness k alone.
module fw_rigid_law
   use fw_event_contact, only: new_event_contact
   use fw_force_law, only: force_workspace, law_facts, pair_mixed, pair_open, pair_stuck, &
      prediction_type
   use fw_fourier, only: fourier_type
   use fw_friction_events, only: event_room, friction_by_events
   use fw_kinds, only: wp
   use fw_oscillator, only: new_oscillator
   use fw_oscillator_pair, only: oscillator_pair_type
   use fw_key, only: key_visitor
   use fw_contact_data, only: contact_type
   use fw_pair_law, only: bind_speeds, pair_law
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: friction_of_high_order

   type, extends(friction_by_events) :: rigid_law
   contains
      procedure :: bind_keys
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: sample
      procedure :: coefficients
      procedure :: tail
      procedure :: fractions
      procedure :: located
   end type rigid_law

   !> `paths` are those of all pairs, without the tangential directions that have mass.
   type, extends(event_room) :: rigid_room
      !> Pairs with mass: their numbers, tangential directions and paths.
      integer :: n_massive = 0
      integer, allocatable :: pair(:), direction(:)
      type(oscillator_pair_type), allocatable :: massive(:)
      !> P, P', P'', N, N', N'' of each: coefficients and values at the instants.
      real(wp), allocatable :: rows(:, :), values(:, :)
      !> Force of each (n_coefficients, tangential and normal, n_massive).
      real(wp), allocatable :: force(:, :, :)
   end type rigid_room

contains

   !> Events are needed: above H the motion has kinks that no number of instants resolves.
   pure type(rigid_law) function friction_of_high_order() result(law)
      law%prediction = prediction_type(takes_balance=.true., has_inertia=.true.)
      law%facts = law_facts(remembers=.true., needs_independent=.true., has_events=.true., &
                            follows_events=.true., locates_events=.true., &
                            needs_projection=.true., has_tail=.true., measures_slip=.true., &
                            is_integrated=.true.)
   end function friction_of_high_order

   !> What presses may slide steadily; an anchor that moves has no closed form here.
   subroutine bind_keys(self, keys, contact, slides, closes)
      class(rigid_law), intent(in) :: self
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: slides, closes

      call bind_speeds(keys, contact)
      associate (unused => self, unused_slides => slides, unused_closes => closes)
      end associate
   end subroutine bind_keys

   !> Room; the masses are known.
   subroutine reserve(self, fourier, work)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (rigid_room :: work%room)
      select type (room => work%room)
      type is (rigid_room)
         call fill_room(self, fourier, room)
      end select
   end subroutine reserve

   !> Which pairs are followed as displacement laws, and which as oscillators.
   subroutine fill_room(self, fourier, room)
      type(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(rigid_room), intent(out) :: room
      logical :: massive(2, self%n_elements), present(3, self%n_elements)
      integer :: i, j

      ! An inertia of zero (a massless direction) leaves the displacement law.
      massive = .false.
      if (allocated(self%prediction%inertia)) then
         massive = transpose(self%prediction%inertia(:, 1:2)) > 0.0_wp
      end if
      present = self%present
      ! The paths see such a pair with its normal direction only.
      present(1:2, :) = present(1:2, :) .and. .not. massive
      call new_event_contact(self%mu, present, .true., fourier, room%paths)
      room%pair = pack([(i, i=1, self%n_elements)], any(massive, dim=1))
      room%n_massive = size(room%pair)
      room%direction = findloc(massive(:, room%pair), .true., dim=1)
      allocate (room%massive(room%n_massive))
      do j = 1, room%n_massive
         call room%massive(j)%reserve_oscillator(maxval(fourier%harmonic), fourier%n_time, &
                                                 fourier%n_coefficients)
         room%massive(j)%curves%mu = self%mu(room%pair(j))
      end do
      ! Six rows a pair, one pair behind the other, so that one transform takes them all.
      allocate (room%rows(6*room%n_massive, fourier%n_coefficients), source=0.0_wp)
      allocate (room%values(6*room%n_massive, fourier%n_time), source=0.0_wp)
      allocate (room%force(fourier%n_coefficients, 2, room%n_massive), source=0.0_wp)
   end subroutine fill_room

   !> First all pairs by the displacement law, for those with mass their normal direction alone;
   !> then those with mass over again.
   subroutine evaluate(self, fourier, work)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      if (self%n_elements == 0) return
      call self%friction_by_events%evaluate(fourier, work)
      select type (room => work%room)
      type is (rigid_room)
         if (room%n_massive == 0) return
         if (allocated(self%worn)) room%massive%curves%mu = work%mu(room%pair)
         call evaluate_massive(self, fourier, work, room)
         if (work%measures_slip) call measure_paths(room, work%slip)
      end select
   end subroutine evaluate

   !> int N |dx| of pairs with mass, x in units of force.
   subroutine measure_paths(room, slip)
      type(rigid_room), intent(inout) :: room
      real(wp), intent(inout) :: slip(:)
      integer :: j

      do j = 1, room%n_massive
         slip(room%pair(j)) = room%massive(j)%friction_path()
      end do
   end subroutine measure_paths

   !> State over the whole period: open at all times, stuck at all times, or anything else.
   elemental integer function state_of(open, closed, moved) result(state)
      logical, intent(in) :: open, closed, moved

      state = pair_mixed
      if (open) state = pair_open
      if (closed .and. .not. moved) state = pair_stuck
   end function state_of

   !> Forces of the pairs whose mass and damping matter: each direction is an oscillator between
   !> its events.
   subroutine evaluate_massive(self, fourier, work, room)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      type(rigid_room), intent(inout) :: room
      integer :: i, j

      do j = 1, room%n_massive
         ! All pairs at once: one transform for their grids.
         call fill_rows(fourier, work, room%pair(j), room%direction(j), &
                        room%rows(6*j - 5:6*j, :))
      end do
      call fourier%to_time(6*room%n_massive, room%rows, room%values)
      !$omp parallel do default(none) shared(self, fourier, work, room) private(i, j) &
      !$omp schedule(dynamic) if(room%n_massive >= pairs_for_threads)
      do j = 1, room%n_massive
         i = room%pair(j)
         call follow_pair(self, fourier, work, i, room%direction(j), room%rows(6*j - 5:6*j, :), &
                          room%values(6*j - 5:6*j, :), room%massive(j), room%force(:, :, j))
      end do
      !$omp end parallel do
   end subroutine evaluate_massive

   !> Coefficients of P, N and their first two derivatives.
   subroutine fill_rows(fourier, work, pair, direction, rows)
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair, direction
      real(wp), intent(inout) :: rows(:, :)

      rows(1, :) = work%prediction(pair, direction, :)
      ! N is a pressure, y_n a force that opens.
      rows(4, :) = -work%prediction(pair, 3, :)
      rows(2:3, :) = 0.0_wp
      rows(5:6, :) = 0.0_wp
      call take_slopes(fourier, rows)
   end subroutine fill_rows

   !> First and second derivatives by tau, in the rows behind those of P and of N: with (a, b) the
   !> coefficients, (n b, -n a) and -n^2 (a, b).
   subroutine take_slopes(fourier, rows)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: rows(:, :)
      integer :: c, h, k, n

      do h = 1, fourier%n_retained
         n = fourier%harmonic(h)
         k = fourier%column(h)
         if (n == 0) cycle
         do c = 1, 4, 3
            rows(c + 1, k) = n*rows(c, k + 1)
            rows(c + 1, k + 1) = -n*rows(c, k)
            rows(c + 2, k:k + 1) = -real(n, wp)**2*rows(c, k:k + 1)
         end do
      end do
   end subroutine take_slopes

   !> The path, the force and the state of one pair with mass.
   subroutine follow_pair(self, fourier, work, i, direction, rows, values, pair, force)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: i, direction
      real(wp), intent(in) :: rows(:, :), values(:, :)
      type(oscillator_pair_type), intent(inout) :: pair
      real(wp), intent(inout) :: force(:, :)
      integer :: h, k, n

      associate (p => self%prediction, c => pair%curves)
         ! In the angle: rates are multiplied by omega, accelerations by its square.
         pair%waves%oscillator = new_oscillator(work%rate**2*p%inertia(i, direction), &
                                                work%rate*p%damping(i, direction), &
                                                p%stiffness(i, direction))
         do h = 1, fourier%n_retained
            n = fourier%harmonic(h)
            k = fourier%column(h)
            ! Coefficients by harmonic number: harmonics left out of the balance keep their zeros.
            c%tangential(n, 1) = rows(1, k)
            c%normal(n, 1) = rows(4, k)
            if (n == 0) cycle
            c%tangential(n, 2) = rows(1, k + 1)
            c%normal(n, 2) = rows(4, k + 1)
         end do
         if (.not. fourier%has_constant()) c%normal(0, 1) = 0.0_wp
         ! The gap acts through the mean of the prediction.
         c%normal(0, 1) = c%normal(0, 1) - work%offset(i)
         do k = 1, 6
            c%samples(:, k) = values(k, :)
         end do
         c%samples(:, 4) = c%samples(:, 4) - work%offset(i)
         call c%combine(c%mu)
      end associate
      call pair%follow(work%x_start(i, direction))
      call pair%force(fourier%n_retained, fourier%harmonic, fourier%column, force(:, 1), &
                      force(:, 2))
      work%force(i, direction, :) = force(:, 1)
      work%x(i, direction) = pair%path%z_end
      work%turns(i) = pair%n_turns
      ! Relative to the motion there, a force here.
      work%drift(i) = pair%drift*work%scale(i)
      work%state(i) = state_of(pair%path%open, pair%path%closed, pair%path%moved)
   end subroutine follow_pair

   !> Blocks G of mixed pairs; open and stuck ones have 0 and 1 without being asked.
   subroutine linearize(self, fourier, work)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work

      call self%friction_by_events%linearize(fourier, work)
      if (.not. any(work%state == pair_mixed)) return
      select type (room => work%room)
      type is (rigid_room)
         call linearize_pairs(self, fourier, room, work)
      end select
   end subroutine linearize

   !> Blocks of pairs with mass come after those of the paths, whose normal part they keep.
   subroutine linearize_pairs(self, fourier, room, work)
      class(rigid_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(rigid_room), intent(inout) :: room
      type(force_workspace), intent(inout) :: work
      integer :: j, nc

      nc = fourier%n_coefficients
      !$omp parallel do default(none) shared(self, fourier, work, room, nc) private(j) &
      !$omp schedule(dynamic) if(room%n_massive >= pairs_for_threads)
      do j = 1, room%n_massive
         if (work%state(room%pair(j)) /= pair_mixed) cycle
         call linearize_pair(fourier, nc, (room%direction(j) - 1)*nc, &
                             self%present(3, room%pair(j)), room%massive(j), &
                             work%jacobian(:, :, room%pair(j)))
         if (.not. work%differentiates_slip) cycle
         call differentiate_path(fourier, nc, (room%direction(j) - 1)*nc, &
                                 self%present(3, room%pair(j)), room%massive(j), &
                                 work%slip_derivative(:, room%pair(j)))
      end do
      !$omp end parallel do
   end subroutine linearize_pairs

   !> What the tangential force of a pair with mass depends on.
   subroutine linearize_pair(fourier, nc, t, has_normal, pair, jacobian)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: nc
      !> Coefficients before those of the direction.
      integer, intent(in) :: t
      logical, intent(in) :: has_normal
      type(oscillator_pair_type), intent(inout) :: pair
      real(wp), intent(inout) :: jacobian(:, :)
      real(wp) :: by_tangential(nc, nc), by_normal(nc, nc), normal(nc, nc)

      call pair%derivative(fourier%n_retained, fourier%harmonic, fourier%column, by_tangential, &
                           by_normal, normal)
      jacobian(t + 1:t + nc, t + 1:t + nc) = by_tangential
      ! The normal prediction acts on friction through Q = -mu y_n.
      if (has_normal) jacobian(2*nc + 1:, t + 1:t + nc) = by_normal
   end subroutine linearize_pair

   !> What the sliding of a pair with mass depends on.
   subroutine differentiate_path(fourier, nc, t, has_normal, pair, slope)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: nc, t
      logical, intent(in) :: has_normal
      type(oscillator_pair_type), intent(inout) :: pair
      real(wp), intent(inout) :: slope(:)
      real(wp) :: by_tangential(nc), by_normal(nc)

      call pair%path_derivative(fourier%n_retained, fourier%harmonic, fourier%column, &
                                by_tangential, by_normal)
      ! The other tangential direction is not there: pairs with mass have only one.
      slope = 0.0_wp
      slope(t + 1:t + nc) = by_tangential
      if (has_normal) slope(2*nc + 1:) = by_normal
   end subroutine differentiate_path

   !> Forces at the instants, read off the paths; the normal ones are those of the displacement law.
   subroutine sample(self, work)
      class(rigid_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      real(wp), allocatable :: out(:, :)
      integer :: j

      if (self%n_elements == 0) return
      call self%friction_by_events%sample(work)
      select type (room => work%room)
      type is (rigid_room)
         allocate (out(size(work%force_time, 3), 2))
         do j = 1, room%n_massive
            call room%massive(j)%values_at(size(out, 1), out(:, 1), out(:, 2))
            work%force_time(room%pair(j), room%direction(j), :) = out(:, 1)
         end do
      end select
   end subroutine sample

   !> Tangential forces of pairs with mass up to the harmonics that their curves know.
   subroutine coefficients(self, work, computed, fourier, force)
      class(rigid_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: out(fourier%n_coefficients, 2)
      integer :: j, n

      if (self%n_elements == 0) return
      call self%friction_by_events%coefficients(work, computed, fourier, force)
      select type (room => work%room)
      type is (rigid_room)
         do j = 1, room%n_massive
            out = 0.0_wp
            n = count(fourier%harmonic <= room%massive(j)%curves%degree)
            call room%massive(j)%force(n, fourier%harmonic, fourier%column, out(:, 1), out(:, 2))
            force(room%pair(j), room%direction(j), :) = out(:, 1)
         end do
      end select
   end subroutine coefficients

   !> All harmonics of the force up to `highest`, exact integrals over the pieces of the paths.
   subroutine tail(self, work, highest, force)
      class(rigid_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: highest
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: out(2*highest + 1, 2)
      integer :: j

      if (self%n_elements == 0) return
      select type (room => work%room)
      type is (rigid_room)
         call room%paths%tail(highest, force)
         do j = 1, room%n_massive
            call room%massive(j)%force_to(highest, out(:, 1), out(:, 2))
            force(room%pair(j), room%direction(j), :) = out(:, 1)
         end do
      end select
   end subroutine tail

   !> Shares of stick, slip and open by durations; those of pairs with mass replace the others.
   pure subroutine fractions(self, work, share)
      class(rigid_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)
      integer :: j

      call self%friction_by_events%fractions(work, share)
      if (self%n_elements == 0) return
      select type (room => work%room)
      type is (rigid_room)
         do j = 1, room%n_massive
            share(:, room%pair(j)) = room%massive(j)%shares()
         end do
      end select
   end subroutine fractions

   !> It follows events already.
   subroutine located(self, law)
      class(rigid_law), intent(in) :: self
      class(pair_law), allocatable, intent(out) :: law

      allocate (law, source=self)
   end subroutine located

end module fw_rigid_law
