!> The limits of pairs that vibrate about constant offsets x with the amplitude A,
!>
!>   |T_i(t)| <= mu_i N_i(t),   T_i = x_i + A c_i(t),   N_i = N_0i + sum_j C_ij x_j + A n_i(t),
!>
!> and the sum of minus their logarithms with its derivatives by x and A.
module fw_shakedown_limits
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: shakedown_limits, pair_limits

   type :: shakedown_limits
      !> Pairs, and unknowns: offsets and the amplitude behind them.
      integer :: n_pairs = 0, n = 0
      !> Friction coefficients (n_pairs); places of the offsets of each pair among the unknowns, 0
      !> where it has no such direction (2, n_pairs).
      real(wp), allocatable :: mu(:)
      integer, allocatable :: place(:, :)
      !> Normal forces without vibration or offset (n_pairs), and what offsets add (n_pairs, n - 1).
      real(wp), allocatable :: normal(:), coupling(:, :)
      !> Of t1, t2 and the normal force, for a unit amplitude: A Re(cycle exp(i t)) (3, n_pairs).
      complex(wp), allocatable :: cycle(:, :)
   contains
      procedure :: find
      procedure :: height
      procedure :: slopes
   end type shakedown_limits

   !> Forces of a pair at all instants, and what is left to its limit.
   type :: pair_limits
      real(wp), allocatable :: force(:, :), normal(:), left(:)
   end type pair_limits

contains

   !> mu^2 N^2 - |T|^2 of a pair, or N where it has no tangential direction.
   pure subroutine find(self, i, wave, x, limits)
      class(shakedown_limits), intent(in) :: self
      integer, intent(in) :: i
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: x(:)
      type(pair_limits), intent(inout) :: limits
      integer :: c, n

      n = self%n
      limits%normal = self%normal(i) + dot_product(self%coupling(i, :), x(:n - 1)) + &
                      x(n)*real(self%cycle(3, i)*wave, wp)
      limits%left = limits%normal
      if (all(self%place(:, i) == 0)) return
      limits%left = (self%mu(i)*limits%normal)**2
      if (.not. allocated(limits%force)) allocate (limits%force(size(wave), 2))
      limits%force = 0.0_wp
      do c = 1, 2
         if (self%place(c, i) == 0) cycle
         limits%force(:, c) = x(self%place(c, i)) + x(n)*real(self%cycle(c, i)*wave, wp)
         limits%left = limits%left - limits%force(:, c)**2
      end do
   end subroutine find

   !> Minus the logarithms of all limits, and the weighed amplitude; huge where one is passed.
   pure real(wp) function height(self, wave, weight, x)
      class(shakedown_limits), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: weight, x(:)
      type(pair_limits) :: limits
      integer :: i

      height = -weight*x(self%n)
      do i = 1, self%n_pairs
         call self%find(i, wave, x, limits)
         if (.not. (all(limits%normal > 0.0_wp) .and. all(limits%left > 0.0_wp))) then
            height = huge(1.0_wp)
            return
         end if
         height = height - sum(log(limits%left))
      end do
   end function height

   !> First and second derivatives of minus the logarithms of all limits. A pair knows four numbers
   !> alone: its two offsets, its normal force without vibration, and the amplitude; their
   !> derivatives are added up over the instants before they are spread over all unknowns.
   subroutine slopes(self, wave, x, gradient, curvature)
      class(shakedown_limits), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: gradient(:), curvature(:, :)
      real(wp) :: by(4), twice(4, 4), by_normal(self%n_pairs), row(self%n - 1)
      type(pair_limits) :: limits
      integer :: c, i, j, n, p

      n = self%n
      gradient = 0.0_wp
      curvature = 0.0_wp
      do i = 1, self%n_pairs
         call self%find(i, wave, x, limits)
         call local_slopes(self, i, wave, limits, by, twice)
         by_normal(i) = twice(3, 3)
         row = self%coupling(i, :)
         gradient(:n - 1) = gradient(:n - 1) + by(3)*row
         gradient(n) = gradient(n) + by(4)
         curvature(:n - 1, n) = curvature(:n - 1, n) + twice(3, 4)*row
         curvature(n, n) = curvature(n, n) + twice(4, 4)
         do c = 1, 2
            p = self%place(c, i)
            if (p == 0) cycle
            gradient(p) = gradient(p) + by(c)
            curvature(p, n) = curvature(p, n) + twice(c, 4)
            curvature(:n - 1, p) = curvature(:n - 1, p) + twice(c, 3)*row
            curvature(p, :n - 1) = curvature(p, :n - 1) + twice(c, 3)*row
            do j = 1, 2
               if (self%place(j, i) == 0) cycle
               curvature(self%place(j, i), p) = curvature(self%place(j, i), p) + twice(j, c)
            end do
         end do
      end do
      curvature(n, :n - 1) = curvature(:n - 1, n)
      curvature(:n - 1, :n - 1) = curvature(:n - 1, :n - 1) + matmul(transpose(self%coupling), &
         spread(by_normal, 2, n - 1)*self%coupling)
   end subroutine slopes

   !> Of a pair, by its two offsets, its normal force without vibration, and the amplitude.
   pure subroutine local_slopes(self, i, wave, limits, by, twice)
      type(shakedown_limits), intent(in) :: self
      integer, intent(in) :: i
      complex(wp), intent(in) :: wave(:)
      type(pair_limits), intent(in) :: limits
      real(wp), intent(out) :: by(4), twice(4, 4)
      real(wp) :: slope(size(wave), 4), vibrating(size(wave), 3), bend
      integer :: c, j

      do c = 1, 3
         vibrating(:, c) = real(self%cycle(c, i)*wave, wp)
      end do
      slope = 0.0_wp
      if (all(self%place(:, i) == 0)) then
         slope(:, 3) = 1.0_wp/limits%left
      else
         do c = 1, 2
            if (self%place(c, i) > 0) slope(:, c) = -2.0_wp*limits%force(:, c)/limits%left
         end do
         slope(:, 3) = 2.0_wp*self%mu(i)**2*limits%normal/limits%left
      end if
      slope(:, 4) = sum(slope(:, :3)*vibrating, dim=2)
      by = -sum(slope, dim=1)
      twice = matmul(transpose(slope), slope)
      if (all(self%place(:, i) == 0)) return
      ! The second derivative of the limit itself.
      do c = 1, 3
         if (c < 3) then
            if (self%place(c, i) == 0) cycle
         end if
         bend = 2.0_wp
         if (c == 3) bend = -2.0_wp*self%mu(i)**2
         associate (part => bend/limits%left)
            twice(c, c) = twice(c, c) + sum(part)
            twice(c, 4) = twice(c, 4) + sum(part*vibrating(:, c))
            twice(4, 4) = twice(4, 4) + sum(part*vibrating(:, c)**2)
         end associate
      end do
      do j = 1, 3
         twice(4, j) = twice(j, 4)
      end do
   end subroutine local_slopes

end module fw_shakedown_limits
