!> Time of one pair of transforms, to the instants and back, by the matrix product and by FFTW.
!> Writes one line of comma-separated values for each size; `fft_pays` in src/math/fourier.f90
!> rests on it.
program transforms
   use, intrinsic :: iso_fortran_env, only: int64, output_unit
   use fw_fourier, only: fft_pays, fourier_type, new_fourier
   use fw_fft, only: fft_type
   use fw_kinds, only: wp
   implicit none (type, external)

   integer, parameter :: harmonics(*) = [3, 7, 15, 31, 63, 127]
   integer, parameter :: instants(*) = [64, 128, 256, 512, 1024, 2048]
   !> Three rows a pair.
   integer, parameter :: rows(*) = [3, 48, 144]
   !> Time of one sample [s], and samples of which the median counts.
   real(wp), parameter :: sample_seconds = 1.0e-3_wp
   integer, parameter :: n_samples = 7
   integer :: h, k, r

   write (output_unit, '(a)') 'n_harmonics,n_time,n_rows,matrix,fft,difference,chosen'
   do r = 1, size(rows)
      do k = 1, size(instants)
         do h = 1, size(harmonics)
            ! At least four instants for each wave of the highest harmonic.
            if (instants(k) >= 4*harmonics(h)) call compare(harmonics(h), instants(k), rows(r))
         end do
      end do
   end do

contains

   !> Measure one size and write its line.
   subroutine compare(n_harmonics, n_time, n_rows)
      integer, intent(in) :: n_harmonics, n_time, n_rows
      type(fourier_type) :: matrix, fft
      type(fft_type), allocatable :: plans, none
      real(wp), allocatable :: coefficients(:, :), values(:, :), by_matrix(:, :), by_fft(:, :)
      real(wp) :: matrix_seconds, fft_seconds

      matrix = new_fourier(n_harmonics, n_time)
      fft = new_fourier(n_harmonics, n_time)
      fft%fft_rows = n_rows
      call fft%plan_fft(n_rows, plans)
      allocate (coefficients(n_rows, matrix%n_coefficients), values(n_rows, n_time))
      allocate (by_matrix, by_fft, mold=coefficients)
      call random_number(coefficients)
      call measure(matrix, none, coefficients, values, by_matrix, matrix_seconds)
      call measure(fft, plans, coefficients, values, by_fft, fft_seconds)
      write (output_unit, '(3(i0, ","), 3(es12.5, ","), a)') n_harmonics, n_time, n_rows, &
         matrix_seconds, fft_seconds, maxval(abs(by_matrix - by_fft)), &
         trim(merge('fft   ', 'matrix', fft_pays(matrix%n_coefficients)))
   end subroutine compare

   !> Median time of a pair of transforms [s].
   subroutine measure(fourier, fft, coefficients, values, back, seconds)
      type(fourier_type), intent(in) :: fourier
      type(fft_type), allocatable, intent(inout) :: fft
      real(wp), intent(in) :: coefficients(:, :)
      real(wp), intent(inout) :: values(:, :), back(:, :)
      real(wp), intent(out) :: seconds
      real(wp) :: samples(n_samples)
      integer :: i, n

      n = 1
      do
         samples(1) = sample(fourier, fft, coefficients, values, back, n)
         if (samples(1) >= sample_seconds) exit
         n = 2*n
      end do
      do i = 1, n_samples
         samples(i) = sample(fourier, fft, coefficients, values, back, n)/real(n, wp)
      end do
      seconds = median(samples)
   end subroutine measure

   !> Time of n pairs of transforms [s].
   real(wp) function sample(fourier, fft, coefficients, values, back, n)
      type(fourier_type), intent(in) :: fourier
      type(fft_type), allocatable, intent(inout) :: fft
      real(wp), intent(in) :: coefficients(:, :)
      real(wp), intent(inout) :: values(:, :), back(:, :)
      integer, intent(in) :: n
      integer(int64) :: start, finish, rate
      integer :: i

      call system_clock(start, rate)
      do i = 1, n
         call fourier%to_time(size(values, 1), coefficients, values, fft)
         call fourier%to_coefficients(size(values, 1), values, back, fft)
      end do
      call system_clock(finish)
      sample = real(finish - start, wp)/real(rate, wp)
   end function sample

   !> The middle of an odd number of values.
   pure real(wp) function median(values)
      real(wp), intent(in) :: values(:)
      integer :: i

      median = values(1)
      do i = 1, size(values)
         if (count(values < values(i)) > size(values)/2) cycle
         if (count(values > values(i)) > size(values)/2) cycle
         median = values(i)
      end do
   end function median

end program transforms
