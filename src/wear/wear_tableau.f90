!> Singly diagonally implicit Runge-Kutta methods for the growth of the depth: stiffly accurate, so
!> that the vibration is in equilibrium with the depth at the end of a step, and L-stable, so that
!> steps may grow without bound towards a steady state.
!>
!> Sources: order 2 and 3, R. Alexander, SIAM J. Numer. Anal. 14 (1977); order 4, Hairer and
!> Wanner, Solving Ordinary Differential Equations II, table IV.6.5.
module fw_wear_tableau
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: tableau_type, new_tableau

   integer, parameter :: highest_order = 4

   type :: tableau_type
      !> Order in the step, and the number of stages.
      integer :: order = 1
      integer :: n_stages = 1
      !> The diagonal, the same in all stages.
      real(wp) :: gamma = 1.0_wp
      !> Weights of earlier stages (stage, earlier stage); the last row ends the step.
      real(wp), allocatable :: a(:, :)
      !> Weights of the rates in the error estimate: at the start of the step (0), at the stages.
      real(wp), allocatable :: error(:)
   contains
      procedure :: time
   end type tableau_type

contains

   !> The method of an order from 1 to 4.
   pure function new_tableau(order) result(self)
      integer, intent(in) :: order
      type(tableau_type) :: self
      integer :: s

      self%order = order
      self%n_stages = merge(5, order, order == 4)
      s = self%n_stages
      allocate (self%a(s, s), source=0.0_wp)
      allocate (self%error(0:s), source=0.0_wp)
      select case (order)
      case (1)
         ! Implicit Euler; the trapezoidal rule estimates its error.
         self%gamma = 1.0_wp
         self%error = [-0.5_wp, 0.5_wp]
      case (2)
         self%gamma = 1.0_wp - sqrt(0.5_wp)
         self%a(2, 1) = 1.0_wp - self%gamma
         self%error(1:2) = [-self%gamma, self%gamma]
      case (3)
         call fill_third_order(self)
      case default
         self%gamma = 0.25_wp
         self%a(2, 1) = 0.5_wp
         self%a(3, 1:2) = [17.0_wp/50.0_wp, -1.0_wp/25.0_wp]
         self%a(4, 1:3) = [371.0_wp/1360.0_wp, -137.0_wp/2720.0_wp, 15.0_wp/544.0_wp]
         self%a(5, 1:4) = [25.0_wp/24.0_wp, -49.0_wp/48.0_wp, 125.0_wp/16.0_wp, -85.0_wp/12.0_wp]
         self%error(1:5) = [self%a(5, 1) - 59.0_wp/48.0_wp, self%a(5, 2) + 17.0_wp/96.0_wp, &
                            self%a(5, 3) - 225.0_wp/32.0_wp, 0.0_wp, self%gamma]
      end select
   end function new_tableau

   !> Where a stage stands, as a part of the step.
   pure real(wp) function time(self, stage)
      class(tableau_type), intent(in) :: self
      integer, intent(in) :: stage

      time = self%gamma + sum(self%a(stage, :stage - 1))
   end function time

   !> Three stages of order 3 (Alexander 1977).
   pure subroutine fill_third_order(self)
      type(tableau_type), intent(inout) :: self
      ! The middle root of g**3 - 3 g**2 + 3/2 g - 1/6.
      real(wp), parameter :: g = 0.435866521508458999416019_wp
      real(wp) :: second

      self%gamma = g
      self%a(2, 1) = 0.5_wp*(1.0_wp - g)
      self%a(3, 1:2) = [-0.25_wp*(6.0_wp*g**2 - 16.0_wp*g + 1.0_wp), &
                        0.25_wp*(6.0_wp*g**2 - 20.0_wp*g + 5.0_wp)]
      ! Less the method of order 2 on the first two stages.
      second = (1.0_wp - 2.0_wp*g)/(1.0_wp - g)
      self%error(1:3) = [self%a(3, 1) - 1.0_wp + second, self%a(3, 2) - second, g]
   end subroutine fill_third_order

end module fw_wear_tableau
