!> The predicted forces of one pair as trigonometric polynomials, with samples that isolate their
!> roots: P the tangential prediction, N = -y_n the normal pressure, Q = mu N, and the bounds
!> P - Q and P + Q between which the corrected position lies.
module fw_event_curves
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: curves_type

   type :: curves_type
      integer :: degree = 0
      !> Angles of the grid, at least 4 degree.
      integer :: n_grid = 0
      real(wp) :: mu = 0.0_wp
      !> P, N, P - Q, P + Q, and the slopes of the last two (0:degree, cosine and sine).
      real(wp), allocatable :: tangential(:, :), normal(:, :), lower(:, :), upper(:, :)
      real(wp), allocatable :: lower_slope(:, :), upper_slope(:, :)
      !> P, P', P'', N, N', N'' on the grid (n_grid, 6).
      real(wp), allocatable :: samples(:, :)
      !> P - Q and P + Q (or their slopes) and the slopes of that on the grid (n_grid).
      real(wp), allocatable :: values(:), slopes(:)
      !> Sum of the amplitudes of P and Q: the measure of round-off.
      real(wp) :: scale = 0.0_wp
      !> N is constant.
      logical :: steady = .false.
      !> How fast side 2 takes the corrected position along [force/rad]: bounds are then counted in
      !> a frame that goes with it.
      real(wp) :: carry = 0.0_wp
   contains
      procedure :: reserve
      procedure :: combine
      procedure :: sample_bound
   end type curves_type

contains

   !> Room for polynomials of a degree on a grid.
   pure subroutine reserve(self, degree, n_grid)
      class(curves_type), intent(inout) :: self
      integer, intent(in) :: degree, n_grid

      self%degree = degree
      self%n_grid = n_grid
      allocate (self%tangential(0:degree, 2), self%normal(0:degree, 2), source=0.0_wp)
      allocate (self%lower, self%upper, self%lower_slope, self%upper_slope, mold=self%normal)
      allocate (self%samples(n_grid, 6), source=0.0_wp)
      allocate (self%values(n_grid), self%slopes(n_grid), source=0.0_wp)
   end subroutine reserve

   !> Fill the bounds from P and N.
   !> Called once the coefficients of P and N are filled; `samples` are not touched.
   pure subroutine combine(self, mu)
      class(curves_type), intent(inout) :: self
      real(wp), intent(in) :: mu
      integer :: m

      self%mu = mu
      self%scale = 0.0_wp
      self%steady = .true.
      do m = 0, self%degree
         self%lower(m, :) = self%tangential(m, :) - mu*self%normal(m, :)
         self%upper(m, :) = self%tangential(m, :) + mu*self%normal(m, :)
         self%lower_slope(m, 1) = real(m, wp)*self%lower(m, 2)
         self%lower_slope(m, 2) = -real(m, wp)*self%lower(m, 1)
         self%upper_slope(m, 1) = real(m, wp)*self%upper(m, 2)
         self%upper_slope(m, 2) = -real(m, wp)*self%upper(m, 1)
         ! Not the size of the bounds themselves: where P and Q cancel, the round-off of the terms
         ! stays.
         self%scale = self%scale + abs(self%tangential(m, 1)) + abs(self%tangential(m, 2)) + &
                      mu*(abs(self%normal(m, 1)) + abs(self%normal(m, 2)))
         if (m > 0) self%steady = self%steady .and. all(abs(self%normal(m, :)) <= 0.0_wp)
      end do
      if (.not. abs(self%carry) > 0.0_wp) return
      ! In its frame a bound has the slope of P -+ Q less that of the frame.
      self%lower_slope(0, 1) = self%lower_slope(0, 1) - self%carry
      self%upper_slope(0, 1) = self%upper_slope(0, 1) - self%carry
      self%scale = self%scale + 2.0_wp*pi*abs(self%carry)
   end subroutine combine

   !> Values and slopes on the grid of P + side Q, or of its derivative.
   !> The slope of a derivative is the second one: hence the six samples.
   pure subroutine sample_bound(self, side, of_derivative)
      class(curves_type), intent(inout) :: self
      !> -1 for the lower bound, +1 for the upper one.
      real(wp), intent(in) :: side
      logical, intent(in) :: of_derivative
      integer :: first, k

      ! P or P' as the values, of which the next sample is the slope; N stands three further on.
      first = merge(2, 1, of_derivative)
      do k = 1, self%n_grid
         self%values(k) = self%samples(k, first) + side*self%mu*self%samples(k, first + 3)
         self%slopes(k) = self%samples(k, first + 1) + side*self%mu*self%samples(k, first + 4)
      end do
      if (of_derivative .and. abs(self%carry) > 0.0_wp) self%values = self%values - self%carry
   end subroutine sample_bound

end module fw_event_curves
