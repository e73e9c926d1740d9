!> The contact problem of one step: forces lambda of the rows with
!>
!>   s = s_free - W lambda,
!>   normal      lambda_n <= 0, s_n >= 0, lambda_n s_n = 0          (Signorini),
!>   tangential  |lambda_t| <= mu |lambda_n|, in slip lambda_t = mu |lambda_n| s_t/|s_t|  (Coulomb),
!>   steadily    lambda_t = mu v/|v| lambda_n                 (side 2 slides, whatever s_t),
!>   springs     lambda = coefficient s**power,
!>   elements    lambda = f(s, ds/dt) of their rows together,
!>   others      lambda = f(s, ds/dt) at the middle of the step (laws that act at once).
!>
!> s measures from where the pair would stay closed and stuck. W is the Delassus operator, with
!> the compliance of the penalty law on its diagonal: an elastic pair is a rigid one behind its
!> springs. Semismooth Newton on the projections (Alart and Curnier 1991); where it cycles,
!> projected Gauss-Seidel sweeps (Jean 1999).
module fw_contact_step
   use fw_instant_law, only: element_motion, reserve_motion
   use fw_element_forces, only: element_forces, note_refusal
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_time_structure, only: element_rows, time_structure
   implicit none (type, external)
   private

   public :: contact_problem, new_contact_problem
   public :: state_open, state_stick, state_slip

   integer, parameter :: state_open = 0, state_stick = 1, state_slip = 2

   ! Newton's method ends in few steps or not at all; sweeps converge slowly, but seldom fail.
   integer, parameter :: max_newton = 20, max_sweeps = 400
   !> On the projections, relative to the largest force; where Newton's method stagnates at the
   !> round-off of the smallest steps, the looser one will do.
   real(wp), parameter :: tolerance = 1.0e-10_wp, loose_tolerance = 1.0e-7_wp

   !> One instant of the elements of a kind, and df/ds (output, input, element).
   type :: element_slopes
      type(element_motion) :: motion
      real(wp), allocatable :: slope(:, :, :)
   end type element_slopes

   type :: contact_problem
      !> Forces of the rows (n_rows), kept as the first guess of the next step.
      real(wp), allocatable :: force(:)
      !> Where the pair would stay without force (n_rows).
      real(wp), allocatable :: free(:)
      !> Of rows of pairs that act at once and of elements: relative displacement at the start of
      !> the step, and velocity in its middle over what the displacement gains up to there (n_rows).
      real(wp), allocatable :: start(:), speed(:)
      !> Whether the gap of the pair is closed, so that it may bear (n_pairs).
      logical, allocatable :: closed(:)
      !> What an obstacle adds to gaps in this step (n_pairs).
      real(wp), allocatable :: moved(:)
      !> state_open, state_stick or state_slip (n_pairs).
      integer, allocatable :: state(:)
      !> Largest force seen, the scale of the tolerance.
      real(wp) :: scale = 0.0_wp
      ! Workspace.
      !> Projection parameter, lambda - projection, s (n_rows each), slopes of the projections
      !> (component, component, n_pairs).
      real(wp), allocatable :: rate(:), mismatch(:), relative(:), slope(:, :, :)
      type(lu_type) :: lu
      type(element_slopes), allocatable :: elements(:)
      !> Frequency of the load [rad/s] and omega t in the middle of the step, which functions of a
      !> user are told; and what those said that had no force for a motion.
      real(wp) :: omega = 0.0_wp, tau = 0.0_wp
      type(element_forces), allocatable :: refusals
   contains
      procedure :: solve
   end type contact_problem

contains

   !> All pairs start closed and stuck, which the first evaluation corrects.
   pure function new_contact_problem(structure) result(self)
      type(time_structure), intent(in) :: structure
      type(contact_problem) :: self
      integer :: k, n

      n = structure%n_rows
      allocate (self%force(n), self%free(n), self%rate(n), self%mismatch(n), self%relative(n), &
                self%start(n), self%speed(n), source=0.0_wp)
      allocate (self%closed(structure%n_pairs), source=.true.)
      allocate (self%moved(structure%n_pairs), source=0.0_wp)
      allocate (self%state(structure%n_pairs), source=state_stick)
      allocate (self%slope(3, 3, structure%n_pairs), source=0.0_wp)
      call self%lu%reserve(n)
      allocate (self%refusals)
      allocate (self%elements(size(structure%kind)))
      do k = 1, size(self%elements)
         associate (own => self%elements(k), kind => structure%kind(k))
            n = size(kind%row, 1)
            call reserve_motion(n, 1, kind%law%needs_scratch, own%motion)
            own%motion%wants_slopes = .true.
            allocate (own%slope(n, n, size(kind%row, 2)), source=0.0_wp)
         end associate
      end do
   end function new_contact_problem

   !> Solve for the forces with the operator w (n_rows, n_rows); `done` is false where neither
   !> method converged.
   subroutine solve(self, structure, w, done)
      class(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      !> Symmetric, positive semidefinite; its diagonal positive, or a row could not be moved.
      real(wp), intent(in) :: w(:, :)
      logical, intent(out) :: done
      integer :: iteration
      logical :: singular

      done = .true.
      if (structure%n_rows == 0) return
      self%refusals%status = 0
      ! The guess is the force of the last step.
      call set_rates(self, structure, w)
      do iteration = 1, max_newton
         call evaluate(self, structure, w)
         if (self%refusals%status /= 0) exit
         done = maxval(abs(self%mismatch)) <= tolerance*self%scale
         if (done) return
         call newton_step(self, structure, w, singular)
         if (singular) exit
      end do
      ! A motion without a force is none to go on from.
      if (self%refusals%status == 0) call evaluate(self, structure, w)
      done = self%refusals%status == 0
      if (.not. done) return
      ! Cycling at round-off is no reason for sweeps.
      done = maxval(abs(self%mismatch)) <= loose_tolerance*self%scale .and. .not. singular
      if (.not. done) call sweep(self, structure, w, done)
   end subroutine solve

   !> Projection parameters: the inverse of the pair's own compliance, one for both tangential
   !> directions.
   pure subroutine set_rates(self, structure, w)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      !> Delassus operator (n_rows, n_rows) [length/force].
      real(wp), intent(in) :: w(:, :)
      real(wp) :: mean
      integer :: i, r

      do r = 1, structure%n_rows
         self%rate(r) = 1.0_wp/w(r, r)
      end do
      do i = 1, structure%n_pairs
         if (any(structure%row(1:2, i) == 0)) cycle
         ! One parameter, so that the projection onto the disc commutes with turning the axes.
         mean = 2.0_wp/(w(structure%row(1, i), structure%row(1, i)) + &
                        w(structure%row(2, i), structure%row(2, i)))
         self%rate(structure%row(1:2, i)) = mean
      end do
   end subroutine set_rates

   !> s, the mismatch lambda - projection(lambda + rate s), states and slopes of the projection.
   subroutine evaluate(self, structure, w)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: w(:, :)
      integer :: i, k, r

      ! The largest force so far, not of this step: between two contacts all forces vanish.
      self%scale = max(self%scale, maxval(abs(self%force)))
      self%relative = self%free
      do r = 1, structure%n_rows
         self%relative = self%relative - w(:, r)*self%force(r)
      end do
      do i = 1, structure%n_pairs
         if (structure%at_once(i)) then
            call follow_pair(self, structure, i)
         else
            call project_pair(self, structure, i)
         end if
      end do
      do k = 1, size(self%elements)
         do i = 1, size(structure%kind(k)%row, 2)
            call follow_element(structure%kind(k), i, self, self%elements(k))
         end do
      end do
      ! A spring knows no states: its force is a function of s, and the mismatch its residual.
      do i = 1, structure%n_springs
         r = structure%n_rows - structure%n_springs + i
         self%mismatch(r) = self%force(r) - &
                            structure%coefficient(i)*self%relative(r)**structure%power(i)
      end do
   end subroutine evaluate

   !> One pair: mismatch, state, and slope = d projection / d y with y = lambda + rate s.
   pure subroutine project_pair(self, structure, i)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      integer, intent(in) :: i
      real(wp) :: y(3), e(2), p, length, limit
      integer :: c, r

      y = 0.0_wp
      do c = 1, 3
         r = structure%row(c, i)
         if (r > 0) y(c) = self%force(r) + self%rate(r)*self%relative(r)
      end do
      ! A constant load takes the place of the normal row.
      if (structure%row(3, i) == 0) y(3) = -structure%normal_load(i)
      ! The gap decides first: an open gap bears nothing, whatever y says.
      p = merge(max(-y(3), 0.0_wp), 0.0_wp, self%closed(i))
      length = norm2(y(1:2))
      limit = structure%mu(i)*p
      associate (slope => self%slope(:, :, i))
         slope = 0.0_wp
         if (p <= 0.0_wp) then
            self%state(i) = state_open
            y = 0.0_wp
         else
            if (structure%row(3, i) > 0) slope(3, 3) = 1.0_wp
            if (structure%leans(i)) then
               ! Where side 2 slides to, friction follows from what presses alone.
               self%state(i) = state_slip
               y(1:2) = -p*structure%lean(:, i)
               if (structure%row(3, i) > 0) slope(1:2, 3) = structure%lean(:, i)
            else if (length <= limit) then
               self%state(i) = state_stick
               slope(1, 1) = 1.0_wp
               slope(2, 2) = 1.0_wp
            else
               self%state(i) = state_slip
               e = y(1:2)/length
               y(1:2) = limit*e
               ! d of limit e: the disc turns the force, and grows with p.
               slope(1:2, 1) = -limit/length*e*e(1)
               slope(1:2, 2) = -limit/length*e*e(2)
               slope(1, 1) = slope(1, 1) + limit/length
               slope(2, 2) = slope(2, 2) + limit/length
               if (structure%row(3, i) > 0) slope(1:2, 3) = -structure%mu(i)*e
            end if
         end if
         do c = 1, 3
            r = structure%row(c, i)
            if (r > 0) self%mismatch(r) = self%force(r) - y(c)
         end do
      end associate
   end subroutine project_pair

   !> One pair whose forces are functions of displacement and velocity: mismatch lambda - f, and
   !> slope = df/ds (output, input).
   pure subroutine follow_pair(self, structure, i)
      class(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      integer, intent(in) :: i
      real(wp) :: u(3), v(3), force(3), slope(3, 3), by_s(3)
      integer :: c, r

      u = 0.0_wp
      v = 0.0_wp
      by_s = 0.0_wp
      associate (law => structure%law)
         do c = 1, 3
            r = structure%row(c, i)
            if (r == 0) cycle
            u(c) = self%relative(r)
            v(c) = self%speed(r)*(u(c) - self%start(r))
            by_s(c) = law%prediction%stiffness(i, c)
            if (law%prediction%order_of(i, c) > 0) by_s(c) = by_s(c)*self%speed(r)
         end do
         call law%at_instant(i, law%input_at(i, u, v, structure%depth(i) + self%moved(i)), &
                             force, slope)
         self%state(i) = state_open
         ! Smooth friction never sticks; without friction there is nothing to slip.
         if (force(3) < 0.0_wp) self%state(i) = merge(state_slip, state_stick, &
                                                      law%prediction%order_of(i, 1) > 0 .or. &
                                                      structure%leans(i))
      end associate
      do c = 1, 3
         self%slope(c, :, i) = slope(:, c)*by_s
         r = structure%row(c, i)
         if (r > 0) self%mismatch(r) = self%force(r) - force(c)
      end do
   end subroutine follow_pair

   !> One element: mismatch lambda - f of its rows, and slope = df/ds (output, input).
   subroutine follow_element(kind, i, self, own)
      type(element_rows), intent(in) :: kind
      integer, intent(in) :: i
      type(contact_problem), intent(inout) :: self
      type(element_slopes), intent(inout) :: own
      integer :: c, r

      associate (motion => own%motion)
         motion%element = i
         motion%omega = self%omega
         motion%tau(1) = self%tau
         motion%u = 0.0_wp
         motion%v = 0.0_wp
         motion%by_u = 0.0_wp
         motion%by_v = 0.0_wp
         do c = 1, size(kind%row, 1)
            r = kind%row(c, i)
            if (r == 0) cycle
            motion%u(c, 1) = self%relative(r)
            motion%v(c, 1) = self%speed(r)*(self%relative(r) - self%start(r))
         end do
         call kind%law%act(motion)
         own%slope(:, :, i) = 0.0_wp
         if (motion%status /= 0) then
            ! What ends the run comes before what takes the step back.
            if (self%refusals%status <= 0) call note_refusal(kind%law, motion, self%refusals)
            motion%status = 0
            motion%force = 0.0_wp
         end if
         do c = 1, size(kind%row, 1)
            r = kind%row(c, i)
            if (r == 0) cycle
            self%mismatch(r) = self%force(r) - motion%force(c, 1)
            own%slope(:, c, i) = motion%by_u(c, :, 1) + self%speed(r)*motion%by_v(c, :, 1)
         end do
      end associate
   end subroutine follow_element

   !> force <- force - J^-1 mismatch, J = 1 - slope (1 - rate W).
   subroutine newton_step(self, structure, w, singular)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: w(:, :)
      logical, intent(out) :: singular
      real(wp) :: tangent
      integer :: i, c, d, k, r, q

      associate (jacobian => self%lu%matrix)
         ! ds = -W dlambda, so that y = lambda + rate s has dy = (1 - rate W) dlambda.
         jacobian = 0.0_wp
         do r = 1, structure%n_rows
            jacobian(r, r) = 1.0_wp
         end do
         do i = 1, structure%n_pairs
            do c = 1, 3
               r = structure%row(c, i)
               if (r == 0) cycle
               do d = 1, 3
                  q = structure%row(d, i)
                  if (q == 0 .or. abs(self%slope(c, d, i)) <= 0.0_wp) cycle
                  if (structure%at_once(i)) then
                     ! Of lambda - f(s) = 0, with ds = -W dlambda.
                     jacobian(r, :) = jacobian(r, :) + self%slope(c, d, i)*w(q, :)
                     cycle
                  end if
                  jacobian(r, q) = jacobian(r, q) - self%slope(c, d, i)
                  ! 1 - slope (1 - rate W), row by row.
                  jacobian(r, :) = jacobian(r, :) + self%slope(c, d, i)*self%rate(q)*w(q, :)
               end do
            end do
         end do
         do k = 1, size(self%elements)
            do i = 1, size(structure%kind(k)%row, 2)
               do c = 1, size(structure%kind(k)%row, 1)
                  r = structure%kind(k)%row(c, i)
                  if (r == 0) cycle
                  do d = 1, size(structure%kind(k)%row, 1)
                     q = structure%kind(k)%row(d, i)
                     if (q > 0) jacobian(r, :) = jacobian(r, :) + &
                                                 self%elements(k)%slope(c, d, i)*w(q, :)
                  end do
               end do
            end do
         end do
         ! Of lambda - coefficient s**power = 0, again with ds = -W dlambda.
         do i = 1, structure%n_springs
            r = structure%n_rows - structure%n_springs + i
            tangent = structure%coefficient(i)*real(structure%power(i), wp)* &
                      self%relative(r)**(structure%power(i) - 1)
            jacobian(r, :) = jacobian(r, :) + tangent*w(r, :)
         end do
      end associate
      call self%lu%factor(singular)
      if (singular) return
      call self%lu%solve(self%mismatch)
      self%force = self%force - self%mismatch
   end subroutine newton_step

   !> Projected Gauss-Seidel: each pair in turn takes its projection, springs a Newton step.
   subroutine sweep(self, structure, w, done)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: w(:, :)
      logical, intent(out) :: done
      real(wp) :: change, tangent
      integer :: i, c, r, k

      ! Newton's method may have left NaN or infinities behind.
      self%force = merge(self%force, 0.0_wp, abs(self%force) <= huge(1.0_wp))
      do k = 1, max_sweeps
         call evaluate(self, structure, w)
         done = maxval(abs(self%mismatch)) <= tolerance*self%scale .and. &
                self%refusals%status == 0
         if (done .or. self%refusals%status /= 0) return
         do i = 1, structure%n_pairs
            ! With the relative motion as the pairs before have left it.
            if (structure%at_once(i)) then
               call follow_pair(self, structure, i)
            else
               call project_pair(self, structure, i)
            end if
            do c = 1, 3
               r = structure%row(c, i)
               if (r == 0) cycle
               change = -self%mismatch(r)
               if (structure%at_once(i)) change = change/(1.0_wp + max(self%slope(c, c, i), &
                                                                       0.0_wp)*w(r, r))
               self%force(r) = self%force(r) + change
               self%relative = self%relative - w(:, r)*change
            end do
         end do
         call sweep_elements(self, structure, w)
         ! By Newton's method on the spring's own row: the others stand still meanwhile.
         do i = 1, structure%n_springs
            r = structure%n_rows - structure%n_springs + i
            tangent = structure%coefficient(i)*real(structure%power(i), wp)* &
                      self%relative(r)**(structure%power(i) - 1)
            change = -(self%force(r) - structure%coefficient(i)* &
                       self%relative(r)**structure%power(i))/(1.0_wp + tangent*w(r, r))
            self%force(r) = self%force(r) + change
            self%relative = self%relative - w(:, r)*change
         end do
      end do
   end subroutine sweep

   !> Each element in turn: Newton steps of its rows by their own slopes.
   subroutine sweep_elements(self, structure, w)
      type(contact_problem), intent(inout) :: self
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: w(:, :)
      real(wp) :: change
      integer :: c, i, k, r

      do k = 1, size(self%elements)
         do i = 1, size(structure%kind(k)%row, 2)
            call follow_element(structure%kind(k), i, self, self%elements(k))
            do c = 1, size(structure%kind(k)%row, 1)
               r = structure%kind(k)%row(c, i)
               if (r == 0) cycle
               change = -self%mismatch(r)/(1.0_wp + w(r, r)* &
                                           max(self%elements(k)%slope(c, c, i), 0.0_wp))
               self%force(r) = self%force(r) + change
               self%relative = self%relative - w(:, r)*change
            end do
         end do
      end do
   end subroutine sweep_elements

end module fw_contact_step
