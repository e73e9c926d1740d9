!> Stress at a solved point: what the rows of &stress observe of its motion, with what stands there
!> without motion, and the amplitude and mean of its cycle.
!>
!> The rows belong to a second system of the case, which observes them in place of what the case
!> observes and is brought to where the first one stands: nothing of the solution depends on them.
module fw_stress_recovery
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_sweep, only: as_factor
   use fw_parameters, only: rotation_speed
   use fw_point, only: point_stress, point_type
   use fw_problem, only: build_system
   use fw_recovery, only: carry_solution, observed_coefficients
   use fw_stress_cycle, only: new_stress_grid, stress_cycle, stress_grid, utilisation_of
   implicit none (type, external)
   private

   public :: stress_recovery

   integer, parameter :: n_components = 6

   !> Serves all points of one number of harmonics.
   type :: stress_recovery
      private
      logical :: is_built = .false.
      !> The case with the rows as its observed quantities.
      class(case_type), allocatable :: case
      type(balance_problem), allocatable :: problem
      type(balance_state), allocatable :: system
      type(stress_grid) :: grid
   contains
      procedure :: find
   end type stress_recovery

contains

   !> The stress of a point whose solution is x, where the system was evaluated last.
   subroutine find(self, case, system, x, n_harmonics, point, error)
      class(stress_recovery), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      real(wp), intent(in), contiguous :: x(:)
      !> H of the result.
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: y(:), found(:, :)

      call build(self, case, system, error)
      if (allocated(error)) return
      call self%system%follow(system, error)
      if (allocated(error)) return
      self%system%structure_state%load_factor = system%structure_state%load_factor
      call self%system%structure_state%scale_loads()
      allocate (y(self%system%n))
      call carry_solution(system, x, self%system, y)
      call observed_coefficients(self%system, y, n_harmonics, found)
      call add_static(case, point, found)
      if (allocated(case%stress%of_base)) call add_base(case, point, found)
      if (self%grid%n_harmonics /= n_harmonics .or. .not. allocated(self%grid%waves)) then
         self%grid = new_stress_grid(n_harmonics)
      end if
      allocate (point%stress)
      call judge(case, self%grid, found, point%stress)
      if (case%stress%writes_tensor()) call move_alloc(found, point%stress%coefficients)
   end subroutine find

   !> Once for all points.
   subroutine build(self, case, system, error)
      type(stress_recovery), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(balance_state), intent(in) :: system
      type(error_type), allocatable, intent(out) :: error

      if (self%is_built) return
      allocate (self%case, source=case)
      self%case%model%observe_matrix = case%stress%rows
      call observe_nodal_stress(self%case)
      allocate (self%problem, self%system)
      call build_system(self%case, self%problem, self%system, error, &
                        of_level=case%harmonics%with_harmonics(maxval(system%problem%fourier% &
                                                                      harmonic)), &
                        forces=system%problem%forces)
      self%is_built = .not. allocated(error)
   end subroutine build

   !> The same of matrices of nodal diameters, whose first coordinates are the displacements.
   subroutine observe_nodal_stress(case)
      type(case_type), intent(inout) :: case
      integer :: k

      if (.not. case%model%cyclic%has_nodal()) return
      do k = 1, size(case%model%cyclic%nodal)
         associate (nodal => case%model%cyclic%nodal(k), rows => case%stress%rows)
            if (.not. allocated(nodal%mass)) cycle
            deallocate (nodal%observe)
            if (allocated(nodal%stress)) then
               nodal%observe = nodal%stress
               cycle
            end if
            allocate (nodal%observe(size(rows, 1), size(nodal%mass, 1)), source=(0.0_wp, 0.0_wp))
            nodal%observe(:, :case%model%n_dof) = rows
         end associate
      end do
   end subroutine observe_nodal_stress

   !> What stands there without motion, in harmonic 0 (2H+1, 6 n_points n_sectors).
   pure subroutine add_static(case, point, coefficients)
      type(case_type), intent(in) :: case
      type(point_type), intent(in) :: point
      real(wp), intent(inout) :: coefficients(:, :)
      real(wp) :: speed, static(size(case%stress%rows, 1))
      integer :: j, n

      speed = case%stress%rotation_speed
      if (case%over%number == rotation_speed) then
         speed = merge(speed, 1.0_wp, case%over%as == as_factor)*point%place
      else if (case%sweep%speed_order > 0.0_wp) then
         speed = point%omega/case%sweep%speed_order
      end if
      n = size(static)
      static = 0.0_wp
      if (allocated(case%stress%static)) static = reshape(case%stress%static, [n])
      if (allocated(case%stress%static_rotation)) then
         static = static + speed**2*reshape(case%stress%static_rotation, [n])
      end if
      do j = 0, size(coefficients, 2)/n - 1
         coefficients(1, j*n + 1:(j + 1)*n) = coefficients(1, j*n + 1:(j + 1)*n) + static
      end do
   end subroutine add_static

   !> What moves with the base is strained by it too (2H+1, 6 n_points).
   pure subroutine add_base(case, point, coefficients)
      type(case_type), intent(in) :: case
      type(point_type), intent(in) :: point
      real(wp), intent(inout) :: coefficients(:, :)
      integer :: k

      do k = 1, size(coefficients, 2)
         coefficients(:, k) = coefficients(:, k) + case%stress%of_base(k)*point%base
      end do
   end subroutine add_base

   !> Amplitude, mean and utilisation of every point, of each sector where sectors differ.
   subroutine judge(case, grid, coefficients, stress)
      type(case_type), intent(in) :: case
      type(stress_grid), intent(in) :: grid
      real(wp), intent(in) :: coefficients(:, :)
      type(point_stress), intent(inout) :: stress
      integer :: i, n
      logical :: jumps

      n = size(coefficients, 2)/n_components
      allocate (stress%amplitude(n), stress%mean(n))
      stress%n_jumps = 0
      do i = 1, n
         call stress_cycle(coefficients(:, n_components*(i - 1) + 1:n_components*i), grid, &
                           case%stress%method, stress%amplitude(i), stress%mean(i), jumps)
         if (jumps) stress%n_jumps = stress%n_jumps + 1
      end do
      stress%worst = maxloc(stress%amplitude, dim=1) - 1
      if (.not. case%stress%is_judged()) return
      associate (p => case%stress%n_points)
         stress%utilisation = [(utilisation_of(stress%amplitude(i), stress%mean(i), &
                                               case%stress%endurance(modulo(i - 1, p) + 1), &
                                               case%stress%ultimate(modulo(i - 1, p) + 1), &
                                               case%stress%diagram), i=1, n)]
      end associate
      stress%worst = maxloc(stress%utilisation, dim=1) - 1
   end subroutine judge

end module fw_stress_recovery
