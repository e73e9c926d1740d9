!> Factors of the preconditioner of the balance for waves around equal sectors, one matrix a wave
!> and harmonic, and of what sectors have of their own beside each other.
module fw_wave_factors
   use fw_kinds, only: wp
   use fw_preconditioner_lu, only: preconditioner_lu_type
   implicit none (type, external)
   private

   public :: wave_factors

   !> Factors of I + Gamma D of a harmonic (fw_balance_waves), and scratch.
   type :: own_factors
      logical :: is_there = .false.
      complex(wp), allocatable :: matrix(:, :), block(:, :, :), rows(:, :), force(:)
      integer, allocatable :: pivot(:)
   end type own_factors

   type :: wave_factors
      !> Of waves (n_sectors, n_retained).
      type(preconditioner_lu_type), allocatable :: wave(:, :)
      !> Scratch (slots of a sector, n_sectors, n_retained).
      complex(wp), allocatable :: sectors(:, :, :), waves(:, :, :), answer(:, :, :)
      !> Of what sectors have beside each other (n_retained).
      type(own_factors), allocatable :: own(:)
   contains
      procedure :: reserve
   end type wave_factors

contains

   pure subroutine reserve(self, n_slots, n_sectors, n_harmonics)
      class(wave_factors), intent(inout) :: self
      integer, intent(in) :: n_slots, n_sectors, n_harmonics

      allocate (self%wave(n_sectors, n_harmonics), self%own(n_harmonics))
      allocate (self%sectors(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
      allocate (self%waves(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
      allocate (self%answer(n_slots, n_sectors, n_harmonics), source=(0.0_wp, 0.0_wp))
   end subroutine reserve

end module fw_wave_factors
