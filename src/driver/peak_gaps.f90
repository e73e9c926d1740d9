!> Intervals between rows below which a resonance of a joint that opens may lie (fw_mixed_bands),
!> and how many points are solved in each.
module fw_peak_gaps
   use fw_kinds, only: wp
   use fw_mixed_bands, only: hidden_points, mixed_band, opens
   use fw_peak_options, only: limits
   use fw_samples, only: sample_list, sample_type
   implicit none (type, external)
   private

   public :: gap_list

   type :: gap_type
      !> Between two rows [rad/s].
      real(wp) :: below = 0.0_wp, above = 0.0_wp
      !> How many times too long it is for the flank to rise above the rows at all.
      real(wp) :: length = 0.0_wp
      !> How high the resonance may be (n_observed).
      real(wp), allocatable :: height(:)
      !> Whether the joint opens and closes at one of the rows: else only at the resonance.
      logical :: opens = .false.
      !> To be solved in it, and those that were: some fail, or are above the budget of the search.
      integer :: points = 0, solved = 0
   end type gap_type

   type :: gap_list
      integer :: n = 0
      type(gap_type), allocatable :: item(:)
   contains
      procedure :: note
      procedure :: plan
      procedure :: find_open
   end type gap_list

contains

   !> Keep the interval of two rows where it may hide a resonance; both are needed then.
   subroutine note(self, bands, below, above)
      class(gap_list), intent(inout) :: self
      type(mixed_band), intent(in) :: bands(:)
      type(sample_type), intent(inout) :: below, above
      type(gap_type), allocatable :: longer(:)
      real(wp) :: height(size(below%amplitude)), length
      integer :: k

      call hidden_points(bands, below, above, length, height)
      if (length*limits%stands_out <= 1.0_wp) return
      below%is_needed = .true.
      above%is_needed = .true.
      if (.not. allocated(self%item)) allocate (self%item(8))
      if (self%n == size(self%item)) then
         allocate (longer(2*self%n))
         do k = 1, self%n
            longer(k) = self%item(k)
         end do
         call move_alloc(longer, self%item)
      end if
      self%n = self%n + 1
      associate (gap => self%item(self%n))
         gap%below = below%omega
         gap%above = above%omega
         gap%length = length
         gap%height = height
         gap%opens = opens(below) .or. opens(above)
      end associate
   end subroutine note

   !> Share points among those intervals that may hold the highest maximum of a quantity: first
   !> where the joint opens, and then elsewhere, if it opens at all.
   subroutine plan(self, samples, highest, n_rows, n_most)
      class(gap_list), intent(inout) :: self
      !> All that are known.
      type(sample_list), intent(in) :: samples
      !> Known so far (n_observed).
      real(wp), intent(in) :: highest(:)
      !> Rows of the sweep, and points that may be solved.
      integer, intent(in) :: n_rows, n_most
      integer :: k, left

      left = max(0, min(max(limits%least_points, n_rows/limits%rows_per_point), n_most))
      call share(self, highest, .true., left)
      do k = 1, samples%n
         if (.not. opens(samples%item(k)%at)) cycle
         call share(self, highest, .false., left)
         exit
      end do
   end subroutine plan

   !> As many points as are left, in the intervals of one kind.
   subroutine share(self, highest, opens, left)
      class(gap_list), intent(inout) :: self
      real(wp), intent(in) :: highest(:)
      logical, intent(in) :: opens
      integer, intent(inout) :: left
      real(wp) :: wanted
      integer :: k, total

      wanted = limits%stands_out
      do
         total = 0
         do k = 1, self%n
            associate (gap => self%item(k))
               if (gap%opens .neqv. opens) cycle
               gap%points = 0
               if (any(gap%height > highest)) then
                  ! More than are left are too many, however many.
                  gap%points = max(ceiling(min(wanted*gap%length, real(left + 2, wp))) - 1, 0)
               end if
               total = total + gap%points
            end associate
         end do
         if (total <= left) exit
         wanted = limits%fewer*wanted
      end do
      left = left - total
   end subroutine share

   !> The range of the intervals that may still hide a maximum above the highest.
   pure subroutine find_open(self, highest, range, n_open)
      class(gap_list), intent(in) :: self
      !> (n_observed)
      real(wp), intent(in) :: highest(:)
      !> [rad/s]
      real(wp), intent(out) :: range(2)
      integer, intent(out) :: n_open
      integer :: k

      n_open = 0
      range = 0.0_wp
      do k = 1, self%n
         associate (gap => self%item(k))
            if (.not. gap%opens) cycle
            if (all(gap%height <= highest)) cycle
            ! Where no solution is found beside known ones, another branch may be near.
            if (gap%solved == gap%points .and. gap%length <= real(gap%points + 1, wp)) cycle
            if (n_open == 0) range = [gap%below, gap%above]
            range = [min(range(1), gap%below), max(range(2), gap%above)]
            n_open = n_open + 1
         end associate
      end do
   end subroutine find_open

end module fw_peak_gaps
