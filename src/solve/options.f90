!> Options of the nonlinear solvers. Defaults live here and nowhere else; the words are those
!> of the namelist, in the order of the constants.
module fw_solver_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: solver_options, pseudo_time_options, sweep_options
   public :: solver_words, solver_newton, solver_powell, solver_kinsol, solver_pseudo_time
   public :: linear_words, linear_auto, linear_lu, linear_krylov
   public :: jacobian_words, jacobian_analytic, jacobian_difference
   public :: flow_words, flow_rotated, flow_identity, flow_preconditioned
   public :: scheme_words, scheme_implicit_euler, scheme_bdf, scheme_rosenbrock, &
             scheme_runge_kutta
   public :: unit_words, unit_rad_per_second, unit_hertz
   public :: continuation_words, continuation_natural, continuation_arclength

   character(*), parameter :: solver_words(*) = &
      [character(11) :: 'newton', 'powell', 'kinsol', 'pseudo_time']
   integer, parameter :: solver_newton = 1, solver_powell = 2, solver_kinsol = 3, &
                         solver_pseudo_time = 4

   character(*), parameter :: linear_words(*) = [character(6) :: 'auto', 'lu', 'krylov']
   integer, parameter :: linear_auto = 1, linear_lu = 2, linear_krylov = 3

   character(*), parameter :: jacobian_words(*) = [character(10) :: 'analytic', 'difference']
   integer, parameter :: jacobian_analytic = 1, jacobian_difference = 2

   character(*), parameter :: flow_words(*) = &
      [character(14) :: 'rotated', 'identity', 'preconditioned']
   integer, parameter :: flow_rotated = 1, flow_identity = 2, flow_preconditioned = 3

   character(*), parameter :: scheme_words(*) = &
      [character(14) :: 'implicit_euler', 'bdf', 'rosenbrock', 'runge_kutta']
   integer, parameter :: scheme_implicit_euler = 1, scheme_bdf = 2, scheme_rosenbrock = 3, &
                         scheme_runge_kutta = 4

   character(*), parameter :: unit_words(*) = [character(5) :: 'rad/s', 'Hz']
   integer, parameter :: unit_rad_per_second = 1, unit_hertz = 2

   character(*), parameter :: continuation_words(*) = [character(9) :: 'natural', 'arclength']
   integer, parameter :: continuation_natural = 1, continuation_arclength = 2

   !> Options of a nonlinear solution (group &solver).
   type :: solver_options
      integer :: kind = solver_newton
      integer :: linear = linear_auto
      integer :: jacobian = jacobian_analytic
      !> On norm(R)/norm(F).
      real(wp) :: tolerance = 1.0e-8_wp
      integer :: max_iterations = 60
      !> Try other ways to the solution where the first fails.
      logical :: fallback = .true.
      !> Leave out work that a case does not need (stuck pairs, components that nothing moves).
      logical :: skips = .true.
   end type solver_options

   !> Options of pseudo-time integration (group &pseudo_time).
   type :: pseudo_time_options
      integer :: flow = flow_rotated
      integer :: scheme = scheme_implicit_euler
      !> First step of pseudo-time (0: chosen by the scheme).
      real(wp) :: step = 0.0_wp
      !> Courant number of the explicit scheme.
      real(wp) :: cfl = 0.8_wp
      integer :: max_steps = 500
   end type pseudo_time_options

   !> The frequencies of a case (group &sweep).
   type :: sweep_options
      real(wp) :: start = 0.0_wp
      real(wp) :: end = 0.0_wp
      integer :: n_points = 1
      integer :: unit = unit_rad_per_second
      integer :: continuation = continuation_natural
      integer :: max_points = 1000
      !> Compute the Floquet multipliers of every point.
      logical :: stability = .false.
   end type sweep_options

end module fw_solver_options
