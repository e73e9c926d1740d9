!> The periodic state of a system that is integrated in time: a fixed point s = G(s) of its period
!> map. Plain iteration is integration from period to period, which for a mode of damping ratio
!> zeta takes 1/(2 pi zeta) periods a factor e; Anderson's acceleration (Anderson 1965, Walker and
!> Ni 2011) spends one period an iteration as well, and removes the slow modes by least squares
!> over the last changes.
!>
!> The residual is the change from one period to the next as integrated, relative to the range
!> of the state within the period: nothing is called periodic that does not repeat. Light contact
!> nodes may chatter and never repeat exactly: a motion whose change has stopped to fall under
!> plain iteration, which falls steadily on the way to any periodic state, is accepted at
!> `chatter_tolerance`.
module fw_periodic_state
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: period_map, find_periodic_state, periodic_report

   !> A system that can be integrated over one period of its load.
   type, abstract :: period_map
      !> Weights that give the entries of the state a common unit (n_state).
      real(wp), allocatable :: weight(:)
      !> What may end the integration early; null where nothing does.
      class(interrupt_type), pointer :: interrupt => null()
   contains
      procedure(integrate_interface), deferred :: integrate
   end type period_map

   abstract interface
      !> State at the end of a period from that at its start, and the weighted range of the state
      !> within the period; `done` is false where the integration failed or
      !> was ended from outside.
      subroutine integrate_interface(self, start, finish, range, done)
         import :: period_map, wp
         implicit none (type, external)
         class(period_map), intent(inout) :: self
         !> (n_state).
         real(wp), intent(in), contiguous :: start(:)
         real(wp), intent(out), contiguous :: finish(:)
         real(wp), intent(out) :: range
         logical, intent(out) :: done
      end subroutine integrate_interface
   end interface

   type :: periodic_report
      logical :: converged = .false.
      !> Periods integrated.
      integer :: n_periods = 0
      !> Relative change over the last period.
      real(wp) :: change = huge(1.0_wp)
   end type periodic_report

   !> Iterates kept: twice the number of modes that are slow, and some.
   integer, parameter :: max_history = 24
   !> Periods integrated before the acceleration starts: fast modes die out by themselves.
   integer, parameter :: n_settling = 2
   !> Periods without a new smallest change after which acceleration is given up: the map is not
   !> smooth on that scale (light contact nodes that chatter), and least squares fit its noise.
   integer, parameter :: patience = 10
   real(wp), parameter :: chatter_tolerance = 1.0e-4_wp
   !> Growth of the change over the best one at which the history is given up.
   real(wp), parameter :: worst_growth = 30.0_wp
   !> A difference that the others explain to this part adds nothing but round-off.
   real(wp), parameter :: dependent = 1.0e-7_wp

contains

   !> Iterate from `state` (n_state) until the relative change falls below `tolerance`; on return
   !> the map holds the record of the last period that was integrated.
   subroutine find_periodic_state(map, n_periods, tolerance, state, report)
      class(period_map), intent(inout) :: map
      !> Largest number of periods.
      integer, intent(in) :: n_periods
      real(wp), intent(in) :: tolerance
      real(wp), intent(inout), contiguous :: state(:)
      type(periodic_report), intent(out) :: report
      real(wp), allocatable :: image(:), change(:), last_image(:), last_change(:)
      real(wp), allocatable :: d_image(:, :), d_change(:, :)
      real(wp) :: range, best
      integer :: n, n_history, n_idle
      logical :: done, plain

      n = size(state)
      plain = .false.
      allocate (image(n), change(n), last_image(n), last_change(n))
      allocate (d_image(n, max_history), d_change(n, max_history))
      n_history = 0
      n_idle = 0
      best = huge(1.0_wp)
      do
         call map%integrate(state, image, range, done)
         report%n_periods = report%n_periods + 1
         if (.not. done) return
         ! In the common unit, in which least squares are taken too.
         change = map%weight*(image - state)
         report%change = norm2(change)/max(range, tiny(1.0_wp))
         n_idle = merge(0, n_idle + 1, report%change < best)
         ! Once given up, acceleration stays so.
         plain = plain .or. n_idle > patience
         report%converged = report%change <= tolerance .or. &
            (plain .and. n_idle > 2*patience .and. report%change <= chatter_tolerance)
         if (report%converged .or. report%n_periods >= n_periods) return
         if (report%change/worst_growth > best .or. plain) then
            n_history = 0
         else if (report%n_periods > n_settling) then
            ! Differences of two following periods: n periods give n - 1 of them.
            call remember(n_history, d_image, d_change, image - last_image, change - last_change)
         end if
         best = min(best, report%change)
         last_image = image
         last_change = change
         call accelerate(n_history, d_image, d_change, image, change, state)
      end do
   end subroutine find_periodic_state

   !> Put the newest differences first.
   pure subroutine remember(n_history, d_image, d_change, new_image, new_change)
      integer, intent(inout) :: n_history
      !> The newest differences first (n_state, max_history).
      real(wp), intent(inout) :: d_image(:, :), d_change(:, :)
      !> Image as integrated, change weighted.
      real(wp), intent(in) :: new_image(:), new_change(:)
      integer :: j

      n_history = min(n_history + 1, max_history)
      ! The oldest falls out; few and short columns, next to a period of integration.
      do j = n_history, 2, -1
         d_image(:, j) = d_image(:, j - 1)
         d_change(:, j) = d_change(:, j - 1)
      end do
      d_image(:, 1) = new_image
      d_change(:, 1) = new_change
   end subroutine remember

   !> state = image - d_image gamma with gamma minimising |change - d_change gamma|: by modified
   !> Gram-Schmidt from the newest difference on, carrying the images along.
   pure subroutine accelerate(n_history, d_image, d_change, image, change, state)
      integer, intent(in) :: n_history
      !> Differences, image as integrated, weighted change (n_state).
      real(wp), intent(in) :: d_image(:, :), d_change(:, :), image(:), change(:)
      real(wp), intent(out) :: state(:)
      real(wp) :: basis(size(image), n_history), carried(size(image), n_history)
      real(wp) :: rest(size(image)), part, before, after
      integer :: j, k, n_used

      state = image
      rest = change
      n_used = 0
      do j = 1, n_history
         k = n_used + 1
         basis(:, k) = d_change(:, j)
         carried(:, k) = d_image(:, j)
         before = norm2(basis(:, k))
         call orthogonalize(k, basis, carried)
         after = norm2(basis(:, k))
         ! The column takes no part, and the next one its place.
         if (after <= dependent*before) cycle
         n_used = k
         basis(:, k) = basis(:, k)/after
         carried(:, k) = carried(:, k)/after
         part = dot_product(basis(:, k), rest)
         rest = rest - part*basis(:, k)
         state = state - part*carried(:, k)
      end do
   end subroutine accelerate

   !> Remove columns 1..k-1 from column k, twice for full orthogonality.
   pure subroutine orthogonalize(k, basis, carried)
      integer, intent(in) :: k
      real(wp), intent(inout) :: basis(:, :), carried(:, :)
      real(wp) :: part
      integer :: i, pass

      do pass = 1, 2
         do i = 1, k - 1
            part = dot_product(basis(:, i), basis(:, k))
            basis(:, k) = basis(:, k) - part*basis(:, i)
            carried(:, k) = carried(:, k) - part*carried(:, i)
         end do
      end do
   end subroutine orthogonalize

end module fw_periodic_state
