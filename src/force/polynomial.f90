!> Nonlinear springs, force coefficient * u_r**power, by alternating frequency/time.
module fw_polynomial
   use fw_kinds, only: wp
   use fw_fourier, only: fourier_type
   implicit none (type, external)
   private

   public :: springs_type, new_springs

   type :: springs_type
      integer :: n_springs = 0
      real(wp), allocatable :: coefficient(:)
      integer, allocatable :: power(:)
      !> Harmonics above this one are filtered from the elongations (LaBryer and Attar 2009).
      integer :: highest_harmonic = huge(0)
      !> Coefficients of elongations and forces (n_springs, n_coefficients).
      real(wp), allocatable :: elongation(:, :), force(:, :)
      !> The same at the instants (n_springs, n_time).
      real(wp), allocatable :: elongation_time(:, :), force_time(:, :)
      !> Derivative between coefficients (input, output, spring).
      real(wp), allocatable :: jacobian(:, :, :)
   contains
      procedure :: evaluate
      procedure :: linearize
   end type springs_type

contains

   pure function new_springs(coefficient, power, fourier) result(self)
      real(wp), intent(in) :: coefficient(:)
      integer, intent(in) :: power(:)
      type(fourier_type), intent(in) :: fourier
      type(springs_type) :: self
      integer :: n, nc

      n = size(coefficient)
      nc = fourier%n_coefficients
      self%n_springs = n
      self%coefficient = coefficient
      self%power = power
      allocate (self%elongation(n, nc), self%force(n, nc), source=0.0_wp)
      allocate (self%elongation_time(n, fourier%n_time), source=0.0_wp)
      allocate (self%force_time(n, fourier%n_time), source=0.0_wp)
      allocate (self%jacobian(nc, nc, n), source=0.0_wp)
   end function new_springs

   !> Forces from the elongations.
   subroutine evaluate(self, fourier)
      class(springs_type), intent(inout) :: self
      type(fourier_type), intent(inout) :: fourier
      integer :: i, k

      if (self%n_springs == 0) return
      call low_pass(self, fourier, self%elongation)
      call fourier%to_time(self%n_springs, self%elongation, self%elongation_time)
      do k = 1, fourier%n_time
         do i = 1, self%n_springs
            self%force_time(i, k) = self%coefficient(i)*self%elongation_time(i, k)**self%power(i)
         end do
      end do
      call fourier%to_coefficients(self%n_springs, self%force_time, self%force)
   end subroutine evaluate

   !> Zero the coefficients above the highest harmonic.
   pure subroutine low_pass(self, fourier, coefficients)
      type(springs_type), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: coefficients(:, :)
      integer :: h

      do h = 1, fourier%n_retained
         if (fourier%harmonic(h) <= self%highest_harmonic) cycle
         coefficients(:, fourier%column(h):fourier%column(h) + 1) = 0.0_wp
      end do
   end subroutine low_pass

   !> Derivatives at the last evaluated elongations.
   subroutine linearize(self, fourier)
      class(springs_type), intent(inout) :: self
      type(fourier_type), intent(in) :: fourier
      integer :: i, j, k
      real(wp) :: slope

      self%jacobian = 0.0_wp
      do i = 1, self%n_springs
         do k = 1, fourier%n_time
            slope = self%coefficient(i)*real(self%power(i), wp)* &
                    self%elongation_time(i, k)**(self%power(i) - 1)
            do j = 1, fourier%n_coefficients
               self%jacobian(:, j, i) = self%jacobian(:, j, i) + &
                                        (slope*fourier%analysis(j, k))*fourier%synthesis(:, k)
            end do
         end do
         ! Inputs are rows here: what is filtered has no derivative.
         do j = 1, fourier%n_retained
            if (fourier%harmonic(j) <= self%highest_harmonic) cycle
            self%jacobian(fourier%column(j):fourier%column(j) + 1, :, i) = 0.0_wp
         end do
      end do
   end subroutine linearize

end module fw_polynomial
