!> Pseudo-time flows of the harmonic balance, P dU/dt = -R(U), on the whole structure:
!>
!>   rotated         P_n = 2 i n omega M,  P_0 = omega^2 M
!>   identity        P = omega^2 m, the same for every coordinate (the paper's flow, with m the
!>                   mean mass to give it the unit of a stiffness)
!>   preconditioned  P_n = Z_n + the prediction stiffness of the pairs: the closed linear joint
!>
!> The rotated flow damps every harmonic below and above every resonance: the eigenvalues of its
!> linear part have the real part c/2m. The identity flow grows wherever n omega passes a natural
!> frequency.
!>
!> A shift adds P (U - U_old)/h to the residual, outside of the contact laws, so that a step of
!> implicit Euler is one of the flow to the letter. All coordinates stay in the linear problem.
module fw_flow
   use fw_kinds, only: wp
   use fw_balance_state, only: balance_state
   use fw_fourier, only: to_complex, to_real
   use fw_lapack, only: zgemm
   use fw_linalg, only: complex_lu_type
   use fw_pseudo_system, only: pseudo_system
   use fw_solver_options, only: flow_identity, flow_preconditioned
   implicit none (type, external)
   private

   public :: flow_system, new_flow

   type, extends(pseudo_system) :: flow_system
      !> The balance, nothing condensed, at its frequency.
      type(balance_state), pointer :: balance => null()
      !> P of each harmonic (n_coordinates, n_coordinates, n_retained), and its factors.
      complex(wp), allocatable :: p(:, :, :)
      type(complex_lu_type), allocatable :: factors(:)
      !> 1/h of the shift, 0 without one, and where its step started (n).
      real(wp) :: inverse_step = 0.0_wp
      real(wp), allocatable :: start(:), moved(:), shifted(:)
      !> Workspace (n_coordinates, n_retained), (n_coordinates, n_coefficients).
      complex(wp), allocatable :: input(:, :), output(:, :)
   contains
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: precondition
      procedure :: assemble
      procedure :: flow_product
      procedure :: flow_solve
      procedure :: set_shift
      procedure :: clear_shift
   end type flow_system

   !> Massless directions get this share of their stiffness as mass, so that P is regular.
   real(wp), parameter :: massless_share = 1.0e-4_wp

contains

   !> The flow of a balance at its present frequency; to be made anew when that changes.
   subroutine new_flow(balance, flow, self)
      type(balance_state), intent(inout), target :: balance
      !> flow_rotated, flow_identity or flow_preconditioned.
      integer, intent(in) :: flow
      type(flow_system), intent(out) :: self
      integer :: h, m, nh

      m = balance%problem%structure%n_coordinates
      nh = balance%problem%fourier%n_retained
      self%balance => balance
      self%interrupt => balance%interrupt
      self%n = balance%n
      self%reference = balance%reference
      self%reduced = .false.
      allocate (self%p(m, m, nh), self%factors(nh), self%input(m, nh), self%output(m, nh))
      allocate (self%start(self%n), self%moved(self%n), self%shifted(self%n), source=0.0_wp)
      do h = 1, nh
         ! Not to be used then: see solve_by_flow.
         if (self%is_interrupted()) exit
         call fill_flow(balance, flow, h, self%p(:, :, h))
         call factor_flow(self, h)
      end do
   end subroutine new_flow

   !> P of one harmonic.
   subroutine fill_flow(balance, flow, h, p)
      type(balance_state), intent(in) :: balance
      integer, intent(in) :: flow, h
      !> P of the harmonic (n_coordinates, n_coordinates), of the unit of a stiffness.
      complex(wp), intent(out), contiguous :: p(:, :)
      real(wp) :: omega, mean_mass, mass(size(p, 1), size(p, 2))
      integer :: i, n

      omega = balance%frequency()
      n = balance%problem%fourier%harmonic(h)
      call balance%problem%structure%mass(mass)
      select case (flow)
      case (flow_identity)
         mean_mass = sum([(abs(mass(i, i)), i=1, size(p, 1))])/real(size(p, 1), wp)
         p = (0.0_wp, 0.0_wp)
         do i = 1, size(p, 1)
            p(i, i) = omega**2*mean_mass
         end do
      case (flow_preconditioned)
         call balance%problem%structure%block(balance%structure_state, h, p)
         call add_closed_joint(balance, h, p)
      case default
         p = omega**2*mass
         if (n > 0) p = cmplx(0.0_wp, 2.0_wp*n, wp)*p
      end select
   end subroutine fill_flow

   !> Prediction stiffness of every component of every pair, where that is one.
   subroutine add_closed_joint(balance, h, p)
      type(balance_state), intent(in) :: balance
      integer, intent(in) :: h
      !> Grows by B^T k B of every pair (n_coordinates, n_coordinates).
      complex(wp), intent(inout) :: p(:, :)
      integer :: i, c

      associate (law => balance%problem%forces%entry(balance%problem%forces%pairs)%law)
         do i = 1, balance%problem%n_pairs
            do c = 1, 3
               if (balance%problem%joint%row(c, i) == 0) cycle
               if (law%prediction%in_time(i) .and. law%prediction%order_of(i, c) > 0) cycle
               call balance%problem%incidence%add_block(balance%problem%joint%row(c, i), h, &
                  cmplx(law%prediction%stiffness(i, c), kind=wp), p)
            end do
         end do
      end associate
   end subroutine add_closed_joint

   !> Factors of P for the explicit schemes, massless directions made regular.
   subroutine factor_flow(self, h)
      type(flow_system), intent(inout) :: self
      integer, intent(in) :: h
      logical :: singular
      real(wp) :: smallest
      integer :: i, m

      m = size(self%p, 1)
      call self%factors(h)%reserve(m)
      self%factors(h)%matrix = self%p(:, :, h)
      call self%factors(h)%factor(singular)
      ! A pivot of round-off counts as none: its direction has no mass.
      smallest = minval([(abs(self%factors(h)%matrix(i, i)), i=1, m)])
      if (.not. singular .and. smallest > 1.0e-12_wp*maxval(abs(self%p(:, :, h)))) return
      do i = 1, m
         self%p(i, i, h) = self%p(i, i, h) + massless_share* &
            abs(self%balance%problem%structure%diagonal(self%balance%structure_state, h, i))
      end do
      self%factors(h)%matrix = self%p(:, :, h)
      call self%factors(h)%factor(singular)
   end subroutine factor_flow

   !> P v.
   subroutine flow_product(self, vector, product)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)

      call multiply(self, size(self%p, 1), vector, product)
   end subroutine flow_product

   !> In complex amplitudes, since P couples cosine and sine of a harmonic, but no two harmonics.
   subroutine multiply(self, m, vector, product)
      class(flow_system), intent(inout) :: self
      integer, intent(in) :: m
      real(wp), intent(in) :: vector(m, *)
      real(wp), intent(inout) :: product(m, *)
      complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
      integer :: h

      call to_complex(self%balance%problem%fourier, m, vector, self%input)
      do h = 1, size(self%p, 3)
         call zgemm('N', 'N', m, 1, m, one, self%p(1, 1, h), m, self%input(1, h), m, zero, &
                    self%output(1, h), m)
      end do
      call to_real(self%balance%problem%fourier, m, self%output, product)
   end subroutine multiply

   !> P^-1 v, massless directions with the mass that factor_flow has given them.
   subroutine flow_solve(self, vector)
      class(flow_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      integer :: h, m

      m = size(self%p, 1)
      call to_complex(self%balance%problem%fourier, m, vector, self%input)
      do h = 1, size(self%p, 3)
         call self%factors(h)%solve(1, self%input(:, h:h))
      end do
      call to_real(self%balance%problem%fourier, m, self%input, vector)
   end subroutine flow_solve

   !> From now on R(U) + P (U - x_old)/h = 0 is solved: one step of implicit Euler.
   subroutine set_shift(self, h, x_old)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in) :: h
      real(wp), intent(in), contiguous :: x_old(:)

      self%inverse_step = 1.0_wp/h
      self%start = x_old
      ! The balance adds it to its derivative; the shift of the residual is added here.
      self%balance%shift = self%p/h
   end subroutine set_shift

   !> The balance as it is, without a step of pseudo-time: its solution is a steady state.
   subroutine clear_shift(self)
      class(flow_system), intent(inout) :: self

      self%inverse_step = 0.0_wp
      if (allocated(self%balance%shift)) deallocate (self%balance%shift)
   end subroutine clear_shift

   ! The system of the balance, shifted or not.

   !> R(x) + P (x - x_old)/step: an implicit step is the root of it, and the balance itself is
   !> met where x no longer moves.
   subroutine residual(self, x, r)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)

      ! The shift stands outside of the contact laws: no row reads eps v = -r any more, and nothing
      ! leaves the linear problem.
      self%balance%reduced = .false.
      call self%balance%residual(x, r)
      if (self%inverse_step <= 0.0_wp) return
      self%moved = x - self%start
      call self%flow_product(self%moved, self%shifted)
      r = r + self%inverse_step*self%shifted
   end subroutine residual

   !> Also behind calls from elsewhere: all rows stay in the linear problem here.
   subroutine linearize(self, n_linear)
      class(flow_system), intent(inout) :: self
      integer, intent(out) :: n_linear

      self%balance%reduced = .false.
      call self%balance%linearize(n_linear)
   end subroutine linearize

   !> Handed on, as are the next: the shift stands in the balance itself.
   subroutine reduce(self, r, rhs)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)

      call self%balance%reduce(r, rhs)
   end subroutine reduce

   subroutine expand(self, r, solution, step)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)

      call self%balance%expand(r, solution, step)
   end subroutine expand

   subroutine apply(self, vector, product)
      class(flow_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)

      call self%balance%apply(vector, product)
   end subroutine apply

   subroutine build_preconditioner(self)
      class(flow_system), intent(inout) :: self

      call self%balance%build_preconditioner()
   end subroutine build_preconditioner

   subroutine precondition(self, vector)
      class(flow_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)

      call self%balance%precondition(vector)
   end subroutine precondition

   subroutine assemble(self, matrix)
      class(flow_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)

      call self%balance%assemble(matrix)
   end subroutine assemble

end module fw_flow
