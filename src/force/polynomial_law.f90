!> Nonlinear springs, force coefficient * u_r**power, by alternating frequency/time.
module fw_polynomial_law
   use fw_force_law, only: force_law
   use fw_force_law, only: force_workspace
   use fw_force_law, only: law_facts
   use fw_force_law, only: law_room
   use fw_force_law, only: pair_mixed
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   implicit none (type, external)
   private

   public :: new_polynomial

   !> Instants of one product: enough for the speed of dgemm, few enough for the cache.
   integer, parameter :: block = 64

   type, extends(force_law) :: polynomial_law
      !> Force per length**power (n_elements).
      real(wp), allocatable :: coefficient(:)
      !> Whole numbers from 1 on (n_elements): 1 is a linear spring, odd ones keep the parity of the
      !> motion.
      integer, allocatable :: power(:)
      !> Harmonics above this one are filtered from the elongations (LaBryer and Attar 2009).
      integer :: highest_harmonic = huge(0)
   contains
      procedure :: evaluate
      procedure :: linearize
      procedure :: slope_at
      procedure :: n_parameters
      procedure :: by_parameter
   end type polynomial_law

   !> Slopes at the instants of a block times the base functions there (n_coefficients, block).
   type, extends(law_room) :: polynomial_room
      real(wp), allocatable :: sloped(:, :)
   end type polynomial_room

contains

   !> Springs of one power each, filtered together.
   pure type(polynomial_law) function new_polynomial(coefficient, power, highest_harmonic) &
      result(self)
      !> (n_springs) each.
      real(wp), intent(in) :: coefficient(:)
      integer, intent(in) :: power(:)
      !> Harmonics above it are filtered; 0: none is.
      integer, intent(in) :: highest_harmonic
      logical :: present(1, size(coefficient))

      ! A spring is an element of one component, whose prediction is its elongation.
      present = .true.
      call self%take_elements(present)
      self%prediction%stiffness = 1.0_wp
      self%coefficient = coefficient
      self%power = power
      if (highest_harmonic > 0) self%highest_harmonic = highest_harmonic
      self%facts = law_facts(is_odd=all(modulo(power, 2) == 1), has_multipliers=.true., &
                             is_integrated=.true.)
      ! From (power + 1) H + 1 instants on, polynomials are sampled without any error.
      self%facts%fewest_instants = 0
      self%facts%instants_per_harmonic = maxval([0, power]) + 1
      self%facts%instants_with_separation = self%facts%instants_per_harmonic
      self%facts%further_instants = 2
   end function new_polynomial

   !> Forces from the elongations.
   subroutine evaluate(self, fourier, work)
      class(polynomial_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i, k

      if (self%n_elements == 0) return
      ! Before the instants: products of what is filtered would fold back into the retained
      ! harmonics.
      call low_pass(self, fourier, work%prediction)
      call fourier%to_time(self%n_elements, work%prediction, work%prediction_time, work%fft)
      do k = 1, fourier%n_time
         do i = 1, self%n_elements
            work%force_time(i, 1, k) = self%coefficient(i)* &
                                       work%prediction_time(i, 1, k)**self%power(i)
         end do
      end do
      call fourier%to_coefficients(self%n_elements, work%force_time, work%force, work%fft)
      ! Every spring has a block in the derivative.
      work%state = pair_mixed
   end subroutine evaluate

   !> Zero the coefficients above the highest harmonic.
   pure subroutine low_pass(self, fourier, coefficients)
      type(polynomial_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Elongations (n_elements, 1, n_coefficients).
      real(wp), intent(inout) :: coefficients(:, :, :)
      integer :: h

      do h = 1, fourier%n_retained
         if (fourier%harmonic(h) <= self%highest_harmonic) cycle
         coefficients(:, :, fourier%column(h):fourier%column(h) + 1) = 0.0_wp
      end do
   end subroutine low_pass

   !> Derivatives at the last evaluated elongations.
   subroutine linearize(self, fourier, work)
      class(polynomial_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i, j, nc

      nc = fourier%n_coefficients
      work%linear_state = work%state
      if (.not. allocated(work%jacobian)) then
         allocate (work%jacobian(nc, nc, self%n_elements))
         allocate (polynomial_room :: work%room)
      end if
      select type (room => work%room)
      class is (polynomial_room)
         if (.not. allocated(room%sloped)) allocate (room%sloped(nc, block))
         do i = 1, self%n_elements
            call differentiate(self, i, fourier, work%prediction_time(i, 1, :), room%sloped, &
                               work%jacobian(:, :, i))
         end do
      end select
      ! Inputs are rows here: what is filtered has no derivative.
      do j = 1, fourier%n_retained
         if (fourier%harmonic(j) <= self%highest_harmonic) cycle
         work%jacobian(fourier%column(j):fourier%column(j) + 1, :, :) = 0.0_wp
      end do
   end subroutine linearize

   !> G = analysis diag(slope) synthesis of an element, transposed: the first index is the input.
   subroutine differentiate(self, element, fourier, y, sloped, gain)
      class(polynomial_law), intent(in) :: self
      integer, intent(in) :: element
      type(fourier_type), intent(in) :: fourier
      !> At the instants.
      real(wp), intent(in) :: y(:)
      real(wp), intent(inout), contiguous :: sloped(:, :), gain(:, :)
      integer :: first, k, last, nc

      nc = fourier%n_coefficients
      gain = 0.0_wp
      do first = 1, fourier%n_time, block
         last = min(first + block - 1, fourier%n_time)
         do k = first, last
            sloped(:, k - first + 1) = self%slope_at(element, y(k))*fourier%synthesis(:, k)
         end do
         call dgemm('N', 'T', nc, nc, last - first + 1, 1.0_wp, sloped, nc, &
                    fourier%analysis(:, first:last), nc, 1.0_wp, gain, nc)
      end do
   end subroutine differentiate

   !> d force/d elongation [force/length] of an element.
   elemental real(wp) function slope_at(self, element, y) result(slope)
      class(polynomial_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y

      slope = self%coefficient(element)*real(self%power(element), wp)*y**(self%power(element) - 1)
   end function slope_at

   !> The coefficient.
   pure integer function n_parameters(self)
      class(polynomial_law), intent(in) :: self

      n_parameters = merge(1, 0, self%n_elements > 0)
   end function n_parameters

   !> The force of a unit coefficient.
   subroutine by_parameter(self, number, fourier, work, force)
      class(polynomial_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)
      real(wp) :: values(self%n_elements, fourier%n_time)
      integer :: k

      do k = 1, fourier%n_time
         values(:, k) = work%prediction_time(:, 1, k)**self%power
      end do
      call fourier%to_coefficients(self%n_elements, values, force)
      associate (unused => number)
      end associate
   end subroutine by_parameter

end module fw_polynomial_law
