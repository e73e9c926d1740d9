!> Waves around a ring of n equal sectors, by FFTW:
!>
!>   u_j = sum_k U_k z_k**j,   z_k = exp(-2 pi i k/n),   U_k = 1/n sum_j u_j z_k**-j.
!>
!> Arrays are (row, sector) and (row, k + 1): the rows of a sector are neighbours.
!>
!> Compiled with FRETWEAR_WITHOUT_FFTW the same transforms are sums over a table of one wave.
module fw_ring_fft
#ifdef FRETWEAR_WITHOUT_FFTW
   use fw_kinds, only: pi
#else
   ! allow(C121): all that fftw3.f03 takes from there
   use, intrinsic :: iso_c_binding
#endif
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: ring_fft

#ifdef FRETWEAR_WITHOUT_FFTW
   !> A table of one wave around the ring, which threads may share.
   type :: ring_fft
      integer :: n_rows = 0
      integer :: n_sectors = 0
      !> exp(-2 pi i k/n) at k = 0, 1, ..
      complex(wp), allocatable, private :: factor(:)
   contains
      procedure :: plan
      procedure :: find_waves
      procedure :: add_waves
   end type ring_fft

contains

   subroutine plan(self, n_rows, n_sectors)
      class(ring_fft), intent(inout) :: self
      integer, intent(in) :: n_rows, n_sectors
      integer :: k

      self%n_rows = n_rows
      self%n_sectors = n_sectors
      self%factor = [(exp(cmplx(0.0_wp, -2.0_wp*pi*k/n_sectors, wp)), k=0, n_sectors - 1)]
   end subroutine plan

   !> U_k from u_j.
   subroutine find_waves(self, sectors, waves)
      class(ring_fft), intent(in) :: self
      complex(wp), intent(inout) :: sectors(self%n_rows, self%n_sectors)
      complex(wp), intent(inout) :: waves(self%n_rows, self%n_sectors)
      integer :: j, k

      do k = 0, self%n_sectors - 1
         waves(:, k + 1) = (0.0_wp, 0.0_wp)
         do j = 0, self%n_sectors - 1
            waves(:, k + 1) = waves(:, k + 1) + &
                              conjg(self%factor(modulo(j*k, self%n_sectors) + 1))*sectors(:, j + 1)
         end do
      end do
      waves = waves/real(self%n_sectors, wp)
   end subroutine find_waves

   !> u_j from U_k.
   subroutine add_waves(self, waves, sectors)
      class(ring_fft), intent(in) :: self
      complex(wp), intent(inout) :: waves(self%n_rows, self%n_sectors)
      complex(wp), intent(inout) :: sectors(self%n_rows, self%n_sectors)
      integer :: j, k

      do j = 0, self%n_sectors - 1
         sectors(:, j + 1) = (0.0_wp, 0.0_wp)
         do k = 0, self%n_sectors - 1
            sectors(:, j + 1) = sectors(:, j + 1) + &
                                self%factor(modulo(j*k, self%n_sectors) + 1)*waves(:, k + 1)
         end do
      end do
   end subroutine add_waves

#else
#include <fftw3.f03>

   !> Plans without buffers, which threads may share. Not to be copied: both would free the plans.
   type :: ring_fft
      integer :: n_rows = 0
      integer :: n_sectors = 0
      !> Plans of FFTW; null where there are none.
      type(c_ptr), private :: to_waves = c_null_ptr, to_sectors = c_null_ptr
   contains
      procedure :: plan
      procedure :: find_waves
      procedure :: add_waves
      final :: destroy
   end type ring_fft

contains

   !> Estimated, not measured, for the reasons of fw_fft.
   subroutine plan(self, n_rows, n_sectors)
      class(ring_fft), intent(inout) :: self
      integer, intent(in) :: n_rows, n_sectors
      complex(c_double_complex), allocatable :: from(:, :), to(:, :)
      integer(c_int) :: length(1), rows

      self%n_rows = n_rows
      self%n_sectors = n_sectors
      if (n_rows == 0) return
      allocate (from(n_rows, n_sectors), to(n_rows, n_sectors))
      length = int(n_sectors, c_int)
      rows = int(n_rows, c_int)
      !$omp critical (fretwear_fftw)
      ! Of any arrays: FFTW must not assume how they are aligned.
      self%to_waves = fftw_plan_many_dft(1_c_int, length, rows, from, length, rows, 1_c_int, to, &
                                         length, rows, 1_c_int, FFTW_BACKWARD, &
                                         ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
      self%to_sectors = fftw_plan_many_dft(1_c_int, length, rows, from, length, rows, 1_c_int, &
                                           to, length, rows, 1_c_int, FFTW_FORWARD, &
                                           ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
      !$omp end critical (fretwear_fftw)
   end subroutine plan

   !> U_k from u_j; `sectors` is left as it is.
   subroutine find_waves(self, sectors, waves)
      class(ring_fft), intent(in) :: self
      complex(wp), intent(inout) :: sectors(self%n_rows, self%n_sectors)
      complex(wp), intent(inout) :: waves(self%n_rows, self%n_sectors)

      if (self%n_rows == 0) return
      call fftw_execute_dft(self%to_waves, sectors, waves)
      waves = waves/real(self%n_sectors, wp)
   end subroutine find_waves

   !> u_j from U_k; `waves` is left as it is.
   subroutine add_waves(self, waves, sectors)
      class(ring_fft), intent(in) :: self
      complex(wp), intent(inout) :: waves(self%n_rows, self%n_sectors)
      complex(wp), intent(inout) :: sectors(self%n_rows, self%n_sectors)

      if (self%n_rows == 0) return
      call fftw_execute_dft(self%to_sectors, waves, sectors)
   end subroutine add_waves

   subroutine destroy(self)
      type(ring_fft), intent(inout) :: self

      !$omp critical (fretwear_fftw)
      if (c_associated(self%to_waves)) call fftw_destroy_plan(self%to_waves)
      if (c_associated(self%to_sectors)) call fftw_destroy_plan(self%to_sectors)
      !$omp end critical (fretwear_fftw)
      self%to_waves = c_null_ptr
      self%to_sectors = c_null_ptr
   end subroutine destroy

#endif

end module fw_ring_fft
