!> Coordinates of the perturbations of a periodic solution: u = T y with y in three parts,
!>
!>   massive   T^T M T = I,
!>   damped    massless directions with damping: T^T C T = I, without damping towards the others,
!>   static    directions with neither: they follow the others without delay.
!>
!> A massive direction has two exponents, a damped one has one, a static one has none. All else
!> (stiffness, nonlinear forces) stays full. Rows are scaled to a unit diagonal first, so that
!> mixed units do not decide what counts as massless.
module fw_stability_basis
   use fw_error, only: error_type, fatal_error, status_input
   use fw_incidence, only: incidence_type, new_incidence
   use fw_kinds, only: wp
   use fw_linalg, only: diagonalize, lu_type
   use fw_model, only: model_type
   use fw_relative, only: relative_type
   implicit none (type, external)
   private

   public :: perturbation_basis, new_perturbation_basis

   type :: perturbation_basis
      !> Coordinates: massive, then damped, then static ones.
      integer :: n = 0
      integer :: n_massive = 0
      integer :: n_damped = 0
      !> In these coordinates (n, n).
      real(wp), allocatable :: stiffness(:, :), damping(:, :)
      !> Relative displacement of each row of the joint per coordinate (n, n_rows).
      real(wp), allocatable :: direction(:, :)
   end type perturbation_basis

   !> Eigenvalues below this share of the largest count as zero: round-off of an order 1000
   !> matrix stays well below, a physical ratio of masses well above.
   real(wp), parameter :: rank_tolerance = 1.0e-12_wp

contains

   !> Build the coordinates of a model and the directions of its joint.
   subroutine new_perturbation_basis(model, relative, self, error)
      type(model_type), intent(in) :: model
      type(relative_type), intent(in) :: relative
      type(perturbation_basis), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: basis(:, :), rows(:, :), massive(:, :), damping(:, :)
      integer :: nb, nd, i

      call split_mass(model, basis, self%n_massive, error)
      if (allocated(error)) return
      call split_damping(model%damping, basis, self%n_massive, self%n_damped, error)
      if (allocated(error)) return
      self%n = model%n_dof
      nb = self%n_massive
      nd = self%n_damped
      self%stiffness = matmul(transpose(basis), matmul(model%stiffness, basis))
      allocate (self%damping(self%n, self%n), source=0.0_wp)
      if (allocated(model%cyclic%circulatory)) self%stiffness = self%stiffness + &
         matmul(transpose(basis), matmul(model%cyclic%circulatory, basis))
      massive = basis(:, :nb)
      damping = model%damping
      if (allocated(model%cyclic%coriolis)) then
         call check_coriolis(model%cyclic%coriolis, basis, nb, error)
         if (allocated(error)) return
         damping = damping + model%cyclic%coriolis
      end if
      self%damping(:nb, :nb) = matmul(transpose(massive), matmul(damping, massive))
      do i = nb + 1, nb + nd
         self%damping(i, i) = 1.0_wp
      end do
      call rows_of_dofs(relative, rows)
      self%direction = matmul(transpose(basis), rows)
   end subroutine new_perturbation_basis

   !> Skew forces of velocities act between directions with mass alone.
   subroutine check_coriolis(coriolis, basis, n_massive, error)
      real(wp), intent(in) :: coriolis(:, :), basis(:, :)
      integer, intent(in) :: n_massive
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: forces(size(basis, 1), size(basis, 2) - n_massive)

      forces = matmul(coriolis, basis(:, n_massive + 1:))
      if (norm2(forces) <= rank_tolerance*norm2(coriolis)*norm2(basis)) return
      call fatal_error(error, '&sweep stability: coriolis or damping_unsymmetric acts on a dof '// &
                       'without mass; give it mass, or leave stability out', status_input)
   end subroutine check_coriolis

   !> Columns (n, n): massive directions of unit mass, then the massless ones.
   subroutine split_mass(model, basis, n_massive, error)
      type(model_type), intent(in) :: model
      real(wp), allocatable, intent(out) :: basis(:, :)
      integer, intent(out) :: n_massive
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :), values(:)
      real(wp) :: scale(model%n_dof)
      integer :: j, n, n_massless

      n = model%n_dof
      scale = unit_scale(model)
      allocate (vectors(n, n))
      do j = 1, n
         vectors(:, j) = scale*model%mass(:, j)*scale(j)
      end do
      call diagonalize(vectors, values, 'sweep%stability', error)
      if (allocated(error)) return
      ! Ascending eigenvalues: the massless directions come first.
      n_massless = count(values <= rank_tolerance*max(values(n), 0.0_wp))
      n_massive = n - n_massless
      allocate (basis(n, n))
      do j = 1, n_massive
         basis(:, j) = scale*vectors(:, n_massless + j)/sqrt(values(n_massless + j))
      end do
      do j = 1, n_massless
         basis(:, n_massive + j) = scale*vectors(:, j)
      end do
   end subroutine split_mass

   !> Factors that bring the diagonal of M to one, and that of K where there is no mass (n).
   pure function unit_scale(model) result(scale)
      type(model_type), intent(in) :: model
      real(wp) :: scale(model%n_dof)
      ! Far below any physical ratio of masses in one model, whatever the units.
      real(wp), parameter :: no_mass = 1.0e-20_wp
      real(wp) :: largest
      integer :: i

      largest = 0.0_wp
      do i = 1, model%n_dof
         largest = max(largest, model%mass(i, i))
      end do
      do i = 1, model%n_dof
         scale(i) = 1.0_wp
         if (model%mass(i, i) > no_mass*largest) then
            scale(i) = 1.0_wp/sqrt(model%mass(i, i))
         else if (abs(model%stiffness(i, i)) > 0.0_wp) then
            scale(i) = 1.0_wp/sqrt(abs(model%stiffness(i, i)))
         end if
      end do
   end function unit_scale

   !> Sort the massless columns of the basis into damped and static ones; the massive columns are
   !> shifted along the damped ones, which changes their mass by nothing, until C decouples them.
   subroutine split_damping(damping, basis, n_massive, n_damped, error)
      real(wp), intent(in) :: damping(:, :)
      real(wp), intent(inout) :: basis(:, :)
      integer, intent(in) :: n_massive
      integer, intent(out) :: n_damped
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :), values(:), whole(:, :), sorted(:, :), shift(:, :)
      integer :: j, n, n_massless

      n = size(basis, 1)
      n_massless = n - n_massive
      n_damped = 0
      if (n_massless == 0) return
      whole = matmul(transpose(basis), matmul(damping, basis))
      vectors = whole(n_massive + 1:, n_massive + 1:)
      call diagonalize(vectors, values, 'sweep%stability', error)
      if (allocated(error)) return
      n_damped = count(values > rank_tolerance*maxval(abs(whole)))
      ! Descending eigenvalues: the damped directions come first.
      sorted = matmul(basis(:, n_massive + 1:), vectors(:, n_massless:1:-1))
      do j = 1, n_damped
         sorted(:, j) = sorted(:, j)/sqrt(values(n_massless + 1 - j))
      end do
      basis(:, n_massive + 1:) = sorted
      if (n_damped == 0 .or. n_massive == 0) return
      sorted = sorted(:, :n_damped)
      shift = matmul(transpose(sorted), matmul(damping, basis(:, :n_massive)))
      basis(:, :n_massive) = basis(:, :n_massive) - matmul(sorted, shift)
   end subroutine split_damping

   !> Rows of the joint as combinations of the dofs (n_dof, n_rows), from
   !> u(pivot) = c q - r u(free)  and  row = sum of coefficient * q.
   subroutine rows_of_dofs(relative, rows)
      type(relative_type), intent(in) :: relative
      real(wp), allocatable, intent(out) :: rows(:, :)
      type(lu_type) :: lu
      real(wp), allocatable :: weights(:)
      type(incidence_type) :: incidence
      integer :: row, m
      logical :: singular

      m = relative%n_coordinates
      allocate (rows(relative%n_dof, relative%n_rows), source=0.0_wp)
      if (m == 0) return
      call lu%reserve(m)
      lu%matrix = transpose(relative%c)
      ! The elimination that made c has scaled its pivots to one: it is never singular.
      call lu%factor(singular)
      allocate (weights(m))
      call new_incidence(relative, m, incidence)
      do row = 1, relative%n_rows
         call incidence%weights_of(row, weights)
         call lu%solve(weights)
         rows(relative%pivot, row) = weights
         rows(relative%free, row) = matmul(weights, relative%r)
      end do
   end subroutine rows_of_dofs

end module fw_stability_basis
