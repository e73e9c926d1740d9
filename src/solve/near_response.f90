!> What the linearized system does near a point of a branch when p alone changes: how far a step
!> may go without passing over a resonance.
!>
!> With J = dR/dx and its derivative J' by p, both frozen, R(x, p) = 0 becomes
!>
!>   x(p + d) = x + d (1 + d T)^-1 dx/dp,     T = J^-1 J',
!>
!> whose poles are the resonances. The Krylov space of T from dx/dp holds those that the
!> excitation moves, the nearest first; there T is a small Hessenberg matrix H (a Pade
!> approximation by Arnoldi's method; Antoulas 2005, Approximation of large-scale dynamical
!> systems). The small model costs next to nothing: a step is short enough when the cubic through
!> its ends and slopes follows the model all the way, at its narrowest resonances too. Values alone
!> cannot tell: beside a resonance of 0.1 % damping there is nothing to see of it.
module fw_near_response
   use fw_branch_point, only: branch_point
   use fw_corrector, only: corrector_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgeev
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: near_response

   type :: near_response
      !> Whether the branch is measured by x.
      logical :: measures_x = .true.
      !> Order of the model; 0: nothing is known, and nothing is bounded.
      integer :: n = 0
      !> Norms of dx/dp and x, over the scale of x.
      real(wp) :: slope = 0.0_wp, size = 0.0_wp
      !> H, and x in the basis over the scale of x.
      real(wp), allocatable :: hessenberg(:, :), base(:)
      !> Resonances: changes of p to where they are (n).
      real(wp), allocatable :: resonance(:)
   contains
      procedure :: find
      procedure :: bound
      procedure :: misses
   end type near_response

   !> Directions of the model, where a direct solution makes them cheap and where it does not.
   integer, parameter :: directions_lu = 16, directions_krylov = 4
   !> A direction that is nothing but round-off of the one before.
   real(wp), parameter :: dependent = 1.0e-10_wp
   !> What the cubic may miss of the model, of the size of x: the model is linear in the change of
   !> p, and takes a resonance ahead to be a little further than it is.
   real(wp), parameter :: allowed = 2.0e-3_wp
   !> Places of a step where it is looked at.
   integer, parameter :: n_places = 12
   !> How much further than along the tangent p is followed.
   real(wp), parameter :: furthest = 4.0_wp
   !> Shortening of a step that goes too far, and how often.
   real(wp), parameter :: shorter = 0.75_wp
   integer, parameter :: max_trials = 60

contains

   !> The model at a point at which the tangent has just been found.
   subroutine find(self, corrector, system, point, scale)
      class(near_response), intent(inout) :: self
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: point
      !> The size of x.
      real(wp), intent(in) :: scale
      real(wp), allocatable :: v(:, :), at_point(:)
      integer :: j, m

      self%n = 0
      if (corrector%stands(point) .or. size(corrector%linear%rhs) == 0) return
      self%measures_x = .not. associated(corrector%view)
      self%slope = norm2(point%t)/abs(point%t_p)/scale
      self%size = norm2(point%x)/scale
      if (.not. self%slope > 0.0_wp) return
      m = min(system%n, merge(directions_lu, directions_krylov, corrector%linear%factored))
      allocate (v(system%n, m + 1), at_point(system%n))
      if (allocated(self%hessenberg)) deallocate (self%hessenberg)
      allocate (self%hessenberg(m, m), source=0.0_wp)
      call system%parameter_derivative(point%x, at_point)
      v(:, 1) = point%t/norm2(point%t)
      do j = 1, m
         call extend(self, corrector, system, point, scale, at_point, v, j)
         if (self%n < j) exit
      end do
      if (self%n == 0) return
      self%hessenberg = self%hessenberg(:self%n, :self%n)
      self%base = matmul(point%x, v(:, :self%n))/scale
      if (point%t_p < 0.0_wp) self%base = -self%base
      call find_resonances(self)
   end subroutine find

   !> Column j of H and direction j + 1 (modified Gram-Schmidt, twice).
   subroutine extend(self, corrector, system, point, scale, at_point, v, j)
      type(near_response), intent(inout) :: self
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: point
      real(wp), intent(in) :: scale, at_point(:)
      real(wp), intent(inout), contiguous :: v(:, :)
      integer, intent(in) :: j
      real(wp), parameter :: forcing = 1.0e-2_wp
      real(wp), allocatable :: w(:), image(:)
      real(wp) :: part, size
      integer :: i, turn
      logical :: done

      allocate (w(system%n), image(system%n))
      ! dR/dp is affine in x where the state of the contact is frozen.
      call system%parameter_derivative(point%x + scale*v(:, j), image)
      image = (image - at_point)/scale
      call corrector%linear%solve_prepared(system, image, forcing, w, done)
      if (.not. done) return
      w = -w
      size = norm2(w)
      do turn = 1, 2
         do i = 1, j
            part = dot_product(v(:, i), w)
            if (i <= ubound(self%hessenberg, 1)) then
               self%hessenberg(i, j) = self%hessenberg(i, j) + part
            end if
            w = w - part*v(:, i)
         end do
      end do
      self%n = j
      part = norm2(w)
      if (part <= dependent*size .or. j == ubound(self%hessenberg, 1)) then
         self%n = j
         v(:, j + 1) = 0.0_wp
         return
      end if
      self%hessenberg(j + 1, j) = part
      v(:, j + 1) = w/part
   end subroutine extend

   !> Where 1 + d T is closest to singular for real d: d = Re(-1/eigenvalue).
   subroutine find_resonances(self)
      type(near_response), intent(inout) :: self
      real(wp) :: matrix(self%n, self%n), re(self%n), im(self%n), work(8*self%n), unused(1)
      integer :: info

      matrix = self%hessenberg
      call dgeev('N', 'N', self%n, matrix, self%n, re, im, unused, 1, unused, 1, work, size(work), &
                 info)
      self%resonance = [real(wp) ::]
      if (info == 0) self%resonance = -re/max(re**2 + im**2, tiny(1.0_wp))
   end subroutine find_resonances

   !> The longest step along the tangent of the point, up to a wanted one, that passes over
   !> nothing; `share` is the part of p in the unit tangent. Where the curve bends, p changes by
   !> more than the tangent says: the model knows.
   pure real(wp) function bound(self, wanted, share, p_scale) result(length)
      class(near_response), intent(in) :: self
      real(wp), intent(in) :: wanted, share, p_scale
      real(wp) :: change, at_end(self%n), slope_end(self%n)
      integer :: k

      length = wanted
      if (self%n == 0) return
      change = furthest*wanted*share*p_scale
      do k = 1, max_trials
         if (self%misses(change) <= allowed) exit
         change = shorter*change
      end do
      if (k == 1) return
      if (.not. self%measures_x) then
         length = min(wanted, change/(share*p_scale))
         return
      end if
      call evaluate(self, change, at_end, slope_end)
      length = sqrt(1.0_wp - share**2)*at_end(1)*sign(1.0_wp, change) + share*change/p_scale
      length = min(wanted, max(length, share*change/p_scale))
   end function bound

   !> What the cubic of a step misses of the model, over the size of x there.
   pure real(wp) function misses(self, change)
      class(near_response), intent(in) :: self
      real(wp), intent(in) :: change
      real(wp) :: at_end(self%n), slope_end(self%n), here(self%n), slope(self%n), cubic(self%n)
      real(wp) :: d, s, slope_start(self%n)
      integer :: k

      misses = 0.0_wp
      if (self%n == 0) return
      slope_start = 0.0_wp
      slope_start(1) = self%slope
      call evaluate(self, change, at_end, slope_end)
      do k = 1, n_places + size(self%resonance)
         if (k <= n_places) then
            d = change*real(k, wp)/real(n_places + 1, wp)
         else
            d = self%resonance(k - n_places)
            if (d*(change - d) <= 0.0_wp) cycle
         end if
         s = d/change
         call evaluate(self, d, here, slope)
         cubic = s**2*(3.0_wp - 2.0_wp*s)*at_end + change*s*(1.0_wp - s)*((1.0_wp - s)* &
                                                                   slope_start - s*slope_end)
         misses = max(misses, norm2(cubic - here)/size_with(self, here))
      end do
   end function misses

   !> Size of x + its change; not that of an antiresonance, where x is all but nothing.
   pure real(wp) function size_with(self, change) result(size)
      type(near_response), intent(in) :: self
      real(wp), intent(in) :: change(:)
      real(wp), parameter :: least = 0.15_wp

      size = self%size**2 + 2.0_wp*dot_product(self%base, change) + sum(change**2)
      size = max(sqrt(max(size, 0.0_wp)), least)
   end function size_with

   !> Change of x for a change d of p, in the basis, and its derivative by d.
   pure subroutine evaluate(self, d, change, slope)
      type(near_response), intent(in) :: self
      real(wp), intent(in) :: d
      real(wp), intent(out) :: change(:), slope(:)
      real(wp) :: right(self%n, 2)

      right = 0.0_wp
      right(1, 1) = self%slope
      call solve_shifted(self%n, self%hessenberg, d, right(:, 1))
      change = d*right(:, 1)
      right(:, 2) = right(:, 1)
      call solve_shifted(self%n, self%hessenberg, d, right(:, 2))
      slope = right(:, 2)
   end subroutine evaluate

   !> (1 + d H) x = b in place, H of Hessenberg form.
   pure subroutine solve_shifted(n, hessenberg, d, b)
      integer, intent(in) :: n
      real(wp), intent(in) :: hessenberg(n, n), d
      real(wp), intent(inout) :: b(n)
      real(wp) :: a(n, n), row(n), factor
      integer :: i

      a = d*hessenberg
      do i = 1, n
         a(i, i) = a(i, i) + 1.0_wp
      end do
      do i = 1, n - 1
         if (abs(a(i + 1, i)) > abs(a(i, i))) then
            row = a(i, :)
            a(i, :) = a(i + 1, :)
            a(i + 1, :) = row
            b([i, i + 1]) = b([i + 1, i])
         end if
         if (abs(a(i, i)) <= 0.0_wp) cycle
         factor = a(i + 1, i)/a(i, i)
         a(i + 1, i:) = a(i + 1, i:) - factor*a(i, i:)
         b(i + 1) = b(i + 1) - factor*b(i)
      end do
      do i = n, 1, -1
         b(i) = b(i) - dot_product(a(i, i + 1:), b(i + 1:))
         b(i) = b(i)/sign(max(abs(a(i, i)), tiny(1.0_wp)), a(i, i))
      end do
   end subroutine solve_shifted

end module fw_near_response
