!> Options of fretting wear (group &wear). Defaults live here and nowhere else.
module fw_wear_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, at_most, below, from_to, operator(.and.)
   use fw_kinds, only: wp
   use fw_worn_friction, only: friction_by_energy, friction_decays, worn_friction
   implicit none (type, external)
   private

   public :: wear_options
   public :: follow_range
   public :: wear_explicit, wear_implicit, wear_pseudo_time
   public :: wear_archard, wear_energy
   public :: mu_by_depth, mu_by_energy, mu_by_none

   character(*), parameter :: wear_scheme_words(*) = &
      [character(11) :: 'explicit', 'implicit', 'pseudo_time']
   integer, parameter :: wear_explicit = 1, wear_implicit = 2, wear_pseudo_time = 3

   character(*), parameter :: wear_law_words(*) = [character(7) :: 'archard', 'energy']
   integer, parameter :: wear_archard = 1, wear_energy = 2

   character(*), parameter :: mu_by_words(*) = [character(6) :: 'none', 'depth', 'energy']
   integer, parameter :: mu_by_none = 1, mu_by_depth = 2, mu_by_energy = 3

   type :: wear_options
      !> One of the constants above.
      integer :: scheme = wear_implicit
      !> Depth proportional to pressure times slip (Archard), or to friction energy.
      integer :: law = wear_archard
      !> Wear coefficient k_w of every pair (n_pairs) [area / force]; required, no default.
      real(wp), allocatable :: coefficient(:)
      !> Order of the scheme in the cycles (0: 1 with steps of a given size, else the highest that
      !> pays).
      integer :: order = 0
      !> Vibration cycles to be covered.
      real(wp) :: n_cycles = huge(1.0_wp)
      !> Largest growth of the depth in one step [length] (0: by the error alone).
      real(wp) :: max_depth_step = 0.0_wp
      !> Largest error of the depth in one step, as a part of the largest depth (0: steps of
      !> max_depth_step where that is given, else default_error_tolerance).
      real(wp) :: error_tolerance = 0.0_wp
      !> A joint is steady when its largest rate has fallen to this part of the first.
      real(wp) :: steady_tolerance = 1.0e-6_wp
      integer :: max_steps = 1000
      !> Growth of the depth in a step that is allowed in any case, as a part of the largest depth;
      !> only where nothing in the case tells the size of the steps.
      real(wp) :: relative_step = 0.0_wp
      !> Run a second time with steps of half the size, to see how far the profile moves.
      logical :: check_steps = .false.
      !> Whether friction changes with the depth or with the friction energy; towards mu_final, over
      !> the scale [length or force*length] (n_pairs).
      integer :: mu_by = mu_by_none
      real(wp), allocatable :: mu_final(:), mu_scale(:)
      !> Keep the excitation at the resonance of the first observed quantity.
      logical :: follow_resonance = .false.
   contains
      procedure :: bind_keys
      procedure :: controls_error
      procedure :: tolerance
      procedure :: halve_steps
      procedure :: friction
   end type wear_options

   !> How far the resonance is followed, as parts of the first frequency.
   real(wp), parameter :: follow_range(2) = [0.5_wp, 1.5_wp]

   real(wp), parameter :: default_error_tolerance = 1.0e-3_wp

contains

   !> The keys of group &wear.
   subroutine bind_keys(self, keys, is_wear)
      class(wear_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is one of wear.
      logical, intent(in) :: is_wear
      ! The default, huge, stands for no limit and lies outside of what may be written.
      real(wp), parameter :: most_cycles = 1.0e300_wp

      call keys%open('wear', 'fretting wear')
      call keys%bind_word(key('scheme', &
                              'rate at the start of a step, vibration and depth together, '// &
                              'linearly implicit'), self%scheme, wear_scheme_words)
      call keys%bind_word(key('law', 'pressure times slip, or friction energy'), self%law, &
                          wear_law_words)
      call keys%bind(key('order', 'implicit 1 to 4, explicit 1 or 2; 0: chosen', from_to(0, 4), &
                         only="scheme = 'implicit', 'explicit'"), self%order)
      call keys%bind(key('coefficient', 'depth over contact force times slip over area', &
                         above(0.0_wp), 'L^2/F', 'n_pairs', absent='required for wear'), &
                     self%coefficient, needed=is_wear)
      call keys%bind(key('n_cycles', 'to be covered', above(0.0_wp) .and. at_most(most_cycles), &
                         absent='none'), self%n_cycles)
      call keys%bind(key('max_depth_step', 'growth of the depth in a step; 0: by the error alone', &
                         at_least(0.0_wp), unit='L'), self%max_depth_step)
      call keys%bind(key('error_tolerance', &
                         'of a step over the largest depth; 0: by max_depth_step, else 1e-3', &
                         at_least(0.0_wp)), self%error_tolerance)
      call keys%bind(key('steady_tolerance', &
                         'steady where the largest rate has fallen to this part of its maximum', &
                         above(0.0_wp) .and. below(1.0_wp)), self%steady_tolerance)
      call keys%bind(key('max_steps', 'steps at most', at_least(1)), self%max_steps)
      call keys%bind(key('check_steps', 'run again with halved steps'), self%check_steps)
      call keys%bind_word(key('mu_by', &
                              'friction changes with the depth, or the friction energy of its '// &
                              'pair'), self%mu_by, mu_by_words)
      call keys%bind(key('mu_final', 'that wear leads to', at_least(0.0_wp), shape='n_pairs', &
                         absent='required with mu_by', only='mu_by'), self%mu_final, &
                     needed=self%mu_by /= mu_by_none)
      call keys%bind(key('mu_scale', 'after which 1/e of the change is left', above(0.0_wp), &
                         'L or F L', 'n_pairs', absent='required with mu_by', only='mu_by'), &
                     self%mu_scale, needed=self%mu_by /= mu_by_none)
      call keys%bind(key('follow_resonance', 'stay at the peak of the first observed quantity'), &
                     self%follow_resonance)
   end subroutine bind_keys

   !> Whether the error sets the steps, not the growth of the depth alone.
   pure logical function controls_error(self)
      class(wear_options), intent(in) :: self

      controls_error = self%error_tolerance > 0.0_wp .or. self%max_depth_step <= 0.0_wp
   end function controls_error

   !> Error of a step over the largest depth, the default where none was given.
   pure real(wp) function tolerance(self)
      class(wear_options), intent(in) :: self

      tolerance = self%error_tolerance
      if (tolerance <= 0.0_wp) tolerance = default_error_tolerance
   end function tolerance

   !> How friction follows the depth: energy does by the law of wear.
   subroutine friction(self, area, worn)
      class(wear_options), intent(in) :: self
      !> Of the pairs (n_pairs) [length**2].
      real(wp), intent(in) :: area(:)
      !> Not allocated where friction stays as it is.
      type(worn_friction), allocatable, intent(out) :: worn

      if (self%mu_by == mu_by_none .or. .not. allocated(self%coefficient)) return
      if (.not. (allocated(self%mu_final) .and. allocated(self%mu_scale))) return
      allocate (worn)
      worn%final = self%mu_final
      worn%form = friction_decays
      worn%rate = 1.0_wp/self%mu_scale
      if (self%mu_by == mu_by_depth) return
      worn%rate = area/(self%coefficient*self%mu_scale)
      ! By the law of energy depth and energy go together.
      select case (self%law)
      case (wear_archard)
         worn%form = friction_by_energy
      case default
      end select
   end subroutine friction

   !> Ask for steps of half the size. The estimate of the error grows with the power of the step
   !> that the control of the steps takes it to have.
   pure subroutine halve_steps(self, order)
      class(wear_options), intent(inout) :: self
      !> Order of the scheme.
      integer, intent(in) :: order
      integer, parameter :: most_steps = 100000000
      integer :: exponent

      exponent = max(2, order)
      if (self%scheme == wear_explicit) exponent = 2
      if (self%controls_error()) self%error_tolerance = self%tolerance()/2.0_wp**exponent
      self%max_depth_step = 0.5_wp*self%max_depth_step
      self%relative_step = 0.5_wp*self%relative_step
      ! Room for them, with some for what halving rejects.
      if (self%max_steps <= most_steps) self%max_steps = 4*self%max_steps
   end subroutine halve_steps

end module fw_wear_options
