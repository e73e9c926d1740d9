!> Rows of a mission: those of a jump wait until it is taken, and are what a run is continued from.
module fw_mission_rows
   use fw_analysis, only: run_type
   use fw_block_march, only: block_type, mission_state
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file
   use fw_kinds, only: wp
   use fw_mission_group, only: mission_record
   use fw_point, only: point_type
   use fw_restart_file, only: restart_type
   use fw_restart_rows, only: n_counts, restart_row_set
   use fw_wear_march, only: wear_march
   implicit none (type, external)
   private

   public :: mission_rows

   !> A row that is written once its jump is taken.
   type :: row_type
      type(point_type) :: point
      real(wp), allocatable :: vibration(:), notes(:)
      real(wp) :: spacing = 0.0_wp
   end type row_type

   !> Rows of a mission that wait until the flight that they belong to is accepted.
   type :: mission_rows
      type(run_type), pointer :: run => null()
      type(restart_row_set) :: for_restart
      type(mission_record), allocatable :: record
      !> Rows written, those to come (0: not known), and unknowns of the largest block.
      integer :: n_written = 0, n_expected = 0, longest = 0
      type(row_type), allocatable, private :: waiting(:)
   contains
      procedure :: keep
      procedure :: forget
      procedure :: write_down
      procedure :: note
      procedure :: copy
   end type mission_rows

contains

   !> The row of a march that has just ended.
   subroutine keep(self, block, now, point)
      class(mission_rows), intent(inout) :: self
      type(block_type), intent(in) :: block
      type(mission_state), intent(in) :: now
      type(point_type), intent(in) :: point
      type(row_type), allocatable :: longer(:)
      integer :: n

      n = 0
      if (allocated(self%waiting)) n = size(self%waiting)
      allocate (longer(n + 1))
      if (n > 0) longer(:n) = self%waiting
      associate (row => longer(n + 1), joint => block%joint)
         row%point = point
         row%point%flight = now%flight
         row%point%block = now%block
         row%vibration = joint%state%x(:joint%balance%n)
         row%notes = block%recorder%finer%notes()
         row%spacing = joint%march%resonance%spacing
      end associate
      call move_alloc(longer, self%waiting)
   end subroutine keep

   !> What waits is not taken.
   pure subroutine forget(self)
      class(mission_rows), intent(inout) :: self

      if (allocated(self%waiting)) deallocate (self%waiting)
   end subroutine forget

   !> Rows that were waiting. Of a jump all but the last are provisional: a run that is continued
   !> takes all of it or nothing.
   subroutine write_down(self, blocks, over, is_cut, error)
      class(mission_rows), intent(inout) :: self
      type(block_type), intent(inout), target :: blocks(:)
      !> The control of the flights, for who continues the run.
      type(wear_march), intent(inout) :: over
      !> Another n_flights would have made the jump longer.
      logical, intent(in) :: is_cut
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: vibration(self%longest)
      real(wp) :: counts(n_counts)
      integer :: k

      counts = [self%record%error, real([self%record%n_jumps, self%record%n_refused, &
                                         self%record%n_marches], wp)]
      if (.not. allocated(self%waiting)) return
      do k = 1, size(self%waiting)
         associate (row => self%waiting(k))
            vibration = 0.0_wp
            vibration(:size(row%vibration)) = row%vibration
            over%is_provisional = is_cut .or. k < size(self%waiting)
            over%resonance%spacing = row%spacing
            call self%for_restart%append(self%run%writer%file, over, vibration, &
                                          row%point%converged, row%notes, error, counts)
            if (.not. allocated(error)) call self%run%writer%add_point(row%point, error)
            if (allocated(error)) return
            call self%note(blocks, row%point)
            call self%run%observer%on_point(self%n_written, self%n_expected, row%point)
         end associate
      end do
      deallocate (self%waiting)
   end subroutine write_down

   !> A row counts, written now or by an earlier run.
   subroutine note(self, blocks, point)
      class(mission_rows), intent(inout) :: self
      type(block_type), intent(inout), target :: blocks(:)
      type(point_type), intent(in) :: point

      self%n_written = self%n_written + 1
      call self%record%note(point%flight, point%block, point%depth)
      call blocks(max(1, point%block))%recorder%count_point(point)
   end subroutine note

   !> The rows of the earlier run become the first of this result.
   subroutine copy(self, restart, error)
      class(mission_rows), intent(inout) :: self
      type(restart_type), intent(in) :: restart
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: source
      type(error_type), allocatable :: ignored

      if (self%run%writer%file%id < 0) return
      !$omp critical (fretwear_io)
      call source%open_read(restart%path, error)
      !$omp end critical (fretwear_io)
      associate (file => self%run%writer%file, n => restart%n_rows)
         if (.not. allocated(error)) call self%for_restart%copy(file, source, n, error)
         if (.not. allocated(error)) call self%run%writer%copy_points(source, n, error)
      end associate
      !$omp critical (fretwear_io)
      call source%close(ignored)
      !$omp end critical (fretwear_io)
   end subroutine copy

end module fw_mission_rows
