!> The derivative of a law in single precision, for steps of iterative solvers, which only have to
!> be near: half the memory is read, and of what was stored only the rows and columns that count.
!>
!> Products with the blocks of many harmonics wait for memory: at 192 pairs and 17 harmonics those
!> with the whole blocks in double precision take 10 times as long.
module fw_near_derivative
   use fw_force_law, only: force_workspace
   use fw_force_law, only: pair_mixed
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   use fw_lapack, only: sgemv
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)
   private

   public :: near_derivative

   type :: near_derivative
      private
      !> Coefficients of a component, and most inputs of an element.
      integer :: n_coefficients = 0, n_most = 0
      !> Components of each element that exist, and those of them whose force is computed
      !> (n_elements).
      integer, allocatable :: n_inputs(:), n_outputs(:)
      !> (coefficient and component of the output, then of the input; element).
      real(sp), allocatable :: block(:, :)
   contains
      procedure :: take
      procedure :: multiply
   end type near_derivative

contains

   !> The blocks of the mixed elements, after `linearize`.
   subroutine take(self, row, pins_last, work)
      class(near_derivative), intent(inout) :: self
      !> Row of each component of each element, 0 where there is none.
      integer, intent(in) :: row(:, :)
      !> The last component of an element that bears throughout has the derivative 1, and no other
      !> component acts on it (rigid pairs).
      logical, intent(in) :: pins_last
      type(force_workspace), intent(in) :: work
      integer :: i

      if (.not. allocated(work%jacobian)) return
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

      if (work%linear_state(element) /= pair_mixed) return
      last = size(row)
      self%n_inputs(element) = count(row > 0)
      self%n_outputs(element) = self%n_inputs(element)
      if (pins_last .and. row(last) > 0) then
         if (work%always_closed(element)) self%n_outputs(element) = self%n_inputs(element) - 1
      end if
      call copy_block(self%n_coefficients, row, self%n_outputs(element), &
                      work%jacobian(:, :, element), self%n_outputs(element)*self%n_coefficients, &
                      self%block(:, element))
   end subroutine take_one

   !> Components that exist, turned over: a product then runs down the columns.
   pure subroutine copy_block(nc, row, n_outputs, jacobian, n_rows, block)
      integer, intent(in) :: nc, n_outputs, n_rows
      integer, intent(in) :: row(:)
      !> (input, output)
      real(wp), intent(in) :: jacobian(:, :)
      real(sp), intent(inout) :: block(n_rows, *)
      integer :: c_in, c_out, i, j, to_column, to_row

      to_row = 0
      do c_out = 1, size(row)
         if (row(c_out) == 0) cycle
         if (to_row == n_outputs*nc) exit
         to_column = 0
         do c_in = 1, size(row)
            if (row(c_in) == 0) cycle
            do j = 1, nc
               do i = 1, nc
                  block(to_row + j, to_column + i) = real(jacobian((c_in - 1)*nc + i, &
                                                                   (c_out - 1)*nc + j), sp)
               end do
            end do
            to_column = to_column + nc
         end do
         to_row = to_row + nc
      end do
   end subroutine copy_block

   !> output = G input of a mixed element, nearly.
   subroutine multiply(self, row, element, work)
      class(near_derivative), intent(in) :: self
      integer, intent(in) :: row(:)
      integer, intent(in) :: element
      type(force_workspace), intent(inout) :: work
      real(sp) :: input(self%n_most), output(self%n_most)
      real(wp) :: largest
      integer :: c, nc, n_in, n_out, place

      nc = self%n_coefficients
      n_in = nc*self%n_inputs(element)
      n_out = nc*self%n_outputs(element)
      associate (from => work%input(:, element), to => work%output(:, element))
         ! To the order of one, because single precision ends at 1e38.
         largest = maxval(abs(from))
         if (.not. largest > 0.0_wp) then
            to = 0.0_wp
            return
         end if
         place = 0
         do c = 1, size(row)
            if (row(c) == 0) cycle
            input(place + 1:place + nc) = real(from((c - 1)*nc + 1:c*nc)/largest, sp)
            place = place + nc
         end do
         call sgemv('N', n_out, n_in, 1.0_sp, self%block(1, element), n_out, input, 1, &
                    0.0_sp, output, 1)
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
   end subroutine multiply

   subroutine reserve(self, row, n_coefficients)
      class(near_derivative), intent(inout) :: self
      integer, intent(in) :: row(:, :), n_coefficients

      if (allocated(self%block)) return
      self%n_coefficients = n_coefficients
      self%n_most = n_coefficients*maxval(count(row > 0, dim=1))
      allocate (self%n_inputs(size(row, 2)), self%n_outputs(size(row, 2)), source=0)
      allocate (self%block(self%n_most**2, size(row, 2)))
   end subroutine reserve

end module fw_near_derivative
