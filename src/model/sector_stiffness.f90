!> The condensed stiffness of a sector in one harmonic, from the basis of its nodal diameter, or the
!> conjugates of it where that diameter is above N/2 (K_(N-k) = conj(K_k)):
!>
!>   D = k_i - theta m_i + i s c_i,   Z_r = Z_qq - Z_qi D^-1 Z_iq,   F_r = F_q - Z_qi D^-1 F_i.
!>
!> Z_qi is not the transpose of Z_iq: the blocks of K, M and C are Hermitian, their sum is not.
module fw_sector_stiffness
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_lapack, only: zgemm
   use fw_sector_reduction, only: sector_reduction
   use fw_structure_operator, only: by_frequency
   implicit none (type, external)
   private

   public :: harmonic_point, slopes_of, form_sector, derive_sector, recover_sector
   public :: observed_by_sector, observed_sector_slope, work_of_sector, answer_of_modes
   public :: add_whirl, combine_rows, factor_internal, load_of, turned

   !> Where a harmonic stands: factors of K, M and C in Z = k K - theta M + i s C.
   type :: harmonic_point
      integer :: harmonic = 0
      !> Whether the conjugates of the basis act.
      logical :: conjugated = .false.
      complex(wp) :: theta = (0.0_wp, 0.0_wp)
      real(wp) :: s = 0.0_wp
      !> 1, or 0 in a derivative.
      real(wp) :: k = 1.0_wp
      !> Whether the load is a wave of this nodal diameter.
      logical :: is_loaded = .true.
   end type harmonic_point

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp)

contains

   !> d/dp of the factors of K, M and C.
   pure type(harmonic_point) function slopes_of(point, self_excitation, parameter) result(slopes)
      type(harmonic_point), intent(in) :: point
      real(wp), intent(in) :: self_excitation
      integer, intent(in) :: parameter

      slopes = point
      slopes%k = 0.0_wp
      if (parameter == by_frequency) then
         slopes%theta = point%harmonic*cmplx(2.0_wp*point%s, self_excitation, wp)
         slopes%s = real(point%harmonic, wp)
      else
         slopes%theta = cmplx(0.0_wp, point%s, wp)
         slopes%s = 0.0_wp
      end if
   end function slopes_of

   !> Z_r and F_r; fails where a mode resonates without damping.
   subroutine form_sector(basis, point, matrix, load, failed)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> (n_coordinates, n_coordinates) and (n_coordinates).
      complex(wp), intent(inout), contiguous :: matrix(:, :)
      complex(wp), intent(inout) :: load(:)
      logical, intent(out) :: failed
      type(internal_block) :: internal
      complex(wp), allocatable :: z_iq(:, :), z_qi(:, :), solved(:, :)
      integer :: m, n

      m = basis%n_coordinates
      n = basis%n_internal
      call factor_internal(basis, point, internal, failed)
      call combine_rows(basis, point, 1, m, .false., matrix)
      if (basis%has_whirl()) call add_whirl(basis, point, 0, 0, matrix)
      load = load_of(basis, basis%load_q, point)
      if (n == 0) return
      allocate (z_iq(n, m), z_qi(n, m), solved(n, m + 1))
      call combine_rows(basis, point, m + 1, m + n, .false., z_iq)
      ! The transpose of Z_qi.
      call combine_rows(basis, point, m + 1, m + n, .true., z_qi)
      if (basis%has_whirl()) then
         call add_whirl(basis, point, m, 0, z_iq)
         call add_whirl(basis, point, m, 0, z_qi, adjoint=.true.)
      end if
      solved(:, :m) = z_iq
      solved(:, m + 1) = load_of(basis, basis%load_i, point)
      call internal%solve(m + 1, solved)
      call zgemm('T', 'N', m, m, n, -one, z_qi, n, solved, n, one, matrix, m)
      load = load - matmul(transpose(z_qi), solved(:, m + 1))
   end subroutine form_sector

   !> d(Z_r q - F_r)/dp, from the derivatives of the factors:
   !> Z'_qq q + Z'_qi x - Z_qi D^-1 (Z'_iq q + D' x).
   subroutine derive_sector(basis, point, slopes, load_factor, q, derivative)
      type(sector_reduction), intent(in) :: basis
      !> `slopes` holds the derivatives of the factors.
      type(harmonic_point), intent(in) :: point, slopes
      !> Of the loads of the basis.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: derivative(:)
      type(internal_block) :: internal
      complex(wp), allocatable :: block(:, :), x(:, :)
      integer :: m, n
      logical :: failed

      m = basis%n_coordinates
      n = basis%n_internal
      allocate (block(m, m))
      call combine_rows(basis, slopes, 1, m, .false., block)
      call add_whirl(basis, slopes, 0, 0, block)
      derivative = matmul(block, q)
      if (basis%waves%acts()) derivative = derivative - load_factor* &
                                           slope_of(basis, basis%load_q, point, slopes)
      if (n == 0) return
      call factor_internal(basis, point, internal, failed)
      allocate (x(n, 1))
      deallocate (block)
      allocate (block(n, m))
      x(:, 1) = modes_of(basis, point, internal, load_factor, q)
      call combine_rows(basis, slopes, m + 1, m + n, .true., block)
      call add_whirl(basis, slopes, m, 0, block, adjoint=.true.)
      derivative = derivative + matmul(x(:, 1), block)
      call combine_rows(basis, slopes, m + 1, m + n, .false., block)
      call add_whirl(basis, slopes, m, 0, block)
      x(:, 1) = matmul(block, q) + internal_slope(basis, slopes, x(:, 1))
      if (basis%waves%acts()) x(:, 1) = x(:, 1) - load_factor* &
                                        slope_of(basis, basis%load_i, point, slopes)
      call internal%solve(1, x)
      call combine_rows(basis, point, m + 1, m + n, .true., block)
      call add_whirl(basis, point, m, 0, block, adjoint=.true.)
      derivative = derivative - matmul(x(:, 1), block)
   end subroutine derive_sector

   !> Observed quantities of sector 0.
   subroutine recover_sector(basis, point, load_factor, q, observed)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> Of the loads of the basis.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: observed(:)
      type(internal_block) :: internal
      logical :: failed

      observed = matmul(turned(basis%observe_q, point), q)
      if (basis%n_internal == 0) return
      call factor_internal(basis, point, internal, failed)
      observed = observed + matmul(turned(basis%observe_i, point), &
                                   modes_of(basis, point, internal, load_factor, q))
   end subroutine recover_sector

   !> Observed quantities of sector 0 by the coordinates.
   subroutine observed_by_sector(basis, point, matrix)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> (n_observed, n_coordinates)
      complex(wp), intent(out) :: matrix(:, :)
      type(internal_block) :: internal
      complex(wp), allocatable :: z_iq(:, :)
      logical :: failed

      matrix = turned(basis%observe_q, point)
      associate (m => basis%n_coordinates, n => basis%n_internal)
         if (n == 0) return
         allocate (z_iq(n, m))
         call factor_internal(basis, point, internal, failed)
         call combine_rows(basis, point, m + 1, m + n, .false., z_iq)
         call add_whirl(basis, point, m, 0, z_iq)
         call internal%solve(m, z_iq)
         matrix = matrix - matmul(turned(basis%observe_i, point), z_iq)
      end associate
   end subroutine observed_by_sector

   !> Observed quantities of a sector that is condensed whole, by a force along each of the last of
   !> them, then by the load.
   subroutine answer_of_modes(basis, point, n_forced, answer, failed)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      integer, intent(in) :: n_forced
      !> (n_observed, n_forced + 1)
      complex(wp), intent(out) :: answer(:, :)
      logical, intent(out) :: failed
      type(internal_block) :: internal
      complex(wp), allocatable :: observe(:, :), x(:, :)

      call factor_internal(basis, point, internal, failed)
      if (failed) return
      observe = turned(basis%observe_i, point)
      allocate (x(basis%n_internal, n_forced + 1))
      x(:, :n_forced) = conjg(transpose(observe(size(observe, 1) - n_forced + 1:, :)))
      x(:, n_forced + 1) = load_of(basis, basis%load_i, point)
      call internal%solve(n_forced + 1, x)
      answer = matmul(observe, x)
   end subroutine answer_of_modes

   !> Observed quantities by the frequency at held coordinates: the internal modes follow.
   subroutine observed_sector_slope(basis, point, slopes, load_factor, q, slope)
      type(sector_reduction), intent(in) :: basis
      !> `slopes` holds the derivatives of the factors.
      type(harmonic_point), intent(in) :: point, slopes
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: slope(:)
      complex(wp) :: x(basis%n_internal), x_slope(basis%n_internal)

      slope = (0.0_wp, 0.0_wp)
      if (basis%n_internal == 0) return
      call follow_frequency(basis, point, slopes, load_factor, q, x, x_slope)
      slope = matmul(turned(basis%observe_i, point), x_slope)
   end subroutine observed_sector_slope

   !> x = D^-1 (F_i - Z_iq q) and x' = D^-1 (F_i' - Z_iq' q - D' x).
   subroutine follow_frequency(basis, point, slopes, load_factor, q, x, x_slope)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point, slopes
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: x(:), x_slope(:)
      type(internal_block) :: internal
      complex(wp) :: block(basis%n_internal, basis%n_coordinates), column(basis%n_internal, 1)
      logical :: failed

      call factor_internal(basis, point, internal, failed)
      x = modes_of(basis, point, internal, load_factor, q)
      associate (m => basis%n_coordinates, n => basis%n_internal)
         call combine_rows(basis, slopes, m + 1, m + n, .false., block)
         call add_whirl(basis, slopes, m, 0, block)
      end associate
      column(:, 1) = load_factor*slope_of(basis, basis%load_i, point, slopes) - &
                     matmul(block, q) - internal_slope(basis, slopes, x)
      call internal%solve(1, column)
      x_slope = column(:, 1)
   end subroutine follow_frequency

   !> F^H u, its derivative by the frequency at held coordinates, and its row by them.
   subroutine work_of_sector(basis, point, slopes, load_factor, q, work, slope, row)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point, slopes
      !> What the loads of the model are multiplied by.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: work
      complex(wp), intent(out), optional :: slope, row(:)
      type(internal_block) :: internal
      complex(wp) :: x(basis%n_internal), x_slope(basis%n_internal), f_i(basis%n_internal)
      complex(wp) :: f_q(basis%n_coordinates)
      complex(wp), allocatable :: z_iq(:, :)
      logical :: failed

      f_q = load_factor*conjg(load_of(basis, basis%load_q, point))
      work = sum(f_q*q)
      if (present(slope)) slope = load_factor* &
         sum(conjg(slope_of(basis, basis%load_q, point, slopes))*q)
      if (present(row)) row = f_q
      if (basis%n_internal == 0) return
      call follow_frequency(basis, point, slopes, load_factor, q, x, x_slope)
      f_i = load_factor*conjg(load_of(basis, basis%load_i, point))
      work = work + sum(f_i*x)
      if (present(slope)) slope = slope + sum(f_i*x_slope) + load_factor* &
         sum(conjg(slope_of(basis, basis%load_i, point, slopes))*x)
      if (.not. present(row)) return
      associate (m => basis%n_coordinates, n => basis%n_internal)
         allocate (z_iq(n, m))
         call combine_rows(basis, point, m + 1, m + n, .false., z_iq)
         call add_whirl(basis, point, m, 0, z_iq)
         call factor_internal(basis, point, internal, failed)
         call internal%solve(m, z_iq)
      end associate
      row = row - matmul(f_i, z_iq)
   end subroutine work_of_sector

   !> x = D^-1 (F_i - Z_iq q).
   function modes_of(basis, point, internal, load_factor, q) result(x)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      type(internal_block), intent(in) :: internal
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp) :: x(basis%n_internal)
      complex(wp), allocatable :: z_iq(:, :), rhs(:, :)

      associate (m => basis%n_coordinates, n => basis%n_internal)
         allocate (z_iq(n, m), rhs(n, 1))
         call combine_rows(basis, point, m + 1, m + n, .false., z_iq)
         call add_whirl(basis, point, m, 0, z_iq)
         rhs(:, 1) = load_factor*load_of(basis, basis%load_i, point) - matmul(z_iq, q)
         call internal%solve(1, rhs)
         x = rhs(:, 1)
      end associate
   end function modes_of

   !> k K - theta M + i s C of some rows of the blocks, or of their conjugates.
   pure subroutine combine_rows(basis, point, first, last, adjoint, z)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      integer, intent(in) :: first, last
      logical, intent(in) :: adjoint
      complex(wp), intent(inout) :: z(:, :)
      real(wp) :: side
      integer :: j, n

      n = last - first + 1
      ! The conjugates of the blocks act, but not of the factors.
      side = merge(-1.0_wp, 1.0_wp, point%conjugated .neqv. adjoint)
      associate (b => basis%blocks)
         do j = 1, basis%n_coordinates
            call combine(n, point%k, side*point%k, point%theta, side, b(first, j, 1), &
                         b(first, j, 2), z(:, j))
            if (basis%n_blocks == 3) call add_damping(n, point%s, side, b(first, j, 3), z(:, j))
         end do
      end associate
   end subroutine combine_rows

   !> k K - theta M of a column, by parts: these loops are run through at every frequency.
   pure subroutine combine(n, k, k_side, theta, side, stiffness, mass, z)
      integer, intent(in) :: n
      !> k, and times the side.
      real(wp), intent(in) :: k, k_side
      complex(wp), intent(in) :: theta
      !> -1 for the conjugates of the blocks.
      real(wp), intent(in) :: side
      complex(wp), intent(in) :: stiffness(n), mass(n)
      complex(wp), intent(out) :: z(n)
      real(wp) :: re, im, re_side, im_side
      integer :: i

      re = real(theta, wp)
      im = aimag(theta)
      re_side = side*re
      im_side = side*im
      do i = 1, n
         z(i) = cmplx(k*real(stiffness(i), wp) - re*real(mass(i), wp) + im_side*aimag(mass(i)), &
                      k_side*aimag(stiffness(i)) - re_side*aimag(mass(i)) - im*real(mass(i), wp), &
                      wp)
      end do
   end subroutine combine

   !> z = z + i s C.
   pure subroutine add_damping(n, s, side, damping, z)
      integer, intent(in) :: n
      real(wp), intent(in) :: s, side
      complex(wp), intent(in) :: damping(n)
      complex(wp), intent(inout) :: z(n)
      real(wp) :: s_side
      integer :: i

      s_side = side*s
      do i = 1, n
         z(i) = cmplx(real(z(i), wp) - s_side*aimag(damping(i)), &
                      aimag(z(i)) + s*real(damping(i), wp), wp)
      end do
   end subroutine add_damping

   !> Add i s G, and in harmonics above 0 the stiffness of the air, of a part of the rows and
   !> columns of coordinates and internal modes; of a derivative (k = 0) the air has none.
   pure subroutine add_whirl(basis, point, rows, columns, z, adjoint)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> Rows and columns in front of the part.
      integer, intent(in) :: rows, columns
      complex(wp), intent(inout) :: z(:, :)
      !> Transposed: the part of the columns in question, as rows.
      logical, intent(in), optional :: adjoint
      complex(wp) :: added
      integer :: a, b, i, j
      logical :: is_turned

      if (.not. basis%has_whirl()) return
      is_turned = present(adjoint)
      do j = 1, size(z, 2)
         do i = 1, size(z, 1)
            a = merge(columns + j, rows + i, is_turned)
            b = merge(rows + i, columns + j, is_turned)
            added = (0.0_wp, 0.0_wp)
            if (allocated(basis%coriolis)) added = cmplx(0.0_wp, point%s, wp)* &
               merge(conjg(basis%coriolis(a, b)), basis%coriolis(a, b), point%conjugated)
            if (allocated(basis%aero) .and. point%harmonic > 0) added = added + &
               point%k*basis%aero(a, b, merge(2, 1, point%conjugated))
            z(i, j) = z(i, j) + added
         end do
      end do
   end subroutine add_whirl

   !> D, factored where damping or whirl couples the modes.
   subroutine factor_internal(basis, point, self, failed)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      type(internal_block), intent(out) :: self
      logical, intent(out) :: failed
      integer :: j

      failed = .false.
      self%coupled = allocated(basis%c_ii) .or. (basis%has_whirl() .and. basis%n_internal > 0)
      self%inverse = cmplx(basis%k_i - real(point%theta, wp)*basis%m_i, &
                           -aimag(point%theta)*basis%m_i, wp)
      if (self%coupled) then
         call self%lu%reserve(basis%n_internal)
         if (allocated(basis%c_ii)) then
            self%lu%matrix = cmplx(0.0_wp, point%s, wp)*turned(basis%c_ii, point)
         else
            self%lu%matrix = (0.0_wp, 0.0_wp)
            do j = 1, basis%n_internal
               self%lu%matrix(j, j) = cmplx(0.0_wp, point%s*basis%c_i(j), wp)
            end do
         end if
         call add_whirl(basis, point, basis%n_coordinates, basis%n_coordinates, self%lu%matrix)
         do j = 1, basis%n_internal
            self%lu%matrix(j, j) = self%lu%matrix(j, j) + self%inverse(j)
            if (abs(self%inverse(j)) <= 0.0_wp .and. point%s <= 0.0_wp) then
               self%lu%matrix(j, j) = one
            end if
         end do
         call self%lu%factor(failed)
      else
         self%inverse = self%inverse + cmplx(0.0_wp, point%s*basis%c_i, wp)
         failed = point%s > 0.0_wp .and. any(abs(self%inverse) <= 0.0_wp)
      end if
      ! A free internal mode carries no static load (checked on construction): it stays at rest.
      do j = 1, basis%n_internal
         if (abs(self%inverse(j)) > 0.0_wp) then
            self%inverse(j) = 1.0_wp/self%inverse(j)
         else if (point%s > 0.0_wp) then
            self%inverse(j) = one
         end if
      end do
   end subroutine factor_internal

   !> D' times a vector.
   pure function internal_slope(basis, slopes, vector) result(product)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: slopes
      complex(wp), intent(in) :: vector(:)
      complex(wp) :: product(size(vector))
      integer :: m

      product = -slopes%theta*basis%m_i*vector
      if (allocated(basis%c_ii)) then
         product = product + cmplx(0.0_wp, slopes%s, wp)*matmul(turned(basis%c_ii, slopes), vector)
      else
         product = product + cmplx(0.0_wp, slopes%s, wp)*basis%c_i*vector
      end if
      if (.not. allocated(basis%coriolis)) return
      m = basis%n_coordinates
      product = product + cmplx(0.0_wp, slopes%s, wp)* &
                matmul(turned(basis%coriolis(m + 1:, m + 1:), slopes), vector)
   end function internal_slope

   !> Complex load of a harmonic: G_c - i G_s, of a conjugated basis from the conjugates of both.
   pure function load_of(basis, parts, point) result(load)
      type(sector_reduction), intent(in) :: basis
      !> Of the coordinates or of the internal modes.
      complex(wp), intent(in) :: parts(:, :)
      type(harmonic_point), intent(in) :: point
      complex(wp) :: load(size(parts, 1))
      integer :: w

      load = (0.0_wp, 0.0_wp)
      if (.not. point%is_loaded) return
      select case (point%harmonic)
      case (0)
         load = cmplx(real(parts(:, 1), wp), kind=wp)
      case (1)
         load = joined(parts(:, 2:3), point)
      case default
         load = (0.0_wp, 0.0_wp)
      end select
      do w = 1, basis%waves%n_waves()
         if (basis%waves%harmonic(w) /= point%harmonic) cycle
         load = load + basis%waves%factor(w, point%harmonic, point%s)* &
                joined(parts(:, 2*w + 2:2*w + 3), point)
      end do
   end function load_of

   !> dF/dp of loads that grow with their frequency.
   pure function slope_of(basis, parts, point, slopes) result(slope)
      type(sector_reduction), intent(in) :: basis
      complex(wp), intent(in) :: parts(:, :)
      type(harmonic_point), intent(in) :: point, slopes
      complex(wp) :: slope(size(parts, 1))
      integer :: w

      slope = (0.0_wp, 0.0_wp)
      if (.not. point%is_loaded) return
      do w = 1, basis%waves%n_waves()
         slope = slope + basis%waves%slope(w, point%harmonic, point%s, slopes%s)* &
                 joined(parts(:, 2*w + 2:2*w + 3), point)
      end do
   end function slope_of

   !> Cosine and sine part of a wave as its complex amplitude.
   pure function joined(parts, point) result(load)
      complex(wp), intent(in) :: parts(:, :)
      type(harmonic_point), intent(in) :: point
      complex(wp) :: load(size(parts, 1))
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)

      if (point%conjugated) then
         load = conjg(parts(:, 1)) - i*conjg(parts(:, 2))
      else
         load = parts(:, 1) - i*parts(:, 2)
      end if
   end function joined

   !> A matrix of the basis as the harmonic takes it.
   pure function turned(matrix, point) result(as_taken)
      complex(wp), intent(in) :: matrix(:, :)
      type(harmonic_point), intent(in) :: point
      complex(wp), allocatable :: as_taken(:, :)

      as_taken = matrix
      if (point%conjugated) as_taken = conjg(matrix)
   end function turned

end module fw_sector_stiffness
