!> The last solutions of a walk along any path, from which the next one is guessed.
module fw_solution_history
   use fw_extrapolation, only: best_order, extrapolate
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: history_options, most_kept, position, solution_history

   !> Solutions that are kept at most: polynomials up to the fourth order.
   integer, parameter :: most_kept = 5

   !> Where on a path.
   type :: position
      !> The frequency, or the value of the parameter that the path goes along.
      real(wp) :: along = 0.0_wp
      !> Of what is raised beside it: the share of the load, or the amplitude that is asked for.
      real(wp) :: level = 1.0_wp
   end type position

   type :: history_options
      integer :: most = most_kept
      !> Steps longer than this many of the last one are guessed by a straight line at most: what a
      !> curved one leaves out grows with their power. 0: none are.
      real(wp) :: far = 2.0_wp
      !> Share of what a lower order would have been off that a higher one has to come nearer than:
      !> two that did alike say that neither fits.
      real(wp) :: clearly = 0.6_wp
      !> The lowest order of a guess from two solutions: a sweep goes somewhere.
      integer :: lowest = 1
      !> By the highest order that the solutions allow, however it would have served.
      logical :: by_all = .false.
      !> Places closer than this are one; below 0 none are.
      real(wp) :: same = 0.0_wp
      !> Unknowns that come first and move in proportion to the exponential of the place.
      integer :: n_exponential = 0
   end type history_options

   type :: solution_history
      type(history_options) :: options
      !> How many there are.
      integer :: kept = 0
      !> Where they are, the newest first, and the unknowns there (n, most_kept).
      real(wp) :: place(most_kept) = -1.0_wp, level(most_kept) = 1.0_wp
      real(wp), allocatable :: x(:, :)
      !> The first of the present level, where one is known.
      logical :: has_head = .false.
      real(wp) :: head_place = 0.0_wp, head_level = 1.0_wp
      real(wp), allocatable :: head(:)
      !> Of the polynomials of those that move exponentially, and of all others.
      integer, private :: order(2) = 0
   contains
      procedure :: start
      procedure :: begin_with
      procedure :: remember
      procedure :: predict
      procedure :: guess
      procedure :: newest
      procedure :: give_back
   end type solution_history

contains

   !> Nothing is known yet of n unknowns.
   subroutine start(self, n, options)
      class(solution_history), intent(inout) :: self
      integer, intent(in) :: n
      type(history_options), intent(in), optional :: options

      if (present(options)) self%options = options
      allocate (self%x(n, most_kept), source=0.0_wp)
   end subroutine start

   !> A solution from elsewhere is all that is known: those before are of other harmonics, say.
   pure subroutine begin_with(self, place, x, level)
      class(solution_history), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)
      real(wp), intent(in), optional :: level

      self%kept = 0
      call self%remember(place, x, level)
   end subroutine begin_with

   !> The newest solution; one at the same place replaces it.
   pure subroutine remember(self, place, x, level)
      class(solution_history), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)
      !> 1 unless the path has two coordinates.
      real(wp), intent(in), optional :: level
      real(wp) :: height
      integer :: k

      height = 1.0_wp
      if (present(level)) height = level
      if (self%kept > 0) then
         ! No direction to extrapolate in.
         if (abs(place - self%place(1)) <= self%options%same) then
            self%x(:, 1) = x
            return
         end if
         ! The next level begins where this one did.
         if (abs(self%level(1) - height) > 0.0_wp) self%has_head = .false.
         call choose_orders(self, place, x)
      end if
      do k = self%options%most, 2, -1
         self%place(k) = self%place(k - 1)
         self%level(k) = self%level(k - 1)
         self%x(:, k) = self%x(:, k - 1)
      end do
      self%place(1) = place
      self%level(1) = height
      self%x(:, 1) = x
      self%kept = min(self%options%most, self%kept + 1)
      if (self%kept == 1) self%order = 0
      ! The second solution makes a line possible, and nothing is known of it.
      if (self%kept == 2) self%order = 1
      if (self%has_head .or. .not. present(level)) return
      self%has_head = .true.
      self%head_place = place
      self%head_level = height
      self%head = x
   end subroutine remember

   !> The orders that would have served a new solution best.
   pure subroutine choose_orders(self, place, x)
      class(solution_history), intent(inout) :: self
      real(wp), intent(in) :: place, x(:)

      if (self%options%by_all) then
         self%order = self%kept
         return
      end if
      associate (n => self%options%n_exponential, p => self%place(:self%kept), &
                 share => self%options%clearly)
         if (n > 0) self%order(1) = best_order(exp(p - place), self%x(:n, :), 1.0_wp, x(:n), share)
         self%order(2) = best_order(p, self%x(n + 1:, :), place, x(n + 1:), share)
      end associate
   end subroutine choose_orders

   !> A guess from two solutions at least, or from the only one.
   pure subroutine predict(self, place, x)
      class(solution_history), intent(in) :: self
      real(wp), intent(in) :: place
      real(wp), intent(out) :: x(:)
      integer :: n, order(2)

      n = self%options%n_exponential
      order = self%order
      if (self%kept > 1) then
         order = max(self%options%lowest, order)
         if (self%options%far > 0.0_wp .and. abs(place - self%place(1)) > &
             self%options%far*abs(self%place(1) - self%place(2))) order = min(1, order)
      end if
      order = min(order, self%kept - 1)
      if (n > 0) call extrapolate(exp(self%place(:order(1) + 1) - place), self%x(:n, :), 1.0_wp, &
                                  x(:n))
      call extrapolate(self%place(:order(2) + 1), self%x(n + 1:, :), place, x(n + 1:))
   end subroutine predict

   !> Guesses of every path in their order: extrapolated from two solutions at least, the last one.
   pure subroutine guess(self, number, place, x, is_there)
      class(solution_history), intent(in) :: self
      integer, intent(in) :: number
      real(wp), intent(in) :: place
      real(wp), intent(inout) :: x(:)
      !> Whether as many are known.
      logical, intent(out) :: is_there

      is_there = self%kept > 2 - number
      if (.not. is_there) return
      if (number == 1) call self%predict(place, x)
      if (number == 2) x = self%x(:, 1)
   end subroutine guess

   !> Where the newest solution is.
   pure type(position) function newest(self)
      class(solution_history), intent(in) :: self

      newest = position(self%place(1), self%level(1))
   end function newest

   !> A solution that was known before is the only one again.
   pure subroutine give_back(self, at, x)
      class(solution_history), intent(inout) :: self
      type(position), intent(in) :: at
      real(wp), intent(in) :: x(:)

      self%kept = 1
      self%place(1) = at%along
      self%level(1) = at%level
      self%x(:, 1) = x
      self%order = 0
   end subroutine give_back

end module fw_solution_history
