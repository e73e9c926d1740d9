!> A nonlinear system R(x) = 0 with a flow in pseudo-time, P dx/dt = -R(x), whose steady states
!> are the solutions. P is a constant, regular linear operator.
!>
!> With a shift set, the system is that of a step of implicit Euler from x_old,
!>
!>   R_s(x) = R(x) + P (x - x_old)/h:
!>
!> `residual`, `linearize`, `reduce`, `expand`, `apply`, `assemble` and the preconditioner belong
!> to R_s then. J + P/h is also what the implicit schemes of higher order solve with, since
!> (1 + h P^-1 J) v = b is (J + P/h) v = P b/h.
!>
!> What the schemes rely on: `apply` and `assemble` are called after `linearize` with no residual
!> in between; `precondition` uses the last `build_preconditioner`, whatever was evaluated since.
module fw_pseudo_system
   use fw_kinds, only: wp
   use fw_system, only: nonlinear_system
   implicit none (type, external)
   private

   public :: pseudo_system, spectral_radius

   type, abstract, extends(nonlinear_system) :: pseudo_system
   contains
      procedure(multiply_flow), deferred :: flow_product
      procedure(solve_flow), deferred :: flow_solve
      procedure(start_shift), deferred :: set_shift
      procedure(end_shift), deferred :: clear_shift
      ! May be overridden.
      procedure :: rate
      procedure :: local_steps
      procedure :: accept
   end type pseudo_system

   abstract interface
      !> product = P vector.
      subroutine multiply_flow(self, vector, product)
         import :: pseudo_system, wp
         class(pseudo_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: vector(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine multiply_flow

      !> vector = P^-1 vector.
      subroutine solve_flow(self, vector)
         import :: pseudo_system, wp
         class(pseudo_system), intent(inout) :: self
         real(wp), intent(inout), contiguous :: vector(:)
      end subroutine solve_flow

      !> From here on the system is R(x) + P (x - x_old)/h. May be called again at any time.
      subroutine start_shift(self, h, x_old)
         import :: pseudo_system, wp
         class(pseudo_system), intent(inout) :: self
         real(wp), intent(in) :: h
         real(wp), intent(in), contiguous :: x_old(:)
      end subroutine start_shift

      !> Back to R(x); harmless where no shift is set.
      subroutine end_shift(self)
         import :: pseudo_system
         class(pseudo_system), intent(inout) :: self
      end subroutine end_shift
   end interface

   !> Radius of the half disc on the stable side in which the multistage schemes are stable
   !> (2.55 with five stages, 2.62 with four; computed from their stability polynomials).
   real(wp), parameter :: stable_radius = 2.55_wp
   !> Products of the estimate of the spectral radius, those that count, and its safety factor.
   integer, parameter :: n_products = 24, n_counted = 8
   real(wp), parameter :: safety = 1.1_wp

contains

   !> dxdt = -P^-1 R(x); with a shift set, that of the shifted flow.
   subroutine rate(self, x, dxdt)
      class(pseudo_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dxdt(:)

      call self%residual(x, dxdt)
      dxdt = -dxdt
      call self%flow_solve(dxdt)
   end subroutine rate

   !> Steps of an explicit scheme, one for each unknown (n): by default the same for all,
   !> cfl * stable radius / spectral radius of P^-1 J. Different ones integrate another flow to the
   !> same steady states.
   subroutine local_steps(self, x, cfl, step)
      class(pseudo_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(in) :: cfl
      real(wp), intent(out), contiguous :: step(:)

      step = cfl*stable_radius/max(spectral_radius(self, x), tiny(1.0_wp))
   end subroutine local_steps

   !> A step has ended at x, which solves the shifted system. For systems that have unknowns
   !> behind x (condensed ones); the others need not care.
   subroutine accept(self, x)
      class(pseudo_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)

      associate (self => self, x => x)
      end associate
   end subroutine accept

   !> Spectral radius of P^-1 J at x by the growth of norms under repeated products, which complex
   !> eigenvalues do not disturb; zero where the products vanish.
   real(wp) function spectral_radius(system, x) result(radius)
      class(pseudo_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      real(wp), allocatable :: vector(:), product(:)
      real(wp) :: norm, growth
      logical :: reduced
      integer :: i, n_linear

      allocate (vector(system%n), product(system%n))
      reduced = system%reduced
      system%reduced = .false.
      call system%residual(x, product)
      call system%linearize(n_linear)
      system%reduced = reduced
      ! No eigenvector of anything: components of many sizes and both signs.
      vector = [(sin(1.0_wp + 2.4_wp*real(i, wp)*real(i, wp)), i=1, system%n)]
      vector = vector/norm2(vector)
      growth = 0.0_wp
      radius = 0.0_wp
      do i = 1, n_products
         call system%apply(vector, product)
         call system%flow_solve(product)
         norm = norm2(product)
         if (.not. norm > 0.0_wp) return
         if (i > n_products - n_counted) growth = growth + log(norm)
         vector = product/norm
      end do
      radius = safety*exp(growth/real(n_counted, wp))
   end function spectral_radius

end module fw_pseudo_system
