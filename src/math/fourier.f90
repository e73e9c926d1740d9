!> Fourier operators on a set of harmonics and n_time uniform instants tau_k = 2 pi k / n_time:
!>
!>   u(tau) = u_0 + sum_n uc_n cos(n tau) + us_n sin(n tau),   coefficients (0, c1, s1, c2, s2, ..)
!>
!> Arrays are (row, coefficient) and (row, instant): rows (coordinates, pairs) lie innermost, so
!> that both transforms are one matrix product over all rows, and kernels run along the rows.
!> Long transforms of many harmonics go through FFTW instead (see `fft_rows`).
module fw_fourier
   use fw_kinds, only: wp, pi
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_folded_waves, only: folded_waves
   use fw_lapack, only: dgemm, dgemv
   use fw_linalg, only: lu_type
   use fw_fft, only: fft_type, has_fftw
   use fw_threads, only: coordinates_for_threads
   implicit none (type, external)
   private

   public :: fourier_type, new_fourier, coefficient_count, fft_pays, to_complex, to_real

   !> Rows that are transformed one by one: those of a single pair, of which a direction or two are
   !> mostly zero. A product with three rows takes as long as three with one.
   integer, parameter :: few_rows = 3
   !> Rows of many that are transformed at a time, and rows from which threads share the blocks.
   integer, parameter :: block_rows = 48, rows_for_threads = coordinates_for_threads

   type :: fourier_type
      !> Retained harmonics, ascending (n_retained); 0 is among them unless only odd ones are.
      integer, allocatable :: harmonic(:)
      integer :: n_retained = 0
      !> Real coefficients per row.
      integer :: n_coefficients = 0
      integer :: n_time = 0
      !> Column of the constant or cosine coefficient of each retained harmonic; the sine
      !> coefficient follows it (n_retained).
      integer, allocatable :: column(:)
      !> Values of the base functions at the instants, and the weights of the analysis
      !> (n_coefficients, n_time).
      real(wp), allocatable :: synthesis(:, :), analysis(:, :)
      !> Rows of the arrays that go through FFTW, 0 where none do: who transforms such arrays brings
      !> the plans and buffers (`plan_fft`), for they belong to one thread.
      integer :: fft_rows = 0
      !> The analysis is the projection, not a collocation.
      logical :: projects = .true.
      !> The same waves for transforms of single rows.
      type(folded_waves), private :: waves
   contains
      procedure :: row_to_time
      procedure :: to_time
      procedure :: to_coefficients
      procedure :: differentiate
      procedure :: has_constant
      procedure :: plan_fft
      procedure :: collocate
   end type fourier_type

contains

   !> Real coefficients of all harmonics 0..n_harmonics: 2H+1.
   pure integer function coefficient_count(n_harmonics)
      integer, intent(in) :: n_harmonics

      coefficient_count = 2*n_harmonics + 1
   end function coefficient_count

   !> Operators for the harmonics 0..n_harmonics, or only the odd ones.
   !> n_time must be at least 2 n_harmonics + 1. Not pure: plans of transforms are finalized.
   function new_fourier(n_harmonics, n_time, odd_only) result(self)
      integer, intent(in) :: n_harmonics, n_time
      logical, intent(in), optional :: odd_only
      type(fourier_type) :: self
      integer :: i, step

      step = 1
      if (present(odd_only)) step = merge(2, 1, odd_only)
      ! 0, 1, 2, .. or 1, 3, 5, ..: without even harmonics there is no constant either.
      self%harmonic = [(i, i=step - 1, n_harmonics, step)]
      self%n_retained = size(self%harmonic)
      self%n_time = n_time
      allocate (self%column(self%n_retained))
      self%n_coefficients = 0
      do i = 1, self%n_retained
         self%column(i) = self%n_coefficients + 1
         self%n_coefficients = self%n_coefficients + merge(1, 2, self%harmonic(i) == 0)
      end do
      call fill_operators(self)
      call self%waves%build(self%harmonic, self%column, n_time)
   end function new_fourier

   !> Angles are reduced in integer arithmetic, so that high harmonics keep full precision, and all
   !> waves are made of n_time cosines and sines.
   pure subroutine fill_operators(self)
      type(fourier_type), intent(inout) :: self
      real(wp), allocatable :: cosine(:), sine(:)
      integer :: i, k, n, column, place

      allocate (cosine(0:self%n_time - 1), sine(0:self%n_time - 1))
      do k = 0, self%n_time - 1
         cosine(k) = cos(2.0_wp*pi*real(k, wp)/real(self%n_time, wp))
         sine(k) = sin(2.0_wp*pi*real(k, wp)/real(self%n_time, wp))
      end do
      allocate (self%synthesis(self%n_coefficients, self%n_time))
      do k = 1, self%n_time
         do i = 1, self%n_retained
            n = self%harmonic(i)
            column = self%column(i)
            place = modulo(n*(k - 1), self%n_time)
            self%synthesis(column, k) = cosine(place)
            if (n > 0) self%synthesis(column + 1, k) = sine(place)
         end do
      end do
      ! Discrete orthogonality: over the instants cos(n tau)**2 and sin(n tau)**2 add up to
      ! n_time/2 for 0 < 2n < n_time, the constant to n_time. Hence analysis synthesis^T = 1.
      self%analysis = (2.0_wp/real(self%n_time, wp))*self%synthesis
      if (self%has_constant()) self%analysis(1, :) = 1.0_wp/real(self%n_time, wp)
   end subroutine fill_operators

   !> Whether harmonic 0 is retained; it is the first then.
   pure logical function has_constant(self)
      class(fourier_type), intent(in) :: self

      has_constant = .false.
      if (self%n_retained > 0) has_constant = self%harmonic(1) == 0
   end function has_constant

   !> Plans and buffers for arrays of n_rows rows, where these go through FFTW: work for the
   !> construction of a workspace, outside of parallel regions.
   subroutine plan_fft(self, n_rows, fft)
      class(fourier_type), intent(in) :: self
      integer, intent(in) :: n_rows
      !> Not allocated where the matrices serve.
      type(fft_type), allocatable, intent(out) :: fft

      if (self%fft_rows == 0 .or. self%fft_rows /= n_rows) return
      allocate (fft)
      call fft%plan(n_rows, self%n_time)
   end subroutine plan_fft

   !> Replace the analysis by collocation: coefficients that fit the values at n_points of the
   !> instants, exactly where n_points = n_coefficients, else in the sense of least squares.
   subroutine collocate(self, n_points)
      class(fourier_type), intent(inout) :: self
      !> n_coefficients <= n_points <= n_time.
      integer, intent(in) :: n_points
      type(lu_type) :: normal
      integer :: instant(n_points), j
      logical :: singular

      ! As even as the instants allow; distinct, because n_points <= n_time.
      instant = [((j*self%n_time)/n_points + 1, j=0, n_points - 1)]
      self%projects = .false.
      ! With S the columns of the synthesis at the chosen instants the coefficients a obey (S S^T)
      ! a = S values, so that the analysis is (S S^T)^-1 S. The other instants get the weight zero.
      call normal%reserve(self%n_coefficients)
      normal%matrix = matmul(self%synthesis(:, instant), transpose(self%synthesis(:, instant)))
      call normal%factor(singular)
      self%analysis = 0.0_wp
      do j = 1, n_points
         self%analysis(:, instant(j)) = self%synthesis(:, instant(j))
         call normal%solve(self%analysis(:, instant(j)))
      end do
   end subroutine collocate

   !> Whether FFTW beats the matrix product for this many coefficients, whatever the instants: the
   !> product runs at the speed of dgemm, the strided transform does not. Measured by
   !> bench/speed/transforms.f90.
   pure logical function fft_pays(n_coefficients)
      integer, intent(in) :: n_coefficients

      fft_pays = has_fftw .and. n_coefficients > 64
   end function fft_pays

   !> Plans are made for one number of rows; others go through the matrix.
   pure logical function fft_serves(n_rows, fft)
      integer, intent(in) :: n_rows
      type(fft_type), intent(in), optional :: fft

      fft_serves = .false.
      if (present(fft)) fft_serves = fft%n_rows == n_rows
   end function fft_serves

   !> Values (n_rows, n_time) at the instants from coefficients (n_rows, n_coefficients).
   subroutine to_time(self, n_rows, coefficients, values, fft, wanted)
      class(fourier_type), intent(in) :: self
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: coefficients(n_rows, *)
      real(wp), intent(inout) :: values(n_rows, *)
      type(fft_type), intent(inout), optional :: fft
      !> Parts of the rows, as long as each other, that are not zero throughout (default: all).
      logical, intent(in), optional :: wanted(:)
      integer :: first, i, last, part

      if (fft_serves(n_rows, fft)) then
         call fft%synthesise(self%harmonic, self%column, coefficients, values)
         return
      end if
      do part = 1, n_parts(wanted)
         call rows_of(n_rows, part, wanted, first, last)
         if (is_idle(part, wanted)) then
            values(first:last, :self%n_time) = 0.0_wp
         else if (last - first < few_rows) then
            do i = first, last
               if (all(abs(coefficients(i, :self%n_coefficients)) <= 0.0_wp)) then
                  values(i, :self%n_time) = 0.0_wp
               else
                  call self%waves%synthesise(n_rows, coefficients(i, 1), n_rows, values(i, 1))
               end if
            end do
         else
            ! Whoever does a block: sizes of products decide on their last bits.
            !$omp parallel do default(none) private(i) if(last - first >= rows_for_threads) &
            !$omp shared(self, n_rows, first, last, coefficients, values)
            do i = first, last, block_rows
               call dgemm('N', 'N', min(block_rows, last - i + 1), self%n_time, &
                          self%n_coefficients, 1.0_wp, coefficients(i, 1), n_rows, &
                          self%synthesis, self%n_coefficients, 0.0_wp, values(i, 1), n_rows)
            end do
            !$omp end parallel do
         end if
      end do
   end subroutine to_time

   !> Coefficients (n_rows, n_coefficients) of values (n_rows, n_time) at the instants.
   subroutine to_coefficients(self, n_rows, values, coefficients, fft, wanted)
      class(fourier_type), intent(in) :: self
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: values(n_rows, *)
      real(wp), intent(inout) :: coefficients(n_rows, *)
      type(fft_type), intent(inout), optional :: fft
      !> Parts of the rows that vary, as in to_time; of the others the first value is taken.
      logical, intent(in), optional :: wanted(:)
      integer :: first, i, last, part

      if (self%projects .and. fft_serves(n_rows, fft)) then
         call fft%analyse(self%harmonic, self%column, values, coefficients)
         return
      end if
      do part = 1, n_parts(wanted)
         call rows_of(n_rows, part, wanted, first, last)
         if (self%projects .and. is_idle(part, wanted)) then
            coefficients(first:last, :self%n_coefficients) = 0.0_wp
            if (self%has_constant()) coefficients(first:last, 1) = values(first:last, 1)
         else if (last - first < few_rows) then
            do i = first, last
               if (all(abs(values(i, :self%n_time)) <= 0.0_wp)) then
                  coefficients(i, :self%n_coefficients) = 0.0_wp
               else
                  call analyse_row(self, n_rows, values(i, 1), coefficients(i, 1))
               end if
            end do
         else
            !$omp parallel do default(none) private(i) if(last - first >= rows_for_threads) &
            !$omp shared(self, n_rows, first, last, coefficients, values)
            do i = first, last, block_rows
               call dgemm('N', 'T', min(block_rows, last - i + 1), self%n_coefficients, &
                          self%n_time, 1.0_wp, values(i, 1), n_rows, self%analysis, &
                          self%n_coefficients, 0.0_wp, coefficients(i, 1), n_rows)
            end do
            !$omp end parallel do
         end if
      end do
   end subroutine to_coefficients

   !> Values of one row (n_time) from its coefficients.
   pure subroutine row_to_time(self, coefficients, values)
      class(fourier_type), intent(in) :: self
      real(wp), intent(in) :: coefficients(self%n_coefficients)
      real(wp), intent(inout) :: values(self%n_time)

      call self%waves%synthesise(1, coefficients, 1, values)
   end subroutine row_to_time

   !> One row of values by the projection, or by collocation.
   subroutine analyse_row(self, stride, values, coefficients)
      type(fourier_type), intent(in) :: self
      integer, intent(in) :: stride
      real(wp), intent(in) :: values(stride, *)
      real(wp), intent(inout) :: coefficients(stride, *)

      if (self%projects) then
         associate (mean => 1.0_wp/real(self%n_time, wp))
            call self%waves%analyse(stride, values, 2.0_wp*mean, mean, stride, coefficients)
         end associate
      else
         call dgemv('N', self%n_coefficients, self%n_time, 1.0_wp, self%analysis, &
                    self%n_coefficients, values, stride, 0.0_wp, coefficients, stride)
      end if
   end subroutine analyse_row

   !> Parts that the rows of an array fall into.
   pure integer function n_parts(wanted)
      logical, intent(in), optional :: wanted(:)

      n_parts = 1
      if (present(wanted)) n_parts = size(wanted)
   end function n_parts

   !> Whether nothing of a part varies.
   pure logical function is_idle(part, wanted)
      integer, intent(in) :: part
      logical, intent(in), optional :: wanted(:)

      is_idle = .false.
      if (present(wanted)) is_idle = .not. wanted(part)
   end function is_idle

   !> The rows of a part.
   pure subroutine rows_of(n_rows, part, wanted, first, last)
      integer, intent(in) :: n_rows, part
      logical, intent(in), optional :: wanted(:)
      integer, intent(out) :: first, last

      last = part*(n_rows/n_parts(wanted))
      first = last - n_rows/n_parts(wanted) + 1
   end subroutine rows_of

   !> Coefficients of du/dtau from those of u (n_rows, n_coefficients).
   pure subroutine differentiate(self, n_rows, coefficients, derivative)
      class(fourier_type), intent(in) :: self
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: coefficients(n_rows, *)
      real(wp), intent(inout) :: derivative(n_rows, *)
      integer :: i, column
      real(wp) :: n

      do i = 1, self%n_retained
         column = self%column(i)
         n = real(self%harmonic(i), wp)
         if (self%harmonic(i) == 0) then
            derivative(:, column) = 0.0_wp
         else
            ! d/dtau (c cos n tau + s sin n tau) = n s cos n tau - n c sin n tau.
            derivative(:, column) = n*coefficients(:, column + 1)
            derivative(:, column + 1) = -n*coefficients(:, column)
         end if
      end do
   end subroutine differentiate

   !> U_n = uc_n - i us_n of each retained harmonic (n_rows, n_retained).
   pure subroutine to_complex(fourier, n_rows, coefficients, harmonics)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      real(wp), intent(in) :: coefficients(n_rows, *)
      complex(wp), intent(inout) :: harmonics(n_rows, *)

      call amplitudes_of(fourier%harmonic, fourier%column, n_rows, coefficients, n_rows, harmonics)
   end subroutine to_complex

   !> The inverse of to_complex.
   pure subroutine to_real(fourier, n_rows, harmonics, coefficients)
      type(fourier_type), intent(in) :: fourier
      integer, intent(in) :: n_rows
      complex(wp), intent(in) :: harmonics(n_rows, *)
      real(wp), intent(inout) :: coefficients(n_rows, *)

      call coefficients_of(fourier%harmonic, fourier%column, n_rows, n_rows, harmonics, &
                           coefficients)
   end subroutine to_real

end module fw_fourier
