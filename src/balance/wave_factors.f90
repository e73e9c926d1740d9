!> Factors of the preconditioner of the balance for waves around equal sectors, one matrix a wave
!> and harmonic, and of what sectors have of their own beside each other.
module fw_wave_factors
   use fw_kinds, only: pi, wp
   use fw_lapack, only: zgemm, zgemv
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_ring_update, only: ring_update
   implicit none (type, external)
   private

   public :: wave_factors

   !> Factors of I + Gamma D of a harmonic (fw_balance_waves), and scratch.
   type :: own_factors
      logical :: is_there = .false.
      complex(wp), allocatable :: matrix(:, :), block(:, :, :), rows(:, :), force(:)
      integer, allocatable :: pivot(:)
   end type own_factors

   !> Of contact that differs from sector to sector in a harmonic (fw_balance_differing): rows W_k
   !> and M_k^-1 W_k^H of every wave, what they become, and scratch.
   type :: differing_factors
      logical :: is_there = .false.
      !> (n_rows, n_slots, n_sectors), (n_slots, n_rows, n_sectors).
      complex(wp), allocatable :: rows(:, :, :), answer(:, :, :)
      !> The slot and the weight of a row that is a coordinate in all waves; slot 0: of another one.
      integer, allocatable, private :: slot(:)
      real(wp), allocatable, private :: weight(:)
      type(ring_update) :: update
      !> z_k**j (n_sectors, n_sectors), and rows of waves and sectors (n_rows, n_sectors).
      complex(wp), allocatable, private :: turn(:, :), wave(:, :), sector(:, :)
   contains
      procedure :: reserve => reserve_differing
      procedure :: find_coordinates
      procedure :: take_off
      procedure :: take_off_transposed
   end type differing_factors

   type :: wave_factors
      !> Of waves (n_sectors, n_retained).
      type(preconditioner_lu_type), allocatable :: wave(:, :)
      !> Scratch (slots of a sector, n_sectors, n_retained).
      complex(wp), allocatable :: sectors(:, :, :), waves(:, :, :), answer(:, :, :)
      !> Of what sectors have beside each other (n_retained).
      type(own_factors), allocatable :: own(:)
      !> Of contact that differs (n_retained).
      type(differing_factors), allocatable :: differing(:)
   contains
      procedure :: reserve
   end type wave_factors

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

contains

   pure subroutine reserve(self, n_slots, n_sectors, n_harmonics)
      class(wave_factors), intent(inout) :: self
      integer, intent(in) :: n_slots, n_sectors, n_harmonics

      allocate (self%wave(n_sectors, n_harmonics), self%own(n_harmonics), &
                self%differing(n_harmonics))
      allocate (self%sectors(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
      allocate (self%waves(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
      allocate (self%answer(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
   end subroutine reserve

   pure subroutine reserve_differing(self, n_rows, n_slots, n_sectors)
      class(differing_factors), intent(inout) :: self
      integer, intent(in) :: n_rows, n_slots, n_sectors
      integer :: j, k

      if (allocated(self%rows)) then
         if (size(self%rows, 1) == n_rows) return
         deallocate (self%rows, self%answer, self%slot, self%weight, self%turn, self%wave, &
                     self%sector)
      end if
      allocate (self%rows(n_rows, n_slots, n_sectors), self%answer(n_slots, n_rows, n_sectors))
      allocate (self%slot(n_rows), source=0)
      allocate (self%weight(n_rows), source=0.0_wp)
      allocate (self%turn(n_sectors, n_sectors), self%wave(n_rows, n_sectors), &
                self%sector(n_rows, n_sectors))
      do j = 0, n_sectors - 1
         do k = 0, n_sectors - 1
            self%turn(k + 1, j + 1) = &
               exp(cmplx(0.0_wp, -2.0_wp*pi*modulo(j*k, n_sectors)/n_sectors, wp))
         end do
      end do
   end subroutine reserve_differing

   !> Rows with one entry, the same in all waves.
   pure subroutine find_coordinates(self)
      class(differing_factors), intent(inout) :: self
      complex(wp) :: entry
      integer :: a, m

      self%slot = 0
      do a = 1, size(self%rows, 1)
         m = maxloc(abs(self%rows(a, :, 1)), dim=1)
         entry = self%rows(a, m, 1)
         if (abs(aimag(entry)) > 0.0_wp .or. any(abs(self%rows(a, m, :) - entry) > 0.0_wp)) cycle
         if (any(abs(self%rows(a, :m - 1, :)) > 0.0_wp)) cycle
         if (any(abs(self%rows(a, m + 1:, :)) > 0.0_wp)) cycle
         self%slot(a) = m
         self%weight(a) = real(entry, wp)
      end do
   end subroutine find_coordinates

   !> Take M^-1 W^T X W x off from x = M^-1 b, in waves (n_slots, n_sectors).
   subroutine take_off(self, waves)
      class(differing_factors), intent(inout) :: self
      complex(wp), intent(inout) :: waves(size(self%rows, 2), size(self%rows, 3))
      integer :: a, k, m, n, r

      m = size(self%rows, 2)
      n = size(self%rows, 3)
      r = size(self%rows, 1)
      do k = 1, n
         do a = 1, r
            if (self%slot(a) > 0) then
               self%wave(a, k) = self%weight(a)*waves(self%slot(a), k)
            else
               self%wave(a, k) = sum(self%rows(a, :, k)*waves(:, k))
            end if
         end do
      end do
      call zgemm('N', 'N', r, n, n, one, self%wave, r, self%turn, n, zero, self%sector, r)
      call self%update%apply(self%sector)
      call zgemm('N', 'C', r, n, n, one/n, self%sector, r, self%turn, n, zero, self%wave, r)
      do k = 1, n
         call zgemv('N', m, r, -one, self%answer(1, 1, k), m, self%wave(1, k), 1, one, &
                    waves(1, k), 1)
      end do
   end subroutine take_off

   !> Take W^T X^T W M^-T b off from b: the transpose of a wave stands in the one the other way.
   subroutine take_off_transposed(self, waves)
      class(differing_factors), intent(inout) :: self
      complex(wp), intent(inout) :: waves(size(self%rows, 2), size(self%rows, 3))
      integer :: k, m, n, other, r

      m = size(self%rows, 2)
      n = size(self%rows, 3)
      r = size(self%rows, 1)
      do k = 1, n
         other = modulo(n - k + 1, n) + 1
         call zgemv('T', m, r, one, self%answer(1, 1, other), m, waves(1, k), 1, zero, &
                    self%wave(1, k), 1)
      end do
      call zgemm('N', 'N', r, n, n, one, self%wave, r, self%turn, n, zero, self%sector, r)
      call self%update%apply_transposed(self%sector)
      call zgemm('N', 'C', r, n, n, one/n, self%sector, r, self%turn, n, zero, self%wave, r)
      do k = 1, n
         other = modulo(n - k + 1, n) + 1
         call zgemv('T', r, m, -one, self%rows(1, 1, other), r, self%wave(1, k), 1, one, &
                    waves(1, k), 1)
      end do
   end subroutine take_off_transposed

end module fw_wave_factors
