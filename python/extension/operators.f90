!> Core operators for post-processing, with plain arrays: what the wrapper for Python calls.
module fw_python_operators
   use fw_error, only: error_type, fatal_error, status_input
   use fw_force_law, only: force_workspace, pair_mixed, pair_stuck
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_plain_structure, only: new_plain_structure, plain_structure
   use fw_relative, only: relative_type, new_relative
   use fw_structure_operator, only: structure_state
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: build_condensation, unpack_jacobian

contains

   !> Condense a structure to the relative displacements u(side_1) - u(side_2) at one frequency.
   subroutine build_condensation(model, side_1, side_2, harmonic, omega, structure, state, error)
      type(model_type), intent(in) :: model
      !> Signed dof numbers, 0 for ground (n_rows).
      integer, intent(in) :: side_1(:), side_2(:)
      !> Harmonics (n_harmonics).
      integer, intent(in) :: harmonic(:)
      !> [rad/s]
      real(wp), intent(in) :: omega
      type(plain_structure), intent(out) :: structure
      !> At that frequency.
      class(structure_state), allocatable, intent(out) :: state
      !> Raised where the rows depend on each other, and at a pole of the condensed stiffness.
      type(error_type), allocatable, intent(out) :: error
      type(relative_type) :: relative
      integer :: dependent

      call new_relative(model%n_dof, side_1, side_2, relative)
      dependent = findloc(relative%independent, .false., dim=1)
      if (dependent > 0) then
         call fatal_error(error, 'row '//to_text(dependent)//' of side_1 and side_2 follows '// &
                          'from the rows before it: remove it', status_input)
         return
      end if
      call new_plain_structure(model, relative, harmonic, [omega, omega], structure, error)
      if (allocated(error)) return
      if (structure%n_coordinates > size(side_1)) then
         call fatal_error(error, 'omega = '//to_text(omega)//' rad/s: one of the harmonics is '// &
                          'an undamped natural frequency of the structure with the rows held, '// &
                          'where the condensed stiffness is infinite; give damping, or shift '// &
                          'omega', status_input)
         return
      end if
      call structure%new_state(state)
      call structure%at(state, omega, 0.0_wp, error)
   end subroutine build_condensation

   !> Derivative of the force coefficients by those of the prediction, pair by pair, with nothing
   !> left out: (coefficient, component) of the prediction, then of the force, pair.
   subroutine unpack_jacobian(work, present_components, n_coefficients, jacobian)
      type(force_workspace), intent(in) :: work
      !> (3, n_pairs)
      logical, intent(in) :: present_components(:, :)
      integer, intent(in) :: n_coefficients
      real(wp), intent(out) :: jacobian(3*n_coefficients, 3*n_coefficients, size(work%state))
      integer :: i, k

      jacobian = 0.0_wp
      do i = 1, size(work%state)
         if (work%state(i) == pair_stuck) then
            do k = 1, 3*n_coefficients
               if (present_components((k - 1)/n_coefficients + 1, i)) jacobian(k, k, i) = 1.0_wp
            end do
         else if (work%state(i) == pair_mixed) then
            jacobian(:, :, i) = work%jacobian(:, :, i)
         end if
      end do
   end subroutine unpack_jacobian

end module fw_python_operators
