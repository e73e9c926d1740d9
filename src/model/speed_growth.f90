!> What the rotation speed Omega adds to stiffness and static load: even powers of it,
!>
!>   K = K_0 + sum_p Omega**(2 p) K_p,   f = f_0 + sum_p Omega**(2 p) f_p.
!>
!> One power is the usual centrifugal stiffening; more go through matrices at several speeds.
module fw_speed_growth
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: even_powers, slopes_of_powers, speed_growth

   !> A component is not allocated where nothing grows.
   type :: speed_growth
      !> K_p (n_dof, n_dof, n_powers) [force/length/(rad/s)**(2 p)].
      real(wp), allocatable :: stiffness(:, :, :)
      !> f_p (n_dof, n_powers), and f_0 of tables (n_dof).
      real(wp), allocatable :: load(:, :), load_at_rest(:)
      !> Between these it is known [rad/s].
      real(wp) :: lowest = 0.0_wp, highest = huge(1.0_wp)
   contains
      procedure :: exists
      procedure :: n_powers
      procedure :: add_stiffness
      procedure :: add_load
   end type speed_growth

contains

   !> Whether anything depends on the speed.
   pure logical function exists(self)
      class(speed_growth), intent(in) :: self

      exists = allocated(self%stiffness) .or. allocated(self%load)
   end function exists

   !> Powers of the stiffness or of the load.
   pure integer function n_powers(self)
      class(speed_growth), intent(in) :: self

      n_powers = 0
      if (allocated(self%stiffness)) n_powers = size(self%stiffness, 3)
      if (allocated(self%load)) n_powers = max(n_powers, size(self%load, 2))
   end function n_powers

   !> Add factors times K_p: of even powers for the stiffness, of their slopes for its derivative.
   pure subroutine add_stiffness(self, factors, matrix)
      class(speed_growth), intent(in) :: self
      !> As many as there are powers, or more.
      real(wp), intent(in) :: factors(:)
      !> Grows by them (n_dof, n_dof).
      real(wp), intent(inout) :: matrix(:, :)
      integer :: p

      if (.not. allocated(self%stiffness)) return
      do p = 1, size(self%stiffness, 3)
         matrix = matrix + factors(p)*self%stiffness(:, :, p)
      end do
   end subroutine add_stiffness

   !> Likewise of the load, without that at rest.
   pure subroutine add_load(self, factors, vector)
      class(speed_growth), intent(in) :: self
      real(wp), intent(in) :: factors(:)
      !> Grows by them (n_dof).
      real(wp), intent(inout) :: vector(:)

      if (.not. allocated(self%load)) return
      vector = vector + matmul(self%load, factors(:size(self%load, 2)))
   end subroutine add_load

   !> Omega**2, Omega**4, .. (n).
   !> The number of powers is that of the matrices; a speed of 0 makes all of them 0.
   pure function even_powers(speed, n) result(factors)
      real(wp), intent(in) :: speed
      integer, intent(in) :: n
      real(wp) :: factors(n)
      integer :: p

      factors = [(speed**(2*p), p=1, n)]
   end function even_powers

   !> Their derivatives by Omega.
   pure function slopes_of_powers(speed, n) result(slopes)
      real(wp), intent(in) :: speed
      integer, intent(in) :: n
      real(wp) :: slopes(n)
      integer :: p

      slopes = [(2*p*speed**(2*p - 1), p=1, n)]
   end function slopes_of_powers

end module fw_speed_growth
