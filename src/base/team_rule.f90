!> Whether the threads of a run serve it, or wait for processors that other programs have: a region
!> ends when its last thread does, so a thread that stands in a queue holds up all others, which
!> spin meanwhile. Decided by time in the queue only, which is next to nothing on a quiet machine.
!> Results do not depend on the number of threads.
module fw_team_rule
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: team_rule

   !> Time between two looks [s]: short beside what a run of lost regions costs, long beside a look.
   real(wp), parameter, public :: span = 0.01_wp
   !> Time in the queue over time of the clock: of all threads, above which they are no gain (two
   !> threads of two processors that they share with one other program stand there for a third),
   !> and of a single one, below which others may find a processor.
   real(wp), parameter :: most_of_team = 0.25_wp, most_of_one = 0.05_wp
   !> Time in one thread before the next try [s], doubled from try to try.
   real(wp), parameter :: first_pause = 0.1_wp, longest_pause = 4.0_wp
   !> Time without a loss after which the next one is a first one again [s].
   real(wp), parameter :: calm = 1.0_wp

   type :: team_rule
      !> Whether one thread does the work of all.
      logical :: alone = .false.
      !> How often that began.
      integer :: n_retreats = 0
      real(wp), private :: pause = first_pause, since = 0.0_wp
   contains
      procedure :: look
   end type team_rule

contains

   !> Look at the time since the last look.
   pure subroutine look(self, passed, queued)
      class(team_rule), intent(inout) :: self
      !> Time of the clock, and that in the queue, of all threads that were at work together [s].
      real(wp), intent(in) :: passed, queued

      self%since = self%since + passed
      if (self%alone) then
         if (queued > most_of_one*passed) self%since = 0.0_wp
         if (self%since < self%pause) return
         self%alone = .false.
         self%since = 0.0_wp
         self%pause = min(2.0_wp*self%pause, longest_pause)
      else if (queued > most_of_team*passed) then
         self%alone = .true.
         self%n_retreats = self%n_retreats + 1
         self%since = 0.0_wp
      else if (self%since > calm) then
         self%pause = first_pause
      end if
   end subroutine look

end module fw_team_rule
