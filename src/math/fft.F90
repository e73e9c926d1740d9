!> Batched real transforms through FFTW along the second index of (row, instant) arrays.
!>
!> A transform of length n_time costs O(n_time log n_time) a row where the matrix product costs
!> n_time (2H+1); it pays above a number of coefficients that fw_fourier knows (`fft_pays`). The row
!> is the first index, so that all rows of an instant are neighbours and FFTW vectorises over them.
!>
!> Compiled with FRETWEAR_WITHOUT_FFTW the same transforms are sums over a table of one wave:
!> nothing is planned then (`has_fftw`), and matrix products serve every number of coefficients.
module fw_fft
#ifdef FRETWEAR_WITHOUT_FFTW
   use fw_kinds, only: pi
#else
   ! allow(C121): all that fftw3.f03 takes from there
   use, intrinsic :: iso_c_binding
#endif
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: fft_type, has_fftw

#ifdef FRETWEAR_WITHOUT_FFTW
   !> Whether FFTW stands behind fft_type.
   logical, parameter :: has_fftw = .false.

   !> A table of one wave over the instants of a period.
   type :: fft_type
      !> Number of rows (pairs times components), and of instants in a period.
      integer :: n_rows = 0
      integer :: n_time = 0
      !> Cosine and sine of 2 pi k/n_time at k = 0, 1, ..
      real(wp), allocatable :: cosine(:), sine(:)
   contains
      procedure :: plan
      procedure :: synthesise
      procedure :: analyse
   end type fft_type

contains

   !> The table of n_time instants, for n_rows rows.
   subroutine plan(self, n_rows, n_time)
      class(fft_type), intent(inout) :: self
      integer, intent(in) :: n_rows, n_time
      integer :: k

      self%n_rows = n_rows
      self%n_time = n_time
      self%cosine = [(cos(2.0_wp*pi*k/n_time), k=0, n_time - 1)]
      self%sine = [(sin(2.0_wp*pi*k/n_time), k=0, n_time - 1)]
   end subroutine plan

   !> Values at the instants from coefficients; U_n = uc_n - i us_n stands at frequency n.
   subroutine synthesise(self, harmonic, column, coefficients, values)
      class(fft_type), intent(inout) :: self
      !> Harmonic numbers, increasing, and the column at which the coefficients of each begin (n).
      integer, intent(in) :: harmonic(:), column(:)
      !> Coefficients (n_rows, n_coefficients): one column for harmonic 0, cosine and sine for
      !> others.
      real(wp), intent(in) :: coefficients(self%n_rows, *)
      !> Values at tau_k = 2 pi k/n_time (n_rows, n_time).
      real(wp), intent(inout) :: values(self%n_rows, *)
      integer :: i, k, at

      do k = 1, self%n_time
         values(:, k) = 0.0_wp
         do i = 1, size(harmonic)
            at = 1 + modulo(harmonic(i)*(k - 1), self%n_time)
            values(:, k) = values(:, k) + self%cosine(at)*coefficients(:, column(i))
            if (harmonic(i) > 0) values(:, k) = values(:, k) + &
               self%sine(at)*coefficients(:, column(i) + 1)
         end do
      end do
   end subroutine synthesise

   !> Coefficients of the retained harmonics from values at the instants.
   !> Harmonics above n_time/2 alias: the caller keeps n_time > 2H.
   subroutine analyse(self, harmonic, column, values, coefficients)
      !> As in synthesise.
      class(fft_type), intent(inout) :: self
      integer, intent(in) :: harmonic(:), column(:)
      real(wp), intent(in) :: values(self%n_rows, *)
      real(wp), intent(inout) :: coefficients(self%n_rows, *)
      integer :: i, k, at
      real(wp) :: weight

      do i = 1, size(harmonic)
         weight = merge(1.0_wp, 2.0_wp, harmonic(i) == 0)/real(self%n_time, wp)
         coefficients(:, column(i)) = 0.0_wp
         if (harmonic(i) > 0) coefficients(:, column(i) + 1) = 0.0_wp
         do k = 1, self%n_time
            at = 1 + modulo(harmonic(i)*(k - 1), self%n_time)
            coefficients(:, column(i)) = coefficients(:, column(i)) + &
               weight*self%cosine(at)*values(:, k)
            if (harmonic(i) > 0) then
               coefficients(:, column(i) + 1) = coefficients(:, column(i) + 1) + &
                  weight*self%sine(at)*values(:, k)
            end if
         end do
      end do
   end subroutine analyse

#else
#include <fftw3.f03>

   !> Whether FFTW stands behind fft_type.
   logical, parameter :: has_fftw = .true.

   !> A pair of plans with their own buffers; belongs to one thread, and is not to be copied: both
   !> would destroy the same plans.
   type :: fft_type
      !> Number of rows (pairs times components), and of instants in a period.
      integer :: n_rows = 0
      integer :: n_time = 0
      !> Values at the instants (n_rows, n_time) and half spectrum (n_rows, n_time/2 + 1): the
      !> buffers of the plans, whose alignment FFTW has assumed; other arrays are copied through
      !> them.
      real(c_double), allocatable :: values(:, :)
      complex(c_double_complex), allocatable :: spectrum(:, :)
      !> Plans of FFTW; null where there are none.
      type(c_ptr) :: forward = c_null_ptr
      type(c_ptr) :: backward = c_null_ptr
   contains
      procedure :: plan
      procedure :: synthesise
      procedure :: analyse
      final :: destroy
   end type fft_type

contains

   !> Plan transforms of n_rows rows with n_time instants. The planner of FFTW serves one thread
   !> at a time; transforms with plans of their own may run side by side.
   !> Plans are estimated, not measured: measuring would choose by the clock, and the sums, hence
   !> the last digits of a result, would change from run to run.
   subroutine plan(self, n_rows, n_time)
      class(fft_type), intent(inout) :: self
      integer, intent(in) :: n_rows, n_time
      integer(c_int) :: length(1), rows

      self%n_rows = n_rows
      self%n_time = n_time
      allocate (self%values(n_rows, n_time), self%spectrum(n_rows, n_time/2 + 1))
      length = int(n_time, c_int)
      rows = int(n_rows, c_int)
      ! A transform runs along the second index: its entries lie n_rows apart (the stride), and the
      ! transforms of two rows one apart (the distance).
      !$omp critical (fretwear_fftw)
      self%forward = fftw_plan_many_dft_r2c(1_c_int, length, rows, self%values, length, rows, &
                                            1_c_int, self%spectrum, length/2 + 1, rows, 1_c_int, &
                                            FFTW_ESTIMATE)
      self%backward = fftw_plan_many_dft_c2r(1_c_int, length, rows, self%spectrum, length/2 + 1, &
                                             rows, 1_c_int, self%values, length, rows, 1_c_int, &
                                             FFTW_ESTIMATE)
      !$omp end critical (fretwear_fftw)
   end subroutine plan

   !> Values at the instants from coefficients; U_n = uc_n - i us_n stands at frequency n.
   subroutine synthesise(self, harmonic, column, coefficients, values)
      class(fft_type), intent(inout) :: self
      !> Harmonic numbers, increasing, and the column at which the coefficients of each begin (n).
      integer, intent(in) :: harmonic(:), column(:)
      !> Coefficients (n_rows, n_coefficients): one column for harmonic 0, cosine and sine for
      !> others.
      real(wp), intent(in) :: coefficients(self%n_rows, *)
      !> Values at tau_k = 2 pi k/n_time (n_rows, n_time).
      real(wp), intent(inout) :: values(self%n_rows, *)
      integer :: i

      ! The backward transform of FFTW overwrites its input: it is filled anew every time.
      self%spectrum = (0.0_wp, 0.0_wp)
      do i = 1, size(harmonic)
         if (harmonic(i) == 0) then
            self%spectrum(:, 1) = cmplx(coefficients(:self%n_rows, column(i)), kind=wp)
         else
            ! The other half of a real wave is the conjugate at -n, which the transform implies.
            self%spectrum(:, harmonic(i) + 1) = 0.5_wp* &
               cmplx(coefficients(:self%n_rows, column(i)), &
                     -coefficients(:self%n_rows, column(i) + 1), wp)
         end if
      end do
      call fftw_execute_dft_c2r(self%backward, self%spectrum, self%values)
      values(:, :self%n_time) = self%values
   end subroutine synthesise

   !> Coefficients of the retained harmonics from values at the instants.
   !> Harmonics above n_time/2 alias: the caller keeps n_time > 2H.
   subroutine analyse(self, harmonic, column, values, coefficients)
      !> As in synthesise.
      class(fft_type), intent(inout) :: self
      integer, intent(in) :: harmonic(:), column(:)
      real(wp), intent(in) :: values(self%n_rows, *)
      real(wp), intent(inout) :: coefficients(self%n_rows, *)
      integer :: i
      real(wp) :: weight

      self%values = values(:, :self%n_time)
      call fftw_execute_dft_r2c(self%forward, self%values, self%spectrum)
      ! FFTW does not normalise.
      weight = 1.0_wp/real(self%n_time, wp)
      do i = 1, size(harmonic)
         if (harmonic(i) == 0) then
            coefficients(:, column(i)) = weight*real(self%spectrum(:, 1), wp)
         else
            coefficients(:, column(i)) = 2.0_wp*weight*real(self%spectrum(:, harmonic(i) + 1), wp)
            coefficients(:, column(i) + 1) = -2.0_wp*weight*aimag(self%spectrum(:, harmonic(i) + 1))
         end if
      end do
   end subroutine analyse

   !> Plans are of FFTW's own storage, which deallocation of the object alone would leak.
   subroutine destroy(self)
      type(fft_type), intent(inout) :: self

      !$omp critical (fretwear_fftw)
      if (c_associated(self%forward)) call fftw_destroy_plan(self%forward)
      if (c_associated(self%backward)) call fftw_destroy_plan(self%backward)
      !$omp end critical (fretwear_fftw)
      self%forward = c_null_ptr
      self%backward = c_null_ptr
   end subroutine destroy
#endif

end module fw_fft
