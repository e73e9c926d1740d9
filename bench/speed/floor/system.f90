!> A balance whose calls are timed and written down.
module floor_system
   use floor_clock, only: processor_time, time_of_reading
   use floor_trace, only: event_type, n_parts, part_apply, part_build, part_condense, &
      part_linearize, part_newton, part_pinned, part_precondition, part_residual, trace_type
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_error, only: error_type
   use fw_force_law, only: pair_mixed
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: measured_system, new_measured_system

   type, extends(balance_state) :: measured_system
      type(trace_type) :: trace
      integer :: calls(n_parts) = 0
      real(wp) :: seconds(n_parts) = 0.0_wp
      !> What reading the clock takes, and what measuring has taken in all.
      real(wp) :: empty = 0.0_wp
      real(wp) :: overhead = 0.0_wp
      !> When the last call ended.
      real(wp), private :: ended = 0.0_wp
      !> Products of the solution at work: vectors of the Krylov basis.
      integer, private :: n_products = 0
   contains
      procedure :: set_frequency
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: build_preconditioner
      procedure :: apply
      procedure :: precondition
   end type measured_system

   !> Relative residual of a linear solution from which cheaper products serve, as in
   !> src/balance/balance_linear.f90.
   real(wp), parameter :: near_enough = 5.0e-5_wp

contains

   !> A system of the same problem.
   subroutine new_measured_system(system, self)
      type(balance_state), intent(in) :: system
      type(measured_system), intent(out) :: self

      call new_balance_state(system%problem, self%balance_state)
      call self%trace%clear()
      self%empty = time_of_reading()
   end subroutine new_measured_system

   !> Add what has passed since a time.
   subroutine count_call(self, part, start)
      type(measured_system), intent(inout) :: self
      integer, intent(in) :: part
      real(wp), intent(in) :: start

      self%ended = processor_time()
      self%calls(part) = self%calls(part) + 1
      self%seconds(part) = self%seconds(part) + max(0.0_wp, self%ended - start - self%empty)
   end subroutine count_call

   !> What has passed since then has written the call down, and the clock was read three times.
   subroutine count_overhead(self)
      type(measured_system), intent(inout) :: self

      self%overhead = self%overhead + processor_time() - self%ended + 2.0_wp*self%empty
   end subroutine count_overhead

   subroutine set_frequency(self, parameter, error)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: start

      start = processor_time()
      call self%balance_state%set_frequency(parameter, error)
      call count_call(self, part_condense, start)
      call self%trace%add(event_type(part=part_condense))
      call count_overhead(self)
   end subroutine set_frequency

   subroutine residual(self, x, r)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      real(wp) :: start

      start = processor_time()
      call self%balance_state%residual(x, r)
      call count_call(self, part_residual, start)
      associate (work => self%work(self%problem%forces%pairs))
         call self%trace%add_residual(work%prediction, work%x, work%turns)
      end associate
      call count_overhead(self)
   end subroutine residual

   subroutine linearize(self, n_linear)
      class(measured_system), intent(inout) :: self
      integer, intent(out) :: n_linear
      real(wp) :: start

      start = processor_time()
      call self%balance_state%linearize(n_linear)
      call count_call(self, part_linearize, start)
      call self%trace%add_derivative(computed_outputs(self), blocks_wait(self))
      call count_overhead(self)
   end subroutine linearize

   !> Whether the blocks of the pairs between all coefficients are not formed yet.
   pure logical function blocks_wait(self)
      class(balance_state), intent(in) :: self

      blocks_wait = self%work(self%problem%forces%pairs)%waits
   end function blocks_wait

   !> Components of the mixed pairs whose forces are computed: not the normal one of a pair that
   !> bears throughout.
   function computed_outputs(self) result(n_outputs)
      type(measured_system), intent(in) :: self
      integer :: n_outputs(self%problem%n_pairs)
      integer :: i

      n_outputs = 0
      associate (work => self%work(self%problem%forces%pairs), row => self%problem%joint%row)
         do i = 1, self%problem%n_pairs
            if (work%linear_state(i) /= pair_mixed) cycle
            n_outputs(i) = count(row(:, i) > 0)
            if (.not. (row(3, i) > 0 .and. self%pins_normals)) cycle
            if (work%always_closed(i)) n_outputs(i) = n_outputs(i) - 1
         end do
      end associate
   end function computed_outputs

   subroutine reduce(self, r, rhs)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)
      real(wp) :: start
      logical :: waited

      waited = blocks_wait(self)
      start = processor_time()
      call self%balance_state%reduce(r, rhs)
      call count_call(self, part_pinned, start)
      if (waited .and. .not. blocks_wait(self)) then
         call self%trace%add(event_type(part=part_pinned, forms_blocks=.true.))
      end if
      call count_overhead(self)
   end subroutine reduce

   subroutine expand(self, r, solution, step)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)
      real(wp) :: start

      start = processor_time()
      call self%balance_state%expand(r, solution, step)
      call count_call(self, part_pinned, start)
      call end_solution(self)
      call count_overhead(self)
   end subroutine expand

   subroutine build_preconditioner(self)
      class(measured_system), intent(inout) :: self
      real(wp) :: start
      logical :: waited

      waited = blocks_wait(self)
      start = processor_time()
      call self%balance_state%build_preconditioner()
      call count_call(self, part_build, start)
      call end_solution(self)
      call self%trace%add(event_type(part=part_build, n_active=self%active%n_active, &
                                     n_used=self%active%n_used, &
                                     is_cheap=self%preconditioner%is_split, &
                                     forms_blocks=waited .and. .not. blocks_wait(self)))
      call count_overhead(self)
   end subroutine build_preconditioner

   !> The last product of a solution checks it: it adds no vector to the basis.
   subroutine end_solution(self)
      type(measured_system), intent(inout) :: self

      call self%trace%drop_last(part_newton)
      self%n_products = 0
   end subroutine end_solution

   !> With the vector that the product adds to the Krylov basis.
   subroutine apply(self, vector, product)
      class(measured_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      real(wp) :: start
      logical :: waited

      waited = blocks_wait(self)
      start = processor_time()
      call self%balance_state%apply(vector, product)
      call count_call(self, part_apply, start)
      self%n_products = self%n_products + 1
      associate (a => self%active)
         call self%trace%add(event_type(part=part_apply, n_active=a%n_active, n_used=a%n_used, &
                                        is_cheap=is_near(self), &
                                        forms_blocks=waited .and. .not. blocks_wait(self)))
         call self%trace%add(event_type(part=part_newton, n_active=a%n_active, &
                                        n_basis=self%n_products))
      end associate
      call count_overhead(self)
   end subroutine apply

   !> Whether a product only has to be near, and the structure has such products.
   logical function is_near(self)
      type(measured_system), intent(in) :: self

      is_near = self%nearly .and. self%asked >= near_enough
      if (is_near) is_near = self%splits() .or. self%problem%structure%has_near_product()
   end function is_near

   subroutine precondition(self, vector)
      class(measured_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      real(wp) :: start

      start = processor_time()
      call self%balance_state%precondition(vector)
      call count_call(self, part_precondition, start)
      ! Of the order of its own factors, which may be kept from other active coordinates.
      call self%trace%add(event_type(part=part_precondition, n_active=self%preconditioner%n, &
                                     is_cheap=self%preconditioner%is_split))
      call count_overhead(self)
   end subroutine precondition

end module floor_system
