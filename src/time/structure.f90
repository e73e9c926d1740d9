!> A structure with contact pairs and springs, prepared for integration in time:
!>
!>   M u'' + C u' + K u + B^T lambda = f_0 + f_c cos(omega t) + f_s sin(omega t) + ..
!>
!> Rows of B are the relative displacements u(side_1) - u(side_2) of the components in use, pair by
!> pair, then of the other elements, then of the springs. The mass may be singular: its massless
!> directions are separated by an orthogonal projection and follow the others without inertia.
module fw_time_structure
   use fw_kinds, only: wp
   use fw_contact_data, only: contact_type, sliding_steady, spring_type
   use fw_element_forces, only: element_forces, new_element_forces
   use fw_element_group, only: element_group, group_name_length
   use fw_elements, only: element_list
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_force_law, only: force_law
   use fw_gap_motion, only: gap_motion, take_gap_motion
   use fw_instant_law, only: as_instant_law, instant_law
   use fw_lapack, only: dgemm, dsyevd
   use fw_laws, only: build_law
   use fw_load_waves, only: load_waves
   use fw_model, only: model_type
   use fw_pair_law, only: pair_law
   use fw_side, only: add_side
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: element_rows, time_structure, new_time_structure

   !> Share of the largest eigenvalue of the scaled mass below which a direction is massless.
   real(wp), parameter :: massless_tolerance = 1.0e-12_wp
   !> Part of a row of B that must lie in the massless directions to count.
   real(wp), parameter :: massless_part = 1.0e-9_wp

   !> Elements of one kind, whose forces follow from their rows and the rates of these.
   type :: element_rows
      character(group_name_length) :: group = ''
      class(instant_law), allocatable :: law
      !> Row of each input, 0 where there is none (n_in, n_elements).
      integer, allocatable :: row(:, :)
   end type element_rows

   type :: time_structure
      integer :: n_dof = 0
      integer :: n_pairs = 0
      integer :: n_springs = 0
      !> Rows of B: components of pairs, then inputs of other elements, then springs.
      integer :: n_rows = 0
      integer :: n_element_rows = 0
      !> Matrices (n_dof, n_dof); the stiffness is without springs and contact.
      real(wp), allocatable :: mass(:, :), damping(:, :), stiffness(:, :)
      !> Loads in columns (n_dof, n_columns) [force], and what these are.
      real(wp), allocatable :: load(:, :)
      type(load_waves) :: waves
      !> B transposed (n_dof, n_rows).
      real(wp), allocatable :: rows(:, :)
      !> Row of each component of each pair, 0 where it is absent (3, n_pairs).
      integer, allocatable :: row(:, :)
      !> Whether a row moves without inertia (n_rows).
      logical, allocatable :: massless(:)
      !> 1/stiffness of elastic pairs, 0 for rigid ones (n_rows) [length/force].
      real(wp), allocatable :: compliance(:)
      !> Friction coefficient, gap with wear [length], constant normal force [force] (n_pairs).
      real(wp), allocatable :: mu(:), gap(:), normal_load(:)
      !> What gaps have in harmonics, where they move, and velocities of side 2 along t1 and t2
      !> (n_pairs, 2) [length/time].
      type(gap_motion), allocatable :: motion
      real(wp), allocatable :: speed(:, :)
      !> Of pairs whose side 2 slides steadily, tangential forces over the normal one, mu v/|v|; 0
      !> of all others (2, n_pairs).
      real(wp), allocatable :: lean(:, :)
      !> The law of the pairs, those that act at once, by its `at_instant` (n_pairs), and the depth
      !> that they are worn by [length].
      class(pair_law), allocatable :: law
      logical, allocatable :: at_once(:)
      real(wp), allocatable :: depth(:)
      !> Kinds of elements that midpoint steps take.
      type(element_rows), allocatable :: kind(:)
      !> Springs: force coefficient * e**power (n_springs).
      real(wp), allocatable :: coefficient(:)
      integer, allocatable :: power(:)
      !> Elements that are neither, for motions that are smooth; not allocated where there are none.
      type(element_forces), allocatable :: elements
      !> Projection on the directions with mass (n_dof, n_dof); not allocated where all have mass.
      real(wp), allocatable :: massive(:, :)
   contains
      procedure :: project
      procedure :: leans
   end type time_structure

contains

   !> Prepare a model; `present` marks the components of the pairs that are in use (3, n_pairs).
   subroutine new_time_structure(model, contact, springs, present, self, error, elements)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      logical, intent(in) :: present(:, :)
      type(time_structure), intent(out) :: self
      !> status_failure where the eigenvalues of the mass cannot be computed, status_input where
      !> elements cannot be integrated.
      type(error_type), allocatable, intent(out) :: error
      !> Others, whose forces follow from the motion at the same instant (default: none).
      type(element_list), intent(in), optional :: elements

      self%n_dof = model%n_dof
      self%n_pairs = contact%n_pairs
      self%n_springs = springs%n_springs
      self%mass = model%mass
      self%damping = model%damping
      self%stiffness = model%stiffness
      self%load = model%load_columns()
      self%waves = model%waves
      call take_pairs(contact, present, model%rows, self)
      allocate (self%kind(0))
      call take_elements(self, model, elements)
      call take_springs(springs, model%rows, self)
      call find_massless(self, error)
      if (.not. allocated(error)) call check_rates(self, error)
   end subroutine new_time_structure

   !> What is neither pair nor spring.
   subroutine take_elements(self, model, elements)
      type(time_structure), intent(inout) :: self
      type(model_type), intent(in) :: model
      type(element_list), intent(in), optional :: elements

      if (.not. present(elements)) return
      if (elements%n_elements() == 0) return
      allocate (self%elements)
      call new_element_forces(elements, model, self%elements)
      call take_kinds(elements, model%rows, self)
   end subroutine take_elements

   !> Components that an elastic law gives no stiffness transmit nothing and are left out.
   subroutine take_pairs(contact, present, rows, self)
      type(contact_type), intent(in) :: contact
      logical, intent(in) :: present(:, :)
      !> Of the model.
      real(wp), allocatable, intent(in) :: rows(:, :)
      type(time_structure), intent(inout) :: self
      integer :: i, c

      allocate (self%row(3, contact%n_pairs), source=0)
      allocate (self%compliance(3*contact%n_pairs), source=0.0_wp)
      allocate (self%rows(self%n_dof, 3*contact%n_pairs + self%n_springs), source=0.0_wp)
      allocate (self%mu(0), self%gap(0), self%normal_load(0), self%at_once(0), self%depth(0))
      self%speed = contact%speeds()
      allocate (self%lean(2, contact%n_pairs), source=0.0_wp)
      if (contact%n_pairs == 0) return
      call build_law(contact, present, self%law)
      self%mu = self%law%mu
      if (contact%sliding == sliding_steady) call take_lean(self, present)
      self%at_once = [(self%law%acts_alone(i), i=1, contact%n_pairs)]
      self%depth = 0.0_wp*self%mu
      if (allocated(contact%depth)) self%depth = contact%depth
      ! Worn depth opens the contact further (docs/theory.md, Motion).
      self%gap = self%law%prediction%gap
      call take_gap_motion(contact, self%motion)
      if (allocated(contact%depth)) self%gap = self%gap + contact%depth
      self%normal_load = self%law%prediction%load
      do i = 1, contact%n_pairs
         do c = 1, 3
            if (.not. present(c, i)) cycle
            if (.not. self%law%prediction%takes(i)) then
               associate (stiffness => self%law%prediction%stiffness(i, c))
                  if (stiffness <= 0.0_wp) cycle
                  ! A pair that acts at once is its own law, as a spring is; friction of steady
                  ! sliding is no spring's.
                  if (.not. (self%at_once(i) .or. (c < 3 .and. self%leans(i)))) then
                     self%compliance(self%n_rows + 1) = 1.0_wp/stiffness
                  end if
               end associate
            end if
            self%n_rows = self%n_rows + 1
            self%row(c, i) = self%n_rows
            call add_side(contact%side_1(c, i), 1.0_wp, self%rows(:, self%n_rows), rows)
            call add_side(contact%side_2(c, i), -1.0_wp, self%rows(:, self%n_rows), rows)
         end do
      end do
   end subroutine take_pairs

   !> Friction that has the direction of side 2 whatever the vibration.
   pure subroutine take_lean(self, present)
      type(time_structure), intent(inout) :: self
      logical, intent(in) :: present(:, :)
      integer :: i

      do i = 1, self%n_pairs
         associate (v => self%speed(i, :))
            if (norm2(v) > 0.0_wp) self%lean(:, i) = merge(self%mu(i)*v/norm2(v), 0.0_wp, &
                                                           present(1:2, i))
         end associate
      end do
   end subroutine take_lean

   !> Whether side 2 of a pair slides steadily under friction.
   elemental logical function leans(self, pair)
      class(time_structure), intent(in) :: self
      integer, intent(in) :: pair

      leans = any(abs(self%lean(:, pair)) > 0.0_wp)
   end function leans

   !> Rows of elements behind those of the pairs: their inputs.
   subroutine take_kinds(elements, rows, self)
      type(element_list), intent(in) :: elements
      real(wp), allocatable, intent(in) :: rows(:, :)
      type(time_structure), intent(inout) :: self
      type(element_rows) :: kind
      class(force_law), allocatable :: law
      integer :: k

      do k = 1, size(elements%slot)
         if (elements%slot(k)%group%n_elements == 0) cycle
         call elements%slot(k)%group%make_law(1, law)
         call as_instant_law(law, kind%law)
         if (.not. allocated(kind%law)) cycle
         kind%group = elements%slot(k)%group%name()
         call take_inputs(elements%slot(k)%group, rows, self, kind%row)
         self%kind = [self%kind, kind]
      end do
   end subroutine take_kinds

   !> Rows of the inputs of a kind.
   subroutine take_inputs(group, rows, self, row)
      class(element_group), intent(in) :: group
      !> Of the model.
      real(wp), allocatable, intent(in) :: rows(:, :)
      type(time_structure), intent(inout) :: self
      integer, allocatable, intent(out) :: row(:, :)
      real(wp), allocatable :: longer(:, :)
      integer :: c, i, n

      n = group%n_in*group%n_elements
      allocate (row(group%n_in, group%n_elements), source=0)
      allocate (longer(self%n_dof, size(self%rows, 2) + n), source=0.0_wp)
      longer(:, :self%n_rows) = self%rows(:, :self%n_rows)
      call move_alloc(longer, self%rows)
      n = self%n_rows
      do i = 1, group%n_elements
         do c = 1, group%n_in
            if (group%row_side_1(c, i) == 0 .and. group%row_side_2(c, i) == 0) cycle
            self%n_rows = self%n_rows + 1
            row(c, i) = self%n_rows
            call add_side(group%row_side_1(c, i), 1.0_wp, self%rows(:, self%n_rows), rows)
            call add_side(group%row_side_2(c, i), -1.0_wp, self%rows(:, self%n_rows), rows)
         end do
      end do
      ! As a spring an element is its own law: nothing yields in series with it.
      self%compliance = [self%compliance(:n), (0.0_wp, i=n + 1, self%n_rows)]
      self%n_element_rows = self%n_element_rows + self%n_rows - n
   end subroutine take_inputs

   !> The rate of a row that moves without inertia, in part or altogether, is no part of a state.
   subroutine check_rates(self, error)
      type(time_structure), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: c, i, k

      do k = 1, size(self%kind)
         if (.not. self%kind(k)%law%takes_rates) cycle
         do i = 1, size(self%kind(k)%row, 2)
            do c = 1, size(self%kind(k)%row, 1)
               if (self%kind(k)%row(c, i) == 0) cycle
               if (.not. self%massless(self%kind(k)%row(c, i))) cycle
               call fatal_error(error, "case%analysis = 'time': element "//to_text(i)//' of &'// &
                                trim(self%kind(k)%group)//' acts on a dof without mass; give '// &
                                "the dof a mass, or use 'frf' or 'point'", status_input)
               return
            end do
         end do
      end do
   end subroutine check_rates

   !> Rows of springs behind those of pairs and elements: their elongations.
   subroutine take_springs(springs, rows, self)
      type(spring_type), intent(in) :: springs
      real(wp), allocatable, intent(in) :: rows(:, :)
      type(time_structure), intent(inout) :: self
      integer :: i

      allocate (self%coefficient(0), self%power(0))
      ! A spring is its own law: nothing yields in series with it.
      self%compliance = [self%compliance(:self%n_rows), (0.0_wp, i=1, springs%n_springs)]
      do i = 1, springs%n_springs
         self%n_rows = self%n_rows + 1
         call add_side(springs%side_1(i), 1.0_wp, self%rows(:, self%n_rows), rows)
         call add_side(springs%side_2(i), -1.0_wp, self%rows(:, self%n_rows), rows)
      end do
      self%rows = self%rows(:, :self%n_rows)
      if (springs%n_springs == 0) return
      self%coefficient = springs%coefficient
      self%power = springs%power
   end subroutine take_springs

   !> Split the dofs by the eigenvectors of the mass scaled to a unit diagonal, so that mixed
   !> units do not decide what counts as massless.
   subroutine find_massless(self, error)
      type(time_structure), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: vectors(:, :), values(:), null_space(:, :), scale(:), work(:)
      integer, allocatable :: iwork(:)
      integer :: n, n_null, info, i

      n = self%n_dof
      allocate (self%massless(self%n_rows), source=.false.)
      allocate (values(n), work(1 + 6*n + 2*n**2), iwork(3 + 5*n))
      ! A dof without mass keeps its row of zeros, whatever its scale.
      scale = [(merge(1.0_wp/sqrt(self%mass(i, i)), 1.0_wp, self%mass(i, i) > 0.0_wp), i=1, n)]
      vectors = self%mass
      do i = 1, n
         vectors(:, i) = scale(:)*vectors(:, i)*scale(i)
      end do
      call dsyevd('V', 'U', n, vectors, n, values, work, size(work), iwork, size(iwork), info)
      if (info /= 0) then
         call fatal_error(error, 'the eigenvalues of the mass matrix could not be computed; '// &
                          'check its values', status_failure)
         return
      end if
      n_null = count(values <= massless_tolerance*max(values(n), 0.0_wp))
      if (n_null == 0) return
      null_space = vectors(:, :n_null)
      do i = 1, n
         null_space(i, :) = scale(i)*null_space(i, :)
      end do
      call orthonormalize(null_space)
      allocate (self%massive(n, n), source=0.0_wp)
      do i = 1, n
         self%massive(i, i) = 1.0_wp
      end do
      call dgemm('N', 'T', n, n, n_null, -1.0_wp, null_space, n, null_space, n, 1.0_wp, &
                 self%massive, n)
      do i = 1, self%n_rows
         self%massless(i) = norm2(matmul(self%rows(:, i), null_space)) > &
                            massless_part*norm2(self%rows(:, i))
      end do
   end subroutine find_massless

   !> Gram-Schmidt, twice, in place.
   pure subroutine orthonormalize(columns)
      real(wp), intent(inout) :: columns(:, :)
      integer :: i, j, pass

      do i = 1, size(columns, 2)
         do pass = 1, 2
            do j = 1, i - 1
               columns(:, i) = columns(:, i) - &
                               dot_product(columns(:, j), columns(:, i))*columns(:, j)
            end do
            columns(:, i) = columns(:, i)/norm2(columns(:, i))
         end do
      end do
   end subroutine orthonormalize

   !> Part of a vector in the directions with mass (n_dof).
   pure subroutine project(self, vector, part)
      class(time_structure), intent(in) :: self
      real(wp), intent(in) :: vector(self%n_dof)
      real(wp), intent(out) :: part(self%n_dof)
      integer :: j

      if (.not. allocated(self%massive)) then
         part = vector
         return
      end if
      part = 0.0_wp
      do j = 1, self%n_dof
         part = part + vector(j)*self%massive(:, j)
      end do
   end subroutine project

end module fw_time_structure
