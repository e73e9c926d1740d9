!> Whether a branch that turns at a corner runs back along itself.
!>
!> A curve does not come back along its own points. At a place where many pieces meet, round-off may
!> give the piece beyond the orientation of the way back, and the branch would then be followed to
!> its first point without an end. The last points before a turn are kept; a point further on after
!> the turn that lies on their cubics, with the opposite tangent, is one of theirs.
module fw_branch_retrace
   use fw_branch_mark, only: share_at
   use fw_branch_point, only: branch_point, metric_type
   use fw_branch_step, only: interpolate
   use fw_corrector, only: corrector_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_newton, only: solver_report
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: branch_trail

   !> Steps shrink by half towards a corner: these reach back beyond the longest that turn sharply.
   integer, parameter :: most_kept = 24
   !> Cosine of the angle between tangents up to which they are opposite.
   real(wp), parameter :: opposite = -0.98_wp
   !> Distance from the way before, over that from the turn: of a cubic through it, and of its
   !> solution.
   real(wp), parameter :: near_cubic = 0.03_wp, near_solution = 1.0e-3_wp
   !> How far behind the turn it is looked at, at most, and how often that is halved.
   real(wp), parameter :: furthest = 1.0e-2_wp
   integer, parameter :: most_halvings = 10

   !> The last points of a branch before p turned, and those since.
   type :: branch_trail
      logical :: has_turned = .false.
      integer, private :: n = 0, n_since = 0
      type(branch_point), private :: point(most_kept)
      ! Allocatable to be freed: CONTRIBUTING, Style in short.
      type(branch_point), allocatable, private :: since(:)
   contains
      procedure :: keep
      procedure :: forget
      procedure :: is_retraced
      procedure :: n_kept
      procedure :: back
   end type branch_trail

contains

   !> The branch has come to a point. The points before a turn are those looked at until it has
   !> gone away from there.
   pure subroutine keep(self, metric, point)
      class(branch_trail), intent(inout) :: self
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: point

      if (self%n > 0 .and. .not. self%has_turned) then
         self%has_turned = self%point(self%n)%t_p*point%t_p < 0.0_wp
      end if
      if (.not. self%has_turned) then
         call append(self%point, self%n, point)
         return
      end if
      if (.not. allocated(self%since)) allocate (self%since(most_kept))
      call append(self%since, self%n_since, point)
      if (metric%chord(self%point(self%n), point) <= 2.0_wp*furthest) return
      self%n = self%n_since
      self%point(:self%n) = self%since(:self%n)
      self%n_since = 0
      self%has_turned = .false.
   end subroutine keep

   !> One point more; the first makes room.
   pure subroutine append(list, n, point)
      type(branch_point), intent(inout) :: list(most_kept)
      integer, intent(inout) :: n
      type(branch_point), intent(in) :: point
      integer :: k

      if (n == most_kept) then
         do k = 2, most_kept
            list(k - 1) = list(k)
         end do
         n = most_kept - 1
      end if
      n = n + 1
      list(n) = point
   end subroutine append

   !> The branch goes on elsewhere.
   pure subroutine forget(self)
      class(branch_trail), intent(inout) :: self

      self%n = 0
      self%n_since = 0
      self%has_turned = .false.
   end subroutine forget

   pure integer function n_kept(self)
      class(branch_trail), intent(in) :: self

      n_kept = self%n
   end function n_kept

   !> The last point but k.
   pure subroutine back(self, k, point)
      class(branch_trail), intent(in) :: self
      integer, intent(in) :: k
      type(branch_point), intent(out) :: point

      point = self%point(self%n - k)
   end subroutine back

   !> Whether the branch, at `ahead` just beyond a turn, runs back along the points kept.
   subroutine is_retraced(self, corrector, system, ahead, answer, error)
      class(branch_trail), intent(in) :: self
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: ahead
      logical, intent(out) :: answer
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: beyond, before
      real(wp) :: length
      integer :: k
      logical :: found

      answer = .false.
      if (.not. may_retrace(self, corrector%metric, ahead)) return
      length = furthest
      do k = 0, most_halvings
         beyond = ahead
         beyond%x = ahead%x + length*ahead%t
         beyond%y = ahead%y + length*ahead%t_y
         beyond%p = ahead%p + length*ahead%t_p
         beyond%report = solver_report()
         call corrector%correct(system, ahead, length, beyond, error)
         if (allocated(error)) return
         found = beyond%report%converged
         if (found) call find_before(self, corrector, beyond%p, before, found)
         if (found) exit
         length = 0.5_wp*length
      end do
      if (found) call compare(corrector, system, self%point(self%n), beyond, before, answer, error)
   end subroutine is_retraced

   !> Whether the tangent is opposite to one before: else nothing has to be solved for.
   pure logical function may_retrace(self, metric, ahead)
      class(branch_trail), intent(in) :: self
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: ahead
      integer :: k

      may_retrace = .false.
      if (self%n < 2) return
      do k = 1, self%n
         may_retrace = may_retrace .or. cosine(metric, self%point(k), ahead) <= opposite
      end do
   end function may_retrace

   !> The way before the turn at a value of p, on its cubics.
   pure subroutine find_before(self, corrector, p, before, found)
      class(branch_trail), intent(in) :: self
      type(corrector_type), intent(in) :: corrector
      real(wp), intent(in) :: p
      type(branch_point), intent(out) :: before
      logical, intent(out) :: found
      integer :: k

      found = .false.
      do k = self%n, 2, -1
         associate (a => self%point(k - 1), b => self%point(k))
            found = (p - a%p)*(p - b%p) <= 0.0_wp .and. abs(b%p - a%p) > 0.0_wp
            if (.not. found) cycle
            before = b
            call interpolate(corrector%metric, a, b, share_at(corrector, a, b, p), before)
            before%p = p
            return
         end associate
      end do
   end subroutine find_before

   !> Whether both are one point of the branch, in opposite directions.
   subroutine compare(corrector, system, turn, beyond, before, answer, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: turn, beyond, before
      logical, intent(out) :: answer
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: change(:)
      real(wp) :: way
      logical :: done

      associate (metric => corrector%metric)
         way = metric%chord(turn, beyond)
         answer = metric%size(before%y - beyond%y) <= near_cubic*way .and. &
                  cosine(metric, before, beyond) <= opposite
         if (.not. answer) return
         ! Two pieces at a small angle are told apart by the solution before the turn.
         call corrector%try(system, before, change, done, error)
         if (allocated(error) .or. .not. done) return
         answer = metric%size(before%y + change - beyond%y) <= near_solution*way
      end associate
   end subroutine compare

   !> Of the angle between two tangents.
   pure real(wp) function cosine(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b

      cosine = metric%inner(a%t_y, a%t_p, b%t_y, b%t_p)/ &
               (metric%length(a%t_y, a%t_p)*metric%length(b%t_y, b%t_p))
   end function cosine

end module fw_branch_retrace
