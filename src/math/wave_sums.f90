!> Products of two base functions summed over the instants with a weight s,
!>
!>   G(i, j) = sum over k of s(k) synthesis(i, k) analysis(j, k),
!>
!> which is what derivatives of forces that follow from inputs of the same instant are made of. The
!> product of two waves is half the sum of the waves of the sum and the difference of their numbers,
!>
!>   2 cos m cos n = cos (m-n) + cos (m+n),   2 sin m sin n = cos (m-n) - cos (m+n),
!>   2 sin m cos n = sin (m+n) + sin (m-n),
!>
!> at every instant by itself, whatever the number of instants: G follows from the sums of s with
!> the waves up to twice the highest harmonic, (4H+1) n_time products in place of (2H+1)**2 n_time.
!> Where s is the same over a run of instants, first..last, its sums are geometric series,
!>
!>   sum of z**k, k = first..last: (z**(last+1) - z**first)/(z - 1),   z = exp(2 pi i p/n_time).
!>
!> The waves are only read, and threads share them; the sums belong to one thread.
module fw_wave_sums
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi, wp
   use fw_folded_waves, only: folded_waves
   implicit none (type, external)
   private

   public :: add_wave_products, wave_table, wave_sums

   type :: wave_table
      !> Waves 1, cos, sin, cos 2, .. up to twice the highest harmonic.
      integer, private :: n_waves = 0, n_time = 0, highest = 0
      !> (n_waves, n_time + 1): the last instant is the first again.
      real(wp), allocatable, private :: wave(:, :)
      !> Real and imaginary part of 1/(z - 1) of each wave but the constant (2, 2 highest).
      real(wp), allocatable, private :: geometric(:, :)
      !> Harmonics and their columns (n_retained).
      integer, allocatable, private :: harmonic(:), column(:)
      !> The same waves for sums of values at all instants.
      type(folded_waves), private :: folded
   contains
      procedure :: build
   end type wave_table

   !> Sums of an s with the waves of a table.
   type :: wave_sums
      !> (n_waves)
      real(wp), allocatable, private :: sums(:)
      !> The same by the number of the wave, negative ones too (-2 highest..2 highest).
      real(wp), allocatable, private :: cosine(:), sine(:)
   contains
      procedure :: reserve
      procedure :: clear
      procedure :: of_values
      procedure :: add_run
      procedure :: add_sums
      procedure :: add_products
      procedure :: analyse
   end type wave_sums

contains

   !> The waves of the harmonics of a transform whose analysis is the projection.
   pure subroutine build(self, fourier)
      class(wave_table), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp) :: angle, cosine(0:fourier%n_time - 1), sine(0:fourier%n_time - 1)
      integer :: k, p, place

      self%n_time = fourier%n_time
      self%harmonic = fourier%harmonic
      self%column = fourier%column
      self%highest = maxval([0, fourier%harmonic])
      self%n_waves = 4*self%highest + 1
      allocate (self%wave(self%n_waves, self%n_time + 1), self%geometric(2, 2*self%highest))
      do k = 0, self%n_time - 1
         cosine(k) = cos(2.0_wp*pi*real(k, wp)/real(self%n_time, wp))
         sine(k) = sin(2.0_wp*pi*real(k, wp)/real(self%n_time, wp))
      end do
      do k = 1, self%n_time + 1
         self%wave(1, k) = 1.0_wp
         ! Angles are reduced in integers: high waves keep full precision.
         place = 0
         do p = 1, 2*self%highest
            place = modulo(place + k - 1, self%n_time)
            self%wave(2*p, k) = cosine(place)
            self%wave(2*p + 1, k) = sine(place)
         end do
      end do
      do p = 1, 2*self%highest
         ! 1/(exp(i a) - 1) = -1/2 - i/2 cot(a/2); a is no multiple of 2 pi, because n_time is at
         ! least 2H+1.
         angle = pi*real(modulo(p, self%n_time), wp)/real(self%n_time, wp)
         self%geometric(:, p) = [-0.5_wp, -0.5_wp*cos(angle)/sin(angle)]
      end do
      call self%folded%build([(p, p=0, 2*self%highest)], [1, (2*p, p=1, 2*self%highest)], &
                             self%n_time)
   end subroutine build

   !> Room for the sums with the waves of a table.
   pure subroutine reserve(self, table)
      class(wave_sums), intent(inout) :: self
      type(wave_table), intent(in) :: table

      if (allocated(self%sums)) return
      allocate (self%sums(table%n_waves), source=0.0_wp)
      associate (most => 2*table%highest)
         allocate (self%cosine(-most:most), self%sine(-most:most))
      end associate
   end subroutine reserve

   !> s = 0.
   pure subroutine clear(self)
      class(wave_sums), intent(inout) :: self

      self%sums = 0.0_wp
   end subroutine clear

   !> s = values at the instants.
   pure subroutine of_values(self, table, values)
      class(wave_sums), intent(inout) :: self
      type(wave_table), intent(in) :: table
      real(wp), intent(in), contiguous :: values(:)

      call table%folded%analyse(1, values, 1.0_wp, 1.0_wp, 1, self%sums)
   end subroutine of_values

   !> s = s + factor at the instants first..last.
   pure subroutine add_run(self, table, first, last, factor)
      class(wave_sums), intent(inout) :: self
      type(wave_table), intent(in) :: table
      integer, intent(in) :: first, last
      real(wp), intent(in) :: factor
      real(wp) :: cosine, sine
      integer :: p

      self%sums(1) = self%sums(1) + factor*real(last - first + 1, wp)
      do p = 1, 2*table%highest
         cosine = factor*(table%wave(2*p, last + 1) - table%wave(2*p, first))
         sine = factor*(table%wave(2*p + 1, last + 1) - table%wave(2*p + 1, first))
         associate (re => table%geometric(1, p), im => table%geometric(2, p))
            self%sums(2*p) = self%sums(2*p) + cosine*re - sine*im
            self%sums(2*p + 1) = self%sums(2*p + 1) + cosine*im + sine*re
         end associate
      end do
   end subroutine add_run

   !> s = s + that of other sums.
   pure subroutine add_sums(self, other)
      class(wave_sums), intent(inout) :: self
      type(wave_sums), intent(in) :: other

      self%sums = self%sums + other%sums
   end subroutine add_sums

   !> Coefficients of s itself (n_coefficients).
   pure subroutine analyse(self, table, coefficients)
      class(wave_sums), intent(in) :: self
      type(wave_table), intent(in) :: table
      real(wp), intent(out), contiguous :: coefficients(:)
      integer :: h, j, n

      do h = 1, size(table%harmonic)
         n = table%harmonic(h)
         j = table%column(h)
         if (n == 0) then
            coefficients(j) = self%sums(1)/real(table%n_time, wp)
         else
            coefficients(j:j + 1) = (2.0_wp/real(table%n_time, wp))*self%sums(2*n:2*n + 1)
         end if
      end do
   end subroutine analyse

   !> products(i, j) = products(i, j) + G(i, j).
   pure subroutine add_products(self, table, n, products)
      class(wave_sums), intent(inout) :: self
      type(wave_table), intent(in) :: table
      !> Leading dimension.
      integer, intent(in) :: n
      real(wp), intent(inout) :: products(n, *)
      integer :: p

      self%cosine(0) = self%sums(1)
      self%sine(0) = 0.0_wp
      do p = 1, 2*table%highest
         self%cosine(p) = self%sums(2*p)
         self%cosine(-p) = self%sums(2*p)
         self%sine(p) = self%sums(2*p + 1)
         self%sine(-p) = -self%sums(2*p + 1)
      end do
      ! Weights of the analysis are 2/n_time; and half of the sums.
      call add_wave_products(size(table%harmonic), table%harmonic, table%column, 2*table%highest, &
                             1.0_wp/real(table%n_time, wp), self%cosine, self%sine, n, products)
   end subroutine add_products

   !> products(i, j) = products(i, j) + factor times the sums of two waves each, by the sums and
   !> differences of their numbers; half of it where the second wave is the constant.
   pure subroutine add_wave_products(n_harmonics, harmonic, column, most, factor, cosine, sine, n, &
                                     products)
      !> Harmonics, evenly spaced from the first one or from 0 on, and their columns, of which one
      !> follows the other.
      integer, intent(in) :: n_harmonics, harmonic(n_harmonics), column(n_harmonics)
      !> Largest number of a wave, and leading dimension.
      integer, intent(in) :: most, n
      real(wp), intent(in) :: factor
      !> Sums with the waves -most..most: those of cosines even, of sines odd.
      real(wp), intent(in) :: cosine(-most:most), sine(-most:most)
      real(wp), intent(inout) :: products(n, *)
      real(wp) :: weight
      integer :: above, below, first, h, j, n_pairs, nb, step

      if (n_harmonics == 0) return
      ! The first harmonic that is not the constant.
      first = merge(2, 1, harmonic(1) == 0)
      n_pairs = n_harmonics - first + 1
      step = 1
      if (n_harmonics > 1) step = harmonic(2) - harmonic(1)
      do h = 1, n_harmonics
         nb = harmonic(h)
         j = column(h)
         weight = merge(0.5_wp, 1.0_wp, nb == 0)*factor
         if (first == 2) then
            products(1, j) = products(1, j) + 2.0_wp*weight*cosine(nb)
            if (nb > 0) products(1, j + 1) = products(1, j + 1) + 2.0_wp*weight*sine(nb)
         end if
         if (n_pairs == 0) cycle
         above = harmonic(first) + nb
         below = harmonic(first) - nb
         call add_pairs(n_pairs, step, weight, weight, cosine(above), cosine(below), sine(above), &
                        sine(below), products(column(first), j))
         if (nb > 0) call add_pairs(n_pairs, step, weight, -weight, sine(above), sine(below), &
                                    cosine(below), cosine(above), products(column(first), j + 1))
      end do
   end subroutine add_wave_products

   !> rows = rows + a weight times some sums of waves and another one times others, which go from
   !> harmonic to harmonic by a step, 1 or 2.
   pure subroutine add_pairs(n, step, weight, other, a, b, c, d, rows)
      integer, intent(in) :: n, step
      real(wp), intent(in) :: weight, other
      !> Of the cosines of the rows a and b, of the sines c and d.
      real(wp), intent(in) :: a(*), b(*), c(*), d(*)
      real(wp), intent(inout) :: rows(2, n)
      integer :: i

      ! Known strides let a processor take several rows by one instruction.
      if (step == 1) then
         do i = 1, n
            rows(1, i) = rows(1, i) + (weight*a(i) + other*b(i))
            rows(2, i) = rows(2, i) + (weight*c(i) + other*d(i))
         end do
      else
         do i = 1, n
            rows(1, i) = rows(1, i) + (weight*a(2*i - 1) + other*b(2*i - 1))
            rows(2, i) = rows(2, i) + (weight*c(2*i - 1) + other*d(2*i - 1))
         end do
      end if
   end subroutine add_pairs

end module fw_wave_sums
