!> A mass on a spring and a dashpot, in closed form:
!>
!>   m x'' + c x' + k x = 0,   X = (x, x'),   X(t) = Phi(t) X(0),
!>   E_n = k - n**2 m + i n c,   x_n = y_n/E_n under y_n e^(i n t).
!>
!> m and k are above zero, c is not below it: the energy m x'**2 + k x**2 never grows, and since
!> every derivative of x obeys the same equation, it bounds all of them.
module fw_oscillator
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: oscillator_type, new_oscillator

   type :: oscillator_type
      !> In the angle tau = omega t: m = omega**2 mass, c = omega damping [force/length], k
      !> [force/length].
      real(wp) :: m = 1.0_wp, c = 0.0_wp, k = 1.0_wp
      !> Decay c/(2m), k/m, and the root of their difference in absolute value.
      real(wp), private :: decay = 0.0_wp, square = 1.0_wp, root = 1.0_wp
      logical, private :: overdamped = .false.
   contains
      procedure :: propagate
      procedure :: impedance
      procedure :: bound
      procedure :: energy_norm
   end type oscillator_type

   !> Products of root and time below which the two exponentials are not told apart.
   real(wp), parameter :: close_roots = 1.0_wp

contains

   pure type(oscillator_type) function new_oscillator(m, c, k) result(self)
      real(wp), intent(in) :: m, c, k
      real(wp) :: difference

      self%m = m
      self%c = c
      self%k = k
      self%decay = 0.5_wp*c/m
      self%square = k/m
      difference = self%decay**2 - self%square
      ! At the difference 0 the other branch is exact: sin(0)/0 is taken as its limit.
      self%overdamped = difference > 0.0_wp
      self%root = sqrt(abs(difference))
   end function new_oscillator

   !> Phi(t), t >= 0. Both columns of an overdamped oscillator are made from its two exponentials,
   !> the slow one being -(k/m)/(decay + root): no digits are lost, nothing overflows.
   pure subroutine propagate(self, t, phi)
      class(oscillator_type), intent(in) :: self
      real(wp), intent(in) :: t
      real(wp), intent(out) :: phi(2, 2)
      real(wp) :: even, odd, angle, slow, fast, sum_of_roots

      angle = self%root*t
      ! Both exponentials by themselves: cosh and sinh would cancel, or overflow for long times.
      if (self%overdamped .and. angle > close_roots) then
         sum_of_roots = self%decay + self%root
         slow = exp(-self%square/sum_of_roots*t)/(2.0_wp*self%root)
         fast = exp(-sum_of_roots*t)/(2.0_wp*self%root)
         odd = slow - fast
         phi(1, 1) = sum_of_roots*slow - self%square/sum_of_roots*fast
         phi(2, 2) = sum_of_roots*fast - self%square/sum_of_roots*slow
      else
         ! Here cosh and sinh are of the order of one, and their difference keeps its digits.
         even = exp(-self%decay*t)
         odd = even*t
         if (self%overdamped) then
            if (angle > tiny(1.0_wp)) odd = even*sinh(angle)/self%root
            even = even*cosh(angle)
         else
            if (angle > tiny(1.0_wp)) odd = even*sin(angle)/self%root
            even = even*cos(angle)
         end if
         phi(1, 1) = even + self%decay*odd
         phi(2, 2) = even - self%decay*odd
      end if
      ! Phi = even 1 + odd (A + decay 1), A the matrix of the first-order system.
      phi(1, 2) = odd
      phi(2, 1) = -self%square*odd
   end subroutine propagate

   !> E_n.
   elemental complex(wp) function impedance(self, n)
      class(oscillator_type), intent(in) :: self
      integer, intent(in) :: n

      impedance = cmplx(self%k - real(n, wp)**2*self%m, real(n, wp)*self%c, wp)
   end function impedance

   !> Bounds of the third and the fourth derivative of x' of a free motion from X on.
   pure subroutine bound(self, x, third, fourth)
      class(oscillator_type), intent(in) :: self
      real(wp), intent(in) :: x(2)
      real(wp), intent(out) :: third, fourth
      real(wp) :: a, b, next
      integer :: i

      a = x(1)
      b = x(2)
      ! At last a = x'''' and b its rate: their energy bounds the third derivative of x' from here
      ! on.
      do i = 1, 4
         next = -(self%k*a + self%c*b)/self%m
         a = b
         b = next
      end do
      third = sqrt(a**2 + b**2/self%square)
      next = -(self%k*a + self%c*b)/self%m
      fourth = sqrt(b**2 + next**2/self%square)
   end subroutine bound

   !> Root of m x'**2 + k x**2: a motion under friction never moves away from another in it.
   pure real(wp) function energy_norm(self, x)
      class(oscillator_type), intent(in) :: self
      real(wp), intent(in) :: x(2)

      energy_norm = sqrt(self%m*x(2)**2 + self%k*x(1)**2)
   end function energy_norm

end module fw_oscillator
