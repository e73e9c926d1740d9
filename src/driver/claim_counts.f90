!> What became of the points of a run that asks for an accuracy: claims, estimates that miss it, and
!> points whose finer balances were given up; in words.
module fw_claim_counts
   use fw_kinds, only: wp
   use fw_known_tail, only: unknown
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: claim_counts

   type :: claim_counts
      !> Points with a claim, and the largest estimate of these.
      integer :: n_claimed = 0
      real(wp) :: worst_claimed = 0.0_wp
      !> Points that miss the accuracy, the largest estimate, and where it is [rad/s].
      integer :: n_short = 0
      real(wp), private :: worst = 0.0_wp, worst_omega = 0.0_wp
      !> Points that were given up, and of the first one: where, iterations, harmonics.
      integer, private :: n_left = 0, left_after = 0, left_at = 0
      real(wp), private :: left_omega = 0.0_wp
   contains
      procedure :: note
      procedure :: note_left
      procedure :: tell
   end type claim_counts

contains

   !> Count a converged point.
   pure subroutine note(self, estimate, accuracy, omega)
      class(claim_counts), intent(inout) :: self
      real(wp), intent(in) :: estimate, accuracy
      !> [rad/s]
      real(wp), intent(in) :: omega

      if (estimate <= accuracy) then
         self%n_claimed = self%n_claimed + 1
         self%worst_claimed = max(self%worst_claimed, estimate)
         return
      end if
      self%n_short = self%n_short + 1
      if (estimate > self%worst .and. estimate < unknown) then
         self%worst = estimate
         self%worst_omega = omega
      end if
   end subroutine note

   !> Count a point whose finer balances are given up.
   pure subroutine note_left(self, omega, iterations, n_harmonics)
      class(claim_counts), intent(inout) :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      !> Spent on it, and the most harmonics that were tried.
      integer, intent(in) :: iterations, n_harmonics

      self%n_left = self%n_left + 1
      if (self%n_left > 1) return
      self%left_omega = omega
      self%left_after = iterations
      self%left_at = n_harmonics
   end subroutine note_left

   !> Where the accuracy is missed, and what to do; empty where it is kept.
   subroutine tell(self, accuracy, message)
      class(claim_counts), intent(in) :: self
      real(wp), intent(in) :: accuracy
      character(:), allocatable, intent(out) :: message

      message = ''
      if (self%n_short == 0) return
      message = 'accuracy'//number(accuracy)//' is missed at '//to_text(self%n_short)// &
                trim(merge(' point ', ' points', self%n_short == 1))
      if (self%worst > accuracy) message = message//', by estimates up to'//number(self%worst)// &
                                           ' (at'//number(self%worst_omega)//' rad/s)'
      if (self%n_left < self%n_short) then
         message = message//': raise harmonics%n_harmonics, or ask for less'
      end if
      if (self%n_left == 0) return
      message = message//'; finer balances were given up at '//to_text(self%n_left)// &
                ' of them (first at'//number(self%left_omega)//' rad/s, after '// &
                to_text(self%left_after)//' iterations with up to '//to_text(self%left_at)// &
                ' harmonics): ask for less there, or give n_harmonics'
   end subroutine tell

   !> With a blank before it.
   pure function number(value) result(text)
      real(wp), intent(in) :: value
      character(9) :: text

      write (text, '(es9.2)') value
   end function number

end module fw_claim_counts
