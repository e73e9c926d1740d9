!> One number of a response, Q, and its first and second derivatives along any two directions, from
!> the complex amplitudes U_n of an observed quantity and theirs:
!>
!>   first harmonic  Q = |U_1|,      Q_a  = Re(conj(U_1) U_1a)/Q,
!>                                   Q_ab = Re(conj(U_1a) U_1b + conj(U_1) U_1ab)/Q - Q_a Q_b/Q
!>   largest         Q = s u(tau),   Q_a  = s u_a,   Q_ab = s (u_ab - u_a' u_b'/u''),
!>
!> u = Re sum U_n exp(i n tau), ' by tau, at the peak tau, which moves with the directions.
module fw_response_quantity
   use fw_kinds, only: wp
   use fw_recovery, only: peak_angles
   implicit none (type, external)
   private

   public :: response_quantity, of_first_harmonic, of_largest

   integer, parameter :: of_first_harmonic = 1, of_largest = 2

   type :: response_quantity
      integer :: kind = of_first_harmonic
      !> Harmonics of the amplitudes (n_retained), and where the first stands.
      integer, allocatable :: harmonic(:)
      integer :: first = 1
      real(wp) :: value = 0.0_wp
      !> Two peaks are alike: derivatives are those of one of them.
      logical :: is_tied = .false.
      complex(wp), allocatable, private :: u(:)
      !> At the peak: its angle, the sign of u, u''.
      real(wp), private :: angle = 0.0_wp, side = 1.0_wp, bend = -1.0_wp
   contains
      procedure :: take
      procedure :: slope
      procedure :: second
   end type response_quantity

contains

   !> Take the amplitudes of a response (n_retained).
   pure subroutine take(self, kind, harmonic, u)
      class(response_quantity), intent(inout) :: self
      integer, intent(in) :: kind, harmonic(:)
      complex(wp), intent(in) :: u(:)
      real(wp), allocatable :: coefficients(:)
      real(wp) :: angle(2), side(2)
      integer :: h, n_peaks

      self%kind = kind
      self%harmonic = harmonic
      self%first = findloc(harmonic, 1, dim=1)
      self%u = u
      self%is_tied = .false.
      if (kind == of_first_harmonic) then
         self%value = abs(u(self%first))
         return
      end if
      allocate (coefficients(2*maxval(harmonic) + 1), source=0.0_wp)
      do h = 1, size(harmonic)
         if (harmonic(h) == 0) then
            coefficients(1) = real(u(h), wp)
         else
            coefficients(2*harmonic(h)) = real(u(h), wp)
            coefficients(2*harmonic(h) + 1) = -aimag(u(h))
         end if
      end do
      call peak_angles(coefficients, self%value, n_peaks, angle, side)
      ! The half-wave symmetry of odd harmonics makes peaks alike without being a tie.
      self%is_tied = n_peaks > 1 .and. any(harmonic == 0)
      self%angle = angle(1)
      self%side = side(1)
      self%bend = at_peak(self, u, 2)
   end subroutine take

   !> Derivative of order n by tau of Re sum U_n exp(i n tau), at the peak.
   pure real(wp) function at_peak(self, u, order) result(value)
      class(response_quantity), intent(in) :: self
      complex(wp), intent(in) :: u(:)
      integer, intent(in) :: order
      complex(wp) :: factor
      integer :: h

      value = 0.0_wp
      do h = 1, size(u)
         factor = cmplx(0.0_wp, self%harmonic(h), wp)**order
         if (order == 0) factor = (1.0_wp, 0.0_wp)
         value = value + real(factor*u(h)*exp(cmplx(0.0_wp, self%harmonic(h)*self%angle, wp)), wp)
      end do
   end function at_peak

   !> Q_a from U_a.
   pure real(wp) function slope(self, u_a)
      class(response_quantity), intent(in) :: self
      complex(wp), intent(in) :: u_a(:)

      if (self%kind == of_first_harmonic) then
         slope = 0.0_wp
         if (self%value > 0.0_wp) then
            slope = real(conjg(self%u(self%first))*u_a(self%first), wp)/self%value
         end if
      else
         slope = self%side*at_peak(self, u_a, 0)
      end if
   end function slope

   !> Q_ab from U_a, U_b and U_ab.
   pure real(wp) function second(self, u_a, u_b, u_ab)
      class(response_quantity), intent(in) :: self
      complex(wp), intent(in) :: u_a(:), u_b(:), u_ab(:)

      second = self%slope(u_ab)
      if (self%kind == of_first_harmonic) then
         if (.not. self%value > 0.0_wp) return
         associate (h => self%first)
            second = second + (real(conjg(u_a(h))*u_b(h), wp) - &
                               self%slope(u_a)*self%slope(u_b))/self%value
         end associate
      else if (abs(self%bend) > 0.0_wp) then
         second = second - self%side*at_peak(self, u_a, 1)*at_peak(self, u_b, 1)/self%bend
      end if
   end function second

end module fw_response_quantity
