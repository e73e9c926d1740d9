!> Polynomial forces of several displacements: sums of terms c x_1**e_1 x_2**e_2 .., each a force on
!> one row, or a potential, whose gradient the forces are.
module fw_term_law
   use fw_force_law, only: force_workspace, law_facts
   use fw_fourier, only: fourier_type
   use fw_instant_law, only: element_motion, instant_law
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: element_term, most_factors, new_terms, term_law

   !> Factors of a term.
   integer, parameter :: most_factors = 8

   !> A product of powers of the displacements of one element.
   type :: element_term
      integer :: element = 0
      !> Place of its coefficient among those of a sector.
      integer :: given = 0
      !> Input that the force acts on; 0: the term is a potential.
      integer :: on = 0
      !> Different inputs, and their powers.
      integer :: n = 0
      integer :: input(most_factors) = 0, power(most_factors) = 0
      !> +1 or -1: signs of the dofs.
      real(wp) :: sign = 1.0_wp
   end type element_term

   type, extends(instant_law) :: term_law
      !> Sorted by the element, those of element i being first(i) .. first(i + 1) - 1.
      type(element_term), allocatable :: term(:)
      integer, allocatable :: first(:)
      !> Of each term, with its sign.
      real(wp), allocatable :: factor(:)
   contains
      procedure :: act
      procedure :: n_parameters
      procedure :: find_parameter
      procedure :: by_parameter
   end type term_law

contains

   !> Terms of one sector, repeated for as many as there are.
   pure type(term_law) function new_terms(n_in, n_elements, n_sectors, term, coefficient) &
      result(self)
      integer, intent(in) :: n_in
      !> Of one sector.
      integer, intent(in) :: n_elements
      integer, intent(in) :: n_sectors
      type(element_term), intent(in) :: term(:)
      !> Of the terms as they are given.
      real(wp), intent(in) :: coefficient(:)
      integer :: e, i, n

      call self%take_inputs(n_in, n_elements*n_sectors, .false.)
      allocate (self%term(size(term)*n_sectors), self%first(self%n_elements + 1))
      n = 0
      do e = 1, self%n_elements
         self%first(e) = n + 1
         do i = 1, size(term)
            if (term(i)%element /= modulo(e - 1, n_elements) + 1) cycle
            n = n + 1
            self%term(n) = term(i)
            self%term(n)%element = e
         end do
      end do
      self%first(self%n_elements + 1) = n + 1
      self%factor = self%term%sign*coefficient(self%term%given)
      self%has_potential = all(term%on == 0)
      n = maxval([0, (degree(term(i)), i=1, size(term))])
      self%facts = law_facts(is_odd=all([(modulo(degree(term(i)), 2) == 1, i=1, size(term))]))
      ! From (degree + 1) H + 1 instants on, polynomials are sampled without any error.
      self%facts%fewest_instants = 0
      self%facts%instants_per_harmonic = n + 1
      self%facts%instants_with_separation = n + 1
      self%facts%further_instants = 2
   end function new_terms

   !> Of the forces.
   pure integer function degree(term)
      type(element_term), intent(in) :: term

      degree = sum(term%power(:term%n)) - merge(1, 0, term%on == 0)
   end function degree

   subroutine act(self, motion)
      class(term_law), intent(in) :: self
      type(element_motion), intent(inout) :: motion
      integer :: i

      motion%force = 0.0_wp
      do i = self%first(motion%element), self%first(motion%element + 1) - 1
         if (self%term(i)%on > 0) then
            call add_force(self%term(i), self%factor(i), motion)
         else
            call add_gradient(self%term(i), self%factor(i), motion)
         end if
      end do
   end subroutine act

   !> A force on one row, and its slopes.
   pure subroutine add_force(term, factor, motion)
      type(element_term), intent(in) :: term
      real(wp), intent(in) :: factor
      type(element_motion), intent(inout) :: motion
      integer :: j, k

      do k = 1, motion%n_time
         motion%force(term%on, k) = motion%force(term%on, k) + &
                                    factor*product_of(term, motion%u(:, k), 0, 0)
         if (.not. motion%wants_slopes) cycle
         do j = 1, term%n
            associate (slope => motion%by_u(term%input(j), term%on, k))
               slope = slope + factor*product_of(term, motion%u(:, k), j, 0)
            end associate
         end do
      end do
   end subroutine add_force

   !> Forces of a potential, and its second derivatives.
   pure subroutine add_gradient(term, factor, motion)
      type(element_term), intent(in) :: term
      real(wp), intent(in) :: factor
      type(element_motion), intent(inout) :: motion
      integer :: i, j, k

      do k = 1, motion%n_time
         do i = 1, term%n
            associate (force => motion%force(term%input(i), k))
               force = force + factor*product_of(term, motion%u(:, k), i, 0)
            end associate
            if (.not. motion%wants_slopes) cycle
            do j = 1, term%n
               associate (slope => motion%by_u(term%input(j), term%input(i), k))
                  slope = slope + factor*product_of(term, motion%u(:, k), i, j)
               end associate
            end do
         end do
      end do
   end subroutine add_gradient

   !> The product of the powers, differentiated by the factors i and j (0: not).
   pure real(wp) function product_of(term, u, i, j) result(value)
      type(element_term), intent(in) :: term
      real(wp), intent(in) :: u(:)
      integer, intent(in) :: i, j
      integer :: m, power

      value = 1.0_wp
      do m = 1, term%n
         power = term%power(m)
         if (m == i) then
            value = value*power
            power = power - 1
         end if
         if (m == j) then
            value = value*power
            power = power - 1
         end if
         if (power > 0) value = value*u(term%input(m))**power
      end do
   end function product_of

   !> Terms of the element that has most.
   pure integer function n_parameters(self) result(n)
      class(term_law), intent(in) :: self

      n = 0
      if (self%n_elements > 0) n = maxval(self%first(2:) - self%first(:self%n_elements))
   end function n_parameters

   pure subroutine find_parameter(self, value, element, number)
      class(term_law), intent(in) :: self
      integer, intent(in) :: value
      integer, intent(out) :: element, number
      integer :: at

      at = findloc(self%term%given, value, dim=1)
      element = self%term(at)%element
      number = at - self%first(element) + 1
   end subroutine find_parameter

   !> The force of a unit coefficient of one term of each element.
   subroutine by_parameter(self, number, fourier, work, force)
      class(term_law), intent(in) :: self
      integer, intent(in) :: number
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(in) :: work
      real(wp), intent(inout) :: force(:, :, :)
      type(element_motion) :: motion
      real(wp), allocatable :: values(:, :, :)
      integer :: e, i

      allocate (values, mold=work%force_time)
      values = 0.0_wp
      motion%n_time = fourier%n_time
      do e = 1, self%n_elements
         i = self%first(e) + number - 1
         if (i >= self%first(e + 1)) cycle
         motion%u = work%prediction_time(e, :, :)
         motion%force = 0.0_wp*motion%u
         if (self%term(i)%on > 0) then
            call add_force(self%term(i), self%term(i)%sign, motion)
         else
            call add_gradient(self%term(i), self%term(i)%sign, motion)
         end if
         values(e, :, :) = motion%force
      end do
      call fourier%to_coefficients(self%n_elements*self%n_components, values, force)
   end subroutine by_parameter

end module fw_term_law
