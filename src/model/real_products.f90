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
   use fw_complex_form, only: amplitudes_of
   use fw_complex_form, only: coefficients_of
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_panel_product, only: group_count
   use fw_panel_product, only: group_width
   use fw_panel_product, only: multiply_panels
   use fw_panel_product, only: panel_count
   use fw_panel_product, only: panel_height
   use fw_reduction, only: reduction_type
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: real_products, harmonic_factors, packed_blocks

   !> What belongs to the harmonics at a frequency: Z_n = k K - theta_n M + i s_n C.
   type :: harmonic_factors
      !> Retained harmonics and their columns (n_retained).
      integer, allocatable :: harmonic(:), column(:)
      real(wp) :: k = 1.0_wp
      !> (n omega)**2 + i n omega xi of each harmonic (n_retained).
      complex(wp), allocatable :: theta(:)
      !> n omega.
      real(wp), allocatable :: s(:)
   end type harmonic_factors

   !> K, M and C of rows and columns in use, packed.
   type :: packed_blocks
      !> Rows, and those among them, the first, that are columns too.
      integer :: n_used = 0
      integer :: n_active = 0
      !> [K_qq M_qq C_qq K_qi M_qi C_qi] and [K_iq M_iq C_iq] in panels.
      real(wp), allocatable, private :: rows(:), modes(:)
   contains
      procedure :: pack_blocks
   end type packed_blocks

   type :: real_products
      integer :: n_coefficients = 0
      !> D of each harmonic.
      type(internal_block), allocatable :: internal(:)
      !> Rows and columns in use, where these are not all.
      type(packed_blocks) :: active
      !> Scratch: multiples of a vector and, behind them, of the internal modes, in groups.
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
      procedure :: multiply_active
      procedure :: multiply_blocks
      procedure :: solve_internal
      procedure :: subtract_modes
   end type real_products

contains

   pure subroutine reserve(self, basis, n_harmonics, n_coefficients)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_harmonics, n_coefficients

      self%n_coefficients = n_coefficients
      associate (m => basis%n_coordinates, n_i => basis%n_internal, nb => basis%n_blocks, &
                 nc => n_coefficients)
         allocate (self%internal(n_harmonics))
         ! Columns are rounded up to whole groups, which are filled with zeros.
         allocate (self%multiples((m + n_i)*nb*group_count(nc)*group_width), source=0.0_wp)
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

      n_failed = 0
      do h = 1, size(self%internal)
         call self%internal(h)%factor(basis, factors%theta(h), factors%s(h), failed)
         if (failed) n_failed = n_failed + 1
      end do
   end subroutine factor

   !> Copy rows and columns in use.
   subroutine pack_blocks(self, basis, n_active, n_used, used)
      class(packed_blocks), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_active, n_used
      !> First n_used entries; the first n_active of them are columns.
      integer, intent(in) :: used(:)
      integer :: n_inner, n_stored

      self%n_used = n_used
      self%n_active = n_active
      n_inner = (n_active + basis%n_internal)*basis%n_blocks
      n_stored = panel_height*n_inner*panel_count(n_used)
      call make_room(self%rows, n_stored)
      call make_room(self%modes, panel_height*n_active*basis%n_blocks* &
                     panel_count(basis%n_internal))
      call fill_rows(basis, n_active, n_used, used, n_inner, self%rows)
      call fill_modes(basis, n_active, used, self%modes)
   end subroutine pack_blocks

   !> Room that grows by need, with a tenth to spare, and stays.
   pure subroutine make_room(array, n)
      real(wp), allocatable, intent(inout) :: array(:)
      integer, intent(in) :: n

      if (allocated(array)) then
         if (size(array) >= n) return
         deallocate (array)
         allocate (array(n + n/10))
      else
         allocate (array(n))
      end if
   end subroutine make_room

   !> [K_qq M_qq C_qq K_qi M_qi C_qi] of the rows in use: one product takes them all.
   pure subroutine fill_rows(basis, n_active, n_used, used, n_inner, panels)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_active, n_used, n_inner
      !> Coordinates in use; the first n_active of them are columns.
      integer, intent(in) :: used(:)
      real(wp), intent(inout) :: panels(panel_height, n_inner, *)
      integer :: b, i, j, k, p

      ! Row i stands in panel (i - 1)/panel_height + 1. The last panel may have rows to spare,
      ! which stay zero.
      panels(:, :, panel_count(n_used)) = 0.0_wp
      do b = 1, basis%n_blocks
         do j = 1, n_active
            do i = 1, n_used
               p = (i - 1)/panel_height
               panels(i - p*panel_height, (b - 1)*n_active + j, p + 1) = &
                  basis%blocks(used(i), used(j), b)
            end do
         end do
      end do
      ! Behind K, M and C of the coordinates those of the internal modes, in the same order.
      k = n_active*basis%n_blocks
      do i = 1, n_used
         p = (i - 1)/panel_height
         do b = 1, basis%n_blocks
            do j = 1, basis%n_internal
               panels(i - p*panel_height, k + (b - 1)*basis%n_internal + j, p + 1) = &
                  basis%coupling(j, b, used(i))
            end do
         end do
      end do
   end subroutine fill_rows

   !> [K_iq M_iq C_iq] of the columns in use.
   pure subroutine fill_modes(basis, n_active, used, panels)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: n_active
      integer, intent(in) :: used(:)
      real(wp), intent(inout) :: panels(panel_height, n_active*basis%n_blocks, *)
      integer :: b, i, j, p

      if (basis%n_internal == 0) return
      panels(:, :, panel_count(basis%n_internal)) = 0.0_wp
      do j = 1, n_active
         do b = 1, basis%n_blocks
            do i = 1, basis%n_internal
               p = (i - 1)/panel_height
               panels(i - p*panel_height, (b - 1)*n_active + j, p + 1) = &
                  basis%coupling(i, b, used(j))
            end do
         end do
      end do
   end subroutine fill_modes

   !> product = Z_r v for packed rows and columns; product has n_stored rows.
   subroutine multiply(self, basis, factors, packed, v, n_stored, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      type(packed_blocks), intent(in) :: packed
      integer, intent(in) :: n_stored
      !> Coordinates of the packed columns (n_active, n_coefficients).
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)

      call multiply_packed(self, basis, factors, packed%n_used, packed%n_active, packed%rows, &
                           packed%modes, v, n_stored, product)
   end subroutine multiply

   !> As `multiply` of the rows and columns in use.
   subroutine multiply_active(self, basis, factors, v, n_stored, product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_stored
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)

      call multiply_packed(self, basis, factors, self%active%n_used, self%active%n_active, &
                           self%active%rows, self%active%modes, v, n_stored, product)
   end subroutine multiply_active

   !> Both products of the module header, with the panels that serve: all, or those in use.
   subroutine multiply_packed(self, basis, factors, n_used, n_active, rows, modes, v, n_stored, &
                              product)
      class(real_products), intent(inout) :: self
      type(reduction_type), intent(in) :: basis
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n_used, n_active, n_stored
      !> Packed blocks, as packed_blocks has them.
      real(wp), intent(in) :: rows(*), modes(*)
      real(wp), intent(in) :: v(*)
      real(wp), intent(inout) :: product(n_stored, *)
      integer :: n_i, n_inner, n_short, nc
      logical :: threaded

      nc = self%n_coefficients
      n_i = basis%n_internal
      n_short = n_active*basis%n_blocks
      n_inner = n_short + n_i*basis%n_blocks
      threaded = n_used >= coordinates_for_threads
      if (n_i > 0) then
         ! b of the header in self%modes, then y = D^-1 b in its place.
         call group_multiples(factors, n_active, basis%n_blocks, 1.0_wp, v, 0, n_short, &
                              self%multiples)
         call multiply_panels(n_i, n_short, nc, modes, self%multiples, threaded, n_i, self%modes)
         call self%solve_internal(factors)
      end if
      ! Once more, since a group is longer by the modes now: multiples of v and, below, of -y, so
      ! that one product gives both terms.
      call group_multiples(factors, n_active, basis%n_blocks, 1.0_wp, v, 0, n_inner, &
                           self%multiples)
      call group_multiples(factors, n_i, basis%n_blocks, -1.0_wp, self%modes, n_short, n_inner, &
                           self%multiples)
      call multiply_panels(n_used, n_inner, nc, rows, self%multiples, threaded, n_stored, product)
   end subroutine multiply_packed

   !> sign times k v, -theta v and i s v behind `first` rows of the groups. In real form, of
   !> U = uc - i us: -theta U = -(Re uc + Im us) + i (Re us - Im uc) and i s U = s us + i s uc.
   pure subroutine group_multiples(factors, n, n_blocks, sign, v, first, n_inner, groups)
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n, n_blocks
      real(wp), intent(in) :: sign
      !> Coordinates, or internal modes (n, n_coefficients).
      real(wp), intent(in) :: v(n, *)
      integer, intent(in) :: first, n_inner
      real(wp), intent(inout) :: groups(group_width, n_inner, *)
      real(wp) :: re, im
      integer :: h, k

      do h = 1, size(factors%harmonic)
         k = factors%column(h)
         re = real(factors%theta(h), wp)
         im = aimag(factors%theta(h))
         if (factors%harmonic(h) == 0) then
            call fill_column(n, n_blocks, sign, v(1, k), v(1, k), factors%k, -re, 0.0_wp, 0.0_wp, &
                             first, n_inner, k, groups)
         else
            call fill_column(n, n_blocks, sign, v(1, k), v(1, k + 1), factors%k, -re, -im, &
                             factors%s(h), first, n_inner, k, groups)
            call fill_column(n, n_blocks, sign, v(1, k + 1), v(1, k), factors%k, -re, im, &
                             -factors%s(h), first, n_inner, k + 1, groups)
         end if
      end do
   end subroutine group_multiples

   !> One column of the groups: k a, re a + im b and s b.
   pure subroutine fill_column(n, n_blocks, sign, a, b, k, re, im, s, first, n_inner, column, &
                               groups)
      integer, intent(in) :: n, n_blocks
      real(wp), intent(in) :: sign
      real(wp), intent(in) :: a(n), b(n), k, re, im, s
      integer, intent(in) :: first, n_inner, column
      real(wp), intent(inout) :: groups(group_width, n_inner, *)
      integer :: g, i, p

      g = (column - 1)/group_width + 1
      p = column - (g - 1)*group_width
      do i = 1, n
         groups(p, first + i, g) = sign*(k*a(i))
         groups(p, first + n + i, g) = sign*(re*a(i) + im*b(i))
      end do
      if (n_blocks == 2) return
      do i = 1, n
         groups(p, first + 2*n + i, g) = sign*(s*b(i))
      end do
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
      n_inner = basis%n_coordinates*basis%n_blocks
      call fill_multiples(factors, basis%n_coordinates, basis%n_blocks, v, self%multiples)
      call dgemm('N', 'N', n_rows, self%n_coefficients, n_inner, 1.0_wp, basis%blocks, n_rows, &
                 self%multiples, n_inner, 0.0_wp, self%products, n_rows)
   end subroutine multiply_blocks

   !> k v, -theta v and i s v, one below the other. In real form, of U = uc - i us:
   !> -theta U = -(Re uc + Im us) + i (Re us - Im uc) and i s U = s us + i s uc.
   pure subroutine fill_multiples(factors, n, n_blocks, v, multiples)
      type(harmonic_factors), intent(in) :: factors
      integer, intent(in) :: n, n_blocks
      !> Coefficients (n, n_coefficients), and their multiples.
      real(wp), intent(in) :: v(n, *)
      real(wp), intent(inout) :: multiples(n, n_blocks, *)
      real(wp) :: re, im, s
      integer :: h, k

      do h = 1, size(factors%harmonic)
         k = factors%column(h)
         re = real(factors%theta(h), wp)
         im = aimag(factors%theta(h))
         s = factors%s(h)
         multiples(:, 1, k) = factors%k*v(:, k)
         if (factors%harmonic(h) == 0) then
            multiples(:, 2, k) = -re*v(:, k)
            if (n_blocks == 3) multiples(:, 3, k) = 0.0_wp
         else
            multiples(:, 1, k + 1) = factors%k*v(:, k + 1)
            multiples(:, 2, k) = -(re*v(:, k) + im*v(:, k + 1))
            multiples(:, 2, k + 1) = -(re*v(:, k + 1) - im*v(:, k))
            if (n_blocks == 2) cycle
            multiples(:, 3, k) = s*v(:, k + 1)
            multiples(:, 3, k + 1) = -s*v(:, k)
         end if
      end do
   end subroutine fill_multiples

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
      call fill_multiples(factors, basis%n_internal, basis%n_blocks, self%modes, &
                          self%mode_multiples)
      call dgemm('T', 'N', basis%n_coordinates, self%n_coefficients, n, -1.0_wp, basis%coupling, &
                 n, self%mode_multiples, n, 1.0_wp, product, basis%n_coordinates)
   end subroutine subtract_modes

end module fw_real_products
