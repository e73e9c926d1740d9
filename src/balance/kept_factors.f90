!> Factors of the preconditioner of the balance, one matrix a harmonic, and the coordinates that
!> they were built for: they serve while few coordinates have joined the active ones or left them.
module fw_kept_factors
   use fw_kinds, only: wp
   use fw_preconditioner_lu, only: preconditioner_lu_type
   use fw_split_factors, only: split_factors
   use fw_wave_factors, only: wave_factors
   implicit none (type, external)
   private

   public :: kept_factors

   type :: kept_factors
      type(preconditioner_lu_type), allocatable :: harmonic(:)
      !> In place of them: two matrices for all harmonics; whether the factors in use are these.
      type(split_factors) :: split
      logical :: is_split = .false.
      !> Whether these are used although there are those of waves.
      logical :: is_whole = .false.
      !> Whether those of waves are joined by what contact of each sector has of its own.
      logical :: tells_sectors = .false.
      !> Of waves around equal sectors, in their place.
      type(wave_factors) :: around
      !> Coordinates for which they were built (first n entries).
      integer :: n = 0
      integer, allocatable :: coordinate(:)
      !> A harmonic whose factors another system has, bordered (its place); 0 for none.
      integer :: left_out = 0
      !> What the derivative was altered by then (fw_balance_state); huge with a shift.
      real(wp) :: alteration = 0.0_wp
      !> Place there of each active coordinate, 0 for one that has become active since; prediction
      !> stiffness of those.
      integer, allocatable :: place(:)
      !> The inverse of it: the active coordinate of each place, 0 for one that has left.
      integer, allocatable :: from(:)
      real(wp), allocatable :: unknown_stiffness(:)
   contains
      procedure :: reserve
   end type kept_factors

contains

   pure subroutine reserve(self, n_coordinates, n_harmonics)
      class(kept_factors), intent(inout) :: self
      integer, intent(in) :: n_coordinates, n_harmonics

      allocate (self%harmonic(n_harmonics))
      allocate (self%coordinate(n_coordinates), self%place(n_coordinates), &
                self%from(n_coordinates), source=0)
      allocate (self%unknown_stiffness(n_coordinates), source=0.0_wp)
   end subroutine reserve

end module fw_kept_factors
