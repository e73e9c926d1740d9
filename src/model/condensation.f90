!> Condensation of a linear structure to its relative coordinates, per harmonic:
!>
!>   Z_r(n) q + lambda = F_r(n),   Z_n = K - (n omega)^2 M + i n omega C.
!>
!> u = T_q q + T_i xi: the relative coordinates q with their static constraint modes, and modes xi
!> of the structure with q held, so that the internal block is diagonal (but for damping that is
!> not proportional). Then, with s = n omega,
!>
!>   D_j = k_j - s^2 m_j + i s c_j,   Z_qi = K_qi - s^2 M_qi + i s C_qi,
!>   Z_r = Z_qq - Z_qi D^-1 Z_qi^T,   F_r = F_q - Z_qi D^-1 F_i,   xi = D^-1 (F_i - Z_qi^T q),
!>
!> which costs O(m^2 n_i) a harmonic without any factorisation. This is (B Z^-1 B^T)^-1 in exact
!> arithmetic, and needs neither a regular mass nor a stiffness that holds the structure without
!> its contact. At an undamped mode of the held structure Z_r has a pole; internal modes
!> that a harmonic of the given range of frequencies may hit so are kept as coordinates.
module fw_condensation
   use fw_kinds, only: wp
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_input
   use fw_lapack, only: zgemm
   use fw_linalg, only: complex_lu_type
   use fw_model, only: model_type
   use fw_reduction, only: reduction_type
   use fw_reduction, only: new_reduction
   use fw_relative, only: relative_type
   use fw_text, only: to_text
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: condensation_type, new_condensation

   type :: condensation_type
      type(reduction_type) :: basis
      !> Coordinates kept: the relative ones, then undamped internal modes.
      integer :: n_coordinates = 0
      !> Harmonics in use (n_retained).
      integer, allocatable :: harmonic(:)
      !> Frequency of the present matrices [rad/s].
      real(wp) :: omega = -1.0_wp
      !> Dynamic stiffness (n_coordinates, n_coordinates, n_retained) [force/length].
      complex(wp), allocatable :: stiffness(:, :, :)
      !> Load (n_coordinates, n_retained) [force].
      complex(wp), allocatable :: load(:, :)
   contains
      procedure :: update
      procedure :: recover
      procedure :: frequency_derivative
      procedure :: static_stiffness
   end type condensation_type

contains

   !> Prepare the condensation of a model to its relative coordinates.
   subroutine new_condensation(model, relative, harmonic, omega_range, self, error, keep_all)
      type(model_type), intent(in) :: model
      type(relative_type), intent(in) :: relative
      !> Harmonics in use.
      integer, intent(in) :: harmonic(:)
      !> Lowest and highest frequency that will be asked for [rad/s].
      real(wp), intent(in) :: omega_range(2)
      type(condensation_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Condense nothing: every internal mode becomes a coordinate.
      logical, intent(in), optional :: keep_all

      call new_reduction(model, relative, harmonic, omega_range, self%basis, error, keep_all)
      if (allocated(error)) return
      self%n_coordinates = self%basis%n_coordinates
      self%harmonic = harmonic
      allocate (self%stiffness(self%n_coordinates, self%n_coordinates, size(harmonic)))
      allocate (self%load(self%n_coordinates, size(harmonic)))
   end subroutine new_condensation

   !> Compute the matrices and loads at a frequency; nothing is done if they are there already.
   subroutine update(self, omega, error)
      class(condensation_type), intent(inout) :: self
      !> Angular frequency [rad/s].
      real(wp), intent(in) :: omega
      type(error_type), allocatable, intent(out) :: error
      integer :: h, n_failed

      if (omega >= self%omega .and. omega <= self%omega) return
      if (self%n_coordinates == 0) self%omega = omega
      if (self%n_coordinates == 0) return
      n_failed = 0
      !$omp parallel do default(none) shared(self, omega) private(h) reduction(+:n_failed) &
      !$omp schedule(dynamic) if(self%n_coordinates >= coordinates_for_threads)
      do h = 1, size(self%harmonic)
         call condense(self, h, omega, n_failed)
      end do
      !$omp end parallel do
      if (n_failed > 0) then
         call fatal_error(error, 'the structure resonates without damping at omega = '// &
                          to_text(omega)//' rad/s in a mode that no contact pair touches; '// &
                          'give it damping or shift the frequency', status_input)
         return
      end if
      self%omega = omega
   end subroutine update

   !> One harmonic: stiffness(:, :, h) and load(:, h).
   subroutine condense(self, h, omega, n_failed)
      type(condensation_type), intent(inout) :: self
      integer, intent(in) :: h
      real(wp), intent(in) :: omega
      integer, intent(inout) :: n_failed
      complex(wp), allocatable :: coupling(:, :), solved(:, :), load(:, :)
      logical :: failed
      integer :: m, n_i, j
      real(wp) :: s
      complex(wp), parameter :: one = (1.0_wp, 0.0_wp)

      s = real(self%harmonic(h), wp)*omega
      m = self%n_coordinates
      n_i = self%basis%n_internal
      associate (b => self%basis)
         self%stiffness(:, :, h) = cmplx(b%k_qq - s**2*b%m_qq, s*b%c_qq, wp)
         self%load(:, h) = harmonic_load(b%load_q, self%harmonic(h))
         if (n_i == 0) return
         allocate (coupling(n_i, m), solved(n_i, m + 1), load(m, 1))
         do j = 1, m
            coupling(:, j) = cmplx(b%k_iq(:, j) - s**2*b%m_iq(:, j), s*b%c_iq(:, j), wp)
            solved(:, j) = coupling(:, j)
         end do
         solved(:, m + 1) = harmonic_load(b%load_i, self%harmonic(h))
         call solve_internal(b, s, solved, failed)
         if (failed) n_failed = n_failed + 1
         call add_symmetric_product(m, n_i, coupling, solved, self%stiffness(:, :, h))
         call zgemm('T', 'N', m, 1, n_i, -one, coupling, n_i, solved(:, m + 1), n_i, &
                    (0.0_wp, 0.0_wp), load, m)
         self%load(:, h) = self%load(:, h) + load(:, 1)
      end associate
   end subroutine condense

   !> z = z - coupling^T solved, whose product is symmetric: by blocks of columns down to the
   !> diagonal, the rest by its symmetry.
   subroutine add_symmetric_product(m, n_i, coupling, solved, z)
      integer, intent(in) :: m, n_i
      complex(wp), intent(in) :: coupling(n_i, m), solved(n_i, *)
      complex(wp), intent(inout) :: z(m, m)
      complex(wp), parameter :: one = (1.0_wp, 0.0_wp)
      !> Columns of a block: fewer leave the product no speed.
      integer, parameter :: width = 48
      integer :: first, last, j

      do first = 1, m, width
         last = min(first + width - 1, m)
         call zgemm('T', 'N', last, last - first + 1, n_i, -one, coupling, n_i, &
                    solved(1, first), n_i, one, z(1, first), m)
      end do
      do first = 1, m - width, width
         last = first + width - 1
         do j = first, last
            z(last + 1:, j) = z(j, last + 1:)
         end do
      end do
   end subroutine add_symmetric_product

   !> Complex load of a harmonic from the static, cosine and sine parts in columns.
   pure function harmonic_load(parts, n) result(load)
      real(wp), intent(in) :: parts(:, :)
      integer, intent(in) :: n
      complex(wp) :: load(size(parts, 1))

      select case (n)
      case (0)
         load = cmplx(parts(:, 1), kind=wp)
      case (1)
         load = cmplx(parts(:, 2), -parts(:, 3), wp)
      case default
         load = (0.0_wp, 0.0_wp)
      end select
   end function harmonic_load

   !> Solve the internal block D(s) x = rhs in place (n_internal, n_right).
   subroutine solve_internal(basis, s, rhs, failed)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: s
      complex(wp), intent(inout), contiguous :: rhs(:, :)
      logical, intent(out) :: failed
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: diagonal(:), inverse(:)
      integer :: j

      failed = .false.
      diagonal = cmplx(basis%k_i - s**2*basis%m_i, kind=wp)
      if (allocated(basis%c_ii)) then
         call lu%reserve(basis%n_internal)
         lu%matrix = cmplx(0.0_wp, s*basis%c_ii, wp)
         do j = 1, basis%n_internal
            lu%matrix(j, j) = lu%matrix(j, j) + diagonal(j)
            if (abs(diagonal(j)) <= 0.0_wp .and. s <= 0.0_wp) lu%matrix(j, j) = 1.0_wp
         end do
         call lu%factor(failed)
         if (.not. failed) call lu%solve(size(rhs, 2), rhs)
      else
         diagonal = diagonal + cmplx(0.0_wp, s*basis%c_i, wp)
         failed = s > 0.0_wp .and. any(abs(diagonal) <= 0.0_wp)
         inverse = diagonal
         where (abs(diagonal) <= 0.0_wp) inverse = (1.0_wp, 0.0_wp)
         inverse = 1.0_wp/inverse
         do j = 1, size(rhs, 2)
            rhs(:, j) = inverse*rhs(:, j)
         end do
      end if
      ! A free internal mode carries no static load (checked on construction): leave it at rest.
      if (s <= 0.0_wp) then
         do j = 1, basis%n_internal
            if (abs(diagonal(j)) <= 0.0_wp) rhs(j, :) = (0.0_wp, 0.0_wp)
         end do
      end if
   end subroutine solve_internal

   !> Observed quantities from the coordinates, all harmonics at the present frequency.
   subroutine recover(self, q, observed)
      class(condensation_type), intent(in) :: self
      !> Complex coordinates (n_coordinates, n_retained).
      complex(wp), intent(in) :: q(:, :)
      !> Complex observed quantities (n_observed, n_retained).
      complex(wp), intent(out) :: observed(:, :)
      complex(wp), allocatable :: xi(:, :)
      real(wp), allocatable :: parts(:, :), elastic(:, :), inertial(:, :), damping(:, :)
      logical :: failed
      integer :: h, n
      real(wp) :: s

      n = size(self%harmonic)
      associate (b => self%basis)
         allocate (parts(self%n_coordinates, 2*n), xi(b%n_internal, 1))
         parts(:, :n) = real(q, wp)
         parts(:, n + 1:) = aimag(q)
         elastic = matmul(b%k_iq, parts)
         inertial = matmul(b%m_iq, parts)
         damping = matmul(b%c_iq, parts)
         do h = 1, n
            s = real(self%harmonic(h), wp)*self%omega
            observed(:, h) = matmul(b%observe_q, q(:, h))
            if (b%n_internal == 0) cycle
            xi(:, 1) = harmonic_load(b%load_i, self%harmonic(h)) - cmplx( &
                       elastic(:, h) - s**2*inertial(:, h) - s*damping(:, n + h), &
                       elastic(:, n + h) - s**2*inertial(:, n + h) + s*damping(:, h), wp)
            call solve_internal(b, s, xi, failed)
            observed(:, h) = observed(:, h) + matmul(b%observe_i, xi(:, 1))
         end do
      end associate
   end subroutine recover

   !> d(Z_r q - F_r)/d omega at fixed q (n_coordinates, n_retained). With Z' = dZ/d omega of the
   !> whole structure and xi recovered it is  Z'_qq q + Z'_qi xi - Z_qi D^-1 (Z'_iq q + D' xi).
   subroutine frequency_derivative(self, q, derivative)
      class(condensation_type), intent(in) :: self
      !> Complex coordinates (n_coordinates, n_retained).
      complex(wp), intent(in) :: q(:, :)
      complex(wp), intent(out) :: derivative(:, :)
      complex(wp), allocatable :: coupling(:, :), slope(:, :), xi(:, :)
      logical :: failed
      integer :: h
      real(wp) :: n, s

      allocate (xi(self%basis%n_internal, 1))
      do h = 1, size(self%harmonic)
         n = real(self%harmonic(h), wp)
         s = n*self%omega
         associate (b => self%basis)
            derivative(:, h) = n*matmul(cmplx(-2.0_wp*s*b%m_qq, b%c_qq, wp), q(:, h))
            if (b%n_internal == 0) cycle
            coupling = cmplx(b%k_iq - s**2*b%m_iq, s*b%c_iq, wp)
            slope = n*cmplx(-2.0_wp*s*b%m_iq, b%c_iq, wp)
            xi(:, 1) = harmonic_load(b%load_i, self%harmonic(h)) - matmul(coupling, q(:, h))
            call solve_internal(b, s, xi, failed)
            derivative(:, h) = derivative(:, h) + matmul(xi(:, 1), slope)
            xi(:, 1) = matmul(slope, q(:, h)) + n*internal_slope(b, s, xi(:, 1))
            call solve_internal(b, s, xi, failed)
            derivative(:, h) = derivative(:, h) - matmul(xi(:, 1), coupling)
         end associate
      end do
   end subroutine frequency_derivative

   !> dD/ds times a vector.
   pure function internal_slope(basis, s, vector) result(product)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: s
      complex(wp), intent(in) :: vector(:)
      complex(wp) :: product(size(vector))
      complex(wp), parameter :: i_unit = (0.0_wp, 1.0_wp)

      product = -2.0_wp*s*basis%m_i*vector
      if (allocated(basis%c_ii)) then
         product = product + i_unit*matmul(basis%c_ii, vector)
      else
         product = product + i_unit*basis%c_i*vector
      end if
   end function internal_slope

   !> Static stiffness of a coordinate, the scale of its penalty [force/length].
   pure real(wp) function static_stiffness(self, coordinate)
      class(condensation_type), intent(in) :: self
      integer, intent(in) :: coordinate
      integer :: i

      i = coordinate
      associate (b => self%basis)
         static_stiffness = b%k_qq(i, i)
         if (b%n_internal > 0) then
            static_stiffness = static_stiffness - sum(b%k_iq(:, i)**2/b%k_i, mask=abs(b%k_i) > 0)
         end if
      end associate
   end function static_stiffness

end module fw_condensation
