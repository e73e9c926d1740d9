!> The floor of what a trace tells: its arithmetic done again in the same order, alone.
module floor_replay
   use floor_clock, only: processor_time
   use floor_contact, only: contact_kernels
   use floor_factors, only: factor_kernels
   use floor_matrices, only: matrix_kernels
   use floor_system, only: measured_system
   use floor_trace, only: event_type, n_parts, part_apply, part_build, part_condense, &
      part_linearize, part_newton, part_pinned, part_precondition, part_recover, part_residual, &
      trace_type
   use fw_kinds, only: wp
   use fw_plain_structure, only: plain_structure
   implicit none (type, external)
   private

   public :: replay_type, new_replay

   type :: replay_type
      type(plain_structure), pointer :: structure => null()
      type(matrix_kernels) :: matrices
      type(factor_kernels) :: factors
      type(contact_kernels) :: contact
      !> By BLAS, and by the kernels of the library (n_parts, 2).
      real(wp) :: seconds(n_parts, 2) = 0.0_wp
      !> What reading the clock takes.
      real(wp) :: empty = 0.0_wp
   contains
      procedure :: run
      procedure :: least
   end type replay_type

contains

   !> Room for a system, whose structure is a plain one.
   subroutine new_replay(system, mu, self)
      type(measured_system), intent(in) :: system
      !> Friction coefficient (n_pairs).
      real(wp), intent(in) :: mu(:)
      type(replay_type), intent(out) :: self

      select type (structure => system%problem%structure)
      type is (plain_structure)
         self%structure => structure
      class default
         error stop 'floor: the structure is none of one piece'
      end select
      call self%matrices%reserve(self%structure)
      associate (f => system%problem%fourier)
         call self%factors%reserve(self%structure%n_coordinates, self%structure%dynamic%rank, &
                                   f%n_retained, f%has_constant(), &
                                   merge(f%n_retained, 1, self%structure%forms_blocks))
      end associate
      call self%contact%reserve(system%problem, mu, &
                                allocated(system%work(system%problem%forces%pairs)%march))
      self%empty = system%empty
   end subroutine new_replay

   !> Once by BLAS and LAPACK alone, once by the kernels of the library.
   subroutine run(self, trace)
      class(replay_type), intent(inout) :: self
      type(trace_type), intent(in) :: trace
      integer :: i, way

      do way = 1, 2
         self%matrices%by_panels = way == 2
         self%factors%by_panels = way == 2
         self%contact%by_panels = way == 2
         do i = 1, trace%n_events
            call run_event(self, trace, trace%event(i), way)
         end do
      end do
   end subroutine run

   !> What a call overwrites is set apart from its time.
   subroutine run_event(self, trace, event, way)
      type(replay_type), intent(inout) :: self
      type(trace_type), intent(in) :: trace
      type(event_type), intent(in) :: event
      integer, intent(in) :: way
      real(wp) :: start

      if (event%snapshot > 0) call self%contact%prepare(trace%snapshot(event%snapshot))
      if (event%part == part_build) call self%factors%prepare(event%n_active, event%is_cheap)
      if (event%part == part_precondition) call self%factors%prepare_solution(event%n_active, &
                                                                              event%is_cheap)
      start = processor_time()
      if (event%forms_blocks) call self%contact%differentiate(.false.)
      select case (event%part)
      case (part_condense)
         call self%matrices%condense(self%structure)
      case (part_residual)
         call self%matrices%multiply_all(self%structure%basis%blocks)
         call self%contact%evaluate()
      case (part_linearize)
         call self%contact%differentiate(event%waits)
      case (part_pinned)
         ! Nothing but the blocks that are formed in it.
      case (part_build)
         call self%factors%factor()
      case (part_apply)
         call self%matrices%multiply(event%n_active, event%n_used, event%is_cheap, &
                                     self%structure%basis%blocks)
         call self%contact%multiply(event%is_cheap)
      case (part_precondition)
         call self%factors%solve()
      case (part_newton)
         call self%matrices%orthogonalize(event%n_active, event%n_basis)
      case (part_recover)
         call self%matrices%recover(self%structure)
      case default
         error stop 'floor: no such part'
      end select
      associate (seconds => self%seconds(event%part, way))
         seconds = seconds + max(0.0_wp, processor_time() - start - self%empty)
      end associate
   end subroutine run_event

   !> The faster way of each part [s].
   pure function least(self) result(seconds)
      class(replay_type), intent(in) :: self
      real(wp) :: seconds(n_parts)

      seconds = minval(self%seconds, dim=2)
   end function least

end module floor_replay
