!> Laws of hysteresis: the force of a pair follows from the path of its one tangential displacement,
!>
!>   y = k_t u_t,    |lambda_t| <= mu N,    N constant.
!>
!> Paths are followed from turning point to turning point, without instants. Between these the
!> forces are integrated by Gauss's rule with points that crowd at the start of each piece, where
!> the slope of the force may have any power of the angle and where it changes most: twice as many
!> until the integrals stand. All laws here are homogeneous of degree 1 in y and the limit mu N, so
!> that the derivative by the limit is (lambda - G y)/(mu N).
module fw_path_law
   use fw_displacement_path, only: displacement_path, piece_type
   use fw_event_polynomial, only: fill_waves, value_of
   use fw_force_law, only: force_workspace, law_facts, pair_mixed, pair_open, pair_stuck
   use fw_fourier, only: fourier_type
   use fw_gauss_points, only: gauss_rule
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dgemm
   use fw_pair_law, only: pair_law
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: path_facts, path_law

   type, abstract, extends(pair_law) :: path_law
   contains
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: sample
      procedure :: coefficients
      procedure :: fractions
      procedure :: slope_at_rest
      procedure :: located
      procedure(follow_interface), deferred :: follow
      procedure(respond_interface), deferred :: respond
      procedure(rest_interface), deferred :: respond_at_rest
   end type path_law

   abstract interface
      !> Anchors and pieces of a path that has turning points.
      pure subroutine follow_interface(self, element, path)
         import :: displacement_path, path_law
         implicit none (type, external)
         class(path_law), intent(in) :: self
         integer, intent(in) :: element
         type(displacement_path), intent(inout) :: path
      end subroutine follow_interface

      !> Forces behind an anchor (y_a, force_a), or on the curve of the assembly (direction 0),
      !> their slope by y - y_a, and their derivative by the force of the anchor.
      pure subroutine respond_interface(self, element, limit, y_a, force_a, direction, y, force, &
                                        slope, carry)
         import :: path_law, wp
         implicit none (type, external)
         class(path_law), intent(in) :: self
         integer, intent(in) :: element
         real(wp), intent(in) :: limit, y_a, force_a, direction, y(:)
         real(wp), intent(out) :: force(:), slope(:), carry(:)
      end subroutine respond_interface

      !> Force where y rests, and its slope by the position.
      pure subroutine rest_interface(self, element, limit, y, force, slope)
         import :: path_law, wp
         implicit none (type, external)
         class(path_law), intent(in) :: self
         integer, intent(in) :: element
         real(wp), intent(in) :: limit, y
         real(wp), intent(out) :: force, slope
      end subroutine rest_interface
   end interface

   !> Rules of 16, 32, .. 512 points, one behind the other.
   integer, parameter :: fewest_points = 16, n_levels = 6
   !> Points at a time.
   integer, parameter :: block = fewest_points
   !> The angle from the start of a piece is the third power of a point: with chi = -0.9, where the
   !> slope begins with the power 0.2, 64 points leave 1e-10 of it.
   integer, parameter :: crowding = 3
   !> Sets of integrals in a path.
   integer, parameter :: one_piece = 1, coarser = 2, all_pieces = 3
   !> Change of the integrals over the largest force from one rule to the next that is none.
   real(wp), parameter :: integral_tolerance = 1.0e-11_wp

contains

   !> What holds of all laws of paths.
   pure type(law_facts) function path_facts() result(facts)
      facts = law_facts(remembers=.true., has_events=.true., follows_events=.true., &
                        locates_events=.true., needs_projection=.true., is_hysteretic=.true.)
   end function path_facts

   subroutine reserve(self, fourier, work)
      class(path_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work
      integer :: i, first, k, last

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (work%path(self%n_elements))
      do i = 1, self%n_elements
         call work%path(i)%reserve(maxval(fourier%harmonic))
         call work%path(i)%reserve_waves(maxval(fourier%harmonic), block)
      end do
      allocate (work%rule(first_point(n_levels + 1) - 1, 2))
      do k = 1, n_levels
         first = first_point(k)
         last = first + n_points(k) - 1
         call gauss_rule(work%rule(first:last, 1), work%rule(first:last, 2))
      end do
      ! From points of [0, 1] to parts of a piece.
      work%rule(:, 2) = real(crowding, wp)*work%rule(:, 2)*work%rule(:, 1)**(crowding - 1)
      work%rule(:, 1) = work%rule(:, 1)**crowding
   end subroutine reserve

   pure integer function n_points(level)
      integer, intent(in) :: level

      n_points = fewest_points*2**(level - 1)
   end function n_points

   !> Where the points of a level begin.
   pure integer function first_point(level)
      integer, intent(in) :: level

      first_point = fewest_points*(2**(level - 1) - 1) + 1
   end function first_point

   subroutine evaluate(self, fourier, work)
      class(path_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i

      if (self%n_elements == 0) return
      call work%measure_scale()
      !$omp parallel do default(none) shared(self, fourier, work) private(i) schedule(dynamic) &
      !$omp if(self%n_elements >= pairs_for_threads)
      do i = 1, self%n_elements
         call follow_pair(self, fourier, work, i)
      end do
      !$omp end parallel do
   end subroutine evaluate

   !> Path, force and state of a pair.
   subroutine follow_pair(self, fourier, work, i)
      class(path_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: i
      integer :: h, k

      work%turns(i) = 1
      work%drift(i) = 0.0_wp
      work%force(i, :, :) = 0.0_wp
      ! What presses is a constant: minus the load.
      if (fourier%has_constant()) work%force(i, 3, 1) = min(work%offset(i), 0.0_wp)
      work%pressure(i) = max(-work%offset(i), 0.0_wp)
      associate (path => work%path(i))
         call path%begin()
         ! Harmonics that the balance leaves out keep their zeros.
         do h = 1, fourier%n_retained
            k = fourier%column(h)
            path%y(fourier%harmonic(h), 1) = work%prediction(i, 1, k)
            if (fourier%harmonic(h) > 0) path%y(fourier%harmonic(h), 2) = &
               work%prediction(i, 1, k + 1)
         end do
         call path%take(self%mu(i)*work%pressure(i))
         work%state(i) = pair_open
         if (.not. path%limit > 0.0_wp) return
         work%state(i) = pair_mixed
         if (path%n_turns > 0) then
            call self%follow(i, path)
            work%drift(i) = path%drift
         else if (.not. abs(path%y(0, 1)) > 0.0_wp) then
            work%state(i) = pair_stuck
         end if
         call project(self, work%rule, path, i, fourier, work%force(i, 1, :))
      end associate
   end subroutine follow_pair

   !> Coefficients of the force of a pair from its path, and the rule of each piece.
   subroutine project(self, rule, path, i, fourier, force)
      class(path_law), intent(in) :: self
      real(wp), intent(in) :: rule(:, :)
      type(displacement_path), intent(inout) :: path
      integer, intent(in) :: i
      !> Harmonics that are wanted.
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:)
      real(wp) :: slope
      integer :: degree, h, k, p

      force = 0.0_wp
      if (.not. path%limit > 0.0_wp) return
      if (path%n_turns == 0) then
         if (fourier%has_constant()) call self%respond_at_rest(i, path%limit, path%y(0, 1), &
                                                               force(1), slope)
         return
      end if
      degree = maxval(fourier%harmonic)
      call path%reserve_waves(degree, block)
      path%sums(:, :, all_pieces) = 0.0_wp
      do p = 1, path%n_pieces
         call settle(self, rule, path, i, p, degree)
         path%sums(:degree, :, all_pieces) = path%sums(:degree, :, all_pieces) + &
                                             path%sums(:degree, :, one_piece)
      end do
      do h = 1, fourier%n_retained
         k = fourier%column(h)
         if (fourier%harmonic(h) == 0) then
            force(k) = path%sums(0, 1, all_pieces)/(2.0_wp*pi)
         else
            force(k:k + 1) = path%sums(fourier%harmonic(h), :, all_pieces)/pi
         end if
      end do
   end subroutine project

   !> Integrals over a piece by finer and finer rules, until they stand.
   subroutine settle(self, rule, path, i, p, degree)
      class(path_law), intent(in) :: self
      real(wp), intent(in) :: rule(:, :)
      type(displacement_path), intent(inout) :: path
      integer, intent(in) :: i, p, degree
      real(wp) :: largest
      integer :: k, level

      largest = 0.0_wp
      do k = 1, path%n_anchors
         largest = max(largest, abs(path%anchor(k)%force))
      end do
      level = 1
      do while (level < n_levels - 1 .and. &
                n_points(level) < degree*(path%piece(p)%end - path%piece(p)%start))
         level = level + 1
      end do
      call integrate(self, rule, path, i, p, level, degree)
      do while (level < n_levels)
         level = level + 1
         path%sums(:degree, :, coarser) = path%sums(:degree, :, one_piece)
         call integrate(self, rule, path, i, p, level, degree)
         if (maxval(abs(path%sums(:degree, :, one_piece) - path%sums(:degree, :, coarser))) <= &
             integral_tolerance*largest) exit
      end do
      path%piece(p)%level = level
   end subroutine settle

   !> Integrals of the force times the waves over a piece, by the rule of a level.
   subroutine integrate(self, rule, path, i, p, level, degree)
      class(path_law), intent(in) :: self
      real(wp), intent(in) :: rule(:, :)
      type(displacement_path), intent(inout) :: path
      integer, intent(in) :: i, p, level, degree
      real(wp), dimension(block) :: angle, weight, y, force, slope, carry
      integer :: first, highest, k

      highest = max(degree, path%degree)
      path%sums(:, :, one_piece) = 0.0_wp
      do first = 1, n_points(level), block
         call points_of(rule, path%piece(p), level, first, angle, weight)
         do k = 1, block
            call fill_waves(highest, angle(k), path%cosines(:, k), path%sines(:, k))
            y(k) = value_of(path%degree, path%y, path%cosines(:, k), path%sines(:, k))
         end do
         call answer(self, path, i, p, y, force, slope, carry)
         do k = 1, block
            path%sums(:degree, 1, one_piece) = path%sums(:degree, 1, one_piece) + &
                                               weight(k)*force(k)*path%cosines(:degree, k)
            path%sums(:degree, 2, one_piece) = path%sums(:degree, 2, one_piece) + &
                                               weight(k)*force(k)*path%sines(:degree, k)
         end do
      end do
   end subroutine integrate

   !> A block of the points of a piece.
   pure subroutine points_of(rule, piece, level, first, angle, weight)
      real(wp), intent(in) :: rule(:, :)
      type(piece_type), intent(in) :: piece
      integer, intent(in) :: level, first
      real(wp), intent(out) :: angle(:), weight(:)
      integer :: k
      real(wp) :: length

      k = first_point(level) + first - 1
      length = piece%end - piece%start
      angle = piece%start + length*rule(k:k + size(angle) - 1, 1)
      weight = length*rule(k:k + size(angle) - 1, 2)
   end subroutine points_of

   !> Forces within a piece.
   pure subroutine answer(self, path, i, p, y, force, slope, carry)
      class(path_law), intent(in) :: self
      type(displacement_path), intent(in) :: path
      integer, intent(in) :: i, p
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: force(:), slope(:), carry(:)

      associate (piece => path%piece(p))
         if (piece%anchor == 0) then
            call self%respond(i, path%limit, 0.0_wp, 0.0_wp, 0.0_wp, y, force, slope, carry)
         else
            associate (anchor => path%anchor(piece%anchor))
               call self%respond(i, path%limit, anchor%y, anchor%force, piece%direction, y, &
                                 force, slope, carry)
            end associate
         end if
      end associate
   end subroutine answer

   subroutine linearize(self, fourier, work)
      class(path_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i, nc

      work%linear_state = work%state
      work%linear_rests = work%rests
      nc = fourier%n_coefficients
      if (.not. allocated(work%jacobian)) allocate (work%jacobian(3*nc, 3*nc, self%n_elements))
      !$omp parallel do default(none) shared(self, fourier, work, nc) private(i) &
      !$omp schedule(dynamic) if(self%n_elements >= pairs_for_threads)
      do i = 1, self%n_elements
         if (work%state(i) /= pair_mixed) cycle
         work%jacobian(:, :, i) = 0.0_wp
         call differentiate_pair(self, work%rule, work%path(i), i, fourier, &
                                 work%jacobian(:nc, :nc, i))
         if (self%present(3, i)) call differentiate_limit(fourier, i, work)
      end do
      !$omp end parallel do
   end subroutine linearize

   !> Derivative by what presses, as if a dof did: dlambda = -mu (lambda - G y)/(mu N) dy_n.
   subroutine differentiate_limit(fourier, i, work)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      integer :: k, nc

      nc = fourier%n_coefficients
      do k = 1, nc
         work%jacobian(2*nc + k, 2*nc + k, i) = 1.0_wp
      end do
      if (.not. fourier%has_constant()) return
      work%jacobian(2*nc + 1, :nc, i) = -(work%force(i, 1, :) - matmul(work%prediction(i, 1, :), &
                                          work%jacobian(:nc, :nc, i)))/work%pressure(i)
   end subroutine differentiate_limit

   !> Transposed derivative of the coefficients of the force by those of y (input, output).
   subroutine differentiate_pair(self, rule, path, i, fourier, gain)
      class(path_law), intent(in) :: self
      real(wp), intent(in) :: rule(:, :)
      type(displacement_path), intent(in) :: path
      integer, intent(in) :: i
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: gain(:, :)
      real(wp), dimension(fourier%n_coefficients, path%n_anchors) :: waves, by_y
      real(wp), dimension(fourier%n_coefficients) :: sloped, carried
      real(wp) :: own(fourier%n_coefficients, fourier%n_coefficients), force
      integer :: a, k, p

      if (path%n_turns == 0) then
         gain = 0.0_wp
         do k = 1, fourier%n_coefficients
            gain(k, k) = 1.0_wp
         end do
         if (fourier%has_constant()) call self%respond_at_rest(i, path%limit, path%y(0, 1), &
                                                               force, gain(1, 1))
         return
      end if
      call differentiate_anchors(path, fourier, waves, by_y)
      own = 0.0_wp
      do p = 1, path%n_pieces
         call add_products(self, rule, path, i, p, fourier, own, sloped, carried)
         a = path%piece(p)%anchor
         if (a == 0) cycle
         do k = 1, fourier%n_coefficients
            own(:, k) = own(:, k) - waves(:, a)*sloped(k) + by_y(:, a)*carried(k)
         end do
      end do
      gain = own
   end subroutine differentiate_pair

   !> Base functions at the anchors, and the derivatives of their forces.
   pure subroutine differentiate_anchors(path, fourier, waves, by_y)
      type(displacement_path), intent(in) :: path
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(out) :: waves(:, :), by_y(:, :)
      real(wp) :: first(size(waves, 1))
      integer :: a

      do a = 1, path%n_anchors
         call waves_at(fourier, path%degree, path%anchor(a)%angle, waves(:, a))
      end do
      first = 0.0_wp
      call chain(path, waves, first, by_y)
      if (.not. path%repeats) return
      ! The force at the end is that at the start: with f that from a start that is held,
      ! dF = f + M dF.
      associate (last => path%last)
         first = (last%slope*(waves(:, 1) - waves(:, last%parent)) + &
                  last%carry*by_y(:, last%parent))/path%contraction
      end associate
      call chain(path, waves, first, by_y)
   end subroutine differentiate_anchors

   !> From anchor to anchor.
   pure subroutine chain(path, waves, first, by_y)
      type(displacement_path), intent(in) :: path
      !> Of the first anchor what does not follow from its place.
      real(wp), intent(in) :: waves(:, :), first(:)
      real(wp), intent(out) :: by_y(:, :)
      integer :: a

      do a = 1, path%n_anchors
         associate (anchor => path%anchor(a))
            by_y(:, a) = anchor%slope*waves(:, a)
            if (anchor%parent > 0) by_y(:, a) = by_y(:, a) - anchor%slope*waves(:, anchor%parent) &
                                                + anchor%carry*by_y(:, anchor%parent)
         end associate
         if (a == 1) by_y(:, a) = by_y(:, a) + first
      end do
   end subroutine chain

   !> Base functions at an angle (n_coefficients).
   pure subroutine waves_at(fourier, degree, angle, waves)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: degree
      real(wp), intent(in) :: angle
      real(wp), intent(out) :: waves(:)
      real(wp) :: cosines(0:degree), sines(0:degree)
      integer :: h, k

      call fill_waves(degree, angle, cosines, sines)
      do h = 1, fourier%n_retained
         k = fourier%column(h)
         waves(k) = cosines(fourier%harmonic(h))
         if (fourier%harmonic(h) > 0) waves(k + 1) = sines(fourier%harmonic(h))
      end do
   end subroutine waves_at

   !> Integrals of slope times base function times wave of a piece, and those of the slope and of
   !> the carried part alone.
   subroutine add_products(self, rule, path, i, p, fourier, gain, sloped, carried)
      class(path_law), intent(in) :: self
      real(wp), intent(in) :: rule(:, :)
      type(displacement_path), intent(in) :: path
      integer, intent(in) :: i, p
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout), contiguous :: gain(:, :)
      real(wp), intent(out) :: sloped(:), carried(:)
      real(wp), dimension(fourier%n_coefficients, block) :: waves, weighted
      real(wp), dimension(block) :: angle, weight, y, force, slope, carry
      integer :: first, k, nc

      nc = fourier%n_coefficients
      sloped = 0.0_wp
      carried = 0.0_wp
      do first = 1, n_points(path%piece(p)%level), block
         call points_of(rule, path%piece(p), path%piece(p)%level, first, angle, weight)
         do k = 1, block
            call waves_at(fourier, path%degree, angle(k), waves(:, k))
            y(k) = path%at(angle(k))
         end do
         call answer(self, path, i, p, y, force, slope, carry)
         do k = 1, block
            weighted(:, k) = weight(k)/pi*waves(:, k)
            if (fourier%has_constant()) weighted(1, k) = 0.5_wp*weighted(1, k)
            sloped = sloped + slope(k)*weighted(:, k)
            carried = carried + carry(k)*weighted(:, k)
            waves(:, k) = slope(k)*waves(:, k)
         end do
         call dgemm('N', 'T', nc, nc, block, 1.0_wp, waves, nc, weighted, nc, 1.0_wp, gain, nc)
      end do
   end subroutine add_products

   !> Forces at the instants, read off the path.
   subroutine sample(self, work)
      class(path_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      real(wp) :: angle, own
      real(wp), dimension(1) :: y, force, slope, carry
      integer :: i, k, n, p

      n = size(work%force_time, 3)
      do i = 1, self%n_elements
         work%force_time(i, 2, :) = 0.0_wp
         work%force_time(i, 3, :) = -work%pressure(i)
         associate (path => work%path(i))
            force = 0.0_wp
            if (path%limit > 0.0_wp .and. path%n_turns == 0) then
               call self%respond_at_rest(i, path%limit, path%y(0, 1), force(1), slope(1))
            end if
            do k = 1, n
               if (path%n_pieces > 0) then
                  angle = 2.0_wp*pi*real(k - 1, wp)/real(n, wp)
                  call path%piece_at(angle, p, own)
                  y = path%at(own)
                  call answer(self, path, i, p, y, force, slope, carry)
               end if
               work%force_time(i, 1, k) = force(1)
            end do
         end associate
      end do
   end subroutine sample

   !> Of harmonics that the balance may have left out too.
   subroutine coefficients(self, work, computed, fourier, force)
      class(path_law), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:, :, :)
      integer :: i

      associate (unused => computed)
      end associate
      do i = 1, self%n_elements
         force(i, :, :) = 0.0_wp
         if (fourier%has_constant()) force(i, 3, 1) = -work%pressure(i)
         call project(self, work%rule, work%path(i), i, fourier, force(i, 1, :))
      end do
   end subroutine coefficients

   !> A pair slips in the smallest motion: throughout, or not at all. Without pressure it is open.
   pure subroutine fractions(self, work, share)
      class(path_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)
      integer :: i, state

      share = 0.0_wp
      do i = 1, self%n_elements
         state = 1
         if (work%path(i)%n_turns > 0 .and. self%mu(i) > 0.0_wp) state = 2
         if (.not. work%pressure(i) > 0.0_wp) state = 3
         share(state, i) = 1.0_wp
      end do
   end subroutine fractions

   !> What bears nothing holds nothing.
   pure real(wp) function slope_at_rest(self, element, component) result(slope)
      class(path_law), intent(in) :: self
      integer, intent(in) :: element, component

      slope = merge(1.0_wp, 0.0_wp, component == 1 .and. &
                    self%mu(element)*self%prediction%load(element) > 0.0_wp)
   end function slope_at_rest

   !> It follows its paths already.
   subroutine located(self, law)
      class(path_law), intent(in) :: self
      class(pair_law), allocatable, intent(out) :: law

      allocate (law, source=self)
   end subroutine located

end module fw_path_law
