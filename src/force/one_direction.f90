!> The derivative of friction that is decided at instants, of a pair with one tangential direction.
!> Between two instants of slip or separation the corrected position stands: with k the instant, s
!> the last one before it that moved, E the base functions and e = -1 or 1 the direction of slip,
!>
!>   stick  d lambda_t = d y_t(k) - d x(s),   d x(s) = d y_t(s) + mu e d y_n(s)   (after slip)
!>                                            d x(s) = d y_t(s)                   (after opening)
!>   slip   d lambda_t = -mu e d y_n(k),
!>   open   d lambda_t = 0.
!>
!> Hence the period falls into a few runs of instants, whose sums of waves are geometric series: no
!> rows at instants are formed, and nothing is added up over them. Where the analysis is not the
!> projection, each run is a matrix product.
module fw_one_direction
   use fw_kinds, only: wp
   use fw_lapack, only: dgemm
   use fw_wave_sums, only: wave_sums, wave_table
   implicit none (type, external)
   private

   public :: condition, follow_one_direction, project_one_direction, project_runs, run_room

   integer, parameter :: sticks = 1, slips = 2, opens = 3

   !> What decides the rows of an instant.
   type :: condition
      integer :: state = 0
      !> The last instant that moved the position (0: none yet), and mu e there, 0 where it opened.
      integer :: since = 0
      real(wp) :: pull = 0.0_wp
   end type condition

   !> Room for sums of waves: over all instants of stick, of slip by its pull, and over one run with
   !> its coefficients (n_coefficients).
   type :: run_room
      type(wave_sums) :: stick
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(wave_sums), allocatable :: slip, one
      real(wp), allocatable :: weight(:)
   contains
      procedure :: reserve
   end type run_room

contains

   !> What decides the rows of the instants of the last of n_turns turns.
   pure subroutine follow_one_direction(n_time, n_turns, y_t, y_n, mu, touch, remembers, &
                                        starts_free, x, at)
      integer, intent(in) :: n_time, n_turns
      !> Predicted forces at the instants.
      real(wp), intent(in) :: y_t(n_time), y_n(n_time)
      !> Coefficient of friction, and distance from its limit that counts as slip [force].
      real(wp), intent(in) :: mu, touch
      !> Whether the position is carried from instant to instant (false: velocity-level law).
      logical, intent(in) :: remembers
      !> Whether the position at the start is that after a period, not a given one.
      logical, intent(in) :: starts_free
      !> Corrected position at the start, then at the end.
      real(wp), intent(inout) :: x
      type(condition), intent(out) :: at(n_time)
      type(condition) :: last
      integer :: turn

      last = condition()
      do turn = 1, n_turns
         call march(n_time, y_t, y_n, mu, touch, remembers, x, last, at)
      end do
      ! A limit repeats: what stands before its first motion is the last one of the same turn.
      if (starts_free) then
         where (at%since == 0)
            at%since = last%since
            at%pull = last%pull
         end where
      end if
   end subroutine follow_one_direction

   !> One turn.
   pure subroutine march(n_time, y_t, y_n, mu, touch, remembers, x, last, at)
      integer, intent(in) :: n_time
      real(wp), intent(in) :: y_t(n_time), y_n(n_time), mu, touch
      logical, intent(in) :: remembers
      real(wp), intent(inout) :: x
      !> The last motion, from turn to turn.
      type(condition), intent(inout) :: last
      type(condition), intent(out) :: at(n_time)
      real(wp) :: d, limit
      integer :: k

      do k = 1, n_time
         limit = mu*max(-y_n(k), 0.0_wp)
         d = y_t(k) - x
         if (y_n(k) >= 0.0_wp) then
            last = condition(opens, k, 0.0_wp)
            x = y_t(k)
         else if (abs(d) > limit - touch) then
            last = condition(slips, k, sign(mu, d))
            x = y_t(k) - sign(limit, d)
         else
            last%state = sticks
         end if
         at(k) = last
         if (remembers) cycle
         x = 0.0_wp
         last = condition()
      end do
   end subroutine march

   !> Add to the blocks of the transposed derivative (input, output) whose output is tangential,
   !> run by run of instants of one condition. They start from zero.
   subroutine project_one_direction(n_time, nc, base, analysis, at, has_normal, n, by_tangential, &
                                    by_normal)
      integer, intent(in) :: n_time, nc
      real(wp), intent(in) :: base(nc, n_time), analysis(nc, n_time)
      type(condition), intent(in) :: at(n_time)
      logical, intent(in) :: has_normal
      !> Leading dimension of the blocks.
      integer, intent(in) :: n
      real(wp), intent(inout) :: by_tangential(n, *), by_normal(n, *)
      integer :: first, last

      first = 1
      do while (first <= n_time)
         last = end_of_run(n_time, at, first)
         associate (c => at(first))
            if (c%state == sticks) then
               call dgemm('N', 'T', nc, nc, last - first + 1, 1.0_wp, base(1, first), nc, &
                          analysis(1, first), nc, 1.0_wp, by_tangential, n)
               if (c%since > 0) call take_start(nc, c, base, last - first + 1, &
                                                analysis(1, first), has_normal, n, &
                                                by_tangential, by_normal)
            else if (c%state == slips .and. has_normal) then
               call dgemm('N', 'T', nc, nc, last - first + 1, -c%pull, base(1, first), nc, &
                          analysis(1, first), nc, 1.0_wp, by_normal, n)
            end if
         end associate
         first = last + 1
      end do
   end subroutine project_one_direction

   !> The same by sums of waves.
   subroutine project_runs(waves, n_time, nc, base, at, has_normal, n, room, by_tangential, &
                           by_normal)
      type(wave_table), intent(in) :: waves
      integer, intent(in) :: n_time, nc
      real(wp), intent(in) :: base(nc, n_time)
      type(condition), intent(in) :: at(n_time)
      logical, intent(in) :: has_normal
      integer, intent(in) :: n
      type(run_room), intent(inout) :: room
      real(wp), intent(inout) :: by_tangential(n, *), by_normal(n, *)
      integer :: first, last

      call room%stick%clear()
      call room%slip%clear()
      first = 1
      do while (first <= n_time)
         last = end_of_run(n_time, at, first)
         associate (c => at(first))
            if (c%state == sticks) then
               call room%one%clear()
               call room%one%add_run(waves, first, last, 1.0_wp)
               call room%stick%add_sums(room%one)
               if (c%since > 0) then
                  ! The position stands all along the run.
                  call room%one%analyse(waves, room%weight)
                  call add_start(nc, c, base, room%weight, has_normal, n, by_tangential, by_normal)
               end if
            else if (c%state == slips .and. has_normal) then
               call room%slip%add_run(waves, first, last, -c%pull)
            end if
         end associate
         first = last + 1
      end do
      call room%stick%add_products(waves, n, by_tangential)
      if (has_normal) call room%slip%add_products(waves, n, by_normal)
   end subroutine project_runs

   !> Make room for the harmonics of a table.
   pure subroutine reserve(self, waves, nc)
      class(run_room), intent(inout) :: self
      type(wave_table), intent(in) :: waves
      integer, intent(in) :: nc

      if (allocated(self%weight)) return
      allocate (self%weight(nc), self%slip, self%one)
      call self%stick%reserve(waves)
      call self%slip%reserve(waves)
      call self%one%reserve(waves)
   end subroutine reserve

   !> The last instant of the run that starts at `first`.
   pure integer function end_of_run(n_time, at, first) result(last)
      integer, intent(in) :: n_time, first
      type(condition), intent(in) :: at(n_time)

      last = first
      do while (last < n_time)
         if (.not. continues(at(last), at(last + 1))) exit
         last = last + 1
      end do
   end function end_of_run

   !> Whether two instants, one after the other, belong to one run.
   pure logical function continues(a, b)
      type(condition), intent(in) :: a, b

      continues = a%state == b%state
      if (a%state == sticks) then
         continues = continues .and. a%since == b%since
      else
         continues = continues .and. a%pull*b%pull >= 0.0_wp
      end if
   end function continues

   !> The position of a run of stick: - d x(s), the same at all of its instants.
   subroutine take_start(nc, c, base, n_time, analysis, has_normal, n, by_tangential, by_normal)
      integer, intent(in) :: nc, n_time, n
      type(condition), intent(in) :: c
      real(wp), intent(in) :: base(nc, *), analysis(nc, n_time)
      logical, intent(in) :: has_normal
      real(wp), intent(inout) :: by_tangential(n, *), by_normal(n, *)
      real(wp) :: weight(nc)
      integer :: k

      weight = 0.0_wp
      do k = 1, n_time
         weight = weight + analysis(:, k)
      end do
      call add_start(nc, c, base, weight, has_normal, n, by_tangential, by_normal)
   end subroutine take_start

   !> The same with the sum of the analysis over the run.
   subroutine add_start(nc, c, base, weight, has_normal, n, by_tangential, by_normal)
      integer, intent(in) :: nc, n
      type(condition), intent(in) :: c
      real(wp), intent(in) :: base(nc, *), weight(nc)
      logical, intent(in) :: has_normal
      real(wp), intent(inout) :: by_tangential(n, *), by_normal(n, *)

      call add_outer(nc, -1.0_wp, base(1, c%since), weight, n, by_tangential)
      if (has_normal) call add_outer(nc, -c%pull, base(1, c%since), weight, n, by_normal)
   end subroutine add_start

   !> block = block + factor a b^T. For few coefficients a call of BLAS takes longer.
   pure subroutine add_outer(nc, factor, a, b, n, block)
      integer, intent(in) :: nc, n
      real(wp), intent(in) :: factor, a(nc), b(nc)
      real(wp), intent(inout) :: block(n, nc)
      integer :: i, j

      do j = 1, nc
         do i = 1, nc
            block(i, j) = block(i, j) + (factor*b(j))*a(i)
         end do
      end do
   end subroutine add_outer

end module fw_one_direction
