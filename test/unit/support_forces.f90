!> Friction of pairs without a structure: a law and its workspace in one, for tests of the forces.
module support_forces
   use fw_force_law, only: force_workspace
   use fw_fourier, only: fourier_type
   use fw_friction, only: friction_room, rigid_friction, rigid_friction_of_rates
   use fw_kinds, only: wp
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: forces_type, new_forces

   type, extends(force_workspace) :: forces_type
      class(pair_law), allocatable :: law
   contains
      procedure :: evaluate
      procedure :: linearize
      procedure :: sample
      procedure :: fractions
      procedure :: settled
   end type forces_type

contains

   !> Pairs that remember their position, or not (velocity level), decided at instants or by events.
   !> With speeds of side 2 [force] an angle of 1 is a unit of time.
   subroutine new_forces(mu, present, remembers, events, fourier, self, speed)
      real(wp), intent(in) :: mu(:)
      !> Which components exist (3, n_pairs).
      logical, intent(in) :: present(:, :)
      logical, intent(in) :: remembers, events
      type(fourier_type), intent(in) :: fourier
      type(forces_type), intent(out) :: self
      !> (n_pairs, 2).
      real(wp), intent(in), optional :: speed(:, :)
      class(pair_law), allocatable :: law

      if (remembers) then
         allocate (law, source=rigid_friction())
      else
         allocate (law, source=rigid_friction_of_rates())
      end if
      call law%take_pairs(mu, present)
      if (has_speed(speed)) then
         law%prediction%speed = speed
         law%prediction%stiffness = 1.0_wp
      end if
      if (events) then
         call law%located(self%law)
      else
         call move_alloc(law, self%law)
      end if
      call self%law%reserve(fourier, self%force_workspace)
      self%rate = 1.0_wp
      call self%measure_slip()
   end subroutine new_forces

   !> A dummy of its own: `present` names components above.
   pure logical function has_speed(speed)
      real(wp), intent(in), optional :: speed(:, :)

      has_speed = present(speed)
   end function has_speed

   subroutine evaluate(self, fourier)
      class(forces_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier

      call self%law%evaluate(fourier, self%force_workspace)
   end subroutine evaluate

   subroutine linearize(self, fourier)
      class(forces_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier

      call self%law%linearize(fourier, self%force_workspace)
   end subroutine linearize

   subroutine sample(self)
      class(forces_type), intent(inout) :: self

      call self%law%sample(self%force_workspace)
   end subroutine sample

   subroutine fractions(self, share)
      class(forces_type), intent(in) :: self
      real(wp), intent(out) :: share(:, :)

      call self%law%fractions(self%force_workspace, share)
   end subroutine fractions

   !> Whether the march of a pair was brought to its limit.
   logical function settled(self, pair)
      class(forces_type), intent(in) :: self
      integer, intent(in) :: pair

      settled = .false.
      select type (room => self%room)
      type is (friction_room)
         settled = room%settled(pair)
      end select
   end function settled

end module support_forces
