!> The condensed stiffness of several harmonics side by side, one in each lane of the vectors of a
!> processor: for few coordinates, whose matrices are too small for a library to be fast with each.
!>
!> D = L d L^T without pivots, and with y = L^-1 Z_iq and u = d^-1 y
!>
!>   Z_r = Z_qq - y^T u,
!>
!> of which one triangle is computed: less than half of the work of a solution and a product.
!> Where damping couples no internal modes L = 1.
!>
!> Pivots are not needed where D = R + i S with R diagonal and S positive definite, as damping is
!> (`is_regular` looks at it): a Schur complement with respect to modes E adds
!> S_kE (R_EE + i S_EE)^-1 S_El, which is at most sqrt(S_kk S_ll), because
!> (S_EE^(-1/2) R_EE S_EE^(-1/2) + i)^-1 is at most 1. L may have large entries, but what round-off
!> follows, |L| |d| |L|^T, is made of differences of such complements and is as small as D. Damping
!> that excites (an imaginary part of theta) leaves S without a sign, and is for a library.
!> K, M and C are symmetric.
module fw_condensed_group
   use fw_hermitian, only: is_regular
   use fw_kinds, only: wp
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: condensed_group, lanes

   !> Harmonics side by side: the widest vectors.
   integer, parameter :: lanes = 8
   !> Harmonics from which enough lanes are in use.
   integer, parameter :: fewest_harmonics = 4
   !> Numbers of a group up to which it stays in the cache of a core.
   real(wp), parameter :: most_numbers = 65536.0_wp

   !> Coordinates that no contact touches, condensed together.
   type :: condensed_group
      private
      !> Whether structure and size are such that this serves.
      logical, public :: serves = .false.
      !> Rows of L, real and imaginary part (lane, part, column, row), d^-1 (lane, part, mode), and
      !> two columns (lane, part, mode, 2), of which nobody reads the second.
      real(wp), allocatable :: lower(:, :, :, :), inverse(:, :, :), column(:, :, :, :)
      !> y and u of the coordinates, then of the load, filled up to an even number
      !> (lane, part, mode, coordinate).
      real(wp), allocatable :: y(:, :, :, :), u(:, :, :, :)
   contains
      procedure :: reserve
      procedure :: form
   end type condensed_group

contains

   !> Room, where this serves.
   subroutine reserve(self, basis, n_harmonics)
      class(condensed_group), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_harmonics
      real(wp) :: n_numbers
      integer :: n_columns

      associate (n => basis%n_internal)
         n_columns = 2*((basis%n_coordinates + 2)/2)
         n_numbers = real(4*lanes*n, wp)*n_columns
         if (allocated(basis%c_ii)) n_numbers = n_numbers + real(2*lanes*n, wp)*n
         self%serves = n > 0 .and. n_harmonics >= fewest_harmonics .and. n_numbers <= most_numbers
         if (.not. self%serves) return
         if (allocated(basis%c_ii)) then
            self%serves = is_regular(cmplx(basis%c_ii, kind=wp))
            if (.not. self%serves) return
            allocate (self%lower(lanes, 2, n, n), self%column(lanes, 2, n, 2), source=0.0_wp)
         end if
         allocate (self%inverse(lanes, 2, n), source=0.0_wp)
         allocate (self%y(lanes, 2, n, n_columns), self%u(lanes, 2, n, n_columns), source=0.0_wp)
      end associate
   end subroutine reserve

   !> Z_r of up to `lanes` harmonics, and their loads.
   subroutine form(self, basis, theta, s, internal_load, matrix, load, n_failed)
      class(condensed_group), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      !> theta = (n omega)**2 and s = n omega of each.
      real(wp), intent(in) :: theta(:), s(:)
      !> Load of the internal modes (n_internal, size(s)).
      complex(wp), intent(in) :: internal_load(:, :)
      !> Z_r (n_coordinates, n_coordinates, size(s)), and the condensed loads, before that those of
      !> the coordinates (n_coordinates, size(s)).
      complex(wp), intent(inout) :: matrix(:, :, :), load(:, :)
      !> Harmonics that hit a mode without damping are added.
      integer, intent(inout) :: n_failed
      real(wp) :: theta_of(lanes), s_of(lanes)
      integer :: c, i, m, n

      m = basis%n_coordinates
      n = basis%n_internal
      ! Lanes behind the last harmonic repeat it.
      theta_of = theta(size(theta))
      s_of = s(size(s))
      theta_of(:size(theta)) = theta
      s_of(:size(s)) = s
      call factor(self, basis, theta_of, s_of, size(s), n_failed)
      do c = 1, m
         do i = 1, n
            self%y(:, 1, i, c) = basis%coupling(i, 1, c) - theta_of*basis%coupling(i, 2, c)
            if (basis%n_blocks == 3) self%y(:, 2, i, c) = s_of*basis%coupling(i, 3, c)
            if (basis%n_blocks < 3) self%y(:, 2, i, c) = 0.0_wp
         end do
      end do
      do i = 1, n
         self%y(:size(s), 1, i, m + 1) = real(internal_load(i, :), wp)
         self%y(:size(s), 2, i, m + 1) = aimag(internal_load(i, :))
      end do
      do c = 1, m + 1, 2
         if (allocated(self%lower)) call solve_lower(n, n, self%lower, self%y(1, 1, 1, c))
         call scale(n, self%inverse, self%y(1, 1, 1, c), self%u(1, 1, 1, c))
         call scale(n, self%inverse, self%y(1, 1, 1, c + 1), self%u(1, 1, 1, c + 1))
      end do
      do c = 1, m + 1, 2
         call place_columns(self, basis, theta_of, s_of, c, matrix, load)
      end do
   end subroutine form

   !> L and d^-1, which is zero of a free mode at rest.
   pure subroutine factor(self, basis, theta, s, n_harmonics, n_failed)
      type(condensed_group), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: theta(lanes), s(lanes)
      integer, intent(in) :: n_harmonics
      integer, intent(inout) :: n_failed
      real(wp), dimension(lanes) :: pivot_re, pivot_im, square, ignored_re, ignored_im, re, im
      logical :: failed(lanes)
      integer :: i, j

      failed = .false.
      do i = 1, basis%n_internal
         pivot_re = basis%k_i(i) - theta*basis%m_i(i)
         pivot_im = s*basis%c_i(i)
         if (allocated(basis%c_ii)) then
            do j = 1, i - 1
               self%column(:, 1, j, 1) = 0.0_wp
               self%column(:, 2, j, 1) = s*basis%c_ii(j, i)
            end do
            call solve_lower(i - 1, basis%n_internal, self%lower, self%column)
            call scale(i - 1, self%inverse, self%column, self%lower(1, 1, 1, i))
            call sum_products(i - 1, self%lower(1, 1, 1, i), self%column(1, 1, 1, 1), &
                              self%column(1, 1, 1, 2), re, im, ignored_re, ignored_im)
            pivot_re = pivot_re - re
            pivot_im = pivot_im - im
         end if
         square = pivot_re**2 + pivot_im**2
         failed = failed .or. (.not. square > 0.0_wp .and. s > 0.0_wp)
         where (.not. square > 0.0_wp) square = 1.0_wp
         self%inverse(:, 1, i) = pivot_re/square
         self%inverse(:, 2, i) = -pivot_im/square
      end do
      n_failed = n_failed + count(failed(:n_harmonics))
   end subroutine factor

   !> Two columns, L^-1 of them in place.
   pure subroutine solve_lower(n, n_stored, lower, columns)
      integer, intent(in) :: n, n_stored
      real(wp), intent(in) :: lower(lanes, 2, n_stored, *)
      real(wp), intent(inout) :: columns(lanes, 2, n_stored, 2)
      real(wp), dimension(lanes) :: re_1, im_1, re_2, im_2
      integer :: i

      do i = 2, n
         call sum_products(i - 1, lower(1, 1, 1, i), columns(1, 1, 1, 1), columns(1, 1, 1, 2), &
                           re_1, im_1, re_2, im_2)
         columns(:, 1, i, 1) = columns(:, 1, i, 1) - re_1
         columns(:, 2, i, 1) = columns(:, 2, i, 1) - im_1
         columns(:, 1, i, 2) = columns(:, 1, i, 2) - re_2
         columns(:, 2, i, 2) = columns(:, 2, i, 2) - im_2
      end do
   end subroutine solve_lower

   !> u = factor y, mode by mode.
   pure subroutine scale(n, factor, y, u)
      integer, intent(in) :: n
      real(wp), intent(in) :: factor(lanes, 2, n), y(lanes, 2, n)
      real(wp), intent(inout) :: u(lanes, 2, n)
      integer :: i

      do i = 1, n
         u(:, 1, i) = factor(:, 1, i)*y(:, 1, i) - factor(:, 2, i)*y(:, 2, i)
         u(:, 2, i) = factor(:, 1, i)*y(:, 2, i) + factor(:, 2, i)*y(:, 1, i)
      end do
   end subroutine scale

   !> Two columns of Z_r down to the diagonal, with what is symmetric to them, or of the load.
   subroutine place_columns(self, basis, theta, s, first, matrix, load)
      type(condensed_group), intent(in) :: self
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: theta(lanes), s(lanes)
      integer, intent(in) :: first
      complex(wp), intent(inout) :: matrix(:, :, :), load(:, :)
      real(wp) :: re(lanes, 2), im(lanes, 2)
      integer :: c, column, h, k, m

      m = basis%n_coordinates
      do k = 1, min(first + 1, m)
         call sum_products(basis%n_internal, self%y(1, 1, 1, k), self%u(1, 1, 1, first), &
                           self%u(1, 1, 1, first + 1), re(:, 1), im(:, 1), re(:, 2), im(:, 2))
         do c = 1, 2
            column = first + c - 1
            if (column <= m) then
               re(:, c) = basis%blocks(k, column, 1) - theta*basis%blocks(k, column, 2) - re(:, c)
               im(:, c) = -im(:, c)
               if (basis%n_blocks == 3) im(:, c) = im(:, c) + s*basis%blocks(k, column, 3)
               do h = 1, size(matrix, 3)
                  matrix(k, column, h) = cmplx(re(h, c), im(h, c), wp)
                  matrix(column, k, h) = matrix(k, column, h)
               end do
            else if (column == m + 1) then
               do h = 1, size(load, 2)
                  load(k, h) = load(k, h) - cmplx(re(h, c), im(h, c), wp)
               end do
            end if
         end do
      end do
   end subroutine place_columns

   !> sum_i u_i y_i with two columns y: lane by lane, in registers.
   pure subroutine sum_products(n, u, y_1, y_2, re_1, im_1, re_2, im_2)
      integer, intent(in) :: n
      real(wp), intent(in) :: u(lanes, 2, n), y_1(lanes, 2, n), y_2(lanes, 2, n)
      real(wp), intent(out) :: re_1(lanes), im_1(lanes), re_2(lanes), im_2(lanes)
      real(wp), dimension(lanes) :: a, b, c, d
      integer :: i, l

      a = 0.0_wp
      b = 0.0_wp
      c = 0.0_wp
      d = 0.0_wp
      do i = 1, n
         !$omp simd
         do l = 1, lanes
            a(l) = a(l) + u(l, 1, i)*y_1(l, 1, i) - u(l, 2, i)*y_1(l, 2, i)
            b(l) = b(l) + u(l, 1, i)*y_1(l, 2, i) + u(l, 2, i)*y_1(l, 1, i)
            c(l) = c(l) + u(l, 1, i)*y_2(l, 1, i) - u(l, 2, i)*y_2(l, 2, i)
            d(l) = d(l) + u(l, 1, i)*y_2(l, 2, i) + u(l, 2, i)*y_2(l, 1, i)
         end do
      end do
      re_1 = a
      im_1 = b
      re_2 = c
      im_2 = d
   end subroutine sum_products

end module fw_condensed_group
