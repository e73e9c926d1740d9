!> Multipliers that pass the unit circle between two solutions of a branch, and the functions whose
!> roots are the places where they do.
!>
!> Real multipliers above 1 and below -1 are counted, and complex ones outside of the circle. Where
!> one of the first passes, its count changes by one; a complex pair changes the third by two. Real
!> multipliers that meet outside of the circle and leave the axis change two counts at a time, and
!> nothing becomes stable or unstable by it.
module fw_stability_crossing
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: signature_of, crossing_between, test_value, critical_multiplier, multiplier_track
   public :: movement_between, may_hide
   public :: crossing_none, crossing_plus, crossing_minus, crossing_pair, crossing_several

   !> One multiplier passes 1; one passes -1; a complex pair passes; more than one of these.
   integer, parameter :: crossing_none = 0, crossing_plus = 1, crossing_minus = 2, &
                         crossing_pair = 3, crossing_several = 4
   !> Part of its modulus below which an imaginary part is that of round-off.
   real(wp), parameter :: on_axis = 1.0e-9_wp
   !> Multipliers up to which a look is taken at what two solutions may hide: those of large
   !> structures are near everything.
   integer, parameter :: most_looked_at = 24

   !> The solutions of a branch, as far as verdicts need them.
   type :: multiplier_track
      integer :: n = 0
      integer, allocatable, private :: signature(:, :)
      logical, allocatable, private :: is_decided(:)
   contains
      procedure :: add
      procedure :: is_certain
   end type multiplier_track

contains

   !> Multipliers on the real axis above 1 and below -1, and elsewhere outside of the circle.
   pure function signature_of(multipliers) result(signature)
      complex(wp), intent(in) :: multipliers(:)
      integer :: signature(3)
      logical :: is_real(size(multipliers))

      is_real = abs(aimag(multipliers)) <= on_axis*abs(multipliers)
      signature = [count(is_real .and. real(multipliers, wp) > 1.0_wp), &
                   count(is_real .and. real(multipliers, wp) < -1.0_wp), &
                   count(.not. is_real .and. abs(multipliers) > 1.0_wp)]
   end function signature_of

   !> What lies between two signatures.
   pure integer function crossing_between(a, b) result(crossing)
      integer, intent(in) :: a(3), b(3)
      integer :: change(3)

      change = abs(b - a)
      if (sum(a) == sum(b) .and. modulo(change(1), 2) == 0 .and. modulo(change(2), 2) == 0) then
         crossing = crossing_none
      else if (all(change == [1, 0, 0])) then
         crossing = crossing_plus
      else if (all(change == [0, 1, 0])) then
         crossing = crossing_minus
      else if (all(change == [0, 0, 2])) then
         crossing = crossing_pair
      else
         crossing = crossing_several
      end if
   end function crossing_between

   !> How far the multipliers that are nearest to 1 and to -1 move from one solution to the next.
   pure function movement_between(a, b) result(movement)
      complex(wp), intent(in) :: a(:), b(:)
      real(wp) :: movement(2)
      integer :: crossing

      do crossing = crossing_plus, crossing_minus
         movement(crossing) = max(minval(abs(b - critical_multiplier(a, crossing))), &
                                  minval(abs(a - critical_multiplier(b, crossing))))
      end do
   end function movement_between

   !> Whether a multiplier may pass 1 or -1 and come back between two solutions of equal counts: it
   !> is nearer to that than it moves from solution to solution.
   pure logical function may_hide(a, b, movement_before, has_fold)
      complex(wp), intent(in) :: a(:), b(:)
      !> From the solution before to `a`.
      real(wp), intent(in) :: movement_before(2)
      !> Whether the branch turns between the two, which a multiplier passes 1 for.
      logical, intent(in) :: has_fold
      real(wp) :: movement(2), distance(2)
      integer :: crossing

      may_hide = .false.
      if (size(a) > most_looked_at) return
      movement = max(movement_between(a, b), movement_before)
      do crossing = crossing_plus, crossing_minus
         if (crossing == crossing_plus .and. has_fold) cycle
         distance = [distance_to(critical_multiplier(a, crossing), crossing), &
                     distance_to(critical_multiplier(b, crossing), crossing)]
         may_hide = may_hide .or. minval(distance) < movement(crossing)
      end do
   end function may_hide

   !> Distance of the multiplier that passes from the circle, with the sign of the side: that of
   !> `before` is negative.
   pure real(wp) function test_value(multipliers, crossing, before) result(value)
      complex(wp), intent(in) :: multipliers(:)
      integer, intent(in) :: crossing
      !> Signature on the negative side.
      integer, intent(in) :: before(3)
      integer :: now(3)

      now = signature_of(multipliers)
      value = distance_to(multipliers(nearest_to(multipliers, crossing)), crossing)
      if (now(crossing) == before(crossing)) value = -value
   end function test_value

   !> The multiplier that passes.
   pure complex(wp) function critical_multiplier(multipliers, crossing) result(multiplier)
      complex(wp), intent(in) :: multipliers(:)
      integer, intent(in) :: crossing

      multiplier = multipliers(nearest_to(multipliers, crossing))
   end function critical_multiplier

   !> Place of the multiplier nearest to where a crossing is.
   pure integer function nearest_to(multipliers, crossing) result(best)
      complex(wp), intent(in) :: multipliers(:)
      integer, intent(in) :: crossing
      integer :: k

      best = 1
      do k = 2, size(multipliers)
         if (distance_to(multipliers(k), crossing) < &
             distance_to(multipliers(best), crossing)) best = k
      end do
   end function nearest_to

   !> How far a multiplier is from where it would have to cross the unit circle: at 1, at -1, or
   !> anywhere as one of a complex pair.
   pure real(wp) function distance_to(multiplier, crossing)
      complex(wp), intent(in) :: multiplier
      integer, intent(in) :: crossing

      select case (crossing)
      case (crossing_plus)
         distance_to = abs(multiplier - 1.0_wp)
      case (crossing_minus)
         distance_to = abs(multiplier + 1.0_wp)
      case default
         distance_to = abs(abs(multiplier) - 1.0_wp)
         ! Real ones are not those of a pair.
         if (abs(aimag(multiplier)) <= on_axis*abs(multiplier)) distance_to = 1.0_wp + distance_to
      end select
   end function distance_to

   !> The next solution.
   pure subroutine add(self, signature, is_decided)
      class(multiplier_track), intent(inout) :: self
      integer, intent(in) :: signature(3)
      !> Whether its multipliers leave no doubt.
      logical, intent(in) :: is_decided
      integer, allocatable :: longer(:, :)
      logical, allocatable :: flags(:)
      integer, parameter :: first_size = 64

      if (.not. allocated(self%signature)) then
         allocate (self%signature(3, first_size), self%is_decided(first_size))
      end if
      if (self%n == size(self%is_decided)) then
         allocate (longer(3, 2*self%n), flags(2*self%n))
         longer(:, :self%n) = self%signature
         flags(:self%n) = self%is_decided
         call move_alloc(longer, self%signature)
         call move_alloc(flags, self%is_decided)
      end if
      self%n = self%n + 1
      self%signature(:, self%n) = signature
      self%is_decided(self%n) = is_decided
   end subroutine add

   !> Whether a change behind solution k is more than errors of the multipliers: on either side, one
   !> of the solutions up to the next change leaves no doubt.
   pure logical function is_certain(self, k)
      class(multiplier_track), intent(in) :: self
      integer, intent(in) :: k

      is_certain = has_decided(self, k, -1) .and. has_decided(self, k + 1, 1)
   end function is_certain

   !> Whether, from an entry on and in one direction, a verdict is sure before the signature
   !> changes: what lies between two changes is believed where one of its points is sure.
   pure logical function has_decided(self, from, step)
      class(multiplier_track), intent(in) :: self
      integer, intent(in) :: from, step
      integer :: j

      has_decided = .false.
      j = from
      do while (j >= 1 .and. j <= self%n)
         if (any(self%signature(:, j) /= self%signature(:, from))) exit
         has_decided = self%is_decided(j)
         if (has_decided) exit
         j = j + step
      end do
   end function has_decided

end module fw_stability_crossing
