!> The stability of a solution, with an estimate of the error of its multipliers.
!>
!> What is wrong with a multiplier is mostly the solution: harmonics that it leaves out, instants
!> that are too few. The multipliers are therefore computed twice, at the solution and at the one
!> with twice the harmonics, and automatic instants, that Newton's method finds from it in two or
!> three steps. Hill's method then has twice the harmonics as well, and a march half the steps of
!> time, so that its own error shows too. (A residual of Hill's problem at the solution as it is
!> would be cheaper, and blind to the first of these errors: with a spring of power 5 and H = 9 it
!> is the larger one by far.)
!>
!> Where no solution with more harmonics is found, as next to a fold, nothing is known of the error
!> and the verdict is open.
module fw_stability_solver
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_harmonics_options, only: harmonics_options, method_hbm, parity_all, parity_auto
   use fw_interrupt, only: stop_run
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_moved_parameter, only: moved_parameter
   use fw_newton, only: newton_solver, solver_report
   use fw_parameters, only: is_of_matrices
   use fw_point, only: point_type
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution
   use fw_stability, only: floquet_multipliers
   use fw_stability_verdict, only: multiplier_errors, verdict_of
   implicit none (type, external)
   private

   public :: stability_solver

   !> Serves all points of one number of harmonics.
   type :: stability_solver
      !> The balance with twice the harmonics, made when it is first needed; the state points at the
      !> problem, which stays where it is.
      type(balance_problem), allocatable, private :: problem
      class(balance_state), allocatable, private :: fine
      type(newton_solver), private :: newton
   contains
      procedure :: find
   end type stability_solver

contains

   !> Multipliers of the solution x at the frequency of the system, their errors and the verdict.
   subroutine find(self, case, system, x, point, error)
      class(stability_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: better(:)
      logical :: marched(2)

      call find_multipliers(case, system, x, point%multipliers, error, marched=marched(1))
      if (allocated(error)) return
      allocate (point%multiplier_error(size(point%multipliers)), source=huge(1.0_wp))
      call refine(self, case, system, x, better, marched(2), error)
      if (allocated(error)) return
      if (allocated(better)) point%multiplier_error = multiplier_errors(point%multipliers, better, &
         any(marched))
      point%verdict = verdict_of(point%multipliers, point%multiplier_error)
   end subroutine find

   !> The multipliers with twice the harmonics; not allocated where there is no such solution.
   subroutine refine(self, case, system, x, better, marched, error)
      class(stability_solver), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      complex(wp), allocatable, intent(out) :: better(:)
      logical, intent(out) :: marched
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp), allocatable :: y(:)

      marched = .false.
      if (.not. allocated(self%fine)) call build(self, case, system, error)
      if (.not. allocated(error)) call self%fine%follow(system, error)
      if (allocated(error)) return
      allocate (y(self%fine%n))
      call carry_solution(system, x, self%fine, y)
      call self%newton%solve(self%fine, y, report)
      if (report%interrupted) call stop_run(system%interrupt, error)
      if (allocated(error) .or. .not. report%converged) return
      call find_multipliers(case, self%fine, y, better, error, halved=.true., marched=marched)
   end subroutine refine

   !> Perturbations live in the model at the value where the system stands.
   subroutine find_multipliers(case, system, x, multipliers, error, halved, marched)
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      complex(wp), allocatable, intent(out) :: multipliers(:)
      type(error_type), allocatable, intent(out) :: error
      !> As in floquet_multipliers.
      logical, intent(in), optional :: halved
      logical, intent(out) :: marched

      if (is_of_matrices(case%varied)) then
         call floquet_multipliers(system, moved_model(system), x, multipliers, error, halved, &
                                  marched)
      else
         call floquet_multipliers(system, case%model, x, multipliers, error, halved, marched)
      end if
   end subroutine find_multipliers

   !> The model of the mover that changes it: that of the place, where the other is of the load.
   function moved_model(system) result(model)
      type(balance_state), intent(in) :: system
      type(model_type) :: model

      if (system%goes_along()) then
         select type (mover => system%along%mover)
         type is (moved_parameter)
            model = mover%body%model
         end select
      else
         select type (mover => system%moved%mover)
         type is (moved_parameter)
            model = mover%body%model
         end select
      end if
   end function moved_model

   !> The balance with twice the harmonics and no filter: what a filter does is an error, too.
   subroutine build(self, case, system, error)
      class(stability_solver), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_options) :: harmonics

      harmonics = case%harmonics
      harmonics%method = method_hbm
      harmonics%n_harmonics = 2*max(1, maxval(system%problem%fourier%harmonic))
      harmonics%n_time = 0
      harmonics%doublings = 0
      harmonics%filter_harmonics = 0
      ! What a solution with even harmonics is, its refinement must be able to be.
      harmonics%parity = merge(parity_all, parity_auto, system%problem%fourier%has_constant())
      allocate (self%problem, self%fine)
      call build_system(case, self%problem, self%fine, error, of_level=harmonics)
      self%newton%options = case%solver
   end subroutine build

end module fw_stability_solver
