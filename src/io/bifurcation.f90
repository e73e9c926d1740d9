!> Places of a response where its stability changes, or where it turns.
module fw_bifurcation
   use fw_kinds, only: wp
   use fw_stability_crossing, only: multiplier_track
   implicit none (type, external)
   private

   public :: bifurcation_type, bifurcation_list
   public :: kind_words, kind_fold, kind_doubling, kind_torus, kind_symmetry, kind_branch, &
             kind_nonsmooth, kind_undecided
   public :: way_words, way_turn, way_multiplier, way_bracket

   !> What happens there, in the order of the constants, from 0: the frequency turns back (a real
   !> multiplier passes 1); one passes -1; a complex pair leaves the unit circle; one passes 1 at a
   !> response with half-wave symmetry, or at one without; the multipliers jump over the circle, as
   !> where friction or a gap changes its state; the multipliers are no more certain than that.
   character(*), parameter :: kind_words(0:6) = &
      [character(17) :: 'fold', 'period doubling', 'Neimark-Sacker', 'symmetry breaking', &
       'branch point', 'nonsmooth', 'undecided']
   integer, parameter :: kind_fold = 0, kind_doubling = 1, kind_torus = 2, kind_symmetry = 3, &
                         kind_branch = 4, kind_nonsmooth = 5, kind_undecided = 6

   !> How it was found: the branch turns; a multiplier was brought to the circle by further
   !> solutions; it lies between two solutions, and no nearer ones were found.
   character(*), parameter :: way_words(0:2) = [character(10) :: 'turn', 'multiplier', 'bracket']
   integer, parameter :: way_turn = 0, way_multiplier = 1, way_bracket = 2

   type :: bifurcation_type
      integer :: kind = kind_undecided
      !> The frequency [rad/s], or the value of the parameter that the sweep goes over, and how far
      !> it may be off; below 0 where that is not known.
      real(wp) :: place = 0.0_wp, error = -1.0_wp
      !> Largest magnitude over the period (n_observed).
      real(wp), allocatable :: amplitude(:)
      !> Coefficients (0, c1, s1, ...) of the observed quantities (2H+1, n_observed).
      real(wp), allocatable :: coefficients(:, :)
      !> The multiplier on the unit circle; 0 where none is known.
      complex(wp) :: multiplier = (0.0_wp, 0.0_wp)
      integer :: found_by = way_turn
      !> Number of the solution with multipliers before it (0: stands for itself).
      integer :: after = 0
   end type bifurcation_type

   !> In the order in which they were found.
   type :: bifurcation_list
      integer :: n = 0
      type(bifurcation_type), allocatable :: item(:)
   contains
      procedure :: add
      procedure :: doubt
      procedure :: merge_turns
   end type bifurcation_list

   !> Two turns are one place where frequencies and amplitudes agree to this, relative.
   real(wp), parameter :: same_place = 1.0e-9_wp, same_amplitude = 1.0e-6_wp
   !> A multiplier that passes 1 this near to a fold, whose own is off 1 by so much, is that of the
   !> fold.
   real(wp), parameter :: beside = 3.0e-4_wp, beside_amplitude = 0.03_wp, off_one = 1.0e-3_wp

contains

   subroutine add(self, bifurcation)
      class(bifurcation_list), intent(inout) :: self
      type(bifurcation_type), intent(in) :: bifurcation
      type(bifurcation_type), allocatable :: longer(:)
      integer :: k

      if (.not. allocated(self%item)) allocate (self%item(8))
      if (self%n == size(self%item)) then
         allocate (longer(2*self%n))
         do k = 1, self%n
            longer(k) = self%item(k)
         end do
         call move_alloc(longer, self%item)
      end if
      self%n = self%n + 1
      self%item(self%n) = bifurcation
   end subroutine add

   !> Turns that are one place become one, or none where the branch goes on as before; what
   !> truncation may have made of a curve is left open: two turns with next to no way back between
   !> them, and a multiplier that passes 1 beside a fold instead of at it.
   subroutine merge_turns(self, ripple)
      class(bifurcation_list), intent(inout) :: self
      !> Way back between two turns, relative to the place, that truncation may have made.
      real(wp), intent(in) :: ripple
      type(bifurcation_type), allocatable :: kept(:)
      integer :: k, last, n

      if (self%n < 2) return
      allocate (kept(self%n))
      n = 0
      do k = 1, self%n
         last = 0
         if (self%item(k)%found_by == way_turn) last = last_turn(kept(:n))
         if (last > 0) then
            if (is_same(kept(last), self%item(k))) then
               ! Back and forth at one place: the turn before is undone.
               kept(last:n - 1) = kept(last + 1:n)
               n = n - 1
               cycle
            end if
            if (abs(kept(last)%place - self%item(k)%place) <= ripple*abs(self%item(k)%place)) then
               call leave_open(kept(last), self%item(k)%place)
               call leave_open(self%item(k), kept(last)%place)
            end if
         end if
         n = n + 1
         kept(n) = self%item(k)
      end do
      do k = 1, n
         if (kept(k)%kind == kind_branch) then
            if (any(is_beside(kept(:n), kept(k)))) kept(k)%kind = kind_undecided
         end if
      end do
      self%n = n
      call move_alloc(kept, self%item)
   end subroutine merge_turns

   pure integer function last_turn(items) result(last)
      type(bifurcation_type), intent(in) :: items(:)

      do last = size(items), 1, -1
         if (items(last)%found_by == way_turn) return
      end do
      last = 0
   end function last_turn

   pure logical function is_same(a, b)
      type(bifurcation_type), intent(in) :: a, b

      is_same = abs(a%place - b%place) <= same_place*abs(b%place) .and. &
                maxval(abs(a%amplitude - b%amplitude)) <= same_amplitude*maxval(b%amplitude)
   end function is_same

   !> The other turn is as far as the place may be off.
   pure subroutine leave_open(item, other)
      type(bifurcation_type), intent(inout) :: item
      real(wp), intent(in) :: other

      item%kind = kind_undecided
      item%error = abs(item%place - other)
   end subroutine leave_open

   !> Whether a turn, whose multiplier should be 1 and is not, lies beside a place.
   elemental logical function is_beside(fold, place)
      type(bifurcation_type), intent(in) :: fold, place

      is_beside = fold%found_by == way_turn .and. &
                  abs(fold%place - place%place) <= beside*abs(place%place) .and. &
                  abs(fold%multiplier - 1.0_wp) > off_one .and. abs(fold%multiplier) > 0.0_wp
      if (.not. is_beside) return
      is_beside = maxval(abs(fold%amplitude - place%amplitude)) <= &
                  beside_amplitude*maxval(place%amplitude)
   end function is_beside

   !> Leave open what errors of the multipliers may have made.
   pure subroutine doubt(self, track)
      class(bifurcation_list), intent(inout) :: self
      !> The solutions that the list was made from.
      type(multiplier_track), intent(in) :: track
      integer :: k

      do k = 1, self%n
         associate (item => self%item(k))
            if (item%after == 0 .or. item%kind == kind_fold .or. item%kind == kind_nonsmooth) cycle
            if (.not. track%is_certain(item%after)) item%kind = kind_undecided
         end associate
      end do
   end subroutine doubt

end module fw_bifurcation
