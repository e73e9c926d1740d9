!> Transforms of one row between the coefficients of waves and n_time uniform instants, by the
!> symmetries of cosine and sine,
!>
!>   cos n (2 pi - tau) = cos n tau,         sin n (2 pi - tau) = - sin n tau,
!>   cos n (pi - tau) = (-1)**n cos n tau,   sin n (pi - tau) = -(-1)**n sin n tau:
!>
!> half of the instants serve for all, and a quarter where n_time is even. Even and odd functions of
!> tau are told apart then, and waves of even and odd numbers. Of one row that is faster than a
!> product with all waves, and needs a quarter of their memory.
module fw_folded_waves
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: folded_waves

   type :: folded_waves
      !> Instants of a period, and the last one (from 0) that represents others.
      integer, private :: n_time = 0, last = 0
      !> Numbers of the waves, and the columns where their coefficients begin (n_waves).
      integer, allocatable, private :: number(:), column(:)
      !> Cosine and sine of each at the instants 0..last.
      real(wp), allocatable, private :: cosine(:, :), sine(:, :)
   contains
      procedure :: build
      procedure :: synthesise
      procedure :: analyse
   end type folded_waves

   !> Columns of folded rows: cosines of waves of even numbers and of odd ones, then their sines.
   !> Those of odd numbers stand with the even ones where n_time is odd.
   integer, parameter :: n_kinds = 4
   !> Instants that are folded at a time: room of a fixed size needs no allocation.
   integer, parameter :: block = 64

contains

   !> The waves of some numbers.
   pure subroutine build(self, number, column, n_time)
      class(folded_waves), intent(inout) :: self
      integer, intent(in) :: number(:), column(:), n_time
      real(wp) :: angle, cosine(0:n_time - 1), sine(0:n_time - 1)
      integer :: j, k, place

      self%n_time = n_time
      self%last = (n_time - 1)/2
      if (modulo(n_time, 2) == 0) self%last = n_time/4
      self%number = number
      self%column = column
      allocate (self%cosine(0:self%last, size(number)), self%sine(0:self%last, size(number)))
      do k = 0, n_time - 1
         angle = 2.0_wp*pi*real(k, wp)/real(n_time, wp)
         cosine(k) = cos(angle)
         sine(k) = sin(angle)
      end do
      do j = 1, size(number)
         do k = 0, self%last
            ! Reduced in integers: high waves keep full precision.
            place = modulo(number(j)*k, n_time)
            self%cosine(k, j) = cosine(place)
            self%sine(k, j) = sine(place)
         end do
      end do
   end subroutine build

   !> The kind of the cosine of a wave; its sine is two further.
   pure integer function kind_of(self, j)
      type(folded_waves), intent(in) :: self
      integer, intent(in) :: j

      kind_of = 1
      if (modulo(self%n_time, 2) == 0) kind_of = 1 + modulo(self%number(j), 2)
   end function kind_of

   !> Values at the instants from coefficients, each array with a stride of its own.
   pure subroutine synthesise(self, stride, coefficients, stride_out, values)
      class(folded_waves), intent(in) :: self
      integer, intent(in) :: stride, stride_out
      real(wp), intent(in) :: coefficients(stride, *)
      real(wp), intent(inout) :: values(stride_out, *)
      real(wp) :: folded(block, n_kinds)
      integer :: first, i, j, n

      do first = 0, self%last, block
         n = min(block, self%last - first + 1)
         folded(:n, :) = 0.0_wp
         do j = 1, size(self%number)
            i = kind_of(self, j)
            call add_wave(n, coefficients(1, self%column(j)), self%cosine(first, j), folded(1, i))
            if (self%number(j) == 0) cycle
            call add_wave(n, coefficients(1, self%column(j) + 1), self%sine(first, j), &
                          folded(1, i + 2))
         end do
         call unfold(self%n_time, first, n, folded, stride_out, values)
      end do
   end subroutine synthesise

   pure subroutine add_wave(n, factor, wave, sums)
      integer, intent(in) :: n
      real(wp), intent(in) :: factor, wave(n)
      real(wp), intent(inout) :: sums(n)

      ! Motions that repeat with the other sign after half a period have no even waves.
      if (abs(factor) <= 0.0_wp) return
      sums = sums + factor*wave
   end subroutine add_wave

   !> Values at n instants from `first` on and at their mirror images.
   pure subroutine unfold(n_time, first, n, folded, stride, values)
      integer, intent(in) :: n_time, first, n, stride
      real(wp), intent(in) :: folded(block, n_kinds)
      real(wp), intent(inout) :: values(stride, 0:*)
      real(wp) :: even, odd
      integer :: half, i, k

      half = n_time/2
      do i = 1, n
         k = first + i - 1
         even = folded(i, 1) + folded(i, 2)
         odd = folded(i, 4) + folded(i, 3)
         values(1, k) = even + odd
         ! The start is its own image.
         if (k > 0) values(1, n_time - k) = even - odd
      end do
      if (modulo(n_time, 2) == 1) return
      do i = 1, n
         k = first + i - 1
         even = folded(i, 1) - folded(i, 2)
         odd = folded(i, 4) - folded(i, 3)
         values(1, half + k) = even - odd
         ! Where a quarter is an instant both are its image, and it is its own.
         if (k > 0 .and. 2*k < half) values(1, half - k) = even + odd
      end do
   end subroutine unfold

   !> Coefficients from values at the instants: sums with the waves, times a factor and, for the
   !> constant, another one.
   pure subroutine analyse(self, stride, values, factor, of_constant, stride_out, coefficients)
      class(folded_waves), intent(in) :: self
      integer, intent(in) :: stride, stride_out
      real(wp), intent(in) :: values(stride, *), factor, of_constant
      real(wp), intent(inout) :: coefficients(stride_out, *)
      real(wp) :: folded(block, n_kinds)
      logical :: acts(n_kinds)
      integer :: first, i, j, n

      do j = 1, size(self%number)
         coefficients(1, self%column(j)) = 0.0_wp
         if (self%number(j) > 0) coefficients(1, self%column(j) + 1) = 0.0_wp
      end do
      do first = 0, self%last, block
         n = min(block, self%last - first + 1)
         call fold(self%n_time, first, n, stride, values, folded)
         ! Of a function with a symmetry half of them or more are zero, to the last bit.
         do i = 1, n_kinds
            ! A sum, and this way round: what is not a number acts.
            acts(i) = .not. sum_of_sizes(n, folded(1, i)) <= 0.0_wp
         end do
         do j = 1, size(self%number)
            i = kind_of(self, j)
            associate (column => self%column(j))
               if (self%number(j) == 0) then
                  coefficients(1, column) = coefficients(1, column) + of_constant* &
                                            sum_with(n, self%cosine(first, j), folded(1, i))
                  cycle
               end if
               if (acts(i)) coefficients(1, column) = coefficients(1, column) + factor* &
                  sum_with(n, self%cosine(first, j), folded(1, i))
               if (acts(i + 2)) coefficients(1, column + 1) = coefficients(1, column + 1) + &
                  factor*sum_with(n, self%sine(first, j), folded(1, i + 2))
            end associate
         end do
      end do
   end subroutine analyse

   pure real(wp) function sum_with(n, wave, values) result(total)
      integer, intent(in) :: n
      real(wp), intent(in) :: wave(n), values(n)
      integer :: k

      total = 0.0_wp
      !$omp simd reduction(+:total)
      do k = 1, n
         total = total + wave(k)*values(k)
      end do
   end function sum_with

   pure real(wp) function sum_of_sizes(n, values) result(total)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      integer :: k

      total = 0.0_wp
      !$omp simd reduction(+:total)
      do k = 1, n
         total = total + abs(values(k))
      end do
   end function sum_of_sizes

   !> What the waves of each kind meet at n instants from `first` on, which represent their images.
   pure subroutine fold(n_time, first, n, stride, values, folded)
      integer, intent(in) :: n_time, first, n, stride
      real(wp), intent(in) :: values(stride, 0:*)
      real(wp), intent(out) :: folded(block, n_kinds)
      real(wp) :: even, odd
      integer :: half, i, k

      half = n_time/2
      do i = 1, n
         k = first + i - 1
         even = values(1, k)
         odd = -values(1, k)
         if (k > 0) even = values(1, n_time - k)
         if (k > 0) odd = -values(1, n_time - k)
         folded(i, 1) = values(1, k) + even
         folded(i, 3) = values(1, k) + odd
      end do
      folded(:n, 2) = folded(:n, 1)
      folded(:n, 4) = folded(:n, 3)
      if (modulo(n_time, 2) == 0) then
         do i = 1, n
            k = first + i - 1
            even = values(1, half - k) + values(1, half + k)
            odd = values(1, half - k) - values(1, half + k)
            folded(i, 1) = folded(i, 1) + even
            folded(i, 2) = folded(i, 2) - even
            folded(i, 3) = folded(i, 3) - odd
            folded(i, 4) = folded(i, 4) + odd
         end do
         ! Its images are itself: a quarter, where it is an instant.
         k = half/2
         if (2*k == half .and. k >= first .and. k < first + n .and. k > 0) then
            folded(k - first + 1, :) = 0.5_wp*folded(k - first + 1, :)
         end if
      end if
      ! And the start.
      if (first == 0) folded(1, :) = 0.5_wp*folded(1, :)
   end subroutine fold

end module fw_folded_waves
