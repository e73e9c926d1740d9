!> Complex amplitudes U_n = uc_n - i us_n of real Fourier coefficients, and back.
!>
!> Coefficients are (row, coefficient): the constant or cosine of each harmonic in its column, the
!> sine behind it.
module fw_complex_form
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: amplitudes_of, coefficients_of

contains

   !> U_n = uc - i us of real coefficients: u(tau) is the real part of U_n exp(i n tau).
   pure subroutine amplitudes_of(harmonic, column, n_rows, coefficients, n_stored, amplitudes)
      !> Harmonics and their columns (n_retained).
      integer, intent(in) :: harmonic(:), column(:)
      integer, intent(in) :: n_rows
      !> Real coefficients, constant or cosine and sine (n_rows, n_coefficients).
      real(wp), intent(in) :: coefficients(n_rows, *)
      !> Rows that `amplitudes` has in memory, at least n_rows.
      integer, intent(in) :: n_stored
      complex(wp), intent(inout) :: amplitudes(n_stored, *)
      integer :: h, k

      do h = 1, size(harmonic)
         k = column(h)
         ! Re (U exp(i n tau)) = uc cos(n tau) + us sin(n tau), and a constant has no sine.
         if (harmonic(h) == 0) then
            amplitudes(:n_rows, h) = cmplx(coefficients(:, k), kind=wp)
         else
            amplitudes(:n_rows, h) = cmplx(coefficients(:, k), -coefficients(:, k + 1), wp)
         end if
      end do
   end subroutine amplitudes_of

   !> And back: uc = re U_n, us = -im U_n.
   pure subroutine coefficients_of(harmonic, column, n_rows, n_stored, amplitudes, coefficients)
      !> Harmonics and their columns (n_retained).
      integer, intent(in) :: harmonic(:), column(:)
      !> Rows that are wanted, and rows in memory of both.
      integer, intent(in) :: n_rows, n_stored
      !> Complex amplitudes, and real coefficients (n_stored, n_coefficients).
      complex(wp), intent(in) :: amplitudes(n_stored, *)
      real(wp), intent(inout) :: coefficients(n_stored, *)
      integer :: h, k

      do h = 1, size(harmonic)
         k = column(h)
         coefficients(:n_rows, k) = real(amplitudes(:n_rows, h), wp)
         if (harmonic(h) > 0) coefficients(:n_rows, k + 1) = -aimag(amplitudes(:n_rows, h))
      end do
   end subroutine coefficients_of

end module fw_complex_form
