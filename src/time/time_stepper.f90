!> Integration over a period with contact: implicit midpoint steps (fw_step_operator), each with
!> its contact problem (fw_contact_step), halved around every change of state.
!>
!> Rigid contact of directions with mass is written in velocities (Moreau 1988): a closed pair
!> has v_n+ >= 0, a stuck one v_t+ = 0, impacts are without restitution. A gap closes at the step
!> that finds it closed. Massless directions have no velocity of their own; their pairs are
!> closed and stuck in positions, at the middles of the steps. So are elastic pairs.
!>
!> A step at the end of which a pair has another state (stick, slip, open, or slip turned round)
!> is halved, down to `n_levels` times: in between, steps are second order; the error of a change
!> is that of the smallest step, which is made of the order (1/steps_per_period)**2.
!>
!> Limits: slip in a direction that turns (two tangential directions) is first order, by the
!> backward difference of its path; high modes are not damped by the scheme, so that light contact
!> nodes may chatter; impacts on contact with mass are plastic by assumption.
module fw_time_stepper
   use fw_interrupt, only: must_end
   use fw_kinds, only: wp, pi
   use fw_contact_step, only: contact_problem, new_contact_problem
   use fw_error, only: error_type
   use fw_period_record, only: new_period_record, period_record
   use fw_periodic_state, only: period_map
   use fw_step_operator, only: new_step_operator, step_operator
   use fw_time_structure, only: time_structure
   implicit none (type, external)
   private

   public :: time_stepper, new_time_stepper

   !> Halvings that are worth their factors, whatever the number of steps.
   integer, parameter :: most_levels = 12

   !> One period of a structure with contact as a map of its state, by implicit steps.
   type, extends(period_map) :: time_stepper
      type(time_structure) :: structure
      !> [rad/time] of the load.
      real(wp) :: omega = 0.0_wp
      !> What a function of a user said that had no force where it had to have one; blank: none.
      character(400) :: complaint = ''
      !> Steps of every size: full ones, halves, quarters, .. (0:n_levels).
      type(step_operator), allocatable :: step(:)
      !> Halvings of a step at most.
      integer :: n_levels = 0
      type(contact_problem) :: contact
      !> Observed quantities (n_observed, n_dof).
      real(wp), allocatable :: observe(:, :)
      type(period_record) :: record
      !> Displacement and velocity (n_dof); corrected positions of the rows that are written in
      !> positions (n_rows).
      real(wp), allocatable :: displacement(:), velocity(:), memory(:)
      ! Workspace: increment and parts (n_dof); displacement, velocity, increment of rows (n_rows).
      real(wp), allocatable :: increment(:), load(:), part(:), mean(:)
      real(wp), allocatable :: row_position(:), row_velocity(:), row_increment(:), last_force(:)
      !> Gaps at the start of a step, their mean over both ends and at its end, and how fast they
      !> open there (n_pairs, 4) [length], [length/time]; the middle of the step [time].
      real(wp), allocatable :: gap(:, :)
      real(wp) :: middle = 0.0_wp
      !> Forces (n_rows) and states (n_pairs, -1: none yet) of the last step that was taken.
      integer, allocatable :: last_state(:)
   contains
      procedure :: integrate
      procedure :: pack_state
   end type time_stepper

   interface
      !> One step of the present state with the step of a level: fw_time_step.
      module subroutine try_step(self, level, instant, accepted)
         class(time_stepper), intent(inout) :: self
         integer, intent(in) :: level
         !> Start of the step as a share of the period.
         real(wp), intent(in) :: instant
         !> False: nothing has changed, a shorter step is due.
         logical, intent(out) :: accepted
      end subroutine try_step

      !> Only behind a try_step of the same level.
      module subroutine accept_step(self, level, sample)
         class(time_stepper), intent(inout) :: self
         integer, intent(in) :: level, sample
      end subroutine accept_step
   end interface

contains

   !> Prepare the integration of a structure at omega [rad/time] with uniform steps.
   subroutine new_time_stepper(structure, observe, omega, steps_per_period, self, error)
      type(time_structure), intent(in) :: structure
      !> Observed quantities (n_observed, n_dof).
      real(wp), intent(in) :: observe(:, :)
      real(wp), intent(in) :: omega
      !> At least 4.
      integer, intent(in) :: steps_per_period
      type(time_stepper), intent(out) :: self
      !> status_input where the structure cannot be integrated.
      type(error_type), allocatable, intent(out) :: error
      integer :: level, n

      self%structure = structure
      self%observe = observe
      self%omega = omega
      self%n_levels = 0
      if (structure%n_pairs > 0) then
         ! So many that the smallest step is the square of the full one, as a share of the period.
         self%n_levels = min(most_levels, ceiling(log(real(steps_per_period, wp))/log(2.0_wp)))
      end if
      allocate (self%step(0:self%n_levels))
      do level = 0, self%n_levels
         ! Factors of every level are kept: the same few sizes return in every period.
         call new_step_operator(structure, 2.0_wp*pi/(omega*steps_per_period*2.0_wp**level), &
                                omega, self%step(level), error)
         if (allocated(error)) return
      end do
      self%contact = new_contact_problem(structure)
      self%record = new_period_record(size(observe, 1), structure%n_pairs, steps_per_period)
      n = structure%n_dof
      allocate (self%displacement(n), self%velocity(n), self%increment(n), self%load(n), &
                self%part(n), self%mean(n), source=0.0_wp)
      n = structure%n_rows
      allocate (self%memory(n), self%row_position(n), self%row_velocity(n), &
                self%row_increment(n), self%last_force(n), source=0.0_wp)
      allocate (self%last_state(structure%n_pairs), source=-1)
      allocate (self%gap(structure%n_pairs, 4), source=0.0_wp)
      call set_weights(self)
   end subroutine new_time_stepper

   !> Square roots of energies: stiffness with inertia for positions, mass for velocities, local
   !> stiffness for corrected positions.
   subroutine set_weights(self)
      type(time_stepper), intent(inout) :: self
      integer :: i, n

      associate (s => self%structure)
         n = s%n_dof
         allocate (self%weight(2*n + s%n_rows), source=0.0_wp)
         do i = 1, n
            ! Diagonals alone: units, not norms, are wanted.
            self%weight(i) = sqrt(abs(s%stiffness(i, i)) + self%omega**2*max(s%mass(i, i), 0.0_wp))
            self%weight(n + i) = sqrt(max(s%mass(i, i), 0.0_wp))
         end do
         do i = 1, s%n_rows
            if (s%massless(i) .or. s%compliance(i) > 0.0_wp) then
               self%weight(2*n + i) = 1.0_wp/sqrt(self%step(0)%delassus(i, i))
            end if
         end do
      end associate
   end subroutine set_weights

   !> State vector of a displacement and velocity (n_dof) and of corrected positions (n_rows).
   pure function pack_state(self, displacement, velocity, memory) result(state)
      class(time_stepper), intent(in) :: self
      !> As the balance has them at tau = 0.
      real(wp), intent(in) :: displacement(:), velocity(:), memory(:)
      real(wp), allocatable :: state(:)
      real(wp) :: massive_velocity(self%structure%n_dof)

      ! Massless directions have no velocity; what a series gives them is left out.
      call self%structure%project(velocity, massive_velocity)
      state = [displacement, massive_velocity, memory]
   end function pack_state

   !> One period from a state (2 n_dof + n_rows); the record is that of this period.
   subroutine integrate(self, start, finish, range, done)
      class(time_stepper), intent(inout) :: self
      real(wp), intent(in), contiguous :: start(:)
      real(wp), intent(out), contiguous :: finish(:)
      !> Largest weighted distance from the start: what the change over a period is compared with.
      real(wp), intent(out) :: range
      logical, intent(out) :: done
      integer :: k, n

      n = self%structure%n_dof
      self%displacement = start(:n)
      self%velocity = start(n + 1:2*n)
      self%memory = start(2*n + 1:)
      call self%record%clear()
      range = 0.0_wp
      finish = start
      do k = 1, self%record%n_steps
         done = .not. must_end(self%interrupt)
         if (.not. done) return
         call advance(self, k)
         if (k == self%record%n_steps) call leave_frame(self)
         finish(:n) = self%displacement
         finish(n + 1:2*n) = self%velocity
         finish(2*n + 1:) = self%memory
         range = max(range, norm2(self%weight*(finish - start)))
      end do
      ! False for NaN too.
      done = norm2(finish) <= huge(1.0_wp)
   end subroutine integrate

   !> Corrected positions of rows whose side 2 slides stand in a frame that goes with it, and that
   !> starts anew with each period.
   pure subroutine leave_frame(self)
      type(time_stepper), intent(inout) :: self
      integer :: c, i

      associate (s => self%structure)
         do i = 1, s%n_pairs
            ! Where forces need no anchor there is none to leave it.
            if (s%at_once(i) .or. s%leans(i)) cycle
            do c = 1, 2
               if (s%row(c, i) > 0) self%memory(s%row(c, i)) = self%memory(s%row(c, i)) + &
                  2.0_wp*pi/self%omega*s%speed(i, c)
            end do
         end do
      end associate
   end subroutine leave_frame

   !> One full step, halved where states change. Positions are counted in smallest steps.
   subroutine advance(self, sample)
      class(time_stepper), intent(inout) :: self
      integer, intent(in) :: sample
      integer :: level, position, whole
      real(wp) :: instant
      logical :: accepted

      call self%structure%project(self%displacement, self%part)
      self%record%observed(:, sample) = matmul(self%observe, self%part)
      whole = 2**self%n_levels
      level = 0
      position = 0
      do while (position < whole)
         instant = (real(sample - 1, wp) + real(position, wp)/real(whole, wp))/ &
                   real(self%record%n_steps, wp)
         call try_step(self, level, instant, accepted)
         ! Refused above the last level only: the loop ends.
         if (.not. accepted) then
            level = level + 1
            cycle
         end if
         call accept_step(self, level, sample)
         position = position + 2**(self%n_levels - level)
         ! The coarsest step that starts here: ends stay on the grid of their level.
         do while (level > 0)
            if (modulo(position, 2**(self%n_levels - level + 1)) /= 0) exit
            level = level - 1
         end do
      end do
   end subroutine advance

end module fw_time_stepper
