!> The derivative of friction that is decided at instants: rows of the march, projected on the
!> harmonics pair by pair.
submodule(fw_friction) fw_friction_derivative
   use fw_instant_sum, only: instant_sum
   use fw_lapack, only: dgemm, dgemv
   use fw_march_derivative, only: march_derivative, numbers_of_instant
   use fw_memory, only: allocate_zeros
   use fw_one_direction, only: condition, follow_one_direction, project_one_direction, &
      project_runs, run_room
   use fw_sampled_turn, only: limit_is_unique
   use fw_slip, only: slip_weights
   use fw_two_directions, only: add_start, turn_derivative
   implicit none (type, external)

   !> Distance from the friction cone, as a part of the largest predicted force, that round-off
   !> leaves of a pair that has settled on it.
   real(wp), parameter :: touch = 1.0e-10_wp

   !> Room for the derivative of one pair.
   type, extends(law_room) :: derivative_room
      !> Of a limit that is the only one: derivative of the position at the instants by that at the
      !> start (2, 2, n_time), and (1 - that of a turn)^-1.
      real(wp), allocatable :: by_start(:, :, :)
      real(wp) :: inverse(2, 2) = 0.0_wp
      type(turn_derivative) :: turn
      type(instant_sum) :: sums
      !> Derivatives of the path of slip by positions (2, n_time) and pressures (n_time) at the
      !> instants.
      real(wp), allocatable :: by_x(:, :), by_p(:)
      real(wp), allocatable :: weight(:, :, :)
      !> Predicted forces (3, n_time).
      real(wp), allocatable :: y(:, :)
      !> Whether the pair bears at the instants.
      logical, allocatable :: bears(:)
      !> What a march keeps of the instants (numbers_of_instant, n_time).
      real(wp), allocatable :: numbers(:, :)
      !> Of a pair with one tangential direction: predicted forces, and what follows (n_time).
      real(wp), allocatable :: y_t(:), y_n(:)
      type(condition), allocatable :: at(:)
      type(run_room) :: runs
   end type derivative_room

contains

   ! The state that the derivative belongs to stays beside it: rows of stuck pairs leave the
   ! problem.
   module procedure linearize
      logical :: marched(self%n_elements)

      work%linear_state = work%state
      work%linear_rests = work%rests
      work%waits = .false.
      if (allocated(work%march)) then
         ! Only those who read it are worth a march; wear reads blocks.
         marched = work%may_wait .and. .not. work%differentiates_slip .and. &
                   work%state == pair_mixed .and. all(self%present(1:2, :), dim=1)
         call work%march%choose(marched)
         work%waits = work%may_wait .and. .not. work%differentiates_slip .and. &
                      all(marched .or. work%state /= pair_mixed)
      end if
      if (.not. any(work%state == pair_mixed)) work%waits = .false.
      select type (room => work%room)
      type is (friction_room)
         call make_room(self, fourier, room, work)
         if (any(work%state == pair_mixed)) call differentiate_pairs(self, fourier, room, work)
      end select
      if (allocated(work%march)) call arrange(work%march)
   end procedure linearize

   ! From what the march has kept, because forces may have moved on.
   module procedure form_jacobian

      if (.not. work%waits) return
      work%waits = .false.
      select type (room => work%room)
      type is (friction_room)
         call make_room(self, fourier, room, work)
         call project_pairs(self, fourier, room, work)
      end select
   end procedure form_jacobian

   !> The jacobian where somebody is to have it; while it waits it is out of reach, so that nobody
   !> takes that of before.
   subroutine make_room(self, fourier, room, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(inout) :: room
      type(force_workspace), intent(inout) :: work

      if (work%waits) then
         if (allocated(work%jacobian)) call move_alloc(work%jacobian, room%jacobian)
         return
      end if
      if (allocated(room%jacobian)) call move_alloc(room%jacobian, work%jacobian)
      if (allocated(work%jacobian) .or. .not. any(work%linear_state == pair_mixed)) return
      ! Zero: blocks of components that do not exist stay so.
      associate (n => 3*fourier%n_coefficients)
         call allocate_zeros(work%jacobian, [n, n, self%n_elements])
      end associate
   end subroutine make_room

   !> The jacobian of pairs that are marched.
   subroutine project_pairs(self, fourier, room, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      type(force_workspace), intent(inout) :: work
      type(derivative_room), allocatable :: of_pair
      integer :: i

      !$omp parallel default(none) shared(self, fourier, room, work) private(i, of_pair) &
      !$omp if(self%n_elements >= pairs_for_threads)
      allocate (of_pair)
      call of_pair%sums%reserve(fourier)
      call of_pair%turn%reserve(fourier%n_coefficients, fourier%n_time)
      !$omp do schedule(dynamic)
      do i = 1, self%n_elements
         associate (place => work%march%place_of(i))
            if (place == 0) cycle
            associate (numbers => work%march%instants(:, :, place))
               call of_pair%turn%replay(fourier%n_coefficients, fourier%synthesis, numbers, &
                                        work%march%starts(:, :, place), self%present(:, i))
               of_pair%bears = numbers(numbers_of_instant, :) > 0.0_wp
               call project_pair(self, fourier, room, i, of_pair, work)
            end associate
         end associate
      end do
      !$omp end do
      !$omp end parallel
   end subroutine project_pairs

   !> The block of a pair from the derivative of its last turn.
   subroutine project_pair(self, fourier, room, i, of_pair, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(derivative_room), intent(inout) :: of_pair
      type(force_workspace), intent(inout) :: work

      call of_pair%turn%project(fourier, room%waves, self%present(:, i), of_pair%sums, &
                                work%jacobian(:, :, i))
      if (self%facts%is_curved) then
         call of_pair%sums%form(fourier, room%waves, 3*fourier%n_coefficients, &
                                work%jacobian(2*fourier%n_coefficients + 1, &
                                              2*fourier%n_coefficients + 1, i), &
                                of_pair%turn%pressing)
         return
      end if
      of_pair%sums%wanted = of_pair%bears
      call project_normal(work%jacobian(:, :, i), fourier, room%waves, of_pair%sums, &
                          self%present(3, i))
   end subroutine project_pair

   !> Groups of pairs that are marched side by side, shared by threads.
   subroutine arrange(march)
      type(march_derivative), intent(inout) :: march
      integer :: group

      !$omp parallel do default(none) shared(march) private(group) if(march%n_groups() > 2)
      do group = 1, march%n_groups()
         call march%arrange(group)
      end do
      !$omp end parallel do
   end subroutine arrange

   subroutine differentiate_pairs(self, fourier, room, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(inout) :: room
      type(force_workspace), intent(inout) :: work
      class(law_room), allocatable :: kept
      type(derivative_room), allocatable :: of_pair
      integer :: i

      if (self%n_elements < pairs_for_threads) then
         call move_alloc(room%derivatives, kept)
         if (.not. allocated(kept)) allocate (derivative_room :: kept)
         select type (kept)
         type is (derivative_room)
            do i = 1, self%n_elements
               if (work%state(i) == pair_mixed) call differentiate_pair(self, fourier, room, i, &
                                                                        work, kept)
            end do
         end select
         call move_alloc(kept, room%derivatives)
         return
      end if
      !$omp parallel default(none) shared(self, fourier, room, work) private(i, of_pair)
      ! Of one pair at a time, for each thread: of all pairs it would be the largest array of the
      ! program.
      allocate (of_pair)
      !$omp do schedule(dynamic)
      do i = 1, self%n_elements
         if (work%state(i) == pair_mixed) call differentiate_pair(self, fourier, room, i, work, &
                                                                  of_pair)
      end do
      !$omp end do
      !$omp end parallel
   end subroutine differentiate_pairs

   subroutine differentiate_pair(self, fourier, room, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair

      call of_pair%sums%reserve(fourier)
      if (room%reach(i) > 0.0_wp) then
         call differentiate_held(self, fourier, room, i, work, of_pair)
      else if (.not. work%differentiates_slip .and. count(self%present(1:2, i)) == 1 .and. &
          .not. self%facts%is_curved) then
         call differentiate_one_direction(self, fourier, room, i, work, of_pair)
      else
         call differentiate_rows(self, fourier, room, i, work, of_pair)
      end if
   end subroutine differentiate_pair

   !> Of a pair that its residual traction keeps from slipping, lambda_t = y_t - z: with E the base
   !> functions at the instants a, b of the ends of z, and t its share,
   !>
   !>   dz = (1 - t)/2 (dy_t + mu dy_n)(a) + (1 + t)/2 (dy_t - mu dy_n)(b),
   !>
   !> which is a constant over the period: it takes from harmonic 0 alone.
   subroutine differentiate_held(self, fourier, room, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair
      real(wp) :: pressing, weight
      integer :: k, mean, nc, place, side

      nc = fourier%n_coefficients
      place = merge(0, nc, self%present(1, i))
      work%jacobian(:, place + 1:place + nc, i) = 0.0_wp
      do k = 1, nc
         work%jacobian(place + k, place + k, i) = 1.0_wp
      end do
      if (fourier%has_constant()) then
         mean = place + fourier%column(1)
         do side = -1, 1, 2
            k = room%ends(merge(1, 2, side < 0), i)
            weight = 0.5_wp*(1.0_wp + real(side, wp)*self%share(i))
            associate (column => work%jacobian(:, mean, i))
               column(place + 1:place + nc) = column(place + 1:place + nc) - &
                                              weight*fourier%synthesis(:, k)
               if (.not. self%present(3, i)) cycle
               pressing = 1.0_wp
               if (self%facts%is_curved) pressing = work%pressing(i, k)
               column(2*nc + 1:) = column(2*nc + 1:) + (real(side, wp)*weight*work%mu(i)* &
                                                        pressing)*fourier%synthesis(:, k)
            end associate
         end do
      end if
      if (work%differentiates_slip) work%slip_derivative(:, i) = 0.0_wp
      if (self%facts%is_curved .and. self%present(3, i)) then
         of_pair%turn%pressing = work%pressing(i, :)
         call of_pair%sums%form(fourier, room%waves, 3*nc, work%jacobian(2*nc + 1, 2*nc + 1, i), &
                                of_pair%turn%pressing)
         return
      end if
      of_pair%sums%wanted = work%prediction_time(i, 3, :) < 0.0_wp
      call project_normal(work%jacobian(:, :, i), fourier, room%waves, of_pair%sums, &
                          self%present(3, i))
   end subroutine differentiate_held

   !> Of a pair with one tangential direction whose path of slip nobody asks for.
   subroutine differentiate_one_direction(self, fourier, room, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair
      real(wp) :: x(2)
      integer :: nc, t, place
      logical :: unique

      nc = fourier%n_coefficients
      if (.not. allocated(of_pair%at)) then
         allocate (of_pair%at(fourier%n_time), of_pair%y_t(fourier%n_time))
         allocate (of_pair%y_n(fourier%n_time))
         call of_pair%runs%reserve(room%waves, nc)
      end if
      t = merge(1, 2, self%present(1, i))
      of_pair%y_t = work%prediction_time(i, t, :)
      ! A pair at rest is as of a law with memory, of the prediction with its mean.
      if (work%rests(i)) of_pair%y_t = of_pair%y_t + work%mean(i, t)
      of_pair%y_n = work%prediction_time(i, 3, :)
      call find_start(self, fourier, room%settled(i), work, i, of_pair, x, unique)
      call follow_one_direction(fourier%n_time, merge(1, work%turns(i), unique), of_pair%y_t, &
                                of_pair%y_n, work%mu(i), &
                                merge(touch*work%scale(i), 0.0_wp, unique), &
                                self%facts%remembers .or. work%rests(i), unique, x(t), of_pair%at)
      place = (t - 1)*nc + 1
      work%jacobian(place:place + nc - 1, place:place + nc - 1, i) = 0.0_wp
      if (self%present(3, i)) work%jacobian(2*nc + 1:, place:place + nc - 1, i) = 0.0_wp
      if (fourier%projects) then
         call project_runs(room%waves, fourier%n_time, nc, fourier%synthesis, of_pair%at, &
                           self%present(3, i), 3*nc, of_pair%runs, work%jacobian(place, place, i), &
                           work%jacobian(2*nc + 1, place, i))
      else
         call project_one_direction(fourier%n_time, nc, fourier%synthesis, fourier%analysis, &
                                    of_pair%at, self%present(3, i), 3*nc, &
                                    work%jacobian(place, place, i), &
                                    work%jacobian(2*nc + 1, place, i))
      end if
      of_pair%sums%wanted = of_pair%y_n < 0.0_wp
      call project_normal(work%jacobian(:, :, i), fourier, room%waves, of_pair%sums, &
                          self%present(3, i))
   end subroutine differentiate_one_direction

   !> Where the march that is differentiated starts: at its limit, where that is the only one.
   subroutine find_start(self, fourier, settled, work, pair, of_pair, x, unique)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Whether the march ends at its limit.
      logical, intent(in) :: settled
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      type(derivative_room), intent(inout) :: of_pair
      !> Corrected position.
      real(wp), intent(out) :: x(2)
      logical, intent(out) :: unique
      real(wp) :: z(2)

      unique = .false.
      if (settled) then
         if (.not. allocated(of_pair%by_start)) allocate (of_pair%by_start(2, 2, fourier%n_time))
         ! The prediction in `work` is without its mean: the position goes back by it.
         x = work%x(pair, :)
         z = x
         if (work%rests(pair)) z = x - work%mean(pair, :)
         call limit_is_unique(self%n_elements, fourier%n_time, pair, work%prediction_time, &
                              work%mu(pair), touch*work%scale(pair), z, unique, of_pair%inverse, &
                              of_pair%by_start)
      end if
      if (self%prediction%drags(pair) .and. self%facts%remembers) then
         ! The only limit, which one direction forgets its start for.
         x = work%x(pair, :)
         unique = unique .or. count(self%present(1:2, pair)) < 2
      else if (.not. unique) then
         x = work%x_start(pair, :)
      end if
   end subroutine find_start

   !> Of any pair, by the rows of the march.
   subroutine differentiate_rows(self, fourier, room, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair
      real(wp) :: x(2)
      integer :: c, nc
      logical :: unique

      nc = fourier%n_coefficients
      if (.not. allocated(of_pair%y)) then
         call of_pair%turn%reserve(nc, fourier%n_time)
         allocate (of_pair%weight(2, 2, nc), of_pair%y(3, fourier%n_time))
      end if
      of_pair%y = work%prediction_time(i, :, :)
      if (work%rests(i)) then
         do c = 1, 2
            of_pair%y(c, :) = of_pair%y(c, :) + work%mean(i, c)
         end do
      end if
      of_pair%bears = of_pair%y(3, :) < 0.0_wp
      if (self%facts%is_curved) of_pair%turn%pressing = work%pressing(i, :)
      call derive(self, fourier, room%settled(i), work, i, of_pair, x, unique)
      if (allocated(work%march)) then
         ! Pairs without a tangential direction come here too, and are not marched.
         if (work%march%place_of(i) > 0) call keep_march(work, i, of_pair)
      end if
      if (work%waits) return
      call project_pair(self, fourier, room, i, of_pair, work)
      if (unique) call project_start(work%jacobian(:, :, i), fourier, of_pair%turn%dx, &
                                     of_pair%by_start, of_pair%weight)
      if (.not. work%differentiates_slip) return
      if (work%rests(i)) then
         work%slip_derivative(:, i) = 0.0_wp
      else
         call differentiate_path(self, fourier, i, work%mu(i), x, unique, of_pair, &
                                 work%slip_derivative(:, i))
      end if
   end subroutine differentiate_rows

   !> dS of a pair by the Fourier coefficients of its predicted forces.
   subroutine differentiate_path(self, fourier, i, mu, x, unique, of_pair, gradient)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: i
      real(wp), intent(in) :: mu
      !> At the end of the period, and whether the derivative is that of the limit alone.
      real(wp), intent(in) :: x(2)
      logical, intent(in) :: unique
      !> Its turn, by_start and y are set.
      type(derivative_room), intent(inout) :: of_pair
      real(wp), intent(out) :: gradient(3*fourier%n_coefficients)

      if (.not. allocated(of_pair%by_x)) allocate (of_pair%by_x(2, fourier%n_time), &
                                                   of_pair%by_p(fourier%n_time))
      associate (nc => fourier%n_coefficients, n_time => fourier%n_time)
         call slip_weights(n_time, of_pair%y, mu, self%facts%remembers, x, of_pair%by_x, &
                           of_pair%by_p)
         if (self%facts%is_curved) of_pair%by_p = of_pair%turn%pressing*of_pair%by_p
         call of_pair%turn%sum_positions(nc, fourier%synthesis, self%present(:, i), of_pair%by_x, &
                                         gradient)
         if (unique) call add_start(3*nc, n_time, of_pair%by_start, of_pair%turn%dx, of_pair%by_x, &
                                    gradient)
         if (self%present(3, i)) call dgemv('N', nc, n_time, -1.0_wp, fourier%synthesis, nc, &
                                            of_pair%by_p, 1, 1.0_wp, gradient(2*nc + 1), 1)
      end associate
   end subroutine differentiate_path

   !> The last turn, for products that only have to be near.
   subroutine keep_march(work, pair, of_pair)
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: pair
      type(derivative_room), intent(inout) :: of_pair

      if (.not. allocated(of_pair%numbers)) allocate (of_pair%numbers(numbers_of_instant, &
                                                                      size(of_pair%y, 2)))
      call of_pair%turn%numbers_at(of_pair%numbers)
      of_pair%numbers(numbers_of_instant, :) = merge(1.0_wp, 0.0_wp, of_pair%bears)
      call work%march%keep(pair, of_pair%numbers, of_pair%turn%start)
   end subroutine keep_march

   !> Derivative of the friction of a pair. A limit that is the only one (unique) has a derivative
   !> of its own, dx, whose part in the forces is left to `project_start`; any other carries that of
   !> the way to it.
   subroutine derive(self, fourier, settled, work, pair, of_pair, x, unique)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Whether the march ends at its limit.
      logical, intent(in) :: settled
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      !> Its turn is set, and by_start of a unique limit, from y.
      type(derivative_room), intent(inout) :: of_pair
      !> Corrected position at the end of the period.
      real(wp), intent(out) :: x(2)
      logical, intent(out) :: unique

      call find_start(self, fourier, settled, work, pair, of_pair, x, unique)
      if (unique) then
         call of_pair%turn%to_limit(fourier%n_time, fourier%n_coefficients, fourier%synthesis, &
                                    of_pair%y, work%mu(pair), touch*work%scale(pair), &
                                    self%present(:, pair), of_pair%inverse, x)
      else
         ! From the start once more, with derivatives, as many turns as the march took.
         call of_pair%turn%march(fourier%n_time, fourier%n_coefficients, work%turns(pair), &
                                 fourier%synthesis, of_pair%y, work%mu(pair), 0.0_wp, &
                                 self%present(:, pair), &
                                 self%facts%remembers .or. work%rests(pair), x)
      end if
   end subroutine derive

   !> The blocks whose output is normal: lambda_n = min(y_n, 0), its own where the pair bears.
   subroutine project_normal(jacobian, fourier, waves, bears, has_normal)
      type(fourier_type), intent(in) :: fourier
      type(wave_table), intent(in) :: waves
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      type(instant_sum), intent(inout) :: bears
      logical, intent(in) :: has_normal

      associate (nc => fourier%n_coefficients)
         if (has_normal) call bears%form(fourier, waves, 3*nc, &
                                        jacobian(2*nc + 1, 2*nc + 1))
      end associate
   end subroutine project_normal

   !> What the start of a turn adds to the projected rows: of rank two.
   subroutine project_start(jacobian, fourier, dx, by_start, weight)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: dx(3*fourier%n_coefficients, 2), by_start(2, 2, fourier%n_time)
      !> Room.
      real(wp), intent(inout) :: weight(2, 2, fourier%n_coefficients)
      integer :: c, j, column, nc

      nc = fourier%n_coefficients
      ! lambda = y - x: a later position by dx/dx_0 takes from the force. Coefficients of this
      ! product first, then the outer product with dx_0 by inputs.
      call dgemm('N', 'T', 4, nc, fourier%n_time, -1.0_wp, by_start, 4, fourier%analysis, nc, &
                 0.0_wp, weight, 4)
      do c = 1, 2
         do j = 1, nc
            column = (c - 1)*nc + j
            jacobian(:, column) = jacobian(:, column) + weight(c, 1, j)*dx(:, 1) &
                                  + weight(c, 2, j)*dx(:, 2)
         end do
      end do
   end subroutine project_start

end submodule fw_friction_derivative
