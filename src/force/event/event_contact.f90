!> Event-resolved contact forces of all pairs: from the coefficients of the predicted forces to
!> those of the contact forces, and their derivative. With one tangential direction there is no
!> sampling error: the instants of the transform only isolate the events, for which four for each
!> wave of the highest harmonic are enough. With two, steps of slip are as wide as their tolerance
!> allows.
module fw_event_contact
   use fw_event_cells, only: cells_type, new_cells
   use fw_event_curves, only: curves_type
   use fw_event_pair, only: event_pair_type
   use fw_event_planar, only: planar_pair_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm, dgemv
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: event_contact_type, new_event_contact

   type :: event_contact_type
      integer :: n_pairs = 0
      !> Pairs with at most one tangential direction, and those with two (n_pairs); each pair has
      !> room in one of them.
      type(event_pair_type), allocatable :: pair(:)
      type(planar_pair_type), allocatable :: planar(:)
      logical, allocatable :: is_planar(:)
      !> Waves on the grid of the planar pairs.
      type(cells_type), private :: cells
      !> Component of the one tangential direction of each pair, 0 where there is none.
      integer, allocatable :: direction(:)
      !> Whether a pair bears throughout, or never; whether it ever slips or opens; change of the
      !> position over the last turn (n_pairs).
      logical, allocatable :: closed(:), open(:), moved(:)
      !> Whether a pair without memory comes to rest: it is led to a position that none of its
      !> instants moves it from (n_pairs).
      logical, allocatable :: rests(:)
      real(wp), allocatable :: drift(:)
      !> Half of the distance between the ends of the residual traction of pairs that one is given
      !> for, 0 where none keeps the pair from slipping [force] (n_pairs).
      real(wp), allocatable :: reach(:)
      !> Whether a normal dof exists (n_pairs).
      logical, allocatable :: has_normal(:)
      !> Coefficients (n_coefficients, 6, n_pairs) of P, P', P'', N, N', N'' and their samples.
      real(wp), allocatable, private :: batch(:, :, :), samples(:, :, :)
      !> Coefficients of the contact forces of pairs with one direction (n_coefficients, tangential
      !> and normal, n_pairs).
      real(wp), allocatable, private :: out(:, :, :)
      !> What side 2 slides of each pair in an angle of 1, times the stiffness (n_pairs, 2) [force];
      !> not allocated where none does.
      real(wp), allocatable :: carry(:, :)
   contains
      procedure :: take_friction
      procedure :: take_shares
      procedure :: evaluate
      procedure :: linearize
      procedure :: coefficients
      procedure :: tail
      procedure :: values
      procedure :: friction_path
      procedure :: fractions
   end type event_contact_type

contains

   !> Room for the events of pairs.
   !> Memory of the derivatives is not among it: `linearize` has a block for each thread.
   pure subroutine new_event_contact(mu, present, remembers, fourier, self)
      !> Friction coefficient (n_pairs).
      real(wp), intent(in) :: mu(:)
      !> Which of t1, t2, n exist (3, n_pairs).
      logical, intent(in) :: present(:, :)
      !> Whether pairs remember their position (false: velocity-level law).
      logical, intent(in) :: remembers
      !> Harmonics and instants, at least four for each wave of the highest one.
      type(fourier_type), intent(in) :: fourier
      type(event_contact_type), intent(out) :: self
      integer :: i

      self%n_pairs = size(mu)
      allocate (self%pair(self%n_pairs), self%planar(self%n_pairs))
      allocate (self%closed(self%n_pairs), self%open(self%n_pairs), self%moved(self%n_pairs), &
                self%rests(self%n_pairs), source=.false.)
      allocate (self%drift(self%n_pairs), self%reach(self%n_pairs), source=0.0_wp)
      self%is_planar = present(1, :) .and. present(2, :)
      self%direction = findloc(present(1:2, :), .true., dim=1)
      self%has_normal = present(3, :)
      if (any(self%is_planar)) self%cells = new_cells(fourier)
      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            call self%planar(i)%reserve(self%cells, mu(i), remembers)
            cycle
         end if
         call self%pair(i)%reserve(maxval(fourier%harmonic), fourier%n_time, fourier%n_coefficients)
         self%pair(i)%curves%mu = mu(i)
         self%pair(i)%rubs = self%direction(i) > 0
         self%pair(i)%presses = self%has_normal(i)
         self%pair(i)%remembers = remembers
      end do
      allocate (self%batch(fourier%n_coefficients, 6, self%n_pairs), source=0.0_wp)
      allocate (self%out(fourier%n_coefficients, 2, self%n_pairs), source=0.0_wp)
      allocate (self%samples(fourier%n_time, 6, self%n_pairs), source=0.0_wp)
   end subroutine new_event_contact

   !> Friction that has changed since the paths were made (n_pairs).
   pure subroutine take_friction(self, mu)
      class(event_contact_type), intent(inout) :: self
      real(wp), intent(in) :: mu(:)
      integer :: i

      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            call self%planar(i)%take_friction(mu(i))
         else
            self%pair(i)%curves%mu = mu(i)
         end if
      end do
   end subroutine take_friction

   !> Residual tractions of pairs with one tangential direction, as shares of what balances
   !> (n_pairs).
   pure subroutine take_shares(self, shares)
      class(event_contact_type), intent(inout) :: self
      real(wp), intent(in) :: shares(:)
      integer :: i

      self%pair%path%has_share = .true.
      do i = 1, self%n_pairs
         self%pair(i)%path%share = shares(i)
      end do
   end subroutine take_shares

   !> Contact forces and the position at the end of the period.
   subroutine evaluate(self, fourier, prediction, offset, x_start, force, x, mean)
      !> Also keeps the paths of the pairs, which all other procedures read: evaluate first.
      class(event_contact_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Coefficients of the predicted forces (n_pairs, 3, n_coefficients), and what the normal ones
      !> have in the mean beside (n_pairs).
      real(wp), intent(in) :: prediction(:, :, :), offset(:)
      !> Corrected position at the start and at the end (n_pairs, 2).
      real(wp), intent(in) :: x_start(:, :)
      real(wp), intent(inout) :: x(:, :)
      !> Coefficients of the contact forces (n_pairs, 3, n_coefficients).
      real(wp), intent(inout) :: force(:, :, :)
      !> At velocity level: what the mean position adds to P of a pair that comes to rest
      !> (n_pairs, 2); without it none is looked at.
      real(wp), intent(in), optional :: mean(:, :)
      integer :: i
      logical :: may_rest

      may_rest = present(mean)
      if (.not. all(self%is_planar)) call fill_batch(self, fourier, prediction)
      ! Not a parallel region where it does not pay: one of a single thread costs more than a pair.
      if (self%n_pairs < pairs_for_threads) then
         do i = 1, self%n_pairs
            call evaluate_one(i)
         end do
         return
      end if
      ! Pairs differ widely in the number of their events, hence dynamic; each is summed by one
      ! thread, so that the number of threads changes no bit.
      !$omp parallel do default(none) shared(self) private(i) schedule(dynamic)
      do i = 1, self%n_pairs
         call evaluate_one(i)
      end do
      !$omp end parallel do

   contains

      subroutine evaluate_one(i)
         integer, intent(in) :: i
         real(wp) :: start(2), at_rest(2), carried
         integer :: c

         carried = 0.0_wp
         at_rest = 0.0_wp
         if (may_rest) at_rest = mean(i, :)
         if (self%is_planar(i)) then
            start = x_start(i, :)
            call evaluate_planar(self, i, fourier, prediction(i, :, :), offset(i), start, &
                                 may_rest, at_rest)
            do c = 1, 3
               force(i, c, :) = self%planar(i)%force(:, c)
            end do
            x(i, :) = self%planar(i)%z_end
            return
         end if
         associate (pair => self%pair(i))
            pair%curves%carry = 0.0_wp
            if (allocated(self%carry) .and. self%direction(i) > 0) then
               if (pair%remembers) then
                  pair%curves%carry = self%carry(i, self%direction(i))
               else
                  ! Rates are those against the surface, and come to rest nowhere.
                  carried = self%carry(i, self%direction(i))
               end if
            end if
         end associate
         ! Values and slopes at the instants; those of a component that does not exist are zero.
         do c = 1, 6
            if (c <= 3 .and. self%direction(i) == 0) cycle
            if (c > 3 .and. .not. self%has_normal(i)) cycle
            call fourier%row_to_time(self%batch(:, c, i), self%samples(:, c, i))
         end do
         call evaluate_pair(self%pair(i), fourier, self%batch(:, :, i), self%samples(:, :, i), &
                            offset(i), x_start(i, max(1, self%direction(i))), may_rest, &
                            at_rest(max(1, self%direction(i))), carried, self%rests(i))
         self%closed(i) = self%pair(i)%path%closed
         self%open(i) = self%pair(i)%path%open
         self%moved(i) = self%pair(i)%path%moved
         self%reach(i) = self%pair(i)%path%reach
         call collect(self%pair(i), fourier, self%out(:, :, i))
         force(i, :, :) = 0.0_wp
         ! Where nothing rubs there is no position to move.
         x(i, :) = x_start(i, :)
         force(i, 3, :) = self%out(:, 2, i)
         if (self%direction(i) == 0) return
         force(i, self%direction(i), :) = self%out(:, 1, i)
         x(i, self%direction(i)) = self%pair(i)%path%z_end
      end subroutine evaluate_one

   end subroutine evaluate

   !> Coefficients of P and N and of their first two derivatives.
   pure subroutine fill_batch(self, fourier, prediction)
      type(event_contact_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> (n_pairs, 3, n_coefficients); the normal one is turned, N = -y_n being a pressure.
      real(wp), intent(in) :: prediction(:, :, :)
      integer :: d, i, k

      do k = 1, fourier%n_coefficients
         do i = 1, self%n_pairs
            if (self%direction(i) > 0) then
               self%batch(k, 1, i) = prediction(i, self%direction(i), k)
            end if
            self%batch(k, 4, i) = -prediction(i, 3, k)
         end do
      end do
      do i = 1, self%n_pairs
         ! 1 to 3 are P and its derivatives, 4 to 6 those of N.
         do d = 1, 4, 3
            call differentiate(fourier, self%batch(:, d, i), self%batch(:, d + 1, i))
            call differentiate(fourier, self%batch(:, d + 1, i), self%batch(:, d + 2, i))
         end do
      end do
   end subroutine fill_batch

   !> d/dtau of one row of coefficients, whatever its shape is outside.
   pure subroutine differentiate(fourier, p, derivative)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: p(*)
      real(wp), intent(inout) :: derivative(*)

      call fourier%differentiate(1, p, derivative)
   end subroutine differentiate

   !> A pair with at most one tangential direction.
   pure subroutine evaluate_pair(pair, fourier, coefficients, samples, offset, x_start, may_rest, &
                                 mean, carried, rests)
      type(event_pair_type), intent(inout) :: pair
      type(fourier_type), intent(in) :: fourier
      !> Coefficients and samples as in `batch`, without the offset (of y_n, hence taken off N); the
      !> position at tau = 0 in units of force.
      real(wp), intent(in) :: coefficients(:, :), samples(:, :), offset, x_start
      !> Whether a pair without memory may come to rest, what its mean position adds to P then, and
      !> whether it does.
      logical, intent(in) :: may_rest
      real(wp), intent(in) :: mean
      !> What a rate is less against a side 2 that slides.
      real(wp), intent(in) :: carried
      logical, intent(out) :: rests

      rests = .false.
      call fill_curves(pair%curves, fourier, coefficients, samples, offset, -carried)
      if (abs(carried) > 0.0_wp) then
         call pair%follow(x_start)
         return
      end if
      if (may_rest .and. pair%can_rest()) then
         call fill_curves(pair%curves, fourier, coefficients, samples, offset, mean)
         call pair%follow_to_rest(x_start, rests)
         if (rests) return
         call fill_curves(pair%curves, fourier, coefficients, samples, offset, 0.0_wp)
      end if
      call pair%follow(x_start)
   end subroutine evaluate_pair

   !> P and N of a pair, and what follows from them.
   pure subroutine fill_curves(curves, fourier, coefficients, samples, offset, mean)
      type(curves_type), intent(inout) :: curves
      type(fourier_type), intent(in) :: fourier
      !> As evaluate_pair.
      real(wp), intent(in) :: coefficients(:, :), samples(:, :), offset, mean
      integer :: h, k, n

      associate (c => curves)
         do h = 1, fourier%n_retained
            n = fourier%harmonic(h)
            k = fourier%column(h)
            c%tangential(n, 1) = coefficients(k, 1)
            c%normal(n, 1) = coefficients(k, 4)
            if (n == 0) cycle
            c%tangential(n, 2) = coefficients(k + 1, 1)
            c%normal(n, 2) = coefficients(k + 1, 4)
         end do
         ! Parity leaves the constant out of the unknowns, but not out of what was left from before.
         if (.not. fourier%has_constant()) c%normal(0, 1) = 0.0_wp
         c%normal(0, 1) = c%normal(0, 1) - offset
         c%samples = samples
         c%samples(:, 4) = samples(:, 4) - offset
         if (abs(mean) > 0.0_wp) then
            c%tangential(0, 1) = c%tangential(0, 1) + mean
            c%samples(:, 1) = c%samples(:, 1) + mean
         end if
         call c%combine(c%mu)
      end associate
   end subroutine fill_curves

   !> A pair with two tangential directions.
   subroutine evaluate_planar(self, i, fourier, prediction, offset, x_start, may_rest, mean)
      class(event_contact_type), intent(inout) :: self
      integer, intent(in) :: i
      type(fourier_type), intent(in) :: fourier
      !> As in `evaluate`, of this pair alone (3, n_coefficients).
      real(wp), intent(in) :: prediction(:, :), offset, x_start(2)
      !> As evaluate_pair.
      logical, intent(in) :: may_rest
      real(wp), intent(in) :: mean(2)
      real(wp) :: carry(2)

      associate (pair => self%planar(i))
         self%rests(i) = .false.
         if (allocated(self%carry)) then
            carry = self%carry(i, :)
            if (any(abs(carry) > 0.0_wp) .and. .not. pair%remembers) then
               ! Rates are those against the surface, and come to rest nowhere.
               call pair%follow(self%cells, fourier, prediction, offset, x_start, rate=carry)
               call take_results(self, i)
               return
            end if
            call pair%take_drift(carry)
         end if
         if (may_rest) call pair%follow_to_rest(self%cells, fourier, prediction, offset, x_start, &
                                                mean, self%rests(i))
         if (.not. self%rests(i)) call pair%follow(self%cells, fourier, prediction, offset, x_start)
      end associate
      call take_results(self, i)
   end subroutine evaluate_planar

   !> What the path of a pair with two tangential directions was.
   subroutine take_results(self, i)
      class(event_contact_type), intent(inout) :: self
      integer, intent(in) :: i

      self%closed(i) = self%planar(i)%closed
      self%open(i) = self%planar(i)%open
      self%moved(i) = self%planar(i)%moved
      self%drift(i) = self%planar(i)%drift
   end subroutine take_results

   !> Coefficients of the forces of a pair: projected exactly, or fitted at the instants of the
   !> collocation.
   subroutine collect(pair, fourier, force)
      type(event_pair_type), intent(inout) :: pair
      type(fourier_type), intent(in) :: fourier
      !> (n_coefficients, tangential and normal).
      real(wp), intent(inout) :: force(fourier%n_coefficients, 2)
      integer :: nc

      if (fourier%projects) then
         call pair%force(fourier%n_retained, fourier%harmonic, fourier%column, force(:, 1), &
                         force(:, 2))
         return
      end if
      nc = fourier%n_coefficients
      ! The samples of the bounds have served.
      associate (tangential => pair%curves%values, normal => pair%curves%slopes)
         call pair%values_at(fourier%n_time, tangential, normal)
         call dgemv('N', nc, fourier%n_time, 1.0_wp, fourier%analysis, nc, tangential, 1, 0.0_wp, &
                    force(1, 1), 1)
         call dgemv('N', nc, fourier%n_time, 1.0_wp, fourier%analysis, nc, normal, 1, 0.0_wp, &
                    force(1, 2), 1)
      end associate
   end subroutine collect

   !> Transposed derivatives of pairs at the last evaluation: (coefficient, component) of the input,
   !> then of the output, pair.
   !> The path of the last evaluation is differentiated, so nothing may have been evaluated since.
   !> At a switch that just begins to appear (grazing) the derivative is continuous but not smooth.
   subroutine linearize(self, fourier, wanted, x_start, jacobian, by_path)
      class(event_contact_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Pairs to differentiate (n_pairs).
      logical, intent(in) :: wanted(:)
      !> As in the evaluation (n_pairs, 2).
      real(wp), intent(in) :: x_start(:, :)
      !> Blocks of order 3 n_coefficients (input, output, n_pairs); those of other pairs stay.
      real(wp), intent(inout) :: jacobian(:, :, :)
      !> Derivatives of the friction paths (coefficient and component, pair), if they are wanted.
      real(wp), intent(inout), optional :: by_path(:, :)
      real(wp), allocatable :: block(:, :, :), path(:)
      integer :: i

      if (self%n_pairs < pairs_for_threads) then
         allocate (block(fourier%n_coefficients, fourier%n_coefficients, 3))
         allocate (path(3*fourier%n_coefficients))
         do i = 1, self%n_pairs
            if (wanted(i)) call linearize_one(i, block, path)
         end do
         return
      end if
      !$omp parallel default(none) shared(self, fourier, wanted) private(block, path, i)
      allocate (block(fourier%n_coefficients, fourier%n_coefficients, 3))
      allocate (path(3*fourier%n_coefficients))
      !$omp do schedule(dynamic)
      do i = 1, self%n_pairs
         if (wanted(i)) call linearize_one(i, block, path)
      end do
      !$omp end do
      !$omp end parallel

   contains

      ! Sections by component: rows 1.., nc + 1.., 2 nc + 1.. of the input, likewise of the output.
      subroutine linearize_one(i, block, path)
         integer, intent(in) :: i
         !> Room.
         real(wp), intent(inout) :: block(:, :, :), path(:)
         real(wp) :: start(2)
         integer :: nc, t, n

         nc = fourier%n_coefficients
         n = 2*nc
         if (self%is_planar(i)) then
            start = x_start(i, :)
            call self%planar(i)%derivative(self%cells, fourier, start, present(by_path), &
                                           jacobian(:, :, i), path)
            if (present(by_path)) by_path(:, i) = path
            return
         end if
         if (present(by_path)) call path_derivative(self, i, fourier, by_path(:, i))
         jacobian(:, :, i) = 0.0_wp
         if (fourier%projects) then
            call self%pair(i)%derivative(fourier%n_retained, fourier%harmonic, fourier%column, &
                                         block(:, :, 1), block(:, :, 2), block(:, :, 3))
         else
            call collocate(self%pair(i), fourier, block)
         end if
         if (self%has_normal(i)) jacobian(n + 1:, n + 1:, i) = block(:, :, 3)
         if (self%direction(i) == 0) return
         t = (self%direction(i) - 1)*nc
         jacobian(t + 1:t + nc, t + 1:t + nc, i) = block(:, :, 1)
         if (self%has_normal(i)) jacobian(n + 1:, t + 1:t + nc, i) = block(:, :, 2)
      end subroutine linearize_one

   end subroutine linearize

   !> Derivative of the friction path of a pair with at most one tangential direction.
   subroutine path_derivative(self, i, fourier, by_path)
      class(event_contact_type), intent(inout) :: self
      integer, intent(in) :: i
      type(fourier_type), intent(in) :: fourier
      !> (coefficient, component).
      real(wp), intent(inout) :: by_path(fourier%n_coefficients, 3)
      real(wp) :: by_normal(fourier%n_coefficients)

      by_path = 0.0_wp
      if (self%direction(i) == 0) return
      call self%pair(i)%path_derivative(fourier%n_retained, fourier%harmonic, fourier%column, &
                                        by_path(:, self%direction(i)), by_normal)
      if (self%has_normal(i)) by_path(:, 3) = by_normal
   end subroutine path_derivative

   !> The derivatives of forces that are fitted at instants.
   subroutine collocate(pair, fourier, block)
      !> The last evaluation has to be that of the same harmonics.
      type(event_pair_type), intent(inout) :: pair
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: block(fourier%n_coefficients, fourier%n_coefficients, 3)
      real(wp) :: rows(fourier%n_coefficients, fourier%n_time, 3)
      logical :: bears(fourier%n_time)
      integer :: c, k, nc

      nc = fourier%n_coefficients
      call pair%rows_at(fourier%n_retained, fourier%harmonic, fourier%column, fourier%synthesis, &
                        rows(:, :, 1), rows(:, :, 2), bears)
      ! Normal forces take the normal prediction itself wherever the pair bears.
      do k = 1, fourier%n_time
         rows(:, k, 3) = merge(fourier%synthesis(:, k), 0.0_wp, bears(k))
      end do
      do c = 1, 3
         call dgemm('N', 'T', nc, nc, fourier%n_time, 1.0_wp, rows(1, 1, c), nc, &
                    fourier%analysis, nc, 0.0_wp, block(1, 1, c), nc)
      end do
   end subroutine collocate

   !> Coefficients of the contact forces on any set of harmonics (n_pairs, 3, n_coefficients).
   !> More harmonics than those of the balance may be asked for: the forces are functions of the
   !> angle, not only of the retained coefficients.
   subroutine coefficients(self, fourier, computed, force)
      class(event_contact_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Harmonics of the last evaluation.
      integer, intent(in) :: computed(:)
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: out(fourier%n_coefficients, 3)
      integer :: i, n

      force = 0.0_wp
      out = 0.0_wp
      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            call self%planar(i)%coefficients(fourier, computed, out)
            force(i, :, :) = transpose(out)
            cycle
         end if
         ! Harmonics beyond those of the prediction are even ones, which symmetry makes vanish.
         n = count(fourier%harmonic <= self%pair(i)%curves%degree)
         call self%pair(i)%force(n, fourier%harmonic, fourier%column, out(:, 1), &
                                 out(:, 2))
         if (self%direction(i) > 0) force(i, self%direction(i), :) = out(:, 1)
         force(i, 3, :) = out(:, 2)
      end do
   end subroutine coefficients

   !> Coefficients of the contact forces of the harmonics 0..highest (n_pairs, 3, 2 highest + 1), of
   !> pairs with at most one tangential direction.
   subroutine tail(self, highest, force)
      class(event_contact_type), intent(in) :: self
      integer, intent(in) :: highest
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: out(2*highest + 1, 2)
      integer :: i

      do i = 1, self%n_pairs
         if (self%is_planar(i)) cycle
         call self%pair(i)%force_to(highest, out(:, 1), out(:, 2))
         if (self%direction(i) > 0) force(i, self%direction(i), :) = out(:, 1)
         force(i, 3, :) = out(:, 2)
      end do
   end subroutine tail

   !> Contact forces at uniform instants (n_pairs, 3, n_time).
   subroutine values(self, force)
      class(event_contact_type), intent(inout) :: self
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: out(size(force, 3), 2), planar(3, size(force, 3))
      integer :: i

      force = 0.0_wp
      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            call self%planar(i)%sample(self%cells, planar)
            force(i, :, :) = planar
            cycle
         end if
         call self%pair(i)%values_at(size(force, 3), out(:, 1), out(:, 2))
         if (self%direction(i) > 0) force(i, self%direction(i), :) = out(:, 1)
         force(i, 3, :) = out(:, 2)
      end do
   end subroutine values

   !> int |lambda_n| |dx| over a period [force**2] (n_pairs), x in units of force.
   subroutine friction_path(self, path)
      !> Its derivative goes with that of the forces (linearize), because both need the same
      !> tangents.
      class(event_contact_type), intent(inout) :: self
      real(wp), intent(out) :: path(:)
      integer :: i

      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            path(i) = self%planar(i)%friction_path()
         else
            path(i) = self%pair(i)%friction_path()
         end if
      end do
   end subroutine friction_path

   !> Share of the period that each pair spends in stick, slip and open (3, n_pairs).
   !> By durations, not by counts: they add up to one to round-off.
   pure subroutine fractions(self, share)
      class(event_contact_type), intent(in) :: self
      real(wp), intent(out) :: share(:, :)
      integer :: i

      do i = 1, self%n_pairs
         if (self%is_planar(i)) then
            share(:, i) = self%planar(i)%share()
         else
            share(:, i) = self%pair(i)%shares()
         end if
      end do
   end subroutine fractions

end module fw_event_contact
