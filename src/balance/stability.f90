!> Stability of a periodic solution by its Floquet multipliers: a small perturbation of the
!> displacements is multiplied by them from period to period.
!>
!> Perturbations live in all dofs of the model and in all harmonics, whatever harmonics and
!> coordinates the solution was computed in: an odd solution may well lose its symmetry.
!>
!> * Nonlinear springs, contact with a gap and pairs that stick throughout act at an instant:
!>   Hill's method (fw_hill), with the accuracy of the solution.
!> * Friction that slips depends on the past. Hill's method with the derivative of the periodic
!>   response would take the memory of a pair as periodic: right where a multiplier passes 1, blind
!>   to the damping by friction elsewhere (on an oscillator with one slipping pair the modulus came
!>   out as 0.92 where it is 0.03). There the perturbation is marched through the period, positions
!>   of the pairs included (fw_stability_march); so are models too large for Hill's eigenproblem.
!>   The error is that of 1024 or more steps a period: measured 1e-5 to 1e-4 for springs,
!>   up to 3e-3 where friction switches between the steps.
!> * A pair that sticks throughout could rest anywhere within its cone, a multiplier of exactly 1
!>   that is left out.
!> * Laws that act at once, smooth friction and curved pressures, are marched as well, and so are
!>   dampers and polynomials: slopes by displacements and velocities at every instant.
!> * Rigid contact (dlft, dlft_velocity) has no derivative in time: refused.
module fw_stability
   use fw_error, only: error_type, fatal_error, status_input
   use fw_fourier, only: coefficient_count
   use fw_balance_state, only: balance_state
   use fw_hill, only: hill_exponents
   use fw_kinds, only: pi, wp
   use fw_model, only: model_type
   use fw_stability_basis, only: new_perturbation_basis, perturbation_basis
   use fw_stability_history, only: history_type, new_history
   use fw_stability_march, only: marched_multipliers
   use fw_stability_tangent, only: new_tangent, tangent_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: floquet_multipliers, most_dofs

   !> Order of Hill's eigenproblem beyond which the march is faster by far: the time grows with
   !> the cube of the order (measured on two cores: 0.6 s at 1000, 10 s or more at 2000; the march
   !> of 60 dofs takes 0.2 s).
   integer, parameter :: largest_hill_order = 1000
   !> Dofs above which the march takes minutes too.
   integer, parameter :: most_dofs = 400
   !> Harmonics of the perturbation where the solution has fewer and the order stays below this.
   integer, parameter :: fewest_harmonics = 12, comfortable_order = 500

contains

   !> Floquet multipliers at a solution, by descending modulus.
   subroutine floquet_multipliers(system, model, x, multipliers, error, halved, marched)
      !> At the frequency of the solution; built without leaving out components that nothing moves,
      !> because perturbations move them.
      class(balance_state), intent(in) :: system
      !> The model that the system was built from.
      type(model_type), intent(in) :: model
      !> The solution (n_coordinates * n_coefficients).
      real(wp), intent(in), contiguous :: x(:)
      !> Two for each direction with mass and one for each with damping alone.
      complex(wp), allocatable, intent(out) :: multipliers(:)
      type(error_type), allocatable, intent(out) :: error
      !> March with half the steps that a solution of half the harmonics would take, so that a
      !> comparison shows what steps leave (default: no).
      logical, intent(in), optional :: halved
      !> Whether they come from a march.
      logical, intent(out), optional :: marched
      type(perturbation_basis) :: basis
      type(tangent_type) :: tangent
      type(history_type) :: history
      complex(wp), allocatable :: exponents(:)
      integer :: i, n_harmonics
      logical :: marches

      call check_system(system, model%n_dof, error)
      if (allocated(error)) return
      if (allocated(system%problem%joint%alone)) then
         call new_perturbation_basis(model%at_frequency(system%frequency()), &
                                     system%problem%joint%alone, basis, error)
      else
         call new_perturbation_basis(model, system%problem%joint%relative, basis, error)
      end if
      if (allocated(error)) return
      call new_history(system, x, history, halved)
      n_harmonics = chosen_harmonics(system, basis)
      call check_static(system, basis, history, error)
      if (allocated(error)) return
      marches = n_harmonics == 0 .or. history%acts_at_once .or. size(history%elements) > 0 .or. &
                any([(history%rubs(i), i=1, system%problem%n_pairs)])
      if (present(marched)) marched = marches
      if (marches) then
         call marched_multipliers(system, basis, history, multipliers, error)
         if (allocated(error)) return
      else
         call new_tangent(system, x, history%forces%state, n_harmonics, tangent)
         call hill_exponents(basis, tangent, system%frequency(), exponents, error)
         if (allocated(error)) return
         multipliers = exp(exponents*(2.0_wp*pi/system%frequency()))
      end if
      call pair_conjugates(multipliers)
      call sort_descending(multipliers)
   end subroutine floquet_multipliers

   subroutine check_system(system, n_dof, error)
      class(balance_state), intent(in) :: system
      integer, intent(in) :: n_dof
      type(error_type), allocatable, intent(out) :: error

      if (system%problem%n_pairs > 0 .and. &
          .not. system%problem%forces%entry( &
             system%problem%forces%pairs)%law%facts%has_multipliers) then
         call fatal_error(error, '&sweep stability needs law = ''penalty'' or '// &
                          '''regularised'' in &contact: forces of rigid contact are no '// &
                          'function of the displacements', status_input)
      else if (system%problem%joint%n_idle > 0) then
         call fatal_error(error, '&sweep stability: '//to_text(system%problem%joint%n_idle)// &
                          ' components of contact pairs that nothing moves were left out, but '// &
                          'perturbations move them; keep them in the system', status_input)
      else if (n_dof > most_dofs) then
         call fatal_error(error, '&sweep stability is offered for up to '//to_text(most_dofs)// &
                          ' dofs, the model has '//to_text(n_dof)//'; reduce it or switch '// &
                          'stability off', status_input)
      end if
   end subroutine check_system

   !> A direction without mass and damping that a pair of velocities rubs on is a state of its own,
   !> which the march has not.
   subroutine check_static(system, basis, history, error)
      class(balance_state), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      type(error_type), allocatable, intent(out) :: error
      integer :: c, i, k, row

      do k = 1, size(history%elements)
         if (history%elements(k)%refuses > 0) then
            call fatal_error(error, '&sweep stability: the law of element '// &
                             to_text(history%elements(k)%refuses)//' of &user gives no force '// &
                             'at one of the '//to_text(history%n_time)//' instants of the '// &
                             'march; mend it, or switch stability off', status_input)
            return
         end if
         do i = 1, size(history%elements(k)%row, 2)
            if (.not. any(abs(history%elements(k)%by_v(:, :, i, :)) > 0.0_wp)) cycle
            do c = 1, size(history%elements(k)%row, 1)
               row = history%elements(k)%row(c, i)
               if (row == 0) cycle
               if (.not. moves_static(basis, row)) cycle
               call fatal_error(error, '&sweep stability: element '//to_text(i)//' of &damper '// &
                                'or &user takes velocities and acts on a dof without mass and '// &
                                'other damping; give it either, or switch stability off', &
                                status_input)
               return
            end do
         end do
      end do
      if (.not. history%acts_at_once) return
      do i = 1, system%problem%n_pairs
         do c = 1, 2
            row = system%problem%joint%row(c, i)
            if (row == 0 .or. history%law%prediction%order_of(i, c) == 0) cycle
            if (.not. moves_static(basis, row)) cycle
            call fatal_error(error, '&sweep stability: pair '//to_text(i)//' rubs, by a law '// &
                             'of velocities, on a dof without mass and damping; give it '// &
                             'either, or switch stability off', status_input)
            return
         end do
      end do
   end subroutine check_static

   !> Whether a row has a part in directions without mass and damping.
   pure logical function moves_static(basis, row) result(moves)
      type(perturbation_basis), intent(in) :: basis
      !> Of the joint; 0: none.
      integer, intent(in) :: row
      !> Part of a row that round-off leaves.
      real(wp), parameter :: negligible = 1.0e-9_wp

      moves = .false.
      if (row == 0) return
      associate (nd => basis%n_massive + basis%n_damped)
         moves = norm2(basis%direction(nd + 1:, row)) > negligible*norm2(basis%direction(:, row))
      end associate
   end function moves_static

   !> Harmonics for Hill's method: those of the solution, and more where the eigenproblem stays
   !> small; 0 where it would be too large.
   pure integer function chosen_harmonics(system, basis) result(n_harmonics)
      class(balance_state), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      integer :: width

      width = max(1, 2*basis%n_massive + basis%n_damped)
      n_harmonics = max(maxval(system%problem%fourier%harmonic), &
                        min(fewest_harmonics, (comfortable_order/width - 1)/2))
      if (width*coefficient_count(n_harmonics) > largest_hill_order) n_harmonics = 0
   end function chosen_harmonics

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
