!> Steps towards the least value of a function of numbers between -1 and 1: L-BFGS for those that
!> are free, the others staying at their bounds.
!>
!> Source: Byrd, Lu, Nocedal, Zhu (1995), A limited memory algorithm for bound constrained
!> optimization; here with the two-loop recursion over what is free.
module fw_box_steps
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: box_steps, are_free, gain_left

   !> Pairs of steps and changes of the slope that are kept.
   integer, parameter :: most_pairs = 8

   type :: box_steps
      integer, private :: n_pairs = 0
      !> (n, most_pairs), the last ones first.
      real(wp), allocatable, private :: step(:, :), change(:, :)
   contains
      procedure :: forget
      procedure :: learn
      procedure :: direction
   end type box_steps

contains

   !> Which numbers may go down the slope g.
   pure function are_free(t, g) result(free)
      real(wp), intent(in) :: t(:), g(:)
      logical :: free(size(t))

      free = abs(g) > 0.0_wp .and. .not. (t <= -1.0_wp .and. g > 0.0_wp) .and. &
             .not. (t >= 1.0_wp .and. g < 0.0_wp)
   end function are_free

   !> What the slope promises at most of any one number on its way to its bound.
   pure real(wp) function gain_left(t, g) result(gain)
      real(wp), intent(in) :: t(:), g(:)

      gain = maxval([0.0_wp, abs(g)*(1.0_wp + sign(1.0_wp, g)*t)], dim=1)
   end function gain_left

   !> Another start.
   pure subroutine forget(self)
      class(box_steps), intent(inout) :: self

      self%n_pairs = 0
   end subroutine forget

   !> What a step has changed the slope by. A function that is not convex along it teaches nothing.
   pure subroutine learn(self, step, change)
      class(box_steps), intent(inout) :: self
      real(wp), intent(in) :: step(:), change(:)
      real(wp), parameter :: least_curvature = 1.0e-10_wp
      integer :: n

      if (dot_product(step, change) <= least_curvature*norm2(step)*norm2(change)) return
      if (.not. allocated(self%step)) allocate (self%step(size(step), most_pairs), &
                                                self%change(size(step), most_pairs))
      n = min(self%n_pairs, most_pairs - 1)
      self%step(:, 2:n + 1) = self%step(:, :n)
      self%change(:, 2:n + 1) = self%change(:, :n)
      self%step(:, 1) = step
      self%change(:, 1) = change
      self%n_pairs = n + 1
   end subroutine learn

   !> A direction down the slope g of what is free at t; at first to the corner that the slope
   !> points at.
   pure function direction(self, t, g) result(d)
      class(box_steps), intent(in) :: self
      real(wp), intent(in) :: t(:), g(:)
      real(wp) :: d(size(t))
      real(wp) :: weight(most_pairs), curve
      logical :: free(size(t)), learnt(most_pairs)
      integer :: k

      free = are_free(t, g)
      learnt = .false.
      d = merge(g, 0.0_wp, free)
      curve = 0.0_wp
      do k = 1, self%n_pairs
         associate (s => merge(self%step(:, k), 0.0_wp, free), &
                    y => merge(self%change(:, k), 0.0_wp, free))
            learnt(k) = dot_product(s, y) > 0.0_wp
            if (.not. learnt(k)) cycle
            if (.not. curve > 0.0_wp) curve = dot_product(s, y)/dot_product(y, y)
            weight(k) = dot_product(s, d)/dot_product(s, y)
            d = d - weight(k)*y
         end associate
      end do
      d = curve*d
      do k = self%n_pairs, 1, -1
         if (.not. learnt(k)) cycle
         associate (s => merge(self%step(:, k), 0.0_wp, free), &
                    y => merge(self%change(:, k), 0.0_wp, free))
            d = d + (weight(k) - dot_product(y, d)/dot_product(s, y))*s
         end associate
      end do
      d = -d
      if (curve > 0.0_wp .and. dot_product(d, g) < 0.0_wp) return
      d = merge(-sign(1.0_wp, g) - t, 0.0_wp, free)
   end function direction

end module fw_box_steps
