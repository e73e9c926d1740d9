!> Analysis 'modes': natural frequencies of a structure with its contact open, and closed: every
!> pair as its springs (laws that are elastic at rest) or held (all others). Of a cyclic structure
!> in each nodal diameter, of any other in nodal diameter 0 alone.
module fw_natural_modes
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_body, only: body_type
   use fw_closed_joint, only: closed_joint
   use fw_closed_pairs, only: add_pairs, add_springs
   use fw_cyclic_data, only: nodal_matrices
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hermitian, only: congruence, is_regular, solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_sector, only: close_sector, sector_at
   use fw_text, only: to_text
   use fw_whirl_modes, only: find_whirl, wave_matrices, wave_of
   implicit none (type, external)
   private

   public :: natural_modes, find_natural_modes

   !> Frequencies in ascending order [rad/s], NaN where there are fewer (n_modes, n_diameters).
   type :: natural_modes
      integer, allocatable :: nodal_diameter(:)
      real(wp), allocatable :: open(:, :), closed(:, :)
      !> Fractions of critical damping of the same, only where waves in both directions differ;
      !> below 0 where the motion grows.
      real(wp), allocatable :: open_damping(:, :), closed_damping(:, :)
   end type natural_modes

   !> Shifts of a stiffness that does not hold the structure, in parts of K over M.
   real(wp), parameter :: shift_trials(*) = [1.0e-6_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp]
   !> Eigenvalues below this part of the largest are massless directions: round-off.
   real(wp), parameter :: massless = 1.0e-13_wp
   !> Squares of frequencies below this part of the shift are rigid motions.
   real(wp), parameter :: rigid = 1.0e-7_wp

contains

   !> The lowest frequencies of every nodal diameter that the model holds, or of some.
   subroutine find_natural_modes(case, n_modes, modes, error, wanted)
      class(body_type), intent(in) :: case
      !> Frequencies of each nodal diameter.
      integer, intent(in) :: n_modes
      type(natural_modes), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      !> Nodal diameters, 0 to N/2, or with a sign where waves in both directions differ (default:
      !> all).
      integer, intent(in), optional :: wanted(:)
      integer, allocatable :: list(:)
      integer :: j, k

      associate (cyclic => case%model%cyclic)
         list = [(k, k=0, cyclic%n_sectors/2)]
         if (cyclic%splits_waves()) list = [(k, k=-(cyclic%n_sectors - 1)/2, cyclic%n_sectors/2)]
         if (present(wanted)) list = wanted
         modes%nodal_diameter = pack(list, [(cyclic%holds(abs(list(j))), j=1, size(list))])
      end associate
      allocate (modes%open(n_modes, size(modes%nodal_diameter)), &
                modes%closed(n_modes, size(modes%nodal_diameter)))
      modes%open = ieee_value(1.0_wp, ieee_quiet_nan)
      modes%closed = modes%open
      if (case%model%cyclic%splits_waves()) then
         modes%open_damping = modes%open
         modes%closed_damping = modes%open
         do j = 1, size(modes%nodal_diameter)
            call find_waves(case, j, modes, error)
            if (allocated(error)) return
         end do
         return
      end if
      do j = 1, size(modes%nodal_diameter)
         call find_in_diameter(case, modes%nodal_diameter(j), modes%open(:, j), &
                               modes%closed(:, j), error)
         if (allocated(error)) return
      end do
   end subroutine find_natural_modes

   !> Of a signed nodal diameter, damping included.
   subroutine find_waves(case, place, modes, error)
      class(body_type), intent(in) :: case
      integer, intent(in) :: place
      type(natural_modes), intent(inout) :: modes
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      type(closed_joint) :: springs, pairs
      type(wave_matrices) :: wave
      complex(wp), allocatable :: stiffness(:, :), basis(:, :)
      integer :: k

      k = modes%nodal_diameter(place)
      call sector_at(case%model, abs(k), nodal, error)
      if (allocated(error)) return
      stiffness = nodal%stiffness
      call add_springs(case%springs, case%model%cyclic%n_solved(), springs)
      call close_sector(case%model, springs, abs(k), stiffness, basis)
      call wave_of(nodal, stiffness, k < 0, wave)
      call list_waves(wave, modes%open(:, place), modes%open_damping(:, place))
      modes%closed(:, place) = modes%open(:, place)
      modes%closed_damping(:, place) = modes%open_damping(:, place)
      if (case%contact%n_pairs == 0) return
      call add_pairs(case%contact, pairs)
      call close_sector(case%model, pairs, abs(k), stiffness, basis)
      call wave_of(nodal, stiffness, k < 0, wave)
      if (allocated(basis)) then
         if (k < 0) basis = conjg(basis)
         wave%mass = congruence(basis, wave%mass, basis)
         wave%damping = congruence(basis, wave%damping, basis)
         wave%stiffness = congruence(basis, wave%stiffness, basis)
      end if
      call list_waves(wave, modes%closed(:, place), modes%closed_damping(:, place))
   end subroutine find_waves

   !> The lowest frequencies and their damping, NaN where there are fewer.
   subroutine list_waves(wave, frequency, damping)
      type(wave_matrices), intent(in) :: wave
      real(wp), intent(out) :: frequency(:), damping(:)
      complex(wp), allocatable :: root(:)
      integer :: n

      frequency = ieee_value(1.0_wp, ieee_quiet_nan)
      damping = frequency
      if (size(wave%mass) == 0) return
      call find_whirl(wave, root)
      n = min(size(root), size(frequency))
      frequency(:n) = aimag(root(:n))
      damping(:n) = -real(root(:n), wp)/abs(root(:n))
   end subroutine list_waves

   subroutine find_in_diameter(case, k, open, closed, error)
      class(body_type), intent(in) :: case
      integer, intent(in) :: k
      real(wp), intent(inout) :: open(:), closed(:)
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      type(closed_joint) :: springs, pairs
      complex(wp), allocatable :: stiffness(:, :), basis(:, :)

      call sector_at(case%model, k, nodal, error)
      if (allocated(error)) return
      stiffness = nodal%stiffness
      call add_springs(case%springs, case%model%cyclic%n_solved(), springs)
      call close_sector(case%model, springs, k, stiffness, basis)
      call list_frequencies(nodal%mass, stiffness, k, open, error)
      if (allocated(error)) return
      closed = open
      if (case%contact%n_pairs == 0) return
      call add_pairs(case%contact, pairs)
      call close_sector(case%model, pairs, k, stiffness, basis)
      if (.not. allocated(basis)) then
         call list_frequencies(nodal%mass, stiffness, k, closed, error)
         return
      end if
      closed = ieee_value(1.0_wp, ieee_quiet_nan)
      if (size(basis, 2) == 0) return
      call list_frequencies(congruence(basis, nodal%mass, basis), &
                            congruence(basis, stiffness, basis), k, closed, error)
   end subroutine find_in_diameter

   !> The lowest frequencies, from M x = theta (K + s M) x: massless dofs, and a stiffness that
   !> holds the structure in part, are no exceptions.
   subroutine list_frequencies(mass, stiffness, k, frequency, error)
      complex(wp), intent(in) :: mass(:, :), stiffness(:, :)
      integer, intent(in) :: k
      real(wp), intent(inout) :: frequency(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: theta(:)
      complex(wp), allocatable :: vectors(:, :)
      real(wp) :: shift, square
      integer :: i, j, trial
      logical :: done

      shift = 0.0_wp
      done = .false.
      if (is_regular(stiffness)) call solve_hermitian_eigen(mass, stiffness, theta, vectors, done)
      do trial = 1, size(shift_trials)
         if (done) exit
         shift = shift_trials(trial)*norm2(abs(stiffness))/max(norm2(abs(mass)), tiny(1.0_wp))
         if (.not. is_regular(stiffness + shift*mass)) cycle
         call solve_hermitian_eigen(mass, stiffness + shift*mass, theta, vectors, done)
      end do
      if (.not. done) then
         call fatal_error(error, 'nodal diameter '//to_text(k)//': the structure has a part '// &
                          'without both stiffness and mass (or a mass that is not positive); '// &
                          'check the mass and stiffness matrices', status_input)
         return
      end if
      frequency = ieee_value(1.0_wp, ieee_quiet_nan)
      do i = 1, size(frequency)
         j = size(theta) - i + 1
         if (j < 1) exit
         if (theta(j) <= massless*theta(size(theta))) exit
         square = 1.0_wp/theta(j) - shift
         if (abs(square) <= rigid*shift) square = 0.0_wp
         ! Unstable at rest: no frequency.
         frequency(i) = merge(sqrt(max(square, 0.0_wp)), ieee_value(1.0_wp, ieee_quiet_nan), &
                              square >= 0.0_wp)
      end do
   end subroutine list_frequencies

end module fw_natural_modes
