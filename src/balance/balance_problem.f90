!> What is to be balanced: a structure, the harmonics and instants, and the laws of its nonlinear
!> forces with the rows that they act on.
!>
!> A problem is built once and only read then, so that threads and workers may share it. Where one
!> of them stands is in a `balance_state`, which points at the problem and must not outlive it.
module fw_balance_problem
   use fw_force_law, only: prediction_type
   use fw_force_list, only: force_list
   use fw_fourier, only: fourier_type
   use fw_incidence, only: incidence_type, new_incidence
   use fw_joint, only: joint_type
   use fw_kinds, only: wp
   use fw_reduction, only: held_basis
   use fw_size_options, only: sizes
   use fw_structure_operator, only: structure_operator, structure_state
   implicit none (type, external)
   private

   public :: balance_problem, problem_origin, new_balance_problem

   !> What it takes to condense the structure anew as its matrices change.
   type :: problem_origin
      !> Lowest and highest frequency [rad/s].
      real(wp) :: range(2) = 0.0_wp
      !> Whether all modes of the structure are coordinates, and the modes that they are then: the
      !> same whatever the matrices, so that unknowns keep their meaning.
      logical :: keeps_all = .false.
      type(held_basis) :: basis
      !> Laws are those of another problem, with the stiffness that its structure gave them.
      logical :: borrows_laws = .false.
   end type problem_origin

   type :: balance_problem
      !> Unknowns.
      integer :: n = 0
      type(joint_type) :: joint
      !> B, from the coordinates to the rows of the joint.
      type(incidence_type) :: incidence
      class(structure_operator), allocatable :: structure
      type(fourier_type) :: fourier
      type(force_list) :: forces
      integer :: n_pairs = 0
      !> Wear depth of the pairs where states start (n_pairs) [length].
      real(wp), allocatable :: depth(:)
      !> Whether states solve by themselves what they can, see `reduced` of nonlinear_system.
      logical :: reduced = .true.
      !> Unknowns are the values at the instants, not the coefficients (hdhb).
      logical :: solves_values = .false.
      !> Norm of the vibratory load on the structure [force], below whose round-off no load of the
      !> joint is one; 0 where it is not known.
      real(wp) :: load_size = 0.0_wp
      !> Bodies that nothing but pairs holds: which one each pair of a sector touches, 0 for none.
      integer, allocatable :: body_of_pair(:)
      !> How it was built.
      type(problem_origin) :: origin
   contains
      procedure :: coordinate_of
      procedure :: scale_forces
      procedure :: fits_whole
   end type balance_problem

contains

   !> Whether a matrix of all equal sectors together is worth its factors where waves, which take
   !> contact for the same in all of them, do not serve.
   pure logical function fits_whole(self)
      class(balance_problem), intent(in) :: self

      fits_whole = self%structure%n_coordinates <= sizes%whole_sectors
   end function fits_whole

   !> Put the parts together; laws that take the balance need `scale_forces` then.
   subroutine new_balance_problem(joint, structure, fourier, forces, depth, self)
      type(joint_type), intent(in) :: joint
      !> Moved into the problem.
      class(structure_operator), allocatable, intent(inout) :: structure
      type(fourier_type), intent(in) :: fourier
      type(force_list), intent(in) :: forces
      !> Wear depth of the pairs (n_pairs) [length]; zero where it is not allocated.
      real(wp), allocatable, intent(in) :: depth(:)
      type(balance_problem), intent(out) :: self

      self%joint = joint
      call new_incidence(joint%relative, structure%n_coordinates, self%incidence, &
                         structure%harmonic, structure%column)
      call move_alloc(structure, self%structure)
      self%fourier = fourier
      self%n = self%structure%n_coordinates*fourier%n_coefficients
      self%forces = forces
      self%n_pairs = forces%entry(forces%pairs)%law%n_elements
      allocate (self%depth(self%n_pairs), source=0.0_wp)
      if (allocated(depth)) self%depth = depth
   end subroutine new_balance_problem

   !> Give laws that take the balance their stiffness, from the structure; again where it changed.
   subroutine scale_forces(self, stand, highest)
      class(balance_problem), intent(inout) :: self
      !> The structure at a frequency.
      class(structure_state), intent(in) :: stand
      !> The highest frequency that is asked for [rad/s]: wherever a sweep begins, its points have
      !> the same balance.
      real(wp), intent(in) :: highest
      integer :: k

      do k = 1, self%forces%n_laws
         associate (law => self%forces%entry(k)%law)
            if (.not. law%prediction%takes_balance) cycle
            call set_stiffness(self, stand, highest, law%prediction)
            call law%take_prediction()
         end associate
      end do
   end subroutine scale_forces

   !> eps of the order of the local static stiffness (that of another direction where a coordinate
   !> has none: any value above zero serves), one for both tangential directions (the
   !> friction law is isotropic) and one for the normal. Directions that nothing moves do not
   !> count, whether they are left out or not.
   subroutine set_stiffness(self, stand, highest, prediction)
      type(balance_problem), intent(in) :: self
      class(structure_state), intent(in) :: stand
      real(wp), intent(in) :: highest
      type(prediction_type), intent(inout) :: prediction
      real(wp) :: stiffness(3)
      logical :: counts(2)
      integer :: i, c

      do i = 1, self%n_pairs
         if (.not. prediction%takes(i)) cycle
         stiffness = 0.0_wp
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            stiffness(c) = local_stiffness(self, stand, self%coordinate_of(c, i))
         end do
         counts = self%joint%row(1:2, i) > 0 .and. .not. self%joint%idle(1:2, i)
         if (.not. any(counts)) counts = self%joint%row(1:2, i) > 0
         stiffness(1:2) = sum(stiffness(1:2), mask=counts)/real(max(1, count(counts)), wp)
         if (maxval(stiffness) <= 0.0_wp) stiffness = largest_stiffness(self, stand)
         where (stiffness <= 0.0_wp .and. self%joint%row(:, i) > 0) stiffness = maxval(stiffness)
         prediction%stiffness(i, :) = prediction%scale*stiffness
      end do
      if (prediction%has_inertia) call set_inertia(self, highest, prediction)
   end subroutine set_stiffness

   !> What the structure is to motions above the harmonics of the balance, in place of its static
   !> stiffness; its mass and damping where they matter to a pair with one tangential direction.
   subroutine set_inertia(self, highest, prediction)
      type(balance_problem), intent(in) :: self
      real(wp), intent(in) :: highest
      type(prediction_type), intent(inout) :: prediction
      real(wp) :: m(3), c(3), k(3)
      logical :: counts(3)
      integer :: i, j, n

      ! Another frequency or other matrices may come later.
      if (.not. allocated(prediction%inertia)) allocate (prediction%inertia(self%n_pairs, 3))
      if (.not. allocated(prediction%damping)) allocate (prediction%damping(self%n_pairs, 3))
      prediction%inertia = 0.0_wp
      prediction%damping = 0.0_wp
      n = maxval(self%fourier%harmonic)
      do i = 1, self%n_pairs
         if (allocated(prediction%own)) then
            if (.not. prediction%own(i)%has_inertia) cycle
         end if
         counts = self%joint%row(:, i) > 0 .and. .not. self%joint%idle(:, i)
         k = 0.0_wp
         do j = 1, 3
            if (.not. counts(j)) cycle
            call self%structure%split(self%coordinate_of(j, i), (n + 1)*highest, m(j), &
                                      c(j), k(j))
            if (k(j) > 0.0_wp) prediction%stiffness(i, j) = prediction%scale*k(j)
         end do
         if (count(counts(1:2)) == 2) then
            ! One stiffness for both: friction is isotropic.
            if (all(k(1:2) > 0.0_wp)) then
               prediction%stiffness(i, 1:2) = prediction%scale*0.5_wp*sum(k(1:2))
            end if
            cycle
         end if
         j = findloc(counts(1:2), .true., dim=1)
         if (j == 0) cycle
         if (all(self%joint%row(1:2, i) > 0)) cycle
         if (.not. k(j) > 0.0_wp) cycle
         call take_inertia(4*n*highest, m(j), c(j), k(j))
         prediction%inertia(i, j) = prediction%scale*m(j)
         prediction%damping(i, j) = prediction%scale*c(j)
      end do
   end subroutine set_inertia

   !> Mass and damping of an oscillator as its law takes them: none where neither matters up to a
   !> frequency, else a mass above zero, and a damping that keeps resonances finite.
   pure subroutine take_inertia(frequency, m, c, k)
      real(wp), intent(in) :: frequency, k
      real(wp), intent(inout) :: m, c
      real(wp), parameter :: mass_matters = 0.02_wp, damping_matters = 0.05_wp
      real(wp), parameter :: least_mass = 1.0e-3_wp, least_damping = 1.0e-9_wp

      if (m*frequency**2 < mass_matters*k .and. c*frequency < damping_matters*k) then
         m = 0.0_wp
         c = 0.0_wp
         return
      end if
      m = max(m, least_mass*k/frequency**2)
      c = max(c, least_damping*sqrt(k*m))
   end subroutine take_inertia

   !> Largest static stiffness of all coordinates, or 1.
   real(wp) function largest_stiffness(self, stand) result(stiffness)
      type(balance_problem), intent(in) :: self
      class(structure_state), intent(in) :: stand
      integer :: j

      stiffness = 0.0_wp
      do j = 1, self%structure%n_coordinates
         stiffness = max(stiffness, local_stiffness(self, stand, j))
      end do
      if (stiffness <= 0.0_wp) stiffness = 1.0_wp
   end function largest_stiffness

   !> Static stiffness of a coordinate, or the dynamic one where nothing holds it statically.
   real(wp) function local_stiffness(self, stand, coordinate) result(stiffness)
      type(balance_problem), intent(in) :: self
      class(structure_state), intent(in) :: stand
      integer, intent(in) :: coordinate
      real(wp) :: dynamic
      real(wp), parameter :: unheld = 1.0e-6_wp
      integer :: h

      stiffness = abs(self%structure%static_stiffness(coordinate))
      h = findloc(self%structure%harmonic, 1, dim=1)
      dynamic = abs(self%structure%diagonal(stand, h, coordinate))
      if (stiffness <= unheld*dynamic) stiffness = dynamic
   end function local_stiffness

   !> Coordinate of a component that is one.
   pure integer function coordinate_of(self, component, pair) result(coordinate)
      class(balance_problem), intent(in) :: self
      integer, intent(in) :: component, pair

      coordinate = self%incidence%coordinate_of(self%joint%row(component, pair))
   end function coordinate_of

end module fw_balance_problem
