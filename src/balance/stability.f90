!> Stability of a periodic solution by its Floquet multipliers: a small perturbation of the
!> displacements is multiplied by them from period to period.
!>
!> Perturbations live in all dofs of the model and in all harmonics, whatever harmonics and
!> coordinates the solution was computed in: an odd solution may well lose its symmetry.
!>
!> What the multipliers mean depends on the law:
!> * nonlinear springs, contact with a gap but without friction: those of the structure;
!> * friction of the penalty law: the force depends on where the pair slipped before. Hill's
!>   perturbation p(t) exp(lambda t) is given the force that p alone would find, which takes the
!>   pair's memory as periodic. That is exact at lambda = 0, so that folds are where they
!>   should be, and an approximation away from it (of damping by friction most of all). The memory
!>   of a pair that sticks through the period would add a multiplier of exactly 1; it is left out;
!> * rigid contact (dlft, dlft_velocity) has no derivative in time: refused.
module fw_stability
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_input
   use fw_fourier, only: coefficient_count
   use fw_hbm, only: hbm_system
   use fw_hill, only: hill_exponents
   use fw_kinds, only: pi
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_stability_basis, only: new_perturbation_basis
   use fw_stability_basis, only: perturbation_basis
   use fw_stability_tangent, only: new_tangent
   use fw_stability_tangent, only: tangent_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: floquet_multipliers, is_stable, largest_hill_order

   !> Order of the eigenproblem that is refused beyond.
   integer, parameter :: largest_hill_order = 2000
   !> Harmonics of the perturbation, even where the solution has fewer.
   integer, parameter :: fewest_harmonics = 12
   !> A modulus above 1 by less than this is round-off or truncation of Hill's problem: undamped
   !> structures lie on the circle.
   real(wp), parameter :: round_off = 1.0e-8_wp

contains

   !> Floquet multipliers at a solution, by descending modulus.
   subroutine floquet_multipliers(system, model, x, multipliers, error)
      !> At the frequency of the solution; built without leaving out components that nothing moves,
      !> because perturbations move them.
      class(hbm_system), intent(in) :: system
      !> The model that the system was built from.
      type(model_type), intent(in) :: model
      !> The solution (n_coordinates * n_coefficients).
      real(wp), intent(in), contiguous :: x(:)
      !> Two for each direction with mass and one for each with damping alone.
      complex(wp), allocatable, intent(out) :: multipliers(:)
      type(error_type), allocatable, intent(out) :: error
      type(perturbation_basis) :: basis
      type(tangent_type) :: tangent
      complex(wp), allocatable :: exponents(:)
      integer :: n_harmonics

      call check_system(system, error)
      if (allocated(error)) return
      call new_perturbation_basis(model, system%joint%relative, basis, error)
      if (allocated(error)) return
      call choose_harmonics(system, basis, n_harmonics, error)
      if (allocated(error)) return
      call new_tangent(system, x, n_harmonics, tangent)
      call hill_exponents(basis, tangent, system%structure%omega, exponents, error)
      if (allocated(error)) return
      multipliers = exp(exponents*(2.0_wp*pi/system%structure%omega))
      call sort_descending(multipliers)
   end subroutine floquet_multipliers

   !> Whether no perturbation grows; a multiplier on the unit circle counts as stable.
   pure logical function is_stable(multipliers)
      complex(wp), intent(in) :: multipliers(:)

      is_stable = all(abs(multipliers) <= 1.0_wp + round_off)
   end function is_stable

   subroutine check_system(system, error)
      class(hbm_system), intent(in) :: system
      type(error_type), allocatable, intent(out) :: error

      if (system%rigid .and. system%contact%n_pairs > 0) then
         call fatal_error(error, '&sweep stability needs law = ''penalty'' in &contact: forces '// &
                          'of rigid contact are no function of the displacements', status_input)
      else if (system%joint%n_idle > 0) then
         call fatal_error(error, '&sweep stability: '//to_text(system%joint%n_idle)// &
                          ' components of contact pairs that nothing moves were left out, but '// &
                          'perturbations move them; keep them in the system', status_input)
      end if
   end subroutine check_system

   !> Those of the solution, and more where the eigenproblem stays small.
   subroutine choose_harmonics(system, basis, n_harmonics, error)
      class(hbm_system), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      integer, intent(out) :: n_harmonics
      type(error_type), allocatable, intent(out) :: error
      integer :: width, least, most

      least = maxval(system%fourier%harmonic)
      width = max(1, 2*basis%n_massive + basis%n_damped)
      most = (largest_hill_order/width - 1)/2
      n_harmonics = max(least, min(fewest_harmonics, most))
      if (n_harmonics <= most) return
      call fatal_error(error, '&sweep stability: Hill''s eigenproblem has the order '// &
                       to_text(width*coefficient_count(n_harmonics))//' here, more than '// &
                       to_text(largest_hill_order)//'; take fewer dofs or harmonics, or switch '// &
                       'stability off', status_input)
   end subroutine choose_harmonics

   !> By modulus; of two conjugates the one above the real axis comes first.
   pure subroutine sort_descending(values)
      complex(wp), intent(inout) :: values(:)
      complex(wp) :: value
      integer :: i, j

      do i = 2, size(values)
         value = values(i)
         j = i - 1
         do while (j > 0)
            if (.not. precedes(value, values(j))) exit
            values(j + 1) = values(j)
            j = j - 1
         end do
         values(j + 1) = value
      end do
   end subroutine sort_descending

   pure logical function precedes(a, b)
      complex(wp), intent(in) :: a, b
      ! Moduli of conjugates differ by round-off.
      real(wp), parameter :: equal = 1.0e-12_wp

      if (abs(abs(a) - abs(b)) <= equal*abs(b)) then
         precedes = aimag(a) > aimag(b)
      else
         precedes = abs(a) > abs(b)
      end if
   end function precedes

end module fw_stability
