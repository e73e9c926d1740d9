!> The step of fw_time_stepper: contact problem, changes of state, update and record.
submodule(fw_time_stepper) fw_time_step
   use fw_contact_step, only: state_open, state_slip, state_stick
   use fw_lapack, only: dgemv
   implicit none (type, external)

contains

   !> Solve a step from the present state without taking it. It is refused, unless it is the
   !> smallest, where a pair changes its state or its contact problem is not solved.
   module subroutine try_step(self, level, instant, accepted)
      class(time_stepper), intent(inout) :: self
      integer, intent(in) :: level
      real(wp), intent(in) :: instant
      logical, intent(out) :: accepted
      logical :: done

      ! What has ended the run is not integrated any further.
      accepted = .true.
      if (self%complaint /= '') return
      associate (s => self%structure, step => self%step(level))
         ! The load of the whole step acts in its middle, where the contact problem is written.
         call mean_load(self, instant, step%duration, self%load)
         call step%free_increment(s, self%displacement, self%velocity, self%load, self%increment)
         call take_rows(s, self%displacement, self%row_position)
         call take_rows(s, self%velocity, self%row_velocity)
         call take_rows(s, self%increment, self%row_increment)
         call move_obstacles(self, instant, step%duration)
         call set_references(self, step%h)
         self%contact%omega = self%omega
         self%contact%tau = 2.0_wp*pi*instant + 0.5_wp*self%omega*step%duration
         ! As a guess, and so that a refused step leaves no trace.
         self%contact%force = self%last_force
         call self%contact%solve(s, step%delassus, done)
         call step%add_forces(s, self%contact%force, self%increment)
         call take_rows(s, self%increment, self%row_increment)
      end associate
      accepted = .true.
      ! A number above 0 ends the run; one below 0 does where steps can be no smaller.
      if (self%contact%refusals%status /= 0) then
         accepted = self%contact%refusals%status > 0 .or. level == self%n_levels
         if (accepted) self%complaint = self%contact%refusals%complaint
         return
      end if
      ! The smallest step is taken as it is; what was not solved is counted.
      if (level < self%n_levels) accepted = done .and. .not. any_change(self)
      if (accepted .and. .not. done) self%record%n_failed = self%record%n_failed + 1
   end subroutine try_step

   !> Mean of the loads at both ends of a step, to which the prewarped step belongs.
   pure subroutine mean_load(self, instant, duration, load)
      class(time_stepper), intent(in) :: self
      real(wp), intent(in) :: instant, duration
      !> Force on the dofs (n_dof).
      real(wp), intent(out) :: load(:)
      real(wp) :: middle, share
      integer :: n, w

      ! The mean of both ends of a wave is its middle times this.
      share = cos(0.5_wp*self%omega*duration)
      middle = 2.0_wp*pi*instant + 0.5_wp*self%omega*duration
      load = self%structure%load(:, 1) + share*cos(middle)*self%structure%load(:, 2) + &
             share*sin(middle)*self%structure%load(:, 3)
      do w = 1, self%structure%waves%n_waves()
         n = self%structure%waves%harmonic(w)
         share = cos(0.5_wp*n*self%omega*duration)*self%structure%waves%factor(w, n, n*self%omega)
         load = load + share*cos(n*middle)*self%structure%load(:, 2*w + 2) + &
                share*sin(n*middle)*self%structure%load(:, 2*w + 3)
      end do
   end subroutine mean_load

   !> Gaps at both ends of a step, and the time of its middle.
   pure subroutine move_obstacles(self, instant, duration)
      class(time_stepper), intent(inout) :: self
      real(wp), intent(in) :: instant, duration
      real(wp) :: tau(2)
      integer :: i

      self%middle = 2.0_wp*pi/self%omega*instant + 0.5_wp*duration
      self%gap(:, :3) = spread(self%structure%gap, 2, 3)
      if (.not. allocated(self%structure%motion)) return
      tau = 2.0_wp*pi*instant + [0.0_wp, self%omega*duration]
      associate (motion => self%structure%motion)
         do i = 1, self%structure%n_pairs
            self%gap(i, 1) = self%gap(i, 1) + motion%at_angle(i, tau(1))
            self%gap(i, 3) = self%gap(i, 3) + motion%at_angle(i, tau(2))
            self%gap(i, 2) = 0.5_wp*(self%gap(i, 1) + self%gap(i, 3))
            self%gap(i, 4) = self%omega*motion%slope_at(i, tau(2))
         end do
      end associate
      ! Pairs that act at once take it with their depth.
      self%contact%moved = self%gap(:, 2) - self%structure%gap
   end subroutine move_obstacles

   !> B x of a vector of dofs.
   subroutine take_rows(structure, vector, rows)
      type(time_structure), intent(in) :: structure
      !> Of the dofs (n_dof), and of the rows (n_rows).
      real(wp), intent(in) :: vector(:)
      real(wp), intent(out) :: rows(:)

      if (structure%n_rows == 0) return
      call dgemv('T', structure%n_dof, structure%n_rows, 1.0_wp, structure%rows, &
                 structure%n_dof, vector, 1, 0.0_wp, rows, 1)
   end subroutine take_rows

   !> Measure the rows from where pairs stay closed and stuck: v+ = 0 means d = h v/4 ...
   !> in positions, the gap closes or the corrected position is kept.
   subroutine set_references(self, h)
      class(time_stepper), intent(inout) :: self
      real(wp), intent(in) :: h
      integer :: i, c, r

      associate (s => self%structure, free => self%contact%free)
         do i = 1, s%n_pairs
            ! Contact in positions finds out by itself whether it is closed.
            self%contact%closed(i) = .true.
            do c = 1, 3
               r = s%row(c, i)
               if (r == 0) cycle
               if (s%at_once(i)) then
                  free(r) = self%row_increment(r) + self%row_position(r)
                  self%contact%start(r) = self%row_position(r)
                  ! Massless directions go from value to value, the others from end to end.
                  self%contact%speed(r) = merge(1.0_wp, 2.0_wp, s%massless(r))/h
               else if (.not. in_positions(s, r)) then
                  ! v+ = 4 d/h - v: v+ = 0 at d = h v/4, and as much as side 2 moves at d as much
                  ! further.
                  free(r) = self%row_increment(r) - 0.25_wp*h*(self%row_velocity(r) + &
                                                               speed_of(self, i, c))
                  if (c == 3) self%contact%closed(i) = self%row_position(r) + &
                                                       self%gap(i, 1) <= 0.0_wp
               else if (c == 3) then
                  ! Half-way position with its gap: zero where it just closes.
                  free(r) = self%row_increment(r) + (self%row_position(r) + self%gap(i, 2))
               else
                  ! Half-way position from where it sticks, in the frame of side 2.
                  free(r) = self%row_increment(r) + (self%row_position(r) - self%memory(r)) - &
                            s%speed(i, c)*self%middle
               end if
            end do
         end do
         do r = s%n_rows - s%n_springs - s%n_element_rows + 1, s%n_rows
            free(r) = self%row_increment(r) + self%row_position(r)
            self%contact%start(r) = self%row_position(r)
            self%contact%speed(r) = merge(1.0_wp, 2.0_wp, s%massless(r))/h
         end do
      end associate
   end subroutine set_references

   !> How fast side 2 of a pair moves away at the end of the step.
   pure real(wp) function speed_of(self, pair, component) result(speed)
      class(time_stepper), intent(in) :: self
      integer, intent(in) :: pair, component

      if (component == 3) then
         speed = -self%gap(pair, 4)
      else
         speed = self%structure%speed(pair, component)
      end if
   end function speed_of

   !> Whether the contact of a row is written in positions: massless or elastic.
   elemental logical function in_positions(structure, row)
      type(time_structure), intent(in) :: structure
      integer, intent(in) :: row

      in_positions = structure%massless(row) .or. structure%compliance(row) > 0.0_wp
   end function in_positions

   !> Whether a pair ends the step in another state than it started, or crosses its gap.
   pure logical function any_change(self)
      class(time_stepper), intent(in) :: self
      integer :: i, c, r
      real(wp) :: turn

      any_change = .false.
      associate (s => self%structure)
         do i = 1, s%n_pairs
            ! Unknown (-1) before the first step.
            if (self%contact%state(i) /= self%last_state(i) .and. self%last_state(i) >= 0) then
               any_change = .true.
            else if (self%contact%state(i) == state_slip .and. .not. s%at_once(i)) then
               turn = 0.0_wp
               do c = 1, 2
                  r = s%row(c, i)
                  if (r > 0) turn = turn + self%contact%force(r)*self%last_force(r)
               end do
               ! Slip that turns by more than a right angle has stopped in between.
               any_change = turn < 0.0_wp
            else if (.not. self%contact%closed(i)) then
               r = s%row(3, i)
               ! Twice the increment is the whole step: the gap would be closed at its end.
               any_change = self%row_position(r) + 2.0_wp*self%row_increment(r) + &
                            self%gap(i, 3) < 0.0_wp
            end if
            if (any_change) return
         end do
      end associate
   end function any_change

   !> Take the step that was tried last, and record it in a sample of the period.
   module subroutine accept_step(self, level, sample)
      class(time_stepper), intent(inout) :: self
      integer, intent(in) :: level, sample
      real(wp) :: share

      share = self%step(level)%duration/self%step(0)%duration
      associate (s => self%structure)
         ! Displacements in the middle of the step, which massless directions alone have.
         self%mean = self%displacement + self%increment
         if (s%n_pairs > 0) call record_contact(self, share, self%step(level)%duration, sample)
         call s%project(self%increment, self%part)
         if (allocated(s%massive)) then
            ! What the projection leaves of the mean is the massless part; the load of the step is
            ! spent and its array serves.
            call s%project(self%mean, self%load)
            self%record%observed_mean(:, sample) = self%record%observed_mean(:, sample) + &
               share*matmul(self%observe, self%mean - self%load)
         end if
         ! With d the half of the displacement over the step: v+ = 4 d/h - v.
         self%velocity = 4.0_wp/self%step(level)%h*self%part - self%velocity
         ! u+ = u + 2 d with mass, u + d without.
         self%displacement = self%displacement + self%increment + self%part
      end associate
      self%last_force = self%contact%force
      self%last_state = self%contact%state
      self%record%n_taken = self%record%n_taken + 1
   end subroutine accept_step

   !> Means of forces and displacements, shares of the states, work; corrected positions move.
   subroutine record_contact(self, share, duration, sample)
      class(time_stepper), intent(inout) :: self
      real(wp), intent(in) :: share, duration
      integer, intent(in) :: sample
      real(wp) :: period_share, step_length, force, carried
      integer :: i, c, r, place

      period_share = share/real(self%record%n_steps, wp)
      associate (s => self%structure, record => self%record, contact => self%contact)
         do i = 1, s%n_pairs
            do c = 1, 3
               r = s%row(c, i)
               if (r == 0) cycle
               record%force(c, i, sample) = record%force(c, i, sample) + share*contact%force(r)
               record%slip(c, i, sample) = record%slip(c, i, sample) + &
                                           share*(self%row_position(r) + self%row_increment(r))
               ! Of a row with mass: its whole motion works against the mean force.
               step_length = 2.0_wp*self%row_increment(r)
               force = contact%force(r)
               ! What side 2 adds to the relative motion.
               carried = self%gap(i, 3) - self%gap(i, 1)
               if (c < 3) carried = -s%speed(i, c)*duration
               record%obstacle_work(i) = record%obstacle_work(i) + force*carried
               if (s%at_once(i) .or. (c < 3 .and. s%leans(i))) then
                  if (s%massless(r)) step_length = self%row_increment(r)
                  step_length = step_length + carried
               else if (in_positions(s, r)) then
                  step_length = 0.0_wp
                  if (c < 3 .and. contact%state(i) /= state_stick) then
                     ! A row in positions works by the move of its corrected position alone; elastic
                     ! energy returns.
                     step_length = contact%relative(r)
                     self%memory(r) = self%memory(r) + step_length
                     ! From the middle of the last step to that of this one.
                     force = 0.5_wp*(force + self%last_force(r))
                  end if
               else
                  step_length = step_length + carried
               end if
               record%work(i) = record%work(i) + force*step_length
            end do
            if (s%row(3, i) == 0) record%force(3, i, sample) = -s%normal_load(i)
            ! Shares are in the order stick (1), slip (2), open, which is state 0.
            place = merge(3, contact%state(i), contact%state(i) == state_open)
            record%share(place, i) = record%share(place, i) + period_share
         end do
      end associate
   end subroutine record_contact

end submodule fw_time_step
