!> Coulomb friction with a unilateral normal force, its paths followed from event to event
!> (fw_event_contact): the instants only isolate the events, and the forces are exact integrals over
!> the pieces between them. The same laws as fw_friction, and what laws build on that follow some of
!> their pairs in another way.
module fw_friction_events
   use fw_event_contact, only: event_contact_type, new_event_contact
   use fw_force_law, only: force_workspace, law_room, pair_mixed, pair_open, pair_stuck
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: friction_by_events, event_room, follow_events

   type, extends(pair_law) :: friction_by_events
   contains
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: sample
      procedure :: coefficients
      procedure :: fractions
      procedure :: by_constant
   end type friction_by_events

   !> Paths of all pairs: what evaluation leaves for derivative, samples and results.
   type, extends(law_room) :: event_room
      type(event_contact_type) :: paths
   end type event_room

contains

   !> The law of friction whose pairs and prediction are given.
   pure type(friction_by_events) function follow_events(law) result(self)
      class(pair_law), intent(in) :: law

      self%prediction = law%prediction
      self%facts = law%facts
      ! All other facts stay: the same law, evaluated in another way.
      self%facts%follows_events = .true.
      self%facts%locates_events = .true.
      self%n_elements = law%n_elements
      self%n_components = law%n_components
      self%two_directions = law%two_directions
      if (allocated(law%present)) self%present = law%present
      if (allocated(law%mu)) self%mu = law%mu
      if (allocated(law%worn)) self%worn = law%worn
      if (allocated(law%slider)) self%slider = law%slider
      if (allocated(law%share)) self%share = law%share
   end function follow_events

   !> The instants of `fourier` are a grid that isolates events: four for each wave are enough.
   subroutine reserve(self, fourier, work)
      class(friction_by_events), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (event_room :: work%room)
      select type (room => work%room)
      class is (event_room)
         call new_event_contact(self%mu, self%present, self%facts%remembers, fourier, room%paths)
         if (allocated(self%prediction%speed)) then
            allocate (room%paths%carry(self%n_elements, 2), source=0.0_wp)
         end if
      end select
   end subroutine reserve

   !> The same law with its paths followed from event to event: no number of instants decides.
   subroutine evaluate(self, fourier, work)
      class(friction_by_events), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: c

      if (self%n_elements == 0) return
      call self%take_friction(work)
      call self%take_start(work)
      select type (room => work%room)
      class is (event_room)
         if (allocated(self%worn)) call room%paths%take_friction(work%mu)
         if (allocated(self%share) .and. self%facts%remembers) then
            call room%paths%take_shares(self%share)
         end if
         if (allocated(room%paths%carry) .and. work%rate > 0.0_wp) then
            do c = 1, 2
               room%paths%carry(:, c) = self%prediction%stiffness(:, c)* &
                                        self%prediction%speed(:, c)/work%rate
            end do
         end if
         ! Rates leave the mean position open: for pairs that come to rest it goes along.
         if (any(self%prediction%order > 0) .and. fourier%has_constant()) then
            call room%paths%evaluate(fourier, work%prediction, work%offset, work%x_start, &
                                     work%force, work%x, work%mean)
            work%rests = room%paths%rests
            call hold_stuck_means(room%paths, work)
         else
            call room%paths%evaluate(fourier, work%prediction, work%offset, work%x_start, &
                                     work%force, work%x)
         end if
         ! One turn settles and one is recorded, whatever the load: there is nothing to count.
         work%turns = 1
         work%drift = room%paths%drift
         call work%measure_scale()
         call classify_paths(room%paths, work)
         if (work%measures_slip) call room%paths%friction_path(work%slip)
      end select
   end subroutine evaluate

   !> Pairs that never slip at velocity level rest where they start, should the march to their rest
   !> not have ended.
   pure subroutine hold_stuck_means(paths, work)
      type(event_contact_type), intent(in) :: paths
      type(force_workspace), intent(inout) :: work
      integer :: i

      do i = 1, size(work%rests)
         if (work%rests(i) .or. paths%moved(i) .or. .not. paths%closed(i)) cycle
         ! On a side that slides nothing comes to rest.
         if (allocated(paths%carry)) then
            if (any(abs(paths%carry(i, :)) > 0.0_wp)) cycle
         end if
         work%rests(i) = .true.
         ! lambda = y - x: with x where it started, the mean force is that of a spring from there.
         work%force(i, 1:2, 1) = work%force(i, 1:2, 1) + work%mean(i, :) - work%x_start(i, :)
      end do
   end subroutine hold_stuck_means

   !> Of the pressure, only whether it ever vanishes is known.
   pure subroutine classify_paths(paths, work)
      type(event_contact_type), intent(in) :: paths
      type(force_workspace), intent(inout) :: work
      integer :: i

      do i = 1, size(work%state)
         work%pressure(i) = merge(1.0_wp, 0.0_wp, paths%closed(i))
         ! Open and stuck pairs have a derivative of 0 and 1; any other one needs its block.
         work%state(i) = pair_mixed
         if (paths%open(i)) work%state(i) = pair_open
         if (paths%closed(i) .and. .not. paths%moved(i)) work%state(i) = pair_stuck
      end do
   end subroutine classify_paths

   !> Blocks of the pairs that are neither open nor stuck throughout; those of others are not
   !> filled.
   subroutine linearize(self, fourier, work)
      class(friction_by_events), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: nc

      work%linear_state = work%state
      work%linear_rests = work%rests
      if (.not. any(work%state == pair_mixed)) return
      nc = fourier%n_coefficients
      if (.not. allocated(work%jacobian)) allocate (work%jacobian(3*nc, 3*nc, self%n_elements))
      select type (room => work%room)
      class is (event_room)
         if (work%differentiates_slip) then
            call room%paths%linearize(fourier, work%state == pair_mixed, work%x_start, &
                                      work%jacobian, work%slip_derivative)
         else
            call room%paths%linearize(fourier, work%state == pair_mixed, work%x_start, &
                                      work%jacobian)
         end if
      end select
   end subroutine linearize

   !> Forces at the instants, read off the path: for histories alone.
   subroutine sample(self, work)
      class(friction_by_events), intent(in) :: self
      type(force_workspace), intent(inout) :: work

      if (self%n_elements == 0) return
      select type (room => work%room)
      class is (event_room)
         call room%paths%values(work%force_time)
      end select
   end subroutine sample

   !> Of harmonics that the balance may have left out too.
   subroutine coefficients(self, work, computed, fourier, force)
      class(friction_by_events), intent(in) :: self
      type(force_workspace), intent(inout) :: work
      !> Harmonics of the last evaluation, and those that are wanted.
      type(fourier_type), intent(in) :: computed
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: force(:, :, :)

      if (self%n_elements == 0) return
      select type (room => work%room)
      class is (event_room)
         call room%paths%coefficients(fourier, computed%harmonic, force)
      end select
   end subroutine coefficients

   !> The share of a residual traction; all else acts through the inputs.
   pure subroutine by_constant(self, element, name, fourier, work, force, is_known)
      class(friction_by_events), intent(in) :: self
      integer, intent(in) :: element
      character(*), intent(in) :: name
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :)
      logical, intent(out) :: is_known

      is_known = .false.
      force = 0.0_wp
      if (.not. self%facts%remembers) return
      select type (room => work%room)
      class is (event_room)
         call self%by_share(element, name, fourier, room%paths%reach(element), force, is_known)
      end select
   end subroutine by_constant

   !> Shares of stick, slip and open (3, n_pairs), by durations.
   pure subroutine fractions(self, work, share)
      class(friction_by_events), intent(in) :: self
      type(force_workspace), intent(in) :: work
      real(wp), intent(out) :: share(:, :)

      share = 0.0_wp
      if (self%n_elements == 0) return
      select type (room => work%room)
      class is (event_room)
         call room%paths%fractions(share)
      end select
   end subroutine fractions

end module fw_friction_events
