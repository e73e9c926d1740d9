!> Changes of stability between the rows of a natural sweep: noted while the rows pass by, located
!> by a few more solutions after the sweep.
module fw_sweep_bifurcations
   use fw_bifurcation, only: bifurcation_list
   use fw_case, only: case_type
   use fw_contact_data, only: memory_carried
   use fw_crossing_search, only: probe_type, search_crossings
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_sinks, only: point_sink
   use fw_stability_crossing, only: crossing_between, crossing_none, may_hide, movement_between, &
      multiplier_track, signature_of
   use fw_stability_verdict, only: verdict_undecided
   use fw_strategy, only: new_request, point_request, point_strategy, solver_memory
   use fw_sweep, only: point_source
   implicit none (type, external)
   private

   public :: sweep_bifurcations

   !> Two rows of different stability, or that may hide changes of it.
   type :: change_type
      type(point_type) :: first, second
      type(solver_memory) :: memory
      !> Of the multipliers towards the first.
      real(wp) :: movement(2) = 0.0_wp
      !> Number of the first among the rows with multipliers.
      integer :: after = 0
   end type change_type

   type, extends(point_sink) :: sweep_bifurcations
      type(bifurcation_list) :: found
      !> Solutions of the search, and their iterations.
      integer :: n_solved = 0, iterations = 0
      class(point_source), pointer, private :: source => null()
      class(point_strategy), pointer, private :: strategy => null()
      class(interrupt_type), pointer, private :: interrupt => null()
      type(multiplier_track), private :: track
      type(change_type), allocatable, private :: changes(:)
      !> The last row with multipliers, and from where to go on.
      type(point_type), private :: last
      type(solver_memory), private :: memory
      !> Of its multipliers since the row before it.
      real(wp), private :: movement(2) = 0.0_wp
      logical, private :: is_active = .false.
   contains
      procedure :: start
      procedure :: take
      procedure :: search
   end type sweep_bifurcations

   !> Solutions between two rows, each from the one found last on the side of the first.
   type, extends(probe_type) :: sweep_probe
      type(case_type), pointer :: case => null()
      class(point_strategy), pointer :: strategy => null()
      class(interrupt_type), pointer :: interrupt => null()
      !> Places of the rows, and where a solution starts.
      real(wp) :: place(2) = 0.0_wp
      integer :: before(3) = 0
      real(wp) :: share = 0.0_wp
      type(solver_memory) :: memory
   contains
      procedure :: at
   end type sweep_probe

contains

   !> Get ready for a sweep over frequencies that only rise or only fall.
   subroutine start(self, source, strategy, interrupt)
      class(sweep_bifurcations), intent(inout) :: self
      class(point_source), intent(in), target :: source
      class(point_strategy), intent(in), target :: strategy
      !> What may end the search.
      class(interrupt_type), intent(in), target :: interrupt

      self%source => source
      self%strategy => strategy
      self%interrupt => interrupt
      self%is_active = .true.
      allocate (self%changes(0))
   end subroutine start

   !> A row of the sweep; those that failed lie within a bracket.
   subroutine take(self, point, error)
      class(sweep_bifurcations), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error
      integer :: signature(3)

      if (.not. self%is_active .or. .not. allocated(point%multipliers)) return
      signature = signature_of(point%multipliers)
      call self%track%add(signature, point%verdict /= verdict_undecided)
      if (self%track%n > 1) then
         associate (a => self%last%multipliers, b => point%multipliers)
            if (crossing_between(signature_of(a), signature) /= crossing_none .or. &
                may_hide(a, b, self%movement, .false.)) call keep(self, point)
            self%movement = movement_between(a, b)
         end associate
      end if
      self%last = point
      call self%source%remember(self%memory)
   end subroutine take

   !> Remember the last row and this one.
   subroutine keep(self, point)
      class(sweep_bifurcations), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(change_type), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(self%changes) + 1))
      do k = 1, size(self%changes)
         longer(k) = self%changes(k)
      end do
      longer(size(longer)) = change_type(self%last, point, self%memory, self%movement, &
                                         self%track%n - 1)
      call move_alloc(longer, self%changes)
   end subroutine keep

   !> Locate what the rows enclose.
   subroutine search(self, case, error)
      class(sweep_bifurcations), intent(inout) :: self
      type(case_type), intent(in), target :: case
      type(error_type), allocatable, intent(out) :: error
      type(sweep_probe) :: probe
      integer :: k

      if (.not. self%is_active .or. case%contact%memory == memory_carried) return
      ! What becomes a row now is known here already.
      self%is_active = .false.
      probe%case => case
      probe%strategy => self%strategy
      probe%interrupt => self%interrupt
      do k = 1, size(self%changes)
         associate (change => self%changes(k))
            probe%place = [change%first%place, change%second%place]
            probe%memory = change%memory
            probe%share = 0.0_wp
            probe%before = signature_of(change%first%multipliers)
            call search_crossings(probe, change%first, change%second, change%movement, &
                                  change%after, .false., self%found, error)
         end associate
         if (allocated(error)) return
      end do
      self%n_solved = probe%n_solved
      self%iterations = probe%iterations
      call self%found%doubt(self%track)
   end subroutine search

   !> The solution at a share of the way between the rows.
   subroutine at(self, share, point, error)
      class(sweep_probe), intent(inout) :: self
      real(wp), intent(in) :: share
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request

      if (.not. allocated(self%memory%x)) return
      request = new_request(self%case, (1.0_wp - share)*self%place(1) + share*self%place(2))
      request%fallback = .false.
      request%stability = .true.
      request%contact = .false.
      request%histories = .false.
      request%sensitivity = .false.
      request%interrupt => self%interrupt
      call self%strategy%recall(self%memory)
      call self%strategy%solve_in_time(self%case, request, point, error)
      if (allocated(error)) return
      self%n_solved = self%n_solved + 1
      self%iterations = self%iterations + point%iterations
      if (.not. point%converged .or. share < self%share) return
      if (any(signature_of(point%multipliers) /= self%before)) return
      self%share = share
      call self%strategy%remember(self%memory)
   end subroutine at

end module fw_sweep_bifurcations
