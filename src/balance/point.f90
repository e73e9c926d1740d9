!> What is known of one solution point; results leave the library as a list of these.
module fw_point
   use fw_kinds, only: wp
   use fw_pair_cycle, only: pair_cycle
   use fw_stability_verdict, only: verdict_undecided
   implicit none (type, external)
   private

   public :: element_work, point_type, point_sensitivity, point_stress
   public :: served_words, served_by_none, served_by_newton, served_by_other_guess, &
             served_by_smaller_steps, served_by_raised_load, served_by_pseudo_time, &
             served_by_free_guess, served_by_powell, served_by_kinsol, served_by_arclength, &
             served_by_other_balance, served_by_integration

   !> What gave the solution of a point, in the order of the constants, from 0. The solver that the
   !> case asks for has its own word where its first guess was enough; the words of the fallbacks
   !> say from where Newton's method (or that solver) reached the solution.
   character(*), parameter :: served_words(0:11) = &
      [character(13) :: 'none', 'newton', 'other guess', 'pseudo-time', 'smaller steps', &
       'raised load', 'free guess', 'powell', 'kinsol', 'arclength', &
       'other balance', 'integration']
   integer, parameter :: served_by_none = 0, served_by_newton = 1, served_by_other_guess = 2, &
                         served_by_pseudo_time = 3, served_by_smaller_steps = 4, &
                         served_by_raised_load = 5, served_by_free_guess = 6, &
                         served_by_powell = 7, served_by_kinsol = 8, served_by_arclength = 9, &
                         served_by_other_balance = 10, served_by_integration = 11

   !> Work that elements of one kind take over a cycle (n_elements) [force * length], and Fourier
   !> coefficients of their forces (n_in, n_elements, 2H+1), of kinds that show them.
   type :: element_work
      real(wp), allocatable :: values(:)
      real(wp), allocatable :: force(:, :, :)
   end type element_work

   !> Derivatives of one quantity by one parameter, or the deviation of the quantity.
   type :: point_sensitivity
      !> As in quantity_words and parameter_words; parameter 0: standard deviation; -1 for one of
      !> both: the value of the other one.
      integer :: quantity = 0
      integer :: parameter = 0
      !> The pair or spring runs faster than what is observed.
      real(wp), allocatable :: values(:)
   end type point_sensitivity

   !> Stress of the cycle at points of the structure, those of one sector after those of another
   !> where sectors differ [force/length**2].
   type :: point_stress
      !> Amplitude and mean, and the share of what the point endures, not allocated where its
      !> strength is not given (n).
      real(wp), allocatable :: amplitude(:), mean(:), utilisation(:)
      !> The point with the largest utilisation, else amplitude, from 0.
      integer :: worst = 0
      !> Points whose signed stress jumps.
      integer :: n_jumps = 0
      !> Fourier coefficients (0, c1, s1, ...) of xx, yy, zz, xy, yz, zx, point by point
      !> (2H+1, 6 n); only when asked for.
      real(wp), allocatable :: coefficients(:, :)
   end type point_stress

   type :: point_type
      !> Angular frequency of the excitation [rad/s].
      real(wp) :: omega = 0.0_wp
      !> Where on its path: omega, or the value of the parameter that a sweep goes over.
      real(wp) :: place = 0.0_wp
      !> Factor of the vibratory loads, as load%harmonic_scale is one.
      real(wp) :: load_scale = 1.0_wp
      !> Fourier coefficients of the base (2H+1), where one moves [length].
      real(wp), allocatable :: base(:)
      !> Amplitude that was asked for, where the load is found for it [length].
      real(wp) :: control = 0.0_wp
      !> Fourier coefficients (0, c1, s1, ...) of the observed quantities (2H+1, n_observed).
      real(wp), allocatable :: coefficients(:, :)
      !> Largest magnitude over the period (n_observed).
      real(wp), allocatable :: amplitude(:)
      logical :: converged = .false.
      !> What is worth telling of the way to it; not allocated where nothing is.
      character(:), allocatable :: note
      !> What gave the solution.
      integer :: served_by = served_by_none
      !> Harmonics of the balance and instants per period; 0 where they are those of the case.
      integer :: n_harmonics = 0
      integer :: n_time = 0
      !> Bound of the relative error of the response; 0 where none was asked for, huge(1.0_wp) where
      !> none is known.
      real(wp) :: error_estimate = 0.0_wp
      !> The branch turns here.
      logical :: fold = .false.
      !> Direction of the branch: changes of omega [rad/s] or of the parameter, and of the
      !> coefficients, of any common length; only along a branch.
      real(wp) :: tangent_omega = 0.0_wp, tangent_parameter = 0.0_wp
      real(wp), allocatable :: tangent(:, :)
      !> Floquet multipliers, only when asked for, how far each may be off, huge(1.0_wp) where that
      !> is not known (n_multipliers), and whether all lie in the unit circle.
      complex(wp), allocatable :: multipliers(:)
      real(wp), allocatable :: multiplier_error(:)
      integer :: verdict = verdict_undecided
      integer :: iterations = 0
      !> norm(R)/norm(F) at the end.
      real(wp) :: residual = 0.0_wp
      !> Time spent on the point [s].
      real(wp) :: seconds = 0.0_wp
      !> Fourier coefficients of the contact forces (3, n_pairs, 2H+1) [force].
      real(wp), allocatable :: force(:, :, :)
      !> Share of the period in stick, slip and open (3, n_pairs).
      real(wp), allocatable :: fraction(:, :)
      !> Friction energy per cycle (n_pairs) [force * length].
      real(wp), allocatable :: dissipation(:)
      !> Work per cycle that obstacles which move do (n_pairs) [force * length].
      real(wp), allocatable :: obstacle_work(:)
      !> The same of elements that are neither pairs nor springs, kind by kind.
      type(element_work), allocatable :: work_of(:)
      !> Largest velocity of the vibration along that of side 2, as a part of this (n_pairs): 0 of
      !> pairs that do not bear or whose side 2 does not slide.
      real(wp), allocatable :: overtaking(:)
      !> Work of hysteretic damping per cycle [force * length], and the rotation speed where it
      !> follows the frequency [rad/s].
      real(wp) :: structural_work = 0.0_wp
      real(wp) :: speed = 0.0_wp
      !> Of a nonlinear mode: self-excitation [1/s], modal amplitude [length mass**(1/2)], and the
      !> amplitude of the first harmonic of what is observed, not allocated elsewhere (n_observed).
      real(wp) :: self_excitation = 0.0_wp, modal_amplitude = 0.0_wp
      real(wp), allocatable :: first_harmonic(:)
      !> Of a step of wear: cycles so far, depth [length] and depth per cycle (n_pairs).
      real(wp) :: cycles = 0.0_wp
      real(wp), allocatable :: depth(:), wear_rate(:)
      !> Friction coefficients at these depths, where they change with them (n_pairs).
      real(wp), allocatable :: worn_mu(:)
      !> Of a mission: flights begun so far and the block, 0 before the first.
      integer :: flight = 0, block = 0
      !> Friction energy that the worn depth stands for (n_pairs) [force * length], and the worn
      !> volume of every patch (n_patches) [length**3].
      real(wp), allocatable :: wear_energy(:), wear_volume(:)
      !> Observed quantities over one period, only when asked for (n_time, n_observed).
      real(wp), allocatable :: history(:, :)
      !> Contact forces and relative displacements over one period, only when asked for
      !> (3, n_pairs, n_time).
      real(wp), allocatable :: force_history(:, :, :), slip_history(:, :, :)
      !> The same of the pairs that dissipate most, only when asked for.
      type(pair_cycle), allocatable :: cycle
      !> Instants of a period that its forces ask for, where they had fewer; else 0.
      integer :: instants_wanted = 0
      !> Derivatives by parameters, only when asked for; NaN where there is none, as at a fold.
      type(point_sensitivity), allocatable :: sensitivity(:)
      !> Of models with rows of stress, where the case asks for it.
      type(point_stress), allocatable :: stress
   end type point_type

end module fw_point
