!> The lowest and the highest value of a response over the residual tractions of its pairs, shares
!> from -1 to 1: descents with projection from several shares, each solved from the one before.
!>
!> Every share that is solved is kept: ends are often corners, which several descents come to.
module fw_share_search
   use fw_box_steps, only: box_steps, gain_left
   use fw_error, only: error_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: share_point, share_search, share_solver

   !> A response at some shares.
   type :: share_point
      !> Shares, and derivatives of the value by them (n_pairs).
      real(wp), allocatable :: t(:)
      real(wp), allocatable :: slope(:)
      !> Unknowns of the balance.
      real(wp), allocatable :: x(:)
      real(wp) :: value = 0.0_wp
      !> Whether a descent to the lowest and one to the highest value has gone on from here.
      logical :: is_left(2) = .false.
   end type share_point

   !> Who solves responses.
   type, abstract :: share_solver
   contains
      procedure(solve_shares), deferred :: solve
   end type share_solver

   abstract interface
      !> At shares from the response at others; `found` is without value where there is none.
      subroutine solve_shares(self, from, shares, found, done, error)
         import :: share_solver, share_point, error_type, wp
         implicit none (type, external)
         class(share_solver), intent(inout) :: self
         type(share_point), intent(in) :: from
         real(wp), intent(in) :: shares(:)
         type(share_point), intent(out) :: found
         logical, intent(out) :: done
         type(error_type), allocatable, intent(out) :: error
      end subroutine solve_shares
   end interface

   !> A search at one frequency.
   type :: share_search
      !> Places in `known` of the lowest and the highest value.
      integer :: at(2) = 1
      !> Responses that are known, the centre first, and shares that could not be solved for.
      integer :: n_known = 0, n_failed = 0
      type(share_point), allocatable :: known(:)
   contains
      procedure :: find
      procedure, private :: go_to
      procedure, private :: descend
   end type share_search

   !> Part of the value that the slope may still promise at an end: what is left there is of second
   !> order in it.
   real(wp), parameter :: enough = 1.0e-7_wp
   !> Shares that are one and the same.
   real(wp), parameter :: same = 1.0e-12_wp
   integer, parameter :: most_steps = 20, most_trials = 5

contains

   !> Both ends, from a centre that is solved.
   subroutine find(self, solver, centre, n_starts, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      type(share_point), intent(in) :: centre
      !> The centre, both ends of its slope, and corners that are drawn.
      integer, intent(in) :: n_starts
      type(error_type), allocatable, intent(out) :: error
      integer :: side, start, at, state

      allocate (self%known(8))
      self%known(1) = centre
      self%n_known = 1
      ! The same corners at each frequency: no row depends on those before.
      state = 1
      do start = 1, n_starts
         call self%go_to(solver, 1, start_of(centre, start, state), at, error)
         if (allocated(error)) return
         if (at == 0) cycle
         do side = 1, 2
            call self%descend(solver, side, at, error)
            if (allocated(error)) return
         end do
      end do
      associate (values => self%known(:self%n_known)%value)
         self%at = [minloc(values, dim=1), maxloc(values, dim=1)]
      end associate
   end subroutine find

   !> Shares of a start; those that the centre does not depend on stay in the middle.
   function start_of(centre, number, state) result(t)
      type(share_point), intent(in) :: centre
      integer, intent(in) :: number
      !> Of the numbers that are drawn.
      integer, intent(inout) :: state
      real(wp) :: t(size(centre%t))
      integer, parameter :: middle = 1073741824
      integer :: i

      select case (number)
      case (1)
         t = centre%t
      case (2, 3)
         t = merge(0.0_wp, sign(1.0_wp, centre%slope), abs(centre%slope) <= 0.0_wp)
         if (number == 3) t = -t
      case default
         do i = 1, size(t)
            state = next_number(state)
            t(i) = merge(1.0_wp, -1.0_wp, state > middle)
         end do
      end select
   end function start_of

   !> Park and Miller's generator by Schrage's method, which needs no wider integers.
   pure integer function next_number(state) result(next)
      integer, intent(in) :: state
      !> Quotient and rest of huge(1) by the factor.
      integer, parameter :: factor = 16807, whole = 127773, rest = 2836

      next = factor*modulo(state, whole) - rest*(state/whole)
      if (next <= 0) next = next + huge(1)
   end function next_number

   !> The response at shares: known already, or solved from that at place `from`; 0 where there is
   !> none.
   subroutine go_to(self, solver, from, shares, at, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: from
      real(wp), intent(in) :: shares(:)
      integer, intent(out) :: at
      type(error_type), allocatable, intent(out) :: error
      type(share_point), allocatable :: longer(:)
      type(share_point) :: found
      logical :: done

      do at = 1, self%n_known
         if (maxval(abs(self%known(at)%t - shares)) <= same) return
      end do
      at = 0
      call solver%solve(self%known(from), shares, found, done, error)
      if (allocated(error)) return
      if (.not. done) then
         self%n_failed = self%n_failed + 1
         return
      end if
      if (self%n_known == size(self%known)) then
         allocate (longer(2*self%n_known))
         longer(:self%n_known) = self%known
         call move_alloc(longer, self%known)
      end if
      self%n_known = self%n_known + 1
      at = self%n_known
      self%known(at) = found
   end subroutine go_to

   !> Down to the lowest value (side 1) or up to the highest (2) that shares near by lead to.
   subroutine descend(self, solver, side, start, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      integer, intent(in) :: side, start
      type(error_type), allocatable, intent(out) :: error
      type(box_steps) :: steps
      real(wp), allocatable :: d(:), g(:)
      real(wp) :: turn
      integer :: at, k, next

      turn = merge(1.0_wp, -1.0_wp, side == 1)
      at = start
      do k = 1, most_steps
         if (self%known(at)%is_left(side)) return
         self%known(at)%is_left(side) = .true.
         associate (p => self%known(at))
            g = turn*p%slope
            if (gain_left(p%t, g) <= enough*abs(p%value)) return
            d = steps%direction(p%t, g)
         end associate
         call search_along(self, solver, turn, at, d, next, error)
         if (allocated(error)) return
         if (next == 0) return
         call steps%learn(self%known(next)%t - self%known(at)%t, &
                          turn*(self%known(next)%slope - self%known(at)%slope))
         at = next
      end do
   end subroutine descend

   !> The first response along the projected direction that gains enough; 0 where none does.
   subroutine search_along(self, solver, turn, at, d, next, error)
      class(share_search), intent(inout) :: self
      class(share_solver), intent(inout) :: solver
      real(wp), intent(in) :: turn, d(:)
      integer, intent(in) :: at
      integer, intent(out) :: next
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: sufficient = 1.0e-4_wp, shorter = 0.25_wp
      real(wp) :: length, shares(size(d)), step(size(d))
      integer :: k, trial

      length = 1.0_wp
      next = 0
      do k = 1, most_trials
         shares = max(-1.0_wp, min(1.0_wp, self%known(at)%t + length*d))
         step = shares - self%known(at)%t
         call self%go_to(solver, at, shares, trial, error)
         if (allocated(error)) return
         if (trial == 0) then
            length = shorter*length
            cycle
         end if
         associate (p => self%known(at), q => self%known(trial))
            if (turn*(q%value - p%value) <= sufficient*turn*dot_product(p%slope, step)) then
               next = trial
               return
            end if
            length = length*part_of(turn*(q%value - p%value), turn*dot_product(p%slope, step), &
                                    turn*dot_product(q%slope, step))
         end associate
      end do
   end subroutine search_along

   !> Where the cubic with a change of value and both slopes over the unit step is least, kept off
   !> the ends.
   pure real(wp) function part_of(change, first, last) result(part)
      real(wp), intent(in) :: change, first, last
      real(wp) :: a, b, root

      a = first + last - 2.0_wp*change
      b = 3.0_wp*change - 2.0_wp*first - last
      part = 0.5_wp
      ! The root with the positive second derivative, without cancellation of a small a.
      root = b + sqrt(max(0.0_wp, b**2 - 3.0_wp*a*first))
      if (root > tiny(1.0_wp)) part = -first/root
      part = max(0.1_wp, min(0.7_wp, part))
   end function part_of

end module fw_share_search
