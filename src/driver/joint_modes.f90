!> Modes of a structure with its joint in three linear states: free (no contact at all), sliding
!> (held along the normals) and stuck (held in every direction).
module fw_joint_modes
   use fw_body, only: body_type
   use fw_formed_stiffness, only: harmonic_load
   use fw_kinds, only: wp
   use fw_modes, only: find_modes, mode_type
   use fw_laws, only: build_law
   use fw_pair_law, only: pair_law
   use fw_sector_modes, only: find_sector_modes
   use fw_side, only: terms_of
   implicit none (type, external)
   private

   public :: joint_mode_type, find_joint_modes, held_stiffness, most_dofs
   public :: state_free, state_sliding, state_stuck

   !> What the joint does.
   integer, parameter :: state_free = 1, state_sliding = 2, state_stuck = 3

   type, extends(mode_type) :: joint_mode_type
      !> The state of the joint that it is a mode of.
      integer :: state = state_free
      !> Harmonic of the loads that it answers.
      integer :: harmonic = 1
   end type joint_mode_type

   !> Stiffness that stands for a rigid hold, in parts of the largest of the structure: modes are
   !> that much below those of a rigid one, and round-off of an eigenvalue stays far below.
   real(wp), parameter :: hold = 1.0e6_wp
   !> Dofs up to which modes are looked for: their eigenvalue problems cost the cube of that, the
   !> solution of a point far less with as many.
   integer, parameter :: most_dofs = 2000
   !> The first component of pairs that each state holds.
   integer, parameter :: first_held(*) = [4, 3, 1]

contains

   !> Modes within a range of frequencies; none of a structure that is too large.
   subroutine find_joint_modes(case, range, modes)
      class(body_type), intent(in) :: case
      !> [rad/s]
      real(wp), intent(in) :: range(2)
      type(joint_mode_type), allocatable, intent(out) :: modes(:)
      real(wp), allocatable :: stiffness(:, :)
      integer :: n, state

      allocate (modes(0))
      if (case%model%n_dof > most_dofs) return
      do state = state_free, state_stuck
         if (.not. differs(case, state)) cycle
         if (.not. case%model%cyclic%is_cyclic) call held_stiffness(case, state, stiffness)
         ! A load of harmonic n hits a mode at an n-th of its frequency.
         do n = 1, case%model%waves%highest()
            if (.not. is_loaded(case, n)) cycle
            call add_modes_of(case, state, n, stiffness, range, modes)
         end do
      end do
   end subroutine find_joint_modes

   !> Whether loads of a harmonic are looked at: the first always, others where some act.
   pure logical function is_loaded(case, n)
      class(body_type), intent(in) :: case
      integer, intent(in) :: n

      is_loaded = n == 1
      if (is_loaded .or. .not. allocated(case%model%waves%harmonic)) return
      is_loaded = any(case%model%waves%harmonic == n)
   end function is_loaded

   !> Modes that the load of a harmonic hits, at the frequencies of the first harmonic where it
   !> does.
   subroutine add_modes_of(case, state, n, stiffness, range, modes)
      class(body_type), intent(in) :: case
      integer, intent(in) :: state, n
      !> Of a structure that is not cyclic.
      real(wp), allocatable, intent(in) :: stiffness(:, :)
      real(wp), intent(in) :: range(2)
      type(joint_mode_type), allocatable, intent(inout) :: modes(:)
      type(mode_type), allocatable :: found(:)
      complex(wp) :: load(case%model%n_dof)
      integer :: i, j

      if (case%model%cyclic%is_cyclic) then
         call find_sector_modes(case, n, first_held(state), real(n, wp)*range, found)
      else
         load = harmonic_load(case%model%load_columns(), case%model%waves, n, &
                              0.5_wp*n*sum(range))
         call find_modes(case%model%mass, case%model%damping, stiffness, &
                         reshape([real(load, wp), -aimag(load)], [size(load), 2]), &
                         case%model%observe_matrix, real(n, wp)*range, found, &
                         case%model%loss_factor)
      end if
      do i = 1, size(found)
         found(i)%omega = found(i)%omega/n
         found(i)%width = found(i)%width/n
         found(i)%amplitude = [(found(i)%amplitude, j=1, case%model%cyclic%n_solved())]
      end do
      call join(found, state, n, modes)
   end subroutine add_modes_of

   !> Add the modes of a state. Element by element: gfortran 12 loses allocatable components of an
   !> array constructor in places.
   subroutine join(found, state, harmonic, modes)
      type(mode_type), intent(in) :: found(:)
      integer, intent(in) :: state, harmonic
      type(joint_mode_type), allocatable, intent(inout) :: modes(:)
      type(joint_mode_type), allocatable :: longer(:)
      integer :: i, n

      n = size(modes)
      allocate (longer(n + size(found)))
      do i = 1, n
         longer(i) = modes(i)
      end do
      do i = 1, size(found)
         longer(n + i)%mode_type = found(i)
         longer(n + i)%state = state
         longer(n + i)%harmonic = harmonic
      end do
      call move_alloc(longer, modes)
   end subroutine join

   !> Whether a state holds more than the one before.
   pure logical function differs(case, state)
      class(body_type), intent(in) :: case
      integer, intent(in) :: state

      differs = .true.
      if (state == state_free) return
      differs = case%contact%n_pairs > 0
      if (.not. differs) return
      if (state == state_sliding) then
         differs = any(case%contact%side_1(3, :) /= 0 .or. case%contact%side_2(3, :) /= 0)
      else
         differs = any(case%contact%side_1(1:2, :) /= 0 .or. case%contact%side_2(1:2, :) /= 0)
      end if
   end function differs

   !> The stiffness with linear springs and with what the contact holds.
   subroutine held_stiffness(case, state, stiffness)
      class(body_type), intent(in) :: case
      integer, intent(in) :: state
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      class(pair_law), allocatable :: law
      real(wp) :: rigid
      integer :: i, c

      stiffness = case%model%stiffness
      do i = 1, case%springs%n_springs
         if (case%springs%power(i) == 1) call add_spring(case%model%rows, &
            [case%springs%side_1(i), case%springs%side_2(i)], case%springs%coefficient(i), &
            stiffness)
      end do
      if (state == state_free) return
      rigid = hold*maxval(abs(stiffness))
      associate (contact => case%contact)
         call build_law(contact, contact%side_1 /= 0 .or. contact%side_2 /= 0, law)
         do i = 1, contact%n_pairs
            do c = merge(1, 3, state == state_stuck), 3
               if (.not. law%prediction%takes(i) .and. law%prediction%order_of(i, c) == 0) then
                  call add_spring(case%model%rows, [contact%side_1(c, i), contact%side_2(c, i)], &
                                  law%prediction%stiffness(i, c), stiffness)
               else
                  ! A law of positions that takes the balance, or a law of velocities: held
                  ! rigidly.
                  call add_spring(case%model%rows, [contact%side_1(c, i), contact%side_2(c, i)], &
                                  rigid, stiffness)
               end if
            end do
         end do
      end associate
   end subroutine held_stiffness

   !> A spring between two sides.
   pure subroutine add_spring(rows, sides, coefficient, stiffness)
      !> Of the model.
      real(wp), allocatable, intent(in) :: rows(:, :)
      integer, intent(in) :: sides(2)
      real(wp), intent(in) :: coefficient
      real(wp), intent(inout) :: stiffness(:, :)
      integer, allocatable :: dof(:), other(:)
      real(wp), allocatable :: turn(:), weight(:)
      integer :: a, b

      ! coefficient b b^T, where b is +-1 at both dofs and the ground has no row.
      call terms_of(sides(1), dof, turn, rows)
      call terms_of(-sides(2), other, weight, rows)
      dof = [dof, other]
      turn = [turn, weight]
      do b = 1, size(dof)
         do a = 1, size(dof)
            stiffness(dof(a), dof(b)) = stiffness(dof(a), dof(b)) + turn(a)*turn(b)*coefficient
         end do
      end do
   end subroutine add_spring

end module fw_joint_modes
