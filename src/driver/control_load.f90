!> Points of given amplitude, the last way: responses to given loads, each from the one before,
!> until the amplitude lies between two of them. Where friction holds what is observed no guess of
!> its motion is near, and a load below the one that lets it slip says nothing of those above.
submodule(fw_given_amplitude) fw_control_load
   implicit none (type, external)

   !> Loads that are tried, those in a row without a response after which no more are, and those
   !> between two that hold the amplitude between them.
   integer, parameter :: most_loads = 40, most_lost = 6, most_between = 24
   !> Factor from load to load, and that where all pairs stick and nothing is known of slip.
   real(wp), parameter :: rise = 2.0_wp, long_rise = 8.0_wp
   !> Growth of the amplitude that is none, and steps of the load in a row that show none.
   real(wp), parameter :: no_growth = 5.0e-3_wp
   integer, parameter :: enough = 4
   !> Two loads nearer than this part of them, with different amplitudes, are those of a jump.
   real(wp), parameter :: narrow = 1.0e-6_wp

   !> A response to a load.
   type :: loaded_point
      logical :: is_known = .false., all_stick = .false.
      real(wp) :: load = 0.0_wp, amplitude = 0.0_wp
      real(wp), allocatable :: x(:)
   end type loaded_point

contains

   module procedure search_loads
      type(loaded_point) :: low, high

      if (self%rest >= at%level .or. self%problem%n_pairs == 0) return
      call self%control%stand(at%along, error)
      if (.not. allocated(error)) call enclose(self, walk, at, x, low, high, error)
      if (allocated(error) .or. .not. high%is_known) return
      call close_in(self, walk, at, x, low, high, report, error)
   end procedure search_loads

   !> Two loads whose responses are smaller and larger than the amplitude; `high` is not known where
   !> no load gave a larger one, and `low` is at rest where none gave a smaller one.
   subroutine enclose(self, walk, at, x, low, high, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(loaded_point), intent(out) :: low, high
      type(error_type), allocatable, intent(out) :: error
      type(loaded_point) :: found
      real(wp) :: load
      integer :: k, lost, n_flat

      call first_load(self, walk, at, x, load, error)
      lost = 0
      n_flat = 0
      do k = 1, most_loads
         if (allocated(error) .or. self%state%is_interrupted()) return
         call respond(self, load, low, found, error)
         if (allocated(error)) return
         lost = merge(0, lost + 1, found%is_known)
         if (lost >= most_lost) return
         if (found%is_known .and. found%amplitude >= at%level) then
            high = found
            if (low%is_known) return
            ! Not yet below it: down from here.
            load = load/long_rise
            cycle
         end if
         if (found%is_known) then
            if (low%is_known .and. .not. found%all_stick .and. &
                abs(found%amplitude - low%amplitude) <= no_growth*found%amplitude) then
               n_flat = n_flat + 1
            else
               n_flat = 0
            end if
            low = found
            if (high%is_known) return
            if (n_flat >= enough) then
               self%limit = found%amplitude
               return
            end if
         end if
         if (high%is_known) then
            load = load/long_rise
         else
            load = load*merge(long_rise, rise, low%all_stick .or. n_flat > 0)
         end if
      end do
   end subroutine enclose

   !> That of the linear solution with open pairs, or with stuck ones.
   subroutine first_load(self, walk, at, x, load, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      real(wp), intent(out) :: load
      type(error_type), allocatable, intent(out) :: error
      integer :: guess
      logical :: is_there

      load = abs(self%base)
      do guess = 4, 3, -1
         call self%make_guess(guess, at, walk%known, x, is_there, error)
         if (allocated(error)) return
         if (.not. is_there) cycle
         load = abs(x(size(x)))
         exit
      end do
   end subroutine first_load

   !> The response to a load, from the last one that is known and from linear solutions.
   subroutine respond(self, load, near, found, error)
      class(given_amplitude), intent(inout) :: self
      real(wp), intent(in) :: load
      type(loaded_point), intent(in) :: near
      type(loaded_point), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp), allocatable :: share(:, :)
      integer :: guess

      allocate (found%x(self%state%n))
      call self%state%set_parameter(load, error)
      if (allocated(error)) return
      do guess = merge(1, 2, near%is_known), 3
         if (guess == 1) found%x = near%x
         if (guess == 2) call free_guess(self%state, found%x)
         if (guess == 3) call stuck_guess(self%state, found%x)
         call self%response%solve(found%x, report, error)
         if (allocated(error)) return
         if (ends(report)) exit
      end do
      if (.not. report%converged) return
      found%is_known = .true.
      found%load = load
      call self%control%move(found%x, load)
      found%amplitude = self%control%size_of_motion()
      allocate (share(3, self%problem%n_pairs))
      call self%state%pair_shares(share)
      found%all_stick = all(share(1, :) >= 1.0_wp)
   end subroutine respond

   !> The equations with the amplitude from both ends, and from loads between them.
   subroutine close_in(self, walk, at, x, low, high, report, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      real(wp), intent(inout), contiguous :: x(:)
      type(loaded_point), intent(inout) :: low, high
      type(solver_report), intent(inout) :: report
      type(error_type), allocatable, intent(out) :: error
      type(loaded_point) :: found
      integer :: k

      do k = 0, most_between
         if (k > 0) then
            call respond(self, sqrt(low%load*high%load), low, found, error)
            if (allocated(error) .or. .not. found%is_known) return
            if (found%amplitude >= at%level) then
               high = found
            else
               low = found
            end if
         end if
         call go_on_from(self, walk, at, high, x, report, error)
         if (allocated(error) .or. ends(report)) return
         if (.not. low%is_known) return
         if (.not. low%all_stick) call go_on_from(self, walk, at, low, x, report, error)
         if (allocated(error) .or. ends(report)) return
         if (high%load <= (1.0_wp + narrow)*low%load) exit
      end do
      self%jump = [low%amplitude, high%amplitude, high%load]
   end subroutine close_in

   !> Newton's method on the amplitude from the response to a load.
   subroutine go_on_from(self, walk, at, point, x, report, error)
      class(given_amplitude), intent(inout) :: self
      type(walk_type), intent(inout) :: walk
      type(position), intent(in) :: at
      type(loaded_point), intent(in) :: point
      real(wp), intent(inout), contiguous :: x(:)
      type(solver_report), intent(out) :: report
      type(error_type), allocatable, intent(out) :: error

      self%control%amplitude = at%level
      x = [point%x, point%load]
      call self%solve(x, report, error)
      if (allocated(error)) return
      if (report%converged) call walk%known%remember(at%along, x, at%level)
   end subroutine go_on_from

end submodule fw_control_load
