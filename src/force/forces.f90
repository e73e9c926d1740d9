!> Contact forces of all pairs over a period, in the frequency domain: predicted forces in,
!> contact forces and their exact derivative out (alternating frequency/time).
!>
!> A system fills `prediction` (coefficients of y), calls `evaluate`, reads `force`; after
!> `linearize` the derivative of each pair is in `jacobian`, or is the identity (pair_stuck) or
!> zero (pair_open) and not stored.
module fw_forces
   use fw_kinds, only: wp
   use fw_correction, only: march_turn_1d
   use fw_correction, only: march_turn_2d
   use fw_correction, only: project_turn
   use fw_correction_derivative, only: add_start
   use fw_correction_derivative, only: limit_derivative
   use fw_correction_derivative, only: march_derivative
   use fw_event_contact, only: event_contact_type
   use fw_event_contact, only: new_event_contact
   use fw_fourier, only: fourier_type
   use fw_lapack, only: dgemm
   use fw_sampled_turn, only: limit_is_unique
   use fw_sampled_turn, only: settle_samples
   use fw_settling, only: periodic_tolerance
   use fw_settling, only: shakedown_turns
   use fw_slip, only: slip_gradient
   use fw_slip, only: slip_work
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: forces_type, new_forces
   public :: pair_stuck, pair_open, pair_mixed

   !> Stuck and closed, or open, at every instant of every turn; or anything else.
   integer, parameter :: pair_stuck = 1, pair_open = 2, pair_mixed = 3
   !> Pairs marched together: one cache line, and a whole number of vector registers.
   integer, parameter :: block_size = 8
   !> Turns after which the limit of a march is looked for by Newton's method. One direction needs
   !> one; a random sample with two needed 4 at most, pairs of a blade root that creep thousands.
   integer, parameter :: plain_turns = 4
   !> Change of x over the last turn, as a part of the largest predicted force, above which a march
   !> counts as not periodic.
   real(wp), parameter :: negligible_drift = 1.0e-9_wp
   !> Distance from the friction cone, in the same measure, that round-off leaves of a pair that
   !> has settled on it.
   real(wp), parameter :: touch = 1.0e-10_wp

   type :: forces_type
      integer :: n_pairs = 0
      !> Friction coefficient (n_pairs).
      real(wp), allocatable :: mu(:)
      !> Which of t1, t2, n exist (3, n_pairs).
      logical, allocatable :: present(:, :)
      logical :: two_directions = .false.
      !> Whether pairs remember their position (false: velocity-level law).
      logical :: remembers = .true.
      !> Coefficients of predicted and contact forces (n_pairs, 3, n_coefficients).
      real(wp), allocatable :: prediction(:, :, :), force(:, :, :)
      !> The same at the instants (n_pairs, 3, n_time).
      real(wp), allocatable :: prediction_time(:, :, :), force_time(:, :, :)
      !> Constant part of the predicted normal force: preload, or stiffness times gap (n_pairs).
      real(wp), allocatable :: offset(:)
      !> Bound of the predicted tangential forces, and change of x over the last turn (n_pairs).
      real(wp), allocatable :: scale(:), drift(:)
      !> Corrected position [force] where the march starts, and after its last turn (n_pairs, 2).
      real(wp), allocatable :: x_start(:, :), x(:, :)
      !> Smallest mu p - |d|, smallest p and turns needed (n_pairs).
      real(wp), allocatable :: margin(:), pressure(:)
      integer, allocatable :: turns(:)
      !> Whether the march ends at the limit that `settle` found (n_pairs).
      logical, allocatable :: settled(:)
      !> pair_stuck, pair_open or pair_mixed (n_pairs).
      integer, allocatable :: state(:)
      !> The states at which `linearize` was called last: a derivative may be kept while the forces
      !> move on.
      integer, allocatable :: linear_state(:)
      !> Transposed derivative of the force by the prediction of each pair:
      !> (coefficient, component) of the input, then of the output, pair.
      real(wp), allocatable :: jacobian(:, :, :)
      !> Paths event by event; not allocated where the instants decide (uniform sampling).
      type(event_contact_type), allocatable :: events
      !> Sliding under pressure over the period [force**2] (n_pairs), and its derivative by the
      !> coefficients of the prediction (coefficient, component; pair): only where asked for.
      logical :: measures_slip = .false.
      real(wp), allocatable :: slip(:), slip_derivative(:, :)
   contains
      procedure :: measure_slip
      procedure :: resolve_events
      procedure :: sample
      procedure :: coefficients
      procedure :: friction_path
      procedure :: evaluate
      procedure :: linearize
      procedure :: always_closed
      procedure :: all_open
      procedure :: all_periodic
      procedure :: fractions
   end type forces_type

contains

   !> Room for the forces of pairs; the march starts from x = 0, the unstrained assembly.
   pure function new_forces(mu, present, fourier) result(self)
      !> Friction coefficient (n_pairs).
      real(wp), intent(in) :: mu(:)
      !> Which components exist (3, n_pairs).
      logical, intent(in) :: present(:, :)
      type(fourier_type), intent(in) :: fourier
      type(forces_type) :: self
      integer :: n, nc, nt

      n = size(mu)
      nc = fourier%n_coefficients
      nt = fourier%n_time
      self%n_pairs = n
      self%mu = mu
      self%present = present
      self%two_directions = any(present(2, :))
      allocate (self%prediction(n, 3, nc), self%force(n, 3, nc), source=0.0_wp)
      allocate (self%prediction_time(n, 3, nt), self%force_time(n, 3, nt), source=0.0_wp)
      allocate (self%x_start(n, 2), self%x(n, 2), source=0.0_wp)
      allocate (self%margin(n), self%pressure(n), self%offset(n), self%scale(n), self%drift(n), &
         source=0.0_wp)
      allocate (self%turns(n), source=0)
      allocate (self%settled(n), source=.false.)
      allocate (self%state(n), self%linear_state(n), source=pair_stuck)
   end function new_forces

   !> Contact forces from the predicted ones.
   subroutine evaluate(self, fourier)
      class(forces_type), intent(inout) :: self
      type(fourier_type), intent(inout) :: fourier
      integer :: first, n_blocks, block, k

      if (self%n_pairs == 0) return
      if (allocated(self%events)) then
         call evaluate_events(self, fourier)
         return
      end if
      call fourier%to_time(3*self%n_pairs, self%prediction, self%prediction_time)
      do k = 1, fourier%n_time
         self%prediction_time(:, 3, k) = self%prediction_time(:, 3, k) + self%offset
      end do
      self%scale = 0.0_wp
      do k = 1, fourier%n_coefficients
         self%scale = self%scale + abs(self%prediction(:, 1, k)) + abs(self%prediction(:, 2, k))
      end do
      n_blocks = (self%n_pairs + block_size - 1)/block_size
      !$omp parallel do default(none) shared(self, n_blocks, fourier) private(first, block) &
      !$omp schedule(static) if(self%n_pairs >= pairs_for_threads)
      do block = 1, n_blocks
         first = (block - 1)*block_size + 1
         call march(self, fourier%n_time, first, min(first + block_size - 1, self%n_pairs))
      end do
      !$omp end parallel do
      call fourier%to_coefficients(3*self%n_pairs, self%force_time, self%force)
      call classify(self)
      if (self%measures_slip) call self%friction_path(self%slip)
   end subroutine evaluate

   !> Follow the pairs from event to event instead of from instant to instant. Set `remembers`
   !> before.
   pure subroutine resolve_events(self, fourier)
      class(forces_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier

      allocate (self%events)
      call new_event_contact(self%mu, self%present, self%remembers, fourier, self%events)
   end subroutine resolve_events

   !> Contact forces along the paths. `margin` and `pressure` only have their signs.
   subroutine evaluate_events(self, fourier)
      type(forces_type), intent(inout) :: self
      type(fourier_type), intent(inout) :: fourier
      integer :: i, k

      call self%events%evaluate(fourier, self%prediction, self%offset, self%x_start, self%force, &
                                self%x)
      self%turns = 1
      self%drift = self%events%drift
      self%scale = 0.0_wp
      do k = 1, fourier%n_coefficients
         self%scale = self%scale + abs(self%prediction(:, 1, k)) + abs(self%prediction(:, 2, k))
      end do
      do i = 1, self%n_pairs
         self%pressure(i) = merge(1.0_wp, 0.0_wp, self%events%closed(i))
         self%margin(i) = merge(-1.0_wp, 0.0_wp, self%events%moved(i))
         self%state(i) = pair_mixed
         if (self%events%open(i)) self%state(i) = pair_open
         if (self%events%closed(i) .and. .not. self%events%moved(i)) self%state(i) = pair_stuck
      end do
      if (self%measures_slip) call self%friction_path(self%slip)
   end subroutine evaluate_events

   !> Make the forces at the instants available in `force_time`; under uniform sampling they are.
   subroutine sample(self)
      class(forces_type), intent(inout) :: self

      if (allocated(self%events)) call self%events%values(self%force_time)
   end subroutine sample

   !> Coefficients of the contact forces on another set of harmonics over the same instants
   !> (n_pairs, 3, n_coefficients).
   subroutine coefficients(self, computed, fourier, force)
      class(forces_type), intent(inout) :: self
      !> Harmonics of the last evaluation, and those wanted.
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(inout) :: fourier
      real(wp), intent(inout) :: force(:, :, :)

      if (allocated(self%events)) then
         call self%events%coefficients(fourier, computed%harmonic, force)
      else
         call fourier%to_coefficients(3*self%n_pairs, self%force_time, force)
      end if
   end subroutine coefficients

   !> int |lambda_n| |dx| of every pair over a period, x the corrected position in units of force
   !> [force**2] (n_pairs): divided by the tangential prediction stiffness, what Archard's law
   !> takes. Exact with events, a sum over the instants otherwise.
   subroutine friction_path(self, path)
      class(forces_type), intent(inout) :: self
      real(wp), intent(out) :: path(:)

      if (allocated(self%events)) then
         call self%events%friction_path(path)
      else
         call slip_work(self%n_pairs, size(self%force_time, 3), self%mu, self%prediction_time, &
                        self%remembers, self%x, path)
      end if
   end subroutine friction_path

   !> Ask for `slip`, and for its derivative after `linearize`, from now on.
   pure subroutine measure_slip(self, n_coefficients)
      class(forces_type), intent(inout) :: self
      integer, intent(in) :: n_coefficients

      self%measures_slip = .true.
      allocate (self%slip(self%n_pairs), source=0.0_wp)
      allocate (self%slip_derivative(3*n_coefficients, self%n_pairs), source=0.0_wp)
   end subroutine measure_slip

   !> State of every pair over the whole march.
   pure subroutine classify(self)
      class(forces_type), intent(inout) :: self
      integer :: i, k

      do i = 1, self%n_pairs
         if (self%margin(i) >= 0.0_wp .and. self%pressure(i) > 0.0_wp) then
            self%state(i) = pair_stuck
            cycle
         end if
         self%state(i) = pair_open
         if (self%pressure(i) > 0.0_wp) self%state(i) = pair_mixed
         do k = 1, size(self%force_time, 3)
            if (self%state(i) == pair_mixed) exit
            if (self%force_time(i, 3, k) < 0.0_wp) self%state(i) = pair_mixed
         end do
      end do
   end subroutine classify

   !> March pairs first..last until their state repeats after a period.
   subroutine march(self, n_time, first, last)
      class(forces_type), intent(inout) :: self
      integer, intent(in) :: n_time, first, last
      integer :: turn

      self%x(first:last, :) = self%x_start(first:last, :)
      self%margin(first:last) = huge(1.0_wp)
      self%pressure(first:last) = huge(1.0_wp)
      self%settled(first:last) = .false.
      if (.not. self%remembers) then
         self%drift(first:last) = 0.0_wp
         call project_turn(self%n_pairs, n_time, first, last, self%mu, self%prediction_time, &
                           self%force_time, self%margin, self%pressure)
         self%turns(first:last) = 1
         return
      end if
      self%turns(first:last) = 0
      do turn = 1, plain_turns
         call march_turn(self, n_time, first, last, turn)
         if (all(self%turns(first:last) > 0)) return
      end do
      call find_limits(self, n_time, first, last)
      call march_turn(self, n_time, first, last, plain_turns + 1)
      where (self%turns(first:last) == 0) self%turns(first:last) = shakedown_turns
   end subroutine march

   !> One turn, and which pairs repeat after it.
   subroutine march_turn(self, n_time, first, last, turn)
      class(forces_type), intent(inout) :: self
      integer, intent(in) :: n_time, first, last, turn
      real(wp) :: start(block_size, 2)
      integer :: i

      start(:last - first + 1, :) = self%x(first:last, :)
      if (self%two_directions) then
         call march_turn_2d(self%n_pairs, n_time, first, last, self%mu, self%prediction_time, &
                            self%x, self%force_time, self%margin, self%pressure)
      else
         call march_turn_1d(self%n_pairs, n_time, first, last, self%mu, self%prediction_time, &
                            self%x, self%force_time, self%margin, self%pressure)
      end if
      do i = first, last
         self%drift(i) = maxval(abs(self%x(i, :) - start(i - first + 1, :)))
         if (self%turns(i) > 0 .or. self%settled(i)) cycle
         if (self%drift(i) <= periodic_tolerance*self%scale(i)) self%turns(i) = turn
      end do
   end subroutine march_turn

   !> Bring the pairs that do not repeat yet to the limit of their march.
   subroutine find_limits(self, n_time, first, last)
      class(forces_type), intent(inout) :: self
      integer, intent(in) :: n_time, first, last
      real(wp) :: x(2)
      integer :: i

      do i = first, last
         if (self%turns(i) > 0) cycle
         x = self%x(i, :)
         call settle_samples(self%n_pairs, n_time, i, self%prediction_time, self%mu(i), &
                             self%scale(i), periodic_tolerance, x, self%settled(i))
         self%x(i, :) = x
      end do
   end subroutine find_limits

   !> Derivatives of all mixed pairs at the last evaluated prediction.
   subroutine linearize(self, fourier)
      class(forces_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), allocatable :: rows(:, :, :, :), dx(:, :, :), y(:, :)
      real(wp), allocatable :: by_start(:, :, :), weight(:, :, :)
      real(wp) :: x(2)
      integer :: i, nc
      logical :: unique

      self%linear_state = self%state
      if (.not. any(self%state == pair_mixed)) return
      nc = fourier%n_coefficients
      if (.not. allocated(self%jacobian)) allocate (self%jacobian(3*nc, 3*nc, self%n_pairs))
      if (allocated(self%events)) then
         ! Where slip is not measured, the derivative of it is not allocated: not present.
         call self%events%linearize(fourier, self%state == pair_mixed, self%x_start, &
                                    self%jacobian, self%slip_derivative)
         return
      end if
      !$omp parallel default(none) shared(self, fourier, nc) &
      !$omp private(rows, dx, y, by_start, weight, x, i, unique) &
      !$omp if(self%n_pairs >= pairs_for_threads)
      allocate (rows(nc, 3, 2, fourier%n_time), dx(nc, 3, 2), y(3, fourier%n_time))
      allocate (by_start(2, 2, fourier%n_time), weight(2, 2, nc))
      !$omp do schedule(dynamic)
      do i = 1, self%n_pairs
         if (self%state(i) /= pair_mixed) cycle
         y = self%prediction_time(i, :, :)
         call derive(self, fourier, i, y, x, rows, dx, unique, by_start)
         call project(self%jacobian(:, :, i), fourier, rows, y(3, :), self%present(3, i))
         if (unique) call project_start(self%jacobian(:, :, i), fourier, dx, by_start, weight)
         if (.not. self%measures_slip) cycle
         if (unique) call add_start(3*nc, fourier%n_time, by_start, dx, rows)
         call slip_gradient(fourier%n_time, nc, fourier%synthesis, y, self%mu(i), &
                            self%present(:, i), self%remembers, x, rows, self%slip_derivative(:, i))
      end do
      !$omp end do
      !$omp end parallel
   end subroutine linearize

   !> Derivative of the friction of a pair at the instants. A limit that is the only one (unique)
   !> has a derivative of its own, dx, whose part in the rows is left to `project_start`; any other
   !> carries that of the way to it.
   subroutine derive(self, fourier, pair, y, x, rows, dx, unique, by_start)
      class(forces_type), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: pair
      real(wp), intent(in) :: y(3, fourier%n_time)
      !> Corrected position at the end of the period.
      real(wp), intent(out) :: x(2)
      real(wp), intent(inout) :: rows(fourier%n_coefficients, 3, 2, fourier%n_time)
      real(wp), intent(inout) :: dx(fourier%n_coefficients, 3, 2)
      logical, intent(out) :: unique
      !> Of a unique limit: derivative of the position at the instants by that at the start.
      real(wp), intent(inout) :: by_start(2, 2, fourier%n_time)
      real(wp) :: inverse(2, 2)

      unique = .false.
      x = self%x(pair, :)
      if (self%settled(pair)) then
         call limit_is_unique(self%n_pairs, fourier%n_time, pair, self%prediction_time, &
                              self%mu(pair), touch*self%scale(pair), x, unique, inverse, by_start)
      end if
      if (unique) then
         call limit_derivative(fourier%n_time, fourier%n_coefficients, fourier%synthesis, y, &
                               self%mu(pair), touch*self%scale(pair), self%present(:, pair), &
                               inverse, x, rows, dx)
      else
         x = self%x_start(pair, :)
         dx = 0.0_wp
         call march_derivative(fourier%n_time, fourier%n_coefficients, self%turns(pair), &
                               fourier%synthesis, y, self%mu(pair), 0.0_wp, self%present(:, pair), &
                               self%remembers, x, rows, dx)
      end if
   end subroutine derive

   !> From rows at the instants to the transposed derivative between coefficients.
   subroutine project(jacobian, fourier, rows, y_n, has_normal)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: rows(3*fourier%n_coefficients, 2, fourier%n_time)
      real(wp), intent(in) :: y_n(:)
      logical, intent(in) :: has_normal
      integer :: nc, c, k, j
      real(wp) :: factor
      logical :: closes

      nc = fourier%n_coefficients
      do c = 1, 2
         call dgemm('N', 'T', 3*nc, nc, fourier%n_time, 1.0_wp, rows(1, c, 1), 6*nc, &
                    fourier%analysis, nc, 0.0_wp, jacobian(1, (c - 1)*nc + 1), 3*nc)
      end do
      jacobian(:, 2*nc + 1:) = 0.0_wp
      if (.not. has_normal) return
      ! A pair that bears throughout keeps its coefficients; of any other, the instants of the
      ! rarer state are added up.
      closes = 2*count(y_n < 0.0_wp) > fourier%n_time .and. fourier%projects .and. &
               fourier%n_time > 2*maxval(fourier%harmonic)
      factor = merge(-1.0_wp, 1.0_wp, closes)
      do k = 1, fourier%n_time
         if ((y_n(k) < 0.0_wp) .eqv. closes) cycle
         do j = 1, nc
            jacobian(2*nc + 1:, 2*nc + j) = jacobian(2*nc + 1:, 2*nc + j) + &
                                            factor*fourier%analysis(j, k)*fourier%synthesis(:, k)
         end do
      end do
      if (.not. closes) return
      do j = 1, nc
         jacobian(2*nc + j, 2*nc + j) = jacobian(2*nc + j, 2*nc + j) + 1.0_wp
      end do
   end subroutine project

   !> What the start of a turn adds to the projected rows: of rank two.
   subroutine project_start(jacobian, fourier, dx, by_start, weight)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: dx(3*fourier%n_coefficients, 2), by_start(2, 2, fourier%n_time)
      !> Room.
      real(wp), intent(inout) :: weight(2, 2, fourier%n_coefficients)
      integer :: c, j, column, nc

      nc = fourier%n_coefficients
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

   !> Whether a pair bears at every instant.
   elemental logical function always_closed(self, pair)
      class(forces_type), intent(in) :: self
      integer, intent(in) :: pair

      always_closed = self%pressure(pair) > 0.0_wp
   end function always_closed

   !> Whether the march of every pair has become periodic.
   pure logical function all_periodic(self)
      class(forces_type), intent(in) :: self

      all_periodic = all(self%drift <= negligible_drift*self%scale)
   end function all_periodic

   !> Whether no pair bears at any instant.
   pure logical function all_open(self)
      class(forces_type), intent(in) :: self

      all_open = all(self%state == pair_open)
   end function all_open

   !> Share of the period that each pair spends in stick, slip and open (3, n_pairs).
   pure subroutine fractions(self, share)
      class(forces_type), intent(in) :: self
      real(wp), intent(out) :: share(:, :)
      integer :: i, k, n_time
      real(wp) :: tangential, limit
      logical :: sticks
      ! A slipping force lies on the cone to round-off.
      real(wp), parameter :: on_cone = 1.0_wp - 1.0e-12_wp

      if (allocated(self%events)) then
         call self%events%fractions(share)
         return
      end if
      n_time = size(self%force_time, 3)
      share = 0.0_wp
      do k = 1, n_time
         do i = 1, self%n_pairs
            limit = -self%mu(i)*self%force_time(i, 3, k)
            tangential = norm2(self%force_time(i, 1:2, k))
            if (self%force_time(i, 3, k) >= 0.0_wp) then
               share(3, i) = share(3, i) + 1.0_wp
               cycle
            end if
            sticks = tangential < on_cone*limit .or. self%margin(i) >= 0.0_wp
            if (sticks) then
               share(1, i) = share(1, i) + 1.0_wp
            else
               share(2, i) = share(2, i) + 1.0_wp
            end if
         end do
      end do
      share = share/real(n_time, wp)
   end subroutine fractions

end module fw_forces
