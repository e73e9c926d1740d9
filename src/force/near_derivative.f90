!> The derivative of a law in single precision, for steps of iterative solvers, which only have to
!> be near: half the memory is read, and of what was stored only the rows and columns that count.
!>
!> Products with the blocks of many harmonics wait for memory: at 192 pairs and 17 harmonics those
!> with the whole blocks in double precision take 10 times as long.
module fw_near_derivative
   use fw_force_law, only: force_workspace, pair_mixed
   use fw_kinds, only: sp, wp
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: near_derivative

   !> Columns are filled up to a multiple of this, the widest vectors.
   integer, parameter :: lanes = 16
   !> Inputs of an element for which room of a fixed size serves, which needs no allocation.
   integer, parameter :: usual = 256

   type :: near_derivative
      private
      !> Coefficients of a component, and most inputs of an element.
      integer :: n_coefficients = 0, n_most = 0
      !> Components of each element that exist, and those of them whose force is computed
      !> (n_elements).
      integer, allocatable :: n_inputs(:), n_outputs(:)
      !> (coefficient and component of the input, filled up, then of the output; element).
      real(sp), allocatable :: block(:, :)
      !> Whether the law marches what it keeps of it (fw_march_derivative).
      logical :: marches = .false.
   contains
      procedure :: take
      procedure :: n_groups
      procedure :: is_marched
      procedure :: element_of
      procedure :: multiply
      procedure :: multiply_group
   end type near_derivative

contains

   !> The blocks of the mixed elements, after `linearize`.
   subroutine take(self, row, pins_last, is_altered, work)
      class(near_derivative), intent(inout) :: self
      !> Row of each component of each element, 0 where there is none.
      integer, intent(in) :: row(:, :)
      !> The last component of an element that bears throughout has the derivative 1, and no other
      !> component acts on it (rigid pairs).
      logical, intent(in) :: pins_last
      !> The blocks are no longer as the law left them.
      logical, intent(in) :: is_altered
      type(force_workspace), intent(in) :: work
      integer :: i

      self%marches = allocated(work%march) .and. .not. is_altered
      if (.not. allocated(work%jacobian)) return
      if (.not. any([(work%linear_state(i) == pair_mixed .and. .not. self%is_marched(i, work), &
                      i=1, size(row, 2))])) return
      call reserve(self, row, size(work%input, 1)/size(row, 1))
      if (size(row, 2) < pairs_for_threads) then
         do i = 1, size(row, 2)
            call take_one(self, row(:, i), pins_last, i, work)
         end do
         return
      end if
      !$omp parallel do default(none) shared(self, row, pins_last, work) private(i) &
      !$omp schedule(dynamic, 8)
      do i = 1, size(row, 2)
         call take_one(self, row(:, i), pins_last, i, work)
      end do
      !$omp end parallel do
   end subroutine take

   subroutine take_one(self, row, pins_last, element, work)
      class(near_derivative), intent(inout) :: self
      integer, intent(in) :: row(:)
      logical, intent(in) :: pins_last
      integer, intent(in) :: element
      type(force_workspace), intent(in) :: work
      integer :: last

      if (work%linear_state(element) /= pair_mixed .or. self%is_marched(element, work)) return
      last = size(row)
      self%n_inputs(element) = count(row > 0)
      self%n_outputs(element) = self%n_inputs(element)
      if (pins_last .and. row(last) > 0) then
         if (work%always_closed(element)) self%n_outputs(element) = self%n_inputs(element) - 1
      end if
      call copy_block(self%n_coefficients, row, self%n_outputs(element), &
                      work%jacobian(:, :, element), &
                      padded(self%n_inputs(element)*self%n_coefficients), self%block(:, element))
   end subroutine take_one

   !> Components that exist, in the order in which they lie: turned over they would take longer to
   !> copy than products gain.
   pure subroutine copy_block(nc, row, n_outputs, jacobian, n_rows, block)
      integer, intent(in) :: nc, n_outputs, n_rows
      integer, intent(in) :: row(:)
      !> (input, output)
      real(wp), intent(in) :: jacobian(:, :)
      real(sp), intent(inout) :: block(n_rows, *)
      integer :: c_in, c_out, j, to_column, to_row

      to_column = 0
      do c_out = 1, size(row)
         if (row(c_out) == 0) cycle
         if (to_column == n_outputs*nc) exit
         do j = 1, nc
            to_row = 0
            do c_in = 1, size(row)
               if (row(c_in) == 0) cycle
               block(to_row + 1:to_row + nc, to_column + j) = &
                  real(jacobian((c_in - 1)*nc + 1:c_in*nc, (c_out - 1)*nc + j), sp)
               to_row = to_row + nc
            end do
         end do
         to_column = to_column + nc
      end do
   end subroutine copy_block

   !> Groups of elements that are marched together.
   pure integer function n_groups(self, work)
      class(near_derivative), intent(in) :: self
      type(force_workspace), intent(in) :: work

      n_groups = 0
      if (self%marches) n_groups = work%march%n_groups()
   end function n_groups

   pure logical function is_marched(self, element, work)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: element
      type(force_workspace), intent(in) :: work

      is_marched = .false.
      if (self%marches) is_marched = work%march%place_of(element) > 0
   end function is_marched

   !> Of a group, 0 behind its last one.
   pure integer function element_of(self, group, number, work) result(element)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: group, number
      type(force_workspace), intent(in) :: work

      element = 0
      if (self%marches) element = work%march%element_of(group, number)
   end function element_of

   !> output = G input of the elements of a group, nearly.
   subroutine multiply_group(self, group, work)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: group
      type(force_workspace), intent(inout) :: work

      if (self%marches) call work%march%multiply(group, work%input, work%output)
   end subroutine multiply_group

   !> output = G input of a mixed element, nearly.
   subroutine multiply(self, row, element, work)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: row(:)
      integer, intent(in) :: element
      type(force_workspace), intent(inout) :: work
      real(sp) :: usual_input(usual), usual_output(usual)
      real(sp), allocatable :: input(:), output(:)

      if (self%n_most <= usual) then
         call multiply_in(self, row, element, usual_input, usual_output, work)
      else
         allocate (input(padded(self%n_most)), output(self%n_most))
         call multiply_in(self, row, element, input, output, work)
      end if
   end subroutine multiply

   pure subroutine multiply_in(self, row, element, input, output, work)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: row(:)
      integer, intent(in) :: element
      !> Room.
      real(sp), intent(inout), contiguous :: input(:), output(:)
      type(force_workspace), intent(inout) :: work
      real(wp) :: largest
      integer :: c, i, nc, n_in, n_out, place

      nc = self%n_coefficients
      n_in = nc*self%n_inputs(element)
      n_out = nc*self%n_outputs(element)
      associate (from => work%input(:, element), to => work%output(:, element))
         ! To the order of one, because single precision ends at 1e38.
         largest = 0.0_wp
         !$omp simd reduction(max:largest)
         do i = 1, size(from)
            largest = max(largest, abs(from(i)))
         end do
         ! Its reciprocal is to be finite.
         if (.not. largest > tiny(1.0_wp)) then
            to = 0.0_wp
            return
         end if
         place = 0
         do c = 1, size(row)
            if (row(c) == 0) cycle
            input(place + 1:place + nc) = real(from((c - 1)*nc + 1:c*nc)*(1.0_wp/largest), sp)
            place = place + nc
         end do
         input(n_in + 1:padded(n_in)) = 0.0_sp
         call multiply_transposed(padded(n_in), n_out, self%block(1, element), input, output)
         place = 0
         do c = 1, size(row)
            if (row(c) == 0) then
               to((c - 1)*nc + 1:c*nc) = 0.0_wp
            else if (place < n_out) then
               to((c - 1)*nc + 1:c*nc) = largest*output(place + 1:place + nc)
               place = place + nc
            else
               to((c - 1)*nc + 1:c*nc) = from((c - 1)*nc + 1:c*nc)
            end if
         end do
      end associate
   end subroutine multiply_in

   !> output = block^T input. BLAS is written for larger blocks.
   pure subroutine multiply_transposed(n_rows, n_columns, block, input, output)
      !> A multiple of `lanes`.
      integer, intent(in) :: n_rows
      integer, intent(in) :: n_columns
      real(sp), intent(in) :: block(n_rows, n_columns), input(n_rows)
      real(sp), intent(inout) :: output(n_columns)
      real(sp) :: s1, s2, s3, s4
      integer :: i, j, n_whole

      ! Four columns at a time, so that no sum waits for its last term.
      n_whole = n_columns - modulo(n_columns, 4)
      do j = 1, n_whole, 4
         s1 = 0.0_sp
         s2 = 0.0_sp
         s3 = 0.0_sp
         s4 = 0.0_sp
         !$omp simd reduction(+: s1, s2, s3, s4)
         do i = 1, n_rows
            s1 = s1 + block(i, j)*input(i)
            s2 = s2 + block(i, j + 1)*input(i)
            s3 = s3 + block(i, j + 2)*input(i)
            s4 = s4 + block(i, j + 3)*input(i)
         end do
         output(j:j + 3) = [s1, s2, s3, s4]
      end do
      do j = n_whole + 1, n_columns
         s1 = 0.0_sp
         !$omp simd reduction(+: s1)
         do i = 1, n_rows
            s1 = s1 + block(i, j)*input(i)
         end do
         output(j) = s1
      end do
   end subroutine multiply_transposed

   !> Rows of a column in memory.
   pure integer function padded(n)
      integer, intent(in) :: n

      padded = lanes*((n + lanes - 1)/lanes)
   end function padded

   subroutine reserve(self, row, n_coefficients)
      class(near_derivative), intent(inout) :: self
      integer, intent(in) :: row(:, :), n_coefficients

      if (allocated(self%block)) return
      self%n_coefficients = n_coefficients
      self%n_most = n_coefficients*maxval(count(row > 0, dim=1))
      allocate (self%n_inputs(size(row, 2)), self%n_outputs(size(row, 2)), source=0)
      ! What fills up the columns stays zero.
      allocate (self%block(padded(self%n_most)*self%n_most, size(row, 2)), source=0.0_sp)
   end subroutine reserve

end module fw_near_derivative
