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
!>   pair's memory as periodic. That is exact at lambda = 0, so that a multiplier passes 1 at the
!>   folds, as it should. Elsewhere it is an approximation that misses most of the damping by
!>   friction: on an oscillator with one slipping pair the modulus came out as 0.92 where the memory
!>   makes it 0.03. A result above 1 off the real axis is no proof then. The memory of a pair that
!>   sticks through the period would add a multiplier of exactly 1; it is left out;
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

   !> Order of the eigenproblem that is refused beyond: the time grows with its cube (measured on
   !> two cores: 1000 takes 2 s, 2000 takes 20 s).
   integer, parameter :: largest_hill_order = 2000
   !> Harmonics of the perturbation where the solution has fewer and the order stays below this.
   integer, parameter :: fewest_harmonics = 12, comfortable_order = 500
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
      call pair_conjugates(multipliers)
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
      integer :: width

      width = max(1, 2*basis%n_massive + basis%n_damped)
      n_harmonics = max(maxval(system%fourier%harmonic), &
                        min(fewest_harmonics, (comfortable_order/width - 1)/2))
      if (width*coefficient_count(n_harmonics) <= largest_hill_order) return
      call fatal_error(error, '&sweep stability: Hill''s eigenproblem has the order '// &
                       to_text(width*coefficient_count(n_harmonics))//' here, more than '// &
                       to_text(largest_hill_order)//'; take fewer dofs or harmonics, or switch '// &
                       'stability off', status_input)
   end subroutine choose_harmonics

   !> Multipliers are real or come in conjugate pairs. The copies of the exponents that were chosen
   !> need not be conjugate (a negative multiplier comes from one exponent off the axis), so that
   !> truncation breaks the symmetry: restore it.
   pure subroutine pair_conjugates(values)
      complex(wp), intent(inout) :: values(:)
      logical :: alone(size(values))
      integer :: i, j

      alone = .true.
      do i = 1, size(values)
         if (.not. alone(i)) cycle
         j = minloc(abs(values - conjg(values(i))), dim=1, mask=alone)
         values(i) = 0.5_wp*(values(i) + conjg(values(j)))
         values(j) = conjg(values(i))
         alone([i, j]) = .false.
      end do
   end subroutine pair_conjugates

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
