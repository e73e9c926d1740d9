!> The maxima of a response along its branch. A row knows whether the amplitude rises or falls
!> there, from its tangent: between one where it rises and the next where it falls lies a maximum,
!> which is solved for on the branch.
module fw_branch_peaks
   use fw_crossing_search, only: probe_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_peak, only: found_bound, found_row, found_search, found_unresolved, peak_type
   use fw_point, only: point_type
   use fw_recovery, only: largest_magnitude
   implicit none (type, external)
   private

   public :: branch_peaks

   !> What is kept of a row: amplitudes and their derivatives along the branch (n_observed).
   type :: row_type
      real(wp) :: omega = 0.0_wp
      real(wp), allocatable :: amplitude(:), rise(:)
   end type row_type

   type :: branch_peaks
      integer :: n_solved = 0, iterations = 0
      type(row_type), allocatable, private :: row(:)
      integer, private :: n_rows = 0
      type(point_type), private :: last
      ! Maxima, and the rows that they lie behind.
      type(peak_type), allocatable, private :: found(:)
      integer, allocatable, private :: place(:)
      ! The highest row of every quantity since it last fell, and the maximum found since then (0:
      ! none): where pairs begin to slip corners stand a little above what is solved for.
      type(peak_type), allocatable, private :: crest(:)
      integer, allocatable, private :: crowned(:)
      ! Number of that row, and whether the amplitude rose to it.
      integer, allocatable, private :: crest_row(:)
      logical, allocatable, private :: risen(:)
      ! That maximum as it was found.
      type(peak_type), allocatable, private :: first_found(:)
   contains
      procedure :: add
      procedure :: list
   end type branch_peaks

   !> Rise that may still be found, relative.
   real(wp), parameter :: small_gain = 1.0e-5_wp
   integer, parameter :: most_trials = 8
   !> Quantities that hardly move, as a part of the largest one, have no maxima.
   real(wp), parameter :: negligible = 1.0e-11_wp
   !> Fall on both sides from which on a maximum is none of the instants of sampled contact.
   real(wp), parameter :: prominent = 2.0e-3_wp

contains

   !> A row of the branch; maxima between it and the last are solved for.
   subroutine add(self, point, probe, length, error)
      class(branch_peaks), intent(inout) :: self
      type(point_type), intent(in) :: point
      !> Gives points between the two, and how far they are apart.
      class(probe_type), intent(inout) :: probe
      real(wp), intent(in) :: length
      type(error_type), allocatable, intent(out) :: error
      type(row_type), allocatable :: longer(:)
      integer, parameter :: first_size = 64
      type(peak_type) :: peak
      integer :: i, n

      if (.not. (point%converged .and. allocated(point%tangent))) return
      if (.not. allocated(self%row)) allocate (self%row(first_size), self%found(0), self%place(0))
      if (self%n_rows == size(self%row)) then
         allocate (longer(2*self%n_rows))
         longer(:self%n_rows) = self%row
         call move_alloc(longer, self%row)
      end if
      n = self%n_rows + 1
      self%row(n)%omega = point%omega
      self%row(n)%amplitude = point%amplitude
      self%row(n)%rise = rise_of(point)
      self%n_rows = n
      if (n == 1) then
         self%last = point
         ! One by one: gfortran 12 does not free the coefficients of an array of results.
         allocate (self%crest(size(point%amplitude)))
         do i = 1, size(point%amplitude)
            self%crest(i) = peak_of(point, i)
         end do
         self%first_found = self%crest
         allocate (self%crowned(size(point%amplitude)), source=0)
         allocate (self%crest_row(size(point%amplitude)), source=1)
         allocate (self%risen(size(point%amplitude)), source=.false.)
         return
      end if
      do i = 1, size(point%amplitude)
         if (.not. (self%row(n - 1)%rise(i) > 0.0_wp .and. self%row(n)%rise(i) <= 0.0_wp)) cycle
         if (point%amplitude(i) <= negligible*maxval(point%amplitude)) cycle
         call climb(self, point, probe, length, i, peak, error)
         if (allocated(error)) return
         self%found = [self%found, peak]
         self%place = [self%place, n - 1]
         self%crowned(i) = size(self%found)
         self%first_found(i) = peak
      end do
      call follow_crest(self, point)
      self%n_solved = self%n_solved + probe%n_solved
      self%iterations = self%iterations + probe%iterations
      self%last = point
   end subroutine add

   !> A row that is higher than the maximum beside it takes its place.
   subroutine follow_crest(self, point)
      class(branch_peaks), intent(inout) :: self
      type(point_type), intent(in) :: point
      integer :: i

      do i = 1, size(self%crest)
         if (point%amplitude(i) > self%crest(i)%amplitude) then
            self%crest(i) = peak_of(point, i)
            self%crest_row(i) = self%n_rows
            self%risen(i) = .true.
         end if
         if (self%crowned(i) > 0) call crown(self, i)
         ! Last: a row may fall right behind the maximum that was solved for before it.
         if (point%amplitude(i) >= (1.0_wp - prominent)*self%crest(i)%amplitude) cycle
         if (self%risen(i) .and. self%crowned(i) == 0 .and. &
             self%crest(i)%amplitude > negligible*maxval(point%amplitude)) call note_corner(self, i)
         self%crest(i) = peak_of(point, i)
         self%crest_row(i) = self%n_rows
         self%risen(i) = .false.
         self%crowned(i) = 0
      end do
   end subroutine follow_crest

   !> A crest behind which the amplitude falls though it rises at both rows: a corner between them.
   subroutine note_corner(self, i)
      class(branch_peaks), intent(inout) :: self
      !> Quantity.
      integer, intent(in) :: i
      type(peak_type) :: peak

      peak = self%crest(i)
      peak%found_by = found_unresolved
      self%found = [self%found, peak]
      self%place = [self%place, self%crest_row(i)]
   end subroutine note_corner

   !> The crest in place of the maximum found beside it where it is a little higher.
   subroutine crown(self, i)
      class(branch_peaks), intent(inout) :: self
      !> Quantity.
      integer, intent(in) :: i

      associate (peak => self%found(self%crowned(i)), crest => self%crest(i), &
                 first => self%first_found(i))
         if (crest%amplitude > (1.0_wp + prominent)*first%amplitude) then
            ! It was a step on the way up.
            peak = first
            self%crowned(i) = 0
         else if (crest%amplitude > peak%amplitude) then
            peak = crest
            peak%found_by = found_row
         end if
      end associate
   end subroutine crown

   !> Change of the amplitudes along the branch (n_observed).
   pure function rise_of(point) result(rise)
      type(point_type), intent(in) :: point
      real(wp), allocatable :: rise(:)
      !> Of a difference, over the size of what changes.
      real(wp), parameter :: difference = 1.0e-5_wp
      real(wp) :: step
      integer :: i

      allocate (rise(size(point%amplitude)), source=0.0_wp)
      do i = 1, size(rise)
         step = norm2(point%tangent(:, i))
         if (.not. step > 0.0_wp) cycle
         step = difference*norm2(point%coefficients(:, i))/step
         if (.not. step > 0.0_wp) cycle
         rise(i) = (largest_magnitude(point%coefficients(:, i) + step*point%tangent(:, i)) - &
                    largest_magnitude(point%coefficients(:, i) - step*point%tangent(:, i))) &
                   /(2.0_wp*step)
      end do
   end function rise_of

   !> Solve where the rise of quantity i vanishes between the last row and this one (Illinois).
   subroutine climb(self, point, probe, length, i, peak, error)
      class(branch_peaks), intent(in) :: self
      type(point_type), intent(in) :: point
      class(probe_type), intent(inout) :: probe
      real(wp), intent(in) :: length
      integer, intent(in) :: i
      type(peak_type), intent(out) :: peak
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: between
      real(wp) :: low, high, at_low, at_high, share, gain, rise(size(point%amplitude))
      integer :: k

      peak = peak_of(self%last, i)
      if (point%amplitude(i) > peak%amplitude) peak = peak_of(point, i)
      peak%found_by = found_unresolved
      low = 0.0_wp
      high = 1.0_wp
      at_low = self%row(self%n_rows - 1)%rise(i)
      at_high = self%row(self%n_rows)%rise(i)
      if (gain_of(at_high) <= small_gain*peak%amplitude .or. &
          gain_of(at_low) <= small_gain*peak%amplitude) then
         peak%found_by = found_row
         return
      end if
      do k = 1, most_trials
         share = (low*at_high - high*at_low)/(at_high - at_low)
         call probe%at(share, between, error)
         if (allocated(error)) return
         if (.not. between%converged) return
         rise = rise_of(between)
         gain = gain_of(rise(i))
         if (between%amplitude(i) > peak%amplitude) peak = peak_of(between, i)
         peak%found_by = merge(found_search, found_unresolved, gain <= small_gain*peak%amplitude)
         if (peak%found_by == found_search) return
         if (rise(i) > 0.0_wp) then
            low = share
            at_low = rise(i)
            at_high = 0.5_wp*at_high
         else
            high = share
            at_high = rise(i)
            at_low = 0.5_wp*at_low
         end if
      end do

   contains

      !> What a parabola with the rises of both ends gains on a place of a given one.
      pure real(wp) function gain_of(rise)
         real(wp), intent(in) :: rise

         gain_of = 0.0_wp
         if (at_low > at_high) gain_of = 0.5_wp*rise**2*(high - low)*length/ &
                                         (at_low - at_high)
      end function gain_of

   end subroutine climb

   !> A maximum as it stands in a point that was solved there.
   pure function peak_of(point, i) result(peak)
      type(point_type), intent(in) :: point
      integer, intent(in) :: i
      type(peak_type) :: peak

      peak%observed = i
      peak%omega = point%omega
      peak%amplitude = point%amplitude(i)
      peak%coefficients = point%coefficients(:, i)
   end function peak_of

   !> The maxima of every quantity in the order of the branch, and its ends where they are higher
   !> than what lies next to them.
   subroutine list(self, first, peaks)
      class(branch_peaks), intent(in) :: self
      !> The first row.
      type(point_type), intent(in) :: first
      type(peak_type), allocatable, intent(out) :: peaks(:)
      type(peak_type) :: peak
      integer :: i, k, before

      allocate (peaks(0))
      if (self%n_rows < 2) return
      do i = 1, size(self%row(1)%amplitude)
         before = 0
         if (self%row(1)%rise(i) < 0.0_wp .and. first%amplitude(i) > 0.0_wp) then
            peak = peak_of(first, i)
            peak%found_by = found_bound
            peaks = [peaks, peak]
         end if
         do k = 1, size(self%found)
            if (self%found(k)%observed /= i) cycle
            if (.not. stands_out(self, k)) cycle
            peak = self%found(k)
            peak%bandwidth = width_of(self, k)
            ! Of two corners of one top the higher stays.
            if (is_one_top(self, before, k)) then
               if (peak%amplitude <= self%found(before)%amplitude) cycle
               peaks(size(peaks)) = peak
            else
               peaks = [peaks, peak]
            end if
            before = k
         end do
         if (self%row(self%n_rows)%rise(i) > 0.0_wp) then
            peak = peak_of(self%last, i)
            peak%found_by = found_bound
            peaks = [peaks, peak]
         end if
      end do
   end subroutine list

   !> Whether the amplitude falls on both sides of a maximum before it gets higher; at an end of the
   !> branch it may.
   pure logical function stands_out(self, k)
      class(branch_peaks), intent(in) :: self
      integer, intent(in) :: k
      integer :: side, j
      real(wp) :: floor

      stands_out = .true.
      floor = (1.0_wp - prominent)*self%found(k)%amplitude
      do side = 0, 1
         j = self%place(k) + side
         do while (j >= 1 .and. j <= self%n_rows)
            associate (at => self%row(j)%amplitude(self%found(k)%observed))
               if (at < floor) exit
               stands_out = stands_out .and. at <= self%found(k)%amplitude
            end associate
            j = j + merge(-1, 1, side == 0)
         end do
      end do
   end function stands_out

   !> Whether the amplitude stays near two maxima from one to the other; never of one alone.
   pure logical function is_one_top(self, first, second)
      class(branch_peaks), intent(in) :: self
      integer, intent(in) :: first, second
      real(wp) :: floor
      integer :: i, j

      is_one_top = first > 0
      if (.not. is_one_top) return
      i = self%found(first)%observed
      floor = (1.0_wp - prominent)*min(self%found(first)%amplitude, self%found(second)%amplitude)
      do j = self%place(first) + 1, self%place(second)
         is_one_top = is_one_top .and. self%row(j)%amplitude(i) >= floor
      end do
   end function is_one_top

   !> Width at half of the power of the vibration [rad/s], below 0 where the branch does not fall so
   !> far; between rows as in fw_peak_rules.
   pure real(wp) function width_of(self, k) result(width)
      class(branch_peaks), intent(in) :: self
      integer, intent(in) :: k
      real(wp) :: inner(2), outer(2), edge(2), mean
      integer :: side, j

      width = -1.0_wp
      associate (peak => self%found(k))
         mean = abs(peak%coefficients(1))
         do side = 1, 2
            inner = [peak%omega**2, 0.0_wp]
            j = self%place(k) + side - 1
            do
               if (j < 1 .or. j > self%n_rows) return
               associate (swing => max(self%row(j)%amplitude(peak%observed) - mean, &
                                       tiny(1.0_wp)**0.25_wp*peak%amplitude))
                  outer = [self%row(j)%omega**2, &
                           sqrt(max(((peak%amplitude - mean)/swing)**2 - 1.0_wp, 0.0_wp))]
               end associate
               if (outer(2) >= 1.0_wp) exit
               inner = outer
               j = j + merge(-1, 1, side == 1)
            end do
            edge(side) = sqrt(inner(1) + (1.0_wp - inner(2))/(outer(2) - inner(2))* &
                              (outer(1) - inner(1)))
         end do
      end associate
      width = abs(edge(2) - edge(1))
   end function width_of

end module fw_branch_peaks
