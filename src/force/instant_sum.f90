!> Derivatives of forces that are those of their prediction at some instants and nothing at the
!> others: the sum over these instants of synthesis analysis^T, as a block between coefficients.
!> Over all instants it is the identity where the transform is exact, so that the fewer of both
!> kinds can be summed.
module fw_instant_sum
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: instant_sum

   type :: instant_sum
      !> The instants that count (n_time).
      logical, allocatable :: wanted(:)
      !> Base functions and weights of those that are summed (n_coefficients, n_time).
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
      allocate (self%base(fourier%n_coefficients, fourier%n_time))
      allocate (self%weights(fourier%n_coefficients, fourier%n_time))
   end subroutine reserve

   !> The transposed block (input, output), of the instants that are wanted.
   subroutine form(self, fourier, n_stored, block)
      class(instant_sum), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      !> Rows of the matrix that the block belongs to.
      integer, intent(in) :: n_stored
      real(wp), intent(inout) :: block(n_stored, *)
      integer :: j, k, n, nc
      logical :: by_others

      nc = fourier%n_coefficients
      by_others = 2*count(self%wanted) > fourier%n_time .and. fourier%projects .and. &
                  fourier%n_time > 2*maxval(fourier%harmonic)
      n = 0
      do k = 1, fourier%n_time
         if (self%wanted(k) .eqv. by_others) cycle
         n = n + 1
         self%base(:, n) = fourier%synthesis(:, k)
         self%weights(:, n) = fourier%analysis(:, k)
      end do
      call dgemm('N', 'T', nc, nc, n, merge(-1.0_wp, 1.0_wp, by_others), self%base, nc, &
                 self%weights, nc, 0.0_wp, block, n_stored)
      if (.not. by_others) return
      do j = 1, nc
         block(j, j) = block(j, j) + 1.0_wp
      end do
   end subroutine form

end module fw_instant_sum
