!> What holds bodies that no spring holds: with V the motions of a body and of the nodes without
!> mass that springs tie to it (K V = 0), forces of its pairs have to balance its load at rest,
!>
!>   V^T B^T lambda = V^T f_0,   lambda_n = -N <= 0,   |lambda_t| <= mu N.
!>
!> Circles of friction are polygons around them: what is refused has no forces.
module fw_held_bodies
   use fw_body, only: body_type
   use fw_cone, only: nearest_in_cone, rank_of
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: pi, wp
   use fw_linalg, only: lu_type
   use fw_side, only: add_side, terms_of
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: are_of_bodies, body_hold, check_bodies, find_hold, pairs_of_bodies

   !> How one body is held.
   type :: body_hold
      !> Springs hold it, or what it hangs on is too large to tell: nothing more is known then.
      logical :: has_springs = .false.
      !> Which pairs touch it (n_pairs of a sector).
      logical, allocatable :: touches(:)
      !> Whether forces exist that balance its load, and whether forces exist without one.
      logical :: can_stand = .true., locks_itself = .false.
      !> Whether it has a load at rest at all.
      logical :: is_loaded = .true.
      !> Motions, and those that normals hold.
      integer :: n_motions = 0, n_by_normals = 0
   end type body_hold

   !> Nodes that springs tie to a body, at most.
   integer, parameter :: most_nodes = 300
   !> Directions of friction of a pair with two.
   integer, parameter :: n_directions = 16
   !> Part of the stiffness that round-off leaves, and part of a load that is balanced.
   real(wp), parameter :: round_off = 1.0e-9_wp, balanced = 1.0e-8_wp

contains

   !> Refuse bodies whose load no forces of friction can balance.
   subroutine check_bodies(case, error)
      class(body_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      type(body_hold) :: hold
      integer :: i

      if (.not. allocated(case%bodies)) return
      do i = 1, case%bodies%count()
         call find_hold(case, i, hold)
         if (hold%has_springs) cycle
         if (.not. any(hold%touches)) then
            call fatal_error(error, 'body '//case%bodies%name(i)%text//' (number '//to_text(i)// &
                             ' of /body) touches nothing: its dofs must be in the rows of a '// &
                             'contact pair, or in a stiffness', status_input)
         else if (.not. hold%can_stand) then
            call fatal_error(error, 'body '//case%bodies%name(i)%text//': friction and angle '// &
                             'cannot hold it: no contact forces balance its load at rest; take '// &
                             'another angle, a higher contact%mu, or a load that presses it '// &
                             'against its flanks', status_input)
         else
            cycle
         end if
         return
      end do
   end subroutine check_bodies

   !> The body that each pair of a sector touches, of those that springs do not hold; 0 for none.
   subroutine pairs_of_bodies(case, body_of_pair)
      class(body_type), intent(in) :: case
      integer, allocatable, intent(out) :: body_of_pair(:)
      type(body_hold) :: hold
      integer :: i

      allocate (body_of_pair(case%contact%n_pairs/case%model%cyclic%n_solved()), source=0)
      if (.not. allocated(case%bodies)) return
      do i = 1, case%bodies%count()
         call find_hold(case, i, hold)
         if (hold%has_springs) cycle
         where (hold%touches) body_of_pair = i
      end do
   end subroutine pairs_of_bodies

   !> Which observed quantities show bodies alone that springs do not hold: their own motions have
   !> no damping.
   function are_of_bodies(case) result(are)
      class(body_type), intent(in) :: case
      logical, allocatable :: are(:)
      real(wp), allocatable :: motion(:, :)
      logical :: has_springs, is_body(case%model%n_dof)
      integer :: i, n

      n = size(case%model%observe_matrix, 1)
      allocate (are(case%model%n_observed()), source=.false.)
      if (.not. allocated(case%bodies)) return
      is_body = .false.
      do i = 1, case%bodies%count()
         call find_motion(case, pack(case%bodies%dof(:, i), case%bodies%dof(:, i) /= 0), motion, &
                          has_springs)
         if (.not. has_springs) is_body = is_body .or. any(abs(motion) > 0.0_wp, dim=2)
      end do
      do i = 1, size(are)
         associate (row => abs(case%model%observe_matrix(modulo(i - 1, n) + 1, :)) > 0.0_wp)
            are(i) = any(row) .and. .not. any(row .and. .not. is_body)
         end associate
      end do
   end function are_of_bodies

   !> What holds one body: springs, or pairs, whose forces have to carry its load.
   subroutine find_hold(case, number, hold)
      class(body_type), intent(in) :: case
      !> Of the body.
      integer, intent(in) :: number
      type(body_hold), intent(out) :: hold
      real(wp), allocatable :: motion(:, :), load(:)
      real(wp), allocatable :: cone(:, :), normals(:, :), presses(:, :), extended(:, :)
      real(wp) :: left
      integer :: n, n_press

      allocate (hold%touches(case%contact%n_pairs/case%model%cyclic%n_solved()), source=.false.)
      call find_motion(case, pack(case%bodies%dof(:, number), case%bodies%dof(:, number) /= 0), &
                       motion, hold%has_springs)
      if (hold%has_springs) return
      hold%n_motions = size(motion, 2)
      call list_forces(case, motion, hold%touches, cone, normals, n_press)
      hold%n_by_normals = rank_of(normals)
      load = matmul(static_load(case), motion)
      hold%is_loaded = any(abs(load) > 0.0_wp) .or. allocated(case%model%cyclic%speed)
      ! A speed that follows the frequency, and so the load.
      if (allocated(case%model%cyclic%speed)) load = 0.0_wp
      call nearest_in_cone(cone, load, left)
      hold%can_stand = left <= balanced
      ! Forces of pairs that press, without a load: their sum is 1.
      n = size(motion, 2)
      presses = cone(:, :n_press)
      allocate (extended(n + 1, n_press), source=1.0_wp)
      extended(:n, :) = presses
      if (n_press == 0) return
      call nearest_in_cone(extended, [0.0_wp*load, 1.0_wp], left)
      hold%locks_itself = left <= balanced
   end subroutine find_hold

   !> Motions of all dofs with those of the body, nodes without load that springs tie to it.
   subroutine find_motion(case, dofs, motion, has_springs)
      class(body_type), intent(in) :: case
      integer, intent(in) :: dofs(:)
      real(wp), allocatable, intent(out) :: motion(:, :)
      logical, intent(out) :: has_springs
      type(lu_type) :: lu
      real(wp), allocatable :: held(:, :)
      logical, allocatable :: is_tied(:), is_body(:)
      integer, allocatable :: node(:), term(:)
      real(wp), allocatable :: weight(:)
      logical :: singular
      integer :: i, j, n_before

      associate (k => case%model%stiffness, n => case%model%n_dof)
         allocate (motion(n, size(dofs)), is_tied(n), is_body(n))
         motion = 0.0_wp
         do j = 1, size(dofs)
            motion(dofs(j), j) = 1.0_wp
         end do
         is_body = .false.
         is_body(dofs) = .true.
         is_tied = is_body
         do
            n_before = count(is_tied)
            do i = 1, n
               if (.not. is_tied(i)) cycle
               is_tied = is_tied .or. abs(k(:, i)) > 0.0_wp
            end do
            has_springs = count(is_tied) > most_nodes
            if (has_springs) return
            if (count(is_tied) == n_before) exit
         end do
         node = pack([(i, i=1, n)], is_tied .and. .not. is_body)
         if (size(node) > 0) then
            call lu%reserve(size(node))
            lu%matrix = k(node, node)
            call lu%factor(singular)
            has_springs = singular
            if (singular) return
            do j = 1, size(dofs)
               associate (answer => -k(node, dofs(j)))
                  motion(node, j) = answer
               end associate
               call solve_column(lu, node, motion(:, j))
            end do
         end if
         held = matmul(transpose(motion), matmul(k, motion))
         has_springs = any(abs(held) > round_off*maxval([abs(k(dofs, dofs)), tiny(1.0_wp)]))
         do i = 1, case%springs%n_springs/case%model%cyclic%n_solved()
            call terms_of(case%springs%side_1(i), term, weight, case%model%rows)
            has_springs = has_springs .or. any(is_tied(term))
            call terms_of(case%springs%side_2(i), term, weight, case%model%rows)
            has_springs = has_springs .or. any(is_tied(term))
         end do
      end associate
   end subroutine find_motion

   subroutine solve_column(lu, node, column)
      type(lu_type), intent(inout) :: lu
      integer, intent(in) :: node(:)
      real(wp), intent(inout) :: column(:)
      real(wp) :: values(size(node))

      values = column(node)
      call lu%solve(values)
      column(node) = values
   end subroutine solve_column

   !> Loads of harmonic 0 (n_dof).
   pure function static_load(case) result(load)
      class(body_type), intent(in) :: case
      real(wp) :: load(case%model%n_dof)

      if (case%model%cyclic%has_nodal()) then
         load = 0.0_wp
         associate (nodal => case%model%cyclic%nodal(1))
            if (allocated(nodal%load)) load = real(nodal%load(:size(load), 1), wp)
         end associate
      else
         load = case%model%load_static
      end if
   end function static_load

   !> Forces of the pairs on the motions: columns of which all that is possible is a sum with
   !> factors from 0; those of pairs that press stand first. And the normals.
   subroutine list_forces(case, motion, touches, cone, normals, n_press)
      class(body_type), intent(in) :: case
      real(wp), intent(in) :: motion(:, :)
      logical, intent(inout) :: touches(:)
      real(wp), allocatable, intent(out) :: cone(:, :), normals(:, :)
      integer, intent(out) :: n_press
      real(wp) :: row(size(motion, 2), 3), whole(case%model%n_dof), angle, reach
      real(wp), allocatable :: press(:, :), slide(:, :)
      logical :: there(3)
      integer :: c, i, k, n, p, s

      n = size(motion, 2)
      allocate (press(n, n_directions*size(touches)), slide(n, 4*size(touches)))
      allocate (normals(n, size(touches)), source=0.0_wp)
      p = 0
      s = 0
      associate (contact => case%contact)
         do i = 1, size(touches)
            do c = 1, 3
               whole = 0.0_wp
               call add_side(contact%side_1(c, i), 1.0_wp, whole, case%model%rows)
               call add_side(contact%side_2(c, i), -1.0_wp, whole, case%model%rows)
               row(:, c) = matmul(whole, motion)
               there(c) = maxval(abs(row(:, c))) > 0.0_wp
            end do
            touches(i) = any(there)
            if (.not. touches(i)) cycle
            if (contact%side_1(3, i) == 0 .and. contact%side_2(3, i) == 0) then
               ! A constant load presses: friction of any size, which refuses less.
               do c = 1, 2
                  slide(:, s + 1) = row(:, c)
                  slide(:, s + 2) = -row(:, c)
                  s = s + 2
               end do
               cycle
            end if
            normals(:, i) = row(:, 3)
            if (.not. contact%mu(i) > 0.0_wp .or. .not. any(there(:2))) then
               p = p + 1
               press(:, p) = -row(:, 3)
            else if (all(there(:2))) then
               reach = contact%mu(i)/cos(pi/n_directions)
               do k = 1, n_directions
                  angle = 2.0_wp*pi*k/n_directions
                  p = p + 1
                  press(:, p) = reach*(cos(angle)*row(:, 1) + sin(angle)*row(:, 2)) - row(:, 3)
               end do
            else
               do k = -1, 1, 2
                  p = p + 1
                  press(:, p) = k*contact%mu(i)*(row(:, 1) + row(:, 2)) - row(:, 3)
               end do
            end if
         end do
      end associate
      n_press = p
      allocate (cone(n, p + s))
      cone(:, :p) = press(:, :p)
      cone(:, p + 1:) = slide(:, :s)
   end subroutine list_forces

end module fw_held_bodies
