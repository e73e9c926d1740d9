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
      !> [rad/s], and how far it may be off; below 0 where that is not known.
      real(wp) :: omega = 0.0_wp, error = -1.0_wp
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
   end type bifurcation_list

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
