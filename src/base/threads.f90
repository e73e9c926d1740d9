!> Threads of a run: OpenMP over pairs and harmonics, and one thread inside each BLAS call, so
!> that the two do not oversubscribe the machine. What was set before is restored. While other
!> programs have the processors, one thread does the work of all (fw_team_rule).
module fw_threads
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_team_rule, only: span, team_rule
   use omp_lib, only: omp_get_max_threads, omp_get_thread_num, omp_set_num_threads
   implicit none (type, external)
   private

   public :: thread_scope, watch_team, pairs_for_threads, coordinates_for_threads

   !> Contact pairs, and coordinates of a joint, from which parallel regions pay. One rule for all
   !> of them, because threads that wait for the next region spin for a while (app/idle_threads.c):
   !> below, a run stays in one thread altogether (docs/benchmarks/limit.md).
   integer, parameter :: pairs_for_threads = 64
   integer, parameter :: coordinates_for_threads = 3*pairs_for_threads

   !> Threads that are looked at: more of them tell the same.
   integer, parameter :: most_watched = 64

   !> The threads that work for one thread of the host.
   type :: team_type
      !> As many as the scope has; 1: nothing is looked at.
      integer :: n_threads = 1
      type(team_rule) :: rule
      !> Where each of them tells its time in the queue, once the first region was reached.
      logical :: is_open = .false.
      integer(c_int) :: file(most_watched) = -1_c_int
      !> At the last look: time of the clock, and time in the queue of each [s].
      integer(int64) :: clock = 0_int64
      real(wp) :: queued(most_watched) = 0.0_wp
   end type team_type

   type :: thread_scope
      private
      !> Threads of OpenMP before the scope.
      integer :: outer = 0
      !> Of the scope around it.
      type(team_type) :: outer_team
   contains
      procedure :: enter
      procedure :: leave
   end type thread_scope

   !> Scopes that are open, and the threads of OpenBLAS before the first one. The switch of
   !> OpenBLAS holds for the whole process, so what belongs to it does so too: of the scopes of
   !> several threads, which may overlap, the first one sets it and the last one restores it.
   integer :: n_open = 0
   integer(c_int) :: blas_before = 1_c_int

   !> Of this thread of the host: runs in several threads have a team each.
   type(team_type) :: team
   !$omp threadprivate(team)

   interface
      integer(c_int) function open_queue() bind(c, name='fretwear_open_queue')
         import :: c_int
      end function open_queue

      ! Negative where it is not known.
      real(c_double) function time_in_queue(file) bind(c, name='fretwear_time_in_queue')
         import :: c_double, c_int
         integer(c_int), value :: file
      end function time_in_queue

      subroutine close_queue(file) bind(c, name='fretwear_close_queue')
         import :: c_int
         integer(c_int), value :: file
      end subroutine close_queue

      integer(c_int) function get_blas_threads() bind(c, name='fretwear_blas_threads')
         import :: c_int
      end function get_blas_threads

      ! Of a BLAS that is not OpenBLAS it does nothing (blas_kernel.c).
      subroutine set_blas_threads(n) bind(c, name='fretwear_set_blas_threads')
         import :: c_int
         integer(c_int), value :: n
      end subroutine set_blas_threads
   end interface

contains

   !> Use n_threads threads (0: all that OpenMP was given).
   subroutine enter(self, n_threads)
      class(thread_scope), intent(inout) :: self
      integer, intent(in) :: n_threads

      self%outer = omp_get_max_threads()
      if (n_threads > 0) call omp_set_num_threads(n_threads)
      self%outer_team = team
      team = team_type(n_threads=omp_get_max_threads())
      !$omp critical (fretwear_threads)
      if (n_open == 0) then
         blas_before = get_blas_threads()
         call set_blas_threads(1_c_int)
      end if
      n_open = n_open + 1
      !$omp end critical (fretwear_threads)
   end subroutine enter

   !> Take back what `enter` has set.
   subroutine leave(self)
      class(thread_scope), intent(in) :: self

      call close_queues()
      team = self%outer_team
      call omp_set_num_threads(self%outer)
      !$omp critical (fretwear_threads)
      n_open = n_open - 1
      if (n_open == 0) call set_blas_threads(blas_before)
      !$omp end critical (fretwear_threads)
   end subroutine leave

   !> To be called between regions, as often as one likes: take one thread for all while others
   !> have the processors, and all again later.
   subroutine watch_team(n_coordinates)
      !> Of the joint: one that is too small for threads has no team to look at.
      integer, intent(in) :: n_coordinates
      real(wp) :: passed, queued
      integer(int64) :: clock, rate

      if (team%n_threads == 1 .or. n_coordinates < coordinates_for_threads) return
      call system_clock(clock, rate)
      passed = real(clock - team%clock, wp)/real(rate, wp)
      if (passed < span .and. team%is_open) return
      team%clock = clock
      if (.not. team%is_open) then
         call open_queues()
         return
      end if
      queued = queued_since()
      ! Where the system does not tell, threads stay as they were asked for.
      if (queued < 0.0_wp) return
      call team%rule%look(passed, queued)
      call omp_set_num_threads(merge(1, team%n_threads, team%rule%alone))
   end subroutine watch_team

   !> Each thread opens what tells of it.
   subroutine open_queues()
      integer(c_int) :: file(most_watched)
      integer :: i
      real(wp) :: ignored

      file = -1_c_int
      !$omp parallel default(none) shared(file) private(i)
      i = omp_get_thread_num() + 1
      if (i <= most_watched) file(i) = open_queue()
      !$omp end parallel
      team%file = file
      team%is_open = .true.
      ignored = queued_since()
   end subroutine open_queues

   subroutine close_queues()
      integer :: i

      if (.not. team%is_open) return
      do i = 1, min(team%n_threads, most_watched)
         call close_queue(team%file(i))
      end do
   end subroutine close_queues

   !> Time in the queue since the last call, of the threads that were at work [s]; negative where it
   !> is not known of one of them.
   real(wp) function queued_since() result(queued)
      real(wp) :: now
      integer :: i

      queued = 0.0_wp
      do i = 1, min(team%n_threads, most_watched)
         now = real(time_in_queue(team%file(i)), wp)
         if (now < 0.0_wp) then
            queued = -1.0_wp
            return
         end if
         if (i == 1 .or. .not. team%rule%alone) queued = queued + now - team%queued(i)
         team%queued(i) = now
      end do
   end function queued_since

end module fw_threads
