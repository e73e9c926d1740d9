!> Group /mission of a result file: the depth after every flight, and which block has worn it.
module fw_mission_group
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_kinds, only: wp
   use fw_mission_options, only: mission_options
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: mission_record

   type, extends(result_group) :: mission_record
      type(mission_options), pointer :: options => null()
      !> After each flight, from 0 (n_pairs, 0:n_flights) [length], and whether the run came by
      !> there: jumps pass others over.
      real(wp), allocatable :: depth(:, :)
      logical, allocatable :: solved(:)
      !> What each block has worn (n_pairs, n_blocks), and the depth at the last row [length].
      real(wp), allocatable :: worn(:, :), last(:)
      !> Estimate of the error of the jumps so far [length], their number, and those refused.
      real(wp) :: error = 0.0_wp
      integer :: n_jumps = 0, n_refused = 0
      !> Marches of a block.
      integer :: n_marches = 0
   contains
      procedure :: start
      procedure :: note
      procedure :: write => write_mission
   end type mission_record

contains

   subroutine start(self, options, depth)
      class(mission_record), intent(inout) :: self
      type(mission_options), intent(in), target :: options
      !> Before the first flight (n_pairs).
      real(wp), intent(in) :: depth(:)

      self%options => options
      allocate (self%depth(size(depth), 0:options%n_flights), source=0.0_wp)
      allocate (self%solved(0:options%n_flights), source=.false.)
      allocate (self%worn(size(depth), options%n_blocks), source=0.0_wp)
      self%last = depth
      self%depth(:, 0) = depth
      self%solved(0) = .true.
   end subroutine start

   !> The depth after a block of a flight; of a jump, after the last of its marches.
   subroutine note(self, flight, block, depth)
      class(mission_record), intent(inout) :: self
      integer, intent(in) :: flight, block
      real(wp), intent(in) :: depth(:)

      if (block > 0) self%worn(:, block) = self%worn(:, block) + (depth - self%last)
      self%last = depth
      self%depth(:, flight) = depth
      self%solved(flight) = .true.
   end subroutine note

   subroutine write_mission(self, to)
      class(mission_record), intent(in) :: self
      type(group_writer), intent(inout) :: to
      real(wp) :: share(size(self%worn, 1), size(self%worn, 2))
      real(wp), allocatable :: depth(:, :)
      integer :: b, f

      do b = 1, size(share, 2)
         share(:, b) = 0.0_wp
         where (self%last > 0.0_wp) share(:, b) = self%worn(:, b)/self%last
      end do
      call to%put('/mission/name', self%options%name, '', 'block', 'names of the blocks')
      call to%put('/mission/cycles', self%options%cycles, '1', 'block', &
                  'cycles of the block in a flight')
      depth = self%depth
      ! From 0 on, as that is.
      do f = lbound(depth, 2), ubound(depth, 2)
         if (.not. self%solved(f)) depth(:, f) = ieee_value(1.0_wp, ieee_quiet_nan)
      end do
      call to%put('/mission/depth', depth, '<length>', 'flight pair', &
                  'wear depth after the flight, from 0; NaN within jumps')
      call to%put('/mission/share', share, '1', 'block pair', &
                  'part of the last depth that the block has worn')
      call to%note('/mission', 'n_jumps', self%n_jumps)
      call to%note('/mission', 'n_refused', self%n_refused)
      call to%note('/mission', 'n_marches', self%n_marches)
      call to%note('/mission', 'jump_error', self%error)
   end subroutine write_mission

end module fw_mission_group
