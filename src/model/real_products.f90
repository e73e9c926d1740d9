!> Products with the condensed stiffness without any complex matrix. K, M and C are real and the
!> same for all harmonics: with all coefficients side by side
!>
!>   [a]   [K_qq M_qq C_qq] [    q    ]
!>   [b] = [K_iq M_iq C_iq] [-theta q ],   Z_r q = a - [K_qi M_qi C_qi] [y; -theta y; i s y],
!>                          [  i s q  ]                                       y = D^-1 b,
!>
!> two real products for all harmonics, exact to round-off. The matrices come from memory once, and
!> not once for each harmonic as complex ones. K, M and C are symmetric: the rows of the second
!> product are the columns that the basis has, with those of the internal modes below, and nothing
!> is copied. Rows and columns in use are, when they are first asked for.
module fw_real_products
   use fw_column_product, only: multiply_columns
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_reduction, only: reduction_type
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: real_products, harmonic_factors

   !> What belongs to the harmonics at a frequency: Z_n = k K - theta_n M + i s_n C.
   type :: harmonic_factors
      !> Retained harmonics and their columns (n_retained).
      integer, allocatable :: harmonic(:), column(:)
      real(wp) :: k = 1.0_wp
      !> In harmonics above 0 (1 + i loss) K in place of K.
      real(wp) :: loss = 0.0_wp
      !> (n omega)**2 + i n omega xi of each harmonic (n_retained).
      complex(wp), allocatable :: theta(:)
      !> n omega.
      real(wp), allocatable :: s(:)
   end type harmonic_factors

   !> Products of all harmonics by real matrices that do not depend on the frequency.
   type :: real_products
      integer :: n_coefficients = 0
      !> Leading blocks of K, M, C up to the last that is not zero: without mass and damping, K.
      integer, private :: n_acting = 0
      !> D of each harmonic.
      type(internal_block), allocatable :: internal(:)
      !> Rows and columns in use, where these are not all: their numbers, and K, M and C as the
      !> basis has them (n_active + n_internal, n_used, n_blocks).
      integer, private :: n_active = 0, n_used = 0
      real(wp), allocatable, private :: active(:)
      !> Scratch: multiples of a vector and, below them, of the internal modes.
      real(wp), allocatable, private :: multiples(:)
      !> Products of the blocks, (n_coordinates + n_internal) rows; internal modes
      !> (n_internal, n_coefficients), their multiples and complex amplitudes.
      real(wp), allocatable :: products(:)
      real(wp), allocatable :: modes(:, :), mode_multiples(:)
      complex(wp), allocatable :: amplitudes(:, :)
   contains
      procedure :: reserve
      procedure :: factor
      procedure :: multiply
      procedure :: gather_active
      procedure :: multiply_active
      procedure :: multiply_blocks
      procedure :: multiply_internal
      procedure :: solve_internal
      procedure :: subtract_modes
   end type real_products

   !> Right-hand sides of a product of the internal modes that a thread takes at a time.
   integer, parameter :: few_columns = 4
   !> Complex entries of vectors from which threads share their harmonics: fewer are done sooner
   !> than threads are called.
   integer, parameter :: entries_for_threads = 4000

contains

   pure subroutine reserve(self, basis, n_harmonics, n_coefficients)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_harmonics, n_coefficients

      self%n_coefficients = n_coefficients
      associate (m => basis%n_coordinates, n_i => basis%n_internal, nb => basis%n_blocks, &
                 nc => n_coefficients)
         allocate (self%internal(n_harmonics))
         allocate (self%multiples((m + n_i)*nb*nc), source=0.0_wp)
         allocate (self%products((m + n_i)*nc), source=0.0_wp)
         allocate (self%modes(n_i, nc), self%mode_multiples(n_i*nb*nc), source=0.0_wp)
         allocate (self%amplitudes(n_i, n_harmonics), source=(0.0_wp, 0.0_wp))
      end associate
   end subroutine reserve

   !> D of all harmonics.
   subroutine factor(self, basis, factors, n_failed)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(out) :: n_failed
      logical :: failed
      integer :: h

      ! Here and not in `reserve`: a parameter may have moved what was zero.
      self%n_acting = last_block(basis)
      n_failed = 0
      do h = 1, size(self%internal)
         call self%internal(h)%factor(basis, factors%theta(h), factors%s(h), failed)
         if (failed) n_failed = n_failed + 1
      end do
   end subroutine factor

   !> Of a structure with mass the first column tells.
   pure integer function last_block(basis) result(b)
      type(reduction_type), intent(in) :: basis
      integer :: j

      do b = basis%n_blocks, 2, -1
         do j = 1, size(basis%blocks, 2)
            if (any(abs(basis%blocks(:, j, b)) > 0.0_wp)) return
         end do
      end do
      b = 1
   end function last_block

   !> Copy rows and columns in use, and the internal modes below the columns.
   pure subroutine gather_active(self, basis, n_active, n_used, used)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_active, n_used
      !> First n_used entries; the first n_active of them are columns.
      integer, intent(in) :: used(:)
      integer :: n

      self%n_active = n_active
      self%n_used = n_used
      n = (n_active + basis%n_internal)*n_used*self%n_acting
      ! Room that grows by need, with a tenth to spare, and stays.
      if (allocated(self%active)) then
         if (size(self%active) < n) deallocate (self%active)
      end if
      if (.not. allocated(self%active)) allocate (self%active(n + n/10))
      call fill_active(basis, self%n_acting, n_active, n_used, used, n_active + basis%n_internal, &
                       self%active)
   end subroutine gather_active

   pure subroutine fill_active(basis, n_blocks, n_active, n_used, used, n_inner, active)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_blocks, n_active, n_used, n_inner
      integer, intent(in) :: used(:)
      real(wp), intent(inout) :: active(n_inner, n_used, *)
      integer :: b, i

      do b = 1, n_blocks
         do i = 1, n_used
            active(:n_active, i, b) = basis%blocks(used(:n_active), used(i), b)
            active(n_active + 1:, i, b) = basis%blocks(basis%n_coordinates + 1:, used(i), b)
         end do
      end do
   end subroutine fill_active

   !> product = Z_r v of all coordinates; product has n_stored rows.
   subroutine multiply(self, basis, factors, v, n_stored, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_stored
      !> (n_coordinates, n_coefficients).
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)

      call multiply_by(self, basis, factors, basis%n_coordinates, basis%n_coordinates, &
                       basis%blocks, v, n_stored, product)
   end subroutine multiply

   !> As `multiply`, of the rows and columns in use.
   subroutine multiply_active(self, basis, factors, v, n_stored, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_stored
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)

      call multiply_by(self, basis, factors, self%n_active, self%n_used, self%active, v, n_stored, &
                       product)
   end subroutine multiply_active

   !> Both products of the module header, with the columns that serve: all, or those in use.
   subroutine multiply_by(self, basis, factors, n_active, n_used, columns, v, n_stored, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_active, n_used, n_stored
      real(wp), intent(in) :: columns(n_active + basis%n_internal, n_used, self%n_acting)
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)
      integer :: n_inner

      n_inner = n_active + basis%n_internal
      call place_multiples(factors, n_active, self%n_acting, 1.0_wp, v, 0, n_inner, &
                           self%multiples)
      if (basis%n_internal > 0) then
         call multiply_modes(self, basis, n_active, n_used, columns, self%multiples)
         call self%solve_internal(factors)
         ! Below the multiples of v those of -y: one product gives both terms.
         call place_multiples(factors, basis%n_internal, self%n_acting, -1.0_wp, self%modes, &
                              n_active, n_inner, self%multiples)
      end if
      call multiply_columns(n_used, n_inner, self%n_acting, self%n_coefficients, columns, &
                            self%multiples, n_used >= coordinates_for_threads, n_stored, product)
   end subroutine multiply_by

   !> b of the module header, in the place of the modes.
   subroutine multiply_modes(self, basis, n_active, n_used, columns, multiples)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_active, n_used
      real(wp), intent(in) :: columns(n_active + basis%n_internal, n_used, self%n_acting)
      real(wp), intent(in) :: multiples(n_active + basis%n_internal, self%n_acting, *)
      integer :: b, k, n, n_inner

      if (n_active == 0) then
         self%modes(:, :self%n_coefficients) = 0.0_wp
         return
      end if
      n_inner = n_active + basis%n_internal
      !$omp parallel do default(none) private(b, k, n) if(n_used >= coordinates_for_threads) &
      !$omp shared(self, basis, n_active, n_inner, columns, multiples)
      do k = 1, self%n_coefficients, few_columns
         n = min(few_columns, self%n_coefficients - k + 1)
         self%modes(:, k:k + n - 1) = 0.0_wp
         do b = 1, self%n_acting
            ! The rows of the modes stand below those of the columns.
            call dgemm('N', 'N', basis%n_internal, n, n_active, 1.0_wp, &
                       columns(n_active + 1, 1, b), n_inner, multiples(1, b, k), &
                       n_inner*self%n_acting, 1.0_wp, self%modes(1, k), basis%n_internal)
         end do
      end do
      !$omp end parallel do
   end subroutine multiply_modes

   !> b of the module header in the place of the modes, of all coordinates.
   subroutine multiply_internal(self, basis, factors, v)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      !> (n_coordinates, n_coefficients).
      real(wp), intent(in) :: v(*)

      associate (m => basis%n_coordinates)
         call place_multiples(factors, m, self%n_acting, 1.0_wp, v, 0, m + basis%n_internal, &
                              self%multiples)
         call multiply_modes(self, basis, m, m, basis%blocks, self%multiples)
      end associate
   end subroutine multiply_internal

   !> sign times k v, -theta v and i s v below `first` rows of each. In real form, of
   !> U = uc - i us: -theta U = -(Re uc + Im us) + i (Re us - Im uc) and i s U = s us + i s uc.
   !> Threads share the harmonics.
   subroutine place_multiples(factors, n, n_blocks, sign, v, first, n_inner, multiples)
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n, n_blocks
      real(wp), intent(in) :: sign
      !> Coordinates, or internal modes (n, n_coefficients).
      real(wp), intent(in) :: v(n, *)
      integer, intent(in) :: first, n_inner
      real(wp), intent(inout) :: multiples(n_inner, n_blocks, *)
      real(wp) :: re, im, loss
      integer :: h, k

      ! Without rows no column has a first entry.
      if (n == 0) return
      !$omp parallel do default(none) private(h, k, re, im, loss) &
      !$omp if(n*size(factors%harmonic) >= entries_for_threads) &
      !$omp shared(factors, n, n_blocks, sign, v, first, n_inner, multiples) schedule(static, 1)
      do h = 1, size(factors%harmonic)
         k = factors%column(h)
         re = real(factors%theta(h), wp)
         im = aimag(factors%theta(h))
         if (factors%harmonic(h) == 0) then
            call fill_column(n, n_blocks, sign, v(1, k), v(1, k), factors%k, 0.0_wp, -re, 0.0_wp, &
                             0.0_wp, first, n_inner, multiples(1, 1, k))
         else
            loss = factors%k*factors%loss
            call fill_column(n, n_blocks, sign, v(1, k), v(1, k + 1), factors%k, loss, -re, -im, &
                             factors%s(h), first, n_inner, multiples(1, 1, k))
            call fill_column(n, n_blocks, sign, v(1, k + 1), v(1, k), factors%k, -loss, -re, im, &
                             -factors%s(h), first, n_inner, multiples(1, 1, k + 1))
         end if
      end do
      !$omp end parallel do
   end subroutine place_multiples

   !> One column: k a + loss b, re a + im b and s b.
   pure subroutine fill_column(n, n_blocks, sign, a, b, k, loss, re, im, s, first, n_inner, column)
      integer, intent(in) :: n, n_blocks
      real(wp), intent(in) :: sign
      real(wp), intent(in) :: a(n), b(n), k, loss, re, im, s
      integer, intent(in) :: first, n_inner
      real(wp), intent(inout) :: column(n_inner, n_blocks)

      column(first + 1:first + n, 1) = sign*(k*a)
      if (abs(loss) > 0.0_wp) column(first + 1:first + n, 1) = sign*(k*a + loss*b)
      if (n_blocks >= 2) column(first + 1:first + n, 2) = sign*(re*a + im*b)
      if (n_blocks == 3) column(first + 1:first + n, 3) = sign*(s*b)
   end subroutine fill_column

   !> products = [K M C] [v; -theta v; i s v] of all coordinates: their rows, then those of the
   !> internal modes. For once: nothing is packed.
   subroutine multiply_blocks(self, basis, factors, v)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      !> All coordinates (n_coordinates, n_coefficients).
      real(wp), intent(in) :: v(*)
      integer :: n_rows, n_inner

      n_rows = basis%n_coordinates + basis%n_internal
      n_inner = basis%n_coordinates*self%n_acting
      call place_multiples(factors, basis%n_coordinates, self%n_acting, 1.0_wp, v, 0, &
                           basis%n_coordinates, self%multiples)
      call dgemm('N', 'N', n_rows, self%n_coefficients, n_inner, 1.0_wp, basis%blocks, n_rows, &
                 self%multiples, n_inner, 0.0_wp, self%products, n_rows)
   end subroutine multiply_blocks

   !> modes = D^-1 modes.
   subroutine solve_internal(self, factors)
      class(real_products), intent(inout) :: self
      type(harmonic_factors), intent(in) :: factors
      integer :: h, n_i

      n_i = size(self%modes, 1)
      call amplitudes_of(factors%harmonic, factors%column, n_i, self%modes, n_i, self%amplitudes)
      do h = 1, size(self%internal)
         call self%internal(h)%solve(1, self%amplitudes(:, h:h))
      end do
      call coefficients_of(factors%harmonic, factors%column, n_i, n_i, self%amplitudes, self%modes)
   end subroutine solve_internal

   !> product = product - Z_qi modes of all coordinates.
   subroutine subtract_modes(self, basis, factors, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      !> Grows by - Z_qi y (n_coordinates, n_coefficients).
      real(wp), intent(inout) :: product(*)
      integer :: n

      n = basis%n_internal*basis%n_blocks
      call place_multiples(factors, basis%n_internal, basis%n_blocks, 1.0_wp, self%modes, 0, &
                           basis%n_internal, self%mode_multiples)
      call dgemm('T', 'N', basis%n_coordinates, self%n_coefficients, n, -1.0_wp, basis%coupling, &
                 n, self%mode_multiples, n, 1.0_wp, product, basis%n_coordinates)
   end subroutine subtract_modes

end module fw_real_products
