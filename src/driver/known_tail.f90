!> What a balance of H harmonics misses because it does not know the motion above them.
!>
!> Its forces are known in every harmonic, and so is what the structure answers to them,
!> q_n = -Z_n**-1 B^T lambda_n. With that tail the prediction of every law has harmonics up to N,
!> for a rigid law y_n = lambda_n - E_n B Z_n**-1 B^T lambda_n, for an elastic one k_t B q_n: it is
!> the residual of a balance of N harmonics at (q, tail). Its harmonics up to H are what the known
!> tail does to the balance, and the derivative there is at hand:
!>
!>    q2 = q - J**-1 R(q; tail),   tail2 = tail - Z_n**-1 R_n(q; tail).
!>
!> |u2 - u| estimates the error of u, and u2 is the better answer. The same again, from u2, tells
!> whether this converges: where it does not, neither is worth anything.
module fw_known_tail
   use fw_accuracy_options, only: limits
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_harmonics_options, only: harmonics_options
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_fourier, only: to_complex, to_real
   use fw_kept_modes, only: complete_modes
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type
   use fw_linear_step, only: linear_step_type
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_reduction, only: held_basis
   use fw_recovery, only: carry_solution, largest_magnitude, recover_point
   implicit none (type, external)
   private

   public :: known_tail, relative_distance, unknown, is_like_structure, all_know_tails

   !> Where nothing is known.
   real(wp), parameter :: unknown = huge(1.0_wp)

   type :: known_tail
      !> The balance of N harmonics, evaluated and never solved; its unknowns.
      type(balance_problem), allocatable, private :: problem
      class(balance_state), allocatable, private :: finer
      real(wp), allocatable, private :: x(:), r(:)
      !> Unknowns of the balance of H harmonics, as they are corrected.
      real(wp), allocatable, private :: coarse(:)
      type(linear_step_type) :: linear
      !> Whether its answer is to be taken for the better one.
      logical :: is_better = .false.
      integer, private :: n_kept = 0, n_total = 0
      !> Observed coefficients of the last answer (2N+1, n_observed).
      real(wp), allocatable, private :: coefficients(:, :)
      logical, private :: is_built = .false.
      !> Whether the finer balance was evaluated at x last.
      logical, private :: is_evaluated = .false.
   contains
      procedure :: start
      procedure :: correct
      procedure :: next_change
      procedure :: distance_from
      procedure :: distance_apart
      procedure :: left_above
      procedure :: take
   end type known_tail

contains

   !> Take a solution of H harmonics, where `system` was evaluated last, and give it its tail.
   subroutine start(self, case, harmonics, system, x, done, error, held)
      class(known_tail), intent(inout) :: self
      type(case_type), intent(in) :: case
      !> Of the system.
      type(harmonics_options), intent(in) :: harmonics
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      !> False where the structure is singular, or the instants resolve no tail.
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      !> Modes of the structure with its contact held, see new_reduction.
      type(held_basis), intent(inout), optional :: held

      done = .false.
      if (.not. self%is_built) then
         call build(self, case, harmonics, system, error, held)
         if (allocated(error)) return
      end if
      if (self%n_total <= self%n_kept) return
      call self%finer%follow(system, error)
      if (allocated(error)) return
      self%coarse = x
      call self%linear%prepare(system, done)
      if (.not. done) return
      call carry_solution(system, self%coarse, self%finer, self%x)
      call complete_modes(self%finer, self%n_kept, self%x, done)
      if (.not. done) return
      call self%finer%residual(self%x, self%r)
      call answer_above(self, done)
      if (done) call observe(self, self%coefficients)
   end subroutine start

   !> The balance of N harmonics with the very law of the given one.
   subroutine build(self, case, harmonics, system, error, held)
      class(known_tail), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics
      type(balance_state), intent(in) :: system
      type(error_type), allocatable, intent(out) :: error
      type(held_basis), intent(inout), optional :: held
      type(harmonics_options) :: finer
      logical :: at_instants
      integer :: n

      n = harmonics%n_harmonics
      self%n_kept = n
      finer = harmonics
      self%n_total = min(limits%tail_times*n + limits%tail_more, max(limits%tail_most, 2*n))
      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         at_instants = law%n_elements > 0 .and. .not. law%facts%follows_events
      end associate
      if (at_instants) then
         ! The same instants: what they miss is asked for elsewhere, and not to be seen here.
         finer%n_time = system%problem%fourier%n_time
         self%n_total = min(self%n_total, system%problem%fourier%n_time/2 - 1)
      end if
      self%is_built = .true.
      if (self%n_total <= n) return
      finer%n_harmonics = self%n_total
      allocate (self%problem, self%finer)
      ! With the same laws: E is chosen by H, and with another one a solution would not be one.
      call build_system(case, self%problem, self%finer, error, of_level=finer, &
                        forces=system%problem%forces, held=held)
      if (allocated(error)) return
      self%linear%kind = case%solver%linear
      allocate (self%x(self%finer%n), self%r(self%finer%n))
   end subroutine build

   !> The next answer, and how far it is from the one before: the largest relative distance.
   subroutine correct(self, system, change)
      class(known_tail), intent(inout) :: self
      !> The balance of H harmonics, as at the start.
      type(balance_state), intent(inout) :: system
      real(wp), intent(out) :: change
      real(wp), allocatable :: before(:, :), r(:), step(:), tail(:)
      logical :: done

      change = unknown
      call self%finer%residual(self%x, self%r)
      self%is_evaluated = .false.
      if (.not. self%finer%work(self%problem%forces%pairs)%all_periodic()) return
      allocate (r(system%n), step(system%n))
      call carry_solution(self%finer, self%r, system, r)
      call self%linear%solve_prepared(system, r, limits%linear_tolerance, step, done)
      if (.not. done) return
      self%coarse = self%coarse + step
      call answer_above(self, done)
      if (.not. done) return
      tail = self%x
      call carry_solution(system, self%coarse, self%finer, self%x)
      call join(self%n_kept, self%finer, tail, self%x)
      call complete_modes(self%finer, self%n_kept, self%x, done)
      if (.not. done) return
      call move_alloc(self%coefficients, before)
      call observe(self, self%coefficients)
      change = relative_distance(self%coefficients, before)
   end subroutine correct

   !> How far another correction would go: where it is no smaller, the first was worth nothing.
   subroutine next_change(self, system, change)
      class(known_tail), intent(inout) :: self
      type(balance_state), intent(inout) :: system
      real(wp), intent(out) :: change
      real(wp), allocatable :: x(:), coarse(:), coefficients(:, :)

      x = self%x
      coarse = self%coarse
      coefficients = self%coefficients
      call self%correct(system, change)
      self%x = x
      self%coarse = coarse
      self%coefficients = coefficients
      self%is_evaluated = .true.
   end subroutine next_change

   !> Relative distance of the last answer from other coefficients (2H+1, n_observed).
   pure real(wp) function distance_from(self, coefficients) result(distance)
      class(known_tail), intent(in) :: self
      real(wp), intent(in) :: coefficients(:, :)

      distance = relative_distance(self%coefficients, coefficients)
   end function distance_from

   !> The same, of the last answer of another tail.
   pure real(wp) function distance_apart(self, other) result(distance)
      class(known_tail), intent(in) :: self, other

      distance = relative_distance(self%coefficients, other%coefficients)
   end function distance_apart

   !> What the harmonics above a highest one that is given back, and above N, come to, relative to
   !> the vibration: the former are known, the latter are taken for as much as follows where octaves
   !> fall to a quarter of the power.
   pure real(wp) function left_above(self, n_harmonics) result(left)
      class(known_tail), intent(in) :: self
      integer, intent(in) :: n_harmonics
      real(wp) :: vibration(size(self%coefficients, 2)), power
      integer :: first, i, octave

      left = 0.0_wp
      first = 2*(min(n_harmonics, self%n_total) + 1)
      octave = 2*(self%n_total/2 + 1)
      do i = 1, size(vibration)
         vibration(i) = norm2(self%coefficients(2:, i))
      end do
      if (maxval([vibration, 0.0_wp]) <= 0.0_wp) return
      vibration = max(vibration, limits%least_vibration*maxval(vibration))
      do i = 1, size(vibration)
         power = sum(self%coefficients(first:, i)**2) &
                 + limits%falls_to/(1.0_wp - limits%falls_to)*sum(self%coefficients(octave:, i)**2)
         left = max(left, sqrt(power)/vibration(i))
      end do
   end function left_above

   !> Harmonics above H of one set of unknowns into another.
   pure subroutine join(n_kept, system, tail, x)
      integer, intent(in) :: n_kept
      type(balance_state), intent(in) :: system
      real(wp), intent(in) :: tail(system%problem%structure%n_coordinates, *)
      real(wp), intent(inout) :: x(system%problem%structure%n_coordinates, *)
      integer :: h, k

      do h = 1, system%problem%fourier%n_retained
         if (system%problem%fourier%harmonic(h) <= n_kept) cycle
         k = system%problem%fourier%column(h)
         x(:, k:k + 1) = tail(:, k:k + 1)
      end do
   end subroutine join

   !> Above H, take J_n**-1 times the residual off the unknowns: Z_n, and what pairs add to it that
   !> stick or bear for a share of the period.
   subroutine answer_above(self, done)
      class(known_tail), intent(inout) :: self
      logical, intent(out) :: done
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: r(:, :)
      real(wp) :: share(3, self%problem%n_pairs), slope(3, self%problem%n_pairs)
      logical :: singular
      integer :: h, m

      done = .true.
      m = self%problem%structure%n_coordinates
      if (m == 0) return
      associate (f => self%finer)
         associate (list => f%problem%forces)
            call list%entry(list%pairs)%law%fractions(f%work(list%pairs), share)
         end associate
         slope(1, :) = share(1, :)
         slope(2, :) = share(1, :)
         slope(3, :) = 1.0_wp - share(3, :)
         allocate (r(m, f%problem%fourier%n_retained))
         call to_complex(f%problem%fourier, m, self%r, r)
         call lu%reserve(m)
         do h = 1, f%problem%fourier%n_retained
            if (f%problem%fourier%harmonic(h) <= self%n_kept) then
               r(:, h) = (0.0_wp, 0.0_wp)
               cycle
            end if
            call f%problem%structure%block(f%structure_state, h, lu%matrix)
            call add_pairs(f, h, slope, lu%matrix)
            call lu%factor(singular)
            done = .not. singular
            if (singular) return
            call lu%solve(1, r(:, h:h))
         end do
         call to_real(f%problem%fourier, m, r, self%r)
      end associate
      self%x = self%x - self%r
   end subroutine answer_above

   !> From Z_n to Z_n + G (E_n - Z_n) of rigid pairs, Z_n + G k of elastic ones.
   subroutine add_pairs(system, h, slope, matrix)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      !> G (3, n_pairs).
      real(wp), intent(in) :: slope(:, :)
      complex(wp), intent(inout) :: matrix(:, :)
      integer :: c, i, j, n

      n = system%problem%fourier%harmonic(h)
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         ! Of velocities: not worth a tail.
         if (any(p%order > 0)) return
         do i = 1, system%problem%n_pairs
            do c = 1, 3
               if (system%problem%joint%row(c, i) == 0) cycle
               if (.not. p%takes(i)) then
                  call system%problem%incidence%add_block(system%problem%joint%row(c, i), h, &
                     cmplx(slope(c, i)*p%stiffness(i, c), kind=wp), matrix)
                  cycle
               end if
               j = system%problem%coordinate_of(c, i)
               matrix(j, :) = (1.0_wp - slope(c, i))*matrix(j, :)
               matrix(j, j) = matrix(j, j) + slope(c, i)*p%stiffness(i, c)* &
                              p%impedance_ratio(i, c, n, system%frequency())
            end do
         end do
      end associate
   end subroutine add_pairs

   !> Observed coefficients of the present answer, its tail among them.
   subroutine observe(self, coefficients)
      class(known_tail), intent(inout) :: self
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      type(point_type) :: point

      call recover_point(self%finer, self%x, self%n_total, .false., point)
      call move_alloc(point%coefficients, coefficients)
   end subroutine observe

   !> The last answer in place of the solution, with harmonics up to a highest one.
   subroutine take(self, n_harmonics, with_contact, point)
      class(known_tail), intent(inout) :: self
      integer, intent(in) :: n_harmonics
      logical, intent(in) :: with_contact
      type(point_type), intent(inout) :: point
      type(point_type) :: whole
      integer :: i, n

      ! Its forces: the last evaluation may have been that of the answer before.
      if (.not. self%is_evaluated) call self%finer%residual(self%x, self%r)
      call recover_point(self%finer, self%x, self%n_total, with_contact, whole)
      n = 2*min(n_harmonics, self%n_total) + 1
      point%coefficients = whole%coefficients(:n, :)
      point%amplitude = [(largest_magnitude(point%coefficients(:, i)), &
                          i=1, size(point%coefficients, 2))]
      if (allocated(whole%overtaking)) call move_alloc(whole%overtaking, point%overtaking)
      if (.not. allocated(whole%force)) return
      point%force = whole%force(:, :, :n)
      call move_alloc(whole%fraction, point%fraction)
      call move_alloc(whole%dissipation, point%dissipation)
      call move_alloc(whole%obstacle_work, point%obstacle_work)
   end subroutine take

   !> Whether the structure just above H is what a rigid law takes it for, within a factor of two
   !> for most directions of pairs; elastic laws ask for nothing. With another E a pair that sticks
   !> keeps its tail as it is.
   logical function is_like_structure(system) result(is_like)
      type(balance_state), intent(in) :: system
      real(wp) :: c, k, m, ratio, s
      integer :: component, h, i, n_alike, n_all

      is_like = .true.
      n_all = 0
      n_alike = 0
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         if (.not. p%takes_balance) return
         is_like = .not. any(p%order > 0)
         if (.not. is_like) return
         h = maxval(system%problem%fourier%harmonic)
         do i = 1, system%problem%n_pairs
            if (.not. p%takes(i)) cycle
            do component = 1, 3
               if (system%problem%joint%row(component, i) == 0) cycle
               if (system%problem%joint%idle(component, i)) cycle
               n_all = n_all + 1
               if (p%has_inertia) then
                  ! The oscillator is the structure.
                  if (p%inertia(i, component) > 0.0_wp) n_alike = n_alike + 1
                  if (p%inertia(i, component) > 0.0_wp) cycle
               end if
               s = (2*h + 1)*system%frequency()
               call system%problem%structure%split(system%problem%coordinate_of(component, i), &
                                           (h + 1)*system%frequency(), m, c, k)
               ratio = (k - s**2*m)/p%stiffness(i, component)
               if (ratio > 1.0_wp/limits%alike_within .and. ratio < limits%alike_within) then
                  n_alike = n_alike + 1
               end if
            end do
         end do
      end associate
      is_like = 2*n_alike >= n_all
   end function is_like_structure

   !> Whether every rigid pair follows the motion above H by itself, as an oscillator whose mass
   !> outweighs its spring there; elastic ones and springs have no need to.
   pure logical function all_know_tails(system) result(know)
      type(balance_state), intent(in) :: system
      real(wp) :: s
      integer :: i

      know = .true.
      associate (p => system%problem%forces%entry(system%problem%forces%pairs)%law%prediction)
         if (.not. p%takes_balance) return
         know = p%has_inertia
         if (.not. know) return
         s = (maxval(system%problem%fourier%harmonic) + 1)*system%frequency()
         do i = 1, system%problem%n_pairs
            if (.not. p%takes(i)) cycle
            know = know .and. any(s**2*p%inertia(i, 1:2) > p%stiffness(i, 1:2))
         end do
      end associate
   end function all_know_tails

   !> Largest relative distance of the quantities in two sets of coefficients (2H+1, n_observed), of
   !> which the second may hold fewer harmonics: root mean square over the vibration of the first.
   pure real(wp) function relative_distance(fine, coarse) result(distance)
      real(wp), intent(in) :: fine(:, :), coarse(:, :)
      real(wp) :: vibration(size(fine, 2)), change(size(fine, 1))
      integer :: i, n

      distance = 0.0_wp
      n = size(coarse, 1)
      do i = 1, size(fine, 2)
         vibration(i) = norm2(fine(2:, i))
      end do
      if (maxval([vibration, 0.0_wp]) <= 0.0_wp) return
      vibration = max(vibration, limits%least_vibration*maxval(vibration))
      do i = 1, size(fine, 2)
         change(:n) = fine(:n, i) - coarse(:, i)
         change(n + 1:) = fine(n + 1:, i)
         ! The mean square of a constant is twice that of a harmonic of its size.
         change(1) = sqrt(2.0_wp)*change(1)
         distance = max(distance, norm2(change)/vibration(i))
      end do
   end function relative_distance

end module fw_known_tail
