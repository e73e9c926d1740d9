!> Derivatives of forces that are those of their prediction at some instants and nothing at the
!> others: the sum over these instants of synthesis analysis^T, as a block between coefficients.
!> Where the analysis is the projection, a run of instants is a geometric series of waves
!> (fw_wave_sums); else it is a product over the instants.
module fw_instant_sum
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_wave_sums, only: wave_sums, wave_table
   implicit none (type, external)
   private

   public :: instant_sum

   type :: instant_sum
      !> The instants that count (n_time).
      logical, allocatable :: wanted(:)
      !> Of a projection.
      type(wave_sums), private :: sums
      !> Else base functions and weights of those that are summed (n_coefficients, n_time).
      real(wp), allocatable, private :: base(:, :), weights(:, :)
   contains
      procedure :: reserve
      procedure :: form
   end type instant_sum

contains

   pure subroutine reserve(self, fourier)
      class(instant_sum), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier

      if (allocated(self%wanted)) return
      allocate (self%wanted(fourier%n_time), source=.false.)
      if (fourier%projects) return
      allocate (self%base(fourier%n_coefficients, fourier%n_time))
      allocate (self%weights(fourier%n_coefficients, fourier%n_time))
   end subroutine reserve

   !> The transposed block (input, output), of the instants that are wanted.
   subroutine form(self, fourier, waves, n_stored, block, factor)
      class(instant_sum), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Of its harmonics, where the analysis is the projection.
      type(wave_table), intent(in) :: waves
      !> Rows of the matrix that the block belongs to.
      integer, intent(in) :: n_stored
      real(wp), intent(inout) :: block(n_stored, *)
      !> What the prediction counts at each instant, wanted or not (n_time); default: 1 where it is
      !> wanted.
      real(wp), intent(in), contiguous, optional :: factor(:)
      integer :: k, n, nc

      nc = fourier%n_coefficients
      if (fourier%projects) then
         call self%sums%reserve(waves)
         if (present(factor)) then
            call self%sums%of_values(waves, factor)
         else
            call add_runs(self, waves)
         end if
         block(:nc, :nc) = 0.0_wp
         call self%sums%add_products(waves, n_stored, block)
         return
      end if
      n = 0
      do k = 1, fourier%n_time
         if (.not. (self%wanted(k) .or. present(factor))) cycle
         n = n + 1
         self%base(:, n) = fourier%synthesis(:, k)
         if (present(factor)) self%base(:, n) = factor(k)*self%base(:, n)
         self%weights(:, n) = fourier%analysis(:, k)
      end do
      call dgemm('N', 'T', nc, nc, n, 1.0_wp, self%base, nc, self%weights, nc, 0.0_wp, block, &
                 n_stored)
   end subroutine form

   !> The sums of the waves over the wanted instants, run by run.
   pure subroutine add_runs(self, waves)
      type(instant_sum), intent(inout) :: self
      type(wave_table), intent(in) :: waves
      integer :: first, last

      call self%sums%clear()
      first = 1
      do while (first <= size(self%wanted))
         last = first
         do while (last < size(self%wanted))
            if (self%wanted(last + 1) .neqv. self%wanted(first)) exit
            last = last + 1
         end do
         if (self%wanted(first)) call self%sums%add_run(waves, first, last, 1.0_wp)
         first = last + 1
      end do
   end subroutine add_runs

end module fw_instant_sum
