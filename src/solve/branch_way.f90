!> The whole way of a branch, to see a leap that comes back to it.
!>
!> Where no step along the tangent succeeds, a branch goes on by a step in p alone, to whatever
!> solution is found there. One that lies on the way that the branch has come, in the opposite
!> direction, is no continuation: the branch would be followed back to its first point.
module fw_branch_way
   use fw_branch_mark, only: share_at
   use fw_branch_point, only: branch_point
   use fw_branch_step, only: interpolate
   use fw_corrector, only: corrector_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: branch_way

   !> Distance from the way over the scale of y: of its cubic, which is true to less than this, and
   !> of the solution that a correction there leads to.
   real(wp), parameter :: near_cubic = 2.0e-2_wp, near_solution = 1.0e-3_wp

   type :: branch_way
      integer, private :: n = 0
      type(branch_point), allocatable, private :: point(:)
   contains
      procedure :: add
      procedure :: forget
      procedure :: holds
   end type branch_way

contains

   pure subroutine add(self, point)
      class(branch_way), intent(inout) :: self
      type(branch_point), intent(in) :: point
      type(branch_point), allocatable :: longer(:)
      integer :: k

      if (.not. allocated(self%point)) allocate (self%point(32))
      if (self%n == size(self%point)) then
         allocate (longer(2*self%n))
         do k = 1, self%n
            longer(k) = self%point(k)
         end do
         call move_alloc(longer, self%point)
      end if
      self%n = self%n + 1
      self%point(self%n) = point
   end subroutine add

   pure subroutine forget(self)
      class(branch_way), intent(inout) :: self

      self%n = 0
   end subroutine forget

   !> Whether `ahead` is a point of the way, where that runs in the other direction. The system
   !> stands elsewhere afterwards if so.
   subroutine holds(self, corrector, system, ahead, answer, error)
      class(branch_way), intent(in) :: self
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      logical, intent(out) :: answer
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: before
      real(wp), allocatable :: change(:)
      integer :: k
      logical :: done

      answer = .false.
      do k = 2, self%n
         associate (a => self%point(k - 1), b => self%point(k), metric => corrector%metric)
            if ((ahead%p - a%p)*(ahead%p - b%p) > 0.0_wp) cycle
            if ((b%p - a%p)*ahead%t_p >= 0.0_wp) cycle
            before = b
            call interpolate(metric, a, b, share_at(corrector, a, b, ahead%p), before)
            before%p = ahead%p
            if (metric%size(before%y - ahead%y) > near_cubic) cycle
            call corrector%try(system, before, change, done, error)
            if (allocated(error)) return
            ! A correction that fails tells nothing but what the cubic does.
            answer = .true.
            if (done) answer = metric%size(before%y + change - ahead%y) <= near_solution
            if (answer) return
         end associate
      end do
   end subroutine holds

end module fw_branch_way
