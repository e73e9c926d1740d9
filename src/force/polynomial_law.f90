!> Nonlinear springs, force coefficient * u_r**power, by alternating frequency/time.
module fw_polynomial_law
   use fw_force_law, only: force_law, force_workspace, law_facts, law_room, pair_mixed
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_wave_sums, only: wave_sums, wave_table
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
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: slope_at
      procedure :: n_parameters
      procedure :: by_parameter
   end type polynomial_law

   type, extends(law_room) :: polynomial_room
      !> Slopes at the instants (n_time), and their sums with waves.
      real(wp), allocatable :: slope(:)
      type(wave_sums) :: sums
      type(wave_table) :: waves
      !> Where these do not serve: slopes at the instants of a block times the base functions there
      !> (n_coefficients, block).
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

   !> A spring has no memory: its derivative is made of sums of waves.
   subroutine reserve(self, fourier, work)
      class(polynomial_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work
      type(polynomial_room), allocatable :: room

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (room)
      associate (nc => fourier%n_coefficients)
         allocate (work%jacobian(nc, nc, self%n_elements), source=0.0_wp)
      end associate
      if (self%n_elements > 0) then
         allocate (room%slope(fourier%n_time))
         if (fourier%projects) then
            call room%waves%build(fourier)
            call room%sums%reserve(room%waves)
         else
            allocate (room%sloped(fourier%n_coefficients, block))
         end if
      end if
      call move_alloc(room, work%room)
   end subroutine reserve

   !> Forces from the elongations.
   subroutine evaluate(self, fourier, work)
      class(polynomial_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i

      if (self%n_elements == 0) return
      ! Before the instants: products of what is filtered would fold back into the retained
      ! harmonics.
      call low_pass(self, fourier, work%prediction)
      call fourier%to_time(self%n_elements, work%prediction, work%prediction_time, work%fft)
      do i = 1, self%n_elements
         call raise(self%n_elements, fourier%n_time, work%prediction_time(i, 1, 1), &
                    self%power(i), self%coefficient(i), self%n_elements, work%force_time(i, 1, 1))
      end do
      call fourier%to_coefficients(self%n_elements, work%force_time, work%force, work%fft)
      ! Every spring has a block in the derivative.
      work%state = pair_mixed
   end subroutine evaluate

   !> values = factor y**power at the instants, each array with a stride of its own. Powers are
   !> small: products along the instants take less than a power of each number.
   pure subroutine raise(stride, n_time, y, power, factor, stride_out, values)
      integer, intent(in) :: stride, n_time, power, stride_out
      real(wp), intent(in) :: y(stride, *), factor
      real(wp), intent(inout) :: values(stride_out, *)
      integer :: k, p

      values(1, :n_time) = factor
      do p = 1, power
         do k = 1, n_time
            values(1, k) = values(1, k)*y(1, k)
         end do
      end do
   end subroutine raise

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
      select type (room => work%room)
      type is (polynomial_room)
         do i = 1, self%n_elements
            call raise(self%n_elements, fourier%n_time, work%prediction_time(i, 1, 1), &
                       self%power(i) - 1, self%coefficient(i)*real(self%power(i), wp), 1, &
                       room%slope)
            call differentiate(fourier, room, work%jacobian(:, :, i))
         end do
      end select
      ! Inputs are rows here: what is filtered has no derivative.
      do j = 1, fourier%n_retained
         if (fourier%harmonic(j) <= self%highest_harmonic) cycle
         work%jacobian(fourier%column(j):fourier%column(j) + 1, :, :) = 0.0_wp
      end do
   end subroutine linearize

   !> G = analysis diag(slope) synthesis of an element, transposed: the first index is the input.
   subroutine differentiate(fourier, room, gain)
      type(fourier_type), intent(in) :: fourier
      type(polynomial_room), intent(inout) :: room
      real(wp), intent(inout), contiguous :: gain(:, :)
      integer :: first, k, last, nc

      nc = fourier%n_coefficients
      gain = 0.0_wp
      if (fourier%projects) then
         call room%sums%of_values(room%waves, room%slope)
         call room%sums%add_products(room%waves, nc, gain)
         return
      end if
      do first = 1, fourier%n_time, block
         last = min(first + block - 1, fourier%n_time)
         do k = first, last
            room%sloped(:, k - first + 1) = room%slope(k)*fourier%synthesis(:, k)
         end do
         call dgemm('N', 'T', nc, nc, last - first + 1, 1.0_wp, room%sloped, nc, &
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
