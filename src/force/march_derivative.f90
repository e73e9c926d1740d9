!> The derivative of marched friction as a march of its own, in single precision, for steps of
!> iterative solvers, which only have to be near:
!>
!>   d lambda_t = A_t (dy_t - dx) + p_t dy_n,     dx = dy_t - d lambda_t,
!>
!> from the derivative dx of the start of the last turn. In stick A = 1, p = 0; in slip
!> A = (mu p/|d|) n n^T and p = -mu e with the direction e and n at right angles to it; else both
!> are zero (fw_two_directions).
!>
!> Of many harmonics the block between all coefficients is larger than what caches hold, and each
!> product waits for it; the march has a few numbers an instant, and the waves on both sides of it
!> are those of all pairs. Pairs side by side fill the vectors of a processor: one group after the
!> other, which threads share.
module fw_march_derivative
   use fw_kinds, only: sp, wp
   use fw_single_product, only: group_count, group_width, lanes => panel_height, multiply_tile
   implicit none (type, external)
   private

   public :: march_derivative, numbers_of_instant, elements_of_group

   !> Pairs side by side.
   integer, parameter :: elements_of_group = lanes

   !> Of an instant: 1 in stick, (mu p/|d|) n, p_t, and 1 where the pair bears.
   integer, parameter :: numbers_of_instant = 6

   type :: march_derivative
      private
      integer :: n_coefficients = 0, n_time = 0
      !> Pairs that are marched, and their numbers: that of each pair among them or 0 (n_elements),
      !> and the pair of each.
      integer :: n_marched = 0
      integer, allocatable :: place(:), element(:)
      !> As pairs leave them: of the instants (numbers_of_instant, n_time, place), and of the start
      !> by all inputs (inputs, tangential component, place).
      real(wp), allocatable, public :: instants(:, :, :), starts(:, :, :)
      !> The same of the pairs of a group side by side: A_11, A_12, A_22, p_1, p_2, and 1 where the
      !> pair bears (lane, number, instant, group), and the starts. Lanes behind the last pair hold
      !> what was there before, and nothing of it comes out: their inputs are zero.
      real(sp), allocatable :: grouped(:, :, :, :), from(:, :, :, :)
      !> Base functions and analysis in the order in which tiles read them:
      !> (group_width, n_coefficients, groups of instants), (group_width, n_time, groups of
      !> coefficients).
      real(sp), allocatable :: base(:, :, :), analysis(:, :, :)
   contains
      procedure :: reserve
      procedure :: choose
      procedure :: keep
      procedure :: arrange
      procedure :: n_groups
      procedure :: place_of
      procedure :: element_of
      procedure :: multiply
   end type march_derivative

contains

   pure subroutine reserve(self, base, analysis, n_elements)
      class(march_derivative), intent(inout) :: self
      !> (n_coefficients, n_time)
      real(wp), intent(in) :: base(:, :), analysis(:, :)
      integer, intent(in) :: n_elements
      integer :: j, nc, nt

      nc = size(base, 1)
      nt = size(base, 2)
      self%n_coefficients = nc
      self%n_time = nt
      allocate (self%place(n_elements), self%element(n_elements), source=0)
      allocate (self%base(group_width, nc, group_count(nt)), source=0.0_sp)
      allocate (self%analysis(group_width, nt, group_count(nc)), source=0.0_sp)
      do j = 1, nt
         self%base(modulo(j - 1, group_width) + 1, :, (j - 1)/group_width + 1) = &
            real(base(:, j), sp)
      end do
      do j = 1, nc
         self%analysis(modulo(j - 1, group_width) + 1, :, (j - 1)/group_width + 1) = &
            real(analysis(j, :), sp)
      end do
   end subroutine reserve

   !> The pairs that will be kept.
   pure subroutine choose(self, chosen)
      class(march_derivative), intent(inout) :: self
      logical, intent(in) :: chosen(:)
      integer :: i, n

      n = 0
      self%place = 0
      do i = 1, size(chosen)
         if (.not. chosen(i)) cycle
         n = n + 1
         self%place(i) = n
         self%element(n) = i
      end do
      self%n_marched = n
      if (allocated(self%starts)) then
         if (size(self%starts, 3) >= n) return
         deallocate (self%instants, self%starts, self%grouped, self%from)
      end if
      associate (nc => self%n_coefficients, nt => self%n_time, g => self%n_groups())
         allocate (self%instants(numbers_of_instant, nt, lanes*g))
         allocate (self%starts(3*nc, 2, lanes*g))
         allocate (self%grouped(lanes, numbers_of_instant, nt, g), source=0.0_sp)
         allocate (self%from(lanes, 3*nc, 2, g), source=0.0_sp)
      end associate
   end subroutine choose

   !> The march of a chosen pair. Pairs may be kept by several threads at once.
   pure subroutine keep(self, element, instants, start)
      class(march_derivative), intent(inout) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: instants(:, :), start(:, :)

      self%instants(:, :, self%place(element)) = instants
      self%starts(:, :, self%place(element)) = start
   end subroutine keep

   !> The pairs of a group side by side, after all have been kept.
   pure subroutine arrange(self, group)
      class(march_derivative), intent(inout) :: self
      integer, intent(in) :: group
      integer :: k, l, place
      real(wp) :: a(3), length

      do l = 1, min(lanes, self%n_marched - (group - 1)*lanes)
         place = (group - 1)*lanes + l
         do k = 1, self%n_time
            associate (of => self%instants(:, k, place))
               a = of(1)*[1.0_wp, 0.0_wp, 1.0_wp]
               length = norm2(of(2:3))
               if (length > tiny(1.0_wp)) a = a + [of(2)*of(2), of(2)*of(3), of(3)*of(3)]/length
               self%grouped(l, :3, k, group) = real(a, sp)
               self%grouped(l, 4:, k, group) = real(of(4:), sp)
            end associate
         end do
         self%from(l, :, :, group) = real(self%starts(:, :, place), sp)
      end do
   end subroutine arrange

   pure integer function n_groups(self)
      class(march_derivative), intent(in) :: self

      n_groups = (self%n_marched + lanes - 1)/lanes
   end function n_groups

   !> The number of a pair among those that are marched, 0 where it is not.
   pure integer function place_of(self, element)
      class(march_derivative), intent(in) :: self
      integer, intent(in) :: element

      place_of = self%place(element)
   end function place_of

   !> A pair of a group, 0 behind the last one.
   pure integer function element_of(self, group, lane) result(element)
      class(march_derivative), intent(in) :: self
      integer, intent(in) :: group, lane
      integer :: place

      place = (group - 1)*lanes + lane
      element = 0
      if (place <= self%n_marched) element = self%element(place)
   end function element_of

   !> output = G input of the pairs of a group, nearly.
   subroutine multiply(self, group, input, output)
      class(march_derivative), intent(in) :: self
      integer, intent(in) :: group
      !> (coefficient and component, n_elements); those of other pairs stay as they are.
      real(wp), intent(in) :: input(:, :)
      real(wp), intent(inout) :: output(:, :)
      !> Coefficients and instants (lane, .., component), sizes of the pairs.
      real(sp), allocatable :: v(:, :, :), y(:, :, :)
      real(wp) :: largest(lanes)

      associate (nc => self%n_coefficients, nt => group_width*group_count(self%n_time))
         allocate (v(lanes, group_width*group_count(nc), 3), y(lanes, nt, 3))
         call load(self, group, input, largest, v)
         call to_instants(self, size(v, 2), v, y)
         call march(self%n_time, nt, nc, self%grouped(:, :, :, group), self%from(:, :, :, group), &
                    size(v, 2), v, y)
         call to_coefficients(self, size(v, 2), y, v)
         call store(self, group, largest, v, output)
      end associate
   end subroutine multiply

   !> Inputs side by side, to the order of one: single precision ends at 1e38.
   pure subroutine load(self, group, input, largest, v)
      type(march_derivative), intent(in) :: self
      integer, intent(in) :: group
      real(wp), intent(in) :: input(:, :)
      real(wp), intent(out) :: largest(lanes)
      real(sp), intent(out) :: v(:, :, :)
      integer :: c, i, l
      real(wp) :: factor

      largest = 0.0_wp
      do l = 1, lanes
         i = self%element_of(group, l)
         factor = 0.0_wp
         if (i > 0) then
            largest(l) = maxval(abs(input(:, i)))
            ! Its reciprocal is to be finite.
            if (largest(l) > tiny(1.0_wp)) factor = 1.0_wp/largest(l)
         end if
         associate (nc => self%n_coefficients)
            do c = 1, 3
               if (i > 0) v(l, :nc, c) = real(factor*input((c - 1)*nc + 1:c*nc, i), sp)
               if (i == 0) v(l, :nc, c) = 0.0_sp
            end do
         end associate
      end do
   end subroutine load

   pure subroutine store(self, group, largest, v, output)
      type(march_derivative), intent(in) :: self
      integer, intent(in) :: group
      real(wp), intent(in) :: largest(lanes)
      real(sp), intent(in) :: v(:, :, :)
      real(wp), intent(inout) :: output(:, :)
      integer :: c, i, l

      do l = 1, lanes
         i = self%element_of(group, l)
         if (i == 0) exit
         associate (nc => self%n_coefficients)
            do c = 1, 3
               output((c - 1)*nc + 1:c*nc, i) = largest(l)*v(l, :nc, c)
            end do
         end associate
      end do
   end subroutine store

   pure subroutine to_instants(self, n_stored, v, y)
      type(march_derivative), intent(in) :: self
      integer, intent(in) :: n_stored
      real(sp), intent(in) :: v(lanes, n_stored, 3)
      real(sp), intent(inout) :: y(lanes, group_width*size(self%base, 3), 3)
      integer :: c, g

      do c = 1, 3
         do g = 1, size(self%base, 3)
            call multiply_tile(self%n_coefficients, v(1, 1, c), self%base(1, 1, g), &
                               y(1, (g - 1)*group_width + 1, c))
         end do
      end do
   end subroutine to_instants

   pure subroutine to_coefficients(self, n_stored, y, v)
      type(march_derivative), intent(in) :: self
      integer, intent(in) :: n_stored
      real(sp), intent(in) :: y(lanes, group_width*size(self%base, 3), 3)
      real(sp), intent(inout) :: v(lanes, n_stored, 3)
      integer :: c, g

      do c = 1, 3
         do g = 1, size(self%analysis, 3)
            call multiply_tile(self%n_time, y(1, 1, c), self%analysis(1, 1, g), &
                               v(1, (g - 1)*group_width + 1, c))
         end do
      end do
   end subroutine to_coefficients

   !> Predicted forces in y become forces.
   pure subroutine march(n_time, n_stored, nc, numbers, from, n_columns, v, y)
      integer, intent(in) :: n_time, n_stored, nc, n_columns
      real(sp), intent(in) :: numbers(lanes, numbers_of_instant, n_time), from(lanes, 3*nc, 2)
      real(sp), intent(in) :: v(lanes, n_columns, 3)
      real(sp), intent(inout) :: y(lanes, n_stored, 3)
      real(sp), dimension(lanes) :: x_1, x_2
      real(sp) :: d_1, d_2, force_1, force_2
      integer :: c, i, j, k

      x_1 = 0.0_sp
      x_2 = 0.0_sp
      do c = 1, 3
         do j = 1, nc
            !$omp simd
            do i = 1, lanes
               x_1(i) = x_1(i) + from(i, (c - 1)*nc + j, 1)*v(i, j, c)
               x_2(i) = x_2(i) + from(i, (c - 1)*nc + j, 2)*v(i, j, c)
            end do
         end do
      end do
      do k = 1, n_time
         !$omp simd private(d_1, d_2, force_1, force_2)
         do i = 1, lanes
            d_1 = y(i, k, 1) - x_1(i)
            d_2 = y(i, k, 2) - x_2(i)
            force_1 = numbers(i, 1, k)*d_1 + numbers(i, 2, k)*d_2 + numbers(i, 4, k)*y(i, k, 3)
            force_2 = numbers(i, 2, k)*d_1 + numbers(i, 3, k)*d_2 + numbers(i, 5, k)*y(i, k, 3)
            x_1(i) = y(i, k, 1) - force_1
            x_2(i) = y(i, k, 2) - force_2
            y(i, k, 1) = force_1
            y(i, k, 2) = force_2
            y(i, k, 3) = numbers(i, 6, k)*y(i, k, 3)
         end do
      end do
   end subroutine march

end module fw_march_derivative
