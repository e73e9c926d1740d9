!> One implicit midpoint step of the structure, reduced to its contact rows.
!>
!> With u_m = (u + u+)/2, v_m = 2 (u_m - u)/h and v+ = 2 v_m - v, the increment d = u_m - u obeys
!>
!>   S d = f_m - K u + (2/h) M v - B^T lambda,   S = (4/h^2) M + (2/h) C + K,
!>
!> which is Moreau's scheme with theta = 1/2 (Moreau 1988, Jean 1999), lambda being the mean force
!> of the step. h = (2/omega) tan(omega dt/2) in place of dt makes the response to the harmonic
!> load exact at the ends of the steps (prewarping, Tustin 1947), so that a lightly damped
!> resonance does not move with the step. Massless directions have no use for u+ and v+: they
!> take their value u_m at the middle, where their equilibrium holds, and dampers in these
!> directions see the rate d/h.
module fw_step_operator
   use fw_kinds, only: wp
   use fw_error, only: error_type, fatal_error, status_input
   use fw_lapack, only: dgemm, dgemv
   use fw_linalg, only: lu_type
   use fw_time_structure, only: time_structure
   implicit none (type, external)
   private

   public :: step_operator, new_step_operator

   !> Reciprocal of the pivots' spread beyond which S is taken for singular.
   real(wp), parameter :: singular_tolerance = 1.0e-14_wp

   type :: step_operator
      !> Duration of the step, and the prewarped one [time].
      real(wp) :: duration = 0.0_wp
      real(wp) :: h = 0.0_wp
      !> Factors of S.
      type(lu_type) :: lu
      !> S^-1 B^T (n_dof, n_rows) and B S^-1 B^T + compliance (n_rows, n_rows) [length/force].
      real(wp), allocatable :: response(:, :), delassus(:, :)
   contains
      procedure :: free_increment
      procedure :: add_forces
   end type step_operator

contains

   !> Factor the step of the given duration at the excitation frequency omega [rad/time].
   subroutine new_step_operator(structure, duration, omega, self, error)
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: duration, omega
      type(step_operator), intent(out) :: self
      !> status_input where a dof has neither mass nor stiffness.
      type(error_type), allocatable, intent(out) :: error
      logical :: singular
      integer :: n, j

      n = structure%n_dof
      self%duration = duration
      self%h = 2.0_wp/omega*tan(0.5_wp*omega*duration)
      call self%lu%reserve(n)
      call fill_damping(structure, self%h, self%lu%matrix)
      self%lu%matrix = self%lu%matrix + 4.0_wp/self%h**2*structure%mass + structure%stiffness
      call factor(self%lu, singular)
      if (singular) then
         call fatal_error(error, 'time integration: a dof has neither mass nor stiffness (a '// &
                          'massless dof that contact alone holds); give it a mass or a '// &
                          'stiffness, or condense it from the model', status_input)
         return
      end if
      allocate (self%delassus(structure%n_rows, structure%n_rows), source=0.0_wp)
      self%response = structure%rows
      do j = 1, structure%n_rows
         call self%lu%solve(self%response(:, j))
         self%delassus(j, j) = structure%compliance(j)
      end do
      if (structure%n_rows == 0) return
      call dgemm('T', 'N', structure%n_rows, structure%n_rows, n, 1.0_wp, structure%rows, n, &
                 self%response, n, 1.0_wp, self%delassus, structure%n_rows)
   end subroutine new_step_operator

   !> Damping by d: 2/h along directions with mass, 1/h along the others.
   subroutine fill_damping(structure, h, matrix)
      type(time_structure), intent(in) :: structure
      real(wp), intent(in) :: h
      !> Overwritten (n_dof, n_dof).
      real(wp), intent(inout) :: matrix(:, :)
      integer :: n

      n = structure%n_dof
      if (.not. allocated(structure%massive)) then
         matrix = 2.0_wp/h*structure%damping
         return
      end if
      ! With P the projection onto directions with mass: C (1 + P)/h.
      matrix = structure%damping
      call dgemm('N', 'N', n, n, n, 1.0_wp/h, structure%damping, n, structure%massive, n, &
                 1.0_wp/h, matrix, n)
   end subroutine fill_damping

   !> LU of the matrix scaled by nothing: a pivot that vanishes against its own diagonal entry
   !> before elimination means that neither mass nor stiffness resists.
   subroutine factor(lu, singular)
      type(lu_type), intent(inout) :: lu
      logical, intent(out) :: singular
      real(wp), allocatable :: row_size(:)
      integer :: i

      row_size = [(maxval(abs(lu%matrix(:, i))), i=1, lu%n)]
      call lu%factor(singular)
      do i = 1, lu%n
         singular = singular .or. abs(lu%matrix(i, i)) <= singular_tolerance*row_size(i)
      end do
   end subroutine factor

   !> d without contact forces (n_dof), from displacement, velocity and the mean load of the step.
   subroutine free_increment(self, structure, displacement, velocity, load, increment)
      class(step_operator), intent(in) :: self
      type(time_structure), intent(in) :: structure
      !> Displacement, velocity and mean force on the dofs (n_dof).
      real(wp), intent(in) :: displacement(:), velocity(:), load(:)
      real(wp), intent(out), contiguous :: increment(:)
      integer :: n

      n = structure%n_dof
      increment = load
      call dgemv('N', n, n, -1.0_wp, structure%stiffness, n, displacement, 1, 1.0_wp, increment, 1)
      call dgemv('N', n, n, 2.0_wp/self%h, structure%mass, n, velocity, 1, 1.0_wp, increment, 1)
      call self%lu%solve(increment)
   end subroutine free_increment

   !> Subtract the response to the forces of the rows from d.
   subroutine add_forces(self, structure, force, increment)
      class(step_operator), intent(in) :: self
      type(time_structure), intent(in) :: structure
      !> Forces of the rows (n_rows).
      real(wp), intent(in) :: force(:)
      real(wp), intent(inout), contiguous :: increment(:)

      if (structure%n_rows == 0) return
      call dgemv('N', structure%n_dof, structure%n_rows, -1.0_wp, self%response, &
                 structure%n_dof, force, 1, 1.0_wp, increment, 1)
   end subroutine add_forces

end module fw_step_operator
