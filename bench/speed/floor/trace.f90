!> What the solution of a point has done, in its order: enough to do its arithmetic again.
module floor_trace
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: event_type, snapshot_type, trace_type
   public :: n_parts, part_names, part_condense, part_residual, part_linearize, part_pinned, &
      part_build, part_apply, part_precondition, part_newton, part_guess, part_recover

   integer, parameter :: n_parts = 10
   integer, parameter :: part_condense = 1, part_residual = 2, part_linearize = 3, &
      part_pinned = 4, part_build = 5, part_apply = 6, part_precondition = 7, part_newton = 8, &
      part_guess = 9, part_recover = 10
   character(*), parameter :: part_names(n_parts) = [character(30) :: 'condensation', 'residual', &
      'derivative of the forces', 'rows solved at once', 'preconditioner: build', &
      'product with the derivative', 'preconditioner: solve', 'Newton and GMRES', 'guess', &
      'recovery']

   !> One call.
   type :: event_type
      integer :: part = 0
      !> Columns and rows of the product; of the preconditioner the order of its factors.
      integer :: n_active = 0, n_used = 0
      !> Vectors of the Krylov basis so far.
      integer :: n_basis = 0
      !> Of a product, whether it only has to be near; of factors, whether two serve all harmonics.
      logical :: is_cheap = .false.
      !> Of a derivative, whether its blocks wait; of what follows, whether they are formed in it.
      logical :: waits = .false., forms_blocks = .false.
      !> Number of its snapshot; 0: the last one.
      integer :: snapshot = 0
   end type event_type

   !> What the arithmetic of the pairs depends on.
   type :: snapshot_type
      !> Of a residual: coefficients of the predicted forces (n_pairs, 3, n_coefficients), where
      !> the march ended (n_pairs, 2), and its turns (n_pairs).
      real(wp), allocatable :: prediction(:, :, :), x(:, :)
      integer, allocatable :: turns(:)
      !> Of a derivative: components whose forces are computed, of the mixed pairs (n_pairs).
      integer, allocatable :: n_outputs(:)
   end type snapshot_type

   type :: trace_type
      integer :: n_events = 0, n_snapshots = 0
      type(event_type), allocatable :: event(:)
      type(snapshot_type), allocatable :: snapshot(:)
   contains
      procedure :: clear
      procedure :: add
      procedure :: drop_last
      procedure :: add_residual
      procedure :: add_derivative
   end type trace_type

   integer, parameter :: first_room = 64

contains

   !> Nothing has been done.
   subroutine clear(self)
      class(trace_type), intent(inout) :: self

      if (.not. allocated(self%event)) allocate (self%event(first_room), self%snapshot(first_room))
      self%n_events = 0
      self%n_snapshots = 0
   end subroutine clear

   subroutine add(self, event)
      class(trace_type), intent(inout) :: self
      type(event_type), intent(in) :: event
      type(event_type), allocatable :: larger(:)

      if (self%n_events == size(self%event)) then
         allocate (larger(2*size(self%event)))
         larger(:self%n_events) = self%event
         call move_alloc(larger, self%event)
      end if
      self%n_events = self%n_events + 1
      self%event(self%n_events) = event
   end subroutine add

   !> The last call, where it is of this part.
   subroutine drop_last(self, part)
      class(trace_type), intent(inout) :: self
      integer, intent(in) :: part

      if (self%n_events == 0) return
      if (self%event(self%n_events)%part == part) self%n_events = self%n_events - 1
   end subroutine drop_last

   subroutine add_residual(self, prediction, x, turns)
      class(trace_type), intent(inout) :: self
      real(wp), intent(in) :: prediction(:, :, :), x(:, :)
      integer, intent(in) :: turns(:)

      call new_snapshot(self)
      associate (s => self%snapshot(self%n_snapshots))
         s%prediction = prediction
         s%x = x
         s%turns = turns
      end associate
      call self%add(event_type(part=part_residual, snapshot=self%n_snapshots))
   end subroutine add_residual

   subroutine add_derivative(self, n_outputs, waits)
      class(trace_type), intent(inout) :: self
      integer, intent(in) :: n_outputs(:)
      !> Whether the blocks between all coefficients are not formed yet.
      logical, intent(in) :: waits

      call new_snapshot(self)
      self%snapshot(self%n_snapshots)%n_outputs = n_outputs
      call self%add(event_type(part=part_linearize, waits=waits, snapshot=self%n_snapshots))
   end subroutine add_derivative

   !> Room for one more; what a point before left in it is overwritten.
   subroutine new_snapshot(self)
      type(trace_type), intent(inout) :: self
      type(snapshot_type), allocatable :: larger(:)
      integer :: i

      if (self%n_snapshots == size(self%snapshot)) then
         allocate (larger(2*size(self%snapshot)))
         do i = 1, self%n_snapshots
            call move_snapshot(self%snapshot(i), larger(i))
         end do
         call move_alloc(larger, self%snapshot)
      end if
      self%n_snapshots = self%n_snapshots + 1
   end subroutine new_snapshot

   subroutine move_snapshot(from, to)
      type(snapshot_type), intent(inout) :: from, to

      call move_alloc(from%prediction, to%prediction)
      call move_alloc(from%x, to%x)
      call move_alloc(from%turns, to%turns)
      call move_alloc(from%n_outputs, to%n_outputs)
   end subroutine move_snapshot

end module floor_trace
