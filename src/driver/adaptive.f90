!> Harmonics as many as a point needs (adaptive = .true.): a point is solved again with more of them
!> until the force left out of the balance is within the tolerance; the next starts with fewer
!> where these would have done.
!>
!> Systems are built when their number of harmonics is first asked for, and kept. The solution at
!> one number is the guess at the next.
module fw_adaptive
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_hbm, only: hbm_system
   use fw_kinds, only: wp
   use fw_left_out, only: force_left_out
   use fw_point, only: point_type
   use fw_point_solver, only: point_solver
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution
   implicit none (type, external)
   private

   public :: adaptive_solver

   !> From one number of harmonics to the next; numbers are odd, for the sake of odd-only balances.
   real(wp), parameter :: growth = 1.5_wp
   !> Harmonics are given up only where fewer leave out this part of the tolerance.
   real(wp), parameter :: with_margin = 0.5_wp

   type :: level_type
      type(case_type) :: case
      type(hbm_system) :: system
      type(point_solver) :: solver
      logical :: is_built = .false.
   end type level_type

   type :: adaptive_solver
      !> Numbers of harmonics to choose from, ascending.
      integer, allocatable :: n_harmonics(:)
      !> The one in use.
      integer :: current = 1
      !> Points that would have needed more than the most.
      integer :: n_short = 0
      type(level_type), allocatable :: level(:)
   contains
      procedure :: start
      procedure :: solve
      procedure, private :: build
   end type adaptive_solver

contains

   !> The case gives the largest number of harmonics.
   subroutine start(self, case, error)
      class(adaptive_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: h

      self%n_harmonics = [integer ::]
      h = 1
      do while (h < case%harmonics%n_harmonics)
         self%n_harmonics = [self%n_harmonics, h]
         h = max(h + 2, 2*(nint(growth*h)/2) + 1)
      end do
      self%n_harmonics = [self%n_harmonics, case%harmonics%n_harmonics]
      allocate (self%level(size(self%n_harmonics)))
      call self%build(case, 1, error)
   end subroutine start

   subroutine build(self, case, k, error)
      class(adaptive_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(error_type), allocatable, intent(out) :: error

      associate (level => self%level(k))
         if (level%is_built) return
         level%case = case
         level%case%harmonics%n_harmonics = self%n_harmonics(k)
         call build_system(level%case, level%system, error)
         if (allocated(error)) return
         call level%solver%start(level%case, level%system%n)
         level%is_built = .true.
      end associate
   end subroutine build

   !> Solve at a frequency; the point says how many harmonics it took.
   subroutine solve(self, case, omega, point, error)
      class(adaptive_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: omega
      type(point_type), intent(out) :: point
      type(error_type), allocatable, intent(out) :: error
      type(level_type), pointer :: level
      real(wp) :: seconds
      integer :: iterations

      iterations = 0
      seconds = 0.0_wp
      do
         level => self%level(self%current)
         call level%solver%solve(level%case, level%system, omega, point, error)
         if (allocated(error)) return
         iterations = iterations + point%iterations
         seconds = seconds + point%seconds
         if (.not. point%converged) exit
         if (force_left_out(level%system, self%n_harmonics(self%current)) &
             <= case%harmonics%adaptive_tolerance) exit
         if (self%current == size(self%level)) then
            self%n_short = self%n_short + 1
            exit
         end if
         call change(self, case, self%current + 1, error)
         if (allocated(error)) return
      end do
      point%n_harmonics = self%n_harmonics(self%current)
      point%iterations = iterations
      point%seconds = seconds
      if (self%current == 1 .or. .not. point%converged) return
      if (force_left_out(level%system, self%n_harmonics(self%current - 1)) &
          <= with_margin*case%harmonics%adaptive_tolerance) then
         call change(self, case, self%current - 1, error)
      end if
   end subroutine solve

   !> Go over to another number of harmonics, with the present solution as the last known one.
   subroutine change(self, case, next, error)
      class(adaptive_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      integer, intent(in) :: next
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: x(:)

      call self%build(case, next, error)
      if (allocated(error)) return
      associate (source => self%level(self%current), target => self%level(next))
         allocate (x(target%system%n))
         call carry_solution(source%system, source%solver%x, target%system, x)
         call target%solver%know(x, source%solver%omega_last)
         target%system%contact%x_start = source%system%contact%x_start
      end associate
      self%current = next
   end subroutine change

end module fw_adaptive
