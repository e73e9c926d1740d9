!> The condensed stiffness as complex matrices, one a harmonic: formed at a frequency, products by
!> zgemv. For few coordinates, whose matrices stay in the cache, and for many internal modes.
module fw_formed_stiffness
   use fw_column_panels, only: multiply_panels, pack_columns, panel_count, panel_height
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_condensed_group, only: condensed_group, lanes
   use fw_internal_block, only: internal_block
   use fw_kinds, only: sp, wp
   use fw_lapack, only: dgemm, zgemm, zgemv
   use fw_load_waves, only: load_waves
   use fw_reduction, only: reduction_type
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: formed_stiffness, form_block, harmonic_load, load_slope

   type :: formed_stiffness
      !> Z_r (n_coordinates, n_coordinates, n_retained) [force/length].
      complex(wp), allocatable :: matrix(:, :, :)
      !> Its rows and columns in use, where these are not all, one harmonic behind the other; and
      !> scratch.
      complex(wp), allocatable, private :: active(:)
      complex(wp), allocatable, private :: input(:, :), output(:, :)
      !> Where neither mass nor damping acts Z_r is one real matrix in all harmonics, and one
      !> product serves them. It, and its rows and columns in use.
      logical :: is_static = .false.
      real(wp), allocatable, private :: static(:, :), static_active(:)
      !> Rows and columns in use in single precision, for what only has to be near, one harmonic
      !> behind the other, and what each is to be multiplied by (n_retained).
      real(sp), allocatable, private :: near(:)
      real(wp), allocatable, private :: near_scale(:)
      !> Harmonics side by side.
      type(condensed_group), private :: group
   contains
      procedure :: reserve
      procedure :: form
      procedure :: multiply
      procedure :: gather
      procedure :: multiply_active
      procedure :: pack_near
      procedure :: multiply_near
   end type formed_stiffness

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> Rows up to which products do without a library.
   integer, parameter :: few = 4

contains

   !> Matrices of all harmonics and scratch for their products; copies of rows in use come later.
   subroutine reserve(self, m, n_harmonics, basis)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: m, n_harmonics
      !> Of those who `form`.
      type(reduction_type), intent(in), optional :: basis

      if (present(basis)) call self%group%reserve(basis, n_harmonics)
      allocate (self%matrix(m, m, n_harmonics), source=zero)
      allocate (self%input(m, n_harmonics), self%output(m, n_harmonics), source=zero)
   end subroutine reserve

   !> All harmonics at a frequency, and their loads.
   subroutine form(self, basis, harmonic, theta, s, load, n_failed)
      class(formed_stiffness), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      !> Harmonics, and theta = (n omega)**2 + .. and s = n omega of each (n_retained).
      integer, intent(in) :: harmonic(:)
      complex(wp), intent(in) :: theta(:)
      real(wp), intent(in) :: s(:)
      !> Condensed loads (n_coordinates, n_retained).
      complex(wp), intent(inout) :: load(:, :)
      !> Harmonics that hit a mode without damping.
      integer, intent(out) :: n_failed
      integer :: h

      n_failed = 0
      ! An imaginary part is a damping that excites.
      if (basis%n_internal == 0) then
         call form_uncondensed(self, basis, harmonic, theta, s, load)
      else if (self%group%serves .and. all(abs(aimag(theta)) <= 0.0_wp) .and. &
               basis%loss <= 0.0_wp) then
         call form_groups(self, basis, harmonic, real(theta, wp), s, load, n_failed)
      else if (basis%n_coordinates < coordinates_for_threads) then
         do h = 1, size(harmonic)
            call form_harmonic(basis, harmonic(h), theta(h), s(h), self%matrix(:, :, h), &
                               load(:, h), n_failed)
         end do
      else
         !$omp parallel do default(none) shared(self, basis, harmonic, theta, s, load) &
         !$omp private(h) reduction(+:n_failed) schedule(dynamic)
         do h = 1, size(harmonic)
            call form_harmonic(basis, harmonic(h), theta(h), s(h), self%matrix(:, :, h), &
                               load(:, h), n_failed)
         end do
         !$omp end parallel do
      end if
      call find_static(self)
   end subroutine form

   !> Where there are no internal modes: a sum of matrices.
   subroutine form_uncondensed(self, basis, harmonic, theta, s, load)
      class(formed_stiffness), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: harmonic(:)
      complex(wp), intent(in) :: theta(:)
      real(wp), intent(in) :: s(:)
      complex(wp), intent(inout) :: load(:, :)
      integer :: h

      ! A region of one thread takes as long as a few harmonics of a small structure.
      if (basis%n_coordinates < coordinates_for_threads) then
         do h = 1, size(harmonic)
            call add_matrices(basis, harmonic(h), theta(h), s(h), self%matrix(:, :, h), load(:, h))
         end do
         return
      end if
      !$omp parallel do default(none) private(h) &
      !$omp shared(self, basis, harmonic, theta, s, load)
      do h = 1, size(harmonic)
         call add_matrices(basis, harmonic(h), theta(h), s(h), self%matrix(:, :, h), load(:, h))
      end do
      !$omp end parallel do
   end subroutine form_uncondensed

   !> Of one harmonic, and its load.
   subroutine add_matrices(basis, n, theta, s, matrix, load)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp), intent(inout), contiguous :: matrix(:, :)
      complex(wp), intent(inout) :: load(:)
      integer :: j

      do j = 1, basis%n_coordinates
         call combine(basis%n_coordinates, basis%n_blocks, theta, s, basis%loss_at(s), &
                      basis%blocks(:, j, :), matrix(:, j))
      end do
      call find_load(basis%load_q, basis%waves, n, s, load)
   end subroutine add_matrices

   !> One group of harmonics after the other.
   subroutine form_groups(self, basis, harmonic, theta, s, load, n_failed)
      class(formed_stiffness), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: harmonic(:)
      real(wp), intent(in) :: theta(:), s(:)
      complex(wp), intent(inout) :: load(:, :)
      integer, intent(inout) :: n_failed
      complex(wp) :: internal_load(basis%n_internal, lanes)
      integer :: first, h, last

      do first = 1, size(harmonic), lanes
         last = min(first + lanes - 1, size(harmonic))
         do h = first, last
            load(:, h) = harmonic_load(basis%load_q, basis%waves, harmonic(h), s(h))
            internal_load(:, h - first + 1) = harmonic_load(basis%load_i, basis%waves, &
                                                            harmonic(h), s(h))
         end do
         call self%group%form(basis, theta(first:last), s(first:last), &
                              internal_load(:, :last - first + 1), self%matrix(:, :, first:last), &
                              load(:, first:last), n_failed)
      end do
   end subroutine form_groups

   !> Whether Z_r is one real matrix in all harmonics, to the last bit.
   subroutine find_static(self)
      class(formed_stiffness), intent(inout) :: self
      integer :: h, j

      self%is_static = .false.
      if (size(self%matrix, 1) <= few) return
      ! Of structures with mass the first columns differ, but for harmonic 0: it comes last.
      do j = 1, size(self%matrix, 2)
         do h = size(self%matrix, 3), 1, -1
            if (any(abs(aimag(self%matrix(:, j, h))) > 0.0_wp)) return
            if (any(abs(real(self%matrix(:, j, h), wp) - real(self%matrix(:, j, 1), wp)) > &
                    0.0_wp)) return
         end do
      end do
      self%is_static = .true.
      self%static = real(self%matrix(:, :, 1), wp)
   end subroutine find_static

   !> One harmonic, in a thread of its own: D, the load without internal modes, and Z_r.
   subroutine form_harmonic(basis, n, theta, s, matrix, load, n_failed)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      !> Z_r (n_coordinates, n_coordinates) and the condensed load (n_coordinates).
      complex(wp), intent(inout), contiguous :: matrix(:, :)
      complex(wp), intent(inout) :: load(:)
      integer, intent(inout) :: n_failed
      type(internal_block) :: internal
      logical :: failed
      integer :: j

      call internal%factor(basis, theta, s, failed)
      if (failed) n_failed = n_failed + 1
      load = harmonic_load(basis%load_q, basis%waves, n, s)
      call form_block(basis, theta, s, internal, basis%n_coordinates, &
                      [(j, j=1, basis%n_coordinates)], matrix, &
                      harmonic_load(basis%load_i, basis%waves, n, s), load)
   end subroutine form_harmonic

   !> Z_r of one harmonic, rows in use and the first of them as columns, Z_qq - Z_qi D^-1 Z_iq;
   !> where an internal load is given, load - Z_qi D^-1 F_i along with it.
   subroutine form_block(basis, theta, s, internal, n_active, used, matrix, internal_load, load)
      type(reduction_type), intent(in) :: basis
      complex(wp), intent(in) :: theta
      !> n omega.
      real(wp), intent(in) :: s
      !> D at this harmonic.
      type(internal_block), intent(in) :: internal
      integer, intent(in) :: n_active
      !> Coordinates in use.
      integer, intent(in) :: used(:)
      !> (size(used), n_active)
      complex(wp), intent(inout), contiguous :: matrix(:, :)
      !> Load of the internal modes (n_internal), and that of the rows in use (n_used).
      complex(wp), intent(in), optional :: internal_load(:)
      complex(wp), intent(inout), optional :: load(:)
      complex(wp), allocatable :: z_iq(:, :), solved(:, :), part(:)
      integer :: j, n_i, n_right, n_used
      logical :: in_order

      n_i = basis%n_internal
      n_used = size(used)
      n_right = n_active
      if (present(load)) n_right = n_active + 1
      ! A vector subscript copies what it selects: not where that is everything in its order.
      in_order = all([(used(j) == j, j=1, n_used)])
      do j = 1, n_active
         if (in_order) then
            call combine(n_used, basis%n_blocks, theta, s, basis%loss_at(s), &
                         basis%blocks(:n_used, j, :), matrix(:, j))
         else
            call combine(n_used, basis%n_blocks, theta, s, basis%loss_at(s), &
                         basis%blocks(used, used(j), :), matrix(:, j))
         end if
      end do
      if (n_i == 0) return
      allocate (z_iq(n_i, n_used), solved(n_i, n_right), part(n_used))
      do j = 1, n_used
         call combine(n_i, basis%n_blocks, theta, s, basis%loss_at(s), &
                      basis%coupling(:, :, used(j)), z_iq(:, j))
      end do
      ! The internal load is one more right-hand side of the same factors.
      solved(:, :n_active) = z_iq(:, :n_active)
      if (present(load)) solved(:, n_right) = internal_load
      call internal%solve(n_right, solved)
      call subtract_product(n_used, n_active, n_i, z_iq, solved, matrix)
      if (.not. present(load)) return
      call zgemm('T', 'N', n_used, 1, n_i, -one, z_iq, n_i, solved(1, n_right), n_i, zero, part, &
                 n_used)
      load = load + part
   end subroutine form_block

   !> (1 + i loss) K - theta M + i s C.
   pure subroutine combine(n, n_blocks, theta, s, loss, blocks, z)
      integer, intent(in) :: n, n_blocks
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s, loss
      !> K, M and, with damping, C in columns (n, n_blocks).
      real(wp), intent(in) :: blocks(:, :)
      complex(wp), intent(out) :: z(n)

      ! theta = (n omega)**2 + i n omega xi: the imaginary part is a damping -xi M, which excites.
      if (n_blocks == 3) then
         z = cmplx(blocks(:, 1) - real(theta, wp)*blocks(:, 2), &
                   s*blocks(:, 3) - aimag(theta)*blocks(:, 2), wp)
      else
         z = cmplx(blocks(:, 1) - real(theta, wp)*blocks(:, 2), -aimag(theta)*blocks(:, 2), wp)
      end if
      if (loss > 0.0_wp) z = z + cmplx(0.0_wp, loss*blocks(:, 1), wp)
   end subroutine combine

   !> z = z - z_iq^T solved, symmetric in its first rows: by blocks of columns down to the diagonal
   !> and below the last column, the rest by its symmetry.
   subroutine subtract_product(n_used, n_active, n_i, z_iq, solved, z)
      integer, intent(in) :: n_used, n_active, n_i
      !> Z_iq of the rows in use, and D^-1 of its first n_active columns.
      complex(wp), intent(in) :: z_iq(n_i, n_used), solved(n_i, *)
      complex(wp), intent(inout) :: z(n_used, n_active)
      !> Columns of a block: fewer leave the product no speed.
      integer, parameter :: width = 48
      integer :: first, last, j

      do first = 1, n_active, width
         last = min(first + width - 1, n_active)
         call zgemm('T', 'N', last, last - first + 1, n_i, -one, z_iq, n_i, &
                    solved(1, first), n_i, one, z(1, first), n_used)
      end do
      do first = 1, n_active - width, width
         last = first + width - 1
         do j = first, last
            z(last + 1:n_active, j) = z(j, last + 1:n_active)
         end do
      end do
      if (n_used == n_active) return
      call zgemm('T', 'N', n_used - n_active, n_active, n_i, -one, z_iq(1, n_active + 1), n_i, &
                 solved, n_i, one, z(n_active + 1, 1), n_used)
   end subroutine subtract_product

   !> Complex load of a harmonic from its parts in columns.
   pure function harmonic_load(parts, waves, n, s) result(load)
      !> Static, cosine and sine part, then those of the waves (n_rows, n_columns).
      real(wp), intent(in) :: parts(:, :)
      type(load_waves), intent(in) :: waves
      integer, intent(in) :: n
      !> n omega.
      real(wp), intent(in) :: s
      complex(wp) :: load(size(parts, 1))

      call find_load(parts, waves, n, s, load)
   end function harmonic_load

   !> The same without a copy.
   pure subroutine find_load(parts, waves, n, s, load)
      real(wp), intent(in) :: parts(:, :)
      type(load_waves), intent(in) :: waves
      integer, intent(in) :: n
      real(wp), intent(in) :: s
      complex(wp), intent(inout) :: load(:)
      integer :: w

      ! An amplitude is U = uc - i us.
      select case (n)
      case (0)
         load = cmplx(parts(:, 1), kind=wp)
      case (1)
         load = cmplx(parts(:, 2), -parts(:, 3), wp)
      case default
         load = zero
      end select
      do w = 1, waves%n_waves()
         if (waves%harmonic(w) /= n) cycle
         load = load + waves%factor(w, n, s)*cmplx(parts(:, 2*w + 2), -parts(:, 2*w + 3), wp)
      end do
   end subroutine find_load

   !> d F_n/dp of loads that grow with their frequency, at a rate ds/dp.
   pure function load_slope(parts, waves, n, s, rate) result(slope)
      real(wp), intent(in) :: parts(:, :)
      type(load_waves), intent(in) :: waves
      integer, intent(in) :: n
      real(wp), intent(in) :: s, rate
      complex(wp) :: slope(size(parts, 1))
      integer :: w

      slope = zero
      do w = 1, waves%n_waves()
         if (waves%harmonic(w) /= n) cycle
         slope = slope + waves%slope(w, n, s, rate)* &
                 cmplx(parts(:, 2*w + 2), -parts(:, 2*w + 3), wp)
      end do
   end function load_slope

   !> product = Z q.
   subroutine multiply(self, harmonic, column, m, q, product)
      class(formed_stiffness), intent(inout) :: self
      !> Retained harmonics and their columns (n_retained).
      integer, intent(in) :: harmonic(:), column(:)
      integer, intent(in) :: m
      !> Coordinates and product (m, n_coefficients).
      real(wp), intent(in) :: q(m, *)
      real(wp), intent(inout) :: product(m, *)
      integer :: n

      if (self%is_static) then
         n = coefficient_total(harmonic, column)
         call dgemm('N', 'N', m, n, m, 1.0_wp, self%static, m, q, m, 0.0_wp, product, m)
         return
      end if
      call amplitudes_of(harmonic, column, m, q, m, self%input)
      call multiply_harmonics(self, size(harmonic), m, m, self%matrix)
      call coefficients_of(harmonic, column, m, m, self%output, product)
   end subroutine multiply

   !> Coefficients of the harmonics: the last one has a sine but for harmonic 0.
   pure integer function coefficient_total(harmonic, column) result(n)
      integer, intent(in) :: harmonic(:), column(:)

      n = maxval(column + merge(1, 0, harmonic > 0))
   end function coefficient_total

   !> output = matrix input of every harmonic.
   subroutine multiply_harmonics(self, n_harmonics, n_rows, n_columns, matrix)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: n_harmonics, n_rows, n_columns
      complex(wp), intent(in) :: matrix(n_rows, n_columns, n_harmonics)
      integer :: h

      if (size(self%matrix, 1) < coordinates_for_threads) then
         do h = 1, n_harmonics
            call multiply_one(n_rows, n_columns, matrix(1, 1, h), self%input(1, h), &
                              self%output(1, h))
         end do
         return
      end if
      !$omp parallel do default(none) private(h) &
      !$omp shared(self, n_harmonics, n_rows, n_columns, matrix)
      do h = 1, n_harmonics
         call multiply_one(n_rows, n_columns, matrix(1, 1, h), self%input(1, h), self%output(1, h))
      end do
      !$omp end parallel do
   end subroutine multiply_harmonics

   !> output = matrix input; of a handful of rows without the way into a library.
   subroutine multiply_one(n_rows, n_columns, matrix, input, output)
      integer, intent(in) :: n_rows, n_columns
      complex(wp), intent(in) :: matrix(n_rows, n_columns), input(n_columns)
      complex(wp), intent(inout) :: output(n_rows)
      integer :: j

      if (n_rows > few) then
         call zgemv('N', n_rows, n_columns, one, matrix, n_rows, input, 1, zero, output, 1)
         return
      end if
      output = zero
      do j = 1, n_columns
         output = output + matrix(:, j)*input(j)
      end do
   end subroutine multiply_one

   !> Copy the rows and columns in use, so that products run over contiguous memory.
   subroutine gather(self, n_active, n_used, used)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      !> Coordinates in use, those of the columns first (n_used).
      integer, intent(in) :: used(:)
      integer :: h, j, m, n, place

      m = size(self%matrix, 1)
      if (n_active == m) return
      if (self%is_static) then
         self%static_active = reshape(self%static(used(:n_used), used(:n_active)), &
                                      [n_used*n_active])
         return
      end if
      n = n_used*n_active*size(self%matrix, 3)
      if (allocated(self%active)) then
         if (size(self%active) < n) deallocate (self%active)
      end if
      if (.not. allocated(self%active)) allocate (self%active(n))
      !$omp parallel do collapse(2) default(none) private(h, j, place) &
      !$omp shared(self, n_active, n_used, used) if(m >= coordinates_for_threads)
      do h = 1, size(self%matrix, 3)
         do j = 1, n_active
            ! One harmonic behind the other, each (n_used, n_active).
            place = ((h - 1)*n_active + j - 1)*n_used
            self%active(place + 1:place + n_used) = self%matrix(used(:n_used), used(j), h)
         end do
      end do
      !$omp end parallel do
   end subroutine gather

   !> product = Z(used, active) v, the first n_used rows of product.
   subroutine multiply_active(self, harmonic, column, n_active, n_used, v, m, product)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: harmonic(:), column(:)
      integer, intent(in) :: n_active, n_used, m
      !> Coordinates of the columns (n_active, n_coefficients).
      real(wp), intent(in) :: v(n_active, *)
      real(wp), intent(inout) :: product(m, *)

      if (n_active == m) then
         call self%multiply(harmonic, column, m, v, product)
         return
      end if
      if (self%is_static) then
         call dgemm('N', 'N', n_used, coefficient_total(harmonic, column), n_active, 1.0_wp, &
                    self%static_active, max(1, n_used), v, max(1, n_active), 0.0_wp, product, m)
         return
      end if
      call amplitudes_of(harmonic, column, n_active, v, m, self%input)
      call multiply_harmonics(self, size(harmonic), n_used, n_active, self%active)
      call coefficients_of(harmonic, column, n_used, m, self%output, product)
   end subroutine multiply_active

   !> Copy the rows and columns in use for `multiply_near`.
   subroutine pack_near(self, n_active, n_used, used)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: n_active, n_used
      !> As of `gather`.
      integer, intent(in) :: used(:)
      integer :: h, n, n_harmonics

      n = near_size(n_active, n_used)
      n_harmonics = size(self%matrix, 3)
      if (allocated(self%near)) then
         if (size(self%near) < n*n_harmonics) deallocate (self%near)
      end if
      if (.not. allocated(self%near)) allocate (self%near(n*n_harmonics))
      if (.not. allocated(self%near_scale)) allocate (self%near_scale(n_harmonics))
      !$omp parallel do default(none) private(h) shared(self, n, n_active, n_used, used) &
      !$omp shared(n_harmonics) if(size(self%matrix, 1) >= coordinates_for_threads)
      do h = 1, n_harmonics
         call pack_columns(self%matrix(:, :, h), n_active, used(:n_used), &
                           self%near((h - 1)*n + 1), self%near_scale(h))
      end do
      !$omp end parallel do
   end subroutine pack_near

   !> Numbers of a harmonic.
   pure integer function near_size(n_active, n_used)
      integer, intent(in) :: n_active, n_used

      near_size = panel_height*2*n_active*panel_count(n_used)
   end function near_size

   !> As `multiply_active`, in single precision.
   subroutine multiply_near(self, harmonic, column, n_active, n_used, v, m, product)
      class(formed_stiffness), intent(inout) :: self
      integer, intent(in) :: harmonic(:), column(:)
      integer, intent(in) :: n_active, n_used, m
      real(wp), intent(in) :: v(n_active, *)
      real(wp), intent(inout) :: product(m, *)
      integer :: h, n

      n = near_size(n_active, n_used)
      call amplitudes_of(harmonic, column, n_active, v, m, self%input)
      !$omp parallel do default(none) private(h) shared(self, n, n_active, n_used, harmonic) &
      !$omp if(size(self%matrix, 1) >= coordinates_for_threads)
      do h = 1, size(harmonic)
         call multiply_panels(n_used, n_active, self%near((h - 1)*n + 1), self%near_scale(h), &
                              self%input(:, h), self%output(:, h))
      end do
      !$omp end parallel do
      call coefficients_of(harmonic, column, n_used, m, self%output, product)
   end subroutine multiply_near

end module fw_formed_stiffness
