!> Models, cases and systems that several tests share, with a random sequence of their own (the
!> compiler's differs between versions) and a solver written for obviousness.
module support_models
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_kinds, only: wp
   use fw_laws, only: law_words
   use fw_case, only: case_type, analysis_point
   use fw_contact_data, only: contact_type, spring_type
   use fw_error, only: error_type
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_model, only: model_type
   use fw_problem, only: build_system
   implicit none (type, external)
   private

   public :: random_type, random_structure, chain_structure, new_contact, new_springs_data
   public :: new_case, new_system, solve_dense
   public :: damping_none, damping_rayleigh, damping_general
   public :: law_dlft, law_dlft_velocity, law_penalty, law_regularised, law_rigid

   integer, parameter :: damping_none = 0, damping_rayleigh = 1, damping_general = 2

   !> Park and Miller's generator: the same numbers everywhere.
   type :: random_type
      integer(int64) :: state = 12345_int64
   contains
      procedure :: next
      procedure :: vector
      procedure :: matrix
   end type random_type

   !> Problems of the systems that tests have made: they live to the end of the program, so that a
   !> test need not hold them.
   type :: kept_problem
      type(balance_problem) :: problem
      type(kept_problem), pointer :: before => null()
   end type kept_problem

   type(kept_problem), pointer :: problems => null()

   !> Laws by their words.
   integer, parameter :: law_dlft = findloc(law_words, 'dlft', dim=1)
   integer, parameter :: law_dlft_velocity = findloc(law_words, 'dlft_velocity', dim=1)
   integer, parameter :: law_penalty = findloc(law_words, 'penalty', dim=1)
   integer, parameter :: law_regularised = findloc(law_words, 'regularised', dim=1)
   integer, parameter :: law_rigid = findloc(law_words, 'rigid', dim=1)

contains

   !> Uniform in (-1, 1).
   real(wp) function next(self)
      class(random_type), intent(inout) :: self

      self%state = modulo(16807_int64*self%state, 2147483647_int64)
      next = 2.0_wp*real(self%state, wp)/2147483647.0_wp - 1.0_wp
   end function next

   function vector(self, n) result(v)
      class(random_type), intent(inout) :: self
      integer, intent(in) :: n
      real(wp) :: v(n)
      integer :: i

      do i = 1, n
         v(i) = self%next()
      end do
   end function vector

   function matrix(self, n, m) result(a)
      class(random_type), intent(inout) :: self
      integer, intent(in) :: n, m
      real(wp) :: a(n, m)
      integer :: j

      do j = 1, m
         a(:, j) = self%vector(n)
      end do
   end function matrix

   !> Symmetric positive definite matrices, natural frequencies near 1 to 2, random loads; every
   !> dof is observed.
   subroutine random_structure(random, n, damping, model)
      type(random_type), intent(inout) :: random
      integer, intent(in) :: n, damping
      type(model_type), intent(out) :: model
      real(wp) :: a(n, n)
      integer :: i

      model%n_dof = n
      a = random%matrix(n, n)
      model%mass = matmul(a, transpose(a))/n
      a = random%matrix(n, n)
      model%stiffness = 3.0_wp*matmul(a, transpose(a))/n
      do i = 1, n
         model%mass(i, i) = model%mass(i, i) + 0.5_wp
         model%stiffness(i, i) = model%stiffness(i, i) + 1.0_wp
      end do
      allocate (model%damping(n, n), source=0.0_wp)
      if (damping == damping_rayleigh) then
         model%damping = 0.02_wp*model%mass + 0.03_wp*model%stiffness
      else if (damping == damping_general) then
         a = random%matrix(n, n)
         model%damping = 0.05_wp*matmul(a, transpose(a))
      end if
      model%load_static = random%vector(n)
      model%load_cosine = random%vector(n)
      model%load_sine = random%vector(n)
      call observe_all(model)
   end subroutine random_structure

   !> Masses m in a row, springs k between them and one to the ground at the first;
   !> damping = share of the stiffness; loaded by cosine 1 at the last.
   subroutine chain_structure(n, m, k, share, model)
      integer, intent(in) :: n
      real(wp), intent(in) :: m, k, share
      type(model_type), intent(out) :: model
      integer :: i

      model%n_dof = n
      allocate (model%mass(n, n), model%stiffness(n, n), source=0.0_wp)
      do i = 1, n
         model%mass(i, i) = m
         model%stiffness(i, i) = merge(2.0_wp, 1.0_wp, i < n)*k
         if (i == n) cycle
         model%stiffness(i, i + 1) = -k
         model%stiffness(i + 1, i) = -k
      end do
      model%damping = share*model%stiffness
      allocate (model%load_static(n), model%load_cosine(n), model%load_sine(n), source=0.0_wp)
      model%load_cosine(n) = 1.0_wp
      call observe_all(model)
   end subroutine chain_structure

   subroutine observe_all(model)
      type(model_type), intent(inout) :: model
      integer :: i

      allocate (model%observe_matrix(model%n_dof, model%n_dof), source=0.0_wp)
      allocate (model%observe_name(model%n_dof))
      do i = 1, model%n_dof
         model%observe_matrix(i, i) = 1.0_wp
         model%observe_name(i)%text = 'u'
      end do
   end subroutine observe_all

   !> Pairs without dofs, of equal constants; the test fills in the sides.
   function new_contact(n_pairs, law, mu, normal_load, stiffness) result(contact)
      integer, intent(in) :: n_pairs, law
      real(wp), intent(in) :: mu, normal_load, stiffness
      type(contact_type) :: contact

      contact%n_pairs = n_pairs
      contact%law = law
      allocate (contact%side_1(3, n_pairs), contact%side_2(3, n_pairs), source=0)
      allocate (contact%mu(n_pairs), source=mu)
      allocate (contact%gap(n_pairs), source=0.0_wp)
      allocate (contact%area(n_pairs), source=1.0_wp)
      allocate (contact%normal_load(n_pairs), source=normal_load)
      allocate (contact%tangential_stiffness(n_pairs), source=stiffness)
      allocate (contact%normal_stiffness(n_pairs), source=1.5_wp*stiffness)
   end function new_contact

   function new_springs_data(side_1, side_2, coefficient, power) result(springs)
      integer, intent(in) :: side_1(:), side_2(:), power(:)
      real(wp), intent(in) :: coefficient(:)
      type(spring_type) :: springs

      springs%n_springs = size(side_1)
      springs%side_1 = side_1
      springs%side_2 = side_2
      springs%coefficient = coefficient
      springs%power = power
   end function new_springs_data

   !> One point at omega; the test changes what it is about.
   function new_case(model, contact, omega, n_harmonics, n_time) result(case)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      real(wp), intent(in) :: omega
      integer, intent(in) :: n_harmonics, n_time
      type(case_type) :: case

      case%title = 'test'
      case%analysis = analysis_point
      case%model = model
      case%contact = contact
      case%sweep%start = omega
      case%harmonics%n_harmonics = n_harmonics
      case%harmonics%n_time = n_time
      ! Tight enough for answers of different ways to agree to 1e-9.
      case%solver%tolerance = 1.0e-12_wp
   end function new_case

   !> The system of a case, at its frequency.
   subroutine new_system(case, system)
      type(case_type), intent(in) :: case
      type(balance_state), intent(out) :: system
      type(error_type), allocatable :: error
      type(kept_problem), pointer :: kept

      allocate (kept)
      kept%before => problems
      problems => kept
      call build_system(case, kept%problem, system, error)
      if (allocated(error)) error stop error%message
      call system%set_frequency(case%sweep%start, error)
      if (allocated(error)) error stop error%message
   end subroutine new_system

   !> x = a^-1 b by Gaussian elimination with row pivoting.
   function solve_dense(a, b) result(x)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      complex(wp) :: x(size(b, 1), size(b, 2))
      complex(wp) :: u(size(a, 1), size(a, 1)), row(size(a, 1)), rhs(size(b, 2)), factor
      integer :: i, j, p, n

      n = size(a, 1)
      u = a
      x = b
      do i = 1, n
         p = i - 1 + maxloc(abs(u(i:, i)), dim=1)
         row = u(i, :)
         u(i, :) = u(p, :)
         u(p, :) = row
         rhs = x(i, :)
         x(i, :) = x(p, :)
         x(p, :) = rhs
         do j = i + 1, n
            factor = u(j, i)/u(i, i)
            u(j, i:) = u(j, i:) - factor*u(i, i:)
            x(j, :) = x(j, :) - factor*x(i, :)
         end do
      end do
      do i = n, 1, -1
         do j = i + 1, n
            x(i, :) = x(i, :) - u(i, j)*x(j, :)
         end do
         x(i, :) = x(i, :)/u(i, i)
      end do
   end function solve_dense

end module support_models
