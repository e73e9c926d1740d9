!> Two amplitudes between which pairs begin to depart from the state that they have at rest, and
!> where to look next.
!>
!> Below the onset nothing departs; above it the share of the period that does grows like the root
!> of the excess: slip (or separation) lasts from where the motion passes its limit to where it
!> turns. The square of the share is a straight line there, whose zero is the onset; both ends close
!> in on it as fast as that line settles. Where it does not, the bracket is halved.
module fw_onset_bracket
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: onset_bracket

   type :: onset_bracket
      real(wp) :: low = 0.0_wp, high = huge(1.0_wp)
      !> Amplitudes above the onset, the lowest first, with the squares of what departs there, and
      !> how many are known.
      real(wp), private :: above(2) = 0.0_wp, square(2) = 0.0_wp
      integer, private :: n_above = 0
      !> The last zero of the line, and the width of the bracket before the last two looks.
      real(wp), private :: zero = -1.0_wp, width(2) = huge(1.0_wp)
   contains
      procedure :: next
      procedure :: narrow
      procedure :: take_above
      procedure :: forget_zero
   end type onset_bracket

   !> Parts of the zero of a line below which another one is the same.
   real(wp), parameter :: least_margin = 2.0e-14_wp

contains

   !> The next amplitude to look at, within the bracket.
   real(wp) function next(self) result(amplitude)
      class(onset_bracket), intent(inout) :: self
      real(wp) :: margin, zero

      amplitude = sqrt(self%low*self%high)
      if (self%n_above < 2) return
      if (.not. self%square(2) > self%square(1)) return
      zero = self%above(1) - self%square(1)*(self%above(2) - self%above(1))/ &
             (self%square(2) - self%square(1))
      ! What the line has moved by since it was drawn last says how far it may be off.
      margin = abs(zero - self%zero)
      if (self%zero < 0.0_wp) margin = 0.1_wp*(self%high - self%low)
      margin = max(margin, least_margin*zero)
      self%zero = zero
      ! Two looks have not even halved the bracket.
      if (self%high - self%low > 0.5_wp*self%width(2)) return
      if (self%high - zero > zero - self%low) then
         zero = zero + margin
      else
         zero = zero - margin
      end if
      if (zero > self%low .and. zero < self%high) amplitude = zero
   end function next

   !> What departs at an amplitude between the two; 0 where all is as at rest.
   subroutine narrow(self, amplitude, departure)
      class(onset_bracket), intent(inout) :: self
      real(wp), intent(in) :: amplitude, departure

      self%width = [self%high - self%low, self%width(1)]
      if (departure <= 0.0_wp) then
         self%low = amplitude
         return
      end if
      self%high = amplitude
      call self%take_above(amplitude, departure)
   end subroutine narrow

   !> What departs at an amplitude above the onset; the two lowest amplitudes are kept.
   subroutine take_above(self, amplitude, departure)
      class(onset_bracket), intent(inout) :: self
      real(wp), intent(in) :: amplitude, departure

      if (self%n_above == 0 .or. amplitude < self%above(1)) then
         self%above = [amplitude, self%above(1)]
         self%square = [departure**2, self%square(1)]
      else
         self%above(2) = amplitude
         self%square(2) = departure**2
      end if
      self%n_above = self%n_above + 1
   end subroutine take_above

   !> Other ends: the line is drawn anew.
   subroutine forget_zero(self)
      class(onset_bracket), intent(inout) :: self

      self%zero = -1.0_wp
      self%width = huge(1.0_wp)
   end subroutine forget_zero

end module fw_onset_bracket
